//! Table 3.1 of the thesis. Nothing here is used for anything but to stand beside our own numbers.

use super::settings::BALLS;
use std::collections::BTreeMap;
use std::error::Error;

const TABLE: &str = include_str!("../../../data/multiball-table-3.1.csv");

/// The printed errors and seconds by number of particles.
#[derive(Clone, Debug, PartialEq)]
pub struct Printed(BTreeMap<usize, [f64; 4]>);

impl Printed {
    /// The table as it is kept with the program.
    ///
    /// # Errors
    /// Damaged data.
    pub fn read() -> Result<Printed, Box<dyn Error>> {
        let mut cells = BTreeMap::new();
        for (at, line) in TABLE.lines().enumerate().skip(1) {
            let damaged = || format!("table 3.1, line {}: `{line}`", at + 1);
            let (particles, numbers) = line.split_once(',').ok_or_else(damaged)?;
            let numbers: Vec<f64> = numbers.split(',').filter_map(|cell| cell.parse().ok()).collect();
            let numbers: [f64; 4] = numbers.try_into().map_err(|_| damaged())?;
            if numbers.iter().any(|number| !number.is_finite()) {
                return Err(damaged().into());
            }
            cells.insert(particles.parse().map_err(|_| damaged())?, numbers);
        }
        Ok(Printed(cells))
    }

    /// The numbers of particles.
    pub fn particles(&self) -> Vec<usize> {
        self.0.keys().copied().collect()
    }

    /// What is printed as the error of a ball.
    pub fn error(&self, particles: usize, ball: &str) -> Option<f64> {
        let at = BALLS.iter().position(|name| *name == ball)?;
        self.0.get(&particles)?.get(at).copied()
    }

    /// The printed seconds.
    pub fn seconds(&self, particles: usize) -> Option<f64> {
        self.0.get(&particles).map(|[.., seconds]| *seconds)
    }
}
