//! Tracks at rest: what is written to a file and taken up again.

use super::TrackerSpec;
use crate::belief::{Gaussian, GaussianBelief, SavedCloud};
use crate::error::{Error, Result};
use crate::math::Matrix;
use crate::time::Time;
use serde::{Deserialize, Serialize};

/// Version of the form of [`SavedTracker`]; others are refused.
pub const VERSION: u32 = 1;

/// All tracks of a [`Tracker`](super::Tracker), with the specification that made them. Written by any format of
/// serde that keeps f64 exactly.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SavedTracker {
    /// Read first: what follows may look different in another version.
    pub(super) version: Version,
    pub(super) spec: TrackerSpec,
    pub(super) targets: Vec<(Option<String>, SavedTarget)>,
}

impl SavedTracker {
    /// What the tracker was made from: [`TrackerSpec::build`] makes one that takes the tracks up.
    pub fn spec(&self) -> &TrackerSpec {
        &self.spec
    }
}

/// A version that this program reads.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "u32", into = "u32")]
pub(super) struct Version(u32);

impl Version {
    pub(super) const CURRENT: Version = Version(VERSION);
}

impl TryFrom<u32> for Version {
    type Error = Error;
    fn try_from(version: u32) -> Result<Version> {
        if version == VERSION {
            Ok(Version(version))
        } else {
            let text = format!("the tracks were saved in version {version}; this program reads {VERSION}");
            Err(Error::Unsupported(text))
        }
    }
}

impl From<Version> for u32 {
    fn from(version: Version) -> u32 {
        version.0
    }
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct SavedTarget {
    pub(super) track: u32,
    pub(super) starts: u32,
    pub(super) warm_up: u32,
    pub(super) degenerate: u32,
    #[serde(default)]
    pub(super) gated: u32,
    pub(super) belief: SavedBelief,
}

/// A belief of any number of state components.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum SavedBelief {
    Gaussian { time: Time, mean: Vec<f64>, covariance: Vec<Vec<f64>> },
    Cloud(SavedCloud),
}

impl SavedBelief {
    pub(super) fn gaussian<const N: usize>(belief: &GaussianBelief<N>) -> SavedBelief {
        let rows = belief.state.covariance().0.iter();
        SavedBelief::Gaussian {
            time: belief.time,
            mean: belief.state.mean().to_vec(),
            covariance: rows.map(|row| row.to_vec()).collect(),
        }
    }

    pub(super) fn restored<const N: usize>(
        time: Time,
        mean: Vec<f64>,
        covariance: Vec<Vec<f64>>,
    ) -> Result<GaussianBelief<N>> {
        let rows: Vec<[f64; N]> = covariance.into_iter().map(exactly).collect::<Result<_>>()?;
        let state = Gaussian::computed("mean", "covariance", exactly(mean)?, Matrix(exactly(rows)?))?;
        Ok(GaussianBelief { time, state })
    }
}

fn exactly<T, const N: usize>(list: Vec<T>) -> Result<[T; N]> {
    let found = list.len();
    list.try_into().map_err(|_| Error::Shape { what: "numbers of a saved belief", found, expected: N })
}
