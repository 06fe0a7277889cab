//! Frames with the balls that are followed.

use crate::error::Result;
use crate::report::animation::{Colour, Frame, Pen};
use crate::report::overlay::Drawn;
use std::f64::consts::TAU;
use zerre_vision::balls::TrueBall;

/// Colours of the balls, in turn.
const COLOURS: [Colour; 8] = [
    [255, 160, 20, 255],
    [60, 160, 255, 255],
    [220, 60, 220, 255],
    [40, 200, 120, 255],
    [255, 70, 70, 255],
    [130, 110, 255, 255],
    [200, 180, 0, 255],
    [0, 190, 200, 255],
];
const TRUTH: Colour = [70, 220, 110, 255];
const INK: Colour = [255, 255, 255, 255];
const SHADE: Colour = [0, 0, 0, 150];

/// A ball to draw.
#[derive(Clone, Debug)]
pub struct ShownBall {
    /// Its number.
    pub number: usize,
    /// Its middle, px.
    pub centre: [f64; 2],
    /// Its radius, px.
    pub radius: f64,
    /// Whether it was detected in this frame; otherwise it is drawn dashed.
    pub detected: bool,
    /// Its particles.
    pub particles: Vec<[f64; 2]>,
}

/// A frame with balls on it: rims solid where they were detected, dashed where they are only predicted; particles as
/// dots; the truth thin and green.
pub struct BallScene<'a> {
    /// The picture.
    pub frame: &'a zerre_vision::Frame,
    /// Its number, from 0.
    pub index: usize,
    /// Where balls are.
    pub balls: &'a [ShownBall],
    /// Where they truly are.
    pub truth: &'a [TrueBall],
}

impl Drawn for BallScene<'_> {
    fn size(&self) -> (usize, usize) {
        self.frame.size()
    }

    fn draw(&self, size: [u16; 2]) -> Result<Frame> {
        let mut drawn = Frame::photograph(self.frame, size)?;
        let scale = f64::from(size[0]) / self.frame.width() as f64;
        let rim = |centre: [f64; 2], radius: f64| {
            (0..=48).map(move |k| {
                let (sin, cos) = zerre::math::sin_cos(f64::from(k) * TAU / 48.0);
                [scale * (centre[0] + radius * cos), scale * (centre[1] + radius * sin)]
            })
        };
        for ball in self.truth {
            drawn.line(rim(ball.centre, ball.radius), Pen { colour: TRUTH, width: 1.0, dashed: false });
        }
        for ball in self.balls {
            let colour = COLOURS[ball.number.saturating_sub(1) % COLOURS.len()];
            let place = |p: &[f64; 2]| p.map(|v| scale * v);
            drawn.dots(ball.particles.iter().map(place), 1.0, colour);
            let radius = if ball.radius.is_finite() { ball.radius } else { 8.0 };
            drawn.line(rim(ball.centre, radius), Pen { colour, width: 2.0, dashed: !ball.detected });
            let at = place(&ball.centre).map(|v| v as f32);
            drawn.text([at[0] + 4.0, at[1] - 4.0], 11.0, &ball.number.to_string(), INK);
        }
        let right = f64::from(size[0]);
        drawn.area([[0.0, 0.0], [right, 0.0], [right, 16.0], [0.0, 16.0]], SHADE);
        let found = self.balls.iter().filter(|ball| ball.detected).count();
        let text = format!("{}  balls: {found} seen  {} followed", self.index, self.balls.len());
        drawn.text([4.0, 12.0], 8.0, &text, INK);
        Ok(drawn)
    }
}
