//! Tracks against truth.

use super::Call;
use super::input::{Input, refused};
use super::settings::Settings;
use super::work::Run;
use crate::diagnostic::Diagnostic;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use zerre::track::Row;
use zerre::{Span, Time};
use zerre_io::{LocalFrame, Options, Trajectories, Trajectory};
use zerre_lab::metric::{anees, coverage, crps_gaussian, gospa, median_error, nees, rmse};

/// Scores by name, and the truth that they are against.
#[derive(Default)]
pub(super) struct Scores {
    pub values: Option<BTreeMap<&'static str, f64>>,
    truth: Option<Trajectories>,
}

/// Order of GOSPA, and the distance in metres beyond which an estimate is of something else: ten times the length of
/// a boat or an airliner's wing.
const GOSPA: (f64, f64) = (2.0, 100.0);
/// Truth is read between its points where they are at most this far apart, in seconds.
const TRUTH_GAP_S: f64 = 10.0;

impl Scores {
    /// The true way of a target: the one of its identity, or the only one of a truth without identities.
    pub fn way(&self, id: &str) -> Option<&Trajectory> {
        let truth = self.truth.as_ref()?;
        let of_target = id.split_once('#').map_or(id, |(target, _)| target);
        truth.by_id.get(id).or_else(|| truth.by_id.get(of_target)).or_else(|| {
            let only = truth.by_id.len() == 1;
            truth.by_id.get("").or_else(|| truth.by_id.values().next()).filter(|_| only)
        })
    }
}

pub(super) fn score(
    call: &Call<'_>,
    settings: &Settings,
    input: &Input,
    run: &Run,
) -> Result<Scores, Diagnostic> {
    let Some(path) = &call.args.truth else { return Ok(Scores::default()) };
    let options = Options {
        format: zerre_io::Format::Auto,
        columns: BTreeMap::new(),
        three_d: input.has_height,
        origin: input.frame.as_ref().map(LocalFrame::origin),
        max_rejected: settings.options.max_rejected,
    };
    let truth = Trajectories::open(path, &options).map_err(|error| refused(&error))?;
    let mut scores = Scores { values: None, truth: Some(truth) };
    let dimensions = if input.has_height { 3 } else { 2 };
    let failed = |error: zerre_lab::Error| Diagnostic::new(error.to_string());

    let (mut estimate, mut real, mut covariances) = (Vec::new(), Vec::new(), Vec::new());
    let gap = Span::from_secs(TRUTH_GAP_S);
    let mut ways: BTreeMap<&Arc<str>, Vec<&Row>> = BTreeMap::new();
    for row in run.rows.iter().flatten().filter(|row| !row.mean.is_empty()) {
        ways.entry(&row.id).or_default().push(row);
        let Some(place) = scores.way(&row.id).and_then(|way| way.at(row.time, gap)) else { continue };
        estimate.push(row.mean[..dimensions].to_vec());
        real.push(place[..dimensions].to_vec());
        covariances.push(position_covariance(row, dimensions));
    }
    if estimate.is_empty() {
        return Err(Diagnostic::new(format!(
            "{}: the truth and the tracks have no target and time in common",
            path.display()
        ))
        .help("identities must be equal, and times must be of the same epoch"));
    }
    let mut values = BTreeMap::new();
    values.insert("rmse_m", rmse(&estimate, &real).map_err(failed)?.pooled);
    values.insert("median_error_m", median_error(&estimate, &real).map_err(failed)?);
    // A covariance may be singular (one particle): then there is no NEES to speak of.
    if let Ok(errors) = nees(&estimate, &real, &covariances) {
        values.insert("nees", anees(&errors, dimensions, 0.95).map_err(failed)?.mean);
        if let Some(inside) = coverage(&errors, dimensions, &[0.95]).map_err(failed)?.first() {
            values.insert("coverage95", inside.share());
        }
    }
    let mut crps = 0.0;
    for ((estimate, real), covariance) in estimate.iter().zip(&real).zip(&covariances) {
        for i in 0..dimensions {
            let sd = covariance[i * dimensions + i].max(0.0).sqrt();
            crps += crps_gaussian(estimate[i], sd, real[i]).map_err(failed)? / dimensions as f64;
        }
    }
    values.insert("crps_m", crps / estimate.len() as f64);

    let times: BTreeSet<Time> = ways.values().flatten().map(|row| row.time).collect();
    let max_gap = settings.spec(0).life.max_gap;
    let truth_ways = scores.truth.iter().flat_map(|truth| truth.by_id.values());
    let truth_ways: Vec<&Trajectory> = truth_ways.collect();
    let mut sums = [0.0; 4];
    for &time in &times {
        let real: Vec<Vec<f64>> =
            truth_ways.iter().filter_map(|way| Some(way.at(time, gap)?[..dimensions].to_vec())).collect();
        let estimates: Vec<Vec<f64>> =
            ways.values().filter_map(|rows| between(rows, time, max_gap, dimensions)).collect();
        let g = gospa(&estimates, &real, GOSPA.0, GOSPA.1).map_err(failed)?;
        for (sum, part) in sums.iter_mut().zip([g.distance, g.localisation, g.missed, g.false_tracks]) {
            *sum += part / times.len() as f64;
        }
    }
    for (name, value) in ["gospa", "gospa_localisation", "gospa_missed", "gospa_false"].into_iter().zip(sums)
    {
        values.insert(name, value);
    }
    scores.values = Some(values);
    Ok(scores)
}

/// Covariance of the position, row by row.
fn position_covariance(row: &Row, dimensions: usize) -> Vec<f64> {
    let n = row.mean.len();
    (0..dimensions).flat_map(|i| (0..dimensions).map(move |j| row.covariance[i * n + j])).collect()
}

/// Where a track is at `time`: on the straight line between its rows, while it lives.
fn between(rows: &[&Row], time: Time, max_gap: Span, dimensions: usize) -> Option<Vec<f64>> {
    let next = rows.partition_point(|row| row.time < time);
    let after = rows.get(next)?;
    if after.time == time {
        // The last of several rows of one time has seen all of its measurements.
        let last = rows[next..].iter().take_while(|row| row.time == time).last()?;
        return Some(last.mean[..dimensions].to_vec());
    }
    let before = rows.get(next.checked_sub(1)?)?;
    let gap = after.time - before.time;
    if gap > max_gap {
        return None;
    }
    let share = (time - before.time).secs() / gap.secs();
    let along = |i: usize| before.mean[i] * (1.0 - share) + after.mean[i] * share;
    Some((0..dimensions).map(along).collect())
}
