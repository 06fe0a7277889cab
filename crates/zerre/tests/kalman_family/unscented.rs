//! What the sigma points promise on functions that are not linear.

use crate::models::{Wobble, direct};
use zerre::belief::Gaussian;
use zerre::filter::{SigmaPoints, Unscented, predict_measurement};
use zerre::math::{Cholesky, Matrix, Real};
use zerre::model::{GaussianMeasurement, Measurement, Motion};
use zerre::{Result, Time};

/// |x|^2 of four components.
struct Energy;

impl Measurement<4> for Energy {
    type Value = [f64; 1];
    type Given<'z> = ();
    fn given<'z>(&'z self, _: &'z [f64; 1], _: Time) -> Result<()> {
        Ok(())
    }
    fn log_likelihood<R: Real>(_: &(), x: [R; 4]) -> R {
        x[0].constant(f64::NAN)
    }
}

impl GaussianMeasurement<4, 1> for Energy {
    fn predict<R: Real>(&self, _: Time, x: [R; 4]) -> [R; 1] {
        [x[0].square() + x[1].square() + x[2].square() + x[3].square()]
    }
    fn components(&self, z: &[f64; 1]) -> [f64; 1] {
        *z
    }
    fn covariance(&self) -> [[f64; 1]; 1] {
        [[1.0]]
    }
}

/// E|x|^2 = |m|^2 + 4 s^2 and Var|x|^2 = 4 s^2 |m|^2 + 8 s^4 for x ~ N(m, s^2 I) of four components; a handful of
/// roundings of numbers up to 500.
#[test]
fn sums_of_squares_are_exact() {
    for mean in [[0.0; 4], [1.0, -2.0, 3.0, 0.5]] {
        let law = Gaussian::independent(mean, [1.5; 4]).unwrap();
        let still = crate::models::Glide(0.0);
        let found = predict_measurement(&still, &Energy, &law, Time::ZERO, Time::ZERO).unwrap();
        let (norm, v) = (mean.iter().map(|m| m * m).sum::<f64>(), 2.25);
        assert!((found.mean[0] - (norm + 4.0 * v)).abs() < 1e-12);
        assert!((found.covariance.0[0][0] - (4.0 * v * norm + 8.0 * v * v + 1.0)).abs() < 1e-11);
    }
}

/// The textbook's sum with its weights of the centre (Wan and van der Merwe 2000), for a motion that is
/// linear neither in x nor in w; the rewritten sum must give the same.
#[test]
fn the_rewritten_sum_is_the_textbooks() {
    let law = Gaussian::new([0.7], Matrix([[0.3]])).unwrap();
    let (from, to) = (Time::ZERO, Time::from_secs(0.5));
    for (alpha, beta, kappa) in
        [(1.0, 1.0, 0.0), (0.5, 2.0, 0.0), (1.0, 0.0, 1.0), (0.3, 2.0, 1.0), (1.0, 2.0, -0.5)]
    {
        let c: f64 = alpha * alpha * (2.0 + kappa);
        let f = |x: f64, w: f64| Wobble::apply(&0.5, [x], [w])[0];
        let (dx, dw) = ((c * 0.3).sqrt(), c.sqrt());
        let images = [f(0.7 + dx, 0.0), f(0.7 - dx, 0.0), f(0.7, dw), f(0.7, -dw)];
        let centre = f(0.7, 0.0);
        let weight_mean = 1.0 - 2.0 / c;
        let weight_covariance = weight_mean + 1.0 - alpha * alpha + beta;
        let mean = weight_mean * centre + images.iter().sum::<f64>() / (2.0 * c);
        let variance = weight_covariance * (centre - mean).powi(2)
            + images.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / (2.0 * c);

        let points = SigmaPoints { alpha, beta, kappa: Some(kappa) };
        let filter = Unscented::new(Wobble, direct(1.0), law, points).unwrap();
        let found = filter.predict(&law, from, to).unwrap();
        // The weights of the textbook are up to 1 / c = 4 in size: a few eps of numbers of order one, times that.
        assert!((found.mean()[0] - mean).abs() < 1e-13, "{points:?}");
        assert!((found.covariance().0[0][0] - variance).abs() < 1e-13, "{points:?}");
    }
}

/// beta >= -alpha^2 kappa / n is the border between covariances and indefinite matrices.
#[test]
fn parameters_without_a_law_are_refused() {
    let law = Gaussian::new([0.7], Matrix([[0.3]])).unwrap();
    let refused = |alpha, beta, kappa| {
        let points = SigmaPoints { alpha, beta, kappa };
        Unscented::new(Wobble, direct(1.0), law, points).is_err()
    };
    // n is 2 for the motion and 1 for the measurement.
    assert!(refused(1.0, 0.2, Some(-0.5)));
    assert!(refused(1.0, 0.0, Some(-2.0)));
    assert!(refused(0.0, 2.0, None));
    assert!(
        refused(f64::NAN, 2.0, None)
            && refused(1.0, f64::NAN, None)
            && refused(1.0, 1.0, Some(f64::INFINITY))
    );
    assert!(!refused(1.0, 0.6, Some(-0.5)));
}

/// The often seen kappa = 3 - n with beta = 0 gives this sum of squares of eight variables a negative variance: the
/// mistake that the refusal keeps out. By hand: images of 8 axes are 3, the centre's is 0; c = 3, the centre weighs
/// -5/3 and the mean is 8, so the variance is -5/3 8^2 + 16/6 5^2 = -40.
#[test]
fn a_negative_variance_by_the_book() {
    let (weight, mean) = (-5.0 / 3.0, 8.0);
    let variance: f64 = weight * mean * mean + 16.0 / 6.0 * (3.0f64 - mean).powi(2);
    assert!((variance + 40.0).abs() < 1e-12);
    let law = Gaussian::independent([0.0; 4], [1.0; 4]).unwrap();
    let book = SigmaPoints { alpha: 1.0, beta: 0.0, kappa: Some(3.0 - 8.0) };
    assert!(Unscented::new(crate::models::Glide(1.0), Energy, law, book).is_err());
    let default = Unscented::new(crate::models::Glide(1.0), Energy, law, SigmaPoints::default()).unwrap();
    let (posterior, _) = default.update(&law, &[4.0], Time::ZERO).unwrap();
    assert!(Cholesky::of("P", posterior.covariance()).is_ok());
}

/// Range and bearing squared of a state of two components that moves as x + sin(y) + w: the cubature filter
/// by its source's algorithms (Arasaratnam and Haykin 2009, section III) with 2 n points of weight 1 / 2 n
/// and sums about the mean, written anew. A curved function tells square roots apart, so both take the same
/// one.
#[test]
fn cubature_is_its_twin_of_2n_points() {
    struct Swing;
    impl Motion<2, 1> for Swing {
        type Step = f64;
        fn over(&self, from: Time, to: Time) -> Result<f64> {
            Ok((to - from).secs())
        }
        fn apply<R: Real>(dt: &f64, [x, y]: [R; 2], [w]: [R; 1]) -> [R; 2] {
            let (s, c) = y.sin_cos();
            [x + s * *dt, y + (c + 2.0) * w * *dt]
        }
    }
    struct Both;
    impl Measurement<2> for Both {
        type Value = [f64; 2];
        type Given<'z> = ();
        fn given<'z>(&'z self, _: &'z [f64; 2], _: Time) -> Result<()> {
            Ok(())
        }
        fn log_likelihood<R: Real>(_: &(), x: [R; 2]) -> R {
            x[0].constant(f64::NAN)
        }
    }
    impl GaussianMeasurement<2, 2> for Both {
        fn predict<R: Real>(&self, _: Time, [x, y]: [R; 2]) -> [R; 2] {
            [x.hypot(y), x * y]
        }
        fn components(&self, z: &[f64; 2]) -> [f64; 2] {
            *z
        }
        fn covariance(&self) -> [[f64; 2]; 2] {
            [[0.5, 0.1], [0.1, 0.8]]
        }
    }
    /// The points of a law with this square root, one after the other.
    fn points<const N: usize>(mean: [f64; N], root: Matrix<N, N>) -> Vec<[f64; N]> {
        let root = root * (N as f64).sqrt();
        let point = |sign: f64, j: usize| std::array::from_fn(|i| mean[i] + sign * root.0[i][j]);
        [1.0, -1.0].into_iter().flat_map(|sign| (0..N).map(move |j| point(sign, j))).collect()
    }
    /// Means of a_i, and of (a_i - mean a)(b_i - mean b)'.
    fn mean<const N: usize>(a: &[[f64; N]]) -> [f64; N] {
        std::array::from_fn(|i| a.iter().map(|a| a[i]).sum::<f64>() / a.len() as f64)
    }
    fn cross<const N: usize, const M: usize>(a: &[[f64; N]], b: &[[f64; M]]) -> Matrix<N, M> {
        let (ma, mb) = (mean(a), mean(b));
        let term =
            |i: usize, j: usize| a.iter().zip(b).map(|(a, b)| (a[i] - ma[i]) * (b[j] - mb[j])).sum::<f64>();
        Matrix::from_entries(|i, j| term(i, j) / a.len() as f64)
    }

    let law = Gaussian::new([3.0, -1.0], Matrix([[0.6, 0.2], [0.2, 0.4]])).unwrap();
    let (to, z) = (Time::from_secs(0.5), [2.5, -3.0]);
    // Noise is one more variable.
    let root = |p: &Matrix<2, 2>| Cholesky::semidefinite("P", p).unwrap();
    let [[a, b], [c, d]] = root(law.covariance()).0;
    let augmented = Matrix([[a, b, 0.0], [c, d, 0.0], [0.0, 0.0, 1.0]]);
    let images: Vec<[f64; 2]> = points([3.0, -1.0, 0.0], augmented)
        .iter()
        .map(|&[x, y, w]| Swing::apply(&0.5, [x, y], [w]))
        .collect();
    let (predicted, covariance) = (mean(&images), cross(&images, &images));
    let states = points(predicted, root(&covariance));
    let seen: Vec<[f64; 2]> = states.iter().map(|&x| Both.predict(to, x)).collect();
    let s = cross(&seen, &seen) + Matrix(Both.covariance());
    let gain = cross(&states, &seen) * Cholesky::of("S", &s).unwrap().inverse();
    let nu = mean(&seen).map(|m| -m);
    let nu = [z[0] + nu[0], z[1] + nu[1]];
    let correction = gain * nu;
    let posterior = covariance - gain.congruence(&s);
    let evidence = Gaussian::new([0.0; 2], s).unwrap().log_density(&nu).unwrap();

    let filter = Unscented::new(Swing, Both, law, SigmaPoints::cubature()).unwrap();
    let mut belief = zerre::filter::Filter::start(&filter, Time::ZERO, zerre::rng::Stream::new(0)).unwrap();
    let update = zerre::filter::Filter::step(&filter, &mut belief, to, Some(&z)).unwrap();
    for i in 0..2 {
        assert!((belief.state.mean()[i] - predicted[i] - correction[i]).abs() < 1e-12);
    }
    assert!((*belief.state.covariance() - posterior).max_abs() < 1e-12);
    assert!((update.log_evidence - evidence).abs() < 1e-12);
}
