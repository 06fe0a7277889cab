//! Forward-mode derivatives.

use super::real::Real;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number with its derivatives by `K` variables, of `f64` or of eight particles at once
/// ([`Lanes`](super::Lanes)). The value has the bits that `R` gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<const K: usize, R = f64> {
    /// The number.
    pub value: R,
    /// Its partial derivatives.
    pub gradient: [R; K],
}

impl<const K: usize, R: Real> Dual<K, R> {
    /// A number that does not depend on the variables.
    #[inline(always)]
    pub fn constant(value: R) -> Self {
        Dual { value, gradient: [value.constant(0.0); K] }
    }

    /// The variables themselves, at the point `x`.
    #[inline(always)]
    pub fn variables(x: [R; K]) -> [Self; K] {
        std::array::from_fn(|i| Dual::variable(x[i], i))
    }

    /// Variable number `index`, at `value`.
    #[inline(always)]
    pub fn variable(value: R, index: usize) -> Self {
        let mut d = Dual::constant(value);
        d.gradient[index] = value.constant(1.0);
        d
    }

    /// g(self), given g's value and its derivative. Loops instead of `array::map` here and below: a closure
    /// may fail to be inlined into a kernel.
    #[inline(always)]
    fn chain(self, value: R, slope: R) -> Self {
        let mut gradient = self.gradient;
        for i in 0..K {
            gradient[i] = gradient[i] * slope;
        }
        Dual { value, gradient }
    }

    /// g(self, other), given g's value and its two partial derivatives.
    #[inline(always)]
    fn chain2(self, other: Self, value: R, a: R, b: R) -> Self {
        let mut gradient = self.gradient;
        for i in 0..K {
            gradient[i] = a * gradient[i] + b * other.gradient[i];
        }
        Dual { value, gradient }
    }
}

impl<const K: usize, R: Real> Add for Dual<K, R> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        let mut gradient = self.gradient;
        for i in 0..K {
            gradient[i] = gradient[i] + o.gradient[i];
        }
        Dual { value: self.value + o.value, gradient }
    }
}
impl<const K: usize, R: Real> Sub for Dual<K, R> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        let mut gradient = self.gradient;
        for i in 0..K {
            gradient[i] = gradient[i] - o.gradient[i];
        }
        Dual { value: self.value - o.value, gradient }
    }
}
impl<const K: usize, R: Real> Mul for Dual<K, R> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        self.chain2(o, self.value * o.value, o.value, self.value)
    }
}
impl<const K: usize, R: Real> Div for Dual<K, R> {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        let q = self.value / o.value;
        self.chain2(o, q, q.constant(1.0) / o.value, -q / o.value)
    }
}
impl<const K: usize, R: Real> Neg for Dual<K, R> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.chain(-self.value, self.value.constant(-1.0))
    }
}
impl<const K: usize, R: Real> Add<f64> for Dual<K, R> {
    type Output = Self;
    #[inline(always)]
    fn add(self, c: f64) -> Self {
        Dual { value: self.value + c, ..self }
    }
}
impl<const K: usize, R: Real> Sub<f64> for Dual<K, R> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, c: f64) -> Self {
        Dual { value: self.value - c, ..self }
    }
}
impl<const K: usize, R: Real> Mul<f64> for Dual<K, R> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, c: f64) -> Self {
        self.chain(self.value * c, self.value.constant(c))
    }
}
impl<const K: usize, R: Real> Div<f64> for Dual<K, R> {
    type Output = Self;
    #[inline(always)]
    fn div(self, c: f64) -> Self {
        self.chain(self.value / c, self.value.constant(1.0 / c))
    }
}

impl<const K: usize, R: Real> Real for Dual<K, R> {
    #[inline(always)]
    fn constant(self, c: f64) -> Self {
        Dual::constant(self.value.constant(c))
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        let product = self.chain2(b, self.value, b.value, self.value);
        Dual { value: self.value.mul_add(b.value, c.value), ..product + c }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let s = self.value.sqrt();
        self.chain(s, s.constant(0.5) / s)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        let (zero, one) = (self.value.constant(0.0), self.value.constant(1.0));
        self.chain(self.value.abs(), self.value.if_lt(zero, -one, one))
    }
    #[inline(always)]
    fn if_lt(self, other: Self, then: Self, otherwise: Self) -> Self {
        let mut gradient = then.gradient;
        for i in 0..K {
            gradient[i] = self.value.if_lt(other.value, then.gradient[i], otherwise.gradient[i]);
        }
        Dual { value: self.value.if_lt(other.value, then.value, otherwise.value), gradient }
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let e = self.value.exp();
        self.chain(e, e)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        self.chain(self.value.ln(), self.value.constant(1.0) / self.value)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (s, c) = self.value.sin_cos();
        (self.chain(s, c), self.chain(c, -s))
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        // At the origin there is no derivative; zero is taken.
        let r2 = self.value * self.value + x.value * x.value + f64::MIN_POSITIVE;
        self.chain2(x, self.value.atan2(x.value), x.value / r2, -self.value / r2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Lanes;

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

    /// Eight points at once have the values and the gradients of one after the other, to the bit; the points
    /// fall on both sides of every selection.
    #[test]
    fn lanes_have_the_bits_of_one_after_the_other() {
        #[inline(always)]
        fn all<S: fearless_simd::Simd>(simd: S, x: &[[f64; 8]; 3]) -> [[f64; 8]; 4] {
            let d = expression(Dual::variables(x.each_ref().map(|x| Lanes::load(simd, x))));
            let mut out = [[0.0; 8]; 4];
            d.value.store(&mut out[0]);
            for i in 0..3 {
                d.gradient[i].store(&mut out[i + 1]);
            }
            out
        }
        fn one_by_one(x: &[[f64; 8]; 3]) -> [[f64; 8]; 4] {
            let d: [Dual<3>; 8] = std::array::from_fn(|j| expression(Dual::variables(x.map(|x| x[j]))));
            std::array::from_fn(|i| d.map(|d| if i == 0 { d.value } else { d.gradient[i - 1] }))
        }
        let x: [[f64; 8]; 3] = [
            [0.7, 2.1, -1.2, 0.0, 5.0, -3.3, 0.2, 1.0],
            [-0.4, 0.3, 0.9, 1.0, -2.0, 0.01, 0.0, 3.0],
            [1.9, 0.8, 3.3, 0.5, 7.0, 2.2, 0.1, 4.0],
        ];
        let found = fearless_simd::dispatch!(fearless_simd::Level::new(), simd => all(simd, &x));
        assert_eq!(found.map(|r| r.map(f64::to_bits)), one_by_one(&x).map(|r| r.map(f64::to_bits)));
    }
}
