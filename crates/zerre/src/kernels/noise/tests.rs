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
                let key = NoiseKey { stream: Stream::new(2), purpose: Purpose::Motion, step, block };
                fill_noise(Simd::best(), source, Noise::StandardNormal, key, (BLOCK, usize::MAX), &mut noise);
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
