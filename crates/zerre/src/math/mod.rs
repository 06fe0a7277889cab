//! The arithmetic that models are written in: one scalar trait, three kinds of number, and small fixed-size
//! linear algebra.

mod dual;
mod elementary;
pub mod gaussian;
mod lanes;
mod matrix;
mod real;

pub use dual::Dual;
pub use elementary::{atan2, exp, ln, sin_cos};
pub use lanes::Lanes;
pub(crate) use matrix::vector_serde;
pub use matrix::{Cholesky, Matrix, dot};
pub use real::{Float, Real};
