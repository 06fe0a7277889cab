//! The file with the marks: SQLite, every mark a row that is never changed.
//!
//! A commit is on the disk before it is acknowledged (`synchronous = FULL`), so that what the browser shows
//! as saved survives a crash of the program and of the machine.

use super::{Answer, Event, Job, What};
use crate::{Error, Result};
use rusqlite::{Connection, ErrorCode, OptionalExtension, Transaction, TransactionBehavior, params};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// What the file is for, in its header: "zerL".
const APPLICATION: i32 = 0x7a65_724c;

const SCHEMA: &str = "
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT;
CREATE TABLE operators (
    id INTEGER PRIMARY KEY, name TEXT NOT NULL, folded TEXT NOT NULL UNIQUE, session TEXT NOT NULL
) STRICT;
-- A mark has a place, a point that cannot be seen has none, an undo names the row that no longer holds.
CREATE TABLE events (
    id INTEGER PRIMARY KEY,
    operator INTEGER NOT NULL REFERENCES operators,
    client TEXT NOT NULL,
    frame INTEGER, point INTEGER, x REAL, y REAL,
    undoes INTEGER REFERENCES events,
    unix_ms INTEGER NOT NULL,
    UNIQUE (operator, client),
    CHECK ((undoes IS NULL) = (frame IS NOT NULL) AND (frame IS NULL) = (point IS NULL)),
    CHECK ((x IS NULL) = (y IS NULL) AND (x IS NULL OR undoes IS NULL))
) STRICT;
CREATE TRIGGER events_stay BEFORE UPDATE ON events BEGIN SELECT RAISE(ABORT, 'marks are never changed'); END;
CREATE TRIGGER events_remain BEFORE DELETE ON events BEGIN SELECT RAISE(ABORT, 'marks are never deleted'); END;
";

/// The file.
#[derive(Debug)]
pub struct Store {
    path: PathBuf,
    connection: Connection,
}

/// Who is at work.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Operator {
    /// Number in the file.
    pub id: i64,
    /// Name as first given.
    pub name: String,
}

/// What became of events.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Appended {
    /// Those that are on the disk, by the browser's names.
    pub saved: Vec<String>,
    /// Those that mean nothing, and why.
    pub refused: Vec<(String, String)>,
}

/// All answers of a job.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answers {
    /// Operators in the order of their names.
    pub operators: Vec<String>,
    /// By point, then by operator, then by frame.
    pub answers: Vec<Vec<Vec<Option<Answer>>>>,
}

impl Store {
    /// Opens the file, making it where it is absent.
    ///
    /// # Errors
    /// A file that is something else, a disk that refuses.
    pub fn open(path: &Path) -> Result<Store> {
        let refuse = |problem: String| Error::Store { path: path.to_owned(), problem };
        let sql = |error: rusqlite::Error| refuse(words(&error));
        let mut connection = Connection::open(path).map_err(sql)?;
        connection.busy_timeout(Duration::from_secs(5)).map_err(sql)?;
        let kind: i32 = connection.query_row("PRAGMA application_id", [], |row| row.get(0)).map_err(sql)?;
        let tables: i64 =
            connection.query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0)).map_err(sql)?;
        if tables > 0 && kind != APPLICATION {
            return Err(refuse("it is a database of another program".to_owned()));
        }
        connection
            .execute_batch("PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON")
            .map_err(sql)?;
        if tables == 0 {
            let key = crate::key()?;
            make(&mut connection, &key).map_err(sql)?;
        }
        Ok(Store { path: path.to_owned(), connection })
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn refuse(&self, error: &rusqlite::Error) -> Error {
        Error::Store { path: self.path.clone(), problem: words(error) }
    }

    /// The word in the page's address, the same for the whole life of the file.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn key(&self) -> Result<String> {
        self.get("key").map(Option::unwrap_or_default)
    }

    /// The port that the page had last.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn port(&self) -> Result<Option<u16>> {
        Ok(self.get("port")?.and_then(|port| port.parse().ok()))
    }

    /// Notes the port.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn set_port(&mut self, port: u16) -> Result<()> {
        set(&self.connection, "port", &port.to_string()).map_err(|error| self.refuse(&error))
    }

    /// The job that the marks are of, if it has begun.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn job(&self) -> Result<Option<Job>> {
        let Some(text) = self.get("job")? else { return Ok(None) };
        let job = serde_json::from_str(&text);
        let problem = |error: serde_json::Error| format!("its description of the job is broken: {error}");
        job.map(Some).map_err(|error| Error::Store { path: self.path.clone(), problem: problem(error) })
    }

    /// Begins the job, or goes on with the same one.
    ///
    /// # Errors
    /// A file with the marks of another job; one that cannot be written.
    pub fn begin(&mut self, job: &Job) -> Result<()> {
        if let Some(known) = self.job()? {
            return match known.difference(job) {
                None => Ok(()),
                Some(difference) => Err(Error::OtherJob { path: self.path.clone(), difference }),
            };
        }
        let text = serde_json::to_string(job)
            .map_err(|error| Error::Store { path: self.path.clone(), problem: error.to_string() })?;
        set(&self.connection, "job", &text).map_err(|error| self.refuse(&error))
    }

    fn get(&self, key: &str) -> Result<Option<String>> {
        self.connection
            .query_row("SELECT value FROM meta WHERE key = ?1", [key], |row| row.get(0))
            .optional()
            .map_err(|error| self.refuse(&error))
    }

    /// The operator of this name, in whatever letters it is written.
    pub(super) fn find(&self, name: &str) -> rusqlite::Result<Option<Operator>> {
        self.connection
            .query_row("SELECT id, name FROM operators WHERE folded = ?1", [name.to_lowercase()], operator)
            .optional()
    }

    /// The operator whose session this is.
    pub(super) fn of_session(&self, session: &str) -> rusqlite::Result<Option<Operator>> {
        self.connection
            .query_row("SELECT id, name FROM operators WHERE session = ?1", [session], operator)
            .optional()
    }

    /// Gives the name a new session; an earlier one ends with it.
    pub(super) fn enter(&mut self, name: &str, session: &str) -> rusqlite::Result<Operator> {
        self.connection.query_row(
            "INSERT INTO operators (name, folded, session) VALUES (?1, ?2, ?3)
             ON CONFLICT (folded) DO UPDATE SET session = ?3 RETURNING id, name",
            params![name, name.to_lowercase(), session],
            operator,
        )
    }

    /// All events of an operator in their order.
    pub(super) fn events(&self, operator: i64) -> rusqlite::Result<Vec<Event>> {
        let mut query = self.connection.prepare(
            "SELECT e.client, e.frame, e.point, e.x, e.y, u.client FROM events e
             LEFT JOIN events u ON u.id = e.undoes WHERE e.operator = ?1 ORDER BY e.id",
        )?;
        let rows = query.query_map([operator], |row| {
            let id = row.get(0)?;
            let what = match (row.get(5)?, row.get(3)?) {
                (Some(undoes), _) => What::Undo { undoes },
                (None, Some(x)) => What::Mark { frame: row.get(1)?, point: row.get(2)?, x, y: row.get(4)? },
                (None, None) => What::Hidden { frame: row.get(1)?, point: row.get(2)? },
            };
            Ok(Event { id, what })
        })?;
        rows.collect()
    }

    /// Puts events on the disk, all or none; those that are there already are saved, too.
    pub(super) fn append(
        &mut self,
        operator: i64,
        events: &[Event],
        job: &Job,
    ) -> rusqlite::Result<Appended> {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let now = i64::try_from(now.as_millis()).unwrap_or(i64::MAX);
        let mut done = Appended::default();
        let transaction = self.connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
        for event in events {
            let target = match &event.what {
                What::Undo { undoes } => number(&transaction, operator, undoes)?,
                _ => None,
            };
            let checked = match (event.row(job), &event.what) {
                (Ok(_), What::Undo { .. }) if target.is_none() => {
                    Err("it undoes what is not there".to_owned())
                }
                (checked, _) => checked,
            };
            let [frame, point] = match checked {
                Ok(row) => row,
                Err(why) => {
                    done.refused.push((event.id.clone(), why));
                    continue;
                }
            };
            let place = event.place();
            transaction.execute(
                "INSERT INTO events (operator, client, frame, point, x, y, undoes, unix_ms)
                 VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8) ON CONFLICT (operator, client) DO NOTHING",
                params![
                    operator,
                    event.id,
                    frame,
                    point,
                    place.map(|p| p[0]),
                    place.map(|p| p[1]),
                    target,
                    now
                ],
            )?;
            done.saved.push(event.id.clone());
        }
        transaction.commit()?;
        Ok(done)
    }

    /// What holds of all that was marked.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn answers(&self, job: &Job) -> Result<Answers> {
        let read = || -> rusqlite::Result<Answers> {
            let mut query = self.connection.prepare("SELECT id, name FROM operators ORDER BY folded")?;
            let operators: Vec<Operator> = query.query_map([], operator)?.collect::<Result<_, _>>()?;
            let mut answers = vec![vec![vec![None; job.frames.len()]; operators.len()]; job.points.len()];
            for (at, operator) in operators.iter().enumerate() {
                for ((frame, point), answer) in standing(&self.events(operator.id)?) {
                    let cell = answers.get_mut(point).and_then(|point| point[at].get_mut(frame));
                    if let Some(cell) = cell {
                        *cell = Some(answer);
                    }
                }
            }
            Ok(Answers { operators: operators.into_iter().map(|operator| operator.name).collect(), answers })
        };
        read().map_err(|error| self.refuse(&error))
    }

    /// Lets the file grow to so many pages of 4096 bytes and no further: it is then as full as a disk may be.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn limit_pages(&self, pages: u32) -> Result<()> {
        self.connection
            .pragma_update_and_check(None, "max_page_count", pages, |_| Ok(()))
            .map_err(|error| self.refuse(&error))
    }
}

/// The last answers that were not undone.
pub(super) fn standing(events: &[Event]) -> BTreeMap<(usize, usize), Answer> {
    let undone: std::collections::BTreeSet<&str> = events
        .iter()
        .filter_map(|event| match &event.what {
            What::Undo { undoes } => Some(undoes.as_str()),
            _ => None,
        })
        .collect();
    let mut standing = BTreeMap::new();
    for event in events.iter().filter(|event| !undone.contains(event.id.as_str())) {
        match event.what {
            What::Mark { frame, point, x, y } => standing.insert((frame, point), Some([x, y])),
            What::Hidden { frame, point } => standing.insert((frame, point), None),
            What::Undo { .. } => None,
        };
    }
    standing
}

fn make(connection: &mut Connection, key: &str) -> rusqlite::Result<()> {
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
    transaction.execute_batch(SCHEMA)?;
    transaction.pragma_update(None, "application_id", APPLICATION)?;
    set(&transaction, "key", key)?;
    transaction.commit()
}

fn operator(row: &rusqlite::Row) -> rusqlite::Result<Operator> {
    Ok(Operator { id: row.get(0)?, name: row.get(1)? })
}

fn set(connection: &Connection, key: &str, value: &str) -> rusqlite::Result<()> {
    connection
        .execute(
            "INSERT INTO meta (key, value) VALUES (?1, ?2) ON CONFLICT (key) DO UPDATE SET value = ?2",
            [key, value],
        )
        .map(|_| ())
}

/// Number of an operator's event that is no undo.
fn number(within: &Transaction, operator: i64, client: &str) -> rusqlite::Result<Option<i64>> {
    within
        .query_row(
            "SELECT id FROM events WHERE operator = ?1 AND client = ?2 AND undoes IS NULL",
            params![operator, client],
            |row| row.get(0),
        )
        .optional()
}

/// What went wrong, for people.
pub(super) fn words(error: &rusqlite::Error) -> String {
    match error.sqlite_error_code() {
        Some(ErrorCode::DiskFull) => "the disk is full".to_owned(),
        Some(ErrorCode::ReadOnly) => "it may not be written".to_owned(),
        Some(ErrorCode::CannotOpen) => "it cannot be opened".to_owned(),
        Some(ErrorCode::NotADatabase) => "it is no database".to_owned(),
        Some(ErrorCode::DatabaseBusy) => "another program is writing to it".to_owned(),
        _ => error.to_string(),
    }
}

#[cfg(test)]
mod tests;
