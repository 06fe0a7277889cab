//! What every picture needs: numbers, escaping, ticks and the path from data to the page.

use std::fmt;

/// Text that may hold anything, safe inside HTML, SVG and quoted attributes.
pub(super) struct Escaped<'a>(pub &'a str);

impl fmt::Display for Escaped<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for c in self.0.chars() {
            match c {
                '&' => f.write_str("&amp;")?,
                '<' => f.write_str("&lt;")?,
                '>' => f.write_str("&gt;")?,
                '"' => f.write_str("&quot;")?,
                '\'' => f.write_str("&#39;")?,
                // XML has no way to write these.
                c if c.is_control() && c != '\n' && c != '\t' => f.write_str("\u{fffd}")?,
                '\u{fffe}' | '\u{ffff}' => f.write_str("\u{fffd}")?,
                c => write!(f, "{c}")?,
            }
        }
        Ok(())
    }
}

/// A coordinate on the page: a tenth of a unit is finer than a screen shows.
pub(super) struct At(pub f64);

impl fmt::Display for At {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let tenths = (self.0.clamp(-1e5, 1e5) * 10.0).round() as i64;
        let sign = if tenths < 0 { "-" } else { "" };
        let (whole, tenth) = (tenths.abs() / 10, tenths.abs() % 10);
        if tenth == 0 { write!(f, "{sign}{whole}") } else { write!(f, "{sign}{whole}.{tenth}") }
    }
}

/// A number for reading: about four figures, thousands apart, a true minus sign.
pub(super) fn readable(value: f64) -> String {
    let size = value.abs();
    if !value.is_finite() {
        return if value.is_nan() {
            "–".into()
        } else if value > 0.0 {
            "∞".into()
        } else {
            "−∞".into()
        };
    }
    let text = match size {
        0.0 => "0".into(),
        s if !(1e-3..1e9).contains(&s) => format!("{size:.2e}"),
        s if s >= 1000.0 => group(size.round() as u64),
        s if s >= 100.0 => format!("{size:.1}"),
        s if s >= 1.0 => format!("{size:.2}"),
        _ => format!("{size:.3}"),
    };
    if value < 0.0 { format!("−{text}") } else { text }
}

/// Two decimals and a sign, which zero has none.
pub(super) fn signed(value: f64) -> String {
    if value.abs() >= 1e5 {
        return format!("{value:+.2e}").replace('-', "−");
    }
    match format!("{value:+.2}") {
        text if text.ends_with("0.00") && text.len() == 5 => "0.00".into(),
        text => text.replace('-', "−"),
    }
}

/// A count with its thousands apart.
pub(super) fn group(count: u64) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (i, d) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(d);
    }
    text
}

/// Where an axis is marked: round numbers, and how many decimals tell them apart.
pub(super) struct Ticks {
    pub at: Vec<f64>,
    pub step: f64,
    decimals: usize,
}

impl Ticks {
    /// About `count` ticks between `low` and `high`, at 1, 2 or 5 times a power of ten.
    pub(super) fn between(low: f64, high: f64, count: f64) -> Ticks {
        let step = round_step((high - low) / count);
        let first = (low / step).ceil();
        let many = ((high / step).floor() - first).clamp(0.0, 100.0) as usize;
        Ticks {
            at: (0..=many).map(|i| (first + i as f64) * step).collect(),
            step,
            decimals: (-step.log10().floor()).clamp(0.0, 9.0) as usize,
        }
    }

    /// The label of a tick.
    pub(super) fn label(&self, value: f64) -> String {
        let size = value.abs();
        if size >= 1e7 {
            return format!("{value:.1e}").replace('-', "−");
        }
        // Half a step below zero is zero, without a sign.
        let sign = if value < -0.5 * self.step { "−" } else { "" };
        format!("{sign}{size:.*}", self.decimals)
    }
}

/// Half of a label's width: digits are about 0.58 of the font's size wide.
pub(super) fn half_width(label: &str, font: f64) -> f64 {
    0.29 * font * label.chars().count() as f64
}

/// Where to centre a label at `x` so that none of it lies beyond `width`.
pub(super) fn inside(x: f64, label: &str, font: f64, width: f64) -> f64 {
    x.min(width - half_width(label, font))
}

/// The number of 1, 2 or 5 times a power of ten next to `about`.
pub(super) fn round_step(about: f64) -> f64 {
    let power = 10.0_f64.powf(about.log10().floor());
    let times = about / power;
    let round =
        [(1.0, 1.5), (2.0, 3.5), (5.0, 7.5)].into_iter().find(|(_, to)| times <= *to).map_or(10.0, |r| r.0);
    round * power
}

/// A range of finite numbers that is never empty.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    pub low: f64,
    pub high: f64,
}

impl Range {
    /// Over the finite ones (below 1e150) of `values`, with `margin` of their span on both sides.
    pub(super) fn over(values: impl Iterator<Item = f64>, margin: f64) -> Range {
        // Beyond this a span, or its square, would not be a number any more.
        let finite = values.filter(|v| v.abs() < 1e150);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for v in finite {
            low = low.min(v);
            high = high.max(v);
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        // A constant still needs an axis, and one with room for digits that f64 has.
        let least = (low.abs().max(high.abs()) * 1e-9).max(1e-12);
        let pad = if high - low > least { (high - low) * margin } else { least.max(0.5) };
        Range { low: low - pad, high: high + pad }
    }

    pub(super) fn span(&self) -> f64 {
        self.high - self.low
    }
}

/// At most about `limit` places of `count`, evenly spread, with the first and the last.
pub(super) fn thinned(count: usize, limit: usize) -> impl Iterator<Item = usize> {
    let step = count.div_ceil(limit.max(2)).max(1);
    let last = count.checked_sub(1).filter(|last| last % step != 0);
    (0..count).step_by(step).chain(last)
}

/// An SVG path through points that are already on the page; a point that is not finite interrupts it.
pub(super) fn path(points: impl Iterator<Item = [f64; 2]>) -> String {
    let mut d = String::new();
    let mut pen_down = false;
    for [x, y] in points {
        let drawn = x.is_finite() && y.is_finite();
        if drawn {
            d.push_str(&format!("{}{},{}", if pen_down { 'L' } else { 'M' }, At(x), At(y)));
        }
        pen_down = drawn;
    }
    d
}

/// Dots as one path of strokes without length, whose round ends are the dots: twelve bytes each.
pub(super) fn dots(points: impl Iterator<Item = [f64; 2]>) -> String {
    points
        .filter(|[x, y]| x.is_finite() && y.is_finite())
        .map(|[x, y]| format!("M{},{}h0", At(x), At(y)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_cannot_leave_its_place() {
        assert_eq!(Escaped("<b a='1'>\"&\u{0}").to_string(), "&lt;b a=&#39;1&#39;&gt;&quot;&amp;\u{fffd}");
    }

    #[test]
    fn ticks_are_round() {
        let labels = |low, high| {
            let ticks = Ticks::between(low, high, 5.0);
            ticks.at.iter().map(|v| ticks.label(*v)).collect::<Vec<_>>()
        };
        assert_eq!(labels(-0.9, 1.1), ["−0.5", "0.0", "0.5", "1.0"]);
        assert_eq!(labels(3.0, 98.0), ["20", "40", "60", "80"]);
        assert_eq!(labels(0.0, 0.05), ["0.00", "0.01", "0.02", "0.03", "0.04", "0.05"]);
        assert_eq!(labels(-3500.0, 4200.0), ["−2000", "0", "2000", "4000"]);
    }

    #[test]
    fn numbers_are_readable() {
        assert_eq!(readable(-1234.5), "−1\u{202f}235");
        assert_eq!(readable(12.345), "12.35");
        assert_eq!(readable(0.012_34), "0.012");
        assert_eq!([signed(-0.001), signed(-0.25), signed(10.0)], ["0.00", "−0.25", "+10.00"]);
        assert_eq!(At(-0.04).to_string(), "0");
        assert_eq!(At(-12.34).to_string(), "-12.3");
    }

    #[test]
    fn labels_stay_inside() {
        assert_eq!(inside(300.0, "1000", 11.0, 360.0), 300.0);
        assert!((inside(358.0, "1000", 11.0, 360.0) - (360.0 - 4.0 * 0.29 * 11.0)).abs() < 1e-9);
    }

    #[test]
    fn thinning_keeps_both_ends() {
        assert_eq!(thinned(10, 4).collect::<Vec<_>>(), [0, 3, 6, 9]);
        assert_eq!(thinned(11, 4).collect::<Vec<_>>(), [0, 3, 6, 9, 10]);
        assert_eq!(thinned(0, 4).count(), 0);
        assert_eq!(thinned(1, 0).collect::<Vec<_>>(), [0]);
    }

    #[test]
    fn ranges_are_never_empty() {
        for values in [vec![], vec![f64::NAN], vec![4.5e6], vec![0.0, 0.0], vec![-f64::MAX, f64::MAX]] {
            let range = Range::over(values.into_iter(), 0.1);
            assert!(range.span() > 0.0 && range.span().is_finite(), "{range:?}");
        }
    }

    #[test]
    fn a_gap_lifts_the_pen() {
        let points = [[0.0, 0.0], [1.0, 1.0], [f64::NAN, 1.0], [3.0, 1.0]];
        assert_eq!(path(points.into_iter()), "M0,0L1,1M3,1");
    }
}
