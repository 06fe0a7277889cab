//! The Kalman filter: exact, or refused.

use super::extended::{MotionTangent, measurement_tangent, observed};
use super::gaussian::{GaussianFilter, Joint, Observed, Transform};
use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::math::Matrix;
use crate::model::{GaussianMeasurement, Motion, Noise};
use crate::time::Time;
use std::array::from_fn;

/// A Gaussian goes through a linear function and stays one. Each time the Jacobian is compared at two points; where
/// it differs the function is refused.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Linear;

/// The Kalman filter (Kalman 1960): the exact posterior and evidence of linear models with normal noise. Models of
/// another kind are refused, because its results would not be what the name promises: use
/// [`Extended`](super::Extended) or [`Unscented`](super::Unscented).
///
/// The check costs a second Jacobian per step. What it sees is a Jacobian that differs by more than a relative 1e-12
/// between the mean and a point about a standard deviation and a unit off in each component.
pub type Kalman<A, H, const N: usize, const W: usize, const M: usize> = GaussianFilter<Linear, A, H, N, W, M>;

impl<A, H, const N: usize, const W: usize, const M: usize> Kalman<A, H, N, W, M>
where
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    /// The filter of these models, started from `prior`.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for a measurement that is not linear (angles wrap, so they are not), one with
    /// heavier tails than the normal law, and for process noise that is not normal. A motion that is not linear is
    /// refused by the first step, and so is a measurement that ceases to be.
    pub fn new(motion: A, measurement: H, prior: Gaussian<N>) -> Result<Self> {
        Linear.accept(&motion, &measurement, &prior)?;
        Ok(GaussianFilter::of(Linear, motion, measurement, prior))
    }
}

fn refuse<T>(what: &str) -> Result<T> {
    Err(Error::Unsupported(format!(
        "the Kalman filter is exact for linear normal models only, not for {what}"
    )))
}

impl Transform for Linear {
    const BY_JACOBIANS: bool = true;

    fn propagate<A: Motion<N, W>, const N: usize, const W: usize>(
        &self,
        motion: &A,
        step: &A::Step,
        state: &Gaussian<N>,
    ) -> Result<Gaussian<N>> {
        let noise = motion.noise();
        match MotionTangent::of_linear::<A>(step, noise, state) {
            Some(tangent) => tangent.propagate(noise.variance(), state),
            None => refuse("a nonlinear motion"),
        }
    }

    fn propagate_joint<A: Motion<N, W>, const N: usize, const W: usize>(
        &self,
        motion: &A,
        step: &A::Step,
        state: &Gaussian<N>,
    ) -> Result<Joint<N>> {
        let noise = motion.noise();
        match MotionTangent::of_linear::<A>(step, noise, state) {
            Some(tangent) => tangent.propagate_joint(noise.variance(), state),
            None => refuse("a nonlinear motion"),
        }
    }

    fn observe<H: GaussianMeasurement<N, M>, const N: usize, const M: usize>(
        &self,
        measurement: &H,
        at: Time,
        state: &Gaussian<N>,
    ) -> Result<Observed<N, M>> {
        let here = measurement_tangent(measurement, at, state.mean());
        let (_, there) = measurement_tangent(measurement, at, &off(state));
        if !same(&here.1, &there) {
            return refuse("a nonlinear measurement");
        }
        Ok(observed(here, state))
    }

    fn accept<A, H, const N: usize, const W: usize, const M: usize>(
        &self,
        motion: &A,
        measurement: &H,
        prior: &Gaussian<N>,
    ) -> Result<()>
    where
        A: Motion<N, W>,
        H: GaussianMeasurement<N, M>,
    {
        if motion.noise() != Noise::StandardNormal {
            return refuse("process noise that is not normal");
        }
        if H::ANGLE.contains(&true) {
            return refuse("a measurement of angles");
        }
        // Far out in the tail a robust model has long departed from 1.
        if measurement.is_heavy_tailed() {
            return refuse("a robust measurement");
        }
        self.observe(measurement, Time::ZERO, prior).map(drop)
    }
}

impl<const N: usize, const W: usize> MotionTangent<N, W> {
    /// The tangent at the mean of `state`, unless that at a point away from it differs.
    pub(super) fn of_linear<A: Motion<N, W>>(
        step: &A::Step,
        noise: Noise,
        state: &Gaussian<N>,
    ) -> Option<Self> {
        let here = Self::at::<A>(step, state.mean(), &[noise.mean(); W]);
        let there = Self::at::<A>(step, &off(state), &from_fn(|i| 1.0 + i as f64));
        (same(&here.by_state, &there.by_state) && same(&here.by_noise, &there.by_noise)).then_some(here)
    }
}

/// A point away from the mean, in a direction of no symmetry.
fn off<const N: usize>(state: &Gaussian<N>) -> [f64; N] {
    let variance = state.covariance().diagonal();
    from_fn(|i| state.mean()[i] + (1.0 + variance[i].sqrt()) * (1.0 + 0.25 * i as f64))
}

/// Entries equal to 1e-12; NaN equals nothing.
pub(crate) fn same<const R: usize, const C: usize>(a: &Matrix<R, C>, b: &Matrix<R, C>) -> bool {
    a.0.iter().flatten().zip(b.0.iter().flatten()).all(|(a, b)| (a - b).abs() <= 1e-12 * a.abs().max(b.abs()))
}
