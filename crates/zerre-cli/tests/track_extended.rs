//! `zerre track` on targets that give many points a scan, and on boxes: from generated tables and from real recordings.

use serde_json::Value;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn workspace() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn data(name: &str) -> String {
    workspace().join("data").join(name).display().to_string()
}

/// A large recording, where there is one; continuous integration must have them.
fn recording(path: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("ZERRE_DATA").map_or(workspace().join("../shared/data"), PathBuf::from);
    let file = folder.join(path);
    if !file.exists() {
        assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "no recording {}", file.display());
        eprintln!("SKIPPED: no recording {}", file.display());
        return None;
    }
    Some(file)
}

/// An empty folder of the test's own, with a configuration `e.toml` of the section alone.
fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("track-extended-{name}"));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    write(&path, "e.toml", "[extended]\n");
    path
}

fn write(inside: &Path, name: &str, text: &str) {
    std::fs::write(inside.join(name), text).unwrap();
}

/// Runs `zerre track` with outputs in `out/`.
fn track(inside: &Path, line: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_zerre"));
    command.current_dir(inside).arg("track").args(line.split_whitespace()).args(["--out", "out", "--force"]);
    command.output().unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

/// Runs it to its end; gives the document of `--json` and what was said.
fn tracked(inside: &Path, line: &str) -> (Value, String) {
    let output = track(inside, &format!("{line} --json"));
    let said = text(&output.stderr).to_owned();
    assert_eq!(output.status.code(), Some(0), "{line}: {said}");
    (serde_json::from_slice(&output.stdout).unwrap(), said)
}

fn read(inside: &Path, name: &str) -> String {
    std::fs::read_to_string(inside.join("out").join(name)).unwrap()
}

fn record(inside: &Path) -> Value {
    serde_json::from_str(&read(inside, "run.json")).unwrap()
}

/// The numbers of a column.
fn column(table: &str, name: &str) -> Vec<f64> {
    let mut lines = table.lines();
    let at = lines.next().unwrap().split(',').position(|column| column == name).unwrap();
    lines.map(|line| line.split(',').nth(at).unwrap().parse().unwrap()).collect()
}

/// Numbers between -1 and 1 that look like chance: of a linear congruential generator (Knuth's MMIX).
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// Rows `time,x,y` of a bar of 8 by 2 m that goes east at 3 m/s: `points` of it in each of `scans` seconds.
fn bar(scans: usize, points: usize) -> Vec<String> {
    let mut chance = Chance(7);
    let mut rows = Vec::new();
    for k in 0..scans {
        for _ in 0..points {
            let (x, y) = (3.0 * k as f64 + 4.0 * chance.next(), 10.0 + chance.next());
            rows.push(format!("{k},{x:.3},{y:.3}\n"));
        }
    }
    rows
}

fn table(header: &str, rows: &[String]) -> String {
    format!("{header}\n{}", rows.concat())
}

/// The README's command: from a bare copy of the repository, with nothing told.
#[test]
fn the_small_recording_is_followed_with_its_shape() {
    let inside = folder("turning");
    let line = format!("{} --config {}", data("turning.csv"), data("extended.toml"));
    let (document, said) = tracked(&inside, &format!("{line} --truth {}", data("turning_truth.csv")));
    for part in ["50 used of 50", "points", "consistency", "out/report.html"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let one = &document["tracks"][0];
    assert_eq!((&one["updates"], &one["points"]), (&50.into(), &document["counts"]["used"]));
    assert!((2..=4).contains(&one["ellipses"].as_u64().unwrap()), "an L: {one}");
    // Ten points a scan on a body of 12 m: a scan alone knows the middle to 1.2 m, ten to a third of that.
    let scores = &document["scores"];
    assert!(scores["rmse_m"].as_f64().unwrap() < 0.8, "{scores}");
    assert!((0.3..3.0).contains(&scores["nees"].as_f64().unwrap()), "{scores}");

    let shapes = read(&inside, "shapes.csv");
    assert!(shapes.starts_with("id,time_s,ellipse,weight,x_m,y_m,extent_xx_m2,"));
    let times = column(&shapes, "time_s");
    assert_eq!((times.first(), times.last()), (Some(&0.0), Some(&49.0)));
    let weights: f64 = column(&shapes, "weight").iter().sum();
    assert!((weights - 50.0).abs() < 1e-9, "those of a time sum to one: {weights}");
    // The long side in the end: 12 m of points, even, are 3.46 m of standard deviation, and ellipses share it.
    let last = column(&shapes, "sd_major_m").into_iter().zip(&times).filter(|(_, t)| **t == 49.0);
    assert!((1.0..4.5).contains(&last.map(|(sd, _)| sd).fold(0.0, f64::max)));
    let (low, sd, high) = (
        column(&shapes, "sd_minor_low_m"),
        column(&shapes, "sd_minor_m"),
        column(&shapes, "sd_minor_high_m"),
    );
    assert!(low.iter().zip(&high).all(|(low, high)| 0.0 < *low && low < high) && low.len() == sd.len());

    let plan = read(&inside, "plan.svg");
    assert!(plan.matches("class=\"outline\" d=").count() > 5 && plan.contains("class=\"point\" d="));
    let page = read(&inside, "report.html");
    assert!(page.contains("two standard deviations") && page.contains("points in a scan"));
    let config = &record(&inside)["config"];
    assert_eq!(config["extended"]["rotation"], "velocity", "it turns, and that is found");
    assert!(config["motion"]["acceleration_sd_mps2"].as_f64().unwrap() > 0.0);
    assert_eq!(record(&inside)["input"][0]["bytes"], std::fs::metadata(data("turning.csv")).unwrap().len());
}

#[test]
fn neither_threads_nor_instructions_change_the_digest() {
    let inside = folder("bits");
    let mut rows = Vec::new();
    for id in ["a", "b", "c"] {
        rows.extend(bar(12, 9).into_iter().map(|row| format!("{id},{row}")));
    }
    write(&inside, "m.csv", &table("id,time_s,x_m,y_m", &rows));
    let digest = |options: &str| {
        tracked(&inside, &format!("m.csv --config e.toml {options}"));
        record(&inside)["estimates_digest"].clone()
    };
    let one = digest("--threads 1");
    assert_eq!((digest("--threads 2"), digest("--threads 3")), (one.clone(), one.clone()));
    for level in zerre::kernels::Simd::available() {
        assert_eq!(digest(&format!("--simd {}", level.name())), one, "{}", level.name());
    }
    assert_ne!(digest("--filter random-matrix-koch"), one);
}

/// Rows of one `id` and one time, or one number in the column `scan`, are a scan; without ids there is one target.
#[test]
fn rows_are_gathered_into_scans() {
    let inside = folder("scans");
    let rows = bar(15, 8);
    // The points of a scan come one after the other, as from a sweep.
    let swept: Vec<String> = rows
        .iter()
        .enumerate()
        .map(|(k, row)| {
            let (second, rest) = row.split_once(',').unwrap();
            format!("{second}.{},{second},{rest}", k % 8)
        })
        .collect();
    write(&inside, "plain.csv", &table("time_s,x_m,y_m", &rows));
    write(&inside, "alias.csv", &table("t_s,x_m,y_m", &rows));
    write(&inside, "swept.csv", &table("time_s,scan,x_m,y_m", &swept));
    let two: Vec<String> = rows.iter().flat_map(|row| [format!("a,{row}"), format!("b,{row}")]).collect();
    write(&inside, "two.csv", &table("id,time_s,x_m,y_m", &two));
    for (name, tracks) in
        [("plain.csv", 1), ("alias.csv", 1), ("swept.csv", 1), ("two.csv", 2), ("two.csv --single", 1)]
    {
        let (document, _) = tracked(&inside, &format!("{name} --config e.toml"));
        let found = document["tracks"].as_array().unwrap();
        assert_eq!(found.len(), tracks, "{name}");
        for track in found {
            assert_eq!((&track["updates"], &track["missed"]), (&15.into(), &0.into()), "{name}");
        }
        assert_eq!(document["counts"]["used"], if name.starts_with("two") { 240 } else { 120 });
        assert!(document["outcomes"].as_object().unwrap().is_empty(), "{name}: {document}");
    }
    // The middle of the sweep stands for it.
    tracked(&inside, "swept.csv --config e.toml");
    assert_eq!(column(&read(&inside, "tracks.csv"), "time_s")[..3], [0.35, 1.35, 2.35]);
    // Shuffled rows are sorted, and counted.
    let mut shuffled = rows.clone();
    shuffled.reverse();
    write(&inside, "late.csv", &table("time_s,x_m,y_m", &shuffled));
    let (document, said) = tracked(&inside, "late.csv --config e.toml");
    assert_eq!(document["tracks"][0]["updates"], 15);
    assert_eq!(document["outcomes"]["row-out-of-order"]["count"], 112);
    assert!(said.contains("rows sorted"), "{said}");
    // Some rows with an identity and some without: of nobody knows which target.
    write(&inside, "some.csv", "id,time_s,x_m,y_m\na,0,1,1\n,0,2,2\n");
    let output = track(&inside, "some.csv --config e.toml");
    assert!(text(&output.stderr).contains("some.csv, line 3"), "{}", text(&output.stderr));
}

/// Silence starts another track; so far apart are tests of the beginning and the end.
#[test]
fn silence_ends_a_track() {
    let inside = folder("silence");
    let later = bar(10, 8).into_iter().map(|row| {
        let (second, rest) = row.split_once(',').unwrap();
        format!("{},{rest}", second.parse::<u32>().unwrap() + 5000)
    });
    let rows: Vec<String> = bar(10, 8).into_iter().chain(later).collect();
    write(&inside, "m.csv", &table("time_s,x_m,y_m", &rows));
    let (document, _) = tracked(&inside, "m.csv --config e.toml");
    let ids: Vec<&str> =
        document["tracks"].as_array().unwrap().iter().map(|track| track["id"].as_str().unwrap()).collect();
    assert_eq!(ids, ["target", "target#2"]);
}

/// One point, ten thousand, the same again and again, a line, fewer than ellipses; all filters.
#[test]
fn odd_scans_end_in_finite_rows() {
    let inside = folder("odd");
    let same: Vec<String> = (0..12).flat_map(|k| vec![format!("{k},5,5\n"); 6]).collect();
    let line: Vec<String> =
        (0..12).flat_map(|k| (0..6).map(move |j| format!("{k},{},5\n", 3 * k + j))).collect();
    let many: Vec<String> = (0..3)
        .flat_map(|k| {
            (0..10_000).map(move |j| format!("{k},{},{}\n", 3 * k + j % 7, f64::from(j / 7) / 500.0))
        })
        .collect();
    let few = vec!["0,0,0\n".to_owned(), "0,1,1\n".to_owned(), "1,2,0\n".to_owned(), "1,3,1\n".to_owned()];
    let tables = [
        ("one.csv", vec!["0,1,1\n".to_owned()], 1),
        ("lone.csv", bar(12, 1), 12),
        ("same.csv", same, 12),
        ("line.csv", line, 12),
        ("many.csv", many, 3),
        ("few.csv", few, 2),
    ];
    write(&inside, "many.toml", "[extended]\nellipses = 9\n");
    write(&inside, "koch.toml", "[extended]\nfilter = \"random-matrix-koch\"\nkeep = 0.5\n");
    write(&inside, "feldmann.toml", "[extended]\nfilter = \"random-matrix-feldmann\"\nkeep = 0.0\n");
    write(&inside, "clutter.toml", "[extended]\nclutter_area_m2 = 400.0\n");
    write(&inside, "turning.toml", "[extended]\nrotation = \"velocity\"\n");
    for (name, rows, scans) in tables {
        write(&inside, name, &table("time_s,x_m,y_m", &rows));
        for config in ["e", "many", "koch", "feldmann", "clutter", "turning"] {
            let (document, _) = tracked(&inside, &format!("{name} --config {config}.toml"));
            let one = &document["tracks"][0];
            assert_eq!(one["updates"], scans, "{name} {config}");
            let lone = document["outcomes"]["scan-of-one-point"]["count"].as_u64();
            assert_eq!(lone, rows.len().eq(&scans).then_some(scans as u64), "{name} {config}");
            let told = read(&inside, "tracks.csv");
            assert!(!told.contains("NaN") && !told.contains("inf"), "{name} {config}");
            let page = read(&inside, "report.html");
            assert!(!page.contains("NaN"), "{name} {config}");
            // Six ellipses of two points each are no shape.
            let most = if config == "many" { rows.len().min(9) } else { 6 };
            assert!(one["ellipses"].as_u64().unwrap() as usize <= most, "{name} {config}: {one}");
        }
    }
    // Bad cells are counted as elsewhere.
    let mut rows = bar(30, 10);
    rows.extend(["3,nan,1\n", "4,,1\n", "5,,\n"].map(str::to_owned));
    write(&inside, "nan.csv", &table("time_s,x_m,y_m", &rows));
    let (document, _) = tracked(&inside, "nan.csv --config e.toml");
    let counts = &document["counts"];
    assert_eq!((&counts["read"], &counts["used"], &counts["missing"]), (&303.into(), &300.into(), &3.into()));
    assert_eq!(counts["rejected"]["not a finite number"], 1);
    assert_eq!(counts["left_out"]["no measurement"], 2);
}

#[test]
fn what_would_have_no_effect_is_refused_where_it_stands() {
    let inside = folder("no-effect");
    write(&inside, "m.csv", &table("time_s,x_m,y_m", &bar(5, 5)));
    write(&inside, "polar.csv", "time_s,id,range_m,bearing_deg\n0,a,1,1\n1,a,2,2\n");
    let koch = "[extended]\nfilter = \"random-matrix-koch\"\n";
    for (config, place, says) in [
        ("filter = \"ekf\"\n[extended]\n".to_owned(), "c.toml:1:10", "have filters of their own"),
        ("[extended]\n[filter]\nparticles = 50\n".to_owned(), "c.toml:3:1", "no effect on extended targets"),
        (
            "[extended]\n[motion]\nmodel = \"singer\"\n".to_owned(),
            "c.toml:3:9",
            "move by `constant-velocity`",
        ),
        ("[extended]\n[motion]\ntau_s = 3\n".to_owned(), "c.toml:3:1", "has no such parameter"),
        ("[extended]\n[motion.modes]\nstay_s = 3\n".to_owned(), "c.toml:3:1", "has no modes"),
        (
            "[extended]\n[start]\nposition_m = [1, 2]\nposition_sd_m = 3\n".to_owned(),
            "c.toml:3:1",
            "no effect",
        ),
        ("[extended]\n[start]\nsize_sd_m = 3\n".to_owned(), "c.toml:3:1", "no effect"),
        ("[extended]\n[track]\nestimate = \"mean\"\n".to_owned(), "c.toml:3:1", "no effect"),
        ("[extended]\n[sensor.north]\n".to_owned(), "c.toml:2:9", "all alike"),
        ("[extended]\n[sensor.default]\ngate = 0.9\n".to_owned(), "c.toml:3:1", "position_sd_m alone counts"),
        ("[extended]\nfilter = \"window\"\n".to_owned(), "c.toml:2:10", "did you mean `window-vb`?"),
        (format!("{koch}window = 5\n"), "c.toml:3:1", "has no such setting"),
        (format!("{koch}rotation = \"velocity\"\n"), "c.toml:3:1", "has no such setting"),
        (format!("{koch}[sensor.default]\nposition_sd_m = 1\n"), "c.toml:4:1", "has no such noise"),
    ] {
        write(&inside, "c.toml", &config);
        let output = track(&inside, "m.csv --config c.toml");
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{config}: {said}");
        assert!(said.contains(place) && said.contains(says), "{config}: {said}");
        assert!(!inside.join("out/run.json").exists(), "{config}");
    }
    let output = track(&inside, "polar.csv --config e.toml");
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("polar.csv, line 2: an extended target is seen as points"), "{said}");
    let output = track(&inside, "m.csv --config e.toml --filter ekf");
    assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
    let output = track(&inside, "- --config e.toml");
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("not followed row by row"), "{}", text(&output.stderr));
    // What has an effect is taken, and told with its reason.
    let settings = "[extended]\nfilter = \"random-matrix-feldmann\"\nkeep = 0.9\nleast_sd_m = 0.2\n[motion]\n\
                    acceleration_sd_mps2 = 0.5\n[sensor.default]\nposition_sd_m = 0.1\n[start]\nspeed_sd_mps = 9\n\
                    [track]\nmax_gap_s = 5\n";
    write(&inside, "c.toml", settings);
    let output = track(&inside, "m.csv --config c.toml --explain");
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    for part in
        ["extended.keep = 0.9", "c.toml, line 3", "sensor.default.position_sd_m = 0.1", "max_gap_s = 5.0"]
    {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert!(!said.contains("extended.window"), "it has none: {said}");
}

/// Rows of a vessel of 60 by 12 m that goes north-east, seen by range, azimuth, length, width and heading from either end;
/// every fourth without a size.
fn vessel() -> String {
    let mut chance = Chance(3);
    let mut rows = String::from("time_s,id,range_m,azimuth_deg,length_m,width_m,heading_deg\n");
    for k in 0..60 {
        let (east, north) =
            (500.0 + 4.0 * f64::from(k) + chance.next(), 300.0 + 4.0 * f64::from(k) + chance.next());
        let azimuth = east.atan2(north).to_degrees();
        let size = if k % 4 == 3 {
            ",,".to_owned()
        } else {
            let heading = 45.0 + if k % 2 == 0 { 0.0 } else { 180.0 } + 4.0 * chance.next();
            format!("{:.1},{:.1},{heading:.1}", 60.0 + 3.0 * chance.next(), 12.0 + 3.0 * chance.next())
        };
        let _ = writeln!(rows, "{k},v,{:.2},{azimuth:.4},{size}", east.hypot(north));
    }
    rows
}

#[test]
fn a_box_is_followed_and_drawn() {
    let inside = folder("box");
    write(&inside, "vessel.csv", &vessel());
    for filter in ["ekf", "ukf", "particle"] {
        let line = format!("vessel.csv --motion constant-velocity-box --filter {filter}");
        let (document, said) = tracked(&inside, &line);
        // A row with a size is two measurements.
        assert_eq!(
            (&document["counts"]["used"], &document["tracks"][0]["updates"]),
            (&60.into(), &105.into())
        );
        let sensors = document["sensors"].to_string();
        assert!(sensors.contains("\"range and bearing\"") && sensors.contains("\"size\""), "{sensors}");
        let table = read(&inside, "tracks.csv");
        let last = |name| column(&table, name).pop().unwrap();
        // Three metres of noise at most, 45 times.
        assert!((last("length_m") - 60.0).abs() < 3.0, "{filter} {}", last("length_m"));
        assert!((last("width_m") - 12.0).abs() < 3.0, "{filter} {}", last("width_m"));
        // North-east is 45 degrees from the x axis, or 225.
        let turned = (2.0 * last("orientation_rad")).sin();
        assert!(turned > 0.97, "{filter} {}", last("orientation_rad"));
        assert!(last("var_orientation_rad2") < 0.02);
        let plan = read(&inside, "plan.svg");
        assert!(plan.matches("class=\"outline\" d=").count() > 2, "{filter}");
        assert!(!read(&inside, "report.html").contains("NaN"));
        assert!(said.contains("size"), "{said}");
        assert!(!inside.join("out/shapes.csv").exists());
    }
    // Without such a motion sizes are not read, and said to be so once.
    let output = track(&inside, "vessel.csv --filter ukf");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("the column \"length_m\" is not read"));
    write(&inside, "points.csv", "time_s,id,x_m,y_m\n0,a,1,1\n1,a,2,2\n2,a,3,3\n");
    let output = track(&inside, "points.csv --motion constant-velocity-box");
    assert!(text(&output.stderr).contains("no row holds a size"), "{}", text(&output.stderr));
    write(&inside, "half.csv", "time_s,id,x_m,y_m,length_m\n0,a,1,1,5\n");
    let output = track(&inside, "half.csv --motion constant-velocity-box");
    assert!(
        text(&output.stderr).contains("width_m and an orientation or a heading"),
        "{}",
        text(&output.stderr)
    );
}

/// Two frames of two objects, with boxes for three of them.
fn frames(inside: &Path) {
    let header = "y,x,velocity,motion,time,label";
    let mut chance = Chance(5);
    for (frame, x) in [("07", 10.0), ("09", 14.0)] {
        let mut rows = String::from(header) + "\n";
        for (label, y) in [("0", 3.0), ("1", -4.0), ("-1", 20.0)] {
            for _ in 0..6 {
                let (x, y): (f64, f64) = (x + 2.0 * chance.next(), y + 0.8 * chance.next());
                let _ = writeln!(rows, "{y},{x},1.5,0,0.01,{label}");
            }
        }
        write(inside, &format!("radar_0001_{frame}.csv"), &rows);
    }
    let boxes = "frame,token,name,cx_m,cy_m,cz_m,width_m,length_m,height_m,qw,qx,qy,qz,yaw_rad\n\
                 07,t,car,10,3,1,1.8,4.5,1.5,1,0,0,0,0\n07,t,truck,10,-4,1,2.5,8,3,1,0,0,0,0\n\
                 08,t,bus,10,-4,1,2.5,8,3,1,0,0,0,0\n09,t,car,14,3,1,1.8,4.5,1.5,1,0,0,0,3.1416\n";
    write(inside, "boxes.csv", boxes);
}

#[test]
fn objects_of_frames_have_outlines_beside_their_labelled_boxes() {
    let inside = folder("frames");
    frames(&inside);
    let both = "radar_0001_07.csv radar_0001_09.csv --config e.toml";
    let (document, said) = tracked(&inside, both);
    let tracks = document["tracks"].as_array().unwrap();
    let ids: Vec<&str> = tracks.iter().map(|track| track["id"].as_str().unwrap()).collect();
    assert_eq!(ids, ["0001_07/0", "0001_07/1", "0001_09/0", "0001_09/1"]);
    // Key frames are half a second apart.
    assert_eq!((tracks[0]["start"].as_f64(), tracks[3]["start"].as_f64()), (Some(3.5), Some(4.5)));
    assert!(tracks.iter().all(|track| track["points"] == 6 && track["updates"] == 1));
    assert_eq!(document["counts"]["left_out"]["of no object"], 12);
    let labels: Vec<_> = tracks.iter().map(|track| track["label"].as_str()).collect();
    assert_eq!(labels, [Some("car"), Some("truck"), Some("car"), None]);
    for track in &tracks[..3] {
        let share = track["iou"].as_f64().unwrap();
        assert!((0.2..1.0).contains(&share), "points all over the car: {track}");
    }
    assert!(said.contains("3 of 4 objects lie in a labelled box"), "{said}");
    let page = read(&inside, "report.html");
    assert!(page.contains("radar_0001_07") && page.matches("<figure><figcaption>radar").count() == 2);
    assert!(page.contains(">truck<") && !page.contains(">bus<"), "frame 08 is not among them");
    // All files of the folder are the same, the boxes being no measurements.
    let (all, _) =
        tracked(&inside, "radar_0001_07.csv boxes.csv radar_0001_09.csv --config e.toml --format nuscenes");
    assert_eq!(all["tracks"], document["tracks"]);
    assert_eq!(all["counts"], document["counts"]);
    // Without the boxes all else is there.
    std::fs::remove_file(inside.join("boxes.csv")).unwrap();
    let (bare, _) = tracked(&inside, both);
    assert_eq!(bare["tracks"].as_array().unwrap().len(), 4);
    assert!(bare["tracks"][0].get("iou").is_none());
    // A name without a number is no frame.
    std::fs::rename(inside.join("radar_0001_07.csv"), inside.join("radar.csv")).unwrap();
    let output = track(&inside, "radar.csv --config e.toml");
    assert!(text(&output.stderr).contains("radar.csv: the rows of this table are of one frame"));
}

/// The vehicle that a lidar saw: 49 scans; predictive score beside the baselines.
#[test]
fn a_vehicle_seen_by_lidar() {
    let Some(file) = recording("metu_lidar_vehicle/points.csv") else { return };
    let inside = folder("lidar");
    let line = format!("{} --config {}", file.display(), data("extended.toml"));
    let of = |filter: &str| {
        let (document, _) = tracked(&inside, &format!("{line} --filter {filter}"));
        assert_eq!(
            (&document["counts"]["used"], &document["tracks"][0]["updates"]),
            (&5946.into(), &49.into())
        );
        let table = read(&inside, "tracks.csv");
        let [x, y] = ["x_m", "y_m"].map(|name| column(&table, name));
        // It goes south-west, by some 16 m and 13 m.
        assert!((-18.0..-14.0).contains(&(x[48] - x[0])) && (-16.0..-11.0).contains(&(y[48] - y[0])));
        document["log_evidence"].as_f64().unwrap()
    };
    let (window, koch) = (of("window-vb"), of("random-matrix-koch"));
    let feldmann = of("random-matrix-feldmann");
    // An L of thin sides against one ellipse: more than a unit of information for each of 5946 points.
    assert!(window > koch.max(feldmann) + 5946.0, "{window} {koch} {feldmann}");
}

#[test]
fn labelled_traffic_seen_by_radar() {
    let Some(scene) = recording("nuscenes_radar_labeled/scene-0400") else { return };
    let inside = folder("nuscenes");
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(&scene).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let files: Vec<String> = files.iter().map(|path| path.display().to_string()).collect();
    let (document, said) = tracked(&inside, &format!("{} --config e.toml", files.join(" ")));
    let counts = &document["counts"];
    assert_eq!((&counts["read"], &counts["used"]), (&1084.into(), &1061.into()));
    let tracks = document["tracks"].as_array().unwrap();
    let many = tracks.iter().filter(|track| track["points"].as_u64() >= Some(5));
    let mut shares: Vec<f64> = many.filter_map(|track| track["iou"].as_f64()).collect();
    shares.sort_by(f64::total_cmp);
    // The recording's description: 834 of 1061 points in boxes grown by a metre.
    assert!(shares.len() > 40, "{}", shares.len());
    assert!((0.05..0.9).contains(&shares[shares.len() / 2]), "{shares:?}");
    assert!(said.contains("objects lie in a labelled box"), "{said}");
}

/// The aircraft 4ca9cc and others, as boxes: every row of the radar that has a position has a size.
#[test]
fn aircraft_seen_by_surface_radar() {
    let Some(file) = recording("lebl_smr/lebl_smr_28800_30600.csv") else { return };
    let inside = folder("surface");
    let line = format!("{} --motion constant-velocity-box --filter ukf", file.display());
    let (document, _) = tracked(&inside, &line);
    assert_eq!(document["counts"]["used"], 8261);
    let updates: u64 =
        document["tracks"].as_array().unwrap().iter().map(|track| track["updates"].as_u64().unwrap()).sum();
    assert_eq!(updates, 2 * 8261);
    let table = read(&inside, "tracks.csv");
    let lengths: Vec<f64> = table
        .lines()
        .zip([f64::NAN].into_iter().chain(column(&table, "length_m")))
        .filter(|(line, _)| line.starts_with("1634,"))
        .map(|(_, length)| length)
        .collect();
    let mut settled = lengths[lengths.len() / 2..].to_vec();
    settled.sort_by(f64::total_cmp);
    // A narrow-body airliner is 38 to 45 m long.
    assert!((30.0..55.0).contains(&settled[settled.len() / 2]), "{}", settled[settled.len() / 2]);
    assert!(read(&inside, "plan.svg").contains("class=\"outline\" d="));
}
