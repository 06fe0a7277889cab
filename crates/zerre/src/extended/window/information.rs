//! How well a shape is known.

use super::super::inverse_wishart::{InverseWishart, SemiAxis};
use super::super::shape::{Lobe, MAX_ELLIPSES, Shape, log_sum_exp};
use super::super::statistics::eigen;
use crate::error::Result;
use crate::math::{Matrix, exp};
use serde::{Deserialize, Serialize};

/// Numbers of an ellipse: x and y of its offset; xx, xy and yy of its extent.
const NUMBERS: usize = 5;

/// Information that points about known centres give of all ellipses at once: the sum of the outer products of the scores
/// of their log-densities (Berndt, Hall, Hall and Hausman 1974; McLachlan and Peel, Finite Mixture Models, 2000,
/// section 2.15). Whose a point is, is not known, and ellipses that overlap are known the less for it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Information(Vec<f64>);

impl Information {
    pub fn new(ellipses: usize) -> Information {
        Information(vec![0.0; (NUMBERS * ellipses).pow(2)])
    }

    /// Whether it is of so many ellipses.
    pub fn is_of(&self, ellipses: usize) -> bool {
        self.0.len() == (NUMBERS * ellipses).pow(2)
    }

    pub fn keep(&mut self, share: f64) {
        self.0.iter_mut().for_each(|x| *x *= share);
    }

    /// Takes in a point at `d` from the centre, in the directions of the body, beside clutter of log-density `level`.
    pub fn take(&mut self, d: [f64; 2], lobes: &[Lobe], level: f64) {
        let mut logs = [f64::NEG_INFINITY; MAX_ELLIPSES + 1];
        for (log, lobe) in logs.iter_mut().zip(lobes) {
            *log = lobe.log_density(d);
        }
        logs[lobes.len()] = level;
        let total = log_sum_exp(&logs[..=lobes.len()]);
        if !total.is_finite() {
            return;
        }
        let mut scores = [0.0; NUMBERS * MAX_ELLIPSES];
        for ((score, lobe), log) in scores.chunks_exact_mut(NUMBERS).zip(lobes).zip(logs) {
            let (q, j) = (exp(log - total), lobe.information());
            let [x, y] = j * [d[0] - lobe.offset[0], d[1] - lobe.offset[1]];
            let of_extent = [0.5 * (x * x - j.0[0][0]), x * y - j.0[0][1], 0.5 * (y * y - j.0[1][1])];
            score.copy_from_slice(&[x, y, of_extent[0], of_extent[1], of_extent[2]].map(|s| q * s));
        }
        let scores = &scores[..NUMBERS * lobes.len()];
        for (row, a) in self.0.chunks_exact_mut(scores.len()).zip(scores) {
            for (sum, b) in row.iter_mut().zip(scores) {
                *sum += a * b;
            }
        }
    }

    /// Adds `points` that surely are each ellipse's.
    pub fn add_sure(&mut self, points: f64, lobes: &[Lobe]) {
        let size = NUMBERS * lobes.len();
        for (l, lobe) in lobes.iter().enumerate() {
            let [[a, b], [_, c]] = lobe.information().0;
            // Of X: tr(J dX J dX) / 2.
            let own = [
                [a, b, 0.0, 0.0, 0.0],
                [b, c, 0.0, 0.0, 0.0],
                [0.0, 0.0, 0.5 * a * a, a * b, 0.5 * b * b],
                [0.0, 0.0, a * b, a * c + b * b, b * c],
                [0.0, 0.0, 0.5 * b * b, b * c, 0.5 * c * c],
            ];
            for (i, row) in own.iter().enumerate() {
                let start = (NUMBERS * l + i) * size + NUMBERS * l;
                for (sum, x) in self.0[start..start + NUMBERS].iter_mut().zip(row) {
                    *sum += points * x;
                }
            }
        }
    }

    /// Covariance of the extent (xx, xy, yy) of each ellipse, whatever the others are; `None` where nothing is known.
    fn covariances(mut self, ellipses: usize) -> Option<Vec<Matrix<3, 3>>> {
        let size = NUMBERS * ellipses;
        let at = |i: usize, j: usize| i * size + j;
        let l = &mut self.0;
        for j in 0..size {
            for k in 0..j {
                for i in j..size {
                    l[at(i, j)] -= l[at(i, k)] * l[at(j, k)];
                }
            }
            let pivot = l[at(j, j)];
            if pivot.is_nan() || pivot <= 0.0 {
                return None;
            }
            let root = pivot.sqrt();
            (j..size).for_each(|i| l[at(i, j)] /= root);
        }
        // Columns of L^-1, whose products are those of the inverse.
        let mut columns = Vec::with_capacity(size);
        for j in 0..size {
            let mut column = vec![0.0; size];
            column[j] = 1.0;
            for i in j..size {
                let rest: f64 = (j..i).map(|k| l[at(i, k)] * column[k]).sum();
                column[i] = (column[i] - rest) / l[at(i, i)];
            }
            columns.push(column);
        }
        let product = |a: usize, b: usize| columns[a].iter().zip(&columns[b]).map(|(x, y)| x * y).sum();
        let own = |e: usize| Matrix::from_entries(|i, j| product(NUMBERS * e + 2 + i, NUMBERS * e + 2 + j));
        Some((0..ellipses).map(own).collect())
    }

    /// What is known of the extents of a shape.
    pub fn extents(self, shape: &Shape) -> Vec<Extent> {
        let covariances = self.covariances(shape.len()).unwrap_or_default();
        let known = |k: usize| covariances.get(k).copied();
        let each = shape.ellipses().iter().enumerate();
        each.map(|(k, ellipse)| Extent { mode: ellipse.extent, covariance: known(k) }).collect()
    }
}

/// What is known of the extent X of an ellipse: along every unit vector u the variance u'Xu has the inverse-Wishart law that
/// as many points would leave as say as much of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    mode: Matrix<2, 2>,
    /// Of (xx, xy, yy); `None` where nothing is known.
    covariance: Option<Matrix<3, 3>>,
}

/// Fewest points of a law that has a mean and a variance.
const FEWEST: f64 = 6.0;

impl Extent {
    /// The interval that holds the variance along a unit vector with probability `level`, m^2.
    ///
    /// # Errors
    /// A level outside (0, 1), a direction that is not finite.
    pub fn variance_interval(&self, direction: [f64; 2], level: f64) -> Result<[f64; 2]> {
        let [x, y] = direction;
        let by = [x * x, 2.0 * x * y, y * y];
        let mode = self.mode.quadratic(&direction, &direction);
        // n points know a variance to 2 / n of its square.
        let points = self.covariance.map_or(FEWEST, |covariance| {
            f64::max(2.0 * mode * mode / covariance.quadratic(&by, &by), FEWEST)
        });
        // V = n times the mode, of the mean V / (dof - 3).
        let dof = points - 1.0;
        InverseWishart::new(self.mode * (points / (dof - 3.0)), dof)?.variance_interval(direction, level)
    }

    /// The principal axes, the longer first: the standard deviation along each, and its interval. Their directions are
    /// taken for known.
    ///
    /// # Errors
    /// A level outside (0, 1).
    pub fn semi_axes(&self, level: f64) -> Result<[SemiAxis; 2]> {
        let (values, [c, s]) = eigen(&self.mode);
        let axis = |value: f64, direction: [f64; 2]| {
            let interval = self.variance_interval(direction, level)?.map(f64::sqrt);
            Ok(SemiAxis { direction, length: value.max(0.0).sqrt(), interval })
        };
        Ok([axis(values[0], [c, s])?, axis(values[1], [-s, c])?])
    }
}
