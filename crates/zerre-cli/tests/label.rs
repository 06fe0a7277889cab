//! `zerre label`: a whole job, clicked through in a browser by two operators at once, and what is refused.

mod browser;

use browser::{Browser, Window};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use zerre_vision::Image;
use zerre_vision::frames::folder::{frame, png};
use zerre_web::label::{Desk, Job, Store};

/// Pixels of the made pictures; a page of 1280 x 800 shows them at a whole factor.
const SIZE: [usize; 2] = [96, 64];
const FRAMES: usize = 8;

/// An empty folder of the test's own.
fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("label-{name}"));
    let _ = fs::remove_dir_all(&path);
    fs::create_dir_all(&path).unwrap();
    path
}

/// Where the object is in a frame, px: the middle of a pixel.
fn truth(frame: usize) -> [f64; 2] {
    [20.5 + 5.0 * frame as f64, 30.5 + 2.0 * frame as f64]
}

/// A folder `clip` of pictures with a bright square about the truth.
fn pictures(inside: &Path, count: usize) {
    let path = inside.join("clip");
    fs::create_dir_all(&path).unwrap();
    for frame in 0..count {
        let [cx, cy] = truth(frame);
        let picture = Image::from_fn(SIZE[0], SIZE[1], |x, y| {
            let near = (x as f64 + 0.5 - cx).abs() < 3.0 && (y as f64 + 0.5 - cy).abs() < 3.0;
            if near { [240, 200, 60] } else { [(x * 5 % 61) as u8 + 30, 70, (y * 7 % 53) as u8 + 40] }
        });
        fs::write(path.join(format!("{:04}.png", frame + 1)), png(&picture).unwrap()).unwrap();
    }
}

fn command(inside: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_zerre"));
    command.current_dir(inside).args(line.split_whitespace());
    command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY").stdin(Stdio::null());
    command
}

/// A running `zerre label`.
struct Server {
    process: Child,
    lines: std::io::Lines<BufReader<std::process::ChildStderr>>,
    address: String,
}

impl Server {
    fn start(inside: &Path, line: &str) -> Server {
        let mut process =
            command(inside, line).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(process.stderr.take().unwrap()).lines();
        let mut said = Vec::new();
        let address = loop {
            let Some(Ok(line)) = lines.next() else { panic!("it ended: {}", said.join("\n")) };
            if let Some((_, address)) = line.split_once("http://") {
                break format!("http://{address}");
            }
            said.push(line);
        };
        Server { process, lines, address }
    }

    fn signal(&self, name: &str) {
        let id = self.process.id().to_string();
        assert!(Command::new("kill").args([name, &id]).status().unwrap().success());
    }

    /// Ctrl-C; gives the exit code, standard output and what was said meanwhile.
    fn stop(mut self) -> (Option<i32>, String, String) {
        self.signal("-INT");
        let said = self.lines.map_while(Result::ok).collect::<Vec<_>>().join("\n");
        let mut out = String::new();
        self.process.stdout.take().unwrap().read_to_string(&mut out).unwrap();
        (self.process.wait().unwrap().code(), out, said)
    }

    fn kill(mut self) {
        self.signal("-KILL");
        self.process.wait().unwrap();
    }
}

fn enter(browser: &mut Browser, window: &Window, name: &str) {
    browser
        .wait(window, "document.getElementById('login').open && document.activeElement.id === 'name-field'");
    browser.type_text(window, name);
    browser.key(window, "Enter", 0);
}

fn begin(browser: &mut Browser, window: &Window, name: &str) {
    enter(browser, window, name);
    at_work(browser, window);
}

fn at_work(browser: &mut Browser, window: &Window) {
    browser
        .wait(window, "!document.getElementById('app').inert && document.getElementById('curtain').hidden");
    browser.wait_text(window, "count", "answered");
    shown(browser, window);
}

/// Waits for two pictures on the screen, so that the frame is drawn.
fn shown(browser: &mut Browser, window: &Window) {
    browser.ask(window, "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))");
}

fn on_frame(browser: &mut Browser, window: &Window, number: usize) {
    browser.wait_text(window, "number", &format!("{number} / "));
    shown(browser, window);
}

/// Clicks on a place of the picture, which is shown whole at the largest whole factor, in the middle of its
/// room.
fn click(browser: &mut Browser, window: &Window, place: [f64; 2]) {
    let room = browser.ask(
        window,
        "(r => [r.left, r.top, r.width, r.height])(document.getElementById('picture').getBoundingClientRect())",
    );
    let room: Vec<f64> = room.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    let scale = (room[2] / SIZE[0] as f64).min(room[3] / SIZE[1] as f64).floor();
    let at = [0, 1].map(|k| {
        let free = room[2 + k] - SIZE[k] as f64 * scale;
        // The pointer names the pixel of the screen whose middle the place is nearest to.
        (room[k] + (free / 2.0).round() + place[k] * scale - 0.5).round()
    });
    browser.click(window, at);
}

fn saved(browser: &mut Browser, window: &Window) {
    browser.wait(window, "document.getElementById('saved-text').textContent === 'All saved'");
}

type Labels = BTreeMap<(String, String), Option<[f64; 2]>>;

fn labels(text: &str) -> Labels {
    assert!(text.starts_with("frame,operator,point,x,y,visible\n"), "{text}");
    text.lines()
        .skip(1)
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            let place = (cells[5] == "1").then(|| [cells[3].parse().unwrap(), cells[4].parse().unwrap()]);
            ((cells[0].to_owned(), cells[1].to_owned()), place)
        })
        .collect()
}

fn of(labels: &Labels, frame: usize, who: &str) -> Option<Option<[f64; 2]>> {
    labels.get(&(format!("{frame:04}.png"), who.to_owned())).copied()
}

fn near(found: Option<Option<[f64; 2]>>, place: [f64; 2]) {
    let found = found.flatten().unwrap();
    // A pixel of the screen is a tenth of one of the picture.
    assert!((0..2).all(|k| (found[k] - place[k]).abs() < 0.1), "{found:?} instead of {place:?}");
}

/// Ann works with the mouse, Bob with the keys alone; the server is killed in the middle.
#[test]
fn two_operators_mark_a_whole_job_and_a_killed_server_loses_nothing() {
    let here = folder("job");
    let Some(mut browser) = Browser::start(&here.join("profile")) else { return };
    pictures(&here, FRAMES);
    let line = "label clip --out out";
    let server = Server::start(&here, line);
    let address = server.address.clone();
    let ann = browser.open(&address, false);
    let bob = browser.open(&address, true);

    // Nobody begins without a name.
    browser.wait(&ann, "document.getElementById('login').open");
    browser.key(&ann, "Enter", 0);
    browser.wait_text(&ann, "login-problem", "Please give a name");
    begin(&mut browser, &ann, "Ann");
    begin(&mut browser, &bob, "Bob");
    // The picture has the keys, and Tab goes on to the buttons in their order.
    assert_eq!(browser.ask(&bob, "document.activeElement.id"), "picture");
    let mut order = Vec::new();
    for _ in 0..4 {
        browser.key(&bob, "Tab", 0);
        order.push(browser.ask(&bob, "document.activeElement.id").as_str().unwrap().to_owned());
    }
    assert_eq!(order, ["mark", "hide", "zoom-out", "zoom-in"], "nothing can be undone yet");
    browser.ask(&bob, "document.getElementById('picture').focus()");

    // The mouse: three marks, one of them wrong, undone and given again.
    for frame in 0..2 {
        click(&mut browser, &ann, truth(frame));
        on_frame(&mut browser, &ann, frame + 2);
    }
    click(&mut browser, &ann, [80.5, 10.5]);
    on_frame(&mut browser, &ann, 4);
    browser.key(&ann, "z", 2);
    on_frame(&mut browser, &ann, 3);
    browser.wait_text(&ann, "count", "2 of 8 answered");
    click(&mut browser, &ann, truth(2));
    on_frame(&mut browser, &ann, 4);
    saved(&mut browser, &ann);
    browser.picture(&ann, &here.join("light.png"));

    // The keys: from the middle of the picture, which is (48.5, 32.5), to a pixel beside the truth.
    for _ in 0..2 {
        browser.key(&bob, "ArrowLeft", 8);
    }
    for _ in 0..7 {
        browser.key(&bob, "ArrowLeft", 0);
    }
    browser.key(&bob, "ArrowUp", 0);
    browser.wait_text(&bob, "place", "x 21.50   y 31.50");
    browser.key(&bob, "Enter", 0);
    on_frame(&mut browser, &bob, 2);
    for frame in 1..4 {
        (0..5).for_each(|_| browser.key(&bob, "ArrowRight", 0));
        (0..2).for_each(|_| browser.key(&bob, "ArrowDown", 0));
        browser.key(&bob, " ", 0);
        on_frame(&mut browser, &bob, frame + 2);
    }
    // He goes back, looks, and on to the next frame without an answer; and looks at the keys.
    browser.key(&bob, "Home", 0);
    on_frame(&mut browser, &bob, 1);
    browser.key(&bob, "?", 0);
    browser.wait(&bob, "document.getElementById('help').open");
    browser.picture(&bob, &here.join("help.png"));
    browser.key(&bob, "Escape", 0);
    browser.wait(&bob, "!document.getElementById('help').open");
    browser.key(&bob, "j", 0);
    on_frame(&mut browser, &bob, 5);
    saved(&mut browser, &bob);
    browser.picture(&bob, &here.join("dark.png"));
    // Blind: nothing of Ann's reaches Bob.
    let seen = browser.ask(&bob, "document.body.innerText + JSON.stringify(localStorage)");
    assert!(!seen.as_str().unwrap().contains("Ann"), "{seen}");

    // The server dies; both go on, and are told.
    server.kill();
    click(&mut browser, &ann, truth(3));
    on_frame(&mut browser, &ann, 5);
    browser.key(&bob, "n", 0);
    for window in [&ann, &bob] {
        browser.wait_text(
            window,
            "saved-text",
            "The server does not answer: 1 answer not saved yet, kept in this browser",
        );
    }
    browser.picture(&ann, &here.join("silent.png"));
    // Frames that were fetched ahead are still there.
    click(&mut browser, &ann, truth(4));
    browser.wait_text(&ann, "saved-text", "2 answers not saved yet");

    let server = Server::start(&here, line);
    assert_eq!(server.address, address, "the same page after a restart");
    saved(&mut browser, &ann);
    saved(&mut browser, &bob);
    at_work(&mut browser, &ann);

    // Bob's browser crashes with him; in another one he is asked whether it is he.
    let other = browser.open(&address, true);
    enter(&mut browser, &other, "bob");
    browser.wait_text(&other, "login-problem", "Bob is at work in another window");
    browser.key(&other, "Enter", 0);
    at_work(&mut browser, &other);
    browser.wait_text(&other, "count", "5 of 8 answered");
    on_frame(&mut browser, &other, 6);
    browser.key(&bob, "n", 0);
    browser.wait(&bob, "document.getElementById('taken').open");
    browser.wait_text(&bob, "taken-text", "1 answer not saved yet");
    browser.picture(&bob, &here.join("taken.png"));
    // He takes his first window back, and what it kept is saved.
    browser.press(&bob, "taken-back");
    at_work(&mut browser, &bob);
    saved(&mut browser, &bob);
    browser.wait_text(&bob, "count", "6 of 8 answered");
    browser.wait(&other, "document.getElementById('taken').open");
    browser.key(&bob, "u", 0);
    browser.wait_text(&bob, "count", "5 of 8 answered");

    // A reload keeps everything; Ann is asked whether it is she.
    browser.go(&ann, &address);
    browser.wait(&ann, "document.getElementById('name-field').value === 'Ann'");
    browser.press(&ann, "begin");
    browser.wait_text(&ann, "login-problem", "Ann");
    browser.press(&ann, "take-over");
    at_work(&mut browser, &ann);
    browser.wait_text(&ann, "count", "5 of 8 answered");
    on_frame(&mut browser, &ann, 6);
    for frame in 5..FRAMES {
        click(&mut browser, &ann, truth(frame));
    }
    browser.wait_text(&ann, "done", "All 8 frames are answered. Thank you, Ann!");
    saved(&mut browser, &ann);
    // Her own table, as the export button gives it.
    browser.ask(&ann, "window.text = null; URL.createObjectURL = blob => { blob.text().then(t => { window.text = t; }); return 'data:,'; }");
    browser.press(&ann, "export");
    browser.wait(&ann, "window.text");
    let export = browser.ask(&ann, "window.text");
    let own = labels(export.as_str().unwrap());
    assert_eq!(own.len(), FRAMES);
    browser.picture(&ann, &here.join("done.png"));
    let login = browser.open(&address, false);
    browser.wait(&login, "document.getElementById('login').open");
    browser.picture(&login, &here.join("login.png"));

    // Bob looks closer: wheel, drag, and back; the crosshair stays where it is in the picture.
    browser.wait(&bob, "!document.getElementById('app').inert");
    on_frame(&mut browser, &bob, 6);
    browser.wheel(&bob, [400.0, 300.0], -400.0);
    browser.wait(&bob, "parseFloat(document.getElementById('zoom').textContent) > 20");
    browser.drag(&bob, [400.0, 300.0], [460.0, 340.0]);
    browser.picture(&bob, &here.join("zoomed.png"));
    browser.wait_text(&bob, "count", "5 of 8 answered");
    browser.key(&bob, "0", 0);
    for frame in 5..FRAMES {
        let [x, y] = truth(frame);
        click(&mut browser, &bob, [x + 1.0, y + 1.0]);
    }
    browser.wait_text(&bob, "count", "8 of 8 answered");
    saved(&mut browser, &bob);

    let (code, out, said) = server.stop();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("Ann has answered all of 8 frames") && said.contains("are in out"), "{said}");
    assert!(out.contains("ICC(A,1)") && out.contains("Bob"), "{out}");
    let all = labels(&fs::read_to_string(here.join("out/labels.csv")).unwrap());
    assert_eq!(all.len(), 2 * FRAMES);
    for frame in 0..FRAMES {
        near(of(&all, frame + 1, "Ann"), truth(frame));
        assert_eq!(of(&own, frame + 1, "Ann"), of(&all, frame + 1, "Ann"), "export and table agree");
        let [x, y] = truth(frame);
        match frame {
            4 => assert_eq!(of(&all, 5, "Bob"), Some(None)),
            _ => near(of(&all, frame + 1, "Bob"), [x + 1.0, y + 1.0]),
        }
    }
    // The keys hit the very middle of a pixel.
    assert_eq!(of(&all, 2, "Bob"), Some(Some([26.5, 33.5])));
    check_tables(&here);
}

/// Ann is on the truth and Bob a pixel to the right of and below it: everything else follows.
fn check_tables(here: &Path) {
    let read = |name: &str| fs::read_to_string(here.join("out").join(name)).unwrap();
    let reference = read("reference.csv");
    assert_eq!(reference.lines().count(), FRAMES + 1, "{reference}");
    for (frame, line) in reference.lines().skip(1).enumerate() {
        let cells: Vec<&str> = line.split(',').collect();
        let [x, y, error] = [2, 3, 4].map(|k| cells[k].parse::<f64>().unwrap_or(f64::NAN));
        let [tx, ty] = truth(frame);
        if frame == 4 {
            assert!(error.is_nan() && cells[5] == "1", "{line}");
            continue;
        }
        // Half of the distance over sqrt 2, which is half a pixel; marks are good to a tenth.
        assert!(
            (x - tx - 0.5).abs() < 0.1 && (y - ty - 0.5).abs() < 0.1 && (error - 0.5).abs() < 0.1,
            "{line}"
        );
    }
    let statistics = read("agreement.csv");
    let value = |who: &str, name: &str| -> f64 {
        let start = format!("hand,{who},{name},");
        let line = statistics.lines().find(|line| line.starts_with(&start)).unwrap();
        line[start.len()..].split(',').next().unwrap().parse().unwrap()
    };
    assert!((value("Bob", "bias_x_px") - 1.0).abs() < 0.1 && (value("Ann", "bias_y_px") + 1.0).abs() < 0.1);
    assert!(value("", "icc_x") > 0.98 && value("", "icc_frames") == 7.0);
    assert!((value("Ann", "same_visibility") - 7.0 / 8.0).abs() < 1e-9);
    assert!(read("again.csv").lines().any(|line| line == "0005.png,hand,,,1,1"), "{}", read("again.csv"));
    let page = read("report.html");
    assert!(
        page.contains("Bias of each operator")
            && page.contains("1 see it, 1 do not")
            && !page.contains("NaN")
    );
    let record: Value = serde_json::from_str(&read("run.json")).unwrap();
    assert_eq!((&record["state"], &record["counts"]["used"]), (&"complete".into(), &FRAMES.into()));
    let files: Vec<_> = record["files"].as_array().unwrap().iter().map(|f| f.as_str().unwrap()).collect();
    assert_eq!(files, ["again.csv", "agreement.csv", "labels.csv", "reference.csv", "report.html"]);
}

/// The disk is full in the middle of two points a frame: it is said, the page keeps what it has, and saves it
/// later.
#[test]
fn a_full_disk_is_said_and_nothing_is_lost() {
    let here = folder("full");
    let Some(mut browser) = Browser::start(&here.join("profile")) else { return };
    pictures(&here, 3);
    let store = Arc::new(Mutex::new(Store::open(&here.join("labels.sqlite")).unwrap()));
    let job = Job {
        title: "clip".to_owned(),
        input: "made".to_owned(),
        points: vec!["hand".to_owned(), "elbow".to_owned()],
        frames: (1..=3).map(|k| format!("{k:04}.png")).collect(),
        size: SIZE,
    };
    let clip = here.join("clip");
    let picture = move |number: usize| {
        let path = clip.join(format!("{:04}.png", number + 1));
        Ok(("image/png", fs::read(path).map_err(|error| error.to_string())?))
    };
    let desk = Desk::new(job.clone(), Arc::clone(&store), picture, |_: &str| {}).unwrap().open(None).unwrap();
    let address = desk.address.clone();
    let (stop, done) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
    let asked = Arc::clone(&stop);
    let ended = Arc::clone(&done);
    let server = std::thread::spawn(move || {
        desk.serve(move || asked.load(Ordering::Relaxed)).unwrap();
        ended.store(true, Ordering::Relaxed);
    });

    let ann = browser.open(&address, false);
    begin(&mut browser, &ann, "Ann");
    // Two points a frame: after the first comes the second, then the next frame; a number chooses.
    browser.key(&ann, "Enter", 0);
    browser.wait(&ann, "document.getElementById('point-1').checked");
    browser.key(&ann, "1", 0);
    browser.wait(&ann, "document.getElementById('point-0').checked");
    browser.key(&ann, "2", 0);
    browser.key(&ann, "ArrowRight", 0);
    browser.key(&ann, "Enter", 0);
    on_frame(&mut browser, &ann, 2);
    saved(&mut browser, &ann);
    browser.picture(&ann, &here.join("points.png"));

    store.lock().unwrap().limit_pages(1).unwrap();
    let mut answers = 2;
    while browser.ask(&ann, "document.getElementById('saved').dataset.state") != "bad" {
        browser.key(&ann, "Enter", 0);
        answers += 1;
        assert!(answers < 1000, "the disk is not full");
    }
    browser.wait_text(
        &ann,
        "saved-text",
        "The marks cannot be saved: the disk is full. They are kept in this browser",
    );
    browser.key(&ann, "Enter", 0);
    browser.picture(&ann, &here.join("full.png"));
    // A reload in the worst moment: what was not saved waits in the browser.
    browser.go(&ann, &address);
    browser.wait(&ann, "document.getElementById('name-field').value === 'Ann'");
    browser.press(&ann, "begin");
    browser.wait_text(&ann, "login-problem", "Ann");
    browser.press(&ann, "take-over");
    at_work(&mut browser, &ann);
    browser.wait_text(
        &ann,
        "saved-text",
        "answers not saved yet. The marks cannot be saved: the disk is full",
    );
    store.lock().unwrap().limit_pages(100_000).unwrap();
    saved(&mut browser, &ann);
    let login = "fetch('login', { method: 'POST', body: JSON.stringify({ name: 'Ann', take_over: true }) })
        .then(answer => answer.json()).then(login => login.events.length)";
    assert_eq!(browser.ask(&ann, login), answers + 1, "every key counts");
    let found = store.lock().unwrap().answers(&job).unwrap();
    assert_eq!(found.answers[0][0][0], Some(Some([48.5, 32.5])));
    assert_eq!(found.answers[1][0][0], Some(Some([49.5, 32.5])));
    stop.store(true, Ordering::Relaxed);
    server.join().unwrap();
    assert!(done.load(Ordering::Relaxed));
}

/// Asks the page's server; gives the body.
fn get(server: &Server, path: &str) -> Vec<u8> {
    let (host, key) = server.address.strip_prefix("http://").unwrap().split_once('/').unwrap();
    let key = key.split('/').next().unwrap();
    let mut stream = TcpStream::connect(host).unwrap();
    write!(stream, "GET /{key}/{path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n").unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let body = answer.windows(4).position(|four| four == b"\r\n\r\n").unwrap() + 4;
    answer.split_off(body)
}

#[test]
fn every_second_frame_of_a_video_and_operators_who_label_nothing() {
    if let Err(error) = zerre_vision::frames::ffmpeg::installed("test") {
        assert!(std::env::var_os("CI").is_none_or(|ci| ci != "true"), "{error}");
        eprintln!("SKIPPED: {error}");
        return;
    }
    let here = folder("video");
    pictures(&here, 7);
    let made = Command::new("ffmpeg")
        .args(["-v", "error", "-framerate", "10", "-i", "clip/%04d.png", "-c:v", "png", "clip.mkv"])
        .current_dir(&here)
        .status();
    assert!(made.unwrap().success());
    let line = "label clip.mkv --every 2";
    let server = Server::start(&here, line);
    let job: Value = serde_json::from_slice(&get(&server, "job")).unwrap();
    assert_eq!(job["frames"], serde_json::json!(["frame 1", "frame 3", "frame 5", "frame 7"]));
    let third = here.join("third.png");
    fs::write(&third, get(&server, "frames/1")).unwrap();
    assert_eq!(
        frame(&third).unwrap(),
        frame(&here.join("clip/0003.png")).unwrap(),
        "the pixels of the video"
    );
    let address = server.address.clone();
    let (code, out, said) = server.stop();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("nobody has marked anything: the tables are empty"), "{said}");
    assert!(out.starts_with("point") && out.contains("ICC(A,1) x unknown"), "{out}");
    let table = fs::read_to_string(here.join("out/label-clip/labels.csv")).unwrap();
    assert_eq!(table, "frame,operator,point,x,y,visible\n");
    let record: Value =
        serde_json::from_str(&fs::read_to_string(here.join("out/label-clip/run.json")).unwrap()).unwrap();
    assert_eq!(record["state"], "interrupted");

    // Somebody logs in and marks nothing; the frames, which were lost, come again.
    fs::remove_dir_all(here.join("out/label-clip/frames")).unwrap();
    let server = Server::start(&here, &format!("{line} --json --resume"));
    assert_eq!(server.address, address);
    let (host, key) = server.address.strip_prefix("http://").unwrap().split_once('/').unwrap();
    let mut stream = TcpStream::connect(host).unwrap();
    let body = r#"{"name":"Zoe"}"#;
    let head = format!("Host: {host}\r\nConnection: close\r\nContent-Length: {}", body.len());
    write!(stream, "POST /{key}login HTTP/1.1\r\n{head}\r\n\r\n{body}").unwrap();
    stream.read_to_end(&mut Vec::new()).unwrap();
    assert_eq!(get(&server, "frames/1"), fs::read(&third).unwrap());
    let (code, out, said) = server.stop();
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("Zoe has answered nothing and is left out"), "{said}");
    let document: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(
        (&document["idle"], &document["operators"]),
        (&serde_json::json!(["Zoe"]), &serde_json::json!([]))
    );
}

/// Who asks for quiet still hears where the page is, and that Ctrl-C was heard.
#[test]
fn quiet_leaves_the_address() {
    let here = folder("quiet");
    pictures(&here, 2);
    let mut process =
        command(&here, "label clip --quiet").stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(process.stderr.take().unwrap()).lines();
    let address = lines.next().unwrap().unwrap();
    assert!(address.starts_with("http://127.0.0.1:") && !address.contains(' '), "{address}");
    let server = Server { process, lines, address };
    let job: Value = serde_json::from_slice(&get(&server, "job")).unwrap();
    assert_eq!(job["frames"].as_array().unwrap().len(), 2);
    server.signal("-INT");
    let Server { mut process, lines, .. } = server;
    let said: Vec<_> = lines.map_while(Result::ok).collect();
    assert!(said.iter().all(|line| line.starts_with("stopping after this step")), "{said:?}");
    assert_eq!(process.wait().unwrap().code(), Some(0));
}

/// Runs to its refusal; gives what was said.
fn refused(inside: &Path, line: &str, code: i32) -> String {
    let output = command(inside, line).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{line}: {said}");
    assert!(!said.contains("met a bug"), "{said}");
    said
}

#[test]
fn bad_input_is_refused_and_marks_are_never_in_danger() {
    let here = folder("refused");
    pictures(&here, 4);
    fs::create_dir(here.join("empty")).unwrap();
    fs::create_dir(here.join("full")).unwrap();
    fs::write(here.join("full/notes.txt"), "mine").unwrap();
    fs::write(here.join("no.mp4"), "no video").unwrap();
    let taken = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let port = taken.local_addr().unwrap().port();
    for (line, code, says) in [
        ("label nowhere", 1, "neither a folder of pictures nor a video file"),
        ("label empty", 1, "there is no picture"),
        ("label clip --point a --point a", 2, "the point a is named twice"),
        ("label clip --point =x", 2, "`=x` cannot be the name of a point"),
        ("label clip --out clip --force", 1, "holds the input"),
        ("label clip --out full", 1, "is not empty"),
        (&format!("label clip --port {port}"), 1, &format!("cannot listen on port {port}")),
    ] {
        let said = refused(&here, line, code);
        assert!(said.contains(says), "{line}: {said}");
    }
    if zerre_vision::frames::ffmpeg::installed("test").is_ok() {
        assert!(refused(&here, "label no.mp4", 1).contains("there is no video in it"));
    }
    // One picture is broken and one is of another size: both are left out, and said.
    fs::write(here.join("clip/0002.png"), "no picture").unwrap();
    fs::write(here.join("clip/0003.png"), png(&Image::filled(20, 20, [0; 3])).unwrap()).unwrap();
    let server = Server::start(&here, "label clip --out job");
    let job: Value = serde_json::from_slice(&get(&server, "job")).unwrap();
    assert_eq!(job["frames"], serde_json::json!(["0001.png", "0004.png"]));
    let marks = here.join("job/labels.sqlite");
    assert!(refused(&here, "label clip --out job", 1).contains("another run is writing to job"));
    let (code, _, _) = server.stop();
    assert_eq!(code, Some(0));
    let record: Value =
        serde_json::from_str(&fs::read_to_string(here.join("job/run.json")).unwrap()).unwrap();
    assert_eq!(record["counts"]["rejected"]["unreadable frame"], 2);
    let before = fs::read(&marks).unwrap();
    for (line, says) in [
        ("label clip --out job --point elbow", "another job: its points are hand, not elbow"),
        ("label clip --out job --every 2", "they have changed since"),
    ] {
        let said = refused(&here, line, 1);
        assert!(said.contains(says) && said.contains("the marks in it are safe"), "{line}: {said}");
    }
    // A table of marks without their file is not written over.
    let aside = here.join("aside.sqlite");
    fs::rename(&marks, &aside).unwrap();
    fs::write(here.join("job/labels.csv"), "frame,operator,point,x,y,visible\n0001.png,Ann,hand,1.5,2.5,1\n")
        .unwrap();
    assert!(refused(&here, "label clip --out job", 1).contains("has marks whose file labels.sqlite is gone"));
    fs::rename(&aside, &marks).unwrap();
    // Another command with --force replaces its like, but never marks.
    let output = command(&here, "simulate radar-cv --out job --force").output().unwrap();
    assert!(output.status.success());
    assert!(!here.join("job/labels.csv").exists() && fs::read(&marks).unwrap() == before);
    fs::write(&marks, "no database at all, but long enough for a header of one hundred bytes".repeat(20))
        .unwrap();
    assert!(refused(&here, "label clip --out job --force", 1).contains("labels.sqlite: it is no database"));
}
