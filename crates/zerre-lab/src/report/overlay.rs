//! Frames with what a tracker makes of them: truth, box, particles, and whether the object is lost.

use super::animation::{Colour, Frame, Pen};
use super::study::Picture;
use crate::error::Result;
use zerre_vision::frames::folder::png;
use zerre_vision::tracker::{Estimate, Particle};
use zerre_vision::{Image, Rect};

const TRUTH: Colour = [70, 220, 110, 255];
const BOX: Colour = [255, 160, 20, 255];
const LOST: Colour = [255, 40, 80, 255];
const INK: Colour = [255, 255, 255, 255];
const SHADE: Colour = [0, 0, 0, 150];
/// Particles from the lightest to the heaviest.
const WEIGHTS: [Colour; 5] =
    [[68, 1, 84, 210], [59, 82, 139, 210], [33, 145, 140, 210], [94, 201, 98, 230], [253, 231, 37, 255]];

/// Frames of a filmstrip, and how many stand side by side.
const FILM: usize = 12;
/// Frames that are kept to choose from.
const KEPT: usize = 48;
const ACROSS: usize = 4;
/// Width of its frames, px.
const CELL: u16 = 300;
/// Between frames side by side, px.
const GAP: usize = 4;

/// A frame with something to draw on it.
pub trait Drawn {
    /// Columns and rows of the frame.
    fn size(&self) -> (usize, usize);

    /// The frame at `size` pixels with everything on it.
    ///
    /// # Errors
    /// A size of zero.
    fn draw(&self, size: [u16; 2]) -> Result<Frame>;
}

impl Drawn for Scene<'_> {
    fn size(&self) -> (usize, usize) {
        self.frame.size()
    }

    fn draw(&self, size: [u16; 2]) -> Result<Frame> {
        Scene::draw(self, size)
    }
}

/// One frame and what is known of it.
pub struct Scene<'a> {
    /// The picture.
    pub frame: &'a zerre_vision::Frame,
    /// Its number, from 0.
    pub index: usize,
    /// Where the object is.
    pub truth: Option<Rect>,
    /// Where the tracker has it.
    pub estimate: &'a Estimate,
    /// Its particles.
    pub particles: &'a [Particle],
}

impl Scene<'_> {
    /// The picture at `size` pixels with everything drawn on it: truth green and dashed, box orange or, when
    /// the object is flagged as lost, red and dashed, particles from dark to bright by weight.
    ///
    /// # Errors
    /// A size of zero.
    pub fn draw(&self, size: [u16; 2]) -> Result<Frame> {
        let mut drawn = Frame::photograph(self.frame, size)?;
        let scale = f64::from(size[0]) / self.frame.width() as f64;
        let outline = |r: &Rect| {
            let (left, top) = (scale * r.x, scale * r.y);
            let (right, bottom) = (scale * (r.x + r.width), scale * (r.y + r.height));
            [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]]
        };
        let heaviest = self.particles.iter().map(|p| p.weight).fold(f64::MIN_POSITIVE, f64::max);
        let class = |p: &Particle| {
            let share = (p.weight / heaviest).clamp(0.0, 1.0);
            ((share * WEIGHTS.len() as f64) as usize).min(WEIGHTS.len() - 1)
        };
        // The heaviest lie on top.
        for (k, colour) in WEIGHTS.iter().enumerate() {
            let of = self.particles.iter().filter(|p| class(p) == k);
            drawn.dots(of.map(|p| p.centre.map(|v| scale * v)), 1.8, *colour);
        }
        if let Some(truth) = &self.truth {
            drawn.line(outline(truth), Pen { colour: TRUTH, width: 2.0, dashed: true });
        }
        let lost = self.estimate.is_lost();
        let colour = if lost { LOST } else { BOX };
        drawn.line(outline(&self.estimate.bounds), Pen { colour, width: 2.0, dashed: lost });
        let right = f64::from(size[0]);
        drawn.area([[0.0, 0.0], [right, 0.0], [right, 16.0], [0.0, 16.0]], SHADE);
        let p_lost = self.estimate.p_lost;
        let end = drawn.text([4.0, 12.0], 8.0, &format!("{}  lost: {p_lost:.2}  ", self.index), INK);
        if lost {
            drawn.text([end, 12.0], 8.0, "LOST", LOST);
        }
        Ok(drawn)
    }
}

/// The size at which a frame is shown: between `least` and `most` pixels across where it is not, in its
/// proportions.
pub fn shown((width, height): (usize, usize), least: u16, most: u16) -> [u16; 2] {
    let across = (width as f64).clamp(f64::from(least), f64::from(most.max(least)));
    let down = across * height as f64 / width as f64;
    [across as u16, down.round().clamp(1.0, 8192.0) as u16]
}

/// A dozen frames spread evenly over a video of unknown length: some more are kept, at a distance that
/// doubles whenever they become too many.
#[derive(Clone, Debug)]
pub struct Film {
    kept: Vec<Frame>,
    every: usize,
    seen: usize,
}

impl Default for Film {
    fn default() -> Film {
        Film { kept: Vec::new(), every: 1, seen: 0 }
    }
}

impl Film {
    /// Looks at the next frame, and draws it when its turn has come.
    ///
    /// # Errors
    /// None in practice: a frame without pixels.
    pub fn see(&mut self, scene: &impl Drawn) -> Result<()> {
        let turn = self.seen.is_multiple_of(self.every);
        self.seen += 1;
        if !turn {
            return Ok(());
        }
        if self.kept.len() == KEPT {
            let mut place = 0;
            self.kept.retain(|_| {
                place += 1;
                place % 2 == 1
            });
            self.every *= 2;
            if !(self.seen - 1).is_multiple_of(self.every) {
                return Ok(());
            }
        }
        self.kept.push(scene.draw(shown(scene.size(), CELL, CELL))?);
        Ok(())
    }

    /// The frames side by side; nothing without a frame.
    ///
    /// # Errors
    /// A picture that is too large.
    pub fn strip(&self) -> Result<Option<Frame>> {
        let last = self.kept.len().saturating_sub(1);
        let chosen: Vec<&Frame> = if self.kept.len() <= FILM {
            self.kept.iter().collect()
        } else {
            (0..FILM).filter_map(|k| self.kept.get((k * last + (FILM - 1) / 2) / (FILM - 1))).collect()
        };
        sheet(&chosen, ACROSS)
    }
}

/// Frames of one size side by side, `across` of them in a row; nothing without a frame.
///
/// # Errors
/// A picture that is too large.
pub fn sheet(frames: &[&Frame], across: usize) -> Result<Option<Frame>> {
    let Some(first) = frames.first() else { return Ok(None) };
    let [width, height] = first.size();
    let side = |count: usize, side: usize| u16::try_from(count * (side + GAP) - GAP).unwrap_or(0);
    let rows = frames.len().div_ceil(across);
    let mut sheet = Frame::new([side(across.min(frames.len()), width), side(rows, height)], INK)?;
    for (k, frame) in frames.iter().enumerate() {
        sheet.put(frame, [(k % across) * (width + GAP), (k / across) * (height + GAP)]);
    }
    Ok(Some(sheet))
}

/// A frame as a picture of a page, with the bytes of its file.
///
/// # Errors
/// A frame that cannot be encoded.
pub fn pictured(title: &str, file: &str, drawn: &Frame) -> zerre_vision::Result<(Picture, Vec<u8>)> {
    let [width, height] = drawn.size();
    let bytes = png(&Image::new(width, height, drawn.rgb())?)?;
    // Both fit: frames are made of such sizes.
    let size = [width, height].map(|side| u16::try_from(side).unwrap_or(u16::MAX));
    Ok((Picture { title: title.to_owned(), file: file.to_owned(), size }, bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene<'a>(
        frame: &'a zerre_vision::Frame,
        estimate: &'a Estimate,
        particles: &'a [Particle],
    ) -> Scene<'a> {
        let truth = Some(Rect { x: 60.0, y: 40.0, width: 20.0, height: 20.0 });
        Scene { frame, index: 3, truth, estimate, particles }
    }

    fn estimate(p_lost: f64) -> Estimate {
        let bounds = Rect { x: 10.0, y: 30.0, width: 20.0, height: 30.0 };
        Estimate { bounds, covariance: [[1.0, 0.0], [0.0, 1.0]], score: 1.0, p_lost }
    }

    /// Boxes, particles and the flag are where and as they should be, at twice the size.
    #[test]
    fn everything_is_drawn_in_its_place() {
        let frame = zerre_vision::Frame::filled(100, 80, [90; 3]);
        let particles = [
            Particle { centre: [50.5, 70.5], weight: 0.01 },
            Particle { centre: [40.5, 70.5], weight: 0.99 },
        ];
        let draw = |p_lost: f64| scene(&frame, &estimate(p_lost), &particles).draw([200, 160]).unwrap().rgb();
        let sound = draw(0.1);
        let at = |picture: &[[u8; 3]], x: usize, y: usize| picture[200 * y + x];
        let rgb = |colour: Colour| [colour[0], colour[1], colour[2]];
        assert_eq!((at(&sound, 20, 90), at(&sound, 50, 150)), (rgb(BOX), [90; 3]));
        assert_eq!(at(&sound, 81, 141), rgb(WEIGHTS[4]));
        assert!(at(&sound, 101, 141)[1] < 40, "the lightest is dark");
        let count =
            |picture: &[[u8; 3]], colour: Colour| picture.iter().filter(|p| **p == rgb(colour)).count();
        let lost = draw(0.9);
        assert_eq!((count(&sound, LOST), count(&lost, BOX)), (0, 0));
        assert!(count(&lost, LOST) > 20 && count(&sound, TRUTH) > 20);
    }

    #[test]
    fn a_film_has_a_dozen_frames_of_any_video() {
        let estimate = estimate(0.0);
        for count in [0, 1, 5, 12, 13, 48, 49, 100, 1000] {
            let mut film = Film::default();
            for k in 0..count {
                let frame = zerre_vision::Frame::filled(60, 30, [(k % 200) as u8; 3]);
                film.see(&scene(&frame, &estimate, &[])).unwrap();
            }
            assert!(film.kept.len() <= KEPT);
            assert!(count < FILM || film.kept.len() >= FILM, "{count}: {}", film.kept.len());
            let size = film.strip().unwrap().map(|strip| strip.size());
            let rows = count.min(FILM).div_ceil(ACROSS);
            let expected = (count > 0).then(|| [304 * count.min(ACROSS) - 4, 154 * rows - 4]);
            assert_eq!(size, expected, "{count}");
        }
    }

    #[test]
    fn sizes_keep_their_proportions() {
        assert_eq!(shown((128, 96), 320, 1920), [320, 240]);
        assert_eq!(shown((640, 480), 320, 1920), [640, 480]);
        assert_eq!(shown((3840, 2160), 320, 1920), [1920, 1080]);
    }
}
