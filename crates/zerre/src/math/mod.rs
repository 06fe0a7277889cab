//! The arithmetic that models are written in: one scalar trait, three kinds of number, and small fixed-size
//! linear algebra.

mod angle;
pub mod assignment;
pub mod chi_square;
mod dual;
mod elementary;
pub(crate) mod gamma;
pub mod gaussian;
mod lanes;
mod matrix;
mod real;
pub(crate) mod simplex;
mod special;

pub use angle::wrap;
pub use dual::Dual;
pub use elementary::{atan2, exp, ln, sin_cos};
pub use lanes::Lanes;
pub(crate) use matrix::vector_serde;
pub use matrix::{Cholesky, Matrix, dot};
pub use real::{Float, Real};
pub use special::{decay_average, decay_second_average, ln_gamma, sinc, sine_defect};
