//! Moving particles: gather the survivors of the last resampling, draw their noise, apply the model.

use super::noise::NoiseBlock;
use super::{LANES, Simd};
use crate::math::Lanes;
use crate::model::Motion;
use fearless_simd::{Simd as Token, f32x8, prelude::*};

/// Moves the particles of one block in place: `states[k][i] <- f(states[k][i], noise)`.
pub(crate) fn propagate<const N: usize, const W: usize, M: Motion<N, W>>(
    level: Simd,
    step: &M::Step,
    noise: &NoiseBlock<W>,
    states: &mut [&mut [f64]; N],
) {
    #[inline(always)]
    fn run<const N: usize, const W: usize, M: Motion<N, W>, S: Token>(
        simd: S,
        step: &M::Step,
        noise: &NoiseBlock<W>,
        states: &mut [&mut [f64]; N],
    ) {
        let count = states[0].len();
        let mut i = 0;
        while i + LANES <= count {
            let x = std::array::from_fn(|k| Lanes::load(simd, &states[k][i..i + LANES]));
            let w = std::array::from_fn(|k| noise_lanes(simd, noise, k, i));
            let y = M::apply(step, x, w);
            for k in 0..N {
                y[k].store(&mut states[k][i..i + LANES]);
            }
            i += LANES;
        }
        if i < count {
            let x = std::array::from_fn(|k| load_part(simd, &states[k][i..]));
            let w = std::array::from_fn(|k| noise_lanes(simd, noise, k, i));
            let y = M::apply(step, x, w);
            for k in 0..N {
                store_part(y[k], &mut states[k][i..]);
            }
        }
    }
    fn naive<const N: usize, const W: usize, M: Motion<N, W>>(
        step: &M::Step,
        noise: &NoiseBlock<W>,
        states: &mut [&mut [f64]; N],
    ) {
        for i in 0..states[0].len() {
            let x = std::array::from_fn(|k| states[k][i]);
            let y = M::apply(step, x, std::array::from_fn(|k| noise.number(k, i)));
            for k in 0..N {
                states[k][i] = y[k];
            }
        }
    }
    dispatch!(level, simd => run::<N, W, M, _>(simd, step, noise, states), naive => naive::<N, W, M>(step, noise, states));
}

/// `to[k][i] <- from[k][ancestors[i]]`. Every ancestor is below the length of the columns.
pub(crate) fn gather<const N: usize>(from: &[&[f64]; N], ancestors: &[u32], to: &mut [&mut [f64]; N]) {
    let len = from[0].len();
    assert!(from.iter().all(|c| c.len() == len) && to.iter().all(|c| c.len() == ancestors.len()));
    for (from, to) in from.iter().zip(to.iter_mut()) {
        for (to, &a) in to.iter_mut().zip(ancestors) {
            *to = from[a as usize];
        }
    }
}

#[inline(always)]
fn noise_lanes<const W: usize, S: Token>(simd: S, noise: &NoiseBlock<W>, row: usize, i: usize) -> Lanes<S> {
    let at = row * noise.width + i;
    if noise.is_double {
        Lanes::load(simd, &noise.double()[at..at + LANES])
    } else {
        let (a, b) = simd.widen_f32x8(f32x8::from_slice(simd, &noise.single()[at..at + LANES]));
        Lanes(a.combine(b))
    }
}

/// Fewer than eight numbers, filled up with copies of the first.
#[inline(always)]
pub(super) fn load_part<S: Token>(simd: S, from: &[f64]) -> Lanes<S> {
    let mut all = [from[0]; LANES];
    all[..from.len()].copy_from_slice(from);
    Lanes::load(simd, &all)
}

#[inline(always)]
pub(super) fn store_part<S: Token>(value: Lanes<S>, to: &mut [f64]) {
    let mut all = [0.0; LANES];
    value.store(&mut all);
    to.copy_from_slice(&all[..to.len()]);
}
