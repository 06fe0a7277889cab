//! Corners: points whose surroundings differ in every direction.

use super::{covered, reflect};
use crate::{Error, Image, Rect, Result};

/// Which corners are taken (Shi and Tomasi 1994, "Good features to track").
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corners {
    /// At most how many, the best first; zero for all.
    pub count: usize,
    /// Least quality, as a share of the best corner's, from 0 to 1.
    pub quality: f64,
    /// Least distance of two corners, pixels.
    pub distance: f64,
    /// Side of the window over which gradients are summed, odd, up to 255.
    pub side: usize,
}

impl Default for Corners {
    /// Up to 100 corners of at least 1 % of the best one's quality, 5 pixels apart, by windows of 3 x 3
    /// pixels.
    fn default() -> Corners {
        Corners { count: 100, quality: 0.01, distance: 5.0, side: 3 }
    }
}

/// Lesser eigenvalue of the sum of the gradients' outer products over windows of `2 radius + 1` pixels, up to
/// a common factor; for `width` x `height` pixels from column `x` and row `y`.
fn least_eigenvalues(image: &Image<u8>, radius: usize, area: [usize; 4]) -> Image<f64> {
    let [x, y, width, height] = area;
    let (columns, rows) = image.size();
    let mirrored = |first: usize, count: usize, all: usize| -> Vec<[usize; 3]> {
        let about = |i: usize| {
            let i = reflect((first + i) as isize - radius as isize, all) as isize;
            [i - 1, i, i + 1].map(|i| reflect(i, all))
        };
        (0..count).map(about).collect()
    };
    // Windows that reach over the border see the mirrored pixels.
    let (across, down) = (width + 2 * radius, height + 2 * radius);
    let [columns, rows] = [mirrored(x, across, columns), mirrored(y, down, rows)];
    let side = 2 * radius + 1;
    let mut products = Image::filled(across, down, [0_i32; 3]);
    let mut sums = vec![[0_i64; 3]; across];
    let mut result = Image::filled(width, height, 0.0);
    for (j, rows) in rows.iter().enumerate() {
        let [above, here, below] = rows.map(|y| image.row(y));
        let row = products.row_mut(j).iter_mut().zip(&mut sums).zip(&columns);
        for ((product, sum), &[left, middle, right]) in row {
            let level = |row: &[u8], x: usize| i32::from(row[x]);
            // Sobel's derivatives.
            let across = level(above, right) - level(above, left)
                + 2 * (level(here, right) - level(here, left))
                + level(below, right)
                - level(below, left);
            let down = level(below, left) - level(above, left)
                + 2 * (level(below, middle) - level(above, middle))
                + level(below, right)
                - level(above, right);
            *product = [across * across, across * down, down * down];
            (0..3).for_each(|k| sum[k] += i64::from(product[k]));
        }
        let Some(top) = (j + 1).checked_sub(side) else { continue };
        let mut window = [0_i64; 3];
        let add = |window: &mut [i64; 3], sum: &[i64; 3]| (0..3).for_each(|k| window[k] += sum[k]);
        sums[..side - 1].iter().for_each(|sum| add(&mut window, sum));
        for (i, value) in result.row_mut(top).iter_mut().enumerate() {
            add(&mut window, &sums[i + side - 1]);
            let [a, b, c] = window.map(|v| v as f64);
            *value = (a + c) / 2.0 - ((a - c) * (a - c) / 4.0 + b * b).sqrt();
            add(&mut window, &sums[i].map(|v| -v));
        }
        for (sum, product) in sums.iter_mut().zip(products.row(top)) {
            (0..3).for_each(|k| sum[k] -= i64::from(product[k]));
        }
    }
    result
}

/// Corners whose pixels' centres lie in a box, the best first, as OpenCV's `goodFeaturesToTrack`: pixels
/// whose lesser eigenvalue is the largest of their 3 x 3 neighbours'. The outermost pixels of the picture are
/// none. Corners are centres of pixels: half a pixel more than OpenCV's indices.
///
/// # Errors
/// An even window; a quality outside 0 to 1; a distance that is negative or not finite.
pub fn corners(image: &Image<u8>, bounds: Rect, settings: &Corners) -> Result<Vec<[f64; 2]>> {
    let Corners { count, quality, distance, side } = *settings;
    let refuse = |what, value, needs| Err(Error::OutOfRange { what, value, needs });
    if side % 2 == 0 || side > 255 {
        let needs = "an odd number of pixels up to 255 is needed";
        return refuse("side of the windows of corners", side as f64, needs);
    }
    let radius = side / 2;
    if !(0.0..=1.0).contains(&quality) {
        return refuse("least quality of corners", quality, "a share from 0 to 1 is needed");
    }
    if !(distance.is_finite() && distance >= 0.0) {
        return refuse("least distance of corners", distance, "0 or a positive number of pixels is needed");
    }
    let (columns, rows) = covered(bounds, image.size());
    // Neighbours decide whether a pixel is a maximum, in the box or not; the outermost ones have too few.
    let (left, right) = (columns.start.max(1), columns.end.min(image.width() - 1));
    let (upper, lower) = (rows.start.max(1), rows.end.min(image.height() - 1));
    if left >= right || upper >= lower {
        return Ok(Vec::new());
    }
    let area = [left - 1, upper - 1, right - left + 2, lower - upper + 2];
    let eigenvalues = least_eigenvalues(image, radius, area);
    // The best is looked for in the whole box, its pixels at the picture's border included.
    let inner = |x: usize, y: usize| columns.contains(&(x + left - 1)) && rows.contains(&(y + upper - 1));
    let mut best = 0.0_f64;
    for y in 0..eigenvalues.height() {
        for (x, &value) in eigenvalues.row(y).iter().enumerate() {
            if inner(x, y) {
                best = best.max(value);
            }
        }
    }
    let mut found = Vec::new();
    for y in 1..eigenvalues.height() - 1 {
        for x in 1..eigenvalues.width() - 1 {
            let value = eigenvalues.row(y)[x];
            let largest =
                || (y - 1..=y + 1).all(|j| eigenvalues.row(j)[x - 1..=x + 1].iter().all(|&v| v <= value));
            if value > quality * best && value > 0.0 && largest() {
                found.push((value, x + left - 1, y + upper - 1));
            }
        }
    }
    // Of equals the last one first, as in OpenCV.
    found.reverse();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut corners: Vec<[f64; 2]> = Vec::new();
    for (_, x, y) in found {
        let corner = [x as f64 + 0.5, y as f64 + 0.5];
        let near = |c: &[f64; 2]| {
            let (dx, dy) = (c[0] - corner[0], c[1] - corner[1]);
            dx * dx + dy * dy < distance * distance
        };
        if !corners.iter().any(near) {
            corners.push(corner);
        }
        if count > 0 && corners.len() == count {
            break;
        }
    }
    Ok(corners)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn odd_boxes_have_no_corner_or_are_refused() {
        let image = Image::from_fn(12, 9, |x, y| if x > 5 && y > 4 { 200 } else { 10 });
        let all = Rect { x: -5.0, y: -5.0, width: 99.0, height: 99.0 };
        let settings = Corners::default();
        assert_eq!(corners(&image, all, &settings).unwrap().len(), 1);
        for (image, bounds) in [
            (Image::filled(1, 1, 0), all),
            (Image::filled(2, 40, 0), all),
            (Image::filled(12, 9, 77), all),
            (image.clone(), Rect { x: f64::NAN, ..all }),
            (image.clone(), Rect { width: 0.0, ..all }),
        ] {
            assert_eq!(corners(&image, bounds, &settings).unwrap(), Vec::<[f64; 2]>::new());
        }
        assert_eq!(corners(&image, all, &Corners { side: 31, ..settings }).unwrap().len(), 1);
        assert!(corners(&image, all, &Corners { side: 2, ..settings }).is_err());
        assert!(corners(&image, all, &Corners { quality: 1.5, ..settings }).is_err());
        assert!(corners(&image, all, &Corners { distance: f64::NAN, ..settings }).is_err());
    }
}
