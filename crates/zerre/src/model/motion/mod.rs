//! Motion models. Every discretisation is exact for any length of step, so that two half steps have the law of
//! one whole step, unless a model says otherwise.
//!
//! Sources named in the files: Bar-Shalom, Li and Kirubarajan, *Estimation with Applications to Tracking and
//! Navigation*, Wiley 2001 ("Bar-Shalom"); Li and Jilkov, *Survey of maneuvering target tracking, part I: dynamic
//! models*, IEEE Transactions on Aerospace and Electronic Systems 39(4), 2003 ("Li and Jilkov").

mod constant_velocity;
mod random_walk;

pub use constant_velocity::{ConstantVelocity, ConstantVelocityStep};
pub use random_walk::{RandomWalk, RandomWalkStep};

use crate::error::{Error, Result};
use crate::math::Real;
use crate::time::Time;

/// Length of a step in seconds.
fn elapsed(from: Time, to: Time) -> Result<f64> {
    if to < from { Err(Error::OutOfOrder { from, to }) } else { Ok((to - from).secs()) }
}

/// `base` + `c` `a`, with one rounding.
#[inline(always)]
fn add_scaled<R: Real>(base: R, c: f64, a: R) -> R {
    a.mul_add(a.constant(c), base)
}
