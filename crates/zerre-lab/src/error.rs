//! What the numbers handed in lack, with place and value.

/// Result of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A refusal of input that has no score.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Nothing to score.
    #[error("{what}: none given, at least one is needed")]
    Empty {
        /// What is missing.
        what: &'static str,
    },
    /// Sizes that do not fit together.
    #[error("{what} at position {index}: {found} found, {expected} expected")]
    Shape {
        /// What was counted.
        what: &'static str,
        /// Position in its list, from 0; 0 where the list itself is meant.
        index: usize,
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// A NaN or an infinity where a number is needed.
    #[error("{what} at position {index} is {value}: a finite number is needed")]
    NotFinite {
        /// What the number stands for.
        what: &'static str,
        /// Position in its list, from 0.
        index: usize,
        /// The number.
        value: f64,
    },
    /// A number outside its range.
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
    #[error("the covariance at position {index} is not symmetric positive definite (row {row})")]
    NotPositiveDefinite {
        /// Position in its list, from 0.
        index: usize,
        /// Row that shows it, from 0.
        row: usize,
    },
    /// An animation that cannot be written.
    #[error("the animation cannot be written: {why}")]
    Animation {
        /// What the encoder says.
        why: String,
    },
    /// What the library refuses.
    #[error(transparent)]
    Library(#[from] zerre::Error),
}

impl Error {
    /// All of `values` are finite.
    pub(crate) fn all_finite(what: &'static str, values: &[f64]) -> Result<()> {
        match values.iter().position(|v| !v.is_finite()) {
            Some(index) => Err(Error::NotFinite { what, index, value: values[index] }),
            None => Ok(()),
        }
    }
}
