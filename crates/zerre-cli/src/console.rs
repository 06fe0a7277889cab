//! The two voices of the program: sentences for people on stderr, results on stdout.

use crate::args::{Global, Level};
use crate::diagnostic::Diagnostic;
use serde::Serialize;
use std::fmt::Display;
use std::io::{ErrorKind, IsTerminal, Write};

/// Where text goes, and how much of it.
#[derive(Clone, Copy, Debug)]
pub struct Console {
    level: Level,
    json: bool,
}

impl Console {
    /// The console that the options ask for; `--quiet` leaves errors only.
    pub fn new(options: &Global) -> Console {
        Console { level: if options.quiet { Level::Error } else { options.log }, json: options.json }
    }

    /// The console before any option is understood: errors only.
    pub fn early(json: bool) -> Console {
        Console { level: Level::Error, json }
    }

    /// Whether results are one JSON document.
    pub fn json(&self) -> bool {
        self.json
    }

    /// Whether somebody watches: a terminal that was not asked to be quiet.
    pub fn watched(&self) -> bool {
        self.level >= Level::Info && std::io::stderr().is_terminal()
    }

    /// A fact that makes results doubtful.
    pub fn warn(&self, text: impl Display) {
        self.say(Level::Warn, format_args!("warning: {text}"));
    }

    /// What was done.
    pub fn info(&self, text: impl Display) {
        self.say(Level::Info, text);
    }

    /// A page that waits for somebody at `address`, which `text` names; who asked for quiet hears the address
    /// alone, for without it nobody could go on.
    pub fn page(&self, address: &str, text: impl Display) {
        if self.level >= Level::Info {
            self.info(text);
        } else {
            self.say(Level::Error, address);
        }
    }

    /// What only the hunter of a fault wants.
    pub fn debug(&self, text: impl Display) {
        self.say(Level::Debug, text);
    }

    fn say(&self, level: Level, text: impl Display) {
        if level <= self.level {
            // Nobody is left to tell when stderr is gone.
            let _ = writeln!(std::io::stderr(), "{text}");
        }
    }

    /// An error, for people and, with `--json`, as the one document.
    pub fn fail(&self, diagnostic: &Diagnostic) {
        self.say(Level::Error, diagnostic);
        if self.json {
            let _ = self.document(diagnostic);
        }
    }

    /// Writes a result; `false` when the reader has closed the pipe, which is its right and no error.
    ///
    /// # Errors
    /// Standard output that refuses for another reason (a full disk).
    pub fn result(&self, text: &str) -> Result<bool, Diagnostic> {
        let mut out = std::io::stdout().lock();
        match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
            Ok(()) => Ok(true),
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
            Err(error) => Err(Diagnostic::new(format!("cannot write to standard output: {error}"))),
        }
    }

    /// Writes `value` as the one JSON document of the command; otherwise like [`Console::result`].
    ///
    /// # Errors
    /// As [`Console::result`].
    pub fn document(&self, value: &impl Serialize) -> Result<bool, Diagnostic> {
        let text = serde_json::to_string_pretty(value)
            .map_err(|error| Diagnostic::new(format!("the result has no JSON form: {error}")))?;
        self.result(&(text + "\n"))
    }
}
