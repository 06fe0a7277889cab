//! Experiments of published papers, done again: our numbers beside the printed ones.

pub mod bayes_family;
pub mod extended_target;
pub mod multi_ball;
pub mod multiple_model;
pub mod rgbd;
pub mod swarm;
pub mod video;

/// One paper, as lists show it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Paper {
    /// Name on the command line.
    pub name: &'static str,
    /// One line on what is compared.
    pub about: &'static str,
    /// The paper.
    pub source: &'static str,
    /// Tables that can be asked for singly.
    pub tables: &'static [&'static str],
    /// Tables that are computed only where they are asked for.
    pub on_request: &'static [&'static str],
}

/// The papers whose experiments are here.
pub const PAPERS: &[Paper] = &[
    multiple_model::PAPER,
    bayes_family::PAPER,
    extended_target::PAPER,
    swarm::PAPER,
    video::PAPER,
    multi_ball::PAPER,
    rgbd::PAPER,
];

/// With a capital letter.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
