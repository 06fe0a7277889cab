//! `zerre reproduce` from outside.

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn command(folder: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_zerre"));
    // Recordings are named where they are meant.
    command.args(line.split_whitespace()).current_dir(folder).env_remove("ZERRE_DATA");
    command
}

fn zerre(folder: &Path, line: &str) -> Output {
    command(folder, line).output().unwrap()
}

/// Runs zerre, which must succeed, and reads its document.
fn json(folder: &Path, line: &str) -> Value {
    let output = zerre(folder, &format!("{line} --json"));
    assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// An empty folder of the test's own.
fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("reproduce").join(name);
    let _ = fs::remove_dir_all(&path);
    fs::create_dir_all(&path).unwrap();
    path
}

/// The rows without times, which differ from run to run.
fn estimates(document: &Value) -> Vec<&Value> {
    let is_time = |row: &Value| row["metric"] == "seconds" || row["metric"] == "microseconds_per_step";
    document["rows"].as_array().unwrap().iter().filter(|row| !is_time(row)).collect()
}

#[test]
fn papers_are_listed_and_unknown_ones_refused() {
    let here = folder("list");
    let list = json(&here, "reproduce");
    assert_eq!(list["papers"][0]["name"], "multiple-model");
    assert_eq!(list["papers"][1]["name"], "bayes-family");
    assert_eq!(list["papers"][2]["name"], "extended-target");
    assert_eq!(list["papers"][3]["name"], "swarm");
    assert_eq!(list["papers"][4]["name"], "video");
    assert_eq!(list["papers"][5]["name"], "multi-ball");
    assert_eq!(list["papers"][6]["name"], "rgbd");
    assert!(list["papers"][3]["on_request"].as_array().unwrap().contains(&"variants".into()));
    assert!(
        String::from_utf8(zerre(&here, "reproduce").stdout).unwrap().contains("only on request: variants")
    );
    for (line, word) in [
        ("reproduce multiple-modle", "multiple-model"),
        ("reproduce multiple-model --table 7.1", "7.1"),
        ("reproduce multiple-model --table 6.14", "6.14"),
        ("reproduce bayes-family --table growth", "growth-q1"),
        ("reproduce extended-target --table cluter", "clutter"),
        ("reproduce extended-target --particles 10,20", "one number of particles"),
        ("reproduce swarm --table honst", "honest"),
        ("reproduce swarm --table reading-z", "reading-"),
        ("reproduce swarm --particles 10", "--particles"),
        ("reproduce video --particles 10", "--particles"),
        ("reproduce video --table other", "others"),
    ] {
        let output = zerre(&here, line);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{line}: {text}");
        assert!(text.contains(word), "{text}");
    }
    assert_eq!(zerre(&here, "reproduce multiple-model --resume").status.code(), Some(1));
}

/// All filters in all scenarios, with a few particles: the layout of everything that is written.
#[test]
fn everything_is_written_and_threads_change_nothing_but_times() {
    let here = folder("whole");
    let line = "reproduce multiple-model --quick --runs 2 --particles 30,40";
    let first = json(&here, &format!("{line} --threads 1 --out one"));
    let second = json(&here, &format!("{line} --threads 2 --out two"));
    assert_eq!(first["estimates_digest"], second["estimates_digest"]);
    assert_eq!(estimates(&first), estimates(&second));
    assert_eq!(
        (&first["paper"], &first["seed"], &first["runs"]),
        (&"multiple-model".into(), &1.into(), &2.into())
    );
    let rows = first["rows"].as_array().unwrap();
    for key in [
        "scenario",
        "algorithm",
        "wsms",
        "particles",
        "noise",
        "setting",
        "metric",
        "statistic",
        "value",
        "low",
        "high",
        "paper_value",
    ] {
        assert!(rows.iter().all(|row| row.get(key).is_some()), "{key}");
    }
    for algorithm in [
        "alg1",
        "alg2",
        "alg3",
        "alg2+wsms",
        "alg3+wsms",
        "imm-ukf",
        "imm-ekf",
        "imm-pf",
        "rb-mmpf",
        "known-mode-ukf",
    ] {
        for scenario in 1..=3 {
            for noise in [0.01, 0.1, 0.15, 0.2] {
                let here = |row: &&Value| {
                    row["algorithm"] == algorithm && row["scenario"] == scenario && row["noise"] == noise
                };
                assert!(rows.iter().any(|row| here(&row)), "{algorithm} {scenario} {noise}");
            }
        }
    }
    for row in rows {
        let number = |key: &str| row[key].as_f64().unwrap();
        assert!(number("low") <= number("high") && number("value") >= 0.0, "{row}");
        // Steps times models times particles, at most; a share of one is impossible while the window fills.
        if row["metric"] == "one_model_share" {
            assert!(number("value") < 1.0);
            let selects = row["wsms"] != "none";
            assert!(selects || number("value") == 0.0, "{row}");
        }
        if row["metric"] == "model_evaluations" && row["algorithm"] == "alg1" {
            let models = if row["scenario"] == 1 { 3.0 } else { 4.0 };
            assert_eq!(number("value"), 100.0 * models * number("particles"));
        }
    }
    let out = here.join("one");
    for number in 1..=13 {
        let text = fs::read_to_string(out.join(format!("table-6.{number}.csv"))).unwrap();
        // Five groups, six pairs, or five IMM filters in three scenarios.
        let expected = match number {
            13 => 15,
            4..=6 | 10..=12 => 24,
            _ => 20,
        };
        assert_eq!(text.lines().count(), 1 + expected, "{number}");
    }
    for name in ["table-readings", "table-beyond", "table-paired", "table-saving", "rows", "rmse-per-step"] {
        assert!(fs::read_to_string(out.join(format!("{name}.csv"))).unwrap().lines().count() > 4, "{name}");
    }
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    for text in [
        "STANDARD DEVIATIONS",
        "Printed cells that cannot be right",
        "Probabilities of the modes",
        "Scenario 3",
    ] {
        assert!(page.contains(text), "{text}");
    }
    let record: Value = serde_json::from_str(&fs::read_to_string(out.join("run.json")).unwrap()).unwrap();
    assert_eq!((&record["command"], &record["state"]), (&"reproduce".into(), &"complete".into()));
    assert_eq!(record["estimates_digest"], first["estimates_digest"]);
}

#[test]
fn another_seed_moves_every_cell() {
    let here = folder("seeds");
    let line = "reproduce multiple-model --table 6.1 --table 6.13 --runs 2 --particles 30";
    let [first, second] = [1, 2].map(|seed| json(&here, &format!("{line} --seed {seed} --out s{seed}")));
    let errors = |document: &Value| -> Vec<f64> {
        let rows = document["rows"].as_array().unwrap();
        rows.iter()
            .filter(|row| row["metric"] == "rmse_km")
            .map(|row| row["value"].as_f64().unwrap())
            .collect()
    };
    let (first, second) = (errors(&first), errors(&second));
    assert!(first.len() == second.len() && first.len() >= 2 * 20);
    assert!(first.iter().zip(&second).all(|(a, b)| a != b));
}

/// Two worlds with few particles: columns, the exact filter, filters that do not apply, threads and seeds.
#[test]
fn the_bayesian_family_is_compared_world_by_world() {
    let here = folder("family");
    let line = "reproduce bayes-family --table linear --table ungm --runs 3 --particles 10,50";
    let first = json(&here, &format!("{line} --threads 1 --out one"));
    let second = json(&here, &format!("{line} --threads 2 --out two"));
    assert_eq!(first["estimates_digest"], second["estimates_digest"]);
    assert_eq!(estimates(&first), estimates(&second));
    let rows = first["rows"].as_array().unwrap();
    for row in rows {
        for key in ["world", "filter", "evaluations", "metric", "statistic", "particles", "setting", "runs"] {
            assert!(!row[key].is_null(), "{key}: {row}");
        }
        assert!(row["paper_value"].is_null());
        let number = |key: &str| row[key].as_f64().unwrap();
        assert!(number("low") <= number("high") && number("value") >= 0.0, "{row}");
    }
    let value = |world: &str, filter: &str, metric: &str| {
        let wanted =
            |row: &&Value| row["world"] == world && row["filter"] == filter && row["metric"] == metric;
        rows.iter().filter(wanted).map(|row| row["value"].as_f64().unwrap()).collect::<Vec<_>>()
    };
    for metric in [
        "rmse",
        "crps",
        "coverage90",
        "evidence_error",
        "failures",
        "microseconds_per_step",
        "rmse_ratio",
        "crps_ratio",
    ] {
        assert!(!value("linear", "bootstrap", metric).is_empty(), "{metric}");
    }
    // The extended filter is the exact one where all is linear; the exact one is refused elsewhere.
    assert!(value("linear", "ekf", "rmse_ratio").iter().all(|ratio| (ratio - 1.0).abs() < 1e-9));
    assert!(value("ungm", "kalman", "rmse").is_empty());
    let table = fs::read_to_string(here.join("one/table-ungm.csv")).unwrap();
    assert!(table.lines().any(|line| line.starts_with("kalman") && line.contains("not for")), "{table}");
    for name in ["table-linear", "table-2.1", "table-2.2", "rows"] {
        assert!(here.join(format!("one/{name}.csv")).exists(), "{name}");
    }
    let page = fs::read_to_string(here.join("one/report.html")).unwrap();
    for text in ["Which filter to take", "insensitive to processes of high order", "does not apply"] {
        assert!(page.contains(text), "{text}");
    }
    let other = json(&here, &format!("{line} --seed 2 --out other"));
    let errors = |document: &Value| -> Vec<f64> {
        let rows = document["rows"].as_array().unwrap().iter().filter(|row| row["metric"] == "rmse");
        rows.map(|row| row["value"].as_f64().unwrap()).collect()
    };
    let (a, b) = (errors(&first), errors(&other));
    assert!(a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| a != b));
}

/// The extended target in all its scenes: columns, printed values, methods, threads, seeds, pictures.
#[test]
fn the_extended_target_is_run_in_all_scenes() {
    let here = folder("extended");
    let line = "reproduce extended-target --runs 2 --particles 60";
    let part = |threads: usize| {
        json(
            &here,
            &format!("{line} --table clutter --table rate --threads {threads} --out threads-{threads}"),
        )
    };
    let (serial, parallel) = (part(1), part(2));
    assert_eq!(serial["estimates_digest"], parallel["estimates_digest"]);
    assert_eq!(serial["rows"], parallel["rows"]);
    let first = json(&here, &format!("{line} --out one"));
    let rows = first["rows"].as_array().unwrap();
    for row in rows {
        for key in
            ["method", "scans", "start", "clutter", "rate", "metric", "statistic", "clutter_model", "runs"]
        {
            assert!(!row[key].is_null(), "{key}: {row}");
        }
        let number = |key: &str| row[key].as_f64().unwrap();
        assert!(number("low") <= number("value") && number("value") <= number("high"), "{row}");
        let share = ["iou", "fail", "as_good"].iter().any(|metric| row["metric"] == *metric);
        assert!(number("value") >= 0.0 && (!share || number("value") <= 1.0), "{row}");
        let mean = row["metric"] == "fail" || row["metric"] == "as_good";
        assert_eq!(row["statistic"], if mean { "mean" } else { "median" });
    }
    // What there is of a method in the main scene from a start.
    let found = |method: &str, scans: usize, start: &str, metric: &str| -> Vec<&Value> {
        let wanted = |row: &&Value| {
            (&row["method"], &row["metric"]) == (&method.into(), &metric.into())
                && (&row["scans"], &row["start"]) == (&scans.into(), &start.into())
                && (&row["clutter"], &row["rate"]) == (&0.into(), &9.into())
        };
        rows.iter().filter(wanted).collect()
    };
    for scans in [10, 50, 100] {
        for method in ["paper", "paper-sequential", "rb-online-em", "window-vb", "batch-vb", "batch-pf"] {
            for start in ["near", "data", "truth"] {
                for metric in ["shape_error", "gw", "iou", "fail", "centroid_rmse"] {
                    let rows = found(method, scans, start, metric);
                    let expected = usize::from(method != "batch-pf" || scans == 10);
                    assert_eq!(rows.len(), expected, "{method} {metric} {scans} {start}");
                    // The printed shape gives two of the numbers, in the scene of the paper alone.
                    let printed =
                        scans == 10 && start == "near" && (metric == "shape_error" || metric == "gw");
                    assert!(rows.iter().all(|row| row["paper_value"].is_null() != printed), "{rows:?}");
                }
            }
        }
        for method in ["random-matrix-koch", "random-matrix-feldmann", "ggiw", "mem-ekf", "star-convex"] {
            assert_eq!(found(method, scans, "near", "iou").len(), 1, "{method}");
            assert!(found(method, scans, "near", "shape_error").is_empty(), "{method}");
        }
        assert_eq!(found("oracle", scans, "truth", "shape_error").len(), 1);
    }
    for (key, values) in [("clutter", [1, 3].as_slice()), ("rate", &[27])] {
        assert!(values.iter().all(|value| rows.iter().any(|row| row[key] == *value)), "{key}");
    }
    let rate_errors = rows.iter().filter(|row| row["metric"] == "clutter_error");
    assert!(rate_errors.clone().all(|row| row["clutter_model"] == "learnt") && rate_errors.count() == 2);
    for name in ["table-scene", "table-clutter", "table-rate", "rows"] {
        assert!(here.join(format!("one/{name}.csv")).exists(), "{name}");
    }
    let page = fs::read_to_string(here.join("one/report.html")).unwrap();
    for text in
        ["How likely the printed numbers are", "as good as the printed one", "Outlines along the path"]
    {
        assert!(page.contains(text), "{text}");
    }
    let record: Value =
        serde_json::from_str(&fs::read_to_string(here.join("one/run.json")).unwrap()).unwrap();
    for method in ["paper", "rb-online-em", "window-vb"] {
        let name = format!("shape-{method}.gif");
        let file = fs::read(here.join("one").join(&name)).unwrap();
        assert!(file.starts_with(b"GIF89a") && file.ends_with(b";"), "{name}");
        assert!(page.contains(&format!("<img src=\"{name}\"")), "{name}");
        assert!(record["files"].as_array().unwrap().contains(&name.as_str().into()), "{name}");
    }
    let other = json(&here, &format!("{line} --seed 2 --out other"));
    let values = |document: &Value| -> Vec<f64> {
        let rows = document["rows"].as_array().unwrap().iter();
        let continuous = |row: &&Value| row["metric"] != "fail" && row["metric"] != "as_good";
        rows.filter(continuous).map(|row| row["value"].as_f64().unwrap()).collect()
    };
    let (a, b) = (values(&first), values(&other));
    assert!(a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| a != b));
}

/// The vehicle and the radar's objects, where they are at hand: methods in pairs on the same points. Two thin sides of a
/// car are worth more than a nat a point over any one ellipse; the boxes fall as they do.
#[test]
fn recordings_of_extended_targets_are_judged() {
    let here = folder("recorded");
    let none = json(&here, "reproduce extended-target --table recorded --out none");
    assert!(none["rows"].as_array().unwrap().is_empty());
    let page = fs::read_to_string(here.join("none/report.html")).unwrap();
    assert!(page.contains("Not available"));
    let refused = zerre(&here, "reproduce extended-target --data nowhere");
    let words = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(refused.status.code() == Some(1) && words.contains("nowhere"), "{words}");
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let data = std::env::var_os("ZERRE_DATA").map_or_else(beside, PathBuf::from);
    if !data.join("metu_lidar_vehicle/points.csv").exists() {
        assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "no recordings in {}", data.display());
        eprintln!("SKIPPED: no recordings in {}", data.display());
        return;
    }
    let line = format!("reproduce extended-target --table recorded --data {} --out all", data.display());
    let all = json(&here, &line);
    let row = |recording: &str, method: &str, metric: &str| -> &Value {
        let wanted = |row: &&Value| {
            row["recording"] == recording && row["method"] == method && row["metric"] == metric
        };
        all["rows"].as_array().unwrap().iter().find(wanted).unwrap()
    };
    for other in ["random-matrix-koch", "random-matrix-feldmann"] {
        let gain = row("vehicle", "window-vb", &format!("held_out less {other}"));
        assert!(gain["low"].as_f64().unwrap() > 1.0 && gain["runs"] == 39, "{gain}");
        let turning = row("vehicle", "window-vb", "held_out")["value"].as_f64().unwrap();
        let fixed = row("vehicle", "window-vb-fixed-axes", "held_out")["value"].as_f64().unwrap();
        assert!(turning > fixed, "{turning} {fixed}");
        for (scene, objects) in [("scene-0239", 23), ("scene-0400", 94)] {
            let pair = row(scene, "window-vb", &format!("iou less {other}"));
            assert!(pair["runs"] == objects && pair["low"].as_f64() < pair["high"].as_f64(), "{pair}");
        }
    }
    assert!(here.join("all/table-recorded.csv").exists());
}

/// A sequence that is not on disk leaves what is printed, and says so.
#[test]
fn printed_errors_stand_alone_where_a_sequence_is_missing() {
    let here = folder("video");
    let found = json(&here, "reproduce video --table 2 --runs 1 --out all");
    let rows = found["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 40);
    for row in rows {
        assert_eq!((&row["sequence"], &row["value"]), (&"Walking".into(), &"not available".into()));
        assert!(row["frame"].is_u64() && row["paper_value"].is_f64() && row["low"].is_null(), "{row}");
    }
    assert_eq!(found["paper"], "video");
    let page = fs::read_to_string(here.join("all/report.html")).unwrap();
    assert!(page.contains("Not available: Walking") && here.join("all/table-2.csv").exists());
}

/// Real recordings that are not on disk are named; a folder that is not there is refused.
#[test]
fn recordings_of_depth_that_are_missing_are_said_so() {
    let here = folder("rgbd");
    let found = json(&here, "reproduce rgbd --table recorded --out all");
    assert_eq!(found["rows"], serde_json::json!([]));
    let table = fs::read_to_string(here.join("all/table-recorded.csv")).unwrap();
    assert_eq!(table.matches("not available").count(), 3, "{table}");
    let page = fs::read_to_string(here.join("all/report.html")).unwrap();
    assert!(page.contains("Not available: um, filinha, corridor. Name the folder"));
    for paper in ["rgbd", "video"] {
        let output = zerre(&here, &format!("reproduce {paper} --data nowhere"));
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(
            output.status.code() == Some(1) && text.contains("nowhere: there is no such folder"),
            "{text}"
        );
    }
}

/// Swarm filters: columns, printed values, every filter in every world, tables on request, threads, seeds.
#[test]
fn the_swarm_filters_are_run_in_all_worlds() {
    let here = folder("swarm");
    let line = "reproduce swarm --runs 2";
    let part = |threads: usize| {
        json(&here, &format!("{line} --table 1 --table honest --threads {threads} --out threads-{threads}"))
    };
    let (serial, parallel) = (part(1), part(2));
    assert_eq!(serial["estimates_digest"], parallel["estimates_digest"]);
    assert_eq!(estimates(&serial), estimates(&parallel));
    let first = json(&here, &format!("{line} --out one"));
    let rows = first["rows"].as_array().unwrap();
    for row in rows {
        for key in ["world", "algorithm", "reading", "metric", "statistic"] {
            assert!(row[key].is_string(), "{key}: {row}");
        }
        for key in ["steps", "evaluations", "particles", "runs"] {
            assert!(row[key].is_u64(), "{key}: {row}");
        }
        let number = |key: &str| row[key].as_f64().unwrap();
        assert!(number("low") <= number("value") && number("value") <= number("high"), "{row}");
        assert!(row["metric"] != "coverage90" || number("value") <= 1.0, "{row}");
    }
    let found = |world: &str, reading: &str, algorithm: &str, metric: &str| -> Vec<&Value> {
        let wanted = |row: &&Value| {
            (&row["world"], &row["reading"]) == (&world.into(), &reading.into())
                && (&row["algorithm"], &row["metric"]) == (&algorithm.into(), &metric.into())
                && (row["statistic"] == "mean" || row["statistic"] == "median")
        };
        rows.iter().filter(wanted).collect()
    };
    // The 18 cells of the paper's table, each with its printed value.
    for algorithm in ["pf", "pso-pf", "abc-pf"] {
        let cells = found("paper", "n", algorithm, "rmse");
        let mut places: Vec<_> = cells.iter().map(|row| (row["steps"].as_u64(), row["q"].as_u64())).collect();
        places.sort();
        let expected = [50, 100].map(|steps| [1, 3, 6].map(|q| (Some(steps), Some(q))));
        assert_eq!(places, expected.concat(), "{algorithm}");
        assert!(cells.iter().all(|row| row["paper_value"].as_f64().is_some()));
        for reading in ["a", "d"] {
            assert_eq!(found("paper", reading, algorithm, "rmse").len(), 3, "{reading}");
        }
    }
    let printed: Vec<_> = rows.iter().filter(|row| !row["paper_value"].is_null()).collect();
    assert!(printed.iter().all(|row| row["world"] == "paper" && row["statistic"] == "mean"));
    assert!(found("paper", "n", "bootstrap", "nis").len() == 12);
    for (world, scenes) in [("growth", 3), ("ungm", 1), ("upf", 1)] {
        for (algorithm, sizes) in [
            ("grid", 1),
            ("bootstrap", 5),
            ("abc-pf", 1),
            ("abc-pf-40", 1),
            ("pso-pf-5", 1),
            ("pso-pf-40-personal-best", 1),
            ("auxiliary", 2),
            ("regularised", 2),
            ("ekf-guided", 2),
            ("ukf-guided", 2),
            ("resample-move", 2),
            ("stretch-move", 2),
            ("tempered-random-walk", 2),
            ("tempered-stretch", 2),
            ("swarm-importance", 2),
        ] {
            for metric in ["rmse", "crps", "coverage90", "rmse_ratio", "microseconds_per_step"] {
                let count = found(world, "default", algorithm, metric).len();
                assert_eq!(count, sizes * scenes, "{world} {algorithm} {metric}");
            }
            let beside = if algorithm == "grid" { 0 } else { sizes * scenes };
            for metric in ["posterior_error", "w1"] {
                assert_eq!(found(world, "default", algorithm, metric).len(), beside, "{algorithm} {metric}");
            }
        }
    }
    assert!(found("growth", "default", "grid", "rmse_ratio").iter().all(|row| row["value"] == 1.0));
    for name in ["table-1", "table-honest", "table-misfit", "rows"] {
        assert!(here.join(format!("one/{name}.csv")).exists(), "{name}");
    }
    let page = fs::read_to_string(here.join("one/report.html")).unwrap();
    for text in
        ["When it lies.", "When it helps.", "What shows it.", "90 % intervals: abc-pf", "Shift of the mean"]
    {
        assert!(page.contains(text), "{text}");
    }
    let request = json(&here, &format!("{line} --table variants --table reading-s --out request"));
    let asked = request["rows"].as_array().unwrap();
    assert!(asked.iter().any(|row| row["algorithm"] == "abc-pf-40-scouts"));
    assert!(asked.iter().any(|row| row["reading"] == "s" && row["paper_value"].is_f64()));
    assert!(here.join("request/table-reading-s.csv").exists() && !here.join("request/table-1.csv").exists());
    let other = json(&here, &format!("{line} --seed 2 --out other"));
    let errors = |document: &Value| -> Vec<f64> {
        let rows = document["rows"].as_array().unwrap().iter().filter(|row| row["metric"] == "rmse");
        rows.map(|row| row["value"].as_f64().unwrap()).collect()
    };
    let (a, b) = (errors(&first), errors(&other));
    assert!(a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| a != b));
}

/// A run that is stopped keeps what it has; going on gives what an undisturbed run gives.
#[cfg(unix)]
#[test]
fn an_interrupted_run_goes_on_to_the_same_rows() {
    use std::process::Stdio;
    use std::time::{Duration, Instant};
    let here = folder("resume");
    let line = "reproduce multiple-model --table 6.2 --runs 20 --particles 30,1500 --threads 1";
    let whole = json(&here, &format!("{line} --out whole"));
    let mut child = command(&here, &format!("{line} --out part")).stderr(Stdio::null()).spawn().unwrap();
    let since = Instant::now();
    while !here.join("part/progress.json").exists() {
        assert!(since.elapsed() < Duration::from_secs(120), "no progress");
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(1));
    let state = |out: &str| -> Value {
        serde_json::from_str(&fs::read_to_string(here.join(out).join("run.json")).unwrap()).unwrap()
    };
    assert_eq!(state("part")["state"], "interrupted", "the run was too short to be interrupted");
    let other = zerre(&here, &format!("{line} --seed 2 --out part --resume"));
    assert_eq!(other.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&other.stderr).contains("another configuration"));
    let resumed = json(&here, &format!("{line} --out part --resume"));
    assert_eq!(state("part")["state"], "complete");
    assert_eq!(resumed["estimates_digest"], whole["estimates_digest"]);
    assert_eq!(estimates(&resumed), estimates(&whole));
    // What is done is not done again: times are those that were measured then.
    let again = json(&here, &format!("{line} --out part --resume"));
    assert_eq!(again["rows"], resumed["rows"]);
}
