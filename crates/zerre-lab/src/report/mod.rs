//! One run of a tracker on one page: `report.html`, which needs no network, and the plan view as a picture.
//!
//! Pictures are SVG written here, because one file has to serve light and dark screens, phones and screen readers:
//! colours are variables of the page and texts are elements, where plotting crates fix both.
//!
//! Everything handed in is drawn as far as it goes: lists of unequal length end with the shortest, numbers that are
//! not finite leave gaps, texts may hold anything.

pub mod animation;
mod chart;
mod letters;
mod outline;
pub mod overlay;
mod page;
mod plan;
pub mod study;
mod svg;

use crate::consistency::Assessment;
use crate::metric::Region;

/// What a run read, did and found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunReport {
    /// Head of the page.
    pub title: String,
    /// The command line that made it.
    pub command: String,
    /// Name of the input.
    pub input: String,
    /// Name of the filter.
    pub filter: String,
    /// Name of the motion model.
    pub motion: String,
    /// Seed of the run.
    pub seed: u64,
    /// When the first estimate was ("2024-05-01T12:00:00Z"), from which the page counts; `None` where the recording
    /// does not tell.
    pub start: Option<String>,
    /// What the plan's axes are ("east and north of 47.45° N, 8.56° E"); `None` for plain x and y.
    pub plan_note: Option<String>,
    /// The tracks, in the order of the table.
    pub tracks: Vec<TrackSeries>,
    /// Names of pictures of the plan, where a single one would lay things over each other that were never together:
    /// [`TrackSeries::scene`] counts in this list. Empty: one picture.
    pub scenes: Vec<String>,
    /// What others say of where things are and how large.
    pub labels: Vec<Label>,
    /// The sensors; [`InnovationRow::sensor`] counts in this list.
    pub sensors: Vec<SensorReport>,
    /// What became of the rows of the input.
    pub counts: Counts,
    /// Scores against truth; empty without.
    pub scores: Vec<Score>,
    /// Where errors and covariances disagree, as a sentence.
    pub against_truth: Option<String>,
    /// The effective configuration as text.
    pub config_text: String,
    /// Digest of the estimates.
    pub digest: String,
}

/// One target's estimates. `times_s`, `mean`, `sd`, `position`, `position_cov`, `ess`, `log_evidence` and
/// `mode_probabilities` run side by side, one entry per estimate; any may be empty where there is nothing to
/// say.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrackSeries {
    /// Identity; may hold anything.
    pub id: String,
    /// What the numbers of `mean` are.
    pub states: Vec<StateInfo>,
    /// Times of the estimates, in seconds.
    pub times_s: Vec<f64>,
    /// Estimates, one list of `states.len()` numbers per time, in the unit of the state.
    pub mean: Vec<Vec<f64>>,
    /// Standard deviations of `mean`.
    pub sd: Vec<Vec<f64>>,
    /// Places in the plan, in metres.
    pub position: Vec<[f64; 2]>,
    /// Covariances of `position`: xx, xy, yy, in square metres.
    pub position_cov: Vec<[f64; 3]>,
    /// Effective sample sizes, for particle filters.
    pub ess: Vec<Option<f64>>,
    /// How many particles, for particle filters.
    pub particles: Option<usize>,
    /// Sum of the log-evidence up to each time.
    pub log_evidence: Vec<f64>,
    /// Names of the ways to move that the filter tells apart, the undisturbed one first; mostly none.
    pub modes: Vec<String>,
    /// Their probabilities, one list of `modes.len()` numbers per time.
    pub mode_probabilities: Vec<Vec<f64>>,
    /// Innovations, in order of time.
    pub innovations: Vec<InnovationRow>,
    /// Measurements that have a place in the plan, in metres.
    pub plots: Vec<[f64; 2]>,
    /// Outlines of the target, one entry per estimate, or none at all; those that fit beside each other are drawn.
    pub outlines: Vec<Outline>,
    /// Place in [`RunReport::scenes`].
    pub scene: usize,
    /// How many measurements updated the track.
    pub updates: u64,
    /// How many measurements were expected and absent.
    pub missed: u64,
    /// What happened besides plain updates, by name ("all weights zero"), with how often.
    pub outcomes: Vec<(String, u64)>,
    /// The true states, where known.
    pub truth: Option<TruthSeries>,
}

/// A target's outline at one time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outline {
    /// What it encloses, in the plan, in metres.
    pub region: Region,
    /// The points of the target that were seen then, in metres.
    pub points: Vec<[f64; 2]>,
}

/// Something with a known outline.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Label {
    /// What it is.
    pub name: String,
    /// Its outline, in the plan, in metres.
    pub region: Region,
    /// Place in [`RunReport::scenes`].
    pub scene: usize,
}

/// One number of a state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StateInfo {
    /// What it is ("x", "speed").
    pub name: String,
    /// Its unit ("m", "m/s").
    pub unit: String,
}

/// What one measurement said against the prediction.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InnovationRow {
    /// Time in seconds.
    pub time_s: f64,
    /// Place of the sensor in [`RunReport::sensors`].
    pub sensor: usize,
    /// Normalised innovation squared.
    pub nis: f64,
    /// Innovation in predicted standard deviations, one number per component of the sensor.
    pub whitened: Vec<f64>,
}

/// The truth of one track.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TruthSeries {
    /// Times in seconds.
    pub times_s: Vec<f64>,
    /// Places in the plan, in metres.
    pub position: Vec<[f64; 2]>,
    /// For each state of the track its true values, side by side with `times_s`; an empty list where unknown.
    pub states: Vec<Vec<f64>>,
}

/// One sensor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SensorReport {
    /// Its name.
    pub name: String,
    /// What it measures, component by component ("range", "bearing").
    pub components: Vec<String>,
    /// Where it stands in the plan, in metres.
    pub position: Option<[f64; 2]>,
    /// How many of its measurements updated a track.
    pub used: u64,
    /// How many lay outside the gate.
    pub gated: u64,
    /// What its innovations say.
    pub assessment: Option<Assessment>,
}

/// What became of the rows of the input.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Counts {
    /// Rows read.
    pub read: u64,
    /// Rows used.
    pub used: u64,
    /// Empty cells where a measurement could stand; a row may have several.
    pub missing: u64,
    /// Sound rows that give no new measurement, by reason.
    pub left_out: Vec<(String, u64)>,
    /// Rows that were earlier than one before them, and were sorted by time.
    pub out_of_order: u64,
    /// Rows refused, by reason.
    pub rejected: Vec<Rejection>,
}

/// One reason to refuse rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rejection {
    /// The reason, as a sentence.
    pub reason: String,
    /// How many rows.
    pub count: u64,
    /// The first few.
    pub examples: Vec<RejectedRow>,
}

/// One refused row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RejectedRow {
    /// Line of the input, from 1.
    pub line: u64,
    /// Name of the column.
    pub column: String,
    /// The text found there.
    pub value: String,
}

/// One score of the run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Score {
    /// Its name ("GOSPA").
    pub name: String,
    /// The number.
    pub value: f64,
    /// Its unit; empty for pure numbers.
    pub unit: String,
}

/// The page.
pub fn render(report: &RunReport) -> String {
    page::render(report)
}

/// The plan view alone, as an SVG file that follows the reader's light or dark setting.
pub fn plan_svg(report: &RunReport) -> String {
    let style = format!(
        "<title>{}</title><style>{}svg{{background:var(--bg)}}</style>",
        svg::Escaped(&report.title),
        svg::Escaped(include_str!("palette.css"))
    );
    // Of several pictures the one with the most to see.
    let tracks = |scene: usize| report.tracks.iter().filter(|track| track.scene == scene).count();
    let scene = (0..report.scenes.len()).max_by_key(|scene| (tracks(*scene), std::cmp::Reverse(*scene)));
    plan::draw(report, scene, Some(&style)).svg
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::test_noise::Noise;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    fn track(id: &str, rows: usize, noise: &mut Noise) -> TrackSeries {
        let mut series = TrackSeries {
            id: id.into(),
            states: ["x", "y", "vx", "vy"]
                .map(|name| StateInfo { name: name.into(), unit: "m".into() })
                .to_vec(),
            particles: Some(500),
            updates: rows as u64,
            truth: Some(TruthSeries { states: vec![Vec::new(); 4], ..Default::default() }),
            ..Default::default()
        };
        let offset = [5000.0 * noise.normal(), 5000.0 * noise.normal()];
        for i in 0..rows {
            let place = [offset[0] + 10.0 * i as f64 + noise.normal(), offset[1] + 30.0 * noise.normal()];
            series.times_s.push(1.7e9 + i as f64);
            series.mean.push(vec![place[0], place[1], noise.normal(), noise.normal()]);
            series.sd.push(vec![5.0; 4]);
            series.position.push(place);
            series.position_cov.push([25.0, 5.0, 25.0]);
            series.ess.push(Some(200.0 + 50.0 * noise.uniform()));
            series.log_evidence.push(-(i as f64));
            let whitened = vec![noise.normal(), noise.normal()];
            let nis = whitened.iter().map(|w| w * w).sum();
            series.innovations.push(InnovationRow { time_s: 1.7e9 + i as f64, sensor: 0, nis, whitened });
            series.plots.push(place);
            if let Some(truth) = &mut series.truth {
                truth.times_s.push(1.7e9 + i as f64);
                truth.position.push(place);
                truth.states.iter_mut().for_each(|s| s.push(1.0));
            }
        }
        series
    }

    fn report(tracks: usize, rows: usize) -> RunReport {
        let mut noise = Noise(1);
        RunReport {
            title: "run".into(),
            tracks: (0..tracks).map(|k| track(&format!("t{k}"), rows, &mut noise)).collect(),
            sensors: vec![SensorReport { name: "radar".into(), ..Default::default() }],
            ..Default::default()
        }
    }

    /// Every tag is closed in order: what a strict reader of XML asks of the structure.
    pub(super) fn is_balanced(markup: &str) -> bool {
        let mut open = Vec::new();
        for piece in markup.split('<').skip(1) {
            let Some((tag, _)) = piece.split_once('>') else { return false };
            let name = tag.trim_start_matches('/').split([' ', '/', '\n']).next().unwrap_or_default();
            if tag.starts_with('/') {
                if open.pop() != Some(name) {
                    return false;
                }
            } else if !tag.ends_with('/') && !["!doctype", "meta", "br"].contains(&name) {
                open.push(name);
            }
        }
        open.is_empty()
    }

    fn without_script(page: &str) -> String {
        let (head, rest) = page.split_once("<script>").unwrap();
        format!("{head}{}", rest.split_once("</script>").unwrap().1)
    }

    #[test]
    fn markup_is_balanced() {
        assert!(!is_balanced("<p><b></p></b>"), "the test itself must be able to fail");
        for r in [report(3, 40), report(0, 0), RunReport::default()] {
            assert!(is_balanced(&without_script(&render(&r))));
            assert!(is_balanced(&plan_svg(&r)));
        }
    }

    #[test]
    fn texts_stay_texts() {
        let evil = "</title><script>alert('x')</script>\"<img src=x onerror=y>";
        let mut r = report(2, 30);
        r.tracks[0].id = evil.into();
        r.tracks[0].states[0] = StateInfo { name: evil.into(), unit: evil.into() };
        r.tracks[0].outcomes = vec![(evil.into(), 2)];
        r.sensors[0] = SensorReport {
            name: evil.into(),
            components: vec![evil.into()],
            position: r.tracks[0].position.first().copied(),
            ..Default::default()
        };
        for text in
            [&mut r.title, &mut r.command, &mut r.input, &mut r.filter, &mut r.motion, &mut r.config_text]
        {
            *text = evil.into();
        }
        (r.digest, r.start, r.plan_note) = (evil.into(), Some(evil.into()), Some(evil.into()));
        r.scores = vec![Score { name: evil.into(), value: 1.0, unit: evil.into() }];
        let examples = vec![RejectedRow { line: 3, column: evil.into(), value: evil.into() }];
        r.counts.rejected = vec![Rejection { reason: evil.into(), count: 1, examples }];
        let page = render(&r);
        assert_eq!(page.matches("<script>").count(), 1, "the page's own");
        assert!(!page.contains("<img") && !plan_svg(&r).contains("<script"));
        assert!(is_balanced(&without_script(&page)) && is_balanced(&plan_svg(&r)));
    }

    #[test]
    fn the_page_asks_nothing_of_the_network() {
        let page = render(&report(3, 40));
        for way_out in ["http:", "https:", "src=", "@import", "url(", "<link", "fetch("] {
            assert!(!page.contains(way_out), "{way_out}");
        }
    }

    #[test]
    fn a_large_run_stays_small_and_says_what_it_left_out() {
        let page = render(&report(50, 300));
        assert!(page.len() < 2_000_000, "{} bytes", page.len());
        assert!(page.contains("points each") && page.contains("Every 2nd measurement"), "thinning is said");
        let page = render(&report(70, 5));
        assert!(page.contains("Charts follow for the 60 tracks"));
    }

    #[test]
    fn what_is_known_is_on_the_page() {
        let mut r = report(1, 40);
        r.digest = "abc123".into();
        r.counts = Counts {
            read: 43,
            used: 40,
            missing: 5,
            left_out: vec![("repeated".into(), 3)],
            out_of_order: 2,
            rejected: Vec::new(),
        };
        r.against_truth = Some("the tracks are off".into());
        r.sensors[0].components = vec!["range".into(), "bearing".into()];
        let page = render(&r);
        for text in [
            "abc123",
            "43 rows read: 40 used, 3 left out (repeated: 3)",
            "2 of them were out of order",
            "5 cells were empty",
            "<li>the tracks are off</li>",
            "No row was rejected",
            "aria-label=\"innovations: range, bearing (σ) over time\"",
            "NIS, 95 % between",
            "effective sample size of 500 particles",
            "position error (shaded",
            "log-evidence",
            "not judged",
        ] {
            assert!(page.contains(text), "{text}");
        }
        assert!(!page.contains("NaN") && !page.contains(">inf"));
        r.tracks[0].truth = None;
        assert!(!render(&r).contains("position error"), "nothing is said of a truth that is not known");
    }

    /// Three estimates on a line, the middle one in another mode: its step is marked, and no other.
    #[test]
    fn manoeuvres_are_marked() {
        let mut r = report(1, 3);
        assert!(!render(&r).contains("manoeuvring") && !plan_svg(&r).contains("manoeuvring"));
        let track = &mut r.tracks[0];
        track.modes = vec!["straight".into(), "left".into()];
        track.mode_probabilities = vec![vec![0.5, 0.5], vec![0.2, 0.8], vec![0.9, 0.1]];
        for text in [render(&r), plan_svg(&r)] {
            assert!(text.contains("manoeuvring"));
            let marks: Vec<&str> = text.split("class=\"wild\" d=\"").skip(1).collect();
            // The last one is the track's, the others are of the keys.
            let mark = marks.last().unwrap().split('"').next().unwrap();
            assert_eq!((mark.matches('M').count(), mark.matches('L').count()), (1, 1), "{mark}");
        }
        let page = render(&r);
        assert!(page.contains("aria-label=\"mode probabilities: straight, left over time\""));
        assert!(page.contains("class=\"mode1\"") && is_balanced(&without_script(&page)));
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(10),
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        /// Lists of any length with any numbers in them: a page all the same.
        #[test]
        fn anything_gives_a_page(
            times in prop::collection::vec(prop::num::f64::ANY, 0..6),
            numbers in prop::collection::vec(prop::num::f64::ANY, 0..6),
            places in prop::collection::vec(prop::array::uniform2(prop::num::f64::ANY), 0..6),
            covariances in prop::collection::vec(prop::array::uniform3(prop::num::f64::ANY), 0..6),
            sensor in any::<usize>(),
        ) {
            let innovation =
                |&time_s: &f64| InnovationRow { time_s, sensor, nis: time_s, whitened: numbers.clone() };
            let truth = TruthSeries {
                times_s: numbers.clone(),
                position: places.clone(),
                states: vec![numbers.clone()],
            };
            let r = RunReport {
                tracks: vec![TrackSeries {
                    states: vec![StateInfo::default(); 2],
                    mean: times.iter().map(|_| numbers.clone()).collect(),
                    sd: vec![numbers.clone()],
                    ess: numbers.iter().copied().map(Some).collect(),
                    innovations: times.iter().map(innovation).collect(),
                    log_evidence: numbers.clone(),
                    modes: vec![String::new(); numbers.len()],
                    mode_probabilities: times.iter().map(|_| numbers.clone()).collect(),
                    plots: places.clone(),
                    position: places,
                    position_cov: covariances,
                    truth: Some(truth),
                    times_s: times,
                    ..Default::default()
                }],
                sensors: vec![SensorReport { position: Some([0.0, f64::NAN]), ..Default::default() }],
                ..Default::default()
            };
            let page = without_script(&render(&r));
            prop_assert!(is_balanced(&page) && is_balanced(&plan_svg(&r)));
            prop_assert!(!page.contains("NaN"), "a number that is none was drawn");
        }
    }
}
