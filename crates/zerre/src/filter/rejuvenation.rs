//! What keeps survivors of a resampling apart.

use crate::belief::Cloud;
use crate::error::{Error, Result};
use crate::kernels::{self, Simd, Source, Survivors};
use crate::math::{Cholesky, Real, dot, ln_gamma};
use crate::rng::Purpose;
use serde::{Deserialize, Serialize};
use std::array::from_fn;
use std::f64::consts::PI;

/// What is done to the survivors of a resampling before they move on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rejuvenation {
    /// Nothing.
    #[default]
    Nothing,
    /// Roughening (Gordon, Salmond and Smith 1993, section 3.2): component k gets normal jitter of this
    /// standard deviation times E_k n^(-1/N), E_k being the spread between the largest and the smallest
    /// particle. 0.2 is the authors' value. It widens the posterior.
    Roughen(f64),
    /// The regularised particle filter (Musso, Oudjane and Le Gland 2001): survivors are drawn from a kernel
    /// density of the weighted cloud, x + h D e with D D' its covariance and the bandwidth h = A n^(-1/(N+4))
    /// that is best for a normal law.
    Regularise {
        /// The law of e.
        kernel: Kernel,
        /// Whether survivors are first drawn towards the mean by as much as the kernel widens (West 1993; Liu
        /// and West 2001), so that mean and covariance stay what they were. Without, the covariance grows by
        /// 1 + h^2 Var e at every resampling: by 14 % with 2 000 particles of four components and the normal
        /// kernel.
        shrink: bool,
    },
}

/// A kernel of [`Rejuvenation::Regularise`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kernel {
    /// Standard normal.
    #[default]
    Gaussian,
    /// Density proportional to 1 - |e|^2 on the unit ball: of the least mean integrated squared error.
    Epanechnikov,
}

impl Kernel {
    /// The bandwidth for `n` particles of `dimensions` components and unit covariance (Silverman 1986,
    /// 4.3.2), and the variance of a component of e.
    pub(super) fn bandwidth(self, n: usize, dimensions: usize) -> (f64, f64) {
        let d = dimensions as f64;
        let log_a = match self {
            Kernel::Gaussian => Real::ln(4.0 / (d + 2.0)),
            Kernel::Epanechnikov => {
                let log_ball = 0.5 * d * Real::ln(PI) - ln_gamma(0.5 * d + 1.0);
                Real::ln(8.0 * (d + 4.0)) + d * Real::ln(2.0 * PI.sqrt()) - log_ball
            }
        };
        let variance = match self {
            Kernel::Gaussian => 1.0,
            Kernel::Epanechnikov => 1.0 / (d + 4.0),
        };
        (Real::exp((log_a - Real::ln(n as f64)) / (d + 4.0)), variance)
    }
}

impl Rejuvenation {
    /// Refuses a jitter below zero.
    pub(super) fn checked(self) -> Result<Self> {
        if let Rejuvenation::Roughen(scale) = self {
            Error::not_negative("roughening", scale)?;
        }
        Ok(self)
    }

    /// Gathers the survivors of the last resampling and moves them apart.
    pub(super) fn apply<const N: usize>(self, simd: Simd, cloud: &mut Cloud<N>) {
        match self {
            Rejuvenation::Nothing => {}
            Rejuvenation::Roughen(scale) if scale > 0.0 => roughen(scale, simd, cloud),
            Rejuvenation::Roughen(_) => {}
            Rejuvenation::Regularise { kernel, shrink } => regularise(kernel, shrink, simd, cloud),
        }
    }
}

/// Puts the survivors of the last resampling in their places.
pub(super) fn gather<const N: usize>(simd: Simd, cloud: &mut Cloud<N>) {
    let n = cloud.coming();
    std::mem::swap(&mut cloud.states, &mut cloud.spare);
    cloud.resize(n);
    let survivors = Survivors::new(cloud.spare.each_ref().map(Vec::as_slice), &cloud.ancestors);
    let survivors = survivors.block(simd, 0, n);
    kernels::gather(Source::Survivors(survivors), &mut cloud.states.each_mut().map(Vec::as_mut_slice));
    cloud.pending = false;
}

fn roughen<const N: usize>(scale: f64, simd: Simd, cloud: &mut Cloud<N>) {
    gather(simd, cloud);
    let n = cloud.len();
    let scale = scale * Real::exp(-Real::ln(n as f64) / N as f64);
    let sd: [f64; N] = from_fn(|k| {
        let column = &cloud.states[k];
        let low = column.iter().copied().fold(f64::INFINITY, f64::min);
        let high = column.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        scale * (high - low)
    });
    for i in 0..n {
        let mut draws = cloud.stream.draws(Purpose::Roughen, cloud.step, i as u32);
        for k in 0..N {
            cloud.states[k][i] += sd[k] * draws.normal();
        }
    }
}

fn regularise<const N: usize>(kernel: Kernel, shrink: bool, simd: Simd, cloud: &mut Cloud<N>) {
    // The cloud still shows the weighted particles from which the survivors were drawn.
    let factor = cloud.gaussian().and_then(|law| {
        Cholesky::semidefinite("covariance of the cloud", law.covariance())
            .map(|factor| (*law.mean(), factor))
    });
    // A cloud without a covariance has nothing to be spread by.
    let Ok((mean, factor)) = factor else { return };
    gather(simd, cloud);
    let n = cloud.len();
    let (h, variance) = kernel.bandwidth(n, N);
    // The bandwidth of few particles exceeds what shrinking can make up for.
    let h = if shrink { h.min(1.0 / variance.sqrt()) } else { h };
    let kept = if shrink { (1.0 - h * h * variance).max(0.0).sqrt() } else { 1.0 };
    for i in 0..n {
        let mut draws = cloud.stream.draws(Purpose::Roughen, cloud.step, i as u32);
        let mut e: [f64; N] = from_fn(|_| draws.normal());
        if kernel == Kernel::Epanechnikov {
            // |e|^2 is then Beta(N/2, 2): that of a normal vector shortened by an independent Gamma(2).
            let length = (dot(&e, &e) + 2.0 * draws.gamma(2.0)).sqrt();
            e = e.map(|e| e / length);
        }
        for k in 0..N {
            let x = &mut cloud.states[k][i];
            *x = mean[k] + kept * (*x - mean[k]) + h * dot(&factor.0[k], &e);
        }
    }
}
