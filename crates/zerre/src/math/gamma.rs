//! The incomplete integrals of the gamma function.

use super::{exp, ln, ln_gamma};
use crate::error::{Error, Result};

/// The regularised incomplete gamma functions P(a, x) and Q(a, x) = 1 - P(a, x), each with small relative error in
/// its own tail: a series below x = a + 1, a continued fraction (modified Lentz) above.
/// The factor they share comes from an exponent of the size of a ln x, so the relative error is about eps a ln x, and
/// the terms needed are about ten times the root of a: hence the largest shape.
///
/// # Errors
/// Numbers that are not finite, `a` not above zero or above 1e7, `x` negative.
pub fn regularised(a: f64, x: f64) -> Result<(f64, f64)> {
    Error::positive("shape of the incomplete gamma function", a)?;
    if a > 1e7 {
        let needs = "it must be at most 1e7";
        return Err(Error::OutOfRange { what: "shape of the incomplete gamma function", value: a, needs });
    }
    Error::not_negative("argument of the incomplete gamma function", x)?;
    if x == 0.0 {
        return Ok((0.0, 1.0));
    }
    let front = exp(a * ln(x) - x - ln_gamma(a));
    if x < a + 1.0 {
        // Ratios x / (a + n) fall below one at once, so the terms vanish.
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > sum * (0.25 * f64::EPSILON) {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        let p = (front * sum).min(1.0);
        Ok((p, 1.0 - p))
    } else {
        // All denominators of this fraction are positive for x > a + 1.
        let mut b = x + 1.0 - a;
        let (mut c, mut d) = (f64::MAX, 1.0 / b);
        let mut fraction = d;
        // Converges within some ten sqrt(a) steps.
        for n in 1..1_000_000 {
            let n = f64::from(n);
            let step = -n * (n - a);
            b += 2.0;
            d = 1.0 / (step * d + b);
            c = b + step / c;
            fraction *= c * d;
            if (c * d - 1.0).abs() <= f64::EPSILON {
                break;
            }
        }
        let q = (front * fraction).min(1.0);
        Ok((1.0 - q, q))
    }
}

/// The x with P(a, x) = `p`, a the `shape`: the quantile of the gamma law of scale 1, by bisection down to
/// neighbouring numbers.
///
/// # Errors
/// `p` outside [0, 1), a shape that [`regularised`] refuses.
pub fn quantile(p: f64, shape: f64) -> Result<f64> {
    if !(0.0..1.0).contains(&p) {
        return Err(Error::OutOfRange {
            what: "probability",
            value: p,
            needs: "it must be at least 0 and below 1",
        });
    }
    if p == 0.0 && shape > 0.0 {
        return Ok(0.0);
    }
    // Compared in the smaller tail, where the digits are.
    let below = |x: f64| -> Result<bool> {
        let (lower, upper) = regularised(shape, x)?;
        Ok(if p <= 0.5 { lower < p } else { upper > 1.0 - p })
    };
    let (mut low, mut high) = (0.0, shape);
    while below(high)? {
        (low, high) = (high, 2.0 * high);
    }
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return Ok(high);
        }
        if below(middle)? {
            low = middle;
        } else {
            high = middle;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Q(n, x) = e^-x sum of x^k / k! below n, a sum of positive terms.
    #[test]
    fn whole_shapes_are_poisson_sums() {
        for n in [1u32, 2, 5, 40] {
            for x in [1e-3, 0.5, 3.0, 6.5, 38.0, 45.0, 90.0] {
                let (mut term, mut sum) = (f64::exp(-x), 0.0);
                for k in 0..n {
                    sum += term;
                    term *= x / f64::from(k + 1);
                }
                let (p, q) = regularised(f64::from(n), x).unwrap();
                // The exponent of the factor in front is rounded at the size of a ln x: below 40 ln 90 = 180.
                assert!((q - sum).abs() < 1e-13 + 1e-12 * sum, "{n} {x}: {q} {sum}");
                assert!((p + q - 1.0).abs() < 1e-15);
            }
        }
        assert!(regularised(0.0, 1.0).is_err() && regularised(1.0, -1.0).is_err());
        assert!(regularised(1.0, f64::NAN).is_err() && regularised(f64::INFINITY, 1.0).is_err());
        assert!(regularised(1e17, 1e17).is_err());
        // The median lies 1/3 below the shape and the density there is 1 / sqrt(2 pi a); eps a ln a = 4e-8.
        let (p, q) = regularised(1e7, 1e7).unwrap();
        assert!((p - 0.5 - 4.205e-5).abs() < 1e-7 && (p + q - 1.0).abs() < 1e-15, "{p}");
    }
}
