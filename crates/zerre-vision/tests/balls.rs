//! Balls: how exactly they are found, and whether each stays itself.

use std::collections::{BTreeMap, BTreeSet};
use zerre::filter::Settings;
use zerre::kernels::Simd;
use zerre::resample::Resampling;
use zerre::rng::Stream;
use zerre_vision::Frame;
use zerre_vision::balls::thesis::{ByArea, READINGS};
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

/// Of a disc of radius r about 2 pi r pixels lie on the rim, each set or not by rounding its covered share, whose error
/// has the variance 1/12. The centroid's standard deviation on an axis is then sqrt(pi r / 12) / (pi r): in both axes 0.06 px
/// for the smallest radius, 16, and less for the others. Noise of the camera is far below the contrast.
#[test]
fn centroids_are_exact_to_a_twentieth_of_a_pixel() {
    for seed in 1..=3 {
        let scene = scene("balls-free", seed);
        let detector = detector(&scene);
        let (mut sum, mut count) = (0.0, 0.0);
        for k in (0..scene.len()).step_by(7) {
            let seen = detector.see(&scene.frame(k)).unwrap();
            assert_eq!(seen.blobs.len(), 3, "seed {seed}, frame {k}");
            for ball in scene.truth(k) {
                let off = seen.blobs.iter().map(|blob| distance(blob.centroid, ball.centre));
                sum += off.fold(f64::INFINITY, f64::min).powi(2);
                count += 1.0;
            }
        }
        let rmse = (sum / count).sqrt();
        assert!(rmse < 0.06, "seed {seed}: {rmse} px");
    }
}

/// Balls that touch and bounce, and one scene in uneven light: every ball of which most is seen is held in every
/// frame, none changes its identity, and there are no others.
#[test]
fn balls_that_touch_keep_their_identities() {
    for name in ["balls-touch", "balls-shade"] {
        for seed in 1..=4 {
            let scene = scene(name, seed);
            let rows = followed(&scene, BallMotion::default());
            assert_eq!(swaps_and_held(&scene, &rows, 0.6), (0, 1.0), "{name}, seed {seed}");
            assert_eq!(rows.iter().map(|row| row.ball).max(), Some(3), "{name}, seed {seed}");
        }
    }
}

/// Balls that enter, pass over each other and leave: four in five of them at least have one track to the end, and of
/// what is seen nearly all is held.
#[test]
fn balls_that_come_and_go_are_held() {
    for seed in 2..=4 {
        let scene = scene("balls-enter", seed);
        let (swaps, held) = swaps_and_held(&scene, &followed(&scene, BallMotion::default()), 0.6);
        let balls: BTreeSet<usize> =
            (0..scene.len()).flat_map(|k| scene.truth(k).iter().map(|ball| ball.ball)).collect();
        assert!(5 * swaps <= balls.len() && held > 0.98, "seed {seed}: {swaps} swaps, {held} held");
    }
}

/// Random walks have no velocity, and lose nobody where balls do not meet.
#[test]
fn random_walks_follow_balls_that_stay_apart() {
    let scene = scene("balls-free", 5);
    let rows = followed(&scene, BallMotion::RandomWalk);
    assert_eq!(swaps_and_held(&scene, &rows, 0.6), (0, 1.0));
    assert!(rows.iter().all(|row| row.known.velocity == [0.0; 2]));
}

/// The same seed gives the same bits at every SIMD level, another seed other ones.
#[test]
fn a_seed_gives_the_same_bits_at_every_level() {
    let scene = scene("balls-touch", 1);
    let detector = detector(&scene);
    let seen: Vec<_> = (0..40).map(|k| detector.see(&scene.frame(k)).unwrap()).collect();
    let rows = |simd: Simd, seed: u64| {
        let filter = Settings { simd, ..TrackerSettings::default().filter };
        let settings = TrackerSettings { filter, ..TrackerSettings::default() };
        let mut tracker = Tracker::new(settings, Stream::new(seed)).unwrap();
        seen.iter().enumerate().for_each(|(k, seen)| tracker.take(k, seen, &detector).unwrap());
        tracker.finish().0
    };
    let centres = |rows: &[BallRow]| rows.iter().map(|row| row.known.centre).collect::<Vec<_>>();
    let best = rows(Simd::best(), 1);
    for simd in Simd::available() {
        assert_eq!(centres(&rows(simd, 1)), centres(&best), "{}", simd.name());
    }
    assert_ne!(centres(&rows(Simd::best(), 2)), centres(&best));
}

#[test]
fn no_balls_are_no_tracks_and_bad_settings_are_refused() {
    let empty = Frame::filled(64, 48, [200; 3]);
    let samples = [empty.clone()];
    let detector = Detector::new(&DetectorSettings::default(), &samples).unwrap();
    let mut tracker = Tracker::new(TrackerSettings::default(), Stream::new(1)).unwrap();
    (0..5).for_each(|k| tracker.step(k, &empty, &detector).unwrap());
    // A frame of another size is refused, and the next one goes on.
    assert!(tracker.step(5, &Frame::filled(64, 40, [200; 3]), &detector).is_err());
    tracker.step(6, &empty, &detector).unwrap();
    assert!(tracker.finish().0.is_empty());
    for settings in [
        TrackerSettings { process_sd: f64::NAN, ..TrackerSettings::default() },
        TrackerSettings { measurement_sd: 0.0, ..TrackerSettings::default() },
        TrackerSettings { measurement_sd: f64::INFINITY, ..TrackerSettings::default() },
        TrackerSettings { count: Some(0), ..TrackerSettings::default() },
        TrackerSettings { confirm: 0, ..TrackerSettings::default() },
        TrackerSettings {
            filter: Settings { particles: 0, ..Settings::default() },
            ..TrackerSettings::default()
        },
    ] {
        assert!(Tracker::new(settings, Stream::new(1)).is_err());
    }
    let nothing = DetectorSettings { least_area: Some(9), most_area: Some(8), ..DetectorSettings::default() };
    assert!(Detector::new(&nothing, &samples).is_err() && Detector::new(&nothing, &[]).is_err());
}

/// Sorting areas names the balls of one clip alike in all frames where they stay apart; a ball too many is counted.
#[test]
fn areas_name_balls_that_stay_apart() {
    let scene = scene("balls-free", 1);
    let detector = detector(&scene);
    let particles = (200, Resampling::Multinomial);
    let new = |count| ByArea::new(&READINGS[0], count, scene.settings().size, particles, Stream::new(1));
    let (mut three, mut four) = (new(3).unwrap(), new(4).unwrap());
    for k in 0..60 {
        let seen = detector.see(&scene.frame(k)).unwrap();
        three.take(k, &seen).unwrap();
        four.take(k, &seen).unwrap();
    }
    let (rows, missing) = three.finish();
    assert_eq!((rows.len(), missing, four.finish().1), (180, 0, 60));
    for row in rows {
        let ball = &scene.truth(row.frame)[row.ball - 1];
        assert!(distance(row.detected.unwrap(), ball.centre) < 1.0, "{row:?}");
    }
    assert!(new(0).is_err());
    assert!(ByArea::new(&READINGS[0], 3, (64, 48), (0, Resampling::Multinomial), Stream::new(1)).is_err());
}

/// The clip of rolling steel balls, where it lies beside the repository or where `ZERRE_DATA` says.
fn rolling() -> Option<Vec<Frame>> {
    let beside = || std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let data = std::env::var_os("ZERRE_DATA").map_or_else(beside, std::path::PathBuf::from);
    let folder = data.join("rolling_balls/img");
    if !folder.is_dir() {
        eprintln!("skipped: no clip at {} (set ZERRE_DATA)", folder.display());
        return None;
    }
    let frames = zerre_vision::frames::Frames::open(folder.to_str().unwrap()).unwrap();
    Some(frames.map(|shot| shot.frame.unwrap()).collect())
}

/// Balls of which about half or more is seen were counted by eye on contact sheets of frames with these tracks
/// drawn on them (every frame from 0 to 136); in the rest at most one ball is in view. The tracks are these balls,
/// each with one identity, and no shadow has one. Two balls of which less than half grazes the corner in frames 10
/// to 16 are seen too briefly to be believed.
#[test]
fn rolling_balls_are_held_while_they_are_seen() {
    let Some(frames) = rolling() else { return };
    let samples: Vec<Frame> = frames.iter().step_by(16).cloned().collect();
    let detector = Detector::new(&DetectorSettings::default(), &samples).unwrap();
    let mut tracker = Tracker::new(TrackerSettings::default(), Stream::new(1)).unwrap();
    for (k, frame) in frames.iter().enumerate() {
        tracker.step(k, frame, &detector).unwrap();
    }
    let rows = tracker.finish().0;
    let at = |k: usize| rows.iter().filter(move |row| row.frame == k);
    let counted = [
        (0, 0),
        (3, 0),
        (5, 2),
        (7, 2),
        (9, 4),
        (10, 4),
        (11, 3),
        (12, 3),
        (13, 3),
        (14, 3),
        (15, 3),
        (16, 3),
        (17, 3),
        (19, 2),
        (23, 3),
        (27, 2),
        (33, 1),
        (40, 0),
        (45, 0),
        (53, 3),
        (57, 4),
        (62, 3),
        (65, 3),
        (75, 3),
        (85, 4),
        (95, 4),
        (103, 4),
        (109, 3),
        (118, 2),
        (124, 2),
        (130, 1),
        (136, 0),
        (143, 1),
        (160, 1),
        (190, 1),
        (200, 1),
        (210, 0),
        (228, 0),
    ];
    for (k, count) in counted {
        assert_eq!(at(k).count(), count, "frame {k}");
    }
    assert!(rows.iter().all(|row| row.detected.is_some()));
    // Places read off the pictures: a pair that rolls in contact, one that meets and parts, two that enter with dark
    // shadows between them, and two after these.
    let ways = [
        [(60, [57.0, 375.0]), (80, [164.0, 182.0]), (98, [230.0, 50.0])],
        [(62, [42.0, 408.0]), (80, [129.0, 243.0]), (104, [202.0, 51.0])],
        [(90, [415.0, 73.0]), (100, [427.0, 183.0]), (119, [432.0, 403.0])],
        [(95, [459.0, 52.0]), (110, [466.0, 215.0]), (127, [451.0, 413.0])],
        [(5, [11.0, 398.0]), (11, [95.0, 197.0]), (15, [154.0, 68.0])],
        [(10, [25.0, 180.0]), (12, [63.0, 115.0]), (14, [99.0, 50.0])],
        [(18, [46.0, 204.0]), (20, [74.0, 147.0]), (23, [116.0, 64.0])],
        [(21, [348.0, 361.0]), (26, [436.0, 251.0]), (35, [590.0, 59.0])],
    ];
    let mut identities = BTreeSet::new();
    for way in ways {
        let balls: BTreeSet<usize> = way
            .iter()
            .flat_map(|(k, place)| at(*k).filter(|row| distance(row.known.centre, *place) < 12.0))
            .map(|row| row.ball)
            .collect();
        assert_eq!(balls.len(), 1, "{way:?}: {balls:?}");
        identities.extend(balls);
    }
    assert_eq!(identities.len(), ways.len());
}
