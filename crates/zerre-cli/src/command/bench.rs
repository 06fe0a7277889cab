//! `zerre bench`: the speed of this machine beside recorded peers.

use crate::Exit;
use crate::args::Global;
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run;
use serde::Serialize;
use std::fmt::Write;
use std::time::Duration;
use zerre_lab::bench::{self, Kept, Options, Peer, Row};

#[derive(Serialize)]
struct Machine {
    cpu: String,
    simd: &'static str,
    cores: usize,
}

#[derive(Serialize)]
struct Document<'a> {
    machine: Machine,
    rows: &'a [Row],
    /// Speed-up of `threads` threads on loops that touch no memory; `null` for one thread.
    memory_free_scaling: Option<f64>,
    peers: Vec<Peer>,
}

pub(super) fn run(
    global: &Global,
    names: &[String],
    quick: bool,
    console: &Console,
) -> Result<Exit, Diagnostic> {
    let known = bench::workloads();
    if let Some(name) = names.iter().find(|name| !known.contains(&name.as_str())) {
        return Err(super::unknown("workload", name, &known));
    }
    let simd = super::simd(global)?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = super::threads(global);
    let budget = Duration::from_secs_f64(if quick { 0.1 } else { 2.0 });
    let deadline_steps = if quick { 20_000 } else { 100_000 };
    let options = Options { simd, threads, budget, deadline_steps };
    run::listen()?;
    let machine = Machine { cpu: cpu_name(), simd: simd.name(), cores };
    console.info(format_args!("{}, {} core(s), {}", machine.cpu, machine.cores, machine.simd));
    let rows = bench::run(&options, names, |row| {
        if console.watched() {
            console.info(format_args!(
                "  {:16} {:>9} {:8.2} ns",
                row.workload, row.particles, row.ns_per_particle_step
            ));
        }
        !run::interrupted()
    })
    .map_err(|error| Diagnostic::new(format!("the workloads did not run: {error}")))?;
    if run::interrupted() {
        console.warn("interrupted: the workloads that were complete follow");
    }
    let scaling = (threads > 1 && !run::interrupted()).then(|| bench::memory_free_scaling(threads));
    if console.json() {
        console.document(&Document {
            machine,
            rows: &rows,
            memory_free_scaling: scaling,
            peers: bench::peers(),
        })?;
    } else {
        console.result(&table(&rows, scaling, &bench::peers()))?;
    }
    Ok(if run::interrupted() { Exit::CouldNot } else { Exit::Done })
}

fn table(rows: &[Row], scaling: Option<f64>, peers: &[Peer]) -> String {
    let mut text = String::from(
        "workload          particles  threads  noise        ns/particle-step (range)     rmse     peak MB  best peer\n",
    );
    for row in rows {
        let noise = format!("{} {}", row.generator, row.noise_bits);
        let range = format!("({:.2}..{:.2})", row.ns_range.0, row.ns_range.1);
        let rmse = row.rmse.map_or_else(|| "-".into(), |e| format!("{e:.4}"));
        let peak = row.peak_mb.map_or_else(|| "-".into(), |mb| format!("{mb:.0}"));
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:16} {:>10} {:>8}  {noise:11} {:>8.2} {range:20} {rmse:>10} {peak:>9}  {}",
            row.workload,
            row.particles,
            row.threads,
            row.ns_per_particle_step,
            best(peers, row),
        );
        if let (Some(cpu), Some(wall)) = (row.cpu_seconds, row.wall_seconds) {
            let _ = writeln!(text, "{:16} {cpu:.3} s of processor time, {wall:.3} s", "");
        }
        if let Some(Kept { budget_ms, share, particles: [few, _, many], milliseconds }) = &row.deadline {
            let [median, rare, longest] = milliseconds;
            let _ = writeln!(
                text,
                "{:16} {:.3} % of {} steps within {budget_ms} ms (median {median:.3}, 99.9 % {rare:.3}, longest \
                 {longest:.3}); {few} to {many} particles",
                "",
                100.0 * share,
                row.repetitions,
            );
        }
    }
    if let Some(scaling) = scaling {
        let _ = writeln!(text, "loops that touch no memory run {scaling:.2} times faster with all threads");
    }
    text + "peers: recorded on another machine, see benches/record/peers.csv\n"
}

/// The fastest recorded peer on the same workload and size.
fn best(peers: &[Peer], row: &Row) -> String {
    let workload = if row.workload == "W1-user-model" { "W1" } else { row.workload };
    peers
        .iter()
        .filter(|peer| peer.workload == workload && peer.particles == row.particles)
        .min_by(|a, b| a.ns_per_particle_step.total_cmp(&b.ns_per_particle_step))
        .map_or_else(String::new, |peer| format!("{} {:.1}", peer.peer, peer.ns_per_particle_step))
}

/// The processor's name for itself, on systems that tell.
fn cpu_name() -> String {
    std::fs::read_to_string("/proc/cpuinfo")
        .ok()
        .and_then(|text| {
            let line = text.lines().find(|line| line.starts_with("model name"))?;
            Some(line.split_once(':')?.1.trim().to_owned())
        })
        .unwrap_or_else(|| std::env::consts::ARCH.to_owned())
}
