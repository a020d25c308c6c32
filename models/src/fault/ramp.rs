//! An offset that grows steadily: a drifting instrument, a receiver that is led away slowly.

use super::target::Target;
use super::{Fault, FaultContext, FaultSpec, RowOutcome, Windows};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{Dimensional, PerAxis, dim, range};
use core::ops::Range;
use fusion_core::time::Time;
use schemars::JsonSchema;

/// From the beginning of a window on, an offset that grows steadily is added to a channel; at the
/// end of the window it is gone.
///
/// The offset after the time t in the window is `rate`·t. A gate that judges each measurement by
/// itself follows a slow ramp. A spoofed receiver is led away like this.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RampSpec {
    /// The channel; may be left out where the source has only one.
    channel: Option<String>,
    /// When, in the time of the log; `from` is required. Without an end the offset grows for ever.
    window: Windows,
    /// How fast it grows, one quantity per axis: for a position metres per second north, east, down.
    rate: PerAxis,
}

crate::register!(
    Fault,
    "ramp",
    RampSpec,
    r#"
channel = "position"
window = { from = "120 s", duration = "60 s" }
rate = ["0.5 m/s", 0, 0]
"#
);

#[typetag::deserialize(name = "ramp")]
impl FaultSpec for RampSpec {
    fn windows(&self) -> Windows {
        self.window.clone()
    }

    fn build(&self, context: &FaultContext<'_>) -> Result<Box<dyn Fault>, BuildError> {
        let target = Target::find(context, self.channel.as_deref())?;
        let degrees = target.degrees();
        let per_second = target.dimension().times(dim::Frequency::KIND.dimension);
        let per_second = per_second.ok_or_else(|| BuildError::at("channel", "its dimension has no rate of change"))?;
        // A direction is needed: one number does not hold for every axis.
        let rate = self.rate.directed::<range::Finite>(&vec![per_second; degrees]);
        let rate = rate.map_err(|e| BuildError::quantity("rate", &e))?;
        if self.window.contains(Time::MIN) {
            let error = BuildError::at("window", "a ramp begins at zero, and its window has no beginning");
            return Err(error.help("add `from` to the window"));
        }
        Ok(Box::new(Ramp {
            by: vec![0.0; rate.len()],
            target,
            rate,
            window: self.window.clone(),
        }))
    }
}

#[derive(Debug)]
struct Ramp {
    target: Target,
    /// Per axis, SI per second.
    rate: Vec<f64>,
    by: Vec<f64>,
    window: Windows,
}

impl Fault for Ramp {
    fn columns(&self) -> Range<usize> {
        self.target.columns()
    }

    fn apply(&mut self, time: Time, row: &mut [f64]) -> RowOutcome {
        // At the first instant the offset is still zero.
        let grown = self.window.containing(time).map_or(0.0, |w| time.seconds_since(w.from));
        if grown <= 0.0 {
            return RowOutcome::Untouched;
        }
        self.by.iter_mut().zip(&self.rate).for_each(|(by, rate)| *by = rate * grown);
        self.target.displace(row, &self.by);
        RowOutcome::Disturbed
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{ROW, build};
    use super::*;

    fn heights(text: &str) -> Vec<f64> {
        let mut ramp = build::<RampSpec>(text, 1).unwrap();
        let mut one = |k: u8| {
            let mut row = ROW;
            let outcome = ramp.apply(Time::from_seconds(f64::from(k)), &mut row);
            assert_eq!(outcome == RowOutcome::Disturbed, row != ROW, "{k} s");
            row[2] - ROW[2]
        };
        (0..9).map(&mut one).collect()
    }

    #[test]
    fn an_offset_grows_from_zero_and_is_gone_after_the_window() {
        let seen = heights("channel = 'position'\nwindow = { from = 2, to = 6 }\nrate = [0, 0, '-0.5 m/s']");
        assert_eq!(seen, [0.0, 0.0, 0.0, 0.5, 1.0, 1.5, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn every_repetition_begins_at_zero_and_an_open_window_grows_on() {
        let seen = heights("channel = 'position'\nwindow = { from = 1, duration = 2, every = 3 }\nrate = [0, 0, -1]");
        assert_eq!(seen, [0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
        let seen = heights("channel = 'position'\nwindow = { from = 5 }\nrate = [0, 0, -1]");
        assert_eq!(seen, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0]);
    }

    #[test]
    fn its_dimension_direction_and_beginning_are_asked_for() {
        let said = |text| build::<RampSpec>(text, 1).unwrap_err();
        assert_eq!(
            said("channel = 'velocity'\nwindow = { from = 1 }\nrate = ['1 m/s', 0, 0]"),
            "rate.0: \"1 m/s\" is a speed [m/s]; an acceleration [m/s^2] is expected here, e.g. \"1 mg\""
        );
        assert_eq!(
            said("channel = 'velocity'\nwindow = { from = 1 }\nrate = 1"),
            r#"rate: 3 values are expected here, e.g. ["1 mg", "1 mg", "1 mg"], not 1"#
        );
        assert_eq!(
            said("channel = 'velocity'\nwindow = { to = 9 }\nrate = [1, 0, 0]"),
            "window: a ramp begins at zero, and its window has no beginning / add `from` to the window"
        );
    }
}
