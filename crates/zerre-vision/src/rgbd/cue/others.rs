//! What is like the point and is not: the other hand, the head. It has been there all along, so it is known by where it
//! was: a candidate there is no candidate for the point when that has vanished.

use crate::rgbd::Reading;

/// Frames in which something has been there before it is believed.
const KNOWN: u32 = 4;
/// Frames after which what is not seen is forgotten.
const FORGOTTEN: u32 = 15;
/// Candidates of less confidence are not like the point: they need not be known.
const UNLIKE: f64 = 0.1;
/// Share of a new place's surprise that goes into place and velocity.
const GAINS: [f64; 2] = [0.6, 0.2];

/// Something that is not the point.
#[derive(Clone, Copy, Debug)]
struct Other {
    at: [f64; 2],
    /// Pixels per frame.
    velocity: [f64; 2],
    seen: u32,
    missed: u32,
}

/// All that is known of.
#[derive(Clone, Debug, Default)]
pub struct Others {
    all: Vec<Other>,
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

impl Others {
    /// Takes away the candidates where something else should be. Of two things within `reach` pixels of a candidate it is
    /// the nearer one's: `point` is where the point should be, if it was seen.
    pub fn remove(&self, readings: &mut Vec<Reading>, point: Option<[f64; 2]>, reach: f64) {
        readings.retain(|reading| {
            let known = self.all.iter().filter(|other| other.seen >= KNOWN);
            let nearest = known.map(|other| distance(other.expected(), reading.at)).fold(reach, f64::min);
            nearest >= reach || point.is_some_and(|at| distance(at, reading.at) <= nearest)
        });
    }

    /// Learns from the candidates of a frame which is not `point`: where that was seen, nothing within `reach` pixels is
    /// something else. While it is not seen, nothing new is believed: it may be the point.
    pub fn learn(&mut self, readings: impl Iterator<Item = Reading>, point: Option<[f64; 2]>, reach: f64) {
        for other in &mut self.all {
            other.at = other.expected();
            other.missed += 1;
        }
        let near_point = |reading: &Reading| point.is_some_and(|at| distance(at, reading.at) < reach);
        let like_it = |reading: &Reading| reading.confidence > UNLIKE && !near_point(reading);
        let mut free: Vec<Reading> = readings.filter(like_it).collect();
        // The nearest pairs first; two cues of one thing count once.
        while let Some((off, i, k)) = self.nearest_pair(&free) {
            if off > reach {
                break;
            }
            let reading = free.swap_remove(k);
            let other = &mut self.all[i];
            for k in 0..2 {
                let surprise = reading.at[k] - other.at[k];
                other.at[k] += GAINS[0] * surprise;
                other.velocity[k] += GAINS[1] * surprise;
            }
            other.seen += 1;
            other.missed = 0;
        }
        for reading in free {
            let apart = |other: &Other| distance(other.at, reading.at) > reach;
            if point.is_some() && self.all.iter().all(apart) {
                self.all.push(Other { at: reading.at, velocity: [0.0; 2], seen: 1, missed: 0 });
            }
        }
        for other in self.all.iter_mut().filter(|other| other.missed > 0) {
            other.velocity = other.velocity.map(|v| 0.7 * v);
        }
        self.all.retain(|other| other.missed < FORGOTTEN);
    }
}

impl Others {
    /// The nearest pair of something that has not been seen in this frame and a candidate.
    fn nearest_pair(&self, free: &[Reading]) -> Option<(f64, usize, usize)> {
        let unseen = self.all.iter().enumerate().filter(|(_, other)| other.missed > 0);
        let pairs = unseen.flat_map(|(i, other)| {
            free.iter().enumerate().map(move |(k, reading)| (distance(other.at, reading.at), i, k))
        });
        pairs.min_by(|a, b| a.0.total_cmp(&b.0))
    }
}

impl Other {
    fn expected(&self) -> [f64; 2] {
        [0, 1].map(|k| self.at[k] + self.velocity[k])
    }
}
