//! The interacting multiple-model filter: one Gaussian per mode, mixed before each step.

use super::gaussian::{gate_distance, predict_law, update_law};
use super::{Filter, Linear, Outcome, SigmaPoints, Tangent, Transform, Update};
use crate::belief::{Gaussian, ModalGaussian, matched};
use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::jump::MAX_MODES;
use crate::model::{Chain, GaussianMeasurement, JumpMarkov, Motion};
use crate::rng::Stream;
use crate::time::Time;

/// The interacting multiple-model filter (Blom and Bar-Shalom, IEEE Transactions on Automatic Control 33(8), 1988) with
/// Kalman filters of one kind in its modes: [`ImmKalman`], [`ImmExtended`], [`ImmUnscented`].
///
/// With probabilities mu_i of the modes before the step and transition probabilities p_ij, mode j has probability
/// c_j = sum over i of p_ij mu_i, and the laws of the modes that may have led to it are mixed into one Gaussian of the
/// same mean and covariance: weights p_ij mu_i / c_j, spread of the means included. Each mode is predicted and updated
/// from there; the evidence L_j of the measurement makes its probability proportional to c_j L_j. That mixture is the
/// one approximation of its own: with one mode the results are those of the filter in it, and so they are where the
/// mode is known and never changes.
///
/// Log-evidence is ln sum c_j L_j. A mode whose update is [`Outcome::Degenerate`] has evidence zero, keeps its
/// predicted law, and is no error; where this befalls all modes, so is the outcome of the step. A mode that cannot be
/// (c_j = 0) keeps its own law, predicted only, with probability 0. The gate is applied once, to the innovation of the
/// combined law. A step over no time changes no mode and mixes nothing.
///
/// ```
/// use zerre::belief::Gaussian;
/// use zerre::filter::{Filter, Imm, Tangent};
/// use zerre::model::{Chain, JumpMarkov, measurement::RangeBearing, motion::CoordinatedTurn};
/// use zerre::rng::Stream;
/// use zerre::Time;
///
/// // Straight, left and right at 4.5 degrees per second.
/// let turn = |rate: f64| CoordinatedTurn::new(rate, 0.1);
/// let modes = vec![turn(0.0)?, turn(0.0785)?, turn(-0.0785)?];
/// let model = JumpMarkov::new(modes, Chain::staying(3, 0.95)?)?;
/// let prior = Gaussian::independent([900.0, 500.0, 0.0, 0.0], [100.0, 100.0, 10.0, 10.0])?;
/// let filter = Imm::new(Tangent, model, RangeBearing::new([0.0, 0.0], 5.0, 0.01)?, prior)?;
///
/// let mut belief = filter.start(Time::ZERO, Stream::new(1))?;
/// for (t, range, bearing) in [(0.0, 1000.0, 0.45), (1.0, 1004.0, 0.44), (2.0, 1008.0, 0.43)] {
///     filter.step(&mut belief, Time::from_secs(t), Some(&[range, bearing]))?;
/// }
/// assert!((belief.probabilities().iter().sum::<f64>() - 1.0).abs() < 1e-12);
/// assert!(belief.combined()?.position::<2>()?.ellipse(0.95)?.semi_major < 30.0);
/// # Ok::<(), zerre::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Imm<T, A, H, const N: usize, const W: usize, const M: usize> {
    transform: T,
    model: JumpMarkov<A>,
    measurement: H,
    prior: Gaussian<N>,
    gate: Option<f64>,
}

/// [`Imm`] for linear models: what else there is, it refuses.
pub type ImmKalman<A, H, const N: usize, const W: usize, const M: usize> = Imm<Linear, A, H, N, W, M>;

/// [`Imm`] with extended Kalman filters.
pub type ImmExtended<A, H, const N: usize, const W: usize, const M: usize> = Imm<Tangent, A, H, N, W, M>;

/// [`Imm`] with unscented Kalman filters.
pub type ImmUnscented<A, H, const N: usize, const W: usize, const M: usize> = Imm<SigmaPoints, A, H, N, W, M>;

impl<T, A, H, const N: usize, const W: usize, const M: usize> Imm<T, A, H, N, W, M>
where
    T: Transform,
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    /// The filter of these models; every mode starts from `prior`, with its probability at the start of the chain.
    ///
    /// # Errors
    /// Models or parameters that the `transform` does not hold for.
    pub fn new(transform: T, model: JumpMarkov<A>, measurement: H, prior: Gaussian<N>) -> Result<Self> {
        for mode in model.modes() {
            transform.accept(mode, &measurement, &prior)?;
        }
        Ok(Imm { transform, model, measurement, prior, gate: None })
    }

    /// Leaves out measurements whose squared Mahalanobis distance from what the combined law foretells exceeds the
    /// chi-square quantile at `probability`.
    ///
    /// # Errors
    /// `probability` outside (0, 1).
    pub fn with_gate(self, probability: f64) -> Result<Self> {
        Ok(Imm { gate: Some(gate_distance::<M>(probability)?), ..self })
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

impl<T, A, H, const N: usize, const W: usize, const M: usize> Filter for Imm<T, A, H, N, W, M>
where
    T: Transform,
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    type Measurement = H::Value;
    type Belief = ModalGaussian<N>;

    /// The prior in every mode; no random numbers are drawn.
    fn start(&self, at: Time, _: Stream) -> Result<ModalGaussian<N>> {
        let initial = self.model.chain().initial().to_vec();
        let laws = vec![self.prior; initial.len()];
        ModalGaussian::new(at, initial, laws)
    }

    fn step(&self, belief: &mut ModalGaussian<N>, to: Time, z: Option<&H::Value>) -> Result<Update> {
        step_with(&self.transform, &self.model, &self.measurement, self.gate, belief, to, z)
    }
}

/// [`Imm`]'s step for a measurement model that may differ from step to step; `gate` is a squared distance.
pub(crate) fn step_with<T, A, H, const N: usize, const W: usize, const M: usize>(
    transform: &T,
    model: &JumpMarkov<A>,
    measurement: &H,
    gate: Option<f64>,
    belief: &mut ModalGaussian<N>,
    to: Time,
    z: Option<&H::Value>,
) -> Result<Update>
where
    T: Transform,
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    let from = belief.time;
    let predict =
        |mode: usize, law: &Gaussian<N>| predict_law(transform, &model.modes()[mode], law, from, to);
    let update = |z: &H::Value, gate: Option<f64>, law: &Gaussian<N>| {
        update_law(transform, measurement, gate, law, z, to)
    };
    let update = z.map(|z| move |gate: Option<f64>, law: &Gaussian<N>| update(z, gate, law));
    let update = update.as_ref().map(|update| update as &UpdateLaw<'_, N>);
    step_modes(model.chain(), belief, (from, to), gate, &predict, update)
}

/// Updates a law under a gate.
type UpdateLaw<'a, const N: usize> = dyn Fn(Option<f64>, &Gaussian<N>) -> Result<(Gaussian<N>, Update)> + 'a;

/// The step, whatever the models are: it is compiled once for each size of the state.
fn step_modes<const N: usize>(
    chain: &Chain,
    belief: &mut ModalGaussian<N>,
    (from, to): (Time, Time),
    gate: Option<f64>,
    predict: &dyn Fn(usize, &Gaussian<N>) -> Result<Gaussian<N>>,
    update: Option<&UpdateLaw<'_, N>>,
) -> Result<Update> {
    let modes = belief.len();
    if to < from {
        return Err(Error::OutOfOrder { from, to });
    }
    if modes != chain.initial().len() {
        let expected = chain.initial().len();
        return Err(Error::Shape { what: "modes of the belief", found: modes, expected });
    }
    let transition = chain.over(from, to);
    let mut probabilities = transition.predict(&belief.probabilities);
    let probabilities = &mut probabilities[..modes];
    if to > from {
        // Rows of a chain sum to 1 within 1e-9 only.
        let sum: f64 = probabilities.iter().sum();
        probabilities.iter_mut().for_each(|p| *p /= sum);
    }
    for (j, &probability) in probabilities.iter().enumerate() {
        let mixed = if to > from && probability > 0.0 {
            matched(modes, &|i| (transition.probability(i, j) * belief.probabilities[i], &belief.laws[i]))?
        } else {
            belief.laws[j]
        };
        belief.spare[j] = predict(j, &mixed)?;
    }

    let mut came_to = Update { outcome: Outcome::Predicted, log_evidence: 0.0, particles: None };
    if let Some(update) = update {
        let foretold = || matched(modes, &|j| (probabilities[j], &belief.spare[j]));
        let gated = gate.is_some() && update(gate, &foretold()?)?.1.outcome == Outcome::Gated;
        let mut scores = [f64::NEG_INFINITY; MAX_MODES];
        for j in 0..modes {
            if probabilities[j] > 0.0 {
                let (law, alone) = update(None, &belief.spare[j])?;
                scores[j] = Real::ln(probabilities[j]) + alone.log_evidence;
                if !gated {
                    belief.spare[j] = law;
                }
            }
        }
        came_to = weighed(&mut scores[..modes], gated);
        if came_to.outcome == Outcome::Updated {
            probabilities.copy_from_slice(&scores[..modes]);
        }
    }
    belief.probabilities.copy_from_slice(probabilities);
    std::mem::swap(&mut belief.laws, &mut belief.spare);
    belief.time = to;
    Ok(came_to)
}

/// What a step with a measurement came to, from the log-weights of its hypotheses, ln c_j L_j, which become normalised
/// weights unless none is finite. None is NaN or infinitely large.
pub(super) fn weighed(scores: &mut [f64], gated: bool) -> Update {
    let best = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if best == f64::NEG_INFINITY {
        let outcome = if gated { Outcome::Gated } else { Outcome::Degenerate };
        return Update { outcome, log_evidence: best, particles: None };
    }
    let mut sum = 0.0;
    for score in scores.iter_mut() {
        *score = Real::exp(*score - best);
        sum += *score;
    }
    scores.iter_mut().for_each(|weight| *weight /= sum);
    let outcome = if gated { Outcome::Gated } else { Outcome::Updated };
    Update { outcome, log_evidence: best + Real::ln(sum), particles: None }
}
