//! Outlines of targets over their points.

use super::plan::Frame;
use super::svg::{Escaped, dots, path, thinned};
use super::{Label, Outline, TrackSeries};
use crate::metric::Region;

/// Said beside a picture with outlines.
pub(super) const NOTE: &str = "Outlines are drawn where they fit beside each other along a track.";
/// And where they are of points.
pub(super) const OF_POINTS: &str = "Outlines are drawn where they fit beside each other along a track, with the points \
                                    of the scans that they are of.";

/// More outlines of a track say no more and make the file large.
const MOST: usize = 24;
/// Each is compared with all that are drawn.
const MOST_TRIED: usize = 2000;
/// Points of a scan that are drawn.
const MOST_POINTS: usize = 400;
/// Outlines lie so many of their lengths apart.
const APART: f64 = 1.1;

/// Which outlines of a track are drawn: the last one, and those before it that do not cover each other.
pub(super) fn chosen(track: &TrackSeries) -> Vec<usize> {
    let mut chosen: Vec<(usize, [f64; 2], f64)> = Vec::new();
    let places: Vec<usize> = thinned(track.outlines.len().min(track.position.len()), MOST_TRIED).collect();
    for at in places.into_iter().rev() {
        let (outline, place) = (&track.outlines[at], track.position[at]);
        let Some(length) = length(&outline.region).filter(|_| place.iter().all(|v| v.is_finite())) else {
            continue;
        };
        let clear = |(_, other, size): &(usize, [f64; 2], f64)| {
            let apart = (place[0] - other[0]).hypot(place[1] - other[1]);
            apart > APART * 0.5 * (length + size)
        };
        if chosen.iter().all(clear) {
            chosen.push((at, place, length));
        }
    }
    let kept = thinned(chosen.len(), MOST);
    let mut kept: Vec<usize> = kept.map(|i| chosen[i].0).collect();
    kept.reverse();
    kept
}

/// The diagonal of the box around a region, m; `None` where there is none.
fn length(region: &Region) -> Option<f64> {
    let [low, high] = region.corners()?;
    let length = (high[0] - low[0]).hypot(high[1] - low[1]);
    length.is_finite().then_some(length)
}

/// The outlines of a track that are drawn, and their points.
pub(super) fn draw(svg: &mut String, track: &TrackSeries, frame: &Frame) {
    let chosen: Vec<&Outline> = chosen(track).into_iter().map(|at| &track.outlines[at]).collect();
    if chosen.is_empty() {
        return;
    }
    for outline in &chosen {
        svg.push_str(&format!("<path class=\"outline\" d=\"{}\"/>", lines(&outline.region, frame)));
    }
    let points = chosen.iter().flat_map(|outline| {
        thinned(outline.points.len(), MOST_POINTS).map(|at| frame.place(outline.points[at]))
    });
    let points = dots(points);
    if !points.is_empty() {
        svg.push_str(&format!("<path class=\"point\" d=\"{points}\"/>"));
    }
}

/// What others say of an object, with its name where that can be read.
pub(super) fn label(svg: &mut String, label: &Label, frame: &Frame) {
    svg.push_str(&format!(
        "<g><title>{}</title><path class=\"truth\" d=\"{}\"/></g>",
        Escaped(&label.name),
        lines(&label.region, frame)
    ));
}

/// The lines around the parts of a region as closed paths.
fn lines(region: &Region, frame: &Frame) -> String {
    let closed = |line: Vec<[f64; 2]>| path(line.into_iter().map(|p| frame.place(p))) + "Z";
    region.lines().into_iter().map(closed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(at: [f64; 2], side: f64) -> Outline {
        let corner = |x: f64, y: f64| [at[0] + x * side, at[1] + y * side];
        let corners = vec![corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5)];
        Outline { region: Region::polygon(corners), points: Vec::new() }
    }

    fn track(places: &[[f64; 2]], side: f64) -> TrackSeries {
        TrackSeries {
            position: places.to_vec(),
            outlines: places.iter().map(|place| square(*place, side)).collect(),
            ..TrackSeries::default()
        }
    }

    #[test]
    fn drawn_outlines_do_not_cover_each_other_and_the_last_is_among_them() {
        let places: Vec<[f64; 2]> = (0..100).map(|k| [f64::from(k), 0.0]).collect();
        // Diagonals of 7.07 m: every eighth metre.
        let chosen = chosen(&track(&places, 5.0));
        assert_eq!(chosen.last(), Some(&99));
        assert!(chosen.windows(2).all(|pair| pair[1] - pair[0] == 8), "{chosen:?}");
    }

    #[test]
    fn a_target_that_stands_has_one_outline_and_one_that_comes_back_none_over_another() {
        let still = track(&[[1.0, 2.0]; 30], 4.0);
        assert_eq!(chosen(&still), [29]);
        let round: Vec<[f64; 2]> = (0..100).map(|k| [f64::from(k % 50), 0.0]).collect();
        let chosen = chosen(&track(&round, 5.0));
        assert!(chosen.iter().all(|at| *at >= 50), "{chosen:?}");
    }

    #[test]
    fn places_without_an_outline_have_none_drawn() {
        let mut gaps = track(&[[0.0, 0.0], [50.0, 0.0], [100.0, 0.0]], 5.0);
        gaps.outlines[1] = Outline::default();
        gaps.position[2][0] = f64::NAN;
        assert_eq!(chosen(&gaps), [0]);
        assert!(chosen(&TrackSeries::default()).is_empty());
    }
}
