//! What a finite number of runs says: bootstrap intervals, paired comparisons, and many of them at once.

use crate::distribution::{student_quantile, student_tail};
use std::collections::BTreeMap;
use zerre::rng::{Purpose, Stream};

/// A value with the ends of its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The statistic of all runs.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Draws of a bootstrap: their quantiles at 2.5 % have a standard error of a twelfth of the interval's own scale.
const DRAWS: u64 = 2000;

/// Percentile bootstrap over runs (Efron and Tibshirani, An Introduction to the Bootstrap, 1993, section 13.3). Which
/// runs a draw takes is fixed at the beginning, so that statistics of several columns, and of several filters on the
/// same runs, stay paired.
#[derive(Clone, Debug)]
pub struct Bootstrap {
    all: Vec<usize>,
    draws: Vec<Vec<usize>>,
}

impl Bootstrap {
    /// Draws from `runs` runs.
    pub fn new(runs: usize, stream: Stream) -> Bootstrap {
        let count = (runs as u64).max(1);
        let draw = |number| {
            let mut draws = stream.draws(Purpose::Resample, number, 0);
            (0..runs).map(|_| (draws.next_u64() % count) as usize).collect()
        };
        Bootstrap { all: (0..runs).collect(), draws: (0..DRAWS).map(draw).collect() }
    }

    /// `statistic` of all runs with its interval; it gets their numbers, with repetitions. `None` without runs, and
    /// where it is no number.
    pub fn estimate(&self, statistic: impl Fn(&[usize]) -> f64) -> Option<Estimate> {
        let value = statistic(&self.all);
        if self.all.is_empty() || !value.is_finite() {
            return None;
        }
        let mut values: Vec<f64> = self.draws.iter().map(|picked| statistic(picked)).collect();
        values.sort_unstable_by(f64::total_cmp);
        let last = values.len() - 1;
        let at = |share: f64| values[(share * last as f64).round() as usize];
        Some(Estimate { value, low: at(0.025), high: at(0.975) })
    }
}

/// Bootstraps for columns of several lengths.
#[derive(Clone, Debug)]
pub struct Bootstraps(BTreeMap<usize, Bootstrap>);

/// Label of their stream: "bootstrap" in ASCII, less its last letter.
const BOOTSTRAP: u64 = 0x626f_6f74_7374_7261;

impl Bootstraps {
    /// One for each of these numbers of runs.
    pub fn new(runs: impl IntoIterator<Item = usize>, seed: u64) -> Bootstraps {
        let stream = Stream::new(seed).fork(BOOTSTRAP);
        let mut all = BTreeMap::new();
        for runs in runs {
            all.entry(runs).or_insert_with(|| Bootstrap::new(runs, stream));
        }
        Bootstraps(all)
    }

    /// [`Bootstrap::estimate`] over `runs` runs; `None` for a number that was not announced.
    pub fn estimate(&self, runs: usize, statistic: impl Fn(&[usize]) -> f64) -> Option<Estimate> {
        self.0.get(&runs)?.estimate(statistic)
    }
}

/// Mean with its 95 % interval by Student's t; of a single value the interval is the value. `None` of none,
/// and where a value is no number.
pub fn mean_interval(values: &[f64]) -> Option<Estimate> {
    let n = values.len() as f64;
    let value = values.iter().sum::<f64>() / n;
    if !value.is_finite() {
        return None;
    }
    let squares: f64 = values.iter().map(|v| (v - value) * (v - value)).sum();
    let half = if values.len() < 2 {
        0.0
    } else {
        student_quantile(0.975, n - 1.0) * (squares / (n - 1.0) / n).sqrt()
    };
    Some(Estimate { value, low: value - half, high: value + half })
}

/// Mean of the picked values; NaN of none.
pub fn mean(values: &[f64], picked: &[usize]) -> f64 {
    picked.iter().map(|i| values[*i]).sum::<f64>() / picked.len() as f64
}

/// Median of the picked values, of an even number the mean of the middle two; NaN of none.
pub fn median(values: &[f64], picked: &[usize]) -> f64 {
    let mut sorted: Vec<f64> = picked.iter().map(|i| values[*i]).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[n / 2],
        n => 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]),
    }
}

/// Smallest of the picked values that at least this share of them does not exceed; NaN of none.
pub fn quantile(values: &[f64], picked: &[usize], share: f64) -> f64 {
    let mut sorted: Vec<f64> = picked.iter().map(|i| values[*i]).collect();
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let at = ((share * sorted.len() as f64).ceil() as usize).saturating_sub(1).min(last);
    *sorted.select_nth_unstable_by(at, f64::total_cmp).1
}

/// A paired comparison.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paired {
    /// Mean of the differences.
    pub difference: f64,
    /// Its standard error.
    pub standard_error: f64,
    /// Probability of a mean at least as large if the true one were zero: Student's t with n - 1 degrees of freedom.
    pub p_greater: f64,
}

/// Whether the mean of `differences` exceeds zero (one-sided paired t-test). `None` of fewer than two, and where all
/// are equal: there is no scale to judge by.
pub fn paired(differences: &[f64]) -> Option<Paired> {
    let n = differences.len() as f64;
    if differences.len() < 2 {
        return None;
    }
    let difference = differences.iter().sum::<f64>() / n;
    let squares: f64 = differences.iter().map(|d| (d - difference).powi(2)).sum();
    let standard_error = (squares / (n - 1.0) / n).sqrt();
    if standard_error.is_nan() || standard_error <= 0.0 {
        return None;
    }
    let p_greater = student_tail(difference / standard_error, n - 1.0);
    Some(Paired { difference, standard_error, p_greater })
}

/// Holm's step-down correction (Scandinavian Journal of Statistics 6, 1979): adjusted values, in the order of `p`; a
/// hypothesis is rejected at family-wise level a where its adjusted value is at most a.
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|a, b| p[*a].total_cmp(&p[*b]));
    let mut adjusted = vec![0.0; p.len()];
    let mut largest: f64 = 0.0;
    for (rank, &at) in order.iter().enumerate() {
        largest = largest.max(((p.len() - rank) as f64 * p[at]).min(1.0));
        adjusted[at] = largest;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Holm's own arithmetic: 4 * .005, 3 * .01, 2 * .03 and 1 * .04 made monotone, in the order given.
    #[test]
    fn holm_is_the_hand_computed_one() {
        let adjusted = holm(&[0.01, 0.04, 0.03, 0.005]);
        for (found, expected) in adjusted.iter().zip([0.03, 0.06, 0.06, 0.02]) {
            assert!((found - expected).abs() < 1e-15, "{adjusted:?}");
        }
        assert_eq!(holm(&[0.9, 0.8]), [1.0, 1.0]);
        assert!(holm(&[]).is_empty());
    }

    /// Differences 1, 2, 3: mean 2, standard error 1 / sqrt 3, t = 2 sqrt 3 with 2 degrees of freedom, whose law is
    /// known in closed form: P(T > t) = 1/2 - t / (2 sqrt(2 + t^2)).
    #[test]
    fn the_paired_test_is_the_hand_computed_one() {
        let found = paired(&[1.0, 2.0, 3.0]).unwrap();
        let t = 2.0 * 3f64.sqrt();
        assert!((found.difference - 2.0).abs() < 1e-15);
        assert!((found.standard_error - 1.0 / 3f64.sqrt()).abs() < 1e-15);
        // The incomplete beta function of statrs is good to about 1e-10.
        assert!((found.p_greater - (0.5 - t / (2.0 * (2.0 + t * t).sqrt()))).abs() < 1e-9);
        assert!(paired(&[1.0]).is_none() && paired(&[2.0, 2.0]).is_none());
    }

    /// Values 1, 2, 3: standard error 1 / sqrt 3; the quantile at 97.5 % of two degrees of freedom solves
    /// t^2 = 2 (2p - 1)^2 / (1 - (2p - 1)^2).
    #[test]
    fn the_interval_of_a_mean_is_students() {
        let share = 0.95 * 0.95;
        let half = (2.0_f64 * share / (1.0 - share)).sqrt() / 3f64.sqrt();
        let found = mean_interval(&[1.0, 2.0, 3.0]).unwrap();
        assert!((found.value - 2.0).abs() < 1e-15);
        assert!((found.high - 2.0 - half).abs() < 1e-8 && (2.0 - found.low - half).abs() < 1e-8, "{found:?}");
        assert_eq!(mean_interval(&[4.0]), Some(Estimate { value: 4.0, low: 4.0, high: 4.0 }));
        assert!(mean_interval(&[]).is_none() && mean_interval(&[f64::NAN]).is_none());
    }

    /// The bootstrap law of the mean of two runs 0 and 1 is binomial: 0, 1/2 and 1 with probabilities 1/4, 1/2, 1/4.
    #[test]
    fn the_interval_is_that_of_the_draws() {
        let values = [0.0, 1.0];
        let found = Bootstrap::new(2, Stream::new(1)).estimate(|picked| mean(&values, picked)).unwrap();
        assert_eq!(found, Estimate { value: 0.5, low: 0.0, high: 1.0 });
        assert!(Bootstrap::new(0, Stream::new(1)).estimate(|_| 0.0).is_none());
        assert!(Bootstrap::new(2, Stream::new(1)).estimate(|_| f64::NAN).is_none());
    }

    /// For 400 runs of standard deviation s the interval of the mean is about 2 * 1.96 s / 20 wide. Its ends are
    /// quantiles of 2 000 draws, with a standard error of sqrt(.025 .975 / 2000) / .0584 = 0.06 s / 20 each: 5 of both
    /// together are 0.42 of the 3.92. The sample's own s errs by 1 / sqrt(800) = 3.5 %: 5 of it are 0.69.
    #[test]
    fn the_interval_has_the_width_of_the_normal_one() {
        let mut draws = Stream::new(3).draws(Purpose::Other, 0, 0);
        let values: Vec<f64> = (0..400).map(|_| draws.normal()).collect();
        let found = Bootstrap::new(400, Stream::new(4)).estimate(|picked| mean(&values, picked)).unwrap();
        assert!(((found.high - found.low) * 20.0 - 3.92).abs() < 0.42 + 0.69, "{found:?}");
        assert!(found.low < found.value && found.value < found.high);
    }

    #[test]
    fn medians_are_in_the_middle() {
        let values = [5.0, 1.0, 3.0, 2.0];
        assert_eq!(median(&values, &[0, 1, 2]), 3.0);
        assert_eq!(median(&values, &[0, 1, 2, 3]), 2.5);
        assert!(median(&values, &[]).is_nan());
        // Of twenty values one is 5 %, of the four above one is a quarter.
        let many: Vec<f64> = (0..20).map(f64::from).rev().collect();
        let all: Vec<usize> = (0..20).collect();
        assert_eq!(
            [0.0, 0.05, 0.06, 0.95, 1.0].map(|p| quantile(&many, &all, p)),
            [0.0, 0.0, 1.0, 18.0, 19.0]
        );
        assert_eq!(quantile(&values, &[0, 1, 2, 3], 0.25), 1.0);
        assert!(quantile(&values, &[], 0.5).is_nan());
    }
}
