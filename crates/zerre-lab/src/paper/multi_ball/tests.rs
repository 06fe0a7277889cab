use super::*;

fn experiment(tables: &[&'static str], runs: usize, particles: &[usize], seed: u64) -> MultiBall {
    let request = Request { tables: tables.iter().copied().collect(), runs, particles: particles.to_vec() };
    MultiBall::new(request, seed).unwrap()
}

fn rows(experiment: &MultiBall) -> Vec<Row> {
    let work = |cell: Cell| (cell, experiment.work(&cell, &|| false).unwrap().unwrap());
    let outcomes = experiment.cells().into_iter().map(work).collect();
    experiment.finish(&outcomes, None).unwrap().rows
}

#[test]
fn the_printed_table_is_whole() {
    let printed = Printed::read().unwrap();
    assert_eq!(printed.particles().len(), 11);
    for particles in printed.particles() {
        assert!(settings::BALLS.iter().all(|ball| printed.error(particles, ball).unwrap() > 0.0));
        assert!(printed.seconds(particles).unwrap() > 0.0);
    }
    assert!(printed.error(7, "green").is_none() && printed.error(5, "blue").is_none());
}

/// Goals of the linear-Gaussian version, for the filter that looks at the measurement with both motions, and for
/// the blind systematic one with the random walk: the ratio is a pooled one over 20 draws of three balls, and the
/// upper end of its interval has to be within the goal. What is above 1 falls with the number of particles, for
/// every filter and motion.
#[test]
fn particles_come_near_the_kalman_floor() {
    let all = rows(&experiment(&["floor"], 4, &[50, 250, 1000], 1));
    let ratio = |motion: &str, filter: &str, particles: usize| {
        let is = |row: &&Row| {
            (row.motion, row.filter, row.particles, row.metric) == (motion, filter, particles, "kalman_ratio")
        };
        all.iter().find(is).unwrap()
    };
    for motion in MOTIONS {
        for (filter, ..) in FILTERS {
            let of = [50, 250, 1000].map(|particles| ratio(motion, filter, particles).value);
            println!("{motion} {filter}: {of:?}");
            assert!(of[0] > of[1] && of[1] > of[2] && of[2] > 0.98, "{motion} {filter}: {of:?}");
        }
    }
    for (motion, filter) in
        [("random-walk", "systematic"), ("random-walk", "adapted"), ("constant-velocity", "adapted")]
    {
        let of = [250, 1000].map(|particles| ratio(motion, filter, particles));
        assert!(of[0].high <= 1.06 && of[1].high <= 1.02, "{of:?}");
    }
}

/// Another seed moves every number, the same one none; distances from the detection fall with the number of
/// particles (those from the truth have the noise of the detection in them, which no number takes away).
#[test]
fn the_table_is_computed() {
    let [one, again, other] = [3, 3, 4].map(|seed| rows(&experiment(&["3.1"], 2, &[50, 1000], seed)));
    assert_eq!(one, again);
    assert_eq!(one.len(), other.len());
    for (a, b) in one.iter().zip(&other) {
        assert_ne!(a.value, b.value, "{a:?}");
        assert_eq!(a.paper_value.is_some(), a.reference == "detection");
    }
    for few in one.iter().filter(|row| row.particles == 50 && row.reference == "detection") {
        let many = one.iter().find(|row| {
            (row.particles, row.ball, row.reading, row.reference)
                == (1000, few.ball, few.reading, few.reference)
        });
        assert!(many.unwrap().value < few.value, "{few:?}");
    }
}

#[test]
fn assignment_keeps_identities_that_sorting_areas_does_not() {
    let all = rows(&experiment(&["identity"], 2, &[5], 1));
    let swaps = |scene: &str, method: &str| {
        let is = |row: &&Row| (row.scene, row.method, row.metric) == (scene, method, "swaps");
        all.iter().find(is).unwrap().value
    };
    assert_eq!(swaps("balls-touch", "assignment"), 0.0);
    assert!(swaps("balls-touch", "area") > 1.0);
    assert!(swaps("balls-cross-grey", "area") > swaps("balls-cross-grey", "assignment"));
}
