//! Tests over DDS on this computer.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    reason = "helpers of tests are tests"
)]

/// Against Cyclone DDS; skipped without Python and its package `cyclonedds`.
mod cyclone;
/// Between the link and the output.
mod loopback;
/// Messages that are lost, and declarations that are wrong.
mod refused;
mod support;
