//! The page.

use super::methods::METHODS;
use super::pictures::{Film, printed_beside_truth};
use super::scenario::{ClutterModel, Record, Start, truth};
use super::settings::{
    CLUTTER_SCANS, FAILED_CENTROID, FAILED_IOU, OTHER_RATE, OTHER_RATE_SCANS, OUTLINE, RATE, SCANS,
};
use super::tables::Results;
use super::{Cell, PAPER, RECORDED, printed};
use crate::report::study::{Grid, Section, Shown, StudyReport};
use crate::study::interval;
use std::error::Error;

type Fallible<T> = Result<T, Box<dyn Error>>;

/// A share of runs from which on a result is usual.
const USUAL: f64 = 0.2;

impl Results<'_> {
    /// The whole page, for a run that was `interrupted` or came to its end; `first` gives the first recording of a cell.
    ///
    /// # Errors
    /// None with the settings as they are.
    pub(super) fn page(
        &self,
        seed: u64,
        interrupted: bool,
        first: &dyn Fn(&Cell) -> zerre::Result<Record>,
        films: &[Film],
    ) -> Fallible<StudyReport> {
        let facts = [
            ("Runs per cell", self.request.runs.to_string()),
            ("Particles, where there are any", self.request.particles.to_string()),
            ("Seed", seed.to_string()),
            ("Data", "simulated here".to_owned()),
        ];
        let mut sections = vec![self.chances()?, introduction(interrupted)];
        let asked = PAPER.tables.iter().filter(|t| self.request.tables.contains(**t) && **t != RECORDED);
        sections.extend(asked.map(|table| self.scores(table)));
        sections.extend(self.pictures(first, films)?);
        Ok(StudyReport {
            title: "An extended target and its shape".to_owned(),
            facts: facts.map(|(name, value)| (name.to_owned(), value)).to_vec(),
            sections,
            ..StudyReport::default()
        })
    }

    /// How likely the printed run is.
    fn chances(&self) -> Fallible<Section> {
        let found = printed::errors(&truth()?)?;
        let mut paragraphs = vec![format!(
            "The paper prints the shape of a single run of {} scans, the second table below. Its shape error, the mean \
             relative error of the three extents, is {:.3}, its mean Gauss-Wasserstein distance {:.2} m, and its centre is \
             {:.2} m off, which is taken off before. A run of ours is as good where its shape error is no larger. Shares \
             of runs have 95 % intervals by Wilson.",
            SCANS[0],
            found.extent,
            found.gauss_wasserstein,
            found.gauge[0].hypot(found.gauge[1]),
        )];
        let mut shares = Vec::new();
        for cell in self.cells.iter().filter(|cell| cell.clutter == 0) {
            let share = self.measured(cell, "as_good");
            shares.extend(share.map(|share| Share { cell: *cell, runs: self.runs(cell).len(), share }));
        }
        paragraphs.extend(verdict(&shares));
        paragraphs.extend(within_reach(&shares));
        let columns = [(RATE, &SCANS[..]), (OTHER_RATE, &OTHER_RATE_SCANS[..])];
        let columns: Vec<(usize, usize)> =
            columns.iter().flat_map(|(rate, scans)| scans.iter().map(|n| (*rate, *n))).collect();
        let head = columns.iter().map(|(rate, scans)| format!("{scans} scans of {rate}"));
        let mut rows = Vec::new();
        for info in METHODS {
            let of = |(rate, scans): &(usize, usize)| {
                let wanted = |share: &&Share| {
                    let cell = share.cell;
                    cell.info().name == info.name
                        && (cell.rate, cell.scans) == (*rate, *scans)
                        && share.is_main()
                };
                shares.iter().find(wanted).map_or("–".into(), |share| percents(share.share))
            };
            let shown: Vec<Shown> = columns.iter().map(of).collect();
            if shown.iter().any(|shown| !shown.aside.is_empty()) {
                rows.push(std::iter::once(info.name.into()).chain(shown).collect());
            }
        }
        let chances = Grid {
            caption: "Runs as good as the printed one, by scans and points in each, from the start near (the oracle \
                      knows the truth)"
                .to_owned(),
            head: std::iter::once("method".to_owned()).chain(head).collect(),
            rows,
        };
        Ok(Section {
            title: "How likely the printed numbers are".to_owned(),
            paragraphs,
            tables: vec![chances, printed_shape()?],
            figures: vec![printed_beside_truth()?],
            ..Section::default()
        })
    }

    /// A table.
    fn scores(&self, table: &str) -> Section {
        let cells = self.of_table(table);
        let scans: Column = ("scans", |cell| cell.scans.to_string());
        let (title, tables) = match table {
            "scene" => {
                let of_start = |start: &Start| {
                    let cells: Vec<Cell> =
                        cells.iter().filter(|cell| cell.start == *start).copied().collect();
                    self.grid(&format!("Start {}", start.name()), scans, &cells)
                };
                ("The paper's scene", Start::ALL.iter().map(of_start).collect())
            }
            "clutter" => {
                let about = format!(
                    "{CLUTTER_SCANS} scans from the start near, points of clutter in each: their rate known, learnt, or \
                     clutter ignored"
                );
                let clutter: Column = ("clutter", |cell| format!("{}, {}", cell.clutter, cell.model.name()));
                ("Clutter", vec![self.grid(&about, clutter, &cells)])
            }
            _ => {
                let about = format!("{OTHER_RATE} points a scan, from the start near");
                ("The other reading of the rate", vec![self.grid(&about, scans, &cells)])
            }
        };
        let longest = cells.iter().map(|cell| cell.scans).max().unwrap_or_default();
        let present = |method: usize| cells.iter().any(|cell| cell.method == method);
        let all = METHODS.iter().enumerate();
        let short = all.filter(|(method, info)| info.longest < longest && present(*method)).map(|(_, info)| {
            format!(
                "{} is given recordings of {} scans only: longer ones would take it several times what all other \
                 methods take together.",
                info.name, info.longest
            )
        });
        Section { title: title.to_owned(), paragraphs: short.collect(), tables, ..Section::default() }
    }

    /// Rows of cells: method, a column that tells its cells apart, metrics.
    fn grid(&self, about: &str, (name, of): Column, cells: &[Cell]) -> Grid {
        let learns = cells.iter().any(|cell| cell.model == ClutterModel::Learnt);
        let last =
            if learns { ("error of the rate", "clutter_error") } else { ("Hausdorff (m)", "hausdorff") };
        let metrics = [
            ("shape error", "shape_error"),
            ("GW (m)", "gw"),
            ("IoU", "iou"),
            ("failed runs", "fail"),
            ("centroid (m)", "centroid_rmse"),
            ("MW (m)", "mixture_wasserstein"),
            last,
        ];
        let row = |cell: &Cell| {
            let numbers = metrics.iter().map(|(_, metric)| shown(metric, self.measured(cell, metric)));
            [cell.info().name.into(), of(cell).as_str().into()].into_iter().chain(numbers).collect()
        };
        let head = ["method", name].into_iter().chain(metrics.iter().map(|(name, _)| *name));
        Grid {
            caption: format!(
                "{about}. Medians over runs with 95 % bootstrap intervals, shares of runs with those of Wilson."
            ),
            head: head.map(str::to_owned).collect(),
            rows: cells.iter().map(row).collect(),
        }
    }
}

/// A column that tells cells apart: its name and what it says of a cell.
type Column = (&'static str, fn(&Cell) -> String);

/// The share of the runs of a cell that are as good as the printed one.
struct Share {
    cell: Cell,
    runs: usize,
    share: interval::Estimate,
}

impl Share {
    /// From the start near, or from the only one that there is.
    fn is_main(&self) -> bool {
        self.cell.start == Start::Near || !self.cell.info().starts.contains(&Start::Near)
    }

    fn is_of_the_paper(&self) -> bool {
        (self.cell.rate, self.cell.scans) == (RATE, SCANS[0]) && self.is_main()
    }

    fn told(&self) -> String {
        let good = (self.share.value * self.runs as f64).round();
        format!("{good} of {} ({} to {} %)", self.runs, percent(self.share.low), percent(self.share.high))
    }
}

/// The scene of the paper, and what follows; nothing where it was not computed.
fn verdict(shares: &[Share]) -> Option<String> {
    let of_the_paper: Vec<&Share> = shares.iter().filter(|share| share.is_of_the_paper()).collect();
    let (oracle, methods): (Vec<&Share>, Vec<&Share>) =
        of_the_paper.into_iter().partition(|share| share.cell.start == Start::Truth);
    let oracle = oracle.first()?;
    let told = methods.iter().map(|share| format!("{} {}", share.cell.info().name, share.told()));
    let told: Vec<String> = told.collect();
    let so = if oracle.share.high < USUAL {
        "So the printed numbers are those of a lucky run, or of one with more data than the text says."
    } else if oracle.share.low > USUAL {
        "So the printed numbers are within the reach of usual runs."
    } else {
        "So few runs do not say whether the printed numbers are luck."
    };
    Some(format!(
        "Runs as good as that in the paper's own scene, {} scans of {RATE} points from the start near: {}. With the path and \
         the ellipse of every point known it is {}. {so}",
        SCANS[0],
        told.join(", "),
        oracle.told(),
    ))
}

/// Where the printed numbers are usual; nothing where they are nowhere.
fn within_reach(shares: &[Share]) -> Option<String> {
    let least = |info: &str, rate: usize| {
        let usual = |share: &&Share| {
            share.cell.info().name == info
                && share.cell.rate == rate
                && share.is_main()
                && share.share.value >= USUAL
        };
        shares.iter().filter(usual).map(|share| share.cell.scans).min()
    };
    let mut places = Vec::new();
    for info in METHODS.iter().filter(|info| info.starts.contains(&Start::Near)) {
        for rate in [RATE, OTHER_RATE] {
            if let Some(scans) = least(info.name, rate) {
                places.push(format!("{} at {scans} scans of {rate} points", info.name));
            }
        }
    }
    (!places.is_empty()).then(|| {
        format!("At least a fifth of the runs from the start near are as good with: {}.", places.join(", "))
    })
}

/// What the paper prints, beside the truth.
fn printed_shape() -> Fallible<Grid> {
    let (truth, printed) = (truth()?, printed::estimate()?);
    let pair = |[x, y]: [f64; 2]| format!("({x}, {y})").replace('-', "−");
    let row = |(k, (a, b)): (usize, (&zerre::extended::Ellipse, &zerre::extended::Ellipse))| {
        let extent = |e: &zerre::extended::Ellipse| {
            let [[xx, xy], [_, yy]] = e.extent.0;
            format!("{xx}, {xy}, {yy}").replace('-', "−")
        };
        let texts = [(k + 1).to_string(), pair(a.offset), pair(b.offset), extent(a), extent(b)];
        texts.iter().map(|text| Shown::from(text.as_str())).collect()
    };
    let head =
        ["ellipse", "offset (m), true", "offset, printed", "extent xx, xy, yy (m²), true", "extent, printed"];
    Ok(Grid {
        caption: "The printed estimate".to_owned(),
        head: head.map(str::to_owned).to_vec(),
        rows: truth.ellipses().iter().zip(printed.ellipses()).enumerate().map(row).collect(),
    })
}

fn introduction(interrupted: bool) -> Section {
    let mut paragraphs = vec![format!(
        "Every method sees the same recordings. The shape error is the mean over the ellipses of the error of an extent \
         relative to it (Frobenius), GW their mean Gauss-Wasserstein distance, both for the best assignment of ellipses \
         and with the common offset taken off, against which the centre moves unseen; methods with another number of \
         ellipses have neither. MW is the Wasserstein distance of the mixtures, IoU the intersection over union and \
         Hausdorff the distance of the outlines at {OUTLINE} standard deviations, all three in their places and after the \
         last scan. The centroid is the mean of a point; its root mean square error is over all scans. A run has failed where the \
         last IoU is below {FAILED_IOU}, where the last centroid is more than {FAILED_CENTROID} m off, or where the \
         method gave up."
    )];
    paragraphs.push(format!(
        "The start near is the paper's; data is made of the points of the first scans, which are then gone through again; \
         truth is the true shape. Methods of one ellipse or one outline begin with a circle and stand with the start near. \
         Where the paper says {RATE} points a scan it can mean the target or each of its ellipses: the first reading is \
         the main one."
    ));
    let methods = METHODS.iter().map(|method| format!("{}: {}.", method.name, method.about));
    if interrupted {
        paragraphs.push(
            "This run was stopped before its end: cells that are missing were not computed.".to_owned(),
        );
    }
    Section {
        title: "How to read this".to_owned(),
        paragraphs,
        points: methods.collect(),
        ..Section::default()
    }
}

fn shown(metric: &str, estimate: Option<interval::Estimate>) -> Shown {
    match estimate.filter(|_| metric == "fail") {
        Some(share) => percents(share),
        None => estimate.into(),
    }
}

fn percents(interval::Estimate { value, low, high }: interval::Estimate) -> Shown {
    let aside = format!("{} to {} %", percent(low), percent(high));
    Shown { aside, ..Shown::from(format!("{} %", percent(value)).as_str()) }
}

fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    if percent < 10.0 && percent.fract() > 0.0 { format!("{percent:.1}") } else { format!("{percent:.0}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::wilson_interval;

    fn share(name: &str, scans: usize, (good, runs): (usize, usize)) -> Share {
        let method = METHODS.iter().position(|info| info.name == name).unwrap();
        let cell = Cell::of_table("scene", method).into_iter().find(|cell| cell.scans == scans).unwrap();
        let (low, high) = wilson_interval(good, runs, 0.95).unwrap();
        let share = interval::Estimate { value: good as f64 / runs as f64, low, high };
        Share { cell, runs, share }
    }

    /// What is said follows from the counts.
    #[test]
    fn the_verdict_follows_from_the_runs() {
        let said = |oracle: (usize, usize)| {
            verdict(&[share("paper", 10, (0, 100)), share("oracle", 10, oracle)]).unwrap()
        };
        let lucky = said((4, 100));
        assert!(lucky.contains("paper 0 of 100 (0 to 3.7 %)"), "{lucky}");
        assert!(lucky.contains("known it is 4 of 100 (") && lucky.contains("lucky run"), "{lucky}");
        assert!(said((1, 20)).contains("So few runs"));
        assert!(said((60, 100)).contains("usual runs"));
        assert!(verdict(&[share("paper", 10, (0, 100))]).is_none());
    }

    #[test]
    fn the_least_data_are_named() {
        let shares = [
            share("window-vb", 100, (60, 100)),
            share("window-vb", 50, (30, 100)),
            share("paper", 10, (9, 100)),
        ];
        let said = within_reach(&shares).unwrap();
        assert!(said.contains("window-vb at 50 scans of 9 points.") && !said.contains("paper"), "{said}");
        assert!(within_reach(&shares[2..]).is_none());
    }
}
