//! What an ensemble Kalman filter does to blocks of members: how they look through a sensor, how that varies
//! with their states, and their correction.

use super::noise::NoiseBlock;
use super::propagate::{load_part, store_part};
use super::{BLOCK, LANES, Simd};
use crate::math::{Lanes, Matrix, wrap};
use crate::model::GaussianMeasurement;
use crate::time::Time;
use fearless_simd::Simd as Token;

/// One member, from which the others are counted, so that angles are differences and sums of squares lose
/// nothing.
#[derive(Clone, Copy)]
pub(crate) struct Reference<const N: usize, const M: usize> {
    pub(crate) state: [f64; N],
    pub(crate) seen: [f64; M],
}

impl<const N: usize, const M: usize> Reference<N, M> {
    pub(crate) fn of<H: GaussianMeasurement<N, M>>(measurement: &H, at: Time, state: [f64; N]) -> Self {
        Reference { state, seen: measurement.predict(at, state) }
    }
}

/// Sums over members of deviations from the reference, and of their perturbations.
#[derive(Clone, Copy)]
pub(crate) struct EnsembleSums<const N: usize, const M: usize> {
    pub(crate) state: [f64; N],
    pub(crate) seen: [f64; M],
    pub(crate) seen_squares: Matrix<M, M>,
    pub(crate) cross: Matrix<N, M>,
    pub(crate) noise: [f64; M],
}

impl<const N: usize, const M: usize> EnsembleSums<N, M> {
    pub(crate) const ZERO: Self = EnsembleSums {
        state: [0.0; N],
        seen: [0.0; M],
        seen_squares: Matrix::ZERO,
        cross: Matrix::ZERO,
        noise: [0.0; M],
    };
}

/// How h(x) changes the members: x <- x + shift - gain (h(x) - h(reference)) + spread n, n being their noise.
#[derive(Clone, Copy)]
pub(crate) struct Correction<const N: usize, const M: usize> {
    pub(crate) shift: [f64; N],
    pub(crate) gain: Matrix<N, M>,
    pub(crate) spread: Matrix<N, M>,
}

/// h(x_i) less that of the reference, angles wrapped, in columns.
type Seen<const M: usize> = [[f64; BLOCK]; M];

/// Fills `seen` for the members of one block.
fn observe<H: GaussianMeasurement<N, M>, const N: usize, const M: usize>(
    level: Simd,
    (measurement, at): (&H, Time),
    reference: &Reference<N, M>,
    states: &[&[f64]; N],
    seen: &mut Seen<M>,
) {
    #[inline(always)]
    fn run<H: GaussianMeasurement<N, M>, const N: usize, const M: usize, S: Token>(
        simd: S,
        (measurement, at): (&H, Time),
        states: &[&[f64]; N],
        seen: &mut Seen<M>,
    ) {
        let count = states[0].len();
        let mut x = [Lanes::splat(simd, 0.0); N];
        for i in (0..count).step_by(LANES) {
            let end = count.min(i + LANES);
            for k in 0..N {
                x[k] = load_part(simd, &states[k][i..end]);
            }
            let z = measurement.predict(at, x);
            for k in 0..M {
                store_part(z[k], &mut seen[k][i..end]);
            }
        }
    }
    fn naive<H: GaussianMeasurement<N, M>, const N: usize, const M: usize>(
        (measurement, at): (&H, Time),
        states: &[&[f64]; N],
        seen: &mut Seen<M>,
    ) {
        for i in 0..states[0].len() {
            let z = measurement.predict(at, std::array::from_fn(|k| states[k][i]));
            for k in 0..M {
                seen[k][i] = z[k];
            }
        }
    }
    dispatch!(
        level,
        simd => run::<H, N, M, _>(simd, (measurement, at), states, seen),
        naive => naive::<H, N, M>((measurement, at), states, seen)
    );
    let count = states[0].len();
    for k in 0..M {
        for z in &mut seen[k][..count] {
            *z -= reference.seen[k];
            if H::ANGLE[k] {
                *z = wrap(*z);
            }
        }
    }
}

/// Sum of a_i b_i, in eight lanes that are folded in one order on every level.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0f64; LANES];
    for (a, b) in a.chunks(LANES).zip(b.chunks(LANES)) {
        for ((lane, a), b) in lanes.iter_mut().zip(a).zip(b) {
            *lane = a.mul_add(*b, *lane);
        }
    }
    lanes.iter().sum()
}

/// Adds what the members of one block are to the sums.
pub(crate) fn ensemble_sums<H: GaussianMeasurement<N, M>, const N: usize, const M: usize>(
    level: Simd,
    sensor: (&H, Time),
    reference: &Reference<N, M>,
    states: &[&[f64]; N],
    noise: Option<&NoiseBlock<M>>,
    sums: &mut EnsembleSums<N, M>,
) {
    /// The same code for all levels: compiled for each, it takes its instructions.
    #[inline(always)]
    fn add<const N: usize, const M: usize, T>(
        (moved, seen, noise): (&[[f64; BLOCK]; N], &Seen<M>, Option<&NoiseBlock<M>>),
        count: usize,
        sums: &mut EnsembleSums<N, M>,
        _: T,
    ) {
        let ones = &[1.0; BLOCK][..count];
        for k in 0..N {
            sums.state[k] += dot(&moved[k][..count], ones);
        }
        for j in 0..M {
            let z = &seen[j][..count];
            sums.seen[j] += dot(z, ones);
            for k in 0..M {
                sums.seen_squares.0[j][k] += dot(z, &seen[k][..count]);
            }
            for k in 0..N {
                sums.cross.0[k][j] += dot(&moved[k][..count], z);
            }
            if let Some(noise) = noise {
                sums.noise[j] += (0..count).fold(0.0, |sum, i| sum + noise.number(j, i));
            }
        }
    }
    let count = states[0].len();
    let mut seen = [[0.0; BLOCK]; M];
    observe(level, sensor, reference, states, &mut seen);
    let mut moved = [[0.0; BLOCK]; N];
    for k in 0..N {
        for (d, x) in moved[k].iter_mut().zip(states[k]) {
            *d = x - reference.state[k];
        }
    }
    let parts = (&moved, &seen, noise);
    dispatch!(level, simd => add(parts, count, sums, simd), naive => add(parts, count, sums, ()));
}

/// Corrects the members of one block.
pub(crate) fn correct<H: GaussianMeasurement<N, M>, const N: usize, const M: usize>(
    level: Simd,
    sensor: (&H, Time),
    reference: &Reference<N, M>,
    correction: &Correction<N, M>,
    noise: Option<&NoiseBlock<M>>,
    states: &mut [&mut [f64]; N],
) {
    #[inline(always)]
    fn apply<const N: usize, const M: usize, T>(
        Correction { shift, gain, spread }: &Correction<N, M>,
        seen: &Seen<M>,
        noise: Option<&NoiseBlock<M>>,
        states: &mut [&mut [f64]; N],
        _: T,
    ) {
        for k in 0..N {
            for (i, x) in states[k].iter_mut().enumerate() {
                let mut by = shift[k];
                for j in 0..M {
                    by = (-gain.0[k][j]).mul_add(seen[j][i], by);
                    if let Some(noise) = noise {
                        by = spread.0[k][j].mul_add(noise.number(j, i), by);
                    }
                }
                *x += by;
            }
        }
    }
    let mut seen = [[0.0; BLOCK]; M];
    observe(level, sensor, reference, &states.each_ref().map(|c| &**c), &mut seen);
    dispatch!(
        level,
        simd => apply(correction, &seen, noise, states, simd),
        naive => apply(correction, &seen, noise, states, ())
    );
}
