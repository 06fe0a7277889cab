//! The loop of one target, and the targets of a run.

use super::Plot;
use super::belief::Belief;
use super::modes::Mode;
use super::row::{Event, Innovation, Row, State};
use super::rules::{Rules, states};
use super::saved::{SavedBelief, SavedTarget, SavedTracker, Version};
use super::sensor::Frame;
use crate::error::{Error, Result};
use crate::filter::{Outcome, Update};
use crate::model::Motion;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Follows identified targets: the object-safe edge of the library.
pub trait Tracker: Send {
    /// Takes a plot in and says what became of it. Plots of one identity come in order of time.
    ///
    /// # Errors
    /// A reading that the models have no place for, a number that is not finite; the tracks are then as they were.
    fn push(&mut self, plot: &Plot) -> Result<Row>;

    /// What the numbers of a state are, in order.
    fn states(&self) -> Vec<State>;

    /// The modes whose probabilities rows tell, in order; none for filters without modes.
    fn modes(&self) -> &[Mode];

    /// Where the reading alone puts the target in the plane, metres; `None` if it does not tell.
    fn place(&self, plot: &Plot) -> Option<[f64; 2]>;

    /// All that is needed to go on later, to the same bits.
    fn save(&self) -> SavedTracker;

    /// Takes up what [`Tracker::save`] kept, in place of all tracks.
    ///
    /// # Errors
    /// A state of another specification; beliefs of another shape.
    fn restore(&mut self, saved: SavedTracker) -> Result<()>;
}

/// Name of a target's first, second, ... track: another one for every pair. The random streams are keyed by it.
pub(super) fn track_name(identity: Arc<str>, track: u32) -> Arc<str> {
    let numbered = |number: &str| {
        number.starts_with(|c: char| ('1'..='9').contains(&c)) && number.bytes().all(|b| b.is_ascii_digit())
    };
    match identity.rsplit_once('#') {
        Some((_, number)) if numbered(number) => Arc::from(format!("{identity}#{track}")),
        _ if track > 1 => Arc::from(format!("{identity}#{track}")),
        _ => identity,
    }
}

/// FNV-1a with 64 bits (Fowler, Noll and Vo, draft-eastlake-fnv): the label under which the random stream of a
/// track is forked from the seed. The same text has the same hash for ever.
pub fn stable_hash(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// What is known of one target.
pub(super) struct Target<const N: usize> {
    id: Arc<str>,
    belief: Belief<N>,
    /// Which track of the identity this is, from 1.
    track: u32,
    /// How often its belief was started.
    starts: u32,
    /// Updates that a cloud still waits for: see [`Rules::begin`].
    warm_up: u32,
    /// Degenerate updates in a row.
    degenerate: u32,
    /// Times in a row at which nothing but refused measurements came.
    gated: u32,
}

/// A target, and the step of the filter that started it where there was one.
type Started<const N: usize> = (Target<N>, Option<Update>);

impl<A, F, const N: usize, const W: usize, const D: usize> Rules<A, F, N, W, D>
where
    A: Motion<N, W> + Clone + 'static,
    F: Frame<N, D>,
{
    /// A target whose first plot this is; the second value is the filter's step where there was one.
    fn start(&self, id: Arc<str>, track: u32, starts: u32, plot: &Plot) -> Result<Option<Started<N>>> {
        let Some((law, warm_up)) = self.begin(plot)? else { return Ok(None) };
        let belief = self.form(self.stream_of(&id, starts), plot.time, law, warm_up)?;
        let mut target = Target { id, belief, track, starts, warm_up, degenerate: 0, gated: 0 };
        // A plot that gave no position has still to be used.
        let update = match self.sensors.of(plot).place(&plot.reading)? {
            Some(_) => None,
            None => Some(self.advance(&mut target, plot, true)?),
        };
        Ok(Some((target, update)))
    }

    /// The filter's step.
    fn advance(&self, target: &mut Target<N>, plot: &Plot, used: bool) -> Result<Update> {
        let update = self.step(&mut target.belief, plot, used)?;
        if update.outcome == Outcome::Updated && target.warm_up > 0 {
            target.warm_up -= 1;
            if target.warm_up == 0 {
                let stream = self.stream_of(&target.id, target.starts);
                if let Some(drawn) = self.draw(stream, &target.belief)? {
                    target.belief = drawn;
                }
            }
        }
        Ok(update)
    }

    /// Takes a plot in.
    fn push(&self, slot: &mut Option<Target<N>>, plot: &Plot) -> Result<Row> {
        for &value in plot.reading.values() {
            Error::finite("measurement", value)?;
        }
        let identity = plot.id.clone().unwrap_or_else(|| Arc::from("target"));
        let silent = |t: &Target<N>| plot.time - t.belief.time() > self.spec.life.max_gap;
        if slot.as_ref().is_none_or(silent) {
            let track = slot.as_ref().map_or(1, |t| t.track + 1);
            let id = track_name(identity, track);
            return match self.start(Arc::clone(&id), track, 1, plot)? {
                None => Ok(Row::without_belief(id, plot.time, Event::Waiting)),
                Some((target, update)) => {
                    let row = self.row(&target, Event::Started, update, None);
                    *slot = Some(target);
                    row
                }
            };
        }
        let Some(target) = slot.as_mut() else {
            return Ok(Row::without_belief(identity, plot.time, Event::Waiting));
        };
        if plot.time < target.belief.time() {
            return self.row(target, Event::OutOfOrder, None, None);
        }
        let foretold = self.foretold(&target.belief, plot)?;
        let innovation = foretold.map(|foretold| foretold.innovation);
        let gated = self.gated(plot, innovation.as_ref());
        // What comes at one time may be wrong for one reason: it counts once.
        let again = target.gated > 0 && plot.time == target.belief.time();
        let update = self.advance(target, plot, !gated)?;
        let event = match update.outcome {
            _ if gated => Event::Gated,
            Outcome::Degenerate => Event::Degenerate,
            _ => Event::Updated,
        };
        let update = Update { outcome: if gated { Outcome::Gated } else { update.outcome }, ..update };
        let lost = event == Event::Degenerate || !gated && is_starved(&update, innovation.as_ref());
        // One refused measurement tells nothing of the belief: it neither counts nor clears the count. Many in a row
        // tell that no measurement will ever reach the belief again.
        target.degenerate = if lost {
            target.degenerate + 1
        } else if gated {
            target.degenerate
        } else {
            0
        };
        target.gated = match event {
            Event::Gated if !again => target.gated.saturating_add(1),
            Event::Updated => 0,
            _ => target.gated,
        };
        let most_gated = self.spec.life.restart_after_gated.unwrap_or(self.sensors.of(plot).refusals());
        let locked_out = gated && target.gated >= most_gated.max(1);
        let dead = update.particles.is_some_and(|p| p.ess == 0.0);
        if dead || locked_out || lost && target.degenerate >= self.spec.life.restart_after.max(1) {
            let restarted = self.start(Arc::clone(&target.id), target.track, target.starts + 1, plot)?;
            if let Some((restarted, _)) = restarted {
                *target = restarted;
                return self.row(target, Event::Restarted, Some(update), innovation);
            }
        }
        self.row(target, event, Some(update), innovation)
    }

    fn row(
        &self,
        target: &Target<N>,
        event: Event,
        update: Option<Update>,
        innovation: Option<Innovation>,
    ) -> Result<Row> {
        let Ok(law) = target.belief.law() else {
            // Every particle is lost: there is no estimate until the next start.
            let row = Row::without_belief(Arc::clone(&target.id), target.belief.time(), event);
            return Ok(Row { update, innovation, ..row });
        };
        let mean = target.belief.point(self.spec.life.estimate, law.mean())?;
        Ok(Row {
            id: Arc::clone(&target.id),
            time: target.belief.time(),
            event,
            update,
            mean: mean.to_vec(),
            covariance: law.covariance().0.iter().flatten().copied().collect(),
            modes: target.belief.probabilities(),
            innovation,
        })
    }
}

/// Whether particles have lost their target: hardly more than one carries all the weight, and the measurement is
/// where the cloud all but excluded it (one in 10^10 for two components). Log-weights do not underflow, so the filter
/// itself goes on with the least bad particle.
fn is_starved(update: &Update, innovation: Option<&Innovation>) -> bool {
    const NIS: f64 = 46.0;
    const ESS: f64 = 2.0;
    update.particles.is_some_and(|p| p.ess < ESS) && innovation.is_some_and(|i| i.nis > NIS)
}

/// All targets of a run, by identity.
pub(super) struct Targets<A, F: Frame<N, D>, const N: usize, const W: usize, const D: usize> {
    rules: Rules<A, F, N, W, D>,
    targets: BTreeMap<Option<Arc<str>>, Option<Target<N>>>,
}

impl<A, F: Frame<N, D>, const N: usize, const W: usize, const D: usize> Targets<A, F, N, W, D> {
    pub(super) fn new(rules: Rules<A, F, N, W, D>) -> Self {
        Targets { rules, targets: BTreeMap::new() }
    }
}

impl<A, F, const N: usize, const W: usize, const D: usize> Tracker for Targets<A, F, N, W, D>
where
    A: Motion<N, W> + Clone + 'static,
    F: Frame<N, D>,
{
    fn push(&mut self, plot: &Plot) -> Result<Row> {
        let slot = self.targets.entry(plot.id.clone()).or_default();
        self.rules.push(slot, plot)
    }

    fn states(&self) -> Vec<State> {
        (0..N).map(states::<N, D>).collect()
    }

    fn modes(&self) -> &[Mode] {
        self.rules.modes.as_ref().map_or(&[], |modes| &modes.names)
    }

    fn place(&self, plot: &Plot) -> Option<[f64; 2]> {
        let law = self.rules.sensors.of(plot).place(&plot.reading).ok()??;
        Some([law.mean()[0], law.mean()[1]])
    }

    fn save(&self) -> SavedTracker {
        let save = |target: &Target<N>| SavedTarget {
            track: target.track,
            starts: target.starts,
            warm_up: target.warm_up,
            degenerate: target.degenerate,
            gated: target.gated,
            belief: SavedBelief::of(&target.belief),
        };
        SavedTracker {
            version: Version::CURRENT,
            spec: self.rules.spec.clone(),
            targets: self
                .targets
                .iter()
                .filter_map(|(id, target)| Some((id.as_deref().map(str::to_owned), save(target.as_ref()?))))
                .collect(),
        }
    }

    fn restore(&mut self, saved: SavedTracker) -> Result<()> {
        if saved.spec != self.rules.spec {
            let text = "the saved tracks were made by another configuration; build the tracker from theirs";
            return Err(Error::Unsupported(text.to_owned()));
        }
        let mut targets = BTreeMap::new();
        for (id, target) in saved.targets {
            let id: Option<Arc<str>> = id.map(Arc::from);
            let name = id.clone().unwrap_or_else(|| Arc::from("target"));
            let SavedTarget { track, starts, warm_up, degenerate, gated, belief } = target;
            let name = track_name(name, track);
            let belief = belief.restored()?;
            if !self.rules.accepts(&belief) {
                let text = format!("the saved belief of `{name}` is of another filter");
                return Err(Error::Unsupported(text));
            }
            if belief.modes() != self.rules.modes.as_ref().map_or(0, |modes| modes.names.len()) {
                let text = format!("the saved belief of `{name}` has other modes than this filter");
                return Err(Error::Unsupported(text));
            }
            targets.insert(id, Some(Target { id: name, belief, track, starts, warm_up, degenerate, gated }));
        }
        self.targets = targets;
        Ok(())
    }
}
