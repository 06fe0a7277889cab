//! Boxes that people drew about objects.

use zerre::math::sin_cos;

/// A box seen from above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LabelledBox {
    /// Its middle, m.
    pub centre: [f64; 2],
    /// Length and width, m.
    pub size: [f64; 2],
    /// Where its length points, rad, counterclockwise from x.
    pub yaw: f64,
}

impl LabelledBox {
    /// Whether a point lies within, or not further than `margin` from it along either side.
    pub fn holds(&self, y: [f64; 2], margin: f64) -> bool {
        let (sin, cos) = sin_cos(self.yaw);
        let d = [y[0] - self.centre[0], y[1] - self.centre[1]];
        let own = [cos * d[0] + sin * d[1], cos * d[1] - sin * d[0]];
        (0..2).all(|k| own[k].abs() <= 0.5 * self.size[k] + margin)
    }

    /// Corners about a place, counterclockwise.
    pub fn corners(&self, about: [f64; 2]) -> Vec<[f64; 2]> {
        let (sin, cos) = sin_cos(self.yaw);
        let corner = |[u, v]: [f64; 2]| {
            let (u, v) = (0.5 * u * self.size[0], 0.5 * v * self.size[1]);
            [self.centre[0] - about[0] + cos * u - sin * v, self.centre[1] - about[1] + sin * u + cos * v]
        };
        [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]].map(corner).to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_hold_their_points() {
        let label = LabelledBox { centre: [10.0, 5.0], size: [4.0, 2.0], yaw: std::f64::consts::FRAC_PI_2 };
        assert!(
            label.holds([10.9, 6.9], 0.0) && !label.holds([11.1, 5.0], 0.0) && label.holds([11.1, 5.0], 0.2)
        );
        let corners = label.corners([10.0, 5.0]);
        // A quarter turn: length along y.
        assert!(corners.iter().all(|c| (c[0].abs() - 1.0).abs() < 1e-12 && (c[1].abs() - 2.0).abs() < 1e-12));
    }
}
