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
    let level = |x: usize, y: usize, dx: isize, dy: isize| {
        let (x, y) = (reflect(x as isize + dx, columns), reflect(y as isize + dy, rows));
        i64::from(image.row(y)[x])
    };
    // Products of Sobel's derivatives; windows that reach over the border see those of the mirrored pixels.
    let products = Image::from_fn(width + 2 * radius, height + 2 * radius, |i, j| {
        let x = reflect((x + i) as isize - radius as isize, columns);
        let y = reflect((y + j) as isize - radius as isize, rows);
        let at = |dx, dy| level(x, y, dx, dy);
        let across = at(1, -1) - at(-1, -1) + 2 * (at(1, 0) - at(-1, 0)) + at(1, 1) - at(-1, 1);
        let down = at(-1, 1) - at(-1, -1) + 2 * (at(0, 1) - at(0, -1)) + at(1, 1) - at(1, -1);
        [across * across, across * down, down * down]
    });
    let side = 2 * radius + 1;
    let add = |sum: [i64; 3], p: &[i64; 3]| [sum[0] + p[0], sum[1] + p[1], sum[2] + p[2]];
    let along_rows = Image::from_fn(width, height + 2 * radius, |i, j| {
        products.row(j)[i..i + side].iter().fold([0; 3], add)
    });
    Image::from_fn(width, height, |i, j| {
        let [a, b, c] =
            (j..j + side).fold([0; 3], |sum, j| add(sum, &along_rows.row(j)[i])).map(|v| v as f64);
        (a + c) / 2.0 - ((a - c) * (a - c) / 4.0 + b * b).sqrt()
    })
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
