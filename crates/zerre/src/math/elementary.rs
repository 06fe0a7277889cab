//! Elementary functions as branch-free polynomials, written once for `f64` and for lanes.
//!
//! The standard library's versions differ between platforms and do not vectorise; these give the same bits
//! everywhere. Coefficients are Chebyshev interpolants of the stated degree; the error bounds are the largest
//! that dense sweeps against the platform's libm found, rounded up, and the tests hold them.

use super::real::Float;

/// Horner's scheme with fused steps, highest coefficient last.
macro_rules! poly {
    ($x:expr, $($c:expr),+) => {{
        let x = $x;
        let coefficients = [$($c),+];
        let mut i = coefficients.len() - 1;
        let mut p = x.constant(coefficients[i]);
        while i > 0 {
            i -= 1;
            p = p.mul_add(x, x.constant(coefficients[i]));
        }
        p
    }};
}

const LN2_HI: f64 = 0.693_147_180_369_123_8;
const LN2_LO: f64 = 1.908_214_929_270_587_7e-10;

/// e^x. Relative error below 2.5 ulp where the result is normal; results below 2^-1021 are zero; exact at 0,
/// infinities and NaN.
#[inline(always)]
pub fn exp<F: Float>(x: F) -> F {
    let (n, half_pow2) = (x * std::f64::consts::LOG2_E).round_and_half_pow2();
    let r = (-n).mul_add(x.constant(LN2_LO), (-n).mul_add(x.constant(LN2_HI), x));
    // Coefficients of 2 e^r: the power of two comes halved, so that it exists up to the largest result.
    let p = poly!(
        r,
        2.0 * 0.500_000_000_000_000_1,
        2.0 * 0.166_666_666_666_666_69,
        2.0 * 0.041_666_666_666_624_13,
        2.0 * 0.008_333_333_333_330_062,
        2.0 * 0.001_388_888_891_721_371_7,
        2.0 * 0.000_198_412_698_630_536_18,
        2.0 * 2.480_152_129_595_437_6e-5,
        2.0 * 2.755_726_845_999_706_4e-6,
        2.0 * 2.762_008_844_540_974_6e-7,
        2.0 * 2.510_038_549_551_032e-8
    );
    let twice = (r * r).mul_add(p, r + r) + 2.0;
    let inside = twice * half_pow2;
    let lower = x.if_lt(x.constant(-707.7), x.constant(0.0), inside);
    x.constant(709.782_712_893_384).if_lt(x, x.constant(f64::INFINITY), lower)
}

/// Natural logarithm. Error below 2 ulp; ln(0) = -inf, ln(inf) = inf, NaN below zero.
#[inline(always)]
pub fn ln<F: Float>(x: F) -> F {
    // Subnormal numbers are scaled by 2^54 first.
    let tiny = x.constant(f64::MIN_POSITIVE);
    let scaled = x.if_lt(tiny, x * 18_014_398_509_481_984.0, x);
    let offset = x.if_lt(tiny, x.constant(-54.0), x.constant(0.0));
    let (m, e) = scaled.split_exponent();
    let e = e + offset;
    let f = m - 1.0;
    let s = f / (f + 2.0);
    let z = s * s;
    let p = poly!(
        z,
        0.666_666_666_666_667,
        0.399_999_999_998_994_44,
        0.285_714_286_260_032_7,
        0.222_222_111_302_598_78,
        0.181_828_894_556_749_47,
        0.153_317_106_182_107_73,
        0.146_165_854_248_886_23
    );
    // ln m = f - s (f - z p): the large part f is exact.
    let tail = e.mul_add(x.constant(LN2_LO), -(s * (-z).mul_add(p, f)));
    let value = e.mul_add(x.constant(LN2_HI), f + tail);
    let value = x.constant(f64::MAX).if_lt(x, x, value);
    let zero = x.constant(0.0);
    let not_positive = x.if_lt(zero, x.constant(f64::NAN), x.constant(f64::NEG_INFINITY));
    let value = zero.if_lt(x, value, not_positive);
    // A NaN compares false with everything and must come out as it went in.
    x.if_lt(x.constant(f64::INFINITY), value, x + value.abs())
}

/// (sin x, cos x). Absolute error below 2.5e-16 for |x| <= 2^25; meaningless beyond 2^50, NaN for infinities.
#[inline(always)]
pub fn sin_cos<F: Float>(x: F) -> (F, F) {
    let n = (x * std::f64::consts::FRAC_2_PI).round();
    let m = -n;
    // pi/2 in three parts of 53 bits: the products are exact inside the fused steps.
    let r = m.mul_add(x.constant(std::f64::consts::FRAC_PI_2), x);
    let r = m.mul_add(x.constant(6.123_233_995_736_766e-17), r);
    let r = m.mul_add(x.constant(-1.497_384_905_065_873e-33), r);
    let z = r * r;
    let s = poly!(
        z,
        -0.166_666_666_666_666_66,
        0.008_333_333_333_330_948,
        -0.000_198_412_698_367_567_74,
        2.755_731_610_161_787_4e-6,
        -2.505_113_165_023_518e-8,
        1.591_811_526_326_597_4e-10
    );
    let c = poly!(
        z,
        0.041_666_666_666_666_664,
        -0.001_388_888_888_888_739_8,
        2.480_158_729_876_456e-5,
        -2.755_731_727_114_514_4e-7,
        2.087_614_614_655_861e-9,
        -1.138_262_364_747_460_4e-11
    );
    let sin = (r * z).mul_add(s, r);
    let cos = (z * z).mul_add(c, z.mul_add(z.constant(-0.5), z.constant(1.0)));
    // Quadrant n mod 4: odd swaps the two; sine is negated in 2 and 3, cosine in 1 and 2.
    let (sin, cos) = n.swap_if_odd(sin, cos);
    (n.negate_if_bit1(sin), (n + 1.0).negate_if_bit1(cos))
}

/// Angle of the point (`x`, `y`) in [-pi, pi], with the sign of `y`. Error below 3e-16 + 1 ulp; atan2(0, 0) = 0 for
/// every sign of the zeros in `x`; NaN if either is NaN or both are infinite.
#[inline(always)]
pub fn atan2<F: Float>(y: F, x: F) -> F {
    const TAN_PI_8: f64 = std::f64::consts::SQRT_2 - 1.0;
    let zero = x.constant(0.0);
    let (ay, ax) = (y.abs(), x.abs());
    // Where every point lies near the positive x axis, as innovations do, the reductions below change nothing.
    if ay.all_lt(x * TAN_PI_8) {
        return atan_small(ay / x).copysign(y);
    }
    let large = ax.if_lt(ay, ay, ax);
    let small = ax.if_lt(ay, ax, ay);
    // Reduce to |t| <= tan(pi/8): atan(u) = pi/4 + atan((u - 1) / (u + 1)).
    let corner = large * TAN_PI_8;
    let numerator = corner.if_lt(small, small - large, small);
    let denominator = corner.if_lt(small, small + large, large);
    let base = corner.if_lt(small, x.constant(std::f64::consts::FRAC_PI_4), zero);
    let denominator = zero.if_lt(denominator, denominator, denominator + f64::MIN_POSITIVE);
    let first = atan_small(numerator / denominator) + base;
    let second = ax.if_lt(ay, -first + std::f64::consts::FRAC_PI_2, first);
    let half_plane = x.if_lt(zero, -second + std::f64::consts::PI, second);
    half_plane.copysign(y)
}

/// atan t for |t| <= tan(pi/8).
#[inline(always)]
fn atan_small<F: Float>(t: F) -> F {
    let z = t * t;
    let p = poly!(
        z,
        -0.333_333_333_333_332_5,
        0.199_999_999_998_983_24,
        -0.142_857_142_660_822_9,
        0.111_111_096_356_037_96,
        -0.090_908_525_270_882_97,
        0.076_910_546_148_256_47,
        -0.066_496_079_533_999_17,
        0.057_362_969_593_526_145,
        -0.044_832_186_289_953_74,
        0.022_748_939_747_779_046
    );
    (t * z).mul_add(p, t)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distance in units of the last place of `exact`.
    fn ulps(value: f64, exact: f64) -> f64 {
        if value == exact || (value.is_nan() && exact.is_nan()) {
            return 0.0;
        }
        let ulp = f64::from_bits(exact.abs().to_bits() + 1) - exact.abs();
        (value - exact).abs() / ulp
    }

    #[test]
    fn exp_stays_within_its_bound() {
        for i in -1_400_000..1_410_000 {
            let x = f64::from(i) * 5.03e-4;
            assert!(ulps(exp(x), x.exp()) <= 2.5, "{x}: {} {}", exp(x), x.exp());
        }
        assert_eq!(exp(0.0), 1.0);
        assert_eq!(exp(f64::NEG_INFINITY), 0.0);
        assert_eq!(exp(f64::INFINITY), f64::INFINITY);
        assert_eq!(exp(-1e300), 0.0);
        assert_eq!(exp(710.0), f64::INFINITY);
        assert!(ulps(exp(709.78), 709.78f64.exp()) <= 2.5);
        assert!(exp(f64::NAN).is_nan());
    }

    #[test]
    fn ln_stays_within_its_bound() {
        let mut x = 1e-320;
        while x < 1e308 {
            assert!(ulps(ln(x), f64::ln(x)) <= 2.0, "{x}: {} {}", ln(x), f64::ln(x));
            x *= 1.0007;
        }
        for i in 0..200_000 {
            let x = 0.5 + f64::from(i) * 1e-5;
            assert!(ulps(ln(x), f64::ln(x)) <= 2.0, "{x}: {} {}", ln(x), f64::ln(x));
        }
        assert_eq!(ln(1.0), 0.0);
        assert_eq!(ln(0.0), f64::NEG_INFINITY);
        assert_eq!(ln(f64::INFINITY), f64::INFINITY);
        assert!(ln(-1.0).is_nan() && ln(f64::NAN).is_nan() && ln(f64::NEG_INFINITY).is_nan());
    }

    #[test]
    fn sin_cos_stays_within_its_bound() {
        for scale in [1e-3, 1.0, 997.0, 3.0e4] {
            for i in -40_000..40_000 {
                let x = f64::from(i) * 1e-3 * scale;
                if x.abs() > 33_554_432.0 {
                    continue;
                }
                let (s, c) = sin_cos(x);
                assert!((s - x.sin()).abs() <= 2.5e-16 && (c - x.cos()).abs() <= 2.5e-16, "{x}");
            }
        }
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
        assert!(sin_cos(f64::INFINITY).0.is_nan() && sin_cos(f64::NAN).1.is_nan());
    }

    #[test]
    fn atan2_stays_within_its_bound() {
        for i in 0..20_000 {
            let a = -std::f64::consts::PI + f64::from(i) * 3.1415e-4;
            for r in [1e-200, 0.3, 1.0, 1e150] {
                let (y, x) = (r * a.sin(), r * a.cos());
                let (value, exact) = (atan2(y, x), f64::atan2(y, x));
                assert!(
                    (value - exact).abs() <= 3e-16 + exact.abs() * f64::EPSILON,
                    "{y} {x}: {value} {exact}"
                );
            }
        }
        assert_eq!(atan2(0.0, 0.0), 0.0);
        assert_eq!(atan2(0.0, -0.0), 0.0);
        assert_eq!(atan2(0.0, -1.0), std::f64::consts::PI);
        assert_eq!(atan2(1.0, 0.0), std::f64::consts::FRAC_PI_2);
        assert_eq!(atan2(-1.0, 0.0), -std::f64::consts::FRAC_PI_2);
        assert!(atan2(f64::NAN, 1.0).is_nan() && atan2(1.0, f64::NAN).is_nan());
    }
}
