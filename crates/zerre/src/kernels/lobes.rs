//! Points shared among normal lobes.

use super::propagate::load_part;
use super::{LANES, Simd};
use crate::math::{Lanes, Real};
use fearless_simd::Simd as Token;

/// Most lobes that points are shared among.
pub(crate) const MAX_LOBES: usize = 16;

/// ln(weight N(d; offset, X)) = constant - |U (d - offset)|^2 / 2 with U'U = X^-1, U = [[u0, 0], [u1, u2]].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lobe {
    pub offset: [f64; 2],
    pub root: [f64; 3],
    pub constant: f64,
}

/// Sums over points d, each counted by its share in a lobe: of 1, x, y, xx, xy, yy.
pub(crate) type Shared = [f64; 6];

/// Numbers of [`Shared`].
const SUMS: usize = 6;

/// Takes in points at d, `keep` (1 or 0) of each.
#[inline(always)]
fn take<R: Real, const MOST: usize>(
    d: [R; 2],
    keep: R,
    lobes: &[Lobe],
    rest: f64,
    sums: &mut [[R; SUMS]],
    bound: &mut R,
) {
    // Above -inf, so that differences from it are numbers.
    let mut most = keep.constant(rest.max(f64::MIN));
    let mut shares = [most; MOST];
    for (share, lobe) in shares.iter_mut().zip(lobes) {
        let [a, b, c] = lobe.root;
        let (x, y) = (d[0] - lobe.offset[0], d[1] - lobe.offset[1]);
        let u = x * a;
        let v = y.mul_add(y.constant(c), x * b);
        *share = u.mul_add(u, v * v) * -0.5 + lobe.constant;
        most = most.max(*share);
    }
    let mut total = (-most + rest).exp();
    for share in &mut shares[..lobes.len()] {
        *share = (*share - most).exp();
        total = total + *share;
    }
    // Nothing anywhere near: no share is a number, and none is taken.
    total = total.max(total.constant(1e-300));
    let per = keep / total;
    for (share, sums) in shares.iter().zip(sums) {
        let q = *share * per;
        let (qx, qy) = (q * d[0], q * d[1]);
        sums[0] = sums[0] + q;
        sums[1] = sums[1] + qx;
        sums[2] = sums[2] + qy;
        sums[3] = qx.mul_add(d[0], sums[3]);
        sums[4] = qx.mul_add(d[1], sums[4]);
        sums[5] = qy.mul_add(d[1], sums[5]);
    }
    *bound = keep.mul_add(most + total.ln(), *bound);
}

/// Shares the points (x, y) among `lobes` and a background of log-density `rest`, in `sums`; returns the sum over points
/// of ln(sum of all densities).
pub(crate) fn share_points(
    level: Simd,
    [x, y]: [&[f64]; 2],
    lobes: &[Lobe],
    rest: f64,
    sums: &mut [Shared],
) -> f64 {
    #[inline(always)]
    fn run<S: Token, const MOST: usize>(
        simd: S,
        [x, y]: [&[f64]; 2],
        lobes: &[Lobe],
        rest: f64,
        sums: &mut [Shared],
    ) -> f64 {
        let zero = Lanes::splat(simd, 0.0);
        let mut all = [[zero; SUMS]; MOST];
        let (mut bound, keep) = (zero, Lanes::splat(simd, 1.0));
        let whole = x.len() / LANES * LANES;
        for i in (0..whole).step_by(LANES) {
            let d = [Lanes::load(simd, &x[i..i + LANES]), Lanes::load(simd, &y[i..i + LANES])];
            take::<_, MOST>(d, keep, lobes, rest, &mut all[..lobes.len()], &mut bound);
        }
        if whole < x.len() {
            let mut mask = [0.0; LANES];
            mask[..x.len() - whole].fill(1.0);
            let d = [load_part(simd, &x[whole..]), load_part(simd, &y[whole..])];
            take::<_, MOST>(d, Lanes::load(simd, &mask), lobes, rest, &mut all[..lobes.len()], &mut bound);
        }
        let sum = |lanes: Lanes<S>| {
            let mut out = [0.0; LANES];
            lanes.store(&mut out);
            fold(&out)
        };
        for (sums, lanes) in sums.iter_mut().zip(all) {
            *sums = lanes.map(sum);
        }
        sum(bound)
    }
    fn naive<const MOST: usize>([x, y]: [&[f64]; 2], lobes: &[Lobe], rest: f64, sums: &mut [Shared]) -> f64 {
        let mut bound = [0.0; LANES];
        let mut all = [[[0.0; LANES]; SUMS]; MOST];
        for lane in 0..LANES {
            let mut of_lane = [[0.0; SUMS]; MOST];
            for first in (0..x.len()).step_by(LANES) {
                let i = first + lane;
                let (at, keep) = if i < x.len() { (i, 1.0) } else { (first, 0.0) };
                let own = &mut of_lane[..lobes.len()];
                take::<_, MOST>([x[at], y[at]], keep, lobes, rest, own, &mut bound[lane]);
            }
            for (sums, one) in all.iter_mut().zip(of_lane) {
                for (sum, one) in sums.iter_mut().zip(one) {
                    sum[lane] = one;
                }
            }
        }
        for (sums, lanes) in sums.iter_mut().zip(&all) {
            *sums = std::array::from_fn(|k| fold(&lanes[k]));
        }
        fold(&bound)
    }
    assert!(x.len() == y.len() && lobes.len() <= MAX_LOBES && sums.len() == lobes.len());
    // Few lobes are the rule, and much less to keep at hand.
    macro_rules! at_most {
        ($most:expr) => {
            dispatch!(
                level,
                simd => run::<_, $most>(simd, [x, y], lobes, rest, sums),
                naive => naive::<$most>([x, y], lobes, rest, sums)
            )
        };
    }
    if lobes.len() <= 4 { at_most!(4) } else { at_most!(MAX_LOBES) }
}

fn fold(lanes: &[f64; LANES]) -> f64 {
    lanes.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{Purpose, Stream};

    /// Every level gives the bits of the scalar twin, and the sums are those of the shares written out.
    #[test]
    fn levels_agree_and_shares_are_right() {
        let mut draws = Stream::new(1).draws(Purpose::Prior, 0, 0);
        let lobes: Vec<Lobe> = (0..3)
            .map(|_| Lobe {
                offset: [draws.normal(), draws.normal()],
                root: [1.0 + draws.uniform(), draws.normal(), 1.0 + draws.uniform()],
                constant: draws.normal(),
            })
            .collect();
        for n in [0, 1, 7, 8, 9, 33] {
            let (x, y): (Vec<f64>, Vec<f64>) = (0..n).map(|_| (draws.normal(), draws.normal())).unzip();
            for rest in [f64::NEG_INFINITY, -1.0] {
                let of = |level| {
                    let mut sums = [[0.0; SUMS]; 3];
                    let bound = share_points(level, [&x, &y], &lobes, rest, &mut sums);
                    (sums, bound)
                };
                let expected = of(Simd::scalar());
                assert_eq!(of(Simd::best()), expected);
                let (mut sums, mut bound) = ([[0.0; SUMS]; 3], 0.0);
                for (x, y) in x.iter().zip(&y) {
                    let density: Vec<f64> = lobes
                        .iter()
                        .map(|lobe| {
                            let (dx, dy) = (x - lobe.offset[0], y - lobe.offset[1]);
                            let (u, v) = (lobe.root[0] * dx, lobe.root[1] * dx + lobe.root[2] * dy);
                            (lobe.constant - 0.5 * (u * u + v * v)).exp()
                        })
                        .collect();
                    let total: f64 = density.iter().sum::<f64>() + rest.exp();
                    bound += total.ln();
                    for (sums, density) in sums.iter_mut().zip(&density) {
                        let share = density / total;
                        for (sum, term) in sums.iter_mut().zip([1.0, *x, *y, x * x, x * y, y * y]) {
                            *sum += share * term;
                        }
                    }
                }
                // Some tens of roundings each of numbers up to tens.
                let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12 * (1.0 + n as f64), "{a} {b}");
                close(expected.1, bound);
                expected.0.iter().flatten().zip(sums.iter().flatten()).for_each(|(a, b)| close(*a, *b));
            }
        }
        // Points that nobody explains are nobody's.
        let mut sums = [[0.0; SUMS]; 3];
        let bound = share_points(Simd::best(), [&[1e200], &[0.0]], &lobes, f64::NEG_INFINITY, &mut sums);
        assert!(bound < -1e300 && sums.iter().flatten().all(|s| !s.is_nan()));
    }
}
