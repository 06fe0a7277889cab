//! Messages that hold a picture: those of ROS 2 (CDR) and of Foxglove (protocol buffers).

use crate::frames::folder;
use crate::rgbd::Depth;
use crate::{Frame, Image};
use std::path::Path;
use zerre::Time;

/// The kinds of messages that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Ros,
    RosCompressed,
    Foxglove,
    FoxgloveCompressed,
}

impl Kind {
    /// By the names of schema and encoding.
    pub(super) fn of(schema: &str, encoding: &str) -> Option<Kind> {
        match (schema, encoding) {
            ("sensor_msgs/msg/Image", "cdr") => Some(Kind::Ros),
            ("sensor_msgs/msg/CompressedImage", "cdr") => Some(Kind::RosCompressed),
            ("foxglove.RawImage", "protobuf") => Some(Kind::Foxglove),
            ("foxglove.CompressedImage", "protobuf") => Some(Kind::FoxgloveCompressed),
            _ => None,
        }
    }
}

/// A picture as it came.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Message {
    /// When it was taken, if it says so.
    pub(super) stamp: Option<Time>,
    /// Columns, rows and bytes per row of pixels that are not packed.
    size: [usize; 3],
    /// Of pixels that are not packed, what they are; else the format.
    encoding: String,
    big_endian: bool,
    packed: bool,
    data: Vec<u8>,
}

const ENDS_EARLY: &str = "the message ends early";

impl Message {
    /// # Errors
    /// Bytes that are no such message, as a sentence.
    pub(super) fn parse(kind: Kind, bytes: &[u8]) -> Result<Message, String> {
        match kind {
            Kind::Ros | Kind::RosCompressed => Message::cdr(bytes, kind == Kind::RosCompressed),
            Kind::Foxglove => Message::protobuf(bytes, &[6, 2, 3, 4, 5], false),
            Kind::FoxgloveCompressed => Message::protobuf(bytes, &[2, 0, 0, 3, 0], true),
        }
    }

    /// `sensor_msgs/msg/Image` and `CompressedImage`: header (stamp, frame), then rows, columns, encoding,
    /// order of bytes, bytes per row, data; or format, data.
    fn cdr(bytes: &[u8], packed: bool) -> Result<Message, String> {
        // Byte 1 of the head says whether numbers are in little order; places count from behind it.
        let (head, body) = bytes.split_at_checked(4).ok_or(ENDS_EARLY)?;
        let mut reader = Cdr { body, at: 0, little: head[1] & 1 == 1 };
        let (seconds, nanos) = (reader.word()?, reader.word()?);
        let stamp = i64::from(seconds.cast_signed()) * 1_000_000_000 + i64::from(nanos);
        let _frame = reader.bytes()?;
        let mut message =
            Message { packed, stamp: (stamp != 0).then(|| Time::from_nanos(stamp)), ..Message::default() };
        if !packed {
            (message.size[1], message.size[0]) = (reader.word()? as usize, reader.word()? as usize);
        }
        message.encoding = reader.text()?;
        if !packed {
            message.big_endian = reader.byte()? != 0;
            message.size[2] = reader.word()? as usize;
        }
        message.data = reader.bytes()?.to_vec();
        Ok(message)
    }

    /// `foxglove.RawImage` and `foxglove.CompressedImage`: `fields` are the numbers of data, width, height,
    /// encoding or format, and step.
    fn protobuf(bytes: &[u8], fields: &[u64; 5], packed: bool) -> Result<Message, String> {
        let mut message = Message { packed, ..Message::default() };
        for field in Fields(bytes) {
            let (number, value) = field?;
            match value {
                Value::Bytes(bytes) if number == 1 => {
                    let mut nanos = 0_i64;
                    for field in Fields(bytes) {
                        match field? {
                            (1, Value::Number(seconds)) => {
                                let seconds = seconds.cast_signed();
                                nanos = nanos.saturating_add(seconds.saturating_mul(1_000_000_000));
                            }
                            (2, Value::Number(part)) => nanos = nanos.saturating_add(part.cast_signed()),
                            _ => {}
                        }
                    }
                    message.stamp = (nanos != 0).then(|| Time::from_nanos(nanos));
                }
                Value::Bytes(bytes) if number == fields[0] => message.data = bytes.to_vec(),
                Value::Bytes(bytes) if number == fields[3] => {
                    message.encoding = String::from_utf8_lossy(bytes).into_owned();
                }
                Value::Number(count) => {
                    for (own, size) in [fields[1], fields[2], fields[4]].iter().zip(&mut message.size) {
                        if *own == number {
                            *size = usize::try_from(count).map_err(|error| error.to_string())?;
                        }
                    }
                }
                Value::Bytes(_) => {}
            }
        }
        Ok(message)
    }

    /// The rows of pixels of so many bytes.
    fn rows(&self, bytes: usize) -> Result<impl Iterator<Item = &[u8]>, String> {
        let [width, height, step] = self.size;
        let needed = width.checked_mul(bytes).filter(|row| *row > 0 && *row <= step);
        let all = height.checked_mul(step).filter(|all| *all > 0 && *all <= self.data.len());
        match (needed, all) {
            (Some(row), Some(_)) => {
                Ok(self.data.chunks_exact(step).take(height).map(move |line| &line[..row]))
            }
            _ => Err(format!(
                "{} bytes do not make {width} x {height} pixels of {bytes} bytes in rows of {step}",
                self.data.len()
            )),
        }
    }

    /// As colours.
    ///
    /// # Errors
    /// Another kind of pixels, too few bytes, as a sentence.
    pub(super) fn frame(&self) -> Result<Frame, String> {
        if self.packed {
            return folder::frame_of(&self.data, Path::new("picture")).map_err(|error| error.to_string());
        }
        let (bytes, order) = match self.encoding.as_str() {
            "rgb8" => (3, [0, 1, 2]),
            // OpenCV's own names are of pictures in its order.
            "bgr8" | "8UC3" => (3, [2, 1, 0]),
            "rgba8" => (4, [0, 1, 2]),
            "bgra8" | "8UC4" => (4, [2, 1, 0]),
            "mono8" | "8UC1" => (1, [0, 0, 0]),
            other => {
                return Err(format!(
                    "pixels of `{other}` are no colours that are read: rgb8, bgr8 or mono8 are"
                ));
            }
        };
        let pixels = self.rows(bytes)?.flat_map(|row| row.chunks_exact(bytes));
        let pixels = pixels.map(|pixel| order.map(|c| pixel[c])).collect();
        Image::new(self.size[0], self.size[1], pixels).map_err(|error| error.to_string())
    }

    /// As depth in units of so many metres. Of numbers that are metres, those that are none become `invalid`.
    ///
    /// # Errors
    /// Another kind of pixels, too few bytes, as a sentence.
    pub(super) fn depth(&self, scale: f64, invalid: u16) -> Result<Depth, String> {
        if self.packed {
            // The transport `compressedDepth` puts 12 bytes of its parameters before the file.
            const PNG: &[u8] = b"\x89PNG";
            let inner =
                self.data.get(12..).filter(|inner| inner.starts_with(PNG) && !self.data.starts_with(PNG));
            let file = inner.unwrap_or(&self.data);
            return folder::depth_of(file, Path::new("picture")).map_err(|error| error.to_string());
        }
        let units = |pixel: &[u8]| match (self.encoding.as_str(), pixel) {
            ("32FC1", [a, b, c, d]) => {
                let bytes = [*a, *b, *c, *d];
                let metres =
                    if self.big_endian { f32::from_be_bytes(bytes) } else { f32::from_le_bytes(bytes) };
                let units = f64::from(metres) / scale + 0.5;
                if (1.0..65_535.0).contains(&units) { units as u16 } else { invalid }
            }
            (_, [a, b]) if self.big_endian => u16::from_be_bytes([*a, *b]),
            (_, [a, b]) => u16::from_le_bytes([*a, *b]),
            _ => invalid,
        };
        let bytes = match self.encoding.as_str() {
            "16UC1" | "mono16" => 2,
            "32FC1" => 4,
            other => {
                return Err(format!(
                    "pixels of `{other}` are no depth that is read: 16UC1, mono16 or 32FC1 are"
                ));
            }
        };
        let pixels = self.rows(bytes)?.flat_map(|row| row.chunks_exact(bytes)).map(units).collect();
        Image::new(self.size[0], self.size[1], pixels).map_err(|error| error.to_string())
    }
}

/// The plain CDR encoding (OMG, DDS-XTypes, 7.4.1).
struct Cdr<'a> {
    body: &'a [u8],
    at: usize,
    little: bool,
}

impl<'a> Cdr<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let taken =
            self.at.checked_add(count).and_then(|end| self.body.get(self.at..end)).ok_or(ENDS_EARLY)?;
        self.at += count;
        Ok(taken)
    }

    fn byte(&mut self) -> Result<u8, String> {
        Ok(self.take(1)?[0])
    }

    fn word(&mut self) -> Result<u32, String> {
        self.at = self.at.next_multiple_of(4);
        let bytes = self.take(4)?.try_into().map_err(|_| ENDS_EARLY)?;
        Ok(if self.little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    }

    fn bytes(&mut self) -> Result<&'a [u8], String> {
        let count = self.word()? as usize;
        self.take(count)
    }

    /// With its end, a zero.
    fn text(&mut self) -> Result<String, String> {
        let bytes = self.bytes()?;
        Ok(String::from_utf8_lossy(bytes.strip_suffix(&[0]).unwrap_or(bytes)).into_owned())
    }
}

/// The fields of a protocol buffer in their order.
struct Fields<'a>(&'a [u8]);

enum Value<'a> {
    Number(u64),
    Bytes(&'a [u8]),
}

impl<'a> Fields<'a> {
    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let (byte, rest) = self.0.split_first()?;
            self.0 = rest;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn field(&mut self) -> Option<(u64, Value<'a>)> {
        let key = self.varint()?;
        let number = |bytes: &[u8]| bytes.iter().rev().fold(0, |sum, byte| sum << 8 | u64::from(*byte));
        let value = match key & 7 {
            0 => Value::Number(self.varint()?),
            1 => Value::Number(number(self.take(8)?)),
            2 => {
                let count = usize::try_from(self.varint()?).ok()?;
                Value::Bytes(self.take(count)?)
            }
            5 => Value::Number(number(self.take(4)?)),
            _ => return None,
        };
        Some((key >> 3, value))
    }
}

impl<'a> Iterator for Fields<'a> {
    type Item = Result<(u64, Value<'a>), String>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.0.is_empty() {
            return None;
        }
        let field = self.field().ok_or_else(|| ENDS_EARLY.to_owned());
        if field.is_err() {
            self.0 = &[];
        }
        Some(field)
    }
}
