//! The commands.

mod balls;
mod bench;
mod catalog;
mod compare;
mod experiment;
pub(crate) mod fuse;
mod init;
mod label;
mod otb;
mod reproduce;
mod schema;
mod simulate;
mod study;
mod track;
mod video;

use crate::Exit;
use crate::args::{Args, Command, Global, Simd};
use crate::console::Console;
use crate::diagnostic::{Diagnostic, suggest};

/// Runs the command that the arguments name.
///
/// # Errors
/// What went wrong, with the exit code in it.
pub fn execute(args: &Args, console: &Console) -> Result<Exit, Diagnostic> {
    if args.global.resume
        && !matches!(
            args.command,
            Command::Reproduce(_) | Command::Study(_) | Command::Otb(_) | Command::Label(_)
        )
    {
        return Err(Diagnostic::usage("nothing here resumes: this command starts anew each time")
            .help("leave --resume out"));
    }
    match &args.command {
        Command::Catalog { kind } => catalog::run(kind.as_deref(), console),
        Command::Schema { kind } => schema::run(kind, console),
        Command::Init { kind } => init::run(kind, &args.global, console),
        Command::Track(of) => track::run(of, &args.global, console),
        Command::Simulate(of) => simulate::run(of, &args.global, console),
        Command::Compare(of) => compare::run(of, &args.global, console),
        Command::Reproduce(of) => reproduce::run(of, &args.global, console),
        Command::Study(of) => study::run(of, &args.global, console),
        Command::Video(of) => video::run(of, &args.global, console),
        Command::Balls(of) => balls::run(of, &args.global, console),
        Command::Fuse(of) => fuse::run(of, &args.global, console),
        Command::Otb(of) => otb::run(of, &args.global, console),
        Command::Label(of) => label::run(of, &args.global, console),
        Command::Bench { workloads, quick } => bench::run(&args.global, workloads, *quick, console),
    }
}

/// Refuses an argument that is none of `known`: wrong usage.
fn unknown(what: &str, name: &str, known: &[&str]) -> Diagnostic {
    suggest(Diagnostic::usage(format!("there is no {what} `{name}`")), name, known)
}

/// The tracker of this name, or the default one.
fn tracker(name: Option<&str>) -> Result<&'static zerre_vision::tracker::Kind, Diagnostic> {
    use zerre_vision::tracker::{TRACKERS, find};
    let Some(name) = name else { return Ok(&TRACKERS[0]) };
    find(name)
        .ok_or_else(|| unknown("tracker", name, &TRACKERS.iter().map(|kind| kind.name).collect::<Vec<_>>()))
}

/// Digests a file that was read.
fn input(path: &std::path::Path) -> Result<crate::run::Input, Diagnostic> {
    let unreadable = |error| Diagnostic::io("read", path, &error);
    let file = std::fs::File::open(path).map_err(unreadable)?;
    crate::run::Hashing::new(file).finish(&path.display().to_string()).map_err(unreadable)
}

/// More threads than this help nobody, and starting them may fail.
const MOST_THREADS: usize = 256;

/// The number of threads that the options ask for: all cores unless they say.
fn threads(global: &Global) -> usize {
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    global.threads.map_or_else(cores, usize::from).min(MOST_THREADS)
}

/// The SIMD level that the options ask for.
fn simd(global: &Global) -> Result<zerre::kernels::Simd, Diagnostic> {
    use zerre::kernels::Simd as Engine;
    let name = match global.simd {
        Simd::Auto => return Ok(Engine::best()),
        Simd::Scalar => "scalar",
        Simd::Avx2 => "avx2",
        Simd::Avx512 => "avx512",
        Simd::Neon => "neon",
    };
    Engine::named(name).ok_or_else(|| {
        let has: Vec<_> = Engine::available().into_iter().map(Engine::name).collect();
        Diagnostic::new(format!("this processor has no {name}")).help(format!("it has {}", has.join(", ")))
    })
}
