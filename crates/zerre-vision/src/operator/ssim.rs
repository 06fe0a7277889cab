//! Structural similarity.

use super::odd;
use crate::{Error, Image, Rect, Result};
use fearless_simd::{Level, dispatch};
use zerre::math::{exp, ln};

/// (K1 255)^2 and (K2 255)^2 with K1 = 0.01 and K2 = 0.03: what keeps the quotients finite.
const C1: f64 = 6.5025;
const C2: f64 = 58.5225;

/// Structural similarity of grey pictures (Wang, Bovik, Sheikh and Simoncelli 2004, IEEE Transactions on
/// Image Processing 13(4), eq. 12): l^alpha c^beta s^gamma of the luminance, the contrast and the structure
/// in a square window, averaged over all windows that lie in the pictures.
///
/// With exponents of one it is scikit-image's `structural_similarity` with uniform windows, sample
/// covariances and a range of 255. The structure is a correlation and may be negative: with another exponent
/// its sign is kept, s^gamma = sign(s) |s|^gamma, so that the opposite of a picture is never like it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ssim {
    side: usize,
    exponents: [f64; 3],
}

impl Default for Ssim {
    /// Windows of 7 x 7 pixels, exponents of one.
    fn default() -> Ssim {
        Ssim { side: 7, exponents: [1.0; 3] }
    }
}

/// A grey picture with mean and variance of its windows: what every comparison with it shares.
#[derive(Clone, Debug)]
pub struct Windows {
    side: usize,
    image: Image<u8>,
    means: Image<f64>,
    variances: Image<f64>,
}

impl Windows {
    /// The picture.
    pub fn image(&self) -> &Image<u8> {
        &self.image
    }
}

/// Sums over the columns of `side` rows, which move down row by row.
struct Columns {
    side: usize,
    sums: Vec<u32>,
    /// Sum of the columns before each.
    before: Vec<u32>,
}

impl Columns {
    fn new(side: usize, width: usize) -> Columns {
        Columns { side, sums: vec![0; width], before: vec![0; width + 1] }
    }

    /// Adds the products of two rows.
    #[inline(always)]
    fn enter(&mut self, a: &[u8], b: &[u8]) {
        for ((sum, &a), &b) in self.sums.iter_mut().zip(a).zip(b) {
            *sum = sum.wrapping_add(u32::from(u16::from(a) * u16::from(b)));
        }
    }

    /// Takes the products of two rows away.
    #[inline(always)]
    fn leave(&mut self, a: &[u8], b: &[u8]) {
        for ((sum, &a), &b) in self.sums.iter_mut().zip(a).zip(b) {
            *sum = sum.wrapping_sub(u32::from(u16::from(a) * u16::from(b)));
        }
    }

    /// The sums over all windows of `side` columns, from the left; none exceeds 32 bits.
    #[inline(always)]
    fn windows(&mut self) -> impl Iterator<Item = u32> + '_ {
        let mut sum = 0_u32;
        for (before, &column) in self.before[1..].iter_mut().zip(&self.sums) {
            sum = sum.wrapping_add(column);
            *before = sum;
        }
        self.before[self.side..].iter().zip(&self.before).map(|(&end, &start)| end.wrapping_sub(start))
    }
}

impl Ssim {
    /// Windows of `side` x `side` pixels, exponents of one.
    ///
    /// # Errors
    /// A side that is even, one, or above 255.
    pub fn new(side: usize) -> Result<Ssim> {
        let what = "side of the windows of structural similarity";
        if !(3..=255).contains(&odd(what, side)?) {
            let needs = "an odd number of pixels from 3 to 255 is needed";
            return Err(Error::OutOfRange { what, value: side as f64, needs });
        }
        Ok(Ssim { side, ..Ssim::default() })
    }

    /// Other exponents of luminance, contrast and structure (alpha, beta, gamma). Exponents other than zero
    /// and one cost a power a window.
    ///
    /// # Errors
    /// An exponent that is negative or not finite.
    pub fn with_exponents(self, luminance: f64, contrast: f64, structure: f64) -> Result<Ssim> {
        let exponents = [luminance, contrast, structure];
        for value in exponents {
            if !(value.is_finite() && value >= 0.0) {
                let needs = "zero or a positive number is needed";
                return Err(Error::OutOfRange { what: "exponent of structural similarity", value, needs });
            }
        }
        Ok(Ssim { exponents, ..self })
    }

    /// Side of the windows, pixels.
    pub fn side(&self) -> usize {
        self.side
    }

    /// Means and variances of a picture's windows, for many comparisons with it.
    ///
    /// # Errors
    /// A picture that is smaller than a window.
    pub fn windows(&self, image: Image<u8>) -> Result<Windows> {
        let (width, height) = image.size();
        if width.min(height) < self.side {
            return Err(Error::Size { found: image.size(), expected: (self.side, self.side) });
        }
        let (across, down) = (width - self.side + 1, height - self.side + 1);
        let mut means = Image::filled(across, down, 0.0);
        let mut variances = means.clone();
        let ones = vec![1; width];
        let mut sums = Columns::new(self.side, width);
        let mut squares = Columns::new(self.side, width);
        let n = (self.side * self.side) as f64;
        for y in 0..height {
            let row = image.row(y);
            sums.enter(row, &ones);
            squares.enter(row, row);
            let Some(upper) = (y + 1).checked_sub(self.side) else { continue };
            let target = means.row_mut(upper).iter_mut().zip(variances.row_mut(upper));
            for (((mean, variance), sum), square) in target.zip(sums.windows()).zip(squares.windows()) {
                // Integers below 2^53: only the quotients are rounded.
                let (sum, square) = (f64::from(sum), f64::from(square));
                *mean = sum / n;
                *variance = (n * square - sum * sum) / (n * (n - 1.0));
            }
            let row = image.row(upper);
            sums.leave(row, &ones);
            squares.leave(row, row);
        }
        Ok(Windows { side: self.side, image, means, variances })
    }

    /// The value of one window from means, variances and covariance.
    #[inline(always)]
    fn value(&self, means: [f64; 2], variances: [f64; 2], covariance: f64) -> f64 {
        let ([a, b], [v, w]) = (means, variances);
        let (above, below) = (2.0 * a * b + C1, a * a + b * b + C1);
        if self.exponents == [1.0; 3] {
            return above * (2.0 * covariance + C2) / (below * (v + w + C2));
        }
        let deviations = (v * w).sqrt();
        let parts = [
            above / below,
            (2.0 * deviations + C2) / (v + w + C2),
            (covariance + C2 / 2.0) / (deviations + C2 / 2.0),
        ];
        let mut product = 1.0;
        for (part, exponent) in parts.into_iter().zip(self.exponents) {
            product *= match exponent {
                0.0 => 1.0,
                1.0 => part,
                _ => exp(exponent * ln(part.abs())).copysign(part),
            };
        }
        product
    }

    /// Calls `each` with every row of windows of `template` against the part of `scene` at a corner.
    fn rows(
        &self,
        template: &Windows,
        scene: &Windows,
        corner: (usize, usize),
        columns: &mut Columns,
        values: &mut [f64],
        each: impl FnMut(&[f64]),
    ) {
        // The same code for every SIMD level, which the compiler widens; nothing in it depends on the width.
        dispatch!(Level::new(), _simd => self.rows_here(template, scene, corner, columns, values, each));
    }

    #[inline(always)]
    fn rows_here(
        &self,
        template: &Windows,
        scene: &Windows,
        (left, upper): (usize, usize),
        columns: &mut Columns,
        values: &mut [f64],
        mut each: impl FnMut(&[f64]),
    ) {
        let n = (self.side * self.side) as f64;
        let (share, unbiased) = (1.0 / (n - 1.0), n / (n - 1.0));
        let (width, height) = template.image.size();
        columns.sums.fill(0);
        for y in 0..height {
            columns.enter(template.image.row(y), &scene.image.row(upper + y)[left..][..width]);
            let Some(top) = (y + 1).checked_sub(self.side) else { continue };
            let statistics = template.means.row(top).iter().zip(template.variances.row(top));
            let others = scene.means.row(upper + top)[left..].iter();
            let others = others.zip(&scene.variances.row(upper + top)[left..]);
            let windows = values.iter_mut().zip(columns.windows()).zip(statistics).zip(others);
            for (((value, product), (&a, &v)), (&b, &w)) in windows {
                let covariance = f64::from(product) * share - unbiased * (a * b);
                *value = self.value([a, b], [v, w], covariance);
            }
            each(values);
            columns.leave(template.image.row(top), &scene.image.row(upper + top)[left..][..width]);
        }
    }

    /// Mean structural similarity of a template and of each part of a scene of its size: the scores of
    /// `corners`, the column and the row of the parts' upper left pixels. Means and variances of the scene
    /// are shared by all; only the covariance is of each part. The scores replace what `scores` held.
    ///
    /// # Errors
    /// Windows of another side; a corner whose part is not all in the scene.
    pub fn scores(
        &self,
        template: &Windows,
        scene: &Windows,
        corners: &[(usize, usize)],
        scores: &mut Vec<f64>,
    ) -> Result<()> {
        for windows in [template, scene] {
            if windows.side != self.side {
                let (what, needs) =
                    ("side of a picture's windows", "that of the similarity which compares them is needed");
                return Err(Error::OutOfRange { what, value: windows.side as f64, needs });
            }
        }
        let (width, height) = template.image.size();
        let (right, lower) = scene.image.size();
        scores.clear();
        let (across, down) = template.means.size();
        let mut columns = Columns::new(self.side, width);
        let (mut values, mut totals) = (vec![0.0; across], vec![0.0; across]);
        for &(x, y) in corners {
            let inside = |start: usize, side: usize, end: usize| start <= end && side <= end - start;
            if !inside(x, width, right) || !inside(y, height, lower) {
                let [x, y, width, height] = [x, y, width, height].map(|v| v as f64);
                let problem =
                    format!("is not inside the scene of {right} x {lower} pixels: crop a larger one");
                return Err(Error::Bounds { bounds: Rect { x, y, width, height }, problem });
            }
            totals.fill(0.0);
            self.rows(template, scene, (x, y), &mut columns, &mut values, |row| {
                for (total, value) in totals.iter_mut().zip(row) {
                    *total += value;
                }
            });
            scores.push(totals.iter().sum::<f64>() / (across * down) as f64);
        }
        Ok(())
    }

    /// Mean structural similarity of two pictures; at most 1, which only equal pictures have.
    ///
    /// # Errors
    /// Pictures of different sizes, or smaller than a window.
    pub fn mean(&self, a: &Image<u8>, b: &Image<u8>) -> Result<f64> {
        a.expect_size(b)?;
        let mut scores = Vec::with_capacity(1);
        self.scores(&self.windows(a.clone())?, &self.windows(b.clone())?, &[(0, 0)], &mut scores)?;
        Ok(scores[0])
    }

    /// Structural similarity of every window of two pictures: pixel (x, y) is that of the window from (x, y)
    /// to (x + side, y + side), so the map is smaller than the pictures by side - 1.
    ///
    /// # Errors
    /// Pictures of different sizes, or smaller than a window.
    pub fn map(&self, a: &Image<u8>, b: &Image<u8>) -> Result<Image<f64>> {
        a.expect_size(b)?;
        let (a, b) = (self.windows(a.clone())?, self.windows(b.clone())?);
        let (across, down) = a.means.size();
        let mut map = Vec::with_capacity(across * down);
        let mut columns = Columns::new(self.side, a.image.width());
        self.rows(&a, &b, (0, 0), &mut columns, &mut vec![0.0; across], |row| map.extend_from_slice(row));
        Image::new(across, down, map)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extreme_pictures_do_not_overflow() {
        let ssim = Ssim::new(255).unwrap();
        let white = Image::filled(256, 255, 255);
        assert_eq!(ssim.mean(&white, &white).unwrap(), 1.0);
        let stripes = Image::from_fn(256, 255, |x, _| if x % 2 == 0 { 255 } else { 0 });
        let opposite = stripes.map(|v| 255 - v);
        for exponents in [[1.0; 3], [0.5; 3]] {
            let [l, c, s] = exponents;
            let ssim = ssim.with_exponents(l, c, s).unwrap();
            assert!((ssim.mean(&stripes, &stripes).unwrap() - 1.0).abs() < 1e-12);
            assert!(ssim.mean(&stripes, &opposite).unwrap() < -0.9);
        }
    }

    #[test]
    fn every_simd_level_gives_the_same_bits() {
        let [a, b] = [3, 5].map(|k| Image::from_fn(29, 17, |x, y| ((k * x * x + 7 * y * x) % 256) as u8));
        for exponents in [[1.0; 3], [0.3, 1.7, 0.6]] {
            let ssim = Ssim { exponents, ..Ssim::default() };
            let [template, scene] = [&a, &b].map(|image| ssim.windows(image.clone()).unwrap());
            let (mut columns, mut values, mut map) = (Columns::new(7, 29), [0.0; 23], Vec::new());
            let collect = |row: &[f64]| map.extend_from_slice(row);
            // Compiled for the least level of the target.
            ssim.rows_here(&template, &scene, (0, 0), &mut columns, &mut values, collect);
            assert_eq!(ssim.map(&a, &b).unwrap().pixels(), map);
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        assert!([0, 1, 2, 8, 257].iter().all(|&side| Ssim::new(side).is_err()));
        let ssim = Ssim::default();
        assert!(ssim.with_exponents(1.0, -1.0, 1.0).is_err());
        assert!(ssim.mean(&Image::filled(6, 7, 0), &Image::filled(6, 7, 0)).is_err());
        let (small, large) = (Image::filled(7, 7, 1), Image::filled(9, 8, 1));
        assert!(ssim.map(&small, &large).is_err());
        let [template, scene] = [small, large].map(|image| ssim.windows(image).unwrap());
        let mut scores = vec![9.0];
        ssim.scores(&template, &scene, &[(2, 1), (0, 0)], &mut scores).unwrap();
        assert_eq!(scores, [1.0, 1.0]);
        for corner in [(3, 0), (0, 2), (usize::MAX, 0)] {
            assert!(ssim.scores(&template, &scene, &[corner], &mut scores).is_err());
        }
        assert!(ssim.scores(&scene, &template, &[(0, 0)], &mut scores).is_err());
        assert!(Ssim::new(5).unwrap().scores(&template, &scene, &[(0, 0)], &mut scores).is_err());
    }
}
