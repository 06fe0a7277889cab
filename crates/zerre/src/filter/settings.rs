//! Where a particle filter starts, and how it goes on.

use crate::belief::{Gaussian, checked_number};
use crate::error::{Error, Result};
use crate::filter::rejuvenation::Rejuvenation;
use crate::filter::size::{Size, never_resampled};
use crate::kernels::{self, BLOCK, NoiseBlock, NoiseKey, NoiseSource, Resolution, Simd, Threads};
use crate::math::Cholesky;
use crate::model::Noise;
use crate::resample::{Resampling, Trigger};
use crate::rng::{Purpose, Stream};

/// Where the first particles come from.
pub trait Prior<const N: usize>: Send + Sync {
    /// `n` independent states in columns.
    ///
    /// # Errors
    /// A law that cannot be drawn from.
    fn columns(&self, stream: Stream, n: usize) -> Result<[Vec<f64>; N]>;
}

impl<const N: usize> Prior<N> for Gaussian<N> {
    fn columns(&self, stream: Stream, n: usize) -> Result<[Vec<f64>; N]> {
        // Not triangular: a semidefinite factor takes its pivots in the order of their size.
        let factor = Cholesky::semidefinite("covariance of the prior", self.covariance())?;
        let mut columns = std::array::from_fn(|_| vec![0.0; n]);
        let source = NoiseSource { resolution: Resolution::Bits64, ..NoiseSource::default() };
        let mut noise = NoiseBlock::<N>::new();
        for (block, first) in (0..n).step_by(BLOCK).enumerate() {
            let last = n.min(first + BLOCK);
            let key = NoiseKey { stream, purpose: Purpose::Prior, step: 0, block };
            kernels::fill_noise(
                Simd::best(),
                source,
                Noise::StandardNormal,
                key,
                (last - first, N),
                &mut noise,
            );
            let mut states = columns.each_mut().map(|c| &mut c[first..last]);
            kernels::draw_normal(Simd::best(), self.mean(), &factor.0, &noise, &mut states);
        }
        Ok(columns)
    }
}

/// Settings of a [`ParticleFilter`](super::ParticleFilter).
#[derive(Clone, Debug)]
pub struct Settings {
    /// Number of particles, 1 000 by default; with a `size` that is not fixed, the first number.
    pub particles: usize,
    /// How their number changes from step to step.
    pub size: Size,
    /// How to resample.
    pub resampling: Resampling,
    /// When to resample.
    pub trigger: Trigger,
    /// What is done to survivors before they move on.
    pub rejuvenation: Rejuvenation,
    /// The auxiliary particle filter (Pitt and Shephard 1999; Whiteley and Johansen 2008): resampling comes
    /// first in a step, by weights times the power of this exponent of what the measurement is expected to
    /// say of a particle, and is divided out of the weights after the move. 1 is the original, less is more
    /// careful, `None` (the default) resamples after the measurement as `trigger` says. What is expected is
    /// p(z | f(x, E w)), or what a guided proposal fits to p(z | x): the locally optimal one leaves all
    /// weights equal (full adaptation). A step over no time resamples nothing, and survivors are not
    /// rejuvenated.
    pub lookahead: Option<f64>,
    /// How process noise is made.
    pub noise: NoiseSource,
    /// Instructions to use; results do not depend on it.
    pub simd: Simd,
    /// Threads to use; results do not depend on them.
    pub threads: Threads,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            particles: 1000,
            size: Size::Fixed,
            resampling: Resampling::default(),
            trigger: Trigger::default(),
            rejuvenation: Rejuvenation::Nothing,
            lookahead: None,
            noise: NoiseSource::default(),
            simd: Simd::best(),
            threads: Threads::Serial,
        }
    }
}

impl Settings {
    /// Refuses what is out of range for states of `dimensions` components.
    pub(super) fn checked(&self, dimensions: usize) -> Result<()> {
        checked_number(self.particles)?;
        if let Trigger::Below(fraction) = self.trigger {
            Error::not_negative("fraction that triggers resampling", fraction)?;
        }
        if let Some(exponent) = self.lookahead {
            Error::not_negative("exponent of the lookahead", exponent)?;
        }
        if self.trigger == Trigger::Never && self.size != Size::Fixed {
            return Err(never_resampled());
        }
        self.size.checked(dimensions, (self.particles, self.lookahead.is_some()))?;
        self.rejuvenation.checked().map(drop)
    }

    /// Refuses what filters cannot have that move their particles after each step, or draw them anew.
    pub(super) fn for_moves(&self) -> Result<()> {
        let refuse = |what: &str| Err(Error::Unsupported(what.to_owned()));
        if self.rejuvenation != Rejuvenation::Nothing {
            return refuse("moves take the place of a rejuvenation: set it to nothing");
        }
        if self.size != Size::Fixed {
            return refuse("moves keep the number of particles: leave its size fixed");
        }
        Ok(())
    }

    /// Refuses what filters cannot have that weigh and resample themselves.
    pub(super) fn for_own_weights(&self) -> Result<()> {
        self.for_moves()?;
        match self.lookahead {
            None => Ok(()),
            Some(_) => {
                let what = "this filter weighs its particles itself: it has no use for a lookahead";
                Err(Error::Unsupported(what.to_owned()))
            }
        }
    }
}
