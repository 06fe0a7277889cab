//! Where in a state the body is: its centre and its heading.

use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::math::{Cholesky, Dual, Matrix, Real};
use std::array::from_fn;

/// Where in the plane a state has its centre, h(x) of Özkan 2019, equation 6, and how its body is turned.
pub trait Centre<const N: usize>: Clone + Send + Sync {
    /// Whether the body turns with the state; else it keeps its direction in the plane.
    const TURNS: bool = false;

    /// h(x), m.
    fn at<R: Real>(&self, x: [R; N]) -> [R; 2];

    /// Angle of the body in the plane, rad, counterclockwise; of use only where it [turns](Centre::TURNS).
    #[inline(always)]
    fn heading<R: Real>(&self, x: [R; N]) -> R {
        x[0].constant(0.0)
    }
}

/// The first two components of the state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FirstTwo;

impl<const N: usize> Centre<N> for FirstTwo {
    #[inline(always)]
    fn at<R: Real>(&self, x: [R; N]) -> [R; 2] {
        const { assert!(N >= 2, "the state has no position") };
        [x[0], x[1]]
    }
}

/// The first two components of the state, the body pointing where the next two, its velocity, do.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AlongVelocity;

impl<const N: usize> Centre<N> for AlongVelocity {
    const TURNS: bool = true;

    #[inline(always)]
    fn at<R: Real>(&self, x: [R; N]) -> [R; 2] {
        const { assert!(N >= 4, "the state has no position and velocity") };
        [x[0], x[1]]
    }

    #[inline(always)]
    fn heading<R: Real>(&self, x: [R; N]) -> R {
        x[3].atan2(x[2])
    }
}

/// The first two components of the state, the body turned by another, rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TurnedBy(
    /// Which.
    pub usize,
);

impl<const N: usize> Centre<N> for TurnedBy {
    const TURNS: bool = true;

    #[inline(always)]
    fn at<R: Real>(&self, x: [R; N]) -> [R; 2] {
        const { assert!(N >= 3, "the state has no position and angle") };
        [x[0], x[1]]
    }

    /// # Panics
    /// Where the state has no such component.
    #[inline(always)]
    fn heading<R: Real>(&self, x: [R; N]) -> R {
        x[self.0]
    }
}

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
pub(crate) fn check(points: &[[f64; 2]]) -> Result<()> {
    points.iter().flatten().try_for_each(|y| Error::finite("point of a scan", *y).map(drop))
}

/// Refuses a covariance of the sensor that is not one; zero is one.
pub(super) fn check_noise(noise: &Matrix<2, 2>) -> Result<()> {
    Cholesky::semidefinite("noise of the sensor", noise).map(drop)
}
