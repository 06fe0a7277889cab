//! The inner loops: the only place with threads and `unsafe`. The scalar level is plain code, the naive twin of what
//! runs in lanes, and gives the same bits as every other level and any number of threads.
//!
//! Particles are processed in fixed blocks of [`BLOCK`]; sums are kept in eight lanes inside a block, folded in a
//! fixed order, and merged in the order of the blocks.

#[macro_use]
mod level;
mod ensemble;
mod lobes;
mod noise;
mod occupancy;
mod philox;
mod pool;
mod propagate;
mod propose;
mod resample;
mod score;
mod share;
mod transition;
mod weigh;

pub use level::Simd;
pub use noise::{Generator, NoiseSource, Resolution};
pub use pool::Threads;

pub(crate) use ensemble::{Correction, EnsembleSums, Reference, correct, ensemble_sums};
pub(crate) use lobes::{Lobe, MAX_LOBES, Shared, share_points};
pub(crate) use noise::{
    NoiseBlock, NoiseKey, exponentials, fill_gamma, fill_noise, fill_uniforms, to_exponentials,
};
pub(crate) use occupancy::{expected_occupied, log_absent};
pub(crate) use propagate::{Source, Survivors, draw_normal, gather, propagate};
pub(crate) use propose::{Propose, propose};
pub(crate) use resample::{
    Cumulative, Positions, checked_sum, expand_copies, fill_sorted, merge_sorted, prefix_sums, split_copies,
};
pub(crate) use score::score;
pub(crate) use share::{Carried, Inherited, MAX_CARRIED, carried_sums, share, share_drawn};
pub(crate) use transition::{add_log_transitions, centres, predict_density, transition_row};
pub(crate) use weigh::{BlockSums, Total, weigh};

/// Particles per block: small enough that states, noise and weights of a block stay in the first-level cache.
pub const BLOCK: usize = 512;

/// Particles per SIMD operation, on every level.
pub(crate) const LANES: usize = 8;
