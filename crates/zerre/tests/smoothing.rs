//! Particle smoothers against the exact smoother of a linear world. Tolerances are standard errors, taken
//! from the spread of independent runs.

use zerre::belief::{Cloud, Gaussian, GaussianBelief};
use zerre::filter::{Filter, Kalman, ParticleFilter, Settings};
use zerre::kernels::Threads;
use zerre::math::{Cholesky, Matrix};
use zerre::model::measurement::{Position, UpfGrowth as GrowthSensor};
use zerre::model::motion::{ConstantVelocity, RandomWalk, UpfGrowth, WienerAcceleration};
use zerre::resample::Trigger;
use zerre::rng::Stream;
use zerre::smooth::{Backward, History, Paris, backward_paths, rauch_tung_striebel};
use zerre::{Error, Time};

const DENSITY: f64 = 0.4;
/// Instants with their measurements: missing ones, two at once, uneven steps.
const DATA: [(f64, Option<f64>); 10] = [
    (0.0, Some(0.3)),
    (0.7, Some(1.9)),
    (1.0, None),
    (2.2, Some(2.4)),
    (2.2, Some(3.6)),
    (3.0, Some(2.9)),
    (4.1, None),
    (5.0, Some(6.1)),
    (5.6, Some(7.4)),
    (6.0, Some(6.8)),
];
const LAST: usize = DATA.len() - 1;
const RUNS: u64 = 40;
const PARTICLES: usize = 400;

fn prior() -> Gaussian<2> {
    Gaussian::independent([0.0, 1.0], [1.0, 0.8]).unwrap()
}

fn motion() -> ConstantVelocity<1> {
    ConstantVelocity::new(DENSITY).unwrap()
}

fn sensor() -> Position<1> {
    Position::new(0.8).unwrap()
}

fn exact() -> Vec<GaussianBelief<2>> {
    let kalman = Kalman::new(motion(), sensor(), prior()).unwrap();
    let mut belief = kalman.start(Time::ZERO, Stream::new(0)).unwrap();
    DATA.iter()
        .map(|&(t, z)| {
            kalman.step(&mut belief, Time::from_secs(t), z.map(|z| [z]).as_ref()).unwrap();
            belief
        })
        .collect()
}

/// F and Q of a step.
fn textbook(t: f64) -> (Matrix<2, 2>, Matrix<2, 2>) {
    let q = Matrix([[t * t * t / 3.0, t * t / 2.0], [t * t / 2.0, t]]) * DENSITY;
    (Matrix([[1.0, t], [0.0, 1.0]]), q)
}

/// Cov[x_k, x_{k+1} | all]: G P_s' with the gain G = P F' (F P F' + Q)^-1.
fn lag_one(filtered: &GaussianBelief<2>, after: &GaussianBelief<2>) -> Matrix<2, 2> {
    let dt = (after.time - filtered.time).secs();
    if dt == 0.0 {
        return *after.state.covariance();
    }
    let (f, q) = textbook(dt);
    let p = filtered.state.covariance();
    let predicted = Cholesky::of("P", &(f.congruence(p) + q)).unwrap();
    predicted.solve_matrix(&(f * *p)).transpose() * *after.state.covariance()
}

/// The clouds of a run, through `each`.
fn run(seed: u64, trigger: Trigger, mut each: impl FnMut(&Cloud<2>)) {
    let settings = Settings { particles: PARTICLES, trigger, ..Settings::default() };
    let filter = ParticleFilter::new(prior(), motion(), sensor(), settings).unwrap();
    let mut cloud = filter.start(Time::ZERO, Stream::new(seed)).unwrap();
    for (t, z) in DATA {
        filter.step(&mut cloud, Time::from_secs(t), z.map(|z| [z]).as_ref()).unwrap();
        each(&cloud);
    }
}

fn history(seed: u64) -> History<2> {
    let mut history = History::new();
    run(seed, Trigger::Below(0.7), |cloud| history.record(cloud).unwrap());
    history
}

/// Estimates of independent runs have the expected mean to 6 of its standard errors; 1e-3 more for the bias,
/// which is of the order of the variances, about 1, over the number of particles, here 2.5e-3, on the average
/// less. Errors are `most` at most.
fn agree(what: &str, estimates: &[Vec<f64>], expected: &[f64], most: f64) {
    for (i, &expected) in expected.iter().enumerate() {
        let n = estimates.len() as f64;
        let mean = estimates.iter().map(|e| e[i]).sum::<f64>() / n;
        let variance = estimates.iter().map(|e| (e[i] - mean).powi(2)).sum::<f64>() / (n - 1.0);
        let error = (variance / n).sqrt();
        assert!(
            (mean - expected).abs() < 6.0 * error + 1e-3,
            "{what} {i}: {mean} +- {error}, exact {expected}"
        );
        assert!(error < most, "{what} {i}: {error}");
    }
}

/// Means, covariances, covariances over one step: what is compared, for the instants up to `LAST`.
fn backward_agrees(how: Backward) {
    let filtered = exact();
    let smoothed = rauch_tung_striebel(&motion(), &filtered).unwrap();
    let mut expected = Vec::new();
    for k in 0..=LAST {
        let (mean, p) = (smoothed[k].state.mean(), smoothed[k].state.covariance());
        expected.extend([mean[0], mean[1], p.0[0][0], p.0[0][1], p.0[1][1]]);
        if k < LAST {
            expected.extend(lag_one(&filtered[k], &smoothed[k + 1]).0.as_flattened());
        }
    }
    let estimate = |seed| {
        let paths =
            backward_paths(&motion(), &history(seed), 400, how, Stream::new(seed).fork(1), &Threads::Serial)
                .unwrap();
        assert_eq!((paths.len(), paths.count()), (LAST + 1, 400));
        let mut found = Vec::new();
        for k in 0..=LAST {
            let (now, mean) = (paths.at(k).unwrap(), paths.at(k).unwrap().mean());
            let p = now.covariance();
            found.extend([mean[0], mean[1], p.0[0][0], p.0[0][1], p.0[1][1]]);
            if k < LAST {
                let next = paths.at(k + 1).unwrap();
                let m = next.mean();
                let covariance = |a: usize, b: usize| {
                    let pairs = now.states[a].iter().zip(&next.states[b]);
                    pairs.map(|(x, y)| (x - mean[a]) * (y - m[b])).sum::<f64>() / 400.0
                };
                found.extend([covariance(0, 0), covariance(0, 1), covariance(1, 0), covariance(1, 1)]);
            }
        }
        found
    };
    let estimates: Vec<Vec<f64>> = (0..RUNS).map(estimate).collect();
    agree(&format!("{how:?}"), &estimates, &expected, 0.02);
    let variance = |beliefs: &[GaussianBelief<2>]| beliefs[1].state.covariance().0[1][1];
    let gap = variance(&filtered) - variance(&smoothed);
    assert!(gap > 6.0 * 0.02 + 1e-3, "the filter would not pass: {gap}");
}

#[test]
fn backward_simulation_by_rejection_is_the_exact_smoother() {
    backward_agrees(Backward::default());
}

/// Without a try: by the sum alone.
#[test]
fn backward_simulation_by_sums_is_the_exact_smoother() {
    backward_agrees(Backward::Rejection { tries: 0 });
}

#[test]
fn backward_simulation_by_moves_is_the_exact_smoother() {
    backward_agrees(Backward::Moves { count: 10 });
}

#[test]
fn fixed_lags_are_the_smoothers_of_what_is_known_then() {
    let filtered = exact();
    let at = 7;
    for lag in [0, 3] {
        let smoothed = rauch_tung_striebel(&motion(), &filtered[..=at]).unwrap()[at - lag];
        let (mean, p) = (smoothed.state.mean(), smoothed.state.covariance());
        let expected = [mean[0], mean[1], p.0[0][0], p.0[0][1], p.0[1][1]];
        let estimate = |seed| {
            let mut history = History::window(lag + 1).unwrap();
            let (mut found, mut k) = (Vec::new(), 0);
            run(seed, Trigger::default(), |cloud| {
                history.record(cloud).unwrap();
                if k == at {
                    let lagged = history.lagged(lag).unwrap();
                    assert_eq!((lagged.time, history.len()), (Time::from_secs(DATA[at - lag].0), lag + 1));
                    let (mean, p) = (lagged.mean(), lagged.covariance());
                    found = vec![mean[0], mean[1], p.0[0][0], p.0[0][1], p.0[1][1]];
                    if lag == 0 {
                        let gap = (mean[0] - cloud.mean()[0]).abs();
                        assert!(gap < 1e-12 && lagged.gaussian().is_ok());
                        let [a] = lagged.quantiles(1, [0.3]).unwrap();
                        assert_eq!([a], cloud.quantiles(1, [0.3]).unwrap());
                    }
                }
                k += 1;
            });
            found
        };
        let estimates: Vec<Vec<f64>> = (0..RUNS).map(estimate).collect();
        agree(&format!("lag {lag}"), &estimates, &expected, 0.02);
    }
}

/// Sums of p_k p_{k+1}, of v_k^2 and of 1 over the path.
#[test]
fn additive_functions_have_their_smoothed_expectations() {
    let filtered = exact();
    let smoothed = rauch_tung_striebel(&motion(), &filtered).unwrap();
    let mut expected = [0.0; 3];
    for k in 0..=LAST {
        let (m, p) = (smoothed[k].state.mean(), smoothed[k].state.covariance());
        expected[1] += m[1] * m[1] + p.0[1][1];
        if k < LAST {
            let joint = lag_one(&filtered[k], &smoothed[k + 1]).0[0][0];
            expected[0] += (m[0] * smoothed[k + 1].state.mean()[0] + joint) / 10.0;
        }
    }
    (expected[1], expected[2]) = (expected[1] / 10.0, LAST as f64);
    for how in [Backward::default(), Backward::Moves { count: 10 }] {
        let estimate = |seed| {
            let mut paris: Option<Paris<2, 3>> = None;
            run(seed, Trigger::Below(0.7), |cloud| match &mut paris {
                None => {
                    let first = |x: &[f64; 2]| [0.0, x[1] * x[1] / 10.0, 0.0];
                    paris = Some(Paris::new(cloud, how, Stream::new(seed).fork(2), first).unwrap());
                }
                Some(paris) => {
                    let motion = motion();
                    let term = |step: &zerre::smooth::PathStep<2>| {
                        let (a, b) = (step.before, step.after);
                        assert!(step.from <= step.to && (step.from < step.to || a == b));
                        [a[0] * b[0] / 10.0, b[1] * b[1] / 10.0, 1.0]
                    };
                    paris.step(&motion, cloud, term).unwrap();
                }
            });
            paris.unwrap().expectation().unwrap().to_vec()
        };
        let estimates: Vec<Vec<f64>> = (0..RUNS).map(estimate).collect();
        assert!(estimates.iter().all(|e| (e[2] - LAST as f64).abs() < 1e-9), "terms are counted once");
        let both: Vec<Vec<f64>> = estimates.iter().map(|e| e[..2].to_vec()).collect();
        agree(&format!("{how:?}"), &both, &expected[..2], 0.06);
    }
}

/// A path never goes back below where the noise, which is positive, can lead.
#[test]
fn gamma_noise_has_possible_paths() {
    let prior = Gaussian::new([1.0], Matrix([[0.75]])).unwrap();
    let motion = UpfGrowth::new(3.0, 2.0).unwrap();
    let settings = Settings { particles: 200, ..Settings::default() };
    let filter = ParticleFilter::new(prior, motion, GrowthSensor::new(1.0).unwrap(), settings).unwrap();
    let mut cloud = filter.start(Time::ZERO, Stream::new(3)).unwrap();
    let mut history = History::new();
    for k in 1..20 {
        filter.step(&mut cloud, Time::from_secs(f64::from(k)), Some(&[4.0])).unwrap();
        history.record(&cloud).unwrap();
    }
    for how in [Backward::default(), Backward::Moves { count: 5 }] {
        let paths = backward_paths(&motion, &history, 50, how, Stream::new(1), &Threads::Serial).unwrap();
        for k in 1..paths.len() {
            let phase = 0.04 * std::f64::consts::PI * paths.times()[k].secs();
            for j in 0..50 {
                let (a, b) = (paths.state(k - 1, j).unwrap()[0], paths.state(k, j).unwrap()[0]);
                assert!(b - 0.5 * a - 1.0 - phase.sin() > 0.0);
            }
        }
    }
}

#[test]
fn paths_repeat_and_pass_the_particles_they_name() {
    let history = history(5);
    let draw = |count, stream, threads| {
        backward_paths(&motion(), &history, count, Backward::default(), stream, &threads).unwrap()
    };
    let paths = |stream| draw(30, stream, Threads::Serial);
    assert_eq!(paths(Stream::new(1)), paths(Stream::new(1)));
    let shared = draw(1000, Stream::new(1), Threads::new(2).unwrap());
    assert!(shared == draw(1000, Stream::new(1), Threads::Serial), "threads change the paths");
    assert_ne!(paths(Stream::new(1)), paths(Stream::new(2)));
    let paths = paths(Stream::new(1));
    assert_eq!(paths.particles(4).len(), 30);
    // Two measurements at one instant: the same states.
    assert_eq!(paths.at(3).unwrap().states, paths.at(4).unwrap().states);
    assert!(paths.at(LAST + 1).is_none() && paths.state(0, 30).is_none() && paths.particles(99).is_empty());
}

#[test]
fn what_has_no_backward_law_is_refused() {
    let prior = Gaussian::independent([0.0; 3], [1.0; 3]).unwrap();
    let jumps = WienerAcceleration::<1>::new(0.5).unwrap();
    let settings = Settings { particles: 50, ..Settings::default() };
    let filter = ParticleFilter::new(prior, jumps, Position::<1>::new(1.0).unwrap(), settings).unwrap();
    let mut cloud = filter.start(Time::ZERO, Stream::new(1)).unwrap();
    let mut history = History::new();
    let mut paris = Paris::<3, 1>::new(&cloud, Backward::default(), Stream::new(1), |_| [0.0]).unwrap();
    history.record(&cloud).unwrap();
    filter.step(&mut cloud, Time::from_secs(1.0), Some(&[1.0])).unwrap();
    history.record(&cloud).unwrap();
    let refused = backward_paths(&jumps, &history, 10, Backward::default(), Stream::new(1), &Threads::Serial);
    assert!(matches!(refused, Err(Error::Unsupported(_))));
    assert!(matches!(paris.step(&jumps, &cloud, |_| [0.0]), Err(Error::Unsupported(_))));
    // The fixed lag asks for no density.
    assert!(history.lagged(1).is_ok() && history.lagged(2).is_err());

    let none = History::<2>::new();
    assert!(none.is_empty() && none.time(0).is_none() && none.lagged(0).is_err());
    let walk = RandomWalk::<2>::new(1.0).unwrap();
    for (history, count) in [(&none, 10), (&self::history(1), 0)] {
        assert!(
            backward_paths(&walk, history, count, Backward::default(), Stream::new(1), &Threads::Serial)
                .is_err()
        );
    }
    assert!(History::<2>::window(0).is_err());
    // Clouds out of order, or of other numbers of particles.
    let cloud = |secs, n: usize| {
        Cloud::from_columns(Time::from_secs(secs), Stream::new(1), [vec![0.0; n], vec![1.0; n]]).unwrap()
    };
    let mut history = History::new();
    history.record(&cloud(1.0, 4)).unwrap();
    assert!(matches!(history.record(&cloud(0.0, 4)), Err(Error::OutOfOrder { .. })));
    assert!(matches!(history.record(&cloud(2.0, 5)), Err(Error::Shape { .. })));
    assert_eq!((history.len(), history.time(0)), (1, Some(Time::from_secs(1.0))));
    assert!(Paris::<2, 1>::new(&cloud(1.0, 4), Backward::default(), Stream::new(1), |_| [f64::NAN]).is_err());
}

/// A motion that never led there is found out instead of drawing at random.
#[test]
fn a_history_of_another_motion_is_refused() {
    let cloud = |secs, x: f64| {
        Cloud::from_columns(Time::from_secs(secs), Stream::new(1), [vec![x, x + 0.1]]).unwrap()
    };
    let mut history = History::new();
    history.record(&cloud(1.0, 10.0)).unwrap();
    history.record(&cloud(2.0, 0.0)).unwrap();
    let growth = UpfGrowth::new(3.0, 2.0).unwrap();
    let refused = backward_paths(&growth, &history, 3, Backward::default(), Stream::new(1), &Threads::Serial);
    assert!(matches!(refused, Err(Error::Unsupported(_))));
    // Far out in the tail of a normal law numbers underflow, and the path is still found.
    let walk = RandomWalk::<1>::new(1e-3).unwrap();
    let paths =
        backward_paths(&walk, &history, 3, Backward::default(), Stream::new(1), &Threads::Serial).unwrap();
    assert_eq!(paths.state(0, 0), Some([10.0]), "the nearer of two");
}
