//! `run.json`: what was computed from what, so that anybody can compute it again and compare.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::io::{self, Read};

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// It has not: it is running, or was killed. The files listed may be incomplete as a set, never singly.
    Unfinished,
    /// Somebody stopped it; what is there is complete as far as it goes.
    Interrupted,
    /// All is there.
    Complete,
}

/// The record of a run. The folder adds `program` and `files`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Record {
    /// Version of the program.
    pub version: &'static str,
    /// The subcommand.
    pub command: String,
    /// How the run ended.
    pub state: State,
    /// Seed of all random numbers.
    pub seed: u64,
    /// The whole effective configuration.
    pub config: Value,
    /// Digest of command, seed and configuration: equal digests and inputs give equal estimates.
    pub config_digest: String,
    /// What was read.
    pub input: Vec<Input>,
    /// What became of the rows.
    pub counts: Counts,
    /// Degeneracies by name, and what was done about them.
    pub outcomes: BTreeMap<String, OutcomeCount>,
    /// Time from start to end, s.
    pub seconds: f64,
    /// Digest of the estimates, absent where a command makes none.
    pub estimates_digest: Option<String>,
}

impl Record {
    /// A record of a complete run with the given effective configuration and nothing counted yet.
    pub fn new(command: &str, seed: u64, config: Value) -> Record {
        Record {
            version: env!("CARGO_PKG_VERSION"),
            command: command.to_owned(),
            state: State::Complete,
            seed,
            config_digest: config_digest(command, seed, &config),
            config,
            input: Vec::new(),
            counts: Counts::default(),
            outcomes: BTreeMap::new(),
            seconds: 0.0,
            estimates_digest: None,
        }
    }

    /// Counts one more of a degeneracy; `action` says what was done about it.
    pub fn outcome(&mut self, name: &str, action: &str) {
        self.outcomes_of(name, action, 1);
    }

    /// Counts `count` more of a degeneracy.
    pub fn outcomes_of(&mut self, name: &str, action: &str, count: u64) {
        let new = || OutcomeCount { count: 0, action: action.to_owned() };
        self.outcomes.entry(name.to_owned()).or_insert_with(new).count += count;
    }
}

/// An input file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Input {
    /// Its path as given; `-` is standard input.
    pub path: String,
    /// Its size.
    pub bytes: u64,
    /// SHA-256 of its bytes, in hexadecimal.
    pub sha256: String,
}

/// What became of the rows of the inputs.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Rows read.
    pub read: u64,
    /// Rows used.
    pub used: u64,
    /// Rows rejected, by reason.
    pub rejected: BTreeMap<String, u64>,
    /// Empty cells where a measurement could stand.
    pub missing: u64,
    /// Sound rows that give no new measurement, by reason.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub left_out: BTreeMap<String, u64>,
}

impl Counts {
    /// Says that the run stopped after `used` of the rows that were to be used.
    pub fn stop_at(&mut self, used: u64) {
        let rest = self.used.saturating_sub(used);
        if rest > 0 {
            self.left_out.insert("not reached".to_owned(), rest);
        }
        self.used -= rest;
    }
}

/// How often something happened, and what was done about it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct OutcomeCount {
    /// How often.
    pub count: u64,
    /// What was done.
    pub action: String,
}

/// SHA-256 of command, seed and configuration as compact JSON.
pub fn config_digest(command: &str, seed: u64, config: &Value) -> String {
    let text = serde_json::json!({ "command": command, "config": config, "seed": seed }).to_string();
    hexadecimal(Sha256::digest(text.as_bytes()).as_slice())
}

/// SHA-256 of a text, in hexadecimal.
pub fn text_digest(text: &str) -> String {
    hexadecimal(Sha256::digest(text.as_bytes()).as_slice())
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// SHA-256 of estimates: their little-endian `f64` in row order.
#[derive(Clone, Debug, Default)]
pub struct EstimatesDigest(Sha256);

impl EstimatesDigest {
    /// Adds the numbers of a row.
    pub fn push(&mut self, row: &[f64]) {
        for value in row {
            self.0.update(value.to_le_bytes());
        }
    }

    /// The digest in hexadecimal.
    pub fn finish(self) -> String {
        hexadecimal(self.0.finalize().as_slice())
    }
}

/// A reader that sees to it that the digest is of the very bytes that were read.
#[derive(Debug)]
pub struct Hashing<R> {
    inner: R,
    digest: Sha256,
    bytes: u64,
}

impl<R: Read> Hashing<R> {
    /// Reads `inner` and digests along.
    pub fn new(inner: R) -> Hashing<R> {
        Hashing { inner, digest: Sha256::new(), bytes: 0 }
    }

    /// Reads what is left and says what the input was; `path` is its name as given.
    ///
    /// # Errors
    /// Those of the reader.
    pub fn finish(mut self, path: &str) -> io::Result<Input> {
        io::copy(&mut self, &mut io::sink())?;
        Ok(self.so_far(path))
    }

    /// What of the input was read; for streams that are left before their end.
    pub fn so_far(self, path: &str) -> Input {
        Input {
            path: path.to_owned(),
            bytes: self.bytes,
            sha256: hexadecimal(self.digest.finalize().as_slice()),
        }
    }
}

impl<R: Read> Read for Hashing<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(buffer)?;
        self.digest.update(&buffer[..count]);
        self.bytes += count as u64;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// SHA-256 of "abc": FIPS 180-4, example 1.
    const ABC: &str = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";

    #[test]
    fn inputs_are_digested_whole_however_far_they_were_read() {
        for read in 0..=3 {
            let mut hashing = Hashing::new(&b"abc"[..]);
            hashing.read_exact(&mut vec![0; read]).unwrap();
            let input = hashing.finish("-").unwrap();
            assert_eq!(input, Input { path: "-".to_owned(), bytes: 3, sha256: ABC.to_owned() });
        }
    }

    #[test]
    fn the_digest_of_estimates_is_of_their_bytes_in_order() {
        let digest = |rows: &[&[f64]]| {
            let mut digest = EstimatesDigest::default();
            rows.iter().for_each(|row| digest.push(row));
            digest.finish()
        };
        let bytes: Vec<u8> = [1.5f64, -2.0, 3.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(digest(&[&[1.5, -2.0], &[3.0]]), hexadecimal(Sha256::digest(&bytes).as_slice()));
        assert_ne!(digest(&[&[1.5, -2.0, 3.0]]), digest(&[&[-2.0, 1.5, 3.0]]));
    }

    #[test]
    fn the_configuration_digest_tells_command_seed_and_values_apart() {
        let digest = |command, seed, value| config_digest(command, seed, &serde_json::json!({ "a": value }));
        let one = digest("track", 1, 0.5);
        assert_eq!(one, digest("track", 1, 0.5));
        for other in [digest("study", 1, 0.5), digest("track", 2, 0.5), digest("track", 1, 0.25)] {
            assert_ne!(one, other);
        }
    }

    #[test]
    fn rows_behind_the_stop_are_left_out_not_used() {
        let mut counts = Counts { read: 12, used: 10, ..Counts::default() };
        counts.stop_at(10);
        assert_eq!((counts.used, counts.left_out.len()), (10, 0));
        counts.stop_at(4);
        assert_eq!((counts.read, counts.used, counts.left_out["not reached"]), (12, 4, 6));
    }

    #[test]
    fn the_record_has_the_keys_of_the_contract() {
        let mut record = Record::new("track", 7, serde_json::json!({}));
        record.outcome("degenerate", "predicted");
        record.outcome("degenerate", "predicted");
        let value = serde_json::to_value(&record).unwrap();
        for key in [
            "version",
            "command",
            "seed",
            "config",
            "config_digest",
            "input",
            "counts",
            "outcomes",
            "seconds",
        ] {
            assert!(value.get(key).is_some(), "{key}");
        }
        for key in ["read", "used", "rejected", "missing"] {
            assert!(value["counts"].get(key).is_some(), "{key}");
        }
        assert!(value.get("estimates_digest").is_some());
        assert_eq!(value["outcomes"]["degenerate"], serde_json::json!({ "count": 2, "action": "predicted" }));
    }
}
