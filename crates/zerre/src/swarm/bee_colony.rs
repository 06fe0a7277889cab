//! The artificial bee colony.

use super::{Bounds, Found, Memory, Search, clip};
use crate::error::{Error, Result};
use crate::kernels::{Simd, exponentials, fill_uniforms};
use crate::moves::Law;
use std::array::from_fn;

/// The artificial bee colony (Karaboga, technical report TR06, Erciyes University, 2005). In each cycle every point is
/// tried by an employed bee, then as many onlookers try points that a roulette picks by fitness, then scouts replace
/// points that were tried in vain too often.
///
/// To try a point x is to look at v = x + phi (x - y), y being another point and phi uniform on (-1, 1), and to go
/// there if it is fitter. All bees of a phase set out from the points as they are at its beginning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeeColony<const N: usize> {
    /// How often all phases are gone through.
    pub cycles: u32,
    /// A point that was tried in vain so often in a row is given up for one drawn uniformly within the bounds;
    /// without a limit there are no scouts.
    pub limit: Option<u32>,
    /// What the points do not leave.
    pub bounds: Option<Bounds<N>>,
    /// How onlookers choose.
    pub roulette: Roulette,
    /// What a bee changes.
    pub coordinates: Coordinates,
}

/// How probable a point is to an onlooker.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Roulette {
    /// Proportional to its fitness.
    #[default]
    Fitness,
    /// Proportional to exp(-c / mean c), c >= 0 being by how much the logarithm of its fitness is below the
    /// best ever seen: the choice of a widely used program.
    CostRatio,
}

/// What a bee changes of a point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Coordinates {
    /// One component, drawn.
    #[default]
    One,
    /// All, each with a phi of its own.
    All,
}

impl<const N: usize> Default for BeeColony<N> {
    /// One cycle, without scouts and bounds.
    fn default() -> Self {
        BeeColony {
            cycles: 1,
            limit: None,
            bounds: None,
            roulette: Roulette::default(),
            coordinates: Coordinates::default(),
        }
    }
}

impl<const N: usize> BeeColony<N> {
    pub(super) fn check(&self) -> Result<()> {
        if self.limit.is_some() && self.bounds.is_none() {
            let what = "scouts need bounds to look within: give some, or no limit";
            return Err(Error::Unsupported(what.to_owned()));
        }
        self.bounds.as_ref().map_or(Ok(()), Bounds::check)
    }

    /// Random numbers that a bee takes: one for a partner, then phi and which component, or phi of each.
    pub(super) fn chances(&self) -> usize {
        match self.coordinates {
            Coordinates::One => 3,
            Coordinates::All => 1 + N,
        }
    }

    pub(super) fn search(
        &self,
        states: &mut [Vec<f64>; N],
        fitness: &mut [f64],
        search: Search<'_, impl Law<N>>,
    ) -> Found<N> {
        let Search { law, stream, step, simd, memory } = search;
        let Memory { uniforms, numbers: sums, fitness: places, trials, chosen } = memory;
        let n = fitness.len();
        let found = Found::among(states, fitness);
        let tries = self.chances();
        trials.fill(0);
        let mut hive = Hive { colony: self, law, states, fitness, trials, found };
        for cycle in 0..self.cycles {
            fill_uniforms(simd, stream.fork(u64::from(cycle)), step, 0, uniforms);
            let (employed, rest) = uniforms.split_at(n * tries);
            let (onlookers, rest) = rest.split_at(n * tries);
            let (picks, scouts) = rest.split_at(n);
            chosen.iter_mut().zip(0..).for_each(|(to, i)| *to = i);
            hive.send(chosen, employed, places);
            let total = self.roulette.sums(simd, hive.fitness, hive.found.fitness, sums);
            for (to, pick) in chosen.iter_mut().zip(picks) {
                *to = sums.partition_point(|sum| *sum <= pick * total).min(n - 1) as u32;
            }
            hive.send(chosen, onlookers, places);
            if let (Some(limit), Some(bounds)) = (self.limit, &self.bounds) {
                hive.scout(limit, bounds, scouts);
            }
        }
        hive.found
    }
}

impl Roulette {
    /// Writes the running sums of what is proportional to each point's probability, and returns the last.
    fn sums(self, simd: Simd, fitness: &[f64], best: f64, sums: &mut [f64]) -> f64 {
        // 0 / 0 where all are equally fit, inf / inf where a fitness is zero.
        let cost = |fit: &f64| if *fit == best { 0.0 } else { best - fit };
        sums.iter_mut().zip(fitness).for_each(|(sum, fit)| *sum = -cost(fit));
        if self == Roulette::CostRatio {
            let mean = -sums.iter().sum::<f64>() / sums.len() as f64;
            sums.iter_mut().for_each(|sum| *sum = if mean > 0.0 { (*sum / mean).max(-745.0) } else { 0.0 });
        }
        exponentials(simd, sums);
        let mut total = 0.0;
        for sum in sums {
            total += *sum;
            *sum = total;
        }
        total
    }
}

/// A colony at work.
struct Hive<'a, const N: usize, L> {
    colony: &'a BeeColony<N>,
    law: &'a L,
    states: &'a mut [Vec<f64>; N],
    fitness: &'a mut [f64],
    trials: &'a mut [u32],
    found: Found<N>,
}

impl<const N: usize, L: Law<N>> Hive<'_, N, L> {
    /// Sends a bee to look about each of the points `chosen`, at once. Of the chances of a bee the first picks
    /// the other point. `places` is where they get, component after component, and how fit that is.
    fn send(&mut self, chosen: &[u32], chances: &[f64], places: &mut [f64]) {
        let (n, bees) = (self.fitness.len(), chosen.len());
        if n == 1 {
            return;
        }
        let (places, fitness) = places.split_at_mut(N * bees);
        let tries = chances.len() / bees;
        for (bee, (&i, chance)) in chosen.iter().zip(chances.chunks_exact(tries)).enumerate() {
            let i = i as usize;
            let other = (chance[0] * (n - 1) as f64) as usize;
            let other = if other < i { other } else { other + 1 };
            for k in 0..N {
                let (x, y) = (self.states[k][i], self.states[k][other]);
                let phi = match self.colony.coordinates {
                    Coordinates::One if N == 1 || k == ((chance[2] * N as f64) as usize).min(N - 1) => {
                        chance[1]
                    }
                    Coordinates::One => 0.5,
                    Coordinates::All => chance[1 + k],
                };
                places[k * bees + bee] = clip(&self.colony.bounds, k, x + (2.0 * phi - 1.0) * (x - y));
            }
        }
        let columns: [&[f64]; N] = from_fn(|k| &places[k * bees..(k + 1) * bees]);
        self.law.log_density(0, &columns, fitness);
        self.found.evaluations += bees;
        for (bee, &i) in chosen.iter().enumerate() {
            let i = i as usize;
            if fitness[bee] > self.fitness[i] {
                self.settle(i, from_fn(|k| columns[k][bee]), fitness[bee]);
            } else {
                self.trials[i] += 1;
            }
        }
    }

    /// Gives up points that were tried in vain `limit` times in a row.
    fn scout(&mut self, limit: u32, bounds: &Bounds<N>, chances: &[f64]) {
        for (i, chance) in chances.chunks_exact(N).enumerate() {
            if self.trials[i] < limit {
                continue;
            }
            let place = from_fn(|k| chance[k].mul_add(bounds.upper[k] - bounds.lower[k], bounds.lower[k]));
            let mut fitness = [0.0];
            self.law.log_density(i, &place.each_ref().map(std::slice::from_ref), &mut fitness);
            self.found.evaluations += 1;
            self.settle(i, place, fitness[0]);
        }
    }

    fn settle(&mut self, i: usize, place: [f64; N], fitness: f64) {
        self.states.iter_mut().zip(place).for_each(|(column, x)| column[i] = x);
        (self.fitness[i], self.trials[i]) = (fitness, 0);
        if fitness > self.found.fitness {
            (self.found.best, self.found.fitness) = (place, fitness);
        }
    }
}
