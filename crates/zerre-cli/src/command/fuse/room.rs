//! The room before the first frame.

use super::feed::Feed;
use super::refused;
use crate::args::{Fuse, RoomFrom};
use crate::diagnostic::Diagnostic;
use crate::run::interrupted;
use zerre_vision::rgbd::NO_DEPTH;
use zerre_vision::rgbd::background::{Background, MedianRoom, RunningSettings};
use zerre_vision::rgbd::recording::{Recording, RecordingOptions};

/// Frames that the median of a room is taken of.
const MEDIAN_OF: usize = 31;
/// Frames of which the first with any depth begins a room that is learnt frame by frame.
const BEGINNING: usize = 30;

/// Whether the depth of the room was measured anywhere.
pub(super) fn has_depth(room: &Background) -> bool {
    room.depth().pixels().iter().any(|depth| *depth != NO_DEPTH)
}

/// The room of a recording, which is opened anew where its frames are needed.
pub(super) fn of_recording(
    args: &Fuse,
    options: &RecordingOptions,
    recording: &mut Recording,
) -> Result<(Background, RoomFrom), Diagnostic> {
    let pictures = recording.room().transpose().map_err(refused)?;
    let from = args.room.unwrap_or(if pictures.is_some() { RoomFrom::Pictures } else { RoomFrom::Median });
    let again = || Recording::open(&args.recording, options).map_err(refused);
    let room = match (from, pictures) {
        (RoomFrom::Pictures, Some((colour, depth))) => Background::still(colour, depth),
        (RoomFrom::Pictures, None) => {
            let what = format!("{} has no pictures of the empty room", args.recording.display());
            let help = "save them as background_rgb.png and background_depth.png, or use --room median";
            return Err(Diagnostic::new(what).help(help));
        }
        (RoomFrom::Median, _) => {
            let mut median = MedianRoom::new(MEDIAN_OF);
            for frame in again()?.flatten() {
                if interrupted() {
                    return Err(Diagnostic::new("stopped before the first frame: nothing was written"));
                }
                median.add(&frame).map_err(refused)?;
            }
            median.finish()
        }
        (RoomFrom::Running, _) => {
            let mut first = None;
            for frame in again()?.flatten().take(BEGINNING) {
                let deep = frame.depth.pixels().iter().any(|depth| *depth != NO_DEPTH);
                if deep || first.is_none() {
                    first = Some(frame);
                }
                if deep || !recording.may_have_depth() {
                    break;
                }
            }
            let Some(first) = first else { return Err(nothing(args)) };
            Background::running(first.colour, first.depth, RunningSettings::default())
        }
    };
    Ok((room.map_err(refused)?, from))
}

/// The room of a camera or a stream: its first frame, and then what is learnt.
pub(super) fn of_camera(args: &Fuse, feed: &mut Feed) -> Result<(Background, RoomFrom), Diagnostic> {
    if args.room.is_some_and(|room| room != RoomFrom::Running) {
        return Err(Diagnostic::usage("the room before a camera is learnt frame by frame")
            .help("leave --room out, or give --room running"));
    }
    let Some(first) = feed.peek() else { return Err(nothing(args)) };
    let room = Background::running(first.colour.clone(), first.depth.clone(), RunningSettings::default());
    Ok((room.map_err(refused)?, RoomFrom::Running))
}

fn nothing(args: &Fuse) -> Diagnostic {
    Diagnostic::new(format!("{}: no frame can be read", args.recording.display()))
}
