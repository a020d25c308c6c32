//! Text of a design: read, checked and assembled. Nothing is included, no file is opened.

#![no_main]

use fusion::Navigator;
use fusion::config::{Diagnostics, Document};
use fusion::examine::variants;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    fusion::models::link();
    let (document, mistakes) = Document::parse("design.toml", text);
    let mut syntax = Diagnostics::new();
    syntax.extend(mistakes);
    assert_eq!(syntax.is_empty(), syntax.to_string().is_empty());
    assert!(variants(&document, &[]).to_string().len() < 1 << 24);
    match Navigator::from_toml(text) {
        Ok(nav) => assert!(nav.belief().is_none(), "nothing was fed"),
        Err(mistakes) => assert!(!mistakes.to_string().is_empty(), "a refusal says why"),
    }
});
