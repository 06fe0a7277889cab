//! Singer's manoeuvring target: R. A. Singer, *Estimating optimal tracking filter performance for manned
//! maneuvering targets*, IEEE Transactions on Aerospace and Electronic Systems 6(4), 1970.

use super::{ThirdOrderStep, elapsed};
use crate::error::{Error, Result};
use crate::math::{Real, decay_average, decay_second_average};
use crate::model::Motion;
use crate::time::Time;

/// Acceleration as a first-order Markov process along each of `D` axes (1, 2 or 3):
/// da = -(a / tau) dt + sqrt(2 s^2 / tau) dB, with stationary standard deviation s.
///
/// A long tau gives nearly constant acceleration with jerk density 2 s^2 / tau, a short one nearly constant
/// velocity with acceleration density 2 s^2 tau.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Singer<const D: usize> {
    acceleration_sd: f64,
    time_constant: f64,
}

impl<const D: usize> Singer<D> {
    /// A stationary acceleration of standard deviation `acceleration_sd` (m/s^2) on each axis that lasts for about
    /// `time_constant_s` seconds: 60 for a lazy turn, 10 to 20 for an evasive manoeuvre, 1 for turbulence.
    ///
    /// # Errors
    /// `acceleration_sd` negative or not finite; `time_constant_s` not finite or below a nanosecond.
    pub fn new(acceleration_sd: f64, time_constant_s: f64) -> Result<Self> {
        Ok(Singer {
            acceleration_sd: Error::not_negative("standard deviation of the acceleration", acceleration_sd)?,
            time_constant: super::time_constant("time constant of the manoeuvre", time_constant_s)?,
        })
    }

    /// Singer's law of the acceleration: none with probability `p_none`, the largest `a_max` (m/s^2) with
    /// probability `p_max` in each direction, uniform between otherwise. Its variance is
    /// a_max^2 / 3 (1 + 4 p_max - p_none).
    ///
    /// # Errors
    /// `a_max` negative or not finite, probabilities outside `[0, 1]` or with 2 `p_max` + `p_none` above 1, and
    /// what [`Singer::new`] refuses.
    pub fn from_largest(a_max: f64, p_max: f64, p_none: f64, time_constant_s: f64) -> Result<Self> {
        Error::not_negative("largest acceleration", a_max)?;
        Error::not_negative("probability of the largest acceleration", p_max)?;
        Error::not_negative("probability of no acceleration", p_none)?;
        let together = 2.0 * p_max + p_none;
        if together > 1.0 {
            let what = "probability of either largest or no acceleration";
            return Err(Error::OutOfRange { what, value: together, needs: "it must not be above 1" });
        }
        Singer::new(a_max * ((1.0 + 4.0 * p_max - p_none) / 3.0).sqrt(), time_constant_s)
    }

    fn step(&self, dt: f64) -> ThirdOrderStep {
        let theta = dt / self.time_constant;
        // Cholesky factor for dt = 1 and unit density of the noise; positions scale with dt^2, velocities with dt.
        let [[q11, q12, q13], [q22, q23, q33]] = unit_covariance(theta);
        let l11 = q11.sqrt();
        let (l21, l31) = (q12 / l11, q13 / l11);
        let l22 = (q22 - l21 * l21).sqrt();
        let l32 = (q23 - l31 * l21) / l22;
        let l33 = (q33 - l31 * l31 - l32 * l32).sqrt();
        let a = self.acceleration_sd * (2.0 * theta).sqrt();
        let v = a * dt;
        let p = v * dt;
        let f33 = Real::exp(-theta);
        ThirdOrderStep {
            f12: dt,
            f13: decay_second_average(theta) * dt * dt,
            f23: decay_average(theta) * dt,
            f33,
            l11: p * l11,
            l21: v * l21,
            l22: v * l22,
            l31: a * l31,
            l32: a * l32,
            l33: a * l33,
        }
    }
}

/// [[q11, q12, q13], [q22, q23, q33]] of the position, velocity and acceleration that unit white noise builds up
/// in unit time when the acceleration decays at rate `theta`: integrals over s in (0, theta) of the products of
/// s - 1 + e^-s, 1 - e^-s and e^-s, over theta^5, theta^4, theta^3; theta^3, theta^2; theta.
fn unit_covariance(theta: f64) -> [[f64; 3]; 2] {
    let average = decay_average(theta);
    let second = decay_second_average(theta);
    let q12 = 0.5 * second * second;
    let q23 = 0.5 * average * average;
    let q33 = decay_average(2.0 * theta);
    let (q11, q13, q22) = if theta < 1.0 {
        // Power series: the closed forms below lose theta^-5 of their digits. Terms are (-theta)^k times powers of
        // two over factorials, below 1e-16 of the sum after k = 20.
        let (mut q11, mut q13, mut q22) = (0.0, 0.0, 0.0);
        let (mut over3, mut over5, mut pow2) = (1.0 / 6.0, 1.0 / 120.0, 4.0);
        for k in 0..=20 {
            let k = f64::from(k);
            q13 += over3 * (pow2 - (k + 3.0));
            q22 += over3 * (pow2 - 2.0);
            q11 += over5 * (4.0 * pow2 - 2.0 * (k + 5.0));
            over3 *= -theta / (k + 4.0);
            over5 *= -theta / (k + 6.0);
            pow2 *= 2.0;
        }
        (q11, q13, q22)
    } else {
        let decay = Real::exp(-theta);
        let squared = theta * q33;
        let less = theta - 1.0;
        let q11 = (less * less * less + 1.0) / 3.0 - 2.0 * theta * decay + squared;
        let q13 = squared - theta * decay;
        let q22 = theta - 2.0 * theta * average + squared;
        let theta3 = theta * theta * theta;
        (q11 / (theta3 * theta * theta), q13 / theta3, q22 / theta3)
    };
    [[q11, q12, q13], [q22, q23, q33]]
}

super::third_order_motion!(Singer);
