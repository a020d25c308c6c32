//! Rows that arrive without numbers.

use super::target::Target;
use super::{Fault, FaultContext, FaultSpec, RowOutcome, Windows};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use core::ops::Range;
use fusion_core::time::Time;
use schemars::JsonSchema;

/// During a window, a channel says NaN; the rows arrive all the same.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NotANumberSpec {
    /// The channel; all of them by default.
    channel: Option<String>,
    /// When, in the time of the log.
    window: Windows,
}

crate::register!(
    Fault,
    "not_a_number",
    NotANumberSpec,
    r#"
window = { from = "200 s", to = "201 s" }
"#
);

#[typetag::deserialize(name = "not_a_number")]
impl FaultSpec for NotANumberSpec {
    fn windows(&self) -> Windows {
        self.window.clone()
    }

    fn build(&self, context: &FaultContext<'_>) -> Result<Box<dyn Fault>, BuildError> {
        Ok(Box::new(NotANumber {
            columns: Target::columns_of(context, self.channel.as_deref())?,
            window: self.window.clone(),
        }))
    }
}

#[derive(Debug)]
struct NotANumber {
    columns: Range<usize>,
    window: Windows,
}

impl Fault for NotANumber {
    fn columns(&self) -> Range<usize> {
        self.columns.clone()
    }

    fn apply(&mut self, time: Time, row: &mut [f64]) -> RowOutcome {
        if !self.window.contains(time) {
            return RowOutcome::Untouched;
        }
        row[self.columns.clone()].fill(f64::NAN);
        RowOutcome::Disturbed
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{ROW, build};
    use super::*;

    #[test]
    fn a_channel_or_the_whole_row_loses_its_numbers_during_the_window() {
        let lost = |text: &str, at: f64| -> Vec<usize> {
            let mut fault = build::<NotANumberSpec>(text, 1).unwrap();
            let mut row = ROW;
            fault.apply(Time::from_seconds(at), &mut row);
            (0..row.len()).filter(|i| row[*i].is_nan()).collect()
        };
        assert_eq!(lost("channel = 'velocity'\nwindow = { from = 1, to = 2 }", 1.5), [3, 4, 5]);
        assert_eq!(lost("window = { from = 1, to = 2 }", 1.0), (0..ROW.len()).collect::<Vec<_>>());
        assert!(lost("window = { from = 1, to = 2 }", 2.0).is_empty());
    }
}
