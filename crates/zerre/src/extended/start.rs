//! A first shape from the points alone, and how many ellipses they call for.

use super::centre::Centre;
use super::shape::{Ellipse, Shape};
use super::window::{Smoothed, WindowVb};
use crate::belief::Gaussian;
use crate::error::{Error, Result};
use crate::math::{Matrix, ln};
use crate::model::Motion;
use crate::rng::{Draws, Purpose, Stream};
use crate::time::Time;

/// How first shapes are sought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Search {
    /// Starts from other points for each number of ellipses, 6 by default: the best fit of all is kept.
    pub restarts: usize,
    /// Turns of each fit, 40 by default.
    pub turns: usize,
    /// Least eigenvalue of a first extent, m^2.
    pub floor: f64,
}

impl Default for Search {
    fn default() -> Self {
        Search { restarts: 6, turns: 40, floor: 0.1 }
    }
}

/// A fit of some number of ellipses to all scans at once.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit<const N: usize> {
    /// Path, shape and bound on the likelihood.
    pub smoothed: Smoothed<N>,
    /// Bayesian information criterion, the less the better: -2 bound + (6 K - 3) ln n for K ellipses and n points.
    pub bic: f64,
}

/// The best fit of each number of ellipses in `counts` to `scans`, by k-means++ (Arthur and Vassilvitskii 2007) of what a
/// single ellipse leaves, from several starts. `filter` gives the models and settings; its shape does not count.
///
/// # Errors
/// No points; what [`WindowVb::smoothed`] refuses.
pub fn fits<A, C, const N: usize, const W: usize>(
    filter: &WindowVb<A, C, N, W>,
    at: Time,
    scans: &[(Time, Vec<[f64; 2]>)],
    counts: impl IntoIterator<Item = usize>,
    search: &Search,
    stream: Stream,
) -> Result<Vec<Fit<N>>>
where
    A: Motion<N, W> + Clone,
    C: Centre<N>,
{
    Error::positive("restarts of a search", search.restarts as f64)?;
    Error::positive("least eigenvalue of a first extent", search.floor)?;
    let one = filter.with_shape(Shape::ellipse(about_means(scans, search.floor)?)?);
    let single = one.smoothed(at, scans, search.turns)?;
    let left = residuals(filter.centre(), &single.states, scans);
    let mut best = Vec::new();
    for count in counts {
        let mut kept: Option<Smoothed<N>> = None;
        for restart in 0..search.restarts {
            let mut draws = stream.draws(Purpose::Prior, count as u64, restart as u32);
            let shape = clustered(&left, count, search.floor, &mut draws)?;
            let smoothed = filter.with_shape(shape).smoothed(at, scans, search.turns)?;
            if kept.as_ref().is_none_or(|best| smoothed.bound > best.bound) {
                kept = Some(smoothed);
            }
            if count == 1 {
                break;
            }
        }
        best.extend(kept.map(|smoothed| {
            let bic = (6 * count - 3) as f64 * ln(left.len() as f64) - 2.0 * smoothed.bound;
            Fit { smoothed, bic }
        }));
    }
    Ok(best)
}

/// Covariance of the points about the means of their scans.
fn about_means(scans: &[(Time, Vec<[f64; 2]>)], floor: f64) -> Result<Matrix<2, 2>> {
    let (mut sum, mut free) = (Matrix::ZERO, 0.0);
    for (_, points) in scans.iter().filter(|(_, points)| !points.is_empty()) {
        let n = points.len() as f64;
        let mean = points.iter().fold([0.0; 2], |m, y| [m[0] + y[0] / n, m[1] + y[1] / n]);
        for y in points {
            let d = [y[0] - mean[0], y[1] - mean[1]];
            sum = sum + Matrix::outer(&d, &d);
        }
        free += n - 1.0;
    }
    if scans.iter().all(|(_, points)| points.is_empty()) {
        return Err(Error::Unsupported("a shape cannot be found without points".into()));
    }
    Ok(super::statistics::floored(&(sum * (1.0 / f64::max(free, 1.0))), floor))
}

/// The points about the centres.
fn residuals<C: Centre<N>, const N: usize>(
    centre: &C,
    states: &[Gaussian<N>],
    scans: &[(Time, Vec<[f64; 2]>)],
) -> Vec<[f64; 2]> {
    let of = |(state, (_, points)): (&Gaussian<N>, &(Time, Vec<[f64; 2]>))| {
        let at = centre.at(*state.mean());
        points.iter().map(|y| [y[0] - at[0], y[1] - at[1]]).collect::<Vec<_>>()
    };
    states.iter().zip(scans).flat_map(of).collect()
}

fn squared(a: &[f64; 2], b: &[f64; 2]) -> f64 {
    (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1])
}

/// A shape from clusters: seeds drawn far from one another, and ten turns of Lloyd's algorithm.
fn clustered(points: &[[f64; 2]], count: usize, floor: f64, draws: &mut Draws) -> Result<Shape> {
    let pick = |weights: &[f64], draws: &mut Draws| {
        let target = draws.uniform() * weights.iter().sum::<f64>();
        let mut sum = 0.0;
        let found = weights.iter().position(|w| {
            sum += w;
            sum > target
        });
        found.unwrap_or(weights.len() - 1)
    };
    let mut distances = vec![1.0; points.len()];
    let mut seeds: Vec<[f64; 2]> = Vec::with_capacity(count);
    for _ in 0..count {
        let seed = points[pick(&distances, draws)];
        seeds.push(seed);
        for (distance, y) in distances.iter_mut().zip(points) {
            let near = squared(y, &seed);
            *distance = if seeds.len() == 1 { near } else { near.min(*distance) };
        }
    }
    let mut ellipses = Vec::new();
    for _ in 0..10 {
        let mut sums = vec![super::Sums::default(); count];
        for y in points {
            let nearest = (0..count).min_by(|&a, &b| squared(y, &seeds[a]).total_cmp(&squared(y, &seeds[b])));
            if let Some(sums) = nearest.and_then(|k| sums.get_mut(k)) {
                sums.add(1.0, *y, &Matrix::ZERO);
            }
        }
        ellipses.clear();
        for (seed, s) in seeds.iter_mut().zip(&sums) {
            // An empty cluster stays a small ellipse at its seed.
            let n = s.count.max(1.0);
            if s.count > 0.0 {
                *seed = s.first.map(|x| x / n);
            }
            let [xx, xy, yy] = s.second.map(|x| x / n);
            let [x, y] = *seed;
            let covariance = Matrix([[xx - x * x, xy - x * y], [xy - x * y, yy - y * y]]);
            let extent = super::statistics::floored(&covariance, floor);
            ellipses.push(Ellipse { weight: s.count + 1.0, offset: *seed, extent });
        }
    }
    Shape::new(ellipses)
}
