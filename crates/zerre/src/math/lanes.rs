//! Eight particles at once.

use super::elementary;
use super::real::{Float, ROUND_MAGIC, Real, SQRT_HALF_BITS};
use fearless_simd::{Simd, f32x8, f64x8, i64x8, prelude::*, u64x8};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Eight `f64` numbers on the SIMD level `S`; every lane has the bits that `f64` gives, on every level.
#[derive(Clone, Copy)]
pub struct Lanes<S: Simd>(pub(crate) f64x8<S>);

impl<S: Simd> Lanes<S> {
    /// How many particles go at once, on every SIMD level.
    pub const COUNT: usize = 8;

    #[inline(always)]
    pub(crate) fn splat(simd: S, c: f64) -> Self {
        Lanes(f64x8::splat(simd, c))
    }
    /// The first eight numbers of `from`, which has at least that many.
    #[inline(always)]
    pub(crate) fn load(simd: S, from: &[f64]) -> Self {
        Lanes(f64x8::from_slice(simd, &from[..8]))
    }
    /// The first eight single-precision numbers of `from`.
    #[inline(always)]
    pub(crate) fn widen(simd: S, from: &[f32]) -> Self {
        let (low, high) = simd.widen_f32x8(f32x8::from_slice(simd, &from[..8]));
        Lanes(low.combine(high))
    }
    #[inline(always)]
    pub(crate) fn store(self, to: &mut [f64]) {
        self.0.store_slice(&mut to[..8]);
    }
    #[inline(always)]
    fn bits(self) -> u64x8<S> {
        self.0.bitcast()
    }
    #[inline(always)]
    fn from_bits(bits: u64x8<S>) -> Self {
        Lanes(bits.bitcast())
    }
    #[inline(always)]
    fn simd(self) -> S {
        self.0.simd
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident) => {
        impl<S: Simd> $trait for Lanes<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Lanes($trait::$method(self.0, other.0))
            }
        }
        impl<S: Simd> $trait<f64> for Lanes<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, c: f64) -> Self {
                Lanes($trait::$method(self.0, f64x8::splat(self.simd(), c)))
            }
        }
    };
}
operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Lanes(-self.0)
    }
}

impl<S: Simd> Real for Lanes<S> {
    #[inline(always)]
    fn constant(self, c: f64) -> Self {
        Lanes::splat(self.simd(), c)
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Lanes(self.simd().mul_add_precise_f64x8(self.0, b.0, c.0))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Lanes(self.simd().sqrt_f64x8(self.0))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Lanes(self.simd().abs_f64x8(self.0))
    }
    #[inline(always)]
    fn if_lt(self, other: Self, then: Self, otherwise: Self) -> Self {
        Lanes(self.simd().simd_lt_f64x8(self.0, other.0).select(then.0, otherwise.0))
    }
    #[inline(always)]
    fn exp(self) -> Self {
        elementary::exp(self)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        elementary::ln(self)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        elementary::sin_cos(self)
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        elementary::atan2(self, x)
    }
}

impl<S: Simd> Float for Lanes<S> {
    #[inline(always)]
    fn round_and_half_pow2(self) -> (Self, Self) {
        let t = self + ROUND_MAGIC;
        let bits = (t.bits() + u64x8::splat(self.simd(), 1022)) << 52;
        (t - ROUND_MAGIC, Lanes::from_bits(bits))
    }
    #[inline(always)]
    fn round(self) -> Self {
        (self + ROUND_MAGIC) - ROUND_MAGIC
    }
    #[inline(always)]
    fn split_exponent(self) -> (Self, Self) {
        let simd = self.simd();
        let border = u64x8::splat(simd, SQRT_HALF_BITS);
        let shifted = self.bits() - border;
        let exponent: i64x8<S> = shifted.bitcast::<i64x8<S>>() >> 52;
        let mantissa = (shifted & u64x8::splat(simd, 0x000f_ffff_ffff_ffff)) + border;
        // A small integer becomes a float by the rounding constant: cheaper than a conversion below AVX-512.
        let magic = i64x8::splat(simd, ROUND_MAGIC.to_bits() as i64);
        let exponent = Lanes((exponent + magic).bitcast::<f64x8<S>>()) - ROUND_MAGIC;
        (Lanes::from_bits(mantissa), exponent)
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        Lanes(self.simd().copysign_f64x8(self.0, sign.0))
    }
    #[inline(always)]
    fn all_lt(self, other: Self) -> bool {
        self.simd().simd_lt_f64x8(self.0, other.0).all_true()
    }
    #[inline(always)]
    fn swap_if_odd(self, a: Self, b: Self) -> (Self, Self) {
        let simd = self.simd();
        let one = u64x8::splat(simd, 1);
        let odd = simd.simd_eq_u64x8((self + ROUND_MAGIC).bits() & one, one);
        (Lanes(odd.select(b.0, a.0)), Lanes(odd.select(a.0, b.0)))
    }
    #[inline(always)]
    fn negate_if_bit1(self, a: Self) -> Self {
        let bit = ((self + ROUND_MAGIC).bits() & u64x8::splat(self.simd(), 2)) << 62;
        Lanes::from_bits(a.bits() ^ bit)
    }
}
