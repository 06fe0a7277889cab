//! Balls: how exactly they are found.

use zerre_vision::balls::{Detector, DetectorSettings, SCENES, Scene};

fn scene(name: &str, seed: u64) -> Scene {
    let named = SCENES.iter().find(|named| named.name == name).unwrap();
    Scene::new((named.settings)(), seed)
}

fn detector(scene: &Scene) -> Detector {
    let samples: Vec<_> = (0..scene.len()).step_by(20).map(|k| scene.frame(k)).collect();
    Detector::new(&DetectorSettings::default(), &samples).unwrap()
}

#[test]
fn scratch() {
    for seed in 1..4 {
        let scene = scene("balls-free", seed);
        let detector = detector(&scene);
        let (mut sum, mut n) = (0.0, 0);
        for k in (0..200).step_by(7) {
            let seen = detector.see(&scene.frame(k)).unwrap();
            assert_eq!(seen.blobs.len(), 3);
            for t in scene.truth(k) {
                let d = seen.blobs.iter().map(|b| (b.centroid[0]-t.centre[0]).powi(2) + (b.centroid[1]-t.centre[1]).powi(2)).fold(1e9, f64::min);
                sum += d; n += 1;
            }
        }
        println!("level {} rmse {}", detector.level(), (sum / n as f64).sqrt());
    }
    let data = std::path::PathBuf::from(std::env::var("ZERRE_DATA").unwrap());
    let dir = data.join("rolling_balls/img");
    let frames: Vec<_> = zerre_vision::frames::Frames::open(dir.to_str().unwrap()).unwrap().map(|s| s.frame.unwrap()).collect();
    let samples: Vec<_> = frames.iter().step_by(15).cloned().collect();
    let t = std::time::Instant::now();
    let det = Detector::new(&DetectorSettings::default(), &samples).unwrap();
    println!("level {} areas {:?} ground {} new {:?}", det.level(), det.areas(), det.ground().area(), t.elapsed());
    for (k, f) in frames.iter().enumerate() {
        let t = std::time::Instant::now();
        let seen = det.see(f).unwrap();
        let e = t.elapsed();
        let s: Vec<String> = seen.blobs.iter().map(|b| format!("({:.0},{:.0} a{} {})", b.centroid[0], b.centroid[1], b.area, if b.clipped {"c"} else {""})).collect();
        println!("{k}: {:?} {} {}", e, seen.blobs.len(), s.join(" "));
    }
}
