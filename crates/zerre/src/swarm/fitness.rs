//! What swarms look for in a filter.

use crate::kernels::{self, Simd};
use crate::math::Real;
use crate::model::{Likelihood, Motion, TransitionDensity};
use crate::moves::Law;
use std::array::from_fn;

/// Particles before a step: where it leads each on the average of its noise, and their normalised weights.
#[derive(Clone, Debug)]
pub(crate) struct Forecast<const N: usize> {
    centres: [Vec<f64>; N],
    weights: Vec<f64>,
    /// Running sums of the weights.
    sums: Vec<f64>,
}

impl<const N: usize> Default for Forecast<N> {
    fn default() -> Self {
        Forecast::with_room(0)
    }
}

impl<const N: usize> Forecast<N> {
    /// Of nothing yet, with room for `n` particles.
    pub(crate) fn with_room(n: usize) -> Self {
        let room = || Vec::with_capacity(n);
        Forecast { centres: from_fn(|_| room()), weights: room(), sums: room() }
    }

    /// Of the particles `from` with these normalised weights.
    pub(crate) fn fill<A: Motion<N, W>, const W: usize>(
        &mut self,
        simd: Simd,
        density: &TransitionDensity<A, N, W>,
        from: &[Vec<f64>; N],
        weights: impl Iterator<Item = f64>,
    ) {
        self.weights.clear();
        self.weights.extend(weights);
        self.sums.clear();
        self.sums.extend(self.weights.iter().scan(0.0, |sum, weight| {
            *sum += weight;
            Some(*sum)
        }));
        self.centres.iter_mut().for_each(|column| column.resize(self.weights.len(), 0.0));
        let mut centres = self.centres.each_mut().map(Vec::as_mut_slice);
        kernels::centres(simd, density, &from.each_ref().map(Vec::as_slice), &mut centres);
    }

    /// The particle at a place in (0, 1) of the sum of the weights.
    pub(crate) fn pick(&self, place: f64) -> usize {
        let total = self.sums.last().copied().unwrap_or_default();
        let at = self.sums.partition_point(|sum| *sum <= place * total);
        at.min(self.sums.len().saturating_sub(1))
    }

    /// Writes ln sum_j w_j p(x | x_j) of each state.
    pub(crate) fn log_density<A: Motion<N, W>, const W: usize>(
        &self,
        simd: Simd,
        density: &TransitionDensity<A, N, W>,
        states: &[&[f64]; N],
        out: &mut [f64],
    ) {
        let centres = self.centres.each_ref().map(Vec::as_slice);
        kernels::predict_density(simd, density, states, (&centres, &self.weights), out);
        out.iter_mut().for_each(|sum| *sum = Real::ln(*sum));
    }
}

/// ln p(z | x): the measurement alone.
pub(crate) struct Seen<'a, 'z, H: Likelihood<N> + 'z, const N: usize> {
    pub(crate) digest: &'a H::Digest<'z>,
    pub(crate) simd: Simd,
}

/// ln p(z | x) + ln sum_j w_j p(x | x_j), x_j being the particles before the step.
pub(crate) struct Expected<'a, 'z, A: Motion<N, W>, H: Likelihood<N> + 'z, const N: usize, const W: usize> {
    pub(crate) seen: Seen<'a, 'z, H, N>,
    pub(crate) density: &'a TransitionDensity<A, N, W>,
    pub(crate) forecast: &'a Forecast<N>,
}

/// States that are looked at together: bees come one by one, and should not pay for memory that they do not use.
const PART: usize = 64;

/// NaN and +inf count as impossible.
fn mend(out: &mut [f64]) {
    out.iter_mut().filter(|d| d.is_nan() || **d == f64::INFINITY).for_each(|d| *d = f64::NEG_INFINITY);
}

impl<H: Likelihood<N>, const N: usize> Law<N> for Seen<'_, '_, H, N> {
    fn log_density(&self, _: usize, states: &[&[f64]; N], out: &mut [f64]) {
        H::score(self.digest, self.simd, states, out);
        mend(out);
    }
}

impl<A: Motion<N, W>, H: Likelihood<N>, const N: usize, const W: usize> Law<N>
    for Expected<'_, '_, A, H, N, W>
{
    fn log_density(&self, _: usize, states: &[&[f64]; N], out: &mut [f64]) {
        H::score(self.seen.digest, self.seen.simd, states, out);
        let mut predictions = [0.0; PART];
        for (b, out) in out.chunks_mut(PART).enumerate() {
            let predictions = &mut predictions[..out.len()];
            let part = states.map(|column| &column[b * PART..b * PART + out.len()]);
            self.forecast.log_density(self.seen.simd, self.density, &part, predictions);
            out.iter_mut().zip(predictions).for_each(|(out, prediction)| *out += *prediction);
        }
        mend(out);
    }
}
