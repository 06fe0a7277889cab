//! Models and a filter for them: how beliefs start, step and foretell.

use super::Plot;
use super::belief::Belief;
use super::kind::{Family, Form, Kind};
use super::modes::{Modes, Moves};
use super::row::{Innovation, State};
use super::sensor::{Frame, Sensors, Work};
use super::spec::{Engine, TrackerSpec};
use super::tracker::stable_hash;
use crate::belief::{Cloud, Gaussian, GaussianBelief, Hypotheses, Hypothesis, ModalGaussian};
use crate::error::{Error, Result};
use crate::filter::{
    Filter, GaussianFilter, ImmParticle, Linear, ModalSettings, MultipleModel, ParticleFilter, Prior,
    Rejuvenation, Settings, Size, Tangent, Transform, Update, check_hypotheses, predict_measurement,
    step_hypotheses, step_modes,
};
use crate::math::gaussian::LN_2PI;
use crate::math::{Cholesky, Matrix};
use crate::model::{GaussianMeasurement, JumpMarkov, Measurement, Motion};
use crate::resample::{Reduction, Trigger};
use crate::rng::Stream;
use crate::time::Time;
use std::array::from_fn;

/// Standard deviation of an axis of which nothing is known, uniform over half a turn: pi / sqrt(12).
const ANY_AXIS: f64 = 0.906_899_682_117_109;

/// Models and settings: what all targets share.
pub(super) struct Rules<A, F: Frame<N, D>, const N: usize, const W: usize, const D: usize> {
    pub(super) spec: TrackerSpec,
    motion: A,
    /// Its modes, for filters that have them.
    pub(super) modes: Option<Modes<A>>,
    pub(super) sensors: Sensors<F, N, D>,
    kind: Kind,
    finally: Finally<A, F, N, W, D>,
    stream: Stream,
}

/// What takes the place of the Gaussians that a belief starts as.
enum Finally<A, F: Frame<N, D>, const N: usize, const W: usize, const D: usize> {
    /// Nothing.
    Gaussian,
    /// So many hypotheses.
    Hypotheses(usize),
    Cloud(ParticleFilter<N, W, A, Sensors<F, N, D>>),
    EveryMode(MultipleModel<N, W, A, Sensors<F, N, D>>),
    Interacting(ImmParticle<N, W, A, Sensors<F, N, D>>),
}

impl<A, F, const N: usize, const W: usize, const D: usize> Rules<A, F, N, W, D>
where
    A: Motion<N, W> + Clone + 'static,
    F: Frame<N, D>,
{
    pub(super) fn new(spec: &TrackerSpec, moves: Moves<A>, engine: Engine) -> Result<Self> {
        let kind = Kind::named(&spec.filter.name)?;
        let start = &spec.start;
        Error::positive("standard deviation of the speed at the start", start.speed_sd_mps)?;
        Error::positive("standard deviation of the acceleration at the start", start.acceleration_sd_mps2)?;
        Error::positive("standard deviation of the turn rate at the start", start.turn_rate_sd_rad_s)?;
        Error::positive("standard deviation of the size at the start", start.size_sd_m)?;
        let mut rules = Rules {
            spec: spec.clone(),
            motion: moves.quiet,
            modes: moves.modes,
            sensors: Sensors::new(&spec.sensors)?,
            kind,
            finally: Finally::Gaussian,
            stream: Stream::new(spec.seed),
        };
        rules.finally = rules.finally(engine)?;
        Ok(rules)
    }

    fn finally(&self, engine: Engine) -> Result<Finally<A, F, N, W, D>> {
        let filter = &self.spec.filter;
        let (particles, resampling, noise) = (filter.particles, filter.resampling, filter.noise);
        let Engine { simd, threads } = engine;
        // Where a belief starts is for its first plot to say; these priors are never drawn from.
        let (position, sd) = self.spec.start.position.unwrap_or(([0.0; 3], 1.0));
        let prior = self.prior(&Gaussian::independent(from_fn(|i| position[i]), [sd; D])?)?;
        let sensors = self.sensors.clone();
        if self.kind.form == Form::Cloud {
            let trigger = if filter.name == "sis" { Trigger::Never } else { filter.trigger };
            let (rejuvenation, lookahead) = (Rejuvenation::Roughen(filter.roughening), None);
            let settings = Settings {
                particles,
                size: Size::Fixed,
                resampling,
                trigger,
                rejuvenation,
                lookahead,
                noise,
                simd,
                threads,
            };
            return ParticleFilter::new(prior, self.motion.clone(), sensors, settings).map(Finally::Cloud);
        }
        let Some(Modes { model, .. }) = &self.modes else { return Ok(Finally::Gaussian) };
        let settings = ModalSettings { particles, resampling, noise, simd, threads };
        Ok(match self.kind.form {
            Form::Gaussian | Form::Cloud => Finally::Gaussian,
            Form::Hypotheses => {
                check_hypotheses(particles)?;
                Finally::Hypotheses(particles)
            }
            Form::EveryMode => {
                Finally::EveryMode(MultipleModel::new(prior, model.clone(), sensors, settings)?)
            }
            Form::Interacting => {
                Finally::Interacting(ImmParticle::new(prior, model.clone(), sensors, settings)?)
            }
        })
    }

    /// The law of a state of which a position is known: everything else is as the start says, around zero.
    fn prior(&self, position: &Gaussian<D>) -> Result<Gaussian<N>> {
        let start = &self.spec.start;
        let mean = from_fn(|i| if i < D { position.mean()[i] } else { 0.0 });
        let covariance = Matrix::from_entries(|i, j| match states::<N, D>(i) {
            State::Position(_) if j < D => position.covariance().0[i][j],
            State::Velocity(_) if i == j => start.speed_sd_mps * start.speed_sd_mps,
            State::Acceleration(_) if i == j => start.acceleration_sd_mps2 * start.acceleration_sd_mps2,
            State::TurnRate if i == j => start.turn_rate_sd_rad_s * start.turn_rate_sd_rad_s,
            State::Length | State::Width if i == j => start.size_sd_m * start.size_sd_m,
            State::Orientation if i == j => ANY_AXIS * ANY_AXIS,
            _ => 0.0,
        });
        Gaussian::new(mean, covariance)
    }

    /// The law of the state that `plot` starts; `None` if it tells no position. With it, how many updates
    /// particles wait for.
    ///
    /// A precise plot leaves the velocity open: of particles spread over all velocities hardly one would meet
    /// the next plot. So the belief stays Gaussian (one for each mode, where there are modes) until as many
    /// plots as the state has orders (position, velocity, acceleration) have fixed it, and the cloud is drawn
    /// then. A belief that starts from a configured position is a cloud at once, because what comes first
    /// then (bearings) makes it far from normal.
    pub(super) fn begin(&self, plot: &Plot) -> Result<Option<(Gaussian<N>, u32)>> {
        if let Some(position) = self.sensors.of(plot).place(&plot.reading)? {
            return Ok(Some((self.prior(&position)?, N.div_ceil(D) as u32 - 1)));
        }
        let Some((position, sd)) = self.spec.start.position else { return Ok(None) };
        let law = Gaussian::independent(from_fn(|i| position[i]), [sd; D])?;
        Ok(Some((self.prior(&law)?, 0)))
    }

    /// Random numbers of a belief: its track's, and other ones after each start.
    pub(super) fn stream_of(&self, id: &str, starts: u32) -> Stream {
        self.stream.fork(stable_hash(id)).fork(u64::from(starts))
    }

    /// The belief that starts as `law`, in every mode, and is drawn at once if there is nothing to wait for.
    pub(super) fn form(&self, stream: Stream, at: Time, law: Gaussian<N>, warm_up: u32) -> Result<Belief<N>> {
        let belief = match &self.modes {
            None => Belief::Gaussian(GaussianBelief { time: at, state: law }),
            Some(Modes { model, .. }) => {
                let initial = model.chain().initial().to_vec();
                let laws = vec![law; initial.len()];
                Belief::Modal(ModalGaussian::new(at, initial, laws)?)
            }
        };
        let waits = warm_up > 0 && self.kind.has_particles();
        let drawn = if waits { None } else { self.draw(stream, &belief)? };
        Ok(drawn.unwrap_or(belief))
    }

    /// What takes the place of the Gaussians that stood for it; `None` where they stay.
    pub(super) fn draw(&self, stream: Stream, belief: &Belief<N>) -> Result<Option<Belief<N>>> {
        Ok(Some(match (&self.finally, belief) {
            (Finally::Cloud(filter), Belief::Gaussian(GaussianBelief { time, state })) => {
                let columns = state.columns(stream, filter.settings().particles)?;
                Belief::Cloud(Box::new(Cloud::from_columns(*time, stream, columns)?))
            }
            (Finally::Hypotheses(_), Belief::Modal(law)) => {
                let each = law.probabilities().iter().enumerate();
                let all =
                    each.map(|(mode, &weight)| Hypothesis { label: mode, weight, law: *law.mode(mode) });
                Belief::Hypotheses(Hypotheses::new(law.time(), stream, law.len(), all.collect())?)
            }
            (Finally::EveryMode(filter), Belief::Modal(law)) => {
                Belief::EveryMode(Box::new(filter.draw(law, stream)?))
            }
            (Finally::Interacting(filter), Belief::Modal(law)) => {
                Belief::Interacting(Box::new(filter.draw(law, stream)?))
            }
            _ => return Ok(None),
        }))
    }

    /// Whether a belief is one that this filter may have.
    pub(super) fn accepts(&self, belief: &Belief<N>) -> bool {
        match belief {
            // They stand for what is not yet drawn.
            Belief::Gaussian(_) | Belief::Modal(_) => true,
            Belief::Hypotheses(_) => matches!(self.finally, Finally::Hypotheses(_)),
            Belief::Cloud(_) => matches!(self.finally, Finally::Cloud(_)),
            Belief::EveryMode(_) => matches!(self.finally, Finally::EveryMode(_)),
            Belief::Interacting(_) => matches!(self.finally, Finally::Interacting(_)),
        }
    }

    /// The step of the filter, or of the one that stands for it until particles are drawn: an update by
    /// `plot`, or a prediction to its time where `used` is false.
    pub(super) fn step(&self, belief: &mut Belief<N>, plot: &Plot, used: bool) -> Result<Update> {
        let (to, z) = (plot.time, used.then_some(plot));
        let gaussians = match (belief, &self.finally) {
            (Belief::Cloud(cloud), Finally::Cloud(filter)) => return filter.step(cloud, to, z),
            (Belief::EveryMode(belief), Finally::EveryMode(filter)) => return filter.step(belief, to, z),
            (Belief::Interacting(cloud), Finally::Interacting(filter)) => return filter.step(cloud, to, z),
            (Belief::Hypotheses(belief), Finally::Hypotheses(most)) => Gaussians::Hypotheses(belief, *most),
            (Belief::Modal(belief), _) => Gaussians::ByMode(belief),
            (Belief::Gaussian(belief), _) => Gaussians::One(belief),
            _ => return Err(of_another_filter()),
        };
        let modes = self.modes.as_ref().map(|modes| &modes.model);
        let step = Step { motion: &self.motion, modes, family: self.kind.family, gaussians, at: to, used };
        self.sensors.of(plot).with(&plot.reading, step)
    }

    /// What `belief` foretells, against what was measured; `None` where it foretells nothing finite.
    ///
    /// Particles are foretold by their mean and covariance (in each mode, where there are modes).
    pub(super) fn foretold(&self, belief: &Belief<N>, plot: &Plot) -> Result<Option<Foretold>> {
        let foretold = || {
            let Some(law) = belief.by_mode()? else {
                return self.innovation(&belief.law()?, belief.time(), plot);
            };
            let mut ahead = Belief::Modal(law);
            if ahead.time() < plot.time {
                self.step(&mut ahead, plot, false)?;
            }
            ahead.law().and_then(|law| self.innovation(&law, plot.time, plot)).or(Ok(None))
        };
        match foretold() {
            // A cloud without spread, or without a particle left, foretells nothing; the filter can still go on.
            Err(_) if belief.has_particles() => Ok(None),
            foretold => foretold,
        }
    }

    /// What `state` at `from` foretells, against what was measured; `None` where it foretells nothing finite.
    pub(super) fn innovation(
        &self,
        state: &Gaussian<N>,
        from: Time,
        plot: &Plot,
    ) -> Result<Option<Foretold>> {
        struct Foretell<'a, A, const N: usize, const W: usize> {
            motion: &'a A,
            state: &'a Gaussian<N>,
            from: Time,
            at: Time,
        }
        impl<A: Motion<N, W>, const N: usize, const W: usize> Work<N> for Foretell<'_, A, N, W> {
            type Out = Option<Foretold>;
            fn with<H, const M: usize>(self, model: &H, z: &[f64; M]) -> Result<Self::Out>
            where
                H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]> + Clone,
            {
                for &component in z {
                    Error::finite("measurement", component)?;
                }
                let Ok(foretold) = predict_measurement(self.motion, model, self.state, self.from, self.at)
                else {
                    return Ok(None);
                };
                let Ok(factor) = Cholesky::of("covariance of the innovation", &foretold.covariance) else {
                    return Ok(None);
                };
                let whitened = factor.whiten(&foretold.innovation(&model.components(z)));
                let nis: f64 = whitened.iter().map(|w| w * w).sum();
                let shares = factor.solve_matrix(&Matrix(model.covariance())).diagonal();
                let log_density = -0.5 * (nis + factor.log_det() + M as f64 * LN_2PI);
                let noise_share = shares.iter().sum::<f64>() / M as f64;
                let least_share = shares.into_iter().fold(f64::INFINITY, f64::min);
                let innovation = Innovation { whitened: whitened.to_vec(), nis, noise_share };
                let finite = nis.is_finite() && noise_share.is_finite();
                Ok(finite.then_some(Foretold { innovation, log_density, least_share }))
            }
        }
        let work = Foretell { motion: &self.motion, state, from, at: plot.time };
        self.sensors.of(plot).with(&plot.reading, work)
    }

    /// Whether an innovation lies outside the gate of the plot's sensor.
    pub(super) fn gated(&self, plot: &Plot, innovation: Option<&Innovation>) -> bool {
        innovation.is_some_and(|i| i.nis > self.sensors.of(plot).threshold(i.whitened.len()))
    }
}

fn of_another_filter() -> Error {
    Error::Unsupported("a belief of another filter".to_owned())
}

/// A belief of Gaussians.
enum Gaussians<'a, const N: usize> {
    One(&'a mut GaussianBelief<N>),
    ByMode(&'a mut ModalGaussian<N>),
    /// Of which so many are kept.
    Hypotheses(&'a mut Hypotheses<N>, usize),
}

/// The step of such a belief to `at`: an update if the reading is `used`, else a prediction.
struct Step<'a, A, const N: usize, const W: usize> {
    motion: &'a A,
    modes: Option<&'a JumpMarkov<A>>,
    family: Family,
    gaussians: Gaussians<'a, N>,
    at: Time,
    used: bool,
}

impl<A: Motion<N, W> + Clone, const N: usize, const W: usize> Work<N> for Step<'_, A, N, W> {
    type Out = Update;
    fn with<H, const M: usize>(self, sensor: &H, z: &[f64; M]) -> Result<Update>
    where
        H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]> + Clone,
    {
        match self.family {
            Family::Kalman => self.by(Linear, sensor, z),
            Family::Extended => self.by(Tangent, sensor, z),
            Family::Unscented(points) => self.by(points, sensor, z),
        }
    }
}

impl<A: Motion<N, W> + Clone, const N: usize, const W: usize> Step<'_, A, N, W> {
    fn by<T, H, const M: usize>(self, transform: T, sensor: &H, z: &[f64; M]) -> Result<Update>
    where
        T: Transform,
        H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]> + Clone,
    {
        let (at, z) = (self.at, self.used.then_some(z));
        let accept = |model: &JumpMarkov<A>, law: &Gaussian<N>| {
            model.modes().iter().try_for_each(|mode| transform.accept(mode, sensor, law))
        };
        match (self.gaussians, self.modes) {
            (Gaussians::One(belief), _) => {
                transform.accept(self.motion, sensor, &belief.state)?;
                let (motion, sensor, prior) = (self.motion.clone(), sensor.clone(), belief.state);
                GaussianFilter::of(transform, motion, sensor, prior).step(belief, at, z)
            }
            (Gaussians::ByMode(belief), Some(model)) => {
                accept(model, belief.mode(0))?;
                step_modes(&transform, model, sensor, None, belief, at, z)
            }
            (Gaussians::Hypotheses(belief, most), Some(model)) => {
                let settings = (most, Reduction::default(), None);
                step_hypotheses(&transform, model, sensor, settings, belief, at, z)
            }
            _ => Err(of_another_filter()),
        }
    }
}

/// A measurement against its prediction, and what only learning asks.
pub(super) struct Foretold {
    pub(super) innovation: Innovation,
    /// ln N(nu; 0, S).
    pub(super) log_density: f64,
    /// The least of the components' shares of noise, of which `noise_share` is the mean.
    pub(super) least_share: f64,
}

/// What component `i` of a state of `N` numbers in `D` dimensions is.
pub(super) fn states<const N: usize, const D: usize>(i: usize) -> State {
    match i / D {
        0 => State::Position(i),
        1 => State::Velocity(i - D),
        _ if N == 3 * D => State::Acceleration(i - 2 * D),
        // A box in the plane.
        _ if N == 2 * D + 3 => [State::Length, State::Width, State::Orientation][(i - 2 * D).min(2)],
        _ => State::TurnRate,
    }
}
