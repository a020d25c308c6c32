//! The scheduler without a queue and without an input.
