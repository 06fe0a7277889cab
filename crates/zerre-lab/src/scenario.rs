//! Worlds to draw from: how targets move and how sensors see them. The named ones are the list [`SCENARIOS`];
//! others are written as TOML with the fields of [`Scenario`].

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use zerre::model::motion::{
    ConstantAcceleration, ConstantVelocity, CoordinatedTurn, Growth, ManoeuvreTurn, MarkovTurn, RandomWalk,
    Singer, WienerAcceleration, WienerTurn,
};
use zerre::model::{GaussianMeasurement, Measurement, Motion, measurement, simulate};
use zerre::rng::{Purpose, Stream};
use zerre::{Span, Time};

/// A scenario that has a name.
#[derive(Clone, Copy, Debug)]
pub struct Named {
    /// Name on the command line.
    pub name: &'static str,
    /// What happens in it, in one line.
    pub about: &'static str,
    /// Where it comes from; empty if from here.
    pub source: &'static str,
    /// Builds it.
    pub scenario: fn() -> Scenario,
}

/// Every named scenario.
pub const SCENARIOS: &[Named] = &[
    Named {
        name: "radar-cv",
        about: "one target of nearly constant velocity, ranges and bearings from one radar",
        source: "Bar-Shalom, Li and Kirubarajan 2001, chapters 6 and 10",
        scenario: radar_cv,
    },
    Named {
        name: "growth",
        about: "univariate growth, its square measured: two modes; pure numbers, which track does not read",
        source: "Gordon, Salmond and Smith 1993",
        scenario: growth,
    },
    Named {
        name: "turn",
        about: "an aircraft in a coordinated turn of three degrees per second, seen by a radar",
        source: "Bar-Shalom, Li and Kirubarajan 2001, chapter 11",
        scenario: turn,
    },
    Named {
        name: "bearings-only",
        about: "one ship between two listening stations that measure directions only",
        source: "Ristic, Arulampalam and Gordon 2004, chapter 6",
        scenario: bearings_only,
    },
    Named {
        name: "two-crossing",
        about: "two targets whose ways cross, positions with gaps",
        source: "",
        scenario: two_crossing,
    },
];

/// The scenario of that name.
pub fn find(name: &str) -> Option<Scenario> {
    SCENARIOS.iter().find(|named| named.name == name).map(|named| (named.scenario)())
}

/// A world to draw from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "zerre scenario")]
pub struct Scenario {
    /// Seconds between two instants, all of which every sensor sees.
    pub step_s: f64,
    /// Seconds from the first instant, which is 0, to the last one at most.
    pub duration_s: f64,
    /// Which of the worlds with these numbers: another one draws independently under the same `--seed`.
    #[serde(default)]
    pub seed: u32,
    /// How targets move.
    pub motion: MotionModel,
    /// The targets.
    pub target: Vec<Target>,
    /// The sensors.
    pub sensor: Vec<Sensor>,
}

/// How targets move: a name of `zerre catalog motions` with its parameters. Densities are power spectral densities
/// of white noise, per axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "model", rename_all = "kebab-case", deny_unknown_fields)]
pub enum MotionModel {
    /// State x, y.
    RandomWalk {
        /// Of the velocity, m^2/s.
        velocity_density: f64,
    },
    /// State x, y, vx, vy.
    ConstantVelocity {
        /// Of the acceleration, m^2/s^3.
        acceleration_density: f64,
    },
    /// State x, y, vx, vy, ax, ay.
    ConstantAcceleration {
        /// Of the jerk, m^2/s^5.
        jerk_density: f64,
    },
    /// State x, y, vx, vy, ax, ay.
    WienerAcceleration {
        /// Standard deviation of the change of the acceleration per step, m/s^2.
        acceleration_sd_mps2: f64,
    },
    /// State x, y, vx, vy, ax, ay.
    Singer {
        /// Standard deviation of the acceleration in the long run, m/s^2.
        acceleration_sd_mps2: f64,
        /// How long an acceleration lasts.
        time_constant_s: f64,
    },
    /// State x, y, vx, vy.
    CoordinatedTurn {
        /// Positive to the left.
        turn_rate_rad_s: f64,
        /// Of the acceleration, m^2/s^3.
        acceleration_density: f64,
    },
    /// State x, y, vx, vy.
    ManoeuvreTurn {
        /// Across the velocity, positive to the left.
        acceleration_mps2: f64,
        /// Of the acceleration, m^2/s^3.
        acceleration_density: f64,
    },
    /// State x, y, vx, vy, turn rate.
    WienerTurn {
        /// Of the acceleration, m^2/s^3.
        acceleration_density: f64,
        /// Of the turn acceleration, rad^2/s^3.
        turn_density: f64,
    },
    /// State x, y, vx, vy, turn rate.
    MarkovTurn {
        /// Of the acceleration, m^2/s^3.
        acceleration_density: f64,
        /// Standard deviation of the turn rate in the long run.
        turn_rate_sd_rad_s: f64,
        /// How long a turn lasts.
        time_constant_s: f64,
    },
    /// State x, a pure number; steps of one second.
    Growth {
        /// Variance of the noise per step.
        variance: f64,
    },
}

/// A target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// Its identity in the tables.
    pub id: String,
    /// The mean of its state at time 0: the components of the motion, m, m/s, m/s^2, rad/s.
    pub start: Vec<f64>,
    /// The standard deviations of that state; all zero if absent.
    #[serde(default)]
    pub start_sd: Vec<f64>,
}

/// A sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Its name in the tables; sensors may go without if there is only one.
    #[serde(default)]
    pub name: String,
    /// What it measures.
    pub measures: Measures,
    /// Probability that it sees a target at an instant.
    #[serde(default = "always")]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub detection: f64,
}

fn always() -> f64 {
    1.0
}

/// What a sensor measures: a name of `zerre catalog measurements` with its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "model", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Measures {
    /// x and y.
    Position {
        /// Standard deviation of each.
        position_sd_m: f64,
    },
    /// Range and bearing.
    RangeBearing {
        /// Where the sensor stands, x and y.
        position_m: [f64; 2],
        /// Standard deviation of the range.
        range_sd_m: f64,
        /// Standard deviation of the bearing.
        bearing_sd_rad: f64,
    },
    /// Bearing only.
    Bearing {
        /// Where the sensor stands, x and y.
        position_m: [f64; 2],
        /// Standard deviation of the bearing.
        bearing_sd_rad: f64,
    },
    /// Range only.
    Range {
        /// Where the sensor stands, x and y.
        position_m: [f64; 2],
        /// Standard deviation of the range.
        range_sd_m: f64,
    },
    /// The square of the growth model's state over 20, a pure number.
    Growth {
        /// Variance of the noise.
        variance: f64,
    },
}

/// A scenario that has no meaning: where, and why.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}: {what}", path.join("."))]
pub struct Invalid {
    /// Keys from the top; a target or sensor by its place in the list, from 0.
    pub path: Vec<String>,
    /// The complaint, as a sentence without its full stop.
    pub what: String,
}

/// What one run drew.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// The true states, in order of time, then of targets.
    pub truth: Vec<TruePoint>,
    /// The measurements, in order of time, then of targets, then of sensors.
    pub measurements: Vec<Measured>,
}

/// Where a target was.
#[derive(Clone, Debug, PartialEq)]
pub struct TruePoint {
    /// When.
    pub time: Time,
    /// Place in [`Scenario::target`].
    pub target: usize,
    /// The components that [`MotionModel::columns`] names.
    pub state: Vec<f64>,
}

/// What a sensor reported.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// When.
    pub time: Time,
    /// Place in [`Scenario::target`].
    pub target: usize,
    /// Place in [`Scenario::sensor`].
    pub sensor: usize,
    /// The numbers that [`Measures::columns`] names.
    pub values: Vec<f64>,
}

/// More instants than anybody means.
const MOST_INSTANTS: i64 = 10_000_000;

impl MotionModel {
    /// Columns of the leading components of the state in a table of truth.
    pub fn columns(&self) -> &'static [&'static str] {
        match self {
            MotionModel::Growth { .. } => &["x"],
            MotionModel::RandomWalk { .. } => &["x_m", "y_m"],
            _ => &["x_m", "y_m", "vx_mps", "vy_mps"],
        }
    }

    /// Name in the catalogue.
    pub fn name(&self) -> &'static str {
        use MotionModel::*;
        match self {
            RandomWalk { .. } => "random-walk",
            ConstantVelocity { .. } => "constant-velocity",
            ConstantAcceleration { .. } => "constant-acceleration",
            WienerAcceleration { .. } => "wiener-acceleration",
            Singer { .. } => "singer",
            CoordinatedTurn { .. } => "coordinated-turn",
            ManoeuvreTurn { .. } => "manoeuvre-turn",
            WienerTurn { .. } => "wiener-turn",
            MarkovTurn { .. } => "markov-turn",
            Growth { .. } => "growth",
        }
    }

    /// Number of components of the state.
    fn dimension(&self) -> usize {
        use MotionModel::*;
        match self {
            Growth { .. } => 1,
            RandomWalk { .. } => 2,
            ConstantVelocity { .. } | CoordinatedTurn { .. } | ManoeuvreTurn { .. } => 4,
            WienerTurn { .. } | MarkovTurn { .. } => 5,
            ConstantAcceleration { .. } | WienerAcceleration { .. } | Singer { .. } => 6,
        }
    }

    /// A path from `start` through `times`: whole states, one after the other.
    fn path(&self, start: &[f64], times: &[Time], stream: Stream) -> zerre::Result<Vec<Vec<f64>>> {
        use MotionModel as M;
        match *self {
            M::RandomWalk { velocity_density: q } => walk(&RandomWalk::<2>::new(q)?, start, times, stream),
            M::ConstantVelocity { acceleration_density: q } => {
                walk(&ConstantVelocity::<2>::new(q)?, start, times, stream)
            }
            M::ConstantAcceleration { jerk_density: q } => {
                walk(&ConstantAcceleration::<2>::new(q)?, start, times, stream)
            }
            M::WienerAcceleration { acceleration_sd_mps2: sd } => {
                walk(&WienerAcceleration::<2>::new(sd)?, start, times, stream)
            }
            M::Singer { acceleration_sd_mps2: sd, time_constant_s: tau } => {
                walk(&Singer::<2>::new(sd, tau)?, start, times, stream)
            }
            M::CoordinatedTurn { turn_rate_rad_s: rate, acceleration_density: q } => {
                walk(&CoordinatedTurn::new(rate, q)?, start, times, stream)
            }
            M::ManoeuvreTurn { acceleration_mps2: a, acceleration_density: q } => {
                walk(&ManoeuvreTurn::new(a, q)?, start, times, stream)
            }
            M::WienerTurn { acceleration_density: q, turn_density: t } => {
                walk(&WienerTurn::new(q, t)?, start, times, stream)
            }
            M::MarkovTurn { acceleration_density: q, turn_rate_sd_rad_s: sd, time_constant_s: tau } => {
                walk(&MarkovTurn::new(q, sd, tau)?, start, times, stream)
            }
            M::Growth { variance } => walk(&Growth::new(variance)?, start, times, stream),
        }
    }
}

fn walk<const N: usize, const W: usize, M: Motion<N, W>>(
    motion: &M,
    start: &[f64],
    times: &[Time],
    stream: Stream,
) -> zerre::Result<Vec<Vec<f64>>> {
    let start = leading::<N>("components of the start", start)?;
    Ok(simulate::path(motion, start, times, stream)?.into_iter().map(Vec::from).collect())
}

/// The first `N` numbers of a state.
fn leading<const N: usize>(what: &'static str, state: &[f64]) -> zerre::Result<[f64; N]> {
    let shape = || zerre::Error::Shape { what, found: state.len(), expected: N };
    state.first_chunk().copied().ok_or_else(shape)
}

impl Measures {
    /// Columns of the values in a table of measurements.
    pub fn columns(&self) -> &'static [&'static str] {
        match self {
            Measures::Position { .. } => &["x_m", "y_m"],
            Measures::RangeBearing { .. } => &["range_m", "bearing_rad"],
            Measures::Bearing { .. } => &["bearing_rad"],
            Measures::Range { .. } => &["range_m"],
            Measures::Growth { .. } => &["z"],
        }
    }

    /// What the sensor reports of a path.
    fn see(&self, path: &[Vec<f64>], times: &[Time], stream: Stream) -> zerre::Result<Vec<Vec<f64>>> {
        match *self {
            Measures::Position { position_sd_m: sd } => {
                report::<2, 2, _>(&measurement::Position::<2>::new(sd)?, path, times, stream)
            }
            Measures::RangeBearing { position_m, range_sd_m, bearing_sd_rad } => {
                let sensor = measurement::RangeBearing::new(position_m, range_sd_m, bearing_sd_rad)?;
                report::<2, 2, _>(&sensor, path, times, stream)
            }
            Measures::Bearing { position_m, bearing_sd_rad: sd } => {
                report::<2, 1, _>(&measurement::BearingOnly::new(position_m, sd)?, path, times, stream)
            }
            Measures::Range { position_m, range_sd_m: sd } => {
                report::<2, 1, _>(&measurement::RangeOnly::new(position_m, sd)?, path, times, stream)
            }
            Measures::Growth { variance } => {
                report::<1, 1, _>(&measurement::Growth::new(variance)?, path, times, stream)
            }
        }
    }
}

fn report<const N: usize, const M: usize, H>(
    sensor: &H,
    path: &[Vec<f64>],
    times: &[Time],
    stream: Stream,
) -> zerre::Result<Vec<Vec<f64>>>
where
    H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]>,
{
    let states: Vec<[f64; N]> =
        path.iter().map(|x| leading("components of the state", x)).collect::<zerre::Result<_>>()?;
    Ok(simulate::measurements(sensor, &states, times, stream)?.into_iter().map(Vec::from).collect())
}

impl Scenario {
    /// Whether it has a meaning.
    ///
    /// # Errors
    /// The first value that has none.
    pub fn check(&self) -> Result<(), Invalid> {
        let at = |path: &[&str]| path.iter().map(|key| (*key).to_owned()).collect::<Vec<_>>();
        let refuse = |path: &[&str], what: String| Err(Invalid { path: at(path), what });
        for (key, value) in [("step_s", self.step_s), ("duration_s", self.duration_s)] {
            if !(value.is_finite() && value > 0.0) {
                return refuse(&[key], format!("{value} is out of range; a number above zero is needed"));
            }
        }
        let step = Span::from_secs(self.step_s).nanos();
        if step == 0 {
            return refuse(&["step_s"], format!("{} is below a nanosecond", self.step_s));
        }
        if Span::from_secs(self.duration_s).nanos() / step >= MOST_INSTANTS {
            return refuse(&["duration_s"], format!("there would be more than {MOST_INSTANTS} instants"));
        }
        self.motion
            .path(&vec![0.0; self.motion.dimension()], &[Time::ZERO], Stream::new(0))
            .map_err(|error| Invalid { path: at(&["motion"]), what: error.to_string() })?;
        if self.target.is_empty() {
            return refuse(&["target"], "at least one target is needed".to_owned());
        }
        for (i, target) in self.target.iter().enumerate() {
            let i_text = i.to_string();
            let place = |key| ["target", &i_text, key];
            if target.id.is_empty() || self.target[..i].iter().any(|other| other.id == target.id) {
                return refuse(&place("id"), format!("{:?} is no identity of its own", target.id));
            }
            let n = self.motion.dimension();
            for (key, values) in [("start", &target.start), ("start_sd", &target.start_sd)] {
                let absent = key == "start_sd" && values.is_empty();
                if values.len() != n && !absent {
                    let (found, model) = (values.len(), self.motion.name());
                    return refuse(&place(key), format!("{found} numbers; the state of {model} has {n}"));
                }
                if let Some(bad) = values.iter().find(|v| !v.is_finite() || key == "start_sd" && **v < 0.0) {
                    return refuse(&place(key), format!("{bad} is out of range"));
                }
            }
        }
        if self.sensor.is_empty() {
            return refuse(&["sensor"], "at least one sensor is needed".to_owned());
        }
        let growth = !self.trackable();
        for (i, sensor) in self.sensor.iter().enumerate() {
            let i_text = i.to_string();
            let place = |key| ["sensor", &i_text, key];
            let alone = self.sensor.len() == 1;
            if !alone && (sensor.name.is_empty() || self.sensor[..i].iter().any(|s| s.name == sensor.name)) {
                return refuse(&place("name"), format!("{:?} is no name of its own", sensor.name));
            }
            if !(0.0..=1.0).contains(&sensor.detection) {
                let what = format!("{} is out of range; a number from 0 to 1 is needed", sensor.detection);
                return refuse(&place("detection"), what);
            }
            if growth != matches!(sensor.measures, Measures::Growth { .. }) {
                let what = "the growth motion and the growth measurement go together only";
                return refuse(&place("measures"), what.to_owned());
            }
            sensor
                .measures
                .see(&[], &[], Stream::new(0))
                .map_err(|error| Invalid { path: at(&place("measures")), what: error.to_string() })?;
        }
        Ok(())
    }

    /// Whether its tables are measurements of places: those of the growth model are pure numbers.
    pub fn trackable(&self) -> bool {
        !matches!(self.motion, MotionModel::Growth { .. })
    }

    /// The instants: 0, `step_s`, ..., the last one not after `duration_s`.
    pub fn times(&self) -> Vec<Time> {
        let step = Span::from_secs(self.step_s).nanos().max(1);
        let last = (Span::from_secs(self.duration_s).nanos() / step).clamp(0, MOST_INSTANTS);
        (0..=last).map(|k| Time::from_nanos(k * step)).collect()
    }

    /// Draws run number `run` under `seed`: the same numbers on every machine, whatever other runs there are.
    ///
    /// # Errors
    /// What the models refuse; nothing for a scenario that passes [`Scenario::check`], unless a target comes so far
    /// that its numbers are not finite.
    pub fn draw(&self, seed: u64, run: u32) -> zerre::Result<Run> {
        let times = self.times();
        let world = Stream::new(seed).fork(u64::from(self.seed)).fork(u64::from(run));
        let mut drawn = Run { truth: Vec::new(), measurements: Vec::new() };
        for (t, target) in self.target.iter().enumerate() {
            let of_target = world.fork(t as u64);
            let mut draws = of_target.draws(Purpose::Prior, 0, 0);
            let start: Vec<f64> = (0..target.start.len())
                .map(|i| target.start[i] + target.start_sd.get(i).copied().unwrap_or(0.0) * draws.normal())
                .collect();
            let path = self.motion.path(&start, &times, of_target)?;
            for (s, sensor) in self.sensor.iter().enumerate() {
                let of_sensor = of_target.fork(s as u64);
                let seen = sensor.measures.see(&path, &times, of_sensor)?;
                for ((k, &time), values) in (0..).zip(&times).zip(seen) {
                    if of_sensor.draws(Purpose::Other, k, 0).uniform() < sensor.detection {
                        drawn.measurements.push(Measured { time, target: t, sensor: s, values });
                    }
                }
            }
            let shown = self.motion.columns().len();
            for (&time, mut state) in times.iter().zip(path) {
                state.truncate(shown);
                drawn.truth.push(TruePoint { time, target: t, state });
            }
        }
        drawn.truth.sort_by_key(|point| (point.time, point.target));
        drawn.measurements.sort_by_key(|m| (m.time, m.target, m.sensor));
        Ok(drawn)
    }
}

fn target(id: &str, start: &[f64], start_sd: &[f64]) -> Target {
    Target { id: id.to_owned(), start: start.to_vec(), start_sd: start_sd.to_vec() }
}

fn sensor(name: &str, measures: Measures) -> Sensor {
    Sensor { name: name.to_owned(), measures, detection: 1.0 }
}

fn radar_cv() -> Scenario {
    Scenario {
        step_s: 1.0,
        duration_s: 99.0,
        seed: 0,
        motion: MotionModel::ConstantVelocity { acceleration_density: 0.05 },
        target: vec![target("1", &[0.0, 0.0, 0.5, 0.3], &[0.5, 0.5, 0.3, 0.3])],
        sensor: vec![sensor(
            "",
            Measures::RangeBearing { position_m: [-6.0, 12.0], range_sd_m: 0.1, bearing_sd_rad: 0.01 },
        )],
    }
}

fn growth() -> Scenario {
    Scenario {
        step_s: 1.0,
        duration_s: 99.0,
        seed: 0,
        motion: MotionModel::Growth { variance: 10.0 },
        // A variance of 10.
        target: vec![target("1", &[0.0], &[10.0_f64.sqrt()])],
        sensor: vec![sensor("", Measures::Growth { variance: 1.0 })],
    }
}

fn turn() -> Scenario {
    Scenario {
        step_s: 4.0,
        duration_s: 400.0,
        seed: 0,
        motion: MotionModel::CoordinatedTurn {
            turn_rate_rad_s: 3.0_f64.to_radians(),
            acceleration_density: 0.1,
        },
        target: vec![target("1", &[20_000.0, 10_000.0, -120.0, 60.0], &[100.0, 100.0, 5.0, 5.0])],
        sensor: vec![sensor(
            "",
            Measures::RangeBearing { position_m: [0.0, 0.0], range_sd_m: 50.0, bearing_sd_rad: 0.002 },
        )],
    }
}

fn bearings_only() -> Scenario {
    let station = |name, x| sensor(name, Measures::Bearing { position_m: [x, 0.0], bearing_sd_rad: 0.01 });
    Scenario {
        step_s: 10.0,
        duration_s: 1200.0,
        seed: 0,
        motion: MotionModel::ConstantVelocity { acceleration_density: 1e-4 },
        target: vec![target("1", &[-2000.0, 4000.0, 4.0, -1.0], &[100.0, 100.0, 0.5, 0.5])],
        sensor: vec![station("west", -3000.0), station("east", 3000.0)],
    }
}

fn two_crossing() -> Scenario {
    Scenario {
        step_s: 1.0,
        duration_s: 120.0,
        seed: 0,
        motion: MotionModel::ConstantVelocity { acceleration_density: 0.01 },
        target: vec![
            target("a", &[-300.0, -100.0, 5.0, 1.7], &[5.0, 5.0, 0.2, 0.2]),
            target("b", &[-300.0, 100.0, 5.0, -1.7], &[5.0, 5.0, 0.2, 0.2]),
        ],
        sensor: vec![Sensor { detection: 0.9, ..sensor("", Measures::Position { position_sd_m: 5.0 }) }],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_named_scenario_is_sound_and_draws_the_same_twice() {
        for named in SCENARIOS {
            let scenario = (named.scenario)();
            assert_eq!(scenario.check(), Ok(()), "{}", named.name);
            assert_eq!(find(named.name), Some(scenario.clone()));
            assert_eq!(SCENARIOS.iter().filter(|other| other.name == named.name).count(), 1);
            let run = scenario.draw(7, 0).unwrap();
            assert_eq!(run, scenario.draw(7, 0).unwrap());
            assert_eq!(run.truth.len(), scenario.times().len() * scenario.target.len());
            for other in [scenario.draw(8, 0), scenario.draw(7, 1)] {
                assert_ne!(run, other.unwrap(), "{}", named.name);
            }
            assert_ne!(run, Scenario { seed: 1, ..scenario }.draw(7, 0).unwrap());
        }
    }

    #[test]
    fn instants_are_exact_and_end_in_time() {
        let scenario = Scenario { step_s: 0.1, duration_s: 0.35, ..radar_cv() };
        let nanos: Vec<_> = scenario.times().into_iter().map(Time::nanos).collect();
        assert_eq!(nanos, [0, 100_000_000, 200_000_000, 300_000_000]);
    }

    #[test]
    fn measurements_err_as_the_sensor_says() {
        // 40 runs of 100 measurements: the mean of 4000 squared unit normals has standard deviation
        // sqrt(2 / 4000) = 0.022; 5 of them are allowed. Twice that standard deviation would show 4 in place of 1.
        let scenario = radar_cv();
        let (mut range, mut bearing, mut count) = (0.0, 0.0, 0.0);
        for run in 0..40 {
            let run = scenario.draw(1, run).unwrap();
            for (m, t) in run.measurements.iter().zip(&run.truth) {
                assert_eq!(m.time, t.time);
                let (dx, dy) = (t.state[0] + 6.0, t.state[1] - 12.0);
                let turn = m.values[1] - dy.atan2(dx);
                range += ((m.values[0] - dx.hypot(dy)) / 0.1).powi(2);
                bearing += (turn.sin().atan2(turn.cos()) / 0.01).powi(2);
                count += 1.0;
            }
        }
        for mean in [range / count, bearing / count] {
            assert!((mean - 1.0).abs() < 5.0 * 0.022, "{mean}");
        }
    }

    #[test]
    fn detection_is_a_share() {
        // 200 draws per run, 30 runs: sd sqrt(0.9 0.1 / 7260) = 0.0035; 5 of them are allowed.
        let scenario = two_crossing();
        let (seen, all) = (0..30)
            .map(|run| scenario.draw(3, run).unwrap())
            .fold((0, 0), |(seen, all), run| (seen + run.measurements.len(), all + run.truth.len()));
        assert!((seen as f64 / all as f64 - 0.9).abs() < 5.0 * 0.0035, "{seen} of {all}");
        let blind =
            Scenario { sensor: vec![Sensor { detection: 0.0, ..scenario.sensor[0].clone() }], ..scenario };
        assert!(blind.draw(3, 0).unwrap().measurements.is_empty());
    }

    #[test]
    fn what_has_no_meaning_is_refused_with_its_place() {
        let refused = |change: fn(&mut Scenario), path: &str| {
            let mut scenario = radar_cv();
            change(&mut scenario);
            let invalid = scenario.check().unwrap_err();
            assert_eq!(invalid.path.join("."), path, "{invalid}");
        };
        refused(|s| s.step_s = 0.0, "step_s");
        refused(|s| s.step_s = 1e-12, "step_s");
        refused(|s| s.duration_s = f64::NAN, "duration_s");
        refused(|s| s.duration_s = 1e9, "duration_s");
        refused(|s| s.motion = MotionModel::ConstantVelocity { acceleration_density: -1.0 }, "motion");
        refused(|s| s.target.clear(), "target");
        refused(|s| s.target.push(s.target[0].clone()), "target.1.id");
        refused(|s| s.target[0].start.truncate(3), "target.0.start");
        refused(|s| s.target[0].start_sd = vec![0.0, 0.0, 0.0, -1.0], "target.0.start_sd");
        refused(|s| s.target[0].start[1] = f64::INFINITY, "target.0.start");
        refused(|s| s.sensor.clear(), "sensor");
        refused(|s| s.sensor.push(s.sensor[0].clone()), "sensor.0.name");
        refused(|s| s.sensor[0].detection = 1.5, "sensor.0.detection");
        refused(|s| s.sensor[0].measures = Measures::Growth { variance: 1.0 }, "sensor.0.measures");
        refused(|s| s.sensor[0].measures = Measures::Position { position_sd_m: 0.0 }, "sensor.0.measures");
    }

    #[test]
    fn names_are_those_of_the_catalogue() {
        for named in SCENARIOS {
            let name = (named.scenario)().motion.name();
            assert!(zerre::catalog::MOTIONS.iter().any(|entry| entry.name == name), "{name}");
        }
    }
}
