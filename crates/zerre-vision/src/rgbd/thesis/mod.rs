//! The filter of the thesis as it stands: three places, each a normal likelihood of one width, multiplied; the mean of the
//! best tenth; residual resampling (its table 4.1 and appendix 4). What is unsound in it is left so: it is what
//! [`fusion`](super::fusion) is measured against.

mod pipeline;

pub use pipeline::{Difference, Logic, Picture, Show};

use super::{Depth, Reading, RgbdFrame};
use crate::{Error, Frame, Result};
use pipeline::{Before, Window};
use serde::{Deserialize, Serialize};
use zerre::math::Real;
use zerre::resample::{Resampler, Resampling};
use zerre::rng::{Purpose, Stream};

/// When particles are resampled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Resamples {
    /// In every step, as the program in the appendix does.
    #[default]
    Always,
    /// Where the estimate is not adequate and the effective number below two thirds, as table 4.1 says.
    WhenNeeded,
}

/// How the thesis's filter is set. Numbers that its text has lost were chosen on drawn calibration clips
/// ([`SceneSettings::calibration`](super::scene::SceneSettings)), and are marked so.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ThesisSettings {
    /// Number of particles.
    pub particles: usize,
    /// Side of the active window about the device's joint, pixels.
    pub window: usize,
    /// Lower and upper threshold of the colours' difference, levels (lost).
    pub colour_thresholds: [u8; 2],
    /// Regions of fewer pixels are dropped (lost).
    pub colour_area: usize,
    /// Diameter of the disc that joins regions, pixels (lost).
    pub colour_grow: usize,
    /// Lower and upper threshold of the depths' difference, levels of 16 mm (lost).
    pub depth_thresholds: [u8; 2],
    /// Diameter of the disc that joins regions, pixels (lost).
    pub depth_grow: usize,
    /// How the difference of colours is taken.
    pub difference: Difference,
    /// How the masks of the two thresholds become one (lost).
    pub thresholds_by: Logic,
    /// How step I10 of depth gets the holes (lost).
    pub holes_by: Logic,
    /// Process noise of place and velocity, pixels (lost).
    pub process_noise: [f64; 2],
    /// Standard deviation of all three likelihoods, pixels (lost).
    pub sensor_sd: f64,
    /// Noise that is added to the places of colour and depth, pixels (lost).
    pub added_noise: [f64; 2],
    /// Share of the particles whose mean is the estimate.
    pub best: f64,
    /// When particles are resampled.
    pub resamples: Resamples,
    /// An estimate that is as near to the mean of the places is adequate, pixels (lost).
    pub adequate: f64,
}

impl Default for ThesisSettings {
    fn default() -> ThesisSettings {
        ThesisSettings {
            particles: 150,
            window: 141,
            colour_thresholds: [45, 110],
            colour_area: 60,
            colour_grow: 3,
            depth_thresholds: [40, 120],
            depth_grow: 3,
            difference: Difference::Saturating,
            thresholds_by: Logic::Xor,
            holes_by: Logic::And,
            process_noise: [5.0, 2.0],
            sensor_sd: 15.0,
            added_noise: [3.0, 3.0],
            best: 0.1,
            resamples: Resamples::Always,
            adequate: 5.0,
        }
    }
}

impl ThesisSettings {
    /// # Errors
    /// A number out of its range.
    pub fn checked(&self) -> Result<()> {
        let refuse = |what, value: f64, needs| Err(Error::OutOfRange { what, value, needs });
        if self.particles == 0 {
            return refuse("particles", 0.0, "it must be 1 or more");
        }
        if !(9..=2001).contains(&self.window) {
            return refuse("window", self.window as f64, "it must be from 9 to 2001 pixels");
        }
        for (what, value) in [("colour_grow", self.colour_grow), ("depth_grow", self.depth_grow)] {
            if !(1..=self.window).contains(&value) {
                return refuse(what, value as f64, "it must be from 1 pixel to the window's side");
            }
        }
        for (what, value) in [("sensor_sd", self.sensor_sd), ("best", self.best), ("adequate", self.adequate)]
        {
            if !(value > 0.0 && value.is_finite()) {
                return refuse(what, value, "it must be positive");
            }
        }
        if self.best > 1.0 {
            return refuse("best", self.best, "it must be at most 1");
        }
        for value in self.process_noise.into_iter().chain(self.added_noise) {
            if !(value >= 0.0 && value.is_finite()) {
                return refuse("noise", value, "it must be 0 or more");
            }
        }
        Ok(())
    }
}

/// What a step gave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThesisStep {
    /// Mean of the best particles.
    pub estimate: [f64; 2],
    /// Covariance of all of them.
    pub covariance: [[f64; 2]; 2],
    /// The places of device, colour and depth, before noise is added.
    pub places: [Option<[f64; 2]>; 3],
    /// Effective number of particles.
    pub ess: f64,
    /// Whether the estimate was adequate.
    pub adequate: bool,
    /// Whether particles were resampled.
    pub resampled: bool,
}

/// The filter.
#[derive(Clone, Debug)]
pub struct Thesis {
    settings: ThesisSettings,
    room: (Frame, Depth),
    stream: Stream,
    step: u64,
    /// Place and velocity.
    particles: Vec<[f64; 4]>,
    weights: Vec<f64>,
    resampler: Resampler,
    ancestors: Vec<u32>,
    before: Option<Before>,
    device: [f64; 2],
}

impl Thesis {
    /// A filter with its particles about a first place, and the empty room.
    ///
    /// # Errors
    /// Settings out of range, pictures of the room of different sizes.
    pub fn start(
        settings: ThesisSettings,
        room: (Frame, Depth),
        first: [f64; 2],
        stream: Stream,
    ) -> Result<Thesis> {
        settings.checked()?;
        room.0.expect_size(&room.1)?;
        let n = settings.particles;
        let particles = (0..n).map(|i| {
            let mut draws = stream.draws(Purpose::Prior, 0, i as u32);
            let mut about = |v: f64| v + settings.sensor_sd * draws.normal();
            [about(first[0]), about(first[1]), 0.0, 0.0]
        });
        Ok(Thesis {
            room,
            stream,
            step: 0,
            particles: particles.collect(),
            weights: vec![1.0 / n as f64; n],
            resampler: Resampler::new(Resampling::Residual),
            ancestors: vec![0; n],
            before: None,
            device: first,
            settings,
        })
    }

    /// The particles' places and weights: those of before resampling would be gone, so they are equal after it.
    pub fn particles(&self) -> impl Iterator<Item = ([f64; 2], f64)> {
        self.particles.iter().map(|p| [p[0], p[1]]).zip(self.weights.iter().copied())
    }

    /// A frame, with the device's joint where there is one; the window stays where it was without it. `show` gets the
    /// pictures of the steps, those of colour in its first and those of depth in its second half.
    ///
    /// # Errors
    /// A frame of another size than the room's.
    pub fn step(
        &mut self,
        frame: &RgbdFrame,
        device: Option<&Reading>,
        [show_colour, show_depth]: [Option<Show<'_>>; 2],
    ) -> Result<ThesisStep> {
        self.room.0.expect_size(&frame.colour)?;
        self.room.1.expect_size(&frame.depth)?;
        if let Some(reading) = device {
            reading.checked()?;
            self.device = reading.at;
        }
        let window = Window::about(self.device, self.settings.window);
        let colour = pipeline::colour(&self.settings, (frame, &self.room.0), window, show_colour)?;
        let depth =
            pipeline::depth(&self.settings, (frame, &self.room.1), window, &mut self.before, show_depth)?;
        self.fuse([device.map(|reading| reading.at), colour, depth])
    }

    /// The filter alone, on places of device, colour and depth.
    ///
    /// # Errors
    /// None where the places are finite.
    pub fn fuse(&mut self, places: [Option<[f64; 2]>; 3]) -> Result<ThesisStep> {
        self.step += 1;
        let mut noise = self.stream.draws(Purpose::Measurement, self.step, 0);
        let mut heard = places;
        for (place, sd) in heard[1..].iter_mut().zip(self.settings.added_noise) {
            // Drawn for missing places too, so that one that is missing does not change the others.
            let off = [sd * noise.normal(), sd * noise.normal()];
            if let Some(place) = place {
                *place = [place[0] + off[0], place[1] + off[1]];
            }
        }
        let [place_sd, speed_sd] = self.settings.process_noise;
        for (i, [x, y, u, v]) in self.particles.iter_mut().enumerate() {
            let mut draws = self.stream.draws(Purpose::Motion, self.step, i as u32);
            *x += *u + place_sd * draws.normal();
            *y += *v + place_sd * draws.normal();
            *u += speed_sd * draws.normal();
            *v += speed_sd * draws.normal();
        }
        // Each likelihood is divided by its sum over the particles, which the last division undoes: logarithms keep what
        // is far from everything.
        let scale = 0.5 / self.settings.sensor_sd.square();
        let log: Vec<f64> = (self.particles.iter().zip(&self.weights))
            .map(|([x, y, ..], weight)| {
                let squares = heard.iter().flatten().map(|z| (z[0] - x).square() + (z[1] - y).square());
                Real::ln(*weight) - scale * squares.sum::<f64>()
            })
            .collect();
        let top = log.iter().copied().fold(f64::MIN, f64::max);
        self.weights.iter_mut().zip(&log).for_each(|(w, l)| *w = Real::exp(l - top));
        let sum: f64 = self.weights.iter().sum();
        self.weights.iter_mut().for_each(|w| *w /= sum);

        let estimate = self.best();
        let covariance = self.covariance(estimate);
        let ess = 1.0 / self.weights.iter().map(|w| w * w).sum::<f64>();
        let known: Vec<[f64; 2]> = heard.iter().flatten().copied().collect();
        let count = known.len() as f64;
        let middle = [0, 1].map(|k| known.iter().map(|z| z[k]).sum::<f64>() / count);
        let off = (estimate[0] - middle[0]).hypot(estimate[1] - middle[1]);
        let adequate = !known.is_empty() && off <= self.settings.adequate;
        let n = self.particles.len();
        let resampled = match self.settings.resamples {
            Resamples::Always => true,
            Resamples::WhenNeeded => !adequate && ess < 2.0 * n as f64 / 3.0,
        };
        if resampled {
            self.resampler.ancestors(&self.weights, self.stream, self.step, &mut self.ancestors)?;
            self.particles = self.ancestors.iter().map(|&a| self.particles[a as usize]).collect();
            self.weights.fill(1.0 / n as f64);
        }
        Ok(ThesisStep { estimate, covariance, places, ess, adequate, resampled })
    }

    /// Plain mean of the particles of largest weight.
    fn best(&self) -> [f64; 2] {
        let mut order: Vec<usize> = (0..self.weights.len()).collect();
        order.sort_by(|&a, &b| self.weights[b].total_cmp(&self.weights[a]));
        let count = ((self.settings.best * order.len() as f64).ceil() as usize).clamp(1, order.len());
        [0, 1].map(|k| order[..count].iter().map(|&i| self.particles[i][k]).sum::<f64>() / count as f64)
    }

    fn covariance(&self, about: [f64; 2]) -> [[f64; 2]; 2] {
        let mut sum = [[0.0; 2]; 2];
        for (particle, w) in self.particles.iter().zip(&self.weights) {
            let off = [particle[0] - about[0], particle[1] - about[1]];
            for i in 0..2 {
                for j in 0..2 {
                    sum[i][j] += w * off[i] * off[j];
                }
            }
        }
        sum
    }
}
