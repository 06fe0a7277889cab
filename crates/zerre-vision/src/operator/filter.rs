//! Linear filters.

use super::{odd, reflect};
use crate::{Error, Image, Result};
use zerre::math::exp;

/// Weights of a Gaussian window of `size` pixels that sum to one, as OpenCV's `getGaussianKernel`. Without a
/// standard deviation (`sigma`, pixels) it is 0.3 ((size - 1) / 2 - 1) + 0.8, and up to 9 pixels the window
/// is OpenCV's table of multiples of 1/256 - the binomial weights up to 7 - instead.
///
/// # Errors
/// An even size or none; a standard deviation that is not a positive number.
pub fn gaussian_kernel(size: usize, sigma: Option<f64>) -> Result<Vec<f64>> {
    let radius = odd("size of a Gaussian window", size)? / 2;
    if let Some(sigma) = sigma
        && !(sigma.is_finite() && sigma > 0.0)
    {
        let needs = "a positive number of pixels is needed";
        return Err(Error::OutOfRange {
            what: "standard deviation of a Gaussian window",
            value: sigma,
            needs,
        });
    }
    let table: &[u32] = match size {
        1 => &[256],
        3 => &[64, 128, 64],
        5 => &[16, 64, 96, 64, 16],
        7 => &[8, 28, 56, 72, 56, 28, 8],
        9 => &[4, 13, 30, 51, 60, 51, 30, 13, 4],
        _ => &[],
    };
    if sigma.is_none() && !table.is_empty() {
        return Ok(table.iter().map(|&w| f64::from(w) / 256.0).collect());
    }
    let sigma = sigma.unwrap_or(0.3 * (radius as f64 - 1.0) + 0.8);
    let weight = |i: usize| {
        let x = (i as f64 - radius as f64) / sigma;
        exp(-0.5 * x * x)
    };
    let total: f64 = (0..size).map(weight).sum();
    Ok((0..size).map(|i| weight(i) / total).collect())
}

/// Weights in units of 1/256 that sum to 256: what rounding one takes, its neighbour towards the middle gets.
fn fixed_point(kernel: &[f64]) -> Vec<u16> {
    let radius = kernel.len() / 2;
    let (mut fixed, mut error, mut sum) = (vec![0; kernel.len()], 0.0, 0);
    for i in 0..radius {
        let exact = kernel[i] * 256.0 + error;
        let rounded = exact.round_ties_even();
        error = exact - rounded;
        let weight = rounded as u16;
        (fixed[i], fixed[kernel.len() - 1 - i]) = (weight, weight);
        sum += 2 * weight;
    }
    fixed[radius] = 256 - sum;
    fixed
}

/// A picture under a separable window: along the rows first, into the type of sums `S`, then along the
/// columns. The border is mirrored at the outermost pixels (OpenCV's `BORDER_REFLECT_101`).
fn separable<P: Copy, S: Copy + Default, T: Copy + Default>(
    image: &Image<P>,
    kernel: &[S],
    along_row: impl Fn(&mut S, P, S),
    along_column: impl Fn(&mut T, S, S),
) -> Image<T> {
    let (width, height) = image.size();
    let radius = (kernel.len() / 2) as isize;
    let columns: Vec<usize> = (-radius..width as isize + radius).map(|x| reflect(x, width)).collect();
    let mut padded = Vec::with_capacity(columns.len());
    let mut rows = Image::filled(width, height, S::default());
    for y in 0..height {
        let source = image.row(y);
        padded.clear();
        padded.extend(columns.iter().map(|&x| source[x]));
        let sums = rows.row_mut(y);
        for (i, &weight) in kernel.iter().enumerate() {
            for (sum, &pixel) in sums.iter_mut().zip(&padded[i..]) {
                along_row(sum, pixel, weight);
            }
        }
    }
    let mut result = Image::filled(width, height, T::default());
    for y in 0..height {
        let sums = result.row_mut(y);
        for (i, &weight) in kernel.iter().enumerate() {
            let row = rows.row(reflect(y as isize + i as isize - radius, height));
            for (sum, &pixel) in sums.iter_mut().zip(row) {
                along_column(sum, pixel, weight);
            }
        }
    }
    result
}

/// A grey picture blurred by a Gaussian window of `size` x `size` pixels ([`gaussian_kernel`]), as OpenCV's
/// `GaussianBlur`: weights are multiples of 1/256, and the result is rounded once.
///
/// # Errors
/// What [`gaussian_kernel`] refuses.
pub fn blur(image: &Image<u8>, size: usize, sigma: Option<f64>) -> Result<Image<u8>> {
    let kernel = fixed_point(&gaussian_kernel(size, sigma)?);
    let sums = separable(
        image,
        &kernel,
        |sum, pixel: u8, weight| *sum += u16::from(pixel) * weight,
        |sum: &mut u32, row, weight| *sum += u32::from(row) * u32::from(weight),
    );
    Ok(sums.map(|&sum| ((sum + (1 << 15)) >> 16) as u8))
}

/// [`blur`] of real numbers, without rounding.
///
/// # Errors
/// What [`gaussian_kernel`] refuses.
pub fn blur_f32(image: &Image<f32>, size: usize, sigma: Option<f64>) -> Result<Image<f32>> {
    let kernel: Vec<f32> = gaussian_kernel(size, sigma)?.iter().map(|&w| w as f32).collect();
    let step = |sum: &mut f32, pixel: f32, weight: f32| *sum += pixel * weight;
    Ok(separable(image, &kernel, step, step))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_one() {
        for size in [1, 3, 9, 11, 31] {
            for sigma in [None, Some(0.1), Some(2.5)] {
                let kernel = gaussian_kernel(size, sigma).unwrap();
                assert!((kernel.iter().sum::<f64>() - 1.0).abs() < 1e-14);
                assert_eq!(fixed_point(&kernel).iter().sum::<u16>(), 256);
            }
        }
    }

    #[test]
    fn a_picture_of_one_colour_stays() {
        for (width, height) in [(1, 1), (1, 5), (4, 2)] {
            let image = Image::filled(width, height, 255);
            assert_eq!(blur(&image, 11, None).unwrap(), image);
        }
        assert!(blur(&Image::filled(3, 3, 0), 4, None).is_err());
        assert!(blur(&Image::filled(3, 3, 0), 0, None).is_err());
        assert!(blur_f32(&Image::filled(3, 3, 0.0), 3, Some(f64::NAN)).is_err());
    }
}
