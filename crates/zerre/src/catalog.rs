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
    /// What the laws expect of it; `None` for models.
    pub class: Option<Class>,
}

/// How close to Bayes' rule a filter comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// The posterior itself, up to rounding, for the models that it takes.
    Exact,
    /// The posterior in the limit of many particles.
    Consistent,
    /// Near the posterior where the models are nearly linear.
    Approximate,
}

const fn entry(name: &'static str, about: &'static str, source: &'static str) -> Entry {
    Entry { name, about, source, class: None }
}

const fn classed(class: Class, name: &'static str, about: &'static str, source: &'static str) -> Entry {
    Entry { name, about, source, class: Some(class) }
}

/// The motion models of [`model::motion`](crate::model::motion).
pub const MOTIONS: &[Entry] = &[
    entry("random-walk", "position as Brownian motion", "Bar-Shalom, Li and Kirubarajan 2001, chapter 4"),
    entry("constant-velocity", "white-noise acceleration", "Bar-Shalom, Li and Kirubarajan 2001, 6.2.2"),
    entry(
        "constant-velocity-box",
        "white-noise acceleration of a box whose length, width and orientation wander",
        "Bar-Shalom, Li and Kirubarajan 2001, 6.2.2",
    ),
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

/// The motions of [`model::motion`](crate::model::motion) that [`track`](crate::track) does not make by name:
/// of one component, or of a benchmark.
pub const SERIES: &[Entry] = &[
    entry(
        "autoregressive",
        "a level that returns to its mean, per step",
        "Box, Jenkins and Reinsel 1994, chapter 3",
    ),
    entry(
        "discrete-velocity",
        "white acceleration that is constant over a step",
        "Bar-Shalom, Li and Kirubarajan 2001, 6.3.2",
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
    entry("box-size", "length, width and orientation of a box", "EUROCONTROL ASTERIX category 010, I010/270"),
    entry("linear", "any matrix with any covariance", "Kalman 1960"),
    entry("growth", "square of the state", "Gordon, Salmond and Smith 1993"),
    entry("upf-growth", "square first, straight later", "van der Merwe, Doucet, de Freitas and Wan 2000"),
    entry("stochastic-volatility", "a return whose log-variance is the state", "Taylor 1986"),
    entry("binomial-logit", "successes, the state being their log-odds", "Temereanca, Brown and Simons 2008"),
];

/// The filters of [`filter`](crate::filter), as [`track`](crate::track) makes them by name.
pub const FILTERS: &[Entry] = &[
    classed(Class::Exact, "kalman", "exact for linear motion and measurement, refuses others", "Kalman 1960"),
    classed(Class::Approximate, "ekf", "extended Kalman filter: tangents at the mean", "Jazwinski 1970"),
    classed(
        Class::Approximate,
        "ukf",
        "unscented Kalman filter: sigma points instead of tangents",
        "Julier and Uhlmann 2004",
    ),
    classed(
        Class::Approximate,
        "cubature",
        "cubature Kalman filter: 2 n sigma points of equal weight",
        "Arasaratnam and Haykin 2009",
    ),
    classed(
        Class::Approximate,
        "imm-kalman",
        "interacting multiple models: a Kalman filter in each mode, for manoeuvring targets",
        "Blom and Bar-Shalom 1988",
    ),
    classed(
        Class::Approximate,
        "imm-ekf",
        "interacting multiple models: an extended Kalman filter in each mode",
        "Blom and Bar-Shalom 1988",
    ),
    classed(
        Class::Approximate,
        "imm-ukf",
        "interacting multiple models: an unscented Kalman filter in each mode",
        "Blom and Bar-Shalom 1988",
    ),
    classed(
        Class::Approximate,
        "rb-mmpf",
        "Rao-Blackwellised: an unscented Kalman filter for each of many histories of modes",
        "Doucet, Gordon and Krishnamurthy 2001",
    ),
    classed(
        Class::Consistent,
        "mmpf",
        "multiple-model particle filter: every particle under every mode",
        "McGinnity and Irwin 2000",
    ),
    classed(
        Class::Consistent,
        "imm-pf",
        "IMM particle filter: as many particles in each mode, however rare",
        "Blom and Bloem 2003",
    ),
    classed(
        Class::Consistent,
        "particle",
        "particle filter with resampling (sequential importance resampling)",
        "Gordon, Salmond and Smith 1993",
    ),
    classed(Class::Consistent, "sir", "another name of `particle`", "Gordon, Salmond and Smith 1993"),
    classed(
        Class::Consistent,
        "sis",
        "particle filter that never resamples (sequential importance sampling)",
        "Handschin and Mayne 1969",
    ),
];

/// The filters of [`extended`](crate::extended), as [`track`](crate::track) makes them by name.
pub const EXTENDED_FILTERS: &[Entry] = &[
    classed(
        Class::Approximate,
        "window-vb",
        "a union of ellipses by variational expectation maximisation over a window of scans",
        "after Özkan 2019",
    ),
    classed(
        Class::Approximate,
        "random-matrix-koch",
        "one ellipse as a random matrix, the sensor's noise being part of it",
        "Koch 2008",
    ),
    classed(
        Class::Approximate,
        "random-matrix-feldmann",
        "one ellipse as a random matrix, apart from the sensor's noise",
        "Feldmann, Fränken and Koch 2011",
    ),
];

/// What a [`ParticleFilter`](crate::filter::ParticleFilter) proposes by: the kinds of [`proposal`](crate::proposal).
pub const PROPOSALS: &[Entry] = &[
    entry("bootstrap", "by the motion alone", "Gordon, Salmond and Smith 1993"),
    entry("ekf-guided", "by the tangent of the measurement", "Doucet, Godsill and Andrieu 2000"),
    entry(
        "ukf-guided",
        "by sigma points, iterated: the unscented particle filter",
        "van der Merwe, Doucet, de Freitas and Wan 2000",
    ),
    entry(
        "optimal",
        "by the exact posterior, refuses all but linear normal noise",
        "Doucet, Godsill and Andrieu 2000",
    ),
];

/// The resamplers of [`Resampling`](crate::resample::Resampling); each gives particle i on average n w_i copies.
pub const RESAMPLERS: &[Entry] = &[
    classed(Class::Consistent, "multinomial", "independent draws", "Gordon, Salmond and Smith 1993"),
    classed(Class::Consistent, "residual", "whole copies for sure, the rest drawn", "Liu and Chen 1998"),
    classed(Class::Consistent, "stratified", "one draw in each of n equal strata", "Kitagawa 1996"),
    classed(
        Class::Consistent,
        "systematic",
        "the same place in each of n equal strata: least work, small spread",
        "Carpenter, Clifford and Fearnhead 1999",
    ),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_kebab_case_and_unique() {
        for list in [MOTIONS, SERIES, MEASUREMENTS, FILTERS, EXTENDED_FILTERS, PROPOSALS, RESAMPLERS] {
            for (i, entry) in list.iter().enumerate() {
                assert!(entry.name.split('-').all(|word| !word.is_empty()), "{entry:?}");
                assert!(entry.name.bytes().all(|b| b.is_ascii_lowercase() || b == b'-'), "{entry:?}");
                assert!(!entry.about.is_empty() && !entry.source.is_empty(), "{entry:?}");
                assert!(list[..i].iter().all(|other| other.name != entry.name), "{entry:?}");
            }
        }
    }
}
