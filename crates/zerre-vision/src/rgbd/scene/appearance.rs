//! What differs from clip to clip: the person, the clothes, the light, the room.

use super::settings::{Purpose, SceneSettings};
use super::space::{Point, unit};
use crate::texture::Texture;
use serde::Serialize;
use std::f64::consts::TAU;
use zerre::math::Real;
use zerre::rng::{self, Draws, Stream};

/// Draws values from ranges of which a clip to test on and one to calibrate on have different cells.
#[derive(Clone, Debug)]
pub(super) struct Picker {
    draws: Draws,
    offset: f64,
}

impl Picker {
    pub(super) fn new(stream: Stream, purpose: Purpose, index: u32) -> Picker {
        let offset = match purpose {
            Purpose::Test => 0.0,
            Purpose::Calibration => 1.0,
        };
        Picker { draws: stream.draws(rng::Purpose::Prior, 0, index), offset }
    }

    /// From `low` to `high`. Cells have margins, so that values of different ones are not next to each other.
    pub(super) fn value(&mut self, low: f64, high: f64) -> f64 {
        let cell = 2.0 * (4.0 * self.draws.uniform()).floor() + self.offset;
        low + (high - low) * (cell + 0.05 + 0.9 * self.draws.uniform()) / 8.0
    }

    pub(super) fn draws(&mut self) -> &mut Draws {
        &mut self.draws
    }
}

/// A movement along one axis: sums of these are smooth and never repeat within a clip.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Wave {
    /// Millimetres, radians, or a share.
    pub amplitude: f64,
    /// Cycles per second.
    pub hz: f64,
    /// At time 0, in cycles.
    pub phase: f64,
}

impl Wave {
    fn new(picker: &mut Picker, amplitude: [f64; 2], hz: [f64; 2]) -> Wave {
        Wave {
            amplitude: picker.value(amplitude[0], amplitude[1]),
            hz: picker.value(hz[0], hz[1]),
            phase: picker.value(0.0, 1.0),
        }
    }

    /// At a time.
    pub(super) fn at(&self, seconds: f64) -> f64 {
        self.amplitude * Real::sin_cos(TAU * (self.hz * seconds + self.phase)).0
    }
}

/// What differs from clip to clip. Lengths in mm, angles in radians, colours from 0 to 255.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Appearance {
    /// Size of the person, as a share of 1.75 m.
    pub height: f64,
    /// Width of limbs and trunk, as a share of a usual one.
    pub girth: f64,
    /// Distance of the person from the camera.
    pub distance: f64,
    /// The person's place to the right of the camera's axis.
    pub aside: f64,
    /// Where the person is turned to, from the camera.
    pub turn: f64,
    /// Colour of the skin.
    pub skin: [f64; 3],
    /// Colour of what covers trunk and arms.
    pub shirt: [f64; 3],
    /// Strength of its texture, levels.
    pub weave: f64,
    /// Share of its colour that its stripes have.
    pub stripes: f64,
    /// Colour of what covers the legs.
    pub trousers: [f64; 3],
    /// Colour of the hair.
    pub hair: [f64; 3],
    /// Where the light comes from: of length 1, from things to the lamp.
    pub light: Point,
    /// Share of the light that comes from everywhere.
    pub ambient: f64,
    /// Distance of the wall behind the person from the camera.
    pub wall: f64,
    /// Angle of that wall against the picture.
    pub wall_turn: f64,
    /// Its colour.
    pub wall_colour: [f64; 3],
    /// Height of the camera above the floor.
    pub floor: f64,
    /// Colour of the floor.
    pub floor_colour: [f64; 3],
    /// Movement of the right hand to the right, downwards and away from the camera, two waves each.
    pub hand: [[Wave; 2]; 3],
    /// How it turns about the forearm.
    pub roll: Wave,
    /// Movement of the left hand along the same axes.
    pub left: [Wave; 3],
    /// How the person sways to the right.
    pub sway: Wave,
    /// How the light goes up and down, as a share of the wanted drift.
    pub drift: Wave,
}

impl Appearance {
    pub(super) fn new(settings: &SceneSettings, stream: Stream) -> Appearance {
        let picker = &mut Picker::new(stream, settings.purpose, 0);
        let tone = picker.value(0.0, 1.0);
        let warmth = picker.value(-8.0, 8.0);
        let mix = |dark: f64, bright: f64| dark + tone * (bright - dark);
        let skin = [mix(108.0, 226.0) + warmth, mix(72.0, 178.0), mix(54.0, 150.0) - warmth];
        // Not the hues of skin.
        let shirt = colour(picker.value(0.17, 0.92), picker.value(0.35, 0.9), picker.value(0.3, 0.75));
        let trousers = colour(picker.value(0.5, 0.75), picker.value(0.2, 0.7), picker.value(0.15, 0.4));
        let hair = colour(picker.value(0.05, 0.1), picker.value(0.2, 0.7), picker.value(0.08, 0.4));
        let (aside, above) = (picker.value(-0.9, 0.9), picker.value(0.5, 1.1));
        let light = unit([aside, -above, -1.0]);
        let wall_colour = colour(picker.value(0.08, 0.6), picker.value(0.02, 0.12), picker.value(0.88, 0.99));
        let floor_colour = colour(picker.value(0.04, 0.12), picker.value(0.2, 0.5), picker.value(0.35, 0.6));
        let mut wave = |amplitude, hz| Wave::new(picker, amplitude, hz);
        let hand = [
            [wave([170.0, 260.0], [0.3, 0.5]), wave([60.0, 110.0], [0.55, 0.8])],
            [wave([150.0, 240.0], [0.25, 0.45]), wave([50.0, 90.0], [0.5, 0.8])],
            [wave([40.0, 90.0], [0.3, 0.5]), wave([15.0, 35.0], [0.5, 0.8])],
        ];
        let roll = wave([0.3, 0.9], [0.2, 0.5]);
        let left =
            [wave([30.0, 70.0], [0.2, 0.5]), wave([40.0, 90.0], [0.2, 0.5]), wave([20.0, 60.0], [0.2, 0.5])];
        let sway = wave([8.0, 25.0], [0.15, 0.35]);
        let drift = wave([0.8, 1.0], [0.2, 0.4]);
        Appearance {
            height: picker.value(0.92, 1.06),
            girth: picker.value(0.88, 1.12),
            distance: picker.value(1900.0, 2200.0),
            aside: picker.value(-90.0, 130.0),
            turn: picker.value(-0.2, 0.2),
            skin,
            shirt,
            weave: picker.value(6.0, 26.0),
            stripes: picker.value(0.0, 0.35),
            trousers,
            hair,
            light,
            ambient: picker.value(0.45, 0.65),
            wall: picker.value(2750.0, 3500.0),
            wall_turn: picker.value(-0.12, 0.12),
            wall_colour,
            floor: picker.value(1120.0, 1260.0),
            floor_colour,
            hand,
            roll,
            left,
            sway,
            drift,
        }
    }
}

/// From hue, saturation and value, 0 to 1 each.
pub(super) fn colour(hue: f64, saturation: f64, value: f64) -> [f64; 3] {
    let sector = 6.0 * (hue - hue.floor());
    [5.0, 3.0, 1.0].map(|shift| {
        let k = (shift + sector) % 6.0;
        let fall = k.min(4.0 - k).clamp(0.0, 1.0);
        255.0 * value * (1.0 - saturation * fall)
    })
}

/// Cloth: a texture that repeats every 512 mm, at 2 mm.
#[derive(Clone, Debug)]
pub(super) struct Cloth {
    pixels: Vec<[f32; 3]>,
}

const CLOTH: i32 = 256;

impl Cloth {
    pub(super) fn new(draws: &mut Draws, base: [f64; 3], weave: f64, stripes: f64) -> Cloth {
        let mut texture = Texture::new(draws, &[(16.0, weave), (8.0, weave)]);
        texture.base = base;
        let pixel = |i: i32| {
            let (x, y) = (f64::from(i % CLOTH), f64::from(i / CLOTH));
            let share = if (i / CLOTH / 12) % 2 == 0 { 1.0 } else { 1.0 - stripes };
            texture.at(2.0 * x, 2.0 * y).map(|v| (share * v).clamp(0.0, 255.0) as f32)
        };
        Cloth { pixels: (0..CLOTH * CLOTH).map(pixel).collect() }
    }

    /// The colour at a place, mm.
    #[inline]
    pub(super) fn at(&self, x: f64, y: f64) -> [f32; 3] {
        let (column, row) = ((0.5 * x) as i32 & (CLOTH - 1), (0.5 * y) as i32 & (CLOTH - 1));
        self.pixels[(row * CLOTH + column) as usize]
    }
}
