//! What is read before the first frame.

use super::marks::{Marks, marks};
use super::tables::{self, Joints};
use crate::args::{Fuse, FusePreset, RoomFrom};
use crate::config::Source as ConfigSource;
use crate::diagnostic::Diagnostic;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use zerre_vision::frames::Frames;
use zerre_vision::rgbd::fusion::Source;
use zerre_vision::rgbd::thesis::ThesisSettings;
use zerre_vision::rgbd::tracker::TrackerSettings;

/// Name of a point that is shown by hand.
const POINT: &str = "point";

/// What a configuration file may set.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct FuseConfig {
    /// Sources that are left out: color, depth, or one of the table of joints.
    pub without: Vec<String>,
    /// The sound filter.
    pub tracker: TrackerSettings,
    /// The thesis's.
    pub thesis: ThesisSettings,
    /// What the sources were learnt from, as --calibrate notes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub learnt: Option<Learnt>,
}

impl FuseConfig {
    /// Refuses settings before anything is read.
    pub(super) fn checked(&self, preset: FusePreset) -> Result<(), Diagnostic> {
        self.tracker.checked().map_err(super::refused)?;
        self.thesis.checked().map_err(super::refused)?;
        if preset == FusePreset::Thesis && self.tracker.sources.len() > 1 {
            let names: Vec<&str> = self.tracker.sources.iter().map(|source| source.name.as_str()).collect();
            let what = "the thesis's filter knows one device".to_owned();
            return Err(Diagnostic::new(what).help(format!("there are {}", names.join(", "))));
        }
        Ok(())
    }
}

/// What sources were learnt from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Learnt {
    /// The recording.
    pub recording: String,
    /// SHA-256 of the table of marks.
    pub marks_sha256: String,
    /// Marked frames.
    pub frames: usize,
}

pub(super) struct Opened {
    pub recording: PathBuf,
    pub config: FuseConfig,
    pub joints: Joints,
    /// Rows of joints that are not followed.
    pub unasked: usize,
    pub names: Vec<String>,
    /// For scores.
    pub truth: Option<Marks>,
    /// To learn from.
    pub lesson: Option<Marks>,
    pub read: Vec<PathBuf>,
}

pub(super) fn open(args: &Fuse) -> Result<Opened, Diagnostic> {
    refuse_together(args)?;
    let mut read = Vec::new();
    let mut config = FuseConfig::default();
    if let Some(path) = &args.config {
        config = ConfigSource::read(path)?.parse()?;
        read.push(path.clone());
    }
    if let Some(particles) = args.particles {
        config.tracker.fusion.particles = particles.get() as usize;
        config.thesis.particles = particles.get() as usize;
    }
    let beside = args.recording.join("joints.csv");
    let file = args.joints.clone().or_else(|| beside.is_file().then_some(beside));
    let mut joints = Joints::default();
    if let Some(path) = &file {
        joints = tables::joints(path)?;
        read.push(path.clone());
    }
    let names = names(args, &joints)?;
    let all = joints.rows.len();
    joints.rows.retain(|row| names.contains(&row.joint));
    let unasked = all - joints.rows.len();
    let usual = TrackerSettings::default().sources.into_iter().next();
    for row in &joints.rows {
        let known = config.tracker.sources.iter().any(|source| source.name == row.source);
        if let (false, Some(usual)) = (known, &usual) {
            config.tracker.sources.push(Source { name: row.source.clone(), ..usual.clone() });
        }
    }
    config.without.extend(args.without.iter().cloned());
    leave_out(&mut config)?;
    // Who says nothing is no source: a point that is shown by hand is known at once.
    config.tracker.sources.retain(|source| joints.rows.iter().any(|row| row.source == source.name));
    let mut table = |path: &Option<PathBuf>| -> Result<Option<Marks>, Diagnostic> {
        let Some(path) = path else { return Ok(None) };
        read.push(path.clone());
        marks(path, &names).map(Some)
    };
    let (lesson, truth) = (table(&args.calibrate)?, table(&args.truth)?);
    Ok(Opened { recording: args.recording.clone(), config, joints, unasked, names, truth, lesson, read })
}

/// Refuses what makes no sense together.
fn refuse_together(args: &Fuse) -> Result<(), Diagnostic> {
    let thesis = args.preset == FusePreset::Thesis;
    if !args.steps.is_empty() && !thesis {
        return Err(Diagnostic::usage("--steps shows the steps of the thesis").help("add --preset thesis"));
    }
    if thesis && !args.without.is_empty() {
        return Err(Diagnostic::usage("the thesis's filter has all its sources").help("leave --without out"));
    }
    if thesis && args.calibrate.is_some() {
        return Err(Diagnostic::usage("the thesis's filter learns nothing")
            .help("leave --calibrate or --preset thesis out"));
    }
    if args.room == Some(RoomFrom::Running) && args.calibrate.is_some() {
        return Err(Diagnostic::usage("--calibrate needs a room that stays as it is")
            .help("give --room median or --room pictures; what is learnt can be used with another one"));
    }
    if Frames::is_live(&args.recording.to_string_lossy()) {
        for (given, option, why) in [
            (args.joints.is_some(), "--joints", "the times of a table are not those of a camera"),
            (args.truth.is_some(), "--truth", "nobody has marked what is yet to come"),
            (args.calibrate.is_some(), "--calibrate", "learning goes through a recording several times"),
        ] {
            if given {
                let what = format!("{option} needs a recording: {why}");
                return Err(Diagnostic::usage(what).help(format!("leave {option} out, or record first")));
            }
        }
    }
    Ok(())
}

/// Names of the points, in the order in which they were asked for.
fn names(args: &Fuse, joints: &Joints) -> Result<Vec<String>, Diagnostic> {
    if args.start.is_some() {
        return Ok(vec![args.joint.first().cloned().unwrap_or_else(|| POINT.to_owned())]);
    }
    let mut names: Vec<String> = joints.rows.iter().map(|row| row.joint.clone()).collect();
    names.sort();
    names.dedup();
    if names.is_empty() {
        let what = "nothing says where the point is";
        return Err(Diagnostic::new(what)
            .help("give a table of joints with --joints, or its first place with --start x,y"));
    }
    if !args.joint.is_empty() {
        let known: Vec<&str> = names.iter().map(String::as_str).collect();
        if let Some(missing) = args.joint.iter().find(|name| !known.contains(&name.as_str())) {
            return Err(super::super::unknown("joint", missing, &known));
        }
        names.retain(|name| args.joint.contains(name));
        names.sort_by_key(|name| args.joint.iter().position(|asked| asked == name));
    }
    Ok(names)
}

/// Leaves the sources out that are not wanted.
fn leave_out(config: &mut FuseConfig) -> Result<(), Diagnostic> {
    let FuseConfig { without, tracker, .. } = config;
    let known: Vec<String> = tracker.all_sources().map(|source| source.name.clone()).collect();
    let known: Vec<&str> = known.iter().map(String::as_str).collect();
    if let Some(name) = without.iter().find(|name| !known.contains(&name.as_str())) {
        return Err(super::super::unknown("source", name, &known));
    }
    tracker.sources.retain(|source| !without.contains(&source.name));
    for cue in [&mut tracker.colour, &mut tracker.depth] {
        cue.take_if(|source| without.contains(&source.name));
    }
    Ok(())
}
