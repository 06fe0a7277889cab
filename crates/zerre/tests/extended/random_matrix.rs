//! Random matrices.

use crate::single::*;
use zerre::Time;
use zerre::belief::Gaussian;
use zerre::extended::centre::FirstTwo;
use zerre::extended::inverse_wishart::InverseWishart;
use zerre::extended::random_matrix::{RandomMatrix, RandomMatrixSettings, Rule};
use zerre::extended::rate::Rate;
use zerre::filter::Filter;
use zerre::math::{Cholesky, Matrix, ln_gamma};
use zerre::rng::{Draws, Stream};

type Rm = RandomMatrix<Motion, FirstTwo, 4, 4>;

const EXTENT: Matrix<2, 2> = Matrix([[6.0, 1.5], [1.5, 2.0]]);
const KOCH: Rule = Rule::Koch { unit: 3.0 };
const EXACT: Rule = Rule::Feldmann { noise: Matrix::ZERO };
const NOISY: Rule = Rule::Feldmann { noise: Matrix([[0.5, 0.2], [0.2, 0.8]]) };

fn settings(rule: Rule) -> RandomMatrixSettings {
    RandomMatrixSettings { rule, ..RandomMatrixSettings::default() }
}

fn filter(sd: f64, dof: f64, settings: RandomMatrixSettings) -> Rm {
    let prior = Gaussian::independent([0.0, 0.0, 1.0, -2.0], [sd, sd, 0.3 * sd, 0.3 * sd]).unwrap();
    let extent = InverseWishart::new(Matrix([[5.0, 0.0], [0.0, 4.0]]), dof).unwrap();
    RandomMatrix::new(motion(0.1 * sd), FirstTwo, prior, extent, settings).unwrap()
}

/// `count` points a scan about the known path of [`filter`].
fn scans(d: &mut Draws, extent: &Matrix<2, 2>, scans: usize, count: usize) -> Vec<Vec<[f64; 2]>> {
    let scan = |k: usize, d: &mut Draws| {
        let t = (k + 1) as f64;
        (0..count).map(|_| normal(d, [t, -2.0 * t], extent)).collect()
    };
    (0..scans).map(|k| scan(k, d)).collect()
}

/// Every point adds its square to the scale and one to the degrees of freedom; the points together have a matrix t
/// density. Sums of 35 terms: 1e-10 leaves five digits of room.
#[test]
fn known_centre_has_the_closed_posterior() {
    let data = scans(&mut draws(1), &EXTENT, 5, 7);
    for (rule, scaling) in [(EXACT, 1.0), (KOCH, 1.0), (EXACT, 0.25), (KOCH, 0.25)] {
        let f = filter(0.0, 8.0, RandomMatrixSettings { scaling, ..settings(rule) });
        let (belief, evidence) = run(&f, &data);
        let mut scale = Matrix([[25.0, 0.0], [0.0, 20.0]]);
        let first = Cholesky::of("V", &scale).unwrap().log_det();
        for (k, scan) in data.iter().enumerate() {
            let t = (k + 1) as f64;
            for y in scan {
                let d = [y[0] - t, y[1] + 2.0 * t];
                scale = scale + Matrix::outer(&d, &d) * (1.0 / scaling);
            }
        }
        assert!(apart(&belief.extent.scale(), &scale) < 1e-10);
        assert_eq!(belief.extent.dof(), 43.0);
        assert!(apart(belief.extent.mean(), &(scale * (1.0 / 40.0))) < 1e-10);
        assert!(apart(&belief.extent.mode(), &(scale * (1.0 / 46.0))) < 1e-10);
        let last = Cholesky::of("V", &scale).unwrap().log_det();
        let gamma = |a: f64| ln_gamma(0.5 * a) + ln_gamma(0.5 * (a - 1.0));
        let by_hand = gamma(43.0) - gamma(8.0) + 4.0 * first
            - 21.5 * last
            - 35.0 * (std::f64::consts::PI.ln() + scaling.ln());
        close(evidence, by_hand, 1e-10);
    }
}

/// Koch 2008 written out for one scan: S = h + 1/n, K = P h / S, V + N + Y.
#[test]
fn koch_has_his_closed_forms() {
    let data = scans(&mut draws(2), &EXTENT, 1, 6);
    let f = filter(2.0, 8.0, settings(KOCH));
    let mut belief = f.start(Time::ZERO, Stream::new(1)).unwrap();
    f.step(&mut belief, at(1), None).unwrap();
    // P (x) X at the mean extent diag(5, 4): position variance is 4 + .36 + q/3 in units of 3.
    let p = [[4.0 + 0.36 + 0.2 / 3.0, 0.36 + 0.1], [0.36 + 0.1, 0.36 + 0.2]].map(|row| row.map(|x| x / 3.0));
    close(belief.state.covariance().0[0][0], 5.0 * p[0][0], 1e-12);
    close(belief.state.covariance().0[3][1], 4.0 * p[1][0], 1e-12);
    f.step(&mut belief, at(1), Some(&data[0])).unwrap();
    let mean = [0, 1].map(|k| data[0].iter().map(|y| y[k]).sum::<f64>() / 6.0);
    let d = [mean[0] - 1.0, mean[1] + 2.0];
    let s = p[0][0] + 1.0 / 6.0;
    let scatter = data[0].iter().fold(Matrix::ZERO, |sum, y| {
        let e = [y[0] - mean[0], y[1] - mean[1]];
        sum + Matrix::outer(&e, &e)
    });
    let scale = Matrix([[25.0, 0.0], [0.0, 20.0]]) + scatter + Matrix::outer(&d, &d) * (1.0 / s);
    assert!(apart(&belief.extent.scale(), &scale) < 1e-12);
    let gain = [p[0][0] / s, p[1][0] / s];
    let expected = [1.0 + gain[0] * d[0], -2.0 + gain[0] * d[1], 1.0 + gain[1] * d[0], -2.0 + gain[1] * d[1]];
    for (a, b) in belief.state.mean().iter().zip(expected) {
        close(*a, b, 1e-12);
    }
    let left = Matrix::<4, 4>::from_entries(|i, j| {
        (p[i / 2][j / 2] - gain[i / 2] * gain[j / 2] * s) * scale.0[i % 2][j % 2] / 11.0
    });
    assert!(apart(belief.state.covariance(), &left) < 1e-12);
}

/// Koch's posterior is exact: points one by one, at the same time, say what they say together.
#[test]
fn koch_does_not_mind_how_points_come() {
    let data = scans(&mut draws(3), &EXTENT, 4, 5);
    let f = filter(2.0, 8.0, RandomMatrixSettings { scaling: 0.25, ..settings(KOCH) });
    let (together, evidence) = run(&f, &data);
    let mut belief = f.start(Time::ZERO, Stream::new(1)).unwrap();
    let mut sum = 0.0;
    for (k, scan) in data.iter().enumerate() {
        for y in scan {
            sum += f.step(&mut belief, at(k + 1), Some(&vec![*y])).unwrap().log_evidence;
        }
    }
    close(sum, evidence, 1e-11);
    assert!(apart(belief.extent.mean(), together.extent.mean()) < 1e-11);
    assert!(apart(belief.state.covariance(), together.state.covariance()) < 1e-11);
    for (a, b) in belief.state.mean().iter().zip(together.state.mean()) {
        close(*a, *b, 1e-11);
    }
}

/// One point is bivariate t with dof - 1 = 19 degrees of freedom: within 20 standard deviations lies all but 1e-20,
/// and the sum over a grid as fine as a sixth of one is exact beyond 1e-9 for a function this smooth.
#[test]
fn evidence_is_a_density() {
    for (rule, scaling) in [(KOCH, 1.0), (EXACT, 1.0), (NOISY, 0.25), (KOCH, 0.25)] {
        let f = filter(1.0, 20.0, RandomMatrixSettings { scaling, ..settings(rule) });
        let mut ahead = f.start(Time::ZERO, Stream::new(1)).unwrap();
        f.step(&mut ahead, at(1), None).unwrap();
        let step = if scaling == 1.0 { 0.4 } else { 0.25 };
        let mut sum = 0.0;
        for i in -120..=120 {
            for j in -120..=120 {
                let y = vec![[1.0 + step * f64::from(i), -2.0 + step * f64::from(j)]];
                sum += f.step(&mut ahead.clone(), at(1), Some(&y)).unwrap().log_evidence.exp();
            }
        }
        close(sum * step * step, 1.0, 1e-8);
    }
}

/// X from the prior, points from X: a 90 % interval of the posterior holds 90 % of the X. Over 3000 runs that share
/// has a standard deviation of .0055, and four of them are allowed for each of three directions.
#[test]
fn intervals_hold_what_they_say() {
    let f = filter(0.0, 9.0, settings(EXACT));
    let prior = Cholesky::of("V", &Matrix([[30.0, 0.0], [0.0, 24.0]])).unwrap();
    let mut d = draws(4);
    let directions = [[1.0, 0.0], [0.0, 1.0], [0.6, 0.8]];
    let (mut held, mut below) = ([0u32; 3], [0u32; 3]);
    for _ in 0..3000 {
        // Bartlett: with A lower, A A' ~ W(9, I), and X = L A^-T A^-1 L' is inverse Wishart with scale L L'.
        let a = [(2.0 * d.gamma(4.5)).sqrt(), d.normal(), (2.0 * d.gamma(4.0)).sqrt()];
        let inverse = Matrix([[1.0 / a[0], -a[1] / (a[0] * a[2])], [0.0, 1.0 / a[2]]]);
        let x = (*prior.factor() * inverse).congruence(&Matrix::identity());
        let (belief, _) = run(&f, &scans(&mut d, &x, 2, 4));
        for (k, u) in directions.iter().enumerate() {
            let [low, high] = belief.extent.variance_interval(*u, 0.9).unwrap();
            let true_value = x.quadratic(u, u);
            held[k] += u32::from((low..=high).contains(&true_value));
            below[k] += u32::from(true_value < low);
        }
    }
    for k in 0..3 {
        close(f64::from(held[k]) / 3000.0, 0.9, 0.022 / 1.9);
        // sqrt(.05 .95 / 3000) = .004.
        close(f64::from(below[k]) / 3000.0, 0.05, 0.016 / 1.05);
    }
}

#[test]
fn semi_axes_lie_along_the_mean() {
    let law = InverseWishart::new(turn(0.4).congruence(&Matrix::from_diagonal([9.0, 4.0])), 40.0).unwrap();
    let [long, short] = law.semi_axes(0.9).unwrap();
    close(long.length, 3.0, 1e-12);
    close(short.length, 2.0, 1e-12);
    close((long.direction[1] / long.direction[0]).atan(), 0.4, 1e-12);
    assert!(long.direction[0] * short.direction[0] + long.direction[1] * short.direction[1] == 0.0);
    // u'Vu over quantiles of chi-square with 39 degrees of freedom (tables): 54.572 and 25.695.
    close(long.interval[0], (9.0 * 37.0 / 54.572_227_758_941_73_f64).sqrt(), 1e-9);
    close(long.interval[1], (9.0 * 37.0 / 25.695_390_399_574_75_f64).sqrt(), 1e-9);
    for level in [0.0, 1.0, -0.1, f64::NAN] {
        assert!(law.semi_axes(level).is_err());
    }
    assert!(law.variance_interval([f64::NAN, 0.0], 0.9).is_err());
}

/// Nothing depends on the axes: rounding alone, amplified by some tens of operations.
#[test]
fn a_turn_of_the_plane_turns_the_answer() {
    let data = scans(&mut draws(6), &EXTENT, 10, 6);
    let angle = 0.7;
    for rule in [KOCH, EXACT, NOISY] {
        let with = |angle: f64| {
            let rule = match rule {
                Rule::Feldmann { noise } => Rule::Feldmann { noise: turn(angle).congruence(&noise) },
                koch => koch,
            };
            let prior = Gaussian::independent([0.0, 0.0, 1.0, -2.0], [2.0, 2.0, 0.5, 0.5]).unwrap();
            let extent = turn(angle).congruence(&Matrix([[5.0, 0.0], [0.0, 4.0]]));
            let extent = InverseWishart::new(extent, 8.0).unwrap();
            let settings = RandomMatrixSettings { forgetting: Some(20.0), ..settings(rule) };
            RandomMatrix::new(motion(0.2), FirstTwo, turned(&prior, angle), extent, settings).unwrap()
        };
        let (a, evidence) = run(&with(0.0), &data);
        let (b, same) = run(&with(angle), &turned_scans(&data, angle));
        close(same, evidence, 1e-11);
        assert!(apart(b.extent.mean(), &turn(angle).congruence(a.extent.mean())) < 1e-11);
        assert!(apart(b.state.covariance(), turned(&a.state, angle).covariance()) < 1e-11);
        for (x, y) in b.state.mean().iter().zip(turned(&a.state, angle).mean()) {
            close(*x, *y, 1e-11);
        }
    }
}

/// dof <- 5 + k (dof - 5) + n has the fixed point 5 + n / (1 - k), reached to k^400 = e^-40 of the start.
#[test]
fn forgetting_and_rate() {
    let data = scans(&mut draws(7), &EXTENT, 400, 6);
    let rate = Rate::new(4.0, 2.0, 1.0).unwrap();
    let f = filter(1.0, 8.0, RandomMatrixSettings { forgetting: Some(10.0), rate, ..settings(EXACT) });
    let (belief, _) = run(&f, &data);
    close(belief.extent.dof(), 5.0 + 6.0 / (1.0 - (-0.1f64).exp()), 1e-12);
    close(belief.rate.mean(), (8.0 + 2400.0) / 402.0, 1e-12);
    // Without points it is forgotten over time, and the mean stays.
    let mut later = belief;
    f.step(&mut later, at(1400), None).unwrap();
    close(later.extent.dof(), 5.0, 1e-12);
    assert_eq!(later.extent.mean(), belief.extent.mean());
}

/// Points seen with noise of the size of the extent, about a centre that is not known: over 30 seeds the mean extent
/// lies within four standard errors of the truth, but for what is left of the first error. A scan corrects
/// the share X (X + R)^-1 > 2/3 of it, so that of 5 degrees of freedom's worth of an error of at most 2 there remain
/// 2 (5 / 805)^(2/3) = .07.
#[test]
fn noise_of_the_sensor_is_taken_off() {
    let noise = Matrix([[2.0, 0.0], [0.0, 1.0]]);
    let settings = settings(Rule::Feldmann { noise });
    let prior = Gaussian::independent([0.0, 0.0, 1.0, -2.0], [1.0, 1.0, 0.3, 0.3]).unwrap();
    let extent = InverseWishart::new(Matrix([[5.0, 0.0], [0.0, 4.0]]), 8.0).unwrap();
    let f = RandomMatrix::new(motion(0.0), FirstTwo, prior, extent, settings).unwrap();
    let mut entries = [const { Vec::new() }; 3];
    for seed in 0..30 {
        let (belief, _) = run(&f, &scans(&mut draws(100 + seed), &(EXTENT + noise), 100, 8));
        let m = belief.extent.mean().0;
        entries[0].push(m[0][0] - 6.0);
        entries[1].push(m[0][1] - 1.5);
        entries[2].push(m[1][1] - 2.0);
    }
    for e in &entries {
        let (mean, error) = mean_and_error(e);
        assert!(mean.abs() < 4.0 * error + 0.07, "{mean} {error}");
    }
}

#[test]
fn bears_all_scans() {
    for rule in [KOCH, EXACT, NOISY] {
        for forgetting in [None, Some(3.0)] {
            let f = filter(1.0, 8.0, RandomMatrixSettings { forgetting, ..settings(rule) });
            bears(&f, |b| b.shape().is_ok() && b.extent.semi_axes(0.9).is_ok());
        }
    }
    // A point without size, for good: the floor holds the extent.
    let f = filter(1.0, 8.0, RandomMatrixSettings { forgetting: Some(2.0), ..settings(EXACT) });
    let (belief, _) = run(&f, &vec![vec![[0.0, 0.0]; 4]; 600]);
    assert!(belief.shape().unwrap().ellipses()[0].extent.0[0][0] >= 0.99e-9);
}

#[test]
fn refusals() {
    let new = |settings, sd: [f64; 4]| {
        let prior = Gaussian::independent([0.0; 4], sd).unwrap();
        let extent = InverseWishart::new(EXTENT, 8.0).unwrap();
        RandomMatrix::<_, _, 4, 4>::new(motion(1.0), FirstTwo, prior, extent, settings).map(|_| ())
    };
    assert!(new(settings(KOCH), [1.0; 4]).is_ok());
    assert!(new(settings(KOCH), [1.0, 2.0, 1.0, 1.0]).is_err());
    assert!(new(settings(EXACT), [1.0, 2.0, 1.0, 1.0]).is_ok());
    assert!(new(settings(Rule::Koch { unit: 0.0 }), [1.0; 4]).is_err());
    assert!(new(settings(Rule::Feldmann { noise: Matrix([[-1.0, 0.0], [0.0, 1.0]]) }), [1.0; 4]).is_err());
    for bad in [0.0, -1.0, f64::NAN] {
        assert!(new(RandomMatrixSettings { scaling: bad, ..settings(EXACT) }, [1.0; 4]).is_err());
        assert!(new(RandomMatrixSettings { forgetting: Some(bad), ..settings(EXACT) }, [1.0; 4]).is_err());
        assert!(new(RandomMatrixSettings { floor: bad, ..settings(EXACT) }, [1.0; 4]).is_err());
    }
    assert!(InverseWishart::new(EXTENT, 3.0).is_err());
    assert!(InverseWishart::new(Matrix([[1.0, 2.0], [2.0, 1.0]]), 8.0).is_err());
    let text = r#"{"mean":[[1.0,2.0],[2.0,1.0]],"dof":8.0}"#;
    assert!(serde_json::from_str::<InverseWishart>(text).is_err());
}
