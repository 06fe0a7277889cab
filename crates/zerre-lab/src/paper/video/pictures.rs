//! Frames with the particles on them.

use super::settings::{PICTURED, PICTURED_RUN, PICTURED_TRACKERS, PICTURED_WIDTH};
use super::{VideoTrackers, follow, luck};
use crate::report::overlay::{Scene, pictured, shown};
use crate::report::study::Picture;
use std::error::Error;
use zerre_vision::tracker::find;

/// A picture of the page with its file.
pub(super) struct Painted {
    pub picture: Picture,
    pub bytes: Vec<u8>,
}

fn painted(tracker: &str, sequence: &str, scene: &Scene) -> Result<Painted, Box<dyn Error>> {
    let number = scene.index + 1;
    let size = shown(scene.frame.size(), PICTURED_WIDTH, PICTURED_WIDTH);
    let title = format!("{tracker}, {sequence}, frame {number}");
    let file = format!("{sequence}-{tracker}-{number}.png").to_lowercase();
    let (picture, bytes) = pictured(&title, &file, &scene.draw(size)?)?;
    Ok(Painted { picture, bytes })
}

impl VideoTrackers {
    /// Pictures of one run at chosen frames.
    ///
    /// # Errors
    /// A frame that cannot be encoded.
    pub(super) fn pictures(&self) -> Result<Vec<Painted>, Box<dyn Error>> {
        let mut pictures = Vec::new();
        for (name, chosen) in PICTURED {
            let Some(at) = self.sequences.iter().position(|sequence| sequence.name == name) else { continue };
            let last = chosen.iter().copied().max().unwrap_or(0);
            for kind in PICTURED_TRACKERS.iter().filter_map(|name| find(name)) {
                let (mut frames, truth, bounds) = self.open(at, last)?;
                let mut failure = None;
                let stream = luck(self.seed, PICTURED_RUN as u64);
                let followed = follow(
                    kind,
                    &mut frames,
                    |_| bounds,
                    stream,
                    |moment| {
                        let frame = moment.frame.filter(|_| chosen.contains(&(moment.index + 1)));
                        let Some(frame) = frame else { return true };
                        let scene = Scene {
                            frame,
                            index: moment.index,
                            truth: truth.get(moment.index).copied().flatten(),
                            estimate: moment.estimate,
                            particles: &moment.tracker.particles(),
                        };
                        match painted(kind.name, name, &scene) {
                            Ok(one) => pictures.push(one),
                            Err(error) => failure = Some(error),
                        }
                        true
                    },
                );
                followed?;
                failure.map_or(Ok(()), Err)?;
            }
        }
        Ok(pictures)
    }
}
