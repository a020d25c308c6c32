//! Quantities and units as they are written in a design.

#![no_main]

use fusion::models::units::{AnyQuantity, parse, parse_unit};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    match parse(text) {
        Ok((si, dimension)) => {
            assert!(si.is_finite(), "{si} of {text:?}");
            let any = AnyQuantity::from_text(text).expect("a quantity is one in any field");
            assert_eq!(any.expect(dimension).ok(), Some(si));
            // The unit that messages print can be read again.
            let shown = dimension.to_string();
            assert_eq!(parse_unit(&shown).map(|(_, again)| again).ok(), Some(dimension), "{shown}");
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
    match parse_unit(text) {
        Ok((factor, _)) => assert!(factor.is_finite() && factor > 0.0, "{factor} of {text:?}"),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
});
