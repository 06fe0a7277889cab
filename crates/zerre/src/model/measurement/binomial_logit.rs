//! Counts of successes with a log-odds that wanders (Temereanca, Brown and Simons, Journal of Neuroscience
//! 28, 2008).

use crate::error::{Error, Result};
use crate::math::{Real, ln_gamma};
use crate::model::Measurement;
use crate::time::Time;

/// z ~ Binomial(n, 1 / (1 + e^-x)): of `n` trials, z succeed. Values are `[z]`, whole numbers. Not of the
/// form h(x) + v: the Kalman family does not take it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BinomialLogit {
    trials: f64,
}

/// A count, digested.
#[derive(Clone, Copy, Debug)]
pub struct BinomialLogitGiven {
    count: f64,
    trials: f64,
    constant: f64,
}

impl BinomialLogit {
    /// Counts out of `trials`, one at least.
    ///
    /// # Errors
    /// No trials.
    pub fn new(trials: u32) -> Result<Self> {
        Ok(BinomialLogit { trials: Error::positive("number of trials", f64::from(trials))? })
    }
}

impl<const N: usize> Measurement<N> for BinomialLogit {
    type Value = [f64; 1];
    type Given<'z> = BinomialLogitGiven;

    fn given(&self, &[count]: &[f64; 1], _: Time) -> Result<BinomialLogitGiven> {
        let trials = self.trials;
        if !(0.0..=trials).contains(&Error::finite("measured count", count)?) || count.fract() != 0.0 {
            let needs = "it must be a whole number from 0 to the number of trials";
            return Err(Error::OutOfRange { what: "measured count", value: count, needs });
        }
        let constant = ln_gamma(trials + 1.0) - ln_gamma(count + 1.0) - ln_gamma(trials - count + 1.0);
        Ok(BinomialLogitGiven { count, trials, constant })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &BinomialLogitGiven, x: [R; N]) -> R {
        x[0] * given.count - x[0].log_add_exp(x[0].constant(0.0)) * given.trials + given.constant
    }
}
