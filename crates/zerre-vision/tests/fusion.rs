//! The laws of the fusion of doubtful sources, and of what is learnt of them.

use zerre::Time;
use zerre::belief::Gaussian;
use zerre::filter::{Filter, Kalman};
use zerre::model::measurement::Position;
use zerre::model::motion::ConstantVelocity;
use zerre::rng::{Purpose, Stream};
use zerre_vision::rgbd::Reading;
use zerre_vision::rgbd::calibrate::{Observed, learn};
use zerre_vision::rgbd::fusion::{Evidence, Fused, Fusion, FusionSettings, Source};

const FRAME: (usize, usize) = (640, 480);
const AREA: f64 = 640.0 * 480.0;

fn source(name: &str, sd: f64, outlier: f64) -> Source {
    Source {
        name: name.to_owned(),
        sd,
        depth_sd: 40.0,
        outlier,
        offset: [0.0; 2],
        depth_offset: 0.0,
        sees: false,
    }
}

fn reading(x: f64, y: f64) -> Reading {
    Reading { at: [x, y], depth_mm: None, confidence: 1.0 }
}

/// Rates that are as good as never.
fn steady(particles: usize) -> FusionSettings {
    let never = 1e-13;
    FusionSettings { particles, acceleration: 300.0, hides: never, jumps: never, ..FusionSettings::default() }
}

fn start(settings: FusionSettings, sources: Vec<Source>, seed: u64) -> Fusion {
    Fusion::start(settings, sources, (FRAME, reading(320.0, 240.0), 10.0), (Time::ZERO, Stream::new(seed)))
        .unwrap()
}

fn at(frame: usize) -> Time {
    Time::from_nanos(frame as i64 * 33_333_333)
}

/// With sources that are never wrong, every particle is the Kalman filter.
#[test]
fn sources_that_are_never_wrong_make_a_kalman_filter() {
    let mut fusion = start(steady(3), vec![source("a", 3.0, 1e-13), source("b", 5.0, 1e-13)], 1);
    let motion = ConstantVelocity::<2>::new(300.0 * 300.0).unwrap();
    let prior = Gaussian::independent([320.0, 240.0, 0.0, 0.0], [10.0, 10.0, 100.0, 100.0]).unwrap();
    let [first, second] =
        [3.0, 5.0].map(|sd| Kalman::new(motion, Position::<2>::new(sd).unwrap(), prior).unwrap());
    let mut belief = first.start(Time::ZERO, Stream::new(1)).unwrap();
    for k in 1..40 {
        let (x, y) = (320.0 + 3.0 * k as f64, 240.0 - 0.1 * (k * k) as f64);
        let readings = [[reading(x + 1.0, y)], [reading(x, y - 2.0)]];
        let said = [0, 1].map(|source| Evidence { source, readings: &readings[source], area: AREA });
        let fused = fusion.step(at(k), &said).unwrap();
        first.step(&mut belief, at(k), Some(&[x + 1.0, y])).unwrap();
        second.step(&mut belief, at(k), Some(&[x, y - 2.0])).unwrap();
        let (mean, covariance) = (belief.state.mean(), belief.state.covariance());
        for i in 0..2 {
            assert!((fused.at[i] - mean[i]).abs() < 1e-6, "{k}: {:?} {mean:?}", fused.at);
            assert!((fused.velocity[i] - mean[2 + i]).abs() < 1e-5);
            assert!((fused.covariance[i][i] - covariance.0[i][i]).abs() < 1e-6);
        }
        assert!(fused.p_lost < 1e-9);
    }
}

/// What the sources say in the steps of the next test: one of each is wrong at times.
const SAID: [[[f64; 2]; 2]; 5] = [
    [[322.0, 241.0], [318.0, 238.0]],
    [[340.0, 255.0], [325.0, 240.0]],
    [[328.0, 243.0], [330.0, 228.0]],
    [[332.0, 246.0], [345.0, 239.0]],
    [[339.0, 262.0], [336.0, 244.0]],
];

/// Every history of answers (4^5 of them), each with its Kalman filter and its probability: the exact posterior mean.
fn exact() -> [f64; 2] {
    let motion = ConstantVelocity::<2>::new(300.0 * 300.0).unwrap();
    let prior = Gaussian::independent([320.0, 240.0, 0.0, 0.0], [10.0, 10.0, 100.0, 100.0]).unwrap();
    let sds = [4.0, 6.0];
    let rules = sds.map(|sd| Kalman::new(motion, Position::<2>::new(sd).unwrap(), prior).unwrap());
    let (mut sum, mut mean) = (0.0, [0.0; 2]);
    for history in 0..4_usize.pow(5) {
        let mut belief = rules[0].start(Time::ZERO, Stream::new(1)).unwrap();
        let mut log = 0.0;
        for (k, said) in SAID.iter().enumerate() {
            rules[0].step(&mut belief, at(k + 1), None).unwrap();
            for (s, z) in said.iter().enumerate() {
                if (history >> (2 * k + s)) & 1 == 1 {
                    let update = rules[s].step(&mut belief, at(k + 1), Some(z)).unwrap();
                    log += update.log_evidence + (0.7 * AREA).ln();
                } else {
                    log += 0.3_f64.ln();
                }
            }
        }
        let weight = log.exp();
        sum += weight;
        (0..2).for_each(|i| mean[i] += weight * belief.state.mean()[i]);
    }
    mean.map(|v| v / sum)
}

/// The mean over seeds is the exact one to within four of its own standard errors, and the filter with ten times the
/// particles is nearer; without outliers in the model it is not.
#[test]
fn histories_are_drawn_from_their_posterior() {
    let exact = exact();
    let runs = |particles: usize, outlier: f64| {
        let errors: Vec<[f64; 2]> = (0..200)
            .map(|seed| {
                let sources = vec![source("a", 4.0, outlier), source("b", 6.0, outlier)];
                let mut fusion = start(steady(particles), sources, seed);
                let mut last = [0.0; 2];
                for (k, said) in SAID.iter().enumerate() {
                    let readings = said.map(|[x, y]| [reading(x, y)]);
                    let said =
                        [0, 1].map(|source| Evidence { source, readings: &readings[source], area: AREA });
                    last = fusion.step(at(k + 1), &said).unwrap().at;
                }
                [last[0] - exact[0], last[1] - exact[1]]
            })
            .collect();
        [0, 1].map(|i| {
            let n = errors.len() as f64;
            let mean = errors.iter().map(|e| e[i]).sum::<f64>() / n;
            let squares = errors.iter().map(|e| (e[i] - mean).powi(2)).sum::<f64>() / (n - 1.0);
            (mean, squares.sqrt())
        })
    };
    let (few, many, trusting) = (runs(50, 0.3), runs(500, 0.3), runs(50, 1e-13));
    for i in 0..2 {
        let (mean, sd) = many[i];
        // The estimate is a ratio of sums: its bias is of the order of its variance over its size, below a tenth of its
        // standard deviation here, or 1.4 standard errors of 200 runs.
        assert!(mean.abs() < 5.4 * sd / 200_f64.sqrt(), "{mean} of {sd}");
        // A variance of 200 runs has a relative standard deviation of a tenth: 10 is well beyond 4.
        assert!(few[i].1.powi(2) / sd.powi(2) > 4.0, "{few:?} {many:?}");
    }
    assert!(trusting[1].0.abs() > 10.0 * many[1].1 / 200_f64.sqrt(), "{trusting:?} {many:?}");
}

fn seen(fusion: &mut Fusion, frames: std::ops::Range<usize>, x: impl Fn(usize) -> Option<f64>) -> Fused {
    let mut last = None;
    for k in frames {
        let readings: Vec<Reading> = x(k).map(|x| reading(x, 200.0)).into_iter().collect();
        let said = [0, 1].map(|source| Evidence { source, readings: &readings, area: 141.0 * 141.0 });
        last = Some(fusion.step(at(k), &said).unwrap());
    }
    last.unwrap()
}

/// What nobody sees any more is hidden, its ellipse grows, and where it shows again it is taken up at once, though far
/// from where it was.
#[test]
fn points_are_hidden_and_found() {
    let sources = ["a", "b"].map(|name| Source { sees: true, ..source(name, 3.0, 0.05) });
    let mut fusion = start(FusionSettings::default(), sources.to_vec(), 1);
    let before = seen(&mut fusion, 1..30, |k| Some(300.0 + k as f64));
    assert!(before.p_lost < 0.01, "{before:?}");
    assert!(seen(&mut fusion, 30..33, |_| None).is_lost());
    let hidden = seen(&mut fusion, 33..60, |_| None);
    assert!(hidden.p_lost > 0.9 && hidden.covariance[0][0] > 30.0 * before.covariance[0][0], "{hidden:?}");
    let after = seen(&mut fusion, 60..63, |_| Some(400.0));
    assert!(!after.is_lost() && (after.at[0] - 400.0).abs() < 3.0, "{after:?}");
}

/// A source that has not looked changes no bit, and a seed is a result.
#[test]
fn silence_is_no_evidence() {
    let readings = [reading(330.0, 230.0)];
    let step = |sources: usize, seed: u64| {
        let sources = (0..sources).map(|i| source(&i.to_string(), 4.0, 0.3)).collect();
        let mut fusion = start(FusionSettings::default(), sources, seed);
        let said = [Evidence { source: 0, readings: &readings, area: AREA }];
        (1..20).map(|k| fusion.step(at(k), &said).unwrap().at).collect::<Vec<_>>()
    };
    assert_eq!(step(1, 5), step(3, 5));
    assert_ne!(step(1, 5), step(1, 6));
}

#[test]
fn bad_input_is_refused_and_changes_nothing() {
    let mut fusion = start(FusionSettings::default(), vec![source("a", 4.0, 0.3)], 1);
    let mut twin = fusion.clone();
    let good = [reading(330.0, 230.0)];
    let not_finite = [Reading { at: [f64::NAN, 0.0], ..good[0] }];
    let too_sure = [Reading { confidence: 2.0, ..good[0] }];
    for (source, readings, area) in
        [(0, &not_finite, AREA), (0, &too_sure, AREA), (1, &good, AREA), (0, &good, 0.0)]
    {
        assert!(fusion.step(at(1), &[Evidence { source, readings, area }]).is_err());
    }
    let said = [Evidence { source: 0, readings: &good, area: AREA }];
    assert_eq!(fusion.step(at(2), &said).unwrap(), twin.step(at(2), &said).unwrap());
    assert!(fusion.step(at(1), &said).is_err(), "time goes backwards");
    let settings = FusionSettings { particles: 0, ..FusionSettings::default() };
    assert!(settings.checked().is_err());
    assert!(Source { outlier: 1.0, ..source("a", 1.0, 0.1) }.checked().is_err());
}

/// A reading that nobody is sure of is as good as none: what is said of it is said by the outliers.
#[test]
fn confidence_counts() {
    let trust = |confidence: f64| {
        let mut fusion = start(FusionSettings::default(), vec![source("a", 4.0, 0.1)], 1);
        let readings = [Reading { confidence, ..reading(326.0, 240.0) }];
        let said = [Evidence { source: 0, readings: &readings, area: AREA }];
        fusion.step(at(1), &said).unwrap().trust[0].unwrap()
    };
    assert!(trust(1.0) > 0.99 && trust(0.0) == 0.0 && trust(0.01) < trust(1.0));
}

/// Standard deviation, offset and share of outliers come back to within four standard errors of 4 000 drawn readings.
#[test]
fn sources_are_learnt_from_marks() {
    let n = 4000;
    let mut draws = Stream::new(3).draws(Purpose::Other, 0, 0);
    let all: Vec<Observed> = (0..n)
        .map(|_| {
            let truth = [200.0 + 200.0 * draws.uniform(), 150.0 + 150.0 * draws.uniform()];
            let good = draws.uniform() > 0.2;
            let mut near = |v: f64, off: f64, all: f64| {
                let (normal, uniform) = (draws.normal(), draws.uniform());
                if good { v + off + 5.0 * normal } else { all * uniform }
            };
            let found = reading(near(truth[0], 3.0, 640.0), near(truth[1], -2.0, 480.0));
            Observed { readings: vec![found], area: AREA, truth, truth_mm: None }
        })
        .collect();
    let learnt = learn(&source("a", 20.0, 0.5), &all);
    let good = 0.8 * f64::from(n);
    assert!((learnt.outlier - 0.2).abs() < 4.0 * (0.16 / f64::from(n)).sqrt(), "{learnt:?}");
    assert!((learnt.sd - 5.0).abs() < 4.0 * 5.0 / (4.0 * good).sqrt(), "{learnt:?}");
    for (found, put) in learnt.offset.iter().zip([3.0, -2.0]) {
        assert!((found - put).abs() < 4.0 * 5.0 / good.sqrt(), "{learnt:?}");
    }
    assert_eq!(learn(&learnt, &[]), learnt);
}
