//! Files that get their names together, when all of them are complete.
//!
//! ```text
//! FileSet::begin ─▶ create ─▶ OutputFile, written as .fusion-partial/NAME ─▶ close ─▶ commit ─▶ NAME
//! ```
//!
//! A file that is not closed never gets its name. So a run that fails, is stopped or is killed
//! leaves the files of an earlier one as they were. At [`commit`](FileSet::commit) the file that
//! was closed last, the summary, is removed first and put back last. If the summary exists, all other
//! files are from the same run.
//!
//! The unfinished files of a set may also be kept when its process ends, so that another process can continue them.

use super::{Spill, Unwritable};
use core::cell::Cell;
use std::fs::{self, File, TryLockError};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The folder of unfinished files, inside that of the finished ones: on the same file system.
const PARTIAL: &str = ".fusion-partial";

/// The folders of unfinished files of this process; locked while one is made, emptied or renamed.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// No file of this process can be begun or get its name while this is held.
#[derive(Debug)]
pub struct Abandoned {
    _held: MutexGuard<'static, Vec<PathBuf>>,
    /// The folders whose new files were given up.
    pub folders: Vec<PathBuf>,
}

/// Removes every unfinished file of this process, for a process that is about to end at any point
/// of its work. A set that is being renamed is finished first.
#[must_use = "files can be begun again as soon as it is dropped"]
pub fn abandon() -> Abandoned {
    let mut held = unfinished();
    let mut folders: Vec<PathBuf> = held.drain(..).collect();
    for partial in &mut folders {
        // A file that cannot be removed does not have its final name.
        let _ = fs::remove_dir_all(&partial);
        partial.pop();
    }
    Abandoned { _held: held, folders }
}

/// How unfinished files are treated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Unfinished {
    Removed,
    /// They stay, for [`FileSet::go_on`].
    Kept,
}

/// The files of one result in one folder.
#[derive(Debug)]
pub struct FileSet {
    folder: PathBuf,
    partial: PathBuf,
    /// Held as long as the set: no other process writes into the folder.
    lock: Option<File>,
    /// Names of files that are whole, in the order in which they were closed.
    closed: Vec<String>,
    /// Names of files that this result does not have.
    absent: Vec<String>,
    unfinished: Unfinished,
}

/// A file that is being written.
#[derive(Debug)]
pub struct OutputFile {
    /// Its final path.
    path: PathBuf,
    name: String,
    /// Set if it gets its name at the end; a pipe or a device is written directly.
    is_staged: bool,
    out: BufWriter<File>,
    /// Bytes that have been written to it.
    length: Cell<u64>,
}

/// A writer whose output another process may continue.
pub trait Sink: Write {
    /// Bytes in it, once it is flushed.
    fn length(&self) -> u64 {
        0
    }

    /// Stores the flushed bytes so that they survive the end of the process, and a crash of the machine.
    ///
    /// # Errors
    /// The errors of the system.
    fn sync(&self) -> io::Result<()> {
        Ok(())
    }

    /// Takes back everything after the first `length` bytes.
    ///
    /// # Errors
    /// It has fewer bytes, or an error of the system.
    fn cut(&self, _length: u64) -> io::Result<()> {
        Ok(())
    }
}

impl FileSet {
    /// Begins a set in `folder`, which is created if necessary.
    ///
    /// # Errors
    /// The folder is not writable, or another process uses it.
    pub fn begin(folder: &Path) -> Result<Self, Unwritable> {
        Self::open(folder, Unfinished::Removed, false)
    }

    /// The same, but its unfinished files are kept when this process ends, so that another process can continue them.
    ///
    /// # Errors
    /// As [`FileSet::begin`].
    pub(crate) fn begin_kept(folder: &Path) -> Result<Self, Unwritable> {
        Self::open(folder, Unfinished::Kept, false)
    }

    /// Continues the unfinished files that another process has kept in `folder`.
    ///
    /// # Errors
    /// There are no unfinished files, the folder is not writable, or another process uses it.
    pub fn go_on(folder: &Path) -> Result<Self, Unwritable> {
        Self::open(folder, Unfinished::Kept, true)
    }

    fn open(folder: &Path, unfinished: Unfinished, goes_on: bool) -> Result<Self, Unwritable> {
        let failed = |error| Unwritable::new(folder, error);
        if folder.exists() && !folder.is_dir() {
            return Err(failed(io::Error::other("it is a file, not a folder")));
        }
        fs::create_dir_all(folder).map_err(failed)?;
        let lock = lock(folder).map_err(failed)?;
        let partial = folder.join(PARTIAL);
        let mut all = self::unfinished();
        if goes_on {
            if !partial.is_dir() {
                return Err(failed(io::Error::other(
                    "the files of the run that was stopped are not there any more",
                )));
            }
        } else {
            // Left by a killed process: no other process has locked the folder.
            let _ = fs::remove_dir_all(&partial);
            fs::create_dir(&partial).map_err(failed)?;
        }
        if unfinished == Unfinished::Removed {
            all.push(partial.clone());
        }
        drop(all);
        Ok(Self {
            folder: folder.to_owned(),
            partial,
            lock,
            closed: Vec::new(),
            absent: Vec::new(),
            unfinished,
        })
    }

    /// Begins a file.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn create(&self, name: &str) -> Result<OutputFile, Unwritable> {
        let path = self.folder.join(name);
        let found = fs::metadata(&path).map(|m| m.file_type()).ok();
        if found.is_some_and(|f| f.is_dir()) {
            return Err(Unwritable::new(&path, io::Error::other("it is a folder")));
        }
        let is_staged = found.is_none_or(|f| f.is_file());
        let file = if is_staged {
            let _unfinished = unfinished();
            // A continued file is not truncated here: its owner cuts it to the remembered length.
            let goes_on = self.unfinished == Unfinished::Kept;
            let mut options = File::options();
            options.write(true).create(true).truncate(!goes_on).open(self.partial.join(name))
        } else {
            // Waits for the reader of a pipe.
            File::options().write(true).open(&path)
        };
        match file {
            Ok(file) => Ok(OutputFile {
                path,
                name: name.to_owned(),
                is_staged,
                out: BufWriter::new(file),
                length: Cell::new(0),
            }),
            Err(error) => Err(Unwritable { path, error }),
        }
    }

    /// Begins a file that is read back, and removed before the other files get their names.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn spill(&self, name: &str) -> Result<Spill, Unwritable> {
        let path = self.partial.join(name);
        let _unfinished = unfinished();
        Spill::create(path)
    }

    /// Ends a complete file.
    ///
    /// # Errors
    /// The buffered bytes cannot be written.
    pub fn close(&mut self, mut file: OutputFile) -> Result<(), Unwritable> {
        let mut end = || {
            file.out.flush()?;
            // A full disk may show only when the data reach it.
            if !file.is_staged {
                return Ok(());
            }
            // An earlier process may have written more.
            file.out.get_ref().set_len(file.length.get())?;
            file.out.get_ref().sync_all()
        };
        end().map_err(|error| Unwritable::new(&file.path, error))?;
        if file.is_staged {
            self.closed.push(file.name);
        }
        Ok(())
    }

    /// Writes a whole file.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn write(&mut self, name: &str, write: impl FnOnce(&mut OutputFile) -> io::Result<()>) -> Result<(), Unwritable> {
        let mut file = self.create(name)?;
        write(&mut file).map_err(|error| Unwritable::new(&file.path, error))?;
        self.close(file)
    }

    /// Declares that this result has no file `name`: the file of an earlier result is removed with the others.
    pub fn without(&mut self, name: &str) {
        self.absent.push(name.to_owned());
    }

    /// Gives all closed files their names.
    ///
    /// # Errors
    /// Where one cannot be renamed.
    pub fn commit(mut self) -> Result<(), Unwritable> {
        let mut unfinished = unfinished();
        let names = core::mem::take(&mut self.closed);
        let summary = if names.len() > 1 { names.last() } else { None };
        for name in summary.into_iter().chain(&self.absent) {
            let path = self.folder.join(name);
            match fs::remove_file(&path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(Unwritable { path, error }),
                _ => {}
            }
        }
        for name in &names {
            let path = self.folder.join(name);
            fs::rename(self.partial.join(name), &path).map_err(|error| Unwritable { path, error })?;
        }
        unfinished.retain(|partial| *partial != self.partial);
        self.unfinished = Unfinished::Removed;
        Ok(())
    }
}

/// Locks a folder against other processes; `None` if the system cannot.
fn lock(folder: &Path) -> io::Result<Option<File>> {
    let Ok(handle) = File::open(folder) else { return Ok(None) };
    match handle.try_lock() {
        Ok(()) => Ok(Some(handle)),
        Err(TryLockError::WouldBlock) => Err(io::Error::other("another run is writing there")),
        Err(TryLockError::Error(_)) => Ok(None),
    }
}

impl Drop for FileSet {
    fn drop(&mut self) {
        let mut unfinished = unfinished();
        unfinished.retain(|partial| *partial != self.partial);
        if self.unfinished == Unfinished::Removed {
            let _ = fs::remove_dir_all(&self.partial);
        }
        // Unlocked after that, so that no other process finds the folder of unfinished files.
        self.lock = None;
    }
}

impl OutputFile {
    /// Its final path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Sink for OutputFile {
    fn length(&self) -> u64 {
        self.length.get()
    }

    fn sync(&self) -> io::Result<()> {
        if self.is_staged { self.out.get_ref().sync_data() } else { Ok(()) }
    }

    fn cut(&self, length: u64) -> io::Result<()> {
        if !self.is_staged {
            return Ok(());
        }
        let mut file = self.out.get_ref();
        if file.metadata()?.len() < length {
            return Err(io::Error::other("it is shorter than it was"));
        }
        file.set_len(length)?;
        file.seek(SeekFrom::Start(length))?;
        self.length.set(length);
        Ok(())
    }
}

impl Write for OutputFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.length.set(self.length.get() + written as u64);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(test: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("fusion-set-{test}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        folder
    }

    fn read(folder: &Path, name: &str) -> Option<String> {
        fs::read_to_string(folder.join(name)).ok()
    }

    #[test]
    fn files_get_their_names_together() {
        let folder = folder("together");
        let set = |text: &'static str| {
            let mut set = FileSet::begin(&folder).unwrap();
            for name in ["rows", "summary"] {
                set.write(name, |f| f.write_all(text.as_bytes())).unwrap();
            }
            set
        };
        set("old").commit().unwrap();
        let new = set("new");
        assert_eq!(
            ["rows", "summary"].map(|n| read(&folder, n)),
            [(); 2].map(|()| Some("old".to_owned()))
        );
        new.commit().unwrap();
        assert_eq!(
            ["rows", "summary"].map(|n| read(&folder, n)),
            [(); 2].map(|()| Some("new".to_owned()))
        );
        drop(set("never"));
        assert_eq!(
            ["rows", "summary"].map(|n| read(&folder, n)),
            [(); 2].map(|()| Some("new".to_owned()))
        );
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 2);
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_file_that_was_not_closed_gets_no_name() {
        let folder = folder("unclosed");
        let mut set = FileSet::begin(&folder).unwrap();
        set.write("whole", |f| f.write_all(b"all of it")).unwrap();
        let mut half = set.create("half").unwrap();
        half.write_all(b"half of").unwrap();
        drop(half);
        set.commit().unwrap();
        assert_eq!(read(&folder, "whole").as_deref(), Some("all of it"));
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
        fs::remove_dir_all(&folder).unwrap();
    }

    /// As a process that is killed between two names would leave them.
    #[test]
    fn a_set_that_got_half_of_its_names_has_no_summary() {
        let folder = folder("half");
        let write = || {
            let mut set = FileSet::begin(&folder).unwrap();
            for name in ["a", "b", "summary"] {
                set.write(name, |f| f.write_all(b"x")).unwrap();
            }
            set
        };
        write().commit().unwrap();
        let set = write();
        // A folder in the place of a file cannot be replaced.
        fs::remove_file(folder.join("b")).unwrap();
        fs::create_dir(folder.join("b")).unwrap();
        let error = set.commit().unwrap_err();
        assert_eq!(error.path, folder.join("b"));
        assert_eq!(read(&folder, "summary"), None);
        fs::remove_dir_all(&folder).unwrap();
    }
}
