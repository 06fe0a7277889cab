//! Three time series of the literature, with log-likelihoods and filtered moments that were computed
//! elsewhere.

mod common;

use common::recording;
use zerre::Time;
use zerre::belief::Gaussian;
use zerre::filter::{Filter, Grid, Kalman, ParticleFilter, Settings};
use zerre::math::Matrix;
use zerre::model::measurement::{BinomialLogit, Position, StochasticVolatility};
use zerre::model::motion::{Autoregressive, RandomWalk};
use zerre::model::{Measurement, Motion};
use zerre::rng::Stream;

/// Column number `column` of a file of the series, without its head.
fn column(file: &str, column: usize, head: usize) -> Option<Vec<f64>> {
    let text = std::fs::read_to_string(recording(&format!("smc_timeseries/{file}"))?).unwrap();
    let number = |line: &str| line.split(',').nth(column).unwrap().trim().parse().unwrap();
    Some(text.lines().skip(head).filter(|line| !line.trim().is_empty()).map(number).collect())
}

/// What the reference says of each instant: sum of the log-evidence, mean and variance after the measurement.
fn reference(file: &str) -> Option<[Vec<f64>; 3]> {
    Some([column(file, 2, 1)?, column(file, 3, 1)?, column(file, 4, 1)?])
}

/// Log-evidence of all measurements, the first of them at the time of the prior, and largest distances from
/// the reference: of the sums of the log-evidence, of the means, of the variances.
fn against<F: Filter<Measurement = [f64; 1]>>(
    filter: &F,
    data: &[f64],
    reference: &[Vec<f64>; 3],
    moments: impl Fn(&F::Belief) -> (f64, f64),
) -> (f64, [f64; 3]) {
    assert!(reference[0].len() == data.len() && data.len() > 99);
    let mut belief = filter.start(Time::ZERO, Stream::new(1)).unwrap();
    let (mut sum, mut worst) = (0.0, [0.0f64; 3]);
    for (k, &z) in data.iter().enumerate() {
        sum += filter.step(&mut belief, Time::from_secs(k as f64), Some(&[z])).unwrap().log_evidence;
        let (mean, variance) = moments(&belief);
        let gaps = [sum - reference[0][k], mean - reference[1][k], variance - reference[2][k]];
        for (worst, gap) in worst.iter_mut().zip(gaps) {
            *worst = worst.max(gap.abs());
        }
    }
    (sum, worst)
}

/// Log-evidence less the `exact` one of independent particle filters.
fn evidence_errors<A, H>(
    (prior, motion, sensor): (Gaussian<1>, A, H),
    data: &[f64],
    exact: f64,
    (runs, particles): (u64, usize),
) -> Vec<f64>
where
    A: Motion<1, 1>,
    H: Measurement<1, Value = [f64; 1]>,
{
    let settings = Settings { particles, ..Settings::default() };
    let filter = ParticleFilter::new(prior, motion, sensor, settings).unwrap();
    let error = |seed| {
        let mut cloud = filter.start(Time::ZERO, Stream::new(seed)).unwrap();
        let step = |(k, &z): (usize, &f64)| {
            filter.step(&mut cloud, Time::from_secs(k as f64), Some(&[z])).unwrap().log_evidence
        };
        data.iter().enumerate().map(step).sum::<f64>() - exact
    };
    (0..runs).map(error).collect()
}

/// Mean and variance.
fn moments(x: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = x.clone().count() as f64;
    let mean = x.clone().sum::<f64>() / n;
    (mean, x.map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0))
}

/// The mean of the evidence over the exact one is 1, because a particle filter's evidence is unbiased; the
/// standard error is that of the runs' spread.
fn unbiased(errors: &[f64]) {
    let (mean, variance) = moments(errors.iter().map(|e| e.exp()));
    let error = (variance / errors.len() as f64).sqrt();
    assert!(error < 0.3 && (mean - 1.0).abs() < 3.0 * error, "{mean} +- {error}");
}

/// Flow of the Nile 1871-1970 as a local level with the variances of Durbin and Koopman.
#[test]
fn nile() {
    let (Some(data), Some(expected)) = (column("nile.csv", 1, 1), reference("reference_nile_kalman.csv"))
    else {
        return;
    };
    let prior = Gaussian::new([0.0], Matrix([[1e7]])).unwrap();
    let (motion, sensor) =
        (RandomWalk::<1>::new(1469.1).unwrap(), Position::<1>::new(15099f64.sqrt()).unwrap());
    let kalman = Kalman::new(motion, sensor, prior).unwrap();
    let (sum, worst) =
        against(&kalman, &data, &expected, |b| (b.state.mean()[0], b.state.covariance().0[0][0]));
    assert!((sum - -641.585578).abs() < 1e-6, "{sum}");
    // The reference has 12 digits.
    assert!(worst[0] < 1e-6 && worst[1] < 1e-6 && worst[2] < 1e-5, "{worst:?}");
    let grid = Grid::new(prior, motion, sensor).unwrap();
    let (sum, worst) = against(&grid, &data, &expected, |b| (b.mean()[0], b.covariance().0[0][0]));
    assert!((sum - -641.585578).abs() < 1e-4 && worst[1] < 1e-2, "{sum} {worst:?}");
}

fn volatility(mean: f64) -> (Gaussian<1>, Autoregressive, StochasticVolatility) {
    let motion = Autoregressive::new(mean, 0.9702, 0.178).unwrap();
    (motion.stationary().unwrap(), motion, StochasticVolatility)
}

/// Daily returns of the pound against the dollar with the parameters of Pitt and Shephard.
#[test]
fn stochastic_volatility() {
    let full = (-1.02, 750, -492.454_242_622, "reference_sv_full.csv");
    let short = (2.0 * 0.5992f64.ln(), 201, -160.940_263_804, "reference_sv_T201.csv");
    for (mean, count, exact, file) in [full, short] {
        let (Some(returns), Some(expected)) = (column("gbp_usd_logreturns.csv", 1, 1), reference(file))
        else {
            return;
        };
        let (returns, model) = (&returns[..count], volatility(mean));
        let grid = Grid::new(model.0, model.1, model.2).unwrap();
        let (sum, worst) = against(&grid, returns, &expected, |b| (b.mean()[0], b.covariance().0[0][0]));
        assert!((sum - exact).abs() < 1e-6, "{sum}");
        assert!(worst.iter().all(|&w| w < 1e-6), "{worst:?}");
        unbiased(&evidence_errors(model, returns, exact, (50, 1000)));
    }
}

/// Firing of a neuron in the thalamus in 50 trials, 3 000 instants.
#[test]
fn neuron() {
    let (Some(path), Some(expected)) =
        (recording("smc_timeseries/thaldata.csv"), reference("reference_neuro.csv"))
    else {
        return;
    };
    let text = std::fs::read_to_string(path).unwrap();
    let counts: Vec<f64> = text.trim().split(',').map(|count| count.trim().parse().unwrap()).collect();
    let prior = Gaussian::new([0.0], Matrix([[1.0]])).unwrap();
    let motion = Autoregressive::new(0.0, 0.99, 0.0121f64.sqrt()).unwrap();
    let model = (prior, motion, BinomialLogit::new(50).unwrap());
    let grid = Grid::new(model.0, model.1, model.2).unwrap().with_nodes(300).unwrap();
    let (sum, worst) = against(&grid, &counts, &expected, |b| (b.mean()[0], b.covariance().0[0][0]));
    assert!((sum - -3_595.298_067_056).abs() < 1e-6, "{sum}");
    assert!(worst.iter().all(|&w| w < 1e-6), "{worst:?}");
    unbiased(&evidence_errors(model, &counts[..200], expected[0][199], (50, 10_000)));
    // Over all 3 000 instants the evidence of 20 000 particles scatters by e^3: the mean of so few runs says
    // nothing, but its logarithm is normal with mean -s^2 / 2 (Berard, Del Moral and Doucet 2014). The
    // variance of the mean of n logarithms is s^2 / n, that of half their sample variance s^4 / 2 (n - 1).
    let n = 8;
    let errors = evidence_errors(model, &counts, -3_595.298_067_056, (n, 20_000));
    let (mean, variance) = moments(errors.iter().copied());
    let n = n as f64;
    let error = (variance / n + variance * variance / (2.0 * (n - 1.0))).sqrt();
    assert!(variance < 20.0 && (mean + 0.5 * variance).abs() < 3.0 * error, "{mean} {variance} +- {error}");
}
