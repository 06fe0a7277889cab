//! The page around the pictures.

use super::chart::{Chart, Key, Layer};
use super::plan::{self, Plan, style_of};
use super::svg::{Escaped, Range, group, readable, signed, thinned};
use super::{RunReport, SensorReport, TrackSeries};
use crate::distribution::chi_square_quantile;
use std::collections::HashMap;

/// Tracks with charts; the table has all of them.
const MOST_DETAILED: usize = 60;
/// Tracks whose charts are open at first.
const OPEN: usize = 3;
/// Pictures of scenes.
const MOST_SCENES: usize = 12;
/// Points of all charts together, at about twelve bytes each: keeps the page below two megabytes.
const CHART_POINTS: usize = 80_000;

/// The whole document.
pub(super) fn render(report: &RunReport) -> String {
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
         <title>{}</title><style>\n{}{}</style></head><body><main>\n",
        Escaped(&report.title),
        include_str!("palette.css"),
        include_str!("page.css")
    );
    let clock = Clock::of(report);
    header(&mut out, report, &clock);
    verdicts(&mut out, report);
    plan_section(&mut out, report);
    tracks(&mut out, report, &clock);
    input(&mut out, report);
    if !report.config_text.is_empty() {
        out.push_str(&format!(
            "<section><h2>Configuration</h2><pre tabindex=\"0\">{}</pre></section>\n",
            Escaped(&report.config_text)
        ));
    }
    out.push_str("<footer>");
    if !report.digest.is_empty() {
        out.push_str(&format!("Digest of the estimates <code>{}</code><br>", Escaped(&report.digest)));
    }
    out.push_str(&format!(
        "The same input, configuration and seed give the same digest on every machine. zerre {}</footer></main>\
         <script>\n{}</script></body></html>\n",
        env!("CARGO_PKG_VERSION"),
        include_str!("page.js")
    ));
    out
}

/// Times of the page: from the first estimate, in a unit that suits the span.
struct Clock {
    start: f64,
    span: f64,
    seconds: f64,
    unit: &'static str,
}

impl Clock {
    fn of(report: &RunReport) -> Clock {
        let all = || report.tracks.iter().flat_map(|t| &t.times_s).copied().filter(|t| t.is_finite());
        let (start, end) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
        let (start, span) = if start <= end { (start, end - start) } else { (0.0, 0.0) };
        let (seconds, unit) = match span {
            s if s < 600.0 => (1.0, "s"),
            s if s < 4.0 * 3600.0 => (60.0, "min"),
            _ => (3600.0, "h"),
        };
        Clock { start, span, seconds, unit }
    }

    fn of_time(&self, time_s: f64) -> f64 {
        (time_s - self.start) / self.seconds
    }
}

/// "12.4 s", "3.2 min", "1.5 h".
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 600.0 => format!("{} s", readable(s)),
        s if s < 4.0 * 3600.0 => format!("{} min", readable(s / 60.0)),
        s => format!("{} h", readable(s / 3600.0)),
    }
}

fn header(out: &mut String, report: &RunReport, clock: &Clock) {
    out.push_str(&format!("<header><h1>{}</h1>", Escaped(&report.title)));
    if !report.command.is_empty() {
        out.push_str(&format!("<code class=\"command\">{}</code>", Escaped(&report.command)));
    }
    out.push_str("<dl class=\"facts\">");
    let seed = report.seed.to_string();
    let start = report.start.as_deref().unwrap_or_default();
    let facts = [
        ("Input", report.input.as_str()),
        ("Filter", &report.filter),
        ("Motion", &report.motion),
        ("Seed", &seed),
        ("First estimate", start),
    ];
    for (name, value) in facts.into_iter().filter(|(_, value)| !value.is_empty()) {
        out.push_str(&format!("<dt>{name}</dt><dd>{}</dd>", Escaped(value)));
    }
    out.push_str("</dl><dl class=\"tiles\">");
    let rejected: u64 = report.counts.rejected.iter().map(|r| r.count).sum();
    let mut tile = |name: &str, value: String, unit: &str| {
        out.push_str(&format!(
            "<div><dt>{}</dt><dd>{value} <small>{}</small></dd></div>",
            Escaped(name),
            Escaped(unit)
        ));
    };
    tile("tracks", group(report.tracks.len() as u64), "");
    tile("updates", group(report.tracks.iter().map(|t| t.updates).sum()), "");
    tile("missed", group(report.tracks.iter().map(|t| t.missed).sum()), "");
    let span = duration(clock.span);
    let (number, unit) = span.split_once(' ').unwrap_or((&span, ""));
    tile("time span", number.into(), unit);
    tile("rows used", group(report.counts.used), &format!("of {}", group(report.counts.read)));
    tile("rows rejected", group(rejected), "");
    for score in &report.scores {
        tile(&score.name, readable(score.value), &score.unit);
    }
    out.push_str("</dl></header>\n");
}

fn verdicts(out: &mut String, report: &RunReport) {
    if report.sensors.is_empty() && report.against_truth.is_none() {
        return;
    }
    out.push_str("<section><h2>Do the measurements agree with the model?</h2>");
    for sensor in &report.sensors {
        verdict(out, sensor);
    }
    if let Some(text) = &report.against_truth {
        out.push_str(&format!(
            "<div class=\"verdict warn\"><h3>Against the truth</h3><ul><li>{}</li></ul></div>",
            Escaped(text)
        ));
    }
    out.push_str("</section>\n");
}

fn verdict(out: &mut String, sensor: &SensorReport) {
    let class = match &sensor.assessment {
        Some(a) if a.is_consistent() => " good",
        Some(a) if a.is_judged() => " warn",
        _ => "",
    };
    let name = if sensor.name.is_empty() { "Sensor" } else { &sensor.name };
    out.push_str(&format!("<div class=\"verdict{class}\"><h3>{}</h3><ul>", Escaped(name)));
    let mut numbers = Vec::new();
    match &sensor.assessment {
        None => out.push_str("<li>not judged: no innovations</li>"),
        Some(a) => {
            for finding in &a.findings {
                out.push_str(&format!("<li>{}</li>", Escaped(&finding.to_string())));
            }
            if let Some(nis) = &a.nis {
                let left_out = a.samples - nis.samples.min(a.samples);
                let (of, all) = match a.nis_of_all {
                    Some(all) if left_out > 0 => (
                        format!(" without the {} outliers", group(left_out as u64)),
                        format!(", {} with them", readable(all)),
                    ),
                    _ => Default::default(),
                };
                numbers.push(format!(
                    "mean NIS per degree of freedom{of} {} (1 expected, limits {:.2} to {:.2}){all}",
                    readable(nis.mean),
                    nis.low,
                    nis.high
                ));
            }
            if let Some(lag) = &a.lag1 {
                numbers.push(format!(
                    "lag-1 correlation {} ({} to {})",
                    signed(lag.value),
                    signed(lag.low),
                    signed(lag.high)
                ));
            }
            for c in &a.components {
                let (mean, kurtosis) =
                    (c.mean, c.kurtosis.map_or(String::new(), |k| format!(", kurtosis {}", readable(k))));
                numbers.push(format!(
                    "mean {} {} σ ({} to {}){kurtosis}",
                    c.name,
                    signed(mean.value),
                    signed(mean.low),
                    signed(mean.high)
                ));
            }
        }
    }
    numbers.push(format!("{} used, {} outside the gate", group(sensor.used), group(sensor.gated)));
    out.push_str(&format!("</ul><p class=\"small\">{}</p></div>", Escaped(&numbers.join(" · "))));
}

fn plan_section(out: &mut String, report: &RunReport) {
    let drawn = report.tracks.iter().any(|t| !t.position.is_empty() || !t.plots.is_empty());
    if !drawn {
        return;
    }
    let shown: Vec<usize> = thinned(report.scenes.len(), MOST_SCENES).collect();
    let plans: Vec<Plan> = match shown.is_empty() {
        true => vec![plan::draw(report, None, None)],
        false => shown.iter().map(|scene| plan::draw(report, Some(*scene), None)).collect(),
    };
    out.push_str("<section><h2>Plan</h2>");
    let mut notes: Vec<String> = report.plan_note.iter().cloned().collect();
    for note in plans.iter().flat_map(|plan| &plan.notes) {
        if !notes.contains(note) {
            notes.push(note.clone());
        }
    }
    if shown.len() < report.scenes.len() {
        notes.push(format!("{} of {} pictures are shown.", shown.len(), report.scenes.len()));
    }
    out.push_str("<ul class=\"key\">");
    let mut key = |mark: &str, text: &str| {
        out.push_str(&format!("<li><svg viewBox=\"0 0 22 14\" aria-hidden=\"true\">{mark}</svg>{text}</li>"));
    };
    key("<path class=\"mean\" d=\"M1,7h20\"/>", "track");
    if plan::shows_modes(report) {
        key("<path class=\"wild\" d=\"M5,7h12\"/><path class=\"mean\" d=\"M1,7h20\"/>", "manoeuvring");
    }
    if report.tracks.iter().any(|t| t.truth.is_some()) {
        key("<path class=\"truth\" d=\"M1,7h20\"/>", "truth");
    }
    if report.tracks.iter().any(|t| t.outlines.iter().any(|outline| !outline.points.is_empty())) {
        key("<path class=\"point\" d=\"M7,7h0M15,7h0\"/>", "points");
    } else {
        key("<path class=\"plot\" d=\"M11,7h0\"/>", "measurement");
    }
    if report.tracks.iter().any(|t| !t.outlines.is_empty()) {
        key("<ellipse class=\"outline\" cx=\"11\" cy=\"7\" rx=\"10\" ry=\"6\"/>", "outline");
    } else {
        key("<ellipse class=\"ellipse\" cx=\"11\" cy=\"7\" rx=\"10\" ry=\"6\"/>", "95 % of the position");
    }
    if !report.labels.is_empty() {
        key("<path class=\"truth\" d=\"M2,2h18v10h-18z\"/>", "label");
    }
    key("<circle class=\"start\" cx=\"11\" cy=\"7\" r=\"4\" style=\"r:4px\"/>", "start");
    key("<circle class=\"end\" cx=\"11\" cy=\"7\" r=\"4.5\" style=\"r:4.5px\"/>", "end");
    out.push_str("</ul>");
    if shown.is_empty() {
        plans.iter().for_each(|plan| out.push_str(&plan.svg));
    } else {
        out.push_str("<div class=\"scenes\">");
        for (scene, plan) in shown.iter().zip(&plans) {
            let name = Escaped(&report.scenes[*scene]);
            out.push_str(&format!("<figure><figcaption>{name}</figcaption>{}</figure>", plan.svg));
        }
        out.push_str("</div>");
    }
    if !notes.is_empty() {
        out.push_str(&format!("<p class=\"small\">{}</p>", Escaped(&notes.join(" "))));
    }
    out.push_str("</section>\n");
}

fn tracks(out: &mut String, report: &RunReport, clock: &Clock) {
    if report.tracks.is_empty() {
        out.push_str("<section><h2>Tracks</h2><p>No target was tracked.</p></section>\n");
        return;
    }
    out.push_str(
        "<section><h2>Tracks</h2><div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Table of tracks\">\
         <table><thead><tr><th scope=\"col\">track</th><th scope=\"col\" class=\"r\">from</th>\
         <th scope=\"col\" class=\"r\">for</th><th scope=\"col\" class=\"r\">updates</th>\
         <th scope=\"col\" class=\"r\">missed</th><th scope=\"col\" class=\"r\">log-evidence</th>\
         <th scope=\"col\">outcomes</th></tr></thead><tbody>",
    );
    let detailed = most_updated(&report.tracks);
    for (index, track) in report.tracks.iter().enumerate() {
        row(out, index, track, clock, detailed[index]);
    }
    out.push_str("</tbody></table></div>");
    let charts = detailed.iter().filter(|d| **d).count();
    if charts < report.tracks.len() && charts > 0 {
        out.push_str(&format!(
            "<p class=\"small\">Charts follow for the {charts} tracks with the most updates.</p>"
        ));
    }
    let lines: usize =
        report.tracks.iter().map(|t| 4 * t.states.len() + 2 * t.modes.len() + 6).max().unwrap_or(1);
    let limit = (CHART_POINTS / (lines * charts.max(1))).clamp(60, 600);
    if report.tracks.iter().any(|t| t.times_s.len() > limit) {
        out.push_str(&format!(
            "<p class=\"small\">Lines are drawn through about {limit} points each; values outside their limits are \
             kept.</p>"
        ));
    }
    let charted = report.tracks.iter().enumerate().filter(|(index, _)| detailed[*index]);
    for (place, (index, track)) in charted.enumerate() {
        details(out, index, track, report, clock, limit, place < OPEN);
    }
    out.push_str("</section>\n");
}

/// Which tracks get charts.
fn most_updated(tracks: &[TrackSeries]) -> Vec<bool> {
    // A single estimate is no series.
    let mut order: Vec<usize> = (0..tracks.len()).filter(|i| tracks[*i].times_s.len() > 1).collect();
    order.sort_by_key(|i| std::cmp::Reverse(tracks[*i].updates));
    let mut chosen = vec![false; tracks.len()];
    order.into_iter().take(MOST_DETAILED).for_each(|i| chosen[i] = true);
    chosen
}

fn row(out: &mut String, index: usize, track: &TrackSeries, clock: &Clock, linked: bool) {
    let (dashed, colour) = style_of(index);
    let (first, last) = (track.times_s.first().copied(), track.times_s.last().copied());
    let from = first.map_or("–".into(), |t| format!("{} {}", readable(clock.of_time(t)), clock.unit));
    let long = first.zip(last).map_or("–".into(), |(a, b)| duration(b - a));
    let evidence = track.log_evidence.last().map_or("–".into(), |l| readable(*l));
    let outcomes: Vec<String> =
        track.outcomes.iter().map(|(name, n)| format!("{name}: {}", group(*n))).collect();
    let id = Escaped(&track.id);
    let name = if linked { format!("<a href=\"#track-{index}\">{id}</a>") } else { id.to_string() };
    out.push_str(&format!(
        "<tr data-t=\"{index}\"><td class=\"text\"><span class=\"swatch{dashed}\" style=\"--c:var(--c{colour})\">\
         </span>{name}</td><td class=\"r\">{from}</td><td class=\"r\">{long}</td><td class=\"r\">{}</td>\
         <td class=\"r\">{}</td><td class=\"r\">{evidence}</td><td class=\"text\">{}</td></tr>",
        group(track.updates),
        group(track.missed),
        Escaped(&outcomes.join(", "))
    ));
}

fn details(
    out: &mut String,
    index: usize,
    track: &TrackSeries,
    report: &RunReport,
    clock: &Clock,
    limit: usize,
    open: bool,
) {
    let (dashed, colour) = style_of(index);
    out.push_str(&format!(
        "<details id=\"track-{index}\"{} style=\"--c:var(--c{colour})\"><summary><span class=\"swatch{dashed}\"></span>\
         {}<span class=\"small\">{} updates</span></summary><div class=\"charts\">",
        if open { " open" } else { "" },
        Escaped(&track.id),
        group(track.updates)
    ));
    let times: Vec<f64> = track.times_s.iter().map(|t| clock.of_time(*t)).collect();
    let of_innovations = track.innovations.iter().map(|i| clock.of_time(i.time_s));
    let time = Range::over(times.iter().copied().chain(of_innovations), 0.0);
    let mut chart = |title: &str, key: Vec<Key>, unit: &str, from_zero: bool, layers: Vec<Layer>| {
        let chart = Chart { title, key, unit, time, time_unit: clock.unit, limit, layers, from_zero };
        out.push_str(&chart.render());
    };
    for (s, state) in track.states.iter().enumerate() {
        let (unit, layers) = state_layers(track, s, &state.unit, &times, clock);
        chart(&state.name, Vec::new(), unit, false, layers);
    }
    let errors = position_errors(track, clock);
    if !errors.is_empty() {
        let radius = |c: &[f64; 3]| plan::radius_95(*c);
        let band = times.iter().zip(&track.position_cov).map(|(t, c)| [*t, 0.0, radius(c)]).collect();
        let layers = vec![Layer::Band(band, "band"), Layer::Line(errors, "mean")];
        chart("position error (shaded: 95 % radius)", Vec::new(), "m", true, layers);
    }
    if track.outlines.iter().any(|outline| !outline.points.is_empty()) {
        let counts = times.iter().zip(&track.outlines).map(|(t, o)| [*t, o.points.len() as f64]).collect();
        chart("points in a scan", Vec::new(), "", true, vec![Layer::Dots(counts, "dot0")]);
    }
    if track.modes.len() > 1 {
        let (key, layers) = mode_layers(track, &times);
        chart("mode probabilities", key, "", true, layers);
    }
    if track.ess.iter().any(Option::is_some) {
        let ess = times.iter().zip(&track.ess).map(|(t, e)| [*t, e.unwrap_or(f64::NAN)]).collect();
        let mut layers = vec![Layer::Line(ess, "mean")];
        layers.extend(track.particles.map(|n| Layer::Level(n as f64)));
        let title = match track.particles {
            Some(n) => format!("effective sample size of {} particles", group(n as u64)),
            None => "effective sample size".into(),
        };
        chart(&title, Vec::new(), "", true, layers);
    }
    innovation_charts(track, report, clock, &mut chart);
    if !track.log_evidence.is_empty() {
        let line = times.iter().zip(&track.log_evidence).map(|(t, l)| [*t, *l]).collect();
        chart("log-evidence, summed", Vec::new(), "", false, vec![Layer::Line(line, "mean")]);
    }
    out.push_str("</div></details>\n");
}

/// Band, truth and mean of one state, and the unit they are shown in.
fn state_layers<'a>(
    track: &TrackSeries,
    state: usize,
    unit: &'a str,
    times: &[f64],
    clock: &Clock,
) -> (&'a str, Vec<Layer>) {
    let number =
        |rows: &[Vec<f64>], i: usize| rows.get(i).and_then(|r| r.get(state)).copied().unwrap_or(f64::NAN);
    let size = track.mean.iter().filter_map(|r| r.get(state)).fold(0.0_f64, |a, v| a.max(v.abs()));
    let (unit, divisor) = if unit == "m" && size >= 10_000.0 { ("km", 1000.0) } else { (unit, 1.0) };
    let rows = || times.iter().enumerate().take(track.mean.len());
    let mean: Vec<[f64; 2]> = rows().map(|(i, t)| [*t, number(&track.mean, i) / divisor]).collect();
    let band = rows().map(|(i, t)| {
        let (m, half) = (number(&track.mean, i) / divisor, 2.0 * number(&track.sd, i) / divisor);
        [*t, m - half, m + half]
    });
    let mut layers = vec![Layer::Band(band.collect(), "band")];
    let truth = track.truth.as_ref().and_then(|t| Some((t, t.states.get(state)?)));
    if let Some((truth, values)) = truth.filter(|(_, values)| !values.is_empty()) {
        let line = truth.times_s.iter().zip(values).map(|(t, v)| [clock.of_time(*t), v / divisor]);
        layers.push(Layer::Line(line.collect(), "truth"));
    }
    layers.push(Layer::Line(mean, "mean"));
    (unit, layers)
}

/// The probabilities of the modes on top of each other, the first one at the bottom.
fn mode_layers(track: &TrackSeries, times: &[f64]) -> (Vec<Key>, Vec<Layer>) {
    const STYLES: [&str; 6] = ["mode0", "mode1", "mode2", "mode3", "mode4", "mode5"];
    let rows = || times.iter().zip(&track.mode_probabilities);
    let mut tops = vec![0.0; rows().len()];
    let of_mode = |(j, name): (usize, &String)| {
        let class = STYLES[j % STYLES.len()];
        let area = rows().zip(&mut tops).map(|((t, probabilities), top)| {
            let bottom = *top;
            *top += probabilities.get(j).copied().unwrap_or(f64::NAN);
            [*t, bottom, *top]
        });
        (Key { class, name: name.clone() }, Layer::Band(area.collect(), class))
    };
    track.modes.iter().enumerate().map(of_mode).unzip()
}

/// Distance between estimate and truth wherever both have the same time, to the microsecond.
fn position_errors(track: &TrackSeries, clock: &Clock) -> Vec<[f64; 2]> {
    let Some(truth) = &track.truth else { return Vec::new() };
    let mut truths = truth.times_s.iter().zip(&truth.position).peekable();
    let mut errors = Vec::new();
    for (time, estimate) in track.times_s.iter().zip(&track.position) {
        while truths.next_if(|(t, _)| **t < time - 1e-6).is_some() {}
        if let Some((_, place)) = truths.peek().filter(|(t, _)| (*t - time).abs() <= 1e-6) {
            errors.push([clock.of_time(*time), (estimate[0] - place[0]).hypot(estimate[1] - place[1])]);
        }
    }
    errors
}

/// Innovations and NIS of every sensor that saw the track.
fn innovation_charts(
    track: &TrackSeries,
    report: &RunReport,
    clock: &Clock,
    chart: &mut impl FnMut(&str, Vec<Key>, &str, bool, Vec<Layer>),
) {
    const STYLES: [&str; 3] = ["dot0", "dot1", "dot2"];
    let mut bounds: HashMap<usize, (f64, f64)> = HashMap::new();
    let last = track.innovations.iter().map(|row| row.sensor).max();
    for sensor in 0..last.map_or(0, |s| s.saturating_add(1).min(report.sensors.len())) {
        let rows = || track.innovations.iter().filter(move |row| row.sensor == sensor);
        let Some(dimension) = rows().map(|row| row.whitened.len()).max() else { continue };
        let SensorReport { name, components, .. } = &report.sensors[sensor];
        let of = if report.sensors.len() > 1 { format!(", {name}") } else { String::new() };
        if dimension > 0 {
            let mut layers = vec![Layer::Level(-2.0), Layer::Level(2.0)];
            let mut shown = Vec::new();
            for (c, class) in STYLES.iter().enumerate().take(dimension) {
                let values = rows()
                    .map(|row| [clock.of_time(row.time_s), row.whitened.get(c).copied().unwrap_or(f64::NAN)]);
                layers.push(Layer::Dots(values.collect(), class));
                let name = components.get(c).map_or("innovation", String::as_str);
                shown.push(Key { class, name: name.to_owned() });
            }
            chart(&format!("innovations{of}"), shown, "σ", false, layers);
            let (low, high) = *bounds.entry(dimension).or_insert_with(|| {
                let degrees = dimension as f64;
                (chi_square_quantile(0.025, degrees), chi_square_quantile(0.975, degrees))
            });
            let nis = rows().map(|row| [clock.of_time(row.time_s), row.nis]).collect();
            let layers = vec![Layer::Level(low), Layer::Level(high), Layer::Dots(nis, "dot0")];
            chart(&format!("NIS, 95 % between {low:.2} and {high:.2}{of}"), Vec::new(), "", true, layers);
        }
    }
}

fn input(out: &mut String, report: &RunReport) {
    let counts = &report.counts;
    out.push_str(&format!(
        "<section><h2>Input</h2><p>{} rows read: {} used",
        group(counts.read),
        group(counts.used)
    ));
    let left_out: u64 = counts.left_out.iter().map(|(_, count)| count).sum();
    if left_out > 0 {
        let reasons: Vec<_> =
            counts.left_out.iter().map(|(reason, n)| format!("{}: {}", Escaped(reason), group(*n))).collect();
        out.push_str(&format!(", {} left out ({})", group(left_out), reasons.join(", ")));
    }
    out.push('.');
    if counts.out_of_order > 0 {
        out.push_str(&format!(
            " {} of them were out of order and sorted by time.",
            group(counts.out_of_order)
        ));
    }
    if counts.missing > 0 {
        let cells = if counts.missing == 1 { "cell was" } else { "cells were" };
        out.push_str(&format!(
            " {} {cells} empty where a measurement could stand; a row may have several.",
            group(counts.missing)
        ));
    }
    out.push_str("</p>");
    if counts.rejected.is_empty() {
        out.push_str("<p>No row was rejected.</p></section>\n");
        return;
    }
    out.push_str(
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Rejected rows\"><table><thead><tr>\
         <th scope=\"col\">rejected because</th><th scope=\"col\" class=\"r\">rows</th>\
         <th scope=\"col\">for example</th></tr></thead><tbody>",
    );
    for rejection in &counts.rejected {
        let examples: Vec<String> = rejection
            .examples
            .iter()
            .map(|e| {
                format!("line {}, {}: <code>{}</code>", group(e.line), Escaped(&e.column), Escaped(&e.value))
            })
            .collect();
        out.push_str(&format!(
            "<tr><td class=\"text\">{}</td><td class=\"r\">{}</td><td class=\"text\">{}</td></tr>",
            Escaped(&rejection.reason),
            group(rejection.count),
            examples.join("<br>")
        ));
    }
    out.push_str("</tbody></table></div></section>\n");
}
