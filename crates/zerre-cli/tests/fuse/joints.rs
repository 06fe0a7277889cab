//! Several joints, from several sources, each with a rate of its own.

use super::{beginning, document, drawn, folder, fuse, record, text, words};
use std::fs;
use std::path::Path;

/// Cells of the drawn truth by the names of their columns, row by row.
fn truth(columns: &[&str]) -> Vec<Vec<f64>> {
    let table = fs::read_to_string(drawn().join("truth.csv")).unwrap();
    let mut lines = table.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let at = |name: &&str| head.iter().position(|column| column == name).unwrap();
    let at: Vec<usize> = columns.iter().map(at).collect();
    lines
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            at.iter().map(|k| cells[*k].parse().unwrap()).collect()
        })
        .collect()
}

/// What looks like noise and is the same each time, within 4 px.
fn noise(k: usize) -> f64 {
    (k * 7919 % 97) as f64 / 97.0 * 8.0 - 4.0
}

const FRAMES: usize = 45;

/// The device's rows of the right hand in every frame, an estimator's in every third, 10 ms late, and its
/// rows of the left hand in some.
fn rows() -> Vec<String> {
    let table = fs::read_to_string(drawn().join("joints.csv")).unwrap();
    let time =
        |line: &&str| line.split(',').next().unwrap().parse::<f64>().unwrap() < FRAMES as f64 / 30.0 - 0.01;
    let device = table.lines().skip(1).filter(time).map(|line| format!("{line},device"));
    let mut rows: Vec<String> = device.collect();
    for (k, place) in
        truth(&["time_s", "x", "y", "left_hand_x", "left_hand_y"]).iter().take(FRAMES - 1).enumerate()
    {
        let [t, x, y, left, down] = place[..] else { panic!() };
        let (dx, dy) = (noise(k), noise(k + 31));
        if k % 3 == 0 {
            rows.push(format!("{:.3},hand_right,{},{},,0.8,pose", t + 0.01, x + dx, y + dy));
        }
        if [0, 1, 4].contains(&(k * k % 7)) {
            rows.push(format!("{:.3},hand_left,{},{},,0.9,pose", t + 0.004, left + dx, down + dy));
        }
    }
    rows
}

const HEAD: &str = "time_s,joint,x,y,z,confidence,source\n";

fn marks(path: &Path) {
    let mut table = "frame,point,x,y\n".to_owned();
    for (k, place) in truth(&["x", "y", "left_hand_x", "left_hand_y"]).iter().enumerate() {
        table +=
            &format!("{k},hand_right,{},{}\n{k},hand_left,{},{}\n", place[0], place[1], place[2], place[3]);
    }
    fs::write(path, table).unwrap();
}

/// Both hands are followed, whatever the order of the rows, and what is bad among them is counted, each by
/// its kind.
#[test]
fn joints_of_sources_with_other_rates_are_followed() {
    let (made, out) = (beginning("rates", FRAMES), folder("rates-out"));
    let good = rows();
    marks(&made.join("marks.csv"));
    let run = |name: &str, rows: &[String], more: &[&str]| {
        let file = made.join(format!("{name}.csv"));
        fs::write(&file, HEAD.to_owned() + &rows.join("\n")).unwrap();
        let marks = made.join("marks.csv");
        let mut args = vec!["--joints", text(&file), "--truth", text(&marks)];
        args.extend_from_slice(more);
        let run = fuse(&made, &out.join(name), &args);
        (document(&run), words(&run))
    };
    let (found, said) = run("good", &good, &[]);
    assert_eq!(found["joints"], serde_json::json!(["hand_left", "hand_right"]), "{said}");
    for (score, joint) in found["scores"].as_array().unwrap().iter().zip(["hand_left", "hand_right"]) {
        let (rmse, frames) = (score["rmse_px"].as_f64().unwrap(), score["frames"].as_u64().unwrap());
        // The estimator is up to 4 px off in either direction: so much, and some of the hand's own movement.
        assert!(score["joint"] == joint && rmse < 9.0 && frames > 40, "{score}");
    }
    let points = fs::read_to_string(out.join("good/points.csv")).unwrap();
    assert!(
        points.starts_with("frame,name,time_s,joint,x,y,") && points.contains("trust_device,trust_pose,"),
        "{points}"
    );
    for joint in ["hand_left", "hand_right"] {
        assert!(points.matches(joint).count() > 40, "{joint}");
    }

    let mut bad = good.clone();
    bad.reverse();
    bad.extend(
        [
            "-7,hand_left,1,1,,1,pose",
            "1000,hand_left,1,1,,1,pose",
            "0.2,hand_left,NaN,1,,1,pose",
            "0.2,hand_left,,,,,pose",
            "0.2,nose,1,1,,1,pose",
            "0.2,,1,1,,1,pose",
            "soon,hand_left,1,1,,1,pose",
        ]
        .map(str::to_owned),
    );
    let (same, said) = run("bad", &bad, &["--joint", "hand_left", "--joint", "hand_right"]);
    assert_eq!(same["estimates_digest"], found["estimates_digest"], "{said}");
    let record = record(&out.join("bad"));
    let counts = &record["counts"];
    assert_eq!(
        (&counts["rejected"]["row of joints"], &counts["missing"]),
        (&3.into(), &1.into()),
        "{record}"
    );
    for (kind, count) in [
        ("row of joints before the first frame", 1),
        ("row of joints behind the last frame", 1),
        ("row of joints of a joint that is not followed", 1),
    ] {
        assert_eq!(counts["left_out"][kind], count, "{record}");
    }
    for words in [
        "column x has `NaN`",
        "column joint is empty",
        "column time_s has `soon`",
        "1 rows of joints are of times",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
}

/// Frames by their names or their places; those that do not occur are counted, and a joint that nobody shows
/// is told.
#[test]
fn rows_may_name_frames() {
    let (made, out) = (beginning("named", 6), folder("named-out"));
    let rows =
        "frame,joint,x,y\n0001.png,a,300,200\n2,a,301,200\n3,a,302,200\n99,a,1,1\nnone.png,a,1,1\n88,b,1,1\n";
    fs::write(made.join("joints.csv"), rows).unwrap();
    let run = fuse(&made, &out.join("run"), &[]);
    assert_eq!(document(&run)["joints"], serde_json::json!(["a", "b"]));
    assert!(words(&run).contains("no frame says where b is"), "{}", words(&run));
    let record = record(&out.join("run"));
    assert_eq!(record["counts"]["left_out"]["row of joints of another frame"], 3, "{record}");
}

/// A joint that is first reported off the frame is followed from where it is on it, and disturbs nobody.
#[test]
fn joints_may_begin_off_the_frame() {
    let (made, out) = (beginning("off", 6), folder("off-out"));
    let rows = "frame,joint,x,y\n0,a,300,200\n0,b,-20,200\n1,a,300,200\n1,b,-9,200\n2,b,4,200\n3,b,5,200\n4,b,9,200\n";
    fs::write(made.join("joints.csv"), rows).unwrap();
    let found = document(&fuse(&made, &out.join("run"), &[]));
    assert_eq!(found["left_out"], 0, "{found}");
    let points = fs::read_to_string(out.join("run/points.csv")).unwrap();
    let of = |joint: &str| points.lines().filter(|line| line.split(',').nth(3) == Some(joint)).count();
    assert_eq!((of("a"), of("b")), (6, 4), "{points}");
}
