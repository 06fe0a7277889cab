//! The ground that balls move on: a picture without them, and the part of it where they can be.

use crate::operator::{Neighbours, components};
use crate::{Error, Frame, Image, Result};
use std::ops::Range;
use zerre::math::{Cholesky, Matrix};

/// Where the picture of the empty ground comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum GroundFrom {
    /// Ground of one colour under light that varies smoothly: in each channel a polynomial of second order is fitted
    /// to what has the colour of the middle of the picture, and balls can be in the convex hull of that part. Holds
    /// for a single frame, and for balls that rest.
    Plain,
    /// The median of frames, pixel by pixel: for ground with a pattern, where balls do not rest.
    Median,
    /// A picture that shows it.
    Picture(Frame),
}

/// The ground of a video.
#[derive(Clone, Debug, PartialEq)]
pub struct Ground {
    picture: Frame,
    /// Of every row the columns where balls can be.
    region: Vec<Range<usize>>,
}

/// Half the side of the middle part whose colour is taken for that of the ground, as a share of the picture's.
const MIDDLE: f64 = 0.25;
/// Side of a cell of colours that are counted together, grey levels.
const CELL: usize = 16;
/// Pixels between those that surfaces are fitted to.
const STRIDE: usize = 4;
/// Levels within which a pixel has the ground's colour, from the first fit to the last.
const TOLERANCES: [f64; 4] = [48.0, 36.0, 28.0, 24.0];
/// Least share of the picture that has to be ground.
const LEAST_SHARE: f64 = 0.1;

impl Ground {
    /// The ground seen in `samples`, of one size, spread over the video.
    ///
    /// # Errors
    /// No sample, samples of several sizes, a picture of another size than they have, no plain ground.
    pub fn of(from: &GroundFrom, samples: &[Frame]) -> Result<Ground> {
        let first = samples.first().ok_or_else(|| no_ground("there is no frame to see it in"))?;
        for sample in samples {
            first.expect_size(sample)?;
        }
        match from {
            GroundFrom::Plain => Ground::plain(&median(samples)),
            GroundFrom::Median => Ok(Ground::everywhere(median(samples))),
            GroundFrom::Picture(picture) => {
                first.expect_size(picture)?;
                Ok(Ground::everywhere(picture.clone()))
            }
        }
    }

    /// Balls can be everywhere on `picture`.
    fn everywhere(picture: Frame) -> Ground {
        let region = vec![0..picture.width(); picture.height()];
        Ground { picture, region }
    }

    fn plain(seen: &Frame) -> Result<Ground> {
        let (width, height) = seen.size();
        let colour = colour_of_middle(seen);
        let mut surface = [0, 1, 2].map(|c| Surface([colour[c], 0.0, 0.0, 0.0, 0.0, 0.0]));
        for tolerance in TOLERANCES {
            let mut fit = [Fit::default(); 3];
            for y in (0..height).step_by(STRIDE) {
                for (x, pixel) in seen.row(y).iter().enumerate().step_by(STRIDE) {
                    let terms = terms(x, y, (width, height));
                    if is_near(pixel, &surface, &terms, tolerance) {
                        fit.iter_mut().zip(pixel).for_each(|(fit, level)| fit.add(&terms, f64::from(*level)));
                    }
                }
            }
            for (surface, fit) in surface.iter_mut().zip(&fit) {
                *surface = fit.surface().ok_or_else(|| no_ground("no plain ground is seen"))?;
            }
        }
        let [.., tolerance] = TOLERANCES;
        let picture = Image::from_fn(width, height, |x, y| {
            let terms = terms(x, y, (width, height));
            surface.map(|surface| surface.at(&terms).round().clamp(0.0, 255.0) as u8)
        });
        let mask = Image::from_fn(width, height, |x, y| {
            let pairs = seen.row(y)[x].into_iter().zip(picture.row(y)[x]);
            u8::from(pairs.into_iter().all(|(a, b)| f64::from(a.abs_diff(b)) <= tolerance))
        });
        let found = components(&mask, Neighbours::Four);
        let largest = found.all.iter().enumerate().max_by_key(|(at, part)| (part.area, usize::MAX - at));
        let Some((at, part)) = largest else { return Err(no_ground("no plain ground is seen")) };
        if (part.area as f64) < LEAST_SHARE * (width * height) as f64 {
            return Err(no_ground("too little of the picture has the colour of its middle"));
        }
        let label = at as u32 + 1;
        let ends = |y: usize| {
            let row = found.labels.row(y);
            let first = row.iter().position(|l| *l == label)?;
            let last = row.iter().rposition(|l| *l == label)?;
            Some((first, last + 1))
        };
        let ends: Vec<_> = (0..height).map(ends).collect();
        Ok(Ground { picture, region: hull(&ends, width) })
    }

    /// The empty ground.
    pub fn picture(&self) -> &Frame {
        &self.picture
    }

    /// Columns of row `y` where balls can be.
    pub fn columns(&self, y: usize) -> Range<usize> {
        self.region.get(y).cloned().unwrap_or(0..0)
    }

    /// Whether a ball can have its middle there.
    pub fn holds(&self, [x, y]: [f64; 2]) -> bool {
        let inside = |columns: Range<usize>| x >= columns.start as f64 && x < columns.end as f64;
        y >= 0.0 && y < self.region.len() as f64 && inside(self.columns(y as usize))
    }

    /// Pixels where balls can be.
    pub fn area(&self) -> usize {
        self.region.iter().map(ExactSizeIterator::len).sum()
    }
}

fn no_ground(problem: &str) -> Error {
    let input = "the ground".to_owned();
    let problem = format!("{problem}: give another way to find it, such as a picture without balls");
    Error::Input { input, problem }
}

/// The median of each channel of each pixel; of an even number the lower one of the middle two.
fn median(samples: &[Frame]) -> Frame {
    if let [only] = samples {
        return only.clone();
    }
    let mut levels = vec![0; samples.len()];
    let middle = (samples.len() - 1) / 2;
    let (width, height) = samples[0].size();
    Image::from_fn(width, height, |x, y| {
        [0, 1, 2].map(|c| {
            levels.iter_mut().zip(samples).for_each(|(level, sample)| *level = sample.row(y)[x][c]);
            *levels.select_nth_unstable(middle).1
        })
    })
}

/// The commonest colour of the middle part.
fn colour_of_middle(seen: &Frame) -> [f64; 3] {
    let (width, height) = seen.size();
    let range = |side: usize| {
        let cut = ((0.5 - MIDDLE) * side as f64) as usize;
        cut..side - cut
    };
    let pixels = || range(height).flat_map(|y| seen.row(y)[range(width)].iter());
    let cells = 256 / CELL;
    let mut counts = vec![0_usize; cells * cells * cells];
    let cell = |pixel: &[u8; 3]| pixel.iter().fold(0, |at, level| at * cells + usize::from(*level) / CELL);
    pixels().for_each(|pixel| counts[cell(pixel)] += 1);
    let most = counts.iter().enumerate().max_by_key(|(at, count)| (**count, usize::MAX - at));
    let most = most.map_or(0, |(at, _)| at);
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    for pixel in pixels().filter(|pixel| cell(pixel) == most) {
        sum = [0, 1, 2].map(|c| sum[c] + f64::from(pixel[c]));
        count += 1.0;
    }
    sum.map(|sum| sum / count)
}

const TERMS: usize = 6;

/// Levels of a channel: 1, u, v, u u, u v, v v by coefficients, (u, v) from -1 to 1 over the picture.
#[derive(Clone, Copy, Debug)]
struct Surface([f64; TERMS]);

impl Surface {
    fn at(&self, terms: &[f64; TERMS]) -> f64 {
        self.0.iter().zip(terms).map(|(c, t)| c * t).sum()
    }
}

fn terms(x: usize, y: usize, (width, height): (usize, usize)) -> [f64; TERMS] {
    let scaled = |at: usize, side: usize| 2.0 * (at as f64 + 0.5) / side as f64 - 1.0;
    let (u, v) = (scaled(x, width), scaled(y, height));
    [1.0, u, v, u * u, u * v, v * v]
}

fn is_near(pixel: &[u8; 3], surface: &[Surface; 3], terms: &[f64; TERMS], tolerance: f64) -> bool {
    surface.iter().zip(pixel).all(|(s, level)| (s.at(terms) - f64::from(*level)).abs() <= tolerance)
}

/// Sums of a least-squares fit.
#[derive(Clone, Copy, Debug, Default)]
struct Fit {
    normal: [[f64; TERMS]; TERMS],
    right: [f64; TERMS],
}

impl Fit {
    fn add(&mut self, terms: &[f64; TERMS], level: f64) {
        for (i, t) in terms.iter().enumerate() {
            self.right[i] += t * level;
            self.normal[i].iter_mut().zip(terms).for_each(|(sum, u)| *sum += t * u);
        }
    }

    /// The best surface; nothing where the points do not fix one.
    fn surface(&self) -> Option<Surface> {
        let mut normal = Matrix(self.normal);
        // Curvatures that a narrow strip of ground cannot show are taken for small.
        let ridge = 1e-6 * normal.0[0][0].max(1e-9);
        (1..TERMS).for_each(|i| normal.0[i][i] += ridge);
        let factor = Cholesky::of("normal equations of the ground", &normal).ok()?;
        let solved = factor.solve(&self.right);
        solved.iter().all(|c| c.is_finite()).then_some(Surface(solved))
    }
}

/// Rows of the convex hull of the ends of rows (Andrew's monotone chain, down the left side and down the right).
fn hull(ends: &[Option<(usize, usize)>], width: usize) -> Vec<Range<usize>> {
    let side = |of: fn((usize, usize)) -> usize, sign: f64| -> Vec<(f64, f64)> {
        let mut chain: Vec<(f64, f64)> = Vec::new();
        for (y, ends) in ends.iter().enumerate() {
            let Some(ends) = ends else { continue };
            let point = (y as f64, of(*ends) as f64);
            while let [.., a, b] = chain[..] {
                let turn = (b.0 - a.0) * (point.1 - a.1) - (b.1 - a.1) * (point.0 - a.0);
                if sign * turn > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(point);
        }
        chain
    };
    let (left, right) = (side(|e| e.0, 1.0), side(|e| e.1, -1.0));
    let at = |chain: &[(f64, f64)], y: usize| -> Option<f64> {
        let y = y as f64;
        let after = chain.iter().position(|point| point.0 >= y)?;
        let (to, from) = (chain[after], chain[after.saturating_sub(1)]);
        if y < from.0 {
            return None;
        }
        let share = if to.0 > from.0 { (y - from.0) / (to.0 - from.0) } else { 0.0 };
        Some(from.1 + share * (to.1 - from.1))
    };
    let row = |y: usize| match (at(&left, y), at(&right, y)) {
        (Some(from), Some(to)) => (from.ceil() as usize).min(width)..(to.floor() as usize).min(width),
        _ => 0..0,
    };
    (0..ends.len()).map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shaded(x: usize, y: usize) -> [u8; 3] {
        let (u, v) = (x as f64 / 80.0 - 1.0, y as f64 / 60.0 - 1.0);
        [180.0, 150.0, 120.0].map(|level: f64| (level - 20.0 * u * u - 10.0 * v + 6.0 * u * v).round() as u8)
    }

    /// A surface of second order is found again to the rounding of levels, and balls, bars and a ball at the edge
    /// change neither it nor the region, but for the bars.
    #[test]
    fn plain_ground_is_found_under_balls_and_beside_bars() {
        let frame = Image::from_fn(160, 120, |x, y| {
            let ball = |cx: f64, cy: f64| (x as f64 - cx).powi(2) + (y as f64 - cy).powi(2) < 100.0;
            if !(8..112).contains(&y) {
                [0; 3]
            } else if ball(50.0, 50.0) || ball(80.0, 60.0) || ball(0.0, 70.0) {
                [20, 10, 30]
            } else {
                shaded(x, y)
            }
        });
        let ground = Ground::of(&GroundFrom::Plain, &[frame]).unwrap();
        for y in 8..112 {
            assert_eq!(ground.columns(y), 0..160, "row {y}");
            for x in 0..160 {
                let (found, is) = (ground.picture().at(x as isize, y as isize), shaded(x, y));
                assert!((0..3).all(|c| found[c].abs_diff(is[c]) <= 1), "{x} {y}: {found:?} {is:?}");
            }
        }
        assert!(ground.columns(7).is_empty() && ground.columns(112).is_empty());
        assert!(ground.holds([0.0, 70.0]) && !ground.holds([3.0, 3.0]) && !ground.holds([-1.0, 50.0]));
    }

    #[test]
    fn the_median_forgets_what_moves() {
        let frames: Vec<Frame> = (0..5)
            .map(|k| Image::from_fn(10, 4, |x, y| if x / 2 == k { [250, 0, 0] } else { [y as u8; 3] }))
            .collect();
        let ground = Ground::of(&GroundFrom::Median, &frames).unwrap();
        assert_eq!(ground.picture(), &Image::from_fn(10, 4, |_, y| [y as u8; 3]));
    }

    #[test]
    fn no_ground_is_an_error() {
        assert!(Ground::of(&GroundFrom::Plain, &[]).is_err());
        let two = [Frame::filled(4, 4, [0; 3]), Frame::filled(5, 4, [0; 3])];
        assert!(Ground::of(&GroundFrom::Median, &two).is_err());
        let other = GroundFrom::Picture(Frame::filled(9, 9, [0; 3]));
        assert!(Ground::of(&other, &two[..1]).is_err());
        // A chequered picture has no plain ground.
        let wild = Image::from_fn(64, 64, |x, y| if (x + y) % 2 == 0 { [0; 3] } else { [255; 3] });
        assert!(Ground::of(&GroundFrom::Plain, &[wild]).is_err());
        // One colour alone is ground, however small the picture.
        assert!(Ground::of(&GroundFrom::Plain, &[Frame::filled(1, 1, [9; 3])]).is_ok());
    }
}
