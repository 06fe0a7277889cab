//! A drawn recording of colour and depth as a folder.

use super::{COMMAND, pretty};
use crate::Exit;
use crate::args::{Global, Simulate};
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use crate::run::{Destination, Folder, Progress, Record, State, interrupted, listen};
use serde_json::json;
use std::io::Write;
use std::path::Path;
use std::time::Instant;
use zerre_vision::rgbd::scene::{Named, Scene, SceneFile};

/// Pictures of colours and of depth, each in a folder of its own, and tables beside them.
pub(super) fn draw(
    kind: &Named,
    args: &Simulate,
    options: &Global,
    console: &Console,
) -> Result<Exit, Diagnostic> {
    let since = Instant::now();
    if args.runs.get() > 1 {
        return Err(Diagnostic::usage("a recording is drawn once: its pictures are a folder's".to_owned())
            .help("give each one its own --seed and --out"));
    }
    let settings = kind.settings();
    let config = json!({ "scenario": kind.name, "runs": 1, "scene": settings });
    if options.explain {
        console.info(&pretty(&config)?);
    }
    listen()?;
    let refused = |error: zerre_vision::Error| Diagnostic::new(error.to_string());
    let scene = Scene::new(settings, options.seed).map_err(refused)?;
    let mut folder = Folder::open(&Destination::of(options, COMMAND, Some(Path::new(kind.name))), COMMAND)?;
    let mut pictures = [folder.within("rgb")?, folder.within("depth")?];
    let mut progress = Progress::new(console, "frames", Some(scene.len() as u64));
    let mut made = 0;
    while made < scene.len() && !interrupted() {
        for (folder, file) in pictures.iter_mut().zip(scene.pictures(made).map_err(refused)?) {
            let name = file.name.rsplit('/').next().unwrap_or_default();
            folder.write(name, |out| out.write_all(&file.bytes))?;
        }
        made += 1;
        progress.advance(1);
    }
    drop(progress);
    for SceneFile { name, bytes } in scene.tables().map_err(refused)? {
        folder.write(&name, |out| out.write_all(&bytes))?;
    }
    let record = || {
        let mut record = Record::new(COMMAND, options.seed, config.clone());
        if made < scene.len() {
            record.state = State::Interrupted;
        }
        record.seconds = since.elapsed().as_secs_f64();
        record
    };
    if made < scene.len() {
        console.warn(format_args!("stopped after {made} of {} frames; these are complete", scene.len()));
    }
    for folder in pictures {
        folder.finish(&record())?;
    }
    let record = record();
    let path = folder.finish(&record)?;
    let before = (0..made).filter(|k| scene.truth(*k).overlap).count();
    if console.json() {
        console.document(&json!({
            "scenario": kind.name, "state": record.state, "frames": made, "overlap": before,
            "out": path.display().to_string(),
        }))?;
    }
    console.info(format_args!("{made} frames, the hand is before the body in {before}: {}", path.display()));
    Ok(if made < scene.len() { Exit::CouldNot } else { Exit::Done })
}
