//! Philox4x32-10, sixteen calls at a time: the same words as [`crate::rng::philox4x32`].

use crate::rng::{PHILOX_M0, PHILOX_M1, PHILOX_ROUNDS, PHILOX_W0, PHILOX_W1};
use fearless_simd::{Level, Simd, prelude::*, u32x16, u64x4, u64x8};

/// Words of sixteen calls with counters (`first` + 0..16, `c1`, `c2`, `c3`).
#[inline(always)]
pub(super) fn philox_x16<S: Simd>(simd: S, key: [u32; 2], first: u32, rest: [u32; 3]) -> [u32x16<S>; 4] {
    // Calls of even and of odd number in the low halves of 64-bit lanes: merged, they are in natural order.
    let even: u64x8<S> = [0u64, 2, 4, 6, 8, 10, 12, 14].simd_into(simd);
    let first = u64x8::splat(simd, u64::from(first));
    let start = even + first;
    let [a0, a1, a2, a3] = rounds(simd, key, start, rest);
    let [b0, b1, b2, b3] = rounds(simd, key, start + u64x8::splat(simd, 1), rest);
    [merge(simd, a0, b0), merge(simd, a1, b1), merge(simd, a2, b2), merge(simd, a3, b3)]
}

/// The ten rounds on eight counters. Only the low half of each lane has a meaning.
///
/// Three of the four counter words are the same in all lanes: half of the first two rounds is scalar arithmetic, which
/// the caller's loop needs once.
#[inline(always)]
fn rounds<S: Simd>(
    simd: S,
    [mut k0, mut k1]: [u32; 2],
    c0: u64x8<S>,
    [c1, c2, c3]: [u32; 3],
) -> [u64x8<S>; 4] {
    let (m0, m1) = (wide(simd, PHILOX_M0), wide(simd, PHILOX_M1));
    let p0 = multiply_low_halves(simd, c0, m0);
    let p1 = u64::from(PHILOX_M1) * u64::from(c2);
    let (s0, s1) = ((p1 >> 32) as u32 ^ c1 ^ k0, p1 as u32);
    let c2 = (p0 >> 32) ^ wide(simd, c3 ^ k1);
    (k0, k1) = (k0.wrapping_add(PHILOX_W0), k1.wrapping_add(PHILOX_W1));

    let s = u64::from(PHILOX_M0) * u64::from(s0);
    let p1 = multiply_low_halves(simd, c2, m1);
    let mut c0 = (p1 >> 32) ^ wide(simd, s1 ^ k0);
    let mut c2 = p0 ^ wide(simd, (s >> 32) as u32 ^ k1);
    let (mut c1, mut c3) = (p1, wide(simd, s as u32));
    (k0, k1) = (k0.wrapping_add(PHILOX_W0), k1.wrapping_add(PHILOX_W1));
    for _ in 2..PHILOX_ROUNDS {
        let p0 = multiply_low_halves(simd, c0, m0);
        let p1 = multiply_low_halves(simd, c2, m1);
        c0 = (p1 >> 32) ^ c1 ^ wide(simd, k0);
        c2 = (p0 >> 32) ^ c3 ^ wide(simd, k1);
        c1 = p1;
        c3 = p0;
        k0 = k0.wrapping_add(PHILOX_W0);
        k1 = k1.wrapping_add(PHILOX_W1);
    }
    [c0, c1, c2, c3]
}

#[inline(always)]
fn wide<S: Simd>(simd: S, c: u32) -> u64x8<S> {
    u64x8::splat(simd, u64::from(c))
}

#[inline(always)]
fn merge<S: Simd>(simd: S, even: u64x8<S>, odd: u64x8<S>) -> u32x16<S> {
    ((even & u64x8::splat(simd, 0xffff_ffff)) | (odd << 32)).bitcast()
}

/// 32 x 32 -> 64 bit products of the low halves of the lanes.
#[inline(always)]
pub(super) fn multiply_low_halves<S: Simd>(simd: S, a: u64x8<S>, b: u64x8<S>) -> u64x8<S> {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{__m256i, __m512i, _mm256_mul_epu32, _mm512_mul_epu32};
        fearless_simd::kernel!(
            #[inline(always)]
            fn product512(avx512: Avx512, a: __m512i, b: __m512i) -> __m512i {
                _mm512_mul_epu32(a, b)
            }
        );
        fearless_simd::kernel!(
            #[inline(always)]
            fn product256(avx2: Avx2, a: __m256i, b: __m256i) -> __m256i {
                _mm256_mul_epu32(a, b)
            }
        );
        match simd.level() {
            Level::Avx512(token) => {
                let (a, b): ([u64; 8], [u64; 8]) = (a.into(), b.into());
                let (a, b): (u64x8<_>, u64x8<_>) = (a.simd_into(token), b.simd_into(token));
                let product: u64x8<_> = product512(token, a.into(), b.into()).simd_into(token);
                let product: [u64; 8] = product.into();
                return product.simd_into(simd);
            }
            Level::Avx2(token) => {
                let (a, b): ([u64; 8], [u64; 8]) = (a.into(), b.into());
                let (a, b): (u64x8<_>, u64x8<_>) = (a.simd_into(token), b.simd_into(token));
                let ((a0, a1), (b0, b1)) = (a.split(), b.split());
                let low: u64x4<_> = product256(token, a0.into(), b0.into()).simd_into(token);
                let high: u64x4<_> = product256(token, a1.into(), b1.into()).simd_into(token);
                let product: [u64; 8] = low.combine(high).into();
                return product.simd_into(simd);
            }
            _ => {}
        }
    }
    let low = u64x8::splat(simd, 0xffff_ffff);
    (a & low) * (b & low)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels;
    use crate::rng::philox4x32;

    #[test]
    fn sixteen_calls_are_sixteen_scalar_calls() {
        for level in kernels::Simd::available() {
            let (key, rest) = ([0x1234_5678, 0x9abc_def0], [0x0000_0701, 42, 3]);
            let words: [[u32; 16]; 4] = dispatch!(
                level,
                simd => philox_x16(simd, key, u32::MAX - 7, rest).map(|w| w.into()),
                naive => continue
            );
            for call in 0..16u32 {
                let expected =
                    philox4x32(key, [(u32::MAX - 7).wrapping_add(call), rest[0], rest[1], rest[2]]);
                for w in 0..4 {
                    assert_eq!(words[w][call as usize], expected[w], "{level:?} call {call} word {w}");
                }
            }
        }
    }
}
