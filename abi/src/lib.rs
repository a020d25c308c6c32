//! The C interface of a compiled design. `fusion compile --target c` writes the crate that uses it, and `fusion.h`.
//!
//! One program has one filter. Its memory is a block that the caller places. Calls come from one thread: a call during
//! another one, as from an interrupt, does nothing and returns [`Status::Busy`].
//!
//! This is the only crate between a design and a microcontroller with unsafe code: it trusts the pointers of its caller.

#![no_std]

mod arena;
mod filter;
#[cfg(feature = "meter")]
mod meter;
mod state;

pub use arena::Arena;
pub use filter::Filter;
pub use fusion_vehicle;
#[cfg(feature = "meter")]
pub use meter::{Measurement, Meter};
pub use state::{State, Status};

/// Writes the functions of `fusion.h`, which `abi/src/filter.rs` explains. `assemble` makes the filter; `design` is the
/// hash of the design, `streams` are the functions that feed one stream: name, number and width.
#[macro_export]
macro_rules! export {
    ($assemble:path, $design:expr, { $($feed:ident: $stream:literal, $width:literal;)* }) => {
        #[global_allocator]
        static ARENA: $crate::Arena = $crate::Arena::new();
        static FILTER: $crate::Filter = $crate::Filter::new();

        /// # Safety
        /// `memory` has `bytes` bytes, which nothing else uses from now on.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn fusion_init(memory: *mut u8, bytes: usize) -> $crate::Status {
            // SAFETY: the caller's promise.
            unsafe { FILTER.init(&ARENA, memory, bytes, $assemble) }
        }

        /// # Safety
        /// `row` has `width` numbers.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn fusion_feed(stream: u32, time: i64, row: *const f64, width: usize) -> $crate::Status {
            // SAFETY: the caller's promise.
            unsafe { FILTER.feed(stream, time, row, width) }
        }

        $(
            /// # Safety
            /// `row` has as many numbers as `fusion.h` says.
            #[unsafe(no_mangle)]
            pub unsafe extern "C" fn $feed(time: i64, row: *const f64) -> $crate::Status {
                // SAFETY: the caller's promise.
                unsafe { FILTER.feed($stream, time, row, $width) }
            }
        )*

        /// # Safety
        /// `state` points to a state, or is null.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn fusion_state(state: *mut $crate::State) -> $crate::Status {
            // SAFETY: the caller's promise.
            unsafe { FILTER.state(state) }
        }

        /// # Safety
        /// `state` points to a state, or is null.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn fusion_predict(time: i64, state: *mut $crate::State) -> $crate::Status {
            // SAFETY: the caller's promise.
            unsafe { FILTER.predict(time, state) }
        }

        #[unsafe(no_mangle)]
        pub extern "C" fn fusion_finish() -> $crate::Status {
            FILTER.finish()
        }

        /// # Safety
        /// `bytes` has room for `capacity` bytes.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn fusion_checkpoint(bytes: *mut u8, capacity: usize) -> usize {
            // SAFETY: the caller's promise.
            unsafe { FILTER.checkpoint(bytes, capacity) }
        }

        /// # Safety
        /// `bytes` has `length` bytes.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn fusion_restore(bytes: *const u8, length: usize) -> $crate::Status {
            // SAFETY: the caller's promise.
            unsafe { FILTER.restore(bytes, length) }
        }

        #[unsafe(no_mangle)]
        pub extern "C" fn fusion_memory_used() -> usize {
            ARENA.most_used()
        }

        #[unsafe(no_mangle)]
        pub extern "C" fn fusion_design() -> *const u8 {
            concat!($design, "\0").as_ptr()
        }

        #[cfg(not(feature = "std"))]
        #[panic_handler]
        fn panicked(_: &core::panic::PanicInfo<'_>) -> ! {
            unsafe extern "C" {
                fn fusion_panicked() -> !;
            }
            // SAFETY: a function of the caller's program without arguments.
            unsafe { fusion_panicked() }
        }
    };
}
