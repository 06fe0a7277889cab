//! The page.
/// Where the numbers come from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Provenance {
    /// The command line.
    pub command: String,
}
