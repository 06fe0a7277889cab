//! A bar for those who wait.

use crate::console::Console;
use indicatif::{ProgressBar, ProgressStyle};
use std::time::{Duration, Instant};

/// Work under way. It shows on a terminal only, and only when the work lasts longer than a second.
#[derive(Debug)]
pub struct Progress {
    what: &'static str,
    total: Option<u64>,
    done: u64,
    since: Instant,
    watched: bool,
    rate: bool,
    bar: Option<ProgressBar>,
}

const PATIENCE: Duration = Duration::from_secs(1);
const KNOWN: &str = "{wide_bar} {percent} % of {len} {msg}, {eta} left";
const UNKNOWN: &str = "{spinner} {pos} {msg}, {elapsed}";
const RATE: &str = ", {per_sec}";

impl Progress {
    /// Work of `total` units, if that is known; `what` names the unit in the plural ("measurements").
    pub fn new(console: &Console, what: &'static str, total: Option<u64>) -> Progress {
        Progress {
            what,
            total,
            done: 0,
            since: Instant::now(),
            watched: console.watched(),
            rate: false,
            bar: None,
        }
    }

    /// Shows how many units are done in a second, too.
    #[must_use]
    pub fn with_rate(mut self) -> Progress {
        self.rate = true;
        self
    }

    /// Says that `count` more units are done.
    pub fn advance(&mut self, count: u64) {
        self.done += count;
        if let Some(bar) = &self.bar {
            bar.set_position(self.done);
        } else if self.watched && self.since.elapsed() > PATIENCE {
            self.bar = Some(self.show());
        }
    }

    fn show(&self) -> ProgressBar {
        let (bar, template) = match self.total {
            Some(total) => (ProgressBar::new(total), KNOWN),
            None => (ProgressBar::no_length(), UNKNOWN),
        };
        // A template that does not parse costs the looks of the bar, not the run.
        let template = if self.rate { format!("{template}{RATE}") } else { template.to_owned() };
        let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
        bar.set_style(style);
        bar.set_message(self.what);
        bar.set_position(self.done);
        // What was done before the bar appeared counts for its forecast.
        bar.with_elapsed(self.since.elapsed())
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_is_for_watchers_of_long_work_only() {
        let progress = |watched, since| Progress {
            what: "rows",
            total: Some(9),
            done: 0,
            since,
            watched,
            rate: true,
            bar: None,
        };
        let long_ago = Instant::now().checked_sub(2 * PATIENCE).unwrap();
        for (watched, since, shown) in
            [(true, long_ago, true), (false, long_ago, false), (true, Instant::now(), false)]
        {
            let mut progress = progress(watched, since);
            progress.advance(4);
            assert_eq!(progress.bar.as_ref().map(ProgressBar::position), shown.then_some(4));
        }
    }

    #[test]
    fn both_templates_are_understood() {
        for template in
            ["{wide_bar} {percent} % of {len} {msg}, {eta} left", "{spinner} {pos} {msg}, {elapsed}"]
        {
            assert!(ProgressStyle::with_template(template).is_ok());
            assert!(ProgressStyle::with_template(&format!("{template}{RATE}")).is_ok());
        }
    }
}
