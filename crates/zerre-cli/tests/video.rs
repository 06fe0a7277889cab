//! `zerre video` and `zerre otb` on pictures that the tests make, and on real sequences.

use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use zerre_vision::frames::folder::png;
use zerre_vision::{Frame, Image};

/// An empty folder of the test's own.
fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("video-{name}"));
    let _ = fs::remove_dir_all(&path);
    fs::create_dir_all(&path).unwrap();
    path
}

/// A real sequence, where there is one; continuous integration must have them.
fn recorded(name: &str) -> Option<PathBuf> {
    let beside = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let path = std::env::var_os("ZERRE_DATA").map_or_else(beside, PathBuf::from).join("otb").join(name);
    if !path.exists() {
        assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "no sequence {}", path.display());
        eprintln!("SKIPPED: no sequence {}", path.display());
        return None;
    }
    Some(path)
}

fn has_ffmpeg() -> bool {
    let found = zerre_vision::frames::ffmpeg::installed("test");
    if let Err(error) = &found {
        assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "{error}");
        eprintln!("SKIPPED: {error}");
    }
    found.is_ok()
}

/// A textured square of 16 px on a textured ground, `k` px to the right of where it began.
fn scene(k: usize) -> Frame {
    Image::from_fn(96, 64, |x, y| {
        let inside = (20 + k..36 + k).contains(&x) && (24..40).contains(&y);
        if inside {
            [200, ((x - k) * 37 % 97) as u8, (y * 53 % 89) as u8]
        } else {
            [(x * 7 % 31) as u8, 60, (y * 5 % 29) as u8]
        }
    })
}

/// A folder `seq` of `count` frames with `groundtruth_rect.txt`.
fn sequence(inside: &Path, count: usize) -> PathBuf {
    let path = inside.join("seq");
    fs::create_dir_all(path.join("img")).unwrap();
    let mut truth = String::new();
    for k in 0..count {
        fs::write(path.join(format!("img/{:04}.png", k + 1)), png(&scene(k)).unwrap()).unwrap();
        truth += &format!("{}\t25\t16\t16\n", 21 + k);
    }
    fs::write(path.join("groundtruth_rect.txt"), truth).unwrap();
    path
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

/// Runs to its refusal; gives what was said.
fn refused(inside: &Path, line: &str, code: i32) -> String {
    let output = zerre(inside, &format!("{line} --out out --force"));
    let said = text(&output.stderr).to_owned();
    assert_eq!(output.status.code(), Some(code), "{line}: {said}");
    assert!(!said.contains("met a bug"), "{said}");
    said
}

fn record(inside: &Path) -> Value {
    serde_json::from_slice(&fs::read(inside.join("out/run.json")).unwrap()).unwrap()
}

fn rows(inside: &Path, name: &str) -> Vec<Vec<String>> {
    let text = fs::read_to_string(inside.join("out").join(name)).unwrap();
    text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

#[test]
fn an_annotated_sequence_brings_its_box_and_its_truth() {
    let inside = folder("annotated");
    sequence(&inside, 15);
    let (document, _) = done(&inside, "video seq --tracker still --overlay seen.gif");
    assert_eq!((&document["frames"], &document["state"]), (&15.into(), &"complete".into()));
    assert_eq!(document["box"]["x"], 20.0);
    // The still box errs by 0, 1, ..., 14 px.
    let mean_square = (0..15).map(|k| f64::from(k * k)).sum::<f64>() / 15.0;
    assert!((document["scores"]["rmse_px"].as_f64().unwrap() - mean_square.sqrt()).abs() < 1e-9);
    let rows = rows(&inside, "boxes.csv");
    assert_eq!(rows[0], ["frame", "x", "y", "w", "h", "p_lost", "var_x", "var_y"]);
    assert_eq!((rows.len(), &rows[15][..5]), (16, &["14", "20", "24", "16", "16"].map(str::to_owned)[..]));
    let page = fs::read_to_string(inside.join("out/report.html")).unwrap();
    for part in ["film.png", "Error of the centre", "Probability of being lost", "Against the truth"] {
        assert!(page.contains(part), "{part}");
    }
    let film = zerre_vision::frames::folder::frame(&inside.join("out/film.png")).unwrap();
    assert_eq!(film.size(), (4 * 304 - 4, 3 * 204 - 4));
    assert!(fs::read(inside.join("seen.gif")).unwrap().starts_with(b"GIF89a"));
    let record = record(&inside);
    assert_eq!(record["counts"]["used"], 15);
    assert_eq!(record["estimates_digest"], document["estimates_digest"]);
    assert_eq!(record["input"].as_array().unwrap().len(), 2);
}

#[test]
fn bad_input_is_refused_with_a_way_out() {
    let inside = folder("refused");
    let path = sequence(&inside, 3);
    fs::write(inside.join("nan.txt"), "NaN NaN NaN NaN\n").unwrap();
    fs::write(inside.join("bad.txt"), "1,2,3,4\n1,2,x,4\n").unwrap();
    fs::create_dir(inside.join("empty")).unwrap();
    for (line, code, says) in [
        ("video seq --box 200,10,16,16", 1, "lies outside the frame of 96 x 64 pixels"),
        ("video seq --box 10,10,1,16", 1, "smaller than 2 x 2"),
        ("video seq --box 10,10,NaN,16", 1, "not finite"),
        ("video seq/img", 1, "give --box x,y,w,h in pixels of the first frame, which has 96 x 64"),
        ("video seq/img --truth nan.txt", 1, "the truth has no box to start from"),
        ("video seq/img --truth bad.txt", 1, "bad.txt, line 2: `x` is not a number"),
        ("video empty --box 1,1,9,9", 1, "there is no picture: jpg, jpeg, png are read"),
        ("video nowhere.mp4 --box 1,1,9,9", 1, "there is no such file or folder"),
        ("video seq --tracker stil", 2, "did you mean `still`?"),
        ("video seq --overlay seen.avi", 2, "neither .mp4 nor .gif"),
        ("video seq --overlay nowhere/seen.gif", 1, "there is no folder nowhere"),
        ("otb empty", 1, "there is no picture"),
        ("otb seq seq", 1, "two sequences have the name seq"),
        ("otb seq --tracker kcf", 2, "there is no tracker `kcf`"),
        ("otb seq --results nowhere.txt", 1, "nowhere.txt: it cannot be read"),
    ] {
        let said = refused(&inside, line, code);
        assert!(said.contains(says), "{line}: {said}");
    }
    for line in ["video seq --out seq/img --force", "otb seq --out seq/img --force"] {
        let output = zerre(&inside, line);
        assert!(
            text(&output.stderr).contains("the folder seq/img holds the input"),
            "{}",
            text(&output.stderr)
        );
    }
    fs::write(path.join("img/0001.png"), "no picture").unwrap();
    let said = refused(&inside, "video seq", 1);
    assert!(said.contains("0001.png: it is no readable picture"), "{said}");
    assert!(!inside.join("out/boxes.csv").exists());
}

#[test]
fn bad_frames_are_counted_and_the_rest_is_followed() {
    let inside = folder("frames");
    let path = sequence(&inside, 8);
    let picture = fs::read(path.join("img/0003.png")).unwrap();
    fs::write(path.join("img/0003.png"), &picture[..picture.len() / 2]).unwrap();
    fs::write(path.join("img/0004.png"), png(&Frame::filled(20, 20, [0; 3])).unwrap()).unwrap();
    fs::remove_file(path.join("img/0005.png")).unwrap();
    fs::write(path.join("img/notes.txt"), "").unwrap();
    let (document, said) = done(&inside, "video seq --tracker still --overlay seen.gif");
    assert_eq!((&document["frames"], &document["unreadable"]), (&8.into(), &3.into()));
    for part in ["0003.png", "0004.png: it has 20 x 20 pixels", "no picture with the number 5"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let counts = record(&inside)["counts"].clone();
    assert_eq!((&counts["read"], &counts["used"]), (&8.into(), &5.into()));
    assert_eq!(counts["rejected"]["unreadable frame"], 3);
    assert_eq!(counts["left_out"]["file that is no picture"], 1);
}

#[test]
fn several_targets_are_chosen_by_their_annotation() {
    let inside = folder("targets");
    let path = sequence(&inside, 4);
    fs::rename(path.join("groundtruth_rect.txt"), path.join("groundtruth_rect.1.txt")).unwrap();
    fs::write(path.join("groundtruth_rect.2.txt"), "5,5,8,8\n5,5,8,8\n5,5,8,8\n5,5,8,8\n").unwrap();
    let said = refused(&inside, "video seq --tracker still", 1);
    assert!(said.contains("seq has 2 targets") && said.contains("groundtruth_rect.2.txt"), "{said}");
    let (document, _) = done(&inside, "video seq --tracker still --truth seq/groundtruth_rect.2.txt");
    assert_eq!((&document["box"]["x"], &document["scores"]["iou"]), (&4.0.into(), &1.0.into()));
    let (document, _) = done(&inside, "otb seq --tracker still");
    let names: Vec<_> = document["rows"].as_array().unwrap().iter().map(|row| &row["sequence"]).collect();
    assert_eq!(names, ["seq.1", "seq.2"]);
}

#[test]
fn videos_are_followed_and_films_are_written() {
    if !has_ffmpeg() {
        return;
    }
    let inside = folder("film");
    sequence(&inside, 12);
    let made = Command::new("ffmpeg")
        .args(["-v", "error", "-framerate", "10", "-i", "seq/img/%04d.png", "-c:v", "mpeg4", "-q:v", "2"])
        .args(["-movflags", "+faststart", "clip.mp4"])
        .current_dir(&inside)
        .status();
    assert!(made.unwrap().success());
    let (document, said) =
        done(&inside, "video clip.mp4 --tracker still --box 20,24,16,16 --overlay seen.mp4");
    assert_eq!((&document["frames"], &document["unreadable"]), (&12.into(), &0.into()), "{said}");
    // The film is a video of the same length, large enough to see something.
    let mut film = zerre_vision::frames::Frames::open(inside.join("seen.mp4").to_str().unwrap()).unwrap();
    assert_eq!((film.expected(), film.rate()), (Some(12), Some(10.0)));
    assert_eq!(film.next().unwrap().frame.unwrap().size(), (320, 214));
    assert!(!inside.join(".seen.mp4.partial").exists());
    // A video that ends early gives what it has.
    let bytes = fs::read(inside.join("clip.mp4")).unwrap();
    fs::write(inside.join("cut.mp4"), &bytes[..bytes.len() * 2 / 3]).unwrap();
    let (document, said) = done(&inside, "video cut.mp4 --tracker still --box 20,24,16,16");
    let frames = document["frames"].as_u64().unwrap() as usize;
    assert!((1..12).contains(&frames) && said.contains("of the 12 frames that its header claims"), "{said}");
    assert_eq!(rows(&inside, "boxes.csv").len(), frames + 1);
    assert!(record(&inside)["outcomes"]["video ended early or is damaged"].is_object());
}

#[test]
fn trackers_are_scored_with_others_beside() {
    let inside = folder("scored");
    let path = sequence(&inside, 24);
    fs::create_dir(inside.join("exact")).unwrap();
    fs::copy(path.join("groundtruth_rect.txt"), inside.join("exact/seq.txt")).unwrap();
    let line = "otb seq --tracker still --repeat 2 --protocol one-pass --protocol spatial --results exact";
    let (document, _) = done(&inside, line);
    let all = document["rows"].as_array().unwrap();
    for key in ["sequence", "tracker", "rmse_px", "precision20", "success_auc", "fps", "frames", "repeat"] {
        assert!(all.iter().all(|row| row.get(key).is_some()), "{key}");
    }
    let of = |tracker: &str, protocol: &str| -> Vec<&Value> {
        all.iter().filter(|row| row["tracker"] == tracker && row["protocol"] == protocol).collect()
    };
    assert_eq!((of("still", "one-pass").len(), of("still", "spatial").len()), (2, 2));
    assert_eq!(of("still", "one-pass")[0]["precision20"], 21.0 / 24.0);
    assert_eq!(of("still", "spatial")[0]["frames"], 12 * 24);
    let exact = of("exact", "one-pass");
    assert_eq!((exact.len(), &exact[0]["rmse_px"], &exact[0]["fps"]), (1, &0.0.into(), &Value::Null));
    // All but the last of the 21 thresholds lie below an overlap of 1.
    assert_eq!(exact[0]["success_auc"], 20.0 / 21.0);
    assert_eq!(rows(&inside, "scores.csv").len(), 1 + 5);
    let summary = rows(&inside, "summary.csv");
    assert_eq!(summary.iter().filter(|row| row[1] == "all").count(), 3);
    let page = fs::read_to_string(inside.join("out/report.html")).unwrap();
    for part in
        ["Success [area under the curve]", "Precision [at 20 px]", "Spatial robustness", "exact [0.952]"]
    {
        assert!(page.contains(part), "{part}");
    }
    // The boxes that were written are scored as they were.
    fs::copy(inside.join("out/boxes-still-seq.csv"), inside.join("again.csv")).unwrap();
    let (document, _) = done(&inside, "otb seq --tracker still --results again.csv");
    let both = document["rows"].as_array().unwrap();
    assert_eq!((both.len(), &both[1]["tracker"]), (2, &"again".into()));
    assert_eq!(both[0]["success_auc"], both[1]["success_auc"]);
    let output = zerre(&inside, "otb seq --tracker still --out table");
    assert!(text(&output.stdout).contains("success_auc") && text(&output.stdout).contains("mean of 1"));
}

/// The number of threads changes nothing but times.
#[test]
fn scores_do_not_depend_on_threads() {
    let inside = folder("threads");
    sequence(&inside, 30);
    let digest = |threads: usize| {
        let line = format!("otb seq --protocol temporal --protocol one-pass --repeat 2 --threads {threads}");
        done(&inside, &line).0["estimates_digest"].clone()
    };
    assert_eq!(digest(1), digest(3));
}

#[test]
fn real_sequences_are_scored() {
    let Some(deer) = recorded("Deer") else { return };
    let inside = folder("real");
    let (document, said) = done(&inside, &format!("otb {} --tracker still", deer.display()));
    let row = &document["rows"][0];
    assert_eq!((&row["sequence"], &row["frames"]), (&"Deer".into(), &71.into()), "{said}");
    // Deer leaps about: a box that stays meets it now and then, and in no half of the frames.
    let precision = row["precision20"].as_f64().unwrap();
    assert!(precision > 0.0 && precision < 0.5, "{precision}");
}

/// Asks the page's server, as a browser does.
fn ask(address: &str, request: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    String::from_utf8_lossy(&answer).into_owned()
}

/// With a display and without a box, a page shows the first frame; a bad box is refused there, a good one followed.
#[test]
fn a_box_can_be_drawn() {
    let here = folder("drawn");
    let seq = sequence(&here, 4);
    fs::remove_file(seq.join("groundtruth_rect.txt")).unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_zerre"))
        .args(["video", "seq", "--out", "out"])
        .current_dir(&here)
        .env("DISPLAY", ":none")
        .env("PATH", "")
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let line = lines.find(|line| line.as_ref().is_ok_and(|l| l.contains("http://"))).unwrap().unwrap();
    let (address, key) = line.split("http://").nth(1).unwrap().split_once('/').unwrap();
    let key = key.split('/').next().unwrap();
    let request = |method: &str, path: &str, body: &str| {
        let length = body.len();
        let head = "Host: 127.0.0.1\r\nConnection: close";
        ask(address, &format!("{method} {path} HTTP/1.1\r\n{head}\r\nContent-Length: {length}\r\n\r\n{body}"))
    };
    let get = |path: &str| request("GET", &format!("/{key}/{path}"), "");
    let post = |body: &str| request("POST", &format!("/{key}/box"), body);
    assert!(get("").contains("Which object?") && request("GET", "/", "").starts_with("HTTP/1.1 404"));
    assert!(get("frame.png").contains("PNG") && get("other").starts_with("HTTP/1.1 404"));
    assert!(post("1,2,3").contains("four numbers") && post("500,2,9,9").contains("outside the frame"));
    assert!(post("20,24,16,16").starts_with("HTTP/1.1 200"));
    assert!(child.wait().unwrap().success());
    let boxes = fs::read_to_string(here.join("out/boxes.csv")).unwrap();
    assert_eq!(boxes.lines().count(), 5);
    assert!(boxes.lines().nth(1).unwrap().starts_with("0,20,24,16,16,"), "{boxes}");
}
