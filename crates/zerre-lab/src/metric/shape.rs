//! How far shapes made of ellipses lie apart, as laws of points.
//!
//! Shapes are given about their centres; to compare them in the plane, move them there first
//! ([`Shape::about`] minus the centre). Ellipses have no names: those of two shapes are compared in the order
//! that fits best. What two shapes cover is compared by [`Region`](super::Region).

use crate::error::{Error, Result};
use zerre::extended::{Ellipse, Shape};
use zerre::math::Matrix;
use zerre::math::assignment::{assign, transport};

/// Squared Gauss-Wasserstein distance of two normal laws, m^2: |m1 - m2|^2 + tr(A + B - 2 (A^1/2 B A^1/2)^1/2), in
/// closed form in the plane: tr (A^1/2 B A^1/2)^1/2 = sqrt(tr(A B) + 2 sqrt(det A det B)). Weights do not count
/// (S. Yang, M. Baum, K. Granström, Metrics for performance evaluation of elliptic extended object tracking methods,
/// MFI 2016).
pub fn gauss_wasserstein_squared(a: &Ellipse, b: &Ellipse) -> f64 {
    let (x, y) = (a.offset[0] - b.offset[0], a.offset[1] - b.offset[1]);
    let trace = |m: &Matrix<2, 2>| m.0[0][0] + m.0[1][1];
    let det = |m: &Matrix<2, 2>| m.0[0][0] * m.0[1][1] - m.0[0][1] * m.0[1][0];
    let both = trace(&(a.extent * b.extent)) + 2.0 * (det(&a.extent) * det(&b.extent)).max(0.0).sqrt();
    let rest = trace(&a.extent) + trace(&b.extent) - 2.0 * both.max(0.0).sqrt();
    x * x + y * y + rest.max(0.0)
}

/// Squared Gauss-Wasserstein distances of all pairs, row-major: rows are the ellipses of `a`.
fn squared_distances(a: &Shape, b: &Shape) -> Vec<f64> {
    let row = |of: &Ellipse| -> Vec<f64> {
        b.ellipses().iter().map(|to| gauss_wasserstein_squared(of, to)).collect()
    };
    a.ellipses().iter().flat_map(row).collect()
}

/// Wasserstein distance of mixtures, m: the least root mean squared Gauss-Wasserstein distance over which the weights
/// of one shape can be moved to those of the other (J. Delon, A. Desolneux, A Wasserstein-type distance in the space of
/// Gaussian mixture models, SIAM J. on Imaging Sciences 13, 2020). The numbers of ellipses may differ.
///
/// # Errors
/// [`Error::NotFinite`] for shapes so far apart that the square of the distance is no number.
pub fn mixture_wasserstein(a: &Shape, b: &Shape) -> Result<f64> {
    let weights = |shape: &Shape| -> Vec<f64> { shape.ellipses().iter().map(|e| e.weight).collect() };
    Ok(transport(&squared_distances(a, b), &weights(a), &weights(b))?.max(0.0).sqrt())
}

/// Errors of a shape against the truth, ellipse by ellipse after the best assignment, the common offset of all taken
/// off first (the centre of a shape and its offsets move against each other unseen).
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeErrors {
    /// Mean over the ellipses of |X - X_true| / |X_true|, Frobenius.
    pub extent: f64,
    /// Mean distance of the offsets, m.
    pub offset: f64,
    /// Mean Gauss-Wasserstein distance, m.
    pub gauss_wasserstein: f64,
    /// The common offset that was taken off, m.
    pub gauge: [f64; 2],
    /// Which ellipse of the estimate stands for each of the truth: the assignment of least total squared
    /// Gauss-Wasserstein distance.
    pub order: Vec<usize>,
}

/// The errors of `estimate`.
///
/// # Errors
/// [`Error::Shape`] where the numbers of ellipses differ, [`Error::NotFinite`] where the square of a distance is no
/// number.
pub fn shape_errors(truth: &Shape, estimate: &Shape) -> Result<ShapeErrors> {
    let (expected, found) = (truth.len(), estimate.len());
    if found != expected {
        return Err(Error::Shape { what: "ellipses of an estimate", index: 0, found, expected });
    }
    let count = expected as f64;
    let mean_offset = |shape: &Shape| {
        let sum = shape.ellipses().iter().fold([0.0; 2], |s, e| [s[0] + e.offset[0], s[1] + e.offset[1]]);
        sum.map(|x| x / count)
    };
    let (a, b) = (mean_offset(truth), mean_offset(estimate));
    let gauge = [b[0] - a[0], b[1] - a[1]];
    let moved = estimate.about(gauge);
    let pairs = assign(&squared_distances(truth, &moved), expected, found)?;
    let order: Vec<usize> = pairs.column_of_row.into_iter().flatten().collect();
    let mut errors = ShapeErrors { extent: 0.0, offset: 0.0, gauss_wasserstein: 0.0, gauge, order };
    for (t, &at) in truth.ellipses().iter().zip(&errors.order) {
        let e = &moved.ellipses()[at];
        let norm = |m: Matrix<2, 2>| m.0.iter().flatten().map(|x| x * x).sum::<f64>().sqrt();
        errors.extent += norm(e.extent - t.extent) / norm(t.extent) / count;
        errors.offset += (e.offset[0] - t.offset[0]).hypot(e.offset[1] - t.offset[1]) / count;
        errors.gauss_wasserstein += gauss_wasserstein_squared(t, e).sqrt() / count;
    }
    Ok(errors)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::test_noise::Noise;
    use zerre::math::Cholesky;

    fn random(noise: &mut Noise) -> Ellipse {
        let a = Matrix([[noise.normal(), noise.normal()], [noise.normal(), noise.normal()]]);
        let extent = a * a.transpose() + Matrix::identity() * 0.05;
        Ellipse {
            weight: noise.uniform(),
            offset: [2.0 * noise.normal(), 2.0 * noise.normal()],
            extent: extent.symmetrised(),
        }
    }

    fn shape(count: usize, noise: &mut Noise) -> Shape {
        Shape::new((0..count).map(|_| random(noise)).collect()).unwrap()
    }

    /// The definition: the least expected squared distance over all couplings. Those of normal laws that are linear are
    /// Cov(X, Y) = L R M' with L L' = A, M M' = B and R a rotation, with or without a reflection: R is searched over a
    /// grid of angles. The gain g(t) = tr(L R(t) M') is a sinusoid, so that half a step d from its top it lies below it
    /// by at most g d^2 / 8, and 2 g is at most tr A + tr B.
    #[test]
    fn the_closed_form_is_the_best_coupling() {
        let mut noise = Noise(1);
        for _ in 0..50 {
            let (a, b) = (random(&mut noise), random(&mut noise));
            let [l, m] = [&a, &b].map(|e| *Cholesky::of("extent", &e.extent).unwrap().factor());
            let steps = 20_000;
            let angle = std::f64::consts::TAU / f64::from(steps);
            let mut most = f64::NEG_INFINITY;
            for k in 0..steps {
                let (s, c) = (f64::from(k) * angle).sin_cos();
                for r in [Matrix([[c, -s], [s, c]]), Matrix([[c, s], [s, -c]])] {
                    most = most.max((l * r * m.transpose()).diagonal().iter().sum());
                }
            }
            let traces: f64 = a.extent.diagonal().iter().chain(&b.extent.diagonal()).sum();
            let far: f64 = (0..2).map(|k| (a.offset[k] - b.offset[k]).powi(2)).sum();
            let twin = far + traces - 2.0 * most;
            let bound = traces * angle * angle / 8.0 + 1e-12 * (traces + far);
            let found = gauss_wasserstein_squared(&a, &b);
            assert!(found <= twin + bound && twin - found <= bound, "{found} {twin} {bound}");
            assert!(gauss_wasserstein_squared(&a, &a) < 1e-12 * traces);
        }
    }

    /// Laws whose extents share their axes: distances of means and of standard deviations along each.
    #[test]
    fn the_closed_form_by_hand() {
        let ellipse =
            |x, a, b| Ellipse { weight: 1.0, offset: [x, 0.0], extent: Matrix([[a, 0.0], [0.0, b]]) };
        let found = gauss_wasserstein_squared(&ellipse(0.0, 1.0, 4.0), &ellipse(3.0, 9.0, 1.0));
        assert!((found - (9.0 + 4.0 + 1.0)).abs() < 1e-12, "{found}");
    }

    /// From one ellipse to many there is one plan only, and from two to two there is a line of plans, the best of which
    /// is an end of it; a shape in another order is the same shape.
    #[test]
    fn mixtures_are_moved_by_the_best_plan() {
        let mut noise = Noise(2);
        for _ in 0..20 {
            let (one, two, other) = (shape(1, &mut noise), shape(2, &mut noise), shape(2, &mut noise));
            let expected: f64 = two
                .ellipses()
                .iter()
                .map(|e| e.weight * gauss_wasserstein_squared(&one.ellipses()[0], e))
                .sum();
            let found = mixture_wasserstein(&one, &two).unwrap();
            assert!((found * found - expected).abs() < 1e-10 * expected, "{found} {expected}");
            assert!((found - mixture_wasserstein(&two, &one).unwrap()).abs() < 1e-10 * found);

            let d = squared_distances(&two, &other);
            let (p, q) = (two.ellipses()[0].weight, other.ellipses()[0].weight);
            let plan = |t: f64| t * d[0] + (p - t) * d[1] + (q - t) * d[2] + (1.0 - p - q + t) * d[3];
            let expected = plan((p + q - 1.0).max(0.0)).min(plan(p.min(q)));
            let found = mixture_wasserstein(&two, &other).unwrap();
            assert!((found * found - expected).abs() < 1e-10 * expected, "{found} {expected}");

            let three = shape(3, &mut noise);
            let turned = Shape::new(three.ellipses().iter().rev().copied().collect()).unwrap();
            assert!(mixture_wasserstein(&three, &turned).unwrap() < 1e-6);
        }
    }

    /// A shape moved as a whole and in another order has no error; one extent twice as large errs by one third of one.
    #[test]
    fn errors_are_of_the_best_order_without_the_common_offset() {
        let truth = shape(3, &mut Noise(3));
        let mut ellipses = truth.about([-5.0, 2.0]).ellipses().to_vec();
        ellipses.rotate_left(1);
        let found = shape_errors(&truth, &Shape::new(ellipses.clone()).unwrap()).unwrap();
        assert_eq!(found.order, [2, 0, 1]);
        assert!(found.extent == 0.0 && found.offset < 1e-14 && found.gauss_wasserstein < 1e-6, "{found:?}");
        assert!((found.gauge[0] - 5.0).abs() < 1e-14 && (found.gauge[1] + 2.0).abs() < 1e-14);
        ellipses[0].extent = ellipses[0].extent * 2.0;
        let found = shape_errors(&truth, &Shape::new(ellipses).unwrap()).unwrap();
        assert!((found.extent - 1.0 / 3.0).abs() < 1e-12, "{found:?}");
        assert!(matches!(shape_errors(&truth, &shape(2, &mut Noise(4))), Err(Error::Shape { found: 2, .. })));
    }
}
