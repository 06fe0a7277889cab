//! The arm's end by depth: the places of the body that are far from its middle along its surface (Baak, Müller, Bharaj,
//! Seidel and Theobalt, ICCV 2011), where a surface ends when its depth jumps. A hand before the chest is far along the
//! arm, and near in the picture.

use super::{HandColours, NO_DEPTH, View, nearer_by};
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

/// A cell of the body's surface: the nearest in its pixels.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    /// Mean place of its pixels, and how many they are.
    at: [f32; 2],
    pixels: u8,
    /// Point in the colour camera's frame, millimetres; z = 0 where there is no body.
    point: [f32; 3],
    /// Distance from the body's middle along the surface.
    far: f32,
}

/// The cue, and the memory that it uses again.
#[derive(Clone, Debug, Default)]
pub struct ArmEnd {
    columns: usize,
    cells: Vec<Cell>,
    buckets: Vec<Vec<u32>>,
    order: Vec<u32>,
    parents: Vec<u32>,
}

/// An end of the body, with how far it stands out.
#[derive(Clone, Copy, Debug)]
struct End {
    cell: u32,
    stands_out: f32,
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
        self.columns = width / CELL;
        let rows = height / CELL;
        self.cells.clear();
        self.cells.resize(self.columns * rows, Cell::default());
        let lens = view.lens;
        let [fx, fy] = lens.focal.map(|v| v as f32);
        let [cx, cy] = lens.principal.map(|v| v as f32);
        for (j, line) in self.cells.chunks_mut(self.columns.max(1)).enumerate() {
            for (i, cell) in line.iter_mut().enumerate() {
                let mut body = [(0, 0, 0); CELL * CELL];
                let (mut count, mut nearest) = (0, u16::MAX);
                for y in CELL * j..CELL * (j + 1) {
                    let seen = &view.depth.row(y)[CELL * i..CELL * (i + 1)];
                    let room = &view.room_depth.row(y)[CELL * i..CELL * (i + 1)];
                    for (x, (&z, &far)) in seen.iter().zip(room).enumerate() {
                        let before = z != NO_DEPTH
                            && far != NO_DEPTH
                            && i32::from(far) - i32::from(z) > nearer_by(far);
                        if before {
                            body[count] = (CELL * i + x, y, z);
                            count += 1;
                            nearest = nearest.min(z);
                        }
                    }
                }
                // A quarter of the pixels, or it is noise.
                if count * 4 < CELL * CELL {
                    continue;
                }
                let (mut sum, mut n) = ([0.0_f32; 3], 0_u8);
                for &(x, y, z) in &body[..count] {
                    if f32::from(z) < f32::from(nearest) + STEP {
                        sum[0] += x as f32;
                        sum[1] += y as f32;
                        sum[2] += f32::from(z);
                        n += 1;
                    }
                }
                let [u, v, z] = sum.map(|s| s / f32::from(n));
                let point = [(u - cx) / fx * z, (v - cy) / fy * z, z];
                *cell = Cell { at: [u + 0.5, v + 0.5], pixels: n, point, far: f32::INFINITY };
            }
        }
    }

    /// Neighbours of a cell that have a body, with the length of the way and whether it is a jump.
    fn neighbours(cells: &[Cell], columns: usize, i: usize) -> impl Iterator<Item = (usize, f32, bool)> {
        let (x, y) = (i % columns, i / columns);
        let rows = cells.len() / columns;
        let here = cells[i].point;
        let around = (y.saturating_sub(1)..(y + 2).min(rows))
            .flat_map(move |v| (x.saturating_sub(1)..(x + 2).min(columns)).map(move |u| v * columns + u));
        around.filter(move |&k| k != i && cells[k].point[2] > 0.0).map(move |k| {
            let there = cells[k].point;
            let [a, b, c] = [0, 1, 2].map(|d| there[d] - here[d]);
            let length = (a * a + b * b + c * c).sqrt();
            let jumps = c.abs() > STEP;
            (k, if jumps { 3.0 * length + JUMP } else { length }, jumps)
        })
    }

    /// Distances along the surface from the body's middle (Dijkstra 1959, by buckets). `false` where there is no body.
    fn measure(&mut self) -> bool {
        let body = |c: &&Cell| c.point[2] > 0.0;
        let count = self.cells.iter().filter(body).count();
        if count < FEW {
            return false;
        }
        let mut values: Vec<f32> = Vec::with_capacity(count);
        let median = |values: &mut Vec<f32>, of: &dyn Fn(&Cell) -> Option<f32>| {
            values.clear();
            values.extend(self.cells.iter().filter(body).filter_map(of));
            let middle = values.len() / 2;
            (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f32::total_cmp).1)
        };
        let (Some(x), Some(y)) =
            (median(&mut values, &|c| Some(c.at[0])), median(&mut values, &|c| Some(c.at[1])))
        else {
            return false;
        };
        let close = |c: &Cell| (c.at[0] - x).abs() < MIDDLE[0] && (c.at[1] - y).abs() < MIDDLE[0];
        let Some(depth) = median(&mut values, &|c| close(c).then_some(c.point[2])) else { return false };
        self.buckets.iter_mut().for_each(Vec::clear);
        let mut queue = std::mem::take(&mut self.buckets);
        let put = |queue: &mut Vec<Vec<u32>>, i: usize, far: f32| {
            let bucket = (far / BUCKET) as usize;
            if queue.len() <= bucket {
                queue.resize_with(bucket + 1, Vec::new);
            }
            queue[bucket].push(i as u32);
        };
        for i in 0..self.cells.len() {
            let cell = &mut self.cells[i];
            if cell.point[2] > 0.0 && close(cell) && (cell.point[2] - depth).abs() < MIDDLE[1] {
                cell.far = 0.0;
                put(&mut queue, i, 0.0);
            }
        }
        let mut bucket = 0;
        while bucket < queue.len() {
            while let Some(i) = queue[bucket].pop() {
                let i = i as usize;
                let far = self.cells[i].far;
                if (far / BUCKET) as usize != bucket {
                    continue; // A shorter way was found meanwhile.
                }
                let near: [Option<(usize, f32)>; 8] = {
                    let mut all = [None; 8];
                    let ways = Self::neighbours(&self.cells, self.columns, i);
                    for (slot, (k, way, _)) in all.iter_mut().zip(ways) {
                        *slot = Some((k, way));
                    }
                    all
                };
                for (k, way) in near.into_iter().flatten() {
                    if far + way < self.cells[k].far {
                        self.cells[k].far = far + way;
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
        self.order.clear();
        self.order.extend((0..cells.len() as u32).filter(|&i| {
            let cell = &cells[i as usize];
            cell.point[2] > 0.0 && cell.far.is_finite() && cell.far > 0.0
        }));
        self.order.sort_unstable_by(|&a, &b| {
            cells[b as usize].far.total_cmp(&cells[a as usize].far).then(a.cmp(&b))
        });
        self.parents.clear();
        self.parents.resize(cells.len(), u32::MAX);
        let parents = &mut self.parents;
        let mut ends = Vec::new();
        // The root of a tree is its peak.
        fn root(parents: &mut [u32], mut i: u32) -> u32 {
            while parents[i as usize] != i {
                parents[i as usize] = parents[parents[i as usize] as usize];
                i = parents[i as usize];
            }
            i
        }
        for &i in &self.order {
            parents[i as usize] = i;
            for (k, _, jumps) in Self::neighbours(cells, self.columns, i as usize) {
                if jumps || parents[k] == u32::MAX {
                    continue;
                }
                let (a, b) = (root(parents, i), root(parents, k as u32));
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
        let mut lowest: Vec<(u32, f32)> = Vec::new();
        for &i in &self.order {
            let top = root(parents, i);
            match lowest.iter_mut().find(|(cell, _)| *cell == top) {
                Some((_, low)) => *low = low.min(cells[i as usize].far),
                None => lowest.push((top, cells[i as usize].far)),
            }
        }
        for (cell, low) in lowest {
            let stands_out = cells[cell as usize].far - low;
            if stands_out > STANDS_OUT {
                ends.push(End { cell, stands_out });
            }
        }
        ends
    }

    /// Middle and depth of the hand at an end, and how much its colours are a hand's (1 where they are not known).
    fn hand(&self, end: u32, view: &View<'_>, colours: Option<&HandColours>) -> Option<([f64; 2], f64, f64)> {
        let tip = self.cells[end as usize];
        let mut reached = vec![end];
        let (mut sum, mut depth, mut weight, mut odds) = ([0.0_f64; 2], 0.0, 0.0, 0.0);
        let mut next = 0;
        while next < reached.len() {
            let i = reached[next] as usize;
            next += 1;
            let cell = self.cells[i];
            let back = tip.far - cell.far;
            let palm = (back - PALM_FROM_TIP).abs() < PALM_REACH;
            let n = if palm { f64::from(cell.pixels) } else { 0.0 };
            weight += n;
            sum[0] += n * f64::from(cell.at[0]);
            sum[1] += n * f64::from(cell.at[1]);
            depth += n * f64::from(cell.point[2]);
            if let Some(colours) = colours {
                odds += n * colours.odds_at(view, cell.at);
            }
            for (k, _, jumps) in Self::neighbours(&self.cells, self.columns, i) {
                let there = &self.cells[k];
                let [a, b, c] = [0, 1, 2].map(|d| there.point[d] - tip.point[d]);
                let near = (a * a + b * b + c * c).sqrt() < PALM_FROM_TIP + 1.5 * PALM_REACH;
                if !jumps
                    && near
                    && there.far > tip.far - PALM_FROM_TIP - PALM_REACH
                    && !reached.contains(&(k as u32))
                {
                    reached.push(k as u32);
                }
            }
        }
        if reached.len() < 4 || weight == 0.0 {
            return None;
        }
        let odds = if colours.is_some_and(|c| !c.is_empty()) { odds / weight } else { 1.0 };
        Some((sum.map(|v| v / weight), depth / weight, odds))
    }
}
