//! Reading a CSV: two vessels in a real harbour radar recording, followed and scored against satellite positions.
//!
//! Command: `cargo run --release -p zerre-examples --bin 05_reading_csv`
//!
//! `zerre-io` reads the table: columns carry their units, time is exact, bad rows are counted. Each identity gets its
//! own filter, started from its first plot. `zerre track data/ferry_radar.csv --truth data/ferry_truth.csv` does the
//! same and more.
//!
//! Picture: `report.html` of that command shows both tracks over the plots.
//!
//! Conclude: most of the error of these plots is an offset that stays (a radar sees the side of a hull, the receiver
//! stands elsewhere), which no filter of noise removes: look at the offset before you tune. What the filter adds is
//! the velocity, which the radar does not measure; differences of plots err twice as much.

use std::collections::BTreeMap;
use std::error::Error as StdError;
use std::path::Path;
use std::sync::Arc;
use zerre::belief::{Gaussian, GaussianBelief};
use zerre::filter::{Filter, Kalman};
use zerre::model::measurement::Position;
use zerre::model::motion::ConstantVelocity;
use zerre::rng::Stream;
use zerre::track::Reading;
use zerre::{Span, Time};
use zerre_io::{Options, Recording, Trajectories};
use zerre_lab::metric::rmse;

type Vessel = Kalman<ConstantVelocity<2>, Position<2>, 4, 4, 2>;

/// Follows one vessel, and keeps what it said beside the truth.
struct Track {
    filter: Vessel,
    belief: GaussianBelief<4>,
    last: ([f64; 2], Time),
    scored: Vec<Scored>,
}

/// Positions in metres and velocities in metres per second at one instant.
struct Scored {
    plot: [f64; 2],
    estimate: [f64; 2],
    truth: [f64; 2],
    differences: [f64; 2],
    velocity: [f64; 2],
    true_velocity: [f64; 2],
}

/// A filter that starts at the first plot, with any speed that a vessel has.
fn started([x, y]: [f64; 2]) -> zerre::Result<Vessel> {
    let prior = Gaussian::independent([x, y, 0.0, 0.0], [2.0, 2.0, 5.0, 5.0])?;
    Kalman::new(ConstantVelocity::<2>::new(0.1)?, Position::<2>::new(2.0)?, prior)
}

/// The change from `a` to `b` per second.
fn rate(a: [f64; 2], b: [f64; 2], over: Span) -> [f64; 2] {
    [0, 1].map(|i| (b[i] - a[i]) / over.secs())
}

fn main() -> Result<(), Box<dyn StdError>> {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data");
    let recording = Recording::open(&data.join("ferry_radar.csv"), &Options::default())?;
    let truth = Trajectories::open(&data.join("ferry_truth.csv"), &Options::default())?;
    println!("{} rows, {} used", recording.summary.counts.read, recording.summary.counts.used);

    let mut tracks: BTreeMap<Arc<str>, Track> = BTreeMap::new();
    for plot in &recording.plots {
        let (Some(id), Reading::Position2(z)) = (&plot.id, plot.reading) else { continue };
        let Some(track) = tracks.get_mut(id) else {
            let filter = started(z)?;
            // The Kalman filter draws no random numbers: any stream will do.
            let belief = filter.start(plot.time, Stream::new(1))?;
            let last = (z, plot.time);
            tracks.insert(id.clone(), Track { filter, belief, last, scored: Vec::new() });
            continue;
        };
        track.filter.step(&mut track.belief, plot.time, Some(&z))?;
        let (before, at) = std::mem::replace(&mut track.last, (z, plot.time));
        // The truth is known at the times of the radar: its velocity is the slope over two seconds.
        let [earlier, now, later] = [-1.0, 0.0, 1.0].map(|s| {
            let [x, y, _] = truth.by_id.get(id)?.at(plot.time + Span::from_secs(s), Span::from_secs(5.0))?;
            Some([x, y])
        });
        let (Some(earlier), Some(now), Some(later)) = (earlier, now, later) else { continue };
        let [x, y, vx, vy] = *track.belief.state.mean();
        track.scored.push(Scored {
            plot: z,
            estimate: [x, y],
            truth: now,
            differences: rate(before, z, plot.time - at),
            velocity: [vx, vy],
            true_velocity: rate(earlier, later, Span::from_secs(2.0)),
        });
    }

    println!(
        "vessel  instants    position: plots   of it offset    filter     velocity: differences    filter"
    );
    for (id, Track { scored, .. }) in &tracks {
        let column = |of: fn(&Scored) -> [f64; 2]| scored.iter().map(of).collect::<Vec<_>>();
        let (truth, true_velocity) = (column(|s| s.truth), column(|s| s.true_velocity));
        let error = |rows: &[[f64; 2]], truth: &[[f64; 2]]| rmse(rows, truth).map(|found| found.pooled);
        let offset =
            [0, 1].map(|i| scored.iter().map(|s| s.plot[i] - s.truth[i]).sum::<f64>() / scored.len() as f64);
        println!(
            "{id:>6} {:9} {:15.2} m {:12.2} m {:7.2} m {:19.2} m/s {:5.2} m/s",
            scored.len(),
            error(&column(|s| s.plot), &truth)?,
            offset[0].hypot(offset[1]),
            error(&column(|s| s.estimate), &truth)?,
            error(&column(|s| s.differences), &true_velocity)?,
            error(&column(|s| s.velocity), &true_velocity)?,
        );
    }
    Ok(())
}
