//! The likelihood: how much each box of a frame resembles the template.

use super::colour::{Bins, ColourTemplate, Counts, bin_of, span};
use super::motion::STATE;
use super::place::Place;
use super::settings::{AppearanceSettings, Equalisation, Similarity};
use super::structure::{Moments, Plane, StructureTemplate, Sums};
use crate::operator::{Clahe, blur, channel, crop, extended, grey, merge, patch};
use crate::{Frame, Image, Rect, Result};
use fearless_simd::{Level, dispatch};
use std::sync::{Mutex, PoisonError};
use zerre::Time;
use zerre::kernels::Simd;
use zerre::math::Real;
use zerre::math::gaussian::LN_2PI;
use zerre::model::Likelihood;

/// What boxes are compared with.
#[derive(Clone, Debug)]
pub(super) enum Template {
    Colour(ColourTemplate),
    Structure(Box<StructureTemplate>),
}

/// Memory that blocks of particles use one after the other.
#[derive(Debug, Default)]
pub(super) struct Memory {
    /// The frame, by its number, and the part of it that is in the memory.
    seen: Option<(i64, Place)>,
    picture: Option<(Image<u8>, Place)>,
    places: Vec<Option<Place>>,
    similarities: Vec<f64>,
    bins: Bins,
    counts: Counts,
    plane: Plane,
    moments: Moments,
    patch: Plane,
    patch_moments: Moments,
    sums: Sums,
}

/// Memory that no block uses at present.
#[derive(Debug, Default)]
pub(super) struct Spare(Mutex<Vec<Memory>>);

impl Spare {
    fn with<T>(&self, work: impl FnOnce(&mut Memory) -> T) -> T {
        let list = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut memory = list().pop().unwrap_or_default();
        let done = work(&mut memory);
        list().push(memory);
        done
    }
}

/// The row of a picture that begins at `from` which row `y` of `region` shows.
fn row_of<P>(picture: &Image<P>, from: Place, region: Place, y: usize) -> &[P] {
    let row = region.y + y as isize - from.y;
    picture.row(row.clamp(0, picture.height() as isize - 1) as usize)
}

/// The pixels of a box.
fn cut(frame: &Frame, place: Place) -> Frame {
    crop(frame, place.x, place.y, place.width, place.height)
}

impl AppearanceSettings {
    /// The part of the smoothed frame that `region` sees, and where it lies.
    fn colours(&self, frame: &Frame, region: Place) -> Result<(Frame, Place)> {
        let seen = region.on_frame(0, frame.size());
        let Some(size) = self.blur else { return Ok((cut(frame, seen), seen)) };
        // What the kernel reaches beyond the region is computed and not used.
        let wider = region.on_frame(size / 2, frame.size());
        let part = cut(frame, wider);
        let channels = [0, 1, 2].map(|i| blur(&channel(&part, i), size, None));
        let [red, green, blue] = channels;
        Ok((merge([&red?, &green?, &blue?])?, wider))
    }

    /// The part of the smoothed and equalised grey frame that `region` sees, and where it lies: as it is in
    /// the whole frame, of which no more is computed than decides it.
    fn greys(&self, frame: &Frame, region: Place) -> Result<(Image<u8>, Place)> {
        let seen = region.on_frame(0, frame.size());
        let Some(Equalisation { clip, tiles }) = self.equalisation else {
            return self.smooth_greys(frame, seen);
        };
        let clahe = Clahe::new(frame.size(), clip, tiles)?;
        let part = [seen.x as usize, seen.y as usize, seen.width, seen.height];
        let [x, y, width, height] = clahe.reach(part);
        let reach = Place { x: x as isize, y: y as isize, width, height };
        let (picture, from) = self.smooth_greys(frame, reach)?;
        Ok((clahe.part(&picture, (from.x as usize, from.y as usize), part), seen))
    }

    /// A part of the smoothed grey frame, with a margin that is not right, and where it lies.
    fn smooth_greys(&self, frame: &Frame, part: Place) -> Result<(Image<u8>, Place)> {
        let Some(size) = self.blur else { return Ok((grey(&cut(frame, part)), part)) };
        let wider = part.on_frame(size / 2, frame.size());
        Ok((blur(&grey(&cut(frame, wider)), size, None)?, wider))
    }

    fn bins(&self, frame: &Frame, region: Place, count: usize, bins: &mut Bins) -> Result<()> {
        let (picture, from) = self.colours(frame, region)?;
        let bin = bin_of(count);
        bins.reset(region.width, region.height);
        let count = count as u16;
        let number = |[r, g, b]: [u8; 3]| {
            let [r, g, b] = [r, g, b].map(|v| bin[usize::from(v)]);
            (r * count + g) * count + b
        };
        for y in 0..region.height {
            extended(row_of(&picture, from, region, y), region.x - from.x, bins.row_mut(y), number);
        }
        Ok(())
    }

    /// The grey values of a box in `plane`, and the picture that they are of with its place.
    fn plane(&self, frame: &Frame, region: Place, plane: &mut Plane) -> Result<(Image<u8>, Place)> {
        let (picture, from) = self.greys(frame, region)?;
        plane.reset(region.width, region.height);
        for y in 0..region.height {
            let to = &mut plane.row_mut(y)[..region.width];
            extended(row_of(&picture, from, region, y), region.x - from.x, to, f32::from);
        }
        Ok((picture, from))
    }
}

/// A box of a picture that begins at `from`, resampled to the template's size.
fn resampled(
    (picture, from): &(Image<u8>, Place),
    place: Place,
    size: (usize, usize),
    plane: &mut Plane,
) -> Result<()> {
    let [x, y] = [place.x - from.x, place.y - from.y].map(|v| v as f64);
    let bounds = Rect { x, y, width: place.width as f64, height: place.height as f64 };
    plane.copy_image(&patch(picture, bounds, size)?);
    Ok(())
}

impl Template {
    /// What a box of a frame shows.
    pub(super) fn new(frame: &Frame, place: Place, settings: &AppearanceSettings) -> Result<Template> {
        let size = (place.width, place.height);
        match settings.similarity {
            Similarity::Colour { bins: count, .. } => {
                let mut bins = Bins::default();
                settings.bins(frame, place, count, &mut bins)?;
                Ok(Template::Colour(ColourTemplate::new(count, &bins, (0, 0), size)))
            }
            Similarity::Structure { window, exponents, centre } => {
                let mut patch = Plane::default();
                settings.plane(frame, place, &mut patch)?;
                let template = StructureTemplate::new(size, (window, exponents, centre), patch);
                Ok(Template::Structure(Box::new(template)))
            }
        }
    }

    /// Makes the template (1 - rate) of itself and `rate` of what a box of a frame shows.
    pub(super) fn blend(
        &mut self,
        frame: &Frame,
        place: Place,
        settings: &AppearanceSettings,
        rate: f64,
    ) -> Result<()> {
        match self {
            Template::Colour(template) => {
                let mut bins = Bins::default();
                settings.bins(frame, place, template.bins(), &mut bins)?;
                template.blend(rate, &bins, (0, 0), (place.width, place.height));
            }
            Template::Structure(template) => {
                let (mut seen, mut patch) = (Plane::default(), Plane::default());
                let picture = settings.plane(frame, place, &mut seen)?;
                resampled(&picture, place, template.size(), &mut patch)?;
                template.blend(&patch, rate);
            }
        }
        Ok(())
    }
}

/// The image likelihood p(frame | box) = N(D; 0, sigma^2) (Dilmen and Talu 2017, equation 17), D being one
/// less the similarity with the template, or its root.
#[derive(Clone, Copy, Debug)]
pub(super) struct Resemblance<'a> {
    template: &'a Template,
    settings: &'a AppearanceSettings,
    spare: &'a Spare,
    /// Number of the frame.
    number: i64,
}

impl<'a> Resemblance<'a> {
    pub(super) fn new(
        template: &'a Template,
        settings: &'a AppearanceSettings,
        spare: &'a Spare,
        number: i64,
    ) -> Self {
        Resemblance { template, settings, spare, number }
    }

    /// Similarity of one box.
    pub(super) fn similarity(&self, frame: &Frame, place: Place) -> Result<f64> {
        self.spare.with(|memory| {
            memory.places.clear();
            memory.places.push(Some(place));
            self.compare(frame, memory)?;
            Ok(memory.similarities.first().copied().unwrap_or(0.0))
        })
    }

    /// Similarities of all places in the memory; 0 where there is nothing to be seen.
    fn compare(&self, frame: &Frame, memory: &mut Memory) -> Result<()> {
        memory.similarities.clear();
        memory.similarities.resize(memory.places.len(), 0.0);
        let Some(wanted) = Place::about(memory.places.iter().flatten().copied()) else { return Ok(()) };
        // What a part of the frame looks like does not depend on the part.
        let known = memory.seen.filter(|(number, region)| *number == self.number && wanted.is_in(*region));
        let region = known.map_or(wanted, |(_, region)| region);
        if known.is_none() {
            memory.seen = None;
            match self.template {
                Template::Colour(template) => {
                    self.settings.bins(frame, region, template.bins(), &mut memory.bins)?;
                }
                Template::Structure(template) => {
                    memory.picture = Some(self.settings.plane(frame, region, &mut memory.plane)?);
                    let Memory { plane, moments, sums, .. } = memory;
                    if template.shares_moments() {
                        dispatch!(Level::new(), _simd => moments.fill(plane, template.window(), sums));
                    }
                }
            }
            memory.seen = Some((self.number, region));
        }
        match self.template {
            Template::Colour(template) => {
                for (place, similarity) in memory.places.iter().zip(&mut memory.similarities) {
                    let Some(place) = *place else { continue };
                    let (at, size) = span(place, region);
                    *similarity = template.similarity(&memory.bins, at, size, &mut memory.counts);
                }
                Ok(())
            }
            Template::Structure(template) => {
                // The same code for every SIMD level, which the compiler widens; no result depends on the
                // width.
                dispatch!(Level::new(), _simd => structures(template, region, memory))
            }
        }
    }
}

/// Structural similarities of all places, whose grey values are those of `region`.
#[inline(always)]
fn structures(template: &StructureTemplate, region: Place, memory: &mut Memory) -> Result<()> {
    let Memory { places, similarities, picture, plane, moments, patch, patch_moments, sums, .. } = memory;
    let size = template.size();
    let is_whole = |place: &Place| (place.width, place.height) == size;
    let shares_moments = template.shares_moments();
    for (place, similarity) in places.iter().zip(similarities) {
        let Some(place) = *place else { continue };
        if shares_moments && is_whole(&place) {
            *similarity = template.similarity((plane, moments), place.within(region), sums);
            continue;
        }
        if is_whole(&place) {
            patch.copy(plane, place.within(region), size);
        } else if let Some(picture) = picture {
            resampled(picture, place, size, patch)?;
        }
        template.shade(patch);
        patch_moments.fill(patch, template.window(), sums);
        *similarity = template.similarity((patch, patch_moments), (0, 0), sums);
    }
    Ok(())
}

impl Likelihood<STATE> for Resemblance<'_> {
    type Value = Frame;
    type Digest<'z>
        = (Resemblance<'z>, &'z Frame)
    where
        Self: 'z;

    fn digest<'z>(&'z self, frame: &'z Frame, _: Time) -> zerre::Result<Self::Digest<'z>> {
        Ok((*self, frame))
    }

    fn score(
        (resemblance, frame): &(Resemblance<'_>, &Frame),
        _: Simd,
        states: &[&[f64]; STATE],
        out: &mut [f64],
    ) {
        let Resemblance { settings, spare, .. } = resemblance;
        let root = matches!(settings.similarity, Similarity::Colour { root: true, .. });
        let constant = -Real::ln(settings.sigma) - 0.5 * LN_2PI;
        spare.with(|memory| {
            memory.places.clear();
            let state = |i: usize| states.map(|column| column[i]);
            memory.places.extend((0..out.len()).map(|i| Place::of(state(i), frame.size())));
            if resemblance.compare(frame, memory).is_err() {
                // Parameters were held to be right when the tracker started; the filter counts what is no
                // number.
                return out.fill(f64::NAN);
            }
            for (score, similarity) in out.iter_mut().zip(&memory.similarities) {
                let distance = 1.0 - similarity;
                let square = if root { distance.max(0.0) } else { distance * distance };
                *score = constant - 0.5 * square / (settings.sigma * settings.sigma);
            }
        });
    }
}
