//! Methods that learn a union of ellipses.

use super::super::scenario::{ClutterModel, motion, prior};
use super::super::settings::{
    BATCH_ITERATIONS, BATCH_PATHS, BATCH_TURNS, BURN_IN, CLUTTER_SIDE, CLUTTER_SWEEPS, CLUTTER_WINDOW,
    DATA_SCANS, DATA_TRIES, DATA_TURNS, EXPONENT, FLOOR, PRIOR_POINTS, SWEEPS, VAGUE, WINDOW,
};
use super::{Body, Estimate, Task, filtered};
use zerre::extended::batch::{BatchSettings, batch_em};
use zerre::extended::centre::FirstTwo;
use zerre::extended::online::{OnlineEm, OnlineSettings, Reading};
use zerre::extended::rate::Rate;
use zerre::extended::start::{Search, fits};
use zerre::extended::window::{Clutter, WindowSettings, WindowVb};
use zerre::extended::{Ellipse, MStep, Shape};
use zerre::filter::Settings;
use zerre::model::motion::ConstantVelocity;
use zerre::{Error, Result, Time};

type Window = WindowVb<ConstantVelocity<2>, FirstTwo, 4, 4>;

/// Weights are known.
const M_STEP: MStep = MStep { prior: PRIOR_POINTS, floor: FLOOR, weights: false };

/// The particle filter that learns scan by scan.
pub fn online(task: &Task<'_>, reading: Reading, recentre: bool) -> Result<Vec<Estimate>> {
    let settings = OnlineSettings {
        reading,
        particles: task.particles,
        exponent: EXPONENT,
        burn_in: BURN_IN,
        m_step: M_STEP,
        recentre,
        ..OnlineSettings::default()
    };
    let filter = OnlineEm::new(motion()?, FirstTwo, prior()?, task.start.clone(), settings)?;
    filtered(task, &filter, |belief| {
        let [x, y, ..] = *belief.state()?.mean();
        Ok(Estimate::ellipses([x, y], belief.shape().clone()))
    })
}

fn window(task: &Task<'_>) -> Result<Window> {
    // What is known is so as from many scans.
    let known = |mean| Rate::new(mean, 1e6, 1.0);
    let vague = |mean| Rate::new(mean, VAGUE, 1.0);
    let of_target = task.rate;
    let area = CLUTTER_SIDE * CLUTTER_SIDE;
    let (rate, clutter) = match task.clutter_model {
        ClutterModel::None | ClutterModel::Ignored => (known(of_target)?, None),
        ClutterModel::Known => {
            (known(of_target)?, Some(Clutter { area, rate: known(task.clutter)?, learnt: false }))
        }
        ClutterModel::Learnt => (vague(of_target)?, Some(Clutter { area, rate: vague(1.0)?, learnt: true })),
    };
    let (window, sweeps) =
        if clutter.is_some() { (CLUTTER_WINDOW, CLUTTER_SWEEPS) } else { (WINDOW, SWEEPS) };
    let settings =
        WindowSettings { window, sweeps, m_step: M_STEP, rate, clutter, ..WindowSettings::default() };
    WindowVb::new(motion()?, FirstTwo, prior()?, task.start.clone(), settings)
}

pub fn window_vb(task: &Task<'_>) -> Result<Vec<Estimate>> {
    filtered(task, &window(task)?, |belief| {
        let [x, y, ..] = *belief.state().mean();
        let clutter = belief.clutter().filter(|clutter| clutter.learnt).map(|clutter| clutter.rate.mean());
        Ok(Estimate { centre: [x, y], body: Body::Ellipses(belief.shape().clone()), clutter })
    })
}

fn scans(task: &Task<'_>) -> Vec<(Time, Vec<[f64; 2]>)> {
    task.record.times.iter().copied().zip(task.record.scans.iter().cloned()).collect()
}

/// One shape along a path.
fn all_along<'a>(path: impl IntoIterator<Item = &'a [f64; 4]>, shape: &Shape) -> Vec<Estimate> {
    path.into_iter().map(|[x, y, ..]| Estimate::ellipses([*x, *y], shape.clone())).collect()
}

pub fn batch_vb(task: &Task<'_>) -> Result<Vec<Estimate>> {
    let found = window(task)?.smoothed(Time::ZERO, &scans(task), BATCH_TURNS)?;
    Ok(all_along(found.states.iter().map(|state| state.mean()), &found.shape))
}

pub fn batch_pf(task: &Task<'_>) -> Result<Vec<Estimate>> {
    let settings = BatchSettings {
        iterations: BATCH_ITERATIONS,
        paths: BATCH_PATHS,
        m_step: M_STEP,
        particles: Settings { particles: task.particles, ..Settings::default() },
        ..BatchSettings::default()
    };
    let models = (&motion()?, &FirstTwo);
    let first = (Time::ZERO, prior()?, &task.start);
    let found = batch_em(models, first, &scans(task), &settings, task.stream)?;
    Ok(all_along(&found.states, &found.shape))
}

/// The start from data: the most likely of several fits to the first scans.
pub fn from_data(task: &Task<'_>) -> Result<Shape> {
    let search = Search { restarts: DATA_TRIES, turns: DATA_TURNS, floor: FLOOR };
    let scans = &scans(task)[..task.record.scans.len().min(DATA_SCANS)];
    let count = task.start.len();
    let found = fits(&window(task)?, Time::ZERO, scans, [count], &search, task.stream)?;
    let fit = found.first().ok_or_else(|| Error::Unsupported("no scans to begin with".into()))?;
    // Weights are known to be equal.
    Shape::new(fit.smoothed.shape.ellipses().iter().map(|e| Ellipse { weight: 1.0, ..*e }).collect())
}
