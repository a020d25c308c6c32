//! Checkpoints of navigators and runs: which design they belong to, and their files.
//!
//! The hash of a design is 64-bit FNV-1a.

use crate::config::{Document, Node, Value};
use fusion_core::checkpoint::{Fnv, HEADER, Of};
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

/// The tables of a design that do not affect its filter: the sources of the rows, and the use of the
/// estimates.
const OUTSIDE: [&str; 6] = ["source", "simulation", "reference", "stress", "variant", "include"];
/// The keys under `run` that do not affect the filter.
const OUTSIDE_RUN: [&str; 7] = ["description", "data_dir", "start", "stop", "output_rate", "smooth", "seed"];

/// A hash of all that a design declares for a run, and of the `options`.
#[must_use]
pub(crate) fn fingerprint_of_run(document: &Document, options: &str) -> u64 {
    let mut hash = Hash::default();
    // The values of the selected variants are already in the other tables.
    for entry in document.root().entries().iter().filter(|e| e.key != "variant") {
        hash.text(&entry.key);
        hash.node(&entry.node);
    }
    hash.text(options);
    hash.0.value()
}

/// A hash of all that a design declares for its filter, in the order of the file.
#[must_use]
pub(crate) fn fingerprint(document: &Document) -> u64 {
    let mut hash = Hash::default();
    for entry in document.root().entries().iter().filter(|e| !OUTSIDE.contains(&e.key.as_str())) {
        hash.text(&entry.key);
        if entry.key == "run" {
            let keys = entry.node.entries().iter();
            for entry in keys.filter(|e| !OUTSIDE_RUN.contains(&e.key.as_str())) {
                hash.text(&entry.key);
                hash.node(&entry.node);
            }
        } else {
            hash.node(&entry.node);
        }
    }
    hash.0.value()
}

/// Reads a file that may be a checkpoint. If it is another kind of file, only its beginning is read.
pub(crate) fn read(path: &Path) -> io::Result<Vec<u8>> {
    // Opening a pipe without a writer would wait forever.
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::other("it is no file"));
    }
    let (mut file, mut bytes) = (File::open(path)?, Vec::new());
    file.by_ref().take(HEADER as u64).read_to_end(&mut bytes)?;
    if [Of::Navigator, Of::Run].iter().any(|of| bytes.starts_with(&of.magic())) {
        file.read_to_end(&mut bytes)?;
    }
    Ok(bytes)
}

/// The hash of texts and nodes.
#[derive(Default)]
struct Hash(Fnv);

impl Hash {
    /// Text and its length, so that no two lists of texts are alike.
    fn text(&mut self, text: &str) {
        self.0.bytes(&(text.len() as u64).to_le_bytes());
        self.0.bytes(text.as_bytes());
    }

    fn node(&mut self, node: &Node) {
        match node.value() {
            Value::Table { entries, .. } => {
                self.text("{");
                for entry in entries {
                    self.text(&entry.key);
                    self.node(&entry.node);
                }
                self.text("}");
            }
            Value::Array(items) => {
                self.text("[");
                items.iter().for_each(|item| self.node(item));
                self.text("]");
            }
            value => self.text(&format!("{value:?}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_says_nothing_of_the_filter_leaves_the_fingerprint() {
        let of = |text: &str| fingerprint(&Document::parse("design.toml", text).0);
        let text = "run.reorder = '1 s'\nprocess.type = 'hold'\nsource.a.path = 'x'";
        assert_eq!(
            of(text),
            of("run.reorder = '1 s'\nrun.stop = 5\nprocess.type = 'hold'\nsource.a.path = 'y'")
        );
        for other in [
            "run.reorder = '2 s'\nprocess.type = 'hold'",
            "run.reorder = '1 s'\nprocess.type = 'holds'",
            "run.reorder = '1 s'\nprocess.type = 'hold'\nprocess.x = 1",
        ] {
            assert_ne!(of(text), of(other), "{other}");
        }
    }
}
