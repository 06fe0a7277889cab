//! Filters with modes against one motion, on real recordings that neither has seen: noises and modes are learnt on the
//! first part of every target, and the rest is foretold one measurement ahead.

use std::collections::BTreeMap;
use std::path::PathBuf;
use zerre::track::{DEFAULT_SENSOR, Noise, Plot, Row, TrackerSpec, Unknown, has_modes, learn};
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
fn heldout(filter: &str, noises: &[Noise], plots: &[(Plot, bool)]) -> BTreeMap<String, Heldout> {
    let mut spec = TrackerSpec::new(filter, "constant-velocity");
    spec.start.speed_sd_mps = 100.0;
    let mut unknown: Vec<Unknown> =
        noises.iter().map(|&noise| Unknown::Sensor(DEFAULT_SENSOR.to_owned(), noise)).collect();
    unknown.push(Unknown::Motion);
    if has_modes(filter) {
        unknown.extend([Unknown::Stay, Unknown::TurnRate, Unknown::Manoeuvre]);
    }
    let first: Vec<Plot> = plots.iter().filter(|(_, learnt)| *learnt).map(|(plot, _)| plot.clone()).collect();
    let since = std::time::Instant::now();
    let learnt = learn(&spec, &unknown, &first).unwrap();
    eprintln!("{filter}: {:?} {:?}, {:?}, {:.1?}", unknown, learnt.values, learnt.heavy_tails, since.elapsed());
    let mut tracker = learnt.spec.build(Default::default()).unwrap();
    let mut found: BTreeMap<String, Heldout> = BTreeMap::new();
    let mut last: BTreeMap<String, Row> = BTreeMap::new();
    for (plot, learnt) in plots {
        let id = plot.id.as_deref().unwrap().to_owned();
        let place = tracker.place(plot).unwrap();
        let row = tracker.push(plot).unwrap();
        if !learnt
            && let Some(before) = last.get(&id).filter(|before| before.id == row.id)
            && let Some(update) = row.update
        {
            // Both filters foretell the mean of a mixture of straight lines and turns; the belief's mean after the plot
            // less its correction is not kept, so the distance is that of the innovation, which is in metres here.
            let _ = before;
            let one = found.entry(id.clone()).or_default();
            one.plots += 1.0;
            one.log_evidence += update.log_evidence;
            let _ = place;
        }
        last.insert(id, row);
    }
    found
}
