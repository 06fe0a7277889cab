//! What runs look like: outlines over the path, and films of the shape as it is learnt.

use super::film::{SIZE, film};
use super::methods::{Estimate, METHODS};
use super::scenario::{Record, Start, near, truth};
use super::settings::{CLUTTER_SCANS, OUTLINE, RATE, SCANS};
use super::tables::Results;
use super::{Cell, printed};
use crate::metric::Region;
use crate::report::study::{Figure, Picture, Section, Series};
use std::error::Error;
use zerre::extended::Shape;

type Fallible<T> = Result<T, Box<dyn Error>>;
/// The first recording of a cell.
type First<'a> = &'a dyn Fn(&Cell) -> zerre::Result<Record>;

/// Methods whose learning is shown as a film.
const FILMED: [&str; 3] = ["window-vb", "rb-online-em", "paper"];
/// Scans from one outline to the next on the path: closer ones would cover each other.
const EVERY: usize = 3;

/// Cells of which pictures are drawn: in the paper's scene from the start `near`, as short as the paper's, and longer for
/// films.
pub(super) fn is_pictured(cell: &Cell) -> bool {
    let filmed = cell.scans == CLUTTER_SCANS && FILMED.contains(&cell.info().name);
    (cell.rate, cell.clutter, cell.start) == (RATE, 0, Start::Near) && (cell.scans == SCANS[0] || filmed)
}

/// A film and the method that it is of.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Film {
    method: &'static str,
    scans: usize,
    /// Name of its file.
    pub file: String,
    /// The file.
    pub bytes: Vec<u8>,
}

impl Results<'_> {
    /// A pictured cell with its estimates.
    fn pictured(&self, name: &str, scans: usize) -> Option<(&Cell, &[Estimate])> {
        let wanted = |cell: &&Cell| cell.info().name == name && cell.scans == scans && is_pictured(cell);
        let cell = self.cells.iter().find(wanted)?;
        let estimates = &self.outcomes.get(cell)?.pictured[..];
        (!estimates.is_empty()).then_some((cell, estimates))
    }

    /// The films.
    ///
    /// # Errors
    /// None with the settings as they are.
    pub(super) fn films(&self, first: First<'_>) -> Fallible<Vec<Film>> {
        let mut films = Vec::new();
        for method in FILMED {
            if let Some((cell, estimates)) = self.pictured(method, CLUTTER_SCANS) {
                let bytes = film(method, &first(cell)?, estimates)?;
                films.push(Film {
                    method,
                    scans: estimates.len(),
                    file: format!("shape-{method}.gif"),
                    bytes,
                });
            }
        }
        Ok(films)
    }

    /// What the first run looks like.
    pub(super) fn pictures(&self, first: First<'_>, films: &[Film]) -> Fallible<[Section; 2]> {
        let shown = |film: &Film| Picture {
            title: format!("{}: the first {} scans", film.method, film.scans),
            file: film.file.clone(),
            size: SIZE,
        };
        let learnt = Section {
            title: "The shape as it is learnt".to_owned(),
            paragraphs: vec![
                "Above the whole path with the outlines of some scans, below the target from close by with the points \
                 of the scan: the true outline dashed, the estimate in blue. Lines of the grid are 100 m apart above and \
                 10 m below."
                    .to_owned(),
            ],
            pictures: films.iter().map(shown).collect(),
            ..Section::default()
        };
        let mut figures = Vec::new();
        for info in METHODS {
            if let Some((cell, estimates)) = self.pictured(info.name, SCANS[0]) {
                figures.push(along_the_path(info.name, &first(cell)?, estimates)?);
            }
        }
        let paragraph = format!(
            "Outlines are drawn at {OUTLINE} standard deviations, along the path those of the first scan and of every \
             third after it with their points. All pictures and films are of the first run, whatever it came to, from \
             the start near and with {RATE} points a scan."
        );
        let outlines = Section {
            title: "Outlines along the path".to_owned(),
            paragraphs: vec![paragraph],
            figures,
            ..Section::default()
        };
        Ok([learnt, outlines])
    }
}

/// The true shape, the first one and the printed estimate.
///
/// # Errors
/// None with the settings as they are.
pub(super) fn printed_beside_truth() -> Fallible<Figure> {
    let of = |name: &str, shape: &Shape, reference: bool| Series {
        name: name.to_owned(),
        points: joined(&Region::of_shape(shape, [0.0; 2], OUTLINE)),
        reference,
        ..Series::default()
    };
    Ok(Figure {
        title: "Shapes about the centre".to_owned(),
        x: "x (m)".to_owned(),
        y: "y (m)".to_owned(),
        map: true,
        series: vec![
            of("printed estimate of the paper", &printed::estimate()?, false),
            of("start near", &near()?, false),
            of("truth", &truth()?, true),
        ],
        ..Figure::default()
    })
}

/// Points and outlines in their places.
fn along_the_path(name: &str, record: &Record, estimates: &[Estimate]) -> Fallible<Figure> {
    let truth = truth()?;
    let some = (0..estimates.len()).step_by(EVERY);
    let true_outlines = some.clone().flat_map(|k| {
        let [x, y, ..] = record.path[k];
        joined(&Region::of_shape(&truth, [x, y], OUTLINE))
    });
    let true_path = record.path.iter().map(|x| [x[0], x[1]]);
    let series = vec![
        Series {
            name: name.to_owned(),
            points: some.clone().flat_map(|k| joined(&estimates[k].region(OUTLINE, [0.0; 2]))).collect(),
            ..Series::default()
        },
        Series {
            name: "points".to_owned(),
            points: some.flat_map(|k| record.scans[k].iter().copied()).collect(),
            dots: true,
            ..Series::default()
        },
        Series {
            name: "its centroid".to_owned(),
            points: estimates.iter().map(Estimate::centroid).collect(),
            ..Series::default()
        },
        Series {
            name: "truth".to_owned(),
            points: true_path.chain([[f64::NAN; 2]]).chain(true_outlines).collect(),
            reference: true,
            ..Series::default()
        },
    ];
    Ok(Figure {
        title: format!("{name}: {} scans", estimates.len()),
        x: "x (m)".to_owned(),
        y: "y (m)".to_owned(),
        map: true,
        series,
        ..Figure::default()
    })
}

/// The lines around a region as one, interrupted between its parts.
fn joined(region: &Region) -> Vec<[f64; 2]> {
    region.lines().into_iter().flat_map(|line| line.into_iter().chain([[f64::NAN; 2]])).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{ExtendedTarget, Recordings, Request};
    use super::*;
    use crate::study::experiment::Experiment;

    /// Every method that has the start is pictured once on the path, and every film has its cell.
    #[test]
    fn pictures_have_their_cells() {
        let cells = ExtendedTarget::new(Request::new(true), Recordings::default(), 1).cells();
        let count = |name: &str, scans: usize| {
            let of = |cell: &&Cell| cell.info().name == name && cell.scans == scans && is_pictured(cell);
            cells.iter().filter(of).count()
        };
        for info in METHODS {
            let expected = usize::from(info.starts.contains(&Start::Near));
            assert_eq!(count(info.name, SCANS[0]), expected, "{}", info.name);
        }
        for name in FILMED {
            assert_eq!(count(name, CLUTTER_SCANS), 1, "{name}");
        }
    }
}
