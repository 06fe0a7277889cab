//! The filters of one shape on the scene of Özkan 2019, three ellipses moving as one: what one ellipse, or one
//! outline, can make of it.

use crate::single::*;
use zerre::belief::Gaussian;
use zerre::extended::centre::FirstTwo;
use zerre::extended::contour::{Contour, ContourBelief, ContourSettings, Depth, OutlinePoint, RadiusProcess};
use zerre::extended::inverse_wishart::InverseWishart;
use zerre::extended::mem_ekf::{MemEkf, MemSettings};
use zerre::extended::random_matrix::{RandomMatrix, RandomMatrixSettings, Rule};
use zerre::extended::{Ellipse, Shape};
use zerre::filter::Filter;
use zerre::math::{Cholesky, Matrix};
use zerre::model::simulate;
use zerre::rng::{Draws, Purpose, Stream};
use zerre::{Result, Time};

fn truth() -> Shape {
    let ellipse = |y: f64, extent| Ellipse { weight: 1.0 / 3.0, offset: [0.0, y], extent: Matrix(extent) };
    Shape::new(vec![
        ellipse(0.0, [[50.0, 0.0], [0.0, 2.0]]),
        ellipse(-5.0, [[8.0, 4.5], [4.5, 5.0]]),
        ellipse(5.0, [[8.0, -4.5], [-4.5, 5.0]]),
    ])
    .unwrap()
}

fn poisson(d: &mut Draws, mean: f64) -> usize {
    let (mut count, mut product) = (0, d.uniform());
    while product > (-mean).exp() {
        (count, product) = (count + 1, product * d.uniform());
    }
    count
}

/// Path and scans, 9 points a scan on average.
fn scene(seed: u64, count: usize) -> (Vec<[f64; 4]>, Vec<Vec<[f64; 2]>>) {
    let times: Vec<Time> = (0..=count).map(at).collect();
    let stream = Stream::new(seed);
    let path = simulate::path(&motion(1.0), [0.0, 0.0, 10.0, 0.0], &times, stream.fork(0)).unwrap();
    let mut d = stream.fork(1).draws(Purpose::Measurement, 0, 0);
    let shape = truth();
    let scans = path[1..].iter().map(|x| {
        (0..poisson(&mut d, 9.0))
            .map(|_| {
                let e = &shape.ellipses()[((3.0 * d.uniform()) as usize).min(2)];
                normal(&mut d, [x[0] + e.offset[0], x[1] + e.offset[1]], &e.extent)
            })
            .collect()
    });
    let scans = scans.collect();
    (path[1..].to_vec(), scans)
}

fn median(mut x: Vec<f64>) -> f64 {
    x.sort_by(f64::total_cmp);
    0.5 * (x[x.len() / 2] + x[(x.len() - 1) / 2])
}

/// Intersection over union of the true ellipses about `x`, at two standard deviations, and of what `found` says; on
/// cells of 0.4 m.
fn overlap(x: [f64; 2], found: impl Fn([f64; 2]) -> bool) -> f64 {
    let shape = truth();
    let factor = |e: &Ellipse| (e.offset, Cholesky::of("extent", &e.extent).unwrap());
    let ellipses: Vec<_> = shape.ellipses().iter().map(factor).collect();
    let (mut both, mut either) = (0u32, 0u32);
    for i in -50..50 {
        for j in -50..50 {
            let d = [0.4 * (f64::from(i) + 0.5), 0.4 * (f64::from(j) + 0.5)];
            let inside = |(o, extent): &([f64; 2], Cholesky<2>)| {
                extent.mahalanobis_squared(&[d[0] - o[0], d[1] - o[1]]) <= 4.0
            };
            let (a, b) = (ellipses.iter().any(inside), found([x[0] + d[0], x[1] + d[1]]));
            both += u32::from(a && b);
            either += u32::from(a || b);
        }
    }
    f64::from(both) / f64::from(either)
}

/// Medians over 30 seeds of the last intersection over union and of the root mean square error of the centre.
fn measure<F>(
    filter: &F,
    count: usize,
    centre: impl Fn(&F::Belief) -> [f64; 2],
    holds: impl Fn(&F::Belief, [f64; 2]) -> bool,
) -> (f64, f64)
where
    F: Filter<Measurement = Vec<[f64; 2]>>,
{
    let (mut overlaps, mut errors) = (vec![], vec![]);
    for seed in 1000..1030 {
        let (path, scans) = scene(seed, count);
        let mut belief = filter.start(Time::ZERO, Stream::new(1)).unwrap();
        let mut square = 0.0;
        for (k, (scan, x)) in scans.iter().zip(&path).enumerate() {
            filter.step(&mut belief, at(k + 1), Some(scan)).unwrap();
            let found = centre(&belief);
            square += (found[0] - x[0]).powi(2) + (found[1] - x[1]).powi(2);
        }
        errors.push((square / count as f64).sqrt());
        overlaps.push(overlap([path[count - 1][0], path[count - 1][1]], |y| holds(&belief, y)));
    }
    (median(overlaps), median(errors))
}

fn position(state: &Gaussian<4>) -> [f64; 2] {
    [state.mean()[0], state.mean()[1]]
}

fn in_ellipse(shape: Result<Shape>, state: &Gaussian<4>, y: [f64; 2]) -> bool {
    let (extent, m) = (shape.unwrap().ellipses()[0].extent, position(state));
    Cholesky::of("extent", &extent).unwrap().mahalanobis_squared(&[y[0] - m[0], y[1] - m[1]]) <= 4.0
}

/// Centroid of the area of an outline.
fn centroid(outline: &[OutlinePoint]) -> [f64; 2] {
    let origin = outline[0].at;
    let (mut area, mut sum) = (0.0, [0.0; 2]);
    for (p, q) in outline.iter().zip(outline.iter().cycle().skip(1)) {
        let [p, q] = [p, q].map(|p| [p.at[0] - origin[0], p.at[1] - origin[1]]);
        let cross = p[0] * q[1] - p[1] * q[0];
        area += 3.0 * cross;
        sum = [0, 1].map(|k| sum[k] + cross * (p[k] + q[k]));
    }
    [0, 1].map(|k| origin[k] + sum[k] / area)
}

fn prior() -> Gaussian<4> {
    Gaussian::independent([0.0, 0.0, 10.0, 0.0], [0.01; 4]).unwrap()
}

/// The published medians (IoU .55 to .58, centre 1.7 to 1.8 m) came from 30 other draws. One run's IoU has a spread of
/// .04, so the median of 30 one of .01, and the difference of two .014; the centre's error .5, .11 and .16. Three of
/// them, and the last printed digit, are allowed.
#[test]
fn one_ellipse_on_three() {
    let motion = || motion(1.0);
    let extent = InverseWishart::new(Matrix::identity() * 20.0, 8.0).unwrap();
    let mut found = vec![];
    for rule in [Rule::Koch { unit: 20.0 }, Rule::Feldmann { noise: Matrix::ZERO }] {
        let settings = RandomMatrixSettings { rule, ..RandomMatrixSettings::default() };
        let f = RandomMatrix::new(motion(), FirstTwo, prior(), extent, settings).unwrap();
        let of = |n| measure(&f, n, |b| position(&b.state), |b, y| in_ellipse(b.shape(), &b.state, y));
        found.push((format!("{rule:?}"), [of(10), of(50)]));
    }
    let axes = Gaussian::independent([0.0, 20f64.sqrt(), 20f64.sqrt()], [0.5, 2.0, 2.0]).unwrap();
    let settings = MemSettings { multiplicative: 1.0, ..MemSettings::default() };
    let f = MemEkf::new(motion(), FirstTwo, prior(), axes, settings).unwrap();
    let of = |n| measure(&f, n, |b| position(&b.state), |b, y| in_ellipse(b.shape(), &b.state, y));
    found.push(("MEM-EKF*".into(), [of(10), of(50)]));
    for (name, medians) in found {
        println!("{name}: {medians:.3?}");
        for ((overlap, error), (iou, centre)) in medians.into_iter().zip([(0.555, 1.70), (0.58, 1.80)]) {
            assert!((overlap - iou).abs() < 0.05, "{name}: {overlap} {iou}");
            assert!((error - centre).abs() < 0.5, "{name}: {error} {centre}");
        }
    }
}

/// An outline is no worse than an ellipse by area. Its position (the centroid, since the centre is not seen) falls
/// short of theirs: the mean of a scan alone has an error of sqrt(tr C / 9) = 2.2 m, C being the covariance of a point,
/// and twice that is allowed.
#[test]
fn one_outline_on_three() {
    let process = RadiusProcess { radius: 80f64.sqrt(), common: 3.0, deviation: 3.0, length: 0.6 };
    let settings =
        ContourSettings { process, forgetting: 0.0, noise: Matrix::identity() * 0.25, depth: Depth::NORMAL };
    let f: Contour<_, _, 4, 4> = Contour::new(motion(1.0), FirstTwo, prior(), settings).unwrap();
    for count in [10, 50] {
        let centre = |b: &ContourBelief<4>| centroid(&f.outline(b, 36).unwrap());
        let (overlap, error) = measure(&f, count, centre, |b, y| f.holds(b, y));
        println!("{count}: {overlap:.3} {error:.3}");
        assert!(overlap > 0.5 && error < 4.4, "{overlap} {error}");
    }
}
