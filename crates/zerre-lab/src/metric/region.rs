//! What shapes cover in the plane: how far two regions overlap, and how far their outlines lie apart.

use zerre::extended::Shape;
use zerre::math::{Cholesky, sin_cos};

/// A region of the plane: a union of parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Region {
    parts: Vec<Part>,
}

/// A piece of a [`Region`].
#[derive(Clone, Debug, PartialEq)]
enum Part {
    /// The points `at + root u`, |u| <= 1, with a lower triangular root [a, b, c] = [[a, 0], [b, c]].
    Ellipse { at: [f64; 2], root: [f64; 3] },
    /// What lies within an odd number of turns of a closed line.
    Polygon(Vec<[f64; 2]>),
}

/// Lines along which regions are cut.
const ROWS: u32 = 2048;
/// Places on the outline of an ellipse.
const PLACES: u32 = 360;

impl Region {
    /// The ellipses of `shape` out to `sds` standard deviations, its centre at `at` (m).
    pub fn of_shape(shape: &Shape, at: [f64; 2], sds: f64) -> Region {
        // Extents of shapes are positive definite.
        let part = |e: &zerre::extended::Ellipse| {
            let [[a, _], [b, c]] = Cholesky::of("extent", &e.extent).ok()?.factor().0;
            let at = [at[0] + e.offset[0], at[1] + e.offset[1]];
            Some(Part::Ellipse { at, root: [sds * a, sds * b, sds * c] })
        };
        Region { parts: shape.ellipses().iter().filter_map(part).collect() }
    }

    /// What a closed line through `corners` (m) encloses.
    pub fn polygon(corners: Vec<[f64; 2]>) -> Region {
        Region { parts: vec![Part::Polygon(corners)] }
    }

    /// The lower left and the upper right corner of the box around it, m; `None` of a region without parts.
    pub fn corners(&self) -> Option<[[f64; 2]; 2]> {
        let end = |k: usize| {
            let all = self.parts.iter().map(|part| part.range(k));
            all.reduce(|(a, b), (low, high)| (a.min(low), b.max(high)))
        };
        let ((left, right), (low, high)) = (end(0)?, end(1)?);
        Some([[left, low], [right, high]])
    }

    /// The closed line around each part, m, ends repeated: what a picture shows.
    pub fn lines(&self) -> Vec<Vec<[f64; 2]>> {
        self.parts.iter().map(Part::line).collect()
    }

    /// Share of what either region covers that both cover, 0 where neither covers anything.
    ///
    /// Both are cut along 2048 lines, in the middle of as many rows of height s; along a line lengths are exact. The
    /// length that is covered varies, over all rows, by no more than V = 2 (sum of the widths of all ellipses) + (sum
    /// of the horizontal lengths of the sides of polygons): a row's middle misses the row's mean by at most half of
    /// its variation, so that each area is wrong by at most s V / 2, and the share by at most s V / (area of the
    /// union).
    pub fn intersection_over_union(&self, other: &Region) -> f64 {
        let ends = |k: usize| {
            let all = self.parts.iter().chain(&other.parts).map(move |part| part.range(k));
            all.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), (low, high)| (a.min(low), b.max(high)))
        };
        let (low, high) = ends(1);
        let row = (high - low) / f64::from(ROWS);
        if row.is_nan() || row <= 0.0 || row.is_infinite() {
            return 0.0;
        }
        let (mut both, mut either) = (0.0, 0.0);
        let (mut ours, mut theirs) = (Vec::new(), Vec::new());
        for k in 0..ROWS {
            let y = low + (f64::from(k) + 0.5) * row;
            self.cut(y, &mut ours);
            other.cut(y, &mut theirs);
            let (a, b) = (length(&ours), length(&theirs));
            ours.append(&mut theirs);
            merge(&mut ours);
            let union = length(&ours);
            either += union;
            both += a + b - union;
        }
        if either > 0.0 { (both / either).clamp(0.0, 1.0) } else { 0.0 }
    }

    /// The intervals of the line at height `y` that the region covers, apart from each other and in order.
    fn cut(&self, y: f64, into: &mut Vec<[f64; 2]>) {
        into.clear();
        self.parts.iter().for_each(|part| part.cut(y, into));
        merge(into);
    }

    /// Hausdorff distance of the outlines, m: how far a point on one can be from all of the other.
    ///
    /// The outline is what of the lines around the parts no other part covers, at places at most d = 2 pi r / 360
    /// apart around an ellipse of largest radius r, and no further around polygons. Both outlines lie within d / 2 of
    /// their places, but for pieces shorter than d between two parts, and so the distance is right to within d.
    /// Infinite against a region without outline.
    pub fn hausdorff(&self, other: &Region) -> f64 {
        let (a, b) = (self.outline(), other.outline());
        let far = |from: &[[f64; 2]], to: &[[f64; 2]]| {
            let nearest = |p: &[f64; 2]| {
                let squared = |q: &[f64; 2]| (p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2);
                to.iter().map(squared).fold(f64::INFINITY, f64::min)
            };
            from.iter().map(nearest).fold(0.0, f64::max)
        };
        far(&a, &b).max(far(&b, &a)).sqrt()
    }

    /// Places on the outline.
    fn outline(&self) -> Vec<[f64; 2]> {
        let mut places = Vec::new();
        for (at, part) in self.parts.iter().enumerate() {
            let line = part.places();
            let others = || self.parts.iter().enumerate().filter(|(k, _)| *k != at).map(|(_, part)| part);
            places.extend(line.into_iter().filter(|p| !others().any(|part| part.holds(*p))));
        }
        places
    }
}

impl Part {
    /// Smallest and largest coordinate `k`.
    fn range(&self, k: usize) -> (f64, f64) {
        match self {
            Part::Ellipse { at, root: [a, b, c] } => {
                let reach = if k == 0 { *a } else { b.hypot(*c) };
                (at[k] - reach, at[k] + reach)
            }
            Part::Polygon(corners) => corners
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p[k]), high.max(p[k]))),
        }
    }

    /// Adds the intervals of the line at height `y`.
    fn cut(&self, y: f64, into: &mut Vec<[f64; 2]>) {
        match self {
            Part::Ellipse { at, root: [a, b, c] } => {
                // Of the unit circle the line cuts b u + c v = h: a chord about h (b, c) / (b^2 + c^2).
                let (squared, h) = (b * b + c * c, y - at[1]);
                let rest = squared - h * h;
                if rest > 0.0 {
                    let (middle, half) = (at[0] + a * b * h / squared, a * c.abs() * rest.sqrt() / squared);
                    into.push([middle - half, middle + half]);
                }
            }
            Part::Polygon(_) => {
                let mut at: Vec<f64> = self.crossings(y).collect();
                at.sort_unstable_by(f64::total_cmp);
                into.extend(at.chunks_exact(2).map(|pair| [pair[0], pair[1]]));
            }
        }
    }

    /// Where the sides of a polygon cross the line at height `y`.
    fn crossings(&self, y: f64) -> impl Iterator<Item = f64> {
        let corners: &[[f64; 2]] = if let Part::Polygon(corners) = self { corners } else { &[] };
        let crossing = sides(corners).filter(move |(p, q)| (p[1] <= y) != (q[1] <= y));
        crossing.map(move |(p, q)| p[0] + (y - p[1]) / (q[1] - p[1]) * (q[0] - p[0]))
    }

    /// Whether a point lies inside.
    fn holds(&self, p: [f64; 2]) -> bool {
        match self {
            Part::Ellipse { at, root: [a, b, c] } => {
                let u = (p[0] - at[0]) / a;
                let v = (p[1] - at[1] - b * u) / c;
                // Of parts that coincide none hides the other.
                u * u + v * v < 1.0 - 1e-9
            }
            Part::Polygon(_) => self.crossings(p[1]).filter(|x| *x < p[0]).count() % 2 == 1,
        }
    }

    /// The line around, its first point repeated at the end.
    fn line(&self) -> Vec<[f64; 2]> {
        match self {
            Part::Ellipse { .. } => self.around(48),
            Part::Polygon(corners) => corners.iter().chain(corners.first()).copied().collect(),
        }
    }

    /// Places around an ellipse, the first repeated at the end.
    fn around(&self, count: u32) -> Vec<[f64; 2]> {
        let Part::Ellipse { at, root: [a, b, c] } = self else { return Vec::new() };
        let place = |k: u32| {
            let (s, cos) = sin_cos(std::f64::consts::TAU * f64::from(k % count) / f64::from(count));
            [at[0] + a * cos, at[1] + b * cos + c * s]
        };
        (0..=count).map(place).collect()
    }

    /// Places close together on the line around.
    fn places(&self) -> Vec<[f64; 2]> {
        let Part::Polygon(corners) = self else { return self.around(PLACES) };
        let round: f64 = sides(corners).map(|(p, q)| (q[0] - p[0]).hypot(q[1] - p[1])).sum();
        let mut places = Vec::new();
        for (p, q) in sides(corners) {
            let side = (q[0] - p[0]).hypot(q[1] - p[1]);
            let pieces = (side / round * f64::from(PLACES)).ceil().max(1.0);
            // Round may be zero: a single point.
            let pieces = if pieces.is_finite() { pieces as u32 } else { 1 };
            places.extend((0..pieces).map(|k| {
                let share = f64::from(k) / f64::from(pieces);
                [p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])]
            }));
        }
        places
    }
}

/// The sides of a closed line.
fn sides(corners: &[[f64; 2]]) -> impl Iterator<Item = ([f64; 2], [f64; 2])> {
    corners.iter().zip(corners.iter().cycle().skip(1)).map(|(p, q)| (*p, *q))
}

/// Joins intervals that overlap.
fn merge(intervals: &mut Vec<[f64; 2]>) {
    intervals.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    intervals.dedup_by(|next, last| {
        let joined = next[0] <= last[1];
        if joined {
            last[1] = last[1].max(next[1]);
        }
        joined
    });
}

fn length(intervals: &[[f64; 2]]) -> f64 {
    intervals.iter().map(|[low, high]| high - low).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::test_noise::Noise;
    use std::f64::consts::PI;
    use zerre::extended::Ellipse;
    use zerre::math::Matrix;

    /// Circles of these places and radii.
    fn circles(all: &[([f64; 2], f64)]) -> Region {
        let ellipse = |(offset, r): &([f64; 2], f64)| Ellipse {
            weight: 1.0,
            offset: *offset,
            extent: Matrix::identity() * (r * r),
        };
        let shape = Shape::new(all.iter().map(ellipse).collect()).unwrap();
        Region::of_shape(&shape, [0.0; 2], 1.0)
    }

    /// s V / area with widths and heights as the documentation says.
    fn bound(height: f64, variation: f64, union: f64) -> f64 {
        height / f64::from(ROWS) * variation / union
    }

    /// Two unit circles a distance d apart share 2 acos(d / 2) - d / 2 sqrt(4 - d^2).
    #[test]
    fn overlapping_circles_share_a_lens() {
        for d in [0.1_f64, 0.7, 1.3, 1.9] {
            let lens = 2.0 * (0.5 * d).acos() - 0.5 * d * (4.0 - d * d).sqrt();
            let expected = lens / (2.0 * PI - lens);
            for away in [[d, 0.0], [0.0, d], [0.6 * d, -0.8 * d]] {
                let (a, b) = (circles(&[([0.0; 2], 1.0)]), circles(&[(away, 1.0)]));
                let found = a.intersection_over_union(&b);
                let bound = bound(2.0 + away[1].abs(), 8.0, 2.0 * PI - lens);
                assert!((found - expected).abs() < bound, "{d}: {found} {expected} {bound}");
                assert!((found - b.intersection_over_union(&a)).abs() < 1e-12);
            }
        }
        let (a, far) = (circles(&[([0.0; 2], 1.0)]), circles(&[([3.0, 0.0], 1.0)]));
        assert_eq!((a.intersection_over_union(&a), a.intersection_over_union(&far)), (1.0, 0.0));
        assert_eq!(Region::default().intersection_over_union(&Region::default()), 0.0);
        let both = circles(&[([0.0; 2], 1.0), ([3.0, 1.0], 2.0)]);
        assert_eq!((both.corners(), Region::default().corners()), (Some([[-1.0, -1.0], [5.0, 3.0]]), None));
    }

    /// An ellipse at a slant in another that is twice as large covers a quarter of it, wherever both are, and the part
    /// of a union that lies inside another part of it does not count twice.
    #[test]
    fn ellipses_at_a_slant_and_unions() {
        let extent = Matrix([[8.0, 4.5], [4.5, 5.0]]);
        let shape = Shape::ellipse(extent).unwrap();
        let at = [12.0, -7.0];
        let (small, large) = (Region::of_shape(&shape, at, 1.0), Region::of_shape(&shape, at, 2.0));
        let height = 4.0 * 5f64.sqrt();
        let area = 4.0 * PI * (40.0 - 4.5 * 4.5_f64).sqrt();
        let bound = bound(height, 2.0 * 6.0 * 8f64.sqrt(), area);
        let found = small.intersection_over_union(&large);
        assert!((found - 0.25).abs() < bound, "{found} {bound}");
        let both = Region { parts: [small.parts.clone(), large.parts.clone()].concat() };
        assert!((both.intersection_over_union(&large) - 1.0).abs() < 1e-12);
    }

    /// The twin: the share of random points in either that lie in both, with its standard error.
    #[test]
    fn the_share_is_that_of_random_points() {
        let a = circles(&[([0.0, 0.0], 2.0), ([2.5, 1.0], 1.0)]);
        let mut b = circles(&[([0.5, -0.5], 1.5)]);
        b.parts.push(Part::Polygon(vec![[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [2.0, 1.0], [0.0, 3.0]]));
        let mut noise = Noise(5);
        let (mut both, mut either) = (0.0, 0.0);
        for _ in 0..200_000 {
            let p = [12.0 * noise.uniform() - 6.0, 12.0 * noise.uniform() - 6.0];
            let [x, y] = [&a, &b].map(|region| region.parts.iter().any(|part| part.holds(p)));
            both += f64::from(u8::from(x && y));
            either += f64::from(u8::from(x || y));
        }
        let share: f64 = both / either;
        let error = (share * (1.0 - share) / either).sqrt();
        let found = a.intersection_over_union(&b);
        assert!((found - share).abs() < 4.5 * error, "{found} {share} {error}");
    }

    /// Squares that are shifted along one side by a third overlap by a half.
    #[test]
    fn polygons_are_cut_exactly() {
        let square = |x: f64| Region::polygon(vec![[x, 0.0], [x + 3.0, 0.0], [x + 3.0, 3.0], [x, 3.0]]);
        assert!((square(0.0).intersection_over_union(&square(1.0)) - 0.5).abs() < 1e-12);
        // The sides meet at corners, which are places: the distance is the shift.
        assert!((square(0.0).hausdorff(&square(1.0)) - 1.0).abs() < 0.1);
    }

    /// Circles about one place lie as far apart as their radii, circles of the same size as far as their places; what
    /// another part hides is no outline.
    #[test]
    fn outlines_lie_apart_by_hand() {
        let step = 2.0 * PI * 3.0 / 360.0;
        let near =
            |found: f64, expected: f64| assert!((found - expected).abs() <= step, "{found} {expected}");
        let (one, three) = (circles(&[([0.0; 2], 1.0)]), circles(&[([0.0; 2], 3.0)]));
        near(one.hausdorff(&three), 2.0);
        near(three.hausdorff(&circles(&[([0.7, 0.0], 3.0)])), 0.7);
        let hidden = circles(&[([0.0; 2], 3.0), ([0.5, 0.5], 1.0)]);
        assert_eq!(hidden.hausdorff(&three), 0.0);
        assert_eq!(one.hausdorff(&Region::default()), f64::INFINITY);
        // Not symmetric by itself: the far side of the union decides.
        near(one.hausdorff(&circles(&[([0.0; 2], 1.0), ([5.0, 0.0], 1.0)])), 5.0);
    }
}
