//! The arithmetic that models are written in: one scalar trait, three kinds of number, and small fixed-size
//! linear algebra.

mod dual;
mod elementary;
mod lanes;
mod real;
mod special;

pub use dual::Dual;
pub use elementary::{atan2, exp, ln, sin_cos};
pub use lanes::Lanes;
pub use real::{Float, Real};
pub use special::{decay_average, decay_second_average, ln_gamma, sinc, sine_defect};
