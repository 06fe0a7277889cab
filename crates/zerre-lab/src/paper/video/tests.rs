use super::*;
use std::fs;
use std::path::PathBuf;
use zerre_vision::Frame;
use zerre_vision::frames::folder::png;

/// A sequence of 12 frames in which a textured box moves by two pixels a frame, in a folder of the test's
/// own.
fn sequence(name: &str, test: &str) -> Sequence {
    let folder =
        std::env::temp_dir().join(format!("zerre-paper-video-{}-{test}", std::process::id())).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let mut truth = String::new();
    for k in 0..12 {
        let left = 10 + 2 * k;
        let frame = Frame::from_fn(80, 50, |x, y| {
            let is_object = (left..left + 24).contains(&x) && (14..34).contains(&y);
            let (u, v) = (x.wrapping_sub(left), y.wrapping_sub(14));
            if is_object {
                [(u * v % 97 + 120) as u8, 40, (9 * u % 61) as u8]
            } else {
                [20, (5 * x % 83 + 60) as u8, 90]
            }
        });
        fs::write(folder.join(format!("{k}.png")), png(&frame).unwrap()).unwrap();
        truth += &format!("{},15,24,20\n", left + 1);
    }
    fs::write(folder.join("groundtruth_rect.txt"), truth).unwrap();
    Sequence::open(&folder).unwrap().remove(0)
}

fn clean(sequence: &Sequence) {
    let folder: PathBuf = sequence.pictures.folder().to_owned();
    fs::remove_dir_all(folder.parent().unwrap()).unwrap();
}

fn experiment(tables: &[&'static str], sequences: Vec<Sequence>, seed: u64) -> VideoTrackers {
    let request = Request { tables: tables.iter().copied().collect(), runs: 2 };
    VideoTrackers::new(request, sequences, seed).unwrap()
}

fn all(experiment: &VideoTrackers) -> BTreeMap<Cell, Outcome> {
    let work = |cell: Cell| (cell, experiment.work(&cell, &|| false).unwrap().unwrap());
    experiment.cells().into_iter().map(work).collect()
}

#[test]
fn what_is_not_on_disk_is_said_and_nothing_else_is_computed() {
    let nothing = experiment(&["1", "2", "3", "others"], Vec::new(), 1);
    assert!(nothing.cells().is_empty());
    let rows = nothing.finish(&BTreeMap::new(), Some(&Timing::new())).unwrap().rows;
    // 8 frames of 5 trackers twice, and 5 sequences of 5 trackers.
    assert_eq!(rows.len(), 40 + 40 + 25);
    for row in rows {
        assert_eq!((row.value, row.runs), (Value::Missing(NOT_AVAILABLE), 0));
        assert!(row.paper_value.is_some() && row.metric == "rmse_px");
    }
    let rows = experiment(&["others"], Vec::new(), 1).finish(&BTreeMap::new(), None).unwrap().rows;
    assert!(rows.is_empty());
}

#[test]
fn every_tracker_runs_and_stands_beside_what_is_printed() {
    let girl = sequence("Girl", "beside");
    let of_paper = experiment(&["3"], vec![girl.clone()], 4);
    assert_eq!(of_paper.cells().len(), 2 * TRACKERS.len());
    let keys: BTreeSet<String> = of_paper.cells().iter().map(|cell| of_paper.key(cell)).collect();
    assert_eq!(keys.len(), of_paper.cells().len());
    let outcomes = all(&of_paper);
    let mut rounds = 0;
    let timing = of_paper.time(&|| false, &mut || rounds += 1).unwrap().unwrap();
    assert_eq!((rounds, timing.len()), (of_paper.rounds(), TRACKERS.len()));
    let finished = of_paper.finish(&outcomes, Some(&timing)).unwrap();
    let find = |tracker: &str, metric: &str, statistic: &str| {
        let is = |row: &&Row| {
            row.sequence == "Girl"
                && row.tracker == tracker
                && (row.metric, row.statistic) == (metric, statistic)
        };
        finished.rows.iter().find(is).unwrap_or_else(|| panic!("{tracker} {metric} {statistic}"))
    };
    for kind in TRACKERS {
        for metric in ["rmse_px", "precision20", "success_auc", "iou", "lost_share", "fps"] {
            let row = find(kind.name, metric, "mean");
            let [value, low, high] = row.numbers().unwrap();
            assert!(value >= 0.0 && low <= value && value <= high, "{row:?}");
            let is_printed = of_paper.printed.trackers().contains(&kind.name) && metric == "rmse_px";
            assert_eq!(row.paper_value.is_some(), is_printed, "{row:?}");
        }
    }
    // The box that stays is 2 k px off in frame k: a mean square of 4 (0 + 1 + ... + 121) / 12.
    let still = find("still", "rmse_px", "mean").numbers().unwrap();
    assert!((still[0] - (4.0 * 506.0 / 12.0_f64).sqrt()).abs() < 1e-9, "{still:?}");
    // An object that moves by a twelfth of its width is followed to a quarter of its height.
    assert!(find("massimahe", "rmse_px", "mean").numbers().unwrap()[0] < 5.0);
    let table = finished.tables.iter().find(|table| table.name == "table-3").unwrap();
    assert!(table.csv().contains("Walking,rt,,rmse_px,mean,not available"));
    // As one of the others nothing is printed of it, and it is not computed.
    assert!(experiment(&["others"], vec![girl.clone()], 4).cells().is_empty());
    clean(&girl);
}

/// Of the paper's trackers: others may find the same box whatever their luck.
#[test]
fn another_seed_moves_every_cell_of_the_paper() {
    let own = sequence("Own", "seeds");
    let rows = |seed| {
        let experiment = experiment(&["others"], vec![own.clone()], seed);
        let outcomes = all(&experiment);
        experiment.finish(&outcomes, None).unwrap().rows
    };
    let (one, again, other) = (rows(1), rows(1), rows(2));
    assert_eq!(one, again);
    let printed = Printed::read().unwrap();
    let is_printed =
        |row: &Row| printed.trackers().contains(&row.tracker.as_str()) && row.metric == "rmse_px";
    let pairs: Vec<_> = one.iter().zip(&other).filter(|(a, _)| is_printed(a)).collect();
    assert!(pairs.len() >= printed.trackers().len());
    for (a, b) in pairs {
        assert_ne!(a.value, b.value, "{a:?}");
        assert_eq!((a.paper_value, a.frame), (None, None));
    }
    clean(&own);
}

#[test]
fn a_run_that_cannot_begin_is_counted() {
    let mut bad = sequence("Own", "bad");
    bad.truth[0] = Some(Rect { x: 500.0, y: 0.0, width: 9.0, height: 9.0 });
    let experiment = experiment(&["others"], vec![bad.clone()], 1);
    let outcomes = all(&experiment);
    let finished = experiment.finish(&outcomes, None).unwrap();
    assert!(finished.rows.is_empty());
    assert_eq!(finished.mishaps[1].count, outcomes.len());
    clean(&bad);
}
