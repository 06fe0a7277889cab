//! The law of a sensor's errors, chosen at run time.

use crate::error::Result;
use crate::math::Real;
use crate::model::measurement::{OutlierMixture, OutlierMixtureGiven, StudentT, StudentTGiven};
use crate::model::{GaussianMeasurement, Measurement};
use crate::rng::Draws;
use crate::time::Time;
use serde::{Deserialize, Serialize};

/// A law of errors with heavier tails than the normal one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Robust {
    /// Student's t with these degrees of freedom ([`StudentT`]).
    StudentT {
        /// Degrees of freedom.
        dof: f64,
    },
    /// A share of the measurements errs `scale` times more ([`OutlierMixture`]).
    Outliers {
        /// That share, from 0 to below 1.
        share: f64,
        /// Factor on its standard deviation, at least 1.
        scale: f64,
    },
}

/// A sensor model under one of the laws. The law is the same for all particles, so a kernel tells it apart once.
#[derive(Clone, Debug)]
pub(super) enum Tail<H, const M: usize> {
    Normal(H),
    StudentT(StudentT<H, M>),
    Outliers(OutlierMixture<H, M>),
}

/// A measurement under one of the laws, digested.
pub(super) enum TailGiven<G> {
    Normal(G),
    StudentT(StudentTGiven<G>),
    Outliers(OutlierMixtureGiven<G>),
}

impl<H, const M: usize> Tail<H, M> {
    pub(super) fn new(model: H, robust: Option<Robust>) -> Result<Self> {
        Ok(match robust {
            None => Tail::Normal(model),
            Some(Robust::StudentT { dof }) => Tail::StudentT(StudentT::new(model, dof)?),
            // No outliers, or outliers like the others.
            Some(Robust::Outliers { share, scale }) if share == 0.0 || scale == 1.0 => Tail::Normal(model),
            Some(Robust::Outliers { share, scale }) => {
                Tail::Outliers(OutlierMixture::new(model, share, scale)?)
            }
        })
    }
}

impl<const N: usize, const M: usize, H: GaussianMeasurement<N, M>> Measurement<N> for Tail<H, M> {
    type Value = H::Value;
    type Given<'z>
        = TailGiven<H::Given<'z>>
    where
        H: 'z;

    fn given<'z>(&'z self, z: &'z H::Value, at: Time) -> Result<Self::Given<'z>> {
        Ok(match self {
            Tail::Normal(model) => TailGiven::Normal(model.given(z, at)?),
            Tail::StudentT(model) => TailGiven::StudentT(Measurement::<N>::given(model, z, at)?),
            Tail::Outliers(model) => TailGiven::Outliers(Measurement::<N>::given(model, z, at)?),
        })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &Self::Given<'_>, x: [R; N]) -> R {
        match given {
            TailGiven::Normal(given) => H::log_likelihood(given, x),
            TailGiven::StudentT(given) => <StudentT<H, M> as Measurement<N>>::log_likelihood(given, x),
            TailGiven::Outliers(given) => <OutlierMixture<H, M> as Measurement<N>>::log_likelihood(given, x),
        }
    }
}

/// The same question to whichever model there is.
macro_rules! ask {
    ($tail:expr, $model:ident => $answer:expr) => {
        match $tail {
            Tail::Normal($model) => $answer,
            Tail::StudentT($model) => $answer,
            Tail::Outliers($model) => $answer,
        }
    };
}

impl<const N: usize, const M: usize, H: GaussianMeasurement<N, M>> GaussianMeasurement<N, M> for Tail<H, M> {
    const ANGLE: [bool; M] = H::ANGLE;

    #[inline(always)]
    fn predict<R: Real>(&self, at: Time, x: [R; N]) -> [R; M] {
        ask!(self, model => model.predict(at, x))
    }

    fn components(&self, z: &H::Value) -> [f64; M] {
        ask!(self, model => GaussianMeasurement::<N, M>::components(model, z))
    }

    fn covariance(&self) -> [[f64; M]; M] {
        ask!(self, model => GaussianMeasurement::<N, M>::covariance(model))
    }

    fn covariance_scale(&self, mahalanobis_squared: f64) -> f64 {
        ask!(self, model => GaussianMeasurement::<N, M>::covariance_scale(model, mahalanobis_squared))
    }

    fn draw_covariance_scale(&self, draws: &mut Draws) -> f64 {
        ask!(self, model => GaussianMeasurement::<N, M>::draw_covariance_scale(model, draws))
    }
}
