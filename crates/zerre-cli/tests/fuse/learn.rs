//! What sources are like, learnt from marked frames.

use super::{beginning, document, folder, fuse, record, text, words};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// The table of joints with every place moved.
fn moved(made: &Path, by: [f64; 2]) -> std::path::PathBuf {
    let table = fs::read_to_string(made.join("joints.csv")).unwrap();
    let row = |line: &str| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        for k in 0..2 {
            if let Ok(value) = cells[2 + k].parse::<f64>() {
                cells[2 + k] = (value + by[k]).to_string();
            }
        }
        cells.join(",")
    };
    let file = made.join(format!("moved-{}.csv", by[0]));
    fs::write(&file, table.lines().map(row).collect::<Vec<_>>().join("\n")).unwrap();
    file
}

fn source<'a>(found: &'a Value, name: &str) -> &'a Value {
    found["learnt"]["sources"].as_array().unwrap().iter().find(|source| source["source"] == name).unwrap()
}

/// A device that is off by so much is learnt to be off by so much more than one that is not; what was learnt
/// is written as a configuration that gives the same points, and these are better than without. In-sample
/// scores are said to be.
#[test]
fn sources_are_learnt_from_several_operators() {
    let (made, out) = (beginning("learn", 60), folder("learn-out"));
    let (labels, truth) = (made.join("labels.csv"), made.join("truth.csv"));
    let learn = |name: &str, joints: &Path, more: &[&str]| {
        let mut args = vec!["--joints", text(joints), "--calibrate", text(&labels)];
        args.extend_from_slice(more);
        let run = fuse(&made, &out.join(name), &args);
        (document(&run), words(&run))
    };
    let (right, _) = learn("right", &moved(&made, [0.0, 0.0]), &[]);
    let joints = moved(&made, [14.0, -9.0]);
    let (wrong, said) = learn("wrong", &joints, &[]);
    let offset = |found: &Value, k: usize| source(found, "device")["offset"][k].as_f64().unwrap();
    // The same readings moved: the same law moved, as far as both rounds settle at it.
    for (k, by) in [14.0, -9.0].into_iter().enumerate() {
        let learnt = offset(&wrong, k) - offset(&right, k);
        assert!((learnt - by).abs() < 1.5, "{learnt} instead of {by}: {wrong}");
    }
    assert!(said.contains("outlier") && said.contains("device"), "{said}");
    let seen = fs::read_to_string(&labels).unwrap().lines().filter(|line| line.ends_with(",1")).count();
    let frames = source(&wrong, "color")["frames"].as_u64().unwrap();
    assert!(frames > 40 && frames < 60 && seen > 300, "{frames}");
    // The reference is known to so much: seven operators with 3 px each have 3 sqrt(4 / 7 pi) = 1.3 px.
    let score = &wrong["scores"][0];
    assert!((0.5..2.5).contains(&score["reference_se_px"].as_f64().unwrap()), "{score}");
    assert_eq!(score["in_sample"], score["frames"]);
    let page = fs::read_to_string(out.join("wrong/report.html")).unwrap();
    for words in ["In-sample", "geometric median of up to 7 operators", "What was learnt of the sources"] {
        assert!(page.contains(words), "{words}");
    }

    let config = out.join("wrong/fuse.toml");
    let run = |name: &str, more: &[&str]| {
        let mut args = vec!["--joints", text(&joints)];
        args.extend_from_slice(more);
        document(&fuse(&made, &out.join(name), &args))
    };
    let again = run("again", &["--config", text(&config), "--truth", text(&truth)]);
    assert_eq!(again["estimates_digest"], wrong["estimates_digest"]);
    assert_eq!(
        again["scores"][0]["in_sample"], again["scores"][0]["frames"],
        "other marks of the same recording"
    );
    let before = run("before", &["--truth", text(&truth)]);
    let rmse = |found: &Value| found["rmse_px"].as_f64().unwrap();
    assert!(rmse(&again) < rmse(&before), "{again} {before}");
    // Of another recording they are not, unless the marks are the very same.
    let other = beginning("learn-other", 12);
    fs::write(other.join("labels.csv"), fs::read_to_string(&labels).unwrap() + "\n").unwrap();
    for (marks, inside) in [(&other.join("truth.csv"), 0), (&other.join("labels.csv"), 0), (&labels, 12)] {
        let name = format!("other-{inside}-{}", marks.file_stem().unwrap().to_str().unwrap());
        let run = fuse(&other, &out.join(name), &["--config", text(&config), "--truth", text(marks)]);
        assert_eq!(document(&run)["scores"][0]["in_sample"], inside, "{}", marks.display());
    }
    // The starter's remarks are in it.
    let toml = fs::read_to_string(&config).unwrap();
    assert!(toml.contains("# The cue of depth") && toml.contains("[learnt]\n"), "{toml}");
    assert!(record(&out.join("wrong"))["files"].as_array().unwrap().contains(&"fuse.toml".into()));
}

#[test]
fn what_cannot_be_learnt_is_said() {
    let (made, out) = (beginning("unlearnt", 14), folder("unlearnt-out"));
    let (labels, few) = (made.join("labels.csv"), made.join("few.csv"));
    let rows: Vec<String> = (0..5).map(|k| format!("{k},300,200")).collect();
    fs::write(&few, format!("frame,x,y\n{}\n", rows.join("\n"))).unwrap();
    let refused = |more: &[&str], words_of: &str| {
        let run = fuse(&made, &out.join("run"), more);
        assert!(!run.status.success() && words(&run).contains(words_of), "{more:?}: {}", words(&run));
        assert!(!out.join("run/fuse.toml").exists() && !out.join("run/points.csv").exists());
    };
    refused(&["--calibrate", text(&few)], "10 at least are needed");
    refused(&["--calibrate", text(&labels), "--preset", "thesis"], "learns nothing");
    refused(&["--calibrate", text(&labels), "--room", "running"], "--room median");
    refused(&["--calibrate", text(&made.join("camera.json"))], "there is no column");
    let other = made.join("other.csv");
    fs::write(&other, "frame,point,x,y\n0,foot,1,2\n0,nose,1,2\n").unwrap();
    refused(&["--calibrate", text(&other)], "its points are foot, nose");
}

/// `without` of a configuration is that of the command line.
#[test]
fn a_configuration_switches_cues_off() {
    let (made, out) = (beginning("without", 8), folder("without-out"));
    let config = made.join("without.toml");
    fs::write(&config, "without = [\"depth\"]\n").unwrap();
    let run =
        |name: &str, more: &[&str]| document(&fuse(&made, &out.join(name), more))["estimates_digest"].clone();
    let by_file = run("file", &["--config", text(&config)]);
    assert_eq!(by_file, run("line", &["--without", "depth"]));
    assert_ne!(by_file, run("all", &[]));
    fs::write(&config, "without = [\"colour\"]\n").unwrap();
    let run = fuse(&made, &out.join("wrong"), &["--config", text(&config)]);
    assert!(!run.status.success() && words(&run).contains("there is no source `colour`"), "{}", words(&run));
}
