//! The first filter: a particle filter follows one target from ranges and bearings.
//!
//! Command: `cargo run --release -p zerre-examples --bin 01_first_filter`
//!
//! A filter is made of what is believed at the start, how the target moves and how the sensor sees it. Each
//! measurement changes the belief and says how well it was predicted (the log-evidence).
//!
//! Conclude: the filter errs less than the sensor at this distance (0.01 rad of 2 km are 20 m across), and its own
//! standard deviation says so before the truth is known.

use std::error::Error;
use zerre::belief::Gaussian;
use zerre::filter::{Filter, ParticleFilter, Settings};
use zerre::model::measurement::RangeBearing;
use zerre::model::motion::ConstantVelocity;
use zerre::model::simulate;
use zerre::rng::Stream;
use zerre::{Span, Time};

fn main() -> Result<(), Box<dyn Error>> {
    // The state is [x, y, vx, vy] in metres and metres per second.
    let prior = Gaussian::independent([1700.0, 900.0, -8.0, 8.0], [50.0, 50.0, 5.0, 5.0])?;
    let motion = ConstantVelocity::<2>::new(0.1)?; // the velocity wanders by sqrt(0.1 t) m/s in t seconds
    let radar = RangeBearing::new([0.0, 0.0], 10.0, 0.01)?; // at the origin; 10 m and 0.01 rad

    // A true path and what the radar says of it, every two seconds.
    let times: Vec<Time> = (1..=40).map(|k| Time::ZERO + Span::from_secs(2.0 * f64::from(k))).collect();
    let truth = simulate::path(&motion, [1700.0, 900.0, -12.0, 6.0], &times, Stream::new(5))?;
    let measured = simulate::measurements(&radar, &truth, &times, Stream::new(6))?;

    let filter =
        ParticleFilter::new(prior, motion, radar, Settings { particles: 5000, ..Settings::default() })?;
    let mut belief = filter.start(Time::ZERO, Stream::new(1))?;
    let (mut of_filter, mut of_sensor) = (0.0, 0.0);
    println!(" time    estimate x, y          sd     error  evidence");
    for ((z, x), time) in measured.iter().zip(&truth).zip(&times) {
        let update = filter.step(&mut belief, *time, Some(z))?;
        let (mean, covariance) = (belief.mean(), belief.covariance());
        let error = (mean[0] - x[0]).hypot(mean[1] - x[1]);
        let sd = (covariance.0[0][0] + covariance.0[1][1]).sqrt();
        let direct = (z[0] * z[1].cos() - x[0]).hypot(z[0] * z[1].sin() - x[1]);
        of_filter += error * error / times.len() as f64;
        of_sensor += direct * direct / times.len() as f64;
        if time.secs() % 16.0 == 0.0 {
            let [x, y, ..] = mean;
            let (t, evidence) = (time.secs(), update.log_evidence);
            println!("{t:>3} s  {x:8.1} {y:8.1} m  {sd:6.1} m  {error:6.1} m  {evidence:8.2}");
        }
    }
    println!("RMSE: filter {:.1} m, sensor alone {:.1} m", of_filter.sqrt(), of_sensor.sqrt());
    Ok(())
}
