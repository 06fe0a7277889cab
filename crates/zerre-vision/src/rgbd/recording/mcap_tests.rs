//! MCAP files that are written here, message by message, as the definitions of their schemas say.

use super::*;
use crate::frames::folder::{depth_png, png};
use ::mcap::records::MessageHeader;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::BufWriter;
use zerre::Time;

/// A protocol buffer: field numbers with numbers, fixed numbers or bytes.
#[derive(Default)]
struct Buffer(Vec<u8>);

impl Buffer {
    fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    fn number(mut self, field: u64, value: u64) -> Buffer {
        self.varint(field << 3);
        self.varint(value);
        self
    }

    fn fixed(mut self, field: u64, value: u32) -> Buffer {
        self.varint(field << 3 | 5);
        self.0.extend(value.to_le_bytes());
        self
    }

    fn bytes(mut self, field: u64, bytes: &[u8]) -> Buffer {
        self.varint(field << 3 | 2);
        self.varint(bytes.len() as u64);
        self.0.extend(bytes);
        self
    }
}

fn stamp(ms: u64) -> Vec<u8> {
    Buffer::default().number(1, ms / 1000).number(2, ms % 1000 * 1_000_000).0
}

fn foxglove_raw(ms: u64, [width, height, step]: [u32; 3], encoding: &str, data: &[u8]) -> Vec<u8> {
    let head = Buffer::default().bytes(1, &stamp(ms)).bytes(7, b"camera").fixed(2, width).fixed(3, height);
    head.bytes(4, encoding.as_bytes()).fixed(5, step).bytes(6, data).0
}

fn foxglove_packed(ms: u64, data: &[u8]) -> Vec<u8> {
    Buffer::default().bytes(1, &stamp(ms)).bytes(2, data).bytes(3, b"png").bytes(4, b"camera").0
}

/// CDR in little order: words stand at multiples of four.
#[derive(Default)]
struct Cdr(Vec<u8>);

impl Cdr {
    fn word(mut self, value: u32) -> Cdr {
        self.0.resize(self.0.len().next_multiple_of(4), 0);
        self.0.extend(value.to_le_bytes());
        self
    }

    fn bytes(self, bytes: &[u8]) -> Cdr {
        let mut own = self.word(bytes.len() as u32);
        own.0.extend(bytes);
        own
    }

    fn text(self, text: &str) -> Cdr {
        self.bytes(format!("{text}\0").as_bytes())
    }

    fn whole(self) -> Vec<u8> {
        [&[0, 1, 0, 0], self.0.as_slice()].concat()
    }
}

fn ros_head(ms: u64) -> Cdr {
    Cdr::default().word((ms / 1000) as u32).word((ms % 1000 * 1_000_000) as u32).text("camera_link")
}

fn ros(ms: u64, [width, height, step]: [u32; 3], encoding: &str, data: &[u8]) -> Vec<u8> {
    let mut cdr = ros_head(ms).word(height).word(width).text(encoding);
    cdr.0.push(0);
    cdr.word(step).bytes(data).whole()
}

/// Topic, schema, encoding, time of the log in ms, message.
type Written<'a> = (&'a str, &'a str, &'a str, u64, Vec<u8>);

fn open(name: &str, messages: &[Written<'_>], cut: usize) -> Result<Recording> {
    let path = std::env::temp_dir().join(format!("zerre-mcap-{}-{name}.mcap", std::process::id()));
    let mut writer = ::mcap::Writer::new(BufWriter::new(File::create(&path).unwrap())).unwrap();
    for (k, (topic, schema, encoding, ms, data)) in messages.iter().enumerate() {
        let schema = writer.add_schema(schema, "", b"-").unwrap();
        let channel_id = writer.add_channel(schema, topic, encoding, &BTreeMap::new()).unwrap();
        let time = ms * 1_000_000;
        let header = MessageHeader { channel_id, sequence: k as u32, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, data).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() - cut]).unwrap();
    let recording = Recording::open(&path, &RecordingOptions::default());
    fs::remove_file(&path).unwrap();
    recording
}

const RAW: &str = "foxglove.RawImage";
const PACKED: &str = "foxglove.CompressedImage";
const ROS: &str = "sensor_msgs/msg/Image";
const ROS_PACKED: &str = "sensor_msgs/msg/CompressedImage";

fn first(messages: &[Written<'_>], name: &str) -> RgbdFrame {
    open(name, messages, 0).unwrap().next().unwrap().unwrap()
}

/// Each kind of message, in each direction: 2 x 2 pixels with rows of more bytes than they need.
#[test]
fn every_kind_of_message_is_read() {
    let colours = [1, 2, 3, 4, 5, 6, 99, 99, 7, 8, 9, 10, 11, 12, 99, 99];
    let depths = [0xe8, 3, 0, 0, 0xd0, 7, 1, 0];
    let wanted = Image::new(2, 2, vec![[1, 2, 3], [4, 5, 6], [7, 8, 9], [10, 11, 12]]).unwrap();
    let wanted_depth = Image::new(2, 2, vec![1000, NO_DEPTH, 2000, 1]).unwrap();
    let flipped = wanted.map(|[r, g, b]| [*b, *g, *r]);
    let metres: Vec<u8> = [1.0_f32, f32::NAN, 2.0, 0.001].iter().flat_map(|v| v.to_le_bytes()).collect();
    let colour_file = png(&wanted).unwrap();
    let depth_file = depth_png(&wanted_depth).unwrap();
    let transported = [&[0; 12], depth_file.as_slice()].concat();
    let (pb, cdr) = ("protobuf", "cdr");
    let cases: [(Written<'_>, Written<'_>, &Frame); 4] = [
        (
            ("/color", RAW, pb, 1, foxglove_raw(5000, [2, 2, 8], "rgb8", &colours)),
            ("/depth", RAW, pb, 2, foxglove_raw(5003, [2, 2, 4], "16UC1", &depths)),
            &wanted,
        ),
        (
            ("/color", PACKED, pb, 1, foxglove_packed(5000, &colour_file)),
            ("/depth", PACKED, pb, 2, foxglove_packed(5003, &depth_file)),
            &wanted,
        ),
        (
            ("/cam/color", ROS, cdr, 1, ros(5000, [2, 2, 8], "bgr8", &colours)),
            ("/cam/depth", ROS, cdr, 2, ros(5003, [2, 2, 8], "32FC1", &metres)),
            &flipped,
        ),
        (
            ("/color", ROS_PACKED, cdr, 1, ros_head(5000).text("png").bytes(&colour_file).whole()),
            (
                "/depth",
                ROS_PACKED,
                cdr,
                2,
                ros_head(5003).text("compressedDepth").bytes(&transported).whole(),
            ),
            &wanted,
        ),
    ];
    for (k, (colour, depth, wanted)) in cases.into_iter().enumerate() {
        let name = format!("kind-{k}");
        let frame = first(&[colour, depth], &name);
        assert_eq!((&frame.colour, &frame.depth), (wanted, &wanted_depth), "{name}");
        assert_eq!(frame.time, Time::from_nanos(5_000_000_000));
    }
}

/// Pictures of about one time belong together, whichever comes first; the rest is counted, and so is what is
/// damaged.
#[test]
fn pictures_are_paired_by_their_stamps() {
    let colour = |ms: u64| ("/rgb", RAW, "protobuf", ms, foxglove_raw(ms, [1, 1, 3], "rgb8", &[ms as u8; 3]));
    let depth = |ms: u64| {
        let bytes = (ms as u16).to_le_bytes();
        ("/depth", RAW, "protobuf", ms + 5, foxglove_raw(ms, [1, 1, 2], "mono16", &bytes))
    };
    let other = ("/imu", "sensor_msgs/msg/Imu", "cdr", 1, vec![1, 2, 3]);
    let damaged = ("/rgb", RAW, "protobuf", 210, foxglove_raw(210, [5, 5, 15], "rgb8", &[1; 3]));
    let messages = [
        other,
        depth(40),
        colour(100),
        depth(102),
        depth(130),
        colour(133),
        colour(150),
        depth(163),
        colour(166),
        damaged,
        colour(300),
    ];
    let mut recording = open("pairs", &messages, 0).unwrap();
    let read: Vec<_> = recording
        .by_ref()
        .map(|frame| frame.ok().map(|frame| (frame.index, frame.colour.at(0, 0)[0], frame.depth.at(0, 0))))
        .collect();
    let wanted = [
        Some((0, 100, 102)),
        Some((1, 133, 130)),
        Some((2, 150, 0)),
        Some((3, 166, 163)),
        None,
        Some((5, 44, 0)),
    ];
    assert_eq!(read, wanted);
    let outcomes =
        Outcomes { read: 5, without_depth: 2, unreadable: 1, depth_alone: 1, ..Outcomes::default() };
    assert_eq!(recording.outcomes(), outcomes);
}

#[test]
fn damaged_files_and_other_topics_are_told() {
    let imu = ("/imu", "sensor_msgs/msg/Imu", "cdr", 1, vec![1, 2, 3]);
    let told = open("imu", &[imu], 0).unwrap_err().to_string();
    assert!(told.contains("/imu (sensor_msgs/msg/Imu)") && told.contains("foxglove.RawImage"), "{told}");
    let colour = ("/rgb", RAW, "protobuf", 1, foxglove_raw(1, [1, 1, 3], "rgb8", &[9; 3]));
    // Cut behind the data: its end is told, and what stood before is read.
    let mut recording = open("cut", &[colour], 30).unwrap();
    let results: Vec<bool> = recording.by_ref().map(|frame| frame.is_ok()).collect();
    assert_eq!(results.iter().filter(|good| **good).count(), 1, "{results:?}");
    assert!(results.contains(&false) && recording.outcomes().unreadable > 0);
}

/// Any bytes are a picture or a refusal.
#[test]
fn no_bytes_are_too_strange() {
    let good = [
        (message::Kind::Foxglove, foxglove_raw(1, [1, 1, 3], "rgb8", &[9; 3])),
        (message::Kind::FoxgloveCompressed, foxglove_packed(1, &[1, 2])),
        (message::Kind::Ros, ros(1, [1, 1, 3], "rgb8", &[9; 3])),
        (message::Kind::RosCompressed, ros_head(1).text("png").bytes(&[1, 2]).whole()),
    ];
    for (kind, bytes) in good {
        for cut in 0..bytes.len() {
            if let Ok(message) = message::Message::parse(kind, &bytes[..cut]) {
                assert!(
                    message.frame().is_err() && message.depth(0.001, 0).is_err(),
                    "{kind:?} cut at {cut}"
                );
            }
        }
        for at in 0..bytes.len() {
            for value in [0, 0x7f, 0x80, 0xff] {
                let mut bytes = bytes.clone();
                bytes[at] = value;
                if let Ok(message) = message::Message::parse(kind, &bytes) {
                    let _ = (message.frame(), message.depth(0.001, 0));
                }
            }
        }
    }
}
