//! Variational EM over a window.

use crate::{near, point, poisson, record, secs, truth};
use zerre::belief::Gaussian;
use zerre::extended::centre::FirstTwo;
use zerre::extended::rate::Rate;
use zerre::extended::window::{Clutter, ExtendedBelief, WindowSettings, WindowVb};
use zerre::extended::{Ellipse, MStep, Shape};
use zerre::filter::{Filter, Outcome};
use zerre::math::{Cholesky, Matrix, gaussian::log_density};
use zerre::model::motion::ConstantVelocity;
use zerre::rng::{Purpose, Stream};
use zerre::{Error, Time};

type Window = WindowVb<ConstantVelocity<2>, FirstTwo, 4, 4>;

fn window(prior: Gaussian<4>, density: f64, shape: Shape, settings: WindowSettings) -> Window {
    WindowVb::new(ConstantVelocity::new(density).unwrap(), FirstTwo, prior, shape, settings).unwrap()
}

fn usual(shape: Shape) -> Window {
    let prior = Gaussian::independent([0.0, 0.0, 10.0, 0.0], [1.0; 4]).unwrap();
    window(prior, 1.0, shape, WindowSettings::default())
}

/// A target that stands still, known to be at (3, -2).
fn standing(shape: Shape, m_step: MStep) -> Window {
    let prior = Gaussian::independent([3.0, -2.0, 0.0, 0.0], [1e-9; 4]).unwrap();
    window(prior, 0.0, shape, WindowSettings { m_step, window: 4, ..WindowSettings::default() })
}

fn follow(filter: &Window, scans: &[Vec<[f64; 2]>]) -> ExtendedBelief<4> {
    let mut belief = filter.start(Time::ZERO, Stream::new(1)).unwrap();
    for (k, scan) in scans.iter().enumerate() {
        filter.step(&mut belief, secs(k + 1), Some(scan)).unwrap();
    }
    belief
}

fn close(a: &Matrix<2, 2>, b: &Matrix<2, 2>, tolerance: f64) {
    let gap = (*a - *b).max_abs();
    assert!(gap <= tolerance * b.max_abs(), "{a:?} {b:?}");
}

/// One ellipse about a known centre: the mode under the conjugate prior, in closed form, whether its scans are still in
/// the window or have left it.
#[test]
fn one_ellipse_with_a_known_centre_is_conjugate() {
    let mut draws = Stream::new(4).draws(Purpose::Measurement, 0, 0);
    let wide = Matrix([[9.0, 2.0], [2.0, 4.0]]);
    let one = Shape::ellipse(wide).unwrap();
    let scans: Vec<Vec<[f64; 2]>> =
        (0..9).map(|k| (0..k).map(|_| point(&mut draws, &one, [3.0, -2.0])).collect()).collect();
    let first = Matrix([[2.0, 0.5], [0.5, 1.0]]);
    for points in [0.0, 3.0] {
        let m_step = MStep { prior: points, floor: 1e-6, weights: true };
        let filter = standing(Shape::ellipse(first).unwrap(), m_step);
        let belief = follow(&filter, &scans);
        let (mut n, mut mean, mut square) = (points, [0.0; 2], first * points);
        for y in scans.iter().flatten() {
            let d = [y[0] - 3.0, y[1] + 2.0];
            n += 1.0;
            mean = [mean[0] + d[0], mean[1] + d[1]];
            square = square + Matrix::outer(&d, &d);
        }
        let mean = mean.map(|x| x / n);
        let expected = square * (1.0 / n) - Matrix::outer(&mean, &mean);
        let found = belief.shape().ellipses()[0];
        // The centre is known to 1e-9, and moves by less.
        close(&found.extent, &expected, 1e-10);
        assert!((0..2).all(|k| (found.offset[k] - mean[k]).abs() < 1e-8), "{found:?} {mean:?}");
    }
}

/// ln p of one scan's points, summed over all ways to label them.
fn exact(prior: &Gaussian<4>, shape: &Shape, points: &[[f64; 2]]) -> f64 {
    let mut logs = Vec::new();
    for labels in 0..shape.len().pow(points.len() as u32) {
        let mut code = labels;
        let (mut mean, mut covariance) = (*prior.mean(), *prior.covariance());
        let mut log = 0.0;
        for y in points {
            let e = shape.ellipses()[code % shape.len()];
            code /= shape.len();
            let s = Matrix::<2, 2>::from_entries(|i, j| covariance.0[i][j]) + e.extent;
            let s = Cholesky::of("S", &s).unwrap();
            let nu = [y[0] - mean[0] - e.offset[0], y[1] - mean[1] - e.offset[1]];
            log += log_density(&nu, &s) + e.weight.ln();
            let cross = Matrix::<4, 2>::from_entries(|i, j| covariance.0[i][j]);
            let gain = s.solve_matrix(&cross.transpose()).transpose();
            let step = gain * nu;
            mean = std::array::from_fn(|i| mean[i] + step[i]);
            covariance = (covariance - gain * cross.transpose()).symmetrised();
        }
        logs.push(log);
    }
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    most + logs.iter().map(|log| (log - most).exp()).sum::<f64>().ln()
}

/// What the filter calls log-evidence is a bound: never above the exact value, and equal to it where there is nothing to
/// label.
#[test]
fn the_bound_is_below_the_exact_value() {
    let prior = Gaussian::independent([0.0, 0.0, 1.0, 0.0], [1.0, 2.0, 0.5, 0.5]).unwrap();
    let mut draws = Stream::new(7).draws(Purpose::Measurement, 0, 0);
    let two = Shape::new(vec![
        Ellipse { weight: 0.4, offset: [-2.0, 0.0], extent: Matrix([[2.0, 0.5], [0.5, 1.0]]) },
        Ellipse { weight: 0.6, offset: [2.0, 1.0], extent: Matrix([[1.0, -0.3], [-0.3, 3.0]]) },
    ])
    .unwrap();
    for shape in [Shape::ellipse(Matrix([[3.0, 1.0], [1.0, 2.0]])).unwrap(), two] {
        for _ in 0..20 {
            let at = [draws.normal(), draws.normal()];
            let points: Vec<_> = (0..5).map(|_| point(&mut draws, &shape, at)).collect();
            let settings = WindowSettings { sweeps: 60, ..WindowSettings::default() };
            let filter = window(prior, 1.0, shape.clone(), settings);
            let mut belief = filter.start(Time::ZERO, Stream::new(1)).unwrap();
            let bound = filter.step(&mut belief, Time::ZERO, Some(&points)).unwrap().log_evidence;
            let exact = exact(&prior, &shape, &points);
            // Rounding of some hundred steps of numbers up to a hundred.
            assert!(bound <= exact + 1e-9, "{bound} {exact}");
            // The likeliest of the 2^5 labellings has at least that share, and its own bound is no better than the best.
            let most = if shape.len() == 1 { 1e-9 } else { 5.0 * 2f64.ln() };
            assert!(exact - bound <= most, "{bound} {exact}");
        }
    }
}

/// Turns between shares and shape about a known centre are expectation maximisation: the likelihood never falls.
#[test]
fn turns_never_lower_the_likelihood() {
    let mut draws = Stream::new(9).draws(Purpose::Measurement, 0, 0);
    let m_step = MStep { prior: 0.0, floor: 1e-9, weights: true };
    let filter = standing(near(), m_step);
    let scans: Vec<(Time, Vec<[f64; 2]>)> = (1..6)
        .map(|k| (secs(k), (0..20).map(|_| point(&mut draws, &truth(), [3.0, -2.0])).collect()))
        .collect();
    let mut last = f64::NEG_INFINITY;
    for turns in 0..40 {
        let shape = filter.smoothed(Time::ZERO, &scans, turns).unwrap().shape;
        let of = |y: &[f64; 2]| shape.log_density(&[y[0] - 3.0, y[1] + 2.0]).unwrap();
        let likelihood: f64 = scans.iter().flat_map(|scan| &scan.1).map(of).sum();
        assert!(likelihood >= last - 1e-6, "{turns}: {last} {likelihood}");
        last = likelihood;
    }
    assert_eq!(filter.smoothed(Time::ZERO, &scans, 0).unwrap().shape, near());
}

/// With an unknown path the bound on the likelihood never falls either.
#[test]
fn turns_never_lower_the_bound() {
    let (_, scans) = record(21, 15);
    let scans: Vec<_> = scans.into_iter().enumerate().map(|(k, scan)| (secs(k + 1), scan)).collect();
    let prior = Gaussian::independent([0.0, 0.0, 10.0, 0.0], [1.0; 4]).unwrap();
    let m_step = MStep { prior: 0.0, floor: 1e-9, weights: true };
    let settings = WindowSettings { m_step, ..WindowSettings::default() };
    let filter = window(prior, 1.0, near(), settings);
    let mut last = f64::NEG_INFINITY;
    for turns in 1..40 {
        let bound = filter.smoothed(Time::ZERO, &scans, turns).unwrap().bound;
        // Some thousand roundings of numbers up to a thousand.
        assert!(bound >= last - 1e-8, "{turns}: {last} {bound}");
        last = bound;
    }
}

/// The plane has no preferred direction: turned data give the turned answer.
#[test]
fn a_turned_world_gives_a_turned_answer() {
    let (_, scans) = record(3, 12);
    let (sin, cos) = 0.7f64.sin_cos();
    let turn = Matrix([[cos, -sin], [sin, cos]]);
    let turned: Vec<Vec<[f64; 2]>> =
        scans.iter().map(|scan| scan.iter().map(|y| turn * *y).collect()).collect();
    let plain = follow(&usual(near()), &scans);
    let prior = Gaussian::independent([0.0, 0.0, 10.0 * cos, 10.0 * sin], [1.0; 4]).unwrap();
    let other = window(prior, 1.0, near().turned(0.7), WindowSettings::default());
    let other = follow(&other, &turned);
    let expected = plain.shape().turned(0.7);
    for (a, b) in other.shape().ellipses().iter().zip(expected.ellipses()) {
        // Sixty sweeps of rounding.
        close(&a.extent, &b.extent, 1e-7);
        assert!((0..2).all(|k| (a.offset[k] - b.offset[k]).abs() < 1e-6));
    }
}

/// Learning pays: the extents of 30 scans are nearer the truth than those that the filter began with. Were they not,
/// 18 of 20 runs would seem so once in five thousand times.
#[test]
fn shapes_are_learnt() {
    // Ellipses have no names: the order that fits best counts.
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let error = |shape: &Shape| {
        let norm = |m: Matrix<2, 2>| m.0.iter().flatten().map(|x| x * x).sum::<f64>().sqrt();
        let one = |e: &Ellipse, t: &Ellipse| norm(e.extent - t.extent) / norm(t.extent) / 3.0;
        let of = |order: [usize; 3]| {
            let truth = truth();
            let pairs = order.iter().zip(truth.ellipses());
            pairs.map(|(&k, t)| one(&shape.ellipses()[k], t)).sum::<f64>()
        };
        orders.map(of).into_iter().fold(f64::INFINITY, f64::min)
    };
    let first = error(&near());
    let good = (0..20).filter(|seed| {
        let (_, scans) = record(100 + seed, 30);
        error(follow(&usual(near()), &scans).shape()) < first
    });
    let good = good.count();
    assert!(good >= 18, "{good} of 20");
}

/// Uniform points are told apart, and their rate is learnt.
#[test]
fn clutter_is_told_apart() {
    let (path, mut scans) = record(11, 60);
    let mut draws = Stream::new(12).draws(Purpose::Measurement, 0, 0);
    let mut count = 0;
    for (x, scan) in path.iter().zip(&mut scans) {
        for _ in 0..poisson(&mut draws, 3.0) {
            scan.push([x[0] + 60.0 * (draws.uniform() - 0.5), x[1] + 60.0 * (draws.uniform() - 0.5)]);
            count += 1;
        }
    }
    let prior = Gaussian::independent([0.0, 0.0, 10.0, 0.0], [1.0; 4]).unwrap();
    let rate = Rate::new(1.0, 1.0, 1.0).unwrap();
    let clutter = Some(Clutter { area: 3600.0, rate, learnt: true });
    let settings = WindowSettings { clutter, ..WindowSettings::default() };
    let belief = follow(&window(prior, 1.0, near(), settings), &scans);
    let learnt = belief.clutter().unwrap().rate.mean();
    let expected = f64::from(count) / 60.0;
    // Points of 60 x 60 that fall into the shape's 30 x 20 are rightly shared; six standard deviations of the count.
    let spread = 6.0 * (3.0f64 / 60.0).sqrt();
    assert!(learnt > expected * (1.0 - 600.0 / 3600.0) - spread && learnt < expected + spread, "{learnt}");
    let widest = belief.shape().covariance().max_abs();
    assert!(widest < 2.0 * truth().covariance().max_abs(), "{widest}");
}

#[test]
fn any_scan_is_taken_or_refused_in_words() {
    let filter = usual(near());
    let fresh = || filter.start(Time::ZERO, Stream::new(1)).unwrap();
    let scans: [Vec<[f64; 2]>; 6] = [
        vec![[1e70, -1e70], [0.0, 0.0]],
        vec![],
        vec![[10.0, 1.0]],
        vec![[10.0, 1.0]; 50],
        (0..9).map(|k| [10.0 + f64::from(k), 1.0]).collect(),
        (0..10_000).map(|k| [10.0 + f64::from(k % 100) / 10.0, f64::from(k / 100) / 10.0]).collect(),
    ];
    for scan in &scans {
        let mut belief = fresh();
        for k in 1..14 {
            let update = filter.step(&mut belief, secs(k), Some(scan)).unwrap();
            assert_eq!(update.outcome, Outcome::Updated);
            assert!(update.log_evidence.is_finite());
        }
        for e in belief.shape().ellipses() {
            assert!(Cholesky::of("extent", &e.extent).is_ok(), "{e:?}");
        }
        assert!(belief.state().mean().iter().all(|x| x.is_finite()));
    }
    for bad in [f64::NAN, f64::INFINITY, 1e200] {
        let mut belief = fresh();
        let before = belief.clone();
        let refused = filter.step(&mut belief, secs(1), Some(&vec![[0.0, bad]]));
        assert!(matches!(refused, Err(Error::NotFinite { .. } | Error::OutOfRange { .. })));
        assert_eq!(belief, before);
    }
    let mut belief = fresh();
    filter.step(&mut belief, secs(2), None).unwrap();
    assert!(matches!(filter.step(&mut belief, secs(1), None), Err(Error::OutOfOrder { .. })));
    assert!(Shape::new(vec![]).is_err() && Shape::ellipse(Matrix([[1.0, 2.0], [2.0, 1.0]])).is_err());
    let settings = WindowSettings { sweeps: 0, ..WindowSettings::default() };
    let prior = Gaussian::independent([0.0; 4], [1.0; 4]).unwrap();
    let motion = ConstantVelocity::<2>::new(1.0).unwrap();
    assert!(WindowVb::<_, _, 4, 4>::new(motion, FirstTwo, prior, near(), settings).is_err());
}
