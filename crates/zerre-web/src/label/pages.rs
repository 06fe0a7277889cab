//! What the browser asks for.

use super::store::{Store, words};
use super::{Event, Job, name};
use crate::Result;
use crate::server::{file, held, listen, said, serve};
use axum::Router;
use axum::body::Bytes;
use axum::extract::{Path, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt;
use std::net::TcpListener;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// The kind of a picture and its bytes.
pub type Picture = (&'static str, Vec<u8>);

/// A browser that has been silent for so long is gone; the page speaks every five seconds.
const SILENCE: Duration = Duration::from_secs(15);

/// The table at which all operators sit.
pub struct Desk {
    job: Job,
    store: Arc<Mutex<Store>>,
    picture: Box<dyn Fn(usize) -> std::result::Result<Picture, String> + Send + Sync>,
    tell: Box<dyn Fn(&str) + Send + Sync>,
    /// When each operator was last heard of.
    heard: Mutex<BTreeMap<i64, Instant>>,
    /// Whether the disk refused the last time, and who has answered everything.
    told: Mutex<(bool, Vec<i64>)>,
}

impl fmt::Debug for Desk {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Desk").field("job", &self.job.title).finish_non_exhaustive()
    }
}

/// A desk whose door is open.
#[derive(Debug)]
pub struct Opened {
    desk: Arc<Desk>,
    listener: TcpListener,
    key: String,
    /// The page's address.
    pub address: String,
    /// The port that it has.
    pub port: u16,
}

impl Desk {
    /// A desk for a job whose marks are in `store`. `picture` gives the encoded picture of a frame, `tell`
    /// gets a sentence where something happens that whoever started the program may want to know.
    ///
    /// # Errors
    /// A store with another job.
    pub fn new(
        job: Job,
        store: Arc<Mutex<Store>>,
        picture: impl Fn(usize) -> std::result::Result<Picture, String> + Send + Sync + 'static,
        tell: impl Fn(&str) + Send + Sync + 'static,
    ) -> Result<Desk> {
        held(&store).begin(&job)?;
        Ok(Desk {
            job,
            store,
            picture: Box::new(picture),
            tell: Box::new(tell),
            heard: Mutex::default(),
            told: Mutex::default(),
        })
    }

    /// Listens on `port`, else on the one of last time, so that pages still open find it again, else on any.
    ///
    /// # Errors
    /// A port of the caller's that is taken; a store that cannot be written.
    pub fn open(self, port: Option<u16>) -> Result<Opened> {
        let mut store = held(&self.store);
        let last = store.port()?;
        let (listener, port) = match (port, last) {
            (Some(port), _) => listen(port)?,
            (None, Some(last)) => listen(last).or_else(|_| {
                (self.tell)(&format!(
                    "port {last}, where the page was last time, is taken: marks that a browser could not save then come \
                     back when the page is served on it again (--port {last})"
                ));
                listen(0)
            })?,
            (None, None) => listen(0)?,
        };
        store.set_port(port)?;
        let key = store.key()?;
        drop(store);
        let address = format!("http://127.0.0.1:{port}/{key}/");
        Ok(Opened { desk: Arc::new(self), listener, key, address, port })
    }
}

impl Opened {
    /// Serves the page until `done` says so.
    ///
    /// # Errors
    /// A system that refuses.
    pub fn serve(self, done: impl Fn() -> bool + Send + Sync + 'static) -> Result<()> {
        let asset = |kind: &'static str, text: &'static str| get(move || async move { file(kind, text) });
        let index = asset("text/html; charset=utf-8", include_str!("page.html"));
        let index = index.with_state(Arc::clone(&self.desk));
        let pages = Router::new()
            .route("/page.css", asset("text/css; charset=utf-8", include_str!("page.css")))
            .route("/marks.js", asset("text/javascript; charset=utf-8", include_str!("marks.js")))
            .route("/view.js", asset("text/javascript; charset=utf-8", include_str!("view.js")))
            .route("/page.js", asset("text/javascript; charset=utf-8", include_str!("page.js")))
            .route("/job", get(job))
            .route("/frames/{number}", get(frame))
            .route("/login", post(login))
            .route("/alive", post(alive))
            .route("/events", post(events))
            .with_state(self.desk);
        serve(self.listener, &self.key, index, pages, done)
    }
}

fn answer(status: StatusCode, value: &impl Serialize) -> Response {
    match serde_json::to_vec(value) {
        Ok(text) => (status, file("application/json", text)).into_response(),
        Err(error) => said(StatusCode::INTERNAL_SERVER_ERROR, &error.to_string()),
    }
}

/// A refusal: `error` is a word for the page, `message` a sentence for people.
fn refusal(status: StatusCode, error: &str, message: &str) -> Response {
    answer(status, &json!({ "error": error, "message": message }))
}

/// Does what waits for the disk where nobody else waits for it.
async fn aside(work: impl FnOnce() -> Response + Send + 'static) -> Response {
    tokio::task::spawn_blocking(work).await.unwrap_or_else(|error| {
        refusal(StatusCode::INTERNAL_SERVER_ERROR, "fault", &format!("The server met a fault: {error}"))
    })
}

fn parsed<'a, T: Deserialize<'a>>(body: &'a [u8]) -> std::result::Result<T, Box<Response>> {
    serde_json::from_slice(body).map_err(|error| {
        let message = format!("The server does not understand this: {error}");
        Box::new(refusal(StatusCode::BAD_REQUEST, "malformed", &message))
    })
}

/// The disk refuses: nothing is lost, for the browser keeps it and asks again.
fn full(desk: &Desk, error: &rusqlite::Error) -> Response {
    let why = words(error);
    let mut told = held(&desk.told);
    if !std::mem::replace(&mut told.0, true) {
        let path = held(&desk.store).path().display().to_string();
        (desk.tell)(&format!(
            "marks cannot be saved to {path}: {why}; the browsers keep them and try again: make room on the disk"
        ));
    }
    let message =
        format!("The marks cannot be saved: {why}. They are kept in this browser, and it tries again.");
    refusal(StatusCode::INSUFFICIENT_STORAGE, "full", &message)
}

async fn job(State(desk): State<Arc<Desk>>) -> Response {
    aside(move || {
        let id = match held(&desk.store).key() {
            // A part of the word in the address, which the browser knows anyway.
            Ok(key) => key.chars().take(12).collect::<String>(),
            Err(error) => return said(StatusCode::INTERNAL_SERVER_ERROR, &error.to_string()),
        };
        let Job { title, points, frames, size, .. } = &desk.job;
        let job = json!({ "id": id, "title": title, "points": points, "frames": frames, "size": size });
        answer(StatusCode::OK, &job)
    })
    .await
}

async fn frame(State(desk): State<Arc<Desk>>, Path(number): Path<usize>) -> Response {
    if number >= desk.job.frames.len() {
        return said(StatusCode::NOT_FOUND, "there is no such frame");
    }
    aside(move || match (desk.picture)(number) {
        Ok((kind, data)) => {
            let mut response = file(kind, data);
            let keep = HeaderValue::from_static("private, max-age=86400, immutable");
            response.headers_mut().insert(header::CACHE_CONTROL, keep);
            response
        }
        Err(problem) => {
            (desk.tell)(&format!("{} cannot be shown: {problem}", desk.job.frames[number]));
            said(StatusCode::INTERNAL_SERVER_ERROR, &problem)
        }
    })
    .await
}

#[derive(Deserialize)]
struct Login {
    name: String,
    #[serde(default)]
    take_over: bool,
}

async fn login(State(desk): State<Arc<Desk>>, body: Bytes) -> Response {
    aside(move || {
        let request: Login = match parsed(&body) {
            Ok(request) => request,
            Err(response) => return *response,
        };
        let name = match name(&request.name) {
            Ok(name) => name,
            Err(message) => return refusal(StatusCode::BAD_REQUEST, "name", &message),
        };
        let session = match crate::key() {
            Ok(session) => session,
            Err(error) => return refusal(StatusCode::INTERNAL_SERVER_ERROR, "fault", &error.to_string()),
        };
        let mut store = held(&desk.store);
        let known = match store.find(&name) {
            Ok(known) => known,
            Err(error) => {
                drop(store);
                return full(&desk, &error);
            }
        };
        let active = known.as_ref().is_some_and(|known| {
            held(&desk.heard).get(&known.id).is_some_and(|heard| heard.elapsed() < SILENCE)
        });
        if let Some(known) = known.as_ref().filter(|_| !request.take_over) {
            let name = &known.name;
            let message = if active {
                format!(
                    "{name} is at work in another window. If that is you, take over here: nothing is lost. If it is \
                     somebody else, choose another name."
                )
            } else {
                format!("{name} has worked on this job before. If that is you, go on; otherwise choose another name.")
            };
            let word = if active { "active" } else { "known" };
            return refusal(StatusCode::CONFLICT, word, &message);
        }
        let entered = store.enter(&name, &session);
        let events = entered.as_ref().ok().map(|operator| store.events(operator.id));
        drop(store);
        let (operator, events) = match (entered, events) {
            (Ok(operator), Some(Ok(events))) => (operator, events),
            (Err(error), _) | (Ok(_), Some(Err(error))) => return full(&desk, &error),
            (Ok(_), None) => return refusal(StatusCode::INTERNAL_SERVER_ERROR, "fault", "no events"),
        };
        held(&desk.heard).insert(operator.id, Instant::now());
        (desk.tell)(&match (&known, active) {
            (None, _) => format!("{} begins", operator.name),
            (Some(_), false) => format!("{} goes on", operator.name),
            (Some(_), true) => format!("{} goes on in another window; the first one is told", operator.name),
        });
        answer(StatusCode::OK, &json!({ "session": session, "name": operator.name, "events": events }))
    })
    .await
}

/// The operator of a session, who is heard of by this; a refusal where another window has taken over.
fn heard(desk: &Desk, session: &str) -> std::result::Result<super::Operator, Box<Response>> {
    match held(&desk.store).of_session(session) {
        Ok(Some(operator)) => {
            held(&desk.heard).insert(operator.id, Instant::now());
            Ok(operator)
        }
        Ok(None) => Err(Box::new(refusal(
            StatusCode::CONFLICT,
            "taken",
            "This name is at work in another window now. What was not saved yet is kept here.",
        ))),
        Err(error) => {
            let message = format!("The marks cannot be read: {}", words(&error));
            Err(Box::new(refusal(StatusCode::INSUFFICIENT_STORAGE, "full", &message)))
        }
    }
}

#[derive(Deserialize)]
struct Alive {
    session: String,
    /// The window is being closed.
    #[serde(default)]
    leaving: bool,
}

async fn alive(State(desk): State<Arc<Desk>>, body: Bytes) -> Response {
    aside(move || {
        let request: Alive = match parsed(&body) {
            Ok(request) => request,
            Err(response) => return *response,
        };
        match heard(&desk, &request.session) {
            Ok(operator) => {
                if request.leaving {
                    held(&desk.heard).remove(&operator.id);
                }
                answer(StatusCode::OK, &json!({}))
            }
            Err(response) => *response,
        }
    })
    .await
}

#[derive(Deserialize)]
struct Sent {
    session: String,
    events: Vec<Value>,
}

async fn events(State(desk): State<Arc<Desk>>, body: Bytes) -> Response {
    aside(move || {
        let request: Sent = match parsed(&body) {
            Ok(request) => request,
            Err(response) => return *response,
        };
        let operator = match heard(&desk, &request.session) {
            Ok(operator) => operator,
            Err(response) => return *response,
        };
        // One event that means nothing must not hold up the others behind it.
        let (mut sound, mut refused) = (Vec::new(), Vec::new());
        for value in request.events {
            let id = value.get("id").and_then(Value::as_str).unwrap_or_default().to_owned();
            match serde_json::from_value::<Event>(value) {
                Ok(event) => sound.push(event),
                Err(error) => refused.push((id, error.to_string())),
            }
        }
        let appended = held(&desk.store).append(operator.id, &sound, &desk.job);
        let mut appended = match appended {
            Ok(appended) => appended,
            Err(error) => return full(&desk, &error),
        };
        appended.refused.extend(refused);
        after_saving(&desk, &operator);
        let refused: Vec<Value> =
            appended.refused.iter().map(|(id, why)| json!({ "id": id, "why": why })).collect();
        answer(StatusCode::OK, &json!({ "saved": appended.saved, "refused": refused }))
    })
    .await
}

/// Tells that the disk takes marks again, and that somebody has answered everything.
fn after_saving(desk: &Desk, operator: &super::Operator) {
    let all = desk.job.frames.len() * desk.job.points.len();
    let answered = held(&desk.store).events(operator.id).map(|events| super::store::standing(&events).len());
    let mut told = held(&desk.told);
    if std::mem::replace(&mut told.0, false) {
        (desk.tell)("marks are saved again");
    }
    let done = answered.is_ok_and(|answered| answered >= all);
    let known = told.1.iter().position(|id| *id == operator.id);
    match (done, known) {
        (true, None) => {
            told.1.push(operator.id);
            (desk.tell)(&format!("{} has answered all of {} frames", operator.name, desk.job.frames.len()));
        }
        (false, Some(at)) => {
            told.1.remove(at);
        }
        _ => {}
    }
}
