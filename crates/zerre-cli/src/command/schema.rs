//! `zerre schema`: the JSON Schema of a configuration.

use crate::Exit;
use crate::config;
use crate::console::Console;
use crate::diagnostic::Diagnostic;

pub(super) fn run(kind: &str, console: &Console) -> Result<Exit, Diagnostic> {
    let schema =
        config::schema(kind).ok_or_else(|| super::unknown("kind of configuration", kind, &config::KINDS))?;
    console.document(&schema)?;
    Ok(Exit::Done)
}
