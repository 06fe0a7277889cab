//! Who is best at what price.

/// Which of (cost, loss) no other beats in both, or in one at no loss in the other: the Pareto front. Points
/// with a number that is not finite are never on it.
pub fn front(points: &[[f64; 2]]) -> Vec<bool> {
    let sound = |p: &[f64; 2]| p.iter().all(|v| v.is_finite());
    let beats = |a: &[f64; 2], b: &[f64; 2]| sound(a) && a[0] <= b[0] && a[1] <= b[1] && a != b;
    points.iter().map(|p| sound(p) && !points.iter().any(|other| beats(other, p))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_is_what_nothing_beats() {
        let points = [[1.0, 5.0], [2.0, 3.0], [2.0, 4.0], [3.0, 3.0], [4.0, 1.0], [0.5, f64::NAN]];
        assert_eq!(front(&points), [true, true, false, false, true, false]);
        assert_eq!(front(&[[1.0, 1.0], [1.0, 1.0]]), [true, true]);
    }
}
