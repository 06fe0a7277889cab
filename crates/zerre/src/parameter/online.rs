//! Online expectation maximisation.

use super::Parameters;
use crate::belief::Cloud;
use crate::error::{Error, Result};
use crate::filter::{Filter, ParticleFilter, Prior};
use crate::math::{exp, ln};
use crate::model::{Likelihood, Motion};
use crate::proposal::Proposal;
use crate::rng::Stream;
use crate::smooth::{Backward, Paris, PathStep};
use crate::time::Time;
use std::borrow::Borrow;

/// Settings of [`online_em`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmSettings {
    /// The statistics of step k count k^-`exponent`, those before it the rest; between 0.5 and 1, 0.6 by
    /// default.
    pub exponent: f64,
    /// Steps before the parameters first change, 50 by default: statistics of few steps say little.
    pub wait: usize,
    /// Steps after which the values are averaged, 1 000 by default.
    pub average_after: usize,
    /// How paths are drawn backwards.
    pub backward: Backward,
}

impl Default for EmSettings {
    fn default() -> Self {
        EmSettings { exponent: 0.6, wait: 50, average_after: 1000, backward: Backward::default() }
    }
}

/// What [`online_em`] gives.
#[derive(Clone, Debug, PartialEq)]
pub struct EmTrace<const K: usize> {
    /// Values of the parameters after each step.
    pub values: Vec<[f64; K]>,
    /// Their average after [`EmSettings::average_after`] steps, which scatters less than any of them; the
    /// last of fewer.
    pub average: [f64; K],
    /// Maxima that lay outside the prior: the value before stayed.
    pub impossible: usize,
}

/// Maximum likelihood along with a particle filter, each measurement being looked at once (online EM: Cappé,
/// Journal of Computational and Graphical Statistics 20(3), 2011; with particle smoothing Del Moral, Doucet
/// and Singh 2010). `statistics` gives the sufficient statistics s of the complete data of one step, a step
/// of the path and the measurement at its end; `maximise` gives the likeliest parameters under statistics. In
/// every step the filter of the current value moves on, the smoothed statistics become S = (1 - g) S + g s
/// with g = k^-exponent, by [`Paris`], and the value becomes that of S.
///
/// The values go to a maximum of the likelihood of ever more measurements, over some thousand steps, and up
/// to a bias: that of the smoothed statistics, of the order of one over the number of particles, times the
/// information that path and measurements would give over that of the measurements alone, which can be ten
/// and more. The prior only says where values may lie.
///
/// # Errors
/// A start outside the prior, an exponent outside (0.5, 1], a motion without
/// [`TransitionDensity`](crate::model::TransitionDensity), statistics that are not finite, what the filter
/// and the closures refuse.
pub fn online_em<A, H, P, Q, Z, const K: usize, const N: usize, const W: usize, const S: usize>(
    parameters: &Parameters<K>,
    start: [f64; K],
    settings: EmSettings,
    stream: Stream,
    (from, data): (Time, &[(Time, Option<Z>)]),
    mut model: impl FnMut(&[f64; K]) -> Result<ParticleFilter<N, W, A, H, P, Q>>,
    (mut statistics, mut maximise): (
        impl FnMut(&PathStep<N>, Option<&Z>) -> [f64; S],
        impl FnMut(&[f64; S]) -> Result<[f64; K]>,
    ),
) -> Result<EmTrace<K>>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
    Q: Proposal<N, W, A, H>,
    Z: Borrow<H::Value>,
{
    let exponent = settings.exponent;
    if !(exponent > 0.5 && exponent <= 1.0) {
        let needs = "it must lie above 0.5 and not above 1";
        return Err(Error::OutOfRange { what: "exponent of the gains", value: exponent, needs });
    }
    parameters.free(&start)?;
    let mut theta = start;
    let mut cloud: Cloud<N> = model(&theta)?.start(from, stream)?;
    let mut paris = Paris::<N, S>::new(&cloud, settings.backward, stream.fork(0), |_| [0.0; S])?;
    let (mut values, mut impossible) = (Vec::with_capacity(data.len()), 0);
    for (k, (to, z)) in (1usize..).zip(data) {
        let filter = model(&theta)?;
        filter.step(&mut cloud, *to, z.as_ref().map(Borrow::borrow))?;
        let gain = exp(-exponent * ln(k as f64));
        paris.mix(filter.motion(), &cloud, (1.0 - gain, gain), |step| statistics(step, z.as_ref()))?;
        if k > settings.wait {
            let value = maximise(&paris.expectation()?)?;
            if parameters.free(&value).is_ok() {
                theta = value;
            } else {
                impossible += 1;
            }
        }
        values.push(theta);
    }
    let averaged = values.get(settings.average_after..).filter(|values| !values.is_empty());
    let mut average = theta;
    if let Some(values) = averaged {
        average = std::array::from_fn(|i| values.iter().map(|v| v[i]).sum::<f64>() / values.len() as f64);
    }
    Ok(EmTrace { values, average, impossible })
}
