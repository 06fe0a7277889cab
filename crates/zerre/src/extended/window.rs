//! Variational expectation maximisation over a window of scans.

use super::path::{Leap, Moments};
use super::rate::Rate;
use super::shape::{Ellipse, Lobe, MAX_ELLIPSES, Shape, log_sum_exp};
use super::statistics::{MStep, Sums};
use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::filter::{Filter, MotionTangent, Outcome, Update};
use crate::kernels::{self, Simd};
use crate::math::{Dual, Matrix, Real, ln};
use crate::model::Motion;
use crate::rng::Stream;
use crate::time::Time;
use serde::{Deserialize, Serialize};
use std::array::from_fn;
use std::collections::VecDeque;

/// Where in the plane a state has its centre: h(x) of Özkan 2019, equation 6.
pub trait Centre<const N: usize>: Clone + Send + Sync {
    /// h(x), m.
    fn at<R: Real>(&self, x: [R; N]) -> [R; 2];
}

/// The first two components of the state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FirstTwo;

impl<const N: usize> Centre<N> for FirstTwo {
    #[inline(always)]
    fn at<R: Real>(&self, x: [R; N]) -> [R; 2] {
        const { assert!(N >= 2, "the state has no position") };
        [x[0], x[1]]
    }
}

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
}

impl Default for WindowSettings {
    fn default() -> Self {
        WindowSettings {
            window: 10,
            sweeps: 5,
            m_step: MStep::default(),
            keep: 1.0,
            noise: Matrix::ZERO,
            rate: Rate { points: 5.0, scans: 0.5, keep: 1.0 },
            clutter: None,
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

/// What a [`WindowVb`] knows.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtendedBelief<const N: usize> {
    time: Time,
    state: Gaussian<N>,
    shape: Shape,
    /// Where the window starts from.
    anchor: (Time, Moments<N>),
    frozen: Vec<Sums>,
    sums: Vec<Sums>,
    window: VecDeque<Scan<N>>,
    rate: Rate,
    clutter: Option<Clutter>,
}

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

/// A scan in the window.
#[derive(Clone, Debug, PartialEq)]
struct Scan<const N: usize> {
    time: Time,
    /// x and y of its points.
    points: [Vec<f64>; 2],
    /// Where the shares were taken.
    seen: Seen<N>,
    /// What the points said about there, ellipse by ellipse.
    sums: [Sums; MAX_ELLIPSES],
    filtered: Moments<N>,
    smoothed: Moments<N>,
    /// The prediction for it.
    ahead: Moments<N>,
    /// From the scan before; `None` where no time has passed.
    leap: Option<Leap<N>>,
    /// What its points said of the centre when the path was last smoothed.
    said: (Matrix<2, 2>, [f64; 2]),
}

/// The centre of a state's law, by the tangent.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Seen<const N: usize> {
    at: [f64; 2],
    slope: Matrix<2, N>,
    spread: Matrix<2, 2>,
}

impl<const N: usize> ExtendedBelief<N> {
    /// Time of the last scan.
    pub fn time(&self) -> Time {
        self.time
    }

    /// Law of the state.
    pub fn state(&self) -> &Gaussian<N> {
        &self.state
    }

    /// The shape about the centre.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// Points that each ellipse has had, and their sums: what the shape is known by.
    pub fn sums(&self) -> &[Sums] {
        &self.sums
    }

    /// Points of the target in a scan.
    pub fn rate(&self) -> &Rate {
        &self.rate
    }

    /// Points of others.
    pub fn clutter(&self) -> Option<&Clutter> {
        self.clutter.as_ref()
    }
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

    fn seen(&self, state: &Moments<N>) -> Seen<N> {
        let seen = self.centre.at(Dual::<N>::variables(state.mean));
        let slope = Matrix(seen.map(|s| s.gradient));
        Seen { at: seen.map(|s| s.value), slope, spread: slope.congruence(&state.covariance) }
    }

    fn leap(&self, from: Time, to: Time, state: &Moments<N>) -> Result<Option<Leap<N>>> {
        if from == to {
            return Ok(None);
        }
        let step = self.motion.over(from, to)?;
        let noise = self.motion.noise();
        let tangent = MotionTangent::<N, W>::at::<A>(&step, &state.mean, &[noise.mean(); W]);
        Ok(Some(Leap {
            value: tangent.value,
            slope: tangent.by_state,
            noise: tangent.noise_covariance(noise.variance()),
        }))
    }

    /// Shares the points of a scan among the lobes about its smoothed state: q ~ weight exp E ln N(y; h(x) + offset, X),
    /// what is left being clutter. The sum of the logarithms of what the shares were scaled by is the bound on the
    /// points' log-density but for the divergence of the state.
    fn share(&self, scan: &mut Scan<N>, lobes: &[Lobe], level: f64) -> f64 {
        let seen = self.seen(&scan.smoothed);
        let mut there = [Lobe { offset: [0.0; 2], root: [0.0; 3], constant: 0.0 }; MAX_ELLIPSES];
        for (there, lobe) in there.iter_mut().zip(lobes) {
            let j = lobe.information();
            let blur = j.0[0][0] * seen.spread.0[0][0]
                + 2.0 * j.0[0][1] * seen.spread.0[0][1]
                + j.0[1][1] * seen.spread.0[1][1];
            let offset = [lobe.offset[0] + seen.at[0], lobe.offset[1] + seen.at[1]];
            *there = Lobe { offset, root: lobe.root, constant: lobe.constant - 0.5 * blur };
        }
        let mut shared = [[0.0; 6]; MAX_ELLIPSES];
        let [x, y] = &scan.points;
        let count = lobes.len();
        let bound = kernels::share_points(self.simd, [x, y], &there[..count], level, &mut shared[..count]);
        for (sums, [n, x, y, xx, xy, yy]) in scan.sums.iter_mut().zip(shared).take(count) {
            *sums = Sums { count: n, first: [x, y], second: [xx, xy, yy] }.about(seen.at);
        }
        scan.seen = seen;
        bound
    }

    /// What the points of a scan say of its centre h, as they are shared: exp(b'h - h'Jh / 2), h about where the
    /// shares were taken. Each ellipse is measured by the points that it has.
    fn measured(&self, scan: &Scan<N>, lobes: &[Lobe]) -> (Matrix<2, 2>, [f64; 2]) {
        let (mut total, mut vector) = (Matrix::<2, 2>::ZERO, [0.0; 2]);
        for (lobe, sums) in lobes.iter().zip(&scan.sums) {
            let j = lobe.information();
            total = total + j * sums.count;
            let rest: [f64; 2] = from_fn(|k| sums.first[k] - sums.count * lobe.offset[k]);
            vector[0] += j.0[0][0] * rest[0] + j.0[0][1] * rest[1];
            vector[1] += j.0[1][0] * rest[0] + j.0[1][1] * rest[1];
        }
        (total, vector)
    }

    /// The law of a state after that, and the logarithm of the mean of the factor before.
    fn given(
        &self,
        ahead: &Moments<N>,
        scan: &Scan<N>,
        (information, vector): &(Matrix<2, 2>, [f64; 2]),
    ) -> (Moments<N>, f64) {
        let seen = self.seen(ahead);
        let at = from_fn(|k| seen.at[k] - scan.seen.at[k]);
        ahead.given(at, &seen.slope, information, *vector)
    }

    /// The logarithm of that factor, its mean under a state's law.
    fn expected(&self, state: &Moments<N>, scan: &Scan<N>, (j, b): &(Matrix<2, 2>, [f64; 2])) -> f64 {
        let seen = self.seen(state);
        let h: [f64; 2] = from_fn(|k| seen.at[k] - scan.seen.at[k]);
        let square = |p: usize, q: usize| j.0[p][q] * (h[p] * h[q] + seen.spread.0[p][q]);
        b[0] * h[0] + b[1] * h[1] - 0.5 * (square(0, 0) + 2.0 * square(0, 1) + square(1, 1))
    }

    /// The path through the window under the shares of its points; returns the divergence of its law from that
    /// before the points.
    fn smooth(&self, belief: &mut ExtendedBelief<N>, lobes: &[Lobe]) -> Result<f64> {
        let (mut time, mut state) = belief.anchor;
        let mut divergence = 0.0;
        for scan in &mut belief.window {
            scan.leap = self.leap(time, scan.time, &state)?;
            scan.ahead = scan.leap.as_ref().map_or(state, |leap| state.after(leap));
            scan.said = self.measured(scan, lobes);
            let (after, log_mean) = self.given(&scan.ahead, scan, &scan.said);
            state = after;
            divergence -= log_mean;
            (scan.filtered, scan.smoothed, time) = (state, state, scan.time);
        }
        for k in (1..belief.window.len()).rev() {
            let Scan { smoothed: after, ahead, leap, .. } = &belief.window[k];
            let now = &belief.window[k - 1].filtered;
            let smoothed = leap.as_ref().map_or(*after, |leap| now.condition(leap, ahead, after));
            belief.window[k - 1].smoothed = smoothed;
        }
        for scan in &belief.window {
            divergence += self.expected(&scan.smoothed, scan, &scan.said);
        }
        Ok(divergence)
    }

    /// Adds the statistics of a scan, moved from where they were taken to where the state is now.
    fn collect(&self, scan: &Scan<N>, sums: &mut [Sums]) {
        let seen = self.seen(&scan.smoothed);
        let by = [seen.at[0] - scan.seen.at[0], seen.at[1] - scan.seen.at[1]];
        for (sums, scan) in sums.iter_mut().zip(&scan.sums) {
            let mut moved = scan.about(by);
            moved.add(moved.count, [0.0; 2], &seen.spread);
            // Its points have been counted already.
            moved.count = scan.count;
            sums.blend(1.0, 1.0, &moved);
        }
    }

    /// One turn: the path under the shares, the shape under the path, the shares under both. Returns the bound on
    /// the log-density of the points in the window, their numbers given.
    fn sweep(&self, belief: &mut ExtendedBelief<N>, lobes: &mut [Lobe]) -> Result<f64> {
        let divergence = self.smooth(belief, lobes)?;
        belief.sums.clone_from(&belief.frozen);
        for scan in &belief.window {
            self.collect(scan, &mut belief.sums);
        }
        belief.shape = self.settings.m_step.shape(&belief.sums, &self.shape, &self.settings.noise)?;
        self.digest(&belief.shape, lobes)?;
        let level = clutter_level(&belief.rate, belief.clutter.as_ref());
        let mut bound = -divergence;
        for scan in &mut belief.window {
            bound += self.share(scan, lobes, level);
        }
        Ok(bound)
    }

    fn digest(&self, shape: &Shape, lobes: &mut [Lobe]) -> Result<()> {
        for (place, ellipse) in lobes.iter_mut().zip(shape.ellipses()) {
            *place = Lobe::of(&Ellipse { extent: ellipse.extent + self.settings.noise, ..*ellipse })?;
        }
        Ok(())
    }

    /// A scan as it enters, shared by turns with its state alone, under the shape that it finds; and the variational
    /// bound on the log-density of its points given those before and their number.
    fn enter(
        &self,
        (time, ahead, points): (Time, Moments<N>, &[[f64; 2]]),
        lobes: &[Lobe],
        level: f64,
    ) -> (Scan<N>, f64) {
        let mut scan = Scan {
            time,
            points: from_fn(|k| points.iter().map(|y| y[k]).collect()),
            seen: self.seen(&ahead),
            sums: [Sums::default(); MAX_ELLIPSES],
            filtered: ahead,
            smoothed: ahead,
            ahead,
            leap: None,
            said: (Matrix::ZERO, [0.0; 2]),
        };
        let mut bound = self.share(&mut scan, lobes, level);
        if points.is_empty() {
            return (scan, 0.0);
        }
        for _ in 0..self.settings.sweeps {
            let said = self.measured(&scan, lobes);
            let (state, log_mean) = self.given(&ahead, &scan, &said);
            let divergence = self.expected(&state, &scan, &said) - log_mean;
            scan.smoothed = state;
            bound = self.share(&mut scan, lobes, level) - divergence;
        }
        (scan, bound)
    }

    /// Takes in a scan; the bound on its log-density.
    fn take(
        &self,
        belief: &mut ExtendedBelief<N>,
        to: Time,
        ahead: Moments<N>,
        points: &[[f64; 2]],
    ) -> Result<f64> {
        let mut lobes = [Lobe { offset: [0.0; 2], root: [0.0; 3], constant: 0.0 }; MAX_ELLIPSES];
        let lobes = &mut lobes[..belief.shape.len()];
        self.digest(&belief.shape, lobes)?;
        let level = clutter_level(&belief.rate, belief.clutter.as_ref());
        let (scan, bound) = self.enter((to, ahead, points), lobes, level);
        if belief.window.len() == self.settings.window {
            self.freeze(belief);
        }
        belief.window.push_back(scan);
        for _ in 0..self.settings.sweeps {
            self.sweep(belief, lobes)?;
        }
        belief.rate.predict();
        if let Some(scan) = belief.window.back() {
            belief.state = scan.smoothed.law()?;
            let of_target: f64 = scan.sums.iter().map(|sums| sums.count).sum();
            belief.rate.update(of_target);
            if let Some(clutter) = belief.clutter.as_mut().filter(|c| c.learnt) {
                clutter.rate.predict();
                clutter.rate.update((points.len() as f64 - of_target).max(0.0));
            }
        }
        belief.time = to;
        Ok(bound)
    }

    /// The oldest scan leaves its statistics to the shape and its state to the start of the window.
    fn freeze(&self, belief: &mut ExtendedBelief<N>) {
        let Some(scan) = belief.window.pop_front() else { return };
        for sums in &mut belief.frozen {
            let old = *sums;
            sums.blend(self.settings.keep, 0.0, &old);
        }
        self.collect(&scan, &mut belief.frozen);
        belief.anchor = (scan.time, scan.filtered);
    }

    /// All scans at once, by `turns` between the whole path and the shape: variational expectation maximisation. Scans
    /// are in the order of time, from the start at `at` on.
    ///
    /// # Errors
    /// Points that are not finite, times out of order, a model that refuses its parameters.
    pub fn smoothed(&self, at: Time, scans: &[(Time, Vec<[f64; 2]>)], turns: usize) -> Result<Smoothed<N>> {
        let mut belief = self.start(at, Stream::new(0))?;
        let mut lobes = [Lobe { offset: [0.0; 2], root: [0.0; 3], constant: 0.0 }; MAX_ELLIPSES];
        let lobes = &mut lobes[..belief.shape.len()];
        self.digest(&belief.shape, lobes)?;
        let level = clutter_level(&belief.rate, belief.clutter.as_ref());
        let (mut time, mut state) = belief.anchor;
        for (to, points) in scans {
            finite(points)?;
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
        for _ in 0..turns {
            bound = self.sweep(&mut belief, lobes)?;
        }
        let states = belief.window.iter().map(|scan| scan.smoothed.law()).collect::<Result<_>>()?;
        Ok(Smoothed { states, shape: belief.shape, bound })
    }
}

fn finite(points: &[[f64; 2]]) -> Result<()> {
    points.iter().flatten().try_for_each(|y| Error::finite("point of a scan", *y).map(drop))
}

/// Log-density of clutter beside which the target's, per point, is `ln sum weight N`: relative rates count.
fn clutter_level(rate: &Rate, clutter: Option<&Clutter>) -> f64 {
    clutter.map_or(f64::NEG_INFINITY, |c| ln(c.rate.mean()) - ln(c.area) - ln(rate.mean()))
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
            anchor: (at, Moments::from(&self.prior)),
            frozen: vec![Sums::default(); count],
            sums: vec![Sums::default(); count],
            window: VecDeque::with_capacity(self.settings.window),
            rate: self.settings.rate,
            clutter: self.settings.clutter,
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
        finite(points)?;
        let log_evidence = self.take(belief, to, ahead, points)?;
        Ok(Update { outcome: Outcome::Updated, log_evidence, particles: None })
    }
}

/// ln p of points about a state's law, each for itself: the centre's uncertainty added to every ellipse.
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
    let at = seen.map(|s| s.value);
    let lobes: Vec<Lobe> = shape.blurred(&spread).ellipses().iter().map(Lobe::of).collect::<Result<_>>()?;
    let score = |y: &[f64; 2]| {
        let logs: Vec<f64> =
            lobes.iter().map(|lobe| lobe.log_density([y[0] - at[0], y[1] - at[1]])).collect();
        log_sum_exp(&logs)
    };
    Ok(points.iter().map(score).sum())
}
