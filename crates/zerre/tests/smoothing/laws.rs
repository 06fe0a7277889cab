//! The laws of the smoothers: each runs over the whole list, and rejects what is broken on purpose. A law is
//! a function that says what is wrong.

use crate::list::{Entry, Figures, Means, figures, smoothers};
use crate::{DATA, LAST, Seen, exact, follow, lag_one, motion};
use zerre::kernels::{Simd, Threads};
use zerre::smooth::{History, rauch_tung_striebel};

type Verdict = Result<(), String>;

const RUNS: u64 = 40;

fn uphold(verdicts: impl IntoIterator<Item = (String, Verdict)>) {
    let broken: Vec<String> =
        verdicts.into_iter().filter_map(|(name, v)| v.err().map(|e| format!("{name}: {e}"))).collect();
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

/// The exact figures.
fn truth(data: &[Seen]) -> Figures {
    let filtered = exact(data);
    let smoothed = rauch_tung_striebel(&motion(), &filtered).unwrap();
    let mut all: Figures =
        smoothed.iter().flat_map(|b| figures(b.state.mean(), b.state.covariance())).collect();
    all.extend(
        (1..smoothed.len()).flat_map(|k| lag_one(&filtered[k - 1], &smoothed[k]).0.into_iter().flatten()),
    );
    all
}

/// Law 1: means, covariances and covariances over one step are those of the exact smoother: to 1e-9 where it
/// claims to be exact (numbers up to ten, systems of condition 1e3 at most); otherwise the mean of
/// independent runs to 6 of its standard errors, and 1e-3 more for the bias, which is of the order of the
/// variances, about 1, over the number of particles, here 2.5e-3, on the average less. Standard errors are
/// small. Beyond 6 of 39 degrees of freedom lies 5e-7 of Student's law, and there are some 4 000 comparisons.
fn smooths(entry: &Entry, data: &[Seen]) -> Verdict {
    let expected = truth(data);
    let runs = if entry.is_exact { 1 } else { RUNS };
    let found: Vec<Figures> =
        (0..runs).map(|seed| (entry.smooth)(data, seed, &Means::default()).unwrap()).collect();
    for (i, expected) in expected.iter().enumerate() {
        let n = runs as f64;
        let mean = found.iter().map(|f| f[i]).sum::<f64>() / n;
        if mean.is_nan() && i >= 5 * data.len() {
            continue;
        }
        let square = found.iter().map(|f| (f[i] - mean).powi(2)).sum::<f64>();
        let error = if entry.is_exact { 0.0 } else { (square / (n - 1.0) / n).sqrt() };
        let allowed = if entry.is_exact { 1e-9 } else { 6.0 * error + 1e-3 };
        if !((mean - expected).abs() < allowed && error < 0.03 * (1.0 + expected.abs())) {
            return Err(format!("figure {i} is {mean} +- {error}, exact {expected}"));
        }
    }
    Ok(())
}

#[test]
fn every_smoother_is_the_exact_one() {
    uphold(smoothers().iter().map(|entry| (entry.name.clone(), smooths(entry, &DATA))));
}

/// Nothing is seen: what is known at the end is what was predicted.
#[test]
fn without_measurements_every_smoother_predicts() {
    let unseen = DATA.map(|(t, _)| (t, None));
    uphold(smoothers().iter().map(|entry| (entry.name.clone(), smooths(entry, &unseen))));
}

/// What the filter knew, and lags that follow nobody back.
#[test]
fn what_does_not_smooth_is_found_out() {
    let filter: Entry = Entry {
        name: "filter".to_owned(),
        is_exact: false,
        smooth: Box::new(|data, seed, means| {
            let mut all = Figures::new();
            follow(&crate::list::bootstrap(means), data, seed, |cloud| {
                let mut history = History::new();
                history.record(cloud).unwrap();
                let lagged = history.lagged(0).unwrap();
                all.extend(figures(&lagged.mean(), &lagged.covariance()));
            });
            all.resize(all.len() + 4 * LAST, f64::NAN);
            Ok(all)
        }),
    };
    assert!(smooths(&filter, &DATA).is_err());
    let lazy = Entry {
        name: "exact filter".to_owned(),
        is_exact: true,
        smooth: Box::new(|data, _, _| {
            let mut all: Figures =
                exact(data).iter().flat_map(|b| figures(b.state.mean(), b.state.covariance())).collect();
            all.resize(all.len() + 4 * LAST, f64::NAN);
            Ok(all)
        }),
    };
    assert!(smooths(&lazy, &DATA).is_err());
}

fn bits(entry: &Entry, data: &[Seen], means: &Means) -> Vec<u64> {
    let figures = (entry.smooth)(data, 3, means).unwrap();
    figures.into_iter().map(f64::to_bits).collect()
}

/// Law 2: the bits do not depend on threads and lanes; they do on the seed, unless it is exact. Eight blocks
/// of particles are shared.
#[test]
fn threads_and_lanes_do_not_count() {
    let means = Means { particles: 3600, paths: 30, ..Means::default() };
    let data = &DATA[..4];
    let others: Vec<Means> = Simd::available()
        .into_iter()
        .map(|simd| Means { simd, ..means.clone() })
        .chain([Means { threads: Threads::new(2).unwrap(), ..means.clone() }])
        .collect();
    uphold(smoothers().iter().map(|entry| {
        let serial = bits(entry, data, &means);
        let other = others.iter().find(|other| bits(entry, data, other) != serial);
        let verdict = match other {
            Some(Means { simd, threads, .. }) => Err(format!("{} and {threads:?} differ", simd.name())),
            None => Ok(()),
        };
        let another = (entry.smooth)(data, 4, &means).unwrap();
        assert_eq!(entry.is_exact, another.iter().map(|x| x.to_bits()).eq(serial), "{}", entry.name);
        (entry.name.clone(), verdict)
    }));
}

/// Law 3: a measurement that is no number leaves nothing behind.
#[test]
fn bad_measurements_leave_nothing_behind() {
    let mut bad = DATA.to_vec();
    bad.insert(3, (1.5, Some(f64::NAN)));
    bad.insert(0, (0.0, Some(f64::NAN)));
    uphold(smoothers().iter().map(|entry| {
        let same = bits(entry, &bad, &Means::default()) == bits(entry, &DATA, &Means::default());
        (entry.name.clone(), if same { Ok(()) } else { Err("it has changed".to_owned()) })
    }));
}

/// The window of a fixed lag runs along with the filter: with no lag it is the filter, with three it knows
/// the three measurements that came after.
#[test]
fn fixed_lags_are_the_smoothers_of_what_is_known_then() {
    for (lag, at) in [(0, 7), (3, 7)] {
        let data = &DATA[..=at];
        let lagged: Entry = Entry {
            name: format!("lag {lag}"),
            is_exact: false,
            smooth: Box::new(move |data, seed, means| {
                let mut history = History::window(lag + 1).unwrap();
                let mut all = Figures::new();
                follow(&crate::list::bootstrap(means), data, seed, |cloud| {
                    history.record(cloud).unwrap();
                    let lagged = history.lagged(lag);
                    assert_eq!(lagged.is_ok(), history.len() == lag + 1);
                    let Ok(lagged) = lagged else { return };
                    if lag == 0 {
                        assert!((lagged.mean()[0] - cloud.mean()[0]).abs() < 1e-12);
                        assert!(lagged.gaussian().is_ok());
                        let [a] = lagged.quantiles(1, [0.3]).unwrap();
                        assert_eq!([a], cloud.quantiles(1, [0.3]).unwrap());
                    }
                    all = vec![f64::NAN; 5 * (LAST + 1) + 4 * LAST];
                    all[..5].copy_from_slice(&figures(&lagged.mean(), &lagged.covariance()));
                });
                Ok(all)
            }),
        };
        let expected = rauch_tung_striebel(&motion(), &exact(data)).unwrap()[at - lag];
        let expected = figures(expected.state.mean(), expected.state.covariance());
        let found: Vec<Figures> =
            (0..RUNS).map(|seed| (lagged.smooth)(data, seed, &Means::default()).unwrap()).collect();
        for (i, expected) in expected.iter().enumerate() {
            let n = RUNS as f64;
            let mean = found.iter().map(|f| f[i]).sum::<f64>() / n;
            let square = found.iter().map(|f| (f[i] - mean).powi(2)).sum::<f64>();
            let error = (square / (n - 1.0) / n).sqrt();
            assert!((mean - expected).abs() < 6.0 * error + 1e-3 && error < 0.02, "{} {i}", lagged.name);
        }
    }
}
