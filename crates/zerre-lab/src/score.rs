//! Tracks against truth: the one definition behind every command that scores.
//!
//! A [`Way`] has one point per instant: of several estimates of one target at one time the last holds, because it has
//! seen all that was measured then. Between its points a target is on the straight line, where they are at most
//! [`Rules::max_gap`] apart; this holds for estimates and for truth. Positions are those in the plane.
//!
//! Errors, CRPS, NEES and coverage are of each point of an estimate that has a true position at its time; GOSPA and
//! OSPA are of the sets of all targets at each time at which there is any estimate, averaged over these times.

use crate::consistency::ENOUGH;
use crate::error::Result;
use crate::metric::{
    anees, coverage, crps_gaussian, gospa, median_error, ospa, rmse, squared_mahalanobis_if_definite,
};
use crate::number::{number, signed};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use zerre::{Span, Time};

/// A target at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// When.
    pub time: Time,
    /// x and y in metres.
    pub position: [f64; 2],
    /// Variance of x, covariance of x and y, variance of y in square metres; `None` where nobody says.
    pub covariance: Option<[f64; 3]>,
}

/// The way of one target: points in order of time, no two of one time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Way(Vec<Point>);

/// Ways by the identity of their target.
pub type Ways = BTreeMap<Arc<str>, Way>;

impl Way {
    /// The way through these points; of several of one time the last holds.
    pub fn new(mut points: Vec<Point>) -> Way {
        points.sort_by_key(|point| point.time);
        // `dedup` keeps the first, so each later one overwrites it.
        points.dedup_by(|later, kept| {
            let same = later.time == kept.time;
            if same {
                *kept = *later;
            }
            same
        });
        Way(points)
    }

    /// Where the target is at `time`: at a point, or between two that are at most `max_gap` apart.
    fn at(&self, time: Time, max_gap: Span) -> Option<[f64; 2]> {
        let next = self.0.partition_point(|point| point.time < time);
        let after = self.0.get(next)?;
        if after.time == time {
            return Some(after.position);
        }
        let before = self.0.get(next.checked_sub(1)?)?;
        let gap = after.time - before.time;
        let share = (time - before.time).secs() / gap.secs();
        let along = |i: usize| before.position[i] * (1.0 - share) + after.position[i] * share;
        (gap <= max_gap).then(|| [along(0), along(1)])
    }
}

/// What belongs together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// Distance in metres from which on an estimate and a true object do not belong together (GOSPA, OSPA).
    pub cutoff_m: f64,
    /// Order of GOSPA and OSPA, 1 or more.
    pub order: f64,
    /// Longest gap between two points of a way that is bridged by a straight line.
    pub max_gap: Span,
}

/// 100 m, the length of a ship or several airliners; order 2, so that places count as in an RMSE; 10 s.
impl Default for Rules {
    fn default() -> Self {
        Rules { cutoff_m: 100.0, order: 2.0, max_gap: Span::from_secs(10.0) }
    }
}

/// Errors and covariances disagree from this NEES on, and from its inverse down: a factor of 1.4 in lengths. Values
/// along a track depend on each other, so that the interval of independent ones would call out honest tracks.
const DISAGREES: f64 = 2.0;
/// So many tracks are told by name in a sentence.
const MOST_OFFSETS: usize = 3;

/// How estimates found their truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Association {
    /// By the same identity.
    Id,
    /// One estimated target, one true one.
    Only,
    /// At each instant the pairs of GOSPA.
    Gospa,
}

/// How many estimates were compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Instants {
    /// Estimates with a true position.
    pub compared: usize,
    /// Estimates without one: of no true target, or at a time without truth.
    pub unmatched: usize,
    /// Compared estimates without a covariance: left out of CRPS, NEES and coverage.
    pub without_covariance: usize,
    /// Compared estimates whose covariance is singular (a cloud that has collapsed has no ellipse): left out of NEES
    /// and coverage.
    pub singular: usize,
    /// Instants of estimates, at which sets were compared.
    pub sets: usize,
    /// True positions at these instants without an estimate near enough.
    pub missed: usize,
}

/// A number of the result.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// Name of its metric in [`METRICS`](crate::metric::METRICS).
    pub metric: &'static str,
    /// Its own name: that of a key in a document.
    pub key: &'static str,
    /// The number.
    pub value: f64,
    /// Its unit; empty for a pure number.
    pub unit: &'static str,
    /// What to know when reading it; may be empty.
    pub note: String,
}

/// By how much the estimates of one track are off on average.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Offset {
    /// The track.
    pub id: String,
    /// Mean of estimate less truth along x, metres.
    pub x_m: f64,
    /// Along y, metres.
    pub y_m: f64,
    /// Of so many estimates.
    pub estimates: usize,
}

/// How well covariances and errors agree once every track is shifted by its [`Offset`]: what an offset does not
/// explain.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Centred {
    /// NEES over its dimension.
    pub nees: f64,
    /// Share of the true positions inside the 95 % ellipses.
    pub coverage95: f64,
}

/// Scores, and of what they are.
#[derive(Clone, Debug, PartialEq)]
pub struct Scores {
    /// How estimates found their truth.
    pub association: Association,
    /// How many there were.
    pub instants: Instants,
    /// Every metric that the estimates allow, in the order of tables; none if no estimate has a true position.
    pub scores: Vec<Score>,
    /// Tracks of at least [`ENOUGH`] estimates that have a true way by identity or for lack
    /// of a choice, with what they are off by.
    pub offsets: Vec<Offset>,
    /// NEES and coverage without these offsets; `None` where there are none.
    pub centred: Option<Centred>,
}

/// The identity in the truth: the second track of target `A` is called `A#2`, and the first one of a target `A#2` is
/// `A#2#1`.
pub fn target_of<'a>(id: &'a str, truth: &BTreeMap<Arc<str>, impl Sized>) -> &'a str {
    match id.rsplit_once('#') {
        Some((target, track)) if track.parse::<u32>().is_ok() && truth.contains_key(target) => target,
        _ => id,
    }
}

/// Scores `estimates` against `truth`: by identity if any agrees, else the only one against the only one, else by
/// place.
///
/// # Errors
/// [`Error::OutOfRange`](crate::Error::OutOfRange) for rules and
/// [`Error::NotFinite`](crate::Error::NotFinite) for points that cannot be compared.
pub fn score(estimates: &Ways, truth: &Ways, rules: &Rules) -> Result<Scores> {
    let common = estimates.keys().any(|id| truth.contains_key(target_of(id, truth)));
    let association = match (estimates.len(), truth.len()) {
        _ if common => Association::Id,
        (1, 1) => Association::Only,
        _ => Association::Gospa,
    };
    let mut pairs = Pairs::default();
    let mut offsets = Vec::new();
    for (id, way) in estimates {
        let own = match association {
            Association::Id => truth.get(target_of(id, truth)),
            Association::Only => truth.values().next(),
            Association::Gospa => break,
        };
        let first = pairs.estimate.len();
        for point in &way.0 {
            pairs.compare(point, own.and_then(|own| own.at(point.time, rules.max_gap)))?;
        }
        offsets.extend(pairs.centre(id, first));
    }
    let sets = pairs.compare_sets(estimates, truth, rules, association == Association::Gospa)?;
    let scores = if pairs.instants.compared > 0 { pairs.scores(&sets, rules)? } else { Vec::new() };
    let centred = match pairs.centred.len() {
        0 => None,
        _ => Some(Centred {
            nees: anees(&pairs.centred, 2, 0.95)?.mean,
            coverage95: coverage(&pairs.centred, 2, &[0.95])?[0].share(),
        }),
    };
    Ok(Scores { association, instants: pairs.instants, scores, offsets, centred })
}

/// Estimates beside the truth they belong to.
#[derive(Default)]
struct Pairs {
    instants: Instants,
    estimate: Vec<[f64; 2]>,
    truth: Vec<[f64; 2]>,
    covariance: Vec<Option<[f64; 3]>>,
    /// CRPS of x and of y, of estimates with a covariance.
    crps: Vec<f64>,
    /// Of estimates whose covariance is regular.
    nees: Vec<f64>,
    /// The same of tracks that are shifted by what they are off on average.
    centred: Vec<f64>,
}

/// Distances between the set of estimates and that of true positions, averaged over instants.
#[derive(Default)]
struct Sets {
    gospa: f64,
    localisation: f64,
    missed: f64,
    false_tracks: f64,
    ospa: f64,
}

impl Pairs {
    fn compare(&mut self, point: &Point, truth: Option<[f64; 2]>) -> Result<()> {
        let Some(truth) = truth else {
            self.instants.unmatched += 1;
            return Ok(());
        };
        self.instants.compared += 1;
        let index = self.estimate.len();
        self.estimate.push(point.position);
        self.truth.push(truth);
        self.covariance.push(point.covariance);
        let Some([xx, xy, yy]) = point.covariance else {
            self.instants.without_covariance += 1;
            return Ok(());
        };
        let error = [point.position[0] - truth[0], point.position[1] - truth[1]];
        for (axis, variance) in [xx, yy].into_iter().enumerate() {
            self.crps.push(crps_gaussian(point.position[axis], variance.max(0.0).sqrt(), truth[axis])?);
        }
        match squared_mahalanobis_if_definite(&error, &[xx, xy, xy, yy], index)? {
            Some(value) => self.nees.push(value),
            None => self.instants.singular += 1,
        }
        Ok(())
    }

    /// What the track is off by whose pairs begin at `first`; `None` for a few.
    fn centre(&mut self, id: &str, first: usize) -> Option<Offset> {
        let errors: Vec<[f64; 2]> = self.estimate[first..]
            .iter()
            .zip(&self.truth[first..])
            .map(|(e, t)| [e[0] - t[0], e[1] - t[1]])
            .collect();
        if errors.len() < ENOUGH {
            return None;
        }
        let mean = |axis: usize| errors.iter().map(|e| e[axis]).sum::<f64>() / errors.len() as f64;
        let (x_m, y_m) = (mean(0), mean(1));
        for (error, covariance) in errors.iter().zip(&self.covariance[first..]) {
            let Some([xx, xy, yy]) = *covariance else { continue };
            // A singular one is counted where it is compared.
            let error = [error[0] - x_m, error[1] - y_m];
            self.centred
                .extend(squared_mahalanobis_if_definite(&error, &[xx, xy, xy, yy], first).ok().flatten());
        }
        Some(Offset { id: id.to_owned(), x_m, y_m, estimates: errors.len() })
    }

    /// Sets at every time of an estimate: a truth that lasts longer than the recording is not missed. `by_place` takes
    /// the pairs of each instant for the truth of the estimates.
    fn compare_sets(
        &mut self,
        estimates: &Ways,
        truth: &Ways,
        rules: &Rules,
        by_place: bool,
    ) -> Result<Sets> {
        let times: BTreeSet<Time> =
            estimates.values().flat_map(|way| &way.0).map(|point| point.time).collect();
        let mut sum = Sets::default();
        for &time in &times {
            let present = |ways: &Ways| -> Vec<[f64; 2]> {
                ways.values().filter_map(|way| way.at(time, rules.max_gap)).collect()
            };
            let (of_estimates, of_truth) = (present(estimates), present(truth));
            let set = gospa(&of_estimates, &of_truth, rules.order, rules.cutoff_m)?;
            sum.gospa += set.distance;
            sum.localisation += set.localisation;
            sum.missed += set.missed;
            sum.false_tracks += set.false_tracks;
            sum.ospa += ospa(&of_estimates, &of_truth, rules.order, rules.cutoff_m)?;
            self.instants.missed += set.missed_count;
            if by_place {
                let ways = estimates.values().filter(|way| way.at(time, rules.max_gap).is_some());
                for (place, way) in ways.enumerate() {
                    // A target between its points counts in the set only.
                    let Ok(own) = way.0.binary_search_by_key(&time, |point| point.time) else { continue };
                    let pair = set.pairs.iter().find(|(e, _)| *e == place);
                    self.compare(&way.0[own], pair.map(|(_, t)| of_truth[*t]))?;
                }
            }
        }
        self.instants.sets = times.len();
        let mean = |sum: f64| sum / times.len().max(1) as f64;
        Ok(Sets {
            gospa: mean(sum.gospa),
            localisation: mean(sum.localisation),
            missed: mean(sum.missed),
            false_tracks: mean(sum.false_tracks),
            ospa: mean(sum.ospa),
        })
    }

    /// At least one estimate was compared.
    fn scores(&self, sets: &Sets, rules: &Rules) -> Result<Vec<Score>> {
        let mut scores = Vec::new();
        let mut add = |metric, key, value, unit, note| scores.push(Score { metric, key, value, unit, note });
        let none = String::new;
        let found = rmse(&self.estimate, &self.truth)?;
        add("rmse", "rmse_m", found.pooled, "m", none());
        add("rmse", "rmse_x_m", found.components[0], "m", none());
        add("rmse", "rmse_y_m", found.components[1], "m", none());
        add("median_error", "median_error_m", median_error(&self.estimate, &self.truth)?, "m", none());
        let Rules { order, cutoff_m, .. } = rules;
        let cut = || format!("order {order}, cut-off {cutoff_m} m, mean over instants");
        add("gospa", "gospa", sets.gospa, "m", cut());
        add("gospa", "gospa_localisation", sets.localisation, "m", none());
        add("gospa", "gospa_missed", sets.missed, "m", none());
        add("gospa", "gospa_false", sets.false_tracks, "m", none());
        add("ospa", "ospa", sets.ospa, "m", cut());
        if !self.crps.is_empty() {
            let mean = self.crps.iter().sum::<f64>() / self.crps.len() as f64;
            add("crps", "crps_m", mean, "m", "mean of x and y".to_owned());
        }
        if !self.nees.is_empty() {
            let mean = anees(&self.nees, 2, 0.95)?;
            let note = format!("honest: {:.3} to {:.3}, if instants were independent", mean.low, mean.high);
            add("nees", "nees", mean.mean, "", note);
            const KEYS: [&str; 3] = ["coverage50", "coverage90", "coverage95"];
            for (key, c) in KEYS.into_iter().zip(coverage(&self.nees, 2, &[0.5, 0.9, 0.95])?) {
                let note = format!("95 % interval {:.3} to {:.3}", c.low, c.high);
                add("coverage", key, c.share(), "", note);
            }
        }
        Ok(scores)
    }
}

impl Scores {
    /// The value of this key.
    fn value(&self, key: &str) -> Option<f64> {
        self.scores.iter().find(|score| score.key == key).map(|score| score.value)
    }

    /// Where errors are not as large as the covariances say: by how much, and whether a mean error explains it.
    /// `consistent` tells that the innovations contradicted nothing, which then asks for a word. `None` where errors
    /// and covariances agree or nobody can tell.
    pub fn against_truth(&self, consistent: bool) -> Option<String> {
        let (nees, inside) = (self.value("nees")?, self.value("coverage95")?);
        let agree =
            if consistent { "the tracks agree with their own measurements, but " } else { "the tracks " };
        let found = format!(
            "(nees {}, 1 expected; {:.0} % of the true positions inside the 95 % ellipses)",
            number(nees),
            100.0 * inside
        );
        if nees < 1.0 / DISAGREES {
            return Some(format!("{agree}are nearer to the truth than their covariances say {found}"));
        }
        if nees <= DISAGREES {
            return None;
        }
        let mut text = format!("{agree}are farther from the truth than their covariances say {found}");
        let Some(centred) = self.centred else { return Some(text) };
        let without = format!(
            "without the mean offset of each track nees is {}, and {:.0} % are inside",
            number(centred.nees),
            100.0 * centred.coverage95
        );
        if centred.nees > nees / DISAGREES {
            text += &format!("; no mean offset explains it: {without}");
            return Some(text);
        }
        text += "; on average ";
        for (i, Offset { id, x_m, y_m, .. }) in self.offsets.iter().take(MOST_OFFSETS).enumerate() {
            let comma = if i == 0 { "" } else { ", " };
            text += &format!("{comma}track {id} is off by ({}, {}) m", signed(*x_m), signed(*y_m));
        }
        if self.offsets.len() > MOST_OFFSETS {
            text += &format!(" and {} more tracks likewise", self.offsets.len() - MOST_OFFSETS);
        }
        let much = if centred.nees > DISAGREES {
            ", so that it explains a part"
        } else {
            ", so that it explains it"
        };
        text +=
            &format!(", a bias that no innovation shows where the measurements share it; {without}{much}");
        Some(text)
    }

    /// What was compared, and what was left out, as a sentence.
    pub fn sentence(&self) -> String {
        let how = match self.association {
            Association::Id => "by id",
            Association::Only => "the only target with the only truth",
            Association::Gospa => "by place, for no id agrees",
        };
        let Instants { compared, unmatched, without_covariance, singular, sets, missed } = self.instants;
        let mut text = format!(
            "compared {how}: {compared} estimates, {unmatched} more without truth; sets at {sets} instants, {missed} \
             true positions without an estimate"
        );
        if singular > 0 {
            text += &format!("; nees and coverage leave out {singular} with a singular covariance");
        }
        // Where none has any, there is nothing that they were left out of.
        if without_covariance > 0 && without_covariance < compared {
            text += &format!("; crps, nees and coverage leave out {without_covariance} without a covariance");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(secs: f64, x: f64, covariance: Option<[f64; 3]>) -> Point {
        Point { time: Time::ZERO + Span::from_secs(secs), position: [x, 0.0], covariance }
    }

    fn ways(list: &[(&str, &[Point])]) -> Ways {
        list.iter().map(|(id, points)| (Arc::from(*id), Way::new(points.to_vec()))).collect()
    }

    fn value(scores: &Scores, key: &str) -> Option<f64> {
        scores.scores.iter().find(|score| score.key == key).map(|score| score.value)
    }

    const UNIT: Option<[f64; 3]> = Some([1.0, 0.0, 1.0]);

    #[test]
    fn a_later_track_is_of_the_target_before_its_number() {
        let truth: BTreeMap<Arc<str>, ()> = ["A", "A#2", "bus #12"].map(|id| (id.into(), ())).into();
        let pairs = [
            ("A", "A"),
            ("A#2", "A"),
            ("A#2#1", "A#2"),
            ("bus #12#1", "bus #12"),
            ("A#x", "A#x"),
            ("B#2", "B#2"),
        ];
        for (id, target) in pairs {
            assert_eq!(target_of(id, &truth), target);
        }
    }

    /// Thirty estimates, three metres off along x, with variances of one square metre: NEES is 9 / 2 + what the
    /// scatter adds, and without the offset the scatter alone.
    #[test]
    fn an_offset_is_told_from_errors_that_scatter() {
        let track = |offset: f64, scatter: f64| -> Vec<Point> {
            (0..30)
                .map(|k| {
                    let side = if k % 2 == 0 { 1.0 } else { -1.0 };
                    point(f64::from(k), f64::from(k) + offset + scatter * side, UNIT)
                })
                .collect()
        };
        let truth = ways(&[("a", &track(0.0, 0.0))]);
        let found = |points: &[Point]| score(&ways(&[("a", points)]), &truth, &Rules::default()).unwrap();
        let off = found(&track(3.0, 1.0));
        assert_eq!((off.offsets[0].x_m, off.offsets[0].y_m, off.offsets[0].estimates), (3.0, 0.0, 30));
        assert_eq!(off.centred, Some(Centred { nees: 0.5, coverage95: 1.0 }));
        let text = off.against_truth(true).unwrap();
        assert!(text.starts_with("the tracks agree with their own measurements, but are farther"), "{text}");
        assert!(
            text.contains("nees 5.000, 1 expected") && text.contains("track a is off by (+3.00, +0.00) m"),
            "{text}"
        );
        assert!(text.ends_with("nees is 0.500, and 100 % are inside, so that it explains it"), "{text}");
        let wide = found(&track(0.0, 3.0));
        assert!(wide.against_truth(false).unwrap().contains("no mean offset explains it"), "{wide:?}");
        assert_eq!(found(&track(0.0, 1.4)).against_truth(true), None);
        assert!(found(&track(0.0, 0.1)).against_truth(true).unwrap().contains("nearer to the truth"));
        // A few estimates have no mean worth telling.
        let few = found(&track(3.0, 0.0)[..5]);
        assert!(few.offsets.is_empty() && few.centred.is_none() && few.against_truth(true).is_some());
    }

    #[test]
    fn of_estimates_of_one_time_the_last_holds() {
        let truth = ways(&[("a", &[point(0.0, 0.0, None), point(1.0, 0.0, None)])]);
        let twice = ways(&[("a", &[point(1.0, 50.0, UNIT), point(0.0, 1.0, UNIT), point(1.0, 3.0, UNIT)])]);
        let found = score(&twice, &truth, &Rules::default()).unwrap();
        assert_eq!(
            (found.association, found.instants.compared, found.instants.sets),
            (Association::Id, 2, 2)
        );
        // Errors 1 and 3: mean square 5, sets of one pair each at 1 and 3.
        assert!((value(&found, "rmse_m").unwrap() - 5.0_f64.sqrt()).abs() < 1e-15);
        assert_eq!(value(&found, "gospa"), Some(2.0));
    }

    /// One rule for both sides: what is farther apart than the gap is not there in between.
    #[test]
    fn gaps_are_the_same_for_estimates_and_truth() {
        let long = [point(0.0, 0.0, None), point(20.0, 0.0, None)];
        let short = [point(0.0, 0.0, None), point(10.0, 0.0, None), point(20.0, 0.0, None)];
        let of = |estimates: &[Point], truth: &[Point]| {
            let other = [point(10.0, 500.0, None)];
            score(&ways(&[("a", estimates), ("b", &other)]), &ways(&[("a", truth)]), &Rules::default())
                .unwrap()
        };
        let (bridged, silent) = (of(&short, &long).instants, of(&long, &short).instants);
        assert_eq!((bridged.compared, bridged.missed), (2, 0));
        assert_eq!((silent.compared, silent.missed), (2, 1));
    }

    #[test]
    fn one_singular_covariance_is_left_out_and_counted() {
        let truth = ways(&[("a", &[point(0.0, 0.0, None), point(1.0, 0.0, None), point(2.0, 0.0, None)])]);
        let flat = Some([4.0, 2.0, 1.0]);
        let estimates =
            ways(&[("a", &[point(0.0, 2.0, UNIT), point(1.0, 7.0, flat), point(2.0, 1.0, None)])]);
        let found = score(&estimates, &truth, &Rules::default()).unwrap();
        let Instants { compared, singular, without_covariance, .. } = found.instants;
        assert_eq!((compared, singular, without_covariance), (3, 1, 1));
        // 2^2 over two dimensions, and the errors 2, 7 and 1 all count in the RMSE.
        assert_eq!(value(&found, "nees"), Some(2.0));
        assert!((value(&found, "rmse_m").unwrap() - 18.0_f64.sqrt()).abs() < 1e-15);
        for part in ["leave out 1 with a singular covariance", "leave out 1 without a covariance"] {
            assert!(found.sentence().contains(part), "{}", found.sentence());
        }
        // Nothing but singular ones: no NEES, the rest stands.
        let only = score(&ways(&[("a", &[point(1.0, 7.0, flat)])]), &truth, &Rules::default()).unwrap();
        assert_eq!((value(&only, "nees"), value(&only, "coverage95")), (None, None));
        assert!(value(&only, "crps_m").is_some() && only.instants.singular == 1);
    }

    #[test]
    fn nothing_in_common_has_no_scores() {
        let (a, late) = (ways(&[("a", &[point(0.0, 0.0, UNIT)])]), ways(&[("a", &[point(9.0, 0.0, None)])]));
        let found = score(&a, &late, &Rules::default()).unwrap();
        assert!(found.scores.is_empty() && found.instants.unmatched == 1);
        assert!(score(&a, &late, &Rules { cutoff_m: 0.0, ..Rules::default() }).is_err());
    }

    #[test]
    fn every_score_is_of_a_metric_of_the_catalogue() {
        let truth = ways(&[("a", &[point(0.0, 0.0, None)])]);
        let found = score(&ways(&[("b", &[point(0.0, 1.0, UNIT)])]), &truth, &Rules::default()).unwrap();
        assert_eq!(found.association, Association::Only);
        assert!(found.scores.iter().all(|score| crate::metric::find(score.metric).is_some()));
    }
}
