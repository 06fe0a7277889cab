//! The smoother of Rauch, Tung and Striebel (AIAA Journal 3(8), 1965).

use crate::belief::{Gaussian, GaussianBelief};
use crate::error::{Error, Result};
use crate::filter::MotionTangent;
use crate::math::{Cholesky, Matrix};
use crate::model::Motion;
use std::array::from_fn;

/// The beliefs given all measurements, from the `filtered` ones in the order of time (after each step, whether it
/// had a measurement or not; several at one instant are fine). Exact for linear normal models; otherwise the
/// extended smoother: tangents of the motion at the filtered means, by dual numbers. The last belief stays as it is,
/// and so does the order.
///
/// The covariance is summed from squares, (I - G F) P (I - G F)' + G (Q + P_s) G' with the gain G and the smoothed
/// covariance P_s of the step after, so that rounding does not make it indefinite.
///
/// # Errors
/// [`Error::OutOfOrder`]; a model that refuses its parameters; a prediction that is not finite or whose covariance
/// is singular (a component known exactly has nothing to smooth: leave it out of the state).
pub fn rauch_tung_striebel<A, const N: usize, const W: usize>(
    motion: &A,
    filtered: &[GaussianBelief<N>],
) -> Result<Vec<GaussianBelief<N>>>
where
    A: Motion<N, W>,
{
    let mut smoothed = filtered.to_vec();
    for k in (1..smoothed.len()).rev() {
        let (now, after) = (filtered[k - 1], smoothed[k]);
        if now.time > after.time {
            return Err(Error::OutOfOrder { from: now.time, to: after.time });
        }
        if now.time == after.time {
            // Nothing moved in between: what is known of the one is known of the other.
            smoothed[k - 1] = after;
            continue;
        }
        let step = motion.over(now.time, after.time)?;
        smoothed[k - 1].state = backward(motion, &step, &now.state, &after.state)?;
    }
    Ok(smoothed)
}

/// One step back: the smoothed law before a step from the filtered law `now` and the smoothed law `after` it.
pub(super) fn backward<A, const N: usize, const W: usize>(
    motion: &A,
    step: &A::Step,
    now: &Gaussian<N>,
    after: &Gaussian<N>,
) -> Result<Gaussian<N>>
where
    A: Motion<N, W>,
{
    let noise = motion.noise();
    let tangent = MotionTangent::<N, W>::at::<A>(step, now.mean(), &[noise.mean(); W]);
    let added = tangent.noise_covariance(noise.variance());
    let prior = now.covariance();
    let predicted = Cholesky::of("predicted covariance", &(tangent.by_state.congruence(prior) + added))?;
    let gain = predicted.solve_matrix(&(tangent.by_state * *prior)).transpose();
    let correction = gain * from_fn(|i| after.mean()[i] - tangent.value[i]);
    let mean = from_fn(|i| now.mean()[i] + correction[i]);
    let kept = (Matrix::identity() - gain * tangent.by_state).congruence(prior);
    let covariance = kept + gain.congruence(&(added + *after.covariance()));
    Gaussian::computed("smoothed mean", "smoothed covariance", mean, covariance)
}
