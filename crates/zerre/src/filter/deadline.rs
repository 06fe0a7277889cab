//! Particle filters with a time to keep: as many particles as a step has time for.

use crate::belief::PacedCloud;
use crate::error::{Error, Result};
use crate::filter::size::{Goal, Size, checked_range, never_resampled};
use crate::filter::{Filter, ParticleFilter, Prior, Settings, Update};
use crate::model::{Likelihood, Motion};
use crate::proposal::Proposal;
use crate::resample::Trigger;
use crate::rng::Stream;
use crate::time::Time;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What a step of a [`Deadline`] may take, and the numbers of particles that it may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Budget {
    /// Time of a step.
    pub step: Duration,
    /// Share of it that is planned for, in (0, 1]: the rest is for steps that take longer than foreseen.
    pub safety: f64,
    /// Least number of particles, however long they take.
    pub least: usize,
    /// Largest number of particles; memory is taken for as many at the start.
    pub most: usize,
}

impl Budget {
    /// So much time a step, four fifths of it planned for, by 100 to 100 000 particles.
    pub fn per_step(step: Duration) -> Budget {
        Budget { step, safety: 0.8, least: 100, most: 100_000 }
    }
}

/// A particle filter with as many particles as fit into a budget of time per step.
///
/// The filter itself has no clock: the caller gives one, any function that says how much time has passed since
/// some instant. Each step is planned from what a particle cost in the steps before:
/// n = safety x budget / cost, where the cost is the third largest of the last 64 steps' times per particle.
/// A step or two that the system held up thus change nothing, however long they took; slowness that comes a
/// third time is taken for what it is, and given up 64 steps later. The number grows by no more than a quarter
/// at once, and changes where the filter resamples; a change of more than an eighth makes it resample. It
/// comes into force one step after the plan, or at once with a lookahead. A step is never cut short.
///
/// What random numbers are drawn depends on the clock by the numbers of particles alone. They are recorded
/// ([`ParticleUpdate::particles`](super::ParticleUpdate::particles)), and the plain filter with
/// [`Size::Recorded`] does the same again, to the same bits.
#[derive(Clone, Debug)]
pub struct Deadline<F, C> {
    filter: F,
    clock: C,
    budget: Budget,
}

/// Steps that the cost of a particle is learnt from.
const WINDOW: usize = 64;
/// Steps among them that may be slow by chance.
const OUTLIERS: usize = 2;
/// By what the number of particles may grow at once.
const GROWTH: f64 = 1.25;

/// What particles have cost.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Pace {
    /// Seconds per particle of the last steps, the oldest at `oldest` once there are enough.
    costs: Vec<f64>,
    oldest: usize,
}

impl Pace {
    fn new() -> Pace {
        Pace { costs: Vec::with_capacity(WINDOW), oldest: 0 }
    }

    fn record(&mut self, cost: f64) {
        if self.costs.len() < WINDOW {
            self.costs.push(cost);
        } else if let Some(place) = self.costs.get_mut(self.oldest % WINDOW) {
            *place = cost;
            self.oldest = (self.oldest + 1) % WINDOW;
        }
    }

    /// Seconds per particle to reckon with; `None` before the first step.
    fn cost(&self) -> Option<f64> {
        let mut largest = [f64::NEG_INFINITY; OUTLIERS + 1];
        for &cost in &self.costs {
            let mut one = cost;
            for place in &mut largest {
                if one > *place {
                    std::mem::swap(&mut one, place);
                }
            }
        }
        // Of few steps fewer are taken for outliers: the median is kept.
        let by_chance = (self.costs.len().checked_sub(1)? / 2).min(OUTLIERS);
        largest.get(by_chance).copied()
    }

    /// The number of particles after `n` of them.
    fn number(&self, budget: &Budget, n: usize) -> usize {
        let Some(cost) = self.cost() else { return n };
        // A clock too coarse to see a step allows any number.
        let fits = budget.safety * budget.step.as_secs_f64() / cost;
        let fits = fits.min(GROWTH * n as f64 + 1.0);
        (fits as usize).clamp(budget.least, budget.most)
    }
}

impl<const N: usize, const W: usize, M, H, P, Q, C> Deadline<ParticleFilter<N, W, M, H, P, Q>, C>
where
    M: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
    Q: Proposal<N, W, M, H>,
    C: Fn() -> Duration,
{
    /// `filter` within `budget`, by `clock`. The filter's number of particles is that of the first step.
    ///
    /// # Errors
    /// No time at all, a safety outside (0, 1], numbers of particles that are none, too many or in the wrong
    /// order, a first number outside them; a filter that never resamples, or has a [`Size`] of its own.
    pub fn new(filter: ParticleFilter<N, W, M, H, P, Q>, budget: Budget, clock: C) -> Result<Self> {
        Error::positive("time of a step", budget.step.as_secs_f64())?;
        Error::positive("safety of the deadline", budget.safety)?;
        if budget.safety > 1.0 {
            let (what, value) = ("safety of the deadline", budget.safety);
            return Err(Error::OutOfRange { what, value, needs: "it must lie in (0, 1]" });
        }
        checked_range(budget.least, budget.most)?;
        let Settings { particles, trigger, ref size, .. } = *filter.settings();
        if !(budget.least..=budget.most).contains(&particles) {
            let (what, value) = ("first number of particles", particles as f64);
            return Err(Error::OutOfRange { what, value, needs: "it must lie within those of the budget" });
        }
        if *size != Size::Fixed {
            let text = "the deadline sets the number of particles: leave the size of the filter fixed";
            return Err(Error::Unsupported(text.to_owned()));
        }
        if trigger == Trigger::Never {
            return Err(never_resampled());
        }
        Ok(Deadline { filter, clock, budget })
    }

    /// The filter inside.
    pub fn filter(&self) -> &ParticleFilter<N, W, M, H, P, Q> {
        &self.filter
    }
}

impl<const N: usize, const W: usize, M, H, P, Q, C> Filter for Deadline<ParticleFilter<N, W, M, H, P, Q>, C>
where
    M: Motion<N, W>,
    H: Likelihood<N>,
    P: Prior<N>,
    Q: Proposal<N, W, M, H>,
    C: Fn() -> Duration,
{
    type Measurement = H::Value;
    type Belief = PacedCloud<N>;

    fn start(&self, at: Time, stream: Stream) -> Result<PacedCloud<N>> {
        let cloud = self.filter.start_with_room(at, stream, self.budget.most)?;
        Ok(PacedCloud { cloud, pace: Pace::new() })
    }

    fn step(&self, belief: &mut PacedCloud<N>, to: Time, z: Option<&H::Value>) -> Result<Update> {
        let since = (self.clock)();
        let PacedCloud { cloud, pace } = belief;
        let number = pace.number(&self.budget, cloud.coming());
        let update = self.filter.step_toward(cloud, to, z, &Goal::About(number))?;
        let spent = (self.clock)().saturating_sub(since);
        pace.record(spent.as_secs_f64() / cloud.len() as f64);
        Ok(update)
    }
}
