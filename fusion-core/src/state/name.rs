//! Names of states and signals, typed by the manifold that their values live on.

use alloc::string::String;
use core::{fmt, marker::PhantomData};

/// The name of a state or signal, and the manifold `M` of its values.
///
/// A well-known name is written in one place only, as a constant of this type. A
/// [`Layout`](super::Layout) returns a handle of the right type for it. A plain text is a name for any
/// manifold.
///
/// ```
/// use fusion_core::state::{Layout, QuantityName, Velocity};
///
/// const VELOCITY: QuantityName<'_, Velocity> = QuantityName::new("velocity");
/// assert!(Layout::default().slot(VELOCITY).is_err()); // an empty layout
/// ```
pub struct QuantityName<'a, M> {
    text: &'a str,
    manifold: PhantomData<fn() -> M>,
}

impl<'a, M> QuantityName<'a, M> {
    /// A name.
    #[must_use]
    pub const fn new(text: &'a str) -> Self {
        Self {
            text,
            manifold: PhantomData,
        }
    }

    /// As text.
    #[must_use]
    pub const fn as_str(self) -> &'a str {
        self.text
    }
}

// Written out, because a derive would ask the manifold for the same traits.
impl<M> Clone for QuantityName<'_, M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M> Copy for QuantityName<'_, M> {}

impl<M> fmt::Debug for QuantityName<'_, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.text, f)
    }
}

impl<M> fmt::Display for QuantityName<'_, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text)
    }
}

impl<M> AsRef<str> for QuantityName<'_, M> {
    fn as_ref(&self) -> &str {
        self.text
    }
}

impl<'a, M> From<&'a str> for QuantityName<'a, M> {
    fn from(text: &'a str) -> Self {
        Self::new(text)
    }
}

impl<'a, M> From<&'a String> for QuantityName<'a, M> {
    fn from(text: &'a String) -> Self {
        Self::new(text)
    }
}
