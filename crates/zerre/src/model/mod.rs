//! Models: how a target moves and how a sensor sees it. One file is one model, with its source.
//!
//! Components of a state come in this order: positions, then velocities, then accelerations, then what else there
//! is (a turn rate): `[x, y, vx, vy]`, `[x, y, z, vx, vy, vz, ax, ay, az]`, `[x, y, vx, vy, turn_rate]`. Units are
//! metres, seconds and radians. A measurement model reads the leading components that it needs and fits every
//! motion that begins with them.

pub mod jump;
mod latent;
mod likelihood;
pub mod measurement;
pub mod motion;
pub mod simulate;
pub(crate) mod state_space;
mod transition;

use crate::error::Result;
use crate::math::Real;
use crate::rng::Draws;
use crate::time::Time;
pub use jump::{Chain, JumpMarkov};
pub(crate) use latent::sampled;
pub use latent::{Label, Latent, NoiseScale};
pub use likelihood::Likelihood;
pub use state_space::StateSpace;
pub use transition::TransitionDensity;

/// How the state moves: x_k = f(x_{k-1}, w_k), with `N` state components and `W` noise components.
///
/// Written once: particle filters run it in SIMD lanes, unscented filters on plain numbers, extended Kalman
/// filters under dual numbers (transition matrix and noise covariance follow from it), simulations draw from it.
pub trait Motion<const N: usize, const W: usize>: Send + Sync {
    /// What is the same for all particles of one step: discretised noise factors, sine and cosine of a turn.
    type Step: Send + Sync;

    /// Digests the step from `from` to `to`; filters call it with `to` > `from` only, because a step over no time
    /// is the identity and draws nothing.
    ///
    /// # Errors
    /// Parameters that are not finite or out of range.
    fn over(&self, from: Time, to: Time) -> Result<Self::Step>;

    /// Moves one state (or eight). Mark it `#[inline(always)]`.
    fn apply<R: Real>(step: &Self::Step, x: [R; N], w: [R; W]) -> [R; N];

    /// Law of each of the independent components of w.
    fn noise(&self) -> Noise {
        Noise::StandardNormal
    }

    /// How many of the leading components of w [`Motion::apply`] reads; the others need not be drawn, and are zero.
    fn noise_components(&self) -> usize {
        W
    }
}

/// Law of a component of process noise.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Noise {
    /// Normal with mean 0 and variance 1.
    StandardNormal,
    /// Gamma with this shape and scale 1: mean and variance equal the shape.
    Gamma {
        /// The shape, above zero.
        shape: f64,
    },
}

impl Noise {
    /// Mean of the law.
    pub fn mean(self) -> f64 {
        match self {
            Noise::StandardNormal => 0.0,
            Noise::Gamma { shape } => shape,
        }
    }

    /// Variance of the law.
    pub fn variance(self) -> f64 {
        match self {
            Noise::StandardNormal => 1.0,
            Noise::Gamma { shape } => shape,
        }
    }
}

/// How a sensor sees a state of `N` components: log p(z | x), with all constants kept, because evidence and the
/// weights of competing models need them.
pub trait Measurement<const N: usize>: Send + Sync {
    /// What the sensor reports.
    type Value: ?Sized;
    /// A measurement digested once, to score any number of states.
    type Given<'z>: Sync
    where
        Self: 'z;

    /// Digests `z`, measured at `at`.
    ///
    /// # Errors
    /// Numbers that are not finite, a parameter out of range.
    fn given<'z>(&'z self, z: &'z Self::Value, at: Time) -> Result<Self::Given<'z>>;

    /// log p(z | x) of one state (or eight). Mark it `#[inline(always)]`.
    fn log_likelihood<R: Real>(given: &Self::Given<'_>, x: [R; N]) -> R;
}

/// A measurement z = h(x) + v with v ~ N(0, R) and `M` components: what the Kalman family needs.
///
/// Noise with heavier tails takes part as a scale mixture of normals, v ~ N(0, s R) with random s: see
/// [`GaussianMeasurement::covariance_scale`].
pub trait GaussianMeasurement<const N: usize, const M: usize>: Measurement<N> {
    /// Which components are angles: their differences are wrapped into (-pi, pi].
    const ANGLE: [bool; M] = [false; M];

    /// h(x) at `at`: a sensor may move, a benchmark may change its sensor. Mark it `#[inline(always)]`.
    fn predict<R: Real>(&self, at: Time, x: [R; N]) -> [R; M];

    /// The components of a measured value.
    fn components(&self, z: &Self::Value) -> [f64; M];

    /// R, `M` x `M`, in the units of the components squared.
    fn covariance(&self) -> [[f64; M]; M];

    /// What R must be multiplied by once the residual r = z - h(x) is known: 1 / E[1 / s | r], given the squared
    /// Mahalanobis distance r' R^-1 r (its expectation, where x is uncertain). Normal noise has 1. Mark it
    /// `#[inline(always)]`.
    #[inline(always)]
    fn covariance_scale<R: Real>(&self, mahalanobis_squared: R) -> R {
        mahalanobis_squared.constant(1.0)
    }

    /// Whether the tails are heavier than those of the normal law.
    fn is_heavy_tailed(&self) -> bool {
        // Far out such a model has long departed from 1.
        self.covariance_scale(1e6) != 1.0
    }

    /// Draws s for a simulation.
    fn draw_covariance_scale(&self, _draws: &mut Draws) -> f64 {
        1.0
    }

    /// Draws s with a residual in view, of the squared Mahalanobis distance r' R^-1 r, and gives with it the
    /// ratio p / q of its law to that which it is drawn from. Half of q should be p itself: then no ratio
    /// exceeds 2.
    fn propose_covariance_scale(&self, _mahalanobis_squared: f64, draws: &mut Draws) -> (f64, f64) {
        (self.draw_covariance_scale(draws), 1.0)
    }
}
