//! Swarms: points that search together for where a fitness is greatest.
//!
//! They leave no law as it is: points that a swarm has moved are a sample of nothing.
//! [`SwarmFilter`](crate::filter::SwarmFilter) takes them for particles all the same, as papers do;
//! [`SwarmImportance`](crate::filter::SwarmImportance) looks about them and weighs what it finds. What a bee's
//! step becomes as a Markov kernel is [`Move::Stretch`](crate::moves::Move).

mod bee_colony;
mod fitness;
mod particle_swarm;

pub use bee_colony::{BeeColony, Coordinates, Roulette};
pub(crate) use fitness::{Expected, Forecast, Seen};
pub use particle_swarm::{ParticleSwarm, Positions};

use crate::error::{Error, Result};
use crate::kernels::Simd;
use crate::moves::Law;
use crate::rng::Stream;
use std::array::from_fn;

/// A swarm, and how it searches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Swarm<const N: usize> {
    /// Particle swarm optimisation.
    Particles(ParticleSwarm<N>),
    /// Artificial bee colony.
    Bees(BeeColony<N>),
}

/// A box that a swarm does not leave, in the units of the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds<const N: usize> {
    /// Least value of each component.
    pub lower: [f64; N],
    /// Greatest value of each component.
    pub upper: [f64; N],
}

impl<const N: usize> Bounds<N> {
    /// The same interval for every component.
    pub fn cube(lower: f64, upper: f64) -> Self {
        Bounds { lower: [lower; N], upper: [upper; N] }
    }

    fn check(&self) -> Result<()> {
        for (&lower, &upper) in self.lower.iter().zip(&self.upper) {
            Error::finite("lower bound of a swarm", lower)?;
            Error::finite("upper bound of a swarm", upper)?;
            if lower > upper {
                let needs = "it must not be less than the lower bound";
                return Err(Error::OutOfRange { what: "upper bound of a swarm", value: upper, needs });
            }
        }
        Ok(())
    }
}

/// Component `k` of a point, brought back into the box where there is one.
#[inline(always)]
fn clip<const N: usize>(bounds: &Option<Bounds<N>>, k: usize, x: f64) -> f64 {
    match bounds {
        Some(bounds) if x < bounds.lower[k] => bounds.lower[k],
        Some(bounds) if x > bounds.upper[k] => bounds.upper[k],
        _ => x,
    }
}

/// What a search found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Found<const N: usize> {
    /// The fittest point that was ever seen; the first of several.
    pub(crate) best: [f64; N],
    /// Its fitness.
    pub(crate) fitness: f64,
    /// How often the fitness was asked for.
    pub(crate) evaluations: usize,
}

impl<const N: usize> Found<N> {
    fn among(states: &[Vec<f64>; N], fitness: &[f64]) -> Self {
        let mut found = Found { best: [f64::NAN; N], fitness: f64::NAN, evaluations: fitness.len() };
        found.compare(states, fitness);
        found
    }

    /// Looks whether one of the points is fitter than the best so far.
    fn compare(&mut self, states: &[Vec<f64>; N], fitness: &[f64]) {
        for (i, &fit) in fitness.iter().enumerate() {
            if self.fitness.is_nan() || fit > self.fitness {
                (self.best, self.fitness) = (from_fn(|k| states[k][i]), fit);
            }
        }
    }
}

/// Memory of a search, made by [`Swarm::memory`] and used again and again.
#[derive(Clone, Debug, Default)]
pub(crate) struct Memory {
    /// Random numbers of one round.
    uniforms: Vec<f64>,
    /// Of each point: velocities and best places of a particle swarm, component after component; sums of the
    /// roulette of bees.
    numbers: Vec<f64>,
    /// Fitness at the best places of a particle swarm; of bees the places that they look at, with their fitness.
    fitness: Vec<f64>,
    /// How often in a row a bee's place was not improved.
    trials: Vec<u32>,
    /// Which point each bee looks about.
    chosen: Vec<u32>,
}

/// What a search needs beside its points.
pub(crate) struct Search<'a, L> {
    /// ln of the fitness, up to a constant.
    pub(crate) law: &'a L,
    pub(crate) stream: Stream,
    pub(crate) step: u64,
    pub(crate) simd: Simd,
    pub(crate) memory: &'a mut Memory,
}

impl<const N: usize> Swarm<N> {
    /// Refuses parameters out of range.
    pub(crate) fn check(&self) -> Result<()> {
        match self {
            Swarm::Particles(swarm) => swarm.check(),
            Swarm::Bees(colony) => colony.check(),
        }
    }

    /// Random numbers that `n` points take in a round.
    fn uniforms(&self, n: usize) -> usize {
        match self {
            Swarm::Particles(_) => 2 * N * n,
            Swarm::Bees(colony) => n * (2 * colony.chances() + 1 + N),
        }
    }

    /// Memory of a search by `n` points.
    pub(crate) fn memory(&self, n: usize) -> Memory {
        match self {
            Swarm::Particles(_) => Memory {
                uniforms: vec![0.0; self.uniforms(n)],
                numbers: vec![0.0; 2 * N * n],
                fitness: vec![0.0; n],
                ..Memory::default()
            },
            Swarm::Bees(_) => Memory {
                uniforms: vec![0.0; self.uniforms(n)],
                numbers: vec![0.0; n],
                fitness: vec![0.0; (N + 1) * n],
                trials: vec![0; n],
                chosen: vec![0; n],
            },
        }
    }

    /// How often a search by `points` asks for the fitness, scouts left out.
    pub fn evaluations(&self, points: usize) -> usize {
        points
            * match self {
                Swarm::Particles(swarm) => 1 + swarm.iterations as usize,
                Swarm::Bees(colony) => 1 + 2 * colony.cycles as usize,
            }
    }

    /// Lets the points search; `fitness` is theirs afterwards.
    pub(crate) fn search(
        &self,
        states: &mut [Vec<f64>; N],
        fitness: &mut [f64],
        search: Search<'_, impl Law<N>>,
    ) -> Found<N> {
        let n = fitness.len();
        if search.memory.uniforms.len() != self.uniforms(n) {
            *search.memory = self.memory(n);
        }
        search.law.log_density(0, &states.each_ref().map(Vec::as_slice), fitness);
        match self {
            Swarm::Particles(swarm) => swarm.search(states, fitness, search),
            Swarm::Bees(colony) => colony.search(states, fitness, search),
        }
    }
}

#[cfg(test)]
mod tests;
