//! Whether a bench is only tried, each work once: `cargo bench -- --test`.

/// True after `--test`: what must agree is compared, and no time is of use.
pub fn is_test() -> bool {
    std::env::args().any(|argument| argument == "--test")
}
