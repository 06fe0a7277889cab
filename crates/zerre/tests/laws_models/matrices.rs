//! Matrices of any size, plainly, and the ones of a motion.

use crate::Verdict;
use zerre::Time;
use zerre::math::Dual;
use zerre::model::Motion;

pub(crate) type Matrix = Vec<Vec<f64>>;

pub(crate) fn matrix(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> Matrix {
    (0..rows).map(|i| (0..columns).map(|j| entry(i, j)).collect()).collect()
}

pub(crate) fn product(a: &Matrix, b: &Matrix) -> Matrix {
    matrix(a.len(), b[0].len(), |i, j| (0..b.len()).map(|k| a[i][k] * b[k][j]).sum())
}

pub(crate) fn transposed(a: &Matrix) -> Matrix {
    matrix(a[0].len(), a.len(), |i, j| a[j][i])
}

pub(crate) fn magnitude(a: &Matrix) -> Matrix {
    matrix(a.len(), a[0].len(), |i, j| a[i][j].abs())
}

/// F = df/dx and G = df/dw of a step at (x, w).
pub(crate) fn derivatives<const N: usize, const W: usize, M: Motion<N, W>>(
    motion: &M,
    from: Time,
    to: Time,
    x: [f64; N],
    w: [f64; W],
) -> (Matrix, Matrix) {
    let step = motion.over(from, to).unwrap();
    let by_x = M::apply(&step, Dual::<N>::variables(x), w.map(Dual::constant));
    let by_w = M::apply(&step, x.map(Dual::constant), Dual::<W>::variables(w));
    (matrix(N, N, |i, j| by_x[i].gradient[j]), matrix(N, W, |i, j| by_w[i].gradient[j]))
}

/// F and Q of a linear motion over `dt` seconds.
pub(crate) fn linear<const N: usize, const W: usize, M: Motion<N, W>>(
    motion: &M,
    from: Time,
    to: Time,
) -> (Matrix, Matrix) {
    let (f, g) = derivatives(motion, from, to, [0.3; N], [0.0; W]);
    (f, product(&g, &transposed(&g)))
}

pub(crate) fn compare(
    what: &str,
    found: &Matrix,
    expected: &Matrix,
    scale: &Matrix,
    tolerance: f64,
) -> Verdict {
    for i in 0..expected.len() {
        for j in 0..expected[0].len() {
            let error = (found[i][j] - expected[i][j]).abs();
            if error.is_nan() || error > tolerance * scale[i][j] {
                return Err(format!("{what}[{i}][{j}] is {}, not {}", found[i][j], expected[i][j]));
            }
        }
    }
    Ok(())
}

/// The scale of rounding errors in a covariance: by Cauchy and Schwarz no entry is larger.
pub(crate) fn covariance_scale(q: &Matrix) -> Matrix {
    matrix(q.len(), q.len(), |i, j| q[i][i].sqrt() * q[j][j].sqrt())
}
