//! What differs from the ground: difference, threshold, connected parts, their areas and centroids.

use super::disc::circle;
use super::ground::{Ground, GroundFrom};
use crate::operator::{Neighbours, fill_holes, otsu};
use crate::{Error, Frame, Image, Result};
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
/// Levels between those at which shadows are looked for, and how many there are.
const STEP: u8 = 16;
const HIGHER: u8 = 5;
/// Channels whose shares of the ground's light differ by less than this are those of a shadow.
const GREY: f64 = 0.12;

/// Finds what is not ground in frames of one size.
#[derive(Clone, Debug, PartialEq)]
pub struct Detector {
    ground: Ground,
    level: u8,
    least: usize,
    most: usize,
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
        let mut detector = Detector { ground, level: 0, least, most };
        detector.level = match settings.level {
            Some(level) => level,
            None => detector.otsu(samples)?.max(LEAST_LEVEL),
        };
        if settings.least_area.is_none() {
            let typical = LEAST_SHARE * detector.typical_area(samples)? as f64;
            detector.least = detector.least.max(typical as usize);
        }
        Ok(detector)
    }

    /// Half of the pixels of parts that are seen whole belong to parts of at least this area; 0 without a part.
    fn typical_area(&self, samples: &[Frame]) -> Result<usize> {
        let mut areas = Vec::new();
        for sample in samples {
            areas.extend(self.see(sample)?.blobs.iter().filter(|blob| !blob.clipped).map(|blob| blob.area));
        }
        areas.sort_unstable();
        let half = areas.iter().sum::<usize>() / 2;
        let mut sum = 0;
        let reaches = |area: &&usize| {
            sum += **area;
            sum > half
        };
        Ok(areas.iter().find(reaches).copied().unwrap_or(0))
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

    /// The parts of a frame that differ from the ground.
    ///
    /// # Errors
    /// A frame of another size than the ground.
    pub fn see(&self, frame: &Frame) -> Result<Seen> {
        self.ground.picture().expect_size(frame)?;
        let mut seen = self.parts(frame, self.level, |y| self.ground.columns(y));
        let blobs = std::mem::take(&mut seen.blobs);
        for blob in blobs {
            match self.without_shadow(frame, &blob) {
                Some(parts) => seen.blobs.extend(parts),
                None => seen.blobs.push(blob),
            }
        }
        Ok(seen)
    }

    /// A part that is not round may be balls with dark shadows between them: its parts at the higher level that shows
    /// the most of round ones, where these are most of what is left and what is gone is as grey as a shadow. Discs of
    /// one colour that touch have none at any level, and discs of several colours leave more than shadow behind.
    fn without_shadow(&self, frame: &Frame, blob: &Blob) -> Option<Vec<Blob>> {
        let is_round = |blob: &Blob| circle(&blob.outline()).is_some_and(|(_, residual)| residual < ROUND);
        if is_round(blob) {
            return None;
        }
        let [left, top] = blob.corner;
        let (width, height) = (blob.mask.width() - 2, blob.mask.height() - 2);
        let columns = |y: usize| {
            if !(top..top + height).contains(&y) {
                return 0..0;
            }
            let all = self.ground.columns(y);
            let (start, end) = (all.start.max(left), all.end.min(left + width));
            start..end.max(start)
        };
        let mut best: Option<(usize, Vec<Blob>)> = None;
        for step in 1..=HIGHER {
            let Some(level) = self.level.checked_add(step * STEP) else { break };
            let mut parts = self.parts(frame, level, columns).blobs;
            parts.retain(|part| blob.covers(part.centroid));
            let all: usize = parts.iter().map(|part| part.area).sum();
            let round: usize = parts.iter().filter(|part| is_round(part)).map(|part| part.area).sum();
            if 2 * round >= all.max(1)
                && best.as_ref().is_none_or(|(most, _)| round > *most)
                && self.is_shadow(frame, blob, &parts)
            {
                best = Some((round, parts));
            }
        }
        best.map(|(_, parts)| parts)
    }

    /// Whether what is in `blob` and in none of `parts` is ground that all channels show darker alike.
    fn is_shadow(&self, frame: &Frame, blob: &Blob, parts: &[Blob]) -> bool {
        let ([left, top], mut seen, mut empty) = (blob.corner, [0.0; 3], [0.0; 3]);
        for y in top..top + blob.mask.height() - 2 {
            for x in left..left + blob.mask.width() - 2 {
                let at = [x as f64 + 0.5, y as f64 + 0.5];
                if blob.mask.row(y - top + 1)[x - left + 1] != 0 && !parts.iter().any(|part| part.covers(at))
                {
                    for c in 0..3 {
                        seen[c] += f64::from(frame.row(y)[x][c]);
                        empty[c] += f64::from(self.ground.picture().row(y)[x][c]);
                    }
                }
            }
        }
        let shares = [0, 1, 2].map(|c| if empty[c] > 0.0 { seen[c] / empty[c] } else { 1.0 });
        let (least, most) = shares.iter().fold((1.0, 0.0), |(l, m): (f64, f64), s| (l.min(*s), m.max(*s)));
        most < 1.0 && most - least < GREY
    }

    /// The parts that differ by more than `level`, in some columns of each row.
    fn parts(&self, frame: &Frame, level: u8, columns: impl Fn(usize) -> Range<usize>) -> Seen {
        let mut runs = self.runs(frame, level, columns);
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

    /// Set pixels, eight at a look: most of a picture is ground.
    fn runs(&self, frame: &Frame, level: u8, columns: impl Fn(usize) -> Range<usize>) -> Runs {
        const TOGETHER: usize = 8;
        let (mut runs, mut flags) = (Runs::default(), vec![0_u8; 3 * frame.width()]);
        let mut above = 0..0;
        for y in 0..frame.height() {
            let columns = columns(y);
            let first = columns.start;
            let flags = &mut flags[..3 * columns.len()];
            let ground = self.ground.picture().row(y)[columns.clone()].as_flattened();
            let row = frame.row(y)[columns].as_flattened();
            for ((flag, a), b) in flags.iter_mut().zip(row).zip(ground) {
                *flag = u8::from(a.abs_diff(*b) > level);
            }
            let begin = runs.0.len();
            let mut open = None;
            for (k, chunk) in flags.chunks(3 * TOGETHER).enumerate() {
                let x = first + k * TOGETHER;
                if chunk.iter().fold(0, |any, flag| any | flag) == 0 {
                    if let Some(start) = open.take() {
                        runs.push((y, start, x), &mut above);
                    }
                    continue;
                }
                for (i, pixel) in chunk.chunks(3).enumerate() {
                    let set = pixel.iter().any(|flag| *flag != 0);
                    match (set, open) {
                        (true, None) => open = Some(x + i),
                        (false, Some(start)) => {
                            runs.push((y, start, x + i), &mut above);
                            open = None;
                        }
                        _ => {}
                    }
                }
            }
            if let Some(start) = open {
                runs.push((y, start, first + flags.len() / 3), &mut above);
            }
            above = begin..runs.0.len();
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

impl Blob {
    /// Middles of the edges between its pixels and others, in pixels of the frame; those at a border of the ground
    /// are left out: there it goes on unseen.
    pub fn outline(&self) -> Vec<[f64; 2]> {
        let mut points = Vec::new();
        let (width, height) = self.mask.size();
        let [left, top, right, bottom] = self.borders;
        for y in 1..height - 1 {
            let rows = [y - 1, y, y + 1].map(|y| self.mask.row(y));
            for x in (1..width - 1).filter(|x| rows[1][*x] != 0) {
                let (px, py) = ((self.corner[0] + x - 1) as f64, (self.corner[1] + y - 1) as f64);
                let mut edge = |set: u8, unseen: bool, at: [f64; 2]| {
                    if set == 0 && !unseen {
                        points.push(at);
                    }
                };
                edge(rows[1][x - 1], left && x == 1, [px, py + 0.5]);
                edge(rows[0][x], top && y == 1, [px + 0.5, py]);
                edge(rows[1][x + 1], right && x == width - 2, [px + 1.0, py + 0.5]);
                edge(rows[2][x], bottom && y == height - 2, [px + 0.5, py + 1.0]);
            }
        }
        points
    }

    /// The radius of a disc of its area, px.
    pub fn radius(&self) -> f64 {
        (self.area as f64 / std::f64::consts::PI).sqrt()
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
