//! Discs through points of an outline.

use zerre::math::{Cholesky, Matrix};

/// A disc, px.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disc {
    /// Its middle.
    pub centre: [f64; 2],
    /// Its radius.
    pub radius: f64,
}

/// A disc that was fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fitted {
    /// The disc.
    pub disc: Disc,
    /// Share of its rim that points were found for.
    pub arc: f64,
    /// Root mean square distance of these points from the rim, as a share of the radius; NaN without a point.
    pub residual: f64,
}

/// Rounds of the fit: each takes the points to the nearest rims and the discs to their points.
const ROUNDS: usize = 12;
/// Points between the edges of pixels on the rim of a disc of radius r: 8 r.
const EDGES_PER_RADIUS: f64 = 8.0;

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    let [x, y] = [a[0] - b[0], a[1] - b[1]];
    (x * x + y * y).sqrt()
}

impl Disc {
    /// Distance of a point from the rim, positive outside.
    fn beyond(&self, point: [f64; 2]) -> f64 {
        distance(point, self.centre) - self.radius
    }
}

/// Discs of known radii through the outline of what they cover together: Gauss-Newton on the distances from the
/// nearest rims. Discs that hide each other keep the places that their visible rims give them, which centroids would
/// not; a disc without a point stays where it was.
pub fn fit(outline: &[[f64; 2]], starts: &[Disc]) -> Vec<Fitted> {
    let mut discs = starts.to_vec();
    let nearest = |discs: &[Disc], point: [f64; 2]| {
        let far = |at: &usize| discs[*at].beyond(point).abs();
        (0..discs.len()).min_by(|a, b| far(a).total_cmp(&far(b)))
    };
    for _ in 0..ROUNDS {
        // Of each disc the normal equations of its shift, damped a little.
        let mut sums = vec![([[0.0; 2]; 2], [0.0; 2]); discs.len()];
        for point in outline {
            let Some(at) = nearest(&discs, *point) else { break };
            let Disc { centre, radius } = discs[at];
            let away = distance(*point, centre).max(1e-9);
            let u = [(point[0] - centre[0]) / away, (point[1] - centre[1]) / away];
            let (normal, right) = &mut sums[at];
            // Points far off are another thing's: they pull with a bounded force.
            let error = (away - radius).clamp(-0.5 * radius, 0.5 * radius);
            for i in 0..2 {
                right[i] += u[i] * error;
                (0..2).for_each(|j| normal[i][j] += u[i] * u[j]);
            }
        }
        for (disc, (mut normal, right)) in discs.iter_mut().zip(sums) {
            let damping = 0.01 * (normal[0][0] + normal[1][1]) + 1e-9;
            (0..2).for_each(|i| normal[i][i] += damping);
            if let Ok(factor) = Cholesky::of("normal equations of a disc", &Matrix(normal)) {
                let shift = factor.solve(&right);
                disc.centre = [disc.centre[0] + shift[0], disc.centre[1] + shift[1]];
            }
        }
    }
    let mut squares = vec![(0, 0.0); discs.len()];
    for point in outline {
        let Some(at) = nearest(&discs, *point) else { break };
        let error = discs[at].beyond(*point) / discs[at].radius;
        squares[at] = (squares[at].0 + 1, squares[at].1 + error * error);
    }
    let fitted = |(disc, (count, sum)): (&Disc, (usize, f64))| Fitted {
        disc: *disc,
        arc: count as f64 / (EDGES_PER_RADIUS * disc.radius),
        residual: (sum / count as f64).sqrt(),
    };
    discs.iter().zip(squares).map(fitted).collect()
}

/// Points whose scatter across is less than about this share, squared, of that along are on a line.
const ON_A_LINE: f64 = 1e-9;

/// The circle through points by least squares of its equation (Kåsa, IEEE Transactions on Instrumentation and
/// Measurement 25, 1976), with the root mean square distance of the points from it as a share of its radius; nothing
/// for points on a line.
pub fn circle(points: &[[f64; 2]]) -> Option<(Disc, f64)> {
    let n = points.len() as f64;
    let mean = points.iter().fold([0.0; 2], |sum, p| [sum[0] + p[0] / n, sum[1] + p[1] / n]);
    let (mut normal, mut right) = ([[0.0; 3]; 3], [0.0; 3]);
    for point in points {
        let [x, y] = [point[0] - mean[0], point[1] - mean[1]];
        let row = [x, y, 1.0];
        for i in 0..3 {
            right[i] += row[i] * (x * x + y * y);
            (0..3).for_each(|j| normal[i][j] += row[i] * row[j]);
        }
    }
    // Points on a line have none, and rounding must not make one of them.
    let [[xx, xy, _], [_, yy, _], _] = normal;
    let across = (xx * yy - xy * xy) / (xx + yy).powi(2);
    // Points in one place, or none, have no scatter at all: this is no number then.
    if across.is_nan() || across <= ON_A_LINE {
        return None;
    }
    let [a, b, c] = Cholesky::of("normal equations of a circle", &Matrix(normal)).ok()?.solve(&right);
    let square = c + 0.25 * (a * a + b * b);
    if !(square.is_finite() && square > 0.0) {
        return None;
    }
    let disc = Disc { centre: [mean[0] + 0.5 * a, mean[1] + 0.5 * b], radius: square.sqrt() };
    let sum: f64 = points.iter().map(|p| disc.beyond(*p).powi(2)).sum();
    Some((disc, (sum / n).sqrt() / disc.radius))
}

/// Discs that a shape may be made of, from the points of it that lie deepest: `inside` are its pixels, `outline` its
/// rim as far as it is seen. The first is the largest disc in it; others are at least half as large, and their middles
/// are outside those before them.
pub fn inscribed(inside: &[[f64; 2]], outline: &[[f64; 2]], most: usize) -> Vec<Disc> {
    let depth = |p: &[f64; 2]| {
        outline.iter().map(|q| (p[0] - q[0]).powi(2) + (p[1] - q[1]).powi(2)).fold(f64::INFINITY, f64::min)
    };
    let mut deep: Vec<Disc> = inside.iter().map(|p| Disc { centre: *p, radius: depth(p).sqrt() }).collect();
    deep.retain(|disc| disc.radius.is_finite());
    deep.sort_by(|a, b| b.radius.total_cmp(&a.radius));
    let mut found: Vec<Disc> = Vec::new();
    for disc in &deep {
        let Some(first) = found.first() else {
            found.push(*disc);
            continue;
        };
        if found.len() >= most || disc.radius < 0.5 * first.radius {
            break;
        }
        let apart = |other: &Disc| distance(other.centre, disc.centre) > other.radius.max(disc.radius);
        if found.iter().all(apart) {
            found.push(*disc);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rim(disc: Disc) -> impl Iterator<Item = [f64; 2]> {
        (0..120).map(move |k| {
            let (s, c) = (f64::from(k) * std::f64::consts::TAU / 120.0).sin_cos();
            [disc.centre[0] + disc.radius * c, disc.centre[1] + disc.radius * s]
        })
    }

    /// Two discs of which one covers a third of the other: the visible rims give both places exactly.
    #[test]
    fn hidden_parts_do_not_shift_discs() {
        let front = Disc { centre: [20.0, 20.0], radius: 10.0 };
        let behind = Disc { centre: [32.0, 24.0], radius: 12.0 };
        let both = [front, behind];
        let outline: Vec<_> = both
            .iter()
            .flat_map(|one| rim(*one))
            .filter(|p| both.iter().all(|disc| disc.beyond(*p) > -1e-9))
            .collect();
        let starts =
            [Disc { centre: [17.0, 21.0], radius: 10.0 }, Disc { centre: [35.0, 21.0], radius: 12.0 }];
        for (found, is) in fit(&outline, &starts).iter().zip(both) {
            assert!(distance(found.disc.centre, is.centre) < 1e-3, "{found:?}");
            assert!(found.residual < 1e-3 && found.arc > 0.5);
        }
        assert!(fit(&[], &starts)[0].residual.is_nan());
        assert!(fit(&outline, &[]).is_empty());
    }

    #[test]
    fn an_arc_has_its_circle() {
        let disc = Disc { centre: [-3.0, 40.0], radius: 15.0 };
        let arc: Vec<_> = rim(disc).filter(|p| p[0] > 0.0).collect();
        let (found, residual) = circle(&arc).unwrap();
        assert!(distance(found.centre, disc.centre) < 1e-9 && (found.radius - 15.0).abs() < 1e-9);
        assert!(residual < 1e-9);
        assert!(circle(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]).is_none() && circle(&[]).is_none());
    }

    #[test]
    fn a_pair_that_touches_is_two_discs() {
        let both = [Disc { centre: [20.0, 20.0], radius: 10.0 }, Disc { centre: [38.0, 20.0], radius: 9.0 }];
        let outline: Vec<_> = both.iter().flat_map(|one| rim(*one)).collect();
        let inside: Vec<[f64; 2]> = (0..60 * 40)
            .map(|i| [f64::from(i % 60) + 0.5, f64::from(i / 60) + 0.5])
            .filter(|p| both.iter().any(|disc| disc.beyond(*p) < 0.0))
            .collect();
        let found = inscribed(&inside, &outline, 5);
        assert_eq!(found.len(), 2, "{found:?}");
        for (found, is) in found.iter().zip(both) {
            assert!(distance(found.centre, is.centre) < 1.0 && (found.radius - is.radius).abs() < 1.0);
        }
        assert!(inscribed(&inside, &[], 5).is_empty());
    }
}
