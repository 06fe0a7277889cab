//! What the comparison of the Bayesian family assumes.

/// The text of this file, so that a report can say by which settings, to the letter, it was made.
pub const SOURCE: &str = include_str!("settings.rs");

/// Runs of each cell.
pub const RUNS: usize = 200;
/// Runs of each cell of the short version.
pub const QUICK_RUNS: usize = 20;
/// Likelihood evaluations a step that filters with particles may spend.
pub const BUDGETS: [usize; 2] = [40, 820];
/// Filters with a number of particles of their own in a world, beside the budgets.
pub const ALSO: [(&str, &str, usize); 1] = [("upf", "ukf-guided", 200)];

/// Seed on which settings are chosen; reports use others.
pub const CHOICE_SEED: u64 = 1001;

/// The worlds, in the order of the tables.
pub const WORLDS: [&str; 8] =
    ["linear", "growth-q1", "growth-q3", "growth-q6", "ungm", "upf", "bearings-only", "outliers"];

/// What the others are measured against in each world, with its particles (nodes): the exact filter where
/// there is one, else more particles than anybody would spend.
pub const TRUTHS: [(&str, &str, usize); 8] = [
    ("linear", "kalman", 0),
    ("growth-q1", "grid", 500),
    ("growth-q3", "grid", 500),
    ("growth-q6", "grid", 500),
    ("ungm", "grid", 1000),
    ("upf", "grid", 1000),
    ("bearings-only", "bootstrap", 200_000),
    ("outliers", "grid", 500),
];

/// Where the truth is a filter with random numbers, another that shows how well it is known.
pub const CHECKS: [(&str, &str, usize); 1] = [("bearings-only", "ekf-guided", 60_000)];

/// A filter counts as being as good as the truth up to this ratio of errors and of scores, ...
pub const AS_GOOD: f64 = 1.02;
/// ... where its central 90 % intervals cover as often, up to this share, ...
pub const AS_HONEST: f64 = 0.02;
/// ... and as not to be taken from this share of failed runs on.
pub const BROKEN: f64 = 0.05;
/// A run has failed where one step in ten errs by more than so many standard deviations of the truth's
/// posterior.
pub const LOST_SDS: f64 = 10.0;
/// ... or where its log-evidence lies more nats than this below the truth's, summed over the run: particles that
/// have died out coast by the motion, near to where the truth may well be, and call every measurement impossible.
pub const LOST_NATS: f64 = 30.0;
/// One run in so many is timed, at least three.
pub const TIMED: usize = 20;
