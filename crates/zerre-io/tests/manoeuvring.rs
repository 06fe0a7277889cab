//! Filters with modes against one motion, on real recordings that neither has seen: noises and modes are learnt on the
//! first part of every target, and the rest is foretold one measurement ahead.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::Arc;
use zerre::Time;
use zerre::track::{
    DEFAULT_SENSOR, Noise, Plot, Reading, SensorSpec, TrackerSpec, Unknown, has_modes, learn,
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

/// Learns all that `filter` needs from the first part, and foretells the second, by target.
fn heldout(filter: &str, plots: &[(Plot, bool)]) -> BTreeMap<Arc<str>, Heldout> {
    let mut spec = TrackerSpec::new(filter, "constant-velocity");
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
    spec = learnt.spec;
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

/// `imm-ekf` against `ekf`, paired over targets: gain in log-evidence per plot, and in the logarithm of the root mean
/// square of the distance between what was foretold and what was measured; each with half its interval.
fn compare(name: &str, plots: &[(Plot, bool)]) -> [(f64, f64); 2] {
    let (one, modes) = (heldout("ekf", plots), heldout("imm-ekf", plots));
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
        "{name}: {} targets, {} plots held out; log-evidence per plot {:.3} -> {:.3}, per target {:+.3} +- {:.3}; \
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

/// Aircraft at ten-second intervals, some of them in circuits: modes are the better default by both measures.
#[test]
fn aircraft() {
    let Some(r) = recording("adsb_ais_uav/OpenSky_Plane_States.csv") else { return };
    for (gain, half) in compare("aircraft", &split(&r.plots)) {
        assert!(gain - half > 0.0, "{gain} +- {half}");
    }
}

/// Aircraft and vehicles on the ground, which stand and set off.
#[test]
fn airport() {
    let Some(r) = recording("lebl_smr/lebl_smr_28800_30600.csv") else { return };
    for (gain, half) in compare("airport", &split(&r.plots)) {
        assert!(gain - half > 0.0, "{gain} +- {half}");
    }
}
