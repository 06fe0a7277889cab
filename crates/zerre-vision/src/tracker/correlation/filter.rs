//! The background-aware correlation filter (Galoogahi, Fagg and Lucey, ICCV 2017): a filter as large as the object that is
//! trained with all shifts of a larger window, so that the surroundings are its counterexamples.

use super::fourier::{Bin, CHANNELS, Fourier, LANES, Spectrum};
use std::ops::Range;

/// Weight of the filter's own size against the fit.
const RIDGE: f32 = 0.01;
/// Penalty of the first turn; it grows tenfold each turn.
const PENALTY: f32 = 0.3;
const GROWTH: f32 = 10.0;
const LARGEST_PENALTY: f32 = 1000.0;

/// Trains filters on a grid.
pub struct Trainer {
    /// Transform of the wanted response: a normal peak at the origin.
    wanted: Vec<f32>,
    /// Rows and columns of the object, about the middle of the grid.
    rows: Range<usize>,
    columns: Range<usize>,
    turns: usize,
    /// Transforms of the filter that is as small as the object, and of the multipliers.
    small: Spectrum,
    multipliers: Spectrum,
}

/// sum of conj(a) b over channels, with a fixed order of the sums.
#[inline(always)]
fn inner(a: &Bin, b: &Bin) -> [f32; 2] {
    let (mut re, mut im) = ([0.0_f32; LANES], [0.0_f32; LANES]);
    for c in 0..CHANNELS {
        re[c % LANES] += a.re[c] * b.re[c] + a.im[c] * b.im[c];
        im[c % LANES] += a.re[c] * b.im[c] - a.im[c] * b.re[c];
    }
    [total(re), total(im)]
}

#[inline(always)]
fn total(mut lanes: [f32; LANES]) -> f32 {
    let mut half = LANES / 2;
    while half > 0 {
        for l in 0..half {
            lanes[l] += lanes[l + half];
        }
        half /= 2;
    }
    lanes[0]
}

impl Trainer {
    /// For objects of `size` cells (columns, rows) on the grid of `fourier`: the wanted response has a standard
    /// deviation of `sd` cells.
    pub fn new(fourier: &mut Fourier, size: (usize, usize), sd: f64, turns: usize) -> Trainer {
        let n = fourier.side();
        let middle = |length: usize| {
            let length = length.clamp(1, n);
            let start = n / 2 - length / 2;
            start..start + length
        };
        let from = |k: usize| if k > n / 2 { k as f64 - n as f64 } else { k as f64 };
        for (i, point) in fourier.grid().iter_mut().enumerate() {
            let (x, y) = (from(i % n), from(i / n));
            let value = zerre::math::Real::exp(-(x * x + y * y) / (2.0 * sd * sd)) as f32;
            *point = super::fourier::Lane { re: [value; LANES], im: [0.0; LANES] };
        }
        let mut spectrum = Spectrum::new();
        fourier.forward(0..n, &mut spectrum);
        Trainer {
            wanted: spectrum.iter().map(|bin| bin.re[0]).collect(),
            rows: middle(size.1),
            columns: middle(size.0),
            turns,
            small: Spectrum::new(),
            multipliers: Spectrum::new(),
        }
    }

    /// The filter for the features `seen`, written to `filter`: its transform, of the size of the grid.
    pub fn train(&mut self, fourier: &mut Fourier, seen: &Spectrum, filter: &mut Spectrum) {
        let points = (fourier.side() * fourier.side()) as f32;
        filter.clear();
        filter.resize(seen.len(), Bin::ZERO);
        for spectrum in [&mut self.small, &mut self.multipliers] {
            spectrum.clear();
            spectrum.resize(seen.len(), Bin::ZERO);
        }
        let mut penalty = PENALTY;
        for turn in 0..self.turns {
            super::wide(
                #[inline(always)]
                || self.fit(seen, filter, penalty, points, turn == 0),
            );
            self.shrink(fourier, filter, penalty, points);
            if turn + 1 < self.turns {
                super::wide(
                    #[inline(always)]
                    || {
                        for (l, (g, h)) in self.multipliers.iter_mut().zip(filter.iter().zip(&self.small)) {
                            for c in 0..CHANNELS {
                                l.re[c] += penalty * (g.re[c] - h.re[c]);
                                l.im[c] += penalty * (g.im[c] - h.im[c]);
                            }
                        }
                    },
                );
            }
            penalty = (GROWTH * penalty).min(LARGEST_PENALTY);
        }
    }

    /// The filter of any size that fits best, bin by bin (equation 9 there: Sherman and Morrison).
    #[inline(always)]
    fn fit(&self, seen: &Spectrum, filter: &mut Spectrum, penalty: f32, points: f32, first: bool) {
        for (at, g) in filter.iter_mut().enumerate() {
            let (x, h, l) = (&seen[at], &self.small[at], &self.multipliers[at]);
            let wanted = self.wanted[at];
            let power = inner(x, x)[0];
            let whole = power + points * penalty;
            let scale = 1.0 / (points * penalty);
            if first {
                let factor = scale * wanted * (1.0 - power / whole);
                for c in 0..CHANNELS {
                    g.re[c] = factor * x.re[c];
                    g.im[c] = factor * x.im[c];
                }
                continue;
            }
            let ([lr, li], [hr, hi]) = (inner(x, l), inner(x, h));
            let re = scale * wanted - (scale * power * wanted - lr / penalty + hr) / whole;
            let im = -(hi - li / penalty) / whole;
            for c in 0..CHANNELS {
                g.re[c] = x.re[c] * re - x.im[c] * im + h.re[c] - l.re[c] / penalty;
                g.im[c] = x.re[c] * im + x.im[c] * re + h.im[c] - l.im[c] / penalty;
            }
        }
    }

    /// The filter that is as small as the object and nearest to it.
    fn shrink(&mut self, fourier: &mut Fourier, filter: &Spectrum, penalty: f32, points: f32) {
        for (h, (g, l)) in self.small.iter_mut().zip(filter.iter().zip(&self.multipliers)) {
            for c in 0..CHANNELS {
                h.re[c] = penalty * g.re[c] + l.re[c];
                h.im[c] = penalty * g.im[c] + l.im[c];
            }
        }
        fourier.inverse(&self.small, self.rows.clone());
        let scale = points / (penalty * points + RIDGE);
        let n = fourier.side();
        for (i, point) in fourier.grid().iter_mut().enumerate() {
            let kept = self.rows.contains(&(i / n)) && self.columns.contains(&(i % n));
            let scale = if kept { scale } else { 0.0 };
            for l in 0..LANES {
                // What stands in rows that were not wanted may be anything.
                point.re[l] = if kept { point.re[l] * scale } else { 0.0 };
                point.im[l] = if kept { point.im[l] * scale } else { 0.0 };
            }
        }
        fourier.forward(self.rows.clone(), &mut self.small);
    }
}

/// Responses of filters to features, all real: one channel of `out` for each pair, 0 at the shift (0, 0) of the object.
/// At most [`CHANNELS`] of them.
pub fn respond(pairs: &[(&Spectrum, &Spectrum)], out: &mut Spectrum) {
    let bins = pairs.first().map_or(0, |(filter, _)| filter.len());
    out.clear();
    out.resize(bins, Bin::ZERO);
    super::wide(
        #[inline(always)]
        || {
            for (channel, (filter, seen)) in pairs.iter().take(CHANNELS).enumerate() {
                for ((out, g), x) in out.iter_mut().zip(filter.iter()).zip(seen.iter()) {
                    let [re, im] = inner(g, x);
                    out.re[channel] = re;
                    out.im[channel] = im;
                }
            }
        },
    );
}
