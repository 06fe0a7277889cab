//! Process noise of a block of particles.
//!
//! A block of `B` particles (a multiple of 64, at most [`BLOCK`]) with `W` noise components needs `W B` numbers, laid
//! out as `W` rows of `B`. With 32-bit resolution, Philox call `q` of the block gives four of them by two Box-Muller
//! transforms: words 0 and 1 the numbers `q` and `q + W B / 4`, words 2 and 3 the numbers `q + 2 W B / 4` and
//! `q + 3 W B / 4`. With full resolution a call gives the numbers `q` and `q + W B / 2`. Call `q` of block `b` has the
//! counter `b W BLOCK + q`: every number belongs to one particle, one component and one step.

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
    /// One 32-bit word for the radius and one for the angle, computed in `f32`: the numbers lie within +-6.77 and are off by
    /// at most 2.4e-4 near zero and 1e-6 of themselves elsewhere.
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
pub(crate) struct NoiseBlock<const W: usize> {
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
        // SAFETY: inside the union; the slice is only written before it is read.
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
    pub(crate) step: u64,
    pub(crate) block: usize,
}

/// Fills `noise` for the first `count` particles of a block.
pub(crate) fn fill_noise<const W: usize>(
    level: Simd,
    source: NoiseSource,
    law: Noise,
    key: NoiseKey,
    count: usize,
    noise: &mut NoiseBlock<W>,
) {
    let width = count.div_ceil(64) * 64;
    match law {
        Noise::StandardNormal => match source.resolution {
            Resolution::Bits32 => {
                let out = noise.single_mut(width);
                match source.generator {
                    Generator::Philox => dispatch!(
                        level,
                        simd => normals32::<_, Counter>(simd, key, W, out),
                        naive => naive::normals32(naive::Counter::new(key, W), out)
                    ),
                    Generator::Xoshiro => dispatch!(
                        level,
                        simd => normals32::<_, Lanewise<_>>(simd, key, W, out),
                        naive => naive::normals32(naive::Lanewise::new(key, W), out)
                    ),
                }
            }
            Resolution::Bits64 => {
                let out = noise.double_mut(width);
                match source.generator {
                    Generator::Philox => dispatch!(
                        level,
                        simd => normals64::<_, Counter>(simd, key, W, out),
                        naive => naive::normals64(naive::Counter::new(key, W), out)
                    ),
                    Generator::Xoshiro => dispatch!(
                        level,
                        simd => normals64::<_, Lanewise<_>>(simd, key, W, out),
                        naive => naive::normals64(naive::Lanewise::new(key, W), out)
                    ),
                }
            }
        },
        Noise::Gamma { shape } => {
            let out = noise.double_mut(width);
            out.fill(0.0);
            let first = (key.block * BLOCK) as u32;
            for (i, particle) in (first..).take(count).enumerate() {
                let mut draws = key.stream.draws(Purpose::Motion, key.step, particle);
                for w in 0..W {
                    out[w * width + i] = draws.gamma(shape);
                }
            }
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
            rest: [Purpose::Motion as u32, at.step as u32, (at.step >> 32) as u32],
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

/// Uniform numbers on (0, 1) with 32-bit resolution, for resampling: number `64 c + 16 w + 8 h + j` is the middle of the
/// cell that word `w` of call `16 c + 2 j + h` names. `first` is a multiple of 64; `out` may have any length.
pub(crate) fn fill_uniforms(
    level: Simd,
    stream: Stream,
    step: u64,
    draw: u32,
    first: usize,
    out: &mut [f64],
) {
    dispatch!(
        level,
        simd => uniforms(simd, stream, step, draw, first, out),
        naive => naive::uniforms(stream, step, draw, first, out)
    );
}

#[inline(always)]
fn uniforms<S: Token>(simd: S, stream: Stream, step: u64, draw: u32, first: usize, out: &mut [f64]) {
    debug_assert!(first.is_multiple_of(64));
    let rest = [Purpose::Resample as u32 | draw << 8, step as u32, (step >> 32) as u32];
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

/// The naive twins: one number after the other.
mod naive {
    use super::{BLOCK, NoiseKey};
    use crate::math::Real;
    use crate::rng::{Purpose, Stream, philox4x32, unit_open};

    /// Call after call of four words.
    pub(super) struct Counter {
        key: [u32; 2],
        counter: [u32; 4],
    }

    impl Counter {
        pub(super) fn new(at: NoiseKey, components: usize) -> Self {
            let first = (at.block as u32).wrapping_mul((components * BLOCK) as u32);
            let counter = [first, Purpose::Motion as u32, at.step as u32, (at.step >> 32) as u32];
            Counter { key: at.stream.key(), counter }
        }
    }

    impl Iterator for Counter {
        type Item = [u32; 4];
        fn next(&mut self) -> Option<[u32; 4]> {
            let words = philox4x32(self.key, self.counter);
            self.counter[0] = self.counter[0].wrapping_add(1);
            Some(words)
        }
    }

    /// Eight xoshiro256++ generators; four rounds of them give the words of sixteen calls.
    pub(super) struct Lanewise {
        state: [[u64; 8]; 4],
        words: [[u32; 16]; 4],
        used: usize,
    }

    impl Lanewise {
        pub(super) fn new(at: NoiseKey, components: usize) -> Self {
            let mut calls = Counter::new(at, components);
            calls.counter[1] |= 1 << 8;
            let calls: [[u32; 4]; 16] = std::array::from_fn(|_| calls.next().unwrap_or_default());
            let word = |w: usize, j: usize| u64::from(calls[2 * j][w]) | u64::from(calls[2 * j + 1][w]) << 32;
            let state = std::array::from_fn(|w| std::array::from_fn(|j| word(w, j)));
            Lanewise { state, words: [[0; 16]; 4], used: 16 }
        }

        fn round(&mut self) -> [u32; 16] {
            let mut out = [0; 16];
            for j in 0..8 {
                let [s0, s1, s2, s3] = self.state.map(|s| s[j]);
                let result = (s0.wrapping_add(s3)).rotate_left(23).wrapping_add(s0);
                (out[2 * j], out[2 * j + 1]) = (result as u32, (result >> 32) as u32);
                let t = s1 << 17;
                let (s2, s3) = (s2 ^ s0, s3 ^ s1);
                let (s1, s0) = (s1 ^ s2, s0 ^ s3);
                for (state, new) in self.state.iter_mut().zip([s0, s1, s2 ^ t, s3.rotate_left(45)]) {
                    state[j] = new;
                }
            }
            out
        }
    }

    impl Iterator for Lanewise {
        type Item = [u32; 4];
        fn next(&mut self) -> Option<[u32; 4]> {
            if self.used == 16 {
                self.words = [self.round(), self.round(), self.round(), self.round()];
                self.used = 0;
            }
            self.used += 1;
            Some(self.words.map(|w| w[self.used - 1]))
        }
    }

    pub(super) fn normals32(calls: impl Iterator<Item = [u32; 4]>, out: &mut [f32]) {
        let quarter = out.len() / 4;
        for (q, [w0, w1, w2, w3]) in calls.take(quarter).enumerate() {
            (out[q], out[q + quarter]) = box_muller32(w0, w1);
            (out[q + 2 * quarter], out[q + 3 * quarter]) = box_muller32(w2, w3);
        }
    }

    fn box_muller32(radius: u32, angle: u32) -> (f32, f32) {
        let r = radius32(radius);
        let theta = (angle << 2) as i32 as f32 * (std::f32::consts::FRAC_PI_4 / 2_147_483_648.0);
        let z = theta * theta;
        let s = z.mul_add(-0.000_195_878_67, 0.008_332_748).mul_add(z, -0.166_666_64);
        let s = (theta * z).mul_add(s, theta);
        let c = z.mul_add(2.454_791_7e-5, -0.001_388_830_2).mul_add(z, 0.041_666_664);
        let c = (z * z).mul_add(c, z.mul_add(-0.5, 1.0));
        let c = f32::from_bits(c.to_bits() ^ (angle & 0x8000_0000));
        if angle & 0x4000_0000 != 0 { (r * s, r * c) } else { (r * c, r * s) }
    }

    /// sqrt(-2 ln u) for u = (word + 1/2) / 2^32.
    pub(super) fn radius32(word: u32) -> f32 {
        let u = (word as f32).mul_add(1.0 / 4_294_967_296.0, 0.5 / 4_294_967_296.0);
        let shifted = u.to_bits().wrapping_sub(0x3f35_04f3);
        let exponent = ((shifted as i32) >> 23) as f32;
        let f = f32::from_bits((shifted & 0x007f_ffff) + 0x3f35_04f3) - 1.0;
        let mut p: f32 = -2.0 * 0.085_333_13;
        for c in [
            -0.142_692_58f32,
            0.149_774_01,
            -0.165_779_93,
            0.199_559_33,
            -0.250_013_53,
            0.333_341_93,
            -0.499_999_97,
        ] {
            p = p.mul_add(f, -2.0 * c);
        }
        f.mul_add(p.mul_add(f, -2.0), exponent * (-2.0 * std::f32::consts::LN_2)).sqrt()
    }

    pub(super) fn normals64(calls: impl Iterator<Item = [u32; 4]>, out: &mut [f64]) {
        let half = out.len() / 2;
        for (q, [w0, w1, w2, w3]) in calls.take(half).enumerate() {
            let wide = |low: u32, high: u32| u64::from(low) | u64::from(high) << 32;
            let r = (Real::ln(unit_open(wide(w0, w1))) * -2.0).sqrt();
            let (s, c) = Real::sin_cos(unit_open(wide(w2, w3)) * std::f64::consts::TAU);
            (out[q], out[q + half]) = (r * c, r * s);
        }
    }

    pub(super) fn uniforms(stream: Stream, step: u64, draw: u32, first: usize, out: &mut [f64]) {
        for (i, out) in out.iter_mut().enumerate() {
            let i = i + first;
            let (chunk, word, half, lane) = (i / 64, i / 16 % 4, i / 8 % 2, i % 8);
            let call = (16 * chunk + 2 * lane + half) as u32;
            let counter = [call, Purpose::Resample as u32 | draw << 8, step as u32, (step >> 32) as u32];
            *out = (f64::from(philox4x32(stream.key(), counter)[word]) + 0.5) * (1.0 / 4_294_967_296.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCES: [NoiseSource; 4] = [
        NoiseSource { generator: Generator::Philox, resolution: Resolution::Bits32 },
        NoiseSource { generator: Generator::Philox, resolution: Resolution::Bits64 },
        NoiseSource { generator: Generator::Xoshiro, resolution: Resolution::Bits32 },
        NoiseSource { generator: Generator::Xoshiro, resolution: Resolution::Bits64 },
    ];

    /// `blocks` blocks of `steps` steps: rows of components, one number per particle.
    fn draw<const W: usize>(source: NoiseSource, steps: u64, blocks: usize) -> Vec<[Vec<f64>; W]> {
        let mut noise = NoiseBlock::<W>::new();
        (0..steps)
            .map(|step| {
                let mut rows = std::array::from_fn(|_| Vec::with_capacity(blocks * BLOCK));
                for block in 0..blocks {
                    let key = NoiseKey { stream: Stream::new(2), step, block };
                    fill_noise(Simd::best(), source, Noise::StandardNormal, key, BLOCK, &mut noise);
                    for (w, row) in rows.iter_mut().enumerate() {
                        row.extend((0..BLOCK).map(|i| noise.number(w, i)));
                    }
                }
                rows
            })
            .collect()
    }

    /// The largest deviation of a sample moment, in standard errors: E[z^k] of 1 to 6, with Var[z^k] = E[z^2k] -
    /// E[z^k]^2 of the normal law.
    fn moments(numbers: impl Iterator<Item = f64>) -> f64 {
        let mut sums = [0.0; 6];
        let mut n = 0.0;
        for z in numbers {
            let mut power = 1.0;
            for sum in &mut sums {
                power *= z;
                *sum += power;
            }
            n += 1.0;
        }
        // E[z^k], k = 0 to 12.
        let law = [1.0, 0.0, 1.0, 0.0, 3.0, 0.0, 15.0, 0.0, 105.0, 0.0, 945.0, 0.0, 10_395.0];
        let deviation = |(i, sum): (usize, &f64)| {
            let (k, sd) = (i + 1, (law[2 * i + 2] - law[i + 1] * law[i + 1]).sqrt());
            (sum / n - law[k]).abs() / (sd / f64::sqrt(n))
        };
        sums.iter().enumerate().map(deviation).fold(0.0, f64::max)
    }

    /// 4 sources with 6 moments: beyond 4.5 standard errors with probability 24 * 7e-6. Of 2 million numbers the
    /// sixth moment is known to 0.5 %; what lies beyond the largest 32-bit number adds 1e-6 to it.
    #[test]
    fn moments_to_the_sixth() {
        for source in SOURCES {
            let numbers = draw::<4>(source, 8, 256);
            let worst = moments(numbers.iter().flatten().flatten().copied());
            assert!(worst < 4.5, "{source:?}: {worst} standard errors");
            // Numbers that are 1 % too large, of which the tails are cut at 4.5, or that lean by half a percent.
            let of = |f: fn(f64) -> f64| moments(numbers.iter().flatten().flatten().map(|&z| f(z)));
            assert!(of(|z| z * 1.01) > 4.5 && of(|z| z + 0.005) > 4.5);
            assert!(of(|z| z.clamp(-3.5, 3.5)) > 4.5);
        }
    }

    /// Correlation of numbers and of their squares (the two halves of a Box-Muller pair share a radius), between
    /// components, particles, blocks and steps. Of n pairs it has a standard deviation of 1 / sqrt(n); there are about
    /// 250 comparisons per source: beyond 5 with probability 6e-4 in all.
    #[test]
    fn numbers_are_independent() {
        fn correlation<'a>(a: impl Iterator<Item = &'a f64>, b: impl Iterator<Item = &'a f64>) -> [f64; 2] {
            let (mut sums, mut n) = ([0.0; 2], 0.0);
            for (a, b) in a.zip(b) {
                // z^2 - 1 has variance 2.
                sums[0] += a * b;
                sums[1] += (a * a - 1.0) * (b * b - 1.0) / 2.0;
                n += 1.0;
            }
            sums.map(|s| (s / f64::sqrt(n)).abs())
        }
        for source in SOURCES {
            let steps = draw::<4>(source, 3, 128);
            let check = |what: &str, found: [f64; 2]| {
                assert!(found.iter().all(|&c| c < 5.0), "{source:?}, {what}: {found:?} / sqrt(n)");
            };
            for a in 0..4 {
                let row = &steps[0][a];
                for (b, other) in steps[0].iter().enumerate().skip(a + 1) {
                    check(&format!("components {a} and {b}"), correlation(row.iter(), other.iter()));
                }
                for step in 1..3 {
                    for b in 0..4 {
                        let other = &steps[step][b];
                        check(&format!("steps 0 and {step}"), correlation(row.iter(), other.iter()));
                    }
                }
                // Neighbours, lanes, vectors, quarters and halves of a block, blocks.
                for lag in [1, 2, 3, 4, 7, 8, 15, 16, 32, 63, 64, 127, 128, 255, 256, 512] {
                    check(&format!("lag {lag}"), correlation(row.iter(), row.iter().skip(lag)));
                }
            }
        }
        // It finds a copy at any of these places.
        let steps = draw::<1>(NoiseSource::default(), 1, 16);
        let row = &steps[0][0];
        let copy: Vec<f64> = row.iter().enumerate().map(|(i, &z)| if i % 4 == 0 { -z } else { z }).collect();
        let [linear, squares] = correlation(row.iter(), copy.iter());
        assert!(linear > 5.0 && squares > 5.0);
    }

    /// P(|z| > k) of z = r cos(angle) for a uniform angle: the share of words, weighted by 2/pi acos(k / r). `radius`
    /// gives r of a word; all of the 2^20 words of the largest radii are taken, of the rest one in 4097.
    fn tail_mass(radius: fn(u32) -> f32, k: f64) -> f64 {
        let beyond = |word: u32| {
            let r = f64::from(radius(word));
            if r > k { (k / r).acos() * std::f64::consts::FRAC_2_PI } else { 0.0 }
        };
        let all: f64 = (0..1 << 20).map(beyond).sum();
        let sampled: f64 = ((1u64 << 20)..1 << 32).skip(2048).step_by(4097).map(|w| beyond(w as u32)).sum();
        (all + 4097.0 * sampled) / 4_294_967_296.0
    }

    /// Exact tails, 2 Q(k), k = 1 to 6 (tables of the error function).
    const TAILS: [f64; 6] = [
        0.317_310_507_862_914_15,
        0.045_500_263_896_358_42,
        0.002_699_796_063_260_189_6,
        6.334_248_366_623_996e-5,
        5.733_031_437_583_869e-7,
        1.973_175_290_075_396e-9,
    ];

    /// The mass beyond k is the integral over u of a function that falls from at most 1 to 0, here summed over cells
    /// of width h around their middles: off by at most h, with h = 2^-32 where all words are taken and 4097 times that
    /// for what the sampled part holds of the function, which is at most its value at u = 2^-12. Rounding of r, u and
    /// the polynomial is below 1e-6 of r, which moves the mass by k^2 + 1 times that share.
    fn tails(radius: fn(u32) -> f32) -> std::result::Result<(), String> {
        for (k, exact) in (1..).zip(TAILS) {
            let k = f64::from(k);
            let found = tail_mass(radius, k);
            let cell = 1.0 / 4_294_967_296.0;
            let edge = (24.0 * std::f64::consts::LN_2).sqrt() * 1.000_001;
            let sampled = if edge > k { (k / edge).acos() * std::f64::consts::FRAC_2_PI } else { 0.0 };
            let allowed = cell + 4097.0 * cell * sampled + 1e-6 * (k * k + 1.0) * exact;
            if (found - exact).abs() > allowed {
                return Err(format!("P(|z| > {k}) = {found:e}, not {exact:e} +- {allowed:e}"));
            }
        }
        Ok(())
    }

    #[test]
    fn tails_are_normal_to_the_resolution_of_the_words() {
        tails(naive::radius32).unwrap();
        // 24 bits end at 5.9: nothing lies beyond 6.
        assert!(tails(|word| naive::radius32(word | 0xff)).unwrap_err().contains("> 5)"));
        // The ends of the cells instead of their middles are an infinity at one end, and half a cell elsewhere.
        assert!(tails(|word| naive::radius32(word.saturating_add(1) / 2)).is_err());
    }

    /// The radius itself beside f64, over the extreme words and one in 4097 of the others: within 1e-6 of its size,
    /// and near zero, where u rounds to a multiple of 2^-24 beside 1, with r^2 = -2 ln u within 2 du / u of its value
    /// for du just above 2^-25. Never NaN.
    #[test]
    fn radius_of_every_kind_of_word() {
        let words = (0..1u64 << 20)
            .chain(((1 << 20)..(1 << 32) - (1 << 20)).step_by(4097))
            .chain((1 << 32) - (1 << 20)..1 << 32);
        for word in words {
            let u = (word as f64 + 0.5) / 4_294_967_296.0;
            let exact = -2.0 * u.ln();
            let found = f64::from(naive::radius32(word as u32)).powi(2);
            let near_one = if u > 0.5 { 2.01 * 2.0f64.powi(-25) / u } else { 0.0 };
            assert!((found - exact).abs() <= 2e-6 * exact + near_one, "{word}: {found} {exact}");
        }
    }
}
