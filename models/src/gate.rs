//! Gate policies as TOML declares them.

use crate::block::{BuildError, GateSpec};
use crate::units::{NonNegative, Positive, Probability, dim};
use fusion_core::gate::{Gate, Nis, Open, Recovery};
use schemars::JsonSchema;
use serde::Deserialize;

/// Accepts everything; its NIS is still reported.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoneSpec {}

crate::register!(Gate, "none", NoneSpec, "");

#[typetag::deserialize(name = "none")]
impl GateSpec for NoneSpec {
    fn build(&self) -> Result<Box<dyn Gate>, BuildError> {
        Ok(Box::new(Open))
    }
}

/// When a gate that has been rejecting counts its sensor as denied, and how it comes back.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RecoverySpec {
    /// Consecutive rejections after which the sensor counts as denied.
    deny_after: u32,
    /// Consecutive measurements that pass, after which a denied sensor is followed again.
    resume_after: u32,
    /// How long a denied sensor must have been rejected before five fixes that agree with each
    /// other are believed against the estimate.
    readopt_after: NonNegative<dim::Duration>,
    /// After a pause of this length, five fixes that agree are believed at once.
    gap: Positive<dim::Duration>,
    /// Never believe the sensor against the estimate: for pseudo-measurements, which agree with
    /// each other by construction.
    never_readopt: bool,
}

impl Default for RecoverySpec {
    fn default() -> Self {
        let r = Recovery::default();
        Self {
            deny_after: r.deny_after,
            resume_after: r.resume_after,
            readopt_after: NonNegative::try_from_si(r.readopt_after).unwrap_or_default(),
            gap: Positive::try_from_si(r.gap).unwrap_or_else(|_| unreachable!("the default gap is positive")),
            never_readopt: false,
        }
    }
}

impl RecoverySpec {
    fn build(&self) -> Recovery {
        let never = |seconds: f64| if self.never_readopt { f64::INFINITY } else { seconds };
        Recovery {
            deny_after: self.deny_after,
            resume_after: self.resume_after,
            readopt_after: never(self.readopt_after.si()),
            gap: never(self.gap.si()),
            ..Recovery::default()
        }
    }
}

/// Rejects what a consistent filter would see too seldom: NIS above a χ² quantile.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NisSpec {
    /// The share of good measurements that passes, e.g. 0.999.
    probability: Probability,
    /// How the gate avoids a lock-out.
    #[serde(default)]
    recovery: RecoverySpec,
}

crate::register!(Gate, "nis", NisSpec, r#"
probability = 0.999
recovery = { deny_after = 5, resume_after = 3, readopt_after = "30 s", gap = "10 s", never_readopt = false }
"#);

#[typetag::deserialize(name = "nis")]
impl GateSpec for NisSpec {
    fn build(&self) -> Result<Box<dyn Gate>, BuildError> {
        let p = self.probability.si();
        if !(0.5..1.0).contains(&p) {
            let message = format!("a gate that passes {p} of the good measurements is none");
            return Err(BuildError::at("probability", message).help("write a probability from 0.5 to below 1, e.g. 0.999; `none` passes everything"));
        }
        Ok(Box::new(Nis::new(p, self.recovery.build())))
    }
}
