//! Linear motions: what the textbooks print, and that two half steps are a whole one.

use crate::matrices::*;
use crate::{EPS, STEPS, Verdict, seconds};
use zerre::math::Real;
use zerre::model::Motion;
use zerre::model::motion::*;
use zerre::{Result, Span, Time};

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

/// A box is a point of constant velocity with three numbers more that wander by themselves.
#[test]
fn a_box_moves_like_its_middle() {
    let (q, size, turn) = (0.05, 0.3, 0.02);
    let motion = ConstantVelocityBox::new(q, size, turn).unwrap();
    semigroup(&motion).unwrap();
    for dt in STEPS {
        let (f, found) = linear(&motion, Time::ZERO, seconds(dt));
        let (of_point, noise) = linear(&ConstantVelocity::<2>::new(q).unwrap(), Time::ZERO, seconds(dt));
        let t = Span::from_secs(dt).secs();
        let spread = |small: &Matrix, rest: [f64; 3]| {
            matrix(7, 7, |i, j| match (i < 4, j < 4) {
                (true, true) => small[i][j],
                (false, false) if i == j => rest[i - 4],
                _ => 0.0,
            })
        };
        let expected = spread(&of_point, [1.0; 3]);
        compare("F", &f, &expected, &magnitude(&expected), 4.0 * EPS).unwrap();
        let expected = spread(&noise, [size * t, size * t, turn * t]);
        compare("Q", &found, &expected, &covariance_scale(&expected), 16.0 * EPS).unwrap();
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
