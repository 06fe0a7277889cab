//! The recordings: read, merged, checked.

use super::Call;
use super::settings::Settings;
use crate::diagnostic::Diagnostic;
use crate::run::{Counts, Hashing, Input as File};
use std::io::{BufReader, Read};
use std::path::Path;
use std::sync::Arc;
use zerre::track::{Plot, Reading};
use zerre_io::{LocalFrame, Options, Recording, Rejection};

/// Everything that was read.
pub(super) struct Input {
    /// In order of time.
    pub plots: Vec<Plot>,
    pub files: Vec<File>,
    pub counts: Counts,
    pub rejections: Vec<Rejection>,
    /// Where the plane touches the earth, if that is known.
    pub frame: Option<LocalFrame>,
    pub out_of_order: u64,
    pub repeated: u64,
    pub has_height: bool,
}

/// A refusal of a reader.
pub(super) fn refused(error: &zerre_io::Error) -> Diagnostic {
    use zerre_io::Error::{Empty, FormatMismatch, NoMeasurement, NoTime, TooManyRejected};
    let diagnostic = Diagnostic::new(error.to_string());
    match error {
        TooManyRejected { .. } => diagnostic.help("mend the rows, or raise max_rejected under [input]"),
        FormatMismatch { .. } => diagnostic.help("leave --format out: the format is told from the header"),
        NoTime { .. } | NoMeasurement { .. } | Empty { .. } => {
            diagnostic.help("`zerre track --help` shows what a table looks like")
        }
        _ => diagnostic,
    }
}

pub(super) fn read(call: &Call<'_>, settings: &Settings) -> Result<Input, Diagnostic> {
    let mut options = settings.options.clone();
    let mut input = Input {
        plots: Vec::new(),
        files: Vec::new(),
        counts: Counts::default(),
        rejections: Vec::new(),
        frame: None,
        out_of_order: 0,
        repeated: 0,
        has_height: false,
    };
    let several = call.args.inputs.len() > 1;
    for path in &call.args.inputs {
        let bytes = whole(path)?;
        let name = path.display().to_string();
        let recording =
            parse(&name, &bytes.0, &mut options).map_err(|error| settings.refused_by_reader(&error))?;
        if recording.plots.is_empty() {
            let text = format!("{name}: no row holds a measurement");
            return Err(Diagnostic::new(text).help("`zerre track --help` shows what a table looks like"));
        }
        if let (Some(ours), Some(theirs)) = (&input.frame, &recording.summary.frame)
            && ours.origin() != theirs.origin()
        {
            let text =
                format!("{name}: its plane touches the earth elsewhere than that of the recordings before");
            return Err(
                Diagnostic::new(text).help("give one origin for all under [input], or track them one by one")
            );
        }
        let stem: Arc<str> = Arc::from(path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy());
        for mut plot in recording.plots {
            if several && plot.sensor.is_none() {
                plot.sensor = Some(Arc::clone(&stem));
            }
            if call.args.single {
                plot.id = None;
            } else if plot.id.is_none() {
                return Err(unidentified(&name, plot.line));
            }
            input.plots.push(plot);
        }
        input.has_height |= options.three_d;
        for column in &recording.summary.ignored {
            let hint = column.did_you_mean.map_or(String::new(), |name| format!("; did you mean {name}?"));
            call.console.warn(format_args!("{name}: the column {:?} is not read{hint}", column.column));
        }
        let counts = recording.summary.counts;
        input.counts.read += counts.read;
        input.counts.used += counts.used;
        input.counts.missing += counts.missing;
        for (reason, count) in counts.rejected {
            *input.counts.rejected.entry(reason.to_owned()).or_default() += count;
        }
        for (reason, count) in counts.left_out {
            *input.counts.left_out.entry(reason.to_owned()).or_default() += count;
        }
        input.rejections.extend(recording.summary.rejections);
        input.out_of_order += recording.out_of_order;
        input.repeated += recording.repeated;
        // Later recordings join the plane of the first.
        input.frame = input.frame.or(recording.summary.frame);
        options.origin = options.origin.or(input.frame.as_ref().map(LocalFrame::origin));
        input.files.push(bytes.1);
    }
    // Stable: plots of one time keep the order of the inputs.
    input.plots.sort_by_key(|plot| plot.time);
    Ok(input)
}

pub(super) fn unidentified(name: &str, line: u64) -> Diagnostic {
    Diagnostic::new(format!(
        "{name}, line {line}: the measurement has no `id`, so which target it is of is not known, \
         and association does not exist yet"
    ))
    .help("give a column `id`, or --single if all measurements are of one target")
}

/// A whole file, and what `run.json` says of it.
fn whole(path: &Path) -> Result<(Vec<u8>, File), Diagnostic> {
    let unreadable = |error| Diagnostic::io("read", path, &error);
    let name = path.display().to_string();
    let mut bytes = Vec::new();
    let file = if path == Path::new("-") {
        let mut hashing = Hashing::new(std::io::stdin().lock());
        hashing.read_to_end(&mut bytes).map_err(unreadable)?;
        hashing.finish(&name)
    } else {
        let mut hashing = Hashing::new(std::fs::File::open(path).map_err(unreadable)?);
        hashing.read_to_end(&mut bytes).map_err(unreadable)?;
        hashing.finish(&name)
    };
    Ok((bytes, file.map_err(unreadable)?))
}

/// Reads the table; heights count where elevations are measured, because a slant range needs them.
fn parse(name: &str, bytes: &[u8], options: &mut Options) -> Result<Recording, zerre_io::Error> {
    let read = |options: &Options| Recording::read(name, BufReader::new(bytes), options);
    let recording = read(options)?;
    let in_space = |plot: &Plot| matches!(plot.reading, Reading::RangeBearingElevation(_));
    if options.three_d || !recording.plots.iter().any(in_space) {
        return Ok(recording);
    }
    options.three_d = true;
    read(options)
}
