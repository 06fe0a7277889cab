//! A camera, which here is a stream that `ffmpeg` sends in its own time.

use super::{document, folder, text, words, zerre};
use std::fs;
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

pub(super) fn has_ffmpeg() -> bool {
    let found = zerre_vision::frames::ffmpeg::installed("test");
    if let Err(error) = &found {
        assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "{error}");
        eprintln!("SKIPPED: {error}");
    }
    found.is_ok()
}

/// A port that was free a moment ago.
fn port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// Pictures of 640 x 480, so many a second and seconds of them, sent once somebody listens.
fn send(port: u16, rate: u32, seconds: u32) -> Child {
    let input = format!("testsrc=size=640x480:rate={rate}:duration={seconds}");
    let to = format!("tcp://127.0.0.1:{port}");
    let since = Instant::now();
    loop {
        let mut command = Command::new("ffmpeg");
        command.args(["-nostdin", "-v", "error", "-re", "-f", "lavfi", "-i", &input, "-c:v", "mpeg2video"]);
        command.args(["-q:v", "4", "-f", "mpegts", &to]).stderr(Stdio::null());
        let mut child = command.spawn().unwrap();
        // Who finds nobody that listens ends at once.
        std::thread::sleep(Duration::from_millis(400));
        match child.try_wait().unwrap() {
            None => return child,
            Some(_) => assert!(since.elapsed() < Duration::from_secs(60), "nobody listens"),
        }
    }
}

/// Follows a stream with so many particles to its end.
fn follow(out: &Path, particles: &str, rate: u32, seconds: u32) -> Output {
    let port = port();
    let address = format!("tcp://127.0.0.1:{port}?listen=1");
    let child = Command::new(env!("CARGO_BIN_EXE_zerre"))
        .args([
            "fuse",
            &address,
            "--start",
            "320,240",
            "--particles",
            particles,
            "--json",
            "--out",
            text(out),
        ])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut sender = send(port, rate, seconds);
    let output = child.wait_with_output().unwrap();
    let _ = sender.kill();
    sender.wait().unwrap();
    output
}

/// Who is too slow for a camera drops frames: what is followed is never late by much more than the work of
/// one frame, and the frames that were dropped are counted.
#[test]
fn frames_are_dropped_rather_than_late() {
    if !has_ffmpeg() {
        return;
    }
    let out = folder("live");
    let (rate, seconds) = (25, 6);
    let run = follow(&out.join("run"), "60000", rate, seconds);
    let found = document(&run);
    let (frames, dropped) = (found["frames"].as_u64().unwrap(), found["dropped"].as_u64().unwrap());
    assert!(frames > 2 && dropped > frames, "{found}");
    assert!(frames + dropped <= u64::from(rate * seconds), "{found}");
    let stages = &found["latency"]["stages"];
    assert_eq!(found["latency"]["clock"], "wall");
    for stage in ["waiting here", "room", "colour cue", "fusion", "from arrival to estimate"] {
        assert!(stages[stage]["median_ms"].as_f64().unwrap() >= 0.0, "{stage}: {found}");
    }
    // A frame waits at most for the one at work: twice the longest work is the latest that a result comes.
    let longest = |stage: &str| stages[stage]["longest_ms"].as_f64().unwrap();
    let work = longest("tracker, all of it") + longest("room");
    assert!(longest("from arrival to estimate") < 2.0 * work + 1000.0, "{found}");
    let points = fs::read_to_string(out.join("run/points.csv")).unwrap();
    let numbers: Vec<u64> =
        points.lines().skip(1).map(|line| line.split(',').next().unwrap().parse().unwrap()).collect();
    assert!(numbers.windows(2).all(|pair| pair[0] < pair[1]), "{numbers:?}");
    assert!(
        *numbers.last().unwrap() > frames,
        "numbers of frames that were dropped are left out: {numbers:?}"
    );
    let page = fs::read_to_string(out.join("run/report.html")).unwrap();
    assert!(page.contains("Latency per frame and point") && page.contains("dropped"), "{page}");
}

/// Ctrl-C is how a camera's run ends: it is complete.
#[cfg(unix)]
#[test]
fn a_camera_is_followed_until_it_is_told_to_stop() {
    if !has_ffmpeg() {
        return;
    }
    let out = folder("live-stop").join("run");
    let port = port();
    let address = format!("tcp://127.0.0.1:{port}?listen=1");
    let child = Command::new(env!("CARGO_BIN_EXE_zerre"))
        .args(["fuse", &address, "--start", "320,240", "--json", "--out", text(&out)])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut sender = send(port, 10, 60);
    let since = Instant::now();
    // The folder is made when the first frame has come.
    while !out.is_dir() {
        assert!(since.elapsed() < Duration::from_secs(60), "no frame came");
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_millis(1500));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let _ = sender.kill();
    sender.wait().unwrap();
    let found = document(&output);
    assert!(found["state"] == "complete" && found["frames"].as_u64().unwrap() > 0, "{found}");
    assert!(out.join("points.csv").is_file() && out.join("film.png").is_file());
}

#[test]
fn what_a_camera_cannot_do_is_said() {
    for (more, words_of) in [
        (&["--truth", "truth.csv"][..], "--truth needs a recording"),
        (&["--joints", "joints.csv"], "--joints needs a recording"),
        (&["--calibrate", "labels.csv"], "--calibrate needs a recording"),
        (&[], "--start x,y"),
    ] {
        let run = zerre(&[&["fuse", "/dev/video77"], more].concat());
        assert!(!run.status.success() && words(&run).contains(words_of), "{more:?}: {}", words(&run));
    }
    let run = zerre(&["fuse", "/dev/video77", "--start", "1,1"]);
    assert!(!run.status.success() && words(&run).contains("/dev/video77"), "{}", words(&run));
}
