//! Measurement models. A value is an array of the components in the order that the model names, so that readers
//! and simulations treat all sensors alike.
//!
//! Angles are counter-clockwise from the x axis, and every difference of angles is wrapped into (-pi, pi]. The
//! density of an angle is the normal density of its wrapped residual: it integrates to 1 up to the tail beyond pi,
//! which is below 1e-9 for standard deviations under half a radian.

mod bearing_only;
mod binomial_logit;
mod box_size;
mod conditioned;
mod growth;
mod linear;
mod position;
mod range_bearing;
mod range_bearing_elevation;
mod range_only;
mod range_rate;
mod robust;
mod stochastic_volatility;
mod upf_growth;

pub use bearing_only::{BearingOnly, BearingOnlyGiven};
pub use binomial_logit::{BinomialLogit, BinomialLogitGiven};
pub use box_size::{BoxSize, BoxSizeGiven};
pub use conditioned::{Conditioned, ConditionedGiven};
pub use growth::{Growth, GrowthGiven};
pub use linear::{Linear, LinearGiven};
pub use position::{Position, PositionGiven};
pub use range_bearing::{RangeBearing, RangeBearingGiven};
pub use range_bearing_elevation::{RangeBearingElevation, RangeBearingElevationGiven};
pub use range_only::{RangeOnly, RangeOnlyGiven};
pub use range_rate::{RangeRate, RangeRateGiven};
pub use robust::{HeavyTailed, HeavyTailedGiven, UniformOutliers, UniformOutliersGiven};
pub use stochastic_volatility::{StochasticVolatility, StochasticVolatilityGiven};
pub use upf_growth::{UpfGrowth, UpfGrowthGiven};

use crate::error::{Error, Result};
use crate::math::Real;
use crate::math::gaussian::LN_2PI;

/// `z` if all its components are finite.
fn finite<'z, const M: usize>(what: &'static str, z: &'z [f64; M]) -> Result<&'z [f64; M]> {
    for &value in z {
        Error::finite(what, value)?;
    }
    Ok(z)
}

/// Sine and cosine of a measured angle. Angles of more than millions of turns are refused: their digits say no
/// direction any more.
fn direction(what: &'static str, value: f64) -> Result<(f64, f64)> {
    if Error::finite(what, value)?.abs() > 33_554_432.0 {
        return Err(Error::OutOfRange { what, value, needs: "an angle in radians is needed" });
    }
    Ok(Real::sin_cos(value))
}

/// -sum ln(sd sqrt(2 pi)): the constant of a normal density of independent components.
fn log_constant(sds: &[f64]) -> f64 {
    sds.iter().map(|&sd| -Real::ln(sd) - 0.5 * LN_2PI).sum()
}

/// Length of a vector. The smallest normal number inside the root changes no length that matters and keeps the
/// derivatives at the sensor itself zero instead of NaN.
#[inline(always)]
fn length<R: Real, const D: usize>(d: [R; D]) -> R {
    let mut sum = d[0].constant(f64::MIN_POSITIVE);
    for d in d {
        sum = d.mul_add(d, sum);
    }
    sum.sqrt()
}

/// The vector from `origin` to the position at the front of the state.
#[inline(always)]
fn from_sensor<R: Real, const D: usize, const N: usize>(x: &[R; N], origin: &[f64; D]) -> [R; D] {
    const { assert!(D > 0 && N >= D, "the state has no position of so many dimensions") };
    let mut d = [x[0]; D];
    for i in 0..D {
        d[i] = x[i] - origin[i];
    }
    d
}

/// Angle of the point (`ahead`, `left`) less the angle of which `sin` and `cos` are given. Turned back by that
/// angle, the point's direction is the difference itself, already wrapped into (-pi, pi].
#[inline(always)]
fn turned_back<R: Real>(ahead: R, left: R, sin: f64, cos: f64) -> R {
    let y = left.mul_add(left.constant(cos), -(ahead * sin));
    let x = ahead.mul_add(ahead.constant(cos), left * sin);
    y.atan2(x)
}

/// The covariance of independent components with these standard deviations.
fn diagonal<const M: usize>(sds: [f64; M]) -> [[f64; M]; M] {
    std::array::from_fn(|i| std::array::from_fn(|j| if i == j { sds[i] * sds[i] } else { 0.0 }))
}
