//! The laws of the Kalman family: exactness, consistency, and what bad input does.

#[path = "../common/mod.rs"]
mod common;
mod consistency;
mod ensemble;
mod exact;
mod gaussian_sum;
mod library;
mod models;
mod refusals;
mod smoother;
mod unscented;
