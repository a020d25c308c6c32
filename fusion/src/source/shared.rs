//! Readers that several sources of a run share.

use core::any::{Any, TypeId};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Readers of files with several streams. The sources of a run share them, so that such a file is read and unpacked
/// once. Clones share the same readers.
#[derive(Clone, Debug, Default)]
pub struct SharedReaders(Arc<Mutex<HashMap<(TypeId, PathBuf), Reader>>>);

/// A reader of any type.
type Reader = Arc<dyn Any + Send + Sync>;

impl SharedReaders {
    /// The reader of this type for a file. The first call opens it.
    ///
    /// # Errors
    /// Those of `open`. Nothing is kept then.
    pub fn reader<T: Any + Send + Sync, E>(&self, path: &Path, open: impl FnOnce() -> Result<T, E>) -> Result<Arc<T>, E> {
        let mut readers = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (TypeId::of::<T>(), path.to_owned());
        if let Some(Ok(known)) = readers.get(&key).map(|reader| Arc::clone(reader).downcast()) {
            return Ok(known);
        }
        let opened = Arc::new(open()?);
        readers.insert(key, Arc::clone(&opened) as _);
        Ok(opened)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_opened_once_for_each_type_of_reader() {
        let shared = SharedReaders::default();
        let open = |path: &str, number: u32| shared.reader::<u32, ()>(Path::new(path), || Ok(number)).unwrap();
        assert_eq!((*open("a", 1), *open("a", 2), *open("b", 3)), (1, 1, 3));
        assert_eq!(*shared.clone().reader::<u8, ()>(Path::new("a"), || Ok(4)).unwrap(), 4);
        assert_eq!(shared.reader::<i8, &str>(Path::new("a"), || Err("no")), Err("no"));
        assert_eq!(shared.reader::<i8, &str>(Path::new("a"), || Ok(5)).as_deref(), Ok(&5));
    }
}
