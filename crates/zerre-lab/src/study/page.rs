//! The page of a study.

use super::comparison::{Comparison, Entry, Measured, fronts, scheme, trigger};
use super::interval::mean_interval;
use super::spec::Metric;
use super::world::Place;
use crate::report::study::{Figure, Grid, Mark, Section, Shown, StudyReport};
use zerre::resample::{Resampling, Trigger};

/// Level of the family of comparisons with the first.
const LEVEL: f64 = 0.05;

impl Comparison {
    pub(super) fn page(&self, ranked: &[Vec<Measured<'_>>], interrupted: bool) -> StudyReport {
        let metrics: Vec<_> = self.metrics.iter().map(|metric| Comparison::metric(*metric).0).collect();
        let facts = [
            ("Runs per cell", self.runs.to_string()),
            ("Worlds", self.places.len().to_string()),
            ("Cells", self.entries.len().to_string()),
            ("Metrics", metrics.join(", ")),
            ("Seed", self.seed.to_string()),
        ];
        let mut sections = vec![self.summary(ranked, interrupted)];
        sections.extend(ranked.iter().zip(&self.places).map(|(all, place)| self.world(all, place)));
        StudyReport {
            title: "Filters compared".to_owned(),
            facts: facts.map(|(name, value)| (name.to_owned(), value)).to_vec(),
            sections,
            ..StudyReport::default()
        }
    }

    fn summary(&self, ranked: &[Vec<Measured<'_>>], interrupted: bool) -> Section {
        let mut paragraphs = vec![format!(
            "In every world the filters are ranked by their mean {} over the same runs. A filter counts as being as good as \
             the first if a paired t-test, corrected by Holm for all comparisons with the first, does not find it worse \
             at {} %. Intervals are 95 % ones of the mean (Student's t). Times are medians over runs of the processor \
             time of a step, while other runs shared the machine.",
            self.ranks_by(),
            100.0 * LEVEL
        )];
        if interrupted {
            paragraphs.push(
                "This run was stopped before its end: runs that are missing were not computed.".to_owned(),
            );
        }
        let points = ranked.iter().zip(&self.places).map(|(all, place)| self.verdict(all, place));
        Section { title: "Ranking".to_owned(), paragraphs, points: points.collect(), ..Section::default() }
    }

    fn ranks_by(&self) -> &'static str {
        match self.metrics.first() {
            Some(Metric::Crps) => "continuous ranked probability score",
            _ => "root mean square error",
        }
    }

    fn verdict(&self, all: &[Measured<'_>], place: &Place) -> String {
        let Some(first) = all.first().filter(|first| first.loss.is_some()) else {
            return format!("{}: nothing is measured.", told(place));
        };
        let priced =
            |m: &Measured<'_>| format!("{} ({} µs a step)", self.called(m), Shown::from(m.microseconds).text);
        let peers: Vec<&Measured<'_>> = all.iter().filter(|m| is_peer(m)).collect();
        let mut text = format!("{}: least error with {}", told(place), priced(first));
        let by_time = |m: &&&Measured<'_>| (m.microseconds * 1e3) as u64;
        match peers.iter().min_by_key(by_time) {
            Some(cheapest) if cheapest.microseconds < first.microseconds => {
                text += &format!("; as good and the fastest of {}: {}", peers.len() + 1, priced(cheapest));
            }
            Some(_) => text += &format!("; as good and slower: {} more", peers.len()),
            None => text += "; all others are worse",
        }
        text + "."
    }

    /// A filter with what of it differs from the defaults.
    fn called(&self, measured: &Measured<'_>) -> String {
        let Entry { contender, .. } = self.entries[measured.entry];
        let mut name = contender.filter.to_owned();
        if contender.particles > 0 {
            name += &format!(" with {}", contender.particles);
        }
        let words = [
            scheme(&contender).filter(|_| contender.resampling != Resampling::default()),
            trigger(&contender).filter(|_| contender.trigger != Trigger::default()),
        ];
        for word in words.into_iter().flatten() {
            name += &format!(", {word}");
        }
        name
    }

    fn world(&self, all: &[Measured<'_>], place: &Place) -> Section {
        let mut head = vec!["rank".to_owned(), "filter".to_owned()];
        head.extend(self.metrics.iter().map(|metric| Comparison::metric(*metric).0.to_owned()));
        let rest =
            ["worse by chance (p, Holm)", "failed runs", "evaluations a step", "µs a step", "on the front"];
        head.extend(rest.map(str::to_owned));
        let (by_time, by_evaluations) = fronts(all);
        let rows = all.iter().enumerate().map(|(at, measured)| {
            let mut name = Shown::from(self.called(measured).as_str());
            if let Some(reason) = measured.refusal {
                name.aside = "does not apply".to_owned();
                name.doubt = Some(reason.to_owned());
            } else if at > 0 && is_peer(measured) {
                name.aside = "as good as the first".to_owned();
            }
            let rank = if measured.loss.is_some() { (at + 1).to_string() } else { "–".to_owned() };
            let mut row = vec![Shown::from(rank.as_str()), name];
            row.extend(self.metrics.iter().map(|metric| {
                let of = Comparison::metric(*metric).1;
                let values: Vec<f64> = measured.runs.iter().filter_map(|run| of(run)).collect();
                mean_interval(&values).into()
            }));
            let failed = measured.runs.iter().filter(|run| run.degenerate > 0 || run.lost > 0).count();
            let share = (!measured.runs.is_empty()).then(|| failed as f64 / measured.runs.len() as f64);
            let fronts = match (by_time[at], by_evaluations[at]) {
                (true, true) => "time, evaluations",
                (true, false) => "time",
                (false, true) => "evaluations",
                (false, false) => "",
            };
            row.extend([
                measured.p_holm.into(),
                share.into(),
                measured.evaluations.to_string().as_str().into(),
                Some(measured.microseconds).filter(|time| time.is_finite()).into(),
                fronts.into(),
            ]);
            row
        });
        let rows = rows.collect();
        let grid = Grid { caption: format!("{}: the best first", told(place)), head, rows };
        let figures = [
            self.price(all, &by_time, "time of a step (µs)", &|m| m.microseconds),
            self.price(all, &by_evaluations, "likelihood evaluations a step", &|m| m.evaluations as f64),
        ];
        Section {
            title: format!("World: {}", told(place)),
            figures: figures.into_iter().filter(|figure| !figure.marks.is_empty()).collect(),
            tables: vec![grid],
            ..Section::default()
        }
    }

    /// Error against cost.
    fn price(
        &self,
        all: &[Measured<'_>],
        front: &[bool],
        unit: &str,
        cost: &dyn Fn(&Measured<'_>) -> f64,
    ) -> Figure {
        let least = all.first().and_then(|first| first.loss).map_or(f64::NAN, |loss| loss.value);
        let marks = all.iter().zip(front).filter_map(|(measured, labelled)| {
            let at = [cost(measured), measured.loss?.value / least];
            Some(Mark { at, name: self.called(measured), labelled: *labelled })
        });
        Figure {
            title: "Error as a multiple of the least, by cost".to_owned(),
            x: unit.to_owned(),
            y: "ratio".to_owned(),
            logarithmic: true,
            logarithmic_x: true,
            marks: marks.collect(),
            ..Figure::default()
        }
    }
}

/// Whether nothing says that it is worse than the first.
fn is_peer(measured: &Measured<'_>) -> bool {
    measured.p_holm.is_some_and(|p| p > LEVEL)
}

/// A world with its own numbers.
fn told(place: &Place) -> String {
    let mut text = place.world.to_owned();
    for (name, value) in
        [("measurement variance", place.measurement_variance), ("process variance", place.process_variance)]
    {
        if let Some(value) = value {
            text += &format!(", {name} {value}");
        }
    }
    if let Some(steps) = place.steps {
        text += &format!(", {steps} steps");
    }
    text
}
