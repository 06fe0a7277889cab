//! Parameters and values that no model can have are refused.

use crate::seconds;
use zerre::model::measurement::{self, *};
use zerre::model::motion::{self, *};
use zerre::model::{Measurement, Motion};
use zerre::{Error, Time};

#[test]
fn parameters_out_of_range_are_refused() {
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(RandomWalk::<1>::new(bad).is_err());
        assert!(ConstantVelocity::<2>::new(bad).is_err());
        assert!(ConstantAcceleration::<2>::new(bad).is_err());
        assert!(WienerAcceleration::<2>::new(bad).is_err());
        assert!(Singer::<2>::new(bad, 1.0).is_err());
        assert!(Singer::<2>::new(1.0, bad).is_err());
        assert!(Singer::<2>::from_largest(1.0, bad, 0.1, 1.0).is_err());
        assert!(CoordinatedTurn::new(0.1, bad).is_err());
        assert!(ManoeuvreTurn::new(0.1, bad).is_err());
        for densities in [[bad, 0.1, 0.1], [0.1, bad, 0.1], [0.1, 0.1, bad]] {
            let [motion, size, turn] = densities;
            assert!(ConstantVelocityBox::new(motion, size, turn).is_err());
        }
        assert!(WienerTurn::new(bad, 0.1).is_err() && WienerTurn::new(0.1, bad).is_err());
        assert!(MarkovTurn::new(0.1, 0.1, bad).is_err() && MarkovTurn::new(0.1, bad, 0.1).is_err());
        assert!(motion::Growth::new(bad).is_err());
        assert!(motion::UpfGrowth::new(bad, 1.0).is_err() && motion::UpfGrowth::new(1.0, bad).is_err());
        assert!(Position::<2>::new(bad).is_err());
        assert!(RangeBearingElevation::new([0.0; 3], 1.0, 1.0, bad).is_err());
        assert!(BearingOnly::new([0.0; 2], bad).is_err());
        assert!(RangeOnly::new([0.0; 2], bad).is_err());
        assert!(RangeRate::new([0.0; 2], [0.0; 2], bad).is_err());
        assert!(measurement::Growth::new(bad).is_err() && measurement::UpfGrowth::new(bad).is_err());
        let unit = Position::<1>::new(1.0).unwrap();
        assert!(HeavyTailed::<_, 1>::student_t(unit, bad).is_err());
        assert!(HeavyTailed::<_, 1>::outliers(unit, bad, 2.0).is_err());
        assert!(HeavyTailed::<_, 1>::outliers(unit, 0.1, bad).is_err());
        assert!(
            UniformOutliers::new(unit, bad, 1.0).is_err() && UniformOutliers::new(unit, 0.1, bad).is_err()
        );
        assert!(Linear::new([[bad.sqrt()]], [[1.0]]).is_err() && Linear::new([[1.0]], [[bad]]).is_err());
    }
    assert!(matches!(
        Linear::new([[1.0, 0.0], [0.0, 1.0]], [[1.0, 2.0], [2.0, 1.0]]),
        Err(Error::NotPositiveDefinite { row: 1, .. })
    ));
    assert!(Linear::new([[1.0, 0.0], [0.0, 1.0]], [[1.0, 0.1], [0.2, 1.0]]).is_err());
    assert!(Singer::<1>::from_largest(1.0, 0.4, 0.4, 1.0).is_err());
    assert!(matches!(
        ConstantVelocity::<2>::new(1.0).unwrap().over(seconds(1.0), seconds(0.5)),
        Err(Error::OutOfOrder { .. })
    ));
}

#[test]
fn values_out_of_range_are_refused() {
    fn refuses<const M: usize, H: Measurement<6, Value = [f64; M]>>(sensor: &H, good: [f64; M], range: bool) {
        assert!(sensor.given(&good, Time::ZERO).is_ok());
        for i in 0..M {
            for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let mut z = good;
                z[i] = bad;
                assert!(matches!(sensor.given(&z, Time::ZERO), Err(Error::NotFinite { .. })), "{z:?}");
            }
        }
        let mut z = good;
        z[0] = -1.0;
        assert_eq!(matches!(sensor.given(&z, Time::ZERO), Err(Error::OutOfRange { .. })), range);
    }
    let pair = RangeBearing::new([0.0, 0.0], 1.0, 0.1).unwrap();
    refuses(&pair, [1.0, 2.0], true);
    refuses(&HeavyTailed::<_, 2>::student_t(pair, 3.0).unwrap(), [1.0, 2.0], true);
    refuses(&HeavyTailed::<_, 2>::outliers(pair, 0.1, 3.0).unwrap(), [1.0, 2.0], true);
    refuses(&UniformOutliers::new(pair, 0.1, 3.0).unwrap(), [1.0, 2.0], true);
    refuses(&RangeBearingElevation::new([0.0; 3], 1.0, 0.1, 0.1).unwrap(), [1.0, 2.0, 0.5], true);
    refuses(&RangeOnly::new([0.0; 3], 1.0).unwrap(), [1.0], true);
    refuses(&RangeRate::new([0.0; 3], [0.0; 3], 1.0).unwrap(), [1.0], false);
    refuses(&BearingOnly::new([0.0; 2], 1.0).unwrap(), [1.0], false);
    refuses(&Position::<2>::new(1.0).unwrap(), [1.0, 2.0], false);
    refuses(&measurement::Growth::new(1.0).unwrap(), [1.0], false);
    refuses(&measurement::UpfGrowth::new(1.0).unwrap(), [1.0], false);
    refuses(&Linear::new([[1.0; 6]], [[1.0]]).unwrap(), [1.0], false);
}
