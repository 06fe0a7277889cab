//! The filters by name, each with its settings.

use super::settings::{
    BOOTSTRAPS, BUDGETS, CYCLES, IMPORTANCE, JUDGE, LIMIT, MOVED, PARTICLES, PLAIN, REACH, TEMPERED_SWEEPS,
    World,
};
use zerre::filter::{Fitness, MovedWeights, Readings, SwarmEstimate};
use zerre::moves::Move;
use zerre::swarm::{BeeColony, Bounds, ParticleSwarm, Positions, Roulette, Swarm};

/// A filter with its settings, for states of one component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entrant {
    /// Its name in rows.
    pub name: &'static str,
    /// Particles; 0 for the exact filter.
    pub particles: usize,
    /// What it is.
    pub how: How,
}

/// Filters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum How {
    /// The exact filter, which comes with the truth.
    Exact,
    /// Bootstrap particle filter that resamples in every step, as the paper's.
    EveryStep,
    /// The paper's: a swarm moves what was resampled.
    Swarm(Swarm<1>, Readings),
    /// Bootstrap particle filter.
    Bootstrap,
    /// Auxiliary particle filter.
    Auxiliary,
    /// Regularised particle filter.
    Regularised,
    /// Particles move by the tangent of the measurement.
    EkfGuided,
    /// Particles move by sigma points.
    UkfGuided,
    /// What was resampled is moved by a Markov kernel, so many times.
    Moves(Move, u32),
    /// The likelihood is taken in by parts, with moves between them, so many times each.
    Tempered(Move, u32),
    /// A swarm is a proposal, and what it finds is weighed.
    Importance(Swarm<1>),
}

impl Entrant {
    /// About how often a step asks for the likelihood of a particle.
    pub fn evaluations(&self) -> usize {
        let times = match &self.how {
            How::Exact => 0,
            How::EveryStep | How::Bootstrap | How::Regularised => 1,
            How::Auxiliary => 2,
            How::EkfGuided => 3,
            How::UkfGuided => 4,
            How::Swarm(swarm, readings) => {
                return self.particles + swarm.evaluations(self.particles) * readings.repetitions as usize;
            }
            How::Moves(_, sweeps) => 1 + *sweeps as usize,
            How::Tempered(_, sweeps) => 1 + 3 * *sweeps as usize,
            How::Importance(swarm) => return self.particles + swarm.evaluations(self.particles),
        };
        times * self.particles
    }
}

const fn entrant(name: &'static str, particles: usize, how: How) -> Entrant {
    Entrant { name, particles, how }
}

fn paper_bounds() -> Option<Bounds<1>> {
    Some(Bounds { lower: [-REACH], upper: [REACH] })
}

fn flight(iterations: u32) -> ParticleSwarm<1> {
    ParticleSwarm { iterations, bounds: paper_bounds(), ..ParticleSwarm::default() }
}

fn colony(cycles: u32) -> BeeColony<1> {
    BeeColony { cycles, bounds: paper_bounds(), ..BeeColony::default() }
}

fn pso(name: &'static str, swarm: ParticleSwarm<1>, readings: Readings) -> Entrant {
    entrant(name, PARTICLES, How::Swarm(Swarm::Particles(swarm), readings))
}

fn abc(name: &'static str, swarm: BeeColony<1>, readings: Readings) -> Entrant {
    entrant(name, PARTICLES, How::Swarm(Swarm::Bees(swarm), readings))
}

/// The paper's three, then what they are compared with in its own world.
pub fn of_the_paper() -> Vec<Entrant> {
    vec![
        entrant("pf", PARTICLES, How::EveryStep),
        pso("pso-pf", flight(1), PLAIN),
        abc("abc-pf", colony(1), PLAIN),
        abc("abc-pf-40", colony(CYCLES), PLAIN),
        entrant("bootstrap", BUDGETS[0], How::EveryStep),
        entrant("bootstrap", JUDGE, How::EveryStep),
    ]
}

/// The paper's filters with what it leaves open decided otherwise.
pub fn variants() -> Vec<Entrant> {
    let equal = Readings { weights: MovedWeights::Equal, ..PLAIN };
    let best = Readings { estimate: SwarmEstimate::Best, ..PLAIN };
    let posterior = Readings { fitness: Fitness::Posterior, ..PLAIN };
    let repeated = Readings { repetitions: 2, ..PLAIN };
    let own = |iterations| ParticleSwarm { positions: Positions::PersonalBest, ..flight(iterations) };
    let scouts = BeeColony { limit: Some(LIMIT), ..colony(CYCLES) };
    let cost_ratio = BeeColony { roulette: Roulette::CostRatio, ..colony(1) };
    vec![
        pso("pso-pf", flight(1), PLAIN),
        pso("pso-pf-40", flight(CYCLES), PLAIN),
        pso("pso-pf-personal-best", own(1), PLAIN),
        pso("pso-pf-40-personal-best", own(CYCLES), PLAIN),
        pso("pso-pf-equal", flight(1), equal),
        pso("pso-pf-best", flight(1), best),
        pso("pso-pf-posterior", flight(1), posterior),
        pso("pso-pf-repeated", flight(1), repeated),
        pso("pso-pf-unbounded", ParticleSwarm { bounds: None, ..flight(1) }, PLAIN),
        abc("abc-pf", colony(1), PLAIN),
        abc("abc-pf-40", colony(CYCLES), PLAIN),
        abc("abc-pf-40-scouts", scouts, PLAIN),
        abc("abc-pf-equal", colony(1), equal),
        abc("abc-pf-best", colony(1), best),
        abc("abc-pf-posterior", colony(1), posterior),
        abc("abc-pf-repeated", colony(1), repeated),
        abc("abc-pf-cost-ratio", cost_ratio, PLAIN),
        abc("abc-pf-unbounded", BeeColony { bounds: None, ..colony(1) }, PLAIN),
    ]
}

/// The filters of the honest table in a world: the exact one, the paper's, sound ones at the budgets.
pub fn honest(world: &World) -> Vec<Entrant> {
    let own = |iterations| ParticleSwarm { positions: Positions::PersonalBest, ..flight(iterations) };
    let mut all = vec![entrant("grid", 0, How::Exact)];
    all.extend(BOOTSTRAPS.map(|particles| entrant("bootstrap", particles, How::Bootstrap)));
    all.extend([
        pso("pso-pf-5", flight(5), PLAIN),
        pso("pso-pf-5-personal-best", own(5), PLAIN),
        pso("pso-pf-40", flight(CYCLES), PLAIN),
        pso("pso-pf-40-personal-best", own(CYCLES), PLAIN),
        abc("abc-pf", colony(1), PLAIN),
        abc("abc-pf-40", colony(CYCLES), PLAIN),
    ]);
    for at in 0..BUDGETS.len() {
        let (budget, moved, tempered) = (BUDGETS[at], MOVED[at], world.tempered[at]);
        let sweeps = (budget / moved - 1) as u32;
        let walk = Move::default();
        all.extend([
            entrant("auxiliary", budget / 2, How::Auxiliary),
            entrant("regularised", budget, How::Regularised),
            entrant("ekf-guided", budget / 3, How::EkfGuided),
            entrant("ukf-guided", world.guided[at], How::UkfGuided),
            entrant("resample-move", moved, How::Moves(walk, sweeps)),
            entrant("stretch-move", moved, How::Moves(Move::Stretch, sweeps)),
            entrant("tempered-random-walk", tempered, How::Tempered(walk, TEMPERED_SWEEPS[at])),
            entrant("tempered-stretch", tempered, How::Tempered(Move::Stretch, TEMPERED_SWEEPS[at])),
        ]);
        let (particles, iterations) = IMPORTANCE[at];
        let swarm = Swarm::Particles(ParticleSwarm { iterations, bounds: None, ..own(iterations) });
        all.push(entrant("swarm-importance", particles, How::Importance(swarm)));
    }
    all
}
