//! The naive twins: one number after the other.

use super::NoiseKey;
use crate::kernels::BLOCK;
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
        let counter = [first, at.purpose as u32, at.step as u32, (at.step >> 32) as u32];
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

pub(super) fn uniforms(stream: Stream, step: u64, first: usize, out: &mut [f64]) {
    for (i, out) in out.iter_mut().enumerate() {
        let i = i + first;
        let (chunk, word, half, lane) = (i / 64, i / 16 % 4, i / 8 % 2, i % 8);
        let call = (16 * chunk + 2 * lane + half) as u32;
        let counter = [call, Purpose::Resample as u32, step as u32, (step >> 32) as u32];
        *out = (f64::from(philox4x32(stream.key(), counter)[word]) + 0.5) * (1.0 / 4_294_967_296.0);
    }
}
