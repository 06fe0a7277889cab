//! Stopping: the first Ctrl-C or termination asks the run to end with what is complete, the second ends it at once.

use crate::diagnostic::Diagnostic;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};

static ASKED: AtomicBool = AtomicBool::new(false);

/// The exit code of a program that an interrupt ended, by the convention of shells.
const KILLED: i32 = 130;

/// Starts to listen for Ctrl-C and termination. Only commands whose loop asks [`interrupted`] may call this: for
/// the others the signal's own effect is the right one.
///
/// # Errors
/// A system that refuses a handler.
pub fn listen() -> Result<(), Diagnostic> {
    ctrlc::set_handler(|| {
        if ASKED.swap(true, Ordering::Relaxed) {
            std::process::exit(KILLED);
        }
        let _ = writeln!(std::io::stderr(), "stopping after this step; Ctrl-C again ends at once");
    })
    .map_err(|error| Diagnostic::new(format!("cannot listen for Ctrl-C: {error}")))
}

/// Whether somebody asked the run to stop.
pub fn interrupted() -> bool {
    ASKED.load(Ordering::Relaxed)
}
