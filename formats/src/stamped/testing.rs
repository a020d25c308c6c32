//! The tests of all logs with schemas use this module.

use crate::messages::{Broken, Cells, MessageReader};
use fusion::source::{DataFile, OpenContext};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// A temporary file.
pub(crate) struct File(pub(crate) PathBuf);

impl File {
    pub(crate) fn new(ending: &str, bytes: &[u8]) -> Self {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("fusion-log-{}-{number}{ending}", std::process::id()));
        std::fs::write(&path, bytes).unwrap();
        Self(path)
    }
}

impl Drop for File {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

/// A message: its topic, and its cells as messages show them.
pub(crate) type Shown = (String, Vec<String>);

/// Opens a log, and splits these lists.
pub(crate) fn opened<R: MessageReader>(path: &Path, lists: &[(&str, &str)]) -> Result<R, String> {
    let context = OpenContext::default();
    let mut reader = R::open(&DataFile::new(path, &context), &context).map_err(|error| error.to_string())?;
    for (topic, list) in lists {
        reader.split(topic, list)?;
    }
    Ok(reader)
}

/// All messages, and the damage at which reading ends.
pub(crate) fn all<R: MessageReader>(reader: &mut R) -> (Vec<Shown>, Option<Broken>) {
    let (mut messages, mut cells) = (Vec::new(), Cells::default());
    loop {
        match reader.advance() {
            Ok(Some(topic)) => {
                cells.clear();
                let shown = match reader.decode(&mut cells) {
                    Ok(()) => (0..cells.len()).map(|k| cells.get(k).shown().into_owned()).collect(),
                    Err(why) => vec![why],
                };
                messages.push((reader.topics()[topic].name.clone(), shown));
            }
            Ok(None) => return (messages, None),
            Err(broken) => return (messages, Some(broken)),
        }
    }
}

/// Reads a log that is whole.
#[cfg(any(feature = "mcap", feature = "rosbag"))]
pub(crate) fn whole<R: MessageReader>(ending: &str, bytes: &[u8]) -> Vec<Shown> {
    let file = File::new(ending, bytes);
    let (messages, broken) = all(&mut opened::<R>(&file.0, &[]).unwrap());
    assert_eq!(broken, None);
    messages
}

/// Half of the files are cut off: the messages before the cut are read, and the damage is reported. `end` is the place
/// after the last message. The others have flipped bytes: they are read without panic.
#[cfg(any(feature = "mcap", feature = "rosbag"))]
pub(crate) fn survives_damage<R: MessageReader>(ending: &str, bytes: &[u8], end: usize) {
    use rand::{RngExt, SeedableRng};
    let whole = whole::<R>(ending, bytes);
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let mut with_some = 0;
    for _ in 0..250 {
        let cut = random.random_range(0..end);
        let file = File::new(ending, &bytes[..cut]);
        let Ok(mut reader) = opened::<R>(&file.0, &[]) else { continue };
        let (messages, broken) = all(&mut reader);
        assert!(whole.starts_with(&messages), "{messages:?} of a file cut at {cut}");
        let broken = broken.unwrap_or_else(|| panic!("a file cut at {cut} is not whole"));
        assert!(broken.at.is_none_or(|at| at <= cut as u64), "{broken} of a file cut at {cut}");
        with_some += usize::from(!messages.is_empty());
    }
    assert!(with_some > 50, "{with_some} of 250 files had messages before the cut");
    for _ in 0..250 {
        let mut damaged = bytes.to_vec();
        for _ in 0..random.random_range(1..=8) {
            let at = random.random_range(0..damaged.len());
            damaged[at] = random.random();
        }
        let file = File::new(ending, &damaged);
        if let Ok(mut reader) = opened::<R>(&file.0, &[]) {
            // A message takes at least one byte, packed 255 times at most by lz4; zstd and bz2 have check sums.
            assert!(all(&mut reader).0.len() <= 255 * bytes.len());
        }
    }
}
