//! Points of a scan shared among ellipses: weights of particles, and the statistics that each carries along.

use super::propagate::{load_part, store_part};
use super::weigh::fold_array;
use super::{BLOCK, LANES, Simd};
use crate::extended::MAX_ELLIPSES;
use crate::extended::centre::Centre;
use crate::extended::scan::{MOMENTS, PointScanGiven, draw_labels, expect};
use crate::math::{Lanes, Real};
use crate::rng::Draws;
use fearless_simd::Simd as Token;
use serde::{Deserialize, Serialize};

/// Most numbers that a particle carries.
pub(crate) const MAX_CARRIED: usize = MOMENTS * MAX_ELLIPSES;

/// What the particles of a block carry: column c of particle i at `[c * BLOCK + i]`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Carried(Vec<f64>);

impl Carried {
    pub(crate) fn new(columns: usize) -> Self {
        Carried(vec![0.0; columns * BLOCK])
    }

    pub(crate) fn columns(&self) -> usize {
        self.0.len() / BLOCK
    }

    /// The columns of particle `i`.
    pub(crate) fn row(&self, i: usize) -> impl Iterator<Item = f64> + '_ {
        self.0.chunks_exact(BLOCK).map(move |column| column[i])
    }

    pub(crate) fn set_row(&mut self, i: usize, row: &[f64]) {
        for (column, x) in self.0.chunks_exact_mut(BLOCK).zip(row) {
            column[i] = *x;
        }
    }
}

/// What particles inherit: particle i of a block has `keep` times what `parents[i]` carried, about a centre
/// that lies `by` further on.
#[derive(Clone, Copy)]
pub(crate) struct Inherited<'a> {
    pub(crate) from: &'a [Carried],
    pub(crate) parents: &'a [u32],
    pub(crate) keep: f64,
    pub(crate) by: [f64; 2],
}

impl Inherited<'_> {
    /// What one particle inherits.
    #[inline(always)]
    pub(crate) fn row(&self, i: usize, row: &mut [f64]) {
        let parent = self.parents[i] as usize;
        for (to, x) in row.iter_mut().zip(self.from[parent / BLOCK].row(parent % BLOCK)) {
            *to = x;
        }
        pass_on(row, self.keep, self.by);
    }

    #[inline(always)]
    fn lanes<S: Token>(&self, simd: S, i: usize, rows: &mut [Lanes<S>]) {
        let mut eight: [&[f64]; LANES] = [&[]; LANES];
        for j in 0..LANES {
            // Fewer than eight at the end: the first stands in for those that there are not.
            let at = if i + j < self.parents.len() { i + j } else { i };
            let parent = self.parents[at] as usize;
            eight[j] = &self.from[parent / BLOCK].0[parent % BLOCK..];
            assert!(eight[j].len() > (rows.len() - 1) * BLOCK);
        }
        let mut numbers = [0.0; LANES];
        for (c, row) in rows.iter_mut().enumerate() {
            for j in 0..LANES {
                // SAFETY: found long enough above.
                numbers[j] = unsafe { *eight[j].get_unchecked(c * BLOCK) };
            }
            *row = Lanes::load(simd, &numbers);
        }
        pass_on(rows, self.keep, self.by);
    }
}

/// `keep` times statistics of the same points about a centre that lies `by` further on.
#[inline(always)]
fn pass_on<R: Real>(row: &mut [R], keep: f64, [a, b]: [f64; 2]) {
    for s in row.chunks_exact_mut(MOMENTS) {
        let (n, x, y) = (s[0] * keep, s[1] * keep, s[2] * keep);
        let (na, nb) = (n * a, n * b);
        s[0] = n;
        s[1] = x - na;
        s[2] = y - nb;
        s[3] = s[3] * keep - x * (2.0 * a) + na * a;
        s[4] = s[4] * keep - y * a - x * b + na * b;
        s[5] = s[5] * keep - y * (2.0 * b) + nb * b;
    }
}

/// `out[i] <- ln p(points | x_i)`, and `to` what the particles inherit with `gain` times the expected
/// statistics of the scan.
pub(crate) fn share<const N: usize, C: Centre<N>>(
    level: Simd,
    given: &PointScanGiven<'_, C>,
    states: &[&[f64]; N],
    inherited: Inherited<'_>,
    gain: f64,
    (out, to): (&mut [f64], &mut Carried),
) {
    #[inline(always)]
    fn run<const N: usize, C: Centre<N>, S: Token>(
        simd: S,
        given: &PointScanGiven<'_, C>,
        states: &[&[f64]; N],
        inherited: Inherited<'_>,
        gain: f64,
        (out, to): (&mut [f64], &mut Carried),
    ) {
        let columns = to.columns();
        // A local copy of the column slices: the stores below could otherwise alias them.
        let states = *states;
        assert!(states.iter().all(|c| c.len() == out.len()) && inherited.parents.len() == out.len());
        let mut all = [Lanes::splat(simd, 0.0); MAX_CARRIED];
        let rows = &mut all[..columns];
        let mut x = [Lanes::splat(simd, 0.0); N];
        for i in (0..out.len()).step_by(LANES) {
            inherited.lanes(simd, i, rows);
            let last = out.len().min(i + LANES);
            for k in 0..N {
                x[k] = load_part(simd, &states[k][i..last]);
            }
            let centre = given.centre.at(x);
            let log = expect::<_, true>(given.lobes.all(), given.points, centre, gain, rows);
            store_part(log, &mut out[i..last]);
            for (row, column) in rows.iter().zip(to.0.chunks_exact_mut(BLOCK)) {
                row.store(&mut column[i..i + LANES]);
            }
        }
    }
    fn naive<const N: usize, C: Centre<N>>(
        given: &PointScanGiven<'_, C>,
        states: &[&[f64]; N],
        inherited: Inherited<'_>,
        gain: f64,
        (out, to): (&mut [f64], &mut Carried),
    ) {
        let mut all = [0.0; MAX_CARRIED];
        let row = &mut all[..to.columns()];
        for (i, out) in out.iter_mut().enumerate() {
            inherited.row(i, row);
            let centre = given.centre.at(std::array::from_fn(|k| states[k][i]));
            *out = expect::<_, true>(given.lobes.all(), given.points, centre, gain, row);
            to.set_row(i, row);
        }
    }
    dispatch!(
        level,
        simd => run::<N, C, _>(simd, given, states, inherited, gain, (out, to)),
        naive => naive::<N, C>(given, states, inherited, gain, (out, to))
    );
}

/// As [`share`], with the ellipse of every point drawn (see [`draw_labels`]) from the numbers that `draws`
/// gives for a particle of the block. One particle after the other: levels differ by their instructions only.
pub(crate) fn share_drawn<const N: usize, C: Centre<N>>(
    level: Simd,
    given: &PointScanGiven<'_, C>,
    (optimal, draws): (bool, impl Fn(usize) -> Draws),
    states: &[&[f64]; N],
    inherited: Inherited<'_>,
    gain: f64,
    (out, to): (&mut [f64], &mut Carried),
) {
    #[inline(always)]
    fn run<const N: usize, C: Centre<N>, T>(
        _: T,
        given: &PointScanGiven<'_, C>,
        (optimal, draws): (bool, impl Fn(usize) -> Draws),
        states: &[&[f64]; N],
        inherited: Inherited<'_>,
        gain: f64,
        (out, to): (&mut [f64], &mut Carried),
    ) {
        let mut all = [0.0; MAX_CARRIED];
        let row = &mut all[..to.columns()];
        let mut x = [0.0; N];
        for (i, out) in out.iter_mut().enumerate() {
            inherited.row(i, row);
            for k in 0..N {
                x[k] = states[k][i];
            }
            *out = draw_labels(given, (optimal, draws(i)), given.centre.at(x), gain, row);
            to.set_row(i, row);
        }
    }
    dispatch!(
        level,
        simd => run(simd, given, (optimal, draws), states, inherited, gain, (out, to)),
        naive => run((), given, (optimal, draws), states, inherited, gain, (out, to))
    );
}

/// `sums[c] <- sum over the particles of weight times column c`.
pub(crate) fn carried_sums(level: Simd, weights: &[f64], carried: &Carried, sums: &mut [f64]) {
    #[inline(always)]
    fn run<S: Token>(simd: S, weights: &[f64; BLOCK], last: usize, carried: &Carried, sums: &mut [f64]) {
        for (sum, column) in sums.iter_mut().zip(carried.0.chunks_exact(BLOCK)) {
            let mut lanes = Lanes::splat(simd, 0.0);
            for i in (0..last).step_by(LANES) {
                let w = Lanes::load(simd, &weights[i..i + LANES]);
                lanes = w.mul_add(Lanes::load(simd, &column[i..i + LANES]), lanes);
            }
            let mut eight = [0.0; LANES];
            lanes.store(&mut eight);
            *sum = fold_array(eight, |a, b| a + b);
        }
    }
    fn naive(weights: &[f64; BLOCK], last: usize, carried: &Carried, sums: &mut [f64]) {
        for (sum, column) in sums.iter_mut().zip(carried.0.chunks_exact(BLOCK)) {
            let mut lanes = [0.0; LANES];
            for i in 0..last {
                lanes[i % LANES] = weights[i].mul_add(column[i], lanes[i % LANES]);
            }
            *sum = fold_array(lanes, |a, b| a + b);
        }
    }
    let mut padded = [0.0; BLOCK];
    padded[..weights.len()].copy_from_slice(weights);
    let last = weights.len();
    dispatch!(
        level,
        simd => run(simd, &padded, last, carried, sums),
        naive => naive(&padded, last, carried, sums)
    );
}
