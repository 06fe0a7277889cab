//! The Rao-Blackwellised filter: what is hidden by enumeration, or draws, and reduction; the state given it
//! by a Gaussian.

use super::gaussian::{gate_distance, predict_law, update_law};
use super::imm::weighed;
use super::{Filter, MotionTangent, Outcome, ParticleUpdate, Transform, Update};
use crate::belief::{Gaussian, Hypotheses, Hypothesis, MAX_PARTICLES, matched};
use crate::error::{Error, Result};
use crate::math::{Matrix, Real};
use crate::model::jump::MAX_MODES;
use crate::model::{GaussianMeasurement, JumpMarkov, Label, Latent, Motion, sampled};
use crate::resample::Reduction;
use crate::rng::{Draws, Purpose, Stream};
use crate::time::Time;
use std::array::from_fn;
use std::borrow::Borrow;

/// The Rao-Blackwellised filter of a model that is linear and normal, or nearly so, given a [`Latent`] label:
/// the mode of a [`JumpMarkov`] model (Doucet, Gordon and Krishnamurthy, IEEE Transactions on Signal
/// Processing 49(3), 2001), the scale of heavy-tailed noise ([`NoiseScale`](crate::model::NoiseScale)), the
/// nonlinear part of a mixed model (Schön, Gustafsson and Nordlund, same journal 53(7), 2005). It keeps
/// hypotheses about the history of labels, each with a Kalman filter of one kind or another.
///
/// A step takes every hypothesis through every label that may follow, or several draws of it, multiplies its
/// weight by their probability and the evidence of the measurement (so that labels are proposed by their own
/// posterior), and shows all of them. The next one first reduces them to the number that the filter keeps
/// ([`Reduction`]), without bias: exp of the summed log-evidence has the expectation that no reduction would
/// give. While the number is not exceeded nothing is reduced, and with labels that are enumerated the results
/// on linear models are exact. Neighbours of equal labels and laws, as modes have at the start, go on as one.
///
/// [`Reduction::Optimal`] serves labels that are drawn as well as modes: it asks that no hypothesis stand
/// twice among those it chooses from, and draws of a continuous label never do.
///
/// A pair of hypothesis and label whose update is [`Outcome::Degenerate`] has evidence zero; where this
/// befalls all, so is the outcome of the step. The gate is applied once, to the innovation of the combined
/// law. Labels that are drawn report [`ParticleUpdate`], where a hypothesis with one of its draws counts as a
/// particle.
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
pub struct RaoBlackwell<T, L, H, const N: usize, const W: usize, const M: usize> {
    transform: T,
    model: L,
    measurement: H,
    prior: Gaussian<N>,
    hypotheses: usize,
    reduction: Reduction,
    gate: Option<f64>,
}

impl<T, L, H, const N: usize, const W: usize, const M: usize> RaoBlackwell<T, L, H, N, W, M>
where
    T: Transform,
    L: Latent<N, W, M, H>,
    H: GaussianMeasurement<N, M>,
{
    /// The filter of these models, started from `prior` under every label, which keeps at most so many
    /// `hypotheses` and reduces them by [`Reduction::Optimal`].
    ///
    /// # Errors
    /// Models or parameters that the `transform` or the labels do not hold for; no hypothesis, or so many
    /// that with all branches they exceed 2^26; a number of branches that [`Latent::branches`] excludes.
    pub fn new(
        transform: T,
        model: L,
        measurement: H,
        prior: Gaussian<N>,
        hypotheses: usize,
    ) -> Result<Self> {
        model.accept(&measurement)?;
        if model.modes() == 0 {
            sampled(model.branches())?;
        }
        let mut refusal = Ok(());
        let accept = |label: &L::Label| {
            let (motion, sensor) = (model.motion(label)?, model.sensor(&measurement, label)?);
            transform.accept(motion.borrow(), sensor.borrow(), &prior)
        };
        let mut draws = Stream::new(0).draws(Purpose::Mode, 0, 0);
        model.first(&measurement, 1, &mut draws, &mut |label, _| {
            if refusal.is_ok() {
                refusal = accept(&label);
            }
        });
        refusal?;
        check_hypotheses(hypotheses)?;
        let reduction = Reduction::default();
        Ok(RaoBlackwell { transform, model, measurement, prior, hypotheses, reduction, gate: None })
    }

    /// The same with another reduction.
    #[must_use]
    pub fn with_reduction(self, reduction: Reduction) -> Self {
        RaoBlackwell { reduction, ..self }
    }

    /// What is hidden: the modes and their chain, or another label.
    pub fn model(&self) -> &L {
        &self.model
    }

    /// The measurement model.
    pub fn measurement(&self) -> &H {
        &self.measurement
    }
}

impl<T, A, H, const N: usize, const W: usize, const M: usize> RaoBlackwell<T, JumpMarkov<A>, H, N, W, M>
where
    T: Transform,
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    /// Leaves out measurements whose squared Mahalanobis distance from what the combined law foretells
    /// exceeds the chi-square quantile at `probability`. Labels that change the sensor have no one law of
    /// what it foretells.
    ///
    /// # Errors
    /// `probability` outside (0, 1).
    pub fn with_gate(self, probability: f64) -> Result<Self> {
        Ok(RaoBlackwell { gate: Some(gate_distance::<M>(probability)?), ..self })
    }
}

impl<T, L, H, const N: usize, const W: usize, const M: usize> Filter for RaoBlackwell<T, L, H, N, W, M>
where
    T: Transform,
    L: Latent<N, W, M, H>,
    H: GaussianMeasurement<N, M>,
{
    type Measurement = H::Value;
    type Belief = Hypotheses<N, L::Label>;

    fn start(&self, at: Time, stream: Stream) -> Result<Hypotheses<N, L::Label>> {
        let mut all = Vec::new();
        let mut draws = stream.draws(Purpose::Mode, 0, 0);
        self.model.first(&self.measurement, self.hypotheses, &mut draws, &mut |label, weight| {
            all.push(Hypothesis { label, weight, law: self.prior });
        });
        all.retain(|hypothesis| hypothesis.weight != 0.0);
        Hypotheses::new(at, stream, self.model.modes(), all)
    }

    fn step(&self, belief: &mut Hypotheses<N, L::Label>, to: Time, z: Option<&H::Value>) -> Result<Update> {
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
pub(crate) fn step_with<T, L, H, const N: usize, const W: usize, const M: usize>(
    transform: &T,
    model: &L,
    measurement: &H,
    settings: (usize, Reduction, Option<f64>),
    belief: &mut Hypotheses<N, L::Label>,
    to: Time,
    z: Option<&H::Value>,
) -> Result<Update>
where
    T: Transform,
    L: Latent<N, W, M, H>,
    H: GaussianMeasurement<N, M>,
{
    let from = belief.time;
    if to < from {
        return Err(Error::OutOfOrder { from, to });
    }
    let numbers = Numbers { modes: model.modes(), branches: model.branches() };
    let predict = |near: &Gaussian<N>, all: &mut [Hypothesis<N, L::Label>]| {
        predict(transform, model, near, (from, to), all)
    };
    let mut step = |z: Option<&H::Value>| {
        let over = model.over(measurement, from, to, z)?;
        let branch = |parent: &_, draws: &mut _, out: &mut dyn FnMut(L::Label, f64)| {
            model.branch(&over, parent, draws, out);
        };
        let update =
            |z: &H::Value, gate: Option<f64>, given: Option<&L::Label>, law: &Gaussian<N>| match given {
                Some(label) => {
                    update_law(transform, model.sensor(measurement, label)?.borrow(), gate, law, z, to)
                }
                None => update_law(transform, measurement, gate, law, z, to),
            };
        let update =
            z.map(|z| move |gate: Option<f64>, given: Option<&_>, law: &_| update(z, gate, given, law));
        let update = update.as_ref().map(|update| update as &UpdateLaw<'_, N, L::Label>);
        step_hypotheses(numbers, settings, belief, to, (&branch, &predict, update))
    };
    let update = step(z)?;
    if update.outcome != Outcome::Degenerate {
        return Ok(update);
    }
    // Labels may have been drawn for a measurement that is not used.
    let predicted = step(None)?;
    let evaluations = update.particles.map_or(0, |p| p.evaluations);
    let particles = predicted.particles.map(|p| ParticleUpdate { evaluations, ..p });
    Ok(Update { particles, ..update })
}

/// What a latent label has so many of: see [`Latent`].
#[derive(Clone, Copy)]
struct Numbers {
    modes: usize,
    branches: usize,
}

/// Names the labels that may follow that of a hypothesis, with weights.
type Branch<'a, const N: usize, L> = dyn Fn(&Hypothesis<N, L>, &mut Draws, &mut dyn FnMut(L, f64)) + 'a;

/// Moves the laws of all hypotheses; Jacobians that serve all are taken near a law.
type Predict<'a, const N: usize, L> = dyn Fn(&Gaussian<N>, &mut [Hypothesis<N, L>]) -> Result<()> + 'a;

/// Updates a law under a gate by what is seen given a label, or without one.
type UpdateLaw<'a, const N: usize, L> =
    dyn Fn(Option<f64>, Option<&L>, &Gaussian<N>) -> Result<(Gaussian<N>, Update)> + 'a;

/// The step, whatever the models are: it is compiled once for each size of the state and each kind of label. After a
/// degenerate measurement the belief is as it was.
fn step_hypotheses<L: Label, const N: usize>(
    numbers: Numbers,
    (hypotheses, reduction, gate): (usize, Reduction, Option<f64>),
    belief: &mut Hypotheses<N, L>,
    to: Time,
    (branch, predict, update): (&Branch<'_, N, L>, &Predict<'_, N, L>, Option<&UpdateLaw<'_, N, L>>),
) -> Result<Update> {
    let (from, modes) = (belief.time, belief.modes);
    if modes != numbers.modes {
        let expected = numbers.modes;
        return Err(Error::Shape { what: "modes of the belief", found: modes, expected });
    }
    let Hypotheses { all, spare, weights, kept, stream, step, .. } = &mut *belief;

    weights.clear();
    kept.clear();
    // As many as there can ever be: no later step allocates.
    let most = all.len().max(hypotheses * numbers.branches);
    weights.reserve(most);
    kept.reserve(most);
    weights.extend(all.iter().map(|h| h.weight));
    // Numbers of the step that is about to be, so that a step that fails leaves them to the next.
    reduction.reduce(weights, hypotheses, *stream, *step + 1, kept)?;
    let resampled = weights.iter().filter(|&&weight| weight > 0.0).count() > hypotheses;

    spare.clear();
    spare.reserve(most);
    let (mut first, mut before) = (0, None);
    for &(h, weight) in &*kept {
        let parent = &all[h as usize];
        // Equal laws that neighbour each other go on as one where their labels are the same: only the label
        // before told them apart.
        if before != Some(parent.law) {
            (first, before) = (spare.len(), Some(parent.law));
        }
        let mut k = first;
        let mut refusal = Ok(());
        let mut draws = stream.draws(Purpose::Mode, *step + 1, h);
        branch(parent, &mut draws, &mut |label, p| {
            match Error::not_negative("weight of a label", p) {
                Err(error) => refusal = Err(error),
                Ok(p) => match spare.get_mut(k) {
                    Some(same) if same.label == label => same.weight += weight * p,
                    _ => spare.push(Hypothesis { label, weight: weight * p, law: parent.law }),
                },
            }
            k += 1;
        });
        refusal?;
    }
    spare.retain(|h| h.weight > 0.0);
    // Rows of a chain sum to 1 within 1e-9 only. Weights of draws from another law do so in expectation, and
    // are evidence.
    let sum: f64 = spare.iter().map(|h| h.weight).sum();
    let sum = Error::positive("sum of the weights", sum)?;
    spare.iter_mut().for_each(|h| h.weight /= sum);
    if to > from {
        predict(&all[kept[0].0 as usize].law, spare)?;
    }

    let mut came_to = Update { outcome: Outcome::Predicted, log_evidence: 0.0, particles: None };
    if let Some(update) = update {
        let foretold = || matched(spare.len(), &|i| (spare[i].weight, &spare[i].law));
        let gated = gate.is_some() && update(gate, None, &foretold()?)?.1.outcome == Outcome::Gated;
        weights.clear();
        for hypothesis in spare.iter_mut() {
            let (law, alone) = update(None, Some(&hypothesis.label), &hypothesis.law)?;
            weights.push(Real::ln(hypothesis.weight) + alone.log_evidence);
            if !gated {
                hypothesis.law = law;
            }
        }
        came_to = weighed(weights, gated);
        match came_to.outcome {
            Outcome::Updated => {
                spare.iter_mut().zip(weights.iter()).for_each(|(h, &weight)| h.weight = weight);
                if modes == 0 {
                    came_to.log_evidence += Real::ln(sum);
                }
            }
            Outcome::Degenerate => {
                let evaluations = spare.len();
                let particles = ParticleUpdate { evaluations, ..ParticleUpdate::default() };
                return Ok(Update { particles: Some(particles), ..came_to });
            }
            _ => {}
        }
    }
    if modes == 0 {
        let ess = 1.0 / spare.iter().map(|h| h.weight * h.weight).sum::<f64>();
        let evaluations = if update.is_some() { spare.len() } else { 0 };
        came_to.particles = Some(ParticleUpdate {
            ess,
            resampled,
            distinct_ancestors: kept.len(),
            not_finite: 0,
            particles: spare.len(),
            evaluations,
        });
    }
    *step += 1;
    std::mem::swap(all, spare);
    belief.time = to;
    Ok(came_to)
}

/// Moves every law by the motion of its label. Jacobians that serve all are taken near the law `near`.
fn predict<T, L, H, const N: usize, const W: usize, const M: usize>(
    transform: &T,
    model: &L,
    near: &Gaussian<N>,
    (from, to): (Time, Time),
    all: &mut [Hypothesis<N, L::Label>],
) -> Result<()>
where
    T: Transform,
    L: Latent<N, W, M, H>,
    H: GaussianMeasurement<N, M>,
{
    let mut steps: [Option<Ahead<L::Motion, N, W>>; MAX_MODES] = from_fn(|_| None);
    // Neighbours of one law and one motion move alike.
    let mut last: Option<(usize, Gaussian<N>, Gaussian<N>)> = None;
    for hypothesis in all {
        let law = hypothesis.law;
        let shared = model.shared_motion(&hypothesis.label).filter(|&number| number < MAX_MODES);
        hypothesis.law = match (shared, last) {
            (Some(number), Some((same, before, after))) if (number, law) == (same, before) => after,
            (Some(number), _) => {
                let motion = model.motion(&hypothesis.label)?;
                let step = match &mut steps[number] {
                    Some(step) => step,
                    none => none.insert(Ahead::of::<T>(motion.borrow(), from, to, near)?),
                };
                let after = step.propagate(transform, motion.borrow(), &law)?;
                last = Some((number, law, after));
                after
            }
            (None, _) => predict_law::<_, L::Motion, N, W>(
                transform,
                model.motion(&hypothesis.label)?.borrow(),
                &law,
                from,
                to,
            )?,
        };
    }
    Ok(())
}

/// A motion over one step.
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
