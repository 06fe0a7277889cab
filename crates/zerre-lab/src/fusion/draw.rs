//! Frames with the points that are followed.

use crate::error::Result;
use crate::report::animation::{Colour, Frame, Pen};
use crate::report::overlay::Drawn;
use std::f64::consts::TAU;

const POINT: Colour = [255, 160, 20, 255];
const LOST: Colour = [255, 40, 80, 255];
const TRUTH: Colour = [70, 220, 110, 255];
const PARTICLE: Colour = [253, 231, 37, 200];
const INK: Colour = [255, 255, 255, 255];
const SHADE: Colour = [0, 0, 0, 150];
/// Root of the quantile of chi-square with two degrees of freedom at 95 %.
const WITHIN_95: f64 = 2.447_746_830_680_816;

/// A point to draw.
#[derive(Clone, Debug)]
pub struct ShownPoint {
    /// Where it is, pixels.
    pub at: [f64; 2],
    /// Covariance of that.
    pub covariance: [[f64; 2]; 2],
    /// Whether it is flagged as lost.
    pub lost: bool,
    /// Its particles.
    pub particles: Vec<[f64; 2]>,
}

/// A frame with points on it: a cross and the 95 % ellipse, dashed and red where a point is flagged as lost; particles as
/// dots; the truth green.
pub struct PointScene<'a> {
    /// The picture.
    pub frame: &'a zerre_vision::Frame,
    /// What people know it by.
    pub name: &'a str,
    /// Where points are.
    pub points: &'a [ShownPoint],
    /// Where they truly are.
    pub truth: &'a [[f64; 2]],
}

impl Drawn for PointScene<'_> {
    fn size(&self) -> (usize, usize) {
        self.frame.size()
    }

    fn draw(&self, size: [u16; 2]) -> Result<Frame> {
        let mut drawn = Frame::photograph(self.frame, size)?;
        let scale = f64::from(size[0]) / self.frame.width() as f64;
        let place = |p: [f64; 2]| p.map(|v| scale * v);
        for point in self.points {
            drawn.dots(point.particles.iter().map(|p| place(*p)), 1.2, PARTICLE);
        }
        let cross = |drawn: &mut Frame, [x, y]: [f64; 2], pen: Pen| {
            let arm = 5.0;
            drawn.line([[x - arm, y], [x + arm, y]], pen);
            drawn.line([[x, y - arm], [x, y + arm]], pen);
        };
        for truth in self.truth {
            cross(&mut drawn, place(*truth), Pen { colour: TRUTH, width: 2.0, dashed: false });
        }
        for point in self.points {
            let colour = if point.lost { LOST } else { POINT };
            cross(&mut drawn, place(point.at), Pen { colour, width: 2.0, dashed: false });
            // The covariance's lower Cholesky factor takes the circle to the ellipse.
            let [[a, b], [_, c]] = point.covariance;
            let first = a.max(0.0).sqrt();
            let across = if first > 0.0 { b / first } else { 0.0 };
            let second = (c - across * across).max(0.0).sqrt();
            let rim = (0..=64).map(|k| {
                let (sin, cos) = zerre::math::sin_cos(f64::from(k) * TAU / 64.0);
                let off = [first * cos, across * cos + second * sin];
                place([0, 1].map(|i| point.at[i] + WITHIN_95 * off[i]))
            });
            drawn.line(rim, Pen { colour, width: 1.5, dashed: point.lost });
        }
        let right = f64::from(size[0]);
        drawn.area([[0.0, 0.0], [right, 0.0], [right, 16.0], [0.0, 16.0]], SHADE);
        let lost = self.points.iter().filter(|point| point.lost).count();
        let text = if lost > 0 { format!("{}  LOST", self.name) } else { self.name.to_owned() };
        drawn.text([4.0, 12.0], 8.0, &text, if lost > 0 { LOST } else { INK });
        Ok(drawn)
    }
}
