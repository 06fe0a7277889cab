//! Where one ball is: a particle filter of one motion or another.

use crate::Result;
use serde::{Deserialize, Serialize};
use zerre::Time;
use zerre::belief::{Cloud, Gaussian};
use zerre::filter::{Filter, Linear, Outcome, ParticleFilter, Prior, Settings};
use zerre::model::measurement::Position;
use zerre::model::motion::{ConstantVelocity, RandomWalk};
use zerre::model::{GaussianMeasurement, Motion};
use zerre::proposal::Guided;
use zerre::rng::Stream;

/// How a ball moves between frames. Seconds of the library's models are frames here, metres pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BallMotion {
    /// It goes on as it went, and its velocity wanders.
    #[default]
    ConstantVelocity,
    /// Its place wanders.
    RandomWalk,
}

/// A measured place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// The place, px.
    pub at: [f64; 2],
    /// Standard deviation of each of its coordinates, px: a ball that is half hidden is known worse.
    pub sd: f64,
}

/// What is known of a ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Known {
    /// Its middle, px.
    pub centre: [f64; 2],
    /// Its velocity, px per frame; zero where the motion has none.
    pub velocity: [f64; 2],
    /// Covariance of its middle, px^2.
    pub covariance: [[f64; 2]; 2],
}

/// How beliefs go on.
#[derive(Clone, Debug)]
pub struct BallModel {
    /// The motion.
    pub motion: BallMotion,
    /// Standard deviation of the process noise after a frame: of the velocity (px per frame) with constant
    /// velocity, of the place (px) with a random walk.
    pub process_sd: f64,
    /// Particles, resampling and so on.
    pub filter: Settings,
}

/// Places are measured linearly and all noise is normal: the locally optimal proposal is at hand.
type Law<const N: usize, M> = ParticleFilter<N, N, M, Position<2>, Gaussian<N>, Guided<Linear, 2>>;

/// Particles of one motion, and how they go on.
#[derive(Clone, Debug)]
pub struct Followed<const N: usize, M> {
    prior: Gaussian<N>,
    filter: Law<N, M>,
    sd: f64,
    cloud: Cloud<N>,
    mean: [f64; N],
    covariance: [[f64; N]; N],
}

/// The belief about one ball.
#[derive(Clone, Debug)]
pub enum BallBelief {
    /// Place alone.
    Walk(Box<Followed<2, RandomWalk<2>>>),
    /// Place and velocity.
    Velocity(Box<Followed<4, ConstantVelocity<2>>>),
}

fn law<const N: usize, M: Motion<N, N>>(
    prior: Gaussian<N>,
    motion: M,
    sd: f64,
    settings: Settings,
) -> zerre::Result<Law<N, M>>
where
    Position<2>: GaussianMeasurement<N, 2>,
{
    ParticleFilter::guided(prior, motion, Position::new(sd)?, Guided::new(Linear), settings)
}

impl<const N: usize, M: Motion<N, N> + Clone> Followed<N, M>
where
    Gaussian<N>: Prior<N>,
    Position<2>: GaussianMeasurement<N, 2, Value = [f64; 2]>,
{
    fn start(
        prior: Gaussian<N>,
        motion: M,
        model: &BallModel,
        (at, sd): (Time, f64),
        stream: Stream,
    ) -> zerre::Result<Box<Self>> {
        let filter = law(prior, motion, sd, model.filter.clone())?;
        let cloud = filter.start(at, stream)?;
        let (mean, covariance) = (cloud.mean(), cloud.covariance().0);
        Ok(Box::new(Followed { prior, filter, sd, cloud, mean, covariance }))
    }

    fn step(&mut self, to: Time, spot: Option<&Spot>) -> zerre::Result<bool> {
        if let Some(sd) = spot.map(|spot| spot.sd).filter(|sd| *sd != self.sd) {
            let settings = self.filter.settings().clone();
            self.filter = law(self.prior, self.filter.motion().clone(), sd, settings)?;
            self.sd = sd;
        }
        let update = self.filter.step(&mut self.cloud, to, spot.map(|spot| &spot.at))?;
        (self.mean, self.covariance) = (self.cloud.mean(), self.cloud.covariance().0);
        Ok(update.outcome != Outcome::Degenerate)
    }

    fn particles(&self) -> Vec<([f64; 2], f64)> {
        let places = self.cloud.column(0).iter().zip(self.cloud.column(1)).map(|(x, y)| [*x, *y]);
        places.zip(self.cloud.weights()).collect()
    }

    fn block(&self) -> [[f64; 2]; 2] {
        [0, 1].map(|i| [0, 1].map(|j| self.covariance[i][j]))
    }
}

impl BallModel {
    /// A belief about a ball that was measured at `spot`, with a velocity known to `velocity_sd` (px per frame).
    ///
    /// # Errors
    /// Numbers that are not finite, settings that the filter refuses.
    pub fn start(
        &self,
        at: Time,
        spot: Spot,
        (velocity, velocity_sd): ([f64; 2], f64),
        stream: Stream,
    ) -> Result<BallBelief> {
        let ([x, y], q, when) = (spot.at, self.process_sd * self.process_sd, (at, spot.sd));
        Ok(match self.motion {
            BallMotion::RandomWalk => {
                let prior = Gaussian::independent([x, y], [spot.sd; 2])?;
                BallBelief::Walk(Followed::start(prior, RandomWalk::new(q)?, self, when, stream)?)
            }
            BallMotion::ConstantVelocity => {
                let [u, v] = velocity;
                let sds = [spot.sd, spot.sd, velocity_sd, velocity_sd];
                let prior = Gaussian::independent([x, y, u, v], sds)?;
                BallBelief::Velocity(Followed::start(prior, ConstantVelocity::new(q)?, self, when, stream)?)
            }
        })
    }

    /// What will be known of a ball one frame after `now`.
    pub fn foretell(&self, belief: &BallBelief) -> Known {
        let mut known = belief.known();
        let q = self.process_sd * self.process_sd;
        match belief {
            BallBelief::Walk(_) => (0..2).for_each(|k| known.covariance[k][k] += q),
            BallBelief::Velocity(followed) => {
                // F P F' + Q of the places, F = [1 1; 0 1] on each axis.
                let p = &followed.covariance;
                for i in 0..2 {
                    known.centre[i] += known.velocity[i];
                    for j in 0..2 {
                        known.covariance[i][j] += p[i][2 + j] + p[2 + i][j] + p[2 + i][2 + j];
                    }
                    known.covariance[i][i] += q / 3.0;
                }
            }
        }
        known
    }
}

impl BallBelief {
    /// Moves it to `to` and takes a measurement in, if there is one; says whether any particle could explain it.
    ///
    /// # Errors
    /// A step back in time, a measurement that is not finite.
    pub fn step(&mut self, to: Time, spot: Option<&Spot>) -> Result<bool> {
        Ok(match self {
            BallBelief::Walk(followed) => followed.step(to, spot)?,
            BallBelief::Velocity(followed) => followed.step(to, spot)?,
        })
    }

    /// Means and covariance.
    pub fn known(&self) -> Known {
        match self {
            BallBelief::Walk(walk) => {
                Known { centre: walk.mean, velocity: [0.0; 2], covariance: walk.block() }
            }
            BallBelief::Velocity(followed) => {
                let [x, y, u, v] = followed.mean;
                Known { centre: [x, y], velocity: [u, v], covariance: followed.block() }
            }
        }
    }

    /// Places and weights of its particles.
    pub fn particles(&self) -> Vec<([f64; 2], f64)> {
        match self {
            BallBelief::Walk(followed) => followed.particles(),
            BallBelief::Velocity(followed) => followed.particles(),
        }
    }
}
