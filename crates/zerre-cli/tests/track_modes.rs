//! `zerre track` with filters for manoeuvring targets: what it writes of the modes, and what it refuses.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use zerre::rng::{Purpose, Stream};

fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("track-modes-{name}"));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

fn command(inside: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_zerre"));
    command.current_dir(inside).arg("track").args(line.split_whitespace()).args(["--out", "out", "--force"]);
    command
}

fn track(inside: &Path, line: &str) -> Output {
    command(inside, line).output().unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

fn written(inside: &Path, name: &str) -> String {
    std::fs::read_to_string(inside.join("out").join(name)).unwrap()
}

/// Names and values of the columns of a table, row by row.
fn cells(table: &str) -> (Vec<&str>, Vec<Vec<&str>>) {
    let mut lines = table.lines().map(|line| line.split(',').collect());
    (lines.next().unwrap(), lines.collect())
}

/// A target at 30 m/s that turns to the left at 0.1 rad/s from 40 s to 80 s, measured to 2 m every second.
fn turn() -> String {
    let mut draws = Stream::new(8).draws(Purpose::Other, 0, 0);
    let (mut x, mut y, mut heading) = (0.0_f64, 0.0_f64, 0.3_f64);
    let mut table = "time_s,id,x_m,y_m\n".to_owned();
    for k in 0..120 {
        heading += if (40..80).contains(&k) { 0.1 } else { 0.0 };
        (x, y) = (x + 30.0 * heading.cos(), y + 30.0 * heading.sin());
        table += &format!("{k},a,{:.3},{:.3}\n", x + 2.0 * draws.normal(), y + 2.0 * draws.normal());
    }
    table
}

/// What [`turn`] was made with.
const KNOWN: &str = "[motion]\nacceleration_sd_mps2 = 0.5\n[motion.modes]\nstay_s = 30\nturn_rate_rad_s = 0.1\n\
                     manoeuvre_factor = 10\n[sensor.default]\nposition_sd_m = 2\n";

/// A drone whose log is bundled: noises and modes are learnt, every row tells a mode, in all outputs; and the
/// bits do not depend on threads.
#[test]
fn filters_with_modes_follow_a_drone() {
    for (filter, shown) in [
        ("mmpf", "mmpf, 2000 particles"),
        ("imm-pf", "imm-pf, 2000 particles"),
        ("rb-mmpf", "rb-mmpf, 100 hypotheses"),
        ("imm-ukf", "imm-ukf"),
    ] {
        let inside = folder(&format!("drone-{filter}"));
        let recording = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../data/uav.csv");
        let line = format!("{} --filter {filter}", recording.display());
        let output = track(&inside, &format!("{line} --threads 1"));
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{said}");
        assert!(said.contains("300 used of 300") && said.contains(shown), "{said}");
        // Particles are measured against the filters of the Kalman family that have the same modes.
        assert_eq!(
            said.contains("for comparison, imm-"),
            filter.ends_with("pf") && filter != "rb-mmpf",
            "{said}"
        );
        let record = |inside: &Path| serde_json::from_str::<Value>(&written(inside, "run.json")).unwrap();
        let first = record(&inside);
        for key in ["stay_s", "turn_rate_rad_s", "manoeuvre_factor"] {
            assert!(first["config"]["motion"]["modes"][key].as_f64().unwrap() > 0.0, "{key}");
        }
        let table = written(&inside, "tracks.csv");
        let (header, rows) = cells(&table);
        assert_eq!((&header[header.len() - 2..], rows.len()), (&["mode", "mode_probability"][..], 300));
        for row in &rows {
            let (mode, probability) = (row[row.len() - 2], row[row.len() - 1]);
            assert!(["straight", "left", "right", "manoeuvre"].contains(&mode), "{mode}");
            // The most probable of four.
            assert!((0.25..=1.0).contains(&probability.parse::<f64>().unwrap()), "{probability}");
        }
        let map: Value = serde_json::from_str(&written(&inside, "tracks.geojson")).unwrap();
        let counts = map["features"][0]["properties"]["modes"].as_object().unwrap();
        assert_eq!(counts.values().map(|n| n.as_u64().unwrap()).sum::<u64>(), 300);
        let page = written(&inside, "report.html");
        assert!(page.contains("mode probabilities: straight, left, right, manoeuvre over time"));
        assert!(page.contains("manoeuvring") && written(&inside, "plan.svg").contains("manoeuvring"));
        assert!(track(&inside, &format!("{line} --threads 2")).status.success());
        assert_eq!(record(&inside)["estimates_digest"], first["estimates_digest"]);
    }
}

/// The turn is in the table as what it is, whatever the filter; another motion has quiet and manoeuvring
/// modes, and filters without modes have no such columns.
#[test]
fn the_table_tells_the_turn() {
    let inside = folder("turn");
    std::fs::write(inside.join("m.csv"), turn()).unwrap();
    std::fs::write(inside.join("c.toml"), KNOWN).unwrap();
    for filter in ["imm-kalman", "imm-ekf", "imm-ukf", "rb-mmpf", "mmpf", "imm-pf"] {
        let output = track(&inside, &format!("m.csv --config c.toml --filter {filter}"));
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let table = written(&inside, "tracks.csv");
        let (_, rows) = cells(&table);
        for (k, row) in rows.iter().enumerate() {
            let expected = match k {
                20..40 | 95..120 => "straight",
                50..80 => "left",
                _ => continue,
            };
            assert_eq!(row[row.len() - 2], expected, "{filter} {k}: {row:?}");
        }
    }
    let learnt = "[motion]\nacceleration_sd_mps2 = 0.5\n[sensor.default]\nposition_sd_m = 2\n";
    std::fs::write(inside.join("c.toml"), learnt).unwrap();
    assert!(track(&inside, "m.csv --config c.toml --filter rb-mmpf --motion singer").status.success());
    let table = written(&inside, "tracks.csv");
    let named: Vec<&str> = cells(&table).1.iter().map(|row| row[row.len() - 2]).collect();
    assert!(named.iter().all(|mode| ["quiet", "manoeuvre"].contains(mode)), "{named:?}");
    assert!(track(&inside, "m.csv --config c.toml --filter ekf").status.success());
    assert!(!written(&inside, "tracks.csv").contains("mode"));
    assert!(!written(&inside, "report.html").contains("mode probabilities"));
}

#[test]
fn a_stream_tells_modes_row_by_row() {
    let inside = folder("stream");
    std::fs::write(inside.join("m.csv"), turn()).unwrap();
    std::fs::write(inside.join("c.toml"), KNOWN).unwrap();
    for filter in ["mmpf", "imm-pf", "rb-mmpf"] {
        let from_file = track(&inside, &format!("m.csv --config c.toml --filter {filter}"));
        assert!(from_file.status.success(), "{}", text(&from_file.stderr));
        let table = written(&inside, "tracks.csv");
        let input = std::fs::File::open(inside.join("m.csv")).unwrap();
        let line = format!("- --config c.toml --filter {filter}");
        let output = command(&inside, &line).stdin(Stdio::from(input)).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        assert_eq!(text(&output.stdout), table, "{filter}");
    }
}

#[test]
fn settings_of_filters_with_modes_are_explained_or_refused() {
    let inside = folder("settings");
    std::fs::write(inside.join("m.csv"), turn()).unwrap();
    for (filter, used, unused) in [
        ("mmpf", "filter.particles = 2000", "filter.resample_when"),
        ("imm-pf", "filter.resampling = \"systematic\"", "filter.roughening"),
        ("rb-mmpf", "filter.particles = 100", "filter.resampling"),
    ] {
        std::fs::write(inside.join("c.toml"), KNOWN).unwrap();
        let output = track(&inside, &format!("m.csv --config c.toml --filter {filter} --explain"));
        let said = text(&output.stderr);
        assert!(said.contains(used) && !said.contains(unused), "{filter}: {said}");
        let roughened = format!("[filter]\nname = \"{filter}\"\nroughening = 0.2\n{KNOWN}");
        std::fs::write(inside.join("c.toml"), roughened).unwrap();
        let output = track(&inside, "m.csv --config c.toml");
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1));
        assert!(said.contains("c.toml:3:1") && said.contains("it is of particle, sir"), "{said}");
        let few = format!("[filter]\nname = \"{filter}\"\nparticles = 10\n{KNOWN}");
        std::fs::write(inside.join("c.toml"), few).unwrap();
        let output = track(&inside, "m.csv --config c.toml");
        let said = text(&output.stderr);
        assert!(output.status.success() && said.contains(&format!("{filter}, 10 ")), "{said}");
    }
}
