//! The filters at work: targets in parallel, each as if it were alone.

use super::input::Input;
use super::settings::refused;
use crate::args::Global;
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::{Progress, interrupted};
use std::collections::{BTreeMap, HashSet};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::time::Duration;
use zerre::kernels::{Simd, Threads};
use zerre::track::{Body, Engine, Event, Mode, Row, State, TrackerSpec};

/// Who works. Neither number of threads nor instructions change a result.
pub(super) struct Workers {
    threads: usize,
    simd: Simd,
}

impl Workers {
    pub fn new(global: &Global) -> Result<Workers, Diagnostic> {
        let simd = crate::command::simd(global)?;
        Ok(Workers { threads: crate::command::threads(global), simd })
    }

    /// What one of `targets` that are followed at the same time computes with.
    pub fn engine(&self, targets: usize) -> Result<Engine, Diagnostic> {
        let threads = Threads::new(self.threads / targets.clamp(1, self.threads))
            .map_err(|error| Diagnostic::new(format!("cannot start threads: {error}")))?;
        Ok(Engine { simd: self.simd, threads })
    }
}

/// What came of the plots.
pub(super) struct Run {
    pub states: Vec<State>,
    /// The ways to move that the filter tells apart.
    pub modes: Vec<Mode>,
    /// Side by side with the plots; `None` where the run was stopped before.
    pub rows: Vec<Option<Row>>,
    /// Where each plot alone puts its target in the plane, metres.
    pub places: Vec<Option<[f64; 2]>>,
    /// Side by side with the rows, where targets are extended; else empty.
    pub bodies: Vec<Option<Body>>,
    /// The same recording under a Kalman filter, for filters with particles.
    pub reference: Option<Reference>,
}

/// How a Kalman filter fared.
pub(super) struct Reference {
    pub filter: &'static str,
    /// Log-evidence of the plots that both filters used.
    pub log_evidence: f64,
    /// Of the filter itself, of the same plots.
    pub own: f64,
    /// How many plots.
    pub plots: usize,
}

/// Natural units of information per measurement, which a filter may lose against the reference before it is said: a
/// twentieth doubles the odds against it every fourteen measurements.
pub(super) const TOLERABLE_LOSS: f64 = 0.05;

impl Reference {
    /// What the filter loses against the reference for each plot, in natural units of information.
    pub fn loss_per_plot(&self) -> f64 {
        (self.log_evidence - self.own) / self.plots.max(1) as f64
    }

    /// Whether modes, of which this is how they fared, are clearly worth their three numbers more against `plain`: the
    /// evidence grows beyond what fitting them explains (Schwarz 1978), and beyond what may be lost.
    pub fn is_worth_its_modes(&self, plain: &Reference) -> bool {
        let plots = self.plots.min(plain.plots).max(1) as f64;
        let gain = plots * (self.loss_per_plot() - plain.loss_per_plot());
        gain > (1.5 * plots.ln()).max(TOLERABLE_LOSS * plots)
    }

    /// Whether the particles are too few for these models and this recording.
    pub fn is_better(&self) -> bool {
        self.loss_per_plot() > TOLERABLE_LOSS
    }
}

/// The plots of each target; those of the most plots first, so that no thread is left with them at the end.
pub(super) fn targets(input: &Input) -> Vec<Vec<usize>> {
    let mut by_target: BTreeMap<Option<&str>, Vec<usize>> = BTreeMap::new();
    for (index, plot) in input.plots.iter().enumerate() {
        by_target.entry(plot.id.as_deref()).or_default().push(index);
    }
    let mut targets: Vec<Vec<usize>> = by_target.into_values().collect();
    targets.sort_by_key(|indices| std::cmp::Reverse(indices.len()));
    targets
}

/// A plot by its place in the input, and what went wrong there.
pub(super) type Failure = (usize, zerre::Error);

/// Does all targets, each by itself: `one` gets the plots of one and tells what came of each, until it hears that it is
/// to stop. Gives back what was told, side by side with the plots.
pub(super) fn in_parallel<T: Clone + Send>(
    input: &Input,
    workers: &Workers,
    console: &Console,
    one: impl Fn(&[usize], &mut dyn FnMut(usize, T) -> bool) -> Result<(), Failure> + Sync,
) -> Result<Vec<Option<T>>, Diagnostic> {
    let plots = &input.plots;
    let targets = targets(input);
    let crew = workers.threads.min(targets.len()).max(1);
    let told = Mutex::new(vec![None; plots.len()]);
    let failure: Mutex<Option<Failure>> = Mutex::new(None);
    let (next, done, stop) = (AtomicUsize::new(0), AtomicU64::new(0), AtomicBool::new(false));
    let stopped = || interrupted() || stop.load(Ordering::Relaxed);
    let work = || {
        while let Some(indices) = targets.get(next.fetch_add(1, Ordering::Relaxed)).filter(|_| !stopped()) {
            let mut own = Vec::with_capacity(indices.len());
            let result = one(indices, &mut |index, value| {
                own.push((index, value));
                done.fetch_add(1, Ordering::Relaxed);
                !stopped()
            });
            let mut told = lock(&told);
            for (index, value) in own {
                told[index] = Some(value);
            }
            if let Err((index, error)) = result {
                stop.store(true, Ordering::Relaxed);
                let mut failure = lock(&failure);
                // The earliest plot is named, whichever thread came first.
                if failure.as_ref().is_none_or(|(other, _)| index < *other) {
                    *failure = Some((index, error));
                }
            }
        }
    };
    let mut progress = Progress::new(console, "measurements", Some(plots.len() as u64));
    std::thread::scope(|scope| {
        let crew: Vec<_> = (0..crew).map(|_| scope.spawn(work)).collect();
        let mut shown = 0;
        while crew.iter().any(|worker| !worker.is_finished()) {
            std::thread::sleep(Duration::from_millis(if console.watched() { 20 } else { 1 }));
            let now = done.load(Ordering::Relaxed);
            progress.advance(now - shown);
            shown = now;
        }
    });
    if let Some((index, error)) = lock(&failure).take() {
        let id = plots[index].id.as_deref().unwrap_or("target");
        return Err(refused(&format!("{}, target `{id}`", input.place(index)), &error));
    }
    let told = std::mem::take(&mut *lock(&told));
    Ok(told)
}

/// Follows all targets.
pub(super) fn follow(
    spec: &TrackerSpec,
    input: &Input,
    workers: &Workers,
    console: &Console,
) -> Result<Run, Diagnostic> {
    let engine = workers.engine(targets(input).len())?;
    let tracker = spec.build(engine.clone()).map_err(|error| refused(&input.names(), &error))?;
    let (states, modes) = (tracker.states(), tracker.modes().to_vec());
    let told = in_parallel(input, workers, console, |indices, tell| {
        let first = indices.first().copied().unwrap_or_default();
        let mut tracker = spec.build(engine.clone()).map_err(|error| (first, error))?;
        for &index in indices {
            let plot = &input.plots[index];
            let row = tracker.push(plot).map_err(|error| (index, error))?;
            if !tell(index, (row, tracker.place(plot))) {
                break;
            }
        }
        Ok(())
    })?;
    let of = |told: Option<(Row, Option<[f64; 2]>)>| told.map_or((None, None), |(row, at)| (Some(row), at));
    let (rows, places) = told.into_iter().map(of).unzip();
    Ok(Run { states, modes, rows, places, bodies: Vec::new(), reference: None })
}

/// A panic in another thread ends the program by itself; here its half-done work is not looked at.
fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

impl Run {
    /// Refuses a run in which nothing could start.
    pub fn check_started(&self, input: &Input) -> Result<(), Diagnostic> {
        let any = |holds: &dyn Fn(&Row) -> bool| self.rows.iter().flatten().any(holds);
        if any(&|row| !row.mean.is_empty()) || !any(&|row| row.event == Event::Waiting) {
            return Ok(());
        }
        Err(Diagnostic::new(format!(
            "{}: neither this measurement nor another tells a position; bearings, ranges or range rates alone \
             start no track",
            input.place(0)
        ))
        .help("say where targets appear: position_m and position_sd_m under [start]"))
    }

    /// How many rows of the recordings the plots that were reached are of; a row with two readings is two plots.
    pub fn rows_followed(&self, input: &Input) -> u64 {
        let reached = |index: &usize| self.rows.get(*index).is_some_and(Option::is_some);
        if !input.points.is_empty() {
            // Every point is a row.
            let points = input.points.iter().enumerate().filter(|(index, _)| reached(index));
            return points.map(|(_, points)| points.len() as u64).sum();
        }
        let plots = input.plots.iter().zip(&input.file_of).zip(&self.rows);
        let rows: HashSet<_> =
            plots.filter(|(_, row)| row.is_some()).map(|((plot, file), _)| (file, plot.line)).collect();
        rows.len() as u64
    }

    /// Runs `filters` of the Kalman family with `spec` on the same plots: of [`PLAIN`] the exact one where the models
    /// are linear, elsewhere the extended and the unscented one, of which the one with more evidence counts. Gives back
    /// how it fared and its run.
    pub fn against_kalman(
        &self,
        filters: &[&'static str],
        spec: &TrackerSpec,
        input: &Input,
        workers: &Workers,
        console: &Console,
    ) -> Option<(Reference, Run)> {
        let mut best: Option<(Reference, Run)> = None;
        for &filter in filters {
            let mut other = spec.clone();
            other.filter.name = filter.to_owned();
            // Models that are not linear are refused by the exact filter.
            let Ok(run) = follow(&other, input, workers, console) else { continue };
            let mut reference = Reference { filter, log_evidence: 0.0, own: 0.0, plots: 0 };
            for (own, theirs) in self.rows.iter().zip(&run.rows) {
                let evidence = |row: &Option<Row>| super::outcome::evidence(row.as_ref()?);
                if let (Some(own), Some(theirs)) = (evidence(own), evidence(theirs)) {
                    reference.own += own;
                    reference.log_evidence += theirs;
                    reference.plots += 1;
                }
            }
            let gain = |best: &(Reference, Run)| reference.loss_per_plot() - best.0.loss_per_plot();
            if reference.plots > 0 && best.as_ref().is_none_or(|best| gain(best) > 0.0) {
                best = Some((reference, run));
            }
            if filter == "kalman" {
                break;
            }
        }
        best
    }
}

/// The filters of the Kalman family without modes.
pub(super) const PLAIN: &[&str] = &["kalman", "ekf", "ukf"];
/// Those with modes; the exact one is no different where it can be had.
pub(super) const MODAL: &[&str] = &["imm-ekf", "imm-ukf"];
/// The one of them that is tried where nobody asked for modes.
pub(super) const TRIED: &[&str] = &["imm-ekf"];
