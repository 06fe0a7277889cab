//! How far shapes made of ellipses lie apart.
//!
//! Shapes are given about their centres; to compare them in the plane, move them there first
//! ([`Shape::about`]). Ellipses have no names: those of two shapes are compared in the order that fits best.

use zerre::extended::{Ellipse, Shape};
use zerre::math::Matrix;

/// Squared Gauss-Wasserstein distance of two normal laws: |m1 - m2|^2 + tr(A + B - 2 (A^1/2 B A^1/2)^1/2), in closed
/// form in the plane: tr (A^1/2 B A^1/2)^1/2 = sqrt(tr(A B) + 2 sqrt(det A det B)).
pub fn gauss_wasserstein_squared(a: &Ellipse, b: &Ellipse) -> f64 {
    let (x, y) = (a.offset[0] - b.offset[0], a.offset[1] - b.offset[1]);
    let trace = |m: &Matrix<2, 2>| m.0[0][0] + m.0[1][1];
    let det = |m: &Matrix<2, 2>| m.0[0][0] * m.0[1][1] - m.0[0][1] * m.0[1][0];
    let both = trace(&(a.extent * b.extent)) + 2.0 * (det(&a.extent) * det(&b.extent)).max(0.0).sqrt();
    let rest = trace(&a.extent) + trace(&b.extent) - 2.0 * both.max(0.0).sqrt();
    x * x + y * y + rest.max(0.0)
}

/// Which ellipse of the estimate stands for which of the truth: the assignment of least total squared Gauss-Wasserstein
/// distance, the estimate moved by `offset`; `None` unless both have as many.
pub fn assigned(truth: &Shape, estimate: &Shape) -> Option<Vec<usize>> {
    let count = truth.len();
    if estimate.len() != count {
        return None;
    }
    let cost: Vec<Vec<f64>> = truth
        .ellipses()
        .iter()
        .map(|t| estimate.ellipses().iter().map(|e| gauss_wasserstein_squared(t, e)).collect())
        .collect();
    Some(assignment(&cost))
}

/// The permutation of least total cost of a square table (Kuhn and Munkres, by shortest augmenting paths).
fn assignment(cost: &[Vec<f64>]) -> Vec<usize> {
    let n = cost.len();
    let (mut u, mut v) = (vec![0.0; n + 1], vec![0.0; n + 1]);
    // Row assigned to each column; index 0 stands for none.
    let mut row_of = vec![0usize; n + 1];
    for row in 1..=n {
        row_of[0] = row;
        let (mut least, mut way, mut used) = (vec![f64::INFINITY; n + 1], vec![0; n + 1], vec![false; n + 1]);
        let mut column = 0;
        loop {
            used[column] = true;
            let i = row_of[column];
            let (mut delta, mut next) = (f64::INFINITY, 0);
            for j in 1..=n {
                if used[j] {
                    continue;
                }
                let reduced = cost[i - 1][j - 1] - u[i] - v[j];
                if reduced < least[j] {
                    (least[j], way[j]) = (reduced, column);
                }
                if least[j] < delta {
                    (delta, next) = (least[j], j);
                }
            }
            for j in 0..=n {
                if used[j] {
                    u[row_of[j]] += delta;
                    v[j] -= delta;
                } else {
                    least[j] -= delta;
                }
            }
            column = next;
            if row_of[column] == 0 {
                break;
            }
        }
        while column != 0 {
            row_of[column] = row_of[way[column]];
            column = way[column];
        }
    }
    let mut found = vec![0; n];
    for column in 1..=n {
        found[row_of[column] - 1] = column - 1;
    }
    found
}

/// Errors of a shape against the truth, ellipse by ellipse after the best assignment, the common offset of all taken
/// off first (the centre of a shape and its offsets move against each other unseen).
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeErrors {
    /// Mean over the ellipses of |X - X_true| / |X_true|, Frobenius.
    pub extent: f64,
    /// Mean distance of the offsets.
    pub offset: f64,
    /// Mean Gauss-Wasserstein distance.
    pub gauss_wasserstein: f64,
    /// The common offset that was taken off.
    pub gauge: [f64; 2],
}

/// The errors of `estimate`; `None` where the numbers of ellipses differ.
pub fn shape_errors(truth: &Shape, estimate: &Shape) -> Option<ShapeErrors> {
    let count = truth.len() as f64;
    let mean_offset = |shape: &Shape| {
        let sum = shape.ellipses().iter().fold([0.0; 2], |s, e| [s[0] + e.offset[0], s[1] + e.offset[1]]);
        sum.map(|x| x / count)
    };
    let (a, b) = (mean_offset(truth), mean_offset(estimate));
    let gauge = [b[0] - a[0], b[1] - a[1]];
    let moved = estimate.about(gauge);
    let order = assigned(truth, &moved)?;
    let (mut extent, mut offset, mut distance) = (0.0, 0.0, 0.0);
    for (t, &at) in truth.ellipses().iter().zip(&order) {
        let e = &moved.ellipses()[at];
        let norm = |m: Matrix<2, 2>| m.0.iter().flatten().map(|x| x * x).sum::<f64>().sqrt();
        extent += norm(e.extent - t.extent) / norm(t.extent) / count;
        offset += (e.offset[0] - t.offset[0]).hypot(e.offset[1] - t.offset[1]) / count;
        distance += gauss_wasserstein_squared(t, e).sqrt() / count;
    }
    Some(ShapeErrors { extent, offset, gauss_wasserstein: distance, gauge })
}

/// Intersection over union of the outlines at two standard deviations, `a` about `at_a` and `b` about `at_b`: the share
/// of the cells of a grid (a 256th of the larger side of the box around both) that lie in both among those in either.
pub fn intersection_over_union(a: (&Shape, [f64; 2]), b: (&Shape, [f64; 2])) -> f64 {
    let inside = [a, b].map(|(shape, at)| Outline::new(shape, at));
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for (shape, at) in [a, b] {
        for e in shape.ellipses() {
            for k in 0..2 {
                let (middle, reach) = (at[k] + e.offset[k], 2.0 * e.extent.0[k][k].max(0.0).sqrt());
                (low[k], high[k]) = (low[k].min(middle - reach), high[k].max(middle + reach));
            }
        }
    }
    let side = (high[0] - low[0]).max(high[1] - low[1]) / 256.0;
    if side.is_nan() || side <= 0.0 || side.is_infinite() {
        return 0.0;
    }
    let (mut both, mut either) = (0u32, 0u32);
    let cells = |k: usize| ((high[k] - low[k]) / side).ceil() as u32;
    for i in 0..cells(0) {
        for j in 0..cells(1) {
            let y = [low[0] + (f64::from(i) + 0.5) * side, low[1] + (f64::from(j) + 0.5) * side];
            let (in_a, in_b) = (inside[0].holds(y), inside[1].holds(y));
            both += u32::from(in_a && in_b);
            either += u32::from(in_a || in_b);
        }
    }
    if either == 0 { 0.0 } else { f64::from(both) / f64::from(either) }
}

/// The union of ellipses at two standard deviations.
struct Outline(Vec<([f64; 2], [f64; 3])>);

impl Outline {
    fn new(shape: &Shape, at: [f64; 2]) -> Outline {
        let of = |e: &Ellipse| {
            let [[p, q], [_, r]] = e.extent.0;
            let det = p * r - q * q;
            ([at[0] + e.offset[0], at[1] + e.offset[1]], [r / det, -q / det, p / det])
        };
        Outline(shape.ellipses().iter().map(of).collect())
    }

    fn holds(&self, y: [f64; 2]) -> bool {
        self.0.iter().any(|(c, [p, q, r])| {
            let (x, y) = (y[0] - c[0], y[1] - c[1]);
            p * x * x + 2.0 * q * x * y + r * y * y <= 4.0
        })
    }
}
