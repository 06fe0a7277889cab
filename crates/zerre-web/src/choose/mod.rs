//! A box about an object, drawn by hand on one picture.

use crate::Result;
use crate::server::{file, held, key, listen, said, serve};
use axum::Router;
use axum::body::Bytes;
use axum::http::StatusCode;
use axum::routing::{get, post};
use std::sync::{Arc, Mutex};

/// Serves a page with `picture`, a PNG file, until what is drawn on it is taken. `tell` gets the page's
/// address; `read` makes of a text of four numbers `x,y,width,height` what is wanted, or says what is wrong
/// with it.
///
/// # Errors
/// A system that refuses.
pub fn ask<T: Send + 'static>(
    picture: Vec<u8>,
    tell: impl FnOnce(&str),
    read: impl Fn(&str) -> std::result::Result<T, String> + Send + Sync + 'static,
) -> Result<T> {
    let (listener, port) = listen(0)?;
    let key = key()?;
    let found = Arc::new(Mutex::new(None));
    let [taken, seen] = [Arc::clone(&found), Arc::clone(&found)];
    let read = Arc::new(read);
    let take = move |body: Bytes| {
        let (read, taken) = (Arc::clone(&read), Arc::clone(&taken));
        async move {
            match read(std::str::from_utf8(&body).unwrap_or_default().trim()) {
                Ok(value) => {
                    *held(&taken) = Some(value);
                    said(StatusCode::OK, "The object is followed.")
                }
                Err(problem) => said(StatusCode::BAD_REQUEST, &problem),
            }
        }
    };
    let asset = |kind: &'static str, text: &'static str| get(move || async move { file(kind, text) });
    let picture = Bytes::from(picture);
    let index = asset("text/html; charset=utf-8", include_str!("page.html"));
    let pages = Router::new()
        .route("/page.css", asset("text/css; charset=utf-8", include_str!("page.css")))
        .route("/page.js", asset("text/javascript; charset=utf-8", include_str!("page.js")))
        .route("/frame.png", get(move || async move { file("image/png", picture) }))
        .route("/box", post(take));
    tell(&format!("http://127.0.0.1:{port}/{key}/"));
    serve(listener, &key, index, pages, move || held(&seen).is_some())?;
    let value = held(&found).take();
    value.ok_or_else(|| std::io::Error::other("it ended before a box was drawn").into())
}
