//! What differs from the ground: difference, threshold, connected parts, their areas and centroids.

use super::ground::{Ground, GroundFrom};
use crate::operator::{Element, Neighbours, and, dilate, erode, fill_holes, otsu};
use crate::{Error, Frame, Image, Result};
use std::f64::consts::PI;
use std::ops::Range;

/// How balls are told from the ground.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectorSettings {
    /// The ground.
    pub ground: GroundFrom,
    /// A pixel is set where a channel differs from the ground by more than this; Otsu's level of the differences in
    /// the samples by default, which keeps shadows out where balls stand out more than their shadows.
    pub level: Option<u8>,
    /// Least pixels of a part. By default an eighth of a typical ball in the samples, the area that half of what is
    /// seen whole belongs to parts of at least: slivers of rims and gaps between shadows are smaller.
    pub least_area: Option<usize>,
    /// Most pixels of a part; a quarter of the ground by default.
    pub most_area: Option<usize>,
}

impl Default for DetectorSettings {
    fn default() -> Self {
        DetectorSettings { ground: GroundFrom::Plain, level: None, least_area: None, most_area: None }
    }
}

/// Levels below this are noise of cameras and of codecs, whatever Otsu says: there may be no ball in the samples.
const LEAST_LEVEL: u8 = 16;
/// Least pixels of a part before a typical ball is known, and as a share of it.
const LEAST_PIXELS: usize = 12;
const LEAST_SHARE: f64 = 0.125;
/// Most pixels of a part, as a share of the ground.
const MOST_SHARE: f64 = 0.25;

/// A rim that deviates from a circle by more than this share of its radius is not that of one ball.
pub(super) const ROUND: f64 = 0.2;
/// Channels whose shares of the ground's light differ by less than this are those of a shadow or of a grey ball.
/// A shadow leaves more light than so many times what the darkest pixels of typical parts keep, this share of
/// their pixels; these count as keeping no less than a least share.
const GREY: f64 = 0.12;
const LIGHTER: f64 = 3.0;
const DARKEST: f64 = 0.05;
const LEAST_LIGHT: f64 = 0.03;
/// Rims of shiny balls are grey as well: what is this near to what is surely a ball belongs to it, in radii of a
/// typical part.
const RIM: f64 = 0.3;

/// What of a part is shadow.
#[derive(Clone, Debug, PartialEq)]
struct Shadow {
    /// The least share of the ground's light that is left in it.
    light: f64,
    /// Pixels that are sure only in smaller groups than this are noise.
    grain: Element,
    /// How far a ball goes beyond what is sure.
    rim: Element,
}

/// Finds what is not ground in frames of one size.
#[derive(Clone, Debug, PartialEq)]
pub struct Detector {
    ground: Ground,
    level: u8,
    least: usize,
    most: usize,
    /// Half of the pixels of parts that the samples show whole belong to parts of at least this area.
    typical: usize,
    /// Where balls are darker than shadows can be.
    shadow: Option<Shadow>,
}

/// A connected part that differs from the ground, its holes filled.
#[derive(Clone, Debug, PartialEq)]
pub struct Blob {
    /// Pixels.
    pub area: usize,
    /// Mean of the pixels' centres.
    pub centroid: [f64; 2],
    /// Mean colour, red, green and blue.
    pub colour: [f64; 3],
    /// Whether it goes on beyond the border of the picture or of the ground.
    pub clipped: bool,
    /// Column and row of the first pixel of `mask`.
    pub corner: [usize; 2],
    /// The part in a frame of one unset pixel.
    pub mask: Image<u8>,
    /// Sides beyond which the picture or the ground ends: left, top, right, bottom.
    pub borders: [bool; 4],
}

/// What a frame shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Seen {
    /// Parts by their first pixels, row after row.
    pub blobs: Vec<Blob>,
    /// Parts that were too large.
    pub too_large: usize,
}

/// Pixels at a look: most of a picture is ground.
const TOGETHER: usize = 16;

/// Pixels of a row that belong together: from `start` to before `end`.
#[derive(Clone, Copy, Debug)]
struct Run {
    y: usize,
    start: usize,
    end: usize,
    parent: usize,
}

/// Runs of set pixels, row after row, and the trees of those that belong together.
#[derive(Default)]
struct Runs(Vec<Run>);

impl Runs {
    fn root(&mut self, mut at: usize) -> usize {
        while self.0[at].parent != at {
            self.0[at].parent = self.0[self.0[at].parent].parent;
            at = self.0[at].parent;
        }
        at
    }

    /// Adds the runs of `len` pixels of row `y` from column `first` on; chunks that are blank have none. `above`
    /// are those of the row before, and then of this one.
    fn row(
        &mut self,
        (y, first, len): (usize, usize, usize),
        above: &mut Range<usize>,
        is_blank: impl Fn(usize) -> bool,
        is_set: impl Fn(usize) -> bool,
    ) {
        let (begin, mut open) = (self.0.len(), None);
        for (k, start) in (0..len).step_by(TOGETHER).enumerate() {
            if is_blank(k) {
                if let Some(from) = open.take() {
                    self.push((y, first + from, first + start), above);
                }
                continue;
            }
            for x in start..(start + TOGETHER).min(len) {
                match (is_set(x), open) {
                    (true, None) => open = Some(x),
                    (false, Some(from)) => {
                        self.push((y, first + from, first + x), above);
                        open = None;
                    }
                    _ => {}
                }
            }
        }
        if let Some(from) = open {
            self.push((y, first + from, first + len), above);
        }
        *above = begin..self.0.len();
    }

    /// Adds a run; `above` goes through the runs of the row before.
    fn push(&mut self, (y, start, end): (usize, usize, usize), above: &mut Range<usize>) {
        let at = self.0.len();
        self.0.push(Run { y, start, end, parent: at });
        // Neighbours by an edge or a corner.
        while above.start < above.end && self.0[above.start].end < start {
            above.start += 1;
        }
        let mut next = above.start;
        while next < above.end && self.0[next].start <= end {
            let (a, b) = (self.root(next), self.root(at));
            self.0[a.max(b)].parent = a.min(b);
            next += 1;
        }
    }
}

impl Detector {
    /// A detector for videos of which `samples` are some frames, as many as possible at other times.
    ///
    /// # Errors
    /// Those of [`Ground::of`]; limits of the area that leave nothing.
    pub fn new(settings: &DetectorSettings, samples: &[Frame]) -> Result<Detector> {
        let ground = Ground::of(&settings.ground, samples)?;
        let most = settings.most_area.unwrap_or((MOST_SHARE * ground.area() as f64) as usize).max(1);
        let least = settings.least_area.unwrap_or(LEAST_PIXELS.min(most)).max(1);
        if least > most {
            let needs = "it must not be below the least area";
            return Err(Error::OutOfRange { what: "largest area of a ball", value: most as f64, needs });
        }
        let mut detector = Detector { ground, level: 0, least, most, typical: 0, shadow: None };
        detector.level = match settings.level {
            Some(level) => level,
            None => detector.otsu(samples)?.max(LEAST_LEVEL),
        };
        let mut whole = Vec::new();
        for sample in samples {
            let seen = detector.see(sample)?;
            let parts = seen.blobs.iter().filter(|blob| !blob.clipped);
            whole.extend(parts.map(|blob| (blob.area, detector.darkest(sample, blob))));
        }
        let area = typical(&mut whole, |part, other| part.0.cmp(&other.0)).map_or(0, |part| part.0);
        detector.typical = area;
        let by_light = |part: &(usize, f64), other: &(usize, f64)| part.1.total_cmp(&other.1);
        if let Some((_, darkest)) = typical(&mut whole, by_light) {
            let light = LIGHTER * darkest.max(LEAST_LIGHT);
            let rim = 2 * (RIM * (area as f64 / PI).sqrt()).ceil() as usize + 3;
            if light < 1.0 {
                let (grain, rim) = (Element::rectangle(3, 3)?, Element::ellipse(rim, rim)?);
                detector.shadow = Some(Shadow { light, grain, rim });
            }
        }
        if settings.least_area.is_none() {
            detector.least = detector.least.max((LEAST_SHARE * area as f64) as usize);
        }
        Ok(detector)
    }

    /// The share of the ground's light that is left in the darkest pixels of a part.
    fn darkest(&self, frame: &Frame, blob: &Blob) -> f64 {
        // Shares up to two, in steps of a 128th.
        let mut counts = [0_usize; 256];
        let [left, top] = blob.corner;
        let all = |pixel: &[u8; 3]| pixel.iter().map(|level| usize::from(*level)).sum::<usize>();
        for y in top..top + blob.mask.height() - 2 {
            let columns = left..left + blob.mask.width() - 2;
            let pixels = frame.row(y)[columns.clone()].iter().zip(&self.ground.picture().row(y)[columns]);
            for (set, (pixel, empty)) in blob.mask.row(y - top + 1).iter().skip(1).zip(pixels) {
                if *set != 0 {
                    counts[(128 * all(pixel) / all(empty).max(1)).min(255)] += 1;
                }
            }
        }
        let wanted = DARKEST * blob.area as f64;
        let mut below = 0;
        let reaches = |count: &usize| {
            below += count;
            below as f64 > wanted
        };
        counts.iter().position(reaches).map_or(2.0, |at| at as f64 / 128.0)
    }

    /// Otsu's level of the largest difference of a channel, every second row and column of the samples.
    fn otsu(&self, samples: &[Frame]) -> Result<u8> {
        let mut differences = Vec::new();
        for sample in samples {
            for y in (0..sample.height()).step_by(2) {
                let columns = self.ground.columns(y);
                let rows = sample.row(y)[columns.clone()].iter().zip(&self.ground.picture().row(y)[columns]);
                let most = |(a, b): (&[u8; 3], &[u8; 3])| {
                    a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0)
                };
                differences.extend(rows.step_by(2).map(most));
            }
        }
        let count = differences.len();
        Ok(otsu(&Image::new(count, 1, differences)?))
    }

    /// The ground.
    pub fn ground(&self) -> &Ground {
        &self.ground
    }

    /// The level above which a difference counts.
    pub fn level(&self) -> u8 {
        self.level
    }

    /// Least and most pixels of a part.
    pub fn areas(&self) -> (usize, usize) {
        (self.least, self.most)
    }

    /// Pixels of a typical part in the samples; 0 where they show none whole.
    pub fn typical_area(&self) -> usize {
        self.typical
    }

    /// The parts of a frame that differ from the ground.
    ///
    /// # Errors
    /// A frame of another size than the ground.
    pub fn see(&self, frame: &Frame) -> Result<Seen> {
        self.ground.picture().expect_size(frame)?;
        let mut seen = self.parts(frame, self.runs(frame));
        if let Some(shadow) = &self.shadow {
            for blob in std::mem::take(&mut seen.blobs) {
                seen.blobs.extend(self.without_shadow(frame, blob, shadow)?);
            }
        }
        Ok(seen)
    }

    /// What is left of a part without its shadows: pixels as grey as one, and as light, far from all others.
    fn without_shadow(&self, frame: &Frame, blob: Blob, shadow: &Shadow) -> Result<Vec<Blob>> {
        let ([left, top], (width, height)) = (blob.corner, blob.mask.size());
        let mut sure = blob.mask.clone();
        for y in 1..height - 1 {
            let columns = left..left + width - 2;
            let empty = &self.ground.picture().row(top + y - 1)[columns.clone()];
            let pixels = frame.row(top + y - 1)[columns].iter().zip(empty);
            for (set, (pixel, empty)) in sure.row_mut(y)[1..].iter_mut().zip(pixels) {
                if *set != 0 && shadow.may_show(pixel, empty) {
                    *set = 0;
                }
            }
        }
        let kept = and(&dilate(&erode(&sure, &shadow.grain), &shadow.rim), &blob.mask)?;
        if kept == blob.mask {
            return Ok(vec![blob]);
        }
        let mut runs = Runs::default();
        let mut above = 0..0;
        for y in 1..height - 1 {
            let row = &kept.row(y)[1..width - 1];
            runs.row((top + y - 1, left, row.len()), &mut above, |_| false, |x| row[x] != 0);
        }
        Ok(self.parts(frame, runs).blobs)
    }

    /// The parts that runs make.
    fn parts(&self, frame: &Frame, mut runs: Runs) -> Seen {
        // Runs of each tree, by its root: the first of its runs.
        let mut members: Vec<(usize, usize)> = (0..runs.0.len()).map(|at| (runs.root(at), at)).collect();
        members.sort_unstable();
        let mut seen = Seen::default();
        for tree in members.chunk_by(|a, b| a.0 == b.0) {
            let of = || tree.iter().map(|(_, at)| &runs.0[*at]);
            let area: usize = of().map(|run| run.end - run.start).sum();
            if area < self.least {
                continue;
            }
            if area > self.most {
                seen.too_large += 1;
                continue;
            }
            seen.blobs.push(self.blob(frame, of));
        }
        seen
    }

    /// Runs of pixels that differ.
    fn runs(&self, frame: &Frame) -> Runs {
        let (mut runs, mut above) = (Runs::default(), 0..0);
        for y in 0..frame.height() {
            let columns = self.ground.columns(y);
            let place = (y, columns.start, columns.len());
            let (row, empty) = (&frame.row(y)[columns.clone()], &self.ground.picture().row(y)[columns]);
            let (many, none) = (row.as_chunks::<TOGETHER>().0, empty.as_chunks::<TOGETHER>().0);
            let most = |a: &[[u8; 3]], b: &[[u8; 3]]| {
                let pairs = a.as_flattened().iter().zip(b.as_flattened());
                pairs.fold(0, |most, (a, b)| a.abs_diff(*b).max(most))
            };
            let is_blank = |k: usize| {
                many.get(k).zip(none.get(k)).is_some_and(|(row, empty)| most(row, empty) <= self.level)
            };
            let is_set = |x: usize| most(&row[x..=x], &empty[x..=x]) > self.level;
            runs.row(place, &mut above, is_blank, is_set);
        }
        runs
    }

    /// The part that some runs make.
    fn blob<'a, I: Iterator<Item = &'a Run>>(&self, frame: &Frame, runs: impl Fn() -> I) -> Blob {
        let edges = |ends: [usize; 4], run: &Run| {
            [ends[0].min(run.start), ends[1].min(run.y), ends[2].max(run.end), ends[3].max(run.y + 1)]
        };
        let [left, top, right, bottom] = runs().fold([usize::MAX, usize::MAX, 0, 0], edges);
        let mut mask = Image::filled(right - left + 2, bottom - top + 2, 0_u8);
        for run in runs() {
            mask.row_mut(run.y - top + 1)[run.start - left + 1..run.end - left + 1].fill(255);
        }
        let mask = fill_holes(&mask, Neighbours::Four);
        let (mut area, mut sums, mut colour) = (0, [0.0; 2], [0.0; 3]);
        for y in top..bottom {
            let set = mask.row(y - top + 1).iter().skip(1).zip(&frame.row(y)[left..right]);
            for (x, (_, pixel)) in (left..).zip(set).filter(|(_, (set, _))| **set != 0) {
                area += 1;
                sums = [sums[0] + x as f64 + 0.5, sums[1] + y as f64 + 0.5];
                colour = [0, 1, 2].map(|c| colour[c] + f64::from(pixel[c]));
            }
        }
        let at_side =
            |at: fn(&Run, Range<usize>) -> bool| runs().any(|run| at(run, self.ground.columns(run.y)));
        let beyond = |y: Option<usize>| y.is_none_or(|y| self.ground.columns(y).is_empty());
        let borders = [
            at_side(|run, columns| run.start == columns.start),
            beyond(top.checked_sub(1)),
            at_side(|run, columns| run.end == columns.end),
            beyond(Some(bottom)),
        ];
        Blob {
            area,
            centroid: sums.map(|sum| sum / area as f64),
            colour: colour.map(|sum| sum / area as f64),
            clipped: borders.contains(&true),
            corner: [left, top],
            mask,
            borders,
        }
    }
}

impl Shadow {
    /// Whether a pixel may be ground in a shadow.
    fn may_show(&self, pixel: &[u8; 3], empty: &[u8; 3]) -> bool {
        let shares = [0, 1, 2].map(|c| f64::from(pixel[c]) / f64::from(empty[c].max(1)));
        let (least, most) = shares.iter().fold((2.0, 0.0), |(l, m): (f64, f64), s| (l.min(*s), m.max(*s)));
        least > self.light && most < 1.0 && most - least < GREY
    }
}

/// The part at which parts, in some order, have come to half of their pixels.
fn typical(
    parts: &mut [(usize, f64)],
    order: impl Fn(&(usize, f64), &(usize, f64)) -> std::cmp::Ordering,
) -> Option<(usize, f64)> {
    parts.sort_unstable_by(order);
    let half = parts.iter().map(|part| part.0).sum::<usize>() / 2;
    let mut sum = 0;
    let reaches = |part: &&(usize, f64)| {
        sum += part.0;
        sum > half
    };
    parts.iter().find(reaches).copied()
}

impl Blob {
    /// Middles of the edges between its pixels and others, in pixels of the frame; those at a border of the ground
    /// are left out: there it goes on unseen.
    pub fn outline(&self) -> Vec<[f64; 2]> {
        let mut points = Vec::new();
        let (width, height) = self.mask.size();
        let [left, top, right, bottom] = self.borders;
        for y in 1..height - 1 {
            let rows = [y - 1, y, y + 1].map(|y| self.mask.row(y));
            for x in 1..width - 1 {
                let around = [rows[1][x - 1], rows[0][x], rows[1][x + 1], rows[2][x]];
                // Most pixels are inside.
                if rows[1][x] == 0 || !around.contains(&0) {
                    continue;
                }
                let (px, py) = ((self.corner[0] + x - 1) as f64, (self.corner[1] + y - 1) as f64);
                let edges = [
                    (left && x == 1, [px, py + 0.5]),
                    (top && y == 1, [px + 0.5, py]),
                    (right && x == width - 2, [px + 1.0, py + 0.5]),
                    (bottom && y == height - 2, [px + 0.5, py + 1.0]),
                ];
                let seen = around.into_iter().zip(edges).filter(|(set, (unseen, _))| *set == 0 && !unseen);
                points.extend(seen.map(|(_, (_, at))| at));
            }
        }
        points
    }

    /// The radius of a disc of its area, px.
    pub fn radius(&self) -> f64 {
        (self.area as f64 / PI).sqrt()
    }

    /// Whether the pixel at a place belongs to it.
    pub fn covers(&self, [x, y]: [f64; 2]) -> bool {
        let place = |at: f64, corner: usize, side: usize| {
            let at = at - corner as f64 + 1.0;
            (at >= 0.0 && at < side as f64).then_some(at as usize)
        };
        let (width, height) = self.mask.size();
        let at = place(x, self.corner[0], width).zip(place(y, self.corner[1], height));
        at.is_some_and(|(x, y)| self.mask.row(y)[x] != 0)
    }
}
