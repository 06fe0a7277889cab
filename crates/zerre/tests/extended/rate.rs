//! How many points a scan has.

use crate::poisson;
use zerre::Error;
use zerre::extended::rate::Rate;
use zerre::rng::{Draws, Purpose, Stream};

fn draws(seed: u64) -> Draws {
    Stream::new(seed).draws(Purpose::Measurement, 0, 0)
}

/// ln p of all counts, each given those before.
fn score(mut rate: Rate, counts: &[usize]) -> f64 {
    let mut sum = 0.0;
    for count in counts {
        rate.predict();
        sum += rate.log_probability(*count);
        rate.update(*count as f64);
    }
    sum
}

/// Probabilities of counts sum to one, and their mean is that of the rate: a negative binomial law, in numbers.
#[test]
fn counts_have_a_law() {
    for (mean, scans) in [(9.0, 0.5), (0.3, 2.0), (40.0, 100.0)] {
        let rate = Rate::new(mean, scans, 1.0).unwrap();
        let (mut sum, mut first) = (0.0, 0.0);
        for count in 0..4000 {
            let p = rate.log_probability(count).exp();
            sum += p;
            first += p * count as f64;
        }
        // What is left beyond 4 000 is far below rounding.
        assert!((sum - 1.0).abs() < 1e-9 && (first - mean).abs() < 1e-6 * mean, "{sum} {first}");
    }
}

/// The posterior of a constant rate is Gamma: mean (a + sum of counts) / (b + scans).
#[test]
fn a_constant_rate_is_conjugate() {
    let mut rate = Rate::new(4.0, 2.0, 1.0).unwrap();
    for count in [3.0, 0.0, 7.0] {
        rate.predict();
        rate.update(count);
    }
    assert!((rate.mean() - 18.0 / 5.0).abs() < 1e-14);
}

/// Counts that are over-dispersed, their rate wandering between 3 and 15, or that fail altogether every fifth time, are
/// foretold better by a rate that forgets. The gain is some nats a scan in 300 scans; that all of ten runs show it by
/// chance has probability 1e-3.
#[test]
fn forgetting_pays_where_counts_are_over_dispersed() {
    for seed in 0..10 {
        let mut d = draws(seed);
        let wandering: Vec<usize> =
            (0..300).map(|k| poisson(&mut d, 9.0 + 6.0 * (f64::from(k) / 15.0).sin())).collect();
        let with = |keep| score(Rate::new(9.0, 1.0, keep).unwrap(), &wandering);
        assert!(with(0.9) > with(1.0), "{seed}: {} {}", with(0.9), with(1.0));
        // Bursts without points: a few scans in a row.
        let bursts: Vec<usize> =
            (0..300).map(|k| if k / 10 % 5 == 0 { 0 } else { poisson(&mut d, 9.0) }).collect();
        let with = |keep| score(Rate::new(9.0, 1.0, keep).unwrap(), &bursts);
        assert!(with(0.7) > with(1.0), "{seed}: {} {}", with(0.7), with(1.0));
        // Where it is constant, a constant rate is the better one.
        let steady: Vec<usize> = (0..300).map(|_| poisson(&mut d, 9.0)).collect();
        let with = |keep| score(Rate::new(9.0, 1.0, keep).unwrap(), &steady);
        assert!(with(1.0) > with(0.8), "{seed}: {} {}", with(1.0), with(0.8));
    }
}

#[test]
fn rates_that_mean_nothing_are_refused() {
    for (mean, scans, keep) in [(0.0, 1.0, 1.0), (1.0, 0.0, 1.0), (1.0, 1.0, 0.0), (f64::NAN, 1.0, 1.0)] {
        assert!(Rate::new(mean, scans, keep).is_err());
    }
    assert!(matches!(Rate::new(1.0, 1.0, 1.5), Err(Error::OutOfRange { .. })));
}
