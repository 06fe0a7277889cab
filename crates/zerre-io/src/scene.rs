//! Scenes of an automotive radar whose points people have sorted into objects, with the boxes that they drew.

use crate::error::{Error, Result};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The points of one object in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Cluster {
    /// Frame, as the file names have it.
    pub frame: String,
    /// Number of the object within the frame.
    pub label: i64,
    /// Its points: forward and left of the vehicle, m.
    pub points: Vec<[f64; 2]>,
}

/// A box that people drew, seen from above, in the frame of the points.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneBox {
    /// Frame.
    pub frame: String,
    /// Class, such as `vehicle.car`.
    pub class: String,
    /// Its middle, m.
    pub centre: [f64; 2],
    /// Length and width, m.
    pub size: [f64; 2],
    /// Where its length points, rad, counterclockwise from forward.
    pub yaw: f64,
}

/// A scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// Objects, frame by frame.
    pub clusters: Vec<Cluster>,
    /// Boxes, in the order of the file.
    pub boxes: Vec<SceneBox>,
}

/// Columns of `radar_SCENE_FRAME.csv` that are used.
#[derive(Deserialize)]
struct PointRow {
    x: f64,
    y: f64,
    label: i64,
}

/// Columns of `boxes.csv` that are used.
#[derive(Deserialize)]
struct BoxRow {
    frame: String,
    name: String,
    cx_m: f64,
    cy_m: f64,
    width_m: f64,
    length_m: f64,
    yaw_rad: f64,
}

fn rows<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>> {
    let file = || path.display().to_string();
    let open = std::fs::File::open(path).map_err(|source| Error::Read { file: file(), source })?;
    let of = |row: csv::Result<T>| row.map_err(|source| Error::Scene { file: file(), source });
    csv::Reader::from_reader(open).into_deserialize().map(of).collect()
}

impl Scene {
    /// Reads a folder of `radar_SCENE_FRAME.csv` (columns `y`, `x`, `label`; label -1 is no object) with `boxes.csv`.
    ///
    /// # Errors
    /// Files that cannot be read, cells that are not what they should be (with their line).
    pub fn read(folder: &Path) -> Result<Scene> {
        let refused = |source| Error::Read { file: folder.display().to_string(), source };
        let mut files: Vec<(String, PathBuf)> = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(refused)? {
            let path = entry.map_err(refused)?.path();
            let stem = path.file_stem().and_then(|name| name.to_str()).unwrap_or_default();
            let is_table = path.extension().is_some_and(|end| end == "csv");
            if let (Some((scene, frame)), true) = (stem.rsplit_once('_'), is_table)
                && scene.starts_with("radar")
            {
                files.push((frame.to_owned(), path.clone()));
            }
        }
        files.sort();
        let mut scene = Scene::default();
        for (frame, path) in files {
            let mut clusters: BTreeMap<i64, Vec<[f64; 2]>> = BTreeMap::new();
            for row in rows::<PointRow>(&path)?.into_iter().filter(|row| row.label >= 0) {
                clusters.entry(row.label).or_default().push([row.x, row.y]);
            }
            let cluster = |(label, points)| Cluster { frame: frame.clone(), label, points };
            scene.clusters.extend(clusters.into_iter().map(cluster));
        }
        let of_box = |row: BoxRow| SceneBox {
            frame: row.frame,
            class: row.name,
            centre: [row.cx_m, row.cy_m],
            size: [row.length_m, row.width_m],
            yaw: row.yaw_rad,
        };
        scene.boxes = rows(&folder.join("boxes.csv"))?.into_iter().map(of_box).collect();
        Ok(scene)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_are_read_and_bad_cells_named() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        write("radar_7_02.csv", "y,x,velocity,motion,time,label\n1,2,0,0,0,0\n3,4,0,0,0,-1\n5,6,0,0,0,0\n");
        write("radar_7_01.csv", "y,x,velocity,motion,time,label\n1,2,0,0,0,3\n");
        let head = "frame,token,name,cx_m,cy_m,cz_m,width_m,length_m,height_m,qw,qx,qy,qz,yaw_rad\n";
        write("boxes.csv", &format!("{head}01,t,vehicle.car,1,2,0,1.9,4.5,1.5,1,0,0,0,0.5\n"));
        let scene = Scene::read(folder.path()).unwrap();
        let found: Vec<_> =
            scene.clusters.iter().map(|c| (c.frame.as_str(), c.label, c.points.len())).collect();
        assert_eq!(found, [("01", 3, 1), ("02", 0, 2)]);
        assert_eq!(scene.clusters[1].points, [[2.0, 1.0], [6.0, 5.0]]);
        let label = &scene.boxes[0];
        assert!(label.size == [4.5, 1.9] && label.centre == [1.0, 2.0] && label.class == "vehicle.car");
        write("radar_7_02.csv", "y,x,velocity,motion,time,label\n1,two,0,0,0,0\n");
        let refused = Scene::read(folder.path()).unwrap_err().to_string();
        assert!(refused.contains("radar_7_02.csv") && refused.contains("line: 2"), "{refused}");
        assert!(Scene::read(&folder.path().join("none")).is_err());
    }
}
