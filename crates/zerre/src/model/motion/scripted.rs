//! A motion that changes at known times.

use crate::error::{Error, Result};
use crate::math::Real;
use crate::model::Motion;
use crate::time::Time;

/// Motions in turn, each from a known time on: what a filter would do that knew the mode, and what a scenario does.
#[derive(Clone, Debug, PartialEq)]
pub struct Scripted<A> {
    legs: Vec<(Time, A)>,
}

impl<A> Scripted<A> {
    /// Motions with the times at which they begin; the first one also holds before its time.
    ///
    /// # Errors
    /// No leg; times that do not rise.
    pub fn new(legs: Vec<(Time, A)>) -> Result<Self> {
        if legs.is_empty() {
            return Err(Error::Shape { what: "legs of the motion", found: 0, expected: 1 });
        }
        for pair in legs.windows(2) {
            if pair[1].0 <= pair[0].0 {
                return Err(Error::OutOfOrder { from: pair[0].0, to: pair[1].0 });
            }
        }
        Ok(Scripted { legs })
    }

    /// The number of the leg that a step from `from` belongs to.
    pub fn leg(&self, from: Time) -> usize {
        self.legs.partition_point(|(begin, _)| *begin <= from).max(1) - 1
    }
}

impl<A: Motion<N, W>, const N: usize, const W: usize> Motion<N, W> for Scripted<A> {
    type Step = A::Step;

    /// The step of the leg that holds at `from`, even if the next one begins before `to`.
    fn over(&self, from: Time, to: Time) -> Result<A::Step> {
        self.legs[self.leg(from)].1.over(from, to)
    }

    #[inline(always)]
    fn apply<R: Real>(step: &A::Step, x: [R; N], w: [R; W]) -> [R; N] {
        A::apply(step, x, w)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legs_follow_each_other() {
        let at = Time::from_secs;
        let script = Scripted::new(vec![(at(0.0), 'a'), (at(5.0), 'b'), (at(7.0), 'c')]).unwrap();
        for (time, leg) in [(-1.0, 0), (0.0, 0), (4.9, 0), (5.0, 1), (6.9, 1), (7.0, 2), (99.0, 2)] {
            assert_eq!(script.leg(at(time)), leg, "{time}");
        }
        assert!(Scripted::<char>::new(vec![]).is_err());
        assert!(Scripted::new(vec![(at(1.0), 'a'), (at(1.0), 'b')]).is_err());
    }
}
