//! Equalisation of histograms.

use super::reflect;
use crate::{Error, Image, Result};
use fearless_simd::{Level, dispatch};
use std::ops::Range;

/// A grey picture whose grey levels are spread over 0 to 255 by its histogram, as OpenCV's `equalizeHist`.
pub fn equalize(image: &Image<u8>) -> Image<u8> {
    let mut counts = [0_u32; 256];
    for &pixel in image.pixels() {
        counts[usize::from(pixel)] += 1;
    }
    let total = image.pixels().len() as u32;
    let darkest = counts.iter().position(|&c| c > 0).unwrap_or(0);
    if counts[darkest] == total {
        return image.clone();
    }
    let scale = 255.0 / (total - counts[darkest]) as f32;
    let (mut table, mut sum) = ([0; 256], 0);
    for level in darkest + 1..256 {
        sum += counts[level];
        table[level] = (sum as f32 * scale).round_ties_even() as u8;
    }
    image.map(|&pixel| table[usize::from(pixel)])
}

/// Table of a tile's grey levels under a clipped histogram.
fn tile_table(mut counts: [u32; 256], limit: u32, scale: f32) -> [u8; 256] {
    if limit > 0 {
        let mut clipped = 0;
        for count in &mut counts {
            clipped += count.saturating_sub(limit);
            *count = (*count).min(limit);
        }
        let rest = clipped % 256;
        for count in &mut counts {
            *count += clipped / 256;
        }
        if rest > 0 {
            let step = (256 / rest as usize).max(1);
            for count in counts.iter_mut().step_by(step).take(rest as usize) {
                *count += 1;
            }
        }
    }
    let mut sum = 0;
    counts.map(|count| {
        sum += count;
        (sum as f32 * scale).round_ties_even() as u8
    })
}

/// Contrast-limited adaptive histogram equalisation (Zuiderveld 1994, Graphics Gems IV), as OpenCV's
/// `createCLAHE`: the picture is cut into `tiles` = (columns, rows); no grey level of a tile counts for more
/// than `clip_limit` times its share in a flat histogram, and what is clipped is spread over all levels; the
/// tables of the four nearest tiles are interpolated at every pixel. A clip limit of 0 clips nothing.
///
/// # Errors
/// No tile in a row or a column, or more tiles than pixels; a clip limit that is negative or not finite.
pub fn clahe(image: &Image<u8>, clip_limit: f64, tiles: (usize, usize)) -> Result<Image<u8>> {
    let whole = [0, 0, image.width(), image.height()];
    Ok(Clahe::new(image.size(), clip_limit, tiles)?.part(image, (0, 0), whole))
}

/// [`clahe`] of parts of pictures: a part is what it is in the whole, and only the tiles about it are looked
/// at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clahe {
    size: (usize, usize),
    tiles: (usize, usize),
    /// Columns and rows of a tile, which may reach beyond the picture.
    tile: (usize, usize),
    /// Most pixels of a grey level; 0 for any number.
    limit: u32,
}

/// The two tiles about a column or a row, and the weight of the second.
#[inline(always)]
fn between(i: usize, side: usize, tiles: usize) -> (usize, usize, f32) {
    let place = i as f32 * (1.0 / side as f32) - 0.5;
    let first = place.floor();
    let weight = place - first;
    let first = first as isize;
    (first.max(0) as usize, ((first + 1) as usize).min(tiles - 1), weight)
}

impl Clahe {
    /// For pictures of this size: see [`clahe`].
    ///
    /// # Errors
    /// No tile in a row or a column, or more tiles than pixels; a clip limit that is negative or not finite.
    pub fn new(size: (usize, usize), clip_limit: f64, tiles: (usize, usize)) -> Result<Clahe> {
        if !(clip_limit.is_finite() && clip_limit >= 0.0) {
            let needs = "0, which clips nothing, or a positive number is needed";
            return Err(Error::OutOfRange { what: "clip limit of CLAHE", value: clip_limit, needs });
        }
        let (width, height) = size;
        for (tiles, side) in [(tiles.0, width), (tiles.1, height)] {
            if tiles == 0 || tiles > side {
                let needs =
                    "at least one is needed, and not more than the picture has pixels in that direction";
                return Err(Error::OutOfRange {
                    what: "number of tiles of CLAHE",
                    value: tiles as f64,
                    needs,
                });
            }
        }
        // OpenCV lets a picture that the tiles do not divide grow in both directions, in one of them by a
        // whole tile row.
        let divides = width % tiles.0 == 0 && height % tiles.1 == 0;
        let grown = |side: usize, tiles: usize| if divides { side } else { side + tiles - side % tiles };
        let tile = (grown(width, tiles.0) / tiles.0, grown(height, tiles.1) / tiles.1);
        let area = (tile.0 * tile.1) as f64;
        let limit = if clip_limit > 0.0 { ((clip_limit * area / 256.0) as u32).max(1) } else { 0 };
        Ok(Clahe { size, tiles, tile, limit })
    }

    /// Columns and rows of the tiles about a part, from the first to behind the last.
    fn tiles_about(&self, [x, y, width, height]: [usize; 4]) -> [Range<usize>; 2] {
        let about = |first: usize, count: usize, side: usize, tiles: usize| {
            let last = (first + count).saturating_sub(1).max(first);
            between(first, side, tiles).0.min(tiles - 1)..between(last, side, tiles).1 + 1
        };
        [about(x, width, self.tile.0, self.tiles.0), about(y, height, self.tile.1, self.tiles.1)]
    }

    /// The pixels that decide what the part `[x, y, width, height]` of a picture becomes, in the same form.
    /// The part lies in the picture.
    pub fn reach(&self, part: [usize; 4]) -> [usize; 4] {
        let [columns, rows] = self.tiles_about(part);
        let pixels = |tiles: Range<usize>, side: usize, all: usize| {
            let (start, end) = (tiles.start * side, tiles.end * side);
            // What a tile lacks beyond the picture is mirrored.
            let mirrored = (all..end).map(|i| reflect(i as isize, all)).min();
            let start = start.min(all).min(mirrored.unwrap_or(start));
            (start, end.min(all) - start)
        };
        let (x, width) = pixels(columns, self.tile.0, self.size.0);
        let (y, height) = pixels(rows, self.tile.1, self.size.1);
        [x, y, width, height]
    }

    /// The part `[x, y, width, height]` of the equalised picture. `image` is the picture from the column and
    /// row of `origin` on, and shows at least what [`Clahe::reach`] says; beyond its border it goes on.
    pub fn part(&self, image: &Image<u8>, origin: (usize, usize), part: [usize; 4]) -> Image<u8> {
        dispatch!(Level::new(), _simd => self.part_here(image, origin, part))
    }

    #[inline(always)]
    fn part_here(
        &self,
        image: &Image<u8>,
        (left, upper): (usize, usize),
        part @ [x, y, width, height]: [usize; 4],
    ) -> Image<u8> {
        let [columns, rows] = self.tiles_about(part);
        let Clahe { tile, tiles, limit, .. } = *self;
        let scale = 255.0 / (tile.0 * tile.1) as f32;
        let row_of = |y: usize| image.row(y.saturating_sub(upper).min(image.height() - 1));
        let column_of = |x: usize| x.saturating_sub(left).min(image.width() - 1);
        let mut tables = Vec::with_capacity(columns.len() * rows.len());
        for row in rows.clone() {
            for column in columns.clone() {
                let mut counts = [0; 256];
                let (first, end) = (column * tile.0, (column + 1) * tile.0);
                for y in row * tile.1..(row + 1) * tile.1 {
                    let source = row_of(reflect(y as isize, self.size.1));
                    let seen =
                        column_of(first)..(end.min(self.size.0).saturating_sub(left)).min(image.width());
                    for &pixel in source.get(seen).unwrap_or_default() {
                        counts[usize::from(pixel)] += 1;
                    }
                    for x in first.max(self.size.0)..end {
                        counts[usize::from(source[column_of(reflect(x as isize, self.size.0))])] += 1;
                    }
                }
                tables.push(tile_table(counts, limit, scale));
            }
        }
        let places: Vec<_> = (x..x + width)
            .map(|x| {
                let (before, behind, across) = between(x, tile.0, tiles.0);
                (column_of(x), before - columns.start, behind - columns.start, across)
            })
            .collect();
        let mut result = Image::filled(width, height, 0);
        for j in 0..result.height() {
            let source = row_of(y + j);
            let (above, below, down) = between(y + j, tile.1, tiles.1);
            let [above, below] = [above, below].map(|row| &tables[(row - rows.start) * columns.len()..]);
            for (pixel, &(x, before, behind, across)) in result.row_mut(j).iter_mut().zip(&places) {
                let level = usize::from(source[x]);
                let along = |tables: &[[u8; 256]]| {
                    let [before, behind] = [before, behind].map(|tile| f32::from(tables[tile][level]));
                    before * (1.0 - across) + behind * across
                };
                *pixel = (along(above) * (1.0 - down) + along(below) * down).round_ties_even() as u8;
            }
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::crop;

    #[test]
    fn odd_sizes_are_equalised_or_refused() {
        let image = Image::filled(1, 1, 7);
        assert_eq!(equalize(&image), image);
        assert!(clahe(&image, 2.0, (1, 1)).is_ok());
        assert!(clahe(&image, 2.0, (2, 1)).is_err());
        assert!(clahe(&image, 2.0, (1, 0)).is_err());
        assert!(clahe(&image, f64::NAN, (1, 1)).is_err());
        assert_eq!(clahe(&Image::filled(5, 9, 3), 2.0, (4, 7)).unwrap().size(), (5, 9));
    }

    /// A part needs its tiles alone, and is then what it is in the whole.
    #[test]
    fn parts_are_those_of_the_whole() {
        for (size, tiles) in [((80, 64), (8, 8)), ((83, 61), (8, 8)), ((37, 50), (4, 7)), ((9, 9), (8, 5))] {
            let image = Image::from_fn(size.0, size.1, |x, y| ((x * x + 5 * y * x + 31 * y) % 251) as u8);
            let whole = clahe(&image, 2.0, tiles).unwrap();
            let clahe = Clahe::new(size, 2.0, tiles).unwrap();
            for part in [
                [0, 0, size.0, size.1],
                [size.0 / 2, size.1 / 3, size.0 / 4, size.1 / 2],
                [0, size.1 - 3, 2, 3],
                [size.0 - 1, 0, 1, 1],
            ] {
                let reach = clahe.reach(part).map(|v| v as isize);
                let [x, y, width, height] = reach;
                let seen = crop(&image, x, y, width as usize, height as usize);
                let expected = crop(&whole, part[0] as isize, part[1] as isize, part[2], part[3]);
                let found = clahe.part(&seen, (x as usize, y as usize), part);
                assert_eq!(found, expected, "{size:?} {tiles:?} {part:?} {reach:?}");
            }
        }
    }
}
