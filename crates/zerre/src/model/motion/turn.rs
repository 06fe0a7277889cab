//! What coordinated turns share.

use super::add_scaled;
use crate::math::{Real, sinc};

/// Moves position and velocity at the front of `x` over `dt` seconds along the arc on which the velocity turns
/// left by 2 `half` radians.
#[inline(always)]
pub(super) fn along_arc<R: Real, const N: usize>(x: &mut [R; N], dt: f64, half: R) {
    let (s, c) = half.sin_cos();
    // The chord: dt sinc(half), half way between the old and the new direction. No cancellation for small turns.
    let chord = sinc(half);
    let (vx, vy) = (x[2], x[3]);
    let (ahead, aside) = (chord * c, chord * s);
    x[0] = add_scaled(x[0], dt, ahead.mul_add(vx, -(aside * vy)));
    x[1] = add_scaled(x[1], dt, ahead.mul_add(vy, aside * vx));
    let (cos, sin) = (c.mul_add(c, -(s * s)), s * c * 2.0);
    x[2] = cos.mul_add(vx, -(sin * vy));
    x[3] = cos.mul_add(vy, sin * vx);
}
