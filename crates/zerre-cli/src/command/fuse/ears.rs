//! What devices and pose estimators say in a frame.

use super::tables::{JointRow, When};
use std::collections::BTreeMap;
use zerre_vision::rgbd::fusion::Source;
use zerre_vision::rgbd::{Reading, RgbdFrame};

/// Times that differ by less are the same, nanoseconds.
const SLACK: i64 = 1_000_000;
/// Rows that are so much older than the first frame say nothing of it, nanoseconds.
const OLD: i64 = 100_000_000;

/// What is said of each joint: the number of the source, and its reading.
pub(super) type Heard = BTreeMap<String, Vec<(usize, Vec<Reading>)>>;

/// What became of the rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Fate {
    /// The last of their source and joint before their frame.
    pub used: usize,
    /// Followed by another one before the next frame.
    pub replaced: usize,
    /// Before the first frame.
    pub early: usize,
    /// Behind the last frame.
    pub late: usize,
    /// Of frames that are not in the recording, or cannot be read.
    pub elsewhere: usize,
    /// Of sources that are left out.
    pub left_out: usize,
}

/// The rows of a table of joints, which are used up in the order of their times.
pub(super) struct Ears {
    timed: Vec<JointRow>,
    next: usize,
    framed: BTreeMap<String, Vec<JointRow>>,
    sources: Vec<String>,
    begun: bool,
    fate: Fate,
}

impl Ears {
    pub(super) fn new(rows: Vec<JointRow>, sources: &[Source]) -> Ears {
        let sources: Vec<String> = sources.iter().map(|source| source.name.clone()).collect();
        let (mut timed, mut framed, mut fate) = (Vec::new(), BTreeMap::new(), Fate::default());
        for row in rows {
            if !sources.contains(&row.source) {
                fate.left_out += 1;
                continue;
            }
            match &row.when {
                When::Time(time) => timed.push((*time, row)),
                When::Frame(name) => framed.entry(name.clone()).or_insert_with(Vec::new).push(row),
            }
        }
        // Of equal times the table's order holds.
        timed.sort_by_key(|(time, _)| *time);
        let timed = timed.into_iter().map(|(_, row)| row).collect();
        Ears { timed, next: 0, framed, sources, begun: false, fate }
    }

    /// The last reading of every joint and source since the frame before.
    pub(super) fn hear(&mut self, frame: &RgbdFrame) -> Heard {
        let mut rows = Vec::new();
        while let Some(row) = self.timed.get(self.next) {
            let When::Time(time) = &row.when else { break };
            let age = frame.time.nanos().saturating_sub(time.nanos());
            if age < -SLACK {
                break;
            }
            if !self.begun && age > OLD {
                self.fate.early += 1;
            } else {
                rows.push(row.clone());
            }
            self.next += 1;
        }
        self.begun = true;
        for name in [&frame.name, &frame.index.to_string()] {
            rows.extend(self.framed.remove(name).into_iter().flatten());
        }
        let mut last: BTreeMap<(String, usize), Reading> = BTreeMap::new();
        for row in rows {
            let Some(source) = self.sources.iter().position(|source| *source == row.source) else { continue };
            self.fate.used += 1;
            if last.insert((row.joint, source), row.reading).is_some() {
                self.fate.used -= 1;
                self.fate.replaced += 1;
            }
        }
        let mut heard = Heard::new();
        for ((joint, source), reading) in last {
            heard.entry(joint).or_default().push((source, vec![reading]));
        }
        heard
    }

    /// What became of the rows, after the last frame.
    pub(super) fn fate(&self) -> Fate {
        let elsewhere = self.framed.values().map(Vec::len).sum();
        Fate { late: self.timed.len() - self.next, elsewhere, ..self.fate }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use zerre::Time;
    use zerre_vision::Image;

    fn row(when: When, joint: &str, source: &str, x: f64) -> JointRow {
        let reading = Reading { at: [x, 0.0], depth_mm: None, confidence: 1.0 };
        JointRow { when, joint: joint.to_owned(), source: source.to_owned(), reading }
    }

    fn frame(index: usize, ms: i64) -> RgbdFrame {
        let (colour, depth) = (Image::filled(1, 1, [0; 3]), Image::filled(1, 1, 0));
        let time = Time::from_nanos(ms * 1_000_000);
        RgbdFrame { index, name: format!("{:04}.png", index + 1), time, colour, depth }
    }

    fn ears(rows: Vec<JointRow>) -> Ears {
        let settings = zerre_vision::rgbd::tracker::TrackerSettings::default();
        let other = Source { name: "other".to_owned(), ..settings.sources[0].clone() };
        Ears::new(rows, &[settings.sources[0].clone(), other])
    }

    /// Out of order, too early, too late, twice, of two joints and sources: each is where it belongs, and
    /// counted.
    #[test]
    fn rows_are_heard_in_their_frames() {
        let at = |ms: i64| When::Time(Time::from_nanos(ms * 1_000_000));
        let mut ears = ears(vec![
            row(at(1066), "a", "device", 5.0),
            row(at(500), "a", "device", 1.0),
            row(at(1000), "a", "device", 2.0),
            row(at(1020), "a", "device", 3.0),
            row(at(1034), "a", "device", 4.0),
            row(at(1030), "b", "other", 9.0),
            row(at(1030), "b", "absent", 9.0),
            row(at(2000), "a", "device", 6.0),
        ]);
        let said = |heard: &Heard, joint: &str| heard.get(joint).map(|said| (said[0].0, said[0].1[0].at[0]));
        let heard = ears.hear(&frame(0, 1000));
        assert_eq!((said(&heard, "a"), said(&heard, "b")), (Some((0, 2.0)), None));
        // 1034 is within a millisecond of 1033.
        let heard = ears.hear(&frame(1, 1033));
        assert_eq!((said(&heard, "a"), said(&heard, "b")), (Some((0, 4.0)), Some((1, 9.0))));
        assert_eq!(said(&ears.hear(&frame(2, 1066)), "a"), Some((0, 5.0)));
        assert!(ears.hear(&frame(3, 1100)).is_empty());
        let fate = Fate { used: 4, replaced: 1, early: 1, late: 1, elsewhere: 0, left_out: 1 };
        assert_eq!(ears.fate(), fate);
    }

    #[test]
    fn frames_are_known_by_name_and_by_place() {
        let name = |name: &str| When::Frame(name.to_owned());
        let mut ears = ears(vec![
            row(name("1"), "a", "device", 2.0),
            row(name("0001.png"), "a", "device", 1.0),
            row(name("7"), "a", "device", 3.0),
        ]);
        let x = |heard: Heard| heard["a"][0].1[0].at[0];
        assert_eq!((x(ears.hear(&frame(0, 0))), x(ears.hear(&frame(1, 33)))), (1.0, 2.0));
        assert_eq!(ears.fate(), Fate { used: 2, elsewhere: 1, ..Fate::default() });
    }
}
