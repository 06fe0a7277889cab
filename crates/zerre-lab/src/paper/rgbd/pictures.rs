//! Pictures of the thesis's steps, and of the particles of both filters.

use super::run::{device, distance, first};
use super::settings::PICTURED_PARTICLES;
use crate::fusion::{PointScene, ShownPoint};
use crate::report::animation::{Colour, Frame};
use crate::report::overlay::{Drawn, pictured, sheet};
use crate::report::study::Picture;
use std::error::Error;
use zerre::rng::Stream;
use zerre_vision::operator::crop;
use zerre_vision::rgbd::scene::Scene;
use zerre_vision::rgbd::thesis::{Picture as Step, Thesis, ThesisSettings};
use zerre_vision::rgbd::tracker::{PointTracker, TrackerSettings};
use zerre_vision::rgbd::{Reading, RgbdFrame};

/// A picture with the bytes of its file.
pub(super) type Painted = (Picture, Vec<u8>);

const INK: Colour = [255, 255, 255, 255];
const SHADE: Colour = [0, 0, 0, 170];
/// Side of a step's picture, px.
const STEP: u16 = 240;
/// Side of the part of a frame that is shown with particles, and of its picture, px.
const PART: usize = 200;
const CELL: u16 = 320;
/// Particles that are drawn at most.
pub(super) const DRAWN: usize = 500;

/// What the steps of colour do.
const COLOUR: [(&str, &str); 12] = [
    ("I1A", "empty room"),
    ("I1B", "scene"),
    ("I2", "room less scene"),
    ("I3", "grey"),
    ("I4", "over low threshold"),
    ("I5", "over high threshold"),
    ("I6", "one but not both"),
    ("I7", "small regions dropped"),
    ("I8", "holes filled"),
    ("I9", "dilated"),
    ("I10", "border cleared"),
    ("I11", "largest region"),
];
/// What the steps of depth do.
const DEPTH: [(&str, &str); 13] = [
    ("I1A", "empty room"),
    ("I1B", "scene"),
    ("I2", "room less scene"),
    ("I3", "8 bits"),
    ("I4", "over low threshold"),
    ("I5", "over high threshold"),
    ("I6", "one but not both"),
    ("I7", "change of I6"),
    ("I8", "holes filled"),
    ("I9", "dilated"),
    ("I10", "I9 and I6"),
    ("I11", "border cleared"),
    ("I12", "largest region"),
];

/// A frame that is shown, from 0, and what is to be seen on it.
type Chosen = (usize, &'static str);

/// A frame in which the hand is free, one in which it is before the body, and the one in which the device is
/// off most.
pub(super) fn chosen(scene: &Scene) -> Vec<Chosen> {
    let middle = |wanted: &dyn Fn(usize) -> bool| {
        let all: Vec<usize> = (1..scene.len()).filter(|k| wanted(*k)).collect();
        all.get(all.len() / 2).copied()
    };
    let free = middle(&|k| !scene.truth(k).overlap && scene.truth(k).visible > 0.0);
    let before = middle(&|k| scene.truth(k).overlap);
    let off = |k: &usize| scene.device(*k).map_or(0.0, |said| distance(said.at, scene.truth(*k).hand));
    let burst = (1..scene.len()).max_by(|a, b| off(a).total_cmp(&off(b)));
    let named = [(free, "hand free"), (before, "hand before the body"), (burst, "device off most")];
    named.into_iter().filter_map(|(k, what)| Some((k?, what))).collect()
}

/// Writes on a strip across the top.
pub(super) fn label(drawn: &mut Frame, text: &str) {
    let right = drawn.size()[0] as f64;
    drawn.area([[0.0, 0.0], [right, 0.0], [right, 18.0], [0.0, 18.0]], SHADE);
    drawn.text([4.0, 13.0], 9.0, text, INK);
}

/// A frame in which both ways of the thesis go through to their last step: the middle one of these, if there
/// is any.
pub(super) fn complete(scene: &Scene, thesis: &ThesisSettings) -> zerre_vision::Result<Option<usize>> {
    let mut filter = Thesis::start(thesis.clone(), scene.background(), first(scene).at, Stream::new(1))?;
    let mut found = Vec::new();
    for k in 1..scene.len() {
        let [_, colour, depth] = filter.step(&scene.frame(k), scene.device(k).as_ref(), [None, None])?.places;
        found.extend((colour.is_some() && depth.is_some()).then_some(k));
    }
    Ok(found.get(found.len() / 2).copied())
}

/// The steps of colour and of depth in a frame of a clip, each on one sheet.
pub(super) fn steps(
    scene: &Scene,
    thesis: &ThesisSettings,
    (clip, wanted): (usize, usize),
) -> Result<Vec<Painted>, Box<dyn Error>> {
    let mut filter = Thesis::start(thesis.clone(), scene.background(), first(scene).at, Stream::new(1))?;
    // Depth compares a frame with the one before.
    let mut shown: [Vec<(&'static str, Step)>; 2] = Default::default();
    for k in wanted.saturating_sub(1)..=wanted {
        let [colour, depth] = &mut shown;
        colour.clear();
        depth.clear();
        let mut keep_colour = |step, picture| colour.push((step, picture));
        let mut keep_depth = |step, picture| depth.push((step, picture));
        let joint = scene.device(k);
        filter.step(&scene.frame(k), joint.as_ref(), [Some(&mut keep_colour), Some(&mut keep_depth)])?;
    }
    let mut painted = Vec::new();
    for (name, about, pictures) in [("color", &COLOUR[..], &shown[0]), ("depth", &DEPTH[..], &shown[1])] {
        let mut cells = Vec::with_capacity(about.len());
        for (step, about) in about {
            // Where nothing is left there is no largest region: its place stays dark.
            let picture = pictures.iter().find(|(there, _)| there == step);
            let mut cell = match picture {
                Some((_, picture)) => Frame::photograph(&picture.frame(), [STEP; 2])?,
                None => Frame::new([STEP; 2], [40, 40, 40, 255])?,
            };
            let none = if picture.is_none() { ": nothing left" } else { "" };
            label(&mut cell, &format!("{step}  {about}{none}"));
            cells.push(cell);
        }
        let across = cells.len().div_ceil(2);
        if let Some(sheet) = sheet(&cells.iter().collect::<Vec<_>>(), across)? {
            let title = format!(
                "The thesis's steps of {} in its window, frame {} of clip {}",
                if name == "color" { "colour" } else { name },
                wanted + 1,
                clip + 1
            );
            painted.push(pictured(&title, &format!("steps-{name}.png"), &sheet)?);
        }
    }
    Ok(painted)
}

/// What a filter says of a frame, in the part of it that is shown.
fn part(
    frame: &RgbdFrame,
    corner: [f64; 2],
    (name, point): (&str, ShownPoint),
    truth: [f64; 2],
) -> crate::Result<Frame> {
    let cut = crop(&frame.colour, corner[0] as isize, corner[1] as isize, PART, PART);
    let within = |at: [f64; 2]| [at[0] - corner[0], at[1] - corner[1]];
    let particles = point.particles.iter().map(|at| within(*at)).collect();
    let points = [ShownPoint { at: within(point.at), particles, ..point }];
    let mut drawn =
        PointScene { frame: &cut, name: "", points: &points, truth: &[within(truth)] }.draw([CELL; 2])?;
    label(&mut drawn, name);
    Ok(drawn)
}

/// At most [`DRAWN`] of them.
pub(super) fn some(particles: impl Iterator<Item = ([f64; 2], f64)>, count: usize) -> Vec<[f64; 2]> {
    particles.map(|(at, _)| at).step_by(count.div_ceil(DRAWN).max(1)).collect()
}

/// Particles of both filters, of every pictured number, in the chosen frames: a sheet for each of these.
pub(super) fn overlays(
    scene: &Scene,
    settings: &TrackerSettings,
    thesis: &ThesisSettings,
    stream: Stream,
) -> Result<Vec<Painted>, Box<dyn Error>> {
    let chosen = chosen(scene);
    let (room, lens) = (scene.background(), scene.camera().colour);
    let (begin, start) = (first(scene), scene.frame(0));
    let mut filters = Vec::new();
    for particles in PICTURED_PARTICLES {
        let mut settings = settings.clone();
        settings.fusion.particles = particles;
        let thesis = ThesisSettings { particles, ..thesis.clone() };
        filters.push((
            particles,
            Thesis::start(thesis, room.clone(), begin.at, stream)?,
            PointTracker::start(settings, (room.clone(), lens), (&start, begin), stream)?,
        ));
    }
    let mut painted = vec![None; chosen.len()];
    let last = chosen.iter().map(|(k, _)| *k).max().unwrap_or(0);
    for k in 1..=last {
        let (frame, truth, joint) = (scene.frame(k), scene.truth(k).hand, scene.device(k));
        let said = device(scene, k);
        let said: Vec<(usize, &[Reading])> = said.iter().map(|(s, r)| (*s, r.as_slice())).collect();
        let is_shown = chosen.iter().any(|(wanted, _)| *wanted == k);
        let (mut above, mut below) = (Vec::new(), Vec::new());
        let corner = [0, 1].map(|axis| (truth[axis] - PART as f64 / 2.0).round());
        for (particles, old, tracker) in &mut filters {
            let step = old.step(&frame, joint.as_ref(), [None, None])?;
            let fused = tracker.step(&frame, &said, &mut |_| ())?.fused;
            if !is_shown {
                continue;
            }
            let point = ShownPoint {
                at: step.estimate,
                covariance: step.covariance,
                lost: false,
                particles: some(old.particles(), *particles),
            };
            above.push(part(&frame, corner, (&format!("thesis: {particles} particles"), point), truth)?);
            let point = ShownPoint {
                at: fused.at,
                covariance: fused.covariance,
                lost: fused.is_lost(),
                particles: some(tracker.particles(), *particles),
            };
            below.push(part(&frame, corner, (&format!("sound: {particles} particles"), point), truth)?);
        }
        let cells: Vec<&Frame> = above.iter().chain(&below).collect();
        let Some(sheet) = sheet(&cells, filters.len())? else { continue };
        for (place, (_, what)) in chosen.iter().enumerate().filter(|(_, (wanted, _))| *wanted == k) {
            let title = format!("Particles in frame {} of the first clip ({what})", k + 1);
            painted[place] = Some(pictured(&title, &format!("particles-{:03}.png", k + 1), &sheet)?);
        }
    }
    let mut painted: Vec<Painted> = painted.into_iter().flatten().collect();
    // One frame may be several of these.
    painted.dedup_by(|a, b| a.0.file == b.0.file);
    Ok(painted)
}
