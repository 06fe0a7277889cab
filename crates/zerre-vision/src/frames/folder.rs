//! Folders of pictures.

use crate::{Error, Frame, Image, Result};
use image::codecs::png::PngEncoder;
use image::{DynamicImage, ExtendedColorType, ImageEncoder, ImageReader};
use std::cmp::Ordering;
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// Endings of the files that are taken for pictures, in any case.
pub const ENDINGS: [&str; 3] = ["jpg", "jpeg", "png"];

/// Folders within a sequence that hold its pictures in the public benchmarks.
const WITHIN: [&str; 2] = ["img", "color"];

/// A place in a video that is kept as a folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// A picture.
    File(PathBuf),
    /// The number of a picture that is not there although those before and behind it are.
    Missing(u64),
}

/// The pictures of a folder in the order of their numbers.
#[derive(Clone, Debug)]
pub struct Pictures {
    folder: PathBuf,
    places: Vec<Place>,
    ignored: usize,
}

impl Pictures {
    /// The pictures of `folder`, or of the folder `img` or `color` within it. `frame_9.png` comes before
    /// `frame_10.png`; the first number may be any. Where all names differ in their number alone, a number that is
    /// left out is a missing frame, unless more are missing than are there.
    ///
    /// # Errors
    /// A folder that cannot be read or has no picture.
    pub fn open(folder: &Path) -> Result<Pictures> {
        for name in WITHIN {
            let within = folder.join(name);
            if within.is_dir() {
                let (files, ignored) = list(&within)?;
                if !files.is_empty() {
                    return Ok(Pictures { folder: within, places: with_gaps(files), ignored });
                }
            }
        }
        let (files, ignored) = list(folder)?;
        if files.is_empty() {
            let others = if ignored == 0 { String::new() } else { format!(" among its {ignored} files") };
            let problem = format!("there is no picture{others}: {} are read", ENDINGS.join(", "));
            return Err(Error::Input { input: folder.display().to_string(), problem });
        }
        Ok(Pictures { folder: folder.to_owned(), places: with_gaps(files), ignored })
    }

    /// Where the pictures lie.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// All places in their order.
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// Files that are no pictures.
    pub fn ignored(&self) -> usize {
        self.ignored
    }

    /// The pictures from place `first` on, at most `count` of them.
    pub fn part(&self, first: usize, count: usize) -> Pictures {
        let places = self.places.iter().skip(first).take(count).cloned().collect();
        Pictures { folder: self.folder.clone(), places, ignored: self.ignored }
    }

    /// The pictures that are there.
    pub fn without_gaps(&self) -> Pictures {
        let there = |place: &&Place| matches!(place, Place::File(_));
        Pictures { places: self.places.iter().filter(there).cloned().collect(), ..self.clone() }
    }

    /// The place of the picture with this number in its name.
    pub fn numbered(&self, number: u64) -> Option<usize> {
        self.places.iter().position(|place| match place {
            Place::File(path) => split(path).is_some_and(|(_, n, _)| n == number),
            Place::Missing(n) => *n == number,
        })
    }

    /// # Errors
    /// A missing picture, one that cannot be read or ends early.
    pub fn read(&self, place: &Place) -> Result<Frame> {
        match place {
            Place::File(path) => frame(path),
            Place::Missing(number) => Err(Error::Input {
                input: self.folder.display().to_string(),
                problem: format!("there is no picture with the number {number}"),
            }),
        }
    }
}

/// The picture in a file as a frame: 16 bits are rounded to 8, grey stands in all three channels, and an
/// alpha channel is dropped.
///
/// # Errors
/// A file that cannot be read, is no picture or ends early.
pub fn frame(path: &Path) -> Result<Frame> {
    frame_of(&bytes(path)?, path)
}

/// The picture in these bytes, which are those of the file `path`.
pub(crate) fn frame_of(bytes: &[u8], path: &Path) -> Result<Frame> {
    let picture = decode(bytes, path)?.into_rgb8();
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    Image::new(width, height, picture.into_raw().as_chunks::<3>().0.to_vec())
}

/// A frame as the bytes of a PNG file.
///
/// # Errors
/// A picture that is too large for the format.
pub fn png(frame: &Frame) -> Result<Vec<u8>> {
    encode(frame.pixels().as_flattened(), frame.size(), ExtendedColorType::Rgb8)
}

/// A depth picture as the bytes of a PNG file of one channel of 16 bits.
///
/// # Errors
/// A picture that is too large for the format.
pub fn depth_png(depth: &Image<u16>) -> Result<Vec<u8>> {
    // The encoder takes 16 bits in the machine's own order.
    let bytes: Vec<u8> = depth.pixels().iter().flat_map(|units| units.to_ne_bytes()).collect();
    encode(&bytes, depth.size(), ExtendedColorType::L16)
}

fn encode(pixels: &[u8], (width, height): (usize, usize), kind: ExtendedColorType) -> Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    let side = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
    PngEncoder::new(&mut bytes)
        .write_image(pixels, side(width), side(height), kind)
        .map_err(|error| Error::Picture { path: PathBuf::from("PNG"), problem: error.to_string() })?;
    Ok(bytes.into_inner())
}

/// A depth picture: one channel of 16 bits, in the unit of its camera (often millimetres; 0 is often
/// "unknown").
///
/// # Errors
/// A file that cannot be read, ends early, or has another kind of pixels.
pub fn depth(path: &Path) -> Result<Image<u16>> {
    depth_of(&bytes(path)?, path)
}

/// The depth picture in these bytes, which are those of the file `path`.
pub(crate) fn depth_of(bytes: &[u8], path: &Path) -> Result<Image<u16>> {
    match decode(bytes, path)? {
        DynamicImage::ImageLuma16(picture) => {
            Image::new(picture.width() as usize, picture.height() as usize, picture.into_raw())
        }
        other => {
            let kind = other.color();
            let (bits, channels) = (8 * u32::from(kind.bytes_per_pixel()), kind.channel_count());
            let problem = format!(
                "it has {channels} channels of {} bits: a depth picture has one of 16 bits",
                bits / u32::from(channels).max(1)
            );
            Err(Error::Picture { path: path.to_owned(), problem })
        }
    }
}

/// Columns and rows of the picture in a file, from its header.
///
/// # Errors
/// A file that cannot be read or is no picture.
pub(crate) fn size(path: &Path) -> Result<(usize, usize)> {
    let refuse = |problem: String| Error::Picture { path: path.to_owned(), problem };
    let reader = ImageReader::open(path).and_then(ImageReader::with_guessed_format);
    let reader = reader.map_err(|error| refuse(format!("it cannot be read: {error}")))?;
    let (width, height) = reader.into_dimensions().map_err(|error| refuse(error.to_string()))?;
    Ok((width as usize, height as usize))
}

/// The last number in a file's name.
pub(crate) fn number(path: &Path) -> Option<u64> {
    split(path).map(|(_, number, _)| number)
}

fn bytes(path: &Path) -> Result<Vec<u8>> {
    let refuse =
        |error| Error::Picture { path: path.to_owned(), problem: format!("it cannot be read: {error}") };
    fs::read(path).map_err(refuse)
}

fn decode(bytes: &[u8], path: &Path) -> Result<DynamicImage> {
    let refuse = |problem: String| Error::Picture { path: path.to_owned(), problem };
    if is_cut_jpeg(bytes) {
        return Err(refuse("the picture ends early: copy the file again".to_owned()));
    }
    let reader = ImageReader::new(Cursor::new(bytes));
    let reader = reader.with_guessed_format().map_err(|error| refuse(error.to_string()))?;
    reader.decode().map_err(|error| refuse(format!("it is no readable picture: {error}")))
}

/// Whether a JPEG file lacks its end. Its decoder would fill what is missing with grey, which a tracker must
/// not see. The headers are walked up to the first scan; behind it the mark of the end cannot stand for
/// anything else.
fn is_cut_jpeg(bytes: &[u8]) -> bool {
    let Some(mut rest) = bytes.strip_prefix(&[0xff, 0xd8]) else { return false };
    loop {
        let [0xff, mark, tail @ ..] = rest else { return true };
        match mark {
            0xff => rest = &rest[1..],
            0xda => return !tail.windows(2).any(|pair| pair == [0xff, 0xd9]),
            0x01 | 0xd0..=0xd9 => rest = tail,
            _ => {
                let [high, low, ..] = tail else { return true };
                let Some(next) = tail.get(usize::from(u16::from_be_bytes([*high, *low]))..) else {
                    return true;
                };
                rest = next;
            }
        }
    }
}

/// The pictures of a folder in natural order, and how many other files it has.
fn list(folder: &Path) -> Result<(Vec<PathBuf>, usize)> {
    let refuse = |error: std::io::Error| Error::Input {
        input: folder.display().to_string(),
        problem: format!("the folder cannot be read: {error}"),
    };
    let (mut files, mut ignored) = (Vec::new(), 0);
    for entry in fs::read_dir(folder).map_err(refuse)? {
        let path = entry.map_err(refuse)?.path();
        if path.is_dir() {
            continue;
        }
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
        // Files whose name begins with a dot are notes that systems leave, such as `._0001.jpg`.
        let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
        if !hidden && ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str())) {
            files.push(path);
        } else {
            ignored += 1;
        }
    }
    files.sort_by(|a, b| natural(&a.to_string_lossy(), &b.to_string_lossy()));
    Ok((files, ignored))
}

/// Order of names in which digits count as numbers.
fn natural(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (a, b);
    while !left.is_empty() && !right.is_empty() {
        let (one, two) = (digits(left), digits(right));
        let order = if one > 0 && two > 0 {
            let (x, y) = (left[..one].trim_start_matches('0'), right[..two].trim_start_matches('0'));
            x.len().cmp(&y.len()).then_with(|| x.cmp(y))
        } else {
            left.chars().next().cmp(&right.chars().next())
        };
        if order != Ordering::Equal {
            return order;
        }
        let step = |text: &str, digits: usize| digits.max(text.chars().next().map_or(0, char::len_utf8));
        (left, right) = (&left[step(left, one)..], &right[step(right, two)..]);
    }
    left.len().cmp(&right.len()).then_with(|| a.cmp(b))
}

fn digits(text: &str) -> usize {
    text.bytes().take_while(u8::is_ascii_digit).count()
}

/// What stands before the last number of a file's name, the number, and what stands behind it.
fn split(path: &Path) -> Option<(String, u64, String)> {
    let stem = path.file_stem()?.to_string_lossy().into_owned();
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = stem[..end].rfind(|c: char| !c.is_ascii_digit());
    let start = start.map_or(0, |at| at + stem[at..].chars().next().map_or(1, char::len_utf8));
    Some((stem[..start].to_owned(), stem[start..end].parse().ok()?, stem[end..].to_owned()))
}

/// The files with the numbers that are left out between them.
fn with_gaps(files: Vec<PathBuf>) -> Vec<Place> {
    let plain = |files: Vec<PathBuf>| files.into_iter().map(Place::File).collect();
    let Some(parts) = files.iter().map(|file| split(file)).collect::<Option<Vec<_>>>() else {
        return plain(files);
    };
    let one_series = parts.windows(2).all(|pair| pair[0].0 == pair[1].0 && pair[0].2 == pair[1].2);
    let numbers: Vec<u64> = parts.iter().map(|part| part.1).collect();
    let steps = || numbers.windows(2).map(|pair| pair[1].saturating_sub(pair[0]));
    // Every fifth frame of a video is a video too: what is regular is no gap.
    let Some(step) = steps().min().filter(|step| one_series && *step > 0) else { return plain(files) };
    let missing: u64 = steps().map(|s| s / step - 1).fold(0, u64::saturating_add);
    if steps().any(|s| s % step != 0) || missing > files.len() as u64 {
        return plain(files);
    }
    let mut places = Vec::with_capacity(files.len() + missing as usize);
    let mut expected = numbers.first().copied();
    for (file, number) in files.into_iter().zip(numbers) {
        while let Some(lost) = expected.filter(|n| *n < number) {
            places.push(Place::Missing(lost));
            expected = lost.checked_add(step);
        }
        places.push(Place::File(file));
        expected = number.checked_add(step);
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_count_as_numbers() {
        let mut names =
            ["frame_10.png", "frame_9.png", "a.png", "frame_009.png", "Frame 1.png", "frame_.png"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(
            names,
            ["Frame 1.png", "a.png", "frame_.png", "frame_009.png", "frame_9.png", "frame_10.png"]
        );
        assert_eq!(natural("18446744073709551616.png", "9.png"), Ordering::Greater);
        assert_eq!(natural("é2", "é10"), Ordering::Less);
    }

    #[test]
    fn the_last_number_of_a_name_is_the_frames() {
        let parts = |name: &str| split(Path::new(name));
        assert_eq!(parts("0247.jpg"), Some((String::new(), 247, String::new())));
        assert_eq!(parts("cam2_é7l.jpg"), Some(("cam2_é".to_owned(), 7, "l".to_owned())));
        assert_eq!(parts("a.jpg"), None);
    }

    #[test]
    fn gaps_are_what_breaks_the_step() {
        let places = |names: &[&str]| with_gaps(names.iter().map(PathBuf::from).collect());
        let file = |name: &str| Place::File(PathBuf::from(name));
        assert_eq!(
            places(&["7.png", "8.png", "11.png"]),
            [file("7.png"), file("8.png"), Place::Missing(9), Place::Missing(10), file("11.png")]
        );
        let regular = ["0.png", "5.png", "10.png"];
        assert_eq!(places(&regular), regular.map(file));
        for odd in [&["1.png", "2.png", "999.png"][..], &["1.png", "3.png", "6.png"], &["a1.png", "b3.png"]] {
            assert_eq!(places(odd).len(), odd.len(), "{odd:?}");
        }
        assert_eq!(places(&["5.png", "10.png", "20.png"])[2], Place::Missing(15));
    }

    #[test]
    fn the_end_of_a_jpeg_is_looked_for_behind_its_headers() {
        // A header may hold a small picture of its own, with its own end.
        let head = [0xff, 0xd8, 0xff, 0xe1, 0, 4, 0xff, 0xd9, 0xff, 0xda, 0, 2, 7, 7];
        assert!(is_cut_jpeg(&head));
        assert!(is_cut_jpeg(&head[..5]) && is_cut_jpeg(&head[..8]));
        assert!(!is_cut_jpeg(&[&head[..], &[0xff, 0xd9, 0]].concat()));
        assert!(!is_cut_jpeg(b"\x89PNG"));
    }
}
