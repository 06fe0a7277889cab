//! What the paper prints of its single run.

use super::scenario::equal_shape;
use crate::metric::{ShapeErrors, shape_errors};
use std::error::Error;
use zerre::extended::Shape;

/// The estimate after ten scans: offsets, m, and extents (xx, xy, yy), m^2.
const ESTIMATE: [([f64; 2], [f64; 3]); 3] = [
    ([1.08, 0.36], [56.03, -1.04, 1.5]),
    ([0.4, -4.6], [7.12, 4.26, 4.76]),
    ([0.63, 5.33], [6.81, -4.45, 5.75]),
];

/// The printed shape.
///
/// # Errors
/// None: the numbers are a shape.
pub fn estimate() -> zerre::Result<Shape> {
    equal_shape(&ESTIMATE)
}

/// Its errors by the same measures as ours.
///
/// # Errors
/// None: the numbers are shapes.
pub fn errors(truth: &Shape) -> Result<ShapeErrors, Box<dyn Error>> {
    Ok(shape_errors(truth, &estimate()?)?)
}

#[cfg(test)]
mod tests {
    use super::super::scenario::truth;
    use super::*;

    /// The figures that the specification of the experiment derives from the paper, to their last digit.
    #[test]
    fn the_printed_run_has_the_known_errors() {
        let found = errors(&truth().unwrap()).unwrap();
        assert_eq!(found.order, [0, 1, 2]);
        assert!((found.extent - (0.124 + 0.086 + 0.124) / 3.0).abs() < 1e-3, "{found:?}");
        assert!((found.offset - (0.38 + 0.31 + 0.08) / 3.0).abs() < 5e-3, "{found:?}");
        assert!((found.gauss_wasserstein - (0.61 + 0.35 + 0.28) / 3.0).abs() < 5e-3, "{found:?}");
        assert!((found.gauge[0].hypot(found.gauge[1]) - 0.79).abs() < 5e-3, "{found:?}");
    }
}
