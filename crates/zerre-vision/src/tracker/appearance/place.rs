//! Boxes of whole pixels: what a particle looks at.

use super::motion::STATE;

/// A box of whole pixels; it may reach beyond the frame, whose border goes on there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) x: isize,
    pub(super) y: isize,
    pub(super) width: usize,
    pub(super) height: usize,
}

impl Place {
    /// The box of a state; `None` where there is nothing to be seen: a centre beyond the frame, a box larger
    /// than the frame.
    pub(super) fn of(state: [f64; STATE], (columns, rows): (usize, usize)) -> Option<Place> {
        let [x, y, _, _, width, height] = state;
        let (columns, rows) = (columns as f64, rows as f64);
        let (width, height) = (width.round().max(2.0), height.round().max(2.0));
        let is_seen = (0.0..=columns).contains(&x) && (0.0..=rows).contains(&y);
        (is_seen && width <= columns.max(2.0) && height <= rows.max(2.0)).then(|| Place {
            x: (x - width / 2.0).round() as isize,
            y: (y - height / 2.0).round() as isize,
            width: width as usize,
            height: height as usize,
        })
    }

    fn right(self) -> isize {
        self.x + self.width as isize
    }

    fn bottom(self) -> isize {
        self.y + self.height as isize
    }

    fn between(x: isize, y: isize, right: isize, bottom: isize) -> Place {
        let side = |from: isize, to: isize| usize::try_from(to - from).unwrap_or(0);
        Place { x, y, width: side(x, right), height: side(y, bottom) }
    }

    /// The smallest box about all of these.
    pub(super) fn about(places: impl IntoIterator<Item = Place>) -> Option<Place> {
        places.into_iter().reduce(|a, b| {
            let (right, bottom) = (a.right().max(b.right()), a.bottom().max(b.bottom()));
            Place::between(a.x.min(b.x), a.y.min(b.y), right, bottom)
        })
    }

    /// It with `margin` pixels more on every side, as far as they are on the frame: at least the pixel
    /// nearest to it.
    pub(super) fn on_frame(self, margin: usize, (columns, rows): (usize, usize)) -> Place {
        let (margin, columns, rows) = (margin as isize, columns as isize, rows as isize);
        let x = (self.x - margin).clamp(0, columns - 1);
        let y = (self.y - margin).clamp(0, rows - 1);
        let right = (self.right() + margin).clamp(x + 1, columns);
        let bottom = (self.bottom() + margin).clamp(y + 1, rows);
        Place::between(x, y, right, bottom)
    }

    /// Whether it lies in another.
    pub(super) fn is_in(self, larger: Place) -> bool {
        Place::about([self, larger]) == Some(larger)
    }

    /// Where its upper left corner lies in a larger box, columns and rows.
    pub(super) fn within(self, larger: Place) -> (usize, usize) {
        let along = |from: isize, to: isize| usize::try_from(to - from).unwrap_or(0);
        (along(larger.x, self.x), along(larger.y, self.y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_looks_at_whole_pixels() {
        let place = Place::of([175.0, 150.0, 9.0, 9.0, 114.0, 162.0], (352, 288)).unwrap();
        assert_eq!(place, Place { x: 118, y: 69, width: 114, height: 162 });
        assert!(Place::of([-0.5, 150.0, 0.0, 0.0, 8.0, 8.0], (352, 288)).is_none());
        assert!(Place::of([5.0, f64::NAN, 0.0, 0.0, 8.0, 8.0], (352, 288)).is_none());
        assert!(Place::of([5.0, 5.0, 0.0, 0.0, 353.0, 8.0], (352, 288)).is_none());
    }

    #[test]
    fn boxes_unite_and_stay_on_the_frame() {
        let a = Place { x: -3, y: 2, width: 5, height: 4 };
        let b = Place { x: 1, y: 0, width: 3, height: 3 };
        let both = Place::about([a, b]).unwrap();
        assert_eq!(both, Place { x: -3, y: 0, width: 7, height: 6 });
        assert_eq!(b.within(both), (4, 0));
        assert!(a.is_in(both) && b.is_in(both) && !both.is_in(a));
        assert_eq!(both.on_frame(1, (100, 5)), Place { x: 0, y: 0, width: 5, height: 5 });
        let beyond = Place { x: 120, y: -9, width: 4, height: 4 };
        assert_eq!(beyond.on_frame(2, (100, 50)), Place { x: 99, y: 0, width: 1, height: 1 });
    }
}
