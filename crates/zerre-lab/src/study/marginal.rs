//! One component of a belief, whatever the belief is: what scores are computed from.

use crate::distribution::normal_cdf;
use crate::metric::{crps_mixture, crps_sorted};
use zerre::belief::{Cloud, GaussianBelief, GridBelief, Hypotheses, MovedCloud, SwarmBelief};
use zerre::model::Label;

/// The law of one component. Built again and again in the same memory.
#[derive(Clone, Debug, PartialEq)]
pub enum Marginal {
    /// (value, weight); weights are not negative and not all zero.
    Samples(Vec<(f64, f64)>),
    /// One normal law; a standard deviation of zero is a point.
    Normal {
        /// Its mean.
        mean: f64,
        /// Its standard deviation.
        sd: f64,
    },
    /// (weight, mean, standard deviation) of normal parts.
    Mixture(Vec<(f64, f64, f64)>),
}

impl Default for Marginal {
    fn default() -> Self {
        Marginal::Samples(Vec::new())
    }
}

impl Marginal {
    /// The memory of a sample, empty; the law is undefined until it is given back.
    fn take_samples(&mut self) -> Vec<(f64, f64)> {
        match std::mem::take(self) {
            Marginal::Samples(mut points) => {
                points.clear();
                points
            }
            _ => Vec::new(),
        }
    }

    /// The memory of a mixture, likewise.
    fn take_mixture(&mut self) -> Vec<(f64, f64, f64)> {
        match std::mem::take(self) {
            Marginal::Mixture(mut parts) => {
                parts.clear();
                parts
            }
            _ => Vec::new(),
        }
    }

    /// The mean; NaN where nothing has a weight.
    pub fn mean(&self) -> f64 {
        match self {
            Marginal::Samples(points) => {
                let (sum, total) =
                    points.iter().fold((0.0, 0.0), |(sum, total), (x, w)| (sum + w * x, total + w));
                sum / total
            }
            Marginal::Normal { mean, .. } => *mean,
            Marginal::Mixture(parts) => {
                let (sum, total) =
                    parts.iter().fold((0.0, 0.0), |(sum, total), (w, m, _)| (sum + w * m, total + w));
                sum / total
            }
        }
    }

    /// The standard deviation; NaN where nothing has a weight.
    pub fn sd(&self) -> f64 {
        let mean = self.mean();
        let (sum, total) = match self {
            Marginal::Samples(points) => points
                .iter()
                .fold((0.0, 0.0), |(sum, total), (x, w)| (sum + w * (x - mean) * (x - mean), total + w)),
            Marginal::Normal { sd, .. } => return *sd,
            Marginal::Mixture(parts) => parts.iter().fold((0.0, 0.0), |(sum, total), (w, m, s)| {
                (sum + w * (s * s + (m - mean) * (m - mean)), total + w)
            }),
        };
        (sum / total).sqrt()
    }

    /// The continuous ranked probability score against `truth`. Samples are sorted by it.
    pub fn crps(&mut self, truth: f64) -> f64 {
        match self {
            Marginal::Samples(points) => {
                points.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
                crps_sorted(points, truth)
            }
            Marginal::Normal { mean, sd } => crps_mixture(&[(1.0, *mean, *sd)], truth),
            Marginal::Mixture(parts) => crps_mixture(parts, truth),
        }
    }

    /// The 1-Wasserstein distance to another sample, the integral of |F - G|: how far mass has to be carried
    /// on average to make one law of the other, in the unit of the component. Both are sorted by it. `None`
    /// where one of the two is no sample.
    pub fn wasserstein(&mut self, other: &mut Marginal) -> Option<f64> {
        let (Marginal::Samples(one), Marginal::Samples(two)) = (self, other) else { return None };
        for points in [&mut *one, &mut *two] {
            points.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        }
        Some(wasserstein_sorted(one, two))
    }

    /// Whether `truth` lies in the central interval of this probability. The ends of a sample's are the
    /// smallest values whose cumulative weight reaches (1 - p) / 2 and (1 + p) / 2.
    pub fn covers(&self, truth: f64, probability: f64) -> bool {
        let (below, upto) = self.cumulative(truth);
        upto >= 0.5 * (1.0 - probability) && below < 0.5 * (1.0 + probability)
    }

    /// P(X < x) and P(X <= x).
    fn cumulative(&self, x: f64) -> (f64, f64) {
        let normal = |mean: f64, sd: f64| {
            if sd > 0.0 {
                let p = normal_cdf((x - mean) / sd);
                (p, p)
            } else {
                (f64::from(u8::from(mean < x)), f64::from(u8::from(mean <= x)))
            }
        };
        match self {
            Marginal::Samples(points) => {
                let (mut below, mut upto, mut total) = (0.0, 0.0, 0.0);
                for &(value, weight) in points {
                    below += if value < x { weight } else { 0.0 };
                    upto += if value <= x { weight } else { 0.0 };
                    total += weight;
                }
                (below / total, upto / total)
            }
            Marginal::Normal { mean, sd } => normal(*mean, *sd),
            Marginal::Mixture(parts) => {
                let (mut below, mut upto, mut total) = (0.0, 0.0, 0.0);
                for &(weight, mean, sd) in parts {
                    let (b, u) = normal(mean, sd);
                    below += weight * b;
                    upto += weight * u;
                    total += weight;
                }
                (below / total, upto / total)
            }
        }
    }
}

/// The distance of two samples in the order of their values: between neighbours F and G are constant.
fn wasserstein_sorted(one: &[(f64, f64)], two: &[(f64, f64)]) -> f64 {
    let share = |points: &[(f64, f64)]| 1.0 / points.iter().map(|(_, weight)| weight).sum::<f64>();
    let (of_one, of_two) = (share(one), share(two));
    let (mut i, mut j, mut difference, mut left, mut distance) = (0, 0, 0.0_f64, f64::NAN, 0.0);
    loop {
        let (x, step) = match (one.get(i), two.get(j)) {
            (Some(&(x, weight)), other) if other.is_none_or(|other| x <= other.0) => {
                i += 1;
                (x, weight * of_one)
            }
            (_, Some(&(x, weight))) => {
                j += 1;
                (x, -weight * of_two)
            }
            _ => return distance,
        };
        if !left.is_nan() {
            distance += difference.abs() * (x - left);
        }
        left = x;
        difference += step;
    }
}

/// A belief whose components have laws of their own.
pub trait Marginals {
    /// Writes the law of component `k` into `out`.
    fn marginal(&self, k: usize, out: &mut Marginal);
}

impl<const N: usize> Marginals for Cloud<N> {
    fn marginal(&self, k: usize, out: &mut Marginal) {
        let mut points = out.take_samples();
        points.extend(self.column(k).iter().copied().zip(self.weights()));
        *out = Marginal::Samples(points);
    }
}

impl<const N: usize> Marginals for MovedCloud<N> {
    fn marginal(&self, k: usize, out: &mut Marginal) {
        self.cloud().marginal(k, out);
    }
}

impl<const N: usize> Marginals for SwarmBelief<N> {
    fn marginal(&self, k: usize, out: &mut Marginal) {
        self.cloud().marginal(k, out);
    }
}

impl<const N: usize> Marginals for GridBelief<N> {
    fn marginal(&self, k: usize, out: &mut Marginal) {
        let mut points = out.take_samples();
        points.extend(self.nodes().map(|(x, mass)| (x[k], mass)));
        *out = Marginal::Samples(points);
    }
}

impl<const N: usize> Marginals for GaussianBelief<N> {
    fn marginal(&self, k: usize, out: &mut Marginal) {
        let (mean, sd) = (self.state.mean()[k], self.state.covariance().0[k][k].sqrt());
        *out = Marginal::Normal { mean, sd };
    }
}

impl<const N: usize, L: Label> Marginals for Hypotheses<N, L> {
    fn marginal(&self, k: usize, out: &mut Marginal) {
        let mut parts = out.take_mixture();
        parts.extend(self.iter().map(|h| (h.weight, h.law.mean()[k], h.law.covariance().0[k][k].sqrt())));
        *out = Marginal::Mixture(parts);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use zerre::Time;
    use zerre::belief::Gaussian;
    use zerre::rng::{Purpose, Stream};

    /// All three forms of one normal law agree: mean, sd and score of 20 000 draws within 5 standard errors
    /// (sd / 141, sd / 200; the score moves by at most the error of a draw over n, so its standard error is
    /// below sd / 141).
    #[test]
    fn the_forms_of_one_law_agree() {
        let (mean, sd) = (3.0, 2.0);
        let mut draws = Stream::new(5).draws(Purpose::Other, 0, 0);
        let values: Vec<f64> = (0..20_000).map(|_| mean + sd * draws.normal()).collect();
        let cloud = Cloud::<1>::from_columns(Time::ZERO, Stream::new(1), [values]).unwrap();
        let state = Gaussian::independent([mean], [sd]).unwrap();
        let belief = GaussianBelief { time: Time::ZERO, state };
        let (mut sample, mut normal) = (Marginal::default(), Marginal::default());
        cloud.marginal(0, &mut sample);
        belief.marginal(0, &mut normal);
        let mut mixture = Marginal::Mixture(vec![(0.5, mean, sd); 3]);
        let error = 5.0 * sd / 141.0;
        assert!((sample.mean() - mean).abs() < error && (sample.sd() - sd).abs() < error);
        for truth in [-2.0, 3.0, 4.5] {
            assert!((sample.crps(truth) - normal.crps(truth)).abs() < error);
            assert!((mixture.crps(truth) - normal.crps(truth)).abs() < 1e-12);
        }
        assert!((mixture.mean(), mixture.sd()) == (mean, sd));
        // The central 90 % of a normal law end 1.645 standard deviations from its mean.
        for law in [&sample, &normal, &mixture] {
            for (z, inside) in [(-1.75, false), (-1.55, true), (0.0, true), (1.55, true), (1.75, false)] {
                assert_eq!(law.covers(mean + z * sd, 0.9), inside, "{z}");
            }
        }
    }

    /// Values 0, 1, 2 with weights 1, 2, 1: the central half reaches from 0 (cumulative 1/4) to 1 (3/4).
    #[test]
    fn samples_have_the_interval_of_their_quantiles() {
        let law = Marginal::Samples(vec![(2.0, 1.0), (0.0, 1.0), (1.0, 2.0)]);
        for (truth, inside) in [(-0.1, false), (0.0, true), (0.5, true), (1.0, true), (1.1, false)] {
            assert_eq!(law.covers(truth, 0.5), inside, "{truth}");
        }
        let point = Marginal::Normal { mean: 1.0, sd: 0.0 };
        assert!(point.covers(1.0, 0.9) && !point.covers(1.1, 0.9) && !point.covers(0.9, 0.9));
    }

    /// By hand: of 0 and 2 in equal parts to 1 all mass is carried by 1; to 0 with three quarters and 2 with
    /// one, a quarter is carried by 2. Weights need not sum to one, and the order of points does not matter.
    #[test]
    fn mass_is_carried_as_far_as_by_hand() {
        let sample = |points: &[(f64, f64)]| Marginal::Samples(points.to_vec());
        let distance = |a: &[(f64, f64)], b: &[(f64, f64)]| {
            let (mut a, mut b) = (sample(a), sample(b));
            let found = [a.wasserstein(&mut b), b.wasserstein(&mut a)].map(Option::unwrap);
            assert!((found[0] - found[1]).abs() < 1e-15);
            found[0]
        };
        let halves = [(2.0, 5.0), (0.0, 5.0)];
        assert!((distance(&halves, &[(1.0, 3.0)]) - 1.0).abs() < 1e-15);
        assert!((distance(&halves, &[(0.0, 0.75), (2.0, 0.25)]) - 0.5).abs() < 1e-15);
        assert!(distance(&halves, &[(0.0, 1.0), (2.0, 1.0)]).abs() < 1e-15);
        assert!((distance(&[(-1.0, 1.0)], &[(2.5, 1.0)]) - 3.5).abs() < 1e-15);
        let mut normal = Marginal::Normal { mean: 0.0, sd: 1.0 };
        assert_eq!(sample(&halves).wasserstein(&mut normal), None);
        assert!(sample(&[(1.0, 0.0)]).wasserstein(&mut sample(&halves)).unwrap().is_nan());
    }

    /// A law moved by d lies d away: |F - G| integrates to the difference of the means where one is above the
    /// other everywhere. n = 4 000 draws of a normal law are E|F_n - F| = sqrt(2 F (1 - F) / (pi n)) away at
    /// each place, together less than 1.5 sd / sqrt(n) = .024 sd on average; both samples, by the triangle
    /// inequality, and twice that.
    #[test]
    fn a_law_that_is_moved_lies_as_far_away() {
        let draw = |seed, by: f64| {
            let mut draws = Stream::new(seed).draws(Purpose::Other, 0, 0);
            Marginal::Samples((0..4000).map(|_| (by + draws.normal(), 1.0)).collect())
        };
        for by in [0.0, 0.5, 3.0] {
            let found = draw(1, 0.0).wasserstein(&mut draw(2, by)).unwrap();
            assert!((found - by).abs() < 0.09, "{by} {found}");
        }
    }

    #[test]
    fn nothing_has_no_moments_and_covers_nothing() {
        let law = Marginal::Samples(vec![(1.0, 0.0)]);
        assert!(law.mean().is_nan() && law.sd().is_nan() && !law.covers(1.0, 0.9));
    }
}
