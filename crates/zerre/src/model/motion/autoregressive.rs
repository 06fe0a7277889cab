//! First-order autoregression (Box, Jenkins and Reinsel, *Time Series Analysis*, 1994, chapter 3).

use super::{add_scaled, elapsed};
use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::math::{Matrix, Real};
use crate::model::Motion;
use crate::time::Time;

/// x_k = mu + rho (x_{k-1} - mu) + sigma w. One step is one application, however long it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Autoregressive {
    mean: f64,
    rho: f64,
    sd: f64,
}

impl Autoregressive {
    /// The level `mean`, the share `rho` of the deviation that a step keeps, and the standard deviation `sd`
    /// of what a step adds, in the units of the state.
    ///
    /// # Errors
    /// Numbers that are not finite; `sd` negative.
    pub fn new(mean: f64, rho: f64, sd: f64) -> Result<Self> {
        Ok(Autoregressive {
            mean: Error::finite("mean of the autoregression", mean)?,
            rho: Error::finite("coefficient of the autoregression", rho)?,
            sd: Error::not_negative("standard deviation of the autoregression", sd)?,
        })
    }

    /// The law that a step leaves as it is: N(mu, sigma^2 / (1 - rho^2)).
    ///
    /// # Errors
    /// [`Error::OutOfRange`] unless |rho| < 1.
    pub fn stationary(&self) -> Result<Gaussian<1>> {
        if self.rho.abs() >= 1.0 {
            let needs = "a stationary law needs it between -1 and 1";
            return Err(Error::OutOfRange {
                what: "coefficient of the autoregression",
                value: self.rho,
                needs,
            });
        }
        Gaussian::new([self.mean], Matrix([[self.sd * self.sd / (1.0 - self.rho * self.rho)]]))
    }
}

impl Motion<1, 1> for Autoregressive {
    type Step = Autoregressive;

    fn over(&self, from: Time, to: Time) -> Result<Autoregressive> {
        elapsed(from, to)?;
        Ok(*self)
    }

    #[inline(always)]
    fn apply<R: Real>(step: &Autoregressive, [x]: [R; 1], [w]: [R; 1]) -> [R; 1] {
        [add_scaled(add_scaled(x.constant(step.mean), step.rho, x - step.mean), step.sd, w)]
    }
}
