//! `zerre track` from outside: what it writes, what it says, how it ends.

use serde_json::Value;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn workspace() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// An empty folder of the test's own.
fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("track-{name}"));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// Runs `zerre track` with outputs in `out/` of the folder.
fn track(inside: &Path, line: &str) -> Output {
    command(inside, line).output().unwrap()
}

fn command(inside: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_zerre"));
    command.current_dir(inside).arg("track").args(line.split_whitespace()).args(["--out", "out", "--force"]);
    command
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

fn record(inside: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(inside.join("out/run.json")).unwrap()).unwrap()
}

fn data(name: &str) -> String {
    workspace().join("data").join(name).display().to_string()
}

/// A large recording, where there is one; continuous integration must have them.
fn recording(path: &str) -> Option<String> {
    let folder = std::env::var_os("ZERRE_DATA").map_or(workspace().join("../shared/data"), PathBuf::from);
    let file = folder.join(path);
    if !file.exists() {
        assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "no recording {}", file.display());
        eprintln!("SKIPPED: no recording {}", file.display());
        return None;
    }
    Some(file.display().to_string())
}

#[test]
fn a_real_recording_gives_all_outputs() {
    let inside = folder("uav");
    let output = track(&inside, &data("uav.csv"));
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(output.stdout.is_empty());
    let said = text(&output.stderr);
    for part in ["tracks", "300 used of 300", "log-evidence", "consistency", "out/report.html"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let file = |name: &str| std::fs::read(inside.join("out").join(name)).unwrap();
    assert_eq!(text(&file("tracks.csv")).lines().count(), 301);
    assert!(file("tracks.parquet").starts_with(b"PAR1"));
    let geo: Value = serde_json::from_slice(&file("tracks.geojson")).unwrap();
    assert_eq!(geo["features"][0]["geometry"]["coordinates"].as_array().unwrap().len(), 300);
    let page = file("report.html");
    assert!(text(&page).contains("2019-12-09T10:51:05Z") && !text(&page).contains("https:"));
    let record = record(&inside);
    for key in
        ["version", "command", "seed", "config", "config_digest", "input", "counts", "outcomes", "seconds"]
    {
        assert!(record.get(key).is_some(), "{key}");
    }
    assert_eq!((&record["state"], &record["counts"]["used"]), (&"complete".into(), &300.into()));
    assert_eq!(record["estimates_digest"].as_str().unwrap().len(), 64);
    assert_eq!(record["config"]["motion"]["model"], "constant-velocity");
    assert!(record["config"]["sensor"]["default"]["position_sd_m"].as_f64().unwrap() > 0.0);
}

/// A detection of a radar is off by metres, as the vessels are long; the tracks must not be farther off than the
/// detections themselves.
#[test]
fn truth_gives_scores() {
    let inside = folder("ferry");
    let line = format!("{} --truth {} --json", data("ferry_radar.csv"), data("ferry_truth.csv"));
    let output = track(&inside, &line);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    let scores = &document["scores"];
    for key in [
        "gospa",
        "gospa_localisation",
        "gospa_missed",
        "gospa_false",
        "rmse_m",
        "nees",
        "coverage95",
        "crps_m",
    ] {
        assert!(scores[key].is_number(), "{key}");
    }
    let detections = Command::new(env!("CARGO_BIN_EXE_zerre"))
        .current_dir(&inside)
        .args(["compare", &data("ferry_radar.csv"), &data("ferry_truth.csv"), "--metric", "rmse", "--json"])
        .output()
        .unwrap();
    let detections: Value = serde_json::from_slice(&detections.stdout).unwrap();
    assert!(scores["rmse_m"].as_f64().unwrap() < detections["scores"]["rmse_m"].as_f64().unwrap());
    assert_eq!(scores["gospa_false"], 0.0);
    let tracks = document["tracks"].as_array().unwrap();
    assert_eq!(tracks.len(), 2);
    for key in ["id", "start", "end", "updates", "missed"] {
        assert!(tracks[0].get(key).is_some(), "{key}");
    }
    // A truth of other targets is no truth.
    std::fs::write(inside.join("other.csv"), "time_s,id,x_m,y_m\n0,x,0,0\n1,y,1,1\n").unwrap();
    let output = track(&inside, &format!("{} --truth other.csv", data("ferry_radar.csv")));
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("no target and time in common"));
}

#[test]
fn neither_threads_nor_instructions_change_the_digest() {
    let inside = folder("bits");
    let mut seen = Vec::new();
    let levels: Vec<&str> = zerre::kernels::Simd::available().iter().map(|level| level.name()).collect();
    for option in ["--threads 1", "--threads 2", "--threads 4"]
        .into_iter()
        .map(str::to_owned)
        .chain(levels.iter().map(|level| format!("--simd {level}")))
    {
        let line = format!("{} --filter particle {option}", data("ferry_radar.csv"));
        assert_eq!(track(&inside, &line).status.code(), Some(0), "{option}");
        seen.push((record(&inside)["estimates_digest"].clone(), record(&inside)["config_digest"].clone()));
    }
    assert!(seen.iter().all(|digests| *digests == seen[0]), "{seen:?}");
    track(&inside, &format!("{} --filter particle --seed 2", data("ferry_radar.csv")));
    assert_ne!(record(&inside)["estimates_digest"], seen[0].0);
}

#[test]
fn explain_gives_a_reason_for_every_value() {
    let inside = folder("explain");
    std::fs::write(
        inside.join("c.toml"),
        "filter = \"ekf\"\n[sensor.default]\nposition_sd_m = 3\nrobust = { kind = \"student-t\", dof = 5 }\n",
    )
    .unwrap();
    let output = track(&inside, &format!("{} --config c.toml --explain", data("ferry_radar.csv")));
    let said = text(&output.stderr);
    for part in [
        "filter.name = \"ekf\"",
        "given: c.toml, line 1",
        "sensor.default.position_sd_m = 3.0",
        "learnt: by maximum likelihood from 133 measurements of 2 targets",
        "default: after five minutes",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    std::fs::write(inside.join("c.toml"), "filter = \"ekff\"\n").unwrap();
    let output = track(&inside, &format!("{} --config c.toml", data("ferry_radar.csv")));
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("c.toml:1:10") && text(&output.stderr).contains("`ekf`"));
}

/// A short recording of two sensors.
fn two_sensors() -> String {
    let rows = (0..20).map(|k| format!("{k},a,{},{},{}\n", ["north", "south"][k % 2], 3 * k, k % 3));
    "time_s,id,sensor,x_m,y_m\n".to_owned() + &rows.collect::<String>()
}

#[test]
fn settings_that_would_have_no_effect_are_refused_where_they_stand() {
    let inside = folder("no-effect");
    std::fs::write(inside.join("two.csv"), two_sensors()).unwrap();
    std::fs::write(inside.join("none.csv"), "time_s,id,x_m,y_m\n0,a,1,1\n1,a,2,1\n").unwrap();
    for (line, config, place, says) in [
        ("two.csv", "[sensor.nroth]\ngate = 0.99\n", "c.toml:1:9", "did you mean `north`?"),
        ("two.csv", "[sensor.default]\n[sensor.\"a b\"]\n", "c.toml:2:9", "known: north, south"),
        ("none.csv", "[sensor.north]\n", "c.toml:1:9", "[sensor.default]"),
        // Parameters of another motion: of the chosen one, of the default, of an option.
        ("two.csv", "[motion]\nmodel = \"random-walk\"\ntau_s = 3\n", "c.toml:3:1", "singer, markov-turn"),
        (
            "two.csv",
            "[motion]\njerk_sd_mps3 = 1\n",
            "c.toml:2:1",
            "`constant-velocity` has no such parameter",
        ),
        ("two.csv --motion wiener-turn", "[motion]\ntau_s = 3\n", "c.toml:2:1", "`wiener-turn` has no such"),
        ("two.csv --motion singer", "[motion]\np_0 = 0.5\n", "c.toml:2:1", "without `a_max_mps2`"),
        (
            "two.csv --motion singer",
            "[motion]\nacceleration_sd_mps2 = 1\na_max_mps2 = 3\n",
            "c.toml:3:1",
            "keep one of the two",
        ),
        // Columns that the recording does not have, or names that there are not.
        ("two.csv", "[input.columns]\nfoo = \"range_m\"\n", "c.toml:2:1", "\"foo\" is not in the header"),
        ("two.csv", "[input.columns]\nx_m = \"range_q\"\n", "c.toml:2:7", "no known column"),
        ("two.csv", "[input]\ncolumns = { x_m = \"y_m\" }\n", "c.toml:2:19", "both give y"),
        (
            "two.csv",
            "[sensor.north]\nposition = { lat_deg = 1, lon_deg = 1 }\n",
            "c.toml:2:1",
            "needs the origin",
        ),
    ] {
        std::fs::write(inside.join("c.toml"), config).unwrap();
        let output = track(&inside, &format!("{line} --config c.toml"));
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{config}: {said}");
        assert!(said.contains(place) && said.contains(says), "{config}: {said}");
        assert!(!inside.join("out/run.json").exists(), "{config}");
    }
    // What has an effect is taken.
    let config = "[motion]\nmodel = \"singer\"\ntau_s = 9\na_max_mps2 = 2\np_0 = 0.5\n[sensor.south]\n\
                  position_sd_m = 1\n[sensor.default]\nposition_sd_m = 2\n";
    std::fs::write(inside.join("c.toml"), config).unwrap();
    let output = track(&inside, "two.csv --config c.toml --filter kalman");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
}

/// Which sensors a stream has is known at its end only.
#[test]
fn a_stream_without_a_sensor_of_the_configuration_ends_with_a_warning() {
    let inside = folder("idle");
    let noises = "filter = \"kalman\"\n[motion]\nacceleration_sd_mps2 = 1\n[sensor.default]\nposition_sd_m = 1\n\
                  [sensor.north]\nposition_sd_m = 1\n";
    for (more, idle) in [("", None), ("[sensor.west]\n[sensor.east]\n", Some(2))] {
        std::fs::write(inside.join("c.toml"), format!("{noises}{more}")).unwrap();
        std::fs::write(inside.join("two.csv"), two_sensors()).unwrap();
        let input = std::fs::File::open(inside.join("two.csv")).unwrap();
        let output = command(&inside, "- --config c.toml").stdin(input).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let count = record(&inside)["outcomes"]["sensor-without-measurements"]["count"].as_u64();
        assert_eq!(count, idle);
        assert_eq!(text(&output.stderr).contains("warning: sensor.west"), idle.is_some());
    }
}

#[test]
fn no_command_writes_over_what_it_reads() {
    let inside = folder("own");
    let out = inside.join("out");
    std::fs::create_dir_all(&out).unwrap();
    let config =
        "filter = \"kalman\"\n[motion]\nacceleration_sd_mps2 = 1\n[sensor.default]\nposition_sd_m = 1\n";
    let scenario = workspace().join("crates/zerre-cli/src/config/scenario.toml");
    let files = [
        ("tracks.csv", two_sensors()),
        ("report.html", config.to_owned()),
        ("track.toml", std::fs::read_to_string(scenario).unwrap()),
        // A record of an earlier run: its files are cleared away.
        (
            "run.json",
            r#"{"program":"zerre","version":"0","command":"x","state":"complete","files":["tracks.csv"]}"#
                .to_owned(),
        ),
    ];
    for folder in [&inside, &out] {
        for (name, content) in &files {
            std::fs::write(folder.join(name), content).unwrap();
        }
    }
    for line in [
        "track out/tracks.csv",
        "track tracks.csv out/tracks.csv",
        "track tracks.csv --config out/report.html",
        "track tracks.csv --truth out/tracks.csv",
        "compare out/tracks.csv tracks.csv",
        "compare tracks.csv out/tracks.csv",
        "simulate out/track.toml",
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_zerre"))
            .current_dir(&inside)
            .args(line.split(' '))
            .args(["--out", "out", "--force"])
            .output()
            .unwrap();
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{line}: {said}");
        assert!(said.contains("the folder out holds the input out/"), "{line}: {said}");
        for (name, content) in &files {
            assert_eq!(&std::fs::read_to_string(out.join(name)).unwrap(), content, "{line}: {name}");
        }
        assert_eq!(std::fs::read_dir(&out).unwrap().count(), files.len(), "{line}");
    }
}

#[test]
fn bad_input_ends_in_words() {
    let inside = folder("bad");
    let long = format!("time_s,id,x_m,y_m\n0,a,1,{}\n", "9".repeat(1 << 21));
    let cases: [(&str, &[u8], &str); 10] = [
        ("empty.csv", b"", "the file is empty"),
        ("header.csv", b"time_s,id,x_m,y_m\n", "no row holds a measurement"),
        ("blank.csv", b"time_s,id,x_m,y_m\n0,a,,\n1,a,,\n", "no row holds a measurement"),
        ("no-header.csv", b"0,1,2\n1,2,3\n", "there is no header"),
        ("latin.csv", b"time_s,id,x_m,y_m\n0,Caf\xe9,1,1\n", "not UTF-8"),
        ("long.csv", long.as_bytes(), "longer than"),
        ("nan.csv", b"time_s,id,x_m,y_m\n0,a,nan,1\n1,a,1,1\n", "max_rejected"),
        (
            "unit.csv",
            b"time_s,id,x_furlong,y_m\n0,a,1,1\n",
            "\"x_furlong\" has an unknown unit; known are x_m, x_km",
        ),
        ("no-id.csv", b"time_s,x_m,y_m\n0,1,1\n1,2,2\n", "no `id`"),
        (
            "bearings.csv",
            b"time_s,id,bearing_deg\n0,a,1\n1,a,2\n2,a,3\n3,a,4\n",
            "position_m and position_sd_m",
        ),
    ];
    for (name, bytes, says) in cases {
        std::fs::write(inside.join(name), bytes).unwrap();
        let output = track(&inside, name);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{name}: {said}");
        assert!(said.starts_with("error: ") && said.contains(says), "{name}: {said}");
        assert!(!inside.join("out/run.json").exists(), "{name}");
    }
    let missing = track(&inside, "no-such-file.csv");
    assert!(text(&missing.stderr).contains("cannot read no-such-file.csv"));
    let resumed = track(&inside, "no-id.csv --single --resume");
    assert_eq!(resumed.status.code(), Some(2));
    assert!(text(&resumed.stderr).contains("leave --resume out"));
}

#[test]
fn odd_input_is_counted() {
    let inside = folder("odd");
    let mut table = "time_s,x_m,y_m\n".to_owned();
    for k in 0..60 {
        table += &format!("{k},{},{}\n", 3 * k, if k % 2 == 0 { 1 } else { 0 });
    }
    // Unsorted, repeated, and after a day.
    table += "30,90,1\n5.5,16,0\n90000,0,0\n90001,3,1\n";
    std::fs::write(inside.join("odd.csv"), table).unwrap();
    for options in ["--filter kalman", "--filter particle", "--filter sis", "--filter ukf --motion singer"] {
        let output = track(&inside, &format!("odd.csv --single --json {options}"));
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let document: Value = serde_json::from_slice(&output.stdout).unwrap();
        let ids: Vec<&str> =
            document["tracks"].as_array().unwrap().iter().map(|t| t["id"].as_str().unwrap()).collect();
        assert_eq!(ids, ["target", "target#2"]);
        assert_eq!(document["outcomes"]["row-out-of-order"]["count"], 2);
        assert_eq!(document["outcomes"]["row-repeated"]["count"], 1);
    }
    std::fs::write(inside.join("one.toml"), "[filter]\nname = \"particle\"\nparticles = 1\n").unwrap();
    let output = track(&inside, "odd.csv --single --config one.toml");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("particle, 1 particle\n"), "{}", text(&output.stderr));
    // A measurement alone is a track of one point, noises being told.
    std::fs::write(inside.join("lone.csv"), "time_s,id,x_m,y_m\n0,a,1,1\n").unwrap();
    let noises = "[motion]\nacceleration_sd_mps2 = 1\n[sensor.default]\nposition_sd_m = 1\n";
    std::fs::write(inside.join("noises.toml"), noises).unwrap();
    let output = track(&inside, "lone.csv --config noises.toml");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
}

#[test]
fn a_noise_that_is_far_off_is_degraded_under_strict() {
    let inside = folder("strict");
    let noises =
        "filter = \"kalman\"\n[motion]\nacceleration_sd_mps2 = 0.1\n[sensor.default]\nposition_sd_m = 0.01\n";
    std::fs::write(inside.join("c.toml"), noises).unwrap();
    let line = format!("{} --config c.toml", data("ferry_radar.csv"));
    assert_eq!(track(&inside, &line).status.code(), Some(0));
    let output = track(&inside, &format!("{line} --strict"));
    assert_eq!(output.status.code(), Some(3));
    assert!(text(&output.stderr).contains("consistency"));
}

#[test]
fn a_stream_answers_row_by_row() {
    let inside = folder("stream");
    let noises = "[motion]\nacceleration_sd_mps2 = 1\n[sensor.default]\nposition_sd_m = 1\n";
    std::fs::write(inside.join("c.toml"), noises).unwrap();
    let mut child = command(&inside, "- --config c.toml")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    let mut output = std::io::BufReader::new(child.stdout.take().unwrap());
    let mut line = || {
        let mut line = String::new();
        std::io::BufRead::read_line(&mut output, &mut line).unwrap();
        line
    };
    input.write_all(b"time_s,id,x_m,y_m\n0,a,0,0\n").unwrap();
    assert!(line().starts_with("id,time_s,x_m,y_m,vx_mps,vy_mps,var_x_m2"));
    assert!(line().starts_with("a,0,"));
    // The answer comes before the next question.
    for k in 1..5 {
        input.write_all(format!("{k},a,{},0\n", 5 * k).as_bytes()).unwrap();
        assert!(line().starts_with(&format!("a,{k},")));
    }
    drop(input);
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(record(&inside)["counts"]["used"], 5);
}

#[test]
fn several_recordings_are_one() {
    let inside = folder("several");
    for (name, shift) in [("north", 0.0), ("south", 0.5)] {
        let mut table = "time_s,id,x_m,y_m\n".to_owned();
        for k in 0..40 {
            let t = f64::from(k) + shift;
            table += &format!("{t},a,{},{}\n", 4.0 * t, f64::from(k % 3));
        }
        std::fs::write(inside.join(format!("{name}.csv")), table).unwrap();
    }
    let output = track(&inside, "north.csv south.csv --json");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    let names: Vec<&str> =
        document["sensors"].as_array().unwrap().iter().map(|s| s["sensor"].as_str().unwrap()).collect();
    assert_eq!(names, ["north, position", "south, position"]);
    assert_eq!(document["tracks"][0]["updates"], 80);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_leaves_nothing_half_written() {
    let inside = folder("full");
    // No file may grow beyond 8 KiB: what a full disk does, for one process.
    let run = format!(
        "ulimit -f 8; trap '' XFSZ; exec {} track {} --out out --force",
        env!("CARGO_BIN_EXE_zerre"),
        data("uav.csv")
    );
    let output = Command::new("bash").current_dir(&inside).args(["-c", &run]).output().unwrap();
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.starts_with("error: cannot write"), "{said}");
    let left: Vec<_> =
        std::fs::read_dir(inside.join("out")).unwrap().flatten().map(|e| e.file_name()).collect();
    assert!(!left.iter().any(|name| name.to_string_lossy().contains("tracks")), "{left:?}");
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output =
        command(&inside, &format!("{} --json", data("ferry_radar.csv"))).stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("cannot write to standard output"));
}

#[test]
fn flights_ships_and_surface_radar() {
    for (path, tracks, used) in [
        ("adsb_ais_uav/OpenSky_Plane_States.csv", 36, 2210),
        ("adsb_ais_uav/SolentAIS_20160112_130211.csv", 50, 11207),
        ("lebl_smr/lebl_smr_28800_30600.csv", 1, 8261),
    ] {
        let Some(file) = recording(path) else { continue };
        let inside = folder("real");
        let output = track(&inside, &format!("{file} --json"));
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let document: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(document["counts"]["used"], used, "{path}");
        assert!(document["tracks"].as_array().unwrap().len() >= tracks, "{path}");
        assert!(inside.join("out/tracks.geojson").exists(), "{path}");
    }
}

#[cfg(unix)]
#[test]
fn a_run_that_is_stopped_keeps_what_it_has() {
    use std::time::Duration;
    let inside = folder("stopped");
    let mut table = "time_s,id,x_m,y_m\n".to_owned();
    for k in 0..200_000 {
        table += &format!("{k},a,{},{}\n", 3 * k, k % 2);
    }
    std::fs::write(inside.join("long.csv"), table).unwrap();
    // Some minutes of work.
    let settings = "[filter]\nname = \"particle\"\nparticles = 20000\n[motion]\nacceleration_sd_mps2 = 1\n\
                    [sensor.default]\nposition_sd_m = 1\n";
    std::fs::write(inside.join("c.toml"), settings).unwrap();
    let child = command(&inside, "long.csv --config c.toml --threads 1")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Long enough to read the table and to listen for the signal, on a slow machine too.
    std::thread::sleep(Duration::from_secs(5));
    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-TERM", &id]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("stopped before the end"), "{said}");
    assert_eq!(record(&inside)["state"], "interrupted");
    let rows = std::fs::read_to_string(inside.join("out/tracks.csv")).unwrap();
    let written = rows.lines().count() as u64 - 1;
    assert!((0..200_000).contains(&written), "{written}");
    // What was not reached was not used.
    let counts = &record(&inside)["counts"];
    assert_eq!((&counts["read"], &counts["used"]), (&200_000.into(), &written.into()));
    assert_eq!(counts["left_out"]["not reached"], 200_000 - written);
    assert!(rows.ends_with('\n'));
}

/// A first measurement far off, and a gate: without a restart nothing would ever reach the track again.
#[test]
fn a_track_that_its_gate_locks_out_is_restarted_and_said() {
    let inside = folder("locked-out");
    let mut table = "time_s,id,x_m,y_m\n".to_owned();
    for k in 0..200 {
        let scatter = f64::from(k * 37 % 11) / 5.0 - 1.0;
        let x = if k == 0 { 300.0 } else { 10.0 * f64::from(k) } + scatter;
        table += &format!("{k},a,{x},{}\n", 100.0 - scatter);
    }
    std::fs::write(inside.join("m.csv"), table).unwrap();
    let settings = "filter = \"ekf\"\n[motion]\nacceleration_sd_mps2 = 0.05\n[start]\nspeed_sd_mps = 15\n\
                    [sensor.default]\nposition_sd_m = 1\ngate = 0.999\n";
    std::fs::write(inside.join("c.toml"), settings).unwrap();
    let output = track(&inside, "m.csv --config c.toml --strict --json");
    assert_eq!(output.status.code(), Some(3), "{}", text(&output.stderr));
    let said = text(&output.stderr);
    assert!(said.contains("track lost") && said.contains("1 time, started anew"), "{said}");
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(document["restarts"], serde_json::json!({ "gate": 1, "degenerate": 0 }));
    assert_eq!(document["outcomes"]["restarted"]["count"], 1);
    let rows = std::fs::read_to_string(inside.join("out/tracks.csv")).unwrap();
    assert_eq!(rows.lines().filter(|row| row.ends_with(",restarted")).count(), 1);
    assert!(rows.lines().filter(|row| row.ends_with(",gated")).count() < 10);
    let last: Vec<f64> =
        rows.lines().last().unwrap().split(',').skip(2).take(2).map(|v| v.parse().unwrap()).collect();
    // Ten standard deviations.
    assert!((last[0] - 1990.0).abs() < 10.0 && (last[1] - 100.0).abs() < 10.0, "{last:?}");
    // The setting holds: with a number that is never reached the track stays where it was.
    std::fs::write(inside.join("c.toml"), format!("{settings}[track]\nrestart_after_gated = 1000\n"))
        .unwrap();
    let output = track(&inside, "m.csv --config c.toml --strict --json");
    assert_eq!(output.status.code(), Some(3), "so many refusals are a finding: {}", text(&output.stderr));
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(document["restarts"]["gate"], 0);
    let verdict = document["sensors"][0]["verdict"].as_str().unwrap();
    assert!(verdict.starts_with("the gate refused 1"), "{verdict}");
}

/// The picture of the first page is what its caption says.
#[test]
fn the_picture_of_the_readme_is_what_the_command_makes() {
    let inside = folder("picture");
    assert!(track(&inside, &data("ferry_radar.csv")).status.success());
    let made = std::fs::read(inside.join("out/plan.svg")).unwrap();
    let shown = std::fs::read(workspace().join("docs/track.svg")).unwrap();
    assert!(
        made == shown,
        "docs/track.svg is not the picture that the program makes; renew it by `cargo run --release -- track \
         data/ferry_radar.csv --out made`, then copy made/plan.svg to docs/track.svg"
    );
}

/// The radar of the ferry trails its targets: the tracks agree with it, and not with the truth.
#[test]
fn what_the_truth_contradicts_is_said_in_a_sentence() {
    let inside = folder("offset");
    let output =
        track(&inside, &format!("{} --truth {} --json", data("ferry_radar.csv"), data("ferry_truth.csv")));
    let said = text(&output.stderr);
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    let sentence = document["against_truth"].as_str().unwrap();
    for part in [
        "farther from the truth",
        "track 1 is off by (+2.",
        "track 2 is off by (-5.",
        "without the mean offset",
    ] {
        assert!(sentence.contains(part), "{part}: {sentence}");
    }
    assert!(said.contains(sentence), "{said}");
    let page = std::fs::read_to_string(inside.join("out/report.html")).unwrap();
    assert!(page.contains("Against the truth") && page.contains("track 1 is off by"));
    assert_eq!(document["offsets"].as_array().unwrap().len(), 2);
    let nees = |value: &Value| value["nees"].as_f64().unwrap();
    assert!(nees(&document["without_offsets"]) < 0.5 * nees(&document["scores"]));
}

#[test]
fn what_was_read_and_not_used_is_in_the_summary() {
    let inside = folder("rows");
    let header = "time_s,id,x_m,y_m,range_m,bearing_deg\n";
    std::fs::write(inside.join("m.csv"), format!("{header}2,a,1,1,,\n1,a,0,0,,\n3,a,2,2,,\n4,a,,,,\n"))
        .unwrap();
    let settings =
        "filter = \"ekf\"\n[motion]\nacceleration_sd_mps2 = 1\n[sensor.default]\nposition_sd_m = 1\n";
    std::fs::write(inside.join("c.toml"), settings).unwrap();
    let output = track(&inside, "m.csv --config c.toml");
    let said = text(&output.stderr);
    for part in ["1 of 4: 1 no measurement", "rows sorted", "1 row earlier"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let page = std::fs::read_to_string(inside.join("out/report.html")).unwrap();
    for part in [
        "4 rows read: 3 used, 1 left out (no measurement: 1)",
        "1 of them were out of order",
        "cells were empty",
    ] {
        assert!(page.contains(part), "{part}");
    }
    // Nothing to learn from, and a motion that nothing sees: told as what they are.
    std::fs::write(inside.join("one.csv"), "time_s,id,x_m,y_m\n1,a,0,0\n").unwrap();
    let said = track(&inside, "one.csv");
    assert!(text(&said.stderr).contains("no target is measured more than once"), "{}", text(&said.stderr));
    std::fs::write(inside.join("g.toml"), "motion = \"growth\"\n").unwrap();
    let output = track(&inside, "m.csv --config g.toml");
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        said.contains("g.toml:1") && said.contains("of a benchmark") && !said.contains("position_sd_m"),
        "{said}"
    );
}

/// A filter that never resamples collapses: its scores are beyond all measure, and still short.
#[test]
fn no_number_of_the_summary_is_long() {
    let inside = folder("digits");
    let made = Command::new(env!("CARGO_BIN_EXE_zerre"))
        .current_dir(&inside)
        .args(["simulate", "radar-cv", "--seed", "7", "--out", "made"])
        .status()
        .unwrap();
    assert!(made.success());
    let line = "made/measurements.csv --config made/track.toml --truth made/truth.csv --filter sis";
    let output = track(&inside, line);
    let said = text(&output.stderr);
    assert!(said.contains("\nnees "), "{said}");
    let digits = |word: &str| word.chars().filter(char::is_ascii_digit).count();
    let scores = said.lines().filter(|line| !line.contains('/'));
    for word in scores.flat_map(str::split_whitespace) {
        assert!(digits(word) <= 8, "{word}: {said}");
    }
}

#[cfg(unix)]
#[test]
fn every_command_that_is_stopped_says_so_by_its_exit_code() {
    let inside = folder("stopped-simulation");
    let child = Command::new(env!("CARGO_BIN_EXE_zerre"))
        .current_dir(&inside)
        .args(["simulate", "radar-cv", "--runs", "1000000", "--out", "made"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_secs(2));
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    let record = std::fs::read(inside.join("made/run.json")).unwrap();
    assert_eq!(serde_json::from_slice::<Value>(&record).unwrap()["state"], "interrupted");
    std::fs::remove_dir_all(&inside).unwrap();
}
