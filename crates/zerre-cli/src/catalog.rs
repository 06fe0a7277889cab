//! What there is to choose from: one list per kind, which help, diagnostics and `zerre catalog` share.

use serde::Serialize;
use std::collections::BTreeMap;
use zerre_io::{COLUMNS, Column, Format};
use zerre_lab::metric::{METRICS, MetricInfo};
use zerre_lab::paper::{PAPERS, Paper};
use zerre_lab::scenario::{Named, SCENARIOS};
use zerre_lab::study::contender::{CONTENDERS, ContenderInfo};
use zerre_lab::study::world::{WORLDS, WorldInfo};
use zerre_vision::balls::SCENES as BALL_SCENES;
use zerre_vision::balls::scene::Named as BallScene;
use zerre_vision::clip::{CLIPS, Named as Clip};
use zerre_vision::rgbd::recording::KINDS as RECORDINGS;
use zerre_vision::rgbd::scene::{Named as Scene, SCENES};
use zerre_vision::tracker::{Kind as Tracker, TRACKERS};

/// One thing that can be named on the command line or in a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Entry {
    /// The list it belongs to, in the plural: `filters`, `motions`, `formats`.
    #[serde(skip)]
    pub kind: &'static str,
    /// The name to write.
    pub name: &'static str,
    /// One line on what it is.
    pub about: &'static str,
    /// Where it comes from: a paper, a standard.
    pub source: &'static str,
}

/// Entries by kind.
pub type Kinds<'a> = BTreeMap<&'static str, Vec<&'a Entry>>;

/// `entries` by kind, each kind in the order of the list.
pub fn by_kind(entries: &[Entry]) -> Kinds<'_> {
    let mut kinds = Kinds::new();
    for entry in entries {
        kinds.entry(entry.kind).or_default().push(entry);
    }
    kinds
}

/// The names of one kind.
pub fn names(entries: &[Entry], kind: &str) -> Vec<&'static str> {
    entries.iter().filter(|entry| entry.kind == kind).map(|entry| entry.name).collect()
}

/// Everything that this program can name: the lists of the crates, one after the other.
pub fn all() -> Vec<Entry> {
    use zerre::catalog::{EXTENDED_FILTERS, FILTERS, MEASUREMENTS, MOTIONS, PROPOSALS, RESAMPLERS, SERIES};
    let library = [
        ("filters", FILTERS),
        ("extended-filters", EXTENDED_FILTERS),
        ("motions", MOTIONS),
        ("series", SERIES),
        ("measurements", MEASUREMENTS),
        ("proposals", PROPOSALS),
        ("resamplers", RESAMPLERS),
    ];
    let of_library = library.iter().flat_map(|(kind, list)| {
        list.iter().map(|e| Entry { kind, name: e.name, about: e.about, source: e.source })
    });
    let metric = |m: &MetricInfo| Entry { kind: "metrics", name: m.name, about: m.about, source: m.source };
    let scenario = |s: &Named| Entry { kind: "scenarios", name: s.name, about: s.about, source: s.source };
    let clip = |c: &Clip| Entry { kind: "scenarios", name: c.name, about: c.about, source: "" };
    let scene = |s: &Scene| Entry { kind: "scenarios", name: s.name, about: s.about, source: "" };
    let balls = |s: &BallScene| Entry { kind: "scenarios", name: s.name, about: s.about, source: "" };
    let paper = |p: &Paper| Entry { kind: "papers", name: p.name, about: p.about, source: p.source };
    let world = |w: &WorldInfo| Entry { kind: "worlds", name: w.name, about: w.about, source: w.source };
    let contender =
        |c: &ContenderInfo| Entry { kind: "contenders", name: c.name, about: c.about, source: c.source };
    let tracker = |t: &Tracker| Entry { kind: "trackers", name: t.name, about: t.about, source: t.source };
    let format = |&(_, name, about): &(Format, _, _)| Entry { kind: "formats", name, about, source: "" };
    let column = |c: &Column| Entry { kind: "columns", name: c.name, about: c.about, source: "" };
    of_library
        .chain(METRICS.iter().map(metric))
        .chain(SCENARIOS.iter().map(scenario))
        .chain(CLIPS.iter().map(clip))
        .chain(SCENES.iter().map(scene))
        .chain(BALL_SCENES.iter().map(balls))
        .chain(PAPERS.iter().map(paper))
        .chain(WORLDS.iter().map(world))
        .chain(CONTENDERS.iter().map(contender))
        .chain(TRACKERS.iter().map(tracker))
        .chain(Format::ALL.iter().map(format))
        .chain(COLUMNS.iter().map(column))
        .chain(RECORDINGS.iter().map(|&(name, about)| Entry { kind: "recordings", name, about, source: "" }))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Format;
    use clap::ValueEnum;

    #[test]
    fn the_formats_are_those_that_the_command_line_takes() {
        let taken: Vec<_> = Format::value_variants()
            .iter()
            .filter_map(|f| Some(f.to_possible_value()?.get_name().to_owned()))
            .collect();
        assert_eq!(names(&all(), "formats"), taken);
    }

    #[test]
    fn no_name_stands_twice_in_a_kind() {
        for (kind, entries) in by_kind(&all()) {
            let mut names: Vec<_> = entries.iter().map(|entry| entry.name).collect();
            names.sort_unstable();
            names.dedup();
            assert_eq!(names.len(), entries.len(), "{kind}");
        }
    }
}
