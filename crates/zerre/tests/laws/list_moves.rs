//! Filters that move their particles by Markov kernels, for the list.

use crate::list::{Class, Entry, Estimates, Means, Sensor, UnderLaw, World};
use zerre::belief::{MovedCloud, SwarmBelief};
use zerre::filter::{
    Fitness, McmcSettings, ParticleFilter, Readings, ResampleMove, SequentialMcmc, Settings, SwarmFilter,
    SwarmImportance, Tempered,
};
use zerre::math::Matrix;
use zerre::moves::Move;
use zerre::resample::Trigger;
use zerre::swarm::{BeeColony, Coordinates, ParticleSwarm, Positions, Roulette, Swarm};

pub fn filters<H: Sensor>(world: &World<H>, means: &Means) -> Vec<Entry> {
    let &World { prior, motion, sensor } = world;
    let Means { particles, simd, ref threads } = *means;
    let mut list = Vec::new();
    let mut add = |name: String, filter: Box<dyn UnderLaw>| {
        list.push(Entry { name, class: Class::Consistent, filter });
    };
    for kernel in [Move::default(), Move::Stretch, Move::Gibbs] {
        let settings = Settings { particles, simd, threads: threads.clone(), ..Settings::default() };
        let inside = ParticleFilter::new(prior, motion, sensor, settings).unwrap();
        let moving = ResampleMove::new(inside, kernel, 2).unwrap();
        add(format!("resample-move, {kernel:?}"), Box::new(moving));
    }
    for (kernel, sweeps) in [(Move::default(), 0), (Move::default(), 2), (Move::Stretch, 2), (Move::Gibbs, 1)]
    {
        let threads = threads.clone();
        let settings = McmcSettings { particles, kernel, sweeps, simd, threads, ..McmcSettings::default() };
        let chain = SequentialMcmc::new(prior, motion, sensor, settings).unwrap();
        add(format!("sequential MCMC, {sweeps} x {kernel:?}"), Box::new(chain));
    }
    // Swarms of all kinds, as proposals: the law is that they do not matter.
    let swarms = [
        Swarm::Bees(BeeColony { cycles: 2, ..BeeColony::default() }),
        Swarm::Bees(BeeColony {
            coordinates: Coordinates::All,
            roulette: Roulette::CostRatio,
            ..BeeColony::default()
        }),
        Swarm::Particles(ParticleSwarm { positions: Positions::PersonalBest, ..ParticleSwarm::default() }),
    ];
    // Their cost grows with the square of the number of particles.
    let settings = |particles, trigger| Settings {
        particles,
        trigger,
        simd,
        threads: threads.clone(),
        ..Settings::default()
    };
    for swarm in swarms {
        let settings = settings(particles.min(200), Trigger::default());
        let inside = ParticleFilter::new(prior, motion, sensor, settings).unwrap();
        let filter = Box::new(SwarmImportance::new(inside, swarm).unwrap());
        list.push(Entry { name: format!("importance by {swarm:?}"), class: Class::Elsewhere, filter });
    }
    for (kernel, share) in [(Move::default(), 0.5), (Move::Stretch, 0.9)] {
        let inside =
            ParticleFilter::new(prior, motion, sensor, settings(particles, Trigger::default())).unwrap();
        let filter = Tempered::new(inside, kernel, 2).unwrap().with_share(share).unwrap();
        // The powers are chosen by the particles: with a share of .9 there are about ten of them in a step.
        let class = Class::Approximate { bias: 10.0 };
        list.push(Entry { name: format!("tempered, {kernel:?}"), class, filter: Box::new(filter) });
    }
    for (swarm, fitness) in
        swarms.into_iter().zip([Fitness::Likelihood, Fitness::Posterior, Fitness::Likelihood])
    {
        let n = if fitness == Fitness::Posterior { particles.min(200) } else { particles };
        let inside = ParticleFilter::new(prior, motion, sensor, settings(n, Trigger::Always)).unwrap();
        let readings = Readings { fitness, repetitions: 2, ..Readings::default() };
        let filter = Box::new(SwarmFilter::new(inside, swarm, readings).unwrap());
        let name = format!("moved by {swarm:?} for the {fitness:?}");
        list.push(Entry { name, class: Class::Reproduction, filter });
    }
    list
}

impl Estimates for SwarmBelief<4> {
    fn mean(&self) -> [f64; 4] {
        self.estimate()
    }
    fn covariance(&self) -> Matrix<4, 4> {
        self.cloud().covariance()
    }
}

impl Estimates for MovedCloud<4> {
    fn mean(&self) -> [f64; 4] {
        self.cloud().mean()
    }
    fn covariance(&self) -> Matrix<4, 4> {
        self.cloud().covariance()
    }
}
