//! Files that say what the cameras of a recording are.

use crate::rgbd::{Camera, Intrinsics, NO_DEPTH};
use crate::{Error, Result};
use serde::Deserialize;
use std::fs;
use std::path::Path;

/// What a file says of the cameras of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraFile {
    /// The cameras. Where the file has one lens alone, depth is registered: both are the same.
    pub camera: Camera,
    /// Metres per unit of depth, if the file says it.
    pub depth_scale: Option<f64>,
    /// What stands where nothing was measured, if the file says it.
    pub invalid: Option<u16>,
}

/// The keys of our own files: those of [`Camera`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Named {
    colour: Intrinsics,
    depth: Option<Intrinsics>,
    rotation: Option<[[f64; 3]; 3]>,
    translation: Option<[f64; 3]>,
    depth_scale: Option<f64>,
    invalid: Option<u16>,
}

/// Matrices as toolboxes for calibration write them.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Matrices {
    #[serde(rename = "Kdepth")]
    depth: [[f64; 3]; 3],
    #[serde(rename = "Krgb")]
    colour: [[f64; 3]; 3],
    #[serde(rename = "R")]
    rotation: [[f64; 3]; 3],
    #[serde(rename = "T")]
    translation: Column,
    depth_scale: Option<f64>,
    invalid: Option<u16>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Column {
    Flat([f64; 3]),
    Rows([[f64; 1]; 3]),
}

/// Metres per unit where nothing else is said: millimetres.
const SCALE: f64 = 0.001;

const IDENTITY: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

impl CameraFile {
    /// Reads a file of JSON: an object with `colour` and, where depth is not registered, `depth` (each with
    /// `focal` and `principal`, two numbers in pixels), `rotation` (three rows) and `translation` (metres)
    /// from the depth camera to the colour camera; or with the matrices `Kdepth`, `Krgb`, `R` and `T`. Either
    /// may have `depth_scale` (metres per unit) and `invalid`.
    ///
    /// # Errors
    /// A file that cannot be read, other keys, numbers that are no camera.
    pub fn read(path: &Path) -> Result<CameraFile> {
        let refuse = |problem: String| Error::Input { input: path.display().to_string(), problem };
        let text = fs::read(path).map_err(|error| refuse(format!("it cannot be read: {error}")))?;
        CameraFile::parse(&text).map_err(|problem| {
            refuse(format!(
                "{problem}: a camera file has `colour` {{\"focal\": [x, y], \"principal\": [x, y]}} and, where depth is not \
                 registered, `depth`, `rotation` and `translation`; or `Kdepth`, `Krgb`, `R` and `T`"
            ))
        })
    }

    fn parse(text: &[u8]) -> Result<CameraFile, String> {
        let value: serde_json::Value = serde_json::from_slice(text).map_err(|error| error.to_string())?;
        let Named { colour, depth, rotation, translation, depth_scale, invalid } =
            if value.get("Krgb").is_some() {
                let matrices: Matrices = serde_json::from_value(value).map_err(|error| error.to_string())?;
                let translation = match matrices.translation {
                    Column::Flat(flat) => flat,
                    Column::Rows(rows) => rows.map(|[v]| v),
                };
                Named {
                    colour: lens(matrices.colour)?,
                    depth: Some(lens(matrices.depth)?),
                    rotation: Some(matrices.rotation),
                    translation: Some(translation),
                    depth_scale: matrices.depth_scale,
                    invalid: matrices.invalid,
                }
            } else {
                serde_json::from_value(value).map_err(|error| error.to_string())?
            };
        if depth.is_none() && (rotation.is_some() || translation.is_some()) {
            return Err("there is a `rotation` or a `translation` without a lens `depth`".to_owned());
        }
        let camera = Camera {
            colour,
            depth: depth.unwrap_or(colour),
            rotation: rotation.unwrap_or(IDENTITY),
            translation: translation.unwrap_or_default(),
            depth_scale: depth_scale.unwrap_or(SCALE),
            invalid: invalid.unwrap_or(NO_DEPTH),
        };
        camera.checked().map_err(|error| error.to_string())?;
        Ok(CameraFile { camera, depth_scale, invalid })
    }

    /// Whether depth is already that of the colour camera's pixels.
    pub fn is_registered(&self) -> bool {
        let Camera { colour, depth, rotation, translation, .. } = self.camera;
        colour == depth && rotation == IDENTITY && translation == [0.0; 3]
    }
}

/// The lens of a matrix [[fx, 0, cx], [0, fy, cy], [0, 0, 1]].
fn lens(matrix: [[f64; 3]; 3]) -> Result<Intrinsics, String> {
    let [[fx, skew, cx], [zero, fy, cy], last] = matrix;
    if last != [0.0, 0.0, 1.0] || zero != 0.0 || skew.abs() > 1e-3 * fx.abs() {
        return Err(format!("{matrix:?} is not [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]"));
    }
    Ok(Intrinsics { focal: [fx, fy], principal: [cx, cy] })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_kinds_of_keys_are_read() {
        let one =
            CameraFile::parse(br#"{"colour": {"focal": [500, 501], "principal": [320, 240]}}"#).unwrap();
        assert!(one.is_registered() && one.depth_scale.is_none());
        assert_eq!(one.camera.depth.focal, [500.0, 501.0]);
        let matrices = br#"{"Kdepth": [[567, 0, 312], [0, 568, 242], [0, 0, 1]],
            "Krgb": [[534, 0, 309], [0, 535, 243], [0, 0, 1]], "R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
            "T": [[-0.026], [0.0003], [-0.0008]], "depth_scale": 0.0002, "invalid": 65535}"#;
        let pair = CameraFile::parse(matrices).unwrap();
        assert!(!pair.is_registered());
        assert_eq!(pair.camera.translation, [-0.026, 0.0003, -0.0008]);
        assert_eq!((pair.camera.depth.principal, pair.camera.colour.focal), ([312.0, 242.0], [534.0, 535.0]));
        assert_eq!((pair.depth_scale, pair.invalid), (Some(0.0002), Some(65_535)));
        // What serde writes of a camera is a camera file.
        let written = serde_json::to_vec(&pair.camera).unwrap();
        assert_eq!(CameraFile::parse(&written).unwrap().camera, pair.camera);
    }

    #[test]
    fn what_is_no_camera_is_refused() {
        let lens = r#""colour": {"focal": [500, 501], "principal": [320, 240]}"#;
        for text in [
            "",
            "[]",
            r#"{"color": {}}"#,
            r#"{"colour": {"focal": [0, 501], "principal": [320, 240]}}"#,
            &format!("{{{lens}, \"rotation\": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}}"),
            &format!("{{{lens}, \"depth_scale\": 0}}"),
            &format!("{{{lens}, \"scale\": 1}}"),
            r#"{"Krgb": [[1, 0, 0], [0, 1, 0], [0, 0, 2]]}"#,
        ] {
            assert!(CameraFile::parse(text.as_bytes()).is_err(), "{text}");
        }
    }
}
