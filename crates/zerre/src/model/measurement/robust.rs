//! Heavier tails for any sensor, so that one wild value does not throw a filter off.

use crate::error::{Error, Result};
use crate::math::gaussian::LN_2PI;
use crate::math::{Cholesky, Matrix, Real, ln_gamma};
use crate::model::{GaussianMeasurement, Measurement};
use crate::rng::Draws;
use crate::time::Time;

/// A sensor whose noise keeps its shape R but has tails of its own: v ~ N(0, s R) with random s.
/// [`GaussianMeasurement::covariance`] gives R.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeavyTailed<H, const M: usize> {
    sensor: H,
    law: Law,
}

/// The law of s.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Law {
    /// s = 1.
    Normal,
    /// 1 / s ~ Gamma(dof / 2, dof / 2).
    StudentT { dof: f64 },
    /// s = `scale`^2 with `probability`, else 1.
    Outliers { probability: f64, scale: f64 },
}

/// A measurement with heavy tails, digested.
#[derive(Clone, Copy, Debug)]
pub struct HeavyTailedGiven<G> {
    normal: G,
    law: LawGiven,
}

/// The law of s, digested. It is the same for all states, so a kernel tells it apart once.
#[derive(Clone, Copy, Debug)]
enum LawGiven {
    Normal,
    StudentT { peak: f64, constant: f64, per_dof: f64, half_power: f64 },
    Outliers { log_inlier: f64, per_scale2: f64, broad: f64 },
}

impl<H, const M: usize> HeavyTailed<H, M> {
    /// Leaves `sensor` its normal law: for laws that are chosen at run time.
    pub fn normal(sensor: H) -> Self {
        HeavyTailed { sensor, law: Law::Normal }
    }

    /// Gives `sensor` Student-t noise of `dof` degrees of freedom: 1 is Cauchy's law, 3 to 5 the usual choice,
    /// infinity would be the normal law. Its covariance is R nu / (nu - 2) for nu > 2.
    ///
    /// Source: M. Roth, E. Özkan and F. Gustafsson, *A Student's t filter for heavy tailed process and measurement
    /// noise*, ICASSP 2013.
    ///
    /// # Errors
    /// `dof` not positive and finite.
    pub fn student_t(sensor: H, dof: f64) -> Result<Self> {
        let dof = Error::positive("degrees of freedom", dof)?;
        Ok(HeavyTailed { sensor, law: Law::StudentT { dof } })
    }

    /// Gives `sensor` noise that is now and then broad: with `probability` the standard deviations are `scale` times
    /// the usual ones (Tukey's contaminated normal law, 1960).
    ///
    /// # Errors
    /// `probability` not between 0 and 1 (both excluded), `scale` not finite or not above 1.
    pub fn outliers(sensor: H, probability: f64, scale: f64) -> Result<Self> {
        let what = "scale of the outliers";
        if Error::finite(what, scale)? <= 1.0 {
            return Err(Error::OutOfRange { what, value: scale, needs: "it must be above 1" });
        }
        let probability = outlier_probability(probability)?;
        Ok(HeavyTailed { sensor, law: Law::Outliers { probability, scale } })
    }
}

impl<const N: usize, const M: usize, H: GaussianMeasurement<N, M>> Measurement<N> for HeavyTailed<H, M> {
    type Value = H::Value;
    type Given<'z>
        = HeavyTailedGiven<H::Given<'z>>
    where
        H: 'z;

    fn given<'z>(&'z self, z: &'z H::Value, at: Time) -> Result<Self::Given<'z>> {
        let law = match self.law {
            Law::Normal => LawGiven::Normal,
            Law::StudentT { dof } => {
                let (peak, half_m) = (log_peak(&self.sensor)?, 0.5 * M as f64);
                LawGiven::StudentT {
                    peak,
                    constant: peak + ln_gamma_step(0.5 * dof, M) - half_m * Real::ln(0.5 * dof),
                    per_dof: 1.0 / dof,
                    half_power: 0.5 * dof + half_m,
                }
            }
            Law::Outliers { probability, scale } => {
                let (peak, per_scale2) = (log_peak(&self.sensor)?, 1.0 / (scale * scale));
                LawGiven::Outliers {
                    log_inlier: Real::ln(1.0 - probability),
                    per_scale2,
                    // ln p(broad) = peak - M ln scale + (ln p - peak) / scale^2.
                    broad: Real::ln(probability) + peak * (1.0 - per_scale2) - M as f64 * Real::ln(scale),
                }
            }
        };
        Ok(HeavyTailedGiven { normal: self.sensor.given(z, at)?, law })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &Self::Given<'_>, x: [R; N]) -> R {
        let normal = H::log_likelihood(&given.normal, x);
        match given.law {
            LawGiven::Normal => normal,
            LawGiven::StudentT { peak, constant, per_dof, half_power } => {
                let distance2 = (normal - peak) * -2.0;
                ln_1p(distance2 * per_dof) * -half_power + constant
            }
            LawGiven::Outliers { log_inlier, per_scale2, broad } => {
                let broad = normal * per_scale2 + broad;
                (normal + log_inlier).log_add_exp(broad)
            }
        }
    }
}

impl<const N: usize, const M: usize, H: GaussianMeasurement<N, M>> GaussianMeasurement<N, M>
    for HeavyTailed<H, M>
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

    #[inline(always)]
    fn covariance_scale<R: Real>(&self, mahalanobis_squared: R) -> R {
        let one = mahalanobis_squared.constant(1.0);
        match self.law {
            Law::Normal => one,
            Law::StudentT { dof } => (mahalanobis_squared + dof) / (dof + M as f64),
            // 1 / (p + (1 - p) / scale^2), where p is the posterior probability of an ordinary value.
            Law::Outliers { probability, scale } => {
                let ordinary = ordinary::<R, M>(probability, scale, mahalanobis_squared);
                one / (ordinary + (one - ordinary) * (1.0 / (scale * scale)))
            }
        }
    }

    fn draw_covariance_scale(&self, draws: &mut Draws) -> f64 {
        match self.law {
            Law::Normal => 1.0,
            Law::StudentT { dof } => 0.5 * dof / draws.gamma(0.5 * dof),
            Law::Outliers { probability, scale } => {
                if draws.uniform() < probability {
                    scale * scale
                } else {
                    1.0
                }
            }
        }
    }

    fn propose_covariance_scale(&self, mahalanobis_squared: f64, draws: &mut Draws) -> (f64, f64) {
        if !mahalanobis_squared.is_finite() {
            return (<Self as GaussianMeasurement<N, M>>::draw_covariance_scale(self, draws), 1.0);
        }
        match self.law {
            Law::Normal => (1.0, 1.0),
            // 1 / s given the residual is Gamma((nu + M) / 2, (nu + d^2) / 2).
            Law::StudentT { dof } => {
                let (shape, half_m) = (0.5 * dof, 0.5 * M as f64);
                let rate = 0.5 * (dof + mahalanobis_squared);
                let precision = if draws.uniform() < 0.5 {
                    draws.gamma(shape) / shape
                } else {
                    draws.gamma(shape + half_m) / rate
                };
                let log_ratio = shape * ln_1p(mahalanobis_squared / dof)
                    - 0.5 * mahalanobis_squared * precision
                    + half_m * (Real::ln(rate) + Real::ln(precision))
                    - ln_gamma_step(shape, M);
                (1.0 / precision, 2.0 / (1.0 + Real::exp(log_ratio)))
            }
            Law::Outliers { probability, scale } => {
                let posterior = 1.0 - ordinary::<f64, M>(probability, scale, mahalanobis_squared);
                let proposed = 0.5 * (probability + posterior);
                if draws.uniform() < proposed {
                    (scale * scale, probability / proposed)
                } else {
                    (1.0, (1.0 - probability) / (1.0 - proposed))
                }
            }
        }
    }
}

/// The posterior probability that a value at this distance is no outlier.
#[inline(always)]
fn ordinary<R: Real, const M: usize>(probability: f64, scale: f64, mahalanobis_squared: R) -> R {
    let log_odds = mahalanobis_squared * 0.5 * (1.0 - 1.0 / (scale * scale))
        + (Real::ln(probability / (1.0 - probability)) - M as f64 * Real::ln(scale));
    mahalanobis_squared.constant(1.0) / (log_odds.exp() + 1.0)
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
