//! Each kernel keeps laws that it is started from, and finds them from elsewhere.

use super::*;
use crate::math::Cholesky;

const KERNELS: [Move; 4] =
    [Move::RandomWalk { scale: None }, Move::RandomWalk { scale: Some(0.5) }, Move::Stretch, Move::Gibbs];

/// Two components: the first gamma with shape 4, the second normal about half of the first.
struct Curved;

impl Law<2> for Curved {
    fn log_density(&self, _: usize, states: &[&[f64]; 2], out: &mut [f64]) {
        for (i, out) in out.iter_mut().enumerate() {
            let [x, y] = states.map(|c| c[i]);
            let r = y - 0.5 * x;
            *out = if x > 0.0 { 3.0 * Real::ln(x) - x - 0.5 * r * r } else { f64::NEG_INFINITY };
        }
    }
}

fn densities(states: &[Vec<f64>; 2]) -> Vec<f64> {
    let mut out = vec![0.0; states[0].len()];
    Curved.log_density(0, &states.each_ref().map(Vec::as_slice), &mut out);
    out
}

fn walk(threads: &Threads, step: u64) -> Walk<'_, 2> {
    // Var x = 4, Var y = 1 + 4 / 4, Cov = 2.
    let covariance = Matrix([[4.0, 2.0], [2.0, 2.0]]);
    let spread = *Cholesky::of("covariance", &covariance).unwrap().factor();
    Walk { stream: Stream::new(5), step, threads, spread }
}

/// Means of x, x^2, x^3, y, y^2 and xy against E x^k = 4, 20, 120, 840 (k = 1..4), E y = 2, E y^2 = 1 + 20 /
/// 4 and E xy = 10, in standard deviations of one draw.
fn moments(states: &[Vec<f64>; 2]) -> [f64; 6] {
    let [x, y] = states;
    let mean =
        |f: &dyn Fn(f64, f64) -> f64| x.iter().zip(y).map(|(&x, &y)| f(x, y)).sum::<f64>() / x.len() as f64;
    // Standard deviations: of x 2; of x^2 sqrt(840 - 400); of x^3 sqrt(E x^6 - 120^2) with E x^6 = 9! / 3!;
    // of y sqrt 2; of y^2 sqrt(E y^4 - 36), E y^4 = 840 / 16 + 6 * 20 / 4 + 3; of xy sqrt(E x^4 / 4 + E x^2 -
    // 100).
    let sd_cube = (362_880.0f64 / 6.0 - 14_400.0).sqrt();
    [
        (mean(&|x, _| x) - 4.0) / 2.0,
        (mean(&|x, _| x * x) - 20.0) / 440f64.sqrt(),
        (mean(&|x, _| x * x * x) - 120.0) / sd_cube,
        (mean(&|_, y| y) - 2.0) / 2f64.sqrt(),
        (mean(&|_, y| y * y) - 6.0) / (52.5 + 30.0 + 3.0 - 36.0f64).sqrt(),
        (mean(&|x, y| x * y) - 10.0) / (210.0 + 20.0 - 100.0f64).sqrt(),
    ]
}

/// Independent draws of the law stay independent draws of it, except that the stretch move ties particles
/// weakly to their partners: means of n of them stay within six standard errors.
#[test]
fn draws_of_a_law_stay_draws_of_it() {
    let n = 60_000;
    let threads = Threads::Serial;
    for kernel in KERNELS {
        let mut draws = Stream::new(3).draws(Purpose::Other, 0, 0);
        let mut states: [Vec<f64>; 2] = from_fn(|_| Vec::with_capacity(n));
        for _ in 0..n {
            let x = draws.gamma(4.0);
            states[0].push(x);
            states[1].push(0.5 * x + draws.normal());
        }
        let mut own = densities(&states);
        let mut frozen = Frozen::new(n);
        for step in 0..3 {
            let moved = kernel.sweep(&walk(&threads, step), &mut states, &mut own, &Curved, &mut frozen);
            assert!(moved.accepted > n / 5, "{kernel:?}: {moved:?}");
        }
        assert_eq!(own, densities(&states), "{kernel:?}");
        for (k, z) in moments(&states).into_iter().enumerate() {
            assert!(z.abs() * (n as f64).sqrt() < 6.0, "{kernel:?}, moment {k}: {z}");
        }
    }
}

/// From a single heap the law is found: after many sweeps the means are within six standard errors of n / 4
/// independent draws, which is less than what the particles are worth.
#[test]
fn the_law_is_found_from_elsewhere() {
    let n = 8_000;
    let threads = Threads::Serial;
    for kernel in KERNELS {
        let mut draws = Stream::new(4).draws(Purpose::Other, 0, 0);
        let mut states: [Vec<f64>; 2] =
            from_fn(|_| (0..n).map(|_| 1.0 + 0.1 * draws.normal().abs()).collect());
        let mut own = densities(&states);
        let mut frozen = Frozen::new(n);
        // The stretch move widens a heap by its own size: it needs the longest.
        for step in 0..300 {
            kernel.sweep(&walk(&threads, step), &mut states, &mut own, &Curved, &mut frozen);
        }
        for (k, z) in moments(&states).into_iter().enumerate() {
            assert!(z.abs() * (n as f64 / 4.0).sqrt() < 6.0, "{kernel:?}, moment {k}: {z}");
        }
    }
}

/// Without its factor z^(N-2) the stretch move, here on one component, settles on a law that is too narrow:
/// the test above can tell.
#[test]
fn the_factor_of_the_stretch_move_matters() {
    struct Normal;
    impl Law<1> for Normal {
        fn log_density(&self, _: usize, states: &[&[f64]; 1], out: &mut [f64]) {
            out.iter_mut().zip(states[0]).for_each(|(out, x)| *out = -0.5 * x * x);
        }
    }
    let n = 20_000;
    let threads = Threads::Serial;
    let variance = |with_factor: bool| {
        let mut draws = Stream::new(6).draws(Purpose::Other, 0, 0);
        let mut states = [(0..n).map(|_| draws.normal()).collect::<Vec<f64>>()];
        let mut own: Vec<f64> = states[0].iter().map(|x| -0.5 * x * x).collect();
        let mut frozen = Frozen::new(n);
        for step in 0..40 {
            let walk = Walk { stream: Stream::new(8), step, threads: &threads, spread: Matrix([[1.0]]) };
            if with_factor {
                Move::Stretch.sweep(&walk, &mut states, &mut own, &Normal, &mut frozen);
            } else {
                let columns = states[0].clone();
                let propose = |draws: &mut Draws, [x]: [f64; 1]| {
                    let z = 2.0 * draws.uniform();
                    let y = columns[(draws.uniform() * n as f64) as usize];
                    ([y + z * (x - y)], 0.0)
                };
                metropolis(&walk, &mut states, &mut own, 0..n, &Normal, &mut frozen.blocks, propose);
            }
        }
        states[0].iter().map(|x| x * x).sum::<f64>() / n as f64
    };
    // The sample variance of n normals has standard deviation sqrt(2 / n) = 0.01.
    assert!((variance(true) - 1.0).abs() < 0.06);
    assert!(variance(false) < 0.8);
}

#[test]
fn threads_change_nothing() {
    let n = 6_000;
    let run = |threads: Threads, kernel: Move| {
        let mut draws = Stream::new(9).draws(Purpose::Other, 0, 0);
        let mut states: [Vec<f64>; 2] = from_fn(|_| (0..n).map(|_| draws.gamma(3.0)).collect());
        let mut own = densities(&states);
        let moved = kernel.sweep(&walk(&threads, 1), &mut states, &mut own, &Curved, &mut Frozen::new(n));
        (states, own, moved)
    };
    for kernel in KERNELS {
        assert_eq!(run(Threads::Serial, kernel), run(Threads::new(3).unwrap(), kernel), "{kernel:?}");
    }
}
