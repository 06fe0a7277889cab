//! Particle-based, rapid incremental smoother (PaRIS; Olsson and Westerborn, Bernoulli 23, 2017).

use super::backward::{Backward, Tables};
use super::history::History;
use crate::belief::Cloud;
use crate::error::{Error, Result};
use crate::model::Motion;
use crate::rng::{Purpose, Stream};
use crate::time::Time;

/// Smooths `K` additive functions of the path, sum over k of s(x_k, x_{k+1}), along with the filter: each
/// particle carries its expectation of the sum over the paths that lead to it, renewed from a few backward
/// draws.
#[derive(Clone, Debug)]
pub struct Paris<const N: usize, const K: usize> {
    how: Backward,
    draws: u32,
    stream: Stream,
    number: u64,
    history: History<N>,
    sums: Vec<[f64; K]>,
    spare: Vec<[f64; K]>,
    tables: Tables<N>,
}

/// A step of a path from one instant to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathStep<const N: usize> {
    /// When it begins.
    pub from: Time,
    /// The state there.
    pub before: [f64; N],
    /// When it ends.
    pub to: Time,
    /// The state there.
    pub after: [f64; N],
}

impl<const N: usize, const K: usize> Paris<N, K> {
    /// Begins at a cloud with the sums that `first` gives to its states, with two backward draws for each
    /// particle and step: one does not suffice (the paths would degenerate), more than two gain little.
    ///
    /// # Errors
    /// Sums that are not finite; a cloud whose particles are all lost.
    pub fn new(
        cloud: &Cloud<N>,
        how: Backward,
        stream: Stream,
        first: impl Fn(&[f64; N]) -> [f64; K],
    ) -> Result<Self> {
        let mut history = History::window(2)?;
        history.record(cloud)?;
        let sums = (0..cloud.len()).map(|i| finite(first(&cloud.particle(i)))).collect::<Result<_>>()?;
        let tables = Tables::default();
        Ok(Paris { how, draws: 2, stream, number: 0, history, sums, spare: Vec::new(), tables })
    }

    /// The same with another number of backward draws.
    ///
    /// # Errors
    /// No draws.
    pub fn with_draws(self, draws: u32) -> Result<Self> {
        Error::positive("number of backward draws", f64::from(draws))?;
        Ok(Paris { draws, ..self })
    }

    /// Takes in the cloud after a step of the filter; `term` is s. Where no time passes each particle keeps
    /// its one predecessor, and `term` sees the state twice.
    ///
    /// # Errors
    /// What [`History::record`] and [`backward_paths`](super::backward_paths) refuse; terms that are not
    /// finite. The sums cannot go on then.
    pub fn step<A: Motion<N, W>, const W: usize>(
        &mut self,
        motion: &A,
        cloud: &Cloud<N>,
        term: impl FnMut(&PathStep<N>) -> [f64; K],
    ) -> Result<()> {
        self.mix(motion, cloud, (1.0, 1.0), term)
    }

    /// The same for sums in which what there was counts `kept` and the new term `gain`: with 1 - g and g they
    /// are averages that forget.
    pub(crate) fn mix<A: Motion<N, W>, const W: usize>(
        &mut self,
        motion: &A,
        cloud: &Cloud<N>,
        (kept, gain): (f64, f64),
        mut term: impl FnMut(&PathStep<N>) -> [f64; K],
    ) -> Result<()> {
        self.history.record(cloud)?;
        self.number += 1;
        let (before, after) = (self.history.get(0)?, self.history.get(1)?);
        let density = self.tables.prepare(motion, before, after.time)?;
        self.spare.clear();
        for i in 0..cloud.len() {
            let (to, parent) = (after.state(i), before.parent(i));
            let mut draws = self.stream.draws(Purpose::Path, self.number, i as u32);
            let count = if density.is_some() { self.draws } else { 1 };
            let mut mean = [0.0; K];
            for _ in 0..count {
                let from = match &density {
                    None => parent,
                    Some(density) => self.tables.draw(density, before, to, parent, self.how, &mut draws)?,
                };
                let step =
                    PathStep { from: before.time, before: before.state(from), to: after.time, after: to };
                let term = term(&step);
                for k in 0..K {
                    mean[k] += (kept * self.sums[from][k] + gain * term[k]) / f64::from(count);
                }
            }
            self.spare.push(finite(mean)?);
        }
        std::mem::swap(&mut self.sums, &mut self.spare);
        Ok(())
    }

    /// E[sum of s | all measurements so far].
    ///
    /// # Errors
    /// None once a cloud has been recorded.
    pub fn expectation(&self) -> Result<[f64; K]> {
        let weights = &self.history.get(self.history.len().saturating_sub(1))?.weights;
        let mut sum = [0.0; K];
        for (sums, w) in self.sums.iter().zip(weights) {
            for k in 0..K {
                sum[k] += w * sums[k];
            }
        }
        Ok(sum)
    }
}

fn finite<const K: usize>(sums: [f64; K]) -> Result<[f64; K]> {
    for value in sums {
        Error::finite("additive function of a path", value)?;
    }
    Ok(sums)
}
