//! The scene: a target of three ellipses on a nearly straight path, seen as points.

use super::methods::{Task, from_data};
use super::settings::{ACCELERATION, CLUTTER_SIDE, FIRST_DEVIATION, FIRST_STATE, NEAR, TRUTH};
use zerre::belief::Gaussian;
use zerre::extended::{Ellipse, Shape};
use zerre::math::{Cholesky, Matrix, exp};
use zerre::model::motion::ConstantVelocity;
use zerre::model::simulate;
use zerre::rng::{Draws, Purpose, Stream};
use zerre::{Result, Time};

/// A recording with its truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Time of each scan.
    pub times: Vec<Time>,
    /// Points of each scan, m, the target's first.
    pub scans: Vec<Vec<[f64; 2]>>,
    /// True state at each scan.
    pub path: Vec<[f64; 4]>,
    /// True ellipse of each of the target's points; what follows them is clutter.
    pub origins: Vec<Vec<usize>>,
}

/// Shape of ellipses with equal weights, from offsets and extents (xx, xy, yy).
///
/// # Errors
/// An extent that is not positive definite.
pub fn equal_shape(ellipses: &[([f64; 2], [f64; 3])]) -> Result<Shape> {
    let of = |&(offset, [xx, xy, yy]): &([f64; 2], [f64; 3])| Ellipse {
        weight: 1.0,
        offset,
        extent: Matrix([[xx, xy], [xy, yy]]),
    };
    Shape::new(ellipses.iter().map(of).collect())
}

/// The true shape.
///
/// # Errors
/// None: the settings are a shape.
pub fn truth() -> Result<Shape> {
    equal_shape(&TRUTH)
}

/// How the target moves: as methods assume.
///
/// # Errors
/// None: the settings are a motion.
pub fn motion() -> Result<ConstantVelocity<2>> {
    ConstantVelocity::<2>::new(ACCELERATION)
}

/// What methods know of the first state.
///
/// # Errors
/// None: the settings are a law.
pub fn prior() -> Result<Gaussian<4>> {
    Gaussian::independent(FIRST_STATE, [FIRST_DEVIATION; 4])
}

/// Draws a recording of `scans` scans with `rate` points of the target and `clutter` others in each, on average. A
/// longer one begins with the shorter; clutter leaves the points of the target as they are.
///
/// # Errors
/// None with the settings as they are.
pub fn record(scans: usize, rate: usize, clutter: usize, stream: Stream) -> Result<Record> {
    let shape = truth()?;
    let roots = shape
        .ellipses()
        .iter()
        .map(|e| Ok(*Cholesky::of("extent", &e.extent)?.factor()))
        .collect::<Result<Vec<_>>>()?;
    let times: Vec<Time> = (0..=scans).map(|k| Time::from_secs(k as f64)).collect();
    let path = simulate::path(&motion()?, FIRST_STATE, &times, stream)?.split_off(1);
    let mut record =
        Record { times: times[1..].to_vec(), scans: Vec::new(), path: path.clone(), origins: Vec::new() };
    for (step, x) in (0..).zip(&path) {
        let mut draws = stream.draws(Purpose::Measurement, step, 0);
        let count = poisson(&mut draws, rate as f64);
        let (mut points, mut origins) = (Vec::new(), Vec::new());
        for _ in 0..count {
            // Weights are equal.
            let at = (draws.uniform() * roots.len() as f64) as usize;
            let (offset, n) = (shape.ellipses()[at].offset, [draws.normal(), draws.normal()]);
            let d = roots[at] * n;
            points.push([x[0] + offset[0] + d[0], x[1] + offset[1] + d[1]]);
            origins.push(at);
        }
        let mut draws = stream.draws(Purpose::Other, step, 0);
        for _ in 0..poisson(&mut draws, clutter as f64) {
            points.push([0, 1].map(|k| x[k] + CLUTTER_SIDE * (draws.uniform() - 0.5)));
        }
        record.scans.push(points);
        record.origins.push(origins);
    }
    Ok(record)
}

/// A Poisson number: how many uniform numbers can be multiplied before the product falls to e^-mean (Knuth).
fn poisson(draws: &mut Draws, mean: f64) -> usize {
    let end = exp(-mean);
    let (mut count, mut product) = (0, draws.uniform());
    while product > end {
        count += 1;
        product *= draws.uniform();
    }
    count
}

/// What the shape is learnt from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Start {
    /// Three circles where the ellipses are, about.
    Near,
    /// The first scans alone.
    Data,
    /// The true shape.
    Truth,
}

impl Start {
    /// In the order of the tables.
    pub const ALL: [Start; 3] = [Start::Near, Start::Data, Start::Truth];

    /// Name in rows.
    pub fn name(self) -> &'static str {
        match self {
            Start::Near => "near",
            Start::Data => "data",
            Start::Truth => "truth",
        }
    }
}

/// What a method knows of clutter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ClutterModel {
    /// There is none.
    None,
    /// How many points of it a scan has, on average, and the area that they fall into.
    Known,
    /// The area alone.
    Learnt,
    /// Nothing: its points are taken for the target's.
    Ignored,
}

impl ClutterModel {
    /// Name in rows.
    pub fn name(self) -> &'static str {
        match self {
            ClutterModel::None => "none",
            ClutterModel::Known => "known",
            ClutterModel::Learnt => "learnt",
            ClutterModel::Ignored => "ignored",
        }
    }
}

/// The start `near`.
///
/// # Errors
/// None: the settings are a shape.
pub fn near() -> Result<Shape> {
    equal_shape(&NEAR)
}

/// The first shape of a task, whose own is the start `near`.
///
/// # Errors
/// What the filter behind the start `data` refuses.
pub fn first_shape(start: Start, task: &Task<'_>) -> Result<Shape> {
    match start {
        Start::Near => near(),
        Start::Truth => truth(),
        Start::Data => from_data(task),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means and covariances of 2 000 scans of nine points, against the truth: the count has variance 9, so that its
    /// mean errs by 3 / sqrt(2000) = .067; an element X_ij of an extent from n = 6000 points by
    /// sqrt((X_ii X_jj + X_ij^2) / n). 4.5 standard errors each.
    #[test]
    fn recordings_follow_the_truth() {
        let found = record(2000, 9, 2, Stream::new(3)).unwrap();
        let of_target: usize = found.origins.iter().map(Vec::len).sum();
        let all: usize = found.scans.iter().map(Vec::len).sum();
        assert!((of_target as f64 / 2000.0 - 9.0).abs() < 4.5 * 0.067);
        assert!(((all - of_target) as f64 / 2000.0 - 2.0).abs() < 4.5 * (2.0_f64 / 2000.0).sqrt());
        for (at, (offset, [xx, xy, yy])) in TRUTH.iter().enumerate() {
            let mut sums = zerre::extended::Sums::default();
            for ((x, points), origins) in found.path.iter().zip(&found.scans).zip(&found.origins) {
                for (y, _) in points.iter().zip(origins).filter(|(_, origin)| **origin == at) {
                    let d = [y[0] - x[0] - offset[0], y[1] - x[1] - offset[1]];
                    sums.add(1.0, d, &Matrix::ZERO);
                }
            }
            let n = sums.count;
            let near = |found: f64, expected: f64, variance: f64| {
                assert!((found - expected).abs() < 4.5 * (variance / n).sqrt(), "{at}: {found} {expected}");
            };
            near(sums.first[0] / n, 0.0, *xx);
            near(sums.first[1] / n, 0.0, *yy);
            near(sums.second[0] / n, *xx, 2.0 * xx * xx);
            near(sums.second[1] / n, *xy, xx * yy + xy * xy);
            near(sums.second[2] / n, *yy, 2.0 * yy * yy);
        }
    }

    #[test]
    fn longer_recordings_begin_with_the_shorter() {
        let stream = Stream::new(1);
        let (short, long) = (record(10, 9, 0, stream).unwrap(), record(50, 9, 0, stream).unwrap());
        assert_eq!((&short.scans[..], &short.path[..]), (&long.scans[..10], &long.path[..10]));
        let cluttered = record(10, 9, 3, stream).unwrap();
        for ((all, own), origins) in cluttered.scans.iter().zip(&short.scans).zip(&short.origins) {
            assert_eq!(&all[..origins.len()], &own[..]);
        }
        assert_ne!(record(10, 9, 0, Stream::new(2)).unwrap().scans, short.scans);
    }
}
