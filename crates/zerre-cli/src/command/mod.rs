//! The commands.

mod catalog;
mod init;
mod schema;
mod track;

use crate::Exit;
use crate::args::{Args, Command};
use crate::console::Console;
use crate::diagnostic::{Diagnostic, suggest};

/// Runs the command that the arguments name.
///
/// # Errors
/// What went wrong, with the exit code in it.
pub fn execute(args: &Args, console: &Console) -> Result<Exit, Diagnostic> {
    if args.global.resume {
        return Err(Diagnostic::usage("nothing here resumes: this command starts anew each time")
            .help("leave --resume out"));
    }
    match &args.command {
        Command::Catalog { kind } => catalog::run(kind.as_deref(), console),
        Command::Schema { kind } => schema::run(kind, console),
        Command::Init { kind } => init::run(kind, &args.global, console),
        Command::Track(track) => track::run(track, &args.global, console),
        Command::Simulate(_) | Command::Compare(_) | Command::Bench => {
            Err(Diagnostic::new("this build holds no engine to run the command"))
        }
    }
}

/// Refuses an argument that is none of `known`: wrong usage.
fn unknown(what: &str, name: &str, known: &[&str]) -> Diagnostic {
    suggest(Diagnostic::usage(format!("there is no {what} `{name}`")), name, known)
}
