//! Pictures like the figures of the thesis: trajectories, and particles on frames.

use super::settings::{BALLS, PICTURED_FRAMES, PICTURED_PARTICLES};
use super::work::{detector, follow};
use super::{MultiBall, Part};
use crate::balls::{BallScene, ShownBall};
use crate::report::overlay::{Drawn, pictured, shown};
use crate::report::study::{Figure, Picture, Series};
use std::error::Error;
use zerre::resample::Resampling;
use zerre_vision::balls::thesis::{ByArea, READINGS};

/// Width of the pictures, px.
const WIDTH: u16 = 480;
/// Particles that are drawn of each ball.
const DRAWN: usize = 300;

type Painted = (Picture, Vec<u8>);

impl MultiBall {
    /// Trajectories of the first clip at some sizes, and its frames with particles.
    ///
    /// # Errors
    /// A frame that cannot be encoded.
    pub(super) fn pictures(&self) -> Result<(Vec<Figure>, Vec<Painted>), Box<dyn Error>> {
        let luck = self.luck(Part::Table, 0);
        let Some(clip) = self.clip(0, &|| false)? else { return Ok(Default::default()) };
        let mut figures = Vec::new();
        for particles in PICTURED_PARTICLES {
            let followed = follow(&clip, &READINGS[0], particles, luck)?;
            // The palette begins with blue, orange and green: from the last ball on, these are nearest to theirs.
            let way = |(ball, name): (usize, &&str)| Series {
                name: (*name).to_owned(),
                points: followed.estimates.iter().map(|of| [of[ball][0], -of[ball][1]]).collect(),
                ..Series::default()
            };
            let mut series: Vec<Series> = BALLS.iter().enumerate().rev().map(way).collect();
            let detected = (0..BALLS.len()).flat_map(|ball| {
                let places = clip.detected.iter().filter_map(move |of| of[ball].map(|[x, y]| [x, -y]));
                // No line from the end of one way to the start of the next.
                places.chain([[f64::NAN; 2]])
            });
            series.push(Series {
                name: "detected".to_owned(),
                points: detected.collect(),
                reference: true,
                ..Series::default()
            });
            figures.push(Figure {
                title: format!("{particles} particles"),
                x: "x (px)".to_owned(),
                y: "-y (px)".to_owned(),
                map: true,
                series,
                ..Figure::default()
            });
        }
        let detector = detector(&clip.scene)?;
        let most = PICTURED_PARTICLES.into_iter().max().unwrap_or(1);
        let size = clip.scene.settings().size;
        let mut balls = ByArea::new(&READINGS[0], BALLS.len(), size, (most, Resampling::Multinomial), luck)?;
        let mut painted = Vec::new();
        let last = PICTURED_FRAMES.into_iter().max().unwrap_or(0).min(clip.scene.len());
        for k in 0..last {
            let frame = clip.scene.frame(k);
            balls.take(k, &detector.see(&frame)?)?;
            if !PICTURED_FRAMES.contains(&(k + 1)) {
                continue;
            }
            let shown_balls: Vec<ShownBall> = balls
                .balls()
                .map(|(row, radius, filter)| ShownBall {
                    number: row.ball,
                    centre: row.known.centre,
                    radius,
                    detected: row.detected.is_some(),
                    particles: filter.particles().take(DRAWN).collect(),
                })
                .collect();
            // Counted from 1, as in the thesis.
            let scene =
                BallScene { frame: &frame, index: k + 1, balls: &shown_balls, truth: clip.scene.truth(k) };
            let size = shown(frame.size(), WIDTH, WIDTH);
            let title = format!("Frame {}, {most} particles of each ball", k + 1);
            painted.push(pictured(&title, &format!("particles-{}.png", k + 1), &scene.draw(size)?)?);
        }
        Ok((figures, painted))
    }
}
