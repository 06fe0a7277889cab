//! `zerre compare`: estimates against truth.

use crate::Exit;
use crate::args::{Compare, Global};
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::{Destination, Folder, Hashing, Input, Record};
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::time::Instant;
use zerre::{Span, Time};
use zerre_io::{Options, Trajectories, Trajectory};
use zerre_lab::metric::{METRICS, anees, coverage, crps_gaussian, gospa, median_error, nees, ospa, rmse};

const COMMAND: &str = "compare";
/// The order of GOSPA and OSPA.
const ORDER: f64 = 2.0;
const LEVELS: [f64; 3] = [0.5, 0.9, 0.95];
/// Metrics of the error's size against what the covariance says.
const NEED_COVARIANCE: [&str; 3] = ["crps", "nees", "coverage"];

pub(super) fn run(args: &Compare, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let since = Instant::now();
    let known: Vec<_> = METRICS.iter().map(|metric| metric.name).collect();
    if let Some(name) = args.metric.iter().find(|name| !known.contains(&name.as_str())) {
        return Err(super::unknown("metric", name, &known));
    }
    for (option, value) in [("--cutoff-m", args.cutoff_m), ("--max-gap-s", args.max_gap_s)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(Diagnostic::usage(format!("{option} is {value}; a number above zero is needed")));
        }
    }
    if args.metric.iter().any(|name| name == "nis") {
        return Err(Diagnostic::new("nis compares innovations with their covariance, which no table holds")
            .help("`zerre track` prints it; choose another metric here"));
    }
    let (estimates, of_estimates) = read(&args.estimates, &Options::default())?;
    let origin = estimates.summary.frame.as_ref().map(|frame| frame.origin());
    let (truth, of_truth) = read(&args.truth, &Options { origin, ..Options::default() })?;
    if estimates.summary.frame.is_some() != truth.summary.frame.is_some() {
        let what = "one table has positions on Earth and the other in metres: they have no common frame";
        return Err(Diagnostic::new(what).help("`zerre track --truth` scores in the frame of the recording"));
    }
    let matched = Matched::new(&estimates, &truth, args);
    let scores = matched.scores(&args.metric)?;
    if args.metric.is_empty() && !matched.has_covariance() {
        console.info(no_covariance(&args.estimates));
    } else if args.metric.is_empty() && !scores.iter().any(|score| score.key == "nees") {
        console.warn("an estimate has a covariance that is not positive definite: no nees, no coverage");
    } else if let Some(name) = args.metric.iter().find(|name| NEED_COVARIANCE.contains(&name.as_str()))
        && !matched.has_covariance()
    {
        return Err(Diagnostic::new(no_covariance(&args.estimates)).help(format!("leave {name} out")));
    }

    let config = json!({
        "metric": args.metric, "cutoff_m": args.cutoff_m, "order": ORDER, "max_gap_s": args.max_gap_s,
    });
    let destination = Destination::of(options, COMMAND, Some(&args.estimates))
        .reading([args.estimates.as_path(), args.truth.as_path()]);
    let folder = Folder::open(&destination, COMMAND)?;
    let mut record = Record::new(COMMAND, options.seed, config);
    record.input = vec![of_estimates, of_truth];
    for table in [&estimates, &truth] {
        let counts = &table.summary.counts;
        record.counts.read += counts.read;
        record.counts.used += counts.used;
        record.counts.missing += counts.missing;
        for (reason, count) in &counts.rejected {
            *record.counts.rejected.entry((*reason).to_owned()).or_default() += count;
        }
    }
    record.seconds = since.elapsed().as_secs_f64();
    folder.finish(&record)?;

    if console.json() {
        let keys: Map<String, Value> =
            scores.iter().map(|score| (score.key.to_owned(), json!(score.value))).collect();
        console.document(&json!({
            "association": matched.association, "instants": matched.instants, "scores": keys,
        }))?;
    } else {
        console.info(matched.sentence());
        console.result(&table(&scores))?;
    }
    Ok(Exit::Done)
}

fn no_covariance(file: &Path) -> String {
    let columns = "var_x_m2, cov_xy_m2 and var_y_m2";
    format!("{} has no columns {columns}: crps, nees and coverage need them", file.display())
}

/// Reads a table, and digests the bytes along.
fn read(path: &Path, options: &Options) -> Result<(Trajectories, Input), Diagnostic> {
    let name = path.display().to_string();
    let unreadable = |error| Diagnostic::io("read", path, &error);
    let mut input = BufReader::new(Hashing::new(File::open(path).map_err(unreadable)?));
    let table =
        Trajectories::read(&name, &mut input, options).map_err(|error| Diagnostic::new(error.to_string()))?;
    Ok((table, input.into_inner().finish(&name).map_err(unreadable)?))
}

/// How estimates found their truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Association {
    /// By the same identity.
    Id,
    /// One estimated target, one true one.
    Only,
    /// At each instant the pairs of GOSPA.
    Gospa,
}

/// How many estimates were compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
struct Instants {
    /// Estimates with a true position.
    compared: usize,
    /// Estimates without one: of no true target, or at a time without truth.
    unmatched: usize,
    /// Instants of estimates, at which sets were compared.
    sets: usize,
    /// True positions at these instants without an estimate near enough.
    missed: usize,
}

/// Estimates beside the truth they belong to.
struct Matched {
    association: Association,
    instants: Instants,
    estimate: Vec<[f64; 2]>,
    truth: Vec<[f64; 2]>,
    /// As many as estimates, if all of them have one.
    covariance: Vec<[f64; 4]>,
    /// Mean over instants: GOSPA with its shares, OSPA.
    sets: Option<Sets>,
    cutoff: f64,
}

/// Distances between the set of estimates and the set of true positions, averaged over instants.
#[derive(Clone, Copy, Default)]
struct Sets {
    gospa: f64,
    localisation: f64,
    missed: f64,
    false_tracks: f64,
    ospa: f64,
}

/// A number of the result.
struct Score {
    key: &'static str,
    value: f64,
    unit: &'static str,
    note: String,
}

/// The identity in the truth: `zerre track` calls the second track of a target `id#2`.
fn target_of<'a>(id: &'a str, truth: &Trajectories) -> &'a str {
    if truth.by_id.contains_key(id) { id } else { id.split_once('#').map_or(id, |(target, _)| target) }
}

fn plane(position: [f64; 3]) -> [f64; 2] {
    [position[0], position[1]]
}

impl Matched {
    fn new(estimates: &Trajectories, truth: &Trajectories, args: &Compare) -> Matched {
        let max_gap = Span::from_secs(args.max_gap_s);
        let common = estimates.by_id.keys().any(|id| truth.by_id.contains_key(target_of(id, truth)));
        let association = if common {
            Association::Id
        } else if estimates.by_id.len() == 1 && truth.by_id.len() == 1 {
            Association::Only
        } else {
            Association::Gospa
        };
        let mut matched = Matched {
            association,
            instants: Instants::default(),
            estimate: Vec::new(),
            truth: Vec::new(),
            covariance: Vec::new(),
            sets: None,
            cutoff: args.cutoff_m,
        };
        if association != Association::Gospa {
            for (id, trajectory) in &estimates.by_id {
                let own = match association {
                    Association::Only => truth.by_id.values().next(),
                    _ => truth.by_id.get(target_of(id, truth)),
                };
                for point in trajectory.points() {
                    matched.compare(point, own.and_then(|own| own.at(point.time, max_gap)));
                }
            }
        }
        matched.compare_sets(estimates, truth, max_gap);
        if matched.covariance.len() < matched.estimate.len() {
            matched.covariance.clear();
        }
        matched
    }

    fn compare(&mut self, point: &zerre_io::TrajectoryPoint, truth: Option<[f64; 3]>) {
        let Some(truth) = truth else {
            self.instants.unmatched += 1;
            return;
        };
        self.instants.compared += 1;
        self.estimate.push(plane(point.position));
        self.truth.push(plane(truth));
        self.covariance.extend(point.covariance.map(|[xx, xy, yy]| [xx, xy, xy, yy]));
    }

    /// Sets at every time of an estimate, each target on the line between its points: a truth that lasts longer than
    /// the recording is not missed.
    fn compare_sets(&mut self, estimates: &Trajectories, truth: &Trajectories, max_gap: Span) {
        let points = estimates.by_id.values().flat_map(Trajectory::points);
        let times: BTreeSet<Time> = points.map(|point| point.time).collect();
        let present = |table: &Trajectories, time| -> Vec<([f64; 2], usize)> {
            let at = |(i, t): (usize, &Trajectory)| Some((plane(t.at(time, max_gap)?), i));
            table.by_id.values().enumerate().filter_map(at).collect()
        };
        let positions = |set: &[([f64; 2], usize)]| set.iter().map(|(p, _)| *p).collect::<Vec<_>>();
        let trajectories: Vec<&Trajectory> = estimates.by_id.values().collect();
        let (mut sum, mut count) = (Sets::default(), 0);
        for time in times {
            let (of_estimates, of_truth) = (present(estimates, time), present(truth, time));
            let (e, t) = (positions(&of_estimates), positions(&of_truth));
            // Positions come from a reader that refuses what is not finite, the options are checked: no refusal.
            let Ok(set) = gospa(&e, &t, ORDER, self.cutoff) else { continue };
            let Ok(distance) = ospa(&e, &t, ORDER, self.cutoff) else { continue };
            count += 1;
            sum.gospa += set.distance;
            sum.localisation += set.localisation;
            sum.missed += set.missed;
            sum.false_tracks += set.false_tracks;
            sum.ospa += distance;
            self.instants.missed += set.missed_count;
            if self.association == Association::Gospa {
                for (place, (_, index)) in of_estimates.iter().enumerate() {
                    let points = trajectories[*index].points();
                    let Ok(own) = points.binary_search_by_key(&time, |p| p.time) else { continue };
                    let pair = set.pairs.iter().find(|(e, _)| *e == place);
                    self.compare(
                        &points[own],
                        pair.map(|(_, t)| [of_truth[*t].0[0], of_truth[*t].0[1], 0.0]),
                    );
                }
            }
        }
        self.instants.sets = count;
        let mean = |sum: f64| sum / count as f64;
        self.sets = (count > 0).then(|| Sets {
            gospa: mean(sum.gospa),
            localisation: mean(sum.localisation),
            missed: mean(sum.missed),
            false_tracks: mean(sum.false_tracks),
            ospa: mean(sum.ospa),
        });
    }

    fn has_covariance(&self) -> bool {
        !self.covariance.is_empty()
    }

    fn sentence(&self) -> String {
        let how = match self.association {
            Association::Id => "by id",
            Association::Only => "the only target with the only truth",
            Association::Gospa => "by place, for no id agrees",
        };
        let Instants { compared, unmatched, sets, missed } = self.instants;
        format!(
            "compared {how}: {compared} estimates, {unmatched} more without truth; sets at {sets} instants, \
             {missed} true positions without an estimate"
        )
    }

    /// The metrics of these names, all that are possible if there are none.
    fn scores(&self, names: &[String]) -> Result<Vec<Score>, Diagnostic> {
        let refused = |error: zerre_lab::Error| Diagnostic::new(error.to_string());
        let wanted = |name: &str| {
            let possible = self.has_covariance() || !NEED_COVARIANCE.contains(&name);
            possible && (names.is_empty() || names.iter().any(|other| other == name))
        };
        if self.estimate.is_empty() && self.sets.is_none_or(|sets| sets.localisation == 0.0) {
            let help = "are times of one epoch, ids the same, and is --max-gap-s or --cutoff-m too small?";
            return Err(Diagnostic::new("no estimate meets any truth").help(help));
        }
        let mut scores = Vec::new();
        let mut add = |key, value, unit, note: String| scores.push(Score { key, value, unit, note });
        let none = String::new;
        let pairs = !self.estimate.is_empty();
        if pairs && wanted("rmse") {
            let found = rmse(&self.estimate, &self.truth).map_err(refused)?;
            add("rmse_m", found.pooled, "m", none());
            add("rmse_x_m", found.components[0], "m", none());
            add("rmse_y_m", found.components[1], "m", none());
        }
        if pairs && wanted("median_error") {
            add("median_error_m", median_error(&self.estimate, &self.truth).map_err(refused)?, "m", none());
        }
        if let Some(sets) = &self.sets {
            let cut = || format!("order {ORDER}, cut-off {} m, mean over instants", self.cutoff);
            if wanted("gospa") {
                add("gospa", sets.gospa, "m", cut());
                add("gospa_localisation", sets.localisation, "m", none());
                add("gospa_missed", sets.missed, "m", none());
                add("gospa_false", sets.false_tracks, "m", none());
            }
            if wanted("ospa") {
                add("ospa", sets.ospa, "m", cut());
            }
        }
        if wanted("crps") && pairs {
            let mut sum = 0.0;
            for ((e, t), c) in self.estimate.iter().zip(&self.truth).zip(&self.covariance) {
                for axis in 0..2 {
                    sum += crps_gaussian(e[axis], c[3 * axis].sqrt(), t[axis]).map_err(refused)?;
                }
            }
            add("crps_m", sum / (2 * self.estimate.len()) as f64, "m", "mean of x and y".to_owned());
        }
        if pairs && (wanted("nees") || wanted("coverage")) {
            let values = match nees(&self.estimate, &self.truth, &self.covariance) {
                Ok(values) => values,
                // A cloud that has collapsed has no ellipse. Who asked for it by name is told so by the error.
                Err(zerre_lab::Error::NotPositiveDefinite { .. }) if names.is_empty() => return Ok(scores),
                Err(error) => return Err(refused(error)),
            };
            if wanted("nees") {
                let mean = anees(&values, 2, 0.95).map_err(refused)?;
                let note =
                    format!("honest: {:.3} to {:.3}, if instants were independent", mean.low, mean.high);
                add("nees", mean.mean, "1", note);
            }
            if wanted("coverage") {
                let keys = ["coverage50", "coverage90", "coverage95"];
                for (key, c) in keys.into_iter().zip(coverage(&values, 2, &LEVELS).map_err(refused)?) {
                    add(key, c.share(), "1", format!("95 % interval {:.3} to {:.3}", c.low, c.high));
                }
            }
        }
        Ok(scores)
    }
}

/// One line per score.
fn table(scores: &[Score]) -> String {
    let mut text = String::new();
    for Score { key, value, unit, note } in scores {
        let unit = if *unit == "1" { "" } else { unit };
        let line = format!("{key:<20} {value:>12.4} {unit:<2} {note}");
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}", line.trim_end());
    }
    text
}
