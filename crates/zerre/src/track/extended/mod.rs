//! Extended targets by name: scans of points in; where the target is and what shape it has out.

mod begin;
mod follow;

use crate::catalog::EXTENDED_FILTERS;
use crate::error::{Error, Result};
use crate::extended::{MAX_ELLIPSES, Shape};
use crate::math::gaussian::LN_2PI;
use crate::math::simplex::{Search, climb};
use crate::math::{exp, ln};
use crate::time::{Span, Time};
use begin::thinned;
use follow::Following;
use serde::{Deserialize, Serialize};

use super::{Row, State};

/// The points of a target at one time, m.
pub type Scan = (Time, Vec<[f64; 2]>);

/// A filter of extended targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ExtendedFilter {
    /// [`WindowVb`](crate::extended::window::WindowVb).
    WindowVb,
    /// [`RandomMatrix`](crate::extended::random_matrix::RandomMatrix) by Koch's rule.
    RandomMatrixKoch,
    /// [`RandomMatrix`](crate::extended::random_matrix::RandomMatrix) by the rule of Feldmann, Fränken and Koch.
    RandomMatrixFeldmann,
}

impl ExtendedFilter {
    /// The filter of a name of [`EXTENDED_FILTERS`].
    ///
    /// # Errors
    /// Another name.
    pub fn named(name: &str) -> Result<ExtendedFilter> {
        match name {
            "window-vb" => Ok(ExtendedFilter::WindowVb),
            "random-matrix-koch" => Ok(ExtendedFilter::RandomMatrixKoch),
            "random-matrix-feldmann" => Ok(ExtendedFilter::RandomMatrixFeldmann),
            _ => {
                let known: Vec<_> = EXTENDED_FILTERS.iter().map(|entry| entry.name).collect();
                let text = format!("there is no filter of extended targets `{name}`; known: ");
                Err(Error::Unsupported(text + &known.join(", ")))
            }
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            ExtendedFilter::WindowVb => "window-vb",
            ExtendedFilter::RandomMatrixKoch => "random-matrix-koch",
            ExtendedFilter::RandomMatrixFeldmann => "random-matrix-feldmann",
        }
    }
}

/// How a body turns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rotation {
    /// It keeps its direction in the plane.
    #[default]
    None,
    /// It points along its velocity.
    Velocity,
}

/// Points that are of no target.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClutterSpec {
    /// Area over which they are uniform, m^2.
    pub area_m2: f64,
    /// How many there are in a scan; `None`: learnt.
    pub rate: Option<f64>,
}

/// A tracker of extended targets written down. The target moves at nearly constant velocity
/// ([`ConstantVelocity`](crate::model::motion::ConstantVelocity)), its state is `[x, y, vx, vy]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExtendedSpec {
    /// The filter.
    pub filter: ExtendedFilter,
    /// How the body turns; [`ExtendedFilter::WindowVb`] alone knows more than [`Rotation::None`].
    pub rotation: Rotation,
    /// Number of ellipses; `None`: as many as the points call for, then and as the target is followed.
    pub ellipses: Option<usize>,
    /// Scans that the first shape is found from.
    pub first_scans: usize,
    /// See [`WindowSettings`](crate::extended::window::WindowSettings).
    pub window: usize,
    /// See [`WindowSettings`](crate::extended::window::WindowSettings).
    pub sweeps: usize,
    /// Share of what is known of the shape that is kept from scan to scan, from 0 to 1: 1 for a shape that stays. The
    /// window filter forgets scans that have left its window.
    pub keep: f64,
    /// Least standard deviation of points along an axis of an ellipse, m.
    pub least_sd_m: f64,
    /// Standard deviation of the noise of the sensor, m: not a part of the shape. Koch's rule has none.
    pub position_sd_m: f64,
    /// Points of no target; for [`ExtendedFilter::WindowVb`].
    pub clutter: Option<ClutterSpec>,
    /// Standard deviation of the acceleration averaged over a second, m/s^2; the spectral density of the white noise is
    /// its square times 1 s.
    pub acceleration_sd_mps2: f64,
    /// Standard deviation of each component of the velocity at the start, m/s.
    pub speed_sd_mps: f64,
    /// A longer silence ends a track; the next scan starts another.
    pub max_gap: Span,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// An interval of a standard deviation, m.
pub type Interval = [f64; 2];

/// What is known of a target after a scan.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtendedRow {
    /// State and outcome. The position is the mean of a point of the shape, and its covariance that of the centre and
    /// of where the middle of the shape lies from there; of the innovation, the mean of the points
    /// of the scan against its prediction, there is none where points may be of no target.
    pub row: Row,
    /// The rest.
    pub body: Body,
}

/// The body of a target, and how many points it gives.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// The shape about the position, as it lies in the plane.
    pub shape: Shape,
    /// Of each ellipse, 95 % intervals of the standard deviation of its points along its axes, the longer first.
    pub intervals: Vec<[Interval; 2]>,
    /// Points of the target in a scan, posterior mean.
    pub rate: f64,
    /// Points of no target in a scan, where they are expected.
    pub clutter_rate: Option<f64>,
}

impl ExtendedSpec {
    /// Scans in which the first shape is sought, and which the window holds: enough for a shape of three ellipses at
    /// ten points a scan, few enough for a target that turns.
    pub const SCANS: usize = 10;

    /// The default settings for a motion of this size.
    pub fn new(filter: ExtendedFilter, acceleration_sd_mps2: f64) -> ExtendedSpec {
        ExtendedSpec {
            filter,
            rotation: Rotation::None,
            ellipses: None,
            first_scans: ExtendedSpec::SCANS,
            window: ExtendedSpec::SCANS,
            sweeps: 5,
            keep: 1.0,
            least_sd_m: 0.05,
            position_sd_m: 0.0,
            clutter: None,
            acceleration_sd_mps2,
            speed_sd_mps: 30.0,
            max_gap: Span::from_nanos(300_000_000_000),
            seed: 1,
        }
    }

    /// What the numbers of a state are, in order.
    pub const fn states() -> [State; 4] {
        [State::Position(0), State::Position(1), State::Velocity(0), State::Velocity(1)]
    }

    /// Refuses settings that mean nothing together; those of one filter alone are refused when it is made.
    ///
    /// # Errors
    /// The first of them.
    pub fn check(&self) -> Result<()> {
        if let Some(ellipses) = self.ellipses
            && !(1..=MAX_ELLIPSES).contains(&ellipses)
        {
            let needs = "it must lie between 1 and 16";
            return Err(Error::OutOfRange { what: "number of ellipses", value: ellipses as f64, needs });
        }
        Error::positive("scans that the first shape is found from", self.first_scans as f64)?;
        Error::positive("least standard deviation of an ellipse", self.least_sd_m)?;
        Error::not_negative("noise of the sensor", self.position_sd_m)?;
        Error::positive("standard deviation of the speed at the start", self.speed_sd_mps)?;
        if Error::not_negative("share of the shape that is kept", self.keep)? > 1.0 {
            let needs = "it must not exceed 1";
            return Err(Error::OutOfRange {
                what: "share of the shape that is kept",
                value: self.keep,
                needs,
            });
        }
        let of_window = [
            ("rotation", self.rotation != Rotation::None),
            ("clutter", self.clutter.is_some()),
            ("more than one ellipse", self.ellipses.is_some_and(|ellipses| ellipses > 1)),
        ];
        if self.filter != ExtendedFilter::WindowVb
            && let Some((what, _)) = of_window.iter().find(|(_, given)| *given)
        {
            return Err(Error::Unsupported(format!("the filter `{}` has no {what}", self.filter.name())));
        }
        if self.filter == ExtendedFilter::RandomMatrixKoch && self.position_sd_m > 0.0 {
            let text = "the filter `random-matrix-koch` has no noise of the sensor".to_owned();
            return Err(Error::Unsupported(text));
        }
        Ok(())
    }

    /// Follows a target through its scans, which are in order of time. Tracks are started from the data alone: the first
    /// scans tell the first shape, the first of them the position, and the velocity is unknown. Positions may lie far
    /// from the origin of the plane, at no loss.
    ///
    /// The rows end with the first error: scans out of order, numbers that are not finite, a track whose scans all have
    /// no points.
    ///
    /// # Errors
    /// Settings that mean nothing.
    pub fn follow<'a>(
        &'a self,
        identity: &str,
        scans: &'a [Scan],
    ) -> Result<impl Iterator<Item = Result<ExtendedRow>> + use<'a>> {
        self.check()?;
        Ok(Following::new(self, identity, scans))
    }

    /// The log-evidence of the first scans of targets, each foretold from those before, by one ellipse: of at most five
    /// targets, those with the most scans, the first fifty of each, and in each no more than some forty points. `None`
    /// where no target is seen twice, -inf where the filter breaks.
    ///
    /// # Errors
    /// Settings that mean nothing.
    pub fn log_evidence(&self, targets: &[&[Scan]]) -> Result<Option<f64>> {
        self.check()?;
        let chosen = chosen(targets);
        Ok((!chosen.is_empty()).then(|| self.evidence(&chosen)))
    }

    /// The acceleration under which [`ExtendedSpec::log_evidence`] is the largest, to two digits, and that evidence.
    ///
    /// # Errors
    /// Settings that mean nothing; scans that no acceleration explains.
    pub fn learn_acceleration(&self, targets: &[&[Scan]]) -> Result<Option<(f64, f64)>> {
        // Logarithm of the largest factor between it and 1 m/s^2: numbers without any scatter (made ones) would drive
        // the noise to zero.
        const WIDEST: f64 = 8.0;
        self.check()?;
        let chosen = chosen(targets);
        if chosen.is_empty() {
            return Ok(None);
        }
        let with = |log: f64| ExtendedSpec { acceleration_sd_mps2: two_digits(exp(log)), ..self.clone() };
        let evidence = |log: f64| with(log).evidence(&chosen);
        // Coarse steps of a factor of four, then the simplex.
        let mut best = (f64::NEG_INFINITY, 0.0);
        for step in -4..=4 {
            let log = f64::from(step) * ln(4.0);
            let value = evidence(log);
            if value > best.0 {
                best = (value, log);
            }
        }
        if best.0 == f64::NEG_INFINITY {
            // Why, the filter says itself.
            for row in self.follow("", &chosen[0])? {
                row?;
            }
            let text = "no acceleration explains the first scans: give acceleration_sd_mps2".to_owned();
            return Err(Error::Unsupported(text));
        }
        let near = Search { first: 0.5, close: 0.05, turns: 20 };
        let summit = climb(&[best.1], near, |logs| {
            let log = logs.first().copied().unwrap_or_default();
            Ok(if log.abs() > WIDEST { f64::NEG_INFINITY } else { evidence(log) })
        })?;
        let log = summit.at.first().copied().unwrap_or_default();
        Ok(Some((with(log).acceleration_sd_mps2, summit.height)))
    }

    /// Log-evidence of scans by one ellipse; -inf where the filter breaks, which a motion far from the target's may do.
    fn evidence(&self, targets: &[Vec<Scan>]) -> f64 {
        let spec = ExtendedSpec { ellipses: Some(1), ..self.clone() };
        let of_all = || -> Result<f64> {
            // No ellipse is smaller than the least, and no density of a point larger than that allows.
            let most = match self.filter {
                ExtendedFilter::WindowVb => -LN_2PI - 2.0 * ln(self.least_sd_m.max(self.position_sd_m)),
                _ => f64::INFINITY,
            };
            let mut sum = 0.0;
            for scans in targets {
                for (row, (_, points)) in spec.follow("", scans)?.zip(scans) {
                    let Some(update) = row?.row.update else { continue };
                    if !points.is_empty() && update.log_evidence > most * points.len() as f64 {
                        return Ok(f64::NEG_INFINITY);
                    }
                    sum += update.log_evidence;
                }
            }
            Ok(sum)
        };
        of_all().ok().filter(|sum| !sum.is_nan()).unwrap_or(f64::NEG_INFINITY)
    }
}

/// What of the scans of targets is enough to learn a number from.
fn chosen(targets: &[&[Scan]]) -> Vec<Vec<Scan>> {
    const MOST_TARGETS: usize = 5;
    const MOST_SCANS: usize = 50;
    const MOST_POINTS: usize = 40;
    let mut targets: Vec<_> = targets.iter().filter(|scans| scans.len() > 1).collect();
    targets.sort_by_key(|scans| std::cmp::Reverse(scans.len()));
    targets.truncate(MOST_TARGETS);
    let few = |scans: &&&[Scan]| {
        let first = scans.iter().take(MOST_SCANS);
        first.map(|(time, points)| (*time, thinned(points, MOST_POINTS))).collect()
    };
    targets.iter().map(few).collect()
}

/// Two digits: more are not known.
fn two_digits(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(value)
}
