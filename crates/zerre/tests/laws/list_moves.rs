//! Filters that move their particles by Markov kernels, for the list.

use crate::list::{Class, Entry, Estimates, Means, Sensor, UnderLaw, World};
use zerre::belief::MovedCloud;
use zerre::filter::{McmcSettings, ParticleFilter, ResampleMove, SequentialMcmc, Settings};
use zerre::math::Matrix;
use zerre::moves::Move;

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
    list
}

impl Estimates for MovedCloud<4> {
    fn mean(&self) -> [f64; 4] {
        self.cloud().mean()
    }
    fn covariance(&self) -> Matrix<4, 4> {
        self.cloud().covariance()
    }
}
