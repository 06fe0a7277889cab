//! Filters by name and budget, and what their runs give.

use super::drive::drive;
use super::marginal::{Marginal, Marginals};
use super::world::{Place, Problem, Record, Visit, label, with_problem};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use zerre::filter::{
    Boxes, Ensemble, EnsembleSettings, Extended, Filter, GaussianSum, Grid, Kalman, Kernel, Kld, Linear,
    McmcSettings, Outcome as StepOutcome, ParticleFilter, RaoBlackwell, Rejuvenation, ResampleMove,
    SequentialMcmc, Settings, SigmaPoints, Size, SumSettings, Tangent, Unscented, Update,
};
use zerre::model::{GaussianMeasurement, Measurement, Motion, NoiseScale};
use zerre::moves::Move;
use zerre::proposal::Guided;
use zerre::resample::{Resampling, Trigger};
use zerre::rng::Stream;
use zerre::{Error, Result};

/// What lists say of a filter that takes part.
#[derive(Clone, Copy, Debug)]
pub struct ContenderInfo {
    /// Its name.
    pub name: &'static str,
    /// What it is.
    pub about: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    /// What a step costs.
    pub cost: Cost,
}

/// Evaluations of the likelihood, or of the measurement function, in one step.
#[derive(Clone, Copy, Debug)]
pub enum Cost {
    /// Of the dimension of the state.
    Fixed(fn(usize) -> usize),
    /// For each particle (member, node, part), of the dimension of the noise.
    PerParticle(fn(usize) -> usize),
    /// One for each particle, whose number varies up to the given one: runs count them.
    Counted,
}

const fn info(name: &'static str, about: &'static str, source: &'static str, cost: Cost) -> ContenderInfo {
    ContenderInfo { name, about, source, cost }
}

/// The filters that take part, by name. A new one is a line here and an arm of `run`'s `match`.
pub const CONTENDERS: &[ContenderInfo] = &[
    info(
        "kalman",
        "Kalman filter: exact for linear normal models, refuses others",
        "Kalman 1960",
        Cost::Fixed(|n| n + 1),
    ),
    info("ekf", "extended Kalman filter: tangents at the mean", "Jazwinski 1970", Cost::Fixed(|n| n + 1)),
    info(
        "ukf",
        "unscented Kalman filter: sigma points",
        "Julier and Uhlmann 2004",
        Cost::Fixed(|n| 2 * n + 1),
    ),
    info(
        "bootstrap",
        "particle filter that proposes by the motion",
        "Gordon, Salmond and Smith 1993",
        Cost::PerParticle(|_| 1),
    ),
    info("sis", "particle filter that never resamples", "Handschin and Mayne 1969", Cost::PerParticle(|_| 1)),
    info(
        "cubature",
        "cubature Kalman filter: 2 n points",
        "Arasaratnam and Haykin 2009",
        Cost::Fixed(|n| 2 * n + 1),
    ),
    info("ensemble", "ensemble Kalman filter", "Evensen 1994", Cost::PerParticle(|_| 1)),
    info(
        "gaussian-sum",
        "parts that split where the models curve, and merge at a stated cost; counted by the parts kept",
        "Sorenson and Alspach 1971",
        Cost::PerParticle(|w| 2 * w + 1),
    ),
    info(
        "grid",
        "point masses on nodes, up to three dimensions; its searches for the support are not counted",
        "Bucy and Senne 1971",
        Cost::PerParticle(|_| 1),
    ),
    info(
        "ekf-guided",
        "particles move by the tangent of the measurement",
        "Doucet, Godsill and Andrieu 2000",
        Cost::PerParticle(|w| w + 2),
    ),
    info(
        "ukf-guided",
        "particles move by sigma points, iterated where they are far off; the budget reckons with one pass",
        "van der Merwe, Doucet, de Freitas and Wan 2000",
        Cost::PerParticle(|w| 2 * w + 2),
    ),
    info(
        "optimal",
        "particles move by their exact posterior",
        "Doucet, Godsill and Andrieu 2000",
        Cost::PerParticle(|w| w + 2),
    ),
    info(
        "auxiliary",
        "particles are resampled by what the measurement will say",
        "Pitt and Shephard 1999",
        Cost::PerParticle(|_| 2),
    ),
    info(
        "regularised",
        "survivors are drawn from a kernel density, shrunk",
        "Musso, Oudjane and Le Gland 2001",
        Cost::PerParticle(|_| 1),
    ),
    info(
        "kld",
        "as many particles as the posterior's shape needs, up to the given number; counted as it runs",
        "Fox 2003",
        Cost::Counted,
    ),
    info(
        "resample-move",
        "survivors take a random-walk step",
        "Gilks and Berzuini 2001",
        Cost::PerParticle(|_| 2),
    ),
    info(
        "stretch-move",
        "survivors take a stretch step, the exact bee move",
        "Goodman and Weare 2010",
        Cost::PerParticle(|_| 2),
    ),
    info(
        "mcmc-mh",
        "a chain of joint proposals, refined by a random-walk step",
        "Khan, Balch and Dellaert 2005",
        Cost::PerParticle(|_| 3),
    ),
    info(
        "mcmc-gibbs",
        "a chain of joint proposals, refined by slices; counted with two evaluations a slice",
        "Septier, Pang, Carmi and Godsill 2009",
        Cost::PerParticle(|w| 2 + 2 * w),
    ),
    info(
        "rao-blackwell",
        "Kalman filters given drawn scales of heavy-tailed noise, four draws for each; counted with tangents",
        "Schön, Gustafsson and Nordlund 2005",
        Cost::PerParticle(|w| 1 + SCALES * (w + 1)),
    ),
];

/// Draws of the scale of the noise from each hypothesis.
const SCALES: usize = 4;

/// A filter with its budget.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contender {
    /// A name of [`CONTENDERS`].
    pub filter: &'static str,
    /// Particles (members, nodes, parts); 0 for filters without.
    pub particles: usize,
    /// How particles are resampled.
    pub resampling: Resampling,
    /// When they are.
    pub trigger: Trigger,
}

impl ContenderInfo {
    /// The filter of that name.
    pub fn named(name: &str) -> Option<&'static ContenderInfo> {
        CONTENDERS.iter().find(|info| info.name == name)
    }

    /// Whether it has particles, or anything else whose number can be chosen.
    pub fn is_sampled(&self) -> bool {
        !matches!(self.cost, Cost::Fixed(_))
    }

    /// As many particles as `evaluations` a step buy where the noise has `noise` components, at least one; 0
    /// for a filter without.
    pub fn particles(&self, evaluations: usize, noise: usize) -> usize {
        match self.cost {
            Cost::Fixed(_) => 0,
            Cost::PerParticle(cost) => (evaluations / cost(noise)).max(1),
            Cost::Counted => evaluations.max(1),
        }
    }

    /// The filter with so many particles, resampled as particle filters are by default.
    pub fn with(&self, particles: usize) -> Contender {
        let particles = if self.is_sampled() { particles } else { 0 };
        Contender {
            filter: self.name,
            particles,
            resampling: Resampling::default(),
            trigger: Trigger::default(),
        }
    }
}

impl Contender {
    fn settings(&self) -> Settings {
        let Contender { particles, resampling, trigger, .. } = *self;
        Settings { particles, resampling, trigger, ..Settings::default() }
    }
}

/// What is looked at after each step beside the error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Scores {
    /// The score of the marginals; it sorts all particles.
    pub crps: bool,
    /// Coverage of central 90 % intervals, and the posterior's standard deviations.
    pub coverage: bool,
}

impl Scores {
    /// Everything.
    pub const ALL: Scores = Scores { crps: true, coverage: true };
}

/// What one run of one filter gave.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Root mean square error of the shown components over the steps.
    pub rmse: f64,
    /// Error that nine steps of ten do not exceed.
    pub rmse90: f64,
    /// Mean score of the shown components.
    pub crps: Option<f64>,
    /// Share of steps and shown components whose central 90 % interval held the truth.
    pub coverage90: Option<f64>,
    /// Root mean square of the posterior's standard deviation of the shown components together.
    pub sd: Option<f64>,
    /// Sum of the logarithms of the evidence; absent where a step had none.
    pub log_evidence: Option<f64>,
    /// Mean number of likelihood evaluations a step, as the filter counted; 0 without particles.
    #[serde(default)]
    pub evaluations: f64,
    /// Least effective sample size; absent without particles.
    pub ess_min: Option<f64>,
    /// Steps whose measurement had no likelihood anywhere.
    pub degenerate: usize,
    /// Steps that the filter did not reach, or had no finite estimate on.
    pub lost: usize,
    /// Mean processor time of a step, microseconds.
    pub microseconds: f64,
}

/// What became of the runs of a filter in a world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fate {
    /// They are done.
    Ran(Vec<Run>),
    /// The filter does not apply to the models, for this reason.
    DoesNotApply(String),
}

impl Fate {
    /// The runs, if there are any.
    pub fn runs(&self) -> &[Run] {
        match self {
            Fate::Ran(runs) => runs,
            Fate::DoesNotApply(_) => &[],
        }
    }

    /// Why there are none.
    pub fn refusal(&self) -> Option<&str> {
        match self {
            Fate::Ran(_) => None,
            Fate::DoesNotApply(reason) => Some(reason),
        }
    }
}

/// Dimensions of a world: of the state and of the noise.
///
/// # Errors
/// As [`with_problem`].
pub fn dimensions(place: &Place) -> Result<(usize, usize)> {
    struct Dimensions;
    impl Visit for Dimensions {
        type Out = (usize, usize);

        fn visit<A, H, const N: usize, const W: usize, const M: usize>(
            self,
            _: &Problem<A, H, N>,
        ) -> Result<(usize, usize)>
        where
            A: Motion<N, W> + Clone,
            H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]> + Clone,
        {
            Ok((N, W))
        }
    }
    with_problem(place, Dimensions)
}

/// Evaluations a step of `contender` in a world of these dimensions; the most where runs count them.
pub fn evaluations(contender: &Contender, (state, noise): (usize, usize)) -> usize {
    match ContenderInfo::named(contender.filter).map(|info| info.cost) {
        Some(Cost::Fixed(cost)) => cost(state),
        Some(Cost::PerParticle(cost)) => contender.particles * cost(noise),
        Some(Cost::Counted) => contender.particles,
        None => 0,
    }
}

/// Evaluations a step that `runs` of the filter called `name` took: `planned`, or what they counted where that is
/// more (sigma points that were drawn anew) or the only thing known.
pub fn evaluations_of<'a>(name: &str, planned: usize, runs: impl ExactSizeIterator<Item = &'a Run>) -> usize {
    let count = runs.len();
    if count == 0 {
        return planned;
    }
    let counted = (runs.map(|run| run.evaluations).sum::<f64>() / count as f64).round() as usize;
    match ContenderInfo::named(name).map(|info| info.cost) {
        Some(Cost::Counted) => counted,
        _ => counted.max(planned),
    }
}

/// Does the runs `which` of `contender` in `place`; `None` if `stop` says so meanwhile. Run number r draws
/// the same truth and measurements for every filter.
///
/// # Errors
/// What the world refuses.
pub fn contend(
    place: &Place,
    contender: &Contender,
    which: Range<usize>,
    seed: u64,
    scores: Scores,
    stop: &dyn Fn() -> bool,
) -> Result<Option<Fate>> {
    with_problem(place, Contest { place, contender, which, seed, scores, stop })
}

struct Contest<'a> {
    place: &'a Place,
    contender: &'a Contender,
    which: Range<usize>,
    seed: u64,
    scores: Scores,
    stop: &'a dyn Fn() -> bool,
}

impl Visit for Contest<'_> {
    type Out = Option<Fate>;

    fn visit<A, H, const N: usize, const W: usize, const M: usize>(
        self,
        problem: &Problem<A, H, N>,
    ) -> Result<Option<Fate>>
    where
        A: Motion<N, W> + Clone,
        H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]> + Clone,
    {
        let mut runs = Vec::with_capacity(self.which.len());
        for number in self.which {
            if (self.stop)() {
                return Ok(None);
            }
            let luck = self.place.luck(self.seed, number);
            let record: Record<N, M> = problem.record(luck)?;
            let stream = luck.fork(label(self.contender.filter)).fork(self.contender.particles as u64);
            let follow =
                Follow { prior: problem.prior.mean(), shown: problem.shown, record: &record, stream };
            match run::<A, H, N, W, M>(problem, self.contender, follow, self.scores) {
                Ok(run) => runs.push(run),
                Err(Error::Unsupported(reason)) => return Ok(Some(Fate::DoesNotApply(reason))),
                Err(error) => return Err(error),
            }
        }
        Ok(Some(Fate::Ran(runs)))
    }
}

/// One run. [`Error::Unsupported`] says that the filter does not apply here.
fn run<A, H, const N: usize, const W: usize, const M: usize>(
    problem: &Problem<A, H, N>,
    contender: &Contender,
    follow: Follow<'_, N, M>,
    scores: Scores,
) -> Result<Run>
where
    A: Motion<N, W> + Clone,
    H: GaussianMeasurement<N, M> + Measurement<N, Value = [f64; M]> + Clone,
{
    let Problem { motion, sensor, prior, .. } = problem.clone();
    let settings = contender.settings();
    match contender.filter {
        "kalman" => follow.through(&Kalman::new(motion, sensor, prior)?, scores),
        "ekf" => follow.through(&Extended::new(motion, sensor, prior), scores),
        "ukf" => follow.through(&Unscented::new(motion, sensor, prior, SigmaPoints::default())?, scores),
        "bootstrap" => follow.through(&ParticleFilter::new(prior, motion, sensor, settings)?, scores),
        "sis" => {
            let settings = Settings { trigger: Trigger::Never, ..settings };
            follow.through(&ParticleFilter::new(prior, motion, sensor, settings)?, scores)
        }
        "cubature" => {
            follow.through(&Unscented::new(motion, sensor, prior, SigmaPoints::cubature())?, scores)
        }
        "ensemble" => {
            let settings = EnsembleSettings { members: settings.particles, ..EnsembleSettings::default() };
            follow.through(&Ensemble::new(prior, motion, sensor, settings)?, scores)
        }
        "gaussian-sum" => {
            let settings = SumSettings { parts: settings.particles, ..SumSettings::default() };
            follow
                .through(&GaussianSum::new(SigmaPoints::default(), motion, sensor, prior, settings)?, scores)
        }
        "grid" => {
            let nodes = settings.particles.max(16);
            follow.through(&Grid::new(prior, motion, sensor)?.with_nodes(nodes)?, scores)
        }
        "ekf-guided" => {
            let filter = ParticleFilter::guided(prior, motion, sensor, Guided::new(Tangent), settings)?;
            follow.through(&filter, scores)
        }
        "ukf-guided" => {
            let proposal = Guided::new(SigmaPoints::default());
            follow.through(&ParticleFilter::guided(prior, motion, sensor, proposal, settings)?, scores)
        }
        "optimal" => {
            let filter = ParticleFilter::guided(prior, motion, sensor, Guided::new(Linear), settings)?;
            follow.through(&filter, scores)
        }
        "auxiliary" => {
            let settings = Settings { lookahead: Some(1.0), ..settings };
            follow.through(&ParticleFilter::new(prior, motion, sensor, settings)?, scores)
        }
        "regularised" => {
            let rejuvenation = Rejuvenation::Regularise { kernel: Kernel::Gaussian, shrink: true };
            let settings = Settings { rejuvenation, ..settings };
            follow.through(&ParticleFilter::new(prior, motion, sensor, settings)?, scores)
        }
        "kld" => {
            // In boxes of half a standard deviation a normal law of one component asks for some 650. A quarter
            // at least: a few particles with all the weight look like a narrow posterior.
            let most = settings.particles;
            let kld = Kld::new(0.02, 0.99, Boxes::Deviations(0.5), most.div_ceil(4), most)?;
            let settings = Settings { size: Size::Kld(kld), ..settings };
            follow.through(&ParticleFilter::new(prior, motion, sensor, settings)?, scores)
        }
        "resample-move" | "stretch-move" => {
            let kernel = if contender.filter == "stretch-move" { Move::Stretch } else { Move::default() };
            let inside = ParticleFilter::new(prior, motion, sensor, settings)?;
            follow.through(&ResampleMove::new(inside, kernel, 1)?, scores)
        }
        "mcmc-mh" | "mcmc-gibbs" => {
            let kernel = if contender.filter == "mcmc-gibbs" { Move::Gibbs } else { Move::default() };
            let particles = settings.particles;
            let settings = McmcSettings { particles, kernel, ..McmcSettings::default() };
            follow.through(&SequentialMcmc::new(prior, motion, sensor, settings)?, scores)
        }
        "rao-blackwell" => {
            let scales = NoiseScale::new(motion, SCALES)?;
            follow.through(&RaoBlackwell::new(Linear, scales, sensor, prior, settings.particles)?, scores)
        }
        other => Err(Error::Unsupported(format!("there is no filter `{other}` here"))),
    }
}

/// A record to go through.
struct Follow<'a, const N: usize, const M: usize> {
    /// The estimate before any measurement.
    prior: &'a [f64; N],
    shown: usize,
    record: &'a Record<N, M>,
    stream: Stream,
}

/// What one step adds.
struct Step {
    error: f64,
    crps: f64,
    inside: usize,
    variance: f64,
}

impl<const N: usize, const M: usize> Follow<'_, N, M> {
    fn through<F>(self, filter: &F, scores: Scores) -> Result<Run>
    where
        F: Filter<Measurement = [f64; M]>,
        F::Belief: Marginals,
    {
        let Follow { record, shown, .. } = self;
        let mut run = Run::default();
        let mut law = Marginal::default();
        let mut last = *self.prior;
        let (mut evidence, mut ess, mut evaluations, mut at) = (0.0, f64::INFINITY, 0, 0);
        let see = |belief: &F::Belief, update: &Update| {
            let truth = &record.truth[at];
            let mut step = Step { error: 0.0, crps: 0.0, inside: 0, variance: 0.0 };
            let mut estimate = last;
            for k in 0..shown {
                belief.marginal(k, &mut law);
                estimate[k] = law.mean();
                step.error += (estimate[k] - truth[k]) * (estimate[k] - truth[k]);
                if scores.coverage {
                    step.inside += usize::from(law.covers(truth[k], 0.9));
                    step.variance += law.sd() * law.sd();
                }
                if scores.crps && estimate[k].is_finite() {
                    step.crps += law.crps(truth[k]);
                }
            }
            if !(step.error.is_finite() && step.crps.is_finite() && step.variance.is_finite()) {
                return Ok(None);
            }
            (last, at) = (estimate, at + 1);
            if update.outcome != StepOutcome::Predicted {
                evidence += update.log_evidence;
            }
            if let Some(particles) = update.particles {
                ess = ess.min(particles.ess);
                evaluations += particles.evaluations;
            }
            Ok(Some(step))
        };
        let seen = record.times.iter().copied().zip(&record.measured);
        let driven = drive(filter, seen, self.stream, see)?;
        if let (Some(Error::Unsupported(reason)), true) = (&driven.refusal, driven.seen.is_empty()) {
            return Err(Error::Unsupported(reason.clone()));
        }
        let mut steps = driven.seen;
        run.evaluations = evaluations as f64 / steps.len().max(1) as f64;
        run.lost = record.truth.len() - steps.len();
        // A filter that is lost keeps its last estimate, and says no more how sure it is.
        for truth in &record.truth[steps.len()..] {
            let error: f64 = (0..shown).map(|k| (last[k] - truth[k]) * (last[k] - truth[k])).sum();
            let crps = (0..shown).map(|k| (last[k] - truth[k]).abs()).sum();
            steps.push(Step { error, crps, inside: 0, variance: 0.0 });
        }
        let (count, scored) = (steps.len() as f64, (steps.len() * shown) as f64);
        let sum = |of: fn(&Step) -> f64| steps.iter().map(of).sum::<f64>();
        run.rmse = (sum(|step| step.error) / count).sqrt();
        run.crps = scores.crps.then(|| sum(|step| step.crps) / scored);
        run.coverage90 = scores.coverage.then(|| sum(|step| step.inside as f64) / scored);
        run.sd = scores.coverage.then(|| (sum(|step| step.variance) / count).sqrt());
        let mut errors: Vec<f64> = steps.iter().map(|step| step.error).collect();
        errors.sort_unstable_by(f64::total_cmp);
        run.rmse90 = errors.get(errors.len() * 9 / 10).or(errors.last()).map_or(0.0, |square| square.sqrt());
        run.log_evidence = Some(evidence).filter(|e| e.is_finite() && run.lost == 0);
        run.ess_min = Some(ess).filter(|e| e.is_finite());
        run.degenerate = driven.degenerate;
        run.microseconds = 1e6 * driven.seconds / count;
        Ok(run)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::world::WORLDS;

    fn go(world: &str, filter: &str, particles: usize, runs: Range<usize>) -> Fate {
        let place = Place { steps: Some(12), ..Place::named(world).unwrap() };
        let contender = ContenderInfo::named(filter).unwrap().with(particles);
        contend(&place, &contender, runs, 1, Scores::ALL, &|| false).unwrap().unwrap()
    }

    #[test]
    fn every_filter_runs_somewhere_and_says_where_it_does_not_apply() {
        for info in CONTENDERS {
            let mut ran = 0;
            for world in WORLDS {
                match go(world.name, info.name, 30, 0..1) {
                    Fate::Ran(runs) => {
                        let run = &runs[0];
                        assert!(run.rmse.is_finite() && run.crps.is_some() && run.coverage90.is_some());
                        assert!(info.is_sampled() || run.ess_min.is_none());
                        ran += 1;
                    }
                    Fate::DoesNotApply(reason) => assert!(reason.len() > 10, "{reason}"),
                }
            }
            assert!(ran > 0, "{}", info.name);
        }
        assert!(matches!(go("ungm", "kalman", 0, 0..1), Fate::DoesNotApply(_)));
        assert!(matches!(go("upf", "kalman", 0, 0..1), Fate::DoesNotApply(_)));
        for world in WORLDS {
            let applies = matches!(go(world.name, "rao-blackwell", 10, 0..1), Fate::Ran(_));
            assert_eq!(applies, world.name == "outliers", "{}", world.name);
        }
    }

    /// Particle estimates approach the exact ones: of 2 000 particles the mean error of a component is about
    /// sd / sqrt(ess / 2) with ess above 200, a tenth of the posterior's sd; its effect on an RMSE of the
    /// same size is half of its square, 0.5 %. Five times that.
    #[test]
    fn on_the_linear_world_particles_agree_with_kalman() {
        let (exact, particles) = (go("linear", "kalman", 0, 0..4), go("linear", "bootstrap", 2000, 0..4));
        for (a, b) in exact.runs().iter().zip(particles.runs()) {
            assert!((a.rmse - b.rmse).abs() < 0.1 * a.rmse, "{a:?} {b:?}");
            assert!((a.sd.unwrap() - b.sd.unwrap()).abs() < 0.1 * a.sd.unwrap(), "{a:?} {b:?}");
            assert!((a.log_evidence.unwrap() - b.log_evidence.unwrap()).abs() < 1.0, "{a:?} {b:?}");
        }
    }

    /// Given the scales of its noise the world with outliers is Kalman's: a few hypotheses come to the grid's
    /// error within the hundredth that ESS of some hundred leave (1 / ESS in squares), and to its evidence.
    #[test]
    fn with_the_noise_taken_apart_outliers_are_met() {
        let (exact, found) = (go("outliers", "grid", 500, 0..4), go("outliers", "rao-blackwell", 400, 0..4));
        assert_eq!((exact.runs().len(), found.runs().len()), (4, 4));
        for (a, b) in exact.runs().iter().zip(found.runs()) {
            assert!((a.rmse - b.rmse).abs() < 0.03 * a.rmse, "{a:?} {b:?}");
            assert!((a.log_evidence.unwrap() - b.log_evidence.unwrap()).abs() < 0.3, "{a:?} {b:?}");
            assert!(b.ess_min.unwrap() > 50.0, "{b:?}");
        }
    }

    #[test]
    fn chunks_of_runs_are_the_runs() {
        let whole = go("ungm", "bootstrap", 20, 0..4);
        let parts = [go("ungm", "bootstrap", 20, 0..1), go("ungm", "bootstrap", 20, 1..4)];
        let timeless = |fates: &[Fate]| -> Vec<Run> {
            let runs = fates.iter().flat_map(|fate| fate.runs());
            runs.map(|run| Run { microseconds: 0.0, ..run.clone() }).collect()
        };
        assert_eq!(timeless(&[whole]), timeless(&parts));
    }

    #[test]
    fn budgets_buy_particles() {
        let info = |name| ContenderInfo::named(name).unwrap();
        assert_eq!(info("bootstrap").particles(820, 1), 820);
        assert_eq!(info("ekf").particles(820, 1), 0);
        assert_eq!(evaluations(&info("ukf").with(7), (4, 4)), 9);
        assert_eq!(evaluations(&info("sis").with(7), (4, 4)), 7);
    }

    /// The filter whose particles vary costs what it counted, and no more than the most; a particle filter
    /// that does not counts what it was planned to cost.
    #[test]
    fn numbers_that_vary_are_counted() {
        let of = |name: &str, planned| {
            let fate = go("ungm", name, planned, 0..4);
            evaluations_of(name, planned, fate.runs().iter())
        };
        for most in [20, 1000] {
            let counted = of("kld", most);
            assert!(counted > most / 4 && counted < most, "{counted} of {most}");
        }
        let fixed = go("ungm", "bootstrap", 50, 0..2);
        assert!(fixed.runs().iter().all(|run| run.evaluations == 50.0));
        assert_eq!(evaluations_of("kld", 7, [].iter()), 7);
    }
}
