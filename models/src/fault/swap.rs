//! Two numbers of a channel that have changed places.

use super::target::Target;
use super::{Fault, FaultContext, FaultSpec, RowOutcome, Windows};
use crate::block::{BuildError, Shape};
use crate::de::DeserializeSpec;
use core::ops::Range;
use fusion_core::time::Time;
use schemars::JsonSchema;

/// Two numbers of a channel change places, such as latitude and longitude.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SwapSpec {
    /// The channel; may be left out where the source has only one.
    channel: Option<String>,
    /// Which two of its numbers, counted from 0; the first two by default. An attitude is a quaternion w, x, y, z.
    numbers: Option<[usize; 2]>,
    /// When it acts; always by default.
    #[serde(default)]
    window: Windows,
}

crate::register!(
    Fault,
    "swap",
    SwapSpec,
    r#"
channel = "velocity"
numbers = [0, 1]
"#
);

#[typetag::deserialize(name = "swap")]
impl FaultSpec for SwapSpec {
    fn windows(&self) -> Windows {
        self.window.clone()
    }

    fn build(&self, context: &FaultContext<'_>) -> Result<Box<dyn Fault>, BuildError> {
        let target = Target::find(context, self.channel.as_deref())?;
        let [a, b] = self.numbers.unwrap_or([0, 1]);
        let columns = target.columns();
        // A height in place of a latitude would be another fault.
        let count = if target.shape() == Shape::Geodetic { 2 } else { columns.len() };
        if count < 2 {
            let error = BuildError::at("channel", "the channel has one number: there is nothing to swap");
            return Err(error.help("swap numbers of a channel that has two at least"));
        }
        if a == b || a.max(b) >= count {
            let error = BuildError::at(
                "numbers",
                format!("[{a}, {b}] are not two numbers of the channel that can be swapped"),
            );
            return Err(error.help(format!("two different ones of 0 to {}", count - 1)));
        }
        Ok(Box::new(Swap {
            at: [columns.start + a, columns.start + b],
            columns,
            window: self.window.clone(),
        }))
    }
}

#[derive(Debug)]
struct Swap {
    columns: Range<usize>,
    /// Their indices in the row.
    at: [usize; 2],
    window: Windows,
}

impl Fault for Swap {
    fn columns(&self) -> Range<usize> {
        self.columns.clone()
    }

    fn apply(&mut self, time: Time, row: &mut [f64]) -> RowOutcome {
        let [a, b] = self.at;
        // Equal ones look the same in either place.
        if !self.window.contains(time) || row[a] == row[b] {
            return RowOutcome::Untouched;
        }
        row.swap(a, b);
        RowOutcome::Disturbed
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{ROW, build};
    use super::*;

    #[test]
    fn two_numbers_change_places_during_the_window_only() {
        let mut fault = build::<SwapSpec>("channel = 'velocity'\nnumbers = [0, 2]\nwindow = { from = 5, to = 6 }", 1).unwrap();
        let mut after = |seconds: f64| {
            let mut row = ROW;
            let outcome = fault.apply(Time::from_seconds(seconds), &mut row);
            assert_eq!((&row[..3], &row[6..]), (&ROW[..3], &ROW[6..]));
            (outcome, [row[3], row[4], row[5]])
        };
        assert_eq!(after(4.9), (RowOutcome::Untouched, [1.0, 2.0, 3.0]));
        assert_eq!(after(5.0), (RowOutcome::Disturbed, [3.0, 2.0, 1.0]));
        assert_eq!(after(6.0), (RowOutcome::Untouched, [1.0, 2.0, 3.0]));
        let mut equal = ROW;
        equal[5] = equal[3];
        assert_eq!(fault.apply(Time::from_seconds(5.5), &mut equal), RowOutcome::Untouched);
    }

    #[test]
    fn latitude_and_longitude_are_swapped_as_they_stand() {
        let mut row = ROW;
        build::<SwapSpec>("channel = 'position'", 1)
            .unwrap()
            .apply(Time::default(), &mut row);
        assert_eq!(row[..3], [ROW[1], ROW[0], ROW[2]]);
    }

    #[test]
    fn numbers_that_cannot_be_swapped_are_refused() {
        let said = |text| build::<SwapSpec>(text, 1).unwrap_err();
        assert_eq!(
            said("channel = 'position'\nnumbers = [0, 2]"),
            "numbers: [0, 2] are not two numbers of the channel that can be swapped / two different ones of 0 to 1"
        );
        assert_eq!(
            said("channel = 'velocity'\nnumbers = [1, 1]"),
            "numbers: [1, 1] are not two numbers of the channel that can be swapped / two different ones of 0 to 2"
        );
        assert_eq!(
            said("channel = 'heading'"),
            "channel: the channel has one number: there is nothing to swap / swap numbers of a channel that has two at least"
        );
    }
}
