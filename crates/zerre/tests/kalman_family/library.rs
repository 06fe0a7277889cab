//! The models of the library under every filter of the family.

use zerre::belief::Gaussian;
use zerre::filter::{Extended, Kalman, Outcome, SigmaPoints, Unscented};
use zerre::math::Cholesky;
use zerre::model::Motion;
use zerre::model::measurement::Position;
use zerre::model::motion::{
    ConstantAcceleration, ConstantVelocity, CoordinatedTurn, Growth, ManoeuvreTurn, MarkovTurn, RandomWalk,
    Singer, WienerAcceleration, WienerTurn,
};
use zerre::{Error, Time};

/// Predicts and updates by the extended and the unscented filter, whose laws must stay laws, and tells whether the
/// Kalman filter takes the motion for linear.
fn is_linear<A: Motion<N, W> + Copy, const N: usize, const W: usize>(motion: A) -> bool {
    let prior = Gaussian::independent(std::array::from_fn(|i| 1.0 + i as f64), [0.5; N]).unwrap();
    let sensor = Position::<1>::new(1.0).unwrap();
    let (from, to) = (Time::ZERO, Time::from_secs(1.5));
    let extended = Extended::new(motion, sensor, prior);
    let unscented = Unscented::new(motion, sensor, prior, SigmaPoints::default()).unwrap();
    let laws = [extended.predict(&prior, from, to).unwrap(), unscented.predict(&prior, from, to).unwrap()];
    for (law, update) in
        [extended.update(&laws[0], &[1.0], to).unwrap(), unscented.update(&laws[1], &[1.0], to).unwrap()]
    {
        assert_eq!(update.outcome, Outcome::Updated);
        assert!(Cholesky::semidefinite("P", law.covariance()).is_ok());
    }
    match Kalman::new(motion, sensor, prior).unwrap().predict(&prior, from, to) {
        Ok(law) => {
            assert_eq!(law, laws[0]);
            true
        }
        Err(Error::Unsupported(_)) => false,
        Err(other) => panic!("{other}"),
    }
}

#[test]
fn the_kalman_filter_knows_the_linear_ones() {
    assert!(is_linear(RandomWalk::<1>::new(0.5).unwrap()));
    assert!(is_linear(ConstantVelocity::<1>::new(0.5).unwrap()));
    assert!(is_linear(ConstantVelocity::<3>::new(0.5).unwrap()));
    assert!(is_linear(ConstantAcceleration::<2>::new(0.5).unwrap()));
    assert!(is_linear(Singer::<2>::new(1.0, 8.0).unwrap()));
    assert!(is_linear(WienerAcceleration::<2>::new(0.5).unwrap()));
    // A turn of known rate is a rotation of the velocity.
    assert!(is_linear(CoordinatedTurn::new(0.1, 0.5).unwrap()));

    assert!(!is_linear(Growth::new(10.0).unwrap()));
    assert!(!is_linear(ManoeuvreTurn::new(0.7, 0.5).unwrap()));
    assert!(!is_linear(WienerTurn::new(0.5, 0.01).unwrap()));
    assert!(!is_linear(MarkovTurn::new(0.5, 0.1, 20.0).unwrap()));
}
