//! The newest of what comes faster than it is used: those who follow a camera must not lag behind it.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Items of an iterator that is gone through on a thread of its own, of which only the newest one waits;
/// those that nobody has taken before the next one came are dropped and counted.
#[derive(Debug)]
pub struct Newest<T> {
    shared: Arc<Shared<T>>,
}

#[derive(Debug)]
struct Shared<T> {
    slot: Mutex<Slot<T>>,
    changed: Condvar,
}

#[derive(Debug)]
struct Slot<T> {
    waiting: Option<(T, Instant)>,
    dropped: usize,
    ended: bool,
    /// Whether nobody takes any more.
    left: bool,
}

/// What there was to take.
#[derive(Debug)]
pub enum Taken<T> {
    /// The newest item, and when it came.
    Item(T, Instant),
    /// None came within the time.
    Late,
    /// None will come any more.
    End,
}

impl<T> Shared<T> {
    fn slot(&self) -> MutexGuard<'_, Slot<T>> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Tells that no more items come, whatever ended the thread.
struct Ending<T>(Arc<Shared<T>>);

impl<T> Drop for Ending<T> {
    fn drop(&mut self) {
        self.0.slot().ended = true;
        self.0.changed.notify_all();
    }
}

impl<T: Send + 'static> Newest<T> {
    /// Begins to go through `items`; it goes on until they end or this is dropped.
    pub fn of(items: impl Iterator<Item = T> + Send + 'static) -> Newest<T> {
        let slot = Slot { waiting: None, dropped: 0, ended: false, left: false };
        let shared = Arc::new(Shared { slot: Mutex::new(slot), changed: Condvar::new() });
        let ending = Ending(Arc::clone(&shared));
        std::thread::spawn(move || {
            let Ending(shared) = &ending;
            for item in items {
                let mut slot = shared.slot();
                if slot.left {
                    return;
                }
                let before = slot.waiting.replace((item, Instant::now()));
                slot.dropped += usize::from(before.is_some());
                drop(slot);
                shared.changed.notify_all();
            }
        });
        Newest { shared }
    }

    /// The newest item, waiting for one at most so long.
    pub fn take(&self, at_most: Duration) -> Taken<T> {
        let until = Instant::now() + at_most;
        let mut slot = self.shared.slot();
        loop {
            if let Some((item, came)) = slot.waiting.take() {
                return Taken::Item(item, came);
            }
            if slot.ended {
                return Taken::End;
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Taken::Late;
            }
            let waited = self.shared.changed.wait_timeout(slot, left);
            slot = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Items that were dropped so far.
    pub fn dropped(&self) -> usize {
        self.shared.slot().dropped
    }
}

impl<T> Drop for Newest<T> {
    fn drop(&mut self) {
        self.shared.slot().left = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;

    const LONG: Duration = Duration::from_secs(20);

    /// Who is slow gets the newest one, and what was dropped in between is counted: nothing depends on the
    /// clock, for the maker tells when it has made an item and waits to be told to go on.
    #[test]
    fn who_is_slow_gets_the_newest() {
        let (go, told) = mpsc::channel::<()>();
        let (tell, made) = mpsc::channel();
        let items = (0..100).inspect(move |_| {
            // An item is in its place when the next one is asked for.
            tell.send(()).unwrap();
            told.recv().unwrap();
        });
        let newest = Newest::of(items);
        let make = |count: usize| {
            for _ in 0..count {
                go.send(()).unwrap();
                made.recv_timeout(LONG).unwrap();
            }
        };
        made.recv_timeout(LONG).unwrap();
        assert!(matches!(newest.take(Duration::from_millis(1)), Taken::Late), "none is made yet");
        make(5);
        assert!(matches!(newest.take(LONG), Taken::Item(4, _)));
        assert_eq!(newest.dropped(), 4);
        assert!(matches!(newest.take(Duration::from_millis(1)), Taken::Late));
        make(1);
        assert!(matches!(newest.take(LONG), Taken::Item(5, _)));
        assert_eq!(newest.dropped(), 4);
    }

    #[test]
    fn the_last_item_comes_before_the_end() {
        let newest = Newest::of(std::iter::once(7));
        assert!(matches!(newest.take(LONG), Taken::Item(7, _)));
        assert!(matches!(newest.take(LONG), Taken::End));
        // A maker that breaks ends, too.
        let broken = Newest::of(std::iter::from_fn(|| -> Option<i32> { panic!("a test's own") }));
        assert!(matches!(broken.take(LONG), Taken::End));
    }
}
