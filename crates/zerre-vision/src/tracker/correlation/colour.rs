//! What colours the object has and its surroundings do not (Bertinetto, Valmadre, Golodetz, Miksik and Torr, CVPR 2016,
//! section 3.3).

use super::features::Features;
use crate::{Frame, Rect};

/// Steps of each colour.
const STEPS: usize = 16;
/// Pixels that a cell is sampled with on each side.
pub const FINE: usize = 2;

/// Shares of colours in the object and about it.
pub struct ColourModel {
    rate: f32,
    inside: Vec<f32>,
    outside: Vec<f32>,
    contrast: f32,
    features: Features,
    share: Vec<f32>,
    integral: Vec<f64>,
}

fn bin(colour: &[f32; 3]) -> usize {
    let step = |v: f32| (v as usize * STEPS / 256).min(STEPS - 1);
    (step(colour[0]) * STEPS + step(colour[1])) * STEPS + step(colour[2])
}

impl ColourModel {
    /// Learns with that share of each new frame.
    pub fn new(rate: f64) -> ColourModel {
        ColourModel {
            rate: rate as f32,
            inside: Vec::new(),
            outside: Vec::new(),
            contrast: 0.0,
            features: Features::default(),
            share: Vec::new(),
            integral: Vec::new(),
        }
    }

    /// How much more the object's pixels look like it than those about it do, from 0 to 1.
    pub fn contrast(&self) -> f32 {
        self.contrast.max(0.0)
    }

    /// Learns from a window of n x n cells with the object in its middle, `size` cells large (columns, rows).
    pub fn learn(&mut self, frame: &Frame, window: Rect, n: usize, size: (f64, f64), share: f32) {
        let side = n * FINE;
        let colours = self.features.colours(frame, window, (side, side));
        let mut counts = [vec![0.0_f32; STEPS * STEPS * STEPS], vec![0.0_f32; STEPS * STEPS * STEPS]];
        let middle = side as f64 / 2.0;
        for (i, colour) in colours.iter().enumerate() {
            let dx = ((i % side) as f64 + 0.5 - middle).abs() / (size.0 * FINE as f64);
            let dy = ((i / side) as f64 + 0.5 - middle).abs() / (size.1 * FINE as f64);
            // The rim of the box is neither.
            if dx < 0.4 && dy < 0.4 {
                counts[0][bin(colour)] += 1.0;
            } else if dx > 0.55 || dy > 0.55 {
                counts[1][bin(colour)] += 1.0;
            }
        }
        let first = self.inside.is_empty();
        let rate = if first { 1.0 } else { self.rate * share };
        for (model, counts) in [&mut self.inside, &mut self.outside].into_iter().zip(&counts) {
            model.resize(counts.len(), 0.0);
            let total = counts.iter().sum::<f32>().max(1.0);
            for (share, count) in model.iter_mut().zip(counts) {
                *share = (1.0 - rate) * *share + rate * count / total;
            }
        }
        let pairs = self.inside.iter().zip(&self.outside);
        self.contrast = pairs.map(|(i, o)| (i - o) * (i + 1e-4) / (i + o + 2e-4)).sum();
    }

    /// Mean probability of the object's colours in its box, for the box moved by whole cells: `out[y * n + x]` with the
    /// box's centre in cell (x, y) of the window.
    pub fn respond(&mut self, frame: &Frame, window: Rect, n: usize, size: (f64, f64), out: &mut Vec<f32>) {
        let side = n * FINE;
        let colours = self.features.colours(frame, window, (side, side));
        self.share.clear();
        self.share.extend(colours.iter().map(|colour| {
            let at = bin(colour);
            let (inside, outside) = (self.inside[at], self.outside[at]);
            // A colour that was never seen says nothing.
            (inside + 1e-4) / (inside + outside + 2e-4)
        }));
        let wide = side + 1;
        self.integral.clear();
        self.integral.resize(wide * wide, 0.0);
        for y in 0..side {
            let mut row = 0.0;
            for x in 0..side {
                row += f64::from(self.share[y * side + x]);
                self.integral[(y + 1) * wide + x + 1] = self.integral[y * wide + x + 1] + row;
            }
        }
        let reach = |length: f64| ((length * FINE as f64 / 2.0).round() as usize).clamp(1, side / 2);
        let (rx, ry) = (reach(size.0), reach(size.1));
        out.clear();
        for cy in 0..n {
            for cx in 0..n {
                let (x, y) = (cx * FINE + FINE / 2, cy * FINE + FINE / 2);
                let (left, right) = (x.saturating_sub(rx), (x + rx).min(side));
                let (top, bottom) = (y.saturating_sub(ry), (y + ry).min(side));
                let sum = self.integral[bottom * wide + right] + self.integral[top * wide + left]
                    - self.integral[bottom * wide + left]
                    - self.integral[top * wide + right];
                out.push((sum / (4 * rx * ry) as f64) as f32);
            }
        }
    }
}
