//! Angles as numbers on a circle.

use std::f64::consts::{PI, TAU};

/// The same angle in (-pi, pi], exact up to the rounding of 2 pi; NaN for NaN and infinities.
pub fn wrap(angle: f64) -> f64 {
    // The remainder is exact for any size of the quotient.
    let rest = angle % TAU;
    if rest > PI {
        rest - TAU
    } else if rest <= -PI {
        rest + TAU
    } else {
        rest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn borders() {
        assert_eq!(wrap(PI), PI);
        assert_eq!(wrap(-PI), PI);
        assert_eq!(wrap(1.0), 1.0);
        assert!((wrap(2.0 * PI - 0.1) + 0.1).abs() < 1e-15);
        assert!((wrap(-2.0 * PI + 0.1) - 0.1).abs() < 1e-15);
        for x in [1e300, -1e300, 1e17, 400.0, -400.0] {
            assert!((-PI..=PI).contains(&wrap(x)), "{x}");
        }
        assert!(wrap(f64::INFINITY).is_nan() && wrap(f64::NAN).is_nan());
    }
}
