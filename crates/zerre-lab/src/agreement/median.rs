//! The geometric median of a few points in the plane, and how well it is known.

use std::f64::consts::PI;

/// Steps of the iteration at the most; it stops long before unless points nearly lie on a line.
const MOST_STEPS: usize = 1000;
/// Movement, as a share of the points' extent, at which the iteration ends.
const TOLERANCE: f64 = 1e-12;

/// The point with the least sum of distances to `points`: Weiszfeld's iteration with the treatment of data
/// points by Vardi and Zhang (The multivariate L1-median and associated data depth, PNAS 97, 2000). Of two
/// points every point between them has the least sum, and the middle is taken. `None` of no points, and where
/// one is not finite.
pub fn geometric_median(points: &[[f64; 2]]) -> Option<[f64; 2]> {
    if points.is_empty() || points.iter().flatten().any(|value| !value.is_finite()) {
        return None;
    }
    let count = points.len() as f64;
    let mean = [0, 1].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / count);
    if points.len() <= 2 {
        return Some(mean);
    }
    // A data point is the median when the pull of the others is no larger than its own weight.
    let holds = |at: &&[f64; 2]| {
        let (pull, own) = pull(points, **at);
        pull[0].hypot(pull[1]) <= own
    };
    if let Some(at) = points.iter().find(holds) {
        return Some(*at);
    }
    let extent = points.iter().map(|p| distance(*p, mean)).fold(0.0, f64::max);
    let mut at = mean;
    for _ in 0..MOST_STEPS {
        let next = step(points, at);
        let moved = distance(next, at);
        at = next;
        if moved <= TOLERANCE * extent {
            break;
        }
    }
    Some(at)
}

/// Sum of the unit vectors from `at` to the points, and how many points lie there.
fn pull(points: &[[f64; 2]], at: [f64; 2]) -> ([f64; 2], f64) {
    let (mut sum, mut own) = ([0.0; 2], 0.0);
    for point in points {
        let r = distance(*point, at);
        if r == 0.0 {
            own += 1.0;
        } else {
            sum = [sum[0] + (point[0] - at[0]) / r, sum[1] + (point[1] - at[1]) / r];
        }
    }
    (sum, own)
}

/// One step of Vardi and Zhang, equations 2.4 to 2.6.
fn step(points: &[[f64; 2]], at: [f64; 2]) -> [f64; 2] {
    let (mut weights, mut sum) = (0.0, [0.0; 2]);
    for point in points {
        let r = distance(*point, at);
        if r > 0.0 {
            weights += 1.0 / r;
            sum = [sum[0] + point[0] / r, sum[1] + point[1] / r];
        }
    }
    let target = sum.map(|value| value / weights);
    let (pull, own) = pull(points, at);
    let kept = if own > 0.0 { (own / pull[0].hypot(pull[1])).min(1.0) } else { 0.0 };
    [0, 1].map(|k| (1.0 - kept) * target[k] + kept * at[k])
}

/// Standard error of the geometric median `at` of `points` along one axis, the root of the mean over both
/// axes. The squared distance between median and truth has twice its square as its mean. `None` of fewer than
/// two points.
///
/// In the plane the median of n draws from an isotropic normal law has the covariance 4 s^2 / (pi n) (Brown,
/// Statistical uses of the spatial median, JRSS B 45, 1983; Mottonen, Nordhausen and Oja, Asymptotic theory
/// of the spatial median, 2010), and s is the mean distance from the centre times sqrt(2 / pi): together 8
/// d^2 / (pi^2 (n - 1)), with n - 1 for the centre that was fitted. A mark far off enters by its distance and
/// not by the square. The general sandwich A^-1 B A^-1 of the same sources is of no use for the two to seven
/// operators of a job: with three, draws of a normal law give it no mean. The middle of two points is their
/// mean, with the mean's standard error. Where one axis is far noisier than the other the interval is too
/// short (covering 89 % instead of 95 % at five to one).
pub fn standard_error(points: &[[f64; 2]], at: [f64; 2]) -> Option<f64> {
    let mean = points.iter().map(|p| distance(*p, at)).sum::<f64>() / points.len() as f64;
    match points.len() {
        0 | 1 => None,
        2 => Some(mean / 2f64.sqrt()),
        n => Some(mean * 8f64.sqrt() / PI / ((n - 1) as f64).sqrt()),
    }
}

/// Radius about a geometric median of `count` points within which the truth lies with a probability of 95 %,
/// in its standard errors: the squared distance over 2 se^2 is taken as F(2, 2 (n - 1)), whose quantile has
/// this closed form.
pub fn radius95(count: usize) -> Option<f64> {
    let freedom = count.checked_sub(1).filter(|freedom| *freedom > 0)? as f64;
    Some((2.0 * freedom * (0.05f64.powf(-1.0 / freedom) - 1.0)).sqrt())
}

pub(super) fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::test_noise::Noise;

    fn near(found: Option<[f64; 2]>, expected: [f64; 2], within: f64) {
        let found = found.unwrap();
        assert!(distance(found, expected) <= within, "{found:?} instead of {expected:?}");
    }

    #[test]
    fn closed_forms() {
        assert_eq!(geometric_median(&[]), None);
        assert_eq!(geometric_median(&[[1.0, f64::NAN]]), None);
        assert_eq!(geometric_median(&[[3.0, 4.0]]), Some([3.0, 4.0]));
        assert_eq!(geometric_median(&[[0.0, 0.0], [2.0, 4.0]]), Some([1.0, 2.0]));
        // Of the corners of a convex quadrilateral: where its diagonals cross (Fagnano).
        near(geometric_median(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 2.0]]), [4.0 / 3.0; 2], 1e-9);
        // A triangle with an angle above 120 degrees: its corner. A corner that is there twice, too.
        assert_eq!(geometric_median(&[[10.0, 1.0], [0.0, 0.0], [-10.0, 1.0]]), Some([0.0; 2]));
        assert_eq!(geometric_median(&[[5.0, 5.0], [9.0, 1.0], [5.0, 5.0], [0.0, 0.0]]), Some([5.0; 2]));
        // On a line: the middle of an odd number.
        near(geometric_median(&[[0.0, 0.0], [1.0, 1.0], [9.0, 9.0]]), [1.0; 2], 1e-9);
    }

    /// Any other triangle: all sides are seen under 120 degrees (Torricelli), so unit vectors sum to zero.
    #[test]
    fn sides_are_seen_under_equal_angles() {
        let corners = [[0.0, 0.0], [7.0, 1.0], [2.0, 5.0]];
        let at = geometric_median(&corners).unwrap();
        let (pull, own) = pull(&corners, at);
        assert!(own == 0.0 && pull[0].hypot(pull[1]) < 1e-9, "{pull:?}");
    }

    /// One of seven marks may go anywhere: the median moves less than the spread of the six.
    #[test]
    fn one_wild_mark_moves_little() {
        let six = [[0.0, 0.0], [1.0, 0.3], [0.2, 1.0], [-0.8, 0.1], [0.4, -0.9], [-0.3, 0.5]];
        let at = |wild| geometric_median(&[&six[..], &[wild]].concat()).unwrap();
        assert!(distance(at([0.1, 0.1]), at([1e4, 1e4])) < 1.0);
    }

    /// How often the truth lies within the radius, and the mean square of the error against that of
    /// `standard_error`.
    fn coverage(draw: &mut dyn FnMut() -> [f64; 2], count: usize, runs: usize) -> (f64, f64) {
        let (mut inside, mut squares, mut claimed) = (0, 0.0, 0.0);
        for _ in 0..runs {
            let points: Vec<_> = (0..count).map(|_| draw()).collect();
            let at = geometric_median(&points).unwrap();
            let error = standard_error(&points, at).unwrap();
            let off = distance(at, [0.0; 2]);
            inside += usize::from(off <= error * radius95(count).unwrap());
            squares += 0.5 * off * off;
            claimed += error * error;
        }
        (inside as f64 / runs as f64, claimed / squares)
    }

    /// 4000 runs: a share of 0.95 has a standard error of 0.0034; four of them, and 0.005 for the approximate
    /// F law, are the bounds. The mean square of an error in the plane has a relative standard error of 1 /
    /// sqrt(4000) at least (each square is exponential); five of them for both means together, and 8 % for
    /// the asymptotic factor, which at four operators is off by so much.
    #[test]
    fn the_standard_error_covers() {
        let mut noise = Noise(3);
        for count in [2, 3, 4, 5, 7, 12] {
            let (share, ratio) = coverage(&mut || [2.0 * noise.normal(), 2.0 * noise.normal()], count, 4000);
            assert!((share - 0.95).abs() < 0.0136 + 0.005, "{count} operators: {share}");
            assert!((ratio - 1.0).abs() < 0.08 + 0.08, "{count} operators: {ratio}");
        }
        // One mark of ten is a slip of 10 standard deviations: the interval is wide rather than short.
        for count in [3, 5, 7] {
            let mut draw = || {
                let size = if noise.uniform() < 0.1 { 10.0 } else { 1.0 };
                [size * noise.normal(), size * noise.normal()]
            };
            let (share, _) = coverage(&mut draw, count, 4000);
            assert!(share > 0.95 - 0.0136, "{count} operators with slips: {share}");
        }
        // Five times as far across as down, the other way an interval is too short by a little, and is said
        // to be.
        let (share, _) = coverage(&mut || [noise.normal(), 0.2 * noise.normal()], 5, 4000);
        assert!((0.86..0.95).contains(&share), "{share}");
        assert_eq!((standard_error(&[[1.0, 1.0]], [1.0, 1.0]), radius95(1), radius95(0)), (None, None, None));
    }
}
