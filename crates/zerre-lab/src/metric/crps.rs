use super::MetricInfo;
use crate::distribution::normal_cdf;
use crate::error::{Error, Result};
use std::f64::consts::{PI, TAU};

pub(super) const INFO: MetricInfo = MetricInfo {
    name: "crps",
    about: "continuous ranked probability score of one component: error and honesty in one number, less is better",
    source: "Gneiting and Raftery, J. of the American Statistical Association 102, 2007, \
             doi:10.1198/016214506000001437",
    unit: "state",
};

/// The score of a weighted sample: the integral of `(F(x) - [x >= truth])^2`, exact, O(n log n). Weights need not
/// sum to one; none at all (an empty slice) means equal ones.
///
/// # Errors
/// [`Error::Empty`] without values or with weights that are all zero, [`Error::Shape`], [`Error::NotFinite`],
/// [`Error::OutOfRange`] for a negative weight.
pub fn crps_sample(values: &[f64], weights: &[f64], truth: f64) -> Result<f64> {
    if values.is_empty() {
        return Err(Error::Empty { what: "values of a sample" });
    }
    Error::all_finite("value of a sample", values)?;
    Error::all_finite("weight of a sample", weights)?;
    Error::all_finite("true value", &[truth])?;
    if !weights.is_empty() && weights.len() != values.len() {
        let (found, expected) = (weights.len(), values.len());
        return Err(Error::Shape { what: "weights", index: 0, found, expected });
    }
    if let Some(&value) = weights.iter().find(|w| **w < 0.0) {
        return Err(Error::OutOfRange { what: "a weight", value, needs: "it must not be negative" });
    }
    let weight = |i: usize| weights.get(i).copied().unwrap_or(1.0);
    let total: f64 = (0..values.len()).map(weight).sum();
    if total <= 0.0 {
        return Err(Error::Empty { what: "weights above zero" });
    }
    let mut sorted: Vec<(f64, f64)> = (0..values.len()).map(|i| (values[i], weight(i))).collect();
    sorted.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    Ok(crps_sorted(&sorted, truth))
}

/// The score of (value, weight) in the order of the values: finite, at least one weight above zero and none
/// below.
pub(crate) fn crps_sorted(sorted: &[(f64, f64)], truth: f64) -> f64 {
    let total: f64 = sorted.iter().map(|(_, weight)| weight).sum();
    // F is constant between neighbours, so the integral is a sum over gaps, split where the truth lies; before the
    // first value F is 0 and after the last it is 1.
    let (mut score, mut below, mut left) = (0.0, 0.0_f64, sorted.first().map_or(truth, |s| s.0).min(truth));
    let gap = |left: f64, right: f64, share: f64| {
        let (under, over) = ((right.min(truth) - left).max(0.0), (right - left.max(truth)).max(0.0));
        under * share * share + over * (1.0 - share) * (1.0 - share)
    };
    for &(value, weight) in sorted {
        score += gap(left, value, (below / total).min(1.0));
        left = value;
        below += weight;
    }
    score + gap(left, left.max(truth), 1.0)
}

/// The score of a normal forecast, in closed form; a standard deviation of zero gives the absolute error.
///
/// # Errors
/// [`Error::NotFinite`], or [`Error::OutOfRange`] for a negative standard deviation.
pub fn crps_gaussian(mean: f64, standard_deviation: f64, truth: f64) -> Result<f64> {
    Error::all_finite("forecast or true value", &[mean, standard_deviation, truth])?;
    if standard_deviation < 0.0 {
        let (value, needs) = (standard_deviation, "it must not be negative");
        return Err(Error::OutOfRange { what: "a standard deviation", value, needs });
    }
    if standard_deviation == 0.0 {
        return Ok((truth - mean).abs());
    }
    Ok(distance(truth - mean, standard_deviation) - standard_deviation / PI.sqrt())
}

/// The score of a mixture of normal laws, parts as (weight, mean, standard deviation): finite, weights not
/// negative and not all zero, standard deviations not negative. Closed form in O(n^2): E|X - y| - E|X - X'| /
/// 2 with the mean absolute value of each normal difference (Grimit, Gneiting, Berrocal and Johnson,
/// Quarterly J. of the Royal Meteorological Society 132, 2006).
pub(crate) fn crps_mixture(parts: &[(f64, f64, f64)], truth: f64) -> f64 {
    let total: f64 = parts.iter().map(|(weight, ..)| weight).sum();
    let mut score = 0.0;
    for (i, &(w, m, s)) in parts.iter().enumerate() {
        score += w / total * distance(truth - m, s);
        // Pairs are met once; a part against itself is half of a pair.
        for (j, &(v, n, t)) in parts[..=i].iter().enumerate() {
            let half = if i == j { 0.5 } else { 1.0 };
            score -= half * (w / total) * (v / total) * distance(m - n, s.hypot(t));
        }
    }
    score
}

/// E|X| of a normal X.
fn distance(mean: f64, sd: f64) -> f64 {
    if sd == 0.0 {
        return mean.abs();
    }
    let z = mean / sd;
    2.0 * sd * (-0.5 * z * z).exp() / TAU.sqrt() + mean * (2.0 * normal_cdf(z) - 1.0)
}

#[cfg(test)]
mod tests {
    use super::super::test_noise::Noise;
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    /// E|X - y| - E|X - X'| / 2, the definition by pairs, O(n^2).
    fn by_pairs(values: &[f64], weights: &[f64], truth: f64) -> f64 {
        let total: f64 = weights.iter().sum();
        let mut score = 0.0;
        for (x, w) in values.iter().zip(weights) {
            score += w / total * (x - truth).abs();
            for (y, v) in values.iter().zip(weights) {
                score -= 0.5 * (w / total) * (v / total) * (x - y).abs();
            }
        }
        score
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(8),
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        #[test]
        fn is_the_definition_by_pairs(
            sample in prop::collection::vec((-5.0..5.0, 0.01..3.0), 1..20), truth in -8.0..8.0
        ) {
            let (values, weights): (Vec<f64>, Vec<f64>) = sample.into_iter().unzip();
            let found = crps_sample(&values, &weights, truth).unwrap();
            // 420 terms below 13, whose shares sum to 3/2: as many roundings of half an ulp of a sum below 20.
            let rounding = 420.0 * 0.5 * 20.0 * f64::EPSILON;
            prop_assert!((found - by_pairs(&values, &weights, truth)).abs() < rounding);
        }
    }

    #[test]
    fn by_hand() {
        assert_eq!(crps_sample(&[2.0], &[], 5.0).unwrap(), 3.0);
        assert_eq!(crps_sample(&[2.0], &[], -1.0).unwrap(), 3.0);
        // Two values 0 and 1, truth 0: F = 1/2 between them.
        assert_eq!(crps_sample(&[1.0, 0.0], &[], 0.0).unwrap(), 0.25);
        // Weights that do not sum to one, and a value without weight.
        assert_eq!(crps_sample(&[1.0, 0.0, 9.0], &[2.0, 2.0, 0.0], 0.0).unwrap(), 0.25);
        // Standard normal at its mean: 2 phi(0) - 1 / sqrt(pi).
        assert!((crps_gaussian(0.0, 1.0, 0.0).unwrap() - 0.233_695_0).abs() < 1e-7);
        assert_eq!(crps_gaussian(1.0, 0.0, 3.5).unwrap(), 2.5);
    }

    /// The score of n draws is on average that of the law plus E|X - X'| / (2 n); by Efron and Stein its variance
    /// is at most sd^2 / n times a constant near 1 (each draw moves the score by no more than |change| / n).
    /// Tolerance: bias sd / (n sqrt(pi)) plus 5 sd / sqrt(n).
    #[test]
    fn a_sample_converges_to_the_closed_form() {
        let (mean, sd, n) = (3.0, 2.0, 20_000);
        let mut noise = Noise(3);
        let values: Vec<f64> = (0..n).map(|_| mean + sd * noise.normal()).collect();
        for truth in [-2.0, 3.0, 4.5, 11.0] {
            let tolerance = sd / (n as f64 * PI.sqrt()) + 5.0 * sd / (n as f64).sqrt();
            let (sample, exact) =
                (crps_sample(&values, &[], truth).unwrap(), crps_gaussian(mean, sd, truth).unwrap());
            assert!((sample - exact).abs() < tolerance, "{truth}: {sample} instead of {exact}");
        }
    }

    /// One part is the normal law; two halves of it are it too; two far points are the sample of their means.
    #[test]
    fn mixtures_in_closed_form() {
        for truth in [-2.0, 0.3, 5.0] {
            let normal = crps_gaussian(1.0, 2.0, truth).unwrap();
            for parts in [vec![(3.0, 1.0, 2.0)], vec![(0.25, 1.0, 2.0), (0.75, 1.0, 2.0)]] {
                assert!((crps_mixture(&parts, truth) - normal).abs() < 1e-12);
            }
            let points = crps_sample(&[0.0, 1.0], &[1.0, 3.0], truth).unwrap();
            assert!((crps_mixture(&[(1.0, 0.0, 0.0), (3.0, 1.0, 0.0)], truth) - points).abs() < 1e-12);
        }
        // By quadrature: the integral of (F(x) - [x >= y])^2 with steps of 1e-3, whose error is below the
        // step.
        let parts = [(0.3, -2.0, 0.5), (0.7, 1.0, 1.5)];
        let cdf = |x: f64| parts.iter().map(|(w, m, s)| w * normal_cdf((x - m) / s)).sum::<f64>();
        let sum: f64 = (-20_000..20_000)
            .map(|i| (f64::from(i) + 0.5) * 1e-3)
            .map(|x| (cdf(x) - f64::from(u8::from(x >= 0.4))).powi(2) * 1e-3)
            .sum();
        assert!((crps_mixture(&parts, 0.4) - sum).abs() < 1e-3);
    }

    #[test]
    fn refuses_bad_input() {
        assert!(matches!(crps_sample(&[], &[], 0.0), Err(Error::Empty { .. })));
        assert!(matches!(crps_sample(&[1.0], &[0.0], 0.0), Err(Error::Empty { .. })));
        assert!(matches!(crps_sample(&[1.0], &[1.0, 1.0], 0.0), Err(Error::Shape { .. })));
        assert!(matches!(crps_sample(&[1.0], &[-1.0], 0.0), Err(Error::OutOfRange { .. })));
        assert!(matches!(crps_sample(&[1.0, f64::NAN], &[], 0.0), Err(Error::NotFinite { index: 1, .. })));
        assert!(matches!(crps_gaussian(0.0, -1.0, 0.0), Err(Error::OutOfRange { .. })));
        assert!(matches!(crps_gaussian(0.0, 1.0, f64::NAN), Err(Error::NotFinite { .. })));
    }
}
