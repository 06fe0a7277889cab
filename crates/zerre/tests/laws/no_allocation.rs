//! After warm-up a step allocates nothing: not the filters of the list, with one thread.

use crate::list::{Estimates, Means, Run, UnderLaw, filters};
use crate::{Verdict, uphold, worlds};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use zerre::Time;
use zerre::filter::Update;
use zerre::kernels::{Simd, Threads};
use zerre::math::Matrix;
use zerre::rng::Stream;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, counting what each thread asks for.
struct Counting;

// SAFETY: every call is passed on to the system's allocator with its arguments.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's contract is the same.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        // SAFETY: the caller's contract is the same.
        unsafe { System.dealloc(at, layout) }
    }
    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: the caller's contract is the same.
        unsafe { System.realloc(at, layout, size) }
    }
}

fn count() {
    // A thread that is going down has no counter any more, and no test either.
    let _ = ALLOCATIONS.try_with(|a| a.set(a.get() + 1));
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// The law: three steps of warm-up, then a hundred measurements, predictions and measurements of no time.
fn frugal(filter: &dyn UnderLaw) -> Verdict {
    let mut run = filter.begin(Stream::new(1));
    for k in 0..103 {
        let to = Time::from_secs(f64::from(k - k % 4));
        let z = [to.secs() + f64::from(k % 3), -0.5 * to.secs()];
        let before = ALLOCATIONS.get();
        run.step(to, (k % 5 != 4).then_some(&z)).map_err(|e| e.to_string())?;
        let made = ALLOCATIONS.get() - before;
        if k >= 3 && made > 0 {
            return Err(format!("step {k} allocates {made} times"));
        }
    }
    Ok(())
}

#[test]
fn steps_allocate_nothing() {
    let world = worlds::linear(1.0);
    for simd in Simd::available() {
        for particles in [1, 100, 3000] {
            let means = Means { particles, simd, threads: Threads::Serial };
            let named = |name: &str| format!("{name}, {particles} particles, {}", simd.name());
            let list = filters(&world, &means);
            uphold(list.iter().map(|e| (named(&e.name), frugal(&*e.filter))));
        }
    }
}

/// A filter that takes a fresh buffer for every step.
struct Wasteful(Box<dyn UnderLaw>);
struct WastefulRun<'f>(Box<dyn Run + 'f>);

impl UnderLaw for Wasteful {
    fn begin(&self, stream: Stream) -> Box<dyn Run + '_> {
        Box::new(WastefulRun(self.0.begin(stream)))
    }
    fn resume(&self, saved: &str) -> Box<dyn Run + '_> {
        Box::new(WastefulRun(self.0.resume(saved)))
    }
}

impl Run for WastefulRun<'_> {
    fn step(&mut self, to: Time, z: Option<&[f64; 2]>) -> zerre::Result<Update> {
        let fresh = std::hint::black_box(z.map(|z| z.to_vec()));
        self.0.step(to, fresh.as_deref().and_then(|z| z.first_chunk()))
    }
    fn save(&self) -> String {
        self.0.save()
    }
}

impl Estimates for WastefulRun<'_> {
    fn mean(&self) -> [f64; 4] {
        self.0.mean()
    }
    fn covariance(&self) -> Matrix<4, 4> {
        self.0.covariance()
    }
}

#[test]
fn the_law_finds_a_fresh_buffer() {
    for entry in filters(&worlds::linear(1.0), &Means::serial(100)) {
        assert!(frugal(&Wasteful(entry.filter)).is_err(), "{}", entry.name);
    }
}
