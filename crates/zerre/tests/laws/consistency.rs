//! Law 5: errors and innovations are as large as the filter says.
//!
//! Over independent runs, each with a target of its own, the normalised error squared of the last step (NEES) sums up
//! to a chi-square number of 4 degrees of freedom per run, the normalised innovations squared (NIS) to one of 2 per
//! measurement, and 95 % of the targets lie inside the 95 % ellipsoid. Bounds are two-sided quantiles that a right
//! filter misses with probability `MISS` each: some 90 filters on two worlds with three numbers make 540
//! comparisons, so all of them hold with probability 0.9994.
//!
//! A mean of as many independent particles as the ESS says errs by P / ESS more, and the inverse of their covariance
//! is too large by ESS / (ESS - 5) (inverse Wishart law, 4 components): NEES is divided by both, with at least 10 for
//! the ESS. Importance sampling needs that; elsewhere it is below 1 %. What is left, and the curvature of the radar's
//! bearing (0.01 standard deviations), is below `APPROXIMATE` of the sums.

use crate::list::{Means, Sensor, UnderLaw, World, filters};
use crate::{Verdict, uphold, worlds};
use zerre::Time;
use zerre::belief::Gaussian;
use zerre::filter::{Kalman, ParticleFilter, Settings, predict_measurement};
use zerre::math::chi_square;
use zerre::rng::Stream;

const MISS: f64 = 1e-6;
const APPROXIMATE: f64 = 0.04;
const RUNS: u32 = 200;
const PARTICLES: usize = 1000;

/// The law for a filter that believes in `believed`, on targets of `world`.
fn consistent<H: Sensor>(filter: &dyn UnderLaw, believed: &World<H>, world: &World<H>) -> Verdict {
    let (mut nees, mut nis, mut seen, mut inside) = (0.0, 0.0, 0, 0);
    let radius = chi_square::quantile(0.95, 4).unwrap();
    for r in 0..RUNS {
        let stream = Stream::new(77).fork(u64::from(r));
        let (script, truth) = worlds::script(world, stream);
        let mut run = filter.begin(stream.fork(1));
        let (mut now, mut ess) = (Time::ZERO, f64::INFINITY);
        for (to, z) in &script {
            if let Some(z) = z {
                let state = Gaussian::new(run.mean(), run.covariance()).map_err(|e| e.to_string())?;
                let foretold =
                    predict_measurement(&believed.motion, &believed.sensor, &state, now, *to).unwrap();
                nis += foretold.nis(z).unwrap();
                seen += 1;
            }
            let update = run.step(*to, z.as_ref()).unwrap();
            ess = update.particles.map_or(f64::INFINITY, |p| p.ess.max(10.0));
            now = *to;
        }
        let state = Gaussian::new(run.mean(), run.covariance()).map_err(|e| e.to_string())?;
        let error = state.mahalanobis_squared(&truth[truth.len() - 1]).map_err(|e| e.to_string())?;
        let error = error * (1.0 - 5.0 / ess) / (1.0 + 1.0 / ess);
        nees += error;
        inside += u32::from(error < radius);
    }
    plausible("NEES", nees, 4 * RUNS)?;
    plausible("NIS", nis, 2 * seen)?;
    // Chernoff: P(|k / n - p| > d) < 2 exp(-2 n d^2).
    let share = f64::from(inside) / f64::from(RUNS);
    let width = ((2.0 / MISS).ln() / (2.0 * f64::from(RUNS))).sqrt();
    if (share - 0.95).abs() > width {
        return Err(format!("{share} of the targets lie inside the 95 % ellipsoid"));
    }
    Ok(())
}

fn plausible(what: &str, sum: f64, dof: u32) -> Verdict {
    let low = (1.0 - APPROXIMATE) * chi_square::quantile(MISS / 2.0, dof).unwrap();
    let high = (1.0 + APPROXIMATE) * chi_square::quantile(1.0 - MISS / 2.0, dof).unwrap();
    if (low..=high).contains(&sum) {
        return Ok(());
    }
    Err(format!("{what} is {:.3} times what it should be ({low:.0} to {high:.0})", sum / f64::from(dof)))
}

fn all_consistent<H: Sensor>(world: &World<H>) {
    let list = filters(world, &Means::serial(PARTICLES));
    let bound = list.iter().filter(|entry| entry.class.is_bound_here());
    uphold(bound.map(|e| (e.name.clone(), consistent(&*e.filter, world, world))));
}

#[test]
fn on_a_linear_world() {
    all_consistent(&worlds::linear(2.0));
}

#[test]
fn on_a_radar() {
    all_consistent(&worlds::radar());
}

/// R four times too small: the classic.
#[test]
fn the_law_finds_an_optimist() {
    let (world, wrong) = (worlds::linear(2.0), worlds::linear(1.0));
    let kalman = Kalman::new(wrong.motion, wrong.sensor, wrong.prior).unwrap();
    assert!(consistent(&kalman, &wrong, &world).is_err());
    let settings = Settings { particles: 1000, ..Settings::default() };
    let particle = ParticleFilter::new(wrong.prior, wrong.motion, wrong.sensor, settings).unwrap();
    assert!(consistent(&particle, &wrong, &world).is_err());
}

/// R four times too large: errors are smaller than it says.
#[test]
fn the_law_finds_a_pessimist() {
    let (world, wrong) = (worlds::linear(2.0), worlds::linear(4.0));
    let kalman = Kalman::new(wrong.motion, wrong.sensor, wrong.prior).unwrap();
    assert!(consistent(&kalman, &wrong, &world).is_err());
}
