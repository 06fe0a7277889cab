//! The fixed-lag smoother (Kitagawa and Sato 2001; Olsson, Cappe, Douc and Moulines, Bernoulli 14, 2008).

use super::history::{History, Smoothed};
use crate::error::Result;

impl<const N: usize> History<N> {
    /// The law of the state `lag` records before the last one, given all that is recorded: the ancestors of
    /// the last particles with their weights. It needs no transition density; with a window of `lag + 1`
    /// records it runs along with the filter. Ancestors become few as the lag grows: take
    /// [`backward_paths`](super::backward_paths) for lags beyond some tens of steps. With lag 0 it is the
    /// filter.
    ///
    /// # Errors
    /// [`Error::Shape`](crate::Error::Shape) where there are not so many records;
    /// [`Error::Unsupported`](crate::Error::Unsupported) where the filter does not say whom its particles
    /// come from.
    pub fn lagged(&self, lag: usize) -> Result<Smoothed<N>> {
        self.get(lag)?;
        let (last, at) = (self.get(self.len() - 1)?, self.len() - 1 - lag);
        let mut ancestors: Vec<usize> = (0..last.weights.len()).collect();
        for k in (at..self.len() - 1).rev() {
            let record = self.get(k)?;
            record.has_children()?;
            ancestors.iter_mut().for_each(|a| *a = record.parent(*a));
        }
        let record = self.get(at)?;
        Ok(Smoothed {
            time: record.time,
            states: record.states.each_ref().map(|c| ancestors.iter().map(|&a| c[a]).collect()),
            weights: last.weights.clone(),
        })
    }
}
