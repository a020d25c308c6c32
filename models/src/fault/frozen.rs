//! A sensor that repeats its last value.

use super::target::Target;
use super::{Fault, FaultContext, FaultSpec, RowOutcome, Windows};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use core::ops::Range;
use fusion_core::time::Time;
use schemars::JsonSchema;

/// During a window, a channel repeats its last value; the stamps go on.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrozenSpec {
    /// The channel; all of them by default.
    channel: Option<String>,
    /// When, in the time of the log.
    window: Windows,
}

crate::register!(
    Fault,
    "frozen",
    FrozenSpec,
    r#"
window = { from = "200 s", to = "210 s" }
"#
);

#[typetag::deserialize(name = "frozen")]
impl FaultSpec for FrozenSpec {
    fn windows(&self) -> Windows {
        self.window.clone()
    }

    fn build(&self, context: &FaultContext<'_>) -> Result<Box<dyn Fault>, BuildError> {
        Ok(Box::new(Frozen {
            columns: Target::columns_of(context, self.channel.as_deref())?,
            window: self.window.clone(),
            last: None,
        }))
    }
}

#[derive(Debug)]
struct Frozen {
    columns: Range<usize>,
    window: Windows,
    last: Option<Vec<f64>>,
}

impl Fault for Frozen {
    fn columns(&self) -> Range<usize> {
        self.columns.clone()
    }

    fn apply(&mut self, time: Time, row: &mut [f64]) -> RowOutcome {
        let value = &mut row[self.columns.clone()];
        match &mut self.last {
            Some(last) if self.window.contains(time) => {
                value.copy_from_slice(last);
                RowOutcome::Disturbed
            }
            // A log that begins frozen repeats its first value.
            Some(last) => {
                last.copy_from_slice(value);
                RowOutcome::Untouched
            }
            None => {
                self.last = Some(value.to_vec());
                RowOutcome::Untouched
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{ROW, build};
    use super::*;

    fn heights(text: &str) -> Vec<(f64, f64)> {
        let mut frozen = build::<FrozenSpec>(text, 1).unwrap();
        let mut one = |k: u8| {
            let mut row = ROW;
            (row[2], row[5]) = (f64::from(k), f64::from(k));
            frozen.apply(Time::from_seconds(f64::from(k)), &mut row);
            (row[2], row[5])
        };
        (0..6).map(&mut one).collect()
    }

    #[test]
    fn a_frozen_channel_repeats_its_last_value_and_others_go_on() {
        let seen = heights("channel = 'position'\nwindow = { from = 2, to = 4 }");
        assert_eq!(seen, [(0.0, 0.0), (1.0, 1.0), (1.0, 2.0), (1.0, 3.0), (4.0, 4.0), (5.0, 5.0)]);
    }

    #[test]
    fn without_a_channel_the_whole_row_freezes_even_from_the_beginning() {
        let seen = heights("window = { to = 3 }");
        assert_eq!(seen, [(0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (3.0, 3.0), (4.0, 4.0), (5.0, 5.0)]);
    }
}
