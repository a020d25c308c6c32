//! Parts of a backend that other crates bring: a chart, an update rule or a form.

use alloc::sync::Arc;
use core::fmt;

/// A chart, an update rule or a form of another crate: `T` is `dyn Chart`, `dyn UpdateRule` or `dyn Form`.
pub struct Custom<T: ?Sized> {
    /// Its name in designs, `snake_case`: unlike every name of its kind. A form and a rule give the same one by
    /// their `name()`.
    pub name: &'static str,
    /// A description in one sentence, for the schema and for help.
    pub about: &'static str,
    /// Makes it.
    pub make: fn() -> Arc<T>,
}

/// Two of one name are the same.
impl<T: ?Sized> PartialEq for Custom<T> {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl<T: ?Sized> Eq for Custom<T> {}

impl<T: ?Sized> fmt::Debug for Custom<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}
