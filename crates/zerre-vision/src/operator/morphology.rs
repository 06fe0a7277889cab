//! Mathematical morphology.

use super::components::{Component, Neighbours, label};
use crate::{Error, Image, Result};

/// A structuring element: which pixels about its middle count. The middle of an even side is the pixel behind
/// it.
#[derive(Clone, Debug, PartialEq)]
pub struct Element {
    width: usize,
    /// Of every row the first column that counts and the one behind the last.
    rows: Vec<(usize, usize)>,
}

impl Element {
    fn new(width: usize, height: usize, row: impl FnMut(usize) -> (usize, usize)) -> Result<Element> {
        for value in [width, height] {
            if !(1..1 << 15).contains(&value) {
                let needs = "from 1 to 32767 pixels are needed";
                return Err(Error::OutOfRange {
                    what: "side of a structuring element",
                    value: value as f64,
                    needs,
                });
            }
        }
        Ok(Element { width, rows: (0..height).map(row).collect() })
    }

    /// A rectangle.
    ///
    /// # Errors
    /// A side of no pixel.
    pub fn rectangle(width: usize, height: usize) -> Result<Element> {
        Element::new(width, height, |_| (0, width))
    }

    /// The row and the column of the middle.
    ///
    /// # Errors
    /// A side of no pixel.
    pub fn cross(width: usize, height: usize) -> Result<Element> {
        let middle = width / 2;
        Element::new(width, height, |y| if y == height / 2 { (0, width) } else { (middle, middle + 1) })
    }

    /// The ellipse in a rectangle, as OpenCV's `getStructuringElement` draws it.
    ///
    /// # Errors
    /// A side of no pixel.
    pub fn ellipse(width: usize, height: usize) -> Result<Element> {
        let (across, down) = (width / 2, height / 2);
        Element::new(width, height, |y| {
            let dy = y.abs_diff(down);
            // Of a single row only the middle counts, as in OpenCV.
            let share = if down > 0 { (down * down - dy * dy) as f64 / (down * down) as f64 } else { 0.0 };
            let half = (across as f64 * share.sqrt()).round_ties_even() as usize;
            (across.saturating_sub(half), (across + half + 1).min(width))
        })
    }

    /// The element as a mask.
    pub fn mask(&self) -> Image<u8> {
        Image::from_fn(self.width, self.rows.len(), |x, y| {
            let (start, end) = self.rows[y];
            if (start..end).contains(&x) { 255 } else { 0 }
        })
    }
}

/// Every pixel combined with those that the element shows; those beyond the border do not count.
fn combine(image: &Image<u8>, element: &Element, neutral: u8, best: impl Fn(u8, u8) -> u8) -> Image<u8> {
    let (width, height) = image.size();
    let mut result = Image::filled(width, height, neutral);
    let (across, down) = (element.width / 2, element.rows.len() / 2);
    for y in 0..height {
        let target = result.row_mut(y);
        for (j, &(start, end)) in element.rows.iter().enumerate() {
            let Some(row) = (y + j).checked_sub(down).filter(|&row| row < height) else { continue };
            let source = image.row(row);
            for i in start..end {
                // Pixel x meets pixel x + i - across.
                let (to, from) = (across.saturating_sub(i), i.saturating_sub(across));
                if to < width && from < width {
                    for (pixel, &other) in target[to..].iter_mut().zip(&source[from..]) {
                        *pixel = best(*pixel, other);
                    }
                }
            }
        }
    }
    result
}

/// The least level under the element about each pixel (OpenCV's `erode`).
pub fn erode(image: &Image<u8>, element: &Element) -> Image<u8> {
    combine(image, element, 255, u8::min)
}

/// The largest level under the element about each pixel (OpenCV's `dilate`).
pub fn dilate(image: &Image<u8>, element: &Element) -> Image<u8> {
    combine(image, element, 0, u8::max)
}

/// [`erode`], then [`dilate`]: without bright parts that do not hold the element.
pub fn open(image: &Image<u8>, element: &Element) -> Image<u8> {
    dilate(&erode(image, element), element)
}

/// [`dilate`], then [`erode`]: without dark parts that do not hold the element.
pub fn close(image: &Image<u8>, element: &Element) -> Image<u8> {
    erode(&dilate(image, element), element)
}

/// The components of the pixels that are set as `set`, as far as `keep` says so.
fn select(
    mask: &Image<u8>,
    neighbours: Neighbours,
    set: bool,
    keep: impl Fn(&Component) -> bool,
) -> Image<u8> {
    let components = label(mask, neighbours, |&pixel| (pixel != 0) == set);
    let kept: Vec<bool> = components.all.iter().map(keep).collect();
    let is_kept = |&label: &u32| label.checked_sub(1).is_some_and(|i| kept[i as usize]);
    components.labels.map(|label| if is_kept(label) { 255 } else { 0 })
}

/// Whether a component has a pixel at the border of a picture.
fn at_border(component: &Component, (width, height): (usize, usize)) -> bool {
    let b = component.bounds;
    b.x <= 0.0 || b.y <= 0.0 || b.x + b.width >= width as f64 || b.y + b.height >= height as f64
}

/// A mask without its components of fewer than `area` pixels.
pub fn area_open(mask: &Image<u8>, area: usize, neighbours: Neighbours) -> Image<u8> {
    select(mask, neighbours, true, |component| component.area >= area)
}

/// A mask with its holes: unset pixels from which no path of neighbours leads to the border. `Four` is the
/// neighbourhood of unset pixels that fits components of eight neighbours.
pub fn fill_holes(mask: &Image<u8>, neighbours: Neighbours) -> Image<u8> {
    let size = mask.size();
    select(mask, neighbours, false, |component| at_border(component, size)).map(|&outside| !outside)
}

/// A mask without its components that have a pixel at the border.
pub fn clear_border(mask: &Image<u8>, neighbours: Neighbours) -> Image<u8> {
    let size = mask.size();
    select(mask, neighbours, true, |component| !at_border(component, size))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_may_be_larger_than_the_picture() {
        let image = Image::from_fn(3, 2, |x, y| (10 * y + x) as u8);
        for element in [Element::rectangle(9, 8), Element::rectangle(40, 41)] {
            let element = element.unwrap();
            assert_eq!(erode(&image, &element), Image::filled(3, 2, 0));
            assert_eq!(dilate(&image, &element), Image::filled(3, 2, 12));
        }
        let point = Element::ellipse(1, 1).unwrap();
        assert_eq!(open(&image, &point), image);
        assert_eq!(close(&Image::filled(1, 1, 4), &Element::cross(2, 7).unwrap()), Image::filled(1, 1, 4));
        assert!(Element::rectangle(0, 3).is_err() && Element::cross(3, 0).is_err());
    }
}
