//! The command line of zerre: arguments, configuration, diagnostics, and the record that every run leaves.
//!
//! The library exists so that tests reach the parts; its names follow the binary, not semantic versioning.
//! Text for people goes to stderr, results to stdout. Exit codes: 0 done, 1 could not or was
//! stopped before the end, 2 wrong usage, 3 done but degraded under `--strict`.

pub mod args;
pub mod browser;
pub mod catalog;
pub mod command;
pub mod config;
pub mod console;
pub mod diagnostic;
pub mod run;

use args::Args;
use clap::Parser;
use console::Console;
use diagnostic::Diagnostic;
use std::io::Write;
use std::process::ExitCode;

/// Runs the program on the arguments of the process.
pub fn main() -> ExitCode {
    std::panic::set_hook(Box::new(|panic| {
        let _ = writeln!(std::io::stderr(), "{}", bug_report(panic));
    }));
    let args = match Args::try_parse() {
        Ok(args) => args,
        Err(error) => return not_run(&error).into(),
    };
    let console = Console::new(&args.global);
    match command::execute(&args, &console) {
        Ok(code) => code.into(),
        Err(diagnostic) => {
            console.fail(&diagnostic);
            diagnostic.exit_code().into()
        }
    }
}

/// What the parser of arguments has instead of arguments: help, the version, or a complaint.
fn not_run(answer: &clap::Error) -> Exit {
    let text = answer.render().to_string();
    // Behind `--` everything is a name.
    let json = std::env::args_os().skip(1).take_while(|word| word != "--").any(|word| word == "--json");
    let console = Console::early(json);
    if !answer.use_stderr() {
        return match console.result(&text) {
            Ok(_) => Exit::Done,
            Err(diagnostic) => {
                console.fail(&diagnostic);
                diagnostic.exit_code()
            }
        };
    }
    // Nobody is left to tell when stderr is gone.
    let _ = std::io::stderr().write_all(text.as_bytes());
    if json {
        let _ = console.document(&Diagnostic::misused(&text));
    }
    Exit::Usage
}

/// What a panic says: whose fault it is and what a report should hold. The process then ends with Rust's own 101.
fn bug_report(panic: &dyn std::fmt::Display) -> String {
    format!(
        "zerre met a bug in itself and stopped: {panic}\n\
         help: please report this text, the command line and the input at {} (zerre {})",
        env!("CARGO_PKG_REPOSITORY"),
        env!("CARGO_PKG_VERSION")
    )
}

/// How the program ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// 0: done.
    Done,
    /// 1: could not, and a diagnostic says what, where and how to mend it; or was stopped before the end, and what is
    /// written is complete as far as it goes.
    CouldNot,
    /// 2: wrong usage.
    Usage,
    /// 3: done, but the outcome is degraded and `--strict` was given.
    Degraded,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> ExitCode {
        ExitCode::from(match exit {
            Exit::Done => 0,
            Exit::CouldNot => 1,
            Exit::Usage => 2,
            Exit::Degraded => 3,
        })
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_bug_report_names_the_fault_the_version_and_the_place_to_send_it() {
        let text = super::bug_report(&"index 3 of 2");
        assert!(text.contains("index 3 of 2") && text.contains("https://"));
        assert!(text.contains(env!("CARGO_PKG_VERSION")));
    }
}
