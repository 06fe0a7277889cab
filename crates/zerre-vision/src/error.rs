//! What can go wrong with pictures, and how to mend it.

use crate::Rect;
use std::path::PathBuf;

/// Result of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A refusal. What a tracker survives (an object that is lost, a frame that cannot be read) is not one: it is counted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Pixels that are no picture of this size.
    #[error("{found} pixels do not make a picture of {width} x {height}")]
    Pixels {
        /// How many there are.
        found: usize,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// Pictures that should be of one size.
    #[error("a picture of {} x {} where {} x {} is needed", found.0, found.1, expected.0, expected.1)]
    Size {
        /// Width and height found.
        found: (usize, usize),
        /// Width and height needed.
        expected: (usize, usize),
    },
    /// A box that no object can be in.
    #[error("the box {bounds} {problem}")]
    Bounds {
        /// The box.
        bounds: Rect,
        /// What is wrong with it, and what would be right.
        problem: String,
    },
    /// A parameter outside its range.
    #[error("{what} is {value}: {needs}")]
    OutOfRange {
        /// What the number stands for.
        what: &'static str,
        /// The number.
        value: f64,
        /// The range, as a sentence.
        needs: &'static str,
    },
    /// A file that is no picture, or one that ends early.
    #[error("{}: {problem}", path.display())]
    Picture {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, and how to mend it.
        problem: String,
    },
    /// A folder, a video, a camera or a stream that gives no frames, or fewer than it should.
    #[error("{input}: {problem}")]
    Input {
        /// The folder, the file or the address.
        input: String,
        /// What is wrong with it, and how to mend it.
        problem: String,
    },
    /// A line of an annotation that is no box.
    #[error("{}, line {line}: {problem}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong with it, with the value.
        problem: String,
    },
    /// What a filter refuses.
    #[error(transparent)]
    Filter(#[from] zerre::Error),
}
