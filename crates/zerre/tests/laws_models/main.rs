//! Laws that every motion and measurement model keeps. Each law is a function that says what is wrong, so that
//! deliberately broken models can show that it notices.

mod densities;
mod derivatives;
mod linear_motions;
mod matrices;
mod other_motions;
mod refusals;
mod sensors;
mod series;
mod simulation;

use zerre::{Span, Time};

/// What a law says of a model: nothing, or what is wrong.
type Verdict = Result<(), String>;

const EPS: f64 = f64::EPSILON;
/// Steps in seconds: short, irregular, long.
const STEPS: [f64; 5] = [1e-3, 0.37, 1.0, 7.3, 61.7];

fn seconds(secs: f64) -> Time {
    Time::ZERO + Span::from_secs(secs)
}
