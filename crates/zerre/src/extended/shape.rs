//! Shapes made of ellipses.

use crate::error::{Error, Result};
pub(crate) use crate::kernels::Lobe;
use crate::kernels::MAX_LOBES;
use crate::math::gaussian::LN_2PI;
use crate::math::{Cholesky, Matrix, exp, ln};
use serde::{Deserialize, Serialize};

/// One ellipse of a shape: a normal law N(offset, extent) of the points about the centre of the target.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ellipse {
    /// Probability that a point comes from here; those of a shape sum to one.
    pub weight: f64,
    /// Where it lies from the centre, m.
    #[serde(with = "crate::math::vector_serde")]
    pub offset: [f64; 2],
    /// Covariance of its points, m^2: the outline is usually drawn at two standard deviations.
    pub extent: Matrix<2, 2>,
}

/// A union of ellipses: points come from the mixture sum_l weight_l N(centre + offset_l, extent_l) (Özkan 2019,
/// equation 6).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<Ellipse>", into = "Vec<Ellipse>")]
pub struct Shape {
    ellipses: Vec<Ellipse>,
}

/// More than anybody can tell apart.
pub const MAX_ELLIPSES: usize = MAX_LOBES;

impl Shape {
    /// The union of `ellipses`, whose weights are scaled to sum to one.
    ///
    /// # Errors
    /// None or more than [`MAX_ELLIPSES`]; weights that are negative or all zero; numbers that are not finite; an
    /// extent that is not positive definite.
    pub fn new(mut ellipses: Vec<Ellipse>) -> Result<Shape> {
        if ellipses.is_empty() || ellipses.len() > MAX_ELLIPSES {
            let needs = "it must lie between 1 and 16";
            let value = ellipses.len() as f64;
            return Err(Error::OutOfRange { what: "number of ellipses", value, needs });
        }
        let mut sum = 0.0;
        for ellipse in &ellipses {
            sum += Error::not_negative("weight of an ellipse", ellipse.weight)?;
            for x in ellipse.offset {
                Error::finite("offset of an ellipse", x)?;
            }
            Cholesky::of("extent of an ellipse", &ellipse.extent)?;
        }
        Error::positive("weights of a shape", sum)?;
        // What sums to one already, as a saved shape does, keeps its bits.
        if (sum - 1.0).abs() > 1e-14 {
            ellipses.iter_mut().for_each(|ellipse| ellipse.weight /= sum);
        }
        Ok(Shape { ellipses })
    }

    /// A single ellipse about the centre.
    ///
    /// # Errors
    /// An extent that is not positive definite.
    pub fn ellipse(extent: Matrix<2, 2>) -> Result<Shape> {
        Shape::new(vec![Ellipse { weight: 1.0, offset: [0.0; 2], extent }])
    }

    /// The ellipses.
    pub fn ellipses(&self) -> &[Ellipse] {
        &self.ellipses
    }

    /// Their number.
    pub fn len(&self) -> usize {
        self.ellipses.len()
    }

    /// Never: a shape has an ellipse at least.
    pub fn is_empty(&self) -> bool {
        self.ellipses.is_empty()
    }

    /// Mean of a point about the centre: sum_l weight_l offset_l.
    pub fn centroid(&self) -> [f64; 2] {
        self.ellipses.iter().fold([0.0; 2], |sum, e| {
            [e.weight.mul_add(e.offset[0], sum[0]), e.weight.mul_add(e.offset[1], sum[1])]
        })
    }

    /// Covariance of a point.
    #[must_use]
    pub fn covariance(&self) -> Matrix<2, 2> {
        let centre = self.centroid();
        self.ellipses.iter().fold(Matrix::ZERO, |sum, e| {
            let d = [e.offset[0] - centre[0], e.offset[1] - centre[1]];
            sum + (e.extent + Matrix::outer(&d, &d)) * e.weight
        })
    }

    /// The shape about a centre that lies `by` further on: its points stay where they are.
    #[must_use]
    pub fn about(&self, by: [f64; 2]) -> Shape {
        let moved = |e: &Ellipse| Ellipse { offset: [e.offset[0] - by[0], e.offset[1] - by[1]], ..*e };
        Shape { ellipses: self.ellipses.iter().map(moved).collect() }
    }

    /// The shape turned by `angle` (rad, counterclockwise) about the centre.
    #[must_use]
    pub fn turned(&self, angle: f64) -> Shape {
        let (sin, cos) = crate::math::sin_cos(angle);
        let turn = Matrix([[cos, -sin], [sin, cos]]);
        let turned =
            |e: &Ellipse| Ellipse { offset: turn * e.offset, extent: turn.congruence(&e.extent), ..*e };
        Shape { ellipses: self.ellipses.iter().map(turned).collect() }
    }

    /// The shape with `noise` added to every extent: how a sensor of that covariance sees it.
    #[must_use]
    pub fn blurred(&self, noise: &Matrix<2, 2>) -> Shape {
        let blurred = |e: &Ellipse| Ellipse { extent: e.extent + *noise, ..*e };
        Shape { ellipses: self.ellipses.iter().map(blurred).collect() }
    }

    /// ln p of a point `d` from the centre.
    ///
    /// # Errors
    /// None for shapes that came from [`Shape::new`].
    pub fn log_density(&self, d: &[f64; 2]) -> Result<f64> {
        let mut logs = [f64::NEG_INFINITY; MAX_ELLIPSES];
        for (log, e) in logs.iter_mut().zip(&self.ellipses) {
            *log = Lobe::of(e)?.log_density(*d);
        }
        Ok(log_sum_exp(&logs[..self.len()]))
    }
}

impl TryFrom<Vec<Ellipse>> for Shape {
    type Error = Error;

    fn try_from(ellipses: Vec<Ellipse>) -> Result<Shape> {
        Shape::new(ellipses)
    }
}

impl From<Shape> for Vec<Ellipse> {
    fn from(shape: Shape) -> Vec<Ellipse> {
        shape.ellipses
    }
}

impl Lobe {
    /// An ellipse digested for densities.
    pub fn of(e: &Ellipse) -> Result<Lobe> {
        let [[a, b], [_, d]] = e.extent.0;
        let first = a.sqrt();
        let cross = b / first;
        let pivot = d - cross * cross;
        if !(a > 0.0 && pivot > 0.0 && (a + pivot).is_finite()) {
            let row = usize::from(a > 0.0);
            return Err(Error::NotPositiveDefinite {
                what: "extent of an ellipse",
                row,
                pivot: pivot.min(a),
            });
        }
        let second = pivot.sqrt();
        let root = [1.0 / first, -cross / (first * second), 1.0 / second];
        let constant = ln(e.weight / (first * second)) - LN_2PI;
        Ok(Lobe { offset: e.offset, root, constant })
    }

    /// ln(weight N(d; offset, X)).
    pub fn log_density(&self, d: [f64; 2]) -> f64 {
        let (x, y) = (d[0] - self.offset[0], d[1] - self.offset[1]);
        let [a, b, c] = self.root;
        let (u, v) = (a * x, b * x + c * y);
        self.constant - 0.5 * (u * u + v * v)
    }

    /// X^-1.
    pub fn information(&self) -> Matrix<2, 2> {
        let [a, b, c] = self.root;
        Matrix([[a * a + b * b, b * c], [b * c, c * c]])
    }
}

/// ln sum exp.
pub(crate) fn log_sum_exp(logs: &[f64]) -> f64 {
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if most == f64::NEG_INFINITY {
        return most;
    }
    most + ln(logs.iter().map(|log| exp(log - most)).sum::<f64>())
}
