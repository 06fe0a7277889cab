//! Where targets were: truth, or estimates of another program, as positions over time.

use crate::columns::Quantity;
use crate::error::{Error, Result};
use crate::header::Purpose;
use crate::rows::{Options, Row, Rows, Summary};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::sync::Arc;
use zerre::{Span, Time};

/// A target at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectoryPoint {
    /// When.
    pub time: Time,
    /// x, y, z in metres; z is zero unless [`Options::three_d`] asks for heights.
    pub position: [f64; 3],
    /// Velocity along x, y, z in metres per second; z is zero where the table has no such column.
    pub velocity: Option<[f64; 3]>,
    /// Variance of x, covariance of x and y, variance of y, in square metres.
    pub covariance: Option<[f64; 3]>,
}

impl TrajectoryPoint {
    /// `None` if the row has no position.
    fn new(row: &Row) -> Option<TrajectoryPoint> {
        let of = |q| row.value(q);
        let velocity = of(Quantity::VelocityX).zip(of(Quantity::VelocityY));
        let covariance = of(Quantity::VarianceX).zip(of(Quantity::CovarianceXy)).zip(of(Quantity::VarianceY));
        Some(TrajectoryPoint {
            time: row.time,
            position: row.position?,
            velocity: velocity.map(|(vx, vy)| [vx, vy, of(Quantity::VelocityZ).unwrap_or(0.0)]),
            covariance: covariance.map(|((xx, xy), yy)| [xx, xy, yy]),
        })
    }
}

/// The way of one target: points in order of time, no two of one time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    points: Vec<TrajectoryPoint>,
}

impl Trajectory {
    /// The points, in order of time.
    pub fn points(&self) -> &[TrajectoryPoint] {
        &self.points
    }

    /// x, y, z in metres at `time`, on the straight line between its neighbours if they are at most `max_gap`
    /// apart; `None` otherwise, and before the first and after the last point.
    pub fn at(&self, time: Time, max_gap: Span) -> Option<[f64; 3]> {
        let next = self.points.partition_point(|p| p.time < time);
        let after = self.points.get(next)?;
        if after.time == time {
            return Some(after.position);
        }
        let before = self.points.get(next.checked_sub(1)?)?;
        let gap = after.time - before.time;
        if gap > max_gap {
            return None;
        }
        let share = (time - before.time).secs() / gap.secs();
        let along = |i: usize| before.position[i] * (1.0 - share) + after.position[i] * share;
        Some([along(0), along(1), along(2)])
    }
}

/// The ways of all targets of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectories {
    /// By identity; a table without identities is one target named `""`.
    pub by_id: BTreeMap<Arc<str>, Trajectory>,
    /// Rows of the same target and time as a row before them: the last one holds.
    pub repeated: u64,
    /// What the reader says.
    pub summary: Summary,
}

impl Trajectories {
    /// Reads columns of positions (`x_m` and `y_m`, or geographic ones in any [`Format`](crate::Format)), and of
    /// velocities and covariances where there are any. Give the measurements' origin as [`Options::origin`] so
    /// that both are in one frame. Any bytes give trajectories or an error.
    ///
    /// # Errors
    /// Whatever makes this no table of positions, and [`Error::TooManyRejected`].
    pub fn read(file: &str, input: impl BufRead, options: &Options) -> Result<Trajectories> {
        let mut rows = Rows::open(file, input, options, Purpose::Positions)?;
        let mut by_id: BTreeMap<Arc<str>, Trajectory> = BTreeMap::new();
        while let Some(row) = rows.next()? {
            let point = TrajectoryPoint::new(&row);
            rows.count(point.is_some());
            if let Some(point) = point {
                by_id.entry(row.id.unwrap_or_else(|| Arc::from(""))).or_default().points.push(point);
            }
        }
        let mut repeated = 0;
        for trajectory in by_id.values_mut() {
            let points = &mut trajectory.points;
            points.sort_by_key(|p| p.time);
            let before = points.len();
            // The last of equal times holds: `dedup` keeps the first, so each one overwrites it.
            points.dedup_by(|later, kept| {
                let same = later.time == kept.time;
                if same {
                    *kept = *later;
                }
                same
            });
            repeated += (before - points.len()) as u64;
        }
        Ok(Trajectories { by_id, repeated, summary: rows.finish()? })
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    /// [`Error::Read`] if it cannot be opened, and those of [`Trajectories::read`].
    pub fn open(path: &Path, options: &Options) -> Result<Trajectories> {
        let file = path.display().to_string();
        match File::open(path) {
            Ok(input) => Trajectories::read(&file, BufReader::new(input), options),
            Err(source) => Err(Error::Read { file, source }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(text: &str) -> Trajectories {
        Trajectories::read("truth.csv", text.as_bytes(), &Options::default()).unwrap()
    }

    #[test]
    fn estimates_carry_velocity_and_covariance() {
        let t = read(
            "id,time_s,x_m,y_m,vx_mps,vy_mps,var_x_m2,cov_xy_m2,var_y_m2\na,0,1,2,3,4,5,6,7\na,1,1,2,,,,,\n",
        );
        let points = t.by_id["a"].points();
        assert_eq!(points[0].velocity, Some([3.0, 4.0, 0.0]));
        assert_eq!(points[0].covariance, Some([5.0, 6.0, 7.0]));
        assert_eq!((points[1].velocity, points[1].covariance), (None, None));
    }

    #[test]
    fn order_and_repeats_are_mended() {
        let t = read("time_s,x_m,y_m\n2,2,0\n1,1,0\n2,5,0\n");
        assert_eq!(t.repeated, 1);
        let points = t.by_id[""].points();
        assert_eq!(points.iter().map(|p| p.position[0]).collect::<Vec<_>>(), [1.0, 5.0]);
    }

    #[test]
    fn positions_between_points() {
        let t = read("id,time_s,x_m,y_m\na,0,0,10\na,1,2,20\na,4,8,20\n");
        let at = |s: &str, gap| t.by_id["a"].at(Time::parse_secs(s).unwrap(), Span::from_secs(gap));
        assert_eq!(at("0", 0.0), Some([0.0, 10.0, 0.0]));
        assert_eq!(at("0.25", 1.0), Some([0.5, 12.5, 0.0]));
        assert_eq!(at("2", 1.0), None);
        assert_eq!(at("2.5", 3.0), Some([5.0, 20.0, 0.0]));
        assert_eq!((at("-0.1", 9.0), at("4.1", 9.0)), (None, None));
    }

    #[test]
    fn polar_tables_are_no_truth() {
        let table = "id,time_s,range_m,bearing_deg\na,0,1,2\n";
        let error = Trajectories::read("f", table.as_bytes(), &Options::default()).unwrap_err();
        assert!(matches!(error, Error::NoMeasurement { .. }), "{error}");
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(body in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = Trajectories::read("f", &body[..], &Options::default());
            let mut table = b"time_s,id,x_m,y_m,vx_mps,var_x_m2\n".to_vec();
            table.extend(body);
            let _ = Trajectories::read("f", &table[..], &Options { max_rejected: 1.0, ..Options::default() });
        }
    }
}
