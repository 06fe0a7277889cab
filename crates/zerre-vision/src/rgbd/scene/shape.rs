//! Bodies that a ray meets in closed form, and pictures of them.

use super::space::{Point, across, along, dot, sub, times, unit};
use crate::rgbd::Intrinsics;

/// A body; lengths in mm.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shape {
    /// Its half axes lie along three directions at right angles.
    Ellipsoid { centre: Point, axes: [Point; 3], radii: [f64; 3] },
    /// The hull of two spheres, neither inside the other.
    Cone { ends: [Point; 2], radii: [f64; 2] },
}

/// Where a ray meets a body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// Distance along the camera's axis.
    pub(super) z: f64,
    /// Outwards, of length 1.
    pub(super) normal: Point,
    /// Place on the body: of an ellipsoid along its axes, -1 to 1; of a cone to the right, down (-1 to 1
    /// about) and along (0 to 1).
    pub(super) place: Point,
}

/// A camera: where its rays go, and the part of the picture that is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    pub(super) lens: Intrinsics,
    /// First column, first row, and those behind the last ones.
    pub(super) window: [i64; 4],
}

/// A body as seen by a camera in the origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    shape: Ready,
    window: [i64; 4],
}

/// A body that is prepared to be met by rays of a camera in the origin.
#[derive(Clone, Copy, Debug)]
pub(super) enum Ready {
    /// With directions divided by radii, `centre` in these coordinates and its square less 1.
    Ellipsoid {
        scaled: [Point; 3],
        centre: Point,
        rest: f64,
        axes: [Point; 3],
        radii: [f64; 3],
    },
    Cone {
        ends: [Point; 2],
        radii: [f64; 2],
        axis: Point,
        squares: [f64; 3],
    },
}

impl Shape {
    /// Moved by what is done to points; `turn` does so to directions.
    pub(super) fn moved(self, place: impl Fn(Point) -> Point, turn: impl Fn(Point) -> Point) -> Shape {
        match self {
            Shape::Ellipsoid { centre, axes, radii } => {
                Shape::Ellipsoid { centre: place(centre), axes: axes.map(turn), radii }
            }
            Shape::Cone { ends, radii } => Shape::Cone { ends: ends.map(place), radii },
        }
    }

    /// Two spheres whose hull is about it: centres and radii.
    pub(super) fn hull(self) -> ([Point; 2], [f64; 2]) {
        match self {
            Shape::Ellipsoid { centre, axes, radii } => {
                let long = (0..3).max_by(|a, b| radii[*a].total_cmp(&radii[*b])).unwrap_or(0);
                let width = 0.5 * (radii.iter().sum::<f64>() - radii[long]);
                let out = (radii[long] - width).max(0.0);
                ([-out, out].map(|by| along(centre, axes[long], by)), [width; 2])
            }
            Shape::Cone { ends, radii } => (ends, radii),
        }
    }

    /// As seen in the part of a picture, if any of it is there.
    pub(super) fn seen(self, view: &View) -> Option<Seen> {
        let bounds = match self {
            Shape::Ellipsoid { centre, axes, radii } => {
                let spread = std::array::from_fn(|i| {
                    std::array::from_fn(|j| {
                        (0..3).map(|k| axes[k][i] * axes[k][j] * radii[k] * radii[k]).sum::<f64>()
                    })
                });
                outline(centre, spread, &view.lens)?
            }
            Shape::Cone { ends, radii } => {
                let ball = |end: usize| {
                    let square = radii[end] * radii[end];
                    let spread =
                        std::array::from_fn(|i| std::array::from_fn(|j| if i == j { square } else { 0.0 }));
                    outline(ends[end], spread, &view.lens)
                };
                let (a, b) = (ball(0)?, ball(1)?);
                [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]
            }
        };
        let inside =
            |low: usize, value: f64| value.clamp(view.window[low] as f64, view.window[low + 2] as f64);
        let window = [
            inside(0, bounds[0].floor()) as i64,
            inside(1, bounds[1].floor()) as i64,
            inside(0, bounds[2].ceil()) as i64,
            inside(1, bounds[3].ceil()) as i64,
        ];
        if window[0] >= window[2] || window[1] >= window[3] {
            return None;
        }
        Some(Seen { shape: self.ready(), window })
    }

    /// Prepared to be met by rays of a camera in the origin.
    pub(super) fn ready(self) -> Ready {
        match self {
            Shape::Ellipsoid { centre, axes, radii } => {
                let scaled: [Point; 3] = std::array::from_fn(|k| times(axes[k], 1.0 / radii[k]));
                let own = scaled.map(|axis| dot(axis, centre));
                Ready::Ellipsoid { scaled, centre: own, rest: dot(own, own) - 1.0, axes, radii }
            }
            Shape::Cone { ends, radii } => {
                let axis = sub(ends[1], ends[0]);
                let squares = [dot(axis, axis), dot(ends[0], ends[0]), dot(ends[1], ends[1])];
                Ready::Cone { ends, radii, axis, squares }
            }
        }
    }
}

/// The box in the picture around an ellipsoid with this centre and square of its matrix; none if it is not
/// before the camera.
fn outline(centre: Point, spread: [[f64; 3]; 3], lens: &Intrinsics) -> Option<[f64; 4]> {
    // The dual conic of its outline, c cᵀ - S: Hartley and Zisserman, Multiple View Geometry, 8.7.
    let dual = |i: usize, j: usize| centre[i] * centre[j] - spread[i][j];
    let depth = dual(2, 2);
    if centre[2] <= 0.0 || depth <= 0.0 {
        return None;
    }
    let range = |i: usize| {
        let (middle, half) =
            (dual(i, 2) / depth, (dual(i, 2) * dual(i, 2) - dual(i, i) * depth).max(0.0).sqrt());
        let place = |ray: f64| ray * lens.focal[i] + lens.principal[i] + 0.5;
        (place(middle - half / depth), place(middle + half / depth))
    };
    let ((left, right), (top, bottom)) = (range(0), range(1));
    Some([left, top, right, bottom])
}

impl Seen {
    /// Columns and rows that may show it: first, and behind the last.
    pub(super) fn window(&self) -> [i64; 4] {
        self.window
    }
}

impl Ready {
    /// Where the ray (x, y, 1) first meets it.
    #[inline]
    pub(super) fn hit(&self, ray: Point) -> Option<Hit> {
        match self {
            Ready::Ellipsoid { scaled, centre, rest, axes, radii } => {
                let own = scaled.map(|axis| dot(axis, ray));
                let (a, b) = (dot(own, own), dot(own, *centre));
                let inside = b * b - a * rest;
                if inside < 0.0 {
                    return None;
                }
                let z = (b - inside.sqrt()) / a;
                let place = sub(times(own, z), *centre);
                let mut normal = [0.0; 3];
                for k in 0..3 {
                    normal = along(normal, axes[k], place[k] / radii[k]);
                }
                Some(Hit { z, normal: unit(normal), place })
            }
            Ready::Cone { ends, radii: [ra, rb], axis, squares: [m0, m5, m7] } => {
                // The body of a cone between the spheres, then the spheres (Quilez, "rounded cone -
                // intersection"), for a ray of any length.
                let dd = dot(ray, ray);
                let rr = ra - rb;
                let (m1, m2, m3, m6) =
                    (-dot(*axis, ends[0]), dot(*axis, ray), -dot(ray, ends[0]), -dot(ray, ends[1]));
                let d2 = m0 - rr * rr;
                let k2 = d2 * dd - m2 * m2;
                let k1 = d2 * m3 - m1 * m2 + m2 * rr * ra;
                let k0 = d2 * m5 - m1 * m1 + m1 * rr * ra * 2.0 - m0 * ra * ra;
                let h = k1 * k1 - k0 * k2;
                if h < 0.0 {
                    return None;
                }
                let root = h.sqrt();
                let mut first = f64::INFINITY;
                for z in [(-k1 - root) / k2, (-k1 + root) / k2] {
                    let y = m1 - ra * rr + z * m2;
                    if y > 0.0 && y < d2 && z > 0.0 && z < first {
                        first = z;
                    }
                }
                for (middle, rest) in [(m3, m5 - ra * ra), (m6, m7 - rb * rb)] {
                    let inside = middle * middle - dd * rest;
                    if inside > 0.0 {
                        let z = (-middle - inside.sqrt()) / dd;
                        if z > 0.0 && z < first {
                            first = z;
                        }
                    }
                }
                if first == f64::INFINITY {
                    return None;
                }
                let from = sub(times(ray, first), ends[0]);
                let share = ((dot(from, *axis) - ra * rr) / d2).clamp(0.0, 1.0);
                let normal = unit(along(from, *axis, -share));
                let out = across(from, unit(*axis));
                Some(Hit { z: first, normal, place: [out[0] / ra, out[1] / ra, share] })
            }
        }
    }
}

impl View {
    /// The ray through the middle of a pixel's column or row.
    pub(super) fn ray(&self, axis: usize, pixel: i64) -> f64 {
        (pixel as f64 - self.lens.principal[axis]) / self.lens.focal[axis]
    }

    /// Columns and rows of the part that is drawn.
    pub(super) fn size(&self) -> (usize, usize) {
        let [left, top, right, bottom] = self.window;
        ((right - left).max(0) as usize, (bottom - top).max(0) as usize)
    }

    /// Draws a body before what is at the distances `depth` (mm, row after row of the window): `paint` gets
    /// the number of each pixel where it is the nearest.
    pub(super) fn draw(&self, shape: Shape, depth: &mut [f32], mut paint: impl FnMut(usize, &Hit)) {
        let Some(seen) = shape.seen(self) else { return };
        let [left, top, right, bottom] = seen.window();
        let width = self.size().0;
        for y in top..bottom {
            let down = self.ray(1, y);
            let row = (y - self.window[1]) as usize * width;
            for x in left..right {
                let at = row + (x - self.window[0]) as usize;
                if let Some(hit) = seen.shape.hit([self.ray(0, x), down, 1.0])
                    && let Some(before) = depth.get_mut(at)
                    && hit.z < f64::from(*before)
                {
                    *before = hit.z as f32;
                    paint(at, &hit);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::space::{add, length};
    use super::*;

    const LENS: Intrinsics = Intrinsics { focal: [525.0, 520.0], principal: [319.5, 239.5] };
    const VIEW: View = View { lens: LENS, window: [0, 0, 640, 480] };

    /// Every drawn pixel lies on the surface, by a formula for the distance from it that has no ray in it;
    /// every pixel whose ray passes is left; and nothing of it lies outside its window.
    #[test]
    fn drawn_pixels_lie_on_the_surface() {
        let slant = unit([1.0, 2.0, -0.5]);
        let other = unit(across([0.0, 0.3, 1.0], slant));
        let axes = [slant, other, super::super::space::cross(slant, other)];
        let centre = [120.0, -80.0, 1900.0];
        let radii = [160.0, 60.0, 20.0];
        let ellipsoid = Shape::Ellipsoid { centre, axes, radii };
        let ends = [[-300.0, 50.0, 1700.0], [-120.0, 180.0, 1950.0]];
        let cone = Shape::Cone { ends, radii: [55.0, 30.0] };
        // Towards the camera: rays meet the wide end alone.
        let ahead = Shape::Cone { ends: [[10.0, 0.0, 1500.0], [12.0, 3.0, 1800.0]], radii: [20.0, 60.0] };
        let off = |shape: Shape, point: Point| match shape {
            Shape::Ellipsoid { centre, axes, radii } => {
                let own: Point = std::array::from_fn(|k| dot(axes[k], sub(point, centre)) / radii[k]);
                length(own) - 1.0
            }
            Shape::Cone { ends: [a, b], radii: [ra, rb] } => {
                // The largest gap into any sphere between the ends, by trying many.
                let inside = |i: i32| {
                    let share = f64::from(i) / 4000.0;
                    let middle = super::super::space::between(a, b, share);
                    length(sub(point, middle)) - (ra + share * (rb - ra))
                };
                (0..=4000).map(inside).fold(f64::INFINITY, f64::min) / ra
            }
        };
        for shape in [ellipsoid, cone, ahead] {
            let mut depth = vec![f32::INFINITY; 640 * 480];
            let mut drawn = 0;
            VIEW.draw(shape, &mut depth, |at, hit| {
                drawn += 1;
                let ray = [VIEW.ray(0, at as i64 % 640), VIEW.ray(1, at as i64 / 640), 1.0];
                let gap = off(shape, times(ray, hit.z));
                // Between tried spheres at most 0.08 mm apart the gap is off by less than 0.08² / (2 · 30)
                // mm.
                assert!(gap.abs() < 1e-5, "off by {gap}");
                assert!((length(hit.normal) - 1.0).abs() < 1e-9 && dot(hit.normal, ray) < 1e-6);
                assert!((off(shape, add(times(ray, hit.z), times(hit.normal, 1.0)))) > 0.0);
            });
            let all = View { window: [-2000, -2000, 3000, 3000], ..VIEW };
            let seen = shape.seen(&all).unwrap();
            let [left, top, right, bottom] = seen.window();
            let hits = (0..640 * 480_i64).filter(|at| {
                let (x, y) = (at % 640, at / 640);
                let met = seen.shape.hit([VIEW.ray(0, x), VIEW.ray(1, y), 1.0]).is_some();
                assert!(!met || ((left..right).contains(&x) && (top..bottom).contains(&y)));
                met
            });
            assert_eq!(drawn, hits.count());
            assert!(drawn > 500, "{drawn}");
        }
    }
}
