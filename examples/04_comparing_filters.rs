//! Comparing filters: the same models and measurements under four filters, scored in the same way.
//!
//! Command: `cargo run --release -p zerre-examples --bin 04_comparing_filters`
//!
//! Columns: the root mean square error of the position; NEES, the squared error over what the covariance promises,
//! per dimension (1 is honest, more is overconfident); the log-evidence of all measurements (more is better, a
//! difference of 5 is decisive); microseconds per step.
//!
//! Conclude: in a linear world all agree, and the Kalman filter is exact and costs least; the particle filter's
//! evidence is within its Monte-Carlo error. With a precise range and a vague bearing the Kalman filter refuses, the
//! extended and the unscented filter are overconfident, and the particle filter is honest, at a hundred times the
//! cost. Its evidence is the largest by far: that shows without knowing the truth.

use std::error::Error as StdError;
use std::time::Instant;
use zerre::belief::{Cloud, Gaussian, GaussianBelief};
use zerre::filter::{Extended, Filter, Kalman, ParticleFilter, Settings, SigmaPoints, Unscented};
use zerre::model::measurement::{Position, RangeBearing};
use zerre::model::motion::ConstantVelocity;
use zerre::model::{GaussianMeasurement, Measurement, simulate};
use zerre::rng::Stream;
use zerre::{Span, Time};
use zerre_lab::metric::{anees, nees, rmse};

const RUNS: u64 = 20;
const STEPS: i32 = 50;

/// Mean and covariance (row by row) of the position: what every belief can say.
trait Estimate {
    fn position(&self) -> zerre::Result<([f64; 2], [f64; 4])>;
}

impl Estimate for GaussianBelief<4> {
    fn position(&self) -> zerre::Result<([f64; 2], [f64; 4])> {
        let position = self.state.position::<2>()?;
        let [[xx, xy], [yx, yy]] = position.covariance().0;
        Ok((*position.mean(), [xx, xy, yx, yy]))
    }
}

impl Estimate for Cloud<4> {
    fn position(&self) -> zerre::Result<([f64; 2], [f64; 4])> {
        let (mean, c) = (self.mean(), self.covariance().0);
        Ok(([mean[0], mean[1]], [c[0][0], c[0][1], c[1][0], c[1][1]]))
    }
}

/// Paths drawn from the prior itself, so that a perfect filter has a NEES of 1, and their measurements.
struct World {
    times: Vec<Time>,
    truth: Vec<Vec<[f64; 4]>>,
    measured: Vec<Vec<[f64; 2]>>,
}

impl World {
    fn new<H>(prior: [[f64; 4]; 2], motion: &ConstantVelocity<2>, sensor: &H) -> zerre::Result<World>
    where
        H: GaussianMeasurement<4, 2> + Measurement<4, Value = [f64; 2]>,
    {
        let times: Vec<Time> = (1..=STEPS).map(|k| Time::ZERO + Span::from_secs(f64::from(k))).collect();
        // The start is at time zero, before the first measurement.
        let with_start: Vec<Time> = std::iter::once(Time::ZERO).chain(times.iter().copied()).collect();
        let (mut truth, mut measured) = (Vec::new(), Vec::new());
        for run in 0..RUNS {
            let stream = Stream::new(42).fork(run);
            let mut draws = stream.draws(zerre::rng::Purpose::Prior, 0, 0);
            let start = std::array::from_fn(|i| prior[0][i] + prior[1][i] * draws.normal());
            let path = simulate::path(motion, start, &with_start, stream)?.split_off(1);
            measured.push(simulate::measurements(sensor, &path, &times, stream)?);
            truth.push(path);
        }
        Ok(World { times, truth, measured })
    }

    /// Runs a filter over the world and prints its line.
    fn score<F>(&self, name: &str, filter: zerre::Result<F>) -> Result<(), Box<dyn StdError>>
    where
        F: Filter<Measurement = [f64; 2]>,
        F::Belief: Estimate,
    {
        let filter = match filter {
            Ok(filter) => filter,
            Err(error) => {
                println!("  {name:<20} refuses: {error}");
                return Ok(());
            }
        };
        let (mut means, mut truths, mut covariances) = (Vec::new(), Vec::new(), Vec::new());
        let (mut evidence, mut seconds) = (0.0, 0.0);
        for (run, (truth, measured)) in (1..).zip(self.truth.iter().zip(&self.measured)) {
            let mut belief = filter.start(Time::ZERO, Stream::new(run))?;
            for ((time, x), z) in self.times.iter().zip(truth).zip(measured) {
                let since = Instant::now();
                evidence += filter.step(&mut belief, *time, Some(z))?.log_evidence;
                seconds += since.elapsed().as_secs_f64();
                let (mean, covariance) = belief.position()?;
                means.push(mean);
                covariances.push(covariance);
                truths.push([x[0], x[1]]);
            }
        }
        let error = rmse(&means, &truths)?.pooled;
        let honesty = anees(&nees(&means, &truths, &covariances)?, 2, 0.95)?.mean;
        let micros = 1e6 * seconds / means.len() as f64;
        println!("  {name:<20} {error:8.3} m {honesty:8.2} {evidence:12.1} {micros:10.1} us");
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn StdError>> {
    let motion = ConstantVelocity::<2>::new(0.05)?;
    let settings = Settings { particles: 10_000, ..Settings::default() };
    let heading = || println!("  filter                   RMSE     NEES     evidence   per step");

    println!("Positions (linear): every filter may be used");
    heading();
    let (mean, sd) = ([0.0, 0.0, 1.0, 0.5], [2.0, 2.0, 0.5, 0.5]);
    let (prior, sensor) = (Gaussian::independent(mean, sd)?, Position::<2>::new(1.0)?);
    let world = World::new([mean, sd], &motion, &sensor)?;
    world.score("Kalman", Kalman::new(motion, sensor, prior))?;
    world.score("extended", Ok(Extended::new(motion, sensor, prior)))?;
    world.score("unscented", Unscented::new(motion, sensor, prior, SigmaPoints::default()))?;
    world.score("particles, 10 000", ParticleFilter::new(prior, motion, sensor, settings.clone()))?;

    println!("Range to 0.2 m and bearing to 0.3 rad (a banana, not an ellipse)");
    heading();
    let (mean, sd) = ([10.0, 0.0, 0.0, 0.0], [4.0, 4.0, 0.3, 0.3]);
    let (prior, sensor) = (Gaussian::independent(mean, sd)?, RangeBearing::new([0.0, 0.0], 0.2, 0.3)?);
    let world = World::new([mean, sd], &motion, &sensor)?;
    world.score("Kalman", Kalman::new(motion, sensor, prior))?;
    world.score("extended", Ok(Extended::new(motion, sensor, prior)))?;
    world.score("unscented", Unscented::new(motion, sensor, prior, SigmaPoints::default()))?;
    world.score("particles, 10 000", ParticleFilter::new(prior, motion, sensor, settings))?;
    Ok(())
}
