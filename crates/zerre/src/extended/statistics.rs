//! Sufficient statistics of a shape, and the shape that is most likely given them.

use super::shape::{Ellipse, Shape};
use crate::error::{Error, Result};
use crate::math::{Matrix, Real};
use serde::{Deserialize, Serialize};

/// What an ellipse is known by: sums over points d about the centre, each counted by the probability that it came
/// from the ellipse (Özkan 2019, equation 24).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sums {
    /// sum 1.
    pub count: f64,
    /// sum d.
    pub first: [f64; 2],
    /// sum d d': xx, xy, yy.
    pub second: [f64; 3],
}

impl Sums {
    /// From numbers in the order of the fields, none for those that there are not.
    pub(crate) fn from_moments(s: &[f64]) -> Sums {
        let at = |k: usize| s.get(k).copied().unwrap_or_default();
        Sums { count: at(0), first: [at(1), at(2)], second: [at(3), at(4), at(5)] }
    }

    /// Takes in points about `d` with covariance `spread`, `share` of them.
    pub fn add(&mut self, share: f64, d: [f64; 2], spread: &Matrix<2, 2>) {
        let [x, y] = d;
        self.count += share;
        self.first[0] += share * x;
        self.first[1] += share * y;
        self.second[0] += share * (x * x + spread.0[0][0]);
        self.second[1] += share * (x * y + spread.0[0][1]);
        self.second[2] += share * (y * y + spread.0[1][1]);
    }

    /// self <- keep self + share other.
    pub fn blend(&mut self, keep: f64, share: f64, other: &Sums) {
        let blend = |a: &mut f64, b: f64| *a = keep * *a + share * b;
        blend(&mut self.count, other.count);
        for k in 0..2 {
            blend(&mut self.first[k], other.first[k]);
        }
        for k in 0..3 {
            blend(&mut self.second[k], other.second[k]);
        }
    }

    /// The sums of the same points about a centre that lies `by` further on.
    #[must_use]
    pub fn about(&self, by: [f64; 2]) -> Sums {
        let (n, [x, y], [a, b]) = (self.count, self.first, by);
        Sums {
            count: n,
            first: [x - n * a, y - n * b],
            second: [
                self.second[0] - 2.0 * a * x + n * a * a,
                self.second[1] - a * y - b * x + n * a * b,
                self.second[2] - 2.0 * b * y + n * b * b,
            ],
        }
    }
}

/// How a shape follows from its statistics: the M-step of expectation maximisation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MStep {
    /// Points that the first shape counts for, in each of its ellipses: with none of them it is maximum likelihood,
    /// with some the mode under a conjugate prior. It must be above zero where ellipses may get no points.
    pub prior: f64,
    /// Least eigenvalue of an extent, m^2.
    pub floor: f64,
    /// Whether the weights are learnt; else they stay those of the first shape.
    pub weights: bool,
}

impl Default for MStep {
    fn default() -> Self {
        MStep { prior: 1.0, floor: 0.1, weights: true }
    }
}

impl MStep {
    /// Refuses settings that mean nothing.
    ///
    /// # Errors
    /// Negative numbers, or a floor of zero.
    pub fn check(&self) -> Result<()> {
        Error::not_negative("points of the prior", self.prior)?;
        Error::positive("least eigenvalue of an extent", self.floor)?;
        Ok(())
    }

    /// The shape of these statistics, per ellipse; `noise` of the sensor is taken off the extents. An ellipse
    /// without points keeps what `first` says of it.
    ///
    /// # Errors
    /// Statistics that are not finite.
    pub fn shape(&self, sums: &[Sums], first: &Shape, noise: &Matrix<2, 2>) -> Result<Shape> {
        let total: f64 = sums.iter().map(|s| s.count + self.prior).sum();
        if total <= 1e-9 {
            return Ok(first.clone());
        }
        let mut ellipses = Vec::with_capacity(sums.len());
        for (s, e) in sums.iter().zip(first.ellipses()) {
            let mut all = *s;
            all.add(self.prior, e.offset, &(e.extent + *noise));
            let n = all.count;
            if n <= 1e-9 {
                ellipses.push(Ellipse { weight: if self.weights { 0.0 } else { e.weight }, ..*e });
                continue;
            }
            let offset = [all.first[0] / n, all.first[1] / n];
            let [xx, xy, yy] = all.second.map(|x| x / n);
            let covariance = Matrix([
                [xx - offset[0] * offset[0], xy - offset[0] * offset[1]],
                [xy - offset[0] * offset[1], yy - offset[1] * offset[1]],
            ]);
            let extent = floored(&(covariance - *noise), self.floor);
            let weight = if self.weights { n / total } else { e.weight };
            ellipses.push(Ellipse { weight, offset, extent });
        }
        Shape::new(ellipses)
    }
}

/// Eigenvalues of a symmetric matrix, the larger first, and the unit vector of the larger.
pub fn eigen(a: &Matrix<2, 2>) -> ([f64; 2], [f64; 2]) {
    let [[p, q], [_, r]] = a.0;
    let (half, mean) = (0.5 * (p - r), 0.5 * (p + r));
    let root = Real::hypot(half, q);
    if root == 0.0 {
        return ([mean; 2], [1.0, 0.0]);
    }
    // (q, root - half) and (root + half, q) both lie along the axis; the longer is the more exact.
    let v = if half > 0.0 { [root + half, q] } else { [q, root - half] };
    let length = Real::hypot(v[0], v[1]);
    ([mean + root, mean - root], [v[0] / length, v[1] / length])
}

/// The symmetric matrix with eigenvalues not below `floor`, nor below a 1e12th of the other: what is thinner has no root.
pub fn floored(a: &Matrix<2, 2>, floor: f64) -> Matrix<2, 2> {
    let ([large, small], [c, s]) = eigen(a);
    let floor = floor.max(1e-12 * large);
    if small >= floor {
        return a.symmetrised();
    }
    let (large, small) = (large.max(floor), small.max(floor));
    let cross = (large - small) * c * s;
    Matrix([[large * c * c + small * s * s, cross], [cross, large * s * s + small * c * c]])
}
