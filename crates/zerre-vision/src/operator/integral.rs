//! Integral images.

use crate::Image;

/// Sums over every upright box of a picture in four look-ups (Crow 1984; Viola and Jones 2001).
#[derive(Clone, Debug, PartialEq)]
pub struct Integral {
    /// One column and one row more than the picture: the sums of all pixels to the left of and above a
    /// corner.
    sums: Image<f64>,
}

impl Integral {
    /// Sums of a function of the pixels: their values, squares, weights. Sums of integers are exact below
    /// 2^53.
    pub fn of<P>(image: &Image<P>, mut value: impl FnMut(&P) -> f64) -> Integral {
        let (width, height) = image.size();
        let mut sums = Image::filled(width + 1, height + 1, 0.0);
        let mut above = vec![0.0; width + 1];
        for y in 0..height {
            let mut row = 0.0;
            let target = sums.row_mut(y + 1);
            for (x, pixel) in image.row(y).iter().enumerate() {
                row += value(pixel);
                target[x + 1] = above[x + 1] + row;
            }
            above.copy_from_slice(target);
        }
        Integral { sums }
    }

    /// Sum over the pixels of columns `x` to `x + width - 1` and rows `y` to `y + height - 1`, as far as they
    /// are in the picture.
    pub fn sum(&self, x: isize, y: isize, width: usize, height: usize) -> f64 {
        let (right, lower) = (x.saturating_add_unsigned(width), y.saturating_add_unsigned(height));
        self.sums.at(right, lower) - self.sums.at(x, lower) - self.sums.at(right, y) + self.sums.at(x, y)
    }

    /// The sums themselves: pixel (x, y) holds that of all pixels in columns before `x` and rows before `y`.
    pub fn sums(&self) -> &Image<f64> {
        &self.sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_cut_at_the_border() {
        let image = Image::from_fn(4, 3, |x, y| (1 + x + 10 * y) as f64);
        let integral = Integral::of(&image, |&v| v);
        assert_eq!(integral.sum(1, 1, 2, 1), 12.0 + 13.0);
        assert_eq!(integral.sum(-3, -3, 4, 4), 1.0);
        assert_eq!(integral.sum(-3, -3, usize::MAX, usize::MAX), image.pixels().iter().sum::<f64>());
        assert_eq!(integral.sum(4, 0, 5, 5), 0.0);
    }
}
