//! Expectation maximisation over all scans at once, the path by a particle smoother (Özkan 2019, equations 13
//! and 14).

use super::centre::{Centre, check};
use super::scan::{Lobes, MOMENTS, PointScan, expect};
use super::shape::Shape;
use super::statistics::{MStep, Sums};
use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::filter::{Filter, ParticleFilter, Settings};
use crate::math::Matrix;
use crate::model::Motion;
use crate::rng::Stream;
use crate::smooth::{Backward, History, backward_paths};
use crate::time::Time;
use std::array::from_fn;

/// Settings of [`batch_em`].
#[derive(Clone, Debug)]
pub struct BatchSettings {
    /// Turns between the path and the shape, 30 by default.
    pub iterations: usize,
    /// Paths drawn backwards in each, 50 by default.
    pub paths: usize,
    /// How they are drawn.
    pub backward: Backward,
    /// How the shape follows from the statistics.
    pub m_step: MStep,
    /// Noise of the sensor on each point, m^2.
    pub noise: Matrix<2, 2>,
    /// The particle filter.
    pub particles: Settings,
}

impl Default for BatchSettings {
    fn default() -> Self {
        BatchSettings {
            iterations: 30,
            paths: 50,
            backward: Backward::default(),
            m_step: MStep::default(),
            noise: Matrix::ZERO,
            particles: Settings::default(),
        }
    }
}

/// What [`batch_em`] gives.
#[derive(Clone, Debug, PartialEq)]
pub struct BatchFit<const N: usize> {
    /// The shape of the last iteration.
    pub shape: Shape,
    /// Smoothed means of the states at the scans, under the shape before it.
    pub states: Vec<[f64; N]>,
    /// Estimates of ln p of all points under the shape that each iteration started from.
    pub log_likelihoods: Vec<f64>,
}

/// The shape that is most likely under all scans, and the path: in turns, paths drawn backwards through a
/// particle filter of the present shape, and the shape that is most likely under the points shared among its
/// ellipses along these paths.
///
/// # Errors
/// No iterations, scans that are not finite or out of order, a scan that no particle explains, a motion
/// without [`TransitionDensity`](crate::model::TransitionDensity).
pub fn batch_em<A, C, const N: usize, const W: usize>(
    (motion, centre): (&A, &C),
    (from, prior, first): (Time, Gaussian<N>, &Shape),
    scans: &[(Time, Vec<[f64; 2]>)],
    settings: &BatchSettings,
    stream: Stream,
) -> Result<BatchFit<N>>
where
    A: Motion<N, W> + Clone,
    C: Centre<N>,
{
    settings.m_step.check()?;
    Error::positive("iterations", settings.iterations as f64)?;
    scans.iter().try_for_each(|(_, points)| check(points))?;
    let mut fit = BatchFit { shape: first.clone(), states: Vec::new(), log_likelihoods: Vec::new() };
    let mut sums = vec![Sums::default(); first.len()];
    for turn in 0..settings.iterations {
        let stream = stream.fork(turn as u64);
        let scan = PointScan::new(centre.clone(), fit.shape.clone(), &settings.noise)?;
        let filter = ParticleFilter::new(prior, motion.clone(), scan, settings.particles.clone())?;
        let mut cloud = filter.start(from, stream)?;
        let mut history = History::new();
        history.record(&cloud)?;
        let mut log_likelihood = 0.0;
        for (to, points) in scans {
            log_likelihood += filter.step(&mut cloud, *to, Some(points))?.log_evidence;
            history.record(&cloud)?;
        }
        Error::finite("log-likelihood of the scans", log_likelihood)?;
        fit.log_likelihoods.push(log_likelihood);
        let threads = &settings.particles.threads;
        let paths =
            backward_paths(motion, &history, settings.paths, settings.backward, stream.fork(0), threads)?;
        let lobes = Lobes::of(&fit.shape.blurred(&settings.noise))?;
        let mut all = vec![0.0; MOMENTS * first.len()];
        let part = 1.0 / settings.paths as f64;
        fit.states.clear();
        for (k, (_, points)) in scans.iter().enumerate() {
            let mut mean = [0.0; N];
            for x in (0..settings.paths).filter_map(|j| paths.state(k + 1, j)) {
                expect::<f64, true>(lobes.all(), points, centre.at(x), part, &mut all);
                mean = from_fn(|i| part.mul_add(x[i], mean[i]));
            }
            fit.states.push(mean);
        }
        for (sums, s) in sums.iter_mut().zip(all.chunks_exact(MOMENTS)) {
            *sums = Sums::from_moments(s);
        }
        fit.shape = settings.m_step.shape(&sums, first, &settings.noise)?;
    }
    Ok(fit)
}
