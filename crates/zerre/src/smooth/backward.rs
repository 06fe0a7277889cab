//! Forward filtering, backward simulation (Godsill, Doucet and West, Journal of the American Statistical
//! Association 99, 2004).

use super::history::{History, Record, Smoothed};
use crate::error::{Error, Result};
use crate::kernels::{self, Simd, Threads};
use crate::math::Real;
use crate::model::{Motion, TransitionDensity};
use crate::rng::{Draws, Purpose, Stream};
use crate::time::Time;
use std::array::from_fn;
use std::ops::Range;

/// How the particle before a given state is drawn: with probability proportional to w_i p(x_{k+1} | x_k^i).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Backward {
    /// Exactly, by proposals from the weights that are accepted with p / sup p (Douc, Garivier, Moulines and
    /// Olsson, Annals of Applied Probability 21, 2011), and after this many refusals by the sum over all
    /// particles (Taghavi, Lindsten, Svensson and Schon 2013). Steps where few draws end by a proposal go to
    /// the sum at once.
    Rejection {
        /// Proposals before the sum.
        tries: u32,
    },
    /// From the particle that the filter took it from, by this many moves of a Markov chain with proposals
    /// from the weights (Bunch and Godsill, IEEE Transactions on Signal Processing 61, 2013): the cost does
    /// not depend on the number of particles. Too few moves beside what a proposal needs to be accepted, and
    /// the paths stay close to the filter's own, which are few.
    Moves {
        /// Number of moves.
        count: u32,
    },
}

impl Default for Backward {
    fn default() -> Self {
        Backward::Rejection { tries: 16 }
    }
}

/// Paths drawn from the law of all states given all measurements; each is as likely as any other.
#[derive(Clone, Debug, PartialEq)]
pub struct Paths<const N: usize> {
    times: Vec<Time>,
    count: usize,
    /// Path after path, instant after instant: `[k * count + j]`.
    particles: Vec<u32>,
    states: [Vec<f64>; N],
}

impl<const N: usize> Paths<N> {
    /// Number of instants.
    pub fn len(&self) -> usize {
        self.times.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.times.is_empty()
    }

    /// Number of paths.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The instants.
    pub fn times(&self) -> &[Time] {
        &self.times
    }

    /// State of path `j` at instant `k`; `None` beyond the last of either.
    pub fn state(&self, k: usize, j: usize) -> Option<[f64; N]> {
        (k < self.len() && j < self.count).then(|| from_fn(|c| self.states[c][k * self.count + j]))
    }

    /// Which particles of record `k` the paths pass; empty beyond the last record.
    pub fn particles(&self, k: usize) -> &[u32] {
        self.particles.chunks_exact(self.count).nth(k).unwrap_or_default()
    }

    /// The states of all paths at instant `k`.
    pub fn at(&self, k: usize) -> Option<Smoothed<N>> {
        let range = k * self.count..(k + 1) * self.count;
        Some(Smoothed {
            time: *self.times.get(k)?,
            states: self.states.each_ref().map(|column| column[range.clone()].to_vec()),
            weights: vec![1.0 / self.count as f64; self.count],
        })
    }
}

/// `count` paths through the recorded particles, drawn backwards in time; the number of threads changes nothing.
///
/// # Errors
/// An empty history, no paths or more than 2^26; a motion without [`TransitionDensity`]; a state that no
/// particle before it leads to (the history is of another motion); by moves, and where no time passes, a
/// filter that does not say whom its particles come from.
pub fn backward_paths<A, const N: usize, const W: usize>(
    motion: &A,
    history: &History<N>,
    count: usize,
    how: Backward,
    stream: Stream,
    threads: &Threads,
) -> Result<Paths<N>>
where
    A: Motion<N, W>,
{
    if count == 0 || count > crate::belief::MAX_PARTICLES {
        let needs = "it must lie between 1 and 2^26";
        return Err(Error::OutOfRange { what: "number of paths", value: count as f64, needs });
    }
    let walk = Walk { motion, history, how, stream };
    let mut bundles: Vec<_> = (0..count)
        .step_by(BUNDLE)
        .map(|first| (first..count.min(first + BUNDLE), Ok((Vec::new(), from_fn(|_| Vec::new())))))
        .collect();
    threads.share(&mut bundles, |_, (paths, drawn)| *drawn = walk.draw(paths.clone()));
    let times = (0..history.len()).map(|k| Ok(history.get(k)?.time)).collect::<Result<Vec<Time>>>()?;
    let mut particles = Vec::with_capacity(times.len() * count);
    let mut states: [Vec<f64>; N] = from_fn(|_| Vec::with_capacity(times.len() * count));
    let drawn = bundles.into_iter().map(|(paths, drawn)| Ok((paths.len(), drawn?)));
    let drawn = drawn.collect::<Result<Vec<_>>>()?;
    for k in 0..times.len() {
        for (width, (bundle, columns)) in &drawn {
            let part = k * width..(k + 1) * width;
            particles.extend_from_slice(&bundle[part.clone()]);
            for (column, from) in states.iter_mut().zip(columns) {
                column.extend_from_slice(&from[part.clone()]);
            }
        }
    }
    Ok(Paths { times, count, particles, states })
}

/// Paths that are drawn together: many enough to share what one step back needs, few enough to be spread over
/// threads. Which draws go to the sum at once is decided within a bundle, so that its size is part of the result.
const BUNDLE: usize = 64;

/// How paths are drawn.
struct Walk<'a, A, const N: usize> {
    motion: &'a A,
    history: &'a History<N>,
    how: Backward,
    stream: Stream,
}

impl<A, const N: usize> Walk<'_, A, N> {
    /// The particles of these paths and their states, instant after instant.
    fn draw<const W: usize>(&self, paths: Range<usize>) -> Result<(Vec<u32>, [Vec<f64>; N])>
    where
        A: Motion<N, W>,
    {
        let (instants, count) = (self.history.len(), paths.len());
        let mut particles = vec![0u32; instants * count];
        let mut states: [Vec<f64>; N] = from_fn(|_| vec![0.0; instants * count]);
        let mut tables = Tables::default();
        let mut next = self.history.get(instants.saturating_sub(1))?.time;
        for k in (0..instants).rev() {
            let record = self.history.get(k)?;
            let (now, after) = particles[k * count..].split_at_mut(count);
            let density = if k + 1 == instants {
                tables.choose_from(record);
                None
            } else {
                tables.prepare(self.motion, record, next)?
            };
            next = record.time;
            for (j, particle) in now.iter_mut().enumerate() {
                let mut draws = self.stream.draws(Purpose::Path, k as u64, (paths.start + j) as u32);
                let at = match (after.get(j), &density) {
                    (None, _) => tables.pick(draws.uniform()),
                    // Nothing moved in between.
                    (Some(&next), None) => record.parent(next as usize),
                    (Some(&next), Some(density)) => {
                        let to = from_fn(|c| states[c][(k + 1) * count + j]);
                        let parent = record.parent(next as usize);
                        tables.draw(density, record, to, parent, self.how, &mut draws)?
                    }
                };
                *particle = at as u32;
                for (column, from) in states.iter_mut().zip(&record.states) {
                    column[k * count + j] = from[at];
                }
            }
        }
        Ok((particles, states))
    }
}

/// What is the same for all draws of one step back.
#[derive(Clone, Debug)]
pub(super) struct Tables<const N: usize> {
    simd: Simd,
    guide: Guide,
    centres: [Vec<f64>; N],
    row: Vec<f64>,
    /// Sums of the chunks of `row`.
    chunks: Vec<f64>,
    /// Draws of this step that tried proposals, and those that ended by one.
    tried: u32,
    ended: u32,
}

/// Numbers that are summed at once.
const CHUNK: usize = 64;

impl<const N: usize> Default for Tables<N> {
    fn default() -> Self {
        Tables {
            simd: Simd::best(),
            guide: Guide::default(),
            centres: from_fn(|_| Vec::new()),
            row: Vec::new(),
            chunks: Vec::new(),
            tried: 0,
            ended: 0,
        }
    }
}

impl<const N: usize> Tables<N> {
    /// Prepares the step from `record` to `to`; `None` where no time passes.
    pub(super) fn prepare<A: Motion<N, W>, const W: usize>(
        &mut self,
        motion: &A,
        record: &Record<N>,
        to: Time,
    ) -> Result<Option<TransitionDensity<A, N, W>>> {
        if to == record.time {
            record.has_children()?;
            return Ok(None);
        }
        let density = TransitionDensity::over(motion, record.time, to, &record.mean())?;
        let n = record.weights.len();
        (self.tried, self.ended) = (0, 0);
        self.row.resize(n, 0.0);
        self.centres.iter_mut().for_each(|c| c.resize(n, 0.0));
        let states = record.states.each_ref().map(Vec::as_slice);
        kernels::centres(self.simd, &density, &states, &mut self.centres.each_mut().map(Vec::as_mut_slice));
        self.guide.fill(&record.weights);
        Ok(Some(density))
    }

    /// Prepares [`Tables::pick`] for the weights of `record`.
    pub(super) fn choose_from(&mut self, record: &Record<N>) {
        self.guide.fill(&record.weights);
    }

    /// The particle that a uniform number chooses by weight, of the record that was prepared.
    pub(super) fn pick(&self, uniform: f64) -> usize {
        self.guide.pick(uniform)
    }

    /// Draws the particle of `record` that a path passes before `to`; `parent` is the one that the filter led
    /// there.
    pub(super) fn draw<A: Motion<N, W>, const W: usize>(
        &mut self,
        density: &TransitionDensity<A, N, W>,
        record: &Record<N>,
        to: [f64; N],
        parent: usize,
        how: Backward,
        draws: &mut Draws,
    ) -> Result<usize> {
        let log_density = |i: usize| density.log_residual(from_fn(|k| to[k] - self.centres[k][i]));
        let bound = density.log_bound();
        match how {
            Backward::Rejection { tries } => {
                // A density without a bound has no rejection.
                if bound < f64::INFINITY && (self.tried < 32 || 4 * self.ended > self.tried) {
                    self.tried += 1;
                    for _ in 0..tries {
                        let i = self.guide.pick(draws.uniform());
                        if Real::ln(draws.uniform()) < log_density(i) - bound {
                            self.ended += 1;
                            return Ok(i);
                        }
                    }
                }
                self.sum(density, record, to, draws)
            }
            Backward::Moves { count } => {
                record.has_children()?;
                let mut at = (parent, log_density(parent));
                for _ in 0..count {
                    let i = self.guide.pick(draws.uniform());
                    let log = log_density(i);
                    if Real::ln(draws.uniform()) < log - at.1 {
                        at = (i, log);
                    }
                }
                Ok(at.0)
            }
        }
    }

    /// Draws by the sum over all particles.
    fn sum<A: Motion<N, W>, const W: usize>(
        &mut self,
        density: &TransitionDensity<A, N, W>,
        record: &Record<N>,
        to: [f64; N],
        draws: &mut Draws,
    ) -> Result<usize> {
        let bound = density.log_bound();
        let offset = if bound < f64::INFINITY { bound } else { 0.0 };
        let centres = self.centres.each_ref().map(Vec::as_slice);
        let weights = record.weights.as_slice();
        kernels::transition_row(self.simd, density, to, (&centres, weights), offset, &mut self.row);
        let mut total = self.sum_chunks();
        if !(total > f64::MIN_POSITIVE && total < f64::INFINITY) {
            // Out of the range of numbers: relative to the largest.
            let log = |i: usize| {
                Real::ln(weights[i]) + density.log_residual(from_fn(|k| to[k] - self.centres[k][i]))
            };
            let largest = (0..weights.len()).map(log).fold(f64::NEG_INFINITY, f64::max);
            for i in 0..weights.len() {
                self.row[i] = Real::exp(log(i) - largest);
            }
            total = self.sum_chunks();
        }
        if !total.is_finite() {
            let at = record.time;
            let why =
                format!("no particle at {at} s leads to a state recorded after it: another motion made it");
            return Err(Error::Unsupported(why));
        }
        let target = draws.uniform() * total;
        let (mut sum, mut chunk) = (0.0, 0);
        while chunk + 1 < self.chunks.len() && sum + self.chunks[chunk] <= target {
            sum += self.chunks[chunk];
            chunk += 1;
        }
        // Sums in another order may differ by a rounding: the last that has a weight, then.
        let mut last = 0;
        for (i, &weight) in self.row.iter().enumerate().skip(chunk * CHUNK).filter(|(_, w)| **w > 0.0) {
            (sum, last) = (sum + weight, i);
            if sum > target {
                break;
            }
        }
        Ok(last)
    }

    /// The sum of `row`, and those of its chunks.
    fn sum_chunks(&mut self) -> f64 {
        self.chunks.clear();
        self.chunks.extend(self.row.chunks(CHUNK).map(|chunk| {
            let (eights, rest) = chunk.as_chunks::<8>();
            let mut sums = [0.0; 8];
            for eight in eights {
                for (sum, x) in sums.iter_mut().zip(eight) {
                    *sum += x;
                }
            }
            sums.iter().chain(rest).sum::<f64>()
        }));
        self.chunks.iter().sum()
    }
}

/// Draws indices by weight in constant time on average: a table of where to begin looking in the cumulative
/// sums (Chen and Asau 1974).
#[derive(Clone, Debug, Default)]
struct Guide {
    cumulative: Vec<f64>,
    begin: Vec<u32>,
}

impl Guide {
    /// For these weights, which sum to something above zero.
    fn fill(&mut self, weights: &[f64]) {
        let n = weights.len();
        let mut sum = 0.0;
        self.cumulative.clear();
        self.cumulative.extend(weights.iter().map(|w| {
            sum += w;
            sum
        }));
        let last = weights.iter().rposition(|&w| w > 0.0).unwrap_or(0);
        self.cumulative.iter_mut().for_each(|c| *c /= sum);
        // Rounding must leave no gap below 1, nor fill one with a weight of zero.
        self.cumulative[last..].fill(1.0);
        self.begin.clear();
        let mut i = 0u32;
        for cell in 0..n {
            while self.cumulative[i as usize] <= cell as f64 / n as f64 {
                i += 1;
            }
            self.begin.push(i);
        }
    }

    /// The index of a uniform number in (0, 1).
    fn pick(&self, uniform: f64) -> usize {
        let mut i = self.begin[(uniform * self.begin.len() as f64) as usize] as usize;
        while self.cumulative[i] <= uniform {
            i += 1;
        }
        i
    }
}
