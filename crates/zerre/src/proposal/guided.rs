//! Normal proposals that look at the measurement.

use super::engine::{Engine, Models};
use super::fit::{Fit, Given, affine, dot, normal};
use crate::error::{Error, Result};
use crate::kernels::{self, NoiseBlock, Propose, Simd};
use crate::math::{Cholesky, Float, Matrix, Real, gaussian::LN_2PI, ln_gamma};
use crate::model::{GaussianMeasurement, Likelihood, Motion, Noise};
use std::array::from_fn;

/// A normal law for the noise of each particle, fitted to its posterior p(w | x, z) given a measurement of
/// `M` components.
///
/// | `T` | the fit | source |
/// |---|---|---|
/// | [`Tangent`](crate::filter::Tangent) | by the tangent of h(f(x, .)) at the mean of the noise: EKF-guided | Doucet, Godsill and Andrieu 2000, II.D |
/// | [`Linear`](crate::filter::Linear) | the same where it is exact, and nothing else: locally optimal | Doucet, Godsill and Andrieu 2000, II.D |
/// | [`SigmaPoints`](crate::filter::SigmaPoints) | by the regression line over sigma points: UKF-guided, the unscented particle filter | van der Merwe, Doucet, de Freitas and Wan 2000 |
///
/// With sigma points, a particle for which the line misses more than the noise of the measurement (trace(R^-1
/// Omega) > 1) has its points drawn anew from the fit, up to three passes in all: posterior linearisation
/// (García-Fernández, Svensson, Morelande and Särkkä 2015). Points of the prior alone, as in the source, lose
/// targets where the sensor is precise and curved.
///
/// A proposal whose tails are lighter than those of what it stands for lets single weights grow without
/// bound. A `defensive` share of the particles therefore takes noise of the motion's own law, and all weights
/// are those of the mixture (Hesterberg, Technometrics 37, 1995): none exceeds the likelihood over the share.
/// It is [`DEFENSIVE`] where the process noise is not normal or the sensor robust, and nothing elsewhere,
/// unless it is set.
///
/// Of a robust sensor with noise v ~ N(0, s R) and random s, the fit of a particle takes the s that its
/// distance from the measurement speaks for: a particle that faces an outlier stays where the motion takes
/// it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guided<T, const M: usize> {
    transform: T,
    defensive: Option<f64>,
    passes: u32,
}

/// The defensive share where tails ask for one.
pub const DEFENSIVE: f64 = 0.1;

impl<T, const M: usize> Guided<T, M> {
    /// The proposal of this fit.
    pub fn new(transform: T) -> Self {
        Guided { transform, defensive: None, passes: 3 }
    }

    /// Sets the share of the particles that take noise of the motion's own law.
    ///
    /// # Errors
    /// A share outside [0, 1).
    pub fn with_defensive(self, share: f64) -> Result<Self> {
        let what = "defensive share";
        if Error::not_negative(what, share)? >= 1.0 {
            return Err(Error::OutOfRange { what, value: share, needs: "it must be below 1" });
        }
        Ok(Guided { defensive: Some(share), ..self })
    }

    /// Sets the largest number of passes of sigma points; 1 is the original proposal of van der Merwe et al.
    /// The other fits take one.
    ///
    /// # Errors
    /// No pass at all.
    pub fn with_passes(self, passes: u32) -> Result<Self> {
        Error::positive("passes of sigma points", f64::from(passes))?;
        Ok(Guided { passes, ..self })
    }
}

/// A measurement digested, with what the weights need.
pub struct GuidedGiven<'a, S, A, H, T: Fit, const M: usize> {
    given: Given<'a, S, A, H, T, M>,
    law: Law,
    defensive: f64,
}

/// ln p(w) up to what is the same in ln q.
#[derive(Clone, Copy)]
enum Law {
    Normal,
    /// Shape, the constant less that of the standard normal law, and how many components are drawn.
    Gamma {
        shape: f64,
        constant: f64,
        components: usize,
    },
}

impl<T, A, H, const N: usize, const W: usize, const M: usize> Engine<N, W, A, H> for Guided<T, M>
where
    T: Fit,
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    type Given<'a>
        = GuidedGiven<'a, A::Step, A, H, T, M>
    where
        A: 'a,
        H: 'a;

    const GUIDED: bool = true;

    fn accept(&self, motion: &A, sensor: &H) -> Result<()> {
        const { assert!(W > 0 && M > 0, "nothing to guide") };
        self.transform.spread(W)?;
        if T::EXACT {
            normal(motion.noise(), sensor)?;
        }
        Ok(())
    }

    fn given<'a>(
        &self,
        models: Models<'a, A::Step, A, H>,
        z: &<H as Likelihood<N>>::Value,
        near: &[f64; N],
    ) -> Result<Self::Given<'a>> {
        let (noise, sensor) = (models.motion.noise(), models.sensor);
        let heavy = sensor.is_heavy_tailed();
        let factor = Cholesky::of("covariance of the measurement", &Matrix(sensor.covariance()))?;
        let columns: [[f64; M]; M] = from_fn(|j| factor.whiten(&from_fn(|i| f64::from(u8::from(i == j)))));
        let law = match noise {
            Noise::StandardNormal => Law::Normal,
            Noise::Gamma { shape } => {
                let components = models.motion.noise_components().min(W);
                // q has a scale of sqrt(shape) in every component.
                let one = 0.5 * LN_2PI + 0.5 * Real::ln(shape) - ln_gamma(shape);
                Law::Gamma { shape, constant: components as f64 * one, components }
            }
        };
        let tails = noise != Noise::StandardNormal || heavy;
        let given = Given {
            z: sensor.components(z),
            whiten: Matrix(columns).transpose().0,
            noise: (noise.mean(), noise.variance().sqrt()),
            spread: self.transform.spread(W)?,
            passes: self.passes,
            heavy,
            models,
        };
        if T::EXACT {
            affine(&given, near)?;
        }
        let defensive = self.defensive.unwrap_or(if tails { DEFENSIVE } else { 0.0 });
        Ok(GuidedGiven { given, law, defensive })
    }

    fn defensive(given: &Self::Given<'_>) -> f64 {
        given.defensive
    }

    fn propose(
        given: &Self::Given<'_>,
        simd: Simd,
        (normal, own): (&NoiseBlock<W>, Option<&NoiseBlock<W>>),
        states: &mut [&mut [f64]; N],
        ratios: &mut [f64],
    ) -> usize {
        let more = kernels::propose(simd, given, normal, own, states, ratios);
        let (once, again) = T::evaluations(W);
        once * ratios.len() + again * more
    }
}

impl<T, A, H, const N: usize, const W: usize, const M: usize> Propose<N, W>
    for GuidedGiven<'_, A::Step, A, H, T, M>
where
    T: Fit,
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    #[inline(always)]
    fn propose<R: Float>(&self, x: [R; N], normal: [R; W], own: [R; W], takes_own: R) -> ([R; N], R, R) {
        let zero = takes_own.constant(0.0);
        let (mean, sd) = self.given.noise;
        let (fitted, more) = T::fit::<R, A, H, N, W, M>(&self.given, x);
        // A fit that has left the numbers is none: the particle is drawn as if nothing had been seen.
        let mut sum = fitted.information;
        for i in 0..W {
            sum = sum + fitted.mean[i].abs();
        }
        let infinity = zero.constant(f64::INFINITY);
        let information = sum.if_lt(infinity, fitted.information, zero.constant(1.0));
        let mut v = fitted.at(normal);
        // What stands for the normal number that would have led to v.
        let mut n = normal;
        for i in 0..W {
            v[i] = sum.if_lt(infinity, v[i], normal[i]);
        }
        if self.defensive > 0.0 {
            let half = zero.constant(0.5);
            let mut plain = own;
            if let Law::Gamma { components, .. } = self.law {
                for i in 0..W {
                    plain[i] = if i < components { (own[i] - mean) * (1.0 / sd) } else { normal[i] };
                }
            }
            let from = fitted.standardised(plain);
            for i in 0..W {
                let from = sum.if_lt(infinity, from[i], plain[i]);
                v[i] = half.if_lt(takes_own, plain[i], v[i]);
                n[i] = half.if_lt(takes_own, from, n[i]);
            }
        }
        let mut w = v;
        for i in 0..W {
            w[i] = v[i] * sd + mean;
        }
        // ln p / q, the normal constants of both left out.
        let q = (information.ln() - dot(&n, &n)) * 0.5;
        let p = match self.law {
            Law::Normal => dot(&v, &v) * -0.5,
            Law::Gamma { shape, constant, components } => {
                let mut p = zero.constant(constant);
                for i in 0..components {
                    let log = (w[i].ln() * (shape - 1.0) - w[i]) + p;
                    p = zero.if_lt(w[i], log, -infinity);
                }
                p
            }
        };
        let mut ratio = p - q;
        if self.defensive > 0.0 {
            let share = self.defensive;
            ratio = -(((-ratio).exp() * (1.0 - share) + share).ln());
        }
        (A::apply(self.given.models.step, x, w), ratio, more)
    }
}
