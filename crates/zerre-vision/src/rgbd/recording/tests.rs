use super::super::scene::{Scene, SceneSettings};
use super::*;
use crate::frames::folder::{depth_png, png};
use std::fs;
use zerre::Time;

/// A folder of its own that is removed behind the test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("zerre-recording-{}-{name}", std::process::id()));
        fs::create_dir_all(path.join("rgb")).unwrap();
        fs::create_dir_all(path.join("depth")).unwrap();
        Folder(path)
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        fs::write(self.0.join(name), bytes).unwrap();
    }

    fn colour(&self, name: &str, level: u8) {
        self.write(name, png(&Image::filled(8, 6, [level; 3])).unwrap());
    }

    fn depth(&self, name: &str, units: u16) {
        self.write(name, depth_png(&Image::filled(8, 6, units)).unwrap());
    }

    fn open(&self) -> Result<Recording> {
        Recording::open(&self.0, &RecordingOptions::default())
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn problem<T: std::fmt::Debug>(result: Result<T>) -> String {
    result.unwrap_err().to_string()
}

/// A drawn recording, written and read: colours are the same, and depth is that of the colour camera wherever
/// both see.
#[test]
fn a_drawn_recording_reads_back() {
    let folder = Folder::new("drawn");
    let settings = SceneSettings { size: [160, 120], frames: 5, ..SceneSettings::default() };
    let scene = Scene::new(settings, 2).unwrap();
    for k in 0..5 {
        for file in scene.pictures(k).unwrap() {
            folder.write(&file.name, file.bytes);
        }
    }
    for file in scene.tables().unwrap() {
        folder.write(&file.name, file.bytes);
    }
    let mut recording = folder.open().unwrap();
    assert_eq!((recording.camera(), recording.expected()), (Some(scene.camera()), Some(5)));
    let near = |a: &Depth, b: &Depth| {
        let pairs = a.pixels().iter().zip(b.pixels()).filter(|(a, b)| **a != NO_DEPTH && **b != NO_DEPTH);
        let (mut same, mut all) = (0, 0);
        for (a, b) in pairs {
            all += 1;
            // Noise and levels of both: 0.5 % at 3 m is 15 mm; five deviations are 4 %.
            same += usize::from(a.abs_diff(*b) < b / 25);
        }
        all > 160 * 120 / 2 && same * 100 > all * 95
    };
    let (colour, depth) = recording.room().unwrap().unwrap();
    assert!(colour == scene.background().0 && near(&depth, &scene.background().1));
    for k in 0..5 {
        let (read, drawn) = (recording.next().unwrap().unwrap(), scene.frame(k));
        assert_eq!((read.index, &read.name, read.time), (k, &drawn.name, drawn.time));
        assert!(read.colour == drawn.colour && near(&read.depth, &drawn.depth), "frame {k}");
    }
    assert!(recording.next().is_none());
    assert_eq!(recording.outcomes(), Outcomes { read: 5, ..Outcomes::default() });
    let text = |name: &str| fs::read_to_string(folder.0.join(name)).unwrap();
    for (name, rows, columns) in [("truth.csv", 6, 29), ("joints.csv", 6, 6), ("labels.csv", 36, 6)] {
        let text = text(name);
        assert_eq!(text.lines().count(), rows, "{name}");
        assert!(text.lines().all(|line| line.split(',').count() == columns), "{name}: {text}");
    }
    let [x, y] = scene.truth(0).hand;
    assert!(text("truth.csv").lines().nth(1).unwrap().starts_with(&format!("0001.png,0,{x:.3},{y:.3},")));
}

/// Numbers may begin anywhere and leave some out; what has no partner is counted.
#[test]
fn pictures_of_one_number_belong_together() {
    let folder = Folder::new("numbers");
    for k in [9, 10, 11, 13] {
        folder.colour(&format!("rgb/f_{k}.png"), k);
    }
    for (name, units) in [("d9", 900), ("d0010", 1000), ("d13", 1300), ("d77", 1)] {
        folder.depth(&format!("depth/{name}.png"), units);
    }
    folder.write("depth/d11.png", b"no picture");
    let mut recording = folder.open().unwrap();
    assert_eq!(recording.expected(), Some(5));
    let mut seen = Vec::new();
    for frame in recording.by_ref().filter_map(Result::ok) {
        seen.push((frame.index, frame.colour.at(0, 0)[0], frame.depth.at(0, 0)));
    }
    assert_eq!(seen, [(0, 9, 900), (1, 10, 1000), (2, 11, 0), (4, 13, 1300)]);
    let wanted = Outcomes { read: 4, without_depth: 0, unreadable_depth: 1, unreadable: 1, depth_alone: 1 };
    assert_eq!(recording.outcomes(), wanted);
    fs::remove_file(folder.0.join("depth/d13.png")).unwrap();
    let mut recording = folder.open().unwrap();
    assert_eq!(recording.by_ref().filter(Result::is_ok).count(), 4);
    assert_eq!(recording.outcomes().without_depth, 1);
}

#[test]
fn times_come_from_a_table() {
    let folder = Folder::new("times");
    for k in 1..=3 {
        folder.colour(&format!("rgb/{k}.png"), k);
        folder.depth(&format!("depth/{k}.png"), 1000);
    }
    folder.write("times.csv", "frame,time_s\n1.png,0.5\n2,0.54\n0003.png,0.6\n");
    let times: Vec<Time> = folder.open().unwrap().map(|frame| frame.unwrap().time).collect();
    assert_eq!(times, [500, 540, 600].map(|ms| Time::from_nanos(ms * 1_000_000)));
    for (table, told) in [
        ("frame,time\n1,0\n", "time_s"),
        ("frame,time_s\n1,0\n2,1\n", "no time for 3.png"),
        ("frame,time_s\n1,0\n2,soon\n3,2\n", "line 3"),
        ("frame,time_s\n1,0\n2,0\n3,2\n", "not behind"),
        ("frame,time_s\n1,0\n1,1\n", "twice"),
        ("frame,time_s\n1\n", "too few"),
    ] {
        folder.write("times.csv", table);
        let problem = problem(folder.open());
        assert!(problem.contains(told), "{problem}");
    }
}

#[test]
fn the_layout_of_the_tum_benchmark_is_read() {
    let folder = Folder::new("tum");
    folder.write(
        "rgb.txt",
        "# color images\n# timestamp filename\n10.000 rgb/a.png\n10.033 rgb/b.png\n10.1 rgb/c.png\n",
    );
    folder.write("depth.txt", "# depth\n10.019 depth/a.png\n10.030 depth/b.png\n10.2 depth/c.png\n");
    for (name, units) in [("a", 5000), ("b", 10_000), ("c", 1)] {
        folder.colour(&format!("rgb/{name}.png"), 1);
        folder.depth(&format!("depth/{name}.png"), units);
    }
    let mut recording = folder.open().unwrap();
    let depths: Vec<u16> = recording.by_ref().map(|frame| frame.unwrap().depth.at(0, 0)).collect();
    assert_eq!(depths, [1000, 2000, 0]);
    assert_eq!(
        recording.outcomes(),
        Outcomes { read: 3, without_depth: 1, depth_alone: 1, ..Outcomes::default() }
    );
    // Pairs that somebody else has made, depth first.
    folder.write("associations.txt", "10.2 depth/c.png 10.1 rgb/c.png\n10.0 depth/b.png 10.05 rgb/a.png\n");
    let options =
        RecordingOptions { depth_scale: Some(0.001), invalid: Some(1), ..RecordingOptions::default() };
    let read = Recording::open(&folder.0, &options).unwrap();
    let read: Vec<_> =
        read.map(|frame| frame.map(|frame| (frame.name, frame.depth.at(0, 0))).unwrap()).collect();
    assert_eq!(read, [("a.png".to_owned(), 10_000), ("c.png".to_owned(), 0)]);
    folder.write("associations.txt", "10.2 rgb/c.png\n");
    assert!(problem(folder.open()).contains("line 1"));
    folder.write("associations.txt", "# nothing\n");
    assert!(problem(folder.open()).contains("names no picture"));
}

#[test]
fn what_cannot_be_read_says_what_is_needed() {
    let folder = Folder::new("refused");
    assert!(
        problem(Recording::open(&folder.0.join("none"), &RecordingOptions::default()))
            .contains("no such file or folder")
    );
    folder.colour("rgb/1.png", 1);
    assert!(problem(folder.open()).contains("no picture"));
    folder.write("depth/1.png", depth_png(&Image::filled(4, 3, 1000)).unwrap());
    let told = problem(folder.open());
    assert!(told.contains("4 x 3") && told.contains("8 x 6") && told.contains("camera.json"), "{told}");
    folder.write("camera.json", "{\"colour\": 1}");
    assert!(problem(folder.open()).contains("camera.json"));
    // With both lenses they are registered: one unit is 4 m here, all in the middle of view.
    folder.write(
        "camera.json",
        r#"{"colour": {"focal": [8, 8], "principal": [3.5, 2.5]}, "depth": {"focal": [4, 4], "principal": [1.5, 1]},
            "depth_scale": 0.002}"#,
    );
    let frame = folder.open().unwrap().next().unwrap().unwrap();
    assert_eq!(frame.depth.size(), (8, 6));
    assert!(
        frame.depth.pixels().contains(&2000) && frame.depth.pixels().iter().all(|z| [0, 2000].contains(z))
    );
    for (options, told) in [
        (RecordingOptions { rate_hz: 0.0, ..RecordingOptions::default() }, "rate_hz"),
        (RecordingOptions { depth_scale: Some(-1.0), ..RecordingOptions::default() }, "depth_scale"),
    ] {
        assert!(problem(Recording::open(&folder.0, &options)).contains(told));
    }
    fs::remove_dir_all(folder.0.join("depth")).unwrap();
    assert!(problem(folder.open()).contains("no folder `depth`"));
}
