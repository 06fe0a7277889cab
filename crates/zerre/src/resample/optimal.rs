//! Reduction of weighted hypotheses to fewer: unlike particles, no two of them need be the same.

use crate::belief::MAX_PARTICLES;
use crate::error::{Error, Result};
use crate::math::Real;
use crate::rng::{Draws, Purpose, Stream};
use serde::{Deserialize, Serialize};

/// How many weighted hypotheses become few. All keep the expectation of every weight, so that estimates of the evidence
/// stay unbiased; they differ in the spread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reduction {
    /// The heavy ones stay with their weights, the rest is drawn with equal weights, and none is drawn twice: of all
    /// unbiased reductions the one with the least expected squared error of the weights (Fearnhead and Clifford,
    /// Journal of the Royal Statistical Society B 65, 2003).
    #[default]
    Optimal,
    /// Independent draws. A hypothesis drawn several times is kept once with the weight of all its copies.
    Multinomial,
    /// One draw in each of equal strata, at the same place in each. Copies are put together as above.
    Systematic,
}

impl Reduction {
    /// Picks at most `count` of the hypotheses with these `weights`, which need not be normalised: their indices,
    /// ascending, and their new weights, of the same sum, go to `kept`. Where no more than `count` have weight, all of
    /// these stay as they are; otherwise [`Reduction::Optimal`] keeps exactly `count`. `step` distinguishes repeated
    /// calls with one stream. Nothing is allocated once `kept` has room for all weights.
    ///
    /// # Errors
    /// A weight that is negative or not finite, weights that are all zero or whose sum overflows, more than 2^26 of
    /// them, a `count` of zero.
    pub fn reduce(
        self,
        weights: &[f64],
        count: usize,
        stream: Stream,
        step: u64,
        kept: &mut Vec<(u32, f64)>,
    ) -> Result<()> {
        for (what, value) in
            [("number of hypotheses to keep", count), ("number of hypotheses", weights.len())]
        {
            if !(1..=MAX_PARTICLES).contains(&value) {
                let needs = "it must lie between 1 and 2^26";
                return Err(Error::OutOfRange { what, value: value as f64, needs });
            }
        }
        kept.clear();
        let mut total = 0.0;
        for (i, &weight) in weights.iter().enumerate() {
            total += Error::not_negative("weight", weight)?;
            if weight > 0.0 {
                kept.push((i as u32, weight));
            }
        }
        Error::positive("sum of the weights", total)?;
        if kept.len() <= count {
            return Ok(());
        }
        let mut draws = stream.draws(Purpose::Resample, step, 0);
        match self {
            Reduction::Optimal => optimal(weights, count, &mut draws, kept),
            Reduction::Systematic => {
                let offset = draws.uniform();
                copies(weights, total, count, kept, |i| (i as f64 + offset) / count as f64);
            }
            Reduction::Multinomial => {
                // Sorted uniforms are partial sums of exponentials over the sum of one more (Devroye 1986, chapter V);
                // the numbers can be had twice, so that they need not be kept.
                let exponential = |draws: &mut Draws| -Real::ln(draws.uniform());
                let mut again = draws.clone();
                let sum: f64 = (0..=count).map(|_| exponential(&mut draws)).sum();
                let mut partial = 0.0;
                copies(weights, total, count, kept, |_| {
                    partial += exponential(&mut again);
                    partial / sum
                });
            }
        }
        Ok(())
    }
}

/// Keeps what the optimal reduction keeps of `kept`, which comes with all indices and weights above zero, more than
/// `count` of them.
fn optimal(weights: &[f64], count: usize, draws: &mut Draws, kept: &mut Vec<(u32, f64)>) {
    // Sum over i of min(1, w_i / c) = count: with the k heaviest above c, c is the sum of the rest over count - k, and
    // k is the least for which the heaviest of the rest lies below.
    kept.sort_unstable_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let mut rest: f64 = kept[count - 1..].iter().rev().map(|&(_, w)| w).sum();
    let (mut heavy, mut threshold) = (count - 1, rest);
    while heavy > 0 && kept[heavy - 1].1 * ((count - heavy + 1) as f64) < rest + kept[heavy - 1].1 {
        heavy -= 1;
        rest += kept[heavy].1;
        threshold = rest / (count - heavy) as f64;
    }
    // Below or equal to this weight a hypothesis is drawn for; ties at the bound go by index, as sorted.
    let bound = kept[heavy];
    let mut open = kept.len() - heavy;
    let mut wanted = count - heavy;
    kept.clear();
    // A point in every stretch of length c: weights below c hold one at most, and i holds one with probability w_i / c.
    let mut next = threshold * draws.uniform();
    let mut sum = 0.0;
    for (i, &weight) in weights.iter().enumerate().filter(|&(_, &weight)| weight > 0.0) {
        let i = i as u32;
        if weight > bound.1 || (weight == bound.1 && i < bound.0) {
            kept.push((i, weight));
            continue;
        }
        sum += weight;
        // Rounding must not lose the last point.
        if wanted > 0 && (sum > next || open == wanted) {
            kept.push((i, threshold));
            next += threshold;
            wanted -= 1;
        }
        open -= 1;
    }
}

/// `count` draws at ascending positions in [0, 1), those of one hypothesis put together.
fn copies(
    weights: &[f64],
    total: f64,
    count: usize,
    kept: &mut Vec<(u32, f64)>,
    mut position: impl FnMut(usize) -> f64,
) {
    let last = kept.last().map_or(0, |&(i, _)| i);
    kept.clear();
    let each = total / count as f64;
    let (mut drawn, mut next, mut sum) = (0, total * position(0), 0.0);
    for (i, &weight) in weights.iter().enumerate().filter(|&(_, &weight)| weight > 0.0) {
        let i = i as u32;
        sum += weight;
        let before = drawn;
        while drawn < count && (sum > next || i == last) {
            drawn += 1;
            if drawn < count {
                next = total * position(drawn);
            }
        }
        if drawn > before {
            kept.push((i, each * (drawn - before) as f64));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reduced(reduction: Reduction, weights: &[f64], count: usize, step: u64) -> Vec<(u32, f64)> {
        let mut kept = Vec::new();
        reduction.reduce(weights, count, Stream::new(8), step, &mut kept).unwrap();
        kept
    }

    /// Of 8, 4, 1, 1, 1, 1 to 4: with 8 and 4 kept c = 4 / 2 = 2. Of 8, 1.5, 1, 1, 1 to 3: c = 4.5 / 2, below 8 alone.
    #[test]
    fn thresholds_worked_by_hand() {
        let kept = reduced(Reduction::Optimal, &[1.0, 8.0, 1.0, 4.0, 1.0, 1.0], 4, 0);
        assert_eq!(kept.len(), 4);
        assert!(kept.contains(&(1, 8.0)) && kept.contains(&(3, 4.0)));
        assert_eq!(kept.iter().filter(|k| k.1 == 2.0).count(), 2);
        let kept = reduced(Reduction::Optimal, &[8.0, 1.5, 1.0, 1.0, 1.0], 3, 0);
        assert!(kept[0] == (0, 8.0) && kept[1].1 == 2.25 && kept[2].1 == 2.25);
    }

    #[test]
    fn few_are_all_kept_and_zeros_are_not() {
        for reduction in [Reduction::Optimal, Reduction::Multinomial, Reduction::Systematic] {
            let kept = reduced(reduction, &[0.0, 0.5, 0.0, 0.25], 2, 0);
            assert_eq!(kept, [(1, 0.5), (3, 0.25)]);
        }
    }

    #[test]
    fn what_are_no_weights_is_refused() {
        let refuses = |weights: &[f64], count| {
            Reduction::Optimal.reduce(weights, count, Stream::new(1), 0, &mut Vec::new()).is_err()
        };
        assert!(refuses(&[], 1) && refuses(&[1.0], 0) && refuses(&[0.0; 3], 1));
        assert!(refuses(&[-1.0, 2.0], 1) && refuses(&[f64::NAN], 1) && refuses(&[f64::MAX; 3], 1));
    }
}
