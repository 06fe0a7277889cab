//! Points of a body followed in colour and depth: several sources that each say where the point is, one posterior.

pub mod background;
pub mod calibrate;
pub mod camera;
pub mod cue;
pub mod fusion;
pub mod recording;
pub mod scene;
pub mod thesis;
pub mod tracker;

pub use camera::{Camera, Intrinsics, Registration};

use crate::{Frame, Image, Result};
use serde::{Deserialize, Serialize};
use zerre::Time;

/// Distances from the camera along its axis, millimetres, pixel by pixel; [`NO_DEPTH`] where nothing was measured.
pub type Depth = Image<u16>;

/// What stands in a [`Depth`] where nothing was measured, whatever its file says there.
pub const NO_DEPTH: u16 = 0;

/// What both cameras saw at a time.
#[derive(Clone, Debug)]
pub struct RgbdFrame {
    /// Its place in the recording, from 0. Frames that cannot be read have one too.
    pub index: usize,
    /// What people know it by: the file's number or name.
    pub name: String,
    /// When it was taken.
    pub time: Time,
    /// Colours.
    pub colour: Frame,
    /// Depth in the pixels of the colours: already registered, of the same size.
    pub depth: Depth,
}

/// What a source says of where the point is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// The place in the colours' picture, pixels.
    pub at: [f64; 2],
    /// Distance from the colour camera along its axis, millimetres.
    pub depth_mm: Option<f64>,
    /// How sure the source is, from 0 to 1; beside others of one source it is what counts.
    pub confidence: f64,
}

impl Reading {
    /// # Errors
    /// A number that is not finite, a confidence outside [0, 1].
    pub fn checked(&self) -> Result<()> {
        for value in [self.at[0], self.at[1], self.depth_mm.unwrap_or(0.0)] {
            zerre::Error::finite("a reading", value)?;
        }
        if !(0.0..=1.0).contains(&self.confidence) {
            let needs = "it must be from 0 to 1";
            return Err(crate::Error::OutOfRange { what: "confidence", value: self.confidence, needs });
        }
        Ok(())
    }
}
