//! What a sensor says of one target at one instant: the type that readers make and trackers take.

use crate::time::Time;
use std::sync::Arc;

/// One measurement of one target by one sensor. A row of a recording that carries several independent readings
/// (range and bearing, and range rate) becomes several plots of the same time: a step over no time draws nothing,
/// so their product is exact.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// When it was measured.
    pub time: Time,
    /// Identity of the target, where the sensor or its extractor tells it.
    pub id: Option<Arc<str>>,
    /// Name of the sensor; `None` is the only one of the recording.
    pub sensor: Option<Arc<str>>,
    /// Number of the scan, where the recording counts them.
    pub scan: Option<u64>,
    /// Line of the input, from 1; 0 where there is none (simulation).
    pub line: u64,
    /// The numbers.
    pub reading: Reading,
}

/// The numbers of a plot, in metres, metres per second and radians; bearings counter-clockwise from the x axis,
/// elevation up from the x-y plane; polar readings are relative to the sensor's position.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Reading {
    /// x, y.
    Position2([f64; 2]),
    /// x, y, z.
    Position3([f64; 3]),
    /// Range, bearing.
    RangeBearing([f64; 2]),
    /// Range, bearing, elevation.
    RangeBearingElevation([f64; 3]),
    /// Bearing only.
    Bearing(f64),
    /// Range only.
    Range(f64),
    /// Range rate, positive when the target recedes.
    RangeRate(f64),
    /// Length, width, and orientation of the length, of which half a turn is the same.
    Size([f64; 3]),
}

impl Reading {
    /// The numbers as a slice, in the order of the variant's description.
    pub fn values(&self) -> &[f64] {
        match self {
            Reading::Position2(v) | Reading::RangeBearing(v) => v,
            Reading::Position3(v) | Reading::RangeBearingElevation(v) | Reading::Size(v) => v,
            Reading::Bearing(v) | Reading::Range(v) | Reading::RangeRate(v) => std::slice::from_ref(v),
        }
    }
}
