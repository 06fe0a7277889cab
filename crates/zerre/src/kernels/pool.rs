//! Threads over blocks.

use super::BLOCK;
use rayon::prelude::*;
use std::marker::PhantomData;
use std::ops::Range;
use std::sync::Arc;

/// Who computes the blocks of a step. The number of threads never changes a result.
#[derive(Clone, Default)]
pub enum Threads {
    /// The calling thread alone.
    #[default]
    Serial,
    /// A pool that the caller owns; steps with few blocks stay on the calling thread.
    Pool(Arc<rayon::ThreadPool>),
}

/// Blocks that one task takes at least: below this, handing work over costs more than doing it.
const MIN_BLOCKS_PER_TASK: usize = 4;

impl Threads {
    /// `count` threads; 0 or 1 is the calling thread.
    ///
    /// # Errors
    /// The operating system refuses threads.
    pub fn new(count: usize) -> Result<Threads, rayon::ThreadPoolBuildError> {
        if count <= 1 {
            return Ok(Threads::Serial);
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build()?;
        Ok(Threads::Pool(Arc::new(pool)))
    }

    /// Runs `work(block, parts of the block of columns and more, &mut results[block])` for every block of [`BLOCK`]
    /// particles. All columns are equally long, and `results` has one entry per block.
    pub(crate) fn for_each_block<T: Send, const K: usize, const L: usize>(
        &self,
        columns: [&mut [f64]; K],
        more: [&mut [f64]; L],
        results: &mut [T],
        work: impl Fn(usize, [&mut [f64]; K], [&mut [f64]; L], &mut T) + Sync,
    ) {
        let (columns, more) = (SharedColumns::new(columns), SharedColumns::new(more));
        let len = if K > 0 { columns.len } else { more.len };
        assert!(results.len() == len.div_ceil(BLOCK));
        self.share(results, |block, result| {
            let (first, last) = (block * BLOCK, ((block + 1) * BLOCK).min(len));
            // SAFETY: every block is visited once, and blocks do not overlap.
            let (columns, more) = unsafe { (columns.range(first, last), more.range(first, last)) };
            work(block, columns, more, result);
        });
    }

    /// Runs `work(i, &mut out[range(&items[i])], &mut items[i])` for every item. The ranges must not overlap, and stand
    /// in the order of the items.
    pub(crate) fn for_each_part<T: Send>(
        &self,
        out: &mut [u32],
        items: &mut [T],
        range: impl Fn(&T) -> Range<usize> + Sync,
        work: impl Fn(usize, &mut [u32], &mut T) + Sync,
    ) {
        let mut end = 0;
        for item in items.iter() {
            let range = range(item);
            assert!(end <= range.start && range.start <= range.end, "parts overlap");
            end = range.end;
        }
        let out = SharedColumns::new([out]);
        self.share(items, |i, item| {
            let range = range(item);
            // SAFETY: the ranges were found disjoint above; they are fields of the items, which have not changed since.
            let [part] = unsafe { out.range(range.start, range.end) };
            work(i, part, item);
        });
    }

    /// Runs `work(i, &mut items[i])` for every item, on one thread or several.
    pub(crate) fn share<T: Send>(&self, items: &mut [T], work: impl Fn(usize, &mut T) + Sync) {
        match self {
            Threads::Pool(pool) if items.len() >= 2 * MIN_BLOCKS_PER_TASK => pool.install(|| {
                items
                    .par_iter_mut()
                    .with_min_len(MIN_BLOCKS_PER_TASK)
                    .enumerate()
                    .for_each(|(i, item)| work(i, item));
            }),
            _ => items.iter_mut().enumerate().for_each(|(i, item)| work(i, item)),
        }
    }
}

impl std::fmt::Debug for Threads {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Threads::Serial => write!(f, "Serial"),
            Threads::Pool(pool) => write!(f, "Pool({})", pool.current_num_threads()),
        }
    }
}

/// `K` slices of equal length that several threads write in disjoint ranges.
struct SharedColumns<'a, T, const K: usize> {
    start: [*mut T; K],
    len: usize,
    lifetime: PhantomData<&'a mut [T]>,
}

// SAFETY: the pointers come from exclusive borrows of `Send` data; `range` hands out a part to one thread at a time
// by its contract.
unsafe impl<T: Send, const K: usize> Sync for SharedColumns<'_, T, K> {}

impl<'a, T, const K: usize> SharedColumns<'a, T, K> {
    fn new(columns: [&'a mut [T]; K]) -> Self {
        let len = columns.first().map_or(0, |c| c.len());
        assert!(columns.iter().all(|c| c.len() == len), "columns of different lengths");
        SharedColumns { start: columns.map(|c| c.as_mut_ptr()), len, lifetime: PhantomData }
    }

    /// The columns from `from` to `to`.
    ///
    /// # Safety
    /// No two live results may overlap.
    #[allow(clippy::mut_from_ref, reason = "disjointness is the caller's contract")]
    unsafe fn range(&self, from: usize, to: usize) -> [&mut [T]; K] {
        assert!(from <= to && (K == 0 || to <= self.len));
        // SAFETY: inside the borrowed slices, and not aliased by the contract above.
        self.start.map(|p| unsafe { std::slice::from_raw_parts_mut(p.add(from), to - from) })
    }
}
