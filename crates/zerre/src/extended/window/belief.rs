//! What the window filter knows.

use super::super::inverse_wishart::{InverseWishart, SemiAxis};
use super::super::path::{Leap, Moments, Pose, Said};
use super::super::rate::Rate;
use super::super::shape::{MAX_ELLIPSES, Shape};
use super::super::statistics::{Sums, eigen};
use super::Clutter;
use super::number::{Memory, Wish};
use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::math::Matrix;
use crate::time::Time;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// What a [`WindowVb`](super::WindowVb) knows. It can be saved: what is loaded goes on to the same bits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parts<N>")]
pub struct ExtendedBelief<const N: usize> {
    pub(super) time: Time,
    pub(super) state: Gaussian<N>,
    pub(super) shape: Shape,
    /// What the ellipses begin with: a part of the prior of each.
    pub(super) first: Shape,
    /// Where the window starts from.
    pub(super) anchor: (Time, Moments<N>),
    /// Statistics of scans that have left the window; none have while this is false.
    pub(super) has_frozen: bool,
    pub(super) frozen: Vec<Evidence>,
    /// Those with the window's.
    pub(super) evidence: Vec<Evidence>,
    pub(super) window: VecDeque<Scan<N>>,
    /// Rates of the target's points and of others before the window.
    pub(super) frozen_rates: [Rate; 2],
    pub(super) rate: Rate,
    pub(super) clutter: Option<Clutter>,
    /// Points before the window; none where the number of ellipses stays.
    pub(super) memory: Memory,
    pub(super) wish: Wish,
}

/// What is read before it is checked.
#[derive(Deserialize)]
struct Parts<const N: usize> {
    time: Time,
    state: Gaussian<N>,
    shape: Shape,
    first: Shape,
    anchor: (Time, Moments<N>),
    has_frozen: bool,
    frozen: Vec<Evidence>,
    evidence: Vec<Evidence>,
    window: VecDeque<Scan<N>>,
    frozen_rates: [Rate; 2],
    rate: Rate,
    clutter: Option<Clutter>,
    memory: Memory,
    wish: Wish,
}

impl<const N: usize> TryFrom<Parts<N>> for ExtendedBelief<N> {
    type Error = Error;

    fn try_from(p: Parts<N>) -> Result<Self> {
        let count = p.shape.len();
        let whole = |scan: &Scan<N>| scan.points[0].len() == scan.points[1].len();
        if [p.first.len(), p.frozen.len(), p.evidence.len()] != [count; 3]
            || !p.window.iter().all(whole)
            || p.memory.0[0].len() != p.memory.0[1].len()
        {
            return Err(Error::Unsupported(
                "the parts of a saved belief do not belong together: save it anew".into(),
            ));
        }
        Ok(ExtendedBelief {
            time: p.time,
            state: p.state,
            shape: p.shape,
            first: p.first,
            anchor: p.anchor,
            has_frozen: p.has_frozen,
            frozen: p.frozen,
            evidence: p.evidence,
            window: p.window,
            frozen_rates: p.frozen_rates,
            rate: p.rate,
            clutter: p.clutter,
            memory: p.memory,
            wish: p.wish,
        })
    }
}

/// What an ellipse is known by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Sums over the points, each counted by its share.
    pub sums: Sums,
    /// Sum of the squares of the shares: as many points that surely are the ellipse's would say as much of it (Louis,
    /// JRSS B 44, 1982: what is missing is information too).
    pub sure: f64,
    /// Sum over the points of the covariance of their centre, xx, xy, yy, m^2: what they are blurred by.
    pub blur: [f64; 3],
    /// Sum over the scans of the square of their number: points of one scan share the error of their centre.
    pub crowd: f64,
}

impl Evidence {
    /// self <- keep self + other.
    pub(super) fn blend(&mut self, keep: f64, other: &Evidence) {
        self.sums.blend(keep, 1.0, &other.sums);
        self.sure = keep * self.sure + other.sure;
        self.crowd = keep * self.crowd + other.crowd;
        for (blur, other) in self.blur.iter_mut().zip(other.blur) {
            *blur = keep * *blur + other;
        }
    }
}

/// A scan in the window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Scan<const N: usize> {
    pub time: Time,
    /// x and y of its points.
    pub points: [Vec<f64>; 2],
    /// Where the shares were taken.
    pub seen: Pose<N>,
    /// Where the smoothed state is.
    pub now: Pose<N>,
    /// What the points said about there, in the directions of the body, ellipse by ellipse.
    pub evidence: [Evidence; MAX_ELLIPSES],
    pub filtered: Moments<N>,
    pub smoothed: Moments<N>,
    /// The prediction for it.
    pub ahead: Moments<N>,
    /// From the scan before; `None` where no time has passed.
    pub leap: Option<Leap<N>>,
    /// What its points said of the pose when the path was last smoothed.
    pub said: Said,
}

impl<const N: usize> Scan<N> {
    /// What the target and others have of the points.
    pub fn counts(&self) -> [f64; 2] {
        let of_target = self.evidence.iter().map(|evidence| evidence.sums.count).sum::<f64>();
        [of_target, (self.points[0].len() as f64 - of_target).max(0.0)]
    }
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

    /// The shape about the centre, as it lies when the heading is zero. How it lies now says
    /// [`WindowVb::placed`](super::WindowVb::placed).
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// What each ellipse is known by.
    pub fn evidence(&self) -> &[Evidence] {
        &self.evidence
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

/// What is known of the extent of an ellipse: along every direction the inverse-Wishart law that as many points would
/// leave as say as much of it. Points of which it is not sure whose they are, and whose centre is not known, say less
/// (Louis, JRSS B 44, 1982).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    mode: Matrix<2, 2>,
    evidence: Evidence,
    prior: f64,
}

impl Extent {
    /// Along a direction: the variance has there the law of `u'Xu`.
    fn along(&self, direction: [f64; 2]) -> Result<InverseWishart> {
        let Evidence { sums, sure, blur: [xx, xy, yy], crowd } = self.evidence;
        let count = sums.count.max(1e-9);
        let blur = Matrix([[xx, xy], [xy, yy]]).quadratic(&direction, &direction) / count;
        let relative = blur / self.mode.quadratic(&direction, &direction);
        // A variance X is known to 2 X^2 / n from n points d, and d^2 to 4 d^2 P + 2 P^2 where the centre is known
        // to P: of n points, n (2 P / X + n P^2 / X^2) are lost.
        let lost = 2.0 * relative + crowd / count * relative * relative;
        let points = (sure * (1.0 - lost).max(0.1) + self.prior).max(5.0);
        // V = points times the mode, of the mean V / (dof - 3).
        let dof = points - 1.0;
        InverseWishart::new(self.mode * (points / (dof - 3.0)), dof)
    }

    /// The interval that holds the variance along a unit vector with probability `level`, m^2.
    ///
    /// # Errors
    /// A level outside (0, 1), a direction that is not finite.
    pub fn variance_interval(&self, direction: [f64; 2], level: f64) -> Result<[f64; 2]> {
        self.along(direction)?.variance_interval(direction, level)
    }

    /// The principal axes, the longer first: the standard deviation along each, and its interval. Their directions are
    /// taken for known.
    ///
    /// # Errors
    /// A level outside (0, 1).
    pub fn semi_axes(&self, level: f64) -> Result<[SemiAxis; 2]> {
        let (values, [c, s]) = eigen(&self.mode);
        let axis = |value: f64, direction: [f64; 2]| {
            let interval = self.variance_interval(direction, level)?.map(f64::sqrt);
            Ok(SemiAxis { direction, length: value.max(0.0).sqrt(), interval })
        };
        Ok([axis(values[0], [c, s])?, axis(values[1], [-s, c])?])
    }
}

/// What is known of the extents of a belief.
pub(super) fn extents<const N: usize>(belief: &ExtendedBelief<N>, prior: f64) -> Vec<Extent> {
    let each = belief.shape.ellipses().iter().zip(&belief.evidence);
    each.map(|(ellipse, evidence)| Extent { mode: ellipse.extent, evidence: *evidence, prior }).collect()
}
