//! The simulated device that reports a joint, and the simulated people who label it.

use super::{Scene, SceneTruth};
use crate::rgbd::Reading;
use std::f64::consts::TAU;
use zerre::Time;
use zerre::math::Real;
use zerre::rng::{Purpose, Stream};

/// The hand must be seen this much for people to label it.
const LABELLED: f64 = 0.3;

/// Readings in their order: when each was taken, none where it is missing.
pub(super) fn readings(scene: &Scene, truths: &[SceneTruth], stream: Stream) -> Vec<(Time, Option<Reading>)> {
    let (settings, rate) = (&scene.settings.device, scene.settings.rate_hz);
    let mut draws = stream.draws(Purpose::Truth, 0, 0);
    let pixel = scene.settings.size[0] as f64 / 640.0;
    let count = (truths.len() as f64 * settings.rate_hz / rate).ceil() as usize;
    let kept = Real::exp(Real::ln(settings.correlation) * 30.0 / settings.rate_hz);
    let kept = if settings.correlation > 0.0 { kept } else { 0.0 };
    let fresh = (1.0 - kept * kept).sqrt();
    // Stretches without readings: one in each of as many equal parts of the clip.
    let mut stretches = Vec::new();
    let part = truths.len() / settings.drop_outs.max(1);
    for k in 0..settings.drop_outs {
        let spare = part.saturating_sub(settings.drop_out_frames);
        let first = k * part + (draws.uniform() * spare as f64) as usize;
        stretches.push(first..first + settings.drop_out_frames);
    }
    let mut noise = [draws.normal(), draws.normal()];
    let mut burst: Option<(usize, [f64; 3])> = None;
    let mut out = Vec::with_capacity(count);
    let mut last_frame = None;
    for k in 0..count {
        let seconds = k as f64 / settings.rate_hz;
        let frame = ((seconds * rate + 1e-6) as usize).min(truths.len().saturating_sub(1));
        noise = noise.map(|v| kept * v + fresh * draws.normal());
        // Bursts begin and end with frames.
        if last_frame != Some(frame) {
            last_frame = Some(frame);
            if burst.is_some_and(|(end, _)| frame >= end) {
                burst = None;
            }
            let (chance, turn, far, long) =
                (draws.uniform(), draws.uniform(), draws.uniform(), draws.uniform());
            let away = 60.0 * draws.normal();
            if burst.is_none() && truths[frame].overlap && chance < settings.burst_probability {
                let [least, most] = settings.burst_frames;
                let long = least + (long * (most - least + 1) as f64) as usize;
                let far = settings.burst_px * (1.0 + 2.0 * far) / 3.0;
                let (s, c) = Real::sin_cos(TAU * turn);
                burst = Some((frame + long, [far * c, far * s, away]));
            }
        }
        let late = scene.person.pose(seconds - settings.lag_frames / rate).right.palm;
        let [u, v] = scene.camera.colour.project(late);
        let off = burst.map_or([0.0; 3], |(_, off)| off);
        let deep = late[2] + 15.0 * draws.normal() + off[2];
        let sure = match (burst.is_some(), truths[frame].overlap) {
            (true, _) => 0.5,
            (false, true) => 0.75,
            (false, false) => 0.9,
        };
        let reading = Reading {
            at: [
                u + pixel * (settings.noise_px * noise[0] + off[0]),
                v + pixel * (settings.noise_px * noise[1] + off[1]),
            ],
            depth_mm: Some(deep),
            confidence: (sure + 0.12 * draws.normal()).clamp(0.05, 1.0),
        };
        let lost =
            draws.uniform() < settings.loss || stretches.iter().any(|stretch| stretch.contains(&frame));
        out.push((Time::from_secs(seconds), (!lost).then_some(reading)));
    }
    out
}

/// What each person has clicked on in frame `k`: none where the hand can hardly be seen.
pub(super) fn labels(scene: &Scene, k: usize, truth: &SceneTruth, stream: Stream) -> Vec<Option<[f64; 2]>> {
    let settings = &scene.settings.operators;
    (0..settings.count)
        .map(|who| {
            let mut bias = stream.draws(Purpose::Prior, 1, who as u32);
            let mut noise = stream.draws(Purpose::Measurement, k as u64, 1000 + who as u32);
            let mut off = || settings.bias_px * bias.normal() + settings.noise_px * noise.normal();
            (truth.visible >= LABELLED).then(|| truth.hand.map(|place| place + off()))
        })
        .collect()
}
