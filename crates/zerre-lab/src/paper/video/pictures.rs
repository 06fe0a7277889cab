//! Frames with the particles on them.

use super::settings::{PICTURED, PICTURED_RUN, PICTURED_TRACKERS};
use super::{VideoTrackers, follow, luck};
use crate::report::study::Picture;
use zerre_vision::frames::folder::png;
use zerre_vision::tracker::{Particle, find};
use zerre_vision::{Frame, Rect};

const TRUTH: [u8; 3] = [255; 3];
const ESTIMATE: [u8; 3] = [60, 220, 90];

/// Colours a pixel, where it is on the frame.
fn dot(frame: &mut Frame, x: f64, y: f64, colour: [u8; 3]) {
    let (width, height) = frame.size();
    if (0.0..width as f64).contains(&x) && (0.0..height as f64).contains(&y) {
        frame.row_mut(y as usize)[x as usize] = colour;
    }
}

/// Draws the border of a box, two pixels wide.
fn outline(frame: &mut Frame, bounds: Rect, colour: [u8; 3]) {
    for inset in [0.0, 1.0] {
        let (right, bottom) = (bounds.x + bounds.width - inset, bounds.y + bounds.height - inset);
        let (left, top) = (bounds.x + inset, bounds.y + inset);
        for i in 0..=bounds.width.max(0.0) as usize {
            let x = (bounds.x + i as f64).min(right);
            dot(frame, x, top, colour);
            dot(frame, x, bottom, colour);
        }
        for i in 0..=bounds.height.max(0.0) as usize {
            let y = (bounds.y + i as f64).min(bottom);
            dot(frame, left, y, colour);
            dot(frame, right, y, colour);
        }
    }
}

/// A frame with the truth, the estimate and the particles, the heaviest on top.
fn painted(frame: &Frame, truth: Option<Rect>, estimate: Rect, mut particles: Vec<Particle>) -> Frame {
    let mut frame = frame.clone();
    if let Some(truth) = truth {
        outline(&mut frame, truth, TRUTH);
    }
    outline(&mut frame, estimate, ESTIMATE);
    particles.sort_by(|a, b| a.weight.total_cmp(&b.weight));
    let most = particles.last().map_or(1.0, |particle| particle.weight);
    for Particle { centre: [x, y], weight } in particles {
        let share = (weight / most).clamp(0.0, 1.0);
        let colour = [(255.0 * share) as u8, 60, (255.0 * (1.0 - share)) as u8];
        for dx in -1..=1 {
            for dy in -1..=1 {
                dot(&mut frame, x + f64::from(dx), y + f64::from(dy), colour);
            }
        }
    }
    frame
}

impl VideoTrackers {
    /// Pictures of one run, and their files.
    ///
    /// # Errors
    /// A frame that cannot be encoded.
    #[allow(clippy::type_complexity, reason = "the two lists go to different places")]
    pub(super) fn pictures(
        &self,
    ) -> Result<(Vec<Picture>, Vec<(String, Vec<u8>)>), Box<dyn std::error::Error>> {
        let (mut pictures, mut files) = (Vec::new(), Vec::new());
        for (name, chosen) in PICTURED {
            let Some(at) = self.sequences.iter().position(|sequence| sequence.name == name) else { continue };
            for kind in PICTURED_TRACKERS.iter().filter_map(|name| find(name)) {
                let last = chosen.iter().copied().max().unwrap_or(0);
                let (mut frames, truth, bounds) = self.open(at, last)?;
                let mut failure = None;
                let followed = follow(
                    kind,
                    &mut frames,
                    |_| bounds,
                    luck(self.seed, PICTURED_RUN as u64),
                    |moment| {
                        let number = moment.index + 1;
                        let Some(frame) = moment.frame.filter(|_| chosen.contains(&number)) else {
                            return true;
                        };
                        let truth = truth.get(moment.index).copied().flatten();
                        let particles = moment.tracker.particles();
                        let frame = painted(frame, truth, moment.estimate.bounds, particles);
                        match png(&frame) {
                            Ok(bytes) => {
                                let file = format!("{name}-{}-{number}.png", kind.name).to_lowercase();
                                let side = |side: usize| u16::try_from(side).unwrap_or(u16::MAX);
                                pictures.push(Picture {
                                    title: format!("{}, {name}, frame {number}", kind.name),
                                    file: file.clone(),
                                    size: [side(frame.width()), side(frame.height())],
                                });
                                files.push((file, bytes));
                            }
                            Err(error) => failure = Some(error),
                        }
                        true
                    },
                );
                if let Some(error) = followed.err().or(failure) {
                    return Err(error.into());
                }
            }
        }
        Ok((pictures, files))
    }
}
