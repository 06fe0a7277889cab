//! Tracks at rest: what is written to a file and taken up again.

use super::TrackerSpec;
use super::belief::Belief;
use crate::belief::{
    Cloud, Gaussian, GaussianBelief, Hypotheses, Hypothesis, ModalCloud, ModalGaussian, SavedCloud,
    SavedModalCloud,
};
use crate::error::{Error, Result};
use crate::filter::{ModalBelief, SavedModalBelief};
use crate::math::Matrix;
use crate::rng::Stream;
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
    Modal { time: Time, modes: Vec<SavedPart> },
    Hypotheses { time: Time, stream: Stream, step: u64, modes: usize, all: Vec<(usize, SavedPart)> },
    Cloud(SavedCloud),
    EveryMode(SavedModalBelief),
    Interacting(SavedModalCloud),
}

/// A part of a mixture: its probability, and the law given it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct SavedPart {
    probability: f64,
    mean: Vec<f64>,
    covariance: Vec<Vec<f64>>,
}

impl SavedPart {
    fn of<const N: usize>(probability: f64, law: &Gaussian<N>) -> SavedPart {
        let (mean, covariance) = numbers(law);
        SavedPart { probability, mean, covariance }
    }
}

impl SavedBelief {
    pub(super) fn of<const N: usize>(belief: &Belief<N>) -> SavedBelief {
        match belief {
            Belief::Gaussian(GaussianBelief { time, state }) => {
                let (mean, covariance) = numbers(state);
                SavedBelief::Gaussian { time: *time, mean, covariance }
            }
            Belief::Modal(belief) => {
                let part = |(j, &p): (usize, &f64)| SavedPart::of(p, belief.mode(j));
                let modes = belief.probabilities().iter().enumerate().map(part).collect();
                SavedBelief::Modal { time: belief.time(), modes }
            }
            Belief::Hypotheses(belief) => SavedBelief::Hypotheses {
                time: belief.time,
                stream: belief.stream,
                step: belief.step,
                modes: belief.modes,
                all: belief.iter().map(|h| (h.label, SavedPart::of(h.weight, &h.law))).collect(),
            },
            Belief::Cloud(cloud) => SavedBelief::Cloud(cloud.saved()),
            Belief::EveryMode(belief) => SavedBelief::EveryMode(belief.saved()),
            Belief::Interacting(cloud) => SavedBelief::Interacting(cloud.saved()),
        }
    }

    pub(super) fn restored<const N: usize>(self) -> Result<Belief<N>> {
        Ok(match self {
            SavedBelief::Gaussian { time, mean, covariance } => {
                Belief::Gaussian(GaussianBelief { time, state: law(mean, covariance)? })
            }
            SavedBelief::Modal { time, modes } => {
                let probabilities = modes.iter().map(|mode| mode.probability).collect();
                let laws = modes.into_iter().map(|mode| law(mode.mean, mode.covariance));
                Belief::Modal(ModalGaussian::new(time, probabilities, laws.collect::<Result<_>>()?)?)
            }
            SavedBelief::Hypotheses { time, stream, step, modes, all } => {
                let hypothesis = |(mode, part): (usize, SavedPart)| {
                    Ok(Hypothesis {
                        label: mode,
                        weight: part.probability,
                        law: law(part.mean, part.covariance)?,
                    })
                };
                let all = all.into_iter().map(hypothesis).collect::<Result<_>>()?;
                Belief::Hypotheses(Hypotheses { step, ..Hypotheses::new(time, stream, modes, all)? })
            }
            SavedBelief::Cloud(cloud) => Belief::Cloud(Box::new(Cloud::restore(cloud)?)),
            SavedBelief::EveryMode(belief) => Belief::EveryMode(Box::new(ModalBelief::restore(belief)?)),
            SavedBelief::Interacting(cloud) => Belief::Interacting(Box::new(ModalCloud::restore(cloud)?)),
        })
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
