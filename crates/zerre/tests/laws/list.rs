//! The list of filters under law. A filter joins all laws by one line in [`filters`]; a new kind of belief says in
//! [`Estimates`] what it estimates.

use serde::{Serialize, de::DeserializeOwned};
use zerre::belief::{Cloud, Gaussian, GaussianBelief, ModalCloud};
use zerre::filter::{
    AfterResampling, Extended, Filter, ImmParticle, Kalman, ModalBelief, ModalSettings, MultipleModel,
    Output, ParticleFilter, Rejuvenation, ScaledResidual, Settings, SigmaPoints, Unscented, Update, Wsms,
};
use zerre::kernels::{Generator, NoiseSource, Resolution, Simd, Threads};
use zerre::math::Matrix;
use zerre::model::{Chain, GaussianMeasurement, JumpMarkov, Measurement, motion::ConstantVelocity};
use zerre::resample::{Resampling, Trigger};
use zerre::rng::Stream;
use zerre::{Result, Time};

/// What a filter is on a linear Gaussian world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Class {
    /// The posterior, up to rounding.
    Exact,
    /// Converges to the posterior as the number of particles grows.
    Consistent,
    /// Converges to the posterior as the number of particles n grows, with a bias of at most `bias` / n in
    /// everything that law 1 compares, evidence included.
    Approximate { bias: f64 },
    /// Does what a paper says, which is not the posterior: free of laws 1, 2 and 5, and pinned by a test of its own.
    Reproduction,
    /// Converges to the posterior, but at a cost for each particle that grows with their number: bound by laws 1
    /// and 5 on smaller worlds, in `tests/swarm.rs`.
    Elsewhere,
}

impl Class {
    /// Whether laws 1 and 5 are upheld on the whole list.
    pub fn is_bound_here(self) -> bool {
        !matches!(self, Class::Reproduction | Class::Elsewhere)
    }
}

/// A filter with its name and what it claims to be.
pub struct Entry {
    pub name: String,
    pub class: Class,
    pub filter: Box<dyn UnderLaw>,
}

/// The models of a world: what a target does and what is seen of it.
#[derive(Clone, Copy)]
pub struct World<H> {
    pub prior: Gaussian<4>,
    pub motion: ConstantVelocity<2>,
    pub sensor: H,
}

/// Sensors of two components that every filter takes.
pub trait Sensor: GaussianMeasurement<4, 2> + Measurement<4, Value = [f64; 2]> + Copy + 'static {}
impl<H: GaussianMeasurement<4, 2> + Measurement<4, Value = [f64; 2]> + Copy + 'static> Sensor for H {}

/// What does not change what a filter is.
#[derive(Clone)]
pub struct Means {
    pub particles: usize,
    pub simd: Simd,
    pub threads: Threads,
}

impl Means {
    pub fn serial(particles: usize) -> Means {
        Means { particles, simd: Simd::best(), threads: Threads::Serial }
    }
}

pub const RESAMPLINGS: [Resampling; 4] =
    [Resampling::Multinomial, Resampling::Residual, Resampling::Stratified, Resampling::Systematic];

pub const SOURCES: [NoiseSource; 4] = [
    NoiseSource { generator: Generator::Philox, resolution: Resolution::Bits32 },
    NoiseSource { generator: Generator::Philox, resolution: Resolution::Bits64 },
    NoiseSource { generator: Generator::Xoshiro, resolution: Resolution::Bits32 },
    NoiseSource { generator: Generator::Xoshiro, resolution: Resolution::Bits64 },
];

/// The list.
pub fn filters<H: Sensor>(world: &World<H>, means: &Means) -> Vec<Entry> {
    let &World { prior, motion, sensor } = world;
    let particle = |noise, resampling, trigger, rejuvenation| {
        let Means { particles, simd, ref threads } = *means;
        let (threads, lookahead) = (threads.clone(), None);
        let settings = Settings {
            particles,
            resampling,
            trigger,
            rejuvenation,
            lookahead,
            noise,
            simd,
            threads,
            ..Settings::default()
        };
        ParticleFilter::new(prior, motion, sensor, settings).unwrap()
    };
    let mut list = vec![
        entry("extended", Class::Exact, Extended::new(motion, sensor, prior)),
        entry(
            "unscented",
            Class::Exact,
            Unscented::new(motion, sensor, prior, SigmaPoints::default()).unwrap(),
        ),
    ];
    // It refuses worlds that are not linear.
    if let Ok(kalman) = Kalman::new(motion, sensor, prior) {
        list.push(entry("kalman", Class::Exact, kalman));
    }
    for noise in SOURCES {
        let source = format!("{:?} {:?}", noise.generator, noise.resolution);
        let never = particle(noise, Resampling::Systematic, Trigger::Never, Rejuvenation::Nothing);
        list.push(entry(format!("importance sampling, {source}"), Class::Consistent, never));
        for resampling in RESAMPLINGS {
            for trigger in [Trigger::Always, Trigger::Below(0.5)] {
                let name = format!("particle, {resampling:?} {trigger:?}, {source}");
                list.push(entry(
                    name,
                    Class::Consistent,
                    particle(noise, resampling, trigger, Rejuvenation::Nothing),
                ));
            }
        }
    }
    // One mode, and two that are alike behind a chain that is not: the posterior is that of one.
    let alike = [(1, Chain::staying(1, 1.0)), (2, Chain::per_step(vec![vec![0.8, 0.2], vec![0.5, 0.5]]))];
    for (modes, chain) in alike {
        let model = JumpMarkov::new(vec![motion; modes], chain.unwrap()).unwrap();
        for (noise, resampling) in SOURCES.into_iter().zip(RESAMPLINGS) {
            let Means { particles, simd, ref threads } = *means;
            let settings = ModalSettings { particles, resampling, noise, simd, threads: threads.clone() };
            let of = format!("{modes} alike, {resampling:?}, {noise:?}");
            let interacting = ImmParticle::new(prior, model.clone(), sensor, settings.clone()).unwrap();
            list.push(entry(format!("IMM particle, {of}"), Class::Consistent, interacting));
            let filter = MultipleModel::new(prior, model.clone(), sensor, settings).unwrap();
            list.push(entry(format!("multiple model, {of}"), Class::Consistent, filter));
        }
    }
    list.extend(crate::list_modes_gaussian::filters(world));
    list.extend(crate::list_latent::filters(world, means));
    list.extend(crate::list_moves::filters(world, means));
    list.extend(crate::list_deterministic::filters(world, means));
    let default = NoiseSource::default();
    let roughened = particle(default, Resampling::Systematic, Trigger::Always, Rejuvenation::Roughen(0.2));
    list.push(entry("roughened (Gordon, Salmond and Smith)", Class::Reproduction, roughened));
    let model = JumpMarkov::new(vec![motion; 3], Chain::staying(3, 0.9).unwrap()).unwrap();
    let Means { particles, simd, ref threads } = *means;
    let settings = ModalSettings { particles, simd, threads: threads.clone(), ..ModalSettings::default() };
    let thesis = MultipleModel::new(prior, model, sensor, settings).unwrap();
    let survivors = thesis.clone().with_output(Output::Survivors).unwrap();
    let recomputed = survivors.with_after_resampling(AfterResampling::RecomputedKept);
    list.push(entry("multiple model, weights recomputed (Ucar)", Class::Reproduction, recomputed));
    let selecting = thesis.with_error(ScaledResidual { sensor, scale: [1.0; 2] });
    let selecting = selecting.with_output(Output::LeastError).unwrap();
    let selecting =
        selecting.with_selection(Wsms { threshold_range: (0.035, 3.0), ..Wsms::default() }).unwrap();
    list.push(entry("multiple model, one selected (Ucar)", Class::Reproduction, selecting));
    list.extend(crate::list_guided::filters(world, means));
    list.extend(crate::list_sizes::filters(world, means));
    list
}

pub fn entry(name: impl Into<String>, class: Class, filter: impl UnderLaw + 'static) -> Entry {
    Entry { name: name.into(), class, filter: Box::new(filter) }
}

/// What laws read from a belief.
pub trait Estimates {
    fn mean(&self) -> [f64; 4];
    fn covariance(&self) -> Matrix<4, 4>;
}

impl Estimates for GaussianBelief<4> {
    fn mean(&self) -> [f64; 4] {
        *self.state.mean()
    }
    fn covariance(&self) -> Matrix<4, 4> {
        *self.state.covariance()
    }
}

impl Estimates for Cloud<4> {
    fn mean(&self) -> [f64; 4] {
        Cloud::mean(self)
    }
    fn covariance(&self) -> Matrix<4, 4> {
        Cloud::covariance(self)
    }
}

impl Estimates for ModalCloud<4> {
    fn mean(&self) -> [f64; 4] {
        ModalCloud::mean(self)
    }
    fn covariance(&self) -> Matrix<4, 4> {
        ModalCloud::covariance(self)
    }
}

impl Estimates for ModalBelief<4> {
    fn mean(&self) -> [f64; 4] {
        self.estimate()
    }
    fn covariance(&self) -> Matrix<4, 4> {
        self.cloud().covariance()
    }
}

/// Any filter of the list, whatever its belief.
pub trait UnderLaw {
    /// A run from the prior at time zero.
    fn begin(&self, stream: Stream) -> Box<dyn Run + '_>;
    /// A run that was saved.
    fn resume(&self, saved: &str) -> Box<dyn Run + '_>;
}

/// A filter and its belief.
pub trait Run: Estimates {
    fn step(&mut self, to: Time, z: Option<&[f64; 2]>) -> Result<Update>;
    /// The belief as text: two beliefs are the same, bit for bit, if their texts are.
    fn save(&self) -> String;
}

struct Running<'f, F: Filter> {
    filter: &'f F,
    belief: F::Belief,
}

impl<F> UnderLaw for F
where
    F: Filter<Measurement = [f64; 2]>,
    F::Belief: Estimates + Serialize + DeserializeOwned,
{
    fn begin(&self, stream: Stream) -> Box<dyn Run + '_> {
        Box::new(Running { filter: self, belief: Filter::start(self, Time::ZERO, stream).unwrap() })
    }
    fn resume(&self, saved: &str) -> Box<dyn Run + '_> {
        Box::new(Running { filter: self, belief: serde_json::from_str(saved).unwrap() })
    }
}

impl<F> Run for Running<'_, F>
where
    F: Filter<Measurement = [f64; 2]>,
    F::Belief: Estimates + Serialize + DeserializeOwned,
{
    fn step(&mut self, to: Time, z: Option<&[f64; 2]>) -> Result<Update> {
        self.filter.step(&mut self.belief, to, z)
    }
    fn save(&self) -> String {
        serde_json::to_string(&self.belief).unwrap()
    }
}

impl<F: Filter> Estimates for Running<'_, F>
where
    F::Belief: Estimates,
{
    fn mean(&self) -> [f64; 4] {
        self.belief.mean()
    }
    fn covariance(&self) -> Matrix<4, 4> {
        self.belief.covariance()
    }
}
