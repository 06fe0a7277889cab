//! What the name of a filter says.

use crate::catalog::FILTERS;
use crate::error::{Error, Result};
use crate::filter::SigmaPoints;

/// A filter by name, taken apart.
#[derive(Clone, Copy)]
pub(super) struct Kind {
    /// How Gaussians are updated: those of the filter, or those that stand for its particles until they are
    /// drawn.
    pub(super) family: Family,
    /// What it keeps.
    pub(super) form: Form,
    /// Whether it takes several modes of the motion into account.
    pub(super) modes: bool,
}

/// How a Gaussian belief is updated.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Family {
    Kalman,
    Extended,
    Unscented(SigmaPoints),
}

/// What a filter keeps of a target.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Form {
    /// A Gaussian, or one for each mode.
    Gaussian,
    /// A Gaussian for each of many histories of modes.
    Hypotheses,
    /// Particles.
    Cloud,
    /// Particles that each go on under every mode.
    EveryMode,
    /// As many particles in each mode.
    Interacting,
}

impl Kind {
    /// # Errors
    /// A name that is none of [`FILTERS`].
    pub(super) fn named(name: &str) -> Result<Kind> {
        use Family::{Extended, Kalman};
        let unscented = Family::Unscented(SigmaPoints::default());
        let (family, form, modes) = match name {
            "kalman" => (Kalman, Form::Gaussian, false),
            "ekf" => (Extended, Form::Gaussian, false),
            "ukf" => (unscented, Form::Gaussian, false),
            "cubature" => (Family::Unscented(SigmaPoints::cubature()), Form::Gaussian, false),
            "imm-kalman" => (Kalman, Form::Gaussian, true),
            "imm-ekf" => (Extended, Form::Gaussian, true),
            "imm-ukf" => (unscented, Form::Gaussian, true),
            "rb-mmpf" => (unscented, Form::Hypotheses, true),
            "particle" | "sir" | "sis" => (unscented, Form::Cloud, false),
            "mmpf" => (unscented, Form::EveryMode, true),
            "imm-pf" => (unscented, Form::Interacting, true),
            _ => {
                let known: Vec<_> = FILTERS.iter().map(|entry| entry.name).collect();
                let text = format!("there is no filter `{name}`; known: {}", known.join(", "));
                return Err(Error::Unsupported(text));
            }
        };
        Ok(Kind { family, form, modes })
    }

    /// Whether it keeps particles, which have to be drawn.
    pub(super) fn has_particles(self) -> bool {
        !matches!(self.form, Form::Gaussian | Form::Hypotheses)
    }

    /// The filter of the Kalman family that learning takes in its place.
    pub(super) fn stand_in(self) -> &'static str {
        if self.modes { "imm-ekf" } else { "ekf" }
    }
}

/// Whether the filter of this name takes several modes of a motion into account.
pub fn has_modes(filter: &str) -> bool {
    Kind::named(filter).is_ok_and(|kind| kind.modes)
}

/// Whether the filter of this name keeps particles.
pub fn has_particles(filter: &str) -> bool {
    Kind::named(filter).is_ok_and(Kind::has_particles)
}
