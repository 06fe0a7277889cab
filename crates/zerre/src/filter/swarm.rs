//! Particle filters whose survivors a swarm moves to where the likelihood is greatest, as papers have them.

use crate::belief::{Gaussian, Lineage, MovedCloud, Pull, SwarmBelief, moments};
use crate::error::{Error, Result};
use crate::filter::{Filter, ParticleFilter, Prior, Settings, Update};
use crate::kernels::BLOCK;
use crate::model::{Likelihood, Motion, TransitionDensity};
use crate::moves::{Law, Moved};
use crate::resample::Trigger;
use crate::rng::Stream;
use crate::swarm::{Expected, Search, Seen, Swarm};
use crate::time::Time;
use serde::{Deserialize, Serialize};

/// How a [`SwarmFilter`] reads what papers leave open. The default is what their text says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, rename_all = "kebab-case")]
pub struct Readings {
    /// What the swarm looks for.
    pub fitness: Fitness,
    /// Weights of particles that have moved.
    pub weights: MovedWeights,
    /// What is said of the state.
    pub estimate: SwarmEstimate,
    /// How often weighing, resampling and search are gone through with the same measurement. The step after the
    /// estimate asks whether "the greatest number of iterations" is reached, and goes back to weighing if not: 1
    /// reads that number as the one of the search itself. (Where it goes back to drawing the particles, all
    /// repetitions but the last are forgotten, which is 1 again.)
    pub repetitions: u32,
}

/// What a swarm in a filter looks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fitness {
    /// The likelihood p(z | x) alone.
    #[default]
    Likelihood,
    /// The likelihood times the prediction, p(z | x) sum_j p(x | x_j) over the particles x_j before the step: the
    /// posterior. It needs a motion with a transition density, and n densities for each evaluation.
    Posterior,
}

/// Weights of particles that a swarm has moved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MovedWeights {
    /// Equal, as resampling left them.
    Equal,
    /// In proportion to their likelihood, which is then used twice. They enter the estimate; the next step
    /// starts from equal ones.
    #[default]
    Refit,
}

/// What a [`SwarmFilter`] says of the state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SwarmEstimate {
    /// The weighted mean of the particles.
    #[default]
    Mean,
    /// The fittest place that the search saw.
    Best,
}

impl Default for Readings {
    fn default() -> Self {
        Readings {
            fitness: Fitness::default(),
            weights: MovedWeights::default(),
            estimate: SwarmEstimate::default(),
            repetitions: 1,
        }
    }
}

/// A particle filter that resamples in every step and then lets a [`Swarm`] move the survivors (PSO-PF and ABC-PF of
/// many papers).
///
/// **It does not estimate the posterior.** The search draws the particles to the maximum of the likelihood and
/// nothing corrects for it: with more iterations the spread goes to zero and the error to that of the likelihood's
/// maximum, whatever the motion says. The log-evidence is the one of the step before the search and is not one. See
/// [`SwarmImportance`](super::SwarmImportance), [`ResampleMove`](super::ResampleMove) with
/// [`Move::Stretch`](crate::moves::Move) and [`Tempered`](super::Tempered) for what is sound.
#[derive(Clone, Debug)]
pub struct SwarmFilter<const N: usize, const W: usize, A, H, P = Gaussian<N>> {
    filter: ParticleFilter<N, W, A, H, P>,
    swarm: Swarm<N>,
    readings: Readings,
}

impl<const N: usize, const W: usize, A, H, P> SwarmFilter<N, W, A, H, P>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
{
    /// Lets `swarm` move the survivors of `filter`.
    ///
    /// # Errors
    /// A filter that does not resample in every step ([`Trigger::Always`]), rejuvenates, changes the number of its
    /// particles or looks ahead; parameters of the swarm out of range; no repetition. A motion without a density is
    /// refused, where the fitness needs one, by the first step that takes time.
    pub fn new(filter: ParticleFilter<N, W, A, H, P>, swarm: Swarm<N>, readings: Readings) -> Result<Self> {
        filter.settings().for_own_weights()?;
        if filter.settings().trigger != Trigger::Always {
            let what = "a swarm moves the survivors of every step: set the trigger of the filter to always";
            return Err(Error::Unsupported(what.to_owned()));
        }
        if readings.repetitions == 0 {
            let needs = "it must be at least 1";
            return Err(Error::OutOfRange { what: "repetitions of the search", value: 0.0, needs });
        }
        swarm.check()?;
        Ok(SwarmFilter { filter, swarm, readings })
    }

    /// Searches from the particles as they stand, and weighs them afterwards.
    fn search(&self, belief: &mut SwarmBelief<N>, round: u64, digest: &H::Digest<'_>, law: &impl Law<N>) {
        let &Settings { simd, .. } = self.filter.settings();
        let MovedCloud { cloud, densities, swarm: memory, moved, .. } = &mut belief.moved;
        // Streams of a search are apart from those of resampling and of each other.
        let stream = cloud.stream.fork(SEARCH).fork(round);
        let search = Search { law, stream, step: cloud.step, simd, memory };
        let found = self.swarm.search(&mut cloud.states, densities, search);
        moved.evaluations += found.evaluations;
        cloud.equalise();
        if self.readings.weights == MovedWeights::Refit {
            match self.readings.fitness {
                Fitness::Likelihood => cloud.scores.copy_from_slice(densities),
                Fitness::Posterior => {
                    let states = cloud.states.each_ref().map(Vec::as_slice);
                    Seen::<H, N> { digest, simd }.log_density(0, &states, &mut cloud.scores);
                    moved.evaluations += cloud.len();
                }
            }
            let total = cloud.weigh(simd);
            // They enter the estimate only: `equal` stays, and with it what the next step starts from.
            if total.max == f64::NEG_INFINITY {
                cloud.equalise();
            }
        }
        belief.estimate = match self.readings.estimate {
            SwarmEstimate::Mean => cloud.mean(),
            SwarmEstimate::Best => found.best,
        };
    }

    /// Draws survivors by likelihood once more. Particles of no likelihood at all stay as they are.
    fn resample_again(&self, belief: &mut SwarmBelief<N>, round: u64, digest: &H::Digest<'_>) {
        let &Settings { simd, ref threads, resampling, .. } = self.filter.settings();
        let MovedCloud { cloud, moved, .. } = &mut belief.moved;
        let (stream, n) = (cloud.stream, cloud.len());
        for b in 0..n.div_ceil(BLOCK) {
            let range = b * BLOCK..((b + 1) * BLOCK).min(n);
            let states = cloud.states.each_ref().map(|c| &c[range.clone()]);
            Seen::<H, N> { digest, simd }.log_density(0, &states, &mut cloud.scores[range]);
        }
        moved.evaluations += n;
        if !cloud.equal {
            cloud.scores.iter_mut().zip(&cloud.log_weights).for_each(|(score, weight)| *score += weight);
        }
        let total = cloud.weigh(simd);
        if total.max > f64::NEG_INFINITY {
            cloud.stream = stream.fork(SEARCH).fork(round).fork(SEARCH);
            cloud.resample(resampling, (simd, threads), &total, n);
            cloud.stream = stream;
            belief.moved.branch(simd);
        }
        belief.moved.cloud.equalise();
    }
}

/// Label of the streams of searches: "swarm" in ASCII.
const SEARCH: u64 = 0x73_7761_726d;

impl<const N: usize, const W: usize, A, H, P> Filter for SwarmFilter<N, W, A, H, P>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
{
    type Measurement = H::Value;
    type Belief = SwarmBelief<N>;

    fn start(&self, at: Time, stream: Stream) -> Result<SwarmBelief<N>> {
        self.filter.start(at, stream).map(|cloud| SwarmBelief::new(cloud, &self.swarm))
    }

    fn step(&self, belief: &mut SwarmBelief<N>, to: Time, z: Option<&H::Value>) -> Result<Update> {
        let moved = &mut belief.moved;
        let from = moved.cloud.time;
        if to < from {
            return Err(Error::OutOfOrder { from, to });
        }
        let digest = z.map(|z| self.filter.sensor().digest(z, to)).transpose()?;
        let &Settings { simd, .. } = self.filter.settings();
        // Over no time there is no density: what was predicted is what is there.
        let foretells = self.readings.fitness == Fitness::Posterior && z.is_some() && to > from;
        let density = foretells
            .then(|| TransitionDensity::over(self.filter.motion(), from, to, &moved.cloud.mean()))
            .transpose()?;
        if let Some(density) = &density {
            moved.foretell(simd, density);
        }
        let mut update = self.filter.step(&mut moved.cloud, to, z)?;
        (moved.moved, moved.pull) = (Moved::default(), None);
        belief.estimate = belief.moved.cloud.mean();
        let (Some(digest), true) = (&digest, belief.moved.cloud.pending) else { return Ok(update) };
        belief.moved.branch(simd);
        belief.moved.cloud.equalise();
        belief.moved.cloud.lineage = Lineage::Lost;
        let before = moments(&belief.moved.cloud.states);
        let forecast = std::mem::take(&mut belief.moved.forecast);
        for round in 0..u64::from(self.readings.repetitions) {
            if round > 0 {
                self.resample_again(belief, round, digest);
            }
            match &density {
                Some(density) => {
                    let seen = Seen { digest, simd };
                    let law = Expected::<A, H, N, W> { seen, density, forecast: &forecast };
                    self.search(belief, round, digest, &law);
                }
                None => self.search(belief, round, digest, &Seen::<H, N> { digest, simd }),
            }
        }
        belief.moved.forecast = forecast;
        let MovedCloud { cloud, moved, pull, .. } = &mut belief.moved;
        *pull = Some(Pull::between(before, moments(&cloud.states)));
        if let Some(particles) = &mut update.particles {
            particles.evaluations += moved.evaluations;
        }
        Ok(update)
    }
}
