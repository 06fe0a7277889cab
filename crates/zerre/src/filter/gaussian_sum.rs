//! The Gaussian sum filter: a mixture whose parts are split where a function bends within them, and put
//! together again where they say the same.

use super::extended::measurement_tangent;
use super::gaussian::{Deviations, Observed, gate_distance, predict_law, update_law};
use super::imm::weighed;
use super::{Filter, MotionTangent, Outcome, SigmaPoints, Transform, Update};
use crate::belief::{Gaussian, Hypotheses, Hypothesis, matched};
use crate::error::{Error, Result};
use crate::math::{Cholesky, Matrix, Real};
use crate::model::{GaussianMeasurement, Motion};
use crate::rng::Stream;
use crate::time::Time;
use std::array::from_fn;

/// Settings of a [`GaussianSum`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SumSettings {
    /// Most parts that a step leaves, 64 by default; within a step there may be three times as many.
    pub parts: usize,
    /// Parts are split while their weight times their curvature exceeds this, 0.01 by default; infinite for
    /// never. The curvature is the trace of C^-1 Omega, Omega being the mean square of what the tangent
    /// leaves of h(x) and C the covariance of the measurement's noise; for the motion, of what it leaves of
    /// f(x, w) and C that of f(x, w).
    pub split: f64,
    /// Parts whose weights together are no more than this are dropped, 1e-6 by default; after the motion and
    /// after the measurement each.
    pub prune: f64,
    /// Parts are merged while that costs no more than this in all (nats), 1e-3 by default, and further down
    /// to the number of parts whatever it costs; after the motion and after the measurement each.
    pub merge: f64,
}

impl Default for SumSettings {
    fn default() -> Self {
        SumSettings { parts: 64, split: 0.01, prune: 1e-6, merge: 1e-3 }
    }
}

/// What a step did to the parts of a mixture besides Bayes' rule: after the motion and after the measurement,
/// summed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Simplified {
    /// How often a part was split in three.
    pub splits: usize,
    /// Weight of the parts that were dropped. With p a mixture before and q the one after, the divergence D(q
    /// || p) is at most -ln(1 - `pruned`).
    pub pruned: f64,
    /// How often two parts became one.
    pub merges: usize,
    /// What that cost: the sum of Runnalls' bounds, in nats. With p a mixture before and q the one after, D(p
    /// || q) is at most this.
    pub cost: f64,
}

/// The Gaussian sum filter (Sorenson and Alspach, Automatica 7, 1971; Alspach and Sorenson, IEEE Transactions
/// on Automatic Control 17(4), 1972): the posterior as a mixture, each part of which goes through the models
/// as in a Kalman filter of the kind of `T` and is weighed by its evidence.
///
/// One Gaussian cannot say more than one linearisation knows. Before each function the part whose weight
/// times curvature is largest is split in three along the column of the square root of its covariance that
/// bends most, until none exceeds [`SumSettings::split`]. Weights .2252, .5495, .2252 and means -1.0575, 0,
/// 1.0575 standard deviations are those that DeMars, Bishop and Jah (Journal of Guidance, Control, and
/// Dynamics 36(4), 2013) fitted to a normal law; theirs have variances of .4510, which leave .9548 of the
/// whole, and here they are .4963, so that splitting changes neither mean nor covariance. Curvature is taken
/// at the points of [`SigmaPoints::default`] for every `T`.
///
/// After a motion, and again after a measurement, the lightest parts are dropped, and pairs become one
/// Gaussian of the same mean and covariance in the order of Runnalls' bound ((w_i + w_j) ln|P_ij| - w_i
/// ln|P_i| - w_j ln|P_j|) / 2 on the divergence that it makes (Runnalls, IEEE Transactions on Aerospace and
/// Electronic Systems 43(3), 2007). The bounds of all merges at one point add up to a bound for them
/// together; [`GaussianSum::advance`] states the sum for the step.
///
/// On linear models nothing is ever split, and the filter is the Kalman filter. Process noise that is not
/// normal counts with its mean and variance. The belief has one mode; a mixture of one's own
/// ([`Hypotheses::new`]) may start it.
///
/// ```
/// use zerre::belief::Gaussian;
/// use zerre::filter::{Filter, GaussianSum, SumSettings, Tangent};
/// use zerre::model::{measurement::Growth, motion};
/// use zerre::rng::Stream;
/// use zerre::Time;
///
/// // The square of the state is seen: its sign stays open.
/// let prior = Gaussian::independent([0.0], [5.0])?;
/// let (motion, sensor) = (motion::Growth::new(10.0)?, Growth::new(1.0)?);
/// let filter = GaussianSum::new(Tangent, motion, sensor, prior, SumSettings::default())?;
/// let mut belief = filter.start(Time::ZERO, Stream::new(1))?;
/// let (_, simplified) = filter.advance(&mut belief, Time::ZERO, Some(&[1.8]))?;
/// assert!(simplified.splits > 0 && belief.len() > 1);
/// let sd = belief.combined()?.covariance().0[0][0].sqrt();
/// assert!(belief.mean()[0].abs() < 0.5 * sd && sd > 3.0);
/// # Ok::<(), zerre::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct GaussianSum<T, A, H, const N: usize, const W: usize, const M: usize> {
    transform: T,
    motion: A,
    measurement: H,
    prior: Gaussian<N>,
    settings: SumSettings,
    gate: Option<f64>,
}

/// Weight of the outer parts of a split, and their distance from the middle in standard deviations.
const OUTER: (f64, f64) = (0.225_224_624_9, 1.057_515_461_5);

impl<T, A, H, const N: usize, const W: usize, const M: usize> GaussianSum<T, A, H, N, W, M>
where
    T: Transform,
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    /// The filter of these models, started from `prior`.
    ///
    /// # Errors
    /// Models or parameters that the `transform` does not hold for; no part or more than 4096; limits that
    /// are negative or NaN, a share to drop of 1 or more.
    pub fn new(
        transform: T,
        motion: A,
        measurement: H,
        prior: Gaussian<N>,
        settings: SumSettings,
    ) -> Result<Self> {
        transform.accept(&motion, &measurement, &prior)?;
        let refuse = |what, value, needs| Err(Error::OutOfRange { what, value, needs });
        if !(1..=4096).contains(&settings.parts) {
            let needs = "it must lie between 1 and 4096";
            return refuse("number of parts", settings.parts as f64, needs);
        }
        for (what, value) in [("curvature that splits", settings.split), ("cost of merging", settings.merge)]
        {
            if value.is_nan() || value < 0.0 {
                return refuse(what, value, "it must not be negative");
            }
        }
        if !(0.0..1.0).contains(&settings.prune) {
            return refuse("share of the weights to drop", settings.prune, "it must lie in [0, 1)");
        }
        Ok(GaussianSum { transform, motion, measurement, prior, settings, gate: None })
    }

    /// Leaves out measurements whose squared Mahalanobis distance from what the whole mixture, taken as one
    /// Gaussian, foretells exceeds the chi-square quantile at `probability`.
    ///
    /// # Errors
    /// `probability` outside (0, 1).
    pub fn with_gate(self, probability: f64) -> Result<Self> {
        Ok(GaussianSum { gate: Some(gate_distance::<M>(probability)?), ..self })
    }

    /// Settings of the filter.
    pub fn settings(&self) -> &SumSettings {
        &self.settings
    }

    /// [`Filter::step`], with what it did to the parts.
    ///
    /// # Errors
    /// Those of [`Filter::step`]; a belief of more modes than one.
    pub fn advance(
        &self,
        belief: &mut Hypotheses<N>,
        to: Time,
        z: Option<&H::Value>,
    ) -> Result<(Update, Simplified)> {
        if to < belief.time {
            return Err(Error::OutOfOrder { from: belief.time, to });
        }
        if belief.modes != 1 {
            return Err(Error::Shape { what: "modes of the belief", found: belief.modes, expected: 1 });
        }
        let Hypotheses { time, all, spare, weights, kept, .. } = &mut *belief;
        let most = 3 * self.settings.parts.max(all.len());
        // As many as there can ever be: no later step allocates.
        spare.clear();
        kept.clear();
        weights.clear();
        spare.reserve(most);
        all.reserve(most.saturating_sub(all.len()));
        weights.reserve(most);
        kept.reserve(most);
        spare.extend_from_slice(all);

        let mut done = Simplified::default();
        if to > *time {
            let step = self.motion.over(*time, to)?;
            done.splits += self.split(spare, kept, |law| moved_curvature(&self.motion, &step, law))?;
            for part in spare.iter_mut() {
                part.law = predict_law(&self.transform, &self.motion, &part.law, *time, to)?;
            }
            self.simplify(spare, (weights, kept), &mut done)?;
        }
        let mut update = Update { outcome: Outcome::Predicted, log_evidence: 0.0, particles: None };
        if let Some(z) = z {
            let whole = || matched(spare.len(), &|i| (spare[i].weight, &spare[i].law));
            let gated = self.gate.is_some()
                && update_law(&self.transform, &self.measurement, self.gate, &whole()?, z, to)?.1.outcome
                    == Outcome::Gated;
            let before = done.splits;
            if !gated {
                let noise = Matrix(self.measurement.covariance());
                let noise = Cholesky::of("covariance of the measurement", &noise).ok();
                done.splits += self.split(spare, kept, |law| match &noise {
                    Some(noise) => seen_curvature(&self.measurement, to, noise, law),
                    None => (0.0, 0),
                })?;
            }
            weights.clear();
            for part in spare.iter_mut() {
                let (law, alone) = update_law(&self.transform, &self.measurement, None, &part.law, z, to)?;
                weights.push(Real::ln(part.weight) + alone.log_evidence);
                if !gated {
                    part.law = law;
                }
            }
            update = weighed(weights, gated);
            match update.outcome {
                Outcome::Updated => {
                    spare.iter_mut().zip(weights.iter()).for_each(|(part, &weight)| part.weight = weight);
                }
                // Split for a measurement that is not used.
                Outcome::Degenerate if done.splits > before => {
                    let (_, done) = self.advance(belief, to, None)?;
                    return Ok((update, done));
                }
                _ => {}
            }
        }
        self.simplify(spare, (weights, kept), &mut done)?;
        std::mem::swap(all, spare);
        (belief.time, belief.step) = (to, belief.step + 1);
        Ok((update, done))
    }

    /// Drops and merges parts as the settings say.
    fn simplify(
        &self,
        parts: &mut Vec<Hypothesis<N>>,
        memory: (&mut Vec<f64>, &mut Vec<(u32, f64)>),
        done: &mut Simplified,
    ) -> Result<()> {
        done.pruned += prune(parts, self.settings.prune);
        let (merges, cost) = merge(parts, memory, &self.settings)?;
        done.merges += merges;
        done.cost += cost;
        Ok(())
    }

    /// Splits the part of the largest weight times curvature until none exceeds the limit or there are too
    /// many; returns how often. `curvature` tells it and the column of the square root that bends most.
    fn split(
        &self,
        parts: &mut Vec<Hypothesis<N>>,
        bends: &mut Vec<(u32, f64)>,
        curvature: impl Fn(&Gaussian<N>) -> (f64, usize),
    ) -> Result<usize> {
        let bend = |part: &Hypothesis<N>| {
            let (curvature, axis) = curvature(&part.law);
            (axis as u32, part.weight * curvature)
        };
        bends.clear();
        bends.extend(parts.iter().map(bend));
        let mut splits = 0;
        while parts.len() + 2 <= 3 * self.settings.parts {
            // Not a number where the function is none: such parts stay whole.
            let largest = |best: (usize, f64), (i, &(_, b)): (usize, &(u32, f64))| {
                if b > best.1 { (i, b) } else { best }
            };
            let (i, worst) = bends.iter().enumerate().fold((0, 0.0), largest);
            if worst.is_nan() || worst <= self.settings.split {
                break;
            }
            let [left, middle, right] = thirds(&parts[i], bends[i].0 as usize)?;
            (parts[i], bends[i]) = (middle, bend(&middle));
            for part in [left, right] {
                bends.push(bend(&part));
                parts.push(part);
            }
            splits += 1;
        }
        Ok(splits)
    }
}

/// Curvature of the measurement, with the column that bends most; none where the points have no images.
fn seen_curvature<H: GaussianMeasurement<N, M>, const N: usize, const M: usize>(
    measurement: &H,
    at: Time,
    noise: &Cholesky<M>,
    law: &Gaussian<N>,
) -> (f64, usize) {
    let (_, tangent) = measurement_tangent(measurement, at, law.mean());
    let observed = SigmaPoints::default().observe(measurement, at, law);
    observed.map_or((0.0, 0), |observed| worst(&observed, &tangent, noise))
}

/// Curvature of the motion, with the column that bends most. None where the points have no images or these
/// are singular.
fn moved_curvature<A: Motion<N, W>, const N: usize, const W: usize>(
    motion: &A,
    step: &A::Step,
    law: &Gaussian<N>,
) -> (f64, usize) {
    let tangent = MotionTangent::<N, W>::at::<A>(step, law.mean(), &[motion.noise().mean(); W]).by_state;
    let joint = SigmaPoints::default().propagate_joint(motion, step, law);
    let scaled =
        joint.and_then(|joint| Ok((Cholesky::of("predicted covariance", joint.law().covariance())?, joint)));
    scaled.map_or((0.0, 0), |(factor, joint)| worst(&joint.by_state, &tangent, &factor))
}

/// The trace of C^-1 Omega and the column that adds most to it, C being the matrix that was factored. The
/// sigma points are those of [`SigmaPoints::default`], which count deviations from the image of the mean.
fn worst<const N: usize, const K: usize>(
    seen: &Observed<N, K>,
    tangent: &Matrix<K, N>,
    scale: &Cholesky<K>,
) -> (f64, usize) {
    let Deviations::Points { weight, state, measured } = &seen.deviations else { return (0.0, 0) };
    let (mut trace, mut most, mut axis) = (0.0, 0.0, 0);
    for (j, (dx, [plus, minus])) in state.iter().zip(measured).enumerate() {
        let straight = *tangent * *dx;
        let bend = scale.mahalanobis_squared(&from_fn(|i| plus[i] - straight[i]))
            + scale.mahalanobis_squared(&from_fn(|i| minus[i] + straight[i]));
        trace += weight * bend;
        if bend > most {
            (most, axis) = (bend, j);
        }
    }
    (trace, axis)
}

/// A part as three along column `axis` of the square root of its covariance.
fn thirds<const N: usize>(part: &Hypothesis<N>, axis: usize) -> Result<[Hypothesis<N>; 3]> {
    let mut factor = Cholesky::semidefinite("covariance of a part", part.law.covariance())?;
    let column = factor.column(axis);
    let (outer, distance) = OUTER;
    // What the means spread, 2 w d^2, is taken off.
    let narrow = (1.0 - 2.0 * outer * distance * distance).sqrt();
    for i in 0..N {
        factor.0[i][axis] *= narrow;
    }
    let covariance = factor.congruence(&Matrix::identity());
    let at = |weight: f64, off: f64| {
        let mean = from_fn(|i| part.law.mean()[i] + off * column[i]);
        let law = Gaussian::computed("mean of a part", "covariance of a part", mean, covariance)?;
        Ok(Hypothesis { label: part.label, weight: weight * part.weight, law })
    };
    Ok([at(outer, -distance)?, at(1.0 - 2.0 * outer, 0.0)?, at(outer, distance)?])
}

/// Sorts the parts by weight and drops the lightest, which together have no more than `share`; returns their
/// weight.
fn prune<const N: usize>(parts: &mut Vec<Hypothesis<N>>, share: f64) -> f64 {
    parts.sort_unstable_by(|a, b| b.weight.total_cmp(&a.weight));
    let mut dropped = 0.0;
    while parts.len() > 1 {
        let Some(lightest) = parts.last().filter(|part| dropped + part.weight <= share) else { break };
        dropped += lightest.weight;
        parts.pop();
    }
    if dropped > 0.0 {
        let sum: f64 = parts.iter().map(|part| part.weight).sum();
        parts.iter_mut().for_each(|part| part.weight /= sum);
    }
    dropped
}

/// Merges the cheapest pairs as the settings say; returns how many and what they cost.
fn merge<const N: usize>(
    parts: &mut Vec<Hypothesis<N>>,
    (log_dets, nearest): (&mut Vec<f64>, &mut Vec<(u32, f64)>),
    settings: &SumSettings,
) -> Result<(usize, f64)> {
    log_dets.clear();
    log_dets.extend(parts.iter().map(|part| log_det(&part.law)));
    nearest.clear();
    for i in 0..parts.len() {
        nearest.push(cheapest(parts, log_dets, i));
    }
    let (mut merges, mut total) = (0, 0.0);
    while parts.len() > 1 {
        let least = |best: usize, i: usize| if nearest[i].1 < nearest[best].1 { i } else { best };
        let a = (1..parts.len()).fold(0, least);
        let (b, cost) = nearest[a];
        if parts.len() <= settings.parts && total + cost > settings.merge {
            break;
        }
        let (a, b) = (a.min(b as usize), a.max(b as usize));
        let both = [&parts[a], &parts[b]];
        let law = matched(2, &|i| (both[i].weight, &both[i].law))?;
        let weight = both[0].weight + both[1].weight;
        parts[a] = Hypothesis { law, weight, ..parts[a] };
        log_dets[a] = log_det(&law);
        parts.swap_remove(b);
        log_dets.swap_remove(b);
        nearest.swap_remove(b);
        (merges, total) = (merges + 1, total + cost);
        // The last part stands where b was.
        let last = parts.len() as u32;
        for i in 0..parts.len() {
            if i == a || nearest[i].0 as usize == a || nearest[i].0 as usize == b {
                nearest[i] = cheapest(parts, log_dets, i);
                continue;
            }
            if nearest[i].0 == last {
                nearest[i].0 = b as u32;
            }
            let cost = bound(parts, log_dets, i, a);
            if cost < nearest[i].1 {
                nearest[i] = (a as u32, cost);
            }
        }
    }
    Ok((merges, total))
}

/// ln det of the covariance; -inf where it is singular.
fn log_det<const N: usize>(law: &Gaussian<N>) -> f64 {
    Cholesky::of("covariance of a part", law.covariance())
        .map_or(f64::NEG_INFINITY, |factor| factor.log_det())
}

/// The part that is merged with part `i` at the least cost, and the cost.
fn cheapest<const N: usize>(parts: &[Hypothesis<N>], log_dets: &[f64], i: usize) -> (u32, f64) {
    let others = (0..parts.len()).filter(|&j| j != i).map(|j| (j as u32, bound(parts, log_dets, i, j)));
    others.reduce(|best, next| if next.1 < best.1 { next } else { best }).unwrap_or((0, f64::INFINITY))
}

/// Runnalls' bound for the merge of two parts; infinite where a singular part loses its exactness.
fn bound<const N: usize>(parts: &[Hypothesis<N>], log_dets: &[f64], i: usize, j: usize) -> f64 {
    let (a, b) = (&parts[i], &parts[j]);
    let Ok(law) = matched(2, &|part| if part == 0 { (a.weight, &a.law) } else { (b.weight, &b.law) }) else {
        return f64::INFINITY;
    };
    let both = log_det(&law);
    let cost = 0.5 * (a.weight * (both - log_dets[i]) + b.weight * (both - log_dets[j]));
    if cost.is_nan() { f64::INFINITY } else { cost.max(0.0) }
}

impl<T, A, H, const N: usize, const W: usize, const M: usize> Filter for GaussianSum<T, A, H, N, W, M>
where
    T: Transform,
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    type Measurement = H::Value;
    type Belief = Hypotheses<N>;

    /// The prior as one part; no random numbers are drawn.
    fn start(&self, at: Time, stream: Stream) -> Result<Hypotheses<N>> {
        Hypotheses::new(at, stream, 1, vec![Hypothesis { label: 0, weight: 1.0, law: self.prior }])
    }

    fn step(&self, belief: &mut Hypotheses<N>, to: Time, z: Option<&H::Value>) -> Result<Update> {
        Ok(self.advance(belief, to, z)?.0)
    }
}
