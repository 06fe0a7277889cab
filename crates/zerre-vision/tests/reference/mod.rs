//! Reads the files that `make.py` writes.

use std::collections::HashMap;
use zerre_vision::{Frame, Image};

/// A picture or a list of numbers.
struct Entry {
    size: (usize, usize),
    bytes: Vec<u8>,
    real: Vec<f64>,
}

/// The entries of a file.
pub struct Vectors(HashMap<String, Entry>);

impl Vectors {
    pub fn read(name: &str) -> Vectors {
        let path = format!("{}/tests/reference/{name}.txt", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(&path).expect(&path);
        let mut lines = text.lines();
        let mut entries = HashMap::new();
        while let Some(head) = lines.next() {
            let head: Vec<&str> = head.split(' ').collect();
            let [width, height, channels] = [1, 2, 3].map(|i| head[i].parse::<usize>().unwrap());
            let (mut bytes, mut real) = (Vec::new(), Vec::new());
            for line in lines.by_ref().take(height) {
                if head[4] == "u8" {
                    bytes.extend(
                        (0..line.len() / 2).map(|i| u8::from_str_radix(&line[2 * i..][..2], 16).unwrap()),
                    );
                } else {
                    real.extend(line.split(' ').map(|v| v.parse::<f64>().unwrap()));
                }
            }
            assert_eq!(bytes.len() + real.len(), width * height * channels, "{}", head[0]);
            entries.insert(head[0].to_owned(), Entry { size: (width, height), bytes, real });
        }
        Vectors(entries)
    }

    fn entry(&self, name: &str) -> &Entry {
        self.0.get(name).unwrap_or_else(|| panic!("no entry {name}"))
    }

    pub fn grey(&self, name: &str) -> Image<u8> {
        let Entry { size, bytes, .. } = self.entry(name);
        Image::new(size.0, size.1, bytes.clone()).unwrap()
    }

    pub fn frame(&self, name: &str) -> Frame {
        let Entry { size, bytes, .. } = self.entry(name);
        Image::new(size.0, size.1, bytes.as_chunks().0.to_vec()).unwrap()
    }

    pub fn real(&self, name: &str) -> &[f64] {
        &self.entry(name).real
    }
}

/// Each number within `tolerance` of the expected one, or of that share of it where it is larger than one.
pub fn close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (i, (f, e)) in found.iter().zip(expected).enumerate() {
        assert!((f - e).abs() <= tolerance * e.abs().max(1.0), "number {i}: {f} instead of {e}");
    }
}

/// Each grey level within `tolerance` levels of the expected one.
pub fn close_u8(found: &Image<u8>, expected: &Image<u8>, tolerance: u8) {
    assert_eq!(found.size(), expected.size());
    for (i, (f, e)) in found.pixels().iter().zip(expected.pixels()).enumerate() {
        let (x, y) = (i % found.width(), i / found.width());
        assert!(f.abs_diff(*e) <= tolerance, "pixel ({x}, {y}): {f} instead of {e}");
    }
}
