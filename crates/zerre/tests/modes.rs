//! Jump-Markov models: their simulation has the law of the chain.

use zerre::Time;
use zerre::model::motion::{Flight, Manoeuvre, RandomWalk, WienerAcceleration};
use zerre::model::{Chain, JumpMarkov, Motion, simulate};
use zerre::rng::Stream;

fn seconds(n: i64) -> Vec<Time> {
    (0..n).map(|k| Time::from_nanos(k * 1_000_000_000)).collect()
}

/// Counts of transitions lie within 5 standard deviations of the binomial, given how often each mode was left.
#[test]
fn simulated_modes_follow_their_chain() {
    let rows = vec![vec![0.8, 0.2, 0.0], vec![0.05, 0.9, 0.05], vec![0.0, 0.5, 0.5]];
    let modes = vec![RandomWalk::<1>::new(1.0).unwrap(); 3];
    let chain = Chain::per_step(rows.clone()).unwrap().with_initial(&[0.0, 0.0, 1.0]).unwrap();
    let model = JumpMarkov::new(modes, chain).unwrap();
    let (path, states) = simulate::jump_path(&model, [0.0], &seconds(40_000), Stream::new(3)).unwrap();
    assert_eq!((path[0], states.len()), (2, path.len()));
    let mut counts = [[0.0; 3]; 3];
    for pair in path.windows(2) {
        counts[pair[0]][pair[1]] += 1.0;
    }
    for (i, row) in rows.iter().enumerate() {
        let left: f64 = counts[i].iter().sum();
        assert!(left > 100.0);
        for (j, &p) in row.iter().enumerate() {
            let sd = (left * p * (1.0 - p)).sqrt();
            assert!((counts[i][j] - left * p).abs() <= 5.0 * sd, "{i} {j}: {} of {left}", counts[i][j]);
        }
    }
}

/// With one mode the path is that of its motion alone, number by number.
#[test]
fn one_mode_is_its_motion() {
    let walk = RandomWalk::<2>::new(0.7).unwrap();
    let model = JumpMarkov::new(vec![walk], Chain::staying(1, 1.0).unwrap()).unwrap();
    let times = seconds(50);
    let (modes, states) = simulate::jump_path(&model, [1.0, 2.0], &times, Stream::new(9)).unwrap();
    assert_eq!(states, simulate::path(&walk, [1.0, 2.0], &times, Stream::new(9)).unwrap());
    assert!(modes.iter().all(|&m| m == 0));
}

#[test]
fn a_manoeuvre_is_the_motion_it_names() {
    let (flight, wiener) = (Flight::new(0.1, 2.0, 3.0).unwrap(), WienerAcceleration::<2>::new(0.5).unwrap());
    let (from, to) = (Time::ZERO, Time::from_secs(1.5));
    let (x, w) = ([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [0.1, 0.2, 0.3, 0.4]);
    let by = |mode: Manoeuvre| Manoeuvre::apply(&mode.over(from, to).unwrap(), x, w);
    assert_eq!(by(Manoeuvre::Flight(flight)), Flight::apply(&flight.over(from, to).unwrap(), x, w));
    let alone = WienerAcceleration::<2>::apply(&wiener.over(from, to).unwrap(), x, [w[0], w[1]]);
    assert_eq!(by(Manoeuvre::Wiener(wiener)), alone);
    assert_eq!(Manoeuvre::Wiener(wiener).noise_components(), 2);
}
