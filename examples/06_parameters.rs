//! Unknown numbers of a model: how far a level wanders in a step, and how noisy its measurements are.
//!
//! Command: `cargo run --release -p zerre-examples --bin 06_parameters`
//!
//! The same record of 200 measurements under four methods. Columns: the two standard deviations, each with
//! what is left open about it.
//!
//! Conclude: the methods agree, and the truth lies within what they leave open. Maximum likelihood is the
//! quickest and gives a point; the others give a law. Particle marginal Metropolis-Hastings needs no more
//! than a filter; particle Gibbs needs the density of a step and then few particles; SMC^2 goes along with
//! the measurements, here with exact filters inside, and also gives the evidence of the model, which is far
//! larger than that of a level that hardly wanders.

use std::error::Error as StdError;
use zerre::belief::Gaussian;
use zerre::filter::{Kalman, ParticleFilter, Settings};
use zerre::model::{StateSpace, measurement::Position, motion::RandomWalk, simulate};
use zerre::parameter::{
    ChainSettings, GibbsSettings, GivenPath, Law, NestedSettings, Parameters, SmcSquared, log_likelihood,
    maximum_likelihood, particle_gibbs, particle_metropolis_hastings,
};
use zerre::rng::Stream;
use zerre::{Result, Time};

const TRUTH: [f64; 2] = [0.5, 1.0];

/// The model of a value of the parameters: a random walk, and what is seen of it.
fn model([step, noise]: &[f64; 2]) -> Result<StateSpace<1, RandomWalk<1>, Position<1>>> {
    let prior = Gaussian::independent([0.0], [2.0])?;
    Ok(StateSpace { prior, motion: RandomWalk::new(step * step)?, sensor: Position::new(*noise)? })
}

/// The exact filter of the model.
fn kalman(theta: &[f64; 2]) -> Result<Kalman<RandomWalk<1>, Position<1>, 1, 1, 1>> {
    let StateSpace { prior, motion, sensor } = model(theta)?;
    Kalman::new(motion, sensor, prior)
}

/// Prints mean and standard deviation of both numbers from what gives the mean of a function.
fn show(method: &str, mean: impl Fn(&dyn Fn(&[f64; 2]) -> f64) -> f64) {
    let spread = |k: usize| {
        let first = mean(&|theta| theta[k]);
        (first, (mean(&|theta| theta[k] * theta[k]) - first * first).sqrt())
    };
    let ((step, step_sd), (noise, noise_sd)) = (spread(0), spread(1));
    println!("{method:<28} {step:6.3} +- {step_sd:5.3}   {noise:6.3} +- {noise_sd:5.3}");
}

fn main() -> std::result::Result<(), Box<dyn StdError>> {
    let truth = model(&TRUTH)?;
    let times: Vec<Time> = (1..=200).map(|k| Time::from_secs(f64::from(k))).collect();
    let path = simulate::path(&truth.motion, [0.0], &times, Stream::new(42))?;
    let seen = simulate::measurements(&truth.sensor, &path, &times, Stream::new(42))?;
    let data: Vec<_> = times.into_iter().zip(seen.into_iter().map(Some)).collect();

    // What is known beforehand: the size of the things.
    let size = Law::LogNormal { median: 1.0, sd: 1.0 };
    let parameters = Parameters::new([("step", size), ("noise", size)])?;
    let (start, from) = ([2.0, 2.0], Time::ZERO);

    println!("{:<28} {:>6} {:>17}", "", "step", "noise");
    println!("{:<28} {:6.3} {:17.3}", "truth", TRUTH[0], TRUTH[1]);
    let best = maximum_likelihood(&parameters, start, Stream::new(0), |theta, stream| {
        log_likelihood(&kalman(theta)?, from, &data, stream)
    })?;
    println!("{:<28} {:6.3} {:17.3}", "maximum likelihood", best.theta[0], best.theta[1]);

    let settings = ChainSettings::default();
    let chain =
        particle_metropolis_hastings(&parameters, start, settings, Stream::new(1), |theta, stream| {
            let StateSpace { prior, motion, sensor } = model(theta)?;
            let settings = Settings { particles: 200, ..Settings::default() };
            let filter = ParticleFilter::new(prior, motion, sensor, settings)?;
            log_likelihood(&filter, from, &data, stream)
        })?;
    show("particle MH, 200 particles", |of| chain.mean(of));

    let settings = GibbsSettings { particles: 10, ..GibbsSettings::default() };
    let given = GivenPath::Steps(5);
    let gibbs =
        particle_gibbs(&parameters, (start, None), settings, Stream::new(2), (from, &data), model, given)?;
    show("particle Gibbs, 10 particles", |of| gibbs.chain.mean(of));

    let settings = NestedSettings::default();
    let mut nested =
        SmcSquared::new(&parameters, settings.clone(), from, Stream::new(3), |theta, _| kalman(theta))?;
    for &(to, z) in &data {
        nested.step(to, z)?;
    }
    show("SMC^2, 500 values", |of| nested.mean(of));

    let noise_alone = Parameters::new([("noise", size)])?;
    let still = |&[noise]: &[f64; 1], _: usize| kalman(&[0.01, noise]);
    let mut other = SmcSquared::new(&noise_alone, settings, from, Stream::new(4), still)?;
    for &(to, z) in &data {
        other.step(to, z)?;
    }
    println!(
        "evidence of the walk {:.1} and of a level that hardly wanders {:.1}",
        nested.log_evidence(),
        other.log_evidence()
    );
    Ok(())
}
