use super::{MetricInfo, check_order_and_cutoff, distances};
use crate::error::Result;
use zerre::math::assignment::{assign, pairs};

pub(super) const INFO: MetricInfo = MetricInfo {
    name: "gospa",
    about: "distance between the sets of tracks and of true objects, with its shares: place, missed, false",
    source: "Rahmathullah, Garcia-Fernandez and Svensson, FUSION 2017, doi:10.23919/ICIF.2017.8009645, alpha = 2",
    unit: "m",
};

/// A distance between two sets of points and what it is made of.
///
/// `distance^p = localisation^p + missed^p + false_tracks^p`: all four carry the unit of the points.
#[derive(Clone, Debug, PartialEq)]
pub struct Gospa {
    /// The metric.
    pub distance: f64,
    /// Share of the pairs: `(sum of their distances^p)^(1/p)`.
    pub localisation: f64,
    /// Share of true objects without an estimate: `(missed_count c^p / 2)^(1/p)`.
    pub missed: f64,
    /// Share of estimates without a true object: `(false_count c^p / 2)^(1/p)`.
    pub false_tracks: f64,
    /// How many true objects have no estimate.
    pub missed_count: usize,
    /// How many estimates have no true object.
    pub false_count: usize,
    /// Pairs closer than `c`: (index of the estimate, index of the true object).
    pub pairs: Vec<(usize, usize)>,
}

/// The generalised optimal sub-pattern assignment metric with alpha = 2, order `p` and cut-off distance `c`; the
/// assignment is exact. Either set may be empty.
///
/// # Errors
/// [`Error::OutOfRange`](crate::Error::OutOfRange) for `p < 1` or `c <= 0`, [`Error::Shape`](crate::Error::Shape)
/// and [`Error::NotFinite`](crate::Error::NotFinite) for points that cannot be compared.
pub fn gospa<E: AsRef<[f64]>, T: AsRef<[f64]>>(
    estimates: &[E],
    truth: &[T],
    p: f64,
    c: f64,
) -> Result<Gospa> {
    check_order_and_cutoff(p, c)?;
    let distance = distances(estimates, truth)?;
    // Relative to c every power stays in [0, 1]: no overflow for large p. A pair at c or beyond costs as much as a
    // missed and a false one together, so cutting there leaves the optimum of the definition.
    let cut: Vec<f64> = distance.iter().map(|d| (d / c).min(1.0).powf(p)).collect();
    let best = assign(&cut, estimates.len(), truth.len())?;
    let close: Vec<_> =
        pairs(&best.column_of_row).filter(|(e, t)| distance[e * truth.len() + t] < c).collect();
    let place: f64 = close.iter().map(|(e, t)| cut[e * truth.len() + t]).sum();
    let (missed_count, false_count) = (truth.len() - close.len(), estimates.len() - close.len());
    let length = |power: f64| c * power.powf(1.0 / p);
    let (missed, wrong) = (missed_count as f64 / 2.0, false_count as f64 / 2.0);
    Ok(Gospa {
        distance: length(place + missed + wrong),
        localisation: length(place),
        missed: length(missed),
        false_tracks: length(wrong),
        missed_count,
        false_count,
        pairs: close,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    const NONE: [[f64; 2]; 0] = [];

    /// Up to a dozen roundings of half an ulp, of powers, their sum and a root.
    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() <= 6.0 * f64::EPSILON * b.abs()
    }

    #[test]
    fn of_empty_sets() {
        let both = gospa(&NONE, &NONE, 2.0, 10.0).unwrap();
        assert_eq!((both.distance, both.pairs.len()), (0.0, 0));
        // n points against nothing: c (n / 2)^(1/p).
        let missed = gospa(&NONE, &[[0.0, 0.0]; 3], 2.0, 10.0).unwrap();
        assert!(close(missed.distance, 10.0 * 1.5_f64.sqrt()) && missed.missed == missed.distance);
        let wrong = gospa(&[[0.0, 0.0]; 3], &NONE, 2.0, 10.0).unwrap();
        assert_eq!(
            (wrong.distance, wrong.false_tracks, wrong.missed),
            (missed.distance, wrong.distance, 0.0)
        );
    }

    #[test]
    fn by_hand() {
        // One pair 3 apart, one true object without an estimate: 9 + 100 / 2 = 59.
        let found = gospa(&[[3.0, 0.0]], &[[50.0, 0.0], [0.0, 0.0]], 2.0, 10.0).unwrap();
        assert!(close(found.distance, 59.0_f64.sqrt()) && close(found.localisation, 3.0));
        assert!(close(found.missed, 50.0_f64.sqrt()) && found.false_tracks == 0.0);
        assert_eq!((found.missed_count, found.false_count, found.pairs), (1, 0, vec![(0, 1)]));
        // Beyond the cut-off the pair is a missed and a false one: 100 / 2 + 100 / 2.
        let far = gospa(&[[11.0, 0.0]], &[[0.0, 0.0]], 2.0, 10.0).unwrap();
        assert!(close(far.distance, 10.0) && far.localisation == 0.0 && far.pairs.is_empty());
        assert_eq!((far.missed_count, far.false_count), (1, 1));
    }

    #[test]
    fn the_nearest_pair_is_not_always_the_best() {
        // Greedy takes (1, 1.9) and leaves 0 - 10; the optimum pairs in order: 1.9 + 8.1 against 0.9 + 10.
        let found = gospa(&[[1.0], [10.0]], &[[0.0], [1.9]], 1.0, 100.0).unwrap();
        assert!(close(found.distance, 1.0 + 8.1), "{found:?}");
        assert_eq!(found.pairs, [(0, 0), (1, 1)]);
    }

    /// The definition: the least over every partial one-to-one pairing.
    fn by_definition(e: &[[f64; 2]], t: &[[f64; 2]], p: f64, c: f64) -> f64 {
        fn visit(
            e: &[[f64; 2]],
            t: &[[f64; 2]],
            used: &mut [bool],
            paired: usize,
            p: f64,
            c: f64,
            all: usize,
        ) -> f64 {
            let Some((first, rest)) = e.split_first() else {
                return c.powf(p) / 2.0 * (all - 2 * paired) as f64;
            };
            let mut best = visit(rest, t, used, paired, p, c, all);
            for i in 0..t.len() {
                if !used[i] {
                    used[i] = true;
                    let d = (first[0] - t[i][0]).hypot(first[1] - t[i][1]);
                    best = best.min(d.powf(p) + visit(rest, t, used, paired + 1, p, c, all));
                    used[i] = false;
                }
            }
            best
        }
        visit(e, t, &mut vec![false; t.len()], 0, p, c, e.len() + t.len()).powf(1.0 / p)
    }

    fn points() -> impl Strategy<Value = Vec<[f64; 2]>> {
        prop::collection::vec(prop::array::uniform2(-10.0..10.0), 0..5)
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(9),
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        #[test]
        fn is_its_definition_and_the_sum_of_its_shares(e in points(), t in points(), p in 1.0..3.0, c in 0.5..20.0) {
            let found = gospa(&e, &t, p, c).unwrap();
            // Sums of at most ten powers above zero, each good to a few eps, and a root: 20 eps of at most 60.
            let rounding = 20.0 * 60.0 * f64::EPSILON;
            prop_assert!((found.distance - by_definition(&e, &t, p, c)).abs() < rounding);
            let sum = found.localisation.powf(p) + found.missed.powf(p) + found.false_tracks.powf(p);
            prop_assert!((sum.powf(1.0 / p) - found.distance).abs() < rounding);
        }

        #[test]
        fn is_a_metric(a in points(), b in points(), d in points(), p in 1.0..3.0, c in 0.5..20.0) {
            let between = |x: &[[f64; 2]], y: &[[f64; 2]]| gospa(x, y, p, c).unwrap().distance;
            let rounding = 3.0 * 20.0 * 60.0 * f64::EPSILON;
            prop_assert_eq!(between(&a, &a), 0.0);
            prop_assert!((between(&a, &b) - between(&b, &a)).abs() < rounding);
            prop_assert!(between(&a, &d) <= between(&a, &b) + between(&b, &d) + rounding);
        }
    }

    #[test]
    fn refuses_bad_input() {
        assert!(matches!(gospa(&[[0.0]], &[[0.0]], 0.5, 1.0), Err(Error::OutOfRange { .. })));
        assert!(matches!(gospa(&[[0.0]], &[[0.0]], 2.0, 0.0), Err(Error::OutOfRange { .. })));
        assert!(matches!(gospa(&[vec![0.0]], &[vec![0.0, 1.0]], 2.0, 1.0), Err(Error::Shape { .. })));
        assert!(matches!(gospa(&[[f64::NAN]], &NONE, 2.0, 1.0), Err(Error::NotFinite { .. })));
    }
}
