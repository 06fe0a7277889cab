//! Motions that turn at a rate of their own, and those of benchmarks.

use crate::matrices::derivatives;
use crate::{STEPS, seconds};
use std::f64::consts::{PI, TAU};
use zerre::Time;
use zerre::model::measurement;
use zerre::model::motion::{self, *};
use zerre::model::{GaussianMeasurement, Motion, Noise};

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
