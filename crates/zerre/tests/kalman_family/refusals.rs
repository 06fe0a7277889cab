//! Gates, degeneracy, robust models, bad input, replay.

use crate::models::{Glide, Growth, Level, Polar, Rows, Wobble, direct, positions};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use zerre::belief::{Gaussian, GaussianBelief};
use zerre::filter::{Extended, Filter, Kalman, Outcome, SigmaPoints, Unscented};
use zerre::math::{Cholesky, Matrix, chi_square};
use zerre::model::measurement::{HeavyTailed, Position};
use zerre::rng::Stream;
use zerre::{Error, Time};

fn start<F: Filter>(filter: &F) -> F::Belief {
    filter.start(Time::ZERO, Stream::new(0)).unwrap()
}

fn wide() -> Gaussian<4> {
    Gaussian::independent([0.0; 4], [10.0, 1.0, 10.0, 1.0]).unwrap()
}

#[test]
fn innovations_take_the_short_way_round() {
    let prior = Gaussian::independent([-1000.0, 0.0, 10.0, 0.0], [10.0, 1.0, 10.0, 1.0]).unwrap();
    let z = [1000.0, -0.01 - std::f64::consts::PI + 0.02];
    let right = Polar::<true> { range_sd: 1.0, bearing_sd: 0.01 };
    let unscented = Unscented::new(Glide(1.0), right, prior, SigmaPoints::default()).unwrap();
    for (posterior, _) in [
        Extended::new(Glide(1.0), right, prior).update(&prior, &z, Time::ZERO).unwrap(),
        unscented.update(&prior, &z, Time::ZERO).unwrap(),
    ] {
        // Predicted at pi - 0.01 and seen at -pi + 0.01, equally sure: halfway, on the axis.
        assert!(posterior.mean()[2].abs() < 0.1, "{posterior:?}");
    }
    let wrong = Polar::<false> { range_sd: 1.0, bearing_sd: 0.01 };
    let (posterior, _) = Extended::new(Glide(1.0), wrong, prior).update(&prior, &z, Time::ZERO).unwrap();
    assert!(posterior.mean()[2] > 1000.0);
}

#[test]
fn the_gate_is_a_quantile() {
    let prior = Gaussian::new([0.0], Matrix([[3.0]])).unwrap();
    let filter = Kalman::new(Level(0.0), direct(1.0), prior).unwrap().with_gate(0.99).unwrap();
    let border = 2.0 * chi_square::quantile(0.99, 1).unwrap().sqrt();
    for (z, outcome) in [(border - 1e-9, Outcome::Updated), (border + 1e-9, Outcome::Gated)] {
        let mut belief = start(&filter);
        let update = filter.step(&mut belief, Time::from_secs(1.0), Some(&[z])).unwrap();
        assert_eq!(update.outcome, outcome);
        assert!(
            (update.log_evidence - Gaussian::new([0.0], Matrix([[4.0]])).unwrap().log_density(&[z]).unwrap())
                .abs()
                < 1e-14
        );
        assert_eq!(belief.time, Time::from_secs(1.0));
        assert_eq!(belief.state == prior, outcome == Outcome::Gated);
    }
    for bad in [0.0, 1.0, -0.5, f64::NAN] {
        assert!(Kalman::new(Level(0.0), direct(1.0), prior).unwrap().with_gate(bad).is_err(), "{bad}");
    }
}

#[test]
fn what_no_gaussian_explains_is_degenerate() {
    fn degenerate<F>(filter: &F, z: &F::Measurement)
    where
        F: Filter<Belief = GaussianBelief<1>>,
        F::Measurement: Sized,
    {
        let mut belief = start(filter);
        let mut predicted = belief;
        let to = Time::from_secs(1.0);
        filter.step(&mut predicted, to, None).unwrap();
        let update = filter.step(&mut belief, to, Some(z)).unwrap();
        assert_eq!((update.outcome, update.log_evidence), (Outcome::Degenerate, f64::NEG_INFINITY));
        assert_eq!(belief, predicted);
    }
    let known = Gaussian::new([1.0], Matrix([[0.0]])).unwrap();
    degenerate(&Kalman::new(Level(0.0), direct(0.0), known).unwrap(), &[1.0]);
    let prior = Gaussian::new([1.0], Matrix([[1.0]])).unwrap();
    degenerate(&Kalman::new(Level(1.0), direct(1.0), prior).unwrap(), &[1e200]);
    degenerate(&Kalman::new(Level(1.0), direct(-5.0), prior).unwrap(), &[1.0]);

    // A target where the sensor stands has no tangent: the derivative of its range is 0 / 0.
    let sensor = Polar::<true> { range_sd: 1.0, bearing_sd: 0.1 };
    let filter = Extended::new(Glide(1.0), sensor, wide());
    let (state, update) = filter.update(&wide(), &[1.0, 0.0], Time::ZERO).unwrap();
    assert_eq!((state, update.outcome), (wide(), Outcome::Degenerate));
}

#[test]
fn bad_input_leaves_the_belief_alone() {
    let filter = Kalman::new(Glide(1.0), positions(1.0), wide()).unwrap();
    let mut belief = start(&filter);
    filter.step(&mut belief, Time::from_secs(5.0), Some(&[1.0, 2.0])).unwrap();
    let before = belief;
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let refusal = filter.step(&mut belief, Time::from_secs(6.0), Some(&[0.0, bad]));
        assert!(matches!(refusal, Err(Error::NotFinite { .. })));
        assert_eq!(belief, before);
    }
    let refusal = filter.step(&mut belief, Time::from_secs(4.0), Some(&[0.0, 0.0]));
    assert_eq!(refusal, Err(Error::OutOfOrder { from: Time::from_secs(5.0), to: Time::from_secs(4.0) }));
    assert_eq!(belief, before);

    // No time, no motion; no measurement, no evidence.
    let update = filter.step(&mut belief, Time::from_secs(5.0), None).unwrap();
    assert_eq!((update.outcome, update.log_evidence, belief), (Outcome::Predicted, 0.0, before));

    // A model without the check of its own: the filter still refuses.
    let polar = Extended::new(Glide(1.0), Polar::<true> { range_sd: 1.0, bearing_sd: 0.1 }, wide());
    let refusal = polar.update(&wide(), &[f64::NAN, 0.0], Time::ZERO);
    assert!(matches!(refusal, Err(Error::NotFinite { what: "measurement", .. })));
}

#[test]
fn the_kalman_filter_is_exact_or_refuses() {
    let prior = Gaussian::new([0.0], Matrix([[1.0]])).unwrap();
    let refused = |message: &str| message.contains("exact for linear normal models only");
    let unsupported = |e: Error| matches!(e, Error::Unsupported(m) if refused(&m));
    let wobble = Kalman::new(Wobble, direct(1.0), prior).unwrap();
    assert!(unsupported(wobble.step(&mut start(&wobble), Time::from_secs(1.0), None).unwrap_err()));
    assert!(unsupported(Kalman::new(Growth { shape: 2.0 }, direct(1.0), prior).unwrap_err()));
    assert!(unsupported(Kalman::new(Level(1.0), student(4.0), prior).unwrap_err()));
    let angles = Polar::<true> { range_sd: 1.0, bearing_sd: 0.1 };
    assert!(unsupported(Kalman::new(Glide(1.0), angles, wide()).unwrap_err()));
    let curved = Polar::<false> { range_sd: 1.0, bearing_sd: 0.1 };
    assert!(unsupported(Kalman::new(Glide(1.0), curved, wide()).unwrap_err()));
}

fn student(dof: f64) -> HeavyTailed<Position<1>, 1> {
    HeavyTailed::student_t(Position::new(1.0).unwrap(), dof).unwrap()
}

/// A known state leaves nothing to approximate: the evidence is the t density.
#[test]
fn evidence_of_robust_noise_at_a_known_state() {
    let known = Gaussian::new([0.0], Matrix([[0.0]])).unwrap();
    let filter = Extended::new(Level(1.0), student(4.0), known);
    for z in [0.0, 0.7, 3.0, -30.0] {
        let (posterior, update) = filter.update(&known, &[z], Time::ZERO).unwrap();
        // Gamma(5/2) / (sqrt(4 pi) Gamma(2)) = 3/8.
        let density = (3.0 / 8.0) * (1.0 + z * z / 4.0).powf(-2.5);
        assert!((update.log_evidence - density.ln()).abs() < 1e-12, "{z}");
        assert_eq!((posterior, update.outcome), (known, Outcome::Updated));
    }
}

/// Against the posterior by quadrature: 40 000 trapezoids of a smooth integrand that vanishes at both ends. The
/// approximation is off most in between, where the value may be ordinary or wild: by 0.21 in mean and 0.20 in
/// log-evidence among these (the standard deviations are 0.9 to 1.8); a quarter is the bound held here.
#[test]
fn robust_noise_beside_the_exact_posterior() {
    let prior = Gaussian::new([0.0], Matrix([[3.0]])).unwrap();
    let filter = Extended::new(Level(1.0), student(4.0), prior);
    let normal = Extended::new(Level(1.0), direct(1.0), prior);
    for z in [0.0, 1.0, 3.0, 10.0, 20.0, 40.0] {
        let (mut mass, mut first) = (0.0, 0.0);
        let step = 1e-3;
        for i in -20_000..=20_000 {
            let x = f64::from(i) * step;
            let t = (3.0 / 8.0) * (1.0 + (z - x) * (z - x) / 4.0).powf(-2.5);
            let p = t * (-x * x / 6.0).exp() / (std::f64::consts::TAU * 3.0).sqrt() * step;
            mass += p;
            first += p * x;
        }
        let (found, update) = filter.update(&prior, &[z], Time::ZERO).unwrap();
        let error = update.log_evidence - mass.ln();
        assert!(error.abs() < 0.25, "{z}: {error}");
        assert!((found.mean()[0] - first / mass).abs() < 0.25, "{z}: {found:?}");
        if z >= 10.0 {
            let (trusting, trusted) = normal.update(&prior, &[z], Time::ZERO).unwrap();
            assert!(trusting.mean()[0] > 7.0 && trusted.log_evidence < mass.ln() - 3.0);
        }
    }
    // The gate sees the nominal noise.
    let gated = filter.with_gate(0.999).unwrap().update(&prior, &[40.0], Time::ZERO).unwrap();
    assert_eq!((gated.0, gated.1.outcome), (prior, Outcome::Gated));
}

#[test]
fn a_saved_belief_continues_to_the_same_bits() {
    let sensor = Polar::<true> { range_sd: 1.0, bearing_sd: 0.01 };
    let prior = Gaussian::independent([100.0, 1.0, 50.0, -1.0], [10.0, 1.0, 10.0, 1.0]).unwrap();
    let filter = Unscented::new(Glide(0.3), sensor, prior, SigmaPoints::default()).unwrap();
    let z = |k: u32| [110.0 + f64::from(k).sin(), 0.45 + 0.01 * f64::from(k).cos()];
    let mut belief = start(&filter);
    for k in 1..20 {
        let text = serde_json::to_string(&belief).unwrap();
        let mut loaded: GaussianBelief<4> = serde_json::from_str(&text).unwrap();
        let to = Time::from_secs(0.37 * f64::from(k));
        let continued = filter.step(&mut loaded, to, Some(&z(k))).unwrap();
        assert_eq!(filter.step(&mut belief, to, Some(&z(k))).unwrap(), continued);
        assert_eq!(loaded, belief);
    }
}

fn matrix<const R: usize, const C: usize>(
    range: std::ops::Range<f64>,
) -> impl Strategy<Value = Matrix<R, C>> {
    prop::collection::vec(range, R * C).prop_map(|v| Matrix::from_entries(|i, j| v[C * i + j]))
}

proptest! {
    #![proptest_config(ProptestConfig {
        rng_seed: RngSeed::Fixed(7),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    /// A linear measurement never makes a Gaussian wider: prior minus posterior is positive semidefinite. Variances
    /// are below 16 and the gains below 4 * 16 / 0.01: roundings are below 1e-10.
    #[test]
    fn updates_never_widen(b in matrix::<4, 4>(-2.0..2.0), h in matrix::<2, 4>(-2.0..2.0), r in 0.01..10.0) {
        let prior = Gaussian::new([0.0; 4], b.congruence(&Matrix::identity())).unwrap();
        let sensor = Rows { h, r: Matrix::identity() * r };
        let points = SigmaPoints::default();
        for (posterior, update) in [
            Kalman::new(Glide(1.0), sensor, prior).unwrap().update(&prior, &[1.0, -1.0], Time::ZERO).unwrap(),
            Unscented::new(Glide(1.0), sensor, prior, points)
                .unwrap()
                .update(&prior, &[1.0, -1.0], Time::ZERO)
                .unwrap(),
        ] {
            prop_assert_eq!(update.outcome, Outcome::Updated);
            let gained = *prior.covariance() - *posterior.covariance() + Matrix::identity() * 1e-9;
            prop_assert!(Cholesky::of("gain", &gained).is_ok(), "{gained:?}");
            prop_assert!(Cholesky::semidefinite("posterior", posterior.covariance()).is_ok());
        }
    }

    /// Any numbers at all: an error or a belief that is finite, never a panic or a NaN.
    #[test]
    fn extreme_numbers_end_in_a_law_or_a_refusal(
        mean in prop::array::uniform4(any::<f64>()),
        sd in prop::array::uniform4(any::<f64>()),
        z in prop::array::uniform2(any::<f64>()),
        nanos in any::<i64>(),
    ) {
        let Ok(prior) = Gaussian::independent(mean, sd.map(f64::abs)) else { return Ok(()) };
        let sensor = Polar::<true> { range_sd: 1.0, bearing_sd: 0.01 };
        let unscented = Unscented::new(Glide(1.0), sensor, prior, SigmaPoints::default()).unwrap();
        let extended = Extended::new(Glide(1.0), sensor, prior);
        let to = Time::from_nanos(nanos);
        let mut beliefs = [start(&unscented), start(&extended)];
        let [a, b] = &mut beliefs;
        let _ = unscented.step(a, to, Some(&z));
        let _ = extended.step(b, to, Some(&z));
        for belief in beliefs {
            prop_assert!(belief.state.mean().iter().all(|m| m.is_finite()));
            prop_assert!(belief.state.covariance().finite("P").is_ok());
        }
    }
}
