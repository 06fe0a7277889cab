//! Writes `report.html` and `plan.svg` of a synthetic run into the folder given as the first argument: three
//! targets, a radar whose range noise is told too small, and a camera that fits.

use std::f64::consts::TAU;
use zerre_lab::consistency::{SensorInnovations, WhitenedComponent, assess};
use zerre_lab::report::{
    Counts, InnovationRow, RejectedRow, Rejection, RunReport, Score, SensorReport, StateInfo, TrackSeries,
    TruthSeries, plan_svg, render,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder =
        std::path::PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "target/report_demo".into()));
    let many = std::env::args().nth(2).map_or(Ok(3), |n| n.parse::<usize>())?;
    std::fs::create_dir_all(&folder)?;
    let report = run(many, 300)?;
    std::fs::write(folder.join("report.html"), render(&report))?;
    std::fs::write(folder.join("plan.svg"), plan_svg(&report))?;
    Ok(())
}

/// A sum of twelve uniforms less six: normal enough for a picture.
fn normal(state: &mut u64) -> f64 {
    (0..12).fold(-6.0, |sum, _| {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        sum + (*state >> 11) as f64 / (1_u64 << 53) as f64
    })
}

fn run(targets: usize, steps: usize) -> Result<RunReport, zerre_lab::Error> {
    let mut noise = 7;
    let tracks: Vec<TrackSeries> = (0..targets).map(|k| track(k, steps, &mut noise)).collect();
    let names = [("radar", vec!["range", "bearing"], 3.0), ("camera", vec!["bearing"], 1.0)];
    let mut sensors = Vec::new();
    for (index, (name, components, _)) in names.iter().enumerate() {
        let rows = |t: &TrackSeries| -> Vec<InnovationRow> {
            t.innovations.iter().filter(|row| row.sensor == index).cloned().collect()
        };
        let component = |c: usize| WhitenedComponent {
            name: components[c].into(),
            series: tracks.iter().map(|t| rows(t).iter().map(|row| row.whitened[c]).collect()).collect(),
        };
        let innovations = SensorInnovations {
            sensor: (*name).into(),
            dimension: components.len(),
            nis: tracks.iter().flat_map(|t| rows(t).into_iter().map(|row| row.nis)).collect(),
            components: (0..components.len()).map(component).collect(),
            noise_share: Some(0.8),
            ..SensorInnovations::default()
        };
        sensors.push(SensorReport {
            name: (*name).into(),
            components: components.iter().map(|c| (*c).into()).collect(),
            position: Some([[1500.0, -1800.0], [4000.0, 5000.0]][index]),
            used: innovations.nis.len() as u64,
            gated: 12,
            assessment: Some(assess(&innovations)?),
        });
    }
    Ok(RunReport {
        labels: Vec::new(),
        scenes: Vec::new(),
        against_truth: None,
        title: "Three targets in a harbour".into(),
        command: "zerre track harbour.csv --truth harbour-truth.csv --seed 7".into(),
        input: "harbour.csv".into(),
        filter: "bootstrap particle filter, 2 000 particles, systematic resampling at ESS < N/2".into(),
        motion: "nearly constant velocity, 0.5 m²/s³".into(),
        seed: 7,
        start: Some("2024-05-01T12:00:00Z".into()),
        plan_note: Some("x points east and y north of 54.32° N, 10.15° E.".into()),
        tracks,
        sensors,
        counts: Counts {
            read: 918,
            used: 900,
            missing: 9,
            left_out: Vec::new(),
            out_of_order: 0,
            rejected: vec![Rejection {
                reason: "not a number".into(),
                count: 9,
                examples: vec![RejectedRow { line: 1043, column: "range_m".into(), value: "<n/a>".into() }],
            }],
        },
        scores: vec![
            Score { name: "GOSPA (p = 2, c = 200 m)".into(), value: 61.2, unit: "m".into() },
            Score { name: "RMSE".into(), value: 43.7, unit: "m".into() },
            Score { name: "inside 95 %".into(), value: 0.943, unit: String::new() },
        ],
        config_text:
            "[filter]\nkind = \"particle\"\nparticles = 2000\n\n[motion]\nkind = \"constant-velocity\"\n"
                .into(),
        digest: "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08".into(),
    })
}

fn track(k: usize, steps: usize, noise: &mut u64) -> TrackSeries {
    let ids = ["Astrid", "<b>MV \"Boreas\"</b> & tow", "265547250"];
    let mut series = TrackSeries {
        id: ids.get(k).map_or_else(|| format!("target {k}"), |id| (*id).into()),
        states: [("x", "m"), ("y", "m"), ("vx", "m/s"), ("vy", "m/s")]
            .map(|(name, unit)| StateInfo { name: name.into(), unit: unit.into() })
            .to_vec(),
        particles: Some(2000),
        updates: steps as u64 - 3,
        missed: 3,
        outcomes: if k == 1 { vec![("all weights zero, restarted".into(), 1)] } else { Vec::new() },
        ..Default::default()
    };
    let mut truth = TruthSeries { states: vec![Vec::new(); 4], ..Default::default() };
    let (phase, radius) = (TAU * k as f64 / 3.0, 4000.0 + 300.0 * (k as f64));
    let mut evidence = 0.0;
    let mut lag = [0.0; 2];
    for i in 0..steps {
        let (time, turn) = (1.714_564_8e9 + i as f64, phase + i as f64 / steps as f64 * 2.6);
        let rate = 2.6 / steps as f64;
        let x = [radius * turn.cos(), 0.75 * radius * (1.4 * turn).sin()];
        let v = [-radius * rate * turn.sin(), 0.75 * radius * 1.4 * rate * (1.4 * turn).cos()];
        let sd = 45.0 + 400.0 * (-(i as f64) / 6.0).exp();
        lag = lag.map(|l: f64| 0.9 * l + 0.43 * 0.5 * sd * normal(noise));
        let mean = [x[0] + lag[0], x[1] + lag[1], v[0] + 2.0 * normal(noise), v[1] + 2.0 * normal(noise)];
        series.times_s.push(time);
        series.mean.push(mean.to_vec());
        series.sd.push(vec![sd, sd * 0.6, 4.0, 3.0]);
        series.position.push([mean[0], mean[1]]);
        series.position_cov.push([sd * sd, 0.35 * sd * sd, 0.36 * sd * sd]);
        series.ess.push(Some(1100.0 + 700.0 * (i as f64 / 9.0).sin() + 60.0 * normal(noise)));
        evidence -= 11.0 + normal(noise);
        series.log_evidence.push(evidence);
        series.plots.push([x[0] + 110.0 * normal(noise), x[1] + 110.0 * normal(noise)]);
        let sensor = usize::from(i % 3 == 0);
        let whitened =
            if sensor == 0 { vec![1.7 * normal(noise), normal(noise)] } else { vec![normal(noise)] };
        let nis = whitened.iter().map(|w| w * w).sum();
        series.innovations.push(InnovationRow { time_s: time, sensor, nis, whitened });
        truth.times_s.push(time);
        truth.position.push(x);
        for (column, value) in truth.states.iter_mut().zip([x[0], x[1], v[0], v[1]]) {
            column.push(value);
        }
    }
    series.truth = Some(truth);
    series
}
