//! Particle filters whose number of particles changes, for the list.

use crate::list::{Class, Entry, Estimates, Means, RESAMPLINGS, Sensor, World, entry};
use crate::worlds;
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use zerre::belief::PacedCloud;
use zerre::filter::{
    Boxes, Budget, Deadline, Kernel, Kld, ParticleFilter, Rejuvenation, Settings, Size, Tangent,
};
use zerre::math::Matrix;
use zerre::proposal::Guided;
use zerre::resample::Trigger;
use zerre::rng::Stream;

/// Numbers for the steps of a run that begins with `particles`: fewer, more, the same.
fn numbers(particles: usize) -> Vec<u32> {
    let shares = [1.0, 0.5, 2.0, 2.0, 0.6, 1.3, 1.0, 0.5, 1.7, 0.8, 1.0, 0.7];
    shares.map(|share| (share * particles as f64).ceil() as u32).to_vec()
}

pub fn filters<H: Sensor>(world: &World<H>, means: &Means) -> Vec<Entry> {
    let &World { prior, motion, sensor } = world;
    let Means { particles, simd, ref threads } = *means;
    let plain = Settings { particles, simd, threads: threads.clone(), ..Settings::default() };
    let always = Settings { trigger: Trigger::Always, ..plain.clone() };
    // An error by which a normal law of four components asks for about as many as there are.
    let kld = |boxes| {
        let (least, most) = (particles.div_ceil(3), 2 * particles);
        Size::Kld(Kld::new(100.0 / particles as f64, 0.99, boxes, least, most).unwrap())
    };
    let deviations = || kld(Boxes::Deviations(2.0));
    let sides = || kld(Boxes::Sides(vec![2.0, 2.0, 1.0, f64::INFINITY]));
    let recorded = || Size::Recorded(numbers(particles));
    let mut list = Vec::new();

    let mut add = |name: String, settings| {
        let filter = ParticleFilter::new(prior, motion, sensor, settings).unwrap();
        list.push(entry(name, Class::Consistent, filter));
    };
    add("KLD sampling".into(), Settings { size: deviations(), ..plain.clone() });
    add("KLD sampling, sides, always".into(), Settings { size: sides(), ..always.clone() });
    let ahead = |size| Settings { size, lookahead: Some(1.0), ..plain.clone() };
    add("KLD sampling, auxiliary".into(), ahead(deviations()));
    add("recorded numbers, auxiliary".into(), ahead(recorded()));
    for resampling in RESAMPLINGS {
        let settings = Settings { size: recorded(), resampling, ..plain.clone() };
        add(format!("recorded numbers, {resampling:?}"), settings);
    }
    let rejuvenation = Rejuvenation::Regularise { kernel: Kernel::Gaussian, shrink: true };
    let settings = Settings { size: recorded(), rejuvenation, ..always.clone() };
    add("recorded numbers, regularised".into(), settings);

    for (name, size) in [("KLD sampling", deviations()), ("recorded numbers", recorded())] {
        let proposal = Guided::<Tangent, 2>::new(Tangent);
        let settings = Settings { size, ..plain.clone() };
        let filter = ParticleFilter::guided(prior, motion, sensor, proposal, settings).unwrap();
        list.push(entry(format!("{name}, EKF-guided"), Class::Consistent, filter));
    }

    // A clock by which every step takes a microsecond, whatever it does.
    for (name, micros) in [("too much", 3), ("too little", 1)] {
        let filter = ParticleFilter::new(prior, motion, sensor, plain.clone()).unwrap();
        let budget = Budget {
            step: Duration::from_micros(micros),
            safety: 0.8,
            least: particles.div_ceil(2),
            most: 2 * particles,
        };
        let now = AtomicU64::new(0);
        let clock = move || Duration::from_micros(now.fetch_add(1, Ordering::Relaxed));
        let timed = Deadline::new(filter, budget, clock).unwrap();
        list.push(entry(format!("deadline, {name} time"), Class::Consistent, timed));
    }
    list
}

impl Estimates for PacedCloud<4> {
    fn mean(&self) -> [f64; 4] {
        self.cloud().mean()
    }
    fn covariance(&self) -> Matrix<4, 4> {
        self.cloud().covariance()
    }
}

/// Without that the laws would say nothing of them.
#[test]
fn the_numbers_of_the_list_do_change() {
    let world = worlds::linear(2.0);
    let (script, _) = worlds::script(&world, Stream::new(5));
    for entry in filters(&world, &Means::serial(2000)) {
        let mut run = entry.filter.begin(Stream::new(41));
        let number = |(to, z): &worlds::Seen| run.step(*to, z.as_ref()).unwrap().particles.unwrap().particles;
        let numbers: Vec<usize> = script.iter().map(number).collect();
        let distinct: BTreeSet<&usize> = numbers.iter().collect();
        assert!(distinct.len() >= 2, "{}: {numbers:?}", entry.name);
    }
}
