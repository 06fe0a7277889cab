//! What the paper may mean by its model: what data are drawn from, and what filters are told.

use super::settings::{READINGS, TINY};
use crate::study::world::{Problem, upf_growth};
use zerre::Result;
use zerre::model::{measurement, motion};

/// Noise of the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Noise {
    /// Gamma(3, 2) with 2 a rate: mean 3/2, variance 3/4.
    Rate,
    /// Gamma(3, 2) with 2 a scale: mean 6, variance 12.
    Scale,
    /// Normal of variance 1.
    Unit,
    /// Normal of the variance Q of the table.
    Q,
}

/// Variance of the measurement's noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variance {
    /// That of the table.
    Q,
    /// 1.
    One,
    /// That written beside the model.
    Tiny,
}

/// One way to read the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    /// Its letter.
    pub name: &'static str,
    /// Noises that data are drawn with.
    pub drawn: (Noise, Variance),
    /// Noises that filters reckon with.
    pub told: (Noise, Variance),
}

/// Growth as the paper has it.
pub type Growth = Problem<motion::UpfGrowth, measurement::UpfGrowth, 1>;

impl Reading {
    /// The place of a reading in [`READINGS`].
    pub fn place(name: &str) -> Option<usize> {
        READINGS.iter().position(|reading| reading.name == name)
    }

    /// What data are drawn from, and what filters are told, at the variance `q` of the table.
    ///
    /// # Errors
    /// None for a positive `q`.
    pub fn problems(&self, q: f64, steps: usize) -> Result<[Growth; 2]> {
        let problem = |(noise, variance): (Noise, Variance)| {
            let motion = match noise {
                Noise::Rate => motion::UpfGrowth::new(3.0, 2.0)?,
                Noise::Scale => motion::UpfGrowth::new(3.0, 0.5)?,
                Noise::Unit => motion::UpfGrowth::normal(1.0)?,
                Noise::Q => motion::UpfGrowth::normal(q)?,
            };
            let variance = match variance {
                Variance::Q => q,
                Variance::One => 1.0,
                Variance::Tiny => TINY,
            };
            upf_growth(motion, measurement::UpfGrowth::new(variance)?, steps)
        };
        Ok([problem(self.drawn)?, problem(self.told)?])
    }

    /// What filters are told, in words, against what is so.
    pub fn about(&self) -> String {
        let noise = |noise: Noise| match noise {
            Noise::Rate => "gamma noise of shape 3 and rate 2",
            Noise::Scale => "gamma noise of shape 3 and scale 2",
            Noise::Unit => "normal noise of variance 1",
            Noise::Q => "normal noise of variance Q",
        };
        let variance = |variance: Variance| match variance {
            Variance::Q => "variance Q".to_owned(),
            Variance::One => "variance 1".to_owned(),
            Variance::Tiny => format!("variance {TINY:e}"),
        };
        let told = |(a, b): (Noise, Variance)| format!("{} and measurements of {}", noise(a), variance(b));
        if self.drawn == self.told {
            format!("{}, as filters are told", told(self.drawn))
        } else {
            format!("{}; filters are told {}", told(self.drawn), told(self.told))
        }
    }
}
