//! The room: walls, a floor, furniture and what hangs on the wall. It stands still: it is drawn once.

use super::appearance::{Appearance, Picker, colour};
use super::settings::SceneSettings;
use super::shape::View;
use super::space::{Point, add, dot, times, unit};
use crate::texture::Texture;
use zerre::math::Real;

/// A box with sides along the axes.
#[derive(Clone, Debug)]
struct Block {
    low: Point,
    high: Point,
    colour: [f64; 3],
}

/// A rectangle on the wall behind the person.
#[derive(Clone, Debug)]
struct Patch {
    /// Left, top, right, bottom; or a disc within it.
    bounds: [f64; 4],
    round: bool,
    colour: [f64; 3],
}

#[derive(Clone, Debug)]
pub(super) struct Room {
    wall: f64,
    /// How much farther the wall is a millimetre further right.
    slope: f64,
    wall_normal: Point,
    floor: f64,
    sides: [f64; 2],
    colours: [[f64; 3]; 2],
    texture: Texture,
    texture_share: f64,
    blocks: Vec<Block>,
    patches: Vec<Patch>,
    light: Point,
    ambient: f64,
}

/// A picture without anybody: distances in mm and colours from 0 to 255, row after row.
#[derive(Clone, Debug)]
pub(super) struct Empty {
    pub(super) depth: Vec<f32>,
    pub(super) colour: Vec<[f32; 3]>,
}

impl Room {
    pub(super) fn new(settings: &SceneSettings, looks: &Appearance, mut picker: Picker) -> Room {
        let (s, c) = Real::sin_cos(looks.wall_turn);
        let mut texture = Texture::new(picker.draws(), &[(300.0, 70.0), (90.0, 60.0), (25.0, 40.0)]);
        texture.base = [0.0; 3];
        let sides = [picker.value(-2100.0, -1500.0), picker.value(1500.0, 2100.0)];
        let mut blocks = Vec::new();
        let block = |picker: &mut Picker, middle: f64, [wide, high, deep]: [f64; 3], bottom: f64| {
            let back = looks.wall - 60.0;
            let paint = colour(picker.value(0.04, 0.7), picker.value(0.1, 0.5), picker.value(0.35, 0.85));
            Block {
                low: [middle - 0.5 * wide, bottom - high, back - deep],
                high: [middle + 0.5 * wide, bottom, back],
                colour: paint,
            }
        };
        // A cupboard on one side, a table on the other.
        let side = if picker.draws().uniform() < 0.5 { -1.0 } else { 1.0 };
        let (at, tall) = (picker.value(750.0, 1100.0), picker.value(900.0, 1500.0));
        let sizes = [picker.value(450.0, 700.0), tall, picker.value(300.0, 420.0)];
        blocks.push(block(&mut picker, side * at, sizes, looks.floor));
        let (at, deep) = (picker.value(750.0, 1100.0), picker.value(400.0, 550.0));
        let sizes = [picker.value(600.0, 900.0), 40.0, deep];
        blocks.push(block(&mut picker, -side * at, sizes, looks.floor - 700.0));
        // Shelves with things on them.
        for _ in 0..(14.0 * settings.clutter).round() as usize {
            let middle = picker.value(-1300.0, 1300.0);
            let sizes = [picker.value(80.0, 350.0), picker.value(60.0, 300.0), picker.value(60.0, 320.0)];
            let bottom = picker.value(-900.0, 700.0);
            blocks.push(block(&mut picker, middle, sizes, bottom));
        }
        let mut patches = Vec::new();
        let mut patch = |picker: &mut Picker, sides: [f64; 2], colour: [f64; 3]| {
            let (x, y) = (picker.value(-1400.0, 1400.0), picker.value(-1150.0, 700.0));
            let (wide, high) = (picker.value(sides[0], sides[1]), picker.value(sides[0], sides[1]));
            let bounds = [x - 0.5 * wide, y - 0.5 * high, x + 0.5 * wide, y + 0.5 * high];
            patches.push(Patch { bounds, round: picker.draws().uniform() < 0.4, colour });
        };
        for _ in 0..(40.0 * settings.clutter).round() as usize {
            let paint = colour(picker.value(0.0, 1.0), picker.value(0.1, 0.9), picker.value(0.2, 0.95));
            patch(&mut picker, [60.0, 500.0], paint);
        }
        for _ in 0..settings.skin_patches {
            let near = looks.skin.map(|v| v + picker.value(-10.0, 10.0));
            patch(&mut picker, [80.0, 240.0], near);
        }
        Room {
            wall: looks.wall,
            slope: s / c,
            wall_normal: [s, 0.0, -c],
            floor: looks.floor,
            sides,
            colours: [looks.wall_colour, looks.floor_colour],
            texture,
            texture_share: 0.06 + 0.6 * settings.clutter,
            blocks,
            patches,
            light: looks.light,
            ambient: looks.ambient,
        }
    }

    /// As seen by a camera; `ray` makes the direction of a pixel's ray one in the room, and `origin` is where
    /// they begin.
    pub(super) fn seen(&self, view: &View, origin: Point, ray: impl Fn(Point) -> Point) -> Empty {
        let (width, height) = view.size();
        let mut empty =
            Empty { depth: Vec::with_capacity(width * height), colour: Vec::with_capacity(width * height) };
        for y in 0..height {
            for x in 0..width {
                let own =
                    [view.ray(0, x as i64 + view.window[0]), view.ray(1, y as i64 + view.window[1]), 1.0];
                let (far, colour) = self.at(origin, ray(own));
                empty.depth.push(far as f32);
                empty.colour.push(colour.map(|v| v as f32));
            }
        }
        empty
    }

    /// What a ray meets first: how many times its length away, and the colour.
    fn at(&self, origin: Point, ray: Point) -> (f64, [f64; 3]) {
        let mut far = f64::INFINITY;
        let (mut normal, mut paint) = ([0.0, 0.0, -1.0], [0.0; 3]);
        // The wall: z = wall + slope x.
        let away = (self.wall + self.slope * origin[0] - origin[2]) / (ray[2] - self.slope * ray[0]);
        if away > 0.0 {
            let point = add(origin, times(ray, away));
            (far, normal, paint) = (away, self.wall_normal, self.on_wall(point[0], point[1]));
        }
        let mut plane = |distance: f64, towards: f64, facing: Point, colour: [f64; 3]| {
            let away = distance / towards;
            if away > 0.0 && away < far {
                (far, normal, paint) = (away, facing, colour);
            }
        };
        plane(self.floor - origin[1], ray[1], [0.0, -1.0, 0.0], self.colours[1]);
        plane(self.sides[0] - origin[0], ray[0], [1.0, 0.0, 0.0], self.colours[0]);
        plane(self.sides[1] - origin[0], ray[0], [-1.0, 0.0, 0.0], self.colours[0]);
        for block in &self.blocks {
            if let Some((away, facing)) = block.hit(origin, ray)
                && away < far
            {
                (far, normal, paint) = (away, facing, block.colour);
            }
        }
        let shade = self.ambient + (1.0 - self.ambient) * dot(normal, self.light).max(0.0);
        (far, paint.map(|v| shade * v))
    }

    fn on_wall(&self, x: f64, y: f64) -> [f64; 3] {
        let inside = |patch: &&Patch| {
            let [left, top, right, bottom] = patch.bounds;
            if !(left..right).contains(&x) || !(top..bottom).contains(&y) {
                return false;
            }
            let (u, v) =
                ((2.0 * x - left - right) / (right - left), (2.0 * y - top - bottom) / (bottom - top));
            !patch.round || u * u + v * v < 1.0
        };
        let (share, base) = match self.patches.iter().rev().find(inside) {
            Some(patch) => (0.15, patch.colour),
            None => (self.texture_share, self.colours[0]),
        };
        let texture = self.texture.at(x, y);
        std::array::from_fn(|c| (base[c] + share * texture[c]).clamp(0.0, 255.0))
    }
}

impl Block {
    fn hit(&self, origin: Point, ray: Point) -> Option<(f64, Point)> {
        let (mut near, mut far, mut axis) = (0.0, f64::INFINITY, 0);
        for k in 0..3 {
            let (a, b) = ((self.low[k] - origin[k]) / ray[k], (self.high[k] - origin[k]) / ray[k]);
            let (first, last) = (a.min(b), a.max(b));
            if first > near {
                (near, axis) = (first, k);
            }
            far = last.min(far);
        }
        if !(near > 0.0 && near < far) {
            return None;
        }
        let mut normal = [0.0; 3];
        normal[axis] = if ray[axis] > 0.0 { -1.0 } else { 1.0 };
        Some((near, unit(normal)))
    }
}
