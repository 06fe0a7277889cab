//! The grid (point mass) filter: Bayes' rule on a lattice that follows the law (Bucy and Senne, Automatica 7,
//! 1971; Simandl, Kralovec and Soderstrom, Automatica 42, 2006).

use super::{Filter, Outcome, Update};
use crate::belief::{Gaussian, GridBelief, Lattice, Workspace};
use crate::error::{Error, Result};
use crate::kernels::{self, Simd};
use crate::math::gaussian::LN_2PI;
use crate::math::{Cholesky, Matrix, Real, gamma};
use crate::model::{Likelihood, Motion, Noise, TransitionDensity};
use crate::rng::Stream;
use crate::time::Time;
use std::array::from_fn;
use std::ops::Range;

/// How far a normal law reaches, in standard deviations: beyond lies 2e-19 of it.
const REACH: f64 = 9.0;
/// What lies so far below the largest log-density is left out: the same, as a density.
const DEPTH: f64 = 0.5 * REACH * REACH;
/// Spacing of the lattice that pushed nodes are put on, in standard deviations of the noise.
const DEPOSIT: f64 = 0.5;
/// Spacing of the nodes in two and three dimensions, in standard deviations of the noise: a step may spread
/// them until they are 1 apart.
const FINE: f64 = 0.6;
/// Passes that look for the support, at most: each narrows it to a tenth where the likelihood is sharp.
const PASSES: usize = 12;

/// A filter on a lattice, for one, two or three components: the law itself up to the spacing of the nodes,
/// however the models bend it, and so the truth that other filters are compared with.
///
/// The motion must have a [`TransitionDensity`]. In one dimension the prediction is the direct sum of the
/// density over all pairs of nodes. In two and three the axes of the lattice are chosen such that the noise
/// is white and the prediction uncorrelated along them; the nodes are pushed through the motion and put on a
/// lattice of half a standard deviation of the noise with quadratic B-splines, which keep mass, mean and
/// covariance, and that is convolved axis by axis with the rest of the (normal) noise; the fourth cumulant of
/// the noise is off by 0.0016.
///
/// After each step the nodes are laid afresh over the support: coarse passes over the predicted law times the
/// likelihood narrow the box until it holds what lies within e^-40 of the largest density. A likelihood a
/// thousand times narrower than the prediction is no difficulty; one with several sharp modes far apart needs
/// more nodes, and [`GridBelief::effective_nodes`] tells. Where the nodes lie too far apart for the noise of
/// a step, they are interpolated (cubically) first.
#[derive(Clone, Debug)]
pub struct Grid<const N: usize, const W: usize, M, H> {
    prior: Gaussian<N>,
    motion: M,
    sensor: H,
    nodes: usize,
    simd: Simd,
}

impl<const N: usize, const W: usize, M, H> Grid<N, W, M, H>
where
    M: Motion<N, W>,
    H: Likelihood<N>,
{
    /// A filter with 500, 64 or 40 nodes along each axis in one, two or three dimensions.
    ///
    /// # Errors
    /// A state of other than one to three components; a prior whose covariance is singular.
    pub fn new(prior: Gaussian<N>, motion: M, sensor: H) -> Result<Self> {
        let nodes = match N {
            1 => 500,
            2 => 64,
            3 => 40,
            _ => return Err(Error::Unsupported(format!("a grid of {N} components: it has one to three"))),
        };
        Cholesky::of("covariance of the prior", prior.covariance())?;
        Ok(Grid { prior, motion, sensor, nodes, simd: Simd::best() })
    }

    /// The filter with this many nodes along each axis; more where the spread of the law over the noise asks
    /// for them.
    ///
    /// # Errors
    /// Fewer than 16 nodes or more than 2^20.
    pub fn with_nodes(self, nodes: usize) -> Result<Self> {
        if (16..=1 << 20).contains(&nodes) {
            return Ok(Grid { nodes, ..self });
        }
        let needs = "it must lie between 16 and 2^20";
        Err(Error::OutOfRange { what: "nodes along an axis of the grid", value: nodes as f64, needs })
    }

    /// The filter with these instructions; results do not depend on them.
    #[must_use]
    pub fn with_simd(self, simd: Simd) -> Self {
        Grid { simd, ..self }
    }
}

/// How the density before the measurement is had at the nodes of a lattice.
enum Prediction<A: Motion<N, W>, const N: usize, const W: usize> {
    /// Nothing moved: the belief, interpolated.
    Still(Lattice<N>),
    /// The direct sum over the pushed nodes, for one dimension.
    Direct(TransitionDensity<A, N, W>),
    /// The pushed nodes on a lattice, to be convolved.
    Convolved(Lattice<N>),
}

/// A box in the coordinates of a lattice.
#[derive(Clone, Copy)]
struct Support<const N: usize> {
    low: [f64; N],
    high: [f64; N],
}

/// What is known before the measurement: the density, the axes of its lattices and the box that holds it.
struct Ahead<A: Motion<N, W>, const N: usize, const W: usize> {
    prediction: Prediction<A, N, W>,
    axes: Matrix<N, N>,
    support: Support<N>,
}

/// A lattice, or a sum over it, that came out of a pass.
struct Pass {
    /// The largest log-density; -inf where there is none.
    most: f64,
    /// Likelihood evaluations.
    evaluations: usize,
}

impl<const N: usize, const W: usize, M, H> Filter for Grid<N, W, M, H>
where
    M: Motion<N, W>,
    H: Likelihood<N>,
{
    type Measurement = H::Value;
    type Belief = GridBelief<N>;

    fn start(&self, at: Time, _: Stream) -> Result<GridBelief<N>> {
        let factor = Cholesky::of("covariance of the prior", self.prior.covariance())?;
        let centre = factor.whiten(self.prior.mean());
        let (low, high) = (centre.map(|c| c - REACH), centre.map(|c| c + REACH));
        let lattice = Lattice::over(*factor.factor(), low, high, [self.nodes; N])?;
        let density = |index| {
            let u: [f64; N] =
                from_fn(|k| lattice.low[k] + lattice.spacing[k] * lattice.along(index, k) as f64 - centre[k]);
            Real::exp(-0.5 * u.iter().map(|u| u * u).sum::<f64>())
        };
        let mut masses: Vec<f64> = (0..lattice.len()).map(density).collect();
        normalise(&mut masses);
        Ok(GridBelief { time: at, lattice, masses, evaluations: 0, work: Workspace::default() })
    }

    fn step(&self, belief: &mut GridBelief<N>, to: Time, z: Option<&H::Value>) -> Result<Update> {
        if to < belief.time {
            return Err(Error::OutOfOrder { from: belief.time, to });
        }
        let digest = z.map(|z| self.sensor.digest(z, to)).transpose()?;
        if digest.is_none() && to == belief.time {
            return Ok(Update { outcome: Outcome::Predicted, log_evidence: 0.0, particles: None });
        }
        let mut work = std::mem::take(&mut belief.work);
        let done = self.advance(belief, to, digest.as_ref(), &mut work);
        belief.work = work;
        done
    }
}

impl<const N: usize, const W: usize, M, H> Grid<N, W, M, H>
where
    M: Motion<N, W>,
    H: Likelihood<N>,
{
    /// A step over time, with a measurement, or both.
    fn advance(
        &self,
        belief: &mut GridBelief<N>,
        to: Time,
        digest: Option<&H::Digest<'_>>,
        work: &mut Workspace<N>,
    ) -> Result<Update> {
        let ahead = if to > belief.time { self.predict(belief, to, work)? } else { still(belief, work) };
        let mut evaluations = 0;
        let mut lattice = self.settle(&ahead, digest, work, &mut evaluations, &belief.lattice)?;
        let mut outcome = if digest.is_some() { Outcome::Updated } else { Outcome::Predicted };
        if lattice.is_none() && digest.is_some() {
            outcome = Outcome::Degenerate;
            lattice = self.settle(&ahead, None, work, &mut 0, &belief.lattice)?;
        }
        let Some((lattice, most)) = lattice else {
            return Err(Error::Unsupported(
                "the grid lost the law: its density is zero everywhere".to_owned(),
            ));
        };
        let mut sum = 0.0;
        for score in &mut work.scores {
            *score = Real::exp(*score - most);
            sum += *score;
        }
        belief.masses.clear();
        belief.masses.extend(work.scores.iter().map(|mass| mass / sum));
        let cell: f64 = lattice.spacing.iter().map(|&h| Real::ln(h)).sum();
        (belief.time, belief.lattice, belief.evaluations) = (to, lattice, evaluations);
        let log_evidence = match outcome {
            Outcome::Updated => most + Real::ln(sum) + cell,
            Outcome::Degenerate => f64::NEG_INFINITY,
            _ => 0.0,
        };
        Ok(Update { outcome, log_evidence, particles: None })
    }

    /// Pushes the nodes through the motion, refined first where they would come to lie too far apart.
    fn predict(&self, belief: &GridBelief<N>, to: Time, work: &mut Workspace<N>) -> Result<Ahead<M, N, W>> {
        let density = TransitionDensity::over(&self.motion, belief.time, to, &belief.mean())?;
        let q = density.by_noise().congruence(&Matrix::identity());
        let factor = Cholesky::of("noise of the motion", &(q * density.noise().variance()))?;
        // The kink of a gamma density asks for nodes that are closer.
        let limit = match density.noise() {
            Noise::StandardNormal => 1.0,
            Noise::Gamma { .. } if N == 1 => 0.25,
            Noise::Gamma { .. } => {
                let why = "a grid of several dimensions holds for normal process noise only";
                return Err(Error::Unsupported(why.to_owned()));
            }
        };
        let mut lattice = belief.lattice.clone();
        work.masses.clone_from(&belief.masses);
        loop {
            lattice.columns(&mut work.nodes);
            work.centres.iter_mut().for_each(|c| c.resize(lattice.len(), 0.0));
            let nodes = work.nodes.each_ref().map(Vec::as_slice);
            let mut centres = work.centres.each_mut().map(Vec::as_mut_slice);
            kernels::centres(self.simd, &density, &nodes, &mut centres);
            for &c in centres.iter().flat_map(|c| c.iter()) {
                Error::finite("state that a node is led to", c)?;
            }
            let gaps = largest_gaps(&lattice, work, &factor);
            if gaps.iter().all(|&gap| gap <= limit) {
                break;
            }
            // 1.1: the gaps differ from place to place.
            let count = from_fn(|k| {
                let more = (1.1 * gaps[k] / limit).max(1.0);
                ((lattice.count[k] - 1) as f64 * more).ceil().min(1e9) as usize + 1
            });
            let high = from_fn(|k| lattice.low[k] + lattice.spacing[k] * (lattice.count[k] - 1) as f64);
            let fine = Lattice::over(lattice.axes, lattice.low, high, count)?;
            std::mem::swap(&mut work.source, &mut work.masses);
            spread(Kernel::Cubic, &lattice, &fine, work);
            work.spread.iter_mut().for_each(|m| *m = m.max(0.0));
            std::mem::swap(&mut work.masses, &mut work.spread);
            normalise(&mut work.masses);
            lattice = fine;
        }
        if N == 1 {
            let (low, high) = range(&work.centres[0]);
            let [below, above] = reach(density.noise(), density.by_noise())?;
            let support = Support { low: [low + below; N], high: [high + above; N] };
            return Ok(Ahead { prediction: Prediction::Direct(density), axes: Matrix::identity(), support });
        }
        let (axes, support) = self.turn(&factor, work);
        let low = support.low.map(|l| l - 2.0 * DEPOSIT);
        let count = from_fn(|k| ((support.high[k] - low[k]) / DEPOSIT).ceil().min(1e9) as usize + 3);
        let high = from_fn(|k| low[k] + DEPOSIT * (count[k] - 1) as f64);
        let deposit = Lattice { spacing: [DEPOSIT; N], ..Lattice::over(axes, low, high, count)? };
        put(&deposit, work);
        let support = Support { low: support.low.map(|l| l - REACH), high: support.high.map(|h| h + REACH) };
        Ok(Ahead { prediction: Prediction::Convolved(deposit), axes, support })
    }

    /// Axes along which the noise is white and the pushed nodes uncorrelated, and the box of the nodes, whose
    /// coordinates replace their states in `work.centres`.
    fn turn(&self, factor: &Cholesky<N>, work: &mut Workspace<N>) -> (Matrix<N, N>, Support<N>) {
        let mut mean = [0.0; N];
        for (i, &mass) in work.masses.iter().enumerate() {
            let v = factor.whiten(&from_fn(|k| work.centres[k][i]));
            for k in 0..N {
                work.centres[k][i] = v[k];
                mean[k] += mass * v[k];
            }
        }
        let mut covariance = Matrix::<N, N>::ZERO;
        for (i, &mass) in work.masses.iter().enumerate() {
            let d: [f64; N] = from_fn(|k| work.centres[k][i] - mean[k]);
            covariance = covariance + Matrix::outer(&d, &d) * mass;
        }
        let turn = eigenvectors(covariance);
        let back = turn.transpose();
        for i in 0..work.masses.len() {
            let u = back * from_fn(|k| work.centres[k][i]);
            for k in 0..N {
                work.centres[k][i] = u[k];
            }
        }
        let ranges = work.centres.each_ref().map(|c| range(c));
        (*factor.factor() * turn, Support { low: ranges.map(|r| r.0), high: ranges.map(|r| r.1) })
    }

    /// Finds the support, lays the nodes over it and leaves their log-densities in `work.scores`; `None`
    /// where the density is zero everywhere.
    fn settle(
        &self,
        ahead: &Ahead<M, N, W>,
        digest: Option<&H::Digest<'_>>,
        work: &mut Workspace<N>,
        evaluations: &mut usize,
        before: &Lattice<N>,
    ) -> Result<Option<(Lattice<N>, f64)>> {
        let &Ahead { ref prediction, ref axes, mut support } = ahead;
        let coarse = (self.nodes / if N == 1 { 4 } else { 2 }).max(16);
        for _ in 0..PASSES {
            let lattice = Lattice::over(*axes, support.low, support.high, [coarse; N])?;
            let pass = self.evaluate(prediction, &lattice, digest, work);
            *evaluations += pass.evaluations;
            if pass.most == f64::NEG_INFINITY {
                return Ok(None);
            }
            let kept = kept(&lattice, &work.scores, pass.most);
            let narrower = |k: usize| kept.high[k] - kept.low[k] < 0.6 * (support.high[k] - support.low[k]);
            let go_on = (0..N).any(narrower);
            support = kept;
            if !go_on {
                break;
            }
        }
        let wide = |k: usize| {
            support.high[k] - support.low[k] > 0.5 * before.spacing[k] * (before.count[k] - 1) as f64
        };
        if matches!(prediction, Prediction::Still(_)) && (0..N).all(wide) {
            // The nodes serve as they are: nothing is lost by interpolation.
            let pass = self.evaluate(prediction, before, digest, work);
            *evaluations += pass.evaluations;
            return Ok((pass.most > f64::NEG_INFINITY).then(|| (before.clone(), pass.most)));
        }
        let count = from_fn(|k| {
            let spacing = match prediction {
                Prediction::Still(_) => before.spacing[k],
                Prediction::Direct(_) => return self.nodes,
                Prediction::Convolved(_) => FINE,
            };
            let least = ((support.high[k] - support.low[k]) / spacing).ceil().min(1e9) as usize + 1;
            self.nodes.max(least)
        });
        let lattice = Lattice::over(*axes, support.low, support.high, count)?;
        let pass = self.evaluate(prediction, &lattice, digest, work);
        *evaluations += pass.evaluations;
        Ok((pass.most > f64::NEG_INFINITY).then_some((lattice, pass.most)))
    }

    /// Fills `work.scores` with the log-density of the prediction times the likelihood at the nodes of
    /// `lattice`.
    fn evaluate(
        &self,
        prediction: &Prediction<M, N, W>,
        lattice: &Lattice<N>,
        digest: Option<&H::Digest<'_>>,
        work: &mut Workspace<N>,
    ) -> Pass {
        lattice.columns(&mut work.nodes);
        match prediction {
            Prediction::Direct(density) => {
                work.spread.resize(lattice.len(), 0.0);
                let targets = work.nodes.each_ref().map(Vec::as_slice);
                let centres = work.centres.each_ref().map(Vec::as_slice);
                let sources = (&centres, work.masses.as_slice());
                kernels::predict_density(self.simd, density, &targets, sources, &mut work.spread);
            }
            Prediction::Still(own) => spread(Kernel::Cubic, own, lattice, work),
            Prediction::Convolved(deposit) => spread(Kernel::Normal, deposit, lattice, work),
        }
        work.scores.resize(lattice.len(), 0.0);
        let evaluations = match digest {
            Some(digest) => {
                let nodes = work.nodes.each_ref().map(Vec::as_slice);
                H::score(digest, self.simd, &nodes, &mut work.scores);
                lattice.len()
            }
            None => {
                work.scores.fill(0.0);
                0
            }
        };
        let mut most = f64::NEG_INFINITY;
        for (score, &density) in work.scores.iter_mut().zip(&work.spread) {
            // A likelihood that is no number, or infinite, tells nothing of its node: as in the particle
            // filter.
            let usable = score.is_finite() && density > 0.0;
            *score = if usable { *score + Real::ln(density) } else { f64::NEG_INFINITY };
            most = most.max(*score);
        }
        Pass { most, evaluations }
    }
}

/// The prediction over no time: the belief itself.
fn still<A: Motion<N, W>, const N: usize, const W: usize>(
    belief: &GridBelief<N>,
    work: &mut Workspace<N>,
) -> Ahead<A, N, W> {
    let lattice = &belief.lattice;
    let cell: f64 = lattice.spacing.iter().product();
    work.source.clear();
    work.source.extend(belief.masses.iter().map(|mass| mass / cell));
    let high = from_fn(|k| lattice.low[k] + lattice.spacing[k] * (lattice.count[k] - 1) as f64);
    let support = Support { low: lattice.low, high };
    Ahead { prediction: Prediction::Still(lattice.clone()), axes: lattice.axes, support }
}

/// How far neighbours along each axis are led apart, in standard deviations of the noise; nodes that hold
/// next to nothing do not count.
fn largest_gaps<const N: usize>(lattice: &Lattice<N>, work: &Workspace<N>, factor: &Cholesky<N>) -> [f64; N] {
    let least = 1e-9 * work.masses.iter().copied().fold(0.0, f64::max);
    from_fn(|k| {
        let stride = lattice.stride(k);
        let mut largest = 0.0f64;
        for i in 0..lattice.len() {
            if lattice.along(i, k) + 1 < lattice.count[k]
                && work.masses[i].max(work.masses[i + stride]) > least
            {
                let apart = from_fn(|c| work.centres[c][i + stride] - work.centres[c][i]);
                largest = largest.max(factor.mahalanobis_squared(&apart));
            }
        }
        largest.sqrt()
    })
}

/// How far the noise of one dimension carries below and above its centre: all but 2e-19 of it, a gamma law's
/// lower end exactly.
fn reach<const N: usize, const W: usize>(noise: Noise, by_noise: &Matrix<N, W>) -> Result<[f64; 2]> {
    let sd = by_noise.0.iter().flatten().map(|g| g * g).sum::<f64>().sqrt();
    let Noise::Gamma { shape } = noise else { return Ok([-REACH * sd, REACH * sd]) };
    let mut high = shape + 1.0;
    while gamma::regularised(shape, high)?.1 > 2e-19 {
        high += 1.0 + 0.1 * high;
    }
    // With as many components of noise as of the state there is one.
    let g = by_noise.0[0][0];
    let (at_zero, far) = (-shape * g, (high - shape) * g);
    Ok([at_zero.min(far), at_zero.max(far)])
}

fn range(column: &[f64]) -> (f64, f64) {
    column.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| (low.min(x), high.max(x)))
}

fn normalise(masses: &mut [f64]) {
    let sum: f64 = masses.iter().sum();
    masses.iter_mut().for_each(|mass| *mass /= sum);
}

/// The box, one node wider on each side, of the nodes beside which the log-density may come within [`DEPTH`]
/// of the largest: between nodes it may be higher by about as much as it differs between neighbours.
fn kept<const N: usize>(lattice: &Lattice<N>, scores: &[f64], most: f64) -> Support<N> {
    let (mut first, mut last) = (lattice.count, [0; N]);
    for (i, &score) in scores.iter().enumerate() {
        if score == f64::NEG_INFINITY {
            continue;
        }
        let mut slack = 0.0f64;
        for k in 0..N {
            let (at, stride) = (lattice.along(i, k), lattice.stride(k));
            let down = (at > 0).then(|| scores[i - stride]);
            let up = (at + 1 < lattice.count[k]).then(|| scores[i + stride]);
            for beside in [down, up].into_iter().flatten().filter(|s| s.is_finite()) {
                slack = slack.max((beside - score).abs());
            }
        }
        if score + slack >= most - DEPTH {
            for k in 0..N {
                let at = lattice.along(i, k);
                first[k] = first[k].min(at);
                last[k] = last[k].max(at);
            }
        }
    }
    let at = |k: usize, i: usize| lattice.low[k] + lattice.spacing[k] * i as f64;
    Support {
        low: from_fn(|k| at(k, first[k].saturating_sub(1))),
        high: from_fn(|k| at(k, (last[k] + 1).min(lattice.count[k] - 1))),
    }
}

/// Puts the pushed nodes, whose coordinates stand in `work.centres`, on the nodes of `deposit` with quadratic
/// B-splines.
fn put<const N: usize>(deposit: &Lattice<N>, work: &mut Workspace<N>) {
    work.source.clear();
    work.source.resize(deposit.len(), 0.0);
    let stride: [usize; N] = from_fn(|k| deposit.stride(k));
    for (i, &mass) in work.masses.iter().enumerate() {
        let mut corner = 0;
        let mut weights = [[0.0; 3]; N];
        for k in 0..N {
            let t = (work.centres[k][i] - deposit.low[k]) / deposit.spacing[k];
            let nearest = (t + 0.5).floor();
            let d = t - nearest;
            weights[k] = [0.5 * (0.5 - d) * (0.5 - d), 0.75 - d * d, 0.5 * (0.5 + d) * (0.5 + d)];
            corner += (nearest as usize - 1) * stride[k];
        }
        for part in 0..3usize.pow(N as u32) {
            let (mut index, mut share, mut rest) = (corner, mass, part);
            for k in 0..N {
                index += rest % 3 * stride[k];
                share *= weights[k][rest % 3];
                rest /= 3;
            }
            work.source[index] += share;
        }
    }
}

/// What carries numbers from the nodes of one lattice to those of another along one axis.
#[derive(Clone, Copy)]
enum Kernel {
    /// Cubic interpolation (Lagrange) between the four nodes around; nothing outside.
    Cubic,
    /// The normal density of the noise less what the B-splines hold of its variance.
    Normal,
}

impl Kernel {
    /// The sources of a target at `at`, counted in nodes of `spacing` of an axis of `count`, and their
    /// weights.
    fn taps(self, at: f64, spacing: f64, count: usize, out: &mut Vec<(usize, f64)>) {
        let end = (count - 1) as f64;
        let clip =
            |range: Range<f64>| range.start.max(0.0) as usize..(range.end.min(end) + 1.0).max(0.0) as usize;
        match self {
            Kernel::Cubic => {
                // A rounding beyond the last node is none.
                if !(-1e-9..=end + 1e-9).contains(&at) {
                    return;
                }
                let middle = at.floor().clamp(1.0, end - 2.0);
                let f = at - middle;
                let first = middle as usize - 1;
                let weights = [
                    -f * (f - 1.0) * (f - 2.0) / 6.0,
                    (f + 1.0) * (f - 1.0) * (f - 2.0) / 2.0,
                    -(f + 1.0) * f * (f - 2.0) / 2.0,
                    (f + 1.0) * f * (f - 1.0) / 6.0,
                ];
                out.extend(weights.into_iter().enumerate().map(|(i, w)| (first + i, w)));
            }
            Kernel::Normal => {
                let variance = 1.0 - 0.25 * spacing * spacing;
                let constant = -0.5 * (LN_2PI + Real::ln(variance));
                let reach = REACH / spacing;
                for i in clip((at - reach).ceil()..(at + reach).floor()) {
                    let d = (at - i as f64) * spacing;
                    out.push((i, Real::exp(constant - 0.5 * d * d / variance)));
                }
            }
        }
    }
}

/// Carries `work.source`, numbers at the nodes of `from`, to the nodes of `to` (of the same axes) in
/// `work.spread`, axis by axis.
fn spread<const N: usize>(kernel: Kernel, from: &Lattice<N>, to: &Lattice<N>, work: &mut Workspace<N>) {
    work.spread.clone_from(&work.source);
    for k in 0..N {
        work.taps.clear();
        work.tap_ends.clear();
        for t in 0..to.count[k] {
            let at = (to.low[k] + to.spacing[k] * t as f64 - from.low[k]) / from.spacing[k];
            kernel.taps(at, from.spacing[k], from.count[k], &mut work.taps);
            work.tap_ends.push(work.taps.len());
        }
        let outer: usize = to.count[..k].iter().product();
        let inner = from.stride(k);
        let (sources, targets) = (from.count[k] * inner, to.count[k] * inner);
        work.half.clear();
        work.half.resize(outer * targets, 0.0);
        for o in 0..outer {
            let source = &work.spread[o * sources..(o + 1) * sources];
            let target = &mut work.half[o * targets..(o + 1) * targets];
            let mut first = 0;
            for (row, &end) in target.chunks_exact_mut(inner).zip(&work.tap_ends) {
                for &(s, weight) in &work.taps[first..end] {
                    for (t, s) in row.iter_mut().zip(&source[s * inner..(s + 1) * inner]) {
                        *t += weight * s;
                    }
                }
                first = end;
            }
        }
        std::mem::swap(&mut work.half, &mut work.spread);
    }
}

/// Eigenvectors of a symmetric matrix in columns, by Jacobi's rotations.
fn eigenvectors<const N: usize>(mut a: Matrix<N, N>) -> Matrix<N, N> {
    let mut vectors = Matrix::identity();
    // Convergence is quadratic: three components are diagonal to rounding after five or six rounds.
    for _ in 0..10 {
        for p in 0..N {
            for q in p + 1..N {
                if a.0[p][q] == 0.0 {
                    continue;
                }
                let theta = (a.0[q][q] - a.0[p][p]) / (2.0 * a.0[p][q]);
                let t = 1.0f64.copysign(theta) / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                let mut turn = Matrix::identity();
                (turn.0[p][p], turn.0[q][q], turn.0[p][q], turn.0[q][p]) = (c, c, s, -s);
                a = turn.transpose().congruence(&a);
                vectors = vectors * turn;
            }
        }
    }
    vectors
}
