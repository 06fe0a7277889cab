//! The laws of the filters. `list.rs` names the filters; every law runs over the whole list and rejects an
//! implementation that is broken on purpose. A law is a function that says what is wrong.

mod bad_input;
mod consistency;
mod exact;
mod lanes_and_threads;
mod limits;
mod list;
mod list_deterministic;
mod list_guided;
mod list_latent;
mod list_modes_gaussian;
mod list_moves;
mod list_sizes;
mod no_allocation;
mod parity;
mod replay;
mod unbiased;
mod worlds;

/// Nothing, or the sentence that says how a law is broken.
type Verdict = Result<(), String>;

/// Panics with all complaints at once.
fn uphold(verdicts: impl IntoIterator<Item = (String, Verdict)>) {
    let broken: Vec<String> =
        verdicts.into_iter().filter_map(|(name, v)| v.err().map(|e| format!("{name}: {e}"))).collect();
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}
