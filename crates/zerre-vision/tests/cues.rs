//! The cues of colour and depth on drawn bodies whose hand is known.

use zerre::Time;
use zerre::rng::{Purpose, Stream};
use zerre_vision::rgbd::cue::{ArmEnd, ColourCue, Light, Room, Search, View, light};
use zerre_vision::rgbd::{Depth, Intrinsics, NO_DEPTH, RgbdFrame};
use zerre_vision::{Frame, Image};

const SIZE: (usize, usize) = (320, 400);
const LENS: Intrinsics = Intrinsics { focal: [525.0, 525.0], principal: [159.5, 199.5] };
const WALL: [u8; 3] = [150, 150, 140];
const CLOTH: [u8; 3] = [40, 50, 120];
const SKIN: [u8; 3] = [200, 140, 110];

/// An arm of 24 pixels' width along a line; its depth goes along too. The last 30 pixels are the hand.
struct Arm {
    from: [f64; 3],
    to: [f64; 3],
}

impl Arm {
    /// How far along the line a pixel is, where it is on the arm: pixels from the end, and depth.
    fn at(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        let [dx, dy, dz] = [0, 1, 2].map(|k| self.to[k] - self.from[k]);
        let length = dx.hypot(dy);
        let along = ((x - self.from[0]) * dx + (y - self.from[1]) * dy) / length;
        let off = ((x - self.from[0]) * dy - (y - self.from[1]) * dx).abs() / length;
        let on = (0.0..=length).contains(&along) && off <= 12.0;
        on.then(|| (length - along, self.from[2] + dz * along / length))
    }

    /// The middle of the hand.
    fn hand(&self) -> [f64; 2] {
        let length = (self.to[0] - self.from[0]).hypot(self.to[1] - self.from[1]);
        [0, 1].map(|k| self.to[k] - 15.0 * (self.to[k] - self.from[k]) / length)
    }
}

/// A frame before its room.
struct Drawn {
    frame: RgbdFrame,
    room: Room,
    light: Light,
}

impl Drawn {
    fn new(frame: RgbdFrame, room: Frame, room_depth: Depth) -> Drawn {
        let room = Room::new(room, room_depth).unwrap();
        Drawn { light: Light::of(&frame.colour, &room), frame, room }
    }

    fn view(&self) -> View<'_> {
        let Drawn { frame, room, light } = self;
        View { colour: &frame.colour, depth: &frame.depth, room, lens: LENS, light }
    }
}

fn scene(arm: &Arm, gain: f64, noise: bool) -> Drawn {
    let mut draws = Stream::new(7).draws(Purpose::Other, 0, 0);
    let mut level = |v: u8| {
        let off = if noise { 3.0 * draws.normal() } else { 0.0 };
        (gain * f64::from(v) + off).clamp(0.0, 255.0) as u8
    };
    let mut colour = Image::filled(SIZE.0, SIZE.1, WALL.map(&mut level));
    let mut depth = Image::filled(SIZE.0, SIZE.1, 3000);
    for y in 0..SIZE.1 {
        for x in 0..SIZE.0 {
            let torso = (120..200).contains(&x) && (100..330).contains(&y);
            let (u, v) = (x as f64 + 0.5, y as f64 + 0.5);
            let (shown, z) = match arm.at(u, v) {
                Some((rest, z)) if rest < 30.0 => (SKIN, z as u16),
                Some((_, z)) => (CLOTH, z as u16),
                None if torso => (CLOTH, 2000),
                None => (WALL, 3000),
            };
            colour.row_mut(y)[x] = shown.map(&mut level);
            depth.row_mut(y)[x] = z;
        }
    }
    let frame = RgbdFrame { index: 0, name: "0".to_owned(), time: Time::ZERO, colour, depth };
    Drawn::new(frame, Image::filled(SIZE.0, SIZE.1, WALL), Image::filled(SIZE.0, SIZE.1, 3000))
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

const ASIDE: Arm = Arm { from: [190.0, 130.0, 2000.0], to: [300.0, 170.0, 1950.0] };
/// Before the chest: the silhouette has no hand.
const BEFORE: Arm = Arm { from: [195.0, 150.0, 1990.0], to: [150.0, 250.0, 1700.0] };

#[test]
fn the_arm_ends_at_the_hand() {
    for arm in [ASIDE, BEFORE] {
        let scene = scene(&arm, 1.0, false);
        let found = ArmEnd::default().candidates(&scene.view(), None);
        let best = found.iter().map(|r| distance(r.at, arm.hand())).fold(f64::INFINITY, f64::min);
        // A palm is sought 110 mm from the tip, about 29 pixels of this arm: 14 from the middle of its last 30. Half a
        // cell and what the last cells' edges lack of it are added.
        assert!(best < 20.0, "{found:?} {:?}", arm.hand());
    }
}

#[test]
fn colours_show_the_hand_in_any_light() {
    let first = scene(&ASIDE, 1.0, true);
    let mut cue = ColourCue::default();
    assert!(cue.colours.is_empty());
    let hand = ASIDE.hand();
    let search = |at: [f64; 2]| Search { at, side: 141, step: 1, depth: Some([1950.0, 30.0]) };
    assert!(cue.candidates(&first.view(), &search(hand), 4).is_empty(), "nothing is known of it");
    cue.colours.learn(&first.view(), hand, 10.5, Some(1955.0));
    for (arm, gain) in [(ASIDE, 1.0), (ASIDE, 0.75), (BEFORE, 1.25)] {
        let scene = scene(&arm, gain, true);
        let depth = if gain > 1.0 { 1720.0 } else { 1955.0 };
        let hand = arm.hand();
        let search = Search { depth: Some([depth, 30.0]), ..search([hand[0] + 20.0, hand[1] - 10.0]) };
        let found = cue.candidates(&scene.view(), &search, 4);
        assert!(!found.is_empty() && distance(found[0].at, hand) < 3.0, "{gain}: {found:?} {hand:?}");
        assert!((found[0].depth_mm.unwrap() - depth).abs() < 60.0);
    }
}

/// Half the room is a person's: the light is the room's all the same.
#[test]
fn light_is_measured_beside_the_person() {
    for gain in [0.75, 1.0, 1.3] {
        let Drawn { frame, room, .. } = scene(&BEFORE, gain, true);
        for found in light(&frame.colour, room.colour()) {
            // Levels are cut to whole ones: half a level of 150 at most, beside the noise of a median.
            assert!((f64::from(found) - gain).abs() < 0.01, "{found} {gain}");
        }
    }
}

#[test]
fn nothing_is_found_where_nothing_is() {
    let Drawn { frame, room, .. } = scene(&ASIDE, 1.0, false);
    let (room, room_depth) = (room.colour().clone(), room.depth().clone());
    let nothing = Depth::filled(SIZE.0, SIZE.1, NO_DEPTH);
    let search = Search { at: [-50.0, 900.0], side: 141, step: 1, depth: Some([2000.0, 50.0]) };
    let without_depth = RgbdFrame { depth: nothing.clone(), ..frame.clone() };
    let only_room = RgbdFrame { colour: room.clone(), depth: room_depth.clone(), ..frame.clone() };
    let scenes = [
        Drawn::new(without_depth, room.clone(), room_depth.clone()),
        Drawn::new(frame, room.clone(), nothing),
        Drawn::new(only_room, room, room_depth),
    ];
    for scene in &scenes {
        assert!(ArmEnd::default().candidates(&scene.view(), None).is_empty());
        let mut cue = ColourCue::default();
        cue.colours.learn(&scene.view(), [400.0, -3.0], 10.0, None);
        assert!(cue.candidates(&scene.view(), &search, 4).is_empty());
    }
}
