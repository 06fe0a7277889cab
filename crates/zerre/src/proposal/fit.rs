//! The posterior of a particle's noise, fitted by a normal law.
//!
//! Noise is scaled to v with mean 0 and covariance I, and a measurement with its noise to covariance I. What
//! is seen of v is linear, or made so: r = B v + N(0, I), `M` rows b_i. Rows are taken in one after the other
//! in square-root form (Potter's update: Bierman, *Factorization Methods for Discrete Sequential Estimation*,
//! 1977, II.4), which leaves the factor of the covariance as a product that is never multiplied out,
//!
//! F = (I - g_1 f_1 f_1') ... (I - g_M f_M f_M'), f_i = F_{i-1}' b_i, s_i = 1 + f_i' f_i, g_i = 1 / (s_i +
//! sqrt(s_i)),
//!
//! with ln det F = -1/2 sum ln s_i.

use super::engine::Models;
use crate::error::{Error, Result};
use crate::filter::{Linear, SigmaPoints, Spread, Tangent, same};
use crate::math::{Dual, Float, Matrix, Real};
use crate::model::{GaussianMeasurement, Motion, Noise};
use std::array::from_fn;

/// A measurement digested for fits.
pub struct Given<'a, S, A, H, T: Fit, const M: usize> {
    pub(super) models: Models<'a, S, A, H>,
    pub(super) z: [f64; M],
    /// L^-1 of R = L L'.
    pub(super) whiten: [[f64; M]; M],
    /// Mean and standard deviation of the noise.
    pub(super) noise: (f64, f64),
    pub(super) spread: T::Spread,
    pub(super) passes: u32,
    /// Whether the tails of the sensor are heavier than the normal law's.
    pub(super) heavy: bool,
}

/// N(mean, F F').
#[derive(Clone, Copy)]
pub struct Fitted<R, const W: usize, const M: usize> {
    pub(super) mean: [R; W],
    directions: [[R; W]; M],
    gains: [R; M],
    roots: [R; M],
    /// s_1 ... s_M = 1 / det F F'.
    pub(super) information: R,
}

#[inline(always)]
pub(super) fn dot<R: Real, const W: usize>(a: &[R; W], b: &[R; W]) -> R {
    let mut sum = a[0] * b[0];
    for i in 1..W {
        sum = a[i].mul_add(b[i], sum);
    }
    sum
}

/// a += c b.
#[inline(always)]
fn add<R: Real, const W: usize>(a: &mut [R; W], c: R, b: &[R; W]) {
    for i in 0..W {
        a[i] = c.mul_add(b[i], a[i]);
    }
}

impl<R: Real, const W: usize, const M: usize> Fitted<R, W, M> {
    /// The posterior of v ~ N(0, I) given r = B v + N(0, I).
    #[inline(always)]
    pub(super) fn new(rows: &[[R; W]; M], residuals: &[R; M]) -> Self {
        let zero = residuals[0].constant(0.0);
        let one = zero.constant(1.0);
        let mut fitted = Fitted {
            mean: [zero; W],
            directions: [[zero; W]; M],
            gains: [zero; M],
            roots: [one; M],
            information: one,
        };
        for i in 0..M {
            let mut f = rows[i];
            for j in 0..i {
                let c = -(fitted.gains[j] * dot(&fitted.directions[j], &f));
                add(&mut f, c, &fitted.directions[j]);
            }
            let s = dot(&f, &f) + 1.0;
            let root = s.sqrt();
            let rest = residuals[i] - dot(&rows[i], &fitted.mean);
            let mut step = f;
            fitted.factor(i, &mut step);
            add(&mut fitted.mean, rest / s, &step);
            (fitted.directions[i], fitted.roots[i]) = (f, root);
            fitted.gains[i] = one / (s + root);
            fitted.information = fitted.information * s;
        }
        fitted
    }

    /// v <- F_k v, the product of the first `k` factors.
    #[inline(always)]
    fn factor(&self, k: usize, v: &mut [R; W]) {
        for j in (0..k).rev() {
            let c = -(self.gains[j] * dot(&self.directions[j], v));
            add(v, c, &self.directions[j]);
        }
    }

    /// mean + F n.
    #[inline(always)]
    pub(super) fn at(&self, mut n: [R; W]) -> [R; W] {
        self.factor(M, &mut n);
        for i in 0..W {
            n[i] = n[i] + self.mean[i];
        }
        n
    }

    /// F^-1 (v - mean).
    #[inline(always)]
    pub(super) fn standardised(&self, mut v: [R; W]) -> [R; W] {
        for i in 0..W {
            v[i] = v[i] - self.mean[i];
        }
        for j in 0..M {
            let c = self.gains[j] * self.roots[j] * dot(&self.directions[j], &v);
            add(&mut v, c, &self.directions[j]);
        }
        v
    }

    /// F^-1' a.
    #[inline(always)]
    fn unscaled(&self, a: &mut [R; W]) {
        for j in (0..M).rev() {
            let c = self.gains[j] * self.roots[j] * dot(&self.directions[j], a);
            add(a, c, &self.directions[j]);
        }
    }

    /// E |r - B v|^2, the squared distance of the measurement from what the fit makes of it, in units of R.
    #[inline(always)]
    fn distance(&self, rows: &[[R; W]; M], residuals: &[R; M]) -> R {
        let mut sum = residuals[0].constant(0.0);
        for i in 0..M {
            let rest = residuals[i] - dot(&rows[i], &self.mean);
            let mut f = rows[i];
            for j in 0..M {
                let c = -(self.gains[j] * dot(&self.directions[j], &f));
                add(&mut f, c, &self.directions[j]);
            }
            sum = rest.mul_add(rest, sum) + dot(&f, &f);
        }
        sum
    }

    /// `other` where `border` < `value`.
    #[inline(always)]
    fn replaced(&mut self, border: R, value: R, other: &Self) {
        for i in 0..W {
            self.mean[i] = border.if_lt(value, other.mean[i], self.mean[i]);
        }
        for j in 0..M {
            for i in 0..W {
                self.directions[j][i] = border.if_lt(value, other.directions[j][i], self.directions[j][i]);
            }
            self.gains[j] = border.if_lt(value, other.gains[j], self.gains[j]);
            self.roots[j] = border.if_lt(value, other.roots[j], self.roots[j]);
        }
        self.information = border.if_lt(value, other.information, self.information);
    }
}

impl<S, A, H, T: Fit, const M: usize> Given<'_, S, A, H, T, M> {
    /// h(f(x, w)) for noise in its own units.
    #[inline(always)]
    fn seen<R: Real, const N: usize, const W: usize>(&self, x: [R; N], w: [R; W]) -> [R; M]
    where
        A: Motion<N, W, Step = S>,
        H: GaussianMeasurement<N, M>,
    {
        self.models.sensor.predict(self.models.at, A::apply(self.models.step, x, w))
    }

    /// L^-1 d in place.
    #[inline(always)]
    fn whitened<R: Real>(&self, d: &mut [R; M]) {
        for i in (0..M).rev() {
            let mut sum = d[i] * self.whiten[i][i];
            for j in 0..i {
                sum = d[j].mul_add(d[j].constant(self.whiten[i][j]), sum);
            }
            d[i] = sum;
        }
    }
}

/// a - b, wrapped into [-pi, pi] where they are angles.
#[inline(always)]
fn difference<R: Float, const M: usize>(a: [R; M], b: &[R; M], angle: [bool; M]) -> [R; M] {
    let mut d = a;
    for i in 0..M {
        d[i] = a[i] - b[i];
        if angle[i] {
            let turns = (d[i] * (0.5 / std::f64::consts::PI)).round();
            d[i] = turns.mul_add(turns.constant(-std::f64::consts::TAU), d[i]);
        }
    }
    d
}

/// How a normal law is fitted: by [`Tangent`], [`Linear`] or [`SigmaPoints`].
pub trait Fit: Copy + Send + Sync + 'static {
    /// Parameters digested for a number of noise components.
    type Spread: Copy + Send + Sync;

    /// Digests the parameters.
    fn spread(&self, components: usize) -> Result<Self::Spread>;

    /// Evaluations of h per particle, and per further pass.
    fn evaluations(components: usize) -> (usize, usize);

    /// Whether it takes nothing but models that it is exact for.
    const EXACT: bool = false;

    /// The fit of the noise of a particle at x, and how many passes it took beyond the first.
    fn fit<R: Float, A, H, const N: usize, const W: usize, const M: usize>(
        given: &Given<'_, A::Step, A, H, Self, M>,
        x: [R; N],
    ) -> (Fitted<R, W, M>, R)
    where
        A: Motion<N, W>,
        H: GaussianMeasurement<N, M>;
}

impl Fit for Tangent {
    type Spread = ();

    fn spread(&self, _: usize) -> Result<()> {
        Ok(())
    }

    fn evaluations(components: usize) -> (usize, usize) {
        (1 + components, 0)
    }

    #[inline(always)]
    fn fit<R: Float, A, H, const N: usize, const W: usize, const M: usize>(
        given: &Given<'_, A::Step, A, H, Self, M>,
        x: [R; N],
    ) -> (Fitted<R, W, M>, R)
    where
        A: Motion<N, W>,
        H: GaussianMeasurement<N, M>,
    {
        tangent(given, x)
    }
}

impl Fit for Linear {
    type Spread = ();

    fn spread(&self, _: usize) -> Result<()> {
        Ok(())
    }

    fn evaluations(components: usize) -> (usize, usize) {
        (1 + components, 0)
    }

    const EXACT: bool = true;

    #[inline(always)]
    fn fit<R: Float, A, H, const N: usize, const W: usize, const M: usize>(
        given: &Given<'_, A::Step, A, H, Self, M>,
        x: [R; N],
    ) -> (Fitted<R, W, M>, R)
    where
        A: Motion<N, W>,
        H: GaussianMeasurement<N, M>,
    {
        tangent(given, x)
    }
}

/// By the tangent of h(f(x, .)) at the mean of the noise.
#[inline(always)]
fn tangent<R: Float, A, H, T: Fit, const N: usize, const W: usize, const M: usize>(
    given: &Given<'_, A::Step, A, H, T, M>,
    x: [R; N],
) -> (Fitted<R, W, M>, R)
where
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    let zero = x[0].constant(0.0);
    let (mean, sd) = given.noise;
    let mut state = [Dual::<W, R>::constant(zero); N];
    for k in 0..N {
        state[k] = Dual::constant(x[k]);
    }
    let mut w = [Dual::<W, R>::constant(zero); W];
    for k in 0..W {
        w[k] = Dual::variable(zero.constant(mean), k);
    }
    let seen = given.seen(state, w);
    let (mut z, mut centre) = ([zero; M], [zero; M]);
    for i in 0..M {
        (z[i], centre[i]) = (zero.constant(given.z[i]), seen[i].value);
    }
    let mut residuals = difference(z, &centre, H::ANGLE);
    given.whitened(&mut residuals);
    let mut rows = [[zero; W]; M];
    for k in 0..W {
        let mut slope = [zero; M];
        for i in 0..M {
            slope[i] = seen[i].gradient[k] * sd;
        }
        given.whitened(&mut slope);
        for i in 0..M {
            rows[i][k] = slope[i];
        }
    }
    if !given.heavy {
        return (Fitted::new(&rows, &residuals), zero);
    }
    (robust(given, &rows, &residuals, None), zero)
}

/// Turns between the scale of heavy-tailed noise and the fit. They begin with the law of the process noise,
/// which makes a residual that is far off an outlier, not news of the state; more than four gain nothing
/// unless the process noise is far wider than R.
const ROBUST_ROUNDS: usize = 4;

/// The fit under noise of covariance s R. No one s serves all particles: near the measurement the tails do
/// not show, and far from it they are all there is. So s and v are taken as independent given the
/// measurement, the normal law of v nearest to its posterior in that form (variational Bayes; Piché, Särkkä
/// and Hartikainen, MLSP 2012): in turns, s follows from the expected distance of the measurement and v from
/// s. The line misses `missed`, if anything.
///
/// R times the variance of the noise, nu / (nu - 2) for Student's law, is no better than R itself: it widens
/// the fit of the many measurements that are no outliers, and still draws the particles to those that are.
#[inline(always)]
fn robust<R: Float, A, H, T: Fit, const N: usize, const W: usize, const M: usize>(
    given: &Given<'_, A::Step, A, H, T, M>,
    rows: &[[R; W]; M],
    residuals: &[R; M],
    missed: Option<&[[R; M]; M]>,
) -> Fitted<R, W, M>
where
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    let mut distance = residuals[0].constant(0.0);
    for i in 0..M {
        distance = residuals[i].mul_add(residuals[i], distance) + dot(&rows[i], &rows[i]);
    }
    let mut fitted = scaled(rows, residuals, missed, given.models.sensor.covariance_scale(distance));
    for _ in 1..ROBUST_ROUNDS {
        let distance = fitted.distance(rows, residuals);
        fitted = scaled(rows, residuals, missed, given.models.sensor.covariance_scale(distance));
    }
    fitted
}

/// Refuses what is not affine in the noise: its slope at the mean and away from it, at two states, must
/// agree.
pub(super) fn affine<A, H, T: Fit, const N: usize, const W: usize, const M: usize>(
    given: &Given<'_, A::Step, A, H, T, M>,
    near: &[f64; N],
) -> Result<()>
where
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    let mean = [given.noise.0; W];
    let off: [f64; W] = from_fn(|i| 1.0 + i as f64 + mean[i]);
    let other: [f64; N] = from_fn(|i| near[i] + (1.0 + near[i].abs()) * (1.0 + 0.25 * i as f64));
    let slope = |x: &[f64; N], w: [f64; W]| {
        Matrix(given.seen(x.map(Dual::constant), Dual::<W>::variables(w)).map(|z| z.gradient))
    };
    if [near, &other].into_iter().all(|x| same(&slope(x, mean), &slope(x, off))) {
        return Ok(());
    }
    Err(Error::Unsupported(
        "the locally optimal proposal needs a measurement that is linear in the process noise".into(),
    ))
}

/// Refuses laws for which the fit is not exact.
pub(super) fn normal<H: GaussianMeasurement<N, M>, const N: usize, const M: usize>(
    noise: Noise,
    sensor: &H,
) -> Result<()> {
    let what = if noise != Noise::StandardNormal {
        "process noise that is not normal"
    } else if H::ANGLE.contains(&true) {
        "a measurement of angles"
    } else if sensor.is_heavy_tailed() {
        "a robust measurement"
    } else {
        return Ok(());
    };
    Err(Error::Unsupported(format!(
        "the locally optimal proposal is for linear normal noise, not for {what}"
    )))
}

impl Fit for SigmaPoints {
    type Spread = Spread;

    fn spread(&self, components: usize) -> Result<Spread> {
        SigmaPoints::spread(self, components)
    }

    fn evaluations(components: usize) -> (usize, usize) {
        let points = 1 + 2 * components;
        (points, points)
    }

    #[inline(always)]
    fn fit<R: Float, A, H, const N: usize, const W: usize, const M: usize>(
        given: &Given<'_, A::Step, A, H, Self, M>,
        x: [R; N],
    ) -> (Fitted<R, W, M>, R)
    where
        A: Motion<N, W>,
        H: GaussianMeasurement<N, M>,
    {
        let zero = x[0].constant(0.0);
        let one = zero.constant(1.0);
        let (mut fitted, mut curvature) = regression(given, x, None);
        let mut more = zero;
        for _ in 1..given.passes {
            if curvature.all_lt(one) {
                break;
            }
            // Lanes that are done keep what they have: others must not see how long their neighbours took.
            let (next, then) = regression(given, x, Some(&fitted));
            fitted.replaced(one, curvature, &next);
            more = one.if_lt(curvature, more + 1.0, more);
            curvature = one.if_lt(curvature, then, curvature);
        }
        (fitted, more)
    }
}

/// By the regression line of h(f(x, .)) over the sigma points of `about` (of the law of the noise itself, if
/// there is none), what the line misses being added to the noise of the measurement: one pass of posterior
/// linearisation (García-Fernández, Svensson, Morelande and Särkkä, IEEE TSP 63, 2015). With it comes the
/// trace of that addition in units of R.
///
/// In the coordinates of `about` = N(m, F F') the points are m +- d F e_j with images y_0 + a_j +- b_j: the
/// line has the slopes b_j / d along F, and misses sum a_j a_j' / d^2 (for the default weights; see
/// [`SigmaPoints`]).
#[inline(always)]
fn regression<R: Float, A, H, const N: usize, const W: usize, const M: usize>(
    given: &Given<'_, A::Step, A, H, SigmaPoints, M>,
    x: [R; N],
    about: Option<&Fitted<R, W, M>>,
) -> (Fitted<R, W, M>, R)
where
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    let zero = x[0].constant(0.0);
    let (noise_mean, sd) = given.noise;
    let Spread { distance, shift, .. } = given.spread;
    let mut v = [zero; W];
    if let Some(about) = about {
        v = about.mean;
    }
    let centre = {
        let mut w = v;
        for i in 0..W {
            w[i] = v[i] * sd + noise_mean;
        }
        given.seen(x, w)
    };
    let per_square = 1.0 / (distance * distance);
    let (mut rows, mut shifted, mut missed) = ([[zero; W]; M], [zero; M], [[zero; M]; M]);
    for j in 0..W {
        let mut column = [zero; W];
        column[j] = zero.constant(distance);
        if let Some(about) = about {
            about.factor(M, &mut column);
        }
        let (mut ahead, mut behind) = (v, v);
        for i in 0..W {
            ahead[i] = (v[i] + column[i]) * sd + noise_mean;
            behind[i] = (v[i] - column[i]) * sd + noise_mean;
        }
        let mut ahead = difference(given.seen(x, ahead), &centre, H::ANGLE);
        let mut behind = difference(given.seen(x, behind), &centre, H::ANGLE);
        given.whitened(&mut ahead);
        given.whitened(&mut behind);
        let mut even = [zero; M];
        for i in 0..M {
            rows[i][j] = (ahead[i] - behind[i]) * (0.5 / distance);
            even[i] = (ahead[i] + behind[i]) * 0.5;
            shifted[i] = even[i].mul_add(zero.constant(per_square), shifted[i]);
        }
        for i in 0..M {
            for k in 0..=i {
                missed[i][k] = (even[i] * per_square).mul_add(even[k], missed[i][k]);
            }
        }
    }
    // The other weights put the centre of the covariance elsewhere: sum (a - e)(a - e)' / d^2 with e = shift
    // times the mean of the images.
    let excess = W as f64 * per_square * shift * shift - 2.0 * shift;
    let mut trace = zero;
    for i in 0..M {
        for k in 0..=i {
            missed[i][k] = (shifted[i] * excess).mul_add(shifted[k], missed[i][k]);
        }
        trace = trace + missed[i][i];
    }
    let mut z = [zero; M];
    for i in 0..M {
        z[i] = zero.constant(given.z[i]);
    }
    let mut residuals = difference(z, &centre, H::ANGLE);
    given.whitened(&mut residuals);
    for i in 0..M {
        residuals[i] = residuals[i] - shifted[i];
        if let Some(about) = about {
            about.unscaled(&mut rows[i]);
            residuals[i] = residuals[i] + dot(&rows[i], &v);
        }
    }
    let fitted = if given.heavy {
        robust(given, &rows, &residuals, Some(&missed))
    } else {
        missing(&rows, &residuals, &missed, zero.constant(1.0))
    };
    (fitted, trace)
}

/// The fit under noise of covariance `scale` I.
#[inline(always)]
fn scaled<R: Float, const W: usize, const M: usize>(
    rows: &[[R; W]; M],
    residuals: &[R; M],
    missed: Option<&[[R; M]; M]>,
    scale: R,
) -> Fitted<R, W, M> {
    if let Some(missed) = missed {
        return missing(rows, residuals, missed, scale);
    }
    let (mut rows, mut residuals) = (*rows, *residuals);
    let per_root = scale.constant(1.0) / scale.sqrt();
    for i in 0..M {
        residuals[i] = residuals[i] * per_root;
        for k in 0..W {
            rows[i][k] = rows[i][k] * per_root;
        }
    }
    Fitted::new(&rows, &residuals)
}

/// The fit where the line misses `missed` beside noise of covariance `scale` I: whitened once more.
#[inline(always)]
fn missing<R: Float, const W: usize, const M: usize>(
    rows: &[[R; W]; M],
    residuals: &[R; M],
    missed: &[[R; M]; M],
    scale: R,
) -> Fitted<R, W, M> {
    let (mut rows, mut residuals, mut lower) = (*rows, *residuals, *missed);
    for i in 0..M {
        for k in 0..=i {
            let mut rest = if i == k { missed[i][k] + scale } else { missed[i][k] };
            for l in 0..k {
                rest = (-lower[i][l]).mul_add(lower[k][l], rest);
            }
            lower[i][k] = if i == k { rest.sqrt() } else { rest / lower[k][k] };
        }
        for k in 0..i {
            residuals[i] = (-lower[i][k]).mul_add(residuals[k], residuals[i]);
            for j in 0..W {
                rows[i][j] = (-lower[i][k]).mul_add(rows[k][j], rows[i][j]);
            }
        }
        let per = scale.constant(1.0) / lower[i][i];
        residuals[i] = residuals[i] * per;
        for j in 0..W {
            rows[i][j] = rows[i][j] * per;
        }
    }
    Fitted::new(&rows, &residuals)
}
