//! A study on one page: what was asked, tables with intervals, line charts. It needs no network and no script.

use super::svg::{At, Escaped, Range, Ticks, dots, half_width, inside, path, readable};
use crate::study::interval::Estimate;
use crate::study::table::Entry;
use std::fmt::Write as _;

/// The page.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StudyReport {
    /// Head of the page.
    pub title: String,
    /// The command line that made it.
    pub command: String,
    /// Names and values at the top.
    pub facts: Vec<(String, String)>,
    /// Parts, in order.
    pub sections: Vec<Section>,
    /// Digest of the estimates.
    pub digest: String,
}

/// A part of the page.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Section {
    /// Its head.
    pub title: String,
    /// What is to be said before the figures and tables.
    pub paragraphs: Vec<String>,
    /// Points of a list.
    pub points: Vec<String>,
    /// Figures.
    pub figures: Vec<Figure>,
    /// Pictures in files of their own.
    pub pictures: Vec<Picture>,
    /// Tables.
    pub tables: Vec<Grid>,
}

/// A picture in a file beside the page.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// What it shows.
    pub title: String,
    /// Name of the file.
    pub file: String,
    /// Pixels across and down.
    pub size: [u16; 2],
}

/// A table for readers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Grid {
    /// What it shows.
    pub caption: String,
    /// Names of the columns.
    pub head: Vec<String>,
    /// Rows, as long as the head.
    pub rows: Vec<Vec<Shown>>,
}

/// One entry of a [`Grid`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shown {
    /// The text.
    pub text: String,
    /// Smaller text behind it: an interval, a printed value.
    pub aside: String,
    /// Why it is to be doubted; it is then marked, and the reason stands below the table.
    pub doubt: Option<String>,
}

impl From<&str> for Shown {
    fn from(text: &str) -> Shown {
        Shown { text: text.to_owned(), ..Shown::default() }
    }
}

impl From<f64> for Shown {
    fn from(value: f64) -> Shown {
        Shown { text: readable(value), ..Shown::default() }
    }
}

impl From<Option<f64>> for Shown {
    fn from(value: Option<f64>) -> Shown {
        value.map_or(Shown::from("–"), Shown::from)
    }
}

impl From<Option<Estimate>> for Shown {
    fn from(estimate: Option<Estimate>) -> Shown {
        let Some(Estimate { value, low, high }) = estimate else { return None::<f64>.into() };
        Shown { aside: format!("{} to {}", readable(low), readable(high)), ..Shown::from(value) }
    }
}

impl From<&Entry> for Shown {
    fn from(entry: &Entry) -> Shown {
        match entry {
            Entry::Text(text) => text.as_str().into(),
            Entry::Count(count) => count.to_string().as_str().into(),
            Entry::Number(value) => (*value).into(),
            Entry::Missing => "–".into(),
        }
    }
}

/// Lines over two axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// What it shows.
    pub title: String,
    /// Name and unit of the horizontal axis.
    pub x: String,
    /// Name and unit of the vertical axis.
    pub y: String,
    /// The vertical axis is logarithmic; what is not positive is left out.
    pub logarithmic: bool,
    /// A length along x is one along y: a map.
    pub map: bool,
    /// The horizontal axis is logarithmic.
    pub logarithmic_x: bool,
    /// What is drawn, from back to front.
    pub series: Vec<Series>,
    /// Single points with names, on top.
    pub marks: Vec<Mark>,
}

/// A named point of a [`Figure`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mark {
    /// Where it is.
    pub at: [f64; 2],
    /// Its name, shown when it is pointed at.
    pub name: String,
    /// Its name stands beside it.
    pub labelled: bool,
}

/// One line of a [`Figure`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// Its points; those that are not finite interrupt it.
    pub points: Vec<[f64; 2]>,
    /// Low and high at each point, shaded between: an interval about the line. Empty for none.
    pub band: Vec<[f64; 2]>,
    /// Drawn as dots.
    pub dots: bool,
    /// Drawn thin and dotted, in the colour of the text: what the others are compared with.
    pub reference: bool,
}

const WIDTH: f64 = 480.0;
const HEIGHT: f64 = 300.0;
const LEFT: f64 = 58.0;
const RIGHT: f64 = 10.0;
const TOP: f64 = 10.0;
const BOTTOM: f64 = 40.0;
/// Pictures of at least so many pixels across have the whole width of the page.
const BROAD: u16 = 1000;
/// Columns of a table that have their smaller text beside the larger; of more it stands below.
const MOST_COLUMNS: usize = 8;
/// Colours of the palette; further series are dashed.
const COLOURS: usize = 6;

const STYLE: &str = ".study .charts{grid-template-columns:repeat(auto-fill,minmax(min(420px,100%),1fr));align-items:start}\
.aside{color:var(--muted);font-size:12px;margin-left:6px}.doubt{color:var(--warn);font-weight:700}\
.study .wide .aside{display:block;margin:0}.study .wide :is(th,td){padding-right:10px}.study table{font-size:13.5px;margin:0 0 8px}.study caption{text-align:left;color:var(--muted);padding:12px 0 6px}\
.study ul.points{max-width:76ch;padding-left:20px;margin:0 0 12px}.study ul.points li{margin:0 0 6px}\
.study .chart svg .tick text{font-size:12px}svg .reference{stroke:var(--ink);stroke-width:1.2;stroke-dasharray:2 3;opacity:.8}\
.study .chart svg circle{fill:var(--muted);opacity:.55}.study .chart svg circle.front{fill:var(--c0);opacity:1}\
.study .chart svg .names text{font-size:11.5px;fill:var(--ink)}.study .swatch.spot{width:7px;height:7px;border:0;border-radius:50%;background:var(--c)}.study img{width:100%;height:auto;border:1px solid var(--line);border-radius:8px}.study .broad{grid-column:1/-1}svg .spots{stroke:var(--c,var(--ink));stroke-width:6;stroke-linecap:round}";

/// The whole document.
pub fn render(report: &StudyReport) -> String {
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
         <title>{title}</title><style>\n{}{}{STYLE}</style></head><body><main class=\"study\">\n\
         <header><h1>{title}</h1><code class=\"command\">{}</code><dl class=\"facts\">",
        include_str!("palette.css"),
        include_str!("page.css"),
        Escaped(&report.command),
        title = Escaped(&report.title),
    );
    for (name, value) in &report.facts {
        // Writing to a string cannot fail, here and below.
        let _ = write!(out, "<dt>{}</dt><dd>{}</dd>", Escaped(name), Escaped(value));
    }
    out.push_str("</dl></header>\n");
    for part in &report.sections {
        section(&mut out, part);
    }
    let _ = writeln!(
        out,
        "<footer>Digest of the estimates <code>{}</code><br>The same configuration and seed give the same digest on \
         every machine; times differ. zerre {}</footer></main></body></html>",
        Escaped(&report.digest),
        env!("CARGO_PKG_VERSION")
    );
    out
}

fn section(out: &mut String, section: &Section) {
    let _ = write!(out, "<section><h2>{}</h2>", Escaped(&section.title));
    for text in &section.paragraphs {
        let _ = write!(out, "<p>{}</p>", Escaped(text));
    }
    if !section.points.is_empty() {
        out.push_str("<ul class=\"points\">");
        for text in &section.points {
            let _ = write!(out, "<li>{}</li>", Escaped(text));
        }
        out.push_str("</ul>");
    }
    if !(section.figures.is_empty() && section.pictures.is_empty()) {
        out.push_str("<div class=\"charts\">");
        section.figures.iter().for_each(|f| figure(out, f));
        section.pictures.iter().for_each(|p| picture(out, p));
        out.push_str("</div>");
    }
    section.tables.iter().for_each(|g| grid(out, g));
    out.push_str("</section>\n");
}

fn picture(out: &mut String, picture: &Picture) {
    let Picture { title, file, size: [width, height] } = picture;
    let broad = if *width >= BROAD { " broad" } else { "" };
    let _ = write!(
        out,
        "<figure class=\"chart{broad}\"><figcaption>{title} <span class=\"unit\">{file}</span></figcaption>\
         <img src=\"{file}\" alt=\"{title}\" width=\"{width}\" height=\"{height}\" loading=\"lazy\"/></figure>",
        title = Escaped(title),
        file = Escaped(file),
    );
}

fn grid(out: &mut String, grid: &Grid) {
    let _ = write!(
        out,
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{caption}\"><table{wide}><caption>{caption}\
         </caption><thead><tr>",
        caption = Escaped(&grid.caption),
        wide = if grid.head.len() > MOST_COLUMNS { " class=\"wide\"" } else { "" },
    );
    for name in &grid.head {
        let _ = write!(out, "<th scope=\"col\">{}</th>", Escaped(name));
    }
    out.push_str("</tr></thead><tbody>");
    let mut doubts: Vec<&str> = Vec::new();
    for row in &grid.rows {
        out.push_str("<tr>");
        for Shown { text, aside, doubt } in row {
            let _ = write!(out, "<td>{}", Escaped(text));
            if !aside.is_empty() {
                let _ = write!(out, "<span class=\"aside\">{}</span>", Escaped(aside));
            }
            if let Some(reason) = doubt {
                let place = doubts.iter().position(|known| known == reason).unwrap_or_else(|| {
                    doubts.push(reason);
                    doubts.len() - 1
                });
                let _ = write!(out, "<sup class=\"doubt\">{}</sup>", place + 1);
            }
            out.push_str("</td>");
        }
        out.push_str("</tr>");
    }
    out.push_str("</tbody></table></div>");
    for (place, reason) in (1..).zip(doubts) {
        let _ = write!(out, "<p class=\"small\"><sup class=\"doubt\">{place}</sup> {}</p>", Escaped(reason));
    }
}

/// From values to the page along one axis.
struct Scale {
    range: Range,
    logarithmic: bool,
}

impl Scale {
    fn over(values: impl Iterator<Item = f64>, margin: f64, logarithmic: bool) -> Scale {
        let values = values.map(|v| if logarithmic { log10(v) } else { v });
        Scale { range: Range::over(values.filter(|v| v.is_finite()), margin), logarithmic }
    }

    /// Share of the axis below `value`.
    fn share(&self, value: f64) -> f64 {
        let value = if self.logarithmic { log10(value) } else { value };
        (value - self.range.low) / self.range.span()
    }

    /// Values to mark, with their labels.
    fn marks(&self, count: f64) -> Vec<(f64, String)> {
        let linear = |low: f64, high: f64| {
            let ticks = Ticks::between(low, high, count);
            ticks.at.iter().map(|v| (*v, ticks.label(*v))).collect()
        };
        if !self.logarithmic {
            return linear(self.range.low, self.range.high);
        }
        // Within less than a factor of five, 1, 2 and 5 mark too little.
        if self.range.span() < 0.7 {
            return linear(10f64.powf(self.range.low), 10f64.powf(self.range.high));
        }
        let (first, last) = (self.range.low.floor() as i32, self.range.high.ceil() as i32);
        (first..=last)
            .flat_map(|power| [1.0, 2.0, 5.0].map(|times| times * 10f64.powi(power)))
            .filter(|v| (self.range.low..=self.range.high).contains(&v.log10()))
            .map(|v| (v, format!("{v}")))
            .collect()
    }
}

/// NaN where there is no logarithm, which interrupts lines.
fn log10(value: f64) -> f64 {
    if value > 0.0 { value.log10() } else { f64::NAN }
}

fn figure(out: &mut String, figure: &Figure) {
    let lines = |k: usize| figure.series.iter().flat_map(move |s| s.points.iter().map(move |p| p[k]));
    let all = |k: usize| lines(k).chain(figure.marks.iter().map(move |mark| mark.at[k]));
    let bands = figure.series.iter().flat_map(|s| s.band.iter().flatten().copied());
    let margin = if figure.map || !figure.marks.is_empty() { 0.05 } else { 0.0 };
    let mut x = Scale::over(all(0), margin, figure.logarithmic_x);
    let mut y = Scale::over(all(1).chain(bands), 0.06, figure.logarithmic);
    let wide = WIDTH - LEFT - RIGHT;
    let high = if figure.map {
        // As flat or as tall as what it shows, within reason.
        (wide * y.range.span() / x.range.span()).clamp(0.3 * wide, wide).round()
    } else {
        HEIGHT - TOP - BOTTOM
    };
    let height = high + TOP + BOTTOM;
    if figure.map {
        // The axis with room to spare is widened until a length is the same along both.
        let unit = (x.range.span() / wide).max(y.range.span() / high);
        x.range = about_the_middle(x.range, unit * wide);
        y.range = about_the_middle(y.range, unit * high);
    } else if !figure.logarithmic {
        y.range = Range { low: y.range.low.min(0.0), high: y.range.high };
    }
    let at = |[a, b]: [f64; 2]| [LEFT + x.share(a) * wide, TOP + (1.0 - y.share(b)) * high];
    let _ = write!(
        out,
        "<figure class=\"chart\"><figcaption>{title} <span class=\"unit\">{y}</span></figcaption>\
         <svg viewBox=\"0 0 {WIDTH} {height}\" role=\"img\" aria-label=\"{title}: {y} over {x}\">\
         <g class=\"tick\" text-anchor=\"end\">",
        title = Escaped(&figure.title),
        x = Escaped(&figure.x),
        y = Escaped(&figure.y),
    );
    let mut lines = String::new();
    for (value, label) in y.marks(5.0) {
        let down = TOP + (1.0 - y.share(value)) * high;
        let _ = write!(lines, "M{LEFT},{}H{}", At(down), WIDTH - RIGHT);
        let _ = write!(out, "<text x=\"{}\" y=\"{}\">{label}</text>", LEFT - 6.0, At(down + 4.0));
    }
    let floor = TOP + high;
    let _ = write!(
        out,
        "<text x=\"{}\" y=\"{}\">{}</text></g><g class=\"tick\" text-anchor=\"middle\">",
        WIDTH - RIGHT,
        height - 6.0,
        Escaped(&figure.x)
    );
    let mut free = 0.0;
    for (value, label) in x.marks(6.0) {
        let middle = inside(LEFT + x.share(value) * wide, &label, 11.0, WIDTH);
        let half = half_width(&label, 11.0);
        // A label that would run into the one before is left out.
        if middle - half >= free {
            free = middle + half + 4.0;
            let _ = write!(out, "<text x=\"{}\" y=\"{}\">{label}</text>", At(middle), At(floor + 15.0));
        }
    }
    let _ = write!(
        out,
        "</g><path class=\"grid\" d=\"{lines}\"/><path class=\"axis\" d=\"M{LEFT},{}H{}\"/>",
        At(floor),
        WIDTH - RIGHT
    );
    let mut key = String::new();
    let mut coloured = 0;
    for series in &figure.series {
        let colour = if series.reference {
            "--c:var(--ink)".to_owned()
        } else {
            coloured += 1;
            format!("--c:var(--c{})", (coloured - 1) % COLOURS)
        };
        let dashed = if coloured > COLOURS || series.reference { " dashed" } else { "" };
        let class = match (series.dots, series.reference) {
            (true, _) => "spots",
            (false, true) => "reference",
            (false, false) => "mean",
        };
        if !series.band.is_empty() {
            let edge =
                |k: usize| series.points.iter().zip(&series.band).map(move |(p, band)| at([p[0], band[k]]));
            let around = edge(0).chain(edge(1).rev()).filter(|p| p.iter().all(|v| v.is_finite()));
            let _ = write!(out, "<path class=\"band\" style=\"{colour}\" d=\"{}Z\"/>", path(around));
        }
        let points = series.points.iter().map(|p| at(*p));
        let d = if series.dots { dots(points) } else { path(points) };
        let _ =
            write!(out, "<g class=\"{dashed}\" style=\"{colour}\"><path class=\"{class}\" d=\"{d}\"/></g>");
        let _ = write!(
            key,
            "<li style=\"{colour}\"><span class=\"swatch{dashed}{}\"></span>{}</li>",
            if series.dots { " spot" } else { "" },
            Escaped(&series.name)
        );
    }
    marks(out, &figure.marks, at);
    let _ = write!(out, "</svg><ul class=\"key\">{key}</ul></figure>");
}

/// Draws the marks; names move down until they cover no other.
fn marks(out: &mut String, marks: &[Mark], at: impl Fn([f64; 2]) -> [f64; 2]) {
    const FONT: f64 = 11.5;
    const LINE: f64 = 12.5;
    let mut names = String::new();
    let mut taken: Vec<[f64; 3]> = Vec::new();
    let mut sorted: Vec<(&Mark, [f64; 2])> = marks.iter().map(|mark| (mark, at(mark.at))).collect();
    sorted.retain(|(_, [x, y])| x.is_finite() && y.is_finite());
    taken.extend(sorted.iter().map(|(_, [x, y])| [x - 4.0, x + 4.0, y + 4.0]));
    taken.sort_by(|a, b| a[2].total_cmp(&b[2]));
    sorted.sort_by(|a, b| a.1[1].total_cmp(&b.1[1]));
    for (mark, [x, y]) in sorted {
        let class = if mark.labelled { " class=\"front\"" } else { "" };
        let _ = write!(
            out,
            "<circle{class} cx=\"{}\" cy=\"{}\" r=\"3.5\"><title>{}</title></circle>",
            At(x),
            At(y),
            Escaped(&mark.name)
        );
        if !mark.labelled {
            continue;
        }
        let wide = 0.56 * FONT * mark.name.chars().count() as f64;
        let left = if x + 7.0 + wide < WIDTH - 2.0 { x + 7.0 } else { x - 7.0 - wide };
        let mut down = y + 4.0;
        for [a, b, line] in &taken {
            if left < *b && left + wide > *a && (down - line).abs() < LINE {
                down = line + LINE;
            }
        }
        taken.push([left, left + wide, down]);
        taken.sort_by(|a, b| a[2].total_cmp(&b[2]));
        let _ = write!(names, "<text x=\"{}\" y=\"{}\">{}</text>", At(left), At(down), Escaped(&mark.name));
    }
    if !names.is_empty() {
        let _ = write!(out, "<g class=\"names\">{names}</g>");
    }
}

fn about_the_middle(range: Range, span: f64) -> Range {
    let middle = 0.5 * (range.low + range.high);
    Range { low: middle - 0.5 * span, high: middle + 0.5 * span }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Beside the page and nowhere else.
    #[test]
    fn pictures_are_shown() {
        let picture = Picture { title: "a \"film\"".into(), file: "shape.gif".into(), size: [640, 480] };
        let section = Section { pictures: vec![picture], ..Section::default() };
        let page = render(&StudyReport { sections: vec![section], ..StudyReport::default() });
        assert!(super::super::tests::is_balanced(&page));
        assert!(
            page.contains("<img src=\"shape.gif\" alt=\"a &quot;film&quot;\" width=\"640\" height=\"480\"")
        );
    }

    fn sample() -> StudyReport {
        let line = |name: &str, values: &[f64]| Series {
            name: name.into(),
            points: values.iter().enumerate().map(|(i, v)| [i as f64, *v]).collect(),
            ..Series::default()
        };
        let figure = Figure {
            title: "error".into(),
            x: "noise".into(),
            y: "km".into(),
            logarithmic: true,
            map: false,
            logarithmic_x: true,
            series: vec![line("a", &[0.1, 1.0, -3.0, 10.0]), line("b", &[f64::NAN; 3])],
            marks: [1.0, -1.0, f64::NAN]
                .map(|v| Mark { at: [v, 2.0], name: "m".into(), labelled: true })
                .to_vec(),
        };
        let doubtful = Shown { doubt: Some("a copy".into()), ..Shown::from(0.5) };
        StudyReport {
            title: "a study".into(),
            sections: vec![Section {
                title: "part".into(),
                paragraphs: vec!["said".into()],
                points: vec!["first".into()],
                figures: vec![
                    figure.clone(),
                    Figure { logarithmic: false, map: true, ..figure },
                    Figure::default(),
                ],
                pictures: Vec::new(),
                tables: vec![Grid {
                    caption: "numbers".into(),
                    head: vec!["x".into(), "y".into()],
                    rows: vec![vec!["a".into(), doubtful.clone()], vec![None::<f64>.into(), doubtful]],
                }],
            }],
            ..StudyReport::default()
        }
    }

    #[test]
    fn markup_is_balanced_and_asks_nothing_of_the_network() {
        for report in [sample(), StudyReport::default()] {
            let page = render(&report);
            assert!(super::super::tests::is_balanced(&page));
            for way_out in ["http:", "https:", "src=", "@import", "url(", "<link", "<script"] {
                assert!(!page.contains(way_out), "{way_out}");
            }
            assert!(!page.contains("NaN"));
        }
    }

    #[test]
    fn doubts_are_told_once() {
        let page = render(&sample());
        assert_eq!(page.matches("a copy").count(), 1);
        assert_eq!(page.matches("<sup class=\"doubt\">1</sup>").count(), 3);
    }

    #[test]
    fn texts_stay_texts() {
        let evil = "</title><script>alert('x')</script>";
        let mut report = sample();
        report.title = evil.into();
        report.facts = vec![(evil.into(), evil.into())];
        report.sections[0].points = vec![evil.into()];
        report.sections[0].figures[0].series[0].name = evil.into();
        report.sections[0].tables[0].rows[0][0] = Shown { aside: evil.into(), ..evil.into() };
        let page = render(&report);
        assert!(!page.contains("<script"));
    }

    /// A length of one along x and along y is drawn alike on a map.
    #[test]
    fn maps_do_not_stretch() {
        let wide = about_the_middle(Range { low: 0.0, high: 2.0 }, 6.0);
        assert_eq!((wide.low, wide.high), (-2.0, 4.0));
    }
}
