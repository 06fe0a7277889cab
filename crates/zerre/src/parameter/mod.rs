//! Static parameters of models: what is not known of a motion or a sensor and does not change with time.
//!
//! A method asks for one thing only: the log-likelihood of all measurements at a value of the parameters, as
//! a closure of that value and of a [`Stream`]. [`log_likelihood`] gives it for any
//! [`Filter`]: exactly with a Kalman filter, as an estimate whose exponential is
//! unbiased with a particle filter.

mod chain;
mod gibbs;
mod law;
mod maximum;
mod nested;
mod online;
mod walk;

pub use chain::{Chain, ChainSettings, particle_metropolis_hastings};
pub use gibbs::{ExactDraw, GibbsChain, GibbsSettings, GivenPath, particle_gibbs};
pub use law::Law;
pub use maximum::{Maximum, maximum_likelihood};
pub use nested::{NestedSettings, NestedUpdate, SmcSquared};
pub use online::{EmSettings, EmTrace, online_em};

use crate::error::{Error, Result};
use crate::filter::Filter;
use crate::rng::{Draws, Stream};
use crate::time::Time;
use std::array::from_fn;
use std::borrow::Borrow;

/// The log-likelihood of `data`, measurements or their absence in the order of time, from a belief at
/// `start`: the sum of the [`log_evidence`](crate::filter::Update::log_evidence) of all steps. -inf once a
/// step is degenerate.
///
/// # Errors
/// Those of the filter.
pub fn log_likelihood<F: Filter, Z: Borrow<F::Measurement>>(
    filter: &F,
    start: Time,
    data: &[(Time, Option<Z>)],
    stream: Stream,
) -> Result<f64> {
    Ok(run(filter, start, data, stream)?.1)
}

/// The belief after all of `data`, or where a step was degenerate, and the log-likelihood.
fn run<F: Filter, Z: Borrow<F::Measurement>>(
    filter: &F,
    start: Time,
    data: &[(Time, Option<Z>)],
    stream: Stream,
) -> Result<(F::Belief, f64)> {
    let mut belief = filter.start(start, stream)?;
    let mut sum = 0.0;
    for (to, z) in data {
        sum += filter.step(&mut belief, *to, z.as_ref().map(Borrow::borrow))?.log_evidence;
        if sum == f64::NEG_INFINITY {
            break;
        }
    }
    Ok((belief, sum))
}

/// A parameter with what is known of it beforehand.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its prior.
    pub law: Law,
}

/// `K` parameters, independent beforehand. Methods move in coordinates that have no borders, one per
/// parameter (see [`Law`]).
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters<const K: usize> {
    list: [Parameter; K],
}

impl<const K: usize> Parameters<K> {
    /// Parameters by name and prior.
    ///
    /// # Errors
    /// No parameter, two of the same name, a law with parameters out of range.
    pub fn new(list: [(&str, Law); K]) -> Result<Self> {
        if K == 0 {
            return Err(Error::Shape { what: "parameters", found: 0, expected: 1 });
        }
        for (i, (name, law)) in list.iter().enumerate() {
            law.check()?;
            if list[..i].iter().any(|(other, _)| other == name) {
                return Err(Error::Unsupported(format!("two parameters are called {name:?}")));
            }
        }
        Ok(Parameters { list: list.map(|(name, law)| Parameter { name: name.to_owned(), law }) })
    }

    /// The parameters in order.
    pub fn list(&self) -> &[Parameter; K] {
        &self.list
    }

    /// Log-density of the prior; -inf outside it.
    pub fn log_prior(&self, theta: &[f64; K]) -> f64 {
        self.list.iter().zip(theta).map(|(parameter, &x)| parameter.law.log_density(x)).sum()
    }

    /// A draw from the prior.
    pub fn draw(&self, draws: &mut Draws) -> [f64; K] {
        from_fn(|k| self.list[k].law.draw(draws))
    }

    /// Coordinates without borders.
    ///
    /// # Errors
    /// A value on or beyond the border of its prior.
    fn free(&self, theta: &[f64; K]) -> Result<[f64; K]> {
        let mut free = [0.0; K];
        for k in 0..K {
            free[k] =
                Error::finite("value of a parameter in its own range", self.list[k].law.free(theta[k]))?;
        }
        Ok(free)
    }

    /// The values behind coordinates, and ln of the factor by which they stretch.
    fn bound(&self, free: &[f64; K]) -> ([f64; K], f64) {
        let both: [(f64, f64); K] = from_fn(|k| self.list[k].law.bound(free[k]));
        (both.map(|(x, _)| x), both.iter().map(|&(_, stretch)| stretch).sum())
    }
}
