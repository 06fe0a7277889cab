//! What all pages share: where the server listens, who may ask, and how it ends.

use crate::{Error, Result};
use axum::Router;
use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn};
use axum::response::{IntoResponse, Response};
use axum::routing::MethodRouter;
use std::future::{Future, IntoFuture, poll_fn};
use std::net::{Ipv4Addr, TcpListener};
use std::pin::pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::Poll;
use std::time::Duration;

/// How often the server looks whether it shall end.
const LOOK: Duration = Duration::from_millis(50);
/// How long requests under way may last once it shall.
const GRACE: Duration = Duration::from_secs(3);

/// Nothing from elsewhere, no frames about the page, no forms that lead away.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; \
                      connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// A word that nobody can guess: 128 random bits in hexadecimal.
///
/// # Errors
/// A system without random numbers.
pub fn key() -> Result<String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(|error| Error::Random(error.to_string()))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// A listener on the loopback address; port 0 is any that is free.
///
/// # Errors
/// A port that is taken or not allowed.
pub(crate) fn listen(port: u16) -> Result<(TcpListener, u16)> {
    let listener =
        TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(|source| Error::Port { port, source })?;
    let port = listener.local_addr()?.port();
    Ok((listener, port))
}

/// Serves `index` as `/key/` and `pages` below it until `done` says so.
///
/// # Errors
/// A system that refuses.
pub(crate) fn serve(
    listener: TcpListener,
    key: &str,
    index: MethodRouter,
    pages: Router,
    done: impl Fn() -> bool + Send + Sync + 'static,
) -> Result<()> {
    let app = Router::new()
        .route(&format!("/{key}/"), index)
        .nest(&format!("/{key}"), pages)
        .fallback(nothing_here)
        .layer(from_fn(guard));
    // One thread answers; what waits for the disk does so on threads of its own.
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    listener.set_nonblocking(true)?;
    let done = Arc::new(done);
    let asked = move || {
        let done = Arc::clone(&done);
        async move {
            while !done() {
                tokio::time::sleep(LOOK).await;
            }
        }
    };
    let served = runtime.block_on(async move {
        let listener = tokio::net::TcpListener::from_std(listener)?;
        let mut server = pin!(axum::serve(listener, app).with_graceful_shutdown(asked()).into_future());
        let mut late = pin!(async move {
            asked().await;
            tokio::time::sleep(GRACE).await;
        });
        poll_fn(|context| match server.as_mut().poll(context) {
            Poll::Ready(result) => Poll::Ready(result),
            Poll::Pending => late.as_mut().poll(context).map(Ok),
        })
        .await
    });
    runtime.shutdown_timeout(GRACE);
    Ok(served?)
}

/// What is behind a lock.
pub(crate) fn held<T>(lock: &Mutex<T>) -> MutexGuard<'_, T> {
    // A panic elsewhere leaves no half-done state behind: rows are whole or not there.
    lock.lock().unwrap_or_else(PoisonError::into_inner)
}

async fn nothing_here() -> Response {
    said(StatusCode::NOT_FOUND, "There is nothing here: open the whole address that the terminal shows.")
}

/// A sentence as an answer.
pub(crate) fn said(status: StatusCode, text: &str) -> Response {
    (status, [(header::CONTENT_TYPE, "text/plain; charset=utf-8")], text.to_owned()).into_response()
}

/// A file as an answer.
pub(crate) fn file(kind: &'static str, data: impl Into<Body>) -> Response {
    ([(header::CONTENT_TYPE, kind)], data.into()).into_response()
}

/// Whether a page from elsewhere may have sent this.
fn is_foreign(headers: &HeaderMap) -> bool {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    let host = text(header::HOST).unwrap_or_default();
    let origin = text(header::ORIGIN);
    !is_loopback(host) || origin.is_some_and(|origin| origin.strip_prefix("http://") != Some(host))
}

/// Refuses what a foreign page may have sent, and says to the browser what the page may do.
async fn guard(request: Request, next: Next) -> Response {
    let mut response = if is_foreign(request.headers()) {
        said(StatusCode::FORBIDDEN, "This page answers to the browser of its own machine only.")
    } else {
        next.run(request).await
    };
    let headers = response.headers_mut();
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    // What was marked changes; only pictures say themselves that they may be kept.
    headers.entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));
    response
}

/// Whether a host with or without a port is this machine. The port may be another: of a tunnel.
fn is_loopback(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|digit| digit.is_ascii_digit()) => name,
        _ => host,
    };
    ["127.0.0.1", "localhost", "[::1]"].contains(&name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_of_this_machine_are_hosts() {
        for host in ["127.0.0.1", "127.0.0.1:80", "localhost:9000", "[::1]:7", "[::1]"] {
            assert!(is_loopback(host), "{host}");
        }
        for host in
            ["", "evil.example", "127.0.0.1.evil.example:80", "localhost.evil:80", "10.0.0.1", "::1", ":80"]
        {
            assert!(!is_loopback(host), "{host}");
        }
    }

    #[test]
    fn keys_differ() {
        let (a, b) = (key().unwrap(), key().unwrap());
        assert!(a != b && a.len() == 32 && a.bytes().all(|c| c.is_ascii_hexdigit()));
    }
}
