//! A wrong clock.

use super::{Fault, FaultContext, FaultSpec, RowOutcome, Windows, all_columns};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::Duration;
use core::ops::Range;
use fusion_core::time::{Time, nanos};
use schemars::JsonSchema;

/// During a window, the stamps of a source are wrong by a constant; the arrival times of its rows do not change.
///
/// One hour ahead for one row is a glitch, a leap second forever is a misconfigured receiver. Gate statistics count
/// such a row as disturbed: its stamp differs from the time of its measurement.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ClockJumpSpec {
    /// Added to the stamps; negative for a clock that is late.
    by: Duration,
    /// When, in the time of the log; without `to`, forever.
    window: Windows,
}

crate::register!(
    Fault,
    "clock_jump",
    ClockJumpSpec,
    r#"
by = "1 h"
window = { from = "200 s", to = "201 s" }
"#
);

#[typetag::deserialize(name = "clock_jump")]
impl FaultSpec for ClockJumpSpec {
    fn windows(&self) -> Windows {
        self.window.clone()
    }

    fn build(&self, context: &FaultContext<'_>) -> Result<Box<dyn Fault>, BuildError> {
        let by = nanos(self.by.si());
        if by == 0 {
            return Err(BuildError::at("by", "a jump by less than a nanosecond changes nothing"));
        }
        Ok(Box::new(ClockJump {
            columns: all_columns(context.channels),
            by,
            window: self.window.clone(),
        }))
    }
}

#[derive(Debug)]
struct ClockJump {
    columns: Range<usize>,
    by: i64,
    window: Windows,
}

impl Fault for ClockJump {
    fn columns(&self) -> Range<usize> {
        self.columns.clone()
    }

    fn apply(&mut self, time: Time, _: &mut [f64]) -> RowOutcome {
        if self.window.contains(time) {
            RowOutcome::Restamped { by: self.by }
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
    fn stamps_are_wrong_during_the_window_and_numbers_are_right() {
        let mut fault = build::<ClockJumpSpec>("by = '-1 min'\nwindow = { from = 3, to = 5 }", 1).unwrap();
        let mut row = ROW;
        let seen: Vec<RowOutcome> = (2..6).map(|k| fault.apply(Time::from_seconds(f64::from(k)), &mut row)).collect();
        let back = RowOutcome::Restamped { by: -60_000_000_000 };
        assert_eq!(seen, [RowOutcome::Untouched, back, back, RowOutcome::Untouched]);
        assert_eq!((row, fault.columns()), (ROW, 0..ROW.len()));
    }

    #[test]
    fn no_jump_is_refused() {
        let said = build::<ClockJumpSpec>("by = 0\nwindow = { from = 3 }", 1).unwrap_err();
        assert_eq!(said, "by: a jump by less than a nanosecond changes nothing");
    }
}
