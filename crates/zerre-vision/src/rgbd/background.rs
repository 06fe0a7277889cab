//! The room without people: from a picture of it, from the median of a recording, or learnt as it goes.

use super::cue::{depth_noise, light};
use super::{Depth, NO_DEPTH, RgbdFrame};
use crate::{Error, Frame, Image, Result};
use serde::{Deserialize, Serialize};

/// What the room looks like where nobody stands.
#[derive(Clone, Debug)]
pub struct Background {
    colour: Frame,
    depth: Depth,
    running: Option<Running>,
}

/// How a room is learnt as it goes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RunningSettings {
    /// Frames over which the room is averaged.
    pub memory: f64,
    /// Frames that something must stay to become part of the room: a person who stands still is none for so
    /// long.
    pub patience: u16,
    /// Frames that something farther away than the room must be seen to be the room: it cannot be before it.
    pub revealed: u16,
}

impl Default for RunningSettings {
    /// 3 s, 60 s and 0.2 s at 30 frames per second.
    fn default() -> RunningSettings {
        RunningSettings { memory: 90.0, patience: 1800, revealed: 6 }
    }
}

/// What a pixel has shown. Means are whole numbers of a small part, which takes half the time of fractions.
#[derive(Clone, Copy, Debug)]
struct Pixel {
    /// Mean colour of the room in parts of a level, and the variance of a channel in parts of a squared one.
    colour: [u16; 3],
    variance: u16,
    /// Mean depth of the room in parts of a millimetre, 0 if unknown.
    depth: u32,
    /// Share of the frames with a depth, of [`ALL`].
    valid: u16,
    /// What may become the room, and for how many frames it has been seen.
    other: [u8; 3],
    other_depth: u16,
    seen: u16,
}

#[derive(Clone, Debug)]
struct Running {
    settings: RunningSettings,
    pixels: Vec<Pixel>,
    /// Frames so far.
    frames: usize,
}

/// Levels by which a colour differs that may still be the same thing.
const SAME_COLOUR: f32 = 18.0;
/// Rows are learnt in turn, every so many-th in a frame: neither people nor the light are faster than that.
const TURN: usize = 2;
/// Parts of a level, of a squared one, of a millimetre.
const PARTS: i64 = 256;
/// Variance of a channel, at least and at most, in parts.
const VARIANCE: [i64; 2] = [4 * PARTS, 64 * PARTS];
/// Every frame.
const ALL: i64 = u16::MAX as i64;
/// What a rate of 1 is.
const WHOLE: i64 = 1 << 16;

/// A mean with another value in it, rounded.
fn towards(mean: i64, value: i64, rate: i64) -> i64 {
    mean + (((value - mean) * rate + WHOLE / 2) >> 16)
}

/// Whether two depths may be those of one thing.
fn is_same_depth(a: f32, b: f32) -> bool {
    let noise = depth_noise(f64::from(a.max(b))) as f32;
    (a - b).abs() < 20.0 + 5.0 * std::f32::consts::SQRT_2 * noise
}

fn is_same_colour(a: [f32; 3], b: [f32; 3], most_squared: f32) -> bool {
    (0..3).all(|c| (a[c] - b[c]) * (a[c] - b[c]) < most_squared)
}

fn in_parts(level: u8) -> u16 {
    u16::from(level) * PARTS as u16
}

impl Background {
    /// From a picture of the empty room: it stays what it is.
    ///
    /// # Errors
    /// Colour and depth of different sizes.
    pub fn still(colour: Frame, depth: Depth) -> Result<Background> {
        colour.expect_size(&depth)?;
        Ok(Background { colour, depth, running: None })
    }

    /// From a first picture, which people may stand in, and then from every frame.
    ///
    /// # Errors
    /// Colour and depth of different sizes, settings outside their range.
    pub fn running(colour: Frame, depth: Depth, settings: RunningSettings) -> Result<Background> {
        colour.expect_size(&depth)?;
        let refuse = |what, value, needs| Err(Error::OutOfRange { what, value, needs });
        if !(settings.memory >= 1.0 && settings.memory.is_finite()) {
            return refuse("memory", settings.memory, "it must be at least 1 frame");
        }
        for (what, value) in [("patience", settings.patience), ("revealed", settings.revealed)] {
            if value == 0 {
                return refuse(what, 0.0, "it must be at least 1 frame");
            }
        }
        let pixel = |(colour, depth): (&[u8; 3], &u16)| Pixel {
            colour: colour.map(in_parts),
            variance: VARIANCE[0] as u16,
            depth: u32::from(*depth) * PARTS as u32,
            valid: if *depth == NO_DEPTH { 0 } else { ALL as u16 },
            other: [0; 3],
            other_depth: NO_DEPTH,
            seen: 0,
        };
        let pixels = colour.pixels().iter().zip(depth.pixels()).map(pixel).collect();
        Ok(Background { colour, depth, running: Some(Running { settings, pixels, frames: 0 }) })
    }

    /// Colours of the room.
    pub fn colour(&self) -> &Frame {
        &self.colour
    }

    /// Depth of the room; [`NO_DEPTH`] where it was never measured.
    pub fn depth(&self) -> &Depth {
        &self.depth
    }

    /// Learns from a frame, if it learns at all. Pixels that `foreground` has not as 0 are not the room
    /// whatever they look like; others are where they look like it, in depth if that is known and else in
    /// colour, the light apart. What stays different for [`RunningSettings::patience`] frames becomes the
    /// room, under the mask too.
    ///
    /// # Errors
    /// A picture of another size.
    pub fn update(&mut self, frame: &RgbdFrame, foreground: Option<&Image<u8>>) -> Result<()> {
        self.colour.expect_size(&frame.colour)?;
        self.colour.expect_size(&frame.depth)?;
        if let Some(mask) = foreground {
            self.colour.expect_size(mask)?;
        }
        let Some(Running { settings, pixels, frames }) = &mut self.running else { return Ok(()) };
        let gain = light(&frame.colour, &self.colour);
        // At 1 the last frame is the room.
        let rate = (TURN as f64 * WHOLE as f64 / settings.memory).round() as i64;
        let rate = rate.min(WHOLE);
        // At least so many frames, and at most.
        let turns = [settings.patience / TURN as u16 + 1, settings.revealed.div_ceil(TURN as u16)];
        *frames += 1;
        let width = self.colour.width();
        let room = self.colour.pixels_mut().chunks_mut(width).zip(self.depth.pixels_mut().chunks_mut(width));
        for (y, (pixels, (colours, depths))) in pixels.chunks_mut(width).zip(room).enumerate() {
            let turn = (y + *frames).is_multiple_of(TURN);
            let now = frame.colour.row(y).iter().zip(frame.depth.row(y));
            let room = pixels.iter_mut().zip(colours.iter_mut().zip(depths));
            for (x, ((pixel, (colour, deep)), (&seen, &depth))) in room.zip(now).enumerate() {
                // What was never measured is taken at once.
                if !turn && (pixel.depth > 0 || depth == NO_DEPTH) {
                    continue;
                }
                let masked = foreground.is_some_and(|mask| mask.row(y)[x] != 0);
                let measured = if depth == NO_DEPTH { 0 } else { ALL };
                pixel.valid = towards(i64::from(pixel.valid), measured, rate) as u16;
                if !masked && pixel.is_room(seen, depth, gain) {
                    pixel.average(seen, depth, rate);
                    pixel.seen = pixel.seen.saturating_sub(1);
                } else if !pixel.becomes_room(seen, depth, turns) {
                    continue;
                }
                // The largest level and depth are whole ones: rounding cannot go beyond them.
                *colour = pixel.colour.map(|v| ((i64::from(v) + PARTS / 2) / PARTS) as u8);
                *deep = ((i64::from(pixel.depth) + PARTS / 2) / PARTS) as u16;
            }
        }
        Ok(())
    }

    /// Share of the frames of late in which the depth of a pixel was measured; `None` of a room that does not
    /// learn.
    pub fn validity(&self, x: usize, y: usize) -> Option<f64> {
        let running = self.running.as_ref()?;
        let inside = x < self.colour.width() && y < self.colour.height();
        inside.then(|| f64::from(running.pixels[y * self.colour.width() + x].valid) / ALL as f64)
    }
}

impl Pixel {
    fn depth_mm(&self) -> f32 {
        self.depth as f32 / PARTS as f32
    }

    fn is_room(&self, seen: [u8; 3], depth: u16, gain: [f32; 3]) -> bool {
        if depth != NO_DEPTH && self.depth > 0 {
            return is_same_depth(f32::from(depth), self.depth_mm());
        }
        let expected = std::array::from_fn(|c| gain[c] * f32::from(self.colour[c]) / PARTS as f32);
        let most = (16.0 * f32::from(self.variance) / PARTS as f32).max(SAME_COLOUR * SAME_COLOUR);
        is_same_colour(seen.map(f32::from), expected, most)
    }

    fn average(&mut self, seen: [u8; 3], depth: u16, rate: i64) {
        let mut squares = 0;
        for c in 0..3 {
            let (mean, value) = (i64::from(self.colour[c]), i64::from(in_parts(seen[c])));
            self.colour[c] = towards(mean, value, rate) as u16;
            squares += (value - mean) * (value - mean) / PARTS;
        }
        let [least, most] = VARIANCE;
        self.variance = towards(i64::from(self.variance), squares / 3, rate).clamp(least, most) as u16;
        if depth != NO_DEPTH {
            let depth = i64::from(depth) * PARTS;
            let mean = if self.depth > 0 { towards(i64::from(self.depth), depth, rate) } else { depth };
            self.depth = mean as u32;
        }
    }

    /// Counts what is not the room; whether it has now become it, seen so often as what may come and go or as
    /// what was behind something.
    fn becomes_room(&mut self, seen: [u8; 3], depth: u16, [patience, revealed]: [u16; 2]) -> bool {
        let near = if depth != NO_DEPTH && self.other_depth != NO_DEPTH {
            is_same_depth(f32::from(depth), f32::from(self.other_depth))
        } else {
            is_same_colour(seen.map(f32::from), self.other.map(f32::from), SAME_COLOUR * SAME_COLOUR)
        };
        if self.seen > 0 && !near {
            // One frame of something else, as at an edge, does not begin anew.
            self.seen = self.seen.saturating_sub(2);
            return false;
        }
        if self.seen == 0 || self.other_depth == NO_DEPTH {
            self.other_depth = depth;
        }
        self.other = seen;
        self.seen = self.seen.saturating_add(1);
        let (far, room) = (f32::from(self.other_depth), self.depth_mm());
        let farther = self.depth > 0 && far > room && !is_same_depth(far, room);
        if self.seen < if farther { revealed } else { patience } {
            return false;
        }
        self.colour = seen.map(in_parts);
        self.variance = VARIANCE[0] as u16;
        // What has no depth itself does not have that of what was there.
        self.depth = u32::from(self.other_depth) * PARTS as u32;
        self.seen = 0;
        true
    }
}

/// The median of a recording, pixel by pixel: what most frames show. Frames are thinned out evenly as they
/// come, so that no more than a number of them is in memory.
#[derive(Clone, Debug)]
pub struct MedianRoom {
    most: usize,
    every: usize,
    given: usize,
    frames: Vec<(Frame, Depth)>,
}

/// Share of the frames in which depth must have been measured for its median to count.
const MEASURED: f64 = 0.2;

impl MedianRoom {
    /// Of at least half of `most` frames, if there are so many, and at most of `most` (at least 2).
    pub fn new(most: usize) -> MedianRoom {
        MedianRoom { most: most.max(2), every: 1, given: 0, frames: Vec::new() }
    }

    /// Takes a frame into account.
    ///
    /// # Errors
    /// A picture of another size.
    pub fn add(&mut self, frame: &RgbdFrame) -> Result<()> {
        frame.colour.expect_size(&frame.depth)?;
        if let Some((first, _)) = self.frames.first() {
            first.expect_size(&frame.colour)?;
        }
        if self.given.is_multiple_of(self.every) {
            if self.frames.len() == self.most {
                let mut k = 0;
                self.frames.retain(|_| {
                    k += 1;
                    k % 2 == 1
                });
                self.every *= 2;
            }
            if self.given.is_multiple_of(self.every) {
                self.frames.push((frame.colour.clone(), frame.depth.clone()));
            }
        }
        self.given += 1;
        Ok(())
    }

    /// The room: the median of each channel, and of the depths that were measured, where at least a fifth of
    /// the frames has one. Of an even number, the lower of both in the middle.
    ///
    /// # Errors
    /// No frame.
    pub fn finish(self) -> Result<Background> {
        let Some((first, _)) = self.frames.first() else {
            let problem = "the median of no frames is no room: a recording with frames is needed".to_owned();
            return Err(Error::Input { input: "background".to_owned(), problem });
        };
        let (width, height) = first.size();
        let (mut colour, mut depth) =
            (Image::filled(width, height, [0; 3]), Image::filled(width, height, NO_DEPTH));
        let needed = (MEASURED * self.frames.len() as f64).ceil() as usize;
        let (mut levels, mut depths) = (Vec::new(), Vec::new());
        let pixels = colour.pixels_mut().iter_mut().zip(depth.pixels_mut());
        for (i, (colour, depth)) in pixels.enumerate() {
            for c in 0..3 {
                levels.clear();
                levels.extend(self.frames.iter().map(|(frame, _)| frame.pixels()[i][c]));
                colour[c] = middle(&mut levels);
            }
            depths.clear();
            depths.extend(self.frames.iter().map(|(_, depth)| depth.pixels()[i]).filter(|z| *z != NO_DEPTH));
            if depths.len() >= needed.max(1) {
                *depth = middle(&mut depths);
            }
        }
        Background::still(colour, depth)
    }
}

/// The median of at least one value.
fn middle<T: Ord + Copy>(values: &mut [T]) -> T {
    let middle = (values.len() - 1) / 2;
    *values.select_nth_unstable(middle).1
}

#[cfg(test)]
mod tests {
    use super::super::scene::{Scene, SceneSettings};
    use super::*;
    use zerre::Time;

    fn frame(colour: Frame, depth: Depth) -> RgbdFrame {
        RgbdFrame { index: 0, name: String::new(), time: Time::ZERO, colour, depth }
    }

    fn small() -> Scene {
        Scene::new(SceneSettings { size: [160, 120], ..SceneSettings::default() }, 4).unwrap()
    }

    /// Share of the pixels at which the room's depth is known and nearer than the empty one by more than its
    /// noise.
    fn too_near(room: &Background, scene: &Scene) -> f64 {
        let (_, empty) = scene.background();
        let pairs = room.depth().pixels().iter().zip(empty.pixels());
        let near =
            pairs.filter(|(a, b)| **a != NO_DEPTH && a < b && !is_same_depth(f32::from(**a), f32::from(**b)));
        near.count() as f64 / empty.pixels().len() as f64
    }

    #[test]
    fn a_still_room_stays() {
        let scene = small();
        let (colour, depth) = scene.background();
        let mut room = Background::still(colour.clone(), depth.clone()).unwrap();
        room.update(&scene.frame(0), None).unwrap();
        assert_eq!((room.colour(), room.depth()), (&colour, &depth));
        assert!(Background::still(colour, Image::filled(3, 3, 0)).is_err());
        assert!(room.update(&frame(Image::filled(3, 3, [0; 3]), Image::filled(3, 3, 0)), None).is_err());
    }

    #[test]
    fn medians_are_of_what_was_measured() {
        let colours = [[10, 20, 30], [12, 220, 28], [14, 22, 29]];
        let depths = [2000, NO_DEPTH, 1990];
        let mut room = MedianRoom::new(10);
        assert!(MedianRoom::new(10).finish().is_err());
        for k in 0..3 {
            let depth = Image::from_fn(2, 1, |x, _| if x == 0 { depths[k] } else { NO_DEPTH });
            room.add(&frame(Image::filled(2, 1, colours[k]), depth)).unwrap();
        }
        let room = room.finish().unwrap();
        assert_eq!(room.colour().pixels(), [[12, 22, 29]; 2]);
        // Nothing measured, nothing known.
        assert_eq!(room.depth().pixels(), [1990, NO_DEPTH]);
        // One of ten is too few.
        let mut rare = MedianRoom::new(10);
        for k in 0..10 {
            rare.add(&frame(Image::filled(1, 1, [0; 3]), Image::filled(1, 1, 500 * u16::from(k == 0))))
                .unwrap();
        }
        assert_eq!(rare.finish().unwrap().depth().pixels(), [NO_DEPTH]);
    }

    /// Of 100 frames, 8 to 16 are kept, evenly.
    #[test]
    fn frames_are_thinned_out() {
        let mut room = MedianRoom::new(16);
        for k in 0..100 {
            room.add(&frame(Image::filled(1, 1, [k; 3]), Image::filled(1, 1, 0))).unwrap();
        }
        let kept: Vec<u8> = room.frames.iter().map(|(frame, _)| frame.pixels()[0][0]).collect();
        assert_eq!(kept, (0..100).step_by(8).collect::<Vec<u8>>());
    }

    /// Where the moving hand is beside the body, the median shows what is behind it; every frame shows the
    /// hand.
    #[test]
    fn what_moves_is_not_in_the_median() {
        let scene = small();
        let mut room = MedianRoom::new(31);
        for k in 0..scene.len() {
            room.add(&scene.frame(k)).unwrap();
        }
        let room = room.finish().unwrap();
        let (_, empty) = scene.background();
        let (mut there, mut gone, mut count) = (0, 0, 0);
        for k in (0..scene.len()).filter(|k| !scene.truth(*k).overlap) {
            let [x, y] = scene.truth(k).hand.map(|v| v as isize);
            let wall = empty.at(x, y);
            if wall == NO_DEPTH {
                continue;
            }
            let is_wall = |z: u16| is_same_depth(f32::from(z), f32::from(wall));
            count += 1;
            there += usize::from(is_wall(scene.frame(k).depth.at(x, y)));
            gone += usize::from(is_wall(room.depth().at(x, y)));
        }
        assert!(count > 40 && there == 0 && 10 * gone > 8 * count, "{there} {gone} of {count}");
    }

    /// A person who walks in and stands still is no part of the room for `patience` frames, with and without
    /// a mask, and is afterwards.
    #[test]
    fn who_stands_still_is_not_absorbed_before_time() {
        let scene = small();
        let (colour, depth) = scene.background();
        let settings = RunningSettings { patience: 40, ..RunningSettings::default() };
        for masked in [false, true] {
            let mut room = Background::running(colour.clone(), depth.clone(), settings).unwrap();
            let mask = Image::filled(160, 120, 255_u8);
            // One pose, other noise.
            let pose = scene.frame(20);
            for k in 0..60 {
                let noise = (k % 5) as u8;
                let frame =
                    frame(pose.colour.map(|c| c.map(|v| v.saturating_add(noise))), pose.depth.clone());
                room.update(&frame, masked.then_some(&mask)).unwrap();
                let near = too_near(&room, &scene);
                match k + 1 {
                    ..40 => assert!(near < 0.002, "{near} after {}", k + 1),
                    50.. => assert!(near > 0.05, "{near} after {}", k + 1),
                    _ => {}
                }
            }
        }
    }

    /// Learnt from a first frame with the person in it: what the person leaves becomes the room within
    /// `revealed` frames, and the light's changes go into the colours.
    #[test]
    fn what_is_revealed_is_the_room() {
        let scene = small();
        let first = scene.frame(0);
        let mut room = Background::running(first.colour, first.depth, RunningSettings::default()).unwrap();
        let before = too_near(&room, &scene);
        let (colour, depth) = scene.background();
        let dark = colour.map(|c| c.map(|v| (0.8 * f32::from(v)) as u8));
        for k in 0..300 {
            room.update(&frame(dark.clone(), depth.clone()), None).unwrap();
            if k == 6 {
                assert!(before > 0.05 && too_near(&room, &scene) < 0.01);
            }
        }
        let off = |a: &Frame, b: &Frame| {
            let pairs = a.pixels().as_flattened().iter().zip(b.pixels().as_flattened());
            pairs.map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / (3 * a.pixels().len()) as f64
        };
        // After 300 frames exp(-300 / 90) of the difference is left.
        assert!(off(room.colour(), &dark) < 0.05 * off(&colour, &dark) + 1.5);
    }

    #[test]
    fn without_any_depth_colours_are_learnt_and_depth_is_unknown() {
        let none = Image::filled(8, 8, NO_DEPTH);
        let mut room =
            Background::running(Image::filled(8, 8, [100; 3]), none.clone(), RunningSettings::default())
                .unwrap();
        for _ in 0..400 {
            room.update(&frame(Image::filled(8, 8, [110; 3]), none.clone()), None).unwrap();
        }
        assert!(room.colour().pixels().iter().all(|c| c[0] >= 109));
        assert_eq!(room.depth(), &none);
        assert_eq!(room.validity(3, 3), Some(0.0));
        assert_eq!(room.validity(8, 0), None);
        // The first depth is taken.
        room.update(&frame(Image::filled(8, 8, [110; 3]), Image::filled(8, 8, 2000)), None).unwrap();
        assert_eq!(room.depth(), &Image::filled(8, 8, 2000));
        let mut median = MedianRoom::new(5);
        median.add(&frame(Image::filled(8, 8, [110; 3]), none.clone())).unwrap();
        assert_eq!(median.finish().unwrap().depth(), &none);
    }

    #[test]
    fn settings_are_checked() {
        let room =
            |settings| Background::running(Image::filled(1, 1, [0; 3]), Image::filled(1, 1, 0), settings);
        let usual = RunningSettings::default();
        assert!(room(RunningSettings { memory: 0.5, ..usual }).is_err());
        assert!(room(RunningSettings { memory: f64::NAN, ..usual }).is_err());
        assert!(room(RunningSettings { patience: 0, ..usual }).is_err());
        assert!(room(usual).is_ok());
    }
}
