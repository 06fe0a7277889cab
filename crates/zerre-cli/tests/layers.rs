//! The rules that no compiler checks: which crate may know which, and where `unsafe` may stand.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// What each package may depend on within the workspace.
const MAY_USE: [(&str, &[&str]); 7] = [
    ("zerre", &[]),
    ("zerre-io", &["zerre"]),
    ("zerre-vision", &["zerre"]),
    ("zerre-lab", &["zerre", "zerre-vision"]),
    ("zerre-web", &[]),
    ("zerre-cli", &["zerre", "zerre-io", "zerre-lab", "zerre-vision", "zerre-web"]),
    ("zerre-examples", &["zerre", "zerre-io", "zerre-lab"]),
];

/// Where the library may hold `unsafe`.
const MAY_BE_UNSAFE: [&str; 1] = ["crates/zerre/src/kernels"];

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The packages of the workspace that `manifest` depends on, in any kind of dependency.
fn uses(manifest: &toml::Table) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut tables = vec![manifest];
    tables.extend(
        manifest
            .get("target")
            .and_then(|t| t.as_table())
            .into_iter()
            .flat_map(|targets| targets.values().filter_map(|target| target.as_table())),
    );
    for table in tables {
        for kind in ["dependencies", "dev-dependencies", "build-dependencies"] {
            for (name, value) in table.get(kind).and_then(|d| d.as_table()).into_iter().flatten() {
                let package = value.get("package").and_then(|p| p.as_str()).unwrap_or(name);
                if package == "zerre" || package.starts_with("zerre-") {
                    found.insert(package.to_owned());
                }
            }
        }
    }
    found
}

#[test]
fn arrows_point_one_way() {
    let root = workspace();
    let mut folders: Vec<PathBuf> =
        fs::read_dir(root.join("crates")).unwrap().map(|entry| entry.unwrap().path()).collect();
    folders.push(root.join("examples"));
    let mut seen = BTreeSet::new();
    for folder in folders.iter().filter(|folder| folder.join("Cargo.toml").exists()) {
        let manifest: toml::Table = read(&folder.join("Cargo.toml")).parse().unwrap();
        let name = manifest["package"]["name"].as_str().unwrap().to_owned();
        let (_, allowed) = MAY_USE.iter().find(|(package, _)| *package == name).unwrap_or_else(|| {
            panic!("{name} has no place in the list of layers: give it one");
        });
        for used in uses(&manifest) {
            assert!(allowed.contains(&used.as_str()), "{name} must not use {used}");
        }
        seen.insert(name);
    }
    assert_eq!(seen, MAY_USE.iter().map(|(name, _)| (*name).to_owned()).collect());
}

#[test]
fn an_arrow_that_points_back_is_seen() {
    let manifest = |text: &str| text.parse::<toml::Table>().unwrap();
    for text in [
        "[dependencies]\nzerre-cli.workspace = true",
        "[dev-dependencies]\nzerre-cli = { path = \"../zerre-cli\" }",
        "[build-dependencies]\nother = { package = \"zerre-cli\", version = \"1\" }",
        "[target.'cfg(unix)'.dependencies]\nzerre-cli = \"1\"",
    ] {
        assert!(uses(&manifest(text)).contains("zerre-cli"), "{text}");
    }
}

/// Lines with the keyword, comments, strings and lints about it apart.
fn unsafe_lines(text: &str) -> Vec<usize> {
    let keyword = |line: &str| {
        let code = line.split("//").next().unwrap_or_default();
        let mut words = code.split(|c: char| !(c.is_alphanumeric() || c == '_'));
        words.any(|word| word == "unsafe") && !code.contains("\"unsafe")
    };
    text.lines().enumerate().filter(|(_, line)| keyword(line)).map(|(at, _)| at + 1).collect()
}

fn rust_files(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && path.file_name().is_some_and(|name| name != "target") {
            rust_files(&path, into);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            into.push(path);
        }
    }
}

/// Counting allocators of tests are unsafe by nature; product code is what the rule is about.
#[test]
fn unsafe_stands_where_it_may() {
    let root = workspace();
    let mut files = Vec::new();
    rust_files(&root.join("examples"), &mut files);
    for entry in fs::read_dir(root.join("crates")).unwrap() {
        rust_files(&entry.unwrap().path().join("src"), &mut files);
    }
    let mut places: BTreeSet<&str> = BTreeSet::new();
    for file in &files {
        let lines = unsafe_lines(&read(file));
        let place = file.strip_prefix(&root).unwrap();
        let allowed = MAY_BE_UNSAFE.iter().find(|allowed| place.starts_with(allowed));
        assert!(lines.is_empty() || allowed.is_some(), "{}: unsafe in lines {lines:?}", place.display());
        places.extend(allowed.filter(|_| !lines.is_empty()));
    }
    assert_eq!(places.len(), MAY_BE_UNSAFE.len(), "a place in the list has no unsafe any more: {places:?}");
}

#[test]
fn the_keyword_is_told_from_words_about_it() {
    assert_eq!(
        unsafe_lines("// unsafe\nlet a = unsafe { b };\nunsafe_op\n\"unsafe\"\nunsafe fn f() {}"),
        [2, 5]
    );
}
