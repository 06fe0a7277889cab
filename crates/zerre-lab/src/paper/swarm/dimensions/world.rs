//! Worlds of any dimension whose posterior is known: they fall apart into lines or planes that know nothing of each
//! other, while a filter sees one state.

use super::settings::{BEACON, KEEP, NODES, STEPS};
use zerre::belief::{Gaussian, GaussianBelief, GridBelief};
use zerre::error::Error;
use zerre::filter::{Filter, Grid, Kalman, Prior};
use zerre::math::Real;
use zerre::model::measurement::Position;
use zerre::model::{GaussianMeasurement, Measurement, Motion, simulate};
use zerre::rng::Stream;
use zerre::{Result, Time};

/// Components that return to zero, each on its own: x <- c x + sqrt(1 - c^2) w over a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Relaxing<const D: usize>;

impl<const D: usize> Motion<D, D> for Relaxing<D> {
    type Step = [f64; 2];

    fn over(&self, from: Time, to: Time) -> Result<[f64; 2]> {
        if to < from {
            return Err(Error::OutOfOrder { from, to });
        }
        Ok([KEEP, (1.0 - KEEP * KEEP).sqrt()])
    }

    #[inline(always)]
    fn apply<R: Real>(&[keep, renew]: &[f64; 2], x: [R; D], w: [R; D]) -> [R; D] {
        std::array::from_fn(|k| x[k] * keep + w[k] * renew)
    }
}

/// exp(x) of each component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exponentials<const D: usize> {
    /// Standard deviation of each.
    pub sd: f64,
}

/// Numbers with independent noise of one standard deviation, digested.
#[derive(Clone, Copy, Debug)]
pub struct Given<const M: usize> {
    z: [f64; M],
    per_sd: f64,
    constant: f64,
}

impl<const M: usize> Given<M> {
    fn of(z: &[f64; M], sd: f64) -> Given<M> {
        let constant = -(M as f64) * ((2.0 * std::f64::consts::PI).sqrt() * sd).ln();
        Given { z: *z, per_sd: 1.0 / sd, constant }
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(&self, foretold: [R; M]) -> R {
        let mut sum = foretold[0].constant(0.0);
        for k in 0..M {
            let r = (foretold[k] - self.z[k]) * self.per_sd;
            sum = r.mul_add(r, sum);
        }
        sum * -0.5 + self.constant
    }
}

fn alike<const M: usize>(sd: f64) -> [[f64; M]; M] {
    std::array::from_fn(|i| std::array::from_fn(|j| if i == j { sd * sd } else { 0.0 }))
}

impl<const D: usize> Measurement<D> for Exponentials<D> {
    type Value = [f64; D];
    type Given<'z> = Given<D>;

    fn given<'z>(&'z self, z: &'z [f64; D], _: Time) -> Result<Given<D>> {
        Ok(Given::of(z, self.sd))
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &Given<D>, x: [R; D]) -> R {
        given.log_likelihood(x.map(Real::exp))
    }
}

impl<const D: usize> GaussianMeasurement<D, D> for Exponentials<D> {
    #[inline(always)]
    fn predict<R: Real>(&self, _: Time, x: [R; D]) -> [R; D] {
        x.map(Real::exp)
    }

    fn components(&self, z: &[f64; D]) -> [f64; D] {
        *z
    }

    fn covariance(&self) -> [[f64; D]; D] {
        alike(self.sd)
    }
}

/// Distances from a beacon at (-[`BEACON`], 0) in each of M planes, components 2 k and 2 k + 1 being plane k.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ranges<const M: usize> {
    /// Standard deviation of each.
    pub sd: f64,
}

impl<const D: usize, const M: usize> Measurement<D> for Ranges<M> {
    type Value = [f64; M];
    type Given<'z> = Given<M>;

    fn given<'z>(&'z self, z: &'z [f64; M], _: Time) -> Result<Given<M>> {
        Ok(Given::of(z, self.sd))
    }

    #[inline(always)]
    fn log_likelihood<R: Real>(given: &Given<M>, x: [R; D]) -> R {
        given.log_likelihood(std::array::from_fn(|k| range(x, k)))
    }
}

#[inline(always)]
fn range<R: Real, const D: usize>(x: [R; D], plane: usize) -> R {
    let (along, across) = (x[2 * plane] + BEACON, x[2 * plane + 1]);
    along.mul_add(along, across * across).sqrt()
}

impl<const D: usize, const M: usize> GaussianMeasurement<D, M> for Ranges<M> {
    #[inline(always)]
    fn predict<R: Real>(&self, _: Time, x: [R; D]) -> [R; M] {
        std::array::from_fn(|k| range(x, k))
    }

    fn components(&self, z: &[f64; M]) -> [f64; M] {
        *z
    }

    fn covariance(&self) -> [[f64; M]; M] {
        alike(self.sd)
    }
}

/// The law of the state before any measurement, which is that of any time without one.
pub fn prior<const D: usize>() -> Result<Gaussian<D>> {
    Gaussian::independent([0.0; D], [1.0; D])
}

/// Time zero and the times of the measurements.
pub fn times() -> Vec<Time> {
    (0..=STEPS as i64).map(|k| Time::from_nanos(k * 1_000_000_000)).collect()
}

/// Measurements of a run.
///
/// # Errors
/// What the models refuse: none of those here.
pub fn draw<const D: usize, const M: usize, H>(sensor: &H, luck: Stream) -> Result<Vec<[f64; M]>>
where
    H: GaussianMeasurement<D, M> + Measurement<D, Value = [f64; M]>,
{
    let start = prior::<D>()?.columns(luck, 1)?.map(|column| column[0]);
    let times = times();
    let path = simulate::path(&Relaxing::<D>, start, &times, luck)?;
    simulate::measurements(sensor, &path[1..], &times[1..], luck)
}

/// The exact posterior after each measurement.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Exact {
    /// Means of the components, step after step.
    pub mean: Vec<Vec<f64>>,
    /// Standard deviations.
    pub sd: Vec<Vec<f64>>,
    /// Log-evidence of all measurements.
    pub log_evidence: f64,
}

impl Exact {
    /// Adds a part of the state, P components seen by one number of each measurement.
    fn add<F, const P: usize>(
        &mut self,
        filter: &F,
        seen: impl Iterator<Item = f64>,
        read: impl Fn(&F::Belief) -> [[f64; 2]; P],
    ) -> Result<()>
    where
        F: Filter<Measurement = [f64; 1]>,
    {
        let times = times();
        let mut belief = filter.start(Time::ZERO, Stream::new(0))?;
        self.mean.resize(STEPS, Vec::new());
        self.sd.resize(STEPS, Vec::new());
        for (step, z) in seen.enumerate() {
            self.log_evidence += filter.step(&mut belief, times[step + 1], Some(&[z]))?.log_evidence;
            for [mean, sd] in read(&belief) {
                self.mean[step].push(mean);
                self.sd[step].push(sd);
            }
        }
        Ok(())
    }

    /// Of places with this standard deviation: a Kalman filter for each component.
    ///
    /// # Errors
    /// What the models refuse: none of those here.
    pub fn of_places<const M: usize>(sd: f64, measured: &[[f64; M]]) -> Result<Exact> {
        let filter = Kalman::new(Relaxing::<1>, Position::<1>::new(sd)?, prior::<1>()?)?;
        let mut exact = Exact::default();
        for k in 0..M {
            exact.add(&filter, measured.iter().map(|z| z[k]), |belief: &GaussianBelief<1>| {
                [[belief.state.mean()[0], belief.state.covariance().0[0][0].sqrt()]]
            })?;
        }
        Ok(exact)
    }

    /// Of exponentials with this standard deviation: a grid for each component.
    ///
    /// # Errors
    /// What the models refuse: none of those here.
    pub fn of_exponentials<const M: usize>(sd: f64, measured: &[[f64; M]]) -> Result<Exact> {
        let filter = Grid::new(prior::<1>()?, Relaxing::<1>, Exponentials::<1> { sd })?;
        let mut exact = Exact::default();
        for k in 0..M {
            exact.add(&filter, measured.iter().map(|z| z[k]), |belief: &GridBelief<1>| {
                [[belief.mean()[0], belief.covariance().0[0][0].sqrt()]]
            })?;
        }
        Ok(exact)
    }

    /// Of ranges with this standard deviation: a grid for each plane.
    ///
    /// # Errors
    /// What the models refuse: none of those here.
    pub fn of_ranges<const M: usize>(sd: f64, measured: &[[f64; M]]) -> Result<Exact> {
        let filter = Grid::new(prior::<2>()?, Relaxing::<2>, Ranges::<1> { sd })?.with_nodes(NODES)?;
        let mut exact = Exact::default();
        for k in 0..M {
            exact.add(&filter, measured.iter().map(|z| z[k]), |belief: &GridBelief<2>| {
                let (mean, covariance) = (belief.mean(), belief.covariance());
                [0, 1].map(|i| [mean[i], covariance.0[i][i].sqrt()])
            })?;
        }
        Ok(exact)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use zerre::filter::{ParticleFilter, Settings};

    /// The grid at its nodes against 2^18 particles on one plane: means within 5 sd / sqrt(ess), the evidence of all
    /// steps within 5 sqrt(steps / ess), ess being the least of the run; the other way round, twice the nodes.
    #[test]
    fn the_exact_answer_is_exact() {
        for sd in [1.0, 0.1, 0.03] {
            let sensor = Ranges::<1> { sd };
            let measured = draw::<2, 1, _>(&sensor, Stream::new(5)).unwrap();
            let exact = Exact::of_ranges(sd, &measured).unwrap();
            let settings = Settings { particles: 1 << 18, ..Settings::default() };
            let filter = ParticleFilter::new(prior::<2>().unwrap(), Relaxing::<2>, sensor, settings).unwrap();
            let mut cloud = filter.start(Time::ZERO, Stream::new(6)).unwrap();
            let (mut evidence, mut ess) = (0.0, f64::INFINITY);
            for (step, z) in measured.iter().enumerate() {
                let update = filter.step(&mut cloud, times()[step + 1], Some(z)).unwrap();
                evidence += update.log_evidence;
                ess = ess.min(update.particles.unwrap().ess);
                for (k, mean) in cloud.mean().into_iter().enumerate() {
                    let error = (mean - exact.mean[step][k]) / exact.sd[step][k];
                    assert!(error.abs() < 5.0 / ess.sqrt(), "sd {sd}, step {step}: {error}, ess {ess}");
                }
            }
            assert!((evidence - exact.log_evidence).abs() < 5.0 * (STEPS as f64 / ess).sqrt(), "sd {sd}");
        }
    }
}
