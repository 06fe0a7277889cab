//! How the tracker is set.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// How a [`CorrelationTracker`](super::CorrelationTracker) is set. The values by default were chosen on the nine
/// sequences of the shared data, what decides that an object is lost on drawn clips (`visibility`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CorrelationSettings {
    /// Cells of a side of the search window; a product of 2, 3 and 5.
    pub side: usize,
    /// Side of the search window, in sizes of the object (the root of its area). It is less where it would be larger
    /// than the frame.
    pub padding: f64,
    /// Standard deviation of the response that the filters are trained for, in sizes of the object.
    pub label_sd: f64,
    /// Turns of the filter's training.
    pub turns: usize,
    /// Share of a new frame in what the object looks like.
    pub rate: f64,
    /// Share of a new frame in its colours.
    pub colour_rate: f64,
    /// Share of a new frame in what its scale looks like.
    pub scale_rate: f64,
    /// Share of the first frame's filter in the response, from 0 to 1.
    pub first_share: f64,
    /// Weight of the colours beside the response, where they tell the object from its surroundings entirely.
    pub colour_share: f64,
    /// Number of particles.
    pub particles: usize,
    /// What one unit of the response says, nats.
    pub sharpness: f64,
    /// Standard deviation of the object's movement from frame to frame, in its sizes.
    pub motion_sd: f64,
    /// How far from the filter's place a box that people draw is centred, a standard deviation in sizes of the object.
    pub box_sd: f64,
    /// Windows besides the first that are searched in each frame while the object is lost.
    pub searches: usize,
}

impl Default for CorrelationSettings {
    fn default() -> CorrelationSettings {
        CorrelationSettings {
            side: 40,
            padding: 4.0,
            label_sd: 1.0 / 16.0,
            turns: 2,
            rate: 0.015,
            colour_rate: 0.04,
            scale_rate: 0.025,
            first_share: 0.5,
            colour_share: 0.75,
            particles: 200,
            sharpness: 20.0,
            motion_sd: 0.3,
            box_sd: 0.06,
            searches: 2,
        }
    }
}

impl CorrelationSettings {
    /// # Errors
    /// A number out of its range.
    pub fn checked(&self) -> Result<()> {
        let refuse = |what, value: f64, needs| Err(Error::OutOfRange { what, value, needs });
        let mut rest = self.side.max(1);
        for prime in [2, 3, 5] {
            while rest.is_multiple_of(prime) {
                rest /= prime;
            }
        }
        if !(8..=200).contains(&self.side) || rest != 1 {
            return refuse("side", self.side as f64, "it must be a product of 2, 3 and 5 from 8 to 200");
        }
        if !(1.5..=10.0).contains(&self.padding) {
            return refuse("padding", self.padding, "it must be from 1.5 to 10 sizes of the object");
        }
        if !(1..=20).contains(&self.turns) {
            return refuse("turns", self.turns as f64, "it must be from 1 to 20");
        }
        if self.particles == 0 {
            return refuse("particles", 0.0, "it must be 1 or more");
        }
        for (what, value) in [
            ("rate", self.rate),
            ("colour_rate", self.colour_rate),
            ("scale_rate", self.scale_rate),
            ("first_share", self.first_share),
        ] {
            if !(0.0..=1.0).contains(&value) {
                return refuse(what, value, "it must be from 0 to 1");
            }
        }
        for (what, value) in [
            ("label_sd", self.label_sd),
            ("sharpness", self.sharpness),
            ("motion_sd", self.motion_sd),
            ("box_sd", self.box_sd),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return refuse(what, value, "it must be positive");
            }
        }
        if !(self.colour_share >= 0.0 && self.colour_share.is_finite()) {
            return refuse("colour_share", self.colour_share, "it must be 0 or more");
        }
        Ok(())
    }
}
