//! Whether blocks can print themselves.

/// A block behind a pointer prints itself with `{:?}` if the crate is built with `std`.
///
/// Without `std` only the name of its role is printed. A table of functions of each block would else bring its whole text,
/// and the formatting of numbers, into a program for a microcontroller: a tenth of its flash.
#[cfg(feature = "std")]
pub trait Printed: core::fmt::Debug {}
#[cfg(feature = "std")]
impl<T: core::fmt::Debug + ?Sized> Printed for T {}

/// A block behind a pointer prints the name of its role with `{:?}`, as the crate is built without `std`.
#[cfg(not(feature = "std"))]
pub trait Printed {}
#[cfg(not(feature = "std"))]
impl<T: ?Sized> Printed for T {}

/// Blocks behind pointers print the name of their role, where they cannot print themselves.
macro_rules! role {
    ($role:ident) => {
        #[cfg(not(feature = "std"))]
        impl core::fmt::Debug for dyn $role + '_ {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.write_str(stringify!($role))
            }
        }
    };
}
pub(crate) use role;
