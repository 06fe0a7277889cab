//! The density of a step, derived from any motion whose noise is added and reaches every component.

use crate::error::{Error, Result};
use crate::filter::{MotionTangent, same};
use crate::math::gaussian::LN_2PI;
use crate::math::{Cholesky, Matrix, Real, ln_gamma};
use crate::model::{Motion, Noise};
use crate::time::Time;
use std::array::from_fn;

/// p(x_k | x_{k-1}) of one step of a motion: what grids, backward simulation and moves along a path need, and
/// what a filter that only draws does without.
///
/// With f(x, w) = f(x, E w) + G (w - E w) and the residual r = x_k - f(x_{k-1}, E w), the noise is recovered
/// as w = E w + G' (G G')^-1 r. Normal noise gives N(r; 0, G G'), also with more components of noise than of
/// the state; gamma noise, with as many, gives the product of its densities over |det G|.
pub struct TransitionDensity<A: Motion<N, W>, const N: usize, const W: usize> {
    step: A::Step,
    /// G.
    by_noise: Matrix<N, W>,
    /// G' (G G')^-1.
    recover: Matrix<W, N>,
    noise: Noise,
    /// What the density holds that does not depend on the states.
    constant: f64,
}

impl<A: Motion<N, W>, const N: usize, const W: usize> TransitionDensity<A, N, W> {
    /// The density of the step from `from` to `to`; `near` is a state that the target may be in, where the
    /// tangent of the motion by its noise is taken.
    ///
    /// # Errors
    /// [`Error::Unsupported`] where there is no density: a step over no time, noise that does not reach every
    /// component, or enters otherwise than by addition (found by comparing the tangents at two points), gamma
    /// noise with more components than the state. What the motion refuses.
    pub fn over(motion: &A, from: Time, to: Time, near: &[f64; N]) -> Result<Self> {
        if to == from {
            return Err(Error::Unsupported("a step over no time has no density".to_owned()));
        }
        let (step, noise) = (motion.over(from, to)?, motion.noise());
        let centre = noise.mean();
        let here = MotionTangent::<N, W>::at::<A>(&step, near, &[centre; W]);
        let aside = from_fn(|i| near[i] + (1.0 + near[i].abs()) * (1.0 + 0.25 * i as f64));
        let there = MotionTangent::<N, W>::at::<A>(&step, &aside, &from_fn(|i| centre + 1.0 + i as f64));
        here.by_noise.finite("derivative of the motion by its noise")?;
        if !same(&here.by_noise, &there.by_noise) {
            return refuse::<A, _>("its noise is not simply added");
        }
        if noise != Noise::StandardNormal && N != W {
            return refuse::<A, _>("its gamma noise has another number of components than the state");
        }
        // Rows scaled to unit variance: a missing rank shows as a pivot of the size of the rounding.
        let g = here.by_noise;
        let scale: [f64; N] = from_fn(|i| g.0[i].iter().map(|c| c * c).sum::<f64>().sqrt());
        let scaled = Matrix::<N, W>::from_entries(|i, j| g.0[i][j] / scale[i]);
        let tolerance = (16.0 * N as f64 * f64::EPSILON).sqrt();
        let factor = Cholesky::of("noise of the motion", &scaled.congruence(&Matrix::identity()))
            .ok()
            .filter(|factor| factor.factor().diagonal().iter().all(|&d| d > tolerance));
        let Some(factor) = factor else {
            return refuse::<A, _>("its noise does not reach every component of the state");
        };
        let recover =
            factor.solve_matrix(&scaled).transpose() * Matrix::from_diagonal(scale.map(|s| 1.0 / s));
        let log_det = 0.5 * factor.log_det() + scale.iter().map(|&s| Real::ln(s)).sum::<f64>();
        let constant = match noise {
            Noise::StandardNormal => -0.5 * N as f64 * LN_2PI,
            Noise::Gamma { shape } => -(N as f64) * ln_gamma(shape),
        } - log_det;
        Ok(TransitionDensity { step, by_noise: g, recover, noise, constant })
    }

    /// f(x, E w): where the step leads on the average of its noise.
    #[inline(always)]
    pub fn centre<R: Real>(&self, from: [R; N]) -> [R; N] {
        A::apply(&self.step, from, [from[0].constant(self.noise.mean()); W])
    }

    /// ln p(x_k | x_{k-1}) of one pair of states (or eight), given r = x_k -
    /// [`centre`](Self::centre)(x_{k-1}); -inf where the step cannot lead.
    #[inline(always)]
    pub fn log_residual<R: Real>(&self, residual: [R; N]) -> R {
        let zero = residual[0].constant(0.0);
        let mut sum = zero;
        let mut possible = zero + 1.0;
        for row in &self.recover.0 {
            let mut w = residual[0] * row[0];
            for (&r, &c) in residual.iter().zip(row).skip(1) {
                // Axes that do not mix leave half of the matrix zero and more.
                if c != 0.0 {
                    w = r.mul_add(r.constant(c), w);
                }
            }
            match self.noise {
                Noise::StandardNormal => sum = (w * -0.5).mul_add(w, sum),
                Noise::Gamma { shape } => {
                    let w = w + shape;
                    possible = zero.if_lt(w, possible, zero);
                    sum = sum + (w.ln() * (shape - 1.0) - w);
                }
            }
        }
        zero.if_lt(possible, sum + self.constant, zero + f64::NEG_INFINITY)
    }

    /// ln p(`to` | `from`) of one pair of states (or eight).
    #[inline(always)]
    pub fn log_density<R: Real>(&self, from: [R; N], to: [R; N]) -> R {
        let mut residual = self.centre(from);
        for (r, &x) in residual.iter_mut().zip(&to) {
            *r = x - *r;
        }
        self.log_residual(residual)
    }

    /// The largest ln p(x_k | x_{k-1}) over all pairs of states; +inf for gamma noise of a shape below 1.
    pub fn log_bound(&self) -> f64 {
        self.constant
            + match self.noise {
                Noise::StandardNormal => 0.0,
                Noise::Gamma { shape } if shape < 1.0 => f64::INFINITY,
                Noise::Gamma { shape: 1.0 } => 0.0,
                // At the mode, shape - 1.
                Noise::Gamma { shape } => N as f64 * (shape - 1.0) * (Real::ln(shape - 1.0) - 1.0),
            }
    }

    /// G: how the noise is added.
    pub(crate) fn by_noise(&self) -> &Matrix<N, W> {
        &self.by_noise
    }

    /// Law of the noise.
    pub(crate) fn noise(&self) -> Noise {
        self.noise
    }
}

fn refuse<A, T>(why: &str) -> Result<T> {
    let name = std::any::type_name::<A>();
    let (path, parameters) = name.split_at(name.find('<').unwrap_or(name.len()));
    let name = path.rsplit("::").next().unwrap_or(path);
    Err(Error::Unsupported(format!("the motion {name}{parameters} has no transition density: {why}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::belief::Gaussian;
    use crate::kernels::{self, Simd};
    use crate::model::motion::{
        ConstantAcceleration, ConstantVelocity, Growth, RandomWalk, UpfGrowth, WienerAcceleration,
    };

    const FROM: Time = Time::from_nanos(2_000_000_000);
    const TO: Time = Time::from_nanos(2_700_000_000);

    /// Both sides solve systems of condition 1e3 at most, in numbers up to 1e2: 1e-10 has room.
    #[test]
    fn constant_velocity_has_its_textbook_density() {
        let (q, t) = (0.3, 0.7);
        let motion = ConstantVelocity::<2>::new(q).unwrap();
        let density = TransitionDensity::over(&motion, FROM, TO, &[0.0; 4]).unwrap();
        let (pp, pv, vv) = (q * t * t * t / 3.0, q * t * t / 2.0, q * t);
        let covariance =
            Matrix([[pp, 0.0, pv, 0.0], [0.0, pp, 0.0, pv], [pv, 0.0, vv, 0.0], [0.0, pv, 0.0, vv]]);
        let x = [1.0, -2.0, 3.0, 0.5];
        let mean = [x[0] + t * x[2], x[1] + t * x[3], x[2], x[3]];
        let law = Gaussian::new(mean, covariance).unwrap();
        for shift in [0.0, 0.3, -0.8] {
            let y = from_fn(|i| mean[i] + shift * (1.0 - 0.4 * i as f64));
            let expected = law.log_density(&y).unwrap();
            assert!((density.log_density(x, y) - expected).abs() < 1e-10);
            assert!(density.log_bound() >= expected);
        }
        assert!((density.log_bound() - law.log_density(&mean).unwrap()).abs() < 1e-12);
    }

    /// Gamma(3, rate 2) by hand: p(u) = 4 u^2 e^(-2 u).
    #[test]
    fn gamma_noise_has_its_density() {
        let motion = UpfGrowth::new(3.0, 2.0).unwrap();
        let density = TransitionDensity::over(&motion, FROM, TO, &[1.0]).unwrap();
        let x = 1.7;
        let base = 1.0 + (0.04 * std::f64::consts::PI * TO.secs()).sin() + 0.5 * x;
        for u in [1e-3, 0.4, 1.0, 2.5, 9.0f64] {
            let expected = (4.0 * u * u).ln() - 2.0 * u;
            assert!((density.log_density([x], [base + u]) - expected).abs() < 1e-11, "{u}");
            assert!(expected <= density.log_bound() + 1e-12);
        }
        assert!((density.log_bound() - (4f64.ln() - 2.0)).abs() < 1e-12, "at the mode, u = 1");
        for u in [0.0, -1e-9, -3.0] {
            assert_eq!(density.log_density([x], [base - 1e-12 + u]), f64::NEG_INFINITY);
        }
        let steep = UpfGrowth::new(0.5, 2.0).unwrap();
        assert_eq!(TransitionDensity::over(&steep, FROM, TO, &[1.0]).unwrap().log_bound(), f64::INFINITY);
    }

    /// The midpoint rule with a twentieth of a standard deviation on smooth densities is exact to rounding;
    /// the kink of the gamma density at 0 leaves h^3 / 6 times its second derivative 8, here 1e-8.
    #[test]
    fn densities_integrate_to_one() {
        fn mass<A: Motion<1, 1>>(motion: &A, x: f64, sd: f64) -> f64 {
            let density = TransitionDensity::over(motion, FROM, TO, &[x]).unwrap();
            let (centre, h) = (density.centre([x])[0], sd / 400.0);
            let node = |i: i32| density.log_density([x], [centre + h * f64::from(i)]).exp();
            (-8000..8000).map(node).sum::<f64>() * h
        }
        assert!((mass(&Growth::new(10.0).unwrap(), 2.0, 10f64.sqrt()) - 1.0).abs() < 1e-12);
        assert!((mass(&UpfGrowth::new(3.0, 2.0).unwrap(), 2.0, 0.75f64.sqrt()) - 1.0).abs() < 1e-7);

        let motion = ConstantVelocity::<1>::new(0.3).unwrap();
        let density = TransitionDensity::over(&motion, FROM, TO, &[0.0; 2]).unwrap();
        let (x, h) = ([1.0, 2.0], [0.01, 0.02]);
        let centre = density.centre(x);
        let mut sum = 0.0;
        for i in -250..250 {
            for j in -250..250 {
                let y = [centre[0] + h[0] * f64::from(i), centre[1] + h[1] * f64::from(j)];
                sum += density.log_density(x, y).exp();
            }
        }
        // 250 nodes of 0.01 are 13 standard deviations of the position, of 0.02 are 10 of the velocity.
        assert!((sum * h[0] * h[1] - 1.0).abs() < 1e-12, "{sum}");
    }

    #[test]
    fn lanes_have_the_bits_of_plain_numbers() {
        fn check<A: Motion<N, W>, const N: usize, const W: usize>(motion: &A) {
            let density = TransitionDensity::over(motion, FROM, TO, &[0.5; N]).unwrap();
            let column = |k: usize| (0..21).map(|i| 0.3 * f64::from(i) - k as f64).collect();
            let states: [Vec<f64>; N] = from_fn(column);
            let states = states.each_ref().map(Vec::as_slice);
            let to: [f64; N] = from_fn(|k| 2.0 + 0.1 * k as f64);
            let weights: Vec<f64> = (0..21).map(|i| 1.0 / (1.0 + f64::from(i))).collect();
            for level in Simd::available() {
                let mut centres: [Vec<f64>; N] = from_fn(|_| vec![0.0; 21]);
                kernels::centres(level, &density, &states, &mut centres.each_mut().map(Vec::as_mut_slice));
                let centres = centres.each_ref().map(Vec::as_slice);
                let (mut row, mut sums) = ([0.0; 21], [0.0; 21]);
                kernels::transition_row(level, &density, to, (&centres, &weights), -0.5, &mut row);
                kernels::predict_density(level, &density, &states, (&centres, &weights), &mut sums);
                for i in 0..21 {
                    let from = from_fn(|k| states[k][i]);
                    let weighted = Real::exp(density.log_density(from, to) + 0.5) * weights[i];
                    assert_eq!(row[i].to_bits(), weighted.to_bits());
                    let sum = (0..21).fold(0.0, |sum, j| {
                        let log = density.log_density(from_fn(|k| states[k][j]), from);
                        Real::mul_add(Real::exp(log), weights[j], sum)
                    });
                    assert_eq!(sums[i].to_bits(), sum.to_bits());
                }
            }
        }
        check(&UpfGrowth::new(3.0, 2.0).unwrap());
        check(&ConstantVelocity::<2>::new(0.3).unwrap());
    }

    /// x moves by w, or by w times x, or by w of which half is lost.
    struct Odd(u8);

    impl Motion<1, 2> for Odd {
        type Step = u8;
        fn over(&self, _: Time, _: Time) -> Result<u8> {
            Ok(self.0)
        }
        fn apply<R: Real>(&kind: &u8, [x]: [R; 1], [v, w]: [R; 2]) -> [R; 1] {
            match kind {
                0 => [x + v * 3.0 + w * 4.0],
                1 => [x + x * v + w],
                _ => [x + v * v],
            }
        }
    }

    #[test]
    fn two_noises_of_one_state_add_their_variances() {
        let density = TransitionDensity::over(&Odd(0), FROM, TO, &[1.0]).unwrap();
        let law = Gaussian::new([1.0], Matrix([[25.0]])).unwrap();
        let gap: f64 = density.log_density([1.0], [-6.0]) - law.log_density(&[-6.0]).unwrap();
        assert!(gap.abs() < 1e-13);
    }

    #[test]
    fn what_has_no_density_is_refused_by_name() {
        fn refusal<A: Motion<N, W>, const N: usize, const W: usize>(motion: &A, to: Time) -> String {
            match TransitionDensity::over(motion, FROM, to, &[1.0; N]) {
                Err(Error::Unsupported(text)) => text,
                Err(other) => panic!("{other}"),
                Ok(_) => panic!("accepted"),
            }
        }
        let lost = refusal(&WienerAcceleration::<2>::new(0.5).unwrap(), TO);
        assert!(lost.contains("WienerAcceleration<2>") && lost.contains("every component"), "{lost}");
        assert!(refusal(&RandomWalk::<2>::new(0.0).unwrap(), TO).contains("every component"));
        assert!(refusal(&Odd(1), TO).contains("added"));
        assert!(refusal(&Odd(2), TO).contains("added"));
        assert!(refusal(&Odd(0), FROM).contains("no time"));
        let full = ConstantAcceleration::<3>::new(0.1).unwrap();
        assert!(TransitionDensity::over(&full, FROM, TO, &[0.0; 9]).is_ok());
    }
}
