//! The smoother of interacting multiple models.

use super::rts::backward;
use crate::belief::{ModalGaussian, matched};
use crate::error::{Error, Result};
use crate::filter::Tangent;
use crate::model::jump::MAX_MODES;
use crate::model::{JumpMarkov, Motion};

/// The beliefs of an [`Imm`](crate::filter::Imm) given all measurements, from the `filtered` ones in the order of time
/// (Kim, Journal of Econometrics 60, 1994). The last belief stays as it is, and so does the order.
///
/// Backwards, with mu_i the filtered probabilities, c_j = sum over i of p_ij mu_i and nu_j the smoothed probability of
/// mode j a step later, modes i and then j have probability nu_j p_ij mu_i / c_j: that the later measurements say
/// nothing more of i once j is known is the approximation. For each pair one step of
/// [`rauch_tung_striebel`](super::rauch_tung_striebel) under mode j leads from the filtered law of i towards the
/// smoothed law of j; the laws of one i are then matched by one Gaussian. With one mode this is that smoother. A mode
/// that turns out impossible keeps its filtered law with probability zero.
///
/// # Errors
/// [`Error::OutOfOrder`]; beliefs of another number of modes; a model that refuses its parameters; a prediction that is
/// not finite or whose covariance is singular.
pub fn smooth_modes<A, const N: usize, const W: usize>(
    model: &JumpMarkov<A>,
    filtered: &[ModalGaussian<N>],
) -> Result<Vec<ModalGaussian<N>>>
where
    A: Motion<N, W>,
{
    let expected = model.modes().len();
    if let Some(found) = filtered.iter().map(ModalGaussian::len).find(|&found| found != expected) {
        return Err(Error::Shape { what: "modes of a belief", found, expected });
    }
    let mut smoothed = filtered.to_vec();
    for k in (1..smoothed.len()).rev() {
        let (head, tail) = smoothed.split_at_mut(k);
        let (Some(now), Some(after)) = (head.last_mut(), tail.first()) else { break };
        let (from, to) = (now.time, after.time);
        if from > to {
            return Err(Error::OutOfOrder { from, to });
        }
        if from == to {
            // Nothing moved in between: what is known of the one is known of the other.
            *now = after.clone();
            continue;
        }
        let steps = model.modes().iter().map(|mode| mode.over(from, to)).collect::<Result<Vec<_>>>()?;
        let transition = model.chain().over(from, to);
        let predicted = transition.predict(&now.probabilities);
        let mut probabilities = [0.0; MAX_MODES];
        for i in 0..expected {
            let mut paths = Vec::with_capacity(expected);
            for (j, (motion, step)) in model.modes().iter().zip(&steps).enumerate() {
                let joint = transition.probability(i, j) * now.probabilities[i];
                // Where nothing leads to j, its filter gave it no probability, and nothing later can.
                if joint > 0.0 && after.probabilities[j] > 0.0 {
                    let weight = after.probabilities[j] * (joint / predicted[j]);
                    paths.push((weight, backward(&Tangent, motion, step, &now.laws[i], &after.laws[j])?));
                }
            }
            probabilities[i] = paths.iter().map(|(weight, _)| weight).sum();
            if probabilities[i] > 0.0 {
                now.spare[i] = matched(paths.len(), &|j| (paths[j].0, &paths[j].1))?;
            } else {
                now.spare[i] = now.laws[i];
            }
        }
        let sum: f64 = Error::positive("sum of the smoothed probabilities", probabilities.iter().sum())?;
        for (p, smoothed) in now.probabilities.iter_mut().zip(probabilities) {
            *p = smoothed / sum;
        }
        std::mem::swap(&mut now.laws, &mut now.spare);
    }
    Ok(smoothed)
}
