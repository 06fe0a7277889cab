//! The number of ellipses while a target is tracked: split, merge and prune.

use super::super::centre::Centre;
use super::super::shape::{Ellipse, MAX_ELLIPSES, Shape};
use super::super::statistics::{Sums, eigen};
use super::WindowVb;
use super::belief::{ExtendedBelief, Scan};
use super::information::Information;
use super::turns::{NO_LOBE, clutter_level};
use crate::error::{Error, Result};
use crate::kernels::{Shared, share_points};
use crate::math::{Matrix, ln};
use crate::model::Motion;
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_2_PI;

/// How the number of ellipses follows the data. Now and then the last points, about the centres that their scans turned
/// out to have, are explained by the ellipses as they are, with one split or with two merged, and the Bayesian
/// information criterion says which is better. A change must be wanted some looks in a row, and by a margin, before it is
/// made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Number {
    /// Most ellipses, 6 by default.
    pub most: usize,
    /// Points that are kept to look at, 500 by default: a shape that changes must not be judged by its past.
    pub memory: usize,
    /// Scans from one look to the next, 5 by default.
    pub every: u64,
    /// Turns of expectation maximisation that each candidate gets, 30 by default.
    pub turns: usize,
    /// Looks in a row that must want the same change, 2 by default.
    pub agree: u32,
    /// What the criterion, -2 bound + (6 K - 3) ln n for K ellipses and n points, must gain: 6 by default, strong
    /// evidence (Kass and Raftery, JASA 90, 1995).
    pub margin: f64,
    /// An ellipse with less than this share of the points goes, 0.02 by default; where weights are learnt.
    pub least: f64,
}

impl Default for Number {
    fn default() -> Self {
        Number { most: 6, memory: 500, every: 5, turns: 30, agree: 2, margin: 6.0, least: 0.02 }
    }
}

impl Number {
    pub(super) fn check(&self) -> Result<()> {
        Error::positive("most ellipses", self.most as f64)?;
        Error::positive("scans between looks at the number of ellipses", self.every as f64)?;
        Error::positive("points to judge the number of ellipses by", self.memory as f64)?;
        Error::positive("turns of a look at the number of ellipses", self.turns as f64)?;
        Error::not_negative("margin of the number of ellipses", self.margin)?;
        Error::not_negative("least share of an ellipse", self.least)?;
        if self.most > MAX_ELLIPSES {
            let needs = "it must lie between 1 and 16";
            return Err(Error::OutOfRange { what: "most ellipses", value: self.most as f64, needs });
        }
        Ok(())
    }
}

/// What the looks so far have wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Wish {
    /// Scans since the last look.
    pub since: u64,
    /// More ellipses, or fewer.
    pub more: bool,
    /// Looks in a row that wanted that.
    pub looks: u32,
}

/// Points of scans that have left the window, in the directions of the body about its centre: x and y.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Memory(pub [Vec<f64>; 2]);

impl Memory {
    /// Takes in more, and forgets the oldest beyond `most`.
    pub fn take<const N: usize>(&mut self, scan: &Scan<N>, most: usize) {
        for [x, y] in scan.in_body() {
            self.0[0].push(x);
            self.0[1].push(y);
        }
        let old = self.0[0].len().saturating_sub(most);
        for column in &mut self.0 {
            column.drain(..old);
        }
    }
}

/// Shapes that could be instead: one ellipse split along an axis, or two in one; the mean and covariance of all points
/// stay.
fn neighbours(shape: &Shape, most: usize) -> Result<Vec<Shape>> {
    let mut all = Vec::new();
    let count = shape.len();
    for at in (0..count).filter(|_| count < most) {
        let Ellipse { weight, offset, extent } = shape.ellipses()[at];
        let ([large, small], [c, s]) = eigen(&extent);
        for (value, axis) in [(large, [c, s]), (small, [-s, c])] {
            // Halves of a normal law: their means lie sqrt(2 / pi) standard deviations off.
            let by = axis.map(|a| a * (FRAC_2_PI * value).sqrt());
            let half = |sign: f64| Ellipse {
                weight: 0.5 * weight,
                offset: [offset[0] + sign * by[0], offset[1] + sign * by[1]],
                extent: extent - Matrix::outer(&by, &by),
            };
            let mut ellipses = shape.ellipses().to_vec();
            ellipses[at] = half(1.0);
            ellipses.push(half(-1.0));
            all.push(Shape::new(ellipses)?);
        }
    }
    for b in 1..count {
        for a in 0..b {
            let mut ellipses = shape.ellipses().to_vec();
            let (p, q) = (ellipses[a], ellipses.remove(b));
            let weight = p.weight + q.weight;
            // Ellipses without any weight count alike.
            let share = if weight > 0.0 { q.weight / weight } else { 0.5 };
            let d = [q.offset[0] - p.offset[0], q.offset[1] - p.offset[1]];
            let between = Matrix::outer(&d, &d) * (share * (1.0 - share));
            ellipses[a] = Ellipse {
                weight,
                offset: [p.offset[0] + share * d[0], p.offset[1] + share * d[1]],
                extent: p.extent * (1.0 - share) + q.extent * share + between,
            };
            all.push(Shape::new(ellipses)?);
        }
    }
    Ok(all)
}

impl<A, C, const N: usize, const W: usize> WindowVb<A, C, N, W>
where
    A: Motion<N, W>,
    C: Centre<N>,
{
    /// The number of ellipses, looked at when it is time to.
    pub(super) fn reconsider(&self, belief: &mut ExtendedBelief<N>, number: &Number) -> Result<()> {
        belief.wish.since += 1;
        if belief.wish.since < number.every {
            return Ok(());
        }
        belief.wish.since = 0;
        let mut points = belief.memory.clone();
        for scan in &belief.window {
            points.take(scan, usize::MAX);
        }
        // Fewer points than numbers to learn say nothing of how many there are.
        let count = points.0[0].len();
        if count <= 6 * belief.shape.len() {
            return Ok(());
        }
        let level = clutter_level(&belief.rate, belief.clutter.as_ref());
        let criterion = |shape: &Shape| -> Result<(f64, Shape)> {
            let (bound, learnt) = self.explain(&points, shape, number.turns, level)?;
            Ok(((6 * shape.len() - 3) as f64 * ln(count as f64) - 2.0 * bound, learnt))
        };
        let (now, same) = criterion(&belief.shape)?;
        let lightest = same.ellipses().iter().map(|e| e.weight).fold(1.0, f64::min);
        // One that has hardly any points goes whatever the criterion says.
        let needed =
            if self.settings.m_step.weights && lightest < number.least { 0.0 } else { number.margin };
        let mut best: Option<(f64, Shape)> = None;
        for shape in neighbours(&belief.shape, number.most)? {
            let found = criterion(&shape)?;
            if found.0 < best.as_ref().map_or(now - needed, |(least, _)| *least) {
                best = Some(found);
            }
        }
        let wish = &mut belief.wish;
        let Some((_, shape)) = best else {
            wish.looks = 0;
            return Ok(());
        };
        let more = shape.len() > belief.shape.len();
        wish.looks = if wish.more == more { wish.looks + 1 } else { 1 };
        wish.more = more;
        if wish.looks >= number.agree {
            wish.looks = 0;
            self.become_of(belief, shape, level)?;
        }
        Ok(())
    }

    /// The shape that `turns` of expectation maximisation make of one for points about known centres, and the
    /// log-density of the points under it.
    fn explain(&self, points: &Memory, first: &Shape, turns: usize, level: f64) -> Result<(f64, Shape)> {
        let (mut shape, mut bound) = (first.clone(), f64::NEG_INFINITY);
        for _ in 0..turns {
            let (log, sums) = self.shared(points, &shape, level)?;
            bound = log;
            shape = self.settings.m_step.shape(&sums, first, &self.settings.noise)?;
        }
        Ok((bound, shape))
    }

    /// Points shared among the ellipses of a shape: their log-density, and what they say of each.
    fn shared(&self, points: &Memory, shape: &Shape, level: f64) -> Result<(f64, Vec<Sums>)> {
        let mut lobes = vec![NO_LOBE; shape.len()];
        self.digest(shape, &mut lobes)?;
        let mut shared = vec![Shared::default(); shape.len()];
        let [x, y] = &points.0;
        let bound = share_points(self.simd, [x, y], &lobes, level, &mut shared);
        let sums = |[n, x, y, xx, xy, yy]: Shared| Sums { count: n, first: [x, y], second: [xx, xy, yy] };
        Ok((bound, shared.into_iter().map(sums).collect()))
    }

    /// Goes on with another shape, known by the points that are remembered.
    fn become_of(&self, belief: &mut ExtendedBelief<N>, shape: Shape, level: f64) -> Result<()> {
        belief.frozen = self.shared(&belief.memory, &shape, level)?.1;
        // What the first shape says of an ellipse is a small prior: new ones have themselves.
        (belief.first, belief.shape) = (shape.clone(), shape);
        let mut lobes = [NO_LOBE; MAX_ELLIPSES];
        let lobes = &mut lobes[..belief.shape.len()];
        self.digest(&belief.shape, lobes)?;
        belief.information = Information::new(lobes.len());
        let [x, y] = &belief.memory.0;
        x.iter().zip(y).for_each(|(x, y)| belief.information.take([*x, *y], lobes, level));
        self.share_again(belief)?;
        for turn in 0..self.settings.sweeps {
            self.sweep(belief, lobes, turn == 0)?;
        }
        Ok(())
    }
}
