//! The thesis's two ways from a window to a place, step by step (its sections 4.5.1 and 4.5.2).

use super::ThesisSettings;
use crate::operator::{
    Element, Neighbours, absolute_difference, and, area_open, clear_border, components, crop, dilate,
    fill_holes, grey, threshold, xor,
};
use crate::rgbd::{Depth, RgbdFrame};
use crate::{Frame, Image, Result};
use serde::{Deserialize, Serialize};

/// How the difference of two pictures is taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Difference {
    /// Empty room less scene, nothing below 0, as the thesis does: what is brighter than the room vanishes.
    #[default]
    Saturating,
    /// Without its sign.
    Absolute,
}

/// How two masks become one. The thesis lost the word.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Logic {
    /// One or the other, not both: of two thresholds of one picture what lies between them.
    #[default]
    Xor,
    /// Both.
    And,
}

impl Logic {
    fn of(self, a: &Image<u8>, b: &Image<u8>) -> Result<Image<u8>> {
        match self {
            Logic::Xor => xor(a, b),
            Logic::And => and(a, b),
        }
    }
}

/// What a step made, for people to look at.
#[derive(Clone, Debug)]
pub enum Picture {
    /// Colours.
    Colour(Frame),
    /// Levels, or a mask.
    Grey(Image<u8>),
}

impl Picture {
    /// As a frame.
    pub fn frame(&self) -> Frame {
        match self {
            Picture::Colour(frame) => frame.clone(),
            Picture::Grey(image) => image.map(|&v| [v; 3]),
        }
    }
}

/// Gets the pictures of the steps by their names in the thesis: `I1A`, `I2`, ...
pub type Show<'a> = &'a mut dyn FnMut(&'static str, Picture);

/// The window about a place: its first column and row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Window {
    pub(super) left: isize,
    pub(super) top: isize,
    pub(super) side: usize,
}

impl Window {
    pub(super) fn about([x, y]: [f64; 2], side: usize) -> Window {
        let first = |v: f64| (v - side as f64 / 2.0).round() as isize;
        Window { left: first(x), top: first(y), side }
    }

    /// The part of a picture; beyond its border, the nearest pixels.
    fn of<P: Copy>(&self, image: &Image<P>) -> Image<P> {
        crop(image, self.left, self.top, self.side, self.side)
    }
}

/// The middle of the largest component of a mask in a window.
fn largest(mask: &Image<u8>, window: Window, show: Option<Show<'_>>, step: &'static str) -> Option<[f64; 2]> {
    let parts = components(mask, Neighbours::Eight);
    let (number, best) = parts
        .all
        .iter()
        .enumerate()
        .reduce(|best, next| if next.1.area > best.1.area { next } else { best })?;
    if let Some(show) = show {
        show(
            step,
            Picture::Grey(parts.labels.map(|&label| if label == number as u32 + 1 { 255 } else { 0 })),
        );
    }
    Some([window.left as f64 + best.centroid[0], window.top as f64 + best.centroid[1]])
}

/// The steps I1 to I11 of colour: where the hand is, if anything is left.
pub(super) fn colour(
    settings: &ThesisSettings,
    (frame, room): (&RgbdFrame, &Frame),
    window: Window,
    mut show: Option<Show<'_>>,
) -> Result<Option<[f64; 2]>> {
    let mut tell = |step, picture: &dyn Fn() -> Picture| {
        if let Some(show) = show.as_deref_mut() {
            show(step, picture());
        }
    };
    let (room, scene) = (window.of(room), window.of(&frame.colour));
    tell("I1A", &|| Picture::Colour(room.clone()));
    tell("I1B", &|| Picture::Colour(scene.clone()));
    let less = |a: u8, b: u8| match settings.difference {
        Difference::Saturating => a.saturating_sub(b),
        Difference::Absolute => a.abs_diff(b),
    };
    let pixels = room.pixels().iter().zip(scene.pixels());
    let difference = Frame::new(
        window.side,
        window.side,
        pixels.map(|(a, b)| std::array::from_fn(|c| less(a[c], b[c]))).collect(),
    )?;
    tell("I2", &|| Picture::Colour(difference.clone()));
    let levels = grey(&difference);
    tell("I3", &|| Picture::Grey(levels.clone()));
    let low = threshold(&levels, settings.colour_thresholds[0]);
    tell("I4", &|| Picture::Grey(low.clone()));
    let high = threshold(&levels, settings.colour_thresholds[1]);
    tell("I5", &|| Picture::Grey(high.clone()));
    let band = settings.thresholds_by.of(&low, &high)?;
    tell("I6", &|| Picture::Grey(band.clone()));
    let large = area_open(&band, settings.colour_area, Neighbours::Eight);
    tell("I7", &|| Picture::Grey(large.clone()));
    let filled = fill_holes(&large, Neighbours::Four);
    tell("I8", &|| Picture::Grey(filled.clone()));
    let grown = dilate(&filled, &Element::ellipse(settings.colour_grow, settings.colour_grow)?);
    tell("I9", &|| Picture::Grey(grown.clone()));
    let free = clear_border(&grown, Neighbours::Eight);
    tell("I10", &|| Picture::Grey(free.clone()));
    Ok(largest(&free, window, show, "I11"))
}

/// A mask of a window that the next frame is compared with.
#[derive(Clone, Debug)]
pub(super) struct Before {
    mask: Image<u8>,
    window: Window,
}

/// The steps I1 to I12 of depth: where the hand is, if anything is left. Frames are compared where both windows show the
/// same place of the picture.
pub(super) fn depth(
    settings: &ThesisSettings,
    (frame, room): (&RgbdFrame, &Depth),
    window: Window,
    before: &mut Option<Before>,
    mut show: Option<Show<'_>>,
) -> Result<Option<[f64; 2]>> {
    let mut tell = |step, picture: &dyn Fn() -> Picture| {
        if let Some(show) = show.as_deref_mut() {
            show(step, picture());
        }
    };
    // 12 bits to 8.
    let eight = |v: &u16| (v / 16).min(255) as u8;
    let (room, scene) = (window.of(room), window.of(&frame.depth));
    tell("I1A", &|| Picture::Grey(room.map(eight)));
    tell("I1B", &|| Picture::Grey(scene.map(eight)));
    let pixels = room.pixels().iter().zip(scene.pixels());
    let difference =
        Depth::new(window.side, window.side, pixels.map(|(a, b)| a.saturating_sub(*b)).collect())?;
    let levels = difference.map(eight);
    tell("I2", &|| Picture::Grey(levels.clone()));
    tell("I3", &|| Picture::Grey(levels.clone()));
    let low = threshold(&levels, settings.depth_thresholds[0]);
    tell("I4", &|| Picture::Grey(low.clone()));
    let high = threshold(&levels, settings.depth_thresholds[1]);
    tell("I5", &|| Picture::Grey(high.clone()));
    let band = settings.thresholds_by.of(&low, &high)?;
    tell("I6", &|| Picture::Grey(band.clone()));
    let last = before.replace(Before { mask: band.clone(), window });
    let moved = match last {
        Some(last) if last.window.side == window.side => {
            let (dx, dy) = (window.left - last.window.left, window.top - last.window.top);
            absolute_difference(&crop(&last.mask, dx, dy, window.side, window.side), &band)?
        }
        _ => band.clone(),
    };
    tell("I7", &|| Picture::Grey(moved.clone()));
    let filled = fill_holes(&moved, Neighbours::Four);
    tell("I8", &|| Picture::Grey(filled.clone()));
    let grown = dilate(&filled, &Element::ellipse(settings.depth_grow, settings.depth_grow)?);
    tell("I9", &|| Picture::Grey(grown.clone()));
    let holes = settings.holes_by.of(&grown, &band)?;
    tell("I10", &|| Picture::Grey(holes.clone()));
    let free = clear_border(&holes, Neighbours::Eight);
    tell("I11", &|| Picture::Grey(free.clone()));
    Ok(largest(&free, window, show, "I12"))
}
