//! Law 3: every SIMD level gives the bits of the naive twins, for every number of particles, model, generator and
//! scheme. The public path goes through all kernels: noise, gather, propagation, scoring, weighing, resampling.

use crate::list::{RESAMPLINGS, SOURCES};
use crate::worlds;
use zerre::belief::Gaussian;
use zerre::filter::{Filter, ParticleFilter, Settings};
use zerre::kernels::Simd;
use zerre::math::{Matrix, Real};
use zerre::model::measurement::{self, Linear, RangeBearing};
use zerre::model::motion::{Growth, MarkovTurn, UpfGrowth};
use zerre::model::{Likelihood, Measurement, Motion};
use zerre::resample::Trigger;
use zerre::rng::Stream;
use zerre::{Result, Time};

/// A model of a user's own that calls everything that [`Real`] has.
#[derive(Clone, Copy)]
struct Everything;

impl Motion<2, 3> for Everything {
    type Step = f64;
    fn over(&self, from: Time, to: Time) -> Result<f64> {
        Ok((to - from).secs())
    }
    #[inline(always)]
    fn apply<R: Real>(&dt: &f64, [x, v]: [R; 2], w: [R; 3]) -> [R; 2] {
        let (s, c) = (x * 0.3 - w[0]).sin_cos();
        let turn = s.atan2(c + 0.1).abs();
        let pull = ((-x.square() / 50.0).exp() + 1.0).ln();
        let near = x.if_lt(v, x.max(w[1]), v.min(w[1]));
        let far = x.hypot(v).sqrt();
        [
            (v * dt).mul_add(x.constant(0.25), x * 0.5 + near + w[0] * 0.7),
            (v - turn * pull).log_add_exp(w[2] - far) + c - 1.0,
        ]
    }
}

impl Measurement<2> for Everything {
    type Value = f64;
    type Given<'z> = f64;
    fn given(&self, z: &f64, _: Time) -> Result<f64> {
        zerre::Error::finite("value", *z)
    }
    #[inline(always)]
    fn log_likelihood<R: Real>(&z: &f64, [x, v]: [R; 2]) -> R {
        let e = (x + v * 0.1 - z).abs();
        let tail = -(e.sqrt() + 1.0).ln() * 2.0;
        (-(e * e) * 0.5).log_add_exp(tail)
    }
}

/// Bits of a run of four steps, one of them without a measurement and one without time.
fn bits<const N: usize, const W: usize, M: Motion<N, W>, H: Likelihood<N>>(
    (prior, motion, sensor): (Gaussian<N>, M, H),
    z: &H::Value,
    settings: Settings,
) -> Vec<u64> {
    let filter = ParticleFilter::new(prior, motion, sensor, settings).unwrap();
    let mut cloud = filter.start(Time::ZERO, Stream::new(6)).unwrap();
    let mut bits = Vec::new();
    for (t, seen) in [(0.0, true), (1.0, true), (1.7, false), (1.7, true), (3.0, true)] {
        let update = filter.step(&mut cloud, Time::from_secs(t), seen.then_some(z)).unwrap();
        let particles = update.particles.unwrap();
        bits.extend([update.log_evidence.to_bits(), particles.ess.to_bits()]);
        bits.push(particles.distinct_ancestors as u64);
        bits.extend(cloud.mean().map(f64::to_bits));
        bits.extend(cloud.weights().map(f64::to_bits));
        (0..N).for_each(|k| bits.extend(cloud.column(k).iter().map(|x| x.to_bits())));
    }
    bits
}

type Model = (&'static str, Box<dyn Fn(Settings) -> Vec<u64>>);

fn models() -> Vec<Model> {
    let linear =
        Linear::new([[1.0, 0.2, 0.0, 0.1], [0.0, 1.0, -0.3, 0.0]], [[2.0, 0.5], [0.5, 1.0]]).unwrap();
    let growth = || Gaussian::new([0.0], Matrix([[5.0]])).unwrap();
    vec![
        (
            "constant velocity, range and bearing",
            Box::new(|s| {
                let world = worlds::linear(1.0);
                let radar = RangeBearing::new([-6.0, 12.0], 0.1, 0.01).unwrap();
                bits((world.prior, world.motion, radar), &[13.0, -1.1], s)
            }),
        ),
        (
            "constant velocity, linear",
            Box::new(move |s| {
                bits((worlds::linear(1.0).prior, worlds::linear(1.0).motion, linear), &[1.0, 0.3], s)
            }),
        ),
        (
            "turn of unknown rate, position",
            Box::new(|s| {
                let prior =
                    Gaussian::independent([0.0, 0.0, 5.0, 1.0, 0.1], [2.0, 2.0, 1.0, 1.0, 0.3]).unwrap();
                let turn = MarkovTurn::new(0.3, 0.2, 10.0).unwrap();
                bits((prior, turn, measurement::Position::<2>::new(1.5).unwrap()), &[2.0, 1.0], s)
            }),
        ),
        (
            "growth",
            Box::new(move |s| {
                let sensor = measurement::Growth::new(1.0).unwrap();
                bits((growth(), Growth::new(10.0).unwrap(), sensor), &[3.0], s)
            }),
        ),
        (
            "growth with gamma noise",
            Box::new(move |s| {
                let sensor = measurement::UpfGrowth::new(1.0).unwrap();
                bits((growth(), UpfGrowth::new(3.0, 2.0).unwrap(), sensor), &[3.0], s)
            }),
        ),
        (
            "a user's own",
            Box::new(|s| {
                let prior = Gaussian::independent([0.5, -1.0], [2.0, 1.0]).unwrap();
                bits((prior, Everything, Everything), &0.7, s)
            }),
        ),
    ]
}

/// The law: how the bits of a level differ from the naive twin's.
fn parity(run: &dyn Fn(Settings) -> Vec<u64>, settings: &Settings) -> crate::Verdict {
    let naive = run(Settings { simd: Simd::scalar(), ..settings.clone() });
    for simd in Simd::available().into_iter().skip(1) {
        if run(Settings { simd, ..settings.clone() }) != naive {
            return Err(format!("{} is not scalar", simd.name()));
        }
    }
    Ok(())
}

/// Every combination of source, scheme and trigger, by number.
fn combination(number: usize, particles: usize) -> Settings {
    let trigger = [Trigger::Always, Trigger::Below(0.5), Trigger::Never][number / 16 % 3];
    let (noise, resampling) = (SOURCES[number % 4], RESAMPLINGS[number / 4 % 4]);
    Settings { particles, noise, resampling, trigger, ..Settings::default() }
}

/// Sizes beside lanes, vectors and blocks, in every combination.
#[test]
fn at_the_borders() {
    for (name, run) in models() {
        for particles in [1, 7, 8, 9, 63, 64, 65, 255, 256, 257, 1023, 1025] {
            for number in 0..48 {
                let settings = combination(number, particles);
                parity(&run, &settings).unwrap_or_else(|e| panic!("{name}, {settings:?}: {e}"));
            }
        }
    }
}

/// All sizes; the combinations take turns.
#[test]
fn at_every_size() {
    for (m, (name, run)) in models().into_iter().enumerate() {
        for particles in 1..=1100 {
            let settings = combination(particles * 7 + m, particles);
            parity(&run, &settings).unwrap_or_else(|e| panic!("{name}, {settings:?}: {e}"));
        }
    }
}

/// The last digit of one particle's likelihood, on all levels but the naive one.
struct Sloppy;

impl Likelihood<2> for Sloppy {
    type Value = f64;
    type Digest<'z> = f64;
    fn digest(&self, z: &f64, _: Time) -> Result<f64> {
        Ok(*z)
    }
    fn score(z: &f64, simd: Simd, states: &[&[f64]; 2], out: &mut [f64]) {
        <Everything as Likelihood<2>>::score(z, simd, states, out);
        if simd.name() != "scalar" {
            let last = out.len() - 1;
            out[last] = f64::from_bits(out[last].to_bits() ^ 1);
        }
    }
}

#[test]
fn the_law_finds_a_difference_in_the_last_bit() {
    let prior = Gaussian::independent([0.5, -1.0], [2.0, 1.0]).unwrap();
    let run = |settings| bits((prior, Everything, Sloppy), &0.7, settings);
    let levels = Simd::available().len();
    for particles in [1, 100, 1000] {
        assert_eq!(parity(&run, &combination(0, particles)).is_err(), levels > 1);
    }
}
