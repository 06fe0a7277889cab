//! What keeps a page from being served.

use std::io;
use std::path::PathBuf;

/// Result of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A refusal.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A port that cannot be listened on.
    #[error("cannot listen on port {port} of this machine: {source}")]
    Port {
        /// The port; 0 is any.
        port: u16,
        /// What the system says.
        source: io::Error,
    },
    /// A server that cannot run.
    #[error("the page cannot be served: {0}")]
    Server(#[from] io::Error),
    /// The system gives no random numbers.
    #[error("the system gives no random numbers: {0}")]
    Random(String),
    /// The file with the marks cannot be read or written.
    #[error("{}: {problem}", path.display())]
    Store {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// The file holds the marks of another job.
    #[error("{} holds the marks of another job: {difference}", path.display())]
    OtherJob {
        /// The file.
        path: PathBuf,
        /// What differs.
        difference: String,
    },
}
