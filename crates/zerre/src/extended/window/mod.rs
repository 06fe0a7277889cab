//! Variational expectation maximisation over a window of scans.

mod belief;
mod information;
mod number;
mod turns;

pub use belief::ExtendedBelief;
pub use information::Extent;
pub use number::Number;

use super::centre::{self, Centre};
use super::path::Moments;
use super::rate::Rate;
use super::shape::{Lobe, MAX_ELLIPSES, Shape, log_sum_exp};
use super::statistics::{MStep, Sums};
use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::filter::{Filter, Outcome, Update};
use crate::kernels::Simd;
use crate::math::{Dual, Matrix};
use crate::model::Motion;
use crate::rng::Stream;
use crate::time::Time;
use information::Information;
use number::{Memory, Wish};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use turns::{NO_LOBE, clutter_level};

/// Points that are not the target's, uniform over an area.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Clutter {
    /// Area that they fall into, m^2.
    pub area: f64,
    /// How many there are in a scan.
    pub rate: Rate,
    /// Whether the rate is learnt from the points.
    pub learnt: bool,
}

/// Settings of a [`WindowVb`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WindowSettings {
    /// Scans in the window, 10 by default: those that leave it keep what they said of the shape.
    pub window: usize,
    /// Turns between the path and the shape after each scan, 5 by default.
    pub sweeps: usize,
    /// Turns from the first shape on, after each scan as long as all scans are in the window, 20 by default: what few
    /// points seemed to say at first is not held on to. 0: none.
    pub fresh: usize,
    /// How the shape follows from the statistics.
    pub m_step: MStep,
    /// What is kept, from scan to scan, of the statistics that have left the window: 1 for a shape that stays.
    pub keep: f64,
    /// Noise of the sensor on each point, m^2.
    pub noise: Matrix<2, 2>,
    /// Points of the target in a scan.
    pub rate: Rate,
    /// Points of others.
    pub clutter: Option<Clutter>,
    /// How the number of ellipses changes; `None`: it stays.
    pub number: Option<Number>,
}

impl Default for WindowSettings {
    fn default() -> Self {
        WindowSettings {
            window: 10,
            sweeps: 5,
            fresh: 20,
            m_step: MStep { prior: 0.5, ..MStep::default() },
            keep: 1.0,
            noise: Matrix::ZERO,
            rate: Rate { points: 5.0, scans: 0.5, keep: 1.0 },
            clutter: None,
            number: None,
        }
    }
}

/// The filter: in turns, the path of the last scans by a smoother with every point shared among the ellipses, and the
/// shape by its most likely value given those shares and paths. Scans that leave the window leave their statistics
/// behind, and their filtered state as the start of what follows.
#[derive(Clone, Debug)]
pub struct WindowVb<A, C, const N: usize, const W: usize> {
    motion: A,
    centre: C,
    prior: Gaussian<N>,
    shape: Shape,
    settings: WindowSettings,
    simd: Simd,
}

/// Turns over all scans after which the motion is linearised about the path once more.
const ANEW: usize = 5;

/// What all scans say at once.
#[derive(Clone, Debug, PartialEq)]
pub struct Smoothed<const N: usize> {
    /// The state at each scan.
    pub states: Vec<Gaussian<N>>,
    /// The shape.
    pub shape: Shape,
    /// Bound on the log-density of all points under the shape, their numbers given; -inf without a turn.
    pub bound: f64,
}

impl<A, C, const N: usize, const W: usize> WindowVb<A, C, N, W>
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
        settings: WindowSettings,
    ) -> Result<Self> {
        settings.m_step.check()?;
        Error::positive("scans in the window", settings.window as f64)?;
        Error::positive("sweeps", settings.sweeps as f64)?;
        settings.noise.finite("noise of the sensor")?;
        let what = "share of old statistics that is kept";
        if Error::not_negative(what, settings.keep)? > 1.0 {
            return Err(Error::OutOfRange { what, value: settings.keep, needs: "it must not exceed 1" });
        }
        if let Some(clutter) = &settings.clutter {
            Error::positive("area of the clutter", clutter.area)?;
        }
        if let Some(number) = &settings.number {
            number.check()?;
        }
        Ok(WindowVb { motion, centre, prior, shape, settings, simd: Simd::best() })
    }

    /// The same from another shape.
    #[must_use]
    pub fn with_shape(&self, shape: Shape) -> Self
    where
        A: Clone,
    {
        WindowVb {
            shape,
            settings: self.settings.clone(),
            motion: self.motion.clone(),
            centre: self.centre.clone(),
            ..*self
        }
    }

    /// Where a state has its centre.
    pub fn centre(&self) -> &C {
        &self.centre
    }

    /// The centre of the target and its shape about it, as they lie in the plane.
    pub fn placed(&self, belief: &ExtendedBelief<N>) -> ([f64; 2], Shape) {
        place(&self.centre, &belief.state, &belief.shape)
    }

    /// What is known of the extent of each ellipse; path, sensor noise and heading are taken for known. With all scans in
    /// the window, intervals hold what they say (90 % of the time .90, three overlapping ellipses, 50 scans); where scans
    /// leave it, they are somewhat narrow (.84 with a window of 10).
    ///
    /// # Errors
    /// None for the beliefs of this filter.
    pub fn extents(&self, belief: &ExtendedBelief<N>) -> Result<Vec<Extent>> {
        let mut lobes = [NO_LOBE; MAX_ELLIPSES];
        let lobes = &mut lobes[..belief.shape.len()];
        self.digest(&belief.shape, lobes)?;
        let level = clutter_level(&belief.rate, belief.clutter.as_ref());
        let mut information = belief.information.clone();
        for scan in &belief.window {
            scan.in_body().for_each(|d| information.take(d, lobes, level));
        }
        information.add_sure(self.settings.m_step.prior, lobes);
        Ok(information.extents(&belief.shape))
    }

    /// Takes in a scan; the bound on its log-density.
    fn take(
        &self,
        belief: &mut ExtendedBelief<N>,
        to: Time,
        ahead: Moments<N>,
        points: &[[f64; 2]],
    ) -> Result<f64> {
        let mut lobes = [NO_LOBE; MAX_ELLIPSES];
        let lobes = &mut lobes[..belief.shape.len()];
        self.digest(&belief.shape, lobes)?;
        let level = clutter_level(&belief.rate, belief.clutter.as_ref());
        let (scan, bound) = self.enter((to, ahead, points), lobes, level);
        if belief.window.len() == self.settings.window {
            self.freeze(belief, lobes, level);
        }
        belief.window.push_back(scan);
        self.turn(belief, lobes)?;
        if let Some(number) = &self.settings.number {
            self.reconsider(belief, number)?;
        }
        if let Some(scan) = belief.window.back() {
            belief.state = scan.smoothed.law()?;
        }
        belief.time = to;
        Ok(bound)
    }

    /// The turns after a scan.
    fn turn(&self, belief: &mut ExtendedBelief<N>, lobes: &mut [Lobe]) -> Result<()> {
        let mut turns = self.settings.sweeps;
        if !belief.has_frozen && self.settings.fresh > 0 {
            turns = self.settings.fresh;
            belief.shape.clone_from(&belief.first);
            self.digest(&belief.shape, lobes)?;
            self.share_again(belief)?;
        }
        for turn in 0..turns {
            self.sweep(belief, lobes, turn == 0)?;
        }
        Ok(())
    }

    /// All scans at once, by `turns` between the whole path and the shape: variational expectation maximisation. Scans
    /// are in the order of time, from the start at `at` on.
    ///
    /// # Errors
    /// Points that are not finite, times out of order, a model that refuses its parameters.
    pub fn smoothed(&self, at: Time, scans: &[(Time, Vec<[f64; 2]>)], turns: usize) -> Result<Smoothed<N>> {
        let mut belief = self.start(at, Stream::new(0))?;
        let mut lobes = [NO_LOBE; MAX_ELLIPSES];
        let lobes = &mut lobes[..belief.shape.len()];
        self.digest(&belief.shape, lobes)?;
        let level = clutter_level(&belief.rate, belief.clutter.as_ref());
        let (mut time, mut state) = belief.anchor;
        for (to, points) in scans {
            check(points)?;
            if *to < time {
                return Err(Error::OutOfOrder { from: time, to: *to });
            }
            let leap = self.leap(time, *to, &state)?;
            let ahead = leap.as_ref().map_or(state, |leap| state.after(leap));
            let (scan, _) = self.enter((*to, ahead, points), lobes, level);
            (time, state) = (*to, scan.smoothed);
            belief.window.push_back(scan);
        }
        let mut bound = f64::NEG_INFINITY;
        for turn in 0..turns {
            bound = self.sweep(&mut belief, lobes, turn % ANEW == 0)?;
        }
        let states = belief.window.iter().map(|scan| scan.smoothed.law()).collect::<Result<_>>()?;
        Ok(Smoothed { states, shape: belief.shape, bound })
    }
}

impl<A, C, const N: usize, const W: usize> Filter for WindowVb<A, C, N, W>
where
    A: Motion<N, W>,
    C: Centre<N>,
{
    type Measurement = Vec<[f64; 2]>;
    type Belief = ExtendedBelief<N>;

    fn start(&self, at: Time, _: Stream) -> Result<ExtendedBelief<N>> {
        let count = self.shape.len();
        Ok(ExtendedBelief {
            time: at,
            state: self.prior,
            shape: self.shape.clone(),
            first: self.shape.clone(),
            anchor: (at, Moments::from(&self.prior)),
            has_frozen: false,
            frozen: vec![Sums::default(); count],
            sums: vec![Sums::default(); count],
            information: Information::new(count),
            window: VecDeque::with_capacity(self.settings.window),
            frozen_rates: [self.settings.rate, self.settings.clutter.map_or(self.settings.rate, |c| c.rate)],
            rate: self.settings.rate,
            clutter: self.settings.clutter,
            memory: Memory::default(),
            wish: Wish::default(),
        })
    }

    fn step(&self, belief: &mut ExtendedBelief<N>, to: Time, scan: Option<&Vec<[f64; 2]>>) -> Result<Update> {
        if to < belief.time {
            return Err(Error::OutOfOrder { from: belief.time, to });
        }
        let state = Moments::from(&belief.state);
        let leap = self.leap(belief.time, to, &state)?;
        let ahead = leap.as_ref().map_or(state, |leap| state.after(leap));
        let Some(points) = scan else {
            (belief.time, belief.state) = (to, ahead.law()?);
            return Ok(Update { outcome: Outcome::Predicted, log_evidence: 0.0, particles: None });
        };
        check(points)?;
        let log_evidence = self.take(belief, to, ahead, points)?;
        Ok(Update { outcome: Outcome::Updated, log_evidence, particles: None })
    }
}

/// Further off than this nothing can be measured: the determinant of a covariance would be no number.
const FARTHEST: f64 = 1e75;

/// Refuses points that are not finite, or too far off to be squared twice.
fn check(points: &[[f64; 2]]) -> Result<()> {
    centre::check(points)?;
    points.iter().flatten().filter(|y| y.abs() > FARTHEST).try_for_each(|y| {
        let needs = "it must lie within 1e75 of zero";
        Err(Error::OutOfRange { what: "point of a scan", value: *y, needs })
    })
}

/// Where a target is and how its shape lies there.
fn place<C: Centre<N>, const N: usize>(centre: &C, state: &Gaussian<N>, shape: &Shape) -> ([f64; 2], Shape) {
    let at = centre.at(*state.mean());
    let shape = if C::TURNS { shape.turned(centre.heading(*state.mean())) } else { shape.clone() };
    (at, shape)
}

/// ln p of points about a state's law, each for itself: the centre's uncertainty added to every ellipse, the heading taken
/// for known.
///
/// # Errors
/// Extents that are not positive definite.
pub fn predictive_score<C: Centre<N>, const N: usize>(
    centre: &C,
    state: &Gaussian<N>,
    shape: &Shape,
    points: &[[f64; 2]],
) -> Result<f64> {
    let seen = centre.at(Dual::<N>::variables(*state.mean()));
    let spread = Matrix(seen.map(|s| s.gradient)).congruence(state.covariance());
    let (at, shape) = place(centre, state, shape);
    let lobes: Vec<Lobe> = shape.blurred(&spread).ellipses().iter().map(Lobe::of).collect::<Result<_>>()?;
    let score = |y: &[f64; 2]| {
        let logs: Vec<f64> =
            lobes.iter().map(|lobe| lobe.log_density([y[0] - at[0], y[1] - at[1]])).collect();
        log_sum_exp(&logs)
    };
    Ok(points.iter().map(score).sum())
}
