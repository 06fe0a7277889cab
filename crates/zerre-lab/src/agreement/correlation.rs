//! The intraclass correlation: how much of what differs between marks is the object and not the operator.

use crate::distribution::fisher_quantile;
use crate::study::interval::Estimate;

/// Two-way analysis of variance of a full table: rows are frames, columns operators, one value in each cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variance {
    /// Number of rows and of columns.
    pub size: [usize; 2],
    /// Mean square between rows, between columns, and of the rest.
    pub mean_squares: [f64; 3],
}

impl Variance {
    /// `None` of fewer than two rows or columns, and of rows of other lengths.
    pub fn of(rows: &[Vec<f64>]) -> Option<Variance> {
        let (n, k) = (rows.len(), rows.first()?.len());
        if n < 2 || k < 2 || rows.iter().any(|row| row.len() != k) {
            return None;
        }
        let (rows_n, columns_n) = (n as f64, k as f64);
        let grand = rows.iter().flatten().sum::<f64>() / (rows_n * columns_n);
        let of_row: Vec<f64> = rows.iter().map(|row| row.iter().sum::<f64>() / columns_n).collect();
        let of_column: Vec<f64> =
            (0..k).map(|j| rows.iter().map(|row| row[j]).sum::<f64>() / rows_n).collect();
        let square = |values: &[f64]| values.iter().map(|v| (v - grand) * (v - grand)).sum::<f64>();
        let mut rest = 0.0;
        for (row, mean) in rows.iter().zip(&of_row) {
            for (value, column) in row.iter().zip(&of_column) {
                rest += (value - mean - column + grand).powi(2);
            }
        }
        Some(Variance {
            size: [n, k],
            mean_squares: [
                columns_n * square(&of_row) / (rows_n - 1.0),
                rows_n * square(&of_column) / (columns_n - 1.0),
                rest / ((rows_n - 1.0) * (columns_n - 1.0)),
            ],
        })
    }

    /// ICC(A,1), which is ICC(2,1) of Shrout and Fleiss: absolute agreement of single marks, operators taken
    /// as drawn at random from those who might have marked. With its 95 % interval. McGraw and Wong, Forming
    /// inferences about some intraclass correlation coefficients, Psychological Methods 1, 1996, tables 4 and
    /// 7. `None` where all values are equal.
    pub fn absolute_agreement(&self) -> Option<Estimate> {
        let [n, k] = self.size.map(|size| size as f64);
        let [rows, columns, rest] = self.mean_squares;
        let value = (rows - rest) / (rows + (k - 1.0) * rest + k * (columns - rest) / n);
        if !value.is_finite() {
            return None;
        }
        if value >= 1.0 {
            return Some(Estimate { value: 1.0, low: 1.0, high: 1.0 });
        }
        let a = k * value / (n * (1.0 - value));
        let b = 1.0 + k * value * (n - 1.0) / (n * (1.0 - value));
        let freedom = (a * columns + b * rest).powi(2)
            / ((a * columns).powi(2) / (k - 1.0) + (b * rest).powi(2) / ((n - 1.0) * (k - 1.0)));
        if !freedom.is_finite() {
            return None;
        }
        let between = k * columns + (k * n - k - n) * rest;
        let lower = fisher_quantile(0.975, n - 1.0, freedom);
        let upper = fisher_quantile(0.975, freedom, n - 1.0);
        Some(Estimate {
            value,
            low: n * (rows - lower * rest) / (lower * between + n * rows),
            high: n * (upper * rows - rest) / (between + n * upper * rows),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::test_noise::Noise;

    /// Shrout and Fleiss, Intraclass correlations, Psychological Bulletin 86, 1979, tables 2 to 4: the mean
    /// squares and ICC(2,1) are printed there with two decimals; the interval is that of the R package psych
    /// (0.019 to 0.761).
    #[test]
    fn the_example_of_shrout_and_fleiss() {
        let rows = [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]];
        let rows: Vec<Vec<f64>> = rows.iter().map(|row| row.map(f64::from).to_vec()).collect();
        let variance = Variance::of(&rows).unwrap();
        for (found, printed) in variance.mean_squares.iter().zip([11.24, 32.49, 1.02]) {
            assert!((found - printed).abs() < 0.005, "{found} {printed}");
        }
        let icc = variance.absolute_agreement().unwrap();
        assert!((icc.value - 0.29).abs() < 0.005, "{icc:?}");
        assert!((icc.low - 0.019).abs() < 6e-4 && (icc.high - 0.761).abs() < 6e-4, "{icc:?}");
    }

    #[test]
    fn edges() {
        assert_eq!(Variance::of(&[]), None);
        assert_eq!(Variance::of(&[vec![1.0, 2.0]]), None);
        assert_eq!(Variance::of(&[vec![1.0], vec![2.0]]), None);
        assert_eq!(Variance::of(&[vec![1.0, 2.0], vec![2.0]]), None);
        let same = Variance::of(&[vec![5.0, 5.0], vec![5.0, 5.0]]).unwrap();
        assert_eq!(same.absolute_agreement(), None);
        let exact = Variance::of(&[vec![1.0, 1.0], vec![5.0, 5.0]]).unwrap();
        assert_eq!(exact.absolute_agreement(), Some(Estimate { value: 1.0, low: 1.0, high: 1.0 }));
    }

    /// Objects with sd 4, operators with bias of sd 1 and noise of sd 2: the correlation is 16 / 21. Of 400
    /// jobs of 40 frames and 5 operators, a share of 0.95 has a standard error of 0.011; three of them and
    /// 0.015 for the approximate interval are the bounds.
    #[test]
    fn the_interval_covers() {
        let mut noise = Noise(9);
        let mut inside = 0;
        for _ in 0..400 {
            let biases: Vec<f64> = (0..5).map(|_| noise.normal()).collect();
            let rows: Vec<Vec<f64>> = (0..40)
                .map(|_| {
                    let place = 4.0 * noise.normal();
                    biases.iter().map(|bias| place + bias + 2.0 * noise.normal()).collect()
                })
                .collect();
            let icc = Variance::of(&rows).unwrap().absolute_agreement().unwrap();
            inside += usize::from((icc.low..=icc.high).contains(&(16.0 / 21.0)));
        }
        let share = inside as f64 / 400.0;
        assert!((share - 0.95).abs() < 0.033 + 0.015, "{share}");
    }
}
