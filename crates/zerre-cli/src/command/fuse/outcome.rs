//! What a run ends with: tables, the page, and what is said.

use super::TOLD;
use super::ears::Fate;
use super::feed::Feed;
use super::learn::Lesson;
use super::marks::{Marked, Marks};
use super::open::{FuseConfig, Learnt, Opened};
use crate::Exit;
use crate::args::{Fuse, FusePreset, Global, RoomFrom};
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::{EstimatesDigest, Folder, Input, Record, State};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use zerre_lab::fusion::{Clock, Follow, Row, Score, Watched, page, points_csv};
use zerre_lab::report::study::{Picture, render};
use zerre_vision::rgbd::RgbdFrame;

/// How far the points are off, where people have marked them.
pub(super) struct Scores {
    marks: Option<Marks>,
    all: Vec<Score>,
    /// Frames from which the sources were learnt.
    lesson: BTreeSet<usize>,
    /// Whether the sources were learnt on this very recording, or from these very marks.
    same: bool,
}

impl Scores {
    /// Marks that were learnt from are scored where no others are.
    pub(super) fn of(
        opened: &Opened,
        config: &FuseConfig,
        lesson: Option<&Lesson>,
        inputs: &[Input],
    ) -> Scores {
        let marks = opened.truth.clone().or_else(|| opened.lesson.clone());
        let path = marks.as_ref().map(|marks| marks.path.display().to_string());
        let same = |learnt: &Learnt| {
            let canonical = |path: &Path| path.canonicalize().ok();
            let here = canonical(&opened.recording);
            let of_marks = inputs.iter().filter(|input| Some(&input.path) == path.as_ref());
            (here.is_some() && canonical(Path::new(&learnt.recording)) == here)
                || of_marks.into_iter().any(|input| input.sha256 == learnt.marks_sha256)
        };
        Scores {
            // What is learnt now is known frame by frame.
            same: lesson.is_none() && config.learnt.as_ref().is_some_and(same),
            marks,
            all: opened
                .names
                .iter()
                .map(|joint| Score { joint: joint.clone(), ..Score::default() })
                .collect(),
            lesson: lesson.map(|lesson| lesson.frames.clone()).unwrap_or_default(),
        }
    }

    /// Scores the rows of a frame; gives where the points truly are.
    pub(super) fn see(&mut self, frame: &RgbdFrame, rows: &[Row]) -> Vec<[f64; 2]> {
        let mut truth = Vec::new();
        for score in &mut self.all {
            let marks = self.marks.as_ref().and_then(|marks| marks.joints.get(&score.joint));
            let Some(mark) = marks.and_then(|marks| marks.of(frame)) else { continue };
            truth.push(mark.at);
            if let Some(row) = rows.iter().find(|row| row.joint == score.joint) {
                let [dx, dy] = [0, 1].map(|k| row.at[k] - mark.at[k]);
                score.errors.push((frame.index, dx.hypot(dy)));
            }
        }
        truth
    }

    /// Frames that were scored and learnt from.
    fn in_sample(&self, score: &Score) -> usize {
        if self.same {
            return score.errors.len();
        }
        score.errors.iter().filter(|(frame, _)| self.lesson.contains(frame)).count()
    }

    /// The scores with what is to be said of them.
    fn told(&mut self) -> Vec<Score> {
        let mut all = self.all.clone();
        for score in &mut all {
            let marked = |marks: &Marks| marks.joints.get(&score.joint).cloned();
            let marked: Marked = self.marks.as_ref().and_then(marked).unwrap_or_default();
            score.floor = marked.floor;
            score.about = marked.about();
            let from = match self.in_sample(score) {
                0 => continue,
                _ if self.same => "on this recording".to_owned(),
                count => format!("from {count} of these frames"),
            };
            score.about += &format!(
                " In-sample: the sources were learnt {from}, and others will be followed less well."
            );
        }
        all.retain(|score| !score.errors.is_empty());
        all
    }

    /// Marks of which no frame was scored.
    fn unused(&self) -> usize {
        let marked =
            self.marks.iter().flat_map(|marks| marks.joints.values()).map(Marked::len).sum::<usize>();
        marked.saturating_sub(self.all.iter().map(|score| score.errors.len()).sum())
    }
}

/// What there is when the last frame is done.
pub(super) struct Outcome<'a> {
    pub args: &'a Fuse,
    pub options: &'a Global,
    pub opened: Opened,
    pub follow: Follow,
    pub scores: Scores,
    pub lesson: Option<Lesson>,
    pub feed: Feed,
    pub from: RoomFrom,
    pub film: Option<Picture>,
    pub count: u64,
    pub left_out: u64,
}

impl Outcome<'_> {
    /// Writes it all, and says it.
    pub(super) fn write(
        mut self,
        (mut folder, mut record): (Folder, Record),
        (mut notes, fate): (Vec<String>, Fate),
        console: &Console,
    ) -> Result<Exit, Diagnostic> {
        let (args, options) = (self.args, self.options);
        let dropped = self.feed.dropped();
        self.note(&mut notes, fate, dropped);
        notes.iter().for_each(|note| console.warn(note));
        let lost = self.follow.rows.iter().filter(|row| is_lost(row)).count();
        self.count(&mut record, fate, dropped, lost);
        let digest = digest(&self.follow);
        folder.write("points.csv", |file| file.write_all(points_csv(&self.follow).as_bytes()))?;
        let scores = self.scores.told();
        let rmse = scores.iter().find(|score| self.opened.names.first() == Some(&score.joint));
        let rmse = rmse.and_then(Score::rmse);
        let mut page = page(Watched {
            title: format!("Colour and depth: {}", args.recording.display()),
            facts: self.facts(dropped),
            follow: &self.follow,
            scores: scores.clone(),
            learnt: self.lesson.as_ref().map(Lesson::grid),
            film: self.film.take(),
            notes,
        });
        page.command = command_line(args, options);
        page.digest.clone_from(&digest);
        folder.write("report.html", |file| file.write_all(render(&page).as_bytes()))?;

        if record.state == State::Interrupted {
            console.warn(format_args!("stopped after {} frames", self.count));
        }
        record.estimates_digest = Some(digest.clone());
        let path = folder.finish(&record)?;
        if console.json() {
            let score = |score: &Score| {
                json!({
                    "joint": score.joint, "frames": score.errors.len(), "rmse_px": score.rmse(),
                    "reference_se_px": score.floor, "in_sample": self.scores.in_sample(score),
                })
            };
            let scores: Vec<Value> = scores.iter().map(score).collect();
            let mut document = json!({
                "joints": self.opened.names, "frames": self.count, "left_out": self.left_out, "lost_frames": lost,
                "rmse_px": rmse, "scores": scores, "latency": latency(&self.follow), "estimates_digest": digest,
                "state": record.state,
            });
            if self.feed.is_live() {
                document["dropped"] = dropped.into();
            }
            if let Some(lesson) = &self.lesson {
                document["learnt"] = json!({ "sources": lesson.known, "reference_sd": lesson.floor });
            }
            console.document(&document)?;
        }
        let score = rmse.map_or_else(String::new, |rmse| format!(", RMSE {} px", zerre_lab::number(rmse)));
        console.info(format_args!(
            "{} frames, {} points, flagged as lost {lost} times{score} in {:.1} s: {}",
            self.count,
            self.opened.names.len(),
            record.seconds,
            path.join("report.html").display()
        ));
        let lost_at_last = self.follow.last().iter().any(is_lost);
        Ok(if record.state == State::Interrupted || self.follow.rows.is_empty() {
            Exit::CouldNot
        } else if args.strict && lost_at_last {
            Exit::Degraded
        } else {
            Exit::Done
        })
    }

    /// What people should know beside the figures.
    fn note(&self, notes: &mut Vec<String>, fate: Fate, dropped: usize) {
        if self.left_out > TOLD as u64 {
            notes.push(format!("{} frames were left out; the first {TOLD} are named", self.left_out));
        }
        let rejected = &self.opened.joints.rejected;
        notes.extend(rejected.iter().take(TOLD).cloned());
        if rejected.len() > TOLD {
            notes.push(format!("{} rows of joints are bad; the first {TOLD} are named", rejected.len()));
        }
        let missing = self.opened.names.iter().filter(|name| !self.follow.has(name));
        notes.extend(missing.map(|name| format!("no frame says where {name} is: it was not followed")));
        for (number, what) in [
            (fate.early, "rows of joints are of times before the first frame"),
            (fate.late, "rows of joints are of times behind the last frame"),
            (fate.elsewhere, "rows of joints are of frames that are not there or cannot be read"),
            (self.scores.unused(), "marks are of frames in which the point is not followed"),
            (dropped, "frames were dropped: the next one came while one was at work"),
        ] {
            if number > 0 {
                notes.push(format!("{number} {what}"));
            }
        }
        let complaint = self.feed.complaint();
        notes.extend(complaint.map(|complaint| format!("{}: {complaint}", self.args.recording.display())));
    }

    fn count(&self, record: &mut Record, fate: Fate, dropped: usize, lost: usize) {
        let outcomes = self.feed.outcomes();
        let has_depth = self.follow.sources().iter().any(|source| source == "depth");
        record.counts.read = self.count;
        record.counts.used = self.count - self.left_out;
        record.counts.missing = self.opened.joints.missing as u64;
        let rejected = &mut record.counts.rejected;
        for (name, number) in [
            ("frame that was left out", self.left_out as usize),
            ("row of joints", self.opened.joints.rejected.len()),
        ] {
            if number > 0 {
                rejected.insert(name.to_owned(), number as u64);
            }
        }
        for (name, number) in [
            ("depth picture without a frame", outcomes.depth_alone),
            ("frame that was dropped", dropped),
            ("row of joints before the first frame", fate.early),
            ("row of joints behind the last frame", fate.late),
            ("row of joints of another frame", fate.elsewhere),
            ("row of joints that a later one replaced", fate.replaced),
            ("row of joints of a source that is left out", fate.left_out),
            ("row of joints of a joint that is not followed", self.opened.unasked),
            ("mark of a frame that is not followed", self.scores.unused()),
        ] {
            if number > 0 {
                record.counts.left_out.insert(name.to_owned(), number as u64);
            }
        }
        let without = if has_depth { outcomes.without_depth } else { 0 };
        for (name, action, number) in [
            ("frame without depth", "colour alone was used", without),
            ("depth picture that cannot be read", "colour alone was used", outcomes.unreadable_depth),
            ("point hidden", "it is flagged", lost),
        ] {
            if number > 0 {
                record.outcomes_of(name, action, number as u64);
            }
        }
    }

    fn facts(&self, dropped: usize) -> Vec<(String, String)> {
        let room = match self.from {
            RoomFrom::Pictures => "its own pictures",
            RoomFrom::Median => "the median of frames",
            RoomFrom::Running => "learnt frame by frame",
        };
        let filter = match self.args.preset {
            FusePreset::Sound => "mixtures with outliers (sound)",
            FusePreset::Thesis => "as in the thesis",
        };
        let frames = if self.feed.is_live() {
            format!("{} followed, {dropped} dropped", self.count)
        } else {
            self.count.to_string()
        };
        [
            ("Recording", self.args.recording.display().to_string()),
            ("Filter", filter.to_owned()),
            ("Empty room", room.to_owned()),
            ("Points", self.opened.names.join(", ")),
            ("Sources", self.follow.sources().join(", ")),
            ("Frames", frames),
            ("Seed", self.options.seed.to_string()),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .to_vec()
    }
}

fn is_lost(row: &Row) -> bool {
    row.p_lost.is_some_and(|p| p > 0.5)
}

/// Times of the stages by their names, milliseconds.
fn latency(follow: &Follow) -> Value {
    let stage = |(stage, [median, p99, longest]): (&str, [f64; 3])| {
        (stage.to_owned(), json!({ "median_ms": median, "p99_ms": p99, "longest_ms": longest }))
    };
    let clock = match follow.clock() {
        Clock::Processor => "processor",
        Clock::Wall => "wall",
    };
    let stages: serde_json::Map<String, Value> = follow.latency().into_iter().map(stage).collect();
    json!({ "clock": clock, "stages": stages })
}

fn digest(follow: &Follow) -> String {
    let mut digest = EstimatesDigest::default();
    for row in &follow.rows {
        let [[xx, xy], [_, yy]] = row.covariance;
        digest.push(&[row.frame as f64, row.at[0], row.at[1], xx, xy, yy, row.p_lost.unwrap_or(0.0)]);
    }
    digest.finish()
}

/// The command line that gives this run again.
fn command_line(args: &Fuse, options: &Global) -> String {
    let mut line = format!("zerre fuse {}", args.recording.display());
    let mut option = |name: &str, value: Option<String>| {
        if let Some(value) = value {
            line += &format!(" --{name} {value}");
        }
    };
    let path = |path: &Option<PathBuf>| path.as_deref().map(Path::display).map(|path| path.to_string());
    option("config", path(&args.config));
    option("joints", path(&args.joints));
    args.joint.iter().for_each(|joint| option("joint", Some(joint.clone())));
    option("start", args.start.map(|[x, y]| format!("{x},{y}")));
    args.without.iter().for_each(|name| option("without", Some(name.clone())));
    option("preset", (args.preset == FusePreset::Thesis).then(|| "thesis".to_owned()));
    option("room", args.room.and_then(|room| json!(room).as_str().map(str::to_owned)));
    option("camera", path(&args.camera));
    option("particles", args.particles.map(|particles| particles.to_string()));
    option("calibrate", path(&args.calibrate));
    option("truth", path(&args.truth));
    option("overlay", path(&args.overlay));
    let steps: Vec<String> = args.steps.iter().map(ToString::to_string).collect();
    option("steps", (!steps.is_empty()).then(|| steps.join(",")));
    option("seed", Some(options.seed.to_string()));
    line
}
