//! What a drawn recording is like: its person, its room and everything that goes wrong in it.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// A condition under which trackers are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Condition {
    /// A plain, light wall.
    Light,
    /// A wall full of things, some of them coloured like skin.
    Clutter,
    /// The light drifts by a fifth and changes from frame to frame.
    Flicker,
    /// The hand goes behind the back and returns.
    BehindBack,
    /// The device gives nothing for whole stretches.
    DeviceDropOut,
}

impl Condition {
    /// All of them.
    pub const ALL: [Condition; 5] = [
        Condition::Light,
        Condition::Clutter,
        Condition::Flicker,
        Condition::BehindBack,
        Condition::DeviceDropOut,
    ];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Condition::Light => "light",
            Condition::Clutter => "clutter",
            Condition::Flicker => "flicker",
            Condition::BehindBack => "behind-back",
            Condition::DeviceDropOut => "device-drop-out",
        }
    }

    /// The condition of this name.
    pub fn find(name: &str) -> Option<Condition> {
        Condition::ALL.into_iter().find(|condition| condition.name() == name)
    }
}

/// Which half of every range a clip's values are drawn from. Ranges are cut into eight cells; clips to
/// calibrate on have their values in every second one, clips to test on in the others: the two share none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Purpose {
    /// To measure what a tracker can do.
    #[default]
    Test,
    /// To choose its parameters.
    Calibration,
}

/// A drawn recording. A disturbance that is 0 is absent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SceneSettings {
    /// Columns and rows of both pictures.
    pub size: [usize; 2],
    /// Number of frames.
    pub frames: usize,
    /// Frames per second.
    pub rate_hz: f64,
    /// What the clip is for.
    pub purpose: Purpose,
    /// How much hangs on the walls: 0 plain, 1 a wall that is covered.
    pub clutter: f64,
    /// Patches of the person's skin colour on the wall.
    pub skin_patches: usize,
    /// Share of the arm's length that is clothed, from the shoulder: 1 to the wrist.
    pub sleeve: f64,
    /// Share of the frames in which the hand is before the body, about.
    pub overlap: f64,
    /// Movement of the left hand, as a share of its usual one.
    pub left_hand: f64,
    /// Frames during which the hand stays behind the back.
    pub behind_back: usize,
    /// Of the depth camera.
    pub depth: DepthSettings,
    /// Of the colour camera and the light.
    pub colour: ColourSettings,
    /// The device that reports joints.
    pub device: DeviceSettings,
    /// The people who label the hand.
    pub operators: OperatorSettings,
}

/// The depth camera of a drawn recording.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DepthSettings {
    /// Standard deviation at a distance of z mm, as a share of z², 1/mm.
    pub noise: f64,
    /// Distance between two levels at z mm, as a share of z², 1/mm; 0 gives whole millimetres.
    pub step: f64,
    /// Distance of the projector from the camera, to its right, mm: what it does not light has no depth.
    pub baseline_mm: f64,
    /// Probability of a hole in a pixel at an edge.
    pub edge_holes: f64,
    /// Mean number of spots per frame without depth.
    pub spots: f64,
    /// Share of single pixels without depth.
    pub speckle: f64,
    /// Probability that a frame has no depth at all.
    pub loss: f64,
    /// Farther things are not measured, mm.
    pub far_mm: f64,
}

/// The colour camera and the light of a drawn recording.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ColourSettings {
    /// Standard deviation, of 255 levels.
    pub noise: f64,
    /// The light goes up and down by this share over the clip.
    pub drift: f64,
    /// In some frame it changes by this share, and stays.
    pub step: f64,
    /// From frame to frame it changes by up to this share: lamps on 50 Hz mains.
    pub flicker: f64,
    /// Share of the light that the person keeps from the wall.
    pub shadow: f64,
    /// How often a pixel is averaged with its neighbours.
    pub blur: usize,
}

/// The device that reports joints.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DeviceSettings {
    /// Readings per second.
    pub rate_hz: f64,
    /// Standard deviation of its noise in each coordinate, pixels of a picture 640 wide.
    pub noise_px: f64,
    /// Correlation of the noise over a 30th of a second.
    pub correlation: f64,
    /// How late it is, in frames.
    pub lag_frames: f64,
    /// Probability per frame before the body that it takes something else for the hand.
    pub burst_probability: f64,
    /// How far off it is then, at most, pixels of a picture 640 wide; at least a third of it.
    pub burst_px: f64,
    /// For how many frames, at least and at most.
    pub burst_frames: [usize; 2],
    /// Probability that a reading is missing.
    pub loss: f64,
    /// Number of stretches without readings.
    pub drop_outs: usize,
    /// Length of each, in frames.
    pub drop_out_frames: usize,
}

/// People who label the hand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OperatorSettings {
    /// How many there are.
    pub count: usize,
    /// Standard deviation among them of each one's constant error, in each coordinate, pixels.
    pub bias_px: f64,
    /// Standard deviation of each label, in each coordinate, pixels.
    pub noise_px: f64,
}

impl Default for SceneSettings {
    fn default() -> SceneSettings {
        SceneSettings {
            size: [640, 480],
            frames: 111,
            rate_hz: 30.0,
            purpose: Purpose::Test,
            clutter: 0.0,
            skin_patches: 0,
            sleeve: 1.0,
            overlap: 0.48,
            left_hand: 1.0,
            behind_back: 0,
            depth: DepthSettings::default(),
            colour: ColourSettings::default(),
            device: DeviceSettings::default(),
            operators: OperatorSettings::default(),
        }
    }
}

impl Default for DepthSettings {
    fn default() -> DepthSettings {
        DepthSettings {
            noise: 1.5e-6,
            step: 2.9e-6,
            baseline_mm: 75.0,
            edge_holes: 0.4,
            spots: 4.0,
            speckle: 0.002,
            loss: 0.0,
            far_mm: 4500.0,
        }
    }
}

impl Default for ColourSettings {
    fn default() -> ColourSettings {
        ColourSettings { noise: 2.5, drift: 0.0, step: 0.0, flicker: 0.0, shadow: 0.3, blur: 1 }
    }
}

impl Default for DeviceSettings {
    fn default() -> DeviceSettings {
        DeviceSettings {
            rate_hz: 30.0,
            noise_px: 4.0,
            correlation: 0.8,
            lag_frames: 0.5,
            burst_probability: 0.12,
            burst_px: 55.0,
            burst_frames: [3, 8],
            loss: 0.0,
            drop_outs: 0,
            drop_out_frames: 0,
        }
    }
}

impl Default for OperatorSettings {
    fn default() -> OperatorSettings {
        OperatorSettings { count: 7, bias_px: 2.0, noise_px: 3.0 }
    }
}

/// Frames in which the hand goes behind the back, and as many in which it returns.
pub(super) const GOING: usize = 32;
/// Frames before it goes and after it is back, at least.
pub(super) const AROUND: usize = 6;

impl SceneSettings {
    /// The usual clip under a condition.
    pub fn condition(condition: Condition) -> SceneSettings {
        let mut settings = SceneSettings::default();
        match condition {
            Condition::Light => {}
            Condition::Clutter => (settings.clutter, settings.skin_patches) = (1.0, 12),
            Condition::Flicker => (settings.colour.drift, settings.colour.flicker) = (0.2, 0.05),
            Condition::BehindBack => settings.behind_back = 25,
            Condition::DeviceDropOut => {
                (settings.device.drop_outs, settings.device.drop_out_frames) = (2, 20);
            }
        }
        settings
    }

    /// A clip to choose parameters on: plain, of a person, a room, a light and a movement that no test has.
    pub fn calibration() -> SceneSettings {
        SceneSettings { purpose: Purpose::Calibration, ..SceneSettings::default() }
    }

    /// # Errors
    /// A number outside its range.
    pub fn checked(&self) -> Result<()> {
        let refuse = |what, value: f64, needs| Err(Error::OutOfRange { what, value, needs });
        let SceneSettings { depth, colour, device, operators, .. } = self;
        for side in self.size {
            if !(16..=8192).contains(&side) {
                return refuse("a side of `size`", side as f64, "it must be from 16 to 8192 pixels");
            }
        }
        if self.frames == 0 {
            return refuse("frames", 0.0, "there must be at least one");
        }
        for (what, value) in [("rate_hz", self.rate_hz), ("device.rate_hz", device.rate_hz)] {
            if !(value > 0.0 && value <= 1000.0) {
                return refuse(what, value, "it must be above 0 and at most 1000 Hz");
            }
        }
        let shares = [
            ("clutter", self.clutter),
            ("sleeve", self.sleeve),
            ("overlap", self.overlap),
            ("left_hand", self.left_hand),
            ("depth.edge_holes", depth.edge_holes),
            ("depth.speckle", depth.speckle),
            ("depth.loss", depth.loss),
            ("colour.drift", colour.drift),
            ("colour.step", colour.step),
            ("colour.flicker", colour.flicker),
            ("colour.shadow", colour.shadow),
            ("device.burst_probability", device.burst_probability),
            ("device.loss", device.loss),
        ];
        for (what, value) in shares {
            if !(0.0..=1.0).contains(&value) {
                return refuse(what, value, "it must be from 0 to 1");
            }
        }
        if !(0.0..1.0).contains(&device.correlation) {
            return refuse("device.correlation", device.correlation, "it must be at least 0 and below 1");
        }
        let lengths = [
            ("depth.noise", depth.noise, 1e-3),
            ("depth.step", depth.step, 1e-3),
            ("depth.baseline_mm", depth.baseline_mm, 500.0),
            ("depth.spots", depth.spots, 1000.0),
            ("depth.far_mm", depth.far_mm, 60_000.0),
            ("colour.noise", colour.noise, 100.0),
            ("colour.blur", colour.blur as f64, 50.0),
            ("device.noise_px", device.noise_px, 1000.0),
            ("device.lag_frames", device.lag_frames, 100.0),
            ("device.burst_px", device.burst_px, 1000.0),
            ("operators.bias_px", operators.bias_px, 1000.0),
            ("operators.noise_px", operators.noise_px, 1000.0),
            ("operators.count", operators.count as f64, 1000.0),
            ("skin_patches", self.skin_patches as f64, 1000.0),
        ];
        for (what, value, most) in lengths {
            if !(0.0..=most).contains(&value) {
                return refuse(what, value, "it must not be negative, and not absurdly large");
            }
        }
        let [least, most] = device.burst_frames;
        if least == 0 || most < least {
            return refuse(
                "device.burst_frames",
                least as f64,
                "the least must be at least 1, at most the second",
            );
        }
        let room = self.behind_back + 2 * (GOING + AROUND);
        if self.behind_back > 0 && self.frames < room {
            return refuse(
                "frames",
                self.frames as f64,
                "too few for the way behind the back: 76 more are needed",
            );
        }
        if device.drop_outs.saturating_mul(device.drop_out_frames) > self.frames {
            let what = "device.drop_out_frames";
            return refuse(what, device.drop_out_frames as f64, "the stretches are longer than the clip");
        }
        Ok(())
    }
}
