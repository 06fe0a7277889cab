//! `zerre track`: follows identified targets in recorded measurements.

mod extended;
mod input;
mod labels;
mod live;
mod outcome;
mod report;
mod scores;
mod settings;
mod work;

use crate::Exit;
use crate::args::{Global, Track};
use crate::config::{Source, TrackConfig};
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::{Destination, Folder, Record, State, interrupted, listen};
use input::Input;
use settings::Settings;
use std::path::Path;
use std::time::Instant;
use work::{Reference, Run, Workers};
use zerre::track::has_particles;
use zerre_io::write_ellipses;

/// What all parts of the command are told.
struct Call<'a> {
    args: &'a Track,
    global: &'a Global,
    console: &'a Console,
    since: Instant,
}

impl Call<'_> {
    fn destination(&self) -> Destination {
        let inputs = self.args.inputs.iter().map(|input| input.as_path());
        let others = [&self.args.config, &self.args.truth].into_iter().flatten().map(|file| file.as_path());
        Destination::of(self.global, "track", inputs.clone().next()).reading(inputs.chain(others))
    }
}

pub(super) fn run(args: &Track, global: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let call = Call { args, global, console, since: Instant::now() };
    let source = args.config.as_deref().map(Source::read).transpose()?;
    let config = match &source {
        Some(source) => TrackConfig::from_source(source)?,
        None => TrackConfig::default(),
    };
    let mut settings = Settings::new(args, source, config)?;
    let workers = Workers::new(global)?;
    let standard_input = Path::new("-");
    if args.inputs.iter().any(|input| input == standard_input) {
        if args.inputs.len() > 1 {
            return Err(Diagnostic::usage("standard input (-) cannot be read together with files"));
        }
        if args.truth.is_some() && !global.json {
            let text = "a stream is not scored: rows leave as soon as they are made";
            return Err(Diagnostic::usage(text)
                .help("leave --truth out, or give --json to read all of the input first"));
        }
        if settings.extended.is_some() && !global.json {
            let text = "extended targets are not followed row by row: their first scans tell the first shape";
            return Err(Diagnostic::usage(text).help("write the points to a file, and track that"));
        }
        if !global.json {
            return live::run(&call, settings, &workers);
        }
    }

    if let Some(truth) = &args.truth {
        input::is_there(truth)?;
    }
    // The folder first: a wrong --out is told before the work, not after it.
    let place = call.destination();
    let mut folder = Folder::open(&place, "track")?;
    listen()?;
    let input = input::read(&call, &settings)?;
    settings.check_sensors(&input.plots)?;
    settings.settle_extended(&input)?;
    let run = match &settings.extended {
        Some(extended) => extended.follow(global.seed, &input, &workers, console)?,
        None => follow_points(&mut settings, &input, &workers, &call)?,
    };
    if global.explain {
        console.info(&settings.effective);
    }
    let scores = scores::score(&call, &settings, &input, &run)?;
    let outcome = outcome::Outcome::of(&run, &input, &settings.spec(global.seed))?;

    let mut record = Record::new("track", global.seed, settings.effective.to_json());
    record.state = if interrupted() { State::Interrupted } else { State::Complete };
    record.input = input.files.clone();
    record.counts = input.counts.clone();
    if interrupted() {
        record.counts.stop_at(run.rows_followed(&input));
    }
    outcome.record(&mut record);
    let table = outcome.table(&run)?;
    let ellipses = outcome.ellipses(&run);
    record.estimates_digest = Some(outcome.digest(&table, &ellipses));
    folder.write("tracks.csv", |out| table.write_csv(out))?;
    folder.write("tracks.parquet", |out| table.write_parquet(out))?;
    if !ellipses.is_empty() {
        folder.write("shapes.csv", |out| write_ellipses(out, &ellipses))?;
    }
    if let Some(frame) = &input.frame {
        let text = table.geojson(frame).map_err(|error| Diagnostic::new(error.to_string()))?;
        folder.write("tracks.geojson", |out| std::io::Write::write_all(out, text.as_bytes()))?;
    }
    let (page, plan) = report::pages(&call, &settings, &input, &run, &outcome, &scores, &record);
    folder.write("report.html", |out| std::io::Write::write_all(out, page.as_bytes()))?;
    folder.write("plan.svg", |out| std::io::Write::write_all(out, plan.as_bytes()))?;
    record.seconds = call.since.elapsed().as_secs_f64();
    let path = folder.finish(&record)?;

    outcome.summarise(&call, &settings, &run, &input, &scores, &path.join("report.html"));
    if global.json {
        console.document(&outcome.document(&record, &run, &input, &scores))?;
    }
    let degraded = outcome.degraded();
    if interrupted() {
        console.warn("stopped before the end: what is written is complete as far as it goes");
    }
    Ok(if interrupted() {
        Exit::CouldNot
    } else if args.strict && degraded {
        Exit::Degraded
    } else {
        Exit::Done
    })
}

/// Follows targets of one measurement at a time, by the filter that is asked for or by a better one.
fn follow_points(
    settings: &mut Settings,
    input: &Input,
    workers: &Workers,
    call: &Call<'_>,
) -> Result<Run, Diagnostic> {
    let (console, seed) = (call.console, call.global.seed);
    let rivals = settings.rivals();
    settings.settle(&input.plots, &input.names(), input.has_height, console)?;
    let mut run = work::follow(&settings.spec(seed), input, workers, console)?;
    run.check_started(input)?;
    if !interrupted() && has_particles(&settings.spec(seed).filter.name) {
        match best_rival(settings, rivals, &run, input, workers, call)? {
            Some((reference, Some(mut rival), other)) if reference.is_better() => {
                rival.prefer(&reference);
                (*settings, run) = (rival, other);
            }
            Some((reference, ..)) => run.reference = Some(reference),
            None => {}
        }
    }
    Ok(run)
}

/// The filter of the Kalman family that has most evidence, with its settings where it may take the place of the
/// particles: one without modes, unless modes are worth more.
fn best_rival(
    settings: &Settings,
    rivals: Option<[Settings; 2]>,
    run: &Run,
    input: &Input,
    workers: &Workers,
    call: &Call<'_>,
) -> Result<Option<(Reference, Option<Settings>, Run)>, Diagnostic> {
    let (console, seed) = (call.console, call.global.seed);
    let settle = |rival: &mut Settings| rival.settle(&input.plots, &input.names(), input.has_height, console);
    let against = |filters, spec: &_| run.against_kalman(filters, spec, input, workers, console);
    let Some([mut plain, mut modal]) = rivals else {
        let best = against(settings.references(), &settings.spec(seed));
        return Ok(best.map(|(reference, run)| (reference, None, run)));
    };
    settle(&mut plain)?;
    let best = against(work::PLAIN, &plain.spec(seed));
    // A recording may be too short to tell three numbers more.
    if !interrupted() && settle(&mut modal).is_ok() {
        let with_modes = against(work::TRIED, &modal.spec(seed));
        if let Some((reference, run)) = with_modes
            && best.as_ref().is_none_or(|(plain, _)| reference.is_worth_its_modes(plain))
        {
            return Ok(Some((reference, Some(modal), run)));
        }
    }
    Ok(best.map(|(reference, run)| (reference, Some(plain), run)))
}
