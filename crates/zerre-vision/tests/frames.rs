//! Frames and annotations from files.

use image::{DynamicImage, ImageBuffer, ImageFormat, Luma, LumaA, Rgb, Rgba};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use zerre_vision::frames::{Frames, folder};
use zerre_vision::sequence::{Sequence, read_boxes};
use zerre_vision::{Frame, Rect};

/// An empty folder of the test's own.
fn empty(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("vision-{name}"));
    let _ = fs::remove_dir_all(&path);
    fs::create_dir_all(&path).unwrap();
    path
}

/// A grey picture of 8 x 6 pixels whose brightness is `level`.
fn grey(path: &Path, level: u8) {
    DynamicImage::ImageLuma8(ImageBuffer::from_pixel(8, 6, Luma([level]))).save(path).unwrap();
}

fn opened(path: &Path) -> Frames {
    Frames::open(path.to_str().unwrap()).unwrap()
}

fn refused(path: &Path) -> String {
    Frames::open(path.to_str().unwrap()).unwrap_err().to_string()
}

fn first(frame: &Frame) -> [u8; 3] {
    frame.at(0, 0)
}

#[test]
fn pictures_come_in_the_order_of_their_numbers() {
    let at = empty("order");
    for (name, level) in [("frame_9.png", 9), ("frame_10.PNG", 10), ("frame_11.jpeg", 11)] {
        grey(&at.join(name), level);
    }
    fs::write(at.join("notes.txt"), "no picture").unwrap();
    fs::write(at.join("._frame_9.png"), "no picture").unwrap();
    let mut frames = opened(&at);
    assert_eq!((frames.expected(), frames.ignored()), (Some(3), 2));
    let levels: Vec<u8> = frames.by_ref().map(|shot| first(&shot.frame.unwrap())[0]).collect();
    assert_eq!(levels, [9, 10, 11]);
    assert_eq!(frames.complaint(), None);
}

#[test]
fn every_kind_of_pixel_becomes_rgb_of_8_bits() {
    let at = empty("kinds");
    let save = |name: &str, picture: DynamicImage| picture.save(at.join(name)).unwrap();
    save("1.png", DynamicImage::ImageLuma8(ImageBuffer::from_pixel(4, 4, Luma([7]))));
    save("2.png", DynamicImage::ImageLuma16(ImageBuffer::from_pixel(4, 4, Luma([0x80ff]))));
    save("3.png", DynamicImage::ImageLumaA8(ImageBuffer::from_pixel(4, 4, LumaA([7, 0]))));
    save("4.png", DynamicImage::ImageRgba8(ImageBuffer::from_pixel(4, 4, Rgba([1, 2, 3, 0]))));
    save("5.png", DynamicImage::ImageRgb16(ImageBuffer::from_pixel(4, 4, Rgb([257, 514, u16::MAX]))));
    // A JPEG file with another ending is known by its content.
    let jpeg = DynamicImage::ImageRgb8(ImageBuffer::from_pixel(4, 4, Rgb([90, 90, 90])));
    jpeg.save_with_format(at.join("6.png"), ImageFormat::Jpeg).unwrap();
    let pixels: Vec<[u8; 3]> = opened(&at).map(|shot| first(&shot.frame.unwrap())).collect();
    // 0x80ff / 257 = 128.5 less a two-hundredth: rounded, not cut.
    assert_eq!(pixels, [[7; 3], [128; 3], [7; 3], [1, 2, 3], [1, 2, 255], [90; 3]]);
}

#[test]
fn depth_keeps_its_16_bits() {
    let at = empty("depth");
    let deep = at.join("deep.png");
    DynamicImage::ImageLuma16(ImageBuffer::from_fn(3, 2, |x, y| Luma([(1000 * y + x) as u16])))
        .save(&deep)
        .unwrap();
    let depth = folder::depth(&deep).unwrap();
    assert_eq!((depth.size(), depth.pixels()), ((3, 2), &[0, 1, 2, 1000, 1001, 1002][..]));
    grey(&at.join("flat.png"), 1);
    let error = folder::depth(&at.join("flat.png")).unwrap_err().to_string();
    assert!(error.contains("1 channels of 8 bits") && error.contains("flat.png"), "{error}");
}

#[test]
fn a_bad_frame_is_told_and_the_next_one_is_read() {
    let at = empty("bad");
    let noise = |seed: u32| {
        let pixel = move |x: u32, y: u32| {
            Rgb([0, 1, 2].map(|c| ((x * 37 + y * 91 + c * 53 + seed).wrapping_mul(2_654_435) >> 8) as u8))
        };
        DynamicImage::ImageRgb8(ImageBuffer::from_fn(48, 32, pixel))
    };
    for (seed, name) in ["1.jpg", "2.jpg", "3.png", "4.png", "6.png", "7.jpg"].iter().enumerate() {
        noise(seed as u32).save(at.join(name)).unwrap();
    }
    for name in ["2.jpg", "3.png"] {
        let bytes = fs::read(at.join(name)).unwrap();
        fs::write(at.join(name), &bytes[..bytes.len() * 2 / 3]).unwrap();
    }
    grey(&at.join("4.png"), 1);
    fs::write(at.join("6.png"), "no picture").unwrap();
    let shots: Vec<_> = opened(&at).collect();
    let told: Vec<_> =
        shots.iter().map(|shot| (shot.index, shot.name.as_str(), shot.frame.is_ok())).collect();
    assert_eq!(
        told,
        [
            (0, "1.jpg", true),
            (1, "2.jpg", false),
            (2, "3.png", false),
            (3, "4.png", false),
            (4, "number 5", false),
            (5, "6.png", false),
            (6, "7.jpg", true),
        ]
    );
    for (at, says) in
        [(1, "2.jpg: the picture ends early"), (2, "3.png"), (3, "8 x 6 pixels"), (4, "number 5")]
    {
        let error = shots[at].frame.as_ref().unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
}

#[test]
fn a_folder_without_a_picture_says_what_is_read() {
    let at = empty("none");
    assert!(refused(&at).contains("there is no picture: jpg, jpeg, png are read"), "{}", refused(&at));
    fs::write(at.join("a.tif"), "").unwrap();
    assert!(refused(&at).contains("among its 1 files"), "{}", refused(&at));
    assert!(refused(&at.join("nowhere")).contains("there is no such file or folder"));
}

/// Whether videos can be tested here; continuous integration must be able to.
fn has_ffmpeg() -> bool {
    match zerre_vision::frames::ffmpeg::installed("test") {
        Ok(()) => true,
        Err(error) => {
            assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "{error}");
            eprintln!("SKIPPED: {error}");
            false
        }
    }
}

/// A video of ten frames of brightness 0, 20, 40, ..., without losses.
fn video(at: &Path, name: &str, kind: &[&str]) -> PathBuf {
    for i in 0..10 {
        let path = at.join(format!("{i}.png"));
        DynamicImage::ImageLuma8(ImageBuffer::from_fn(64, 48, |x, y| {
            Luma([20 * i as u8 + ((x * 7 + y * 13) % 16) as u8])
        }))
        .save(&path)
        .unwrap();
    }
    let made = at.join(name);
    let mut ffmpeg = Command::new("ffmpeg");
    ffmpeg.args(["-v", "error", "-y", "-framerate", "10", "-i"]).arg(at.join("%d.png")).args(kind).arg(&made);
    assert!(ffmpeg.status().unwrap().success());
    made
}

#[test]
fn videos_are_read_frame_by_frame() {
    if !has_ffmpeg() {
        return;
    }
    let at = empty("video");
    // A name with a colon is no protocol.
    let made = video(&at, "a:b.avi", &["-c:v", "ffv1", "-pix_fmt", "gray"]);
    let mut frames = opened(&made);
    let shots: Vec<_> = frames.by_ref().collect();
    let levels: Vec<u8> = shots.iter().map(|shot| first(shot.frame.as_ref().unwrap())[0]).collect();
    assert_eq!(levels, (0..10).map(|i| 20 * i).collect::<Vec<u8>>());
    assert_eq!(shots[9].name, "frame 10");
    assert_eq!(frames.complaint(), None);
    let frame = shots[0].frame.as_ref().unwrap();
    assert_eq!((frame.size(), frame.at(1, 0), frame.at(0, 1)), ((64, 48), [7; 3], [13; 3]));
}

#[test]
fn a_video_that_ends_early_gives_what_it_has() {
    if !has_ffmpeg() {
        return;
    }
    let at = empty("early");
    let made = video(&at, "whole.mp4", &["-c:v", "mpeg4", "-q:v", "2", "-movflags", "+faststart"]);
    let mut frames = opened(&made);
    assert_eq!((frames.expected(), frames.by_ref().count(), frames.complaint()), (Some(10), 10, None));
    let bytes = fs::read(&made).unwrap();
    let cut = at.join("cut.mp4");
    fs::write(&cut, &bytes[..bytes.len() * 3 / 4]).unwrap();
    let mut frames = opened(&cut);
    let read = frames.by_ref().filter(|shot| shot.frame.is_ok()).count();
    assert!((1..10).contains(&read), "{read}");
    let complaint = frames.complaint().unwrap();
    assert!(complaint.contains(&format!("after {read} of the 10 frames")), "{complaint}");
    fs::write(&cut, &bytes[..40]).unwrap();
    assert!(refused(&cut).contains("there is no video in it: ffmpeg reports"), "{}", refused(&cut));
}

fn truth(at: &Path, name: &str, text: &str) {
    fs::write(at.join(name), text).unwrap();
}

fn pictures(at: &Path, numbers: impl Iterator<Item = u32>) {
    fs::create_dir_all(at).unwrap();
    for number in numbers {
        grey(&at.join(format!("{number:04}.png")), number as u8);
    }
}

#[test]
fn otb_boxes_begin_with_one_and_targets_with_their_number() {
    let at = empty("Pair");
    pictures(&at.join("img"), 1..=3);
    truth(&at, "groundtruth_rect.1.txt", "1,1,2,2\r\n2,1,2,2\r\n3,1,2,2\r\n\r\n");
    truth(&at, "groundtruth_rect.2.txt", "5\t5\t2\t2\nNaN\tNaN\tNaN\tNaN\n7 5 2 2\n");
    let found = Sequence::open(&at).unwrap();
    assert_eq!(found.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["vision-Pair.1", "vision-Pair.2"]);
    let rect = |x: f64, y: f64| Some(Rect { x, y, width: 2.0, height: 2.0 });
    assert_eq!(found[0].truth, [rect(0.0, 0.0), rect(1.0, 0.0), rect(2.0, 0.0)]);
    assert_eq!(found[1].truth, [rect(4.0, 4.0), None, rect(6.0, 4.0)]);
    assert!(found.iter().all(|s| s.notes.is_empty() && s.pictures.places().len() == 3));
}

#[test]
fn an_annotation_may_start_late_or_be_short() {
    let at = empty("late").join("BlurCar3");
    pictures(&at.join("img"), 1..=5);
    truth(&at, "groundtruth_rect.txt", "1,1,2,2\n1,1,2,2\n1,1,2,2\n");
    let levels = |sequence: &Sequence| -> Vec<u8> {
        Frames::of_pictures(sequence.pictures.clone()).map(|shot| first(&shot.frame.unwrap())[0]).collect()
    };
    let late = &Sequence::open(&at).unwrap()[0];
    assert_eq!((levels(late), late.truth.len()), (vec![3, 4, 5], 3));
    assert!(late.notes[0].contains("begins with picture 3"), "{:?}", late.notes);
    let short = at.with_file_name("Short");
    fs::rename(&at, &short).unwrap();
    let short = &Sequence::open(&short).unwrap()[0];
    assert_eq!((levels(short), short.truth.len()), (vec![1, 2, 3, 4, 5], 3));
    assert!(short.notes[0].contains("3 rows for 5 pictures"), "{:?}", short.notes);
}

#[test]
fn rows_keep_to_their_pictures_across_gaps() {
    let at = empty("gaps");
    pictures(&at, [1, 2, 4].into_iter());
    truth(&at, "groundtruth.txt", "1,1,2,2\n2,1,2,2\n3,1,2,2\n4,1,2,2\n");
    let x = |at: &Path| -> Vec<(usize, f64)> {
        let sequence = &Sequence::open(at).unwrap()[0];
        let frames = Frames::of_pictures(sequence.pictures.clone()).zip(&sequence.truth);
        frames.filter_map(|(s, t)| Some((usize::from(first(&s.frame.ok()?)[0]), (*t)?.x))).collect()
    };
    assert_eq!(x(&at), [(1, 1.0), (2, 2.0), (4, 4.0)]);
    truth(&at, "groundtruth.txt", "1,1,2,2\n2,1,2,2\n3,1,2,2\n");
    assert_eq!(x(&at), [(1, 1.0), (2, 2.0), (4, 3.0)]);
}

#[test]
fn vot_polygons_and_absent_rows_are_read() {
    let at = empty("vot");
    pictures(&at.join("color"), 1..=3);
    truth(&at, "groundtruth.txt", "1,5,4,9,0,7,2,3\n0,0,5,6\n0,0,0,0\n");
    let sequence = &Sequence::open(&at).unwrap()[0];
    assert_eq!(
        sequence.truth,
        [
            Some(Rect { x: 0.0, y: 3.0, width: 4.0, height: 6.0 }),
            Some(Rect { x: 0.0, y: 0.0, width: 5.0, height: 6.0 }),
            None
        ]
    );
    truth(&at, "absence.label", "1\n0\n0\n");
    assert_eq!(Sequence::open(&at).unwrap()[0].start().map(|(at, _)| at), Some(1));
    truth(&at, "absence.label", "1\n0\n");
    assert!(Sequence::open(&at).unwrap_err().to_string().contains("2 rows where the annotation has 3"));
}

#[test]
fn errors_of_annotations_name_file_line_and_value() {
    let at = empty("errors");
    pictures(&at, 1..=2);
    let error = || Sequence::open(&at).unwrap_err().to_string();
    assert!(error().contains("there is no annotation"), "{}", error());
    for (text, says) in [
        ("1,1,2,2\n1,b,2,2\n", "groundtruth.txt, line 2: `b` is not a number"),
        ("1,1,2,2\n\n1,1,2,2\n", "groundtruth.txt, line 2: `` has 0 values"),
        ("", "the file is empty"),
        ("NaN,NaN,NaN,NaN\n", "there is no row in which the object is to be seen"),
    ] {
        truth(&at, "groundtruth.txt", text);
        assert!(error().contains(says), "{}", error());
    }
}

#[test]
fn results_with_named_columns_are_read_by_name() {
    let at = empty("named");
    truth(&at, "boxes.csv", "frame,x,y,w,h,p_lost\n0,1,2,3,4,0.5\n");
    let boxes = read_boxes(&at.join("boxes.csv"), 1.0).unwrap();
    assert_eq!(boxes, [Some(Rect { x: 1.0, y: 2.0, width: 3.0, height: 4.0 })]);
}

/// Real sequences agree with what is known of them; a twentieth of their pictures is read.
#[test]
fn sequences_of_the_benchmark_are_read() {
    let beside = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("ZERRE_DATA").map_or_else(beside, PathBuf::from).join("otb");
    if !folder.exists() {
        assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "no folder {}", folder.display());
        eprintln!("SKIPPED: no sequences at {} (set ZERRE_DATA)", folder.display());
        return;
    }
    for (name, frames, size, first) in [
        ("Girl", 500, (128, 96), [56.0, 20.0, 31.0, 45.0]),
        ("Suv", 945, (320, 240), [141.0, 124.0, 91.0, 40.0]),
        ("Deer", 71, (704, 400), [305.0, 4.0, 95.0, 65.0]),
    ] {
        let found = Sequence::open(&folder.join(name)).unwrap();
        let [sequence] = &found[..] else { panic!("{name}: {} targets", found.len()) };
        let [x, y, width, height] = first;
        assert_eq!((sequence.truth.len(), sequence.pictures.places().len()), (frames, frames));
        assert_eq!(sequence.start(), Some((0, Rect { x, y, width, height })));
        assert!(sequence.notes.is_empty() && sequence.pictures.ignored() == 0, "{:?}", sequence.notes);
        for place in sequence.pictures.places().iter().step_by(20) {
            assert_eq!(sequence.pictures.read(place).unwrap().size(), size);
        }
    }
}

#[test]
fn a_frame_is_read_back_as_it_was_written() {
    let at = empty("png").join("a.png");
    let frame = Frame::from_fn(5, 3, |x, y| [x as u8, y as u8, 200]);
    fs::write(&at, folder::png(&frame).unwrap()).unwrap();
    assert_eq!(folder::frame(&at).unwrap(), frame);
}
