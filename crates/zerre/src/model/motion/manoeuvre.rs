//! The modes of a manoeuvring aircraft in the plane, over one state.

use super::{Flight, FlightStep, WienerAcceleration, WienerAccelerationStep};
use crate::error::Result;
use crate::math::Real;
use crate::model::Motion;
use crate::time::Time;

/// A mode of a manoeuvring target with the state `[x, y, vx, vy, ax, ay]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Manoeuvre {
    /// Straight flight or a turn at a known rate; the acceleration is drawn afresh.
    Flight(Flight),
    /// An acceleration that lasts and changes a little in each step.
    Wiener(WienerAcceleration<2>),
}

/// One step of a [`Manoeuvre`].
#[derive(Clone, Copy, Debug)]
pub enum ManoeuvreStep {
    /// Of [`Manoeuvre::Flight`].
    Flight(FlightStep),
    /// Of [`Manoeuvre::Wiener`].
    Wiener(WienerAccelerationStep),
}

impl Motion<6, 4> for Manoeuvre {
    type Step = ManoeuvreStep;

    fn over(&self, from: Time, to: Time) -> Result<ManoeuvreStep> {
        Ok(match self {
            Manoeuvre::Flight(mode) => ManoeuvreStep::Flight(mode.over(from, to)?),
            Manoeuvre::Wiener(mode) => ManoeuvreStep::Wiener(mode.over(from, to)?),
        })
    }

    #[inline(always)]
    fn apply<R: Real>(step: &ManoeuvreStep, x: [R; 6], w: [R; 4]) -> [R; 6] {
        match step {
            ManoeuvreStep::Flight(step) => Flight::apply(step, x, w),
            ManoeuvreStep::Wiener(step) => WienerAcceleration::<2>::apply(step, x, [w[0], w[1]]),
        }
    }

    fn noise_components(&self) -> usize {
        match self {
            Manoeuvre::Flight(_) => 4,
            Manoeuvre::Wiener(_) => 2,
        }
    }
}
