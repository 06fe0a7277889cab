//! The plan view: tracks, measurements, ellipses and truth, with equal scales on both axes.

use super::outline;
use super::svg::{At, Escaped, Range, Ticks, dots, inside, path, round_step, thinned};
use super::{Label, RunReport, TrackSeries};

const WIDTH: f64 = 860.0;
const LEFT: f64 = 72.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 40.0;
const BOTTOM: f64 = 58.0;
/// 95 % of a two-dimensional normal law lie within this many standard deviations: sqrt(-2 ln 0.05).
const ELLIPSE_95: f64 = 2.447_746_830_680_816;
/// More of these say no more and make the file large.
const MOST_PLOTS: usize = 8_000;
const MOST_ELLIPSES: usize = 300;
const ELLIPSES_OF_A_TRACK: usize = 16;
const MOST_LINE_POINTS: usize = 12_000;
/// With more labels than this the names are in the table alone.
const MOST_LABELS: usize = 16;
const COLOURS: usize = 6;

/// The class and the colour of the track at that place in the list; later rounds through the colours are dashed.
pub(super) fn style_of(index: usize) -> (&'static str, usize) {
    (if (index / COLOURS).is_multiple_of(2) { "" } else { " dashed" }, index % COLOURS)
}

/// What was left out of a picture, to be said beside it.
pub(super) struct Plan {
    pub svg: String,
    pub notes: Vec<String>,
}

/// What one picture shows.
#[derive(Clone, Copy)]
struct View<'a> {
    report: &'a RunReport,
    /// `None`: everything.
    scene: Option<usize>,
}

impl<'a> View<'a> {
    fn shows(&self, scene: usize) -> bool {
        self.scene.is_none_or(|own| own == scene)
    }

    /// The tracks, with their places in the list.
    fn tracks(self) -> impl Iterator<Item = (usize, &'a TrackSeries)> {
        self.report.tracks.iter().enumerate().filter(move |(_, track)| self.shows(track.scene))
    }

    fn labels(self) -> impl Iterator<Item = &'a Label> {
        self.report.labels.iter().filter(move |label| self.shows(label.scene))
    }

    fn has_points(self) -> bool {
        self.tracks().any(|(_, track)| track.outlines.iter().any(|outline| !outline.points.is_empty()))
    }

    fn has_outlines(self) -> bool {
        self.tracks().any(|(_, track)| !track.outlines.is_empty())
    }
}

/// From metres in the plan to the page.
pub(super) struct Frame {
    x: Range,
    y: Range,
    height: f64,
}

impl Frame {
    fn of(view: View<'_>) -> Frame {
        let drawn = |p: &[f64; 2]| p.iter().all(|v| v.is_finite());
        let mut points: Vec<[f64; 2]> = Vec::new();
        for (_, track) in view.tracks() {
            points.extend(track.position.iter().filter(|p| drawn(p)));
            points.extend(track.truth.iter().flat_map(|truth| &truth.position).filter(|p| drawn(p)));
            points.extend(track.outlines.iter().filter_map(|o| o.region.corners()).flatten().filter(drawn));
        }
        if points.is_empty() {
            points = view.tracks().flat_map(|(_, t)| &t.plots).copied().filter(drawn).collect();
        }
        let mut x = Range::over(points.iter().map(|p| p[0]), 0.06);
        let mut y = Range::over(points.iter().map(|p| p[1]), 0.06);
        // The picture is as flat or as tall as the data, between 2:1 and about 1:1; then the axis with room to spare
        // grows until both have the same scale.
        let width = WIDTH - LEFT - RIGHT;
        let height = (width * y.span() / x.span()).clamp(width * 0.45, width * 0.85).round();
        let metres_per_unit = (x.span() / width).max(y.span() / height);
        let grow = |range: &mut Range, span: f64| {
            let centre = range.low + range.span() / 2.0;
            *range = Range { low: centre - span / 2.0, high: centre + span / 2.0 };
        };
        grow(&mut x, metres_per_unit * width);
        grow(&mut y, metres_per_unit * height);
        Frame { x, y, height }
    }

    pub(super) fn scale(&self) -> f64 {
        (WIDTH - LEFT - RIGHT) / self.x.span()
    }

    /// Inside the plotting area, from its top left.
    pub(super) fn place(&self, p: [f64; 2]) -> [f64; 2] {
        [(p[0] - self.x.low) * self.scale(), (self.y.high - p[1]) * self.scale()]
    }

    pub(super) fn holds(&self, p: [f64; 2]) -> bool {
        (self.x.low..=self.x.high).contains(&p[0]) && (self.y.low..=self.y.high).contains(&p[1])
    }
}

/// Draws the plan, or one scene of it: with a `head` (title and styles) as a file of its own, without as a part of the
/// page.
pub(super) fn draw(report: &RunReport, scene: Option<usize>, head: Option<&str>) -> Plan {
    let view = View { report, scene };
    let frame = Frame::of(view);
    let mut notes = Vec::new();
    let (full_width, full_height) = (WIDTH, TOP + frame.height + BOTTOM);
    let root = head.map_or(String::new(), |_| {
        format!(" xmlns=\"http://www.w3.org/2000/svg\" width=\"{full_width}\" height=\"{full_height}\"")
    });
    let mut svg = format!(
        "<svg{root} viewBox=\"0 0 {full_width} {full_height}\" class=\"plan\" role=\"img\" \
         aria-label=\"Plan view of {} tracks\">{}",
        view.tracks().count(),
        head.unwrap_or_default()
    );
    axes(&mut svg, &frame);
    legend(&mut svg, view);
    svg.push_str(&format!(
        "<svg x=\"{LEFT}\" y=\"{TOP}\" width=\"{}\" height=\"{}\">",
        WIDTH - LEFT - RIGHT,
        frame.height
    ));
    measurements(&mut svg, view, &frame, &mut notes);
    for label in view.labels() {
        outline::label(&mut svg, label, &frame);
    }
    let rows: usize = view.tracks().map(|(_, t)| t.position.len()).sum();
    let line_limit = (MOST_LINE_POINTS / view.tracks().count().max(1)).clamp(50, 1500);
    let (mut widest_step, mut thinned_lines) = (1, false);
    for (index, track) in view.tracks() {
        let step =
            rows.div_ceil(MOST_ELLIPSES).max(track.position.len().div_ceil(ELLIPSES_OF_A_TRACK)).max(1);
        widest_step = widest_step.max(step);
        thinned_lines |= track.position.len() > line_limit;
        draw_track(&mut svg, index, track, &frame, step, line_limit);
    }
    for (index, track) in view.tracks() {
        draw_ends(&mut svg, index, track, &frame);
    }
    for sensor in &report.sensors {
        if let Some(position) = sensor.position.filter(|p| frame.holds(*p)) {
            let [x, y] = frame.place(position);
            svg.push_str(&format!(
                "<g class=\"sensor\"><title>sensor {name}</title><path d=\"M{},{}l6,11h-12z\"/>\
                 <text class=\"tick name\" x=\"{}\" y=\"{}\">{name}</text></g>",
                At(x),
                At(y - 6.0),
                At(x + 10.0),
                At(y + 5.0),
                name = Escaped(&sensor.name)
            ));
        }
    }
    labels(&mut svg, view, &frame);
    svg.push_str("</svg></svg>");
    if view.has_outlines() {
        let note = if view.has_points() { outline::OF_POINTS } else { outline::NOTE };
        notes.push(note.to_owned());
    } else if widest_step > 1 {
        notes.push(format!("Ellipses are drawn at every {} row of the longest track.", ordinal(widest_step)));
    }
    if thinned_lines {
        notes.push(format!("Tracks are drawn through about {line_limit} of their rows."));
    }
    Plan { svg, notes }
}

/// "4th", "22nd".
fn ordinal(n: usize) -> String {
    let ending = match (n % 10, n % 100) {
        (1, x) if x != 11 => "st",
        (2, x) if x != 12 => "nd",
        (3, x) if x != 13 => "rd",
        _ => "th",
    };
    format!("{n}{ending}")
}

fn axes(svg: &mut String, frame: &Frame) {
    let (width, height) = (WIDTH - LEFT - RIGHT, frame.height);
    let kilometres = frame.x.span().max(frame.y.span()) >= 10_000.0;
    let (unit, metres) = if kilometres { ("km", 1000.0) } else { ("m", 1.0) };
    let across = Ticks::between(frame.x.low / metres, frame.x.high / metres, 7.0);
    let up = Ticks::between(frame.y.low / metres, frame.y.high / metres, 7.0 * height / width);
    let (x_from, y_from) = (offset(&across), offset(&up));
    let mut grid = String::new();
    for v in &across.at {
        let x = LEFT + (v * metres - frame.x.low) * frame.scale();
        let label = across.label(v - x_from);
        grid.push_str(&format!("M{},{TOP}v{height}", At(x)));
        svg.push_str(&format!(
            "<text class=\"tick\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">{label}</text>",
            At(inside(x, &label, 12.0, WIDTH)),
            TOP + height + 18.0
        ));
    }
    for v in &up.at {
        let at = At(TOP + (frame.y.high - v * metres) * frame.scale());
        grid.push_str(&format!("M{LEFT},{at}h{width}"));
        svg.push_str(&format!(
            "<text class=\"tick\" x=\"{}\" y=\"{at}\" dy=\".35em\" text-anchor=\"end\">{}</text>",
            LEFT - 8.0,
            up.label(v - y_from)
        ));
    }
    let name = |axis: &str, from: f64| {
        if from == 0.0 { format!("{axis} ({unit})") } else { format!("{axis} − {from} ({unit})") }
    };
    svg.push_str(&format!(
        "<text class=\"label\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\
         <text class=\"label\" transform=\"translate(16 {}) rotate(-90)\" text-anchor=\"middle\">{}</text>\
         <path class=\"grid\" d=\"{grid}\"/>",
        LEFT + width / 2.0,
        TOP + height + 46.0,
        name("x", x_from),
        TOP + height / 2.0,
        name("y", y_from)
    ));
    let long = round_step(frame.x.span() / metres / 8.0);
    let length = long * metres * frame.scale();
    let (right, y) = (WIDTH - RIGHT, TOP - 14.0);
    svg.push_str(&format!(
        "<path class=\"bar\" d=\"M{},{}v8h{}v-8\"/>\
         <text class=\"tick\" x=\"{}\" y=\"{}\" text-anchor=\"end\">{} {unit}</text>",
        At(right - length),
        y - 4.0,
        At(length),
        At(right - length - 8.0),
        y + 4.0,
        long
    ));
}

/// What to subtract from labels that would be long (a national grid); mostly nothing.
fn offset(ticks: &Ticks) -> f64 {
    let longest = ticks.at.iter().map(|v| ticks.label(*v).chars().count()).max().unwrap_or(0);
    let (Some(first), true) = (ticks.at.first(), longest > 6) else { return 0.0 };
    let coarse = ticks.step * 10.0;
    (first / coarse).floor() * coarse
}

fn legend(svg: &mut String, view: View<'_>) {
    let report = view.report;
    let y = TOP - 14.0;
    let mut x = LEFT;
    svg.push_str("<g class=\"legend\">");
    let mut entry = |mark: String, text: &str, width: f64| {
        svg.push_str(&format!(
            "<g transform=\"translate({x} {y})\">{mark}<text class=\"tick\" x=\"26\" dy=\".35em\">{text}</text></g>"
        ));
        x += width;
    };
    entry("<path class=\"mean\" d=\"M0,0h20\"/>".into(), "track", 72.0);
    if shows_modes(report) {
        let mark = "<path class=\"wild\" d=\"M4,0h12\"/><path class=\"mean\" d=\"M0,0h20\"/>";
        entry(mark.into(), "manoeuvring", 124.0);
    }
    if report.tracks.iter().any(|t| t.truth.is_some()) {
        entry("<path class=\"truth\" d=\"M0,0h20\"/>".into(), "truth", 72.0);
    }
    match view.has_points() {
        true => entry("<path class=\"point\" d=\"M6,0h0M14,0h0\"/>".into(), "points", 80.0),
        false => entry("<path class=\"plot\" d=\"M10,0h0\"/>".into(), "measurement", 126.0),
    }
    if view.has_outlines() {
        entry("<ellipse class=\"outline\" cx=\"10\" rx=\"10\" ry=\"6\"/>".into(), "outline", 86.0);
    } else {
        entry("<ellipse class=\"ellipse\" cx=\"10\" rx=\"10\" ry=\"6\"/>".into(), "95 %", 70.0);
    }
    if view.labels().next().is_some() {
        entry("<path class=\"truth\" d=\"M1,-6h18v12h-18z\"/>".into(), "label", 74.0);
    }
    entry("<circle class=\"start\" cx=\"10\" r=\"4\"/>".into(), "start", 66.0);
    entry("<circle class=\"end\" cx=\"10\" r=\"4.5\"/>".into(), "end", 60.0);
    svg.push_str("</g>");
}

fn measurements(svg: &mut String, view: View<'_>, frame: &Frame, notes: &mut Vec<String>) {
    let all: Vec<[f64; 2]> = view.tracks().flat_map(|(_, t)| t.plots.iter().copied()).collect();
    let outside = all.iter().filter(|p| !frame.holds(**p)).count();
    let kept = thinned(all.len(), MOST_PLOTS).map(|i| all[i]).filter(|p| frame.holds(*p));
    svg.push_str(&format!("<path class=\"plot\" d=\"{}\"/>", dots(kept.map(|p| frame.place(p)))));
    let step = all.len().div_ceil(MOST_PLOTS);
    if step > 1 {
        notes.push(format!("Every {} measurement is drawn.", ordinal(step)));
    }
    if outside > 0 {
        notes.push(format!("{outside} measurements lie outside the picture."));
    }
}

fn draw_track(svg: &mut String, index: usize, track: &TrackSeries, frame: &Frame, step: usize, limit: usize) {
    let (dashed, colour) = style_of(index);
    svg.push_str(&format!(
        "<g class=\"track{dashed}\" data-t=\"{index}\" style=\"--c:var(--c{colour})\"><title>{}</title>",
        Escaped(&track.id)
    ));
    outline::draw(svg, track, frame);
    let ellipses = if track.outlines.is_empty() { track.position.len() } else { 0 };
    for i in (0..ellipses).step_by(step) {
        if let (Some(&centre), Some(&covariance)) = (track.position.get(i), track.position_cov.get(i)) {
            ellipse(svg, frame, centre, covariance);
        }
    }
    let line = |points: &[[f64; 2]]| {
        let kept: Vec<_> = thinned(points.len(), limit).map(|i| frame.place(points[i])).collect();
        path(kept.into_iter())
    };
    if let Some(truth) = &track.truth {
        svg.push_str(&format!("<path class=\"truth\" d=\"{}\"/>", line(&truth.position)));
    }
    let wild = manoeuvres(track, frame, limit);
    if !wild.is_empty() {
        svg.push_str(&format!("<path class=\"wild\" d=\"{wild}\"/>"));
    }
    svg.push_str(&format!("<path class=\"mean\" d=\"{}\"/>", line(&track.position)));
    svg.push_str("</g>");
}

/// Whether manoeuvring stretches can be told from others.
pub(super) fn shows_modes(report: &RunReport) -> bool {
    report.tracks.iter().any(|track| track.modes.len() > 1)
}

/// The steps at whose end another mode than the first is the most probable one.
fn manoeuvres(track: &TrackSeries, frame: &Frame, limit: usize) -> String {
    let is_wild = |i: usize| {
        let Some(probabilities) = track.mode_probabilities.get(i) else { return false };
        let quiet = probabilities.first().copied().unwrap_or(f64::NAN);
        probabilities.iter().any(|p| *p > quiet)
    };
    let mut points = Vec::new();
    let mut last = None;
    for i in thinned(track.position.len(), limit) {
        let here = frame.place(track.position[i]);
        match last {
            Some(before) if is_wild(i) => points.extend([before, here]),
            // Lifts the pen.
            _ => points.push([f64::NAN; 2]),
        }
        last = Some(here);
    }
    path(points.into_iter())
}

/// Where the track begins and ends, above all lines.
fn draw_ends(svg: &mut String, index: usize, track: &TrackSeries, frame: &Frame) {
    let colour = style_of(index).1;
    svg.push_str(&format!("<g class=\"track\" data-t=\"{index}\" style=\"--c:var(--c{colour})\">"));
    let drawn = |p: &&[f64; 2]| p.iter().all(|v| v.is_finite());
    if let Some(&first) = track.position.iter().find(drawn) {
        let [x, y] = frame.place(first);
        svg.push_str(&format!("<circle class=\"start\" cx=\"{}\" cy=\"{}\" r=\"4\"/>", At(x), At(y)));
    }
    if let Some(&last) = track.position.iter().rev().find(drawn) {
        let [x, y] = frame.place(last);
        svg.push_str(&format!("<circle class=\"end\" cx=\"{}\" cy=\"{}\" r=\"4.5\"/>", At(x), At(y)));
    }
    svg.push_str("</g>");
}

/// Standard deviations along the long and the short axis of a covariance (xx, xy, yy).
fn axes_of([xx, xy, yy]: [f64; 3]) -> (f64, f64) {
    let (mean, half) = ((xx + yy) / 2.0, ((xx - yy) / 2.0).hypot(xy));
    ((mean + half).sqrt(), (mean - half).max(0.0).sqrt())
}

/// The long half-axis of the 95 % ellipse, in metres.
pub(super) fn radius_95(covariance: [f64; 3]) -> f64 {
    ELLIPSE_95 * axes_of(covariance).0
}

/// The 95 % ellipse; nothing for a covariance that is none.
fn ellipse(svg: &mut String, frame: &Frame, centre: [f64; 2], covariance: [f64; 3]) {
    let [xx, xy, yy] = covariance;
    let (long, short) = axes_of(covariance);
    let [x, y] = frame.place(centre);
    if !(long.is_finite() && x.is_finite() && y.is_finite()) || long == 0.0 {
        return;
    }
    // The page's y axis points down, which turns the angle around.
    let degrees = -(0.5 * (2.0 * xy).atan2(xx - yy)).to_degrees();
    let radius = |s: f64| At(s * ELLIPSE_95 * frame.scale());
    svg.push_str(&format!(
        "<ellipse class=\"ellipse\" rx=\"{}\" ry=\"{}\" transform=\"translate({} {}) rotate({})\"/>",
        radius(long),
        radius(short),
        At(x),
        At(y),
        At(degrees)
    ));
}

/// Names at the ends of tracks, where they do not cover each other.
fn labels(svg: &mut String, view: View<'_>, frame: &Frame) {
    if view.tracks().count() > MOST_LABELS {
        return;
    }
    let mut taken: Vec<[f64; 4]> = Vec::new();
    for (index, track) in view.tracks() {
        let Some(&end) = track.position.iter().rev().find(|p| p.iter().all(|v| v.is_finite())) else {
            continue;
        };
        // In the picture of a scene its own name need not stand again.
        let id = match view.scene.and(track.id.rsplit_once('/')) {
            Some((_, within)) => within,
            None => &track.id,
        };
        let name = match id.char_indices().nth(16) {
            Some((cut, _)) => format!("{}…", &id[..cut]),
            None => id.to_owned(),
        };
        // Nearly nine units per character are the bold digits of the widest usual font.
        let (width, [x, y]) = (8.7 * name.chars().count() as f64 + 4.0, frame.place(end));
        let right_edge = WIDTH - LEFT - RIGHT;
        let places = [
            (x + 9.0, y + 4.0),
            (x - 9.0 - width, y + 4.0),
            (x - width / 2.0, y - 10.0),
            (x - width / 2.0, y + 20.0),
        ];
        let free = places.into_iter().find(|(left, base)| {
            let inside = *left >= 0.0 && left + width <= right_edge && *base >= 14.0 && *base <= frame.height;
            let clear = taken
                .iter()
                .all(|[l, t, r, b]| left + width < *l || left > r || base + 3.0 < *t || base - 12.0 > *b);
            inside && clear
        });
        if let Some((left, base)) = free {
            taken.push([left, base - 12.0, left + width, base + 3.0]);
            svg.push_str(&format!(
                "<text class=\"name\" data-t=\"{index}\" style=\"--c:var(--c{})\" x=\"{}\" y=\"{}\">{}</text>",
                style_of(index).1,
                At(left),
                At(base),
                Escaped(&name)
            ));
        }
    }
}
