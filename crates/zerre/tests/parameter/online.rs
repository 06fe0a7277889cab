//! Online expectation maximisation.

use std::array::from_fn;
use zerre::belief::Gaussian;
use zerre::filter::{Kalman, ParticleFilter, Settings};
use zerre::math::{Cholesky, Matrix};
use zerre::model::measurement::Position;
use zerre::model::motion::{Autoregressive, RandomWalk, WienerAcceleration};
use zerre::model::simulate;
use zerre::parameter::{EmSettings, EmTrace, Law, Parameters, log_likelihood, maximum_likelihood, online_em};
use zerre::rng::Stream;
use zerre::smooth::PathStep;
use zerre::{Error, Result, Time};

const PARTICLES: usize = 400;

type Data = Vec<(Time, Option<[f64; 1]>)>;

fn parameters() -> Parameters<3> {
    let variance = Law::LogNormal { median: 1.0, sd: 2.0 };
    let rho = Law::Uniform { low: -1.0, high: 1.0 };
    Parameters::new([("rho", rho), ("step", variance), ("noise", variance)]).unwrap()
}

fn models([rho, step, noise]: &[f64; 3]) -> Result<(Gaussian<1>, Autoregressive, Position<1>)> {
    let prior = Gaussian::new([0.0], Matrix([[4.0]]))?;
    Ok((prior, Autoregressive::new(0.0, *rho, step.sqrt())?, Position::new(noise.sqrt())?))
}

/// An autoregression of rho 0.8 and variances 1 and 0.5; every tenth measurement is missing.
fn record(length: u32) -> Data {
    let (_, motion, sensor) = models(&[0.8, 1.0, 0.5]).unwrap();
    let times: Vec<Time> = (0..=length).map(|k| Time::from_secs(f64::from(k))).collect();
    let path = simulate::path(&motion, [0.0], &times, Stream::new(81)).unwrap();
    let z = simulate::measurements(&sensor, &path, &times, Stream::new(81)).unwrap();
    let seen = times.into_iter().zip(z).zip(0u32..);
    seen.skip(1).map(|((t, z), k)| (t, (k % 10 != 0).then_some(z))).collect()
}

fn run(data: &Data, settings: EmSettings, start: [f64; 3], seed: u64) -> Result<EmTrace<3>> {
    let model = |theta: &[f64; 3]| {
        let (prior, motion, sensor) = models(theta)?;
        ParticleFilter::new(prior, motion, sensor, Settings { particles: PARTICLES, ..Settings::default() })
    };
    // Of the path, and of the measurements with their number.
    let statistics = |step: &PathStep<1>, z: Option<&[f64; 1]>| {
        let ([x], [y]) = (step.before, step.after);
        let seen = z.map_or([0.0; 2], |z| [(z[0] - y).powi(2), 1.0]);
        [x * x, x * y, y * y, seen[0], seen[1]]
    };
    let maximise = |&[xx, xy, yy, noise, seen]: &[f64; 5]| Ok([xy / xx, yy - xy * xy / xx, noise / seen]);
    let data = (Time::ZERO, data.as_slice());
    online_em(&parameters(), start, settings, Stream::new(seed), data, model, (statistics, maximise))
}

/// Where the likelihood of the record is largest, and the standard deviations that its curvature there gives
/// to the estimates: by central differences in steps of a tenth of them, whose error is a hundredth.
fn maximum(data: &Data) -> ([f64; 3], [f64; 3]) {
    let log = |theta: &[f64; 3]| {
        let (prior, motion, sensor) = models(theta)?;
        log_likelihood(&Kalman::new(motion, sensor, prior)?, Time::ZERO, data, Stream::new(0))
    };
    let best = maximum_likelihood(&parameters(), [0.5, 0.5, 0.5], Stream::new(0), |theta, _| log(theta));
    let best = best.unwrap().theta;
    let step = 0.005;
    let at = |i: usize, a: f64, j: usize, b: f64| {
        let mut theta = best;
        theta[i] += a * step;
        theta[j] += b * step;
        log(&theta).unwrap()
    };
    let information = Matrix::<3, 3>::from_entries(|i, j| {
        let sum = at(i, 1.0, j, 1.0) + at(i, -1.0, j, -1.0) - at(i, 1.0, j, -1.0) - at(i, -1.0, j, 1.0);
        -sum / (4.0 * step * step)
    });
    let covariance = Cholesky::of("information", &information).unwrap().inverse();
    (best, from_fn(|i| covariance.0[i][i].sqrt()))
}

/// From far away the averages go to the maximum likelihood estimate of the same record. An estimate from its
/// last 5/8 alone would be sqrt(8/5 - 1) = 0.77 standard deviations off: three times that is allowed. Moments
/// under weights are off by about the number itself over the effective number of particles, half of all at
/// least; what that does to the estimate is more by the information of the complete data over that of the
/// measurements (Louis 1982), 2 to 16 here.
#[test]
fn averages_go_to_the_maximum_of_the_likelihood() {
    let data = record(8000);
    let (best, sd) = maximum(&data);
    let [rho, step, noise] = best;
    let complete = [((1.0 - rho * rho) / 8000.0).sqrt(), step / 4000f64.sqrt(), noise / 3600f64.sqrt()];
    let settings = EmSettings { average_after: 3000, ..EmSettings::default() };
    for (seed, start) in [(1, [0.1, 3.0, 3.0]), (2, [0.95, 0.2, 0.1])] {
        let found = run(&data, settings, start, seed).unwrap();
        for k in 0..3 {
            let bias = (sd[k] / complete[k]).powi(2) * 2.0 * best[k] / PARTICLES as f64;
            let allowed = 3.0 * 0.6f64.sqrt() * sd[k] + bias;
            let off = (found.average[k] - best[k]).abs();
            assert!(off < allowed, "{k}: {off} from {}, allowed {allowed}", best[k]);
            // The start is no such value: it would not pass.
            assert!((start[k] - best[k]).abs() > 2.0 * allowed);
        }
        assert!(found.values.len() == 8000 && found.impossible < 10);
        assert!(found.values[..50].iter().all(|value| *value == start));
    }
}

#[test]
fn what_cannot_be_maximised_is_refused() {
    let data = record(60);
    let start = [0.5, 1.0, 1.0];
    let settings = EmSettings { wait: 0, ..EmSettings::default() };
    let first = run(&data, settings, start, 1).unwrap();
    assert_eq!(first, run(&data, settings, start, 1).unwrap());
    assert_eq!(first.average, first.values[59], "too few to be averaged");
    for exponent in [0.5, 1.1, f64::NAN] {
        assert!(run(&data, EmSettings { exponent, ..settings }, start, 1).is_err());
    }
    assert!(run(&data, settings, [2.0, 1.0, 1.0], 1).is_err());
    let none: &Data = &vec![];
    assert_eq!(run(none, settings, start, 1).unwrap().average, start);

    // Values outside the prior are passed over; statistics that are no numbers are not.
    let walk = |&[q]: &[f64; 1]| {
        let prior = Gaussian::new([0.0], Matrix([[1.0]]))?;
        ParticleFilter::new(prior, RandomWalk::<1>::new(q)?, Position::<1>::new(1.0)?, Settings::default())
    };
    let q = Parameters::new([("q", Law::Uniform { low: 0.1, high: 2.0 })]).unwrap();
    let em = |statistic: f64| {
        let both = (|_: &PathStep<1>, _: Option<&[f64; 1]>| [statistic], |&[s]: &[f64; 1]| Ok([s]));
        online_em(&q, [1.0], settings, Stream::new(1), (Time::ZERO, data.as_slice()), walk, both)
    };
    let stays = em(-1.0).unwrap();
    assert!(stays.impossible == 60 && stays.values.iter().all(|value| *value == [1.0]));
    assert!(em(f64::NAN).is_err());
    let flat = |_: &[f64; 1]| {
        let prior = Gaussian::independent([0.0; 3], [1.0; 3])?;
        let (motion, sensor) = (WienerAcceleration::<1>::new(1.0)?, Position::<1>::new(1.0)?);
        ParticleFilter::new(prior, motion, sensor, Settings::default())
    };
    let both = (|_: &PathStep<3>, _: Option<&[f64; 1]>| [0.0], |&[s]: &[f64; 1]| Ok([s]));
    let refused = online_em(&q, [1.0], settings, Stream::new(1), (Time::ZERO, data.as_slice()), flat, both);
    assert!(matches!(refused, Err(Error::Unsupported(_))));
}
