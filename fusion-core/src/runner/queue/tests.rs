//! The queue without an estimator.
