//! The star-convex outline.

use crate::single::*;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};
use zerre::Time;
use zerre::belief::Gaussian;
use zerre::extended::centre::FirstTwo;
use zerre::extended::contour::{Contour, ContourSettings, Depth, RadiusProcess};
use zerre::filter::Filter;
use zerre::math::{Cholesky, Matrix};
use zerre::rng::{Draws, Stream};

type Outline = Contour<Motion, FirstTwo, 4, 4>;

const SETTINGS: ContourSettings = ContourSettings {
    process: RadiusProcess { radius: 2.0, common: 0.5, deviation: 0.8, length: FRAC_PI_4 },
    forgetting: 0.0,
    noise: Matrix([[0.01, 0.0], [0.0, 0.01]]),
    depth: Depth::EDGE,
};

fn filter(sd: f64, settings: ContourSettings) -> Outline {
    let prior = Gaussian::independent([0.0, 0.0, 1.0, -2.0], [sd, sd, 0.3 * sd, 0.3 * sd]).unwrap();
    Contour::new(motion(0.01 * sd), FirstTwo, prior, settings).unwrap()
}

/// Radius of the ellipse with semi-axes 3 and 2 along the axes.
fn ellipse(u: f64) -> f64 {
    1.0 / ((u.cos() / 3.0).powi(2) + (u.sin() / 2.0).powi(2)).sqrt()
}

/// Radius of a box of 5 by 3.
fn rectangle(u: f64) -> f64 {
    (2.5 / u.cos().abs()).min(1.5 / u.sin().abs())
}

/// Points at even angles, at a share of the radius, seen with noise, on the path that the motion starts with.
fn scans(
    d: &mut Draws,
    radius: fn(f64) -> f64,
    surface: bool,
    scans: usize,
    count: usize,
) -> Vec<Vec<[f64; 2]>> {
    let scan = |k: usize, d: &mut Draws| {
        let t = (k + 1) as f64;
        let point = |d: &mut Draws| {
            let u = TAU * d.uniform();
            let r = radius(u) * if surface { d.uniform().sqrt() } else { 1.0 };
            normal(d, [t + r * u.cos(), r * u.sin() - 2.0 * t], &SETTINGS.noise)
        };
        (0..count).map(|_| point(d)).collect()
    };
    (0..scans).map(|k| scan(k, d)).collect()
}

/// With the centre known the radii are a Gaussian regression: precision K^-1 + sum h h' / s, s = noise plus what the
/// interpolation leaves. The normal equations lose the condition of K (the nugget's 1e9 at worst) of 1e-16.
#[test]
fn known_centre_is_a_regression() {
    let data = scans(&mut draws(1), ellipse, false, 4, 10);
    let f = filter(0.0, SETTINGS);
    let (belief, evidence) = run(&f, &data);
    let kernel =
        |a: f64, b: f64| 0.25 + 0.64 * (-2.0 * (0.5 * (a - b)).sin().powi(2) / FRAC_PI_4.powi(2)).exp();
    let angle = |i: usize| TAU * i as f64 / 20.0;
    let nugget = |i, j| if i == j { 0.64e-9 } else { 0.0 };
    let covariance = Matrix::<20, 20>::from_entries(|i, j| kernel(angle(i), angle(j)) + nugget(i, j));
    let factor = Cholesky::of("K", &covariance).unwrap();
    let (mut precision, mut vector, mut by_hand) = (factor.inverse(), [0.0; 20], 0.0);
    for (k, scan) in data.iter().enumerate() {
        let t = (k + 1) as f64;
        for y in scan {
            let d = [y[0] - t, y[1] + 2.0 * t];
            let u = d[1].atan2(d[0]);
            let cross: [f64; 20] = std::array::from_fn(|i| kernel(u, angle(i)));
            let h = factor.solve(&cross);
            let s = 0.01 + 0.89 - h.iter().zip(cross).map(|(a, b)| a * b).sum::<f64>();
            let law = Cholesky::of("precision", &precision).unwrap();
            let so_far = law.solve(&vector);
            let e = d[0].hypot(d[1]) - 2.0 - h.iter().zip(so_far).map(|(a, b)| a * b).sum::<f64>();
            let variance = s + law.inverse().quadratic(&h, &h);
            // Along the radius; across it the tangent has no error, only the sensor's variance.
            by_hand -= 0.5 * (e * e / variance + variance.ln() + 0.01f64.ln()) + TAU.ln();
            precision = precision + Matrix::outer(&h, &h) * (1.0 / s);
            let z = (d[0].hypot(d[1]) - 2.0) / s;
            vector = std::array::from_fn(|i| vector[i] + h[i] * z);
        }
    }
    let law = Cholesky::of("precision", &precision).unwrap();
    assert!(apart(belief.radii.covariance(), &law.inverse()) < 1e-6);
    for (a, b) in belief.radii.mean().iter().zip(law.solve(&vector)) {
        close(*a, 2.0 + b, 1e-6);
    }
    close(evidence, by_hand, 1e-6);
}

/// Over 20 seeds, the root mean square error of the outline about the true centre, the mean of its square in units of
/// the outline's variance, and the mean intersection over union (on cells of 0.1 m).
fn errors(radius: fn(f64) -> f64, depth: Depth, sd: f64) -> (f64, f64, f64) {
    let f = filter(sd, ContourSettings { depth, ..SETTINGS });
    let (mut square, mut score, mut n) = (0.0, 0.0, 0.0);
    let (mut both, mut either) = (0u32, 0u32);
    for seed in 0..20 {
        let data = scans(&mut draws(300 + seed), radius, depth != Depth::EDGE, 40, 20);
        let (b, _) = run(&f, &data);
        let beyond = |d: [f64; 2]| d[0].hypot(d[1]) - radius(d[1].atan2(d[0]));
        for point in f.outline(&b, 36).unwrap() {
            let e = beyond([point.at[0] - 40.0, point.at[1] + 80.0]);
            square += e * e;
            score += e * e / (point.deviation * point.deviation);
            n += 1.0;
        }
        for i in -40..40 {
            for j in -30..30 {
                let d = [0.1 * (f64::from(i) + 0.5), 0.1 * (f64::from(j) + 0.5)];
                let (a, b) = (beyond(d) <= 0.0, f.holds(&b, [d[0] + 40.0, d[1] - 80.0]));
                both += u32::from(a && b);
                either += u32::from(a || b);
            }
        }
    }
    (f64::sqrt(square / n), score / n, f64::from(both) / f64::from(either))
}

/// 800 points are 40 to each of 20 angles: of an error s along the radius there is s / sqrt(40) left, less by what
/// angles tell of each other; 1.5 of it is allowed, and twice as much where the centre has to be found too. On the
/// edge s is the noise of .1; inside it is the deviation of the share, sqrt(1/18) / (2/3), of a radius of at most 3.
/// With a known centre the errors of a smooth outline have the variance that the belief says: its mean square over 20
/// times about 10 independent angles is within 1 +- 4 sqrt(2 / 200).
#[test]
fn finds_a_smooth_outline() {
    for (depth, s) in [(Depth::EDGE, 0.1), (Depth::SURFACE, 3.0 * f64::sqrt(0.125))] {
        let (known, score, _) = errors(ellipse, depth, 0.0);
        let (found, _, overlap) = errors(ellipse, depth, 0.3);
        let allowed = 1.5 * s / f64::sqrt(40.0);
        assert!(known < allowed && found < 2.0 * allowed, "{depth:?}: {known} {found}");
        assert!((score - 1.0).abs() < 0.4, "{depth:?}: {score}");
        // An outline that is e off all around changes the area by e times the perimeter of 16 over the area of 19.
        assert!(overlap > 1.0 - 2.0 * allowed * 16.0 / 19.0, "{depth:?}: {overlap}");
    }
}

/// Corners are rounded by as much as the length scale says: a quarter of the height and width of a corner's triangle
/// of .6 rad or 1.5 m a side, four of them, are .9 m^2 of 15 or 6 %; noise as above.
#[test]
fn finds_a_box_but_for_its_corners() {
    for (depth, s) in [(Depth::EDGE, 0.1), (Depth::SURFACE, 3.0 * f64::sqrt(0.125))] {
        for sd in [0.0, 0.3] {
            let (_, _, overlap) = errors(rectangle, depth, sd);
            assert!(overlap > 1.0 - 0.06 - 1.5 * s / f64::sqrt(40.0) * 16.0 / 15.0, "{depth:?}: {overlap}");
        }
    }
}

/// An outline that is known finds its centre, .05 off along each axis, in one scan: by the tangent up to the square of
/// that over the least radius of curvature (b^2 / a = 1.33), .004, and the noise of .1 over 5000 points on two axes,
/// four times .1 sqrt(2 / 5000) = .008.
#[test]
fn a_known_outline_finds_its_centre() {
    let f = filter(0.0, SETTINGS);
    let (learnt, _) = run(&f, &scans(&mut draws(6), ellipse, false, 1, 10_000));
    let mut belief = f.start(Time::ZERO, Stream::new(1)).unwrap();
    belief.radii = learnt.radii;
    belief.state = Gaussian::independent([0.05, -0.05, 1.0, -2.0], [0.3, 0.3, 0.0, 0.0]).unwrap();
    f.step(&mut belief, at(1), Some(&scans(&mut draws(7), ellipse, false, 1, 5000)[0])).unwrap();
    let x = belief.state.mean();
    let e = (x[0] - 1.0).hypot(x[1] + 2.0);
    assert!(e < 0.012, "{e}");
}

/// A quarter turn moves the angles onto each other: rounding alone.
#[test]
fn a_quarter_turn_of_the_plane_turns_the_answer() {
    let data = scans(&mut draws(2), ellipse, true, 6, 12);
    let with = |angle: f64| {
        let prior = Gaussian::independent([0.0, 0.0, 1.0, -2.0], [0.3, 0.3, 0.1, 0.1]).unwrap();
        let settings = ContourSettings { depth: Depth::SURFACE, forgetting: 0.05, ..SETTINGS };
        let filter: Outline = Contour::new(motion(0.1), FirstTwo, turned(&prior, angle), settings).unwrap();
        filter
    };
    let (f, g) = (with(0.0), with(FRAC_PI_2));
    let (a, evidence) = run(&f, &data);
    let (b, same) = run(&g, &turned_scans(&data, FRAC_PI_2));
    close(same, evidence, 1e-7);
    for i in 0..20 {
        close(b.radii.mean()[(i + 5) % 20], a.radii.mean()[i], 1e-7);
    }
    for (x, y) in f.outline(&a, 8).unwrap().iter().zip(g.outline(&b, 8).unwrap().iter().cycle().skip(2)) {
        let at = turn(FRAC_PI_2) * x.at;
        close(at[0], y.at[0], 1e-7);
        close(at[1], y.at[1], 1e-7);
        close(x.deviation, y.deviation, 1e-7);
    }
}

/// All tangents are those at the prediction, so the order of the points is rounding.
#[test]
fn order_of_points_does_not_matter() {
    let mut data = scans(&mut draws(3), ellipse, false, 3, 15);
    let f = filter(0.3, SETTINGS);
    let (a, evidence) = run(&f, &data);
    data.iter_mut().for_each(|scan| scan.reverse());
    let (b, same) = run(&f, &data);
    close(same, evidence, 1e-7);
    for (x, y) in a.radii.mean().iter().zip(b.radii.mean()) {
        close(*x, *y, 1e-7);
    }
}

/// Without points the radii go back to where they came from: e^-2 of the deviation is left after 20 s at 0.1 / s, and
/// the law is that of the start after 1000 s (e^-100).
#[test]
fn forgets() {
    let f = filter(0.3, ContourSettings { forgetting: 0.1, ..SETTINGS });
    let (a, _) = run(&f, &scans(&mut draws(4), ellipse, false, 5, 20));
    let mut b = a;
    f.step(&mut b, at(25), None).unwrap();
    let keep = (-2.0f64).exp();
    for (x, y) in a.radii.mean().iter().zip(b.radii.mean()) {
        close(2.0 + keep * (x - 2.0), *y, 1e-12);
    }
    f.step(&mut b, at(1025), None).unwrap();
    let first = f.start(Time::ZERO, Stream::new(1)).unwrap();
    assert!(apart(b.radii.covariance(), first.radii.covariance()) < 1e-12);
    assert!(b.cross.max_abs() < 1e-12);
}

#[test]
fn outline_and_inside_agree() {
    let f = filter(0.3, SETTINGS);
    let (b, _) = run(&f, &scans(&mut draws(5), rectangle, false, 20, 20));
    let centre = b.state.mean();
    for point in f.outline(&b, 50).unwrap() {
        let along = |share: f64| [0, 1].map(|k| centre[k] + share * (point.at[k] - centre[k]));
        assert!(f.holds(&b, along(0.999)) && !f.holds(&b, along(1.001)));
        assert!(point.deviation > 0.0 && point.radius > 0.0);
    }
    assert!(f.holds(&b, [centre[0], centre[1]]));
}

#[test]
fn bears_all_scans() {
    for depth in [Depth::EDGE, Depth::SURFACE] {
        for forgetting in [0.0, 0.1] {
            let settings = ContourSettings { depth, forgetting, ..SETTINGS };
            let f = filter(0.3, settings);
            bears(&f, |b| f.outline(b, 30).is_ok_and(|o| o.iter().all(|p| p.deviation.is_finite())));
        }
    }
}

#[test]
fn refusals() {
    let new = |settings| {
        let prior = Gaussian::independent([0.0; 4], [1.0; 4]).unwrap();
        Contour::<_, _, 4, 4, 12>::new(motion(1.0), FirstTwo, prior, settings).map(|_| ())
    };
    assert!(new(SETTINGS).is_ok());
    let process = SETTINGS.process;
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(new(ContourSettings { forgetting: bad, ..SETTINGS }).is_err());
        for process in [
            RadiusProcess { radius: bad, ..process },
            RadiusProcess { common: bad, ..process },
            RadiusProcess { deviation: bad, ..process },
            RadiusProcess { length: bad, ..process },
        ] {
            assert!(new(ContourSettings { process, ..SETTINGS }).is_err());
        }
        for depth in [Depth { mean: bad, variance: 0.1 }, Depth { mean: 0.5, variance: bad }] {
            assert!(new(ContourSettings { depth, ..SETTINGS }).is_err());
        }
    }
    assert!(new(ContourSettings { noise: Matrix::ZERO, ..SETTINGS }).is_err());
    let prior = Gaussian::independent([0.0; 4], [1.0; 4]).unwrap();
    assert!(Contour::<_, _, 4, 4, 2>::new(motion(1.0), FirstTwo, prior, SETTINGS).is_err());
}
