//! A small time series: bands, lines, dots and levels over one axis of time.

use super::svg::{At, Escaped, Range, Ticks, dots, inside, path, thinned};

const WIDTH: f64 = 360.0;
const HEIGHT: f64 = 178.0;
const LEFT: f64 = 50.0;
const RIGHT: f64 = 8.0;
const TOP: f64 = 8.0;
const BOTTOM: f64 = 34.0;

/// Something drawn; classes name styles of the page.
pub(super) enum Layer {
    /// (time, low, high) and class.
    Band(Vec<[f64; 3]>, &'static str),
    /// (time, value) and class.
    Line(Vec<[f64; 2]>, &'static str),
    /// (time, value) and class; those outside the levels survive thinning.
    Dots(Vec<[f64; 2]>, &'static str),
    /// A horizontal line.
    Level(f64),
}

/// What the dots of a class are.
pub(super) struct Key {
    pub class: &'static str,
    pub name: String,
}

/// One picture.
pub(super) struct Chart<'a> {
    /// For the caption and for screen readers.
    pub title: &'a str,
    /// Follows the title: each name behind a dot as the picture draws it.
    pub key: Vec<Key>,
    /// Unit of the values; empty for pure numbers.
    pub unit: &'a str,
    /// Time shown, in `time_unit`.
    pub time: Range,
    /// Unit of the times.
    pub time_unit: &'a str,
    /// At most this many points per layer.
    pub limit: usize,
    /// From back to front.
    pub layers: Vec<Layer>,
    /// The value axis starts at zero.
    pub from_zero: bool,
}

impl Chart<'_> {
    /// A `<figure>`: caption and picture.
    pub(super) fn render(&self) -> String {
        let values = self.value_range();
        let (width, height) = (WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM);
        let x = |t: f64| (t - self.time.low) / self.time.span() * width;
        let y = |v: f64| (values.high - v) / values.span() * height;

        let unit = if self.unit.is_empty() { String::new() } else { format!(" ({})", Escaped(self.unit)) };
        let marks: Vec<_> = self.key.iter().map(|key| self.mark(key)).collect();
        let names: Vec<_> = self.key.iter().map(|key| Escaped(&key.name).to_string()).collect();
        let colon = if self.key.is_empty() { "" } else { ": " };
        let (marks, names) = (marks.join(", "), names.join(", "));
        let mut out = format!(
            "<figure class=\"chart\"><figcaption>{title}{colon}{marks}<span class=\"unit\">{unit}</span></figcaption>\
             <svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{title}{colon}{names}{unit} over time\" \
             data-x0=\"{}\" data-x1=\"{}\" data-y0=\"{}\" data-y1=\"{}\" data-tu=\"{}\" data-vu=\"{}\">",
            self.time.low,
            self.time.high,
            values.low,
            values.high,
            Escaped(self.time_unit),
            Escaped(self.unit),
            title = Escaped(self.title),
        );
        // Labels share the attributes of their group: a page has thousands.
        let ticks = Ticks::between(values.low, values.high, 4.5);
        let mut grid = String::new();
        out.push_str("<g class=\"tick\" text-anchor=\"end\">");
        for v in &ticks.at {
            let (at, base, label) = (At(TOP + y(*v)), At(TOP + y(*v) + 4.0), ticks.label(*v));
            grid.push_str(&format!("M{LEFT},{at}H{}", WIDTH - RIGHT));
            out.push_str(&format!("<text x=\"{}\" y=\"{base}\">{label}</text>", LEFT - 6.0));
        }
        out.push_str(&format!(
            "<text x=\"{}\" y=\"{}\">time ({})</text></g><g class=\"tick\" text-anchor=\"middle\">",
            WIDTH - RIGHT,
            HEIGHT - 5.0,
            Escaped(self.time_unit)
        ));
        let ticks = Ticks::between(self.time.low, self.time.high, 6.0);
        let floor = TOP + height;
        for t in &ticks.at {
            let (base, label) = (floor + 14.0, ticks.label(*t));
            let at = At(inside(LEFT + x(*t), &label, 11.0, WIDTH));
            out.push_str(&format!("<text x=\"{at}\" y=\"{base}\">{label}</text>"));
        }
        out.push_str(&format!(
            "</g><path class=\"grid\" d=\"{grid}\"/><path class=\"axis\" d=\"M{LEFT},{}H{}\"/>\
             <svg x=\"{LEFT}\" y=\"{TOP}\" width=\"{width}\" height=\"{height}\">",
            At(floor),
            WIDTH - RIGHT
        ));
        for layer in &self.layers {
            out.push_str(&self.layer(layer, &x, &y, width));
        }
        out.push_str("</svg></svg></figure>");
        out
    }

    /// A name behind its dot, on one line with it; alone it needs none.
    fn mark(&self, Key { class, name }: &Key) -> String {
        if self.key.len() == 1 {
            return Escaped(name).to_string();
        }
        format!(
            "<span class=\"named\"><svg class=\"mark\" viewBox=\"0 0 10 10\" aria-hidden=\"true\">\
             <path class=\"{class}\" d=\"M5,5h0\"/></svg>{}</span>",
            Escaped(name)
        )
    }

    fn layer(&self, layer: &Layer, x: &dyn Fn(f64) -> f64, y: &dyn Fn(f64) -> f64, width: f64) -> String {
        match layer {
            Layer::Level(v) => format!("<path class=\"level\" d=\"M0,{}H{width}\"/>", At(y(*v))),
            Layer::Line(points, class) => {
                let kept = thinned(points.len(), self.limit).map(|i| points[i]);
                format!("<path class=\"{class}\" d=\"{}\"/>", path(kept.map(|[t, v]| [x(t), y(v)])))
            }
            Layer::Dots(points, class) => {
                let levels = || {
                    self.layers.iter().filter_map(|l| if let Layer::Level(v) = l { Some(*v) } else { None })
                };
                let (low, high) =
                    levels().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
                let step = points.len().div_ceil(self.limit.max(1)).max(1);
                let mut outside = 0;
                let kept = points.iter().enumerate().filter(|(i, [_, v])| {
                    let far = low < high && (*v < low || *v > high) && outside < self.limit;
                    outside += usize::from(far);
                    far || i % step == 0
                });
                format!("<path class=\"{class}\" d=\"{}\"/>", dots(kept.map(|(_, [t, v])| [x(*t), y(*v)])))
            }
            Layer::Band(points, class) => {
                let kept: Vec<[f64; 3]> = thinned(points.len(), self.limit)
                    .map(|i| points[i])
                    .filter(|p| p.iter().all(|v| v.is_finite()))
                    .collect();
                let there = kept.iter().map(|[t, low, _]| [x(*t), y(*low)]);
                let back = kept.iter().rev().map(|[t, _, high]| [x(*t), y(*high)]);
                format!("<path class=\"{class}\" d=\"{}Z\"/>", path(there.chain(back)))
            }
        }
    }

    /// What lines and dots need, and nine tenths of the bands: the widest moments (a start without knowledge) would
    /// flatten all else and are cut instead.
    fn value_range(&self) -> Range {
        let mut values = Vec::new();
        for layer in &self.layers {
            match layer {
                Layer::Line(points, _) | Layer::Dots(points, _) => values.extend(points.iter().map(|p| p[1])),
                Layer::Level(v) => values.push(*v),
                Layer::Band(points, _) => {
                    let sorted = |edge: usize| {
                        let mut edges: Vec<f64> =
                            points.iter().map(|p| p[edge]).filter(|v| v.is_finite()).collect();
                        edges.sort_unstable_by(f64::total_cmp);
                        edges
                    };
                    let (low, high) = (sorted(1), sorted(2));
                    values.extend(low.get(low.len() / 20));
                    values.extend(high.get(high.len().saturating_sub(1 + high.len() / 20)));
                }
            }
        }
        let mut range = Range::over(values.into_iter(), 0.06);
        if self.from_zero {
            range = Range { low: 0.0, high: range.high.max(1e-9) };
        }
        range
    }
}
