//! Extended targets.
mod baselines;
mod contour;
mod mem_ekf;
mod random_matrix;
mod single;
