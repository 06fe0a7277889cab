//! Worlds on which filters are compared: a motion, a sensor, a prior, and how long it lasts.

use serde::Serialize;
use zerre::belief::Gaussian;
use zerre::filter::Prior;
use zerre::model::measurement::{self, BearingOnly, HeavyTailed, Position, RangeBearing};
use zerre::model::motion::{self, ConstantVelocity, DiscreteVelocity, RandomWalk};
use zerre::model::{GaussianMeasurement, Measurement, Motion, simulate};
use zerre::rng::Stream;
use zerre::{Error, Result, Time};

/// What lists say of a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct WorldInfo {
    /// Its name.
    pub name: &'static str,
    /// What happens in it.
    pub about: &'static str,
    /// Where it comes from.
    pub source: &'static str,
}

const fn info(name: &'static str, about: &'static str, source: &'static str) -> WorldInfo {
    WorldInfo { name, about, source }
}

const UPF: &str = "van der Merwe, Doucet, de Freitas and Wan 2000";

/// The worlds.
pub const WORLDS: &[WorldInfo] = &[
    info("linear", "constant velocity in the plane, positions measured", "Kalman 1960"),
    info("growth-q1", "growth with gamma noise, square then straight measurement of variance 1", UPF),
    info("growth-q3", "the same with variance 3", UPF),
    info("growth-q6", "the same with variance 6", UPF),
    info(
        "ungm",
        "univariate growth: two modes, the sign of the state is hidden",
        "Gordon, Salmond and Smith 1993",
    ),
    info("upf", "growth-q1 with a nearly exact measurement, variance 1e-5", UPF),
    info(
        "bearings-only",
        "a ship's track from bearings at a fixed observer",
        "Gordon, Salmond and Smith 1993",
    ),
    info(
        "outliers",
        "random walk, measurement with Student-t noise of 3 degrees of freedom",
        "Roth et al. 2013",
    ),
    info(
        "radar",
        "constant velocity in the plane, range and bearing: the workload W1 of `zerre bench`",
        "zerre",
    ),
];

/// A world with its own noises or others.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Place {
    /// A name of [`WORLDS`].
    pub world: &'static str,
    /// Variance of the measurement; the world's own where absent.
    pub measurement_variance: Option<f64>,
    /// Variance of the process noise of a step of a second (of the constant-velocity motion: its density).
    pub process_variance: Option<f64>,
    /// Number of measurements, one a second.
    pub steps: Option<usize>,
}

impl Place {
    /// The world called `name` as it is; `None` if there is none.
    pub fn named(name: &str) -> Option<Place> {
        let world = WORLDS.iter().find(|world| world.name == name)?.name;
        Some(Place { world, measurement_variance: None, process_variance: None, steps: None })
    }

    /// The random numbers of run number `run`: truth and measurements of every filter and every noise come
    /// from the same draws.
    pub fn luck(&self, seed: u64, run: usize) -> Stream {
        Stream::new(seed).fork(STREAM).fork(label(self.world)).fork(run as u64)
    }
}

/// Label of the streams: "worlds" in ASCII.
const STREAM: u64 = 0x776f_726c_6473;
const TRUTH: u64 = 1;

/// A number for a name (FNV-1a).
pub(crate) fn label(name: &str) -> u64 {
    name.bytes()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// The estimation problem of a world. Measurements come at 1, 2, ... seconds; the prior is of time 0.
#[derive(Clone, Debug)]
pub struct Problem<A, H, const N: usize> {
    /// How the state moves.
    pub motion: A,
    /// What is seen of it.
    pub sensor: H,
    /// What filters know at first.
    pub prior: Gaussian<N>,
    /// The true state at first, where it is not drawn from the prior.
    pub start: Option<[f64; N]>,
    /// Number of measurements.
    pub steps: usize,
    /// How many leading components are scored.
    pub shown: usize,
}

/// One draw of a world.
#[derive(Clone, Debug, PartialEq)]
pub struct Record<const N: usize, const M: usize> {
    /// Times of the measurements.
    pub times: Vec<Time>,
    /// True states then.
    pub truth: Vec<[f64; N]>,
    /// What was measured.
    pub measured: Vec<[f64; M]>,
}

impl<A, H, const N: usize> Problem<A, H, N> {
    /// Draws a truth and its measurements.
    ///
    /// # Errors
    /// What the models refuse.
    pub fn record<const W: usize, const M: usize>(&self, luck: Stream) -> Result<Record<N, M>>
    where
        A: Motion<N, W>,
        H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]>,
    {
        let luck = luck.fork(TRUTH);
        let start = match self.start {
            Some(start) => start,
            None => self.prior.columns(luck, 1)?.map(|column| column[0]),
        };
        let times: Vec<Time> = (0..=self.steps as i64).map(|k| Time::from_nanos(k * 1_000_000_000)).collect();
        let path = simulate::path(&self.motion, start, &times, luck)?;
        let (times, truth) = (times[1..].to_vec(), path[1..].to_vec());
        let measured = simulate::measurements(&self.sensor, &truth, &times, luck)?;
        Ok(Record { times, truth, measured })
    }
}

/// What is to be done with a problem whose types are known here only.
pub trait Visit {
    /// What comes of it.
    type Out;

    /// Does it.
    fn visit<A, H, const N: usize, const W: usize, const M: usize>(
        self,
        problem: &Problem<A, H, N>,
    ) -> Result<Self::Out>
    where
        A: Motion<N, W> + Clone,
        H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]> + Clone;
}

/// What is to be done with a problem of one component.
pub trait VisitScalar {
    /// What comes of it.
    type Out;

    /// Does it.
    fn visit<A, H>(self, problem: &Problem<A, H, 1>) -> Result<Self::Out>
    where
        A: Motion<1, 1> + Clone,
        H: GaussianMeasurement<1, 1> + Measurement<1, Value = [f64; 1]> + Clone;
}

/// What can be done with any problem can be done with one of one component.
struct Scalar<V>(V);

impl<V: Visit> VisitScalar for Scalar<V> {
    type Out = V::Out;

    fn visit<A, H>(self, problem: &Problem<A, H, 1>) -> Result<V::Out>
    where
        A: Motion<1, 1> + Clone,
        H: GaussianMeasurement<1, 1> + Measurement<1, Value = [f64; 1]> + Clone,
    {
        self.0.visit::<A, H, 1, 1, 1>(problem)
    }
}

/// The process noise or the measurement noise of a world whose models fix it, given another.
fn fixed(place: &Place, noise: Option<f64>, what: &str) -> Result<()> {
    match noise {
        None => Ok(()),
        Some(_) => Err(Error::Unsupported(format!("the {what} of the world {} is its own", place.world))),
    }
}

/// Hands the problem of `place` to `visit`.
///
/// # Errors
/// An unknown world; a noise that the world does not have or that is out of range; what `visit` refuses.
pub fn with_problem<V: Visit>(place: &Place, visit: V) -> Result<V::Out> {
    let steps = |own: usize| place.steps.unwrap_or(own);
    let measured = |own: f64| place.measurement_variance.unwrap_or(own);
    let moved = |own: f64| place.process_variance.unwrap_or(own);
    match place.world {
        "linear" => visit.visit::<_, _, 4, 4, 2>(&Problem {
            motion: ConstantVelocity::<2>::new(moved(0.02))?,
            sensor: Position::<2>::new(positive("variance of the measurement", measured(4.0))?.sqrt())?,
            prior: Gaussian::independent([0.0, 0.0, 1.0, -0.5], [1.0, 1.0, 0.2, 0.2])?,
            start: None,
            steps: steps(50),
            shown: 2,
        }),
        "bearings-only" => visit.visit::<_, _, 4, 2, 1>(&Problem {
            motion: DiscreteVelocity::<2>::new(positive("variance of the motion", moved(1e-6))?.sqrt())?,
            sensor: BearingOnly::new(
                [0.0; 2],
                positive("variance of the measurement", measured(0.005 * 0.005))?.sqrt(),
            )?,
            prior: Gaussian::independent([0.0, 0.4, 0.0, -0.05], [0.5, 0.3, 0.005, 0.01])?,
            start: Some([-0.05, 0.7, 0.001, -0.055]),
            steps: steps(24),
            shown: 2,
        }),
        "outliers" => visit.visit::<_, _, 1, 1, 1>(&Problem {
            motion: RandomWalk::<1>::new(moved(1.0))?,
            sensor: HeavyTailed::<_, 1>::student_t(
                Position::<1>::new(positive("variance of the measurement", measured(1.0))?.sqrt())?,
                3.0,
            )?,
            prior: Gaussian::independent([0.0], [2.0])?,
            start: None,
            steps: steps(50),
            shown: 1,
        }),
        "radar" => {
            fixed(place, place.measurement_variance, "measurement noise")?;
            visit.visit::<_, _, 4, 4, 2>(&Problem {
                motion: ConstantVelocity::<2>::new(moved(0.05))?,
                sensor: RangeBearing::new([-6.0, 12.0], 0.1, 0.01)?,
                prior: Gaussian::independent([0.0, 0.0, 0.5, 0.3], [0.5, 0.5, 0.3, 0.3])?,
                start: None,
                steps: steps(100),
                shown: 2,
            })
        }
        _ => with_growth(place, Scalar(visit)),
    }
}

/// Hands the problem of a world of growth to `visit`: `growth-q1`, `growth-q3`, `growth-q6`, `upf` or `ungm`,
/// each of one component. What is compared in these alone need not be compiled for the others.
///
/// # Errors
/// As [`with_problem`], and any other world.
pub fn with_growth<V: VisitScalar>(place: &Place, visit: V) -> Result<V::Out> {
    let steps = |own: usize| place.steps.unwrap_or(own);
    let measured = |own: f64| place.measurement_variance.unwrap_or(own);
    let growth = |variance: f64, own: usize| {
        fixed(place, place.process_variance, "process noise")?;
        let motion = motion::UpfGrowth::new(3.0, 2.0)?;
        upf_growth(motion, measurement::UpfGrowth::new(measured(variance))?, steps(own))
    };
    match place.world {
        "growth-q1" => visit.visit(&growth(1.0, 50)?),
        "growth-q3" => visit.visit(&growth(3.0, 50)?),
        "growth-q6" => visit.visit(&growth(6.0, 50)?),
        "upf" => visit.visit(&growth(1e-5, 60)?),
        "ungm" => visit.visit(&Problem {
            motion: motion::Growth::new(place.process_variance.unwrap_or(10.0))?,
            sensor: measurement::Growth::new(measured(1.0))?,
            prior: Gaussian::independent([0.0], [5f64.sqrt()])?,
            start: None,
            steps: steps(50),
            shown: 1,
        }),
        other => Err(Error::Unsupported(format!("there is no world `{other}` here"))),
    }
}

/// The growth of the unscented particle filter's benchmark, from 1 on; filters know that with a variance of 3/4.
///
/// # Errors
/// None: the prior is a law.
pub fn upf_growth(
    motion: motion::UpfGrowth,
    sensor: measurement::UpfGrowth,
    steps: usize,
) -> Result<Problem<motion::UpfGrowth, measurement::UpfGrowth, 1>> {
    let prior = Gaussian::independent([1.0], [0.75f64.sqrt()])?;
    Ok(Problem { motion, sensor, prior, start: Some([1.0]), steps, shown: 1 })
}

fn positive(what: &'static str, value: f64) -> Result<f64> {
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(Error::OutOfRange { what, value, needs: "it must be positive and finite" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Truth and measurements, as numbers.
    struct Drawn(Stream);

    impl Visit for Drawn {
        type Out = Vec<f64>;

        fn visit<A, H, const N: usize, const W: usize, const M: usize>(
            self,
            problem: &Problem<A, H, N>,
        ) -> Result<Vec<f64>>
        where
            A: Motion<N, W> + Clone,
            H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]> + Clone,
        {
            let record: Record<N, M> = problem.record(self.0)?;
            assert_eq!(record.times.first(), Some(&Time::from_secs(1.0)));
            assert_eq!((record.times.len(), record.truth.len()), (problem.steps, problem.steps));
            assert!(problem.shown <= N);
            Ok(record.truth.iter().flatten().chain(record.measured.iter().flatten()).copied().collect())
        }
    }

    fn drawn(place: &Place, seed: u64, run: usize) -> Vec<f64> {
        with_problem(place, Drawn(place.luck(seed, run))).unwrap()
    }

    #[test]
    fn every_world_is_drawn_and_each_run_anew() {
        for world in WORLDS {
            let place = Place::named(world.name).unwrap();
            let first = drawn(&place, 1, 0);
            assert!(first.iter().all(|v| v.is_finite()), "{}", world.name);
            assert_eq!(first, drawn(&place, 1, 0));
            assert!(first != drawn(&place, 2, 0) && first != drawn(&place, 1, 1), "{}", world.name);
            let short = drawn(&Place { steps: Some(3), ..place }, 1, 0);
            assert_eq!(short[0], first[0]);
        }
        assert!(Place::named("nowhere").is_none());
    }

    /// The draws are the same whatever the variance: errors of the measurement grow by its root.
    #[test]
    fn other_noises_scale_the_same_draws() {
        let place = Place::named("ungm").unwrap();
        let near = drawn(&place, 1, 0);
        let far = drawn(&Place { measurement_variance: Some(4.0), ..place }, 1, 0);
        let (truth, steps) = (&near[..50], 50);
        assert_eq!(truth, &far[..50]);
        for k in 0..steps {
            let seen = truth[k] * truth[k] * 0.05;
            let (a, b) = (near[steps + k] - seen, far[steps + k] - seen);
            assert!((b - 2.0 * a).abs() < 1e-12 * (1.0 + seen), "{a} {b}");
        }
    }

    #[test]
    fn noises_that_a_world_does_not_have_are_refused() {
        for (world, measurement_variance, process_variance) in [
            ("upf", None, Some(1.0)),
            ("radar", Some(1.0), None),
            ("linear", Some(-1.0), None),
            ("bearings-only", None, Some(f64::NAN)),
        ] {
            let place = Place { measurement_variance, process_variance, ..Place::named(world).unwrap() };
            assert!(with_problem(&place, Drawn(place.luck(1, 0))).is_err(), "{world}");
        }
    }
}
