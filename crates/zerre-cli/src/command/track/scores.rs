//! Tracks against truth.

use super::Call;
use super::input::{Input, refused};
use super::outcome::track_row;
use super::settings::Settings;
use super::work::Run;
use crate::command::compare::ways;
use crate::diagnostic::Diagnostic;
use std::collections::BTreeMap;
use std::sync::Arc;
use zerre_io::{LocalFrame, Options, Trajectories, Trajectory};
use zerre_lab::score::{Association, Point, Rules, Way, score as score_ways, target_of};

/// Scores, and the truth that they are against.
#[derive(Default)]
pub(super) struct Scores {
    pub found: Option<zerre_lab::score::Scores>,
    truth: Option<Trajectories>,
}

impl Scores {
    /// The true way that a target was scored against, where identities or the lack of a choice decide on it.
    pub fn way(&self, id: &str) -> Option<&Trajectory> {
        let truth = &self.truth.as_ref()?.by_id;
        match self.found.as_ref()?.association {
            Association::Id => truth.get(target_of(id, truth)),
            Association::Only => truth.values().next(),
            Association::Gospa => None,
        }
    }
}

/// Scores the rows as `zerre compare` would score `tracks.csv`, which has the same ones.
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
        sizes: false,
        three_d: input.has_height,
        origin: input.frame.as_ref().map(LocalFrame::origin),
        max_rejected: settings.options.max_rejected,
    };
    let truth = Trajectories::open(path, &options).map_err(|error| refused(&error))?;
    let mut points: BTreeMap<Arc<str>, Vec<Point>> = BTreeMap::new();
    for row in run.rows.iter().flatten().filter_map(|row| track_row(row, &run.modes)) {
        let variance = |i: usize, j: usize| row.covariance[i * row.mean.len() + j];
        let point = Point {
            time: row.time,
            position: [row.mean[0], row.mean[1]],
            covariance: Some([variance(0, 0), variance(0, 1), variance(1, 1)]),
        };
        points.entry(row.id).or_default().push(point);
    }
    let estimates = points.into_iter().map(|(id, points)| (id, Way::new(points))).collect();
    let found = score_ways(&estimates, &ways(&truth), &Rules::default())
        .map_err(|error| Diagnostic::new(error.to_string()))?;
    if found.scores.is_empty() {
        let text = format!("{}: the truth and the tracks have no target and time in common", path.display());
        return Err(
            Diagnostic::new(text).help("identities must be equal, and times must be of the same epoch")
        );
    }
    Ok(Scores { found: Some(found), truth: Some(truth) })
}
