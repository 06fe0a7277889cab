//! Recordings of other kinds, and what is wrong with recordings.

use super::{beginning, document, drawn, folder, fuse, record, text, words, zerre};
use std::fs;
use std::path::{Path, PathBuf};
use zerre_vision::Image;
use zerre_vision::frames::folder::depth_png;

fn pictures(made: &Path, kind: &str) -> Vec<PathBuf> {
    let mut files: Vec<_> =
        fs::read_dir(made.join(kind)).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

/// Pictures of other sizes need a camera file; with it they are registered, and so is nothing at all.
#[test]
fn what_is_wrong_with_a_recording_is_said() {
    let (made, out) = (beginning("sizes", 3), folder("sizes-out"));
    let refused = |made: &Path, more: &[&str], words_of: &str| {
        let run = fuse(made, &out.join("run"), more);
        assert!(!run.status.success() && words(&run).contains(words_of), "{more:?}: {}", words(&run));
        assert!(!out.join("run/points.csv").exists());
    };
    let small = depth_png(&Image::filled(320, 240, 900_u16)).unwrap();
    pictures(&made, "depth").iter().for_each(|file| fs::write(file, &small).unwrap());
    fs::rename(made.join("camera.json"), made.join("away.json")).unwrap();
    refused(&made, &[], "depth pictures have 320 x 240 pixels and those of colours 640 x 480: a camera file");
    refused(&made, &["--camera", text(&made.join("truth.csv"))], "a camera file has");
    refused(&made, &["--camera", text(&made.join("none.json"))], "none.json: it cannot be read");
    for kind in ["rgb", "depth"] {
        let empty = beginning(&format!("empty-{kind}"), 2);
        pictures(&empty, kind).iter().for_each(|file| fs::remove_file(file).unwrap());
        refused(&empty, &[], "there is no picture");
        fs::remove_dir(empty.join(kind)).unwrap();
        refused(&empty, &[], &format!("no folder `{kind}`"));
    }
    let bare = folder("bare");
    refused(&bare, &["--start", "1,1"], "it is no recording of colour and depth");
    let unread = beginning("unread", 2);
    pictures(&unread, "rgb").iter().for_each(|file| fs::write(file, "no picture").unwrap());
    refused(&unread, &["--room", "median"], "the median of no frames");
    refused(&unread, &["--room", "running"], "no frame can be read");
}

/// Without any depth colours are followed alone, and it is said.
#[test]
fn depth_may_be_invalid_everywhere() {
    let (made, out) = (beginning("invalid", 12), folder("invalid-out"));
    let none = depth_png(&Image::filled(640, 480, 0_u16)).unwrap();
    pictures(&made, "depth").iter().for_each(|file| fs::write(file, &none).unwrap());
    fs::write(made.join("background_depth.png"), &none).unwrap();
    let truth = made.join("truth.csv");
    for room in ["pictures", "median", "running"] {
        let run = fuse(&made, &out.join(room), &["--room", room, "--truth", text(&truth)]);
        let found = document(&run);
        assert!(words(&run).contains("colours alone are used"), "{}", words(&run));
        assert_eq!((found["frames"].as_u64(), found["left_out"].as_u64()), (Some(12), Some(0)));
        assert!(found["rmse_px"].as_f64().unwrap() < 30.0, "{room}: {found}");
        let points = fs::read_to_string(out.join(room).join("points.csv")).unwrap();
        let (head, first) = (points.lines().next().unwrap(), points.lines().nth(3).unwrap());
        assert!(head.ends_with("trust_device,trust_color") && first.contains(",,,"), "{head}\n{first}");
    }
}

/// Ctrl-C in the middle: what is complete is there, whole.
#[cfg(unix)]
#[test]
fn an_interrupted_run_keeps_what_it_has() {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};
    let out = folder("interrupted").join("run");
    let mut child = Command::new(env!("CARGO_BIN_EXE_zerre"))
        // So many particles that 111 frames take far longer than a signal.
        .args([
            "fuse",
            text(drawn()),
            "--particles",
            "200000",
            "--json",
            // The point begins in the first frame; the second has steps.
            "--steps",
            "2",
            "--preset",
            "thesis",
        ])
        .args(["--out", text(&out)])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let since = Instant::now();
    // The pictures of the steps are there when their frame is done.
    while !out.join("run.json").exists() {
        assert!(since.elapsed() < Duration::from_secs(120), "nothing is written");
        std::thread::sleep(Duration::from_millis(10));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    child.wait().unwrap();
    let ended = child.wait_with_output().unwrap();
    assert_eq!(ended.status.code(), Some(1), "{}", words(&ended));
    let record = record(&out);
    let read = record["counts"]["read"].as_u64().unwrap() as usize;
    assert!(record["state"] == "interrupted" && (1..111).contains(&read), "{record}");
    let points = fs::read_to_string(out.join("points.csv")).unwrap();
    let columns = |line: &str| line.split(',').count();
    let all = columns(points.lines().next().unwrap());
    assert!(
        points.lines().count() <= read + 1 && points.lines().all(|line| columns(line) == all),
        "{points}"
    );
    assert!(fs::read_to_string(out.join("report.html")).unwrap().ends_with("</html>\n"));
    for entry in fs::read_dir(&out).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(!name.contains("partial"), "{name}");
    }
}

/// A video has colours alone: every frame of it is followed, at the rate of its header.
#[test]
fn videos_are_followed_by_their_colours() {
    if !super::live::has_ffmpeg() {
        return;
    }
    let (made, out) = (beginning("film", 12), folder("film-out"));
    let film = out.join("clip.mp4");
    let status = std::process::Command::new("ffmpeg")
        .args(["-v", "error", "-framerate", "30", "-i", text(&made.join("rgb/%04d.png"))])
        .args(["-c:v", "mpeg4", "-q:v", "2", text(&film)])
        .status();
    assert!(status.unwrap().success());
    let (joints, truth) = (made.join("joints.csv"), made.join("truth.csv"));
    let marks = fs::read_to_string(&truth).unwrap();
    // A video's frames have no names of files: their places are told.
    let place = |(k, line): (usize, &str)| format!("{k},{}", line.split_once(',').unwrap().1);
    let numbered: Vec<String> = marks.lines().skip(1).enumerate().map(place).collect();
    fs::write(&truth, format!("{}\n{}\n", marks.lines().next().unwrap(), numbered.join("\n"))).unwrap();
    let run = fuse(&film, &out.join("run"), &["--joints", text(&joints), "--truth", text(&truth)]);
    let found = document(&run);
    assert_eq!((&found["frames"], &found["latency"]["clock"]), (&12.into(), &"processor".into()), "{found}");
    assert!(found["rmse_px"].as_f64().unwrap() < 30.0 && words(&run).contains("colours alone"), "{found}");
    let points = fs::read_to_string(out.join("run/points.csv")).unwrap();
    assert!(points.lines().nth(4).unwrap().starts_with("3,frame 4,0.1,"), "{points}");
}

#[cfg(not(feature = "mcap"))]
#[test]
fn what_was_left_out_of_the_program_is_said() {
    let out = folder("no-mcap");
    fs::write(out.join("bag.mcap"), "").unwrap();
    let run = zerre(&["fuse", text(&out.join("bag.mcap")), "--start", "1,1"]);
    assert!(words(&run).contains("cargo build --features mcap"), "{}", words(&run));
}

/// A bag with the drawn pictures: the same points as from their folder.
#[cfg(feature = "mcap")]
#[test]
fn bags_are_followed_like_folders() {
    use zerre_vision::frames::folder::{depth, frame};
    let (made, out) = (beginning("bag", 10), folder("bag-out"));
    let mut bag = bag::Bag::new();
    for (k, (colour, deep)) in pictures(&made, "rgb").iter().zip(pictures(&made, "depth")).enumerate() {
        let (colour, deep) = (frame(colour).unwrap(), depth(&deep).unwrap());
        let nanos = zerre::Time::from_secs(k as f64 / 30.0).nanos() as u64;
        let units: Vec<u8> = deep.pixels().iter().flat_map(|z| z.to_le_bytes()).collect();
        bag.picture(1, nanos, colour.size(), ("rgb8", 3), colour.pixels().as_flattened());
        bag.picture(2, nanos, deep.size(), ("16UC1", 2), &units);
    }
    let file = made.join("recorded.mcap");
    fs::write(&file, bag.whole()).unwrap();
    let joints = made.join("joints.csv");
    let run = |input: &Path, name: &str| {
        document(&fuse(input, &out.join(name), &["--joints", text(&joints), "--room", "median"]))
    };
    let (folder, bag) = (run(&made, "folder"), run(&file, "bag"));
    assert_eq!(bag["frames"], 10);
    assert_eq!(bag["estimates_digest"], folder["estimates_digest"], "{bag} {folder}");
    assert_eq!(record(&out.join("bag"))["input"][0]["path"], text(&file));
    // One that ends early is followed as far as it goes.
    let bytes = fs::read(&file).unwrap();
    fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
    let cut = fuse(&file, &out.join("cut"), &["--joints", text(&joints)]);
    let found = document(&cut);
    assert!((3..=7).contains(&found["frames"].as_u64().unwrap()) && found["left_out"] == 1, "{found}");
    assert!(words(&cut).contains("it is damaged"), "{}", words(&cut));
    fs::write(&file, "no bag").unwrap();
    let none = zerre(&["fuse", text(&file), "--start", "1,1"]);
    assert!(!none.status.success() && words(&none).contains("recorded.mcap"), "{}", words(&none));
}

/// MCAP as its specification has it (version 0, neither chunks nor index), with `foxglove.RawImage` in
/// protocol buffers.
#[cfg(feature = "mcap")]
mod bag {
    pub struct Bag(Vec<u8>);

    const MAGIC: &[u8] = b"\x89MCAP0\r\n";

    fn string(text: &str) -> Vec<u8> {
        [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
    }

    impl Bag {
        /// Channel 1 has colours, channel 2 depth.
        pub fn new() -> Bag {
            let mut bag = Bag(MAGIC.to_vec());
            bag.record(1, &[string(""), string("test")].concat());
            let name = [string("foxglove.RawImage"), string("protobuf"), string("-")].concat();
            bag.record(3, &[&1_u16.to_le_bytes()[..], &name].concat());
            for (id, topic) in [(1_u16, "/camera/color"), (2, "/camera/depth")] {
                let rest = [string(topic), string("protobuf"), vec![0; 4]].concat();
                bag.record(4, &[&id.to_le_bytes()[..], &1_u16.to_le_bytes(), &rest].concat());
            }
            bag
        }

        fn record(&mut self, kind: u8, content: &[u8]) {
            self.0.push(kind);
            self.0.extend((content.len() as u64).to_le_bytes());
            self.0.extend(content);
        }

        pub fn picture(
            &mut self,
            channel: u16,
            nanos: u64,
            (width, height): (usize, usize),
            (encoding, size): (&str, usize),
            pixels: &[u8],
        ) {
            let mut stamp = Vec::new();
            for (field, value) in [(1, nanos / 1_000_000_000), (2, nanos % 1_000_000_000)] {
                varint(&mut stamp, field << 3);
                varint(&mut stamp, value);
            }
            let mut message = Vec::new();
            for (field, bytes) in [(1, &stamp[..]), (4, encoding.as_bytes()), (6, pixels)] {
                varint(&mut message, field << 3 | 2);
                varint(&mut message, bytes.len() as u64);
                message.extend(bytes);
            }
            for (field, value) in [(2, width), (3, height), (5, width * size)] {
                varint(&mut message, field << 3 | 5);
                message.extend((value as u32).to_le_bytes());
            }
            let head =
                [&channel.to_le_bytes()[..], &[0; 4], &nanos.to_le_bytes(), &nanos.to_le_bytes()].concat();
            self.record(5, &[head, message].concat());
        }

        pub fn whole(mut self) -> Vec<u8> {
            self.record(15, &[0; 4]);
            self.record(2, &[0; 20]);
            [self.0, MAGIC.to_vec()].concat()
        }
    }

    fn varint(into: &mut Vec<u8>, mut value: u64) {
        while value >= 0x80 {
            into.push(value as u8 | 0x80);
            value >>= 7;
        }
        into.push(value as u8);
    }
}
