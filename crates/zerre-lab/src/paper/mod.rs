//! Experiments of published papers, done again: our numbers beside the printed ones.

pub mod bayes_family;
pub mod extended_target;
pub mod multiple_model;

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
}

/// The papers whose experiments are here.
pub const PAPERS: &[Paper] = &[multiple_model::PAPER, bayes_family::PAPER, extended_target::PAPER];
