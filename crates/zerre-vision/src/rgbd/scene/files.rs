//! A drawn recording as the files of a folder, as `recording` reads them.

use super::{Condition, Joint, Scene, SceneSettings};
use crate::Result;
use crate::frames::folder::{depth_png, png};
use std::fmt::Write;

/// A kind of drawn recording that can be chosen by its name.
#[derive(Clone, Copy, Debug)]
pub struct Named {
    /// Its name.
    pub name: &'static str,
    /// What it is, in a line.
    pub about: &'static str,
    /// Its condition; none of the clip to calibrate on.
    pub condition: Option<Condition>,
}

/// All of them.
pub const SCENES: &[Named] = &[
    Named {
        name: "rgbd-light",
        about: "colour and depth: a person moves a hand before a plain, light wall",
        condition: Some(Condition::Light),
    },
    Named {
        name: "rgbd-clutter",
        about: "colour and depth: a wall full of things, some coloured like skin",
        condition: Some(Condition::Clutter),
    },
    Named {
        name: "rgbd-flicker",
        about: "colour and depth: the light drifts and flickers",
        condition: Some(Condition::Flicker),
    },
    Named {
        name: "rgbd-behind-back",
        about: "colour and depth: the hand is behind the back for 25 frames",
        condition: Some(Condition::BehindBack),
    },
    Named {
        name: "rgbd-device-drop-out",
        about: "colour and depth: the device loses the joint for two stretches",
        condition: Some(Condition::DeviceDropOut),
    },
    Named {
        name: "rgbd-calibration",
        about: "colour and depth: a clip to choose parameters on",
        condition: None,
    },
];

impl Named {
    /// What it is drawn from.
    pub fn settings(&self) -> SceneSettings {
        self.condition.map_or_else(SceneSettings::calibration, SceneSettings::condition)
    }
}

/// A file of a drawn recording.
#[derive(Clone, Debug)]
pub struct SceneFile {
    /// Its name, within a folder `rgb` or `depth` for the pictures: `rgb/0001.png`.
    pub name: String,
    /// What is in it.
    pub bytes: Vec<u8>,
}

impl Scene {
    /// Files beside the pictures: `camera.json`, the empty room (`background_rgb.png`,
    /// `background_depth.png`), `truth.csv` (places in pixels and mm), `joints.csv` (what the device reports:
    /// pixels, mm, confidence) and `labels.csv` (what people have marked, pixels).
    ///
    /// # Errors
    /// A picture that cannot be written.
    pub fn tables(&self) -> Result<Vec<SceneFile>> {
        let file = |name: &str, bytes| SceneFile { name: name.to_owned(), bytes };
        let camera = serde_json::to_vec_pretty(&self.camera());
        let camera = camera.map_err(|error| crate::Error::Input {
            input: "camera.json".to_owned(),
            problem: error.to_string(),
        })?;
        Ok(vec![
            file("camera.json", camera),
            file("background_rgb.png", png(&self.background().0)?),
            file("background_depth.png", depth_png(&self.raw_background())?),
            file("truth.csv", self.truth_table().into_bytes()),
            file("joints.csv", self.joint_table().into_bytes()),
            file("labels.csv", self.label_table().into_bytes()),
        ])
    }

    /// The pictures of frame `k`: colours, and depth from the depth camera's own place.
    ///
    /// # Errors
    /// A picture that cannot be written.
    pub fn pictures(&self, k: usize) -> Result<[SceneFile; 2]> {
        let name = self.name(k);
        Ok([
            SceneFile { name: format!("rgb/{name}"), bytes: png(&self.colours(k))? },
            SceneFile { name: format!("depth/{name}"), bytes: depth_png(&self.raw_depth(k))? },
        ])
    }

    fn truth_table(&self) -> String {
        let mut text = "frame,time_s,x,y,x_mm,y_mm,z_mm,visible,overlap".to_owned();
        for joint in ["elbow", "shoulder", "head", "left_hand"] {
            for column in ["x", "y", "x_mm", "y_mm", "z_mm"] {
                // Writing to a string cannot fail.
                let _ = write!(text, ",{joint}_{column}");
            }
        }
        text.push('\n');
        for k in 0..self.len() {
            let truth = self.truth(k);
            let place = |joint: Joint| {
                let ([u, v], [x, y, z]) = (joint.px, joint.mm);
                format!(",{u:.3},{v:.3},{x:.2},{y:.2},{z:.2}")
            };
            let hand = place(Joint { px: truth.hand, mm: truth.hand_mm });
            let joints = truth.joints;
            let rest = [joints.elbow, joints.shoulder, joints.head, joints.left_hand].map(place).concat();
            let (name, time, visible, over) =
                (self.name(k), self.time(k), truth.visible, u8::from(truth.overlap));
            let _ = writeln!(text, "{name},{time}{hand},{visible:.4},{over}{rest}");
        }
        text
    }

    fn joint_table(&self) -> String {
        let mut text = "time_s,joint,x,y,z,confidence\n".to_owned();
        for (time, reading) in self.readings() {
            let [x, y] = reading.at;
            let z = reading.depth_mm.map_or_else(String::new, |z| format!("{z:.1}"));
            let _ = writeln!(text, "{time},hand_right,{x:.3},{y:.3},{z},{:.3}", reading.confidence);
        }
        text
    }

    fn label_table(&self) -> String {
        let mut text = "frame,operator,point,x,y,visible\n".to_owned();
        for k in 0..self.len() {
            for (who, label) in self.operators(k).into_iter().enumerate() {
                let _ = write!(text, "{},operator {},hand_right,", self.name(k), who + 1);
                let _ = match label {
                    Some([x, y]) => writeln!(text, "{x:.2},{y:.2},1"),
                    None => writeln!(text, ",,0"),
                };
            }
        }
        text
    }
}
