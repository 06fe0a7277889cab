//! Operators of image processing: free functions from pictures to pictures, numbers or points.
//!
//! They follow the conventions of OpenCV, or of scikit-image where they say so, and are tested against their
//! output. Every operator gives the same bits on every machine: integer arithmetic where its source has it,
//! else sums in a fixed order and no function of the platform's mathematical library.
//!
//! A grey picture is an `Image<u8>`. A mask is one as well: zero is unset, anything else set, and the
//! operators that make masks write 0 and 255.

mod arithmetic;
mod color;
mod components;
mod corner;
mod equalize;
mod filter;
mod flow;
mod histogram;
mod hog;
mod integral;
mod morphology;
mod patch;
mod ssim;
mod threshold;

pub use arithmetic::{absolute_difference, add, and, not, or, subtract, weighted_sum, xor};
pub use color::{channel, grey, hsv, lab, merge};
pub use components::{Component, Components, Neighbours, components};
pub use corner::{Corners, corners};
pub use equalize::{Clahe, clahe, equalize};
pub use filter::{blur, blur_f32, gaussian_kernel};
pub use flow::{Flow, LucasKanade, Pyramid};
pub use histogram::{Histogram, bhattacharyya, bhattacharyya_distance};
pub use hog::Hog;
pub use integral::Integral;
pub use morphology::{Element, area_open, clear_border, close, dilate, erode, fill_holes, open};
pub(crate) use patch::extended;
pub use patch::{Sample, crop, patch};
pub use ssim::{Ssim, Windows};
pub use threshold::{in_range, in_range_color, otsu, threshold};

use crate::{Error, Rect, Result};
use std::ops::Range;

/// Index `i` of a row of `n` elements that is mirrored at its first and at its last element: `dcb|abcd|cba`.
fn reflect(i: isize, n: usize) -> usize {
    if n < 2 {
        return 0;
    }
    let period = 2 * (n as isize - 1);
    let i = i.rem_euclid(period);
    i.min(period - i) as usize
}

/// A size of a window that has a pixel in its middle.
fn odd(what: &'static str, size: usize) -> Result<usize> {
    if size % 2 == 1 && size < 1 << 15 {
        return Ok(size);
    }
    Err(Error::OutOfRange {
        what,
        value: size as f64,
        needs: "an odd number of pixels below 32768 is needed",
    })
}

/// Columns and rows of the pixels whose centres lie in a box, on a picture of this size.
fn covered(bounds: Rect, (width, height): (usize, usize)) -> (Range<usize>, Range<usize>) {
    let range = |start: f64, side: f64, pixels: usize| {
        let edge = |x: f64| ((x - 0.5).ceil() as usize).min(pixels);
        edge(start)..edge(start + side)
    };
    (range(bounds.x, bounds.width, width), range(bounds.y, bounds.height, height))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mirrors_stand_on_the_outermost_pixels() {
        let row: Vec<usize> = (-5..8).map(|i| reflect(i, 4)).collect();
        assert_eq!(row, [1, 2, 3, 2, 1, 0, 1, 2, 3, 2, 1, 0, 1]);
        assert!((-9..9).all(|i| reflect(i, 1) == 0 && reflect(i, 2) < 2));
    }
}
