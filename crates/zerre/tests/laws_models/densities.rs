//! Densities integrate to one, and heavy tails widen a covariance as Bayes says.

use crate::derivatives::slope;
use crate::sensors::{CAREFUL, Careless, log_likelihood};
use std::f64::consts::{PI, TAU};
use zerre::model::measurement::*;
use zerre::model::{GaussianMeasurement, Measurement};

/// Integral of p(z | x) over the boxes `low`..`high` of two components, by the midpoint rule. On smooth functions
/// that vanish at the border it converges faster than any power once the step is below a standard deviation.
fn mass<H, const N: usize>(sensor: &H, x: [f64; N], low: [f64; 2], high: [f64; 2], cells: [u32; 2]) -> f64
where
    H: Measurement<N, Value = [f64; 2]>,
{
    let step = [(high[0] - low[0]) / f64::from(cells[0]), (high[1] - low[1]) / f64::from(cells[1])];
    let mut sum = 0.0;
    for i in 0..cells[0] {
        for j in 0..cells[1] {
            let z = [low[0] + (f64::from(i) + 0.5) * step[0], low[1] + (f64::from(j) + 0.5) * step[1]];
            sum += log_likelihood(sensor, z, x).exp();
        }
    }
    sum * step[0] * step[1]
}

#[test]
fn densities_integrate_to_one() {
    // Looking across the cut, over one whole turn; tails beyond 12 standard deviations of the range are below 1e-30,
    // bearings beyond pi = 10 standard deviations below 1e-22.
    let (x, turn) = ([-50.0, 1e-3], PI);
    let pair = RangeBearing::new([0.0, 0.0], 0.5, 0.3).unwrap();
    let one = mass(&pair, x, [44.0, -turn], [56.0, turn], [60, 60]);
    assert!((one - 1.0).abs() < 1e-12, "{one}");
    // Outliers of 3 times the size: 16 of their standard deviations of range; the bearing has pi = 3.5 of 0.9, the
    // folded tail being erfc(3.49 / sqrt 2) = 4.8e-4 of 5 %, hence at most 2.5e-5 missing.
    let mixed = HeavyTailed::outliers(pair, 0.05, 3.0).unwrap();
    let one = mass(&mixed, x, [26.0, -turn], [74.0, turn], [192, 200]);
    assert!((1.0 - 2.5e-5..1.0 + 1e-6).contains(&one), "{one}");
    // The same with bearings fine enough that nothing folds.
    let fine = RangeBearing::new([0.0, 0.0], 0.5, 0.05).unwrap();
    let mixed = HeavyTailed::outliers(fine, 0.05, 5.0).unwrap();
    let one = mass(&mixed, x, [15.0, -turn], [85.0, turn], [280, 250]);
    assert!((one - 1.0).abs() < 1e-9, "{one}");
    // Even outliers fill the box that they were given.
    let even = UniformOutliers::new(fine, 0.2, 12.0 * TAU).unwrap();
    let one = mass(&even, x, [44.0, -turn], [56.0, turn], [60, 250]);
    assert!((one - 1.0).abs() < 1e-12, "{one}");
    // A law without its constants is noticed.
    let careless = mass(
        &Careless { wraps: true, constant: CAREFUL },
        [-50.0, 1e-3],
        [44.0, -turn],
        [56.0, turn],
        [120, 250],
    );
    assert!((careless - 1.0).abs() > 0.5, "{careless}");
}

/// Student's law in 1, 2 and 3 dimensions, radially: the sphere's area times r^(M-1) p(r) dr with r = e^u. Below
/// e^-40 the mass is 4e-18, beyond e^25 with 3 degrees of freedom or more 1e-32. The integrand is analytic within
/// pi / 2 of the real axis, so that the step 0.05 leaves e^(-pi^2 / 0.05).
#[test]
fn student_laws_integrate_to_one() {
    fn radial<const M: usize>(dof: f64) -> f64 {
        let sensor = HeavyTailed::student_t(Position::<M>::new(1.0).unwrap(), dof).unwrap();
        let area = [2.0, TAU, 2.0 * TAU][M - 1];
        let step = 0.05;
        (0..1300)
            .map(|i| {
                let r = (f64::from(i) * step - 40.0).exp();
                let mut z = [0.0; M];
                z[0] = r;
                area * r.powi(M as i32) * log_likelihood(&sensor, z, [0.0; M]).exp() * step
            })
            .sum()
    }
    for dof in [3.0, 5.5, 39.0, 43.0, 1e4] {
        for one in [radial::<1>(dof), radial::<2>(dof), radial::<3>(dof)] {
            assert!((one - 1.0).abs() < 1e-10, "{dof}: {one}");
        }
    }
}

/// For v ~ N(0, s R) with random s, E[1 / s | v] is -2 times the derivative of log p by the squared distance.
#[test]
fn covariance_scales_are_posterior_means() {
    fn check<H: GaussianMeasurement<2, 2> + Measurement<2, Value = [f64; 2]>>(sensor: &H) {
        for distance2 in [0.01f64, 0.5, 3.0, 9.0, 40.0] {
            let log_p = |d2: f64| log_likelihood(sensor, [0.5 * d2.sqrt(), 0.0], [0.0, 0.0]);
            let derivative = slope(|e| log_p(distance2 + e), 1e-3 * distance2);
            let expected = 1.0 / (-2.0 * derivative);
            let found = sensor.covariance_scale(distance2);
            // The slope carries 4 eps / h of |log p| < 50, with h = 1e-5 at the least.
            assert!((found - expected).abs() < 1e-8 * expected, "{distance2}: {found} {expected}");
        }
    }
    let sensor = Position::<2>::new(0.5).unwrap();
    check(&sensor);
    check(&HeavyTailed::student_t(sensor, 4.0).unwrap());
    check(&HeavyTailed::outliers(sensor, 0.1, 10.0).unwrap());
}
