//! Fourier transforms of square grids of many channels at once: sixteen complex channels stand side by side, so that a
//! butterfly is arithmetic on rows of sixteen numbers, and its bits do not depend on the width of the processor's
//! registers. Two real channels travel as one complex one.

use std::f64::consts::TAU;
use std::ops::Range;
use zerre::math::Real;

/// Complex channels that are transformed together.
pub const LANES: usize = 16;
/// Real channels that travel in them.
pub const CHANNELS: usize = 2 * LANES;

/// Sixteen complex numbers, a channel each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lane {
    /// Real parts: of the real channels, those from 0 to 15.
    pub re: [f32; LANES],
    /// Imaginary parts: of the real channels, those from 16 to 31.
    pub im: [f32; LANES],
}

/// The coefficients of all real channels at one frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bin {
    /// Real parts.
    pub re: [f32; CHANNELS],
    /// Imaginary parts.
    pub im: [f32; CHANNELS],
}

impl Bin {
    /// No coefficient.
    pub const ZERO: Bin = Bin { re: [0.0; CHANNELS], im: [0.0; CHANNELS] };
}

/// Half of the spectrum of real channels on an n x n grid: bin (ky, kx) with kx up to n / 2 stands at
/// `ky (n / 2 + 1) + kx`; the others are their conjugates.
pub type Spectrum = Vec<Bin>;

/// Complex multiplication.
type Twiddle = [f32; 2];

/// A stage of the transform: groups of `radix` points.
struct Stage {
    radix: usize,
    /// Points that one transform of this stage has.
    length: usize,
    /// `twiddles[j * radix + k]`.
    twiddles: Vec<Twiddle>,
}

/// Transforms of n x n grids.
pub struct Fourier {
    n: usize,
    stages: Vec<Stage>,
    /// exp(-2 pi i j k / r) for the radices that occur, row by row.
    roots: Vec<(usize, Vec<Twiddle>)>,
    line: Vec<Lane>,
    other: Vec<Lane>,
    grid: Vec<Lane>,
}

fn root(turn: f64) -> Twiddle {
    let (sin, cos) = Real::sin_cos(-TAU * turn);
    [cos as f32, sin as f32]
}

impl Lane {
    #[inline(always)]
    fn times(self, [c, s]: Twiddle) -> Lane {
        let mut out = Lane::default();
        for l in 0..LANES {
            out.re[l] = self.re[l] * c - self.im[l] * s;
            out.im[l] = self.re[l] * s + self.im[l] * c;
        }
        out
    }

    #[inline(always)]
    fn plus(self, other: Lane) -> Lane {
        let mut out = self;
        for l in 0..LANES {
            out.re[l] += other.re[l];
            out.im[l] += other.im[l];
        }
        out
    }

    #[inline(always)]
    fn minus(self, other: Lane) -> Lane {
        let mut out = self;
        for l in 0..LANES {
            out.re[l] -= other.re[l];
            out.im[l] -= other.im[l];
        }
        out
    }

    /// Times -i.
    #[inline(always)]
    fn turned(self) -> Lane {
        let mut out = Lane { re: self.im, im: self.re };
        for im in &mut out.im {
            *im = -*im;
        }
        out
    }
}

impl Fourier {
    /// Transforms of n x n grids, n a product of 2, 3 and 5.
    pub fn new(n: usize) -> Fourier {
        let mut stages = Vec::new();
        let (mut rest, mut roots) = (n, Vec::new());
        while rest > 1 {
            let radix = [4, 5, 3, 2].into_iter().find(|r| rest.is_multiple_of(*r)).unwrap_or(rest);
            let below = rest / radix;
            let twiddles =
                (0..below * radix).map(|i| root((i / radix * (i % radix)) as f64 / rest as f64)).collect();
            stages.push(Stage { radix, length: rest, twiddles });
            if !roots.iter().any(|(r, _)| *r == radix) {
                let of = |i: usize| root((i / radix * (i % radix) % radix) as f64 / radix as f64);
                roots.push((radix, (0..radix * radix).map(of).collect()));
            }
            rest = below;
        }
        let empty = vec![Lane::default(); n];
        Fourier { n, stages, roots, line: empty.clone(), other: empty, grid: vec![Lane::default(); n * n] }
    }

    /// Points of a side.
    pub fn side(&self) -> usize {
        self.n
    }

    /// Bins of a row of half a spectrum.
    pub fn half(&self) -> usize {
        self.n / 2 + 1
    }

    /// Transforms what is in `line` (Stockham, decimation in frequency).
    #[inline(always)]
    fn transform_line(&mut self) {
        let n = self.n;
        let mut stride = 1;
        for stage in &self.stages {
            let (radix, below) = (stage.radix, stage.length / stage.radix);
            let roots = self.roots.iter().find(|(r, _)| *r == radix).map_or(&[][..], |(_, roots)| roots);
            for j in 0..below {
                let twiddles = &stage.twiddles[j * radix..][..radix];
                for q in 0..stride {
                    let from = |k: usize| self.line[q + stride * (j + below * k)];
                    let to = |k: usize| q + stride * (radix * j + k);
                    match radix {
                        2 => {
                            let (a, b) = (from(0), from(1));
                            self.other[to(0)] = a.plus(b);
                            self.other[to(1)] = a.minus(b).times(twiddles[1]);
                        }
                        4 => {
                            let (a, b, c, d) = (from(0), from(1), from(2), from(3));
                            let (even, odd) = (a.plus(c), b.plus(d));
                            let (left, right) = (a.minus(c), b.minus(d).turned());
                            self.other[to(0)] = even.plus(odd);
                            self.other[to(1)] = left.plus(right).times(twiddles[1]);
                            self.other[to(2)] = even.minus(odd).times(twiddles[2]);
                            self.other[to(3)] = left.minus(right).times(twiddles[3]);
                        }
                        _ => {
                            for k in 0..radix {
                                let mut sum = from(0);
                                for m in 1..radix {
                                    sum = sum.plus(from(m).times(roots[k * radix + m]));
                                }
                                self.other[to(k)] = sum.times(twiddles[k]);
                            }
                        }
                    }
                }
            }
            std::mem::swap(&mut self.line, &mut self.other);
            stride *= radix;
        }
        debug_assert_eq!(stride, n);
    }

    #[inline(always)]
    fn rows(&mut self, rows: Range<usize>) {
        for y in rows {
            self.line.copy_from_slice(&self.grid[y * self.n..][..self.n]);
            self.transform_line();
            self.grid[y * self.n..][..self.n].copy_from_slice(&self.line);
        }
    }

    #[inline(always)]
    fn columns(&mut self) {
        for x in 0..self.n {
            for y in 0..self.n {
                self.line[y] = self.grid[y * self.n + x];
            }
            self.transform_line();
            for y in 0..self.n {
                self.grid[y * self.n + x] = self.line[y];
            }
        }
    }

    /// The grid that is transformed next, row after row: set every point.
    pub fn grid(&mut self) -> &mut [Lane] {
        &mut self.grid
    }

    /// The spectrum of the real channels in [`grid`](Fourier::grid), of which only `rows` are not zero. The grid is
    /// used up.
    pub fn forward(&mut self, rows: Range<usize>, spectrum: &mut Spectrum) {
        super::wide(
            #[inline(always)]
            || {
                self.rows(rows);
                self.columns();
                self.unpack(spectrum);
            },
        );
    }

    #[inline(always)]
    fn unpack(&self, spectrum: &mut Spectrum) {
        let (n, half) = (self.n, self.half());
        spectrum.resize(n * half, Bin::ZERO);
        for ky in 0..n {
            for kx in 0..half {
                let z = &self.grid[ky * n + kx];
                let w = &self.grid[(n - ky) % n * n + (n - kx) % n];
                let bin = &mut spectrum[ky * half + kx];
                for l in 0..LANES {
                    bin.re[l] = 0.5 * (z.re[l] + w.re[l]);
                    bin.im[l] = 0.5 * (z.im[l] - w.im[l]);
                    bin.re[l + LANES] = 0.5 * (z.im[l] + w.im[l]);
                    bin.im[l + LANES] = 0.5 * (w.re[l] - z.re[l]);
                }
            }
        }
    }

    /// The real channels of a spectrum, written to [`grid`](Fourier::grid); right in `rows` only.
    pub fn inverse(&mut self, spectrum: &Spectrum, rows: Range<usize>) {
        super::wide(
            #[inline(always)]
            || {
                self.pack(spectrum);
                self.columns();
                self.rows(rows.clone());
                let scale = 1.0 / (self.n * self.n) as f32;
                for point in &mut self.grid[rows.start * self.n..rows.end * self.n] {
                    let Lane { re, im } = *point;
                    // The transform was that of the numbers with their parts exchanged.
                    *point = Lane { re: im.map(|v| v * scale), im: re.map(|v| v * scale) };
                }
            },
        );
    }

    /// The sixteen complex channels of a spectrum with their parts exchanged: the transform of that is the inverse.
    #[inline(always)]
    fn pack(&mut self, spectrum: &Spectrum) {
        let (n, half) = (self.n, self.half());
        for ky in 0..n {
            for kx in 0..n {
                let point = &mut self.grid[ky * n + kx];
                if kx < half {
                    let bin = &spectrum[ky * half + kx];
                    for l in 0..LANES {
                        point.im[l] = bin.re[l] - bin.im[l + LANES];
                        point.re[l] = bin.im[l] + bin.re[l + LANES];
                    }
                } else {
                    let bin = &spectrum[(n - ky) % n * half + n - kx];
                    for l in 0..LANES {
                        point.im[l] = bin.re[l] + bin.im[l + LANES];
                        point.re[l] = bin.re[l + LANES] - bin.im[l];
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(i: usize) -> f32 {
        let mut draws = zerre::rng::Stream::new(7).draws(zerre::rng::Purpose::Propose, 0, i as u32);
        draws.uniform() as f32 - 0.5
    }

    /// The sum as it is defined, in double precision; rounding of n^2 single additions is some 1e-6 of their size.
    #[test]
    fn transforms_are_the_sums_of_the_definition() {
        for n in [8, 15, 20, 40] {
            let mut fourier = Fourier::new(n);
            let rows = 2..n - 3;
            let value = |y: usize, x: usize, c: usize| {
                if rows.contains(&y) { noise((y * n + x) * CHANNELS + c) } else { 0.0 }
            };
            for y in 0..n {
                for x in 0..n {
                    let point = &mut fourier.grid()[y * n + x];
                    for l in 0..LANES {
                        point.re[l] = value(y, x, l);
                        point.im[l] = value(y, x, l + LANES);
                    }
                }
            }
            let mut spectrum = Spectrum::new();
            fourier.forward(rows.clone(), &mut spectrum);
            for (ky, kx, c) in [(0, 0, 3), (1, 2, 0), (n - 1, n / 2, 20), (n / 2, 1, 31)] {
                let mut sum = [0.0; 2];
                for y in 0..n {
                    for x in 0..n {
                        let (sin, cos) = (-TAU * ((ky * y + kx * x) % n) as f64 / n as f64).sin_cos();
                        sum[0] += cos * f64::from(value(y, x, c));
                        sum[1] += sin * f64::from(value(y, x, c));
                    }
                }
                let bin = &spectrum[ky * fourier.half() + kx];
                let error = (f64::from(bin.re[c]) - sum[0]).abs() + (f64::from(bin.im[c]) - sum[1]).abs();
                assert!(error < 1e-5 * n as f64, "{n}: {error}");
            }
            fourier.inverse(&spectrum, 1..n);
            for y in 1..n {
                for x in 0..n {
                    let point = &fourier.grid()[y * n + x];
                    for l in 0..LANES {
                        assert!((point.re[l] - value(y, x, l)).abs() < 1e-5);
                        assert!((point.im[l] - value(y, x, l + LANES)).abs() < 1e-5);
                    }
                }
            }
        }
    }
}
