//! What the filters say of places, as the likelihood of particles.

use crate::Rect;
use zerre::Time;
use zerre::kernels::Simd;
use zerre::math::Real;
use zerre::model::{Likelihood, Motion};

/// Responses over a window: those of boxes whose centre is in the middle of its cells.
#[derive(Clone, Debug, Default)]
pub struct Map {
    /// The window, pixels.
    pub window: Rect,
    /// Cells of a side.
    pub side: usize,
    /// Responses, row after row.
    pub values: Vec<f32>,
}

impl Map {
    /// Where a cell stands in the frame; cells may be counted in fractions.
    pub fn place(&self, x: f64, y: f64) -> [f64; 2] {
        let per_cell = self.window.width / self.side as f64;
        // The window's middle is the shift 0, which stands in cell side / 2.
        let half = (self.side / 2) as f64;
        let [cx, cy] = self.window.centre();
        [cx + (x - half) * per_cell, cy + (y - half) * per_cell]
    }

    fn at(&self, x: isize, y: isize) -> f64 {
        let inside = |v: isize| v.clamp(0, self.side as isize - 1) as usize;
        f64::from(self.values[inside(y) * self.side + inside(x)])
    }

    /// The response at a place in the frame, between cells by a plane in each direction; `None` outside the window.
    pub fn response(&self, [x, y]: [f64; 2]) -> Option<f64> {
        let per_cell = self.window.width / self.side as f64;
        let half = (self.side / 2) as f64;
        let [cx, cy] = self.window.centre();
        let (u, v) = ((x - cx) / per_cell + half, (y - cy) / per_cell + half);
        let last = self.side as f64 - 1.0;
        if !(0.0..=last).contains(&u) || !(0.0..=last).contains(&v) {
            return None;
        }
        let (i, j) = (u.floor(), v.floor());
        let (fu, fv) = (u - i, v - j);
        let (i, j) = (i as isize, j as isize);
        let top = (1.0 - fu) * self.at(i, j) + fu * self.at(i + 1, j);
        let bottom = (1.0 - fu) * self.at(i, j + 1) + fu * self.at(i + 1, j + 1);
        Some((1.0 - fv) * top + fv * bottom)
    }

    /// The highest response and its place, by a parabola through the neighbours of its cell.
    pub fn peak(&self) -> (f64, [f64; 2]) {
        let mut best = (f32::MIN, 0);
        for (i, value) in self.values.iter().enumerate() {
            if *value > best.0 {
                best = (*value, i);
            }
        }
        let (x, y) = ((best.1 % self.side) as isize, (best.1 / self.side) as isize);
        let middle = f64::from(best.0);
        let refine = |before: f64, after: f64| {
            let curve = before - 2.0 * middle + after;
            if curve < -1e-9 { (0.5 * (before - after) / curve).clamp(-0.5, 0.5) } else { 0.0 }
        };
        let dx = refine(self.at(x - 1, y), self.at(x + 1, y));
        let dy = refine(self.at(x, y - 1), self.at(x, y + 1));
        (middle, self.place(x as f64 + dx, y as f64 + dy))
    }

    /// How far the peak stands out: its height above the mean of the cells that are not near it, in their standard
    /// deviations.
    pub fn prominence(&self, reach: usize) -> f64 {
        let (mut best, mut at) = (f32::MIN, 0);
        for (i, value) in self.values.iter().enumerate() {
            if *value > best {
                (best, at) = (*value, i);
            }
        }
        let (x, y) = (at % self.side, at / self.side);
        let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0_f64);
        for (i, value) in self.values.iter().enumerate() {
            if (i % self.side).abs_diff(x) > reach || (i / self.side).abs_diff(y) > reach {
                sum += f64::from(*value);
                squares += f64::from(*value) * f64::from(*value);
                count += 1.0;
            }
        }
        let mean = sum / count.max(1.0);
        let variance = (squares / count.max(1.0) - mean * mean).max(1e-12);
        (f64::from(best) - mean) / variance.sqrt()
    }
}

/// The likelihood of places: a response is worth so many nats.
#[derive(Clone, Copy, Debug)]
pub struct Responses {
    /// What one unit of the response says, nats.
    pub sharpness: f64,
}

impl Likelihood<2> for Responses {
    type Value = [Map];
    type Digest<'z> = (f64, &'z [Map]);

    fn digest<'z>(&'z self, maps: &'z [Map], _: Time) -> zerre::Result<(f64, &'z [Map])> {
        Ok((self.sharpness, maps))
    }

    /// The best response of the windows that a place is in; a place that no window shows is as likely as the mean of the
    /// first one.
    fn score((sharpness, maps): &(f64, &[Map]), _: Simd, states: &[&[f64]; 2], out: &mut [f64]) {
        let ground = maps.first().map_or(0.0, |map| {
            map.values.iter().map(|v| f64::from(*v)).sum::<f64>() / map.values.len().max(1) as f64
        });
        for (i, out) in out.iter_mut().enumerate() {
            let place = [states[0][i], states[1][i]];
            let seen = maps.iter().filter_map(|map| map.response(place));
            *out = sharpness * seen.reduce(f64::max).unwrap_or(ground);
        }
    }
}

/// A place that wanders.
#[derive(Clone, Copy, Debug)]
pub struct Wander {
    /// Standard deviation of a step, pixels.
    pub sd: f64,
}

impl Motion<2, 2> for Wander {
    type Step = Wander;

    fn over(&self, _: Time, _: Time) -> zerre::Result<Wander> {
        Ok(*self)
    }

    #[inline(always)]
    fn apply<R: Real>(step: &Wander, x: [R; 2], noise: [R; 2]) -> [R; 2] {
        [x[0] + noise[0] * step.sd, x[1] + noise[1] * step.sd]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map() -> Map {
        let values = (0..64).map(|i| {
            let (x, y) = ((i % 8) as f32 - 4.5, (i / 8) as f32 - 3.25);
            1.0 - 0.1 * (x * x + y * y)
        });
        let window = Rect { x: 100.0, y: 50.0, width: 80.0, height: 80.0 };
        Map { window, side: 8, values: values.collect() }
    }

    /// A parabola's peak is found exactly; ten pixels are a cell, and cell 4 is the window's middle.
    #[test]
    fn peaks_are_between_cells() {
        let (value, [x, y]) = map().peak();
        assert!((x - 145.0).abs() < 1e-4 && (y - 82.5).abs() < 1e-4, "{x} {y}");
        assert!(value > 0.9);
    }

    #[test]
    fn responses_are_those_of_cells_and_planes_between() {
        let map = map();
        let at = |x: usize, y: usize| f64::from(map.values[y * 8 + x]);
        assert!((map.response([140.0, 90.0]).unwrap() - at(4, 4)).abs() < 1e-9);
        assert!((map.response([145.0, 90.0]).unwrap() - 0.5 * (at(4, 4) + at(5, 4))).abs() < 1e-9);
        assert_eq!(map.response([99.0, 90.0]), None);
    }

    /// With the particles everywhere, the best place weighs most, and a place that no window shows is as the mean.
    #[test]
    fn places_are_as_likely_as_they_respond() {
        let maps = [map()];
        let sensor = Responses { sharpness: 3.0 };
        let digest = sensor.digest(&maps, Time::ZERO).unwrap();
        let columns = [vec![145.0, 110.0, 0.0], vec![82.5, 60.0, 0.0]];
        let mut out = [0.0; 3];
        Responses::score(&digest, Simd::scalar(), &[&columns[0], &columns[1]], &mut out);
        let mean = maps[0].values.iter().map(|v| f64::from(*v)).sum::<f64>() / 64.0;
        assert!(out[0] > out[1] && (out[2] - 3.0 * mean).abs() < 1e-9, "{out:?}");
    }
}
