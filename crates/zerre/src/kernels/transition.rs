//! Densities between many states: rows for backward simulation, direct sums for grids, pairs for moves.

use super::propagate::{load_part, store_part};
use super::{LANES, Simd};
use crate::math::{Lanes, Real};
use crate::model::{Motion, TransitionDensity};
use fearless_simd::Simd as Token;

/// `out[k][i] <- f(states[..][i], E w)`.
pub(crate) fn centres<A: Motion<N, W>, const N: usize, const W: usize>(
    level: Simd,
    density: &TransitionDensity<A, N, W>,
    states: &[&[f64]; N],
    out: &mut [&mut [f64]; N],
) {
    #[inline(always)]
    fn run<A: Motion<N, W>, S: Token, const N: usize, const W: usize>(
        simd: S,
        density: &TransitionDensity<A, N, W>,
        states: &[&[f64]; N],
        out: &mut [&mut [f64]; N],
    ) {
        for first in (0..states[0].len()).step_by(LANES) {
            let range = first..states[0].len().min(first + LANES);
            let centre = density.centre(states.map(|c| load_part(simd, &c[range.clone()])));
            for k in 0..N {
                store_part(centre[k], &mut out[k][range.clone()]);
            }
        }
    }
    fn naive<A: Motion<N, W>, const N: usize, const W: usize>(
        density: &TransitionDensity<A, N, W>,
        states: &[&[f64]; N],
        out: &mut [&mut [f64]; N],
    ) {
        for i in 0..states[0].len() {
            let centre = density.centre(states.map(|c| c[i]));
            for k in 0..N {
                out[k][i] = centre[k];
            }
        }
    }
    dispatch!(level, simd => run(simd, density, states, out), naive => naive(density, states, out));
}

/// `out[i] <- weights[i] p(to | x_i) e^-offset` for the states whose `centres` these are.
pub(crate) fn transition_row<A: Motion<N, W>, const N: usize, const W: usize>(
    level: Simd,
    density: &TransitionDensity<A, N, W>,
    to: [f64; N],
    (centres, weights): (&[&[f64]; N], &[f64]),
    offset: f64,
    out: &mut [f64],
) {
    #[inline(always)]
    fn run<A: Motion<N, W>, S: Token, const N: usize, const W: usize>(
        simd: S,
        density: &TransitionDensity<A, N, W>,
        to: [f64; N],
        (centres, weights): (&[&[f64]; N], &[f64]),
        offset: f64,
        out: &mut [f64],
    ) {
        let to = to.map(|x| Lanes::splat(simd, x));
        let whole = out.len() / LANES * LANES;
        let centres = *centres;
        assert!(weights.len() == out.len() && centres.iter().all(|c| c.len() == out.len()));
        let mut r = to;
        for i in (0..whole).step_by(LANES) {
            for k in 0..N {
                r[k] = to[k] - Lanes::load(simd, &centres[k][i..i + LANES]);
            }
            let density = (density.log_residual(r) - offset).exp();
            (density * Lanes::load(simd, &weights[i..i + LANES])).store(&mut out[i..i + LANES]);
        }
        if whole < out.len() {
            for k in 0..N {
                r[k] = to[k] - load_part(simd, &centres[k][whole..]);
            }
            let density = (density.log_residual(r) - offset).exp();
            store_part(density * load_part(simd, &weights[whole..]), &mut out[whole..]);
        }
    }
    fn naive<A: Motion<N, W>, const N: usize, const W: usize>(
        density: &TransitionDensity<A, N, W>,
        to: [f64; N],
        (centres, weights): (&[&[f64]; N], &[f64]),
        offset: f64,
        out: &mut [f64],
    ) {
        for (i, out) in out.iter_mut().enumerate() {
            let log = density.log_residual(std::array::from_fn(|k| to[k] - centres[k][i]));
            *out = Real::exp(log - offset) * weights[i];
        }
    }
    let sources = (centres, weights);
    dispatch!(level,
        simd => run(simd, density, to, sources, offset, out),
        naive => naive(density, to, sources, offset, out));
}

/// `out[j] <- sum over i of weights[i] p(targets[..][j] | x_i)`, in the order of i.
pub(crate) fn predict_density<A: Motion<N, W>, const N: usize, const W: usize>(
    level: Simd,
    density: &TransitionDensity<A, N, W>,
    targets: &[&[f64]; N],
    (centres, weights): (&[&[f64]; N], &[f64]),
    out: &mut [f64],
) {
    #[inline(always)]
    fn run<A: Motion<N, W>, S: Token, const N: usize, const W: usize>(
        simd: S,
        density: &TransitionDensity<A, N, W>,
        targets: &[&[f64]; N],
        (centres, weights): (&[&[f64]; N], &[f64]),
        out: &mut [f64],
    ) {
        for first in (0..out.len()).step_by(LANES) {
            let range = first..out.len().min(first + LANES);
            let to = targets.map(|c| load_part(simd, &c[range.clone()]));
            let mut sum = Lanes::splat(simd, 0.0);
            for (i, &weight) in weights.iter().enumerate() {
                let mut r = to;
                for k in 0..N {
                    r[k] = r[k] - centres[k][i];
                }
                sum = density.log_residual(r).exp().mul_add(sum.constant(weight), sum);
            }
            store_part(sum, &mut out[range]);
        }
    }
    fn naive<A: Motion<N, W>, const N: usize, const W: usize>(
        density: &TransitionDensity<A, N, W>,
        targets: &[&[f64]; N],
        (centres, weights): (&[&[f64]; N], &[f64]),
        out: &mut [f64],
    ) {
        for (j, out) in out.iter_mut().enumerate() {
            *out = weights.iter().enumerate().fold(0.0, |sum, (i, &weight)| {
                let r = std::array::from_fn(|k| targets[k][j] - centres[k][i]);
                Real::mul_add(Real::exp(density.log_residual(r)), weight, sum)
            });
        }
    }
    let sources = (centres, weights);
    dispatch!(level,
        simd => run(simd, density, targets, sources, out), naive => naive(density, targets, sources, out));
}

/// `out[i] += ln p(to[..][i] | from[..][i])`.
pub(crate) fn add_log_transitions<A: Motion<N, W>, const N: usize, const W: usize>(
    level: Simd,
    density: &TransitionDensity<A, N, W>,
    from: &[&[f64]; N],
    to: &[&[f64]; N],
    out: &mut [f64],
) {
    #[inline(always)]
    fn run<A: Motion<N, W>, const N: usize, const W: usize, S: Token>(
        simd: S,
        density: &TransitionDensity<A, N, W>,
        (from, to): (&[&[f64]; N], &[&[f64]; N]),
        out: &mut [f64],
    ) {
        let whole = out.len() / LANES * LANES;
        assert!(from.iter().chain(to).all(|c| c.len() == out.len()));
        let zero = Lanes::splat(simd, 0.0);
        let (mut x, mut y) = ([zero; N], [zero; N]);
        for i in (0..whole).step_by(LANES) {
            for k in 0..N {
                x[k] = Lanes::load(simd, &from[k][i..i + LANES]);
                y[k] = Lanes::load(simd, &to[k][i..i + LANES]);
            }
            (Lanes::load(simd, &out[i..]) + density.log_density(x, y)).store(&mut out[i..]);
        }
        if whole < out.len() {
            for k in 0..N {
                x[k] = load_part(simd, &from[k][whole..]);
                y[k] = load_part(simd, &to[k][whole..]);
            }
            let sum = load_part(simd, &out[whole..]) + density.log_density(x, y);
            store_part(sum, &mut out[whole..]);
        }
    }
    fn naive<A: Motion<N, W>, const N: usize, const W: usize>(
        density: &TransitionDensity<A, N, W>,
        (from, to): (&[&[f64]; N], &[&[f64]; N]),
        out: &mut [f64],
    ) {
        for (i, out) in out.iter_mut().enumerate() {
            *out += density.log_density::<f64>(from.map(|c| c[i]), to.map(|c| c[i]));
        }
    }
    dispatch!(
        level,
        simd => run(simd, density, (from, to), out),
        naive => naive(density, (from, to), out)
    );
}
