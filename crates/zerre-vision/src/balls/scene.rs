//! Clips of balls that are drawn: discs of known places roll over plain ground, so that detectors and trackers can be
//! held against the truth.

use crate::{Frame, Image};
use std::f64::consts::TAU;
use zerre::math::{Real, exp};
use zerre::rng::{Draws, Purpose, Stream};

/// What balls do when they meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meeting {
    /// They bounce before they touch: a strip of ground stays between them.
    Apart,
    /// They touch, and bounce as billiard balls do.
    Bounce,
    /// They pass over each other: the one with the higher number hides the other.
    Pass,
}

/// A clip to draw.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneSettings {
    /// Columns and rows.
    pub size: (usize, usize),
    /// Number of frames.
    pub frames: usize,
    /// Radii, px.
    pub radii: Vec<f64>,
    /// All balls have the same grey, and the ground is grey.
    pub grey: bool,
    /// What they do when they meet.
    pub meeting: Meeting,
    /// They are drawn to the middle, so that they meet often.
    pub gather: bool,
    /// They enter and leave: so many frames on average between two that enter. Without it all stay.
    pub arrivals: Option<f64>,
    /// Mean speed, px per frame.
    pub speed: f64,
    /// How fast it changes: standard deviation of the acceleration, px per frame squared.
    pub acceleration: f64,
    /// Half the range of each channel's noise, grey levels.
    pub noise: f64,
    /// Light falls off towards the corners by up to this share, and balls are brighter on one side.
    pub shading: f64,
}

impl Default for SceneSettings {
    /// Three balls of different size and colour that move freely and do not meet.
    fn default() -> Self {
        SceneSettings {
            size: (640, 480),
            frames: 200,
            radii: vec![28.0, 22.0, 16.0],
            grey: false,
            meeting: Meeting::Apart,
            gather: false,
            arrivals: None,
            speed: 6.0,
            acceleration: 0.5,
            noise: 4.0,
            shading: 0.0,
        }
    }
}

/// A scene that can be chosen by its name.
#[derive(Clone, Copy, Debug)]
pub struct Named {
    /// Its name.
    pub name: &'static str,
    /// What it is, in a line.
    pub about: &'static str,
    /// Makes its settings.
    pub settings: fn() -> SceneSettings,
}

fn same(count: usize) -> Vec<f64> {
    vec![20.0; count]
}

/// All of them.
pub const SCENES: &[Named] = &[
    Named {
        name: "balls-free",
        about: "pictures: three balls of different size and colour that do not meet",
        settings: SceneSettings::default,
    },
    Named {
        name: "balls-touch",
        about: "pictures: three grey balls of one size that touch and bounce",
        settings: || SceneSettings {
            radii: same(3),
            grey: true,
            meeting: Meeting::Bounce,
            gather: true,
            ..SceneSettings::default()
        },
    },
    Named {
        name: "balls-cross",
        about: "pictures: three balls of different size and colour that pass over each other",
        settings: || SceneSettings { meeting: Meeting::Pass, gather: true, ..SceneSettings::default() },
    },
    Named {
        name: "balls-cross-grey",
        about: "pictures: three grey balls of one size that pass over each other",
        settings: || SceneSettings {
            radii: same(3),
            grey: true,
            meeting: Meeting::Pass,
            gather: true,
            ..SceneSettings::default()
        },
    },
    Named {
        name: "balls-enter",
        about: "pictures: grey balls of one size enter, meet and leave",
        settings: || SceneSettings {
            radii: same(1),
            grey: true,
            meeting: Meeting::Pass,
            arrivals: Some(20.0),
            acceleration: 0.1,
            ..SceneSettings::default()
        },
    },
    Named {
        name: "balls-shade",
        about: "pictures: balls that touch in uneven light with much noise",
        settings: || SceneSettings {
            meeting: Meeting::Bounce,
            gather: true,
            noise: 14.0,
            shading: 0.35,
            ..SceneSettings::default()
        },
    },
];

/// Where a ball is in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueBall {
    /// Its number, from 1.
    pub ball: usize,
    /// Its middle, px.
    pub centre: [f64; 2],
    /// Its radius, px.
    pub radius: f64,
    /// Share of its disc that is inside the picture and not hidden.
    pub visible: f64,
}

/// A drawn clip.
#[derive(Clone, Debug)]
pub struct Scene {
    settings: SceneSettings,
    stream: Stream,
    ground: [f64; 3],
    colours: Vec<[f64; 3]>,
    truth: Vec<Vec<TrueBall>>,
}

#[derive(Clone, Copy, Debug)]
struct Body {
    ball: usize,
    radius: f64,
    at: [f64; 2],
    velocity: [f64; 2],
    push: [f64; 2],
}

/// Steps of a frame, so that fast balls do not jump over each other.
const SUBSTEPS: usize = 16;
/// Ground between balls that stay apart, px.
const GAP: f64 = 8.0;
/// Part of a push that is left after a frame.
const MEMORY: f64 = 0.9;
/// Pull to the middle, per frame squared.
const PULL: f64 = 6e-3;
/// Colours of the balls; those beyond are drawn.
const COLOURS: [[f64; 3]; 3] = [[30.0, 150.0, 60.0], [235.0, 120.0, 30.0], [170.0, 40.0, 160.0]];

fn length([x, y]: [f64; 2]) -> f64 {
    (x * x + y * y).sqrt()
}

impl Body {
    fn steer(&mut self, settings: &SceneSettings, draws: &mut Draws) {
        let kick = settings.acceleration * (1.0 - MEMORY * MEMORY).sqrt();
        for k in 0..2 {
            self.push[k] = MEMORY * self.push[k] + kick * draws.normal();
            self.velocity[k] += self.push[k];
            if settings.gather {
                let side = [settings.size.0, settings.size.1][k] as f64;
                self.velocity[k] += PULL * (0.5 * side - self.at[k]);
            }
        }
        // Speeds return to the mean one.
        let speed = length(self.velocity).max(1e-6);
        let factor = 1.0 + 0.1 * (settings.speed / speed - 1.0).clamp(-1.0, 1.0);
        self.velocity = self.velocity.map(|v| v * factor);
    }

    fn roll(&mut self, settings: &SceneSettings) {
        let sides = [settings.size.0 as f64, settings.size.1 as f64];
        for k in 0..2 {
            self.at[k] += self.velocity[k] / SUBSTEPS as f64;
            if settings.arrivals.is_none() {
                let (low, high) = (self.radius, (sides[k] - self.radius).max(self.radius));
                if self.at[k] < low {
                    self.velocity[k] = self.velocity[k].abs();
                } else if self.at[k] > high {
                    self.velocity[k] = -self.velocity[k].abs();
                }
                self.at[k] = self.at[k].clamp(low, high);
            }
        }
    }
}

/// An elastic collision of two discs whose masses are as their areas, once they are nearer than their radii and `gap`.
fn collide(a: &mut Body, b: &mut Body, gap: f64) {
    let apart = [b.at[0] - a.at[0], b.at[1] - a.at[1]];
    let distance = length(apart).max(1e-9);
    let overlap = a.radius + b.radius + gap - distance;
    if overlap <= 0.0 {
        return;
    }
    let normal = apart.map(|d| d / distance);
    let (ma, mb) = (a.radius * a.radius, b.radius * b.radius);
    let closing: f64 = (0..2).map(|k| (a.velocity[k] - b.velocity[k]) * normal[k]).sum();
    for k in 0..2 {
        if closing > 0.0 {
            let impulse = 2.0 * closing * normal[k] / (ma + mb);
            a.velocity[k] -= mb * impulse;
            b.velocity[k] += ma * impulse;
        }
        a.at[k] -= overlap * normal[k] * mb / (ma + mb);
        b.at[k] += overlap * normal[k] * ma / (ma + mb);
    }
}

impl Scene {
    /// A clip under a seed; another one has other places, ways and shades.
    pub fn new(settings: SceneSettings, seed: u64) -> Scene {
        // "balls" in ASCII.
        let stream = Stream::new(seed).fork(0x62_616c_6c73);
        let mut draws = stream.draws(Purpose::Prior, 0, 0);
        let level = 190.0 + 40.0 * draws.uniform();
        let tint = |draws: &mut Draws| if settings.grey { 0.0 } else { 16.0 * (draws.uniform() - 0.5) };
        let ground = [level + tint(&mut draws), level, level + tint(&mut draws)];
        let grey = [50.0 + 40.0 * draws.uniform(); 3];
        let truth = ways(&settings, &mut draws);
        let most = truth.iter().flatten().map(|ball| ball.ball).max().unwrap_or(0);
        let colour = |at: usize| match COLOURS.get(at) {
            _ if settings.grey => grey,
            Some(colour) => colour.map(|c| c + 20.0 * (draws.uniform() - 0.5)),
            None => std::array::from_fn(|_| 140.0 * draws.uniform()),
        };
        let colours = (0..most).map(colour).collect();
        Scene { settings, stream, ground, colours, truth }
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.truth.len()
    }

    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.truth.is_empty()
    }

    /// What was drawn.
    pub fn settings(&self) -> &SceneSettings {
        &self.settings
    }

    /// The balls of frame `k` by their numbers, as far as a part of them is inside the picture.
    pub fn truth(&self, k: usize) -> &[TrueBall] {
        self.truth.get(k).map_or(&[], Vec::as_slice)
    }

    /// Light at a place, as a share.
    fn light(&self, x: f64, y: f64) -> f64 {
        let (width, height) = self.settings.size;
        let (u, v) = (2.0 * x / width as f64 - 1.0, 2.0 * y / height as f64 - 1.0);
        1.0 - 0.5 * self.settings.shading * (u * u + v * v)
    }

    /// Frame `k`: discs are smoothed over a pixel at their rims.
    pub fn frame(&self, k: usize) -> Frame {
        let (width, height) = self.settings.size;
        let mut picture = Image::filled(width, height, self.ground);
        if self.settings.shading > 0.0 {
            picture = Image::from_fn(width, height, |x, y| {
                let light = self.light(x as f64 + 0.5, y as f64 + 0.5);
                self.ground.map(|level| level * light)
            });
        }
        for ball in self.truth(k) {
            let ([cx, cy], r) = (ball.centre, ball.radius);
            let range = |c: f64, side: usize| {
                let end = |at: f64| at.clamp(0.0, side as f64) as usize;
                end((c - r - 1.0).floor())..end((c + r + 1.0).ceil())
            };
            let colour = self.colours.get(ball.ball - 1).copied().unwrap_or_default();
            for y in range(cy, height) {
                for x in range(cx, width) {
                    let [dx, dy] = [x as f64 + 0.5 - cx, y as f64 + 0.5 - cy];
                    let share = (r - length([dx, dy]) + 0.5).clamp(0.0, 1.0);
                    let side = 1.0 - self.settings.shading * (dx + dy) / (2.0 * r);
                    let light = self.light(x as f64 + 0.5, y as f64 + 0.5) * side;
                    let pixel = &mut picture.row_mut(y)[x];
                    *pixel = [0, 1, 2].map(|c| pixel[c] + share * (colour[c] * light - pixel[c]));
                }
            }
        }
        let noise = self.settings.noise;
        let mut draws = self.stream.draws(Purpose::Propose, k as u64, 0);
        picture.map(|pixel| {
            let mut levels = *pixel;
            if noise > 0.0 {
                // Three numbers of ten bits are in one word.
                let word = draws.next_u32();
                for (c, level) in levels.iter_mut().enumerate() {
                    let share = f64::from((word >> (10 * c)) & 1023) / 511.5 - 1.0;
                    *level += noise * share;
                }
            }
            levels.map(|level| level.round().clamp(0.0, 255.0) as u8)
        })
    }
}

/// The ways of all balls.
fn ways(settings: &SceneSettings, draws: &mut Draws) -> Vec<Vec<TrueBall>> {
    let mut bodies = Vec::new();
    if settings.arrivals.is_none() {
        for (at, radius) in settings.radii.iter().enumerate() {
            bodies.push(place(at + 1, *radius, &bodies, settings, draws));
        }
    }
    let (mut ball, mut truth) = (bodies.len(), Vec::with_capacity(settings.frames));
    let gap = match settings.meeting {
        Meeting::Apart => Some(GAP),
        Meeting::Bounce => Some(0.0),
        Meeting::Pass => None,
    };
    for _ in 0..settings.frames {
        if let Some(between) = settings.arrivals
            && draws.uniform() < 1.0 - exp(-1.0 / between)
        {
            let radius = settings.radii[ball % settings.radii.len()];
            ball += 1;
            bodies.push(arrival(ball, radius, settings, draws));
        }
        bodies.iter_mut().for_each(|body| body.steer(settings, draws));
        for _ in 0..SUBSTEPS {
            bodies.iter_mut().for_each(|body| body.roll(settings));
            let Some(gap) = gap else { continue };
            for i in 1..bodies.len() {
                let (before, after) = bodies.split_at_mut(i);
                before.iter_mut().for_each(|body| collide(body, &mut after[0], gap));
            }
        }
        let outside = |body: &Body| {
            let sides = [settings.size.0 as f64, settings.size.1 as f64];
            (0..2).any(|k| body.at[k] < -body.radius || body.at[k] > sides[k] + body.radius)
        };
        bodies.retain(|body| !outside(body));
        let seen = |(at, body): (usize, &Body)| TrueBall {
            ball: body.ball,
            centre: body.at,
            radius: body.radius,
            visible: visible(body, &bodies[at + 1..], settings.size),
        };
        truth.push(bodies.iter().enumerate().map(seen).collect());
    }
    truth
}

/// A body at a free place that goes in any direction.
fn place(ball: usize, radius: f64, others: &[Body], settings: &SceneSettings, draws: &mut Draws) -> Body {
    let turn = draws.uniform();
    let (sin, cos) = Real::sin_cos(TAU * turn);
    let velocity = [settings.speed * cos, settings.speed * sin];
    let mut body = Body { ball, radius, at: [0.0; 2], velocity, push: [0.0; 2] };
    // A full picture has no free place: then they push each other away.
    for _ in 0..200 {
        let sides = [settings.size.0 as f64, settings.size.1 as f64];
        body.at = sides.map(|side| radius + (side - 2.0 * radius).max(0.0) * draws.uniform());
        let free = |other: &Body| {
            length([other.at[0] - body.at[0], other.at[1] - body.at[1]]) > other.radius + radius + 3.0 * GAP
        };
        if others.iter().all(free) {
            break;
        }
    }
    body
}

/// A body just outside a side that goes to somewhere in the middle.
fn arrival(ball: usize, radius: f64, settings: &SceneSettings, draws: &mut Draws) -> Body {
    let sides = [settings.size.0 as f64, settings.size.1 as f64];
    let (along, side) = (draws.uniform(), (4.0 * draws.uniform()) as usize);
    let edge = |high: bool, side: f64| if high { side + 0.9 * radius } else { -0.9 * radius };
    let at = match side {
        0 => [edge(false, sides[0]), along * sides[1]],
        1 => [edge(true, sides[0]), along * sides[1]],
        2 => [along * sides[0], edge(false, sides[1])],
        _ => [along * sides[0], edge(true, sides[1])],
    };
    let goal = sides.map(|side| side * (0.3 + 0.4 * draws.uniform()));
    let way = [goal[0] - at[0], goal[1] - at[1]];
    let far = length(way).max(1e-9);
    Body { ball, radius, at, velocity: way.map(|d| settings.speed * d / far), push: [0.0; 2] }
}

/// Share of a disc that is inside the picture and under none of `above`, by a grid of points.
fn visible(body: &Body, above: &[Body], (width, height): (usize, usize)) -> f64 {
    const GRID: usize = 24;
    let (mut inside, mut seen) = (0, 0);
    for i in 0..GRID * GRID {
        let offset = [i % GRID, i / GRID].map(|k| (2.0 * (k as f64 + 0.5) / GRID as f64 - 1.0) * body.radius);
        if length(offset) > body.radius {
            continue;
        }
        inside += 1;
        let [x, y] = [body.at[0] + offset[0], body.at[1] + offset[1]];
        let hidden = above.iter().any(|other| length([other.at[0] - x, other.at[1] - y]) < other.radius);
        let out = x < 0.0 || y < 0.0 || x > width as f64 || y > height as f64;
        seen += usize::from(!hidden && !out);
    }
    seen as f64 / f64::from(inside.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(name: &str, seed: u64) -> Scene {
        let named = SCENES.iter().find(|named| named.name == name).unwrap();
        Scene::new((named.settings)(), seed)
    }

    fn distances(scene: &Scene) -> Vec<f64> {
        let mut all = Vec::new();
        for k in 0..scene.len() {
            let balls = scene.truth(k);
            for (i, a) in balls.iter().enumerate() {
                for b in &balls[i + 1..] {
                    let d = [a.centre[0] - b.centre[0], a.centre[1] - b.centre[1]];
                    all.push(length(d) - a.radius - b.radius);
                }
            }
        }
        all
    }

    #[test]
    fn names_stand_once_and_scenes_differ_by_seed() {
        for named in SCENES {
            assert_eq!(SCENES.iter().filter(|other| other.name == named.name).count(), 1);
            let [one, again, other] = [1, 1, 2].map(|seed| scene(named.name, seed));
            assert_eq!(one.frame(30), again.frame(30));
            assert_ne!(one.frame(30), other.frame(30));
            assert_eq!(one.len(), 200);
        }
    }

    /// Each scene shows what its name says, under several seeds.
    #[test]
    fn meetings_are_as_they_are_called() {
        for seed in 1..=5 {
            assert!(distances(&scene("balls-free", seed)).iter().all(|d| *d > 0.5 * GAP));
            let touching = distances(&scene("balls-touch", seed));
            assert!(touching.iter().all(|d| *d > -1.0), "they do not go into each other");
            // They bounce between two frames, and are a little apart in both.
            let nearest = touching.iter().copied().fold(f64::INFINITY, f64::min);
            assert!(nearest < 3.0, "seed {seed}: they come as near as {nearest} px");
            assert!(distances(&scene("balls-cross", seed)).iter().any(|d| *d < -10.0), "seed {seed}");
            let entering = scene("balls-enter", seed);
            let (first, last) = (entering.truth(0), entering.truth(199));
            let kept = first.iter().filter(|a| last.iter().any(|b| a.ball == b.ball)).count();
            assert!(kept == 0 && (0..200).any(|k| entering.truth(k).len() > 1), "seed {seed}");
        }
    }

    #[test]
    fn what_is_visible_is_a_share() {
        let body = |x: f64| Body { ball: 1, radius: 20.0, at: [x, 50.0], velocity: [0.0; 2], push: [0.0; 2] };
        assert_eq!(visible(&body(50.0), &[], (100, 100)), 1.0);
        assert_eq!(visible(&body(50.0), &[body(50.0)], (100, 100)), 0.0);
        assert!((visible(&body(0.0), &[], (100, 100)) - 0.5).abs() < 0.03);
    }
}
