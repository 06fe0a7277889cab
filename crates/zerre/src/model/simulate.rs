//! Drawing what the models say: true paths, and what sensors would report of them.

use super::{GaussianMeasurement, JumpMarkov, Measurement, Motion, Noise};
use crate::error::{Error, Result};
use crate::math::{Cholesky, Matrix};
use crate::rng::{Draws, Purpose, Stream};
use crate::time::Time;

/// A path that `motion` draws through `times`: the state is `start` at the first of them. Two equal times have the
/// same state.
///
/// # Errors
/// Times that go back, and what the motion refuses.
pub fn path<const N: usize, const W: usize, M: Motion<N, W>>(
    motion: &M,
    start: [f64; N],
    times: &[Time],
    stream: Stream,
) -> Result<Vec<[f64; N]>> {
    let mut x = start;
    let mut states = Vec::with_capacity(times.len());
    let mut last: Option<Time> = None;
    for (k, &to) in (0..).zip(times) {
        if let Some(from) = last.replace(to).filter(|&from| from != to) {
            if to < from {
                return Err(Error::OutOfOrder { from, to });
            }
            let step = motion.over(from, to)?;
            let mut draws = stream.draws(Purpose::Truth, k, 0);
            let noise = motion.noise();
            x = M::apply(&step, x, std::array::from_fn(|_| noise.draw(&mut draws)));
        }
        states.push(x);
    }
    Ok(states)
}

/// A path that a jump-Markov model draws through `times`: the mode of each time, and the state. The first mode comes
/// from the chain's initial law; the mode of a time is the one that moved the state there.
///
/// # Errors
/// Times that go back, and what the motion refuses.
pub fn jump_path<const N: usize, const W: usize, M: Motion<N, W>>(
    model: &JumpMarkov<M>,
    start: [f64; N],
    times: &[Time],
    stream: Stream,
) -> Result<(Vec<usize>, Vec<[f64; N]>)> {
    let pick = |step, law: &[f64]| {
        let u = stream.draws(Purpose::Mode, step, 0).uniform();
        let mut sum = 0.0;
        let fits = |p: &f64| {
            sum += p;
            u < sum
        };
        // Rounding may leave the last of the mass to nobody; modes without probability are never drawn.
        law.iter().position(fits).or_else(|| law.iter().rposition(|&p| p > 0.0)).unwrap_or(0)
    };
    let (mut modes, mut states) = (Vec::with_capacity(times.len()), Vec::with_capacity(times.len()));
    let (mut x, mut mode) = (start, pick(0, model.chain().initial()));
    let mut last: Option<Time> = None;
    for (k, &to) in (0..).zip(times) {
        if let Some(from) = last.replace(to).filter(|&from| from != to) {
            if to < from {
                return Err(Error::OutOfOrder { from, to });
            }
            let transition = model.chain().over(from, to);
            let row: Vec<f64> = (0..transition.len()).map(|j| transition.probability(mode, j)).collect();
            mode = pick(k, &row);
            let motion = &model.modes()[mode];
            let step = motion.over(from, to)?;
            let mut draws = stream.draws(Purpose::Truth, k, 0);
            let noise = motion.noise();
            x = M::apply(&step, x, std::array::from_fn(|_| noise.draw(&mut draws)));
        }
        modes.push(mode);
        states.push(x);
    }
    Ok((modes, states))
}

/// What `sensor` reports of the states `path` at `times`, one value for each. Angles are wrapped into [-pi, pi];
/// values that no sensor of this kind can report (a negative range) are drawn again.
///
/// # Errors
/// As many states as times are needed; what the sensor refuses every time.
pub fn measurements<const N: usize, const M: usize, H>(
    sensor: &H,
    path: &[[f64; N]],
    times: &[Time],
    stream: Stream,
) -> Result<Vec<[f64; M]>>
where
    H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]>,
{
    if path.len() != times.len() {
        return Err(Error::Shape { what: "states of the path", found: path.len(), expected: times.len() });
    }
    let factor = Cholesky::of("covariance of the measurement", &Matrix(sensor.covariance()))?;
    let draw = |k, x: [f64; N], at| {
        let h = sensor.predict(at, x);
        let mut draws = stream.draws(Purpose::Measurement, k, 0);
        let mut attempts = 0;
        loop {
            let size = sensor.draw_covariance_scale(&mut draws).sqrt();
            let w: [f64; M] = std::array::from_fn(|_| size * draws.normal());
            let noise = *factor.factor() * w;
            let z =
                std::array::from_fn(|i| if H::ANGLE[i] { wrapped(h[i] + noise[i]) } else { h[i] + noise[i] });
            attempts += 1;
            match sensor.given(&z, at) {
                Ok(_) => return Ok(z),
                Err(refusal) if attempts == MOST_ATTEMPTS => return Err(refusal),
                Err(_) => {}
            }
        }
    };
    (0..).zip(path).zip(times).map(|((k, &x), &at)| draw(k, x, at)).collect()
}

/// A range of zero is refused every second time: so many refusals in a row mean a state that has no measurement.
const MOST_ATTEMPTS: u32 = 200;

/// `angle` less whole turns, in [-pi, pi].
fn wrapped(angle: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    angle - turn * (angle / turn).round()
}

impl Noise {
    /// Draws one component.
    pub fn draw(self, draws: &mut Draws) -> f64 {
        match self {
            Noise::StandardNormal => draws.normal(),
            Noise::Gamma { shape } => draws.gamma(shape),
        }
    }
}
