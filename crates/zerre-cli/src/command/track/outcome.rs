//! What came of a run: tracks, sensors, degeneracies, and how they are told.

use super::Call;
use super::input::Input;
use super::scores::Scores;
use super::settings::{Settings, counted};
use super::work::{Reference, Run, TOLERABLE_LOSS};
use crate::diagnostic::Diagnostic;
use crate::run::{EstimatesDigest, Record};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;
use zerre::Time;
use zerre::extended::Ellipse;
use zerre::filter::Outcome as Step;
use zerre::track::{Body, DEFAULT_SENSOR, Event, Interval, Mode, Plot, Reading, Row, State, TrackerSpec};
use zerre_io::{Component, EllipseRow, LikelyMode, TrackRow, TrackTable, Unit};
use zerre_lab::consistency::{Assessment, SensorInnovations, WhitenedComponent, assess};
use zerre_lab::number;

/// One track.
pub(super) struct Track {
    pub id: Arc<str>,
    pub start: Time,
    pub end: Time,
    /// Measurements that were used, the first one too.
    pub updates: u64,
    /// Measurements that were not.
    pub missed: u64,
    /// What else happened.
    pub events: BTreeMap<Event, u64>,
    /// Its rows in the order of time: index of the plot, row.
    pub rows: Vec<usize>,
}

/// One kind of reading of one sensor.
pub(super) struct Sensor {
    pub name: String,
    pub components: &'static [&'static str],
    /// Whether its law of errors has heavy tails.
    pub heavy_tails: bool,
    /// Probability inside its gate, where it has one.
    pub gate: Option<f64>,
    pub used: u64,
    pub gated: u64,
    /// Of the gated ones those for which the track was given up: they say nothing of the sensor.
    lost: u64,
    pub assessment: Option<Assessment>,
}

pub(super) struct Outcome {
    pub tracks: Vec<Track>,
    pub sensors: Vec<Sensor>,
    /// Place of each plot's sensor in `sensors`.
    pub sensor_of: Vec<usize>,
    pub events: BTreeMap<Event, u64>,
    pub log_evidence: f64,
    /// Whether a row's innovation is judged: not while the first measurements still fix the state, and not of a
    /// measurement that the gate refused.
    pub judged: Vec<bool>,
    /// How often a track was given up because its gate let nothing in any more, and started anew.
    locked_out: u64,
    /// Of extended targets: scans of a single point.
    lone_points: u64,
    pub out_of_order: u64,
    repeated: u64,
}

/// What the numbers of a reading are.
fn components(reading: &Reading) -> (&'static str, &'static [&'static str]) {
    match reading {
        Reading::Position2(_) => ("position", &["x", "y"]),
        Reading::Position3(_) => ("position", &["x", "y", "z"]),
        Reading::RangeBearing(_) => ("range and bearing", &["range", "bearing"]),
        Reading::RangeBearingElevation(_) => {
            ("range, bearing and elevation", &["range", "bearing", "elevation"])
        }
        Reading::Bearing(_) => ("bearing", &["bearing"]),
        Reading::Range(_) => ("range", &["range"]),
        Reading::RangeRate(_) => ("range rate", &["range rate"]),
        Reading::Size(_) => ("size", &["length", "width", "orientation"]),
        _ => ("reading", &[]),
    }
}

/// What is done about an event, in a word or two; `None` for what is as it should be.
fn action(event: Event) -> Option<&'static str> {
    match event {
        Event::Gated | Event::Degenerate => Some("predicted"),
        Event::Restarted => Some("belief started anew from the measurement"),
        Event::OutOfOrder | Event::Waiting => Some("not used"),
        _ => None,
    }
}

impl Outcome {
    pub fn of(run: &Run, input: &Input, spec: &TrackerSpec) -> Result<Outcome, Diagnostic> {
        let mut tracks: BTreeMap<Arc<str>, Track> = BTreeMap::new();
        let mut places: BTreeMap<(Option<&str>, &str), usize> = BTreeMap::new();
        let mut sensors: Vec<Sensor> = Vec::new();
        let mut outcome = Outcome {
            tracks: Vec::new(),
            sensors: Vec::new(),
            sensor_of: Vec::with_capacity(input.plots.len()),
            events: BTreeMap::new(),
            log_evidence: 0.0,
            judged: vec![false; input.plots.len()],
            locked_out: 0,
            lone_points: input.points.iter().filter(|points| points.len() == 1).count() as u64,
            out_of_order: input.out_of_order,
            repeated: input.repeated,
        };
        let fixing = orders(&run.states);
        // Measurements used since the belief of a track was last started.
        let mut since: BTreeMap<Arc<str>, u64> = BTreeMap::new();
        // Sensors of the measurements in a row that the gate of a track refused.
        let mut refused_in_a_row: BTreeMap<Arc<str>, Vec<usize>> = BTreeMap::new();
        for (index, plot) in input.plots.iter().enumerate() {
            let (kind, names) = match components(&plot.reading) {
                (_, names) if !input.points.is_empty() => ("mean of the points", names),
                told => told,
            };
            let place = *places.entry((plot.sensor.as_deref(), kind)).or_insert_with(|| {
                let name = match plot.sensor.as_deref() {
                    Some(sensor) => format!("{sensor}, {kind}"),
                    None => kind.to_owned(),
                };
                let told = plot
                    .sensor
                    .as_deref()
                    .and_then(|name| spec.sensors.get(name))
                    .or_else(|| spec.sensors.get(DEFAULT_SENSOR));
                sensors.push(Sensor {
                    name,
                    components: names,
                    heavy_tails: told.is_some_and(|sensor| sensor.robust.is_some()),
                    gate: told.and_then(|sensor| sensor.gate).filter(|&inside| inside > 0.0),
                    used: 0,
                    gated: 0,
                    lost: 0,
                    assessment: None,
                });
                sensors.len() - 1
            });
            outcome.sensor_of.push(place);
            let Some(row) = &run.rows[index] else { continue };
            *outcome.events.entry(row.event).or_default() += 1;
            let used = matches!(row.event, Event::Started | Event::Updated | Event::Restarted);
            sensors[place].used += u64::from(used);
            let refused = row.update.is_some_and(|update| update.outcome == Step::Gated);
            sensors[place].gated += u64::from(refused);
            let in_a_row = refused_in_a_row.entry(Arc::clone(&row.id)).or_default();
            if refused {
                in_a_row.push(place);
            }
            if refused && row.event == Event::Restarted {
                outcome.locked_out += 1;
                in_a_row.iter().for_each(|&place| sensors[place].lost += 1);
            }
            if used {
                in_a_row.clear();
            }
            outcome.log_evidence += evidence(row).unwrap_or(0.0);
            if row.mean.is_empty() {
                continue;
            }
            let track = tracks.entry(Arc::clone(&row.id)).or_insert_with(|| Track {
                id: Arc::clone(&row.id),
                start: row.time,
                end: row.time,
                updates: 0,
                missed: 0,
                events: BTreeMap::new(),
                rows: Vec::new(),
            });
            track.end = track.end.max(row.time);
            track.updates += u64::from(used);
            track.missed += u64::from(!used);
            if action(row.event).is_some() {
                *track.events.entry(row.event).or_default() += 1;
            }
            let since = since.entry(Arc::clone(&row.id)).or_default();
            *since = match row.event {
                Event::Started | Event::Restarted => 1,
                _ => *since + u64::from(used),
            };
            outcome.judged[index] = *since > fixing && !refused && row.innovation.is_some();
            track.rows.push(index);
        }
        outcome.sensors = sensors;
        outcome.tracks = tracks.into_values().collect();
        outcome.assess(run)?;
        Ok(outcome)
    }

    /// Judges the innovations of every sensor.
    fn assess(&mut self, run: &Run) -> Result<(), Diagnostic> {
        for (place, sensor) in self.sensors.iter_mut().enumerate() {
            let names = sensor.components;
            let mut all = SensorInnovations {
                sensor: sensor.name.clone(),
                dimension: names.len().max(1),
                heavy_tails_expected: sensor.heavy_tails,
                gate: sensor.gate,
                refused: (sensor.gated - sensor.lost) as usize,
                components: names
                    .iter()
                    .map(|name| WhitenedComponent { name: (*name).to_owned(), series: Vec::new() })
                    .collect(),
                ..SensorInnovations::default()
            };
            let mut share = 0.0;
            for track in &self.tracks {
                let of_track: Vec<_> = track
                    .rows
                    .iter()
                    .filter(|&&index| self.judged[index] && self.sensor_of[index] == place)
                    .filter_map(|&index| run.rows[index].as_ref()?.innovation.as_ref())
                    .collect();
                for (c, component) in all.components.iter_mut().enumerate() {
                    component.series.push(
                        of_track
                            .iter()
                            .filter_map(|innovation| innovation.whitened.get(c).copied())
                            .collect(),
                    );
                }
                all.nis.extend(of_track.iter().map(|innovation| innovation.nis));
                share += of_track.iter().map(|innovation| innovation.noise_share).sum::<f64>();
            }
            if !all.nis.is_empty() {
                all.noise_share = Some((share / all.nis.len() as f64).clamp(f64::MIN_POSITIVE, 1.0));
            }
            let judged = assess(&all).map_err(|error| Diagnostic::new(error.to_string()))?;
            sensor.assessment = Some(judged);
        }
        Ok(())
    }

    /// Whether a track was lost or a filter contradicts its measurements.
    pub fn degraded(&self) -> bool {
        let bad = [Event::Degenerate, Event::Restarted];
        let inconsistent = |a: &Assessment| a.is_judged() && !a.is_consistent();
        bad.iter().any(|event| self.events.contains_key(event))
            || self.sensors.iter().filter_map(|s| s.assessment.as_ref()).any(inconsistent)
    }

    /// How the truth contradicts what the measurements could tell, as a sentence.
    pub fn against_truth(&self, scores: &Scores) -> Option<String> {
        let verdicts = || self.sensors.iter().filter_map(|s| s.assessment.as_ref()).filter(|a| a.is_judged());
        let consistent = verdicts().next().is_some() && verdicts().all(Assessment::is_consistent);
        scores.found.as_ref()?.against_truth(consistent)
    }

    pub fn count(&self, event: Event) -> u64 {
        self.events.get(&event).copied().unwrap_or(0)
    }

    /// Writes degeneracies and what was done about them into the record.
    pub fn record(&self, record: &mut Record) {
        for (&event, &count) in &self.events {
            if let Some(action) = action(event) {
                record.outcomes_of(event.name(), action, count);
            }
        }
        if self.out_of_order > 0 {
            record.outcomes_of("row-out-of-order", "sorted by time", self.out_of_order);
        }
        if self.lone_points > 0 {
            record.outcomes_of("scan-of-one-point", "used as it is", self.lone_points);
        }
        if self.repeated > 0 {
            record.outcomes_of("row-repeated", "used again at the same time", self.repeated);
        }
    }

    /// The estimates, in the order of the measurements.
    pub fn table(&self, run: &Run) -> Result<TrackTable, Diagnostic> {
        let components = run.states.iter().map(|&state| component(state)).collect();
        let with_modes = !run.modes.is_empty();
        let mut table =
            if with_modes { TrackTable::with_modes(components) } else { TrackTable::new(components) };
        for row in run.rows.iter().flatten() {
            if let Some(row) = track_row(row, &run.modes) {
                table.push(row).map_err(|error| Diagnostic::new(error.to_string()))?;
            }
        }
        Ok(table)
    }

    /// The ellipses of extended targets, in the order of the table.
    pub fn ellipses(&self, run: &Run) -> Vec<EllipseRow> {
        let of_row = |(row, body): (&Row, &Body)| -> Vec<EllipseRow> {
            let each = body.shape.ellipses().iter().zip(&body.intervals).enumerate();
            let ellipse = |(k, (ellipse, intervals)): (usize, (&Ellipse, &[Interval; 2]))| EllipseRow {
                id: Arc::clone(&row.id),
                time: row.time,
                ellipse: k + 1,
                weight: ellipse.weight,
                middle: [row.mean[0] + ellipse.offset[0], row.mean[1] + ellipse.offset[1]],
                extent: ellipse.extent,
                intervals: *intervals,
            };
            each.map(ellipse).collect()
        };
        let rows = run.rows.iter().zip(&run.bodies);
        rows.filter_map(|(row, body)| Some((row.as_ref()?, body.as_ref()?))).flat_map(of_row).collect()
    }

    pub fn digest(&self, table: &TrackTable, ellipses: &[EllipseRow]) -> String {
        let mut digest = EstimatesDigest::default();
        table.rows().iter().for_each(|row| digest.push(&row.mean));
        for EllipseRow { weight, middle: [x, y], extent, .. } in ellipses {
            let [[xx, xy], [_, yy]] = extent.0;
            digest.push(&[*weight, *x, *y, xx, xy, yy]);
        }
        digest.finish()
    }

    /// The document of `--json`.
    pub fn document(&self, record: &Record, run: &Run, input: &Input, scores: &Scores) -> Value {
        let tracks: Vec<Value> = self
            .tracks
            .iter()
            .map(|t| {
                let mut track = json!({
                    "id": &*t.id, "start": t.start.secs(), "end": t.end.secs(),
                    "updates": t.updates, "missed": t.missed,
                });
                let last = t.rows.last().and_then(|&row| run.bodies.get(row)?.as_ref());
                if let (Some(body), Value::Object(track)) = (last, &mut track) {
                    let points: usize = t.rows.iter().map(|&row| input.points[row].len()).sum();
                    track.insert("points".to_owned(), json!(points));
                    track.insert("ellipses".to_owned(), json!(body.shape.len()));
                    track.insert("points_per_scan".to_owned(), json!(body.rate));
                    if let Some((label, share)) = labelled(run, input, t) {
                        track.insert("label".to_owned(), json!(label));
                        track.insert("iou".to_owned(), json!(share));
                    }
                    if let Some(rate) = body.clutter_rate {
                        track.insert("clutter_per_scan".to_owned(), json!(rate));
                    }
                }
                track
            })
            .collect();
        let sensors: Vec<Value> = self
            .sensors
            .iter()
            .map(|s| {
                let verdict = s.assessment.as_ref().map(Assessment::to_string);
                let consistent = s.assessment.as_ref().map(Assessment::is_consistent);
                json!({
                    "sensor": s.name, "used": s.used, "gated": s.gated,
                    "verdict": verdict, "consistent": consistent,
                })
            })
            .collect();
        let mut document = json!({
            "tracks": tracks,
            "restarts": { "gate": self.locked_out, "degenerate": self.count(Event::Restarted) - self.locked_out },
            "state": record.state,
            "counts": record.counts,
            "outcomes": record.outcomes,
            "sensors": sensors,
            "log_evidence": self.log_evidence,
            "estimates_digest": record.estimates_digest,
        });
        if let (Some(found), Value::Object(map)) = (&scores.found, &mut document) {
            let keys: Map<_, _> = found.scores.iter().map(|s| (s.key.to_owned(), json!(s.value))).collect();
            map.insert("association".to_owned(), json!(found.association));
            map.insert("instants".to_owned(), json!(found.instants));
            map.insert("scores".to_owned(), Value::Object(keys));
            map.insert("offsets".to_owned(), json!(found.offsets));
            map.insert("without_offsets".to_owned(), json!(found.centred));
            map.insert("against_truth".to_owned(), json!(self.against_truth(scores)));
        }
        document
    }

    /// The summary for people.
    pub fn summarise(
        &self,
        call: &Call<'_>,
        settings: &Settings,
        run: &Run,
        input: &Input,
        scores: &Scores,
        page: &Path,
    ) {
        let mut lines: Vec<(&str, String)> = Vec::new();
        let ids = self.tracks.len();
        lines.push(("tracks", format!("{ids}{}", span(&self.tracks))));
        let used = self.count(Event::Started) + self.count(Event::Updated) + self.count(Event::Restarted);
        let what = if input.points.is_empty() { "measurements" } else { "scans" };
        lines.push((what, format!("{used} used of {}{}", input.plots.len(), self.unused())));
        if !input.points.is_empty() {
            let points: usize = input.points.iter().map(Vec::len).sum();
            lines
                .push(("points", format!("{points}, {} a scan", number(points as f64 / used.max(1) as f64))));
        }
        let gate = "the gate refused every measurement for so long that the track, not they, must be wrong";
        let lost = "the filter found no likelihood where the measurements were";
        if !input.labels.is_empty() {
            /// Fewer points say little of an outline.
            const ENOUGH: usize = 5;
            let found = self.tracks.iter().filter_map(|t| Some((t, labelled(run, input, t)?.1)));
            let (many, shares): (Vec<bool>, Vec<f64>) = found
                .map(|(t, share)| (t.rows.iter().all(|&row| input.points[row].len() >= ENOUGH), share))
                .unzip();
            let mut clear: Vec<f64> =
                shares.iter().zip(&many).filter(|(_, many)| **many).map(|(s, _)| *s).collect();
            clear.sort_unstable_by(f64::total_cmp);
            let mut text = format!("{} of {ids} objects lie in a labelled box", shares.len());
            if let Some(median) = clear.get(clear.len() / 2) {
                text += &format!(
                    "; of {} with at least {ENOUGH} points the median intersection over union is {}",
                    clear.len(),
                    number(*median)
                );
            }
            lines.push(("labels", text));
        }
        for (count, why) in [(self.locked_out, gate), (self.count(Event::Restarted) - self.locked_out, lost)]
        {
            if count > 0 {
                let times = counted(count as usize, "time");
                lines.push(("track lost", format!("{times}, started anew from the measurements: {why}")));
            }
        }
        let rejected: u64 = input.counts.rejected.values().sum();
        if rejected > 0 {
            let reasons: Vec<_> =
                input.counts.rejected.iter().map(|(reason, count)| format!("{count} {reason}")).collect();
            lines.push((
                "rows rejected",
                format!("{rejected} of {}: {}", input.counts.read, reasons.join(", ")),
            ));
        }
        let left_out: u64 = input.counts.left_out.values().sum();
        if left_out > 0 {
            let reasons: Vec<_> =
                input.counts.left_out.iter().map(|(reason, count)| format!("{count} {reason}")).collect();
            let reasons = reasons.join(", ");
            lines.push(("rows left out", format!("{left_out} of {}: {reasons}", input.counts.read)));
        }
        if self.out_of_order > 0 {
            let rows = counted(self.out_of_order as usize, "row");
            lines.push(("rows sorted", format!("{rows} earlier than one before, put in order of time")));
        }
        lines.push(("filter", settings.filter_text()));
        lines.push(("log-evidence", evidence_text(self.log_evidence)));
        if let Some(reference) = &run.reference {
            lines.push(("log-evidence", against(reference, self.log_evidence)));
        }
        let lab = zerre_lab::consistency::ENOUGH;
        for sensor in &self.sensors {
            let verdict = match &sensor.assessment {
                Some(a) if a.is_judged() => a.to_string(),
                Some(a) => format!("{} innovations, too few to judge (at least {lab})", a.samples),
                None => continue,
            };
            lines.push(("consistency", format!("{}: {verdict}", sensor.name)));
        }
        if let Some(found) = &scores.found {
            lines.push(("scores", found.sentence()));
            lines.extend(
                found
                    .scores
                    .iter()
                    .map(|s| (s.key, format!("{} {}", number(s.value), s.unit).trim_end().to_owned())),
            );
            lines.extend(self.against_truth(scores).map(|text| ("truth", text)));
        }
        lines.push(("report", page.display().to_string()));
        let width = lines.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
        let mut text = String::new();
        let mut before = "";
        for (name, value) in &lines {
            // A name stands once for several lines of its kind.
            let shown = if *name == before { "" } else { name };
            let _ = writeln!(text, "{shown:width$}  {value}");
            before = name;
        }
        call.console.info(text.trim_end());
    }

    /// ": 3 gated, 1 degenerate".
    fn unused(&self) -> String {
        let parts: Vec<_> = self
            .events
            .iter()
            .filter(|(event, _)| action(**event).is_some())
            .map(|(event, count)| format!("{count} {}", event.name()))
            .collect();
        if parts.is_empty() { String::new() } else { format!(": {}", parts.join(", ")) }
    }
}

/// The label of the object that a track of one scan is of, and the share of what outline and labelled box cover that both
/// cover.
fn labelled<'a>(run: &Run, input: &'a Input, track: &Track) -> Option<(&'a str, f64)> {
    let [row] = track.rows[..] else { return None };
    let label = input.label_of(row)?;
    let outline = super::report::outline(run, input, row, run.rows.get(row)?.as_ref()?)?;
    Some((&label.name, outline.region.intersection_over_union(&label.region())))
}

/// ", from 0 s to 299 s (5 min)".
fn span(tracks: &[Track]) -> String {
    let (Some(start), Some(end)) = (tracks.iter().map(|t| t.start).min(), tracks.iter().map(|t| t.end).max())
    else {
        return String::new();
    };
    let secs = (end - start).secs();
    let length = match secs {
        s if s < 120.0 => format!("{s:.1} s"),
        s if s < 7200.0 => format!("{:.1} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    };
    format!(" over {length}")
}

/// "for comparison, ukf has -491.3: the particles explain the measurements better": higher is better. What both did not
/// use is left out of the comparison, and the particles' own number is told again where that changes it.
fn against(reference: &Reference, log_evidence: f64) -> String {
    let verdict = if reference.is_better() {
        let loss = number(reference.loss_per_plot());
        format!("the particles lose {loss} per measurement: take more of them, or that filter")
    } else if -reference.loss_per_plot() > TOLERABLE_LOSS {
        "the particles explain the measurements better (higher is better)".to_owned()
    } else {
        "the particles explain the measurements as well".to_owned()
    };
    let (own, theirs) = (evidence_text(reference.own), evidence_text(reference.log_evidence));
    if own == evidence_text(log_evidence) {
        return format!("for comparison, {} has {theirs}: {verdict}", reference.filter);
    }
    let shared = counted(reference.plots, "measurement");
    format!(
        "for comparison, on the {shared} that both use {} has {theirs} and this filter {own}: {verdict}",
        reference.filter
    )
}

/// A log-evidence with a digit after the point, or as a power of ten where it means nothing but failure.
pub(super) fn evidence_text(value: f64) -> String {
    if value.abs() < 1e7 { format!("{value:.1}") } else { format!("{value:.1e}") }
}

/// So many measurements fix a state: of the position for position, velocity, acceleration, and of the size as many.
fn orders(states: &[State]) -> u64 {
    let acceleration = states.iter().any(|s| matches!(s, State::Acceleration(_) | State::TurnRate));
    let velocity = states.iter().any(|s| matches!(s, State::Velocity(_)));
    let positions = 1 + u64::from(velocity) + u64::from(acceleration);
    if states.contains(&State::Length) { 2 * positions } else { positions }
}

/// The evidence of the measurement of a row, where it was used.
pub(super) fn evidence(row: &Row) -> Option<f64> {
    let update = row.update.filter(|_| row.event == Event::Updated)?;
    Some(update.log_evidence).filter(|e| e.is_finite())
}

/// A row as tables hold it, with the most probable of the modes; `None` where there is no new estimate.
pub(super) fn track_row(row: &Row, modes: &[Mode]) -> Option<TrackRow> {
    if row.mean.is_empty() || row.event == Event::OutOfOrder {
        return None;
    }
    Some(TrackRow {
        id: Arc::clone(&row.id),
        time: row.time,
        mean: row.mean.clone(),
        covariance: row.covariance.clone(),
        log_evidence: evidence(row),
        outcome: row.event.name().to_owned(),
        mode: likely(&row.modes).and_then(|(j, probability)| {
            Some(LikelyMode { name: modes.get(j)?.name().to_owned(), probability })
        }),
    })
}

/// The most probable mode, the first of several, and its probability.
fn likely(probabilities: &[f64]) -> Option<(usize, f64)> {
    let better = |best: (usize, f64), one: (usize, f64)| if one.1 > best.1 { one } else { best };
    probabilities.iter().copied().enumerate().reduce(better)
}

/// Name and unit of a number of the state.
pub(super) fn component(state: State) -> Component {
    const AXES: [&str; 3] = ["x", "y", "z"];
    let axis = |i: usize| AXES.get(i).copied().unwrap_or("?");
    match state {
        State::Position(i) => Component::new(axis(i), Unit::M),
        State::Velocity(i) => Component::new(&format!("v{}", axis(i)), Unit::MPS),
        State::Acceleration(i) => Component::new(&format!("a{}", axis(i)), Unit::MPS2),
        State::TurnRate => Component::new("turn_rate", Unit::RADPS),
        State::Length => Component::new("length", Unit::M),
        State::Width => Component::new("width", Unit::M),
        State::Orientation => Component::new("orientation", Unit::RAD),
    }
}

/// Name of a plot's sensor where the recording has one.
pub(super) fn sensor_name(plot: &Plot) -> &str {
    plot.sensor.as_deref().unwrap_or(zerre::track::DEFAULT_SENSOR)
}
