//! Rows that arrive more than once.

use super::random::strikes;
use super::{Fault, FaultContext, FaultSpec, RowOutcome, Windows};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::Probability;
use core::num::NonZeroU32;
use core::ops::Range;
use fusion_core::time::Time;
use schemars::JsonSchema;

/// Rows arrive again, with the same stamp and the same numbers.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DuplicateSpec {
    /// How many copies follow a row; one by default.
    #[serde(default)]
    copies: Option<NonZeroU32>,
    /// Share of the rows that are repeated; all of them by default.
    #[serde(default)]
    rate: Option<Probability>,
    /// When it acts; always by default.
    #[serde(default)]
    window: Windows,
}

crate::register!(
    Fault,
    "duplicate",
    DuplicateSpec,
    r#"
rate = "10 %"
"#
);

#[typetag::deserialize(name = "duplicate")]
impl FaultSpec for DuplicateSpec {
    fn windows(&self) -> Windows {
        self.window.clone()
    }

    fn build(&self, context: &FaultContext<'_>) -> Result<Box<dyn Fault>, BuildError> {
        Ok(Box::new(Duplicate {
            copies: self.copies.map_or(1, NonZeroU32::get),
            rate: self.rate.map_or(1.0, |r| r.si()),
            window: self.window.clone(),
            seed: context.seed,
        }))
    }
}

#[derive(Debug)]
struct Duplicate {
    copies: u32,
    rate: f64,
    window: Windows,
    seed: u64,
}

impl Fault for Duplicate {
    fn columns(&self) -> Range<usize> {
        0..0
    }

    fn apply(&mut self, time: Time, _: &mut [f64]) -> RowOutcome {
        if self.window.contains(time) && strikes(self.seed, time, self.rate) {
            RowOutcome::Repeated { copies: self.copies }
        } else {
            RowOutcome::Untouched
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{ROW, build};
    use super::*;

    #[test]
    fn rows_of_the_window_are_repeated_as_often_as_declared() {
        let mut fault = build::<DuplicateSpec>("copies = 3\nwindow = { from = 2, to = 4 }", 1).unwrap();
        let seen: Vec<RowOutcome> = (1..5)
            .map(|k| fault.apply(Time::from_seconds(f64::from(k)), &mut ROW.clone()))
            .collect();
        let thrice = RowOutcome::Repeated { copies: 3 };
        assert_eq!(seen, [RowOutcome::Untouched, thrice, thrice, RowOutcome::Untouched]);
        assert!(build::<DuplicateSpec>("copies = 0", 1).is_err());
    }
}
