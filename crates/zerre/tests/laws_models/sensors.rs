//! Sensors have the density that their noise says, on either side of every cut and at the sensor itself.

use crate::{Verdict, seconds};
use std::f64::consts::{PI, TAU};
use zerre::math::{Dual, Real};
use zerre::model::measurement::{self, *};
use zerre::model::{GaussianMeasurement, Measurement};
use zerre::{Result, Time};

/// log N(z - h(x); 0, R) without any digesting, with the standard library's functions: Gauss's elimination gives
/// the solution and the determinant.
fn normal_density<const N: usize, const M: usize, H>(sensor: &H, z: [f64; M], x: [f64; N]) -> Verdict
where
    H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]>,
{
    let at = seconds(3.0);
    let h = sensor.predict(at, x);
    let measured = sensor.components(&z);
    let residual: [f64; M] = std::array::from_fn(|i| {
        let e = measured[i] - h[i];
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
        let sized = [3.0, -2.0, 1.5, 0.8, 30.0, 25.0, 1.5];
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
            $law(&BoxSize::new(2.0, 0.1).unwrap(), [31.0, 24.0, 1.4 - PI], sized),
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
            $law(&HeavyTailed::student_t(pair, 3.0).unwrap(), [3.4, -0.5], plane),
            $law(&HeavyTailed::student_t(pair, 1e9).unwrap(), [3.4, -0.5], plane),
            $law(&HeavyTailed::outliers(pair, 0.1, 10.0).unwrap(), [3.4, -0.5], plane),
            $law(&HeavyTailed::outliers(pair, 0.1, 10.0).unwrap(), [6.0, 0.5], plane),
        ]
    }};
}

pub(crate) fn all_hold(laws: Vec<Verdict>) {
    for (i, law) in laws.into_iter().enumerate() {
        law.unwrap_or_else(|e| panic!("sensor {i}: {e}"));
    }
}

pub(crate) use {with_every_robust_sensor, with_every_sensor};

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
    let heavy = HeavyTailed::student_t(pair, dof).unwrap();
    let (z, x) = ([3.4, -0.5], [3.0, -2.0]);
    let normal = <RangeBearing as Measurement<2>>::log_likelihood(
        &Measurement::<2>::given(&pair, &z, Time::ZERO).unwrap(),
        x,
    );
    (log_likelihood(&heavy, z, x) - normal).abs()
}

pub(crate) fn log_likelihood<const N: usize, const M: usize, H>(sensor: &H, z: [f64; M], x: [f64; N]) -> f64
where
    H: Measurement<N, Value = [f64; M]>,
{
    H::log_likelihood(&sensor.given(&z, Time::ZERO).unwrap(), x)
}

/// A radar that forgets to wrap and to normalise.
pub(crate) struct Careless {
    pub(crate) wraps: bool,
    pub(crate) constant: f64,
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

pub(crate) const CAREFUL: f64 = -1.837_877_066_409_345_3; // -ln(2 pi)

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
