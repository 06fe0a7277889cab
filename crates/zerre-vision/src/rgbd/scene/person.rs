//! A person: where the joints are at a time, and the bodies that limbs are drawn as.

use super::appearance::Appearance;
use super::settings::{AROUND, GOING, SceneSettings};
use super::shape::Shape;
use super::space::{
    Point, across, add, along, between, cross, dot, length, smooth, sub, times, turned, unit,
};
use zerre::math::Real;
use zerre::rng::Draws;

/// What a body belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Limb {
    /// The right hand.
    Hand,
    /// The right forearm, which is before or behind its hand whatever this does.
    Forearm,
    /// The rest.
    Rest,
}

/// What it looks like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Surface {
    Skin,
    /// Skin, hair, eyes and mouth.
    Head,
    Shirt,
    Trousers,
    /// Of the arm, these shares of its length from the shoulder.
    Arm([f64; 2]),
}

/// A body of the person.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub(super) shape: Shape,
    pub(super) surface: Surface,
    pub(super) limb: Limb,
}

/// An arm: shoulder, elbow and the middle of the palm, camera frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Arm {
    pub(super) shoulder: Point,
    pub(super) elbow: Point,
    pub(super) palm: Point,
}

/// Where the joints are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pose {
    pelvis: Point,
    pub(super) head: Point,
    pub(super) right: Arm,
    pub(super) left: Arm,
    roll: f64,
}

/// A person who moves. Lengths of the body are for 1.75 m; x to the right in the picture, y down, z away from
/// the camera, from the middle of the pelvis.
#[derive(Clone, Debug)]
pub(super) struct Person {
    looks: Appearance,
    left_motion: f64,
    /// Middle of the right hand's movement.
    middle: Point,
    /// When the hand sets out to the back, how long it goes and how long it stays, seconds.
    behind: Option<[f64; 3]>,
}

const UPPER: f64 = 290.0;
/// From the elbow to the middle of the palm, which lies in the forearm's direction.
const FORE: f64 = 335.0;
const WRIST: f64 = 255.0;
const SHOULDER: Point = [185.0, -475.0, 0.0];
const HEAD: Point = [0.0, -690.0, -15.0];
/// Where the hand is behind the back, and beside the body on its way.
const BACK: Point = [-15.0, -190.0, 165.0];
const BESIDE: Point = [-390.0, -60.0, -40.0];

impl Person {
    pub(super) fn new(settings: &SceneSettings, looks: &Appearance, draws: &mut Draws) -> Person {
        let behind = (settings.behind_back > 0).then(|| {
            let stay = settings.behind_back;
            let spare = settings.frames.saturating_sub(stay + 2 * (GOING + AROUND));
            let first = AROUND as f64 + (spare as f64 * draws.uniform()).floor();
            [first, GOING as f64, stay as f64].map(|frames| frames / settings.rate_hz)
        });
        let left_motion = settings.left_hand;
        let mut person = Person { looks: looks.clone(), left_motion, middle: [0.0, -340.0, -300.0], behind };
        // As far to the side as the wanted share of frames needs to be before the body.
        let moved = |x: f64| {
            let mut moved = person.clone();
            moved.middle[0] = x;
            moved
        };
        let miss = |x: &f64| (moved(*x).overlap(settings) - settings.overlap).abs();
        let best = |middle: f64, step: f64| {
            let tried = (-4..=4).map(|k| middle + step * f64::from(k)).map(|x| (x, miss(&x)));
            tried.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(middle, |(x, _)| x)
        };
        person.middle[0] = best(best(-220.0, 64.0), 14.0);
        person
    }

    /// Share of the frames, but for those on the way behind the back, in which half of the hand is before the
    /// body.
    fn overlap(&self, settings: &SceneSettings) -> f64 {
        let (mut count, mut over) = (0_u32, 0_u32);
        for k in 0..settings.frames {
            let seconds = k as f64 / settings.rate_hz;
            if self.stage(seconds) > 0.0 {
                continue;
            }
            let pose = self.pose(seconds);
            let parts = self.parts(&pose);
            let (hand, rest): (Vec<Part>, Vec<Part>) =
                parts.into_iter().partition(|part| part.limb == Limb::Hand);
            let rest: Vec<_> =
                rest.iter().filter(|part| part.limb == Limb::Rest).map(|part| part.shape.ready()).collect();
            let points = hand.iter().flat_map(|part| part.shape.hull().0);
            let before =
                points.filter(|[x, y, z]| rest.iter().any(|body| body.hit([x / z, y / z, 1.0]).is_some()));
            count += 1;
            over += u32::from(before.count() >= hand.len());
        }
        f64::from(over) / f64::from(count.max(1))
    }

    /// The free movement of the right hand, from the pelvis.
    fn way(&self, seconds: f64) -> Point {
        let wave = |axis: usize| -> f64 { self.looks.hand[axis].iter().map(|wave| wave.at(seconds)).sum() };
        add(self.middle, [wave(0), wave(1), wave(2)])
    }

    /// How far behind the back it is: 0 before the person, 1 beside, 2 behind.
    fn stage(&self, seconds: f64) -> f64 {
        let Some([first, going, stay]) = self.behind else { return 0.0 };
        let (out, back) = (seconds - first, first + 2.0 * going + stay - seconds);
        2.0 * (out.min(back) / going).clamp(0.0, 1.0)
    }

    pub(super) fn pose(&self, seconds: f64) -> Pose {
        let looks = &self.looks;
        let size = looks.height;
        let pelvis = [looks.aside + looks.sway.at(seconds), 0.5 * looks.floor - 350.0 * size, looks.distance];
        let body = |point: Point| add(pelvis, turned(times(point, size), looks.turn));
        let bare = |point: Point| add(pelvis, times(point, size));
        let stage = self.stage(seconds);
        let front = between(bare(self.way(seconds)), body(BESIDE), smooth(stage));
        let target = between(front, body(BACK), smooth(stage - 1.0));
        // Elbows hang down and out; of a hand behind the back, out and back.
        let hang = unit([-0.55, 0.8, 0.25]);
        let pole = between(hang, [-0.9, 0.2, 0.45], smooth(stage - 1.0));
        let [x, y, z] = SHOULDER;
        let right = arm(body([-x, y, z]), target, size, turned(pole, looks.turn));
        let away = |axis: usize| self.left_motion * looks.left[axis].at(seconds);
        let rest = add([290.0, -40.0, -150.0], [away(0), away(1), away(2)]);
        let left = arm(body(SHOULDER), body(rest), size, turned([0.6, 0.5, 0.5], looks.turn));
        Pose { pelvis, head: body(HEAD), right, left, roll: looks.roll.at(seconds) }
    }

    /// The bodies that are drawn.
    pub(super) fn parts(&self, pose: &Pose) -> Vec<Part> {
        let looks = &self.looks;
        let (size, girth) = (looks.height, looks.height * looks.girth);
        let body = |point: Point| add(pose.pelvis, turned(times(point, size), looks.turn));
        let upright =
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| turned(axis, looks.turn));
        let round = |centre: Point, radii: Point, surface| {
            let radii = [radii[0] * girth, radii[1] * size, radii[2] * girth];
            let shape = Shape::Ellipsoid { centre: body(centre), axes: upright, radii };
            Part { shape, surface, limb: Limb::Rest }
        };
        let limb = |ends: [Point; 2], radii: [f64; 2], surface| {
            let shape = Shape::Cone { ends, radii: radii.map(|r| r * girth) };
            Part { shape, surface, limb: Limb::Rest }
        };
        let mut parts = Vec::with_capacity(40);
        parts.push(round([0.0; 3], [165.0, 130.0, 110.0], Surface::Trousers));
        parts.push(round([0.0, -190.0, 0.0], [150.0, 210.0, 108.0], Surface::Shirt));
        parts.push(round([0.0, -350.0, 0.0], [178.0, 185.0, 118.0], Surface::Shirt));
        let across = [[-140.0, -480.0, 0.0], [140.0, -480.0, 0.0]].map(body);
        parts.push(limb(across, [62.0, 61.0], Surface::Shirt));
        parts.push(limb([[0.0, -510.0, 0.0], [0.0, -620.0, -12.0]].map(body), [50.0, 47.0], Surface::Skin));
        let head = Shape::Ellipsoid {
            centre: pose.head,
            axes: upright,
            radii: [76.0, 108.0, 96.0].map(|r| r * size),
        };
        parts.push(Part { shape: head, surface: Surface::Head, limb: Limb::Rest });
        for side in [-1.0, 1.0] {
            let joint = |x: f64, y, z| body([side * x, y, z]);
            let (hip, knee, ankle) =
                (joint(92.0, 45.0, 0.0), joint(105.0, 480.0, -12.0), joint(112.0, 880.0, 15.0));
            parts.push(limb([hip, knee], [90.0, 62.0], Surface::Trousers));
            parts.push(limb([knee, ankle], [61.0, 45.0], Surface::Trousers));
        }
        let bend = UPPER / (UPPER + WRIST);
        for (arm, own) in [(pose.right, true), (pose.left, false)] {
            let wrist = between(arm.elbow, arm.palm, WRIST / FORE);
            parts.push(limb([arm.shoulder, arm.elbow], [58.0, 44.0], Surface::Arm([0.0, bend])));
            let mut fore = limb([arm.elbow, wrist], [43.0, 29.0], Surface::Arm([bend, 1.0]));
            if own {
                fore.limb = Limb::Forearm;
            }
            parts.push(fore);
            self.hand(arm, own, pose.roll, &mut parts);
        }
        parts
    }

    /// A palm, four fingers and a thumb.
    fn hand(&self, arm: Arm, own: bool, roll: f64, parts: &mut Vec<Part>) {
        let size = self.looks.height;
        let ahead = unit(sub(arm.palm, arm.elbow));
        // The back of the hand towards the camera, turned about the forearm; of a forearm along the axis,
        // upwards.
        let towards = across([0.0, -0.2, -1.0], ahead);
        let face = if length(towards) > 0.2 { unit(towards) } else { unit(across([0.0, -1.0, 0.0], ahead)) };
        let aside = cross(ahead, face);
        let (s, c) = Real::sin_cos(roll);
        let (face, aside) = (along(times(face, c), aside, s), along(times(aside, c), face, -s));
        let place = |forward: f64, sideways: f64, out: f64| {
            along(along(along(arm.palm, ahead, size * forward), aside, size * sideways), face, size * out)
        };
        let limb = if own { Limb::Hand } else { Limb::Rest };
        let mut push = |shape| parts.push(Part { shape, surface: Surface::Skin, limb });
        push(Shape::Ellipsoid {
            centre: arm.palm,
            axes: [ahead, aside, face],
            radii: [54.0, 44.0, 18.0].map(|r| size * r),
        });
        for (sideways, long) in [(-29.0, 62.0), (-10.0, 76.0), (10.0, 80.0), (29.0, 70.0)] {
            let ends = [place(34.0, sideways, 0.0), place(34.0 + long, 1.25 * sideways, -0.25 * long)];
            push(Shape::Cone { ends, radii: [10.5 * size, 8.0 * size] });
        }
        let ends = [place(-22.0, 30.0, 0.0), place(24.0, 68.0, -12.0)];
        push(Shape::Cone { ends, radii: [13.0 * size, 9.0 * size] });
    }
}

/// Shoulder, elbow and palm of an arm that reaches for a target with its elbow towards `pole`.
fn arm(shoulder: Point, target: Point, size: f64, pole: Point) -> Arm {
    let (upper, fore) = (UPPER * size, FORE * size);
    let towards = unit(sub(target, shoulder));
    let reach = length(sub(target, shoulder)).clamp(0.35 * (upper + fore), 0.985 * (upper + fore));
    let palm = along(shoulder, towards, reach);
    // Where the circles around both ends meet.
    let share = (reach * reach + upper * upper - fore * fore) / (2.0 * reach);
    let out = (upper * upper - share * share).max(0.0).sqrt();
    let side = unit(across(pole, towards));
    debug_assert!(dot(side, towards).abs() < 1e-9);
    Arm { shoulder, elbow: along(along(shoulder, towards, share), side, out), palm }
}
