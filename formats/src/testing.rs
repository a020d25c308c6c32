//! Logs that tests write, and what is read of them.

use crate::messages::{Broken, Cells, MessageReader};
use fusion::rows::SourceError;
use fusion::source::{DataFile, OpenContext};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::{Path, PathBuf};

/// A file of a test.
pub(crate) struct File(PathBuf);

impl File {
    pub(crate) fn new(name: &str, bytes: &[u8]) -> Self {
        let path = std::env::temp_dir().join(format!("fusion-formats-{}-{name}", std::process::id()));
        std::fs::write(&path, bytes).unwrap();
        Self(path)
    }
}

impl Drop for File {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

/// The cells of a message as text, each with the name of its column.
type Row = Vec<(String, String)>;

/// All messages of a log.
#[derive(Debug, Default)]
pub(crate) struct All {
    /// The topic of each message and its cells, or why it has none.
    pub(crate) messages: Vec<(String, Result<Row, String>)>,
    pub(crate) labels: Vec<String>,
    pub(crate) remarks: Vec<String>,
    pub(crate) broken: Option<Broken>,
}

impl All {
    /// The cells of all messages of a topic that are sound, each as text with blanks between them.
    pub(crate) fn rows(&self, topic: &str) -> Vec<String> {
        let of = self.messages.iter().filter(|(name, _)| name == topic);
        let cells = of.filter_map(|(_, cells)| cells.as_ref().ok());
        let shown = |cells: &Row| cells.iter().map(|(_, cell)| cell.as_str()).collect::<Vec<_>>().join(" ");
        cells.map(shown).collect()
    }

    /// The columns of a topic.
    pub(crate) fn columns(&self, topic: &str) -> Vec<&str> {
        let mut of = self.messages.iter().filter(|(name, _)| name == topic);
        let cells = of.find_map(|(_, cells)| cells.as_ref().ok());
        cells.into_iter().flatten().map(|(column, _)| column.as_str()).collect()
    }

    /// The finite numbers of a topic: how many, and the sum of their asinh.
    pub(crate) fn sum(&self, topic: &str) -> (usize, f64) {
        let rows = self.rows(topic);
        let numbers = rows
            .iter()
            .flat_map(|row| row.split(' '))
            .filter_map(|cell| cell.parse::<f64>().ok());
        numbers
            .filter(|x| x.is_finite())
            .fold((0, 0.0), |(count, sum), x| (count + 1, sum + x.asinh()))
    }
}

/// Reads a whole log.
pub(crate) fn read<R: MessageReader>(name: &str, bytes: &[u8]) -> Result<All, SourceError> {
    read_file::<R>(&File::new(name, bytes).0)
}

/// Reads a whole file.
pub(crate) fn read_file<R: MessageReader>(path: &Path) -> Result<All, SourceError> {
    let context = OpenContext::default();
    let mut reader = R::open(&DataFile::new(path, &context), &context)?;
    let mut all = All::default();
    loop {
        match reader.advance() {
            Ok(Some(topic)) => {
                let mut cells = Cells::default();
                let columns = reader.columns(topic).to_vec();
                let decoded = reader.decode(&mut cells).map(|()| {
                    assert!(cells.len() <= columns.len(), "more cells than columns");
                    let named = columns.into_iter().enumerate();
                    named.map(|(k, column)| (column, cells.shown(k))).collect()
                });
                all.messages.push((reader.topics()[topic].name.clone(), decoded));
            }
            Ok(None) => break,
            Err(broken) => {
                all.broken = Some(broken);
                break;
            }
        }
    }
    for topic in 0..reader.topics().len() {
        all.labels
            .extend((0..reader.columns(topic).len()).filter_map(|column| reader.label(topic, column)));
    }
    all.remarks = reader.remarks();
    Ok(all)
}

/// Reads 500 damaged copies of a log. None may panic or have more messages than bytes.
pub(crate) fn survives_damage<R: MessageReader>(name: &str, sound: &[u8]) {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut broken = 0;
    for _ in 0..500 {
        let mut bytes = sound.to_vec();
        if random.random_bool(0.3) {
            bytes.truncate(random.random_range(0..bytes.len()));
        }
        for _ in 0..random.random_range(0..8) {
            if !bytes.is_empty() {
                let at = random.random_range(0..bytes.len());
                bytes[at] ^= 1 << random.random_range(0..8);
            }
        }
        if let Ok(all) = read::<R>(name, &bytes) {
            assert!(all.messages.len() <= bytes.len());
            broken += usize::from(all.broken.is_some() || all.messages.iter().any(|(_, cells)| cells.is_err()));
        }
    }
    assert!(broken > 100, "the damage of {broken} copies only was reported");
}

/// The real log of this name, if it is there.
pub(crate) fn real(name: &str) -> Option<PathBuf> {
    let data =
        std::env::var_os("FUSION_DATA").map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"), PathBuf::from);
    let path = data.join("binary_logs").join(name);
    if !path.exists() {
        println!("skipped: {} is not there", path.display());
        return None;
    }
    Some(path)
}
