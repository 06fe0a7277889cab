//! What the comparison of swarm filters assumes.

use super::reading::{Noise, Reading, Variance};
use zerre::filter::{Fitness, MovedWeights, Readings, SwarmEstimate};

/// The text of this file, so that a report can say by which settings, to the letter, it was made.
pub const SOURCE: &str = include_str!("settings.rs");

/// Runs of each cell.
pub const RUNS: usize = 200;
/// Runs of each cell of the short version.
pub const QUICK_RUNS: usize = 20;
/// Runs that are done together: what they share is computed once.
pub const TOGETHER: usize = 10;
/// Timed runs in each world of the honest table.
pub const TIMED: usize = 3;
/// Seed on which settings are chosen; reports use others.
pub const CHOICE_SEED: u64 = 1001;

/// Particles of the paper's filters; its colony and its swarm are as large.
pub const PARTICLES: usize = 10;
/// Lengths of a run in the paper's table.
pub const STEPS: [usize; 2] = [50, 100];
/// Measurement variances in the paper's table.
pub const VARIANCES: [u32; 3] = [1, 3, 6];
/// Variance of the measurement's noise as the paper writes it beside its model.
pub const TINY: f64 = 1e-5;
/// The paper's swarms do not leave the interval between minus this and this.
pub const REACH: f64 = 20.0;
/// The paper's number of cycles, or of iterations, read as such.
pub const CYCLES: u32 = 40;
/// Trials after which a food source is given up, where there are scouts.
pub const LIMIT: u32 = 60;

/// The paper's filters as they are taken: the swarm looks for the likelihood alone, "weights are normalised"
/// after it by weighing the particles where they are then, and their mean is the estimate.
pub const PLAIN: Readings = Readings {
    fitness: Fitness::Likelihood,
    weights: MovedWeights::Refit,
    estimate: SwarmEstimate::Mean,
    repetitions: 1,
};

/// What the paper may mean. It says neither how its gamma noise is parametrised nor what its variances are
/// of, and contradicts itself in both. `n` was found by trying all of these, and more, with many variants of
/// the filters, and taking the one nearest to the printed numbers: it is compatible with them, and not proved
/// by them.
pub const READINGS: [Reading; 12] = [
    reading("a", (Noise::Rate, Variance::Q), (Noise::Rate, Variance::Q)),
    reading("b", (Noise::Scale, Variance::Q), (Noise::Scale, Variance::Q)),
    reading("c", (Noise::Unit, Variance::Q), (Noise::Unit, Variance::Q)),
    reading("d", (Noise::Rate, Variance::Q), (Noise::Unit, Variance::Q)),
    reading("f", (Noise::Rate, Variance::Tiny), (Noise::Unit, Variance::Q)),
    reading("h", (Noise::Rate, Variance::Tiny), (Noise::Rate, Variance::Q)),
    reading("i", (Noise::Q, Variance::One), (Noise::Q, Variance::One)),
    reading("k", (Noise::Rate, Variance::Q), (Noise::Unit, Variance::One)),
    reading("n", (Noise::Scale, Variance::Tiny), (Noise::Scale, Variance::Q)),
    reading("o", (Noise::Rate, Variance::Tiny), (Noise::Unit, Variance::Tiny)),
    reading("p", (Noise::Rate, Variance::Tiny), (Noise::Q, Variance::One)),
    reading("s", (Noise::Rate, Variance::One), (Noise::Q, Variance::One)),
];

const fn reading(name: &'static str, drawn: (Noise, Variance), told: (Noise, Variance)) -> Reading {
    Reading { name, drawn, told }
}

/// The reading of table 1.
pub const MAIN: &str = "n";
/// Readings that show what swarms do where filters are told the truth, a wrong motion, and too much noise.
pub const MISFIT: [&str; 3] = ["a", "d", "n"];

/// A world of the honest table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct World {
    /// Its name in the list of worlds.
    pub name: &'static str,
    /// Its name in rows, ...
    pub row: &'static str,
    /// ... and the variance of its measurement.
    pub q: f64,
    /// Length of a run.
    pub steps: usize,
    /// Nodes of the exact filter.
    pub nodes: usize,
    /// Particles that sigma points guide, for each of the budgets: where points are drawn anew they cost
    /// more.
    pub guided: [usize; 2],
    /// Particles that a likelihood is tempered for, for each of the budgets: what one costs is found on the
    /// way.
    pub tempered: [usize; 2],
    /// Whether its measurement is that of the unscented particle filter's benchmark.
    pub is_benchmark: bool,
}

/// The worlds of the honest table.
pub const WORLDS: [World; 5] = [
    World {
        name: "growth-q1",
        row: "growth",
        q: 1.0,
        steps: 50,
        nodes: 500,
        guided: [10, 205],
        tempered: [26, 380],
        is_benchmark: true,
    },
    World {
        name: "growth-q3",
        row: "growth",
        q: 3.0,
        steps: 50,
        nodes: 500,
        guided: [10, 205],
        tempered: [29, 470],
        is_benchmark: true,
    },
    World {
        name: "growth-q6",
        row: "growth",
        q: 6.0,
        steps: 50,
        nodes: 500,
        guided: [10, 205],
        tempered: [31, 540],
        is_benchmark: true,
    },
    World {
        name: "ungm",
        row: "ungm",
        q: 1.0,
        steps: 50,
        nodes: 1000,
        guided: [10, 205],
        tempered: [17, 240],
        is_benchmark: false,
    },
    World {
        name: "upf",
        row: "upf",
        q: 1e-5,
        steps: 60,
        nodes: 600,
        guided: [6, 138],
        tempered: [6, 68],
        is_benchmark: true,
    },
];

/// Evaluations of the likelihood a step that sound filters may spend, the paper's sizes being the larger: 10
/// weights, 10 of the colony and 40 cycles of 20.
pub const BUDGETS: [usize; 2] = [40, 820];
/// Particles of the bootstrap filter, which is the yardstick, beside those.
pub const BOOTSTRAPS: [usize; 5] = [10, 30, 40, 100, 820];
/// Particles that are moved, for each of the budgets: each is weighed once and costs one more in every sweep.
pub const MOVED: [usize; 2] = [20, 100];
/// Moves after each part of a tempered likelihood; how many particles the budgets buy depends on the world.
pub const TEMPERED_SWEEPS: [u32; 2] = [1, 2];
/// Particles of the swarm that is a proposal, and its iterations. Of 40 x 18, 100 x 6, 160 x 3, 200 x 2 and
/// 270 x 1, of current and best positions and of bees, by 120 runs: few rounds of many do best, all but
/// equally.
pub const IMPORTANCE: [(usize, u32); 2] = [(13, 1), (200, 2)];
/// Particles of the filter that predicts measurements, by whose innovations the models are judged.
pub const JUDGE: usize = 820;

/// Probability of the intervals.
pub const COVERAGE: f64 = 0.9;
/// The run that is pictured, ...
pub const PICTURED: usize = 0;
/// ... and the variance of the paper's table that it has.
pub const PICTURED_VARIANCE: u32 = 1;
