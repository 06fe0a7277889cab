//! `zerre balls` on clips that the tests draw.

use serde_json::Value;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use zerre_vision::balls::{Scene, SceneSettings};
use zerre_vision::frames::folder::png;
use zerre_vision::{Frame, Image};

/// An empty folder of the test's own.
fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("balls-{name}"));
    let _ = fs::remove_dir_all(&path);
    fs::create_dir_all(&path).unwrap();
    path
}

/// Pictures 0001.png and on in the folder `clip`.
fn pictures(inside: &Path, frames: impl IntoIterator<Item = Frame>) {
    fs::create_dir_all(inside.join("clip")).unwrap();
    for (k, frame) in (1..).zip(frames) {
        fs::write(inside.join(format!("clip/{k:04}.png")), png(&frame).unwrap()).unwrap();
    }
}

/// Three balls of different sizes and colours that stay apart, as pictures with truth.csv.
fn three(inside: &Path, frames: usize) {
    let settings = SceneSettings {
        size: (200, 150),
        frames,
        radii: vec![14.0, 11.0, 8.0],
        speed: 3.0,
        ..SceneSettings::default()
    };
    let scene = Scene::new(settings, 1);
    pictures(inside, (0..frames).map(|k| scene.frame(k)));
    let mut truth = "frame,ball,x,y,radius,visible\n".to_owned();
    for k in 0..frames {
        for one in scene.truth(k) {
            let [x, y] = one.centre;
            writeln!(truth, "{k},{},{x},{y},{},{}", one.ball, one.radius, one.visible).unwrap();
        }
    }
    fs::write(inside.join("clip/truth.csv"), truth).unwrap();
}

fn zerre(inside: &Path, line: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_zerre"));
    command.current_dir(inside).args(line.split_whitespace());
    command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY").output().unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

/// Runs to its end; gives the document of `--json` and what was said.
fn done(inside: &Path, line: &str) -> (Value, String) {
    let output = zerre(inside, &format!("{line} --json --out out --force"));
    let said = text(&output.stderr).to_owned();
    assert_eq!(output.status.code(), Some(0), "{line}: {said}");
    (serde_json::from_slice(&output.stdout).unwrap(), said)
}

fn record(inside: &Path) -> Value {
    serde_json::from_slice(&fs::read(inside.join("out/run.json")).unwrap()).unwrap()
}

/// The rows of points.csv without the head, their numbers as far as there are some.
fn points(inside: &Path) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(inside.join("out/points.csv")).unwrap();
    let line = |line: &str| line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
    text.lines().skip(1).map(line).collect()
}

#[test]
fn drawn_balls_are_followed_and_scored() {
    let inside = folder("followed");
    three(&inside, 40);
    let line = "balls clip --truth clip/truth.csv --overlay seen.gif --strict";
    let (document, said) = done(&inside, line);
    assert_eq!((&document["balls"], &document["frames"]), (&3.into(), &40.into()), "{said}");
    let scores = &document["scores"];
    assert_eq!((&scores["swaps"], &scores["held"]), (&0.into(), &120.into()));
    // The detector is exact to a tenth of a pixel on balls so small; half of one is believed of it.
    assert!(scores["rmse_px"].as_f64().unwrap() < 0.5, "{scores}");
    assert_eq!(points(&inside).len(), 120);
    let page = fs::read_to_string(inside.join("out/report.html")).unwrap();
    for part in ["film.png", "Against the truth", "Ways", "zerre balls clip"] {
        assert!(page.contains(part), "{part}");
    }
    assert!(inside.join("out/film.png").exists());
    assert!(fs::read(inside.join("seen.gif")).unwrap().starts_with(b"GIF89a"));
    assert_eq!(record(&inside)["estimates_digest"], document["estimates_digest"]);
    assert_eq!(done(&inside, line).0["estimates_digest"], document["estimates_digest"]);
    let other = done(&inside, &format!("{line} --seed 8")).0;
    assert_ne!(other["estimates_digest"], document["estimates_digest"]);
}

/// All motions and resamplers hold all balls; each gives other numbers.
#[test]
fn every_motion_and_resampler_follows() {
    let inside = folder("ways");
    three(&inside, 25);
    let mut digests = std::collections::BTreeSet::new();
    for motion in ["constant-velocity", "random-walk"] {
        for resampling in ["multinomial", "residual", "stratified", "systematic"] {
            let line =
                format!("balls clip --truth clip/truth.csv --motion {motion} --resampling {resampling}");
            let (document, said) = done(&inside, &line);
            assert_eq!(document["scores"]["held"], 75, "{line}: {said}");
            digests.insert(document["estimates_digest"].to_string());
        }
    }
    assert_eq!(digests.len(), 8);
    for preset in ["a", "b", "c", "d"] {
        let (document, _) = done(&inside, &format!("balls clip --preset thesis --reading {preset}"));
        assert_eq!((&document["balls"], &document["rows"]), (&3.into(), &75.into()), "reading {preset}");
    }
}

#[test]
fn bad_input_is_refused_with_a_way_out() {
    let inside = folder("refused");
    three(&inside, 3);
    fs::create_dir(inside.join("empty")).unwrap();
    fs::write(inside.join("small.png"), png(&Frame::filled(9, 9, [9; 3])).unwrap()).unwrap();
    fs::write(inside.join("bad.csv"), "frame,ball,x,y,radius,visible\n0,1,2,3,x,1\n").unwrap();
    fs::write(inside.join("head.csv"), "x,y\n").unwrap();
    for (line, code, says) in [
        ("balls nowhere", 1, "there is no such file or folder"),
        ("balls empty", 1, "there is no picture: jpg, jpeg, png are read"),
        ("balls clip --ground nowhere.png", 1, "the ground is plain, median, or a picture of it"),
        ("balls clip --ground small.png", 1, "9 x 9"),
        ("balls clip --truth nowhere.csv", 1, "nowhere.csv"),
        ("balls clip --truth bad.csv", 1, "bad.csv, line 2"),
        ("balls clip --truth head.csv", 1, "the head `frame,ball,x,y,radius,visible` is needed"),
        ("balls clip --count 0", 2, "--count"),
        ("balls clip --particles 0", 2, "--particles"),
        ("balls clip --particles 99999999", 1, "2^26"),
        ("balls clip --threshold 256", 2, "--threshold"),
        ("balls clip --min-area 9 --max-area 8", 1, "it must not be below the least area"),
        ("balls clip --process-noise 0", 1, "process noise of a ball"),
        ("balls clip --process-noise NaN", 1, "process noise of a ball"),
        ("balls clip --measurement-noise -1", 1, "standard deviation of a ball's detected place"),
        ("balls clip --preset thesis --process-noise inf", 2, "a number above zero is needed"),
        ("balls clip --preset thesis --reading e", 2, "there is no reading `e`"),
        ("balls clip --reading a", 2, "add --preset thesis"),
        ("balls clip --overlay seen.avi", 2, "neither .mp4 nor .gif"),
        ("balls clip --out clip", 1, "holds the input"),
    ] {
        let output = zerre(
            &inside,
            &format!("{line} {}--force", if line.contains("--out") { "" } else { "--out out " }),
        );
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{line}: {said}");
        assert!(said.contains(says) && !said.contains("met a bug"), "{line}: {said}");
    }
    // A chequered ground is not plain; its median is.
    let square = |x: usize, y: usize| if (x / 4 + y / 4).is_multiple_of(2) { [0; 3] } else { [255; 3] };
    pictures(&inside, (0..3).map(|_| Image::from_fn(64, 48, square)));
    let output = zerre(&inside, "balls clip --out out --force");
    let said = text(&output.stderr);
    assert!(said.contains("give another way to find it") && output.status.code() == Some(1), "{said}");
    assert_eq!(done(&inside, "balls clip --ground median").0["balls"], 0);
}

#[test]
fn bad_frames_are_counted_and_the_rest_is_followed() {
    let inside = folder("frames");
    three(&inside, 24);
    let at = |k: usize| inside.join(format!("clip/{k:04}.png"));
    let picture = fs::read(at(9)).unwrap();
    fs::write(at(9), &picture[..picture.len() / 2]).unwrap();
    fs::write(at(12), png(&Frame::filled(20, 20, [0; 3])).unwrap()).unwrap();
    fs::write(at(15), "no picture").unwrap();
    fs::remove_file(at(18)).unwrap();
    let (document, said) = done(&inside, "balls clip");
    assert_eq!((&document["balls"], &document["unreadable"]), (&3.into(), &4.into()), "{said}");
    for part in ["0009.png", "0012.png", "0015.png", "no picture with the number 18"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let counts = record(&inside)["counts"].clone();
    assert_eq!((&counts["read"], &counts["used"]), (&24.into(), &20.into()));
    assert_eq!(counts["rejected"]["unreadable frame"], 4);
    assert_eq!(points(&inside).len(), 3 * 20);
    // None at all can be read.
    (1..=24).for_each(|k| fs::write(at(k), "no picture").unwrap());
    let output = zerre(&inside, "balls clip --out none");
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("none of the frames that were looked at can be read"), "{said}");
}

/// With a number of balls that is not theirs: fewer are followed, or no more than there are; the thesis counts
/// those that a frame does not show, and sorts what it sees.
#[test]
fn a_number_of_balls_may_differ_from_theirs() {
    let inside = folder("count");
    three(&inside, 20);
    for (count, found) in [(1, 1), (2, 2), (3, 3), (7, 3)] {
        let (document, said) = done(&inside, &format!("balls clip --count {count}"));
        assert_eq!((&document["balls"], &document["rows"]), (&found.into(), &(found * 20).into()), "{said}");
    }
    let (document, _) = done(&inside, "balls clip --preset thesis --count 5");
    assert_eq!(document["balls"], 5);
    assert_eq!(record(&inside)["outcomes"]["ball without a part of the picture"]["count"], 40);
    let (document, _) = done(&inside, "balls clip --preset thesis --count 2");
    assert_eq!((&document["balls"], &document["rows"]), (&2.into(), &40.into()));
}

#[test]
fn one_particle_is_enough_to_end_well() {
    let inside = folder("one");
    three(&inside, 20);
    for options in ["", "--motion random-walk --resampling residual", "--preset thesis"] {
        let (document, said) = done(&inside, &format!("balls clip --particles 1 {options}"));
        assert_eq!(document["balls"], 3, "{options}: {said}");
        // Frame, ball, place, velocity and variances are numbers in every row.
        let rows = points(&inside);
        assert!(rows.iter().all(|row| row[..9].iter().all(|cell| cell.is_finite())), "{options}");
    }
}

#[test]
fn no_ball_is_an_outcome() {
    let inside = folder("none");
    pictures(&inside, (0..6).map(|_| Frame::filled(80, 60, [200, 190, 180])));
    for options in ["", "--preset thesis", "--ground median", "--ground clip/0001.png"] {
        let (document, said) = done(&inside, &format!("balls clip {options}"));
        let balls = if options.contains("thesis") { 3 } else { 0 };
        assert_eq!(
            (&document["balls"], &document["frames"]),
            (&balls.into(), &6.into()),
            "{options}: {said}"
        );
    }
    done(&inside, "balls clip");
    assert!(record(&inside)["outcomes"]["no ball was found"].is_object());
    assert!(points(&inside).is_empty());
    let output = zerre(&inside, "balls clip --strict --out strict");
    assert_eq!(output.status.code(), Some(3), "{}", text(&output.stderr));
    // A single frame of a single pixel.
    fs::remove_dir_all(inside.join("clip")).unwrap();
    pictures(&inside, [Frame::filled(1, 1, [7; 3])]);
    assert_eq!(done(&inside, "balls clip").0["balls"], 0);
}
