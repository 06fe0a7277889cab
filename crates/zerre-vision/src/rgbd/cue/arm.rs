//! The arm's end by depth: the places of the body that are far from its middle along its surface (Baak, Müller, Bharaj,
//! Seidel and Theobalt, ICCV 2011), where a surface ends when its depth jumps. A hand before the chest is far along the
//! arm, and near in the picture.

use super::{HandColours, NO_DEPTH, View};
use crate::rgbd::Reading;

/// Pixels of a cell's side.
const CELL: usize = 4;
/// Steps of depth between neighbouring cells beyond which they are of different surfaces, millimetres.
const STEP: f32 = 60.0;
/// What a jump from one surface to another costs, beside its length three times, millimetres.
const JUMP: f32 = 100.0;
/// How far along the surface an end must stand out from what it belongs to, millimetres.
const STANDS_OUT: f32 = 90.0;
/// How far the middle of the palm is from the tip of the longest finger along the surface, millimetres.
const PALM_FROM_TIP: f32 = 110.0;
/// How far on both sides of that cells are still the palm's.
const PALM_REACH: f32 = 40.0;
/// Cells of the middle of the body are within this of its median place and depth: pixels and millimetres.
const MIDDLE: [f32; 2] = [50.0, 90.0];
/// Distances are rounded to so many millimetres where the nearest cell is looked for.
const BUCKET: f32 = 4.0;
/// Cells below which there is no body.
const FEW: usize = 60;

/// Neighbours of a cell, in the order of rows: columns and rows from it. Direction `d` is the opposite of `7 - d`.
const AROUND: [(isize, isize); 8] = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
/// No cell.
const NONE: u32 = u32::MAX;

/// A cell of the body's surface: the nearest in its pixels.
#[derive(Clone, Copy, Debug)]
struct Cell {
    /// Mean place of its pixels, and how many they are.
    at: [f32; 2],
    pixels: u8,
    /// Point in the colour camera's frame, millimetres.
    point: [f32; 3],
    /// Distance from the body's middle along the surface.
    far: f32,
    /// The cells around it ([`AROUND`]) that are of the body, with the length of the way there.
    near: [u32; 8],
    ways: [f32; 8],
    /// Which of the ways are jumps from one surface to another, a bit each.
    jumps: u8,
}

impl Cell {
    /// The cells around it: which, how long the way is, and whether it is a jump.
    fn around(&self) -> impl Iterator<Item = (u32, f32, bool)> {
        let all = self.near.iter().zip(&self.ways).enumerate();
        let jumps = self.jumps;
        all.filter(|(_, (near, _))| **near != NONE)
            .map(move |(d, (near, way))| (*near, *way, jumps >> d & 1 == 1))
    }

    fn distance(&self, other: &Cell) -> f32 {
        let [a, b, c] = [0, 1, 2].map(|k| other.point[k] - self.point[k]);
        (a * a + b * b + c * c).sqrt()
    }
}

/// The cue, and the memory that it uses again.
#[derive(Clone, Debug, Default)]
pub struct ArmEnd {
    /// The body's cells, row by row.
    cells: Vec<Cell>,
    /// Of a row of cells and the one above it, which cell of the body each is.
    rows: [Vec<u32>; 2],
    /// By column of pixels, how many of a row of cells are before the room.
    votes: Vec<u8>,
    buckets: Vec<Vec<u32>>,
    values: Vec<f32>,
    order: Vec<u64>,
    parents: Vec<u32>,
    lowest: Vec<f32>,
    reached: Vec<u32>,
    seen: Vec<bool>,
}

/// An end of the body, with how far it stands out.
#[derive(Clone, Copy, Debug)]
struct End {
    cell: u32,
    stands_out: f32,
}

/// The root of a tree of [`ArmEnd::parents`] is its peak.
fn root(parents: &mut [u32], mut i: u32) -> u32 {
    while parents[i as usize] != i {
        parents[i as usize] = parents[parents[i as usize] as usize];
        i = parents[i as usize];
    }
    i
}

impl ArmEnd {
    /// The ends of the body, as hands: where the middle of a palm would be. Where the hand's colours are known, an end of
    /// other colours is doubted.
    pub fn candidates(&mut self, view: &View<'_>, colours: Option<&HandColours>) -> Vec<Reading> {
        self.survey(view);
        if !self.measure() {
            return Vec::new();
        }
        let ends = self.ends();
        let reading = |end: End| {
            let (at, depth, odds) = self.hand(end.cell, view, colours)?;
            let sure = f64::from(end.stands_out / (end.stands_out + STANDS_OUT)).min(0.95);
            Some(Reading { at, depth_mm: Some(depth), confidence: sure * odds })
        };
        ends.into_iter().filter_map(reading).collect()
    }

    /// The cells of what stands before the room.
    fn survey(&mut self, view: &View<'_>) {
        let (width, height) = view.depth.size();
        let columns = width / CELL;
        self.cells.clear();
        for row in &mut self.rows {
            row.clear();
            row.resize(columns, NONE);
        }
        for j in 0..height / CELL {
            self.votes.clear();
            self.votes.resize(width, 0);
            for y in CELL * j..CELL * (j + 1) {
                let limits = view.room.limit.row(y);
                for (votes, (&z, &limit)) in self.votes.iter_mut().zip(view.depth.row(y).iter().zip(limits)) {
                    *votes += u8::from((z != NO_DEPTH) & (z < limit));
                }
            }
            self.rows.swap(0, 1);
            self.rows[0].fill(NONE);
            for i in 0..columns {
                let votes: u8 = self.votes[CELL * i..CELL * (i + 1)].iter().sum();
                // A quarter of the pixels, or it is noise.
                if usize::from(votes) * 4 >= CELL * CELL {
                    self.rows[0][i] = self.cells.len() as u32;
                    self.cells.push(cell(view, i, j));
                    self.join(i);
                }
            }
        }
    }

    /// Joins the last cell, which is in this column, with those of the body that are before it.
    fn join(&mut self, column: usize) {
        let new = self.cells.len() - 1;
        for (d, (right, down)) in AROUND.into_iter().enumerate().take(4) {
            let row = &self.rows[usize::from(down < 0)];
            let near = column.checked_add_signed(right).and_then(|x| row.get(x)).copied().unwrap_or(NONE);
            if near == NONE {
                continue;
            }
            let other = self.cells[near as usize];
            let length = self.cells[new].distance(&other);
            let jumps = (other.point[2] - self.cells[new].point[2]).abs() > STEP;
            let way = if jumps { 3.0 * length + JUMP } else { length };
            for (from, to, d) in [(new, near as usize, d), (near as usize, new, 7 - d)] {
                let cell = &mut self.cells[from];
                (cell.near[d], cell.ways[d]) = (to as u32, way);
                cell.jumps |= u8::from(jumps) << d;
            }
        }
    }

    /// Distances along the surface from the body's middle (Dijkstra 1959, by buckets). `false` where there is no body.
    fn measure(&mut self) -> bool {
        if self.cells.len() < FEW {
            return false;
        }
        let values = &mut self.values;
        let mut median = |cells: &[Cell], of: &dyn Fn(&Cell) -> Option<f32>| {
            values.clear();
            values.extend(cells.iter().filter_map(of));
            let middle = values.len() / 2;
            (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f32::total_cmp).1)
        };
        let (Some(x), Some(y)) =
            (median(&self.cells, &|c| Some(c.at[0])), median(&self.cells, &|c| Some(c.at[1])))
        else {
            return false;
        };
        let close = |c: &Cell| (c.at[0] - x).abs() < MIDDLE[0] && (c.at[1] - y).abs() < MIDDLE[0];
        let Some(depth) = median(&self.cells, &|c| close(c).then_some(c.point[2])) else { return false };
        self.buckets.iter_mut().for_each(Vec::clear);
        let mut queue = std::mem::take(&mut self.buckets);
        let put = |queue: &mut Vec<Vec<u32>>, i: u32, far: f32| {
            let bucket = (far / BUCKET) as usize;
            if queue.len() <= bucket {
                queue.resize_with(bucket + 1, Vec::new);
            }
            queue[bucket].push(i);
        };
        for (i, cell) in self.cells.iter_mut().enumerate() {
            if close(cell) && (cell.point[2] - depth).abs() < MIDDLE[1] {
                cell.far = 0.0;
                put(&mut queue, i as u32, 0.0);
            }
        }
        let mut bucket = 0;
        while bucket < queue.len() {
            while let Some(i) = queue[bucket].pop() {
                let Cell { far, near, ways, .. } = self.cells[i as usize];
                if (far / BUCKET) as usize != bucket {
                    continue; // A shorter way was found meanwhile.
                }
                for (k, way) in near.into_iter().zip(ways).filter(|(k, _)| *k != NONE) {
                    let there = &mut self.cells[k as usize].far;
                    if far + way < *there {
                        *there = far + way;
                        put(&mut queue, k, far + way);
                    }
                }
            }
            bucket += 1;
        }
        self.buckets = queue;
        true
    }

    /// The ends: peaks of the distance that stand out from where they join a higher one (persistence; Edelsbrunner, Letscher
    /// and Zomorodian 2002).
    fn ends(&mut self) -> Vec<End> {
        let cells = &self.cells;
        // The farthest first: of numbers that are not negative, the bits are in the numbers' order.
        self.order.clear();
        self.order.extend(cells.iter().enumerate().filter_map(|(i, cell)| {
            let there = cell.far.is_finite() && cell.far > 0.0;
            there.then(|| u64::from(!cell.far.to_bits()) << 32 | i as u64)
        }));
        self.order.sort_unstable();
        let order = || self.order.iter().map(|key| *key as u32);
        self.parents.clear();
        self.parents.resize(cells.len(), NONE);
        let parents = &mut self.parents;
        let mut ends = Vec::new();
        for i in order() {
            parents[i as usize] = i;
            for (k, _, jumps) in cells[i as usize].around() {
                if jumps || parents[k as usize] == NONE {
                    continue;
                }
                let (a, b) = (root(parents, i), root(parents, k));
                if a == b {
                    continue;
                }
                let higher = |a: u32, b: u32| cells[a as usize].far >= cells[b as usize].far;
                let (high, low) = if higher(a, b) { (a, b) } else { (b, a) };
                let stands_out = cells[low as usize].far - cells[i as usize].far;
                if stands_out > STANDS_OUT {
                    ends.push(End { cell: low, stands_out });
                }
                parents[low as usize] = high;
            }
        }
        // Those that joined none stand out from the middle, or from where their surface begins.
        self.lowest.clear();
        self.lowest.resize(cells.len(), f32::INFINITY);
        for i in order() {
            // The last one of a tree is its lowest.
            self.lowest[root(parents, i) as usize] = cells[i as usize].far;
        }
        for i in order().filter(|&i| parents[i as usize] == i) {
            let stands_out = cells[i as usize].far - self.lowest[i as usize];
            if stands_out > STANDS_OUT {
                ends.push(End { cell: i, stands_out });
            }
        }
        ends
    }

    /// Middle and depth of the hand at an end, and how much its colours are a hand's (1 where they are not known).
    fn hand(
        &mut self,
        end: u32,
        view: &View<'_>,
        colours: Option<&HandColours>,
    ) -> Option<([f64; 2], f64, f64)> {
        let cells = &self.cells;
        let tip = cells[end as usize];
        self.seen.clear();
        self.seen.resize(cells.len(), false);
        self.seen[end as usize] = true;
        self.reached.clear();
        self.reached.push(end);
        let (mut sum, mut depth, mut weight, mut odds) = ([0.0_f64; 2], 0.0, 0.0, 0.0);
        let mut next = 0;
        while let Some(&i) = self.reached.get(next) {
            next += 1;
            let cell = &cells[i as usize];
            let back = tip.far - cell.far;
            if (back - PALM_FROM_TIP).abs() < PALM_REACH {
                let n = f64::from(cell.pixels);
                weight += n;
                sum[0] += n * f64::from(cell.at[0]);
                sum[1] += n * f64::from(cell.at[1]);
                depth += n * f64::from(cell.point[2]);
                if let Some(colours) = colours {
                    odds += n * colours.odds_at(view, cell.at);
                }
            }
            for (k, _, jumps) in cell.around() {
                let there = &cells[k as usize];
                let near = tip.distance(there) < PALM_FROM_TIP + 1.5 * PALM_REACH;
                let hand = near && there.far > tip.far - PALM_FROM_TIP - PALM_REACH;
                if !jumps && hand && !std::mem::replace(&mut self.seen[k as usize], true) {
                    self.reached.push(k);
                }
            }
        }
        if self.reached.len() < 4 || weight == 0.0 {
            return None;
        }
        let odds = if colours.is_some_and(|c| !c.is_empty()) { odds / weight } else { 1.0 };
        Some((sum.map(|v| v / weight), depth / weight, odds))
    }
}

/// A cell of the body, without its neighbours.
fn cell(view: &View<'_>, i: usize, j: usize) -> Cell {
    let before = |x: usize, y: usize| {
        let z = view.depth.row(y)[x];
        (z != NO_DEPTH && z < view.room.limit.row(y)[x]).then_some(f32::from(z))
    };
    let pixels = || {
        let rows = CELL * j..CELL * (j + 1);
        rows.flat_map(|y| (CELL * i..CELL * (i + 1)).map(move |x| (x, y)))
            .filter_map(|(x, y)| Some((x, y, before(x, y)?)))
    };
    let nearest = pixels().map(|(_, _, z)| z).fold(f32::INFINITY, f32::min);
    let (mut sum, mut n) = ([0.0_f32; 3], 0_u8);
    for (x, y, z) in pixels().filter(|(_, _, z)| *z < nearest + STEP) {
        sum[0] += x as f32;
        sum[1] += y as f32;
        sum[2] += z;
        n += 1;
    }
    let [u, v, z] = sum.map(|s| s / f32::from(n));
    let [fx, fy] = view.lens.focal.map(|v| v as f32);
    let [cx, cy] = view.lens.principal.map(|v| v as f32);
    Cell {
        at: [u + 0.5, v + 0.5],
        pixels: n,
        point: [(u - cx) / fx * z, (v - cy) / fy * z, z],
        far: f32::INFINITY,
        near: [NONE; 8],
        ways: [0.0; 8],
        jumps: 0,
    }
}
