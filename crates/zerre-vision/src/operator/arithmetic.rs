//! Pictures pixel by pixel. Grey levels saturate at 0 and 255, as in OpenCV.

use crate::{Image, Result};

/// A picture from the pixels of two.
fn pair(a: &Image<u8>, b: &Image<u8>, combine: impl Fn(u8, u8) -> u8) -> Result<Image<u8>> {
    a.expect_size(b)?;
    let mut result = a.clone();
    for (a, &b) in result.pixels_mut().iter_mut().zip(b.pixels()) {
        *a = combine(*a, b);
    }
    Ok(result)
}

/// a + b.
///
/// # Errors
/// Pictures of different sizes.
pub fn add(a: &Image<u8>, b: &Image<u8>) -> Result<Image<u8>> {
    pair(a, b, u8::saturating_add)
}

/// a - b.
///
/// # Errors
/// Pictures of different sizes.
pub fn subtract(a: &Image<u8>, b: &Image<u8>) -> Result<Image<u8>> {
    pair(a, b, u8::saturating_sub)
}

/// |a - b|.
///
/// # Errors
/// Pictures of different sizes.
pub fn absolute_difference(a: &Image<u8>, b: &Image<u8>) -> Result<Image<u8>> {
    pair(a, b, u8::abs_diff)
}

/// `weights[0]` a + `weights[1]` b + `offset`, rounded to the nearest level, halves to the even one (OpenCV's
/// `addWeighted`). What is not a number becomes 0.
///
/// # Errors
/// Pictures of different sizes.
pub fn weighted_sum(a: &Image<u8>, b: &Image<u8>, weights: [f64; 2], offset: f64) -> Result<Image<u8>> {
    let [u, v] = weights;
    pair(a, b, |a, b| (f64::from(a) * u + f64::from(b) * v + offset).round_ties_even() as u8)
}

/// Bitwise and: what two masks have in common.
///
/// # Errors
/// Pictures of different sizes.
pub fn and(a: &Image<u8>, b: &Image<u8>) -> Result<Image<u8>> {
    pair(a, b, |a, b| a & b)
}

/// Bitwise exclusive or: what one of two masks has, and the other has not.
///
/// # Errors
/// Pictures of different sizes.
pub fn xor(a: &Image<u8>, b: &Image<u8>) -> Result<Image<u8>> {
    pair(a, b, |a, b| a ^ b)
}

/// Bitwise or: what at least one of two masks has.
///
/// # Errors
/// Pictures of different sizes.
pub fn or(a: &Image<u8>, b: &Image<u8>) -> Result<Image<u8>> {
    pair(a, b, |a, b| a | b)
}

/// Bitwise not: what a mask of 0 and 255 does not have.
pub fn not(a: &Image<u8>) -> Image<u8> {
    a.map(|&v| !v)
}
