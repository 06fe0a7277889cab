//! What others say of where objects are: the labelled boxes of a recording of frames.

use super::input::{Input, refused, whole};
use super::settings::Settings;
use crate::diagnostic::Diagnostic;
use std::collections::BTreeMap;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use zerre::track::{Plot, Reading};
use zerre_io::{Format, Options, Recording};
use zerre_lab::metric::{LabelledBox, Region};

/// Name of the table of boxes beside frames.
const BESIDE: &str = "boxes.csv";

/// A labelled box with its name.
pub(super) struct Named {
    /// What it is.
    pub name: String,
    /// Place of its frame in [`Input::scenes`].
    pub scene: usize,
    label: LabelledBox,
}

impl Named {
    /// What it covers.
    pub fn region(&self) -> Region {
        Region::polygon(self.label.corners([0.0; 2]))
    }
}

impl Input {
    /// The labelled box that holds most of the points of a scan, to within a metre: radar errs by about as much. The
    /// first of several.
    pub fn label_of(&self, plot: usize) -> Option<&Named> {
        const NEAR_M: f64 = 1.0;
        let scene = self.scene_of(plot)?;
        let points = self.points.get(plot)?;
        let held = |named: &&Named| points.iter().filter(|y| named.label.holds(**y, NEAR_M)).count();
        let of_scene = self.labels.iter().filter(|label| label.scene == scene);
        of_scene.rev().max_by_key(held).filter(|label| 2 * held(label) > points.len())
    }

    /// Place in the scenes of the file that a plot is from.
    pub fn scene_of(&self, plot: usize) -> Option<usize> {
        self.scene_of_file.get(*self.file_of.get(plot)?).copied().flatten()
    }
}

/// Takes the tables of labels out of what was read, adds those that lie beside frames, and gives every file that is a
/// frame its scene.
pub(super) fn take(
    settings: &Settings,
    paths: &[PathBuf],
    recordings: &mut Vec<(usize, Recording)>,
    input: &mut Input,
) -> Result<(), Diagnostic> {
    let is_frame =
        |recording: &Recording| recording.summary.format == Format::Nuscenes && !recording.summary.labels;
    input.scene_of_file = vec![None; paths.len()];
    let mut frames: BTreeMap<(PathBuf, u64), usize> = BTreeMap::new();
    for (file, recording) in recordings.iter().filter(|(_, recording)| is_frame(recording)) {
        // A frame without any object has nothing to show.
        let Some(number) = recording.plots.first().and_then(|plot| plot.scan) else { continue };
        let scene = input.scenes.len();
        input.scene_of_file[*file] = Some(scene);
        frames.insert((folder(&paths[*file]), number), scene);
        input.scenes.push(paths[*file].file_stem().unwrap_or_default().to_string_lossy().into_owned());
    }
    let (labels, rest): (Vec<_>, Vec<_>) =
        recordings.drain(..).partition(|(_, recording)| recording.summary.labels);
    *recordings = rest;
    for (file, recording) in labels {
        add(&folder(&paths[file]), recording, &frames, input);
    }
    let mut folders: Vec<PathBuf> = frames.keys().map(|(folder, _)| folder.clone()).collect();
    folders.dedup();
    for folder in folders {
        let path = folder.join(BESIDE);
        let given = |other: &PathBuf| other.canonicalize().ok() == path.canonicalize().ok();
        if !path.is_file() || paths.iter().any(given) {
            continue;
        }
        let (bytes, file) = whole(&path)?;
        let options = Options { format: Format::Auto, sizes: true, ..settings.options.clone() };
        let name = path.display().to_string();
        let recording = Recording::read(&name, BufReader::new(&bytes[..]), &options);
        // Another table of this name is nobody's business.
        let Ok(recording) = recording else { continue };
        if recording.summary.labels {
            input.files.push(file);
            add(&folder, recording, &frames, input);
        }
    }
    Ok(())
}

fn folder(path: &Path) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).to_owned()
}

/// Adds the boxes of the frames that were read. Of each row the position comes first, then the size.
fn add(folder: &Path, table: Recording, frames: &BTreeMap<(PathBuf, u64), usize>, input: &mut Input) {
    let mut middles: BTreeMap<u64, (Plot, [f64; 2])> = BTreeMap::new();
    for plot in table.plots {
        match plot.reading {
            Reading::Position2(middle) => {
                middles.insert(plot.line, (plot, middle));
            }
            Reading::Size(size) => {
                let Some((plot, middle)) = middles.remove(&plot.line) else { continue };
                let scene = plot.scan.and_then(|number| frames.get(&(folder.to_owned(), number)));
                let Some(&scene) = scene else { continue };
                let name = plot.id.as_deref().unwrap_or_default().to_owned();
                let [length, width, yaw] = size;
                let label = LabelledBox { centre: middle, size: [length, width], yaw };
                input.labels.push(Named { name, scene, label });
            }
            _ => {}
        }
    }
}

/// Reads a table of labels again, with the sizes.
pub(super) fn with_sizes(name: &str, bytes: &[u8], options: &Options) -> Result<Recording, Diagnostic> {
    let options = Options { sizes: true, ..options.clone() };
    Recording::read(name, BufReader::new(bytes), &options).map_err(|error| refused(&error))
}
