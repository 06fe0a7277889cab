//! The filters that compete, and how each fares in a run.

use super::settings::{INERTIA, PROPOSING_CYCLES, PROPOSING_ITERATIONS, PULL, STEPS};
use super::world::{Exact, Relaxing, prior, times};
use serde::{Deserialize, Serialize};
use zerre::belief::{Cloud, MovedCloud};
use zerre::filter::{
    Filter, Outcome, ParticleFilter, ResampleMove, Settings, SigmaPoints, SwarmImportance, Tangent, Tempered,
};
use zerre::model::{GaussianMeasurement, Measurement};
use zerre::moves::Move;
use zerre::proposal::Guided;
use zerre::rng::Stream;
use zerre::swarm::{BeeColony, Coordinates, ParticleSwarm, Positions, Swarm};
use zerre::{Result, Time};

/// A filter that competes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Competitor {
    /// Its name.
    pub name: &'static str,
    /// What it is.
    pub about: &'static str,
    /// Whether it owes its moves to a swarm; else it is a rival.
    pub is_swarm: bool,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Bootstrap { lookahead: Option<f64> },
    Guided,
    GuidedByPoints,
    Moved(Move),
    Tempered(Move, u32),
    Bees,
    Particles,
}

const fn rival(name: &'static str, about: &'static str, kind: Kind) -> Competitor {
    Competitor { name, about, is_swarm: false, kind }
}

const fn swarm(name: &'static str, about: &'static str, kind: Kind) -> Competitor {
    Competitor { name, about, is_swarm: true, kind }
}

const WALK: Move = Move::RandomWalk { scale: None };

/// All of them.
pub const COMPETITORS: [Competitor; 12] = [
    rival("bootstrap", "proposes by the motion", Kind::Bootstrap { lookahead: None }),
    rival(
        "auxiliary",
        "resamples by what the measurement will say",
        Kind::Bootstrap { lookahead: Some(1.0) },
    ),
    rival("ekf-guided", "proposes by the tangent of the measurement", Kind::Guided),
    rival("ukf-guided", "proposes by sigma points, iterated where they are far off", Kind::GuidedByPoints),
    rival("resample-move", "survivors take a random-walk step", Kind::Moved(WALK)),
    rival("tempered", "the likelihood by degrees, a random-walk step after each", Kind::Tempered(WALK, 1)),
    rival("tempered-3", "the same with three steps", Kind::Tempered(WALK, 3)),
    swarm("stretch-move", "survivors take a stretch step, the exact bee move", Kind::Moved(Move::Stretch)),
    swarm(
        "tempered-stretch",
        "the likelihood by degrees, a stretch step after each",
        Kind::Tempered(Move::Stretch, 1),
    ),
    swarm("tempered-stretch-3", "the same with three steps", Kind::Tempered(Move::Stretch, 3)),
    swarm("bee-importance", "a bee colony as a proposal, weighed", Kind::Bees),
    swarm("swarm-importance", "a particle swarm as a proposal, weighed", Kind::Particles),
];

/// How a filter fared in a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Root mean square, over steps and components, of its mean less the exact one, in standard deviations of the exact
    /// posterior.
    pub posterior_error: f64,
    /// How far its log-evidence of the run is off, nats.
    pub evidence_error: f64,
    /// Likelihood evaluations a step.
    pub evaluations: f64,
    /// Steps whose measurement had no likelihood anywhere.
    pub degenerate: usize,
}

/// A belief made of particles.
trait Particles<const D: usize> {
    fn particles(&self) -> &Cloud<D>;
}

impl<const D: usize> Particles<D> for Cloud<D> {
    fn particles(&self) -> &Cloud<D> {
        self
    }
}

impl<const D: usize> Particles<D> for MovedCloud<D> {
    fn particles(&self) -> &Cloud<D> {
        self.cloud()
    }
}

impl Competitor {
    /// One run with so many particles.
    ///
    /// # Errors
    /// What the models refuse: none of those here.
    pub fn run<const D: usize, const M: usize, H>(
        &self,
        sensor: &H,
        particles: usize,
        (measured, exact): (&[[f64; M]], &Exact),
        stream: Stream,
    ) -> Result<Score>
    where
        H: GaussianMeasurement<D, M> + Measurement<D, Value = [f64; M]> + Clone,
    {
        let settings = Settings { particles, ..Settings::default() };
        let (prior, motion, record) = (prior::<D>()?, Relaxing::<D>, (measured, exact));
        let plain = |settings| ParticleFilter::new(prior, motion, sensor.clone(), settings);
        match self.kind {
            Kind::Bootstrap { lookahead } => {
                follow(&plain(Settings { lookahead, ..settings })?, record, stream)
            }
            Kind::Guided => {
                let guide = Guided::new(Tangent);
                let filter = ParticleFilter::guided(prior, motion, sensor.clone(), guide, settings)?;
                follow(&filter, record, stream)
            }
            Kind::Moved(kernel) => follow(&ResampleMove::new(plain(settings)?, kernel, 1)?, record, stream),
            Kind::Tempered(kernel, sweeps) => {
                follow(&Tempered::new(plain(settings)?, kernel, sweeps)?, record, stream)
            }
            Kind::GuidedByPoints => {
                let guide = Guided::new(SigmaPoints::default());
                let filter = ParticleFilter::guided(prior, motion, sensor.clone(), guide, settings)?;
                follow(&filter, record, stream)
            }
            Kind::Bees => {
                let coordinates = Coordinates::All;
                let bees = BeeColony { cycles: PROPOSING_CYCLES, coordinates, ..BeeColony::default() };
                follow(&SwarmImportance::new(plain(settings)?, Swarm::Bees(bees))?, record, stream)
            }
            Kind::Particles => {
                let swarm = ParticleSwarm {
                    iterations: PROPOSING_ITERATIONS,
                    inertia: INERTIA,
                    cognitive: PULL,
                    social: PULL,
                    positions: Positions::PersonalBest,
                    bounds: None,
                };
                follow(&SwarmImportance::new(plain(settings)?, Swarm::Particles(swarm))?, record, stream)
            }
        }
    }
}

fn follow<F, const D: usize, const M: usize>(
    filter: &F,
    (measured, exact): (&[[f64; M]], &Exact),
    stream: Stream,
) -> Result<Score>
where
    F: Filter<Measurement = [f64; M]>,
    F::Belief: Particles<D>,
{
    let mut belief = filter.start(Time::ZERO, stream)?;
    let mut score = Score { posterior_error: 0.0, evidence_error: 0.0, evaluations: 0.0, degenerate: 0 };
    let mut log_evidence = 0.0;
    for ((z, to), step) in measured.iter().zip(&times()[1..]).zip(0..) {
        let update = filter.step(&mut belief, *to, Some(z))?;
        log_evidence += update.log_evidence;
        score.degenerate += usize::from(update.outcome == Outcome::Degenerate);
        score.evaluations += update.particles.map_or(0.0, |p| p.evaluations as f64) / STEPS as f64;
        for (k, mean) in belief.particles().mean().into_iter().enumerate() {
            let error = (mean - exact.mean[step][k]) / exact.sd[step][k];
            score.posterior_error += error * error / (STEPS * D) as f64;
        }
    }
    score.posterior_error = score.posterior_error.sqrt();
    // A step without likelihood leaves an evidence of zero.
    score.evidence_error = (log_evidence - exact.log_evidence).abs().min(f64::MAX);
    Ok(score)
}
