//! A swarm that looks for where the posterior is, and weights that put right what it found.

use crate::belief::{Gaussian, Lineage, MovedCloud, Pull, moments};
use crate::error::{Error, Result};
use crate::filter::particle::Defensive;
use crate::filter::rejuvenation::Kernel;
use crate::filter::{Filter, Outcome, ParticleFilter, Prior, Settings, Update};
use crate::math::{Cholesky, Matrix, Real};
use crate::model::{Likelihood, Motion, Noise, TransitionDensity};
use crate::moves::{Law, Moved, spread_of};
use crate::rng::{Draws, Purpose, Stream};
use crate::swarm::{Expected, Search, Seen, Swarm};
use crate::time::Time;

/// A particle filter that proposes about the points of a swarm and weighs by the marginal of the posterior
/// (Klaas, de Freitas and Doucet, *Toward practical N^2 Monte Carlo: the marginal particle filter*, Uncertainty in
/// Artificial Intelligence, 2005).
///
/// The swarm starts from a prediction and looks for p(z | x) P(x) with P(x) = sum_j w_j p(x | x_j) over the particles
/// x_j before the step. Its points s_j, frozen, make the proposal q(x) = a P(x) + (1 - a) / n sum_j N(x; s_j, H), from
/// which n new particles are drawn and weighed by p(z | x) P(x) / q(x). The share a of the prediction bounds the
/// weights by p(z | x) / a, however wrong the swarm is (Hesterberg, Technometrics 37, 1995). H is the covariance of
/// the swarm, scaled by what the fitness of its points says of how far it has contracted.
///
/// Any swarm leaves the posterior as it is, in mean and in evidence; a good one leaves the weights alike. The cost is
/// of the order of n^2 densities of the transition for each round of the swarm. The motion must have such a density.
#[derive(Clone, Debug)]
pub struct SwarmImportance<const N: usize, const W: usize, A, H, P = Gaussian<N>> {
    filter: ParticleFilter<N, W, A, H, P>,
    swarm: Swarm<N>,
    defensive: f64,
}

/// Share of the prediction's standard deviation that H has at least in each component.
const LEAST: f64 = 0.01;
/// Labels of the streams of searches and of what is drawn from the proposal.
const SEARCH: u64 = 1;
const SAMPLE: u64 = 2;

impl<const N: usize, const W: usize, A, H, P> SwarmImportance<N, W, A, H, P>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
{
    /// Lets `swarm` look for where the particles of `filter` should be. A fifth of them comes from the prediction.
    /// How `filter` resamples tells which particles the prediction is drawn from; its trigger has no effect.
    ///
    /// # Errors
    /// A filter that rejuvenates, changes the number of its particles or looks ahead; parameters of the swarm out of
    /// range. A motion without a density is refused by the first step that takes time.
    pub fn new(filter: ParticleFilter<N, W, A, H, P>, swarm: Swarm<N>) -> Result<Self> {
        filter.settings().for_own_weights()?;
        swarm.check()?;
        Ok(SwarmImportance { filter, swarm, defensive: 0.2 })
    }

    /// The same with another share of particles that come from the prediction.
    ///
    /// # Errors
    /// A share outside (0, 1].
    pub fn with_defensive(self, share: f64) -> Result<Self> {
        if !(share > 0.0 && share <= 1.0) {
            let needs = "it must lie in (0, 1]";
            return Err(Error::OutOfRange { what: "share of the prediction", value: share, needs });
        }
        Ok(SwarmImportance { defensive: share, ..self })
    }

    /// Draws the noise of the motion.
    fn noise(&self, draws: &mut Draws) -> [f64; W] {
        let components = self.filter.motion().noise_components();
        std::array::from_fn(|k| match self.filter.motion().noise() {
            _ if k >= components => 0.0,
            Noise::StandardNormal => draws.normal(),
            Noise::Gamma { shape } => draws.gamma(shape),
        })
    }
}

/// N(0, D D') about points: a mixture of them is a random walk from them.
struct About<const N: usize> {
    factor: Matrix<N, N>,
}

impl<const N: usize> Motion<N, N> for About<N> {
    type Step = Matrix<N, N>;

    fn over(&self, _: Time, _: Time) -> Result<Matrix<N, N>> {
        Ok(self.factor)
    }

    #[inline(always)]
    fn apply<R: Real>(factor: &Matrix<N, N>, x: [R; N], w: [R; N]) -> [R; N] {
        std::array::from_fn(|i| (0..N).fold(x[i], |sum, j| (w[j] * factor.0[i][j]) + sum))
    }
}

impl<const N: usize, const W: usize, A, H, P> Filter for SwarmImportance<N, W, A, H, P>
where
    A: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
{
    type Measurement = H::Value;
    type Belief = MovedCloud<N>;

    fn start(&self, at: Time, stream: Stream) -> Result<MovedCloud<N>> {
        let mut cloud = self.filter.start(at, stream)?;
        let n = cloud.len();
        cloud.scratch.reserve(n, n);
        Ok(MovedCloud::new(cloud).with_swarm(&self.swarm))
    }

    fn step(&self, belief: &mut MovedCloud<N>, to: Time, z: Option<&H::Value>) -> Result<Update> {
        let from = belief.cloud.time;
        if to < from {
            return Err(Error::OutOfOrder { from, to });
        }
        let (Some(z), true) = (z, to > from) else {
            let update = self.filter.step(&mut belief.cloud, to, z)?;
            (belief.moved, belief.pull) = (Moved::default(), None);
            return Ok(update);
        };
        let density = TransitionDensity::over(self.filter.motion(), from, to, &belief.cloud.mean())?;
        let step = self.filter.motion().over(from, to)?;
        let digest = self.filter.sensor().digest(z, to)?;
        let &Settings { simd, ref threads, resampling, .. } = self.filter.settings();
        belief.foretell(simd, &density);
        let n = belief.cloud.len();
        let before = (belief.cloud.equal, belief.cloud.log_sum);
        if !belief.cloud.equal {
            // The prediction is drawn from as many particles as there are, by their weights.
            let total = belief.cloud.total();
            belief.cloud.resample(resampling, (simd, threads), &total, n);
        }
        let mut update = self.filter.step(&mut belief.cloud, to, None)?;
        let MovedCloud {
            cloud,
            parents,
            spare,
            densities,
            likelihoods,
            forecast,
            about,
            swarm: memory,
            pull,
            ..
        } = belief;

        let spread = spread_of(cloud);
        let predicted = moments(&cloud.states);
        spare.iter_mut().zip(&cloud.states).for_each(|(to, from)| to.copy_from_slice(from));
        let law =
            Expected::<A, H, N, W> { seen: Seen { digest: &digest, simd }, density: &density, forecast };
        let (stream, number) = (cloud.stream.fork(SEARCH), cloud.step);
        let search = Search { law: &law, stream, step: number, simd, memory };
        let found = self.swarm.search(spare, densities, search);
        let points = &*spare;

        let kernel = About { factor: kernel_factor(points, (densities, found.fitness), &spread) };
        let second = Time::from_nanos(1_000_000_000);
        // One particle has no spread to make a kernel of: the prediction is all there is.
        let kernels = Some(n).filter(|n| *n > 1);
        let kernels =
            kernels.and_then(|_| TransitionDensity::over(&kernel, Time::ZERO, second, &[0.0; N]).ok());
        let share = if kernels.is_some() { self.defensive } else { 1.0 };
        let defensive = Defensive::new(share, cloud.stream, number);
        let takes_own = &mut cloud.weights;
        defensive.mark(0, takes_own);
        let sample = &mut cloud.spare;
        sample.iter_mut().for_each(|column| column.resize(n, 0.0));
        let stream = cloud.stream.fork(SAMPLE);
        for i in 0..n {
            let mut draws = stream.draws(Purpose::Propose, number, i as u32);
            let x = if takes_own[i] != 0.0 || kernels.is_none() {
                let parent = forecast.pick(draws.uniform());
                A::apply(&step, std::array::from_fn(|k| parents[k][parent]), self.noise(&mut draws))
            } else {
                let normal: [f64; N] = std::array::from_fn(|_| draws.normal());
                About::apply(&kernel.factor, std::array::from_fn(|k| points[k][i]), normal)
            };
            sample.iter_mut().zip(x).for_each(|(column, x)| column[i] = x);
        }
        let columns = sample.each_ref().map(Vec::as_slice);
        // ln P into densities, ln q into scores, ln p(z | x) into likelihoods.
        forecast.log_density(simd, &density, &columns, densities);
        match &kernels {
            None => cloud.scores.copy_from_slice(densities),
            Some(kernels) => {
                about.fill(simd, kernels, points, std::iter::repeat_n(1.0 / n as f64, n));
                about.log_density(simd, kernels, &columns, &mut cloud.scores);
                for (q, p) in cloud.scores.iter_mut().zip(&*densities) {
                    *q = log_add(Real::ln(share) + p, Real::ln(1.0 - share) + *q);
                }
            }
        }
        Seen::<H, N> { digest: &digest, simd }.log_density(0, &columns, likelihoods);
        let mut not_finite = 0;
        for (i, q) in cloud.scores.iter_mut().enumerate() {
            let score = likelihoods[i] + densities[i] - *q;
            let is_lost = sample.iter().any(|column| !column[i].is_finite());
            if is_lost {
                not_finite += 1;
                sample.iter_mut().for_each(|column| column[i] = 0.0);
            }
            *q = if is_lost || score.is_nan() { f64::NEG_INFINITY } else { score };
        }
        *pull = Some(Pull::between(predicted, moments(points)));
        belief.moved = Moved { accepted: 0, evaluations: found.evaluations };
        let possible = cloud.scores.iter().any(|score| *score > f64::NEG_INFINITY);
        if !possible {
            // The prediction stands, of the particles as they were with their weights.
            cloud.states.iter_mut().zip(&*parents).for_each(|(to, from)| to.copy_from_slice(from));
            (cloud.equal, cloud.log_sum) = before;
            (cloud.time, cloud.step) = (from, number - 1);
            update = self.filter.step(cloud, to, None)?;
            (update.outcome, update.log_evidence) = (Outcome::Degenerate, f64::NEG_INFINITY);
        }
        if let Some(particles) = &mut update.particles {
            particles.evaluations = found.evaluations + n;
            particles.not_finite += not_finite;
        }
        if !possible {
            return Ok(update);
        }
        std::mem::swap(&mut cloud.states, &mut cloud.spare);
        let total = cloud.weigh(simd);
        cloud.keep_weights(total.log_sum());
        cloud.lineage = Lineage::Lost;
        update.outcome = Outcome::Updated;
        update.log_evidence = total.log_sum() - Real::ln(n as f64);
        if let Some(particles) = &mut update.particles {
            particles.ess = total.ess();
        }
        Ok(update)
    }
}

/// ln (e^a + e^b).
fn log_add(a: f64, b: f64) -> f64 {
    let (large, small) = if a > b { (a, b) } else { (b, a) };
    if large == f64::NEG_INFINITY { large } else { large + Real::ln(1.0 + Real::exp(small - large)) }
}

/// Some D with D D' = s C + LEAST^2 V, C being the covariance of the points and V the variances of the prediction.
///
/// The scale s is h^2, h being the width of the best kernel for a normal law, or more where the swarm has contracted: of
/// points whose covariance is c times that of a normal law in d components, the log-density is c d / 2 below its largest
/// value on average. Their fitness therefore tells c, and s = 1 / c gives the kernels the width of that law, as far as it
/// is not wider than the prediction.
fn kernel_factor<const N: usize>(
    points: &[Vec<f64>; N],
    (fitness, best): (&[f64], f64),
    spread: &Matrix<N, N>,
) -> Matrix<N, N> {
    let n = points.first().map_or(0, Vec::len);
    let [mean, _] = moments(points);
    let (h, _) = Kernel::Gaussian.bandwidth(n, N);
    let mut covariance = Matrix::<N, N>::ZERO;
    for i in 0..n {
        let d: [f64; N] = std::array::from_fn(|k| points[k][i] - mean[k]);
        for r in 0..N {
            for c in 0..N {
                covariance.0[r][c] += d[r] * d[c] / n as f64;
            }
        }
    }
    let variances = (*spread * spread.transpose()).diagonal();
    let (found, mut widest) = (covariance.diagonal(), f64::INFINITY);
    for (&own, &most) in found.iter().zip(&variances) {
        if own > 0.0 {
            widest = widest.min(most / own);
        }
    }
    let below = fitness.iter().map(|fit| best - fit).sum::<f64>() / n as f64;
    let scale = (0.5 * N as f64 / below).min(widest).max(h * h);
    let scale = if scale.is_finite() { scale } else { h * h };
    let least = Matrix::from_diagonal(variances.map(|v| LEAST * LEAST * v));
    Cholesky::semidefinite("covariance of the swarm", &(covariance * scale + least)).unwrap_or(Matrix::ZERO)
}
