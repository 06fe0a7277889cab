//! Which model to compute next: weighted statistical model selection, the rule that lets a multiple-model filter move
//! its particles under one model while that model explains the measurements.
//!
//! The models chosen last vote, the newer the louder; the model with the most votes is computed alone. An error above a
//! threshold calls all models back. The number of votes and the threshold follow the errors. Nothing here knows of
//! particles: a filter asks [`Selector::choose`] before a step and tells [`Selector::record`] after it.

use crate::error::{Error, Result};
use crate::model::jump::MAX_MODES;
use serde::{Deserialize, Serialize};

/// Longest window: more choices than this are not kept.
pub const MAX_WINDOW: usize = 32;

/// Rules of the selection. Errors and thresholds are in the unit of the caller's error of an estimate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Wsms {
    /// Size of the window at the start: how many of the last choices vote; 10 by default. It is a real number that the
    /// rule moves, and is rounded for use.
    pub window: f64,
    /// Smallest and largest window: 3 and 20 by default, at least 1 and at most [`MAX_WINDOW`].
    pub window_range: (f64, f64),
    /// The window moves after every step but this many at the start; 2 by default.
    pub window_kept: u64,
    /// Threshold at the start: a larger error calls for all models; 0.07 by default.
    pub threshold: f64,
    /// Smallest and largest threshold: 0.035 and 0.07 by default; an infinite bound is allowed above.
    pub threshold_range: (f64, f64),
    /// So many steps at the start compute all models and leave the threshold alone; by default (`None`) as many as
    /// there are models.
    pub warm_up: Option<u64>,
    /// How window and threshold follow the errors.
    pub rule: Rule,
}

/// How window and threshold follow the error e of a step with threshold tau.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Rule {
    /// By constant factors: where e > tau the window is divided by one and the threshold multiplied by the other,
    /// where not, the reverse.
    SemiDynamic {
        /// Factor of the window, 1.1 in [`Rule::semi_dynamic`]; at least 1.
        window_factor: f64,
        /// Factor of the threshold, 1.1 in [`Rule::semi_dynamic`]; at least 1.
        threshold_factor: f64,
    },
    /// By the error: the window shrinks (e > tau) or grows (else) by e / tau, rounded, halves away from zero; the
    /// threshold becomes e where e is less than the error before.
    Dynamic,
}

impl Rule {
    /// [`Rule::SemiDynamic`] with both factors 1.1.
    pub fn semi_dynamic() -> Self {
        Rule::SemiDynamic { window_factor: 1.1, threshold_factor: 1.1 }
    }
}

impl Default for Wsms {
    fn default() -> Self {
        Wsms {
            window: 10.0,
            window_range: (3.0, 20.0),
            window_kept: 2,
            threshold: 0.07,
            threshold_range: (0.035, 0.07),
            warm_up: None,
            rule: Rule::semi_dynamic(),
        }
    }
}

impl Wsms {
    /// Whether the numbers make sense together.
    ///
    /// # Errors
    /// A range that is empty or out of bounds, a start outside its range, a factor below 1, a number that is not
    /// finite.
    pub fn check(&self) -> Result<()> {
        let within = |what, value, needs, good| {
            Error::finite(what, value)?;
            if good { Ok(()) } else { Err(Error::OutOfRange { what, value, needs }) }
        };
        let (least, most) = self.window_range;
        within("smallest window", least, "it must be at least 1", least >= 1.0)?;
        let needs = "it must lie between the smallest window and 32";
        within("largest window", most, needs, least <= most && most <= MAX_WINDOW as f64)?;
        let needs = "it must lie between the smallest and the largest";
        within("window", self.window, needs, least <= self.window && self.window <= most)?;
        let (least, most) = self.threshold_range;
        within("smallest threshold", least, "it must be above zero", least > 0.0)?;
        if most.is_nan() || most < least {
            let needs = "it must not be below the smallest";
            return Err(Error::OutOfRange { what: "largest threshold", value: most, needs });
        }
        within("threshold", self.threshold, needs, least <= self.threshold && self.threshold <= most)?;
        if let Rule::SemiDynamic { window_factor, threshold_factor } = self.rule {
            let needs = "it must be at least 1";
            within("factor of the window", window_factor, needs, window_factor >= 1.0)?;
            within("factor of the threshold", threshold_factor, needs, threshold_factor >= 1.0)?;
        }
        Ok(())
    }

    fn warm_up(&self, models: usize) -> u64 {
        self.warm_up.unwrap_or(models as u64)
    }
}

/// What to compute in a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// All models.
    All,
    /// One model alone, by its number.
    One(usize),
}

/// What the selection remembers between steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Saved", into = "Saved")]
pub struct Selector {
    models: usize,
    /// The last choices, oldest first, `len` of them.
    chosen: [u8; MAX_WINDOW],
    len: usize,
    window: f64,
    threshold: f64,
    all: bool,
    last_error: Option<f64>,
    steps: u64,
}

impl Selector {
    /// A selection among `models` models, before the first step.
    ///
    /// # Errors
    /// As [`Wsms::check`]; no model or more than [`MAX_MODES`].
    pub fn new(rules: &Wsms, models: usize) -> Result<Self> {
        rules.check()?;
        if models == 0 || models > MAX_MODES {
            let (what, value) = ("number of models", models as f64);
            return Err(Error::OutOfRange { what, value, needs: "it must lie between 1 and 16" });
        }
        Ok(Selector {
            models,
            chosen: [0; MAX_WINDOW],
            len: 0,
            window: rules.window,
            threshold: rules.threshold,
            all: false,
            last_error: None,
            steps: 0,
        })
    }

    /// What the next step has to compute: all models while warming up and after an error above the threshold, else the
    /// model with the most votes, of several the one chosen last.
    pub fn choose(&self, rules: &Wsms) -> Choice {
        let window = self.window();
        if self.steps < rules.warm_up(self.models) || self.all || window.is_empty() {
            return Choice::All;
        }
        let votes = weighted_votes(window, self.models);
        let most = votes.iter().copied().fold(0.0, f64::max);
        let newest = window.iter().rev().find(|&&model| votes[usize::from(model)] == most);
        newest.map_or(Choice::All, |&model| Choice::One(usize::from(model)))
    }

    /// Takes in what a step came to: the model it selected (the one computed, or of all the one with the least error)
    /// and the error of its output. An error that is not finite says nothing but that all models are needed: it moves
    /// neither window nor threshold.
    ///
    /// # Panics
    /// If there is no such model.
    pub fn record(&mut self, rules: &Wsms, selected: usize, error: f64) {
        assert!(selected < self.models, "no such model");
        if self.len == MAX_WINDOW {
            self.chosen.rotate_left(1);
            self.len -= 1;
        }
        self.chosen[self.len] = selected as u8;
        self.len += 1;
        self.steps += 1;
        let missed = error.is_nan() || error > self.threshold;
        self.all = missed;
        if !error.is_finite() {
            return;
        }
        let (window, threshold) = match rules.rule {
            Rule::SemiDynamic { window_factor, threshold_factor } if missed => {
                (self.window / window_factor, self.threshold * threshold_factor)
            }
            Rule::SemiDynamic { window_factor, threshold_factor } => {
                (self.window * window_factor, self.threshold / threshold_factor)
            }
            Rule::Dynamic => {
                let step = (error / self.threshold).round();
                let less = self.last_error.is_some_and(|before| before > error);
                (
                    if missed { self.window - step } else { self.window + step },
                    if less { error } else { self.threshold },
                )
            }
        };
        if self.steps > rules.window_kept {
            self.window = window.clamp(rules.window_range.0, rules.window_range.1);
        }
        if self.steps > rules.warm_up(self.models) {
            self.threshold = threshold.clamp(rules.threshold_range.0, rules.threshold_range.1);
        }
        self.last_error = Some(error);
    }

    /// The choices that vote, oldest first.
    pub fn window(&self) -> &[u8] {
        let votes = (self.window.round() as usize).min(self.len);
        &self.chosen[self.len - votes..self.len]
    }

    /// Size of the window before rounding.
    pub fn window_size(&self) -> f64 {
        self.window
    }

    /// Error above which the next step is followed by one with all models.
    pub fn threshold(&self) -> f64 {
        self.threshold
    }

    /// The model selected by the last step; `None` before the first.
    pub fn last(&self) -> Option<usize> {
        self.chosen[..self.len].last().map(|&model| usize::from(model))
    }
}

/// Votes of a window (model numbers, oldest first): the k-th of n entries weighs k, and each model's sum of weights is
/// multiplied by its frequency among the n. Entries that are no model count among the n only.
pub fn weighted_votes(window: &[u8], models: usize) -> [f64; MAX_MODES] {
    let models = models.min(MAX_MODES);
    let (mut counts, mut sums) = ([0usize; MAX_MODES], [0usize; MAX_MODES]);
    for (k, &model) in window.iter().enumerate() {
        if usize::from(model) < models {
            counts[usize::from(model)] += 1;
            sums[usize::from(model)] += k + 1;
        }
    }
    // The product is a whole number: equal votes are equal bits, whatever their order.
    std::array::from_fn(
        |m| {
            if counts[m] == 0 { 0.0 } else { (counts[m] * sums[m]) as f64 / window.len() as f64 }
        },
    )
}

/// A [`Selector`] as it is saved.
#[derive(Serialize, Deserialize)]
struct Saved {
    models: usize,
    chosen: Vec<u8>,
    window: f64,
    threshold: f64,
    all: bool,
    last_error: Option<f64>,
    steps: u64,
}

impl From<Selector> for Saved {
    fn from(from: Selector) -> Self {
        let Selector { models, chosen, len, window, threshold, all, last_error, steps } = from;
        Saved { models, chosen: chosen[..len].to_vec(), window, threshold, all, last_error, steps }
    }
}

impl TryFrom<Saved> for Selector {
    type Error = Error;

    fn try_from(from: Saved) -> Result<Self> {
        let Saved { models, chosen: saved, window, threshold, all, last_error, steps } = from;
        let start = Selector::new(&Wsms::default(), models)?;
        let len = saved.len();
        if len > MAX_WINDOW {
            let what = "saved choices of a selection";
            return Err(Error::Shape { what, found: len, expected: MAX_WINDOW });
        }
        if let Some(&bad) = saved.iter().find(|&&model| usize::from(model) >= models) {
            let what = "model of a saved choice";
            return Err(Error::Shape { what, found: usize::from(bad), expected: models - 1 });
        }
        Error::positive("saved size of the window", window)?;
        Error::positive("saved threshold", threshold)?;
        last_error.map(|error| Error::finite("saved error", error)).transpose()?;
        let mut chosen = start.chosen;
        chosen[..len].copy_from_slice(&saved);
        Ok(Selector { models, chosen, len, window, threshold, all, last_error, steps })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DYNAMIC: Wsms = Wsms {
        window: 10.0,
        window_range: (3.0, 20.0),
        window_kept: 2,
        threshold: 0.07,
        threshold_range: (0.035, 0.07),
        warm_up: None,
        rule: Rule::Dynamic,
    };

    /// Models 1 to 4 of the worked example, as numbers from 0.
    const EXAMPLE: [u8; 10] = [0, 1, 0, 2, 3, 2, 1, 2, 3, 0];

    fn selector(rules: &Wsms, models: usize, steps: &[(usize, f64)]) -> Selector {
        let mut selector = Selector::new(rules, models).unwrap();
        for &(model, error) in steps {
            selector.record(rules, model, error);
        }
        selector
    }

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-14 * b.abs()
    }

    #[test]
    fn the_worked_example_selects_model_three() {
        assert_eq!(weighted_votes(&EXAMPLE, 4)[..4], [4.2, 1.8, 5.4, 2.8]);
        // Small errors let the window grow to more places than there are choices: all ten vote.
        let steps = EXAMPLE.map(|model| (usize::from(model), 0.03));
        assert_eq!(selector(&Wsms::default(), 4, &steps).choose(&Wsms::default()), Choice::One(2));
    }

    /// Read backwards the same window has other votes, and another winner: the order matters.
    #[test]
    fn the_newest_choice_weighs_most() {
        let mut backwards = EXAMPLE;
        backwards.reverse();
        let votes = weighted_votes(&backwards, 4);
        // Weights 1, 8, 10 of model 1 and 3, 5, 7 of model 3, each chosen 3 times of 10.
        assert!(close(votes[0], 5.7) && close(votes[2], 4.5), "{votes:?}");
    }

    /// How long a manoeuvre goes unnoticed: of ten places the new model needs the newest four.
    #[test]
    fn a_new_model_needs_four_of_ten_places() {
        for (newest, votes, wins) in [(4, (13.6, 12.6), true), (3, (8.1, 19.6), false)] {
            let window: Vec<u8> = (0..10).map(|k| u8::from(k >= 10 - newest)).collect();
            let scores = weighted_votes(&window, 2);
            assert_eq!((scores[1], scores[0]), votes);
            let rules =
                Wsms { rule: Rule::SemiDynamic { window_factor: 1.0, threshold_factor: 1.0 }, ..DYNAMIC };
            let steps: Vec<_> = window.iter().map(|&model| (usize::from(model), 0.01)).collect();
            let chosen = selector(&rules, 2, &steps).choose(&rules);
            assert_eq!(chosen, Choice::One(usize::from(wins)));
        }
    }

    #[test]
    fn a_window_votes_with_its_newest_entries_only() {
        let rules = Wsms { window: 3.0, window_range: (3.0, 3.0), ..Wsms::default() };
        let steps = [0, 0, 0, 0, 0, 1, 0, 1].map(|model| (model, 0.01));
        let selector = selector(&rules, 2, &steps);
        assert_eq!(selector.window(), [1, 0, 1]);
        assert_eq!(selector.choose(&rules), Choice::One(1));
    }

    /// Window and threshold after each of the errors, worked out by hand. Two models: the threshold moves from step 3
    /// on, as the window does.
    #[test]
    fn the_semi_dynamic_rule_step_by_step() {
        let rules = Wsms::default();
        let mut selector = Selector::new(&rules, 2).unwrap();
        let steps: [(f64, f64, f64, bool); 7] = [
            (0.09, 10.0, 0.07, true),
            (0.01, 10.0, 0.07, false),
            (0.01, 11.0, 0.07 / 1.1, false),
            (0.01, 12.1, 0.07 / 1.1 / 1.1, false),
            // Above the threshold of 0.0579.
            (0.06, 12.1 / 1.1, 0.07 / 1.1, true),
            // Just below the threshold of 0.0636.
            (0.0636, 12.1, 0.07 / 1.1 / 1.1, false),
            (0.5, 11.0, 0.07 / 1.1, true),
        ];
        for (k, (error, window, threshold, all)) in steps.into_iter().enumerate() {
            selector.record(&rules, 0, error);
            assert!(close(selector.window_size(), window), "{k}: {}", selector.window_size());
            assert!(close(selector.threshold(), threshold), "{k}: {}", selector.threshold());
            let choice = if all || k == 0 { Choice::All } else { Choice::One(0) };
            assert_eq!(selector.choose(&rules), choice, "{k}");
        }
    }

    #[test]
    fn the_dynamic_rule_step_by_step() {
        let mut selector = Selector::new(&DYNAMIC, 3).unwrap();
        let steps = [
            // Window fixed for two steps, threshold for three.
            (0.2, 10.0, 0.07),
            (0.1, 10.0, 0.07),
            // 0.06 / 0.07 rounds to 1: the window grows; the error fell, but the models warm up still.
            (0.06, 11.0, 0.07),
            // 0.05 / 0.07 = 0.71: grows by 1; the error fell: it is the threshold.
            (0.05, 12.0, 0.05),
            // 0.126 / 0.05 = 2.52: shrinks by 3; the error rose: the threshold stays.
            (0.126, 9.0, 0.05),
            // 0.01 / 0.05 = 0.2: no change of the window; the threshold falls no lower than its bound.
            (0.01, 9.0, 0.035),
            // 0.035 / 0.035 = 1, not above the threshold: grows.
            (0.035, 10.0, 0.035),
            // 0.4 / 0.035 = 11.4: shrinks by 11, to the least window.
            (0.4, 3.0, 0.035),
            // 0.3 / 0.035 = 8.6: still the least; the error fell: the threshold rises to its upper bound.
            (0.3, 3.0, 0.07),
        ];
        for (k, (error, window, threshold)) in steps.into_iter().enumerate() {
            let all = error > selector.threshold();
            selector.record(&DYNAMIC, k % 3, error);
            assert!(close(selector.window_size(), window), "{k}: {}", selector.window_size());
            assert!(close(selector.threshold(), threshold), "{k}: {}", selector.threshold());
            assert_eq!(selector.choose(&DYNAMIC) == Choice::All, all || k < 2, "{k}");
        }
    }

    /// 0.125 / 0.25 is half a step exactly: away from zero, up and down.
    #[test]
    fn halves_round_away_from_zero() {
        let rules = Wsms { threshold: 0.25, threshold_range: (0.25, 0.25), window_kept: 0, ..DYNAMIC };
        assert_eq!(selector(&rules, 1, &[(0, 0.125)]).window_size(), 11.0);
        assert_eq!(selector(&rules, 1, &[(0, 0.625)]).window_size(), 7.0);
    }

    #[test]
    fn bounds_hold_both_rules() {
        for rule in [Rule::semi_dynamic(), Rule::Dynamic] {
            let rules = Wsms { rule, ..Wsms::default() };
            let quiet = selector(&rules, 4, &[(0, 0.04); 60]);
            assert_eq!(quiet.window_size(), 20.0);
            let lost = selector(&rules, 4, &[(0, 9.0); 60]);
            assert_eq!((lost.window_size(), lost.threshold()), (3.0, 0.07));
        }
        let low = selector(&Wsms::default(), 4, &[(0, 0.0); 60]);
        assert_eq!(low.threshold(), 0.035);
        let free = Wsms { threshold_range: (0.035, f64::INFINITY), ..Wsms::default() };
        assert!(selector(&free, 4, &[(0, 9.0); 60]).threshold() > 8.0);
    }

    #[test]
    fn warming_up_computes_all_models() {
        for models in 1..=MAX_MODES {
            let rules = Wsms::default();
            let mut selector = Selector::new(&rules, models).unwrap();
            for _ in 0..models {
                assert_eq!(selector.choose(&rules), Choice::All);
                assert_eq!(selector.threshold(), 0.07);
                selector.record(&rules, models - 1, 0.01);
            }
            assert_eq!(selector.choose(&rules), Choice::One(models - 1));
        }
        let none = Wsms { warm_up: Some(0), ..Wsms::default() };
        let mut selector = Selector::new(&none, 3).unwrap();
        assert_eq!(selector.choose(&none), Choice::All);
        selector.record(&none, 1, 0.01);
        assert_eq!(selector.choose(&none), Choice::One(1));
    }

    /// Of four choices the outer two weigh 1 + 4, the inner two 2 + 3.
    #[test]
    fn ties_go_to_the_most_recent() {
        for window in [[1, 0, 0, 1], [0, 1, 1, 0]] {
            let votes = weighted_votes(&window, 2);
            assert_eq!(votes[0], votes[1]);
            let rules = Wsms { window: 4.0, window_range: (4.0, 4.0), ..Wsms::default() };
            let steps = window.map(|model| (usize::from(model), 0.01));
            let chosen = selector(&rules, 2, &steps).choose(&rules);
            assert_eq!(chosen, Choice::One(usize::from(window[3])));
        }
    }

    #[test]
    fn an_error_that_is_no_number_calls_all_models_and_moves_nothing() {
        for rule in [Rule::semi_dynamic(), Rule::Dynamic] {
            let rules = Wsms { rule, ..Wsms::default() };
            for error in [f64::NAN, f64::INFINITY] {
                let mut selector = selector(&rules, 2, &[(0, 0.02); 5]);
                let before = (selector.window_size(), selector.threshold());
                selector.record(&rules, 1, error);
                assert_eq!((selector.window_size(), selector.threshold()), before);
                assert_eq!((selector.choose(&rules), selector.last()), (Choice::All, Some(1)));
            }
        }
    }

    #[test]
    fn rules_that_make_no_sense_are_refused() {
        let rules = Wsms::default();
        assert!(rules.check().is_ok() && DYNAMIC.check().is_ok());
        let factors = |window_factor, threshold_factor| Wsms {
            rule: Rule::SemiDynamic { window_factor, threshold_factor },
            ..rules
        };
        for bad in [
            Wsms { window: 21.0, ..rules },
            Wsms { window: f64::NAN, ..rules },
            Wsms { window_range: (0.0, 20.0), ..rules },
            Wsms { window_range: (3.0, 33.0), ..rules },
            Wsms { window_range: (12.0, 11.0), ..rules },
            Wsms { threshold: 0.01, ..rules },
            Wsms { threshold: f64::INFINITY, threshold_range: (0.035, f64::INFINITY), ..rules },
            Wsms { threshold_range: (0.0, 0.07), ..rules },
            Wsms { threshold_range: (0.035, f64::NAN), ..rules },
            factors(0.9, 1.1),
            factors(1.1, f64::INFINITY),
        ] {
            assert!(bad.check().is_err() && Selector::new(&bad, 3).is_err(), "{bad:?}");
        }
        assert!(Selector::new(&rules, 0).is_err() && Selector::new(&rules, 17).is_err());
    }

    #[test]
    fn a_damaged_save_is_refused() {
        let rules = Wsms::default();
        let good = serde_json::to_value(selector(&rules, 2, &[(1, 0.05); 40])).unwrap();
        assert!(serde_json::from_value::<Selector>(good.clone()).is_ok());
        for (field, value) in [
            ("models", serde_json::json!(17)),
            ("chosen", serde_json::json!([0, 2])),
            ("chosen", serde_json::json!(vec![0; 33])),
            ("window", serde_json::json!(-1.0)),
            ("threshold", serde_json::json!(0.0)),
        ] {
            let mut bad = good.clone();
            bad[field] = value;
            assert!(serde_json::from_value::<Selector>(bad).is_err(), "{field}");
        }
    }

    proptest! {
        /// Whatever the errors: window and threshold stay in their ranges, the choice is a model, and a selection that
        /// was saved and loaded goes on as the other.
        #[test]
        fn ranges_hold_for_any_errors(
            dynamic: bool,
            models in 1..=MAX_MODES,
            steps in prop::collection::vec((0..MAX_MODES, prop_oneof![
                0.0..0.2f64, 0.0..1e300f64, Just(0.0), Just(f64::NAN), Just(f64::INFINITY), Just(f64::MAX)
            ]), 0..80),
        ) {
            let rule = if dynamic { Rule::Dynamic } else { Rule::semi_dynamic() };
            let rules = Wsms { rule, ..Wsms::default() };
            let mut selector = Selector::new(&rules, models).unwrap();
            for (k, &(model, error)) in steps.iter().enumerate() {
                let saved = serde_json::to_string(&selector).unwrap();
                selector = serde_json::from_str(&saved).unwrap();
                let choice = selector.choose(&rules);
                prop_assert!(k >= models || choice == Choice::All);
                if let Choice::One(chosen) = choice {
                    prop_assert!(selector.window().contains(&(chosen as u8)));
                }
                selector.record(&rules, model % models, error);
                prop_assert!((3.0..=20.0).contains(&selector.window_size()));
                prop_assert!((0.035..=0.07).contains(&selector.threshold()));
                prop_assert!(selector.window().len() <= 20);
                prop_assert_eq!(selector.last(), Some(model % models));
            }
        }
    }
}
