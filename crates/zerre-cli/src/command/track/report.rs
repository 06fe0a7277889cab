//! `report.html` of a run.

use super::Call;
use super::input::Input;
use super::outcome::{Outcome, component, evidence, evidence_text, sensor_name};
use super::scores::Scores;
use super::settings::Settings;
use super::work::Run;
use crate::run::Record;
use std::collections::BTreeMap;
use zerre::Time;
use zerre::track::{Event, Row, State, has_particles};
use zerre_lab::metric::Region;
use zerre_lab::report::{
    Counts, InnovationRow, Label, Outline, RejectedRow, Rejection, RunReport, Score, SensorReport, StateInfo,
    TrackSeries, TruthSeries, plan_svg, render,
};

/// The page, and its plan as a picture.
pub(super) fn pages(
    call: &Call<'_>,
    settings: &Settings,
    input: &Input,
    run: &Run,
    outcome: &Outcome,
    scores: &Scores,
    record: &Record,
) -> (String, String) {
    let spec = settings.spec(call.global.seed);
    let names: Vec<_> = call
        .args
        .inputs
        .iter()
        .map(|path| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned())
        .collect();
    const NAMED: usize = 4;
    let title = match names.len().saturating_sub(NAMED) {
        0 => names.join(", "),
        more => format!("{} and {more} more", names[..NAMED].join(", ")),
    };
    let particles = has_particles(&spec.filter.name).then(|| match spec.filter.name.as_str() {
        // Each of them under every mode.
        "mmpf" => spec.filter.particles * run.modes.len(),
        _ => spec.filter.particles,
    });
    let filter = settings.filter_text();
    let filter = match &run.reference {
        None => filter,
        Some(r) => {
            let verdict = if r.is_better() { "more particles would help" } else { "it is no better" };
            format!(
                "{filter}; log-evidence {}, and {} on the same measurements {}: {verdict}",
                evidence_text(r.own),
                r.filter,
                evidence_text(r.log_evidence)
            )
        }
    };
    let (key, wander) = spec.motion.wander();
    let motion = match wander {
        Some(value) => format!("{}, {key} {value}", spec.motion.model),
        None => spec.motion.model.clone(),
    };
    let first = outcome.tracks.iter().map(|t| t.start).min();
    let report = RunReport {
        title: title.clone(),
        command: command_line(),
        input: title,
        filter,
        motion,
        seed: call.global.seed,
        start: first.and_then(calendar),
        plan_note: plan_note(input),
        tracks: outcome
            .tracks
            .iter()
            .map(|track| {
                let rows = || track.rows.iter().filter_map(|&i| Some((i, run.rows[i].as_ref()?)));
                let mut series = TrackSeries {
                    id: track.id.to_string(),
                    states: run.states.iter().map(|&state| info(state)).collect(),
                    particles,
                    modes: run.modes.iter().map(|mode| mode.name().to_owned()).collect(),
                    scene: track.rows.first().and_then(|&row| input.scene_of(row)).unwrap_or(0),
                    updates: track.updates,
                    missed: track.missed,
                    outcomes: track.events.iter().map(|(event, n)| (event.name().to_owned(), *n)).collect(),
                    ..TrackSeries::default()
                };
                let mut sum = 0.0;
                for (index, row) in rows().filter(|(_, row)| row.event != Event::OutOfOrder) {
                    sum += evidence(row).unwrap_or(0.0);
                    push(&mut series, row, sum);
                    series.plots.extend(run.places.get(index).copied().flatten());
                    series.outlines.extend(outline(run, input, index, row));
                    if let Some(innovation) = row.innovation.as_ref().filter(|_| outcome.judged[index]) {
                        series.innovations.push(InnovationRow {
                            time_s: row.time.secs(),
                            sensor: outcome.sensor_of[index],
                            nis: innovation.nis,
                            whitened: innovation.whitened.clone(),
                        });
                    }
                }
                series.truth = truth(scores, &track.id, (track.start, track.end), run.states.len());
                series
            })
            .collect(),
        sensors: sensors(settings, input, outcome),
        scenes: input.scenes.clone(),
        labels: input
            .labels
            .iter()
            .map(|label| Label { name: label.name.clone(), region: label.region(), scene: label.scene })
            .collect(),
        counts: Counts {
            read: record.counts.read,
            used: record.counts.used,
            missing: record.counts.missing,
            left_out: record.counts.left_out.iter().map(|(reason, n)| (reason.clone(), *n)).collect(),
            out_of_order: outcome.out_of_order,
            rejected: rejected(input),
        },
        scores: tiles(scores),
        against_truth: outcome.against_truth(scores),
        config_text: settings.effective.to_string(),
        digest: record.estimates_digest.clone().unwrap_or_default(),
    };
    (render(&report), plan_svg(&report))
}

/// What the axes of the plan are, and its outlines.
fn plan_note(input: &Input) -> Option<String> {
    let axes = input.frame.as_ref().map(|frame| {
        let o = frame.origin();
        format!("x points east and y north of {:.5}°, {:.5}° (latitude, longitude).", o.lat_deg, o.lon_deg)
    });
    let two = "Ellipses lie two standard deviations of the points from their middle.".to_owned();
    let notes: Vec<String> = axes.into_iter().chain((!input.points.is_empty()).then_some(two)).collect();
    (!notes.is_empty()).then(|| notes.join(" "))
}

/// The scores, and how many estimates some of them leave out.
fn tiles(scores: &Scores) -> Vec<Score> {
    let Some(found) = &scores.found else { return Vec::new() };
    let tile = |name: String, value, unit: &str| Score { name, value, unit: unit.to_owned() };
    let mut tiles: Vec<_> = found
        .scores
        .iter()
        .map(|s| tile(s.key.trim_end_matches("_m").replace('_', " "), s.value, s.unit))
        .collect();
    if found.instants.singular > 0 {
        let unit = "estimates, left out of nees and coverage";
        tiles.push(tile("singular covariances".to_owned(), found.instants.singular as f64, unit));
    }
    tiles
}

/// The outline of a target after a plot, where it has one.
pub(super) fn outline(run: &Run, input: &Input, index: usize, row: &Row) -> Option<Outline> {
    /// Standard deviations at which ellipses are drawn.
    const SDS: f64 = 2.0;
    if run.bodies.is_empty() {
        return Some(Outline { region: box_of(&run.states, &row.mean)?, points: Vec::new() });
    }
    let body = run.bodies.get(index)?.as_ref()?;
    let region = Region::of_shape(&body.shape, [row.mean[0], row.mean[1]], SDS);
    Some(Outline { region, points: input.points.get(index).cloned().unwrap_or_default() })
}

/// The box of a state that has one.
fn box_of(states: &[State], mean: &[f64]) -> Option<Region> {
    let of = |state| mean.get(states.iter().position(|other| *other == state)?).copied();
    let (sin, cos) = of(State::Orientation)?.sin_cos();
    let (half, side) = (0.5 * of(State::Length)?, 0.5 * of(State::Width)?);
    let (x, y) = (of(State::Position(0))?, of(State::Position(1))?);
    let corner = |a: f64, b: f64| [x + a * half * cos - b * side * sin, y + a * half * sin + b * side * cos];
    let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].map(|(a, b)| corner(a, b));
    Some(Region::polygon(corners.to_vec()))
}

fn push(series: &mut TrackSeries, row: &Row, log_evidence: f64) {
    let n = row.mean.len();
    let entry = |i: usize, j: usize| row.covariance.get(i * n + j).copied().unwrap_or(0.0);
    series.times_s.push(row.time.secs());
    series.mean.push(row.mean.clone());
    series.sd.push((0..n).map(|i| entry(i, i).max(0.0).sqrt()).collect());
    series.position.push([row.mean[0], row.mean[1]]);
    series.position_cov.push([entry(0, 0), entry(0, 1), entry(1, 1)]);
    series.ess.push(row.update.and_then(|update| Some(update.particles?.ess)));
    series.log_evidence.push(log_evidence);
    series.mode_probabilities.push(row.modes.clone());
}

fn info(state: zerre::track::State) -> StateInfo {
    use zerre::track::State::{Acceleration, Length, Orientation, Position, TurnRate, Velocity, Width};
    let unit = match state {
        Position(_) => "m",
        Velocity(_) => "m/s",
        Acceleration(_) => "m/s²",
        TurnRate => "rad/s",
        Length | Width => "m",
        Orientation => "rad",
    };
    StateInfo { name: component(state).name.replace('_', " "), unit: unit.to_owned() }
}

fn truth(scores: &Scores, id: &str, (start, end): (Time, Time), states: usize) -> Option<TruthSeries> {
    let way = scores.way(id)?;
    let mut series = TruthSeries { states: vec![Vec::new(); states], ..TruthSeries::default() };
    let points = || way.points().iter().filter(|point| (start..=end).contains(&point.time));
    for point in points() {
        series.times_s.push(point.time.secs());
        series.position.push([point.position[0], point.position[1]]);
    }
    for (axis, values) in series.states.iter_mut().take(2).enumerate() {
        *values = points().map(|point| point.position[axis]).collect();
    }
    Some(series)
}

fn sensors(settings: &Settings, input: &Input, outcome: &Outcome) -> Vec<SensorReport> {
    let spec = settings.spec(0);
    let first: BTreeMap<usize, &str> =
        outcome.sensor_of.iter().zip(&input.plots).rev().map(|(&i, plot)| (i, sensor_name(plot))).collect();
    let place = |i: usize| {
        let [x, y, _] = spec.sensors.get(*first.get(&i)?)?.position_m;
        Some([x, y])
    };
    let report = |(i, sensor): (usize, &super::outcome::Sensor)| SensorReport {
        name: sensor.name.clone(),
        components: sensor.components.iter().map(|c| (*c).to_owned()).collect(),
        // A sensor of positions, or of sizes, stands nowhere in particular.
        position: place(i).filter(|_| !matches!(sensor.components.first(), Some(&("x" | "length")))),
        used: sensor.used,
        gated: sensor.gated,
        assessment: sensor.assessment.clone(),
    };
    outcome.sensors.iter().enumerate().map(report).collect()
}

/// Refused rows by reason, each with the first few.
fn rejected(input: &Input) -> Vec<Rejection> {
    let examples = |reason: &str| {
        let of_reason = input.rejections.iter().filter(|r| r.reason == reason).take(5);
        of_reason
            .map(|r| RejectedRow {
                line: r.line,
                column: r.column.clone().unwrap_or_default(),
                value: r.value.clone(),
            })
            .collect()
    };
    let of = |(reason, count): (&String, &u64)| Rejection {
        reason: reason.clone(),
        count: *count,
        examples: examples(reason),
    };
    input.counts.rejected.iter().map(of).collect()
}

/// The words of the command line, those with blanks in quotes.
fn command_line() -> String {
    let words = std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned());
    let quoted = words.map(|w| if w.contains(char::is_whitespace) { format!("{w:?}") } else { w });
    std::iter::once("zerre".to_owned()).chain(quoted).collect::<Vec<_>>().join(" ")
}

/// Date and time of seconds since 1970. Times before September 2001 are taken for an epoch of the recording's own:
/// no date is told.
fn calendar(time: Time) -> Option<String> {
    let secs = time.nanos().div_euclid(1_000_000_000);
    if secs < 1_000_000_000 {
        return None;
    }
    // Days to a date: Hinnant, "chrono-compatible low-level date algorithms".
    let (days, rest) = (secs.div_euclid(86_400), secs.rem_euclid(86_400));
    let z = days + 719_468;
    let (era, day_of_era) = (z.div_euclid(146_097), z.rem_euclid(146_097));
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_index = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_index + 2) / 5 + 1;
    let month = if month_index < 10 { month_index + 3 } else { month_index - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    let (hour, minute, second) = (rest / 3600, rest / 60 % 60, rest % 60);
    Some(format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z"))
}

#[cfg(test)]
mod tests {
    use super::calendar;
    use zerre::Time;

    #[test]
    fn dates_of_seconds() {
        let date = |secs: &str| calendar(Time::parse_secs(secs).unwrap());
        assert_eq!(date("1575888665.9").unwrap(), "2019-12-09T10:51:05Z");
        assert_eq!(date("1709164800").unwrap(), "2024-02-29T00:00:00Z");
        assert_eq!(date("28800"), None);
    }
}
