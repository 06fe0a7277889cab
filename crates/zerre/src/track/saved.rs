//! Tracks at rest: what is written to a file and taken up again.

use super::TrackerSpec;
use crate::belief::{Gaussian, GaussianBelief, ModalGaussian, SavedCloud};
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
    Modal { time: Time, modes: Vec<SavedMode> },
    Cloud(SavedCloud),
}

/// A mode of a belief: its probability, and the law given it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct SavedMode {
    probability: f64,
    mean: Vec<f64>,
    covariance: Vec<Vec<f64>>,
}

impl SavedBelief {
    pub(super) fn gaussian<const N: usize>(belief: &GaussianBelief<N>) -> SavedBelief {
        let (mean, covariance) = numbers(&belief.state);
        SavedBelief::Gaussian { time: belief.time, mean, covariance }
    }

    pub(super) fn modal<const N: usize>(belief: &ModalGaussian<N>) -> SavedBelief {
        let mode = |(j, &probability): (usize, &f64)| {
            let (mean, covariance) = numbers(belief.mode(j));
            SavedMode { probability, mean, covariance }
        };
        let modes = belief.probabilities().iter().enumerate().map(mode).collect();
        SavedBelief::Modal { time: belief.time(), modes }
    }

    pub(super) fn restored<const N: usize>(
        time: Time,
        mean: Vec<f64>,
        covariance: Vec<Vec<f64>>,
    ) -> Result<GaussianBelief<N>> {
        Ok(GaussianBelief { time, state: law(mean, covariance)? })
    }

    pub(super) fn restored_modes<const N: usize>(
        time: Time,
        modes: Vec<SavedMode>,
    ) -> Result<ModalGaussian<N>> {
        let probabilities = modes.iter().map(|mode| mode.probability).collect();
        let laws = modes.into_iter().map(|mode| law(mode.mean, mode.covariance)).collect::<Result<_>>()?;
        ModalGaussian::new(time, probabilities, laws)
    }
}

fn numbers<const N: usize>(law: &Gaussian<N>) -> (Vec<f64>, Vec<Vec<f64>>) {
    (law.mean().to_vec(), law.covariance().0.iter().map(|row| row.to_vec()).collect())
}

fn law<const N: usize>(mean: Vec<f64>, covariance: Vec<Vec<f64>>) -> Result<Gaussian<N>> {
    let rows: Vec<[f64; N]> = covariance.into_iter().map(exactly).collect::<Result<_>>()?;
    Gaussian::computed("mean", "covariance", exactly(mean)?, Matrix(exactly(rows)?))
}

fn exactly<T, const N: usize>(list: Vec<T>) -> Result<[T; N]> {
    let found = list.len();
    list.try_into().map_err(|_| Error::Shape { what: "numbers of a saved belief", found, expected: N })
}
