//! What dual numbers say of a model is its derivative, and its value keeps its bits.

use crate::matrices::derivatives;
use crate::sensors::{all_hold, with_every_robust_sensor, with_every_sensor};
use crate::{Verdict, seconds};
use std::f64::consts::PI;
use zerre::math::{Dual, Real};
use zerre::model::measurement::{self, *};
use zerre::model::motion::{self, *};
use zerre::model::{GaussianMeasurement, Measurement, Motion};
use zerre::{Result, Time};

/// Derivative of `f` at 0: central differences at h and h / 2, extrapolated. Truncation is h^4 f^(5) / 480,
/// rounding 4 eps |f| / h.
pub(crate) fn slope(f: impl Fn(f64) -> f64, h: f64) -> f64 {
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

#[test]
fn sensors_have_their_derivatives() {
    all_hold(with_every_sensor!(measurement_gradients));
    all_hold(with_every_robust_sensor!(measurement_gradients));
}
