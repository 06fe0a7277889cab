//! `zerre track` on input that somebody got wrong, or that wants to get something wrong: what is said of it, and
//! what reaches the outputs.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// Noises, so that a few rows are enough.
const NOISES: &str = "[motion]\nacceleration_sd_mps2 = 1\n[sensor.default]\nposition_sd_m = 1\n";

/// An empty folder of the test's own, with a configuration `noises.toml`.
fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("track-input-{name}"));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    std::fs::write(path.join("noises.toml"), NOISES).unwrap();
    path
}

fn command(inside: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_zerre"));
    command.current_dir(inside).arg("track").args(line.split_whitespace()).args(["--out", "out", "--force"]);
    command
}

/// Runs `zerre track` with outputs in `out/`; gives exit code and what it said.
fn track(inside: &Path, line: &str) -> (i32, String) {
    let output = command(inside, line).output().unwrap();
    (output.status.code().unwrap(), text(&output.stderr).to_owned())
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

fn read(inside: &Path, name: &str) -> String {
    std::fs::read_to_string(inside.join("out").join(name)).unwrap()
}

/// A target that goes east at 5 m/s with a weave of half a metre.
fn rows(id: &str, count: i32, start_s: i32, north_m: i32) -> String {
    let row =
        |k: i32| format!("{},{id},{},{}\n", start_s + k, 5 * k, f64::from(north_m) + f64::from(k % 2) / 2.0);
    (0..count).map(row).collect()
}

fn table(inside: &Path, name: &str, rows: &[String]) {
    std::fs::write(inside.join(name), format!("time_s,id,x_m,y_m\n{}", rows.concat())).unwrap();
}

#[test]
fn identities_that_are_markup_stay_text() {
    let inside = folder("markup");
    let ids = [
        "<script>alert(1)</script>",
        "</title></svg></script><script>alert(2)</script>",
        "\"onload=alert(3) x=\"",
        "'&amp;<!--",
        "]]>\u{2028}=1+1",
    ];
    let mut rows = String::from("time_s,id,lat_deg,lon_deg\n");
    for (i, id) in ids.iter().enumerate() {
        for k in 0..4 {
            let quoted = id.replace('"', "\"\"");
            rows += &format!("{k},\"{quoted}\",{},{}\n", 50.0 + f64::from(k) * 1e-5, i);
        }
    }
    std::fs::write(inside.join("in.csv"), rows).unwrap();
    let (code, said) = track(&inside, "in.csv --config noises.toml --filter kalman");
    assert_eq!(code, 0, "{said}");
    for name in ["report.html", "plan.svg"] {
        let page = read(&inside, name);
        for bad in ["<script>alert", "</title></svg></script>", "\"onload=", "'&amp;<!--"] {
            assert!(!page.contains(bad), "{name} holds {bad}");
        }
        assert!(page.contains("&lt;script&gt;alert(1)"), "{name} tells the identity");
    }
    let geo: Value = serde_json::from_str(&read(&inside, "tracks.geojson")).unwrap();
    let mut told: Vec<&str> = geo["features"]
        .as_array()
        .unwrap()
        .iter()
        .map(|feature| feature["properties"]["id"].as_str().unwrap())
        .collect();
    let mut want = ids.to_vec();
    told.sort_unstable();
    want.sort_unstable();
    assert_eq!(told, want);
    let csv = read(&inside, "tracks.csv");
    let mut csv = csv::Reader::from_reader(csv.as_bytes());
    let mut back: Vec<String> = csv.records().map(|record| record.unwrap()[0].to_owned()).collect();
    back.sort_unstable();
    back.dedup();
    assert_eq!(back, want);
}

#[test]
fn later_tracks_have_names_of_their_own() {
    let inside = folder("names");
    let of = |id, start_s, north_m| rows(id, 4, start_s, north_m);
    table(&inside, "in.csv", &[of("A", 0, 0), of("A", 90_000, 0), of("A#2", 0, 300), of("A#2", 90_000, 300)]);
    let output = command(&inside, "in.csv --config noises.toml --filter particle --json").output().unwrap();
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    let tracks = document["tracks"].as_array().unwrap();
    let told: Vec<_> =
        tracks.iter().map(|t| (t["id"].as_str().unwrap(), t["updates"].as_u64().unwrap())).collect();
    assert_eq!(told, [("A", 4), ("A#2", 4), ("A#2#1", 4), ("A#2#2", 4)]);
    // The second track of A is where A is.
    let csv = read(&inside, "tracks.csv");
    let of_a: Vec<&str> = csv.lines().filter(|line| line.starts_with("A#2,")).collect();
    assert!(
        of_a.iter().all(|line| line.split(',').nth(3).unwrap().parse::<f64>().unwrap() < 100.0),
        "{of_a:?}"
    );
}

#[test]
fn every_refusal_names_its_file_and_place() {
    let inside = folder("messages");
    std::fs::create_dir(inside.join("folder")).unwrap();
    let write = |name: &str, text: &str| std::fs::write(inside.join(name), text).unwrap();
    table(&inside, "one.csv", &[rows("a", 1, 0, 0)]);
    table(&inside, "two.csv", &[rows("a", 2, 0, 0)]);
    write("upper.csv", "TIME_S,id,x_m,y_m\n0,a,1,1\n");
    write("upper-id.csv", "time_s,ID,x_m,y_m\n0,a,1,1\n");
    write("furlong.csv", "time_s,id,x_furlong,y_m\n0,a,1,1\n");
    write("late.csv", "time_s,id,x_m,y_m\n1626098398996,a,1,1\n");
    write("bearing.csv", "time_s,id,bearing_deg\n0,a,1\n1,a,2\n2,a,3\n");
    write("bearings.toml", "[motion]\nacceleration_sd_mps2 = 1\n[sensor.default]\nbearing_sd_deg = 1\n");
    write("flat.csv", "time_s,id,x_m,y_m\n0,a,1,1\n");
    write("deep.csv", "time_s,id,range_m,bearing_deg,elevation_deg\n0,a,1,1,1\n");
    let keys = "acceleration_sd_mps2 under [motion]";
    let cases: [(&str, &[&str]); 12] = [
        (
            "one.csv",
            &["one.csv: no target is measured more than once", keys, "position_sd_m under [sensor.default]"],
        ),
        ("two.csv", &["two.csv: 2 measurements are too few", keys]),
        ("upper.csv", &["upper.csv: column \"TIME_S\" is not known, \"time_s\" is; did you mean it?"]),
        ("upper-id.csv", &["upper-id.csv, line 2", "the column \"ID\" is not read; did you mean id?"]),
        ("furlong.csv", &["furlong.csv: column \"x_furlong\"", "known are x_m, x_km"]),
        ("late.csv", &["late.csv: 1 of 1", "line 2, time_s \"1626098398996\": ", "9223372036 s (292 years)"]),
        ("bearing.csv --config bearings.toml", &["bearing.csv, line 2: ", "position_m and position_sd_m"]),
        ("flat.csv deep.csv", &["flat.csv: positions in three dimensions need", "elevations are measured"]),
        ("folder", &["cannot read folder: is a directory"]),
        ("no-such.csv", &["cannot read no-such.csv: "]),
        ("one.csv --truth folder", &["cannot read folder: is a directory"]),
        ("one.csv --truth no-such.csv", &["cannot read no-such.csv: "]),
    ];
    for (line, parts) in cases {
        let (code, said) = track(&inside, line);
        assert_eq!(code, 1, "{line}: {said}");
        assert!(said.lines().any(|line| line.starts_with("error: ")), "{line}: {said}");
        for part in parts {
            assert!(said.contains(part), "{line}: {part}: {said}");
        }
        assert!(!inside.join("out/run.json").exists(), "{line}");
    }
}

#[test]
fn a_long_header_is_not_printed_whole() {
    let inside = folder("header");
    let mut header = format!("time_s,id,x_m,y_m,{}", "z".repeat(100_000));
    let mut cells = String::from("a,1,1,1");
    for k in 0..50 {
        header += &format!(",extra{k}");
        cells += ",1";
    }
    std::fs::write(inside.join("in.csv"), format!("{header}\n0,{cells}\n1,{cells}\n")).unwrap();
    let (code, said) = track(&inside, "in.csv --config noises.toml");
    assert_eq!(code, 0, "{said}");
    assert!(said.len() < 3000 && said.contains("zzz...\""), "{} bytes", said.len());
    assert!(said.contains("nor are 41 more columns"), "{said}");
}

#[test]
fn recordings_are_told_apart() {
    let inside = folder("apart");
    for (name, shift) in [("first", 0), ("second", 100)] {
        std::fs::create_dir(inside.join(name)).unwrap();
        table(&inside, &format!("{name}/radar.csv"), &[rows("a", 4, shift, 0)]);
    }
    let output =
        command(&inside, "first/radar.csv second/radar.csv --config noises.toml --json").output().unwrap();
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    let names: Vec<&str> =
        document["sensors"].as_array().unwrap().iter().map(|s| s["sensor"].as_str().unwrap()).collect();
    assert_eq!(names, ["first/radar.csv, position", "second/radar.csv, position"]);

    let (code, said) = track(&inside, "first/radar.csv first/../first/radar.csv --config noises.toml");
    assert_eq!(code, 2, "{said}");
    assert!(said.contains("first/../first/radar.csv is given twice"), "{said}");
}

#[test]
fn a_plane_of_its_own_does_not_join_the_earth() {
    let inside = folder("planes");
    table(&inside, "plane.csv", &[rows("a", 4, 0, 0)]);
    std::fs::write(
        inside.join("earth.csv"),
        "time_s,id,lat_deg,lon_deg\n0,b,50,-1\n1,b,50.0001,-1\n2,b,50.0002,-1\n",
    )
    .unwrap();
    for line in ["plane.csv earth.csv", "earth.csv plane.csv"] {
        let (code, said) = track(&inside, &format!("{line} --config noises.toml"));
        assert_eq!(code, 1, "{said}");
        assert!(
            said.contains("earth.csv gives places on the earth, plane.csv in a plane of its own"),
            "{said}"
        );
        assert!(said.contains("`origin` of the plane under [input]"), "{said}");
    }
    let placed = format!("{NOISES}[input]\norigin = {{ lat_deg = 50.0, lon_deg = -1.0, alt_m = 0.0 }}\n");
    std::fs::write(inside.join("placed.toml"), placed).unwrap();
    let (code, said) = track(&inside, "plane.csv earth.csv --config placed.toml");
    assert_eq!(code, 0, "{said}");
}

/// A radar that gives no elevation now and then still follows its target in space. The errors: 5 m of range and
/// 2 mrad of angle at 5.5 km are 11 m across; thirty measurements later the estimate is better than one of them.
#[test]
fn missing_elevations_are_missing_values() {
    let inside = folder("space");
    let (mut measured, mut truth) = (String::new(), String::from("time_s,id,x_m,y_m,z_m\n"));
    for k in 0..60 {
        let t = f64::from(k);
        let [x, y, z] = [5000.0 + 50.0 * t, 2000.0 - 20.0 * t, 1000.0 + 5.0 * t];
        let weave = |turns: f64| (t * turns).sin();
        let range = (x * x + y * y + z * z).sqrt() + 5.0 * weave(1.9);
        let bearing = y.atan2(x) + 0.002 * weave(2.3);
        let elevation = z.atan2(x.hypot(y)) + 0.002 * weave(2.9);
        let elevation = if k % 5 == 3 { String::new() } else { elevation.to_string() };
        measured += &format!("{k},a,{range},{bearing},{elevation}\n");
        truth += &format!("{k},a,{x},{y},{z}\n");
    }
    let header = "time_s,id,range_m,bearing_rad,elevation_rad\n";
    std::fs::write(inside.join("in.csv"), format!("{header}{measured}")).unwrap();
    std::fs::write(inside.join("truth.csv"), truth).unwrap();
    let settings = "[motion]\nacceleration_sd_mps2 = 0.5\n[sensor.default]\nrange_sd_m = 5\n\
                    bearing_sd_rad = 0.002\nelevation_sd_rad = 0.002\n";
    std::fs::write(inside.join("c.toml"), settings).unwrap();
    let line = "in.csv --config c.toml --filter ukf --truth truth.csv --json";
    let output: Output = command(&inside, line).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&document["counts"]["used"], &document["counts"]["missing"]), (&60.into(), &12.into()));
    // Twelve rows give a range and a bearing, each by itself.
    assert_eq!(document["tracks"][0]["updates"], 72);
    assert!(document["scores"]["rmse_m"].as_f64().unwrap() < 20.0, "{}", document["scores"]);
}

#[test]
fn a_stream_says_what_it_does_not_read_and_where_it_could_not_write() {
    let inside = folder("stream");
    table(&inside, "in.csv", &[rows("a", 4, 0, 0)]);
    let input = |text: &str| {
        std::fs::write(inside.join("piped.csv"), text).unwrap();
        Stdio::from(std::fs::File::open(inside.join("piped.csv")).unwrap())
    };
    let text_of = |text: &str| {
        let output = command(&inside, "- --config noises.toml").stdin(input(text)).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let (code, said) = text_of("time_s,id,x_m,y_m,colour\n0,a,1,1,red\n");
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("standard input: the column \"colour\" is not read"), "{said}");
    let (code, said) = text_of("time_s,ID,x_m,y_m\n0,a,1,1\n");
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("standard input, line 2") && said.contains("did you mean id?"), "{said}");
    #[cfg(target_os = "linux")]
    {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = command(&inside, "- --config noises.toml")
            .stdin(input("time_s,id,x_m,y_m\n0,a,1,1\n"))
            .stdout(full)
            .output()
            .unwrap();
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("cannot write to standard output"), "{said}");
    }
}

#[cfg(unix)]
#[test]
fn a_stream_that_is_stopped_says_so() {
    use std::io::{BufRead, BufReader, Write};
    let inside = folder("stopped");
    let mut child = command(&inside, "- --config noises.toml")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    let mut rows = BufReader::new(child.stdout.take().unwrap()).lines();
    input.write_all(b"time_s,id,x_m,y_m\n0,a,1,1\n").unwrap();
    assert!(
        rows.next().unwrap().unwrap().starts_with("id,") && rows.next().unwrap().unwrap().starts_with("a,0,")
    );
    // The first row is out: the signal is listened for.
    let mut errors = BufReader::new(child.stderr.take().unwrap()).lines();
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert!(errors.next().unwrap().unwrap().starts_with("stopping after this step"));
    drop(input);
    assert_eq!(child.wait().unwrap().code(), Some(1));
    assert!(errors.any(|line| line.unwrap().contains("stopped before the end")));
    let record: Value = serde_json::from_str(&read(&inside, "run.json")).unwrap();
    assert_eq!((&record["state"], &record["counts"]["used"]), (&"interrupted".into(), &1.into()));
}
