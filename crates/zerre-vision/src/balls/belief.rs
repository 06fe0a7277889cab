//! Where one ball is: a particle filter of one motion or another.

use crate::Result;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use zerre::belief::{Cloud, Gaussian};
use zerre::filter::{Filter, Outcome, ParticleFilter, Prior, Settings};
use zerre::math::{Real, ln};
use zerre::model::motion::{ConstantVelocity, RandomWalk};
use zerre::model::{Measurement, Motion};
use zerre::rng::Stream;
use zerre::{Error, Time};

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
    /// Standard deviation of each of its coordinates, px.
    pub sd: f64,
}

/// A sensor whose measurements say themselves how exact they are: a ball that is half hidden is known worse.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Spots;

/// A [`Spot`], digested.
#[derive(Clone, Copy, Debug)]
pub struct SpotGiven {
    at: [f64; 2],
    per_sd: f64,
    constant: f64,
}

impl<const N: usize> Measurement<N> for Spots {
    type Value = Spot;
    type Given<'z> = SpotGiven;

    fn given(&self, spot: &Spot, _: Time) -> zerre::Result<SpotGiven> {
        for value in spot.at {
            Error::finite("measured place of a ball", value)?;
        }
        let sd = Error::positive("standard deviation of a ball's place", spot.sd)?;
        Ok(SpotGiven { at: spot.at, per_sd: 1.0 / sd, constant: -2.0 * ln(sd) - ln(TAU) })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &SpotGiven, x: [R; N]) -> R {
        const { assert!(N >= 2, "the state has no place in the plane") };
        let (dx, dy) = ((x[0] - given.at[0]) * given.per_sd, (x[1] - given.at[1]) * given.per_sd);
        dx.mul_add(dx, dy * dy) * -0.5 + given.constant
    }
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
    /// Standard deviation of the process noise after a frame: of the velocity (px per frame) with constant velocity,
    /// of the place (px) with a random walk.
    pub process_sd: f64,
    /// Particles, resampling and so on.
    pub filter: Settings,
}

type Walk = ParticleFilter<2, 2, RandomWalk<2>, Spots>;
type Velocity = ParticleFilter<4, 4, ConstantVelocity<2>, Spots>;

/// The belief about one ball.
#[derive(Clone, Debug)]
pub enum BallBelief {
    /// Place alone.
    Walk(Box<Walk>, Box<Cloud<2>>),
    /// Place and velocity.
    Velocity(Box<Velocity>, Box<Cloud<4>>),
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
        let [x, y] = spot.at;
        Ok(match self.motion {
            BallMotion::RandomWalk => {
                let prior = Gaussian::independent([x, y], [spot.sd; 2])?;
                let motion = RandomWalk::new(self.process_sd * self.process_sd)?;
                let (filter, cloud) = begin(prior, motion, &self.filter, at, stream)?;
                BallBelief::Walk(filter, cloud)
            }
            BallMotion::ConstantVelocity => {
                let [u, v] = velocity;
                let sds = [spot.sd, spot.sd, velocity_sd, velocity_sd];
                let prior = Gaussian::independent([x, y, u, v], sds)?;
                let motion = ConstantVelocity::new(self.process_sd * self.process_sd)?;
                let (filter, cloud) = begin(prior, motion, &self.filter, at, stream)?;
                BallBelief::Velocity(filter, cloud)
            }
        })
    }

    /// What will be known of a ball one frame after `now`.
    pub fn foretell(&self, belief: &BallBelief) -> Known {
        let mut known = belief.known();
        let q = self.process_sd * self.process_sd;
        match belief {
            BallBelief::Walk(..) => (0..2).for_each(|k| known.covariance[k][k] += q),
            BallBelief::Velocity(_, cloud) => {
                // F P F' + Q of the places, F = [1 1; 0 1] on each axis.
                let p = cloud.covariance().0;
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

type Begun<const N: usize, M> = (Box<ParticleFilter<N, N, M, Spots>>, Box<Cloud<N>>);

fn begin<const N: usize, M: Motion<N, N>>(
    prior: Gaussian<N>,
    motion: M,
    settings: &Settings,
    at: Time,
    stream: Stream,
) -> Result<Begun<N, M>>
where
    Gaussian<N>: Prior<N>,
    Spots: Measurement<N, Value = Spot>,
{
    let filter = ParticleFilter::new(prior, motion, Spots, settings.clone())?;
    let cloud = filter.start(at, stream)?;
    Ok((Box::new(filter), Box::new(cloud)))
}

impl BallBelief {
    /// Moves it to `to` and takes a measurement in, if there is one; says whether any particle could explain it.
    ///
    /// # Errors
    /// A step back in time, a measurement that is not finite.
    pub fn step(&mut self, to: Time, spot: Option<&Spot>) -> Result<bool> {
        let update = match self {
            BallBelief::Walk(filter, cloud) => filter.step(cloud, to, spot)?,
            BallBelief::Velocity(filter, cloud) => filter.step(cloud, to, spot)?,
        };
        Ok(update.outcome != Outcome::Degenerate)
    }

    /// Means and covariance.
    pub fn known(&self) -> Known {
        let block = |p: &dyn Fn(usize, usize) -> f64| [[p(0, 0), p(0, 1)], [p(1, 0), p(1, 1)]];
        match self {
            BallBelief::Walk(_, cloud) => {
                let p = cloud.covariance().0;
                Known { centre: cloud.mean(), velocity: [0.0; 2], covariance: block(&|i, j| p[i][j]) }
            }
            BallBelief::Velocity(_, cloud) => {
                let ([x, y, u, v], p) = (cloud.mean(), cloud.covariance().0);
                Known { centre: [x, y], velocity: [u, v], covariance: block(&|i, j| p[i][j]) }
            }
        }
    }

    /// Places and weights of its particles.
    pub fn particles(&self) -> Vec<([f64; 2], f64)> {
        let gather = |x: &[f64], y: &[f64], weights: &mut dyn Iterator<Item = f64>| {
            x.iter().zip(y).zip(weights).map(|((x, y), w)| ([*x, *y], w)).collect()
        };
        match self {
            BallBelief::Walk(_, cloud) => gather(cloud.column(0), cloud.column(1), &mut cloud.weights()),
            BallBelief::Velocity(_, cloud) => gather(cloud.column(0), cloud.column(1), &mut cloud.weights()),
        }
    }
}
