//! The inverse-Wishart law of an extent.

use super::statistics::{eigen, floored};
use crate::error::{Error, Result};
use crate::math::{Cholesky, Matrix, gamma, ln, ln_gamma};
use serde::{Deserialize, Serialize};

/// Law of a 2 x 2 covariance X with density proportional to |X|^-(dof + 3)/2 exp(-tr(V X^-1) / 2). It is kept by its
/// mean V / (dof - 3), m^2, so that it has one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parts")]
pub struct InverseWishart {
    mean: Matrix<2, 2>,
    dof: f64,
}

/// What is read before it is checked.
#[derive(Deserialize)]
struct Parts {
    mean: Matrix<2, 2>,
    dof: f64,
}

impl TryFrom<Parts> for InverseWishart {
    type Error = Error;

    fn try_from(parts: Parts) -> Result<Self> {
        InverseWishart::new(parts.mean, parts.dof)
    }
}

/// Bounds of a posterior interval along a direction of the plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SemiAxis {
    /// Unit vector.
    pub direction: [f64; 2],
    /// Root of the mean variance in that direction, m.
    pub length: f64,
    /// Lower and upper bound, m.
    pub interval: [f64; 2],
}

impl InverseWishart {
    /// The law with this mean and these degrees of freedom.
    ///
    /// # Errors
    /// A mean that is not positive definite; degrees of freedom not above 3, where there is no mean.
    pub fn new(mean: Matrix<2, 2>, dof: f64) -> Result<InverseWishart> {
        Cholesky::of("extent", &mean)?;
        if Error::finite("degrees of freedom of an extent", dof)? <= 3.0 {
            let needs = "it must be above 3";
            return Err(Error::OutOfRange { what: "degrees of freedom of an extent", value: dof, needs });
        }
        Ok(InverseWishart { mean, dof })
    }

    /// Mean, m^2.
    pub fn mean(&self) -> &Matrix<2, 2> {
        &self.mean
    }

    /// Degrees of freedom: a point counts as one.
    pub fn dof(&self) -> f64 {
        self.dof
    }

    /// V, m^2: what degrees of freedom and scatter of points add up to.
    #[must_use]
    pub fn scale(&self) -> Matrix<2, 2> {
        self.mean * (self.dof - 3.0)
    }

    /// Most likely extent, V / (dof + 3).
    #[must_use]
    pub fn mode(&self) -> Matrix<2, 2> {
        self.mean * ((self.dof - 3.0) / (self.dof + 3.0))
    }

    /// The interval that holds u'Xu, the variance along a unit vector u, with probability `level`, as much being left
    /// below as above: u'Xu is u'Vu over a chi-square of dof - 1 degrees of freedom (Gupta and Nagar, Matrix Variate
    /// Distributions, chapter 3). With u along an axis of the plane it is that of the component X_11 or X_22.
    ///
    /// # Errors
    /// A level outside (0, 1), a direction that is not finite, more than 2e7 degrees of freedom.
    pub fn variance_interval(&self, direction: [f64; 2], level: f64) -> Result<[f64; 2]> {
        if Error::positive("level of an interval", level)? >= 1.0 {
            let needs = "it must be below 1";
            return Err(Error::OutOfRange { what: "level of an interval", value: level, needs });
        }
        let variance = self.scale().quadratic(&direction, &direction);
        Error::finite("variance along a direction", variance)?;
        let shape = 0.5 * (self.dof - 1.0);
        let bound = |p: f64| Ok(0.5 * variance / gamma::quantile(p, shape)?);
        Ok([bound(0.5 * (1.0 + level))?, bound(0.5 * (1.0 - level))?])
    }

    /// The principal axes of the mean, the longer first, each with the interval that holds the standard deviation of
    /// X along it with probability `level`. The directions are those of the mean: what they are uncertain by is not
    /// in the intervals.
    ///
    /// # Errors
    /// A level outside (0, 1), more than 2e7 degrees of freedom.
    pub fn semi_axes(&self, level: f64) -> Result<[SemiAxis; 2]> {
        let (values, [c, s]) = eigen(&self.mean);
        let axis = |value: f64, direction: [f64; 2]| {
            let interval = self.variance_interval(direction, level)?.map(f64::sqrt);
            Ok(SemiAxis { direction, length: value.max(0.0).sqrt(), interval })
        };
        Ok([axis(values[0], [c, s])?, axis(values[1], [-s, c])?])
    }

    /// What is left of it after a time that keeps the share `keep`: the same mean, and degrees of freedom that fall
    /// towards 5, the fewest with a variance (Feldmann, Fränken and Koch 2011). A law with fewer stays.
    #[must_use]
    pub fn forgotten(&self, keep: f64) -> InverseWishart {
        let dof = if self.dof > 5.0 { keep.mul_add(self.dof - 5.0, 5.0) } else { self.dof };
        InverseWishart { mean: self.mean, dof }
    }

    /// The law after `count` points with `scatter` about their mean, the extent's least eigenvalue being `floor`.
    pub(super) fn with(&self, count: f64, scatter: &Matrix<2, 2>, floor: f64) -> Result<InverseWishart> {
        let dof = self.dof + count;
        let mean = (self.scale() + *scatter) * (1.0 / (dof - 3.0));
        mean.finite("extent")?;
        InverseWishart::new(floored(&mean, floor), dof)
    }

    /// ln of what the density proportional to |X|^-(dof + 3)/2 exp(-tr(V X^-1) / 2) integrates to, less the powers
    /// of 2: |V|^(-dof/2) Gamma_2(dof/2).
    pub(super) fn log_normaliser(scale: &Matrix<2, 2>, dof: f64) -> Result<f64> {
        let det = Cholesky::of("scale of an extent", scale)?.log_det();
        let half = 0.5 * dof;
        Ok(0.5 * ln(std::f64::consts::PI) + ln_gamma(half) + ln_gamma(half - 0.5) - half * det)
    }
}
