//! Motions chosen at run time.

use super::modes::{ModeSpec, Moves, has_turns};
use super::sensor::{Boxed, Frame, Plane, Space, StillPlane, StillSpace};
use crate::catalog::MOTIONS;
use crate::error::{Error, Result};
use crate::model::Motion;
use crate::model::motion::{
    ConstantAcceleration, ConstantVelocity, ConstantVelocityBox, CoordinatedTurn, ManoeuvreTurn, MarkovTurn,
    RandomWalk, Singer, WienerAcceleration, WienerTurn,
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
    /// Of the rates at which length and width change, m/s: `constant-velocity-box`.
    #[serde(default)]
    pub size_sd_mps: Option<f64>,
    /// Of the rate at which the orientation changes, rad/s: `constant-velocity-box`.
    #[serde(default)]
    pub orientation_sd_rad_s: Option<f64>,
    /// How the target manoeuvres, for filters that have modes.
    #[serde(default)]
    pub modes: ModeSpec,
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

    fn wandering(&self) -> Result<f64> {
        let (key, value) = self.wander();
        self.needed(key, value)
    }

    /// Spectral density of the noise that [`MotionSpec::wander`] sets.
    pub(super) fn density(&self) -> Result<f64> {
        self.wandering().map(|sd| sd * sd)
    }

    fn tau(&self) -> Result<f64> {
        self.needed("tau_s", self.tau_s)
    }
}

/// Whether the motion of this name moves a box, of which [`Reading::Size`](super::Reading::Size) tells.
pub fn has_size(motion: &str) -> bool {
    motion == "constant-velocity-box"
}

/// Something to do with the motion of a name.
pub(super) trait WithMotion {
    type Out;
    fn with<A, F, const N: usize, const W: usize, const D: usize>(self, moves: Moves<A>) -> Result<Self::Out>
    where
        A: Motion<N, W> + Clone + 'static,
        F: Frame<N, D>;
}

/// Does `work` with the motion that `spec` names, in 2 or 3 dimensions, and with its modes if `jumping`: one line here
/// for each new motion.
pub(super) fn with_motion<T: WithMotion>(
    spec: &MotionSpec,
    dimensions: usize,
    jumping: bool,
    work: T,
) -> Result<T::Out> {
    macro_rules! with {
        ($frame:ty, $n:literal, $w:literal, $d:literal, $make:expr) => {
            work.with::<_, $frame, $n, $w, $d>(Moves::new(spec, jumping, $make)?)
        };
    }
    type Spec = MotionSpec;
    let rate = |s: &Spec| s.needed("turn_rate_rad_s", s.turn_rate_rad_s);
    let rate_sd = |s: &Spec| s.needed("turn_rate_sd_rad_s", s.turn_rate_sd_rad_s);
    let lateral = |s: &Spec| s.needed("lateral_acceleration_mps2", s.lateral_acceleration_mps2);
    let turn_q =
        |s: &Spec| s.needed("turn_acceleration_sd_rad_s2", s.turn_acceleration_sd_rad_s2).map(|sd| sd * sd);
    let size = |s: &Spec| s.needed("size_sd_mps", s.size_sd_mps);
    let orientation = |s: &Spec| s.needed("orientation_sd_rad_s", s.orientation_sd_rad_s);
    match (spec.model.as_str(), dimensions) {
        (name, _) if jumping && has_turns(name, dimensions) => {
            work.with::<_, Plane, 4, 4, 2>(Moves::turning(spec)?)
        }
        ("random-walk", 2) => with!(StillPlane, 2, 2, 2, |s: &Spec| RandomWalk::<2>::new(s.density()?)),
        ("random-walk", 3) => with!(StillSpace, 3, 3, 3, |s: &Spec| RandomWalk::<3>::new(s.density()?)),
        ("constant-velocity", 2) => {
            with!(Plane, 4, 4, 2, |s: &Spec| ConstantVelocity::<2>::new(s.density()?))
        }
        ("constant-velocity", 3) => {
            with!(Space, 6, 6, 3, |s: &Spec| ConstantVelocity::<3>::new(s.density()?))
        }
        ("constant-velocity-box", 2) => with!(Boxed, 7, 7, 2, |s: &Spec| {
            let (size, turn) = (size(s)?, orientation(s)?);
            ConstantVelocityBox::new(s.density()?, size * size, turn * turn)
        }),
        ("constant-acceleration", 2) => {
            with!(Plane, 6, 6, 2, |s: &Spec| ConstantAcceleration::<2>::new(s.density()?))
        }
        ("constant-acceleration", 3) => {
            with!(Space, 9, 9, 3, |s: &Spec| ConstantAcceleration::<3>::new(s.density()?))
        }
        ("wiener-acceleration", 2) => {
            with!(Plane, 6, 2, 2, |s: &Spec| WienerAcceleration::<2>::new(s.wandering()?))
        }
        ("wiener-acceleration", 3) => {
            with!(Space, 9, 3, 3, |s: &Spec| WienerAcceleration::<3>::new(s.wandering()?))
        }
        ("singer", 2) => with!(Plane, 6, 6, 2, |s: &Spec| Singer::<2>::new(s.wandering()?, s.tau()?)),
        ("singer", 3) => with!(Space, 9, 9, 3, |s: &Spec| Singer::<3>::new(s.wandering()?, s.tau()?)),
        ("coordinated-turn", 2) => {
            with!(Plane, 4, 4, 2, |s: &Spec| CoordinatedTurn::new(rate(s)?, s.density()?))
        }
        ("manoeuvre-turn", 2) => {
            with!(Plane, 4, 4, 2, |s: &Spec| ManoeuvreTurn::new(lateral(s)?, s.density()?))
        }
        ("wiener-turn", 2) => with!(Plane, 5, 5, 2, |s: &Spec| WienerTurn::new(s.density()?, turn_q(s)?)),
        ("markov-turn", 2) => {
            with!(Plane, 5, 5, 2, |s: &Spec| MarkovTurn::new(s.density()?, rate_sd(s)?, s.tau()?))
        }
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
