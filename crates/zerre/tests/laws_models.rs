//! Laws that every motion and measurement model keeps. Each law is a function that says what is wrong, so that
//! deliberately broken models can show that it notices.

use std::f64::consts::{PI, TAU};
use zerre::math::{Dual, Real};
use zerre::model::measurement::{self, *};
use zerre::model::motion::{self, *};
use zerre::model::{GaussianMeasurement, Measurement, Motion, Noise, simulate};
use zerre::rng::Stream;
use zerre::{Error, Result, Span, Time};

type Verdict = std::result::Result<(), String>;
type Matrix = Vec<Vec<f64>>;

const EPS: f64 = f64::EPSILON;
/// Steps in seconds: short, irregular, long.
const STEPS: [f64; 5] = [1e-3, 0.37, 1.0, 7.3, 61.7];

fn seconds(secs: f64) -> Time {
    Time::ZERO + Span::from_secs(secs)
}

fn matrix(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> Matrix {
    (0..rows).map(|i| (0..columns).map(|j| entry(i, j)).collect()).collect()
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    matrix(a.len(), b[0].len(), |i, j| (0..b.len()).map(|k| a[i][k] * b[k][j]).sum())
}

fn transposed(a: &Matrix) -> Matrix {
    matrix(a[0].len(), a.len(), |i, j| a[j][i])
}

fn magnitude(a: &Matrix) -> Matrix {
    matrix(a.len(), a[0].len(), |i, j| a[i][j].abs())
}

/// F = df/dx and G = df/dw of a step at (x, w).
fn derivatives<const N: usize, const W: usize, M: Motion<N, W>>(
    motion: &M,
    from: Time,
    to: Time,
    x: [f64; N],
    w: [f64; W],
) -> (Matrix, Matrix) {
    let step = motion.over(from, to).unwrap();
    let by_x = M::apply(&step, Dual::<N>::variables(x), w.map(Dual::constant));
    let by_w = M::apply(&step, x.map(Dual::constant), Dual::<W>::variables(w));
    (matrix(N, N, |i, j| by_x[i].gradient[j]), matrix(N, W, |i, j| by_w[i].gradient[j]))
}

/// F and Q of a linear motion over `dt` seconds.
fn linear<const N: usize, const W: usize, M: Motion<N, W>>(
    motion: &M,
    from: Time,
    to: Time,
) -> (Matrix, Matrix) {
    let (f, g) = derivatives(motion, from, to, [0.3; N], [0.0; W]);
    (f, product(&g, &transposed(&g)))
}

fn compare(what: &str, found: &Matrix, expected: &Matrix, scale: &Matrix, tolerance: f64) -> Verdict {
    for i in 0..expected.len() {
        for j in 0..expected[0].len() {
            let error = (found[i][j] - expected[i][j]).abs();
            if error.is_nan() || error > tolerance * scale[i][j] {
                return Err(format!("{what}[{i}][{j}] is {}, not {}", found[i][j], expected[i][j]));
            }
        }
    }
    Ok(())
}

/// The scale of rounding errors in a covariance: by Cauchy and Schwarz no entry is larger.
fn covariance_scale(q: &Matrix) -> Matrix {
    matrix(q.len(), q.len(), |i, j| q[i][i].sqrt() * q[j][j].sqrt())
}

/// Two half steps are one whole step: F = F' F' and Q = F' Q' F'^T + Q'. Each entry sums at most a dozen products
/// of factors good to a few eps: 100 eps of the sum of magnitudes.
fn semigroup<const N: usize, const W: usize, M: Motion<N, W>>(motion: &M) -> Verdict {
    for dt in STEPS {
        let start = seconds(12.25);
        let half = Span::from_secs(dt / 2.0);
        let (f1, q1) = linear(motion, start, start + half);
        let (f, q) = linear(motion, start, start + half + half);
        let f_scale = product(&magnitude(&f1), &magnitude(&f1));
        compare("F", &product(&f1, &f1), &f, &f_scale, 100.0 * EPS)?;
        let moved = product(&product(&f1, &q1), &transposed(&f1));
        let both = matrix(N, N, |i, j| moved[i][j] + q1[i][j]);
        let f_magnitude = magnitude(&f1);
        let size = covariance_scale(&q1);
        let through = product(&product(&f_magnitude, &size), &transposed(&f_magnitude));
        let scale = matrix(N, N, |i, j| through[i][j] + size[i][j]);
        compare("Q", &both, &q, &scale, 100.0 * EPS)?;
    }
    Ok(())
}

/// F and Q are those that the textbook gives for one axis, and the axes do not mix.
fn textbook<const N: usize, const W: usize, M: Motion<N, W>>(
    motion: &M,
    axes: usize,
    tolerance: f64,
    axis: impl Fn(f64) -> (Matrix, Matrix),
) -> Verdict {
    for dt in STEPS {
        let (f, q) = linear(motion, seconds(1.0), seconds(1.0 + dt));
        let (f1, q1) = axis(Span::from_secs(dt).secs());
        let spread =
            |a: &Matrix| matrix(N, N, |i, j| if i % axes == j % axes { a[i / axes][j / axes] } else { 0.0 });
        compare("F", &f, &spread(&f1), &magnitude(&spread(&f1)), tolerance)?;
        let q1 = spread(&q1);
        compare("Q", &q, &q1, &covariance_scale(&q1), tolerance)?;
    }
    Ok(())
}

fn velocity_axis(q: f64) -> impl Fn(f64) -> (Matrix, Matrix) {
    move |t| {
        let f = vec![vec![1.0, t], vec![0.0, 1.0]];
        let c = vec![vec![q * t.powi(3) / 3.0, q * t * t / 2.0], vec![q * t * t / 2.0, q * t]];
        (f, c)
    }
}

fn acceleration_f(t: f64) -> Matrix {
    vec![vec![1.0, t, t * t / 2.0], vec![0.0, 1.0, t], vec![0.0, 0.0, 1.0]]
}

fn acceleration_axis(q: f64) -> impl Fn(f64) -> (Matrix, Matrix) {
    move |t| {
        let c = [
            [t.powi(5) / 20.0, t.powi(4) / 8.0, t.powi(3) / 6.0],
            [t.powi(4) / 8.0, t.powi(3) / 3.0, t * t / 2.0],
            [t.powi(3) / 6.0, t * t / 2.0, t],
        ];
        (acceleration_f(t), matrix(3, 3, |i, j| q * c[i][j]))
    }
}

/// Singer's F and Q by what defines them: Q is the integral of g(s) g(s)^T over the step, g the response to a
/// jolt of the acceleration. Gauss's rule with 3 points on 400 panels: the error is below (theta / 400)^6, under
/// 1e-11 for theta up to 6.
fn singer_axis(sd: f64, tau: f64) -> impl Fn(f64) -> (Matrix, Matrix) {
    // (s - 1 + e^-s, 1 - e^-s, e^-s), the first by its series where subtraction would spoil it.
    fn response(s: f64) -> [f64; 3] {
        let mut series = 0.0;
        let mut term = s * s / 2.0;
        for n in 3..25 {
            series += term;
            term *= -s / f64::from(n);
        }
        [if s < 1.0 { series } else { s + (-s).exp_m1() }, -(-s).exp_m1(), (-s).exp()]
    }
    move |t| {
        let theta = t / tau;
        let [p, v, a] = response(theta);
        let f = vec![vec![1.0, t, p * tau * tau], vec![0.0, 1.0, v * tau], vec![0.0, 0.0, a]];
        let mut q = matrix(3, 3, |_, _| 0.0);
        let width = theta / 400.0;
        for panel in 0..400 {
            for (node, weight) in
                [(-0.6f64.sqrt(), 5.0 / 18.0), (0.0, 8.0 / 18.0), (0.6f64.sqrt(), 5.0 / 18.0)]
            {
                let g = response((f64::from(panel) + 0.5 + 0.5 * node) * width);
                let unit = [tau * tau, tau, 1.0];
                for i in 0..3 {
                    for j in 0..3 {
                        q[i][j] += 2.0 * sd * sd * weight * width * g[i] * g[j] * unit[i] * unit[j];
                    }
                }
            }
        }
        (f, q)
    }
}

#[test]
fn random_walk_is_brownian_motion() {
    for law in [
        textbook(&RandomWalk::<1>::new(0.7).unwrap(), 1, 8.0 * EPS, |t| {
            (vec![vec![1.0]], vec![vec![0.7 * t]])
        }),
        textbook(&RandomWalk::<3>::new(0.7).unwrap(), 3, 8.0 * EPS, |t| {
            (vec![vec![1.0]], vec![vec![0.7 * t]])
        }),
        semigroup(&RandomWalk::<2>::new(0.7).unwrap()),
    ] {
        law.unwrap();
    }
}

#[test]
fn constant_velocity_is_the_textbooks() {
    let q = 0.05;
    textbook(&ConstantVelocity::<1>::new(q).unwrap(), 1, 16.0 * EPS, velocity_axis(q)).unwrap();
    textbook(&ConstantVelocity::<2>::new(q).unwrap(), 2, 16.0 * EPS, velocity_axis(q)).unwrap();
    textbook(&ConstantVelocity::<3>::new(q).unwrap(), 3, 16.0 * EPS, velocity_axis(q)).unwrap();
    semigroup(&ConstantVelocity::<2>::new(q).unwrap()).unwrap();
}

#[test]
fn constant_acceleration_is_the_textbooks() {
    let q = 0.3;
    textbook(&ConstantAcceleration::<1>::new(q).unwrap(), 1, 32.0 * EPS, acceleration_axis(q)).unwrap();
    textbook(&ConstantAcceleration::<2>::new(q).unwrap(), 2, 32.0 * EPS, acceleration_axis(q)).unwrap();
    textbook(&ConstantAcceleration::<3>::new(q).unwrap(), 3, 32.0 * EPS, acceleration_axis(q)).unwrap();
    semigroup(&ConstantAcceleration::<2>::new(q).unwrap()).unwrap();
}

#[test]
fn wiener_acceleration_is_the_textbooks_and_knows_its_interval() {
    let sd = 0.4;
    let axis = |t: f64| {
        let g = [t * t / 2.0, t, 1.0];
        (acceleration_f(t), matrix(3, 3, |i, j| sd * sd * g[i] * g[j]))
    };
    textbook(&WienerAcceleration::<1>::new(sd).unwrap(), 1, 16.0 * EPS, axis).unwrap();
    textbook(&WienerAcceleration::<2>::new(sd).unwrap(), 2, 16.0 * EPS, axis).unwrap();
    textbook(&WienerAcceleration::<3>::new(sd).unwrap(), 3, 16.0 * EPS, axis).unwrap();
    // Its documentation says so: this law must refuse it.
    assert!(semigroup(&WienerAcceleration::<2>::new(sd).unwrap()).is_err());
}

#[test]
fn singer_is_exact_for_every_manoeuvre_time() {
    // theta = dt / tau from 5e-8 to 6.
    for tau in [11.0, 60.0, 2e4] {
        textbook(&Singer::<1>::new(0.9, tau).unwrap(), 1, 1e-10, singer_axis(0.9, tau)).unwrap();
        textbook(&Singer::<2>::new(0.9, tau).unwrap(), 2, 1e-10, singer_axis(0.9, tau)).unwrap();
        textbook(&Singer::<3>::new(0.9, tau).unwrap(), 3, 1e-10, singer_axis(0.9, tau)).unwrap();
    }
    for tau in [1e-9, 1e-3, 0.4, 1.0, 7.0, 60.0, 1e5, 1e12, 1e200] {
        semigroup(&Singer::<2>::new(0.9, tau).unwrap()).unwrap_or_else(|e| panic!("tau {tau}: {e}"));
    }
}

/// For theta = dt / tau beside 0 the difference to constant acceleration is of order theta, for large theta that to
/// constant velocity of order 1 / theta.
#[test]
fn singer_has_its_limits() {
    let (sd, slow, fast) = (0.9, 1e9, 1e-7);
    textbook(&Singer::<2>::new(sd, slow).unwrap(), 2, 1e-7, acceleration_axis(2.0 * sd * sd / slow)).unwrap();
    for dt in [0.37, 1.0, 7.3, 61.7] {
        let motion = Singer::<1>::new(sd, fast).unwrap();
        let (f, q) = linear(&motion, seconds(1.0), seconds(1.0 + dt));
        let (cv_f, cv_q) = velocity_axis(2.0 * sd * sd * fast)(dt);
        compare("F", &f, &cv_f, &magnitude(&cv_f), 4.0 * EPS).unwrap();
        compare("Q", &q, &cv_q, &covariance_scale(&cv_q), 10.0 * fast / dt).unwrap();
        assert!((q[2][2] - sd * sd).abs() < 1e-12, "the acceleration is stationary: {}", q[2][2]);
    }
    // a_max^2 / 3 (1 + 4 P_max - P_0).
    let named = Singer::<1>::from_largest(0.02, 0.1, 0.5, 20.0).unwrap();
    let plain = Singer::<1>::new((0.02f64.powi(2) / 3.0 * 0.9).sqrt(), 20.0).unwrap();
    let (found, expected) =
        (linear(&named, Time::ZERO, seconds(3.0)).1, linear(&plain, Time::ZERO, seconds(3.0)).1);
    compare("Q", &found, &expected, &covariance_scale(&expected), 16.0 * EPS).unwrap();
}

#[test]
fn known_turns_are_exact() {
    let (q, t) = (0.05, 7.3);
    for rate in [0.0, 1e-9, 1e-3, 0.0785, -0.6, 3.0] {
        let motion = CoordinatedTurn::new(rate, q).unwrap();
        semigroup(&motion).unwrap_or_else(|e| panic!("rate {rate}: {e}"));
        let (f, found) = linear(&motion, Time::ZERO, seconds(t));
        let f_scale = matrix(4, 4, |i, j| if i < 2 && j > 1 { t } else { 1.0 });
        if rate.abs() < 1e-6 {
            // Straight flight, up to the angle.
            let (cv_f, cv_q) = linear(&ConstantVelocity::<2>::new(q).unwrap(), Time::ZERO, seconds(t));
            let tolerance = 16.0 * EPS + rate * t;
            compare("F", &f, &cv_f, &f_scale, tolerance).unwrap();
            compare("Q", &found, &cv_q, &covariance_scale(&cv_q), tolerance).unwrap();
            continue;
        }
        let angle: f64 = rate * t;
        let (s, c) = angle.sin_cos();
        let expected = [
            [1.0, 0.0, s / rate, -(1.0 - c) / rate],
            [0.0, 1.0, (1.0 - c) / rate, s / rate],
            [0.0, 0.0, c, -s],
            [0.0, 0.0, s, c],
        ];
        // 1 - cos and angle - sin lose eps / angle^2 and eps / angle^3 of themselves.
        let tolerance = 16.0 * EPS * (1.0 + angle.abs().powi(-3));
        compare("F", &f, &matrix(4, 4, |i, j| expected[i][j]), &f_scale, tolerance).unwrap();
        let var = 2.0 * q * (angle - s) / rate.powi(3);
        let (with, across) = (q * (1.0 - c) / rate.powi(2), q * (angle - s) / rate.powi(2));
        let expected = [
            [var, 0.0, with, across],
            [0.0, var, -across, with],
            [with, -across, q * t, 0.0],
            [across, with, 0.0, q * t],
        ];
        let expected = matrix(4, 4, |i, j| expected[i][j]);
        compare("Q", &found, &expected, &covariance_scale(&expected), tolerance).unwrap();
    }
}

/// Constant velocity whose noise of position and velocity is independent: right variances, no cross term.
struct NoCrossTerm;

impl Motion<4, 4> for NoCrossTerm {
    type Step = f64;
    fn over(&self, from: Time, to: Time) -> Result<f64> {
        Ok((to - from).secs())
    }
    fn apply<R: Real>(&dt: &f64, [x, y, vx, vy]: [R; 4], w: [R; 4]) -> [R; 4] {
        let (p, v) = ((0.05 * dt.powi(3) / 3.0).sqrt(), (0.05 * dt).sqrt());
        [x + vx * dt + w[0] * p, y + vy * dt + w[1] * p, vx + w[2] * v, vy + w[3] * v]
    }
}

#[test]
fn the_laws_notice_a_missing_cross_term() {
    assert!(semigroup(&NoCrossTerm).unwrap_err().starts_with("Q"));
    assert!(textbook(&NoCrossTerm, 2, 1e-6, velocity_axis(0.05)).unwrap_err().starts_with("Q[0][2]"));
}

#[test]
fn the_laws_notice_an_acceleration_that_does_not_decay() {
    let (sd, tau) = (0.9, 60.0);
    let jerk = ConstantAcceleration::<1>::new(2.0 * sd * sd / tau).unwrap();
    assert!(textbook(&jerk, 1, 1e-10, singer_axis(sd, tau)).unwrap_err().starts_with("F"));
}

fn moved<const N: usize, const W: usize, M: Motion<N, W>>(motion: &M, dt: f64, x: [f64; N]) -> [f64; N] {
    M::apply(&motion.over(Time::ZERO, seconds(dt)).unwrap(), x, [0.0; W])
}

fn assert_near<const N: usize>(found: [f64; N], expected: [f64; N], tolerance: f64) {
    for (a, b) in found.iter().zip(&expected) {
        assert!((a - b).abs() <= tolerance, "{found:?} {expected:?}");
    }
}

#[test]
fn unknown_turns_follow_their_circles() {
    let x = [10.0, -20.0, 3.0, 4.0];
    let rate = 0.3;
    let known = CoordinatedTurn::new(rate, 0.1).unwrap();
    // Lateral acceleration = rate times speed.
    let manoeuvre = ManoeuvreTurn::new(rate * 5.0, 0.1).unwrap();
    let wiener = WienerTurn::new(0.1, 0.01).unwrap();
    let markov = MarkovTurn::new(0.1, 0.2, 1e15).unwrap();
    let with_rate = |x: [f64; 4]| [x[0], x[1], x[2], x[3], rate];
    for dt in STEPS {
        let expected = moved(&known, dt, x);
        // Angles up to 18 radians at a radius of 17 m: rounding of 20 eps of each.
        assert_near(moved(&manoeuvre, dt, x), expected, 1e-12);
        assert_near(moved(&wiener, dt, with_rate(x)), with_rate(expected), 1e-12);
        assert_near(moved(&markov, dt, with_rate(x)), with_rate(expected), 1e-11);
        assert_near(moved(&manoeuvre, dt, moved(&manoeuvre, dt, x)), moved(&known, 2.0 * dt, x), 1e-12);
    }
    // Once around. Time is whole nanoseconds: 5 m/s for half of one.
    assert_near(moved(&known, TAU / rate, x), x, 1e-8);
    // A quarter to the left of the x axis ends up ahead and to the left.
    let [px, py, vx, vy] = moved(&known, PI / 2.0 / rate, [0.0, 0.0, 3.0, 0.0]);
    assert_near([px, py, vx, vy], [10.0, 10.0, 0.0, 3.0], 1e-8);
}

#[test]
fn markov_turn_decays_and_turns_by_the_mean() {
    let (tau, dt) = (8.0, 5.0);
    let motion = MarkovTurn::new(0.0, 0.2, tau).unwrap();
    let x = [0.0, 0.0, 2.0, 0.0, 0.3];
    let once = moved(&motion, dt, x);
    let twice = moved(&motion, dt / 2.0, moved(&motion, dt / 2.0, x));
    let heading = 0.3 * tau * (1.0 - (-dt / tau).exp());
    for end in [once, twice] {
        assert_near(
            [end[2], end[3], end[4]],
            [2.0 * heading.cos(), 2.0 * heading.sin(), 0.3 * (-dt / tau).exp()],
            1e-14,
        );
    }
    // The noise keeps the standard deviation of the rate: keep^2 s^2 + q = s^2.
    let (f, g) = derivatives(&motion, Time::ZERO, seconds(dt), x, [0.0; 5]);
    assert!((f[4][4].powi(2) * 0.04 + g[4][4].powi(2) - 0.04).abs() < 1e-16);
}

#[test]
fn turning_by_a_manoeuvre_survives_standing_still() {
    let motion = ManoeuvreTurn::new(20.0, 0.0).unwrap();
    let x = [1.0, 2.0, 0.0, 0.0];
    assert_eq!(moved(&motion, 1.0, x), x);
    let (f, g) = derivatives(&motion, Time::ZERO, seconds(1.0), x, [0.0; 4]);
    assert!(f.iter().chain(&g).flatten().all(|d| d.is_finite()), "{f:?}");
}

#[test]
fn growth_models_are_the_papers() {
    let growth = motion::Growth::new(10.0).unwrap();
    let step = growth.over(seconds(6.0), seconds(7.0)).unwrap();
    let [x] = motion::Growth::apply(&step, [3.0], [0.5]);
    let expected = 1.5 + 75.0 / 10.0 + 8.0 * 8.4f64.cos() + 10f64.sqrt() * 0.5;
    assert!((x - expected).abs() < 1e-14);
    let upf = motion::UpfGrowth::new(3.0, 2.0).unwrap();
    let step = upf.over(seconds(6.0), seconds(7.0)).unwrap();
    let [x] = motion::UpfGrowth::apply(&step, [3.0], [2.5]);
    assert!((x - (1.0 + (0.04 * PI * 7.0).sin() + 1.5 + 1.25)).abs() < 1e-14);
    // Gamma(3, rate 2): mean 3/2, variance 3/4.
    assert_eq!(upf.noise(), Noise::Gamma { shape: 3.0 });
    // And what is seen of it, up to 30 s and after.
    let seen = measurement::UpfGrowth::new(1e-5).unwrap();
    assert_near(seen.predict(seconds(30.0), [3.0]), [1.8], 1e-15);
    assert_near(seen.predict(seconds(31.0), [3.0]), [-0.5], 1e-15);
    assert_near(measurement::Growth::new(1.0).unwrap().predict(Time::ZERO, [4.0]), [0.8], 1e-15);
}

// ---- derivatives -----------------------------------------------------------------------------------------------

/// Derivative of `f` at 0: central differences at h and h / 2, extrapolated. Truncation is h^4 f^(5) / 480,
/// rounding 4 eps |f| / h.
fn slope(f: impl Fn(f64) -> f64, h: f64) -> f64 {
    let central = |h: f64| (f(h) - f(-h)) / (2.0 * h);
    (4.0 * central(h / 2.0) - central(h)) / 3.0
}

fn same_slopes(what: &str, found: &[f64], sizes: f64, f: impl Fn(usize, f64) -> f64) -> Verdict {
    for (j, &d) in found.iter().enumerate() {
        let h = 1e-3;
        let expected = slope(|e| f(j, e), h);
        // Fifth derivatives of the models below stay under 10^3 times their size: 1e-12 / 480 * 1e3 ~ 2e-12, and
        // 4 eps / h ~ 1e-12, of the size of the values.
        if (d - expected).abs() > 1e-10 * (1.0 + sizes) || d.is_nan() {
            return Err(format!("derivative {j} of {what} is {d}, not {expected}"));
        }
    }
    Ok(())
}

fn motion_gradients<const N: usize, const W: usize, M: Motion<N, W>>(motion: &M, x: [f64; N]) -> Verdict {
    let (from, to) = (seconds(3.0), seconds(4.3));
    let step = motion.over(from, to).unwrap();
    let w: [f64; W] = std::array::from_fn(|i| 0.4 - 0.3 * i as f64);
    let (f, g) = derivatives(motion, from, to, x, w);
    let at = M::apply(&step, x, w);
    let size = at.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    // The value under duals has the bits of the plain value.
    for (dual, plain) in M::apply(&step, Dual::<N>::variables(x), w.map(Dual::constant)).iter().zip(at) {
        if dual.value.to_bits() != plain.to_bits() {
            return Err(format!("value {} under duals, {plain} plain", dual.value));
        }
    }
    for i in 0..N {
        same_slopes("x", &f[i], size, |j, e| {
            let mut x = x;
            x[j] += e;
            M::apply(&step, x, w)[i]
        })?;
        same_slopes("w", &g[i], size, |j, e| {
            let mut w = w;
            w[j] += e;
            M::apply(&step, x, w)[i]
        })?;
    }
    Ok(())
}

#[test]
fn motions_have_their_derivatives() {
    let plane = [3.0, -2.0, 1.5, 0.8];
    let space = [3.0, -2.0, 1.0, 1.5, 0.8, -0.6];
    let six = [3.0, -2.0, 1.5, 0.8, 0.2, -0.3];
    let nine = [3.0, -2.0, 1.0, 1.5, 0.8, -0.6, 0.2, -0.3, 0.1];
    let turning = [3.0, -2.0, 1.5, 0.8, 0.4];
    let straight = [3.0, -2.0, 1.5, 0.8, 0.0];
    for (i, law) in [
        motion_gradients(&RandomWalk::<3>::new(0.5).unwrap(), [1.0, 2.0, 3.0]),
        motion_gradients(&ConstantVelocity::<2>::new(0.5).unwrap(), plane),
        motion_gradients(&ConstantVelocity::<3>::new(0.5).unwrap(), space),
        motion_gradients(&ConstantAcceleration::<2>::new(0.5).unwrap(), six),
        motion_gradients(&ConstantAcceleration::<3>::new(0.5).unwrap(), nine),
        motion_gradients(&WienerAcceleration::<2>::new(0.5).unwrap(), six),
        motion_gradients(&WienerAcceleration::<3>::new(0.5).unwrap(), nine),
        motion_gradients(&Singer::<2>::new(0.5, 3.0).unwrap(), six),
        motion_gradients(&Singer::<3>::new(0.5, 3.0).unwrap(), nine),
        motion_gradients(&CoordinatedTurn::new(0.3, 0.5).unwrap(), plane),
        motion_gradients(&ManoeuvreTurn::new(0.9, 0.5).unwrap(), plane),
        motion_gradients(&WienerTurn::new(0.5, 0.1).unwrap(), turning),
        motion_gradients(&WienerTurn::new(0.5, 0.1).unwrap(), straight),
        motion_gradients(&MarkovTurn::new(0.5, 0.1, 4.0).unwrap(), turning),
        motion_gradients(&motion::Growth::new(10.0).unwrap(), [2.0]),
        motion_gradients(&motion::UpfGrowth::new(3.0, 2.0).unwrap(), [2.0]),
    ]
    .into_iter()
    .enumerate()
    {
        law.unwrap_or_else(|e| panic!("motion {i}: {e}"));
    }
}

/// A step whose slope is 1 almost everywhere, but not where it jumps.
struct Jump;

impl Motion<1, 1> for Jump {
    type Step = ();
    fn over(&self, _: Time, _: Time) -> Result<()> {
        Ok(())
    }
    fn apply<R: Real>((): &(), [x]: [R; 1], [w]: [R; 1]) -> [R; 1] {
        [w + x.if_lt(x.constant(2.0), x, x + 1.0)]
    }
}

#[test]
fn the_derivative_law_notices_a_jump() {
    assert!(motion_gradients(&Jump, [1.0]).is_ok());
    assert!(motion_gradients(&Jump, [2.0]).is_err());
}

/// Derivatives of h and of the log-likelihood, at one state and one value.
fn measurement_gradients<const N: usize, const M: usize, H>(sensor: &H, z: [f64; M], x: [f64; N]) -> Verdict
where
    H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]>,
{
    let at = seconds(3.0);
    let given = sensor.given(&z, at).unwrap();
    let log_likelihood = |x: [f64; N]| H::log_likelihood(&given, x);
    let h = sensor.predict(at, Dual::<N>::variables(x));
    for (i, h) in h.iter().enumerate() {
        if h.value.to_bits() != sensor.predict(at, x)[i].to_bits() {
            return Err(format!("component {i} differs under duals"));
        }
        same_slopes("h", &h.gradient, h.value.abs(), |j, e| {
            let mut x = x;
            x[j] += e;
            sensor.predict(at, x)[i]
        })?;
    }
    let l = H::log_likelihood(&given, Dual::<N>::variables(x));
    same_slopes("log-likelihood", &l.gradient, l.value.abs(), |j, e| {
        let mut x = x;
        x[j] += e;
        log_likelihood(x)
    })?;
    Ok(())
}

/// log N(z - h(x); 0, R) without any digesting, with the standard library's functions: Gauss's elimination gives
/// the solution and the determinant.
fn normal_density<const N: usize, const M: usize, H>(sensor: &H, z: [f64; M], x: [f64; N]) -> Verdict
where
    H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]>,
{
    let at = seconds(3.0);
    let h = sensor.predict(at, x);
    let residual: [f64; M] = std::array::from_fn(|i| {
        let e = z[i] - h[i];
        if H::ANGLE[i] { e.sin().atan2(e.cos()) } else { e }
    });
    let (mut a, mut b, mut det) = (sensor.covariance(), residual, 1.0);
    for i in 0..M {
        det *= a[i][i];
        for k in i + 1..M {
            let c = a[k][i] / a[i][i];
            let pivot = a[i];
            for (a, p) in a[k].iter_mut().zip(pivot) {
                *a -= c * p;
            }
            b[k] -= c * b[i];
        }
    }
    for i in (0..M).rev() {
        for k in i + 1..M {
            b[i] -= a[i][k] * b[k];
        }
        b[i] /= a[i][i];
    }
    let distance2: f64 = residual.iter().zip(&b).map(|(r, b)| r * b).sum();
    let expected = -0.5 * (distance2 + (det * TAU.powi(M as i32)).ln());
    let found = H::log_likelihood(&sensor.given(&z, at).unwrap(), x);
    // Residuals are differences of numbers up to 10 standard deviations of 1e-3: eps 1e4, squared and summed.
    if (found - expected).abs() < 1e-10 * (1.0 + distance2) {
        Ok(())
    } else {
        Err(format!("log-likelihood is {found}, not {expected}"))
    }
}

/// The state at the sensor itself must not give NaN, as a number or as a derivative.
fn calm_at_the_sensor<const N: usize, const M: usize, H>(sensor: &H, z: [f64; M], x: [f64; N]) -> Verdict
where
    H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]>,
{
    let l = H::log_likelihood(&sensor.given(&z, Time::ZERO).unwrap(), Dual::<N>::variables(x));
    let h = sensor.predict(Time::ZERO, Dual::<N>::variables(x));
    if h.iter().any(|h| h.value.is_nan() || h.gradient.iter().any(|d| d.is_nan())) {
        return Err(format!("h = {h:?}"));
    }
    if !l.value.is_finite() || l.gradient.iter().any(|d| d.is_nan()) {
        return Err(format!("log-likelihood {l:?}"));
    }
    Ok(())
}

/// A model, a value and a state away from the cut, or across it.
macro_rules! with_every_sensor {
    ($law:ident) => {{
        let plane = [3.0, -2.0, 1.5, 0.8];
        let behind = [-4.0, 1e-2, 1.5, 0.8];
        let space = [3.0, -2.0, 1.0, 1.5, 0.8, -0.6];
        let correlated = Linear::new([[1.0, 0.5, 0.0, 0.2], [0.0, 1.0, -0.7, 0.0]], [[2.0, 0.9], [0.9, 1.0]]);
        let pair = RangeBearing::new([0.0, 0.0], 0.4, 0.05).unwrap();
        vec![
            $law(&Position::<2>::new(0.5).unwrap(), [2.5, -1.5], plane),
            $law(&Position::<3>::new(0.5).unwrap(), [2.5, -1.5, 1.2], space),
            $law(&pair, [3.4, -0.5], plane),
            $law(&pair, [4.2, -PI + 0.02], behind),
            $law(&pair, [4.2, 3.0 * PI + 0.02], behind),
            $law(&RangeBearing::new([-6.0, 12.0], 0.3, 0.1).unwrap(), [16.5, -0.95], plane),
            $law(
                &RangeBearingElevation::new([1.0, 1.0, -1.0], 0.3, 0.1, 0.2).unwrap(),
                [4.0, -1.0, 0.4],
                space,
            ),
            $law(&BearingOnly::new([0.0, 0.0], 0.05).unwrap(), [-0.5], plane),
            $law(&BearingOnly::new([0.0, 0.0], 0.05).unwrap(), [-PI], behind),
            $law(&RangeOnly::<2>::new([1.0, 1.0], 0.3).unwrap(), [3.4], plane),
            $law(&RangeOnly::<3>::new([1.0, 1.0, 0.0], 0.3).unwrap(), [3.4], space),
            $law(&RangeRate::<2>::new([1.0, 1.0], [0.3, -0.1], 0.3).unwrap(), [0.4], plane),
            $law(&RangeRate::<3>::new([1.0, 1.0, 0.0], [0.3, -0.1, 0.0], 0.3).unwrap(), [0.4], space),
            $law(&correlated.unwrap(), [2.5, -2.0], plane),
            $law(&measurement::Growth::new(1.0).unwrap(), [1.3], [4.0]),
            $law(&measurement::UpfGrowth::new(0.01).unwrap(), [3.3], [4.0]),
        ]
    }};
}

/// The sensors whose noise is not normal.
macro_rules! with_every_robust_sensor {
    ($law:ident) => {{
        let plane = [3.0, -2.0, 1.5, 0.8];
        let pair = RangeBearing::new([0.0, 0.0], 0.4, 0.05).unwrap();
        vec![
            $law(&StudentT::new(pair, 3.0).unwrap(), [3.4, -0.5], plane),
            $law(&StudentT::new(pair, 1e9).unwrap(), [3.4, -0.5], plane),
            $law(&OutlierMixture::new(pair, 0.1, 10.0).unwrap(), [3.4, -0.5], plane),
            $law(&OutlierMixture::new(pair, 0.1, 10.0).unwrap(), [6.0, 0.5], plane),
        ]
    }};
}

fn all_hold(laws: Vec<Verdict>) {
    for (i, law) in laws.into_iter().enumerate() {
        law.unwrap_or_else(|e| panic!("sensor {i}: {e}"));
    }
}

#[test]
fn sensors_have_their_derivatives() {
    all_hold(with_every_sensor!(measurement_gradients));
    all_hold(with_every_robust_sensor!(measurement_gradients));
}

#[test]
fn sensors_have_the_normal_density() {
    all_hold(with_every_sensor!(normal_density));
    // Heavy tails must not pass for normal ones, but with a billion degrees of freedom they do, to 1e-9 or so.
    let verdicts = with_every_robust_sensor!(normal_density);
    assert!(verdicts[0].is_err() && verdicts[2].is_err() && verdicts[3].is_err(), "{verdicts:?}");
    let error = student_error(1e9);
    assert!(error < 1e-8, "{error}");
}

fn student_error(dof: f64) -> f64 {
    let pair = RangeBearing::new([0.0, 0.0], 0.4, 0.05).unwrap();
    let heavy = StudentT::new(pair, dof).unwrap();
    let (z, x) = ([3.4, -0.5], [3.0, -2.0]);
    let normal = <RangeBearing as Measurement<2>>::log_likelihood(
        &Measurement::<2>::given(&pair, &z, Time::ZERO).unwrap(),
        x,
    );
    (log_likelihood(&heavy, z, x) - normal).abs()
}

fn log_likelihood<const N: usize, const M: usize, H>(sensor: &H, z: [f64; M], x: [f64; N]) -> f64
where
    H: Measurement<N, Value = [f64; M]>,
{
    H::log_likelihood(&sensor.given(&z, Time::ZERO).unwrap(), x)
}

/// A radar that forgets to wrap and to normalise.
struct Careless {
    wraps: bool,
    constant: f64,
}

impl Measurement<2> for Careless {
    type Value = [f64; 2];
    type Given<'z> = (&'z Careless, [f64; 2]);
    fn given<'z>(&'z self, z: &'z [f64; 2], _: Time) -> Result<Self::Given<'z>> {
        Ok((self, *z))
    }
    fn log_likelihood<R: Real>((sensor, z): &Self::Given<'_>, [x, y]: [R; 2]) -> R {
        let bearing = y.atan2(x) - z[1];
        let bearing = if sensor.wraps {
            let (s, c) = bearing.sin_cos();
            s.atan2(c)
        } else {
            bearing
        };
        let range = x.hypot(y) - z[0];
        (range * range / 0.16 + bearing * bearing / 0.0025) * -0.5 + sensor.constant
    }
}

impl GaussianMeasurement<2, 2> for Careless {
    const ANGLE: [bool; 2] = [false, true];
    fn predict<R: Real>(&self, _: Time, [x, y]: [R; 2]) -> [R; 2] {
        [x.hypot(y), y.atan2(x)]
    }
    fn components(&self, z: &[f64; 2]) -> [f64; 2] {
        *z
    }
    fn covariance(&self) -> [[f64; 2]; 2] {
        [[0.16, 0.0], [0.0, 0.0025]]
    }
}

const CAREFUL: f64 = -1.837_877_066_409_345_3; // -ln(2 pi)

#[test]
fn the_density_law_notices_careless_sensors() {
    let constant = CAREFUL - (0.4f64 * 0.05).ln();
    let (z, behind) = ([4.2, -PI + 0.02], [-4.0, 1e-2]);
    assert!(normal_density(&Careless { wraps: true, constant }, z, behind).is_ok());
    assert!(normal_density(&Careless { wraps: false, constant }, z, behind).is_err());
    assert!(normal_density(&Careless { wraps: true, constant: CAREFUL }, z, behind).is_err());
    // At the sensor itself the plain square root has no derivative.
    assert!(calm_at_the_sensor(&Careless { wraps: true, constant }, z, [0.0, 0.0]).is_err());
}

#[test]
fn the_sensor_itself_is_a_state_like_any_other() {
    let (pair, space) = ([0.3, 0.0], [1.0, 2.0, 3.0]);
    all_hold(vec![
        calm_at_the_sensor(&RangeBearing::new([1.0, 2.0], 0.4, 0.05).unwrap(), pair, [1.0, 2.0]),
        calm_at_the_sensor(
            &RangeBearingElevation::new(space, 0.4, 0.1, 0.1).unwrap(),
            [0.3, 0.0, 0.0],
            space,
        ),
        calm_at_the_sensor(
            &RangeBearingElevation::new(space, 0.4, 0.1, 0.1).unwrap(),
            [0.3, 0.0, 0.0],
            [1.0, 2.0, 7.0],
        ),
        calm_at_the_sensor(&BearingOnly::new([1.0, 2.0], 0.05).unwrap(), [0.3], [1.0, 2.0]),
        calm_at_the_sensor(&RangeOnly::new([1.0, 2.0], 0.05).unwrap(), [0.3], [1.0, 2.0]),
        calm_at_the_sensor(&RangeOnly::new(space, 0.05).unwrap(), [0.3], space),
        calm_at_the_sensor(&RangeRate::new([1.0, 2.0], [0.0; 2], 0.05).unwrap(), [0.3], [1.0, 2.0, 3.0, 4.0]),
    ]);
}

// ---- densities integrate to one ----------------------------------------------------------------------------------

/// Integral of p(z | x) over the boxes `low`..`high` of two components, by the midpoint rule. On smooth functions
/// that vanish at the border it converges faster than any power once the step is below a standard deviation.
fn mass<H, const N: usize>(sensor: &H, x: [f64; N], low: [f64; 2], high: [f64; 2], cells: [u32; 2]) -> f64
where
    H: Measurement<N, Value = [f64; 2]>,
{
    let step = [(high[0] - low[0]) / f64::from(cells[0]), (high[1] - low[1]) / f64::from(cells[1])];
    let mut sum = 0.0;
    for i in 0..cells[0] {
        for j in 0..cells[1] {
            let z = [low[0] + (f64::from(i) + 0.5) * step[0], low[1] + (f64::from(j) + 0.5) * step[1]];
            sum += log_likelihood(sensor, z, x).exp();
        }
    }
    sum * step[0] * step[1]
}

#[test]
fn densities_integrate_to_one() {
    // Looking across the cut, over one whole turn; tails beyond 12 standard deviations of the range are below 1e-30,
    // bearings beyond pi = 10 standard deviations below 1e-22.
    let (x, turn) = ([-50.0, 1e-3], PI);
    let pair = RangeBearing::new([0.0, 0.0], 0.5, 0.3).unwrap();
    let one = mass(&pair, x, [44.0, -turn], [56.0, turn], [60, 60]);
    assert!((one - 1.0).abs() < 1e-12, "{one}");
    // Outliers of 3 times the size: 16 of their standard deviations of range; the bearing has pi = 3.5 of 0.9, the
    // folded tail being erfc(3.49 / sqrt 2) = 4.8e-4 of 5 %, hence at most 2.5e-5 missing.
    let mixed = OutlierMixture::new(pair, 0.05, 3.0).unwrap();
    let one = mass(&mixed, x, [26.0, -turn], [74.0, turn], [192, 200]);
    assert!((1.0 - 2.5e-5..1.0 + 1e-6).contains(&one), "{one}");
    // The same with bearings fine enough that nothing folds.
    let fine = RangeBearing::new([0.0, 0.0], 0.5, 0.05).unwrap();
    let mixed = OutlierMixture::new(fine, 0.05, 5.0).unwrap();
    let one = mass(&mixed, x, [15.0, -turn], [85.0, turn], [280, 250]);
    assert!((one - 1.0).abs() < 1e-9, "{one}");
    // Even outliers fill the box that they were given.
    let even = UniformOutliers::new(fine, 0.2, 12.0 * TAU).unwrap();
    let one = mass(&even, x, [44.0, -turn], [56.0, turn], [60, 250]);
    assert!((one - 1.0).abs() < 1e-12, "{one}");
    // A law without its constants is noticed.
    let careless = mass(
        &Careless { wraps: true, constant: CAREFUL },
        [-50.0, 1e-3],
        [44.0, -turn],
        [56.0, turn],
        [120, 250],
    );
    assert!((careless - 1.0).abs() > 0.5, "{careless}");
}

/// Student's law in 1, 2 and 3 dimensions, radially: the sphere's area times r^(M-1) p(r) dr with r = e^u. Below
/// e^-40 the mass is 4e-18, beyond e^25 with 3 degrees of freedom or more 1e-32. The integrand is analytic within
/// pi / 2 of the real axis, so that the step 0.05 leaves e^(-pi^2 / 0.05).
#[test]
fn student_laws_integrate_to_one() {
    fn radial<const M: usize>(dof: f64) -> f64 {
        let sensor = StudentT::new(Position::<M>::new(1.0).unwrap(), dof).unwrap();
        let area = [2.0, TAU, 2.0 * TAU][M - 1];
        let step = 0.05;
        (0..1300)
            .map(|i| {
                let r = (f64::from(i) * step - 40.0).exp();
                let mut z = [0.0; M];
                z[0] = r;
                area * r.powi(M as i32) * log_likelihood(&sensor, z, [0.0; M]).exp() * step
            })
            .sum()
    }
    for dof in [3.0, 5.5, 39.0, 43.0, 1e4] {
        for one in [radial::<1>(dof), radial::<2>(dof), radial::<3>(dof)] {
            assert!((one - 1.0).abs() < 1e-10, "{dof}: {one}");
        }
    }
}

/// For v ~ N(0, s R) with random s, E[1 / s | v] is -2 times the derivative of log p by the squared distance.
#[test]
fn covariance_scales_are_posterior_means() {
    fn check<H: GaussianMeasurement<2, 2> + Measurement<2, Value = [f64; 2]>>(sensor: &H) {
        for distance2 in [0.01f64, 0.5, 3.0, 9.0, 40.0] {
            let log_p = |d2: f64| log_likelihood(sensor, [0.5 * d2.sqrt(), 0.0], [0.0, 0.0]);
            let derivative = slope(|e| log_p(distance2 + e), 1e-3 * distance2);
            let expected = 1.0 / (-2.0 * derivative);
            let found = sensor.covariance_scale(distance2);
            // The slope carries 4 eps / h of |log p| < 50, with h = 1e-5 at the least.
            assert!((found - expected).abs() < 1e-8 * expected, "{distance2}: {found} {expected}");
        }
    }
    let sensor = Position::<2>::new(0.5).unwrap();
    check(&sensor);
    check(&StudentT::new(sensor, 4.0).unwrap());
    check(&OutlierMixture::new(sensor, 0.1, 10.0).unwrap());
}

// ---- simulation --------------------------------------------------------------------------------------------------

/// Sample covariances of n draws lie within 5 standard errors: the variance of the product of two centred normals
/// is C_ii C_jj + C_ij^2.
#[test]
fn paths_have_the_covariance_of_the_motion() {
    let motion = ConstantVelocity::<2>::new(0.05).unwrap();
    let times = [seconds(2.0), seconds(2.0), seconds(3.5)];
    let (_, q) = linear(&motion, times[1], times[2]);
    let n = 20_000;
    let root = Stream::new(11);
    let mut sums = matrix(4, 4, |_, _| 0.0);
    for run in 0..n {
        let path = simulate::path(&motion, [0.0; 4], &times, root.fork(run)).unwrap();
        assert_eq!(path[1], path[0]);
        for i in 0..4 {
            for j in 0..4 {
                sums[i][j] += path[2][i] * path[2][j] / n as f64;
            }
        }
    }
    for i in 0..4 {
        for j in 0..4 {
            let error = ((q[i][i] * q[j][j] + q[i][j] * q[i][j]) / n as f64).sqrt();
            assert!((sums[i][j] - q[i][j]).abs() < 5.0 * error, "{i} {j}: {} {}", sums[i][j], q[i][j]);
        }
    }
    let again = |seed| simulate::path(&motion, [0.0; 4], &times, Stream::new(seed)).unwrap();
    assert_eq!(again(5), again(5));
    assert_ne!(again(5), again(6));
    let back = simulate::path(&motion, [0.0; 4], &[seconds(1.0), seconds(0.0)], root);
    assert!(matches!(back, Err(Error::OutOfOrder { .. })));
}

#[test]
fn measurements_have_the_law_of_the_sensor() {
    let n = 40_000;
    let times = vec![seconds(1.0); n];
    let mean = |values: &[f64]| values.iter().sum::<f64>() / n as f64;
    // Straight across the cut: residuals, not angles, have the mean 0.
    let pair = RangeBearing::new([0.0, 0.0], 0.5, 0.1).unwrap();
    let path = vec![[-20.0, 0.0]; n];
    let z = simulate::measurements(&pair, &path, &times, Stream::new(3)).unwrap();
    assert!(z.iter().all(|z| z[1].abs() <= PI));
    let range: Vec<f64> = z.iter().map(|z| z[0] - 20.0).collect();
    let bearing: Vec<f64> = z.iter().map(|z| (z[1] + PI).sin().atan2((z[1] + PI).cos())).collect();
    for (values, sd) in [(&range, 0.5), (&bearing, 0.1)] {
        let squares: Vec<f64> = values.iter().map(|v| v * v).collect();
        // 5 standard errors of the mean and of the mean square, sd^2 sqrt(2 / n).
        assert!(mean(values).abs() < 5.0 * sd / (n as f64).sqrt());
        assert!((mean(&squares) - sd * sd).abs() < 5.0 * sd * sd * (2.0 / n as f64).sqrt());
    }
    let product: Vec<f64> = range.iter().zip(&bearing).map(|(a, b)| a * b).collect();
    assert!(mean(&product).abs() < 5.0 * 0.5 * 0.1 / (n as f64).sqrt());
    // Heavier tails: variance nu / (nu - 2) and fourth moment 3 nu^2 / ((nu - 2) (nu - 4)) for nu = 12; for the
    // mixture 1 - e + e s^2 and 3 (1 - e + e s^4).
    let line = vec![[0.0]; n];
    let unit = Position::<1>::new(1.0).unwrap();
    let student = simulate::measurements(&StudentT::new(unit, 12.0).unwrap(), &line, &times, Stream::new(4));
    let mixture = OutlierMixture::new(unit, 0.1, 5.0).unwrap();
    let mixture = simulate::measurements(&mixture, &line, &times, Stream::new(4));
    for (z, second, fourth) in [(student, 1.2, 5.4), (mixture, 0.9 + 2.5, 3.0 * (0.9 + 62.5))] {
        let squares: Vec<f64> = z.unwrap().iter().map(|[z]| z * z).collect();
        let error = ((fourth - second * second) / n as f64).sqrt();
        assert!((mean(&squares) - second).abs() < 5.0 * error, "{} {second}", mean(&squares));
    }
    // No range is below zero, and its law is the normal one cut there: mean sd sqrt(2 / pi) at the sensor.
    let near = RangeOnly::<2>::new([0.0, 0.0], 2.0).unwrap();
    let z = simulate::measurements(&near, &vec![[0.0, 0.0]; n], &times, Stream::new(5)).unwrap();
    let ranges: Vec<f64> = z.iter().map(|&[z]| z).collect();
    assert!(ranges.iter().all(|&r| r >= 0.0));
    let sd = 2.0 * (1.0 - 2.0 / PI).sqrt();
    assert!((mean(&ranges) - 2.0 * (2.0 / PI).sqrt()).abs() < 5.0 * sd / (n as f64).sqrt());
    let short = simulate::measurements(&near, &[[0.0, 0.0]], &times, Stream::new(5));
    assert!(matches!(short, Err(Error::Shape { .. })));
}

// ---- bad input ---------------------------------------------------------------------------------------------------

#[test]
fn parameters_out_of_range_are_refused() {
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(RandomWalk::<1>::new(bad).is_err());
        assert!(ConstantVelocity::<2>::new(bad).is_err());
        assert!(ConstantAcceleration::<2>::new(bad).is_err());
        assert!(WienerAcceleration::<2>::new(bad).is_err());
        assert!(Singer::<2>::new(bad, 1.0).is_err());
        assert!(Singer::<2>::new(1.0, bad).is_err());
        assert!(Singer::<2>::from_largest(1.0, bad, 0.1, 1.0).is_err());
        assert!(CoordinatedTurn::new(0.1, bad).is_err());
        assert!(ManoeuvreTurn::new(0.1, bad).is_err());
        assert!(WienerTurn::new(bad, 0.1).is_err() && WienerTurn::new(0.1, bad).is_err());
        assert!(MarkovTurn::new(0.1, 0.1, bad).is_err() && MarkovTurn::new(0.1, bad, 0.1).is_err());
        assert!(motion::Growth::new(bad).is_err());
        assert!(motion::UpfGrowth::new(bad, 1.0).is_err() && motion::UpfGrowth::new(1.0, bad).is_err());
        assert!(Position::<2>::new(bad).is_err());
        assert!(RangeBearingElevation::new([0.0; 3], 1.0, 1.0, bad).is_err());
        assert!(BearingOnly::new([0.0; 2], bad).is_err());
        assert!(RangeOnly::new([0.0; 2], bad).is_err());
        assert!(RangeRate::new([0.0; 2], [0.0; 2], bad).is_err());
        assert!(measurement::Growth::new(bad).is_err() && measurement::UpfGrowth::new(bad).is_err());
        let unit = Position::<1>::new(1.0).unwrap();
        assert!(StudentT::<_, 1>::new(unit, bad).is_err());
        assert!(OutlierMixture::<_, 1>::new(unit, bad, 2.0).is_err());
        assert!(OutlierMixture::<_, 1>::new(unit, 0.1, bad).is_err());
        assert!(
            UniformOutliers::new(unit, bad, 1.0).is_err() && UniformOutliers::new(unit, 0.1, bad).is_err()
        );
        assert!(Linear::new([[bad.sqrt()]], [[1.0]]).is_err() && Linear::new([[1.0]], [[bad]]).is_err());
    }
    assert!(matches!(
        Linear::new([[1.0, 0.0], [0.0, 1.0]], [[1.0, 2.0], [2.0, 1.0]]),
        Err(Error::NotPositiveDefinite { row: 1, .. })
    ));
    assert!(Linear::new([[1.0, 0.0], [0.0, 1.0]], [[1.0, 0.1], [0.2, 1.0]]).is_err());
    assert!(Singer::<1>::from_largest(1.0, 0.4, 0.4, 1.0).is_err());
    assert!(matches!(
        ConstantVelocity::<2>::new(1.0).unwrap().over(seconds(1.0), seconds(0.5)),
        Err(Error::OutOfOrder { .. })
    ));
}

#[test]
fn values_out_of_range_are_refused() {
    fn refuses<const M: usize, H: Measurement<6, Value = [f64; M]>>(sensor: &H, good: [f64; M], range: bool) {
        assert!(sensor.given(&good, Time::ZERO).is_ok());
        for i in 0..M {
            for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let mut z = good;
                z[i] = bad;
                assert!(matches!(sensor.given(&z, Time::ZERO), Err(Error::NotFinite { .. })), "{z:?}");
            }
        }
        let mut z = good;
        z[0] = -1.0;
        assert_eq!(matches!(sensor.given(&z, Time::ZERO), Err(Error::OutOfRange { .. })), range);
    }
    let pair = RangeBearing::new([0.0, 0.0], 1.0, 0.1).unwrap();
    refuses(&pair, [1.0, 2.0], true);
    refuses(&StudentT::<_, 2>::new(pair, 3.0).unwrap(), [1.0, 2.0], true);
    refuses(&OutlierMixture::<_, 2>::new(pair, 0.1, 3.0).unwrap(), [1.0, 2.0], true);
    refuses(&UniformOutliers::new(pair, 0.1, 3.0).unwrap(), [1.0, 2.0], true);
    refuses(&RangeBearingElevation::new([0.0; 3], 1.0, 0.1, 0.1).unwrap(), [1.0, 2.0, 0.5], true);
    refuses(&RangeOnly::new([0.0; 3], 1.0).unwrap(), [1.0], true);
    refuses(&RangeRate::new([0.0; 3], [0.0; 3], 1.0).unwrap(), [1.0], false);
    refuses(&BearingOnly::new([0.0; 2], 1.0).unwrap(), [1.0], false);
    refuses(&Position::<2>::new(1.0).unwrap(), [1.0, 2.0], false);
    refuses(&measurement::Growth::new(1.0).unwrap(), [1.0], false);
    refuses(&measurement::UpfGrowth::new(1.0).unwrap(), [1.0], false);
    refuses(&Linear::new([[1.0; 6]], [[1.0]]).unwrap(), [1.0], false);
}
