//! What a correlation filter sees of a picture: gradients and colours in cells of four pixels.

use super::fourier::CHANNELS;
use crate::{Frame, Rect};
use std::f64::consts::PI;
use zerre::math::Real;

/// Pixels of a cell's side.
pub const CELL: usize = 4;
/// Directions of gradients, of a full turn.
const DIRECTIONS: usize = 18;
/// Directions without their sign.
const AXES: usize = DIRECTIONS / 2;
/// First of the colour channels.
const COLOURS: usize = 29;
/// Where histograms are cut after they are normalised (Felzenszwalb et al. 2010, section 6.2).
const CUT: f32 = 0.2;

/// Weight of the colours beside the gradients.
const COLOUR_GAIN: f32 = 2.0;

/// Channels of a cell: 18 directions, 9 axes, two textures, three colours.
pub type Cell = [f32; CHANNELS];

/// Weights of the pixels of a picture's row or column in those of a resized one.
#[derive(Default)]
struct Taps {
    /// Pixels that each takes from.
    length: usize,
    index: Vec<u32>,
    weight: Vec<f32>,
}

impl Taps {
    /// For `count` pixels that cover `from` to `from + extent` of a side with `side` pixels: triangles, as wide as an
    /// output pixel where the picture shrinks and as an input pixel where it grows; beyond the border, its pixels go on.
    fn fill(&mut self, from: f64, extent: f64, count: usize, side: usize) {
        let step = extent / count as f64;
        let reach = step.max(1.0);
        self.length = 2 * reach.ceil() as usize + 1;
        self.index.clear();
        self.weight.clear();
        for i in 0..count {
            let centre = from + (i as f64 + 0.5) * step - 0.5;
            let first = (centre - reach).ceil();
            let start = self.weight.len();
            let mut sum = 0.0;
            for k in 0..self.length {
                let at = first + k as f64;
                let weight = (1.0 - (at - centre).abs() / reach).max(0.0);
                sum += weight;
                self.index.push(at.clamp(0.0, side as f64 - 1.0) as u32);
                self.weight.push(weight as f32);
            }
            for weight in &mut self.weight[start..] {
                *weight /= sum as f32;
            }
        }
    }

    fn of(&self, i: usize) -> impl Iterator<Item = (usize, f32)> {
        let places = &self.index[i * self.length..][..self.length];
        let weights = &self.weight[i * self.length..][..self.length];
        places.iter().zip(weights).filter(|(_, w)| **w > 0.0).map(|(i, w)| (*i as usize, *w))
    }
}

/// Cuts windows out of frames and describes them; holds the memory for it.
#[derive(Default)]
pub struct Features {
    across: Taps,
    down: Taps,
    sum: Vec<f32>,
    /// Grey values of the window, row after row, from 0 to 255.
    grey: Vec<f32>,
    colour: Vec<[f32; 3]>,
    magnitude: Vec<f32>,
    direction: Vec<i32>,
    cells: Vec<[f32; DIRECTIONS]>,
    energy: Vec<f32>,
}

impl Features {
    /// Sums the rows that the output row `y` takes from, over the columns from `left` to `right`.
    #[inline(always)]
    fn gather_row(&mut self, frame: &Frame, y: usize, (left, right): (usize, usize)) {
        self.sum.clear();
        self.sum.resize((right - left) * 3, 0.0);
        for (row, weight) in self.down.of(y) {
            let bytes = frame.row(row)[left..right].as_flattened();
            for (sum, byte) in self.sum.iter_mut().zip(bytes) {
                *sum += weight * f32::from(*byte);
            }
        }
    }

    fn prepare(&mut self, frame: &Frame, window: Rect, (columns, rows): (usize, usize)) -> (usize, usize) {
        self.across.fill(window.x, window.width, columns, frame.width());
        self.down.fill(window.y, window.height, rows, frame.height());
        let left = self.across.index.iter().min().map_or(0, |i| *i as usize);
        let right = self.across.index.iter().max().map_or(0, |i| *i as usize + 1);
        (left, right)
    }

    /// Fills `grey` with the window, resized.
    #[inline(always)]
    fn cut_grey(&mut self, frame: &Frame, window: Rect, size: (usize, usize)) {
        let span = self.prepare(frame, window, size);
        self.grey.clear();
        let mut line: Vec<f32> = Vec::with_capacity(span.1 - span.0);
        for y in 0..size.1 {
            self.gather_row(frame, y, span);
            line.clear();
            line.extend(self.sum.chunks_exact(3).map(|c| 0.299 * c[0] + 0.587 * c[1] + 0.114 * c[2]));
            for x in 0..size.0 {
                let at = x * self.across.length;
                let mut sum = 0.0;
                for k in at..at + self.across.length {
                    sum += self.across.weight[k] * line[self.across.index[k] as usize - span.0];
                }
                self.grey.push(sum);
            }
        }
    }

    /// The colours of the window, resized: red, green and blue, from 0 to 255.
    pub fn colours(&mut self, frame: &Frame, window: Rect, size: (usize, usize)) -> &[[f32; 3]] {
        super::wide(
            #[inline(always)]
            || {
                let span = self.prepare(frame, window, size);
                self.colour.clear();
                for y in 0..size.1 {
                    self.gather_row(frame, y, span);
                    for x in 0..size.0 {
                        let at = x * self.across.length;
                        let mut sum = [0.0; 3];
                        for k in at..at + self.across.length {
                            let from = &self.sum[3 * (self.across.index[k] as usize - span.0)..][..3];
                            for c in 0..3 {
                                sum[c] += self.across.weight[k] * from[c];
                            }
                        }
                        self.colour.push(sum);
                    }
                }
            },
        );
        &self.colour
    }

    /// Writes the cells of the window, row after row: `columns` x `rows` of them. Without colours those channels are
    /// zero.
    pub fn describe(
        &mut self,
        frame: &Frame,
        window: Rect,
        (columns, rows): (usize, usize),
        coloured: bool,
        out: &mut Vec<Cell>,
    ) {
        super::wide(
            #[inline(always)]
            || {
                self.cut_grey(frame, window, (columns * CELL, rows * CELL));
                self.gradients(columns * CELL, rows * CELL);
                self.histograms(columns, rows);
                self.normalise(columns, rows, out);
            },
        );
        if coloured {
            self.colours(frame, window, (columns, rows));
            for (cell, [r, g, b]) in out.iter_mut().zip(&self.colour) {
                cell[COLOURS] = COLOUR_GAIN * ((r + g + b) / 765.0 - 0.5);
                cell[COLOURS + 1] = COLOUR_GAIN * (r - g) / 255.0;
                cell[COLOURS + 2] = COLOUR_GAIN * (r + g - 2.0 * b) / 510.0;
            }
        }
    }

    /// Size of the gradient of every pixel, and the nearest of the directions.
    #[inline(always)]
    fn gradients(&mut self, width: usize, height: usize) {
        let units: [[f32; 2]; AXES] = std::array::from_fn(|k| {
            let (sin, cos) = Real::sin_cos(PI * k as f64 / AXES as f64);
            [cos as f32, sin as f32]
        });
        self.magnitude.resize(width * height, 0.0);
        self.direction.resize(width * height, 0);
        let mut dx = vec![0.0_f32; width];
        for y in 0..height {
            let row = &self.grey[y * width..][..width];
            let above = &self.grey[y.saturating_sub(1) * width..][..width];
            let below = &self.grey[(y + 1).min(height - 1) * width..][..width];
            for x in 1..width - 1 {
                dx[x] = row[x + 1] - row[x - 1];
            }
            dx[0] = row[1] - row[0];
            dx[width - 1] = row[width - 1] - row[width - 2];
            let magnitude = &mut self.magnitude[y * width..][..width];
            let direction = &mut self.direction[y * width..][..width];
            for x in 0..width {
                let (gx, gy) = (dx[x], below[x] - above[x]);
                let (mut best, mut at) = (0.0_f32, 0);
                for (k, [cos, sin]) in (0_i32..).zip(&units) {
                    let dot = gx * cos + gy * sin;
                    at = if dot > best { k } else { at };
                    best = if dot > best { dot } else { best };
                    at = if -dot > best { k + AXES as i32 } else { at };
                    best = if -dot > best { -dot } else { best };
                }
                magnitude[x] = (gx * gx + gy * gy).sqrt();
                direction[x] = at;
            }
        }
    }

    /// Shares every gradient between the four nearest cells.
    #[inline(always)]
    fn histograms(&mut self, columns: usize, rows: usize) {
        let width = columns * CELL;
        // A border of one cell takes what falls beyond.
        let wide = columns + 2;
        self.cells.clear();
        self.cells.resize(wide * (rows + 2), [0.0; DIRECTIONS]);
        for y in 0..rows * CELL {
            let (cy, fy) = place(y);
            for x in 0..width {
                let (cx, fx) = place(x);
                let (m, d) = (self.magnitude[y * width + x], self.direction[y * width + x] as usize);
                let at = cy * wide + cx;
                let (up, down) = (m * (1.0 - fy), m * fy);
                self.cells[at][d] += up * (1.0 - fx);
                self.cells[at + 1][d] += up * fx;
                self.cells[at + wide][d] += down * (1.0 - fx);
                self.cells[at + wide + 1][d] += down * fx;
            }
        }
    }

    /// Each cell beside the energies of the four blocks that it is in.
    #[inline(always)]
    fn normalise(&mut self, columns: usize, rows: usize, out: &mut Vec<Cell>) {
        let wide = columns + 2;
        self.energy.clear();
        self.energy.extend(self.cells.iter().map(|h| {
            let mut sum = 0.0;
            for k in 0..AXES {
                let both = h[k] + h[k + AXES];
                sum += both * both;
            }
            sum
        }));
        out.clear();
        for y in 0..rows {
            for x in 0..columns {
                let at = (y + 1) * wide + x + 1;
                let h = &self.cells[at];
                // Blocks beyond the border take the cells at it.
                let near = |dx: isize, dy: isize| {
                    let cx = (x as isize + dx).clamp(0, columns as isize - 1) as usize + 1;
                    let cy = (y as isize + dy).clamp(0, rows as isize - 1) as usize + 1;
                    self.energy[cy * wide + cx]
                };
                let own = self.energy[at];
                let block = |dx: isize, dy: isize| {
                    1.0 / (own + near(dx, 0) + near(0, dy) + near(dx, dy) + 1e-2).sqrt()
                };
                let blocks = [block(-1, -1), block(1, -1), block(-1, 1), block(1, 1)];
                let mut cell = [0.0_f32; CHANNELS];
                let mut texture = [0.0_f32; 4];
                for (norm, texture) in blocks.into_iter().zip(&mut texture) {
                    for k in 0..DIRECTIONS {
                        let value = (h[k] * norm).min(CUT);
                        cell[k] += 0.5 * value;
                        *texture += value;
                    }
                    for k in 0..AXES {
                        cell[DIRECTIONS + k] += 0.5 * ((h[k] + h[k + AXES]) * norm).min(CUT);
                    }
                }
                cell[27] = 0.2357 * 0.5 * (texture[0] + texture[3]);
                cell[28] = 0.2357 * 0.5 * (texture[1] + texture[2]);
                out.push(cell);
            }
        }
    }
}

/// The first cell (of a grid with a border of one) that a pixel is shared with, and the share of the next one.
#[inline(always)]
fn place(pixel: usize) -> (usize, f32) {
    let at = (pixel as f32 + 0.5) / CELL as f32 + 0.5;
    let cell = at as usize;
    (cell, at - cell as f32)
}
