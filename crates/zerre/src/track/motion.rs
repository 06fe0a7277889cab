//! Motions chosen at run time.

use super::sensor::{Frame, Plane, Space, StillPlane, StillSpace};
use crate::catalog::MOTIONS;
use crate::error::{Error, Result};
use crate::model::Motion;
use crate::model::motion::{
    ConstantAcceleration, ConstantVelocity, CoordinatedTurn, ManoeuvreTurn, MarkovTurn, RandomWalk, Singer,
    WienerAcceleration, WienerTurn,
};
use serde::{Deserialize, Serialize};

/// A motion model by name, with its parameters: each model takes some of them. Noise is given by the standard
/// deviation of its average over one second, sigma; the spectral density of the white noise is sigma^2 times 1 s.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MotionSpec {
    /// A name of [`MOTIONS`].
    pub model: String,
    /// Of the velocity, m/s: `random-walk`.
    pub speed_sd_mps: Option<f64>,
    /// Of the acceleration, m/s^2: all models but `random-walk` and `constant-acceleration`. For `singer` the
    /// stationary deviation, for `wiener-acceleration` the change per step.
    pub acceleration_sd_mps2: Option<f64>,
    /// Of the jerk, m/s^3: `constant-acceleration`.
    pub jerk_sd_mps3: Option<f64>,
    /// A known turn rate, counter-clockwise, rad/s: `coordinated-turn`.
    pub turn_rate_rad_s: Option<f64>,
    /// A known acceleration across the velocity, to the left, m/s^2: `manoeuvre-turn`.
    pub lateral_acceleration_mps2: Option<f64>,
    /// Stationary standard deviation of the turn rate, rad/s: `markov-turn`.
    pub turn_rate_sd_rad_s: Option<f64>,
    /// Of the change of the turn rate, rad/s^2: `wiener-turn`.
    pub turn_acceleration_sd_rad_s2: Option<f64>,
    /// Time that an acceleration or a turn rate lasts, s: `singer`, `markov-turn`.
    pub tau_s: Option<f64>,
}

impl MotionSpec {
    /// Name and value of the parameter that sets how much the motion wanders; it can be learnt from a recording.
    pub fn wander(&self) -> (&'static str, Option<f64>) {
        match self.model.as_str() {
            "random-walk" => ("speed_sd_mps", self.speed_sd_mps),
            "constant-acceleration" => ("jerk_sd_mps3", self.jerk_sd_mps3),
            _ => ("acceleration_sd_mps2", self.acceleration_sd_mps2),
        }
    }

    /// Sets the parameter of [`MotionSpec::wander`].
    pub fn set_wander(&mut self, value: f64) {
        let place = match self.model.as_str() {
            "random-walk" => &mut self.speed_sd_mps,
            "constant-acceleration" => &mut self.jerk_sd_mps3,
            _ => &mut self.acceleration_sd_mps2,
        };
        *place = Some(value);
    }

    fn needed(&self, key: &str, value: Option<f64>) -> Result<f64> {
        value.ok_or_else(|| Error::Unsupported(format!("the motion `{}` needs {key}", self.model)))
    }
}

/// Something to do with the motion of a name.
pub(super) trait WithMotion {
    type Out;
    fn with<A, F, const N: usize, const W: usize, const D: usize>(self, motion: A) -> Result<Self::Out>
    where
        A: Motion<N, W> + Clone + 'static,
        F: Frame<N, D>;
}

/// Does `work` with the motion that `spec` names, in 2 or 3 dimensions: one line here for each new motion.
pub(super) fn with_motion<T: WithMotion>(spec: &MotionSpec, dimensions: usize, work: T) -> Result<T::Out> {
    let density = |key, value| spec.needed(key, value).map(|sd| sd * sd);
    let wander = || {
        let (key, value) = spec.wander();
        spec.needed(key, value)
    };
    let q = || wander().map(|sd| sd * sd);
    let tau = || spec.needed("tau_s", spec.tau_s);
    let rate_sd = || spec.needed("turn_rate_sd_rad_s", spec.turn_rate_sd_rad_s);
    let turn_q = || density("turn_acceleration_sd_rad_s2", spec.turn_acceleration_sd_rad_s2);
    let turn_rate = || spec.needed("turn_rate_rad_s", spec.turn_rate_rad_s);
    let lateral = || spec.needed("lateral_acceleration_mps2", spec.lateral_acceleration_mps2);
    match (spec.model.as_str(), dimensions) {
        ("random-walk", 2) => work.with::<_, StillPlane, 2, 2, 2>(RandomWalk::<2>::new(q()?)?),
        ("random-walk", 3) => work.with::<_, StillSpace, 3, 3, 3>(RandomWalk::<3>::new(q()?)?),
        ("constant-velocity", 2) => work.with::<_, Plane, 4, 4, 2>(ConstantVelocity::<2>::new(q()?)?),
        ("constant-velocity", 3) => work.with::<_, Space, 6, 6, 3>(ConstantVelocity::<3>::new(q()?)?),
        ("constant-acceleration", 2) => work.with::<_, Plane, 6, 6, 2>(ConstantAcceleration::<2>::new(q()?)?),
        ("constant-acceleration", 3) => work.with::<_, Space, 9, 9, 3>(ConstantAcceleration::<3>::new(q()?)?),
        ("wiener-acceleration", 2) => {
            work.with::<_, Plane, 6, 2, 2>(WienerAcceleration::<2>::new(wander()?)?)
        }
        ("wiener-acceleration", 3) => {
            work.with::<_, Space, 9, 3, 3>(WienerAcceleration::<3>::new(wander()?)?)
        }
        ("singer", 2) => work.with::<_, Plane, 6, 6, 2>(Singer::<2>::new(wander()?, tau()?)?),
        ("singer", 3) => work.with::<_, Space, 9, 9, 3>(Singer::<3>::new(wander()?, tau()?)?),
        ("coordinated-turn", 2) => work.with::<_, Plane, 4, 4, 2>(CoordinatedTurn::new(turn_rate()?, q()?)?),
        ("manoeuvre-turn", 2) => work.with::<_, Plane, 4, 4, 2>(ManoeuvreTurn::new(lateral()?, q()?)?),
        ("wiener-turn", 2) => work.with::<_, Plane, 5, 5, 2>(WienerTurn::new(q()?, turn_q()?)?),
        ("markov-turn", 2) => work.with::<_, Plane, 5, 5, 2>(MarkovTurn::new(q()?, rate_sd()?, tau()?)?),
        (name, _) => Err(no_motion(name, dimensions)),
    }
}

fn no_motion(name: &str, dimensions: usize) -> Error {
    Error::Unsupported(match MOTIONS.iter().any(|entry| entry.name == name) {
        true if name.contains("growth") => {
            format!("the motion `{name}` is a benchmark on one axis: no sensor sees it")
        }
        true => format!("the motion `{name}` has no form in {dimensions} dimensions"),
        false => format!("there is no motion `{name}`"),
    })
}
