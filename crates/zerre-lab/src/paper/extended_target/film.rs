//! The shape as it is learnt, as a GIF: above the path as a whole, below the target from close by.

use super::methods::Estimate;
use super::scenario::{Record, truth};
use super::settings::OUTLINE;
use crate::metric::Region;
use crate::report::animation::{Animation, Colour, Frame, Pen};
use zerre::extended::Shape;

/// Pixels across and down.
pub const SIZE: [u16; 2] = [640, 570];
const HEAD: u16 = 44;
const MAP: u16 = 190;
const CLOSE: u16 = 330;
/// Pixels of a metre from close by.
const CLOSE_SCALE: f64 = 13.0;
/// Metres between the lines of the grid from close by.
const GRID: f64 = 10.0;
/// Free space about the path, m: about as far as the target reaches.
const MARGIN: f64 = 22.0;
/// Scans between the outlines that stay on the map.
const EVERY: usize = 5;
/// Hundredths of a second that a frame stays, and the last one.
const STAYS: u16 = 20;
const LAST_STAYS: u16 = 300;

const GROUND: Colour = [252, 252, 250, 255];
const LINES: Colour = [228, 231, 234, 255];
const EDGE: Colour = [200, 205, 210, 255];
const INK: Colour = [28, 35, 43, 255];
const MUTED: Colour = [95, 106, 117, 255];
const FOUND: Colour = [0, 114, 178, 255];
const FOUND_INSIDE: Colour = [0, 114, 178, 34];
const FOUND_BEFORE: Colour = [0, 114, 178, 110];
const POINTS: Colour = [213, 94, 0, 255];

const fn pen(colour: Colour, width: f32) -> Pen {
    Pen { colour, width, dashed: false }
}

const TRUE_PEN: Pen = Pen { colour: INK, width: 1.3, dashed: true };
const FOUND_PEN: Pen = pen(FOUND, 2.2);

/// A piece of the plane as a part of a frame: pixels of a metre, and the place in the middle.
struct View {
    frame: Frame,
    size: [u16; 2],
    scale: f64,
    middle: [f64; 2],
}

impl View {
    fn new(size: [u16; 2], scale: f64, middle: [f64; 2]) -> crate::Result<View> {
        Ok(View { frame: Frame::new(size, GROUND)?, size, scale, middle })
    }

    fn place(&self, p: [f64; 2]) -> [f64; 2] {
        let [width, height] = self.size.map(f64::from);
        [
            0.5 * width + (p[0] - self.middle[0]) * self.scale,
            0.5 * height - (p[1] - self.middle[1]) * self.scale,
        ]
    }

    fn line(&mut self, points: impl IntoIterator<Item = [f64; 2]>, pen: Pen) {
        let places: Vec<_> = points.into_iter().map(|p| self.place(p)).collect();
        self.frame.line(places, pen);
    }

    fn dots(&mut self, points: &[[f64; 2]], radius: f32, colour: Colour) {
        let places: Vec<_> = points.iter().map(|p| self.place(*p)).collect();
        self.frame.dots(places, radius, colour);
    }

    fn region(&mut self, region: &Region, inside: Option<Colour>, pen: Pen) {
        for line in region.lines() {
            if let Some(colour) = inside {
                let places: Vec<_> = line.iter().map(|p| self.place(*p)).collect();
                self.frame.area(places, colour);
            }
            self.line(line, pen);
        }
    }

    /// A line along the upper edge, and lines that stay where they are while the middle moves on.
    fn grid(&mut self, step: f64) {
        let [width, height] = self.size.map(|pixels| 0.5 * f64::from(pixels) / self.scale);
        let lines = |middle: f64, half: f64| {
            let (first, last) = ((middle - half) / step, (middle + half) / step);
            (first.ceil() as i64..=last.floor() as i64).map(move |k| k as f64 * step)
        };
        let [x, y] = self.middle;
        for at in lines(x, width) {
            self.line([[at, y - height], [at, y + height]], pen(LINES, 1.0));
        }
        for at in lines(y, height) {
            self.line([[x - width, at], [x + width, at]], pen(LINES, 1.0));
        }
        self.line([[x - width, y + height], [x + width, y + height]], pen(EDGE, 2.0));
    }
}

/// What a method called `name` says of a recording, scan by scan.
///
/// # Errors
/// None with the settings as they are.
pub fn film(
    name: &str,
    record: &Record,
    estimates: &[Estimate],
) -> Result<Vec<u8>, Box<dyn std::error::Error>> {
    let truth = truth()?;
    let mut animation = Animation::new(SIZE)?;
    let count = estimates.len().min(record.path.len());
    for k in 0..count {
        let mut frame = Frame::new(SIZE, GROUND)?;
        head(&mut frame, name, (k + 1, count));
        let seen = Seen { record, estimates: &estimates[..=k], truth: &truth };
        frame.put(&seen.map()?.frame, [0, usize::from(HEAD)]);
        frame.put(&seen.close()?.frame, [0, usize::from(SIZE[1] - CLOSE)]);
        animation.push(&frame, if k + 1 == count { LAST_STAYS } else { STAYS })?;
    }
    Ok(animation.finish()?)
}

/// Name, legend and how far it has come.
fn head(frame: &mut Frame, name: &str, (scan, count): (usize, usize)) {
    let base = 28.0;
    frame.text([14.0, base], 12.0, name, INK);
    let mut left = 240.0;
    for (word, pen) in [("true", TRUE_PEN), ("estimate", FOUND_PEN)] {
        let y = f64::from(base) - 5.0;
        frame.line([[f64::from(left), y], [f64::from(left) + 24.0, y]], pen);
        left = frame.text([left + 32.0, base], 9.0, word, MUTED) + 22.0;
    }
    frame.dots([[f64::from(left), f64::from(base) - 5.0]], 3.0, POINTS);
    frame.text([left + 10.0, base], 9.0, "points", MUTED);
    frame.text([528.0, base], 9.0, &format!("scan {scan} of {count}"), MUTED);
    let done = f64::from(SIZE[0]) * scan as f64 / count as f64;
    frame.line([[0.0, 1.0], [done, 1.0]], pen(FOUND, 3.0));
}

/// What is known by a scan.
struct Seen<'a> {
    record: &'a Record,
    /// Up to this scan.
    estimates: &'a [Estimate],
    truth: &'a Shape,
}

impl Seen<'_> {
    fn true_region(&self, k: usize) -> Region {
        let [x, y, ..] = self.record.path[k];
        Region::of_shape(self.truth, [x, y], OUTLINE)
    }

    fn path(&self) -> Vec<[f64; 2]> {
        self.record.path.iter().map(|x| [x[0], x[1]]).collect()
    }

    fn found_path(&self) -> Vec<[f64; 2]> {
        self.estimates.iter().map(Estimate::centroid).collect()
    }

    /// The whole path, to scale, with the outlines of some scans.
    fn map(&self) -> crate::Result<View> {
        let path = self.path();
        let ends = |k: usize| {
            let all = path.iter().map(|p| p[k]);
            (
                all.clone().fold(f64::INFINITY, f64::min) - MARGIN,
                all.fold(f64::NEG_INFINITY, f64::max) + MARGIN,
            )
        };
        let (x, y) = (ends(0), ends(1));
        let scale = (f64::from(SIZE[0]) / (x.1 - x.0)).min(f64::from(MAP) / (y.1 - y.0));
        let middle = [0.5 * (x.0 + x.1), 0.5 * (y.0 + y.1)];
        let mut view = View::new([SIZE[0], MAP], scale, middle)?;
        view.grid(10.0 * GRID);
        view.line(path, Pen { width: 1.0, ..TRUE_PEN });
        let last = self.estimates.len() - 1;
        for k in (0..last).step_by(EVERY) {
            view.region(&self.estimates[k].region(OUTLINE, [0.0; 2]), None, pen(FOUND_BEFORE, 1.0));
        }
        view.line(self.found_path(), pen(FOUND, 1.4));
        view.region(&self.true_region(last), None, Pen { width: 1.0, ..TRUE_PEN });
        view.region(&self.estimates[last].region(OUTLINE, [0.0; 2]), Some(FOUND_INSIDE), pen(FOUND, 1.6));
        Ok(view)
    }

    /// The target with the points of the scan.
    fn close(&self) -> crate::Result<View> {
        let last = self.estimates.len() - 1;
        let [x, y, ..] = self.record.path[last];
        let mut view = View::new([SIZE[0], CLOSE], CLOSE_SCALE, [x, y])?;
        view.grid(GRID);
        view.line(self.path(), Pen { width: 1.0, ..TRUE_PEN });
        view.line(self.found_path(), pen(FOUND_BEFORE, 1.4));
        view.region(&self.estimates[last].region(OUTLINE, [0.0; 2]), Some(FOUND_INSIDE), FOUND_PEN);
        view.region(&self.true_region(last), None, TRUE_PEN);
        view.dots(&self.record.scans[last], 3.0, POINTS);
        Ok(view)
    }
}

#[cfg(test)]
mod tests {
    use super::super::methods::Body;
    use super::super::scenario::record;
    use super::super::settings::RATE;
    use super::*;
    use zerre::rng::Stream;

    /// A frame a scan, whole, whatever the estimates are.
    #[test]
    fn every_scan_has_its_frame() {
        let record = record(3, RATE, 0, Stream::new(1)).unwrap();
        let estimate = |x: &[f64; 4]| Estimate {
            centre: [x[0], x[1]],
            body: Body::Ellipses(truth().unwrap()),
            clutter: None,
        };
        let mut estimates: Vec<Estimate> = record.path.iter().map(estimate).collect();
        estimates[1] = Estimate { centre: [f64::NAN, 1e300], ..estimates[1].clone() };
        estimates[2].body = Body::Outline(vec![[-3.0, 0.0], [3.0, 0.0], [0.0, 4.0]]);
        let file = film("any", &record, &estimates).unwrap();
        let mut reader = gif::DecodeOptions::new().read_info(&file[..]).unwrap();
        assert_eq!([reader.width(), reader.height()], SIZE);
        let mut delays = Vec::new();
        while let Some(frame) = reader.read_next_frame().unwrap() {
            delays.push(frame.delay);
        }
        assert_eq!(delays, [STAYS, STAYS, LAST_STAYS]);
    }
}
