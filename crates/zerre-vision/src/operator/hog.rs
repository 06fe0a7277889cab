//! Histograms of oriented gradients.

use crate::{Error, Image, Result};
use std::f64::consts::PI;
use zerre::math::sin_cos;

/// Histograms of oriented gradients (Dalal and Triggs 2005), as scikit-image's `hog` with
/// `block_norm='L2-Hys'`: unsigned orientations, each pixel in one bin and one cell, and a clipped norm over
/// overlapping blocks of cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hog {
    /// Bins over half a turn.
    pub orientations: usize,
    /// Columns and rows of pixels of a cell.
    pub cell: (usize, usize),
    /// Columns and rows of cells of a block.
    pub block: (usize, usize),
}

impl Default for Hog {
    /// Nine orientations, cells of 8 x 8 pixels, blocks of 3 x 3 cells.
    fn default() -> Hog {
        Hog { orientations: 9, cell: (8, 8), block: (3, 3) }
    }
}

/// Index of the last direction that an upward gradient has reached or passed. The margin is that of rounding:
/// no gradient of integers comes so near to a border without being on it.
#[inline(always)]
fn bin(across: f64, down: f64, directions: &[(f64, f64)]) -> usize {
    // The opposite gradient has the same orientation; this one is from 0 to below half a turn.
    let flip = down < 0.0 || (down == 0.0 && across < 0.0);
    let (across, down) = if flip { (-across, -down) } else { (across, down) };
    directions.iter().map(|&(sine, cosine)| usize::from(cosine * down - sine * across >= -1e-9)).sum()
}

impl Hog {
    /// Blocks in a row and in a column of a picture of this size, and numbers of each.
    ///
    /// # Errors
    /// No orientation or more than 180, cells or blocks without an area, a picture that is smaller than a
    /// block.
    pub fn layout(&self, size: (usize, usize)) -> Result<(usize, usize, usize)> {
        let sides = [self.cell.0, self.cell.1, self.block.0, self.block.1];
        for (what, value, most) in [("orientations", self.orientations, 180)]
            .into_iter()
            .chain(sides.map(|side| ("side of a cell or a block", side, 1 << 15)))
        {
            if !(1..=most).contains(&value) {
                let needs = "at least one is needed, at most 180 orientations and 32768 pixels or cells";
                return Err(Error::OutOfRange { what, value: value as f64, needs });
            }
        }
        let blocks = |pixels: usize, cell: usize, block: usize| (pixels / cell + 1).saturating_sub(block);
        let across = blocks(size.0, self.cell.0, self.block.0);
        let down = blocks(size.1, self.cell.1, self.block.1);
        if across == 0 || down == 0 {
            let expected = (self.cell.0 * self.block.0, self.cell.1 * self.block.1);
            return Err(Error::Size { found: size, expected });
        }
        Ok((across, down, self.block.0 * self.block.1 * self.orientations))
    }

    /// Mean gradient magnitude of every orientation of every cell, grey levels per two pixels: cells row
    /// after row. Gradients are central differences, zero at the picture's border in their direction.
    fn cells(&self, image: &Image<u8>) -> Vec<f64> {
        let (width, height) = image.size();
        let (columns, rows) = (width / self.cell.0, height / self.cell.1);
        let directions: Vec<(f64, f64)> =
            (1..self.orientations).map(|i| sin_cos(PI * i as f64 / self.orientations as f64)).collect();
        let mut sums = vec![0.0; columns * rows * self.orientations];
        for y in 0..rows * self.cell.1 {
            let row = image.row(y);
            let inner = y > 0 && y + 1 < height;
            let (above, below) = if inner { (image.row(y - 1), image.row(y + 1)) } else { (row, row) };
            let cells = y / self.cell.1 * columns;
            for x in 0..columns * self.cell.0 {
                let (before, behind) = if x > 0 && x + 1 < width { (x - 1, x + 1) } else { (x, x) };
                let across = f64::from(row[behind]) - f64::from(row[before]);
                let down = f64::from(below[x]) - f64::from(above[x]);
                let cell = (cells + x / self.cell.0) * self.orientations;
                sums[cell + bin(across, down, &directions)] += (across * across + down * down).sqrt();
            }
        }
        let area = (self.cell.0 * self.cell.1) as f64;
        sums.iter_mut().for_each(|sum| *sum /= area);
        sums
    }

    /// The numbers of all blocks, row after row; in a block those of its cells, row after row; in a cell
    /// those of its orientations, from the one along the rows on.
    ///
    /// # Errors
    /// What [`Hog::layout`] refuses.
    pub fn features(&self, image: &Image<u8>) -> Result<Vec<f64>> {
        const SMALL: f64 = 1e-5;
        let (across, down, length) = self.layout(image.size())?;
        let cells = self.cells(image);
        let columns = image.width() / self.cell.0;
        let mut features = Vec::with_capacity(across * down * length);
        for (row, column) in (0..down).flat_map(|row| (0..across).map(move |column| (row, column))) {
            let start = features.len();
            for j in row..row + self.block.1 {
                let first = (j * columns + column) * self.orientations;
                features.extend_from_slice(&cells[first..][..self.block.0 * self.orientations]);
            }
            let block = &mut features[start..];
            for most in [0.2, f64::INFINITY] {
                let squares: f64 = block.iter().map(|v| v * v).sum();
                let norm = (squares + SMALL * SMALL).sqrt();
                block.iter_mut().for_each(|v| *v = (*v / norm).min(most));
            }
        }
        Ok(features)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn borders_of_bins_are_those_of_the_angle() {
        for n in [1, 2, 4, 8, 9, 12] {
            let directions: Vec<_> = (1..n).map(|i| sin_cos(PI * i as f64 / n as f64)).collect();
            for (x, y, eighths) in
                [(3, 0, 0), (2, 2, 2), (0, 9, 4), (-7, 7, 6), (-3, 0, 0), (-5, -5, 2), (1, -1, 6)]
            {
                assert_eq!(bin(x.into(), y.into(), &directions), n * eighths / 8, "{x} {y} of {n}");
            }
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let image = Image::filled(24, 23, 0);
        assert!(Hog::default().features(&image).is_err());
        let hog = Hog { block: (3, 2), ..Hog::default() };
        assert_eq!(hog.features(&image).unwrap(), vec![0.0; 54]);
        for bad in [
            Hog { orientations: 0, ..hog },
            Hog { orientations: usize::MAX, ..hog },
            Hog { cell: (0, 1), ..hog },
            Hog { block: (1, usize::MAX), ..hog },
        ] {
            assert!(bad.features(&image).is_err());
        }
        let point = Hog { cell: (1, 1), block: (1, 1), ..hog };
        assert_eq!(point.features(&Image::filled(1, 1, 200)).unwrap().len(), 9);
    }
}
