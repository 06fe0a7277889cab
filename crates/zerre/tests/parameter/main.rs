//! Static parameters: the variances of a local level model of the Nile's flow, against quadrature.

mod chain;
#[path = "../common/mod.rs"]
mod common;
mod gibbs;
mod law;
mod nested;
mod online;

use common::recording;
use zerre::belief::Gaussian;
use zerre::filter::Kalman;
use zerre::math::Matrix;
use zerre::model::{measurement::Position, motion::RandomWalk};
use zerre::parameter::{Chain, Law, Parameters, log_likelihood};
use zerre::rng::Stream;
use zerre::{Result, Time};

type Data = Vec<(Time, Option<[f64; 1]>)>;

/// Yearly flow at Aswan, 1871 to 1970, in 1e8 m^3, a year counting as a second.
fn nile() -> Option<Data> {
    let text = std::fs::read_to_string(recording("smc_timeseries/nile.csv")?).unwrap();
    let flow = |line: &str| line.split(',').nth(1).unwrap().parse::<f64>().unwrap();
    let rows = text.lines().skip(1).zip(1..);
    Some(rows.map(|(line, k)| (Time::from_secs(f64::from(k)), Some([flow(line)]))).collect())
}

/// The exact filter of a local level.
type LocalLevel = Kalman<RandomWalk<1>, Position<1>, 1, 1, 1>;

/// What of the flow a year's noise is, and how far the level wanders in a year: standard deviations.
fn kalman(theta: &[f64; 2], first: f64) -> Result<LocalLevel> {
    let prior = Gaussian::new([if first > 1e6 { 0.0 } else { 1000.0 }], Matrix([[first]]))?;
    Kalman::new(RandomWalk::<1>::new(theta[1])?, Position::<1>::new(theta[0].sqrt())?, prior)
}

fn exact(data: &Data, theta: &[f64; 2], first: f64) -> Result<f64> {
    log_likelihood(&kalman(theta, first)?, Time::from_secs(1.0), data, Stream::new(0))
}

/// The two variances, each within a factor of about three of what the literature has.
fn variances() -> Parameters<2> {
    let noise = Law::LogNormal { median: 15_000.0, sd: 1.0 };
    Parameters::new([("noise", noise), ("level", Law::InverseGamma { shape: 2.0, scale: 2000.0 })]).unwrap()
}

/// Moments of ln of both variances, and the evidence of the model.
struct Posterior {
    mean: [f64; 2],
    sd: [f64; 2],
    log_evidence: f64,
}

/// By a product rule over ten posterior standard deviations, a tenth of one apart: exact to many digits for
/// so smooth a function.
fn quadrature(data: &Data, parameters: &Parameters<2>) -> Posterior {
    let (mut weights, mut sums) = (0.0, [0.0; 4]);
    for i in 0..80 {
        for j in 0..80 {
            let u = [9.6 + 0.025 * (f64::from(i) - 40.0), 7.3 + 0.08 * (f64::from(j) - 40.0)];
            let theta = u.map(f64::exp);
            // The density of the logarithms has the variances as a factor.
            let log = exact(data, &theta, 4e4).unwrap() + parameters.log_prior(&theta) + u[0] + u[1];
            let weight = (log + 640.0).exp();
            weights += weight;
            for (sum, term) in sums.iter_mut().zip([u[0], u[1], u[0] * u[0], u[1] * u[1]]) {
                *sum += weight * term;
            }
        }
    }
    let [a, b, aa, bb] = sums.map(|s| s / weights);
    Posterior {
        mean: [a, b],
        sd: [(aa - a * a).sqrt(), (bb - b * b).sqrt()],
        log_evidence: (weights * 0.025 * 0.08).ln() - 640.0,
    }
}

/// Means of the chain within five of their standard errors, and no more than a quarter of a posterior
/// standard deviation wide; mean squares too.
fn agrees(chain: &Chain<2>, truth: &Posterior) {
    for k in 0..2 {
        let z = |theta: &[f64; 2]| (theta[k].ln() - truth.mean[k]) / truth.sd[k];
        let (first, error) = (chain.mean(z), chain.standard_error(z));
        assert!(first.abs() < 5.0 * error && error < 0.25, "{k}: {first} of {error}");
        let square = |theta: &[f64; 2]| z(theta).powi(2);
        let (second, error) = (chain.mean(square), chain.standard_error(square));
        assert!((second - 1.0).abs() < 5.0 * error && error < 0.35, "{k}: {second} of {error}");
    }
}
