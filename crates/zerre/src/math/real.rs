//! The scalar traits.

use super::elementary;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// What a model computes with: `f64`, a [`Dual`](super::Dual) number (derivatives) or
/// [`Lanes`](super::Lanes) (eight particles at once).
///
/// A model writes ordinary arithmetic, with `f64` constants on the right (`x * 2.0 + vx * dt`). Branches on the
/// state are written as selections ([`Real::if_lt`]), because the eight lanes may disagree. The same expression
/// gives the same bits for `f64` and for every lane; under dual numbers the value has the same bits too.
///
/// Mark functions that are generic over `Real` `#[inline(always)]`: a call that is not inlined into the kernel
/// costs a factor of two and more.
pub trait Real:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
{
    /// The constant `c`, in the same representation (and on the same SIMD level) as `self`.
    fn constant(self, c: f64) -> Self;
    /// `self * b + c` with one rounding.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// Square root, correctly rounded.
    fn sqrt(self) -> Self;
    /// Absolute value; its derivative at 0 is taken as +1.
    fn abs(self) -> Self;
    /// `then` where `self < other`, otherwise `otherwise` (also where either is NaN).
    fn if_lt(self, other: Self, then: Self, otherwise: Self) -> Self;
    /// e to the power `self`: see [`exp`](super::exp).
    fn exp(self) -> Self;
    /// Natural logarithm: see [`ln`](super::ln).
    fn ln(self) -> Self;
    /// Sine and cosine: see [`sin_cos`](super::sin_cos).
    fn sin_cos(self) -> (Self, Self);
    /// Angle of the point (`x`, `self`): see [`atan2`](super::atan2).
    fn atan2(self, x: Self) -> Self;

    /// The larger of two numbers; `other` where `self` is NaN.
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        other.if_lt(self, self, other)
    }
    /// The smaller of two numbers; `other` where `self` is NaN.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.if_lt(other, self, other)
    }
    /// `self * self`.
    #[inline(always)]
    fn square(self) -> Self {
        self * self
    }
    /// sqrt(`self`^2 + `other`^2), without protection against overflow.
    #[inline(always)]
    fn hypot(self, other: Self) -> Self {
        self.mul_add(self, other * other).sqrt()
    }
    /// ln(e^`self` + e^`other`), safe against overflow; -inf is the logarithm of zero, and NaN is propagated
    /// from `other`.
    #[inline(always)]
    fn log_add_exp(self, other: Self) -> Self {
        let (big, small) = (self.max(other), self.min(other));
        // The lower bound keeps -inf - -inf out; e^-745 is already nothing beside 1.
        let gap = (small - big).max(big.constant(-745.0));
        big + (gap.exp() + 1.0).ln()
    }
}

/// The primitives from which the elementary functions are built; `f64` and [`Lanes`](super::Lanes) have them,
/// dual numbers do not. A model never needs it.
pub trait Float: Real {
    /// Nearest integer, ties to even, for |`self`| < 2^51, together with 2^that (zero below exponent -1022).
    /// The power is 2^(n - 1): callers fold the missing factor 2 into their polynomial so that n = 1024 works.
    fn round_and_half_pow2(self) -> (Self, Self);
    /// Nearest integer, ties to even, for |`self`| < 2^51.
    fn round(self) -> Self;
    /// (m, e) with `self` = m 2^e and m in [sqrt(1/2), sqrt(2)); for normal positive numbers.
    fn split_exponent(self) -> (Self, Self);
    /// Magnitude of `self`, sign of `sign`.
    fn copysign(self, sign: Self) -> Self;
    /// Whether `self` < `other` in every lane.
    fn all_lt(self, other: Self) -> bool;
    /// (`a`, `b`) where the integer-valued `self` is even, (`b`, `a`) where it is odd.
    fn swap_if_odd(self, a: Self, b: Self) -> (Self, Self);
    /// `-a` where bit 1 of the integer-valued `self` is set.
    fn negate_if_bit1(self, a: Self) -> Self;
}

/// 1.5 2^52: added to a number below 2^51 it leaves the nearest integer in the low bits of the mantissa.
pub(super) const ROUND_MAGIC: f64 = 6_755_399_441_055_744.0;
/// Bits of sqrt(1/2): subtracting them from a number's bits puts the exponent's border at that mantissa.
pub(super) const SQRT_HALF_BITS: u64 = 0x3fe6_a09e_667f_3bcd;

impl Real for f64 {
    #[inline(always)]
    fn constant(self, c: f64) -> f64 {
        c
    }
    #[inline(always)]
    fn mul_add(self, b: f64, c: f64) -> f64 {
        f64::mul_add(self, b, c)
    }
    #[inline(always)]
    fn sqrt(self) -> f64 {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn abs(self) -> f64 {
        f64::abs(self)
    }
    #[inline(always)]
    fn if_lt(self, other: f64, then: f64, otherwise: f64) -> f64 {
        if self < other { then } else { otherwise }
    }
    #[inline(always)]
    fn exp(self) -> f64 {
        elementary::exp(self)
    }
    #[inline(always)]
    fn ln(self) -> f64 {
        elementary::ln(self)
    }
    #[inline(always)]
    fn sin_cos(self) -> (f64, f64) {
        elementary::sin_cos(self)
    }
    #[inline(always)]
    fn atan2(self, x: f64) -> f64 {
        elementary::atan2(self, x)
    }
}

impl Float for f64 {
    #[inline(always)]
    fn round_and_half_pow2(self) -> (f64, f64) {
        let t = self + ROUND_MAGIC;
        (t - ROUND_MAGIC, f64::from_bits(t.to_bits().wrapping_add(1022) << 52))
    }
    #[inline(always)]
    fn round(self) -> f64 {
        (self + ROUND_MAGIC) - ROUND_MAGIC
    }
    #[inline(always)]
    fn split_exponent(self) -> (f64, f64) {
        let shifted = self.to_bits().wrapping_sub(SQRT_HALF_BITS);
        let exponent = ((shifted as i64) >> 52) as f64;
        (f64::from_bits((shifted & 0x000f_ffff_ffff_ffff).wrapping_add(SQRT_HALF_BITS)), exponent)
    }
    #[inline(always)]
    fn copysign(self, sign: f64) -> f64 {
        f64::copysign(self, sign)
    }
    #[inline(always)]
    fn all_lt(self, other: f64) -> bool {
        self < other
    }
    #[inline(always)]
    fn swap_if_odd(self, a: f64, b: f64) -> (f64, f64) {
        if (self + ROUND_MAGIC).to_bits() & 1 == 1 { (b, a) } else { (a, b) }
    }
    #[inline(always)]
    fn negate_if_bit1(self, a: f64) -> f64 {
        f64::from_bits(a.to_bits() ^ (((self + ROUND_MAGIC).to_bits() & 2) << 62))
    }
}
