//! Rao-Blackwellised filters over labels that are drawn, for the list. The labels come to nothing, or to
//! noise that the sensor of the world has anyway, so that the posterior is Kalman's.

use crate::list::{Class, Entry, Estimates, Means, Sensor, World, entry};
use serde::{Deserialize, Serialize};
use std::borrow::Borrow;
use zerre::belief::{Hypotheses, Hypothesis};
use zerre::filter::{RaoBlackwell, Tangent};
use zerre::math::{Cholesky, Matrix};
use zerre::model::measurement::{Conditioned, HeavyTailed};
use zerre::model::motion::ConstantVelocity;
use zerre::model::{GaussianMeasurement, Label, Latent, NoiseScale};
use zerre::resample::Reduction;
use zerre::rng::Draws;
use zerre::{Result, Time};

pub fn filters<H: Sensor>(world: &World<H>, means: &Means) -> Vec<Entry> {
    let &World { prior, motion, sensor } = world;
    // Each is a Kalman filter with four draws: as much work as some forty particles.
    let hypotheses = means.particles.div_ceil(20);
    let share = |share| {
        let model = NoiseShare { motion, share };
        RaoBlackwell::new(Tangent, model, sensor, prior, hypotheses).unwrap()
    };
    let mut list = vec![entry("rao-blackwell, a label without influence", Class::Exact, share(0.0))];
    for reduction in [Reduction::Optimal, Reduction::Systematic, Reduction::Multinomial] {
        let name = format!("rao-blackwell, half of the noise drawn, {reduction:?}");
        list.push(entry(name, Class::Consistent, share(0.5).with_reduction(reduction)));
    }
    // s = 1 + e with e of the order of sqrt(2 / nu) = 1e-10: rounding, to this law.
    let robust = HeavyTailed::<_, 2>::student_t(sensor, 1e20).unwrap();
    let scales = NoiseScale::new(motion, 4).unwrap();
    let scales = RaoBlackwell::new(Tangent, scales, robust, prior, hypotheses).unwrap();
    list.push(entry("rao-blackwell, noise all but normal", Class::Exact, scales));
    list
}

/// A share of the noise of each measurement is drawn: z = h(x) + d + v, d ~ N(0, share R), v ~ N(0, (1 -
/// share) R).
struct NoiseShare {
    motion: ConstantVelocity<2>,
    share: f64,
}

const DRAWS: usize = 4;

/// Standard normal numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Drawn(f64, f64);
impl Label for Drawn {}

impl Drawn {
    fn new(draws: &mut Draws) -> Drawn {
        Drawn(draws.normal(), draws.normal())
    }
}

impl<H: Sensor> Latent<4, 4, 2, H> for NoiseShare {
    type Label = Drawn;
    type Motion = ConstantVelocity<2>;
    type Sensor = Conditioned<H, 2>;
    /// Whether something is measured.
    type Over = bool;

    fn branches(&self) -> usize {
        DRAWS
    }
    fn first(&self, _: &H, count: usize, draws: &mut Draws, out: &mut dyn FnMut(Drawn, f64)) {
        (0..count).for_each(|_| out(Drawn::new(draws), 1.0 / count as f64));
    }
    fn over(&self, _: &H, _: Time, _: Time, z: Option<&[f64; 2]>) -> Result<bool> {
        Ok(z.is_some())
    }
    fn branch(
        &self,
        measured: &bool,
        from: &Hypothesis<4, Drawn>,
        draws: &mut Draws,
        out: &mut dyn FnMut(Drawn, f64),
    ) {
        if *measured {
            (0..DRAWS).for_each(|_| out(Drawn::new(draws), 1.0 / DRAWS as f64));
        } else {
            out(from.label, 1.0);
        }
    }
    fn motion(&self, _: &Drawn) -> Result<impl Borrow<ConstantVelocity<2>>> {
        Ok(&self.motion)
    }
    fn sensor(&self, base: &H, &Drawn(a, b): &Drawn) -> Result<impl Borrow<Conditioned<H, 2>>> {
        let noise = Matrix(<H as GaussianMeasurement<4, 2>>::covariance(base));
        let drawn = *Cholesky::of("R", &noise)?.factor() * [a, b];
        let offset = drawn.map(|d| d * self.share.sqrt());
        Conditioned::new(*base).with_offset(offset)?.with_scale(1.0 - self.share)
    }
}

impl Estimates for Hypotheses<4, Drawn> {
    fn mean(&self) -> [f64; 4] {
        Hypotheses::mean(self)
    }
    fn covariance(&self) -> Matrix<4, 4> {
        *self.combined().unwrap().covariance()
    }
}

impl Estimates for Hypotheses<4, f64> {
    fn mean(&self) -> [f64; 4] {
        Hypotheses::mean(self)
    }
    fn covariance(&self) -> Matrix<4, 4> {
        *self.combined().unwrap().covariance()
    }
}
