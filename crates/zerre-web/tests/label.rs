//! The labelling page's server, asked as a browser would and as an attacker might.

use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use zerre_web::label::{Desk, Job, Store, name};

struct Server {
    address: String,
    port: u16,
    store: Arc<Mutex<Store>>,
    told: Arc<Mutex<Vec<String>>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    fn start(test: &str) -> Server {
        let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("web-{test}.sqlite"));
        for end in ["", "-wal", "-shm"] {
            let _ = std::fs::remove_file(format!("{}{end}", path.display()));
        }
        Server::on(Store::open(&path).unwrap())
    }

    fn on(store: Store) -> Server {
        let job = Job {
            title: "clip".to_owned(),
            input: "abc".to_owned(),
            points: vec!["hand".to_owned()],
            frames: (1..=4).map(|k| format!("frame {k}")).collect(),
            size: [64, 48],
        };
        let (store, told) = (Arc::new(Mutex::new(store)), Arc::new(Mutex::new(Vec::new())));
        let notes = Arc::clone(&told);
        let picture = |number: usize| match number {
            3 => Err("it is gone".to_owned()),
            _ => Ok(("image/png", vec![number as u8; 10])),
        };
        let tell = move |text: &str| notes.lock().unwrap().push(text.to_owned());
        let opened = Desk::new(job, Arc::clone(&store), picture, tell).unwrap().open(None).unwrap();
        let (address, port, stop) = (opened.address.clone(), opened.port, Arc::new(AtomicBool::new(false)));
        let done = Arc::clone(&stop);
        let thread = std::thread::spawn(move || opened.serve(move || done.load(Ordering::Relaxed)).unwrap());
        Server { address, port, store, told, stop, thread: Some(thread) }
    }

    fn path(&self) -> &str {
        self.address.split_once(&format!(":{}", self.port)).unwrap().1
    }

    /// Status and body of a request with these lines of head.
    fn raw(&self, method: &str, path: &str, head: &str, body: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        let length = body.len();
        write!(
            stream,
            "{method} {path} HTTP/1.1\r\n{head}Connection: close\r\nContent-Length: {length}\r\n\r\n{body}"
        )
        .unwrap();
        let mut text = Vec::new();
        stream.read_to_end(&mut text).unwrap();
        let text = String::from_utf8_lossy(&text).into_owned();
        let status = text.split(' ').nth(1).unwrap().parse().unwrap();
        (status, text)
    }

    fn ask(&self, path: &str, body: Option<Value>) -> (u16, Value) {
        let method = if body.is_some() { "POST" } else { "GET" };
        let body = body.map_or_else(String::new, |body| body.to_string());
        let (status, text) =
            self.raw(method, &format!("{}{path}", self.path()), "Host: 127.0.0.1\r\n", &body);
        let body = text.split_once("\r\n\r\n").unwrap().1.to_owned();
        (status, serde_json::from_str(&body).unwrap_or(Value::String(body)))
    }

    fn login(&self, name: &str, take_over: bool) -> (u16, Value) {
        self.ask("login", Some(json!({ "name": name, "take_over": take_over })))
    }

    fn mark(&self, session: &Value, id: &str, frame: usize) -> (u16, Value) {
        let event = json!({ "id": id, "kind": "mark", "frame": frame, "point": 0, "x": 3.5, "y": 4.5 });
        self.ask("events", Some(json!({ "session": session, "events": [event] })))
    }

    fn told(&self) -> String {
        self.told.lock().unwrap().join("\n")
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

#[test]
fn only_pages_of_this_server_on_this_machine_may_ask() {
    let server = Server::start("foreign");
    let job = format!("{}job", server.path());
    let own = format!("Host: 127.0.0.1:{0}\r\nOrigin: http://127.0.0.1:{0}\r\n", server.port);
    // A tunnel has another port and the other name.
    for head in
        ["Host: 127.0.0.1\r\n", "Host: localhost:9000\r\nOrigin: http://localhost:9000\r\n", own.as_str()]
    {
        assert_eq!(server.raw("GET", &job, head, "").0, 200, "{head}");
    }
    for head in [
        "Host: evil.example\r\n",
        "",
        "Host: 127.0.0.1\r\nOrigin: http://evil.example\r\n",
        "Host: 127.0.0.1\r\nOrigin: null\r\n",
        "Host: 127.0.0.1:1\r\nOrigin: http://127.0.0.1:2\r\n",
    ] {
        let (status, _) = server.raw("GET", &job, head, "");
        assert!(status == 403 || (head.is_empty() && status == 400), "{head}: {status}");
    }
    for path in ["/", "/job", "/00000000000000000000000000000000/job"] {
        let (status, text) = server.raw("GET", path, "Host: 127.0.0.1\r\n", "");
        assert!(status == 404 && text.contains("the terminal shows"), "{path}: {text}");
    }
    let (_, page) = server.raw("GET", server.path(), "Host: 127.0.0.1\r\n", "");
    assert!(
        page.contains("default-src 'none'") && page.contains("no-store") && page.contains("Who is marking?")
    );
}

#[test]
fn operators_are_blind_to_each_other() {
    let server = Server::start("blind");
    let (_, ann) = server.login("Ann", false);
    let (_, bob) = server.login("Bob", false);
    assert_eq!(server.mark(&ann["session"], "first-of-ann", 0).1["saved"], json!(["first-of-ann"]));
    assert_eq!(bob["events"], json!([]));
    for (path, body) in [
        ("job", None),
        ("alive", Some(json!({ "session": bob["session"] }))),
        ("events", Some(json!({ "session": bob["session"], "events": [] }))),
    ] {
        let text = server.ask(path, body).1.to_string();
        assert!(!text.contains("first-of-ann") && !text.contains("3.5") && !text.contains("Ann"), "{text}");
    }
    // Nobody without a session, and nobody under a session that is made up, marks.
    for session in [json!("made up"), json!("")] {
        assert_eq!(server.mark(&session, "x", 0).0, 409);
    }
    let job = server.store.lock().unwrap().job().unwrap().unwrap();
    let answers = server.store.lock().unwrap().answers(&job).unwrap();
    assert_eq!(answers.operators, ["Ann", "Bob"]);
    assert_eq!(answers.answers[0][0][0], Some(Some([3.5, 4.5])));
    assert_eq!(answers.answers[0][1], [None, None, None, None]);
}

#[test]
fn a_second_window_is_told_and_may_take_over() {
    let server = Server::start("second");
    let (status, first) = server.login(" Ann  Lee ", false);
    assert_eq!((status, &first["name"]), (200, &json!("Ann Lee")));
    server.mark(&first["session"], "a", 0);
    let (status, refused) = server.login("ann lee", false);
    assert_eq!((status, &refused["error"]), (409, &json!("active")));
    assert!(refused["message"].as_str().unwrap().contains("at work in another window"));
    let (status, second) = server.login("ann lee", true);
    assert_eq!(
        (status, &second["name"], second["events"].as_array().unwrap().len()),
        (200, &json!("Ann Lee"), 1)
    );
    let (status, told) = server.mark(&first["session"], "b", 1);
    assert_eq!((status, &told["error"]), (409, &json!("taken")));
    // What the first window kept comes with it when it takes over again.
    let third = server.login("Ann Lee", true).1;
    assert_eq!(server.mark(&third["session"], "b", 1).0, 200);
    // A window that was closed is gone, and the name is only asked for.
    server.ask("alive", Some(json!({ "session": third["session"], "leaving": true })));
    assert_eq!(server.login("Ann Lee", false).1["error"], "known");
    assert!(server.told().contains("Ann Lee goes on in another window"), "{}", server.told());
}

#[test]
fn nonsense_is_refused_and_holds_nothing_up() {
    let server = Server::start("nonsense");
    for (name, says) in
        [("", "give a name"), ("=1+1", "begins with"), ("a,b", "letters"), ("\u{1b}[2J", "letters")]
    {
        let (status, body) = server.login(name, false);
        assert!(status == 400 && body["message"].as_str().unwrap().contains(says), "{name}: {body}");
    }
    assert!(name(&"x".repeat(41)).unwrap_err().contains("too long"));
    assert_eq!(name("  Zoë   O'Neill-2 "), Ok("Zoë O'Neill-2".to_owned()));
    let session = server.login("Ann", false).1["session"].clone();
    let good = json!({ "id": "good", "kind": "hidden", "frame": 1, "point": 0 });
    let bad = [
        json!({ "id": "kind", "kind": "dance" }),
        json!({ "id": "number", "kind": "mark", "frame": -1, "point": 0, "x": 1, "y": 1 }),
        json!({ "id": "far", "kind": "mark", "frame": 0, "point": 0, "x": 1e9, "y": 1 }),
        json!(7),
    ];
    let mut events = bad.to_vec();
    events.push(good);
    let (status, answer) = server.ask("events", Some(json!({ "session": session, "events": events })));
    assert_eq!((status, &answer["saved"]), (200, &json!(["good"])));
    assert_eq!(answer["refused"].as_array().unwrap().len(), bad.len());
    assert_eq!(server.ask("events", Some(json!([1]))).0, 400);
    for (path, expected) in [("frames/2", 200), ("frames/3", 500), ("frames/4", 404), ("frames/x", 400)] {
        assert_eq!(server.ask(path, None).0, expected, "{path}");
    }
    assert!(server.told().contains("frame 4 cannot be shown: it is gone"));
}

#[test]
fn a_full_disk_is_told_and_marks_come_later() {
    let server = Server::start("full");
    let session = server.login("Ann", false).1["session"].clone();
    server.store.lock().unwrap().limit_pages(1).unwrap();
    let mut sent = 0;
    let refusal = loop {
        let (status, body) = server.mark(&session, &format!("a-{sent}"), 0);
        if status != 200 {
            assert_eq!(status, 507, "{body}");
            break body;
        }
        sent += 1;
        assert!(sent < 2000);
    };
    assert_eq!(refusal["error"], "full");
    assert!(refusal["message"].as_str().unwrap().contains("the disk is full. They are kept in this browser"));
    assert_eq!(server.mark(&session, &format!("a-{sent}"), 0).0, 507);
    assert_eq!(server.told().matches("make room on the disk").count(), 1, "said once: {}", server.told());
    server.store.lock().unwrap().limit_pages(10_000).unwrap();
    assert_eq!(server.mark(&session, &format!("a-{sent}"), 0).0, 200);
    assert!(server.told().contains("marks are saved again"));
    let events = server.login("Ann", true).1["events"].as_array().unwrap().len();
    assert_eq!(events, sent + 1);
}

#[test]
fn the_same_file_has_the_same_address_and_the_sessions_live_on() {
    let server = Server::start("again");
    let session = server.login("Ann", false).1["session"].clone();
    server.mark(&session, "a", 0);
    let (address, path) = (server.address.clone(), server.store.lock().unwrap().path().to_owned());
    drop(server);
    let server = Server::on(Store::open(&path).unwrap());
    assert_eq!(server.address, address);
    assert_eq!(server.mark(&session, "b", 1).0, 200);
    for frame in [2, 3] {
        server.mark(&session, &format!("c{frame}"), frame);
    }
    assert!(server.told().contains("Ann has answered all of 4 frames"), "{}", server.told());
}
