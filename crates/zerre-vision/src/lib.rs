//! Pictures and what moves in them: frames from folders and videos, the operators of image processing, and trackers that
//! answer with a posterior and not only with a box.
//!
//! A pixel (x, y) covers the square from (x, y) to (x + 1, y + 1): x to the right, y downwards, (0, 0) the upper left
//! corner of the picture. Lengths are pixels, times frames.

pub mod balls;
pub mod clip;
mod error;
pub mod frames;
pub mod image;
pub mod operator;
mod rect;
pub mod rgbd;
pub mod sequence;
mod texture;
pub mod tracker;

pub use error::{Error, Result};
pub use image::{Frame, Image};
pub use rect::Rect;
