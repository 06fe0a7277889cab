//! The page.

use super::settings::{PICTURED_RUN, TIMED_FRAMES, TOLERANCE};
use super::tables::{NOT_AVAILABLE, Results, Row, Value, title};
use super::{OTHERS, PAPER};
use crate::report::study::{Grid, Picture, Section, Shown, StudyReport};
use zerre_vision::tracker::TRACKERS;

impl Results<'_> {
    /// The whole page, for a run that was `interrupted` or came to its end.
    pub(super) fn page(&self, pictures: Vec<Picture>, interrupted: bool) -> StudyReport {
        let experiment = self.experiment;
        let used = experiment.sequences();
        let facts = [
            ("Runs per cell", experiment.request.runs.to_string()),
            ("Seed", experiment.seed.to_string()),
            ("Sequences", if used.is_empty() { "none".to_owned() } else { used.join(", ") }),
            (
                "Settings chosen on",
                "the paper's trackers: no sequence, but its text and the readings named below; zerre: the nine shared \
                 sequences Basketball, Car4, Coke, Couple, Crossing, Deer, FaceOcc1, Girl, Suv, and its rule of losing \
                 on drawn clips"
                    .to_owned(),
            ),
        ];
        let mut sections = vec![self.verdict(), how_to_read(interrupted), self.left_open()];
        for table in &experiment.request.tables {
            let grid = match *table {
                "3" | OTHERS => self.whole_grid(table),
                table => self.frames_grid(table),
            };
            sections.push(Section { title: title(table), tables: vec![grid], ..Section::default() });
        }
        if !pictures.is_empty() {
            sections.push(Section {
                title: "Particles and weights".to_owned(),
                paragraphs: vec![format!(
                    "Run {}: the truth green and dashed, the box orange, or red and dashed where it is flagged as lost; particles \
                     from dark to bright by weight.",
                    PICTURED_RUN + 1
                )],
                pictures,
                ..Section::default()
            });
        }
        StudyReport {
            title: "Tracking by structural similarity, run many times".to_owned(),
            facts: facts.map(|(name, value)| (name.to_owned(), value)).to_vec(),
            sections,
            ..StudyReport::default()
        }
    }

    /// What reproduces and what does not, in words.
    fn verdict(&self) -> Section {
        let mut points = Vec::new();
        let beside = self.beside();
        let text = |v: f64| Shown::from(v).text;
        for found in &beside {
            let kept = match found.kept {
                Some(kept) if found.lost_share > 0.0 => {
                    format!(", {} px in the runs that kept it", text(kept.value))
                }
                _ => String::new(),
            };
            let verdict = match found.kept {
                _ if found.is_near(found.all) => "reproduced",
                Some(kept) if found.is_near(kept) => "reproduced in the runs that keep the object only",
                _ => "not reproduced",
            };
            points.push(format!(
                "{} on {}: {verdict}. Printed {} px, ours {} px{kept}; {:.0} % of the runs lost the object.",
                found.tracker,
                found.sequence,
                text(found.printed),
                text(found.all.value),
                100.0 * found.lost_share
            ));
        }
        let near = beside.iter().filter(|found| found.is_near(found.all)).count();
        let kept = beside.iter().filter(|f| f.is_near(f.all) || f.kept.is_some_and(|k| f.is_near(k))).count();
        let mut paragraphs = Vec::new();
        if !beside.is_empty() {
            paragraphs.push(format!(
                "Of {} printed errors of whole sequences that ours can be held against, {near} are within {:.0} % of ours \
                 over all runs, and {kept} within it when runs that lost the object are left out. A mean over ten runs of \
                 which some are lost says little: its size is that of the share of lost runs, which the paper does not \
                 give.",
                beside.len(),
                100.0 * TOLERANCE
            ));
        }
        let missing: Vec<String> = PAPER
            .tables
            .iter()
            .filter(|table| self.experiment.request.tables.contains(*table))
            .flat_map(|table| self.experiment.printed.sequences(table))
            .filter(|name| !self.experiment.sequences().contains(name))
            .map(str::to_owned)
            .collect();
        if !missing.is_empty() {
            let mut missing = missing;
            missing.sort();
            missing.dedup();
            paragraphs.push(format!(
                "Not available: {}. Name a folder that has them with --data (each in a folder of its own, as the \
                 benchmark distributes them).",
                missing.join(", ")
            ));
        }
        Section { title: "What reproduces".to_owned(), paragraphs, points, ..Section::default() }
    }

    /// What the paper leaves out, and what its own tables say of each other.
    fn left_open(&self) -> Section {
        let printed = &self.experiment.printed;
        let text = |v: f64| Shown::from(v).text;
        let mut points: Vec<String> = [
            "The matrix A and the noise of its motion: constant velocity, a tenth of the box's side and one pixel a frame \
             are our reading.",
            "Whether the box changes: the state has width and height, the trackers do not use them. It is fixed here.",
            "How optical flow enters: it takes the place of the particles' velocities here, for the structural trackers, in \
             whose section it stands.",
            "Kernel of the smoothing, clip limit and tiles of the equalisation, window of the local means: 5 x 5, 2 with 8 \
             x 8 tiles, and 7 x 7.",
            "What becomes of the template after the first frame. It stays; blended templates are an option that makes some \
             sequences far better and others far worse.",
            "What the Gaussian weight of the middle is applied to: both patches are multiplied by it. Nearly black borders \
             are then alike everywhere, so that distances shrink; with the paper's sigma this softens the weights, and a \
             part of what the weighting gains is that.",
            "How weights of zero are handled: with the paper's sigma the likelihood underflows for almost every particle. \
             Weights are logarithms here; still the mean of the particles is often one particle.",
            "The resampling scheme, and whether an error at a frame is that of the frame or up to it. The latter is read.",
            "Standard deviations over its ten runs, and how many of them lost the object.",
        ]
        .map(str::to_owned)
        .to_vec();
        for sequence in printed.sequences("3") {
            for table in ["1", "2"] {
                let Some(last) = printed.frames(table, sequence).last().copied() else { continue };
                for tracker in printed.trackers() {
                    let up_to = printed.rmse(table, sequence, Some(last), tracker);
                    let whole = printed.rmse("3", sequence, None, tracker);
                    let (Some(up_to), Some(whole)) = (up_to, whole) else { continue };
                    if (up_to - whole).abs() > 0.005 {
                        points.push(format!(
                            "Its tables differ: {tracker} on {sequence} has {} px at frame {last} in table {table}, {} px in \
                             table 3.",
                            text(up_to),
                            text(whole)
                        ));
                    }
                }
            }
        }
        let of = |sequence: &str, tracker: &str| printed.rmse("3", sequence, None, tracker);
        let sequences = printed.sequences("3");
        let worse = sequences.iter().filter(|s| of(s, "ssimfahe") > of(s, "ssim")).count();
        points.push(format!(
            "By its own table 3, smoothing and equalisation make the structural tracker worse on {worse} of {} sequences; \
             most of what it gains over colour is the change to structure.",
            sequences.len()
        ));
        Section {
            title: "What the paper leaves open, and what contradicts".to_owned(),
            points,
            ..Section::default()
        }
    }

    fn shown(row: &Row) -> Shown {
        match row.value {
            Value::Number(_) if row.metric == "fps" => Shown::from(row.numbers().map(|[value, ..]| value)),
            Value::Number(_) => Shown::from(row.estimate()),
            Value::Missing(why) => why.into(),
        }
    }

    /// A line for each sequence and tracker.
    fn whole_grid(&self, table: &str) -> Grid {
        let rows = self.of_table(table);
        let columns = [
            ("RMSE (px)", "rmse_px", "mean"),
            ("where kept", "rmse_px", "mean-kept"),
            ("lost runs", "lost_share", "mean"),
            ("precision at 20 px", "precision20", "mean"),
            ("success AUC", "success_auc", "mean"),
            ("overlap", "iou", "mean"),
            ("in the 95 % ellipse", "coverage95", "mean"),
            ("frames a second", "fps", "mean"),
        ];
        let mut keys: Vec<(&str, &str)> = Vec::new();
        for row in &rows {
            if !keys.contains(&(&row.sequence, &row.tracker)) {
                keys.push((&row.sequence, &row.tracker));
            }
        }
        let line =
            |(sequence, tracker): &(&str, &str)| -> Vec<Shown> {
                let of = |metric: &str, statistic: &str| {
                    rows.iter().find(|row| {
                        (row.sequence.as_str(), row.tracker.as_str()) == (*sequence, *tracker)
                            && (row.metric, row.statistic) == (metric, statistic)
                    })
                };
                let printed = of("rmse_px", "mean").and_then(|row| row.paper_value);
                let mut line: Vec<Shown> = vec![(*sequence).into(), (*tracker).into()];
                if table != OTHERS {
                    line.push(printed.into());
                }
                line.extend(columns.iter().map(|(_, metric, statistic)| {
                    of(metric, statistic).map_or(Shown::from("–"), Self::shown)
                }));
                line
            };
        let mut head = vec!["sequence".to_owned(), "tracker".to_owned()];
        if table != OTHERS {
            head.push("printed".to_owned());
        }
        head.extend(columns.iter().map(|(name, ..)| (*name).to_owned()));
        Grid {
            caption: "Means over runs with 95 % intervals (Student's t)".to_owned(),
            head,
            rows: keys.iter().map(line).collect(),
        }
    }

    /// A line for each frame: of every tracker what is printed and ours.
    fn frames_grid(&self, table: &str) -> Grid {
        let rows = self.of_table(table);
        let printed = self.experiment.printed.trackers();
        let mut head = vec!["sequence".to_owned(), "frame".to_owned()];
        for kind in TRACKERS {
            if printed.contains(&kind.name) {
                head.push(format!("{}, printed", kind.name));
            }
            head.push(kind.name.to_owned());
        }
        let mut lines = Vec::new();
        for sequence in self.experiment.printed.sequences(table) {
            for frame in self.experiment.printed.frames(table, sequence) {
                let mut line: Vec<Shown> = vec![sequence.into(), frame.to_string().as_str().into()];
                for kind in TRACKERS {
                    let of = rows.iter().find(|row| {
                        (row.sequence.as_str(), row.tracker.as_str(), row.frame)
                            == (sequence, kind.name, Some(frame))
                    });
                    if printed.contains(&kind.name) {
                        line.push(of.and_then(|row| row.paper_value).into());
                    }
                    let is_there = self.experiment.sequences().contains(&sequence);
                    let nothing = if is_there { "–" } else { NOT_AVAILABLE };
                    line.push(of.map_or(Shown::from(nothing), Self::shown));
                }
                lines.push(line);
            }
        }
        Grid {
            caption: "Root mean square error of the centre up to each frame, px: printed, then ours with the 95 % interval"
                .to_owned(),
            head,
            rows: lines,
        }
    }
}

fn how_to_read(interrupted: bool) -> Section {
    let mut paragraphs = vec![format!(
        "Every run starts on the annotated box of the first frame. RMSE is the root mean square distance of the box's centre \
         from the annotated one over the frames of a run; a run is lost when its box is off the object in its last frames \
         to the end. Precision is the share of frames within 20 px, success AUC the mean over 21 thresholds of the share \
         of frames whose overlap exceeds them. Ellipses are counted in frames that the tracker does not flag as lost; the \
         flags of the paper's trackers follow a rule of ours, for the paper has none. Frames a second are those of processor \
         time in the tracker alone, over at most {TIMED_FRAMES} frames, each tracker in its own turn in one thread."
    )];
    if interrupted {
        paragraphs.push(
            "This run was stopped before its end: cells that are missing were not computed.".to_owned(),
        );
    }
    Section { title: "How to read this".to_owned(), paragraphs, ..Section::default() }
}
