//! Counter-based random numbers: any number of any stream can be had without drawing those before it, so results
//! do not depend on the order of work, the number of threads or the width of SIMD.
//!
//! # Bit layout
//! One call of Philox4x32-10 (Salmon, Moraes, Dror, Shaw, SC 2011) turns a 64-bit key and a 128-bit counter into
//! 128 random bits:
//!
//! | word | content |
//! |---|---|
//! | key 0, 1 | seed, low and high half; [`Stream::fork`] replaces it by a hash of itself and a label (target, run) |
//! | counter 0 | index: particle, or number of the call where one call serves several particles |
//! | counter 1 | bits 0..8 the [`Purpose`], bits 8..32 the number of the call of the same index (1: seeds of xoshiro) |
//! | counter 2, 3 | step, low and high half |

use crate::math::Real;
use serde::{Deserialize, Serialize};

/// What random numbers are for: numbers of different purposes are independent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[non_exhaustive]
pub enum Purpose {
    /// The first particles.
    Prior = 0,
    /// Process noise.
    Motion = 1,
    /// Resampling.
    Resample = 2,
    /// Roughening after resampling.
    Roughen = 3,
    /// Measurement noise of a simulation.
    Measurement = 4,
    /// Process noise of a simulation.
    Truth = 6,
    /// Anything else of the caller.
    Other = 5,
    /// Modes of a Markov chain.
    Mode = 7,
    /// Moves of static parameters.
    Parameter = 11,
    /// Perturbations of the measurements of an ensemble.
    Ensemble = 12,
    /// Paths drawn backwards by smoothers.
    Path = 10,
    /// Process noise from a proposal that is not its own law.
    Propose = 8,
    /// Markov moves.
    Move = 9,
    /// Deriving keys.
    Fork = 255,
}

/// A family of random streams: a key. Copy it freely; the numbers depend on key, purpose, step and index only.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Stream {
    key: [u32; 2],
}

impl Stream {
    /// The streams of a seed.
    pub fn new(seed: u64) -> Stream {
        Stream { key: [seed as u32, (seed >> 32) as u32] }
    }

    /// An independent family: of another target, another run, a cloned belief. The same label gives the same
    /// family; two labels give the same one with probability 2^-64.
    #[must_use]
    pub fn fork(self, label: u64) -> Stream {
        let [a, b, ..] = philox4x32(self.key, [label as u32, Purpose::Fork as u32, (label >> 32) as u32, 0]);
        Stream { key: [a, b] }
    }

    /// The key words, for kernels that compute the same numbers eight at a time.
    pub(crate) fn key(self) -> [u32; 2] {
        self.key
    }

    /// A sequence of numbers for one purpose, step and index.
    pub fn draws(self, purpose: Purpose, step: u64, index: u32) -> Draws {
        let counter = [index, purpose as u32, step as u32, (step >> 32) as u32];
        Draws { key: self.key, counter, words: [0; 4], used: 4, spare_normal: None }
    }
}

/// Philox4x32 with ten rounds.
pub fn philox4x32(key: [u32; 2], counter: [u32; 4]) -> [u32; 4] {
    let [mut k0, mut k1] = key;
    let [mut c0, mut c1, mut c2, mut c3] = counter;
    for _ in 0..PHILOX_ROUNDS {
        let p0 = u64::from(PHILOX_M0) * u64::from(c0);
        let p1 = u64::from(PHILOX_M1) * u64::from(c2);
        (c0, c1, c2, c3) = ((p1 >> 32) as u32 ^ c1 ^ k0, p1 as u32, (p0 >> 32) as u32 ^ c3 ^ k1, p0 as u32);
        k0 = k0.wrapping_add(PHILOX_W0);
        k1 = k1.wrapping_add(PHILOX_W1);
    }
    [c0, c1, c2, c3]
}

pub(crate) const PHILOX_ROUNDS: usize = 10;
pub(crate) const PHILOX_M0: u32 = 0xD251_1F53;
pub(crate) const PHILOX_M1: u32 = 0xCD9E_8D57;
pub(crate) const PHILOX_W0: u32 = 0x9E37_79B9;
pub(crate) const PHILOX_W1: u32 = 0xBB67_AE85;

/// Scalar random numbers of full resolution, one after the other; they repeat after 2^26 words of 32 bits.
#[derive(Clone, Debug)]
pub struct Draws {
    key: [u32; 2],
    counter: [u32; 4],
    words: [u32; 4],
    used: usize,
    spare_normal: Option<f64>,
}

impl Draws {
    /// 32 random bits.
    pub fn next_u32(&mut self) -> u32 {
        if self.used == 4 {
            self.words = philox4x32(self.key, self.counter);
            self.counter[1] = self.counter[1].wrapping_add(1 << 8);
            self.used = 0;
        }
        self.used += 1;
        self.words[self.used - 1]
    }

    /// 64 random bits.
    pub fn next_u64(&mut self) -> u64 {
        u64::from(self.next_u32()) | u64::from(self.next_u32()) << 32
    }

    /// Uniform on (0, 1): the middle of one of 2^52 equal cells, never 0 or 1.
    pub fn uniform(&mut self) -> f64 {
        unit_open(self.next_u64())
    }

    /// Standard normal, by Box and Muller in pairs.
    pub fn normal(&mut self) -> f64 {
        if let Some(z) = self.spare_normal.take() {
            return z;
        }
        let radius = (Real::ln(self.uniform()) * -2.0).sqrt();
        let (s, c) = Real::sin_cos(self.uniform() * std::f64::consts::TAU);
        self.spare_normal = Some(radius * s);
        radius * c
    }

    /// Gamma with the given shape and scale 1 (Marsaglia and Tsang, ACM TOMS 26, 2000); NaN unless `shape` > 0.
    pub fn gamma(&mut self, shape: f64) -> f64 {
        if shape.is_nan() || shape <= 0.0 {
            return f64::NAN;
        }
        if shape < 1.0 {
            let boost = Real::exp(Real::ln(self.uniform()) / shape);
            return self.gamma(shape + 1.0) * boost;
        }
        let d = shape - 1.0 / 3.0;
        let c = 1.0 / (9.0 * d).sqrt();
        loop {
            let x = self.normal();
            let v = 1.0 + c * x;
            if v > 0.0 {
                let v = v * v * v;
                if Real::ln(self.uniform()) < 0.5 * x * x + d - d * v + d * Real::ln(v) {
                    return d * v;
                }
            }
        }
    }
}

/// The middle of cell number `bits` / 2^12 of the 2^52 equal cells of (0, 1).
#[inline(always)]
pub(crate) fn unit_open(bits: u64) -> f64 {
    ((bits >> 12) as f64 + 0.5) * f64::EPSILON
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known answers of the Random123 distribution (`kat_vectors`, philox4x32 10).
    #[test]
    fn philox_gives_the_known_answers() {
        let all = u32::MAX;
        assert_eq!(philox4x32([0, 0], [0; 4]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        assert_eq!(philox4x32([all; 2], [all; 4]), [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]);
        assert_eq!(
            philox4x32([0xa409_3822, 0x299f_31d0], [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344]),
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]
        );
    }

    #[test]
    fn uniforms_stay_inside_the_open_interval() {
        assert!(unit_open(0) > 0.0 && unit_open(u64::MAX) < 1.0);
    }

    /// Sample moments of n draws lie within 5 standard errors, sd(x^k) / sqrt(n), of the law's.
    #[test]
    fn normals_and_gammas_have_their_moments() {
        let n = 200_000;
        let mut draws = Stream::new(7).draws(Purpose::Other, 0, 0);
        let mut sums = [0.0; 5];
        for _ in 0..n {
            let z = draws.normal();
            let g = draws.gamma(3.0);
            let h = draws.gamma(0.5);
            for (sum, value) in sums.iter_mut().zip([z, z * z, z * z * z * z, g, h]) {
                *sum += value;
            }
        }
        // Standard deviations of z, z^2, z^4, Gamma(3), Gamma(1/2).
        let laws =
            [(0.0, 1.0), (1.0, 2f64.sqrt()), (3.0, 96f64.sqrt()), (3.0, 3f64.sqrt()), (0.5, 0.5f64.sqrt())];
        for (sum, (mean, sd)) in sums.iter().zip(laws) {
            let error = (sum / f64::from(n) - mean).abs();
            assert!(error < 5.0 * sd / f64::from(n).sqrt(), "{mean}: off by {error}");
        }
    }

    #[test]
    fn forks_differ_and_repeat() {
        let root = Stream::new(1);
        assert_eq!(root.fork(3), root.fork(3));
        assert_ne!(root.fork(3), root.fork(4));
        assert_ne!(root.fork(3), root);
    }
}
