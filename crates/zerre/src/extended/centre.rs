//! What the filters of one shape share: the centre seen through the tangent, and the correction that follows.

use super::window::Centre;
use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::math::{Cholesky, Dual, Matrix};
use std::array::from_fn;

/// The law of the centre, by the tangent at the mean of the state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen<const N: usize> {
    pub at: [f64; 2],
    /// Covariance of the centre, m^2.
    pub spread: Matrix<2, 2>,
    /// dh/dx.
    pub slope: Matrix<2, N>,
}

impl<const N: usize> Seen<N> {
    pub fn of<C: Centre<N>>(centre: &C, state: &Gaussian<N>) -> Seen<N> {
        let seen = centre.at(Dual::<N>::variables(*state.mean()));
        let slope = Matrix(seen.map(|s| s.gradient));
        Seen { at: seen.map(|s| s.value), spread: slope.congruence(state.covariance()), slope }
    }

    /// The law of the state after a position `z` with covariance `noise`; `innovation` is the factor of
    /// spread + noise.
    pub fn correct(
        &self,
        state: &Gaussian<N>,
        z: [f64; 2],
        noise: &Matrix<2, 2>,
        innovation: &Cholesky<2>,
    ) -> Result<Gaussian<N>> {
        let gain = innovation.solve_matrix(&(self.slope * *state.covariance())).transpose();
        let correction = gain * [z[0] - self.at[0], z[1] - self.at[1]];
        let mean = from_fn(|i| state.mean()[i] + correction[i]);
        let kept = (Matrix::identity() - gain * self.slope).congruence(state.covariance());
        Gaussian::computed("mean", "covariance", mean, (kept + gain.congruence(noise)).symmetrised())
    }
}

/// Refuses points that are not finite.
pub(super) fn check(points: &[[f64; 2]]) -> Result<()> {
    points.iter().flatten().try_for_each(|y| Error::finite("point of a scan", *y).map(|_| ()))
}

/// Refuses a covariance of the sensor that is not one; zero is one.
pub(super) fn check_noise(noise: &Matrix<2, 2>) -> Result<()> {
    Cholesky::semidefinite("noise of the sensor", noise).map(|_| ())
}
