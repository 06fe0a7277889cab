//! How the object moved from one frame to the next: the median flow of corners inside its box.

use super::place::Place;
use crate::operator::{Corners, Flow, LucasKanade, Pyramid, corners, crop, grey};
use crate::{Frame, Image, Rect, Result};

/// OpenCV's tutorial of sparse flow; the paper names no setting.
const CORNERS: Corners = Corners { count: 100, quality: 0.3, distance: 7.0, side: 7 };
const TRACKER: LucasKanade =
    LucasKanade { side: 15, levels: 2, iterations: 10, tolerance: 0.03, min_eigenvalue: 0.1024 };

/// Pixels about the box that flow looks at. Corners that move further, or windows that reach beyond, see the
/// border of this part instead of the frame; all else is as if the whole frame had been looked at.
const REACH: usize = 48;

/// Corners of a frame, to be found again in the next one.
#[derive(Debug)]
pub(super) struct Trail {
    region: Place,
    pyramid: Pyramid,
    corners: Vec<[f64; 2]>,
}

fn greys(frame: &Frame, region: Place) -> Image<u8> {
    grey(&crop(frame, region.x, region.y, region.width, region.height))
}

impl Trail {
    /// The corners inside a box of a frame.
    pub(super) fn new(frame: &Frame, place: Place) -> Result<Trail> {
        let mut region = place.on_frame(REACH, frame.size());
        // Halved pictures then have their pixels where those of the whole frame have theirs.
        let grid = 1 << TRACKER.levels;
        let [left, upper] = [region.x % grid, region.y % grid];
        region = Place {
            x: region.x - left,
            y: region.y - upper,
            width: region.width + left as usize,
            height: region.height + upper as usize,
        };
        let greys = greys(frame, region);
        let [x, y] = [place.x - region.x, place.y - region.y].map(|v| v as f64);
        let bounds = Rect { x, y, width: place.width as f64, height: place.height as f64 };
        let corners = corners(&greys, bounds, &CORNERS)?;
        Ok(Trail { region, pyramid: TRACKER.pyramid(greys), corners })
    }

    /// Median of where they went, x and y apart, pixels; `None` if none is found again.
    pub(super) fn median(&self, next: &Frame) -> Result<Option<[f64; 2]>> {
        if self.corners.is_empty() {
            return Ok(None);
        }
        let mut flows: Vec<Flow> = Vec::with_capacity(self.corners.len());
        let next = TRACKER.pyramid(greys(next, self.region));
        TRACKER.track(&self.pyramid, &next, &self.corners, &mut flows)?;
        let along = |d: usize| -> Option<f64> {
            let pairs = flows.iter().zip(&self.corners).filter(|(flow, _)| flow.found);
            let mut moves: Vec<f64> = pairs.map(|(flow, corner)| flow.point[d] - corner[d]).collect();
            moves.sort_by(f64::total_cmp);
            let last = moves.len().checked_sub(1)?;
            Some((moves.get(last / 2)? + moves.get(last.div_ceil(2))?) / 2.0)
        };
        Ok(along(0).zip(along(1)).map(|(x, y)| [x, y]).filter(|flow| flow.iter().all(|v| v.is_finite())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Waves that moved by (dx, dy).
    fn waves(dx: f64, dy: f64) -> Frame {
        Image::from_fn(200, 150, |x, y| {
            let (x, y) = (x as f64 - dx, y as f64 - dy);
            [(128.0 + 50.0 * (0.35 * x + 0.1 * y).sin() + 50.0 * (0.31 * y - 0.07 * x).sin()) as u8; 3]
        })
    }

    /// Grey levels are rounded to whole numbers, against slopes of up to 15 a pixel.
    #[test]
    fn the_median_is_the_motion() {
        for place in [
            Place { x: 81, y: 55, width: 40, height: 30 },
            Place { x: -10, y: 2, width: 40, height: 30 },
            Place { x: 170, y: 130, width: 40, height: 30 },
        ] {
            let trail = Trail::new(&waves(0.0, 0.0), place).unwrap();
            let [x, y] = trail.median(&waves(2.4, -1.3)).unwrap().unwrap();
            assert!((x - 2.4).abs() < 0.1 && (y + 1.3).abs() < 0.1, "{place:?}: {x} {y}");
        }
    }

    #[test]
    fn a_smooth_box_has_no_flow() {
        let flat = Image::filled(60, 50, [9; 3]);
        let trail = Trail::new(&flat, Place { x: 10, y: 10, width: 20, height: 20 }).unwrap();
        assert_eq!(trail.median(&flat).unwrap(), None);
    }
}
