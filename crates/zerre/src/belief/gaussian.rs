//! Gaussian beliefs.

use crate::error::{Error, Result};
use crate::math::gaussian::log_density;
use crate::math::{Cholesky, Matrix, Real, vector_serde};
use crate::time::Time;
use serde::{Deserialize, Serialize};
use std::array::from_fn;

/// A normal law of `N` components, in the units of the state. The covariance is finite and symmetric, and it may be
/// singular: a component may be known exactly.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parts<N>")]
pub struct Gaussian<const N: usize> {
    #[serde(with = "vector_serde")]
    mean: [f64; N],
    covariance: Matrix<N, N>,
}

/// What is read before it is checked.
#[derive(Deserialize)]
struct Parts<const N: usize> {
    #[serde(with = "vector_serde")]
    mean: [f64; N],
    covariance: Matrix<N, N>,
}

/// A saved law is held to be one: after long runs the smallest eigenvalue may round below what
/// [`Gaussian::new`] accepts, and what a filter saved it must be able to load.
impl<const N: usize> TryFrom<Parts<N>> for Gaussian<N> {
    type Error = Error;
    fn try_from(parts: Parts<N>) -> Result<Self> {
        Gaussian::computed("mean", "covariance", parts.mean, parts.covariance)
    }
}

impl<const N: usize> Gaussian<N> {
    /// The law with this mean and covariance.
    ///
    /// # Errors
    /// Numbers that are not finite; a covariance that is not symmetric (to 1e-9 of the standard deviations) or not
    /// positive semidefinite (see [`Cholesky::semidefinite`]).
    pub fn new(mean: [f64; N], covariance: Matrix<N, N>) -> Result<Self> {
        let law = Gaussian::computed("mean", "covariance", mean, covariance)?;
        Cholesky::semidefinite("covariance", &law.covariance)?;
        Ok(law)
    }

    /// The law of independent components with these standard deviations.
    ///
    /// # Errors
    /// Numbers that are not finite, a negative standard deviation.
    pub fn independent(mean: [f64; N], deviations: [f64; N]) -> Result<Self> {
        for sd in deviations {
            Error::not_negative("standard deviation", sd)?;
        }
        Gaussian::new(mean, Matrix::from_diagonal(deviations.map(|sd| sd * sd)))
    }

    /// A law whose covariance is semidefinite by construction, up to rounding: everything else is checked.
    pub(crate) fn computed(
        what_mean: &'static str,
        what_covariance: &'static str,
        mean: [f64; N],
        covariance: Matrix<N, N>,
    ) -> Result<Self> {
        for m in mean {
            Error::finite(what_mean, m)?;
        }
        covariance.finite(what_covariance)?;
        let variance = covariance.diagonal();
        for (row, &pivot) in variance.iter().enumerate() {
            if pivot < 0.0 {
                return Err(Error::NotPositiveDefinite { what: what_covariance, row, pivot });
            }
        }
        for i in 0..N {
            for j in 0..i {
                let gap = covariance.0[i][j] - covariance.0[j][i];
                if gap != 0.0 && gap.abs() > 1e-9 * variance[i].sqrt() * variance[j].sqrt() {
                    let needs = "the entry mirrored at the diagonal must equal it";
                    return Err(Error::OutOfRange {
                        what: what_covariance,
                        value: covariance.0[i][j],
                        needs,
                    });
                }
            }
        }
        Ok(Gaussian { mean, covariance: covariance.symmetrised() })
    }

    /// The mean.
    pub fn mean(&self) -> &[f64; N] {
        &self.mean
    }

    /// The covariance; exactly symmetric.
    pub fn covariance(&self) -> &Matrix<N, N> {
        &self.covariance
    }

    /// ln p(x).
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] where the covariance is singular: there is no density.
    pub fn log_density(&self, x: &[f64; N]) -> Result<f64> {
        let factor = Cholesky::of("covariance", &self.covariance)?;
        Ok(log_density(&from_fn(|i| x[i] - self.mean[i]), &factor))
    }

    /// (x - mean)' P^-1 (x - mean): the normalised estimation error squared (NEES) when x is the truth; chi-square
    /// with `N` degrees of freedom when the belief is right.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] where the covariance is singular.
    pub fn mahalanobis_squared(&self, x: &[f64; N]) -> Result<f64> {
        let factor = Cholesky::of("covariance", &self.covariance)?;
        Ok(factor.mahalanobis_squared(&from_fn(|i| x[i] - self.mean[i])))
    }

    /// The law of some of the components, in the order given: `marginal([0, 2])`.
    ///
    /// # Errors
    /// [`Error::Shape`] for a component that there is not.
    pub fn marginal<const K: usize>(&self, components: [usize; K]) -> Result<Gaussian<K>> {
        if let Some(&found) = components.iter().find(|&&c| c >= N) {
            return Err(Error::Shape { what: "number of the component (from 0, below)", found, expected: N });
        }
        Ok(Gaussian {
            mean: components.map(|c| self.mean[c]),
            covariance: Matrix::from_entries(|i, j| self.covariance.0[components[i]][components[j]]),
        })
    }

    /// The law of the `D` leading components: the position, in the order that [models](crate::model) keep.
    ///
    /// # Errors
    /// [`Error::Shape`] if there are fewer.
    pub fn position<const D: usize>(&self) -> Result<Gaussian<D>> {
        self.marginal(from_fn(|i| i))
    }
}

impl Gaussian<2> {
    /// The ellipse of constant density that holds `probability`: its semi-axes are the standard deviations along
    /// the principal directions times sqrt(-2 ln(1 - p)), the root of the chi-square quantile of 2 degrees of
    /// freedom.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] unless 0 <= `probability` < 1.
    pub fn ellipse(&self, probability: f64) -> Result<Ellipse> {
        if !(0.0..1.0).contains(&probability) {
            let needs = "it must be at least 0 and below 1";
            return Err(Error::OutOfRange { what: "probability", value: probability, needs });
        }
        let radius = (-2.0 * Real::ln(1.0 - probability)).sqrt();
        let [[xx, xy], [_, yy]] = self.covariance.0;
        // Eigenvalues: middle +- spread; rounding must not make the smaller one negative.
        let (middle, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        let spread = Real::hypot(half, xy);
        Ok(Ellipse {
            centre: self.mean,
            semi_major: radius * (middle + spread).sqrt(),
            semi_minor: radius * (middle - spread).max(0.0).sqrt(),
            angle_rad: 0.5 * Real::atan2(xy, half),
        })
    }
}

/// An ellipse in the plane of two components.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ellipse {
    /// Its centre.
    pub centre: [f64; 2],
    /// The longer semi-axis.
    pub semi_major: f64,
    /// The shorter semi-axis.
    pub semi_minor: f64,
    /// Direction of the longer axis from the first component towards the second, in (-pi/2, pi/2].
    pub angle_rad: f64,
}

/// A Gaussian at an instant: the belief of the Kalman family.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GaussianBelief<const N: usize> {
    /// When.
    pub time: Time,
    /// What is known then.
    pub state: Gaussian<N>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_4;

    #[test]
    fn refuses_what_is_not_a_law() {
        assert!(Gaussian::new([f64::NAN], Matrix([[1.0]])).is_err());
        assert!(Gaussian::new([0.0], Matrix([[f64::INFINITY]])).is_err());
        assert!(Gaussian::new([0.0], Matrix([[-1.0]])).is_err());
        assert!(Gaussian::new([0.0; 2], Matrix([[1.0, 0.5], [0.4, 1.0]])).is_err());
        assert!(Gaussian::new([0.0; 2], Matrix([[1.0, 2.0], [2.0, 1.0]])).is_err());
        assert!(Gaussian::independent([0.0], [-1.0]).is_err());
        assert!(Gaussian::new([0.0], Matrix([[0.0]])).is_ok());
    }

    #[test]
    fn a_singular_law_has_no_density() {
        let law = Gaussian::independent([0.0; 2], [1.0, 0.0]).unwrap();
        assert!(matches!(law.log_density(&[0.0; 2]), Err(Error::NotPositiveDefinite { row: 1, .. })));
    }

    #[test]
    fn marginals_pick_components() {
        let p = Matrix([[4.0, 1.0, 0.5], [1.0, 9.0, 2.0], [0.5, 2.0, 16.0]]);
        let law = Gaussian::new([1.0, 2.0, 3.0], p).unwrap();
        let part = law.marginal([2, 0]).unwrap();
        assert_eq!((*part.mean(), part.covariance().0), ([3.0, 1.0], [[16.0, 0.5], [0.5, 4.0]]));
        assert!(law.marginal([3]).is_err());
        assert_eq!(law.position::<2>().unwrap(), law.marginal([0, 1]).unwrap());
        assert!(law.position::<4>().is_err());
    }

    /// Every point of the border lies at the squared Mahalanobis distance -2 ln(1 - p).
    #[test]
    fn the_border_of_an_ellipse_has_one_density() {
        let law = Gaussian::new([3.0, -1.0], Matrix([[4.0, -1.5], [-1.5, 1.0]])).unwrap();
        let e = law.ellipse(0.95).unwrap();
        for t in 0..12 {
            let (s, c) = f64::from(t).sin_cos();
            let (u, v) = (e.semi_major * c, e.semi_minor * s);
            let (sin, cos) = e.angle_rad.sin_cos();
            let x = [e.centre[0] + u * cos - v * sin, e.centre[1] + u * sin + v * cos];
            assert!((law.mahalanobis_squared(&x).unwrap() - 5.991_464_547_107_98).abs() < 1e-12);
        }
        assert!(e.semi_major > e.semi_minor);
        let diagonal =
            Gaussian::new([0.0; 2], Matrix([[1.0, 1.0], [1.0, 1.0]])).unwrap().ellipse(0.5).unwrap();
        assert!((diagonal.angle_rad - FRAC_PI_4).abs() < 1e-15 && diagonal.semi_minor == 0.0);
        assert!(law.ellipse(1.0).is_err() && law.ellipse(f64::NAN).is_err());
    }

    #[test]
    fn a_saved_belief_loads_to_the_same_bits() {
        let state = Gaussian::new([0.1, -2.0 / 3.0], Matrix([[0.7, 0.1], [0.1, 1.0 / 7.0]])).unwrap();
        let belief = GaussianBelief { time: Time::from_nanos(17), state };
        let text = serde_json::to_string(&belief).unwrap();
        assert_eq!(serde_json::from_str::<GaussianBelief<2>>(&text).unwrap(), belief);
        assert!(serde_json::from_str::<GaussianBelief<3>>(&text).is_err());
        let broken = text.replacen("0.7", "-0.7", 1);
        assert!(serde_json::from_str::<GaussianBelief<2>>(&broken).is_err());
    }
}
