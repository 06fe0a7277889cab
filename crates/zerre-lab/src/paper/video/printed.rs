//! Tables 1 to 3 of the paper. Nothing here is used for anything but to stand beside our own numbers.

use std::error::Error;

const TABLES: &str = include_str!("../../../data/video-tables.csv");

/// A printed error.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// `1`, `2` or `3`.
    pub table: &'static str,
    /// Name of the sequence.
    pub sequence: &'static str,
    /// The frame up to which the error is taken; `None` for all of them.
    pub frame: Option<usize>,
    /// Tracker, named as here.
    pub tracker: String,
    /// Root mean square error, px.
    pub rmse_px: f64,
}

/// The printed errors, in their order.
#[derive(Clone, Debug, PartialEq)]
pub struct Printed(Vec<Cell>);

impl Printed {
    /// The tables as they are kept with the program.
    ///
    /// # Errors
    /// Damaged data.
    pub fn read() -> Result<Printed, Box<dyn Error>> {
        let mut lines = TABLES.lines();
        let trackers: Vec<String> =
            lines.next().unwrap_or_default().split(',').skip(3).map(str::to_lowercase).collect();
        let mut cells = Vec::new();
        for line in lines {
            let damaged = || format!("tables of the paper: `{line}`");
            let parts: Vec<&str> = line.split(',').collect();
            let [table, sequence, frame, errors @ ..] = &parts[..] else { return Err(damaged().into()) };
            if errors.len() != trackers.len() {
                return Err(damaged().into());
            }
            let frame = match *frame {
                "" => None,
                frame => Some(frame.parse().map_err(|_| damaged())?),
            };
            for (tracker, error) in trackers.iter().zip(errors) {
                let rmse_px = error.parse().ok().filter(|e: &f64| e.is_finite()).ok_or_else(damaged)?;
                cells.push(Cell { table, sequence, frame, tracker: tracker.clone(), rmse_px });
            }
        }
        Ok(Printed(cells))
    }

    /// The cells of a table.
    pub fn of_table<'a>(&'a self, table: &'a str) -> impl Iterator<Item = &'a Cell> {
        self.0.iter().filter(move |cell| cell.table == table)
    }

    /// Names of the sequences of a table, in their order.
    pub fn sequences(&self, table: &str) -> Vec<&'static str> {
        let mut names: Vec<_> = self.of_table(table).map(|cell| cell.sequence).collect();
        names.dedup();
        names
    }

    /// The frames at which a table gives errors of a sequence.
    pub fn frames(&self, table: &str, sequence: &str) -> Vec<usize> {
        let of = self.of_table(table).filter(|cell| cell.sequence == sequence);
        let mut frames: Vec<_> = of.filter_map(|cell| cell.frame).collect();
        frames.dedup();
        frames
    }

    /// What is printed of a tracker.
    pub fn rmse(&self, table: &str, sequence: &str, frame: Option<usize>, tracker: &str) -> Option<f64> {
        let mut of = self.of_table(table);
        let is = |c: &&Cell| c.sequence == sequence && c.frame == frame && c.tracker == tracker;
        of.find(is).map(|cell| cell.rmse_px)
    }

    /// The trackers, in their order.
    pub fn trackers(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for cell in &self.0 {
            if !names.contains(&cell.tracker.as_str()) {
                names.push(&cell.tracker);
            }
        }
        names
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_is_there_and_every_tracker_is_one_of_ours() {
        let printed = Printed::read().unwrap();
        assert_eq!(printed.trackers(), ["rt", "frt", "ssim", "ssimfahe", "massimahe"]);
        assert!(printed.trackers().iter().all(|name| zerre_vision::tracker::find(name).is_some()));
        for (table, sequences, frames) in [("1", 1, 8), ("2", 1, 8), ("3", 5, 0)] {
            let names = printed.sequences(table);
            assert_eq!(names.len(), sequences);
            for name in names {
                let at = printed.frames(table, name);
                assert_eq!(at.len(), frames);
                assert!(at.is_sorted() && at.iter().all(|frame| *frame > 0));
            }
            let cells = sequences * frames.max(1) * 5;
            assert_eq!(printed.of_table(table).filter(|cell| cell.rmse_px > 1.0).count(), cells);
        }
        assert!(printed.rmse("3", "Girl", None, "rt").is_some());
        assert_eq!(printed.rmse("3", "Girl", Some(5), "rt"), None);
    }
}
