//! MEM-EKF*: an ellipse by its orientation and semi-axes, seen through multiplicative noise.

use super::centre::{Centre, Seen, check, check_noise};
use super::shape::Shape;
use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::filter::{Filter, Outcome, Tangent, Update, predict_law};
use crate::math::gaussian::log_density;
use crate::math::{Cholesky, Matrix, sin_cos};
use crate::model::Motion;
use crate::rng::Stream;
use crate::time::Time;
use serde::{Deserialize, Serialize};
use std::array::from_fn;
use std::f64::consts::{FRAC_PI_2, PI};

/// Settings of a [`MemEkf`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MemSettings {
    /// Variance of each component of the multiplicative noise h: 1/4 (default) for points spread evenly over the
    /// ellipse, 1 for points from a normal law whose standard deviations the semi-axes then are.
    pub multiplicative: f64,
    /// Noise of the sensor on each point, m^2; none by default.
    pub noise: Matrix<2, 2>,
    /// How fast the shape wanders: standard deviations of orientation (rad) and semi-axes (m) after one second; zero by
    /// default.
    pub wander: [f64; 3],
    /// Least semi-axis, m: 1e-3 by default.
    pub floor: f64,
}

impl Default for MemSettings {
    fn default() -> Self {
        MemSettings { multiplicative: 0.25, noise: Matrix::ZERO, wander: [0.0; 3], floor: 1e-3 }
    }
}

/// The filter (Yang and Baum, IEEE Transactions on Signal Processing 67(18), 2019): points
/// y = h(x) + R(a) diag(l1, l2) h + v, taken in one after the other, each by a Kalman update of the state, and one of
/// the shape p = (a, l1, l2) by the squares and the product of its innovation. Orders of the points differ in rounding
/// and linearisation only.
///
/// Its evidence is the sum over the points of ln N(y; predicted mean, predicted covariance), each after those before:
/// the multiplicative noise times the uncertain shape is taken as normal.
#[derive(Clone, Debug)]
pub struct MemEkf<A, C, const N: usize, const W: usize> {
    motion: A,
    centre: C,
    prior: Gaussian<N>,
    axes: Gaussian<3>,
    settings: MemSettings,
}

/// What a [`MemEkf`] knows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MemBelief<const N: usize> {
    /// Time of the last step.
    pub time: Time,
    /// Law of the state.
    pub state: Gaussian<N>,
    /// Law of the orientation of the first axis (rad, not wrapped) and of both semi-axes (m).
    pub axes: Gaussian<3>,
    /// Variance of the multiplicative noise.
    pub multiplicative: f64,
}

impl<const N: usize> MemBelief<N> {
    /// Orientation of the first axis in (-pi/2, pi/2], rad.
    pub fn orientation(&self) -> f64 {
        let rest = self.axes.mean()[0] % PI;
        if rest > FRAC_PI_2 {
            rest - PI
        } else if rest <= -FRAC_PI_2 {
            rest + PI
        } else {
            rest
        }
    }

    /// Both semi-axes, m.
    pub fn semi_axes(&self) -> [f64; 2] {
        let [_, a, b] = *self.axes.mean();
        [a, b]
    }

    /// The ellipse of the points about the centre at the mean of the axes.
    ///
    /// # Errors
    /// None for beliefs of a filter.
    pub fn shape(&self) -> Result<Shape> {
        let s = sides(self.axes.mean());
        Shape::ellipse(s.congruence(&(Matrix::identity() * self.multiplicative)))
    }
}

/// S = R(a) diag(l1, l2).
fn sides([angle, a, b]: &[f64; 3]) -> Matrix<2, 2> {
    let (sin, cos) = sin_cos(*angle);
    Matrix([[a * cos, -b * sin], [a * sin, b * cos]])
}

impl<A, C, const N: usize, const W: usize> MemEkf<A, C, N, W>
where
    A: Motion<N, W>,
    C: Centre<N>,
{
    /// Starts from a state and from an orientation (rad) and semi-axes (m).
    ///
    /// # Errors
    /// Settings that mean nothing; semi-axes below the floor.
    pub fn new(
        motion: A,
        centre: C,
        prior: Gaussian<N>,
        axes: Gaussian<3>,
        settings: MemSettings,
    ) -> Result<Self> {
        Error::positive("variance of the multiplicative noise", settings.multiplicative)?;
        check_noise(&settings.noise)?;
        Error::positive("least semi-axis", settings.floor)?;
        for sd in settings.wander {
            Error::not_negative("wander of a shape", sd)?;
        }
        for &value in &axes.mean()[1..] {
            if value < settings.floor {
                let needs = "it must not be below the least semi-axis";
                return Err(Error::OutOfRange { what: "semi-axis", value, needs });
            }
        }
        Ok(MemEkf { motion, centre, prior, axes, settings })
    }

    /// Takes in one point; its log-density.
    fn take(&self, state: &mut Gaussian<N>, axes: &mut Gaussian<3>, y: [f64; 2]) -> Result<f64> {
        let c = self.settings.multiplicative;
        let p = axes.mean();
        let (sin, cos) = sin_cos(p[0]);
        let s = sides(p);
        // Rows of S and how they change with p: S_m h has the gradient J_m' h.
        let j = [
            Matrix([[-p[1] * sin, cos, 0.0], [-p[2] * cos, 0.0, -sin]]),
            Matrix([[p[1] * cos, sin, 0.0], [-p[2] * sin, 0.0, cos]]),
        ];
        // tr(C_p J_n' C_h J_m): what the uncertain shape adds.
        let blur = Matrix::<2, 2>::from_entries(|m, n| {
            let both = j[m] * *axes.covariance() * j[n].transpose();
            c * (both.0[0][0] + both.0[1][1])
        });
        let seen = Seen::of(&self.centre, state);
        let noise = s.congruence(&(Matrix::identity() * c)) + blur + self.settings.noise;
        let covariance = (seen.spread + noise).symmetrised();
        let innovation = Cholesky::of("innovation covariance", &covariance)?;
        let d = [y[0] - seen.at[0], y[1] - seen.at[1]];
        let log_evidence = Error::finite("log-evidence of a point", log_density(&d, &innovation))?;

        // Squares and product of the innovation: mean, covariance (those of normal d) and slope by p.
        let [[xx, xy], [_, yy]] = covariance.0;
        let surprise = [d[0].mul_add(d[0], -xx), d[1].mul_add(d[1], -yy), d[0].mul_add(d[1], -xy)];
        let spread = Matrix([
            [2.0 * xx * xx, 2.0 * xy * xy, 2.0 * xx * xy],
            [2.0 * xy * xy, 2.0 * yy * yy, 2.0 * yy * xy],
            [2.0 * xx * xy, 2.0 * yy * xy, xx.mul_add(yy, xy * xy)],
        ]);
        let along = |m: usize, n: usize| -> [f64; 3] {
            from_fn(|k| c * (s.0[m][0] * j[n].0[0][k] + s.0[m][1] * j[n].0[1][k]))
        };
        let (first, second, mixed) = (along(0, 0), along(1, 1), [along(0, 1), along(1, 0)]);
        let slope =
            Matrix([first.map(|x| 2.0 * x), second.map(|x| 2.0 * x), from_fn(|k| mixed[0][k] + mixed[1][k])]);
        let gain = Cholesky::of("covariance of the squared innovation", &spread)?
            .solve_matrix(&(slope * *axes.covariance()))
            .transpose();
        let correction = gain * surprise;
        let mean: [f64; 3] = from_fn(|k| p[k] + correction[k]);
        let rest = spread - slope.congruence(axes.covariance());
        let kept = (Matrix::identity() - gain * slope).congruence(axes.covariance());
        let after = (kept + gain.congruence(&rest)).symmetrised();
        *state = seen.correct(state, y, &noise.symmetrised(), &innovation)?;
        *axes = self.folded(mean, after)?;
        Ok(log_evidence)
    }

    /// The same ellipse with semi-axes above zero: l and -l are one.
    fn folded(&self, mut mean: [f64; 3], mut covariance: Matrix<3, 3>) -> Result<Gaussian<3>> {
        for k in 1..3 {
            if mean[k] < 0.0 {
                mean[k] = -mean[k];
                for i in (0..3).filter(|i| *i != k) {
                    covariance.0[i][k] = -covariance.0[i][k];
                    covariance.0[k][i] = -covariance.0[k][i];
                }
            }
            mean[k] = mean[k].max(self.settings.floor);
        }
        Gaussian::computed("axes", "covariance of the axes", mean, covariance)
    }
}

impl<A, C, const N: usize, const W: usize> Filter for MemEkf<A, C, N, W>
where
    A: Motion<N, W>,
    C: Centre<N>,
{
    type Measurement = Vec<[f64; 2]>;
    type Belief = MemBelief<N>;

    fn start(&self, at: Time, _: Stream) -> Result<MemBelief<N>> {
        let multiplicative = self.settings.multiplicative;
        Ok(MemBelief { time: at, state: self.prior, axes: self.axes, multiplicative })
    }

    fn step(&self, belief: &mut MemBelief<N>, to: Time, scan: Option<&Vec<[f64; 2]>>) -> Result<Update> {
        let mut state = predict_law(&Tangent, &self.motion, &belief.state, belief.time, to)?;
        let elapsed = (to - belief.time).secs();
        let wandered = Matrix::from_diagonal(self.settings.wander.map(|sd| sd * sd * elapsed));
        let grown = *belief.axes.covariance() + wandered;
        let mut axes = Gaussian::computed("axes", "covariance of the axes", *belief.axes.mean(), grown)?;
        let (mut log_evidence, mut outcome) = (0.0, Outcome::Predicted);
        if let Some(points) = scan {
            check(points)?;
            outcome = Outcome::Updated;
            for y in points {
                log_evidence += self.take(&mut state, &mut axes, *y)?;
            }
        }
        *belief = MemBelief { time: to, state, axes, multiplicative: self.settings.multiplicative };
        Ok(Update { outcome, log_evidence, particles: None })
    }
}
