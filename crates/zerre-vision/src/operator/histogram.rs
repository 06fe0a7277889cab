//! Histograms of colours.

use super::covered;
use crate::{Error, Image, Rect, Result};

/// Joint histogram of three channels: the share of pixels in every cell of a cube of `bins`^3 colours.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    bins: usize,
    shares: Vec<f64>,
}

impl Histogram {
    /// An empty histogram of `bins` bins a channel, each 256 / `bins` levels wide.
    ///
    /// # Errors
    /// No bin, or more than 64.
    pub fn new(bins: usize) -> Result<Histogram> {
        if !(1..=64).contains(&bins) {
            let needs = "a number from 1 to 64 is needed";
            return Err(Error::OutOfRange { what: "bins of a channel", value: bins as f64, needs });
        }
        Ok(Histogram { bins, shares: vec![0.0; bins.pow(3)] })
    }

    /// Counts the pixels whose centres lie in a box and on the picture, of any colour space, instead of what
    /// was counted before.
    ///
    /// # Errors
    /// A box without such a pixel; the histogram is empty then.
    pub fn count(&mut self, image: &Image<[u8; 3]>, bounds: Rect) -> Result<()> {
        let (columns, rows) = covered(bounds, image.size());
        self.shares.fill(0.0);
        if columns.is_empty() || rows.is_empty() {
            let problem = format!("has no pixel of the picture of {} x {}", image.width(), image.height());
            return Err(Error::Bounds { bounds, problem });
        }
        let pixels = (columns.len() * rows.len()) as f64;
        for y in rows {
            for pixel in &image.row(y)[columns.clone()] {
                let cell =
                    pixel.iter().fold(0, |cell, &v| cell * self.bins + usize::from(v) * self.bins / 256);
                self.shares[cell] += 1.0;
            }
        }
        for share in &mut self.shares {
            *share /= pixels;
        }
        Ok(())
    }

    /// The shares, which sum to one: that of cell (r, g, b) at (r bins + g) bins + b.
    pub fn shares(&self) -> &[f64] {
        &self.shares
    }
}

/// Bhattacharyya coefficient of two distributions, the sum of sqrt(p q): 1 where they are the same, 0 where
/// they have nothing in common. Cells that only one of them has count for nothing.
pub fn bhattacharyya(p: &[f64], q: &[f64]) -> f64 {
    p.iter().zip(q).map(|(p, q)| (p * q).sqrt()).sum()
}

/// Hellinger distance of two distributions, sqrt(1 - [`bhattacharyya`]), from 0 to 1: what OpenCV's
/// `compareHist` calls Bhattacharyya distance, and what colour trackers weigh particles by (Perez, Hue,
/// Vermaak and Gangnet 2002).
pub fn bhattacharyya_distance(p: &[f64], q: &[f64]) -> f64 {
    (1.0 - bhattacharyya(p, q)).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_cut_or_refused() {
        let image = Image::from_fn(4, 1, |x, _| [if x < 2 { 0 } else { 255 }, 127, 128]);
        let mut histogram = Histogram::new(2).unwrap();
        histogram.count(&image, Rect { x: 0.6, y: -9.0, width: 3.0, height: 99.0 }).unwrap();
        let shares = [(0b001, 1.0 / 3.0), (0b101, 2.0 / 3.0)];
        assert!(shares.iter().all(|&(cell, share)| histogram.shares()[cell] == share));
        for x in [4.0, f64::NAN, -0.6, f64::INFINITY] {
            assert!(histogram.count(&image, Rect { x, y: 0.0, width: 1.0, height: 1.0 }).is_err());
        }
        assert!(Histogram::new(0).is_err() && Histogram::new(65).is_err());
    }
}
