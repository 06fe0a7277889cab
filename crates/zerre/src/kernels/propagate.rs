//! Moving particles: gather the survivors of the last resampling, draw their noise, apply the model.

use super::noise::NoiseBlock;
use super::{LANES, Simd};
use crate::math::{Lanes, Real};
use crate::model::Motion;
use fearless_simd::Simd as Token;

/// The particles that survived the last resampling: particle `i` of the block comes from `from[k][ancestors[i]]`.
#[derive(Clone, Copy)]
pub(crate) struct Survivors<'a, const N: usize> {
    from: [&'a [f64]; N],
    ancestors: &'a [u32],
}

impl<'a, const N: usize> Survivors<'a, N> {
    /// `ancestors` of all particles; each is an index into the columns `from`.
    pub(crate) fn new(from: [&'a [f64]; N], ancestors: &'a [u32]) -> Self {
        Survivors { from, ancestors }
    }

    /// Those of the particles `first..last`.
    ///
    /// # Panics
    /// If an ancestor in the range is no index into the columns.
    pub(crate) fn block(self, level: Simd, first: usize, last: usize) -> SurvivorBlock<'a, N> {
        #[inline(always)]
        fn largest<T>(indices: &[u32], _: T) -> u32 {
            indices.iter().copied().fold(0, u32::max)
        }
        let ancestors = &self.ancestors[first..last];
        let largest =
            dispatch!(level, simd => largest(ancestors, simd), naive => largest(ancestors, ())) as usize;
        assert!(self.from.iter().all(|c| largest < c.len()), "an ancestor that there is not");
        SurvivorBlock { from: self.from, ancestors }
    }
}

/// Survivors of one block, their indices vouched for.
#[derive(Clone, Copy)]
pub(crate) struct SurvivorBlock<'a, const N: usize> {
    from: [&'a [f64]; N],
    ancestors: &'a [u32],
}

impl<const N: usize> SurvivorBlock<'_, N> {
    #[inline(always)]
    fn lanes<S: Token>(&self, simd: S, i: usize) -> [Lanes<S>; N] {
        let a = &self.ancestors[i..i + LANES];
        let mut x = [Lanes::splat(simd, 0.0); N];
        for k in 0..N {
            let column = self.from[k];
            let mut eight = [0.0; LANES];
            for j in 0..LANES {
                // SAFETY: `Survivors::block` vouches for the indices.
                eight[j] = unsafe { *column.get_unchecked(a[j] as usize) };
            }
            x[k] = Lanes::load(simd, &eight);
        }
        x
    }

    #[inline(always)]
    fn one(&self, i: usize) -> [f64; N] {
        self.from.map(|c| c[self.ancestors[i] as usize])
    }
}

/// Where the particles of a block stand before they are moved.
#[derive(Clone, Copy)]
pub(crate) enum Source<'a, const N: usize> {
    /// In the columns that they are moved to.
    Here,
    /// In columns of their own: `from[k][i]`, as many as the block has.
    Columns([&'a [f64]; N]),
    /// Among the particles of the step before.
    Survivors(SurvivorBlock<'a, N>),
}

/// Moves the particles of one block: `states[k][i] <- f(x_i, noise)`, x_i being particle i of `source`.
pub(crate) fn propagate<const N: usize, const W: usize, M: Motion<N, W>>(
    level: Simd,
    step: &M::Step,
    noise: &NoiseBlock<W>,
    source: Source<'_, N>,
    states: &mut [&mut [f64]; N],
) {
    #[inline(always)]
    fn run<const N: usize, const W: usize, M: Motion<N, W>, S: Token>(
        simd: S,
        step: &M::Step,
        noise: &NoiseBlock<W>,
        source: Source<'_, N>,
        states: &mut [&mut [f64]; N],
    ) {
        let count = states[0].len();
        let whole = count / LANES * LANES;
        assert!(states.iter().all(|c| c.len() == count) && count <= noise.width);
        // Local copies of the column pointers: the stores below could otherwise alias them.
        let columns = states.each_mut().map(|c| c.as_mut_ptr());
        let from = match source {
            Source::Survivors(survivors) => {
                for i in (0..whole).step_by(LANES) {
                    let y = M::apply(step, survivors.lanes(simd, i), noise_lanes(simd, noise, i));
                    for k in 0..N {
                        // SAFETY: `whole` eights lie inside every column.
                        y[k].store(unsafe { std::slice::from_raw_parts_mut(columns[k].add(i), LANES) });
                    }
                }
                None
            }
            Source::Columns(from) => {
                assert!(from.iter().all(|c| c.len() == count));
                Some(from.map(|c| c.as_ptr()))
            }
            Source::Here => Some(columns.map(<*mut f64>::cast_const)),
        };
        if let Some(from) = from {
            for i in (0..whole).step_by(LANES) {
                let mut x = [Lanes::splat(simd, 0.0); N];
                for k in 0..N {
                    // SAFETY: as above; no reference to what is stored below lives longer than the load.
                    x[k] = Lanes::load(simd, unsafe { std::slice::from_raw_parts(from[k].add(i), LANES) });
                }
                let y = M::apply(step, x, noise_lanes(simd, noise, i));
                for k in 0..N {
                    // SAFETY: as above.
                    y[k].store(unsafe { std::slice::from_raw_parts_mut(columns[k].add(i), LANES) });
                }
            }
        }
        if whole < count {
            match source {
                Source::Here => {}
                Source::Columns(from) => {
                    for k in 0..N {
                        states[k][whole..].copy_from_slice(&from[k][whole..]);
                    }
                }
                Source::Survivors(survivors) => gather_tail(&survivors, whole, states),
            }
            let mut x = [Lanes::splat(simd, 0.0); N];
            for k in 0..N {
                x[k] = load_part(simd, &states[k][whole..]);
            }
            let y = M::apply(step, x, noise_lanes(simd, noise, whole));
            for k in 0..N {
                store_part(y[k], &mut states[k][whole..]);
            }
        }
    }
    fn naive<const N: usize, const W: usize, M: Motion<N, W>>(
        step: &M::Step,
        noise: &NoiseBlock<W>,
        source: Source<'_, N>,
        states: &mut [&mut [f64]; N],
    ) {
        for i in 0..states[0].len() {
            let x = match source {
                Source::Here => std::array::from_fn(|k| states[k][i]),
                Source::Columns(from) => from.map(|c| c[i]),
                Source::Survivors(survivors) => survivors.one(i),
            };
            let y = M::apply(step, x, std::array::from_fn(|k| noise.number(k, i)));
            for k in 0..N {
                states[k][i] = y[k];
            }
        }
    }
    dispatch!(
        level,
        simd => run::<N, W, M, _>(simd, step, noise, source, states),
        naive => naive::<N, W, M>(step, noise, source, states)
    );
}

/// `states[k][i] <- mean[k] + sum over j of factor[k][j] z_ij`, z being the block's noise: a draw from a normal law.
pub(crate) fn draw_normal<const N: usize>(
    level: Simd,
    mean: &[f64; N],
    factor: &[[f64; N]; N],
    noise: &NoiseBlock<N>,
    states: &mut [&mut [f64]; N],
) {
    #[inline(always)]
    fn run<const N: usize, S: Token>(
        simd: S,
        mean: &[f64; N],
        factor: &[[f64; N]; N],
        noise: &NoiseBlock<N>,
        states: &mut [&mut [f64]; N],
    ) {
        let count = states[0].len();
        assert!(states.iter().all(|c| c.len() == count) && count <= noise.width);
        for i in (0..count).step_by(LANES) {
            let z = noise_lanes(simd, noise, i);
            for k in 0..N {
                let mut x = Lanes::splat(simd, mean[k]);
                for j in 0..N {
                    x = z[j].mul_add(Lanes::splat(simd, factor[k][j]), x);
                }
                store_part(x, &mut states[k][i..count.min(i + LANES)]);
            }
        }
    }
    fn naive<const N: usize>(
        mean: &[f64; N],
        factor: &[[f64; N]; N],
        noise: &NoiseBlock<N>,
        states: &mut [&mut [f64]; N],
    ) {
        for i in 0..states[0].len() {
            for k in 0..N {
                states[k][i] =
                    (0..N).fold(mean[k], |x, j| Real::mul_add(noise.number(j, i), factor[k][j], x));
            }
        }
    }
    dispatch!(
        level,
        simd => run(simd, mean, factor, noise, states),
        naive => naive(mean, factor, noise, states)
    );
}

/// Puts the particles of `source` in their places, without moving them.
pub(crate) fn gather<const N: usize>(source: Source<'_, N>, states: &mut [&mut [f64]; N]) {
    let survivors = match source {
        Source::Here => return,
        Source::Columns(from) => {
            return states.iter_mut().zip(from).for_each(|(to, from)| to.copy_from_slice(from));
        }
        Source::Survivors(survivors) => survivors,
    };
    for (to, from) in states.iter_mut().zip(survivors.from) {
        assert!(to.len() == survivors.ancestors.len());
        for (x, &a) in to.iter_mut().zip(survivors.ancestors) {
            // SAFETY: `Survivors::block` vouches for the indices.
            *x = unsafe { *from.get_unchecked(a as usize) };
        }
    }
}

#[inline(always)]
fn gather_tail<const N: usize>(survivors: &SurvivorBlock<'_, N>, first: usize, states: &mut [&mut [f64]; N]) {
    for i in first..states[0].len() {
        let x = survivors.one(i);
        for k in 0..N {
            states[k][i] = x[k];
        }
    }
}

/// Noise of eight particles. Loops instead of `array::from_fn` here and below: a closure may fail to be inlined.
#[inline(always)]
pub(super) fn noise_lanes<const W: usize, S: Token>(
    simd: S,
    noise: &NoiseBlock<W>,
    i: usize,
) -> [Lanes<S>; W] {
    let mut w = [Lanes::splat(simd, 0.0); W];
    for k in 0..W {
        let at = k * noise.width + i;
        // SAFETY: rows are as wide as the block, whole eights of it, and at least as wide as the columns.
        w[k] = unsafe {
            if noise.is_double {
                Lanes::load(simd, noise.double().get_unchecked(at..at + LANES))
            } else {
                Lanes::widen(simd, noise.single().get_unchecked(at..at + LANES))
            }
        };
    }
    w
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
