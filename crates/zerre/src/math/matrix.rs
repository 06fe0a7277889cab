//! Small dense matrices whose sizes are types, and their Cholesky factors. Sums run in index order with fused
//! steps, so results have the same bits everywhere.

use crate::error::{Error, Result};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::array::from_fn;
use std::ops::{Add, Mul, Neg, Sub};

/// A matrix of `R` rows and `C` columns: `m.0[row][column]`. It is saved as a list of rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Matrix<const R: usize, const C: usize>(pub [[f64; C]; R]);

impl<const R: usize, const C: usize> Matrix<R, C> {
    /// All zeros.
    pub const ZERO: Self = Matrix([[0.0; C]; R]);

    /// The matrix with these entries, asked for by row and column.
    pub fn from_entries(mut entry: impl FnMut(usize, usize) -> f64) -> Self {
        Matrix(from_fn(|i| from_fn(|j| entry(i, j))))
    }

    /// a b'.
    pub fn outer(a: &[f64; R], b: &[f64; C]) -> Self {
        Matrix::from_entries(|i, j| a[i] * b[j])
    }

    /// Rows become columns.
    #[must_use]
    pub fn transpose(&self) -> Matrix<C, R> {
        Matrix::from_entries(|i, j| self.0[j][i])
    }

    /// Column number `j`.
    pub fn column(&self, j: usize) -> [f64; R] {
        from_fn(|i| self.0[i][j])
    }

    /// A P A' for this matrix A and a symmetric P; exactly symmetric.
    #[must_use]
    pub fn congruence(&self, p: &Matrix<C, C>) -> Matrix<R, R> {
        // Models leave most of A zero. A fused step with a zero changes no bit of a finite sum, and is left out.
        let a = &self.0;
        let steps = |row: usize| (0..C).filter(move |&k| a[row][k] != 0.0);
        let ap: [[f64; C]; R] =
            from_fn(|i| from_fn(|j| steps(i).fold(0.0, |sum, k| a[i][k].mul_add(p.0[k][j], sum))));
        Matrix::from_entries(|i, j| steps(j).fold(0.0, |sum, k| ap[i][k].mul_add(a[j][k], sum))).symmetrised()
    }

    /// Largest magnitude of an entry; NaN entries are passed over.
    pub fn max_abs(&self) -> f64 {
        self.0.iter().flatten().fold(0.0, |largest: f64, x| largest.max(x.abs()))
    }

    /// Refuses a matrix with a NaN or an infinity.
    ///
    /// # Errors
    /// [`Error::NotFinite`] with the first such entry.
    pub fn finite(&self, what: &'static str) -> Result<()> {
        self.0.iter().flatten().try_for_each(|&x| Error::finite(what, x).map(drop))
    }
}

impl<const N: usize> Matrix<N, N> {
    /// Ones on the diagonal.
    pub fn identity() -> Self {
        Matrix::from_diagonal([1.0; N])
    }

    /// `diagonal` on the diagonal, zeros elsewhere.
    pub fn from_diagonal(diagonal: [f64; N]) -> Self {
        Matrix::from_entries(|i, j| if i == j { diagonal[i] } else { 0.0 })
    }

    /// The entries on the diagonal.
    pub fn diagonal(&self) -> [f64; N] {
        from_fn(|i| self.0[i][i])
    }

    /// (A + A') / 2.
    #[must_use]
    pub fn symmetrised(&self) -> Self {
        Matrix::from_entries(|i, j| 0.5 * self.0[i][j] + 0.5 * self.0[j][i])
    }

    /// a' A b.
    pub fn quadratic(&self, a: &[f64; N], b: &[f64; N]) -> f64 {
        dot(a, &(*self * *b))
    }
}

/// a' b, summed in index order with fused steps.
pub fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).fold(0.0, |sum, (&a, &b)| a.mul_add(b, sum))
}

impl<const R: usize, const C: usize> Add for Matrix<R, C> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Matrix::from_entries(|i, j| self.0[i][j] + other.0[i][j])
    }
}
impl<const R: usize, const C: usize> Sub for Matrix<R, C> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Matrix::from_entries(|i, j| self.0[i][j] - other.0[i][j])
    }
}
impl<const R: usize, const C: usize> Neg for Matrix<R, C> {
    type Output = Self;
    fn neg(self) -> Self {
        self * -1.0
    }
}
impl<const R: usize, const C: usize> Mul<f64> for Matrix<R, C> {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Matrix::from_entries(|i, j| self.0[i][j] * factor)
    }
}
impl<const R: usize, const C: usize> Mul<[f64; C]> for Matrix<R, C> {
    type Output = [f64; R];
    fn mul(self, x: [f64; C]) -> [f64; R] {
        from_fn(|i| dot(&self.0[i], &x))
    }
}
impl<const R: usize, const K: usize, const C: usize> Mul<Matrix<K, C>> for Matrix<R, K> {
    type Output = Matrix<R, C>;
    fn mul(self, other: Matrix<K, C>) -> Matrix<R, C> {
        Matrix::from_entries(|i, j| (0..K).fold(0.0, |sum, k| self.0[i][k].mul_add(other.0[k][j], sum)))
    }
}

impl<const R: usize, const C: usize> Serialize for Matrix<R, C> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.iter().map(|row| row.as_slice()))
    }
}

impl<'de, const R: usize, const C: usize> Deserialize<'de> for Matrix<R, C> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let rows = Vec::<Vec<f64>>::deserialize(deserializer)?;
        let shape =
            |found, expected: usize| serde::de::Error::invalid_length(found, &expected.to_string().as_str());
        let rows: Vec<[f64; C]> = rows
            .into_iter()
            .map(|row| row.try_into().map_err(|row: Vec<f64>| shape(row.len(), C)))
            .collect::<Result<_, D::Error>>()?;
        rows.try_into().map(Matrix).map_err(|rows: Vec<_>| shape(rows.len(), R))
    }
}

/// Serde of `[f64; N]` as a list, for `#[serde(with = "crate::math::vector_serde")]`: serde itself has arrays of
/// literal sizes only.
pub(crate) mod vector_serde {
    use serde::{Deserialize, Deserializer, Serializer};

    pub(crate) fn serialize<S: Serializer, const N: usize>(x: &[f64; N], s: S) -> Result<S::Ok, S::Error> {
        s.collect_seq(x)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>, const N: usize>(d: D) -> Result<[f64; N], D::Error> {
        let list = Vec::<f64>::deserialize(d)?;
        list.try_into()
            .map_err(|list: Vec<f64>| serde::de::Error::invalid_length(list.len(), &N.to_string().as_str()))
    }
}

/// Cholesky factor of a symmetric positive definite matrix: A = L L' with L lower triangular.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cholesky<const N: usize> {
    lower: Matrix<N, N>,
}

impl<const N: usize> Cholesky<N> {
    /// Factors `a`, of which the diagonal and what is below it are read; `what` names it in refusals.
    ///
    /// # Errors
    /// [`Error::NotFinite`] for a NaN or an infinity, [`Error::NotPositiveDefinite`] for a pivot that is not above
    /// zero.
    pub fn of(what: &'static str, a: &Matrix<N, N>) -> Result<Self> {
        a.finite(what)?;
        let mut l = [[0.0f64; N]; N];
        for j in 0..N {
            let pivot = (0..j).fold(a.0[j][j], |rest, k| (-l[j][k]).mul_add(l[j][k], rest));
            // Written so that the NaN of an overflow is refused too.
            if !(pivot > 0.0 && pivot.is_finite()) {
                return Err(Error::NotPositiveDefinite { what, row: j, pivot });
            }
            l[j][j] = pivot.sqrt();
            for i in j + 1..N {
                let rest = (0..j).fold(a.0[i][j], |rest, k| (-l[i][k]).mul_add(l[j][k], rest));
                l[i][j] = rest / l[j][j];
            }
        }
        Ok(Cholesky { lower: Matrix(l) })
    }

    /// Some F with A = F F' for a symmetric positive *semi*definite `a`: degenerate process noise, a component that
    /// is known exactly. F has zero columns in place of missing rank and is in general not triangular.
    ///
    /// Rows are scaled to unit variance and the largest pivot is taken first; pivots below 16 N eps (of a variance
    /// scaled to one) count as zero, and what is left over then is at most that large.
    ///
    /// # Errors
    /// [`Error::NotFinite`]; [`Error::NotPositiveDefinite`] if a pivot, or what is left over, lies further from
    /// zero than the tolerance.
    pub fn semidefinite(what: &'static str, a: &Matrix<N, N>) -> Result<Matrix<N, N>> {
        a.finite(what)?;
        let tolerance = 16.0 * N as f64 * f64::EPSILON;
        let scale = a.diagonal().map(f64::sqrt);
        let mut rest = *a;
        for i in 0..N {
            for j in 0..N {
                if a.0[i][i] < 0.0 || (a.0[i][i] == 0.0 && a.0[i][j] != 0.0) {
                    return Err(Error::NotPositiveDefinite { what, row: i, pivot: a.0[i][i] });
                }
                if a.0[i][j] != 0.0 {
                    rest.0[i][j] = a.0[i][j] / scale[i] / scale[j];
                }
            }
        }
        let mut factor = Matrix::ZERO;
        let mut open = [true; N];
        for k in 0..N {
            let largest =
                (0..N).filter(|&i| open[i]).reduce(|a, b| if rest.0[b][b] > rest.0[a][a] { b } else { a });
            let Some(p) = largest.filter(|&p| rest.0[p][p] > tolerance) else { break };
            open[p] = false;
            let root = rest.0[p][p].sqrt();
            let mut column = [0.0f64; N];
            column[p] = root;
            for i in (0..N).filter(|&i| open[i]) {
                column[i] = rest.0[i][p] / root;
            }
            for i in (0..N).filter(|&i| open[i]) {
                for j in (0..N).filter(|&j| open[j]) {
                    rest.0[i][j] = (-column[i]).mul_add(column[j], rest.0[i][j]);
                }
            }
            for i in 0..N {
                factor.0[i][k] = column[i] * scale[i];
            }
        }
        // Of a positive semidefinite matrix nothing is left that exceeds its largest pivot.
        for i in (0..N).filter(|&i| open[i]) {
            for j in (0..N).filter(|&j| open[j]) {
                if rest.0[i][j].is_nan() || rest.0[i][j].abs() > tolerance {
                    return Err(Error::NotPositiveDefinite { what, row: i, pivot: rest.0[i][i] });
                }
            }
        }
        Ok(factor)
    }

    /// L.
    pub fn factor(&self) -> &Matrix<N, N> {
        &self.lower
    }

    /// L^-1 b: whitens a difference whose covariance is A.
    pub fn whiten(&self, b: &[f64; N]) -> [f64; N] {
        let l = &self.lower.0;
        let mut y = [0.0f64; N];
        for i in 0..N {
            y[i] = (0..i).fold(b[i], |rest, k| (-l[i][k]).mul_add(y[k], rest)) / l[i][i];
        }
        y
    }

    /// A^-1 b.
    pub fn solve(&self, b: &[f64; N]) -> [f64; N] {
        let l = &self.lower.0;
        let mut x = self.whiten(b);
        for i in (0..N).rev() {
            x[i] = (i + 1..N).fold(x[i], |rest, k| (-l[k][i]).mul_add(x[k], rest)) / l[i][i];
        }
        x
    }

    /// A^-1 B.
    #[must_use]
    pub fn solve_matrix<const C: usize>(&self, b: &Matrix<N, C>) -> Matrix<N, C> {
        let columns: [[f64; N]; C] = from_fn(|j| self.solve(&b.column(j)));
        Matrix(columns).transpose()
    }

    /// A^-1, exactly symmetric.
    pub fn inverse(&self) -> Matrix<N, N> {
        self.solve_matrix(&Matrix::identity()).symmetrised()
    }

    /// ln det A.
    pub fn log_det(&self) -> f64 {
        2.0 * self.lower.diagonal().iter().fold(0.0, |sum, &d| sum + super::ln(d))
    }

    /// d' A^-1 d: the squared Mahalanobis distance of a difference whose covariance is A.
    pub fn mahalanobis_squared(&self, d: &[f64; N]) -> f64 {
        let y = self.whiten(d);
        dot(&y, &y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    const A: Matrix<3, 3> = Matrix([[4.0, 2.0, -2.0], [2.0, 10.0, 5.0], [-2.0, 5.0, 9.0]]);

    #[test]
    fn factor_of_a_matrix_factored_by_hand() {
        let c = Cholesky::of("A", &A).unwrap();
        assert_eq!(c.factor().0, [[2.0, 0.0, 0.0], [1.0, 3.0, 0.0], [-1.0, 2.0, 2.0]]);
        // det = (2 3 2)^2; two roundings of ln.
        assert!((c.log_det() - 144f64.ln()).abs() < 1e-14);
        // A (1, 2, 3)' = (2, 37, 35)'.
        assert_eq!(c.solve(&[2.0, 37.0, 35.0]), [1.0, 2.0, 3.0]);
        assert_eq!(c.mahalanobis_squared(&[2.0, 37.0, 35.0]), 2.0 + 74.0 + 105.0);
        assert!((A * c.inverse() - Matrix::identity()).max_abs() < 1e-14);
    }

    #[test]
    fn refusals_name_the_row() {
        let indefinite = Matrix([[1.0, 2.0], [2.0, 1.0]]);
        let refusal = Error::NotPositiveDefinite { what: "P", row: 1, pivot: -3.0 };
        assert_eq!(Cholesky::of("P", &indefinite), Err(refusal));
        assert!(Cholesky::semidefinite("P", &indefinite).is_err());
        assert!(Cholesky::of("P", &Matrix([[0.0]])).is_err());
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let m = Matrix([[1.0, bad], [bad, 1.0]]);
            assert!(matches!(Cholesky::of("P", &m), Err(Error::NotFinite { what: "P", .. })));
            assert!(matches!(Cholesky::semidefinite("P", &m), Err(Error::NotFinite { what: "P", .. })));
        }
        assert!(Cholesky::semidefinite("P", &Matrix([[0.0, 1.0], [1.0, 1.0]])).is_err());
        assert!(Cholesky::semidefinite("P", &Matrix([[-1e-30]])).is_err());
    }

    #[test]
    fn semidefinite_factors_of_zero_and_of_rank_one() {
        assert_eq!(Cholesky::semidefinite("Q", &Matrix::<3, 3>::ZERO).unwrap(), Matrix::ZERO);
        let q = Matrix([[0.25, 0.5], [0.5, 1.0]]);
        let f = Cholesky::semidefinite("Q", &q).unwrap();
        assert_eq!(f * f.transpose(), q);
        assert_eq!(f.column(1), [0.0; 2]);
    }

    #[test]
    fn text_keeps_bits_and_checks_the_shape() {
        let m = Matrix([[0.1, -1.0 / 3.0, 5e-324], [1e308, -0.0, 2.0]]);
        let text = serde_json::to_string(&m).unwrap();
        assert_eq!(serde_json::from_str::<Matrix<2, 3>>(&text).unwrap(), m);
        assert!(serde_json::from_str::<Matrix<3, 2>>(&text).is_err());
        assert!(serde_json::from_str::<Matrix<3, 3>>(&text).is_err());
    }

    fn square() -> impl Strategy<Value = Matrix<4, 4>> {
        prop::collection::vec(-10.0..10.0, 16).prop_map(|v| Matrix::from_entries(|i, j| v[4 * i + j]))
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(4),
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        /// Backward error of either factorisation is below c N eps of the variances (Higham, ch. 10), here with
        /// the tolerance of the semidefinite one on top: 16 N eps = 1.5e-14 of at most 400.
        #[test]
        fn factors_multiply_back(b in square(), rank in 0usize..=4) {
            let mut b = b;
            for row in &mut b.0 {
                row[rank..].fill(0.0);
            }
            let a = b.congruence(&Matrix::identity());
            let f = Cholesky::semidefinite("A", &a).unwrap();
            prop_assert!((f * f.transpose() - a).max_abs() < 1e-11);
            if let Ok(c) = Cholesky::of("A", &a) {
                prop_assert!((*c.factor() * c.factor().transpose() - a).max_abs() < 1e-11);
            }
        }

        #[test]
        fn extreme_numbers_never_panic(v in prop::collection::vec(any::<f64>(), 9)) {
            let m = Matrix::<3, 3>::from_entries(|i, j| v[3 * i + j]);
            let _ = Cholesky::of("M", &m).map(|c| c.inverse());
            let _ = Cholesky::semidefinite("M", &m.symmetrised());
        }
    }
}
