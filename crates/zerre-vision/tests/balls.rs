//! Balls: how exactly they are found, and whether each stays itself.

use std::collections::BTreeMap;
use zerre::rng::Stream;
use zerre_vision::Frame;
use zerre_vision::balls::{
    BallMotion, BallRow, Detector, DetectorSettings, SCENES, Scene, Tracker, TrackerSettings,
};

fn scene(name: &str, seed: u64) -> Scene {
    let named = SCENES.iter().find(|named| named.name == name).unwrap();
    Scene::new((named.settings)(), seed)
}

fn detector(scene: &Scene) -> Detector {
    let samples: Vec<_> = (0..scene.len()).step_by(20).map(|k| scene.frame(k)).collect();
    Detector::new(&DetectorSettings::default(), &samples).unwrap()
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn followed(scene: &Scene, motion: BallMotion) -> Vec<BallRow> {
    let detector = detector(scene);
    let mut tracker = Tracker::new(TrackerSettings::of(motion), Stream::new(1)).unwrap();
    for k in 0..scene.len() {
        tracker.step(k, &scene.frame(k), &detector).unwrap();
    }
    tracker.finish().0
}

/// How often the track nearest to a true ball (within its radius) is another one than before, and the share of the
/// frames in which at least `seen` of a ball is visible that have such a track.
fn swaps_and_held(scene: &Scene, rows: &[BallRow], seen: f64) -> (usize, f64) {
    let mut last: BTreeMap<usize, usize> = BTreeMap::new();
    let (mut swaps, mut held, mut visible) = (0, 0, 0);
    for k in 0..scene.len() {
        for ball in scene.truth(k).iter().filter(|ball| ball.visible >= seen) {
            visible += 1;
            let far = |row: &&BallRow| distance(row.known.centre, ball.centre);
            let of_frame = rows.iter().filter(|row| row.frame == k);
            let nearest = of_frame.min_by(|a, b| far(a).total_cmp(&far(b)));
            let Some(row) = nearest.filter(|row| far(row) < ball.radius) else { continue };
            held += 1;
            let before = last.insert(ball.ball, row.ball);
            swaps += usize::from(before.is_some_and(|before| before != row.ball));
        }
    }
    (swaps, held as f64 / visible as f64)
}

#[test]
fn scratch() {
    for name in ["balls-free", "balls-touch", "balls-cross", "balls-cross-grey", "balls-enter", "balls-shade"] {
        for seed in 1..=6 {
            let scene = scene(name, seed);
            let t = std::time::Instant::now();
            let rows = followed(&scene, BallMotion::default());
            let (swaps, held) = swaps_and_held(&scene, &rows, 0.6);
            let n = rows.iter().map(|r| r.ball).max().unwrap_or(0);
            let truth: std::collections::BTreeSet<_> = (0..200).flat_map(|k| scene.truth(k).to_vec()).map(|b| b.ball).collect();
            println!("{name} {seed}: swaps {swaps} held {held:.4} tracks {n} of {} {:?}", truth.len(), t.elapsed());
        }
    }
    let data = std::path::PathBuf::from(std::env::var("ZERRE_DATA").unwrap());
    let dir = data.join("rolling_balls/img");
    let frames: Vec<Frame> = zerre_vision::frames::Frames::open(dir.to_str().unwrap()).unwrap().map(|s| s.frame.unwrap()).collect();
    let samples: Vec<_> = frames.iter().step_by(15).cloned().collect();
    let det = Detector::new(&DetectorSettings::default(), &samples).unwrap();
    println!("level {} areas {:?}", det.level(), det.areas());
    let mut tracker = Tracker::new(TrackerSettings::default(), Stream::new(1)).unwrap();
    for (k, f) in frames.iter().enumerate() {
        tracker.step(k, f, &det).unwrap();
    }
    let (rows, counted) = tracker.finish();
    println!("{counted:?}");
    let mut by: BTreeMap<usize, Vec<&BallRow>> = BTreeMap::new();
    rows.iter().for_each(|r| by.entry(r.ball).or_default().push(r));
    for (b, rows) in &by {
        let miss: Vec<_> = rows.iter().filter(|r| r.detected.is_none()).map(|r| r.frame).collect();
        let (f, l) = (rows[0], rows[rows.len()-1]);
        println!("ball {b}: {}..{} ({:.0},{:.0}) to ({:.0},{:.0}) missed {miss:?}", f.frame, l.frame, f.known.centre[0], f.known.centre[1], l.known.centre[0], l.known.centre[1]);
    }
    for k in 0..26 {
        let s: Vec<String> = rows.iter().filter(|r| r.frame == k).map(|r| format!("{}:({:.0},{:.0}{})", r.ball, r.known.centre[0], r.known.centre[1], if r.detected.is_some() {""} else {"?"})).collect();
        println!("{k}: {}", s.join(" "));
    }
}
