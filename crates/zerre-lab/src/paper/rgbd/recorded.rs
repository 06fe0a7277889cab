//! Recordings of a real depth camera. Nobody has marked them and there is no skeleton in them, so that
//! nothing can be scored: what is told is whether both ways go through, what they find and how long they
//! take, with pictures for people to judge by.

use super::pictures::{DRAWN, Painted, some};
use super::settings::{CHOSEN, CUES, RECORDED, RECORDED_FRAMES, RECORDED_RATE_HZ, RecordedClip};
use super::tables::Row;
use super::timing::{Clock, Timed};
use crate::fusion::{PointScene, ShownPoint};
use crate::report::animation::{Colour, Frame, Pen};
use crate::report::overlay::{Drawn, pictured, sheet, shown};
use crate::report::study::{Grid, Section, Shown};
use crate::study::interval::quantile;
use crate::study::table::{Entry, Table};
use std::path::{Path, PathBuf};
use zerre::rng::Stream;
use zerre_vision::frames::folder;
use zerre_vision::operator::crop;
use zerre_vision::rgbd::background::MedianRoom;
use zerre_vision::rgbd::recording::{Recording, RecordingOptions};
use zerre_vision::rgbd::thesis::{Thesis, ThesisSettings};
use zerre_vision::rgbd::tracker::{PointTracker, TrackerSettings};
use zerre_vision::rgbd::{Depth, NO_DEPTH, Reading, Registration, RgbdFrame};
use zerre_vision::{Error, Frame as Colours, Result};

/// Frames that a room is the median of, at most.
const ROOM_OF: usize = 31;
/// Pictures side by side, and their width, px.
const ACROSS: usize = 3;
const CELL: u16 = 420;
/// What the thesis's filter is drawn in.
const THESIS: Colour = [60, 220, 255, 220];

/// Recordings on disk.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Recordings {
    folder: Option<PathBuf>,
}

impl Recordings {
    /// Those of [`RECORDED`] that lie in a folder, each in one of its own.
    pub fn within(folder: PathBuf) -> Recordings {
        Recordings { folder: Some(folder) }
    }

    fn path(&self, clip: &RecordedClip) -> Option<PathBuf> {
        self.folder.as_ref().map(|folder| folder.join(clip.name)).filter(|path| path.is_dir())
    }

    /// Names of those that are there.
    pub fn names(&self) -> Vec<&'static str> {
        RECORDED.iter().filter(|clip| self.path(clip).is_some()).map(|clip| clip.name).collect()
    }
}

/// What became of a clip.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Judged {
    pub(super) clip: &'static RecordedClip,
    /// Frames that could be read.
    read: usize,
    /// Of these, without depth.
    without_depth: usize,
    /// Frames that both filters were given: those behind the first place.
    followed: usize,
    /// Pictures that could not be read, and steps that a filter refused.
    failures: usize,
    /// Frames in which a source said nothing: [`CUES`].
    silent: [usize; CUES.len()],
    /// Frames that the sound filter flagged as lost.
    lost: usize,
    /// Estimates of both filters: they are part of the digest.
    estimates: Vec<[f64; 2]>,
    /// Processor time.
    pub(super) times: Vec<Timed>,
    /// Some frames with both filters.
    pub(super) film: Option<Painted>,
}

/// The number in a frame's name.
fn number(frame: &RgbdFrame) -> Option<u32> {
    Path::new(&frame.name).file_stem()?.to_str()?.parse().ok()
}

fn unfit(error: impl std::fmt::Display) -> Error {
    Error::Input { input: "a picture of the page".to_owned(), problem: error.to_string() }
}

/// The middle of the depths that were measured within five pixels of a place.
fn depth_at(frame: &RgbdFrame, [x, y]: [f64; 2]) -> Option<f64> {
    let near = crop(&frame.depth, x as isize - 5, y as isize - 5, 11, 11);
    let mut known: Vec<u16> = near.pixels().iter().copied().filter(|mm| *mm != NO_DEPTH).collect();
    known.sort_unstable();
    known.get(known.len() / 2).map(|mm| f64::from(*mm))
}

/// Depth as its own camera saw it, from the file that belongs to a frame; `None` where there is none.
fn raw(path: &Path, frame: &RgbdFrame) -> Option<Depth> {
    let name = Path::new(&frame.name).with_extension("png");
    folder::depth(&path.join("depth").join(name)).ok()
}

/// A frame with both filters on it.
fn drawn(
    frame: &RgbdFrame,
    tracked: &ShownPoint,
    (at, particles): ([f64; 2], Vec<[f64; 2]>),
) -> crate::Result<Frame> {
    let size = shown(frame.colour.size(), CELL, CELL);
    let points = std::slice::from_ref(tracked);
    let mut drawn = PointScene { frame: &frame.colour, name: &frame.name, points, truth: &[] }.draw(size)?;
    let scale = f64::from(size[0]) / frame.colour.width() as f64;
    drawn.dots(particles.iter().map(|p| p.map(|v| scale * v)), 1.2, THESIS);
    let [x, y] = at.map(|v| scale * v);
    let pen = Pen { colour: THESIS, width: 2.0, dashed: false };
    for sign in [-1.0, 1.0] {
        drawn.line([[x - 5.0, y - sign * 5.0], [x + 5.0, y + sign * 5.0]], pen);
    }
    Ok(drawn)
}

/// The empty room: the median of the frames that the clip names, or of all.
fn room(path: &Path, clip: &RecordedClip, options: &RecordingOptions) -> Result<(Colours, Depth)> {
    let mut median = MedianRoom::new(ROOM_OF);
    for frame in Recording::open(path, options)?.flatten() {
        let [first, last] = clip.empty;
        if number(&frame).is_some_and(|number| (first..=last).contains(&number)) {
            median.add(&frame)?;
        }
    }
    let room = median.finish()?;
    Ok((room.colour().clone(), room.depth().clone()))
}

/// Both filters through a clip, from the frame in which its first place is on.
fn judge_one(
    path: &Path,
    clip: &'static RecordedClip,
    (settings, thesis): (&TrackerSettings, &ThesisSettings),
    stream: Stream,
) -> Result<Judged> {
    let options = RecordingOptions { rate_hz: RECORDED_RATE_HZ, ..RecordingOptions::default() };
    let empty = room(path, clip, &options)?;
    let mut recording = Recording::open(path, &options)?;
    let Some(camera) = recording.camera() else {
        let problem = "there is no camera.json beside it".to_owned();
        return Err(Error::Input { input: path.display().to_string(), problem });
    };
    let first = Reading { at: clip.first.1, depth_mm: None, confidence: 1.0 };
    let behind = recording.expected().unwrap_or(0).saturating_sub(clip.first.0 as usize);
    let mut judged = Judged {
        clip,
        read: 0,
        without_depth: 0,
        followed: 0,
        failures: 0,
        silent: [0; CUES.len()],
        lost: 0,
        estimates: Vec::new(),
        times: Vec::new(),
        film: None,
    };
    let mut clock = Clock::new(CHOSEN);
    let mut registration: Option<Registration> = None;
    let mut filters: Option<(PointTracker, Thesis, [f64; 2])> = None;
    let mut cells = Vec::new();
    for frame in recording.by_ref() {
        let Ok(frame) = frame else {
            judged.failures += 1;
            continue;
        };
        if let Some(raw) = raw(path, &frame) {
            let sizes = (raw.size(), frame.colour.size());
            let register = match registration.take() {
                Some(known) => known,
                None => Registration::new(camera, sizes.0, sizes.1)?,
            };
            clock.begin();
            register.register(&raw)?;
            clock.end("registration");
            registration = Some(register);
        }
        let Some((tracker, old, last)) = &mut filters else {
            if number(&frame) == Some(clip.first.0) {
                let (settings, thesis) = (settings.clone(), thesis.clone());
                let room = (empty.clone(), camera.colour);
                let begin = Reading { depth_mm: depth_at(&frame, first.at), ..first };
                filters = Some((
                    PointTracker::start(settings, room, (&frame, begin), stream)?,
                    Thesis::start(thesis, empty.clone(), first.at, stream)?,
                    first.at,
                ));
            }
            continue;
        };
        clock.begin();
        let mut sum = 0.0;
        let tracked = tracker.step(&frame, &[], &mut |stage| sum += clock.end(stage.name()));
        clock.note("fused", sum);
        // There is no device: its joint is what the filter itself said last.
        let joint = Reading { at: *last, ..first };
        clock.begin();
        let step = old.step(&frame, Some(&joint), [None, None]);
        clock.end("thesis");
        judged.failures += usize::from(tracked.is_err()) + usize::from(step.is_err());
        let (Ok(tracked), Ok(step)) = (tracked, step) else { continue };
        *last = step.estimate;
        judged.followed += 1;
        judged.lost += usize::from(tracked.fused.is_lost());
        let found = |k: usize| {
            tracked.said.get(k).and_then(Option::as_ref).is_some_and(|said| !said.readings.is_empty())
        };
        let found = [found(0), found(1), step.places[1].is_some(), step.places[2].is_some()];
        judged.silent.iter_mut().zip(found).for_each(|(silent, found)| *silent += usize::from(!found));
        judged.estimates.extend([tracked.fused.at, step.estimate]);
        let k = judged.followed - 1;
        let of = |cell: usize| cell * behind.saturating_sub(1) / (RECORDED_FRAMES - 1).max(1);
        if (0..RECORDED_FRAMES).any(|cell| of(cell) == k) {
            let point = ShownPoint {
                at: tracked.fused.at,
                covariance: tracked.fused.covariance,
                lost: tracked.fused.is_lost(),
                particles: some(tracker.particles(), settings.fusion.particles.min(DRAWN)),
            };
            let particles = some(old.particles(), thesis.particles);
            cells.push(drawn(&frame, &point, (step.estimate, particles)).map_err(unfit)?);
        }
    }
    let outcomes = recording.outcomes();
    judged.read = outcomes.read;
    judged.without_depth = outcomes.without_depth + outcomes.unreadable_depth;
    judged.failures += outcomes.unreadable_depth;
    judged.times = clock.stages();
    if let Some(sheet) = sheet(&cells.iter().collect::<Vec<_>>(), ACROSS).map_err(unfit)? {
        let title = format!("{}: {}", clip.name, clip.follows);
        judged.film = Some(pictured(&title, &format!("{}.png", clip.condition), &sheet)?);
    }
    Ok(judged)
}

/// Both filters through every clip that is there.
pub(super) fn judge(
    recordings: &Recordings,
    settings: (&TrackerSettings, &ThesisSettings),
    stream: Stream,
) -> Result<Vec<Judged>> {
    let there = RECORDED.iter().filter_map(|clip| Some((clip, recordings.path(clip)?)));
    there.map(|(clip, path)| judge_one(&path, clip, settings, stream)).collect()
}

impl Judged {
    fn share(&self, count: usize) -> f64 {
        count as f64 / self.followed as f64
    }

    /// What it adds to the table.
    pub(super) fn rows(&self) -> Vec<Row> {
        let row = |source: &str, metric, statistic, value: f64| Row {
            condition: self.clip.condition,
            frames: "all",
            source: source.to_owned(),
            particles: CHOSEN,
            metric,
            statistic,
            value,
            low: value,
            high: value,
            paper_value: None,
        };
        let mut rows = vec![
            row("recording", "frames_read", "pooled", self.read as f64),
            row("recording", "frames_without_depth", "pooled", self.without_depth as f64),
            row("recording", "frames_followed", "pooled", self.followed as f64),
            row("recording", "failures", "pooled", self.failures as f64),
        ];
        if self.followed > 0 {
            let silent = CUES.iter().zip(self.silent);
            rows.extend(silent.map(|(name, n)| row(name, "silent_share", "pooled", self.share(n))));
            rows.push(row("fused", "lost_share", "pooled", self.share(self.lost)));
        }
        for timed in &self.times {
            let all: Vec<usize> = (0..timed.times.len()).collect();
            for (statistic, share) in [("median", 0.5), ("p99", 0.99)] {
                rows.push(row(&timed.stage, "ms_per_frame", statistic, quantile(&timed.times, &all, share)));
            }
        }
        rows
    }

    /// What the digest is of, beside the rows.
    pub(super) fn estimates(&self) -> impl Iterator<Item = f64> {
        self.estimates.iter().flatten().copied()
    }
}

/// One row for each clip; those that are not there say so.
pub(super) fn table(all: &[Judged]) -> Table {
    let head = [
        "recording",
        "state",
        "frames_read",
        "frames_without_depth",
        "frames_followed",
        "failures",
        "found_color",
        "found_depth",
        "found_thesis_color",
        "found_thesis_depth",
        "lost_share",
    ];
    let rows = RECORDED.iter().map(|clip| {
        let Some(judged) = all.iter().find(|judged| judged.clip.name == clip.name) else {
            let mut row = vec![Entry::from(clip.name), "not available".into()];
            row.resize(head.len(), Entry::Missing);
            return row;
        };
        let counts = [judged.read, judged.without_depth, judged.followed, judged.failures];
        let mut row = vec![Entry::from(clip.name), "followed".into()];
        row.extend(counts.map(Entry::from));
        row.extend(judged.silent.map(|n| Entry::from(1.0 - judged.share(n))));
        row.push(judged.share(judged.lost).into());
        row
    });
    Table::new("table-recorded", "Recordings of a real depth camera.", &head, rows.collect())
}

/// The part of the page.
pub(super) fn section(all: &[Judged]) -> Section {
    let missing: Vec<&str> = RECORDED
        .iter()
        .map(|clip| clip.name)
        .filter(|name| all.iter().all(|judged| judged.clip.name != *name))
        .collect();
    let mut section = Section { title: "Recordings of a real camera".to_owned(), ..Section::default() };
    if !missing.is_empty() {
        section.paragraphs.push(format!(
            "Not available: {}. Name the folder that holds them with --data.",
            missing.join(", ")
        ));
    }
    if all.is_empty() {
        return section;
    }
    section.paragraphs.extend(
        [
            "One fixed camera (PrimeSense), 640 x 480, depth not registered to colour, a few frames a second at uneven \
             times. Nobody has marked them, there is no skeleton, no empty room was recorded apart: accuracy cannot be \
             scored. The first place was set by hand. The sound filter has its two cues and no device, with what was \
             learnt of them from the drawn calibration clips; the thesis's filter gets its own last estimate as the \
             device's joint, since its window needs one: it can be drawn to what its pipelines find there, and is not \
             corrected by anything else.",
            "In the pictures: orange cross, 95 % ellipse and yellow particles of the sound filter, red and dashed where it \
             flags the point as lost; blue the particles and the estimate of the thesis's.",
        ]
        .map(str::to_owned),
    );
    section.points = all.iter().map(|judged| format!("{}: {}", judged.clip.name, judged.clip.seen)).collect();
    section.pictures = all.iter().filter_map(|judged| Some(judged.film.as_ref()?.0.clone())).collect();
    let percent = |share: f64| Shown::from(format!("{:.0} %", 100.0 * share).as_str());
    let count = |count: usize| Shown::from(count.to_string().as_str());
    let line = |judged: &Judged| {
        let mut row = vec![Shown::from(judged.clip.name)];
        row.extend([judged.read, judged.without_depth, judged.followed, judged.failures].map(count));
        row.extend(judged.silent.map(|n| percent(1.0 - judged.share(n))));
        row.push(percent(judged.share(judged.lost)));
        row
    };
    let head = [
        "recording",
        "frames read",
        "without depth",
        "followed",
        "failures",
        "colour finds something",
        "depth",
        "thesis's colour",
        "thesis's depth",
        "flagged as lost",
    ];
    section.tables.push(Grid {
        caption: "What was read and found. A cue that finds something need not have found the right thing."
            .to_owned(),
        head: head.map(str::to_owned).to_vec(),
        rows: all.iter().map(line).collect(),
    });
    let mut stages: Vec<&str> = Vec::new();
    for timed in all.iter().flat_map(|judged| &judged.times) {
        if !stages.contains(&timed.stage.as_str()) {
            stages.push(&timed.stage);
        }
    }
    let times = |stage: &&str| {
        let mut row = vec![Shown::from(*stage)];
        for judged in all {
            let Some(timed) = judged.times.iter().find(|timed| timed.stage == *stage) else {
                row.push(Shown::default());
                continue;
            };
            let places: Vec<usize> = (0..timed.times.len()).collect();
            let at = |share| Shown::from(quantile(&timed.times, &places, share));
            row.push(Shown { aside: at(0.99).text, ..at(0.5) });
        }
        row
    };
    section.tables.push(Grid {
        caption: format!(
            "Processor time, ms per frame, {CHOSEN} particles, one thread: median, and behind it the 99th percentile. \
             `fused` is the sum of its stages, `thesis` both pipelines and the filter; reading the files is in none."
        ),
        head: std::iter::once("stage").chain(all.iter().map(|j| j.clip.name)).map(str::to_owned).collect(),
        rows: stages.iter().map(times).collect(),
    });
    section
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use zerre_vision::frames::folder::{depth_png, png};
    use zerre_vision::rgbd::scene::{Scene, SceneSettings};

    /// Seven frames of a drawn recording under the name of a real one, the fifth of which is no picture, the
    /// sixth without depth.
    #[test]
    fn recordings_are_followed_and_what_fails_is_counted() {
        let within = std::env::temp_dir().join(format!("zerre-paper-rgbd-{}", std::process::id()));
        let _ = fs::remove_dir_all(&within);
        let path = within.join(RECORDED[0].name);
        fs::create_dir_all(path.join("rgb")).unwrap();
        fs::create_dir_all(path.join("depth")).unwrap();
        let scene = Scene::new(SceneSettings::calibration(), 3).unwrap();
        let camera = scene.camera();
        let lens = |lens: zerre_vision::rgbd::Intrinsics| {
            format!("{{\"focal\": {:?}, \"principal\": {:?}}}", lens.focal, lens.principal)
        };
        let text = format!(
            "{{\"colour\": {}, \"depth\": {}, \"rotation\": {:?}, \"translation\": {:?}}}",
            lens(camera.colour),
            lens(camera.depth),
            camera.rotation,
            camera.translation
        );
        fs::write(within.join("camera.json"), text).unwrap();
        for k in 0..7 {
            let colours = png(&scene.frame(k).colour).unwrap();
            let colours = if k == 4 { b"none".to_vec() } else { colours };
            fs::write(path.join(format!("rgb/{:04}.png", k + 1)), colours).unwrap();
            if k != 5 {
                let depth = depth_png(&scene.raw_depth(k)).unwrap();
                fs::write(path.join(format!("depth/{:04}.png", k + 1)), depth).unwrap();
            }
        }
        let recordings = Recordings::within(within.clone());
        assert_eq!(recordings.names(), [RECORDED[0].name]);
        let mut settings = TrackerSettings::default();
        settings.sources.clear();
        let all = judge(&recordings, (&settings, &ThesisSettings::default()), Stream::new(1)).unwrap();
        fs::remove_dir_all(&within).unwrap();
        let [judged] = &all[..] else { panic!("{}", all.len()) };
        // Of seven, one cannot be read; the first three are before the point is followed or begin it.
        assert_eq!((judged.read, judged.without_depth, judged.followed, judged.failures), (6, 1, 3, 1));
        assert_eq!(judged.estimates.len(), 6);
        let count = |stage: &str| judged.times.iter().find(|t| t.stage == stage).map(|t| t.times.len());
        assert_eq!((count("registration"), count("fused"), count("thesis")), (Some(5), Some(3), Some(3)));
        let (picture, bytes) = judged.film.as_ref().unwrap();
        assert!(picture.file == "recorded-um.png" && bytes.starts_with(b"\x89PNG"));
        let table = table(&all).csv();
        assert!(
            table.contains("\num,followed,6,1,3,1,") && table.contains("\ncorridor,not available,,"),
            "{table}"
        );
        let section = section(&all);
        assert!(section.paragraphs[0].starts_with("Not available: filinha, corridor."));
        assert_eq!(section.pictures.len(), 1);
    }
}
