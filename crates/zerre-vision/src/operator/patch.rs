//! Parts of pictures.

use crate::{Error, Image, Rect, Result};

/// A pixel that can be interpolated.
pub trait Sample: Copy {
    /// What lies between two of them.
    type Real: Copy;

    /// The value at `across` and `down`, from 0 to 1, between the upper left, upper right, lower left and
    /// lower right pixel.
    fn between(corners: [Self; 4], across: f32, down: f32) -> Self::Real;
}

impl Sample for f32 {
    type Real = f32;

    fn between([a, b, c, d]: [f32; 4], across: f32, down: f32) -> f32 {
        let (upper, lower) = (a + (b - a) * across, c + (d - c) * across);
        upper + (lower - upper) * down
    }
}

impl Sample for u8 {
    type Real = f32;

    fn between(corners: [u8; 4], across: f32, down: f32) -> f32 {
        f32::between(corners.map(f32::from), across, down)
    }
}

impl<P: Sample, const N: usize> Sample for [P; N] {
    type Real = [P::Real; N];

    fn between(corners: [[P; N]; 4], across: f32, down: f32) -> [P::Real; N] {
        std::array::from_fn(|i| P::between(corners.map(|c| c[i]), across, down))
    }
}

/// The pixels of columns `x` to `x + width - 1` and rows `y` to `y + height - 1`, at least one; beyond the
/// border, the nearest ones.
pub fn crop<P: Copy>(image: &Image<P>, x: isize, y: isize, width: usize, height: usize) -> Image<P> {
    let mut part = Image::filled(width, height, image.at(0, 0));
    for j in 0..part.height() {
        let row = y.saturating_add_unsigned(j).clamp(0, image.height() as isize - 1);
        extended(image.row(row as usize), x, part.row_mut(j), |pixel| pixel);
    }
    part
}

/// Fills `to` with values of the pixels of `row` from number `at` on; beyond its ends with those of the
/// nearest pixel.
pub(crate) fn extended<P: Copy, Q: Copy>(row: &[P], at: isize, to: &mut [Q], value: impl Fn(P) -> Q) {
    let (Some(&first), Some(&last)) = (row.first(), row.last()) else { return };
    let before = at.min(0).unsigned_abs().min(to.len());
    let (left, to) = to.split_at_mut(before);
    left.fill(value(first));
    let seen = row.get(at.max(0) as usize..).unwrap_or_default();
    let (middle, right) = to.split_at_mut(seen.len().min(to.len()));
    middle.iter_mut().zip(seen).for_each(|(to, pixel)| *to = value(*pixel));
    right.fill(value(last));
}

/// A box of a picture, resampled to `width` x `height` pixels: the box is cut into as many equal cells, and
/// each is the bilinear value at its centre; beyond the border, that of the nearest pixels. A box as large as
/// the patch is shifted only (OpenCV's `getRectSubPix`); any other is resized (OpenCV's `resize` with
/// `INTER_LINEAR`), where smaller patches skip pixels: blur first.
///
/// # Errors
/// A box with a number that is not finite, or sides that are not positive; a patch without a pixel.
pub fn patch<P: Sample>(
    image: &Image<P>,
    bounds: Rect,
    (width, height): (usize, usize),
) -> Result<Image<P::Real>> {
    let numbers = [bounds.x, bounds.y, bounds.width, bounds.height];
    if !numbers.iter().all(|v| v.is_finite()) || bounds.width <= 0.0 || bounds.height <= 0.0 {
        let problem = "is no part of a picture: finite numbers and positive sides are needed".into();
        return Err(Error::Bounds { bounds, problem });
    }
    if width == 0 || height == 0 {
        return Err(Error::Pixels { found: 0, width, height });
    }
    // The pixel before a place, and how far behind that pixel's centre the place is.
    let place = |start: f64, cell: f64, i: usize| {
        let place = start + (i as f64 + 0.5) * cell - 0.5;
        let pixel = place.floor();
        (pixel as isize, (place - pixel) as f32)
    };
    let (across, down) = (bounds.width / width as f64, bounds.height / height as f64);
    let (last_column, last_row) = (image.width() as isize - 1, image.height() as isize - 1);
    let clamp = |i: isize, last: isize| i.clamp(0, last) as usize;
    let mut pixels = Vec::with_capacity(width * height);
    for j in 0..height {
        let (y, v) = place(bounds.y, down, j);
        let upper = image.row(clamp(y, last_row));
        let lower = image.row(clamp(y.saturating_add(1), last_row));
        for i in 0..width {
            let (x, u) = place(bounds.x, across, i);
            let (left, right) = (clamp(x, last_column), clamp(x.saturating_add(1), last_column));
            pixels.push(P::between([upper[left], upper[right], lower[left], lower[right]], u, v));
        }
    }
    Image::new(width, height, pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn odd_boxes_are_sampled_or_refused() {
        let image = Image::filled(1, 1, 9_u8);
        let bounds = Rect { x: -3.3, y: 1e30, width: 2.5, height: 1e-3 };
        assert_eq!(patch(&image, bounds, (3, 2)).unwrap(), Image::filled(3, 2, 9.0));
        assert!(patch(&image, bounds, (0, 2)).is_err());
        assert!(patch(&image, Rect { x: f64::NAN, ..bounds }, (1, 1)).is_err());
        assert!(patch(&image, Rect { width: 0.0, ..bounds }, (1, 1)).is_err());
        assert_eq!(crop(&image, isize::MAX, -2, 2, 3), Image::filled(2, 3, 9));
    }
}
