//! The first box, drawn by hand: a page that this program serves to the browser of its own machine shows the first
//! frame, and what is drawn on it comes back.

use crate::console::Console;
use crate::diagnostic::Diagnostic;
use std::io::IsTerminal;
use std::process::{Command, Stdio};
use tiny_http::{Header, Method, Request, Response, Server};
use zerre_vision::frames::folder::png;
use zerre_vision::{Frame, Rect};

const PAGE: &str = include_str!("choose.html");
/// A box is a few numbers: longer bodies are no box.
const LONGEST_BODY: usize = 200;

/// Whether somebody sits before a display.
pub(super) fn has_display() -> bool {
    let named = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let always = cfg!(any(target_os = "macos", windows));
    named("DISPLAY") || named("WAYLAND_DISPLAY") || (always && std::io::stderr().is_terminal())
}

/// Asks for the box of the object in `frame`; waits until there is one.
pub(super) fn ask(frame: &Frame, console: &Console) -> Result<Rect, Diagnostic> {
    let cannot = |error: String| {
        Diagnostic::new(format!("the page to choose the object on cannot be shown: {error}"))
            .help("say where it is with --box x,y,w,h")
    };
    let picture = png(frame).map_err(|error| cannot(error.to_string()))?;
    let server = Server::http("127.0.0.1:0").map_err(|error| cannot(error.to_string()))?;
    let address = format!("http://{}/", server.server_addr());
    console.info(format_args!("draw a box about the object on {address} (Ctrl-C leaves)"));
    browse(&address);
    loop {
        let mut request = server.recv().map_err(|error| cannot(error.to_string()))?;
        let found = match (request.method(), request.url()) {
            (Method::Post, "/box") => Some(read(&mut request, frame)),
            _ => None,
        };
        // A browser that has gone away is no reason to stop: it may ask again.
        let _ = match (&found, request.method(), request.url()) {
            (Some(Ok(_)), ..) => request.respond(Response::from_string("The object is followed.")),
            (Some(Err(problem)), ..) => {
                request.respond(Response::from_string(problem.clone()).with_status_code(400))
            }
            (None, Method::Get, "/") => {
                request.respond(typed(PAGE.as_bytes().to_vec(), "text/html; charset=utf-8"))
            }
            (None, Method::Get, "/frame.png") => request.respond(typed(picture.clone(), "image/png")),
            _ => request.respond(Response::from_string("there is nothing here").with_status_code(404)),
        };
        if let Some(Ok(bounds)) = found {
            return Ok(bounds);
        }
    }
}

fn typed(data: Vec<u8>, kind: &str) -> Response<std::io::Cursor<Vec<u8>>> {
    let response = Response::from_data(data);
    match Header::from_bytes("Content-Type", kind) {
        Ok(header) => response.with_header(header),
        Err(()) => response,
    }
}

/// The box in a request's body.
fn read(request: &mut Request, frame: &Frame) -> Result<Rect, String> {
    use std::io::Read;
    let mut text = String::new();
    let mut body = request.as_reader().take(LONGEST_BODY as u64);
    body.read_to_string(&mut text).map_err(|error| error.to_string())?;
    let bounds = crate::args::bounds(text.trim())?;
    bounds.on_frame(frame.size()).map_err(|error| error.to_string())
}

/// Opens the browser; who has none reads the address in the terminal.
fn browse(address: &str) {
    let program = if cfg!(target_os = "macos") {
        "open"
    } else if cfg!(windows) {
        "explorer"
    } else {
        "xdg-open"
    };
    let _ = Command::new(program)
        .arg(address)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
}
