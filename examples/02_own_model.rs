//! A model of your own, in one file, for every filter: a pendulum whose horizontal deflection is measured.
//!
//! Command: `cargo run --release -p zerre-examples --bin 02_own_model`
//!
//! The motion and the measurement are written once, over `Real`. The particle filter runs them in SIMD lanes, the
//! extended Kalman filter under dual numbers (no Jacobian is written anywhere), the unscented one on plain numbers.
//!
//! Conclude: a model is two small pieces of mathematics, and choosing another filter changes one line.

use std::error::Error as StdError;
use zerre::belief::{Cloud, Gaussian, GaussianBelief};
use zerre::filter::{Extended, Filter, ParticleFilter, Settings, SigmaPoints, Unscented};
use zerre::math::{Real, gaussian::LN_2PI};
use zerre::model::{GaussianMeasurement, Measurement, Motion, simulate};
use zerre::rng::Stream;
use zerre::{Error, Result, Span, Time};

/// A pendulum pushed by the wind. The state is [angle from the vertical in rad, its rate in rad/s].
struct Pendulum {
    length_m: f64,
    /// Standard deviation of the change of the rate in one second, rad/s.
    wind: f64,
}

/// What is the same for all particles in one step.
struct Swing {
    dt: f64,
    pull: f64,
    wind: f64,
}

impl Motion<2, 1> for Pendulum {
    type Step = Swing;

    fn over(&self, from: Time, to: Time) -> Result<Swing> {
        let dt = (to - from).secs();
        let pull = -9.81 / Error::positive("length of the pendulum", self.length_m)?;
        Ok(Swing { dt, pull, wind: Error::not_negative("wind", self.wind)? * dt.sqrt() })
    }

    // One symplectic step: good for steps that are short beside the period.
    #[inline(always)]
    fn apply<R: Real>(step: &Swing, [angle, rate]: [R; 2], [w]: [R; 1]) -> [R; 2] {
        let rate = rate + angle.sin_cos().0 * (step.pull * step.dt) + w * step.wind;
        [angle + rate * step.dt, rate]
    }
}

/// A camera beside the pendulum that sees its horizontal deflection, length times sin(angle).
struct Camera {
    length_m: f64,
    sd_m: f64,
}

/// A measured deflection, digested once to score any number of particles.
struct Seen {
    deflection: f64,
    length: f64,
    per_sd: f64,
    constant: f64,
}

impl Measurement<2> for Camera {
    type Value = [f64; 1];
    type Given<'z> = Seen;

    fn given<'z>(&'z self, z: &'z [f64; 1], _: Time) -> Result<Seen> {
        let deflection = Error::finite("measured deflection", z[0])?;
        let sd = Error::positive("standard deviation of the camera", self.sd_m)?;
        let constant = -0.5 * LN_2PI - Real::ln(sd);
        Ok(Seen { deflection, length: self.length_m, per_sd: 1.0 / sd, constant })
    }

    // The whole log-density, constants kept: evidence compares models.
    #[inline(always)]
    fn log_likelihood<R: Real>(seen: &Seen, [angle, _]: [R; 2]) -> R {
        let e = (angle.sin_cos().0 * seen.length - seen.deflection) * seen.per_sd;
        e * e * -0.5 + seen.constant
    }
}

// Needed by the Kalman family and by simulation only.
impl GaussianMeasurement<2, 1> for Camera {
    #[inline(always)]
    fn predict<R: Real>(&self, _: Time, [angle, _]: [R; 2]) -> [R; 1] {
        [angle.sin_cos().0 * self.length_m]
    }

    fn components(&self, z: &[f64; 1]) -> [f64; 1] {
        *z
    }

    fn covariance(&self) -> [[f64; 1]; 1] {
        [[self.sd_m * self.sd_m]]
    }
}

/// Follows the measurements and prints how well: the root mean square error of the angle, and the evidence.
fn follow<F: Filter<Measurement = [f64; 1]>>(
    name: &str,
    filter: &F,
    angle: impl Fn(&F::Belief) -> f64,
    world: &[(Time, [f64; 2], [f64; 1])],
) -> Result<()> {
    let mut belief = filter.start(Time::ZERO, Stream::new(1))?;
    let (mut squares, mut evidence) = (0.0, 0.0);
    for (time, truth, z) in world {
        evidence += filter.step(&mut belief, *time, Some(z))?.log_evidence;
        squares += (angle(&belief) - truth[0]).powi(2);
    }
    let rmse = (squares / world.len() as f64).sqrt().to_degrees();
    println!("{name:<24} {rmse:6.2} degrees   {evidence:8.2}");
    Ok(())
}

fn main() -> std::result::Result<(), Box<dyn StdError>> {
    let pendulum = || Pendulum { length_m: 2.0, wind: 0.05 };
    let camera = || Camera { length_m: 2.0, sd_m: 0.1 };
    let prior = Gaussian::independent([1.0, 0.0], [0.3, 0.3])?;

    let times: Vec<Time> = (1..=400).map(|k| Time::ZERO + Span::from_secs(0.05 * f64::from(k))).collect();
    let truth = simulate::path(&pendulum(), [1.2, 0.0], &times, Stream::new(11))?;
    let seen = simulate::measurements(&camera(), &truth, &times, Stream::new(12))?;
    let world: Vec<_> = times.iter().zip(&truth).zip(&seen).map(|((t, x), z)| (*t, *x, *z)).collect();

    println!("filter                   error of the angle   evidence");
    let of_gaussian = |belief: &GaussianBelief<2>| belief.state.mean()[0];
    follow("extended Kalman", &Extended::new(pendulum(), camera(), prior), of_gaussian, &world)?;
    let unscented = Unscented::new(pendulum(), camera(), prior, SigmaPoints::default())?;
    follow("unscented Kalman", &unscented, of_gaussian, &world)?;
    let settings = Settings { particles: 10_000, ..Settings::default() };
    let particles = ParticleFilter::new(prior, pendulum(), camera(), settings)?;
    follow("particles, 10 000", &particles, |belief: &Cloud<2>| belief.mean()[0], &world)?;
    Ok(())
}
