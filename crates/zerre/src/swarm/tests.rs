//! Swarms find what they look for, count what they ask, and stay where they are told to.

use super::*;
use crate::rng::Purpose;
use std::sync::atomic::{AtomicUsize, Ordering};

/// -|x - goal|^2 in three components; counts what it is asked.
struct Bowl {
    goal: [f64; 3],
    asked: AtomicUsize,
}

impl Law<3> for Bowl {
    fn log_density(&self, _: usize, states: &[&[f64]; 3], out: &mut [f64]) {
        self.asked.fetch_add(out.len(), Ordering::Relaxed);
        for (i, out) in out.iter_mut().enumerate() {
            *out = -(0..3).map(|k| (states[k][i] - self.goal[k]).powi(2)).sum::<f64>();
        }
    }
}

/// The points in the end, their fitness, and what was found.
fn search(swarm: &Swarm<3>, goal: [f64; 3], n: usize) -> ([Vec<f64>; 3], Vec<f64>, Found<3>) {
    let law = Bowl { goal, asked: AtomicUsize::new(0) };
    let mut draws = Stream::new(1).draws(Purpose::Other, 0, 0);
    let mut states: [Vec<f64>; 3] = from_fn(|_| (0..n).map(|_| 2.0 * draws.normal()).collect());
    let mut fitness = vec![0.0; n];
    let mut memory = Memory::default();
    let search =
        Search { law: &law, stream: Stream::new(2), step: 3, simd: Simd::best(), memory: &mut memory };
    let found = swarm.search(&mut states, &mut fitness, search);
    assert_eq!(found.evaluations, law.asked.load(Ordering::Relaxed));
    let mut again = vec![0.0; n];
    law.log_density(0, &states.each_ref().map(Vec::as_slice), &mut again);
    assert_eq!(fitness, again, "{swarm:?}");
    (states, fitness, found)
}

fn bees(cycles: u32) -> BeeColony<3> {
    BeeColony { cycles, ..BeeColony::default() }
}

/// Greedy searches on a bowl come as near as their contraction lets them: a swarm that worked at random would
/// stay at the distance of about 1 that the best of 20 points has from the goal.
#[test]
fn swarms_find_the_maximum() {
    let goal = [1.0, -0.5, 0.3];
    let settled = ParticleSwarm {
        iterations: 100,
        inertia: 0.7,
        cognitive: 1.4,
        social: 1.4,
        positions: Positions::PersonalBest,
        bounds: None,
    };
    let all = Coordinates::All;
    for swarm in [
        Swarm::Particles(settled),
        Swarm::Bees(bees(100)),
        Swarm::Bees(BeeColony { coordinates: all, roulette: Roulette::CostRatio, ..bees(100) }),
    ] {
        let (states, fitness, found) = search(&swarm, goal, 20);
        assert_eq!(found.evaluations, swarm.evaluations(20));
        assert!(found.fitness > -1e-4, "{swarm:?} {found:?}");
        assert!(fitness.iter().all(|fit| *fit <= found.fitness));
        assert!((0..3).all(|k| (found.best[k] - goal[k]).abs() < 1e-2));
        assert!(states[0].iter().all(|x| (x - goal[0]).abs() < 0.1), "{swarm:?}: all have come");
    }
}

/// With w = 1, c1 = 1.5 and c2 = 2 positions spread (Poli 2009) while the best places close in.
#[test]
fn the_papers_weights_scatter_the_swarm() {
    let swarm = |iterations, positions| {
        Swarm::Particles(ParticleSwarm { iterations, positions, ..ParticleSwarm::default() })
    };
    let worst = |swarm: &Swarm<3>| search(swarm, [0.0; 3], 20).1.into_iter().fold(0.0, f64::min);
    assert!(worst(&swarm(60, Positions::Current)) < 100.0 * worst(&swarm(1, Positions::Current)));
    assert!(worst(&swarm(60, Positions::PersonalBest)) >= worst(&swarm(1, Positions::PersonalBest)));
}

#[test]
fn one_cycle_is_what_it_says() {
    // One point has nobody to learn from.
    let (states, _, found) = search(&Swarm::Bees(bees(5)), [0.0; 3], 1);
    assert_eq!((states[0].len(), found.evaluations), (1, 1));
    let (alone, _, _) = search(&Swarm::Particles(ParticleSwarm::default()), [0.0; 3], 1);
    assert_eq!(alone, states, "its own best and that of all are where it is");
    // No iterations move nothing.
    let (still, ..) = search(&Swarm::Bees(bees(0)), [0.0; 3], 9);
    let (same, ..) =
        search(&Swarm::Particles(ParticleSwarm { iterations: 0, ..Default::default() }), [0.0; 3], 9);
    assert_eq!(still, same);
    // A bee that changes one component leaves the others: after one cycle each point has moved in two at most.
    let (moved, ..) = search(&Swarm::Bees(bees(1)), [0.0; 3], 9);
    let changed = |i: usize| (0..3).filter(|&k| moved[k][i] != still[k][i]).count();
    assert!((0..9).any(|i| changed(i) == 1));
}

#[test]
fn bounds_hold_and_scouts_look_within_them() {
    // The points start inside.
    let bounds = Some(Bounds::cube(-8.0, 8.0));
    let goal = [30.0, 30.0, -30.0];
    for swarm in [
        Swarm::Particles(ParticleSwarm { iterations: 40, bounds, ..ParticleSwarm::default() }),
        Swarm::Bees(BeeColony { bounds, limit: Some(3), ..bees(80) }),
    ] {
        let (states, _, found) = search(&swarm, goal, 12);
        assert!(states.iter().flatten().all(|x| x.abs() <= 8.0), "{swarm:?}");
        assert!((0..3).all(|k| found.best[k] == goal[k].signum() * 8.0), "{found:?}");
    }
    // Scouts ask once each beyond the two of every cycle.
    let patient = search(&Swarm::Bees(BeeColony { bounds, ..bees(50) }), goal, 12).2.evaluations;
    let restless =
        search(&Swarm::Bees(BeeColony { bounds, limit: Some(3), ..bees(50) }), goal, 12).2.evaluations;
    assert!(restless > patient);
}

/// Fitness that is nowhere: the roulette has nothing to go by, and nothing moves.
#[test]
fn a_fitness_of_zero_everywhere_moves_nothing() {
    struct Nowhere;
    impl Law<3> for Nowhere {
        fn log_density(&self, _: usize, _: &[&[f64]; 3], out: &mut [f64]) {
            out.fill(f64::NEG_INFINITY);
        }
    }
    for roulette in [Roulette::Fitness, Roulette::CostRatio] {
        let colony = Swarm::Bees(BeeColony { roulette, ..bees(4) });
        let mut states: [Vec<f64>; 3] = from_fn(|k| (0..6).map(|i| (i * k) as f64).collect());
        let before = states.clone();
        let mut fitness = vec![0.0; 6];
        let mut memory = colony.memory(6);
        let search = Search {
            law: &Nowhere,
            stream: Stream::new(2),
            step: 0,
            simd: Simd::best(),
            memory: &mut memory,
        };
        let found = colony.search(&mut states, &mut fitness, search);
        assert_eq!((states, found.fitness), (before, f64::NEG_INFINITY));
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    let refused = |swarm: Swarm<3>| swarm.check().unwrap_err().to_string();
    assert!(refused(Swarm::Bees(BeeColony { limit: Some(5), ..bees(1) })).contains("bounds"));
    let inside_out = Some(Bounds::cube(1.0, -1.0));
    assert!(refused(Swarm::Bees(BeeColony { bounds: inside_out, ..bees(1) })).contains("upper bound"));
    let swarm = ParticleSwarm { inertia: f64::NAN, ..ParticleSwarm::default() };
    assert!(refused(Swarm::Particles(swarm)).contains("inertia"));
    let endless = Some(Bounds::cube(f64::NEG_INFINITY, 0.0));
    assert!(refused(Swarm::Particles(ParticleSwarm { bounds: endless, ..swarm })).len() > 10);
}
