//! What the search for a place where swarms pay assumes. It was fixed before the runs that are reported.

/// The text of this file, so that a report can say by which settings, to the letter, it was made.
pub const SOURCE: &str = include_str!("settings.rs");

/// Runs of each cell.
pub const RUNS: usize = 20;
/// Runs of each cell of the short version.
pub const QUICK_RUNS: usize = 10;
/// Runs that are done together: the trial runs are made again for each such lot.
pub const TOGETHER: usize = 10;
/// Seed of the runs that say how many particles a budget buys; other seeds are reported.
pub const CHOICE_SEED: u64 = 1001;
/// Runs of that seed.
pub const PILOTS: usize = 2;

/// Components of the state.
pub const DIMENSIONS: [usize; 3] = [4, 10, 20];
/// Standard deviation of the measurement, in those of the state.
pub const SHARPNESS: [f64; 4] = [1.0, 0.3, 0.1, 0.03];
/// Likelihood evaluations a step.
pub const BUDGETS: [usize; 2] = [1_000, 10_000];
/// Measurements of a run, one a second.
pub const STEPS: usize = 10;

/// What a component keeps of itself in a second; the rest is drawn anew, such that its variance stays 1.
pub const KEEP: f64 = 0.8;
/// Distance of the beacon that ranges are measured to from the middle of each plane: nearer than the state wanders,
/// so that what a range says is an arc.
pub const BEACON: f64 = 1.5;
/// Nodes of the exact filter along each axis of a plane.
pub const NODES: usize = 128;
/// Bees that propose: cycles. This, the iterations below and the world of exponentials were chosen on the seed of choice,
/// by a few runs that said how many rounds a swarm needs to come near a narrow likelihood.
pub const PROPOSING_CYCLES: u32 = 10;
/// A particle swarm that proposes: iterations, ...
pub const PROPOSING_ITERATIONS: u32 = 50;
/// ... what is kept of a velocity, and each of the two pulls: the constriction of Clerc and Kennedy (2002), with which
/// positions settle.
pub const INERTIA: f64 = 0.72;
/// ...
pub const PULL: f64 = 1.49;
/// A swarm move is said to pay, or not to, at this level, after Holm's correction over all cells and moves.
pub const LEVEL: f64 = 0.05;
