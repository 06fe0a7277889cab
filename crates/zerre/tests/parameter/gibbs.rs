//! Particle Gibbs.

use crate::{Data, agrees, nile, quadrature, variances};
use std::array::from_fn;
use zerre::belief::Gaussian;
use zerre::math::Matrix;
use zerre::model::measurement::Position;
use zerre::model::motion::{RandomWalk, UpfGrowth, WienerAcceleration};
use zerre::model::{Motion, StateSpace};
use zerre::parameter::{GibbsChain, GibbsSettings, GivenPath, Law, Parameters, particle_gibbs};
use zerre::rng::{Draws, Purpose, Stream};
use zerre::smooth::conditional_path;
use zerre::{Error, Result, Time};

type Level = StateSpace<1, RandomWalk<1>, Position<1>>;

fn level([noise, walk]: &[f64; 2], mean: f64, variance: f64) -> Result<Level> {
    let prior = Gaussian::new([mean], Matrix([[variance]]))?;
    Ok(StateSpace { prior, motion: RandomWalk::new(*walk)?, sensor: Position::new(noise.sqrt())? })
}

/// Instants after the start, and whether something is seen there: at once, after a gap, twice.
const INSTANTS: [(f64, bool); 6] =
    [(0.0, true), (1.0, true), (2.5, false), (3.0, true), (3.0, true), (3.2, true)];

/// Parameters and path drawn from the prior and measurements drawn for them are a draw from the posterior,
/// whatever the measurements are; what two particles make of it must be one too (Geweke 2004). So numbers
/// whose law is known under the joint law of everything keep it: of each its mean, over 20 000 draws, within
/// 5 standard errors; there are 23. Three turns double what is wrong in one.
#[test]
fn the_joint_law_stays() {
    const RUNS: u64 = 20_000;
    let parameters = Parameters::new([
        ("noise", Law::LogNormal { median: 0.5, sd: 0.5 }),
        ("walk", Law::LogNormal { median: 1.0, sd: 0.7 }),
    ])
    .unwrap();
    let settings = GibbsSettings { draws: 3, burn_in: 0, particles: 2, first_step: 0.7 };
    let mut samples: Vec<Vec<(f64, f64)>> = Vec::new();
    let (mut renewed, mut accepted) = (0.0, 0.0);
    for run in 0..RUNS {
        let stream = Stream::new(71).fork(run);
        let mut draws = stream.draws(Purpose::Other, 0, 0);
        let theta = parameters.draw(&mut draws);
        let mut path = vec![[2.0 * draws.normal()]];
        let (mut data, mut last) = (Vec::new(), 0.0);
        for (t, is_seen) in INSTANTS {
            let sd = (theta[1] * (t - last)).sqrt();
            let x = path[path.len() - 1][0] + if t > last { sd * draws.normal() } else { 0.0 };
            let z = is_seen.then(|| [x + theta[0].sqrt() * draws.normal()]);
            path.push([x]);
            data.push((Time::from_secs(t), z));
            last = t;
        }
        let start = (theta, Some(path.as_slice()));
        let model = |theta: &[f64; 2]| level(theta, 0.0, 4.0);
        let data = (Time::ZERO, data.as_slice());
        let GibbsChain { chain, path, renewed: now } =
            particle_gibbs(&parameters, start, settings, stream, data, model, GivenPath::Steps(1)).unwrap();
        renewed += now.iter().sum::<f64>() / now.len() as f64 / RUNS as f64;
        accepted += chain.accepted / RUNS as f64;

        let [noise, walk] = chain.draws[2];
        let (a, b) = ((noise / 0.5).ln() / 0.5, walk.ln() / 0.7);
        // What is found, and what its mean must be.
        let mut found = vec![(a, 0.0), (a * a, 1.0), (b, 0.0), (b * b, 1.0), (a * b, 0.0)];
        found.push((path[0][0] * path[0][0] / 4.0, 1.0));
        let mut before = (0.0, path[0][0]);
        for ((t, is_seen), (x, (_, z))) in INSTANTS.iter().zip(path[1..].iter().zip(data.1)) {
            if *t > before.0 {
                let step = (x[0] - before.1) / (walk * (t - before.0)).sqrt();
                found.extend([(step, 0.0), (step * step, 1.0), (step * a, 0.0)]);
            } else {
                assert_eq!(x[0], before.1);
            }
            assert_eq!(z.is_some(), *is_seen);
            if let Some(z) = z {
                found.push(((z[0] - x[0]).powi(2) / noise, 1.0));
            }
            before = (*t, x[0]);
        }
        samples.push(found);
    }
    let n = RUNS as f64;
    assert_eq!(samples[0].len(), 23);
    for i in 0..samples[0].len() {
        let mean = samples.iter().map(|s| s[i].0).sum::<f64>() / n;
        let square = samples.iter().map(|s| (s[i].0 - mean).powi(2)).sum::<f64>() / n;
        let (expected, error) = (samples[0][i].1, (square / n).sqrt());
        assert!((mean - expected).abs() < 5.0 * error && error < 0.02, "{i}: {mean} {expected} {error}");
    }
    assert!(renewed > 0.15 && (0.3..0.9).contains(&accepted), "nothing moves: {renewed} {accepted}");
}

fn nile_model(theta: &[f64; 2]) -> Result<Level> {
    level(theta, 1000.0, 4e4)
}

/// Steps under the priors of the other chains.
#[test]
fn steps_have_the_posterior_of_the_nile_as_their_law() {
    let Some(data) = nile() else { return };
    let truth = quadrature(&data, &variances());
    let settings = GibbsSettings { draws: 3000, burn_in: 400, ..GibbsSettings::default() };
    let data = (Time::from_secs(1.0), data.as_slice());
    let start = ([10_000.0, 3000.0], None);
    let run = || {
        let given = GivenPath::Steps(5);
        particle_gibbs(&variances(), start, settings, Stream::new(6), data, nile_model, given).unwrap()
    };
    let found = run();
    agrees(&found.chain, &truth);
    let chain = &found.chain;
    assert!((0.15..0.6).contains(&chain.accepted) && chain.impossible == 0, "{}", chain.accepted);
    assert!(found.renewed.iter().all(|&share| share > 0.4), "{:?}", found.renewed);
    assert_eq!((chain.draws.len(), chain.log_likelihoods.len(), found.path.len()), (3000, 3000, 101));
}

/// Exact draws under conjugate priors; with two particles, paths change more slowly, and the law is the same.
#[test]
fn exact_draws_have_the_posterior_of_the_nile_as_their_law() {
    let Some(data) = nile() else { return };
    let (shape, scales) = (2.0, [15_000.0, 2000.0]);
    let law = |scale| Law::InverseGamma { shape, scale };
    let parameters = Parameters::new([("noise", law(scales[0])), ("level", law(scales[1]))]).unwrap();
    let truth = quadrature(&data, &parameters);
    for (particles, draws) in [(20, 2000), (2, 8000)] {
        let settings = GibbsSettings { draws, burn_in: 500, particles, ..GibbsSettings::default() };
        let mut draw = |path: &[[f64; 1]], random: &mut Draws| {
            let half = |terms: &mut dyn Iterator<Item = f64>| terms.map(|t| 0.5 * t * t).sum::<f64>();
            let noise = half(&mut path[1..].iter().zip(&data).map(|(x, (_, z))| z.unwrap()[0] - x[0]));
            let walk = half(&mut path.windows(2).map(|pair| pair[1][0] - pair[0][0]));
            let counts = [data.len() as f64, data.len() as f64 - 1.0];
            let sums = [noise, walk];
            Ok(from_fn(|k| (scales[k] + sums[k]) / random.gamma(shape + 0.5 * counts[k])))
        };
        let given = GivenPath::Exact(&mut draw);
        let data = (Time::from_secs(1.0), data.as_slice());
        let start = ([10_000.0, 3000.0], None);
        let found =
            particle_gibbs(&parameters, start, settings, Stream::new(7), data, nile_model, given).unwrap();
        agrees(&found.chain, &truth);
        assert_eq!(found.chain.accepted, 1.0);
    }
}

/// What is seen of a path counts with it: by hand.
#[test]
fn the_complete_likelihood_is_a_sum() {
    let model = level(&[0.25, 2.0], 1.0, 4.0).unwrap();
    let at = Time::from_secs;
    let data = [(at(0.0), Some([1.5])), (at(0.5), None), (at(2.0), Some([3.0]))];
    let path = [[2.0], [2.0], [2.5], [4.0]];
    let normal = |d: f64, variance: f64| -0.5 * (d * d / variance + (std::f64::consts::TAU * variance).ln());
    let expected =
        normal(1.0, 4.0) + normal(-0.5, 0.25) + normal(0.5, 1.0) + normal(1.5, 3.0) + normal(-1.0, 0.25);
    let found = model.log_density(Time::ZERO, &data, &path).unwrap();
    assert!((found - expected).abs() < 1e-12);
    let jumps = [[2.0], [2.1], [2.5], [4.0]];
    assert_eq!(model.log_density(Time::ZERO, &data, &jumps).unwrap(), f64::NEG_INFINITY);
    assert!(matches!(model.log_density(Time::ZERO, &data, &path[1..]), Err(Error::Shape { .. })));
    assert!(matches!(model.log_density(at(1.0), &data, &path), Err(Error::OutOfOrder { .. })));
}

#[test]
fn what_has_no_conditional_path_is_refused() {
    let at = Time::from_secs;
    fn path<A: Motion<N, W>, const N: usize, const W: usize>(
        motion: A,
        (data, reference): (&Data, Option<&[[f64; N]]>),
        particles: usize,
    ) -> Result<Vec<[f64; N]>> {
        let prior = Gaussian::independent([0.0; N], [1.0; N])?;
        let model = StateSpace { prior, motion, sensor: Position::<1>::new(1.0)? };
        conditional_path(&model, (Time::ZERO, data.as_slice()), reference, particles, Stream::new(1))
    }
    let walk = RandomWalk::<1>::new(1.0).unwrap();
    let data = vec![(at(1.0), Some([0.3])), (at(1.0), None)];
    let good = path(walk, (&data, None), 2).unwrap();
    assert_eq!((good.len(), good[1]), (3, good[2]));
    assert_eq!(path(walk, (&vec![], Some(&[[1.0]])), 2).unwrap().len(), 1);
    assert!(matches!(path(walk, (&data, None), 1), Err(Error::OutOfRange { .. })));
    assert!(matches!(path(walk, (&data, Some(&good[1..])), 5), Err(Error::Shape { .. })));
    let torn = [good[0], good[1], [good[2][0] + 1.0]];
    assert!(matches!(path(walk, (&data, Some(&torn)), 5), Err(Error::Unsupported(_))));
    let back = vec![(at(1.0), None), (at(0.5), None)];
    assert!(matches!(path(walk, (&back, None), 5), Err(Error::OutOfOrder { .. })));
    let absurd = vec![(at(1.0), Some([1e200]))];
    assert!(matches!(path(walk, (&absurd, None), 5), Err(Error::Unsupported(_))));
    assert!(path(walk, (&vec![(at(1.0), Some([f64::NAN]))], None), 5).is_err());
    let flat = WienerAcceleration::<1>::new(1.0).unwrap();
    assert!(matches!(path(flat, (&data, None), 5), Err(Error::Unsupported(_))));
    // Positive noise: no particle may lead to the reference, but the one that did.
    let growth = UpfGrowth::new(3.0, 2.0).unwrap();
    let first = path(growth, (&data, None), 3).unwrap();
    let next = path(growth, (&data, Some(&first)), 3).unwrap();
    assert!(next.iter().all(|x| x[0].is_finite()));

    let parameters = Parameters::new([("x", Law::Uniform { low: 0.0, high: 9.0 })]).unwrap();
    let run = |start, settings| {
        let model = |&[x]: &[f64; 1]| level(&[1.0, x], 0.0, 1.0);
        let data = (Time::ZERO, data.as_slice());
        let given = GivenPath::Steps(1);
        particle_gibbs(&parameters, ([start], None), settings, Stream::new(1), data, model, given)
    };
    let settings = GibbsSettings { draws: 5, burn_in: 2, ..GibbsSettings::default() };
    assert!(run(1.0, settings).is_ok_and(|found| found.chain.draws.len() == 5));
    assert!(run(10.0, settings).is_err());
    assert!(run(1.0, GibbsSettings { draws: 0, ..settings }).is_err());
    assert!(run(1.0, GibbsSettings { particles: 1, ..settings }).is_err());
    assert!(run(1.0, GibbsSettings { first_step: 0.0, ..settings }).is_err());
}
