//! The recordings: read, merged, checked.

use super::Call;
use super::labels::{self, Named};
use super::settings::Settings;
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::{Counts, Hashing, Input as File};
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use zerre::track::{Plot, Reading};
use zerre_io::{Ignored, LocalFrame, Options, Recording, Rejection};

/// Everything that was read.
pub(super) struct Input {
    /// In order of time.
    pub plots: Vec<Plot>,
    /// Of extended targets: the points of the scan that each plot stands for.
    pub points: Vec<Vec<[f64; 2]>>,
    /// Which of `files` each plot is from.
    pub file_of: Vec<usize>,
    /// Names of the frames, where each file is one.
    pub scenes: Vec<String>,
    /// Place of each file in `scenes`.
    pub scene_of_file: Vec<Option<usize>>,
    /// What others say of the objects in the frames.
    pub labels: Vec<Named>,
    pub files: Vec<File>,
    pub counts: Counts,
    pub rejections: Vec<Rejection>,
    /// Where the plane touches the earth, if that is known.
    pub frame: Option<LocalFrame>,
    pub out_of_order: u64,
    pub repeated: u64,
    pub has_height: bool,
}

impl Input {
    /// Where a plot was read, for messages.
    pub fn place(&self, plot: usize) -> String {
        match (self.plots.get(plot), self.file_of.get(plot).and_then(|&file| self.files.get(file))) {
            (Some(plot), Some(file)) => format!("{}, line {}", said(Path::new(&file.path)), plot.line),
            _ => self.names(),
        }
    }

    /// The files, for messages: the first few by name.
    pub fn names(&self) -> String {
        const NAMED: usize = 3;
        let named: Vec<_> = self.files.iter().take(NAMED).map(|file| said(Path::new(&file.path))).collect();
        match self.files.len().saturating_sub(NAMED) {
            0 => named.join(", "),
            more => format!("{} and {more} more", named.join(", ")),
        }
    }
}

/// A refusal of a reader.
pub(super) fn refused(error: &zerre_io::Error) -> Diagnostic {
    use zerre_io::Error::{Empty, FormatMismatch, NoHeight, NoMeasurement, NoTime, TooManyRejected};
    let diagnostic = Diagnostic::new(error.to_string());
    match error {
        TooManyRejected { .. } => diagnostic.help("mend the rows, or raise max_rejected under [input]"),
        FormatMismatch { .. } => diagnostic.help("leave --format out: the format is told from the header"),
        NoTime { .. } | NoMeasurement { .. } | Empty { .. } => {
            diagnostic.help("`zerre track --help` shows what a table looks like")
        }
        NoHeight { .. } => diagnostic.help("elevations are measured, so that all is in three dimensions"),
        _ => diagnostic,
    }
}

pub(super) fn read(call: &Call<'_>, settings: &Settings) -> Result<Input, Diagnostic> {
    let paths = &call.args.inputs;
    distinct(paths)?;
    let texts = paths.iter().map(|path| whole(path)).collect::<Result<Vec<_>, _>>()?;
    let parse = |three_d| parse(settings, paths, &texts, Options { three_d, ..settings.options.clone() });
    // Heights count where elevations are measured: a slant range needs them.
    let in_space = |plot: &Plot| matches!(plot.reading, Reading::RangeBearingElevation(_));
    let flat = parse(false)?;
    let has_height = flat.iter().any(|recording| recording.plots.iter().any(in_space));
    let recordings = if has_height { parse(true)? } else { flat };
    if settings.options.origin.is_none() {
        one_plane(paths, &recordings)?;
    }

    let mut input = Input {
        plots: Vec::new(),
        file_of: Vec::new(),
        scenes: Vec::new(),
        scene_of_file: Vec::new(),
        labels: Vec::new(),
        points: Vec::new(),
        files: texts.into_iter().map(|(_, file)| file).collect(),
        counts: Counts::default(),
        rejections: Vec::new(),
        frame: None,
        out_of_order: 0,
        repeated: 0,
        has_height,
    };
    let mut recordings: Vec<(usize, Recording)> = recordings.into_iter().enumerate().collect();
    labels::take(settings, paths, &mut recordings, &mut input)?;
    let sensors = sensor_names(paths);
    // Points without any identity are of one extended target; some of them without are of nobody knows which.
    let named =
        || recordings.iter().any(|(_, recording)| recording.plots.iter().any(|plot| plot.id.is_some()));
    let single = call.args.single || settings.extended.is_some() && !named();
    let mut plots: Vec<(usize, Plot)> = Vec::new();
    for (file, recording) in recordings {
        let name = said(&paths[file]);
        warn_of(call.console, &name, &recording.summary.ignored);
        for mut plot in recording.plots {
            // A frame is no sensor.
            if paths.len() > 1 && plot.sensor.is_none() && input.scene_of_file[file].is_none() {
                plot.sensor = Some(Arc::clone(&sensors[file]));
            }
            if single {
                plot.id = None;
            } else if plot.id.is_none() {
                return Err(unidentified(&name, plot.line, &recording.summary.ignored));
            }
            plots.push((file, plot));
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
        input.frame = input.frame.or(recording.summary.frame);
    }
    if plots.is_empty() {
        let text = format!("{}: no row is of an object", input.names());
        return Err(Diagnostic::new(text).help("tables of labelled boxes go with the points of their frames"));
    }
    let sized = || plots.iter().any(|(_, plot)| matches!(plot.reading, Reading::Size(_)));
    if settings.options.sizes && !sized() {
        let text = "no row holds a size, and without one nothing is known of a box";
        let help = "give length_m, width_m and orientation_deg or heading_deg, or another motion";
        return Err(Diagnostic::new(text).help(help));
    }
    // Stable: plots of one time keep the order of the inputs.
    plots.sort_by_key(|(_, plot)| plot.time);
    (input.file_of, input.plots) = plots.into_iter().unzip();
    if settings.extended.is_some() {
        input.gather()?;
    }
    Ok(input)
}

/// Refuses a recording that is named twice: its measurements would count for two.
fn distinct(paths: &[PathBuf]) -> Result<(), Diagnostic> {
    let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let twice = (1..paths.len()).find(|&i| paths[..i].iter().any(|other| real(other) == real(&paths[i])));
    match twice {
        Some(i) => Err(Diagnostic::usage(format!("{} is given twice", paths[i].display()))),
        None => Ok(()),
    }
}

/// Reads the tables. Later recordings join the plane of the first.
fn parse(
    settings: &Settings,
    paths: &[PathBuf],
    texts: &[(Vec<u8>, File)],
    mut options: Options,
) -> Result<Vec<Recording>, Diagnostic> {
    let mut recordings = Vec::with_capacity(texts.len());
    let mut frame: Option<LocalFrame> = None;
    for (path, (bytes, _)) in paths.iter().zip(texts) {
        let name = said(path);
        let mut recording = Recording::read(&name, BufReader::new(&bytes[..]), &options)
            .map_err(|error| settings.refused_by_reader(&error))?;
        if recording.summary.labels {
            recording = labels::with_sizes(&name, bytes, &options)?;
        }
        // A frame may have no object in it.
        if recording.plots.is_empty() && recording.summary.format != zerre_io::Format::Nuscenes {
            let text = format!("{name}: no row holds a measurement");
            return Err(Diagnostic::new(text).help("`zerre track --help` shows what a table looks like"));
        }
        if let (Some(ours), Some(theirs)) = (&frame, &recording.summary.frame)
            && ours.origin() != theirs.origin()
        {
            let text =
                format!("{name}: its plane touches the earth elsewhere than that of the recordings before");
            return Err(
                Diagnostic::new(text).help("give one origin for all under [input], or track them one by one")
            );
        }
        frame = frame.or_else(|| recording.summary.frame.clone());
        options.origin = options.origin.or(frame.as_ref().map(LocalFrame::origin));
        recordings.push(recording);
    }
    Ok(recordings)
}

/// Refuses places on the earth together with places in a plane that lies nobody knows where.
fn one_plane(paths: &[PathBuf], recordings: &[Recording]) -> Result<(), Diagnostic> {
    let find = |geographic| recordings.iter().position(|r| r.summary.geographic == geographic);
    let (Some(earth), Some(plane)) = (find(true), find(false)) else { return Ok(()) };
    let text = format!(
        "{} gives places on the earth, {} in a plane of its own: how the two lie is not known",
        said(&paths[earth]),
        said(&paths[plane])
    );
    Err(Diagnostic::new(text).help("give the `origin` of the plane under [input]"))
}

/// A name for the sensor of each file, where its rows have none: the name of the file, or its path where two files
/// have one name.
fn sensor_names(paths: &[PathBuf]) -> Vec<Arc<str>> {
    let stem = |path: &PathBuf| path.file_stem().unwrap_or(path.as_os_str()).to_owned();
    let mut times: BTreeMap<_, usize> = BTreeMap::new();
    for path in paths {
        *times.entry(stem(path)).or_default() += 1;
    }
    let name = |path: &PathBuf| match stem(path) {
        stem if times.get(&stem) == Some(&1) => Arc::from(stem.to_string_lossy()),
        _ => Arc::from(path.to_string_lossy()),
    };
    paths.iter().map(name).collect()
}

/// An input as messages name it.
fn said(path: &Path) -> String {
    if path.as_os_str() == OsStr::new("-") { "standard input".to_owned() } else { path.display().to_string() }
}

/// Says which columns are not read: each of the first few once.
pub(super) fn warn_of(console: &Console, name: &str, ignored: &[Ignored]) {
    const SAID: usize = 10;
    for column in ignored.iter().take(SAID) {
        let hint = column.did_you_mean.map_or(String::new(), |name| format!("; did you mean {name}?"));
        console.warn(format_args!("{name}: the column {:?} is not read{hint}", column.column));
    }
    if ignored.len() > SAID {
        console.warn(format_args!("{name}: nor are {} more columns", ignored.len() - SAID));
    }
}

pub(super) fn unidentified(name: &str, line: u64, ignored: &[Ignored]) -> Diagnostic {
    let diagnostic = Diagnostic::new(format!(
        "{name}, line {line}: the measurement has no `id`, so which target it is of is not known, \
         and association does not exist yet"
    ));
    let diagnostic = match ignored.iter().find(|column| column.did_you_mean == Some("id")) {
        Some(column) => {
            diagnostic.help(format!("the column {:?} is not read; did you mean id?", column.column))
        }
        None => diagnostic,
    };
    diagnostic.help("give a column `id`, or --single if all measurements are of one target")
}

/// Refuses a file that cannot be read later, before the work. It is not opened: a pipe can be read only once.
pub(super) fn is_there(path: &Path) -> Result<(), Diagnostic> {
    let unreadable = |error| Diagnostic::io("read", path, &error);
    if std::fs::metadata(path).map_err(unreadable)?.is_dir() {
        return Err(unreadable(std::io::ErrorKind::IsADirectory.into()));
    }
    Ok(())
}

/// A whole file, and what `run.json` says of it.
pub(super) fn whole(path: &Path) -> Result<(Vec<u8>, File), Diagnostic> {
    let shown = said(path);
    let unreadable = |error| Diagnostic::io("read", Path::new(&shown), &error);
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
