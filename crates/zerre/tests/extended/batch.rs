//! Batch expectation maximisation by particles.

use zerre::Time;
use zerre::belief::Gaussian;
use zerre::extended::batch::{BatchSettings, batch_em};
use zerre::extended::centre::FirstTwo;
use zerre::extended::{Ellipse, MStep, Shape, Sums};
use zerre::filter::Settings;
use zerre::math::Matrix;
use zerre::model::motion::ConstantVelocity;
use zerre::rng::{Purpose, Stream};

type Scans = Vec<(Time, Vec<[f64; 2]>)>;

/// Two blobs ten metres apart, and a line of ten metres a second.
fn scans(number: usize) -> Scans {
    let mut draws = Stream::new(1).draws(Purpose::Measurement, 0, 0);
    let mut point =
        |k: usize, side: f64| [10.0 * k as f64 + 2.0 * draws.normal(), side * 5.0 + draws.normal()];
    (1..=number)
        .map(|k| {
            (Time::from_secs(k as f64), (0..8).map(|j| point(k, if j < 3 { 1.0 } else { -1.0 })).collect())
        })
        .collect()
}

fn first() -> Shape {
    let ellipse = |y| Ellipse { weight: 1.0, offset: [0.0, y], extent: Matrix([[6.0, 0.0], [0.0, 6.0]]) };
    Shape::new(vec![ellipse(3.0), ellipse(-3.0)]).unwrap()
}

fn settings(iterations: usize) -> BatchSettings {
    let particles = Settings { particles: 300, ..Settings::default() };
    BatchSettings { iterations, particles, ..BatchSettings::default() }
}

/// Along a path that is known to a millimetre, blobs that nobody confuses have the moments of their own
/// points: those and the distance of the path, at most .001 sqrt(20) in 20 steps, are all that the tolerance
/// covers.
#[test]
fn a_known_path_gives_the_moments_of_the_points() {
    let data = scans(20);
    let noise = Matrix([[0.5, 0.1], [0.1, 0.3]]);
    let m_step = MStep { prior: 0.0, ..MStep::default() };
    let settings = BatchSettings { m_step, noise, ..settings(12) };
    let law = Gaussian::independent([0.0, 0.0, 10.0, 0.0], [1e-16; 4]).unwrap();
    let motion = ConstantVelocity::<2>::new(1e-10).unwrap();
    let fit = batch_em((&motion, &FirstTwo), (Time::ZERO, law, &first()), &data, &settings, Stream::new(3))
        .unwrap();
    let mut sums = [Sums::default(); 2];
    for (k, (_, points)) in (1..).zip(&data) {
        for y in points {
            sums[usize::from(y[1] < 0.0)].add(1.0, [y[0] - 10.0 * f64::from(k), y[1]], &Matrix::ZERO);
        }
    }
    let wanted = m_step.shape(&sums, &first(), &noise).unwrap();
    for (a, b) in fit.shape.ellipses().iter().zip(wanted.ellipses()) {
        let off = (a.extent - b.extent).max_abs().max((a.weight - b.weight).abs());
        let off = off.max((a.offset[0] - b.offset[0]).abs()).max((a.offset[1] - b.offset[1]).abs());
        assert!(off < 0.05, "{a:?} instead of {b:?}");
    }
    assert_eq!(fit.states.len(), 20);
    assert!(fit.states.iter().zip(1..).all(|(x, k)| (x[0] - 10.0 * f64::from(k)).abs() < 0.05));
}

#[test]
fn the_likelihood_rises_and_a_seed_repeats() {
    let data = scans(10);
    let law = Gaussian::independent([0.0, 0.0, 10.0, 0.0], [0.01; 4]).unwrap();
    let motion = ConstantVelocity::<2>::new(1.0).unwrap();
    let run = |seed| {
        let from = (Time::ZERO, law, &first());
        batch_em((&motion, &FirstTwo), from, &data, &settings(10), Stream::new(seed)).unwrap()
    };
    let fit = run(1);
    let logs = &fit.log_likelihoods;
    // Their spread at 300 particles is about one; the gain is of the order of 80 points times .5.
    assert!(logs[9] > logs[0] + 10.0, "{logs:?}");
    assert_eq!(fit, run(1));
    assert_ne!(fit, run(2));
}

#[test]
fn scans_that_cannot_be_used_are_refused() {
    let law = Gaussian::independent([0.0, 0.0, 10.0, 0.0], [0.01; 4]).unwrap();
    let motion = ConstantVelocity::<2>::new(1.0).unwrap();
    let run = |data: &Scans, settings: &BatchSettings| {
        batch_em((&motion, &FirstTwo), (Time::ZERO, law, &first()), data, settings, Stream::new(1))
    };
    let mut data = scans(3);
    assert!(run(&data, &settings(0)).is_err());
    // No scan has to have points.
    data[1].1.clear();
    assert_eq!(run(&data, &settings(2)).unwrap().states.len(), 3);
    assert_eq!(run(&vec![], &settings(2)).unwrap().shape, first());
    data[1].1 = vec![[f64::NAN, 0.0]];
    assert!(run(&data, &settings(2)).is_err());
    data[1].1 = vec![[1e200, 0.0]];
    assert!(run(&data, &settings(2)).is_err());
    data[1] = (Time::ZERO, vec![]);
    assert!(run(&data, &settings(2)).is_err());
}
