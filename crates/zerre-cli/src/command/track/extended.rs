//! Extended targets: from `[extended]` and the points of a recording to the rows of their tracks.

use super::input::Input;
use super::settings::{AUTO, counted};
use super::work::{Run, Workers, in_parallel, targets};
use crate::config::{
    Count, Effective, ExtendedConfig, FilterConfig, Reason, SensorConfig, StartConfig, TrackConfig, Turning,
};
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use std::collections::BTreeMap;
use std::sync::Arc;
use zerre::Span;
use zerre::track::{
    ClutterSpec, DEFAULT_SENSOR, ExtendedFilter, ExtendedSpec, Plot, Reading, Rotation, Scan,
};

/// What `[extended]` and the sections that count with it say.
#[derive(Clone)]
pub(super) struct Extended {
    pub spec: ExtendedSpec,
    turning: Turning,
    /// Whether somebody told the acceleration.
    told: bool,
}

impl Extended {
    /// Settles the section; `None` without it.
    pub fn settle(config: &TrackConfig, effective: &mut Effective) -> Result<Option<Extended>, Diagnostic> {
        let Some(section) = &config.extended else { return Ok(None) };
        refuse_the_rest(config, effective)?;
        let settled = section.settle(effective);
        let path = ["extended", "filter"];
        let catalog = crate::catalog::all();
        effective.check_name(&path, "extended filter", &settled.filter, &catalog, "extended-filters")?;
        let used = ExtendedConfig::used_by(&settled.filter);
        if let Some(key) = section.given().into_iter().find(|key| !used.contains(key)) {
            let text = format!("extended.{key}: the filter `{}` has no such setting", settled.filter);
            let help = format!("it is of {}; leave it out, or choose that filter", ExtendedConfig::FILTER);
            return Err(effective.at_key(&["extended", key], Diagnostic::new(text).help(help)));
        }
        let filter = ExtendedFilter::named(&settled.filter).map_err(|e| Diagnostic::new(e.to_string()))?;
        let path = ["sensor", DEFAULT_SENSOR, "position_sd_m"];
        let noise = config.sensor.get(DEFAULT_SENSOR).and_then(|sensor| sensor.position_sd_m);
        if noise.is_some() && filter == ExtendedFilter::RandomMatrixKoch {
            let text =
                format!("sensor.default.position_sd_m: the filter `{}` has no such noise", filter.name());
            let help = "leave it out: the noise is a part of the extent; or take random-matrix-feldmann";
            return Err(effective.at_key(&path, Diagnostic::new(text).help(help)));
        }
        let noise = match filter {
            ExtendedFilter::RandomMatrixKoch => 0.0,
            _ => effective.settle(&path, &noise, 0.0, "what the sensor errs by is a part of the shape"),
        };
        let told =
            effective.settle_given(&["motion", "acceleration_sd_mps2"], &config.motion.acceleration_sd_mps2);
        let why = "road traffic, ships and drones";
        let speed_sd_mps =
            effective.settle(&["start", "speed_sd_mps"], &config.start.speed_sd_mps, 30.0, why);
        let why = "after five minutes a prediction says nothing";
        let max_gap_s = effective.settle(&["track", "max_gap_s"], &config.life.max_gap_s, 300.0, why);
        let spec = ExtendedSpec {
            rotation: match settled.rotation {
                Turning::Velocity if filter == ExtendedFilter::WindowVb => Rotation::Velocity,
                _ => Rotation::None,
            },
            ellipses: match settled.ellipses {
                Count::Fixed(count) => Some(count as usize),
                Count::Auto => None,
            },
            first_scans: settled.first_scans as usize,
            window: settled.window as usize,
            sweeps: settled.sweeps as usize,
            keep: settled.keep,
            least_sd_m: settled.least_sd_m,
            position_sd_m: noise,
            clutter: settled.clutter.map(|(area_m2, rate)| ClutterSpec { area_m2, rate }),
            speed_sd_mps,
            max_gap: Span::from_secs(max_gap_s),
            ..ExtendedSpec::new(filter, told.unwrap_or(1.0))
        };
        let turning = if filter == ExtendedFilter::WindowVb { settled.rotation } else { Turning::None };
        Ok(Some(Extended { spec, turning, told: told.is_some() }))
    }

    /// Settles what depends on the recording: how the body turns, and an acceleration that nobody told.
    pub fn learn(&mut self, input: &Input, effective: &mut Effective) -> Result<(), Diagnostic> {
        let scans: Vec<Vec<Scan>> = targets(input).iter().map(|indices| input.scans(indices)).collect();
        let all: Vec<&[Scan]> = scans.iter().map(Vec::as_slice).collect();
        let rotations: &[Rotation] = match self.turning {
            Turning::Auto => &[Rotation::None, Rotation::Velocity],
            Turning::None => &[Rotation::None],
            Turning::Velocity => &[Rotation::Velocity],
        };
        if self.told && rotations.len() == 1 {
            return Ok(());
        }
        let mut found: Vec<(ExtendedSpec, f64)> = Vec::new();
        let mut failure = None;
        for &rotation in rotations {
            let spec = ExtendedSpec { rotation, ..self.spec.clone() };
            let tried = if self.told {
                spec.log_evidence(&all).map(|evidence| evidence.map(|log| (spec.acceleration_sd_mps2, log)))
            } else {
                spec.learn_acceleration(&all)
            };
            match tried {
                Ok(Some((acceleration_sd_mps2, log))) => {
                    found.push((ExtendedSpec { acceleration_sd_mps2, ..spec }, log));
                }
                Ok(None) => {}
                // One of two may break: the other is taken.
                Err(error) => failure = Some(error),
            }
        }
        let acceleration = ["motion", "acceleration_sd_mps2"];
        let rotation = ["extended", "rotation"];
        /// Natural units of log-evidence by which a body that turns must win.
        const CLEARLY: f64 = 3.0;
        let better = |best: &(ExtendedSpec, f64), other: &(ExtendedSpec, f64)| other.1 > best.1 + CLEARLY;
        let mut each = found.into_iter();
        let Some(first) = each.next() else {
            if let Some(error) = failure {
                let help = "give acceleration_sd_mps2 under [motion]";
                return Err(Diagnostic::new(format!("{}: {error}", input.names())).help(help));
            }
            let why = "no target is seen twice: what it does between scans does not matter".to_owned();
            if !self.told {
                effective.put(&acceleration, self.spec.acceleration_sd_mps2, Reason::Chosen(why.clone()));
            }
            if self.turning == Turning::Auto {
                effective.put(&rotation, Rotation::None, Reason::Chosen(why));
            }
            return Ok(());
        };
        let second = each.next();
        if self.turning == Turning::Auto {
            let gain = second.as_ref().map_or(f64::NEG_INFINITY, |second| second.1 - first.1);
            let why = match &second {
                Some(other) if better(&first, other) => {
                    format!(
                        "the first scans are more likely by {gain:.0} of log-evidence than if it did not turn"
                    )
                }
                _ => "no clearly larger log-evidence of the first scans if it turned with its velocity"
                    .to_owned(),
            };
            let taken = second.clone().filter(|other| better(&first, other)).unwrap_or(first.clone());
            effective.put(&rotation, taken.0.rotation, Reason::Chosen(why));
        }
        self.spec = second.filter(|other| better(&first, other)).unwrap_or(first).0;
        if !self.told {
            let how = "under it the first scans, each foretold from those before, are most likely";
            effective.put(&acceleration, self.spec.acceleration_sd_mps2, Reason::Learnt(how.to_owned()));
        }
        Ok(())
    }

    /// Follows all targets.
    pub fn follow(
        &self,
        seed: u64,
        input: &Input,
        workers: &Workers,
        console: &Console,
    ) -> Result<Run, Diagnostic> {
        let spec = ExtendedSpec { seed, ..self.spec.clone() };
        let rows = in_parallel(input, workers, console, |indices, tell| {
            let first = indices.first().copied().unwrap_or_default();
            let id = input.plots[first].id.clone().unwrap_or_else(|| Arc::from("target"));
            let scans = input.scans(indices);
            let rows = spec.follow(&id, &scans).map_err(|error| (first, error))?;
            for (&index, row) in indices.iter().zip(rows) {
                if !tell(index, row.map_err(|error| (index, error))?) {
                    break;
                }
            }
            Ok(())
        })?;
        let (rows, bodies) = rows.into_iter().map(|row| row.map(|row| (row.row, row.body)).unzip()).unzip();
        let states = ExtendedSpec::states().to_vec();
        Ok(Run { states, modes: Vec::new(), rows, places: Vec::new(), bodies, reference: None })
    }

    /// The filter in a few words.
    pub fn filter_text(&self) -> String {
        let mut text = self.spec.filter.name().to_owned();
        if let Some(count) = self.spec.ellipses {
            text += &format!(", {}", counted(count, "ellipse"));
        }
        if self.spec.rotation == Rotation::Velocity {
            text += ", turning with the velocity";
        }
        text
    }
}

/// Refuses what is given in other sections and would have no effect.
fn refuse_the_rest(config: &TrackConfig, effective: &Effective) -> Result<(), Diagnostic> {
    let refuse = |path: &[&str], what: &str, help: &str| {
        let text = format!("{}: {what}", path.join("."));
        Err(effective.at_key(path, Diagnostic::new(text).help(help)))
    };
    let idle = "it has no effect on extended targets";
    let leave = "leave it out, or [extended]";
    let FilterConfig { name, .. } = &config.filter;
    if name.as_deref().is_some_and(|name| name != AUTO) {
        let what = "extended targets have filters of their own";
        // `filter = "..."` stands one level higher than its key.
        let text = format!("filter: {what}");
        let help = "name one of `zerre catalog extended-filters` under [extended]";
        return Err(effective.at_value(&["filter", "name"], Diagnostic::new(text).help(help)));
    }
    if let Some(key) = config.filter.given().first() {
        return refuse(&["filter", key], idle, leave);
    }
    let StartConfig {
        acceleration_sd_mps2, turn_rate_sd_rad_s, size_sd_m, position_m, position_sd_m, ..
    } = &config.start;
    let of_start = [
        ("acceleration_sd_mps2", acceleration_sd_mps2.is_some()),
        ("turn_rate_sd_rad_s", turn_rate_sd_rad_s.is_some()),
        ("size_sd_m", size_sd_m.is_some()),
        ("position_m", position_m.is_some()),
        ("position_sd_m", position_sd_m.is_some()),
    ];
    if let Some((key, _)) = of_start.iter().find(|(_, given)| *given) {
        return refuse(&["start", key], idle, "leave it out: the first scans tell where the target is");
    }
    let of_life = [
        ("restart_after_gated", config.life.restart_after_gated.is_some()),
        ("estimate", config.life.estimate.is_some()),
    ];
    if let Some((key, _)) = of_life.iter().find(|(_, given)| *given) {
        return refuse(&["track", key], idle, leave);
    }
    for (name, sensor) in &config.sensor {
        if name != DEFAULT_SENSOR {
            let what = "extended targets are seen by sensors that are all alike";
            return refuse(&["sensor", name], what, "give position_sd_m under [sensor.default]");
        }
        if let Some(key) = idle_keys(sensor).first() {
            let help = "of [sensor.default], position_sd_m alone counts for points";
            return refuse(&["sensor", name, key], idle, help);
        }
    }
    Ok(())
}

/// The settings of a sensor that its points do not have.
fn idle_keys(sensor: &SensorConfig) -> Vec<&'static str> {
    let all = [
        ("position_m", sensor.position_m.is_some()),
        ("position", sensor.position.is_some()),
        ("range_sd_m", sensor.range_sd_m.is_some()),
        ("bearing_sd_rad", sensor.bearing_sd_rad.is_some()),
        ("bearing_sd_deg", sensor.bearing_sd_deg.is_some()),
        ("elevation_sd_rad", sensor.elevation_sd_rad.is_some()),
        ("elevation_sd_deg", sensor.elevation_sd_deg.is_some()),
        ("range_rate_sd_mps", sensor.range_rate_sd_mps.is_some()),
        ("size_sd_m", sensor.size_sd_m.is_some()),
        ("orientation_sd_rad", sensor.orientation_sd_rad.is_some()),
        ("orientation_sd_deg", sensor.orientation_sd_deg.is_some()),
        ("gate", sensor.gate.is_some()),
        ("robust", sensor.robust.is_some()),
    ];
    all.into_iter().filter(|(_, given)| *given).map(|(key, _)| key).collect()
}

/// What makes points one scan: target, sensor, and the number of the scan or else the time.
type Key = (Option<Arc<str>>, Option<Arc<str>>, Result<u64, zerre::Time>);

impl Input {
    /// Makes one plot of each scan: where the middle of its points is, half-way between its first and last time, with
    /// the line of its first point.
    pub fn gather(&mut self) -> Result<(), Diagnostic> {
        let mut place: BTreeMap<Key, usize> = BTreeMap::new();
        let mut scans: Vec<(Plot, usize, Vec<[f64; 2]>, zerre::Time)> = Vec::new();
        for index in 0..self.plots.len() {
            let plot = &self.plots[index];
            let Reading::Position2(point) = plot.reading else {
                let text = format!(
                    "{}: an extended target is seen as points: x_m and y_m, or lat_deg and lon_deg",
                    self.place(index)
                );
                let help = "map other columns to \"ignore\" under [input.columns], or leave [extended] out";
                return Err(Diagnostic::new(text).help(help));
            };
            let key = (plot.id.clone(), plot.sensor.clone(), plot.scan.ok_or(plot.time));
            match place.get(&key).and_then(|&at| scans.get_mut(at)) {
                Some((_, _, points, last)) => {
                    points.push(point);
                    *last = plot.time;
                }
                None => {
                    place.insert(key, scans.len());
                    scans.push((plot.clone(), self.file_of[index], vec![point], plot.time));
                }
            }
        }
        for (plot, _, points, last) in &mut scans {
            plot.time = plot.time + Span::from_nanos((*last - plot.time).nanos() / 2);
            let n = points.len() as f64;
            let from = points[0];
            let sum = points.iter().fold([0.0; 2], |s, p| [s[0] + (p[0] - from[0]), s[1] + (p[1] - from[1])]);
            plot.reading = Reading::Position2([from[0] + sum[0] / n, from[1] + sum[1] / n]);
        }
        scans.sort_by_key(|(plot, ..)| plot.time);
        (self.plots, self.file_of, self.points) = (Vec::new(), Vec::new(), Vec::new());
        for (plot, file, points, _) in scans {
            self.plots.push(plot);
            self.file_of.push(file);
            self.points.push(points);
        }
        // Rows of one time are what a scan is.
        self.repeated = 0;
        Ok(())
    }

    /// The scans of these plots.
    fn scans(&self, indices: &[usize]) -> Vec<Scan> {
        indices.iter().map(|&index| (self.plots[index].time, self.points[index].clone())).collect()
    }
}
