//! Recordings of colour and depth from a real camera. They lie in the folder that the environment variable
//! `ZERRE_DATA` names, or in `shared/data` beside the workspace.

use std::path::PathBuf;
use zerre_vision::rgbd::NO_DEPTH;
use zerre_vision::rgbd::background::MedianRoom;
use zerre_vision::rgbd::recording::{Outcomes, Recording, RecordingOptions};

/// The folder of a recording; `None`, with a message, where there is none. Continuous integration must have
/// them.
fn folder(name: &str) -> Option<PathBuf> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("ZERRE_DATA").map_or(beside, PathBuf::from).join(name);
    if folder.exists() {
        return Some(folder);
    }
    let message = format!("no recording {}: set ZERRE_DATA to the folder that holds it", folder.display());
    assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "{message}");
    eprintln!("SKIPPED: {message}");
    None
}

/// All frames are read and registered with the camera file above the folder. The colour camera's lens is
/// wider: it sees more than the depth camera, so at most (534 / 568)², 88 %, of its pixels can have depth. Of
/// one frame a third of them has none; of the median of the room a part of these is known.
#[test]
fn an_asus_xtion_is_read_and_registered() {
    for (name, count) in [("um", 38), ("filinha", 108), ("corridor", 30)] {
        let Some(path) = folder("rgbd_asus").map(|folder| folder.join(name)) else { return };
        let mut recording = Recording::open(&path, &RecordingOptions::default()).unwrap();
        assert_eq!(recording.expected(), Some(count), "{name}");
        assert!(recording.camera().is_some_and(|camera| (camera.translation[0] + 0.0263).abs() < 1e-4));
        let holes = |depth: &zerre_vision::rgbd::Depth| {
            let unknown = depth.pixels().iter().filter(|z| **z == NO_DEPTH).count();
            unknown as f64 / depth.pixels().len() as f64
        };
        let mut room = MedianRoom::new(31);
        let mut sum = 0.0;
        for frame in recording.by_ref() {
            let frame = frame.unwrap();
            assert_eq!((frame.colour.size(), frame.depth.size()), ((640, 480), (640, 480)));
            sum += holes(&frame.depth) / count as f64;
            room.add(&frame).unwrap();
        }
        assert_eq!(recording.outcomes(), Outcomes { read: count, ..Outcomes::default() });
        let room = holes(room.finish().unwrap().depth());
        assert!((0.12..0.4).contains(&sum) && (0.12..sum).contains(&room), "{name}: {sum} {room}");
    }
}
