//! The methods that are compared: one entry of [`METHODS`] each.

use super::scenario::{Record, Start, motion, prior};
use super::settings::{CLUTTER_SIDE, FLOOR, PRIOR_POINTS, SWEEPS, WINDOW};
use crate::metric::Region;
use serde::{Deserialize, Serialize};
use zerre::extended::centre::FirstTwo;
use zerre::extended::rate::Rate;
use zerre::extended::window::{Clutter, WindowSettings, WindowVb};
use zerre::extended::{MStep, Shape, Sums};
use zerre::filter::Filter;
use zerre::math::Matrix;
use zerre::rng::Stream;
use zerre::{Result, Time};

/// What a method is given.
#[derive(Clone, Debug)]
pub struct Task<'a> {
    /// Times and points of the scans. Its truth is for yardsticks alone.
    pub record: &'a Record,
    /// The first shape.
    pub start: Shape,
    /// Mean number of points of the target in a scan.
    pub rate: f64,
    /// Mean number of points of clutter in a scan, as far as the method is told of them.
    pub clutter: f64,
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
    /// Whether it can be told of clutter.
    pub models_clutter: bool,
    /// The starts that it distinguishes.
    pub starts: &'static [Start],
    /// Estimates after each scan of a task.
    pub run: fn(&Task<'_>) -> Result<Vec<Estimate>>,
}

/// All methods, in the order of rows.
pub const METHODS: &[Method] = &[
    Method {
        name: "window-vb",
        about: "variational expectation maximisation over a window of scans",
        models_clutter: true,
        starts: &Start::ALL,
        run: window_vb,
    },
    Method {
        name: "oracle",
        about: "yardstick: the most likely shape where the path and the ellipse of every point are known",
        models_clutter: true,
        starts: &[Start::Truth],
        run: oracle,
    },
];

/// Runs a filter through the scans; `read` reads off its belief.
fn filtered<F: Filter<Measurement = Vec<[f64; 2]>>>(
    task: &Task<'_>,
    filter: &F,
    read: impl Fn(&F::Belief) -> Estimate,
) -> Result<Vec<Estimate>> {
    let mut belief = filter.start(Time::ZERO, task.stream)?;
    let mut estimates = Vec::with_capacity(task.record.scans.len());
    for (time, scan) in task.record.times.iter().zip(&task.record.scans) {
        filter.step(&mut belief, *time, Some(scan))?;
        estimates.push(read(&belief));
    }
    Ok(estimates)
}

type Window = WindowVb<zerre::model::motion::ConstantVelocity<2>, FirstTwo, 4, 4>;

fn window(task: &Task<'_>, first: &Shape) -> Result<Window> {
    // Rates that are known are as from many scans.
    let known = |mean| Rate::new(mean, 1e6, 1.0);
    let clutter = if task.clutter > 0.0 {
        Some(Clutter { area: CLUTTER_SIDE * CLUTTER_SIDE, rate: known(task.clutter)?, learnt: false })
    } else {
        None
    };
    let settings = WindowSettings {
        window: WINDOW,
        sweeps: SWEEPS,
        m_step: MStep { prior: PRIOR_POINTS, floor: FLOOR, weights: false },
        rate: known(task.rate)?,
        clutter,
        ..WindowSettings::default()
    };
    WindowVb::new(motion()?, FirstTwo, prior()?, first.clone(), settings)
}

fn window_vb(task: &Task<'_>) -> Result<Vec<Estimate>> {
    filtered(task, &window(task, &task.start)?, |belief| {
        let [x, y, ..] = *belief.state().mean();
        Estimate { centre: [x, y], body: Body::Ellipses(belief.shape().clone()) }
    })
}

/// The window filter over the first scans from a shape: centres, the shape it comes to, and the bound on the log-density
/// of the points.
pub(super) fn window_over(
    task: &Task<'_>,
    first: &Shape,
    scans: usize,
) -> Result<(Vec<[f64; 2]>, Shape, f64)> {
    let filter = window(task, first)?;
    let mut belief = filter.start(Time::ZERO, task.stream)?;
    let (mut centres, mut evidence) = (Vec::with_capacity(scans), 0.0);
    for (time, scan) in task.record.times.iter().zip(&task.record.scans).take(scans) {
        evidence += filter.step(&mut belief, *time, Some(scan))?.log_evidence;
        let [x, y, ..] = *belief.state().mean();
        centres.push([x, y]);
    }
    Ok((centres, belief.shape().clone(), evidence))
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
        estimates.push(Estimate { centre: [x, y], body: Body::Ellipses(shape) });
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
        let estimate = Estimate { centre: [10.0, 0.0], body: Body::Outline(house) };
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
