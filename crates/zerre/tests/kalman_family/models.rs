//! Small models to test with, and the world simulated from them.

use zerre::belief::Gaussian;
use zerre::math::{Matrix, Real};
use zerre::model::{GaussianMeasurement, Measurement, Motion, Noise};
use zerre::rng::{Draws, Purpose, Stream};
use zerre::{Error, Result, Time};

/// x + sqrt(variance dt) w.
#[derive(Clone, Copy, Debug)]
pub struct Level(pub f64);

impl Motion<1, 1> for Level {
    type Step = f64;
    fn over(&self, from: Time, to: Time) -> Result<f64> {
        Ok((self.0 * (to - from).secs()).sqrt())
    }
    fn apply<R: Real>(step: &f64, [x]: [R; 1], [w]: [R; 1]) -> [R; 1] {
        [x + w * *step]
    }
}

/// (x, vx, y, vy) under white acceleration of this spectral density, exactly discretised.
#[derive(Clone, Copy, Debug)]
pub struct Glide(pub f64);

pub struct GlideStep {
    dt: f64,
    /// Lower factor of density * [[dt^3/3, dt^2/2], [dt^2/2, dt]].
    factor: [f64; 3],
}

impl Motion<4, 4> for Glide {
    type Step = GlideStep;
    fn over(&self, from: Time, to: Time) -> Result<GlideStep> {
        let dt = (to - from).secs();
        let l00 = (self.0 * dt * dt * dt / 3.0).sqrt();
        let l11 = (self.0 * dt).sqrt();
        Ok(GlideStep { dt, factor: [l00, l11 * 3f64.sqrt() / 2.0, l11 / 2.0] })
    }
    fn apply<R: Real>(s: &GlideStep, [x, vx, y, vy]: [R; 4], w: [R; 4]) -> [R; 4] {
        let [a, b, c] = s.factor;
        [
            x + vx * s.dt + w[0] * a,
            vx + w[0] * b + w[1] * c,
            y + vy * s.dt + w[2] * a,
            vy + w[2] * b + w[3] * c,
        ]
    }
}

/// A motion that no Kalman filter is exact for: noise multiplies the sine of the state.
#[derive(Clone, Copy, Debug)]
pub struct Wobble;

impl Motion<1, 1> for Wobble {
    type Step = f64;
    fn over(&self, from: Time, to: Time) -> Result<f64> {
        Ok((to - from).secs())
    }
    fn apply<R: Real>(dt: &f64, [x]: [R; 1], [w]: [R; 1]) -> [R; 1] {
        let (s, c) = x.sin_cos();
        [x * 0.9 + c * *dt + (s + 2.0) * w * *dt]
    }
}

/// A counter that grows by gamma-distributed amounts: x + w dt.
#[derive(Clone, Copy, Debug)]
pub struct Growth {
    pub shape: f64,
}

impl Motion<1, 1> for Growth {
    type Step = f64;
    fn over(&self, from: Time, to: Time) -> Result<f64> {
        Ok((to - from).secs())
    }
    fn apply<R: Real>(dt: &f64, [x]: [R; 1], [w]: [R; 1]) -> [R; 1] {
        [x + w * *dt]
    }
    fn noise(&self) -> Noise {
        Noise::Gamma { shape: self.shape }
    }
}

/// z = H x + v. Its likelihood is never asked for in these tests.
#[derive(Clone, Copy, Debug)]
pub struct Rows<const N: usize, const M: usize> {
    pub h: Matrix<M, N>,
    pub r: Matrix<M, M>,
}

impl<const N: usize, const M: usize> Measurement<N> for Rows<N, M> {
    type Value = [f64; M];
    type Given<'z> = ();
    fn given<'z>(&'z self, z: &'z [f64; M], _: Time) -> Result<()> {
        z.iter().try_for_each(|&z| Error::finite("z", z).map(drop))
    }
    fn log_likelihood<R: Real>(_: &(), x: [R; N]) -> R {
        x[0].constant(f64::NAN)
    }
}

impl<const N: usize, const M: usize> GaussianMeasurement<N, M> for Rows<N, M> {
    fn predict<R: Real>(&self, _: Time, x: [R; N]) -> [R; M] {
        std::array::from_fn(|i| (0..N).fold(x[0].constant(0.0), |sum, j| sum + x[j] * self.h.0[i][j]))
    }
    fn components(&self, z: &[f64; M]) -> [f64; M] {
        *z
    }
    fn covariance(&self) -> [[f64; M]; M] {
        self.r.0
    }
}

/// z = x + v for a state of one component.
pub fn direct(variance: f64) -> Rows<1, 1> {
    Rows { h: Matrix([[1.0]]), r: Matrix([[variance]]) }
}

/// A sensor that wanders off: z = x + t + v, t the time in seconds and v of variance 1.
#[derive(Clone, Copy, Debug)]
pub struct Adrift;

impl Measurement<1> for Adrift {
    type Value = [f64; 1];
    type Given<'z> = ();
    fn given<'z>(&'z self, _: &'z [f64; 1], _: Time) -> Result<()> {
        Ok(())
    }
    fn log_likelihood<R: Real>(_: &(), [x]: [R; 1]) -> R {
        x.constant(f64::NAN)
    }
}

impl GaussianMeasurement<1, 1> for Adrift {
    fn predict<R: Real>(&self, at: Time, [x]: [R; 1]) -> [R; 1] {
        [x + at.secs()]
    }
    fn components(&self, z: &[f64; 1]) -> [f64; 1] {
        *z
    }
    fn covariance(&self) -> [[f64; 1]; 1] {
        [[1.0]]
    }
}

/// Both positions of [`Glide`], with correlated noise.
pub fn positions(sd: f64) -> Rows<4, 2> {
    let h = Matrix([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);
    Rows { h, r: Matrix([[1.0, 0.3], [0.3, 1.0]]) * (sd * sd) }
}

/// Range and bearing of [`Glide`]'s position from the origin; without `WRAP` the bearing is treated as a number,
/// which is the mistake that the laws must find.
#[derive(Clone, Copy, Debug)]
pub struct Polar<const WRAP: bool> {
    pub range_sd: f64,
    pub bearing_sd: f64,
}

impl<const WRAP: bool> Measurement<4> for Polar<WRAP> {
    type Value = [f64; 2];
    type Given<'z> = ();
    fn given<'z>(&'z self, _: &'z [f64; 2], _: Time) -> Result<()> {
        Ok(())
    }
    fn log_likelihood<R: Real>(_: &(), x: [R; 4]) -> R {
        x[0].constant(f64::NAN)
    }
}

impl<const WRAP: bool> GaussianMeasurement<4, 2> for Polar<WRAP> {
    const ANGLE: [bool; 2] = [false, WRAP];
    fn predict<R: Real>(&self, _: Time, [x, _, y, _]: [R; 4]) -> [R; 2] {
        [x.hypot(y), y.atan2(x)]
    }
    fn components(&self, z: &[f64; 2]) -> [f64; 2] {
        *z
    }
    fn covariance(&self) -> [[f64; 2]; 2] {
        [[self.range_sd * self.range_sd, 0.0], [0.0, self.bearing_sd * self.bearing_sd]]
    }
}

/// A draw of a normal law whose covariance is diagonal.
pub fn draw<const N: usize>(law: &Gaussian<N>, draws: &mut Draws) -> [f64; N] {
    let sd = law.covariance().diagonal().map(f64::sqrt);
    std::array::from_fn(|i| law.mean()[i] + sd[i] * draws.normal())
}

/// A trajectory of `motion` from a draw of `prior`, with the measurements `h` makes of it, at times `dt` apart. Noise
/// of the measurement is independent between components.
pub fn simulate<A, H, const N: usize, const W: usize, const M: usize>(
    (motion, h, prior): (&A, &H, &Gaussian<N>),
    (steps, dt): (u64, f64),
    stream: Stream,
) -> Vec<(Time, [f64; N], [f64; M])>
where
    A: Motion<N, W>,
    H: GaussianMeasurement<N, M>,
{
    let mut x = draw(prior, &mut stream.draws(Purpose::Prior, 0, 0));
    let mut now = Time::ZERO;
    let mut out = Vec::new();
    for k in 1..=steps {
        let to = Time::from_secs(k as f64 * dt);
        let mut noise = stream.draws(Purpose::Motion, k, 0);
        x = A::apply(&motion.over(now, to).unwrap(), x, std::array::from_fn(|_| noise.normal()));
        let noiseless = Gaussian::new(h.predict(to, x), Matrix(h.covariance())).unwrap();
        out.push((to, x, draw(&noiseless, &mut stream.draws(Purpose::Measurement, k, 0))));
        now = to;
    }
    out
}
