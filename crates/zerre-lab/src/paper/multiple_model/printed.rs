//! What the thesis prints. Nothing here is used for anything but to stand beside our own numbers.

use super::contenders::{Algorithm, Cell, Reading, Wsms};
use super::settings::{NOISES, Setting};
use std::collections::HashMap;

const TABLES: &str = include_str!("../../../data/ucar-mmpf-tables.csv");
const IMM: &str = include_str!("../../../data/ucar-imm-table-6.13.csv");
const SUSPECT: &str = include_str!("../../../data/ucar-suspect-cells.csv");

/// A printed pair of error and time.
#[derive(Clone, Debug, PartialEq)]
pub struct Printed {
    /// Root mean square error, km.
    pub rmse: Number,
    /// Time of a run in MATLAB in 2012, s.
    pub seconds: Number,
}

/// A printed number, as it is to be read.
#[derive(Clone, Debug, PartialEq)]
pub struct Number {
    /// What it says; corrected where another table shows what was meant.
    pub value: f64,
    /// Why it cannot be right as it is printed.
    pub doubt: Option<String>,
    /// Whether `value` can be used all the same.
    pub usable: bool,
}

/// Place of a cell: table, name of the algorithm, noise and particles as they are written.
type Place = (String, String, String, String);

/// The tables of the thesis.
#[derive(Clone, Debug)]
pub struct Thesis {
    cells: HashMap<Place, Printed>,
    suspects: Vec<String>,
}

/// A line of the data that is not what it should be.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{table}, line {line}: {what}")]
pub struct Damaged {
    /// Name of the data.
    pub table: &'static str,
    /// Line, from 1.
    pub line: usize,
    /// What is wrong.
    pub what: String,
}

fn lines<const N: usize>(
    table: &'static str,
    text: &str,
) -> impl Iterator<Item = Result<(usize, [String; N]), Damaged>> {
    text.lines().enumerate().skip(1).map(move |(at, line)| {
        let fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        let what = format!("{} fields, {N} are needed", fields.len());
        let fields = fields.try_into().map_err(|_| Damaged { table, line: at + 1, what })?;
        Ok((at + 1, fields))
    })
}

fn number(table: &'static str, line: usize, text: &str) -> Result<f64, Damaged> {
    let damaged = || Damaged { table, line, what: format!("`{text}` is no number") };
    text.parse().ok().filter(|value: &f64| value.is_finite()).ok_or_else(damaged)
}

impl Thesis {
    /// The tables as they are kept with the program.
    ///
    /// # Errors
    /// Damaged data.
    pub fn read() -> Result<Thesis, Damaged> {
        let mut cells = HashMap::new();
        let plain = |value| Number { value, doubt: None, usable: true };
        for row in lines::<8>("tables 6.1 to 6.9", TABLES) {
            let (line, [table, _, _, algorithm, noise, particles, rmse, seconds]) = row?;
            let value = |text: &str| number("tables 6.1 to 6.9", line, text).map(plain);
            let printed = Printed { rmse: value(&rmse)?, seconds: value(&seconds)? };
            if cells.insert((table, algorithm, noise, particles), printed).is_some() {
                return Err(Damaged { table: "tables 6.1 to 6.9", line, what: "a second time".into() });
            }
        }
        for row in lines::<4>("table 6.13", IMM) {
            let (line, [scenario, noise, rmse, seconds]) = row?;
            let doubt = "the thesis gave this filter other measurements: positions whose error does not grow with range";
            let value = |text: &str| {
                let value = number("table 6.13", line, text)?;
                Ok(Number { value, doubt: Some(doubt.to_owned()), usable: false })
            };
            let printed = Printed { rmse: value(&rmse)?, seconds: value(&seconds)? };
            cells.insert(("6.13".to_owned(), scenario, noise, "0".to_owned()), printed);
        }
        let mut suspects = Vec::new();
        for row in lines::<7>("suspect cells", SUSPECT) {
            let (line, [table, algorithm, noise, particles, column, read_as, reason]) = row?;
            let damaged = |what: &str| Damaged { table: "suspect cells", line, what: what.to_owned() };
            let place = format!("{table}, {algorithm}, {particles} particles, noise {noise}, {column}");
            let cell = cells.get_mut(&(table, algorithm, noise, particles));
            let cell = cell.ok_or_else(|| damaged("there is no such cell"))?;
            let number = match column.as_str() {
                "rmse" => &mut cell.rmse,
                "seconds" => &mut cell.seconds,
                _ => return Err(damaged("there is no such column")),
            };
            if !read_as.is_empty() {
                number.value = self::number("suspect cells", line, &read_as)?;
            }
            number.usable = !read_as.is_empty();
            suspects.push(format!("{place}: {reason}"));
            number.doubt = Some(reason);
        }
        Ok(Thesis { cells, suspects })
    }

    /// The numbers that are marked, with the reasons; those of table 6.13 apart, all of which are.
    pub fn suspects(&self) -> &[String] {
        &self.suspects
    }

    /// What the thesis prints for a cell, where it does.
    pub fn printed(&self, cell: &Cell) -> Option<&Printed> {
        if cell.setting != Setting::Reference || cell.reading != Reading::Equal {
            return None;
        }
        let scenario = cell.scenario + 1;
        let (table, name) = match (cell.algorithm, cell.wsms) {
            (Algorithm::Alg1, Wsms::None) => (format!("6.{scenario}"), "Algorithm 1".to_owned()),
            (Algorithm::Alg2, Wsms::None) => (format!("6.{scenario}"), "Algorithm 2".to_owned()),
            (Algorithm::Alg3, Wsms::None) => (format!("6.{scenario}"), "Algorithm 3".to_owned()),
            (Algorithm::Alg2Wsms, wsms) => (table_of(wsms, scenario)?, "Algorithm 2 + WSMS".to_owned()),
            (Algorithm::Alg3Wsms, wsms) => (table_of(wsms, scenario)?, "Algorithm 3 + WSMS".to_owned()),
            (Algorithm::ImmUkf | Algorithm::ImmEkf, Wsms::None) => ("6.13".to_owned(), scenario.to_string()),
            _ => return None,
        };
        let place = (table, name, NOISES[cell.noise].to_string(), cell.particles.to_string());
        self.cells.get(&place)
    }
}

fn table_of(wsms: Wsms, scenario: usize) -> Option<String> {
    match wsms {
        Wsms::None => None,
        Wsms::SemiDynamic => Some(format!("6.{scenario}")),
        Wsms::Dynamic => Some(format!("6.{}", scenario + 6)),
    }
}

#[cfg(test)]
mod tests {
    use super::super::settings::PARTICLES;
    use super::*;

    fn cell(scenario: usize, algorithm: Algorithm, wsms: Wsms, particles: usize, noise: usize) -> Cell {
        let (setting, reading) = (Setting::Reference, Reading::Equal);
        Cell { scenario, algorithm, wsms, particles, noise, setting, reading }
    }

    #[test]
    fn all_cells_of_the_thesis_are_read() {
        let thesis = Thesis::read().unwrap();
        assert_eq!(thesis.cells.len(), 720 + 12);
        assert_eq!(thesis.suspects().len(), SUSPECT.lines().count() - 1);
        let marked =
            |p: &Printed| usize::from(p.rmse.doubt.is_some()) + usize::from(p.seconds.doubt.is_some());
        let marks: usize = thesis.cells.values().map(marked).sum();
        assert_eq!(marks, thesis.suspects().len() + 2 * 12);
        // Every cell of the grid has its printed pair.
        for scenario in 0..3 {
            for noise in 0..NOISES.len() {
                for particles in PARTICLES {
                    let printed = |a, w| thesis.printed(&cell(scenario, a, w, particles, noise)).is_some();
                    for algorithm in [Algorithm::Alg1, Algorithm::Alg2, Algorithm::Alg3] {
                        assert!(printed(algorithm, Wsms::None));
                    }
                    for wsms in [Wsms::SemiDynamic, Wsms::Dynamic] {
                        assert!(printed(Algorithm::Alg2Wsms, wsms) && printed(Algorithm::Alg3Wsms, wsms));
                    }
                    assert!(!printed(Algorithm::ImmPf, Wsms::None));
                }
                assert!(thesis.printed(&cell(scenario, Algorithm::ImmUkf, Wsms::None, 0, noise)).is_some());
            }
        }
    }

    /// The one that would read as six thousand seconds, one that no other table explains, and one that is right.
    #[test]
    fn suspect_numbers_are_marked_and_read_as_meant() {
        let thesis = Thesis::read().unwrap();
        let lost = thesis.printed(&cell(1, Algorithm::Alg3, Wsms::None, 1000, 2)).unwrap();
        assert!(lost.seconds.usable && lost.seconds.value < 1.0 && lost.seconds.doubt.is_some());
        let copied = thesis.printed(&cell(0, Algorithm::Alg3Wsms, Wsms::Dynamic, 5000, 1)).unwrap();
        assert!(!copied.rmse.usable && !copied.seconds.usable);
        let sound = thesis.printed(&cell(0, Algorithm::Alg1, Wsms::None, 1000, 0)).unwrap();
        assert!(sound.rmse.usable && sound.rmse.doubt.is_none());
        // What differs between the two printings of algorithms 1 to 3 is suspect in one of them.
        for ((table, algorithm, noise, particles), first) in &thesis.cells {
            let Some(scenario) = table.strip_prefix("6.").and_then(|s| s.parse::<u8>().ok()) else {
                continue;
            };
            let again = (format!("6.{}", scenario + 6), algorithm.clone(), noise.clone(), particles.clone());
            if !algorithm.starts_with("Algorithm") || algorithm.ends_with("WSMS") || scenario > 3 {
                continue;
            }
            let second = &thesis.cells[&again];
            for (a, b) in [(&first.rmse, &second.rmse), (&first.seconds, &second.seconds)] {
                assert!(a.value == b.value || a.doubt.is_some() || b.doubt.is_some(), "{again:?}");
            }
        }
    }
}
