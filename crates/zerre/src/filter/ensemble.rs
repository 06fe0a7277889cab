//! The ensemble Kalman filter: a Kalman filter whose law is a sample.

use crate::belief::{Cloud, Gaussian, Lineage, MAX_PARTICLES};
use crate::error::{Error, Result};
use crate::filter::{Filter, Outcome, ParticleUpdate, Prior, Update};
use crate::kernels::{
    self, BLOCK, Correction, EnsembleSums, NoiseBlock, NoiseKey, NoiseSource, Reference, Simd, Source,
    Threads,
};
use crate::math::gaussian::log_density;
use crate::math::{Cholesky, Matrix, wrap};
use crate::model::{GaussianMeasurement, Motion, Noise};
use crate::rng::{Purpose, Stream};
use crate::time::Time;
use std::array::from_fn;

/// How a measurement corrects the members of an ensemble. Either way their mean moves by the Kalman gain of
/// their moments times the innovation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Correcting {
    /// Each member meets the measurement with an error of its own, drawn from the law of the measurement's
    /// (Burgers, van Leeuwen and Evensen, Monthly Weather Review 126, 1998); the errors are recentred to have
    /// mean zero, so that they move the spread of the members only.
    #[default]
    Perturbed,
    /// Deviations from the mean shrink by P_xh S^-T/2 (S^1/2 + R^1/2)^-1 times those of h (Whitaker and
    /// Hamill, Monthly Weather Review 130, 2002; Andrews 1968), square roots after Cholesky: the covariance
    /// of the members becomes that of the Kalman update without any draw.
    SquareRoot,
}

/// Settings of an [`Ensemble`].
#[derive(Clone, Debug)]
pub struct EnsembleSettings {
    /// Number of members, 100 by default.
    pub members: usize,
    /// How measurements correct them.
    pub correcting: Correcting,
    /// How noise is made.
    pub noise: NoiseSource,
    /// Instructions to use; results do not depend on it.
    pub simd: Simd,
    /// Threads to use; results do not depend on them.
    pub threads: Threads,
}

impl Default for EnsembleSettings {
    fn default() -> Self {
        EnsembleSettings {
            members: 100,
            correcting: Correcting::default(),
            noise: NoiseSource::default(),
            simd: Simd::best(),
            threads: Threads::Serial,
        }
    }
}

/// The ensemble Kalman filter (Evensen, Journal of Geophysical Research 99, 1994) for a motion model `A`, a
/// sensor `H` and a prior `P`: members move as particles do and keep equal weights; a measurement corrects
/// them by the Kalman gain of their sample moments, P_xh (P_hh + R)^-1, divided by one less than their number
/// n.
///
/// The log-evidence is ln N(nu; 0, P_hh + R), nu being the measurement less the mean of h over the members,
/// angles wrapped. On linear normal models mean, covariance and evidence are off by terms of the order of 1 /
/// n, on others by what the linear update misses too. Moments of few members are rank-deficient, so that at
/// least M + 2 are needed for a measurement of M components, and a small ensemble forgets too fast: nothing
/// is inflated here.
///
/// The outcome is [`Outcome::Degenerate`] where the evidence or the corrected members are not finite. The
/// effective sample size of its updates is the number of members.
///
/// ```
/// use zerre::belief::Gaussian;
/// use zerre::filter::{Ensemble, EnsembleSettings, Filter};
/// use zerre::model::{measurement::RangeBearing, motion::ConstantVelocity};
/// use zerre::rng::Stream;
/// use zerre::Time;
///
/// let prior = Gaussian::independent([900.0, 500.0, 0.0, 0.0], [100.0, 100.0, 10.0, 10.0])?;
/// let radar = RangeBearing::new([0.0, 0.0], 5.0, 0.01)?;
/// let settings = EnsembleSettings { members: 200, ..EnsembleSettings::default() };
/// let filter = Ensemble::new(prior, ConstantVelocity::<2>::new(0.1)?, radar, settings)?;
///
/// let mut belief = filter.start(Time::ZERO, Stream::new(1))?;
/// for (t, range, bearing) in [(0.0, 1000.0, 0.45), (1.0, 1004.0, 0.44), (2.0, 1008.0, 0.43)] {
///     filter.step(&mut belief, Time::from_secs(t), Some(&[range, bearing]))?;
/// }
/// assert!((belief.mean()[0] - 915.0).abs() < 30.0);
/// # Ok::<(), zerre::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Ensemble<const N: usize, const W: usize, const M: usize, A, H, P = Gaussian<N>> {
    prior: P,
    motion: A,
    measurement: H,
    settings: EnsembleSettings,
}

impl<const N: usize, const W: usize, const M: usize, A, H, P> Ensemble<N, W, M, A, H, P>
where
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
    P: Prior<N>,
{
    /// A filter from its models.
    ///
    /// # Errors
    /// Fewer than M + 2 members or more than 2^26; a measurement with heavier tails than the normal law.
    pub fn new(prior: P, motion: A, measurement: H, settings: EnsembleSettings) -> Result<Self> {
        enough::<M>(settings.members)?;
        // Far out in the tail a robust model has long departed from 1.
        if measurement.is_heavy_tailed() {
            let what =
                "the ensemble Kalman filter takes measurements with normal noise only, not robust ones";
            return Err(Error::Unsupported(what.into()));
        }
        Ok(Ensemble { prior, motion, measurement, settings })
    }

    /// Settings of the filter.
    pub fn settings(&self) -> &EnsembleSettings {
        &self.settings
    }

    /// Writes the members, moved if time passes, where the next belief will be.
    fn advance(&self, cloud: &mut Cloud<N>, moved: Option<&A::Step>) -> Result<()> {
        let EnsembleSettings { simd, noise: source, ref threads, .. } = self.settings;
        let (law, components) = (self.motion.noise(), self.motion.noise_components());
        let (stream, step) = (cloud.stream, cloud.step + 1);
        let from = &cloud.states;
        // Units take no memory.
        let mut nothing = vec![(); cloud.blocks.len()];
        let to = cloud.spare.each_mut().map(Vec::as_mut_slice);
        threads.for_each_block(to, [], &mut nothing, |block, mut states, [], ()| {
            let (first, count) = (block * BLOCK, states[0].len());
            let from = from.each_ref().map(|c| &c[first..first + count]);
            let Some(moved) = moved else {
                states.iter_mut().zip(from).for_each(|(to, from)| to.copy_from_slice(from));
                return;
            };
            let mut noise = NoiseBlock::<W>::new();
            let key = NoiseKey { stream, purpose: Purpose::Motion, step, block };
            kernels::fill_noise(simd, source, law, key, (count, components), &mut noise);
            kernels::propagate::<N, W, A>(simd, moved, &noise, Source::Columns(from), &mut states);
        });
        finite(&cloud.spare)
    }

    /// Corrects the members that [`Ensemble::advance`] wrote; the log-evidence, or nothing where the
    /// arithmetic does not hold.
    fn correct(&self, cloud: &mut Cloud<N>, z: &[f64; M], noise: &Noisy<M>, at: Time) -> Option<f64> {
        let EnsembleSettings { simd, correcting, ref threads, .. } = self.settings;
        let sensor = (&self.measurement, at);
        let (n, step) = (cloud.len(), cloud.step + 1);
        let perturbations = |block: usize, count: usize| {
            (correcting == Correcting::Perturbed).then(|| self.draw((cloud.stream, step), block, count))
        };
        let reference = Reference::of(&self.measurement, at, from_fn(|k| cloud.spare[k][0]));
        let mut sums = EnsembleSums::ZERO;
        for (block, first) in (0..n).step_by(BLOCK).enumerate() {
            let last = n.min(first + BLOCK);
            let states = cloud.spare.each_ref().map(|c| &c[first..last]);
            let drawn = perturbations(block, last - first);
            kernels::ensemble_sums(simd, sensor, &reference, &states, drawn.as_ref(), &mut sums);
        }
        let count = n as f64;
        let off = sums.seen.map(|s| s / count);
        let unbiased = 1.0 / (count - 1.0);
        let spread = (sums.seen_squares - Matrix::outer(&sums.seen, &off)).symmetrised() * unbiased;
        let cross = (sums.cross - Matrix::outer(&sums.state, &off)) * unbiased;
        let innovation: [f64; M] = from_fn(|i| {
            let nu = z[i] - reference.seen[i] - off[i];
            if H::ANGLE[i] { wrap(nu) } else { nu }
        });
        let factor = Cholesky::of("covariance of the innovation", &(spread + noise.covariance)).ok()?;
        let log_evidence = log_density(&innovation, &factor);
        if !log_evidence.is_finite() {
            return None;
        }
        let gain = factor.solve_matrix(&cross.transpose()).transpose();
        let mut shift = gain * innovation;
        let correction = match correcting {
            Correcting::Perturbed => {
                let spread = gain * *noise.factor.factor();
                let (back, centre) = (gain * off, spread * sums.noise.map(|s| s / count));
                shift = from_fn(|k| shift[k] + back[k] - centre[k]);
                Correction { shift, gain, spread }
            }
            Correcting::SquareRoot => {
                let gain = square_root_gain(&cross, &factor, &noise.factor);
                let back = gain * off;
                shift = from_fn(|k| shift[k] + back[k]);
                Correction { shift, gain, spread: Matrix::ZERO }
            }
        };
        let mut nothing = vec![(); cloud.blocks.len()];
        let to = cloud.spare.each_mut().map(Vec::as_mut_slice);
        threads.for_each_block(to, [], &mut nothing, |block, mut states, [], ()| {
            let drawn = perturbations(block, states[0].len());
            kernels::correct(simd, sensor, &reference, &correction, drawn.as_ref(), &mut states);
        });
        finite(&cloud.spare).is_ok().then_some(log_evidence)
    }

    /// Standard normal numbers behind the perturbations of the members of a block.
    fn draw(&self, (stream, step): (Stream, u64), block: usize, count: usize) -> NoiseBlock<M> {
        let EnsembleSettings { simd, noise: source, .. } = self.settings;
        let mut noise = NoiseBlock::new();
        let key = NoiseKey { stream, purpose: Purpose::Ensemble, step, block };
        kernels::fill_noise(simd, source, Noise::StandardNormal, key, (count, M), &mut noise);
        noise
    }
}

/// R and its Cholesky factor.
struct Noisy<const M: usize> {
    covariance: Matrix<M, M>,
    factor: Cholesky<M>,
}

/// P_xh D^-T (D + E)^-1 with S = D D' and R = E E'.
fn square_root_gain<const N: usize, const M: usize>(
    cross: &Matrix<N, M>,
    s: &Cholesky<M>,
    r: &Cholesky<M>,
) -> Matrix<N, M> {
    // Rows of P_xh D^-T are the whitened rows of P_xh; X (D + E) = Y is solved from the last column on.
    let lower = *s.factor() + *r.factor();
    Matrix(cross.0.map(|row| {
        let y = s.whiten(&row);
        let mut x = [0.0f64; M];
        for j in (0..M).rev() {
            x[j] = (j + 1..M).fold(y[j], |rest, k| (-x[k]).mul_add(lower.0[k][j], rest)) / lower.0[j][j];
        }
        x
    }))
}

/// Refuses ensembles whose moments cannot serve measurements of M components.
fn enough<const M: usize>(members: usize) -> Result<()> {
    if (M + 2..=MAX_PARTICLES).contains(&members) {
        return Ok(());
    }
    let needs = "it must be at least the components of a measurement plus 2, and at most 2^26";
    Err(Error::OutOfRange { what: "number of members", value: members as f64, needs })
}

/// Refuses members whose covariance is not finite.
fn finite<const N: usize>(columns: &[Vec<f64>; N]) -> Result<()> {
    for column in columns {
        let mean = column.iter().sum::<f64>() / column.len() as f64;
        let square = column.iter().fold(0.0, |sum, x| sum + (x - mean) * (x - mean));
        Error::finite("spread of the members", square)?;
    }
    Ok(())
}

impl<const N: usize, const W: usize, const M: usize, A, H, P> Filter for Ensemble<N, W, M, A, H, P>
where
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
    P: Prior<N>,
{
    type Measurement = H::Value;
    type Belief = Cloud<N>;

    fn start(&self, at: Time, stream: Stream) -> Result<Cloud<N>> {
        Cloud::from_columns(at, stream, self.prior.columns(stream, self.settings.members)?)
    }

    /// The belief may be any cloud of equal weights.
    fn step(&self, cloud: &mut Cloud<N>, to: Time, z: Option<&H::Value>) -> Result<Update> {
        if to < cloud.time {
            return Err(Error::OutOfOrder { from: cloud.time, to });
        }
        let n = cloud.len();
        enough::<M>(n)?;
        if !cloud.equal || cloud.pending {
            return Err(Error::Unsupported("members of an ensemble have equal weights".into()));
        }
        let seen = z.map(|z| {
            self.measurement.given(z, to)?;
            let covariance = Matrix(self.measurement.covariance());
            let factor = Cholesky::of("covariance of the measurement", &covariance)?;
            let z = self.measurement.components(z);
            z.iter().try_for_each(|&z| Error::finite("measurement", z).map(drop))?;
            Ok((z, Noisy { covariance, factor }))
        });
        let seen = seen.transpose()?;
        let moved = (to > cloud.time).then(|| self.motion.over(cloud.time, to)).transpose()?;
        self.advance(cloud, moved.as_ref())?;
        let (mut outcome, mut log_evidence) = (Outcome::Predicted, 0.0);
        if let Some((z, noise)) = seen {
            if let Some(evidence) = self.correct(cloud, &z, &noise, to) {
                (outcome, log_evidence) = (Outcome::Updated, evidence);
            } else {
                (outcome, log_evidence) = (Outcome::Degenerate, f64::NEG_INFINITY);
                // The same numbers once more.
                self.advance(cloud, moved.as_ref())?;
            }
        }
        std::mem::swap(&mut cloud.states, &mut cloud.spare);
        (cloud.time, cloud.step) = (to, cloud.step + 1);
        // Corrected members are no longer where the motion led them.
        cloud.lineage = if outcome == Outcome::Updated { Lineage::Lost } else { Lineage::Numbers };
        for (block, sums) in cloud.blocks.iter_mut().enumerate() {
            let range = block * BLOCK..((block + 1) * BLOCK).min(n);
            let states = cloud.states.each_ref().map(|c| &c[range.clone()]);
            let (scores, weights) = (&mut cloud.scores[range.clone()], &mut cloud.weights[range]);
            scores.fill(0.0);
            *sums = kernels::weigh(self.settings.simd, None, scores, &states, weights);
        }
        let particles = ParticleUpdate {
            particles: n,
            ess: n as f64,
            resampled: false,
            distinct_ancestors: n,
            not_finite: 0,
            evaluations: if z.is_some() { n } else { 0 },
        };
        Ok(Update { outcome, log_evidence, particles: Some(particles) })
    }
}
