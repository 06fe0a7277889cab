//! Chains and maxima of the likelihood.

use crate::law::laws;
use crate::{agrees, exact, nile, quadrature, variances};
use std::cell::Cell;
use zerre::belief::Gaussian;
use zerre::filter::{ParticleFilter, Settings};
use zerre::math::Matrix;
use zerre::model::{measurement::Position, motion::RandomWalk};
use zerre::parameter::{
    ChainSettings, Law, Parameters, log_likelihood, maximum_likelihood, particle_metropolis_hastings,
};
use zerre::rng::{Purpose, Stream};
use zerre::{Error, Time};

/// Durbin and Koopman (2012, section 2.10.3) print 15 099 and 1 469.1 for a diffuse start. Here the level has
/// a variance of 1e7 at first, which moves the maximum by less than a thousandth; the likelihood, flat there,
/// is that of the reference, and no lower than at the printed values.
#[test]
fn the_maximum_is_the_published_one() {
    let Some(data) = nile() else { return };
    let printed = [15_099.0, 1469.1];
    let found = maximum_likelihood(&variances(), [5000.0, 5000.0], Stream::new(0), |theta, _| {
        exact(&data, theta, 1e7)
    });
    let best = found.unwrap();
    assert!((0..2).all(|k| (best.theta[k] / printed[k] - 1.0).abs() < 1e-3), "{best:?}");
    assert!((best.log_likelihood + 641.585_578).abs() < 1e-6 && best.evaluations > 20);
    assert!(best.log_likelihood >= exact(&data, &printed, 1e7).unwrap());
}

/// With exact likelihoods, and with those of 150 particles, whose logarithms have a standard deviation of
/// about one.
#[test]
fn chains_have_the_posterior_as_their_law() {
    let Some(data) = nile() else { return };
    let truth = quadrature(&data, &variances());
    let start = [10_000.0, 3000.0];
    let settings = ChainSettings { draws: 8000, burn_in: 1000, ..ChainSettings::default() };
    let chain = particle_metropolis_hastings(&variances(), start, settings, Stream::new(4), |theta, _| {
        exact(&data, theta, 4e4)
    })
    .unwrap();
    assert!((0.1..0.5).contains(&chain.accepted) && chain.impossible == 0, "{}", chain.accepted);
    assert_eq!(chain.draws.len(), 8000);
    agrees(&chain, &truth);

    let prior = Gaussian::new([1000.0], Matrix([[4e4]])).unwrap();
    let filter = |theta: &[f64; 2]| {
        let settings = Settings { particles: 150, ..Settings::default() };
        let (motion, sensor) = (RandomWalk::<1>::new(theta[1])?, Position::<1>::new(theta[0].sqrt())?);
        ParticleFilter::new(prior, motion, sensor, settings)
    };
    let settings = ChainSettings { draws: 4000, ..settings };
    let chain =
        particle_metropolis_hastings(&variances(), start, settings, Stream::new(5), |theta, stream| {
            log_likelihood(&filter(theta)?, Time::from_secs(1.0), &data, stream)
        })
        .unwrap();
    agrees(&chain, &truth);

    // The spread of the estimates, which a wrong chain would take for evidence.
    let theta = [15_099.0, 1469.1];
    let estimate =
        |r| log_likelihood(&filter(&theta).unwrap(), Time::from_secs(1.0), &data, Stream::new(r)).unwrap();
    let off: Vec<f64> = (0..50).map(|r| estimate(r) - exact(&data, &theta, 4e4).unwrap()).collect();
    let mean = off.iter().sum::<f64>() / 50.0;
    let sd = (off.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 49.0).sqrt();
    assert!((0.3..2.0).contains(&sd), "{sd}");
}

/// With common random numbers the estimate is a function, and its maximum lies within two posterior standard
/// deviations of the exact one: the error that the data leave anyway.
#[test]
fn particles_find_the_maximum() {
    let Some(data) = nile() else { return };
    let best = |particles: Option<usize>, seed| {
        maximum_likelihood(&variances(), [10_000.0, 3000.0], Stream::new(seed), |theta, stream| {
            let Some(particles) = particles else { return exact(&data, theta, 4e4) };
            let prior = Gaussian::new([1000.0], Matrix([[4e4]]))?;
            let settings = Settings { particles, ..Settings::default() };
            let (motion, sensor) = (RandomWalk::<1>::new(theta[1])?, Position::<1>::new(theta[0].sqrt())?);
            let filter = ParticleFilter::new(prior, motion, sensor, settings)?;
            log_likelihood(&filter, Time::from_secs(1.0), &data, stream)
        })
        .unwrap()
    };
    let (truth, [sa, sb]) = (best(None, 0), quadrature(&data, &variances()).sd);
    for seed in 0..4 {
        let found = best(Some(2000), seed);
        assert_eq!(found, best(Some(2000), seed));
        assert!((found.theta[0].ln() - truth.theta[0].ln()).abs() < 2.0 * sa, "{found:?} {truth:?}");
        assert!((found.theta[1].ln() - truth.theta[1].ln()).abs() < 2.0 * sb, "{found:?} {truth:?}");
    }
}

/// Without data the posterior is the prior: each free coordinate has its Jacobian.
#[test]
fn a_chain_without_data_has_the_prior_as_its_law() {
    for law in laws() {
        let parameters = Parameters::new([("x", law)]).unwrap();
        let start = parameters.draw(&mut Stream::new(1).draws(Purpose::Other, 0, 0));
        let settings = ChainSettings { draws: 40_000, burn_in: 2000, first_step: 0.5 };
        let chain =
            particle_metropolis_hastings(&parameters, start, settings, Stream::new(2), |_, _| Ok(0.0))
                .unwrap();
        assert!((0.3..0.6).contains(&chain.accepted), "{law:?}: {}", chain.accepted);
        let mut draws = Stream::new(3).draws(Purpose::Other, 0, 0);
        let drawn: Vec<f64> = (0..100_000).map(|_| (law.draw(&mut draws) / 2.0).tanh()).collect();
        let mean = drawn.iter().sum::<f64>() / 1e5;
        let (found, error) =
            (chain.mean(|x| (x[0] / 2.0).tanh()), chain.standard_error(|x| (x[0] / 2.0).tanh()));
        // Both are samples; the one of independent draws adds at most 1 / sqrt(1e5).
        assert!(
            (found - mean).abs() < 5.0 * (error * error + 1e-5).sqrt() && error < 0.02,
            "{law:?}: {found} {mean}"
        );
    }
}

/// Impossible values are passed over and counted; the estimate of the current value is never made anew.
#[test]
fn what_is_impossible_is_not_accepted() {
    let parameters = Parameters::new([("x", Law::Normal { mean: 0.0, sd: 1.0 })]).unwrap();
    let settings = ChainSettings { draws: 500, burn_in: 100, ..ChainSettings::default() };
    let calls = Cell::new(0);
    let run = |start: f64| {
        calls.set(0);
        particle_metropolis_hastings(&parameters, [start], settings, Stream::new(2), |&[x], _| {
            calls.set(calls.get() + 1);
            Ok(if x > 0.5 { f64::NEG_INFINITY } else { 0.0 })
        })
    };
    let chain = run(0.0).unwrap();
    assert!(chain.impossible > 0 && chain.draws.iter().all(|x| x[0] <= 0.5));
    assert_eq!(calls.get(), 601);
    assert_eq!(run(0.0).unwrap(), chain);
    assert!(run(1.0).is_err());
    let broken = particle_metropolis_hastings(&parameters, [0.0], settings, Stream::new(2), |&[x], _| {
        Ok(if x == 0.0 { 0.0 } else { f64::NAN })
    });
    assert!(matches!(broken, Err(Error::NotFinite { what: "log-likelihood", .. })));
    let wall = |&[x]: &[f64; 1], _| Ok(if x > 0.5 { f64::NEG_INFINITY } else { x });
    let best = maximum_likelihood(&parameters, [0.0], Stream::new(0), wall).unwrap();
    assert!((best.theta[0] - 0.5).abs() < 1e-4);
    assert!(maximum_likelihood(&parameters, [2.0], Stream::new(0), |_, _| Ok(f64::NEG_INFINITY)).is_err());
}
