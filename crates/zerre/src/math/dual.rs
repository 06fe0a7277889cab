//! Forward-mode derivatives.

use super::real::Real;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number with its derivatives by `K` variables. The value has the bits that `f64` gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<const K: usize> {
    /// The number.
    pub value: f64,
    /// Its partial derivatives.
    pub gradient: [f64; K],
}

impl<const K: usize> Dual<K> {
    /// A number that does not depend on the variables.
    pub fn constant(value: f64) -> Self {
        Dual { value, gradient: [0.0; K] }
    }

    /// The variables themselves, at the point `x`.
    pub fn variables(x: [f64; K]) -> [Self; K] {
        std::array::from_fn(|i| Dual::variable(x[i], i))
    }

    /// Variable number `index`, at `value`.
    pub fn variable(value: f64, index: usize) -> Self {
        let mut d = Dual::constant(value);
        d.gradient[index] = 1.0;
        d
    }

    /// g(self), given g's value and its derivative.
    #[inline(always)]
    fn chain(self, value: f64, slope: f64) -> Self {
        Dual { value, gradient: self.gradient.map(|d| d * slope) }
    }

    /// g(self, other), given g's value and its two partial derivatives.
    #[inline(always)]
    fn chain2(self, other: Self, value: f64, a: f64, b: f64) -> Self {
        Dual { value, gradient: std::array::from_fn(|i| a * self.gradient[i] + b * other.gradient[i]) }
    }
}

impl<const K: usize> Add for Dual<K> {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        self.chain2(o, self.value + o.value, 1.0, 1.0)
    }
}
impl<const K: usize> Sub for Dual<K> {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        self.chain2(o, self.value - o.value, 1.0, -1.0)
    }
}
impl<const K: usize> Mul for Dual<K> {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        self.chain2(o, self.value * o.value, o.value, self.value)
    }
}
impl<const K: usize> Div for Dual<K> {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        let q = self.value / o.value;
        self.chain2(o, q, 1.0 / o.value, -q / o.value)
    }
}
impl<const K: usize> Neg for Dual<K> {
    type Output = Self;
    fn neg(self) -> Self {
        self.chain(-self.value, -1.0)
    }
}
impl<const K: usize> Add<f64> for Dual<K> {
    type Output = Self;
    fn add(self, c: f64) -> Self {
        self.chain(self.value + c, 1.0)
    }
}
impl<const K: usize> Sub<f64> for Dual<K> {
    type Output = Self;
    fn sub(self, c: f64) -> Self {
        self.chain(self.value - c, 1.0)
    }
}
impl<const K: usize> Mul<f64> for Dual<K> {
    type Output = Self;
    fn mul(self, c: f64) -> Self {
        self.chain(self.value * c, c)
    }
}
impl<const K: usize> Div<f64> for Dual<K> {
    type Output = Self;
    fn div(self, c: f64) -> Self {
        self.chain(self.value / c, 1.0 / c)
    }
}

impl<const K: usize> Real for Dual<K> {
    fn constant(self, c: f64) -> Self {
        Dual::constant(c)
    }
    fn mul_add(self, b: Self, c: Self) -> Self {
        let product = self.chain2(b, 0.0, b.value, self.value);
        product.chain2(c, Real::mul_add(self.value, b.value, c.value), 1.0, 1.0)
    }
    fn sqrt(self) -> Self {
        let s = f64::sqrt(self.value);
        self.chain(s, 0.5 / s)
    }
    fn abs(self) -> Self {
        self.chain(f64::abs(self.value), if self.value < 0.0 { -1.0 } else { 1.0 })
    }
    fn if_lt(self, other: Self, then: Self, otherwise: Self) -> Self {
        if self.value < other.value { then } else { otherwise }
    }
    fn exp(self) -> Self {
        let e = Real::exp(self.value);
        self.chain(e, e)
    }
    fn ln(self) -> Self {
        self.chain(Real::ln(self.value), 1.0 / self.value)
    }
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = Real::sin_cos(self.value);
        (self.chain(s, c), self.chain(c, -s))
    }
    fn atan2(self, x: Self) -> Self {
        let r2 = self.value * self.value + x.value * x.value;
        self.chain2(x, Real::atan2(self.value, x.value), x.value / r2, -self.value / r2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every operation once; derivatives follow by hand from finite differences of the same expression.
    fn expression<R: Real>([a, b, c]: [R; 3]) -> R {
        let (s, k) = (a * b - c / 3.0).sin_cos();
        let t = (s + 2.0).ln() * (-b).exp() + k.atan2(a) / c.sqrt();
        let u = t.mul_add(a, b.hypot(c)) - (a - b).abs() * 0.5;
        u.if_lt(c, u.square(), u).max(-a).min(a + 9.0).log_add_exp(b - 1.0)
    }

    #[test]
    fn gradients_agree_with_central_differences() {
        for x in [[0.7, -0.4, 1.9], [2.1, 0.3, 0.8], [-1.2, 0.9, 3.3]] {
            let d = expression(Dual::variables(x));
            assert_eq!(d.value.to_bits(), expression(x).to_bits());
            for i in 0..3 {
                // Central differences: truncation h^2 f'''/6 ~ 1e-10, rounding eps/h ~ 2e-11; f''' here below 100.
                let h = 1e-5;
                let (mut lo, mut hi) = (x, x);
                lo[i] -= h;
                hi[i] += h;
                let slope = (expression(hi) - expression(lo)) / (2.0 * h);
                assert!((slope - d.gradient[i]).abs() < 1e-7, "{x:?} {i}: {slope} {}", d.gradient[i]);
            }
        }
    }
}
