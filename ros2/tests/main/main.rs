//! Tests over DDS on this computer.

/// Against Cyclone DDS; skipped without Python and its package `cyclonedds`.
mod cyclone;
/// Between the link and the output.
mod loopback;
/// Messages that are lost, and declarations that are wrong.
mod refused;
mod support;
