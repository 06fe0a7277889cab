//! Rules that change beliefs.

use serde::{Deserialize, Serialize};

/// What became of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Outcome {
    /// There was none: the belief was predicted.
    Predicted,
    /// It was used.
    Updated,
    /// It lay outside the gate and was not used; the belief was predicted.
    Gated,
    /// No particle (or no Gaussian) gives it any likelihood that the arithmetic can hold: it was not used, the
    /// belief was predicted, and the caller's policy decides what follows.
    Degenerate,
}
