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
#[derive(Clone, Copy, Debug)]
pub(crate) struct Summit<const K: usize> {
    pub(crate) height: f64,
    pub(crate) at: [f64; K],
    /// Heights that were asked for.
    pub(crate) evaluations: usize,
}

/// The highest point of `height` near `start` (Nelder and Mead, The Computer Journal 7, 1965). -inf is lower
/// than everything, and NaN must not come.
pub(crate) fn climb<const K: usize>(
    start: [f64; K],
    search: Search,
    mut height: impl FnMut(&[f64; K]) -> Result<f64>,
) -> Result<Summit<K>> {
    let mut evaluations = 0;
    let mut at = |point: [f64; K]| -> Result<(f64, [f64; K])> {
        evaluations += 1;
        Ok((height(&point)?, point))
    };
    let mut corners = vec![at(start)?];
    for k in 0..K {
        let mut corner = start;
        corner[k] += search.first;
        corners.push(at(corner)?);
    }
    for _ in 0..search.turns {
        corners.sort_by(|a, b| b.0.total_cmp(&a.0));
        let best = corners[0];
        let far = |c: &(f64, [f64; K])| (0..K).map(|k| (c.1[k] - best.1[k]).abs()).fold(0.0, f64::max);
        if corners.iter().map(far).fold(0.0, f64::max) < search.close {
            break;
        }
        let (worst, second) = (corners[K], corners[K - 1]);
        let centre: [f64; K] =
            std::array::from_fn(|k| corners[..K].iter().map(|c| c.1[k]).sum::<f64>() / K as f64);
        let along = |t: f64| std::array::from_fn(|k| centre[k] + t * (worst.1[k] - centre[k]));
        let reflected = at(along(-1.0))?;
        if reflected.0 > best.0 {
            let expanded = at(along(-2.0))?;
            corners[K] = if expanded.0 > reflected.0 { expanded } else { reflected };
        } else if reflected.0 > second.0 {
            corners[K] = reflected;
        } else {
            let contracted = at(along(if reflected.0 > worst.0 { -0.5 } else { 0.5 }))?;
            if contracted.0 > worst.0.max(reflected.0) {
                corners[K] = contracted;
            } else {
                for corner in &mut corners[1..] {
                    *corner = at(std::array::from_fn(|k| 0.5 * (corner.1[k] + best.1[k])))?;
                }
            }
        }
    }
    let best = corners.iter().fold(corners[0], |best, &c| if c.0 > best.0 { c } else { best });
    Ok(Summit { height: best.0, at: best.1, evaluations })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEARCH: Search = Search { first: 0.5, close: 1e-9, turns: 2000 };

    /// Rosenbrock's valley, upside down: its summit is (1, 1). Heights near it are flat to rounding within
    /// 1e-8.
    #[test]
    fn a_curved_ridge_is_climbed() {
        let ridge = |x: &[f64; 2]| Ok(-(1.0 - x[0]).powi(2) - 100.0 * (x[1] - x[0] * x[0]).powi(2));
        let summit = climb([-1.2, 1.0], SEARCH, ridge).unwrap();
        assert!((summit.at[0] - 1.0).abs() < 1e-6 && (summit.at[1] - 1.0).abs() < 1e-6, "{summit:?}");
    }

    #[test]
    fn one_coordinate_and_walls() {
        let wall = |x: &[f64; 1]| Ok(if x[0] > 2.0 { f64::NEG_INFINITY } else { x[0] });
        let summit = climb([0.3], SEARCH, wall).unwrap();
        assert!((summit.at[0] - 2.0).abs() < 1e-6 && summit.evaluations > 10);
    }
}
