//! Numbers of particles that change: by the divergence of Kullback and Leibler, by a clock, by a record.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use zerre::belief::{Cloud, Gaussian};
use zerre::filter::{
    Boxes, Budget, Deadline, Filter, Kalman, Kld, ParticleFilter, Prior, ResampleMove, Settings, Size,
    Tangent, Update,
};
use zerre::kernels::Simd;
use zerre::math::Real;
use zerre::model::{Likelihood, Measurement, measurement::Position, motion::RandomWalk};
use zerre::moves::Move;
use zerre::proposal::Guided;
use zerre::resample::Trigger;
use zerre::rng::Stream;
use zerre::{Error, Result, Time};

/// Says nothing of anybody.
#[derive(Clone, Copy)]
struct Flat;

impl Measurement<1> for Flat {
    type Value = [f64; 1];
    type Given<'z> = ();
    fn given(&self, _: &[f64; 1], _: Time) -> Result<()> {
        Ok(())
    }
    #[inline(always)]
    fn log_likelihood<R: Real>((): &(), [x]: [R; 1]) -> R {
        x.constant(0.0)
    }
}

fn prior() -> Gaussian<1> {
    Gaussian::independent([0.0], [2.0]).unwrap()
}

/// How many particles the filter goes on with after these, all of the same weight.
fn number_after(points: Vec<f64>, kld: Kld) -> usize {
    let settings = Settings { size: Size::Kld(kld), trigger: Trigger::Always, ..Settings::default() };
    let filter = ParticleFilter::new(prior(), RandomWalk::<1>::new(1.0).unwrap(), Flat, settings).unwrap();
    let mut cloud = Cloud::from_columns(Time::ZERO, Stream::new(1), [points]).unwrap();
    filter.step(&mut cloud, Time::ZERO, Some(&[0.0])).unwrap();
    let update = filter.step(&mut cloud, Time::ZERO, None).unwrap();
    assert_eq!(cloud.len(), update.particles.unwrap().particles);
    cloud.len()
}

/// Fox's number, written anew; 2.3263478740408408 is the 99 % quantile of tables.
fn fox(k: f64, error: f64) -> f64 {
    let term = 2.0 / (9.0 * (k - 1.0));
    (k - 1.0) / (2.0 * error) * (1.0 - term + term.sqrt() * 2.326_347_874_040_840_8).powi(3)
}

/// Boxes of known masses: the least n that is enough for the boxes that n draws are expected to fall into,
/// found by trying every n.
#[test]
fn the_number_is_that_of_the_closed_form() {
    let laws: [&dyn Fn(usize) -> usize; 3] = [&|_| 4, &|b| 1 + b, &|b| if b == 0 { 400 } else { 1 }];
    for (law, copies) in laws.into_iter().enumerate() {
        for boxes in [3usize, 10, 40, 200] {
            for error in [0.02, 0.05, 0.3] {
                let points: Vec<f64> =
                    (0..boxes).flat_map(|b| vec![3.0 * b as f64 + 0.1; copies(b)]).collect();
                let all = points.len() as f64;
                let occupied = |n: usize| -> f64 {
                    (0..boxes).map(|b| 1.0 - (1.0 - copies(b) as f64 / all).powf(n as f64)).sum()
                };
                let enough = |n: &usize| occupied(*n) < 2.0 || *n as f64 >= fox(occupied(*n), error);
                // From a number on at which two boxes are expected to be found.
                let least = (1..).find(|n| occupied(*n) >= 2.0).unwrap();
                let expected = (least..100_000).find(enough).unwrap();
                let kld = Kld::new(error, 0.99, Boxes::Sides(vec![1.0]), least, 100_000).unwrap();
                assert_eq!(number_after(points, kld), expected, "law {law}, {boxes} boxes, {error}");
            }
        }
    }
    // One box, for which any number will do, and more boxes than there may be particles for.
    let kld = || Kld::new(0.05, 0.99, Boxes::Sides(vec![1.0]), 7, 300).unwrap();
    assert_eq!(number_after(vec![4.0; 50], kld()), 7);
    assert_eq!(number_after((0..2000).map(f64::from).collect(), kld()), 300);
}

/// A normal law of twice the width fills twice the boxes, and so do two laws side by side: n(k) is nearly
/// proportional to k - 1, and the number of boxes beyond which little lies to the width, so that the number
/// nearly doubles; 1.6 leaves room for the boxes at the ends. In units of the law's own deviations it stays
/// what it is when the law widens, up to what few draws in the tails do (5 %), and two modes far apart are
/// narrow.
#[test]
fn the_number_follows_the_posterior() {
    let normal = prior().columns(Stream::new(5), 5000).unwrap()[0].clone();
    let wide: Vec<f64> = normal.iter().map(|x| 2.0 * x).collect();
    let two: Vec<f64> = normal.iter().flat_map(|x| [x - 40.0, x + 40.0]).collect();
    let by = |points: &[f64], boxes| {
        number_after(points.to_vec(), Kld::new(0.05, 0.99, boxes, 10, 100_000).unwrap()) as f64
    };
    let sides = || Boxes::Sides(vec![0.5]);
    let (one, wider, both) = (by(&normal, sides()), by(&wide, sides()), by(&two, sides()));
    assert!(one > 100.0 && wider > 1.6 * one && both > 1.6 * one, "{one} {wider} {both}");
    let own = || Boxes::Deviations(0.25);
    let (one, wider, both) = (by(&normal, own()), by(&wide, own()), by(&two, own()));
    assert!((wider / one - 1.0).abs() < 0.05 && both < one, "{one} {wider} {both}");
}

/// A walk that is seen, and what is seen of it.
type Walk = (RandomWalk<1>, Position<1>);

fn walk() -> (Walk, Vec<(Time, [f64; 1])>) {
    let seen = [0.3, 1.1, -0.4, 2.9, 2.0, 3.2, 1.5, -2.0];
    let at = |k: usize| Time::from_secs(k as f64);
    let seen = seen.iter().enumerate().map(|(k, z)| (at(k), [*z])).collect();
    ((RandomWalk::new(1.0).unwrap(), Position::new(0.7).unwrap()), seen)
}

fn run<F: Filter<Measurement = [f64; 1]>>(filter: &F, stream: Stream) -> (F::Belief, Vec<Update>) {
    let mut belief = filter.start(Time::ZERO, stream).unwrap();
    let step = |(to, z): &(Time, [f64; 1])| filter.step(&mut belief, *to, Some(z)).unwrap();
    let updates = walk().1.iter().map(step).collect();
    (belief, updates)
}

/// A divergence small enough, and boxes fine enough, that the number moves between 20 and 60.
fn kld() -> Size {
    Size::Kld(Kld::new(0.3, 0.9, Boxes::Sides(vec![0.4]), 20, 60).unwrap())
}

fn record(updates: &[Update]) -> Vec<u32> {
    updates.iter().map(|update| update.particles.unwrap().particles as u32).collect()
}

/// The evidence of a run is unbiased for any number of particles, however they were chosen: its average over
/// 4 000 runs lies within five standard errors of the exact one (2.9e-7 each).
#[test]
fn the_evidence_is_unbiased() {
    let ((motion, sensor), _) = walk();
    let kalman = Kalman::new(motion, sensor, prior()).unwrap();
    let total = |updates: Vec<Update>| updates.iter().map(|update| update.log_evidence).sum::<f64>();
    let exact = total(run(&kalman, Stream::new(0)).1);
    let recorded = || Size::Recorded(vec![30, 60, 10, 10, 50, 20, 80, 15]);
    let always = Settings { particles: 30, trigger: Trigger::Always, ..Settings::default() };
    let rarely = Settings { trigger: Trigger::Below(0.5), ..always.clone() };
    for settings in [
        Settings { size: kld(), ..always.clone() },
        Settings { size: kld(), ..rarely.clone() },
        Settings { size: kld(), lookahead: Some(1.0), ..rarely.clone() },
        Settings { size: recorded(), ..always },
        Settings { size: recorded(), ..rarely.clone() },
        Settings { size: recorded(), lookahead: Some(1.0), ..rarely },
    ] {
        let filter = ParticleFilter::new(prior(), motion, sensor, settings.clone()).unwrap();
        let ratios: Vec<f64> =
            (0..4000).map(|seed| (total(run(&filter, Stream::new(seed)).1) - exact).exp()).collect();
        let n = ratios.len() as f64;
        let mean = ratios.iter().sum::<f64>() / n;
        let variance = ratios.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / (n - 1.0);
        assert!((mean - 1.0).abs() < 5.0 * (variance / n).sqrt(), "{mean} {variance} {settings:?}");
    }
}

/// What a record replays to, beside what it is of.
fn replays<F>(filter: &F, settings: &Settings, text: impl Fn(&F::Belief) -> String)
where
    F: Filter<Measurement = [f64; 1]>,
{
    let ((motion, sensor), _) = walk();
    let (belief, updates) = run(filter, Stream::new(3));
    let numbers = record(&updates);
    assert!(numbers.iter().any(|n| *n != numbers[0]), "{numbers:?}");
    let settings = Settings { size: Size::Recorded(numbers), ..settings.clone() };
    let twin = ParticleFilter::new(prior(), motion, sensor, settings).unwrap();
    let (cloud, again) = run(&twin, Stream::new(3));
    assert_eq!(again, updates);
    assert_eq!(serde_json::to_string(&cloud).unwrap(), text(&belief));
}

#[test]
fn a_record_is_replayed_to_the_same_bits() {
    let ((motion, sensor), _) = walk();
    for lookahead in [None, Some(1.0)] {
        for trigger in [Trigger::Always, Trigger::Below(0.7)] {
            let settings = Settings { particles: 30, trigger, lookahead, ..Settings::default() };
            let with = |size| {
                let settings = Settings { size, ..settings.clone() };
                ParticleFilter::new(prior(), motion, sensor, settings).unwrap()
            };
            replays(&with(kld()), &settings, |cloud| serde_json::to_string(cloud).unwrap());
            // A clock that is fast now and slow then.
            let calls = AtomicU64::new(0);
            let clock = move || {
                let call = calls.fetch_add(1, Ordering::Relaxed);
                Duration::from_micros(call * call * call % 17 + 20 * call)
            };
            let budget = Budget { least: 5, most: 200, ..Budget::per_step(Duration::from_micros(30)) };
            let timed = Deadline::new(with(Size::Fixed), budget, clock).unwrap();
            replays(&timed, &settings, |belief| serde_json::to_string(belief.cloud()).unwrap());
        }
    }
}

/// A measurement whose evaluation takes time of a clock that stands still otherwise.
struct Costly {
    sensor: Position<1>,
    now: Arc<AtomicU64>,
    /// Nanoseconds per particle.
    cost: Arc<AtomicU64>,
}

impl Likelihood<1> for Costly {
    type Value = [f64; 1];
    type Digest<'z> = (&'z Costly, <Position<1> as Measurement<1>>::Given<'z>);
    fn digest<'z>(&'z self, z: &'z [f64; 1], at: Time) -> Result<Self::Digest<'z>> {
        Ok((self, Measurement::<1>::given(&self.sensor, z, at)?))
    }
    fn score((costly, given): &Self::Digest<'_>, simd: Simd, states: &[&[f64]; 1], out: &mut [f64]) {
        let cost = costly.cost.load(Ordering::Relaxed);
        costly.now.fetch_add(cost * out.len() as u64, Ordering::Relaxed);
        <Position<1> as Likelihood<1>>::score(given, simd, states, out);
    }
}

/// A run by a machine whose speed the test sets: time of each step in ns, and its particles.
struct Machine {
    step: Box<dyn FnMut() -> (u64, usize)>,
    cost: Arc<AtomicU64>,
}

impl Machine {
    fn new(budget: Budget, particles: usize) -> Machine {
        let (now, cost) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicU64::new(100)));
        let sensor = Costly { sensor: Position::new(1.0).unwrap(), now: now.clone(), cost: cost.clone() };
        let settings = Settings { particles, ..Settings::default() };
        let filter =
            ParticleFilter::new(prior(), RandomWalk::<1>::new(1.0).unwrap(), sensor, settings).unwrap();
        let time = now.clone();
        let clock = move || Duration::from_nanos(time.load(Ordering::Relaxed));
        let deadline = Deadline::new(filter, budget, clock).unwrap();
        let mut belief = deadline.start(Time::ZERO, Stream::new(2)).unwrap();
        let mut k = 0;
        let step = move || {
            k += 1;
            let before = now.load(Ordering::Relaxed);
            let update = deadline.step(&mut belief, Time::from_secs(f64::from(k)), Some(&[0.0])).unwrap();
            (now.load(Ordering::Relaxed) - before, update.particles.unwrap().particles)
        };
        Machine { step: Box::new(step), cost }
    }

    fn steps(&mut self, count: usize) -> Vec<(u64, usize)> {
        (0..count).map(|_| (self.step)()).collect()
    }

    /// Nanoseconds per particle from now on.
    fn set(&self, cost: u64) {
        self.cost.store(cost, Ordering::Relaxed);
    }
}

const MILLI: Duration = Duration::from_millis(1);

/// 0.8 ms hold 8 000 particles of 100 ns, to which 1 000 grow by a quarter a step in 10 steps.
fn settled() -> Machine {
    let mut machine = Machine::new(Budget::per_step(MILLI), 1000);
    let steps = machine.steps(40);
    assert!(steps.windows(2).all(|pair| pair[1].1 as f64 <= 1.25 * pair[0].1 as f64 + 1.0));
    assert!(steps[13..].iter().all(|step| *step == (800_000, 8000)), "{steps:?}");
    machine
}

#[test]
fn as_many_particles_as_fit() {
    let mut machine = settled();
    // A lasting change is taken in at its third step, and comes into force after the next.
    machine.set(400);
    let steps = machine.steps(30);
    assert_eq!(steps.iter().filter(|step| step.0 > 1_000_000).count(), 4, "{steps:?}");
    assert!(steps[4..].iter().all(|step| *step == (800_000, 2000)), "{steps:?}");
    // When it is over the window forgets it, and the number is what it was.
    machine.set(100);
    let steps = machine.steps(90);
    assert!(steps.iter().all(|step| step.0 <= 1_000_000));
    assert_eq!(steps[89], (800_000, 8000));
}

#[test]
fn a_slow_step_by_chance_changes_nothing_and_slow_steps_that_recur_do() {
    let mut machine = settled();
    machine.set(5000);
    assert_eq!(machine.steps(1), [(40_000_000, 8000)]);
    machine.set(100);
    assert!(machine.steps(100).iter().all(|step| *step == (800_000, 8000)));
    // Every tenth step takes three times as long: of 64 steps six or seven.
    let mut late = Vec::new();
    for k in 0..300 {
        machine.set(if k % 10 == 0 { 300 } else { 100 });
        late.extend(machine.steps(1).iter().filter(|step| step.0 > 1_000_000).map(|_| k));
    }
    assert_eq!(late, [0, 10, 20]);
}

#[test]
fn the_ends_of_the_range() {
    // No time passes that the clock would see: as many as there may be.
    let mut machine = Machine::new(Budget { most: 3000, ..Budget::per_step(MILLI) }, 1000);
    machine.set(0);
    assert_eq!(machine.steps(20)[19], (0, 3000));
    // Too little time for the least number: the least, late.
    let mut machine = Machine::new(Budget { least: 500, ..Budget::per_step(MILLI / 100) }, 1000);
    let steps = machine.steps(20);
    assert!(steps[3..].iter().all(|step| *step == (50_000, 500)), "{steps:?}");
}

#[test]
fn settings_out_of_range_are_refused() {
    let out = |found: Result<Kld>| matches!(found, Err(Error::OutOfRange { .. } | Error::NotFinite { .. }));
    let boxes = || Boxes::Deviations(0.5);
    Kld::new(0.05, 0.99, boxes(), 10, 10).unwrap();
    for error in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(out(Kld::new(error, 0.99, boxes(), 10, 100)));
        assert!(out(Kld::new(0.05, 0.99, Boxes::Deviations(error), 10, 100)));
        let sides = vec![1.0, error];
        assert!(error == f64::INFINITY || out(Kld::new(0.05, 0.99, Boxes::Sides(sides), 10, 100)));
    }
    for confidence in [0.0, 1.0, -0.5, 2.0, f64::NAN] {
        assert!(out(Kld::new(0.05, confidence, boxes(), 10, 100)));
    }
    let too_many = (1 << 26) + 1;
    for (least, most) in [(0, 10), (11, 10), (10, too_many), (too_many, too_many)] {
        assert!(out(Kld::new(0.05, 0.99, boxes(), least, most)));
    }

    let ((motion, sensor), _) = walk();
    let filter = |size, trigger| {
        let settings = Settings { particles: 30, size, trigger, ..Settings::default() };
        ParticleFilter::new(prior(), motion, sensor, settings)
    };
    let below = Trigger::default();
    filter(Size::Recorded(vec![30, 40]), below).unwrap();
    assert!(filter(Size::Recorded(vec![30, 0]), below).is_err());
    assert!(filter(Size::Recorded(vec![30, too_many as u32]), below).is_err());
    assert!(matches!(filter(Size::Recorded(vec![40]), below), Err(Error::Shape { .. })));
    let sides = Kld::new(0.05, 0.99, Boxes::Sides(vec![1.0; 2]), 10, 100).unwrap();
    assert!(matches!(filter(Size::Kld(sides), below), Err(Error::Shape { .. })));
    assert!(matches!(filter(kld(), Trigger::Never), Err(Error::Unsupported(_))));
    let moving = ResampleMove::new(filter(kld(), below).unwrap(), Move::default(), 1);
    assert!(matches!(moving, Err(Error::Unsupported(_))));

    let good = Budget { least: 10, ..Budget::per_step(MILLI) };
    let timed =
        |size, trigger, budget| Deadline::new(filter(size, trigger).unwrap(), budget, || MILLI).map(|_| ());
    timed(Size::Fixed, below, good).unwrap();
    for bad in [
        Budget { step: Duration::ZERO, ..good },
        Budget { safety: 0.0, ..good },
        Budget { safety: 1.1, ..good },
        Budget { safety: f64::NAN, ..good },
        Budget { least: 0, ..good },
        Budget { least: 31, ..good },
        Budget { most: 29, ..good },
        Budget { least: 20, most: 10, ..good },
        Budget { most: too_many, ..good },
    ] {
        assert!(timed(Size::Fixed, below, bad).is_err(), "{bad:?}");
    }
    assert!(matches!(timed(kld(), below, good), Err(Error::Unsupported(_))));
    assert!(matches!(timed(Size::Fixed, Trigger::Never, good), Err(Error::Unsupported(_))));
}

/// A measurement that nobody explains, right after the number has changed: the guided filter takes back what
/// it did, particles and all, and goes on as if it had only predicted.
#[test]
fn an_impossible_measurement_is_taken_back() {
    let ((motion, sensor), seen) = walk();
    for lookahead in [None, Some(1.0)] {
        let size = Size::Recorded(vec![600, 1300, 200, 900, 40]);
        let trigger = Trigger::Always;
        let settings = Settings { particles: 600, size, trigger, lookahead, ..Settings::default() };
        let filter =
            ParticleFilter::guided(prior(), motion, sensor, Guided::<Tangent, 1>::new(Tangent), settings)
                .unwrap();
        let mut cloud = filter.start(Time::ZERO, Stream::new(4)).unwrap();
        for (k, (to, z)) in seen[..5].iter().enumerate() {
            let impossible = k == 2;
            let mut twin = cloud.clone();
            let z = if impossible { [1e200] } else { *z };
            let update = filter.step(&mut cloud, *to, Some(&z)).unwrap();
            assert_eq!(update.log_evidence == f64::NEG_INFINITY, impossible, "{k}: {update:?}");
            if impossible {
                filter.step(&mut twin, *to, None).unwrap();
                let text = |cloud: &Cloud<1>| serde_json::to_string(cloud).unwrap();
                assert_eq!(text(&cloud), text(&twin));
            }
        }
        assert_eq!(cloud.len(), 40);
    }
}
