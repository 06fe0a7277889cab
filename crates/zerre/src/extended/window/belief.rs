//! What the window filter knows.

use super::super::path::{Leap, Moments, Pose, Said};
use super::super::rate::Rate;
use super::super::shape::{MAX_ELLIPSES, Shape};
use super::super::statistics::Sums;
use super::Clutter;
use super::information::Information;
use super::number::{Memory, Wish};
use super::turns::turn;
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
    pub(super) frozen: Vec<Sums>,
    /// Those with the window's.
    pub(super) sums: Vec<Sums>,
    /// What scans before the window say of how well the shape is known.
    pub(super) information: Information,
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
    frozen: Vec<Sums>,
    sums: Vec<Sums>,
    information: Information,
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
        if [p.first.len(), p.frozen.len(), p.sums.len()] != [count; 3]
            || !p.information.is_of(count)
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
            sums: p.sums,
            information: p.information,
            window: p.window,
            frozen_rates: p.frozen_rates,
            rate: p.rate,
            clutter: p.clutter,
            memory: p.memory,
            wish: p.wish,
        })
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
    pub sums: [Sums; MAX_ELLIPSES],
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
    /// Its points from the centre, in the directions of the body, where the smoothed state is.
    pub fn in_body(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        let [x, y, angle] = self.now.at;
        let turned = if angle == 0.0 { Matrix::identity() } else { turn(-angle) };
        self.points[0].iter().zip(&self.points[1]).map(move |(px, py)| turned * [px - x, py - y])
    }

    /// What the target and others have of the points.
    pub fn counts(&self) -> [f64; 2] {
        let of_target = self.sums.iter().map(|sums| sums.count).sum::<f64>();
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

    /// Points that each ellipse has had, and their sums: what the shape is learnt from.
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
