//! Recorded targets: points of a vehicle that a filter has not seen, and outlines of single radar scans against boxes that
//! people drew.
//!
//! Nothing here has a true shape. A vehicle's points are dealt into two halves: filters see one, and are judged by the
//! density that they give the other, after each scan. Objects of a radar have a box, and are judged by how much of it
//! their outline covers. Methods are compared on the same points, pair by pair.

use super::settings::recorded::{
    ACCELERATION, BOX_MARGIN, FIRST_SCANS, FLOOR, FORGETTING_S, KEEP, LEAST_POINTS, MOST_ELLIPSES, OUTLINE,
    PLACE_SD, POINTS_OF_PRIOR, POINTS_OF_SIZE, SENSOR_SD, SPEED_SD, VARIANCE,
};
use crate::metric::{LabelledBox, Region};
use crate::report::study::{Grid, Section, Shown};
use crate::study::interval::{Bootstraps, Estimate, mean};
use crate::study::table::{Entry, Table};
use serde::Serialize;
use zerre::belief::Gaussian;
use zerre::extended::centre::{AlongVelocity, Centre, FirstTwo};
use zerre::extended::inverse_wishart::InverseWishart;
use zerre::extended::mem_ekf::{MemEkf, MemSettings};
use zerre::extended::random_matrix::{RandomMatrix, RandomMatrixSettings, Rule};
use zerre::extended::start::{Search, fits};
use zerre::extended::window::{WindowSettings, WindowVb};
use zerre::extended::{Ellipse, MStep, Shape};
use zerre::filter::Filter;
use zerre::math::{Dual, Matrix};
use zerre::model::motion::ConstantVelocity;
use zerre::rng::{Purpose, Stream};
use zerre::{Error, Result, Time};

/// Points of a scan, m.
pub type Scan = (Time, Vec<[f64; 2]>);

/// What was recorded, as far as it is at hand.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recordings {
    /// One vehicle seen by a lidar, in the order of time.
    pub vehicle: Option<Vec<Scan>>,
    /// Objects in single scans of an automotive radar.
    pub objects: Option<Vec<Object>>,
}

/// An object in one scan.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// Name of the scene that it is in.
    pub scene: String,
    /// Its points, m.
    pub points: Vec<[f64; 2]>,
    /// The box that covers most of them.
    pub label: LabelledBox,
}

impl Object {
    /// The points of a cluster with the box that holds most of them; `None` of few points, and where no box holds half.
    pub fn matched(scene: &str, points: Vec<[f64; 2]>, boxes: &[LabelledBox]) -> Option<Object> {
        let held = |b: &LabelledBox| points.iter().filter(|y| b.holds(**y, BOX_MARGIN)).count();
        let mut best: Option<(usize, LabelledBox)> = None;
        for label in boxes {
            let count = held(label);
            if count > best.map_or(0, |(most, _)| most) {
                best = Some((count, *label));
            }
        }
        let (count, label) = best?;
        let enough = points.len() >= LEAST_POINTS && 2 * count > points.len();
        enough.then(|| Object { scene: scene.to_owned(), points, label })
    }
}

/// One number of one method.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// `vehicle`, or the scene of the objects.
    pub recording: String,
    /// Method.
    pub method: &'static str,
    /// `held_out` (nats per point) or `iou`, or one of these less that of another method on the same points.
    pub metric: String,
    /// Mean over scans or objects.
    pub value: f64,
    /// Lower end of its 95 % bootstrap interval over scans or objects.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Scans or objects.
    pub count: usize,
}

/// Methods that others are compared with.
const AGAINST: [&str; 2] = ["random-matrix-koch", "random-matrix-feldmann"];

/// A body in its place.
struct Placed {
    centre: [f64; 2],
    spread: Matrix<2, 2>,
    shape: Shape,
}

impl Placed {
    fn of<C: Centre<4>>(centre: &C, state: &Gaussian<4>, shape: Shape) -> Placed {
        let seen = centre.at(Dual::<4>::variables(*state.mean()));
        let spread = Matrix(seen.map(|s| s.gradient)).congruence(state.covariance());
        let shape = if C::TURNS { shape.turned(centre.heading(*state.mean())) } else { shape };
        Placed { centre: seen.map(|s| s.value), spread, shape }
    }

    /// Mean log-density of points, the centre's uncertainty added to the shape.
    fn score(&self, points: &[[f64; 2]]) -> Result<f64> {
        let blurred = self.shape.blurred(&self.spread);
        let mut sum = 0.0;
        for y in points {
            sum += blurred.log_density(&[y[0] - self.centre[0], y[1] - self.centre[1]])?;
        }
        Ok(sum / points.len() as f64)
    }
}

/// What the filters of a recording have in common.
struct Setting {
    start: Time,
    prior: Gaussian<4>,
    /// First extent of a single ellipse, m^2, ...
    extent: Matrix<2, 2>,
    /// ... and the points that it counts for.
    points: f64,
    noise: Matrix<2, 2>,
    forgetting: Option<f64>,
    keep: f64,
}

impl Setting {
    fn motion() -> Result<ConstantVelocity<2>> {
        ConstantVelocity::new(ACCELERATION)
    }

    fn window<C: Centre<4>>(
        &self,
        centre: C,
        first: Shape,
    ) -> Result<WindowVb<ConstantVelocity<2>, C, 4, 4>> {
        let settings = WindowSettings {
            m_step: MStep { prior: self.points, floor: FLOOR, weights: true },
            noise: self.noise,
            keep: self.keep,
            ..WindowSettings::default()
        };
        WindowVb::new(Self::motion()?, centre, self.prior, first, settings)
    }

    fn random_matrix(&self, rule: Rule) -> Result<RandomMatrix<ConstantVelocity<2>, FirstTwo, 4, 4>> {
        let law = InverseWishart::new(self.extent, 3.0 + self.points)?;
        let settings =
            RandomMatrixSettings { rule, forgetting: self.forgetting, ..RandomMatrixSettings::default() };
        RandomMatrix::new(Self::motion()?, FirstTwo, self.prior, law, settings)
    }

    /// Runs `each` of the single-ellipse methods.
    fn singles<T>(&self, mut each: impl FnMut(&'static str, &mut dyn Follow) -> Result<T>) -> Result<Vec<T>> {
        let koch = self.random_matrix(Rule::Koch { unit: 1.0 })?;
        let feldmann = self.random_matrix(Rule::Feldmann { noise: self.noise })?;
        let side = (4.0 * self.extent.0[0][0]).sqrt();
        let axes = Gaussian::independent([0.0, 1.2 * side, 0.8 * side], [1.0, 0.4 * side, 0.4 * side])?;
        let settings = MemSettings { noise: self.noise, ..MemSettings::default() };
        let mem = MemEkf::new(Self::motion()?, FirstTwo, self.prior, axes, settings)?;
        let (koch, feldmann, mem) = (&koch, &feldmann, &mem);
        Ok(vec![
            each(
                "random-matrix-koch",
                &mut Run::new(koch, self.start, |b| Ok(Placed::of(&FirstTwo, &b.state, b.shape()?)))?,
            )?,
            each(
                "random-matrix-feldmann",
                &mut Run::new(feldmann, self.start, |b| Ok(Placed::of(&FirstTwo, &b.state, b.shape()?)))?,
            )?,
            each(
                "mem-ekf",
                &mut Run::new(mem, self.start, |b| Ok(Placed::of(&FirstTwo, &b.state, b.shape()?)))?,
            )?,
        ])
    }
}

/// A filter on its way.
trait Follow {
    fn take(&mut self, scan: &Scan) -> Result<Placed>;
}

struct Run<'a, F: Filter, R> {
    filter: &'a F,
    belief: F::Belief,
    read: R,
}

impl<'a, F: Filter, R: Fn(&F::Belief) -> Result<Placed>> Run<'a, F, R> {
    fn new(filter: &'a F, at: Time, read: R) -> Result<Self> {
        Ok(Run { filter, belief: filter.start(at, Stream::new(0))?, read })
    }
}

impl<F, R> Follow for Run<'_, F, R>
where
    F: Filter<Measurement = Vec<[f64; 2]>>,
    R: Fn(&F::Belief) -> Result<Placed>,
{
    fn take(&mut self, (at, points): &Scan) -> Result<Placed> {
        self.filter.step(&mut self.belief, *at, Some(points))?;
        (self.read)(&self.belief)
    }
}

fn middle(points: &[[f64; 2]]) -> [f64; 2] {
    let n = points.len().max(1) as f64;
    points.iter().fold([0.0; 2], |m, y| [m[0] + y[0] / n, m[1] + y[1] / n])
}

/// Values of each method, scan by scan or object by object.
type Columns = Vec<(&'static str, Vec<f64>)>;

/// Log-density per held-out point of each scan after the first.
fn held_out(scans: &[Scan], stream: Stream) -> Result<Columns> {
    let halves: Vec<(Scan, Vec<[f64; 2]>)> = (0..)
        .zip(scans)
        .map(|(step, (at, points))| {
            let mut draws = stream.draws(Purpose::Other, step, 0);
            let (seen, rest) = points.iter().partition(|_| draws.uniform() < 0.5);
            ((*at, seen), rest)
        })
        .collect();
    let [((start, one), _), ((next, two), _), ..] = &halves[..] else {
        return Err(Error::Unsupported("a vehicle needs two scans at least".into()));
    };
    let (one, two, gap) = (middle(one), middle(two), (*next - *start).secs());
    let speed = [0, 1].map(|k| (two[k] - one[k]) / gap);
    let setting = Setting {
        start: *start,
        prior: Gaussian::independent(
            [one[0], one[1], speed[0], speed[1]],
            [PLACE_SD, PLACE_SD, SPEED_SD, SPEED_SD],
        )?,
        extent: Matrix::identity() * VARIANCE,
        points: POINTS_OF_PRIOR,
        noise: Matrix::ZERO,
        forgetting: Some(FORGETTING_S),
        keep: KEEP,
    };
    let follow = |name: &'static str, run: &mut dyn Follow| {
        let mut values = Vec::new();
        for (k, (scan, rest)) in halves.iter().enumerate() {
            let placed = run.take(scan)?;
            if k >= FIRST_SCANS && !rest.is_empty() {
                values.push(placed.score(rest)?);
            }
        }
        Ok((name, values))
    };
    let first: Vec<Scan> = halves.iter().take(FIRST_SCANS).map(|(scan, _)| scan.clone()).collect();
    let round = Shape::ellipse(setting.extent)?;
    let mut columns = Vec::new();
    let search = Search { floor: FLOOR, ..Search::default() };
    let turning = setting.window(AlongVelocity, round.clone())?;
    columns.push(follow("window-vb", &mut best(&turning, &first, &search, stream)?)?);
    let straight = setting.window(FirstTwo, round)?;
    columns.push(follow("window-vb-fixed-axes", &mut best(&straight, &first, &search, stream)?)?);
    columns.extend(setting.singles(follow)?);
    Ok(columns)
}

/// The window filter from the shape that explains the first scans best by the Bayesian information criterion.
fn best<C: Centre<4> + 'static>(
    filter: &WindowVb<ConstantVelocity<2>, C, 4, 4>,
    first: &[Scan],
    search: &Search,
    stream: Stream,
) -> Result<Box<dyn Follow>> {
    let at = first.first().map_or(Time::ZERO, |scan| scan.0);
    let fits = fits(filter, at, first, 1..=MOST_ELLIPSES, search, stream)?;
    let least = fits.into_iter().min_by(|a, b| a.bic.total_cmp(&b.bic));
    let Some(fit) = least else {
        return Err(Error::Unsupported("no number of ellipses to choose from".into()));
    };
    let filter = filter.with_shape(fit.smoothed.shape);
    let belief = filter.start(at, stream)?;
    Ok(Box::new(Window { filter, belief }))
}

/// A window filter that owns itself.
struct Window<C: Centre<4>> {
    filter: WindowVb<ConstantVelocity<2>, C, 4, 4>,
    belief: zerre::extended::window::ExtendedBelief<4>,
}

impl<C: Centre<4>> Follow for Window<C> {
    fn take(&mut self, (at, points): &Scan) -> Result<Placed> {
        self.filter.step(&mut self.belief, *at, Some(points))?;
        let belief = &self.belief;
        Ok(Placed::of(self.filter.centre(), belief.state(), belief.shape().clone()))
    }
}

impl Follow for Box<dyn Follow> {
    fn take(&mut self, scan: &Scan) -> Result<Placed> {
        self.as_mut().take(scan)
    }
}

/// Intersection over union of the outline of each object with its box.
fn outlines(objects: &[&Object]) -> Result<Columns> {
    let mut columns: Columns = Vec::new();
    let push = |columns: &mut Columns, name: &'static str, value: f64| match columns
        .iter_mut()
        .find(|(known, _)| *known == name)
    {
        Some((_, values)) => values.push(value),
        None => columns.push((name, vec![value])),
    };
    for object in objects {
        let about = middle(&object.points);
        let scan = (Time::ZERO, object.points.clone());
        let label = Region::polygon(object.label.corners(about));
        let setting = Setting {
            start: Time::ZERO,
            prior: Gaussian::independent([about[0], about[1], 0.0, 0.0], [PLACE_SD, PLACE_SD, 0.0, 0.0])?,
            extent: Matrix::identity() * VARIANCE,
            points: POINTS_OF_SIZE,
            noise: Matrix::identity() * (SENSOR_SD * SENSOR_SD),
            forgetting: None,
            keep: 1.0,
        };
        let covered = |placed: Placed| {
            let at = [placed.centre[0] - about[0], placed.centre[1] - about[1]];
            Region::of_shape(&placed.shape, at, OUTLINE).intersection_over_union(&label)
        };
        // Two ellipses side by side: which of them stretches along the object is left to its points.
        let half = 0.5 * (4.0 * VARIANCE).sqrt();
        let ellipse =
            |x: f64| Ellipse { weight: 1.0, offset: [x, 0.0], extent: Matrix::identity() * VARIANCE };
        let filter = setting.window(FirstTwo, Shape::new(vec![ellipse(-half), ellipse(half)])?)?;
        let belief = filter.start(Time::ZERO, Stream::new(0))?;
        push(&mut columns, "window-vb", covered(Window { filter, belief }.take(&scan)?));
        for (name, value) in setting.singles(|name, run| Ok((name, covered(run.take(&scan)?))))? {
            push(&mut columns, name, value);
        }
    }
    Ok(columns)
}

/// Means with intervals, and those of the paired differences.
fn rows(recording: &str, metric: &str, columns: &Columns, seed: u64) -> Vec<Row> {
    let count = columns.first().map_or(0, |(_, values)| values.len());
    let bootstraps = Bootstraps::new([count], seed);
    let mut rows = Vec::new();
    let mut row = |method: &'static str, metric: String, values: &[f64]| {
        let found = bootstraps.estimate(count, |picked| mean(values, picked));
        rows.extend(found.map(|Estimate { value, low, high }| Row {
            recording: recording.to_owned(),
            method,
            metric,
            value,
            low,
            high,
            count,
        }));
    };
    for (method, values) in columns {
        row(method, metric.to_owned(), values);
        for (other, reference) in
            columns.iter().filter(|(other, _)| AGAINST.contains(other) && other != method)
        {
            let gains: Vec<f64> = values.iter().zip(reference).map(|(a, b)| a - b).collect();
            row(method, format!("{metric} less {other}"), &gains);
        }
    }
    rows
}

/// Everything about what is at hand.
///
/// # Errors
/// Points that are not finite, times out of order.
pub fn judge(recordings: &Recordings, seed: u64) -> Result<Vec<Row>> {
    let mut all = Vec::new();
    if let Some(scans) = &recordings.vehicle {
        let columns = held_out(scans, Stream::new(seed).fork(7))?;
        all.extend(rows("vehicle", "held_out", &columns, seed));
    }
    if let Some(objects) = &recordings.objects {
        let mut scenes: Vec<&str> = objects.iter().map(|object| object.scene.as_str()).collect();
        scenes.sort_unstable();
        scenes.dedup();
        for scene in scenes {
            let of: Vec<&Object> = objects.iter().filter(|object| object.scene == scene).collect();
            all.extend(rows(scene, "iou", &outlines(&of)?, seed));
        }
    }
    Ok(all)
}

/// The rows as a table.
pub fn table(rows: &[Row]) -> Table {
    let head = ["recording", "method", "metric", "value", "low", "high", "count"];
    let line = |row: &Row| -> Vec<Entry> {
        vec![
            row.recording.clone().into(),
            row.method.into(),
            row.metric.clone().into(),
            row.value.into(),
            row.low.into(),
            row.high.into(),
            row.count.into(),
        ]
    };
    let about =
        "Recorded targets: nats per held-out point, overlap with labelled boxes, and paired differences";
    Table::new("table-recorded", about, &head, rows.iter().map(line).collect())
}

/// Each once, in the order in which they come.
fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut all = Vec::new();
    for name in names {
        if !all.contains(&name) {
            all.push(name);
        }
    }
    all
}

/// What the page says of them.
pub(super) fn section(rows: &[Row]) -> Section {
    let mut section = Section { title: "Recorded targets".to_owned(), ..Section::default() };
    if rows.is_empty() {
        let what = "Not available: no recording was at hand. Name the folder that holds them with --data.";
        section.paragraphs.push(what.to_owned());
        return section;
    }
    section.paragraphs = [
        "A vehicle seen by a lidar: of each scan half of the points, drawn at random, are kept from the filter, and \
         judged is the log-density that it then gives them, per point, in all scans after those that first shapes are \
         made from. Objects of an automotive radar, each in a single scan: how much of its labelled box the outline at \
         two standard deviations covers, as intersection over union. The radar sees the near side of an object only, and \
         nobody is told which: no method covers much.",
        "Intervals are 95 % bootstrap intervals over scans or objects; those of scans, which follow one another, are \
         narrower than they should be. Differences are of pairs: the same points.",
    ]
    .map(str::to_owned)
    .to_vec();
    for name in distinct(rows.iter().map(|row| row.recording.as_str())) {
        let of: Vec<&Row> = rows.iter().filter(|row| row.recording == name).collect();
        let head = distinct(of.iter().map(|row| row.metric.as_str()));
        let methods = distinct(of.iter().map(|row| row.method));
        let shown = |method: &str, metric: &str| {
            let found = of.iter().find(|row| row.method == method && row.metric == metric);
            found.map_or_else(Shown::default, |row| Shown {
                text: format!("{:.3}", row.value),
                aside: format!("({:.3} to {:.3})", row.low, row.high),
                ..Shown::default()
            })
        };
        let line = |method: &&str| {
            let first = Shown::from(*method);
            std::iter::once(first).chain(head.iter().map(|metric| shown(method, metric))).collect()
        };
        let count = of.first().map_or(0, |row| row.count);
        let unit = if of.iter().any(|row| row.metric == "iou") { "objects" } else { "scans" };
        section.tables.push(Grid {
            caption: format!("{name}, {count} {unit}"),
            head: std::iter::once("method").chain(head.iter().copied()).map(str::to_owned).collect(),
            rows: methods.iter().map(line).collect(),
        });
    }
    section
}

#[cfg(test)]
mod tests {
    use super::*;
    use zerre::math::sin_cos;

    fn draws(seed: u64) -> zerre::rng::Draws {
        Stream::new(seed).draws(Purpose::Measurement, 0, 0)
    }

    #[test]
    fn objects_have_the_box_that_holds_them() {
        let label = LabelledBox { centre: [10.0, 5.0], size: [4.0, 2.0], yaw: 0.3 };
        let inside = vec![[10.0, 5.0]; LEAST_POINTS];
        let other = LabelledBox { centre: [0.0, 0.0], ..label };
        let found = Object::matched("a", inside.clone(), &[other, label]).unwrap();
        assert_eq!(found.label, label);
        assert!(Object::matched("a", inside, &[other]).is_none());
        assert!(Object::matched("a", vec![[10.0, 5.0]; LEAST_POINTS - 1], &[label]).is_none());
    }

    /// A vehicle seen as two thin sides, whose density one ellipse cannot follow: two sides of width .1 in place of one
    /// blot a metre wide are worth more than a nat a point. And the comparison is of pairs: a method's own differences
    /// add up.
    #[test]
    fn thin_sides_are_seen_and_differences_add_up() {
        let mut d = draws(3);
        let scans: Vec<Scan> = (0..20)
            .map(|k| {
                let x = 0.5 * f64::from(k);
                let mut point = |_| {
                    let (u, e) = (d.uniform(), [0.1 * d.normal(), 0.1 * d.normal()]);
                    let side = if d.uniform() < 0.7 { [4.0 * u, 0.0] } else { [4.0, 2.0 * u] };
                    [x + side[0] + e[0], side[1] + e[1]]
                };
                (Time::from_secs(0.1 * f64::from(k)), (0..60).map(&mut point).collect())
            })
            .collect();
        let recordings = Recordings { vehicle: Some(scans), objects: None };
        let all = judge(&recordings, 1).unwrap();
        let find = |method: &str, metric: &str| {
            all.iter().find(|row| row.method == method && row.metric == metric).unwrap().value
        };
        for other in AGAINST {
            let gain = find("window-vb", &format!("held_out less {other}"));
            assert!(gain > 1.0, "{gain}");
            assert!((find("window-vb", "held_out") - find(other, "held_out") - gain).abs() < 1e-12);
        }
        assert_ne!(judge(&recordings, 2).unwrap(), all, "another seed holds out other points");
    }

    /// Points all over a box cover it: a normal ellipse at two deviations of a uniform box reaches beyond its ends, and
    /// covers more than half of what both cover.
    #[test]
    fn full_boxes_are_covered() {
        let label = LabelledBox { centre: [20.0, -3.0], size: [4.5, 1.9], yaw: 0.4 };
        let mut d = draws(5);
        let (sin, cos) = sin_cos(label.yaw);
        let mut object = |_| {
            let mut point = |_| {
                let (u, v) = (4.5 * (d.uniform() - 0.5), 1.9 * (d.uniform() - 0.5));
                [20.0 + cos * u - sin * v, -3.0 + sin * u + cos * v]
            };
            Object::matched("made", (0..60).map(&mut point).collect(), &[label]).unwrap()
        };
        let objects: Vec<Object> = (0..5).map(&mut object).collect();
        let all = judge(&Recordings { vehicle: None, objects: Some(objects) }, 1).unwrap();
        for row in all.iter().filter(|row| row.metric == "iou") {
            assert!(row.value > 0.5 && row.count == 5, "{row:?}");
        }
        assert_eq!(all.iter().filter(|row| row.metric == "iou").count(), 4);
    }

    #[test]
    fn nothing_recorded_is_nothing_said() {
        assert_eq!(judge(&Recordings::default(), 1).unwrap(), vec![]);
        let one = Recordings { vehicle: Some(vec![(Time::ZERO, vec![[0.0; 2]])]), objects: None };
        assert!(judge(&one, 1).is_err());
    }
}
