//! From a configuration and a recording to a tracker, with the reason for every value.

use super::extended::Extended;
use super::input::Input;
use super::work::Reference;
use crate::args::Track;
use crate::config::{
    Effective, Estimate, FilterConfig, Generator, ModesConfig, MotionConfig, Normals, Reason, ResampleWhen,
    Robust, Source, TrackConfig,
};
use crate::console::Console;
use crate::diagnostic::{Diagnostic, suggest};
use std::collections::BTreeSet;
use zerre::Span;
use zerre::kernels::{Generator as Words, NoiseSource, Resolution};
use zerre::resample::{Resampling, Trigger};
use zerre::track::{
    DEFAULT_SENSOR, Estimate as Point, FilterSpec, HEAVY_TAILS, LifeSpec, ModeSpec, MotionSpec, Noise, Plot,
    Robust as Tails, SensorSpec, StartSpec, TrackerSpec, Unknown, has_modes, has_particles, has_size,
    has_turns, learn,
};
use zerre_io::{Format, Geodetic, LocalFrame, Options};

/// Settled step by step: what the file says, what the recording adds.
#[derive(Clone)]
pub(super) struct Settings {
    config: TrackConfig,
    pub effective: Effective,
    /// How to read.
    pub options: Options,
    spec: TrackerSpec,
    /// Of targets that give many points a scan; the specification has the motion then, and no filter.
    pub extended: Option<Extended>,
    /// Why a Kalman filter took the place of the particles.
    preferred: Option<String>,
}

/// Failure of a model, a sentence of the library; `place` is what it was at work on.
pub(super) fn refused(place: &str, error: &zerre::Error) -> Diagnostic {
    Diagnostic::new(format!("{place}: {error}"))
        .help("`zerre track --explain` shows the settings, `zerre catalog` the choices")
}

pub(super) const AUTO: &str = "auto";

impl Settings {
    pub fn new(
        args: &Track,
        source: Option<Source>,
        mut config: TrackConfig,
    ) -> Result<Settings, Diagnostic> {
        let mut effective = Effective::new(source);
        if let Some(name) = &args.filter {
            let (place, path) = match &mut config.extended {
                Some(extended) => (&mut extended.filter, ["extended", "filter"]),
                None => (&mut config.filter.name, ["filter", "name"]),
            };
            *place = Some(name.clone());
            effective.from_flag(&path, "--filter");
        }
        if let Some(name) = &args.motion {
            config.motion.model = Some(name.clone());
            effective.from_flag(&["motion", "model"], "--motion");
        }
        if let Some(format) = args.format {
            config.input.format = Some(format);
            effective.from_flag(&["input", "format"], "--format");
        }
        let extended = Extended::settle(&config, &mut effective)?;
        let mut spec = match &extended {
            Some(extended) => {
                check_modes(&config, extended.spec.filter.name(), &effective)?;
                let motion = motion(&config, &mut effective)?;
                if motion.model != EXTENDED_MOTION {
                    let text = format!("motion.model: extended targets move by `{EXTENDED_MOTION}`");
                    let help =
                        "leave it out: what a target does beyond that, its acceleration noise allows for";
                    return Err(effective.at_value(&["motion", "model"], Diagnostic::new(text).help(help)));
                }
                TrackerSpec { motion, ..TrackerSpec::new("kalman", EXTENDED_MOTION) }
            }
            None => {
                let filter = filter(&config, &mut effective)?;
                let motion = motion(&config, &mut effective)?;
                check_modes(&config, &filter.name, &effective)?;
                let start = start(&config, &mut effective);
                let life = life(&config, &mut effective);
                TrackerSpec { filter, motion, start, life, ..TrackerSpec::new("kalman", "") }
            }
        };
        spec.seed = 0;
        let input = config.input.settle(&mut effective);
        let format = serde_json::to_value(input.format)
            .and_then(serde_json::from_value::<Format>)
            .map_err(|error| Diagnostic::new(error.to_string()))?;
        let origin = config.input.origin.map(|o| Geodetic::new(o.lat_deg, o.lon_deg, o.alt_m)).transpose();
        let options = Options {
            format,
            columns: config.input.columns.clone(),
            sizes: has_size(&spec.motion.model),
            three_d: false,
            origin: origin.map_err(|error| Diagnostic::new(error.to_string()))?,
            max_rejected: input.max_rejected,
        };
        Ok(Settings { config, effective, options, spec, extended, preferred: None })
    }

    /// The tracker's specification.
    pub fn spec(&self, seed: u64) -> TrackerSpec {
        TrackerSpec { seed, ..self.spec.clone() }
    }

    /// Settles what depends on the recording, which is named `from`: dimensions, sensors, and noises that nobody
    /// told.
    pub fn settle(
        &mut self,
        plots: &[Plot],
        from: &str,
        has_height: bool,
        console: &Console,
    ) -> Result<(), Diagnostic> {
        self.spec.dimensions = if has_height { 3 } else { 2 };
        self.sensors()?;
        let unknown = self.unknown(plots);
        if unknown.is_empty() {
            return Ok(());
        }
        let learnt = learn(&self.spec, &unknown, plots).map_err(|error| {
            let keys: Vec<String> = unknown.iter().map(|unknown| self.key_of(unknown)).collect();
            let text = format!("give them in a configuration (`zerre init track`): {}", keys.join(", "));
            Diagnostic::new(format!("{from}: {error}")).help(text)
        })?;
        let how = format!(
            "by maximum likelihood from {} measurements of {}",
            learnt.plots,
            counted(learnt.targets, "target")
        );
        for (unknown, &value) in unknown.iter().zip(&learnt.values) {
            let reason = Reason::Learnt(how.clone());
            match unknown {
                Unknown::Motion => {
                    self.effective.put(&["motion", self.spec.motion.wander().0], value, reason);
                }
                Unknown::Sensor(name, noise) => {
                    self.effective.put(&["sensor", name, key(*noise)], value, reason);
                }
                Unknown::Stay | Unknown::TurnRate | Unknown::Manoeuvre => {
                    self.effective.put(&["motion", "modes", mode_key(unknown)], value, reason);
                }
            }
        }
        if let Some((sensors, gain)) = &learnt.heavy_tails {
            for name in sensors {
                let how = format!("heavier tails than the normal law raise the log-evidence by {gain:.0}");
                self.effective.put(&["sensor", name, "robust"], heavy_tails(), Reason::Learnt(how));
            }
        }
        self.spec = learnt.spec;
        console.debug(format_args!("learnt {:?} of {unknown:?}", learnt.values));
        Ok(())
    }

    /// Settles what extended targets leave to the recording.
    pub fn settle_extended(&mut self, input: &Input) -> Result<(), Diagnostic> {
        if let Some(extended) = &mut self.extended {
            extended.learn(input, &mut self.effective)?;
            self.spec.motion.set_wander(extended.spec.acceleration_sd_mps2);
        }
        Ok(())
    }

    /// The sensors of the file, `default` aside, that are none of `seen`.
    pub fn idle_sensors(&self, seen: &BTreeSet<String>) -> Vec<&str> {
        let names = self.config.sensor.keys().map(String::as_str);
        names.filter(|name| *name != DEFAULT_SENSOR && !seen.contains(*name)).collect()
    }

    /// Refuses a sensor in the file that no plot is of: its settings would have no effect, and nobody would know.
    pub fn check_sensors(&self, plots: &[Plot]) -> Result<(), Diagnostic> {
        let seen: BTreeSet<String> =
            plots.iter().filter_map(|plot| plot.sensor.as_deref()).map(str::to_owned).collect();
        let Some(&name) = self.idle_sensors(&seen).first() else { return Ok(()) };
        let text = format!("sensor.{name}: no measurement is of a sensor of this name");
        let refusal = self.effective.at_key(&["sensor", name], Diagnostic::new(text));
        if seen.is_empty() {
            let help =
                "the recording names no sensors: settings of its only one stand under [sensor.default]";
            return Err(refusal.help(help));
        }
        let known: Vec<&str> = seen.iter().map(String::as_str).collect();
        Err(suggest(refusal, name, &known).help("leave its section out if it is silent in this recording"))
    }

    /// A refusal of a reader; one of a mapping or an origin points into the configuration that gave it.
    pub fn refused_by_reader(&self, error: &zerre_io::Error) -> Diagnostic {
        use zerre_io::Error::{BadMapping, DuplicateColumn, NotInHeader, PolarOrigin, Unpaired};
        let refusal = super::input::refused(error);
        let columns = match error {
            NotInHeader { column, .. } => {
                return self.effective.at_key(&["input", "columns", column], refusal);
            }
            PolarOrigin { .. } => return self.effective.at_key(&["input", "origin"], refusal),
            BadMapping { column, .. } | Unpaired { column, .. } => vec![column],
            DuplicateColumn { first, second, .. } => vec![second, first],
            _ => Vec::new(),
        };
        match columns.into_iter().find(|column| self.options.columns.contains_key(*column)) {
            Some(column) => self.effective.at_value(&["input", "columns", column], refusal),
            None => refusal,
        }
    }

    /// Where the configuration gives a noise.
    fn key_of(&self, unknown: &Unknown) -> String {
        match unknown {
            Unknown::Motion => format!("{} under [motion]", self.spec.motion.wander().0),
            Unknown::Sensor(name, noise) => format!("{} under [sensor.{name}]", key(*noise)),
            Unknown::Stay | Unknown::TurnRate | Unknown::Manoeuvre => {
                format!("{} under [motion.modes]", mode_key(unknown))
            }
        }
    }

    /// The same for filters of the Kalman family without and with modes, if nobody asked for another: noises are learnt
    /// for the filter that uses them.
    pub fn rivals(&self) -> Option<[Settings; 2]> {
        let asked = self.config.filter.name.as_deref().is_some_and(|name| name != AUTO);
        (!asked).then(|| {
            ["ukf", "imm-ekf"].map(|filter| {
                let mut rival = self.clone();
                rival.spec.filter.name = filter.to_owned();
                rival
            })
        })
    }

    /// The filters that those with particles are measured against: of the Kalman family, with modes or
    /// without as they are.
    pub fn references(&self) -> &'static [&'static str] {
        if has_modes(&self.spec.filter.name) { super::work::MODAL } else { super::work::PLAIN }
    }

    /// Takes the filter of the Kalman family that the particles lost against.
    pub fn prefer(&mut self, reference: &Reference) {
        let why = format!(
            "{} lose{} {:.2} of log-evidence per measurement against it",
            counted(self.spec.filter.particles, "particle"),
            if self.spec.filter.particles == 1 { "s" } else { "" },
            reference.loss_per_plot()
        );
        self.spec.filter.name = reference.filter.to_owned();
        self.effective.put(&["filter", "name"], reference.filter, Reason::Chosen(why.clone()));
        self.preferred = Some(why);
    }

    /// The filter in a few words.
    pub fn filter_text(&self) -> String {
        if let Some(extended) = &self.extended {
            return extended.filter_text();
        }
        let filter = &self.spec.filter;
        match &self.preferred {
            Some(why) => format!("{}: {why}", filter.name),
            None if has_particles(&filter.name) => {
                format!("{}, {}", filter.name, counted(filter.particles, "particle"))
            }
            None if filter.name == "rb-mmpf" => {
                let hypotheses = if filter.particles == 1 { "hypothesis" } else { "hypotheses" };
                format!("{}, {} {hypotheses}", filter.name, filter.particles)
            }
            None => filter.name.clone(),
        }
    }

    /// The sensors of the file; positions on the earth become positions in the plane.
    pub fn sensors(&mut self) -> Result<(), Diagnostic> {
        for (name, sensor) in &self.config.sensor {
            let at = |key| ["sensor", name.as_str(), key];
            let mut position_m = [0.0; 3];
            if let Some(list) = self.effective.settle_given(&at("position_m"), &sensor.position_m) {
                position_m.iter_mut().zip(list).for_each(|(to, from)| *to = from);
            }
            if let Some(place) = self.effective.settle_given(&at("position"), &sensor.position) {
                let Some(origin) = self.options.origin else {
                    let text = format!("sensor.{name}.position needs the origin of the plane");
                    let help = "give `origin` under [input], or `position_m` of the sensor";
                    return Err(self.effective.at_key(&at("position"), Diagnostic::new(text)).help(help));
                };
                let place = Geodetic::new(place.lat_deg, place.lon_deg, place.alt_m)
                    .map_err(|error| Diagnostic::new(error.to_string()))?;
                position_m = LocalFrame::new(origin).local(place);
            }
            let robust = self.effective.settle_given(&at("robust"), &sensor.robust);
            let spec = SensorSpec {
                position_m,
                position_sd_m: self.effective.settle_given(&at("position_sd_m"), &sensor.position_sd_m),
                range_sd_m: self.effective.settle_given(&at("range_sd_m"), &sensor.range_sd_m),
                bearing_sd_rad: self.effective.settle_given(&at("bearing_sd_rad"), &sensor.bearing_sd()),
                elevation_sd_rad: self
                    .effective
                    .settle_given(&at("elevation_sd_rad"), &sensor.elevation_sd()),
                range_rate_sd_mps: self
                    .effective
                    .settle_given(&at("range_rate_sd_mps"), &sensor.range_rate_sd_mps),
                size_sd_m: self.effective.settle_given(&at("size_sd_m"), &sensor.size_sd_m),
                orientation_sd_rad: self
                    .effective
                    .settle_given(&at("orientation_sd_rad"), &sensor.orientation_sd()),
                gate: self.effective.settle_given(&at("gate"), &sensor.gate),
                robust: robust.map(|robust| match robust {
                    Robust::StudentT { dof } => Tails::StudentT { dof },
                    Robust::Outliers { share, scale } => Tails::Outliers { share, scale },
                }),
            };
            self.spec.sensors.insert(name.clone(), spec);
        }
        self.spec.sensors.entry(DEFAULT_SENSOR.to_owned()).or_default();
        Ok(())
    }

    /// The noises that the plots depend on and nobody told.
    pub fn unknown(&self, plots: &[Plot]) -> Vec<Unknown> {
        let mut unknown = BTreeSet::new();
        let section = |plot: &Plot| match plot.sensor.as_deref() {
            Some(name) if self.spec.sensors.contains_key(name) => name.to_owned(),
            _ => DEFAULT_SENSOR.to_owned(),
        };
        for plot in plots {
            let name = section(plot);
            for &noise in Noise::of(&plot.reading) {
                if self.spec.sensors.get(&name).is_none_or(|sensor| sensor.sd(noise).is_none()) {
                    unknown.insert(Unknown::Sensor(name.clone(), noise));
                }
            }
        }
        if self.spec.motion.wander().1.is_none() {
            unknown.insert(Unknown::Motion);
        }
        if has_modes(&self.spec.filter.name) {
            let motion = &self.spec.motion;
            let turns = has_turns(&motion.model, self.spec.dimensions);
            let modes = [
                (Unknown::Stay, motion.modes.stay_s.is_none()),
                (Unknown::TurnRate, turns && motion.modes.turn_rate_rad_s.is_none()),
                (Unknown::Manoeuvre, motion.modes.manoeuvre_factor.is_none()),
            ];
            unknown.extend(modes.into_iter().filter(|(_, open)| *open).map(|(unknown, _)| unknown));
        }
        unknown.into_iter().collect()
    }
}

/// The law that learning tries, as the configuration writes it.
fn heavy_tails() -> Option<Robust> {
    match HEAVY_TAILS {
        Tails::StudentT { dof } => Some(Robust::StudentT { dof }),
        Tails::Outliers { share, scale } => Some(Robust::Outliers { share, scale }),
    }
}

/// How extended targets move.
const EXTENDED_MOTION: &str = "constant-velocity";

/// "1 target", "3 targets".
pub(super) fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// Key of a noise in the configuration.
fn key(noise: Noise) -> &'static str {
    match noise {
        Noise::Position => "position_sd_m",
        Noise::Range => "range_sd_m",
        Noise::Bearing => "bearing_sd_rad",
        Noise::Elevation => "elevation_sd_rad",
        Noise::RangeRate => "range_rate_sd_mps",
        Noise::Size => "size_sd_m",
        Noise::Orientation => "orientation_sd_rad",
    }
}

/// Key of a number of the modes in the configuration.
fn mode_key(unknown: &Unknown) -> &'static str {
    match unknown {
        Unknown::Stay => "stay_s",
        Unknown::TurnRate => "turn_rate_rad_s",
        _ => "manoeuvre_factor",
    }
}

/// A name of a list, checked; `auto` becomes `choice` because `why`.
fn name_of(
    effective: &mut Effective,
    path: &[&str],
    (what, kind): (&str, &'static str),
    given: &Option<String>,
    (choice, why): (&str, &str),
) -> Result<String, Diagnostic> {
    let name = effective.settle(path, given, choice.to_owned(), why);
    if name == AUTO {
        effective.put(path, choice, Reason::Chosen(why.to_owned()));
        return Ok(choice.to_owned());
    }
    effective.check_name(path, what, &name, &crate::catalog::all(), kind)?;
    Ok(name)
}

fn filter(config: &TrackConfig, effective: &mut Effective) -> Result<FilterSpec, Diagnostic> {
    let choice = match config.motion.modes.given().first() {
        None => {
            let why = "it takes any model; a Kalman filter, with modes or without, takes its place where that has \
                       clearly more evidence";
            ("particle", why)
        }
        Some(_) => ("imm-ekf", "modes are told under [motion.modes]"),
    };
    let path = ["filter", "name"];
    let name = name_of(effective, &path, ("filter", "filters"), &config.filter.name, choice)?;
    check_filter(&config.filter, &name, effective)?;
    let mut spec = TrackerSpec::new(&name, "").filter;
    let settings = config.filter.settle_particles(&name, effective);
    let path = ["filter", "resampling"];
    effective.check_name(&path, "resampler", &settings.resampling, &crate::catalog::all(), "resamplers")?;
    spec.particles = settings.particles as usize;
    spec.resampling = match settings.resampling.as_str() {
        "multinomial" => Resampling::Multinomial,
        "residual" => Resampling::Residual,
        "stratified" => Resampling::Stratified,
        _ => Resampling::Systematic,
    };
    spec.trigger = match settings.resample_when {
        ResampleWhen::Never => Trigger::Never,
        ResampleWhen::Always => Trigger::Always,
        ResampleWhen::Below => Trigger::Below(settings.threshold),
    };
    spec.roughening = settings.roughening;
    spec.noise = NoiseSource {
        generator: match settings.generator {
            Generator::Philox => Words::Philox,
            Generator::Fast => Words::Xoshiro,
        },
        resolution: match settings.normals {
            Normals::F32 => Resolution::Bits32,
            Normals::F64 => Resolution::Bits64,
        },
    };
    Ok(spec)
}

/// Refuses a setting that the filter of this `name` would ignore.
fn check_filter(given: &FilterConfig, name: &str, effective: &Effective) -> Result<(), Diagnostic> {
    let used = FilterConfig::used_by(name);
    let Some(key) = given.given().into_iter().find(|key| !used.contains(key)) else { return Ok(()) };
    let filters = crate::catalog::names(&crate::catalog::all(), "filters");
    let takers = filters.into_iter().filter(|filter| FilterConfig::used_by(filter).contains(&key));
    let takers = takers.collect::<Vec<_>>().join(", ");
    let text = format!("filter.{key}: the filter `{name}` has no such setting");
    let help = format!("it is of {takers}; leave it out, or choose such a filter");
    Err(effective.at_key(&["filter", key], Diagnostic::new(text).help(help)))
}

fn motion(config: &TrackConfig, effective: &mut Effective) -> Result<MotionSpec, Diagnostic> {
    let given = &config.motion;
    let why = "the simplest that follows what travels";
    let model = name_of(
        effective,
        &["motion", "model"],
        ("motion", "motions"),
        &given.model,
        ("constant-velocity", why),
    )?;
    if MotionConfig::used_by(&model).is_empty() {
        let text =
            format!("the motion `{model}` is of a benchmark: no sensor that is tracked sees its one number");
        let help = "take another one of `zerre catalog motions`; the library has a measurement for it";
        return Err(effective.at_value(&["motion", "model"], Diagnostic::new(text)).help(help));
    }
    check_parameters(given, &model, effective)?;
    let at = |key| ["motion", key];
    let mut spec = MotionSpec {
        speed_sd_mps: effective.settle_given(&at("speed_sd_mps"), &given.speed_sd_mps),
        acceleration_sd_mps2: effective
            .settle_given(&at("acceleration_sd_mps2"), &given.acceleration_sd_mps2),
        jerk_sd_mps3: effective.settle_given(&at("jerk_sd_mps3"), &given.jerk_sd_mps3),
        turn_rate_rad_s: effective.settle_given(&at("turn_rate_rad_s"), &given.turn_rate_rad_s),
        lateral_acceleration_mps2: effective
            .settle_given(&at("lateral_acceleration_mps2"), &given.lateral_acceleration_mps2),
        turn_acceleration_sd_rad_s2: effective
            .settle_given(&at("turn_acceleration_sd_rad_s2"), &given.turn_acceleration_sd_rad_s2),
        size_sd_mps: effective.settle_given(&at("size_sd_mps"), &given.size_sd_mps),
        orientation_sd_rad_s: effective
            .settle_given(&at("orientation_sd_rad_s"), &given.orientation_sd_rad_s),
        tau_s: effective.settle_given(&at("tau_s"), &given.tau_s),
        turn_rate_sd_rad_s: None,
        modes: modes(&given.modes, effective),
        model,
    };
    match spec.model.as_str() {
        "singer" | "markov-turn" if spec.tau_s.is_none() => {
            let why = "evasive manoeuvres last ten to twenty seconds (Singer 1970)";
            spec.tau_s = Some(effective.settle(&at("tau_s"), &None, 20.0, why));
        }
        "constant-velocity-box" => {
            if spec.size_sd_mps.is_none() {
                let why = "what is seen of a body changes by metres as it turns";
                let path = at("size_sd_mps");
                spec.size_sd_mps = Some(effective.settle(&path, &None, 0.3, why));
            }
            if spec.orientation_sd_rad_s.is_none() {
                let why = "a vehicle turns by a few degrees per second";
                let path = at("orientation_sd_rad_s");
                spec.orientation_sd_rad_s = Some(effective.settle(&path, &None, 0.05, why));
            }
        }
        "wiener-turn" if spec.turn_acceleration_sd_rad_s2.is_none() => {
            let why = "a standard turn of aviation is entered within five seconds";
            let path = at("turn_acceleration_sd_rad_s2");
            spec.turn_acceleration_sd_rad_s2 = Some(effective.settle(&path, &None, 0.01, why));
        }
        _ => {}
    }
    if spec.model == "markov-turn" {
        spec.turn_rate_sd_rad_s = Some(config.start.turn_rate_sd_rad_s.unwrap_or(0.05));
    }
    if let ("singer", Some(largest), None) =
        (spec.model.as_str(), given.a_max_mps2, spec.acceleration_sd_mps2)
    {
        effective.settle_given(&at("a_max_mps2"), &given.a_max_mps2);
        let p_max = effective.settle(&at("p_max"), &given.p_max, 0.1, "Singer's example");
        let p_0 = effective.settle(&at("p_0"), &given.p_0, 0.6, "Singer's example");
        let variance = largest * largest / 3.0 * (1.0 + 4.0 * p_max - p_0);
        spec.acceleration_sd_mps2 = Some(variance.max(0.0).sqrt());
        let how = "a_max² / 3 (1 + 4 p_max - p_0), Singer 1970".to_owned();
        effective.put(&at("acceleration_sd_mps2"), spec.acceleration_sd_mps2, Reason::Chosen(how));
    }
    Ok(spec)
}

fn modes(given: &ModesConfig, effective: &mut Effective) -> ModeSpec {
    let at = |key| ["motion", "modes", key];
    ModeSpec {
        stay_s: effective.settle_given(&at("stay_s"), &given.stay_s),
        turn_rate_rad_s: effective.settle_given(&at("turn_rate_rad_s"), &given.turn_rate_rad_s),
        manoeuvre_factor: effective.settle_given(&at("manoeuvre_factor"), &given.manoeuvre_factor),
    }
}

/// Refuses modes that the filter would ignore.
fn check_modes(config: &TrackConfig, filter: &str, effective: &Effective) -> Result<(), Diagnostic> {
    let given = config.motion.modes.given();
    let Some(key) = given.first().filter(|_| !has_modes(filter)) else { return Ok(()) };
    let text = format!("motion.modes.{key}: the filter `{filter}` has no modes");
    let filters = crate::catalog::names(&crate::catalog::all(), "filters");
    let takers = filters.into_iter().filter(|filter| has_modes(filter)).collect::<Vec<_>>().join(", ");
    let refusal = Diagnostic::new(text).help(format!("choose one that has ({takers}), or leave it out"));
    Err(effective.at_key(&["motion", "modes", key], refusal))
}

/// Refuses a parameter of the motion that this `model` would ignore.
fn check_parameters(given: &MotionConfig, model: &str, effective: &Effective) -> Result<(), Diagnostic> {
    let refuse = |key: &str, what: &str, help: &str| {
        let refusal = Diagnostic::new(format!("motion.{key}: {what}")).help(help);
        Err(effective.at_key(&["motion", key], refusal))
    };
    let used = MotionConfig::used_by(model);
    if let Some(key) = given.given().into_iter().find(|key| !used.contains(key)) {
        let motions = crate::catalog::names(&crate::catalog::all(), "motions");
        let takers = motions.into_iter().filter(|motion| MotionConfig::used_by(motion).contains(&key));
        let takers = takers.collect::<Vec<_>>().join(", ");
        let what = format!("the motion `{model}` has no such parameter");
        return refuse(key, &what, &format!("it is of {takers}; leave it out, or choose such a model"));
    }
    if given.a_max_mps2.is_some() && given.acceleration_sd_mps2.is_some() {
        let what = "`acceleration_sd_mps2` is given as well; keep one of the two";
        return refuse(
            "a_max_mps2",
            what,
            "Singer's a_max_mps2, p_max and p_0 stand for acceleration_sd_mps2",
        );
    }
    for (key, value) in [("p_max", given.p_max), ("p_0", given.p_0)] {
        if value.is_some() && given.a_max_mps2.is_none() {
            return refuse(key, "it means nothing without `a_max_mps2`", "give a_max_mps2, or leave it out");
        }
    }
    Ok(())
}

fn start(config: &TrackConfig, effective: &mut Effective) -> StartSpec {
    let settled = config.start.settle(effective);
    let position = effective.settle_given(&["start", "position_m"], &config.start.position_m);
    let sd = effective.settle_given(&["start", "position_sd_m"], &config.start.position_sd_m);
    StartSpec {
        speed_sd_mps: settled.speed_sd_mps,
        acceleration_sd_mps2: settled.acceleration_sd_mps2,
        turn_rate_sd_rad_s: settled.turn_rate_sd_rad_s,
        size_sd_m: settled.size_sd_m,
        position: position.zip(sd).map(|(list, sd)| {
            let mut place = [0.0; 3];
            place.iter_mut().zip(list).for_each(|(to, from)| *to = from);
            (place, sd)
        }),
    }
}

fn life(config: &TrackConfig, effective: &mut Effective) -> LifeSpec {
    let settled = config.life.settle(effective);
    LifeSpec {
        max_gap: Span::from_secs(settled.max_gap_s),
        restart_after: 3,
        restart_after_gated: effective
            .settle_given(&["track", "restart_after_gated"], &config.life.restart_after_gated),
        estimate: match settled.estimate {
            Estimate::Mean => Point::Mean,
            Estimate::MaxWeight => Point::MaxWeight,
            Estimate::RobustMean => Point::RobustMean,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use zerre::catalog::{FILTERS, MOTIONS};
    use zerre::kernels::{Simd, Threads};
    use zerre::track::Engine;

    /// Modes choose a filter that has them, and are refused by others.
    #[test]
    fn modes_are_never_ignored() {
        let read = |text: &str| {
            let config = TrackConfig::from_source(&Source::new("f.toml", text.to_owned())).unwrap();
            let filter = filter(&config, &mut Effective::default()).unwrap().name;
            let checked = check_modes(&config, &filter, &Effective::default());
            checked.map(|()| filter).map_err(|error| error.to_string())
        };
        assert_eq!(read("[motion.modes]\nstay_s = 5").unwrap(), "imm-ekf");
        assert_eq!(read("filter = \"imm-ukf\"\n[motion.modes]\nstay_s = 5").unwrap(), "imm-ukf");
        assert_eq!(read("").unwrap(), "particle");
        let refused = read("filter = \"ekf\"\n[motion.modes]\nstay_s = 5").unwrap_err();
        assert!(refused.contains("motion.modes.stay_s: the filter `ekf` has no modes"), "{refused}");
        assert!(refused.contains("imm-ekf") && refused.contains("rb-mmpf"), "{refused}");
    }

    /// Each setting is of some filter, and told to be its own; the others refuse it.
    #[test]
    fn settings_of_filters_are_never_ignored() {
        let values = [
            ("particles", "50"),
            ("resampling", "\"residual\""),
            ("resample_when", "\"always\""),
            ("threshold", "0.3"),
            ("roughening", "0.1"),
            ("normals", "\"f32\""),
            ("generator", "\"fast\""),
        ];
        for name in FILTERS.iter().map(|entry| entry.name) {
            let settled = |more: &str| {
                let source = Source::new("f.toml", format!("[filter]\nname = {name:?}\n{more}"));
                let config = TrackConfig::from_source(&source).unwrap();
                let mut effective = Effective::new(Some(source));
                filter(&config, &mut effective).map(|spec| (spec, effective))
            };
            let (default, _) = settled("").unwrap();
            for (key, value) in values {
                match settled(&format!("{key} = {value}\n")) {
                    Ok((spec, effective)) => {
                        assert!(FilterConfig::used_by(name).contains(&key), "{name} {key}");
                        assert!(spec != default, "{name} does not use {key}");
                        assert!(effective.to_string().contains(&format!("filter.{key} = ")));
                    }
                    Err(refused) => {
                        let said = refused.to_string();
                        assert!(!FilterConfig::used_by(name).contains(&key), "{said}");
                        assert!(said.contains("f.toml:3:1") && said.contains("it is of "), "{said}");
                    }
                }
            }
        }
    }

    /// Each parameter that a motion is said to use changes its specification or is needed by it.
    #[test]
    fn every_motion_is_built_from_the_parameters_it_is_said_to_use() {
        for model in MOTIONS.iter().map(|entry| entry.name).filter(|name| !name.contains("growth")) {
            let used = MotionConfig::used_by(model);
            assert!(!used.is_empty(), "{model}");
            let set = |keys: &[&str]| -> Result<MotionSpec, String> {
                let lines: String = keys.iter().map(|key| format!("{key} = 0.5\n")).collect();
                let text = format!("[motion]\nmodel = {model:?}\n{lines}");
                let config = TrackConfig::from_source(&Source::new("f.toml", text)).unwrap();
                motion(&config, &mut Effective::default()).map_err(|error| error.to_string())
            };
            // Singer's acceleration is given in one of two ways.
            let direct: Vec<&str> =
                used.iter().copied().filter(|key| !["a_max_mps2", "p_max", "p_0"].contains(key)).collect();
            let whole = set(&direct).unwrap();
            let spec = TrackerSpec { motion: whole.clone(), ..TrackerSpec::new("ukf", model) };
            let engine = Engine { simd: Simd::best(), threads: Threads::new(1).unwrap() };
            assert!(spec.build(engine).is_ok(), "{model}: {whole:?}");
            for left_out in &direct {
                let rest: Vec<&str> = direct.iter().copied().filter(|key| key != left_out).collect();
                assert_ne!(set(&rest), Ok(whole.clone()), "{model} does not use {left_out}");
            }
        }
    }
}
