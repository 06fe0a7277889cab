//! Recordings that are drawn: a clothed person moves the right hand in a room that stands still, seen by a
//! colour and a depth camera and by a device that follows joints. Where the hand is and how much of it can be
//! seen is known exactly.
//!
//! Lengths are mm in the frame of the colour camera: x to the right, y down, z forward.

mod appearance;
mod device;
mod files;
mod person;
mod room;
mod sensor;
mod settings;
mod shape;
mod space;
#[cfg(test)]
mod tests;

pub use appearance::{Appearance, Wave};
pub use files::{Named, SCENES, SceneFile};
pub use settings::{
    ColourSettings, Condition, DepthSettings, DeviceSettings, OperatorSettings, Purpose, SceneSettings,
};

use super::{Camera, Depth, Intrinsics, Reading, RgbdFrame};
use crate::{Frame, Result};
use appearance::{Cloth, Picker};
use person::{Limb, Part, Person, Pose, Surface};
use room::{Empty, Room};
use sensor::{Kind, Noise};
use shape::{Hit, Shape, View};
use space::{Point, dot, smooth, sub};
use std::f64::consts::TAU;
use std::sync::OnceLock;
use zerre::Time;
use zerre::math::Real;
use zerre::rng::Stream;

/// A point of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Where it is seen in the colour picture, pixels; behind other things too.
    pub px: [f64; 2],
    /// Where it is, mm.
    pub mm: [f64; 3],
}

/// The other points of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joints {
    /// The right elbow.
    pub elbow: Joint,
    /// The right shoulder.
    pub shoulder: Joint,
    /// The middle of the head.
    pub head: Joint,
    /// The middle of the left palm.
    pub left_hand: Joint,
}

/// Where everything is in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneTruth {
    /// Where the middle of the right palm is seen, pixels.
    pub hand: [f64; 2],
    /// Where it is, mm.
    pub hand_mm: [f64; 3],
    /// Share of the pixels of the hand that can be seen.
    pub visible: f64,
    /// Whether at least half of its pixels lie before or behind trunk, head or other limbs; its own forearm
    /// does not count.
    pub overlap: bool,
    /// The rest of the body.
    pub joints: Joints,
}

/// A drawn recording.
#[derive(Clone, Debug)]
pub struct Scene {
    settings: SceneSettings,
    stream: Stream,
    looks: Appearance,
    person: Person,
    room: Room,
    camera: Camera,
    noise: Noise,
    cloths: [Cloth; 2],
    empty: Empty,
    /// The empty room from the depth camera's place.
    empty_raw: OnceLock<Vec<f32>>,
    truths: Vec<SceneTruth>,
    readings: Vec<(Time, Option<Reading>)>,
    /// When the light changes, and to how much.
    step: (usize, f64),
}

/// Points of the room that are looked at for shadows are that many pixels apart.
const COARSE: usize = 8;

impl Scene {
    /// Another seed has another person, another room, another movement and other noise.
    ///
    /// # Errors
    /// A setting outside its range.
    pub fn new(settings: SceneSettings, seed: u64) -> Result<Scene> {
        settings.checked()?;
        let stream = Stream::new(seed).fork(0x7267_6264 + settings.purpose as u64);
        let looks = Appearance::new(&settings, stream);
        let mut picker = Picker::new(stream, settings.purpose, 1);
        let person = Person::new(&settings, &looks, picker.draws());
        let cloths = [
            Cloth::new(picker.draws(), looks.shirt, looks.weave, looks.stripes),
            Cloth::new(picker.draws(), looks.trousers, 0.5 * looks.weave, 0.0),
        ];
        let up = if picker.draws().uniform() < 0.5 { -1.0 } else { 1.0 };
        let when = (settings.frames as f64 * (0.3 + 0.4 * picker.draws().uniform())) as usize;
        let step = (when, 1.0 + up * settings.colour.step);
        let camera = cameras(settings.size);
        let room = Room::new(&settings, &looks, Picker::new(stream, settings.purpose, 2));
        let [width, height] = settings.size;
        let view = View { lens: camera.colour, window: [0, 0, width as i64, height as i64] };
        let empty = room.seen(&view, [0.0; 3], |ray| ray);
        let noise = Noise::new(stream, width);
        let (truths, readings, empty_raw) = (Vec::new(), Vec::new(), OnceLock::new());
        let mut scene = Scene {
            settings,
            stream,
            looks,
            person,
            room,
            camera,
            noise,
            cloths,
            empty,
            empty_raw,
            truths,
            readings,
            step,
        };
        scene.truths = (0..scene.settings.frames).map(|k| scene.exact(k)).collect();
        scene.readings = device::readings(&scene, &scene.truths, stream);
        Ok(scene)
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.settings.frames
    }

    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.settings.frames == 0
    }

    /// What it was drawn from.
    pub fn settings(&self) -> &SceneSettings {
        &self.settings
    }

    /// What the seed has made of it.
    pub fn appearance(&self) -> &Appearance {
        &self.looks
    }

    /// Both cameras: of [`Scene::raw_depth`] and of colours. The depth of [`Scene::frame`] is that of the
    /// second.
    pub fn camera(&self) -> Camera {
        self.camera
    }

    /// When frame `k` is taken.
    pub fn time(&self, k: usize) -> Time {
        Time::from_secs(self.seconds(k))
    }

    fn seconds(&self, k: usize) -> f64 {
        k as f64 / self.settings.rate_hz
    }

    fn view(&self) -> View {
        let [width, height] = self.settings.size;
        View { lens: self.camera.colour, window: [0, 0, width as i64, height as i64] }
    }

    fn size(&self) -> (usize, usize) {
        (self.settings.size[0], self.settings.size[1])
    }

    /// What frame `k` is called: a file's name.
    fn name(&self, k: usize) -> String {
        format!("{:04}.png", k + 1)
    }

    fn parts(&self, k: usize) -> Vec<Part> {
        self.person.parts(&self.person.pose(self.seconds(k)))
    }

    /// Frame `k`, with depth in the pixels of the colours.
    pub fn frame(&self, k: usize) -> RgbdFrame {
        let (exact, seen) = self.seen(&self.parts(k));
        let (size, lens) = (self.size(), self.camera.colour);
        let random = (Kind::Depth, k as u64);
        let depth = self.noise.depth(&exact, size, lens.focal[0], &self.settings.depth, random);
        let (name, time) = (self.name(k), self.time(k));
        RgbdFrame { index: k, name, time, colour: self.lit(seen, k), depth }
    }

    fn colours(&self, k: usize) -> Frame {
        self.lit(self.seen(&self.parts(k)).1, k)
    }

    fn lit(&self, seen: Vec<[f32; 3]>, k: usize) -> Frame {
        self.noise.colour(seen, self.size(), self.light(k), &self.settings.colour, k as u64)
    }

    /// What the depth camera sees in frame `k`, from its own place.
    pub fn raw_depth(&self, k: usize) -> Depth {
        self.raw(&self.parts(k), k as u64)
    }

    /// The empty room: colours, and depth in their pixels.
    pub fn background(&self) -> (Frame, Depth) {
        let (size, step) = (self.size(), u64::MAX - 1);
        let focal = self.camera.colour.focal[0];
        let Empty { depth, colour } = &self.empty;
        (
            self.noise.colour(colour.clone(), size, 1.0, &self.settings.colour, step),
            self.noise.depth(depth, size, focal, &self.settings.depth, (Kind::Depth, step)),
        )
    }

    /// The empty room as the depth camera sees it from its own place.
    pub fn raw_background(&self) -> Depth {
        self.raw(&[], u64::MAX - 1)
    }

    fn raw(&self, parts: &[Part], step: u64) -> Depth {
        let view = View { lens: self.camera.depth, ..self.view() };
        let shift = self.camera.translation.map(|v| 1000.0 * v);
        let forth = |v: Point| self.camera.rotation.map(|row| dot(row, v));
        let back = |v: Point| -> Point {
            std::array::from_fn(|j| (0..3).map(|i| self.camera.rotation[i][j] * v[i]).sum())
        };
        let empty = self.empty_raw.get_or_init(|| self.room.seen(&view, shift, forth).depth);
        let mut depth = empty.clone();
        for part in parts {
            view.draw(part.shape.moved(|point| back(sub(point, shift)), back), &mut depth, |_, _| {});
        }
        let settings = &self.settings.depth;
        self.noise.depth(&depth, self.size(), self.camera.depth.focal[0], settings, (Kind::Raw, step))
    }

    /// Where everything is in frame `k`; of a frame behind the last one, as in the last one.
    pub fn truth(&self, k: usize) -> SceneTruth {
        self.truths[k.min(self.truths.len() - 1)]
    }

    /// The newest reading of the device that came after frame `k - 1` and not after frame `k`.
    pub fn device(&self, k: usize) -> Option<Reading> {
        let (before, now) = (k.checked_sub(1).map(|k| self.time(k)), self.time(k));
        let came = |(time, _): &&(Time, _)| *time <= now && before.is_none_or(|before| *time > before);
        self.readings.iter().rev().filter(came).find_map(|(_, reading)| *reading)
    }

    /// All readings of the device with their times, in order.
    pub fn readings(&self) -> impl Iterator<Item = (Time, Reading)> {
        self.readings.iter().filter_map(|(time, reading)| Some((*time, (*reading)?)))
    }

    /// Where each person who labels the hand sees it in frame `k`, pixels; none where it can hardly be seen.
    pub fn operators(&self, k: usize) -> Vec<Option<[f64; 2]>> {
        device::labels(self, k, &self.truth(k), self.stream)
    }

    /// The light in frame `k`, as a share of the usual one.
    fn light(&self, k: usize) -> f64 {
        let (colour, seconds) = (&self.settings.colour, self.seconds(k));
        let drift = 1.0 + colour.drift * self.looks.drift.at(seconds);
        let step = if k >= self.step.0 { self.step.1 } else { 1.0 };
        // Twice the mains' 50 Hz, a little off, so that frames meet other parts of the cycle.
        let flicker = 1.0 + colour.flicker * Real::sin_cos(TAU * 100.3 * seconds).0;
        drift * step * flicker
    }

    fn exact(&self, k: usize) -> SceneTruth {
        let pose = self.person.pose(self.seconds(k));
        let (visible, overlap) = self.seen_of_hand(&pose);
        let joint = |mm: Point| Joint { px: self.camera.colour.project(mm), mm };
        let joints = Joints {
            elbow: joint(pose.right.elbow),
            shoulder: joint(pose.right.shoulder),
            head: joint(pose.head),
            left_hand: joint(pose.left.palm),
        };
        let Joint { px: hand, mm: hand_mm } = joint(pose.right.palm);
        SceneTruth { hand, hand_mm, visible, overlap, joints }
    }

    /// Share of the hand's pixels that can be seen, and whether half of them lie before or behind the body.
    fn seen_of_hand(&self, pose: &Pose) -> (f64, bool) {
        let parts = self.person.parts(pose);
        // Beyond the border too.
        let all = View { window: [-20_000, -20_000, 20_000, 20_000], ..self.view() };
        let boxes = parts.iter().filter(|part| part.limb == Limb::Hand);
        let around = boxes.filter_map(|part| part.shape.seen(&all)).map(|seen| seen.window());
        let Some(window) =
            around.reduce(|a, b| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])])
        else {
            return (0.0, false);
        };
        let view = View { window, ..all };
        let (width, height) = view.size();
        let mut depths = [(); 3].map(|()| vec![f32::INFINITY; width * height]);
        for part in &parts {
            view.draw(part.shape, &mut depths[part.limb as usize], |_, _| {});
        }
        let [hand, forearm, rest] = depths;
        let (mut own, mut seen, mut over) = (0_u32, 0_u32, 0_u32);
        for (at, z) in hand.iter().enumerate().filter(|(_, z)| z.is_finite()) {
            let (x, y) = (window[0] + (at % width) as i64, window[1] + (at / width) as i64);
            let inside = (0..self.settings.size[0] as i64).contains(&x)
                && (0..self.settings.size[1] as i64).contains(&y);
            own += 1;
            seen += u32::from(inside && *z < forearm[at] && *z < rest[at]);
            over += u32::from(rest[at].is_finite());
        }
        (f64::from(seen) / f64::from(own.max(1)), own > 0 && 2 * over >= own)
    }

    /// Distances and colours with these parts of a person in the room, without noise.
    fn seen(&self, parts: &[Part]) -> (Vec<f32>, Vec<[f32; 3]>) {
        let Empty { depth, colour } = &self.empty;
        let (mut depth, mut colour) = (depth.clone(), colour.clone());
        if self.settings.colour.shadow > 0.0 {
            self.cast(parts, &mut colour);
        }
        let view = self.view();
        for part in parts {
            view.draw(part.shape, &mut depth, |at, hit| colour[at] = self.shade(part, hit));
        }
        (depth, colour)
    }

    fn shade(&self, part: &Part, hit: &Hit) -> [f32; 3] {
        let skin = || self.looks.skin.map(|v| v as f32);
        let [x, y, z] = hit.place;
        let cloth = |which: usize| match part.shape {
            Shape::Ellipsoid { radii, .. } => self.cloths[which].at(x * radii[0], y * radii[1]),
            Shape::Cone { ends: [a, b], radii } => {
                self.cloths[which].at(x * radii[0], z * space::length(sub(b, a)))
            }
        };
        let paint = match part.surface {
            Surface::Skin => skin(),
            Surface::Shirt => cloth(0),
            Surface::Trousers => cloth(1),
            Surface::Arm([from, to]) => {
                if from + z * (to - from) < self.settings.sleeve {
                    cloth(0)
                } else {
                    skin()
                }
            }
            Surface::Head => {
                let near = |u: f64, v: f64, wide: f64, high: f64| {
                    let (a, b) = ((x - u) / wide, (y - v) / high);
                    z < 0.0 && a * a + b * b < 1.0
                };
                if y < -0.55 - 0.3 * z.min(0.0) * (1.0 + y) || z > 0.15 && y < 0.55 {
                    self.looks.hair.map(|v| v as f32)
                } else if near(-0.36, -0.1, 0.14, 0.06) || near(0.36, -0.1, 0.14, 0.06) {
                    [40.0; 3]
                } else if near(0.0, 0.5, 0.28, 0.05) {
                    let [r, g, b] = skin();
                    [0.8 * r, 0.5 * g, 0.5 * b]
                } else {
                    skin()
                }
            }
        };
        let light = dot(hit.normal, self.looks.light).max(0.0);
        let shade = (self.looks.ambient + (1.0 - self.looks.ambient) * light) as f32;
        paint.map(|v| shade * v)
    }

    /// Darkens the room where a person keeps the light away, softly.
    fn cast(&self, parts: &[Part], colour: &mut [[f32; 3]]) {
        let (width, height) = self.size();
        let light = self.looks.light;
        // Coordinates across the light and along it: a shadow is a strip there.
        let right = space::unit(space::cross([0.0, 1.0, 0.0], light));
        let down = space::cross(light, right);
        let flat = |point: Point| [right, down, light].map(|axis| dot(point, axis) as f32);
        let strips: Vec<_> = parts.iter().map(|part| Strip::new(part.shape, flat)).collect();
        let view = self.view();
        let (columns, rows) = (width.div_ceil(COARSE) + 1, height.div_ceil(COARSE) + 1);
        let mut kept = vec![0.0_f32; columns * rows];
        for row in 0..rows {
            let y = (row * COARSE).min(height - 1);
            for column in 0..columns {
                let x = (column * COARSE).min(width - 1);
                let z = f64::from(self.empty.depth[y * width + x]);
                let ray = [view.ray(0, x as i64), view.ray(1, y as i64), 1.0];
                let point = flat(space::times(ray, z));
                let most = strips.iter().map(|strip| strip.keeps(point)).fold(0.0, f32::max);
                kept[row * columns + column] = smooth(f64::from(most)) as f32;
            }
        }
        let strength = self.settings.colour.shadow as f32;
        for y in 0..height {
            let (row, low) = (y / COARSE, (y % COARSE) as f32 / COARSE as f32);
            for x in 0..width {
                let (column, far) = (x / COARSE, (x % COARSE) as f32 / COARSE as f32);
                let at = row * columns + column;
                let top = kept[at] + far * (kept[at + 1] - kept[at]);
                let bottom = kept[at + columns] + far * (kept[at + columns + 1] - kept[at + columns]);
                let share = strength * (top + low * (bottom - top));
                if share > 0.0 {
                    let pixel = &mut colour[y * width + x];
                    *pixel = pixel.map(|v| (1.0 - share) * v);
                }
            }
        }
    }
}

/// What keeps the light from a strip.
struct Strip {
    from: [f32; 3],
    /// To the other end, divided by the square of its length across the light.
    axis: [f32; 2],
    length: [f32; 2],
    radii: [f32; 2],
}

impl Strip {
    fn new(shape: Shape, flat: impl Fn(Point) -> [f32; 3]) -> Strip {
        let (ends, radii) = shape.hull();
        let [from, to] = ends.map(flat);
        let length = [to[0] - from[0], to[1] - from[1]];
        let square = (length[0] * length[0] + length[1] * length[1]).max(1e-6);
        Strip { from, axis: length.map(|v| v / square), length, radii: radii.map(|r| r as f32) }
    }

    /// Share of the light: all of it within 0.7 radii, nothing 40 mm outside; below 0 and above 1 farther out
    /// and in.
    fn keeps(&self, [u, v, w]: [f32; 3]) -> f32 {
        let (a, b) = (u - self.from[0], v - self.from[1]);
        let share = (a * self.axis[0] + b * self.axis[1]).clamp(0.0, 1.0);
        let (a, b) = (a - share * self.length[0], b - share * self.length[1]);
        let radius = self.radii[0] + share * (self.radii[1] - self.radii[0]);
        let (inner, outer) = (0.7 * radius, radius + 40.0);
        if self.from[2] > w { (outer * outer - a * a - b * b) / (outer * outer - inner * inner) } else { 0.0 }
    }
}

/// A colour camera and a depth camera 25 mm to its right that is turned a little and has another lens.
fn cameras([width, height]: [usize; 2]) -> Camera {
    let scale = width as f64 / 640.0;
    let lens = |focal: f64, off: [f64; 2]| Intrinsics {
        focal: [scale * focal; 2],
        principal: [
            (width as f64 - 1.0) / 2.0 + scale * off[0],
            (height as f64 - 1.0) / 2.0 + scale * off[1],
        ],
    };
    let (s, c) = Real::sin_cos(0.004);
    Camera {
        colour: lens(525.0, [0.0; 2]),
        depth: lens(570.0, [-4.0, 3.0]),
        rotation: [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]],
        translation: [0.025, 0.0005, -0.001],
        depth_scale: 0.001,
        invalid: super::NO_DEPTH,
    }
}
