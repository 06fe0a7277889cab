//! Estimates of a cloud beside their definitions, computed from its particles and weights one after the other.

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use zerre::belief::{Cloud, Gaussian};
use zerre::filter::{Filter, ParticleFilter, Settings};
use zerre::math::Matrix;
use zerre::model::measurement::Position;
use zerre::model::motion::RandomWalk;
use zerre::resample::Trigger;
use zerre::rng::Stream;
use zerre::{Error, Time};

/// A cloud of uneven weights.
fn cloud(n: usize, seed: u64, sd: f64) -> Cloud<2> {
    let prior = Gaussian::independent([3.0, -1.0], [2.0, 0.5]).unwrap();
    let (motion, sensor) = (RandomWalk::<2>::new(0.1).unwrap(), Position::<2>::new(sd).unwrap());
    let settings = Settings { particles: n, trigger: Trigger::Never, ..Settings::default() };
    let filter = ParticleFilter::new(prior, motion, sensor, settings).unwrap();
    let mut cloud = filter.start(Time::ZERO, Stream::new(seed)).unwrap();
    for k in 1..3 {
        filter.step(&mut cloud, Time::from_secs(f64::from(k)), Some(&[4.0, -1.2])).unwrap();
    }
    cloud
}

/// (weight, particle), from the lightest to the heaviest.
fn particles(cloud: &Cloud<2>) -> Vec<(f64, [f64; 2])> {
    let mut all: Vec<_> = cloud.weights().enumerate().map(|(i, w)| (w, cloud.particle(i))).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}

fn mean_of(particles: &[(f64, [f64; 2])]) -> [f64; 2] {
    let total: f64 = particles.iter().map(|p| p.0).sum();
    [0, 1].map(|k| particles.iter().map(|(w, x)| w * x[k]).sum::<f64>() / total)
}

/// Sums of n terms in different orders differ by n eps of the sum of their sizes.
fn near(a: f64, b: f64, scale: f64, n: usize) -> bool {
    (a - b).abs() <= 4.0 * f64::EPSILON * scale * n as f64
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 60,
        rng_seed: RngSeed::Fixed(3),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn estimates_are_what_they_are_called(n in 1usize..1500, seed in any::<u64>(), sd in 0.05..5.0f64) {
        let cloud = cloud(n, seed, sd);
        let all = particles(&cloud);
        let total: f64 = all.iter().map(|p| p.0).sum();
        prop_assert!(near(total, 1.0, 1.0, n));
        let ess = 1.0 / all.iter().map(|p| p.0 * p.0).sum::<f64>();
        prop_assert!(near(cloud.ess() / ess, 1.0, 1.0, n));

        let mean = mean_of(&all);
        for k in 0..2 {
            prop_assert!(near(cloud.mean()[k], mean[k], 10.0, n));
            for l in 0..2 {
                let c: f64 = all.iter().map(|(w, x)| w * (x[k] - mean[k]) * (x[l] - mean[l])).sum();
                prop_assert!(near(cloud.covariance().0[k][l], c, 100.0, n));
            }
        }
        prop_assert_eq!(cloud.max_weight(), all[n - 1].1);

        for share in [1e-9, 0.1, 0.5, 1.0] {
            let count = ((share * n as f64).ceil() as usize).max(1);
            let best = mean_of(&all[n - count..]);
            let found = cloud.robust_mean(share).unwrap();
            prop_assert!(near(found[0], best[0], 10.0, n) && near(found[1], best[1], 10.0, n));
        }

        let levels = [0.0, 0.025, 0.5, 0.975, 1.0];
        for k in 0..2 {
            let found = cloud.quantiles(k, levels).unwrap();
            prop_assert!(found.is_sorted());
            for (q, level) in found.iter().zip(levels) {
                let up_to: f64 = all.iter().filter(|p| p.1[k] <= *q).map(|p| p.0).sum();
                let below: f64 = all.iter().filter(|p| p.1[k] < *q).map(|p| p.0).sum();
                let slack = 4.0 * f64::EPSILON * n as f64;
                prop_assert!(up_to >= level - slack && below <= level + slack, "{level}: {below} {up_to}");
            }
        }
    }
}

/// Five particles whose weights are known: likelihoods exp(0), exp(-1/2), exp(-2) around the measured place.
#[test]
fn by_hand() {
    let columns = [vec![0.0, 1.0, -1.0, 2.0, -2.0]];
    let settings = Settings { particles: 5, trigger: Trigger::Never, ..Settings::default() };
    struct Given([Vec<f64>; 1]);
    impl zerre::filter::Prior<1> for Given {
        fn columns(&self, _: Stream, _: usize) -> zerre::Result<[Vec<f64>; 1]> {
            Ok(self.0.clone())
        }
    }
    let (motion, sensor) = (RandomWalk::<1>::new(1.0).unwrap(), Position::<1>::new(1.0).unwrap());
    let filter = ParticleFilter::new(Given(columns), motion, sensor, settings).unwrap();
    let mut cloud = filter.start(Time::ZERO, Stream::new(0)).unwrap();
    // Equal weights, before anything is seen.
    assert_eq!((cloud.mean(), cloud.covariance(), cloud.ess()), ([0.0], Matrix([[2.0]]), 5.0));
    assert_eq!(cloud.quantiles(0, [0.1, 0.2, 0.21, 0.5, 1.0]).unwrap(), [-2.0, -2.0, -1.0, 0.0, 2.0]);
    assert_eq!(cloud.max_weight(), [0.0]);

    let update = filter.step(&mut cloud, Time::ZERO, Some(&[0.0])).unwrap();
    let (one, two) = ((-0.5f64).exp(), (-2.0f64).exp());
    let total = 1.0 + 2.0 * (one + two);
    let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-15, "{a} {b}");
    close(cloud.mean()[0], 0.0);
    close(cloud.covariance().0[0][0], 2.0 * (one + 4.0 * two) / total);
    close(cloud.ess() / (total * total / (1.0 + 2.0 * (one * one + two * two))), 1.0);
    let evidence = (total / 5.0 / std::f64::consts::TAU.sqrt()).ln();
    close(update.log_evidence, evidence);
    assert_eq!(cloud.max_weight(), [0.0]);
    // The best three fifths.
    close(cloud.robust_mean(0.6).unwrap()[0], 0.0);
    assert_eq!(cloud.quantiles(0, [0.5, 0.99]).unwrap(), [0.0, 2.0]);
    let gaussian = cloud.gaussian().unwrap();
    assert_eq!((*gaussian.mean(), *gaussian.covariance()), (cloud.mean(), cloud.covariance()));
}

#[test]
fn shares_and_levels_out_of_range() {
    let cloud = cloud(10, 1, 1.0);
    for bad in [0.0, -0.1, 1.1, f64::NAN] {
        assert!(matches!(cloud.robust_mean(bad), Err(Error::OutOfRange { .. })), "{bad}");
    }
    for bad in [-1e-9, 1.1, f64::NAN, f64::INFINITY] {
        assert!(matches!(cloud.quantiles(0, [0.5, bad]), Err(Error::OutOfRange { .. })), "{bad}");
    }
}

/// A fork has the same particles and other numbers; the same label gives the same fork.
#[test]
fn forks_part() {
    let prior = Gaussian::independent([0.0; 2], [1.0; 2]).unwrap();
    let (motion, sensor) = (RandomWalk::<2>::new(1.0).unwrap(), Position::<2>::new(1.0).unwrap());
    let filter = ParticleFilter::new(prior, motion, sensor, Settings::default()).unwrap();
    let cloud = filter.start(Time::ZERO, Stream::new(0)).unwrap();
    let next = |mut cloud: Cloud<2>| {
        filter.step(&mut cloud, Time::from_secs(1.0), None).unwrap();
        cloud.column(0).to_vec()
    };
    assert_eq!(cloud.fork(1).column(0), cloud.column(0));
    assert_eq!(next(cloud.fork(1)), next(cloud.fork(1)));
    assert_ne!(next(cloud.fork(1)), next(cloud.fork(2)));
    assert_ne!(next(cloud.fork(1)), next(cloud));
}
