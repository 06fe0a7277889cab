//! Moves of particles whose parents stay: each under p(z | x) p(x | parent), or with a part of the likelihood.

use super::{Frozen, Law, Move, Moved, Walk};
use crate::belief::Cloud;
use crate::error::Result;
use crate::kernels::{self, Simd, Threads};
use crate::math::{Cholesky, Matrix};
use crate::model::{Likelihood, Motion, TransitionDensity};

/// power ln p(z | x) + ln p(x | x') of each particle and its parent x'; -inf where either is no number.
pub(crate) struct PathLaw<'a, 'z, A: Motion<N, W>, H: Likelihood<N> + 'z, const N: usize, const W: usize> {
    pub(crate) density: &'a TransitionDensity<A, N, W>,
    pub(crate) digest: &'a H::Digest<'z>,
    pub(crate) parents: &'a [Vec<f64>; N],
    /// 1 for the posterior, less for a law on the way to it.
    pub(crate) power: f64,
    pub(crate) simd: Simd,
}

impl<A: Motion<N, W>, H: Likelihood<N>, const N: usize, const W: usize> PathLaw<'_, '_, A, H, N, W> {
    /// What log-likelihoods of the particles from `first` on, in `out`, are as log-densities.
    pub(crate) fn complete(&self, first: usize, states: &[&[f64]; N], out: &mut [f64]) {
        if self.power != 1.0 {
            out.iter_mut().for_each(|d| *d *= self.power);
        }
        let parents = self.parents.each_ref().map(|c| &c[first..first + out.len()]);
        kernels::add_log_transitions(self.simd, self.density, &parents, states, out);
        out.iter_mut().filter(|d| d.is_nan() || **d == f64::INFINITY).for_each(|d| *d = f64::NEG_INFINITY);
    }

    /// The log-likelihoods that log-densities of all particles were completed from, to rounding.
    pub(crate) fn likelihoods(&self, states: &[Vec<f64>; N], densities: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        let (from, to) = (self.parents.each_ref().map(Vec::as_slice), states.each_ref().map(Vec::as_slice));
        kernels::add_log_transitions(self.simd, self.density, &from, &to, out);
        out.iter_mut().zip(densities).for_each(|(out, density)| *out = (density - *out) / self.power);
    }
}

impl<A: Motion<N, W>, H: Likelihood<N>, const N: usize, const W: usize> Law<N>
    for PathLaw<'_, '_, A, H, N, W>
{
    fn log_density(&self, first: usize, states: &[&[f64]; N], out: &mut [f64]) {
        H::score(self.digest, self.simd, states, out);
        self.complete(first, states, out);
    }
}

/// Some D with D D' the covariance of a cloud; zero for one that has none.
pub(crate) fn spread_of<const N: usize>(cloud: &Cloud<N>) -> Matrix<N, N> {
    let covariance = cloud.gaussian().map(|law| *law.covariance());
    covariance.and_then(|c| Cholesky::semidefinite("covariance of the cloud", &c)).unwrap_or(Matrix::ZERO)
}

/// How particles are moved after a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sweeps {
    pub(crate) kernel: Move,
    pub(crate) count: u32,
}

impl Sweeps {
    pub(crate) fn check(self) -> Result<()> {
        self.kernel.check()
    }

    /// Moves the particles of `cloud` under `law`; `densities` are theirs before and after.
    pub(crate) fn run<const N: usize>(
        self,
        cloud: &mut Cloud<N>,
        densities: &mut [f64],
        frozen: &mut Frozen<N>,
        law: &impl Law<N>,
        (threads, spread): (&Threads, Matrix<N, N>),
    ) -> Moved {
        let mut moved = Moved::default();
        for sweep in 0..self.count {
            let stream = cloud.stream.fork(u64::from(sweep));
            let walk = Walk { stream, step: cloud.step, threads, spread };
            moved += self.kernel.sweep(&walk, &mut cloud.states, densities, law, frozen);
        }
        moved
    }
}
