//! Rows that never arrive: for a stretch of time, or at random.

use super::random::strikes;
use super::{Fault, FaultContext, FaultSpec, RowOutcome, Windows};
use crate::block::BuildError;
use crate::de::DeserializeSpec;
use crate::units::Probability;
use core::ops::Range;
use fusion_core::time::Time;
use schemars::JsonSchema;

/// The source delivers no rows: an outage, whose drift is scored.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OutageSpec {
    /// When, in the time of the log.
    window: Windows,
}

crate::register!(
    Fault,
    "outage",
    OutageSpec,
    r#"
window = { from = "300 s", duration = "60 s", every = "180 s" }
"#
);

#[typetag::deserialize(name = "outage")]
impl FaultSpec for OutageSpec {
    fn windows(&self) -> Windows {
        self.window.clone()
    }

    fn outage(&self) -> Option<&Windows> {
        Some(&self.window)
    }

    fn build(&self, _: &FaultContext<'_>) -> Result<Box<dyn Fault>, BuildError> {
        Ok(Box::new(Outage {
            window: self.window.clone(),
        }))
    }
}

#[derive(Debug)]
struct Outage {
    window: Windows,
}

impl Fault for Outage {
    fn columns(&self) -> Range<usize> {
        0..0
    }

    fn apply(&mut self, time: Time, _: &mut [f64]) -> RowOutcome {
        if self.window.contains(time) {
            RowOutcome::Withheld
        } else {
            RowOutcome::Untouched
        }
    }
}

/// Rows are lost at random.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DropSpec {
    /// Share of the rows that are lost.
    rate: Probability,
    /// When it acts; always by default.
    #[serde(default)]
    window: Windows,
}

crate::register!(
    Fault,
    "drop",
    DropSpec,
    r#"
rate = "5 %"
"#
);

#[typetag::deserialize(name = "drop")]
impl FaultSpec for DropSpec {
    fn windows(&self) -> Windows {
        self.window.clone()
    }

    fn build(&self, context: &FaultContext<'_>) -> Result<Box<dyn Fault>, BuildError> {
        Ok(Box::new(Drop {
            rate: self.rate.si(),
            window: self.window.clone(),
            seed: context.seed,
        }))
    }
}

#[derive(Debug)]
struct Drop {
    rate: f64,
    window: Windows,
    seed: u64,
}

impl Fault for Drop {
    fn columns(&self) -> Range<usize> {
        0..0
    }

    fn apply(&mut self, time: Time, _: &mut [f64]) -> RowOutcome {
        let is_lost = self.window.contains(time) && strikes(self.seed, time, self.rate);
        if is_lost { RowOutcome::Withheld } else { RowOutcome::Untouched }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{ROW, build};
    use super::*;

    #[test]
    fn an_outage_withholds_its_window_and_nothing_else() {
        let mut outage = build::<OutageSpec>("window = { from = 10, to = 20 }", 1).unwrap();
        let mut gone = Vec::new();
        for s in 0..30 {
            if outage.apply(Time::from_seconds(f64::from(s)), &mut ROW.clone()) == RowOutcome::Withheld {
                gone.push(s);
            }
        }
        assert_eq!(gone, (10..20).collect::<Vec<_>>());
    }

    #[test]
    fn rows_are_lost_at_the_declared_rate_whatever_came_before() {
        let lost = |first: i64| -> Vec<i64> {
            let mut drop = build::<DropSpec>("rate = '20 %'", 7).unwrap();
            let stamp = |k: i64| Time::from_nanos(k * 10_000_000);
            (first..10_000)
                .filter(|k| drop.apply(stamp(*k), &mut ROW.clone()) == RowOutcome::Withheld)
                .collect()
        };
        let all = lost(0);
        // 2000 ± 40 (1σ of the binomial): 5σ.
        assert!(all.len().abs_diff(2000) < 200, "{}", all.len());
        let later: Vec<i64> = all.iter().copied().filter(|k| *k >= 5000).collect();
        assert_eq!(lost(5000), later);
    }
}
