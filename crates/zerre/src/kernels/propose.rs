//! Moving particles by noise that is drawn with the measurement in view.

use super::noise::NoiseBlock;
use super::propagate::{load_part, noise_lanes, store_part};
use super::{LANES, Simd};
use crate::math::{Float, Lanes};
use fearless_simd::Simd as Token;

/// What proposes the noise of a particle.
pub(crate) trait Propose<const N: usize, const W: usize>: Sync {
    /// From a state x, standard normal numbers, noise of the motion's own law and whether that is to be taken
    /// (1 or 0): the state that x becomes, ln p(w) / q(w | x), and how often the proposal was improved.
    fn propose<R: Float>(&self, x: [R; N], normal: [R; W], own: [R; W], takes_own: R) -> ([R; N], R, R);
}

/// Moves the particles of a block in place. `ratios` holds, for every particle, whether it takes its `own`
/// noise (which is `normal` where there is none), and receives ln p / q. Returns how often proposals were
/// improved, in all.
pub(crate) fn propose<const N: usize, const W: usize, P: Propose<N, W>>(
    level: Simd,
    proposal: &P,
    normal: &NoiseBlock<W>,
    own: Option<&NoiseBlock<W>>,
    states: &mut [&mut [f64]; N],
    ratios: &mut [f64],
) -> usize {
    #[inline(always)]
    fn run<const N: usize, const W: usize, P: Propose<N, W>, S: Token>(
        simd: S,
        proposal: &P,
        normal: &NoiseBlock<W>,
        own: Option<&NoiseBlock<W>>,
        states: &mut [&mut [f64]; N],
        ratios: &mut [f64],
    ) -> usize {
        let count = ratios.len();
        assert!(states.iter().all(|c| c.len() == count));
        assert!(count <= normal.width && own.is_none_or(|own| count <= own.width));
        let mut improvements = 0.0;
        let mut x = [Lanes::splat(simd, 0.0); N];
        for i in (0..count).step_by(LANES) {
            let part = i..count.min(i + LANES);
            for k in 0..N {
                x[k] = load(simd, &states[k][part.clone()]);
            }
            let drawn = noise_lanes(simd, normal, i);
            let plain = own.map_or(drawn, |own| noise_lanes(simd, own, i));
            let takes_own = load(simd, &ratios[part.clone()]);
            let (y, ratio, improved) = proposal.propose(x, drawn, plain, takes_own);
            for k in 0..N {
                store(y[k], &mut states[k][part.clone()]);
            }
            store(ratio, &mut ratios[part.clone()]);
            let mut each = [0.0; LANES];
            improved.store(&mut each);
            // Whole numbers: the order of the sum changes no bit.
            improvements += each[..part.len()].iter().sum::<f64>();
        }
        improvements as usize
    }
    fn naive<const N: usize, const W: usize, P: Propose<N, W>>(
        proposal: &P,
        normal: &NoiseBlock<W>,
        own: Option<&NoiseBlock<W>>,
        states: &mut [&mut [f64]; N],
        ratios: &mut [f64],
    ) -> usize {
        let mut improvements = 0.0;
        for i in 0..ratios.len() {
            let x = std::array::from_fn(|k| states[k][i]);
            let drawn = std::array::from_fn(|k| normal.number(k, i));
            let plain = own.map_or(drawn, |own| std::array::from_fn(|k| own.number(k, i)));
            let (y, ratio, improved): ([f64; N], f64, f64) = proposal.propose(x, drawn, plain, ratios[i]);
            for k in 0..N {
                states[k][i] = y[k];
            }
            ratios[i] = ratio;
            improvements += improved;
        }
        improvements as usize
    }
    dispatch!(
        level,
        simd => run(simd, proposal, normal, own, states, ratios),
        naive => naive(proposal, normal, own, states, ratios)
    )
}

/// Eight numbers, or what there is of them.
#[inline(always)]
fn load<S: Token>(simd: S, from: &[f64]) -> Lanes<S> {
    if from.len() == LANES { Lanes::load(simd, from) } else { load_part(simd, from) }
}

#[inline(always)]
fn store<S: Token>(value: Lanes<S>, to: &mut [f64]) {
    if to.len() == LANES { value.store(to) } else { store_part(value, to) }
}
