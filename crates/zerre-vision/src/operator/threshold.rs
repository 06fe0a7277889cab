//! Masks by grey level and colour.

use crate::Image;

/// The mask of pixels above `level`.
pub fn threshold(image: &Image<u8>, level: u8) -> Image<u8> {
    image.map(|&v| if v > level { 255 } else { 0 })
}

/// The mask of pixels from `low` to `high`, both included.
pub fn in_range(image: &Image<u8>, low: u8, high: u8) -> Image<u8> {
    image.map(|v| if (low..=high).contains(v) { 255 } else { 0 })
}

/// The mask of pixels whose channels are all from `low` to `high`, both included.
pub fn in_range_color<const N: usize>(image: &Image<[u8; N]>, low: [u8; N], high: [u8; N]) -> Image<u8> {
    image.map(|pixel| {
        let inside = pixel.iter().zip(&low).zip(&high).all(|((v, low), high)| (low..=high).contains(&v));
        if inside { 255 } else { 0 }
    })
}

/// The level that separates dark and bright pixels best (Otsu 1979, IEEE Transactions on Systems, Man, and
/// Cybernetics 9(1)): the least one of the largest variance between the two classes, for [`threshold`]. A
/// picture of one level gives 0.
pub fn otsu(image: &Image<u8>) -> u8 {
    let mut counts = [0_u64; 256];
    for &pixel in image.pixels() {
        counts[usize::from(pixel)] += 1;
    }
    let total: u64 = counts.iter().sum();
    let levels: u64 = counts.iter().zip(0..).map(|(&count, level)| count * level).sum();
    let (mut dark, mut dark_levels) = (0, 0);
    let (mut best, mut separation) = (0, 0.0);
    for (level, &count) in (0_u8..=255).zip(&counts) {
        dark += count;
        dark_levels += count * u64::from(level);
        let bright = total - dark;
        if dark == 0 || bright == 0 {
            continue;
        }
        let apart = dark_levels as f64 / dark as f64 - (levels - dark_levels) as f64 / bright as f64;
        let variance = dark as f64 * bright as f64 * apart * apart;
        if variance > separation {
            (best, separation) = (level, variance);
        }
    }
    best
}
