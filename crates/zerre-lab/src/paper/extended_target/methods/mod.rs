//! The methods that are compared: one entry of [`METHODS`] each.

mod learnt;
mod single;

use super::scenario::{ClutterModel, Record, Start};
use super::settings::FLOOR;
use crate::metric::Region;
use serde::{Deserialize, Serialize};
use zerre::extended::online::Reading;
use zerre::extended::random_matrix::Rule;
use zerre::extended::{MStep, Shape, Sums};
use zerre::filter::Filter;
use zerre::math::Matrix;
use zerre::rng::Stream;
use zerre::{Result, Time};

pub(super) use learnt::from_data;

/// What a method is given.
#[derive(Clone, Debug)]
pub struct Task<'a> {
    /// Times and points of the scans. Its truth is for yardsticks alone.
    pub record: &'a Record,
    /// The first shape.
    pub start: Shape,
    /// Mean number of points of the target in a scan.
    pub rate: f64,
    /// Mean number of points of clutter in a scan, for those who may know it.
    pub clutter: f64,
    /// What the method knows of clutter.
    pub clutter_model: ClutterModel,
    /// Particles, for methods that have them.
    pub particles: usize,
    /// Random numbers of the method's own.
    pub stream: Stream,
}

/// What a method says after a scan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Centre of the target, m.
    pub centre: [f64; 2],
    /// Its body about the centre.
    pub body: Body,
    /// Points of clutter in a scan, where the method learns how many there are.
    pub clutter: Option<f64>,
}

/// Body of a target about its centre.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Body {
    /// Ellipses, or one.
    Ellipses(Shape),
    /// Corners of a closed line, m.
    Outline(Vec<[f64; 2]>),
}

impl Estimate {
    /// Ellipses about a place.
    fn ellipses(centre: [f64; 2], shape: Shape) -> Estimate {
        Estimate { centre, body: Body::Ellipses(shape), clutter: None }
    }

    /// Middle of the body: the mean of a point of ellipses, the centre of area within an outline.
    pub fn centroid(&self) -> [f64; 2] {
        let [x, y] = match &self.body {
            Body::Ellipses(shape) => shape.centroid(),
            Body::Outline(corners) => middle(corners),
        };
        [self.centre[0] + x, self.centre[1] + y]
    }

    /// What the body covers when ellipses are drawn at `sds` standard deviations, about a place that is taken off.
    pub fn region(&self, sds: f64, about: [f64; 2]) -> Region {
        let at = [self.centre[0] - about[0], self.centre[1] - about[1]];
        match &self.body {
            Body::Ellipses(shape) => Region::of_shape(shape, at, sds),
            Body::Outline(corners) => {
                Region::polygon(corners.iter().map(|p| [at[0] + p[0], at[1] + p[1]]).collect())
            }
        }
    }
}

/// Centre of area of a polygon; of one without area the mean corner.
fn middle(corners: &[[f64; 2]]) -> [f64; 2] {
    let next = corners.iter().cycle().skip(1);
    let [area, x, y] = corners.iter().zip(next).fold([0.0; 3], |[area, x, y], (p, q)| {
        let cross = p[0] * q[1] - q[0] * p[1];
        [area + cross, x + cross * (p[0] + q[0]), y + cross * (p[1] + q[1])]
    });
    if area.abs() > 1e-12 {
        return [x / (3.0 * area), y / (3.0 * area)];
    }
    let n = corners.len().max(1) as f64;
    corners.iter().fold([0.0; 2], |[x, y], p| [x + p[0] / n, y + p[1] / n])
}

/// One method.
#[derive(Clone, Copy, Debug)]
pub struct Method {
    /// Name in rows.
    pub name: &'static str,
    /// What it does, in one line.
    pub about: &'static str,
    /// What it can be told of clutter, where there is some.
    pub clutter: &'static [ClutterModel],
    /// The starts that it distinguishes.
    pub starts: &'static [Start],
    /// The longest recording that it is given, in scans: longer ones would take all of the time.
    pub longest: usize,
    /// About how many microseconds a scan takes it.
    pub cost: u64,
    /// Estimates after each scan of a task.
    pub run: fn(&Task<'_>) -> Result<Vec<Estimate>>,
}

/// What most methods have in common.
const USUAL: Method = Method {
    name: "",
    about: "",
    clutter: &[ClutterModel::Ignored],
    starts: &Start::ALL,
    longest: usize::MAX,
    cost: 2,
    run: |_| Ok(Vec::new()),
};

/// All methods, in the order of rows.
pub const METHODS: &[Method] = &[
    Method {
        name: "paper",
        about: "the algorithm as it is printed: online expectation maximisation in a particle filter, the ellipse of each \
                point drawn before the points are looked at",
        cost: 500,
        run: |task| learnt::online(task, Reading::Sampled, false),
        ..USUAL
    },
    Method {
        name: "paper-sequential",
        about: "the same, one point at a time with resampling after each",
        cost: 1500,
        run: |task| learnt::online(task, Reading::Sequential, false),
        ..USUAL
    },
    Method {
        name: "rb-online-em",
        about: "the same with the ellipses of the points summed over (Rao-Blackwell), the centre kept at the mean of a \
                point",
        cost: 115,
        run: |task| learnt::online(task, Reading::Marginal, true),
        ..USUAL
    },
    Method {
        name: "window-vb",
        about: "variational expectation maximisation over a window of scans",
        clutter: &[ClutterModel::Known, ClutterModel::Learnt, ClutterModel::Ignored],
        cost: 60,
        run: learnt::window_vb,
        ..USUAL
    },
    Method {
        name: "batch-vb",
        about: "variational expectation maximisation over all scans at once: what it says of a scan is smoothed, by later \
                scans too",
        clutter: &[ClutterModel::Known, ClutterModel::Ignored],
        cost: 110,
        run: learnt::batch_vb,
        ..USUAL
    },
    Method {
        name: "batch-pf",
        about: "expectation maximisation over all scans at once by a particle smoother: each turn filters and smooths all \
                scans anew",
        longest: super::settings::SCANS[0],
        cost: 15_000,
        run: learnt::batch_pf,
        ..USUAL
    },
    Method {
        name: "random-matrix-koch",
        about: "one ellipse as a random matrix, to which errors of the centre are in proportion (Koch 2008)",
        starts: &[Start::Near],
        run: |task| single::random_matrix(task, single::KOCH),
        ..USUAL
    },
    Method {
        name: "random-matrix-feldmann",
        about: "one ellipse as a random matrix, apart from the centre (Feldmann, Fränken and Koch 2011)",
        starts: &[Start::Near],
        run: |task| single::random_matrix(task, Rule::Feldmann { noise: Matrix::ZERO }),
        ..USUAL
    },
    Method {
        name: "ggiw",
        about: "the same with a gamma law of the number of points (Granström and Orguner 2012), which without clutter and \
                with one target changes neither centre nor ellipse: its numbers are those of the line above",
        starts: &[Start::Near],
        run: |task| single::random_matrix(task, Rule::Feldmann { noise: Matrix::ZERO }),
        ..USUAL
    },
    Method {
        name: "mem-ekf",
        about: "one ellipse by orientation and semi-axes, through multiplicative noise (Yang and Baum 2019)",
        starts: &[Start::Near],
        cost: 20,
        run: single::mem_ekf,
        ..USUAL
    },
    Method {
        name: "star-convex",
        about: "an outline whose radius is a Gaussian process of the angle (Wahlström and Özkan 2015), made for points on \
                it: those from the inside say less of the centre than it takes them to say",
        starts: &[Start::Near],
        cost: 400,
        run: single::star_convex,
        ..USUAL
    },
    Method {
        name: "oracle",
        about: "yardstick: the most likely shape where the path and the ellipse of every point, or that it is clutter, are \
                known",
        clutter: &[ClutterModel::Known],
        starts: &[Start::Truth],
        run: oracle,
        ..USUAL
    },
];

/// Runs a filter through the scans; `read` reads off its belief.
fn filtered<F: Filter<Measurement = Vec<[f64; 2]>>>(
    task: &Task<'_>,
    filter: &F,
    read: impl Fn(&F::Belief) -> Result<Estimate>,
) -> Result<Vec<Estimate>> {
    let mut belief = filter.start(Time::ZERO, task.stream)?;
    let mut estimates = Vec::with_capacity(task.record.scans.len());
    for (time, scan) in task.record.times.iter().zip(&task.record.scans) {
        filter.step(&mut belief, *time, Some(scan))?;
        estimates.push(read(&belief)?);
    }
    Ok(estimates)
}

fn oracle(task: &Task<'_>) -> Result<Vec<Estimate>> {
    let mut sums = vec![Sums::default(); task.start.len()];
    let m_step = MStep { prior: 0.0, floor: FLOOR, weights: false };
    let record = task.record;
    let each = record.path.iter().zip(&record.scans).zip(&record.origins);
    let mut estimates = Vec::with_capacity(record.path.len());
    for ((&[x, y, ..], points), origins) in each {
        for (p, origin) in points.iter().zip(origins) {
            if let Some(sums) = sums.get_mut(*origin) {
                sums.add(1.0, [p[0] - x, p[1] - y], &Matrix::ZERO);
            }
        }
        let shape = m_step.shape(&sums, &task.start, &Matrix::ZERO)?;
        estimates.push(Estimate::ellipses([x, y], shape));
    }
    Ok(estimates)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outlines_have_their_middle_in_the_centre_of_area() {
        // A square with a triangle of the same width and a height of three on top: (4 * 1 + 3 * 3) / 7.
        let house = vec![[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 5.0], [0.0, 2.0]];
        let estimate = Estimate { centre: [10.0, 0.0], body: Body::Outline(house), clutter: None };
        let [x, y] = estimate.centroid();
        assert!((x - 11.0).abs() < 1e-12 && (y - 13.0 / 7.0).abs() < 1e-12, "{x} {y}");
        assert_eq!(middle(&[[1.0, 0.0], [3.0, 0.0]]), [2.0, 0.0]);
        assert_eq!(middle(&[]), [0.0, 0.0]);
    }

    #[test]
    fn names_are_unique() {
        for method in METHODS {
            assert_eq!(METHODS.iter().filter(|other| other.name == method.name).count(), 1);
            assert!(!method.starts.is_empty() && !method.about.is_empty());
        }
    }
}
