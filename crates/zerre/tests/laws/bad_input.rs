//! Law 9: whatever comes in, the outcome is a result, a counted outcome or a typed refusal that leaves the belief as
//! it was, bit for bit. Never a panic.

use crate::limits::sound;
use crate::list::{Estimates, Means, Run, UnderLaw, filters};
use crate::{Verdict, uphold, worlds};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use zerre::belief::{Cloud, Gaussian};
use zerre::filter::{Filter, Outcome, ParticleFilter, ParticleUpdate, Prior, Settings, Update};
use zerre::kernels::Simd;
use zerre::math::{Matrix, Real};
use zerre::model::motion::RandomWalk;
use zerre::model::{Measurement, Motion};
use zerre::resample::Trigger;
use zerre::rng::Stream;
use zerre::{Error, Result, Time};

/// One step; the law for it.
fn withstands(run: &mut dyn Run, clock: &mut Time, to: Time, z: Option<&[f64; 2]>) -> Verdict {
    let now = *clock;
    let before = run.save();
    match run.step(to, z) {
        Ok(update) => {
            if to < now {
                return Err(format!("a step back from {now} to {to} was taken"));
            }
            if z.is_some_and(|z| z.iter().any(|z| !z.is_finite())) {
                return Err(format!("{z:?} was taken for a measurement"));
            }
            *clock = to;
            sound(run, &update)
        }
        Err(_) if run.save() != before => Err("a refusal changed the belief".into()),
        Err(Error::OutOfOrder { from, to: asked }) if to < now => {
            if (from, asked) == (now, to) {
                Ok(())
            } else {
                Err(format!("wrong times {from}, {asked}"))
            }
        }
        Err(e) if to < now => Err(format!("a step back is refused because {e}")),
        Err(_) if z.is_none() => Err("a prediction was refused".into()),
        Err(_) => Ok(()),
    }
}

/// A run that has seen something already.
fn warm(filter: &dyn UnderLaw) -> (Box<dyn Run + '_>, Time) {
    let mut run = filter.begin(Stream::new(1));
    for t in 1..4 {
        run.step(Time::from_secs(f64::from(t)), Some(&[f64::from(t), 0.0])).unwrap();
    }
    (run, Time::from_secs(3.0))
}

const STRANGE: [f64; 12] = [
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    0.0,
    -0.0,
    5e-324,
    -2.2e-308,
    1e308,
    -1.7e308,
    1e200,
    1e20,
    -4e6,
];

/// The law.
fn robust(filter: &dyn UnderLaw) -> Verdict {
    for a in STRANGE {
        for b in STRANGE {
            for secs in [3.0, 3.5] {
                let (mut run, mut now) = warm(filter);
                let to = Time::from_secs(secs);
                withstands(&mut *run, &mut now, to, Some(&[a, b]))
                    .map_err(|e| format!("{a:e}, {b:e}: {e}"))?;
            }
        }
    }
    let (mut run, mut now) = warm(filter);
    for nanos in [i64::MIN, -1, 0, now.nanos() - 1] {
        for z in [None, Some(&[0.0, 0.0]), Some(&[f64::NAN, 0.0])] {
            withstands(&mut *run, &mut now, Time::from_nanos(nanos), z)?;
        }
    }
    Ok(())
}

#[test]
fn every_filter_withstands_everything() {
    let (linear, radar) = (worlds::linear(1.0), worlds::radar());
    for particles in [1, 300] {
        let means = Means::serial(particles);
        for entry in filters(&linear, &means).into_iter().chain(filters(&radar, &means)) {
            uphold([(entry.name, robust(&*entry.filter))]);
        }
    }
}

/// A filter that puts its clock forward before it looks at the measurement.
struct Rash(Box<dyn UnderLaw>);
struct RashRun<'f>(Box<dyn Run + 'f>);

impl UnderLaw for Rash {
    fn begin(&self, stream: Stream) -> Box<dyn Run + '_> {
        Box::new(RashRun(self.0.begin(stream)))
    }
    fn resume(&self, saved: &str) -> Box<dyn Run + '_> {
        Box::new(RashRun(self.0.resume(saved)))
    }
}

impl Run for RashRun<'_> {
    fn step(&mut self, to: Time, z: Option<&[f64; 2]>) -> Result<Update> {
        let update = self.0.step(to, None)?;
        if z.is_some() { self.0.step(to, z) } else { Ok(update) }
    }
    fn save(&self) -> String {
        self.0.save()
    }
}

impl Estimates for RashRun<'_> {
    fn mean(&self) -> [f64; 4] {
        self.0.mean()
    }
    fn covariance(&self) -> Matrix<4, 4> {
        self.0.covariance()
    }
}

#[test]
fn the_law_finds_a_belief_that_moves_before_it_refuses() {
    for entry in filters(&worlds::linear(1.0), &Means::serial(20)) {
        assert!(robust(&Rash(entry.filter)).is_err(), "{}", entry.name);
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 300,
        rng_seed: RngSeed::Fixed(1),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn any_numbers_at_any_time(
        steps in prop::collection::vec(
            (any::<i64>(), prop::option::of([prop::num::f64::ANY, prop::num::f64::ANY])),
            1..6,
        ),
        small in any::<bool>(),
        which in any::<prop::sample::Index>(),
    ) {
        let list = filters(&worlds::linear(1.0), &Means::serial(40));
        let entry = which.get(&list);
        let mut run = entry.filter.begin(Stream::new(1));
        let mut now = Time::ZERO;
        for (nanos, z) in steps {
            // Small steps are near the belief more often than not.
            let to = Time::from_nanos(if small { nanos >> 32 } else { nanos });
            let verdict = withstands(&mut *run, &mut now, to, z.as_ref());
            prop_assert!(verdict.is_ok(), "{}: {verdict:?}", entry.name);
        }
    }
}

/// Far beyond what the arithmetic holds: the measurement is passed over, the belief predicted, and all goes on as if
/// there had been none, weights that were not equal included.
#[test]
fn an_impossible_measurement_is_as_none() {
    let world = worlds::linear(1.0);
    for entry in filters(&world, &Means::serial(700)) {
        let (mut run, _) = warm(&*entry.filter);
        let (mut twin, _) = warm(&*entry.filter);
        let to = Time::from_secs(4.0);
        let update = run.step(to, Some(&[1e200, 0.0])).unwrap();
        assert_eq!((update.outcome, update.log_evidence), (Outcome::Degenerate, f64::NEG_INFINITY));
        let predicted = twin.step(to, None).unwrap();
        // But for the evaluations that it took to see that it is impossible.
        let of = |update: Update| update.particles.map(|p| ParticleUpdate { evaluations: 0, ..p });
        assert_eq!(of(update), of(predicted), "{}", entry.name);
        assert!(run.save() == twin.save(), "{}", entry.name);
        let z = Some(&[4.0, 0.0]);
        let to = Time::from_secs(4.5);
        assert_eq!(run.step(to, z).unwrap(), twin.step(to, z).unwrap(), "{}", entry.name);
    }
}

/// A state of one component, sorted, so that whole blocks share its sign.
#[derive(Clone, Copy)]
struct Sorted;

impl Prior<1> for Sorted {
    fn columns(&self, _: Stream, n: usize) -> Result<[Vec<f64>; 1]> {
        Ok([(0..n).map(|i| 4.0 * (i as f64 + 0.5) / n as f64 - 2.0).collect()])
    }
}

/// What a likelihood is for states below the border.
#[derive(Clone, Copy)]
struct Fails {
    border: f64,
    with: f64,
}

impl Measurement<1> for Fails {
    type Value = f64;
    type Given<'z> = (f64, Fails);
    fn given(&self, z: &f64, _: Time) -> Result<(f64, Fails)> {
        Ok((*z, *self))
    }
    #[inline(always)]
    fn log_likelihood<R: Real>(&(z, Fails { border, with }): &(f64, Fails), [x]: [R; 1]) -> R {
        let e = x - z;
        x.if_lt(x.constant(border), x.constant(with), -(e * e) * 0.5)
    }
}

/// Particles of NaN or infinite likelihood are worth nothing and counted, wherever they stand; the others are as they
/// would be beside particles of likelihood zero.
#[test]
fn likelihoods_that_are_no_numbers_are_counted() {
    for n in [1usize, 5, 8, 100, 256, 300, 1500] {
        for simd in Simd::available() {
            for trigger in [Trigger::Never, Trigger::Always] {
                for border in [-3.0, -1.0, 0.1, 1.9, 3.0] {
                    let run = |with| {
                        let settings = Settings { particles: n, simd, trigger, ..Settings::default() };
                        let motion = RandomWalk::<1>::new(1e-6).unwrap();
                        let filter =
                            ParticleFilter::new(Sorted, motion, Fails { border, with }, settings).unwrap();
                        let mut cloud = filter.start(Time::ZERO, Stream::new(1)).unwrap();
                        let below = cloud.column(0).iter().filter(|&&x| x < border).count();
                        let first = filter.step(&mut cloud, Time::ZERO, Some(&0.3)).unwrap();
                        let weights: Vec<f64> = cloud.weights().collect();
                        let second = filter.step(&mut cloud, Time::from_secs(1.0), Some(&0.3)).unwrap();
                        (below, first, second, weights, cloud.mean(), cloud.covariance())
                    };
                    let (below, zero, then, weights, mean, covariance) = run(f64::NEG_INFINITY);
                    assert_eq!(zero.particles.unwrap().not_finite, 0);
                    assert_eq!(zero.outcome == Outcome::Degenerate, below == n);
                    assert!(mean[0].is_finite() && covariance.0[0][0].is_finite());
                    for with in [f64::NAN, f64::INFINITY, -f64::NAN] {
                        let what = format!("{n} particles, {below} of {with}, {}, {trigger:?}", simd.name());
                        let (_, first, second, found, found_mean, found_covariance) = run(with);
                        assert_eq!(first.particles.unwrap().not_finite, below, "{what}");
                        assert_eq!(
                            (first.outcome, first.log_evidence),
                            (zero.outcome, zero.log_evidence),
                            "{what}"
                        );
                        assert_eq!(found, weights, "{what}");
                        assert_eq!(second.log_evidence, then.log_evidence, "{what}");
                        assert_eq!((found_mean, found_covariance), (mean, covariance), "{what}");
                    }
                }
            }
        }
    }
}

/// Leaves the numbers for states below the border.
#[derive(Clone, Copy)]
struct Cliff {
    border: f64,
    to: f64,
}

impl Motion<1, 1> for Cliff {
    type Step = Cliff;
    fn over(&self, _: Time, _: Time) -> Result<Cliff> {
        Ok(*self)
    }
    #[inline(always)]
    fn apply<R: Real>(&Cliff { border, to }: &Cliff, [x]: [R; 1], _: [R; 1]) -> [R; 1] {
        [x.if_lt(x.constant(border), x.constant(to), x)]
    }
}

/// Particles whose state is lost are out: in predictions, updates and after measurements that are impossible.
#[test]
fn states_that_are_no_numbers_are_out_for_good() {
    let sensor = Fails { border: f64::NEG_INFINITY, with: 0.0 };
    for n in [8usize, 100, 600, 1500] {
        for simd in Simd::available() {
            for trigger in [Trigger::Never, Trigger::Below(0.1), Trigger::Always] {
                for to in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                    for z in [None, Some(&0.3), Some(&1e200)] {
                        let settings = Settings { particles: n, simd, trigger, ..Settings::default() };
                        let cliff = Cliff { border: 0.4, to };
                        let filter = ParticleFilter::new(Sorted, cliff, sensor, settings).unwrap();
                        let mut cloud = filter.start(Time::ZERO, Stream::new(1)).unwrap();
                        let gone = cloud.column(0).iter().filter(|&&x| x < 0.4).count();
                        let what = format!("{n}, {}, {trigger:?}, {to}, {z:?}", simd.name());
                        let update = filter.step(&mut cloud, Time::from_secs(1.0), z).unwrap();
                        let particles = update.particles.unwrap();
                        assert_eq!(particles.not_finite, gone, "{what}");
                        let alive = |cloud: &Cloud<1>| {
                            cloud.weights().take(gone).all(|w| w == 0.0)
                                && cloud.mean()[0] > 0.4
                                && cloud.covariance().0[0][0].is_finite()
                                && cloud.quantiles(0, [0.0, 1.0]).unwrap()[0] > 0.4
                        };
                        assert!(alive(&cloud), "{what}: {:?}", cloud.mean());
                        assert!(particles.ess <= (n - gone) as f64 + 1e-6, "{what}");
                        let update = filter.step(&mut cloud, Time::from_secs(1.0), Some(&1.0)).unwrap();
                        assert!(update.log_evidence.is_finite() && cloud.mean()[0] > 0.4, "{what}");
                    }
                }
            }
        }
    }
}

/// Nobody is left: it is said, with an effective sample size of zero, and goes on being said.
#[test]
fn a_cloud_that_is_lost_says_so() {
    let sensor = Fails { border: f64::NEG_INFINITY, with: 0.0 };
    for n in [1, 300] {
        for z in [None, Some(&0.3)] {
            let settings = Settings { particles: n, ..Settings::default() };
            let cliff = Cliff { border: 9.0, to: f64::NAN };
            let filter = ParticleFilter::new(Sorted, cliff, sensor, settings).unwrap();
            let mut cloud = filter.start(Time::ZERO, Stream::new(1)).unwrap();
            for (secs, lost) in [(1.0, n), (2.0, 0), (3.0, 0)] {
                let update = filter.step(&mut cloud, Time::from_secs(secs), z).unwrap();
                assert_eq!((update.outcome, update.log_evidence), (Outcome::Degenerate, f64::NEG_INFINITY));
                let particles = update.particles.unwrap();
                assert_eq!((particles.ess, particles.not_finite, cloud.ess()), (0.0, lost, 0.0));
            }
            // Such a belief is not loaded.
            let text = serde_json::to_string(&cloud).unwrap();
            assert!(serde_json::from_str::<Cloud<1>>(&text).is_err());
        }
    }
}

/// The evidence after the loss of particles is that of the remaining cloud.
#[test]
fn evidence_goes_on_without_the_lost() {
    let sensor = Fails { border: f64::NEG_INFINITY, with: 0.0 };
    let settings = Settings { particles: 1000, trigger: Trigger::Never, ..Settings::default() };
    let cliff = Cliff { border: 0.4, to: f64::NAN };
    let filter = ParticleFilter::new(Sorted, cliff, sensor, settings).unwrap();
    for z in [None, Some(&1e200)] {
        let mut cloud = filter.start(Time::ZERO, Stream::new(1)).unwrap();
        let likelihoods: Vec<f64> = (cloud.column(0).iter().filter(|&&x| x >= 0.4))
            .map(|x| (-0.5 * (x - 1.0) * (x - 1.0)).exp())
            .collect();
        filter.step(&mut cloud, Time::from_secs(1.0), z).unwrap();
        let update = filter.step(&mut cloud, Time::from_secs(1.0), Some(&1.0)).unwrap();
        let expected = (likelihoods.iter().sum::<f64>() / likelihoods.len() as f64).ln();
        assert!((update.log_evidence - expected).abs() < 1e-12, "{} {expected}", update.log_evidence);
    }
}

/// A prior that is no law is refused by the first belief.
#[test]
fn priors_that_are_no_laws() {
    assert!(Gaussian::new([0.0], Matrix([[-1.0]])).is_err());
    struct Broken;
    impl Prior<1> for Broken {
        fn columns(&self, _: Stream, n: usize) -> Result<[Vec<f64>; 1]> {
            Ok([vec![f64::NAN; n]])
        }
    }
    let motion = RandomWalk::<1>::new(1.0).unwrap();
    let sensor = Fails { border: 0.0, with: 0.0 };
    let filter = ParticleFilter::new(Broken, motion, sensor, Settings::default()).unwrap();
    assert!(matches!(filter.start(Time::ZERO, Stream::new(0)), Err(Error::NotFinite { .. })));
}
