//! Whether the object can be seen: a Markov chain between *seen* and *lost*, filtered along by what the responses are like.

use serde::{Deserialize, Serialize};
use zerre::math::Real;

/// What the responses over a window are like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Signs {
    /// Peak of the filter that follows the object, as a share of what it was trained with.
    pub followed: f64,
    /// Peak of the first frame's filter, likewise.
    pub first: f64,
    /// How far the peak of both stands out from the rest of the window, in the rest's standard deviations.
    pub prominence: f64,
    /// `followed` beside what it usually is while the object is seen.
    pub steadiness: f64,
    /// `prominence` beside what it usually is.
    pub distinction: f64,
}

/// Probability that the object vanishes from one frame to the next.
const VANISHES: f64 = 0.005;
/// Probability that it shows again.
const RETURNS: f64 = 0.2;
/// Share of a new frame in what is usual.
const RATE: f64 = 0.02;

/// Weights of a logistic regression, fitted to windows of drawn clips (`Clip`, seeds 101 to 106, all troubles) with the
/// object and without it, half of each: the constant, `first`, `steadiness` and `distinction`.
const WEIGHTS: [f64; 4] = [-13.4, 8.8, 2.9, 11.9];
/// Frames next to each other are alike: each counts as half a one.
const FRESHNESS: f64 = 0.5;
/// Most that a frame may say.
const LOUDEST: f64 = 15.0;

impl Signs {
    /// ln of how much more likely they are where the object is than where it is not.
    pub fn evidence(&self) -> f64 {
        let [constant, first, steadiness, distinction] = WEIGHTS;
        let sum =
            constant + first * self.first + steadiness * self.steadiness + distinction * self.distinction;
        (FRESHNESS * sum).clamp(-LOUDEST, LOUDEST)
    }
}

/// The chain, and what is usual while the object is seen.
#[derive(Clone, Copy, Debug, Default)]
pub struct Visibility {
    p_lost: f64,
    usual: Option<[f64; 2]>,
}

impl Visibility {
    /// Fills in what depends on what is usual.
    pub fn compare(&self, signs: &mut Signs) {
        let [followed, prominence] = self.usual.unwrap_or([signs.followed, signs.prominence]);
        signs.steadiness = signs.followed / followed.max(1e-3);
        signs.distinction = signs.prominence / prominence.max(1e-3);
    }

    /// The probability of *lost* after one more frame.
    pub fn update(&mut self, signs: &Signs) -> f64 {
        let before = self.p_lost * (1.0 - RETURNS) + (1.0 - self.p_lost) * VANISHES;
        let odds = before / (1.0 - before) * Real::exp(-signs.evidence());
        self.p_lost = odds / (1.0 + odds);
        let rate = RATE * (1.0 - self.p_lost);
        let usual = self.usual.get_or_insert([signs.followed, signs.prominence]);
        for (usual, now) in usual.iter_mut().zip([signs.followed, signs.prominence]) {
            *usual += rate * (now - *usual);
        }
        self.p_lost
    }

    /// Whether the object is more likely lost than seen.
    pub fn is_lost(&self) -> bool {
        self.p_lost > 0.5
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: Signs =
        Signs { followed: 0.9, first: 0.7, prominence: 15.0, steadiness: 1.0, distinction: 1.0 };
    const BAD: Signs =
        Signs { followed: 0.2, first: 0.15, prominence: 4.0, steadiness: 0.2, distinction: 0.3 };

    #[test]
    fn the_chain_is_bayes_rule() {
        let mut chain = Visibility::default();
        let p = chain.update(&BAD);
        let (lost, seen) = (VANISHES * 1.0, (1.0 - VANISHES) * BAD.evidence().exp());
        assert!((p - lost / (lost + seen)).abs() < 1e-12);
        let q = chain.update(&GOOD);
        let before = p * (1.0 - RETURNS) + (1.0 - p) * VANISHES;
        let odds = before / (1.0 - before) * (-GOOD.evidence()).exp();
        assert!((q - odds / (1.0 + odds)).abs() < 1e-12);
    }

    #[test]
    fn objects_are_lost_and_found() {
        let mut chain = Visibility::default();
        assert!((0..50).all(|_| chain.update(&GOOD) < 0.01));
        assert!((0..5).any(|_| chain.update(&BAD) > 0.5) && chain.is_lost());
        assert!((0..500).all(|_| chain.update(&BAD).is_finite()) && chain.is_lost());
        assert!((0..5).any(|_| chain.update(&GOOD) < 0.5) && !chain.is_lost());
    }

    #[test]
    fn what_is_usual_is_that_of_seen_frames() {
        let mut chain = Visibility::default();
        chain.update(&GOOD);
        for _ in 0..200 {
            chain.update(&BAD);
        }
        let mut signs = GOOD;
        chain.compare(&mut signs);
        // The few bad frames before it was lost count a little.
        assert!((1.0..1.2).contains(&signs.steadiness), "{signs:?}");
    }
}
