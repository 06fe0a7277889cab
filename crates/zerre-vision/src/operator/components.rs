//! Connected components of masks.

use crate::{Image, Rect};

/// Which pixels are neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Neighbours {
    /// Those with a common edge.
    Four,
    /// Those with a common edge or corner.
    Eight,
}

/// A connected part of a mask.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Component {
    /// How many pixels it has.
    pub area: usize,
    /// Mean of its pixels' centres.
    pub centroid: [f64; 2],
    /// The least box of whole pixels that holds it.
    pub bounds: Rect,
}

/// The connected parts of a mask.
#[derive(Clone, Debug, PartialEq)]
pub struct Components {
    /// Of every pixel the number of its component, or 0 where the mask is unset.
    pub labels: Image<u32>,
    /// The components by their first pixels, row after row; number n is the entry n - 1.
    pub all: Vec<Component>,
}

/// The root of a label's tree; every tree's root is its least label.
fn root(parents: &mut [u32], label: u32) -> u32 {
    let mut label = label as usize;
    while parents[label] as usize != label {
        parents[label] = parents[parents[label] as usize];
        label = parents[label] as usize;
    }
    label as u32
}

/// The connected parts of a mask, by two passes and trees of equal labels (Rosenfeld and Pfaltz 1966).
pub fn components(mask: &Image<u8>, neighbours: Neighbours) -> Components {
    label(mask, neighbours, |&pixel| pixel != 0)
}

/// The connected parts of the pixels for which `set` holds.
pub(super) fn label<P>(image: &Image<P>, neighbours: Neighbours, set: impl Fn(&P) -> bool) -> Components {
    let (width, height) = image.size();
    let mut labels = Image::filled(width, height, 0_u32);
    let mut parents = vec![0_u32];
    let mut above = vec![0; width];
    for y in 0..height {
        let row = labels.row_mut(y);
        for (x, pixel) in image.row(y).iter().enumerate() {
            if !set(pixel) {
                continue;
            }
            let left = if x > 0 { row[x - 1] } else { 0 };
            let diagonal = |x: Option<usize>| match neighbours {
                Neighbours::Four => 0,
                Neighbours::Eight => x.and_then(|x| above.get(x).copied()).unwrap_or(0),
            };
            let mut least = 0;
            for neighbour in [left, above[x], diagonal(x.checked_sub(1)), diagonal(Some(x + 1))] {
                if neighbour == 0 {
                    continue;
                }
                let neighbour = root(&mut parents, neighbour);
                if least == 0 {
                    least = neighbour;
                } else if neighbour != least {
                    let (low, high) = (least.min(neighbour), least.max(neighbour));
                    parents[high as usize] = low;
                    least = low;
                }
            }
            if least == 0 {
                least = parents.len() as u32;
                parents.push(least);
            }
            row[x] = least;
        }
        above.copy_from_slice(row);
    }
    // A tree's root is its least label, and labels count first pixels: roots in order are components in
    // order.
    let mut numbers = vec![0_u32; parents.len()];
    let mut count = 0;
    for label in 1..parents.len() {
        let root = root(&mut parents, label as u32) as usize;
        if root == label {
            count += 1;
            numbers[label] = count;
        } else {
            numbers[label] = numbers[root];
        }
    }
    // Area, sums of columns and rows, first and last column and row.
    let mut sums = vec![[0, 0, 0, usize::MAX, 0, usize::MAX, 0]; count as usize];
    for y in 0..height {
        for (x, label) in labels.row_mut(y).iter_mut().enumerate() {
            *label = numbers[*label as usize];
            if *label > 0 {
                let [area, xs, ys, left, right, upper, lower] = &mut sums[*label as usize - 1];
                (*area, *xs, *ys) = (*area + 1, *xs + x, *ys + y);
                (*left, *right) = (x.min(*left), x.max(*right));
                (*upper, *lower) = (y.min(*upper), y.max(*lower));
            }
        }
    }
    let component = |[area, xs, ys, left, right, upper, lower]: [usize; 7]| Component {
        area,
        centroid: [xs, ys].map(|sum| sum as f64 / area as f64 + 0.5),
        bounds: Rect {
            x: left as f64,
            y: upper as f64,
            width: (right - left + 1) as f64,
            height: (lower - upper + 1) as f64,
        },
    };
    Components { labels, all: sums.into_iter().map(component).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arms_that_meet_late_are_one() {
        let rows = ["#.#.#", "#.#.#", "#####", ".....", "#.#.#", ".#.#."];
        let mask = Image::from_fn(5, 6, |x, y| u8::from(rows[y].as_bytes()[x] == b'#'));
        let four = components(&mask, Neighbours::Four);
        assert_eq!(four.all.iter().map(|c| c.area).collect::<Vec<_>>(), [11, 1, 1, 1, 1, 1]);
        let eight = components(&mask, Neighbours::Eight);
        assert_eq!(eight.all.iter().map(|c| c.area).collect::<Vec<_>>(), [11, 5]);
        assert_eq!(eight.all[1].bounds, Rect { x: 0.0, y: 4.0, width: 5.0, height: 2.0 });
        assert_eq!(eight.all[1].centroid, [2.5, 4.9]);
        assert_eq!(components(&Image::filled(1, 1, 0), Neighbours::Four).all, []);
        assert_eq!(components(&Image::filled(1, 1, 3), Neighbours::Eight).labels.pixels(), [1]);
    }
}
