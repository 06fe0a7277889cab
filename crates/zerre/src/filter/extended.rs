//! The extended Kalman filter: tangents at the mean, by dual numbers.

use super::gaussian::{Deviations, GaussianFilter, Joint, Observed, Transform};
use crate::belief::Gaussian;
use crate::error::Result;
use crate::math::{Dual, Matrix};
use crate::model::{GaussianMeasurement, Motion};
use crate::time::Time;

/// A Gaussian goes through the tangent of the function at its mean (Jazwinski 1970): exact for linear
/// functions, and nothing of a curvature is seen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tangent;

/// The extended Kalman filter. Process noise may enter anywhere: P = F P F' + G diag(Var w) G' with both Jacobians
/// at the mean of x and w.
pub type Extended<A, H, const N: usize, const W: usize, const M: usize> =
    GaussianFilter<Tangent, A, H, N, W, M>;

impl<A, H, const N: usize, const W: usize, const M: usize> Extended<A, H, N, W, M>
where
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    /// The filter of these models, started from `prior`.
    pub fn new(motion: A, measurement: H, prior: Gaussian<N>) -> Self {
        GaussianFilter::of(Tangent, motion, measurement, prior)
    }
}

/// f and its tangent at a point.
pub(crate) struct MotionTangent<const N: usize, const W: usize> {
    pub(crate) value: [f64; N],
    /// df/dx.
    pub(crate) by_state: Matrix<N, N>,
    /// df/dw.
    pub(crate) by_noise: Matrix<N, W>,
}

impl<const N: usize, const W: usize> MotionTangent<N, W> {
    /// Two passes, one per group of variables: arrays of N + W entries are not to be had in stable Rust.
    pub(crate) fn at<A: Motion<N, W>>(step: &A::Step, x: &[f64; N], w: &[f64; W]) -> Self {
        let along_x = A::apply(step, Dual::variables(*x), w.map(Dual::constant));
        let along_w = A::apply(step, x.map(Dual::constant), Dual::variables(*w));
        MotionTangent {
            value: along_x.map(|d| d.value),
            by_state: Matrix(along_x.map(|d| d.gradient)),
            by_noise: Matrix(along_w.map(|d| d.gradient)),
        }
    }

    /// G diag(Var w) G'.
    pub(crate) fn noise_covariance(&self, variance: f64) -> Matrix<N, N> {
        self.by_noise.congruence(&(Matrix::identity() * variance))
    }

    /// What becomes of a Gaussian with its mean at the point, w having this `variance`.
    pub(super) fn propagate(&self, variance: f64, state: &Gaussian<N>) -> Result<Gaussian<N>> {
        let covariance = self.by_state.congruence(state.covariance()) + self.noise_covariance(variance);
        Gaussian::computed("predicted mean", "predicted covariance", self.value, covariance)
    }

    /// The same with what it has in common with the Gaussian before.
    pub(super) fn propagate_joint(&self, variance: f64, state: &Gaussian<N>) -> Result<Joint<N>> {
        let by_state = observed((self.value, self.by_state), state);
        let law = self.propagate(variance, state)?;
        Ok(Joint { law, by_state, added: self.noise_covariance(variance) })
    }
}

/// h and its Jacobian at a point.
pub(crate) fn measurement_tangent<H: GaussianMeasurement<N, M>, const N: usize, const M: usize>(
    measurement: &H,
    at: Time,
    x: &[f64; N],
) -> ([f64; M], Matrix<M, N>) {
    let z = measurement.predict(at, Dual::variables(*x));
    (z.map(|d| d.value), Matrix(z.map(|d| d.gradient)))
}

/// What is seen of a Gaussian through h and its Jacobian at the mean.
pub(super) fn observed<const N: usize, const M: usize>(
    (mean, jacobian): ([f64; M], Matrix<M, N>),
    state: &Gaussian<N>,
) -> Observed<N, M> {
    Observed {
        mean,
        covariance: jacobian.congruence(state.covariance()),
        cross: *state.covariance() * jacobian.transpose(),
        deviations: Deviations::Linear(jacobian),
    }
}

impl Transform for Tangent {
    const BY_JACOBIANS: bool = true;

    fn propagate<A: Motion<N, W>, const N: usize, const W: usize>(
        &self,
        motion: &A,
        step: &A::Step,
        state: &Gaussian<N>,
    ) -> Result<Gaussian<N>> {
        let noise = motion.noise();
        MotionTangent::<N, W>::at::<A>(step, state.mean(), &[noise.mean(); W])
            .propagate(noise.variance(), state)
    }

    fn propagate_joint<A: Motion<N, W>, const N: usize, const W: usize>(
        &self,
        motion: &A,
        step: &A::Step,
        state: &Gaussian<N>,
    ) -> Result<Joint<N>> {
        let noise = motion.noise();
        MotionTangent::<N, W>::at::<A>(step, state.mean(), &[noise.mean(); W])
            .propagate_joint(noise.variance(), state)
    }

    fn observe<H: GaussianMeasurement<N, M>, const N: usize, const M: usize>(
        &self,
        measurement: &H,
        at: Time,
        state: &Gaussian<N>,
    ) -> Result<Observed<N, M>> {
        Ok(observed(measurement_tangent(measurement, at, state.mean()), state))
    }
}
