//! A law as masses on the nodes of a lattice.

use super::Gaussian;
use super::cloud::{level_checked, shape};
use crate::error::{Error, Result};
use crate::math::{Matrix, Real};
use crate::time::Time;
use serde::{Deserialize, Serialize};
use std::array::from_fn;

/// Most nodes that a lattice has.
pub(crate) const MAX_NODES: usize = 1 << 24;

/// Evenly spaced nodes x = A u with u along each axis k at `low[k] + i spacing[k]`; the last axis runs
/// fastest.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lattice<const N: usize> {
    /// A.
    pub(crate) axes: Matrix<N, N>,
    pub(crate) low: [f64; N],
    pub(crate) spacing: [f64; N],
    pub(crate) count: [usize; N],
}

impl<const N: usize> Lattice<N> {
    /// `count` nodes along each axis from `low` to `high`.
    ///
    /// # Errors
    /// More than [`MAX_NODES`] nodes.
    pub(crate) fn over(axes: Matrix<N, N>, low: [f64; N], high: [f64; N], count: [usize; N]) -> Result<Self> {
        let spacing = from_fn(|k| (high[k] - low[k]) / (count[k] as f64 - 1.0));
        let all: f64 = count.iter().map(|&c| c as f64).product();
        if all > MAX_NODES as f64 {
            let needs = "it must be at most 2^24: the noise is too small for the spread of the law";
            return Err(Error::OutOfRange { what: "number of nodes that the grid needs", value: all, needs });
        }
        Ok(Lattice { axes, low, spacing, count })
    }

    pub(crate) fn len(&self) -> usize {
        self.count.iter().product()
    }

    /// How many nodes lie between neighbours along axis `k`.
    pub(crate) fn stride(&self, k: usize) -> usize {
        self.count[k + 1..].iter().product()
    }

    /// Position along axis `k` of node number `index`, counted in nodes.
    pub(crate) fn along(&self, index: usize, k: usize) -> usize {
        index / self.stride(k) % self.count[k]
    }

    /// State at node number `index`.
    pub(crate) fn node(&self, index: usize) -> [f64; N] {
        self.axes * from_fn(|k| self.low[k] + self.spacing[k] * self.along(index, k) as f64)
    }

    /// States at all nodes, in columns.
    pub(crate) fn columns(&self, out: &mut [Vec<f64>; N]) {
        out.iter_mut().for_each(Vec::clear);
        for index in 0..self.len() {
            let x = self.node(index);
            out.iter_mut().zip(x).for_each(|(column, x)| column.push(x));
        }
    }
}

/// A law of `N` components (1, 2 or 3) as probabilities of the nodes of a lattice: the belief of a
/// [`Grid`](crate::filter::Grid).
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(try_from = "Saved", into = "Saved")]
pub struct GridBelief<const N: usize> {
    pub(crate) time: Time,
    pub(crate) lattice: Lattice<N>,
    /// Probabilities of the nodes; they sum to 1.
    pub(crate) masses: Vec<f64>,
    /// Likelihood evaluations of the last step.
    pub(crate) evaluations: usize,
    pub(crate) work: Workspace<N>,
}

/// Memory that steps use again and again.
#[derive(Clone, Debug)]
pub(crate) struct Workspace<const N: usize> {
    /// States at the nodes of a lattice, in columns.
    pub(crate) nodes: [Vec<f64>; N],
    /// Where the nodes of the belief are led on the average of the noise.
    pub(crate) centres: [Vec<f64>; N],
    /// Probabilities of the nodes of the belief, on a finer lattice where the noise asks for one.
    pub(crate) masses: Vec<f64>,
    /// ln of the density of the prediction, then of the posterior, at the nodes of a lattice.
    pub(crate) scores: Vec<f64>,
    /// What is spread along one axis after the other, its source and its result.
    pub(crate) source: Vec<f64>,
    pub(crate) half: Vec<f64>,
    pub(crate) spread: Vec<f64>,
    /// Weights of the sources of one axis.
    pub(crate) taps: Vec<(usize, f64)>,
    pub(crate) tap_ends: Vec<usize>,
}

impl<const N: usize> Default for Workspace<N> {
    fn default() -> Self {
        Workspace {
            nodes: from_fn(|_| Vec::new()),
            centres: from_fn(|_| Vec::new()),
            masses: Vec::new(),
            scores: Vec::new(),
            source: Vec::new(),
            half: Vec::new(),
            spread: Vec::new(),
            taps: Vec::new(),
            tap_ends: Vec::new(),
        }
    }
}

impl<const N: usize> GridBelief<N> {
    /// Time of the belief.
    pub fn time(&self) -> Time {
        self.time
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.masses.len()
    }

    /// Never true: there are nodes.
    pub fn is_empty(&self) -> bool {
        self.masses.is_empty()
    }

    /// States and probabilities of the nodes.
    pub fn nodes(&self) -> impl Iterator<Item = ([f64; N], f64)> + '_ {
        self.masses.iter().enumerate().map(|(i, &mass)| (self.lattice.node(i), mass))
    }

    /// How often the last step evaluated the likelihood.
    pub fn evaluations(&self) -> usize {
        self.evaluations
    }

    /// 1 / sum of the squared probabilities: over how many nodes the law spreads. With less than about three
    /// along an axis the grid is too coarse for it.
    pub fn effective_nodes(&self) -> f64 {
        1.0 / self.masses.iter().map(|m| m * m).sum::<f64>()
    }

    /// The mean.
    pub fn mean(&self) -> [f64; N] {
        let mut sum = [0.0; N];
        for (x, mass) in self.nodes() {
            for k in 0..N {
                sum[k] += mass * x[k];
            }
        }
        sum
    }

    /// The covariance about the mean.
    pub fn covariance(&self) -> Matrix<N, N> {
        let mean = self.mean();
        let mut sum = Matrix::<N, N>::ZERO;
        for (x, mass) in self.nodes() {
            for r in 0..N {
                for c in 0..=r {
                    sum.0[r][c] += mass * (x[r] - mean[r]) * (x[c] - mean[c]);
                }
            }
        }
        Matrix::from_entries(|r, c| sum.0[r.max(c)][r.min(c)])
    }

    /// Mean and covariance as a Gaussian.
    ///
    /// # Errors
    /// Moments that are not finite.
    pub fn gaussian(&self) -> Result<Gaussian<N>> {
        Gaussian::computed("mean of the grid", "covariance of the grid", self.mean(), self.covariance())
    }

    /// Quantiles of component `k` at `levels`, each node's probability spread evenly over its cell.
    ///
    /// # Errors
    /// A level outside [0, 1], a component that there is not.
    pub fn quantiles<const Q: usize>(&self, k: usize, levels: [f64; Q]) -> Result<[f64; Q]> {
        level_checked(&levels)?;
        if k >= N {
            return Err(Error::Shape {
                what: "number of the component (from 0, below)",
                found: k,
                expected: N,
            });
        }
        let row = &self.lattice.axes.0[k];
        let width = (0..N).map(|j| (row[j] * self.lattice.spacing[j]).square()).sum::<f64>().sqrt();
        let positions = || (0..self.len()).map(|index| self.lattice.node(index)[k]);
        let (least, most) = positions()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b): (f64, f64), x: f64| (a.min(x), b.max(x)));
        Ok(levels.map(|level| {
            let (mut low, mut high) = (least - 0.5 * width, most + 0.5 * width);
            for _ in 0..52 {
                let middle = 0.5 * (low + high);
                let below: f64 = positions()
                    .zip(&self.masses)
                    .map(|(x, mass)| mass * ((middle - x) / width + 0.5).clamp(0.0, 1.0))
                    .sum();
                if below < level { low = middle } else { high = middle }
            }
            0.5 * (low + high)
        }))
    }
}

/// What is saved of a belief.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Saved {
    time: Time,
    axes: Vec<Vec<f64>>,
    low: Vec<f64>,
    spacing: Vec<f64>,
    count: Vec<usize>,
    masses: Vec<f64>,
    evaluations: usize,
}

impl<const N: usize> From<GridBelief<N>> for Saved {
    fn from(belief: GridBelief<N>) -> Self {
        let Lattice { axes, low, spacing, count } = belief.lattice;
        Saved {
            time: belief.time,
            axes: axes.0.iter().map(|row| row.to_vec()).collect(),
            low: low.to_vec(),
            spacing: spacing.to_vec(),
            count: count.to_vec(),
            masses: belief.masses,
            evaluations: belief.evaluations,
        }
    }
}

impl<const N: usize> TryFrom<Saved> for GridBelief<N> {
    type Error = Error;

    fn try_from(saved: Saved) -> Result<Self> {
        fn array<T: Copy, const N: usize>(what: &'static str, list: &[T]) -> Result<[T; N]> {
            list.try_into().map_err(|_| Error::Shape { what, found: list.len(), expected: N })
        }
        let rows: [&Vec<f64>; N] = array("axes of a saved grid", &saved.axes.iter().collect::<Vec<_>>())?;
        let mut axes = Matrix::<N, N>::ZERO;
        for (row, saved) in axes.0.iter_mut().zip(rows) {
            *row = array("components of an axis of a saved grid", saved)?;
        }
        axes.finite("axis of a saved grid")?;
        let low = array("origin of a saved grid", &saved.low)?;
        let spacing = array("spacings of a saved grid", &saved.spacing)?;
        let count: [usize; N] = array("counts of a saved grid", &saved.count)?;
        for k in 0..N {
            Error::finite("origin of a saved grid", low[k])?;
            Error::positive("spacing of a saved grid", spacing[k])?;
        }
        let all = count.iter().try_fold(1usize, |all, &c| all.checked_mul(c)).unwrap_or(usize::MAX);
        shape("nodes of a saved grid", saved.masses.len(), all)?;
        if count.iter().any(|&c| c < 4) || all > MAX_NODES {
            let needs = "it must be 4 at least along each axis, and 2^24 at most in all";
            return Err(Error::OutOfRange { what: "nodes of a saved grid", value: all as f64, needs });
        }
        for &mass in &saved.masses {
            Error::not_negative("probability of a saved node", mass)?;
        }
        Error::positive("sum of the saved probabilities", saved.masses.iter().sum())?;
        let lattice = Lattice { axes, low, spacing, count };
        Ok(GridBelief {
            time: saved.time,
            lattice,
            masses: saved.masses,
            evaluations: saved.evaluations,
            work: Workspace::default(),
        })
    }
}
