//! The downhill simplex, uphill.

use crate::error::Result;

/// Where a search starts and when it ends.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Search {
    /// How far from the start the first corners lie, along each coordinate.
    pub(crate) first: f64,
    /// The search ends once no corner lies further from the best, in any coordinate.
    pub(crate) close: f64,
    /// Turns at most.
    pub(crate) turns: usize,
}

/// A point and its height.
#[derive(Clone, Debug)]
pub(crate) struct Summit {
    pub(crate) height: f64,
    pub(crate) at: Vec<f64>,
    /// Heights that were asked for.
    pub(crate) evaluations: usize,
}

/// The highest point of `height` near `start` (Nelder and Mead, The Computer Journal 7, 1965). -inf is lower
/// than everything, and NaN must not come.
pub(crate) fn climb(
    start: &[f64],
    search: Search,
    mut height: impl FnMut(&[f64]) -> Result<f64>,
) -> Result<Summit> {
    let n = start.len();
    let mut evaluations = 0;
    let mut at = |point: Vec<f64>| -> Result<(f64, Vec<f64>)> {
        evaluations += 1;
        Ok((height(&point)?, point))
    };
    let mut corners = vec![at(start.to_vec())?];
    for k in 0..n {
        let mut corner = start.to_vec();
        corner[k] += search.first;
        corners.push(at(corner)?);
    }
    for _ in 0..search.turns {
        corners.sort_by(|a, b| b.0.total_cmp(&a.0));
        let far = |c: &(f64, Vec<f64>)| {
            c.1.iter().zip(&corners[0].1).map(|(x, b)| (x - b).abs()).fold(0.0, f64::max)
        };
        if corners.iter().map(far).fold(0.0, f64::max) < search.close {
            break;
        }
        let centre: Vec<f64> =
            (0..n).map(|k| corners[..n].iter().map(|c| c.1[k]).sum::<f64>() / n as f64).collect();
        let along = |t: f64, worst: &[f64]| -> Vec<f64> {
            centre.iter().zip(worst).map(|(c, worst)| c + t * (worst - c)).collect()
        };
        let reflected = at(along(-1.0, &corners[n].1))?;
        if reflected.0 > corners[0].0 {
            let expanded = at(along(-2.0, &corners[n].1))?;
            corners[n] = if expanded.0 > reflected.0 { expanded } else { reflected };
        } else if reflected.0 > corners[n - 1].0 {
            corners[n] = reflected;
        } else {
            let worst = corners[n].0;
            let contracted = at(along(if reflected.0 > worst { -0.5 } else { 0.5 }, &corners[n].1))?;
            if contracted.0 > worst.max(reflected.0) {
                corners[n] = contracted;
            } else {
                let best = corners[0].1.clone();
                for corner in &mut corners[1..] {
                    *corner = at(corner.1.iter().zip(&best).map(|(x, b)| 0.5 * (x + b)).collect())?;
                }
            }
        }
    }
    corners.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (height, at) = corners.swap_remove(0);
    Ok(Summit { height, at, evaluations })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEARCH: Search = Search { first: 0.5, close: 1e-9, turns: 2000 };

    /// Rosenbrock's valley, upside down: its summit is (1, 1). Heights near it are flat to rounding within
    /// 1e-8.
    #[test]
    fn a_curved_ridge_is_climbed() {
        let ridge = |x: &[f64]| Ok(-(1.0 - x[0]).powi(2) - 100.0 * (x[1] - x[0] * x[0]).powi(2));
        let summit = climb(&[-1.2, 1.0], SEARCH, ridge).unwrap();
        assert!((summit.at[0] - 1.0).abs() < 1e-6 && (summit.at[1] - 1.0).abs() < 1e-6, "{summit:?}");
    }

    #[test]
    fn one_coordinate_and_walls() {
        let wall = |x: &[f64]| Ok(if x[0] > 2.0 { f64::NEG_INFINITY } else { x[0] });
        let summit = climb(&[0.3], SEARCH, wall).unwrap();
        assert!((summit.at[0] - 2.0).abs() < 1e-6 && summit.evaluations > 10);
    }
}
