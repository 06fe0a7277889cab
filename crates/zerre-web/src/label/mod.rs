//! The labelling page: several operators mark the same points in the same frames, blind to each other.

mod pages;
mod store;

pub use pages::{Desk, Opened, Picture};
pub use store::{Answers, Appended, Operator, Store};

use serde::{Deserialize, Serialize};

/// Where a point is, px; `None` where it cannot be seen.
pub type Answer = Option<[f64; 2]>;

/// What is to be marked.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Job {
    /// What people call it.
    pub title: String,
    /// What tells its input from any other: a digest.
    pub input: String,
    /// Names of the points.
    pub points: Vec<String>,
    /// Names of the frames.
    pub frames: Vec<String>,
    /// Pixels across and down.
    pub size: [usize; 2],
}

impl Job {
    /// Why marks of this job are no marks of the other.
    pub fn difference(&self, other: &Job) -> Option<String> {
        let list = |points: &[String]| points.join(", ");
        if self.input != other.input {
            return Some(format!("its pictures are those of {}, or they have changed since", self.title));
        }
        if self.points != other.points {
            return Some(format!("its points are {}, not {}", list(&self.points), list(&other.points)));
        }
        if self.frames != other.frames || self.size != other.size {
            let [w, h] = self.size;
            return Some(format!("it has other frames, {} of {w} x {h} pixels", self.frames.len()));
        }
        None
    }
}

/// Something that an operator did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// The browser's name for it: sent twice, it counts once.
    pub id: String,
    /// What was done.
    #[serde(flatten)]
    pub what: What,
}

/// What an operator can do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum What {
    /// The point is here.
    Mark {
        /// Number of the frame.
        frame: usize,
        /// Number of the point.
        point: usize,
        /// Pixels to the right.
        x: f64,
        /// Pixels downwards.
        y: f64,
    },
    /// The point cannot be seen.
    Hidden {
        /// Number of the frame.
        frame: usize,
        /// Number of the point.
        point: usize,
    },
    /// An earlier event does not hold.
    Undo {
        /// Its name.
        undoes: String,
    },
}

/// Longest name of an event.
const LONGEST_ID: usize = 64;

impl Event {
    fn place(&self) -> Option<[f64; 2]> {
        match self.what {
            What::Mark { x, y, .. } => Some([x, y]),
            _ => None,
        }
    }

    /// Frame and point, if it is about any and fits the job.
    fn row(&self, job: &Job) -> Result<[Option<usize>; 2], String> {
        if self.id.is_empty() || self.id.len() > LONGEST_ID {
            return Err("it has no sound name".to_owned());
        }
        let (frame, point) = match self.what {
            What::Mark { frame, point, .. } | What::Hidden { frame, point } => (frame, point),
            What::Undo { .. } => return Ok([None; 2]),
        };
        if frame >= job.frames.len() || point >= job.points.len() {
            return Err("there is no such frame or point".to_owned());
        }
        let inside = |value: f64, size: usize| (0.0..=size as f64).contains(&value);
        if let Some([x, y]) = self.place()
            && !(inside(x, job.size[0]) && inside(y, job.size[1]))
        {
            return Err("it lies outside the picture".to_owned());
        }
        Ok([Some(frame), Some(point)])
    }
}

/// Longest name of an operator, characters.
const LONGEST_NAME: usize = 40;

/// A name as it is kept: without white space about it and with single spaces within.
///
/// # Errors
/// What is wrong with it, as a sentence.
pub fn name(text: &str) -> Result<String, String> {
    let name = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if name.is_empty() {
        return Err("Please give a name.".to_owned());
    }
    if name.chars().count() > LONGEST_NAME {
        return Err(format!("The name is too long: {LONGEST_NAME} characters are enough."));
    }
    // Names stand in tables: nothing that a spreadsheet takes for a formula or a separator.
    let sound = |c: char| c.is_alphanumeric() || " .-_'".contains(c);
    if !name.starts_with(char::is_alphanumeric) || !name.chars().all(sound) {
        return Err(
            "A name has letters, digits, spaces and . - _ ' and begins with a letter or a digit.".to_owned()
        );
    }
    Ok(name)
}
