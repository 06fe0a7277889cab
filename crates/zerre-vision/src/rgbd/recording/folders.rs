//! Recordings that are folders of pictures: which picture of depth belongs to which of colours, and when it
//! was taken.

use super::Source;
use crate::frames::folder::{Pictures, Place, number};
use crate::{Error, Result};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use zerre::Time;

/// A place in a recording.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Entry {
    pub(super) name: String,
    pub(super) time: Time,
    /// None if it is missing although those before and after it are there.
    pub(super) colour: Option<Source>,
    pub(super) depth: Option<Source>,
}

/// The places of a recording, and the number of depth pictures that belong to none.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Listed {
    pub(super) entries: Vec<Entry>,
    pub(super) alone: usize,
    /// Metres per unit of depth where nothing else is said.
    pub(super) scale: f64,
}

const COLOURS: [&str; 4] = ["rgb", "color", "colour", "image"];
const DEPTH: &str = "depth";
const TIMES: &str = "times.csv";

fn refuse(path: &Path, problem: impl Into<String>) -> Error {
    Error::Input { input: path.display().to_string(), problem: problem.into() }
}

fn text(path: &Path) -> Result<String> {
    fs::read_to_string(path).map_err(|error| refuse(path, format!("it cannot be read: {error}")))
}

/// Lists what a folder has: the layout of the TUM benchmark, or folders of colours and of depth with the same
/// numbers, and with times if there are some.
pub(super) fn list(folder: &Path, rate_hz: f64, apart_s: f64) -> Result<Listed> {
    if folder.join("associations.txt").is_file()
        || folder.join("rgb.txt").is_file() && folder.join("depth.txt").is_file()
    {
        return listed_by_time(folder, apart_s);
    }
    let colours = COLOURS.iter().map(|name| folder.join(name)).find(|path| path.is_dir());
    match (colours, folder.join(DEPTH).is_dir()) {
        (Some(colours), true) => numbered(folder, &colours, rate_hz),
        (colours, _) => {
            let missing =
                if colours.is_some() { "no folder `depth`" } else { "no folder `rgb` (or `color`)" };
            let problem = format!(
                "it is no recording of colour and depth, there is {missing}: needed are the folders rgb and depth with \
                 pictures of the same numbers (times.csv with `frame,time_s` beside them if you have times), or rgb.txt and \
                 depth.txt with `time file` in each line"
            );
            Err(refuse(folder, problem))
        }
    }
}

/// Pictures of the same number belong together.
fn numbered(folder: &Path, colours: &Path, rate_hz: f64) -> Result<Listed> {
    let (colours, depths) = (Pictures::open(colours)?, Pictures::open(&folder.join(DEPTH))?);
    let mut partners = BTreeMap::new();
    for place in depths.places() {
        if let Place::File(path) = place {
            partners.insert(key(path), path.clone());
        }
    }
    let times = folder.join(TIMES);
    let times = if times.is_file() { Some(read_times(&times)?) } else { None };
    let mut entries = Vec::with_capacity(colours.places().len());
    let mut before = None;
    for (index, place) in colours.places().iter().enumerate() {
        let (id, name, colour) = match place {
            Place::File(path) => (key(path), name(path), Some(Source::File(path.clone()))),
            Place::Missing(number) => (Key::Number(*number), format!("number {number}"), None),
        };
        let time = match &times {
            None => Time::from_secs(index as f64 / rate_hz),
            Some(times) => match times.get(&id) {
                Some(time) => *time,
                // A place that is missing may have no time either.
                None if colour.is_none() => continue,
                None => return Err(refuse(&folder.join(TIMES), format!("there is no time for {name}"))),
            },
        };
        if before.is_some_and(|before| time <= before) {
            let problem = format!("the time of {name} is not behind that of the frame before it");
            return Err(refuse(&folder.join(TIMES), problem));
        }
        before = Some(time);
        let depth = partners.remove(&id).map(Source::File);
        entries.push(Entry { name, time, colour, depth });
    }
    Ok(Listed { entries, alone: partners.len(), scale: 0.001 })
}

/// What pictures of one frame have in common: the number in their names, or all of the name.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Key {
    Number(u64),
    Name(String),
}

fn key(path: &Path) -> Key {
    let stem = || path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    number(path).map_or_else(|| Key::Name(stem()), Key::Number)
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// `frame,time_s` with a heading; a frame is a number or the name of a picture.
fn read_times(path: &Path) -> Result<BTreeMap<Key, Time>> {
    let refuse = |line: usize, problem: String| Error::Line { path: path.to_owned(), line, problem };
    let text = text(path)?;
    let mut lines = text.lines().enumerate();
    let heading = lines.next().map_or("", |(_, line)| line.trim());
    let columns: Vec<&str> = heading.split(',').map(str::trim).collect();
    let column = |name: &str| {
        let found = columns.iter().position(|column| *column == name);
        found.ok_or_else(|| {
            refuse(1, format!("there is no column `{name}`, but `{heading}`: frame,time_s is needed"))
        })
    };
    let (frame, time) = (column("frame")?, column("time_s")?);
    let mut times = BTreeMap::new();
    for (i, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        let field =
            |at: usize| fields.get(at).ok_or_else(|| refuse(i + 1, format!("{line:?} has too few columns")));
        let time = Time::parse_secs(field(time)?).map_err(|error| refuse(i + 1, error.to_string()))?;
        if times.insert(key(Path::new(field(frame)?)), time).is_some() {
            return Err(refuse(i + 1, format!("the frame {} stands there twice", field(frame)?)));
        }
    }
    Ok(times)
}

/// The layout of the TUM RGB-D benchmark (Sturm et al., IROS 2012): pictures with their times, 5000 units of
/// depth to the metre.
fn listed_by_time(folder: &Path, apart_s: f64) -> Result<Listed> {
    let scale = 1.0 / 5000.0;
    let pairs = folder.join("associations.txt");
    if pairs.is_file() {
        let rows = rows(&pairs, 4)?;
        // Either may come first: the files' folders tell which.
        let swapped =
            rows.first().is_some_and(|(_, row)| row[1].starts_with("depth") && !row[3].starts_with("depth"));
        let order = if swapped { [2, 3, 1] } else { [0, 1, 3] };
        let entries = rows.into_iter().map(|(line, row)| {
            let [time, colour, depth] = order.map(|at| row[at].as_str());
            Ok(Entry {
                name: name(Path::new(colour)),
                time: seconds(&pairs, line, time)?,
                colour: Some(Source::File(folder.join(colour))),
                depth: Some(Source::File(folder.join(depth))),
            })
        });
        let mut entries = entries.collect::<Result<Vec<Entry>>>()?;
        entries.sort_by_key(|entry| entry.time);
        return nonempty(&pairs, Listed { entries, alone: 0, scale });
    }
    let table = |file: &str| -> Result<Vec<(Time, String)>> {
        let path = folder.join(file);
        let timed = rows(&path, 2)?.into_iter().map(|(line, row)| {
            let [time, file] = &row[..2] else { return Err(refuse(&path, "it has too few columns")) };
            Ok((seconds(&path, line, time)?, file.clone()))
        });
        let mut timed = timed.collect::<Result<Vec<_>>>()?;
        timed.sort_by_key(|(time, _)| *time);
        Ok(timed)
    };
    let (colours, depths) = (table("rgb.txt")?, table("depth.txt")?);
    let near = nearest(&colours, &depths, apart_s);
    let used = near.iter().flatten().count();
    let entries = colours.into_iter().zip(near).map(|((time, file), partner)| Entry {
        name: name(Path::new(&file)),
        time,
        colour: Some(Source::File(folder.join(&file))),
        depth: partner.map(|at| Source::File(folder.join(&depths[at].1))),
    });
    let entries = entries.collect();
    nonempty(&folder.join("rgb.txt"), Listed { entries, alone: depths.len() - used, scale })
}

fn nonempty(path: &Path, listed: Listed) -> Result<Listed> {
    if listed.entries.is_empty() { Err(refuse(path, "it names no picture")) } else { Ok(listed) }
}

/// Of each colour picture, the depth picture of about its time: the closest pairs first, each picture once.
fn nearest(colours: &[(Time, String)], depths: &[(Time, String)], apart_s: f64) -> Vec<Option<usize>> {
    let most = (apart_s * 1e9) as i64;
    let mut pairs = Vec::new();
    let mut first = 0;
    for (i, (time, _)) in colours.iter().enumerate() {
        while depths.get(first).is_some_and(|(depth, _)| (*time - *depth).nanos() > most) {
            first += 1;
        }
        let near = depths.iter().enumerate().skip(first);
        let near = near.take_while(|(_, (depth, _))| (*depth - *time).nanos() <= most);
        pairs.extend(near.map(|(k, (depth, _))| ((*depth - *time).nanos().abs(), i, k)));
    }
    pairs.sort_unstable();
    let (mut partner, mut taken) = (vec![None; colours.len()], vec![false; depths.len()]);
    for (_, i, k) in pairs {
        if partner[i].is_none() && !taken[k] {
            (partner[i], taken[k]) = (Some(k), true);
        }
    }
    partner
}

/// The lines of a file that are no remarks, in at least so many columns, with their numbers.
fn rows(path: &Path, columns: usize) -> Result<Vec<(usize, Vec<String>)>> {
    let text = text(path)?;
    let lines = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim()));
    let lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let split = lines.map(|(line, content)| {
        let row: Vec<String> =
            content.split([' ', '\t', ',']).filter(|v| !v.is_empty()).map(str::to_owned).collect();
        if row.len() >= columns {
            return Ok((line, row));
        }
        let problem = format!("{content:?} has {} columns where {columns} are needed", row.len());
        Err(Error::Line { path: path.to_owned(), line, problem })
    });
    split.collect()
}

fn seconds(path: &Path, line: usize, text: &str) -> Result<Time> {
    Time::parse_secs(text).map_err(|error| Error::Line {
        path: path.to_owned(),
        line,
        problem: error.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_closest_pictures_belong_together() {
        let at = |ms: &[i64]| -> Vec<(Time, String)> {
            ms.iter().map(|ms| (Time::from_nanos(ms * 1_000_000), ms.to_string())).collect()
        };
        // 33 is 12 from 45 and 3 from 36; 45 goes to 60, from which it is 15 away.
        let partners = nearest(&at(&[0, 33, 60, 200]), &at(&[5, 36, 45, 230]), 0.02);
        assert_eq!(partners, [Some(0), Some(1), Some(2), None]);
        assert_eq!(nearest(&at(&[0, 1]), &at(&[0]), 0.02), [Some(0), None]);
        assert_eq!(nearest(&at(&[100, 120]), &at(&[80, 140]), 0.02), [Some(0), Some(1)]);
    }
}
