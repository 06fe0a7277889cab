//! One Gaussian per mode.

use super::Gaussian;
use crate::error::{Error, Result};
use crate::math::Matrix;
use crate::model::jump::law_of;
use crate::time::Time;
use serde::{Deserialize, Serialize};
use std::array::from_fn;

/// What is known of a target that moves in one of several modes: for each mode its probability and, given that mode, a
/// Gaussian. The belief of the interacting multiple-model filter ([`Imm`](crate::filter::Imm)).
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(try_from = "Parts<N>")]
pub struct ModalGaussian<const N: usize> {
    pub(crate) time: Time,
    pub(crate) probabilities: Vec<f64>,
    pub(crate) laws: Vec<Gaussian<N>>,
    /// Where a step writes, so that one that fails changes nothing and none allocates; as long as `laws`.
    #[serde(skip_serializing)]
    pub(crate) spare: Vec<Gaussian<N>>,
}

/// What is read before it is checked.
#[derive(Deserialize)]
struct Parts<const N: usize> {
    time: Time,
    probabilities: Vec<f64>,
    laws: Vec<Gaussian<N>>,
}

impl<const N: usize> TryFrom<Parts<N>> for ModalGaussian<N> {
    type Error = Error;
    fn try_from(parts: Parts<N>) -> Result<Self> {
        ModalGaussian::new(parts.time, parts.probabilities, parts.laws)
    }
}

/// Equal beliefs go on to equal bits.
impl<const N: usize> PartialEq for ModalGaussian<N> {
    fn eq(&self, other: &Self) -> bool {
        (self.time, &self.probabilities, &self.laws) == (other.time, &other.probabilities, &other.laws)
    }
}

impl<const N: usize> ModalGaussian<N> {
    /// The belief with these probabilities of the modes and, mode by mode, these laws of the state.
    ///
    /// # Errors
    /// No mode or more than [`MAX_MODES`](crate::model::jump::MAX_MODES), another number of laws, probabilities that
    /// are negative, not finite or do not sum to 1 within 1e-9.
    pub fn new(time: Time, probabilities: Vec<f64>, laws: Vec<Gaussian<N>>) -> Result<Self> {
        crate::model::jump::count(probabilities.len())?;
        law_of(&probabilities, laws.len(), "probabilities of the modes")?;
        Ok(ModalGaussian { time, probabilities, spare: laws.clone(), laws })
    }

    /// Time of the belief.
    pub fn time(&self) -> Time {
        self.time
    }

    /// Number of modes.
    pub fn len(&self) -> usize {
        self.laws.len()
    }

    /// Never true: there is at least one mode.
    pub fn is_empty(&self) -> bool {
        self.laws.is_empty()
    }

    /// Probabilities of the modes, in the order of the model.
    pub fn probabilities(&self) -> &[f64] {
        &self.probabilities
    }

    /// The law of the state given mode `j`. A mode of probability zero has one too, which says nothing.
    ///
    /// # Panics
    /// If there is no such mode.
    pub fn mode(&self, j: usize) -> &Gaussian<N> {
        &self.laws[j]
    }

    /// The Gaussian with the mean and covariance of the whole: the spread of the modes' means is part of it.
    ///
    /// # Errors
    /// Numbers so large that the sums are not finite.
    pub fn combined(&self) -> Result<Gaussian<N>> {
        matched(self.laws.len(), &|j| (self.probabilities[j], &self.laws[j]))
    }
}

/// The Gaussian with the mean and covariance of a mixture of `count` parts; weights need not be normalised, and parts of weight zero are
/// not looked at. Parts that are equal give back their own bits.
///
/// Sums are of differences from the heaviest part: what they lose is below the rounding of that part, and the
/// covariance of the whole is at least its share of that part's.
///
/// # Errors
/// Weights that are all zero, sums that are not finite.
pub(crate) fn matched<'a, const N: usize>(
    count: usize,
    part: &dyn Fn(usize) -> (f64, &'a Gaussian<N>),
) -> Result<Gaussian<N>> {
    let mut total = 0.0;
    let mut heaviest: Option<(f64, &Gaussian<N>)> = None;
    for (weight, law) in (0..count).map(part) {
        total += weight;
        if heaviest.is_none_or(|(most, _)| weight > most) {
            heaviest = Some((weight, law));
        }
    }
    let total = Error::positive("sum of the weights", total)?;
    let Some((_, heaviest)) = heaviest else {
        return Err(Error::Shape { what: "parts of a mixture", found: 0, expected: 1 });
    };
    let parts = || {
        (0..count).map(part).filter(|(weight, _)| *weight > 0.0).map(|(weight, law)| (weight / total, law))
    };
    let mut shift = [0.0; N];
    for (share, law) in parts() {
        for i in 0..N {
            shift[i] += share * (law.mean()[i] - heaviest.mean()[i]);
        }
    }
    let mean: [f64; N] = from_fn(|i| heaviest.mean()[i] + shift[i]);
    let mut covariance = *heaviest.covariance();
    for (share, law) in parts() {
        let off: [f64; N] = from_fn(|i| law.mean()[i] - mean[i]);
        let more = *law.covariance() - *heaviest.covariance() + Matrix::outer(&off, &off);
        covariance = covariance + more * share;
    }
    Gaussian::computed("mean of a mixture", "covariance of a mixture", mean, covariance)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1/4 N(0, 1) + 3/4 N(4, 2): mean 3, variance 1/4 + 6/4 + 9/4 + 3/4 = 19/4.
    #[test]
    fn a_mixture_worked_by_hand() {
        let laws = [(0.0, 1.0), (4.0, 2.0)].map(|(m, v)| Gaussian::new([m], Matrix([[v]])).unwrap());
        let belief = ModalGaussian::new(Time::ZERO, vec![0.25, 0.75], laws.to_vec()).unwrap();
        let law = belief.combined().unwrap();
        assert_eq!((law.mean()[0], law.covariance().0[0][0]), (3.0, 4.75));
        let relative = matched(2, &|i| ([1.0, 3.0][i], &laws[i])).unwrap();
        assert_eq!(relative, law);
    }

    #[test]
    fn equal_parts_give_back_their_bits() {
        let law = Gaussian::new([0.1, 1e9 / 3.0], Matrix([[0.3, 0.1], [0.1, 0.7]])).unwrap();
        let weights = [0.1, 0.7, 0.2, 0.0];
        assert_eq!(matched(weights.len(), &|i| (weights[i], &law)).unwrap(), law);
        assert!(matched(1, &|_| (0.0, &law)).is_err());
        assert!(matched::<2>(0, &|_| unreachable!("there is no part")).is_err());
    }

    #[test]
    fn what_is_no_law_is_refused_from_text_too() {
        let law = Gaussian::new([0.5], Matrix([[1.0 / 3.0]])).unwrap();
        let belief = ModalGaussian::new(Time::from_nanos(3), vec![0.25, 0.75], vec![law; 2]).unwrap();
        let text = serde_json::to_string(&belief).unwrap();
        assert_eq!(serde_json::from_str::<ModalGaussian<1>>(&text).unwrap(), belief);
        assert!(serde_json::from_str::<ModalGaussian<1>>(&text.replace("0.25", "0.5")).is_err());
        assert!(ModalGaussian::new(Time::ZERO, vec![1.0], vec![law; 2]).is_err());
        assert!(ModalGaussian::<1>::new(Time::ZERO, vec![], vec![]).is_err());
        assert!(ModalGaussian::new(Time::ZERO, vec![1.5, -0.5], vec![law; 2]).is_err());
    }
}
