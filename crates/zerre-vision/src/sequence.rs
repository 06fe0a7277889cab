//! Annotated sequences of the public benchmarks: pictures, and where the object is in them.
//!
//! - OTB: pictures in `img/`; boxes in `groundtruth_rect.txt`, or one file per target where there are several
//!   (`groundtruth_rect.1.txt`); the first pixel is 1.
//! - VOT: pictures beside the annotation or in `color/`; boxes or polygons of four corners in `groundtruth.txt`;
//!   the first pixel is 0.
//! - GOT-10k: pictures beside the annotation; boxes in `groundtruth.txt`, `absence.label`; the first pixel is 0.
//!
//! A polygon becomes the smallest upright box about its corners. Rows of NaN, boxes without width and height
//! and rows that `absence.label` marks with 1 say that the object is not to be seen.

use crate::frames::folder::{Pictures, Place};
use crate::{Error, Rect, Result};
use std::fs;
use std::path::{Path, PathBuf};

/// Sequences of OTB whose annotation begins later than their pictures, with the number of the first annotated
/// picture (the benchmark's list of sequences).
const LATE: [(&str, u64); 4] = [("David", 300), ("BlurCar1", 247), ("BlurCar3", 3), ("BlurCar4", 18)];

/// One object in one sequence.
#[derive(Clone, Debug)]
pub struct Sequence {
    /// The folder's name; of several targets `Jogging.1`, `Jogging.2`.
    pub name: String,
    /// The pictures from the first annotated one on.
    pub pictures: Pictures,
    /// Where the object is in each of them; `None` where it is not to be seen. There may be fewer than
    /// pictures.
    pub truth: Vec<Option<Rect>>,
    /// The file that says so.
    pub source: PathBuf,
    /// What had to be decided to bring both together, in sentences.
    pub notes: Vec<String>,
}

impl Sequence {
    /// The sequences in a folder: one for each of its targets.
    ///
    /// # Errors
    /// No pictures, no annotation, one without a box, a line that is none.
    pub fn open(folder: &Path) -> Result<Vec<Sequence>> {
        let pictures = Pictures::open(folder)?;
        let name = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
        let name = name.file_name().unwrap_or(name.as_os_str()).to_string_lossy().into_owned();
        let sources = annotations(folder)?;
        let several = sources.len() > 1;
        let mut found = Vec::with_capacity(sources.len());
        for (target, source) in sources {
            let mut truth = read_boxes(&source, origin(&source))?;
            absences(folder, &mut truth)?;
            if truth.iter().all(Option::is_none) {
                let problem = "there is no row in which the object is to be seen".to_owned();
                return Err(Error::Picture { path: source, problem });
            }
            let (pictures, notes) = together(&pictures, &name, &mut truth);
            let name = match target.filter(|_| several) {
                Some(target) => format!("{name}.{target}"),
                None => name.clone(),
            };
            found.push(Sequence { name, pictures, truth, source, notes });
        }
        Ok(found)
    }

    /// Whether a folder has an annotation.
    pub fn is_in(folder: &Path) -> bool {
        folder.is_dir() && annotations(folder).is_ok()
    }

    /// The first picture with a box, from 0, and the box.
    pub fn start(&self) -> Option<(usize, Rect)> {
        self.truth.iter().enumerate().find_map(|(at, bounds)| bounds.map(|bounds| (at, bounds)))
    }
}

/// The files with boxes, with the number of their target where their name says it.
fn annotations(folder: &Path) -> Result<Vec<(Option<String>, PathBuf)>> {
    let mut found = Vec::new();
    let entries = fs::read_dir(folder).map_err(|error| unreadable(folder, &error))?;
    for path in entries.filter_map(|entry| entry.ok()).map(|entry| entry.path()) {
        let Some(name) = path.file_name().and_then(|name| name.to_str()) else { continue };
        let Some(middle) = name.strip_prefix("groundtruth_rect").and_then(|rest| rest.strip_suffix("txt"))
        else {
            continue;
        };
        let target = middle.trim_matches('.');
        if middle.starts_with('.') && target.bytes().all(|byte| byte.is_ascii_digit()) {
            found.push((Some(target.to_owned()).filter(|target| !target.is_empty()), path));
        }
    }
    found.sort();
    let plain = folder.join("groundtruth.txt");
    if found.is_empty() && plain.is_file() {
        found.push((None, plain));
    }
    if found.is_empty() {
        let problem =
            "there is no annotation: groundtruth_rect.txt (OTB) or groundtruth.txt (VOT, GOT-10k) is read";
        return Err(Error::Input { input: folder.display().to_string(), problem: problem.to_owned() });
    }
    Ok(found)
}

/// The number that the first pixel has in an annotation: 1 in OTB, whose files are known by their name, 0
/// elsewhere.
pub fn origin(file: &Path) -> f64 {
    let name = file.file_name().map(|name| name.to_string_lossy());
    if name.is_some_and(|name| name.starts_with("groundtruth_rect")) { 1.0 } else { 0.0 }
}

/// Brings rows and pictures together.
fn together(pictures: &Pictures, name: &str, truth: &mut Vec<Option<Rect>>) -> (Pictures, Vec<String>) {
    let (places, rows) = (pictures.places().len(), truth.len());
    let there = pictures.places().iter().filter(|place| matches!(place, Place::File(_))).count();
    let mut notes = Vec::new();
    if rows == there && there < places {
        notes.push(format!(
            "{} numbers are left out between the pictures; the annotation has a row for each picture that is there",
            places - there
        ));
        return (pictures.without_gaps(), notes);
    }
    if rows > places {
        notes.push(format!(
            "the annotation has {rows} rows for {places} pictures: the last {} are left out",
            rows - places
        ));
        truth.truncate(places);
    }
    if rows >= places {
        return (pictures.clone(), notes);
    }
    let late = LATE.iter().find(|(late, _)| *late == name).and_then(|(_, number)| {
        let first = pictures.numbered(*number).filter(|first| *first > 0 && first + rows <= places)?;
        Some((first, number))
    });
    let of = format!("the annotation has {rows} rows for {places} pictures");
    match late {
        Some((first, number)) => {
            notes.push(format!("{of}: in the benchmark it begins with picture {number}"));
            (pictures.part(first, usize::MAX), notes)
        }
        None => {
            notes
                .push(format!("{of}: it is taken to begin with the first one; the last ones are not scored"));
            (pictures.clone(), notes)
        }
    }
}

/// Boxes from a file, one a line: `x y width height` or the corners of a polygon `x y x y x y x y`, between
/// commas, tabs, semicolons or spaces; `origin` is the number that the first pixel has there. A file whose
/// first line names the columns `x`, `y`, `w` and `h` is read by them, with 0 for the first pixel: so are our
/// own results.
///
/// # Errors
/// A file that cannot be read or is empty, a line that is no box, with its number and the value.
pub fn read_boxes(path: &Path, origin: f64) -> Result<Vec<Option<Rect>>> {
    let bytes = fs::read(path).map_err(|error| unreadable(path, &error))?;
    let text = String::from_utf8_lossy(&bytes);
    let lines: Vec<&str> = text.trim_start_matches('\u{feff}').trim_end().lines().collect();
    let named = lines.first().and_then(|line| columns(line));
    let origin = if named.is_some() { 0.0 } else { origin };
    let mut boxes = Vec::with_capacity(lines.len());
    for (at, line) in lines.iter().enumerate().skip(usize::from(named.is_some())) {
        let parts = split(line);
        let parts = match named {
            Some(columns) => columns.iter().filter_map(|column| parts.get(*column).copied()).collect(),
            None => parts,
        };
        let bounds = bounds(&parts, origin).map_err(|problem| Error::Line {
            path: path.to_owned(),
            line: at + 1,
            problem,
        })?;
        boxes.push(bounds);
    }
    if boxes.is_empty() {
        let problem = "the file is empty: one box a line is needed, as `x,y,width,height`".to_owned();
        return Err(Error::Picture { path: path.to_owned(), problem });
    }
    Ok(boxes)
}

/// Marks the rows in which GOT-10k says that the object is absent.
fn absences(folder: &Path, truth: &mut [Option<Rect>]) -> Result<()> {
    let path = folder.join("absence.label");
    if !path.is_file() {
        return Ok(());
    }
    let text = fs::read_to_string(&path).map_err(|error| unreadable(&path, &error))?;
    let rows = text.split_whitespace().count();
    if rows != truth.len() {
        let problem = format!("it has {rows} rows where the annotation has {}", truth.len());
        return Err(Error::Picture { path, problem });
    }
    for (at, (row, label)) in truth.iter_mut().zip(text.split_whitespace()).enumerate() {
        match label {
            "0" => (),
            "1" => *row = None,
            other => {
                let problem = format!("`{other}` is neither 0 (to be seen) nor 1 (absent)");
                return Err(Error::Line { path, line: at + 1, problem });
            }
        }
    }
    Ok(())
}

fn unreadable(path: &Path, error: &std::io::Error) -> Error {
    Error::Picture { path: path.to_owned(), problem: format!("it cannot be read: {error}") }
}

/// The parts of a line. Commas, semicolons and tabs part cells, spaces do so where there are none of these.
fn split(line: &str) -> Vec<&str> {
    let line = line.trim();
    if line.contains([',', ';', '\t']) {
        line.split([',', ';', '\t']).map(str::trim).collect()
    } else {
        line.split_whitespace().collect()
    }
}

/// The places of the columns of a box, where a line names them.
fn columns(line: &str) -> Option<[usize; 4]> {
    let names = split(line);
    let place = |name: &str| names.iter().position(|n| n.eq_ignore_ascii_case(name));
    Some([place("x")?, place("y")?, place("w")?, place("h")?])
}

fn bounds(parts: &[&str], origin: f64) -> Result<Option<Rect>, String> {
    let mut numbers = [0.0_f64; 8];
    if !matches!(parts.len(), 4 | 8) {
        let line: String = parts.join(",").chars().take(60).collect();
        return Err(format!(
            "`{line}` has {} values: a box has 4 (x, y, width, height), a polygon 8 (four corners)",
            parts.len()
        ));
    }
    for (number, part) in numbers.iter_mut().zip(parts) {
        *number = part.parse().map_err(|_| {
            let part: String = part.chars().take(60).collect();
            format!("`{part}` is not a number")
        })?;
    }
    let numbers = &numbers[..parts.len()];
    if numbers.iter().all(|v| v.is_nan()) {
        return Ok(None);
    }
    if let Some(value) = numbers.iter().find(|v| !v.is_finite()) {
        return Err(format!(
            "`{value}` stands between finite numbers: only a whole row of NaN says \"absent\""
        ));
    }
    let rect = match *numbers {
        [x, y, width, height] => Rect { x, y, width, height },
        _ => {
            let range = |offset: usize| {
                let values = || numbers.iter().skip(offset).step_by(2).copied();
                (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max))
            };
            let ((left, right), (top, bottom)) = (range(0), range(1));
            Rect { x: left, y: top, width: right - left, height: bottom - top }
        }
    };
    if rect.width == 0.0 && rect.height == 0.0 {
        return Ok(None);
    }
    if rect.width <= 0.0 || rect.height <= 0.0 {
        return Err(format!(
            "the box {rect} has no area: width and height must be positive, or both 0 for \"absent\""
        ));
    }
    Ok(Some(Rect { x: rect.x - origin, y: rect.y - origin, ..rect }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_read_with_any_separator() {
        let rect = Rect { x: 9.0, y: 19.5, width: 3.0, height: 4.0 };
        for line in ["10,20.5,3,4", "10\t20.5\t3\t4", " 10 20.5   3 4", "10; 20.5; 3; 4", "1e1, 20.5, 3, 4"] {
            assert_eq!(bounds(&split(line), 1.0), Ok(Some(rect)), "{line}");
        }
        assert_eq!(bounds(&split("1,5,4,9,0,7,2,3"), 0.0).map(|b| b.map(|b| b.to_string())), {
            Ok(Some("0,3,4,6".to_owned()))
        });
        assert_eq!(bounds(&split("NaN,nan,NaN,NaN"), 1.0), Ok(None));
        assert_eq!(bounds(&split("0 0 0 0"), 1.0), Ok(None));
        for (line, says) in [
            ("1,2,3", "`1,2,3` has 3 values"),
            ("1,2,,4", "`` is not a number"),
            ("1,2,3,x", "`x` is not a number"),
            ("1,NaN,3,4", "`NaN` stands between"),
            ("1,2,-3,4", "the box 1,2,-3,4 has no area"),
            ("1,2,0,4", "no area"),
        ] {
            let problem = bounds(&split(line), 1.0).unwrap_err();
            assert!(problem.contains(says), "{line}: {problem}");
        }
    }
}
