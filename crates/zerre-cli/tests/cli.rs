//! The binary from outside: what it prints where, and how it ends.

use std::io::Read;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

fn zerre(line: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_zerre")).args(line.split_whitespace()).output().unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

/// An empty folder of the test's own.
fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

#[test]
fn help_teaches_by_examples_and_tells_defaults() {
    for command in ["", "track", "simulate", "compare", "video", "otb", "bench", "catalog", "schema", "init"]
    {
        let output = zerre(&format!("{command} --help"));
        let help = text(&output.stdout);
        assert_eq!(output.status.code(), Some(0), "{command}");
        assert!(
            help.contains("Example") && help.contains(&format!("  zerre {command}")),
            "{command}: {help}"
        );
        assert!(help.contains("--seed <N>") && help.contains("[default: 1]"), "{command}: {help}");
        assert!(output.stderr.is_empty());
    }
    let version = zerre("--version");
    assert_eq!(text(&version.stdout), format!("zerre {}\n", env!("CARGO_PKG_VERSION")));
}

#[test]
fn wrong_usage_ends_with_two_and_a_way_out() {
    for (line, says) in [
        ("", "Usage"),
        ("trak a.csv", "track"),
        ("track", "INPUT"),
        ("track a.csv --confg f", "--config"),
        ("track a.csv --format gpx", "opensky"),
        ("catalog --seed x", "--seed"),
        ("catalog formts", "did you mean `formats`?"),
        ("schema trak", "did you mean `track`?"),
        ("init otb", "there is no kind of configuration `otb`"),
        ("catalog --resume", "--resume"),
        ("track a.csv --seed -1", "'-1' for '--seed <N>': a whole number from 0 to 18446744073709551615"),
        ("bench W9", "there is no workload `W9`"),
        ("bench --threads 0", "'0' for '--threads <N>': a whole number of at least 1"),
        ("bench --threads -3", "'-3' for '--threads <N>': a whole number of at least 1"),
        ("simulate turn --runs -5", "'-5' for '--runs <N>': a whole number of at least 1"),
        ("compare a b --max-gap-s -5", "--max-gap-s is -5; a number above zero"),
        ("track a.csv --filter particl", "did you mean `particle`?"),
        ("track a.csv --motion turn", "did you mean `coordinated-turn`, `manoeuvre-turn`, "),
        ("simulate radar", "did you mean `radar-cv`?"),
    ] {
        let output = zerre(line);
        assert_eq!(output.status.code(), Some(2), "{line}");
        assert!(text(&output.stderr).contains(says), "{line}: {}", text(&output.stderr));
        assert!(output.stdout.is_empty(), "{line}");
    }
}

#[test]
fn json_is_one_document_on_standard_output_also_for_errors() {
    for line in [
        "catalog --json",
        "catalog formats --json",
        "schema scenario",
        "init scenario --json",
        "schema track",
        "schema track --json",
        "init --json",
    ] {
        let output = zerre(line);
        assert_eq!(output.status.code(), Some(0), "{line}");
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap();
        assert!(output.stderr.is_empty(), "{line}");
    }
    for (line, error) in [
        ("--json schema trak", "there is no kind of configuration `trak`"),
        ("track a.csv --json --bogus", "unexpected argument '--bogus' found"),
        ("track --json", "the following required arguments were not provided: <INPUT>..."),
        ("--json trak", "unrecognized subcommand 'trak'"),
        ("--json", "'zerre' requires a subcommand"),
    ] {
        let failed = zerre(line);
        let document: serde_json::Value = serde_json::from_slice(&failed.stdout).unwrap();
        assert!(document["error"].as_str().unwrap().starts_with(error), "{line}: {document}");
        assert!(!document["help"].as_array().unwrap().is_empty(), "{line}: {document}");
        assert!(text(&failed.stderr).starts_with("error: "), "{line}");
        assert_eq!(failed.status.code(), Some(2), "{line}");
    }
    // Behind `--` it is the name of a file.
    assert!(zerre("track --bogus -- --json").stdout.is_empty());
}

#[test]
fn the_catalogue_is_lists_of_name_about_and_source() {
    let catalog: serde_json::Value = serde_json::from_slice(&zerre("catalog --json").stdout).unwrap();
    let kinds = catalog.as_object().unwrap();
    for kind in ["motions", "measurements", "metrics", "scenarios", "formats", "columns"] {
        assert!(kinds.contains_key(kind), "{kind}");
    }
    for entry in kinds.values().flat_map(|list| list.as_array().unwrap()) {
        let keys: Vec<_> = entry.as_object().unwrap().keys().collect();
        assert_eq!(keys, ["about", "name", "source"]);
        let (name, about) = (entry["name"].as_str().unwrap(), entry["about"].as_str().unwrap());
        assert!(!name.is_empty() && !about.is_empty() && !about.contains('\n'));
    }
    let table = zerre("catalog formats");
    assert!(text(&table.stdout).contains("  csv "));
}

#[test]
fn quiet_leaves_results_and_errors() {
    let path = folder("quiet");
    let output = zerre(&format!("init --quiet --out {}", path.display()));
    assert!(output.status.success() && output.stderr.is_empty() && output.stdout.is_empty());
    assert!(!text(&zerre("--quiet schema trak").stderr).is_empty());
}

#[test]
fn init_prints_or_writes_and_overwrites_only_by_force() {
    let printed = zerre("init track").stdout;
    assert_eq!(zerre("init").stdout, printed);
    let path = folder("init");
    let into = format!("init track --out {}", path.display());
    let written = || std::fs::read(path.join("track.toml")).unwrap();
    assert_eq!(zerre(&into).status.code(), Some(0));
    assert_eq!(written(), printed);
    std::fs::write(path.join("track.toml"), "mine").unwrap();
    let refused = zerre(&into);
    assert_eq!(refused.status.code(), Some(1));
    assert!(text(&refused.stderr).contains("--force"));
    assert_eq!(written(), b"mine");
    assert_eq!(zerre(&format!("{into} --force")).status.code(), Some(0));
    assert_eq!(written(), printed);
}

#[test]
fn a_reader_who_leaves_early_is_no_error() {
    // The pipe closes before or while the program writes.
    for line in ["schema track", "catalog", "init", "--help"] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_zerre"))
            .args(line.split(' '))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let mut errors = String::new();
        child.stderr.take().unwrap().read_to_string(&mut errors).unwrap();
        assert_eq!((child.wait().unwrap().code(), errors.as_str()), (Some(0), ""), "{line}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error() {
    for line in ["catalog", "--help", "track --help", "--version"] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_zerre"));
        let output = command.args(line.split(' ')).stdout(full).stderr(Stdio::piped()).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{line}");
        assert!(text(&output.stderr).contains("cannot write to standard output"), "{line}");
    }
}
