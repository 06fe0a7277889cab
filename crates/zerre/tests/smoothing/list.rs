//! The list of smoothers under law.

use crate::{Seen, exact, follow, motion, prior, sensor};
use std::array::from_fn;
use zerre::belief::{Cloud, Gaussian, MovedCloud};
use zerre::filter::{
    Extended, Filter, Imm, Linear, McmcSettings, ParticleFilter, ResampleMove, SequentialMcmc, Settings,
    SigmaPoints, Size, Tangent, Unscented,
};
use zerre::kernels::{Simd, Threads};
use zerre::math::Matrix;
use zerre::model::measurement::Position;
use zerre::model::motion::ConstantVelocity;
use zerre::model::{Chain, JumpMarkov, StateSpace};
use zerre::moves::Move;
use zerre::proposal::Guided;
use zerre::resample::Trigger;
use zerre::rng::Stream;
use zerre::smooth::{
    Backward, History, Paris, PathStep, backward_paths, conditional_path, rauch_tung_striebel,
    smooth_gaussian, smooth_modes,
};
use zerre::{Result, Time};

/// What does not change what a smoother is.
#[derive(Clone)]
pub struct Means {
    pub particles: usize,
    pub paths: usize,
    pub simd: Simd,
    pub threads: Threads,
}

impl Default for Means {
    fn default() -> Self {
        Means { particles: 400, paths: 400, simd: Simd::best(), threads: Threads::Serial }
    }
}

/// What is compared: for every instant the mean and the three numbers of the covariance, then for every step
/// the four of the covariance of the states before and after it; NaN where a smoother does not say.
pub type Figures = Vec<f64>;

/// From measurements and a seed.
pub type Smooth = Box<dyn Fn(&[Seen], u64, &Means) -> Result<Figures>>;

pub struct Entry {
    pub name: String,
    /// Whether it is exact up to rounding.
    pub is_exact: bool,
    pub smooth: Smooth,
}

type Filtered<F> = fn(&<F as Filter>::Belief) -> &Cloud<2>;
type Bootstrap = ParticleFilter<2, 2, ConstantVelocity<1>, Position<1>>;

fn settings(means: &Means) -> Settings {
    let &Means { particles, simd, ref threads, .. } = means;
    let trigger = Trigger::Below(0.7);
    Settings { particles, trigger, simd, threads: threads.clone(), ..Settings::default() }
}

pub fn bootstrap(means: &Means) -> Bootstrap {
    ParticleFilter::new(prior(), motion(), sensor(), settings(means)).unwrap()
}

/// The list.
pub fn smoothers() -> Vec<Entry> {
    let mut list = gaussian();
    let sums = Backward::Rejection { tries: 0 };
    list.push(entry("bootstrap, backward by sums", backwards(|means| (bootstrap(means), |c| c), sums)));
    particles(&mut list, "bootstrap", |means| (bootstrap(means), |c| c));
    let auxiliary = |means: &Means| {
        let settings = Settings { lookahead: Some(1.0), ..settings(means) };
        ParticleFilter::new(prior(), motion(), sensor(), settings).unwrap()
    };
    particles(&mut list, "auxiliary", move |means| (auxiliary(means), |c| c));
    particles(&mut list, "of a changing number", |means| {
        let numbers = [2, 3, 1].map(|thirds| (means.particles * thirds / 2) as u32);
        let settings = Settings { size: Size::Recorded(numbers.into()), ..settings(means) };
        (ParticleFilter::new(prior(), motion(), sensor(), settings).unwrap(), |c| c)
    });
    particles(&mut list, "fully adapted", |means| {
        let settings = Settings { lookahead: Some(1.0), ..settings(means) };
        let optimal = Guided::<Linear, 1>::new(Linear);
        (ParticleFilter::guided(prior(), motion(), sensor(), optimal, settings).unwrap(), |c| c)
    });
    particles(&mut list, "resample-move", |means| {
        (ResampleMove::new(bootstrap(means), Move::default(), 2).unwrap(), MovedCloud::cloud)
    });
    particles(&mut list, "sequential MCMC", |means| {
        let &Means { particles, simd, ref threads, .. } = means;
        let threads = threads.clone();
        let settings = McmcSettings { particles, sweeps: 1, simd, threads, ..McmcSettings::default() };
        (SequentialMcmc::new(prior(), motion(), sensor(), settings).unwrap(), MovedCloud::cloud)
    });
    for how in [Backward::default(), Backward::Moves { count: 10 }] {
        list.push(entry(format!("bootstrap, PaRIS, {how:?}"), paris(|means| (bootstrap(means), |c| c), how)));
    }
    list.push(entry(
        "auxiliary, PaRIS",
        paris(move |m| (auxiliary(m), |c| c), Backward::Moves { count: 10 }),
    ));
    list.push(entry("conditional paths", Box::new(conditional)));
    list
}

fn entry(name: impl Into<String>, smooth: Smooth) -> Entry {
    Entry { name: name.into(), is_exact: false, smooth }
}

/// What every history must serve.
fn particles<F: Filter<Measurement = [f64; 1]> + 'static>(
    list: &mut Vec<Entry>,
    name: &str,
    filter: impl Fn(&Means) -> (F, Filtered<F>) + Copy + 'static,
) {
    for how in [Backward::default(), Backward::Moves { count: 10 }] {
        list.push(entry(format!("{name}, backward by {how:?}"), backwards(filter, how)));
    }
    list.push(entry(format!("{name}, fixed lag"), fixed_lag(filter)));
}

/// Those of Gaussian beliefs.
fn gaussian() -> Vec<Entry> {
    let mut list = Vec::new();
    let mut add = |name: &str, smooth: fn(&[Seen]) -> Result<Vec<Gaussian<2>>>| {
        let smooth: Smooth = Box::new(move |data, _, _| {
            let laws = smooth(data)?;
            let moments = laws.iter().flat_map(|law| figures(law.mean(), law.covariance())).collect();
            Ok(without_steps(moments))
        });
        list.push(Entry { name: name.to_owned(), is_exact: true, smooth });
    };
    add("Rauch-Tung-Striebel", |data| {
        Ok(rauch_tung_striebel(&motion(), &exact(data))?.into_iter().map(|belief| belief.state).collect())
    });
    add("extended", |data| {
        let mut filtered = Vec::new();
        follow(&Extended::new(motion(), sensor(), prior()), data, 0, |belief| filtered.push(*belief));
        Ok(smooth_gaussian(&Tangent, &motion(), &filtered)?.into_iter().map(|b| b.state).collect())
    });
    add("unscented", |data| {
        let (points, mut filtered) = (SigmaPoints::default(), Vec::new());
        follow(&Unscented::new(motion(), sensor(), prior(), points)?, data, 0, |b| filtered.push(*b));
        Ok(smooth_gaussian(&points, &motion(), &filtered)?.into_iter().map(|b| b.state).collect())
    });
    add("cubature", |data| {
        let points = SigmaPoints::cubature();
        Ok(smooth_gaussian(&points, &motion(), &exact(data))?.into_iter().map(|b| b.state).collect())
    });
    add("Kim, one mode", |data| {
        let model = JumpMarkov::new(vec![motion()], Chain::staying(1, 1.0)?)?;
        let mut filtered = Vec::new();
        let imm = Imm::new(Linear, model.clone(), sensor(), prior())?;
        follow(&imm, data, 0, |belief| filtered.push(belief.clone()));
        smooth_modes(&model, &filtered)?.iter().map(|belief| belief.combined()).collect()
    });
    list
}

/// Mean and covariance in the order of [`Figures`].
pub fn figures(mean: &[f64; 2], covariance: &Matrix<2, 2>) -> [f64; 5] {
    let [[pp, pv], [_, vv]] = covariance.0;
    [mean[0], mean[1], pp, pv, vv]
}

fn without_steps(mut moments: Figures) -> Figures {
    let instants = moments.len() / 5;
    moments.resize(5 * instants + 4 * (instants - 1), f64::NAN);
    moments
}

fn recorded<F: Filter<Measurement = [f64; 1]>>(
    (filter, cloud): (F, Filtered<F>),
    data: &[Seen],
    seed: u64,
) -> History<2> {
    let mut history = History::new();
    follow(&filter, data, seed, |belief| history.record(cloud(belief)).unwrap());
    history
}

fn backwards<F: Filter<Measurement = [f64; 1]> + 'static>(
    filter: impl Fn(&Means) -> (F, Filtered<F>) + 'static,
    how: Backward,
) -> Smooth {
    Box::new(move |data, seed, means| {
        let history = recorded(filter(means), data, seed);
        let stream = Stream::new(seed).fork(1);
        let paths = backward_paths(&motion(), &history, means.paths, how, stream, &means.threads)?;
        let state = |k, j| paths.state(k, j).unwrap();
        let all: Vec<Vec<[f64; 2]>> =
            (0..paths.count()).map(|j| (0..paths.len()).map(|k| state(k, j)).collect()).collect();
        Ok(of_paths(&all))
    })
}

/// Sample moments of paths.
fn of_paths(paths: &[Vec<[f64; 2]>]) -> Figures {
    let (n, instants) = (paths.len() as f64, paths[0].len());
    let mean = |k: usize| from_fn(|a| paths.iter().map(|path| path[k][a]).sum::<f64>() / n);
    let means: Vec<[f64; 2]> = (0..instants).map(mean).collect();
    let between = |k: usize, l: usize| {
        Matrix::<2, 2>::from_entries(|a, b| {
            let product = |path: &Vec<[f64; 2]>| (path[k][a] - means[k][a]) * (path[l][b] - means[l][b]);
            paths.iter().map(product).sum::<f64>() / n
        })
    };
    let mut all: Figures = (0..instants).flat_map(|k| figures(&means[k], &between(k, k))).collect();
    all.extend((1..instants).flat_map(|k| between(k - 1, k).0.into_iter().flatten()));
    all
}

/// From the last instant as far back as there are records.
fn fixed_lag<F: Filter<Measurement = [f64; 1]> + 'static>(
    filter: impl Fn(&Means) -> (F, Filtered<F>) + 'static,
) -> Smooth {
    Box::new(move |data, seed, means| {
        let history = recorded(filter(means), data, seed);
        let mut all = Figures::new();
        for lag in (0..history.len()).rev() {
            let lagged = history.lagged(lag)?;
            all.extend(figures(&lagged.mean(), &lagged.covariance()));
        }
        Ok(without_steps(all))
    })
}

/// Most instants that [`paris`] takes.
const MOST: usize = 10;
/// First and second moments of each instant, products of each step, and the number of terms.
const SUMS: usize = 9 * MOST + 1;

fn paris<F: Filter<Measurement = [f64; 1]> + 'static>(
    filter: impl Fn(&Means) -> (F, Filtered<F>) + 'static,
    how: Backward,
) -> Smooth {
    Box::new(move |data, seed, means| {
        let moments = |[p, v]: &[f64; 2]| [*p, *v, p * p, p * v, v * v];
        let mut paris: Option<Paris<2, SUMS>> = None;
        let mut steps = 0;
        let (filter, cloud) = filter(means);
        follow(&filter, data, seed, |belief| match &mut paris {
            None => {
                let first = |x: &[f64; 2]| {
                    let mut sums = [0.0; SUMS];
                    sums[..5].copy_from_slice(&moments(x));
                    sums
                };
                let stream = Stream::new(seed).fork(2);
                paris = Some(Paris::new(cloud(belief), how, stream, first).unwrap());
            }
            Some(paris) => {
                steps += 1;
                let term = |step: &PathStep<2>| {
                    let (a, b, mut sums) = (step.before, step.after, [0.0; SUMS]);
                    assert!(step.from <= step.to && (step.from < step.to || a == b));
                    sums[5 * steps..][..5].copy_from_slice(&moments(&b));
                    let products = [a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1]];
                    sums[5 * MOST + 4 * (steps - 1)..][..4].copy_from_slice(&products);
                    sums[SUMS - 1] = 1.0;
                    sums
                };
                paris.step(&motion(), cloud(belief), term).unwrap();
            }
        });
        let sums = paris.unwrap().expectation()?;
        assert!((sums[SUMS - 1] - steps as f64).abs() < 1e-9, "terms are counted once");
        let mean = |k: usize| [sums[5 * k], sums[5 * k + 1]];
        let mut all: Figures = (0..=steps)
            .flat_map(|k| {
                let ([p, v], seconds) = (mean(k), &sums[5 * k + 2..]);
                [p, v, seconds[0] - p * p, seconds[1] - p * v, seconds[2] - v * v]
            })
            .collect();
        all.extend((0..4 * steps).map(|i| {
            let (before, after) = (mean(i / 4), mean(i / 4 + 1));
            sums[5 * MOST + i] - before[i % 4 / 2] * after[i % 2]
        }));
        Ok(all)
    })
}

/// A chain of paths, each made from the one before by twenty particles; the first thirty, which still know
/// where the chain began, do not count.
fn conditional(data: &[Seen], seed: u64, means: &Means) -> Result<Figures> {
    let model = StateSpace { prior: prior(), motion: motion(), sensor: sensor() };
    let good = data.iter().filter(|(_, z)| !z.is_some_and(f64::is_nan));
    let data: Vec<_> = good.map(|&(t, z)| (Time::from_secs(t), z.map(|z| [z]))).collect();
    let mut path = vec![[0.0, 0.0]; data.len() + 1];
    let mut paths = Vec::new();
    for turn in 0..means.paths as u64 + 30 {
        let stream = Stream::new(seed).fork(turn);
        path = conditional_path(&model, (Time::ZERO, &data), Some(&path), 20, stream)?;
        // The first state is that of the start, the time of the first measurement.
        paths.push(path[1..].to_vec());
    }
    Ok(of_paths(&paths[30..]))
}
