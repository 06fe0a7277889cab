//! Where runs begin: the benchmark's three protocols.

use serde::{Deserialize, Serialize};
use zerre_vision::Rect;

/// Starts of the temporal evaluation.
pub const STARTS: usize = 20;
/// Fewest frames that a start leaves to follow.
const SHORTEST: usize = 20;

/// A protocol of the benchmark (Wu, Lim and Yang 2015, section 4).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Protocol {
    /// One-pass evaluation: from the first annotated frame, with its box, to the end.
    OnePass,
    /// Temporal robustness: from 20 frames, each with its box, to the end.
    Temporal,
    /// Spatial robustness: from the first annotated frame with 12 wrong boxes.
    Spatial,
}

impl Protocol {
    /// All of them.
    pub const ALL: [Protocol; 3] = [Protocol::OnePass, Protocol::Temporal, Protocol::Spatial];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Protocol::OnePass => "one-pass",
            Protocol::Temporal => "temporal",
            Protocol::Spatial => "spatial",
        }
    }

    /// Where its runs begin in a sequence with this annotation; nothing without a box.
    pub fn starts(self, truth: &[Option<Rect>]) -> Vec<Start> {
        let Some(first) = truth.iter().position(Option::is_some) else { return Vec::new() };
        let exact = |frame| Start { frame, shift: None };
        match self {
            Protocol::OnePass => vec![exact(first)],
            Protocol::Temporal => temporal(truth, first).into_iter().map(exact).collect(),
            Protocol::Spatial => {
                Shift::ALL.iter().map(|shift| Start { frame: first, shift: Some(*shift) }).collect()
            }
        }
    }
}

/// Where a run begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Start {
    /// Frame, from 0.
    pub frame: usize,
    /// What is wrong with its box.
    pub shift: Option<Shift>,
}

/// The frames at which the benchmark splits a sequence: evenly over those whose box begins on the picture and
/// which leave 20 frames to follow, and the last of them. The benchmark also leaves out frames in which the
/// object is hidden, by lists that do not come with its annotations; here they may be among the starts.
fn temporal(truth: &[Option<Rect>], first: usize) -> Vec<usize> {
    let whole = |(at, bounds): (usize, &Option<Rect>)| {
        let bounds = (*bounds)?;
        (bounds.x >= 0.0 && bounds.y >= 0.0 && truth.len() - at >= SHORTEST).then_some(at)
    };
    let able: Vec<usize> = truth.iter().enumerate().filter_map(whole).collect();
    let Some(last) = able.len().checked_sub(1) else { return vec![first] };
    let mut starts: Vec<usize> =
        (0..STARTS - 1).filter_map(|k| able.get(k * able.len() / (STARTS - 1)).copied()).collect();
    starts.push(able[last]);
    starts.dedup();
    starts
}

/// A wrong box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Shift {
    /// Moved by a tenth of its size, -1, 0 or 1 times across and down.
    Moved(i8, i8),
    /// One corner moved outwards by a tenth of the size: left or right, upper or lower.
    Corner(i8, i8),
    /// So many tenths of its size, about its centre.
    Scaled(u8),
}

impl Shift {
    /// Those of the benchmark.
    pub const ALL: [Shift; 12] = [
        Shift::Moved(-1, 0),
        Shift::Moved(1, 0),
        Shift::Moved(0, -1),
        Shift::Moved(0, 1),
        Shift::Corner(-1, -1),
        Shift::Corner(1, -1),
        Shift::Corner(-1, 1),
        Shift::Corner(1, 1),
        Shift::Scaled(8),
        Shift::Scaled(9),
        Shift::Scaled(11),
        Shift::Scaled(12),
    ];

    /// The wrong box, cut at the border of a frame of this size; whole pixels as in the benchmark.
    pub fn of(self, bounds: Rect, (width, height): (usize, usize)) -> Rect {
        let Rect { x, y, width: w, height: h } = bounds;
        let (left, top, right, bottom) = match self {
            Shift::Moved(across, down) => {
                let by = |times: i8, side: f64| f64::from(times) * (0.1 * side + 0.5).round();
                let (dx, dy) = (by(across, w), by(down, h));
                (x + dx, y + dy, x + w + dx, y + h + dy)
            }
            Shift::Corner(across, down) => {
                let (mut left, mut top, mut right, mut bottom) = (x, y, x + w, y + h);
                if across < 0 {
                    left = (x - 0.1 * w).round();
                } else {
                    right = (right + 0.1 * w).round();
                }
                if down < 0 {
                    top = (y - 0.1 * h).round();
                } else {
                    bottom = (bottom + 0.1 * h).round();
                }
                (left, top, right, bottom)
            }
            Shift::Scaled(tenths) => {
                let times = f64::from(tenths) / 10.0;
                let [cx, cy] = bounds.centre();
                let (w, h) = (times * w, times * h);
                let (left, top) = ((cx - w / 2.0).round(), (cy - h / 2.0).round());
                (left, top, left + w.round(), top + h.round())
            }
        };
        let (left, top) = (left.max(0.0), top.max(0.0));
        let (right, bottom) = (right.min(width as f64), bottom.min(height as f64));
        Rect { x: left, y: top, width: right - left, height: bottom - top }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxes(count: usize) -> Vec<Option<Rect>> {
        vec![Some(Rect { x: 10.0, y: 10.0, width: 4.0, height: 4.0 }); count]
    }

    /// 120 frames: 101 leave 20 to follow; every 101 / 19 = 5.3th of them, rounded down, and the last.
    #[test]
    fn temporal_starts_are_twenty_over_the_sequence() {
        let frames = |truth: &[Option<Rect>]| -> Vec<usize> {
            Protocol::Temporal.starts(truth).iter().map(|start| start.frame).collect()
        };
        let starts = frames(&boxes(120));
        assert_eq!(starts.len(), 20);
        assert_eq!(starts[..5], [0, 5, 10, 15, 21]);
        assert_eq!(starts[18..], [95, 100]);
        let mut truth = boxes(120);
        truth[0] = None;
        truth[5] = Some(Rect { x: -1.0, y: 0.0, width: 4.0, height: 4.0 });
        assert_eq!(frames(&truth)[..2], [1, 7]);
        // Too short to be split: as in one pass.
        assert_eq!(frames(&boxes(12)), [0]);
        assert_eq!(frames(&boxes(22)), [0, 1, 2]);
        assert!(Protocol::OnePass.starts(&[None, None]).is_empty());
    }

    #[test]
    fn wrong_boxes_are_off_by_a_tenth() {
        let right = Rect { x: 50.0, y: 40.0, width: 20.0, height: 30.0 };
        let off = |shift: Shift| shift.of(right, (100, 80)).to_string();
        // A tenth of 20 is 2, and the benchmark rounds 2.5 up.
        assert_eq!(off(Shift::Moved(-1, 0)), "47,40,20,30");
        assert_eq!(off(Shift::Moved(0, 1)), "50,44,20,30");
        assert_eq!(off(Shift::Corner(-1, -1)), "48,37,22,33");
        assert_eq!(off(Shift::Corner(1, 1)), "50,40,22,33");
        assert_eq!(off(Shift::Scaled(8)), "52,43,16,24");
        assert_eq!(off(Shift::Scaled(12)), "48,37,24,36");
        // At the border it is cut.
        assert_eq!(Shift::Moved(1, 0).of(right, (72, 80)).to_string(), "53,40,19,30");
        assert_eq!(Shift::Moved(0, -1).of(Rect { y: 1.0, ..right }, (100, 80)).to_string(), "50,0,20,27");
        assert_eq!(Protocol::Spatial.starts(&boxes(3)).len(), 12);
    }
}
