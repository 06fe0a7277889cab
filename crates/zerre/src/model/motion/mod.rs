//! Motion models. Every discretisation is exact for any length of step, so that two half steps have the law of
//! one whole step, unless a model says otherwise.
//!
//! Sources named in the files: Bar-Shalom, Li and Kirubarajan, *Estimation with Applications to Tracking and
//! Navigation*, Wiley 2001 ("Bar-Shalom"); Li and Jilkov, *Survey of maneuvering target tracking, part I: dynamic
//! models*, IEEE Transactions on Aerospace and Electronic Systems 39(4), 2003 ("Li and Jilkov").

mod autoregressive;
mod constant_acceleration;
mod constant_velocity;
mod constant_velocity_box;
mod coordinated_turn;
mod discrete_velocity;
mod flight;
mod growth;
mod manoeuvre;
mod manoeuvre_turn;
mod markov_turn;
mod random_walk;
mod scripted;
mod singer;
mod third_order;
mod turn;
mod upf_growth;
mod wiener_acceleration;
mod wiener_turn;

pub use autoregressive::Autoregressive;
pub use constant_acceleration::ConstantAcceleration;
pub use constant_velocity::{ConstantVelocity, ConstantVelocityStep};
pub use constant_velocity_box::{ConstantVelocityBox, ConstantVelocityBoxStep};
pub use coordinated_turn::{CoordinatedTurn, CoordinatedTurnStep};
pub use discrete_velocity::{DiscreteVelocity, DiscreteVelocityStep};
pub use flight::{Flight, FlightStep};
pub use growth::{Growth, GrowthStep};
pub use manoeuvre::{Manoeuvre, ManoeuvreStep};
pub use manoeuvre_turn::{ManoeuvreTurn, ManoeuvreTurnStep};
pub use markov_turn::{MarkovTurn, MarkovTurnStep};
pub use random_walk::{RandomWalk, RandomWalkStep};
pub use scripted::Scripted;
pub use singer::Singer;
pub use third_order::ThirdOrderStep;
pub use upf_growth::{UpfGrowth, UpfGrowthStep};
pub use wiener_acceleration::{WienerAcceleration, WienerAccelerationStep};
pub use wiener_turn::{WienerTurn, WienerTurnStep};

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

/// A time constant: finite and not below the resolution of [`Time`], so that no quotient overflows.
fn time_constant(what: &'static str, value: f64) -> Result<f64> {
    if Error::finite(what, value)? >= 1e-9 {
        Ok(value)
    } else {
        Err(Error::OutOfRange { what, value, needs: "it must be a nanosecond or longer" })
    }
}

/// [`Motion`](super::Motion) in one, two and three dimensions for a model with `step(dt) -> ThirdOrderStep`.
macro_rules! third_order_motion {
    ($model:ident) => {
        super::third_order_motion!($model: 1, 2, 3);
    };
    ($model:ident: $($d:literal),+) => {$(
        impl Motion<{ 3 * $d }, { 3 * $d }> for $model<$d> {
            type Step = ThirdOrderStep;

            fn over(&self, from: Time, to: Time) -> Result<ThirdOrderStep> {
                Ok(self.step(elapsed(from, to)?))
            }

            #[inline(always)]
            fn apply<R: Real>(step: &ThirdOrderStep, x: [R; 3 * $d], w: [R; 3 * $d]) -> [R; 3 * $d] {
                step.apply::<R, $d, { 3 * $d }>(x, w)
            }
        }
    )+};
}
use third_order_motion;
