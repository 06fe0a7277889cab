//! The output folder. Files appear whole or not at all; what zerre did not write is never deleted.
//!
//! `run.json` lists the files of its run, and is rewritten before each of them appears: however a run ends, the
//! next one knows which files are its own. An earlier run's files stay until the first file of this one is
//! complete, so a run that fails early destroys nothing.

use super::record::{Record, State};
use crate::args::Global;
use crate::diagnostic::Diagnostic;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fmt::Display;
use std::fs::{self, File, TryLockError};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Component, Path, PathBuf};

const RECORD: &str = "run.json";

/// Where outputs shall go.
#[derive(Clone, Debug, PartialEq)]
pub struct Destination {
    path: PathBuf,
    /// Whether the user named it.
    explicit: bool,
    force: bool,
    /// Files that the run reads.
    inputs: Vec<PathBuf>,
}

impl Destination {
    /// The folder of `--out`, else `out/<command>-<name of the first input>`.
    pub fn of(options: &Global, command: &str, input: Option<&Path>) -> Destination {
        let path = options.out.clone().unwrap_or_else(|| match input {
            None => Path::new("out").join(command),
            Some(input) if input == Path::new("-") => Path::new("out").join(format!("{command}-stdin")),
            Some(input) => {
                let stem = input.file_stem().unwrap_or(input.as_os_str()).to_string_lossy();
                let name: String = stem
                    .chars()
                    .map(|c| if "/\\:".contains(c) || c.is_control() { '_' } else { c })
                    .collect();
                Path::new("out").join(format!("{command}-{name}"))
            }
        });
        Destination { path, explicit: options.out.is_some(), force: options.force, inputs: Vec::new() }
    }

    /// Names files that the run reads: a folder that holds one of them is refused, with `--force` too, because
    /// outputs and the clearing away of an earlier run's files would destroy it.
    #[must_use]
    pub fn reading<'a>(mut self, inputs: impl IntoIterator<Item = &'a Path>) -> Destination {
        self.inputs.extend(inputs.into_iter().map(Path::to_owned));
        self
    }

    /// The input that lies in the folder, itself or by a link.
    fn endangered(&self) -> Option<&Path> {
        let folder = self.path.canonicalize().ok()?;
        let inside = |input: &Path| {
            // "a.csv" has the parent "", which has no canonical form.
            let named = std::path::absolute(input).ok().and_then(|path| path.parent()?.canonicalize().ok());
            let real = input.canonicalize().ok();
            named.as_ref() == Some(&folder) || real.as_deref().and_then(Path::parent) == Some(&folder)
        };
        self.inputs.iter().map(PathBuf::as_path).filter(|input| input.is_file()).find(|input| inside(input))
    }
}

/// A folder that this run may write to.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    command: String,
    force: bool,
    /// Files of an earlier run, removed when the first file of this run is complete.
    earlier: Vec<String>,
    /// Files of this run.
    files: BTreeSet<String>,
    begun: bool,
    /// Held open: the lock keeps a second run out and goes with the process, however it ends.
    _lock: Option<File>,
}

/// As much of `run.json` as says whose the files beside it are.
#[derive(Serialize, Deserialize)]
struct Ownership {
    program: String,
    version: String,
    command: String,
    state: State,
    files: Vec<String>,
}

impl Folder {
    /// Opens the folder, making it where it is absent. Nothing in it changes yet.
    ///
    /// # Errors
    /// A folder that is not empty: named with `--out` and without `--force`, or the default one without a
    /// `run.json` of ours. A folder with an input of this run in it, one that another run is writing to. A system
    /// that refuses.
    pub fn open(place: &Destination, command: &str) -> Result<Folder, Diagnostic> {
        let path = &place.path;
        fs::create_dir_all(path).map_err(|error| Diagnostic::io("make the folder", path, &error))?;
        if let Some(input) = place.endangered() {
            let what = format!("the folder {} holds the input {}", path.display(), input.display());
            return Err(
                Diagnostic::new(what).help("outputs could replace it: name another folder with --out")
            );
        }
        let lock = lock(path)?;
        let mut entries =
            fs::read_dir(path).map_err(|error| Diagnostic::io("read the folder", path, &error))?;
        let earlier = ownership(path).map(|ownership| ownership.files);
        if entries.next().is_some() && !place.force {
            if place.explicit {
                return Err(Diagnostic::new(format!("the folder {} is not empty", path.display()))
                    .help(
                        "name another one, or give --force: files of an earlier run and of the same names are then \
                         replaced",
                    ));
            }
            if earlier.is_none() {
                let what = format!("the folder {} holds files that zerre did not write", path.display());
                return Err(Diagnostic::new(what).help("name another one with --out"));
            }
        }
        Ok(Folder {
            path: path.clone(),
            command: command.to_owned(),
            force: place.force,
            earlier: earlier.unwrap_or_default(),
            files: BTreeSet::new(),
            begun: false,
            _lock: lock,
        })
    }

    /// Opens the folder of an earlier run of the same command to go on in it: its files are this run's own, and stay
    /// until they are written anew.
    ///
    /// # Errors
    /// As [`Folder::open`]; a folder without a `run.json` of ours, or with that of another command.
    pub fn reopen(place: &Destination, command: &str) -> Result<Folder, Diagnostic> {
        let nothing = |what: &str| {
            let what = format!("there is nothing to go on from in {}: {what}", place.path.display());
            Diagnostic::new(what).help("leave --resume out to begin anew")
        };
        let ownership = ownership(&place.path).ok_or_else(|| nothing("it has no run.json of zerre"))?;
        if ownership.command != command {
            return Err(nothing(&format!("it is of `zerre {}`", ownership.command)));
        }
        let mut folder = Folder::open(&Destination { force: true, ..place.clone() }, command)?;
        folder.force = place.force;
        folder.files = folder.earlier.drain(..).collect();
        Ok(folder)
    }

    /// A folder in this one, for outputs of the same run. It has a `run.json` of its own.
    ///
    /// # Errors
    /// As [`Folder::open`]; a name that is none or leads elsewhere.
    pub fn within(&self, name: &str) -> Result<Folder, Diagnostic> {
        let path = self.path.join(name);
        if !plain(name) || path.is_symlink() {
            return Err(Diagnostic::new(format!("{name:?} cannot be the name of a folder of outputs")));
        }
        let place = Destination { path, explicit: false, force: self.force, inputs: Vec::new() };
        Folder::open(&place, &self.command)
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the file `name`: `fill` gets a file aside, which takes its name when it is complete.
    ///
    /// # Errors
    /// A name with a folder in it, a file of that name which zerre did not write (without `--force`), and
    /// whatever `fill` or the system says. Nothing appears then.
    pub fn write<E: Display>(
        &mut self,
        name: &str,
        fill: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
    ) -> Result<(), Diagnostic> {
        let target = self.path.join(name);
        if !plain(name) || name == RECORD {
            return Err(Diagnostic::new(format!("{name:?} cannot be the name of an output")));
        }
        let ours = self.files.contains(name) || self.earlier.iter().any(|earlier| earlier == name);
        if target.symlink_metadata().is_ok() && !ours && !self.force {
            let what = format!("{} is there already, and zerre did not write it", target.display());
            return Err(Diagnostic::new(what).help("move it, or name another folder with --out"));
        }
        let aside = Aside::write(&target, fill)?;
        self.begin()?;
        self.files.insert(name.to_owned());
        self.journal()?;
        aside.appear(&target)
    }

    /// Writes `run.json`, and with it ends the run.
    ///
    /// # Errors
    /// A system that refuses.
    pub fn finish(mut self, record: &Record) -> Result<PathBuf, Diagnostic> {
        self.begin()?;
        #[derive(Serialize)]
        struct Whole<'a> {
            program: &'static str,
            #[serde(flatten)]
            record: &'a Record,
            files: &'a BTreeSet<String>,
        }
        self.write_record(&Whole { program: PROGRAM, record, files: &self.files })?;
        Ok(self.path)
    }

    /// Takes the folder over from the earlier run.
    fn begin(&mut self) -> Result<(), Diagnostic> {
        if self.begun {
            return Ok(());
        }
        self.journal()?;
        for name in self.earlier.drain(..) {
            let path = self.path.join(&name);
            match fs::remove_file(&path) {
                Err(error) if error.kind() != ErrorKind::NotFound => {
                    return Err(Diagnostic::io("replace", &path, &error));
                }
                _ => {}
            }
        }
        self.begun = true;
        Ok(())
    }

    /// Notes whose the files are, before they appear.
    fn journal(&self) -> Result<(), Diagnostic> {
        self.write_record(&Ownership {
            program: PROGRAM.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command: self.command.clone(),
            state: State::Unfinished,
            files: self.files.iter().chain(&self.earlier).cloned().collect(),
        })
    }

    fn write_record(&self, record: &impl Serialize) -> Result<(), Diagnostic> {
        let target = self.path.join(RECORD);
        let aside = Aside::write(&target, |file| {
            serde_json::to_writer_pretty(&mut *file, record)?;
            writeln!(file)
        })?;
        aside.appear(&target)
    }
}

const PROGRAM: &str = "zerre";

/// The `run.json` in `folder`, if it is one of ours. Names that lead elsewhere are not ours, whoever wrote them there.
fn ownership(folder: &Path) -> Option<Ownership> {
    let text = fs::read(folder.join(RECORD)).ok()?;
    let mut ownership: Ownership = serde_json::from_slice(&text).ok()?;
    ownership.files.retain(|name| plain(name) && name != RECORD);
    (ownership.program == PROGRAM).then_some(ownership)
}

/// Whether `name` is the name of a file in the folder and nothing else.
fn plain(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    matches!(parts.next(), Some(Component::Normal(part)) if part == name) && parts.next().is_none()
}

fn lock(folder: &Path) -> Result<Option<File>, Diagnostic> {
    // Where folders cannot be opened or locked (Windows, some network disks) the run goes on without.
    let Ok(file) = File::open(folder) else { return Ok(None) };
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(TryLockError::WouldBlock) => {
            Err(Diagnostic::new(format!("another run is writing to {}", folder.display()))
                .help("wait for it, or name another folder with --out"))
        }
        Err(TryLockError::Error(_)) => Ok(None),
    }
}

/// A complete file beside its place; removed if it never takes it.
struct Aside(PathBuf);

impl Aside {
    fn write<E: Display>(
        target: &Path,
        fill: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>,
    ) -> Result<Aside, Diagnostic> {
        let name = target.file_name().unwrap_or_default().to_string_lossy();
        let aside = Aside(target.with_file_name(format!(".{name}.partial")));
        let refused = |error| Diagnostic::io("write", target, &error);
        // A link put there by somebody else must not be followed.
        match fs::remove_file(&aside.0) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(refused(error)),
            _ => {}
        }
        let mut file = BufWriter::new(File::create_new(&aside.0).map_err(refused)?);
        fill(&mut file)
            .map_err(|error| Diagnostic::new(format!("cannot write {}: {error}", target.display())))?;
        file.into_inner().map_err(|error| refused(error.into_error()))?.sync_all().map_err(refused)?;
        Ok(aside)
    }

    fn appear(self, target: &Path) -> Result<(), Diagnostic> {
        fs::rename(&self.0, target).map_err(|error| Diagnostic::io("write", target, &error))
    }
}

impl Drop for Aside {
    fn drop(&mut self) {
        // After `appear` nothing is there any more, which is as well.
        let _ = fs::remove_file(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::Args;
    use clap::Parser;

    /// A folder of the test's own that is not there yet.
    fn fresh(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("zerre-folder-{}-{name}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        path
    }

    fn place(path: &Path, explicit: bool, force: bool) -> Destination {
        Destination { path: path.to_owned(), explicit, force, inputs: Vec::new() }
    }

    fn run(place: &Destination, files: &[&str]) -> Result<PathBuf, Diagnostic> {
        let mut folder = Folder::open(place, "track")?;
        for name in files {
            folder.write(name, |file| writeln!(file, "{name} of this run"))?;
        }
        folder.finish(&Record::new("track", 1, serde_json::json!({})))
    }

    fn listing(path: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(path).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn the_default_folder_is_named_after_command_and_input() {
        let of = |line: &str, input: Option<&str>| {
            let args = Args::try_parse_from(line.split(' ')).unwrap();
            Destination::of(&args.global, "track", input.map(Path::new)).path
        };
        assert_eq!(of("zerre bench", Some("data/ships.csv")), Path::new("out/track-ships"));
        assert_eq!(of("zerre bench", Some("-")), Path::new("out/track-stdin"));
        assert_eq!(of("zerre bench", Some("..")), Path::new("out/track-.."));
        assert_eq!(of("zerre bench", None), Path::new("out/track"));
        assert_eq!(of("zerre bench --out d", Some("a.csv")), Path::new("d"));
    }

    #[test]
    fn our_own_folder_is_replaced_and_foreign_files_stay() {
        let path = fresh("replace");
        run(&place(&path, false, false), &["a.csv", "b.csv"]).unwrap();
        fs::write(path.join("notes.txt"), "mine").unwrap();
        run(&place(&path, false, false), &["b.csv", "c.csv"]).unwrap();
        assert_eq!(listing(&path), ["b.csv", "c.csv", "notes.txt", "run.json"]);
        fs::remove_dir_all(&path).unwrap();
    }

    /// A folder within is replaced with the run's own; what is foreign in it, and a link in its place, are not touched.
    #[test]
    fn folders_within_are_kept_like_the_folder_itself() {
        let path = fresh("within");
        let twice = |files: &[&str]| -> Result<(), Diagnostic> {
            let folder = Folder::open(&place(&path, false, false), "track")?;
            let mut within = folder.within("rgb")?;
            for name in files {
                within.write(name, |_| std::io::Result::Ok(()))?;
            }
            let record = || Record::new("track", 1, serde_json::Value::Null);
            within.finish(&record())?;
            folder.finish(&record()).map(|_| ())
        };
        twice(&["1.png", "2.png"]).unwrap();
        fs::write(path.join("rgb/notes.txt"), "mine").unwrap();
        twice(&["1.png"]).unwrap();
        assert_eq!(listing(&path.join("rgb")), ["1.png", "notes.txt", "run.json"]);
        let folder = Folder::open(&place(&path, false, false), "track").unwrap();
        for name in ["..", "", "a/b", "/tmp"] {
            assert!(folder.within(name).is_err(), "{name}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(path.join("rgb"), path.join("link")).unwrap();
            assert!(folder.within("link").is_err());
        }
        drop(folder);
        fs::remove_dir_all(&path).unwrap();
    }

    #[test]
    fn foreign_folders_and_files_are_refused() {
        let path = fresh("foreign");
        fs::create_dir_all(&path).unwrap();
        fs::write(path.join("run.json"), "{\"version\": \"1\", \"files\": [\"notes.txt\"]}").unwrap();
        fs::write(path.join("notes.txt"), "mine").unwrap();
        for explicit in [false, true] {
            let text = run(&place(&path, explicit, false), &["a.csv"]).unwrap_err().to_string();
            assert!(text.contains("help:"), "{text}");
        }
        assert_eq!(listing(&path), ["notes.txt", "run.json"]);
        run(&place(&path, true, true), &["a.csv"]).unwrap();
        assert_eq!(listing(&path), ["a.csv", "notes.txt", "run.json"]);
        let text = run(&place(&path, false, false), &["notes.txt"]).unwrap_err().to_string();
        assert!(text.contains("zerre did not write it"), "{text}");
        assert_eq!(fs::read_to_string(path.join("notes.txt")).unwrap(), "mine");
        assert!(path.join("a.csv").exists(), "a run that fails early destroys nothing");
        fs::remove_dir_all(&path).unwrap();
    }

    #[test]
    fn an_explicit_folder_needs_force_even_when_it_is_ours() {
        let path = fresh("explicit");
        run(&place(&path, true, false), &["a.csv"]).unwrap();
        assert!(run(&place(&path, true, false), &["a.csv"]).is_err());
        run(&place(&path, true, true), &["b.csv"]).unwrap();
        assert_eq!(listing(&path), ["b.csv", "run.json"]);
        fs::remove_dir_all(&path).unwrap();
    }

    #[test]
    fn a_record_cannot_point_the_broom_outside() {
        let path = fresh("outside");
        let folder = path.join("inner");
        run(&place(&folder, false, false), &["a.csv"]).unwrap();
        fs::write(path.join("precious"), "mine").unwrap();
        fs::create_dir(folder.join("sub")).unwrap();
        fs::write(folder.join("sub/precious"), "mine").unwrap();
        let record = fs::read_to_string(folder.join("run.json")).unwrap();
        let absolute = format!("{:?}", path.join("precious").display().to_string());
        for name in
            ["\"../precious\"", "\"sub/precious\"", "\"./a.csv/../../precious\"", "\"..\"", "\"\"", &absolute]
        {
            fs::write(folder.join("run.json"), record.replace("\"a.csv\"", name)).unwrap();
            run(&place(&folder, false, false), &["b.csv"]).unwrap();
            assert!(path.join("precious").exists() && folder.join("sub/precious").exists(), "{name}");
            fs::remove_file(folder.join("b.csv")).unwrap();
        }
        let mut open = Folder::open(&place(&folder, false, false), "track").unwrap();
        for name in ["../x", "/x", "sub/x", "", ".", "run.json"] {
            assert!(open.write(name, |_| std::io::Result::Ok(())).is_err(), "{name}");
        }
        drop(open);
        fs::remove_dir_all(&path).unwrap();
    }

    #[test]
    fn a_folder_with_an_input_is_refused_whatever_is_said() {
        let path = fresh("inputs");
        fs::create_dir_all(path.join("out/deeper")).unwrap();
        for file in ["outside", "out/inside", "out/deeper/below"] {
            fs::write(path.join(file), "mine").unwrap();
        }
        let open = |input: &Path| {
            let place = place(&path.join("out"), true, true).reading([Path::new("absent"), input]);
            Folder::open(&place, "track").map(|_| ()).map_err(|error| error.to_string())
        };
        let mut inside = vec!["out/inside", "out/../out/inside", "out/deeper/../inside"];
        let mut elsewhere = vec!["outside", "out/deeper/below", "out", "-"];
        #[cfg(unix)]
        {
            // A link out of the folder would be replaced, one into it leads to what would be.
            std::os::unix::fs::symlink(path.join("outside"), path.join("out/link-out")).unwrap();
            std::os::unix::fs::symlink(path.join("out/inside"), path.join("link-in")).unwrap();
            std::os::unix::fs::symlink(path.join("outside"), path.join("link")).unwrap();
            inside.extend(["out/link-out", "link-in"]);
            elsewhere.push("link");
        }
        for input in inside {
            let text = open(&path.join(input)).unwrap_err();
            assert!(text.contains("holds the input") && text.contains("--out"), "{input}: {text}");
        }
        for input in elsewhere {
            assert_eq!(open(&path.join(input)), Ok(()), "{input}");
        }
        fs::remove_dir_all(&path).unwrap();
    }

    #[test]
    fn files_appear_whole_or_not_at_all() {
        let path = fresh("whole");
        let mut folder = Folder::open(&place(&path, false, false), "track").unwrap();
        folder.write("a.csv", |file| writeln!(file, "whole")).unwrap();
        let failed = folder.write("b.csv", |file| {
            writeln!(file, "half").map_err(|e| e.to_string())?;
            Err("the disk caught fire".to_owned())
        });
        assert!(failed.unwrap_err().to_string().contains("the disk caught fire"));
        drop(folder);
        assert_eq!(listing(&path), ["a.csv", "run.json"]);
        // The run ended without its record; the next one still knows what it may replace.
        run(&place(&path, false, false), &["c.csv"]).unwrap();
        assert_eq!(listing(&path), ["c.csv", "run.json"]);
        fs::remove_dir_all(&path).unwrap();
    }

    #[test]
    fn a_run_goes_on_in_the_folder_of_its_own_command_only() {
        let path = fresh("reopen");
        assert!(Folder::reopen(&place(&path, true, false), "track").is_err());
        fs::create_dir_all(&path).unwrap();
        fs::write(path.join("mine.txt"), "mine").unwrap();
        assert!(Folder::reopen(&place(&path, true, true), "track").is_err());
        fs::remove_file(path.join("mine.txt")).unwrap();
        run(&place(&path, true, false), &["a.csv", "b.csv"]).unwrap();
        let text = Folder::reopen(&place(&path, true, false), "study").unwrap_err().to_string();
        assert!(text.contains("zerre track"), "{text}");
        let mut folder = Folder::reopen(&place(&path, true, false), "track").unwrap();
        folder.write("b.csv", |file| writeln!(file, "anew")).unwrap();
        assert!(folder.write("c.csv", |file| writeln!(file, "new")).is_ok());
        folder.finish(&Record::new("track", 1, serde_json::json!({}))).unwrap();
        assert_eq!(listing(&path), ["a.csv", "b.csv", "c.csv", "run.json"]);
        assert_eq!(fs::read_to_string(path.join("b.csv")).unwrap(), "anew\n");
        fs::remove_dir_all(&path).unwrap();
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn two_runs_do_not_share_a_folder() {
        let path = fresh("lock");
        let first = Folder::open(&place(&path, false, false), "track").unwrap();
        let text = Folder::open(&place(&path, false, false), "track").unwrap_err().to_string();
        assert!(text.contains("another run is writing"), "{text}");
        drop(first);
        assert!(Folder::open(&place(&path, false, false), "track").is_ok());
        fs::remove_dir_all(&path).unwrap();
    }
}
