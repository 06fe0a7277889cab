//! The cheapest one-to-one pairing of rows and columns, and the cheapest plan to move amounts between them.
//!
//! Pairings: shortest augmenting paths with dual prices, O(rows^2 columns): R. Jonker and A. Volgenant, "A shortest augmenting
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
        return Err(Error::Shape { what: "costs", found: cost.len(), expected });
    }
    all_finite("cost", cost)?;
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

/// The least cost of moving all of `supply` (per row) to where it meets `demand` (per column), `cost` being that of one
/// unit, row-major: the transport problem, of which [`assign`] is the case of unit amounts. Of the two totals, which
/// have to be equal but for rounding, the smaller is moved.
///
/// Successive shortest paths through what is still free, O(rows columns (rows + columns)) for each of them: meant for
/// small problems (R. K. Ahuja, T. L. Magnanti, J. B. Orlin, Network Flows, 1993, section 9.7).
///
/// # Errors
/// [`Error::Shape`] when `cost` has another size, [`Error::NotFinite`] for a number that is not finite,
/// [`Error::OutOfRange`] for a negative amount or for totals that differ by more than 1e-9 of them.
pub fn transport(cost: &[f64], supply: &[f64], demand: &[f64]) -> Result<f64> {
    let (rows, columns) = (supply.len(), demand.len());
    let expected = rows.saturating_mul(columns);
    if cost.len() != expected {
        return Err(Error::Shape { what: "costs", found: cost.len(), expected });
    }
    all_finite("cost", cost)?;
    for (what, amounts) in [("supply", supply), ("demand", demand)] {
        all_finite(what, amounts)?;
        if let Some(&value) = amounts.iter().find(|amount| **amount < 0.0) {
            return Err(Error::OutOfRange { what, value, needs: "it must not be negative" });
        }
    }
    let (total, value) = (supply.iter().sum::<f64>(), demand.iter().sum::<f64>());
    if (total - value).abs() > 1e-9 * total.max(value) {
        return Err(Error::OutOfRange {
            what: "total demand",
            value,
            needs: "it must equal the total supply",
        });
    }
    // Amounts and gains below these are rounding: following them would go round in circles.
    let dust = 1e-14 * total;
    let grain = 1e-13 * cost.iter().fold(0.0, |most: f64, c| most.max(c.abs()));
    let (mut supply, mut demand) = (supply.to_vec(), demand.to_vec());
    let mut moved = vec![0.0; expected];
    loop {
        // Shortest ways (Bellman and Ford) from the rows that have something left: forward at the cost of a unit,
        // back at its refund.
        let mut to_row: Vec<f64> =
            supply.iter().map(|left| if *left > dust { 0.0 } else { f64::INFINITY }).collect();
        let mut to_column = vec![f64::INFINITY; columns];
        let (mut row_before, mut column_before) = (vec![None; columns], vec![None; rows]);
        let mut better = true;
        while std::mem::take(&mut better) {
            for (r, c) in (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c))) {
                let unit = cost[r * columns + c];
                if to_row[r] + unit < to_column[c] - grain {
                    (to_column[c], row_before[c], better) = (to_row[r] + unit, Some(r), true);
                }
                if moved[r * columns + c] > dust && to_column[c] - unit < to_row[r] - grain {
                    (to_row[r], column_before[r], better) = (to_column[c] - unit, Some(c), true);
                }
            }
        }
        let open = (0..columns).filter(|c| demand[*c] > dust && to_column[*c] < f64::INFINITY);
        let Some(last) = open.min_by(|a, b| to_column[*a].total_cmp(&to_column[*b])) else { break };
        let mut way = Vec::new();
        let (mut amount, mut column) = (demand[last], last);
        while let Some(row) = row_before[column] {
            way.push((row, column, 1.0));
            match column_before[row] {
                Some(before) => {
                    way.push((row, before, -1.0));
                    amount = amount.min(moved[row * columns + before]);
                    column = before;
                }
                None => {
                    amount = amount.min(supply[row]);
                    supply[row] -= amount;
                    break;
                }
            }
        }
        demand[last] -= amount;
        way.iter().for_each(|(row, column, sign)| moved[row * columns + column] += sign * amount);
    }
    Ok(moved.iter().zip(cost).map(|(amount, unit)| amount * unit).sum())
}

/// The (row, column) pairs of an assignment.
pub fn pairs(column_of_row: &[Option<usize>]) -> impl Iterator<Item = (usize, usize)> {
    column_of_row.iter().enumerate().filter_map(|(r, c)| c.map(|c| (r, c)))
}

fn all_finite(what: &'static str, values: &[f64]) -> Result<()> {
    values.iter().try_for_each(|value| Error::finite(what, *value).map(drop))
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

        /// Whole amounts are as many units: their transport is the pairing of these units.
        #[test]
        fn transport_is_the_pairing_of_units(
            (cost, supply, demand) in (1_usize..5, 1_usize..5).prop_flat_map(|(r, c)| {
                let amounts = |n| prop::collection::vec(0_usize..4, n);
                (prop::collection::vec(-20.0..50.0, r * c), amounts(r), amounts(c))
            })
        ) {
            let (mut supply, mut demand): (Vec<usize>, Vec<usize>) = (supply, demand);
            let (a, b) = (supply.iter().sum::<usize>(), demand.iter().sum::<usize>());
            supply[0] += b.saturating_sub(a);
            demand[0] += a.saturating_sub(b);
            let units = |amounts: &[usize]| -> Vec<usize> {
                amounts.iter().enumerate().flat_map(|(at, n)| vec![at; *n]).collect()
            };
            let (rows, columns) = (units(&supply), units(&demand));
            let of_units: Vec<f64> = rows
                .iter()
                .flat_map(|r| columns.iter().map(|c| (*r, *c)))
                .map(|(r, c)| cost[r * demand.len() + c])
                .collect();
            let pairing = assign(&of_units, rows.len(), columns.len()).unwrap();
            let real = |amounts: &[usize]| -> Vec<f64> { amounts.iter().map(|n| *n as f64).collect() };
            let found = transport(&cost, &real(&supply), &real(&demand)).unwrap();
            // Gains below 1e-13 of the largest cost are left: at most 24 units of them, and as much in rounding.
            prop_assert!((found - pairing.cost).abs() <= 1e-9, "{} {}", found, pairing.cost);
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
        assert!(matches!(assign(&[1.0, f64::NAN], 1, 2), Err(Error::NotFinite { what: "cost", .. })));
        let refused =
            |cost: &[f64], supply: &[f64], demand: &[f64]| transport(cost, supply, demand).unwrap_err();
        assert!(matches!(refused(&[1.0], &[1.0], &[0.5, 0.5]), Error::Shape { found: 1, expected: 2, .. }));
        assert!(matches!(refused(&[1.0], &[1.0], &[f64::INFINITY]), Error::NotFinite { what: "demand", .. }));
        assert!(matches!(refused(&[1.0; 2], &[1.0], &[2.0, -1.0]), Error::OutOfRange { what: "demand", .. }));
        assert!(matches!(refused(&[1.0], &[1.0], &[0.9]), Error::OutOfRange { what: "total demand", .. }));
    }

    /// By hand: .6 and .4 to .5, .3 and .2. The first row keeps .5 where it costs nothing and sends .1 on at 1; the
    /// second keeps .3 for nothing and sends .1 at 2.
    #[test]
    fn shares_are_moved_by_hand() {
        let cost = [0.0, 1.0, 4.0, 5.0, 0.0, 2.0];
        let found = transport(&cost, &[0.6, 0.4], &[0.5, 0.3, 0.2]).unwrap();
        assert!((found - (0.1 * 1.0 + 0.2 * 2.0)).abs() < 1e-14, "{found}");
        assert_eq!(transport(&[], &[], &[]), Ok(0.0));
    }
}
