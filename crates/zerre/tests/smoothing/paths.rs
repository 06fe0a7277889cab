//! What smoothers do beside smoothing.

use crate::list::{Means, bootstrap};
use crate::{DATA, LAST, follow, motion};
use zerre::belief::{Cloud, Gaussian};
use zerre::filter::{Ensemble, EnsembleSettings, Filter, ParticleFilter, Settings};
use zerre::kernels::Threads;
use zerre::math::Matrix;
use zerre::model::measurement::{Position, UpfGrowth as GrowthSensor};
use zerre::model::motion::{RandomWalk, UpfGrowth, WienerAcceleration};
use zerre::rng::Stream;
use zerre::smooth::{Backward, History, Paris, backward_paths};
use zerre::{Error, Time};

fn history(seed: u64) -> History<2> {
    let mut history = History::new();
    follow(&bootstrap(&Means::default()), &DATA, seed, |cloud| history.record(cloud).unwrap());
    history
}

/// A path never goes back below where the noise, which is positive, can lead.
#[test]
fn gamma_noise_has_possible_paths() {
    let prior = Gaussian::new([1.0], Matrix([[0.75]])).unwrap();
    let motion = UpfGrowth::new(3.0, 2.0).unwrap();
    let settings = Settings { particles: 200, ..Settings::default() };
    let filter = ParticleFilter::new(prior, motion, GrowthSensor::new(1.0).unwrap(), settings).unwrap();
    let mut cloud = filter.start(Time::ZERO, Stream::new(3)).unwrap();
    let mut history = History::new();
    for k in 1..20 {
        filter.step(&mut cloud, Time::from_secs(f64::from(k)), Some(&[4.0])).unwrap();
        history.record(&cloud).unwrap();
    }
    for how in [Backward::default(), Backward::Moves { count: 5 }] {
        let paths = backward_paths(&motion, &history, 50, how, Stream::new(1), &Threads::Serial).unwrap();
        for k in 1..paths.len() {
            let phase = 0.04 * std::f64::consts::PI * paths.times()[k].secs();
            for j in 0..50 {
                let (a, b) = (paths.state(k - 1, j).unwrap()[0], paths.state(k, j).unwrap()[0]);
                assert!(b - 0.5 * a - 1.0 - phase.sin() > 0.0);
            }
        }
    }
}

#[test]
fn paths_repeat_and_pass_the_particles_they_name() {
    let history = history(5);
    let draw = |count, stream, threads| {
        backward_paths(&motion(), &history, count, Backward::default(), stream, &threads).unwrap()
    };
    let paths = |stream| draw(30, stream, Threads::Serial);
    assert_eq!(paths(Stream::new(1)), paths(Stream::new(1)));
    let shared = draw(1000, Stream::new(1), Threads::new(2).unwrap());
    assert!(shared == draw(1000, Stream::new(1), Threads::Serial), "threads change the paths");
    assert_ne!(paths(Stream::new(1)), paths(Stream::new(2)));
    let paths = paths(Stream::new(1));
    assert_eq!(paths.particles(4).len(), 30);
    // Two measurements at one instant: the same states.
    assert_eq!(paths.at(3).unwrap().states, paths.at(4).unwrap().states);
    assert!(paths.at(LAST + 1).is_none() && paths.state(0, 30).is_none() && paths.particles(99).is_empty());
}

#[test]
fn what_has_no_backward_law_is_refused() {
    let prior = Gaussian::independent([0.0; 3], [1.0; 3]).unwrap();
    let jumps = WienerAcceleration::<1>::new(0.5).unwrap();
    let settings = Settings { particles: 50, ..Settings::default() };
    let filter = ParticleFilter::new(prior, jumps, Position::<1>::new(1.0).unwrap(), settings).unwrap();
    let mut cloud = filter.start(Time::ZERO, Stream::new(1)).unwrap();
    let mut history = History::new();
    let mut paris = Paris::<3, 1>::new(&cloud, Backward::default(), Stream::new(1), |_| [0.0]).unwrap();
    history.record(&cloud).unwrap();
    filter.step(&mut cloud, Time::from_secs(1.0), Some(&[1.0])).unwrap();
    history.record(&cloud).unwrap();
    let refused = backward_paths(&jumps, &history, 10, Backward::default(), Stream::new(1), &Threads::Serial);
    assert!(matches!(refused, Err(Error::Unsupported(_))));
    assert!(matches!(paris.step(&jumps, &cloud, |_| [0.0]), Err(Error::Unsupported(_))));
    // The fixed lag asks for no density.
    assert!(history.lagged(1).is_ok() && history.lagged(2).is_err());

    let none = History::<2>::new();
    assert!(none.is_empty() && none.time(0).is_none() && none.lagged(0).is_err());
    let walk = RandomWalk::<2>::new(1.0).unwrap();
    for (history, count) in [(&none, 10), (&self::history(1), 0)] {
        assert!(
            backward_paths(&walk, history, count, Backward::default(), Stream::new(1), &Threads::Serial)
                .is_err()
        );
    }
    assert!(History::<2>::window(0).is_err());
    // Clouds out of order, or of other numbers of particles.
    let cloud = |secs, n: usize| {
        Cloud::from_columns(Time::from_secs(secs), Stream::new(1), [vec![0.0; n], vec![1.0; n]]).unwrap()
    };
    let mut history = History::new();
    history.record(&cloud(1.0, 4)).unwrap();
    assert!(matches!(history.record(&cloud(0.0, 4)), Err(Error::OutOfOrder { .. })));
    assert!(matches!(history.record(&cloud(2.0, 5)), Err(Error::Shape { .. })));
    assert_eq!((history.len(), history.time(0)), (1, Some(Time::from_secs(1.0))));
    assert!(Paris::<2, 1>::new(&cloud(1.0, 4), Backward::default(), Stream::new(1), |_| [f64::NAN]).is_err());
}

/// A motion that never led there is found out instead of drawing at random.
#[test]
fn a_history_of_another_motion_is_refused() {
    let cloud = |secs, x: f64| {
        Cloud::from_columns(Time::from_secs(secs), Stream::new(1), [vec![x, x + 0.1]]).unwrap()
    };
    let mut history = History::new();
    history.record(&cloud(1.0, 10.0)).unwrap();
    history.record(&cloud(2.0, 0.0)).unwrap();
    let growth = UpfGrowth::new(3.0, 2.0).unwrap();
    let refused = backward_paths(&growth, &history, 3, Backward::default(), Stream::new(1), &Threads::Serial);
    assert!(matches!(refused, Err(Error::Unsupported(_))));
    // Far out in the tail of a normal law numbers underflow, and the path is still found.
    let walk = RandomWalk::<1>::new(1e-3).unwrap();
    let paths =
        backward_paths(&walk, &history, 3, Backward::default(), Stream::new(1), &Threads::Serial).unwrap();
    assert_eq!(paths.state(0, 0), Some([10.0]), "the nearer of two");
}

/// Members that a measurement has corrected are no longer where their motion led them: what would follow them
/// back says so, and what weighs all of them goes on.
#[test]
fn an_ensemble_has_no_parents() {
    let settings = EnsembleSettings { members: 300, ..EnsembleSettings::default() };
    let ensemble = Ensemble::new(crate::prior(), motion(), crate::sensor(), settings).unwrap();
    let history = |data: &[crate::Seen]| {
        let mut history = History::new();
        follow(&ensemble, data, 1, |cloud| history.record(cloud).unwrap());
        history
    };
    let paths = |history, how| backward_paths(&motion(), history, 20, how, Stream::new(1), &Threads::Serial);
    // Two measurements at one instant.
    let twice = history(&DATA);
    assert!(matches!(twice.lagged(1), Err(Error::Unsupported(_))) && twice.lagged(0).is_ok());
    assert!(matches!(paths(&twice, Backward::default()), Err(Error::Unsupported(_))));
    let once = history(&[(0.0, Some(0.3)), (1.0, Some(1.0)), (2.0, Some(3.0)), (3.0, None)]);
    assert!(paths(&once, Backward::default()).is_ok());
    assert!(matches!(paths(&once, Backward::Moves { count: 3 }), Err(Error::Unsupported(_))));
    // Without a measurement they are.
    assert!(once.lagged(1).is_ok() && once.lagged(2).is_err());
}
