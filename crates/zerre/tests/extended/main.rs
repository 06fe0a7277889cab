//! Extended targets: laws of every filter, against closed forms, enumeration and simulation.

mod baselines;
mod batch;
mod changing;
mod contour;
mod heading;
mod mem_ekf;
mod number;
mod online;
mod random_matrix;
mod rate;
mod single;
mod start;
mod window;

use zerre::Time;
use zerre::extended::{Ellipse, Shape};
use zerre::math::{Cholesky, Matrix};
use zerre::model::motion::ConstantVelocity;
use zerre::model::simulate;
use zerre::rng::{Draws, Purpose, Stream};

/// The three ellipses of Özkan 2019.
pub fn truth() -> Shape {
    let ellipse = |offset, extent| Ellipse { weight: 1.0, offset, extent: Matrix(extent) };
    Shape::new(vec![
        ellipse([0.0, 0.0], [[50.0, 0.0], [0.0, 2.0]]),
        ellipse([0.0, -5.0], [[8.0, 4.5], [4.5, 5.0]]),
        ellipse([0.0, 5.0], [[8.0, -4.5], [-4.5, 5.0]]),
    ])
    .unwrap()
}

/// Round ellipses near them.
pub fn near() -> Shape {
    let ellipse = |y| Ellipse { weight: 1.0, offset: [0.0, y], extent: Matrix([[15.0, 0.0], [0.0, 15.0]]) };
    Shape::new([0.0, -3.0, 3.0].map(ellipse).to_vec()).unwrap()
}

/// So many seconds.
pub fn secs(k: usize) -> Time {
    Time::from_secs(k as f64)
}

/// A Poisson number.
pub fn poisson(draws: &mut Draws, mean: f64) -> usize {
    let (mut product, mut count) = (draws.uniform(), 0);
    while product > (-mean).exp() {
        product *= draws.uniform();
        count += 1;
    }
    count
}

/// A point of the shape.
pub fn point(draws: &mut Draws, shape: &Shape, at: [f64; 2]) -> [f64; 2] {
    let (u, mut sum) = (draws.uniform(), 0.0);
    let beyond = |e: &&Ellipse| {
        sum += e.weight;
        u < sum
    };
    let e = shape.ellipses().iter().find(beyond).unwrap_or(&shape.ellipses()[0]);
    let d = *Cholesky::of("extent", &e.extent).unwrap().factor() * [draws.normal(), draws.normal()];
    [at[0] + e.offset[0] + d[0], at[1] + e.offset[1] + d[1]]
}

/// Where a target went at 1, 2, ... seconds, and its scans of nine points on average.
pub fn record(seed: u64, count: usize) -> (Vec<[f64; 4]>, Vec<Vec<[f64; 2]>>) {
    let times: Vec<Time> = (0..=count).map(secs).collect();
    let motion = ConstantVelocity::<2>::new(1.0).unwrap();
    let path = simulate::path(&motion, [0.0, 0.0, 10.0, 0.0], &times, Stream::new(seed).fork(0)).unwrap();
    let mut draws = Stream::new(seed).fork(1).draws(Purpose::Measurement, 0, 0);
    let scans = path[1..]
        .iter()
        .map(|x| (0..poisson(&mut draws, 9.0)).map(|_| point(&mut draws, &truth(), [x[0], x[1]])).collect());
    let scans = scans.collect();
    (path[1..].to_vec(), scans)
}
