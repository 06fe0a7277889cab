//! Scans of points as a measurement: what particle filters weigh by.

use super::centre::{Centre, check};
use super::shape::{Lobe, MAX_ELLIPSES, Shape};
use crate::error::Result;
use crate::math::{Matrix, Real};
use crate::model::Measurement;
use crate::rng::Draws;
use crate::time::Time;

/// A scan from a target of known shape, every point from any of its ellipses: p(y_1..m | x) = prod_j sum_l
/// weight_l N(y_j; h(x) + offset_l, extent_l), their number given (Özkan 2019, equation 6). A value is the
/// points, m.
#[derive(Clone, Debug)]
pub struct PointScan<C> {
    centre: C,
    shape: Shape,
    lobes: Lobes,
}

/// A scan, digested.
#[derive(Clone, Copy, Debug)]
pub struct PointScanGiven<'z, C> {
    pub(crate) centre: &'z C,
    pub(crate) lobes: &'z Lobes,
    pub(crate) points: &'z [[f64; 2]],
}

impl<C> PointScan<C> {
    /// Points of `shape` about the centre of the state, each with `noise` of the sensor (covariance, m^2).
    ///
    /// # Errors
    /// Noise that is not finite or leaves an extent that is not positive definite.
    pub fn new(centre: C, shape: Shape, noise: &Matrix<2, 2>) -> Result<Self> {
        noise.finite("noise of the sensor")?;
        let lobes = Lobes::of(&shape.blurred(noise))?;
        Ok(PointScan { centre, shape, lobes })
    }

    /// The shape.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// Where the centre is.
    pub fn centre(&self) -> &C {
        &self.centre
    }
}

impl<C: Centre<N>, const N: usize> Measurement<N> for PointScan<C> {
    type Value = Vec<[f64; 2]>;
    type Given<'z>
        = PointScanGiven<'z, C>
    where
        C: 'z;

    fn given<'z>(&'z self, z: &'z Vec<[f64; 2]>, _: Time) -> Result<PointScanGiven<'z, C>> {
        check(z)?;
        Ok(PointScanGiven { centre: &self.centre, lobes: &self.lobes, points: z })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &PointScanGiven<'_, C>, x: [R; N]) -> R {
        let mut none = [x[0]; 0];
        let centre = given.centre.at(x);
        expect::<R, false>(given.lobes.all(), given.points, centre, 0.0, &mut none)
    }
}

/// The ellipses of a shape, digested.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lobes {
    all: [Lobe; MAX_ELLIPSES],
    weights: [f64; MAX_ELLIPSES],
    count: usize,
}

impl Lobes {
    pub fn of(shape: &Shape) -> Result<Lobes> {
        let none = Lobe { offset: [0.0; 2], root: [0.0; 3], constant: f64::NEG_INFINITY };
        let mut all = [none; MAX_ELLIPSES];
        let mut weights = [0.0; MAX_ELLIPSES];
        for ((lobe, weight), ellipse) in all.iter_mut().zip(&mut weights).zip(shape.ellipses()) {
            (*lobe, *weight) = (Lobe::of(ellipse)?, ellipse.weight);
        }
        Ok(Lobes { all, weights, count: shape.len() })
    }

    pub fn all(&self) -> &[Lobe] {
        &self.all[..self.count]
    }

    pub fn weights(&self) -> &[f64] {
        &self.weights[..self.count]
    }
}

/// Numbers per ellipse in a row of statistics: 1, d (2), d d' (xx, xy, yy), as in [`Sums`](super::Sums).
pub(crate) const MOMENTS: usize = 6;

/// Below any log-density that a finite distance gives: keeps -inf less -inf out.
const LEAST: f64 = -1e300;
/// Points whose sums may be multiplied: each lies between 1 and the number of ellipses.
const AT_ONCE: usize = 64;

/// e[l] <- exp(log density of the point under ellipse l - most); `most` and the sum.
#[inline(always)]
pub(crate) fn densities<R: Real>(lobes: &[Lobe], d: [R; 2], e: &mut [R; MAX_ELLIPSES]) -> (R, R) {
    let mut most = d[0].constant(LEAST);
    for (e, lobe) in e.iter_mut().zip(lobes) {
        let (x, y) = (d[0] - lobe.offset[0], d[1] - lobe.offset[1]);
        let [a, b, c] = lobe.root;
        let (u, v) = (x * a, x.mul_add(x.constant(b), y * c));
        let log = u.mul_add(u, v * v).mul_add(u.constant(-0.5), u.constant(lobe.constant));
        most = log.max(most);
        *e = log;
    }
    let mut sum = most.constant(0.0);
    for e in e.iter_mut().take(lobes.len()) {
        *e = (*e - most).exp();
        sum = sum + *e;
    }
    (most, sum)
}

/// ln p of the points about a centre. With `SUMS`, `gain` times their statistics, each point shared among the
/// ellipses by the probability that it comes from them, are added to `sums`, [`MOMENTS`] per ellipse.
#[inline(always)]
pub(crate) fn expect<R: Real, const SUMS: bool>(
    lobes: &[Lobe],
    points: &[[f64; 2]],
    centre: [R; 2],
    gain: f64,
    sums: &mut [R],
) -> R {
    let zero = centre[0].constant(0.0);
    let mut e = [zero; MAX_ELLIPSES];
    let mut log = zero;
    for points in points.chunks(AT_ONCE) {
        let mut product = zero.constant(1.0);
        for y in points {
            let d = [-(centre[0] - y[0]), -(centre[1] - y[1])];
            let (most, sum) = densities(lobes, d, &mut e);
            log = log + most;
            product = product * sum;
            if SUMS {
                // A point that no ellipse explains has the sum 0, and the particle no weight.
                let scale = zero.constant(gain) / sum.max(zero.constant(f64::MIN_POSITIVE));
                for (e, sums) in e.iter().zip(sums.chunks_exact_mut(MOMENTS)) {
                    add(*e * scale, d, sums);
                }
            }
        }
        log = log + product.ln();
    }
    log
}

/// Adds `share` of a point to the statistics of an ellipse.
#[inline(always)]
pub(crate) fn add<R: Real>(share: R, [x, y]: [R; 2], sums: &mut [R]) {
    let (sx, sy) = (share * x, share * y);
    sums[0] = sums[0] + share;
    sums[1] = sums[1] + sx;
    sums[2] = sums[2] + sy;
    sums[3] = sx.mul_add(x, sums[3]);
    sums[4] = sx.mul_add(y, sums[4]);
    sums[5] = sy.mul_add(y, sums[5]);
}

/// As [`expect`], for one particle, with the ellipse of every point drawn: from its probability given the
/// point where that is `optimal`, the weight being that of the point whatever it comes from; else from the
/// weights of the ellipses, the weight being that of the point under the one drawn.
#[inline(always)]
pub(crate) fn draw_labels<C>(
    given: &PointScanGiven<'_, C>,
    (optimal, mut draws): (bool, Draws),
    centre: [f64; 2],
    gain: f64,
    sums: &mut [f64],
) -> f64 {
    let (lobes, weights) = (given.lobes.all(), given.lobes.weights());
    let (mut log, mut e) = (0.0, [0.0; MAX_ELLIPSES]);
    for y in given.points {
        let d = [y[0] - centre[0], y[1] - centre[1]];
        let u = draws.uniform();
        let label = if optimal {
            let (most, sum) = densities(lobes, d, &mut e);
            log += most + Real::ln(sum);
            drawn(&e[..lobes.len()], u * sum)
        } else {
            let label = drawn(weights, u);
            log += lobes[label].log_density(d) - Real::ln(weights[label]);
            label
        };
        add(gain, d, &mut sums[MOMENTS * label..MOMENTS * (label + 1)]);
    }
    log
}

/// The entry where the sum first exceeds `level`; the last that is not zero if rounding keeps it below.
#[inline(always)]
fn drawn(shares: &[f64], level: f64) -> usize {
    let (mut sum, mut last) = (0.0, 0);
    for (l, &share) in shares.iter().enumerate() {
        if share > 0.0 {
            (sum, last) = (sum + share, l);
            if level < sum {
                break;
            }
        }
    }
    last
}
