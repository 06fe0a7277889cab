//! Online expectation maximisation by a particle filter (Özkan, Çukurova University Journal of the Faculty of
//! Engineering and Architecture 34(1), 2019, Algorithm 1).

use super::centre::{Centre, check};
use super::scan::{Lobes, MOMENTS, PointScan, PointScanGiven};
use super::shape::{MAX_ELLIPSES, Shape};
use super::statistics::{MStep, Sums};
use crate::belief::{Cloud, Gaussian};
use crate::error::{Error, Result};
use crate::filter::{Filter, Outcome, ParticleFilter, ParticleUpdate, Settings, Update};
use crate::kernels::{self, BLOCK, BlockSums, Carried, Inherited, MAX_CARRIED, Simd, Threads, Total};
use crate::math::{Cholesky, Dual, Matrix, exp, ln};
use crate::model::Motion;
use crate::resample::{Resampling, Trigger};
use crate::rng::{Purpose, Stream};
use crate::time::Time;
use serde::{Deserialize, Serialize};

/// What is done about the ellipse r that a point y comes from, which nobody sees.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reading {
    /// Drawn for every point from the weights of the ellipses before the points are looked at: the algorithm
    /// as it is printed. Nine points and three ellipses are 3^9 combinations, few of which fit.
    Sampled,
    /// As [`Reading::Sampled`], one point at a time, with resampling after each.
    Sequential,
    /// Drawn from p(r | x, y); the weight is that of the points whatever they come from.
    Optimal,
    /// Summed over, in the weights and in the statistics (Rao and Blackwell).
    #[default]
    Marginal,
}

/// Settings of an [`OnlineEm`].
#[derive(Clone, Debug)]
pub struct OnlineSettings {
    /// What is done about the ellipses of points.
    pub reading: Reading,
    /// Number of particles, 1 000 by default.
    pub particles: usize,
    /// Scan k counts k^-`exponent` in the averages, those before it the rest; above 0.5 and at most 1, 0.6 by
    /// default.
    pub exponent: f64,
    /// Scans before the shape first changes, 3 by default.
    pub burn_in: u64,
    /// How the shape follows from the averages. The points of its prior are counted among those of all scans.
    pub m_step: MStep,
    /// Whether the centre is kept where the points have their mean: points say nothing of where in the shape
    /// it is.
    pub recentre: bool,
    /// Noise of the sensor on each point, m^2.
    pub noise: Matrix<2, 2>,
    /// How to resample, which is done after every scan.
    pub resampling: Resampling,
    /// Instructions to use; results do not depend on it.
    pub simd: Simd,
    /// Threads to use; results do not depend on them.
    pub threads: Threads,
}

impl Default for OnlineSettings {
    fn default() -> Self {
        OnlineSettings {
            reading: Reading::default(),
            particles: 1000,
            exponent: 0.6,
            burn_in: 3,
            m_step: MStep::default(),
            recentre: true,
            noise: Matrix::ZERO,
            resampling: Resampling::default(),
            simd: Simd::best(),
            threads: Threads::Serial,
        }
    }
}

/// The filter: particles carry the statistics of their own path, averaged over the scans with weights that
/// fade, and the shape of the next scan is the most likely one under the mean of these over the particles.
#[derive(Clone, Debug)]
pub struct OnlineEm<A, C, const N: usize, const W: usize> {
    particles: ParticleFilter<N, W, A, PointScan<C>>,
    settings: OnlineSettings,
}

/// What an [`OnlineEm`] knows. It can be saved: what is loaded goes on to the same bits.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(try_from = "Saved<N>")]
pub struct OnlineBelief<const N: usize> {
    cloud: Cloud<N>,
    shape: Shape,
    sums: Vec<Sums>,
    /// Scans with points so far.
    scans: u64,
    /// Statistics of the particles, per block.
    carried: Vec<Carried>,
    /// Whose statistics each particle has.
    parents: Vec<u32>,
    /// How far the centre has moved since the statistics were written.
    moved: [f64; 2],
    #[serde(skip_serializing)]
    parts: Vec<Part<N>>,
}

/// What is read before it is checked.
#[derive(Deserialize)]
struct Saved<const N: usize> {
    cloud: Cloud<N>,
    shape: Shape,
    sums: Vec<Sums>,
    scans: u64,
    carried: Vec<Carried>,
    parents: Vec<u32>,
    moved: [f64; 2],
}

impl<const N: usize> TryFrom<Saved<N>> for OnlineBelief<N> {
    type Error = Error;

    fn try_from(saved: Saved<N>) -> Result<Self> {
        let Saved { cloud, shape, sums, scans, carried, parents, moved } = saved;
        let (count, columns) = (cloud.len(), MOMENTS * shape.len());
        let whole = carried.iter().all(|carried| carried.columns() == columns);
        let known = parents.iter().all(|parent| (*parent as usize) < count);
        let lengths = [sums.len(), carried.len(), parents.len()];
        if lengths != [shape.len(), count.div_ceil(BLOCK), count] || !whole || !known {
            return Err(Error::Unsupported(
                "the parts of a saved belief do not belong together: save it anew".into(),
            ));
        }
        Ok(OnlineBelief { parts: parts(&carried), cloud, shape, sums, scans, carried, parents, moved })
    }
}

/// What a block adds to the whole.
#[derive(Clone, Debug)]
struct Part<const N: usize> {
    /// What its particles come to carry.
    to: Carried,
    /// Sums of weights times that.
    sums: [f64; MAX_CARRIED],
    weights: BlockSums<N>,
}

/// Room for what each block adds.
fn parts<const N: usize>(carried: &[Carried]) -> Vec<Part<N>> {
    let part =
        |to: &Carried| Part { to: to.clone(), sums: [0.0; MAX_CARRIED], weights: BlockSums::default() };
    carried.iter().map(part).collect()
}

impl<const N: usize> OnlineBelief<N> {
    /// Time of the belief.
    pub fn time(&self) -> Time {
        self.cloud.time()
    }

    /// The particles, with the weights of the last scan.
    pub fn cloud(&self) -> &Cloud<N> {
        &self.cloud
    }

    /// Law of the state.
    ///
    /// # Errors
    /// [`Error::NotFinite`] once every particle is lost.
    pub fn state(&self) -> Result<Gaussian<N>> {
        self.cloud.gaussian()
    }

    /// The shape about the centre.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// Averaged statistics of a scan, per ellipse: what the shape is known by.
    pub fn sums(&self) -> &[Sums] {
        &self.sums
    }

    /// Scans with points that were used.
    pub fn scans(&self) -> u64 {
        self.scans
    }
}

impl<A, C, const N: usize, const W: usize> OnlineEm<A, C, N, W>
where
    A: Motion<N, W>,
    C: Centre<N>,
{
    /// Starts from a state and a shape.
    ///
    /// # Errors
    /// Settings that mean nothing.
    pub fn new(
        motion: A,
        centre: C,
        prior: Gaussian<N>,
        shape: Shape,
        settings: OnlineSettings,
    ) -> Result<Self> {
        settings.m_step.check()?;
        let value = settings.exponent;
        if !(value > 0.5 && value <= 1.0) {
            let needs = "it must lie above 0.5 and not above 1";
            return Err(Error::OutOfRange { what: "exponent of the gains", value, needs });
        }
        let of_particles = Settings {
            particles: settings.particles,
            resampling: settings.resampling,
            trigger: Trigger::Always,
            simd: settings.simd,
            threads: settings.threads.clone(),
            ..Settings::default()
        };
        let scan = PointScan::new(centre, shape, &settings.noise)?;
        Ok(OnlineEm { particles: ParticleFilter::new(prior, motion, scan, of_particles)?, settings })
    }

    fn first(&self) -> &Shape {
        self.particles.sensor().shape()
    }

    /// Weighs the particles by points; what they carry becomes `keep` times what they carried and `gain`
    /// times what the points say. The sums of the weights and ln p of the points given all before; `None`,
    /// and nothing of what is carried changed yet, if no particle explains them.
    fn weigh(
        &self,
        belief: &mut OnlineBelief<N>,
        given: &PointScanGiven<'_, C>,
        (keep, gain): (f64, f64),
    ) -> Option<(Total<N>, f64)> {
        let OnlineSettings { reading, simd, ref threads, .. } = self.settings;
        let OnlineBelief { cloud, carried, parents, moved, parts, .. } = belief;
        let before = cloud.log_sum;
        let states = cloud.states.each_ref().map(Vec::as_slice);
        let log_weights = (!cloud.equal).then_some(&cloud.log_weights);
        let (stream, step) = (cloud.stream, cloud.step);
        let columns: [&mut [f64]; 2] = [&mut cloud.scores, &mut cloud.weights];
        threads.for_each_block([], columns, parts, |b, [], [scores, weights], part| {
            let range = b * BLOCK..b * BLOCK + scores.len();
            let states = states.map(|column| &column[range.clone()]);
            let inherited = Inherited { from: carried, parents: &parents[range.clone()], keep, by: *moved };
            if reading == Reading::Marginal {
                kernels::share(simd, given, &states, inherited, gain, (&mut *scores, &mut part.to));
            } else {
                let optimal = reading == Reading::Optimal;
                let draws = |i: usize| stream.draws(Purpose::Other, step, (range.start + i) as u32);
                let to = (&mut *scores, &mut part.to);
                kernels::share_drawn(simd, given, (optimal, draws), &states, inherited, gain, to);
            }
            let log_weights = log_weights.map(|l| &l[range.clone()]);
            part.weights = kernels::weigh(simd, log_weights, scores, &states, weights);
            kernels::carried_sums(simd, weights, &part.to, &mut part.sums[..part.to.columns()]);
        });
        cloud.blocks.clear();
        cloud.blocks.extend(parts.iter().map(|part| part.weights));
        let total = cloud.total();
        if !(total.sum.is_finite() && total.max.is_finite()) {
            return None;
        }
        Some((total, total.log_sum() - before))
    }

    /// Makes what the last points said part of what is carried, the centre moving on by `moved`, and
    /// resamples by their weights.
    fn accept(&self, belief: &mut OnlineBelief<N>, total: &Total<N>, moved: [f64; 2]) -> usize {
        for (carried, part) in belief.carried.iter_mut().zip(&mut belief.parts) {
            std::mem::swap(carried, &mut part.to);
        }
        belief.moved = moved;
        let OnlineSettings { resampling, simd, ref threads, particles, .. } = self.settings;
        let distinct = belief.cloud.resample(resampling, (simd, threads), total, particles);
        belief.parents.clone_from(&belief.cloud.ancestors);
        distinct
    }

    /// The shape from what the particles come to carry, and the centre to the mean of its points; how far
    /// that is.
    fn maximise(&self, belief: &mut OnlineBelief<N>, total: &Total<N>) -> Result<[f64; 2]> {
        let mut all = [0.0; MAX_CARRIED];
        for part in &belief.parts {
            let factor = part.weights.factor(total.max) / total.sum;
            for (all, sum) in all.iter_mut().zip(&part.sums) {
                *all = factor.mul_add(*sum, *all);
            }
        }
        let mut sums = [Sums::default(); MAX_ELLIPSES];
        for (sums, s) in sums.iter_mut().zip(all.chunks_exact(MOMENTS)) {
            *sums = Sums::from_moments(s);
        }
        let sums = &mut sums[..belief.shape.len()];
        for s in sums.iter().flat_map(|s| s.first.iter().chain(&s.second).chain([&s.count])) {
            Error::finite("statistics of a shape", *s)?;
        }
        let mut moved = [0.0; 2];
        if belief.scans > self.settings.burn_in {
            let MStep { prior, .. } = self.settings.m_step;
            // Averages are of one scan: so must be what the prior adds.
            let m_step = MStep { prior: prior / belief.scans as f64, ..self.settings.m_step };
            belief.shape = m_step.shape(sums, self.first(), &self.settings.noise)?;
            if self.settings.recentre {
                moved = self.recentre(belief, sums);
            }
        }
        belief.sums.copy_from_slice(sums);
        Ok(moved)
    }

    /// Moves the centre to the mean of the points of the shape: states, shape and statistics together, so
    /// that points stay as likely as they were; to first order where the centre is no linear function of the
    /// state, and not at all where the state cannot move it.
    fn recentre(&self, belief: &mut OnlineBelief<N>, sums: &mut [Sums]) -> [f64; 2] {
        let by = belief.shape.centroid();
        let seen = self.particles.sensor().centre().at(Dual::<N>::variables(belief.cloud.mean()));
        let slope = Matrix(seen.map(|s| s.gradient));
        let square = slope.congruence(&Matrix::identity());
        let Ok(root) = Cholesky::of("square of the slope of the centre", &square) else { return [0.0; 2] };
        belief.cloud.translate(&(slope.transpose() * (root.inverse() * by)));
        belief.shape = belief.shape.about(by);
        sums.iter_mut().for_each(|sums| *sums = sums.about(by));
        by
    }

    /// Takes in a scan with points, the particles having been moved; `None` if nothing explains it.
    fn take(
        &self,
        belief: &mut OnlineBelief<N>,
        points: &[[f64; 2]],
    ) -> Result<Option<(f64, ParticleUpdate)>> {
        let lobes = Lobes::of(&belief.shape.blurred(&self.settings.noise))?;
        let centre = self.particles.sensor().centre();
        let gain = exp(-self.settings.exponent * ln((belief.scans + 1) as f64));
        let at_once = if self.settings.reading == Reading::Sequential { 1 } else { points.len() };
        let (mut log_evidence, mut keep) = (0.0, 1.0 - gain);
        let mut update = ParticleUpdate {
            particles: self.settings.particles,
            ess: f64::INFINITY,
            resampled: true,
            distinct_ancestors: 0,
            not_finite: 0,
            evaluations: 0,
        };
        let parts = points.len().div_ceil(at_once);
        for (k, points) in (1..).zip(points.chunks(at_once)) {
            let given = PointScanGiven { centre, lobes: &lobes, points };
            let Some((total, log)) = self.weigh(belief, &given, (keep, gain)) else { return Ok(None) };
            (log_evidence, keep) = (log_evidence + log, 1.0);
            update.ess = update.ess.min(total.ess());
            update.evaluations += self.settings.particles;
            let mut moved = [0.0; 2];
            if k == parts {
                belief.scans += 1;
                let Ok(by) = self.maximise(belief, &total) else { return Ok(None) };
                moved = by;
            }
            update.distinct_ancestors = self.accept(belief, &total, moved);
            if k < parts {
                let at = belief.time();
                self.particles.step(&mut belief.cloud, at, None)?;
            }
        }
        Ok(Some((log_evidence, update)))
    }
}

impl<A, C, const N: usize, const W: usize> Filter for OnlineEm<A, C, N, W>
where
    A: Motion<N, W>,
    C: Centre<N>,
{
    type Measurement = Vec<[f64; 2]>;
    type Belief = OnlineBelief<N>;

    fn start(&self, at: Time, stream: Stream) -> Result<OnlineBelief<N>> {
        let cloud = self.particles.start(at, stream)?;
        let shape = self.first().clone();
        let carried = vec![Carried::new(MOMENTS * shape.len()); cloud.len().div_ceil(BLOCK)];
        Ok(OnlineBelief {
            sums: vec![Sums::default(); shape.len()],
            shape,
            scans: 0,
            parts: parts(&carried),
            carried,
            parents: (0..cloud.len() as u32).collect(),
            moved: [0.0; 2],
            cloud,
        })
    }

    /// A scan without points moves the particles and says nothing.
    fn step(&self, belief: &mut OnlineBelief<N>, to: Time, scan: Option<&Vec<[f64; 2]>>) -> Result<Update> {
        check(scan.map_or(&[], Vec::as_slice))?;
        let predicted = self.particles.step(&mut belief.cloud, to, None)?;
        let Some(points) = scan else { return Ok(predicted) };
        if points.is_empty() {
            return Ok(Update { outcome: Outcome::Updated, ..predicted });
        }
        // What is taken in point by point cannot be taken back in another way.
        let before = (self.settings.reading == Reading::Sequential).then(|| belief.clone());
        let scans = belief.scans;
        if let Some((log_evidence, mut update)) = self.take(belief, points)? {
            update.not_finite = predicted.particles.map_or(0, |p| p.not_finite);
            return Ok(Update { outcome: Outcome::Updated, log_evidence, particles: Some(update) });
        }
        if let Some(before) = before {
            *belief = before;
        }
        belief.scans = scans;
        // Weights as they were, by a prediction over no time.
        let again = self.particles.step(&mut belief.cloud, to, None)?;
        Ok(Update { outcome: Outcome::Degenerate, log_evidence: f64::NEG_INFINITY, ..again })
    }
}
