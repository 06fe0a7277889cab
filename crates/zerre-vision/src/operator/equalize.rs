//! Equalisation of histograms.

use super::reflect;
use crate::{Error, Image, Result};

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
    if !(clip_limit.is_finite() && clip_limit >= 0.0) {
        let needs = "0, which clips nothing, or a positive number is needed";
        return Err(Error::OutOfRange { what: "clip limit of CLAHE", value: clip_limit, needs });
    }
    let (width, height) = image.size();
    for (tiles, side) in [(tiles.0, width), (tiles.1, height)] {
        if tiles == 0 || tiles > side {
            let needs = "at least one is needed, and not more than the picture has pixels in that direction";
            return Err(Error::OutOfRange { what: "number of tiles of CLAHE", value: tiles as f64, needs });
        }
    }
    // OpenCV lets a picture that the tiles do not divide grow in both directions, in one of them by a whole
    // tile row.
    let divides = width % tiles.0 == 0 && height % tiles.1 == 0;
    let grown = |side: usize, tiles: usize| if divides { side } else { side + tiles - side % tiles };
    let tile = (grown(width, tiles.0) / tiles.0, grown(height, tiles.1) / tiles.1);
    let area = tile.0 * tile.1;
    let limit = if clip_limit > 0.0 { ((clip_limit * area as f64 / 256.0) as u32).max(1) } else { 0 };
    let scale = 255.0 / area as f32;
    let mut tables = Vec::with_capacity(tiles.0 * tiles.1);
    for row in 0..tiles.1 {
        for column in 0..tiles.0 {
            let mut counts = [0; 256];
            for y in row * tile.1..(row + 1) * tile.1 {
                let source = image.row(reflect(y as isize, height));
                for x in column * tile.0..(column + 1) * tile.0 {
                    counts[usize::from(source[reflect(x as isize, width)])] += 1;
                }
            }
            tables.push(tile_table(counts, limit, scale));
        }
    }
    // The two tiles about a column or a row, and the weight of the second.
    let between = |i: usize, side: usize, tiles: usize| {
        let place = i as f32 * (1.0 / side as f32) - 0.5;
        let first = place.floor();
        let weight = place - first;
        let first = first as isize;
        (first.max(0) as usize, ((first + 1) as usize).min(tiles - 1), weight)
    };
    let columns: Vec<_> = (0..width).map(|x| between(x, tile.0, tiles.0)).collect();
    let mut result = image.clone();
    for y in 0..height {
        let (upper, lower, down) = between(y, tile.1, tiles.1);
        for (pixel, &(left, right, across)) in result.row_mut(y).iter_mut().zip(&columns) {
            let level =
                |row: usize, column: usize| f32::from(tables[row * tiles.0 + column][usize::from(*pixel)]);
            let above = level(upper, left) * (1.0 - across) + level(upper, right) * across;
            let below = level(lower, left) * (1.0 - across) + level(lower, right) * across;
            *pixel = (above * (1.0 - down) + below * down).round_ties_even() as u8;
        }
    }
    Ok(result)
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
