//! A custom backend and a custom manifold, written against the public traits of the framework.
//!
//! The backend is a second way to store P, a second way to use a measurement, and a second way to write the error of
//! an attitude. Each is registered below, so that `[filter]` takes it by its name. All are plain rather than fast.
//! The manifold is the sphere of directions, with a process and a sensor that use it. `tests/` checks all of them
//! against the laws, and runs them.

pub mod direction;
mod packed;
mod rodrigues;
pub mod sight;
mod twice;

pub use packed::Packed;
pub use rodrigues::Rodrigues;
pub use twice::Twice;

use fusion::core::custom::Custom;
use fusion::design::BackendPart;
use std::sync::Arc;

fusion::inventory::submit! {
    BackendPart::Form(Custom { name: "packed", about: "The lower triangle of P, row by row.", make: || Arc::new(Packed) })
}

fusion::inventory::submit! {
    BackendPart::Update(Custom { name: "twice", about: "Two Gauss-Newton steps.", make: || Arc::new(Twice) })
}

fusion::inventory::submit! {
    BackendPart::Chart(Custom {
        name: "rodrigues",
        about: "Attitude error in body axes, as modified Rodrigues parameters.",
        make: || Arc::new(Rodrigues),
    })
}

/// Links this crate into a program; call it once, so that the linker keeps it.
pub fn link() {}
