//! Boxes.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::fmt;

/// An upright box, pixels: a pixel (x, y) covers the square from (x, y) to (x + 1, y + 1), so the box of all pixels of
/// a picture is `Rect { x: 0.0, y: 0.0, width, height }`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rect {
    /// Left edge.
    pub x: f64,
    /// Upper edge.
    pub y: f64,
    /// From the left to the right edge.
    pub width: f64,
    /// From the upper to the lower edge.
    pub height: f64,
}

impl fmt::Display for Rect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{},{},{}", self.x, self.y, self.width, self.height)
    }
}

impl Rect {
    /// The box of this size about a centre.
    pub fn about([x, y]: [f64; 2], width: f64, height: f64) -> Rect {
        Rect { x: x - width / 2.0, y: y - height / 2.0, width, height }
    }

    /// Its centre.
    pub fn centre(&self) -> [f64; 2] {
        [self.x + self.width / 2.0, self.y + self.height / 2.0]
    }

    /// Its area, square pixels.
    pub fn area(&self) -> f64 {
        self.width * self.height
    }

    /// What it has in common with another; `None` where that has no area.
    pub fn intersection(&self, other: &Rect) -> Option<Rect> {
        let (x, y) = (self.x.max(other.x), self.y.max(other.y));
        let width = (self.x + self.width).min(other.x + other.width) - x;
        let height = (self.y + self.height).min(other.y + other.height) - y;
        (width > 0.0 && height > 0.0).then_some(Rect { x, y, width, height })
    }

    /// Area of the intersection over that of the union, from 0 to 1.
    pub fn iou(&self, other: &Rect) -> f64 {
        let Some(common) = self.intersection(other) else { return 0.0 };
        common.area() / (self.area() + other.area() - common.area())
    }

    /// Distance of the centres, pixels.
    pub fn distance(&self, other: &Rect) -> f64 {
        let ([a, b], [c, d]) = (self.centre(), other.centre());
        (a - c).hypot(b - d)
    }

    /// The box as one that a tracker may start from, on a frame of `width` x `height`.
    ///
    /// # Errors
    /// Numbers that are not finite, sides of less than two pixels, a box without a pixel on the frame.
    pub fn on_frame(self, (width, height): (usize, usize)) -> Result<Rect> {
        let refuse = |problem: String| Err(Error::Bounds { bounds: self, problem });
        if ![self.x, self.y, self.width, self.height].iter().all(|v| v.is_finite()) {
            return refuse(
                "has a number that is not finite: x, y, width and height are needed, in pixels".into(),
            );
        }
        if self.width < 2.0 || self.height < 2.0 {
            return refuse("is smaller than 2 x 2 pixels: nothing can be recognised in it".into());
        }
        let frame = Rect { x: 0.0, y: 0.0, width: width as f64, height: height as f64 };
        match self.intersection(&frame) {
            Some(seen) if seen.width >= 1.0 && seen.height >= 1.0 => Ok(self),
            _ => refuse(format!("lies outside the frame of {width} x {height} pixels")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlaps_are_areas() {
        let a = Rect { x: 0.0, y: 0.0, width: 4.0, height: 2.0 };
        let b = Rect { x: 2.0, y: 1.0, width: 4.0, height: 2.0 };
        assert_eq!(a.iou(&b), 2.0 / 14.0);
        assert_eq!(a.iou(&a), 1.0);
        assert_eq!(a.iou(&Rect { x: 4.0, ..a }), 0.0);
        assert_eq!(a.distance(&b), 5.0_f64.sqrt());
        assert_eq!(Rect::about(a.centre(), 4.0, 2.0), a);
    }

    #[test]
    fn boxes_without_an_object_are_refused() {
        let good = Rect { x: -3.0, y: 0.0, width: 8.0, height: 8.0 };
        assert!(good.on_frame((10, 10)).is_ok());
        for bad in [
            Rect { x: f64::NAN, ..good },
            Rect { width: 1.5, ..good },
            Rect { height: -8.0, ..good },
            Rect { x: 10.0, ..good },
            Rect { x: -7.5, ..good },
        ] {
            assert!(bad.on_frame((10, 10)).is_err(), "{bad}");
        }
    }
}
