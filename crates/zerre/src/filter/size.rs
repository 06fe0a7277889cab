//! Particle filters whose number of particles changes from step to step.

use crate::belief::{Cloud, MAX_PARTICLES, checked_number};
use crate::error::{Error, Result};
use crate::kernels::{Simd, Total, expected_occupied, log_absent};
use crate::math::chi_square;
use std::array::from_fn;

/// How the number of particles changes. It changes by resampling to another number, which leaves the evidence
/// unbiased: the number is known before the draw. A filter whose trigger is never is refused all but
/// [`Size::Fixed`].
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Size {
    /// It does not.
    #[default]
    Fixed,
    /// As many as the spread of the particles asks for, wherever the trigger resamples.
    Kld(Kld),
    /// The number of each step, from 0, as [`ParticleUpdate::particles`](super::ParticleUpdate::particles) of
    /// an earlier run recorded it, so that the run can be had again, to the same bits. A step with a
    /// measurement that comes before another number resamples, whatever the trigger says; after the end of the
    /// record the number stays. The first is that of the settings (with a lookahead the first step may have
    /// another).
    Recorded(Vec<u32>),
}

/// The number of particles of KLD sampling (Fox, International Journal of Robotics Research 22, 2003): so many
/// that the divergence of Kullback and Leibler between them and the law that they are drawn from, cut into
/// boxes, stays below an error with some confidence. For k boxes that hold particles that is
/// n(k) = (k - 1) / (2 error) (1 - 2 / (9 (k - 1)) + sqrt(2 / (9 (k - 1))) z)^3 with the normal quantile z.
///
/// Fox counts boxes while he draws; where to stop then depends on the draws, and the evidence is biased. Here
/// k(n) is what n draws are expected to fall into, the sum over boxes of 1 - (1 - p)^n, p being the mass of
/// the weighted particles in the box, and the number is the least n with n >= n(k(n)), or `most`.
/// Resampling costs n ln n more. Weights that a few particles hold between them look like a narrow posterior:
/// `least` is to be a number from which the filter recovers.
#[derive(Clone, Debug, PartialEq)]
pub struct Kld {
    error: f64,
    /// Quantile of the standard normal law at the confidence.
    z: f64,
    boxes: Boxes,
    least: usize,
    most: usize,
}

/// The boxes that [`Kld`] cuts the state space into, laid about the mean of the particles.
///
/// Of N components each is cut into at most 2^(128/N) intervals (2^32 if that is less); what lies further out
/// counts as the last.
#[derive(Clone, Debug, PartialEq)]
pub enum Boxes {
    /// Sides in weighted standard deviations of the particles, component by component. The number then
    /// follows the shape of the posterior and not its width: a collapsed one and a wide one ask for the same,
    /// two narrow modes far apart for fewer.
    Deviations(f64),
    /// Sides in the units of the state, one for each component (Fox); an infinite one does not cut. The
    /// number follows the volume that the particles fill.
    Sides(Vec<f64>),
}

impl Kld {
    /// A divergence of at most `error` (nats) with probability `confidence`, by `least` to `most` particles.
    ///
    /// # Errors
    /// An error or a side that is not above zero, a confidence outside (0, 1), no or too many particles, more
    /// of `least` than of `most`.
    pub fn new(error: f64, confidence: f64, boxes: Boxes, least: usize, most: usize) -> Result<Kld> {
        Error::positive("divergence", error)?;
        Error::finite("confidence of the divergence", confidence)?;
        if !(confidence > 0.0 && confidence < 1.0) {
            let what = "confidence of the divergence";
            return Err(Error::OutOfRange { what, value: confidence, needs: "it must lie in (0, 1)" });
        }
        match &boxes {
            Boxes::Deviations(side) => {
                Error::positive("side of a box", *side)?;
            }
            Boxes::Sides(sides) => {
                for &side in sides.iter().filter(|&&side| side != f64::INFINITY) {
                    Error::positive("side of a box", side)?;
                }
            }
        }
        checked_range(least, most)?;
        // The square of a normal number is chi-square.
        let z = chi_square::quantile((2.0 * confidence - 1.0).abs(), 1)?.sqrt();
        Ok(Kld { error, z: z.copysign(confidence - 0.5), boxes, least, most })
    }

    /// n(k). Between one box, which needs nothing, and two it is a straight line.
    fn needed(&self, occupied: f64) -> f64 {
        let over = (occupied - 1.0).max(0.0);
        let freedom = over.max(1.0);
        let spread = 2.0 / (9.0 * freedom);
        let root = (1.0 - spread + spread.sqrt() * self.z).max(0.0);
        over / (2.0 * self.error) * root * root * root
    }

    /// The number for boxes that a draw misses with these log-probabilities.
    fn number(&self, simd: Simd, absent: &[f64]) -> usize {
        let enough = |n: usize| n as f64 >= self.needed(expected_occupied(simd, absent, n as f64));
        let (mut low, mut high) = (self.least, self.most);
        if enough(low) {
            return low;
        }
        // k(n) is concave, and n(k) nearly: from where n is not enough it is enough only once.
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            if enough(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        high
    }

    fn count<const N: usize>(&self, simd: Simd, cloud: &mut Cloud<N>, total: &Total<N>) -> usize {
        let mean = total.sum_states.map(|s| s / total.sum);
        let per_side: [f64; N] = match &self.boxes {
            Boxes::Deviations(side) => {
                let mut variance = [0.0; N];
                for (w, x) in cloud.weighted() {
                    for k in 0..N {
                        variance[k] += w * (x[k] - mean[k]) * (x[k] - mean[k]);
                    }
                }
                variance.map(|v: f64| 1.0 / (side * v.sqrt()))
            }
            Boxes::Sides(sides) => from_fn(|k| sides.get(k).map_or(0.0, |side| 1.0 / side)),
        };
        // A component without any spread is not cut.
        let per_side = per_side.map(|cuts| if cuts.is_finite() { cuts } else { 0.0 });
        let bits = (128 / N.max(1)).clamp(1, 32);
        let half = (1u64 << (bits - 1)) as f64;
        let mut bins = std::mem::take(&mut cloud.scratch.bins);
        bins.clear();
        bins.extend(cloud.weighted().filter(|(w, _)| *w > 0.0).map(|(w, x)| {
            let key = (0..N).fold(0u128, |key, k| {
                let at = ((x[k] - mean[k]) * per_side[k]).floor().clamp(-half, half - 1.0);
                (key << bits) | (at + half) as u128
            });
            (key, w)
        }));
        // In an order that does not depend on the way of sorting, because sums do.
        bins.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let masses = cloud.scratch.masses();
        masses.clear();
        masses.extend(bins.chunk_by(|a, b| a.0 == b.0).map(|bin| bin.iter().map(|(_, w)| w).sum::<f64>()));
        log_absent(simd, masses);
        let number = self.number(simd, masses);
        cloud.scratch.bins = bins;
        number
    }
}

impl Size {
    /// Refuses what is out of range for states of `dimensions` components and so many particles at first, the
    /// number of which the first step may change or not.
    pub(super) fn checked(&self, dimensions: usize, (particles, changes): (usize, bool)) -> Result<()> {
        match self {
            Size::Fixed => Ok(()),
            Size::Kld(Kld { boxes: Boxes::Sides(sides), .. }) if sides.len() != dimensions => {
                Err(Error::Shape { what: "sides of a box", found: sides.len(), expected: dimensions })
            }
            Size::Kld(_) => Ok(()),
            Size::Recorded(numbers) => {
                let first = numbers.first().map_or(particles, |&n| n as usize);
                if first != particles && !changes {
                    let what = "first number of the record";
                    return Err(Error::Shape { what, found: first, expected: particles });
                }
                numbers.iter().try_for_each(|&n| checked_number(n as usize).map(drop))
            }
        }
    }

    /// The largest number that there may be.
    pub(super) fn most(&self, particles: usize) -> usize {
        match self {
            Size::Fixed => particles,
            Size::Kld(kld) => kld.most.max(particles),
            Size::Recorded(numbers) => numbers.iter().fold(particles, |most, &n| most.max(n as usize)),
        }
    }

    /// What a resampling before step `step`, from 0, is to leave.
    pub(super) fn goal(&self, step: u64) -> Goal<'_> {
        match self {
            Size::Fixed => Goal::Same,
            Size::Kld(kld) => Goal::Kld(kld),
            Size::Recorded(numbers) => {
                let number = usize::try_from(step).ok().and_then(|step| numbers.get(step));
                number.map_or(Goal::Same, |&n| Goal::Exactly(n as usize))
            }
        }
    }
}

/// How many particles a resampling is to leave.
pub(super) enum Goal<'a> {
    /// As many as there are.
    Same,
    /// As many as the divergence asks for.
    Kld(&'a Kld),
    /// So many.
    Exactly(usize),
    /// So many, but to change the number by less than an eighth waits for the trigger.
    About(usize),
}

impl Goal<'_> {
    /// Whether `n` particles are to be resampled even if nothing else asks for it.
    pub(super) fn insists(&self, n: usize) -> bool {
        match *self {
            Goal::Same | Goal::Kld(_) => false,
            Goal::Exactly(wanted) => wanted != n,
            Goal::About(wanted) => 8 * wanted.abs_diff(n) > n,
        }
    }

    /// The number.
    pub(super) fn count<const N: usize>(&self, simd: Simd, cloud: &mut Cloud<N>, total: &Total<N>) -> usize {
        match *self {
            Goal::Same => cloud.len(),
            Goal::Kld(kld) => kld.count(simd, cloud, total),
            Goal::Exactly(wanted) | Goal::About(wanted) => wanted,
        }
    }
}

/// Refuses numbers of particles from `least` to `most` that are none, too many or in the wrong order.
pub(super) fn checked_range(least: usize, most: usize) -> Result<()> {
    checked_number(least)?;
    if most < least || most > MAX_PARTICLES {
        let needs = "it must be no less than the least, and at most 2^26";
        return Err(Error::OutOfRange { what: "largest number of particles", value: most as f64, needs });
    }
    Ok(())
}

/// Why a filter that never resamples has one number of particles.
pub(super) fn never_resampled() -> Error {
    Error::Unsupported("the number of particles changes by resampling, and the trigger is never".to_owned())
}
