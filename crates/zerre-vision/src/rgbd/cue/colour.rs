//! The hand by its colours: how much more often a colour is the hand's than something else's (Swain and Ballard,
//! International Journal of Computer Vision 7, 1991), summed over discs of a palm's size, refined by the mean shift.

use super::{BINS, PALM, Search, View, Window, is_before_room};
use crate::operator::Integral;
use crate::rgbd::{NO_DEPTH, Reading};
use crate::{Frame, Image};

/// Share of a new frame in what is known of the colours.
const RATE: f32 = 0.04;
/// Share of what was known at the start that stays.
const ANCHOR: f32 = 0.3;
/// Least share of a bin: what has never been seen says nothing.
const UNSEEN: f32 = 1e-4;
/// Response of a disc below which it is no candidate.
const FAINT: f64 = 0.25;
/// Radius of the mean shift's disc, in radii of a palm: larger ones lean to the fingers.
const SHIFT: f64 = 1.15;
/// A frame outside the window is counted in this raster.
const RASTER: usize = 7;

/// The colours of a hand and of everything else, under the light of the empty room.
#[derive(Clone, Debug, Default)]
pub struct HandColours {
    /// Shares of the bins: in the hand, and elsewhere.
    shares: [Vec<f32>; 2],
    first: [Vec<f32>; 2],
    /// Of each bin, the probability that a pixel of it is the hand's where both are as likely.
    odds: Vec<f32>,
}

impl HandColours {
    /// Whether anything has been learnt.
    pub fn is_empty(&self) -> bool {
        self.odds.is_empty()
    }

    /// The probability that the pixel at a place is the hand's, by its colour, where both are as likely.
    pub(super) fn odds_at(&self, view: &View<'_>, at: [f32; 2]) -> f64 {
        let pixel = view.colour.at(at[0] as isize, at[1] as isize);
        let odds = self.odds.get(view.light.bin(pixel));
        odds.map_or(0.0, |odds| f64::from(*odds))
    }

    /// Learns from a frame with the hand's middle at a place, `radius` pixels large; `depth` is the hand's, where known. The
    /// disc has pixels of other things: those of the room and of another depth are not counted as the hand's.
    pub fn learn(&mut self, view: &View<'_>, at: [f64; 2], radius: f64, depth: Option<f64>) {
        let frame = view.colour;
        let mut counts = [vec![0.0_f32; BINS.pow(3)], vec![0.0_f32; BINS.pow(3)]];
        let (inner, outer) = ((0.8 * radius).powi(2), (2.5 * radius).powi(2));
        let reach = 6.0 * radius;
        let near = |middle: f64, count: usize| {
            let first = (middle - reach).max(0.0) as usize;
            first.min(count)..((middle + reach).max(0.0) as usize).min(count)
        };
        let (columns, rows) = (near(at[0], frame.width()), near(at[1], frame.height()));
        for y in 0..frame.height() {
            let row = frame.row(y);
            let here = if rows.contains(&y) { columns.clone() } else { 0..0 };
            if y % RASTER == 0 {
                for x in (0..row.len()).step_by(RASTER).filter(|x| !here.contains(x)) {
                    counts[1][view.light.bin(row[x])] += 1.0;
                }
            }
            let dy = y as f64 + 0.5 - at[1];
            for x in here {
                let dx = x as f64 + 0.5 - at[0];
                let distance = dx * dx + dy * dy;
                if distance < inner {
                    let i = y * frame.width() + x;
                    let there = view.depth.pixels()[i];
                    let fits = depth.is_none_or(|z| there == NO_DEPTH || (f64::from(there) - z).abs() < 80.0);
                    if fits && is_before_room(view, i) {
                        counts[0][view.light.bin(row[x])] += 1.0;
                    }
                } else if distance > outer {
                    counts[1][view.light.bin(row[x])] += 1.0;
                }
            }
        }
        let sums = [0, 1].map(|k| counts[k].iter().sum::<f32>());
        if sums[0] < 20.0 || sums[1] < 20.0 {
            return;
        }
        for (count, sum) in counts.iter_mut().zip(sums) {
            count.iter_mut().for_each(|v| *v /= sum);
        }
        if self.odds.is_empty() {
            self.odds = vec![0.0; BINS.pow(3)];
            self.first = counts.clone();
            self.shares = counts;
        } else {
            for (known, new) in self.shares.iter_mut().zip(&counts) {
                known.iter_mut().zip(new).for_each(|(known, new)| *known += RATE * (new - *known));
            }
        }
        for (i, odds) in self.odds.iter_mut().enumerate() {
            let mixed = |k: usize| self.shares[k][i] + ANCHOR * (self.first[k][i] - self.shares[k][i]);
            let (hand, rest) = (mixed(0), mixed(1));
            *odds = if hand < UNSEEN { 0.0 } else { hand / (hand + rest + UNSEEN) };
        }
    }
}

/// The cue, and the memory that it uses again.
#[derive(Clone, Debug)]
pub struct ColourCue {
    /// The colours of the hand.
    pub colours: HandColours,
    /// Of the last window, how much of a hand each pixel is.
    share: Image<f32>,
}

impl Default for ColourCue {
    fn default() -> ColourCue {
        ColourCue { colours: HandColours::default(), share: Image::filled(1, 1, 0.0) }
    }
}

impl ColourCue {
    /// Where the hand may be, the most likely first, so many at most.
    pub fn candidates(&mut self, view: &View<'_>, search: &Search, most: usize) -> Vec<Reading> {
        if self.colours.is_empty() {
            return Vec::new();
        }
        let window = search.window(view.colour.size());
        let step = search.step.max(1);
        let share = self.weigh(view, search, window);
        let radius = radius(view, search) / step as f64;
        let found = peaks(&share, radius, most);
        let readings = found.into_iter().map(|(at, strength)| {
            let at = shift(&share, at, SHIFT * radius);
            let depth_mm = search.depth.and_then(|_| depth_about(view, &share, (window, step), at, radius));
            let place = [0, 1].map(|k| window[k] as f64 + step as f64 * at[k]);
            Reading { at: place, depth_mm, confidence: strength.clamp(0.0, 1.0) }
        });
        let readings = apart(readings.collect(), radius * step as f64);
        self.share = share;
        readings
    }

    /// What the last search made of its window, from black to white, for people to look at.
    pub fn picture(&self) -> Frame {
        self.share.map(|v| [(255.0 * v) as u8; 3])
    }

    /// How much of a hand each pixel of the window is: by its colour, if it is before the room and not of another depth.
    fn weigh(&mut self, view: &View<'_>, search: &Search, window: Window) -> Image<f32> {
        let [left, top, columns, rows] = window;
        let (step, width) = (search.step.max(1), view.colour.width());
        let depth = view.depth.pixels();
        let (odds, pixels) = (&self.colours.odds, view.colour.pixels());
        Image::from_fn(columns.div_ceil(step), rows.div_ceil(step), |x, y| {
            let i = (top + step * y) * width + left + step * x;
            let odds = odds[view.light.bin(pixels[i])];
            if odds < 0.1 || !is_before_room(view, i) {
                return 0.0;
            }
            match search.depth {
                Some([mean, sd]) if depth[i] != NO_DEPTH => {
                    let off = (f64::from(depth[i]) - mean).abs();
                    if off < 120.0 + 3.0 * sd { odds } else { 0.0 }
                }
                _ => odds,
            }
        })
    }
}

/// Radius of a palm in pixels, at the depth that it should have or that of a person two metres away.
pub(super) fn radius(view: &View<'_>, search: &Search) -> f64 {
    let depth = search.depth.map_or(2000.0, |[mean, _]| mean.max(300.0));
    (PALM * view.lens.focal[0] / depth).clamp(3.0, search.side as f64 / 4.0)
}

/// Places where a disc is full and its surroundings are not so, the best first.
fn peaks(share: &Image<f32>, radius: f64, most: usize) -> Vec<([f64; 2], f64)> {
    let sums = Integral::of(share, |&v| f64::from(v));
    // A square of a disc's area, and one of twice its side about it.
    let inner = (1.77 * radius).round().max(1.0) as usize;
    let outer = 2 * inner;
    let (n, m) = ((inner * inner) as f64, (outer * outer) as f64);
    let response = |x: usize, y: usize| {
        let sum = |side: usize| {
            let first = |v: usize| v as isize - (side / 2) as isize;
            sums.sum(first(x), first(y), side, side)
        };
        let near = sum(inner);
        // What is around can only take from it.
        if near <= FAINT * n { 0.0 } else { near / n - 0.4 * (sum(outer) - near) / (m - n) }
    };
    let step = ((radius / 4.0) as usize).max(1);
    let mut found: Vec<([f64; 2], f64)> = Vec::new();
    for y in (0..share.height()).step_by(step) {
        for x in (0..share.width()).step_by(step) {
            let value = response(x, y);
            if value > FAINT {
                found.push(([x as f64 + 0.5, y as f64 + 0.5], value));
            }
        }
    }
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut kept: Vec<([f64; 2], f64)> = Vec::new();
    for (at, value) in found {
        if kept.iter().all(|(other, _)| (other[0] - at[0]).hypot(other[1] - at[1]) > 1.5 * radius) {
            kept.push((at, value));
        }
        if kept.len() == most {
            break;
        }
    }
    kept
}

/// The mean shift: the middle of what is in a disc, until it stays (Fukunaga and Hostetler 1975).
fn shift(share: &Image<f32>, mut at: [f64; 2], radius: f64) -> [f64; 2] {
    for _ in 0..10 {
        let (mut sum, mut mean) = (0.0, [0.0; 2]);
        let rows = |v: f64, count: usize| {
            ((v - radius).max(0.0) as usize, ((v + radius).max(0.0) as usize + 1).min(count))
        };
        let (top, bottom) = rows(at[1], share.height());
        let (left, right) = rows(at[0], share.width());
        for y in top..bottom {
            let dy = y as f64 + 0.5 - at[1];
            for x in left..right {
                let dx = x as f64 + 0.5 - at[0];
                let inside = 1.0 - (dx * dx + dy * dy) / (radius * radius);
                if inside > 0.0 {
                    let weight = f64::from(share.row(y)[x]);
                    sum += weight;
                    mean[0] += weight * dx;
                    mean[1] += weight * dy;
                }
            }
        }
        if sum <= 0.0 {
            return at;
        }
        let moved = mean.map(|v| v / sum);
        at = [at[0] + moved[0], at[1] + moved[1]];
        if moved[0].hypot(moved[1]) < 0.05 {
            break;
        }
    }
    at
}

/// The median depth of a disc's pixels that look like a hand.
fn depth_about(
    view: &View<'_>,
    share: &Image<f32>,
    (window, step): (Window, usize),
    at: [f64; 2],
    radius: f64,
) -> Option<f64> {
    let mut depths = Vec::new();
    for y in 0..share.height() {
        let dy = y as f64 + 0.5 - at[1];
        if dy.abs() > radius {
            continue;
        }
        let depth = view.depth.row(window[1] + step * y)[window[0]..].iter().step_by(step);
        for (x, (&odds, &z)) in share.row(y).iter().zip(depth).enumerate() {
            let dx = x as f64 + 0.5 - at[0];
            if odds > 0.3 && z != NO_DEPTH && dx * dx + dy * dy < radius * radius {
                depths.push(z);
            }
        }
    }
    let middle = depths.len() / 2;
    (depths.len() >= 5).then(|| f64::from(*depths.select_nth_unstable(middle).1))
}

/// Readings that the mean shift has brought to one place are one.
fn apart(all: Vec<Reading>, radius: f64) -> Vec<Reading> {
    let mut kept: Vec<Reading> = Vec::new();
    for reading in all {
        let far =
            |other: &Reading| (other.at[0] - reading.at[0]).hypot(other.at[1] - reading.at[1]) > 0.5 * radius;
        if kept.iter().all(far) {
            kept.push(reading);
        }
    }
    kept
}
