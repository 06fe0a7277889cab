//! Letters as strokes, for pictures of pixels: a font would weigh more than all else that is drawn.

/// What to do with the pen, on a grid whose lines of writing have their base at 2 and capitals end at 8.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stroke {
    Move([f32; 2]),
    Line([f32; 2]),
    /// By way of the first point to the second (a parabola).
    Curve([f32; 2], [f32; 2]),
}

/// Height of capitals on the grid.
pub(super) const CAPITAL: f32 = 6.0;
/// Height of the line that letters stand on.
pub(super) const BASE: f32 = 2.0;
/// Free space beside a letter.
const GAP: f32 = 2.0;
/// Width of a space.
const SPACE: f32 = 2.0;

/// The strokes of a letter: m, l and q with coordinates of one digit each. Capitals are written as small letters, and what
/// is not here as a box.
fn strokes(letter: char) -> &'static str {
    match letter.to_ascii_lowercase() {
        ' ' => "",
        'a' => "m44q4626q0604q0222q4244m46l42",
        'b' => "m44q4626q0604q0222q4244m08l02",
        'c' => "m45q4626q0604q0222q4243",
        'd' => "m44q4626q0604q0222q4244m48l42",
        'e' => "m04l44q4626q0604q0222q4243",
        'f' => "m38q1816l12m06l36",
        'g' => "m44q4626q0604q0222q4244m46l42q4020q0001",
        'h' => "m08l02m04q0626q4644l42",
        'i' => "m06l02m08l08",
        'j' => "m16l12q1000m18l18",
        'k' => "m08l02m36l03m14l32",
        'l' => "m08l02",
        'm' => "m06l02m04q0616q2624l22m24q2636q4644l42",
        'n' => "m06l02m04q0626q4644l42",
        'o' => "m44q4626q0604q0222q4244",
        'p' => "m44q4626q0604q0222q4244m06l00",
        'q' => "m44q4626q0604q0222q4244m46l40",
        'r' => "m06l02m04q0636",
        's' => "m45q4626q0605q0424q4443q4222q0203",
        't' => "m18l13q1232m06l36",
        'u' => "m06l04q0222q4244m46l42",
        'v' => "m06l22l46",
        'w' => "m06l12l26l32l46",
        'x' => "m06l42m46l02",
        'y' => "m06l22m46l10",
        'z' => "m06l46l02l42",
        '0' => "m45q4828q0805q0222q4245",
        '1' => "m06l28l22",
        '2' => "m06q0828q4846q4502l42",
        '3' => "m07q0828q4846q4525q4543q4222q0203",
        '4' => "m32l38l04l44",
        '5' => "m48l08l05q1626q4644q4222q0203",
        '6' => "m38q0804q0222q4244q4626q0604",
        '7' => "m08l48l12",
        '8' => "m25q0506q0828q4846q4525q0503q0222q4243q4525",
        '9' => "m12q4246q4828q0806q0424q4446",
        '-' => "m04l34",
        '.' => "m02l02",
        ':' => "m02l02m05l05",
        '/' => "m02l38",
        _ => "m02l08l48l42l02",
    }
}

/// The strokes of a text from x = 0 on, and its width.
pub(super) fn written(text: &str) -> (Vec<Stroke>, f32) {
    let (mut all, mut left) = (Vec::new(), 0.0);
    for letter in text.chars() {
        let mut width = if letter == ' ' { SPACE } else { 0.0 };
        let strokes = strokes(letter).as_bytes();
        let mut rest = strokes;
        while let [what, coordinates @ ..] = rest {
            let mut point = |at: usize| {
                let digit = |k: usize| coordinates.get(k).map_or(0.0, |c| f32::from(c.saturating_sub(b'0')));
                width = digit(at).max(width);
                [left + digit(at), digit(at + 1)]
            };
            let (stroke, used) = match what {
                b'q' => (Stroke::Curve(point(0), point(2)), 4),
                b'm' => (Stroke::Move(point(0)), 2),
                _ => (Stroke::Line(point(0)), 2),
            };
            all.push(stroke);
            rest = coordinates.get(used..).unwrap_or_default();
        }
        left += width + GAP;
    }
    (all, (left - GAP).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every letter is inside its line, and is told from every other.
    #[test]
    fn letters_differ_and_stay_in_line() {
        let letters = "abcdefghijklmnopqrstuvwxyz0123456789-.:/#";
        for letter in letters.chars() {
            let (all, width) = written(&letter.to_string());
            assert!(matches!(all[0], Stroke::Move(_)), "{letter}");
            assert!(width <= 4.0);
            for stroke in &all {
                let (Stroke::Move(end) | Stroke::Line(end) | Stroke::Curve(_, end)) = stroke;
                assert!(end[0] <= width && end[1] <= BASE + CAPITAL, "{letter}");
            }
            let same = letters.chars().filter(|other| written(&other.to_string()).0 == all);
            assert_eq!(same.count(), 1, "{letter}");
        }
        assert_eq!(written("A"), written("a"));
    }

    #[test]
    fn letters_follow_each_other() {
        let (all, width) = written("l l");
        // Widths of 0, 2 and 0 with two gaps.
        assert_eq!((all.len(), width), (4, 6.0));
        assert_eq!(all[2], Stroke::Move([6.0, 8.0]));
        assert_eq!(written(""), (Vec::new(), 0.0));
    }
}
