use super::*;
use crate::rgbd::{NO_DEPTH, Registration};

/// Nothing goes wrong.
fn clean() -> SceneSettings {
    let depth = DepthSettings {
        noise: 0.0,
        step: 0.0,
        baseline_mm: 0.0,
        edge_holes: 0.0,
        spots: 0.0,
        speckle: 0.0,
        loss: 0.0,
        far_mm: 60_000.0,
    };
    let colour = ColourSettings { noise: 0.0, drift: 0.0, step: 0.0, flicker: 0.0, shadow: 0.0, blur: 0 };
    let device = DeviceSettings {
        noise_px: 0.0,
        lag_frames: 0.0,
        burst_probability: 0.0,
        loss: 0.0,
        drop_outs: 0,
        ..DeviceSettings::default()
    };
    let operators = OperatorSettings { bias_px: 0.0, noise_px: 0.0, ..OperatorSettings::default() };
    SceneSettings { depth, colour, device, operators, ..SceneSettings::default() }
}

fn scene(change: impl FnOnce(&mut SceneSettings)) -> Scene {
    let mut settings = clean();
    change(&mut settings);
    Scene::new(settings, 3).unwrap()
}

/// FNV-1a.
fn digest(frame: &RgbdFrame) -> u64 {
    let depth = frame.depth.pixels().iter().flat_map(|z| z.to_le_bytes());
    let bytes = frame.colour.pixels().as_flattened().iter().copied().chain(depth);
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

fn share(frame: &Depth) -> f64 {
    let without = frame.pixels().iter().filter(|z| **z == NO_DEPTH).count();
    without as f64 / frame.pixels().len() as f64
}

fn mean(frame: &Frame) -> f64 {
    let levels = frame.pixels().as_flattened();
    levels.iter().map(|v| f64::from(*v)).sum::<f64>() / levels.len() as f64
}

#[test]
fn the_palm_is_where_the_truth_says() {
    let scene = scene(|_| {});
    let skin = space::unit(scene.appearance().skin);
    let mut seen = 0;
    for k in (0..scene.len()).step_by(7) {
        let (frame, truth) = (scene.frame(k), scene.truth(k));
        assert_eq!(truth.hand, scene.camera().colour.project(truth.hand_mm));
        if truth.visible < 1.0 {
            continue;
        }
        seen += 1;
        let [x, y] = truth.hand.map(|v| v.floor() as isize);
        // Shades of one colour lie in one direction; levels are rounded.
        let own = space::unit(frame.colour.at(x, y).map(f64::from));
        assert!(space::length(sub(own, skin)) < 0.03, "frame {k}: {own:?} for {skin:?}");
        // The palm is 36 mm thick, and 108 mm long where it is seen from its end.
        let before = truth.hand_mm[2] - f64::from(frame.depth.at(x, y));
        assert!((15.0..62.0).contains(&before), "frame {k}: {before} mm before the middle");
    }
    assert!(seen > 10, "{seen}");
}

#[test]
fn half_of_the_frames_have_the_hand_before_the_body() {
    for seed in 0..8 {
        for settings in [SceneSettings::default(), SceneSettings::calibration()] {
            let scene = Scene::new(settings, seed).unwrap();
            let over = (0..scene.len()).filter(|k| scene.truth(*k).overlap).count();
            let share = over as f64 / scene.len() as f64;

            assert!((0.4..=0.55).contains(&share), "seed {seed}: {share}");
        }
    }
}

/// The variance of n draws of a normal law is off by its own 5 · sqrt(2 / n) at most. Rows overlap in the
/// table of numbers: 2^17 numbers used m times each, m Poisson with mean above 1, are worth at least 2^16.
/// Rounding adds 1 / 12.
#[test]
fn noise_is_as_large_as_set() {
    let tolerance = 5.0 * (2.0 / 65_536.0_f64).sqrt();
    let depth = scene(|s| s.depth.noise = 1.5e-6);
    let (_, measured) = depth.background();
    let (mut sum, mut square, mut count) = (0.0, 0.0, 0.0);
    for (z, exact) in measured.pixels().iter().zip(&depth.empty.depth) {
        let exact = f64::from(*exact);
        let variance = (1.5e-6 * exact * exact).powi(2) + 1.0 / 12.0;
        let error = (f64::from(*z) - exact) / variance.sqrt();
        (sum, square, count) = (sum + error, square + error * error, count + 1.0);
    }
    assert!((sum / count).abs() < 5.0 / 256.0, "{}", sum / count);
    assert!((square / count - 1.0).abs() < tolerance, "{}", square / count);

    let colour = scene(|s| s.colour.noise = 2.5);
    let (frame, _) = colour.background();
    let (mut square, mut count) = (0.0, 0.0);
    let exact = colour.empty.colour.as_flattened();
    for (level, exact) in frame.pixels().as_flattened().iter().zip(exact) {
        // Far from the ends of the scale.
        if (30.0..225.0).contains(exact) {
            (square, count) = (square + f64::from(f32::from(*level) - exact).powi(2), count + 1.0);
        }
    }
    let variance = 2.5 * 2.5 + 1.0 / 12.0;
    assert!(count > 100_000.0 && (square / count / variance - 1.0).abs() < tolerance, "{}", square / count);
}

#[test]
fn levels_of_depth_are_equally_far_apart_in_its_inverse() {
    let (_, depth) = scene(|s| s.depth.step = 2.9e-6).background();
    for z in depth.pixels() {
        let level = 1.0 / (2.9e-6 * f64::from(*z));
        // Half a millimetre is less than a tenth of a level from 1.4 m on.
        assert!((level - level.round()).abs() < 0.1, "{z} mm");
    }
}

#[test]
fn without_disturbances_cameras_see_what_is_there() {
    let scene = scene(|_| {});
    let (frame, depth) = scene.background();
    for (z, exact) in depth.pixels().iter().zip(&scene.empty.depth) {
        assert_eq!(*z, (exact + 0.5) as u16);
    }
    for (level, exact) in frame.pixels().as_flattened().iter().zip(scene.empty.colour.as_flattened()) {
        assert_eq!(*level, (exact + 0.5) as u8);
    }
    assert_eq!(share(&scene.frame(50).depth), 0.0);
    let twice = scene.frame(50);
    assert_eq!((twice.colour, twice.depth), (scene.frame(50).colour, scene.frame(50).depth));
    for k in 0..scene.len() {
        let truth = scene.truth(k);
        let reading = scene.device(k).unwrap();
        assert_eq!(reading.at, truth.hand);
        let labels = scene.operators(k);
        assert_eq!(labels.len(), 7);
        assert!(labels.iter().all(|label| *label == (truth.visible >= 0.3).then_some(truth.hand)));
    }
}

/// Each disturbance of depth alone takes pixels away, and where it should.
#[test]
fn depth_is_lost_where_it_should_be() {
    let k = 50;
    let lost = |change: fn(&mut DepthSettings)| share(&scene(|s| change(&mut s.depth)).frame(k).depth);
    // 640 x 480 · 0.01 draws of a pixel: some are drawn twice.
    let speckle = lost(|depth| depth.speckle = 0.01);
    assert!((speckle - (1.0 - (-0.01_f64).exp())).abs() < 5.0 * (0.01 / 307_200.0_f64).sqrt(), "{speckle}");
    assert_eq!(lost(|depth| depth.loss = 1.0), 1.0);
    assert!((0.0005..0.01).contains(&lost(|depth| depth.spots = 10.0)));
    assert!((0.0005..0.02).contains(&lost(|depth| depth.edge_holes = 0.5)));
    let exact = scene(|_| {}).frame(k).depth;
    let near = scene(|s| s.depth.far_mm = 2400.0).frame(k).depth;
    for (near, exact) in near.pixels().iter().zip(exact.pixels()) {
        assert!(*exact == 2400 || *near == if *exact > 2400 { NO_DEPTH } else { *exact });
    }
    // Shadows lie left of something nearer, not farther than the projector's parallax between them; none on
    // the person's front.
    let shadows = scene(|s| s.depth.baseline_mm = 75.0).frame(k).depth;
    let mut count = 0;
    for (i, z) in shadows.pixels().iter().enumerate().filter(|(_, z)| **z == NO_DEPTH) {
        let _ = z;
        count += 1;
        let (x, y) = (i % 640, i / 640);
        let own = f64::from(exact.pixels()[i]);
        let nearer = |x: &usize| {
            let z = f64::from(exact.row(y)[*x]);
            z < own - 20.0 && 525.0 * 75.0 * (1.0 / z - 1.0 / own) > (*x as f64 - (i % 640) as f64) - 2.0
        };
        assert!((x + 1..(x + 40).min(640)).any(|x| nearer(&x)), "({x}, {y})");
    }
    assert!((1000..30_000).contains(&count), "{count}");
}

/// Each disturbance of the light alone, seen on the whole picture.
#[test]
fn light_changes_as_set() {
    let base = scene(|_| {});
    let means = |change: fn(&mut ColourSettings)| -> Vec<f64> {
        let scene = scene(|s| {
            change(&mut s.colour);
            s.size = [160, 120];
        });
        (0..scene.len()).map(|k| mean(&scene.frame(k).colour)).collect()
    };
    let still = means(|_| {});
    let relative = |now: Vec<f64>| -> Vec<f64> { now.iter().zip(&still).map(|(a, b)| a / b - 1.0).collect() };
    let most = |shares: &[f64]| shares.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    let drift = relative(means(|colour| colour.drift = 0.2));
    // Bright pixels end at 255.
    assert!((0.1..=0.202).contains(&most(&drift)), "{}", most(&drift));
    assert!(drift.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 0.02));
    let flicker = relative(means(|colour| colour.flicker = 0.05));
    let jumps: Vec<f64> = flicker.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(most(&flicker) < 0.052 && most(&jumps) > 0.05, "{} {}", most(&flicker), most(&jumps));
    let step = relative(means(|colour| colour.step = 0.2));
    let jumps = step.windows(2).filter(|pair| (pair[1] - pair[0]).abs() > 0.1).count();
    assert_eq!(jumps, 1);
    // Shadows darken the room and nothing else.
    let shadow = scene(|s| s.colour.shadow = 0.3).frame(40).colour;
    let plain = base.frame(40).colour;
    let pairs = || shadow.pixels().as_flattened().iter().zip(plain.pixels().as_flattened());
    assert!(pairs().all(|(dark, bright)| dark <= bright));
    let darker = pairs().filter(|(dark, bright)| f64::from(**dark) < 0.75 * f64::from(**bright)).count();
    assert!(darker > 3 * 2000, "{darker}");
    let blurred = scene(|s| s.colour.blur = 2).frame(40).colour;
    let rough = |frame: &Frame| -> f64 {
        let rows = (0..480).map(|y| frame.row(y));
        rows.flat_map(|row| row.windows(2)).map(|pair| f64::from(pair[0][1].abs_diff(pair[1][1]))).sum()
    };
    assert!(rough(&blurred) < 0.9 * rough(&plain) && (mean(&blurred) - mean(&plain)).abs() < 0.2);
}

#[test]
fn conditions_do_what_they_say() {
    let scene = |condition| Scene::new(SceneSettings::condition(condition), 5).unwrap();
    let behind = scene(Condition::BehindBack);
    let hidden: Vec<usize> = (0..behind.len()).filter(|k| behind.truth(*k).visible == 0.0).collect();
    assert!((25..50).contains(&hidden.len()), "{}", hidden.len());
    assert_eq!(hidden[hidden.len() - 1] - hidden[0] + 1, hidden.len(), "one stretch");
    assert!(hidden.iter().all(|k| behind.truth(*k).overlap && behind.operators(*k) == [None; 7]));
    assert!(behind.truth(0).visible > 0.9 && behind.truth(behind.len() - 1).visible > 0.9);
    let out = scene(Condition::DeviceDropOut);
    let missing = (0..out.len()).filter(|k| out.device(*k).is_none()).count();
    assert_eq!((missing, out.readings().count()), (40, 71));
    let light = scene(Condition::Light);
    assert!((0..light.len()).all(|k| light.device(k).is_some() && light.truth(k).visible > 0.5));
    // On the wall, colours and depth vary more before clutter.
    let spread = |scene: &Scene| {
        let colours: Vec<f64> =
            scene.background().0.pixels()[..640 * 200].iter().map(|c| f64::from(c[1])).collect();
        let mean = colours.iter().sum::<f64>() / colours.len() as f64;
        (colours.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / colours.len() as f64).sqrt()
    };
    let clutter = scene(Condition::Clutter);
    assert!(spread(&clutter) > 1.5 * spread(&light), "{} {}", spread(&clutter), spread(&light));
    assert!(scene(Condition::Flicker).settings().colour.flicker > 0.0);
    for condition in Condition::ALL {
        let named = SCENES.iter().find(|named| named.condition == Some(condition)).unwrap();
        assert_eq!(named.name, format!("rgbd-{}", condition.name()));
        assert_eq!(Condition::find(condition.name()), Some(condition));
        let told = serde_json::to_value(condition).unwrap();
        assert_eq!(told.as_str(), Some(condition.name()));
    }
}

/// Of many clips: bursts come before the body alone, of the length and as far off as set; the rest is noise
/// and lag. The mean square of n correlated numbers is off by at most 5 · sqrt(2 · 4.6 / n) of itself, as
/// numbers with a correlation of 0.8 from one to the next are worth (1 - 0.64) / (1 + 0.64) of independent
/// ones.
#[test]
fn the_device_errs_as_set() {
    let device = DeviceSettings { lag_frames: 0.0, burst_probability: 0.0, ..DeviceSettings::default() };
    let size = [64, 48];
    let settings = SceneSettings { device, size, frames: 3000, ..clean() };
    let scene = Scene::new(settings, 1).unwrap();
    let pixel = 0.1;
    let errors: Vec<[f64; 2]> = (0..3000)
        .map(|k| {
            let (a, b) = (scene.device(k).unwrap().at, scene.truth(k).hand);
            [(a[0] - b[0]) / pixel, (a[1] - b[1]) / pixel]
        })
        .collect();
    let square = errors.as_flattened().iter().map(|e| e * e).sum::<f64>() / 6000.0;
    assert!((square / 16.0 - 1.0).abs() < 5.0 * (2.0 * 4.6 / 6000.0_f64).sqrt(), "{square}");

    let device = DeviceSettings { noise_px: 0.0, lag_frames: 0.0, ..DeviceSettings::default() };
    let scene = Scene::new(SceneSettings { device, size, frames: 3000, ..clean() }, 1).unwrap();
    let far: Vec<f64> = (0..3000)
        .map(|k| {
            space::length({
                let (a, b) = (scene.device(k).unwrap().at, scene.truth(k).hand);
                [(a[0] - b[0]) / pixel, (a[1] - b[1]) / pixel, 0.0]
            })
        })
        .collect();
    let mut k = 0;
    let mut bursts = 0;
    while k < 3000 {
        let long = far[k..].iter().take_while(|d| **d > 1e-6 && (**d - far[k]).abs() < 1e-6).count();
        if long > 0 {
            bursts += 1;
            assert!((3..=8).contains(&long) || k + long == 3000, "{long}");
            assert!((55.0 / 3.0 - 1e-6..=55.0 + 1e-6).contains(&far[k]) && scene.truth(k).overlap);
        }
        k += long.max(1);
    }
    assert!(bursts > 50, "{bursts}");
    // Twice as many readings as frames: the newest counts; half as many: every second frame has none.
    let rated = |rate_hz| {
        let device = DeviceSettings { rate_hz, ..scene.settings.device };
        Scene::new(SceneSettings { device, size, frames: 60, ..clean() }, 1).unwrap()
    };
    assert_eq!((0..60).filter(|k| rated(15.0).device(*k).is_some()).count(), 30);
    assert_eq!(rated(60.0).readings().count(), 120);
    assert!((0..60).all(|k| rated(60.0).device(k).is_some()));
}

/// Each operator's mean error over the clip is the bias; what is left is noise. Mean squares as above.
#[test]
fn operators_err_as_set() {
    let operators = OperatorSettings { count: 200, ..OperatorSettings::default() };
    let scene = scene(|s| (s.operators, s.size) = (operators, [64, 48]));
    let seen: Vec<usize> = (0..scene.len()).filter(|k| scene.truth(*k).visible >= 0.3).collect();
    let (mut bias, mut noise, n) = (0.0, 0.0, seen.len() as f64);
    let labels: Vec<_> = seen.iter().map(|k| (scene.operators(*k), scene.truth(*k).hand)).collect();
    for who in 0..200 {
        for axis in 0..2 {
            let errors: Vec<f64> =
                labels.iter().map(|(labels, hand)| labels[who].unwrap()[axis] - hand[axis]).collect();
            let mean = errors.iter().sum::<f64>() / n;
            bias += mean * mean / 400.0;
            noise += errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / (n - 1.0) / 400.0;
        }
    }
    let wanted = 4.0 + 9.0 / n;
    assert!((bias / wanted - 1.0).abs() < 5.0 * (2.0 / 400.0_f64).sqrt(), "{bias}");
    assert!((noise / 9.0 - 1.0).abs() < 5.0 * (2.0 / (400.0 * n)).sqrt(), "{noise}");
}

/// The picture of the displaced depth camera, registered, is what the colour camera sees where both see.
#[test]
fn registered_depth_is_that_of_the_colours() {
    let scene = scene(|_| {});
    let registered = Registration::new(scene.camera(), (640, 480), (640, 480)).unwrap();
    let registered = registered.register(&scene.raw_depth(30)).unwrap();
    let direct = scene.frame(30).depth;
    let (mut same, mut both) = (0, 0);
    for (a, b) in registered.pixels().iter().zip(direct.pixels()) {
        if *a != NO_DEPTH {
            both += 1;
            // Rounding to pixels moves slanted surfaces; a hundredth is 20 mm there.
            same += usize::from(a.abs_diff(*b) < b / 100);
        }
    }
    assert!(both > 250_000 && same as f64 > 0.985 * both as f64, "{same} of {both}");
    assert_ne!(scene.raw_depth(30), direct);
}

/// The digest is that of every machine.
#[test]
fn a_seed_gives_the_same_bits() {
    let frame = |seed| Scene::new(SceneSettings::condition(Condition::Clutter), seed).unwrap().frame(7);
    assert_eq!(digest(&frame(1)), digest(&frame(1)));
    assert_eq!(digest(&frame(1)), 3_438_058_666_044_102_652);
    assert_ne!(digest(&frame(1)), digest(&frame(2)));
    let scene = Scene::new(SceneSettings::default(), 1).unwrap();
    assert_ne!(digest(&scene.frame(0)), digest(&scene.frame(1)));
}

/// Of 20 clips each to calibrate on and to test on, no two share a number of their appearance; the numbers
/// that are drawn directly come from cells of their own.
#[test]
fn calibration_and_test_share_nothing() {
    fn numbers(value: &serde_json::Value, out: &mut Vec<f64>) {
        match value {
            serde_json::Value::Array(all) => all.iter().for_each(|value| numbers(value, out)),
            serde_json::Value::Object(all) => all.values().for_each(|value| numbers(value, out)),
            other => out.extend(other.as_f64()),
        }
    }
    let all = |purpose| -> Vec<Vec<f64>> {
        (0..20)
            .map(|seed| {
                let settings = SceneSettings { purpose, ..SceneSettings::default() };
                let looks = Appearance::new(&settings, Stream::new(seed));
                let mut out = Vec::new();
                numbers(&serde_json::to_value(looks).unwrap(), &mut out);
                out
            })
            .collect()
    };
    let (test, calibration) = (all(Purpose::Test), all(Purpose::Calibration));
    assert!(test[0].len() > 60, "{}", test[0].len());
    for a in &test {
        for b in &calibration {
            // Lights have one component of directions that both share the length of.
            assert!(a.iter().zip(b).all(|(a, b)| a != b));
        }
    }
    for (purpose, odd) in [(Purpose::Test, 0), (Purpose::Calibration, 1)] {
        let mut picker = Picker::new(Stream::new(1), purpose, 0);
        assert!((0..1000).all(|_| picker.value(0.0, 8.0) as usize % 2 == odd));
    }
}

#[test]
fn settings_outside_their_range_are_refused() {
    let refused = |change: fn(&mut SceneSettings)| {
        let mut settings = SceneSettings::default();
        change(&mut settings);
        Scene::new(settings, 1).is_err()
    };
    assert!(refused(|s| s.size = [0, 480]));
    assert!(refused(|s| s.frames = 0));
    assert!(refused(|s| s.rate_hz = f64::NAN));
    assert!(refused(|s| s.colour.flicker = 1.5));
    assert!(refused(|s| s.depth.noise = -1.0));
    assert!(refused(|s| s.device.correlation = 1.0));
    assert!(refused(|s| s.device.burst_frames = [5, 3]));
    assert!(refused(|s| s.behind_back = 40));
    assert!(refused(|s| (s.device.drop_outs, s.device.drop_out_frames) = (3, 50)));
    assert!(!refused(|s| (s.size, s.frames) = ([17, 16], 1)));
    assert!(serde_json::from_str::<SceneSettings>(r#"{"frames": 50, "depth": {"nose": 1}}"#).is_err());
    assert_eq!(serde_json::from_str::<SceneSettings>(r#"{"frames": 50}"#).unwrap().frames, 50);
}
