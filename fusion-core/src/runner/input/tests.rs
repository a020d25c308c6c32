//! The input without a queue and without an estimator.
