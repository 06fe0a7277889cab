//! Modes of a motion: what filters for manoeuvring targets switch between.

use super::motion::MotionSpec;
use crate::error::{Error, Result};
use crate::model::motion::CoordinatedTurn;
use crate::model::{Chain, JumpMarkov};
use crate::time::Span;
use serde::{Deserialize, Serialize};

/// How a target manoeuvres, for the filters of which [`has_modes`](super::has_modes) holds; others ignore it.
///
/// The quiet mode is the motion itself. The manoeuvring mode is the same motion with more noise. With
/// `constant-velocity` in the plane there are two modes more: turns to the left and to the right at one rate, with the
/// noise of the quiet mode. Modes follow each other as a Markov chain in continuous time, so that irregular steps are
/// sound; each lasts as long on average, and each is as likely at the start.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ModeSpec {
    /// Mean time in a mode, seconds; `None` for [`ModeSpec::STAY_S`].
    pub stay_s: Option<f64>,
    /// Rate of the turning modes, rad/s; 0 for no such modes, `None` for [`ModeSpec::TURN_RATE_RAD_S`].
    pub turn_rate_rad_s: Option<f64>,
    /// Noise of the manoeuvring mode, in standard deviations of the quiet one; 1 for no such mode, `None` for
    /// [`ModeSpec::MANOEUVRE_FACTOR`].
    pub manoeuvre_factor: Option<f64>,
}

impl ModeSpec {
    /// Half a minute: between a turn of a car and one of an airliner.
    pub const STAY_S: f64 = 30.0;
    /// The standard turn of aviation, three degrees per second.
    pub const TURN_RATE_RAD_S: f64 = 0.05236;
    /// Ten times the noise: what a quiet motion all but excludes.
    pub const MANOEUVRE_FACTOR: f64 = 10.0;

    fn factor(&self) -> Result<f64> {
        let factor =
            Error::finite("manoeuvre_factor", self.manoeuvre_factor.unwrap_or(ModeSpec::MANOEUVRE_FACTOR))?;
        if factor >= 1.0 {
            return Ok(factor);
        }
        Err(Error::OutOfRange { what: "manoeuvre_factor", value: factor, needs: "it must be 1 or larger" })
    }

    fn chain(&self, modes: usize) -> Result<Chain> {
        let stay = Error::positive("stay_s", self.stay_s.unwrap_or(ModeSpec::STAY_S))?;
        Chain::sojourns(&vec![Span::from_secs(stay); modes])
    }
}

/// Whether a motion has turning modes.
pub fn has_turns(motion: &str, dimensions: usize) -> bool {
    motion == "constant-velocity" && dimensions == 2
}

/// A way to move, of those that a filter switches between.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Mode {
    /// The motion itself.
    Quiet,
    /// Straight on, where other modes turn.
    Straight,
    /// A turn to the left.
    Left,
    /// A turn to the right.
    Right,
    /// With much noise.
    Manoeuvre,
}

impl Mode {
    /// The word for tables: `quiet`, `left`.
    pub fn name(self) -> &'static str {
        match self {
            Mode::Quiet => "quiet",
            Mode::Straight => "straight",
            Mode::Left => "left",
            Mode::Right => "right",
            Mode::Manoeuvre => "manoeuvre",
        }
    }
}

/// The modes of a motion, and what they are.
pub(super) struct Modes<A> {
    pub(super) model: JumpMarkov<A>,
    /// Side by side with those of the model.
    pub(super) names: Vec<Mode>,
}

/// A motion, and its modes where a filter asks for them.
pub(super) struct Moves<A> {
    pub(super) quiet: A,
    pub(super) modes: Option<Modes<A>>,
}

impl<A: Clone> Moves<A> {
    /// What `make` makes of `spec`, with a quiet and a manoeuvring mode if `jumping`.
    pub(super) fn new(
        spec: &MotionSpec,
        jumping: bool,
        make: impl Fn(&MotionSpec) -> Result<A>,
    ) -> Result<Moves<A>> {
        let quiet = make(spec)?;
        let modes = if jumping { vec![(Mode::Quiet, quiet.clone())] } else { Vec::new() };
        Moves::with_manoeuvre(spec, quiet, modes, make)
    }

    /// Adds the manoeuvring mode to `modes`; none are wanted where that is empty.
    fn with_manoeuvre(
        spec: &MotionSpec,
        quiet: A,
        mut modes: Vec<(Mode, A)>,
        make: impl Fn(&MotionSpec) -> Result<A>,
    ) -> Result<Moves<A>> {
        if modes.is_empty() {
            return Ok(Moves { quiet, modes: None });
        }
        let factor = spec.modes.factor()?;
        if factor > 1.0
            && let (_, Some(wander)) = spec.wander()
        {
            let mut wild = spec.clone();
            wild.set_wander(wander * factor);
            modes.push((Mode::Manoeuvre, make(&wild)?));
        }
        let (names, motions): (Vec<_>, Vec<_>) = modes.into_iter().unzip();
        let model = JumpMarkov::new(motions, spec.modes.chain(names.len())?)?;
        Ok(Moves { quiet, modes: Some(Modes { model, names }) })
    }
}

impl Moves<CoordinatedTurn> {
    /// Straight on, to the left, to the right, and straight on with much noise.
    pub(super) fn turning(spec: &MotionSpec) -> Result<Moves<CoordinatedTurn>> {
        let turn = |spec: &MotionSpec, rate| CoordinatedTurn::new(rate, spec.density()?);
        let rate = spec.modes.turn_rate_rad_s.unwrap_or(ModeSpec::TURN_RATE_RAD_S);
        let rate = Error::not_negative("turn_rate_rad_s of the modes", rate)?;
        let quiet = turn(spec, 0.0)?;
        let mut modes = vec![(Mode::Straight, quiet)];
        if rate > 0.0 {
            modes.extend([(Mode::Left, turn(spec, rate)?), (Mode::Right, turn(spec, -rate)?)]);
        }
        Moves::with_manoeuvre(spec, quiet, modes, |spec| turn(spec, 0.0))
    }
}
