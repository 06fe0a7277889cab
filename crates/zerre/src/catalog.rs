//! The lists of what there is: every surface that names models takes the names from here.

/// One entry of a list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Its name in configurations, in kebab case.
    pub name: &'static str,
    /// What it is, in one line.
    pub about: &'static str,
    /// Where it comes from.
    pub source: &'static str,
}

const fn entry(name: &'static str, about: &'static str, source: &'static str) -> Entry {
    Entry { name, about, source }
}

/// The motion models of [`model::motion`](crate::model::motion).
pub const MOTIONS: &[Entry] = &[
    entry("random-walk", "position as Brownian motion", "Bar-Shalom, Li and Kirubarajan 2001, chapter 4"),
    entry("constant-velocity", "white-noise acceleration", "Bar-Shalom, Li and Kirubarajan 2001, 6.2.2"),
    entry("constant-acceleration", "white-noise jerk", "Bar-Shalom, Li and Kirubarajan 2001, 6.2.3"),
    entry(
        "wiener-acceleration",
        "acceleration that jumps once per step",
        "Bar-Shalom, Li and Kirubarajan 2001, 6.3.3",
    ),
    entry("singer", "acceleration that decays and is renewed", "Singer 1970"),
    entry("coordinated-turn", "turn at a known rate", "Li and Jilkov 2003, V.A"),
    entry(
        "manoeuvre-turn",
        "turn at a known lateral acceleration",
        "Ristic, Arulampalam and Gordon 2004, chapter 6",
    ),
    entry(
        "wiener-turn",
        "turn at an unknown rate that wanders",
        "Bar-Shalom, Li and Kirubarajan 2001, 11.7.2",
    ),
    entry("markov-turn", "turn at an unknown rate that decays", "Li and Jilkov 2003, V.B"),
    entry("growth", "univariate growth with two modes", "Gordon, Salmond and Smith 1993"),
    entry(
        "upf-growth",
        "univariate growth with gamma noise",
        "van der Merwe, Doucet, de Freitas and Wan 2000",
    ),
];

/// The measurement models of [`model::measurement`](crate::model::measurement).
pub const MEASUREMENTS: &[Entry] = &[
    entry("position", "position with independent noise", "Bar-Shalom, Li and Kirubarajan 2001, chapter 6"),
    entry(
        "range-bearing",
        "distance and direction in the plane",
        "Bar-Shalom, Li and Kirubarajan 2001, chapter 10",
    ),
    entry(
        "range-bearing-elevation",
        "distance and direction in space",
        "Bar-Shalom, Li and Kirubarajan 2001, chapter 10",
    ),
    entry("bearing", "direction in the plane", "Ristic, Arulampalam and Gordon 2004, chapter 6"),
    entry("range", "distance", "Ristic, Arulampalam and Gordon 2004, chapter 7"),
    entry("range-rate", "speed along the line of sight", "Bar-Shalom, Li and Kirubarajan 2001, chapter 10"),
    entry("linear", "any matrix with any covariance", "Kalman 1960"),
    entry("growth", "square of the state", "Gordon, Salmond and Smith 1993"),
    entry("upf-growth", "square first, straight later", "van der Merwe, Doucet, de Freitas and Wan 2000"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_kebab_case_and_unique() {
        for list in [MOTIONS, MEASUREMENTS] {
            for (i, entry) in list.iter().enumerate() {
                assert!(entry.name.split('-').all(|word| !word.is_empty()), "{entry:?}");
                assert!(entry.name.bytes().all(|b| b.is_ascii_lowercase() || b == b'-'), "{entry:?}");
                assert!(!entry.about.is_empty() && !entry.source.is_empty(), "{entry:?}");
                assert!(list[..i].iter().all(|other| other.name != entry.name), "{entry:?}");
            }
        }
    }
}
