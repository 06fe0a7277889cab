//! The turns between path and shape.

use super::super::centre::Centre;
use super::super::path::{Leap, Moments, POSE, Pose, Said};
use super::super::rate::Rate;
use super::super::shape::{Ellipse, Lobe, MAX_ELLIPSES, Shape};
use super::super::statistics::Sums;
use super::belief::{ExtendedBelief, Scan};
use super::{Clutter, WindowVb};
use crate::error::Result;
use crate::filter::MotionTangent;
use crate::kernels;
use crate::math::{Dual, Matrix, exp, ln};
use crate::model::Motion;
use crate::time::Time;
use std::array::from_fn;

/// No ellipse.
pub(super) const NO_LOBE: Lobe = Lobe { offset: [0.0; 2], root: [0.0; 3], constant: 0.0 };

/// A quarter turn of a vector.
fn quarter([x, y]: [f64; 2]) -> [f64; 2] {
    [-y, x]
}

/// What a point of an ellipse says of the pose on average, in the directions of the body: the inverse extent J for the
/// centre, J K m beside it and (K m)' J K m + (a/b + b/a - 2) for the heading, m being the offset, K a quarter turn,
/// a and b the eigenvalues of the extent (its Fisher information).
fn of_heading(lobe: &Lobe, j: &Matrix<2, 2>) -> ([f64; 2], f64) {
    let k = quarter(lobe.offset);
    let across = *j * k;
    let (trace, det) = (j.0[0][0] + j.0[1][1], j.0[0][0] * j.0[1][1] - j.0[0][1] * j.0[0][1]);
    (across, across[0] * k[0] + across[1] * k[1] + (trace * trace / det - 4.0).max(0.0))
}

/// A turn by an angle.
pub(super) fn turn(angle: f64) -> Matrix<2, 2> {
    let (sin, cos) = crate::math::sin_cos(angle);
    Matrix([[cos, -sin], [sin, cos]])
}

/// Log-density of clutter beside which the target's, per point, is `ln sum weight N`: relative rates count.
pub(super) fn clutter_level(rate: &Rate, clutter: Option<&Clutter>) -> f64 {
    clutter.map_or(f64::NEG_INFINITY, |c| ln(c.rate.mean()) - ln(c.area) - ln(rate.mean()))
}

/// Takes a scan into the rates of the target and of others.
fn learn(rates: &mut [Rate; 2], counts: [f64; 2]) {
    for (rate, count) in rates.iter_mut().zip(counts) {
        rate.predict();
        rate.update(count);
    }
}

impl<A, C, const N: usize, const W: usize> WindowVb<A, C, N, W>
where
    A: Motion<N, W>,
    C: Centre<N>,
{
    pub(super) fn pose(&self, state: &Moments<N>) -> Pose<N> {
        let variables = Dual::<N>::variables(state.mean);
        let [x, y] = self.centre.at(variables);
        let mut at = [x.value, y.value, 0.0];
        let mut slope = Matrix([x.gradient, y.gradient, [0.0; N]]);
        if C::TURNS {
            let heading = self.centre.heading(variables);
            if heading.value.is_finite() && heading.gradient.iter().all(|g| g.is_finite()) {
                (at[2], slope.0[2]) = (heading.value, heading.gradient);
            }
        }
        let mut pose = Pose { mean: state.mean, at, slope, spread: Matrix::ZERO };
        if C::TURNS {
            // No angle is known to less than about a turn, however steep it is.
            let variance = pose.spread_of::<POSE>(state).1[2][2];
            if variance > 1.0 {
                let scale = 1.0 / variance.sqrt();
                pose.slope.0[2].iter_mut().for_each(|s| *s *= scale);
            }
            pose.spread = Matrix(pose.spread_of::<POSE>(state).1);
        } else {
            pose.spread = Matrix(pose.spread_of::<2>(state).1);
        }
        pose
    }

    pub(super) fn leap(&self, from: Time, to: Time, state: &Moments<N>) -> Result<Option<Leap<N>>> {
        if from == to {
            return Ok(None);
        }
        let step = self.motion.over(from, to)?;
        let noise = self.motion.noise();
        let tangent = MotionTangent::<N, W>::at::<A>(&step, &state.mean, &[noise.mean(); W]);
        Ok(Some(Leap {
            at: state.mean,
            value: tangent.value,
            slope: tangent.by_state,
            noise: tangent.noise_covariance(noise.variance()),
        }))
    }

    /// Shares the points of a scan among the lobes about where its smoothed state is: q ~ weight exp E ln N(y; h(x) + offset, X),
    /// what is left being clutter. The sum of the logarithms of what the shares were scaled by is the bound on the
    /// points' log-density but for the divergence of the state.
    pub(super) fn share(&self, scan: &mut Scan<N>, lobes: &[Lobe], level: f64) -> f64 {
        let seen = scan.now;
        let turned = if C::TURNS { turn(seen.at[2]) } else { Matrix::identity() };
        let mut there = [NO_LOBE; MAX_ELLIPSES];
        for (there, lobe) in there.iter_mut().zip(lobes) {
            *there = *lobe;
            let mut j = lobe.information();
            let mut blur = 0.0;
            if C::TURNS {
                let (across, own) = of_heading(lobe, &j);
                let across = turned * across;
                blur = 2.0 * (across[0] * seen.spread.0[0][2] + across[1] * seen.spread.0[1][2])
                    + own * seen.spread.0[2][2];
                j = turned.congruence(&j);
                there.offset = turned * lobe.offset;
                let last = j.0[1][1].sqrt();
                let cross = j.0[0][1] / last;
                there.root = [(j.0[0][0] - cross * cross).max(0.0).sqrt(), cross, last];
            }
            blur += j.0[0][0] * seen.spread.0[0][0]
                + 2.0 * j.0[0][1] * seen.spread.0[0][1]
                + j.0[1][1] * seen.spread.0[1][1];
            there.offset = from_fn(|k| there.offset[k] + seen.at[k]);
            there.constant -= 0.5 * blur;
        }
        let mut shared = [kernels::Shared::default(); MAX_ELLIPSES];
        let [x, y] = &scan.points;
        let count = lobes.len();
        let bound = kernels::share_points(self.simd, [x, y], &there[..count], level, &mut shared[..count]);
        let at = [seen.at[0], seen.at[1]];
        for (of_scan, [n, x, y, xx, xy, yy]) in scan.sums.iter_mut().zip(shared).take(count) {
            let mut sums = Sums { count: n, first: [x, y], second: [xx, xy, yy] }.about(at);
            if C::TURNS {
                sums = sums.turned(&turned.transpose());
            }
            *of_scan = sums;
        }
        scan.seen = seen;
        bound
    }

    /// What the points of a scan say of its pose, as they are shared, about where the shares were taken. Each ellipse
    /// is measured by the points that it has.
    pub(super) fn measured(&self, scan: &Scan<N>, lobes: &[Lobe]) -> Said {
        let mut said = Said::NOTHING;
        let (mut total, mut vector, mut side) = (Matrix::<2, 2>::ZERO, [0.0; 2], [0.0; 2]);
        for (lobe, sums) in lobes.iter().zip(&scan.sums) {
            let j = lobe.information();
            total = total + j * sums.count;
            let rest: [f64; 2] = from_fn(|k| sums.first[k] - sums.count * lobe.offset[k]);
            vector[0] += j.0[0][0] * rest[0] + j.0[0][1] * rest[1];
            vector[1] += j.0[1][0] * rest[0] + j.0[1][1] * rest[1];
            if C::TURNS {
                let (across, own) = of_heading(lobe, &j);
                side = from_fn(|k| side[k] + sums.count * across[k]);
                said.information.0[2][2] += sums.count * own;
                // sum q (K d)' J (d - m), d about the centre.
                let [xx, xy, yy] = sums.second;
                let (s, m) = (quarter(sums.first), lobe.offset);
                let moment = [[-xy - m[0] * s[0], xx - m[0] * s[1]], [-yy - m[1] * s[0], xy - m[1] * s[1]]];
                for a in 0..2 {
                    for b in 0..2 {
                        said.vector[2] += j.0[a][b] * moment[a][b];
                    }
                }
            }
        }
        if C::TURNS {
            let turned = turn(scan.seen.at[2]);
            (total, vector, side) = (turned.congruence(&total), turned * vector, turned * side);
        }
        for p in 0..2 {
            for q in 0..2 {
                said.information.0[p][q] = total.0[p][q];
            }
            (said.information.0[p][2], said.information.0[2][p]) = (side[p], side[p]);
            said.vector[p] = vector[p];
        }
        said
    }

    /// The law of a state after what points say, and the logarithm of the mean of that.
    pub(super) fn given(&self, ahead: &Moments<N>, scan: &Scan<N>, said: &Said) -> (Moments<N>, f64) {
        let from = &scan.seen;
        if C::TURNS { ahead.given::<POSE>(from, said) } else { ahead.given::<2>(from, said) }
    }

    /// What the points of a scan say, on average over a state's law.
    pub(super) fn expected(&self, state: &Moments<N>, scan: &Scan<N>, said: &Said) -> f64 {
        let from = &scan.seen;
        if C::TURNS { said.expected::<POSE, N>(from, state) } else { said.expected::<2, N>(from, state) }
    }

    /// The path through the window under the shares of its points; returns the divergence of its law from that
    /// before the points. The motion is linearised where it is `anew`.
    fn smooth(&self, belief: &mut ExtendedBelief<N>, lobes: &[Lobe], anew: bool) -> Result<f64> {
        let (mut time, mut state) = belief.anchor;
        let mut divergence = 0.0;
        for scan in &mut belief.window {
            if anew {
                scan.leap = self.leap(time, scan.time, &state)?;
            }
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
        for scan in &mut belief.window {
            divergence += self.expected(&scan.smoothed, scan, &scan.said);
            scan.now = self.pose(&scan.smoothed);
        }
        Ok(divergence)
    }

    /// Adds what a scan says of the shape to `keep` times what is there, moved from where its points were shared to
    /// where the state is now.
    pub(super) fn collect(&self, scan: &Scan<N>, keep: f64, all: &mut [Sums]) {
        let (pose, seen) = (&scan.now, &scan.seen);
        let mut by = [pose.at[0] - seen.at[0], pose.at[1] - seen.at[1]];
        let mut spread =
            Matrix([[pose.spread.0[0][0], pose.spread.0[0][1]], [pose.spread.0[1][0], pose.spread.0[1][1]]]);
        if C::TURNS {
            by = turn(-seen.at[2]) * by;
            spread = turn(-pose.at[2]).congruence(&spread);
        }
        for (all, sums) in all.iter_mut().zip(&scan.sums) {
            let mut moved = sums.about(by);
            if C::TURNS {
                moved = moved.turned(&turn(seen.at[2] - pose.at[2]));
                let across = turn(-pose.at[2]) * [pose.spread.0[0][2], pose.spread.0[1][2]];
                moved = moved.spun(pose.spread.0[2][2], across);
            }
            moved.add(moved.count, [0.0; 2], &spread);
            // Its points have been counted already.
            moved.count = sums.count;
            all.blend(keep, 1.0, &moved);
        }
    }

    /// Shares the points in the window among the ellipses as they are now.
    pub(super) fn share_again(&self, belief: &mut ExtendedBelief<N>) -> Result<()> {
        let mut lobes = [NO_LOBE; MAX_ELLIPSES];
        let lobes = &mut lobes[..belief.shape.len()];
        self.digest(&belief.shape, lobes)?;
        let level = clutter_level(&belief.rate, belief.clutter.as_ref());
        for scan in &mut belief.window {
            scan.sums = [Sums::default(); MAX_ELLIPSES];
            self.share(scan, lobes, level);
        }
        Ok(())
    }

    /// One turn: the path under the shares, the shape under the path, the shares under both. Returns the bound on
    /// the log-density of the points in the window, their numbers given.
    pub(super) fn sweep(
        &self,
        belief: &mut ExtendedBelief<N>,
        lobes: &mut [Lobe],
        anew: bool,
    ) -> Result<f64> {
        let divergence = self.smooth(belief, lobes, anew)?;
        belief.sums.clone_from(&belief.frozen);
        for scan in &belief.window {
            self.collect(scan, 1.0, &mut belief.sums);
        }
        let settings = &self.settings;
        belief.shape = settings.m_step.shape(&belief.sums, &belief.first, &settings.noise)?;
        self.digest(&belief.shape, lobes)?;
        let level = clutter_level(&belief.rate, belief.clutter.as_ref());
        let mut bound = -divergence;
        for scan in &mut belief.window {
            bound += self.share(scan, lobes, level);
        }
        let mut rates = belief.frozen_rates;
        for scan in &belief.window {
            learn(&mut rates, scan.counts());
        }
        belief.rate = rates[0];
        if let Some(clutter) = belief.clutter.as_mut().filter(|c| c.learnt) {
            clutter.rate = rates[1];
        }
        Ok(bound)
    }

    pub(super) fn digest(&self, shape: &Shape, lobes: &mut [Lobe]) -> Result<()> {
        for (place, ellipse) in lobes.iter_mut().zip(shape.ellipses()) {
            *place = Lobe::of(&Ellipse { extent: ellipse.extent + self.settings.noise, ..*ellipse })?;
        }
        Ok(())
    }

    /// A scan as it enters, shared by turns with its state alone, under the shape that it finds; and the variational
    /// bound on the log-density of its points given those before and their number.
    pub(super) fn enter(
        &self,
        (time, ahead, points): (Time, Moments<N>, &[[f64; 2]]),
        lobes: &[Lobe],
        level: f64,
    ) -> (Scan<N>, f64) {
        let now = self.pose(&ahead);
        let mut scan = Scan {
            time,
            points: from_fn(|k| points.iter().map(|y| y[k]).collect()),
            seen: now,
            now,
            sums: [Sums::default(); MAX_ELLIPSES],
            filtered: ahead,
            smoothed: ahead,
            ahead,
            leap: None,
            said: Said::NOTHING,
        };
        let mut bound = self.share(&mut scan, lobes, level);
        if points.is_empty() {
            return (scan, 0.0);
        }
        for _ in 0..self.settings.sweeps {
            let said = self.measured(&scan, lobes);
            let (state, log_mean) = self.given(&ahead, &scan, &said);
            let divergence = self.expected(&state, &scan, &said) - log_mean;
            (scan.smoothed, scan.now) = (state, self.pose(&state));
            bound = self.share(&mut scan, lobes, level) - divergence;
        }
        (scan, bound)
    }

    /// The oldest scan leaves its statistics to the shape and its state to the start of the window.
    pub(super) fn freeze(&self, belief: &mut ExtendedBelief<N>, lobes: &[Lobe], level: f64) {
        let Some(scan) = belief.window.pop_front() else { return };
        belief.information.keep(self.settings.keep);
        scan.in_body().for_each(|d| belief.information.take(d, lobes, level));
        self.collect(&scan, self.settings.keep, &mut belief.frozen);
        learn(&mut belief.frozen_rates, scan.counts());
        if let Some(number) = &self.settings.number {
            belief.memory.take(&scan, number.memory);
        }
        (belief.anchor, belief.has_frozen) = ((scan.time, scan.filtered), true);
    }
}

impl Sums {
    /// The sums of the same points in directions that are turned.
    #[must_use]
    pub(super) fn turned(&self, by: &Matrix<2, 2>) -> Sums {
        let [xx, xy, yy] = self.second;
        let second = by.congruence(&Matrix([[xx, xy], [xy, yy]])).0;
        Sums {
            count: self.count,
            first: *by * self.first,
            second: [second[0][0], second[0][1], second[1][1]],
        }
    }

    /// Their mean over a normal angle of this `variance`, which has the covariance `across` with the centre.
    #[must_use]
    pub(super) fn spun(&self, variance: f64, across: [f64; 2]) -> Sums {
        let (short, mix) = (exp(-0.5 * variance), 0.5 * (1.0 - exp(-2.0 * variance)));
        let ([xx, xy, yy], k) = (self.second, quarter(self.first));
        let second = [
            xx + mix * (yy - xx) + 2.0 * k[0] * across[0],
            xy - 2.0 * mix * xy + k[0] * across[1] + k[1] * across[0],
            yy + mix * (xx - yy) + 2.0 * k[1] * across[1],
        ];
        Sums { count: self.count, first: self.first.map(|x| short * x), second }
    }
}
