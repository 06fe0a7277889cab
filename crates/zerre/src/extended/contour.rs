//! A star-convex outline, its radius a Gaussian process of the angle.

use super::centre::{Centre, Seen, check};
use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::filter::{Filter, MotionTangent, Outcome, Tangent, Update, predict_law};
use crate::math::gaussian::log_density;
use crate::math::{Cholesky, Matrix, Real, dot, exp, sin_cos};
use crate::model::Motion;
use crate::rng::Stream;
use crate::time::Time;
use serde::{Deserialize, Serialize};
use std::array::from_fn;
use std::f64::consts::TAU;

/// Law of the radius before any point: `radius` plus a Gaussian process with covariance
/// `deviation`^2 exp(-2 sin^2(u / 2) / `length`^2) + `common`^2 between angles that lie u apart (Wahlström and Özkan
/// 2015).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RadiusProcess {
    /// Mean radius, m.
    pub radius: f64,
    /// Standard deviation of what all angles have in common, m.
    pub common: f64,
    /// Standard deviation of what they differ by, m.
    pub deviation: f64,
    /// Length scale, rad: pi/4 follows smooth outlines, corners need less.
    pub length: f64,
}

/// Where between centre and outline points come from: at a share of the radius with this mean and variance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Depth {
    /// Mean share.
    pub mean: f64,
    /// Variance of the share.
    pub variance: f64,
}

impl Depth {
    /// Points of the outline.
    pub const EDGE: Depth = Depth { mean: 1.0, variance: 0.0 };
    /// Points spread evenly over the inside, whose squared share is uniform.
    pub const SURFACE: Depth = Depth { mean: 2.0 / 3.0, variance: 1.0 / 18.0 };
    /// Points of a normal law whose outline is drawn at two standard deviations: the share is half a Rayleigh number,
    /// of mean sqrt(pi / 8) and variance 1/2 - pi/8.
    pub const NORMAL: Depth = Depth { mean: 0.626_657_068_657_750_1, variance: 0.107_300_918_301_275_9 };
}

/// Settings of a [`Contour`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContourSettings {
    /// Law of the radius before any point.
    pub process: RadiusProcess,
    /// Rate at which the radius goes back to that law, 1/s: 0 for a shape that stays.
    pub forgetting: f64,
    /// Noise of the sensor on each point, m^2: positive definite.
    pub noise: Matrix<2, 2>,
    /// Where points come from.
    pub depth: Depth,
}

/// The filter (Wahlström and Özkan, IEEE Transactions on Signal Processing 63(16), 2015): state and radii at `B` angles
/// are jointly normal, and all points of a scan correct them by the tangents at the prediction (an extended Kalman
/// update). A point y = c + s p(u) r(u) + v lies at the angle u at which it is seen from the predicted centre c; r(u) is
/// interpolated from the radii, with the interpolation's variance for noise. The outline keeps its
/// orientation. Angles are counterclockwise from the first axis.
///
/// In the tangent by the centre each point has the share of the radius at which it is seen. With the mean share in its
/// place, points that lie further out or in would tell of the centre across the radius, where by the choice of the
/// angle there is no error: the filter would believe its prediction and lose the target.
///
/// Centre and outline move against each other unseen (the first harmonic of the radius is a shift), so the state is
/// known no better than the prior of both says; what is seen is the outline in the plane.
///
/// Its evidence is the density of the points by the tangents: normal, all points of the scan together, the angles at
/// which they are seen being given.
#[derive(Clone, Debug)]
pub struct Contour<A, C, const N: usize, const W: usize, const B: usize = 20> {
    motion: A,
    centre: C,
    prior: Gaussian<N>,
    settings: ContourSettings,
    /// Unit vectors of the angles.
    directions: [[f64; 2]; B],
    /// Of the radii, before any point.
    covariance: Matrix<B, B>,
    factor: Cholesky<B>,
}

/// What a [`Contour`] knows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContourBelief<const N: usize, const B: usize = 20> {
    /// Time of the last step.
    pub time: Time,
    /// Law of the state.
    pub state: Gaussian<N>,
    /// Law of the radii at the angles 2 pi i / B, m.
    pub radii: Gaussian<B>,
    /// Covariance of state and radii.
    pub cross: Matrix<N, B>,
}

/// A point of an outline.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OutlinePoint {
    /// Where it is at the mean, m.
    pub at: [f64; 2],
    /// Its angle about the centre, rad.
    pub angle: f64,
    /// Mean radius, m.
    pub radius: f64,
    /// Standard deviation of the radius, m; that of the centre is not in it.
    pub deviation: f64,
}

/// The radius in one direction.
struct Radius<const B: usize> {
    mean: f64,
    /// Its derivative by the angle.
    slope: f64,
    /// By the radii.
    weights: [f64; B],
    /// Variance when the radii are known.
    rest: f64,
}

/// The outline's variance beside that of its process, which keeps close angles apart in the arithmetic.
const NUGGET: f64 = 1e-9;

impl<A, C, const N: usize, const W: usize, const B: usize> Contour<A, C, N, W, B>
where
    A: Motion<N, W>,
    C: Centre<N>,
{
    /// Starts from a state; the radii start from the law of the settings.
    ///
    /// # Errors
    /// Settings that mean nothing; fewer than 3 angles.
    pub fn new(motion: A, centre: C, prior: Gaussian<N>, settings: ContourSettings) -> Result<Self> {
        let ContourSettings { process, forgetting, noise, depth } = settings;
        Error::positive("mean radius", process.radius)?;
        Error::not_negative("deviation of the common radius", process.common)?;
        Error::positive("deviation of the radius", process.deviation)?;
        Error::positive("length scale of the radius", process.length)?;
        Error::not_negative("forgetting of the radius", forgetting)?;
        Error::positive("mean depth of points", depth.mean)?;
        Error::not_negative("variance of the depth of points", depth.variance)?;
        Cholesky::of("noise of the sensor", &noise)?;
        if B < 3 {
            let needs = "it must be at least 3";
            return Err(Error::OutOfRange { what: "number of angles", value: B as f64, needs });
        }
        let directions = from_fn(|i| {
            let (sin, cos) = sin_cos(TAU * i as f64 / B as f64);
            [cos, sin]
        });
        let covariance = Matrix::from_entries(|i, j| {
            let nugget = if i == j { NUGGET * process.deviation * process.deviation } else { 0.0 };
            process.covariance(dot(&directions[i], &directions[j])) + nugget
        })
        .symmetrised();
        let factor = Cholesky::of("covariance of the radii", &covariance)?;
        Ok(Contour { motion, centre, prior, settings, directions, covariance, factor })
    }

    /// The radius in the direction of the unit vector `u` when the radii have mean `radii`.
    fn radius_along(&self, radii: &[f64; B], u: [f64; 2]) -> Radius<B> {
        let process = &self.settings.process;
        let cosines: [f64; B] = from_fn(|i| dot(&u, &self.directions[i]));
        let covariances = cosines.map(|cos| process.covariance(cos));
        let weights = self.factor.solve(&covariances);
        let apart = radii.map(|r| r - process.radius);
        let digest = self.factor.solve(&apart);
        let slope = (0..B).fold(0.0, |sum, i| {
            let sine = u[1] * self.directions[i][0] - u[0] * self.directions[i][1];
            let own = covariances[i] - process.common * process.common;
            sum - own * sine / (process.length * process.length) * digest[i]
        });
        let rest = (process.covariance(1.0) - dot(&weights, &covariances)).max(0.0);
        Radius { mean: process.radius + dot(&weights, &apart), slope, weights, rest }
    }

    /// `count` points of the outline, at even angles from 0 on.
    ///
    /// # Errors
    /// None for beliefs of this filter.
    pub fn outline(&self, belief: &ContourBelief<N, B>, count: usize) -> Result<Vec<OutlinePoint>> {
        let centre = Seen::of(&self.centre, &belief.state).at;
        let point = |i: usize| {
            let angle = TAU * i as f64 / count as f64;
            let (sin, cos) = sin_cos(angle);
            let radius = self.radius_along(belief.radii.mean(), [cos, sin]);
            let known = belief.radii.covariance().quadratic(&radius.weights, &radius.weights);
            let at = [radius.mean.mul_add(cos, centre[0]), radius.mean.mul_add(sin, centre[1])];
            let deviation = Error::finite("variance of a radius", known.max(0.0) + radius.rest)?.sqrt();
            Ok(OutlinePoint { at, angle, radius: radius.mean, deviation })
        };
        (0..count).map(point).collect()
    }

    /// Whether `y` lies within the mean outline.
    pub fn holds(&self, belief: &ContourBelief<N, B>, y: [f64; 2]) -> bool {
        let centre = Seen::of(&self.centre, &belief.state).at;
        let (u, distance) = direction([y[0] - centre[0], y[1] - centre[1]]);
        distance <= self.radius_along(belief.radii.mean(), u).mean
    }

    /// The belief at `to`, before its points.
    fn ahead(&self, belief: &ContourBelief<N, B>, to: Time) -> Result<ContourBelief<N, B>> {
        let state = predict_law(&Tangent, &self.motion, &belief.state, belief.time, to)?;
        if to == belief.time {
            return Ok(*belief);
        }
        let step = self.motion.over(belief.time, to)?;
        let mean = [self.motion.noise().mean(); W];
        let tangent = MotionTangent::<N, W>::at::<A>(&step, belief.state.mean(), &mean);
        let keep = exp(-self.settings.forgetting * (to - belief.time).secs());
        let first = self.settings.process.radius;
        let old = keep * keep;
        let radii = Gaussian::computed(
            "radii",
            "covariance of the radii",
            belief.radii.mean().map(|r| keep.mul_add(r - first, first)),
            *belief.radii.covariance() * old + self.covariance * (1.0 - old),
        )?;
        Ok(ContourBelief { time: to, state, radii, cross: tangent.by_state * belief.cross * keep })
    }

    /// Takes in the points of a scan; their log-density.
    fn take(&self, belief: &mut ContourBelief<N, B>, points: &[[f64; 2]]) -> Result<f64> {
        let ContourSettings { process, noise, depth, .. } = self.settings;
        let ahead = *belief;
        let seen = Seen::of(&self.centre, &ahead.state);
        let (mut x, mut f) = (*ahead.state.mean(), *ahead.radii.mean());
        let (mut p_xx, mut p_ff, mut p_xf) =
            (*ahead.state.covariance(), *ahead.radii.covariance(), ahead.cross);
        let mut log_evidence = 0.0;
        for y in points {
            let d = [y[0] - seen.at[0], y[1] - seen.at[1]];
            let (u, distance) = direction(d);
            let radius = self.radius_along(ahead.radii.mean(), u);
            let share = depth.mean * radius.mean;
            // How the point moves with the centre: its angle turns by the inverse of its distance, share and radius.
            let lean = radius.slope / radius.mean.max(1e-6 * process.radius);
            let by_state = Matrix::outer(&u, &[u[0] + lean * u[1], u[1] - lean * u[0]]) * seen.slope;
            let by_radii = Matrix::outer(&u, &radius.weights.map(|w| depth.mean * w));
            let known = ahead.radii.covariance().quadratic(&radius.weights, &radius.weights) + radius.rest;
            let along = depth.mean * depth.mean * radius.rest
                + depth.variance * radius.mean.mul_add(radius.mean, known);

            // All tangents are those at the prediction: points in turn correct as all at once would.
            let moved = by_state * from_fn(|i| x[i] - ahead.state.mean()[i]);
            let grown = by_radii * from_fn(|i| f[i] - ahead.radii.mean()[i]);
            let e = from_fn(|k| u[k] * (distance - share) - moved[k] - grown[k]);
            let of_x = p_xx * by_state.transpose() + p_xf * by_radii.transpose();
            let of_f = p_xf.transpose() * by_state.transpose() + p_ff * by_radii.transpose();
            let s = by_state * of_x + by_radii * of_f + noise + Matrix::outer(&u, &u) * along;
            let innovation = Cholesky::of("innovation covariance", &s.symmetrised())?;
            log_evidence += log_density(&e, &innovation);
            let white = innovation.whiten(&e);
            let (root_x, root_f) = (whitened(&of_x, &innovation), whitened(&of_f, &innovation));
            for i in 0..N {
                x[i] += dot(&root_x.0[i], &white);
            }
            for i in 0..B {
                f[i] += dot(&root_f.0[i], &white);
            }
            take_off(&mut p_xx, &root_x, &root_x);
            take_off(&mut p_ff, &root_f, &root_f);
            take_off(&mut p_xf, &root_x, &root_f);
        }
        belief.state = Gaussian::computed("mean", "covariance", x, p_xx)?;
        belief.radii = Gaussian::computed("radii", "covariance of the radii", f, p_ff)?;
        p_xf.finite("covariance of state and radii")?;
        belief.cross = p_xf;
        Error::finite("log-evidence of a scan", log_evidence)
    }
}

impl RadiusProcess {
    /// Covariance of the radii at two angles, given the cosine of their difference.
    fn covariance(&self, cosine: f64) -> f64 {
        let own = self.deviation * self.deviation * exp((cosine - 1.0) / (self.length * self.length));
        self.common.mul_add(self.common, own)
    }
}

/// Unit vector and length; the first axis where there is no length.
fn direction(d: [f64; 2]) -> ([f64; 2], f64) {
    let length = Real::hypot(d[0], d[1]);
    if length > 0.0 { ([d[0] / length, d[1] / length], length) } else { ([1.0, 0.0], 0.0) }
}

/// A L^-T, L L' being the factored matrix: its outer square is A S^-1 A'.
fn whitened<const R: usize>(a: &Matrix<R, 2>, factor: &Cholesky<2>) -> Matrix<R, 2> {
    Matrix(from_fn(|i| factor.whiten(&a.0[i])))
}

/// p <- p - a b'.
fn take_off<const R: usize, const K: usize>(p: &mut Matrix<R, K>, a: &Matrix<R, 2>, b: &Matrix<K, 2>) {
    for i in 0..R {
        for j in 0..K {
            p.0[i][j] -= a.0[i][0] * b.0[j][0] + a.0[i][1] * b.0[j][1];
        }
    }
}

impl<A, C, const N: usize, const W: usize, const B: usize> Filter for Contour<A, C, N, W, B>
where
    A: Motion<N, W>,
    C: Centre<N>,
{
    type Measurement = Vec<[f64; 2]>;
    type Belief = ContourBelief<N, B>;

    fn start(&self, at: Time, _: Stream) -> Result<ContourBelief<N, B>> {
        let radii = Gaussian::computed(
            "radii",
            "covariance of the radii",
            [self.settings.process.radius; B],
            self.covariance,
        )?;
        Ok(ContourBelief { time: at, state: self.prior, radii, cross: Matrix::ZERO })
    }

    fn step(
        &self,
        belief: &mut ContourBelief<N, B>,
        to: Time,
        scan: Option<&Vec<[f64; 2]>>,
    ) -> Result<Update> {
        let mut next = self.ahead(belief, to)?;
        let (mut log_evidence, mut outcome) = (0.0, Outcome::Predicted);
        if let Some(points) = scan {
            check(points)?;
            outcome = Outcome::Updated;
            log_evidence = self.take(&mut next, points)?;
        }
        *belief = next;
        Ok(Update { outcome, log_evidence, particles: None })
    }
}
