//! The cheapest one-to-one pairing of rows and columns.
//!
//! Shortest augmenting paths with dual prices, O(rows^2 columns): R. Jonker and A. Volgenant, "A shortest augmenting
//! path algorithm for dense and sparse linear assignment problems", Computing 38, 1987.

use crate::error::{Error, Result};

/// A pairing that uses as many pairs as the shorter side has members.
#[derive(Clone, Debug, PartialEq)]
pub struct Assignment {
    /// Column of each row; `None` only where rows outnumber columns.
    pub column_of_row: Vec<Option<usize>>,
    /// Sum of the costs of the pairs.
    pub cost: f64,
}

/// The assignment of least total cost; `cost` is row-major, `rows` by `columns`, and may be rectangular or empty.
///
/// # Errors
/// [`Error::Shape`] when `cost` has another size, [`Error::NotFinite`] for a cost that is not finite.
pub fn assign(cost: &[f64], rows: usize, columns: usize) -> Result<Assignment> {
    let expected = rows.saturating_mul(columns);
    if cost.len() != expected {
        return Err(Error::Shape { what: "costs", index: 0, found: cost.len(), expected });
    }
    Error::all_finite("cost", cost)?;
    let column_of_row = if rows <= columns {
        match_rows(rows, columns, |r, c| cost[r * columns + c]).into_iter().map(Some).collect()
    } else {
        let mut columns_of_rows = vec![None; rows];
        for (c, r) in match_rows(columns, rows, |c, r| cost[r * columns + c]).into_iter().enumerate() {
            columns_of_rows[r] = Some(c);
        }
        columns_of_rows
    };
    let cost = pairs(&column_of_row).map(|(r, c)| cost[r * columns + c]).sum();
    Ok(Assignment { column_of_row, cost })
}

/// The (row, column) pairs of an assignment.
pub(crate) fn pairs(column_of_row: &[Option<usize>]) -> impl Iterator<Item = (usize, usize)> {
    column_of_row.iter().enumerate().filter_map(|(r, c)| c.map(|c| (r, c)))
}

/// Column of each row, for `rows <= columns`.
fn match_rows(rows: usize, columns: usize, cost: impl Fn(usize, usize) -> f64) -> Vec<usize> {
    const FREE: usize = usize::MAX;
    // Column `columns` is where every search starts: the row that looks for a partner sits there.
    let mut row_of_column = vec![FREE; columns + 1];
    let mut row_price = vec![0.0; rows];
    let mut column_price = vec![0.0; columns + 1];
    for row in 0..rows {
        row_of_column[columns] = row;
        let mut distance = vec![f64::INFINITY; columns];
        let mut came_from = vec![columns; columns];
        let mut visited = vec![false; columns + 1];
        let mut here = columns;
        while row_of_column[here] != FREE {
            visited[here] = true;
            let r = row_of_column[here];
            let (mut step, mut next) = (f64::INFINITY, here);
            for c in 0..columns {
                if visited[c] {
                    continue;
                }
                let reduced = cost(r, c) - row_price[r] - column_price[c];
                if reduced < distance[c] {
                    distance[c] = reduced;
                    came_from[c] = here;
                }
                if distance[c] < step {
                    step = distance[c];
                    next = c;
                }
            }
            for c in 0..=columns {
                if visited[c] {
                    row_price[row_of_column[c]] += step;
                    column_price[c] -= step;
                } else if c < columns {
                    distance[c] -= step;
                }
            }
            here = next;
        }
        while here != columns {
            row_of_column[here] = row_of_column[came_from[here]];
            here = came_from[here];
        }
    }
    let mut column_of_row = vec![0; rows];
    for (c, &r) in row_of_column[..columns].iter().enumerate() {
        if r != FREE {
            column_of_row[r] = c;
        }
    }
    column_of_row
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    /// The least cost over all ways to pair every member of the shorter side.
    fn brute_force(cost: &[f64], rows: usize, columns: usize) -> f64 {
        fn visit(row: usize, left: usize, used: &mut [bool], cost: &[f64], rows: usize) -> f64 {
            if left == 0 {
                return 0.0;
            }
            if row == rows {
                return f64::INFINITY;
            }
            let columns = used.len();
            let mut best =
                if rows > columns { visit(row + 1, left, used, cost, rows) } else { f64::INFINITY };
            for c in 0..columns {
                if !used[c] {
                    used[c] = true;
                    best = best.min(cost[row * columns + c] + visit(row + 1, left - 1, used, cost, rows));
                    used[c] = false;
                }
            }
            best
        }
        visit(0, rows.min(columns), &mut vec![false; columns], cost, rows)
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(11),
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        #[test]
        fn is_the_best_of_all_pairings(
            (rows, columns, cost) in (0_usize..6, 0_usize..6).prop_flat_map(|(r, c)| {
                (Just(r), Just(c), prop::collection::vec(-50.0..100.0, r * c))
            })
        ) {
            let found = assign(&cost, rows, columns).unwrap();
            // Two sums of at most five numbers below 100, each with four roundings of half an ulp of at most 500.
            let rounding = 8.0 * 0.5 * 500.0 * f64::EPSILON;
            prop_assert!((found.cost - brute_force(&cost, rows, columns)).abs() <= rounding);
            let mut seen: Vec<usize> = found.column_of_row.iter().flatten().copied().collect();
            prop_assert_eq!(seen.len(), rows.min(columns));
            seen.sort_unstable();
            seen.dedup();
            prop_assert_eq!(seen.len(), rows.min(columns), "a column was used twice");
        }

        #[test]
        fn ties_still_pair_everyone(rows in 1_usize..8, columns in 1_usize..8) {
            let found = assign(&vec![3.0; rows * columns], rows, columns).unwrap();
            prop_assert_eq!(found.cost, 3.0 * rows.min(columns) as f64);
        }
    }

    #[test]
    fn refuses_what_is_not_a_matrix_of_numbers() {
        assert!(matches!(assign(&[1.0; 5], 2, 3), Err(Error::Shape { found: 5, expected: 6, .. })));
        assert!(matches!(assign(&[1.0, f64::NAN], 1, 2), Err(Error::NotFinite { index: 1, .. })));
    }
}
