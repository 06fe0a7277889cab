//! Law 4: neither the SIMD level nor the number of threads changes a bit.

use crate::list::{Means, RESAMPLINGS, UnderLaw, filters};
use crate::{Verdict, uphold, worlds};
use zerre::Time;
use zerre::belief::Cloud;
use zerre::filter::{Boxes, Filter, Kld, ParticleFilter, Settings, Size};
use zerre::kernels::{Simd, Threads};
use zerre::model::measurement::Position;
use zerre::model::{Likelihood, Measurement};
use zerre::resample::Trigger;
use zerre::rng::Stream;

/// Beliefs and updates of a whole run, as text.
fn account(filter: &dyn UnderLaw, script: &[worlds::Seen]) -> String {
    let mut run = filter.begin(Stream::new(12));
    let mut text = String::new();
    for (to, z) in script {
        let update = run.step(*to, z.as_ref()).unwrap();
        text += &format!("{update:?} {:?} {:?} {}\n", run.mean(), run.covariance(), run.save());
    }
    text
}

/// Three blocks and a rest.
const PARTICLES: usize = 771;

#[test]
fn every_filter_on_every_level() {
    let world = worlds::linear(1.0);
    let (script, _) = worlds::script(&world, Stream::new(2));
    let list = |simd| filters(&world, &Means { simd, ..Means::serial(PARTICLES) });
    let naive = list(Simd::scalar());
    for level in Simd::available() {
        uphold(list(level).iter().zip(&naive).map(|(a, b)| {
            let same = account(&*a.filter, &script) == account(&*b.filter, &script);
            (a.name.clone(), if same { Ok(()) } else { Err(format!("{} is not scalar", level.name())) })
        }));
    }
}

/// Bits of states, weights, ancestors' children and estimates over a few steps.
fn bits<H>(sensor: H, settings: Settings, steps: u32) -> Vec<u64>
where
    H: Likelihood<4, Value = [f64; 2]>,
{
    let world = worlds::linear(1.0);
    let filter = ParticleFilter::new(world.prior, world.motion, sensor, settings).unwrap();
    let mut cloud: Cloud<4> = filter.start(Time::ZERO, Stream::new(33)).unwrap();
    let mut bits = Vec::new();
    for k in 0..steps {
        let z = [f64::from(k), -0.5 * f64::from(k)];
        let update = filter.step(&mut cloud, Time::from_secs(0.8 * f64::from(k)), Some(&z)).unwrap();
        let particles = update.particles.unwrap();
        bits.extend([update.log_evidence.to_bits(), particles.ess.to_bits()]);
        bits.push(particles.distinct_ancestors as u64);
        bits.extend(cloud.mean().map(f64::to_bits));
        bits.extend(cloud.weights().map(f64::to_bits));
        for k in 0..4 {
            bits.extend(cloud.column(k).iter().map(|x| x.to_bits()));
        }
    }
    bits
}

/// The law for threads.
fn indifferent_to_threads<H>(sensor: impl Fn() -> H, settings: &Settings, steps: u32) -> Verdict
where
    H: Likelihood<4, Value = [f64; 2]>,
{
    let serial = bits(sensor(), settings.clone(), steps);
    for count in [1, 2, 4] {
        let threads = Threads::Pool(pool(count));
        if bits(sensor(), Settings { threads, ..settings.clone() }, steps) != serial {
            return Err(format!("{count} threads are not one"));
        }
    }
    Ok(())
}

fn pool(count: usize) -> std::sync::Arc<rayon::ThreadPool> {
    std::sync::Arc::new(rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap())
}

#[test]
fn every_resampler_on_every_number_of_threads() {
    let sensor = || worlds::linear(1.0).sensor;
    for particles in [1, 255, 256, 4096, 4097, 20_001, 100_000] {
        uphold(RESAMPLINGS.into_iter().flat_map(|resampling| {
            [Trigger::Always, Trigger::Below(0.5)].map(|trigger| {
                let settings = Settings { particles, resampling, trigger, ..Settings::default() };
                let name = format!("{resampling:?} {trigger:?}, {particles} particles");
                (name, indifferent_to_threads(sensor, &settings, 3))
            })
        }));
    }
}

#[test]
fn changing_numbers_on_every_number_of_threads() {
    let sensor = || worlds::linear(1.0).sensor;
    let kld = Kld::new(0.01, 0.99, Boxes::Deviations(1.0), 5000, 30_000).unwrap();
    let recorded = vec![20_001, 3000, 9000, 9000, 30_000];
    for size in [Size::Kld(kld), Size::Recorded(recorded)] {
        for lookahead in [None, Some(1.0)] {
            let size = size.clone();
            let settings = Settings { particles: 20_001, size, lookahead, ..Settings::default() };
            indifferent_to_threads(sensor, &settings, 5).unwrap();
        }
    }
}

/// A sensor whose result depends on who asks.
struct Partisan(Position<2>);

impl Likelihood<4> for Partisan {
    type Value = [f64; 2];
    type Digest<'z> = <Position<2> as Measurement<4>>::Given<'z>;
    fn digest<'z>(&'z self, z: &'z [f64; 2], at: Time) -> zerre::Result<Self::Digest<'z>> {
        Measurement::<4>::given(&self.0, z, at)
    }
    fn score(digest: &Self::Digest<'_>, simd: Simd, states: &[&[f64]; 4], out: &mut [f64]) {
        <Position<2> as Likelihood<4>>::score(digest, simd, states, out);
        if simd.name() != "scalar" || rayon::current_thread_index().is_some() {
            out[0] = f64::from_bits(out[0].to_bits() + 1);
        }
    }
}

#[test]
fn the_law_finds_a_difference_in_the_last_bit() {
    let sensor = || Partisan(worlds::linear(1.0).sensor);
    let settings = Settings { particles: 5000, simd: Simd::scalar(), ..Settings::default() };
    assert!(indifferent_to_threads(sensor, &settings, 2).is_err());
    for simd in Simd::available().into_iter().skip(1) {
        let one = bits(sensor(), settings.clone(), 2);
        assert_ne!(one, bits(sensor(), Settings { simd, ..settings.clone() }, 2));
    }
}
