//! What trackers do, whatever the filter; [`modes`] has those for manoeuvring targets, [`extended`] those of targets with
//! a shape.

mod extended;
mod modes;

use super::*;
use crate::catalog::{FILTERS, MOTIONS};
use crate::error::Error;
use crate::filter::Filter;
use crate::kernels::{Simd, Threads};
use crate::model::motion::ConstantVelocity;
use crate::model::simulate;
use crate::resample::Trigger;
use crate::rng::{Purpose, Stream};
use crate::time::Time;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::sync::Arc;

fn plot(id: &str, secs: f64, reading: Reading) -> Plot {
    Plot { time: Time::from_secs(secs), id: Some(Arc::from(id)), sensor: None, scan: None, line: 1, reading }
}

/// A specification in which nothing is left to tell.
fn spec(filter: &str, motion: &str, dimensions: usize) -> TrackerSpec {
    let mut spec = TrackerSpec::new(filter, motion);
    spec.dimensions = dimensions;
    spec.filter.particles = 300;
    spec.motion = MotionSpec {
        model: motion.to_owned(),
        speed_sd_mps: Some(3.0),
        acceleration_sd_mps2: Some(0.5),
        jerk_sd_mps3: Some(0.2),
        turn_rate_rad_s: Some(0.02),
        lateral_acceleration_mps2: Some(0.3),
        turn_rate_sd_rad_s: Some(0.05),
        turn_acceleration_sd_rad_s2: Some(0.01),
        tau_s: Some(10.0),
        size_sd_mps: Some(0.5),
        orientation_sd_rad_s: Some(0.05),
        modes: ModeSpec::default(),
    };
    let sensor = SensorSpec {
        position_m: [-100.0, 20.0, 0.0],
        position_sd_m: Some(2.0),
        range_sd_m: Some(3.0),
        bearing_sd_rad: Some(0.01),
        elevation_sd_rad: Some(0.01),
        range_rate_sd_mps: Some(0.5),
        size_sd_m: Some(3.0),
        orientation_sd_rad: Some(0.1),
        gate: None,
        robust: None,
    };
    spec.sensors.insert(DEFAULT_SENSOR.to_owned(), sensor);
    spec
}

/// Two targets on straight lines, seen by turns as positions.
fn two_targets(steps: usize) -> Vec<Plot> {
    let mut draws = Stream::new(3).draws(Purpose::Other, 0, 0);
    let mut plots = Vec::new();
    for k in 0..steps {
        let t = k as f64;
        for (id, x, y) in [("a", 10.0 * t, 3.0), ("b", -5.0, 40.0 + 7.0 * t)] {
            plots.push(plot(id, t, Reading::Position2([x + 2.0 * draws.normal(), y + 2.0 * draws.normal()])));
        }
    }
    plots
}

fn rows(spec: &TrackerSpec, engine: Engine, plots: &[Plot]) -> Vec<Row> {
    let mut tracker = spec.build(engine).unwrap();
    plots.iter().map(|p| tracker.push(p).unwrap()).collect()
}

#[test]
fn every_filter_follows_by_every_motion_that_it_takes() {
    for filter in FILTERS {
        for motion in MOTIONS.iter().filter(|m| !m.name.contains("growth")) {
            for dimensions in [2, 3] {
                let spec = spec(filter.name, motion.name, dimensions);
                let Ok(mut tracker) = spec.build(Engine::default()) else {
                    assert!(
                        dimensions == 3 && (motion.name.contains("turn") || has_size(motion.name)),
                        "{} {}",
                        filter.name,
                        motion.name
                    );
                    continue;
                };
                let curved = ["manoeuvre-turn", "wiener-turn", "markov-turn"].contains(&motion.name);
                for k in 0..10 {
                    let t = f64::from(k);
                    let reading = match dimensions {
                        2 => Reading::Position2([t, 5.0]),
                        _ => Reading::Position3([t, 5.0, 100.0]),
                    };
                    let row = match tracker.push(&plot("a", t, reading)) {
                        Ok(row) => row,
                        Err(Error::Unsupported(text)) => {
                            assert!(filter.name.ends_with("kalman") && curved, "{}: {text}", motion.name);
                            break;
                        }
                        Err(other) => panic!("{other}"),
                    };
                    assert!(!(filter.name.ends_with("kalman") && curved && k > 0));
                    assert_eq!(row.event, if k == 0 { Event::Started } else { Event::Updated });
                    assert_eq!(row.mean.len(), tracker.states().len());
                    assert_eq!(row.covariance.len(), row.mean.len() * row.mean.len());
                    // Ten times the deviation of a position.
                    assert!((row.mean[0] - t).abs() < 20.0, "{} {}: {row:?}", filter.name, motion.name);
                }
            }
        }
    }
}

/// A box of 30 by 25 m that goes round at .1 rad/s, seen as position and size in turn, from either end; now and then
/// without a size. Ten seconds after the start every filter knows its size to a metre or two (3 m of noise, thirty times)
/// and its direction, modulo half a turn, to some tenths.
#[test]
fn a_box_is_followed_by_its_size() {
    let mut draws = Stream::new(5).draws(Purpose::Other, 0, 0);
    let mut plots = Vec::new();
    for k in 0..60 {
        let (t, angle) = (f64::from(k), 0.1 * f64::from(k));
        let at = [100.0 * angle.sin() + draws.normal(), 100.0 * (1.0 - angle.cos()) + draws.normal()];
        plots.push(plot("a", t, Reading::Position2(at)));
        let end = if k % 2 == 0 { 0.0 } else { std::f64::consts::PI };
        let size =
            [30.0 + 3.0 * draws.normal(), 25.0 + 3.0 * draws.normal(), angle + end + 0.1 * draws.normal()];
        if k % 7 != 3 {
            plots.push(plot("a", t, Reading::Size(size)));
        }
    }
    for filter in ["ekf", "ukf", "cubature", "particle", "imm-ekf"] {
        let mut spec = spec(filter, "constant-velocity-box", 2);
        // What goes round accelerates by 1 m/s^2.
        spec.motion.acceleration_sd_mps2 = Some(1.0);
        spec.motion.orientation_sd_rad_s = Some(0.15);
        spec.filter.particles = 3000;
        let mut tracker = spec.build(Engine::default()).unwrap();
        for plot in &plots {
            let row = tracker.push(plot).unwrap();
            let t = plot.time.secs();
            if t < 10.0 {
                continue;
            }
            let [length, width, angle] = [4, 5, 6].map(|i| row.mean[i]);
            assert!((length - 30.0).abs() < 6.0 && (width - 25.0).abs() < 6.0, "{filter} {t}: {row:?}");
            let turned = 2.0 * (angle - 0.1 * t);
            assert!(turned.sin().atan2(turned.cos()).abs() / 2.0 < 0.4, "{filter} {t}: {angle}");
            // A row without a size corrects the position alone.
            assert!((row.mean[0] - 100.0 * (0.1 * t).sin()).abs() < 8.0, "{filter} {t}: {row:?}");
        }
    }
    let mut point = spec("ekf", "constant-velocity", 2).build(Engine::default()).unwrap();
    let refused = point.push(&plots[0]).and_then(|_| point.push(&plots[1])).unwrap_err();
    assert!(refused.to_string().contains("sizes need a motion of a box"), "{refused}");
}

#[test]
fn every_reading_finds_its_model() {
    for filter in ["ekf", "ukf", "particle"] {
        for robust in
            [None, Some(Robust::StudentT { dof: 4.0 }), Some(Robust::Outliers { share: 0.1, scale: 9.0 })]
        {
            for (dimensions, position, polar) in [
                (2, Reading::Position2([0.0, 20.0]), Reading::RangeBearing([100.0, 0.0])),
                (3, Reading::Position3([0.0, 20.0, 0.0]), Reading::RangeBearingElevation([100.0, 0.0, 0.0])),
            ] {
                let mut spec = spec(filter, "constant-velocity", dimensions);
                spec.sensors.get_mut(DEFAULT_SENSOR).unwrap().robust = robust;
                let mut tracker = spec.build(Engine::default()).unwrap();
                let readings =
                    [position, polar, Reading::Bearing(0.0), Reading::Range(100.0), Reading::RangeRate(0.0)];
                for (k, reading) in readings.into_iter().enumerate() {
                    let row = tracker.push(&plot("a", 0.1 * k as f64, reading)).unwrap();
                    assert_eq!(row.event, if k == 0 { Event::Started } else { Event::Updated });
                    if let Some(innovation) = row.innovation {
                        assert_eq!(innovation.whitened.len(), reading.values().len());
                        assert!(innovation.noise_share > 0.0 && innovation.noise_share <= 1.0);
                    }
                }
            }
        }
    }
}

#[test]
fn what_does_not_fit_is_refused_in_words() {
    let first = |spec: &TrackerSpec, reading| -> String {
        let pushed = spec.build(Engine::default()).and_then(|mut tracker| {
            tracker.push(&plot("a", 0.0, Reading::Position2([0.0, 0.0]))).ok();
            tracker.push(&plot("a", 1.0, reading))
        });
        pushed.unwrap_err().to_string()
    };
    let near = Reading::Position2([1.0, 1.0]);
    let cases = [
        (spec("kalman", "constant-velocity", 2), Reading::RangeBearing([5.0, 0.1]), "Kalman filter is exact"),
        (spec("kalman", "wiener-turn", 2), near, "nonlinear motion"),
        (spec("ekf", "constant-velocity", 2), Reading::Position3([1.0; 3]), "needs a motion in 3 dimensions"),
        (spec("ekf", "constant-velocity", 3), near, "needs a motion in 2 dimensions"),
        (
            spec("particle", "random-walk", 2),
            Reading::RangeRate(1.0),
            "range rates need a motion with velocity",
        ),
        (spec("particle", "growth", 2), near, "no sensor sees it"),
        (spec("particle", "wiener-turn", 3), near, "no form in 3 dimensions"),
        (spec("particle", "brisk-walk", 2), near, "no motion `brisk-walk`"),
        (spec("kallman", "singer", 2), near, "no filter `kallman`"),
        (TrackerSpec::new("ekf", "constant-velocity"), near, "acceleration_sd_mps2"),
    ];
    for (spec, reading, says) in cases {
        let text = first(&spec, reading);
        assert!(text.contains(says), "{text}");
    }
    let mut blind = spec("ekf", "constant-velocity", 2);
    blind.sensors.get_mut(DEFAULT_SENSOR).unwrap().bearing_sd_rad = None;
    assert!(first(&blind, Reading::Bearing(0.1)).contains("measures bearings, but"));
    for bad in [f64::NAN, f64::INFINITY] {
        assert!(
            first(&spec("ekf", "constant-velocity", 2), Reading::Position2([bad, 0.0])).contains("finite")
        );
    }
}

#[test]
fn targets_do_not_touch_each_other() {
    for filter in ["ukf", "particle"] {
        let spec = spec(filter, "constant-velocity", 2);
        let plots = two_targets(30);
        let together = rows(&spec, Engine::default(), &plots);
        for id in ["a", "b"] {
            let of = |row: &&Row| *row.id == *id;
            let own: Vec<Plot> = plots.iter().filter(|p| p.id.as_deref() == Some(id)).cloned().collect();
            let alone = rows(&spec, Engine::default(), &own);
            assert!(together.iter().filter(of).eq(&alone));
        }
    }
}

#[test]
fn neither_threads_nor_instructions_change_a_bit() {
    let mut spec = spec("particle", "constant-velocity", 2);
    // Enough blocks that a pool takes part.
    spec.filter.particles = 5000;
    let plots = two_targets(8);
    let reference = rows(&spec, Engine { simd: Simd::scalar(), threads: Threads::Serial }, &plots);
    for simd in Simd::available() {
        for threads in [1, 2, 4] {
            let threads = Threads::new(threads).unwrap();
            assert_eq!(rows(&spec, Engine { simd, threads }, &plots), reference, "{}", simd.name());
        }
    }
}

#[test]
fn saved_tracks_go_on_to_the_same_bits() {
    for filter in ["kalman", "particle", "sis"] {
        let spec = spec(filter, "constant-velocity", 2);
        let plots = two_targets(20);
        // After the first plot of `a`, during the warm-up, and later.
        for cut in [1, 3, 17] {
            let mut tracker = spec.build(Engine::default()).unwrap();
            plots[..cut].iter().for_each(|p| drop(tracker.push(p).unwrap()));
            let text = serde_json::to_string(&tracker.save()).unwrap();
            let saved: SavedTracker = serde_json::from_str(&text).unwrap();
            let mut other = saved.spec().build(Engine::default()).unwrap();
            other.restore(saved).unwrap();
            for p in &plots[cut..] {
                assert_eq!(tracker.push(p).unwrap(), other.push(p).unwrap());
            }
        }
    }
}

#[test]
fn other_versions_and_other_specifications_are_refused() {
    let tracker = spec("particle", "constant-velocity", 2).build(Engine::default()).unwrap();
    let text = serde_json::to_string(&tracker.save()).unwrap();
    let newer = text.replacen("\"version\":1", "\"version\":2", 1);
    let refusal = serde_json::from_str::<SavedTracker>(&newer).unwrap_err().to_string();
    assert!(refusal.contains("saved in version 2; this program reads 1"), "{refusal}");
    let mut other = spec("particle", "singer", 2).build(Engine::default()).unwrap();
    assert!(other.restore(tracker.save()).unwrap_err().to_string().contains("another configuration"));
}

#[test]
fn silence_ends_a_track_and_old_plots_are_not_used() {
    let mut tracker = spec("particle", "constant-velocity", 2).build(Engine::default()).unwrap();
    let mut push = |secs: f64| tracker.push(&plot("a", secs, Reading::Position2([0.0, 0.0]))).unwrap();
    assert_eq!(push(0.0).event, Event::Started);
    assert_eq!(push(300.0).event, Event::Updated);
    let row = push(86_700.0);
    assert_eq!((row.event, &*row.id), (Event::Started, "a#2"));
    let before = push(86_701.0);
    let late = push(86_699.0);
    assert_eq!((late.event, late.time, &late.mean), (Event::OutOfOrder, before.time, &before.mean));
    // Repeated times are updates over no time.
    assert_eq!(push(86_701.0).event, Event::Updated);
}

/// The second track of `a` and the first of `a#2` are told apart, by name and by random numbers, before a save and
/// after it.
#[test]
fn names_of_tracks_do_not_collide() {
    let spec = spec("particle", "constant-velocity", 2);
    let mut tracker = spec.build(Engine::default()).unwrap();
    let mut seen = std::collections::BTreeMap::new();
    for secs in [0.0, 100_000.0] {
        for id in ["a", "a#2", "a#2#1", "a#02", "a#"] {
            tracker.push(&plot(id, secs, Reading::Position2([0.0, 0.0]))).unwrap();
            let saved = serde_json::to_string(&tracker.save()).unwrap();
            tracker = spec.build(Engine::default()).unwrap();
            tracker.restore(serde_json::from_str(&saved).unwrap()).unwrap();
            let row = tracker.push(&plot(id, secs + 1.0, Reading::Position2([1.0, 0.0]))).unwrap();
            seen.insert(row.id.to_string(), row.mean);
        }
    }
    let names: Vec<&str> = seen.keys().map(String::as_str).collect();
    let want = ["a", "a#", "a##2", "a#02", "a#02#2", "a#2", "a#2#1", "a#2#1#1", "a#2#1#2", "a#2#2"];
    assert_eq!(names, want);
    let means: Vec<&Vec<f64>> = seen.values().collect();
    assert!((1..means.len()).all(|i| !means[..i].contains(&means[i])), "one stream for two tracks: {seen:?}");
}

#[test]
fn wild_plots_are_gated_and_lost_clouds_start_anew() {
    let mut gated = spec("particle", "constant-velocity", 2);
    gated.sensors.get_mut(DEFAULT_SENSOR).unwrap().gate = Some(0.999);
    let path = |k: usize, jump: f64| plot("a", k as f64, Reading::Position2([10.0 * k as f64 + jump, 0.0]));
    let follow = |spec: &TrackerSpec, last: usize| {
        let mut plots: Vec<Plot> = (0..10).map(|k| path(k, 0.0)).collect();
        plots.extend((10..=last).map(|k| path(k, 5000.0)));
        rows(spec, Engine::default(), &plots)
    };
    let row = follow(&gated, 10).pop().unwrap();
    assert_eq!(row.event, Event::Gated);
    assert!(row.mean[0] < 200.0 && row.update.unwrap().outcome == crate::filter::Outcome::Gated);
    // A narrow noise and few particles: the jump is beyond all of them.
    let mut open = spec("particle", "constant-velocity", 2);
    open.sensors.get_mut(DEFAULT_SENSOR).unwrap().position_sd_m = Some(0.1);
    let rows = follow(&open, 14);
    let restarted = rows.iter().position(|row| row.event == Event::Restarted).unwrap();
    assert!((10..=13).contains(&restarted));
    assert!((rows[14].mean[0] - 5140.0).abs() < 1.0, "{:?}", rows[14]);
}

/// The first plot is far off: its track refuses every later one, until so many were refused in a row that right models
/// would not do it (1e-9 at 0.999: three), or as many as the specification says.
#[test]
fn a_track_that_its_gate_locks_out_starts_anew() {
    let path = |k: usize, jump: f64| plot("a", k as f64, Reading::Position2([10.0 * k as f64 + jump, 0.0]));
    let off: Vec<Plot> = (0..40).map(|k| path(k, if k == 0 { 3000.0 } else { 0.0 })).collect();
    let restart = |rows: &[Row]| -> Vec<usize> {
        (0..rows.len()).filter(|&k| rows[k].event == Event::Restarted).collect()
    };
    for filter in ["kalman", "ekf", "ukf", "particle"] {
        for (gate, setting, at) in
            [(0.999, None, 3), (0.99, None, 5), (0.999_999, None, 3), (0.999, Some(7), 7)]
        {
            let mut spec = spec(filter, "constant-velocity", 2);
            spec.start.speed_sd_mps = 5.0;
            spec.life.restart_after_gated = setting;
            spec.sensors.get_mut(DEFAULT_SENSOR).unwrap().gate = Some(gate);
            let rows = rows(&spec, Engine::default(), &off);
            assert_eq!(restart(&rows), [at], "{filter} {gate}");
            let given_up = rows[at].update.unwrap().outcome;
            assert_eq!(given_up, crate::filter::Outcome::Gated);
            assert!(rows[1..at].iter().all(|row| row.event == Event::Gated), "{filter}");
            assert!(rows[at + 1..].iter().all(|row| row.event == Event::Updated), "{filter}");
            assert!((rows[39].mean[0] - 390.0).abs() < 1.0, "{filter}: {:?}", rows[39].mean);
        }
    }
    // Wild measurements with good ones between them, and many of one time, are no lost track.
    let mut spec = spec("ekf", "constant-velocity", 2);
    spec.sensors.get_mut(DEFAULT_SENSOR).unwrap().gate = Some(0.999);
    let wild: Vec<Plot> = (0..60).map(|k| path(k, if k > 9 && k % 3 != 0 { 3000.0 } else { 0.0 })).collect();
    let events = rows(&spec, Engine::default(), &wild);
    assert!(restart(&events).is_empty() && events.iter().filter(|r| r.event == Event::Gated).count() == 34);
    let mut burst: Vec<Plot> = (0..10).map(|k| path(k, 0.0)).collect();
    burst.extend((0..6).map(|_| path(10, 3000.0)));
    let events = rows(&spec, Engine::default(), &burst);
    assert!(restart(&events).is_empty() && events[10..].iter().all(|r| r.event == Event::Gated));
}

#[test]
fn bearings_start_where_the_configuration_says() {
    let mut spec = spec("particle", "constant-velocity", 2);
    let first = plot("a", 0.0, Reading::Bearing(0.2));
    let row = spec.build(Engine::default()).unwrap().push(&first).unwrap();
    assert_eq!((row.event, row.mean.len()), (Event::Waiting, 0));
    spec.start.position = Some(([0.0; 3], 50.0));
    let row = spec.build(Engine::default()).unwrap().push(&first).unwrap();
    assert_eq!(row.event, Event::Started);
    // The bearing was used: seen from (-100, 20) it lifts the mean above the line of bearing zero.
    assert!(row.update.unwrap().log_evidence < 0.0 && row.mean[1] > 20.0);
}

#[test]
fn one_particle_is_enough() {
    let mut spec = spec("particle", "constant-velocity", 2);
    spec.filter.particles = 1;
    for row in rows(&spec, Engine::default(), &two_targets(10)) {
        assert!(row.mean.iter().chain(&row.covariance).all(|v| v.is_finite()));
    }
}

/// 400 positions of a path drawn from the model. Standard error of ln sd is about 1 / sqrt(2 x 800) = 0.025 for the
/// measurement if all innovations told of it alone; of two numbers that share the innovations each is known at best
/// three times worse, so 0.3 is four standard errors.
#[test]
fn noises_are_learnt_from_a_recording_that_has_them() {
    let (sd, wander) = (4.0, 0.7);
    let motion = ConstantVelocity::<2>::new(wander * wander).unwrap();
    let times: Vec<Time> = (0..400).map(|k| Time::from_secs(f64::from(k))).collect();
    let path = simulate::path(&motion, [0.0, 0.0, 9.0, -3.0], &times, Stream::new(5)).unwrap();
    let mut draws = Stream::new(6).draws(Purpose::Other, 0, 0);
    let plots: Vec<Plot> = times
        .iter()
        .zip(&path)
        .map(|(time, x)| {
            let z = [x[0] + sd * draws.normal(), x[1] + sd * draws.normal()];
            plot("a", time.secs(), Reading::Position2(z))
        })
        .collect();
    let mut spec = TrackerSpec::new("particle", "constant-velocity");
    spec.sensors.insert(DEFAULT_SENSOR.to_owned(), SensorSpec::default());
    let unknown = [Unknown::Sensor(DEFAULT_SENSOR.to_owned(), Noise::Position), Unknown::Motion];
    let learnt = learn(&spec, &unknown, &plots).unwrap();
    for (found, truth) in learnt.values.iter().zip([sd, wander]) {
        assert!((found / truth).ln().abs() < 0.3, "{found} {truth}");
    }
    assert_eq!((learnt.plots, learnt.targets, learnt.heavy_tails), (400, 1, None));
    // Deterministic, and refused where there is nothing to learn from.
    assert_eq!(learn(&spec, &unknown, &plots).unwrap().values, learnt.values);
    assert!(learn(&spec, &unknown, &plots[..1]).is_err());
}

#[test]
fn hashes_are_those_of_the_standard() {
    // Test vectors of draft-eastlake-fnv: FNV-1a, 64 bits.
    assert_eq!(stable_hash(""), 0xcbf2_9ce4_8422_2325);
    assert_eq!(stable_hash("a"), 0xaf63_dc4c_8601_ec8c);
    assert_eq!(stable_hash("foobar"), 0x8594_4171_f739_67e8);
}

/// The tracker does with one target what the filter does.
#[test]
fn the_edge_computes_what_the_inside_does() {
    let spec = spec("kalman", "constant-velocity", 2);
    let plots: Vec<Plot> = two_targets(20).into_iter().filter(|p| p.id.as_deref() == Some("a")).collect();
    let rows = rows(&spec, Engine::default(), &plots);
    let prior = {
        let Reading::Position2([x, y]) = plots[0].reading else { panic!() };
        crate::belief::Gaussian::independent([x, y, 0.0, 0.0], [2.0, 2.0, 30.0, 30.0]).unwrap()
    };
    let sensor = crate::model::measurement::Position::<2>::new(2.0).unwrap();
    let motion = ConstantVelocity::<2>::new(0.25).unwrap();
    let filter = crate::filter::Kalman::new(motion, sensor, prior).unwrap();
    let mut belief = filter.start(plots[0].time, Stream::new(1)).unwrap();
    for (plot, row) in plots.iter().zip(&rows).skip(1) {
        let Reading::Position2(z) = plot.reading else { panic!() };
        let update = filter.step(&mut belief, plot.time, Some(&z)).unwrap();
        assert_eq!((row.update, &row.mean[..]), (Some(update), &belief.state.mean()[..]));
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        rng_seed: RngSeed::Fixed(6),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    /// Whatever is pushed: a row or a refusal, and numbers that are numbers.
    #[test]
    fn any_plot_is_taken_or_refused(
        steps in prop::collection::vec((0usize..9, prop::num::f64::ANY, -3.0e3..3.0e3, -4.0..4.0, -5.0..400.0), 1..25),
        filter in 0usize..7,
        motion in prop::sample::select(vec!["constant-velocity", "constant-velocity-box"]),
    ) {
        let names = ["ekf", "ukf", "particle", "sis", "mmpf", "imm-pf", "rb-mmpf"];
        let mut spec = spec(names[filter], motion, 2);
        spec.filter.particles = 40;
        let mut tracker = spec.build(Engine::default()).unwrap();
        let mut time: f64 = 0.0;
        for (kind, wild, near, angle, dt) in steps {
            time += dt;
            let reading = match kind {
                0 => Reading::Position2([near, near]),
                1 => Reading::RangeBearing([f64::abs(near), angle]),
                2 => Reading::Bearing(angle),
                3 => Reading::Range(wild),
                4 => Reading::RangeRate(near),
                5 => Reading::Position2([wild, near]),
                6 => Reading::Size([near, 5.0, angle]),
                7 => Reading::Size([near, wild, angle]),
                _ => Reading::RangeBearing([near, wild]),
            };
            if let Ok(row) = tracker.push(&plot("a", time, reading)) {
                prop_assert!(row.mean.iter().chain(&row.covariance).all(|v| v.is_finite()));
            }
        }
    }
}
