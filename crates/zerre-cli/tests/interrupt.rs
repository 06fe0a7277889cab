//! Ctrl-C: alone in its file, for a handler belongs to the whole process.
#![cfg(unix)]

use std::time::{Duration, Instant};
use zerre_cli::run::{interrupted, listen};

#[test]
fn the_first_signal_asks_and_does_not_kill() {
    listen().unwrap();
    assert!(!interrupted());
    let me = std::process::id().to_string();
    assert!(std::process::Command::new("kill").args(["-TERM", &me]).status().unwrap().success());
    let since = Instant::now();
    while !interrupted() {
        assert!(since.elapsed() < Duration::from_secs(30), "the signal did not arrive");
        std::thread::sleep(Duration::from_millis(5));
    }
}
