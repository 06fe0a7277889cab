//! The first stage of the auxiliary particle filter.

use crate::belief::{Cloud, Lineage};
use crate::filter::particle::ParticleFilter;
use crate::filter::rejuvenation::gather;
use crate::filter::settings::{Prior, Settings};
use crate::filter::size::Goal;
use crate::kernels::{self, BLOCK, BlockSums, NoiseBlock, Source};
use crate::model::{Likelihood, Motion};
use crate::proposal::Proposal;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Expected log-likelihoods count as no less than this beside the largest: what they are divided out of stays
/// bounded.
const LEAST_EXPECTED: f64 = -14.0;

impl<const N: usize, const W: usize, M, H, P, Q> ParticleFilter<N, W, M, H, P, Q>
where
    M: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
    Q: Proposal<N, W, M, H>,
{
    /// Resamples by what the measurement is expected to say; does not where it says nothing of anybody. The
    /// log-weights of before are kept. Returns how many have descendants, and how often the measurement was
    /// evaluated.
    pub(super) fn look_ahead(
        &self,
        cloud: &mut Cloud<N>,
        (exponent, goal): (f64, &Goal<'_>),
        (step, digest, guide): (&M::Step, &H::Digest<'_>, Option<&Q::Given<'_>>),
    ) -> (Option<usize>, usize) {
        let Settings { simd, ref threads, .. } = *self.settings();
        if cloud.pending {
            gather(simd, cloud);
        }
        let n = cloud.len();
        cloud.kept.resize(n, 0.0);
        cloud.spare.iter_mut().for_each(|column| column.resize(n, 0.0));
        let mean = self.motion().noise().mean();
        let from = cloud.states.each_ref().map(Vec::as_slice);
        let log_weights = (!cloud.equal).then_some(&cloud.log_weights);
        let evaluations = AtomicUsize::new(n);
        // Where each particle goes by the mean of its proposal, and what is seen there.
        threads.for_each_block(
            cloud.spare.each_mut().map(Vec::as_mut_slice),
            [&mut cloud.scores, &mut cloud.kept],
            &mut cloud.blocks,
            |b, mut states, [scores, ratios], sums| {
                let first = b * BLOCK;
                let here = Source::Columns(from.map(|c| &c[first..first + scores.len()]));
                let mut noise = NoiseBlock::<W>::new();
                ratios.fill(0.0);
                if let Some(guide) = guide {
                    kernels::gather(here, &mut states);
                    noise.fill(scores.len(), 0.0);
                    let made = Q::propose(guide, simd, (&noise, None), &mut states, ratios);
                    evaluations.fetch_add(made, Ordering::Relaxed);
                } else {
                    noise.fill(scores.len(), mean);
                    kernels::propagate::<N, W, M>(simd, step, &noise, here, &mut states);
                }
                H::score(digest, simd, &states.each_ref().map(|c| &**c), scores);
                let mut max = f64::NEG_INFINITY;
                for (i, (expected, score)) in ratios.iter_mut().zip(scores).enumerate() {
                    *expected += *score;
                    let has_weight = log_weights.is_none_or(|l| l[first + i] != f64::NEG_INFINITY);
                    if has_weight && *expected > max && *expected < f64::INFINITY {
                        max = *expected;
                    }
                }
                *sums = BlockSums { max, ..BlockSums::default() };
            },
        );
        let evaluations = evaluations.into_inner();
        let max = cloud.total().max;
        if max == f64::NEG_INFINITY {
            return (None, evaluations);
        }
        threads.for_each_block(
            cloud.states.each_mut().map(Vec::as_mut_slice),
            [&mut cloud.scores, &mut cloud.weights, &mut cloud.kept],
            &mut cloud.blocks,
            |b, states, [scores, weights, expected], sums| {
                for (score, expected) in scores.iter_mut().zip(expected) {
                    // Written so that a NaN becomes the least.
                    let beside = *expected - max;
                    let beside = if beside > LEAST_EXPECTED { beside.min(0.0) } else { LEAST_EXPECTED };
                    *expected = exponent * beside;
                    *score = *expected;
                }
                let log_weights = log_weights.map(|l| &l[b * BLOCK..b * BLOCK + scores.len()]);
                *sums = kernels::weigh(simd, log_weights, scores, &states.each_ref().map(|c| &**c), weights);
            },
        );
        let total = cloud.total();
        if !(total.sum.is_finite() && total.sum > 0.0) {
            return (None, evaluations);
        }
        let before = cloud.log_sum;
        let distinct_ancestors = self.resample(cloud, &total, goal);
        cloud.scores.resize(cloud.ancestors.len(), 0.0);
        for (score, &ancestor) in cloud.scores.iter_mut().zip(&cloud.ancestors) {
            *score = -cloud.kept[ancestor as usize];
        }
        std::mem::swap(&mut cloud.kept, &mut cloud.log_weights);
        std::mem::swap(&mut cloud.log_weights, &mut cloud.scores);
        (cloud.equal, cloud.lineage) = (false, Lineage::Ancestors);
        cloud.log_sum -= total.log_sum() - before;
        (Some(distinct_ancestors), evaluations)
    }
}
