use super::*;
use settings::{BUDGETS, LIMIT, MOVED};
use watch::{Followed, Step};

fn scene(table: &str) -> Scene {
    Scene::of_table(table)[0]
}

fn experiment(table: &'static str, runs: usize, seed: u64) -> SwarmFilters {
    SwarmFilters::new(Request { tables: [table].into_iter().collect(), runs }, seed)
}

#[test]
fn every_table_has_its_scenes_and_every_scene_its_filters() {
    for table in PAPER.tables.iter().chain(PAPER.on_request) {
        let scenes = Scene::of_table(table);
        let expected = match *table {
            "honest" => WORLDS.len(),
            "dimensions" => 0,
            "misfit" => MISFIT.len() * VARIANCES.len(),
            _ => STEPS.len() * VARIANCES.len(),
        };
        assert_eq!(scenes.len(), expected, "{table}");
        assert!(Request::table(table).is_some());
        for scene in scenes {
            let entrants = scene.entrants();
            for (at, one) in entrants.iter().enumerate() {
                let same = |other: &Entrant| (other.name, other.particles) == (one.name, one.particles);
                assert!(!entrants[..at].iter().any(same), "{} {}", one.name, one.particles);
            }
        }
    }
    assert!(Scene::of_table("reading-").is_empty() && Request::table("reading-e").is_none());
    // Every reading but the main one can be asked for, and what is asked for is kept apart from the default.
    let readings = PAPER.on_request.iter().filter(|table| table.starts_with("reading-"));
    assert_eq!(readings.count() + 1, READINGS.len());
    assert!(Request::new(false).tables.iter().all(|table| !PAPER.on_request.contains(table)));
    // Keys tell cells apart.
    let all = Request { tables: PAPER.tables.iter().chain(PAPER.on_request).copied().collect(), runs: 25 };
    let all = SwarmFilters::new(all, 1);
    let cells = all.cells();
    assert_eq!(cells.iter().map(|cell| all.key(cell)).collect::<BTreeSet<_>>().len(), cells.len());
    let of_one: usize =
        cells.iter().filter(|cell| cell.scene == scene("1")).map(|cell| all.runs(cell).len()).sum();
    assert_eq!(of_one, 25);
}

/// What is told differs from what is drawn where the reading says so: a first step of data has the mean and
/// the variance of its noise, each within five standard errors of 2 000 draws (of a variance: its own times
/// sqrt((k - 1) / n), k being the kurtosis, at most 3 + 6 / 3 for these).
#[test]
fn readings_draw_what_they_say() {
    for (name, mean, variance) in [("a", 1.5, 0.75), ("b", 6.0, 12.0), ("c", 0.0, 1.0), ("i", 0.0, 3.0)] {
        let [drawn, _] = READINGS[Reading::place(name).unwrap()].problems(3.0, 1).unwrap();
        let count = 2000;
        let drift = 1.5 + (0.04 * std::f64::consts::PI).sin();
        let noise: Vec<f64> = (0..count)
            .map(|run| drawn.record::<1, 1>(Stream::new(7).fork(run)).unwrap().truth[0][0] - drift)
            .collect();
        let found = noise.iter().sum::<f64>() / count as f64;
        let square = noise.iter().map(|v| (v - found).powi(2)).sum::<f64>() / count as f64;
        assert!((found - mean).abs() < 5.0 * (variance / count as f64).sqrt(), "{name} {found}");
        assert!((square - variance).abs() < 5.0 * variance * (4.0 / count as f64).sqrt(), "{name} {square}");
    }
}

/// Scores of a way of two steps by hand, the third being lost.
#[test]
fn runs_are_scored_by_hand() {
    let record = Record {
        times: [29.0, 30.0, 31.0].map(zerre::Time::from_secs).to_vec(),
        truth: vec![[1.0], [2.0], [5.0]],
        measured: vec![[0.0]; 3],
    };
    let step = Step {
        estimate: 2.0,
        band: None,
        crps: 0.5,
        inside: true,
        w1: Some(0.2),
        pull: None,
        spread: None,
        nis: Some(4.0),
        ess: Some(0.5),
        evaluations: 10,
    };
    let steps = vec![step, Step { nis: Some(2.0), inside: false, evaluations: 30, ..step }];
    let followed = Followed { steps, degenerate: 1, seconds: 3e-6 };
    let run = Run::of(&record, &followed, None, (0.0, Some(2.0)));
    // Errors 1, 0, 3; the last estimate stands, and scores as a point.
    assert!((run.rmse - (10.0_f64 / 3.0).sqrt()).abs() < 1e-15);
    assert!((run.crps - 4.0 / 3.0).abs() < 1e-15 && (run.coverage90 - 1.0 / 3.0).abs() < 1e-15);
    assert_eq!((run.nis, run.evaluations, run.lost, run.degenerate), (Some(3.0), 20.0, 1, 1));
    assert!((run.straight_error.unwrap() - 1.5).abs() < 1e-15 && (run.microseconds - 1.0).abs() < 1e-9);
    assert_eq!((run.posterior_error, run.spread), (None, None));
}

/// In the world that filters know: the exact one has no distance from itself, particles approach it, budgets
/// are kept, the colony collapses, and the stretch move does not. Of 820 particles the mean errs by about sd
/// sqrt(2 / 820), and as much again for the predictions behind it: a tenth of the sd at most. Coverage of 10
/// runs of 50 steps has a standard error of .014: five of it.
#[test]
fn the_honest_table_is_honest() {
    let all = experiment("honest", 10, 3);
    let cell = all.cells()[0];
    let runs = all.work(&cell, &|| false).unwrap().unwrap();
    let entrants = cell.scene.entrants();
    let of = |name: &str, particles: usize| {
        let at = entrants.iter().position(|e| (e.name, e.particles) == (name, particles)).unwrap();
        let mean = |value: &dyn Fn(&Run) -> f64| runs[at].iter().map(value).sum::<f64>() / 10.0;
        (
            mean(&|run| run.rmse),
            mean(&|run| run.coverage90),
            mean(&|run| run.posterior_error.unwrap_or(0.0)),
            mean(&|run| run.spread.unwrap_or(1.0)),
            mean(&|run| run.evaluations),
        )
    };
    let (exact, covered, ..) = of("grid", 0);
    assert!((covered - 0.9).abs() < 0.07, "{covered}");
    let plain = of("bootstrap", 820);
    assert!(plain.2 < 0.1 * exact && (plain.0 / exact - 1.0).abs() < 0.02 && plain.4 == 820.0, "{plain:?}");
    let colony = of("abc-pf-40", 10);
    assert!(colony.1 < 0.01 && colony.3 < 0.05 && colony.0 > 1.5 * exact, "{colony:?}");
    let stretch = of("stretch-move", MOVED[1]);
    assert!((stretch.3 - 1.0).abs() < 0.05 && stretch.4 <= BUDGETS[1] as f64, "{stretch:?}");
    assert!((stretch.1 - covered).abs() < 0.07, "{stretch:?}");
    for (entrant, runs) in entrants.iter().zip(&runs) {
        assert!(runs.iter().all(|run| run.lost == 0 && run.rmse.is_finite()), "{}", entrant.name);
    }
}

/// Where models are right the normalised innovations squared are one on average, whatever their law: of 20
/// runs of 50 steps, five standard errors at a kurtosis of 10 are 5 sqrt(9 / 1000) = .5. Told a noise of 6
/// instead of 1e-5 they are less where the measurement is straight, told no noise of the motion that has a
/// mean more.
#[test]
fn innovations_tell_wrong_models() {
    let nis = |reading: &str, q: u32| {
        let reading = Reading::place(reading).unwrap();
        let all = experiment("misfit", 20, 5);
        let scene = Scene::Paper { reading, steps: 50, q, variants: false };
        let runs = all.compete(scene, 0..20, &|| false).unwrap().unwrap();
        runs.last().unwrap().iter().map(|run| run.nis.unwrap()).sum::<f64>() / 20.0
    };
    let (right, wrong, vague) = (nis("a", 1), nis("d", 1), nis("n", 6));
    assert!((right - 1.0).abs() < 0.5 && wrong > 1.5 && vague < right, "{right} {wrong} {vague}");
}

/// Scouts find no way back: with them the colony errs more, as the specification of the experiment has it.
#[test]
fn variants_differ() {
    let all = experiment("variants", 10, 1);
    let cell = all.cells()[0];
    let runs = all.work(&cell, &|| false).unwrap().unwrap();
    let entrants = cell.scene.entrants();
    let error = |name: &str| {
        let at = entrants.iter().position(|entrant| entrant.name == name).unwrap();
        runs[at].iter().map(|run| run.rmse).sum::<f64>() / 10.0
    };
    assert!(LIMIT > 0 && error("abc-pf-40-scouts") > 2.0 * error("abc-pf-40"));
    let errors: Vec<f64> = entrants.iter().map(|entrant| error(entrant.name)).collect();
    for (at, one) in errors.iter().enumerate() {
        assert!(!errors[..at].contains(one), "{}: no option may be without effect", entrants[at].name);
    }
}
