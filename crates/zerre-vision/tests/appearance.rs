//! Trackers by appearance on clips that a formula draws, whose boxes are known exactly.

use zerre::kernels::Threads;
use zerre::resample::{Resampling, Trigger};
use zerre::rng::Stream;
use zerre_vision::tracker::{
    AppearanceSettings, AppearanceTracker, CentreWeight, Deviation, Equalisation, Estimate, FlowUse,
    Similarity, TemplateUpdate, Tracker,
};
use zerre_vision::{Error, Frame, Image, Rect};

const FRAMES: usize = 40;
const SIZE: (usize, usize) = (160, 120);

/// Where the object is.
fn truth(k: usize) -> Rect {
    let t = k as f64;
    Rect { x: 30.0 + 1.8 * t, y: 40.0 + 12.0 * (t / 9.0).sin(), width: 32.0, height: 26.0 }
}

/// A pattern of waves, from 0 to 1.
fn texture(x: f64, y: f64, [a, b, c]: [f64; 3]) -> f64 {
    let waves = (a * x + 1.3 * b * y).sin() + (b * x - a * y + 2.0).sin() + (c * x + c * y).cos();
    0.5 + waves / 6.0
}

/// A reddish pattern that moves over a bluish one.
fn frame(k: usize) -> Frame {
    let bounds = truth(k);
    Image::from_fn(SIZE.0, SIZE.1, |i, j| {
        let (x, y) = (i as f64 + 0.5, j as f64 + 0.5);
        let (u, v) = (x - bounds.x, y - bounds.y);
        let is_object = (0.0..bounds.width).contains(&u) && (0.0..bounds.height).contains(&v);
        let level = |low: f64, high: f64, t: f64| (low + (high - low) * t) as u8;
        if is_object {
            let t = texture(u, v, [0.45, 0.31, 0.22]);
            [level(90.0, 250.0, t), level(40.0, 170.0, t), 60]
        } else {
            let t = texture(x, y, [0.21, 0.37, 0.11]);
            [50, level(30.0, 190.0, t), level(70.0, 240.0, t)]
        }
    })
}

fn presets() -> [(&'static str, AppearanceSettings); 5] {
    [
        ("rt", AppearanceSettings::rt()),
        ("frt", AppearanceSettings::frt()),
        ("ssim", AppearanceSettings::ssim()),
        ("ssimfahe", AppearanceSettings::ssimfahe()),
        ("massimahe", AppearanceSettings::massimahe()),
    ]
}

fn start(settings: &AppearanceSettings, seed: u64) -> AppearanceTracker {
    AppearanceTracker::start(&frame(0), truth(0), settings, (Stream::new(seed), Threads::Serial)).unwrap()
}

fn followed(settings: &AppearanceSettings, seed: u64, frames: usize) -> Vec<Estimate> {
    let mut tracker = start(settings, seed);
    (1..frames).map(|k| tracker.step(&frame(k)).unwrap()).collect()
}

/// With almost all weight on one particle a run may follow a wrong velocity away: the largest error of the
/// middle one of five runs is held to be below half the shorter side by colours, which hardly say where the
/// middle is, and below a quarter of it by structure.
#[test]
fn every_preset_follows_the_object() {
    for (name, settings) in presets() {
        let bound = if name.ends_with("rt") { 13.0 } else { 6.5 };
        let mut worst: Vec<f64> = (0..5)
            .map(|seed| {
                let answers = followed(&settings, seed, FRAMES);
                let errors = answers.iter().zip(1..).map(|(estimate, k)| {
                    let error = estimate.bounds.distance(&truth(k));
                    assert_eq!((estimate.bounds.width, estimate.bounds.height), (32.0, 26.0));
                    assert!(
                        error > bound || estimate.p_lost < 0.5,
                        "{name}, frame {k}: {error} {estimate:?}"
                    );
                    error
                });
                errors.fold(0.0, f64::max)
            })
            .collect();
        worst.sort_by(f64::total_cmp);
        assert!(worst[2] < bound, "{name}: {worst:?}");
    }
}

#[test]
fn the_cloud_is_what_the_estimate_says() {
    let mut tracker = start(&AppearanceSettings::massimahe(), 3);
    assert!(tracker.particles().is_empty());
    let estimate = (1..10).map(|k| tracker.step(&frame(k)).unwrap()).last().unwrap();
    let particles = tracker.particles();
    assert_eq!(particles.len(), 70);
    let mean = |value: &dyn Fn([f64; 2]) -> f64| -> f64 {
        particles.iter().map(|p| p.weight * value(p.centre)).sum()
    };
    assert!((mean(&|_| 1.0) - 1.0).abs() < 1e-12);
    let [x, y] = estimate.bounds.centre();
    assert!((mean(&|c| c[0]) - x).abs() < 1e-9 && (mean(&|c| c[1]) - y).abs() < 1e-9);
    let covariance = mean(&|c| (c[0] - x) * (c[1] - y));
    assert!((covariance - estimate.covariance[0][1]).abs() < 1e-9);
    assert_eq!(estimate.covariance[0][1], estimate.covariance[1][0]);
}

/// Nothing of the object's colours is left in a black frame: D is 1 for every particle, exp(-D^2 / 2 sigma^2)
/// is 0 in double precision, and the particles keep equal weights all the same.
#[test]
fn no_resemblance_anywhere_leaves_weights() {
    let mut tracker = start(&AppearanceSettings::rt(), 1);
    tracker.step(&frame(1)).unwrap();
    let estimate = tracker.step(&Image::filled(SIZE.0, SIZE.1, [0; 3])).unwrap();
    assert_eq!(estimate.score, 0.0);
    assert_eq!(estimate.p_lost, 1.0);
    assert!(estimate.covariance[0][0] > 1.0);
    for particle in tracker.particles() {
        assert!((particle.weight - 1.0 / 70.0).abs() < 1e-12, "{particle:?}");
    }
}

#[test]
fn one_seed_gives_one_answer_for_any_threads() {
    for (name, settings) in presets() {
        // Enough particles for blocks that threads share.
        let settings = AppearanceSettings { particles: 5000, ..settings };
        let answers = |threads, seed| -> Vec<Estimate> {
            let threads = Threads::new(threads).unwrap();
            let mut tracker =
                AppearanceTracker::start(&frame(0), truth(0), &settings, (Stream::new(seed), threads))
                    .unwrap();
            (1..4).map(|k| tracker.step(&frame(k)).unwrap()).collect()
        };
        let one = answers(1, 5);
        assert_eq!(one, answers(4, 5), "{name}");
        let other = answers(1, 6);
        assert!(one.iter().zip(&other).all(|(a, b)| a.bounds != b.bounds), "{name}");
    }
}

#[test]
fn every_option_changes_the_answers() {
    let rt = AppearanceSettings::rt();
    let ssim = AppearanceSettings::ssim();
    let fahe = AppearanceSettings::ssimfahe();
    let structure = |window, exponents, centre| AppearanceSettings {
        similarity: Similarity::Structure { window, exponents, centre },
        ..ssim.clone()
    };
    let colour =
        |bins, root| AppearanceSettings { similarity: Similarity::Colour { bins, root }, ..rt.clone() };
    let equalised =
        |clip, tiles| AppearanceSettings { equalisation: Some(Equalisation { clip, tiles }), ..fahe.clone() };
    let variants = [
        rt.clone(),
        AppearanceSettings::frt(),
        colour(4, false),
        colour(8, true),
        AppearanceSettings { template: TemplateUpdate::Blended { rate: 0.05 }, ..rt.clone() },
        AppearanceSettings { particles: 71, ..rt.clone() },
        AppearanceSettings { sigma: 0.05, ..rt.clone() },
        AppearanceSettings { velocity_kept: 0.0, ..rt.clone() },
        AppearanceSettings { position_noise: Deviation::Pixels(2.0), ..rt.clone() },
        AppearanceSettings { position_noise: Deviation::BoxShare(0.2), ..rt.clone() },
        AppearanceSettings { velocity_noise: 0.5, ..rt.clone() },
        AppearanceSettings { size_noise: 0.02, ..rt.clone() },
        AppearanceSettings { resampling: Resampling::Multinomial, ..rt.clone() },
        AppearanceSettings { trigger: Trigger::Below(0.01), ..rt.clone() },
        ssim.clone(),
        AppearanceSettings { template: TemplateUpdate::Blended { rate: 0.05 }, ..ssim.clone() },
        AppearanceSettings { size_noise: 0.02, ..ssim.clone() },
        AppearanceSettings { flow: FlowUse::Off, ..ssim.clone() },
        AppearanceSettings { flow: FlowUse::Move, ..ssim.clone() },
        structure(5, [1.0; 3], CentreWeight::None),
        structure(7, [2.0, 1.0, 1.0], CentreWeight::None),
        structure(7, [1.0, 2.0, 1.0], CentreWeight::None),
        structure(7, [1.0, 1.0, 0.5], CentreWeight::None),
        structure(7, [1.0; 3], CentreWeight::Multiplied),
        structure(7, [1.0; 3], CentreWeight::Map),
        fahe.clone(),
        AppearanceSettings { blur: Some(9), ..fahe.clone() },
        equalised(4.0, (8, 8)),
        equalised(2.0, (4, 6)),
        AppearanceSettings::massimahe(),
    ];
    let last: Vec<Estimate> =
        variants.iter().map(|settings| *followed(settings, 2, 6).last().unwrap()).collect();
    for i in 0..last.len() {
        for j in 0..i {
            assert_ne!(last[i], last[j], "{:?} and {:?}", variants[i], variants[j]);
        }
    }
}

#[test]
fn what_cannot_be_followed_is_refused() {
    let started = |bounds, settings: &AppearanceSettings| {
        AppearanceTracker::start(&frame(0), bounds, settings, (Stream::new(1), Threads::Serial)).map(drop)
    };
    let good = truth(0);
    for (name, settings) in presets() {
        // Small, half outside, and grey: all of these can be followed.
        assert!(started(Rect { width: 2.0, height: 2.0, ..good }, &settings).is_ok(), "{name}");
        let outside = Rect { x: -10.0, y: 100.0, ..good };
        let mut tracker =
            AppearanceTracker::start(&frame(0), outside, &settings, (Stream::new(1), Threads::Serial))
                .unwrap();
        let grey = frame(1).map(|p| [p[1]; 3]);
        for _ in 0..5 {
            let estimate = tracker.step(&grey).unwrap();
            assert!(estimate.bounds.area() > 0.0 && (0.0..=1.0).contains(&estimate.p_lost), "{name}");
        }
        let other = tracker.step(&Image::filled(9, 9, [0; 3]));
        assert!(matches!(other, Err(Error::Size { found: (9, 9), expected: SIZE })), "{name}");
    }
    let rt = AppearanceSettings::rt();
    for bad in [
        Rect { width: 1.0, ..good },
        Rect { x: f64::NAN, ..good },
        Rect { x: 500.0, ..good },
        Rect { x: -20.0, ..good },
        Rect { width: 400.0, ..good },
    ] {
        assert!(matches!(started(bad, &rt), Err(Error::Bounds { .. })), "{bad}");
    }
    for bad in [
        AppearanceSettings { sigma: 0.0, ..rt.clone() },
        AppearanceSettings { sigma: f64::NAN, ..rt.clone() },
        AppearanceSettings { particles: 0, ..rt.clone() },
        AppearanceSettings { blur: Some(4), ..rt.clone() },
        AppearanceSettings { size_noise: -1.0, ..rt.clone() },
        AppearanceSettings { template: TemplateUpdate::Blended { rate: 1.5 }, ..rt.clone() },
        AppearanceSettings { similarity: Similarity::Colour { bins: 0, root: false }, ..rt.clone() },
        AppearanceSettings {
            equalisation: Some(Equalisation { clip: 2.0, tiles: (0, 8) }),
            ..AppearanceSettings::ssim()
        },
        AppearanceSettings { trigger: Trigger::Below(-1.0), ..rt.clone() },
    ] {
        let refusal = started(good, &bad).unwrap_err();
        assert!(!refusal.to_string().is_empty(), "{bad:?}");
    }
}
