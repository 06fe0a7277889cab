//! Textures that are drawn: of things in clips and scenes.

use zerre::rng::Draws;

/// Colours that vary smoothly on several lengths, from random lattices.
#[derive(Clone, Debug)]
pub(crate) struct Texture {
    /// Their mean.
    pub(crate) base: [f64; 3],
    /// For each length (pixels) a lattice of 32 x 32 colours that repeats.
    octaves: Vec<(f64, f64, Vec<[f64; 3]>)>,
}

const LATTICE: usize = 32;

impl Texture {
    pub(crate) fn new(draws: &mut Draws, lengths: &[(f64, f64)]) -> Texture {
        let base = std::array::from_fn(|_| 60.0 + 135.0 * draws.uniform());
        let octaves = lengths
            .iter()
            .map(|&(length, strength)| {
                let colour = |_| std::array::from_fn(|_| draws.uniform() - 0.5);
                (length, strength, (0..LATTICE * LATTICE).map(colour).collect())
            })
            .collect();
        Texture { base, octaves }
    }

    /// Like another one, but for a share of its own.
    pub(crate) fn near(other: &Texture, draws: &mut Draws, share: f64) -> Texture {
        let mut near = other.clone();
        for (_, _, lattice) in &mut near.octaves {
            for colour in lattice {
                *colour = colour.map(|v| (1.0 - share) * v + share * (draws.uniform() - 0.5));
            }
        }
        near
    }

    pub(crate) fn at(&self, x: f64, y: f64) -> [f64; 3] {
        let mut colour = self.base;
        for (length, strength, lattice) in &self.octaves {
            let (u, v) = (x / length, y / length);
            let (i, j) = (u.floor(), v.floor());
            let (fu, fv) = (smooth(u - i), smooth(v - j));
            let point = |di: f64, dj: f64| {
                let wrap = |k: f64| k.rem_euclid(LATTICE as f64) as usize % LATTICE;
                &lattice[wrap(j + dj) * LATTICE + wrap(i + di)]
            };
            let (a, b, c, d) = (point(0.0, 0.0), point(1.0, 0.0), point(0.0, 1.0), point(1.0, 1.0));
            for k in 0..3 {
                let top = a[k] + fu * (b[k] - a[k]);
                let bottom = c[k] + fu * (d[k] - c[k]);
                colour[k] += strength * (top + fv * (bottom - top));
            }
        }
        colour
    }
}

fn smooth(t: f64) -> f64 {
    t * t * (3.0 - 2.0 * t)
}
