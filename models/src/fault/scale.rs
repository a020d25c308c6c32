//! A wrong scale factor, or a wrong sign.

use super::target::Target;
use super::{Fault, FaultContext, FaultSpec, RowOutcome, Windows};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{Dimension, PerAxis, range};
use core::ops::Range;
use fusion_core::time::Time;
use schemars::JsonSchema;

/// A channel is multiplied by a factor; −1 is a wrong sign.
///
/// For plain numbers and angles: a position or an attitude has no scale.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScaleSpec {
    /// The channel; may be left out where the source has only one.
    channel: Option<String>,
    /// The factor, one for all axes or one per axis.
    factor: PerAxis,
    /// When it acts; always by default.
    #[serde(default)]
    window: Windows,
}

crate::register!(
    Fault,
    "scale",
    ScaleSpec,
    r#"
channel = "velocity"
factor = [1.1, 1.1, -1]
"#
);

#[typetag::deserialize(name = "scale")]
impl FaultSpec for ScaleSpec {
    fn windows(&self) -> Windows {
        self.window.clone()
    }

    fn build(&self, context: &FaultContext<'_>) -> Result<Box<dyn Fault>, BuildError> {
        let target = Target::find(context, self.channel.as_deref())?;
        if !target.has_scale() {
            let error = BuildError::at("channel", "a position or an attitude has no scale");
            return Err(error.help("disturb it by `bias_step`, `spike` or `ramp`"));
        }
        let factor = self.factor.si::<range::Finite>(&vec![Dimension::NONE; target.degrees()]);
        let factor = factor.map_err(|e| BuildError::quantity("factor", &e))?;
        Ok(Box::new(Scale {
            target,
            factor,
            window: self.window.clone(),
        }))
    }
}

#[derive(Debug)]
struct Scale {
    target: Target,
    factor: Vec<f64>,
    window: Windows,
}

impl Fault for Scale {
    fn columns(&self) -> Range<usize> {
        self.target.columns()
    }

    fn apply(&mut self, time: Time, row: &mut [f64]) -> RowOutcome {
        if !self.window.contains(time) {
            return RowOutcome::Untouched;
        }
        // A zero has neither scale nor sign.
        if self.target.stretch(row, &self.factor) {
            RowOutcome::Disturbed
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
    fn axes_are_scaled_and_turned_during_the_window_only() {
        let mut fault = build::<ScaleSpec>("channel = 'velocity'\nfactor = [2, 1, -1]\nwindow = { from = 5, to = 6 }", 1).unwrap();
        let mut after = |seconds: f64| {
            let mut row = ROW;
            let outcome = fault.apply(Time::from_seconds(seconds), &mut row);
            assert_eq!((&row[..3], &row[6..]), (&ROW[..3], &ROW[6..]));
            (outcome, [row[3], row[4], row[5]])
        };
        assert_eq!(after(4.9), (RowOutcome::Untouched, [1.0, 2.0, 3.0]));
        assert_eq!(after(5.0), (RowOutcome::Disturbed, [2.0, 2.0, -3.0]));
        assert_eq!(after(6.0), (RowOutcome::Untouched, [1.0, 2.0, 3.0]));
        let mut still = ROW;
        still[3..6].fill(0.0);
        assert_eq!(fault.apply(Time::from_seconds(5.5), &mut still), RowOutcome::Untouched);
    }

    #[test]
    fn an_angle_stays_within_a_turn() {
        let mut fault = build::<ScaleSpec>("channel = 'heading'\nfactor = 8", 1).unwrap();
        let mut row = ROW;
        fault.apply(Time::default(), &mut row);
        assert_eq!(row[6], 4.0 - std::f64::consts::TAU);
    }

    #[test]
    fn a_place_and_an_attitude_have_no_scale() {
        for channel in ["position", "attitude"] {
            let said = build::<ScaleSpec>(&format!("channel = '{channel}'\nfactor = 2"), 1).unwrap_err();
            let expected = "channel: a position or an attitude has no scale / disturb it by `bias_step`, `spike` or `ramp`";
            assert_eq!(said, expected);
        }
    }
}
