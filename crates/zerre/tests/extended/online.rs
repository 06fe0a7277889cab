//! The particle filter with online expectation maximisation, against enumeration and against itself.

use zerre::Time;
use zerre::belief::Gaussian;
use zerre::extended::centre::{Centre, FirstTwo};
use zerre::extended::online::{OnlineBelief, OnlineEm, OnlineSettings, Reading};
use zerre::extended::{Ellipse, MStep, Shape, Sums};
use zerre::filter::{Filter, Outcome};
use zerre::kernels::{Simd, Threads};
use zerre::math::{Cholesky, Matrix, Real};
use zerre::model::motion::{ConstantVelocity, RandomWalk};
use zerre::rng::{Draws, Purpose, Stream};

const READINGS: [Reading; 4] = [Reading::Sampled, Reading::Sequential, Reading::Optimal, Reading::Marginal];
const NEVER: u64 = u64::MAX;

type Em = OnlineEm<ConstantVelocity<2>, FirstTwo, 4, 4>;
type Points = Vec<[f64; 2]>;

fn shape(parts: &[(f64, [f64; 2], [f64; 3])]) -> Shape {
    let ellipse = |&(weight, offset, [a, b, c]): &(f64, [f64; 2], [f64; 3])| Ellipse {
        weight,
        offset,
        extent: Matrix([[a, b], [b, c]]),
    };
    Shape::new(parts.iter().map(ellipse).collect()).unwrap()
}

fn truth() -> Shape {
    shape(&[
        (1.0, [0.0, 0.0], [50.0, 0.0, 2.0]),
        (1.0, [0.0, -5.0], [8.0, 4.5, 5.0]),
        (1.0, [0.0, 5.0], [8.0, -4.5, 5.0]),
    ])
}

fn near() -> Shape {
    let round = [15.0, 0.0, 15.0];
    shape(&[(1.0, [0.0, 0.0], round), (1.0, [0.0, -3.0], round), (1.0, [0.0, 3.0], round)])
}

fn two() -> Shape {
    shape(&[(0.3, [1.0, -1.0], [2.0, 0.5, 1.0]), (0.7, [-0.5, 0.5], [1.0, -0.2, 3.0])])
}

fn prior(variance: f64) -> Gaussian<4> {
    Gaussian::independent([0.0, 0.0, 10.0, 0.0], [variance; 4]).unwrap()
}

fn filter(first: Shape, variance: f64, settings: OnlineSettings) -> Em {
    OnlineEm::new(ConstantVelocity::new(1.0).unwrap(), FirstTwo, prior(variance), first, settings).unwrap()
}

fn at(k: usize) -> Time {
    Time::from_secs(k as f64)
}

fn point(shape: &Shape, centre: [f64; 2], draws: &mut Draws) -> [f64; 2] {
    let (u, mut sum) = (draws.uniform(), 0.0);
    let e = shape.ellipses().iter().find(|e| {
        sum += e.weight;
        u < sum
    });
    let e = e.unwrap_or(&shape.ellipses()[0]);
    let d = *Cholesky::of("extent", &e.extent).unwrap().factor() * [draws.normal(), draws.normal()];
    [centre[0] + e.offset[0] + d[0], centre[1] + e.offset[1] + d[1]]
}

/// Scans of `count` points of `shape`, along the straight line of ten metres a second.
fn scans(shape: &Shape, number: usize, count: usize, seed: u64) -> Vec<Points> {
    let mut draws = Stream::new(seed).draws(Purpose::Measurement, 0, 0);
    (1..=number)
        .map(|k| (0..count).map(|_| point(shape, [10.0 * k as f64, 0.0], &mut draws)).collect())
        .collect()
}

fn normal(d: [f64; 2], covariance: &Matrix<2, 2>) -> f64 {
    let root = Cholesky::of("covariance", covariance).unwrap();
    (-0.5 * (root.mahalanobis_squared(&d) + root.log_det())).exp() / std::f64::consts::TAU
}

/// All assignments of `count` points to ellipses.
fn labels(ellipses: usize, count: usize) -> impl Iterator<Item = Vec<usize>> {
    (0..ellipses.pow(count as u32))
        .map(move |code| (0..count).map(|j| code / ellipses.pow(j as u32) % ellipses).collect())
}

/// p(y | x) and E[s | x, y], by the sum over all assignments.
fn enumerated(shape: &Shape, centre: [f64; 2], points: &Points) -> (f64, Vec<Sums>) {
    let mut total = 0.0;
    let mut sums = vec![Sums::default(); shape.len()];
    for labels in labels(shape.len(), points.len()) {
        let mut p = 1.0;
        let mut of_these = vec![Sums::default(); shape.len()];
        for (y, &l) in points.iter().zip(&labels) {
            let (e, d) = (&shape.ellipses()[l], [y[0] - centre[0], y[1] - centre[1]]);
            p *= e.weight * normal([d[0] - e.offset[0], d[1] - e.offset[1]], &e.extent);
            of_these[l].add(1.0, d, &Matrix::ZERO);
        }
        total += p;
        sums.iter_mut().zip(&of_these).for_each(|(sums, s)| sums.blend(1.0, p, s));
    }
    sums.iter_mut().for_each(|s| s.blend(1.0 / total, 0.0, &Sums::default()));
    (total, sums)
}

fn numbers(sums: &[Sums]) -> impl Iterator<Item = f64> + '_ {
    sums.iter().flat_map(|s| [s.count, s.first[0], s.first[1], s.second[0], s.second[1], s.second[2]])
}

/// Equal up to the rounding of some thousand operations.
fn close(found: &[Sums], wanted: &[Sums]) {
    let scale = numbers(wanted).fold(1.0, |most: f64, x| most.max(x.abs()));
    for (a, b) in numbers(found).zip(numbers(wanted)) {
        assert!((a - b).abs() < 1e-11 * scale, "{a} instead of {b}");
    }
}

/// The filter's state at an instant, as the sum over its particles of weight times `row`.
fn weighted(belief: &OnlineBelief<4>, row: impl Fn([f64; 2]) -> Vec<Sums>) -> Vec<Sums> {
    let mut all = vec![Sums::default(); belief.shape().len()];
    for (i, w) in belief.cloud().weights().enumerate() {
        let x = belief.cloud().particle(i);
        all.iter_mut().zip(row([x[0], x[1]])).for_each(|(all, s)| all.blend(1.0, w, &s));
    }
    all
}

/// Without noise the particles of the second scan are copies of those of the first, so that the statistics
/// that they carry follow from where they are: exactly where labels are summed over, or where there is but
/// one.
#[test]
fn statistics_and_weights_are_those_of_enumeration() {
    let one = || shape(&[(1.0, [1.0, 0.0], [20.0, 4.0, 9.0])]);
    let cases = READINGS.map(|reading| (reading, one())).into_iter().chain([(Reading::Marginal, truth())]);
    for ((reading, shape), particles) in cases.flat_map(|case| [1, 13, 700].map(|n| (case.clone(), n))) {
        let settings = OnlineSettings { reading, particles, burn_in: NEVER, ..Default::default() };
        let filter = filter(shape.clone(), 4.0, settings);
        let mut belief = filter.start(Time::ZERO, Stream::new(5)).unwrap();
        let before: Vec<[f64; 4]> = (0..particles).map(|i| belief.cloud().particle(i)).collect();
        let (first, second) = (vec![[1.0, 2.0], [-6.0, 0.5], [0.5, -7.0]], vec![[3.0, -4.0], [0.0, 1.0]]);
        let said = filter.step(&mut belief, Time::ZERO, Some(&first)).unwrap();
        let sum: f64 = before.iter().map(|x| enumerated(&shape, [x[0], x[1]], &first).0).sum();
        let log = (sum / particles as f64).ln();
        // Resampling between the points makes an estimate of it.
        assert!(reading == Reading::Sequential || (said.log_evidence - log).abs() < 1e-11);
        close(belief.sums(), &weighted(&belief, |x| enumerated(&shape, x, &first).1));

        filter.step(&mut belief, Time::ZERO, Some(&second)).unwrap();
        let gain = 2f64.powf(-0.6);
        let both = weighted(&belief, |x| {
            let mut s = enumerated(&shape, x, &first).1;
            let new = enumerated(&shape, x, &second).1;
            s.iter_mut().zip(&new).for_each(|(s, new)| s.blend(1.0 - gain, gain, new));
            s
        });
        close(belief.sums(), &both);
    }
}

/// p of two scans, at one second and at two, by a Kalman filter under each assignment.
fn exact(first: &Points, second: &Points, variance: f64) -> f64 {
    let shape = two();
    let (mut f, mut q) = (Matrix::<4, 4>::identity(), Matrix::<4, 4>::ZERO);
    for k in 0..2 {
        f.0[k][k + 2] = 1.0;
        (q.0[k][k], q.0[k][k + 2], q.0[k + 2][k], q.0[k + 2][k + 2]) = (1.0 / 3.0, 0.5, 0.5, 1.0);
    }
    let h = Matrix([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]);
    let mut total = 0.0;
    for labels in labels(2, first.len() + second.len()) {
        let (mut mean, mut covariance) = (*prior(variance).mean(), *prior(variance).covariance());
        let mut p = 1.0;
        let mut labels = labels.iter();
        for scan in [first, second] {
            (mean, covariance) = (f * mean, f.congruence(&covariance) + q);
            for (y, &l) in scan.iter().zip(&mut labels) {
                let e = &shape.ellipses()[l];
                let s = h.congruence(&covariance) + e.extent;
                let d = [y[0] - mean[0] - e.offset[0], y[1] - mean[1] - e.offset[1]];
                p *= e.weight * normal(d, &s);
                let inverse = Cholesky::of("innovation", &s).unwrap().inverse();
                let gain = covariance * h.transpose() * inverse;
                let step = gain * d;
                mean = std::array::from_fn(|k| mean[k] + step[k]);
                covariance = ((Matrix::identity() - gain * h) * covariance).symmetrised();
            }
        }
        total += p;
    }
    total
}

/// Means over 2 000 runs lie within five of their standard errors.
#[test]
fn evidence_is_unbiased_under_every_reading() {
    let (first, second) = (vec![[10.5, 0.5], [9.0, -1.0]], vec![[21.0, 1.0]]);
    let wanted = exact(&first, &second, 1.0);
    for reading in READINGS {
        let settings = OnlineSettings { reading, particles: 40, burn_in: NEVER, ..Default::default() };
        let filter = filter(two(), 1.0, settings);
        let (mut sum, mut squares, runs) = (0.0, 0.0, 2000);
        for seed in 0..runs {
            let mut belief = filter.start(Time::ZERO, Stream::new(seed)).unwrap();
            let mut log = 0.0;
            for (k, scan) in [&first, &second].into_iter().enumerate() {
                log += filter.step(&mut belief, at(k + 1), Some(scan)).unwrap().log_evidence;
            }
            let ratio = log.exp() / wanted;
            (sum, squares) = (sum + ratio, squares + ratio * ratio);
        }
        let n = runs as f64;
        let error = ((squares / n - (sum / n).powi(2)) / n).sqrt();
        assert!(error < 0.05 && (sum / n - 1.0).abs() < 5.0 * error, "{reading:?}: {} +- {error}", sum / n);
    }
}

/// The weights are the same; a count of drawn labels has at most the variance m / 4 times the sum of the
/// squared weights about the expected one, and is within five standard deviations of it.
#[test]
fn optimal_and_marginal_agree() {
    let run = |reading| {
        let settings = OnlineSettings { reading, particles: 4000, burn_in: NEVER, ..Default::default() };
        let filter = filter(truth(), 1.0, settings);
        let mut belief = filter.start(Time::ZERO, Stream::new(2)).unwrap();
        let update = filter.step(&mut belief, at(1), Some(&scans(&truth(), 1, 9, 4)[0])).unwrap();
        (belief.sums().to_vec(), update.log_evidence, update.particles.unwrap().ess)
    };
    let (a, b) = (run(Reading::Optimal), run(Reading::Marginal));
    assert!((a.1 - b.1).abs() < 1e-9 && (a.2 - b.2).abs() < 1e-6);
    assert!(a.0 != b.0);
    for (a_l, b_l) in a.0.iter().zip(&b.0) {
        assert!((a_l.count - b_l.count).abs() < 5.0 * (9.0 / 4.0 / b.2).sqrt());
    }
}

/// With one ellipse there is nothing to draw.
#[test]
fn one_ellipse_reads_the_same_in_every_way() {
    let one = Shape::ellipse(Matrix([[4.0, 0.0], [0.0, 4.0]])).unwrap();
    let blob = Shape::ellipse(Matrix([[9.0, 2.0], [2.0, 3.0]])).unwrap();
    let data = scans(&blob, 12, 6, 8);
    let run = |reading| {
        let filter =
            filter(one.clone(), 1.0, OnlineSettings { reading, particles: 300, ..Default::default() });
        let mut belief = filter.start(Time::ZERO, Stream::new(2)).unwrap();
        let mut log = 0.0;
        for (k, scan) in data.iter().enumerate() {
            log += filter.step(&mut belief, at(k + 1), Some(scan)).unwrap().log_evidence;
        }
        (belief.sums().to_vec(), log)
    };
    let wanted = run(Reading::Marginal);
    for reading in [Reading::Sampled, Reading::Optimal] {
        let found = run(reading);
        assert!((found.1 - wanted.1).abs() < 1e-8, "{reading:?}");
        for (a, b) in numbers(&found.0).zip(numbers(&wanted.0)) {
            assert!((a - b).abs() < 1e-8 * (1.0 + b.abs()), "{reading:?}");
        }
    }
    assert!(run(Reading::Sequential).1.is_finite());
}

#[test]
fn a_single_particle_will_do() {
    for reading in READINGS {
        let filter = filter(near(), 0.1, OnlineSettings { reading, particles: 1, ..Default::default() });
        let mut belief = filter.start(Time::ZERO, Stream::new(3)).unwrap();
        for (k, scan) in scans(&truth(), 20, 9, 1).iter().enumerate() {
            let update = filter.step(&mut belief, at(k + 1), Some(scan)).unwrap();
            assert!(update.outcome == Outcome::Updated && update.particles.unwrap().ess == 1.0);
        }
        assert!(belief.scans() == 20 && belief.shape() != &near());
    }
}

fn bits(belief: &OnlineBelief<4>) -> Vec<u64> {
    let shape = belief.shape().ellipses().iter().flat_map(|e| {
        [e.weight, e.offset[0], e.offset[1], e.extent.0[0][0], e.extent.0[0][1], e.extent.0[1][1]]
    });
    let cloud = (0..belief.cloud().len()).flat_map(|i| belief.cloud().particle(i));
    shape.chain(cloud).chain(belief.cloud().weights()).map(f64::to_bits).collect()
}

/// Eight blocks and a part of one that is no whole number of lanes: enough for a pool to share out.
#[test]
fn instructions_and_threads_change_no_bit() {
    let data = scans(&truth(), 6, 9, 7);
    for reading in READINGS {
        let mut wanted = None;
        for level in Simd::available() {
            for count in [1, 3] {
                let threads = Threads::new(count).unwrap();
                let settings =
                    OnlineSettings { reading, particles: 4101, simd: level, threads, ..Default::default() };
                let filter = filter(near(), 0.1, settings);
                let mut belief = filter.start(Time::ZERO, Stream::new(3)).unwrap();
                for (k, scan) in data.iter().enumerate() {
                    filter.step(&mut belief, at(k + 1), Some(scan)).unwrap();
                }
                let found = bits(&belief);
                assert!(
                    wanted.get_or_insert_with(|| found.clone()) == &found,
                    "{reading:?} {level:?} {count}"
                );
            }
        }
    }
}

/// A move of the centre within the shape changes nothing that can be seen, as long as the motion does not
/// care where it takes place and nothing ties the shape to its start.
#[test]
fn the_gauge_changes_no_weight() {
    let m_step = MStep { prior: 0.0, ..Default::default() };
    let run = |recentre| {
        let filter = filter(near(), 0.1, OnlineSettings { m_step, recentre, ..Default::default() });
        let mut belief = filter.start(Time::ZERO, Stream::new(4)).unwrap();
        let mut logs = Vec::new();
        for (k, scan) in scans(&truth(), 30, 9, 9).iter().enumerate() {
            logs.push(filter.step(&mut belief, at(k + 1), Some(scan)).unwrap().log_evidence);
        }
        let (c, m) = (belief.shape().centroid(), belief.cloud().mean());
        (logs, c, [m[0] + c[0], m[1] + c[1]])
    };
    let (kept, moved) = (run(false), run(true));
    assert!(kept.1[0].hypot(kept.1[1]) > 0.01 && moved.1[0].hypot(moved.1[1]) < 1e-12);
    let off = kept.0.iter().zip(&moved.0).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
    assert!(off < 1e-7, "{off}");
    assert!((0..2).all(|k| (kept.2[k] - moved.2[k]).abs() < 1e-7));
}

/// What the estimate loses against the truth in ln p of a fresh point, each about its own middle, falls to
/// less than half of that of the start in 60 scans.
#[test]
fn the_shape_is_learnt() {
    let loss = |found: &Shape| {
        let mut draws = Stream::new(77).draws(Purpose::Other, 0, 0);
        let found = found.about(found.centroid());
        let gap = |_| {
            let y = point(&truth(), [0.0; 2], &mut draws);
            truth().log_density(&y).unwrap() - found.log_density(&y).unwrap()
        };
        (0..2000).map(gap).sum::<f64>() / 2000.0
    };
    for reading in [Reading::Optimal, Reading::Marginal] {
        for seed in 0..3 {
            let filter = filter(near(), 0.01, OnlineSettings { reading, ..Default::default() });
            let mut belief = filter.start(Time::ZERO, Stream::new(seed)).unwrap();
            for (k, scan) in scans(&truth(), 60, 9, 20 + seed).iter().enumerate() {
                filter.step(&mut belief, at(k + 1), Some(scan)).unwrap();
            }
            let (before, after) = (loss(&near()), loss(belief.shape()));
            assert!(after < 0.5 * before, "{reading:?} {seed}: {before} -> {after}");
        }
    }
}

#[test]
fn odd_scans_are_taken_in() {
    let line: Points = (0..9).map(|j| [f64::from(j), f64::from(j)]).collect();
    let many = scans(&truth(), 1, 10_000, 5)[0].clone();
    let odd = [vec![], vec![[1.0, 1.0]], vec![[2.0, 0.5]; 9], line, many];
    let crowd =
        Shape::new(vec![Ellipse { weight: 1.0, offset: [0.0; 2], extent: Matrix::identity() }; 16]).unwrap();
    for reading in READINGS {
        for first in [near(), crowd.clone()] {
            for scan in &odd {
                if reading == Reading::Sequential && scan.len() > 100 && first.len() > 3 {
                    // Minutes without optimisation.
                    continue;
                }
                let settings = OnlineSettings { reading, particles: 50, burn_in: 0, ..Default::default() };
                let filter = filter(first.clone(), 30.0, settings);
                let mut belief = filter.start(Time::ZERO, Stream::new(3)).unwrap();
                for k in 0..4 {
                    let update = filter.step(&mut belief, Time::ZERO, Some(scan)).unwrap();
                    let evidence = update.log_evidence;
                    assert!(update.outcome == Outcome::Updated && evidence.is_finite(), "{reading:?} {k}");
                    assert!(!scan.is_empty() || evidence == 0.0);
                }
                assert_eq!(belief.shape() == &first, scan.is_empty());
                let update = filter.step(&mut belief, at(1), None).unwrap();
                assert!(update.outcome == Outcome::Predicted && update.log_evidence == 0.0);
            }
        }
    }
}

/// What is refused leaves the belief as it was; what nothing explains, or what no shape follows from, leaves
/// it as if it had not been seen.
#[test]
fn what_cannot_be_used_is_not() {
    let data = scans(&truth(), 6, 9, 3);
    let wide = shape(&[(1.0, [0.0, 0.0], [1e12, 0.0, 1e12]), (1.0, [1.0, 0.0], [2e12, 0.0, 1e12])]);
    // The likelihood of the first is below any number, squares of the second are above any.
    let cases = [(near(), 3, 1e200), (wide, NEVER, 1.5e154)];
    for ((first, burn_in, far), reading) in cases.iter().flat_map(|case| READINGS.map(|r| (case.clone(), r)))
    {
        let settings = OnlineSettings { reading, particles: 100, burn_in, ..Default::default() };
        let filter = filter(first, 0.1, settings);
        let mut belief = filter.start(Time::ZERO, Stream::new(3)).unwrap();
        for (k, scan) in data[..5].iter().enumerate() {
            filter.step(&mut belief, at(k + 1), Some(scan)).unwrap();
        }
        let before = bits(&belief);
        for bad in [f64::NAN, f64::INFINITY] {
            assert!(filter.step(&mut belief, at(6), Some(&vec![[0.0, 0.0], [1.0, bad]])).is_err());
        }
        assert!(filter.step(&mut belief, at(4), Some(&data[5])).is_err());
        assert_eq!(before, bits(&belief));

        let (shape, sums) = (belief.shape().clone(), belief.sums().to_vec());
        let mut other = belief.clone();
        filter.step(&mut other, at(6), None).unwrap();
        let update = filter.step(&mut belief, at(6), Some(&vec![[60.0, 0.0], [far, 0.0]])).unwrap();
        assert!(update.outcome == Outcome::Degenerate && update.log_evidence == f64::NEG_INFINITY);
        assert_eq!(bits(&belief), bits(&other), "{reading:?}");
        assert!(belief.shape() == &shape && belief.sums() == sums && belief.scans() == 5);
        for belief in [&mut belief, &mut other] {
            let update = filter.step(belief, at(6), Some(&data[5])).unwrap();
            assert!(update.outcome == Outcome::Updated && belief.scans() == 6);
        }
        // Labels are drawn anew: only what is summed over is the same.
        assert!(reading != Reading::Marginal || belief.sums() == other.sums());
    }
}

#[test]
fn settings_that_mean_nothing_are_refused() {
    let bad = [
        OnlineSettings { exponent: 0.5, ..Default::default() },
        OnlineSettings { exponent: f64::NAN, ..Default::default() },
        OnlineSettings { particles: 0, ..Default::default() },
        OnlineSettings { m_step: MStep { floor: 0.0, ..Default::default() }, ..Default::default() },
        OnlineSettings { noise: Matrix([[f64::NAN, 0.0], [0.0, 1.0]]), ..Default::default() },
    ];
    for settings in bad {
        let motion = ConstantVelocity::<2>::new(1.0).unwrap();
        assert!(Em::new(motion, FirstTwo, prior(1.0), near(), settings).is_err());
    }
}

/// Range and bearing.
#[derive(Clone, Copy, Debug)]
struct Polar;

impl Centre<2> for Polar {
    #[inline(always)]
    fn at<R: Real>(&self, [range, bearing]: [R; 2]) -> [R; 2] {
        let (sin, cos) = bearing.sin_cos();
        [range * cos, range * sin]
    }
}

/// The first shape lies three metres beside the centre. The middle of the last scan's points has, with 30 of
/// them, the variance (trace 11, 3) / 30 about the middle of the shape: errors beyond five deviations of that
/// are none of chance.
#[test]
fn a_centre_may_be_any_function_of_the_state() {
    let blob = Shape::ellipse(Matrix([[9.0, 2.0], [2.0, 3.0]])).unwrap();
    let first = shape(&[(1.0, [3.0, 0.0], [5.0, 0.0, 5.0])]);
    let motion = RandomWalk::<2>::new(1e-4).unwrap();
    let law = Gaussian::independent([100.0, 0.5], [4.0, 0.0004]).unwrap();
    let filter = OnlineEm::new(motion, Polar, law, first, OnlineSettings::default()).unwrap();
    let centre = [100.0 * 0.5f64.cos(), 100.0 * 0.5f64.sin()];
    let mut draws = Stream::new(6).draws(Purpose::Measurement, 0, 0);
    let mut belief = filter.start(Time::ZERO, Stream::new(1)).unwrap();
    for k in 1..=20 {
        let scan: Points = (0..30).map(|_| point(&blob, centre, &mut draws)).collect();
        filter.step(&mut belief, at(k), Some(&scan)).unwrap();
    }
    let offset = belief.shape().ellipses()[0].offset;
    assert!(offset[0].hypot(offset[1]) < 1e-9);
    let seen = Polar.at(belief.cloud().mean());
    let off = (seen[0] - centre[0]).hypot(seen[1] - centre[1]);
    assert!(off < 5.0 * (12.0f64 / 30.0).sqrt(), "{off}");
}

/// A belief that is saved and loaded goes on to the same bits; one whose parts do not belong together is refused.
#[test]
fn saved_beliefs_go_on() {
    let (_, scans) = crate::record(6, 8);
    let filter = filter(near(), 1.0, OnlineSettings { particles: 600, ..OnlineSettings::default() });
    let mut belief = filter.start(Time::ZERO, Stream::new(2)).unwrap();
    for (k, scan) in scans.iter().enumerate() {
        let text = serde_json::to_string(&belief).unwrap();
        let mut loaded: OnlineBelief<4> = serde_json::from_str(&text).unwrap();
        let a = filter.step(&mut belief, at(k + 1), Some(scan)).unwrap();
        let b = filter.step(&mut loaded, at(k + 1), Some(scan)).unwrap();
        assert_eq!(a.log_evidence.to_bits(), b.log_evidence.to_bits(), "{k}");
        assert_eq!(belief.shape(), loaded.shape());
    }
    let mut value = serde_json::to_value(&belief).unwrap();
    value["parents"][0] = 600.into();
    let refused = serde_json::from_value::<OnlineBelief<4>>(value).unwrap_err().to_string();
    assert!(refused.contains("belong together"), "{refused}");
}
