//! Weighted Gaussians, each of one history of labels.

use super::{Gaussian, ModalGaussian, matched};
use crate::error::{Error, Result};
use crate::model::Label;
use crate::rng::Stream;
use crate::time::Time;
use serde::{Deserialize, Serialize};

/// What is known of a target beside whose state something is hidden: a mode of its motion, or anything else
/// that a [`Latent`](crate::model::Latent) names. Hypotheses about the labels so far, each with its weight
/// and, given it, a Gaussian. The belief of the Rao-Blackwellised filter
/// ([`RaoBlackwell`](crate::filter::RaoBlackwell)).
///
/// It shows all hypotheses that the last step weighed; the next step goes on from as many as the filter keeps.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(try_from = "Parts<N, L>", bound = "L: Label")]
pub struct Hypotheses<const N: usize, L: Label = usize> {
    pub(crate) time: Time,
    pub(crate) stream: Stream,
    pub(crate) step: u64,
    pub(crate) modes: usize,
    pub(crate) all: Vec<Hypothesis<N, L>>,
    /// Where a step writes, so that one that fails changes nothing, and memory that steps use again and again.
    #[serde(skip_serializing)]
    pub(crate) spare: Vec<Hypothesis<N, L>>,
    #[serde(skip_serializing)]
    pub(crate) weights: Vec<f64>,
    #[serde(skip_serializing)]
    pub(crate) kept: Vec<(u32, f64)>,
}

/// One history of labels, of which the last counts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "L: Label")]
pub struct Hypothesis<const N: usize, L: Label = usize> {
    /// The label of the last step: the number of a mode, unless the model has others.
    #[serde(alias = "mode")]
    pub label: L,
    /// Its probability; all sum to 1.
    pub weight: f64,
    /// The law of the state given the history.
    pub law: Gaussian<N>,
}

/// What is read before it is checked.
#[derive(Deserialize)]
#[serde(bound = "L: Label")]
struct Parts<const N: usize, L: Label> {
    time: Time,
    stream: Stream,
    step: u64,
    modes: usize,
    all: Vec<Hypothesis<N, L>>,
}

impl<const N: usize, L: Label> TryFrom<Parts<N, L>> for Hypotheses<N, L> {
    type Error = Error;
    fn try_from(parts: Parts<N, L>) -> Result<Self> {
        let Parts { time, stream, step, modes, all } = parts;
        Ok(Hypotheses { step, ..Hypotheses::new(time, stream, modes, all)? })
    }
}

/// Equal beliefs go on to equal bits.
impl<const N: usize, L: Label> PartialEq for Hypotheses<N, L> {
    fn eq(&self, other: &Self) -> bool {
        let parts = |b: &Self| (b.time, b.stream, b.step, b.modes);
        parts(self) == parts(other) && self.all == other.all
    }
}

impl<const N: usize, L: Label> Hypotheses<N, L> {
    /// The belief of these hypotheses, whose labels are numbers of so many `modes`; 0 where they are no
    /// numbers. `stream` is what labels and reductions are drawn from.
    ///
    /// # Errors
    /// A label that [`Label::check`] refuses; of modes, no mode or more than
    /// [`MAX_MODES`](crate::model::jump::MAX_MODES). Weights that are negative, not finite or do not sum to 1
    /// within 1e-9.
    pub fn new(time: Time, stream: Stream, modes: usize, all: Vec<Hypothesis<N, L>>) -> Result<Self> {
        let mut sum = 0.0;
        for hypothesis in &all {
            hypothesis.label.check(modes)?;
            sum += Error::not_negative("weight of a hypothesis", hypothesis.weight)?;
        }
        if (sum - 1.0).abs() > 1e-9 {
            let needs = "the weights of hypotheses must sum to 1";
            return Err(Error::OutOfRange { what: "sum of the weights", value: sum, needs });
        }
        let (spare, weights, kept) = (Vec::new(), Vec::new(), Vec::new());
        Ok(Hypotheses { time, stream, step: 0, modes, all, spare, weights, kept })
    }

    /// Time of the belief.
    pub fn time(&self) -> Time {
        self.time
    }

    /// Number of hypotheses.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// Never true: there is at least one hypothesis.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// The hypotheses, those of one parent side by side.
    pub fn iter(&self) -> std::slice::Iter<'_, Hypothesis<N, L>> {
        self.all.iter()
    }

    /// Number of modes; 0 where labels are no numbers of modes.
    pub fn modes(&self) -> usize {
        self.modes
    }

    /// The Gaussian with the mean and covariance of the whole.
    ///
    /// # Errors
    /// Sums that are not finite.
    pub fn combined(&self) -> Result<Gaussian<N>> {
        matched(self.all.len(), &|i| (self.all[i].weight, &self.all[i].law))
    }

    /// The expectation of a function of the label.
    pub fn expectation(&self, of: impl Fn(&L) -> f64) -> f64 {
        self.all.iter().map(|h| h.weight * of(&h.label)).sum()
    }

    /// The mean of the whole.
    pub fn mean(&self) -> [f64; N] {
        let mut mean = [0.0; N];
        for hypothesis in &self.all {
            for (sum, x) in mean.iter_mut().zip(hypothesis.law.mean()) {
                *sum += hypothesis.weight * x;
            }
        }
        mean
    }

    /// An independent continuation: the same hypotheses, other random numbers from here on.
    #[must_use]
    pub fn fork(&self, label: u64) -> Self {
        Hypotheses { stream: self.stream.fork(label), ..self.clone() }
    }
}

impl<const N: usize> Hypotheses<N> {
    /// Probability of mode `j`.
    pub fn probability(&self, j: usize) -> f64 {
        self.all.iter().filter(|h| h.label == j).map(|h| h.weight).sum()
    }

    /// The Gaussian with the mean and covariance of the state given mode `j`.
    ///
    /// # Errors
    /// No hypothesis with that mode and a weight; sums that are not finite.
    pub fn mode(&self, j: usize) -> Result<Gaussian<N>> {
        let weight = |h: &Hypothesis<N>| if h.label == j { h.weight } else { 0.0 };
        matched(self.all.len(), &|i| (weight(&self.all[i]), &self.all[i].law))
    }

    /// For each mode its probability and the Gaussian of [`Hypotheses::mode`]. A mode without weight has the
    /// law of the whole, which says nothing.
    ///
    /// # Errors
    /// Sums that are not finite.
    pub fn by_mode(&self) -> Result<ModalGaussian<N>> {
        let whole = self.combined()?;
        let probabilities: Vec<f64> = (0..self.modes).map(|j| self.probability(j)).collect();
        let law = |(j, &p): (usize, &f64)| if p > 0.0 { self.mode(j) } else { Ok(whole) };
        let laws = probabilities.iter().enumerate().map(law).collect::<Result<_>>()?;
        ModalGaussian::new(self.time, probabilities, laws)
    }
}

impl<'a, const N: usize, L: Label> IntoIterator for &'a Hypotheses<N, L> {
    type Item = &'a Hypothesis<N, L>;
    type IntoIter = std::slice::Iter<'a, Hypothesis<N, L>>;
    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Matrix;

    #[test]
    fn parts_are_those_of_the_mixture() {
        let law = |m: f64| Gaussian::new([m], Matrix([[1.0]])).unwrap();
        let part = |label, weight, m| Hypothesis { label, weight, law: law(m) };
        let all = vec![part(0, 0.25, 1.0), part(1, 0.5, 2.0), part(0, 0.25, 3.0)];
        let belief = Hypotheses::new(Time::ZERO, Stream::new(1), 3, all.clone()).unwrap();
        assert_eq!((belief.probability(0), belief.probability(1), belief.probability(2)), (0.5, 0.5, 0.0));
        assert_eq!(belief.mode(0).unwrap(), Gaussian::new([2.0], Matrix([[2.0]])).unwrap());
        assert_eq!(belief.combined().unwrap(), Gaussian::new([2.0], Matrix([[1.5]])).unwrap());
        assert_eq!(belief.mean(), [2.0]);
        assert!(belief.mode(2).is_err());
        let by_mode = belief.by_mode().unwrap();
        assert_eq!(by_mode.probabilities(), [0.5, 0.5, 0.0]);
        assert_eq!(by_mode.mode(0), &belief.mode(0).unwrap());
        assert_eq!(
            (by_mode.mode(2), by_mode.combined().unwrap()),
            (&belief.combined().unwrap(), belief.combined().unwrap())
        );

        let text = serde_json::to_string(&belief).unwrap();
        assert_eq!(serde_json::from_str::<Hypotheses<1>>(&text).unwrap(), belief);
        assert!(serde_json::from_str::<Hypotheses<1>>(&text.replace("\"modes\":3", "\"modes\":1")).is_err());
        // As they were saved when every label was a mode.
        let former = text.replace("\"label\"", "\"mode\"");
        assert!(former != text && serde_json::from_str::<Hypotheses<1>>(&former).unwrap() == belief);
        assert!(Hypotheses::new(Time::ZERO, Stream::new(1), 3, all[..2].to_vec()).is_err());
        assert!(Hypotheses::new(Time::ZERO, Stream::new(1), 17, all).is_err());
        assert_eq!(belief.expectation(|&mode| mode as f64), 0.5);
        let part = |label| Hypothesis { label, weight: 1.0, law: law(0.0) };
        assert!(Hypotheses::new(Time::ZERO, Stream::new(1), 0, vec![part(f64::NAN)]).is_err());
        assert!(Hypotheses::new(Time::ZERO, Stream::new(1), 0, vec![part(-2.5)]).is_ok());
    }
}
