//! The browser of whoever sits before this machine.

use std::io::IsTerminal;
use std::process::{Command, Stdio};

/// Whether somebody sits before a display.
pub fn has_display() -> bool {
    let named = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let always = cfg!(any(target_os = "macos", windows));
    named("DISPLAY") || named("WAYLAND_DISPLAY") || (always && std::io::stderr().is_terminal())
}

/// Opens the browser; who has none reads the address in the terminal.
pub fn browse(address: &str) {
    let program = if cfg!(target_os = "macos") {
        "open"
    } else if cfg!(windows) {
        "explorer"
    } else {
        "xdg-open"
    };
    let _ = Command::new(program)
        .arg(address)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
}
