//! Checks that a magnetic field is the Earth's: compares its size and dip with the undisturbed ones.
//!
//! Smoothed   horizontal and downward part of the field, each by a first-order low-pass. Turns of the body
//!            and yaw do not change these parts, so only noise averages out
//! Difference d \[T\] of the smoothed parts from the reference: the visible part of a disturbance. The part
//!            that turns the heading is as large and invisible, so d may be the noise of fields that pass
//! Hold-off   after a wrong field, the field must look right for a while before it is used again. At the
//!            edge of a disturbance, and if the body turns in it, wrong fields sometimes look right

use super::field::Field;
use fusion_core::math;
use fusion_core::memory;
use fusion_core::model::Literal;
use fusion_core::time::Time;
use nalgebra::Vector2;

/// The properties of a field that do not change with a turn about the vertical.
#[derive(Clone, Copy, Debug, Default, Literal)]
pub struct Shape {
    magnitude: f64,
    dip: f64,
}
memory!(Shape { magnitude, dip });

impl Shape {
    /// Horizontal and downward parts.
    fn parts(&self) -> Vector2<f64> {
        let (sin, cos) = math::sin_cos(self.dip);
        Vector2::new(cos, sin) * self.magnitude
    }

    /// From horizontal and downward parts.
    fn of(parts: &Vector2<f64>) -> Self {
        Self {
            magnitude: parts.norm(),
            dip: math::atan2(parts.y, parts.x),
        }
    }
}

/// The gate with its memory.
#[derive(Clone, Copy, Debug, Literal)]
pub struct FieldGate {
    enabled: bool,
    magnitude: f64,
    dip: f64,
    smooth_over: f64,
    hold_off: f64,
    adopt_after: f64,
    learn_for: f64,
    /// The undisturbed field, once declared or learnt.
    reference: Option<Shape>,
    /// While learning: the start time, the number of fields, and their mean.
    learning: Option<(Time, f64, Vector2<f64>)>,
    /// The smoothed field and its time.
    smooth: Option<(Vector2<f64>, Time)>,
    /// A different field, and the time of its first sample.
    other: Option<(Shape, Time)>,
    /// When the field was last out of bounds.
    wrong_at: Option<Time>,
}
memory!(FieldGate {
    reference, learning, smooth, other, wrong_at;
    enabled, magnitude, dip, smooth_over, hold_off, adopt_after, learn_for
});

impl FieldGate {
    /// The difference \[T\] from the undisturbed field, or `None` if the gate rejects this field. A field passes if it
    /// looks undisturbed, for long enough. The difference is 0 while the undisturbed field is learnt.
    pub fn judge(&mut self, seen: &Field, time: Time) -> Option<f64> {
        let (magnitude, dip) = (seen.magnitude, seen.dip);
        let parts = Shape { magnitude, dip }.parts();
        let Some(reference) = self.reference.or_else(|| self.learn(&parts, time)) else {
            return Some(0.0);
        };
        let smooth = self.smoothed(&parts, time);
        let passes = self.passes(&Shape::of(&smooth), &reference, time) || !self.enabled;
        passes.then(|| (smooth - reference.parts()).norm())
    }

    fn passes(&mut self, now: &Shape, reference: &Shape, time: Time) -> bool {
        if self.near(now, reference) {
            self.other = None;
            return self.wrong_at.is_none_or(|at| time.seconds_since(at) >= self.hold_off);
        }
        self.wrong_at = Some(time);
        match self.other {
            Some((other, since)) if self.near(now, &other) => {
                if time.seconds_since(since) >= self.adopt_after {
                    (self.reference, self.other) = (Some(other), None);
                }
            }
            _ => self.other = Some((*now, time)),
        }
        false
    }

    fn near(&self, a: &Shape, b: &Shape) -> bool {
        (a.magnitude / b.magnitude - 1.0).abs() <= self.magnitude && (a.dip - b.dip).abs() <= self.dip
    }

    /// Averages the fields at the start; returns the reference after the learning time.
    fn learn(&mut self, parts: &Vector2<f64>, time: Time) -> Option<Shape> {
        let (since, count, mean) = self.learning.get_or_insert((time, 0.0, Vector2::zeros()));
        if *count > 0.0 && time.seconds_since(*since) >= self.learn_for {
            self.reference = Some(Shape::of(mean));
        } else {
            *count += 1.0;
            *mean += (parts - *mean) / *count;
        }
        self.reference
    }

    fn smoothed(&mut self, parts: &Vector2<f64>, time: Time) -> Vector2<f64> {
        let smooth = match self.smooth {
            Some((before, at)) if self.smooth_over > 0.0 => {
                let share = -math::exp_m1(-time.seconds_since(at) / self.smooth_over);
                before + (parts - before) * share
            }
            _ => *parts,
        };
        self.smooth = Some((smooth, time));
        smooth
    }
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::units::{self, NonNegative, Positive, Quantity, dim};
    use schemars::JsonSchema;
    use serde::Deserialize;

    /// Rejects the headings of a field that is not the Earth's: with another size or dip.
    #[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields, default)]
    pub struct FieldGateSpec {
        /// False accepts every field.
        pub(crate) enabled: bool,
        /// The undisturbed field; by default it is learnt at the start.
        field: Option<FieldSpec>,
        /// Largest difference of |m| from the reference, as a share of it.
        magnitude: Positive<dim::Ratio>,
        /// Largest difference of the dip from the reference.
        dip: Positive<dim::Angle>,
        /// Time constant over which the field is smoothed before it is judged.
        smooth_over: NonNegative<dim::Duration>,
        /// How long the field must have been within the bounds before headings are used again.
        hold_off: NonNegative<dim::Duration>,
        /// A different field that has been steady for this long becomes the new reference.
        adopt_after: Positive<dim::Duration>,
        /// How long the undisturbed field is averaged at the start to learn it.
        learn_for: Positive<dim::Duration>,
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
                smooth_over: NonNegative::default(),
                hold_off: NonNegative::default(),
                adopt_after: positive(60.0),
                learn_for: positive(1.0),
            }
        }
    }

    impl FieldGateSpec {
        pub(crate) fn build(&self) -> FieldGate {
            FieldGate {
                enabled: self.enabled,
                magnitude: self.magnitude.si(),
                dip: self.dip.si(),
                smooth_over: self.smooth_over.si(),
                hold_off: self.hold_off.si(),
                adopt_after: self.adopt_after.si(),
                learn_for: self.learn_for.si(),
                reference: self.field.map(|f| Shape {
                    magnitude: f.magnitude.si(),
                    dip: f.dip.si(),
                }),
                learning: None,
                smooth: None,
                other: None,
                wrong_at: None,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(magnitude: f64, dip: f64) -> Field {
        Field { turn: 0.0, magnitude, dip }
    }

    /// A gate that has learnt |m| = 50 and a dip of 1.1 rad; its closure judges a field at a second of the run.
    fn gate(smooth_over: f64, hold_off: f64) -> impl FnMut(i32, f64, f64) -> bool {
        let mut gate = FieldGateSpec::default().build();
        (gate.smooth_over, gate.hold_off) = (smooth_over, hold_off);
        let mut at = move |t: i32, magnitude, dip| gate.judge(&field(magnitude, dip), Time::from_seconds(f64::from(t))).is_some();
        assert!(at(-1, 50.0, 1.1) && at(0, 50.0, 1.1));
        at
    }

    #[test]
    fn another_field_is_left_out_and_believed_once_it_has_been_steady() {
        let mut at = gate(0.0, 0.0);
        assert!(
            at(0, 52.0, 1.14) && !at(1, 53.0, 1.1) && !at(2, 50.0, 1.16) && at(3, 50.0, 1.1),
            "the bounds are 5 % and 3°"
        );
        // A different field from second 10 on, changes at 50, and is steady until 110.
        assert!((10..50).all(|t| !at(t, 60.0, 1.1)));
        assert!((50..=110).all(|t| !at(t, 70.0, 1.1)));
        assert!(at(111, 70.0, 1.1) && !at(112, 50.0, 1.1));
    }

    #[test]
    fn another_field_that_the_right_one_interrupts_is_not_steady() {
        let mut at = gate(0.0, 0.0);
        assert!((1..40).all(|t| !at(t, 60.0, 1.1)) && at(40, 50.0, 1.1));
        assert!((41..=101).all(|t| !at(t, 60.0, 1.1)), "its 60 s begin again");
        assert!(at(102, 60.0, 1.1));
    }

    /// A declared gate; its closure judges fields in µT and degrees at given seconds.
    fn declared(toml: &str) -> impl FnMut(f64, f64, f64) -> bool + use<> {
        let mut gate = toml::from_str::<FieldGateSpec>(toml).unwrap().build();
        move |t, magnitude, dip| {
            gate.judge(&field(magnitude * 1e-6, dip.to_radians()), Time::from_seconds(t))
                .is_some()
        }
    }

    #[test]
    fn the_field_learnt_is_the_mean_over_the_time_declared_for_it() {
        let mut at = declared("learn_for = '2 s'");
        // ± 8 % about 50 µT; while it learns, every field passes.
        assert!(at(0.0, 54.0, 60.0) && at(0.5, 46.0, 60.0) && at(1.0, 54.0, 60.0) && at(1.5, 46.0, 60.0));
        assert!(at(2.0, 52.0, 60.0) && at(2.1, 48.0, 60.0));
        assert!(!at(2.2, 54.0, 60.0) && !at(2.3, 46.0, 60.0));
    }

    #[test]
    fn with_a_declared_field_the_first_sample_is_judged_by_the_bounds_declared() {
        let with = |bounds: &str| declared(&format!("{bounds}\nfield = {{ magnitude = '50 uT', dip = '60 deg' }}"));
        let mut at = with("magnitude = '10 %'\ndip = '8 deg'");
        assert!(!at(0.0, 55.5, 60.0) && at(0.1, 54.5, 60.0) && !at(0.2, 50.0, 68.5) && at(0.3, 50.0, 52.5));
        let mut at = with("hold_off = '2 s'");
        assert!(!at(0.0, 60.0, 60.0) && !at(1.9, 50.0, 60.0) && at(2.0, 50.0, 60.0));
        let mut at = with("adopt_after = '4 s'");
        assert!(!at(0.0, 60.0, 60.0) && !at(3.9, 60.0, 60.0) && !at(4.0, 60.0, 60.0) && at(4.1, 60.0, 60.0));
        // 8 % for a tenth of the time constant is 0.8 %.
        let mut at = with("smooth_over = '1 s'");
        assert!(at(0.0, 50.0, 60.0) && at(0.1, 54.0, 60.0));
    }

    #[test]
    fn after_a_wrong_field_headings_wait_until_it_has_been_right_for_the_hold_off() {
        let mut at = gate(0.0, 5.0);
        assert!(at(1, 50.0, 1.1), "nothing was wrong yet");
        assert!(!at(10, 60.0, 1.1));
        assert!((11..15).all(|t| !at(t, 50.0, 1.1)));
        // Wrong for another sample: the wait starts again.
        assert!(!at(15, 60.0, 1.1) && !at(19, 50.0, 1.1) && at(20, 50.0, 1.1));
    }

    #[test]
    fn noise_that_averages_out_is_not_a_disturbance_and_a_small_lasting_one_is() {
        // ± 8 % each second sample: unsmoothed it is out of bounds, over 10 s of smoothing below 1 %.
        let noisy = |t: i32| 50.0 + if t % 2 == 0 { 4.0 } else { -4.0 };
        let (mut raw, mut smooth) = (gate(0.0, 0.0), gate(10.0, 0.0));
        assert!((1..40).all(|t| !raw(t, noisy(t), 1.1)));
        assert!((1..40).all(|t| smooth(t, noisy(t), 1.1)));
        // A steady 8 % exceeds 5 % when 1 − exp(−t/10 s) = 5/8: after 9.8 s.
        let first = (40..80).find(|t| !smooth(*t, 54.0, 1.1)).unwrap();
        assert!((48..=50).contains(&first), "{first}");
    }
}
