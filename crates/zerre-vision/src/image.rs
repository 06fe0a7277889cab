//! Pictures in memory.

use crate::{Error, Result};

/// A picture: pixels of any kind, row after row from the top, from left to right. The channels of a colour stand
/// together: `Image<[u8; 3]>`.
#[derive(Clone, Debug, PartialEq)]
pub struct Image<P> {
    width: usize,
    height: usize,
    pixels: Vec<P>,
}

/// A frame of a video: red, green and blue from 0 to 255 (sRGB).
pub type Frame = Image<[u8; 3]>;

impl<P> Image<P> {
    /// A picture from its pixels, row after row.
    ///
    /// # Errors
    /// Another number of pixels, or none.
    pub fn new(width: usize, height: usize, pixels: Vec<P>) -> Result<Image<P>> {
        if pixels.is_empty() || width.checked_mul(height) != Some(pixels.len()) {
            return Err(Error::Pixels { found: pixels.len(), width, height });
        }
        Ok(Image { width, height, pixels })
    }

    /// A picture of at least one pixel, each made from its column and row.
    pub fn from_fn(width: usize, height: usize, mut pixel: impl FnMut(usize, usize) -> P) -> Image<P> {
        let (width, height) = (width.max(1), height.max(1));
        let pixels = (0..width * height).map(|i| pixel(i % width, i / width)).collect();
        Image { width, height, pixels }
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Columns and rows.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// All pixels, row after row.
    pub fn pixels(&self) -> &[P] {
        &self.pixels
    }

    /// All pixels, to change.
    pub fn pixels_mut(&mut self) -> &mut [P] {
        &mut self.pixels
    }

    /// The pixels of row `y`, which is below the height.
    pub fn row(&self, y: usize) -> &[P] {
        &self.pixels[y * self.width..][..self.width]
    }

    /// The pixels of row `y`, to change.
    pub fn row_mut(&mut self, y: usize) -> &mut [P] {
        &mut self.pixels[y * self.width..][..self.width]
    }

    /// The picture with every pixel changed.
    pub fn map<Q>(&self, change: impl FnMut(&P) -> Q) -> Image<Q> {
        Image { width: self.width, height: self.height, pixels: self.pixels.iter().map(change).collect() }
    }

    /// # Errors
    /// Another picture of a different size.
    pub fn expect_size<Q>(&self, other: &Image<Q>) -> Result<()> {
        if self.size() == other.size() {
            return Ok(());
        }
        Err(Error::Size { found: other.size(), expected: self.size() })
    }
}

impl<P: Copy> Image<P> {
    /// A picture of one colour, of at least one pixel.
    pub fn filled(width: usize, height: usize, pixel: P) -> Image<P> {
        Image::from_fn(width, height, |_, _| pixel)
    }

    /// The pixel in column `x` and row `y`; beyond the border, the nearest one.
    pub fn at(&self, x: isize, y: isize) -> P {
        let x = x.clamp(0, self.width as isize - 1) as usize;
        let y = y.clamp(0, self.height as isize - 1) as usize;
        self.pixels[y * self.width + x]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_counted() {
        assert!(Image::new(2, 3, vec![0_u8; 6]).is_ok());
        assert!(Image::new(2, 3, vec![0_u8; 5]).is_err());
        assert!(Image::<u8>::new(0, 3, Vec::new()).is_err());
        assert!(Image::new(usize::MAX, 3, vec![0_u8; 5]).is_err());
    }

    #[test]
    fn the_border_goes_on() {
        let image = Image::from_fn(3, 2, |x, y| 10 * y + x);
        assert_eq!((image.at(-5, 0), image.at(7, 1), image.at(1, -1), image.at(1, 9)), (0, 12, 1, 11));
        assert_eq!(image.row(1), [10, 11, 12]);
    }
}
