//! Points of a body followed in colour and depth: several sources that each say where the point is, one posterior.

pub mod camera;
pub mod scene;

pub use camera::{Camera, Intrinsics, Registration};

use crate::{Frame, Image};
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

/// Where a device that follows joints, or an estimator of poses, believes a point to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Place in the colour picture, pixels.
    pub at: [f64; 2],
    /// Distance along the colour camera's axis, mm.
    pub depth_mm: Option<f64>,
    /// How sure it is, from 0 to 1.
    pub confidence: f64,
}
