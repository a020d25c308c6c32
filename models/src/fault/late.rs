//! Rows that arrive after newer ones.

use super::random::strikes;
use super::{Fault, FaultContext, FaultSpec, RowOutcome, Windows};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::{Positive, Probability, dim};
use core::ops::Range;
use fusion_core::time::{Time, nanos};
use schemars::JsonSchema;

/// Rows arrive late, with the stamps that they had: out of order.
///
/// A late row comes as soon as the log has reached its stamp and `by`. With a `rate` below 1 the
/// rows of the source itself change places.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LateSpec {
    /// How late.
    by: Positive<dim::Duration>,
    /// Share of the rows that are late; all of them by default.
    #[serde(default)]
    rate: Option<Probability>,
    /// When it acts; always by default.
    #[serde(default)]
    window: Windows,
}

crate::register!(
    Fault,
    "late",
    LateSpec,
    r#"
by = "0.5 s"
rate = "30 %"
"#
);

#[typetag::deserialize(name = "late")]
impl FaultSpec for LateSpec {
    fn windows(&self) -> Windows {
        self.window.clone()
    }

    fn build(&self, context: &FaultContext<'_>) -> Result<Box<dyn Fault>, BuildError> {
        Ok(Box::new(Late {
            by: nanos(self.by.si()).max(1),
            rate: self.rate.map_or(1.0, |r| r.si()),
            window: self.window.clone(),
            seed: context.seed,
        }))
    }
}

#[derive(Debug)]
struct Late {
    by: i64,
    rate: f64,
    window: Windows,
    seed: u64,
}

impl Fault for Late {
    fn columns(&self) -> Range<usize> {
        0..0
    }

    fn apply(&mut self, time: Time, _: &mut [f64]) -> RowOutcome {
        if self.window.contains(time) && strikes(self.seed, time, self.rate) {
            RowOutcome::Delayed { by: self.by }
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
    fn a_share_of_the_rows_is_late_and_all_of_them_without_one() {
        let late = |text: &str| {
            let mut fault = build::<LateSpec>(text, 7).unwrap();
            let mut is_late =
                |k: i64| fault.apply(Time::from_nanos(k * 10_000_000), &mut ROW.clone()) == RowOutcome::Delayed { by: 300_000_000 };
            (0..10_000).filter(|k| is_late(*k)).count()
        };
        // 2500 ± 43 (1σ of the binomial): 5σ.
        assert!(late("by = '300 ms'\nrate = '25 %'").abs_diff(2500) < 217);
        assert_eq!(late("by = '300 ms'\nwindow = { from = 10, to = 20 }"), 1000);
    }
}
