//! Sensors chosen at run time: a reading finds its model once per block of particles, or once per Kalman update.

use super::tail::{Robust, Tail, TailGiven};
use super::{Plot, Reading};
use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::kernels::{self, Simd};
use crate::math::{Matrix, Real, chi_square, ln, sin_cos};
use crate::model::measurement::{
    BearingOnly, BoxSize, Position, RangeBearing, RangeBearingElevation, RangeOnly, RangeRate,
};
use crate::model::{GaussianMeasurement, Likelihood, Measurement};
use crate::time::Time;
use serde::{Deserialize, Serialize};
use std::array::from_fn;
use std::collections::BTreeMap;

/// What a sensor is: where it stands and how far it errs. A noise that is `None` is not known: a reading that needs
/// it is refused.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SensorSpec {
    /// Where it stands, metres; the third component counts in three dimensions only.
    pub position_m: [f64; 3],
    /// Standard deviation of each coordinate of a position, metres.
    pub position_sd_m: Option<f64>,
    /// Standard deviation of a range, metres.
    pub range_sd_m: Option<f64>,
    /// Standard deviation of a bearing, radians.
    pub bearing_sd_rad: Option<f64>,
    /// Standard deviation of an elevation, radians.
    pub elevation_sd_rad: Option<f64>,
    /// Standard deviation of a range rate, metres per second.
    pub range_rate_sd_mps: Option<f64>,
    /// Standard deviation of a length and of a width, metres.
    pub size_sd_m: Option<f64>,
    /// Standard deviation of an orientation, radians.
    pub orientation_sd_rad: Option<f64>,
    /// Probability with which a true measurement of normal errors lies inside the gate; `None` or 0 for no gate.
    pub gate: Option<f64>,
    /// A law of errors with heavier tails.
    pub robust: Option<Robust>,
}

/// A noise of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Noise {
    /// Of a position.
    Position,
    /// Of a range.
    Range,
    /// Of a bearing.
    Bearing,
    /// Of an elevation.
    Elevation,
    /// Of a range rate.
    RangeRate,
    /// Of a length and a width.
    Size,
    /// Of an orientation.
    Orientation,
}

impl Noise {
    /// The noises that a reading depends on.
    pub fn of(reading: &Reading) -> &'static [Noise] {
        match reading {
            Reading::Position2(_) | Reading::Position3(_) => &[Noise::Position],
            Reading::RangeBearing(_) => &[Noise::Range, Noise::Bearing],
            Reading::RangeBearingElevation(_) => &[Noise::Range, Noise::Bearing, Noise::Elevation],
            Reading::Bearing(_) => &[Noise::Bearing],
            Reading::Range(_) => &[Noise::Range],
            Reading::RangeRate(_) => &[Noise::RangeRate],
            Reading::Size(_) => &[Noise::Size, Noise::Orientation],
        }
    }

    fn plural(self) -> &'static str {
        match self {
            Noise::Position => "positions",
            Noise::Range => "ranges",
            Noise::Bearing => "bearings",
            Noise::Elevation => "elevations",
            Noise::RangeRate => "range rates",
            Noise::Size => "sizes",
            Noise::Orientation => "orientations",
        }
    }
}

impl SensorSpec {
    /// The standard deviation of this noise, in metres, radians or metres per second.
    pub fn sd(&self, noise: Noise) -> Option<f64> {
        match noise {
            Noise::Position => self.position_sd_m,
            Noise::Range => self.range_sd_m,
            Noise::Bearing => self.bearing_sd_rad,
            Noise::Elevation => self.elevation_sd_rad,
            Noise::RangeRate => self.range_rate_sd_mps,
            Noise::Size => self.size_sd_m,
            Noise::Orientation => self.orientation_sd_rad,
        }
    }

    /// Where the standard deviation of this noise is kept.
    pub fn sd_mut(&mut self, noise: Noise) -> &mut Option<f64> {
        match noise {
            Noise::Position => &mut self.position_sd_m,
            Noise::Range => &mut self.range_sd_m,
            Noise::Bearing => &mut self.bearing_sd_rad,
            Noise::Elevation => &mut self.elevation_sd_rad,
            Noise::RangeRate => &mut self.range_rate_sd_mps,
            Noise::Size => &mut self.size_sd_m,
            Noise::Orientation => &mut self.orientation_sd_rad,
        }
    }
}

/// The models that fit a state of `N` components in `D` dimensions.
pub(super) trait Frame<const N: usize, const D: usize>: Clone + Send + Sync + 'static {
    type Polar: GaussianMeasurement<N, D> + Measurement<N, Value = [f64; D]> + Clone;
    type Rate: GaussianMeasurement<N, 1> + Measurement<N, Value = [f64; 1]> + Clone;
    type Size: GaussianMeasurement<N, 3> + Measurement<N, Value = [f64; 3]> + Clone;

    fn polar(position: [f64; D], range_sd: f64, bearing_sd: f64, elevation_sd: f64) -> Result<Self::Polar>;
    fn rate(position: [f64; D], sd: f64) -> Result<Self::Rate>;
    fn size(size_sd: f64, orientation_sd: f64) -> Result<Self::Size>;
}

/// States `[x, y, vx, vy, ...]`.
#[derive(Clone)]
pub(super) struct Plane;
/// States `[x, y, vx, vy, length, width, orientation]`.
#[derive(Clone)]
pub(super) struct Boxed;
/// States `[x, y, z, vx, vy, vz, ...]`.
#[derive(Clone)]
pub(super) struct Space;
/// States `[x, y]`.
#[derive(Clone)]
pub(super) struct StillPlane;
/// States `[x, y, z]`.
#[derive(Clone)]
pub(super) struct StillSpace;

/// What a state has not (a velocity, a size): there is no measurement of it.
#[derive(Clone, Debug)]
pub(super) enum Absent<const M: usize> {}

impl<const N: usize, const M: usize> Measurement<N> for Absent<M> {
    type Value = [f64; M];
    type Given<'z> = Absent<M>;

    fn given(&self, _: &[f64; M], _: Time) -> Result<Absent<M>> {
        match *self {}
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &Absent<M>, _: [R; N]) -> R {
        match *given {}
    }
}

impl<const N: usize, const M: usize> GaussianMeasurement<N, M> for Absent<M> {
    #[inline(always)]
    fn predict<R: Real>(&self, _: Time, _: [R; N]) -> [R; M] {
        match *self {}
    }

    fn components(&self, _: &[f64; M]) -> [f64; M] {
        match *self {}
    }

    fn covariance(&self) -> [[f64; M]; M] {
        match *self {}
    }
}

macro_rules! frames {
    ($($frame:ident<$n:ident>, $d:literal, $polar:ty, $rate:ty, $size:ty,
       $make_polar:expr, $make_rate:expr, $make_size:expr;)+) => {$(
        impl<const $n: usize> Frame<$n, $d> for $frame {
            type Polar = $polar;
            type Rate = $rate;
            type Size = $size;

            fn polar(position: [f64; $d], range: f64, bearing: f64, elevation: f64) -> Result<$polar> {
                $make_polar(position, range, bearing, elevation)
            }

            fn rate(position: [f64; $d], sd: f64) -> Result<$rate> {
                $make_rate(position, sd)
            }

            fn size(size_sd: f64, orientation_sd: f64) -> Result<$size> {
                $make_size(size_sd, orientation_sd)
            }
        }
    )+};
}

fn in_plane(position: [f64; 2], range: f64, bearing: f64, _: f64) -> Result<RangeBearing> {
    RangeBearing::new(position, range, bearing)
}

fn moving<const D: usize>(position: [f64; D], sd: f64) -> Result<RangeRate<D>> {
    RangeRate::new(position, [0.0; D], sd)
}

fn still<const D: usize>(_: [f64; D], _: f64) -> Result<Absent<1>> {
    Err(Error::Unsupported("a motion without velocity has no range rate".to_owned()))
}

fn a_point(_: f64, _: f64) -> Result<Absent<3>> {
    Err(Error::Unsupported("a motion of a point has no size".to_owned()))
}

frames! {
    Plane<N>, 2, RangeBearing, RangeRate<2>, Absent<3>, in_plane, moving, a_point;
    StillPlane<N>, 2, RangeBearing, Absent<1>, Absent<3>, in_plane, still, a_point;
    Boxed<N>, 2, RangeBearing, RangeRate<2>, BoxSize, in_plane, moving, BoxSize::new;
    Space<N>, 3, RangeBearingElevation, RangeRate<3>, Absent<3>, RangeBearingElevation::new, moving, a_point;
    StillSpace<N>, 3, RangeBearingElevation, Absent<1>, Absent<3>, RangeBearingElevation::new, still, a_point;
}

/// One sensor with its models; those without a known noise are absent.
#[derive(Clone)]
pub(super) struct Sensor<F: Frame<N, D>, const N: usize, const D: usize> {
    name: String,
    spec: SensorSpec,
    origin: [f64; D],
    position: Option<Tail<Position<D>, D>>,
    polar: Option<Tail<F::Polar, D>>,
    bearing: Option<Tail<BearingOnly, 1>>,
    range: Option<Tail<RangeOnly<D>, 1>>,
    rate: Option<Tail<F::Rate, 1>>,
    size: Option<Tail<F::Size, 3>>,
    /// Largest squared Mahalanobis distance inside the gate, by the number of components less one.
    gate: Option<[f64; 3]>,
}

/// Something to do with the model that a reading needs.
pub(super) trait Work<const N: usize> {
    type Out;
    fn with<H, const M: usize>(self, model: &H, z: &[f64; M]) -> Result<Self::Out>
    where
        H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]> + Clone;
}

impl<F: Frame<N, D>, const N: usize, const D: usize> Sensor<F, N, D> {
    fn new(name: &str, spec: &SensorSpec) -> Result<Self> {
        let origin: [f64; D] = from_fn(|i| spec.position_m[i]);
        for coordinate in origin {
            Error::finite("position of the sensor", coordinate)?;
        }
        let tail = spec.robust;
        let polar = spec.range_sd_m.zip(spec.bearing_sd_rad).zip(if D == 3 {
            spec.elevation_sd_rad
        } else {
            Some(0.0)
        });
        let gate = match spec.gate.filter(|&p| p != 0.0) {
            None => None,
            Some(p) => {
                Error::positive("probability of the gate", p)?;
                Some([chi_square::quantile(p, 1)?, chi_square::quantile(p, 2)?, chi_square::quantile(p, 3)?])
            }
        };
        let flat = [origin[0], origin[1]];
        // Where the motion is at fault, not the sensor, that is told when such a thing is measured.
        let rate = spec.range_rate_sd_mps.and_then(|sd| had(F::rate(origin, sd)));
        let size =
            spec.size_sd_m.zip(spec.orientation_sd_rad).and_then(|(size, turn)| had(F::size(size, turn)));
        Ok(Sensor {
            name: name.to_owned(),
            position: spec.position_sd_m.map(|sd| Tail::new(Position::new(sd)?, tail)).transpose()?,
            polar: polar
                .map(|((range, bearing), elevation)| {
                    Tail::new(F::polar(origin, range, bearing, elevation)?, tail)
                })
                .transpose()?,
            bearing: spec
                .bearing_sd_rad
                .map(|sd| Tail::new(BearingOnly::new(flat, sd)?, tail))
                .transpose()?,
            range: spec.range_sd_m.map(|sd| Tail::new(RangeOnly::new(origin, sd)?, tail)).transpose()?,
            rate: rate.map(|rate| Tail::new(rate?, tail)).transpose()?,
            size: size.map(|size| Tail::new(size?, tail)).transpose()?,
            gate,
            origin,
            spec: spec.clone(),
        })
    }

    /// Largest NIS of a measurement of `m` components that is used.
    pub(super) fn threshold(&self, m: usize) -> f64 {
        self.gate.and_then(|gate| gate.get(m.wrapping_sub(1)).copied()).unwrap_or(f64::INFINITY)
    }

    /// How many measurements in a row the gate refuses before the belief is what is wrong: right models see so many
    /// refused with a probability of at most 1e-9, and two in a row may be one disturbance.
    pub(super) fn refusals(&self) -> u32 {
        const CHANCE: f64 = 1e-9;
        const LEAST: u32 = 3;
        let inside = self.spec.gate.unwrap_or(0.0);
        // A quotient that should be whole is not let up to the next number by its rounding.
        let needed = ((ln(CHANCE) / ln(1.0 - inside)).abs() - 1e-9).ceil();
        LEAST.max(needed as u32)
    }

    /// Whether errors follow the normal law.
    pub(super) fn is_normal(&self) -> bool {
        self.spec.robust.is_none()
    }

    /// Does `work` with the model of `reading`.
    pub(super) fn with<T: Work<N>>(&self, reading: &Reading, work: T) -> Result<T::Out> {
        self.fits(reading)?;
        match reading {
            Reading::Position2(_) | Reading::Position3(_) => {
                work.with(known(&self.position, self, reading)?, exactly(reading)?)
            }
            Reading::RangeBearing(_) | Reading::RangeBearingElevation(_) => {
                work.with(known(&self.polar, self, reading)?, exactly(reading)?)
            }
            Reading::Bearing(_) => work.with(known(&self.bearing, self, reading)?, exactly(reading)?),
            Reading::Range(_) => work.with(known(&self.range, self, reading)?, exactly(reading)?),
            Reading::RangeRate(_) => work.with(known(&self.rate, self, reading)?, exactly(reading)?),
            Reading::Size(_) => work.with(known(&self.size, self, reading)?, exactly(reading)?),
        }
    }

    /// Refuses what cannot be told of a state in `D` dimensions.
    fn fits(&self, reading: &Reading) -> Result<()> {
        let (what, needs) = match reading {
            Reading::Position2(_) if D != 2 => ("a position in the plane", 2),
            Reading::RangeBearing(_) if D != 2 => ("range and bearing without elevation", 2),
            Reading::Position3(_) if D != 3 => ("a position with height", 3),
            Reading::RangeBearingElevation(_) if D != 3 => ("range, bearing and elevation", 3),
            _ => return Ok(()),
        };
        Err(Error::Unsupported(format!(
            "sensor `{}` measures {what}, which needs a motion in {needs} dimensions; this one has {D}",
            self.name
        )))
    }

    /// Where the reading alone puts the target, with its covariance; `None` if it does not tell.
    pub(super) fn place(&self, reading: &Reading) -> Result<Option<Gaussian<D>>> {
        self.fits(reading)?;
        let variance = |noise| -> Result<f64> {
            let sd = self.spec.sd(noise).ok_or_else(|| self.unknown(noise))?;
            Ok(sd * sd)
        };
        for &value in reading.values() {
            Error::finite("measurement", value)?;
        }
        let law = match *reading {
            Reading::Position2(_) | Reading::Position3(_) => {
                let z: &[f64; D] = exactly(reading)?;
                Gaussian::new(*z, Matrix::from_diagonal([variance(Noise::Position)?; D]))?
            }
            Reading::RangeBearing([range, bearing]) => {
                let noise = [variance(Noise::Range)?, variance(Noise::Bearing)?, 0.0];
                self.converted([range, bearing, 0.0], noise)?
            }
            Reading::RangeBearingElevation(z) => {
                let noise = [variance(Noise::Range)?, variance(Noise::Bearing)?, variance(Noise::Elevation)?];
                self.converted(z, noise)?
            }
            Reading::Bearing(_) | Reading::Range(_) | Reading::RangeRate(_) | Reading::Size(_) => {
                return Ok(None);
            }
        };
        Ok(Some(law))
    }

    /// From polar to Cartesian coordinates by the tangent; across the line of sight the spread is that of the
    /// measured range, which it exceeds by far less than one part in sd^2.
    fn converted(&self, [range, bearing, elevation]: [f64; 3], noise: [f64; 3]) -> Result<Gaussian<D>> {
        let ((sb, cb), (se, ce)) = (sin_cos(bearing), sin_cos(elevation));
        let jacobian = [
            [ce * cb, -range * ce * sb, -range * se * cb],
            [ce * sb, range * ce * cb, -range * se * sb],
            [se, 0.0, range * ce],
        ];
        let offset = [range * ce * cb, range * ce * sb, range * se];
        let rows: Matrix<D, 3> = Matrix(from_fn(|i| jacobian[i]));
        let covariance = rows.congruence(&Matrix::from_diagonal(noise));
        Gaussian::new(from_fn(|i| self.origin[i] + offset[i]), covariance)
    }

    fn unknown(&self, noise: Noise) -> Error {
        Error::Unsupported(format!(
            "sensor `{}` measures {}, but the standard deviation of their noise is not known",
            self.name,
            noise.plural()
        ))
    }
}

/// A model, or none where the motion has no place for it.
fn had<T>(made: Result<T>) -> Option<Result<T>> {
    match made {
        Err(Error::Unsupported(_)) => None,
        made => Some(made),
    }
}

/// The values of a reading as an array.
fn exactly<const M: usize>(reading: &Reading) -> Result<&[f64; M]> {
    let values = reading.values();
    values.try_into().map_err(|_| Error::Shape {
        what: "numbers of a reading",
        found: values.len(),
        expected: M,
    })
}

/// The model, or why there is none.
fn known<'a, T, F: Frame<N, D>, const N: usize, const D: usize>(
    model: &'a Option<T>,
    sensor: &Sensor<F, N, D>,
    reading: &Reading,
) -> Result<&'a T> {
    model.as_ref().ok_or_else(|| {
        match Noise::of(reading).iter().find(|&&noise| sensor.spec.sd(noise).is_none()) {
            Some(&noise) => sensor.unknown(noise),
            None => Error::Unsupported(match reading {
                Reading::Size(_) => "sizes need a motion of a box; this one is of a point".to_owned(),
                _ => "range rates need a motion with velocity; this one has none".to_owned(),
            }),
        }
    })
}

/// All sensors of a run. A plot finds its own by name, else the default.
#[derive(Clone)]
pub(super) struct Sensors<F: Frame<N, D>, const N: usize, const D: usize> {
    by_name: BTreeMap<String, Sensor<F, N, D>>,
    default: Sensor<F, N, D>,
}

/// Name of the sensor that stands for all that have none of their own.
pub const DEFAULT_SENSOR: &str = "default";

impl<F: Frame<N, D>, const N: usize, const D: usize> Sensors<F, N, D> {
    pub(super) fn new(specs: &BTreeMap<String, SensorSpec>) -> Result<Self> {
        let make = |(name, spec): (&String, &SensorSpec)| Ok((name.clone(), Sensor::new(name, spec)?));
        let by_name = specs.iter().map(make).collect::<Result<BTreeMap<_, _>>>()?;
        let default = match by_name.get(DEFAULT_SENSOR) {
            Some(default) => default.clone(),
            None => Sensor::new(DEFAULT_SENSOR, &SensorSpec::default())?,
        };
        Ok(Sensors { by_name, default })
    }

    pub(super) fn of(&self, plot: &Plot) -> &Sensor<F, N, D> {
        plot.sensor.as_deref().and_then(|name| self.by_name.get(name)).unwrap_or(&self.default)
    }
}

/// The digest of `z`, for states of `N` components.
fn given<'z, const N: usize, H: Measurement<N>>(
    model: &'z H,
    z: &'z H::Value,
    at: Time,
) -> Result<H::Given<'z>> {
    model.given(z, at)
}

/// A plot, digested: the model's own digest.
pub(super) enum Digest<'z, F: Frame<N, D>, const N: usize, const D: usize>
where
    F::Polar: 'z,
    F::Rate: 'z,
    F::Size: 'z,
{
    Position(TailGiven<<Position<D> as Measurement<N>>::Given<'z>>),
    Polar(TailGiven<<F::Polar as Measurement<N>>::Given<'z>>),
    Bearing(TailGiven<<BearingOnly as Measurement<N>>::Given<'z>>),
    Range(TailGiven<<RangeOnly<D> as Measurement<N>>::Given<'z>>),
    Rate(TailGiven<<F::Rate as Measurement<N>>::Given<'z>>),
    Size(TailGiven<<F::Size as Measurement<N>>::Given<'z>>),
}

impl<F: Frame<N, D>, const N: usize, const D: usize> Likelihood<N> for Sensors<F, N, D> {
    type Value = Plot;
    type Digest<'z> = Digest<'z, F, N, D>;

    fn digest<'z>(&'z self, plot: &'z Plot, at: Time) -> Result<Digest<'z, F, N, D>> {
        let sensor = self.of(plot);
        let reading = &plot.reading;
        sensor.fits(reading)?;
        Ok(match reading {
            Reading::Position2(_) | Reading::Position3(_) => Digest::Position(given::<N, _>(
                known(&sensor.position, sensor, reading)?,
                exactly(reading)?,
                at,
            )?),
            Reading::RangeBearing(_) | Reading::RangeBearingElevation(_) => {
                Digest::Polar(given::<N, _>(known(&sensor.polar, sensor, reading)?, exactly(reading)?, at)?)
            }
            Reading::Bearing(_) => Digest::Bearing(given::<N, _>(
                known(&sensor.bearing, sensor, reading)?,
                exactly(reading)?,
                at,
            )?),
            Reading::Range(_) => {
                Digest::Range(given::<N, _>(known(&sensor.range, sensor, reading)?, exactly(reading)?, at)?)
            }
            Reading::RangeRate(_) => {
                Digest::Rate(given::<N, _>(known(&sensor.rate, sensor, reading)?, exactly(reading)?, at)?)
            }
            Reading::Size(_) => {
                Digest::Size(given::<N, _>(known(&sensor.size, sensor, reading)?, exactly(reading)?, at)?)
            }
        })
    }

    fn score(digest: &Digest<'_, F, N, D>, simd: Simd, states: &[&[f64]; N], out: &mut [f64]) {
        match digest {
            Digest::Position(given) => kernels::score::<N, Tail<Position<D>, D>>(simd, given, states, out),
            Digest::Polar(given) => kernels::score::<N, Tail<F::Polar, D>>(simd, given, states, out),
            Digest::Bearing(given) => kernels::score::<N, Tail<BearingOnly, 1>>(simd, given, states, out),
            Digest::Range(given) => kernels::score::<N, Tail<RangeOnly<D>, 1>>(simd, given, states, out),
            Digest::Rate(given) => kernels::score::<N, Tail<F::Rate, 1>>(simd, given, states, out),
            Digest::Size(given) => kernels::score::<N, Tail<F::Size, 3>>(simd, given, states, out),
        }
    }
}
