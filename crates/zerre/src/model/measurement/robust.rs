//! Heavier tails for any sensor, so that one wild value does not throw a filter off.

use crate::error::{Error, Result};
use crate::math::gaussian::LN_2PI;
use crate::math::{Cholesky, Matrix, Real, ln_gamma};
use crate::model::{GaussianMeasurement, Measurement};
use crate::rng::Draws;
use crate::time::Time;

/// Student-t noise with the scale matrix R of the wrapped sensor: v ~ N(0, s R) with 1 / s ~ Gamma(nu / 2, nu / 2).
/// Its covariance is R nu / (nu - 2) for nu > 2; [`GaussianMeasurement::covariance`] gives R.
///
/// Source: M. Roth, E. Özkan and F. Gustafsson, *A Student's t filter for heavy tailed process and measurement
/// noise*, ICASSP 2013.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StudentT<H, const M: usize> {
    sensor: H,
    dof: f64,
}

/// A measurement with Student-t noise, digested.
#[derive(Clone, Copy, Debug)]
pub struct StudentTGiven<G> {
    normal: G,
    peak: f64,
    constant: f64,
    per_dof: f64,
    half_power: f64,
}

impl<H, const M: usize> StudentT<H, M> {
    /// Gives `sensor` noise of `dof` degrees of freedom: 1 is Cauchy's law, 3 to 5 the usual choice, infinity would
    /// be the normal law.
    ///
    /// # Errors
    /// `dof` not positive and finite.
    pub fn new(sensor: H, dof: f64) -> Result<Self> {
        Ok(StudentT { sensor, dof: Error::positive("degrees of freedom", dof)? })
    }
}

impl<const N: usize, const M: usize, H: GaussianMeasurement<N, M>> Measurement<N> for StudentT<H, M> {
    type Value = H::Value;
    type Given<'z>
        = StudentTGiven<H::Given<'z>>
    where
        H: 'z;

    fn given<'z>(&'z self, z: &'z H::Value, at: Time) -> Result<Self::Given<'z>> {
        let peak = log_peak(&self.sensor)?;
        let half_m = 0.5 * M as f64;
        Ok(StudentTGiven {
            normal: self.sensor.given(z, at)?,
            peak,
            constant: peak + ln_gamma_step(0.5 * self.dof, M) - half_m * Real::ln(0.5 * self.dof),
            per_dof: 1.0 / self.dof,
            half_power: 0.5 * self.dof + half_m,
        })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &Self::Given<'_>, x: [R; N]) -> R {
        let distance2 = (H::log_likelihood(&given.normal, x) - given.peak) * -2.0;
        ln_1p(distance2 * given.per_dof) * -given.half_power + given.constant
    }
}

impl<const N: usize, const M: usize, H: GaussianMeasurement<N, M>> GaussianMeasurement<N, M>
    for StudentT<H, M>
{
    const ANGLE: [bool; M] = H::ANGLE;

    #[inline(always)]
    fn predict<R: Real>(&self, at: Time, x: [R; N]) -> [R; M] {
        self.sensor.predict(at, x)
    }

    fn components(&self, z: &H::Value) -> [f64; M] {
        self.sensor.components(z)
    }

    fn covariance(&self) -> [[f64; M]; M] {
        self.sensor.covariance()
    }

    /// (nu + d^2) / (nu + M).
    fn covariance_scale(&self, mahalanobis_squared: f64) -> f64 {
        (self.dof + mahalanobis_squared) / (self.dof + M as f64)
    }

    fn draw_covariance_scale(&self, draws: &mut Draws) -> f64 {
        0.5 * self.dof / draws.gamma(0.5 * self.dof)
    }
}

/// Noise that is now and then broad: with probability `probability` the standard deviations of the wrapped sensor
/// are `scale` times as large (Tukey's contaminated normal law, 1960).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlierMixture<H, const M: usize> {
    sensor: H,
    probability: f64,
    scale: f64,
}

/// A measurement with mixed noise, digested.
#[derive(Clone, Copy, Debug)]
pub struct OutlierMixtureGiven<G> {
    normal: G,
    log_inlier: f64,
    per_scale2: f64,
    broad: f64,
}

impl<H, const M: usize> OutlierMixture<H, M> {
    /// Gives `sensor` outliers with `probability`, whose standard deviations are `scale` times the usual ones.
    ///
    /// # Errors
    /// `probability` not between 0 and 1 (both excluded), `scale` not finite or not above 1.
    pub fn new(sensor: H, probability: f64, scale: f64) -> Result<Self> {
        let what = "scale of the outliers";
        if Error::finite(what, scale)? <= 1.0 {
            return Err(Error::OutOfRange { what, value: scale, needs: "it must be above 1" });
        }
        Ok(OutlierMixture { sensor, probability: outlier_probability(probability)?, scale })
    }
}

impl<const N: usize, const M: usize, H: GaussianMeasurement<N, M>> Measurement<N> for OutlierMixture<H, M> {
    type Value = H::Value;
    type Given<'z>
        = OutlierMixtureGiven<H::Given<'z>>
    where
        H: 'z;

    fn given<'z>(&'z self, z: &'z H::Value, at: Time) -> Result<Self::Given<'z>> {
        let peak = log_peak(&self.sensor)?;
        let per_scale2 = 1.0 / (self.scale * self.scale);
        Ok(OutlierMixtureGiven {
            normal: self.sensor.given(z, at)?,
            log_inlier: Real::ln(1.0 - self.probability),
            per_scale2,
            // ln p(broad) = peak - M ln scale + (ln p - peak) / scale^2.
            broad: Real::ln(self.probability) + peak * (1.0 - per_scale2) - M as f64 * Real::ln(self.scale),
        })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &Self::Given<'_>, x: [R; N]) -> R {
        let normal = H::log_likelihood(&given.normal, x);
        let broad = normal * given.per_scale2 + given.broad;
        (normal + given.log_inlier).log_add_exp(broad)
    }
}

impl<const N: usize, const M: usize, H: GaussianMeasurement<N, M>> GaussianMeasurement<N, M>
    for OutlierMixture<H, M>
{
    const ANGLE: [bool; M] = H::ANGLE;

    #[inline(always)]
    fn predict<R: Real>(&self, at: Time, x: [R; N]) -> [R; M] {
        self.sensor.predict(at, x)
    }

    fn components(&self, z: &H::Value) -> [f64; M] {
        self.sensor.components(z)
    }

    fn covariance(&self) -> [[f64; M]; M] {
        self.sensor.covariance()
    }

    /// 1 / (p + (1 - p) / scale^2), where p is the posterior probability of an ordinary value.
    fn covariance_scale(&self, mahalanobis_squared: f64) -> f64 {
        let per_scale2 = 1.0 / (self.scale * self.scale);
        let log_odds = Real::ln(self.probability / (1.0 - self.probability))
            - M as f64 * Real::ln(self.scale)
            + 0.5 * mahalanobis_squared * (1.0 - per_scale2);
        let ordinary = 1.0 / (1.0 + Real::exp(log_odds));
        1.0 / (ordinary + (1.0 - ordinary) * per_scale2)
    }

    fn draw_covariance_scale(&self, draws: &mut Draws) -> f64 {
        if draws.uniform() < self.probability { self.scale * self.scale } else { 1.0 }
    }
}

/// Any sensor, of which some values say nothing: p(z | x) = (1 - e) p_sensor(z | x) + e u with a constant density u,
/// one over the volume that the values of the sensor can fill.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UniformOutliers<H> {
    sensor: H,
    log_inlier: f64,
    log_outlier: f64,
}

/// A measurement that may say nothing, digested.
#[derive(Clone, Copy, Debug)]
pub struct UniformOutliersGiven<G> {
    sensor: G,
    log_inlier: f64,
    log_outlier: f64,
}

impl<H> UniformOutliers<H> {
    /// Gives `sensor` outliers with `probability`, spread evenly over a `volume` in the units of its values (metres
    /// times radians for range and bearing).
    ///
    /// # Errors
    /// `probability` not between 0 and 1 (both excluded), `volume` not positive and finite.
    pub fn new(sensor: H, probability: f64, volume: f64) -> Result<Self> {
        let probability = outlier_probability(probability)?;
        let volume = Error::positive("volume of the outliers", volume)?;
        let log_outlier = Real::ln(probability) - Real::ln(volume);
        Ok(UniformOutliers { sensor, log_inlier: Real::ln(1.0 - probability), log_outlier })
    }
}

impl<const N: usize, H: Measurement<N>> Measurement<N> for UniformOutliers<H> {
    type Value = H::Value;
    type Given<'z>
        = UniformOutliersGiven<H::Given<'z>>
    where
        H: 'z;

    fn given<'z>(&'z self, z: &'z H::Value, at: Time) -> Result<Self::Given<'z>> {
        let &UniformOutliers { log_inlier, log_outlier, .. } = self;
        Ok(UniformOutliersGiven { sensor: self.sensor.given(z, at)?, log_inlier, log_outlier })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &Self::Given<'_>, x: [R; N]) -> R {
        let inlier = H::log_likelihood(&given.sensor, x) + given.log_inlier;
        // In this order a NaN of the sensor stays a NaN, which the filter counts.
        inlier.constant(given.log_outlier).log_add_exp(inlier)
    }
}

fn outlier_probability(value: f64) -> Result<f64> {
    let what = "probability of an outlier";
    if Error::finite(what, value)? > 0.0 && value < 1.0 {
        Ok(value)
    } else {
        Err(Error::OutOfRange { what, value, needs: "it must be above 0 and below 1" })
    }
}

/// The largest value of ln N(v; 0, R).
fn log_peak<const N: usize, const M: usize>(sensor: &impl GaussianMeasurement<N, M>) -> Result<f64> {
    let factor = Cholesky::of("covariance of the measurement", &Matrix(sensor.covariance()))?;
    Ok(-0.5 * (factor.log_det() + M as f64 * LN_2PI))
}

/// ln(1 + x) for x > -1, without losing the digits of a small x: what 1 + x rounds away is added to first order.
#[inline(always)]
fn ln_1p<R: Real>(x: R) -> R {
    let u = x + 1.0;
    u.ln() + (x - (u - 1.0)) / u
}

/// ln Gamma(a + m / 2) - ln Gamma(a), without the cancellation of two large logarithms.
fn ln_gamma_step(a: f64, m: usize) -> f64 {
    let whole: f64 = (0..m / 2).map(|i| Real::ln(a + 0.5 * (m % 2) as f64 + i as f64)).sum();
    if m.is_multiple_of(2) {
        whole
    } else if a < 20.0 {
        whole + ln_gamma(a + 0.5) - ln_gamma(a)
    } else {
        // Asymptotic series; the next term, 31 / 18432 a^-9, is below 4e-15.
        let z = 1.0 / (a * a);
        let tail = -0.125 + z * (1.0 / 192.0 + z * (-1.0 / 640.0 + z * (17.0 / 14_336.0)));
        whole + 0.5 * Real::ln(a) + tail / a
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gamma_steps_meet_ln_gamma() {
        for m in 1..=6 {
            for a in [0.3, 1.5, 10.0, 19.99, 20.0, 35.0, 400.0] {
                let direct = ln_gamma(a + 0.5 * m as f64) - ln_gamma(a);
                // ln Gamma is good to 1e-14 of its size.
                let tolerance = 4e-14 * (1.0 + ln_gamma(a + 3.0).abs());
                assert!((ln_gamma_step(a, m) - direct).abs() < tolerance, "{a} {m}");
            }
        }
    }

    #[test]
    fn small_arguments_keep_their_digits() {
        for x in [0.0, 1e-300, 1e-17, 3e-9, 0.1, 7.0, 1e300] {
            assert!((ln_1p(x) - x.ln_1p()).abs() <= 4.0 * f64::EPSILON * x.ln_1p(), "{x}");
        }
    }
}
