//! One component of a belief, whatever the belief is: what scores are computed from.

use crate::distribution::normal_cdf;
use crate::metric::{crps_mixture, crps_sorted};
use zerre::belief::{Cloud, GaussianBelief, GridBelief, Hypotheses, MovedCloud};
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

    #[test]
    fn nothing_has_no_moments_and_covers_nothing() {
        let law = Marginal::Samples(vec![(1.0, 0.0)]);
        assert!(law.mean().is_nan() && law.sd().is_nan() && !law.covers(1.0, 0.9));
    }
}
