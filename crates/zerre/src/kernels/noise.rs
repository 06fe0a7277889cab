//! Process noise of a block of particles.
//!
//! A block of `B` particles (a multiple of 64, at most [`BLOCK`]) with `W` noise components needs `W B` numbers, laid
//! out as `W` rows of `B`. With 32-bit resolution, Philox call `q` of the block gives four of them by two Box-Muller
//! transforms: words 0 and 1 the numbers `q` and `q + W B / 4`, words 2 and 3 the numbers `q + 2 W B / 4` and
//! `q + 3 W B / 4`. With full resolution a call gives the numbers `q` and `q + W B / 2`. Call `q` of block `b` has the
//! counter `b W BLOCK + q`: every number belongs to one particle, one component and one step.

mod naive;

use super::philox::philox_x16;
use super::{BLOCK, Simd};
use crate::math::{Lanes, Real};
use crate::model::Noise;
use crate::rng::{Purpose, Stream};
use fearless_simd::{Simd as Token, f32x16, i32x16, prelude::*, u32x16, u64x8};
use serde::{Deserialize, Serialize};
use std::mem::MaybeUninit;

/// Resolution of standard normal process noise. States and weights are `f64` in either case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Resolution {
    /// One 32-bit word for the radius and one for the angle, computed in `f32`: the numbers lie within +-6.77 and are
    /// off by at most 2.4e-4 near zero and 1e-6 of themselves elsewhere.
    #[default]
    Bits32,
    /// 52 bits for each, computed in `f64`.
    Bits64,
}

/// Generator of the random words.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Generator {
    /// Philox4x32-10: each word is addressed by particle and step.
    #[default]
    Philox,
    /// xoshiro256++ (Blackman and Vigna, 2019) in eight lanes, seeded by Philox for every block and step: faster, as
    /// independent of threads and SIMD, but addressable by block only.
    Xoshiro,
}

/// How process noise is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct NoiseSource {
    /// Generator of the words.
    pub generator: Generator,
    /// Resolution of normal numbers.
    pub resolution: Resolution,
}

/// Noise of one block: `W` rows of `width` numbers, in single or double precision.
pub struct NoiseBlock<const W: usize> {
    /// Written by [`fill_noise`] before it is read: zeroing it first costs as much as moving the particles.
    numbers: MaybeUninit<Numbers<W>>,
    pub(super) width: usize,
    pub(super) is_double: bool,
}

#[derive(Clone, Copy)]
#[repr(C, align(64))]
union Numbers<const W: usize> {
    single: [[f32; BLOCK]; W],
    double: [[f64; BLOCK]; W],
}

impl<const W: usize> NoiseBlock<W> {
    pub(crate) fn new() -> Self {
        NoiseBlock { numbers: MaybeUninit::uninit(), width: 0, is_double: false }
    }

    /// Gives the first `count` particles the same number in every component.
    pub(crate) fn fill(&mut self, count: usize, number: f64) {
        self.double_mut(count.div_ceil(64) * 64).fill(number);
    }

    /// Component `row` of particle `i` of the block.
    pub(super) fn number(&self, row: usize, i: usize) -> f64 {
        let at = row * self.width + i;
        if self.is_double { self.double()[at] } else { f64::from(self.single()[at]) }
    }

    /// The numbers that [`fill_noise`] wrote in single precision; none if it wrote in double.
    #[inline(always)]
    pub(super) fn single(&self) -> &[f32] {
        let len = if self.is_double { 0 } else { W * self.width };
        // SAFETY: `fill_noise` wrote as many, and any bits are a number.
        unsafe { std::slice::from_raw_parts(self.numbers.as_ptr().cast(), len) }
    }

    /// The numbers that [`fill_noise`] wrote in double precision; none if it wrote in single.
    #[inline(always)]
    pub(super) fn double(&self) -> &[f64] {
        let len = if self.is_double { W * self.width } else { 0 };
        // SAFETY: as above.
        unsafe { std::slice::from_raw_parts(self.numbers.as_ptr().cast(), len) }
    }

    /// Memory for `W` rows of `width` single-precision numbers; every one must be written.
    fn single_mut(&mut self, width: usize) -> &mut [f32] {
        assert!(width <= BLOCK);
        (self.width, self.is_double) = (width, false);
        // SAFETY: inside the union, and plain numbers; `fill_noise` writes every one and reads none.
        unsafe { std::slice::from_raw_parts_mut(self.numbers.as_mut_ptr().cast(), W * width) }
    }

    /// Memory for `W` rows of `width` double-precision numbers; every one must be written.
    fn double_mut(&mut self, width: usize) -> &mut [f64] {
        assert!(width <= BLOCK);
        (self.width, self.is_double) = (width, true);
        // SAFETY: as above.
        unsafe { std::slice::from_raw_parts_mut(self.numbers.as_mut_ptr().cast(), W * width) }
    }
}

/// Where the noise of one block comes from.
#[derive(Clone, Copy)]
pub(crate) struct NoiseKey {
    pub(crate) stream: Stream,
    pub(crate) purpose: Purpose,
    pub(crate) step: u64,
    pub(crate) block: usize,
}

/// Fills `noise` for the first `count` particles of a block: `components` rows are drawn, the others zero.
pub(crate) fn fill_noise<const W: usize>(
    level: Simd,
    source: NoiseSource,
    law: Noise,
    key: NoiseKey,
    (count, components): (usize, usize),
    noise: &mut NoiseBlock<W>,
) {
    const { assert!(W <= 64, "block numbers times components must fit the 32-bit counter") };
    let components = components.min(W);
    let width = count.div_ceil(64) * 64;
    match law {
        Noise::StandardNormal => match source.resolution {
            Resolution::Bits32 => {
                let (out, rest) = noise.single_mut(width).split_at_mut(components * width);
                rest.fill(0.0);
                match source.generator {
                    Generator::Philox => dispatch!(
                        level,
                        simd => normals32::<_, Counter>(simd, key, components, out),
                        naive => naive::normals32(naive::Counter::new(key, components), out)
                    ),
                    Generator::Xoshiro => dispatch!(
                        level,
                        simd => normals32::<_, Lanewise<_>>(simd, key, components, out),
                        naive => naive::normals32(naive::Lanewise::new(key, components), out)
                    ),
                }
            }
            Resolution::Bits64 => {
                let (out, rest) = noise.double_mut(width).split_at_mut(components * width);
                rest.fill(0.0);
                match source.generator {
                    Generator::Philox => dispatch!(
                        level,
                        simd => normals64::<_, Counter>(simd, key, components, out),
                        naive => naive::normals64(naive::Counter::new(key, components), out)
                    ),
                    Generator::Xoshiro => dispatch!(
                        level,
                        simd => normals64::<_, Lanewise<_>>(simd, key, components, out),
                        naive => naive::normals64(naive::Lanewise::new(key, components), out)
                    ),
                }
            }
        },
        Noise::Gamma { shape } => fill_gamma(shape, key, (count, components), |_| true, noise),
    }
}

/// Gamma noise for those of the first `count` particles that `takes` names; zeros for the others. It is drawn
/// one after the other, so that it pays to leave some out.
pub(crate) fn fill_gamma<const W: usize>(
    shape: f64,
    key: NoiseKey,
    (count, components): (usize, usize),
    takes: impl Fn(usize) -> bool,
    noise: &mut NoiseBlock<W>,
) {
    let width = count.div_ceil(64) * 64;
    let out = noise.double_mut(width);
    out.fill(0.0);
    let first = (key.block * BLOCK) as u32;
    for (i, particle) in (first..).take(count).enumerate().filter(|&(i, _)| takes(i)) {
        let mut draws = key.stream.draws(key.purpose, key.step, particle);
        for w in 0..components {
            out[w * width + i] = draws.gamma(shape);
        }
    }
}

/// A source of 4 x 16 random words, call after call.
trait Words<S: Token> {
    fn new(simd: S, at: NoiseKey, components: usize) -> Self;
    fn next(&mut self, simd: S) -> [u32x16<S>; 4];
}

/// Philox, one call after the other.
struct Counter {
    key: [u32; 2],
    next: u32,
    rest: [u32; 3],
}

impl<S: Token> Words<S> for Counter {
    #[inline(always)]
    fn new(_: S, at: NoiseKey, components: usize) -> Self {
        Counter {
            key: at.stream.key(),
            next: (at.block as u32).wrapping_mul((components * BLOCK) as u32),
            rest: [at.purpose as u32, at.step as u32, (at.step >> 32) as u32],
        }
    }

    #[inline(always)]
    fn next(&mut self, simd: S) -> [u32x16<S>; 4] {
        let words = philox_x16(simd, self.key, self.next, self.rest);
        self.next = self.next.wrapping_add(16);
        words
    }
}

/// xoshiro256++ in eight lanes.
struct Lanewise<S: Token> {
    state: [u64x8<S>; 4],
}

impl<S: Token> Words<S> for Lanewise<S> {
    #[inline(always)]
    fn new(simd: S, at: NoiseKey, components: usize) -> Self {
        // The calls of the seeds differ from those of the numbers in bit 8 of counter word 1.
        let Counter { key, next, rest } = <Counter as Words<S>>::new(simd, at, components);
        let [a, b, c, d] = philox_x16(simd, key, next, [rest[0] | 1 << 8, rest[1], rest[2]]);
        Lanewise { state: [a.bitcast(), b.bitcast(), c.bitcast(), d.bitcast()] }
    }

    #[inline(always)]
    fn next(&mut self, _: S) -> [u32x16<S>; 4] {
        let a = xoshiro(&mut self.state);
        let b = xoshiro(&mut self.state);
        let c = xoshiro(&mut self.state);
        let d = xoshiro(&mut self.state);
        [a.bitcast(), b.bitcast(), c.bitcast(), d.bitcast()]
    }
}

#[inline(always)]
fn xoshiro<S: Token>([s0, s1, s2, s3]: &mut [u64x8<S>; 4]) -> u64x8<S> {
    let sum = *s0 + *s3;
    let result = ((sum << 23) | (sum >> 41)) + *s0;
    let t = *s1 << 17;
    *s2 ^= *s0;
    *s3 ^= *s1;
    *s1 ^= *s2;
    *s0 ^= *s3;
    *s2 ^= t;
    *s3 = (*s3 << 45) | (*s3 >> 19);
    result
}

#[inline(always)]
fn normals32<S: Token, G: Words<S>>(simd: S, at: NoiseKey, components: usize, out: &mut [f32]) {
    let quarter = out.len() / 4;
    let (a, rest) = out.split_at_mut(quarter);
    let (b, rest) = rest.split_at_mut(quarter);
    let (c, d) = rest.split_at_mut(quarter);
    let mut words = G::new(simd, at, components);
    let chunks = a
        .chunks_exact_mut(16)
        .zip(b.chunks_exact_mut(16))
        .zip(c.chunks_exact_mut(16))
        .zip(d.chunks_exact_mut(16));
    for (((a, b), c), d) in chunks {
        let [w0, w1, w2, w3] = words.next(simd);
        let (z0, z1) = box_muller32(simd, w0, w1);
        let (z2, z3) = box_muller32(simd, w2, w3);
        z0.store_slice(a);
        z1.store_slice(b);
        z2.store_slice(c);
        z3.store_slice(d);
    }
}

#[inline(always)]
fn splat<S: Token>(simd: S, c: f32) -> f32x16<S> {
    f32x16::splat(simd, c)
}

#[inline(always)]
fn fma<S: Token>(simd: S, a: f32x16<S>, b: f32x16<S>, c: f32x16<S>) -> f32x16<S> {
    simd.mul_add_precise_f32x16(a, b, c)
}

/// Two independent standard normals from a radius word and an angle word.
#[inline(always)]
fn box_muller32<S: Token>(simd: S, radius: u32x16<S>, angle: u32x16<S>) -> (f32x16<S>, f32x16<S>) {
    let r = radius32(simd, radius);
    // The low 30 bits give an angle in [-pi/4, pi/4), the high two the quadrant.
    let turned: i32x16<S> = (angle << 2).bitcast();
    let theta = simd.cvt_f32_i32x16(turned) * splat(simd, std::f32::consts::FRAC_PI_4 / 2_147_483_648.0);
    let z = theta * theta;
    let s = fma(
        simd,
        fma(simd, z, splat(simd, -0.000_195_878_67), splat(simd, 0.008_332_748)),
        z,
        splat(simd, -0.166_666_64),
    );
    let s = fma(simd, theta * z, s, theta);
    let c = fma(
        simd,
        fma(simd, z, splat(simd, 2.454_791_7e-5), splat(simd, -0.001_388_830_2)),
        z,
        splat(simd, 0.041_666_664),
    );
    let c = fma(simd, z * z, c, fma(simd, z, splat(simd, -0.5), splat(simd, 1.0)));
    let sign = angle & u32x16::splat(simd, 0x8000_0000);
    let c: f32x16<S> = (c.bitcast::<u32x16<S>>() ^ sign).bitcast();
    let swap_bit = u32x16::splat(simd, 0x4000_0000);
    let swap = simd.simd_eq_u32x16(angle & swap_bit, swap_bit);
    (r * swap.select(s, c), r * swap.select(c, s))
}

/// sqrt(-2 ln u) for u = (word + 1/2) / 2^32.
#[inline(always)]
fn radius32<S: Token>(simd: S, word: u32x16<S>) -> f32x16<S> {
    let u = fma(
        simd,
        simd.cvt_f32_u32x16(word),
        splat(simd, 1.0 / 4_294_967_296.0),
        splat(simd, 0.5 / 4_294_967_296.0),
    );
    let border = u32x16::splat(simd, 0x3f35_04f3);
    let shifted = u.bitcast::<u32x16<S>>() - border;
    let exponent = simd.cvt_f32_i32x16(shifted.bitcast::<i32x16<S>>() >> 23);
    let mantissa = (shifted & u32x16::splat(simd, 0x007f_ffff)) + border;
    let f = mantissa.bitcast::<f32x16<S>>() - splat(simd, 1.0);
    // -2 ln(1 + f) / f.
    let mut p = splat(simd, -2.0 * 0.085_333_13);
    for c in
        [-0.142_692_58, 0.149_774_01, -0.165_779_93, 0.199_559_33, -0.250_013_53, 0.333_341_93, -0.499_999_97]
    {
        p = fma(simd, p, f, splat(simd, -2.0 * c));
    }
    let p = fma(simd, p, f, splat(simd, -2.0));
    simd.sqrt_f32x16(fma(simd, f, p, exponent * splat(simd, -2.0 * std::f32::consts::LN_2)))
}

#[inline(always)]
fn normals64<S: Token, G: Words<S>>(simd: S, at: NoiseKey, components: usize, out: &mut [f64]) {
    let (a, b) = out.split_at_mut(out.len() / 2);
    let mut words = G::new(simd, at, components);
    for (a, b) in a.chunks_exact_mut(16).zip(b.chunks_exact_mut(16)) {
        let [w0, w1, w2, w3] = words.next(simd);
        let (r_even, r_odd) = join_halves(simd, w0, w1);
        let (t_even, t_odd) = join_halves(simd, w2, w3);
        let (c_even, s_even) = box_muller64(simd, r_even, t_even);
        let (c_odd, s_odd) = box_muller64(simd, r_odd, t_odd);
        let (lo, hi) = simd.interleave_f64x8(c_even.0, c_odd.0);
        lo.store_slice(&mut a[..8]);
        hi.store_slice(&mut a[8..]);
        let (lo, hi) = simd.interleave_f64x8(s_even.0, s_odd.0);
        lo.store_slice(&mut b[..8]);
        hi.store_slice(&mut b[8..]);
    }
}

/// 64-bit words of eight even and eight odd calls, from their low and high halves in the order of the calls.
#[inline(always)]
fn join_halves<S: Token>(simd: S, low: u32x16<S>, high: u32x16<S>) -> (u64x8<S>, u64x8<S>) {
    let mask = u64x8::splat(simd, 0xffff_ffff);
    let (low, high): (u64x8<S>, u64x8<S>) = (low.bitcast(), high.bitcast());
    ((low & mask) | (high << 32), (low >> 32) | (high & (mask << 32)))
}

#[inline(always)]
fn box_muller64<S: Token>(simd: S, radius: u64x8<S>, angle: u64x8<S>) -> (Lanes<S>, Lanes<S>) {
    let r = (unit_open_lanes(simd, radius).ln() * -2.0).sqrt();
    let (s, c) = (unit_open_lanes(simd, angle) * std::f64::consts::TAU).sin_cos();
    (r * c, r * s)
}

/// The lanes' twin of [`crate::rng::unit_open`]: exact in every operation, so the bits agree.
#[inline(always)]
fn unit_open_lanes<S: Token>(simd: S, bits: u64x8<S>) -> Lanes<S> {
    // 52 bits under the exponent of 1 give [1, 2).
    let one_to_two = (bits >> 12) | u64x8::splat(simd, 1.0f64.to_bits());
    (Lanes(one_to_two.bitcast()) - 1.0) + 0.5 * f64::EPSILON
}

/// Uniform numbers on (0, 1) with 32-bit resolution, for resampling: number `64 c + 16 w + 8 h + j` is the middle of
/// the cell that word `w` of call `16 c + 2 j + h` names. `first` is a multiple of 64; `out` may have any length.
pub(crate) fn fill_uniforms(level: Simd, stream: Stream, step: u64, first: usize, out: &mut [f64]) {
    dispatch!(
        level,
        simd => uniforms(simd, stream, step, first, out),
        naive => naive::uniforms(stream, step, first, out)
    );
}

#[inline(always)]
fn uniforms<S: Token>(simd: S, stream: Stream, step: u64, first: usize, out: &mut [f64]) {
    debug_assert!(first.is_multiple_of(64));
    let rest = [Purpose::Resample as u32, step as u32, (step >> 32) as u32];
    let mut call = (first / 4) as u32;
    for chunk in out.chunks_mut(64) {
        let words = philox_x16(simd, stream.key(), call, rest);
        call = call.wrapping_add(16);
        let mut last = [0.0; 64];
        let whole = chunk.len() == 64;
        let numbers = if whole { &mut *chunk } else { &mut last };
        let low = u64x8::splat(simd, 0xffff_ffff);
        // A 32-bit integer under the exponent of 2^52, minus 2^52, is that integer.
        let magic = u64x8::splat(simd, 4_503_599_627_370_496f64.to_bits());
        for (word, numbers) in words.into_iter().zip(numbers.chunks_exact_mut(16)) {
            let wide: u64x8<S> = word.bitcast();
            for (half, numbers) in [wide & low, wide >> 32].into_iter().zip(numbers.chunks_exact_mut(8)) {
                let integer = Lanes((half | magic).bitcast()) - 4_503_599_627_370_496.0;
                ((integer + 0.5) * (1.0 / 4_294_967_296.0)).store(numbers);
            }
        }
        if !whole {
            chunk.copy_from_slice(&last[..chunk.len()]);
        }
    }
}

/// -ln u of uniform numbers, in place.
pub(crate) fn to_exponentials(level: Simd, numbers: &mut [f64]) {
    #[inline(always)]
    fn run<S: Token>(simd: S, numbers: &mut [f64]) {
        let mut chunks = numbers.chunks_exact_mut(8);
        for chunk in &mut chunks {
            (-Lanes::load(simd, chunk).ln()).store(chunk);
        }
        for u in chunks.into_remainder() {
            *u = -crate::math::ln(*u);
        }
    }
    dispatch!(
        level,
        simd => run(simd, numbers),
        naive => numbers.iter_mut().for_each(|u| *u = -crate::math::ln(*u))
    );
}

/// e^x, in place.
pub(crate) fn exponentials(level: Simd, numbers: &mut [f64]) {
    #[inline(always)]
    fn run<S: Token>(simd: S, numbers: &mut [f64]) {
        let mut chunks = numbers.chunks_exact_mut(8);
        for chunk in &mut chunks {
            Lanes::load(simd, chunk).exp().store(chunk);
        }
        for x in chunks.into_remainder() {
            *x = crate::math::exp(*x);
        }
    }
    dispatch!(
        level,
        simd => run(simd, numbers),
        naive => numbers.iter_mut().for_each(|x| *x = crate::math::exp(*x))
    );
}

#[cfg(test)]
mod tests;
