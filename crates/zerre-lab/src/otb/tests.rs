use super::summary::lines;
use super::*;
use std::fs;
use std::path::PathBuf;
use zerre_vision::Frame;
use zerre_vision::frames::folder::png;
use zerre_vision::tracker::find;

/// A sequence of 30 grey frames whose annotation moves by one pixel a frame, in a folder of the test's own.
fn sequence(name: &str) -> Sequence {
    let folder = std::env::temp_dir().join(format!("zerre-otb-{}-{name}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let picture = png(&Frame::filled(100, 40, [80; 3])).unwrap();
    let mut truth = String::new();
    for k in 0..30 {
        fs::write(folder.join(format!("{k}.png")), &picture).unwrap();
        truth += &format!("{},10,20,10\n", 10 + k);
    }
    fs::write(folder.join("groundtruth.txt"), truth).unwrap();
    Sequence::open(&folder).unwrap().remove(0)
}

fn otb(name: &str) -> Otb {
    Otb {
        sequences: vec![sequence(name)],
        trackers: vec![find("still").unwrap()],
        others: Vec::new(),
        protocols: Protocol::ALL.to_vec(),
        repeats: 2,
        seed: 1,
    }
}

fn all(otb: &Otb) -> BTreeMap<Cell, Outcome> {
    otb.cells().into_iter().map(|cell| (cell, otb.work(&cell, &|| false).unwrap().unwrap())).collect()
}

fn clean(otb: &Otb) {
    let folder: PathBuf = otb.sequences[0].pictures.folder().to_owned();
    fs::remove_dir_all(folder).unwrap();
}

/// A box that stays while the object moves k px in frame k: 21 of 30 frames are within 20 px, the mean square
/// is that of 0 to 29, and the overlap (20 - k) / (20 + k).
#[test]
fn a_still_box_scores_what_geometry_says() {
    let otb = otb("still");
    let outcomes = all(&otb);
    let finished = otb.finish(&outcomes, None).unwrap();
    let row = &finished.rows[0];
    assert_eq!((row.protocol, row.repeat, row.frames), (Protocol::OnePass, 1, 30));
    assert_eq!(row.precision20, 21.0 / 30.0);
    let mean_square = (0..30).map(|k| f64::from(k * k)).sum::<f64>() / 30.0;
    assert!((row.rmse_px.unwrap() - mean_square.sqrt()).abs() < 1e-12);
    let overlap = |k: i32| f64::from((20 - k).max(0)) / f64::from(20 + k);
    let iou = (0..30).map(overlap).sum::<f64>() / 30.0;
    assert!((row.iou - iou).abs() < 1e-12);
    // The overlap is at most 0.1 from 17 px on: for 13 frames.
    assert_eq!(row.lost_share, 1.0);
    // Starts 0 to 10 leave at least 20 frames: 11 frames that 19 steps repeat, which are 11 starts.
    let temporal = finished.rows.iter().find(|row| row.protocol == Protocol::Temporal).unwrap();
    assert_eq!((temporal.frames, temporal.scores.runs), ((20..=30).sum(), 11));
    let spatial = finished.rows.iter().find(|row| row.protocol == Protocol::Spatial).unwrap();
    assert_eq!((spatial.frames, spatial.scores.runs), (12 * 30, 12));
    assert_eq!(finished.files.len(), 1, "boxes of the first repetition");
    let boxes = String::from_utf8(finished.files[0].1.clone()).unwrap();
    assert_eq!(boxes.lines().count(), 31);
    assert!(boxes.starts_with("frame,x,y,w,h,p_lost,var_x,var_y\n0,10,10,20,10,0,0,0\n1,10,10,20,10,0.5,"));
    let summary = lines(&finished.rows);
    assert_eq!((summary[0].sequence.as_deref(), summary[0].repeats), (None, 2));
    assert_eq!(summary[0].success_auc, summary[1].success_auc);
    clean(&otb);
}

#[test]
fn what_is_not_done_has_no_row() {
    let otb = otb("part");
    let mut outcomes = all(&otb);
    let part = *outcomes.keys().find(|cell| cell.protocol == Protocol::Temporal).unwrap();
    outcomes.remove(&part);
    let rows = otb.finish(&outcomes, None).unwrap().rows;
    let repeats = |protocol| -> Vec<usize> {
        rows.iter().filter(|row| row.protocol == protocol).map(|row| row.repeat).collect()
    };
    assert_eq!(repeats(Protocol::Temporal), [2]);
    assert_eq!(repeats(Protocol::OnePass), [1, 2]);
    let stopped = otb.work(&part, &|| true).unwrap();
    assert_eq!(stopped, None);
    clean(&otb);
}

#[test]
fn boxes_of_others_are_scored_beside() {
    let mut otb = otb("others");
    otb.protocols = vec![Protocol::OnePass];
    let exact = otb.sequences[0].truth.clone();
    let half = exact[..15].to_vec();
    let answers = |name: &str, boxes| Answers { tracker: name.to_owned(), boxes: vec![boxes] };
    otb.others = vec![answers("exact", Some(exact)), answers("half", Some(half)), answers("none", None)];
    let rows = otb.finish(&BTreeMap::new(), None).unwrap().rows;
    let found: Vec<_> = rows.iter().map(|row| (row.tracker.as_str(), row.precision20, row.rmse_px)).collect();
    assert_eq!(found, [("exact", 1.0, Some(0.0)), ("half", 0.5, Some(0.0))]);
    clean(&otb);
}

#[test]
fn frames_and_starts_that_fail_are_counted() {
    let mut otb = otb("bad");
    let folder = otb.sequences[0].pictures.folder().to_owned();
    fs::write(folder.join("7.png"), "no picture").unwrap();
    otb.repeats = 1;
    let outcomes = all(&otb);
    let finished = otb.finish(&outcomes, None).unwrap();
    let count = |what: &str| finished.mishaps.iter().find(|mishap| mishap.what == what).unwrap().count;
    assert_eq!(finished.rows[0].frames, 30);
    // One start of the temporal evaluation is the bad frame itself.
    assert_eq!(count("run that could not begin"), 1);
    // In one pass, in seven temporal runs that begin before it, and in twelve spatial ones.
    assert_eq!(count("frame that could not be read"), 1 + 7 + 12);
    assert!(finished.page.sections.last().unwrap().points.iter().any(|point| point.contains("7.png")));
    clean(&otb);
}
