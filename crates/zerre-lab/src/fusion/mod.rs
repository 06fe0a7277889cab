//! Points of a body followed through a recording of colour and depth, drawn, and on one page.

mod draw;
mod follow;
mod page;

pub use draw::{PointScene, ShownPoint};
pub use follow::{Clock, Follow, Preset, Row, Rules, Stopwatch};
pub use page::{Score, Watched, page, points_csv};
