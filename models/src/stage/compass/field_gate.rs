//! Whether a magnetic field is the Earth's: its size and its dip against the undisturbed ones.

use super::field::Field;
use crate::units::{self, Positive, Quantity, dim};
use fusion_core::time::Time;
use schemars::JsonSchema;
use serde::Deserialize;

/// Leaves out the headings of a field that is not the Earth's: of another size or dip.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FieldGateSpec {
    /// False accepts every field.
    pub(crate) enabled: bool,
    /// The undisturbed field; by default it is learnt at the start.
    field: Option<FieldSpec>,
    /// Largest difference of |m| from that of the reference, as a share of it.
    magnitude: Positive<dim::Ratio>,
    /// Largest difference of the dip from that of the reference.
    dip: Positive<dim::Angle>,
    /// A different field that has been steady for this long becomes the new reference.
    adopt_after: Positive<dim::Duration>,
    /// How long the undisturbed field is averaged at the start, where it is learnt.
    pub(crate) learn_for: Positive<dim::Duration>,
}

/// An undisturbed field.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct FieldSpec {
    /// |m|.
    magnitude: Positive<dim::MagneticField>,
    /// Angle below the horizon.
    dip: units::Angle,
}

impl Default for FieldGateSpec {
    fn default() -> Self {
        fn positive<D: units::Dimensional>(value: f64) -> Positive<D> {
            Quantity::try_from_si(value).unwrap_or_else(|_| unreachable!("{value} is positive"))
        }
        Self {
            enabled: true,
            field: None,
            magnitude: positive(0.05),
            dip: positive(3_f64.to_radians()),
            adopt_after: positive(60.0),
            learn_for: positive(1.0),
        }
    }
}

impl FieldGateSpec {
    pub(crate) fn build(&self) -> FieldGate {
        FieldGate {
            magnitude: self.magnitude.si(),
            dip: self.dip.si(),
            adopt_after: self.adopt_after.si(),
            reference: self.field.map(|f| (f.magnitude.si(), f.dip.si())),
            other: None,
        }
    }
}

/// The gate with its memory.
#[derive(Clone, Copy, Debug)]
pub struct FieldGate {
    /// Largest relative difference of |m|.
    pub magnitude: f64,
    /// Largest difference of the dip \[rad\].
    pub dip: f64,
    /// A field that has been another one, but steady, for so long \[s\] is the new reference.
    pub adopt_after: f64,
    /// The undisturbed |m| and dip, once declared or learnt.
    pub reference: Option<(f64, f64)>,
    /// Another field, and since when.
    pub other: Option<(f64, f64, Time)>,
}

impl FieldGate {
    /// Takes `seen` for undisturbed where no field is declared.
    pub fn learn(&mut self, seen: &Field) {
        self.reference.get_or_insert((seen.magnitude, seen.dip));
    }

    /// Whether the field looks as it does undisturbed.
    pub fn passes(&mut self, seen: &Field, time: Time) -> bool {
        let (magnitude, dip) = (self.magnitude, self.dip);
        let near = |m: f64, d: f64| (seen.magnitude / m - 1.0).abs() <= magnitude && (seen.dip - d).abs() <= dip;
        if self.reference.is_none_or(|(m, d)| near(m, d)) {
            self.other = None;
            return true;
        }
        match self.other {
            Some((m, d, since)) if near(m, d) => {
                if time.seconds_since(since) >= self.adopt_after {
                    self.reference = Some((m, d));
                    self.other = None;
                }
            }
            _ => self.other = Some((seen.magnitude, seen.dip, time)),
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_field_is_left_out_and_believed_once_it_has_been_steady() {
        let mut gate = FieldGateSpec::default().build();
        let field = |magnitude: f64, dip: f64| Field { turn: 0.0, magnitude, dip };
        gate.learn(&field(50.0, 1.1));
        gate.learn(&field(10.0, 0.0));
        let mut at = |t: i32, magnitude, dip| gate.passes(&field(magnitude, dip), Time::from_seconds(f64::from(t)));
        assert!(
            at(0, 52.0, 1.14) && !at(1, 53.0, 1.1) && !at(2, 50.0, 1.16),
            "the bounds are 5 % and 3°"
        );
        // It is another field from second 10 on, moves on at 50, and is steady until 110.
        assert!((10..50).all(|t| !at(t, 60.0, 1.1)));
        assert!((50..=110).all(|t| !at(t, 70.0, 1.1)));
        assert!(at(111, 70.0, 1.1) && !at(112, 50.0, 1.1));
    }
}
