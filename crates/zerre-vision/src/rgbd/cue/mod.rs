//! Cues: where colours and depth say that the point may be.

mod arm;
mod colour;
mod others;

pub use arm::ArmEnd;
pub use colour::{ColourCue, HandColours};
pub use others::Others;

use super::{Depth, Intrinsics, NO_DEPTH};
use crate::{Frame, Result};

/// The empty room.
#[derive(Clone, Debug)]
pub struct Room {
    colour: Frame,
    depth: Depth,
    /// What is nearer than this stands before the room; [`NO_DEPTH`] where the room has no depth.
    limit: Depth,
}

impl Room {
    /// A room of these colours and depths ([`NO_DEPTH`] where unknown).
    ///
    /// # Errors
    /// Pictures of different sizes.
    pub fn new(colour: Frame, depth: Depth) -> Result<Room> {
        colour.expect_size(&depth)?;
        let limit = depth.map(|&far| if far == NO_DEPTH { NO_DEPTH } else { nearest_of_room(far) });
        Ok(Room { colour, depth, limit })
    }

    /// Its colours.
    pub fn colour(&self) -> &Frame {
        &self.colour
    }

    /// Its depths.
    pub fn depth(&self) -> &Depth {
        &self.depth
    }
}

/// The least depth that still is the room's where that is `far`: noise of both measurements, five standard deviations,
/// beside a margin for what a median leaves.
fn nearest_of_room(far: u16) -> u16 {
    let margin = 20 + (5.0 * std::f64::consts::SQRT_2 * depth_noise(f64::from(far))) as u16;
    far.saturating_sub(margin)
}

/// Bins of a channel's levels.
const BINS: usize = 16;

/// How bright a frame is beside the room, with what depends on that and on a pixel's level alone.
#[derive(Clone, Debug)]
pub struct Light {
    /// By channel and level, the bin of that level under the room's light: the channel's digit of a colour's number.
    digits: [[u16; 256]; 3],
    /// By channel and level of the room, what it would be under this light.
    expected: [[f32; 256]; 3],
}

impl Light {
    /// The light of a frame before a room.
    pub fn of(frame: &Frame, room: &Room) -> Light {
        Light::new(light(frame, &room.colour))
    }

    /// The light under which the room's levels are to be multiplied with `gain`.
    pub fn new(gain: [f32; 3]) -> Light {
        let digit = |c: usize, v: usize| {
            let level = (v as f32 * gain[c].recip()).clamp(0.0, 255.0) as usize;
            (level * BINS / 256 * BINS.pow(2 - c as u32)) as u16
        };
        Light {
            digits: std::array::from_fn(|c| std::array::from_fn(|v| digit(c, v))),
            expected: gain.map(|gain| std::array::from_fn(|v| gain * v as f32)),
        }
    }

    /// The number of a colour, from 0 to [`BINS`]^3.
    fn bin(&self, pixel: [u8; 3]) -> usize {
        (0..3).map(|c| usize::from(self.digits[c][usize::from(pixel[c])])).sum()
    }
}

/// A frame before the empty room.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Colours.
    pub colour: &'a Frame,
    /// Depths; all [`NO_DEPTH`] where depth is not used.
    pub depth: &'a Depth,
    /// The empty room.
    pub room: &'a Room,
    /// The colour camera.
    pub lens: Intrinsics,
    /// The light of this frame.
    pub light: &'a Light,
}

/// Where to look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Search {
    /// Where the point should be, pixels.
    pub at: [f64; 2],
    /// Side of the window about it, pixels.
    pub side: usize,
    /// Every pixel is looked at (1), every second one in both directions (2), ...
    pub step: usize,
    /// Depth that it should have, millimetres, and its standard deviation; `None` where depth is not used.
    pub depth: Option<[f64; 2]>,
}

/// A window: first column and row, columns and rows, all on the frame.
type Window = [usize; 4];

impl Search {
    /// Whether a place is in the window, on a frame of this size.
    pub fn holds(&self, [x, y]: [f64; 2], frame: (usize, usize)) -> bool {
        let [left, top, columns, rows] = self.window(frame);
        let inside = |v: f64, first: usize, count: usize| v >= first as f64 && v < (first + count) as f64;
        inside(x, left, columns) && inside(y, top, rows)
    }

    /// Square pixels of the window, on a frame of this size.
    pub fn area(&self, frame: (usize, usize)) -> f64 {
        let [_, _, columns, rows] = self.window(frame);
        (columns * rows) as f64
    }

    /// The window as far as it is on a frame of this size: a point beyond the border is looked for at the border.
    fn window(&self, (width, height): (usize, usize)) -> Window {
        let cut = |centre: f64, count: usize| {
            let side = self.side.clamp(1, count);
            let first = (centre - side as f64 / 2.0).round().clamp(0.0, (count - side) as f64);
            (first as usize, side)
        };
        let ((x, columns), (y, rows)) = (cut(self.at[0], width), cut(self.at[1], height));
        [x, y, columns, rows]
    }
}

/// Noise of a depth camera of structured light: standard deviation at a distance, both millimetres (Khoshelham and
/// Elberink, Sensors 12, 2012).
pub fn depth_noise(depth: f64) -> f64 {
    1.5e-6 * depth * depth
}

/// Size of a palm, millimetres from its middle to its edge.
const PALM: f64 = 40.0;
/// Levels by which a colour differs from the room's before it is something else.
const OTHER_COLOUR: f32 = 24.0;

/// Whether what a pixel shows is before the room: by its depth where both are measured, else by its colour.
pub fn is_before_room(view: &View<'_>, i: usize) -> bool {
    let (depth, limit) = (view.depth.pixels()[i], view.room.limit.pixels()[i]);
    if depth != NO_DEPTH && limit != NO_DEPTH {
        return depth < limit;
    }
    let (seen, room) = (view.colour.pixels()[i], view.room.colour.pixels()[i]);
    (0..3).any(|c| (f32::from(seen[c]) - view.light.expected[c][usize::from(room[c])]).abs() > OTHER_COLOUR)
}

/// What the room's colours must be multiplied with to be those of a frame: the median over a raster, so that a person who
/// stands before less than half of the room does not matter.
pub fn light(frame: &Frame, room: &Frame) -> [f32; 3] {
    const STEP: usize = 11;
    let mut ratios: [Vec<f32>; 3] = Default::default();
    for y in (STEP / 2..frame.height().min(room.height())).step_by(STEP) {
        for x in (STEP / 2..frame.width().min(room.width())).step_by(STEP) {
            let (seen, before) = (frame.row(y)[x], room.row(y)[x]);
            for c in 0..3 {
                // Dark pixels have no ratio, and full ones have lost theirs.
                if before[c] >= 20 && before[c] <= 250 && seen[c] <= 250 {
                    ratios[c].push(f32::from(seen[c]) / f32::from(before[c]));
                }
            }
        }
    }
    ratios.map(|mut all| {
        let middle = all.len() / 2;
        if all.len() < 10 { 1.0 } else { *all.select_nth_unstable_by(middle, f32::total_cmp).1 }
    })
}
