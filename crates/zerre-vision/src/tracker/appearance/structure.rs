//! Structural similarity of many boxes of one frame (Wang, Bovik, Sheikh and Simoncelli, IEEE Transactions on
//! Image Processing 13(4), 2004; Dilmen and Talu 2017, equations 10 and 14).
//!
//! Local means and variances of the frame belong to its pixels and not to a box: they are computed once for
//! all boxes, and a box adds the local means of its products with the template alone.

use super::settings::CentreWeight;
use crate::Image;
use zerre::math::Real;

/// Grey values are added in lanes of so many, in an order that no processor changes.
const LANES: usize = 8;
/// C1 and C2 of the paper: (0.01 L)^2 and (0.03 L)^2 for grey values up to L = 255.
const C1: f32 = 6.5025;
const C2: f32 = 58.5225;

/// Grey values of a rectangle, from 0 to 255, in rows of `stride`. Behind the columns that count, and behind
/// the last row, there is room to read whole lanes.
#[derive(Clone, Debug, Default)]
pub(super) struct Plane {
    pub(super) stride: usize,
    pub(super) height: usize,
    pub(super) values: Vec<f32>,
}

impl Plane {
    /// A plane of zeros with room for `columns` x `rows`, in the memory of this one.
    pub(super) fn reset(&mut self, columns: usize, rows: usize) {
        (self.stride, self.height) = (columns.next_multiple_of(LANES) + 2 * LANES, rows);
        self.values.clear();
        self.values.resize(self.stride * (rows + 1), 0.0);
    }

    pub(super) fn row_mut(&mut self, y: usize) -> &mut [f32] {
        &mut self.values[y * self.stride..][..self.stride]
    }

    /// Makes it the `columns` x `rows` that begin at column `x` and row `y` of another.
    #[inline(always)]
    pub(super) fn copy(&mut self, plane: &Plane, (x, y): (usize, usize), (columns, rows): (usize, usize)) {
        self.reset(columns, rows);
        for j in 0..rows {
            self.row_mut(j)[..columns].copy_from_slice(&plane.from(x, y + j)[..columns]);
        }
    }

    /// Makes it a picture.
    pub(super) fn copy_image(&mut self, image: &Image<f32>) {
        self.reset(image.width(), image.height());
        for j in 0..image.height() {
            self.row_mut(j)[..image.width()].copy_from_slice(image.row(j));
        }
    }

    fn from(&self, x: usize, y: usize) -> &[f32] {
        &self.values[y * self.stride + x..]
    }
}

/// What turns the sums over a square into a mean and a sample covariance.
#[derive(Clone, Copy, Debug)]
struct Shares {
    mean: f32,
    product: f32,
    squared: f32,
}

impl Shares {
    #[inline(always)]
    fn of(window: usize) -> Shares {
        let n = (window * window) as f32;
        Shares { mean: 1.0 / n, product: 1.0 / (n - 1.0), squared: n / (n - 1.0) }
    }
}

/// Local means and variances of a plane, of the squares that begin at each pixel.
#[derive(Clone, Debug, Default)]
pub(super) struct Moments {
    mean: Plane,
    variance: Plane,
}

/// Memory that boxes use one after the other.
#[derive(Clone, Debug, Default)]
pub(super) struct Sums {
    columns: Vec<f32>,
    squares: Vec<f32>,
    row: Vec<f32>,
    row_squares: Vec<f32>,
}

impl Sums {
    fn reset(&mut self, stride: usize) {
        for sums in [&mut self.columns, &mut self.squares, &mut self.row, &mut self.row_squares] {
            sums.clear();
            sums.resize(stride, 0.0);
        }
    }
}

/// `sums[x] <- columns[x] + ... + columns[x + window - 1]`, as far as both reach.
#[inline(always)]
fn along(columns: &[f32], window: usize, sums: &mut [f32]) {
    let count = (columns.len() + 1).saturating_sub(window).min(sums.len());
    let sums = &mut sums[..count];
    sums.copy_from_slice(&columns[..count]);
    // Three at a time: the sums go through memory less often.
    let mut j = 1;
    while j < window {
        let from = |j: usize| &columns[j..][..count];
        let (a, b, c) = (from(j), from((j + 1).min(window - 1)), from((j + 2).min(window - 1)));
        match window - j {
            1 => (0..count).for_each(|x| sums[x] += a[x]),
            2 => (0..count).for_each(|x| sums[x] += a[x] + b[x]),
            _ => (0..count).for_each(|x| sums[x] += a[x] + b[x] + c[x]),
        }
        j += 3;
    }
}

impl Moments {
    /// Those of `plane`, over squares of side `window`, which is at most its height and width.
    #[inline(always)]
    pub(super) fn fill(&mut self, plane: &Plane, window: usize, sums: &mut Sums) {
        let Plane { stride, height, .. } = *plane;
        let rows = (height + 1).saturating_sub(window);
        for kept in [&mut self.mean, &mut self.variance] {
            (kept.stride, kept.height) = (stride, rows);
            kept.values.resize(stride * (rows + 1), 0.0);
        }
        let Shares { mean: share, product, squared } = Shares::of(window);
        sums.reset(stride);
        let Sums { columns, squares, row, row_squares } = sums;
        for y in 0..height {
            let new = &plane.from(0, y)[..stride];
            for ((sum, squares), v) in columns.iter_mut().zip(&mut *squares).zip(new) {
                *sum += v;
                *squares += v * v;
            }
            if y + 1 < window {
                continue;
            }
            along(columns, window, row);
            along(squares, window, row_squares);
            let top = y + 1 - window;
            let mean = self.mean.row_mut(top);
            for ((mean, sum), square) in mean.iter_mut().zip(&*row).zip(&mut *row_squares) {
                *mean = sum * share;
                *square = *square * product - *mean * *mean * squared;
            }
            self.variance.row_mut(top).copy_from_slice(row_squares);
            let old = &plane.from(0, top)[..stride];
            for ((sum, squares), v) in columns.iter_mut().zip(&mut *squares).zip(old) {
                *sum -= v;
                *squares -= v * v;
            }
        }
    }
}

/// The Gaussian of a side, 1 in its middle, at `at` pixels from the first one's centre.
fn bell(side: usize, at: f64) -> f64 {
    let middle = (side as f64 - 1.0) / 2.0;
    let sd = 0.3 * (middle - 1.0) + 0.8;
    Real::exp(-0.5 * Real::square((at - middle) / sd))
}

/// What boxes are compared with.
#[derive(Clone, Debug)]
pub(super) struct StructureTemplate {
    width: usize,
    height: usize,
    window: usize,
    exponents: [f64; 3],
    centre: CentreWeight,
    /// The patch as it was seen.
    patch: Plane,
    /// The patch as it is compared, with its moments.
    compared: Plane,
    moments: Moments,
    /// The Gaussian along x and y, for patches that are multiplied by it.
    bells: [Vec<f32>; 2],
    /// Weight of the squares that begin in each column, then row; the weights of all squares sum to one.
    weights: [Vec<f32>; 2],
}

impl StructureTemplate {
    /// A template from the first patch, of at least 2 x 2 pixels.
    pub(super) fn new(
        (width, height): (usize, usize),
        (window, exponents, centre): (usize, [f64; 3], CentreWeight),
        patch: Plane,
    ) -> StructureTemplate {
        let window = window.min(width).min(height);
        let bell_along = |side: usize| (0..side).map(|i| bell(side, i as f64) as f32).collect();
        let weights_along = |side: usize| {
            let middle = |i: usize| i as f64 + (window as f64 - 1.0) / 2.0;
            let weight = |i: usize| if centre == CentreWeight::Map { bell(side, middle(i)) } else { 1.0 };
            let raw: Vec<f64> = (0..=side - window).map(weight).collect();
            let sum: f64 = raw.iter().sum();
            let mut weights: Vec<f32> = raw.iter().map(|w| (w / sum) as f32).collect();
            // Squares that are no squares count nothing, so that rows can be added in whole lanes.
            weights.resize(weights.len().next_multiple_of(LANES), 0.0);
            weights
        };
        let mut template = StructureTemplate {
            width,
            height,
            window,
            exponents,
            centre,
            compared: Plane::default(),
            moments: Moments::default(),
            bells: [bell_along(width), bell_along(height)],
            weights: [weights_along(width), weights_along(height)],
            patch,
        };
        template.prepare();
        template
    }

    /// Columns and rows.
    pub(super) fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Side of the squares of local means.
    pub(super) fn window(&self) -> usize {
        self.window
    }

    /// Whether local moments of the frame serve every box.
    pub(super) fn shares_moments(&self) -> bool {
        self.centre != CentreWeight::Multiplied
    }

    fn prepare(&mut self) {
        let mut compared = self.patch.clone();
        self.shade(&mut compared);
        self.moments.fill(&compared, self.window, &mut Sums::default());
        self.compared = compared;
    }

    /// Multiplies a patch by the Gaussian, where patches are.
    pub(super) fn shade(&self, patch: &mut Plane) {
        if self.centre != CentreWeight::Multiplied {
            return;
        }
        let [across, down] = &self.bells;
        for (y, down) in down.iter().enumerate() {
            for (value, across) in patch.row_mut(y).iter_mut().zip(across) {
                *value *= across * down;
            }
        }
    }

    /// Makes the template (1 - rate) of itself and `rate` of another patch of its size.
    pub(super) fn blend(&mut self, patch: &Plane, rate: f64) {
        let rate = rate as f32;
        for (old, new) in self.patch.values.iter_mut().zip(&patch.values) {
            *old += rate * (new - *old);
        }
        self.prepare();
    }

    /// Mean structural similarity with the box of the template's size whose upper left corner is column `x`
    /// and row `y` of `plane`, which has these moments; from -1 to 1.
    #[inline(always)]
    pub(super) fn similarity(
        &self,
        (plane, moments): (&Plane, &Moments),
        (x, y): (usize, usize),
        sums: &mut Sums,
    ) -> f64 {
        let window = self.window;
        let squares = self.weights[0].len();
        // As many columns as the squares of the last lane read; the template is zero beyond its own.
        let width = (squares + window - 1).min(self.compared.stride);
        sums.reset(self.compared.stride);
        let Sums { columns, row, row_squares: values, .. } = sums;
        let columns = &mut columns[..width];
        let shares = Shares::of(window);
        let is_plain = self.exponents == [1.0; 3];
        let mut total = 0.0;
        for j in 0..self.height {
            let (ours, theirs) = (&self.compared.from(0, j)[..width], &plane.from(x, y + j)[..width]);
            for i in 0..width {
                columns[i] += ours[i] * theirs[i];
            }
            if j + 1 < window {
                continue;
            }
            along(columns, window, row);
            let top = j + 1 - window;
            let row = Row {
                products: &row[..squares],
                shares,
                ours: [&self.moments.mean, &self.moments.variance].map(|p| &p.from(0, top)[..squares]),
                theirs: [&moments.mean, &moments.variance].map(|p| &p.from(x, y + top)[..squares]),
                weights: &self.weights[0],
            };
            let sum = if is_plain { row.similarity(values) } else { row.general(self.exponents) };
            total += sum * f64::from(self.weights[1][top]);
            let (ours, theirs) = (&self.compared.from(0, top)[..width], &plane.from(x, y + top)[..width]);
            for i in 0..width {
                columns[i] -= ours[i] * theirs[i];
            }
        }
        total
    }
}

/// A row of squares: sums of products, and of both patches means and variances.
struct Row<'a> {
    products: &'a [f32],
    shares: Shares,
    ours: [&'a [f32]; 2],
    theirs: [&'a [f32]; 2],
    weights: &'a [f32],
}

impl Row<'_> {
    /// Weighted sum of equation 14.
    #[inline(always)]
    fn similarity(&self, values: &mut [f32]) -> f64 {
        let count = self.weights.len();
        let Shares { product, squared, .. } = self.shares;
        let (products, weights, values) =
            (&self.products[..count], &self.weights[..count], &mut values[..count]);
        let [a, va] = self.ours.map(|p| &p[..count]);
        let [b, vb] = self.theirs.map(|p| &p[..count]);
        for x in 0..count {
            let mean = a[x] * b[x];
            let covariance = products[x] * product - mean * squared;
            let above = (2.0 * mean + C1) * (2.0 * covariance + C2);
            let below = (a[x] * a[x] + b[x] * b[x] + C1) * (va[x] + vb[x] + C2);
            values[x] = above / below * weights[x];
        }
        let mut sum = [0.0_f32; LANES];
        for values in values.as_chunks::<LANES>().0 {
            for k in 0..LANES {
                sum[k] += values[k];
            }
        }
        let [a, b, c, d, e, f, g, h] = sum.map(f64::from);
        ((a + e) + (c + g)) + ((b + f) + (d + h))
    }

    /// Weighted sum of equation 10.
    fn general(&self, [alpha, beta, gamma]: [f64; 3]) -> f64 {
        let power = |base: f64, exponent: f64| match () {
            () if exponent == 1.0 => base,
            () if exponent == 0.0 => 1.0,
            () if base == 0.0 => 0.0,
            () => Real::exp(exponent * Real::ln(base.abs())).copysign(base),
        };
        let mut sum = 0.0;
        for i in 0..self.products.len() {
            let [[a, va], [b, vb]] = [&self.ours, &self.theirs].map(|p| p.map(|p| f64::from(p[i])));
            let Shares { product, squared, .. } = self.shares;
            let deviations = (va * vb).max(0.0).sqrt();
            let covariance = f64::from(self.products[i] * product) - a * b * f64::from(squared);
            let [c1, c2] = [C1, C2].map(f64::from);
            let luminance = (2.0 * a * b + c1) / (a * a + b * b + c1);
            let contrast = (2.0 * deviations + c2) / (va + vb + c2);
            let structure = (covariance + c2 / 2.0) / (deviations + c2 / 2.0);
            let parts = [(luminance, alpha), (contrast, beta), (structure, gamma)];
            let similarity: f64 = parts.map(|(base, exponent)| power(base, exponent)).iter().product();
            sum += similarity * f64::from(self.weights[i]);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::{Ssim, crop};

    fn picture(columns: usize, rows: usize, seed: u32) -> Image<u8> {
        let mut state = seed;
        Image::from_fn(columns, rows, |x, y| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (100 + (x * y + 3 * x) % 60) as u8 + (state >> 27) as u8
        })
    }

    fn plane(image: &Image<u8>) -> Plane {
        let mut plane = Plane::default();
        plane.copy_image(&image.map(|v| f32::from(*v)));
        plane
    }

    /// Sums of grey values are exact in single precision; a covariance of up to 2^14 then has an error of
    /// 2^-10, against C2 = 58: 2e-5 in the worst square.
    #[test]
    fn similarities_are_those_of_the_operator() {
        let scene = picture(50, 41, 1);
        for (size, window, exponents) in [
            ((14, 15), 7, [1.0; 3]),
            ((33, 9), 5, [1.0; 3]),
            ((7, 20), 7, [1.0; 3]),
            ((15, 15), 15, [1.0; 3]),
            ((14, 15), 7, [0.5, 2.0, 0.3]),
            ((14, 15), 7, [0.0, 1.0, 1.0]),
        ] {
            let [l, c, s] = exponents;
            let ssim = Ssim::new(window).unwrap().with_exponents(l, c, s).unwrap();
            let seen = crop(&picture(50, 41, 2), 6, 4, size.0, size.1);
            let choices = (window, exponents, CentreWeight::None);
            let template = StructureTemplate::new(size, choices, plane(&seen));
            let (plane, mut moments, mut sums) = (plane(&scene), Moments::default(), Sums::default());
            moments.fill(&plane, window, &mut sums);
            for at in [(0, 0), (6, 4), (50 - size.0, 41 - size.1), (3, 1)] {
                let ours = template.similarity((&plane, &moments), at, &mut sums);
                let part = crop(&scene, at.0 as isize, at.1 as isize, size.0, size.1);
                let exact = ssim.mean(&seen, &part).unwrap();
                assert!(
                    (ours - exact).abs() < 2e-5,
                    "{size:?} {window} {exponents:?} {at:?}: {ours} {exact}"
                );
            }
        }
    }

    /// A weighted map is what the operator's map gives under the same Gaussian; a patch under a Gaussian is
    /// nearly black at its border, where all are alike.
    #[test]
    fn the_middle_counts_more() {
        let (seen, other) = (picture(21, 17, 3), picture(21, 17, 4));
        let with = |centre| {
            let template = StructureTemplate::new((21, 17), (7, [1.0; 3], centre), plane(&seen));
            let (mut patch, mut moments, mut sums) = (plane(&other), Moments::default(), Sums::default());
            template.shade(&mut patch);
            moments.fill(&patch, 7, &mut sums);
            template.similarity((&patch, &moments), (0, 0), &mut sums)
        };
        let map = Ssim::default().map(&seen, &other).unwrap();
        let (mut sum, mut weights) = (0.0, 0.0);
        for y in 0..map.height() {
            for x in 0..map.width() {
                // Standard deviations of 3.5 and 2.9 pixels for sides of 21 and 17.
                let (u, v) = ((x as f64 - 7.0) / 3.5, (y as f64 - 5.0) / 2.9);
                let weight = (-0.5 * (u * u + v * v)).exp();
                (sum, weights) = (sum + weight * map.row(y)[x], weights + weight);
            }
        }
        assert!((with(CentreWeight::Map) - sum / weights).abs() < 2e-5);
        assert!(with(CentreWeight::Multiplied) > with(CentreWeight::None) + 0.1);
    }

    #[test]
    fn a_blended_template_is_between() {
        let choices = (7, [1.0; 3], CentreWeight::None);
        let [seen, other] = [picture(12, 12, 3), picture(12, 12, 4)].map(|image| plane(&image));
        let mut template = StructureTemplate::new((12, 12), choices, seen.clone());
        template.blend(&other, 0.25);
        let expected = seen.values.iter().zip(&other.values).map(|(a, b)| 0.75 * a + 0.25 * b);
        assert!(template.patch.values.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3));
        template.blend(&other, 1.0);
        let (mut moments, mut sums) = (Moments::default(), Sums::default());
        moments.fill(&other, 7, &mut sums);
        assert!((template.similarity((&other, &moments), (0, 0), &mut sums) - 1.0).abs() < 1e-5);
    }
}
