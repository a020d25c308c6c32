//! A clock: rows at a fixed rate, timed by another stream.
//!
//! Pseudo-measurements (a non-holonomic constraint, for example) need a time at which they are used. The clock emits an
//! empty row at most once per period of its source; with `min_speed`, only while the vehicle moves. While a source that
//! drives the process is silent, the clock continues with the steps in which the process coasts.

use fusion_core::literal;
use fusion_core::memory;
use fusion_core::model::Literal;
use fusion_core::runner::{Emitter, Stage};
use fusion_core::state::{Quantity, Velocity, View};
use fusion_core::time::Time;

/// The runtime stage.
#[derive(Clone, Debug, Literal)]
pub struct Periodic {
    period: i64,
    min_speed: Option<(Quantity<Velocity>, f64)>,
    next: Time,
}
memory!(Periodic { next; period, min_speed });

impl Periodic {
    fn tick(&mut self, time: Time, view: Option<&View<'_>>, out: &mut Emitter<'_>) {
        if time < self.next {
            return;
        }
        // The grid is fixed, independent of when the vehicle starts to move; half a nanosecond of stamp rounding must
        // not cost a period.
        let slots = time.nanos().div_euclid(self.period) + 1;
        self.next = Time::from_nanos(slots.saturating_mul(self.period));
        if let Some((velocity, min_speed)) = &self.min_speed {
            let moving = view.is_some_and(|v| v.get(velocity).norm() > *min_speed);
            if !moving {
                return;
            }
        }
        out.emit(time, &[]);
    }
}

impl Stage for Periodic {
    fn row(&mut self, _: usize, time: Time, _: &[f64], view: Option<&View<'_>>, out: &mut Emitter<'_>) {
        self.tick(time, view, out);
    }

    fn silence(&mut self, time: Time, view: &View<'_>, out: &mut Emitter<'_>) {
        self.tick(time, Some(view), out);
    }

    literal!();
}

#[cfg(feature = "declare")]
pub use spec::*;

#[cfg(feature = "declare")]
mod spec {
    use super::*;
    use crate::block::{Build, BuildError, Channel, Listen, StageSpec};
    use crate::de::DeserializeSpec;
    use crate::units::{NonNegative, Positive, dim};
    use crate::vocabulary::state;
    use fusion_core::time::nanos;
    use schemars::JsonSchema;

    /// Emits empty rows at a fixed rate: the timing of a pseudo-measurement.
    #[derive(Debug, DeserializeSpec, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct PeriodicSpec {
        /// The stream whose stamps drive the clock, e.g. the IMU.
        source: String,
        /// Rows per second, at most the source's own rate.
        rate: Positive<dim::Frequency>,
        /// Emit only while the estimated speed exceeds this.
        min_speed: Option<NonNegative<dim::Speed>>,
    }

    crate::register!(
        Stage,
        "periodic",
        PeriodicSpec,
        r#"
source = "imu"
rate = "10 Hz"
min_speed = "1 m/s"
"#
    );

    #[typetag::deserialize(name = "periodic")]
    impl StageSpec for PeriodicSpec {
        fn inputs(&self) -> Vec<Listen> {
            vec![Listen {
                source: self.source.clone(),
                channels: Vec::new(),
            }]
        }

        fn output(&self) -> Vec<Channel> {
            Vec::new()
        }

        fn build(&self, b: &mut Build<'_>) -> Result<Box<dyn Stage>, BuildError> {
            let min_speed = match self.min_speed {
                Some(speed) => Some((b.quantity(state::VELOCITY)?, speed.si())),
                None => None,
            };
            Ok(Box::new(Periodic {
                // Two rows are never closer than this.
                period: nanos(1.0 / self.rate.si()).max(1),
                min_speed,
                next: Time::MIN,
            }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::block::{Build, StageSpec};
    use crate::earth::Gravity;
    use fusion_core::state::LayoutBuilder;

    /// How many of eleven rows, 10 ms apart, are emitted at a rate.
    fn emitted(rate: &str) -> usize {
        let spec: PeriodicSpec = toml::from_str(&format!("source = 'imu'\nrate = '{rate}'")).unwrap();
        let mut layout = LayoutBuilder::new();
        let mut build = Build {
            name: "clock",
            layout: &mut layout,
            origin: None,
            gravity: Gravity::default(),
        };
        let mut stage = spec.build(&mut build).unwrap();
        let mut out = Emitter::default();
        (0..=10).for_each(|k| stage.row(0, Time::from_nanos(k * 10_000_000), &[], None, &mut out));
        out.rows().count()
    }

    #[test]
    fn rows_come_at_the_rate_and_not_above_that_of_the_source() {
        assert_eq!(emitted("50 Hz"), 6);
        assert_eq!(emitted("100 Hz"), 11);
        assert_eq!(emitted("1e12 Hz"), 11);
    }
}
