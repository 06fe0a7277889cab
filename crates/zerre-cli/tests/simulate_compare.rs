//! `zerre simulate` and `zerre compare` from outside.

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Runs zerre in `folder`.
fn zerre(folder: &Path, line: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_zerre"))
        .args(line.split_whitespace())
        .current_dir(folder)
        .output()
        .unwrap()
}

/// Runs zerre, which must succeed, and reads its document.
fn json(folder: &Path, line: &str) -> Value {
    let output = zerre(folder, &format!("{line} --json"));
    assert!(output.status.success(), "{line}: {}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

/// An empty folder of the test's own.
fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("simulate_compare").join(name);
    let _ = fs::remove_dir_all(&path);
    fs::create_dir_all(&path).unwrap();
    path
}

/// The figures are sums of a few numbers and a root: up to a dozen roundings of half an ulp.
fn close(found: &Value, expected: f64) {
    let found = found.as_f64().unwrap();
    assert!((found - expected).abs() <= 6.0 * f64::EPSILON * expected.abs(), "{found} is not {expected}");
}

#[test]
fn the_same_seed_makes_the_same_files() {
    let here = folder("seeds");
    for (out, seed) in [("a", 7), ("b", 7), ("c", 8)] {
        json(&here, &format!("simulate two-crossing --seed {seed} --out {out}"));
    }
    let read = |out: &str, name: &str| fs::read_to_string(here.join(out).join(name)).unwrap();
    for name in ["measurements.csv", "truth.csv"] {
        assert_eq!(read("a", name), read("b", name));
        assert_ne!(read("a", name), read("c", name));
    }
    assert!(read("a", "measurements.csv").starts_with("time_s,id,x_m,y_m\n"));
    assert!(read("a", "truth.csv").starts_with("time_s,id,x_m,y_m,vx_mps,vy_mps\n"));
    let record: Value = serde_json::from_str(&read("a", "run.json")).unwrap();
    assert_eq!((&record["command"], &record["seed"]), (&"simulate".into(), &7.into()));
    assert_eq!(record["config"]["scenario"]["motion"]["model"], "constant-velocity");
}

#[test]
fn runs_are_numbered_and_the_first_is_the_only_one() {
    let here = folder("runs");
    let said = json(&here, "simulate bearings-only --runs 3 --out many");
    assert_eq!((&said["runs"], &said["targets"]), (&3.into(), &1.into()));
    json(&here, "simulate bearings-only --out one");
    let read = |name: &str| fs::read_to_string(here.join(name)).unwrap();
    assert_eq!(read("many/measurements-0001.csv"), read("one/measurements.csv"));
    assert_ne!(read("many/measurements-0001.csv"), read("many/measurements-0002.csv"));
    assert!(here.join("many/truth-0003.csv").exists() && !here.join("many/truth-0004.csv").exists());
    // Two sensors see the target at each of the 121 instants.
    assert_eq!(read("one/measurements.csv").lines().count(), 1 + 2 * 121);
}

#[test]
fn a_written_scenario_is_drawn_and_a_wrong_one_is_shown() {
    let here = folder("written");
    assert!(zerre(&here, "init scenario --out .").status.success());
    json(&here, "simulate scenario.toml");
    assert!(here.join("out/simulate-scenario/measurements.csv").exists());
    let starter = fs::read_to_string(here.join("scenario.toml")).unwrap();
    for (from, to, says) in [
        ("step_s = 1.0", "step_s = -1.0", "scenario.toml:5:10"),
        ("step_s = 1.0", "step_m = 1.0", "did you mean `step_s`?"),
        ("0.0, 300.0, 5.0, -2.0", "0.0, 300.0, 5.0", "the state of constant-velocity has 4"),
        ("detection = 0.95", "detection = 2", "sensor.0.detection"),
        ("bearing_sd_rad = 0.01", "bearing_sd_rad = 0.0", "standard deviation of the bearing"),
        ("id = \"b\"", "id = \"a\"", "target.1.id"),
    ] {
        assert!(starter.contains(from), "{from}");
        fs::write(here.join("wrong.toml"), starter.replacen(from, to, 1)).unwrap();
        let output = zerre(&here, "simulate wrong.toml");
        let said = text(&output.stderr).replace("wrong.toml", "scenario.toml");
        assert_eq!(output.status.code(), Some(1), "{to}");
        assert!(said.contains(says) && said.contains("scenario.toml:"), "{to}: {said}");
    }
    assert!(!here.join("out/simulate-wrong").exists());
}

#[test]
fn names_that_do_not_exist_are_wrong_usage_with_a_way_out() {
    let here = folder("names");
    for (line, says) in [
        ("simulate radar-vc", "did you mean `radar-cv`?"),
        ("compare a.csv b.csv --metric rsme", "did you mean `rmse`?"),
        ("compare a.csv b.csv --cutoff-m 0", "--cutoff-m is 0"),
    ] {
        let output = zerre(&here, line);
        assert_eq!(output.status.code(), Some(2), "{line}");
        assert!(text(&output.stderr).contains(says), "{line}: {}", text(&output.stderr));
    }
    for (line, says) in [
        ("simulate absent.toml", "cannot read absent.toml"),
        ("compare absent.csv b.csv", "cannot read absent.csv"),
        ("compare absent.csv b.csv --metric nis", "innovations"),
    ] {
        let output = zerre(&here, line);
        assert_eq!(output.status.code(), Some(1), "{line}");
        assert!(text(&output.stderr).contains(says), "{line}: {}", text(&output.stderr));
    }
}

#[test]
fn numbers_on_one_axis_are_not_taken_for_heights() {
    let here = folder("growth");
    let made = zerre(&here, "simulate growth --out made");
    assert!(text(&made.stderr).contains("`zerre track` has no sensor for them"), "{}", text(&made.stderr));
    let refused = zerre(&here, "track made/measurements.csv");
    assert_eq!(refused.status.code(), Some(1));
    let said = text(&refused.stderr);
    assert!(said.contains("no column gives a measurement") && !said.contains("z_m"), "{said}");
}

#[test]
fn scores_by_id_are_those_worked_out_by_hand() {
    let here = folder("by_id");
    // Target a: errors (3, 4) and (0, 0), the second against truth halfway between 2 s and 4 s; b is without truth.
    fs::write(
        here.join("e.csv"),
        "time_s,id,x_m,y_m,var_x_m2,cov_xy_m2,var_y_m2\n1,a,3,4,9,0,16\n3,a,20,0,1,0,1\n1,b,0,500,1,0,1\n",
    )
    .unwrap();
    fs::write(here.join("t.csv"), "time_s,id,x_m,y_m\n1,a,0,0\n2,a,10,0\n4,a,30,0\n").unwrap();
    let said = json(&here, "compare e.csv t.csv");
    assert_eq!(said["association"], "id");
    assert_eq!((&said["instants"]["compared"], &said["instants"]["unmatched"]), (&2.into(), &1.into()));
    let scores = &said["scores"];
    close(&scores["rmse_m"], 12.5_f64.sqrt());
    close(&scores["rmse_x_m"], 4.5_f64.sqrt());
    close(&scores["median_error_m"], 2.5);
    // NEES 9/9 + 16/16 = 2 and 0: mean 1 per two components, half of it 0.5.
    close(&scores["nees"], 0.5);
    // 2 exceeds the median of chi-square with two degrees of freedom, 2 ln 2 = 1.39, and not the 90 % point 4.61.
    close(&scores["coverage50"], 0.5);
    close(&scores["coverage90"], 1.0);
    // At 1 s: a at distance 5 and b false, so sqrt(25 + 100^2 / 2); at 3 s: no error. Nothing is missed.
    let half = 100.0_f64.powi(2) / 2.0;
    close(&scores["gospa"], (25.0 + half).sqrt() / 2.0);
    close(&scores["gospa_localisation"], 5.0 / 2.0);
    close(&scores["gospa_missed"], 0.0);
    close(&scores["gospa_false"], half.sqrt() / 2.0);
    assert_eq!((&said["instants"]["sets"], &said["instants"]["missed"]), (&2.into(), &0.into()));
    let record: Value =
        serde_json::from_str(&fs::read_to_string(here.join("out/compare-e/run.json")).unwrap()).unwrap();
    assert_eq!((&record["input"][1]["path"], &record["counts"]["used"]), (&"t.csv".into(), &6.into()));
}

#[test]
fn without_common_ids_the_nearest_belong_together() {
    let here = folder("by_place");
    fs::write(here.join("e.csv"), "time_s,id,x_m,y_m\n1,p,101,0\n1,q,1,0\n2,p,102,0\n2,q,2,0\n").unwrap();
    fs::write(here.join("t.csv"), "time_s,id,x_m,y_m\n1,a,0,0\n1,b,100,0\n2,a,0,0\n2,b,100,0\n").unwrap();
    let said = json(&here, "compare e.csv t.csv --cutoff-m 10 --metric rmse gospa");
    assert_eq!(said["association"], "gospa");
    assert_eq!(said["instants"]["compared"], 4);
    close(&said["scores"]["rmse_m"], 2.5_f64.sqrt());
    close(&said["scores"]["gospa"], (2.0_f64.sqrt() + 8.0_f64.sqrt()) / 2.0);
    assert!(said["scores"]["nees"].is_null() && said["scores"]["median_error_m"].is_null());
    // The table has the same numbers; a metric that needs a covariance says so.
    let output = zerre(&here, "compare e.csv t.csv --cutoff-m 10");
    assert!(text(&output.stdout).contains("rmse_m"), "{}", text(&output.stdout));
    assert!(text(&output.stderr).contains("by place") && text(&output.stderr).contains("var_x_m2"));
    let output = zerre(&here, "compare e.csv t.csv --metric nees");
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("var_x_m2"));
}

#[test]
fn later_tracks_of_a_target_belong_to_it_and_gaps_are_missed() {
    let here = folder("again");
    let row = |t: u32, id: &str, x: u32, var: u32| format!("{t},{id},{x},0,{var},0,1\n");
    let header = "time_s,id,x_m,y_m,var_x_m2,cov_xy_m2,var_y_m2\n";
    let rows = row(1, "a", 3, 1) + &row(30, "a#2", 3, 1) + &row(15, "b", 100, 1);
    fs::write(here.join("e.csv"), format!("{header}{rows}")).unwrap();
    let truth = |id: &str, x: u32| (1..=30).map(|t| format!("{t},{id},{x},0\n")).collect::<String>();
    fs::write(here.join("t.csv"), format!("time_s,id,x_m,y_m\n{}{}", truth("a", 0), truth("b", 100)))
        .unwrap();
    let said = json(&here, "compare e.csv t.csv");
    assert_eq!((&said["association"], &said["instants"]["compared"]), (&"id".into(), &3.into()));
    close(&said["scores"]["rmse_m"], 6.0_f64.sqrt());
    // At 1 s and 30 s b has no estimate, at 15 s a has none: a#2 is another trajectory than a.
    assert_eq!(said["instants"]["missed"], 3);
    // A covariance without volume is left out and counted; where there is no other, everything else is said, and the
    // metric asked for by name is an error.
    fs::write(here.join("one.csv"), format!("{header}{}{}", row(1, "a", 3, 0), row(2, "a", 3, 1))).unwrap();
    let said = json(&here, "compare one.csv t.csv --metric nees coverage");
    assert_eq!((&said["instants"]["compared"], &said["instants"]["singular"]), (&2.into(), &1.into()));
    close(&said["scores"]["nees"], 9.0 / 2.0);
    assert!(text(&zerre(&here, "compare one.csv t.csv").stderr).contains("1 with a singular covariance"));
    fs::write(here.join("flat.csv"), format!("{header}{}", row(1, "a", 3, 0))).unwrap();
    let output = zerre(&here, "compare flat.csv t.csv");
    assert!(output.status.success() && text(&output.stderr).contains("not positive definite"));
    assert!(text(&output.stdout).contains("crps_m") && !text(&output.stdout).contains("nees"));
    assert_eq!(zerre(&here, "compare flat.csv t.csv --metric nees").status.code(), Some(1));
}

/// Rows of one time, a silence of 30 s (longer than what is bridged, shorter than what ends a track) and clouds that
/// have collapsed: whatever happens, there is one definition of each figure.
#[test]
fn track_and_compare_give_the_same_figures() {
    let here = folder("same");
    json(&here, "simulate two-crossing --seed 5 --out made");
    let made = fs::read_to_string(here.join("made/measurements.csv")).unwrap();
    let mut lines = made.lines();
    let mut table = format!("{}\n", lines.next().unwrap());
    for (i, line) in lines.enumerate() {
        let (time, rest) = line.split_once(',').unwrap();
        let (id, _) = rest.split_once(',').unwrap();
        let silent = (40.0..70.0).contains(&time.parse::<f64>().unwrap()) && Some(id) == made_id(&made);
        if !silent {
            table += &format!("{line}\n").repeat(1 + usize::from(i % 7 == 0));
        }
    }
    fs::write(here.join("m.csv"), table).unwrap();
    fs::write(here.join("few.toml"), "[filter]\nname = \"particle\"\nparticles = 2\n").unwrap();
    for (options, singular) in [("", false), ("--config few.toml", true)] {
        let tracked = json(&here, &format!("track m.csv --truth made/truth.csv {options} --force --out t"));
        let compared = json(&here, "compare t/tracks.csv made/truth.csv");
        for key in ["association", "instants", "scores"] {
            assert_eq!(tracked[key], compared[key], "{key} {options}");
        }
        assert!(tracked["scores"]["gospa"].as_f64().unwrap() > 0.0);
        let count = tracked["instants"]["singular"].as_u64().unwrap();
        assert_eq!(count > 0, singular);
        let page = fs::read_to_string(here.join("t/report.html")).unwrap();
        assert_eq!(page.contains("singular covariances"), singular);
    }
}

/// The identity in the first row.
fn made_id(table: &str) -> Option<&str> {
    table.lines().nth(1)?.split(',').nth(1)
}

#[test]
fn tables_that_never_meet_and_tables_without_a_common_frame_are_refused() {
    let here = folder("refused");
    fs::write(here.join("e.csv"), "time_s,id,x_m,y_m\n1,a,0,0\n2,a,1,0\n").unwrap();
    fs::write(here.join("late.csv"), "time_s,id,x_m,y_m\n1000,a,0,0\n1001,a,1,0\n").unwrap();
    fs::write(here.join("earth.csv"), "time_s,id,lat_deg,lon_deg\n1,a,50,14\n").unwrap();
    for (truth, says) in [("late.csv", "no estimate meets any truth"), ("earth.csv", "no common frame")] {
        let output = zerre(&here, &format!("compare e.csv {truth}"));
        assert_eq!(output.status.code(), Some(1), "{truth}");
        assert!(text(&output.stderr).contains(says), "{}", text(&output.stderr));
    }
}

#[test]
fn measurements_of_a_scenario_score_as_its_noise_says() {
    let here = folder("noise");
    json(&here, "simulate two-crossing --seed 5 --out made");
    let said = json(&here, "compare made/measurements.csv made/truth.csv --metric rmse");
    // sd 5 m on each axis: sqrt(50) = 7.07; about 218 measurements, relative sd 1 / sqrt(4 * 218) = 0.034; 5 of them.
    let rmse = said["scores"]["rmse_m"].as_f64().unwrap();
    assert!((rmse / 50.0_f64.sqrt() - 1.0).abs() < 5.0 * 0.034, "{rmse}");
    assert_eq!(said["instants"]["unmatched"], 0);
}

/// The object is hidden for 60 of 200 frames: another tracker than the one that stays still says so.
#[test]
fn a_drawn_clip_is_a_sequence_that_trackers_are_scored_on() {
    let here = folder("clip");
    let drawn = json(&here, "simulate clip-hidden --seed 305 --out clip");
    assert_eq!((&drawn["frames"], &drawn["seen"]), (&200.into(), &140.into()));
    let boxes = fs::read_to_string(here.join("clip/groundtruth.txt")).unwrap();
    assert_eq!(boxes.lines().filter(|line| line.starts_with("NaN")).count(), 60);
    let scored = json(&here, "otb clip --tracker zerre --tracker still --out scores");
    let auc = |tracker: &str| {
        let rows = scored["rows"].as_array().unwrap();
        rows.iter().find(|row| row["tracker"] == tracker).unwrap()["success_auc"].as_f64().unwrap()
    };
    assert!(auc("zerre") > 0.7 && auc("still") < 0.5, "{} {}", auc("zerre"), auc("still"));
    let twice = zerre(&here, "simulate clip-hidden --runs 2");
    assert!(!twice.status.success() && text(&twice.stderr).contains("--seed"));
}

/// The folder is one that recordings are read from: pictures of colours and of depth with the same numbers,
/// cameras, and the tables of what is known beside them. Pixels are those of the library (`zerre-vision`);
/// here it is the files.
#[test]
fn a_drawn_recording_of_colour_and_depth_is_a_folder() {
    let here = folder("rgbd");
    let drawn = json(&here, "simulate rgbd-device-drop-out --seed 2 --out made");
    assert_eq!(drawn["frames"], 111);
    assert!((44..=61).contains(&drawn["overlap"].as_u64().unwrap()), "{drawn}");
    for name in ["rgb", "depth"] {
        let pictures = fs::read_dir(here.join("made").join(name)).unwrap();
        assert_eq!(
            pictures.filter(|file| file.as_ref().unwrap().path().extension().unwrap() == "png").count(),
            111
        );
    }
    let lines = |name: &str| fs::read_to_string(here.join("made").join(name)).unwrap().lines().count();
    // Two stretches of 20 frames have no reading; seven people label each frame.
    assert_eq!((lines("truth.csv"), lines("joints.csv"), lines("labels.csv")), (112, 72, 778));
    for name in ["camera.json", "background_rgb.png", "background_depth.png", "rgb/run.json", "run.json"] {
        assert!(here.join("made").join(name).is_file(), "{name}");
    }
    let again = zerre(&here, "simulate rgbd-light --out made");
    assert!(!again.status.success() && text(&again.stderr).contains("--force"));
    let twice = zerre(&here, "simulate rgbd-light --runs 2");
    assert!(!twice.status.success() && text(&twice.stderr).contains("--seed"));
}
