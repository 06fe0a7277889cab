//! Measurements from standard input, a row out for each.

use super::input::{refused, unidentified, warn_of};
use super::outcome::{component, track_row};
use super::settings::{Settings, refused as refused_by_model};
use super::work::Workers;
use super::{Call, Folder, Record, State};
use crate::Exit;
use crate::diagnostic::Diagnostic;
use crate::run::{EstimatesDigest, Hashing, interrupted, listen};
use std::collections::BTreeSet;
use std::io::{BufReader, ErrorKind};
use zerre::track::{Event, Plot, Reading};
use zerre_io::{TableReader, TrackCsv};

/// So many measurements are read before the first row leaves, where noises have to be learnt from them.
const LEARNT_FROM: usize = 200;

pub(super) fn run(call: &Call<'_>, mut settings: Settings, workers: &Workers) -> Result<Exit, Diagnostic> {
    let folder = Folder::open(&call.destination(), "track")?;
    listen()?;
    let mut hashing = Hashing::new(std::io::stdin().lock());
    let mut reader = TableReader::new("standard input", BufReader::new(&mut hashing), &settings.options)
        .map_err(|error| settings.refused_by_reader(&error))?;
    warn_of(call.console, "standard input", reader.ignored());
    let next = |reader: &mut TableReader<_>| -> Result<Option<Plot>, Diagnostic> {
        let Some(plot) = reader.next().transpose().map_err(|error| refused(&error))? else {
            return Ok(None);
        };
        match plot.id {
            _ if call.args.single => Ok(Some(Plot { id: None, ..plot })),
            None => Err(unidentified("standard input", plot.line, reader.ignored())),
            Some(_) => Ok(Some(plot)),
        }
    };

    settings.sensors()?;
    let mut waiting = Vec::new();
    while waiting.len() < LEARNT_FROM && !interrupted() {
        let Some(plot) = next(&mut reader)? else { break };
        waiting.push(plot);
        if settings.unknown(&waiting).is_empty() {
            break;
        }
    }
    if waiting.is_empty() {
        return Err(Diagnostic::new("standard input: no row holds a measurement"));
    }
    if waiting.iter().any(|plot| matches!(plot.reading, Reading::RangeBearingElevation(_))) {
        let text = "standard input: elevations need three dimensions, which a stream is not read in";
        return Err(Diagnostic::new(text).help("write the measurements to a file, and track that"));
    }
    waiting.sort_by_key(|plot| plot.time);
    settings.settle(&waiting, "standard input", false, call.console)?;
    if call.global.explain {
        call.console.info(&settings.effective);
    }

    let mut tracker = settings
        .spec(call.global.seed)
        .build(workers.engine(1)?)
        .map_err(|error| refused_by_model("standard input", &error))?;
    let components: Vec<_> = tracker.states().into_iter().map(component).collect();
    let mut record = Record::new("track", call.global.seed, settings.effective.to_json());
    let mut digest = EstimatesDigest::default();
    let (stdout, modes) = (std::io::stdout().lock(), tracker.modes().to_vec());
    let made = if modes.is_empty() {
        TrackCsv::new(stdout, &components)
    } else {
        TrackCsv::with_modes(stdout, &components)
    };
    let mut out = match made {
        Ok(out) => Some(out),
        Err(error) => return Err(unwritten(&error)),
    };
    let (mut rows, mut rows_read, mut line, mut degraded) = (0_u64, 0_u64, 0, false);
    let mut sensors = BTreeSet::new();
    let mut waiting = waiting.into_iter();
    while !interrupted() && out.is_some() {
        let plot = match waiting.next() {
            Some(plot) => plot,
            None => match next(&mut reader)? {
                Some(plot) => plot,
                None => break,
            },
        };
        if let Some(name) = plot.sensor.as_deref().filter(|name| !sensors.contains(*name)) {
            sensors.insert(name.to_owned());
        }
        let row = tracker
            .push(&plot)
            .map_err(|error| refused_by_model(&format!("standard input, line {}", plot.line), &error))?;
        degraded |= matches!(row.event, Event::Degenerate | Event::Restarted);
        if !matches!(row.event, Event::Started | Event::Updated) {
            record.outcomes_of(row.event.name(), "see outcome in the rows", 1);
        }
        if let (Some(row), Some(stdout)) = (track_row(&row, &modes), &mut out) {
            match stdout.write(&row) {
                Ok(()) => digest.push(&row.mean),
                // The reader of the rows has had enough, which is its right; this row did not reach it.
                Err(zerre_io::Error::Write { source, .. }) if source.kind() == ErrorKind::BrokenPipe => {
                    out = None;
                    continue;
                }
                Err(zerre_io::Error::Write { source, .. }) => return Err(unwritten(&source)),
                Err(error) => return Err(Diagnostic::new(error.to_string())),
            }
        }
        rows += 1;
        // The readings of a row follow each other.
        rows_read += u64::from(plot.line != line);
        line = plot.line;
    }
    let counts = reader.counts().clone();
    if out.is_some() && !interrupted() {
        reader.finish().map_err(|error| settings.refused_by_reader(&error))?;
        for name in settings.idle_sensors(&sensors) {
            call.console.warn(format_args!("sensor.{name}: no measurement was of a sensor of this name"));
            record.outcome("sensor-without-measurements", "its settings had no effect");
        }
    } else {
        drop(reader);
        record.state = State::Interrupted;
    }
    record.counts.read = counts.read;
    record.counts.used = counts.used;
    record.counts.missing = counts.missing;
    record.counts.rejected = counts.rejected.into_iter().map(|(why, n)| (why.to_owned(), n)).collect();
    record.counts.left_out = counts.left_out.into_iter().map(|(why, n)| (why.to_owned(), n)).collect();
    if record.state == State::Interrupted {
        record.counts.stop_at(rows_read);
    }
    record.input = vec![hashing.so_far("-")];
    record.estimates_digest = Some(digest.finish());
    record.seconds = call.since.elapsed().as_secs_f64();
    let path = folder.finish(&record)?;
    call.console.info(format_args!("{rows} measurements tracked; record in {}", path.display()));
    if interrupted() {
        call.console.warn("stopped before the end: what is written is complete as far as it goes");
        return Ok(Exit::CouldNot);
    }
    Ok(if call.args.strict && degraded { Exit::Degraded } else { Exit::Done })
}

fn unwritten(error: &std::io::Error) -> Diagnostic {
    Diagnostic::new(format!("cannot write to standard output: {error}"))
}
