//! Drawn paths and measurements have the law of their models.

use crate::matrices::{linear, matrix};
use crate::seconds;
use std::f64::consts::PI;
use zerre::Error;
use zerre::model::measurement::*;
use zerre::model::motion::ConstantVelocity;
use zerre::model::simulate;
use zerre::rng::Stream;

/// Sample covariances of n draws lie within 5 standard errors: the variance of the product of two centred normals
/// is C_ii C_jj + C_ij^2.
#[test]
fn paths_have_the_covariance_of_the_motion() {
    let motion = ConstantVelocity::<2>::new(0.05).unwrap();
    let times = [seconds(2.0), seconds(2.0), seconds(3.5)];
    let (_, q) = linear(&motion, times[1], times[2]);
    let n = 20_000;
    let root = Stream::new(11);
    let mut sums = matrix(4, 4, |_, _| 0.0);
    for run in 0..n {
        let path = simulate::path(&motion, [0.0; 4], &times, root.fork(run)).unwrap();
        assert_eq!(path[1], path[0]);
        for i in 0..4 {
            for j in 0..4 {
                sums[i][j] += path[2][i] * path[2][j] / n as f64;
            }
        }
    }
    for i in 0..4 {
        for j in 0..4 {
            let error = ((q[i][i] * q[j][j] + q[i][j] * q[i][j]) / n as f64).sqrt();
            assert!((sums[i][j] - q[i][j]).abs() < 5.0 * error, "{i} {j}: {} {}", sums[i][j], q[i][j]);
        }
    }
    let again = |seed| simulate::path(&motion, [0.0; 4], &times, Stream::new(seed)).unwrap();
    assert_eq!(again(5), again(5));
    assert_ne!(again(5), again(6));
    let back = simulate::path(&motion, [0.0; 4], &[seconds(1.0), seconds(0.0)], root);
    assert!(matches!(back, Err(Error::OutOfOrder { .. })));
}

#[test]
fn measurements_have_the_law_of_the_sensor() {
    let n = 40_000;
    let times = vec![seconds(1.0); n];
    let mean = |values: &[f64]| values.iter().sum::<f64>() / n as f64;
    // Straight across the cut: residuals, not angles, have the mean 0.
    let pair = RangeBearing::new([0.0, 0.0], 0.5, 0.1).unwrap();
    let path = vec![[-20.0, 0.0]; n];
    let z = simulate::measurements(&pair, &path, &times, Stream::new(3)).unwrap();
    assert!(z.iter().all(|z| z[1].abs() <= PI));
    let range: Vec<f64> = z.iter().map(|z| z[0] - 20.0).collect();
    let bearing: Vec<f64> = z.iter().map(|z| (z[1] + PI).sin().atan2((z[1] + PI).cos())).collect();
    for (values, sd) in [(&range, 0.5), (&bearing, 0.1)] {
        let squares: Vec<f64> = values.iter().map(|v| v * v).collect();
        // 5 standard errors of the mean and of the mean square, sd^2 sqrt(2 / n).
        assert!(mean(values).abs() < 5.0 * sd / (n as f64).sqrt());
        assert!((mean(&squares) - sd * sd).abs() < 5.0 * sd * sd * (2.0 / n as f64).sqrt());
    }
    let product: Vec<f64> = range.iter().zip(&bearing).map(|(a, b)| a * b).collect();
    assert!(mean(&product).abs() < 5.0 * 0.5 * 0.1 / (n as f64).sqrt());
    // Heavier tails: variance nu / (nu - 2) and fourth moment 3 nu^2 / ((nu - 2) (nu - 4)) for nu = 12; for the
    // mixture 1 - e + e s^2 and 3 (1 - e + e s^4).
    let line = vec![[0.0]; n];
    let unit = Position::<1>::new(1.0).unwrap();
    let student =
        simulate::measurements(&HeavyTailed::student_t(unit, 12.0).unwrap(), &line, &times, Stream::new(4));
    let mixture = HeavyTailed::outliers(unit, 0.1, 5.0).unwrap();
    let mixture = simulate::measurements(&mixture, &line, &times, Stream::new(4));
    for (z, second, fourth) in [(student, 1.2, 5.4), (mixture, 0.9 + 2.5, 3.0 * (0.9 + 62.5))] {
        let squares: Vec<f64> = z.unwrap().iter().map(|[z]| z * z).collect();
        let error = ((fourth - second * second) / n as f64).sqrt();
        assert!((mean(&squares) - second).abs() < 5.0 * error, "{} {second}", mean(&squares));
    }
    // No range is below zero, and its law is the normal one cut there: mean sd sqrt(2 / pi) at the sensor.
    let near = RangeOnly::<2>::new([0.0, 0.0], 2.0).unwrap();
    let z = simulate::measurements(&near, &vec![[0.0, 0.0]; n], &times, Stream::new(5)).unwrap();
    let ranges: Vec<f64> = z.iter().map(|&[z]| z).collect();
    assert!(ranges.iter().all(|&r| r >= 0.0));
    let sd = 2.0 * (1.0 - 2.0 / PI).sqrt();
    assert!((mean(&ranges) - 2.0 * (2.0 / PI).sqrt()).abs() < 5.0 * sd / (n as f64).sqrt());
    let short = simulate::measurements(&near, &[[0.0, 0.0]], &times, Stream::new(5));
    assert!(matches!(short, Err(Error::Shape { .. })));
}
