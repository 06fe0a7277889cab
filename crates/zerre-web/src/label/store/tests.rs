use super::*;
use std::fs;

fn fresh(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("zerre-store-{}-{name}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder.join("labels.sqlite")
}

fn job() -> Job {
    Job {
        title: "clip".to_owned(),
        input: "abc".to_owned(),
        points: vec!["hand".to_owned(), "elbow".to_owned()],
        frames: (1..=3).map(|k| format!("frame {k}")).collect(),
        size: [64, 48],
    }
}

fn begun(name: &str) -> Store {
    let mut store = Store::open(&fresh(name)).unwrap();
    store.begin(&job()).unwrap();
    store
}

fn mark(id: &str, frame: usize, x: f64) -> Event {
    Event { id: id.to_owned(), what: What::Mark { frame, point: 0, x, y: 2.5 } }
}

fn undo(id: &str, undoes: &str) -> Event {
    Event { id: id.to_owned(), what: What::Undo { undoes: undoes.to_owned() } }
}

#[test]
fn the_last_answer_that_was_not_undone_holds() {
    let mut store = begun("holds");
    let ann = store.enter("Ann", "s1").unwrap();
    let hidden = Event { id: "d".to_owned(), what: What::Hidden { frame: 1, point: 1 } };
    let events = [mark("a", 0, 1.5), mark("b", 0, 2.5), mark("c", 2, 63.0), hidden, undo("e", "b")];
    let appended = store.append(ann.id, &events, &job()).unwrap();
    assert_eq!((appended.saved.len(), appended.refused.len()), (5, 0));
    let path = store.path().to_owned();
    drop(store);
    let store = Store::open(&path).unwrap();
    assert_eq!(store.events(ann.id).unwrap(), events, "as they were sent");
    let answers = store.answers(&job()).unwrap();
    assert_eq!(answers.operators, ["Ann"]);
    assert_eq!(answers.answers[0][0], [Some(Some([1.5, 2.5])), None, Some(Some([63.0, 2.5]))]);
    assert_eq!(answers.answers[1][0], [None, Some(None), None]);
    assert_eq!(store.job().unwrap(), Some(job()));
}

#[test]
fn an_event_counts_once_and_nonsense_not_at_all() {
    let mut store = begun("once");
    let ann = store.enter("Ann", "s").unwrap();
    let bob = store.enter("Bob", "t").unwrap();
    for _ in 0..2 {
        assert_eq!(store.append(ann.id, &[mark("a", 0, 1.5)], &job()).unwrap().saved, ["a"]);
    }
    assert_eq!(store.events(ann.id).unwrap().len(), 1);
    let long = "x".repeat(65);
    let nonsense = [
        mark("outside", 0, 64.5),
        mark("nan", 0, f64::NAN),
        mark("late", 3, 1.0),
        mark("", 0, 1.0),
        mark(&long, 0, 1.0),
        undo("nothing", "zzz"),
        Event { id: "point".to_owned(), what: What::Hidden { frame: 0, point: 2 } },
    ];
    let appended = store.append(ann.id, &nonsense, &job()).unwrap();
    assert_eq!((appended.saved.len(), appended.refused.len()), (0, nonsense.len()), "{appended:?}");
    // Nobody undoes the marks of another.
    assert_eq!(store.append(bob.id, &[undo("u", "a")], &job()).unwrap().refused.len(), 1);
    assert!(
        store.connection.execute("DELETE FROM events", []).unwrap_err().to_string().contains("never deleted")
    );
    assert!(
        store
            .connection
            .execute("UPDATE events SET x = 0", [])
            .unwrap_err()
            .to_string()
            .contains("never changed")
    );
    assert_eq!(store.events(ann.id).unwrap(), [mark("a", 0, 1.5)]);
}

#[test]
fn a_new_session_ends_the_earlier_one() {
    let mut store = begun("session");
    let ann = store.enter("Ann", "first").unwrap();
    assert_eq!(store.enter("ANN", "second").unwrap(), ann, "one operator however it is written");
    assert_eq!(store.of_session("first").unwrap(), None);
    assert_eq!(store.of_session("second").unwrap(), Some(ann.clone()));
    assert_eq!((store.find("aNN").unwrap(), store.find("Bob").unwrap()), (Some(ann), None));
}

/// What was saved before the disk was full stays, what was not is refused whole, and all is well with more
/// room.
#[test]
fn a_full_disk_loses_nothing() {
    let mut store = begun("full");
    let ann = store.enter("Ann", "s").unwrap();
    let pages: u32 = store.connection.query_row("PRAGMA page_count", [], |row| row.get(0)).unwrap();
    store.limit_pages(pages + 1).unwrap();
    let batch = |k: usize| -> Vec<Event> { (0..20).map(|i| mark(&format!("{k}-{i}"), 0, 1.0)).collect() };
    let mut saved = 0;
    let error = loop {
        match store.append(ann.id, &batch(saved), &job()) {
            Ok(_) => saved += 1,
            Err(error) => break error,
        }
        assert!(saved < 1000, "the limit does not hold");
    };
    assert_eq!(words(&error), "the disk is full");
    assert!(saved > 0);
    assert_eq!(store.events(ann.id).unwrap().len(), 20 * saved);
    store.limit_pages(pages + 100).unwrap();
    assert_eq!(store.append(ann.id, &batch(saved), &job()).unwrap().saved.len(), 20);
    assert_eq!(store.events(ann.id).unwrap().len(), 20 * (saved + 1));
}

#[test]
fn files_of_others_are_left_alone() {
    let mut store = begun("others");
    let differs = |change: &dyn Fn(&mut Job)| {
        let mut other = job();
        change(&mut other);
        job().difference(&other).unwrap()
    };
    assert!(differs(&|job| job.input = "x".to_owned()).contains("pictures are those of clip"));
    assert!(differs(&|job| job.points.truncate(1)).contains("points are hand, elbow, not hand"));
    assert!(differs(&|job| job.frames.truncate(2)).contains("3 of 64 x 48"));
    assert!(matches!(store.begin(&Job { input: "x".to_owned(), ..job() }), Err(Error::OtherJob { .. })));
    let (path, key) = (store.path().to_owned(), store.key().unwrap());
    store.set_port(8123).unwrap();
    drop(store);
    let store = Store::open(&path).unwrap();
    assert_eq!((store.key().unwrap(), store.port().unwrap()), (key, Some(8123)));
    let foreign = fresh("foreign");
    Connection::open(&foreign).unwrap().execute_batch("CREATE TABLE t (a)").unwrap();
    assert!(Store::open(&foreign).unwrap_err().to_string().contains("of another program"));
    fs::write(&foreign, "no database at all, but long enough for a header of one hundred bytes".repeat(20))
        .unwrap();
    assert!(Store::open(&foreign).unwrap_err().to_string().contains("no database"));
}
