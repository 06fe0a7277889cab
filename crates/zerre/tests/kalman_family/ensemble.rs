//! The ensemble Kalman filter: what a correction does to moments, and what it refuses.

use crate::models::{Glide, Polar, Rows, positions};
use zerre::belief::{Cloud, Gaussian};
use zerre::filter::{
    Correcting, Ensemble, EnsembleSettings, Filter, Kalman, Outcome, ParticleFilter, Prior, Settings, Update,
};
use zerre::kernels::{Simd, Threads};
use zerre::math::Matrix;
use zerre::model::measurement::{HeavyTailed, Position};
use zerre::resample::Trigger;
use zerre::rng::Stream;
use zerre::{Error, Time};

fn prior() -> Gaussian<4> {
    Gaussian::independent([1.0, 0.5, -2.0, 0.1], [3.0, 1.0, 2.0, 1.0]).unwrap()
}

fn filter<const M: usize>(
    sensor: Rows<4, M>,
    members: usize,
    correcting: Correcting,
) -> Ensemble<4, 4, M, Glide, Rows<4, M>> {
    let settings = EnsembleSettings { members, correcting, ..EnsembleSettings::default() };
    Ensemble::new(prior(), Glide(0.1), sensor, settings).unwrap()
}

/// Mean and covariance of the members, the latter divided by one less than their number.
fn moments(cloud: &Cloud<4>) -> Gaussian<4> {
    let n = cloud.len() as f64;
    Gaussian::new(cloud.mean(), cloud.covariance() * (n / (n - 1.0))).unwrap()
}

/// One measurement of a fresh ensemble: moments before, moments after, what it said.
fn corrected<const M: usize>(
    sensor: Rows<4, M>,
    members: usize,
    correcting: Correcting,
    z: [f64; M],
) -> (Gaussian<4>, Gaussian<4>, Update) {
    let filter = filter(sensor, members, correcting);
    let mut cloud = filter.start(Time::ZERO, Stream::new(3)).unwrap();
    let before = moments(&cloud);
    let update = filter.step(&mut cloud, Time::ZERO, Some(&z)).unwrap();
    (before, moments(&cloud), update)
}

/// For a linear measurement the members' mean, and with square roots their covariance too, are the Kalman
/// filter's for a prior of the members' moments: a few roundings of sums of n numbers, below 1e-11.
#[test]
fn a_correction_is_kalmans_for_the_moments_of_the_members() {
    let correlated = positions(0.7);
    let three = Rows {
        h: Matrix([[1.0, 0.0, 0.5, 0.0], [0.0, 2.0, 0.0, -1.0], [0.3, 0.0, 1.0, 1.0]]),
        r: Matrix([[2.0, 0.4, -0.3], [0.4, 1.0, 0.2], [-0.3, 0.2, 0.5]]),
    };
    fn check<const M: usize>(sensor: Rows<4, M>, z: [f64; M]) {
        for members in [M + 2, 40, 512, 1300] {
            for correcting in [Correcting::Perturbed, Correcting::SquareRoot] {
                let (before, after, update) = corrected(sensor, members, correcting, z);
                let kalman = Kalman::new(Glide(0.1), sensor, before).unwrap();
                let (exact, said) = kalman.update(&before, &z, Time::ZERO).unwrap();
                let what = format!("{members} {correcting:?}");
                for i in 0..4 {
                    assert!((after.mean()[i] - exact.mean()[i]).abs() < 1e-11, "{what}");
                }
                assert!((update.log_evidence - said.log_evidence).abs() < 1e-11, "{what}");
                assert_eq!(update.outcome, Outcome::Updated);
                let gap = (*after.covariance() - *exact.covariance()).max_abs();
                match correcting {
                    Correcting::SquareRoot => assert!(gap < 1e-11, "{what}: {gap}"),
                    // Draws show; see below for how much.
                    Correcting::Perturbed => assert!(gap > 1e-6, "{what}"),
                }
            }
        }
    }
    check(correlated, [2.0, 1.0]);
    check(three, [2.0, 1.0, -3.0]);
}

/// Perturbed members spread as they should on average. Over 200 ensembles of 100, the covariances that a
/// correction leaves less those of Kalman for the same members average zero: five standard errors from their
/// own spread.
#[test]
fn perturbations_have_the_law_of_the_measurement() {
    let filter = filter(positions(0.7), 100, Correcting::Perturbed);
    let gaps: Vec<Matrix<4, 4>> = (0..200)
        .map(|run| {
            let mut cloud = filter.start(Time::ZERO, Stream::new(90).fork(run)).unwrap();
            let before = moments(&cloud);
            filter.step(&mut cloud, Time::ZERO, Some(&[2.0, 1.0])).unwrap();
            let kalman = Kalman::new(Glide(0.1), positions(0.7), before).unwrap();
            let (exact, _) = kalman.update(&before, &[2.0, 1.0], Time::ZERO).unwrap();
            *moments(&cloud).covariance() - *exact.covariance()
        })
        .collect();
    let n = gaps.len() as f64;
    for i in 0..4 {
        for j in 0..4 {
            let mean = gaps.iter().map(|gap| gap.0[i][j]).sum::<f64>() / n;
            let square = gaps.iter().map(|gap| (gap.0[i][j] - mean).powi(2)).sum::<f64>();
            let error = (square / (n - 1.0) / n).sqrt();
            // The mistake to find: without perturbations x has variance K R K' = 0.4 too little, forty
            // errors.
            assert!(mean.abs() < 5.0 * error && error < 0.01, "{i} {j}: {mean} of {error}");
        }
    }
}

/// Beliefs and updates of a few steps, as text.
fn account(settings: EnsembleSettings) -> String {
    let sensor = Polar::<true> { range_sd: 0.5, bearing_sd: 0.05 };
    let filter = Ensemble::new(prior(), Glide(0.1), sensor, settings).unwrap();
    let mut cloud = filter.start(Time::ZERO, Stream::new(4)).unwrap();
    let mut text = String::new();
    for k in 0..4 {
        let z = (k != 2).then_some([2.5 + f64::from(k), -1.0]);
        let update = filter.step(&mut cloud, Time::from_secs(f64::from(k)), z.as_ref()).unwrap();
        text += &format!("{update:?} {}\n", serde_json::to_string(&cloud).unwrap());
    }
    text
}

#[test]
fn neither_threads_nor_lanes_show() {
    for members in [4, 5001] {
        for correcting in [Correcting::Perturbed, Correcting::SquareRoot] {
            let settings = EnsembleSettings { members, correcting, ..EnsembleSettings::default() };
            let naive = account(EnsembleSettings { simd: Simd::scalar(), ..settings.clone() });
            for simd in Simd::available() {
                for threads in [Threads::Serial, Threads::new(3).unwrap()] {
                    let found = account(EnsembleSettings { simd, threads, ..settings.clone() });
                    assert!(found == naive, "{members} {correcting:?} {}", simd.name());
                }
            }
        }
    }
}

/// A target on the cut of the bearings, at (-10, 0): members on either side agree that z = pi - 0.01 is near.
/// The correction is Kalman's with the tangent at the mean, up to the curvature of 0.1 m in 10 m: half a per
/// cent.
#[test]
fn bearings_across_the_cut() {
    let sensor = Polar::<true> { range_sd: 0.1, bearing_sd: 0.01 };
    let prior = Gaussian::independent([-10.0, 0.0, 0.0, 0.0], [0.1; 4]).unwrap();
    for correcting in [Correcting::Perturbed, Correcting::SquareRoot] {
        let settings = EnsembleSettings { members: 4000, correcting, ..EnsembleSettings::default() };
        let filter = Ensemble::new(prior, Glide(0.1), sensor, settings).unwrap();
        let mut cloud = filter.start(Time::ZERO, Stream::new(5)).unwrap();
        let start = cloud.mean();
        let z = std::f64::consts::PI - 0.01;
        filter.step(&mut cloud, Time::ZERO, Some(&[10.0, z])).unwrap();
        // Both of variance 0.01: half way from the mean of the members to y = 0.1. The gain errs by 1 /
        // sqrt(n) and more, of 0.05; 0.005 is six times that.
        let expected = 0.5 * (start[2] + 0.1);
        assert!((cloud.mean()[2] - expected).abs() < 0.005, "{} {expected}", cloud.mean()[2]);
    }
}

#[test]
fn what_is_no_ensemble_is_refused() {
    let new = |members| {
        let settings = EnsembleSettings { members, ..EnsembleSettings::default() };
        Ensemble::new(prior(), Glide(0.1), positions(1.0), settings)
    };
    for members in [0, 1, 3, (1 << 26) + 1] {
        let refusal = new(members).unwrap_err();
        assert!(matches!(refusal, Error::OutOfRange { what: "number of members", .. }), "{members}");
    }
    let filter = new(4).unwrap();
    let robust = HeavyTailed::student_t(Position::<2>::new(1.0).unwrap(), 3.0).unwrap();
    let refused = Ensemble::new(prior(), Glide(0.1), robust, EnsembleSettings::default());
    assert!(matches!(refused, Err(Error::Unsupported(_))));

    // Too small, though made elsewhere; and weights that are not equal.
    let small = prior().columns(Stream::new(1), 3).unwrap();
    let mut small = Cloud::from_columns(Time::ZERO, Stream::new(1), small).unwrap();
    assert!(filter.step(&mut small, Time::ZERO, None).is_err());
    let sensor = Position::<2>::new(1.0).unwrap();
    let settings = Settings { particles: 50, trigger: Trigger::Never, ..Settings::default() };
    let particles = ParticleFilter::new(prior(), Glide(0.1), sensor, settings).unwrap();
    let mut weighted = particles.start(Time::ZERO, Stream::new(1)).unwrap();
    assert!(filter.step(&mut weighted, Time::ZERO, None).is_ok());
    particles.step(&mut weighted, Time::ZERO, Some(&[1.0, 1.0])).unwrap();
    assert!(matches!(filter.step(&mut weighted, Time::ZERO, None), Err(Error::Unsupported(_))));
}
