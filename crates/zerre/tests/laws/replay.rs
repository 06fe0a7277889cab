//! Law 8: a belief that is saved and loaded continues to the same bits.

use crate::list::{Estimates, Means, Run, UnderLaw, World, filters};
use crate::worlds::{self, Seen};
use crate::{Verdict, uphold};
use zerre::Result;
use zerre::Time;
use zerre::belief::Cloud;
use zerre::filter::{Filter, Outcome, ParticleFilter, Settings, Update};
use zerre::kernels::Simd;
use zerre::math::{Matrix, Real};
use zerre::model::Measurement;
use zerre::model::measurement::Position;
use zerre::model::motion::ConstantVelocity;
use zerre::resample::Trigger;
use zerre::rng::Stream;

/// The law: at every step a saved twin is loaded and goes on beside the run until the end.
fn replays(filter: &dyn UnderLaw, script: &[Seen]) -> Verdict {
    for pause in 0..script.len() {
        let mut run = filter.begin(Stream::new(4));
        for (to, z) in &script[..pause] {
            run.step(*to, z.as_ref()).unwrap();
        }
        let saved = run.save();
        let mut twin = filter.resume(&saved);
        if twin.save() != saved {
            return Err(format!("loaded after {pause} steps it is another belief"));
        }
        for (k, (to, z)) in script.iter().enumerate().skip(pause) {
            let updates = (run.step(*to, z.as_ref()), twin.step(*to, z.as_ref()));
            let same = updates.0 == updates.1
                && run.mean() == twin.mean()
                && run.covariance() == twin.covariance()
                && run.save() == twin.save();
            if !same {
                return Err(format!("loaded after {pause} steps it differs in step {k}"));
            }
        }
    }
    Ok(())
}

#[test]
fn every_belief_continues() {
    let world = worlds::linear(2.0);
    let (script, _) = worlds::script(&world, Stream::new(2));
    let list = filters(&world, &Means::serial(300));
    uphold(list.iter().map(|e| (e.name.clone(), replays(&*e.filter, &script))));
}

type Sir<H> = ParticleFilter<4, 4, ConstantVelocity<2>, H>;

fn sir<H: Measurement<4>>(sensor: H, trigger: Trigger) -> Sir<H> {
    let World { prior, motion, .. } = worlds::linear(2.0);
    let settings = Settings { particles: 600, trigger, simd: Simd::best(), ..Settings::default() };
    ParticleFilter::new(prior, motion, sensor, settings).unwrap()
}

/// A belief that keeps single precision, or forgets which numbers were drawn.
struct Forgetful {
    filter: Sir<Position<2>>,
    how: How,
}

#[derive(Clone, Copy)]
enum How {
    Not,
    Digits,
    Stream,
    Weights,
}

struct ForgetfulRun<'f> {
    of: &'f Forgetful,
    cloud: Cloud<4>,
}

impl UnderLaw for Forgetful {
    fn begin(&self, stream: Stream) -> Box<dyn Run + '_> {
        Box::new(ForgetfulRun { of: self, cloud: self.filter.start(Time::ZERO, stream).unwrap() })
    }
    fn resume(&self, saved: &str) -> Box<dyn Run + '_> {
        let whole: Cloud<4> = serde_json::from_str(saved).unwrap();
        let columns = |round: fn(f64) -> f64| {
            std::array::from_fn(|k| whole.column(k).iter().map(|&x| round(x)).collect())
        };
        let cloud = match self.how {
            How::Not => whole,
            How::Stream => whole.fork(1),
            How::Digits => {
                Cloud::from_columns(whole.time(), Stream::new(4), columns(|x| f64::from(x as f32))).unwrap()
            }
            How::Weights => Cloud::from_columns(whole.time(), Stream::new(4), columns(|x| x)).unwrap(),
        };
        Box::new(ForgetfulRun { of: self, cloud })
    }
}

impl Run for ForgetfulRun<'_> {
    fn step(&mut self, to: Time, z: Option<&[f64; 2]>) -> Result<Update> {
        self.of.filter.step(&mut self.cloud, to, z)
    }
    fn save(&self) -> String {
        serde_json::to_string(&self.cloud).unwrap()
    }
}

impl Estimates for ForgetfulRun<'_> {
    fn mean(&self) -> [f64; 4] {
        self.cloud.mean()
    }
    fn covariance(&self) -> Matrix<4, 4> {
        self.cloud.covariance()
    }
}

#[test]
fn the_law_finds_what_is_lost() {
    let world = worlds::linear(2.0);
    let (script, _) = worlds::script(&world, Stream::new(2));
    let judge = |how| replays(&Forgetful { filter: sir(world.sensor, Trigger::Below(0.5)), how }, &script);
    judge(How::Not).unwrap();
    for how in [How::Digits, How::Stream, How::Weights] {
        assert!(judge(how).is_err());
    }
}

/// Sees the target in a half-plane only: half of the weights become zero, whose logarithm is -inf.
#[derive(Clone, Copy)]
struct HalfPlane;

impl Measurement<4> for HalfPlane {
    type Value = [f64; 2];
    type Given<'z> = f64;
    fn given(&self, z: &[f64; 2], _: Time) -> Result<f64> {
        Ok(z[0])
    }
    #[inline(always)]
    fn log_likelihood<R: Real>(&border: &f64, x: [R; 4]) -> R {
        let none = x[0].constant(f64::NEG_INFINITY);
        x[0].if_lt(x[0].constant(border), -(x[1] * x[1]) * 0.1, none)
    }
}

/// Text has no infinities, and some formats have no names: the zero weights survive both, and whole blocks of them.
#[test]
fn zero_weights_are_saved() {
    for (border, expected) in [(0.3, Outcome::Updated), (-1e9, Outcome::Degenerate)] {
        for trigger in [Trigger::Never, Trigger::Below(0.2), Trigger::Always] {
            let filter = sir(HalfPlane, trigger);
            let mut cloud = filter.start(Time::ZERO, Stream::new(1)).unwrap();
            let update = filter.step(&mut cloud, Time::from_secs(1.0), Some(&[border, 0.0])).unwrap();
            assert_eq!(update.outcome, expected);
            let text = serde_json::to_string(&cloud).unwrap();
            let bytes = postcard::to_allocvec(&cloud).unwrap();
            let twins: [Cloud<4>; 2] =
                [serde_json::from_str(&text).unwrap(), postcard::from_bytes(&bytes).unwrap()];
            for mut twin in twins {
                let mut cloud = cloud.clone();
                for k in 2..5 {
                    let to = Time::from_secs(f64::from(k));
                    let z = [2.0, 0.0];
                    let update = filter.step(&mut cloud, to, Some(&z)).unwrap();
                    assert_eq!(filter.step(&mut twin, to, Some(&z)).unwrap(), update);
                    assert_eq!(twin.mean(), cloud.mean());
                    assert!(twin.weights().eq(cloud.weights()));
                }
            }
        }
    }
}

/// What was tampered with is refused, not continued.
#[test]
fn broken_saves_are_refused() {
    let filter = sir(worlds::linear(2.0).sensor, Trigger::Never);
    let mut cloud = filter.start(Time::ZERO, Stream::new(1)).unwrap();
    filter.step(&mut cloud, Time::ZERO, Some(&[0.0, 0.0])).unwrap();
    let whole: serde_json::Value = serde_json::to_value(&cloud).unwrap();
    let load = |value: &serde_json::Value| serde_json::from_str::<Cloud<4>>(&value.to_string());
    load(&whole).unwrap();
    assert!(serde_json::from_str::<Cloud<3>>(&whole.to_string()).is_err());
    let fields: Vec<String> = whole.as_object().unwrap().keys().cloned().collect();
    for field in &fields {
        let mut without = whole.clone();
        without.as_object_mut().unwrap().remove(field);
        // An absent option is `None`: equal weights, no survivors.
        assert_eq!(load(&without).is_ok(), ["log_weights", "survivors"].contains(&field.as_str()), "{field}");
    }
    let broken = |path: &str, value: serde_json::Value| {
        let mut broken = whole.clone();
        *broken.pointer_mut(path).unwrap() = value;
        load(&broken).is_err()
    };
    assert!(broken("/weights", vec![1.0].into()));
    assert!(broken("/weights/3", (-1.0).into()));
    assert!(broken("/states/0", vec![1.0; 3].into()));
    assert!(broken("/states", vec![vec![1.0; 600]; 3].into()));
    assert!(broken("/survivors", vec![600; 600].into()));
    // As many as may be, of another number than the particles; but not none.
    assert!(!broken("/survivors", vec![1; 5].into()));
    assert!(broken("/survivors", serde_json::Value::Array(vec![])));
    assert!(broken("/log_weights", vec![0.0; 5].into()));
    assert!(broken("/blocks", serde_json::Value::Array(vec![])));
}
