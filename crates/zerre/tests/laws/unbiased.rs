//! Law 2: m draws contain m w_i copies of particle i on average, and what else each scheme promises.
//!
//! In every scheme a count is a fixed number plus a sum of independent Bernoulli numbers (independent draws, one per
//! stratum) or lies within one of its mean (systematic). In the first case the variance of the Bernoulli part is at
//! most m w_i (1 - w_i), in the second at most f (1 - f) <= 1/4 of the fraction f, and never above m w_i either.
//! Bernstein's inequality for the average of r repetitions then bounds the error, whatever the law, by
//! sqrt(2 v L / r) + 2 L / 3 r with v the variance, missed with probability 2 exp(-L). 23 532 counts are compared:
//! L = ln(2 * 23532 / 1e-3) = 17.7 makes all of them hold with probability 0.999, and is 5.9 standard errors wide.

use crate::list::RESAMPLINGS;
use crate::{Verdict, uphold};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use zerre::resample::Resampling;
use zerre::rng::Stream;

const LOG: f64 = 17.7;
const REPETITIONS: u64 = 2000;

/// Any way of resampling: ancestors of `m` draws from weights, for a seed.
type Draw<'a> = &'a dyn Fn(&[f64], u64, usize) -> Vec<u32>;

fn ancestors(scheme: Resampling, weights: &[f64], seed: u64, m: usize) -> Vec<u32> {
    let mut ancestors = vec![0; m];
    // Repeated calls of one stream differ by their step.
    scheme.ancestors(weights, Stream::new(9), seed, &mut ancestors).unwrap();
    ancestors
}

fn counts(ancestors: &[u32], n: usize) -> Vec<u32> {
    let mut counts = vec![0; n];
    for &a in ancestors {
        counts[a as usize] += 1;
    }
    counts
}

/// The law of averages.
fn unbiased(draw: Draw, weights: &[f64], m: usize) -> Verdict {
    let total: f64 = weights.iter().sum();
    let mut sums = vec![0u64; weights.len()];
    for repetition in 0..REPETITIONS {
        for a in draw(weights, repetition, m) {
            sums[a as usize] += 1;
        }
    }
    for (i, (&sum, w)) in sums.iter().zip(weights).enumerate() {
        let (w, r) = (w / total, REPETITIONS as f64);
        let (found, expected) = (sum as f64 / r, m as f64 * w);
        let variance = m as f64 * w * (1.0 - w);
        let allowed = (2.0 * variance * LOG / r).sqrt() + 2.0 * LOG / (3.0 * r);
        if (found - expected).abs() > allowed {
            return Err(format!("particle {i} has {found} copies of {expected} +- {allowed}"));
        }
    }
    Ok(())
}

/// The law of every single draw. Cumulative sums of n weights are off by n eps of their total: `slack` draws.
fn orderly(scheme: Option<Resampling>, ancestors: &[u32], weights: &[f64], m: usize) -> Verdict {
    let total: f64 = weights.iter().sum();
    if ancestors.len() != m || !ancestors.is_sorted() {
        return Err("ancestors are not sorted".into());
    }
    if ancestors.iter().any(|&a| a as usize >= weights.len()) {
        return Err("an ancestor that there is not".into());
    }
    let slack = 1e-9 + 4.0 * f64::EPSILON * (weights.len() * m) as f64;
    for (i, (&count, &w)) in counts(ancestors, weights.len()).iter().zip(weights).enumerate() {
        let (count, expected) = (f64::from(count), m as f64 * (w / total));
        if w == 0.0 && count > 0.0 {
            return Err(format!("particle {i} of weight zero was drawn"));
        }
        let within = match scheme {
            Some(Resampling::Systematic) => count > expected - 1.0 - slack && count < expected + 1.0 + slack,
            // A weight may touch two strata beyond those that it fills.
            Some(Resampling::Stratified) => count > expected - 2.0 - slack && count < expected + 2.0 + slack,
            Some(Resampling::Residual) => count >= (expected - slack).floor(),
            _ => true,
        };
        if !within {
            return Err(format!("particle {i} has {count} copies of {expected}"));
        }
    }
    Ok(())
}

/// Weights that have gone wrong somewhere: few and many, even and uneven, zeros at either end, one that has it all.
fn weights() -> Vec<(&'static str, Vec<f64>)> {
    let ramp = |n: usize| (1..=n).map(|i| i as f64).collect::<Vec<_>>();
    let one = |n: usize, at: usize| (0..n).map(|i| f64::from(u8::from(i == at))).collect::<Vec<_>>();
    vec![
        ("one", vec![0.3]),
        ("two", vec![0.9, 0.1]),
        ("even", vec![1.0 / 7.0; 7]),
        ("ramp", ramp(20)),
        ("more than a block", ramp(300)),
        ("one has all, first", one(10, 0)),
        ("one has all, last", one(10, 9)),
        ("one has all, of many", one(600, 300)),
        ("zeros", (0..40).map(|i| if i % 3 == 1 { 0.0 } else { 1.0 + i as f64 }).collect()),
        ("blocks of zeros", (0..900).map(|i| if (256..700).contains(&i) { 0.0 } else { 1.0 }).collect()),
        ("tiny", vec![1e-300, 3e-300, 0.0, 2e-300]),
        ("subnormal", vec![1e-310, 3e-310, 0.0, 2e-310]),
        ("tiny beside huge", vec![1e-300, 1e300, 1e-300, 1e300]),
        ("heavy tail", (1..60).map(|i| 1.0 / f64::from(i).powi(3)).collect()),
    ]
}

#[test]
fn copies_are_in_proportion() {
    let mut verdicts = Vec::new();
    for (name, weights) in weights() {
        for scheme in RESAMPLINGS {
            // As many draws as particles, fewer, more.
            let n = weights.len();
            for m in [n, n / 2 + 1, 3 * n + 1] {
                let draw = |w: &[f64], seed: u64, m: usize| ancestors(scheme, w, seed, m);
                verdicts.push((format!("{scheme:?} {m} of {name}"), unbiased(&draw, &weights, m)));
                for seed in 0..20 {
                    let drawn = ancestors(scheme, &weights, seed, m);
                    let verdict = orderly(Some(scheme), &drawn, &weights, m);
                    verdicts.push((format!("{scheme:?} {m} of {name}, seed {seed}"), verdict));
                }
            }
        }
    }
    uphold(verdicts);
}

/// A million draws: rounding in the cumulative sums must not show.
#[test]
fn many_draws() {
    let weights: Vec<f64> = (0..100_000).map(|i| f64::from(i % 100)).collect();
    uphold(RESAMPLINGS.map(|scheme| {
        let drawn = ancestors(scheme, &weights, 0, 1_000_000);
        (format!("{scheme:?}"), orderly(Some(scheme), &drawn, &weights, 1_000_000))
    }));
}

/// Equal weights, as 1/n rounds: every scheme but the multinomial leaves every particle one copy, so that resampling
/// a fresh cloud loses nobody.
#[test]
fn equal_weights_lose_nobody() {
    for n in [1, 2, 3, 7, 10, 49, 100, 255, 256, 257, 1000, 4099] {
        for weight in [1.0, 0.1, 1.0 / n as f64, 1e-200, std::f64::consts::PI] {
            for scheme in [Resampling::Residual, Resampling::Systematic, Resampling::Stratified] {
                let drawn = ancestors(scheme, &vec![weight; n], 1, n);
                let all: Vec<u32> = (0..n as u32).collect();
                assert!(drawn == all, "{scheme:?}, {n} times {weight}");
            }
        }
    }
}

#[test]
fn the_law_finds_wrong_resamplers() {
    let weights: Vec<f64> = (1..=20).map(f64::from).collect();
    let n = weights.len();
    // The cumulative sums are read one place too early.
    let off_by_one = |w: &[f64], seed: u64, m: usize| -> Vec<u32> {
        let shifted: Vec<f64> = w.iter().skip(1).chain([&0.0]).copied().collect();
        ancestors(Resampling::Multinomial, &shifted, seed, m)
    };
    assert!(unbiased(&off_by_one, &weights, n).is_err());
    // Always the middle of the strata: least noise, and wrong.
    let middle = |w: &[f64], _: u64, m: usize| -> Vec<u32> {
        let total: f64 = w.iter().sum();
        let position = |j: usize| (j as f64 + 0.5) / m as f64 * total;
        (0..m)
            .map(|j| {
                let mut sum = 0.0;
                w.iter().take_while(|&&w| (sum + w <= position(j)).then(|| sum += w).is_some()).count() as u32
            })
            .collect()
    };
    assert!(unbiased(&middle, &weights, n).is_err());
    // Only the whole copies, the rest to the heaviest.
    let greedy = |w: &[f64], _: u64, m: usize| -> Vec<u32> {
        let total: f64 = w.iter().sum();
        let mut drawn: Vec<u32> =
            (0..w.len()).flat_map(|i| vec![i as u32; (m as f64 * w[i] / total) as usize]).collect();
        drawn.resize(m, w.len() as u32 - 1);
        drawn
    };
    assert!(unbiased(&greedy, &weights, n).is_err());
    // Two thousand multinomial draws with one of them at a place of weight zero.
    let mut drawn = ancestors(Resampling::Multinomial, &[0.5, 0.0, 0.5], 0, 2000);
    orderly(None, &drawn, &[0.5, 0.0, 0.5], 2000).unwrap();
    let middle = drawn.partition_point(|&a| a == 0);
    drawn[middle] = 1;
    assert!(orderly(None, &drawn, &[0.5, 0.0, 0.5], 2000).is_err());
    // Multinomial counts spread further than the others promise.
    for scheme in [Resampling::Systematic, Resampling::Stratified, Resampling::Residual] {
        let judge = |seed| {
            let drawn = ancestors(Resampling::Multinomial, &weights, seed, n);
            orderly(Some(scheme), &drawn, &weights, n)
        };
        assert!((0..20).any(|seed| judge(seed).is_err()), "{scheme:?}");
    }
}

/// Var of the count of particle i as the schemes have it, from 20 000 repetitions: multinomial m w (1 - w), and less
/// for the others. The standard error of a variance of nearly normal counts is sqrt(2 / r) of it; five are allowed.
#[test]
fn the_spread_is_that_of_the_scheme() {
    let weights = [0.13, 0.27, 0.6];
    let (m, r) = (50, 20_000);
    let variance = |scheme, i: usize| {
        let all: Vec<f64> =
            (0..r).map(|seed| f64::from(counts(&ancestors(scheme, &weights, seed, m), 3)[i])).collect();
        let mean = all.iter().sum::<f64>() / r as f64;
        all.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / r as f64
    };
    for (i, w) in weights.into_iter().enumerate() {
        let multinomial = m as f64 * w * (1.0 - w);
        let found = variance(Resampling::Multinomial, i);
        assert!((found / multinomial - 1.0).abs() < 5.0 * (2.0 / r as f64).sqrt(), "{i}: {found}");
        assert!(variance(Resampling::Residual, i) < 0.1 * multinomial);
        assert!(variance(Resampling::Stratified, i) < 0.1 * multinomial);
        // f (1 - f) with f the fraction of m w: 6.5, 13.5, 30.
        let fraction = (m as f64 * w).fract();
        assert!(variance(Resampling::Systematic, i) < fraction * (1.0 - fraction) + 0.01);
    }
}

#[test]
fn wrong_weights_are_refused() {
    let mut out = [0; 4];
    for bad in [
        vec![],
        vec![0.0, 0.0],
        vec![1.0, -1e-300],
        vec![1.0, f64::NAN],
        vec![1.0, f64::INFINITY],
        vec![f64::MAX, f64::MAX],
    ] {
        for scheme in RESAMPLINGS {
            assert!(scheme.ancestors(&bad, Stream::new(0), 0, &mut out).is_err(), "{scheme:?} {bad:?}");
            assert!(scheme.counts(&bad, Stream::new(0), 0, 4).is_err(), "{scheme:?} {bad:?}");
        }
    }
    for scheme in RESAMPLINGS {
        scheme.ancestors(&[1.0, 2.0], Stream::new(0), 0, &mut []).unwrap();
        assert_eq!(scheme.counts(&[1.0, 2.0], Stream::new(0), 0, 0).unwrap(), [0, 0]);
    }
}

fn any_weight() -> impl Strategy<Value = f64> {
    prop_oneof![
        3 => Just(0.0),
        4 => 0.0..1.0,
        2 => (-700.0..690.0f64).prop_map(f64::exp),
        1 => (0u64..1 << 40).prop_map(f64::from_bits),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 400,
        rng_seed: RngSeed::Fixed(2),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn any_weights_give_orderly_draws(
        weights in prop::collection::vec(any_weight(), 1..700),
        m in 0usize..2000,
        seed in any::<u64>(),
    ) {
        let total: f64 = weights.iter().sum();
        for scheme in RESAMPLINGS {
            let mut drawn = vec![0; m];
            match scheme.ancestors(&weights, Stream::new(seed), 3, &mut drawn) {
                Err(_) => prop_assert!(total == 0.0 || !total.is_finite()),
                Ok(()) => {
                    let verdict = orderly(Some(scheme), &drawn, &weights, m);
                    prop_assert!(verdict.is_ok(), "{scheme:?}: {verdict:?}");
                    let counted = scheme.counts(&weights, Stream::new(seed), 3, m).unwrap();
                    prop_assert_eq!(counted, counts(&drawn, weights.len()));
                }
            }
        }
    }
}
