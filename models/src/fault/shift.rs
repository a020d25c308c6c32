//! A constant offset, from an instant on or for a while.

use super::target::Target;
use super::{Fault, FaultContext, FaultSpec, RowOutcome, Windows};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{Duration, PerAxis, range};
use core::ops::Range;
use fusion_core::time::Time;
use schemars::JsonSchema;

/// From a given time on, a constant is added to a channel.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BiasStepSpec {
    /// The channel; may be left out where the source has only one.
    channel: Option<String>,
    /// When it begins, in the time of the log.
    at: Duration,
    /// The offset, one quantity per axis; metres north, east, down for a position.
    value: PerAxis,
}

crate::register!(
    Fault,
    "bias_step",
    BiasStepSpec,
    r#"
channel = "position"
at = "120 s"
value = ["5 m", 0, 0]
"#
);

#[typetag::deserialize(name = "bias_step")]
impl FaultSpec for BiasStepSpec {
    fn windows(&self) -> Windows {
        Windows::since(Time::from_seconds(self.at.si()))
    }

    fn build(&self, context: &FaultContext<'_>) -> Result<Box<dyn Fault>, BuildError> {
        let (target, by) = offset(context, self.channel.as_deref(), &self.value)?;
        Ok(Box::new(Shift {
            target,
            by,
            window: self.windows(),
        }))
    }
}

/// During a window, a constant is added to a channel: a jump, of a spoofed receiver too.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpikeSpec {
    /// The channel; may be left out where the source has only one.
    channel: Option<String>,
    /// When, in the time of the log.
    window: Windows,
    /// The offset, one quantity per axis; metres north, east, down for a position.
    value: PerAxis,
}

crate::register!(
    Fault,
    "spike",
    SpikeSpec,
    r#"
channel = "position"
window = { from = "120 s", duration = "2 s" }
value = ["30 m", "-20 m", 0]
"#
);

#[typetag::deserialize(name = "spike")]
impl FaultSpec for SpikeSpec {
    fn windows(&self) -> Windows {
        self.window.clone()
    }

    fn build(&self, context: &FaultContext<'_>) -> Result<Box<dyn Fault>, BuildError> {
        let (target, by) = offset(context, self.channel.as_deref(), &self.value)?;
        Ok(Box::new(Shift {
            target,
            by,
            window: self.windows(),
        }))
    }
}

/// An offset has a direction, so that one number does not hold for every axis.
fn offset(context: &FaultContext<'_>, channel: Option<&str>, value: &PerAxis) -> Result<(Target, Vec<f64>), BuildError> {
    let target = Target::find(context, channel)?;
    let axes = vec![target.dimension(); target.degrees()];
    let by = value.directed::<range::Finite>(&axes);
    Ok((target, by.map_err(|e| BuildError::quantity("value", &e))?))
}

#[derive(Debug)]
struct Shift {
    target: Target,
    by: Vec<f64>,
    window: Windows,
}

impl Fault for Shift {
    fn columns(&self) -> Range<usize> {
        self.target.columns()
    }

    fn apply(&mut self, time: Time, row: &mut [f64]) -> RowOutcome {
        if !self.window.contains(time) {
            return RowOutcome::Untouched;
        }
        self.target.displace(row, &self.by);
        RowOutcome::Disturbed
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{ROW, build};
    use super::*;

    fn after(fault: &mut dyn Fault, seconds: f64) -> [f64; 11] {
        let mut row = ROW;
        fault.apply(Time::from_seconds(seconds), &mut row);
        row
    }

    #[test]
    fn a_step_stays_and_a_spike_goes() {
        let mut step = build::<BiasStepSpec>("channel = 'velocity'\nat = 5\nvalue = [1, 0, '-2 m/s']", 1).unwrap();
        let seen: Vec<f64> = [4.9, 5.0, 99.0].map(|s| after(&mut *step, s)[5]).into();
        assert_eq!(seen, [3.0, 1.0, 1.0]);
        let mut spike = build::<SpikeSpec>("channel = 'heading'\nwindow = { from = 5, to = 6 }\nvalue = ['180 deg']", 1).unwrap();
        let seen: Vec<f64> = [4.9, 5.0, 6.0].map(|s| after(&mut *spike, s)[6]).into();
        // An angle stays within a turn.
        assert_eq!(seen, [0.5, 0.5 + std::f64::consts::PI - std::f64::consts::TAU, 0.5]);
    }

    #[test]
    fn one_number_is_no_direction() {
        let said = build::<BiasStepSpec>("channel = 'position'\nat = 5\nvalue = 3", 1).unwrap_err();
        assert_eq!(
            said,
            r#"value: 3 values are expected here, e.g. ["0.5 m", "0.5 m", "0.5 m"], not 1"#
        );
    }
}
