//! Relatives of the Kalman filter for the list: cubature, ensembles, Gaussian sums.

use crate::list::{Class, Entry, Means, Sensor, UnderLaw, World};
use zerre::filter::{
    Correcting, Ensemble, EnsembleSettings, GaussianSum, Linear, SigmaPoints, SumSettings, Tangent, Unscented,
};

/// What an ensemble of n members may be off on average, times n.
///
/// A sample covariance of n members is unbiased, with E[dP B dP] = (P B P + tr(P B) P) / (n - 1) (Wishart).
/// In coordinates where the prior covariance is 1, the update by a measurement of M components acts through
/// a matrix U of rank M with eigenvalues in [0, 1). To second order in dP the posterior covariance 1 - U is
/// off by (1 - U)(U + tr U)(1 - U) / n, at most M / n of itself; the mean, whose whitened innovation is xi,
/// by (1 - U)(U + tr U) U^1/2 xi / n, at most |xi| (M + 1) / 2n posterior standard deviations; exp of the
/// log-evidence by sums of the same kind. Later updates shrink what earlier ones left. Over the eight
/// measurements of the script, M = 2, |xi| = sqrt(pi / 2) on average, that is 8 * 2 and 8 * 1.9, and 1 for
/// the divisor n of a cloud's covariance: 17. Products of errors of different steps are left out of this;
/// for them it is doubled, and rounded up.
const ENSEMBLE_BIAS: f64 = 40.0;

pub fn filters<H: Sensor>(world: &World<H>, means: &Means) -> Vec<Entry> {
    let &World { prior, motion, sensor } = world;
    let mut list = Vec::new();
    let mut add = |name: &str, class: Class, filter: Box<dyn UnderLaw>| {
        list.push(Entry { name: name.into(), class, filter });
    };
    let points = SigmaPoints::cubature();
    let settings = SumSettings::default();
    add("cubature", Class::Exact, Box::new(Unscented::new(motion, sensor, prior, points).unwrap()));
    let sum = GaussianSum::new(Tangent, motion, sensor, prior, settings).unwrap();
    add("gaussian sum, extended", Class::Exact, Box::new(sum));
    let sum = GaussianSum::new(points, motion, sensor, prior, settings).unwrap();
    add("gaussian sum, cubature", Class::Exact, Box::new(sum));
    // It refuses worlds that are not linear.
    if let Ok(sum) = GaussianSum::new(Linear, motion, sensor, prior, settings) {
        add("gaussian sum, kalman", Class::Exact, Box::new(sum));
    }
    for correcting in [Correcting::Perturbed, Correcting::SquareRoot] {
        let Means { particles, simd, ref threads } = *means;
        let threads = threads.clone();
        let settings =
            EnsembleSettings { members: particles, correcting, simd, threads, ..EnsembleSettings::default() };
        // It refuses ensembles that are too small.
        if let Ok(ensemble) = Ensemble::new(prior, motion, sensor, settings) {
            let class = Class::Approximate { bias: ENSEMBLE_BIAS };
            add(&format!("ensemble, {correcting:?}"), class, Box::new(ensemble));
        }
    }
    list
}
