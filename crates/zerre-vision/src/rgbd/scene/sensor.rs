//! What cameras make of what they see: noise, levels, and what they do not see at all.

use super::settings::{ColourSettings, DepthSettings};
use crate::rgbd::{Depth, NO_DEPTH};
use crate::{Frame, Image};
use zerre::rng::{Draws, Purpose, Stream};

/// Normal numbers that are drawn once; every row of every picture reads them from a place of its own.
#[derive(Clone, Debug)]
pub(super) struct Noise {
    numbers: Vec<f32>,
    stream: Stream,
}

const NUMBERS: usize = 1 << 17;

/// What the rows of a picture are random for.
#[derive(Clone, Copy)]
pub(super) enum Kind {
    Colour = 0,
    Depth = 1,
    Raw = 2,
}

impl Noise {
    /// For pictures of up to this width.
    pub(super) fn new(stream: Stream, width: usize) -> Noise {
        let mut draws = stream.draws(Purpose::Measurement, u64::MAX, 0);
        let mut numbers: Vec<f32> = (0..NUMBERS).map(|_| draws.normal() as f32).collect();
        numbers.extend_from_within(..3 * width);
        Noise { numbers, stream }
    }

    fn draws(&self, kind: Kind, step: u64) -> Draws {
        self.stream.draws(Purpose::Measurement, step, 1 + kind as u32)
    }

    fn row(&self, draws: &mut Draws, count: usize) -> &[f32] {
        let first = draws.next_u32() as usize % NUMBERS;
        &self.numbers[first..first + count]
    }

    /// The picture of a camera; `gain` is the light.
    pub(super) fn colour(
        &self,
        mut seen: Vec<[f32; 3]>,
        (width, height): (usize, usize),
        gain: f64,
        settings: &ColourSettings,
        step: u64,
    ) -> Frame {
        for _ in 0..settings.blur {
            blur(seen.as_flattened_mut(), 3 * width);
        }
        let mut draws = self.draws(Kind::Colour, step);
        let (gain, sd) = (gain as f32, settings.noise as f32);
        let mut frame = Image::filled(width, height, [0; 3]);
        for y in 0..height {
            let noise = self.row(&mut draws, 3 * width);
            let levels = seen[y * width..][..width].as_flattened();
            for ((out, level), noise) in frame.row_mut(y).as_flattened_mut().iter_mut().zip(levels).zip(noise)
            {
                *out = (gain * level + sd * noise + 0.5) as u8;
            }
        }
        frame
    }

    /// The picture of a depth camera with a focal length (pixels) that sees these distances, mm.
    pub(super) fn depth(
        &self,
        exact: &[f32],
        (width, height): (usize, usize),
        focal: f64,
        settings: &DepthSettings,
        (kind, step): (Kind, u64),
    ) -> Depth {
        let mut draws = self.draws(kind, step);
        let mut depth = Image::filled(width, height, NO_DEPTH);
        if draws.uniform() < settings.loss {
            return depth;
        }
        let (sd, unit) = (settings.noise as f32, settings.step as f32);
        let far = settings.far_mm.min(65_534.0) as f32;
        for y in 0..height {
            let noise = self.row(&mut draws, width);
            let measured = exact[y * width..][..width].iter().zip(noise);
            for (out, (z, noise)) in depth.row_mut(y).iter_mut().zip(measured) {
                let mut noisy = z + sd * z * z * noise;
                if unit > 0.0 {
                    // Levels of 1 / z are equally far apart.
                    noisy = 1.0 / (unit * ((1.0 / (unit * noisy) + 0.5) as i32).max(1) as f32);
                }
                *out = if *z <= far { (noisy + 0.5).max(1.0) as u16 } else { NO_DEPTH };
            }
        }
        let pixels = depth.pixels_mut();
        if settings.baseline_mm > 0.0 {
            shadow(exact, pixels, width, (focal * settings.baseline_mm) as f32);
        }
        if settings.edge_holes > 0.0 {
            let below = (settings.edge_holes * f64::from(u32::MAX)) as u32;
            edges(exact, pixels, width, |_| draws.next_u32() < below);
        }
        for _ in 0..(settings.speckle * (width * height) as f64).round() as usize {
            let at = draws.next_u32() as usize % (width * height);
            pixels[at] = NO_DEPTH;
        }
        for _ in 0..(settings.spots + draws.uniform()).floor() as usize {
            let scale = width as f64 / 640.0;
            let radius = scale * (2.0 + 7.0 * draws.uniform());
            let (x, y) = (width as f64 * draws.uniform(), height as f64 * draws.uniform());
            let range = |middle: f64, most: usize| {
                (middle - radius).max(0.0) as usize..((middle + radius).ceil() as usize).min(most)
            };
            for row in range(y, height) {
                for column in range(x, width) {
                    let (u, v) = (column as f64 + 0.5 - x, row as f64 + 0.5 - y);
                    if u * u + v * v < radius * radius {
                        pixels[row * width + column] = NO_DEPTH;
                    }
                }
            }
        }
        depth
    }
}

/// No depth where nearer things to the right keep the projector's light away: its rays meet them first.
fn shadow(exact: &[f32], depth: &mut [u16], width: usize, parallax: f32) {
    for (exact, depth) in exact.chunks_exact(width).zip(depth.chunks_exact_mut(width)) {
        let mut least = f32::INFINITY;
        for x in (0..width).rev() {
            // Where the projector has this point in its own picture.
            let place = x as f32 - parallax / exact[x];
            if place > least + 0.5 {
                depth[x] = NO_DEPTH;
            }
            least = least.min(place);
        }
    }
}

/// Holes on both sides of steps in depth.
fn edges(exact: &[f32], depth: &mut [u16], width: usize, mut hole: impl FnMut(usize) -> bool) {
    let count = depth.len();
    let mut step = |at: usize, next: usize| {
        if (exact[at] - exact[next]).abs() > 0.015 * exact[at] {
            for pixel in [at, next] {
                if hole(pixel) {
                    depth[pixel] = NO_DEPTH;
                }
            }
        }
    };
    for at in 0..count {
        if (at + 1) % width != 0 {
            step(at, at + 1);
        }
        if at + width < count {
            step(at, at + width);
        }
    }
}

/// Every level averaged with its neighbours: 1, 2, 1 across and down. `width` counts levels.
fn blur(levels: &mut [f32], width: usize) {
    let mut before = vec![0.0; width];
    for row in levels.chunks_exact_mut(width) {
        before.copy_from_slice(row);
        for x in 3..width.saturating_sub(3) {
            row[x] = 0.5 * before[x] + 0.25 * (before[x - 3] + before[x + 3]);
        }
    }
    let rows = levels.len() / width;
    before.copy_from_slice(&levels[..width]);
    let mut own = vec![0.0; width];
    for y in 1..rows.saturating_sub(1) {
        let (above, below) = levels.split_at_mut((y + 1) * width);
        let row = &mut above[y * width..];
        own.copy_from_slice(row);
        for x in 0..width {
            row[x] = 0.5 * own[x] + 0.25 * (before[x] + below[x]);
        }
        std::mem::swap(&mut before, &mut own);
    }
}
