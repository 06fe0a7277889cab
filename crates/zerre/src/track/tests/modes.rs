//! Filters with modes: the filter without where there is one, exact where all histories can be gone through,
//! the same bits after a rest.

use super::*;
use crate::filter::Outcome;

/// The filters that keep more than a Gaussian for each mode.
const OF_PARTICLES: [&str; 3] = ["mmpf", "imm-pf", "rb-mmpf"];

/// One mode is the filter without modes: the innovations come by another way of computing the same, hence the
/// tolerance of sums of squares of some ten numbers, each with a relative error of some 1e-12.
#[test]
fn one_mode_is_the_filter_without_modes() {
    for (filter, with_modes) in [
        ("kalman", "imm-kalman"),
        ("ekf", "imm-ekf"),
        ("ukf", "imm-ukf"),
        ("ukf", "rb-mmpf"),
        ("particle", "mmpf"),
    ] {
        for motion in ["constant-velocity", "constant-acceleration", "random-walk"] {
            let mut alone = spec(filter, motion, 2);
            // As filters with modes do.
            alone.filter.trigger = Trigger::Always;
            let mut modal = spec(with_modes, motion, 2);
            modal.motion.modes =
                ModeSpec { turn_rate_rad_s: Some(0.0), manoeuvre_factor: Some(1.0), stay_s: Some(5.0) };
            let plots = two_targets(30);
            let pairs = rows(&alone, Engine::default(), &plots).into_iter().zip(rows(
                &modal,
                Engine::default(),
                &plots,
            ));
            for (a, b) in pairs {
                assert_eq!((&a.id, a.event), (&b.id, b.event));
                let near = |x: f64, y: f64| (x - y).abs() <= 1e-8 * (1.0 + x.abs());
                assert!(a.mean.iter().zip(&b.mean).all(|(&x, &y)| near(x, y)), "{a:?}\n{b:?}");
                assert!(a.covariance.iter().zip(&b.covariance).all(|(&x, &y)| near(x, y)), "{a:?}\n{b:?}");
                assert_eq!(a.update.is_some(), b.update.is_some());
                if let (Some(x), Some(y)) = (a.update, b.update) {
                    assert!(near(x.log_evidence, y.log_evidence), "{x:?} {y:?}");
                }
                assert_eq!(a.innovation.is_some(), b.innovation.is_some());
                if let (Some(x), Some(y)) = (a.innovation, b.innovation) {
                    assert!(near(x.nis, y.nis), "{x:?} {y:?}");
                }
            }
        }
    }
}

/// Whatever noise one motion has, it explains less than straight legs and a turn do.
#[test]
fn modes_are_worth_their_evidence() {
    let plots = turning();
    let evidence = |filter: &str, sd: f64| {
        let mut spec = spec(filter, "constant-velocity", 2);
        spec.motion.acceleration_sd_mps2 = Some(sd);
        spec.motion.modes.turn_rate_rad_s = Some(0.1);
        rows(&spec, Engine::default(), &plots)
            .iter()
            .filter_map(|row| row.update)
            .map(|u| u.log_evidence)
            .sum()
    };
    // 3 m/s^2 is the acceleration of the turn; whatever one noise is taken, two straight legs and a turn lose by it.
    let alone = [0.03, 0.1, 0.3, 1.0, 3.0].map(|sd| evidence("ekf", sd)).into_iter().fold(f64::MIN, f64::max);
    let modal: f64 = evidence("imm-ekf", 0.1);
    assert!(modal > alone + 20.0, "{modal} {alone}");
}

/// A target that flies straight, circles at 0.1 rad/s and flies straight again, measured to 2 m.
fn turning() -> Vec<Plot> {
    let mut draws = Stream::new(8).draws(Purpose::Other, 0, 0);
    let (mut x, mut y, mut heading) = (0.0_f64, 0.0_f64, 0.3_f64);
    let step = |k: usize| {
        heading += if (40..80).contains(&k) { 0.1 } else { 0.0 };
        (x, y) = (x + 30.0 * heading.cos(), y + 30.0 * heading.sin());
        let z = [x + 2.0 * draws.normal(), y + 2.0 * draws.normal()];
        plot("a", k as f64, Reading::Position2(z))
    };
    (0..120).map(step).collect()
}

fn turning_spec(filter: &str) -> TrackerSpec {
    let mut spec = spec(filter, "constant-velocity", 2);
    spec.motion.modes.turn_rate_rad_s = Some(0.1);
    spec.filter.particles = if filter == "rb-mmpf" { 50 } else { 2000 };
    spec
}

/// Filters with modes.
fn modal() -> impl Iterator<Item = &'static str> {
    FILTERS.iter().map(|entry| entry.name).filter(|name| has_modes(name))
}

/// Whatever the filter: in the turn, and not on the straight legs, the turn to the left is the most probable
/// mode at each step, the one to the right at none, and every row tells probabilities that sum to 1.
#[test]
fn the_mode_is_found() {
    let plots = turning();
    for filter in modal() {
        let mut tracker = turning_spec(filter).build(Engine::default()).unwrap();
        assert_eq!(tracker.modes(), [Mode::Straight, Mode::Left, Mode::Right, Mode::Manoeuvre]);
        for (k, plot) in plots.iter().enumerate() {
            let row = tracker.push(plot).unwrap();
            assert!((row.modes.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{filter} {k}: {row:?}");
            assert!(k == 0 || row.event == Event::Updated, "{filter} {k}: {row:?}");
            let [straight, left, right, manoeuvre] = row.modes[..] else { panic!() };
            // Some steps after a change it is beyond doubt.
            match k {
                20..40 | 95..120 => assert!(straight > left + right, "{filter} {k}: {:?}", row.modes),
                50..80 => assert!(left > straight + right + manoeuvre, "{filter} {k}: {:?}", row.modes),
                _ => {}
            }
        }
    }
    let rows = rows(&spec("ekf", "constant-velocity", 2), Engine::default(), &plots[..3]);
    assert!(rows.iter().all(|row| row.modes.is_empty()));
}

/// Saved before the cloud is drawn, in the turn and after it; and what another filter saved is refused.
#[test]
fn saved_modes_go_on_to_the_same_bits() {
    let plots = turning();
    for filter in modal() {
        let spec = turning_spec(filter);
        for at in [1, 2, 60, 90] {
            let mut whole = spec.build(Engine::default()).unwrap();
            plots[..at].iter().for_each(|plot| drop(whole.push(plot).unwrap()));
            let text = serde_json::to_string(&whole.save()).unwrap();
            let mut again = spec.build(Engine::default()).unwrap();
            again.restore(serde_json::from_str(&text).unwrap()).unwrap();
            for plot in &plots[at..] {
                assert_eq!(whole.push(plot).unwrap(), again.push(plot).unwrap(), "{filter} {at}");
            }
            // The same specification, but a belief that lost a mode, and one of a filter without modes.
            let saved: serde_json::Value = serde_json::from_str(&text).unwrap();
            let mut lost = saved.clone();
            let belief = &mut lost["targets"][0][1]["belief"];
            if let Some(modes) = belief["modal"]["modes"].as_array_mut() {
                modes.truncate(1);
                modes[0]["probability"] = 1.0.into();
                let refused = again.restore(serde_json::from_value(lost).unwrap()).unwrap_err().to_string();
                assert!(refused.contains("other modes"), "{refused}");
            }
            let mut other = saved.clone();
            let zeros = vec![0.0; 4];
            let gaussian =
                serde_json::json!({ "time": 0, "mean": zeros, "covariance": vec![zeros.clone(); 4] });
            other["targets"][0][1]["belief"] = serde_json::json!({ "gaussian": gaussian });
            let refused = again.restore(serde_json::from_value(other).unwrap()).unwrap_err().to_string();
            assert!(refused.contains("other modes"), "{refused}");
            let mut other = saved;
            other["spec"]["filter"]["name"] = "imm-ekf".into();
            let mut imm = turning_spec("imm-ekf");
            imm.filter = FilterSpec { name: "imm-ekf".to_owned(), ..spec.filter.clone() };
            let mut imm = imm.build(Engine::default()).unwrap();
            let taken = imm.restore(serde_json::from_value(other).unwrap());
            assert_eq!(taken.is_ok(), text.contains("\"modal\""), "{filter} {at}: {taken:?}");
        }
    }
}

/// Two motions of a line each way, linear and normal: with as many hypotheses as there are histories the
/// evidence is exact. That of particles is unbiased: over 60 seeds the mean of its ratio to the exact one is
/// 1 within five of its standard errors, which the spread over the seeds tells; with a thousand particles
/// they are small enough to tell a wrong weight of the modes. One mode has the evidence of the Kalman filter.
#[test]
fn the_evidence_of_particles_is_unbiased() {
    let plots = turning();
    let two = |filter: &str, factor: f64| {
        let mut spec = turning_spec(filter);
        spec.motion.modes =
            ModeSpec { turn_rate_rad_s: Some(0.0), manoeuvre_factor: Some(factor), stay_s: Some(4.0) };
        spec.motion.acceleration_sd_mps2 = Some(1.0);
        spec.filter.particles = 1000;
        spec
    };
    // A straight leg, which one quiet motion explains; its end and the first seconds of the turn, which need
    // another.
    for (factor, plots) in [(1.0, &plots[2..10]), (5.0, &plots[36..44])] {
        let evidence = |spec: &TrackerSpec| {
            let rows = rows(spec, Engine::default(), plots);
            assert!(rows[1..].iter().all(|row| row.event == Event::Updated));
            rows.iter().filter_map(|row| row.update).map(|update| update.log_evidence).sum::<f64>()
        };
        let exact = evidence(&two("rb-mmpf", factor));
        let single = evidence(&two("kalman", factor));
        assert_eq!((exact - single).abs() < 1e-9, factor == 1.0, "{exact} {single}");
        // It mixes where the exact one enumerates: near, and not the same.
        let mixed = evidence(&two("imm-kalman", factor));
        assert!((mixed - exact).abs() < if factor == 1.0 { 1e-9 } else { 0.5 }, "{mixed} {exact}");
        for filter in ["mmpf", "imm-pf"] {
            let ratio = |seed| {
                let mut spec = two(filter, factor);
                spec.seed = seed;
                (evidence(&spec) - exact).exp()
            };
            let ratios: Vec<f64> = (0..60).map(ratio).collect();
            let mean = ratios.iter().sum::<f64>() / 60.0;
            let variance = ratios.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / 59.0;
            let error = (variance / 60.0).sqrt();
            assert!((mean - 1.0).abs() < 5.0 * error && error < 0.1, "{filter} {factor}: {mean} +- {error}");
        }
    }
}

/// A jump that no mode explains: with a gate it is refused, without one lost particles start anew (Gaussians
/// are never lost); and a wrong number of particles or hypotheses is no filter.
#[test]
fn filters_of_particles_with_modes_lose_and_find() {
    let path = |k: usize, jump: f64| plot("a", k as f64, Reading::Position2([10.0 * k as f64 + jump, 0.0]));
    let plots: Vec<Plot> = (0..20).map(|k| path(k, if k < 10 { 0.0 } else { 50_000.0 })).collect();
    for filter in OF_PARTICLES {
        let mut gated = turning_spec(filter);
        gated.sensors.get_mut(DEFAULT_SENSOR).unwrap().gate = Some(0.999);
        let found = rows(&gated, Engine::default(), &plots);
        assert!(found[10..12].iter().all(|row| row.event == Event::Gated), "{filter}");
        assert!(found[10].mean[0] < 200.0 && found[10].update.unwrap().outcome == Outcome::Gated);
        assert_eq!(found[12].event, Event::Restarted, "{filter}");
        assert!((found[19].mean[0] - 50_190.0).abs() < 10.0, "{filter}: {:?}", found[19]);

        if filter != "rb-mmpf" {
            // The third update in a row of hardly more than one particle.
            let found = rows(&turning_spec(filter), Engine::default(), &plots);
            assert!((found[19].mean[0] - 50_190.0).abs() < 10.0, "{filter}: {:?}", found[19]);
            let restarts: Vec<usize> = (0..20).filter(|&k| found[k].event == Event::Restarted).collect();
            assert!(restarts.first().is_some_and(|&k| (10..=13).contains(&k)), "{filter}: {restarts:?}");
        }
        for particles in [0, usize::MAX] {
            let mut none = turning_spec(filter);
            none.filter.particles = particles;
            assert!(none.build(Engine::default()).is_err(), "{filter} {particles}");
        }
        let mut one = turning_spec(filter);
        one.filter.particles = 1;
        for row in rows(&one, Engine::default(), &turning()) {
            assert!(row.mean.iter().chain(&row.covariance).all(|v| v.is_finite()), "{filter}: {row:?}");
        }
    }
}

/// Where the heaviest particle or the mean of the heaviest tenth stands for the belief, it is one of the
/// target's places.
#[test]
fn other_points_stand_for_modes_too() {
    let plots = turning();
    for filter in OF_PARTICLES {
        let run = |estimate| {
            let mut spec = turning_spec(filter);
            spec.life.estimate = estimate;
            rows(&spec, Engine::default(), &plots)
        };
        let means = run(Estimate::Mean);
        for estimate in [Estimate::MaxWeight, Estimate::RobustMean] {
            let others = run(estimate);
            let same = means.iter().zip(&others).skip(2).all(|(a, b)| a.mean == b.mean);
            assert_eq!(same, filter == "rb-mmpf", "{filter}: a mixture of Gaussians has its mean alone");
            for (a, b) in means.iter().zip(&others) {
                assert_eq!((a.update, &a.covariance), (b.update, &b.covariance), "the belief is the same");
                // Six standard deviations of a measurement: the posterior is narrower.
                assert!((a.mean[0] - b.mean[0]).hypot(a.mean[1] - b.mean[1]) < 12.0, "{filter}");
            }
        }
    }
}

/// What is learnt is for the IMM filter of the Kalman family, which stands for all of them; only what
/// particles cannot reach changes it.
#[test]
fn filters_with_modes_learn_alike() {
    let plots = turning();
    let unknown = [
        Unknown::Sensor(DEFAULT_SENSOR.to_owned(), Noise::Position),
        Unknown::Motion,
        Unknown::Stay,
        Unknown::TurnRate,
        Unknown::Manoeuvre,
    ];
    let learnt = |filter: &str| {
        let mut spec = TrackerSpec::new(filter, "constant-velocity");
        spec.sensors.insert(DEFAULT_SENSOR.to_owned(), SensorSpec::default());
        learn(&spec, &unknown, &plots).unwrap()
    };
    let imm = learnt("imm-ekf");
    assert_eq!(learnt("rb-mmpf").values, imm.values);
    for filter in ["mmpf", "imm-pf"] {
        let learnt = learnt(filter);
        assert_eq!(learnt.spec.filter.name, filter);
        // Positions to 2 m and the turn of 0.1 rad/s: within a third, eight standard errors of the former.
        for (value, truth) in [(learnt.values[0], 2.0), (learnt.values[3], 0.1)] {
            assert!((value / truth).ln().abs() < 0.3, "{filter}: {:?}", learnt.values);
        }
        let rows = rows(&learnt.spec, Engine::default(), &plots);
        assert!(rows[1..].iter().all(|row| row.event == Event::Updated), "{filter}");
    }
}

#[test]
fn modes_without_a_meaning_are_refused() {
    for modes in [
        ModeSpec { stay_s: Some(0.0), ..ModeSpec::default() },
        ModeSpec { stay_s: Some(f64::NAN), ..ModeSpec::default() },
        ModeSpec { turn_rate_rad_s: Some(-0.1), ..ModeSpec::default() },
        ModeSpec { manoeuvre_factor: Some(0.9), ..ModeSpec::default() },
        ModeSpec { manoeuvre_factor: Some(f64::INFINITY), ..ModeSpec::default() },
    ] {
        let mut spec = spec("imm-ekf", "constant-velocity", 2);
        spec.motion.modes = modes.clone();
        assert!(spec.build(Engine::default()).is_err(), "{modes:?}");
        // Filters without modes do not look at them.
        spec.filter.name = "ekf".to_owned();
        assert!(spec.build(Engine::default()).is_ok());
    }
}
