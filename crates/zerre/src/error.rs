//! What can go wrong, with the values that made it so.

use crate::time::Time;

/// Result of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A refusal. Degeneracies that a filter survives (all weights zero, a measurement outside the gate) are not
/// errors: they are the [`Outcome`](crate::filter::Outcome) of an update.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A NaN or an infinity where a number is needed.
    #[error("{what} is {value}: a finite number is needed")]
    NotFinite {
        /// What the number stands for.
        what: &'static str,
        /// The number.
        value: f64,
    },
    /// A parameter outside its range.
    #[error("{what} is {value}: {needs}")]
    OutOfRange {
        /// What the number stands for.
        what: &'static str,
        /// The number.
        value: f64,
        /// The range, as a sentence ("it must be positive").
        needs: &'static str,
    },
    /// A covariance that is not symmetric positive definite.
    #[error("{what} is not positive definite (pivot {pivot} of row {row})")]
    NotPositiveDefinite {
        /// Which matrix.
        what: &'static str,
        /// Row at which the factorisation stopped, from 0.
        row: usize,
        /// The pivot found there.
        pivot: f64,
    },
    /// A step back in time.
    #[error("a step from {from} s to {to} s goes back in time")]
    OutOfOrder {
        /// Time of the belief.
        from: Time,
        /// Time asked for.
        to: Time,
    },
    /// Text that is not a time.
    #[error("{text:?} is not a time in decimal seconds")]
    BadTime {
        /// The text.
        text: String,
    },
    /// Sizes that do not fit together.
    #[error("{what}: {found} found, {expected} expected")]
    Shape {
        /// What was counted.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// A combination that has no meaning (a density of degenerate noise, a linear filter on a nonlinear model).
    #[error("{0}")]
    Unsupported(String),
}

impl Error {
    /// `value` if it is finite.
    ///
    /// # Errors
    /// [`Error::NotFinite`] otherwise.
    pub fn finite(what: &'static str, value: f64) -> Result<f64> {
        if value.is_finite() { Ok(value) } else { Err(Error::NotFinite { what, value }) }
    }

    /// `value` if it is finite and above zero.
    ///
    /// # Errors
    /// [`Error::NotFinite`] or [`Error::OutOfRange`].
    pub fn positive(what: &'static str, value: f64) -> Result<f64> {
        Error::finite(what, value)?;
        if value > 0.0 {
            Ok(value)
        } else {
            Err(Error::OutOfRange { what, value, needs: "it must be above zero" })
        }
    }

    /// `value` if it is finite and not below zero.
    ///
    /// # Errors
    /// [`Error::NotFinite`] or [`Error::OutOfRange`].
    pub fn not_negative(what: &'static str, value: f64) -> Result<f64> {
        Error::finite(what, value)?;
        if value >= 0.0 {
            Ok(value)
        } else {
            Err(Error::OutOfRange { what, value, needs: "it must not be negative" })
        }
    }
}
