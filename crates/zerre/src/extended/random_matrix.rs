//! Random matrices: one ellipse, whose extent has an inverse-Wishart law.

use super::centre::{Centre, Seen, check, check_noise};
use super::inverse_wishart::InverseWishart;
use super::rate::Rate;
use super::shape::Shape;
use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::filter::{Filter, Outcome, Tangent, Update, predict_law};
use crate::math::{Cholesky, Matrix, exp, ln};
use crate::model::Motion;
use crate::rng::Stream;
use crate::time::Time;
use serde::{Deserialize, Serialize};

/// How a scan corrects centre and extent X; its points are y = h(x) + e.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rule {
    /// e ~ N(0, scaling X), and the covariance of the state is P (x) X, in proportion to the extent: the exact
    /// posterior (Koch, IEEE Transactions on Aerospace and Electronic Systems 44(3), 2008). It holds for states made of
    /// planar vectors (position, velocity, ...) that a linear motion treats alike along both axes. The process noise
    /// of the motion, and the prior covariance of the state, are those at an extent of `unit` times the identity.
    Koch {
        /// Variance that the noise of the motion is given at, m^2.
        unit: f64,
    },
    /// e ~ N(0, scaling X + noise), the state being independent of the extent: moments matched (Feldmann, Fränken and
    /// Koch, IEEE Transactions on Signal Processing 59(4), 2011). Square roots are the symmetric ones.
    Feldmann {
        /// Noise of the sensor on each point, m^2.
        noise: Matrix<2, 2>,
    },
}

/// Settings of a [`RandomMatrix`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RandomMatrixSettings {
    /// How a scan corrects.
    pub rule: Rule,
    /// Covariance of points in units of X: 1 (default) for points from a normal law, 1/4 for points spread evenly over
    /// the ellipse x'X^-1 x <= 1.
    pub scaling: f64,
    /// Time constant of the forgetting of the extent, s; none (default) for an extent that stays.
    pub forgetting: Option<f64>,
    /// Least eigenvalue of the mean extent, m^2: 1e-9 by default.
    pub floor: f64,
    /// Number of points in a scan: with it this is the gamma Gaussian inverse-Wishart filter (Granström and Orguner,
    /// IEEE Transactions on Signal Processing 60(11), 2012).
    pub rate: Rate,
}

impl Default for RandomMatrixSettings {
    fn default() -> Self {
        RandomMatrixSettings {
            rule: Rule::Feldmann { noise: Matrix::ZERO },
            scaling: 1.0,
            forgetting: None,
            floor: 1e-9,
            rate: Rate { points: 5.0, scans: 0.5, keep: 1.0 },
        }
    }
}

/// The filter. Its evidence is the predictive density of the points, their number given: exact for [`Rule::Koch`]; for
/// [`Rule::Feldmann`] that of the matched model, in which (scaled) innovation and residuals are N(0, X). It is
/// a density, which integrates to one, under either. [`Rate::log_probability`] adds that of the number.
#[derive(Clone, Debug)]
pub struct RandomMatrix<A, C, const N: usize, const W: usize> {
    motion: A,
    centre: C,
    prior: Gaussian<N>,
    extent: InverseWishart,
    settings: RandomMatrixSettings,
}

/// What a [`RandomMatrix`] knows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RandomMatrixBelief<const N: usize> {
    /// Time of the last step.
    pub time: Time,
    /// Law of the state; under [`Rule::Koch`] at the mean extent.
    pub state: Gaussian<N>,
    /// Law of X.
    pub extent: InverseWishart,
    /// Points in a scan.
    pub rate: Rate,
    /// Covariance of points in units of X.
    pub scaling: f64,
}

impl<const N: usize> RandomMatrixBelief<N> {
    /// The ellipse of the points about the centre: scaling times the mean of X.
    ///
    /// # Errors
    /// None for beliefs of a filter.
    pub fn shape(&self) -> Result<Shape> {
        Shape::ellipse(*self.extent.mean() * self.scaling)
    }
}

/// Number, mean and scatter about the mean of the points of a scan.
struct Summary {
    count: f64,
    mean: [f64; 2],
    scatter: Matrix<2, 2>,
}

impl Summary {
    /// None of an empty scan.
    fn of(points: &[[f64; 2]]) -> Option<Summary> {
        let first = *points.first()?;
        let count = points.len() as f64;
        // From the first point on, so that nothing is lost far from the origin.
        let apart = |y: &[f64; 2], from: [f64; 2]| [y[0] - from[0], y[1] - from[1]];
        let sum = points.iter().map(|y| apart(y, first)).fold([0.0; 2], |s, d| [s[0] + d[0], s[1] + d[1]]);
        let mean = [first[0] + sum[0] / count, first[1] + sum[1] / count];
        let scatter =
            points.iter().map(|y| apart(y, mean)).fold(Matrix::ZERO, |s, d| s + Matrix::outer(&d, &d));
        Some(Summary { count, mean, scatter })
    }
}

/// The symmetric root of a positive definite matrix: (A + sqrt(det A) I) / sqrt(tr A + 2 sqrt(det A)).
fn root(a: &Matrix<2, 2>) -> Result<Matrix<2, 2>> {
    let lower = Cholesky::of("extent", a)?.factor().0;
    let det_root = lower[0][0] * lower[1][1];
    let trace = a.0[0][0] + a.0[1][1];
    Ok((*a + Matrix::identity() * det_root) * (1.0 / 2.0f64.mul_add(det_root, trace).sqrt()))
}

/// A^1/2 B^-1/2 of positive definite matrices.
fn ratio(a: &Matrix<2, 2>, b: &Matrix<2, 2>) -> Result<Matrix<2, 2>> {
    let inverse = Cholesky::of("root of a covariance", &root(b)?)?.inverse();
    Ok(root(a)? * inverse)
}

/// P (x) X from P (x) I, or back with the inverse: `by` times every 2 x 2 block.
fn dressed<const N: usize>(covariance: &Matrix<N, N>, by: &Matrix<2, 2>) -> Matrix<N, N> {
    Matrix::from_entries(|i, j| covariance.0[i & !1][j & !1] * by.0[i & 1][j & 1])
}

/// Refuses a covariance that is not P (x) I.
fn check_alike<const N: usize>(what: &'static str, covariance: &Matrix<N, N>) -> Result<()> {
    let limit = 1e-9 * covariance.max_abs();
    let alike = dressed(covariance, &Matrix::identity());
    if N.is_multiple_of(2) && (*covariance - alike).max_abs() <= limit {
        return Ok(());
    }
    let why = format!("Koch's rule needs a {what} of planar vectors, the same along both axes");
    Err(Error::Unsupported(why))
}

impl<A, C, const N: usize, const W: usize> RandomMatrix<A, C, N, W>
where
    A: Motion<N, W>,
    C: Centre<N>,
{
    /// Starts from a state and an extent that are independent but for what the rule says.
    ///
    /// # Errors
    /// Settings that mean nothing; for [`Rule::Koch`] a prior covariance that is not the same along both axes.
    pub fn new(
        motion: A,
        centre: C,
        prior: Gaussian<N>,
        extent: InverseWishart,
        settings: RandomMatrixSettings,
    ) -> Result<Self> {
        match &settings.rule {
            Rule::Koch { unit } => {
                Error::positive("unit of an extent", *unit)?;
                check_alike("prior", prior.covariance())?;
            }
            Rule::Feldmann { noise } => check_noise(noise)?,
        }
        Error::positive("scaling of an extent", settings.scaling)?;
        Error::positive("least eigenvalue of an extent", settings.floor)?;
        if let Some(tau) = settings.forgetting {
            Error::positive("time constant of an extent", tau)?;
        }
        Ok(RandomMatrix { motion, centre, prior, extent, settings })
    }

    /// State and extent at `to`, before its points. For Koch's rule the state is that of P (x) unit I.
    fn ahead(&self, belief: &RandomMatrixBelief<N>, to: Time) -> Result<(Gaussian<N>, InverseWishart)> {
        let state = match self.settings.rule {
            Rule::Koch { unit } => {
                let inverse = Cholesky::of("extent", belief.extent.mean())?.inverse();
                // Of a block p X, tr(X^-1 p X) / 2 is p.
                let block = |i: usize, j: usize| {
                    let c = &belief.state.covariance().0;
                    let b = Matrix([[c[i][j], c[i][j + 1]], [c[i + 1][j], c[i + 1][j + 1]]]);
                    let both = inverse * b;
                    0.5 * unit * (both.0[0][0] + both.0[1][1])
                };
                let bare =
                    Matrix::from_entries(|i, j| if i % 2 == j % 2 { block(i & !1, j & !1) } else { 0.0 });
                let now = Gaussian::computed("mean", "covariance", *belief.state.mean(), bare)?;
                let ahead = predict_law(&Tangent, &self.motion, &now, belief.time, to)?;
                check_alike("motion", ahead.covariance())?;
                ahead
            }
            Rule::Feldmann { .. } => predict_law(&Tangent, &self.motion, &belief.state, belief.time, to)?,
        };
        let keep = self.settings.forgetting.map_or(1.0, |tau| exp(-(to - belief.time).secs() / tau));
        Ok((state, belief.extent.forgotten(keep)))
    }

    /// P (x) X from the state at P (x) unit I.
    fn dress(state: &Gaussian<N>, extent: &InverseWishart, unit: f64) -> Result<Gaussian<N>> {
        let covariance = dressed(state.covariance(), &(*extent.mean() * (1.0 / unit)));
        Gaussian::computed("mean", "covariance", *state.mean(), covariance)
    }

    /// Takes in points; the new laws, and the log-density of the points.
    fn take(
        &self,
        state: &Gaussian<N>,
        extent: &InverseWishart,
        points: &Summary,
    ) -> Result<(Gaussian<N>, InverseWishart, f64)> {
        let (n, scaling) = (points.count, self.settings.scaling);
        let seen = Seen::of(&self.centre, state);
        let d = [points.mean[0] - seen.at[0], points.mean[1] - seen.at[1]];
        let identity = Matrix::<2, 2>::identity();
        // Covariances in which the mean of the points deviates from its prediction, and the points from their mean,
        // the matrices that turn those into X, and the noise that the mean of the points has for the state.
        let (by_mean, by_point, noise) = match &self.settings.rule {
            Rule::Koch { unit } => {
                check_alike("centre", &seen.spread)?;
                let s = seen.spread.0[0][0] / unit + scaling / n;
                (
                    identity * (1.0 / s.sqrt()),
                    identity * (1.0 / scaling.sqrt()),
                    identity * (scaling * unit / n),
                )
            }
            Rule::Feldmann { noise } => {
                let point = *extent.mean() * scaling + *noise;
                let mean = seen.spread + point * (1.0 / n);
                (ratio(extent.mean(), &mean)?, ratio(extent.mean(), &point)?, point * (1.0 / n))
            }
        };
        let innovation = Cholesky::of("innovation covariance", &(seen.spread + noise).symmetrised())?;
        let corrected = seen.correct(state, points.mean, &noise, &innovation)?;
        let scatter = by_mean.congruence(&Matrix::outer(&d, &d)) + by_point.congruence(&points.scatter);
        let after = extent.with(n, &scatter, self.settings.floor)?;
        let log_det = |m: &Matrix<2, 2>| ln(m.0[0][0] * m.0[1][1] - m.0[0][1] * m.0[1][0]);
        // The law of innovation and residuals under X ~ IW is a matrix t.
        let log_evidence = InverseWishart::log_normaliser(&(extent.scale() + scatter), extent.dof() + n)?
            - InverseWishart::log_normaliser(&extent.scale(), extent.dof())?
            - n * ln(std::f64::consts::PI)
            - ln(n)
            + log_det(&by_mean)
            + (n - 1.0) * log_det(&by_point);
        Ok((corrected, after, Error::finite("log-evidence of a scan", log_evidence)?))
    }
}

impl<A, C, const N: usize, const W: usize> Filter for RandomMatrix<A, C, N, W>
where
    A: Motion<N, W>,
    C: Centre<N>,
{
    type Measurement = Vec<[f64; 2]>;
    type Belief = RandomMatrixBelief<N>;

    fn start(&self, at: Time, _: Stream) -> Result<RandomMatrixBelief<N>> {
        let state = match self.settings.rule {
            Rule::Koch { unit } => Self::dress(&self.prior, &self.extent, unit)?,
            Rule::Feldmann { .. } => self.prior,
        };
        let RandomMatrixSettings { rate, scaling, .. } = self.settings;
        Ok(RandomMatrixBelief { time: at, state, extent: self.extent, rate, scaling })
    }

    fn step(
        &self,
        belief: &mut RandomMatrixBelief<N>,
        to: Time,
        scan: Option<&Vec<[f64; 2]>>,
    ) -> Result<Update> {
        let (mut state, mut extent) = self.ahead(belief, to)?;
        let (mut rate, mut log_evidence, mut outcome) = (belief.rate, 0.0, Outcome::Predicted);
        if let Some(points) = scan {
            check(points)?;
            outcome = Outcome::Updated;
            rate.predict();
            rate.update(points.len() as f64);
            if let Some(points) = Summary::of(points) {
                (state, extent, log_evidence) = self.take(&state, &extent, &points)?;
            }
        }
        if let Rule::Koch { unit } = self.settings.rule {
            state = Self::dress(&state, &extent, unit)?;
        }
        *belief = RandomMatrixBelief { time: to, state, extent, rate, scaling: self.settings.scaling };
        Ok(Update { outcome, log_evidence, particles: None })
    }
}
