//! Whether a bench is only tried, each work once: `cargo bench -- --test`.

/// True after `--test`: the bench compares results with those of its rivals and measures no times.
pub fn is_test() -> bool {
    std::env::args().any(|argument| argument == "--test")
}
