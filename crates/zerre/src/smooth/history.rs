//! What a particle filter leaves behind: its clouds and who came from whom.

use crate::belief::{Cloud, Gaussian, Lineage, level_checked, quantiles_of};
use crate::error::{Error, Result};
use crate::math::Matrix;
use crate::time::Time;
use std::array::from_fn;
use std::collections::VecDeque;

/// The clouds of a [`ParticleFilter`](crate::filter::ParticleFilter) after each of its steps, predictions
/// included, each with the weights that its particles had before resampling: what smoothers work on. Clouds
/// of other filters are taken in as well: filters that look ahead or move their particles say whom each comes
/// from, and where a filter does not (an [`Ensemble`](crate::filter::Ensemble)), what needs to know refuses.
#[derive(Clone, Debug, Default)]
pub struct History<const N: usize> {
    records: VecDeque<Record<N>>,
    /// Most records that are kept; the oldest are forgotten first.
    window: Option<usize>,
}

/// One cloud.
#[derive(Clone, Debug)]
pub(super) struct Record<const N: usize> {
    pub(super) time: Time,
    pub(super) states: [Vec<f64>; N],
    /// Normalised.
    pub(super) weights: Vec<f64>,
    /// Whom each particle of the next record comes from (until there is one: each survivor of a resampling);
    /// empty where it is the particle of its own number.
    parents: Vec<u32>,
    /// Whether the particles of the next record come from none of these.
    is_childless: bool,
}

impl<const N: usize> History<N> {
    /// A history of everything.
    pub fn new() -> Self {
        History { records: VecDeque::new(), window: None }
    }

    /// A history of the last `records` records, one at least.
    ///
    /// # Errors
    /// No records at all.
    pub fn window(records: usize) -> Result<Self> {
        Error::positive("records that a history keeps", records as f64)?;
        Ok(History { records: VecDeque::with_capacity(records), window: Some(records) })
    }

    /// Takes in the cloud after a step (and the one before the first). Several steps at one instant are fine.
    ///
    /// # Errors
    /// A step back in time, another number of particles than the last cloud leads to, a cloud whose particles
    /// are all lost. The history is then as it was.
    pub fn record(&mut self, cloud: &Cloud<N>) -> Result<()> {
        if let Some(last) = self.records.back() {
            if cloud.time < last.time {
                return Err(Error::OutOfOrder { from: last.time, to: cloud.time });
            }
            let expected = match cloud.lineage {
                Lineage::Numbers if last.parents.is_empty() => last.weights.len(),
                Lineage::Numbers => last.parents.len(),
                Lineage::Ancestors => cloud.ancestors.len(),
                Lineage::Lost => cloud.len(),
            };
            let found = cloud.len();
            if found != expected {
                return Err(Error::Shape { what: "particles of a recorded cloud", found, expected });
            }
        }
        Error::positive("sum of the recorded weights", cloud.weights().sum())?;
        if let Some(last) = self.records.back_mut() {
            last.is_childless = cloud.lineage == Lineage::Lost;
            if cloud.lineage == Lineage::Ancestors {
                last.descend(&cloud.ancestors);
            }
        }
        let oldest = if self.window == Some(self.records.len()) { self.records.pop_front() } else { None };
        let mut record = oldest.unwrap_or_else(|| Record::first(cloud.time, from_fn(|_| Vec::new())));
        record.time = cloud.time;
        for (column, from) in record.states.iter_mut().zip(&cloud.states) {
            column.clone_from(from);
        }
        record.weights.clear();
        record.weights.extend(cloud.weights());
        record.parents.clear();
        if cloud.pending {
            record.parents.extend_from_slice(&cloud.ancestors);
        }
        self.records.push_back(record);
        Ok(())
    }

    /// Number of records.
    pub fn len(&self) -> usize {
        self.records.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// Time of record `k`, from 0 for the oldest that is kept.
    pub fn time(&self, k: usize) -> Option<Time> {
        self.records.get(k).map(|record| record.time)
    }

    pub(super) fn get(&self, k: usize) -> Result<&Record<N>> {
        let shape = Error::Shape { what: "records of a history", found: self.len(), expected: k + 1 };
        self.records.get(k).ok_or(shape)
    }
}

impl<const N: usize> Record<N> {
    /// Equally weighted particles.
    pub(super) fn first(time: Time, states: [Vec<f64>; N]) -> Self {
        let n = states.first().map_or(0, Vec::len);
        Record { time, states, weights: vec![1.0 / n as f64; n], parents: Vec::new(), is_childless: false }
    }

    /// What follows this record: states and weights at a time, from the particles that `parents` names or
    /// from those of the same number.
    pub(super) fn next(
        &mut self,
        parents: Option<Vec<u32>>,
        (time, states, weights): (Time, [Vec<f64>; N], Vec<f64>),
    ) -> Self {
        self.parents = parents.unwrap_or_default();
        Record { time, states, weights, parents: Vec::new(), is_childless: false }
    }

    /// Each particle to come descends from one of those that would have followed.
    fn descend(&mut self, ancestors: &[u32]) {
        if self.parents.is_empty() {
            self.parents.extend_from_slice(ancestors);
        } else {
            self.parents = ancestors.iter().map(|&a| self.parents[a as usize]).collect();
        }
    }

    /// The particle that particle `i` of the next record comes from.
    pub(super) fn parent(&self, i: usize) -> usize {
        self.parents.get(i).map_or(i, |&parent| parent as usize)
    }

    /// Refuses where the particles of the next record have no parents here.
    pub(super) fn has_children(&self) -> Result<()> {
        if !self.is_childless {
            return Ok(());
        }
        let why = format!("the filter does not say whom its particles after {} s come from", self.time);
        Err(Error::Unsupported(why))
    }

    pub(super) fn state(&self, i: usize) -> [f64; N] {
        from_fn(|k| self.states[k][i])
    }

    pub(super) fn mean(&self) -> [f64; N] {
        from_fn(|k| self.states[k].iter().zip(&self.weights).map(|(x, w)| x * w).sum())
    }
}

/// Weighted states at an instant: what a smoother says of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Smoothed<const N: usize> {
    /// When.
    pub time: Time,
    /// `states[k][i]`: component k of state i.
    pub states: [Vec<f64>; N],
    /// Weights of the states; they sum to 1.
    pub weights: Vec<f64>,
}

impl<const N: usize> Smoothed<N> {
    /// Weighted mean.
    pub fn mean(&self) -> [f64; N] {
        from_fn(|k| self.states[k].iter().zip(&self.weights).map(|(x, w)| x * w).sum())
    }

    /// Weighted covariance about the mean.
    pub fn covariance(&self) -> Matrix<N, N> {
        let mean = self.mean();
        let mut sum = Matrix::<N, N>::ZERO;
        for (i, w) in self.weights.iter().enumerate() {
            let d: [f64; N] = from_fn(|k| self.states[k][i] - mean[k]);
            sum = sum + Matrix::outer(&d, &d) * *w;
        }
        sum
    }

    /// Mean and covariance as a Gaussian.
    ///
    /// # Errors
    /// Moments that are not finite.
    pub fn gaussian(&self) -> Result<Gaussian<N>> {
        Gaussian::computed("smoothed mean", "smoothed covariance", self.mean(), self.covariance())
    }

    /// Smallest value of component `k` whose cumulative weight reaches each of `levels`.
    ///
    /// # Errors
    /// A level outside [0, 1], a component that there is not.
    pub fn quantiles<const Q: usize>(&self, k: usize, levels: [f64; Q]) -> Result<[f64; Q]> {
        level_checked(&levels)?;
        let what = "number of the component (from 0, below)";
        let column = self.states.get(k).ok_or(Error::Shape { what, found: k, expected: N })?;
        Ok(quantiles_of(column.iter().copied().zip(self.weights.iter().copied()), levels))
    }
}
