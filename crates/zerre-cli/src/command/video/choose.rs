//! The first box, drawn by hand: a page that this program serves to the browser of its own machine shows the first
//! frame, and what is drawn on it comes back.

use crate::browser::browse;
use crate::console::Console;
use crate::diagnostic::Diagnostic;
use zerre_vision::frames::folder::png;
use zerre_vision::{Frame, Rect};

/// Asks for the box of the object in `frame`; waits until there is one.
pub(super) fn ask(frame: &Frame, console: &Console) -> Result<Rect, Diagnostic> {
    let cannot = |error: String| {
        Diagnostic::new(format!("the page to choose the object on cannot be shown: {error}"))
            .help("say where it is with --box x,y,w,h")
    };
    let picture = png(frame).map_err(|error| cannot(error.to_string()))?;
    let size = frame.size();
    let tell = |address: &str| {
        console.page(address, format_args!("draw a box about the object on {address} (Ctrl-C leaves)"));
        browse(address);
    };
    let read = move |text: &str| crate::args::bounds(text)?.on_frame(size).map_err(|error| error.to_string());
    zerre_web::choose::ask(picture, tell, read).map_err(|error| cannot(error.to_string()))
}
