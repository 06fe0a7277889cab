//! A headless Chromium, driven by the DevTools protocol: real mouse and key events, no library of scripts
//! between.

use serde_json::{Value, json};
use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tungstenite::{Message, WebSocket};

/// Nothing that a page does takes longer, on a busy machine either.
const PATIENCE: Duration = Duration::from_secs(30);
const NAMES: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

pub struct Browser {
    process: Child,
    socket: WebSocket<TcpStream>,
    next: u64,
}

/// A window of an operator's own: nothing is shared with the others, as if it were another browser.
#[derive(Clone, Debug)]
pub struct Window {
    session: String,
    context: String,
}

impl Browser {
    /// Starts it; `None` without a browser, which continuous integration must have.
    pub fn start(profile: &Path) -> Option<Browser> {
        let process = NAMES.iter().find_map(|name| {
            Command::new(name)
                .args([
                    "--headless=new",
                    "--no-sandbox",
                    "--disable-gpu",
                    "--no-first-run",
                    "--disable-dev-shm-usage",
                ])
                .args(["--disable-background-networking", "--remote-debugging-port=0", "about:blank"])
                .arg(format!("--user-data-dir={}", profile.display()))
                .stdin(Stdio::null())
                .stdout(Stdio::null())
                .stderr(Stdio::piped())
                .spawn()
                .ok()
        });
        let Some(mut process) = process else {
            let message = "no browser: install chromium (Debian: `apt install chromium`)";
            assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "{message}");
            eprintln!("SKIPPED: {message}");
            return None;
        };
        let mut lines = BufReader::new(process.stderr.take().unwrap()).lines();
        let mark = "DevTools listening on ";
        let line = lines.by_ref().map_while(Result::ok).find(|line| line.contains(mark));
        let address = line.expect("the browser says where it listens").split_once(mark).unwrap().1.to_owned();
        // It would stop when nobody reads what it says.
        std::thread::spawn(move || lines.for_each(drop));
        let host = address.strip_prefix("ws://").unwrap().split('/').next().unwrap().to_owned();
        let stream = TcpStream::connect(host).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let (socket, _) = tungstenite::client(address, stream).unwrap();
        Some(Browser { process, socket, next: 0 })
    }

    fn call(&mut self, session: Option<&str>, method: &str, params: Value) -> Value {
        self.next += 1;
        let id = self.next;
        let mut request = json!({ "id": id, "method": method, "params": params });
        if let Some(session) = session {
            request["sessionId"] = session.into();
        }
        self.socket.send(Message::text(request.to_string())).unwrap();
        loop {
            let Message::Text(text) = self.socket.read().unwrap() else { continue };
            let answer: Value = serde_json::from_str(&text).unwrap();
            if answer["id"] == id {
                assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
                return answer["result"].clone();
            }
        }
    }

    /// Opens a page in a browser of its own, `dark` or light.
    pub fn open(&mut self, address: &str, dark: bool) -> Window {
        let context = self.call(None, "Target.createBrowserContext", json!({}))["browserContextId"].clone();
        let context = context.as_str().unwrap().to_owned();
        self.open_beside(&Window { session: String::new(), context }, address, dark)
    }

    /// Opens another window of the same browser.
    pub fn open_beside(&mut self, window: &Window, address: &str, dark: bool) -> Window {
        let context = window.context.clone();
        let size = json!({ "url": "about:blank", "browserContextId": context, "width": 1280, "height": 800 });
        let target = self.call(None, "Target.createTarget", size)["targetId"].clone();
        let attach = json!({ "targetId": target, "flatten": true });
        let session =
            self.call(None, "Target.attachToTarget", attach)["sessionId"].as_str().unwrap().to_owned();
        let window = Window { session, context };
        let scheme = if dark { "dark" } else { "light" };
        let media = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
        self.of(&window, "Emulation.setEmulatedMedia", media);
        let metrics = json!({ "width": 1280, "height": 800, "deviceScaleFactor": 1, "mobile": false });
        self.of(&window, "Emulation.setDeviceMetricsOverride", metrics);
        self.of(&window, "Emulation.setFocusEmulationEnabled", json!({ "enabled": true }));
        self.go(&window, address);
        window
    }

    fn of(&mut self, window: &Window, method: &str, params: Value) -> Value {
        self.call(Some(&window.session), method, params)
    }

    pub fn go(&mut self, window: &Window, address: &str) {
        self.ask(window, "window.left = true");
        self.of(window, "Page.navigate", json!({ "url": address }));
        self.wait(window, "!window.left && document.readyState === 'complete'");
    }

    /// The value of an expression.
    pub fn ask(&mut self, window: &Window, expression: &str) -> Value {
        let params = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let answer = self.of(window, "Runtime.evaluate", params);
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].clone()
    }

    /// Waits until an expression is true.
    pub fn wait(&mut self, window: &Window, expression: &str) {
        let since = Instant::now();
        while self.ask(window, &format!("!!({expression})")) != true {
            if since.elapsed() > PATIENCE {
                let state = "['saved-text', 'number', 'count', 'status', 'login-problem', 'curtain']
                    .map(id => id + ': ' + document.getElementById(id)?.textContent).join('\\n')";
                panic!(
                    "{expression} does not come true:\n{}",
                    self.ask(window, state).as_str().unwrap_or_default()
                );
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Waits until an element has this text somewhere.
    pub fn wait_text(&mut self, window: &Window, id: &str, text: &str) {
        self.wait(window, &format!("document.getElementById('{id}').textContent.includes({})", json!(text)));
    }

    /// Presses and releases a key, as `KeyboardEvent.key` names it; `modifiers` are 1 alt, 2 control, 8
    /// shift.
    pub fn key(&mut self, window: &Window, key: &str, modifiers: u32) {
        let code = match key {
            "Enter" => 13,
            "Tab" => 9,
            "Escape" => 27,
            "Home" => 36,
            "End" => 35,
            "ArrowLeft" => 37,
            "ArrowUp" => 38,
            "ArrowRight" => 39,
            "ArrowDown" => 40,
            " " => 32,
            key => key.to_uppercase().bytes().next().map_or(0, u32::from),
        };
        let text = match key {
            "Enter" => "\r",
            key if key.chars().count() == 1 && modifiers & 3 == 0 => key,
            _ => "",
        };
        let name = if key == "Enter" { "Enter" } else { key };
        let mut down =
            json!({ "type": "keyDown", "key": name, "windowsVirtualKeyCode": code, "modifiers": modifiers });
        if !text.is_empty() {
            down["text"] = text.into();
        }
        self.of(window, "Input.dispatchKeyEvent", down);
        let up =
            json!({ "type": "keyUp", "key": name, "windowsVirtualKeyCode": code, "modifiers": modifiers });
        self.of(window, "Input.dispatchKeyEvent", up);
    }

    pub fn type_text(&mut self, window: &Window, text: &str) {
        text.chars().for_each(|c| self.key(window, &c.to_string(), 0));
    }

    fn mouse(&mut self, window: &Window, kind: &str, at: [f64; 2], held: bool) {
        let buttons = u32::from(held);
        let button = if kind == "mouseMoved" && !held { "none" } else { "left" };
        let params = json!({
            "type": kind, "x": at[0], "y": at[1], "button": button, "buttons": buttons, "clickCount": 1,
        });
        self.of(window, "Input.dispatchMouseEvent", params);
    }

    pub fn click(&mut self, window: &Window, at: [f64; 2]) {
        self.mouse(window, "mouseMoved", at, false);
        self.mouse(window, "mousePressed", at, true);
        self.mouse(window, "mouseReleased", at, false);
    }

    pub fn drag(&mut self, window: &Window, from: [f64; 2], to: [f64; 2]) {
        self.mouse(window, "mouseMoved", from, false);
        self.mouse(window, "mousePressed", from, true);
        let middle = [0, 1].map(|k| 0.5 * (from[k] + to[k]));
        self.mouse(window, "mouseMoved", middle, true);
        self.mouse(window, "mouseMoved", to, true);
        self.mouse(window, "mouseReleased", to, false);
    }

    pub fn wheel(&mut self, window: &Window, at: [f64; 2], down: f64) {
        let params = json!({ "type": "mouseWheel", "x": at[0], "y": at[1], "deltaX": 0, "deltaY": down });
        self.of(window, "Input.dispatchMouseEvent", params);
    }

    /// Clicks in the middle of an element.
    pub fn press(&mut self, window: &Window, id: &str) {
        let place = self.ask(
            window,
            &format!("(r => [r.left + r.width / 2, r.top + r.height / 2])(document.getElementById('{id}').getBoundingClientRect())"),
        );
        self.click(window, [place[0].as_f64().unwrap(), place[1].as_f64().unwrap()]);
    }

    /// Keeps a picture of the page.
    pub fn picture(&mut self, window: &Window, path: &Path) {
        let data = self.of(window, "Page.captureScreenshot", json!({ "format": "png" }))["data"].clone();
        std::fs::write(path, base64(data.as_str().unwrap())).unwrap();
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn base64(text: &str) -> Vec<u8> {
    let value = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let digits: Vec<u32> = text.bytes().filter(|c| *c != b'=').map(|c| u32::from(value(c))).collect();
    let mut bytes = Vec::with_capacity(digits.len() * 3 / 4);
    for four in digits.chunks(4) {
        let bits = four.iter().enumerate().fold(0, |sum, (k, digit)| sum | (digit << (18 - 6 * k)));
        bytes.extend((0..four.len() - 1).map(|k| (bits >> (16 - 8 * k)) as u8));
    }
    bytes
}
