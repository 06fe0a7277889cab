//! What experiments share: cells of a grid that are computed one by one, kept, gone on with later, and made
//! rows, tables and a page of in the end.

use super::table::Table;
use crate::report::study::StudyReport;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use zerre::Result;

/// A grid of work. An outcome depends on the experiment and its cell alone, so that neither the number of
/// threads nor an interruption changes it.
pub trait Experiment: Sync {
    /// One piece of the work; the order is that of the rows.
    type Cell: Clone + Ord + Send + Sync;
    /// What became of it: it is saved as it is, for a run that goes on later.
    type Outcome: Serialize + DeserializeOwned + Send;
    /// Times of filters that took turns, once nothing else runs; `()` where none are taken.
    type Timing;
    /// One number for machines.
    type Row: Serialize;

    /// What [`Experiment::cost`] counts, in the plural.
    const UNIT: &'static str;

    /// All of the work.
    fn cells(&self) -> Vec<Self::Cell>;

    /// The cell in words: the name under which its outcome is kept.
    fn key(&self, cell: &Self::Cell) -> String;

    /// About how much work it is: the longest begins first, and a bar shows the sum.
    fn cost(&self, cell: &Self::Cell) -> u64;

    /// Does a cell; `None` if `stop` says so meanwhile.
    ///
    /// # Errors
    /// What the library refuses and no outcome has a place for.
    fn work(&self, cell: &Self::Cell, stop: &dyn Fn() -> bool) -> Result<Option<Self::Outcome>>;

    /// Rounds of [`Experiment::time`]; none where there is nothing to time.
    fn rounds(&self) -> u64 {
        0
    }

    /// Takes times, in one thread and after all cells; `None` if `stop` says so meanwhile, or if there is
    /// nothing to time. `done` hears of each round.
    ///
    /// # Errors
    /// As [`Experiment::work`].
    fn time(&self, _stop: &dyn Fn() -> bool, _done: &mut dyn FnMut()) -> Result<Option<Self::Timing>> {
        Ok(None)
    }

    /// What the outcomes say. After an interruption some are missing.
    ///
    /// # Errors
    /// Damaged data that came with the program.
    fn finish(
        &self,
        outcomes: &BTreeMap<Self::Cell, Self::Outcome>,
        timing: Option<&Self::Timing>,
    ) -> std::result::Result<Finished<Self::Row>, Box<dyn std::error::Error>>;
}

/// What an experiment leaves behind.
#[derive(Clone, Debug, PartialEq)]
pub struct Finished<R> {
    /// Every number, for machines.
    pub rows: Vec<R>,
    /// Tables, each a file.
    pub tables: Vec<Table>,
    /// Further files, by name.
    pub files: Vec<(String, Vec<u8>)>,
    /// The page, still without its command line, its digest and the settings' origin.
    pub page: StudyReport,
    /// What did not go as planned.
    pub mishaps: Vec<Mishap>,
    /// All estimates in the order of the rows, times left out: their digest is that of the run.
    pub estimates: Vec<f64>,
}

/// Something that did not go as planned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mishap {
    /// What happened.
    pub what: &'static str,
    /// What was done about it.
    pub action: &'static str,
    /// How often.
    pub count: usize,
}

impl Mishap {
    /// Measurements that no particle, or no Gaussian, gave any likelihood.
    pub fn without_likelihood(count: usize) -> Mishap {
        Mishap { what: "measurement without likelihood", action: "the prediction stood", count }
    }

    /// Runs whose filter did not reach the end.
    pub fn refused(count: usize) -> Mishap {
        let action = "its last estimate stood to the end of the run";
        Mishap { what: "filter refused a step", action, count }
    }
}

/// The file of settings behind an experiment, so that a report can say by which, to the letter, it was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SettingsFile {
    /// Its place in the repository.
    pub path: &'static str,
    /// Its text, as compiled in.
    pub text: &'static str,
}
