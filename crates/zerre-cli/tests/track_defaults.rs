//! What `zerre track` chooses where nobody told: filter, noises, laws of errors.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use zerre::rng::{Purpose, Stream};

fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("track-defaults-{name}"));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// The document of a run that must succeed.
fn zerre(inside: &Path, line: &str) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_zerre"))
        .current_dir(inside)
        .args(line.split_whitespace())
        .args(["--json", "--quiet"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The effective configuration of the run in `out/`.
fn configuration(inside: &Path) -> Value {
    let record = std::fs::read_to_string(inside.join("out/run.json")).unwrap();
    serde_json::from_str::<Value>(&record).unwrap()["config"].clone()
}

/// Straight lines with normal errors of 5 m: the law of errors is found to be normal, with a deviation within 4
/// standard errors, 5 / sqrt(2 * 400), and the innovations consistent. Particles, which collapse where the motion has
/// no noise, must not decide on it.
#[test]
fn normal_errors_are_found_normal() {
    for (case, speed) in [0.0, 10.0, 100.0].into_iter().enumerate() {
        let inside = folder(&format!("straight-{case}"));
        let mut draws = Stream::new(40 + case as u64).draws(Purpose::Other, 0, 0);
        let mut table = "time_s,id,x_m,y_m\n".to_owned();
        for k in 0..200 {
            let t = f64::from(k);
            let (x, y) = (speed * t + 5.0 * draws.normal(), 20.0 * t + 5.0 * draws.normal());
            table += &format!("{t},a,{x:.3},{y:.3}\n");
        }
        std::fs::write(inside.join("line.csv"), table).unwrap();
        zerre(&inside, "track line.csv --out out");
        let config = configuration(&inside);
        let sensor = &config["sensor"]["default"];
        assert_eq!(sensor["robust"], Value::Null, "{sensor}");
        let sd = sensor["position_sd_m"].as_f64().unwrap();
        assert!((sd - 5.0).abs() < 4.0 * 5.0 / 800f64.sqrt(), "{sd}");
        assert_eq!(config["filter"]["name"], "kalman");
    }
}

/// Bearings of a hundredth of a radian at close range: the tangent serves better than sigma points and 2 000
/// particles there, and is found by its evidence.
#[test]
fn the_kalman_filter_with_most_evidence_is_taken() {
    let inside = folder("radar");
    zerre(&inside, "simulate radar-cv --seed 7 --out made");
    let tracked = |line: &str| {
        zerre(
            &inside,
            &format!("track made/measurements.csv --config made/track.toml --force --out out {line}"),
        )
    };
    let evidence = |document: &Value| document["log_evidence"].as_f64().unwrap();
    let chosen = tracked("");
    let name = configuration(&inside)["filter"]["name"].clone();
    let best =
        ["ekf", "ukf", "particle"].map(|filter| (evidence(&tracked(&format!("--filter {filter}"))), filter));
    let best = best.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
    assert_eq!((name.as_str(), evidence(&chosen)), (Some(best.1), best.0));
}
