//! One filter through one record of measurements.

use cpu_time::ThreadTime;
use zerre::filter::{Filter, Outcome, Update};
use zerre::rng::Stream;
use zerre::{Error, Result, Time};

/// What a filter did with a record.
#[derive(Clone, Debug, PartialEq)]
pub struct Driven<T> {
    /// What was seen after each step, as far as the filter came.
    pub seen: Vec<T>,
    /// Steps whose measurement had no likelihood anywhere: the prediction stood.
    pub degenerate: usize,
    /// Processor time of the thread in the filter itself, s.
    pub seconds: f64,
    /// Why the filter went no further; `None` at the end of the record, and where it had no estimate any
    /// more.
    pub refusal: Option<Error>,
}

/// Runs `filter` from time 0 through `record` until it refuses a step or `see` finds no estimate.
///
/// # Errors
/// A filter that does not start.
pub fn drive<'z, F, T>(
    filter: &F,
    record: impl IntoIterator<Item = (Time, &'z F::Measurement)>,
    stream: Stream,
    mut see: impl FnMut(&F::Belief, &Update) -> Result<Option<T>>,
) -> Result<Driven<T>>
where
    F: Filter,
    F::Measurement: 'z,
{
    let since = ThreadTime::now();
    let mut belief = filter.start(Time::ZERO, stream)?;
    let mut spent = since.elapsed();
    let mut driven = Driven { seen: Vec::new(), degenerate: 0, seconds: 0.0, refusal: None };
    for (at, z) in record {
        let since = ThreadTime::now();
        let step = filter.step(&mut belief, at, Some(z));
        spent += since.elapsed();
        match step.and_then(|update| Ok((update, see(&belief, &update)?))) {
            Ok((update, Some(seen))) => {
                driven.degenerate += usize::from(update.outcome == Outcome::Degenerate);
                driven.seen.push(seen);
            }
            Ok((_, None)) => break,
            Err(error) => {
                driven.refusal = Some(error);
                break;
            }
        }
    }
    driven.seconds = spent.as_secs_f64();
    Ok(driven)
}
