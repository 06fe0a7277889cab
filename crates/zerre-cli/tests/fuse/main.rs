//! `zerre fuse` on a drawn recording, on damaged ones, and on a real camera's.

mod input;
mod joints;
mod learn;
mod live;

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// An empty folder of the test's own.
fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("fuse-{name}"));
    let _ = fs::remove_dir_all(&path);
    fs::create_dir_all(&path).unwrap();
    path
}

fn zerre(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_zerre")).args(args).output().unwrap()
}

fn words(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn document(output: &Output) -> Value {
    assert!(output.status.success(), "{}", words(output));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// What a run says of itself in its folder.
fn record(out: &Path) -> Value {
    serde_json::from_slice(&fs::read(out.join("run.json")).unwrap()).unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// The drawn recording, made once: 111 frames.
fn drawn() -> &'static Path {
    static MADE: OnceLock<PathBuf> = OnceLock::new();
    MADE.get_or_init(|| {
        let out = folder("made");
        let made = zerre(&["simulate", "rgbd-light", "--seed", "4", "--out", text(&out), "--force"]);
        assert!(made.status.success(), "{}", words(&made));
        out
    })
}

/// The first frames of the drawn recording, in a folder of the test's own.
fn beginning(name: &str, frames: usize) -> PathBuf {
    let out = folder(name);
    for kind in ["rgb", "depth"] {
        fs::create_dir_all(out.join(kind)).unwrap();
        let mut files: Vec<_> =
            fs::read_dir(drawn().join(kind)).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.sort();
        for file in &files[..frames] {
            fs::copy(file, out.join(kind).join(file.file_name().unwrap())).unwrap();
        }
    }
    for file in
        ["camera.json", "background_rgb.png", "background_depth.png", "joints.csv", "truth.csv", "labels.csv"]
    {
        fs::copy(drawn().join(file), out.join(file)).unwrap();
    }
    out
}

fn fuse(recording: &Path, out: &Path, more: &[&str]) -> Output {
    let mut args = vec!["fuse", text(recording), "--out", text(out), "--json"];
    args.extend_from_slice(more);
    zerre(&args)
}

/// The hand is followed through the whole of it, far better than by its device (whose readings are the joints
/// of the table), the same seed gives the same bits, another one others; and the thesis's filter is worse.
#[test]
fn a_hand_is_followed() {
    let (made, out) = (drawn(), folder("followed"));
    let truth = made.join("truth.csv");
    let run = |name: &str, more: &[&str]| {
        let mut all = vec!["--truth", text(&truth)];
        all.extend_from_slice(more);
        document(&fuse(made, &out.join(name), &all))
    };
    let found = run("one", &[]);
    let rmse = |found: &Value| found["rmse_px"].as_f64().unwrap();
    assert_eq!((found["frames"].as_u64(), found["joints"][0].as_str()), (Some(111), Some("hand_right")));
    let thesis = run("thesis", &["--preset", "thesis", "--steps", "1,2"]);
    assert!(rmse(&found) < 6.0 && rmse(&thesis) > 1.5 * rmse(&found), "{found} {thesis}");
    assert!(out.join("thesis/step-0002-colour-I2.png").is_file(), "the pictures of the steps");
    let digest = |found: &Value| found["estimates_digest"].as_str().unwrap().to_owned();
    assert_eq!(digest(&found), digest(&run("again", &["--threads", "1"])));
    assert_ne!(digest(&found), digest(&run("other", &["--seed", "2"])));
    let table = fs::read_to_string(out.join("one/points.csv")).unwrap();
    let head = "frame,name,time_s,joint,x,y,var_x,var_y,cov_xy,x_mm,y_mm,z_mm,p_lost,trust_device,trust_color,trust_depth";
    assert_eq!(table.lines().next(), Some(head));
    assert_eq!(table.lines().count(), 112);
    assert!(fs::read_to_string(out.join("one/report.html")).unwrap().contains("Processor time per frame"));
}

/// What people marked is seen by the scores alone: other marks change no bit of what is found.
#[test]
fn marks_are_for_scores_alone() {
    let (made, out) = (beginning("marks", 20), folder("marks-out"));
    let table = fs::read_to_string(made.join("truth.csv")).unwrap();
    let mut lines: Vec<&str> = table.lines().collect();
    lines[1..].reverse();
    // The frames' names stay in their order, the places are turned round.
    let frames: Vec<&str> = table.lines().map(|line| line.split(',').next().unwrap()).collect();
    let turned: Vec<String> = lines
        .iter()
        .zip(&frames)
        .map(|(line, frame)| format!("{frame},{}", line.split_once(',').unwrap().1))
        .collect();
    fs::write(made.join("turned.csv"), turned.join("\n")).unwrap();
    let run = |name: &str, truth: &str| {
        let truth = made.join(truth);
        let found = document(&fuse(&made, &out.join(name), &["--truth", text(&truth)]));
        let points = fs::read_to_string(out.join(name).join("points.csv")).unwrap();
        (found["rmse_px"].as_f64().unwrap(), points)
    };
    let (right, points) = run("right", "truth.csv");
    let (wrong, same) = run("wrong", "turned.csv");
    assert!(points == same && wrong > right, "{wrong} {right}");
    document(&fuse(&made, &out.join("none"), &[]));
    assert_eq!(fs::read_to_string(out.join("none/points.csv")).unwrap(), points, "without any marks");
}

#[test]
fn damage_is_counted_and_the_rest_is_followed() {
    let (made, out) = (beginning("damaged", 12), folder("damaged-out"));
    let file = |kind: &str, number: usize| {
        let mut files: Vec<_> =
            fs::read_dir(made.join(kind)).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.sort();
        files[number].clone()
    };
    let (cut, gone, empty) = (file("rgb", 3), file("depth", 5), file("depth", 7));
    let bytes = fs::read(&cut).unwrap();
    fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    fs::write(&empty, b"").unwrap();
    fs::remove_file(&gone).unwrap();
    let joints = fs::read_to_string(made.join("joints.csv")).unwrap();
    let mut rows: Vec<String> = joints.lines().map(str::to_owned).collect();
    rows[3] = "0.06,hand_right,NaN,3,,1".to_owned();
    rows[4] = "0.1,hand_right,3,4,,7".to_owned();
    fs::write(made.join("joints.csv"), rows.join("\n")).unwrap();
    let run = fuse(&made, &out.join("run"), &[]);
    let found = document(&run);
    assert_eq!((found["frames"].as_u64(), found["left_out"].as_u64()), (Some(12), Some(1)), "{found}");
    for problem in ["line 4: column x has `NaN`", "line 5: column confidence has 7"] {
        assert!(words(&run).contains(problem), "{}", words(&run));
    }
    let record = record(&out.join("run"));
    assert_eq!(record["counts"]["rejected"]["row of joints"], 2, "{record}");
}

#[test]
fn what_cannot_be_done_is_said() {
    let (made, out) = (beginning("refused", 3), folder("refused-out"));
    let refused = |more: &[&str], words_of: &str| {
        let run = fuse(&made, &out.join("run"), more);
        assert!(!run.status.success() && words(&run).contains(words_of), "{more:?}: {}", words(&run));
    };
    refused(&["--joint", "hand_rihgt"], "hand_right");
    refused(&["--joints", text(&made.join("camera.json"))], "there is no column");
    refused(&["--steps", "1"], "--preset thesis");
    refused(&["--without", "colour"], "color");
    refused(&["--start", "1,x"], "two numbers");
    refused(&["--start", "-100,5"], "not on the frame");
    fs::write(made.join("bad.toml"), "[tracker.fusion]\nparticles = 0\n").unwrap();
    refused(&["--config", text(&made.join("bad.toml"))], "particles is 0");
    fs::remove_file(made.join("joints.csv")).unwrap();
    refused(&[], "--start x,y");
    fs::remove_file(made.join("background_rgb.png")).unwrap();
    refused(&["--start", "300,200", "--room", "pictures"], "background_rgb.png");
    refused(
        &["--start", "300,200", "--without", "color", "--without", "depth", "--without", "device"],
        "no source is left",
    );
    let nowhere = zerre(&["fuse", text(&out.join("nowhere")), "--start", "1,1"]);
    assert!(words(&nowhere).contains("there is no such"), "{}", words(&nowhere));
}

/// A real camera's pictures, that are not registered, without a table of joints: both filters go through.
#[test]
fn real_recordings_are_gone_through() {
    let beside = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let data = std::env::var_os("ZERRE_DATA").map_or_else(beside, PathBuf::from).join("rgbd_asus/um");
    if !data.is_dir() {
        assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "no recording {}", data.display());
        eprintln!("SKIPPED: no recording {}", data.display());
        return;
    }
    let out = folder("real");
    for preset in ["sound", "thesis"] {
        let run = fuse(&data, &out.join(preset), &["--start", "320,240", "--preset", preset]);
        let found = document(&run);
        assert_eq!((found["frames"].as_u64(), found["left_out"].as_u64()), (Some(38), Some(0)), "{found}");
    }
}
