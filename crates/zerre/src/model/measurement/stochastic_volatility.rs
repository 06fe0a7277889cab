//! Stochastic volatility (S. J. Taylor, *Modelling Financial Time Series*, Wiley 1986).

use super::finite;
use crate::error::Result;
use crate::math::Real;
use crate::math::gaussian::LN_2PI;
use crate::model::Measurement;
use crate::time::Time;

/// z ~ N(0, e^x): the state is the logarithm of the variance of a return. Values are `[z]`. Not of the form
/// h(x) + v: the Kalman family does not take it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StochasticVolatility;

/// A return, digested.
#[derive(Clone, Copy, Debug)]
pub struct StochasticVolatilityGiven {
    square: f64,
}

impl<const N: usize> Measurement<N> for StochasticVolatility {
    type Value = [f64; 1];
    type Given<'z> = StochasticVolatilityGiven;

    fn given(&self, z: &[f64; 1], _: Time) -> Result<StochasticVolatilityGiven> {
        let [z] = *finite("measured return", z)?;
        Ok(StochasticVolatilityGiven { square: z * z })
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &StochasticVolatilityGiven, x: [R; N]) -> R {
        ((-x[0]).exp() * given.square + x[0] + LN_2PI) * -0.5
    }
}
