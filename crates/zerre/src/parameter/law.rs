//! Prior laws of parameters.

use crate::error::{Error, Result};
use crate::math::{Real, exp, ln, ln_gamma};
use crate::rng::Draws;
use std::f64::consts::TAU;

/// The prior of one parameter. Its free coordinate is the value itself for a normal law, its logarithm for
/// laws of positive numbers, and ln((x - low) / (high - x)) between borders (0 and 1 for a share).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Law {
    /// Normal.
    Normal {
        /// Its mean.
        mean: f64,
        /// Its standard deviation.
        sd: f64,
    },
    /// The exponential of a normal number.
    LogNormal {
        /// The median of the law.
        median: f64,
        /// The standard deviation of the logarithm.
        sd: f64,
    },
    /// Uniform.
    Uniform {
        /// The lower border.
        low: f64,
        /// The upper border.
        high: f64,
    },
    /// Gamma, of mean `shape` times `scale`.
    Gamma {
        /// The shape.
        shape: f64,
        /// The scale.
        scale: f64,
    },
    /// The inverse of a gamma number of this shape and of scale 1 / `scale`: conjugate to variances.
    InverseGamma {
        /// The shape.
        shape: f64,
        /// The scale.
        scale: f64,
    },
    /// Beta, of mean `alpha` / (`alpha` + `beta`): for shares and probabilities.
    Beta {
        /// The first shape.
        alpha: f64,
        /// The second shape.
        beta: f64,
    },
}

/// ln of a gamma number of scale 1; small shapes make numbers too small to be held.
fn log_gamma_draw(shape: f64, draws: &mut Draws) -> f64 {
    if shape < 1.0 {
        ln(draws.gamma(shape + 1.0)) + ln(draws.uniform()) / shape
    } else {
        ln(draws.gamma(shape))
    }
}

/// The number between `low` and `high` whose share of the width has this log-odds, and ln of its derivative.
fn between((low, high): (f64, f64), log_odds: f64) -> (f64, f64) {
    // ln of the share of the width on either side, without the loss of 1 - share.
    let (below, above) = (-Real::log_add_exp(0.0, -log_odds), -Real::log_add_exp(0.0, log_odds));
    let width = high - low;
    let x = if log_odds < 0.0 { low + width * exp(below) } else { high - width * exp(above) };
    (x, ln(width) + below + above)
}

impl Law {
    pub(super) fn check(&self) -> Result<()> {
        match *self {
            Law::Normal { mean, sd } => {
                Error::finite("mean of a prior", mean)?;
                Error::positive("standard deviation of a prior", sd)?;
            }
            Law::LogNormal { median, sd } => {
                Error::positive("median of a prior", median)?;
                Error::positive("standard deviation of a prior", sd)?;
            }
            Law::Uniform { low, high } => {
                Error::finite("lower border of a prior", low)?;
                Error::positive("width of a prior", Error::finite("upper border of a prior", high)? - low)?;
            }
            Law::Gamma { shape, scale } | Law::InverseGamma { shape, scale } => {
                Error::positive("shape of a prior", shape)?;
                Error::positive("scale of a prior", scale)?;
            }
            Law::Beta { alpha, beta } => {
                Error::positive("shape of a prior", alpha)?;
                Error::positive("shape of a prior", beta)?;
            }
        }
        Ok(())
    }

    /// Log-density at `x`; -inf outside the law.
    pub fn log_density(&self, x: f64) -> f64 {
        let normal = |z: f64, sd: f64| -0.5 * z * z - ln(sd) - 0.5 * ln(TAU);
        match *self {
            Law::Normal { mean, sd } => normal((x - mean) / sd, sd),
            Law::LogNormal { median, sd } if x > 0.0 => normal((ln(x) - ln(median)) / sd, sd) - ln(x),
            Law::Uniform { low, high } if (low..=high).contains(&x) => -ln(high - low),
            Law::Gamma { shape, scale } if x > 0.0 => {
                (shape - 1.0) * ln(x) - x / scale - ln_gamma(shape) - shape * ln(scale)
            }
            Law::InverseGamma { shape, scale } if x > 0.0 => {
                shape * ln(scale) - ln_gamma(shape) - (shape + 1.0) * ln(x) - scale / x
            }
            Law::Beta { alpha: a, beta: b } if x > 0.0 && x < 1.0 => {
                // 1 - x is exact where x is near 1.
                (a - 1.0) * ln(x) + (b - 1.0) * ln(1.0 - x) + ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b)
            }
            _ => f64::NEG_INFINITY,
        }
    }

    /// A draw.
    pub fn draw(&self, draws: &mut Draws) -> f64 {
        match *self {
            Law::Normal { mean, sd } => mean + sd * draws.normal(),
            Law::LogNormal { median, sd } => median * exp(sd * draws.normal()),
            Law::Uniform { low, high } => low + (high - low) * draws.uniform(),
            Law::Gamma { shape, scale } => scale * draws.gamma(shape),
            Law::InverseGamma { shape, scale } => scale / draws.gamma(shape),
            Law::Beta { alpha, beta } => {
                let log_odds = log_gamma_draw(alpha, draws) - log_gamma_draw(beta, draws);
                between((0.0, 1.0), log_odds).0
            }
        }
    }

    /// The free coordinate of a value; not finite where there is none.
    pub(super) fn free(&self, x: f64) -> f64 {
        match *self {
            Law::Normal { .. } => x,
            Law::LogNormal { .. } | Law::Gamma { .. } | Law::InverseGamma { .. } => ln(x),
            Law::Uniform { low, high } => ln((x - low) / (high - x)),
            Law::Beta { .. } => ln(x / (1.0 - x)),
        }
    }

    /// The value of a free coordinate u, and ln |dx / du|.
    pub(super) fn bound(&self, free: f64) -> (f64, f64) {
        match *self {
            Law::Normal { .. } => (free, 0.0),
            Law::LogNormal { .. } | Law::Gamma { .. } | Law::InverseGamma { .. } => (exp(free), free),
            Law::Uniform { low, high } => between((low, high), free),
            Law::Beta { .. } => between((0.0, 1.0), free),
        }
    }
}
