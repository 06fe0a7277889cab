//! The conditional particle filter with ancestor sampling (Lindsten, Jordan and Schön, Journal of Machine
//! Learning Research 15, 2014, algorithm 2).

use super::backward::{Backward, Tables};
use super::history::Record;
use crate::belief::MAX_PARTICLES;
use crate::error::{Error, Result};
use crate::filter::Prior;
use crate::kernels::{self, BLOCK, NoiseBlock, NoiseKey, NoiseSource, Resolution, Simd, Source};
use crate::math::{exp, ln};
use crate::model::state_space::path_fits;
use crate::model::{Likelihood, Motion, StateSpace};
use crate::rng::{Purpose, Stream};
use crate::time::Time;
use std::borrow::Borrow;

/// A path, the state at `start` and then at the time of each of `data`, drawn by a particle filter of
/// `particles` that resamples before every step (multinomially) and follows one of its last particles back.
///
/// With a `reference`, one particle is pinned to that path, and at every step its ancestor is drawn anew
/// among all particles, with probability proportional to w_i p(reference | x_i). This is a Markov kernel that
/// leaves p(x | z) as it is for any number of particles from two on; with more of them the path forgets the
/// reference sooner. Without one, the path is a first guess.
///
/// # Errors
/// Fewer than two particles or more than 2^26; data out of order; a reference of another length, or one that
/// moves where no time passes; a motion without [`TransitionDensity`](crate::model::TransitionDensity);
/// measurements that no particle gives any likelihood; what the models refuse.
pub fn conditional_path<A, H, Z, const N: usize, const W: usize>(
    model: &StateSpace<N, A, H>,
    (start, data): (Time, &[(Time, Option<Z>)]),
    reference: Option<&[[f64; N]]>,
    particles: usize,
    stream: Stream,
) -> Result<Vec<[f64; N]>>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    Z: Borrow<H::Value>,
{
    if !(2..=MAX_PARTICLES).contains(&particles) {
        let needs = "it must lie between 2 and 2^26";
        return Err(Error::OutOfRange { what: "number of particles", value: particles as f64, needs });
    }
    if let Some(reference) = reference {
        path_fits(reference, data.len())?;
    }
    let (simd, pinned) = (Simd::best(), particles - 1);
    let pin = |states: &mut [Vec<f64>; N], k: usize| {
        if let Some(reference) = reference {
            states.iter_mut().zip(reference[k]).for_each(|(column, x)| column[pinned] = x);
        }
    };
    let mut states = model.prior.columns(stream, particles)?;
    pin(&mut states, 0);
    let mut records = Vec::with_capacity(data.len() + 1);
    let mut last = Record::first(start, states);
    let mut tables = Tables::default();
    let mut scores = vec![0.0; particles];
    for (k, (to, z)) in (1..).zip(data) {
        if *to < last.time {
            return Err(Error::OutOfOrder { from: last.time, to: *to });
        }
        let mut states = last.states.clone();
        let mut survivors = None;
        if let Some(density) = tables.prepare(&model.motion, &last, *to)? {
            let mut draws = stream.draws(Purpose::Resample, k as u64, 0);
            let mut ancestors: Vec<u32> =
                (0..particles).map(|_| tables.pick(draws.uniform()) as u32).collect();
            if let Some(reference) = reference {
                let exact = Backward::Rejection { tries: 0 };
                let parent = tables.draw(&density, &last, reference[k], pinned, exact, &mut draws)?;
                ancestors[pinned] = parent as u32;
            }
            for (column, from) in states.iter_mut().zip(&last.states) {
                column.iter_mut().zip(&ancestors).for_each(|(x, &a)| *x = from[a as usize]);
            }
            let step = model.motion.over(last.time, *to)?;
            let source = NoiseSource { resolution: Resolution::Bits64, ..NoiseSource::default() };
            let mut noise = NoiseBlock::<W>::new();
            for (block, first) in (0..particles).step_by(BLOCK).enumerate() {
                let range = first..particles.min(first + BLOCK);
                let key = NoiseKey { stream, purpose: Purpose::Motion, step: k as u64, block };
                let count = (range.len(), model.motion.noise_components());
                kernels::fill_noise(simd, source, model.motion.noise(), key, count, &mut noise);
                let mut states = states.each_mut().map(|c| &mut c[range.clone()]);
                kernels::propagate::<N, W, A>(simd, &step, &noise, Source::Here, &mut states);
            }
            pin(&mut states, k);
            survivors = Some(ancestors);
        } else if reference.is_some_and(|path| path[k] != path[k - 1]) {
            let why = format!("the reference moves at {to} s, where no time passes");
            return Err(Error::Unsupported(why));
        }
        scores.fill(0.0);
        if let Some(z) = z {
            let digest = model.sensor.digest(z.borrow(), *to)?;
            H::score(&digest, simd, &states.each_ref().map(Vec::as_slice), &mut scores);
        }
        if survivors.is_none() {
            // Nobody was resampled: the weights of before count.
            scores.iter_mut().zip(&last.weights).for_each(|(score, &w)| *score += ln(w));
        }
        let weights = weights_of(&scores).ok_or_else(|| {
            Error::Unsupported(format!("no particle gives the measurement at {to} s any likelihood"))
        })?;
        let next = last.next(survivors, (*to, states, weights));
        records.push(std::mem::replace(&mut last, next));
    }
    tables.choose_from(&last);
    let mut at = tables.pick(stream.draws(Purpose::Path, 0, 0).uniform());
    let mut path = vec![last.state(at); data.len() + 1];
    for (state, record) in path.iter_mut().zip(&records).rev() {
        at = record.parent(at);
        *state = record.state(at);
    }
    Ok(path)
}

/// Normalised weights from their logarithms; numbers that are none count as a weight of zero. `None` where
/// all are.
fn weights_of(logs: &[f64]) -> Option<Vec<f64>> {
    let fine = |log: &f64| *log > f64::NEG_INFINITY && *log < f64::INFINITY;
    let max = logs.iter().copied().filter(fine).fold(f64::NEG_INFINITY, f64::max);
    let mut weights: Vec<f64> = logs.iter().map(|log| if fine(log) { exp(log - max) } else { 0.0 }).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|w| *w /= sum);
    (sum > 0.0).then_some(weights)
}
