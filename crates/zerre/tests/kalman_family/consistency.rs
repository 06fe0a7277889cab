//! Consistency: what filters say of their own errors is true, and the test finds those who lie.

use crate::models::{Glide, Polar, positions, simulate};
use zerre::Time;
use zerre::belief::{Gaussian, GaussianBelief};
use zerre::filter::{Extended, Filter, Kalman, SigmaPoints, Unscented, predict_measurement};
use zerre::math::{Matrix, chi_square};
use zerre::model::{GaussianMeasurement, Motion};
use zerre::rng::Stream;

/// Whether `sum` could be a chi-square number: within the two-sided interval that one misses with probability 1e-6.
fn plausible(sum: f64, dof: u32) -> bool {
    let low = chi_square::quantile(0.5e-6, dof).unwrap();
    let high = chi_square::quantile(1.0 - 0.5e-6, dof).unwrap();
    (low..=high).contains(&sum)
}

const RUNS: u32 = 100;
const STEPS: u64 = 40;

/// Sum of NEES at the last step of each run, which are independent: 4 degrees of freedom each; and sum of NIS over
/// all steps, whose innovations are white: 2 each. The innovations are foretold from the belief before the step.
fn errors<A, H, F, const W: usize>(
    (motion, h, prior): (&A, &H, &Gaussian<4>),
    dt: f64,
    filter: &F,
) -> (f64, f64)
where
    A: Motion<4, W>,
    H: GaussianMeasurement<4, 2, Value = [f64; 2]>,
    F: Filter<Measurement = [f64; 2], Belief = GaussianBelief<4>> + Foretell,
{
    let (mut nees, mut nis) = (0.0, 0.0);
    for run in 0..RUNS {
        let world = simulate((motion, h, prior), (STEPS, dt), Stream::new(11).fork(u64::from(run)));
        let mut belief = filter.start(Time::ZERO, Stream::new(0)).unwrap();
        let mut last = [0.0; 4];
        for (time, x, z) in world {
            nis += filter.nis(&belief, time, &z);
            filter.step(&mut belief, time, Some(&z)).unwrap();
            last = x;
        }
        nees += belief.state.mahalanobis_squared(&last).unwrap();
    }
    (nees, nis)
}

/// NIS by the models that the filter believes in.
trait Foretell {
    fn nis(&self, belief: &GaussianBelief<4>, to: Time, z: &[f64; 2]) -> f64;
}

impl<T, A, H, const W: usize> Foretell for zerre::filter::GaussianFilter<T, A, H, 4, W, 2>
where
    T: zerre::filter::Transform,
    A: Motion<4, W>,
    H: GaussianMeasurement<4, 2, Value = [f64; 2]>,
{
    fn nis(&self, belief: &GaussianBelief<4>, to: Time, z: &[f64; 2]) -> f64 {
        predict_measurement(self.motion(), self.measurement(), &belief.state, belief.time, to)
            .unwrap()
            .nis(z)
            .unwrap()
    }
}

fn consistent((nees, nis): (f64, f64)) -> bool {
    plausible(nees, 4 * RUNS) && plausible(nis, 2 * RUNS * STEPS as u32)
}

fn prior() -> Gaussian<4> {
    Gaussian::independent([0.0, 1.0, 0.0, -1.0], [10.0, 1.0, 10.0, 1.0]).unwrap()
}

#[test]
fn the_right_filters_are_consistent_on_a_linear_world() {
    let mut sensor = positions(1.0);
    sensor.r = Matrix::identity();
    let world = (&Glide(0.5), &sensor, &prior());
    assert!(consistent(errors(world, 1.0, &Kalman::new(Glide(0.5), sensor, prior()).unwrap())));
    let unscented = Unscented::new(Glide(0.5), sensor, prior(), SigmaPoints::default()).unwrap();
    assert!(consistent(errors(world, 1.0, &unscented)));
}

#[test]
fn a_filter_that_forgets_process_noise_is_found() {
    let mut sensor = positions(1.0);
    sensor.r = Matrix::identity();
    let world = (&Glide(0.5), &sensor, &prior());
    let (nees, nis) = errors(world, 1.0, &Kalman::new(Glide(1e-9), sensor, prior()).unwrap());
    assert!(!plausible(nees, 4 * RUNS) && !plausible(nis, 2 * RUNS * STEPS as u32), "{nees} {nis}");
}

/// A target far out, seen sharply, crosses the bearing of pi: nearly linear, so the laws hold for the extended and
/// the unscented filter. The error of the tangent is of relative order (sd across / range)^2 = 1e-4, far below the
/// width of the intervals (5 sqrt(2 / dof) = 8 % for NIS).
#[test]
fn bearings_across_the_cut() {
    let prior = Gaussian::independent([-1000.0, 0.0, 40.0, -2.0], [5.0, 0.5, 5.0, 0.5]).unwrap();
    let motion = Glide(0.05);
    let right = Polar::<true> { range_sd: 2.0, bearing_sd: 0.003 };
    let world = (&motion, &right, &prior);
    let crossings = simulate(world, (STEPS, 1.0), Stream::new(11).fork(0));
    assert!(crossings.iter().any(|(.., z)| z[1] < 0.0) && crossings.iter().any(|(.., z)| z[1] > 0.0));

    assert!(consistent(errors(world, 1.0, &Extended::new(motion, right, prior))));
    let unscented = Unscented::new(motion, right, prior, SigmaPoints::default()).unwrap();
    assert!(consistent(errors(world, 1.0, &unscented)));

    let wrong = Polar::<false> { range_sd: 2.0, bearing_sd: 0.003 };
    let (nees, nis) = errors(world, 1.0, &Extended::new(motion, wrong, prior));
    assert!(!plausible(nees, 4 * RUNS) && !plausible(nis, 2 * RUNS * STEPS as u32), "{nees} {nis}");
}
