//! Pinhole cameras, and the depth picture seen from the place of the colour camera.

use super::{Depth, NO_DEPTH};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// A pinhole camera, pixels. The principal point is counted as camera files have it: the middle of the upper left pixel
/// is (0, 0), while the places of this crate have its corner there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    /// Focal lengths, to the right and down.
    pub focal: [f64; 2],
    /// Principal point.
    pub principal: [f64; 2],
}

impl Intrinsics {
    /// Where a point of the camera's frame (x right, y down, z forward) is seen; its z must be positive.
    pub fn project(&self, [x, y, z]: [f64; 3]) -> [f64; 2] {
        [self.focal[0] * x / z + self.principal[0] + 0.5, self.focal[1] * y / z + self.principal[1] + 0.5]
    }

    /// The point at distance `z` along the axis that is seen at a place.
    pub fn point(&self, [u, v]: [f64; 2], z: f64) -> [f64; 3] {
        [
            (u - 0.5 - self.principal[0]) / self.focal[0] * z,
            (v - 0.5 - self.principal[1]) / self.focal[1] * z,
            z,
        ]
    }
}

/// A pair of cameras, one for colours and one for depth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// The colour camera.
    pub colour: Intrinsics,
    /// The depth camera.
    pub depth: Intrinsics,
    /// A point of the depth camera's frame is `rotation` · point + `translation` in the colour camera's.
    pub rotation: [[f64; 3]; 3],
    /// Metres.
    pub translation: [f64; 3],
    /// Metres that one unit of the depth picture stands for.
    pub depth_scale: f64,
    /// What the depth picture holds where nothing was measured.
    pub invalid: u16,
}

impl Camera {
    /// # Errors
    /// A number that is not finite, a focal length or a scale that is not positive, a rotation that is none.
    pub fn checked(&self) -> Result<()> {
        let refuse = |what, value: f64, needs| Err(Error::OutOfRange { what, value, needs });
        for lens in [self.colour, self.depth] {
            for value in lens.focal {
                if !(value > 0.0 && value.is_finite()) {
                    return refuse("a focal length", value, "it must be positive");
                }
            }
        }
        let rest = [self.colour.principal, self.depth.principal].concat();
        if let Some(value) = rest.iter().chain(&self.translation).find(|v| !v.is_finite()) {
            return refuse("the principal point or the translation", *value, "it must be a finite number");
        }
        if !(self.depth_scale > 0.0 && self.depth_scale.is_finite()) {
            return refuse("depth_scale", self.depth_scale, "it must be positive, metres per unit");
        }
        for (i, a) in self.rotation.iter().enumerate() {
            for (j, b) in self.rotation.iter().enumerate() {
                let product: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                let wanted = if i == j { 1.0 } else { 0.0 };
                if product.is_nan() || (product - wanted).abs() >= 1e-3 {
                    return refuse("rotation", product, "its rows must be of length 1 and at right angles");
                }
            }
        }
        Ok(())
    }
}

/// A depth picture seen from the place of the colour camera.
#[derive(Clone, Debug)]
pub struct Registration {
    camera: Camera,
    /// Sizes of the depth picture and of the colour picture.
    sizes: [(usize, usize); 2],
    /// Of each column and each row of the depth picture, x and y at distance 1.
    rays: [Vec<f32>; 2],
}

impl Registration {
    /// For depth and colour pictures of these sizes.
    ///
    /// # Errors
    /// A camera that is none.
    pub fn new(camera: Camera, depth: (usize, usize), colour: (usize, usize)) -> Result<Registration> {
        camera.checked()?;
        let along = |count: usize, axis: usize| {
            let lens = camera.depth;
            (0..count).map(|i| ((i as f64 - lens.principal[axis]) / lens.focal[axis]) as f32).collect()
        };
        Ok(Registration { camera, sizes: [depth, colour], rays: [along(depth.0, 0), along(depth.1, 1)] })
    }

    /// Every measured point in the pixel of the colour picture that shows it, millimetres along the colour camera's axis;
    /// where several meet, the nearest is seen. A pixel between two that are close to each other in depth is filled from
    /// them, as rays of one picture leave gaps in the other; what the colour camera sees and the depth camera does not
    /// stays [`NO_DEPTH`].
    ///
    /// # Errors
    /// A picture of another size.
    pub fn register(&self, raw: &Depth) -> Result<Depth> {
        if raw.size() != self.sizes[0] {
            return Err(Error::Size { found: raw.size(), expected: self.sizes[0] });
        }
        let (width, height) = self.sizes[1];
        let mut seen = Depth::filled(width, height, NO_DEPTH);
        let Camera { colour, rotation, translation, depth_scale, invalid, .. } = self.camera;
        let narrow = |row: [f64; 3]| row.map(|v| v as f32);
        let [right, down, ahead] = rotation.map(narrow);
        let shift = translation.map(|v| (1000.0 * v) as f32);
        let scale = (1000.0 * depth_scale) as f32;
        let [fx, fy] = colour.focal.map(|v| v as f32);
        let [cx, cy] = colour.principal.map(|v| v as f32);
        let (right_end, lower_end) = (width as f32 - 0.5, height as f32 - 0.5);
        let pixels = seen.pixels_mut();
        let columns = self.rays[0].len();
        let (mut places, mut depths) = (vec![0_u32; columns], vec![0_u32; columns]);
        for (j, &ray_y) in self.rays[1].iter().enumerate() {
            // Without a branch, several points at once.
            let row = raw.row(j).iter().zip(&self.rays[0]);
            for ((&units, &ray_x), (place, depth)) in row.zip(places.iter_mut().zip(&mut depths)) {
                let z = f32::from(units) * scale;
                let turned = |row: [f32; 3], shift| z * (row[0] * ray_x + row[1] * ray_y + row[2]) + shift;
                let far = turned(ahead, shift[2]);
                let (x, y) =
                    (fx * turned(right, shift[0]) / far + cx, fy * turned(down, shift[1]) / far + cy);
                let shown = (units != invalid) & (1.0..65_535.0).contains(&far);
                let shown = shown & (x > -0.5) & (y > -0.5) & (x < right_end) & (y < lower_end);
                *place = nearest(y).wrapping_mul(width as u32).wrapping_add(nearest(x));
                *depth = if shown { nearest(far) } else { 0 };
            }
            for (&place, &depth) in places.iter().zip(&depths) {
                if depth != 0 {
                    let there = &mut pixels[place as usize];
                    // NO_DEPTH less 1 is the largest number.
                    *there = (there.wrapping_sub(1)).min((depth as u16).wrapping_sub(1)).wrapping_add(1);
                }
            }
        }
        fill_gaps(&mut seen);
        Ok(seen)
    }
}

/// The nearest whole number to one between -1/2 and 2^22; anything for others. Beside 3 · 2^22, no binary digit is left
/// behind the point: unlike a conversion this can be done to many numbers at once on any processor.
fn nearest(v: f32) -> u32 {
    const WHOLE: f32 = 12_582_912.0;
    (v + WHOLE).to_bits().wrapping_sub(WHOLE.to_bits())
}

/// Fills the pixels between two of nearly one depth, left and right or above and below.
fn fill_gaps(depth: &mut Depth) {
    let (width, height) = depth.size();
    let between = |a: u16, b: u16| {
        let near = a != NO_DEPTH && b != NO_DEPTH && u32::from(a.abs_diff(b)) * 50 < u32::from(a.min(b));
        if near { ((u32::from(a) + u32::from(b)) / 2) as u16 } else { NO_DEPTH }
    };
    for y in 0..height {
        let row = depth.row_mut(y);
        for x in 1..width.saturating_sub(1) {
            if row[x] == NO_DEPTH {
                row[x] = between(row[x - 1], row[x + 1]);
            }
        }
    }
    let pixels = depth.pixels_mut();
    for y in 1..height.saturating_sub(1) {
        let (above, rest) = pixels[(y - 1) * width..].split_at_mut(width);
        let (row, below) = rest.split_at_mut(width);
        for ((pixel, &above), &below) in row.iter_mut().zip(&*above).zip(&*below) {
            *pixel = if *pixel == NO_DEPTH { between(above, below) } else { *pixel };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENS: Intrinsics = Intrinsics { focal: [500.0, 510.0], principal: [31.5, 23.5] };

    fn camera() -> Camera {
        let rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let translation = [0.0; 3];
        Camera { colour: LENS, depth: LENS, rotation, translation, depth_scale: 0.001, invalid: 0 }
    }

    #[test]
    fn projecting_and_lifting_are_inverse() {
        let point = [0.3, -0.2, 1.7];
        let back = LENS.point(LENS.project(point), 1.7);
        assert!(back.iter().zip(point).all(|(a, b)| (a - b).abs() < 1e-12), "{back:?}");
        assert_eq!(LENS.project([0.0, 0.0, 2.0]), [32.0, 24.0]);
    }

    /// One camera in the place of the other changes nothing.
    #[test]
    fn cameras_in_one_place_see_the_same() {
        let raw = Depth::from_fn(64, 48, |x, y| if (x + y) % 7 == 0 { 0 } else { (900 + 10 * x + y) as u16 });
        let registration = Registration::new(camera(), (64, 48), (64, 48)).unwrap();
        let seen = registration.register(&raw).unwrap();
        for (a, b) in seen.pixels().iter().zip(raw.pixels()) {
            // What was empty may be filled from its neighbours.
            assert!(a == b || *b == NO_DEPTH);
        }
    }

    /// A wall at 1 m seen from 2 cm further right moves left by focal · 0.02 / 1 = 10 pixels, and a nearer thing before it
    /// hides it.
    #[test]
    fn things_move_by_their_parallax_and_the_nearest_is_seen() {
        let mut camera = camera();
        camera.translation = [-0.02, 0.0, 0.0];
        let raw =
            Depth::from_fn(64, 48, |x, y| if x == 40 && y == 20 { 500 } else { 1000 * (x >= 20) as u16 });
        let seen = Registration::new(camera, (64, 48), (64, 48)).unwrap().register(&raw).unwrap();
        assert_eq!(seen.at(20, 20), 500, "20 pixels at half the distance");
        assert_eq!((seen.at(9, 5), seen.at(10, 5), seen.at(53, 5), seen.at(54, 5)), (0, 1000, 1000, 0));
        // Where the near thing was taken from, nothing was measured behind it: filled from both sides.
        assert_eq!(seen.at(30, 20), 1000);
    }

    #[test]
    fn numbers_are_rounded_to_the_nearest() {
        for v in [-0.49, -0.3, 0.0, 0.2, 0.6, 1.4, 639.49, 65_534.9, 4_000_000.3_f32] {
            assert_eq!(nearest(v), v.round() as u32, "{v}");
        }
    }

    #[test]
    fn scales_and_invalid_values_are_those_of_the_camera() {
        let mut camera = camera();
        (camera.depth_scale, camera.invalid) = (0.0002, u16::MAX);
        let raw = Depth::from_fn(64, 48, |x, _| if x < 32 { u16::MAX } else { 10_000 });
        let seen = Registration::new(camera, (64, 48), (64, 48)).unwrap().register(&raw).unwrap();
        assert_eq!((seen.at(10, 10), seen.at(40, 10)), (NO_DEPTH, 2000));
        assert!(
            Registration::new(camera, (64, 48), (64, 48)).unwrap().register(&Depth::filled(3, 3, 0)).is_err()
        );
        camera.rotation[0][1] = 0.5;
        assert!(camera.checked().is_err());
        camera.depth_scale = f64::NAN;
        assert!(camera.checked().is_err());
    }
}
