//! What innovations say of the noise a filter was told: a verdict in words, with its numbers.
//!
//! A filter whose models fit has innovations that are white, have mean zero and the size that it predicted. Size and
//! correlation together tell measurement noise R from process noise Q. A gain that is too high over-corrects and
//! leaves neighbours of opposite sign; one that is too low lags behind and leaves neighbours of the same sign
//! (Mehra, IEEE Trans. on Automatic Control 15, 1970):
//!
//! | mean NIS | lag-1 below 0 | white | lag-1 above 0 |
//! |---|---|---|---|
//! | too high | R too small | R too small | Q too small |
//! | as told | Q too large | consistent | Q too small |
//! | too low | Q too large | R too large | R too large |
//!
//! All tests of one sensor together raise a false alarm in at most 5 % of consistent cases (Bonferroni), and a
//! deviation that is real but too small to matter is left alone, so that long recordings do not fail for nothing.

use crate::distribution::{chi_square_cdf, chi_square_quantile, normal_quantile};
use crate::error::{Error, Result};
use crate::metric::{MeanChiSquare, anees, median};
use crate::number::signed;
use std::fmt;

/// Fewer innovations than this are too few to judge: the interval of their mean size spans a factor of two.
pub const ENOUGH: usize = 20;

/// Chance of any false alarm on a consistent sensor.
const FALSE_ALARM: f64 = 0.05;
/// Relative error of the innovations' size below which nobody would retune.
const SCALE_MATTERS: f64 = 0.05;
/// Lag-1 correlation below which nobody would retune.
const LAG_MATTERS: f64 = 0.05;
/// Mean innovation, in standard deviations, below which nobody would calibrate.
const BIAS_MATTERS: f64 = 0.1;
/// A larger share is no outliers any more, but another law.
const FEW_OUTLIERS: f64 = 0.1;
/// Share of outliers that matters, five times what a normal law has beyond [`OUTLIER_LEVEL`].
const OUTLIERS_MATTER: f64 = 0.005;
/// An innovation beyond this quantile is an outlier.
const OUTLIER_LEVEL: f64 = 0.999;
/// Lags over which correlation is summed; a filter that has not forgotten by then has other worries.
const LAGS: usize = 40;

/// The innovations of one sensor over a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SensorInnovations {
    /// Name of the sensor.
    pub sensor: String,
    /// Numbers per measurement, the degrees of freedom of one NIS value.
    pub dimension: usize,
    /// Normalised innovation squared of every update. What a gate refused is not among them: [`Self::refused`] counts
    /// it.
    pub nis: Vec<f64>,
    /// The components of the innovations, in standard deviations; may be empty when only NIS is known.
    pub components: Vec<WhitenedComponent>,
    /// Mean share of the measurement noise in the predicted innovation covariance, `trace(S^-1 R) / dimension`, in
    /// (0, 1]. With it the verdict names the factor of R; without it only a bound.
    pub noise_share: Option<f64>,
    /// Whether the filter's law of errors has heavy tails itself: then far innovations are no finding.
    pub heavy_tails_expected: bool,
    /// Probability with which a true measurement lies inside the gate that these passed; `None` without a gate.
    pub gate: Option<f64>,
    /// How many measurements the gate refused.
    pub refused: usize,
}

/// One component of the innovations, each divided by its predicted standard deviation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WhitenedComponent {
    /// What it measures ("bearing").
    pub name: String,
    /// Values in order of time, one list per track: neighbours in a list are neighbours in time.
    pub series: Vec<Vec<f64>>,
}

/// A number and its 95 % interval; `high` may be infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Best estimate.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
    /// Whether `value` lies between the ends.
    pub fn contains(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }
}

/// One thing that the innovations say.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Finding {
    /// Fewer than [`ENOUGH`] innovations.
    TooFew {
        /// How many there are.
        samples: usize,
    },
    /// Nothing contradicts the models.
    Consistent,
    /// A component's innovations have a mean.
    Biased {
        /// The component.
        component: String,
        /// Its mean, in predicted standard deviations.
        mean: Interval,
    },
    /// The gate refused many more measurements than it would of right models.
    Refused {
        /// How many it refused.
        refused: usize,
        /// Of how many.
        measurements: usize,
        /// How many it would refuse on average.
        expected: f64,
    },
    /// More far innovations than a normal law has. What is said of R and Q leaves them out.
    HeavyTails {
        /// How many lie beyond the 99.9 % bound of a normal law of the size of the others, which may be far from the
        /// size that the filter foretold.
        outliers: usize,
        /// How many innovations there are.
        samples: usize,
        /// Whether a gate would keep them out: there is none, they are few, and the others are as large as foretold.
        gate_helps: bool,
    },
    /// R is smaller than the scatter of the measurements.
    MeasurementNoiseTooSmall {
        /// By how much the true variance exceeds R.
        factor: Interval,
        /// The factor is only a lower bound, because the share of R in S is not known.
        at_least: bool,
    },
    /// R is larger than the scatter of the measurements.
    MeasurementNoiseTooLarge {
        /// By how much R exceeds the true variance.
        factor: Interval,
        /// The factor is only a lower bound, because the share of R in S is not known.
        at_least: bool,
    },
    /// The target moves more than the motion model allows.
    ProcessNoiseTooSmall {
        /// Correlation of neighbouring innovations.
        lag1: Interval,
    },
    /// The target moves less than the motion model allows.
    ProcessNoiseTooLarge {
        /// Correlation of neighbouring innovations.
        lag1: Interval,
    },
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Finding::TooFew { samples } => {
                write!(f, "too few to judge: {samples} innovations, at least {ENOUGH} are needed")
            }
            Finding::Consistent => f.write_str("consistent: innovations are white and as large as predicted"),
            Finding::Biased { component, mean } => write!(
                f,
                "biased: the mean {component} innovation is {} sigma ({} to {}); look for an offset of the sensor",
                signed(mean.value),
                signed(mean.low),
                signed(mean.high)
            ),
            Finding::Refused { refused, measurements, expected } => write!(
                f,
                "the gate refused {refused} of {measurements} measurements ({expected:.1} expected): the noises are \
                 too small, or the measurements have outliers"
            ),
            Finding::HeavyTails { outliers, samples, gate_helps } => write!(
                f,
                "heavy tails: {outliers} of {samples} innovations are too far out for a normal law of the size of the \
                 others ({:.1} expected); use a {}heavy-tailed likelihood",
                *samples as f64 * (1.0 - OUTLIER_LEVEL),
                if *gate_helps { "gate or a " } else { "" }
            ),
            Finding::MeasurementNoiseTooSmall { factor, at_least } => {
                write!(f, "the measurement noise R is {} times too small", Factor(factor, *at_least))
            }
            Finding::MeasurementNoiseTooLarge { factor, at_least } => {
                write!(f, "the measurement noise R is {} times too large", Factor(factor, *at_least))?;
                if factor.low > MOST_FACTOR {
                    f.write_str("; the measurements hold hardly any noise (made or smoothed ones?)")?;
                }
                Ok(())
            }
            Finding::ProcessNoiseTooSmall { lag1 } => write!(
                f,
                "innovations are correlated (lag-1 {:+.2}, {:+.2} to {:+.2}): the motion noise Q is too small or the \
                 motion model is wrong",
                lag1.value, lag1.low, lag1.high
            ),
            Finding::ProcessNoiseTooLarge { lag1 } => write!(
                f,
                "innovations alternate (lag-1 {:+.2}, {:+.2} to {:+.2}): the motion noise Q is too large",
                lag1.value, lag1.low, lag1.high
            ),
        }
    }
}

/// A larger factor of a noise says no more than that there is hardly any.
const MOST_FACTOR: f64 = 1000.0;

/// "about 2.3 (2.1 to 2.6)", "at least 2.1" where the interval has no upper end, "at least about ..." where the claim
/// has none, "more than 1000" beyond all sense.
struct Factor<'a>(&'a Interval, bool);

impl fmt::Display for Factor<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Factor(Interval { value, low, high }, at_least) = self;
        // Beyond ten a digit after the point tells nothing.
        let digits = usize::from(*low < 10.0);
        if *low > MOST_FACTOR {
            return write!(f, "more than {MOST_FACTOR}");
        }
        if *high > MOST_FACTOR {
            return write!(f, "at least {low:.digits$}");
        }
        let bound = if *at_least { "at least " } else { "" };
        write!(f, "{bound}about {value:.digits$} ({low:.digits$} to {high:.digits$})")
    }
}

/// The numbers of one component.
#[derive(Clone, Debug, PartialEq)]
pub struct ComponentAssessment {
    /// What it measures.
    pub name: String,
    /// Mean, in predicted standard deviations.
    pub mean: Interval,
    /// Correlation of neighbours; `None` where there are none or nothing varies.
    pub lag1: Option<f64>,
    /// Fourth moment over the squared second: 3 for a normal law; `None` where nothing varies.
    pub kurtosis: Option<f64>,
}

/// The verdict on one sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Assessment {
    /// Name of the sensor.
    pub sensor: String,
    /// How many innovations were judged.
    pub samples: usize,
    /// Mean NIS over the dimension, with the limits beyond which it raises an alarm, made up for what a gate cut off;
    /// `None` without innovations. With a finding of heavy tails it is that of the innovations but the outliers, so
    /// that its `samples` are fewer.
    pub nis: Option<MeanChiSquare>,
    /// The same mean of all innovations.
    pub nis_of_all: Option<f64>,
    /// Correlation of neighbouring innovations over all components; `None` where no component has neighbours.
    pub lag1: Option<Interval>,
    /// How many innovations lie beyond the 99.9 % bound of a normal law of the size of the bulk.
    pub outliers: usize,
    /// Component by component.
    pub components: Vec<ComponentAssessment>,
    /// What was found, the gravest first; never empty.
    pub findings: Vec<Finding>,
}

impl Assessment {
    /// Whether nothing contradicts the models.
    pub fn is_consistent(&self) -> bool {
        self.findings == [Finding::Consistent]
    }

    /// Whether there were enough innovations for a verdict.
    pub fn is_judged(&self) -> bool {
        !self.findings.iter().any(|f| matches!(f, Finding::TooFew { .. }))
    }
}

impl fmt::Display for Assessment {
    /// The findings as one sentence.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, finding) in self.findings.iter().enumerate() {
            write!(f, "{}{finding}", if i == 0 { "" } else { "; " })?;
        }
        Ok(())
    }
}

/// Judges the innovations of one sensor.
///
/// # Errors
/// [`Error::NotFinite`] or [`Error::OutOfRange`] for a NIS value, a component or a noise share that is none,
/// [`Error::Empty`] for a dimension of zero.
pub fn assess(innovations: &SensorInnovations) -> Result<Assessment> {
    let SensorInnovations { sensor, dimension, components, noise_share, heavy_tails_expected, .. } =
        innovations;
    for series in components.iter().flat_map(|c| &c.series) {
        Error::all_finite("whitened innovation", series)?;
    }
    if let Some(value) = noise_share.filter(|share| !(*share > 0.0 && *share <= 1.0)) {
        let needs = "it must lie above 0 and not above 1";
        return Err(Error::OutOfRange { what: "the share of R in S", value, needs });
    }
    if *dimension == 0 {
        return Err(Error::Empty { what: "degrees of freedom" });
    }
    if let Some(value) = innovations.gate.filter(|inside| !(*inside > 0.0 && *inside < 1.0)) {
        return Err(Error::OutOfRange { what: "the gate", value, needs: "it must lie between 0 and 1" });
    }
    Error::all_finite("normalised error", &innovations.nis)?;
    let cut = innovations.gate.map_or(1.0, |inside| mean_inside(inside, *dimension as f64));
    let nis: &[f64] = &innovations.nis.iter().map(|v| v / cut).collect::<Vec<_>>();

    // Size, correlation, tails and gate are one test each, the mean one per component.
    let tests = (3 + usize::from(innovations.gate.is_some()) + components.len()) as f64;
    let confidence = 1.0 - FALSE_ALARM / tests;
    let limit = normal_quantile(0.5 + confidence / 2.0);
    let moments: Vec<Moments> = components.iter().map(Moments::of).collect();
    let lag = Lag::pooled(&moments);
    let mut assessment = Assessment {
        sensor: sensor.clone(),
        samples: nis.len(),
        nis: if nis.is_empty() { None } else { Some(anees(nis, *dimension, confidence)?) },
        nis_of_all: None,
        lag1: lag.map(Lag::interval),
        outliers: 0,
        components: moments.iter().map(Moments::assessment).collect(),
        findings: Vec::new(),
    };
    assessment.nis_of_all = assessment.nis.map(|all| all.mean);
    assessment.findings.extend(refusals(innovations, confidence));
    if nis.len() < ENOUGH && assessment.findings.is_empty() {
        assessment.findings.push(Finding::TooFew { samples: nis.len() });
    }
    if nis.len() < ENOUGH {
        return Ok(assessment);
    }

    for m in &moments {
        let significant = m.mean.abs() > limit * m.standard_error();
        if significant && m.mean.abs() > BIAS_MATTERS {
            assessment.findings.push(Finding::Biased { component: m.name.clone(), mean: m.mean_interval() });
        }
    }

    let bulk = bulk(nis, *dimension as f64);
    assessment.outliers = nis.len() - bulk.len();
    let chance = chance_of(assessment.outliers, nis.len() as f64 * (1.0 - OUTLIER_LEVEL));
    let heavy = assessment.outliers as f64 > OUTLIERS_MATTER * nis.len() as f64 && chance < 1.0 - confidence;
    if heavy && !heavy_tails_expected {
        let (outliers, samples) = (assessment.outliers, nis.len());
        let few = outliers as f64 <= FEW_OUTLIERS * samples as f64;
        // Around what is half as large as foretold a gate has its edge too far out.
        let as_foretold = bulk.iter().sum::<f64>() > 0.5 * (bulk.len() * dimension) as f64;
        let gate_helps = innovations.gate.is_none() && few && as_foretold;
        assessment.findings.push(Finding::HeavyTails { outliers, samples, gate_helps });
    }
    let size = anees(if heavy { &bulk } else { nis }, *dimension, confidence)?;
    if heavy {
        assessment.nis = Some(size);
    }
    if let Some(finding) = noise_finding(&size, lag, limit, *noise_share) {
        assessment.findings.push(finding);
    }
    if assessment.findings.is_empty() {
        assessment.findings.push(Finding::Consistent);
    }
    Ok(assessment)
}

/// What the gate says.
fn refusals(innovations: &SensorInnovations, confidence: f64) -> Option<Finding> {
    let refused = innovations.refused;
    let measurements = innovations.nis.len() + refused;
    let expected = measurements as f64 * (1.0 - innovations.gate?);
    // A gate counts by the normal law: of heavier tails it refuses more, and that is what it is for.
    let matters = if innovations.heavy_tails_expected { FEW_OUTLIERS } else { OUTLIERS_MATTER };
    let least = (matters * measurements as f64).max(2.0 * expected);
    let significant = refused as f64 > least && chance_of(refused, expected) < 1.0 - confidence;
    significant.then_some(Finding::Refused { refused, measurements, expected })
}

/// Probability of `count` or more of what is rare and independent, `expected` on average: the upper tail of a Poisson
/// law, which is a chi-square integral. 1 for a count of zero would be exact; the value for one is what is told.
fn chance_of(count: usize, expected: f64) -> f64 {
    chi_square_cdf(2.0 * expected, 2.0 * count.max(1) as f64)
}

/// Mean of a chi-square number that passed a gate which holds `inside` of all, over the mean without a gate:
/// E[x; x < t] = d F(t; d + 2).
fn mean_inside(inside: f64, degrees: f64) -> f64 {
    let edge = chi_square_quantile(inside, degrees);
    chi_square_cdf(edge, degrees + 2.0) / inside
}

/// The table of the module's head.
fn noise_finding(size: &MeanChiSquare, lag: Option<Lag>, limit: f64, share: Option<f64>) -> Option<Finding> {
    let sign = |significant: bool, deviation: f64, matters: f64| {
        if significant && deviation.abs() > matters { deviation.signum() as i8 } else { 0 }
    };
    let size_sign = sign(!size.is_inside(), size.mean - 1.0, SCALE_MATTERS);
    let lag_sign = lag.map_or(0, |l| sign(l.value.abs() > limit * l.error, l.value, LAG_MATTERS));
    let correlation = lag.map(Lag::interval);
    match (size_sign, lag_sign, correlation) {
        (0 | 1, 1, Some(lag1)) => Some(Finding::ProcessNoiseTooSmall { lag1 }),
        (0 | -1, -1, Some(lag1)) => Some(Finding::ProcessNoiseTooLarge { lag1 }),
        (1, ..) => {
            let factor = measurement_noise_factor(size, lag, share);
            Some(Finding::MeasurementNoiseTooSmall { factor, at_least: share.is_none() })
        }
        (-1, ..) => {
            let Interval { value, low, high } = measurement_noise_factor(size, lag, share);
            // A bound at or below zero leaves the other side open; what the size alone tells holds always.
            let inverse = |x: f64| if x > 0.0 { 1.0 / x } else { f64::INFINITY };
            let Interval { high: nearest, .. } = measurement_noise_factor(size, lag, None);
            let told = if high > 0.0 { inverse(high).min(MOST_FACTOR) } else { 0.0 };
            let least = inverse(nearest).max(told);
            let factor = Interval { value: inverse(value), low: least, high: inverse(low) };
            Some(Finding::MeasurementNoiseTooLarge { factor, at_least: share.is_none() })
        }
        _ => None,
    }
}

/// By which factor the true measurement variance exceeds R, from the mean size s of the innovations.
///
/// A filter with gain K = 1 - r (r the share of R in S) on a random walk with true variance f R has, in its steady
/// state, predicted variance M = (K^2 f R + Q) / (2 K - K^2). Subtracting the same at f = 1, with R = r S:
/// s = 1 + (f - 1) 2 r / (1 + r), linear in f. As 2 r / (1 + r) <= 1, s itself bounds f from the near side.
fn measurement_noise_factor(size: &MeanChiSquare, lag: Option<Lag>, share: Option<f64>) -> Interval {
    let r = share.unwrap_or(1.0);
    let factor = |s: f64| 1.0 + (s - 1.0) * (1.0 + r) / (2.0 * r);
    // Normal values with correlation rho have squares with correlation rho^2: n of them tell as much as
    // n / (1 + 2 sum rho_k^2) independent ones, each with `dimension` degrees of freedom.
    let squares = lag.map_or(0.0, |l| l.later_squares);
    let degrees = (size.samples * size.dimension) as f64 / (1.0 + 2.0 * squares);
    let end = |probability: f64| factor(size.mean * degrees / chi_square_quantile(probability, degrees));
    Interval { value: factor(size.mean), low: end(0.975), high: end(0.025) }
}

/// The values that are no outliers of the majority's size, which the median tells whatever the tails do.
fn bulk(nis: &[f64], degrees: f64) -> Vec<f64> {
    let size = median(nis.to_vec()) / chi_square_quantile(0.5, degrees);
    let edge = size * chi_square_quantile(OUTLIER_LEVEL, degrees);
    nis.iter().copied().filter(|v| *v <= edge).collect()
}

/// Correlation of neighbours over all components.
#[derive(Clone, Copy)]
struct Lag {
    value: f64,
    /// Standard error for white noise, 1 / sqrt(pairs).
    error: f64,
    /// Sum of the squared correlations at lags 1 to [`LAGS`].
    later_squares: f64,
}

impl Lag {
    /// The mean over components, weighted by pairs.
    fn pooled(moments: &[Moments]) -> Option<Lag> {
        let (mut sum, mut squares, mut pairs) = (0.0, 0.0, 0.0);
        for m in moments {
            if let Some(lag1) = m.lag1 {
                let weight = m.pairs as f64;
                sum += lag1 * weight;
                squares += m.squared_correlations * weight;
                pairs += weight;
            }
        }
        let (value, error) = (sum / pairs, 1.0 / f64::sqrt(pairs));
        (pairs > 0.0).then(|| Lag { value, error, later_squares: squares / pairs })
    }

    fn interval(self) -> Interval {
        let half = normal_quantile(0.975) * self.error;
        Interval { value: self.value, low: (self.value - half).max(-1.0), high: (self.value + half).min(1.0) }
    }
}

/// Sample moments of one component over all its series.
struct Moments {
    name: String,
    count: usize,
    pairs: usize,
    mean: f64,
    variance: f64,
    lag1: Option<f64>,
    squared_correlations: f64,
    positive_correlations: f64,
    kurtosis: Option<f64>,
}

impl Moments {
    fn of(component: &WhitenedComponent) -> Moments {
        let all = || component.series.iter().flatten();
        let count = all().count();
        let n = count.max(1) as f64;
        let mean = all().sum::<f64>() / n;
        let moment = |power: i32| all().map(|v| (v - mean).powi(power)).sum::<f64>() / n;
        let (variance, fourth) = (moment(2), moment(4));
        let pairs_at =
            |lag: usize| component.series.iter().map(|s| s.len().saturating_sub(lag)).sum::<usize>();
        let correlation = |lag: usize| {
            let neighbours = component.series.iter().flat_map(|s| s.iter().zip(s.iter().skip(lag)));
            let product: f64 = neighbours.map(|(a, b)| (a - mean) * (b - mean)).sum();
            (pairs_at(lag) > 0 && variance > 0.0)
                .then(|| (product / pairs_at(lag) as f64 / variance).clamp(-1.0, 1.0))
        };
        // White noise has squared sample correlations of 1 / pairs on average, which is no correlation.
        let square = |lag: usize| {
            correlation(lag).map_or(0.0, |rho| (rho * rho - 1.0 / pairs_at(lag) as f64).max(0.0))
        };
        Moments {
            name: component.name.clone(),
            count,
            pairs: pairs_at(1),
            mean,
            variance,
            lag1: correlation(1),
            // Cut at the first that is not positive, after which the sum is noise (Geyer, Statistical Science 7, 1992).
            positive_correlations: (1..=LAGS).map_while(|k| correlation(k).filter(|rho| *rho > 0.0)).sum(),
            squared_correlations: (1..=LAGS).map(square).sum(),
            kurtosis: (variance > 0.0).then(|| fourth / (variance * variance)),
        }
    }

    /// Of the mean, counting how much neighbours repeat each other.
    fn standard_error(&self) -> f64 {
        (self.variance / self.count.max(1) as f64 * (1.0 + 2.0 * self.positive_correlations)).sqrt()
    }

    fn mean_interval(&self) -> Interval {
        let half = normal_quantile(0.975) * self.standard_error();
        Interval { value: self.mean, low: self.mean - half, high: self.mean + half }
    }

    fn assessment(&self) -> ComponentAssessment {
        ComponentAssessment {
            name: self.name.clone(),
            mean: self.mean_interval(),
            lag1: self.lag1,
            kurtosis: self.kurtosis,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::test_noise::Noise;

    /// A random walk seen in noise: what is true, and what the Kalman filter under judgement believes.
    #[derive(Clone, Copy)]
    struct World {
        q: f64,
        r: f64,
        told_q: f64,
        told_r: f64,
        outlier_share: f64,
    }

    const HONEST: World = World { q: 0.1, r: 1.0, told_q: 0.1, told_r: 1.0, outlier_share: 0.0 };

    /// Two tracks of `steps` each.
    fn run(world: World, steps: usize, seed: u64) -> SensorInnovations {
        let mut noise = Noise(seed);
        let (mut nis, mut series, mut share) = (Vec::new(), Vec::new(), 0.0);
        for _ in 0..2 {
            let (mut x, mut mean, mut whitened) = (0.0, 0.0, Vec::new());
            let mut variance = world.told_r;
            for _ in 0..steps {
                x += world.q.sqrt() * noise.normal();
                variance += world.told_q;
                let wild = if noise.uniform() < world.outlier_share { 12.0 } else { 1.0 };
                let z = x + wild * world.r.sqrt() * noise.normal();
                let s = variance + world.told_r;
                let (v, gain) = (z - mean, variance / s);
                nis.push(v * v / s);
                whitened.push(v / s.sqrt());
                share += world.told_r / s / (2 * steps) as f64;
                mean += gain * v;
                variance *= 1.0 - gain;
            }
            series.push(whitened);
        }
        let components = vec![WhitenedComponent { name: "position".into(), series }];
        SensorInnovations {
            sensor: "radar".into(),
            dimension: 1,
            nis,
            components,
            noise_share: Some(share),
            ..SensorInnovations::default()
        }
    }

    fn judge(world: World, steps: usize, seed: u64) -> Assessment {
        assess(&run(world, steps, seed)).unwrap()
    }

    /// False alarms are at most 5 % by construction: of 400 runs 20, plus 4 sqrt(400 0.05 0.95) = 17.
    #[test]
    fn an_honest_filter_is_called_consistent() {
        let alarms = (0..400).filter(|seed| !judge(HONEST, 150, *seed).is_consistent()).count();
        assert!(alarms <= 37, "{alarms} false alarms of 400");
    }

    /// The 95 % interval of the factor holds it in at least 380 of 400 runs less 4 sqrt(400 0.05 0.95) = 17.
    #[test]
    fn a_wrong_measurement_noise_is_named_with_its_factor() {
        for (told_q, told_r, factor, small) in
            [(0.1, 0.4, 2.5, true), (0.1, 0.25, 4.0, true), (0.1, 3.0, 3.0, false), (0.1, 2.0, 2.0, false)]
        {
            let world = World { told_q, told_r, ..HONEST };
            let (mut named, mut covered) = (0, 0);
            for seed in 0..400 {
                let judged = judge(world, 300, 1000 + seed);
                let interval = match &judged.findings[..] {
                    [Finding::MeasurementNoiseTooSmall { factor, at_least: false }] if small => factor,
                    [Finding::MeasurementNoiseTooLarge { factor, at_least: false }] if !small => factor,
                    _ => continue,
                };
                named += 1;
                covered += usize::from(interval.contains(factor));
            }
            assert!(named >= 363 && covered >= 363, "{told_r}: named {named}, covered {covered} of 400");
        }
    }

    /// A filter that lags wanders, so its mean is now and then called a bias as well: how often is not promised, but
    /// that it is less than every other time, by five standard errors: 25 - 5 sqrt(50 / 4) = 7. The noise is always
    /// named.
    #[test]
    fn a_wrong_process_noise_is_named() {
        let mut biased = 0;
        for seed in 0..50 {
            let slow = judge(World { told_q: 0.005, ..HONEST }, 300, seed);
            assert!(matches!(slow.findings.last(), Some(Finding::ProcessNoiseTooSmall { .. })), "{slow}");
            biased += slow.findings.len() - 1;
            let restless = judge(World { told_q: 2.0, ..HONEST }, 300, seed);
            assert!(matches!(restless.findings[..], [Finding::ProcessNoiseTooLarge { .. }]), "{restless}");
        }
        assert!(biased <= 7, "{biased} of 50 called biased");
    }

    #[test]
    fn an_offset_is_a_bias() {
        let mut noise = Noise(2);
        let series: Vec<f64> = (0..200).map(|_| 0.8 + noise.normal()).collect();
        let innovations = SensorInnovations {
            sensor: "camera".into(),
            dimension: 1,
            nis: series.iter().map(|v| (v - 0.8) * (v - 0.8)).collect(),
            components: vec![WhitenedComponent { name: "bearing".into(), series: vec![series] }],
            ..SensorInnovations::default()
        };
        let judged = assess(&innovations).unwrap();
        let [Finding::Biased { component, mean }] = &judged.findings[..] else { panic!("{judged}") };
        assert!(component == "bearing" && mean.contains(0.8), "{judged}");
        assert!(judged.to_string().starts_with("biased: the mean bearing innovation is +0."), "{judged}");
    }

    #[test]
    fn outliers_are_heavy_tails_and_not_a_wrong_noise() {
        let mut sizes = Vec::new();
        for seed in 0..50 {
            // Little motion, so that an outlier leaves hardly a trail in the estimate.
            let quiet = World { q: 1e-4, told_q: 1e-4, outlier_share: 0.04, ..HONEST };
            let judged = judge(quiet, 400, seed);
            let mut expected = run(quiet, 400, seed);
            expected.heavy_tails_expected = true;
            let expected = assess(&expected).unwrap();
            assert!(!expected.findings.iter().any(|f| matches!(f, Finding::HeavyTails { .. })), "{expected}");
            assert!(matches!(judged.findings[0], Finding::HeavyTails { .. }), "{judged}");
            // Of 800 normal numbers it is 3 with a standard error of sqrt(24 / 800); of these on average 55.
            assert!(judged.components[0].kurtosis.unwrap() > 3.0 + 5.0 * (24.0 / 800.0_f64).sqrt());
            sizes.push(judged.nis.unwrap().mean);
        }
        // With its outliers the size would be 1 + 0.04 (144 - 1) = 6.7. Of what is left, a fifth of the wide draws
        // looks ordinary, with a mean square of 3.6: 1.02. And the estimate, at step k an average of min(k, 100)
        // values, carries 5.7 / min(k, 100) more than it knows: 5.7 (ln 100 + 0.6 + 3) / 400 = 0.12, less what of
        // that is an outlier itself.
        let (n, mean) = (sizes.len() as f64, sizes.iter().sum::<f64>() / sizes.len() as f64);
        let error = (sizes.iter().map(|s| (s - mean) * (s - mean)).sum::<f64>() / (n * (n - 1.0))).sqrt();
        assert!(
            mean < 1.14 + 4.0 * error && mean > 1.0 - 4.0 * error,
            "{mean} with a standard error of {error}"
        );
    }

    #[test]
    fn without_the_share_the_factor_is_a_bound() {
        let mut innovations = run(World { told_r: 0.25, ..HONEST }, 400, 4);
        innovations.noise_share = None;
        let judged = assess(&innovations).unwrap();
        let [Finding::MeasurementNoiseTooSmall { factor, at_least: true }] = &judged.findings[..] else {
            panic!("{judged}")
        };
        assert!(factor.low > 1.0 && factor.value < 4.0);
        assert!(judged.to_string().contains("at least about"), "{judged}");
    }

    /// White innovations of a filter with a gate: what it refuses is no outlier and no reason to call R too large.
    fn gated(inside: f64, count: usize, scale: f64, seed: u64) -> SensorInnovations {
        let mut noise = Noise(seed);
        let edge = chi_square_quantile(inside, 2.0);
        let (mut nis, mut refused) = (Vec::new(), 0);
        for _ in 0..count {
            let value = scale * (noise.normal().powi(2) + noise.normal().powi(2));
            if value > edge { refused += 1 } else { nis.push(value) }
        }
        SensorInnovations { dimension: 2, nis, gate: Some(inside), refused, ..SensorInnovations::default() }
    }

    /// False alarms as without a gate: of 200 runs at most 10 + 4 sqrt(200 0.05 0.95) = 22.
    #[test]
    fn a_gate_of_right_models_raises_no_alarm() {
        for inside in [0.9, 0.99, 0.999] {
            let alarms = |seed: &u64| !assess(&gated(inside, 300, 1.0, *seed)).unwrap().is_consistent();
            let alarms = (0..200).filter(alarms).count();
            assert!(alarms <= 22, "{inside}: {alarms} false alarms of 200");
        }
    }

    #[test]
    fn a_gate_that_refuses_too_much_is_told() {
        let judged = assess(&gated(0.99, 300, 4.0, 1)).unwrap();
        let Finding::Refused { refused, measurements: 300, expected } = judged.findings[0] else {
            panic!("{judged}")
        };
        // Beyond the 0.99 quantile of a law four times as large lie 0.01^(1/4) = 0.316 +- 0.027.
        assert!((60..130).contains(&refused) && (expected - 3.0).abs() < 1e-9, "{judged}");
        assert!(!judged.to_string().contains("use a gate"), "{judged}");
        // Where next to nothing was let in, that is the finding, and not that there is too little to judge.
        let shut = SensorInnovations { refused: 198, ..gated(0.999, 2, 1.0, 1) };
        let judged = assess(&shut).unwrap();
        assert!(matches!(judged.findings[..], [Finding::Refused { refused: 198, .. }]), "{judged}");
        assert!(judged.is_judged() && !judged.is_consistent());
    }

    /// A quarter of the innovations as foretold, the others a hundred times smaller: each number says what it is of.
    #[test]
    fn numbers_with_and_without_outliers_do_not_contradict_each_other() {
        let mut noise = Noise(8);
        let mut draw = |i: usize| (if i.is_multiple_of(4) { 1.0 } else { 0.01 }) * noise.normal().powi(2);
        let nis: Vec<f64> = (0..2000).map(&mut draw).collect();
        let innovations =
            SensorInnovations { dimension: 1, nis, noise_share: Some(0.05), ..Default::default() };
        let judged = assess(&innovations).unwrap();
        let [
            Finding::HeavyTails { outliers, gate_helps: false, .. },
            Finding::MeasurementNoiseTooLarge { factor, .. },
        ] = &judged.findings[..]
        else {
            panic!("{judged}")
        };
        let (bulk, all) = (judged.nis.unwrap(), judged.nis_of_all.unwrap());
        assert_eq!(bulk.samples + outliers, 2000);
        // All: 0.25 + 0.75 / 100 with a standard error of sqrt(2 / 500) / 4 = 0.016.
        assert!(bulk.mean < 0.05 && (all - 0.2575).abs() < 5.0 * 0.016, "{judged}");
        // With so small a share of noise in S the size alone tells: at least as much as it is too small.
        assert!(factor.low.is_finite() && factor.low > 20.0 && factor.high.is_infinite(), "{judged}");
        let text = judged.to_string();
        assert!(text.contains("times too large") && !text.contains("many"), "{text}");
    }

    #[test]
    fn data_without_noise_are_called_so() {
        let innovations = SensorInnovations {
            dimension: 2,
            nis: (0..100).map(|i| 1e-10 * (1.0 + f64::from(i % 5))).collect(),
            noise_share: Some(0.5),
            ..SensorInnovations::default()
        };
        let text = assess(&innovations).unwrap().to_string();
        assert!(
            text.contains("R is more than 1000 times too large; the measurements hold hardly any noise"),
            "{text}"
        );
    }

    #[test]
    fn a_few_are_not_judged() {
        let judged = judge(World { told_r: 0.01, ..HONEST }, 9, 1);
        assert_eq!(judged.findings, [Finding::TooFew { samples: 18 }]);
        let none = SensorInnovations { sensor: "x".into(), dimension: 2, ..Default::default() };
        assert_eq!(assess(&none).unwrap().findings, [Finding::TooFew { samples: 0 }]);
    }

    #[test]
    fn refuses_bad_input() {
        let good = run(HONEST, 20, 1);
        let refused = |change: &dyn Fn(&mut SensorInnovations)| {
            let mut bad = good.clone();
            change(&mut bad);
            assess(&bad).unwrap_err()
        };
        assert!(matches!(refused(&|b| b.dimension = 0), Error::Empty { .. }));
        assert!(matches!(refused(&|b| b.nis[3] = f64::NAN), Error::NotFinite { index: 3, .. }));
        assert!(matches!(refused(&|b| b.nis[3] = -1.0), Error::OutOfRange { .. }));
        assert!(matches!(refused(&|b| b.noise_share = Some(1.5)), Error::OutOfRange { .. }));
        let infinite = refused(&|b| b.components[0].series[1][2] = f64::INFINITY);
        assert!(matches!(infinite, Error::NotFinite { index: 2, .. }));
    }
}
