//! `zerre init`: a commented starter configuration.

use crate::Exit;
use crate::args::Global;
use crate::config;
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use std::fs;
use std::io::{ErrorKind, Write};

pub(super) fn run(kind: &str, options: &Global, console: &Console) -> Result<Exit, Diagnostic> {
    let text =
        config::starter(kind).ok_or_else(|| super::unknown("kind of configuration", kind, &config::KINDS))?;
    let Some(folder) = &options.out else {
        if console.json() {
            console.document(&serde_json::json!({ "kind": kind, "toml": text }))?;
        } else {
            console.result(text)?;
        }
        return Ok(Exit::Done);
    };
    let path = folder.join(format!("{kind}.toml"));
    let refused = |error: std::io::Error| match error.kind() {
        ErrorKind::AlreadyExists => Diagnostic::new(format!("{} is there already", path.display()))
            .help("--force replaces it, --out names another folder"),
        _ => Diagnostic::io("write", &path, &error),
    };
    fs::create_dir_all(folder).map_err(|error| Diagnostic::io("make the folder", folder, &error))?;
    let mut open = fs::OpenOptions::new();
    open.write(true).create_new(!options.force).create(true).truncate(true);
    open.open(&path).and_then(|mut file| file.write_all(text.as_bytes())).map_err(refused)?;
    console.info(format_args!("wrote {}", path.display()));
    if console.json() {
        console.document(&serde_json::json!({ "kind": kind, "path": path.display().to_string() }))?;
    }
    Ok(Exit::Done)
}
