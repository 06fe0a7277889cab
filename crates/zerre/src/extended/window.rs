//! Variational expectation maximisation over a window of scans.

use super::rate::Rate;
use super::shape::{Lobe, MAX_ELLIPSES, Shape, log_sum_exp};
use super::statistics::{MStep, Sums, negentropy};
use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::filter::{Filter, Outcome, Tangent, Transform, Update, predict_law};
use crate::math::{Cholesky, Dual, Matrix, Real, exp, ln};
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
}

/// What a [`WindowVb`] knows.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtendedBelief<const N: usize> {
    time: Time,
    state: Gaussian<N>,
    shape: Shape,
    /// Where the window starts from.
    anchor: (Time, Gaussian<N>),
    frozen: Vec<Sums>,
    sums: Vec<Sums>,
    window: VecDeque<Scan<N>>,
    rate: Rate,
    clutter: Option<Clutter>,
}

#[derive(Clone, Debug, PartialEq)]
struct Scan<const N: usize> {
    time: Time,
    points: Vec<[f64; 2]>,
    /// Point after point, share after share.
    shares: Vec<f64>,
    filtered: Gaussian<N>,
    smoothed: Gaussian<N>,
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
        Ok(WindowVb { motion, centre, prior, shape, settings })
    }

    /// The centre of a state's law, by the tangent: mean, covariance and slope.
    fn seen(&self, state: &Gaussian<N>) -> ([f64; 2], Matrix<2, 2>, Matrix<2, N>) {
        let seen = self.centre.at(Dual::<N>::variables(*state.mean()));
        let slope = Matrix(seen.map(|s| s.gradient));
        (seen.map(|s| s.value), slope.congruence(state.covariance()), slope)
    }

    /// Shares of the points among the lobes: q ~ weight exp E ln N(y; h(x) + offset, X), what is left being
    /// clutter.
    fn share(
        &self,
        points: &[[f64; 2]],
        lobes: &[Lobe],
        state: &Gaussian<N>,
        clutter: f64,
        shares: &mut [f64],
    ) {
        let (centre, spread, _) = self.seen(state);
        let count = lobes.len();
        let blur: [f64; MAX_ELLIPSES] = from_fn(|l| {
            lobes.get(l).map_or(0.0, |lobe| {
                let j = lobe.information();
                -0.5 * (j.0[0][0] * spread.0[0][0]
                    + 2.0 * j.0[0][1] * spread.0[0][1]
                    + j.0[1][1] * spread.0[1][1])
            })
        });
        for (y, shares) in points.iter().zip(shares.chunks_exact_mut(count)) {
            let d = [y[0] - centre[0], y[1] - centre[1]];
            let mut most = clutter;
            for (l, lobe) in lobes.iter().enumerate() {
                shares[l] = lobe.log_density(d) + blur[l];
                most = most.max(shares[l]);
            }
            let mut sum = exp(clutter - most);
            for share in shares.iter_mut() {
                *share = exp(*share - most);
                sum += *share;
            }
            shares.iter_mut().for_each(|share| *share /= sum);
        }
    }

    /// The law of a state before the scan, `ahead`, after points shared so: each ellipse is measured by the points that
    /// it has.
    fn update(
        &self,
        ahead: &Gaussian<N>,
        points: &[[f64; 2]],
        lobes: &[Lobe],
        shares: &[f64],
    ) -> Result<Gaussian<N>> {
        let count = lobes.len();
        let mut information = Matrix::<2, 2>::ZERO;
        let mut vector = [0.0; 2];
        for (l, lobe) in lobes.iter().enumerate() {
            let (mut n, mut sum) = (0.0, [0.0; 2]);
            for (y, shares) in points.iter().zip(shares.chunks_exact(count)) {
                n += shares[l];
                sum[0] = shares[l].mul_add(y[0] - lobe.offset[0], sum[0]);
                sum[1] = shares[l].mul_add(y[1] - lobe.offset[1], sum[1]);
            }
            let j = lobe.information();
            information = information + j * n;
            let add = j * sum;
            vector = [vector[0] + add[0], vector[1] + add[1]];
        }
        // Too little to say anything: a scan without points of the target.
        if information.max_abs() < 1e-12 {
            return Ok(*ahead);
        }
        let noise = Cholesky::of("information of a scan", &information)?.inverse();
        let z = noise * vector;
        let (centre, spread, slope) = self.seen(ahead);
        let gain = Cholesky::of("innovation covariance", &(spread + noise).symmetrised())?
            .solve_matrix(&(slope * *ahead.covariance()))
            .transpose();
        let correction = gain * [z[0] - centre[0], z[1] - centre[1]];
        let mean = from_fn(|i| ahead.mean()[i] + correction[i]);
        let kept = (Matrix::identity() - gain * slope).congruence(ahead.covariance());
        Gaussian::computed("mean", "covariance", mean, (kept + gain.congruence(&noise)).symmetrised())
    }
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
            anchor: (at, self.prior),
            frozen: vec![Sums::default(); count],
            sums: vec![Sums::default(); count],
            window: VecDeque::with_capacity(self.settings.window),
            rate: self.settings.rate,
            clutter: self.settings.clutter,
        })
    }

    fn step(&self, belief: &mut ExtendedBelief<N>, to: Time, scan: Option<&Vec<[f64; 2]>>) -> Result<Update> {
        let ahead = predict_law(&Tangent, &self.motion, &belief.state, belief.time, to)?;
        let Some(points) = scan else {
            (belief.time, belief.state) = (to, ahead);
            return Ok(Update { outcome: Outcome::Predicted, log_evidence: 0.0, particles: None });
        };
        for y in points.iter().flatten() {
            Error::finite("point of a scan", *y)?;
        }
        let mut next = belief.clone();
        let log_evidence = self.take(&mut next, to, ahead, points)?;
        *belief = next;
        Ok(Update { outcome: Outcome::Updated, log_evidence, particles: None })
    }
}

impl<A, C, const N: usize, const W: usize> WindowVb<A, C, N, W>
where
    A: Motion<N, W>,
    C: Centre<N>,
{
    /// Takes in a scan; the variational bound on its log-density given those before, the number of points given.
    fn take(
        &self,
        belief: &mut ExtendedBelief<N>,
        to: Time,
        ahead: Gaussian<N>,
        points: &[[f64; 2]],
    ) -> Result<f64> {
        let count = belief.shape.len();
        let mut lobes = self.lobes(&belief.shape)?;
        let mut level = clutter_level(&belief.rate, belief.clutter.as_ref());
        let mut scan = Scan {
            time: to,
            points: points.to_vec(),
            shares: vec![0.0; points.len() * count],
            filtered: ahead,
            smoothed: ahead,
        };
        // The new scan alone, under the shape that it finds.
        for _ in 0..self.settings.sweeps {
            self.share(points, &lobes, &scan.smoothed, level, &mut scan.shares);
            scan.smoothed = self.update(&ahead, points, &lobes, &scan.shares)?;
        }
        let bound = self.bound(&ahead, &scan, &lobes, level)?;
        belief.rate.predict();
        if let Some(clutter) = belief.clutter.as_mut().filter(|c| c.learnt) {
            clutter.rate.predict();
        }
        if belief.window.len() == self.settings.window {
            self.freeze(belief);
        }
        belief.window.push_back(scan);
        for _ in 0..self.settings.sweeps {
            self.smooth(belief, &lobes)?;
            belief.sums.clone_from(&belief.frozen);
            for scan in &belief.window {
                self.collect(scan, count, &mut belief.sums);
            }
            belief.shape = self.settings.m_step.shape(&belief.sums, &self.shape, &self.settings.noise)?;
            lobes = self.lobes(&belief.shape)?;
            level = clutter_level(&belief.rate, belief.clutter.as_ref());
            for scan in &mut belief.window {
                self.share(&scan.points, &lobes, &scan.smoothed, level, &mut scan.shares);
            }
        }
        let last = belief.window.back().map(|scan| (scan.smoothed, scan.shares.iter().sum::<f64>()));
        if let Some((state, of_target)) = last {
            belief.state = state;
            belief.rate.update(of_target);
            if let Some(clutter) = belief.clutter.as_mut().filter(|c| c.learnt) {
                clutter.rate.update((points.len() as f64 - of_target).max(0.0));
            }
        }
        belief.time = to;
        Ok(bound)
    }

    fn lobes(&self, shape: &Shape) -> Result<Vec<Lobe>> {
        shape.blurred(&self.settings.noise).ellipses().iter().map(Lobe::of).collect()
    }

    /// The oldest scan leaves its statistics to the shape and its state to the start of the window.
    fn freeze(&self, belief: &mut ExtendedBelief<N>) {
        let Some(scan) = belief.window.pop_front() else { return };
        belief.frozen.iter_mut().for_each(|sums| {
            let old = *sums;
            sums.blend(self.settings.keep, 0.0, &old);
        });
        self.collect(&scan, belief.shape.len(), &mut belief.frozen);
        belief.anchor = (scan.time, scan.filtered);
    }

    /// Adds the statistics of a scan.
    fn collect(&self, scan: &Scan<N>, count: usize, sums: &mut [Sums]) {
        let (centre, spread, _) = self.seen(&scan.smoothed);
        for (y, shares) in scan.points.iter().zip(scan.shares.chunks_exact(count)) {
            let d = [y[0] - centre[0], y[1] - centre[1]];
            for (sums, share) in sums.iter_mut().zip(shares) {
                sums.add(*share, d, &spread);
            }
        }
    }

    /// The path through the window under the shares of its points.
    fn smooth(&self, belief: &mut ExtendedBelief<N>, lobes: &[Lobe]) -> Result<()> {
        let (mut time, mut state) = belief.anchor;
        let mut joints = Vec::with_capacity(belief.window.len());
        for scan in &mut belief.window {
            let before = state;
            let joint = if scan.time > time {
                let step = self.motion.over(time, scan.time)?;
                let joint = Tangent.propagate_joint(&self.motion, &step, &state)?;
                state = *joint.law();
                Some(joint)
            } else {
                None
            };
            joints.push((before, joint));
            state = self.update(&state, &scan.points, lobes, &scan.shares)?;
            (scan.filtered, scan.smoothed, time) = (state, state, scan.time);
        }
        for k in (1..belief.window.len()).rev() {
            let after = belief.window[k].smoothed;
            let (now, joint) = &joints[k];
            belief.window[k - 1].smoothed = match joint {
                Some(joint) => joint.condition(now, &after)?,
                None => after,
            };
        }
        Ok(())
    }

    /// The variational bound on ln p of a scan's points.
    fn bound(&self, ahead: &Gaussian<N>, scan: &Scan<N>, lobes: &[Lobe], level: f64) -> Result<f64> {
        let (centre, spread, _) = self.seen(&scan.smoothed);
        let count = lobes.len();
        let mut bound = 0.0;
        for (y, shares) in scan.points.iter().zip(scan.shares.chunks_exact(count)) {
            let d = [y[0] - centre[0], y[1] - centre[1]];
            let mut rest = 1.0;
            for (lobe, share) in lobes.iter().zip(shares) {
                let j = lobe.information();
                let blur = j.0[0][0] * spread.0[0][0]
                    + 2.0 * j.0[0][1] * spread.0[0][1]
                    + j.0[1][1] * spread.0[1][1];
                bound += share * (lobe.log_density(d) - 0.5 * blur);
                rest -= share;
            }
            bound -= negentropy(shares);
            if level > f64::NEG_INFINITY && rest > 1e-15 {
                bound += rest * (level - ln(rest));
            }
        }
        Ok(bound - divergence(&scan.smoothed, ahead)?)
    }
}

/// KL(p || q) of normal laws.
fn divergence<const N: usize>(p: &Gaussian<N>, q: &Gaussian<N>) -> Result<f64> {
    let of_q = Cholesky::of("predicted covariance", q.covariance())?;
    let of_p = Cholesky::of("covariance", p.covariance())?;
    let d = from_fn(|i| p.mean()[i] - q.mean()[i]);
    let ratio = of_q.solve_matrix(p.covariance());
    let trace: f64 = ratio.diagonal().iter().sum();
    Ok(0.5 * (trace + of_q.mahalanobis_squared(&d) - N as f64 + of_q.log_det() - of_p.log_det()))
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
