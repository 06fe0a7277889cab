//! Particle swarm optimisation.

use super::{Bounds, Found, Search, clip};
use crate::error::{Error, Result};
use crate::kernels::fill_uniforms;
use crate::moves::Law;

/// Particle swarm optimisation (Kennedy and Eberhart, IEEE International Conference on Neural Networks, 1995):
/// each point remembers its best place p, all know the best of all g, and in every iteration
/// v <- w v + c1 r1 (p - x) + c2 r2 (g - x), x <- x + v with r1 and r2 uniform on (0, 1) in each component;
/// velocities are zero at first. All points move before p and g are looked at again.
///
/// With w = 1 the positions spread without bound as iterations go on: their variance settles only where
/// c1 + c2 < 24 (1 - w^2) / (7 - 5 w) (Poli, IEEE Transactions on Evolutionary Computation 13, 2009).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParticleSwarm<const N: usize> {
    /// How often all points move.
    pub iterations: u32,
    /// w, how much of the velocity is kept.
    pub inertia: f64,
    /// c1, the pull of a point's own best place.
    pub cognitive: f64,
    /// c2, the pull of the best place of all.
    pub social: f64,
    /// Where the points are in the end.
    pub positions: Positions,
    /// What they do not leave.
    pub bounds: Option<Bounds<N>>,
}

/// Where the points of a [`ParticleSwarm`] are in the end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Positions {
    /// Where they flew to last.
    #[default]
    Current,
    /// At the best place of each.
    PersonalBest,
}

impl<const N: usize> Default for ParticleSwarm<N> {
    /// One iteration with w = 1, c1 = 1.5 and c2 = 2, without bounds.
    fn default() -> Self {
        ParticleSwarm {
            iterations: 1,
            inertia: 1.0,
            cognitive: 1.5,
            social: 2.0,
            positions: Positions::default(),
            bounds: None,
        }
    }
}

impl<const N: usize> ParticleSwarm<N> {
    pub(super) fn check(&self) -> Result<()> {
        Error::finite("inertia of a particle swarm", self.inertia)?;
        Error::finite("pull of the own best place", self.cognitive)?;
        Error::finite("pull of the best place of all", self.social)?;
        self.bounds.as_ref().map_or(Ok(()), Bounds::check)
    }

    pub(super) fn search(
        &self,
        states: &mut [Vec<f64>; N],
        fitness: &mut [f64],
        search: Search<'_, impl Law<N>>,
    ) -> Found<N> {
        let Search { law, stream, step, simd, memory } = search;
        let n = fitness.len();
        let mut found = Found::among(states, fitness);
        let (velocities, best) = memory.numbers.split_at_mut(N * n);
        let mut velocities = columns::<N>(velocities, n);
        let mut best = columns::<N>(best, n);
        velocities.iter_mut().for_each(|column| column.fill(0.0));
        best.iter_mut().zip(&*states).for_each(|(to, from)| to.copy_from_slice(from));
        memory.fitness.copy_from_slice(fitness);
        for iteration in 0..self.iterations {
            fill_uniforms(simd, stream.fork(u64::from(iteration)), step, 0, &mut memory.uniforms);
            let (own, social) = memory.uniforms.split_at(N * n);
            for k in 0..N {
                for i in 0..n {
                    let (x, v) = (&mut states[k][i], &mut velocities[k][i]);
                    let to_own = self.cognitive * own[k * n + i] * (best[k][i] - *x);
                    let to_best = self.social * social[k * n + i] * (found.best[k] - *x);
                    *v = self.inertia * *v + to_own + to_best;
                    *x = clip(&self.bounds, k, *x + *v);
                }
            }
            law.log_density(0, &states.each_ref().map(Vec::as_slice), fitness);
            found.evaluations += n;
            for i in 0..n {
                if fitness[i] > memory.fitness[i] {
                    memory.fitness[i] = fitness[i];
                    best.iter_mut().zip(&*states).for_each(|(to, from)| to[i] = from[i]);
                }
            }
            found.compare(states, fitness);
        }
        if self.positions == Positions::PersonalBest {
            states.iter_mut().zip(&best).for_each(|(to, from)| to.copy_from_slice(from));
            fitness.copy_from_slice(&memory.fitness);
        }
        found
    }
}

/// N columns of `n` numbers each.
fn columns<const N: usize>(numbers: &mut [f64], n: usize) -> [&mut [f64]; N] {
    let mut parts = numbers.chunks_mut(n);
    std::array::from_fn(|_| parts.next().unwrap_or_default())
}
