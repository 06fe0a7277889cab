//! What motions with positions, velocities and accelerations share: each axis moves by itself, in the same way.

use super::add_scaled;
use crate::math::Real;

/// One step of one axis with F = [1 f12 f13; 0 1 f23; 0 0 f33] and a lower Cholesky factor of Q.
#[derive(Clone, Copy, Debug)]
pub struct ThirdOrderStep {
    pub(super) f12: f64,
    pub(super) f13: f64,
    pub(super) f23: f64,
    pub(super) f33: f64,
    pub(super) l11: f64,
    pub(super) l21: f64,
    pub(super) l22: f64,
    pub(super) l31: f64,
    pub(super) l32: f64,
    pub(super) l33: f64,
}

impl ThirdOrderStep {
    #[inline(always)]
    pub(super) fn apply<R: Real, const D: usize, const N: usize>(&self, mut x: [R; N], w: [R; N]) -> [R; N] {
        for d in 0..D {
            let (p, v, a) = (d, D + d, 2 * D + d);
            x[p] = add_scaled(add_scaled(x[p], self.f12, x[v]), self.f13, x[a]);
            x[v] = add_scaled(x[v], self.f23, x[a]);
            x[p] = add_scaled(x[p], self.l11, w[p]);
            x[v] = add_scaled(add_scaled(x[v], self.l21, w[p]), self.l22, w[v]);
            let noise = add_scaled(add_scaled(w[p] * self.l31, self.l32, w[v]), self.l33, w[a]);
            x[a] = add_scaled(noise, self.f33, x[a]);
        }
        x
    }
}
