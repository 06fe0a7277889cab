//! `zerre study` from outside.

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn command(folder: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_zerre"));
    command.args(line.split_whitespace()).current_dir(folder);
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

/// A folder of the test's own with `study.toml` in it.
fn folder(name: &str, text: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("study").join(name);
    let _ = fs::remove_dir_all(&path);
    fs::create_dir_all(&path).unwrap();
    fs::write(path.join("study.toml"), text).unwrap();
    path
}

/// The rows without times, which differ from run to run.
fn estimates(document: &Value) -> Vec<&Value> {
    let rows = document["rows"].as_array().unwrap();
    rows.iter().filter(|row| row["metric"] != "microseconds_per_step").collect()
}

const SMALL: &str = r#"
runs = 60
metrics = ["rmse", "crps", "coverage90", "evidence"]
[[world]]
name = "linear"
measurement_variance = [1.0, 4.0]
steps = 10
[[filter]]
name = "kalman"
[[filter]]
name = "ekf"
[[filter]]
name = "bootstrap"
particles = [20, 60]
resampling = ["systematic", "multinomial"]
trigger = [0.5, "always"]
[[world]]
name = "ungm"
steps = 10
"#;

#[test]
fn the_grid_is_spanned_scored_and_ranked() {
    let here = folder("grid", SMALL);
    let first = json(&here, "study study.toml --threads 1 --out one");
    let second = json(&here, "study study.toml --threads 2 --out two");
    assert_eq!(first["estimates_digest"], second["estimates_digest"]);
    assert_eq!(estimates(&first), estimates(&second));
    let other = json(&here, "study study.toml --seed 2 --out other");
    assert_ne!(first["estimates_digest"], other["estimates_digest"]);

    // Three worlds; kalman, ekf and eight particle filters; the Kalman filter refuses the growth model.
    let read = |name: &str| fs::read_to_string(here.join("one").join(name)).unwrap();
    assert_eq!(read("results.csv").lines().count(), 1 + 60 * (10 + 10 + 9));
    let ranking = read("ranking.csv");
    assert_eq!(ranking.lines().count(), 1 + 30);
    let refused = ranking.lines().filter(|line| line.contains("exact for linear normal models only"));
    assert_eq!(refused.count(), 1);
    let parquet = fs::read(here.join("one/results.parquet")).unwrap();
    assert!(parquet.starts_with(b"PAR1") && parquet.ends_with(b"PAR1"));

    let rows = first["rows"].as_array().unwrap();
    let value = |filter: &str, variance: f64, metric: &str| {
        let wanted = |row: &&Value| {
            row["filter"] == filter && row["measurement_variance"] == variance && row["metric"] == metric
        };
        rows.iter().filter(wanted).map(|row| row["value"].as_f64().unwrap()).collect::<Vec<_>>()
    };
    // Two names for one filter where all is linear; the noise is an axis, and more of it is more error.
    for metric in ["rmse", "crps", "log_evidence"] {
        let (a, b) = (value("kalman", 1.0, metric)[0], value("ekf", 1.0, metric)[0]);
        assert!((a - b).abs() < 1e-9 * a.abs(), "{metric}: {a} {b}");
    }
    assert!(value("kalman", 4.0, "rmse")[0] > value("kalman", 1.0, "rmse")[0]);
    assert!(value("bootstrap", 4.0, "rmse").iter().all(|rmse| *rmse > value("kalman", 4.0, "rmse")[0]));
    // Nine intervals of ten hold the truth: 60 runs of 10 steps and two components, of which neighbours
    // depend on each other; were only every fifth of the 1 200 a draw of its own, five standard errors are
    // 0.1.
    assert!((value("kalman", 1.0, "coverage90")[0] - 0.9).abs() < 0.1);
    let page = read("report.html");
    for text in ["Ranking", "least error with", "does not apply", "as good as the first", "<circle"] {
        assert!(page.contains(text), "{text}");
    }
    let record: Value = serde_json::from_str(&read("run.json")).unwrap();
    assert_eq!((&record["command"], &record["state"]), (&"study".into(), &"complete".into()));
    assert_eq!(record["input"][0]["path"], "study.toml");
    assert_eq!(record["config"]["study"]["runs"], 60);
}

#[test]
fn a_file_without_meaning_is_refused_where_it_stands() {
    let sound =
        "runs = 2\n[[world]]\nname = \"ungm\"\nsteps = 5\n[[filter]]\nname = \"bootstrap\"\nparticles = 9\n";
    let here = folder("bad", sound);
    assert!(zerre(&here, "study study.toml").status.success());
    for (from, to, place, word) in [
        ("particles = 9", "particles = 0", "bad.toml:7:13", "at least 1"),
        ("particles = 9", "particles = [9, -1]", "bad.toml:7", "-1"),
        ("particles = 9", "particels = 9", "bad.toml:7:1", "particles"),
        ("particles = 9", "evaluations = 9\nparticles = 9", "bad.toml:7:15", "not both"),
        ("particles = 9", "trigger = \"alway\"", "bad.toml:7:11", "always"),
        ("particles = 9", "trigger = -1", "bad.toml:7:11", "negative"),
        ("particles = 9", "resampling = [\"sytematic\"]", "bad.toml:7", "systematic"),
        ("\"bootstrap\"", "\"boostrap\"", "bad.toml:6:8", "bootstrap"),
        ("\"bootstrap\"", "\"ekf\"", "bad.toml:7:13", "no particles"),
        ("\"ungm\"", "\"ugnm\"", "bad.toml:3:8", "ungm"),
        ("steps = 5", "steps = []", "bad.toml:4:9", "empty"),
        ("steps = 5", "measurement_variance = nan", "bad.toml:4:24", "positive"),
        ("runs = 2", "runs = 0", "bad.toml:1:8", "between 1"),
        ("runs = 2", "metrics = [\"coverage90\"]", "bad.toml:1:11", "ranks"),
        ("runs = 2", "metrics = [\"rmsee\"]", "bad.toml:1", "rmse"),
        ("[[filter]]", "[[filters]]", "bad.toml:5", "filter"),
        ("[[world]]\nname = \"ungm\"\nsteps = 5\n", "world = []\n", "bad.toml:2", "at least one"),
    ] {
        let text = sound.replacen(from, to, 1);
        assert_ne!(text, sound);
        fs::write(here.join("bad.toml"), text).unwrap();
        let output = zerre(&here, "study bad.toml");
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{to}: {told}");
        assert!(told.contains(place) && told.contains(word), "{to}: {told}");
    }
    assert_eq!(zerre(&here, "study absent.toml").status.code(), Some(1));
    assert!(!here.join("out/study-bad").exists());
}

/// A study that is stopped leaves whole files; going on gives what an undisturbed one gives.
#[cfg(unix)]
#[test]
fn an_interrupted_study_goes_on_to_the_same_rows() {
    use std::process::Stdio;
    use std::time::{Duration, Instant};
    let text =
        "runs = 1000\n[[world]]\nname = \"ungm\"\n[[filter]]\nname = \"bootstrap\"\nparticles = 1500\n";
    let here = folder("resume", text);
    let whole = json(&here, "study study.toml --threads 2 --out whole");
    let mut child =
        command(&here, "study study.toml --threads 1 --out part").stderr(Stdio::null()).spawn().unwrap();
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
    assert_eq!(state("part")["state"], "interrupted", "the study was too short to be interrupted");
    let done = fs::read_to_string(here.join("part/results.csv")).unwrap().lines().count() - 1;
    assert!(done > 0 && done < 1000 && done.is_multiple_of(50), "{done}");
    assert!(fs::read(here.join("part/results.parquet")).unwrap().ends_with(b"PAR1"));
    let other = zerre(&here, "study study.toml --seed 2 --out part --resume");
    assert_eq!(other.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&other.stderr).contains("another configuration"));
    let resumed = json(&here, "study study.toml --threads 2 --out part --resume");
    assert_eq!(state("part")["state"], "complete");
    assert_eq!(resumed["estimates_digest"], whole["estimates_digest"]);
    assert_eq!(estimates(&resumed), estimates(&whole));
}
