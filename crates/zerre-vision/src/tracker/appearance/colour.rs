//! Colour histograms of many boxes of one frame, and their Bhattacharyya coefficients (Dilmen and Talu 2017,
//! equations 18 and 19).

use super::place::Place;

/// The bin of every pixel of a rectangle, in rows.
#[derive(Clone, Debug, Default)]
pub(super) struct Bins {
    columns: usize,
    values: Vec<u16>,
}

impl Bins {
    /// Room for `columns` x `rows`, in the memory of this one.
    pub(super) fn reset(&mut self, columns: usize, rows: usize) {
        self.columns = columns;
        self.values.resize(columns * rows, 0);
    }

    pub(super) fn row_mut(&mut self, y: usize) -> &mut [u16] {
        &mut self.values[y * self.columns..][..self.columns]
    }

    fn row(&self, x: usize, y: usize, width: usize) -> &[u16] {
        &self.values[y * self.columns + x..][..width]
    }
}

/// Memory that boxes use one after the other: the counts of two halves, because adding to one bin again has
/// to wait.
#[derive(Clone, Debug, Default)]
pub(super) struct Counts([Vec<u32>; 2]);

impl Counts {
    /// Counts the pixels of a box that begins at column `x` and row `y`.
    fn of(&mut self, bins: &Bins, count: usize, (x, y): (usize, usize), (width, height): (usize, usize)) {
        let [even, odd] = &mut self.0;
        for counts in [&mut *even, &mut *odd] {
            counts.clear();
            counts.resize(count, 0);
        }
        for row in y..y + height {
            let row = bins.row(x, row, width);
            let (pairs, rest) = row.as_chunks::<2>();
            for [a, b] in pairs {
                even[usize::from(*a)] += 1;
                odd[usize::from(*b)] += 1;
            }
            for bin in rest {
                even[usize::from(*bin)] += 1;
            }
        }
        even.iter_mut().zip(odd).for_each(|(even, odd)| *even += *odd);
    }
}

/// The histogram that boxes are compared with.
#[derive(Clone, Debug)]
pub(super) struct ColourTemplate {
    /// Bins of each of the three colours.
    bins: usize,
    /// Shares of the pixels.
    shares: Vec<f64>,
    /// The bins that hold any, with the roots of their shares.
    roots: Vec<(u16, f64)>,
}

impl ColourTemplate {
    /// The histogram of a box of `size` that begins at column `x` and row `y`.
    pub(super) fn new(bins: usize, seen: &Bins, at: (usize, usize), size: (usize, usize)) -> ColourTemplate {
        let mut template = ColourTemplate { bins, shares: vec![0.0; bins * bins * bins], roots: Vec::new() };
        template.blend(1.0, seen, at, size);
        template
    }

    /// How many bins each colour has.
    pub(super) fn bins(&self) -> usize {
        self.bins
    }

    /// Makes the template (1 - rate) of itself and `rate` of the histogram of another box.
    pub(super) fn blend(&mut self, rate: f64, seen: &Bins, at: (usize, usize), size: (usize, usize)) {
        let mut counts = Counts::default();
        counts.of(seen, self.shares.len(), at, size);
        let pixels = (size.0 * size.1) as f64;
        for (share, count) in self.shares.iter_mut().zip(&counts.0[0]) {
            *share += rate * (f64::from(*count) / pixels - *share);
        }
        let held = self.shares.iter().enumerate().filter(|(_, share)| **share > 0.0);
        self.roots = held.map(|(bin, share)| (bin as u16, share.sqrt())).collect();
    }

    /// The Bhattacharyya coefficient with the histogram of a box that begins at column `x` and row `y`; from
    /// 0 to 1.
    pub(super) fn similarity(
        &self,
        seen: &Bins,
        at: (usize, usize),
        size: (usize, usize),
        counts: &mut Counts,
    ) -> f64 {
        counts.of(seen, self.shares.len(), at, size);
        let [counts, _] = &counts.0;
        let sum: f64 =
            self.roots.iter().map(|(bin, root)| root * f64::from(counts[usize::from(*bin)]).sqrt()).sum();
        sum / ((size.0 * size.1) as f64).sqrt()
    }
}

/// Bin of a colour value, for every value.
pub(super) fn bin_of(bins: usize) -> [u16; 256] {
    std::array::from_fn(|value| (value * bins / 256) as u16)
}

/// Where a box of a rectangle lies in it.
pub(super) fn span(place: Place, region: Place) -> ((usize, usize), (usize, usize)) {
    (place.within(region), (place.width, place.height))
}
