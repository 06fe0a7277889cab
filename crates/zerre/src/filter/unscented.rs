//! The unscented Kalman filter: sigma points instead of derivatives.

use super::gaussian::{Deviations, GaussianFilter, Joint, Observed, Transform};
use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::math::{Cholesky, Matrix, wrap};
use crate::model::{GaussianMeasurement, Motion};
use crate::time::Time;
use std::array::from_fn;

/// A Gaussian of n variables goes through a function by 2 n + 1 of its points: the mean and, along each column of a
/// square root of the covariance, plus and minus sqrt(c) of it, c = alpha^2 (n + kappa) (Julier and Uhlmann 2004;
/// Wan and van der Merwe 2000 for the three parameters).
///
/// With y_0 the image of the mean and y_i the others, which weigh 1 / 2c each, the mean is y_0 + sum (y_i - y_0) / 2c
/// and the covariance is sum (y_i - e)(y_i - e)' / 2c about a point e on the line from y_0 to the mean. That is the
/// usual sum with its weight of the centre, 1 - n/c + 1 - alpha^2 + beta, rewritten so that all weights are positive:
/// e exists, and no covariance can become indefinite, if and only if beta >= -alpha^2 kappa / n. Other parameters
/// are refused.
///
/// The default is alpha = 1, beta = 1, kappa = 2 - n, so c = 2 for any n and e = y_0. Mean and covariance are then
/// exact for linear functions and for sums of squares of the whitened variables, which the often seen kappa = 3 - n
/// (exact fourth moment along an axis) is not beyond one variable, and needs negative weights for n > 3.
///
/// Angles are taken as wrapped differences from y_0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SigmaPoints {
    /// Shrinks the distance of the points.
    pub alpha: f64,
    /// Adds to the weight of the centre in the covariance.
    pub beta: f64,
    /// Sets the distance of the points; `None` is 2 - n.
    pub kappa: Option<f64>,
}

impl Default for SigmaPoints {
    fn default() -> Self {
        SigmaPoints { alpha: 1.0, beta: 1.0, kappa: None }
    }
}

/// Parameters digested for a number of variables.
#[derive(Clone, Copy)]
pub struct Spread {
    /// Distance of the points in standard deviations, sqrt(c).
    pub(crate) distance: f64,
    /// Weight of each point but the centre, 1 / 2c.
    weight: f64,
    /// e = y_0 + shift (mean - y_0).
    pub(crate) shift: f64,
}

impl SigmaPoints {
    /// The points of the cubature Kalman filter (Arasaratnam and Haykin, IEEE Transactions on Automatic
    /// Control 54(6), 2009): 2 n of them at sqrt(n) standard deviations, all of the same weight, the mean not
    /// among them. They are exact for polynomials of degree three, as every choice here is, and the
    /// covariance is about the mean.
    ///
    /// With the image of the mean as the origin of differences they cost one evaluation more than 2 n.
    pub fn cubature() -> Self {
        SigmaPoints { alpha: 1.0, beta: 0.0, kappa: Some(0.0) }
    }

    pub(crate) fn spread(&self, n: usize) -> Result<Spread> {
        let n = n as f64;
        let squared = self.alpha * self.alpha;
        let c = Error::positive("alpha^2 (n + kappa)", squared * (n + self.kappa.unwrap_or(2.0 - n)))?;
        // sum (y_i - y_0)(y_i - y_0)' / 2c + excess d d' with d = mean - y_0; completing the square moves the centre.
        let excess = Error::finite("beta", self.beta)? - squared;
        let root = 1.0 + excess * n / c;
        if root < 0.0 {
            let needs = "it must be at least -alpha^2 kappa / n, or covariances become indefinite";
            return Err(Error::OutOfRange { what: "beta", value: self.beta, needs });
        }
        Ok(Spread { distance: c.sqrt(), weight: 0.5 / c, shift: (1.0 - root.sqrt()) * c / n })
    }
}

impl Spread {
    /// From the deviations y_i - y_0: mean - y_0 and e - y_0.
    fn centres<'a, const K: usize>(
        &self,
        deviations: impl Iterator<Item = &'a [f64; K]>,
    ) -> ([f64; K], [f64; K]) {
        let sum = deviations.fold([0.0; K], |sum, d| from_fn(|i| sum[i] + d[i]));
        let mean = sum.map(|s| s * self.weight);
        (mean, mean.map(|m| m * self.shift))
    }
}

/// The unscented Kalman filter. The motion is sampled in x and w together, so process noise may enter anywhere; the
/// measurement's noise is additive, and its points are drawn anew from the predicted law.
pub type Unscented<A, H, const N: usize, const W: usize, const M: usize> =
    GaussianFilter<SigmaPoints, A, H, N, W, M>;

impl<A, H, const N: usize, const W: usize, const M: usize> Unscented<A, H, N, W, M>
where
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    /// The filter of these models, started from `prior`; `points` is [`SigmaPoints::default`] unless there is a
    /// reason.
    ///
    /// # Errors
    /// Parameters that give no points, or negative variances (see [`SigmaPoints`]).
    pub fn new(motion: A, measurement: H, prior: Gaussian<N>, points: SigmaPoints) -> Result<Self> {
        points.accept(&motion, &measurement, &prior)?;
        Ok(GaussianFilter::of(points, motion, measurement, prior))
    }
}

/// Where a motion takes the points of x and w, as deviations from the image of the mean.
struct Images<const N: usize, const W: usize> {
    spread: Spread,
    centre: [f64; N],
    /// Deviations of the points of x themselves: one of each pair.
    columns: [[f64; N]; N],
    by_state: [[[f64; N]; 2]; N],
    by_noise: [[[f64; N]; 2]; W],
    /// From the image of the mean to the mean and to e.
    to_mean: [f64; N],
    to_e: [f64; N],
}

impl<const N: usize, const W: usize> Images<N, W> {
    fn of<A: Motion<N, W>>(
        points: &SigmaPoints,
        motion: &A,
        step: &A::Step,
        state: &Gaussian<N>,
    ) -> Result<Self> {
        let spread = points.spread(N + W)?;
        let noise = motion.noise();
        let (mean, w) = (*state.mean(), [noise.mean(); W]);
        let centre = A::apply(step, mean, w);
        let deviation = |x: [f64; N], w: [f64; W]| -> [f64; N] {
            let y = A::apply(step, x, w);
            from_fn(|i| y[i] - centre[i])
        };
        let root = Cholesky::semidefinite("covariance of the state", state.covariance())?;
        let columns: [[f64; N]; N] = from_fn(|j| root.column(j).map(|r| r * spread.distance));
        let by_state =
            columns.map(|dx| [1.0, -1.0].map(|sign| deviation(from_fn(|i| mean[i] + sign * dx[i]), w)));
        let distance = spread.distance * noise.variance().sqrt();
        let by_noise: [[[f64; N]; 2]; W] = from_fn(|j| {
            [distance, -distance].map(|d| {
                let mut moved = w;
                moved[j] += d;
                deviation(mean, moved)
            })
        });
        let (to_mean, to_e) = spread.centres(by_state.iter().chain(&by_noise).flatten());
        Ok(Images { spread, centre, columns, by_state, by_noise, to_mean, to_e })
    }

    fn law(&self) -> Result<Gaussian<N>> {
        let deviations = self.by_state.iter().chain(&self.by_noise).flatten();
        let covariance = deviations.fold(Matrix::ZERO, |sum, d| {
            let d: [f64; N] = from_fn(|i| d[i] - self.to_e[i]);
            sum + Matrix::outer(&d, &d) * self.spread.weight
        });
        let mean = from_fn(|i| self.centre[i] + self.to_mean[i]);
        Gaussian::computed("predicted mean", "predicted covariance", mean, covariance)
    }
}

/// Turns deviations of images into those from e, which lies `to_e` away; their covariance and that with the
/// points of the state, which are plus and minus `columns`.
fn about<const N: usize, const M: usize>(
    images: &mut [[[f64; M]; 2]; N],
    to_e: &[f64; M],
    weight: f64,
    columns: &[[f64; N]; N],
) -> (Matrix<M, M>, Matrix<N, M>) {
    let (mut covariance, mut cross) = (Matrix::ZERO, Matrix::ZERO);
    for (dx, pair) in columns.iter().zip(images) {
        for (sign, dz) in [weight, -weight].into_iter().zip(pair) {
            *dz = from_fn(|i| dz[i] - to_e[i]);
            covariance = covariance + Matrix::outer(dz, dz) * weight;
            cross = cross + Matrix::outer(dx, dz) * sign;
        }
    }
    (covariance, cross)
}

impl Transform for SigmaPoints {
    const BY_JACOBIANS: bool = false;

    fn propagate<A: Motion<N, W>, const N: usize, const W: usize>(
        &self,
        motion: &A,
        step: &A::Step,
        state: &Gaussian<N>,
    ) -> Result<Gaussian<N>> {
        Images::of(self, motion, step, state)?.law()
    }

    fn propagate_joint<A: Motion<N, W>, const N: usize, const W: usize>(
        &self,
        motion: &A,
        step: &A::Step,
        state: &Gaussian<N>,
    ) -> Result<Joint<N>> {
        let mut images = Images::of(self, motion, step, state)?;
        let law = images.law()?;
        let (weight, to_e) = (images.spread.weight, images.to_e);
        let about_e = |d: &[f64; N]| from_fn(|i| d[i] - to_e[i]);
        let added = images.by_noise.iter().flatten().map(about_e);
        let added = added.fold(Matrix::ZERO, |sum, d| sum + Matrix::outer(&d, &d) * weight);
        let columns = images.columns;
        let (covariance, cross) = about(&mut images.by_state, &to_e, weight, &columns);
        let deviations = Deviations::Points { weight, state: columns, measured: images.by_state };
        let by_state = Observed { mean: *law.mean(), covariance, cross, deviations };
        Ok(Joint { law, by_state, added })
    }

    fn observe<H: GaussianMeasurement<N, M>, const N: usize, const M: usize>(
        &self,
        measurement: &H,
        at: Time,
        state: &Gaussian<N>,
    ) -> Result<Observed<N, M>> {
        let spread = self.spread(N)?;
        let x = state.mean();
        let centre = measurement.predict(at, *x);
        let root = Cholesky::semidefinite("covariance of the state", state.covariance())?;
        let columns: [[f64; N]; N] = from_fn(|j| root.column(j).map(|r| r * spread.distance));
        let mut measured: [[[f64; M]; 2]; N] = columns.map(|dx| {
            [1.0, -1.0].map(|sign| {
                let z = measurement.predict::<f64>(at, from_fn(|i| x[i] + sign * dx[i]));
                from_fn(|i| if H::ANGLE[i] { wrap(z[i] - centre[i]) } else { z[i] - centre[i] })
            })
        });
        let (to_mean, to_e) = spread.centres(measured.iter().flatten());
        let (covariance, cross) = about(&mut measured, &to_e, spread.weight, &columns);
        let mean = from_fn(|i| {
            let z = centre[i] + to_mean[i];
            if H::ANGLE[i] { wrap(z) } else { z }
        });
        let deviations = Deviations::Points { weight: spread.weight, state: columns, measured };
        Ok(Observed { mean, covariance, cross, deviations })
    }

    fn accept<A, H, const N: usize, const W: usize, const M: usize>(
        &self,
        _: &A,
        _: &H,
        _: &Gaussian<N>,
    ) -> Result<()>
    where
        A: Motion<N, W>,
        H: GaussianMeasurement<N, M>,
    {
        self.spread(N + W)?;
        self.spread(N).map(drop)
    }
}
