//! What a tracker tells of a plot.

use crate::filter::Update;
use crate::time::Time;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// One number of a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Metres along axis 0, 1, 2 (x, y, z).
    Position(usize),
    /// Metres per second along an axis.
    Velocity(usize),
    /// Metres per second squared along an axis.
    Acceleration(usize),
    /// Radians per second, counter-clockwise.
    TurnRate,
    /// Metres.
    Length,
    /// Metres.
    Width,
    /// Direction of the length, radians, counter-clockwise from the x axis.
    Orientation,
}

/// What became of a plot, and what is known after it.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Identity of the track: that of the plot, with `#2`, `#3`, ... for tracks after a gap; `target` for plots
    /// without one. An identity that itself ends so gets `#1` on its first track: no two tracks of different
    /// identities have one name, and what stands before the last `#` is the identity.
    pub id: Arc<str>,
    /// Time of the estimate.
    pub time: Time,
    /// What became of the plot.
    pub event: Event,
    /// The step of the filter; `None` if there was none.
    pub update: Option<Update>,
    /// The estimate; empty while there is no track.
    pub mean: Vec<f64>,
    /// Covariance about the mean of the belief, row by row.
    pub covariance: Vec<f64>,
    /// Probability of each of [`Tracker::modes`](super::Tracker::modes); empty for filters without modes and
    /// while there is no track.
    pub modes: Vec<f64>,
    /// The plot against what the belief foretold; `None` where nothing was foretold.
    pub innovation: Option<Innovation>,
}

/// What became of a plot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Event {
    /// It started a track.
    Started,
    /// It was used.
    Updated,
    /// It lay outside the gate; the belief was predicted.
    Gated,
    /// The belief gave it no likelihood; the belief was predicted.
    Degenerate,
    /// One degenerate update or one refused measurement too many: the belief was started anew from it. The row's
    /// update and innovation are of the belief that was given up;
    /// [`Outcome::Gated`](crate::filter::Outcome::Gated) tells of the gate.
    Restarted,
    /// It is older than the belief; not used.
    OutOfOrder,
    /// There is no track, and it tells no position to start one; not used.
    Waiting,
}

impl Event {
    /// The word for tables: `started`, `out-of-order`.
    pub fn name(self) -> &'static str {
        match self {
            Event::Started => "started",
            Event::Updated => "updated",
            Event::Gated => "gated",
            Event::Degenerate => "degenerate",
            Event::Restarted => "restarted",
            Event::OutOfOrder => "out-of-order",
            Event::Waiting => "waiting",
        }
    }
}

/// A measurement against its prediction; for particles by the mean and covariance of the cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct Innovation {
    /// L^-1 nu with S = L L': components in predicted standard deviations, uncorrelated where the models fit.
    pub whitened: Vec<f64>,
    /// nu' S^-1 nu.
    pub nis: f64,
    /// trace(S^-1 R) / dimension: the share of the measurement's noise in S.
    pub noise_share: f64,
}

impl Row {
    pub(super) fn without_belief(id: Arc<str>, time: Time, event: Event) -> Row {
        let (mean, covariance, modes) = (Vec::new(), Vec::new(), Vec::new());
        Row { id, time, event, update: None, mean, covariance, modes, innovation: None }
    }
}
