//! Resampling followed by moves: copies of a particle part again, and the law stays what it is.

use crate::belief::{Gaussian, Lineage, MovedCloud, Pull, moments};
use crate::error::{Error, Result};
use crate::filter::{Filter, ParticleFilter, Prior, Settings, Update};
use crate::model::{Likelihood, Motion, TransitionDensity};
use crate::moves::{Move, Moved, PathLaw, Sweeps, spread_of};
use crate::rng::Stream;
use crate::time::Time;

/// A particle filter that moves its particles by a Markov kernel after each resampling (Gilks and Berzuini,
/// Journal of the Royal Statistical Society B 63, 2001): particle i with parent a is moved under p(z | x) p(x
/// | x_a), the law that it is a draw of. The motion must have a transition density.
///
/// After such a step the belief shows the moved particles with equal weights. Steps that do not resample, and
/// those in which no time passes, are those of the filter inside.
#[derive(Clone, Debug)]
pub struct ResampleMove<const N: usize, const W: usize, A, H, P = Gaussian<N>> {
    filter: ParticleFilter<N, W, A, H, P>,
    moves: Sweeps,
}

impl<const N: usize, const W: usize, A, H, P> ResampleMove<N, W, A, H, P>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
{
    /// Moves the particles of `filter` so many times by `kernel`.
    ///
    /// # Errors
    /// Parameters of the kernel out of range; a filter that rejuvenates its particles itself, or
    /// changes their number. A motion without a density is refused by the first step that takes time.
    pub fn new(filter: ParticleFilter<N, W, A, H, P>, kernel: Move, sweeps: u32) -> Result<Self> {
        filter.settings().for_moves()?;
        let moves = Sweeps { kernel, count: sweeps };
        moves.check()?;
        Ok(ResampleMove { filter, moves })
    }
}

impl<const N: usize, const W: usize, A, H, P> Filter for ResampleMove<N, W, A, H, P>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
{
    type Measurement = H::Value;
    type Belief = MovedCloud<N>;

    fn start(&self, at: Time, stream: Stream) -> Result<MovedCloud<N>> {
        self.filter.start(at, stream).map(MovedCloud::new)
    }

    fn step(&self, belief: &mut MovedCloud<N>, to: Time, z: Option<&H::Value>) -> Result<Update> {
        let from = belief.cloud.time;
        if to < from {
            return Err(Error::OutOfOrder { from, to });
        }
        let takes_time = z.is_some() && to > from;
        let density = takes_time
            .then(|| TransitionDensity::over(self.filter.motion(), from, to, &belief.cloud.mean()))
            .transpose()?;
        let digest = z.map(|z| self.filter.sensor().digest(z, to)).transpose()?;
        let &Settings { simd, ref threads, .. } = self.filter.settings();
        if takes_time {
            belief.remember_parents(simd);
        }
        let had_weights = !belief.cloud.equal;
        let mut update = self.filter.step(&mut belief.cloud, to, z)?;
        (belief.moved, belief.pull) = (Moved::default(), None);
        // A filter that looks ahead has resampled the parents: nothing is pending, and nothing has become
        // alike.
        if let (Some(density), Some(digest)) = (&density, &digest)
            && belief.cloud.pending
        {
            let spread = spread_of(&belief.cloud);
            let MovedCloud { cloud, likelihoods, .. } = belief;
            likelihoods.copy_from_slice(&cloud.scores);
            if had_weights {
                likelihoods.iter_mut().zip(&cloud.log_weights).for_each(|(score, weight)| *score -= weight);
            }
            belief.branch(simd);
            let MovedCloud { cloud, parents, densities, likelihoods, frozen, moved, pull, .. } = belief;
            let law = PathLaw::<A, H, N, W> { density, digest, parents, power: 1.0, simd };
            densities.copy_from_slice(likelihoods);
            law.complete(0, &cloud.states.each_ref().map(Vec::as_slice), densities);
            let before = moments(&cloud.states);
            *moved = self.moves.run(cloud, densities, frozen, &law, (threads, spread));
            *pull = Some(Pull::between(before, moments(&cloud.states)));
            cloud.equalise();
            cloud.lineage = Lineage::Ancestors;
            if let Some(particles) = &mut update.particles {
                particles.evaluations += moved.evaluations;
            }
        }
        Ok(update)
    }
}
