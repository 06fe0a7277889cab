//! What is hidden beside the state, and given which the state is linear and normal, or nearly so.

use super::measurement::Conditioned;
use super::{GaussianMeasurement, JumpMarkov, Measurement, Motion};
use crate::belief::Hypothesis;
use crate::error::{Error, Result};
use crate::filter::innovation;
use crate::math::{Cholesky, Matrix};
use crate::model::jump::{Transition, count};
use crate::rng::Draws;
use crate::time::Time;
use serde::{Serialize, de::DeserializeOwned};
use std::borrow::Borrow;
use std::fmt::Debug;

/// A value of what is hidden.
pub trait Label: Copy + Debug + PartialEq + Serialize + DeserializeOwned + Send + Sync + 'static {
    /// Refuses what is no label of a belief over so many `modes` (0: labels are no numbers of modes).
    ///
    /// # Errors
    /// Such a label.
    fn check(&self, _modes: usize) -> Result<()> {
        Ok(())
    }
}

/// The number of a mode.
impl Label for usize {
    fn check(&self, modes: usize) -> Result<()> {
        if *self < count(modes)? {
            return Ok(());
        }
        Err(Error::Shape { what: "number of a mode (from 0, below)", found: *self, expected: modes })
    }
}

impl Label for f64 {
    fn check(&self, _: usize) -> Result<()> {
        Error::finite("label of a hypothesis", *self).map(drop)
    }
}

/// A label u_k with a law of its own, given which the motion and the measurement of x are linear and normal,
/// or as near to it as a [`Transform`](crate::filter::Transform) asks: the first kinds of mixed linear and
/// nonlinear models of Schön, Gustafsson and Nordlund (IEEE Transactions on Signal Processing 53(7), 2005), u
/// being the nonlinear part. [`RaoBlackwell`](crate::filter::RaoBlackwell) goes through labels by hypotheses
/// and through x by a Kalman filter for each.
///
/// Labels are enumerated, as [`JumpMarkov`] does with its modes, or sampled, as [`NoiseScale`] does with the
/// scale of heavy-tailed noise: from every label [`Latent::branch`] goes on to several, and the filter weighs
/// each by the evidence of the measurement. What u does next must not depend on x: x would be seen through it
/// once more, as by a second sensor (the third kind of the source), which is not done here.
///
/// A random walk, measured with noise whose log-variance is a random walk itself:
///
/// ```
/// use std::borrow::Borrow;
/// use zerre::belief::{Gaussian, Hypothesis};
/// use zerre::filter::{Filter, Linear, RaoBlackwell};
/// use zerre::model::measurement::{Conditioned, Position};
/// use zerre::model::{Latent, motion::RandomWalk};
/// use zerre::rng::{Draws, Stream};
/// use zerre::{Result, Time};
///
/// struct DriftingNoise(RandomWalk<1>);
///
/// impl Latent<1, 1, 1, Position<1>> for DriftingNoise {
///     type Label = f64; // ln s
///     type Motion = RandomWalk<1>;
///     type Sensor = Conditioned<Position<1>, 1>;
///     type Over = f64; // sqrt(dt)
///
///     fn branches(&self) -> usize {
///         4
///     }
///     fn first(&self, _: &Position<1>, count: usize, draws: &mut Draws, out: &mut dyn FnMut(f64, f64)) {
///         (0..count).for_each(|_| out(draws.normal(), 1.0 / count as f64));
///     }
///     fn over(&self, _: &Position<1>, from: Time, to: Time, _: Option<&[f64; 1]>) -> Result<f64> {
///         Ok((to - from).secs().sqrt())
///     }
///     fn branch(
///         &self,
///         dt: &f64,
///         from: &Hypothesis<1, f64>,
///         draws: &mut Draws,
///         out: &mut dyn FnMut(f64, f64),
///     ) {
///         (0..4).for_each(|_| out(from.label + 0.3 * dt * draws.normal(), 0.25));
///     }
///     fn motion(&self, _: &f64) -> Result<impl Borrow<RandomWalk<1>>> {
///         Ok(self.0)
///     }
///     fn sensor(&self, base: &Position<1>, label: &f64) -> Result<impl Borrow<Self::Sensor>> {
///         Conditioned::new(*base).with_scale(label.exp())
///     }
/// }
///
/// let prior = Gaussian::independent([0.0], [2.0])?;
/// let model = DriftingNoise(RandomWalk::new(1.0)?);
/// let filter = RaoBlackwell::new(Linear, model, Position::new(1.0)?, prior, 100)?;
/// let mut belief = filter.start(Time::ZERO, Stream::new(1))?;
/// for (t, z) in [(1.0, 0.3), (2.0, 9.0), (3.0, -7.0), (4.0, 8.0)] {
///     filter.step(&mut belief, Time::from_secs(t), Some(&[z]))?;
/// }
/// assert!(belief.expectation(|&log_scale| log_scale) > 1.0); // The noise has grown.
/// # Ok::<(), zerre::Error>(())
/// ```
pub trait Latent<const N: usize, const W: usize, const M: usize, H>: Send + Sync
where
    H: GaussianMeasurement<N, M>,
{
    /// What is hidden.
    type Label: Label;
    /// How x moves, given a label.
    type Motion: Motion<N, W>;
    /// How x is seen, given a label; often [`Conditioned`].
    type Sensor: GaussianMeasurement<N, M> + Measurement<N, Value = H::Value>;
    /// What is the same for all hypotheses of one step.
    type Over;

    /// Refuses a sensor that the label does not belong to.
    ///
    /// # Errors
    /// Such a sensor.
    fn accept(&self, _sensor: &H) -> Result<()> {
        Ok(())
    }

    /// Number of modes that labels are numbers of; 0 where they are no numbers but drawn.
    fn modes(&self) -> usize {
        0
    }

    /// Most labels that one step leads to from one label, at most
    /// [`MAX_MODES`](crate::model::jump::MAX_MODES). Of labels that are drawn there are two at least: where
    /// there is but one, all are kept and none is ever chosen.
    fn branches(&self) -> usize;

    /// Labels to start from, with probabilities that sum to 1: all there are, or `count` draws, each from
    /// a state of its own so that hypotheses differ.
    fn first(&self, sensor: &H, count: usize, draws: &mut Draws, out: &mut dyn FnMut(Self::Label, f64));

    /// Digests a step to a measurement `z`, if there is one.
    ///
    /// # Errors
    /// Parameters that are not finite or out of range.
    fn over(&self, sensor: &H, from: Time, to: Time, z: Option<&H::Value>) -> Result<Self::Over>;

    /// Labels that may follow that of a hypothesis, with weights whose expectation is the law of the label:
    /// its probabilities where all are named (always the same labels in the same order, so that hypotheses of
    /// equal laws can go on as one), 1 over their number where they are drawn from it, p / q over their
    /// number where drawn from another law q that looks at the measurement. Over no time a label that lasts
    /// is handed back as it is.
    fn branch(
        &self,
        over: &Self::Over,
        from: &Hypothesis<N, Self::Label>,
        draws: &mut Draws,
        out: &mut dyn FnMut(Self::Label, f64),
    );

    /// A number below [`MAX_MODES`](crate::model::jump::MAX_MODES) of the motion of a label, if labels share
    /// it: it is then digested once a step.
    fn shared_motion(&self, _label: &Self::Label) -> Option<usize> {
        None
    }

    /// The motion given a label.
    ///
    /// # Errors
    /// A label that makes no motion.
    fn motion(&self, label: &Self::Label) -> Result<impl Borrow<Self::Motion>>;

    /// The sensor given a label, `base` being that of the filter.
    ///
    /// # Errors
    /// A label that makes no sensor.
    fn sensor(&self, base: &H, label: &Self::Label) -> Result<impl Borrow<Self::Sensor>>;
}

/// Modes, enumerated.
impl<A, H, const N: usize, const W: usize, const M: usize> Latent<N, W, M, H> for JumpMarkov<A>
where
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    type Label = usize;
    type Motion = A;
    type Sensor = H;
    type Over = Transition;

    fn modes(&self) -> usize {
        self.modes().len()
    }

    fn branches(&self) -> usize {
        self.modes().len()
    }

    fn first(&self, _: &H, _: usize, _: &mut Draws, out: &mut dyn FnMut(usize, f64)) {
        self.chain().initial().iter().enumerate().for_each(|(mode, &p)| out(mode, p));
    }

    fn over(&self, _: &H, from: Time, to: Time, _: Option<&H::Value>) -> Result<Transition> {
        Ok(self.chain().over(from, to))
    }

    fn branch(
        &self,
        over: &Transition,
        from: &Hypothesis<N>,
        _: &mut Draws,
        out: &mut dyn FnMut(usize, f64),
    ) {
        (0..over.len()).for_each(|mode| out(mode, over.probability(from.label, mode)));
    }

    fn shared_motion(&self, mode: &usize) -> Option<usize> {
        Some(*mode)
    }

    fn motion(&self, mode: &usize) -> Result<impl Borrow<A>> {
        Ok(&self.modes()[*mode])
    }

    fn sensor(&self, base: &H, _: &usize) -> Result<impl Borrow<H>> {
        Ok(base)
    }
}

/// The scale s of noise v ~ N(0, s R) with heavy tails, as of
/// [`HeavyTailed`](super::measurement::HeavyTailed): independent from measurement to measurement, and drawn
/// anew for each. Half of the draws come from its law, half from its posterior where the mean of the state is
/// the truth ([`GaussianMeasurement::propose_covariance_scale`]), so that outliers, which the law alone
/// rarely draws, are met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseScale<A> {
    motion: A,
    branches: usize,
}

impl<A> NoiseScale<A> {
    /// A target of this motion, whose measurements take `branches` draws of s for each hypothesis: the more,
    /// the better rare scales are met.
    ///
    /// # Errors
    /// Fewer than two branches, more than [`MAX_MODES`](crate::model::jump::MAX_MODES).
    pub fn new(motion: A, branches: usize) -> Result<Self> {
        Ok(NoiseScale { motion, branches: sampled(branches)? })
    }
}

/// A measurement of heavy-tailed noise, digested.
pub struct ScaleOver<H, S, const M: usize> {
    sensor: H,
    step: Option<S>,
    at: Time,
    z: [f64; M],
    noise: Cholesky<M>,
}

/// A number of draws from each label.
pub(crate) fn sampled(branches: usize) -> Result<usize> {
    if (2..=super::jump::MAX_MODES).contains(&branches) {
        return Ok(branches);
    }
    let needs = "it must lie between 2 and 16";
    Err(Error::OutOfRange { what: "number of draws of a label", value: branches as f64, needs })
}

impl<A, H, const N: usize, const W: usize, const M: usize> Latent<N, W, M, H> for NoiseScale<A>
where
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M> + Clone,
{
    type Label = f64;
    type Motion = A;
    type Sensor = Conditioned<H, M>;
    type Over = Option<ScaleOver<H, A::Step, M>>;

    fn accept(&self, sensor: &H) -> Result<()> {
        if sensor.is_heavy_tailed() {
            return Ok(());
        }
        Err(Error::Unsupported(
            "the noise of the measurement is normal: it has no scale that is hidden".into(),
        ))
    }

    fn branches(&self) -> usize {
        self.branches
    }

    fn first(&self, sensor: &H, count: usize, draws: &mut Draws, out: &mut dyn FnMut(f64, f64)) {
        (0..count).for_each(|_| out(sensor.draw_covariance_scale(draws), 1.0 / count as f64));
    }

    fn over(&self, sensor: &H, from: Time, at: Time, z: Option<&H::Value>) -> Result<Self::Over> {
        let digest = |z| {
            let noise = Cholesky::of("covariance of the measurement", &Matrix(sensor.covariance()))?;
            let step = if at > from { Some(self.motion.over(from, at)?) } else { None };
            Ok(ScaleOver { sensor: sensor.clone(), step, at, z: sensor.components(z), noise })
        };
        z.map(digest).transpose()
    }

    fn branch(
        &self,
        over: &Self::Over,
        from: &Hypothesis<N, f64>,
        draws: &mut Draws,
        out: &mut dyn FnMut(f64, f64),
    ) {
        let Some(ScaleOver { sensor, step, at, z, noise }) = over else { return out(from.label, 1.0) };
        let mean = *from.law.mean();
        let mean = step.as_ref().map_or(mean, |step| A::apply(step, mean, [self.motion.noise().mean(); W]));
        let residual = innovation::<H, N, M>(z, &sensor.predict(*at, mean));
        let distance = noise.mahalanobis_squared(&residual);
        for _ in 0..self.branches {
            let (scale, ratio) = sensor.propose_covariance_scale(distance, draws);
            out(scale, ratio / self.branches as f64);
        }
    }

    fn shared_motion(&self, _: &f64) -> Option<usize> {
        Some(0)
    }

    fn motion(&self, _: &f64) -> Result<impl Borrow<A>> {
        Ok(&self.motion)
    }

    fn sensor(&self, base: &H, scale: &f64) -> Result<impl Borrow<Conditioned<H, M>>> {
        Conditioned::new(base.clone()).with_scale(*scale)
    }
}
