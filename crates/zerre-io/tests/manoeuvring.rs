//! Filters with modes against one motion, on real recordings that neither has seen: noises and modes are learnt on the
//! first part of every target, and the rest is foretold one measurement ahead.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;
use zerre::Time;
use zerre::track::{
    DEFAULT_SENSOR, FilterSpec, HEAVY_TAILS, Noise, Plot, Reading, Robust, SensorSpec, TrackerSpec, Unknown,
    has_modes, learn,
};
use zerre_io::{Options, Recording};

/// A file of the large recordings; `None`, with a message, where there are none. Continuous integration must have
/// them.
fn recording(path: &str) -> Option<Recording> {
    let beside = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let file = std::env::var_os("ZERRE_DATA").map_or_else(beside, PathBuf::from).join(path);
    if file.exists() {
        return Some(Recording::open(&file, &Options::default()).unwrap());
    }
    let message = format!("no recording {}: set ZERRE_DATA to the folder that holds it", file.display());
    assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "{message}");
    eprintln!("SKIPPED: {message}");
    None
}

/// What a filter made of the held-out plots of one target.
#[derive(Clone, Copy, Default)]
struct Heldout {
    plots: f64,
    log_evidence: f64,
    /// Sum of squared distances between what was foretold and what was measured, m^2.
    square: f64,
}

/// Share of each target's plots that is learnt from.
const LEARNT: f64 = 0.6;
/// Targets with fewer plots say nothing of manoeuvres.
const LEAST_PLOTS: usize = 15;

/// The plots of targets with enough of them, in order of time, each marked with whether it is learnt from.
fn split(plots: &[Plot]) -> Vec<(Plot, bool)> {
    let mut total: BTreeMap<_, usize> = BTreeMap::new();
    plots.iter().for_each(|p| *total.entry(p.id.clone()).or_default() += 1);
    let mut seen: BTreeMap<_, usize> = BTreeMap::new();
    let enough = plots.iter().filter(|p| total[&p.id] >= LEAST_PLOTS);
    enough
        .map(|plot| {
            let nth = seen.entry(plot.id.clone()).or_default();
            *nth += 1;
            (plot.clone(), *nth as f64 <= LEARNT * total[&plot.id] as f64)
        })
        .collect()
}

/// All that `filter` needs, learnt from the first part under normal errors, or under the `robust` law.
fn learnt(filter: &str, robust: Option<Robust>, plots: &[(Plot, bool)]) -> TrackerSpec {
    let mut spec = TrackerSpec::new(filter, "constant-velocity");
    if robust.is_some() {
        spec.sensors.insert(DEFAULT_SENSOR.to_owned(), SensorSpec { robust, ..SensorSpec::default() });
    }
    let noises: BTreeSet<Noise> = plots.iter().flat_map(|(p, _)| Noise::of(&p.reading)).copied().collect();
    let of_sensor = |noise| Unknown::Sensor(DEFAULT_SENSOR.to_owned(), noise);
    let mut unknown: Vec<Unknown> = noises.into_iter().map(of_sensor).collect();
    unknown.push(Unknown::Motion);
    if has_modes(filter) {
        unknown.extend([Unknown::Stay, Unknown::TurnRate, Unknown::Manoeuvre]);
    }
    let first: Vec<Plot> = plots.iter().filter(|(_, learnt)| *learnt).map(|(plot, _)| plot.clone()).collect();
    let learnt = learn(&spec, &unknown, &first).unwrap();
    eprintln!("{filter}: {unknown:?} are {:?}, {:?}", learnt.values, learnt.heavy_tails);
    learnt.spec
}

/// Foretells the second part of every target with `filter` and the numbers of `spec`.
fn heldout(filter: &str, spec: &TrackerSpec, plots: &[(Plot, bool)]) -> BTreeMap<Arc<str>, Heldout> {
    let mut spec = spec.clone();
    spec.filter.name = filter.to_owned();
    spec.filter.particles = FilterSpec::default_particles(filter);
    // A sensor that tells nothing: its plots show what the belief foretells, and leave it as it is to fourteen digits.
    let blind = SensorSpec { position_sd_m: Some(1e9), ..SensorSpec::default() };
    spec.sensors.insert("blind".to_owned(), blind);
    let mut tracker = spec.build(Default::default()).unwrap();
    let mut found: BTreeMap<Arc<str>, Heldout> = BTreeMap::new();
    let mut last: BTreeMap<Arc<str>, Time> = BTreeMap::new();
    for (plot, learnt) in plots {
        let id = plot.id.clone().unwrap();
        let before = last.insert(id.clone(), plot.time);
        let followed = before.is_some_and(|before| plot.time - before <= spec.life.max_gap);
        let foretold = followed.then(|| {
            let reading = Reading::Position2([0.0, 0.0]);
            let ahead = Plot { sensor: Some(Arc::from("blind")), reading, ..plot.clone() };
            tracker.push(&ahead).unwrap().mean
        });
        let row = tracker.push(plot).unwrap();
        if let (Some(foretold), Some(update), false) = (foretold, row.update, learnt) {
            let [x, y] = tracker.place(plot).unwrap();
            let one = found.entry(id).or_default();
            one.plots += 1.0;
            one.log_evidence += update.log_evidence;
            one.square += (foretold[0] - x).powi(2) + (foretold[1] - y).powi(2);
        }
    }
    found
}

/// Mean of `values` and half the width of its 95 % interval; a normal quantile, for twenty and more targets.
fn interval(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, 1.96 * (variance / n).sqrt())
}

/// What a filter with modes gains on one without, paired over targets: log-evidence per plot, and the
/// logarithm of the root mean square of the distance between what was foretold and what was measured; each
/// with half its interval.
fn gains(
    what: &str,
    one: &BTreeMap<Arc<str>, Heldout>,
    modes: &BTreeMap<Arc<str>, Heldout>,
) -> [(f64, f64); 2] {
    let pairs: Vec<_> =
        one.iter().map(|(id, one)| (one, &modes[id])).filter(|(a, _)| a.plots >= 5.0).collect();
    let gains: Vec<f64> = pairs.iter().map(|(a, b)| (b.log_evidence - a.log_evidence) / a.plots).collect();
    let nearer: Vec<f64> = pairs.iter().map(|(a, b)| 0.5 * (a.square / b.square).ln()).collect();
    let sum = |of: fn(&Heldout) -> f64, of_modes: bool| {
        pairs.iter().map(|(a, b)| of(if of_modes { b } else { a })).sum::<f64>()
    };
    let rms = |of_modes| (sum(|h| h.square, of_modes) / sum(|h| h.plots, of_modes)).sqrt();
    let (gain, near) = (interval(&gains), interval(&nearer));
    eprintln!(
        "{what}: {} targets, {} plots held out; nats per plot {:.3} -> {:.3}, per target {:+.3} +- {:.3}; \
         one step ahead {:.1} m -> {:.1} m rms, per target {:+.1} % +- {:.1} %",
        pairs.len(),
        sum(|h| h.plots, false),
        sum(|h| h.log_evidence, false) / sum(|h| h.plots, false),
        sum(|h| h.log_evidence, true) / sum(|h| h.plots, true),
        gain.0,
        gain.1,
        rms(false),
        rms(true),
        100.0 * near.0,
        100.0 * near.1,
    );
    [gain, near]
}

/// Each filter of the Kalman family with modes against the one without, under normal errors and under heavy
/// tails, and the Rao-Blackwellised one against `imm-ukf`, whose numbers it takes.
///
/// Modes are the better default: clearly more evidence under either law, and under normal errors a smaller
/// error one step ahead. Under heavy tails a turn may pass for outliers at first, so that nothing is said of
/// that error. Going through histories of modes neither gains nor loses more than a tenth of what modes do.
fn modes_gain(name: &str, plots: &[Plot]) {
    let plots = &split(plots);
    for robust in [None, Some(HEAVY_TAILS)] {
        let law = if robust.is_some() { "heavy tails" } else { "normal errors" };
        let (one, modes) = (learnt("ekf", robust, plots), learnt("imm-ekf", robust, plots));
        let mut evidence = 0.0;
        for (plain, modal) in [("ekf", "imm-ekf"), ("ukf", "imm-ukf")] {
            let what = format!("{name}, {law}, {plain} -> {modal}");
            let [more, nearer] = gains(&what, &heldout(plain, &one, plots), &heldout(modal, &modes, plots));
            assert!(more.0 - more.1 > 0.0, "{what}: {more:?}");
            assert!(robust.is_some() || nearer.0 - nearer.1 > 0.0, "{what}: {nearer:?}");
            evidence = more.0;
        }
        let what = format!("{name}, {law}, imm-ukf -> rb-mmpf");
        let [more, _] = gains(&what, &heldout("imm-ukf", &modes, plots), &heldout("rb-mmpf", &modes, plots));
        assert!(more.0.abs() < 0.1 * evidence, "{what}: {more:?}");
    }
}

/// Aircraft at ten-second intervals, some of them in circuits.
#[test]
fn aircraft() {
    let Some(r) = recording("adsb_ais_uav/OpenSky_Plane_States.csv") else { return };
    modes_gain("aircraft", &r.plots);
}

/// Aircraft and vehicles on the ground, which stand and set off.
#[test]
fn airport() {
    let Some(r) = recording("lebl_smr/lebl_smr_28800_30600.csv") else { return };
    modes_gain("airport", &r.plots);
}
