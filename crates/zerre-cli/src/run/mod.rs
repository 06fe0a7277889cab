//! What every command that computes needs: a folder, a record, a way to stop, and something to look at meanwhile.

mod folder;
mod interrupt;
mod progress;
mod record;

pub use folder::{Destination, Folder};
pub use interrupt::{interrupted, listen};
pub use progress::Progress;
pub use record::{
    Counts, EstimatesDigest, Hashing, Input, OutcomeCount, Record, State, config_digest, text_digest,
};
