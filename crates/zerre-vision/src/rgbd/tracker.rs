//! A point of a body followed through a recording: cues are searched about where the filter expects it, and everything
//! that has been said of it is fused.

use super::background::Background;
use super::cue::{ArmEnd, ColourCue, Light, Others, Room, Search, View};
use super::fusion::{Evidence, Fused, Fusion, FusionSettings, Source};
use super::{Depth, Intrinsics, NO_DEPTH, Reading, RgbdFrame};
use crate::{Error, Frame, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use zerre::math::Real;
use zerre::rng::Stream;

/// How a [`PointTracker`] is set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TrackerSettings {
    /// The filter.
    pub fusion: FusionSettings,
    /// Side of the window that is searched, pixels. It grows while the point is lost.
    pub window: usize,
    /// The cue of colours; `None` switches it off.
    pub colour: Option<Source>,
    /// The cue of depth; `None` switches it off, and depth with it.
    pub depth: Option<Source>,
    /// Sources beside the cues: devices, pose estimators.
    pub sources: Vec<Source>,
    /// How far what people mark is from what the sources agree on, a standard deviation in pixels.
    pub reference_sd: f64,
}

impl Default for TrackerSettings {
    fn default() -> TrackerSettings {
        let source = |name: &str, sd, depth_sd, outlier, sees| Source {
            name: name.to_owned(),
            sd,
            depth_sd,
            outlier,
            offset: [0.0; 2],
            depth_offset: 0.0,
            sees,
        };
        TrackerSettings {
            fusion: FusionSettings::default(),
            window: 141,
            colour: Some(source("color", 3.0, 30.0, 0.1, true)),
            depth: Some(source("depth", 8.0, 40.0, 0.3, true)),
            sources: vec![source("device", 6.0, 60.0, 0.25, false)],
            reference_sd: 1.0,
        }
    }
}

impl TrackerSettings {
    /// # Errors
    /// A number out of its range.
    pub fn checked(&self) -> Result<()> {
        self.fusion.checked()?;
        self.all_sources().try_for_each(Source::checked)?;
        if !(9..=2001).contains(&self.window) {
            let needs = "it must be from 9 to 2001 pixels";
            return Err(Error::OutOfRange { what: "window", value: self.window as f64, needs });
        }
        if !(self.reference_sd >= 0.0 && self.reference_sd.is_finite()) {
            let needs = "it must be 0 or more";
            return Err(Error::OutOfRange { what: "reference_sd", value: self.reference_sd, needs });
        }
        Ok(())
    }

    /// All sources in the order that [`Tracked::said`] and [`Fused::trust`] have: those beside the cues, colour, depth.
    pub fn all_sources(&self) -> impl Iterator<Item = &Source> {
        self.sources.iter().chain(&self.colour).chain(&self.depth)
    }
}

/// What a source said in a step, and the area where it looked.
#[derive(Clone, Debug, PartialEq)]
pub struct Said {
    /// What may be the point.
    pub readings: Vec<Reading>,
    /// Square pixels.
    pub area: f64,
}

/// What a step gave.
#[derive(Clone, Debug, PartialEq)]
pub struct Tracked {
    /// The posterior.
    pub fused: Fused,
    /// What every source said; `None` where it did not look.
    pub said: Vec<Option<Said>>,
    /// Where the cues were searched.
    pub search: Search,
    /// Mean of the point in the colour camera's frame, millimetres, where its depth is known to within a fifth.
    pub point_mm: Option<[f64; 3]>,
}

/// A part of a step, for those who measure how long it takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The room's light, and where to search.
    Light,
    /// The cue of colours.
    Colour,
    /// The cue of depth.
    Depth,
    /// The filter.
    Fusion,
    /// What is learnt of the colours.
    Learning,
}

impl Stage {
    /// All of them, in their order.
    pub const ALL: [Stage; 5] = [Stage::Light, Stage::Colour, Stage::Depth, Stage::Fusion, Stage::Learning];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Light => "light",
            Stage::Colour => "colour cue",
            Stage::Depth => "depth cue",
            Stage::Fusion => "fusion",
            Stage::Learning => "learning",
        }
    }
}

/// The tracker.
#[derive(Clone, Debug)]
pub struct PointTracker {
    settings: TrackerSettings,
    lens: Intrinsics,
    room: Room,
    /// What is seen of depth where it is not used.
    blind: Option<Depth>,
    fusion: Fusion,
    colour: ColourCue,
    arm: ArmEnd,
    /// What is like the point and is not.
    rest: Others,
    lost: bool,
    steps: u64,
}

/// Standard deviation of the first place, pixels.
const FIRST_SD: f64 = 10.0;
/// The colours are learnt where the place is known to this share of a palm's radius.
const KNOWN: f64 = 0.35;
/// Probability of being lost above which nothing is learnt.
const DOUBTFUL: f64 = 0.1;
/// A source is trusted above this probability that it is right.
const AGREES: f64 = 0.8;
/// Candidates of a cue at most.
const CANDIDATES: usize = 4;
/// Windows that are so many times as large are looked at more coarsely.
const COARSE: usize = 2;
/// In every so many frames the whole of it is searched for what else is like the point.
const EVERYWHERE: u64 = 3;
/// Things are apart that are so many radii of a palm from each other.
const REACH: f64 = 2.5;
/// Radius of a palm, millimetres.
const PALM: f64 = 40.0;

impl PointTracker {
    /// A tracker of the point that is at `first` on `frame`, before an empty room (its depth [`NO_DEPTH`] where unknown).
    ///
    /// # Errors
    /// Settings out of range, pictures of different sizes, a first place off the frame.
    pub fn start(
        settings: TrackerSettings,
        (room, lens): ((Frame, Depth), Intrinsics),
        (frame, first): (&RgbdFrame, Reading),
        stream: Stream,
    ) -> Result<PointTracker> {
        settings.checked()?;
        first.checked()?;
        frame.colour.expect_size(&room.0)?;
        frame.colour.expect_size(&room.1)?;
        frame.colour.expect_size(&frame.depth)?;
        let size = frame.colour.size();
        let [x, y] = first.at;
        if !((0.0..=size.0 as f64).contains(&x) && (0.0..=size.1 as f64).contains(&y)) {
            let problem = format!("{x}, {y} is not on the frame of {} x {}", size.0, size.1);
            return Err(Error::Input { input: "the first place".to_owned(), problem });
        }
        let blind = settings.depth.is_none().then(|| Depth::filled(size.0, size.1, NO_DEPTH));
        let room = Room::new(room.0, blind.clone().unwrap_or(room.1))?;
        // Where no source could say it better later, the first place has to be believed.
        let confidence = if settings.sources.is_empty() { 1.0 } else { first.confidence };
        let depth_mm = first.depth_mm.filter(|_| settings.depth.is_some());
        let first = Reading { depth_mm, confidence, ..first };
        let sources = settings.all_sources().cloned().collect();
        let fusion =
            Fusion::start(settings.fusion.clone(), sources, (size, first, FIRST_SD), (frame.time, stream))?;
        let mut tracker = PointTracker {
            settings,
            lens,
            room,
            blind,
            fusion,
            colour: ColourCue::default(),
            arm: ArmEnd::default(),
            rest: Others::default(),
            lost: false,
            steps: 0,
        };
        // With two sources beside the colours, these wait until they agree.
        if tracker.settings.colour.is_some() && tracker.others() < 2 {
            let light = Light::of(&frame.colour, &tracker.room);
            tracker.learn(frame, &light, first.at, first.depth_mm);
        }
        Ok(tracker)
    }

    /// The particles' places and weights.
    pub fn particles(&self) -> impl Iterator<Item = ([f64; 2], f64)> {
        self.fusion.particles()
    }

    /// The room as it is known by now.
    ///
    /// # Errors
    /// A room of another size.
    pub fn see_room(&mut self, room: &Background) -> Result<()> {
        self.room.colour().expect_size(room.colour())?;
        let depth = self.blind.as_ref().unwrap_or(room.depth());
        // A room that is not learnt is the same picture all along.
        if self.room.colour().pixels() != room.colour().pixels()
            || self.room.depth().pixels() != depth.pixels()
        {
            self.room = Room::new(room.colour().clone(), depth.clone())?;
        }
        Ok(())
    }

    /// The settings.
    pub fn settings(&self) -> &TrackerSettings {
        &self.settings
    }

    /// Radius of a palm at a depth, pixels.
    fn radius(&self, depth: Option<f64>) -> f64 {
        PALM * self.lens.focal[0] / depth.unwrap_or(2000.0).max(300.0)
    }

    fn learn(&mut self, frame: &RgbdFrame, light: &Light, at: [f64; 2], depth: Option<f64>) {
        let seen = self.blind.as_ref().unwrap_or(&frame.depth);
        let view = View { colour: &frame.colour, depth: seen, room: &self.room, lens: self.lens, light };
        let radius = self.radius(depth);
        self.colour.colours.learn(&view, at, radius, depth);
    }

    /// How many sources there are beside the colours.
    fn others(&self) -> usize {
        self.settings.sources.len() + usize::from(self.settings.depth.is_some())
    }

    /// Whether colours may be learnt where the point is: at first only where two sources agree, as one may be wrong for
    /// long, if there are two.
    fn agrees(&self, fused: &Fused) -> bool {
        let trusted = fused.trust.iter().flatten().filter(|trust| **trust > AGREES).count();
        !self.colour.colours.is_empty() || trusted >= self.others().min(2)
    }

    /// A frame, with what the sources beside the cues say: the number of the source, from 0, and its readings. One that
    /// has another rate than the camera is left out where it is silent. `done` is called after every stage.
    ///
    /// # Errors
    /// A frame of another size or before the last one, a source that is none, a reading that is not finite; the tracker
    /// is as before then.
    pub fn step(
        &mut self,
        frame: &RgbdFrame,
        others: &[(usize, &[Reading])],
        done: &mut dyn FnMut(Stage),
    ) -> Result<Tracked> {
        self.room.colour().expect_size(&frame.colour)?;
        self.room.colour().expect_size(&frame.depth)?;
        let (width, height) = frame.colour.size();
        let (at, sd, depth) = self.fusion.foretell(frame.time);
        let at = [at[0].clamp(0.0, width as f64), at[1].clamp(0.0, height as f64)];
        let wide = if self.lost { 3 * self.settings.window } else { (6.0 * sd) as usize };
        let side = wide.clamp(self.settings.window, self.settings.window.max(width.max(height)));
        let uses_depth = self.settings.depth.is_some();
        let step = side / (COARSE * self.settings.window) + 1;
        let search = Search { at, side, step, depth: uses_depth.then_some(depth) };
        let light = Light::of(&frame.colour, &self.room);
        let seen = self.blind.as_ref().unwrap_or(&frame.depth);
        let view =
            View { colour: &frame.colour, depth: seen, room: &self.room, lens: self.lens, light: &light };
        done(Stage::Light);
        let mut said: Vec<Option<Said>> = vec![None; self.settings.sources.len()];
        for &(source, readings) in others {
            let Some(place) = said.get_mut(source) else {
                let (found, expected) = (source, self.settings.sources.len());
                let what = "number of a source (from 0, below)";
                return Err(zerre::Error::Shape { what, found, expected }.into());
            };
            let readings = readings
                .iter()
                .map(|r| Reading { depth_mm: r.depth_mm.filter(|_| uses_depth), ..*r })
                .collect();
            *place = Some(Said { readings, area: (width * height) as f64 });
        }
        let size = frame.colour.size();
        let area = search.area(size);
        let radius = self.radius(uses_depth.then_some(depth[0]));
        let expected = (!self.lost).then_some(at);
        let mut candidates = Vec::new();
        if self.settings.colour.is_some() {
            if self.steps.is_multiple_of(EVERYWHERE) {
                let anywhere = Search { at: [0.0; 2], side: usize::MAX, step: COARSE + 1, ..search };
                candidates = self.colour.candidates(&view, &anywhere, 3 * CANDIDATES);
            }
            let mut readings = self.colour.candidates(&view, &search, CANDIDATES);
            candidates.extend_from_slice(&readings);
            self.rest.remove(&mut readings, expected, REACH * radius);
            // Who knows no colours yet has not looked.
            said.push((!self.colour.colours.is_empty()).then_some(Said { readings, area }));
        }
        done(Stage::Colour);
        if uses_depth {
            let colours = self.settings.colour.is_some().then_some(&self.colour.colours);
            let mut readings = self.arm.candidates(&view, colours);
            candidates.extend_from_slice(&readings);
            readings.retain(|reading| search.holds(reading.at, size));
            self.rest.remove(&mut readings, expected, REACH * radius);
            said.push(Some(Said { readings, area }));
        }
        done(Stage::Depth);
        let evidence: Vec<Evidence<'_>> = (said.iter().enumerate())
            .filter_map(|(source, said)| {
                let Said { readings, area } = said.as_ref()?;
                Some(Evidence { source, readings, area: *area })
            })
            .collect();
        let mut fused = self.fusion.step(frame.time, &evidence)?;
        let spread = ((fused.covariance[0][0] + fused.covariance[1][1]) / 2.0).sqrt();
        for k in 0..2 {
            fused.covariance[k][k] += self.settings.reference_sd.square();
        }
        done(Stage::Fusion);
        self.lost = fused.is_lost();
        self.steps += 1;
        let deep = uses_depth.then_some(fused.depth[0]);
        let radius = self.radius(deep);
        self.rest.learn(
            candidates.into_iter(),
            (fused.p_lost < DOUBTFUL).then_some(fused.at),
            REACH * radius,
        );
        let known = fused.p_lost < DOUBTFUL && spread < KNOWN * radius;
        if self.settings.colour.is_some() && known && self.agrees(&fused) {
            self.learn(frame, &light, fused.at, deep);
        }
        done(Stage::Learning);
        let [z, variance] = fused.depth;
        let known = uses_depth && z > 0.0 && variance.sqrt() < 0.2 * z;
        let point_mm = known.then(|| self.lens.point(fused.at, z));
        Ok(Tracked { fused, said, search, point_mm })
    }
}
