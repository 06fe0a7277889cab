//! Table 1 of the paper. Nothing here is used for anything but to stand beside our own numbers.

use std::collections::BTreeMap;
use std::error::Error;

const TABLE: &str = include_str!("../../../data/swarm-table-1.csv");

/// The printed errors, by steps, variance and algorithm.
#[derive(Clone, Debug, PartialEq)]
pub struct Printed(BTreeMap<(usize, u32, String), f64>);

impl Printed {
    /// The table as it is kept with the program.
    ///
    /// # Errors
    /// Damaged data.
    pub fn read() -> Result<Printed, Box<dyn Error>> {
        let mut cells = BTreeMap::new();
        for (at, line) in TABLE.lines().enumerate().skip(1) {
            let damaged = || format!("table 1, line {}: `{line}`", at + 1);
            let [steps, q, algorithm, rmse] = line.split(',').collect::<Vec<_>>()[..] else {
                return Err(damaged().into());
            };
            let rmse: f64 = rmse.parse().ok().filter(|rmse: &f64| rmse.is_finite()).ok_or_else(damaged)?;
            let place = (
                steps.parse().map_err(|_| damaged())?,
                q.parse().map_err(|_| damaged())?,
                algorithm.to_lowercase(),
            );
            if cells.insert(place, rmse).is_some() {
                return Err(damaged().into());
            }
        }
        Ok(Printed(cells))
    }

    /// What is printed of a cell, algorithms being named as here.
    pub fn rmse(&self, steps: usize, q: u32, algorithm: &str) -> Option<f64> {
        self.0.get(&(steps, q, algorithm.to_owned())).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::super::settings::{STEPS, VARIANCES};
    use super::*;

    #[test]
    fn every_cell_is_there() {
        let printed = Printed::read().unwrap();
        assert_eq!(printed.0.len(), 18);
        for steps in STEPS {
            for q in VARIANCES {
                for algorithm in ["pf", "pso-pf", "abc-pf"] {
                    assert!(printed.rmse(steps, q, algorithm).unwrap() > 1.0, "{steps} {q} {algorithm}");
                }
            }
        }
        assert_eq!(printed.rmse(50, 1, "bootstrap"), None);
    }
}
