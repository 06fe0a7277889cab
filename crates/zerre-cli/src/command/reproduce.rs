//! `zerre reproduce`: the experiments of papers, done again.

use super::experiment::{Order, conduct};
use super::unknown;
use crate::Exit;
use crate::args::{Global, Reproduce};
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::{Destination, text_digest};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use zerre::Time;
use zerre::track::Reading;
use zerre_io::{Options, Recording};
use zerre_lab::metric::LabelledBox;
use zerre_lab::paper::bayes_family::{self, BayesFamily};
use zerre_lab::paper::extended_target::recorded::{Object, Recordings};
use zerre_lab::paper::extended_target::{self, ExtendedTarget};
use zerre_lab::paper::multi_ball::{self, MultiBall};
use zerre_lab::paper::multiple_model::settings::{NOISES, Setting};
use zerre_lab::paper::multiple_model::{self, Asked, MultipleModel, Request};
use zerre_lab::paper::rgbd::{self, Recordings as RgbdRecordings, RgbdFusion};
use zerre_lab::paper::swarm::dimensions::Dimensions;
use zerre_lab::paper::swarm::{self, SwarmFilters};
use zerre_lab::paper::video::{self, VideoTrackers};
use zerre_lab::paper::{PAPERS, Paper};
use zerre_lab::study::experiment::{Experiment, SettingsFile};
use zerre_vision::sequence::Sequence;

const COMMAND: &str = "reproduce";

pub(super) fn run(args: &Reproduce, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let Some(name) = &args.paper else { return list(console) };
    let names: Vec<_> = PAPERS.iter().map(|paper| paper.name).collect();
    if !names.contains(&name.as_str()) {
        return Err(unknown("paper", name, &names));
    }
    if name == bayes_family::PAPER.name {
        bayes_family(args, options, console)
    } else if name == extended_target::PAPER.name {
        extended_target(args, options, console)
    } else if name == swarm::PAPER.name {
        swarm(args, options, console)
    } else if name == video::PAPER.name {
        video(args, options, console)
    } else if name == multi_ball::PAPER.name {
        multi_ball(args, options, console)
    } else if name == rgbd::PAPER.name {
        rgbd(args, options, console)
    } else {
        multiple_model(args, options, console)
    }
}

/// Computes the experiments of a paper; `config` is what they depend on beside the seed.
fn reproduce<E: Experiment>(
    paper: &Paper,
    experiment: &E,
    settings: SettingsFile,
    (runs, mut config): (usize, Value),
    (args, options): (&Reproduce, &Global),
    console: &Console,
) -> Result<Exit, Diagnostic> {
    config["paper"] = paper.name.into();
    config["runs"] = runs.into();
    config["settings_sha256"] = text_digest(settings.text).into();
    let order = Order {
        command: COMMAND,
        line: command_line(paper, args, options),
        config,
        explanation: "the report says what the source leaves open and how it is read",
        inputs: Vec::new(),
        destination: Destination::of(options, COMMAND, Some(Path::new(paper.name))),
        settings: Some(settings),
        document: [("paper".to_owned(), paper.name.into()), ("runs".to_owned(), runs.into())]
            .into_iter()
            .collect(),
    };
    conduct(experiment, order, options, console, |_, _| Ok(()))
}

fn list(console: &Console) -> Result<Exit, Diagnostic> {
    if console.json() {
        let papers = PAPERS
            .iter()
            .map(|p| json!({ "name": p.name, "about": p.about, "source": p.source, "tables": p.tables, "on_request": p.on_request }));
        console.document(&json!({ "papers": papers.collect::<Vec<_>>() }))?;
        return Ok(Exit::Done);
    }
    let mut text = String::new();
    for paper in PAPERS {
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{}  {}\n  {}\n  tables: {}",
            paper.name,
            paper.about,
            paper.source,
            paper.tables.join(" ")
        );
        if !paper.on_request.is_empty() {
            let _ = writeln!(text, "  only on request: {}", paper.on_request.join(" "));
        }
    }
    console.result(&text)?;
    Ok(Exit::Done)
}

fn request(args: &Reproduce) -> Result<Request, Diagnostic> {
    let mut request = Request::new(args.quick);
    if !args.table.is_empty() {
        request.tables = args
            .table
            .iter()
            .map(|name| {
                Asked::named(name).ok_or_else(|| unknown("table", name, multiple_model::PAPER.tables))
            })
            .collect::<Result<_, _>>()?;
        request.tables.sort_unstable();
        request.tables.dedup();
    }
    if let Some(runs) = args.runs {
        request.runs = runs.get() as usize;
        request.paired_runs = request.paired_runs.max(request.runs);
        if args.quick {
            request.paired_runs = request.runs;
        }
    }
    if !args.particles.is_empty() {
        request.particles = args.particles.iter().map(|n| n.get() as usize).collect();
        request.particles.sort_unstable();
        request.particles.dedup();
    }
    Ok(request)
}

fn multiple_model(args: &Reproduce, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let request = request(args)?;
    let settings = [Setting::Reference, Setting::Tuned, Setting::Default, Setting::Matched]
        .map(|setting| (setting.name(), setting.assumed()));
    let config = json!({
        "tables": request.tables.iter().map(|table| format!("{table:?}")).collect::<Vec<_>>(),
        "paired_runs": request.paired_runs,
        "particles": request.particles,
        "noises": NOISES,
        "settings": BTreeMap::from(settings),
    });
    let runs = request.runs;
    let experiment = MultipleModel::new(request, options.seed);
    let what = (runs, config);
    reproduce(&multiple_model::PAPER, &experiment, multiple_model::SETTINGS, what, (args, options), console)
}

fn bayes_family(args: &Reproduce, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let paper = &bayes_family::PAPER;
    let mut request = bayes_family::Request::new(args.quick);
    if !args.table.is_empty() {
        let worlds = |name: &String| {
            bayes_family::Request::worlds_of(name).ok_or_else(|| unknown("table", name, paper.tables))
        };
        request.worlds = args.table.iter().map(worlds).collect::<Result<Vec<_>, _>>()?.concat();
        request.worlds.sort_unstable();
        request.worlds.dedup();
    }
    if let Some(runs) = args.runs {
        request.runs = runs.get() as usize;
    }
    if !args.particles.is_empty() {
        request.budgets = args.particles.iter().map(|n| n.get() as usize).collect();
        request.budgets.sort_unstable();
        request.budgets.dedup();
    }
    let config = json!({ "worlds": request.worlds, "budgets": request.budgets });
    let what = (request.runs, config);
    let experiment =
        BayesFamily::new(request, options.seed).map_err(|error| Diagnostic::new(error.to_string()))?;
    reproduce(paper, &experiment, bayes_family::SETTINGS, what, (args, options), console)
}

fn extended_target(args: &Reproduce, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let paper = &extended_target::PAPER;
    let mut request = extended_target::Request::new(args.quick);
    if !args.table.is_empty() {
        let known = |name: &String| {
            let table = paper.tables.iter().find(|table| **table == name.as_str());
            table.copied().ok_or_else(|| unknown("table", name, paper.tables))
        };
        request.tables = args.table.iter().map(known).collect::<Result<_, _>>()?;
    }
    if let Some(runs) = args.runs {
        request.runs = runs.get() as usize;
    }
    match args.particles[..] {
        [] => {}
        [particles] => request.particles = particles.get() as usize,
        _ => {
            let what = format!("{} takes one number of particles, not several", paper.name);
            return Err(Diagnostic::usage(what));
        }
    }
    let config = json!({ "tables": request.tables, "particles": request.particles });
    let what = (request.runs, config);
    let recordings = recordings(args.data.as_deref())?;
    let experiment = ExtendedTarget::new(request, recordings, options.seed);
    reproduce(paper, &experiment, extended_target::SETTINGS, what, (args, options), console)
}

/// The table of swarm filters that is an experiment of its own.
const DIMENSIONS: &str = "dimensions";

fn dimensions(args: &Reproduce, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    if args.table.len() > 1 {
        let what = format!("the table {DIMENSIONS} is an experiment of its own, apart from the others");
        return Err(Diagnostic::usage(what).help("ask for it alone"));
    }
    let runs = args.runs.map(|runs| runs.get() as usize);
    let experiment = Dimensions::new(runs, args.quick, options.seed);
    let what = (experiment.runs(), json!({ "tables": [DIMENSIONS] }));
    reproduce(&swarm::PAPER, &experiment, swarm::dimensions::SETTINGS, what, (args, options), console)
}

fn swarm(args: &Reproduce, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let paper = &swarm::PAPER;
    if !args.particles.is_empty() {
        let what = format!("{} has filters of many sizes, which --particles does not change", paper.name);
        return Err(Diagnostic::usage(what).help("leave it out"));
    }
    if args.table.iter().any(|table| table == DIMENSIONS) {
        return dimensions(args, options, console);
    }
    let mut request = swarm::Request::new(args.quick);
    if !args.table.is_empty() {
        let names: Vec<_> = paper.tables.iter().chain(paper.on_request).copied().collect();
        let known = |name: &String| swarm::Request::table(name).ok_or_else(|| unknown("table", name, &names));
        request.tables = args.table.iter().map(known).collect::<Result<_, _>>()?;
    }
    if let Some(runs) = args.runs {
        request.runs = runs.get() as usize;
    }
    let config = json!({ "tables": request.tables });
    let what = (request.runs, config);
    let experiment = SwarmFilters::new(request, options.seed);
    reproduce(paper, &experiment, swarm::SETTINGS, what, (args, options), console)
}

fn video(args: &Reproduce, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let paper = &video::PAPER;
    if !args.particles.is_empty() {
        let what = format!("the trackers of {} have the particles that they have", paper.name);
        return Err(Diagnostic::usage(what).help("leave --particles out"));
    }
    let mut request = video::Request::new(args.quick);
    if !args.table.is_empty() {
        let known = |name: &String| {
            let table = paper.tables.iter().find(|table| **table == name.as_str());
            table.copied().ok_or_else(|| unknown("table", name, paper.tables))
        };
        request.tables = args.table.iter().map(known).collect::<Result<_, _>>()?;
    }
    if let Some(runs) = args.runs {
        request.runs = runs.get() as usize;
    }
    let (runs, tables) = (request.runs, request.tables.clone());
    let sequences = sequences(args.data.as_deref())?;
    let experiment = VideoTrackers::new(request, sequences, options.seed)
        .map_err(|error| Diagnostic::new(error.to_string()))?;
    let config = json!({ "tables": tables, "sequences": experiment.sequences() });
    reproduce(paper, &experiment, video::SETTINGS, (runs, config), (args, options), console)
}

fn multi_ball(args: &Reproduce, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let paper = &multi_ball::PAPER;
    let mut request = multi_ball::Request::new(args.quick);
    if !args.table.is_empty() {
        let known = |name: &String| {
            let table = paper.tables.iter().find(|table| **table == name.as_str());
            table.copied().ok_or_else(|| unknown("table", name, paper.tables))
        };
        request.tables = args.table.iter().map(known).collect::<Result<_, _>>()?;
    }
    if let Some(runs) = args.runs {
        request.runs = runs.get() as usize;
    }
    if !args.particles.is_empty() {
        request.particles = args.particles.iter().map(|n| n.get() as usize).collect();
    }
    let (runs, tables) = (request.runs, request.tables.clone());
    let experiment =
        MultiBall::new(request, options.seed).map_err(|error| Diagnostic::new(error.to_string()))?;
    let readings = zerre_vision::balls::thesis::READINGS;
    let config = json!({
        "tables": tables, "particles": experiment.particles(),
        "readings": readings.iter().map(|reading| format!("{reading:?}")).collect::<Vec<_>>(),
    });
    reproduce(paper, &experiment, multi_ball::SETTINGS, (runs, config), (args, options), console)
}

fn rgbd(args: &Reproduce, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let paper = &rgbd::PAPER;
    let mut request = rgbd::Request::new(args.quick);
    if !args.table.is_empty() {
        let known = |name: &String| {
            let table = paper.tables.iter().find(|table| **table == name.as_str());
            table.copied().ok_or_else(|| unknown("table", name, paper.tables))
        };
        request.tables = args.table.iter().map(known).collect::<Result<_, _>>()?;
    }
    if let Some(runs) = args.runs {
        request.clips = runs.get() as usize;
    }
    if !args.particles.is_empty() {
        request.particles = args.particles.iter().map(|n| n.get() as usize).collect();
        request.particles.sort_unstable();
        request.particles.dedup();
    }
    let recordings = match folder_of(args.data.as_deref(), "rgbd_asus")? {
        Some(folder) => RgbdRecordings::within(folder),
        None => RgbdRecordings::default(),
    };
    let config = json!({
        "tables": request.tables, "clips": request.clips, "particles": request.particles,
        "recordings": recordings.names(),
    });
    let what = (request.clips, config);
    let experiment = RgbdFusion::new(request, recordings, options.seed);
    reproduce(paper, &experiment, rgbd::SETTINGS, what, (args, options), console)
}

/// The folder that is named, or `part` within it; without one, `part` within that of the environment, where there is such.
fn folder_of(folder: Option<&Path>, part: &str) -> Result<Option<PathBuf>, Diagnostic> {
    let within = |folder: &Path| Some(folder.join(part)).filter(|part| part.is_dir());
    let Some(folder) = folder else {
        return Ok(std::env::var_os("ZERRE_DATA").and_then(|folder| within(Path::new(&folder))));
    };
    if !folder.is_dir() {
        let what = format!("{}: there is no such folder of recordings", folder.display());
        return Err(Diagnostic::new(what).help("name another with --data, or leave it out"));
    }
    Ok(Some(within(folder).unwrap_or_else(|| folder.to_owned())))
}

/// Annotated sequences of a folder.
fn sequences(folder: Option<&Path>) -> Result<Vec<Sequence>, Diagnostic> {
    folder_of(folder, "otb")?.map_or_else(|| Ok(Vec::new()), |folder| super::otb::sequences(&[folder]))
}

fn unreadable(error: zerre_io::Error) -> Diagnostic {
    Diagnostic::new(error.to_string())
}

/// Recordings of extended targets: those that lie in the folder that is named, or in that of the environment.
fn recordings(folder: Option<&Path>) -> Result<Recordings, Diagnostic> {
    let from_environment = std::env::var_os("ZERRE_DATA").map(PathBuf::from);
    let Some(folder) = folder.map(Path::to_owned).or(from_environment) else {
        return Ok(Recordings::default());
    };
    if !folder.is_dir() {
        let what = format!("{}: there is no such folder of recordings", folder.display());
        return Err(Diagnostic::new(what).help("name another with --data, or leave it out"));
    }
    let mut found = Recordings::default();
    let points = folder.join("metu_lidar_vehicle/points.csv");
    if points.is_file() {
        let columns = [("t_s".to_owned(), "time_s".to_owned())].into_iter().collect();
        let recording =
            Recording::open(&points, &Options { columns, ..Options::default() }).map_err(unreadable)?;
        let mut scans: Vec<(Time, Vec<[f64; 2]>)> = Vec::new();
        for plot in recording.plots {
            let Reading::Position2([x, y]) = plot.reading else { continue };
            match scans.last_mut().filter(|(time, _)| *time == plot.time) {
                Some((_, points)) => points.push([x, y]),
                None => scans.push((plot.time, vec![[x, y]])),
            }
        }
        found.vehicle = Some(scans);
    }
    for name in ["scene-0239", "scene-0400"] {
        let scene = folder.join("nuscenes_radar_labeled").join(name);
        if scene.is_dir() {
            found.objects.get_or_insert_default().extend(objects(name, &scene)?);
        }
    }
    Ok(found)
}

/// Objects of a scene with their boxes, frame by frame.
fn objects(name: &str, folder: &Path) -> Result<Vec<Object>, Diagnostic> {
    let sizes = Options { sizes: true, ..Options::default() };
    let table = Recording::open(&folder.join("boxes.csv"), &sizes).map_err(unreadable)?;
    let mut boxes: BTreeMap<u64, Vec<LabelledBox>> = BTreeMap::new();
    let mut centre = (0, [0.0; 2]);
    // Of each row the position comes first, then the size.
    for plot in table.plots {
        match plot.reading {
            Reading::Position2(at) => centre = (plot.line, at),
            Reading::Size([length, width, yaw]) if centre.0 == plot.line => {
                let label = LabelledBox { centre: centre.1, size: [length, width], yaw };
                boxes.entry(plot.scan.unwrap_or_default()).or_default().push(label);
            }
            _ => {}
        }
    }
    let refused = |error: std::io::Error| Diagnostic::io("read", folder, &error);
    let mut files: Vec<PathBuf> = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(refused)? {
        let path = entry.map_err(refused)?.path();
        let is_frame = path.file_name().is_some_and(|file| file.to_string_lossy().starts_with("radar_"));
        files.extend(Some(path).filter(|_| is_frame));
    }
    files.sort();
    let mut all = Vec::new();
    for file in files {
        let recording = Recording::open(&file, &Options::default()).map_err(unreadable)?;
        let mut clusters: BTreeMap<_, (u64, Vec<[f64; 2]>)> = BTreeMap::new();
        for plot in recording.plots {
            let Reading::Position2(at) = plot.reading else { continue };
            let cluster = clusters.entry(plot.id).or_default();
            cluster.0 = plot.scan.unwrap_or_default();
            cluster.1.push(at);
        }
        let near = |frame: u64| boxes.get(&frame).map_or(&[][..], Vec::as_slice);
        all.extend(
            clusters.into_values().filter_map(|(frame, points)| Object::matched(name, points, near(frame))),
        );
    }
    Ok(all)
}

/// The command line that gives this run again.
fn command_line(paper: &Paper, args: &Reproduce, options: &Global) -> String {
    let mut line = format!("zerre reproduce {}", paper.name);
    let mut word = |word: String| {
        line.push(' ');
        line.push_str(&word);
    };
    args.table.iter().for_each(|table| word(format!("--table {table}")));
    if let Some(runs) = args.runs {
        word(format!("--runs {runs}"));
    }
    if !args.particles.is_empty() {
        let counts: Vec<_> = args.particles.iter().map(ToString::to_string).collect();
        word(format!("--particles {}", counts.join(",")));
    }
    if let Some(data) = &args.data {
        word(format!("--data {}", data.display()));
    }
    if args.quick {
        word("--quick".to_owned());
    }
    word(format!("--seed {}", options.seed));
    line
}
