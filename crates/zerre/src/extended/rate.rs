//! How many points a scan has.

use crate::error::{Error, Result};
use crate::math::{ln, ln_gamma};
use serde::{Deserialize, Serialize};

/// Gamma posterior of the mean number of points in a scan, which is Poisson given it: the count itself is negative
/// binomial, more spread than Poisson as long as the rate is not known (Granström and Orguner, IEEE TAES 48, 2012).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rate {
    /// Points seen, with those that the prior counts for.
    pub points: f64,
    /// Scans seen, with those that the prior counts for.
    pub scans: f64,
    /// What is kept of both from one scan to the next, in (0, 1]: 1 is a constant rate, .9 one that changes over
    /// some ten scans and counts that are over-dispersed by as much.
    pub keep: f64,
}

impl Rate {
    /// A rate of about `mean`, known as from `scans` scans.
    ///
    /// # Errors
    /// Numbers that are not positive; a `keep` above 1.
    pub fn new(mean: f64, scans: f64, keep: f64) -> Result<Rate> {
        Error::positive("rate of points", mean)?;
        Error::positive("scans behind a rate", scans)?;
        if Error::positive("share of a rate that is kept", keep)? > 1.0 {
            let needs = "it must not exceed 1";
            return Err(Error::OutOfRange { what: "share of a rate that is kept", value: keep, needs });
        }
        Ok(Rate { points: mean * scans, scans, keep })
    }

    /// Posterior mean.
    pub fn mean(&self) -> f64 {
        self.points / self.scans
    }

    /// The prediction for the next scan.
    pub fn predict(&mut self) {
        self.points *= self.keep;
        self.scans *= self.keep;
    }

    /// Takes in a scan of `count` points, or of as many as an expectation says.
    pub fn update(&mut self, count: f64) {
        self.points += count;
        self.scans += 1.0;
    }

    /// ln p of a scan of `count` points.
    pub fn log_probability(&self, count: usize) -> f64 {
        let (a, b, n) = (self.points, self.scans, count as f64);
        ln_gamma(a + n) - ln_gamma(a) - ln_gamma(n + 1.0) + a * ln(b / (b + 1.0)) - n * ln(b + 1.0)
    }
}
