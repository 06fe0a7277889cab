//! Several points, each with a tracker of its own.

use crate::study::interval::quantile;
use cpu_time::ThreadTime;
use std::collections::BTreeMap;
use std::time::Instant;
use zerre::Time;
use zerre::rng::Stream;
use zerre_vision::Result;
use zerre_vision::rgbd::background::Background;
use zerre_vision::rgbd::thesis::{Show, Thesis, ThesisSettings};
use zerre_vision::rgbd::tracker::{PointTracker, TrackerSettings};
use zerre_vision::rgbd::{Intrinsics, Reading, RgbdFrame};

/// Which filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preset {
    /// Cues as mixtures with outliers.
    #[default]
    Sound,
    /// As the thesis has it.
    Thesis,
}

/// What time is measured by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Clock {
    /// The processor time of this thread.
    #[default]
    Processor,
    /// What passes for who waits for the result.
    Wall,
}

/// Time since something began.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch(Since);

#[derive(Clone, Copy, Debug)]
enum Since {
    Processor(ThreadTime),
    Wall(Instant),
}

impl Stopwatch {
    /// Begins now.
    pub fn start(clock: Clock) -> Stopwatch {
        Stopwatch(match clock {
            Clock::Processor => Since::Processor(ThreadTime::now()),
            Clock::Wall => Since::Wall(Instant::now()),
        })
    }

    /// Milliseconds since then, on the same thread.
    pub fn ms(&self) -> f64 {
        1000.0
            * match self.0 {
                Since::Processor(since) => since.elapsed().as_secs_f64(),
                Since::Wall(since) => since.elapsed().as_secs_f64(),
            }
    }
}

/// How points are followed.
#[derive(Clone, Debug, Default)]
pub struct Rules {
    /// Which filter.
    pub preset: Preset,
    /// Of the sound one.
    pub tracker: TrackerSettings,
    /// Of the thesis's.
    pub thesis: ThesisSettings,
    /// What stages are timed by.
    pub clock: Clock,
}

/// What is known of a point in a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Number of the frame, from 0.
    pub frame: usize,
    /// What people know the frame by.
    pub name: String,
    /// When it was taken.
    pub time: Time,
    /// Which point.
    pub joint: String,
    /// Where it is, pixels.
    pub at: [f64; 2],
    /// Covariance of that.
    pub covariance: [[f64; 2]; 2],
    /// In the colour camera's frame, millimetres, where its depth is known.
    pub point_mm: Option<[f64; 3]>,
    /// Probability that the cameras cannot see it; the thesis's filter does not know.
    pub p_lost: Option<f64>,
    /// Of each source the probability that it is right; `None` where it said nothing.
    pub trust: Vec<Option<f64>>,
}

enum Filter {
    Sound(Box<PointTracker>),
    Thesis(Box<Thesis>),
}

struct Point {
    joint: String,
    filter: Filter,
}

/// All points of a recording.
pub struct Follow {
    rules: Rules,
    lens: Intrinsics,
    stream: Stream,
    points: Vec<Point>,
    /// What was found.
    pub rows: Vec<Row>,
    /// Time by stage, of every frame and point, milliseconds by the rules' clock.
    pub times: BTreeMap<&'static str, Vec<f64>>,
    /// Frames in which a source said nothing, by its name.
    pub silent: BTreeMap<String, usize>,
}

/// What the sources beside the cues say of a point in a frame: number of the source, and its reading.
pub type Heard = Vec<(usize, Vec<Reading>)>;

impl Follow {
    /// Nothing is followed yet.
    pub fn new(rules: Rules, lens: Intrinsics, stream: Stream) -> Follow {
        let (rows, times, silent) = (Vec::new(), BTreeMap::new(), BTreeMap::new());
        Follow { rules, lens, stream, points: Vec::new(), rows, times, silent }
    }

    /// Names of the sources, in the order of [`Row::trust`].
    pub fn sources(&self) -> Vec<String> {
        match self.rules.preset {
            Preset::Sound => self.rules.tracker.all_sources().map(|source| source.name.clone()).collect(),
            Preset::Thesis => ["device", "color", "depth"].map(str::to_owned).to_vec(),
        }
    }

    /// Whether a point is followed.
    pub fn has(&self, joint: &str) -> bool {
        self.points.iter().any(|point| point.joint == joint)
    }

    /// Begins to follow a point that is at `first` on a frame.
    ///
    /// # Errors
    /// Settings out of range, a place off the frame.
    pub fn start(&mut self, joint: &str, frame: &RgbdFrame, room: &Background, first: Reading) -> Result<()> {
        let stream = self.stream.fork(self.points.len() as u64);
        let empty = (room.colour().clone(), room.depth().clone());
        let filter = match self.rules.preset {
            Preset::Sound => {
                let settings = self.rules.tracker.clone();
                let tracker = PointTracker::start(settings, (empty, self.lens), (frame, first), stream)?;
                Filter::Sound(Box::new(tracker))
            }
            Preset::Thesis => {
                let settings = self.rules.thesis.clone();
                Filter::Thesis(Box::new(Thesis::start(settings, empty, first.at, stream)?))
            }
        };
        self.points.push(Point { joint: joint.to_owned(), filter });
        let lost = (self.rules.preset == Preset::Sound).then_some(0.0);
        let trust = vec![None; self.sources().len()];
        let variance = FIRST_SD * FIRST_SD;
        self.rows.push(Row {
            frame: frame.index,
            name: frame.name.clone(),
            time: frame.time,
            joint: joint.to_owned(),
            at: first.at,
            covariance: [[variance, 0.0], [0.0, variance]],
            point_mm: first.depth_mm.map(|z| self.lens.point(first.at, z)),
            p_lost: lost,
            trust,
        });
        Ok(())
    }

    /// A frame, with what was heard of each point, by its name. `show` gets the pictures of the thesis's
    /// steps of the first point.
    ///
    /// # Errors
    /// What a tracker refuses: the frame is left out for all points then.
    pub fn step(
        &mut self,
        frame: &RgbdFrame,
        room: &Background,
        heard: &BTreeMap<String, Heard>,
        mut show: [Option<Show<'_>>; 2],
    ) -> Result<()> {
        let sources = self.sources();
        let mut rows = Vec::with_capacity(self.points.len());
        for point in &mut self.points {
            let said = heard.get(&point.joint).map_or(&[][..], Vec::as_slice);
            let begin = Stopwatch::start(self.rules.clock);
            let mut last = 0.0;
            let mut times: Vec<(&'static str, f64)> = Vec::new();
            let mut stamp = |name: &'static str| {
                let now = begin.ms();
                times.push((name, now - last));
                last = now;
            };
            let row = match &mut point.filter {
                Filter::Sound(tracker) => {
                    tracker.see_room(room)?;
                    let said: Vec<(usize, &[Reading])> =
                        said.iter().map(|(s, r)| (*s, r.as_slice())).collect();
                    let tracked = tracker.step(frame, &said, &mut |stage| stamp(stage.name()))?;
                    for (name, said) in sources.iter().zip(&tracked.said) {
                        if said.as_ref().is_none_or(|said| said.readings.is_empty()) {
                            *self.silent.entry(name.clone()).or_default() += 1;
                        }
                    }
                    let fused = tracked.fused;
                    (fused.at, fused.covariance, tracked.point_mm, Some(fused.p_lost), fused.trust)
                }
                Filter::Thesis(filter) => {
                    let device = said.iter().flat_map(|(_, readings)| readings).last();
                    let [colour, depth] = &mut show;
                    let shown = [colour.take(), depth.take()];
                    let step = filter.step(frame, device, shown)?;
                    stamp("thesis");
                    for (name, place) in sources.iter().zip(step.places) {
                        if place.is_none() {
                            *self.silent.entry(name.clone()).or_default() += 1;
                        }
                    }
                    (step.estimate, step.covariance, None, None, step.places.map(|p| p.map(|_| 1.0)).to_vec())
                }
            };
            let (at, covariance, point_mm, p_lost, trust) = row;
            let (name, joint) = (frame.name.clone(), point.joint.clone());
            rows.push(Row {
                frame: frame.index,
                name,
                time: frame.time,
                joint,
                at,
                covariance,
                point_mm,
                p_lost,
                trust,
            });
            let all: f64 = times.iter().map(|(_, time)| time).sum();
            for (stage, time) in times.into_iter().chain([(ALL, all)]) {
                self.times.entry(stage).or_default().push(time);
            }
        }
        self.rows.append(&mut rows);
        Ok(())
    }

    /// What stages are timed by.
    pub fn clock(&self) -> Clock {
        self.rules.clock
    }

    /// Notes how long something took that is done elsewhere, milliseconds by the rules' clock.
    pub fn note(&mut self, stage: &'static str, ms: f64) {
        self.times.entry(stage).or_default().push(ms);
    }

    /// Of every stage the median, the 99th percentile and the longest time, milliseconds.
    pub fn latency(&self) -> Vec<(&'static str, [f64; 3])> {
        let line = |(stage, times): (&&'static str, &Vec<f64>)| {
            let all: Vec<usize> = (0..times.len()).collect();
            (*stage, [0.5, 0.99, 1.0].map(|share| quantile(times, &all, share)))
        };
        self.times.iter().map(line).collect()
    }

    /// The particles of each point.
    pub fn particles(&self) -> Vec<Vec<([f64; 2], f64)>> {
        let of = |point: &Point| match &point.filter {
            Filter::Sound(tracker) => tracker.particles().collect(),
            Filter::Thesis(filter) => filter.particles().collect(),
        };
        self.points.iter().map(of).collect()
    }

    /// The rows of the last frame.
    pub fn last(&self) -> &[Row] {
        let Some(last) = self.rows.last() else { return &[] };
        let count = self.rows.iter().rev().take_while(|row| row.frame == last.frame).count();
        &self.rows[self.rows.len() - count..]
    }
}

/// All stages of a frame and a point together.
const ALL: &str = "tracker, all of it";
/// Standard deviation of a first place, pixels.
const FIRST_SD: f64 = 10.0;
