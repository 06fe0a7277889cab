//! How large the object is: a correlation filter along the scale alone (Danelljan, Haeger, Khan and Felsberg, BMVC 2014,
//! section 3.2).

use super::features::{CELL, Cell, Features};
use crate::{Frame, Rect};
use std::f64::consts::TAU;
use zerre::math::Real;

/// Scales that are compared, an odd number.
const SCALES: usize = 17;
/// Bins of half their spectrum.
const BINS: usize = SCALES / 2 + 1;
/// One scale over the one before.
const STEP: f64 = 1.025;
/// Standard deviation of the wanted response, in scales.
const SD: f64 = 1.0;
/// Pixels of a patch at most.
const AREA: f64 = 512.0;
/// Weight of the filter's own size.
const RIDGE: f32 = 0.01;
/// Channels of a cell that count: no colours.
const USED: usize = 29;

/// A filter along the scale.
pub struct ScaleFilter {
    /// Cells of a patch (columns, rows).
    cells: (usize, usize),
    rate: f32,
    features: Features,
    patch: Vec<Cell>,
    /// What the scales look like, feature after feature.
    seen: Vec<[f32; SCALES]>,
    numerator: Vec<[[f32; 2]; BINS]>,
    denominator: [f32; BINS],
    /// Transform of the wanted response.
    wanted: [f32; BINS],
    /// `roots[k][s]`: cosine and sine of -2 pi k s / S.
    roots: [[[f32; 2]; SCALES]; BINS],
    window: [f32; SCALES],
}

impl ScaleFilter {
    /// For a box of this size, trained with that share of each new frame.
    pub fn new(width: f64, height: f64, rate: f64) -> ScaleFilter {
        let shrink = (AREA / (width * height)).sqrt().min(1.0);
        let cells = |length: f64| ((length * shrink / CELL as f64).round() as usize).max(2);
        let roots = std::array::from_fn(|k| {
            std::array::from_fn(|s| {
                let (sin, cos) = Real::sin_cos(-TAU * ((k * s) % SCALES) as f64 / SCALES as f64);
                [cos as f32, sin as f32]
            })
        });
        let mut filter = ScaleFilter {
            cells: (cells(width), cells(height)),
            rate: rate as f32,
            features: Features::default(),
            patch: Vec::new(),
            seen: Vec::new(),
            numerator: Vec::new(),
            denominator: [0.0; BINS],
            wanted: [0.0; BINS],
            roots,
            window: std::array::from_fn(|s| {
                (0.5 - 0.5 * Real::sin_cos(TAU * (s as f64 + 1.0) / (SCALES as f64 + 1.0)).1) as f32
            }),
        };
        let peak: [f32; SCALES] = std::array::from_fn(|s| Real::exp(-0.5 * (offset(s) / SD).square()) as f32);
        // About scale 0 in the middle: the phase is taken out, so that the transform of the peak is real.
        for k in 0..BINS {
            let mut sum = 0.0;
            for s in 0..SCALES {
                let angle = TAU * k as f64 * offset(s) / SCALES as f64;
                sum += peak[s] * Real::sin_cos(angle).1 as f32;
            }
            filter.wanted[k] = sum;
        }
        filter
    }

    fn look(&mut self, frame: &Frame, bounds: Rect) {
        let features = self.cells.0 * self.cells.1 * USED;
        self.seen.resize(features, [0.0; SCALES]);
        for s in 0..SCALES {
            let factor = Real::exp(offset(s) * Real::ln(STEP));
            let window = Rect::about(bounds.centre(), bounds.width * factor, bounds.height * factor);
            self.features.describe(frame, window, self.cells, false, &mut self.patch);
            for (cell, seen) in self.patch.iter().zip(self.seen.chunks_exact_mut(USED)) {
                for (value, seen) in cell[..USED].iter().zip(seen) {
                    seen[s] = value * self.window[s];
                }
            }
        }
    }

    #[inline(always)]
    fn transform(&self, values: &[f32; SCALES]) -> [[f32; 2]; BINS] {
        let mut out = [[0.0; 2]; BINS];
        for k in 0..BINS {
            let (mut re, mut im) = (0.0, 0.0);
            for s in 0..SCALES {
                re += self.roots[k][s][0] * values[s];
                im += self.roots[k][s][1] * values[s];
            }
            out[k] = [re, im];
        }
        out
    }

    /// By which factor the object in the box has grown.
    pub fn estimate(&mut self, frame: &Frame, bounds: Rect) -> f64 {
        if self.numerator.is_empty() {
            return 1.0;
        }
        self.look(frame, bounds);
        let mut sum = [[0.0_f32; 2]; BINS];
        for (values, a) in self.seen.iter().zip(&self.numerator) {
            let z = self.transform(values);
            for k in 0..BINS {
                // conj(A) Z
                sum[k][0] += a[k][0] * z[k][0] + a[k][1] * z[k][1];
                sum[k][1] += a[k][0] * z[k][1] - a[k][1] * z[k][0];
            }
        }
        for k in 0..BINS {
            let scale = 1.0 / (self.denominator[k] + RIDGE);
            sum[k] = sum[k].map(|v| v * scale);
        }
        // On a grid five times finer.
        let response = |at: f64| {
            let mut value = f64::from(sum[0][0]);
            for k in 1..BINS {
                let (sin, cos) = Real::sin_cos(TAU * k as f64 * at / SCALES as f64);
                value += 2.0 * (f64::from(sum[k][0]) * cos - f64::from(sum[k][1]) * sin);
            }
            value
        };
        let reach = (5 * (SCALES / 2)) as i32;
        let best = (-reach..=reach)
            .map(|i| f64::from(i) / 5.0)
            .map(|at| (response(at), at))
            .fold((f64::MIN, 0.0), |best, next| if next.0 > best.0 { next } else { best });
        Real::exp(best.1 * Real::ln(STEP))
    }

    /// Learns what the object in the box looks like at all scales.
    pub fn learn(&mut self, frame: &Frame, bounds: Rect, share: f32) {
        self.look(frame, bounds);
        let first = self.numerator.is_empty();
        self.numerator.resize(self.seen.len(), [[0.0; 2]; BINS]);
        let rate = if first { 1.0 } else { self.rate * share };
        let mut power = [0.0_f32; BINS];
        for i in 0..self.seen.len() {
            let x = self.transform(&self.seen[i]);
            let a = &mut self.numerator[i];
            for k in 0..BINS {
                // The peak stands about the middle: the same phase in the wanted response and in what is seen later.
                a[k] = std::array::from_fn(|p| (1.0 - rate) * a[k][p] + rate * self.wanted[k] * x[k][p]);
                power[k] += x[k][0] * x[k][0] + x[k][1] * x[k][1];
            }
        }
        for k in 0..BINS {
            self.denominator[k] = (1.0 - rate) * self.denominator[k] + rate * power[k];
        }
    }
}

/// Scales from the middle one.
fn offset(s: usize) -> f64 {
    s as f64 - (SCALES / 2) as f64
}
