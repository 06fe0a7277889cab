//! Monte-Carlo studies: many independent jobs over threads, intervals over their runs, tables of the outcome.

pub mod comparison;
pub mod contender;
pub mod drive;
pub mod experiment;
pub mod front;
pub mod interval;
pub mod marginal;
mod page;
pub mod spec;
pub mod table;
pub mod world;

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread;

/// Does every one of `jobs` on `threads` threads and hands each result to `done`, on the caller's thread, in the order
/// in which they are ready. A job that gives `None` was interrupted; nothing new begins then, and what is under way is
/// waited for. Results cannot depend on the number of threads as long as `work` depends on its job alone.
///
/// # Errors
/// The first error of `work` or of `done`; what is under way is waited for.
pub fn run<J: Sync, R: Send, E: Send>(
    jobs: &[J],
    threads: usize,
    work: impl Fn(&J) -> Result<Option<R>, E> + Sync,
    mut done: impl FnMut(&J, R) -> Result<(), E>,
) -> Result<(), E> {
    let next = AtomicUsize::new(0);
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        let (send, results) = mpsc::channel();
        for _ in 0..threads.clamp(1, jobs.len().max(1)) {
            let (send, next, stop, work) = (send.clone(), &next, &stop, &work);
            scope.spawn(move || {
                while !stop.load(Ordering::Relaxed) {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    let Some(job) = jobs.get(at) else { break };
                    let result = work(job);
                    if !matches!(result, Ok(Some(_))) {
                        stop.store(true, Ordering::Relaxed);
                    }
                    // The receiver goes only after a failure, which is told elsewhere.
                    let _ = send.send((at, result));
                }
            });
        }
        drop(send);
        let mut outcome = Ok(());
        for (at, result) in results {
            let told = match result {
                Ok(Some(result)) => done(&jobs[at], result),
                Ok(None) => Ok(()),
                Err(error) => Err(error),
            };
            if told.is_err() {
                stop.store(true, Ordering::Relaxed);
            }
            outcome = outcome.and(told);
        }
        outcome
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_job_is_done_once_on_any_number_of_threads() {
        let jobs: Vec<u64> = (0..50).collect();
        for threads in [1, 2, 7, 100] {
            let mut seen = vec![0; jobs.len()];
            let done = |job: &u64, square| {
                assert_eq!(square, job * job);
                seen[*job as usize] += 1;
                Ok::<_, ()>(())
            };
            run(&jobs, threads, |job| Ok(Some(job * job)), done).unwrap();
            assert_eq!(seen, vec![1; jobs.len()]);
        }
        run(&[], 3, |_: &u64| Ok::<_, ()>(Some(())), |_, ()| Ok(())).unwrap();
    }

    #[test]
    fn an_error_or_an_interruption_ends_the_work() {
        let jobs: Vec<usize> = (0..1000).collect();
        let mut count = 0;
        let work = |job: &usize| if *job == 5 { Err("five") } else { Ok(Some(())) };
        let failed = run(&jobs, 1, work, |_, ()| {
            count += 1;
            Ok(())
        });
        assert_eq!((failed, count), (Err("five"), 5));
        let mut count = 0;
        let work = |job: &usize| Ok::<_, ()>((*job < 5).then_some(()));
        run(&jobs, 1, work, |_, ()| {
            count += 1;
            Ok(())
        })
        .unwrap();
        assert_eq!(count, 5);
        assert_eq!(run(&jobs, 2, |_| Ok(Some(())), |_, ()| Err("full")), Err("full"));
    }
}
