//! What the Kalman family shares: prediction, gate, gain, Joseph form, evidence. Its members differ in how a
//! Gaussian goes through a function.

use super::{Filter, Outcome, Update};
use crate::belief::{Gaussian, GaussianBelief};
use crate::error::{Error, Result};
use crate::math::gaussian::log_density;
use crate::math::{Cholesky, Matrix, chi_square, wrap};
use crate::model::{GaussianMeasurement, Motion};
use crate::rng::Stream;
use crate::time::Time;
use std::array::from_fn;

/// How a Gaussian goes through a function: exactly ([`Linear`](super::Linear)), by the tangent
/// ([`Tangent`](super::Tangent)) or by sigma points ([`SigmaPoints`](super::SigmaPoints)).
pub trait Transform: Send + Sync {
    /// Whether a linear motion acts by its Jacobians alone, so that those of one state serve all.
    const BY_JACOBIANS: bool;

    /// The law of f(x, w).
    ///
    /// # Errors
    /// A result that is not finite; a model that the transform does not hold for.
    fn propagate<A: Motion<N, W>, const N: usize, const W: usize>(
        &self,
        motion: &A,
        step: &A::Step,
        state: &Gaussian<N>,
    ) -> Result<Gaussian<N>>;

    /// The joint law of x and f(x, w): what smoothing needs besides [`Transform::propagate`].
    ///
    /// # Errors
    /// Those of [`Transform::propagate`].
    fn propagate_joint<A: Motion<N, W>, const N: usize, const W: usize>(
        &self,
        motion: &A,
        step: &A::Step,
        state: &Gaussian<N>,
    ) -> Result<Joint<N>>;

    /// The moments of h(x) at `at`, without the noise of the measurement.
    ///
    /// # Errors
    /// A model that the transform does not hold for. Numbers that are not finite pass: they make the update
    /// degenerate.
    fn observe<H: GaussianMeasurement<N, M>, const N: usize, const M: usize>(
        &self,
        measurement: &H,
        at: Time,
        state: &Gaussian<N>,
    ) -> Result<Observed<N, M>>;

    /// Refuses what the transform does not hold for before a filter is made of it.
    ///
    /// # Errors
    /// Such models, or parameters of the transform itself.
    fn accept<A, H, const N: usize, const W: usize, const M: usize>(
        &self,
        _motion: &A,
        _measurement: &H,
        _prior: &Gaussian<N>,
    ) -> Result<()>
    where
        A: Motion<N, W>,
        H: GaussianMeasurement<N, M>,
    {
        Ok(())
    }
}

/// Moments of h(x) and what the Joseph form is summed from.
#[derive(Clone, Copy, Debug)]
pub struct Observed<const N: usize, const M: usize> {
    /// E[h(x)].
    pub(crate) mean: [f64; M],
    /// Cov[h(x)].
    pub(crate) covariance: Matrix<M, M>,
    /// Cov[x, h(x)].
    pub(crate) cross: Matrix<N, M>,
    /// Deviations of x and h(x) together.
    pub(crate) deviations: Deviations<N, M>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Deviations<const N: usize, const M: usize> {
    /// h(x) deviates by the Jacobian times the deviation of x.
    Linear(Matrix<M, N>),
    /// Pairs of points: x deviates by plus and minus `state[j]`, h(x) by `measured[j]`; all weigh the same.
    Points { weight: f64, state: [[f64; N]; N], measured: [[[f64; M]; 2]; N] },
}

impl<const N: usize, const M: usize> Observed<N, M> {
    /// Cov[x - K h(x) - K v], v ~ N(0, R): the posterior covariance as a sum of squares (Joseph form; Bucy and
    /// Joseph 1968), which rounding cannot make indefinite, for any gain.
    fn joseph(&self, prior: &Matrix<N, N>, gain: &Matrix<N, M>, noise: &Matrix<M, M>) -> Matrix<N, N> {
        let kept = match &self.deviations {
            Deviations::Linear(jacobian) => (Matrix::identity() - *gain * *jacobian).congruence(prior),
            Deviations::Points { weight, state, measured } => {
                let mut sum = Matrix::ZERO;
                for (dx, pair) in state.iter().zip(measured) {
                    for (sign, dz) in [1.0, -1.0].into_iter().zip(pair) {
                        let correction = *gain * *dz;
                        let rest: [f64; N] = from_fn(|i| sign * dx[i] - correction[i]);
                        sum = sum + Matrix::outer(&rest, &rest) * *weight;
                    }
                }
                sum
            }
        };
        (kept + gain.congruence(noise)).symmetrised()
    }
}

/// The joint law of a state x before a step and y = f(x, w) after it.
#[derive(Clone, Copy, Debug)]
pub struct Joint<const N: usize> {
    /// The law of y, as [`Transform::propagate`] gives it.
    pub(crate) law: Gaussian<N>,
    /// What of y comes from x.
    pub(crate) by_state: Observed<N, N>,
    /// What w adds to the covariance of y.
    pub(crate) added: Matrix<N, N>,
}

impl<const N: usize> Joint<N> {
    /// The law of y.
    pub fn law(&self) -> &Gaussian<N> {
        &self.law
    }

    /// Cov[x, y], `N` x `N`: rows are components of x.
    pub fn cross(&self) -> &Matrix<N, N> {
        &self.by_state.cross
    }

    /// The law of x once y is known to have the law `after`, `now` being the law of x before: the gain is G =
    /// Cov[x, y] Cov[y]^-1 (Särkkä, IEEE Transactions on Automatic Control 53(3), 2008), and the covariance
    /// Cov[x - G y] + G P_after G' is summed from squares, so that rounding does not make it indefinite.
    pub(crate) fn condition(&self, now: &Gaussian<N>, after: &Gaussian<N>) -> Result<Gaussian<N>> {
        let predicted = Cholesky::of("predicted covariance", self.law.covariance())?;
        let gain = predicted.solve_matrix(&self.cross().transpose()).transpose();
        let correction = gain * from_fn(|i| after.mean()[i] - self.law.mean()[i]);
        let mean = from_fn(|i| now.mean()[i] + correction[i]);
        let covariance = self.by_state.joseph(now.covariance(), &gain, &(self.added + *after.covariance()));
        Gaussian::computed("smoothed mean", "smoothed covariance", mean, covariance)
    }
}

/// A Kalman filter of one kind or another: [`Kalman`](super::Kalman), [`Extended`](super::Extended),
/// [`Unscented`](super::Unscented).
///
/// ```
/// use zerre::belief::Gaussian;
/// use zerre::filter::{Extended, Filter};
/// use zerre::model::{measurement::RangeBearing, motion::ConstantVelocity};
/// use zerre::rng::Stream;
/// use zerre::Time;
///
/// // x, y, vx, vy: known to 100 m and 10 m/s.
/// let prior = Gaussian::independent([900.0, 500.0, 0.0, 0.0], [100.0, 100.0, 10.0, 10.0])?;
/// let radar = RangeBearing::new([0.0, 0.0], 5.0, 0.01)?;
/// let filter = Extended::new(ConstantVelocity::<2>::new(0.1)?, radar, prior).with_gate(0.999)?;
///
/// let mut belief = filter.start(Time::ZERO, Stream::new(1))?;
/// for (t, range, bearing) in [(0.0, 1000.0, 0.45), (1.0, 1004.0, 0.44), (2.0, 1008.0, 0.43)] {
///     filter.step(&mut belief, Time::from_secs(t), Some(&[range, bearing]))?;
/// }
/// let ellipse = belief.state.position::<2>()?.ellipse(0.95)?;
/// assert!(ellipse.semi_major < 30.0);
/// # Ok::<(), zerre::Error>(())
/// ```
///
/// Log-evidence is ln N(nu; 0, S), nu the innovation with its angles wrapped and S its covariance. The outcome is
/// [`Outcome::Degenerate`] where S is not positive definite or the evidence or the posterior is not finite. A
/// measurement outside the gate reports its evidence all the same.
///
/// For noise with heavier tails, v ~ N(0, s R) with random s
/// ([`covariance_scale`](GaussianMeasurement::covariance_scale) is then not 1), x and s are taken as independent
/// given z (variational Bayes; Piché, Särkkä and Hartikainen, MLSP 2012): in turns, the factor on R
/// follows from the expected distance of z from h(x), the law of x from the factor, eight times over. Evidence is
/// p(z | x) p(x) / p(x | z) at the updated mean with the model's own likelihood and the normal laws of x: exact where
/// x is known. The gate is applied before, with the nominal R.
#[derive(Clone, Debug)]
pub struct GaussianFilter<T, A, H, const N: usize, const W: usize, const M: usize> {
    transform: T,
    motion: A,
    measurement: H,
    prior: Gaussian<N>,
    gate: Option<f64>,
}

/// Turns between the factor on R and the law of x; each leaves a fraction of the error that is small where the
/// factor matters, because there R is large beside the spread of h(x).
const ROBUST_ROUNDS: usize = 8;

impl<T, A, H, const N: usize, const W: usize, const M: usize> GaussianFilter<T, A, H, N, W, M>
where
    T: Transform,
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    pub(crate) fn of(transform: T, motion: A, measurement: H, prior: Gaussian<N>) -> Self {
        GaussianFilter { transform, motion, measurement, prior, gate: None }
    }

    /// Leaves out measurements whose squared Mahalanobis distance exceeds the chi-square quantile at `probability`,
    /// which a measurement of the model does with 1 - `probability` if its errors are normal.
    ///
    /// # Errors
    /// `probability` outside (0, 1).
    pub fn with_gate(mut self, probability: f64) -> Result<Self> {
        self.gate = Some(gate_distance::<M>(probability)?);
        Ok(self)
    }

    /// The motion model.
    pub fn motion(&self) -> &A {
        &self.motion
    }

    /// The measurement model.
    pub fn measurement(&self) -> &H {
        &self.measurement
    }

    /// The law at `to` of a state that has law `state` at `from`; with `to` equal to `from` it is `state`.
    ///
    /// # Errors
    /// A step back in time, a model that refuses its parameters, a prediction that is not finite.
    pub fn predict(&self, state: &Gaussian<N>, from: Time, to: Time) -> Result<Gaussian<N>> {
        predict_law(&self.transform, &self.motion, state, from, to)
    }

    /// The law of the state after `z`, measured at `at`, and what became of `z`. Where it was not used, the law is
    /// `state`.
    ///
    /// # Errors
    /// A measurement that is not finite, a model that refuses its parameters.
    pub fn update(&self, state: &Gaussian<N>, z: &H::Value, at: Time) -> Result<(Gaussian<N>, Update)> {
        update_law(&self.transform, &self.measurement, self.gate, state, z, at)
    }
}

/// The squared Mahalanobis distance that measurements of `M` components keep within with this probability.
pub(super) fn gate_distance<const M: usize>(probability: f64) -> Result<f64> {
    Error::positive("probability of the gate", probability)?;
    chi_square::quantile(probability, u32::try_from(M).unwrap_or(u32::MAX))
}

/// [`GaussianFilter::predict`] for a transform and a motion.
pub(crate) fn predict_law<T: Transform, A: Motion<N, W>, const N: usize, const W: usize>(
    transform: &T,
    motion: &A,
    state: &Gaussian<N>,
    from: Time,
    to: Time,
) -> Result<Gaussian<N>> {
    match to.cmp(&from) {
        std::cmp::Ordering::Less => Err(Error::OutOfOrder { from, to }),
        std::cmp::Ordering::Equal => Ok(*state),
        std::cmp::Ordering::Greater => transform.propagate(motion, &motion.over(from, to)?, state),
    }
}

/// [`GaussianFilter::update`] for a transform, a measurement model and the squared distance of the gate.
pub(crate) fn update_law<T: Transform, H: GaussianMeasurement<N, M>, const N: usize, const M: usize>(
    transform: &T,
    measurement: &H,
    gate: Option<f64>,
    state: &Gaussian<N>,
    z: &H::Value,
    at: Time,
) -> Result<(Gaussian<N>, Update)> {
    let given = measurement.given(z, at)?;
    let z = measurement.components(z);
    for component in z {
        Error::finite("measurement", component)?;
    }
    let nominal = Matrix(measurement.covariance());
    nominal.finite("covariance of the measurement")?;
    let observed = transform.observe(measurement, at, state)?;
    let innovation = innovation::<H, N, M>(&z, &observed.mean);

    let unused = |outcome, log_evidence| Ok((*state, Update { outcome, log_evidence, particles: None }));
    let degenerate = || unused(Outcome::Degenerate, f64::NEG_INFINITY);
    let assess = |noise: &Matrix<M, M>| {
        let factor = Cholesky::of("covariance of the innovation", &(observed.covariance + *noise)).ok()?;
        let log_evidence = log_density(&innovation, &factor);
        log_evidence.is_finite().then_some((factor, log_evidence))
    };

    let Some((mut factor, mut log_evidence)) = assess(&nominal) else { return degenerate() };
    if gate.is_some_and(|threshold| factor.mahalanobis_squared(&innovation) > threshold) {
        return unused(Outcome::Gated, log_evidence);
    }
    let (mut noise, mut scale) = (nominal, 1.0);
    for _ in 0..ROBUST_ROUNDS {
        // z - h(x) has mean s R S^-1 nu and covariance s R S^-1 Cov[h(x)] given z and the scale s.
        let weighted = factor.solve(&innovation);
        let spread: f64 = factor.solve_matrix(&observed.covariance).diagonal().iter().sum();
        let distance = scale * scale * nominal.quadratic(&weighted, &weighted) + scale * spread;
        let wanted = measurement.covariance_scale(distance);
        if wanted == scale {
            break;
        }
        scale = Error::positive("scale of the covariance", wanted)?;
        noise = nominal * scale;
        let Some(assessed) = assess(&noise) else { return degenerate() };
        (factor, log_evidence) = assessed;
    }

    let gain = factor.solve_matrix(&observed.cross.transpose()).transpose();
    let correction = gain * innovation;
    let mean = from_fn(|i| state.mean()[i] + correction[i]);
    let covariance = observed.joseph(state.covariance(), &gain, &noise);
    let Ok(posterior) = Gaussian::computed("updated mean", "updated covariance", mean, covariance) else {
        return degenerate();
    };
    if scale != 1.0 {
        let Ok(noise_factor) = Cholesky::of("covariance of the measurement", &noise) else {
            return degenerate();
        };
        let residual = self::innovation::<H, N, M>(&z, &measurement.predict(at, mean));
        // With h linear the residual is s R S^-1 nu, and its distance at most that of nu. A curved h may leave
        // more, which must not count as evidence.
        let excess = noise_factor.mahalanobis_squared(&residual) - factor.mahalanobis_squared(&innovation);
        let normal = log_density(&residual, &noise_factor) + 0.5 * excess.max(0.0);
        log_evidence += H::log_likelihood(&given, mean) - normal;
        if !log_evidence.is_finite() {
            return degenerate();
        }
    }
    Ok((posterior, Update { outcome: Outcome::Updated, log_evidence, particles: None }))
}

/// z - z_hat, angles wrapped.
pub(crate) fn innovation<H: GaussianMeasurement<N, M>, const N: usize, const M: usize>(
    z: &[f64; M],
    predicted: &[f64; M],
) -> [f64; M] {
    from_fn(|i| if H::ANGLE[i] { wrap(z[i] - predicted[i]) } else { z[i] - predicted[i] })
}

impl<T, A, H, const N: usize, const W: usize, const M: usize> Filter for GaussianFilter<T, A, H, N, W, M>
where
    T: Transform,
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    type Measurement = H::Value;
    type Belief = GaussianBelief<N>;

    /// The prior; no random numbers are drawn.
    fn start(&self, at: Time, _: Stream) -> Result<GaussianBelief<N>> {
        Ok(GaussianBelief { time: at, state: self.prior })
    }

    fn step(&self, belief: &mut GaussianBelief<N>, to: Time, z: Option<&H::Value>) -> Result<Update> {
        let predicted = self.predict(&belief.state, belief.time, to)?;
        let (state, update) = match z {
            None => (predicted, Update { outcome: Outcome::Predicted, log_evidence: 0.0, particles: None }),
            Some(z) => self.update(&predicted, z, to)?,
        };
        *belief = GaussianBelief { time: to, state };
        Ok(update)
    }
}

/// The law that a belief foretells for a measurement, as a Gaussian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PredictedMeasurement<const M: usize> {
    /// Its mean.
    pub mean: [f64; M],
    /// Its covariance, noise of the measurement included.
    pub covariance: Matrix<M, M>,
    angle: [bool; M],
}

impl<const M: usize> PredictedMeasurement<M> {
    /// `z` minus the mean, angles wrapped.
    pub fn innovation(&self, z: &[f64; M]) -> [f64; M] {
        from_fn(|i| if self.angle[i] { wrap(z[i] - self.mean[i]) } else { z[i] - self.mean[i] })
    }

    /// nu' S^-1 nu: the normalised innovation squared (NIS) of `z`; chi-square with `M` degrees of freedom where
    /// the belief and the models are right and nearly linear.
    ///
    /// # Errors
    /// A covariance that is not positive definite, a `z` that is not finite.
    pub fn nis(&self, z: &[f64; M]) -> Result<f64> {
        for &component in z {
            Error::finite("measurement", component)?;
        }
        Ok(Cholesky::of("covariance of the innovation", &self.covariance)?
            .mahalanobis_squared(&self.innovation(z)))
    }
}

/// What a state of mean and covariance `state` at `from` foretells for a measurement at `to`. It serves every belief
/// that has a mean and a covariance (particles too), so that their innovations are judged by one rule: sigma points
/// ([`SigmaPoints::default`](super::SigmaPoints)) through the motion, if time passes, and through the measurement,
/// whose noise enters with its nominal covariance.
///
/// # Errors
/// A step back in time, a model that refuses its parameters, numbers that are not finite.
pub fn predict_measurement<A, H, const N: usize, const W: usize, const M: usize>(
    motion: &A,
    measurement: &H,
    state: &Gaussian<N>,
    from: Time,
    to: Time,
) -> Result<PredictedMeasurement<M>>
where
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    let points = super::SigmaPoints::default();
    let state = match to.cmp(&from) {
        std::cmp::Ordering::Less => return Err(Error::OutOfOrder { from, to }),
        std::cmp::Ordering::Equal => *state,
        std::cmp::Ordering::Greater => points.propagate(motion, &motion.over(from, to)?, state)?,
    };
    let observed = points.observe(measurement, to, &state)?;
    for z in observed.mean {
        Error::finite("predicted measurement", z)?;
    }
    let covariance = (observed.covariance + Matrix(measurement.covariance())).symmetrised();
    covariance.finite("covariance of the innovation")?;
    Ok(PredictedMeasurement { mean: observed.mean, covariance, angle: H::ANGLE })
}
