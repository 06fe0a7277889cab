//! Measurement models. A value is an array of the components in the order that the model names, so that readers
//! and simulations treat all sensors alike.
//!
//! Angles are counter-clockwise from the x axis, and every difference of angles is wrapped into (-pi, pi]. The
//! density of an angle is the normal density of its wrapped residual: it integrates to 1 up to the tail beyond pi,
//! which is below 1e-9 for standard deviations under half a radian.

mod position;
mod range_bearing;

pub use position::{Position, PositionGiven};
pub use range_bearing::{RangeBearing, RangeBearingGiven};

use crate::error::{Error, Result};
use crate::math::Real;

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
    sds.iter().map(|&sd| -Real::ln(sd) - HALF_LN_TAU).sum()
}

/// ln(2 pi) / 2.
const HALF_LN_TAU: f64 = 0.918_938_533_204_672_8;

/// Length of (`dx`, `dy`). The smallest normal number inside the root changes no length that matters and keeps the
/// derivatives at the sensor itself zero instead of NaN.
#[inline(always)]
fn length<R: Real>(dx: R, dy: R) -> R {
    dx.mul_add(dx, dy.mul_add(dy, dy.constant(f64::MIN_POSITIVE))).sqrt()
}

/// The covariance of independent components with these standard deviations.
fn diagonal<const M: usize>(sds: [f64; M]) -> [[f64; M]; M] {
    std::array::from_fn(|i| std::array::from_fn(|j| if i == j { sds[i] * sds[i] } else { 0.0 }))
}
