//! The Rao-Blackwellised multiple-model filter: the modes by enumeration and reduction, the state given them by a
//! Gaussian.

use super::gaussian::{gate_distance, update_law};
use super::imm::weighed;
use super::{Filter, MotionTangent, Outcome, Transform, Update};
use crate::belief::{Gaussian, Hypotheses, Hypothesis, MAX_PARTICLES, matched};
use crate::error::{Error, Result};
use crate::math::{Matrix, Real};
use crate::model::jump::MAX_MODES;
use crate::model::{GaussianMeasurement, JumpMarkov, Motion};
use crate::resample::Reduction;
use crate::rng::Stream;
use crate::time::Time;
use std::array::from_fn;

/// The Rao-Blackwellised filter of a jump-Markov model (Doucet, Gordon and Krishnamurthy, IEEE Transactions on Signal
/// Processing 49(3), 2001): hypotheses about the history of modes, each with a Kalman filter of one kind or another.
///
/// A step takes every hypothesis through every mode that may follow, multiplies its weight by the transition's
/// probability and the evidence of the measurement (so that modes are proposed by their own posterior), and shows all
/// of them. The next one first reduces them to the number that the filter keeps ([`Reduction`]), without bias: exp of
/// the summed log-evidence has the expectation that no reduction would give. While the number is not exceeded nothing
/// is reduced, and on linear models the results are exact. Neighbours of equal laws, as at the start, go on as one.
///
/// A pair of hypothesis and mode whose update is [`Outcome::Degenerate`] has evidence zero; where this befalls all, so
/// is the outcome of the step. The gate is applied once, to the innovation of the combined law.
///
/// ```
/// use zerre::belief::Gaussian;
/// use zerre::filter::{Filter, RaoBlackwell, Tangent};
/// use zerre::model::{Chain, JumpMarkov, measurement::RangeBearing, motion::CoordinatedTurn};
/// use zerre::rng::Stream;
/// use zerre::Time;
///
/// let turn = |rate: f64| CoordinatedTurn::new(rate, 0.1);
/// let modes = vec![turn(0.0)?, turn(0.0785)?, turn(-0.0785)?];
/// let model = JumpMarkov::new(modes, Chain::staying(3, 0.95)?)?;
/// let prior = Gaussian::independent([900.0, 500.0, 0.0, 0.0], [100.0, 100.0, 10.0, 10.0])?;
/// let filter = RaoBlackwell::new(Tangent, model, RangeBearing::new([0.0, 0.0], 5.0, 0.01)?, prior, 50)?;
///
/// let mut belief = filter.start(Time::ZERO, Stream::new(1))?;
/// for (t, range, bearing) in [(0.0, 1000.0, 0.45), (1.0, 1004.0, 0.44), (2.0, 1008.0, 0.43)] {
///     filter.step(&mut belief, Time::from_secs(t), Some(&[range, bearing]))?;
/// }
/// assert_eq!(belief.len(), 9); // Two transitions of three modes.
/// # Ok::<(), zerre::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct RaoBlackwell<T, A, H, const N: usize, const W: usize, const M: usize> {
    transform: T,
    model: JumpMarkov<A>,
    measurement: H,
    prior: Gaussian<N>,
    hypotheses: usize,
    reduction: Reduction,
    gate: Option<f64>,
}

impl<T, A, H, const N: usize, const W: usize, const M: usize> RaoBlackwell<T, A, H, N, W, M>
where
    T: Transform,
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    /// The filter of these models, started from `prior` in every mode, which keeps at most so many `hypotheses` and
    /// reduces them by [`Reduction::Optimal`].
    ///
    /// # Errors
    /// Models or parameters that the `transform` does not hold for; no hypothesis, or so many that with all modes they
    /// exceed 2^26.
    pub fn new(
        transform: T,
        model: JumpMarkov<A>,
        measurement: H,
        prior: Gaussian<N>,
        hypotheses: usize,
    ) -> Result<Self> {
        for mode in model.modes() {
            transform.accept(mode, &measurement, &prior)?;
        }
        check_hypotheses(hypotheses)?;
        let reduction = Reduction::default();
        Ok(RaoBlackwell { transform, model, measurement, prior, hypotheses, reduction, gate: None })
    }

    /// The same with another reduction.
    #[must_use]
    pub fn with_reduction(self, reduction: Reduction) -> Self {
        RaoBlackwell { reduction, ..self }
    }

    /// Leaves out measurements whose squared Mahalanobis distance from what the combined law foretells exceeds the
    /// chi-square quantile at `probability`.
    ///
    /// # Errors
    /// `probability` outside (0, 1).
    pub fn with_gate(self, probability: f64) -> Result<Self> {
        Ok(RaoBlackwell { gate: Some(gate_distance::<M>(probability)?), ..self })
    }

    /// The modes and their chain.
    pub fn model(&self) -> &JumpMarkov<A> {
        &self.model
    }

    /// The measurement model.
    pub fn measurement(&self) -> &H {
        &self.measurement
    }
}

impl<T, A, H, const N: usize, const W: usize, const M: usize> Filter for RaoBlackwell<T, A, H, N, W, M>
where
    T: Transform,
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    type Measurement = H::Value;
    type Belief = Hypotheses<N>;

    fn start(&self, at: Time, stream: Stream) -> Result<Hypotheses<N>> {
        let initial = self.model.chain().initial();
        let all = initial.iter().enumerate().filter(|&(_, &weight)| weight > 0.0);
        let all = all.map(|(mode, &weight)| Hypothesis { mode, weight, law: self.prior }).collect();
        Hypotheses::new(at, stream, initial.len(), all)
    }

    fn step(&self, belief: &mut Hypotheses<N>, to: Time, z: Option<&H::Value>) -> Result<Update> {
        let settings = (self.hypotheses, self.reduction, self.gate);
        step_with(&self.transform, &self.model, &self.measurement, settings, belief, to, z)
    }
}

/// Refuses a number of hypotheses that no belief holds, with each of them taken through every mode.
pub(crate) fn check_hypotheses(hypotheses: usize) -> Result<()> {
    if (1..=MAX_PARTICLES / MAX_MODES).contains(&hypotheses) {
        return Ok(());
    }
    let needs = "it must lie between 1 and 2^22";
    Err(Error::OutOfRange { what: "number of hypotheses", value: hypotheses as f64, needs })
}

/// [`RaoBlackwell`]'s step for a measurement model that may differ from step to step. Settings are how many
/// hypotheses to keep, their reduction, and the squared distance of the gate.
pub(crate) fn step_with<T, A, H, const N: usize, const W: usize, const M: usize>(
    transform: &T,
    model: &JumpMarkov<A>,
    measurement: &H,
    (hypotheses, reduction, gate): (usize, Reduction, Option<f64>),
    belief: &mut Hypotheses<N>,
    to: Time,
    z: Option<&H::Value>,
) -> Result<Update>
where
    T: Transform,
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    let (from, modes) = (belief.time, belief.modes);
    if to < from {
        return Err(Error::OutOfOrder { from, to });
    }
    if modes != model.modes().len() {
        let expected = model.modes().len();
        return Err(Error::Shape { what: "modes of the belief", found: modes, expected });
    }
    let Hypotheses { all, spare, weights, kept, stream, step, .. } = &mut *belief;

    weights.clear();
    kept.clear();
    // As many as there can ever be: no later step allocates.
    let most = all.len().max(hypotheses * modes);
    weights.reserve(most);
    kept.reserve(most);
    weights.extend(all.iter().map(|h| h.weight));
    // Numbers of the step that is about to be, so that a step that fails leaves them to the next.
    reduction.reduce(weights, hypotheses, *stream, *step + 1, kept)?;

    let transition = model.chain().over(from, to);
    let mut steps: [Option<Ahead<A, N, W>>; MAX_MODES] = from_fn(|_| None);
    if to > from {
        for (step, motion) in steps.iter_mut().zip(model.modes()) {
            *step = Some(Ahead::of::<T>(motion, from, to, &all[kept[0].0 as usize].law)?);
        }
    }
    spare.clear();
    spare.reserve(most);
    let mut first = 0;
    while first < kept.len() {
        // Equal laws that neighbour each other go on as one: only the mode told them apart.
        let law = &all[kept[first].0 as usize].law;
        let mut after = [0.0; MAX_MODES];
        let mut last = first;
        while last < kept.len() && all[kept[last].0 as usize].law == *law {
            let (h, weight) = kept[last];
            for j in 0..modes {
                after[j] += weight * transition.probability(all[h as usize].mode, j);
            }
            last += 1;
        }
        for mode in (0..modes).filter(|&j| after[j] > 0.0) {
            let law = match &steps[mode] {
                Some(step) => step.propagate(transform, &model.modes()[mode], law)?,
                None => *law,
            };
            spare.push(Hypothesis { mode, weight: after[mode], law });
        }
        first = last;
    }
    // Rows of a chain sum to 1 within 1e-9 only.
    let sum: f64 = spare.iter().map(|h| h.weight).sum();
    let sum = Error::positive("sum of the weights", sum)?;
    spare.iter_mut().for_each(|h| h.weight /= sum);

    let mut update = Update { outcome: Outcome::Predicted, log_evidence: 0.0, particles: None };
    if let Some(z) = z {
        let foretold = || matched(spare.iter().map(|h| (h.weight, &h.law)));
        let gated = gate.is_some()
            && update_law(transform, measurement, gate, &foretold()?, z, to)?.1.outcome == Outcome::Gated;
        weights.clear();
        for hypothesis in spare.iter_mut() {
            let (law, alone) = update_law(transform, measurement, None, &hypothesis.law, z, to)?;
            weights.push(Real::ln(hypothesis.weight) + alone.log_evidence);
            if !gated {
                hypothesis.law = law;
            }
        }
        update = weighed(weights, gated);
        if update.outcome == Outcome::Updated {
            spare.iter_mut().zip(weights.iter()).for_each(|(h, &weight)| h.weight = weight);
        }
    }
    *step += 1;
    std::mem::swap(all, spare);
    belief.time = to;
    Ok(update)
}

/// A mode over one step.
struct Ahead<A: Motion<N, W>, const N: usize, const W: usize> {
    step: A::Step,
    /// df/dx and the covariance that the noise adds, where both serve every state.
    linear: Option<(Matrix<N, N>, Matrix<N, N>)>,
}

impl<A: Motion<N, W>, const N: usize, const W: usize> Ahead<A, N, W> {
    /// Looks at the Jacobians at two points near `law`; what differs there is not linear.
    fn of<T: Transform>(motion: &A, from: Time, to: Time, law: &Gaussian<N>) -> Result<Self> {
        let step = motion.over(from, to)?;
        let tangent = || MotionTangent::<N, W>::of_linear::<A>(&step, motion.noise(), law);
        let linear = if T::BY_JACOBIANS { tangent() } else { None };
        let linear =
            linear.map(|tangent| (tangent.by_state, tangent.noise_covariance(motion.noise().variance())));
        Ok(Ahead { step, linear })
    }

    /// [`Transform::propagate`], with what a linear motion has to compute only once.
    fn propagate<T: Transform>(&self, transform: &T, motion: &A, law: &Gaussian<N>) -> Result<Gaussian<N>> {
        let Some((by_state, added)) = &self.linear else {
            return transform.propagate(motion, &self.step, law);
        };
        let mean = A::apply(&self.step, *law.mean(), [motion.noise().mean(); W]);
        let covariance = by_state.congruence(law.covariance()) + *added;
        Gaussian::computed("predicted mean", "predicted covariance", mean, covariance)
    }
}
