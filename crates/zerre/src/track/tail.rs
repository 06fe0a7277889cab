//! The law of a sensor's errors, chosen at run time.

use crate::error::Result;
use crate::model::measurement::{HeavyTailed, HeavyTailedGiven};
use serde::{Deserialize, Serialize};

/// A law of errors with heavier tails than the normal one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Robust {
    /// Student's t with these degrees of freedom ([`HeavyTailed::student_t`]).
    StudentT {
        /// Degrees of freedom.
        dof: f64,
    },
    /// A share of the measurements errs `scale` times more ([`HeavyTailed::outliers`]).
    Outliers {
        /// That share, from 0 to below 1.
        share: f64,
        /// Factor on its standard deviation, at least 1.
        scale: f64,
    },
}

/// A sensor model under one of the laws.
pub(super) type Tail<H, const M: usize> = HeavyTailed<H, M>;

/// A measurement under one of the laws, digested.
pub(super) type TailGiven<G> = HeavyTailedGiven<G>;

impl<H, const M: usize> Tail<H, M> {
    pub(super) fn new(model: H, robust: Option<Robust>) -> Result<Self> {
        match robust {
            None => Ok(HeavyTailed::normal(model)),
            Some(Robust::StudentT { dof }) => HeavyTailed::student_t(model, dof),
            // No outliers, or outliers like the others.
            Some(Robust::Outliers { share, scale }) if share == 0.0 || scale == 1.0 => {
                Ok(HeavyTailed::normal(model))
            }
            Some(Robust::Outliers { share, scale }) => HeavyTailed::outliers(model, share, scale),
        }
    }
}
