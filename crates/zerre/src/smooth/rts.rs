//! The smoother of Rauch, Tung and Striebel (AIAA Journal 3(8), 1965), for every way in which a Gaussian goes
//! through a motion.

use crate::belief::{Gaussian, GaussianBelief};
use crate::error::{Error, Result};
use crate::filter::{Tangent, Transform};
use crate::model::Motion;

/// The beliefs given all measurements, from the `filtered` ones in the order of time (after each step, whether it
/// had a measurement or not; several at one instant are fine). Exact for linear normal models; otherwise the
/// extended smoother: tangents of the motion at the filtered means, by dual numbers. The last belief stays as it is,
/// and so does the order.
///
/// It is [`smooth_gaussian`] with [`Tangent`].
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
    smooth_gaussian(&Tangent, motion, filtered)
}

/// [`rauch_tung_striebel`] for a `transform` of one's own: with [`SigmaPoints`](crate::filter::SigmaPoints)
/// the unscented smoother (Särkkä, IEEE Transactions on Automatic Control 53(3), 2008), with the points of
/// [`SigmaPoints::cubature`](crate::filter::SigmaPoints::cubature) that of cubature. Take the transform that
/// filtered.
///
/// One step back with x before the step, y = f(x, w) after it and the gain G = Cov(x, y) Cov(y)^-1: the mean
/// moves by G times what the mean of y moved, and the covariance is summed from squares, Cov(x - G y) + G P_s
/// G' with the smoothed covariance P_s of y, so that rounding does not make it indefinite.
///
/// # Errors
/// Those of [`rauch_tung_striebel`]; a motion that the transform does not hold for.
pub fn smooth_gaussian<T, A, const N: usize, const W: usize>(
    transform: &T,
    motion: &A,
    filtered: &[GaussianBelief<N>],
) -> Result<Vec<GaussianBelief<N>>>
where
    T: Transform,
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
        smoothed[k - 1].state = backward(transform, motion, &step, &now.state, &after.state)?;
    }
    Ok(smoothed)
}

/// One step back: the smoothed law before a step from the filtered law `now` and the smoothed law `after` it.
pub(super) fn backward<T, A, const N: usize, const W: usize>(
    transform: &T,
    motion: &A,
    step: &A::Step,
    now: &Gaussian<N>,
    after: &Gaussian<N>,
) -> Result<Gaussian<N>>
where
    T: Transform,
    A: Motion<N, W>,
{
    transform.propagate_joint(motion, step, now)?.condition(now, after)
}
