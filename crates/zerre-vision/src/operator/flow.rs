//! Sparse optical flow: points that a small window shows again, and where they are in the next picture.

use super::reflect;
use crate::{Error, Image, Result};

/// A grey picture and smaller ones: each level has half the columns and rows of the one before, rounded up,
/// blurred by the binomial window of five pixels (Burt and Adelson 1983), as OpenCV's `pyrDown`.
#[derive(Clone, Debug, PartialEq)]
pub struct Pyramid(Vec<Image<u8>>);

impl Pyramid {
    /// The picture and up to `levels` smaller ones, as long as they have more than `side` columns and rows.
    pub fn new(image: Image<u8>, levels: usize, side: usize) -> Pyramid {
        let mut all = vec![image];
        while all.len() <= levels {
            let next = half(&all[all.len() - 1]);
            if next.width().min(next.height()) <= side.max(1) {
                break;
            }
            all.push(next);
        }
        Pyramid(all)
    }

    /// The pictures, the largest first.
    pub fn levels(&self) -> &[Image<u8>] {
        &self.0
    }
}

/// The next level of a pyramid.
fn half(image: &Image<u8>) -> Image<u8> {
    // They sum to 16: sums over both directions stay below 2^16.
    const WEIGHTS: [u16; 5] = [1, 4, 6, 4, 1];
    let (width, height) = image.size();
    let columns: Vec<usize> = (-2..width as isize + 2).map(|x| reflect(x, width)).collect();
    let (mut sums, mut padded) = (vec![0; width], vec![0; width + 4]);
    let mut result = Image::filled(width.div_ceil(2), height.div_ceil(2), 0);
    for y in 0..result.height() {
        sums.fill(0);
        for (j, weight) in WEIGHTS.into_iter().enumerate() {
            let row = image.row(reflect((2 * y + j) as isize - 2, height));
            for (sum, &pixel) in sums.iter_mut().zip(row) {
                *sum += weight * u16::from(pixel);
            }
        }
        for (padded, &x) in padded.iter_mut().zip(&columns) {
            *padded = sums[x];
        }
        for (pixel, sums) in result.row_mut(y).iter_mut().zip(padded.windows(5).step_by(2)) {
            let sum: u16 = sums.iter().zip(WEIGHTS).map(|(sum, weight)| sum * weight).sum();
            *pixel = ((sum + 128) >> 8) as u8;
        }
    }
    result
}

/// What became of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flow {
    /// Where it is in the second picture, pixels; a guess where it was not found.
    pub point: [f64; 2],
    /// Whether it was found: its window has texture in two directions, and it did not leave the picture.
    pub found: bool,
    /// Mean absolute difference of the two windows, grey levels; zero where it was not found.
    pub residual: f64,
}

/// Pyramidal tracker of Lucas and Kanade (Bouguet 2000, "Pyramidal implementation of the Lucas Kanade feature
/// tracker"), with the border, the derivatives and the stopping rules of OpenCV's `calcOpticalFlowPyrLK`.
/// Windows are interpolated in single precision where OpenCV rounds them to 1/32 of a grey level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LucasKanade {
    /// Side of the square window about a point, pixels; 3 to 255.
    pub side: usize,
    /// How many times the pictures are halved.
    pub levels: usize,
    /// Steps of Newton's method on every level.
    pub iterations: usize,
    /// The step below which it has converged, pixels.
    pub tolerance: f64,
    /// Least eigenvalue of the gradients' mean outer product over the window, squared grey levels a squared
    /// pixel, below which a point is not found. It is 1024 times that of OpenCV.
    pub min_eigenvalue: f64,
}

impl Default for LucasKanade {
    /// Windows of 21 x 21 pixels on a picture and three smaller ones, as in OpenCV.
    fn default() -> LucasKanade {
        LucasKanade { side: 21, levels: 3, iterations: 30, tolerance: 0.01, min_eigenvalue: 0.1024 }
    }
}

/// What the windows of one tracking need.
struct Buffers {
    /// Grey levels of whole pixels.
    pixels: Vec<f32>,
    /// Derivatives of whole pixels.
    slopes: [Vec<f32>; 2],
    /// The interpolated window of the first picture, its derivatives, and the window of the second.
    first: Vec<f32>,
    gradients: [Vec<f32>; 2],
    second: Vec<f32>,
}

/// The pixels of a square of `side` from column `x` and row `y`, mirrored at the picture's border.
fn gather(image: &Image<u8>, x: isize, y: isize, side: usize, into: &mut Vec<f32>) {
    into.clear();
    let (width, height) = image.size();
    for j in 0..side {
        let row = image.row(reflect(y + j as isize, height));
        match usize::try_from(x) {
            Ok(x) if x + side <= width => into.extend(row[x..x + side].iter().map(|&v| f32::from(v))),
            _ => into.extend((0..side).map(|i| f32::from(row[reflect(x + i as isize, width)]))),
        }
    }
}

/// Derivatives at the inner pixels of a gathered square of `side`, grey levels a pixel (Scharr's operator);
/// zero where they lie outside the picture, whose column and row of the first inner pixel is `(x, y)`.
fn derive(
    pixels: &[f32],
    side: usize,
    (x, y): (isize, isize),
    size: (usize, usize),
    slopes: &mut [Vec<f32>; 2],
) {
    let inside = |i: isize, n: usize| usize::try_from(i).is_ok_and(|i| i < n);
    slopes.iter_mut().for_each(Vec::clear);
    for j in 0..side - 2 {
        let [a, b, c] = [0, 1, 2].map(|k| &pixels[(j + k) * side..][..side]);
        for i in 0..side - 2 {
            let across = 3.0 * (a[i + 2] - a[i] + c[i + 2] - c[i]) + 10.0 * (b[i + 2] - b[i]);
            let down = 3.0 * (c[i] - a[i] + c[i + 2] - a[i + 2]) + 10.0 * (c[i + 1] - a[i + 1]);
            let seen = inside(x + i as isize, size.0) && inside(y + j as isize, size.1);
            let scale = if seen { 1.0 / 32.0 } else { 0.0 };
            slopes[0].push(across * scale);
            slopes[1].push(down * scale);
        }
    }
}

/// A square of `side` between the pixels of one of `stride`, which starts `margin` pixels further out.
fn interpolate(pixels: &[f32], stride: usize, [u, v]: [f32; 2], side: usize, into: &mut Vec<f32>) {
    let [a, b, c, d] = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
    into.clear();
    for j in 0..side {
        let (upper, lower) = (&pixels[j * stride..][..side + 1], &pixels[(j + 1) * stride..][..side + 1]);
        into.extend((0..side).map(|i| a * upper[i] + b * upper[i + 1] + c * lower[i] + d * lower[i + 1]));
    }
}

/// Sum of products, in eight interleaved sums.
fn dot(a: &[f32], b: &[f32]) -> f64 {
    let mut sums = [0.0_f32; 8];
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    for (a, b) in a.iter().zip(b) {
        for i in 0..8 {
            sums[i] += a[i] * b[i];
        }
    }
    let rest: f32 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    f64::from(sums.into_iter().sum::<f32>() + rest)
}

/// Pixel of the upper left corner of a window, and how far behind that pixel's centre it is; `None` for one
/// that shows nothing of the picture.
fn corner(point: [f64; 2], side: usize, (width, height): (usize, usize)) -> Option<([isize; 2], [f32; 2])> {
    let start = point.map(|v| v - (side - 1) as f64 / 2.0);
    let pixel = start.map(f64::floor);
    let seen = |v: f64, n: usize| v >= -(side as f64) && v < n as f64;
    (seen(pixel[0], width) && seen(pixel[1], height))
        .then(|| (pixel.map(|v| v as isize), [0, 1].map(|i| (start[i] - pixel[i]) as f32)))
}

impl LucasKanade {
    /// The levels of a picture that [`LucasKanade::track`] needs.
    pub fn pyramid(&self, image: Image<u8>) -> Pyramid {
        Pyramid::new(image, self.levels, self.side)
    }

    /// Where points of one picture are in another of the same size. The answers, in the points' order,
    /// replace what `flows` held. Points are places in the picture: (0.5, 0.5) is the centre of the first
    /// pixel.
    ///
    /// # Errors
    /// Pictures of different sizes; a side below 3 or above 255.
    pub fn track(
        &self,
        from: &Pyramid,
        to: &Pyramid,
        points: &[[f64; 2]],
        flows: &mut Vec<Flow>,
    ) -> Result<()> {
        from.0[0].expect_size(&to.0[0])?;
        if !(3..=255).contains(&self.side) {
            let (what, needs) =
                ("side of the windows of Lucas and Kanade", "from 3 to 255 pixels are needed");
            return Err(Error::OutOfRange { what, value: self.side as f64, needs });
        }
        let empty = || Vec::with_capacity((self.side + 3).pow(2));
        let mut buffers = Buffers {
            pixels: empty(),
            slopes: [empty(), empty()],
            first: empty(),
            gradients: [empty(), empty()],
            second: empty(),
        };
        flows.clear();
        flows.extend(points.iter().map(|&point| self.one(from, to, point, &mut buffers)));
        Ok(())
    }

    /// One point through all levels, the smallest picture first.
    fn one(&self, from: &Pyramid, to: &Pyramid, point: [f64; 2], buffers: &mut Buffers) -> Flow {
        // Pixel 2 i of a level is pixel i of the next: halving is exact for indices of pixels, not for
        // places.
        let start = point.map(|v| v - 0.5);
        let levels = from.0.len().min(to.0.len());
        let mut next = start.map(|v| v / (1_u64 << (levels - 1)) as f64);
        let mut residual = None;
        for level in (0..levels).rev() {
            let here = start.map(|v| v / (1_u64 << level) as f64);
            residual = self.step(&from.0[level], &to.0[level], here, &mut next, level == 0, buffers);
            if level > 0 {
                next = next.map(|v| 2.0 * v);
            }
        }
        Flow { point: next.map(|v| v + 0.5), found: residual.is_some(), residual: residual.unwrap_or(0.0) }
    }

    /// Newton's method on one level. `None` if the point cannot be found; else the mean absolute difference,
    /// which is measured on the `last` level only.
    fn step(
        &self,
        from: &Image<u8>,
        to: &Image<u8>,
        here: [f64; 2],
        next: &mut [f64; 2],
        last: bool,
        buffers: &mut Buffers,
    ) -> Option<f64> {
        let side = self.side;
        let ([x, y], part) = corner(here, side, from.size())?;
        // One pixel more on each side for the derivatives, one for what lies between pixels.
        gather(from, x - 1, y - 1, side + 3, &mut buffers.pixels);
        derive(&buffers.pixels, side + 3, (x, y), from.size(), &mut buffers.slopes);
        interpolate(&buffers.pixels[side + 4..], side + 3, part, side, &mut buffers.first);
        for (slope, gradient) in buffers.slopes.iter().zip(&mut buffers.gradients) {
            interpolate(slope, side + 1, part, side, gradient);
        }
        let [gx, gy] = &buffers.gradients;
        let (a, b, c) = (dot(gx, gx), dot(gx, gy), dot(gy, gy));
        let area = (side * side) as f64;
        let smallest = (a + c - ((a - c) * (a - c) + 4.0 * b * b).sqrt()) / (2.0 * area);
        let determinant = a * c - b * b;
        if smallest < self.min_eigenvalue || determinant.is_nan() || determinant <= 0.0 {
            return None;
        }
        let mut before = [0.0; 2];
        for iteration in 0..self.iterations {
            let ([x, y], part) = corner(*next, side, to.size())?;
            gather(to, x, y, side + 1, &mut buffers.pixels);
            interpolate(&buffers.pixels, side + 1, part, side, &mut buffers.second);
            for (second, first) in buffers.second.iter_mut().zip(&buffers.first) {
                *second -= first;
            }
            let (p, q) = (dot(&buffers.second, gx), dot(&buffers.second, gy));
            let delta = [(b * q - c * p) / determinant, (b * p - a * q) / determinant];
            *next = [next[0] + delta[0], next[1] + delta[1]];
            if delta[0] * delta[0] + delta[1] * delta[1] <= self.tolerance * self.tolerance {
                break;
            }
            // Two places in turn: the point is between them.
            if iteration > 0 && (0..2).all(|i| (delta[i] + before[i]).abs() < 0.01) {
                *next = [next[0] - delta[0] / 2.0, next[1] - delta[1] / 2.0];
                break;
            }
            before = delta;
        }
        if !last {
            return Some(0.0);
        }
        let ([x, y], part) = corner(*next, side, to.size())?;
        gather(to, x, y, side + 1, &mut buffers.pixels);
        interpolate(&buffers.pixels, side + 1, part, side, &mut buffers.second);
        let differences = buffers.second.iter().zip(&buffers.first).map(|(s, f)| f64::from((s - f).abs()));
        Some(differences.sum::<f64>() / area)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiny_pictures_and_strange_points_are_survived() {
        assert_eq!(Pyramid::new(Image::filled(5, 4, 0), usize::MAX, 0).levels().len(), 2);
        let tracker = LucasKanade::default();
        let mut flows = Vec::new();
        for (width, height) in [(1, 1), (1, 30), (23, 22), (90, 60)] {
            let image = Image::from_fn(width, height, |x, y| ((x * x * 3 + y * 7 + x * y) % 256) as u8);
            let pyramid = tracker.pyramid(image);
            let points = [[0.5; 2], [f64::NAN; 2], [1e300, -1e300], [-20.0, 3.0], [f64::INFINITY, 0.0]];
            tracker.track(&pyramid, &pyramid, &points, &mut flows).unwrap();
            assert_eq!(flows.len(), points.len());
            assert!([1, 2, 4].iter().all(|&i| !flows[i].found));
        }
        let [a, b] = [8, 9].map(|width| tracker.pyramid(Image::filled(width, 8, 0)));
        assert!(tracker.track(&a, &b, &[], &mut flows).is_err());
        assert!(LucasKanade { side: 2, ..tracker }.track(&a, &a, &[], &mut flows).is_err());
    }

    #[test]
    fn pictures_without_texture_find_nothing() {
        let tracker = LucasKanade { levels: 1, ..LucasKanade::default() };
        let mut flows = Vec::new();
        for slope in [0, 3] {
            let pyramid = tracker.pyramid(Image::from_fn(80, 80, |x, _| (x * slope) as u8));
            tracker.track(&pyramid, &pyramid, &[[40.0, 40.0]], &mut flows).unwrap();
            assert!(!flows[0].found);
        }
    }
}
