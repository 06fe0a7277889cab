//! Markov kernels that leave a law as it is: they spread particles that have become alike, without changing
//! what the particles stand for. Resample-move and sequential MCMC filters move by them.

mod path;

pub(crate) use path::{PathLaw, Sweeps, spread_of};

use crate::error::{Error, Result};
use crate::kernels::{BLOCK, Threads};
use crate::math::{Matrix, Real};
use crate::rng::{Draws, Purpose, Stream};
use serde::{Deserialize, Serialize};
use std::array::from_fn;

/// A Markov kernel that leaves the law of each particle as it is, whatever that law.
///
/// ```
/// # use zerre::moves::Move;
/// let default = Move::default();
/// assert_eq!(default, Move::RandomWalk { scale: None });
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Move {
    /// Random-walk Metropolis: x' = x + scale D n with D D' the covariance of all particles, n standard
    /// normal, accepted with probability min(1, pi(x') / pi(x)). `None` is the scale 2.38 / sqrt(N) (Roberts,
    /// Gelman and Gilks, Annals of Applied Probability 7, 1997).
    RandomWalk {
        /// Standard deviation of a proposal in those of the particles.
        scale: Option<f64>,
    },
    /// The move of the artificial bee colony made exact: along the line through a particle y of the other half,
    /// x' = y + z (x - y) with z uniform on (0, 2), accepted with probability min(1, z^(N-2) pi(x') / pi(x)) where
    /// z > 1/2 and never elsewhere. It is a stretch move (Goodman and Weare, Communications in Applied Mathematics and
    /// Computational Science 5, 2010) with another law of z, and needs no covariance.
    Stretch,
    /// Gibbs sampling: one component after the other is drawn from its law given the others, by slices (Neal,
    /// Annals of Statistics 31, 2003; an interval of four standard deviations about the particle, which
    /// shrinks until a point of the slice is met).
    Gibbs,
}

impl Default for Move {
    fn default() -> Self {
        Move::RandomWalk { scale: None }
    }
}

/// What moves did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Moved {
    /// Proposals that were accepted; each component that [`Move::Gibbs`] draws is one.
    pub accepted: usize,
    /// How often the density of a particle was asked for.
    pub evaluations: usize,
}

impl std::ops::AddAssign for Moved {
    fn add_assign(&mut self, other: Moved) {
        self.accepted += other.accepted;
        self.evaluations += other.evaluations;
    }
}

/// The laws that particles are moved under: each may have its own.
pub(crate) trait Law<const N: usize>: Sync {
    /// Writes ln pi(x), up to a constant of each particle, of the particles `first..first + out.len()` at
    /// `states`. NaN counts as impossible.
    fn log_density(&self, first: usize, states: &[&[f64]; N], out: &mut [f64]);
}

/// What moves need beside particles.
pub(crate) struct Walk<'a, const N: usize> {
    pub(crate) stream: Stream,
    pub(crate) step: u64,
    pub(crate) threads: &'a Threads,
    /// Some D with D D' the covariance of the particles.
    pub(crate) spread: Matrix<N, N>,
}

/// Memory of moves: the particles as they stand while their halves move.
#[derive(Clone, Debug)]
pub(crate) struct Frozen<const N: usize> {
    columns: [Vec<f64>; N],
    blocks: Vec<Moved>,
}

impl<const N: usize> Frozen<N> {
    pub(crate) fn new(particles: usize) -> Self {
        let blocks = vec![Moved::default(); particles.div_ceil(BLOCK)];
        Frozen { columns: from_fn(|_| vec![0.0; particles]), blocks }
    }
}

/// Points of a slice are looked for so often: the interval has then shrunk to the particle itself.
const SHRINKINGS: usize = 200;
/// Width of the interval about a particle, in standard deviations of all.
const SLICE: f64 = 4.0;

impl Move {
    /// Refuses parameters that are out of range.
    pub(crate) fn check(self) -> Result<()> {
        match self {
            Move::RandomWalk { scale: Some(scale) } => {
                Error::positive("scale of the random walk", scale).map(drop)
            }
            Move::RandomWalk { scale: None } | Move::Stretch | Move::Gibbs => Ok(()),
        }
    }

    /// Moves every particle once; `densities` are those of the particles before and after.
    pub(crate) fn sweep<const N: usize>(
        self,
        walk: &Walk<'_, N>,
        states: &mut [Vec<f64>; N],
        densities: &mut [f64],
        law: &impl Law<N>,
        frozen: &mut Frozen<N>,
    ) -> Moved {
        let Frozen { columns, blocks } = frozen;
        match self {
            Move::RandomWalk { scale } => {
                let scale = scale.unwrap_or(2.38 / (N as f64).sqrt());
                let step = walk.spread * scale;
                let propose = |draws: &mut Draws, x: [f64; N]| {
                    let n: [f64; N] = from_fn(|_| draws.normal());
                    let dx = step * n;
                    (from_fn(|k| x[k] + dx[k]), 0.0)
                };
                metropolis(walk, states, densities, 0..usize::MAX, law, blocks, propose)
            }
            Move::Stretch => {
                let n = densities.len();
                let half = n / 2;
                let mut moved = Moved::default();
                for (own, other) in [(0..half, half..n), (half..n, 0..half)] {
                    for (to, from) in columns.iter_mut().zip(&*states) {
                        to.copy_from_slice(from);
                    }
                    if other.is_empty() {
                        continue;
                    }
                    let columns = &*columns;
                    let propose = |draws: &mut Draws, x: [f64; N]| {
                        let z = 2.0 * draws.uniform();
                        let partner = other.start + (draws.uniform() * other.len() as f64) as usize;
                        let partner = partner.min(other.end - 1);
                        let y: [f64; N] = from_fn(|k| columns[k][partner]);
                        let factor = (N as f64 - 2.0) * Real::ln(z);
                        let factor = if z > 0.5 { factor } else { f64::NEG_INFINITY };
                        (from_fn(|k| z.mul_add(x[k] - y[k], y[k])), factor)
                    };
                    moved += metropolis(walk, states, densities, own, law, blocks, propose);
                }
                moved
            }
            Move::Gibbs => {
                let variance = (walk.spread * walk.spread.transpose()).diagonal();
                let mut moved = Moved::default();
                for k in 0..N {
                    moved += slice(walk, states, densities, (k, SLICE * variance[k].sqrt()), law, blocks);
                }
                moved
            }
        }
    }
}

/// One Metropolis-Hastings step of the particles of a range. `propose` gives a proposal for the state of a
/// particle and what its log-density gains by an asymmetric proposal.
fn metropolis<const N: usize>(
    walk: &Walk<'_, N>,
    states: &mut [Vec<f64>; N],
    densities: &mut [f64],
    range: std::ops::Range<usize>,
    law: &impl Law<N>,
    blocks: &mut [Moved],
    propose: impl Fn(&mut Draws, [f64; N]) -> ([f64; N], f64) + Sync,
) -> Moved {
    let columns = states.each_mut().map(Vec::as_mut_slice);
    walk.threads.for_each_block(columns, [densities], blocks, |b, states, [densities], moved| {
        *moved = Moved::default();
        let first = b * BLOCK;
        let from = range.start.saturating_sub(first).min(densities.len());
        let to = range.end.saturating_sub(first).min(densities.len());
        if from >= to {
            return;
        }
        let count = to - from;
        let mut proposals = [[0.0; BLOCK]; N];
        let (mut thresholds, mut scores) = ([0.0; BLOCK], [0.0; BLOCK]);
        for i in 0..count {
            let at = from + i;
            let mut draws = walk.stream.draws(Purpose::Move, walk.step, (first + at) as u32);
            let (proposal, gain) = propose(&mut draws, from_fn(|k| states[k][at]));
            for k in 0..N {
                proposals[k][i] = proposal[k];
            }
            thresholds[i] = Real::ln(draws.uniform()) - gain;
        }
        let scores = &mut scores[..count];
        law.log_density(first + from, &proposals.each_ref().map(|p| &p[..count]), scores);
        for i in 0..count {
            let at = from + i;
            let (old, new) = (densities[at], scores[i]);
            // From where nothing is possible every possible point is better. NaN accepts nothing.
            if new > f64::NEG_INFINITY && (old == f64::NEG_INFINITY || thresholds[i] < new - old) {
                for k in 0..N {
                    states[k][at] = proposals[k][i];
                }
                densities[at] = new;
                moved.accepted += 1;
            }
        }
        moved.evaluations = count;
    });
    sum(blocks)
}

/// Draws component `k` of all particles given the others, by slices; the interval has this width.
fn slice<const N: usize>(
    walk: &Walk<'_, N>,
    states: &mut [Vec<f64>; N],
    densities: &mut [f64],
    (k, width): (usize, f64),
    law: &impl Law<N>,
    blocks: &mut [Moved],
) -> Moved {
    let columns = states.each_mut().map(Vec::as_mut_slice);
    let stream = walk.stream.fork(k as u64);
    walk.threads.for_each_block(columns, [densities], blocks, |b, states, [densities], moved| {
        *moved = Moved::default();
        let count = densities.len();
        let (mut low, mut high, mut level) = ([0.0; BLOCK], [0.0; BLOCK], [0.0; BLOCK]);
        let mut candidates = [0.0; BLOCK];
        let mut scores = [0.0; BLOCK];
        let mut draws: [Option<Draws>; BLOCK] = [const { None }; BLOCK];
        let mut open = 0;
        for i in 0..count {
            // What is impossible has no slice; what has no spread, no interval.
            if densities[i] == f64::NEG_INFINITY || width.is_nan() || width <= 0.0 {
                continue;
            }
            let mut own = stream.draws(Purpose::Move, walk.step, (b * BLOCK + i) as u32);
            level[i] = densities[i] + Real::ln(own.uniform());
            low[i] = states[k][i] - width * own.uniform();
            high[i] = low[i] + width;
            draws[i] = Some(own);
            open += 1;
        }
        for _ in 0..SHRINKINGS {
            if open == 0 {
                break;
            }
            for i in 0..count {
                let inside = |own: &mut Draws| low[i] + (high[i] - low[i]) * own.uniform();
                candidates[i] = draws[i].as_mut().map_or(states[k][i], inside);
            }
            let mut at = states.each_ref().map(|c| &**c);
            at[k] = &candidates[..count];
            law.log_density(b * BLOCK, &at, &mut scores[..count]);
            for i in 0..count {
                if draws[i].is_none() {
                    continue;
                }
                moved.evaluations += 1;
                if scores[i] > level[i] {
                    (states[k][i], densities[i]) = (candidates[i], scores[i]);
                    draws[i] = None;
                    open -= 1;
                    moved.accepted += 1;
                } else if candidates[i] < states[k][i] {
                    low[i] = candidates[i];
                } else {
                    high[i] = candidates[i];
                }
            }
        }
    });
    sum(blocks)
}

fn sum(blocks: &[Moved]) -> Moved {
    let mut all = Moved::default();
    blocks.iter().for_each(|block| all += *block);
    all
}

#[cfg(test)]
mod tests;
