//! Clips that are drawn: an object with a texture moves over ground with a texture, and where it is and how much of it
//! can be seen is known exactly.

use crate::texture::Texture;
use crate::{Frame, Image, Rect};
use std::f64::consts::TAU;
use zerre::math::Real;
use zerre::rng::{Purpose, Stream};

/// What makes a clip hard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// Nothing: the object moves smoothly.
    Nothing,
    /// The light goes down to four tenths and comes back.
    Light,
    /// A bar stands in the way, wider than the object: it is hidden for some frames.
    Bar,
    /// The object grows to half as large again, and shrinks.
    Growth,
    /// It moves by up to a third of its size from frame to frame.
    Haste,
    /// Objects that look much like it move beside it.
    Clutter,
    /// It turns by up to forty degrees to each side, and its looks become others.
    Change,
    /// The whole picture is blurred in some frames, by up to a sixth of the object.
    Blur,
    /// It is covered for this many frames while it goes on.
    Hidden(usize),
}

/// A kind of clip that can be chosen by its name.
#[derive(Clone, Copy, Debug)]
pub struct Named {
    /// Its name.
    pub name: &'static str,
    /// What it is, in a line.
    pub about: &'static str,
    /// What makes it hard.
    pub trouble: Trouble,
}

/// All of them.
pub const CLIPS: &[Named] = &[
    Named {
        name: "clip-smooth",
        about: "pictures: an object moves smoothly over textured ground",
        trouble: Trouble::Nothing,
    },
    Named { name: "clip-light", about: "pictures: the light goes and comes back", trouble: Trouble::Light },
    Named { name: "clip-bar", about: "pictures: an object passes behind a bar", trouble: Trouble::Bar },
    Named { name: "clip-growth", about: "pictures: an object grows and shrinks", trouble: Trouble::Growth },
    Named { name: "clip-haste", about: "pictures: an object moves in leaps", trouble: Trouble::Haste },
    Named { name: "clip-clutter", about: "pictures: objects that look alike", trouble: Trouble::Clutter },
    Named {
        name: "clip-change",
        about: "pictures: an object turns and becomes another",
        trouble: Trouble::Change,
    },
    Named { name: "clip-blur", about: "pictures: some frames are blurred", trouble: Trouble::Blur },
    Named {
        name: "clip-hidden",
        about: "pictures: an object is covered for 60 frames",
        trouble: Trouble::Hidden(60),
    },
];

/// A clip.
#[derive(Clone, Debug)]
pub struct Clip {
    trouble: Trouble,
    stream: Stream,
    frames: usize,
    size: (usize, usize),
    object: (f64, f64),
    phases: [f64; 4],
    ground: Texture,
    look: Texture,
    other_look: Texture,
    cover: Texture,
    others: Vec<(Texture, [f64; 4])>,
}

/// Where the object is in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Its box, whether it can be seen or not.
    pub bounds: Rect,
    /// Share of it that can be seen.
    pub visible: f64,
}

fn sin(turn: f64) -> f64 {
    Real::sin_cos(TAU * turn).0
}

impl Clip {
    /// A clip of that many frames, 320 x 240 pixels; another seed has other colours, sizes and ways.
    pub fn new(trouble: Trouble, frames: usize, seed: u64) -> Clip {
        let stream = Stream::new(seed).fork(0x636c_6970);
        let mut draws = stream.draws(Purpose::Prior, 0, 0);
        let ground = Texture::new(&mut draws, &[(60.0, 90.0), (17.0, 70.0), (6.0, 50.0)]);
        let look = Texture::new(&mut draws, &[(14.0, 110.0), (6.0, 80.0)]);
        let other_look = Texture::near(&look, &mut draws, 0.8);
        let cover = Texture::new(&mut draws, &[(40.0, 60.0), (9.0, 60.0)]);
        let object = (28.0 + 28.0 * draws.uniform(), 28.0 + 34.0 * draws.uniform());
        let mut phases: [f64; 4] = std::array::from_fn(|_| draws.uniform());
        if trouble == Trouble::Bar {
            // Half a clip later it goes to the right through the middle: it begins beside the bar.
            let turns = (frames / 2) as f64 / 400.0;
            phases = [1.0 - turns, 0.25 - 3.1 * turns, phases[2], phases[3]];
        }
        let others = match trouble {
            Trouble::Clutter => (0..3)
                .map(|_| {
                    let near = Texture::near(&look, &mut draws, 0.6);
                    (near, std::array::from_fn(|_| draws.uniform()))
                })
                .collect(),
            _ => Vec::new(),
        };
        Clip {
            trouble,
            stream,
            frames,
            size: (320, 240),
            object,
            phases,
            ground,
            look,
            other_look,
            cover,
            others,
        }
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.frames
    }

    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.frames == 0
    }

    /// The way of an object: its centre in frame `k`.
    fn way(&self, k: usize, phases: [f64; 4]) -> [f64; 2] {
        let pace = if self.trouble == Trouble::Haste { 6.0 } else { 1.0 };
        let t = pace * k as f64 / 400.0;
        let (w, h) = (self.size.0 as f64, self.size.1 as f64);
        [
            w / 2.0 + 0.28 * w * sin(t + phases[0]) + 0.06 * w * sin(3.1 * t + phases[1]),
            h / 2.0 + 0.24 * h * sin(1.4 * t + phases[2]) + 0.06 * h * sin(2.7 * t + phases[3]),
        ]
    }

    fn scale(&self, k: usize) -> f64 {
        match self.trouble {
            Trouble::Growth => 1.0 + 0.5 * sin(0.5 * k as f64 / self.frames.max(1) as f64),
            _ => 1.0,
        }
    }

    fn light(&self, k: usize) -> f64 {
        match self.trouble {
            Trouble::Light => 1.0 - 0.6 * sin(0.5 * k as f64 / self.frames.max(1) as f64),
            _ => 1.0,
        }
    }

    /// The colours of the object at a place from its middle, in pixels of the first frame.
    fn looks(&self, k: usize, [x, y]: [f64; 2]) -> [f64; 3] {
        if self.trouble != Trouble::Change {
            return self.look.at(x, y);
        }
        let t = k as f64 / self.frames.max(1) as f64;
        let (sin, cos) = Real::sin_cos(0.7 * self::sin(t));
        let (x, y) = (cos * x - sin * y, sin * x + cos * y);
        let (a, b) = (self.look.at(x, y), self.other_look.at(x, y));
        std::array::from_fn(|c| a[c] + t * (b[c] - a[c]))
    }

    /// What covers the object in frame `k`, if anything does.
    fn covering(&self, k: usize) -> Option<Rect> {
        let middle = self.frames / 2;
        match self.trouble {
            Trouble::Bar => {
                // A standing bar where the object is in the middle of the clip.
                let [x, _] = self.way(middle, self.phases);
                let width = 1.5 * self.object.0;
                Some(Rect { x: x - width / 2.0, y: 0.0, width, height: self.size.1 as f64 })
            }
            Trouble::Hidden(length) => {
                let first = middle.saturating_sub(length / 2);
                (first..first + length).contains(&k).then(|| {
                    let centre = self.way(k, self.phases);
                    Rect::about(centre, 1.6 * self.object.0, 1.6 * self.object.1)
                })
            }
            _ => None,
        }
    }

    /// Where the object is in frame `k`.
    pub fn truth(&self, k: usize) -> Truth {
        let scale = self.scale(k);
        let bounds = Rect::about(self.way(k, self.phases), self.object.0 * scale, self.object.1 * scale);
        let hidden = self.covering(k).and_then(|cover| cover.intersection(&bounds));
        let visible = 1.0 - hidden.map_or(0.0, |hidden| hidden.area() / bounds.area());
        // The quotient of equal areas is rounded.
        Truth { bounds, visible: if visible < 1e-9 { 0.0 } else { visible } }
    }

    /// Frame `k`.
    pub fn frame(&self, k: usize) -> Frame {
        let Truth { bounds, .. } = self.truth(k);
        let (scale, light, cover) = (self.scale(k), self.light(k), self.covering(k));
        let others: Vec<(Rect, &Texture)> = self
            .others
            .iter()
            .map(|(look, phases)| (Rect::about(self.way(k, *phases), bounds.width, bounds.height), look))
            .collect();
        let inside = |bounds: &Rect, x: f64, y: f64| {
            let (dx, dy) = (x - bounds.x, y - bounds.y);
            // Sharp edges, smoothed over a pixel.
            let edge = dx.min(bounds.width - dx).min(dy).min(bounds.height - dy);
            (edge + 0.5).clamp(0.0, 1.0)
        };
        let mut picture = Image::from_fn(self.size.0, self.size.1, |x, y| {
            let (x, y) = (x as f64 + 0.5, y as f64 + 0.5);
            let mut colour = self.ground.at(x, y);
            let mut paint = |share: f64, over: [f64; 3]| {
                for c in 0..3 {
                    colour[c] += share * (over[c] - colour[c]);
                }
            };
            for (bounds, look) in &others {
                let share = inside(bounds, x, y);
                if share > 0.0 {
                    paint(share, look.at(x - bounds.x, y - bounds.y));
                }
            }
            let share = inside(&bounds, x, y);
            if share > 0.0 {
                let [cx, cy] = bounds.centre();
                paint(share, self.looks(k, [(x - cx) / scale, (y - cy) / scale]));
            }
            if let Some(cover) = &cover {
                let share = inside(cover, x, y);
                if share > 0.0 {
                    paint(share, self.cover.at(x, y));
                }
            }
            colour
        });
        let blur = if self.trouble == Trouble::Blur {
            (self.object.0 / 6.0 * (sin(k as f64 / 40.0) - 0.3).max(0.0)) as isize
        } else {
            0
        };
        if blur > 0 {
            let sharp = picture.clone();
            picture = Image::from_fn(self.size.0, self.size.1, |x, y| {
                let mut sum = [0.0; 3];
                for d in -blur..=blur {
                    let colour = sharp.at(x as isize + d, y as isize);
                    sum = std::array::from_fn(|c| sum[c] + colour[c] / (2 * blur + 1) as f64);
                }
                sum
            });
        }
        let mut draws = self.stream.draws(Purpose::Propose, k as u64, 0);
        picture.map(|colour| {
            let noise = 6.0 * (draws.uniform() - 0.5);
            colour.map(|v| (light * v + noise).round().clamp(0.0, 255.0) as u8)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_hidden_is_known() {
        let clip = Clip::new(Trouble::Hidden(60), 200, 1);
        let hidden = (0..200).filter(|k| clip.truth(*k).visible == 0.0).count();
        assert_eq!(hidden, 60);
        assert!((0..200).all(|k| (0.0..=1.0).contains(&clip.truth(k).visible)));
        let bar = Clip::new(Trouble::Bar, 200, 1);
        assert_eq!(bar.truth(100).visible, 0.0);
    }

    #[test]
    fn names_stand_once() {
        for named in CLIPS {
            assert_eq!(CLIPS.iter().filter(|other| other.name == named.name).count(), 1);
            assert_eq!(CLIPS.iter().filter(|other| other.trouble == named.trouble).count(), 1);
        }
    }

    #[test]
    fn clips_differ_and_repeat() {
        let clip = |seed| Clip::new(Trouble::Clutter, 10, seed).frame(5);
        assert_eq!(clip(1), clip(1));
        assert_ne!(clip(1), clip(2));
        let still = Clip::new(Trouble::Nothing, 10, 1);
        assert_ne!(still.frame(1), still.frame(2));
    }
}
