//! Balls that were followed: scored against the truth, drawn, and on one page.

mod draw;
mod page;
mod score;

pub use draw::{BallScene, ShownBall};
pub use page::{Watched, page, points_csv};
pub use score::{BallScores, TruthTable, score};
