//! Gate policies as TOML declares them.

use crate::block::{BuildError, GateSpec};
use crate::units::{Dimension, Dimensional, NonNegative, Positive, Probability, dim};
use fusion_core::gate::{Ellipse, Gate, Magnitude, Nis, Open, Recovery, TwoCondition};
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

/// When a gate counts its sensor as denied, and when it re-acquires it.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RecoverySpec {
    /// Consecutive rejections after which the sensor counts as denied.
    deny_after: u32,
    /// Consecutive measurements inside the gate after which a denied sensor is used again.
    resume_after: u32,
    /// How long a sensor must have been denied before it is re-acquired: five measurements that
    /// agree with each other are then accepted against the estimate.
    reacquire_after: NonNegative<dim::Duration>,
    /// After a pause of this length the sensor is re-acquired as soon as five measurements agree
    /// with each other.
    gap: Positive<dim::Duration>,
    /// Never re-acquire the sensor: for pseudo-measurements, which always agree with each other.
    never_reacquire: bool,
}

impl Default for RecoverySpec {
    fn default() -> Self {
        let r = Recovery::default();
        Self {
            deny_after: r.deny_after,
            resume_after: r.resume_after,
            reacquire_after: NonNegative::try_from_si(r.reacquire_after).unwrap_or_default(),
            gap: Positive::try_from_si(r.gap).unwrap_or_else(|_| unreachable!("the default gap is positive")),
            never_reacquire: false,
        }
    }
}

impl RecoverySpec {
    fn build(&self) -> Recovery {
        let never = |seconds: f64| if self.never_reacquire { f64::INFINITY } else { seconds };
        Recovery {
            deny_after: self.deny_after,
            resume_after: self.resume_after,
            reacquire_after: never(self.reacquire_after.si()),
            gap: never(self.gap.si()),
            ..Recovery::default()
        }
    }
}

/// Rejects measurements whose NIS exceeds a χ² quantile.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NisSpec {
    /// Share of good measurements that is accepted, e.g. 0.999.
    probability: Probability,
    /// How the gate avoids a lock-out: good measurements rejected forever.
    #[serde(default)]
    recovery: RecoverySpec,
}

crate::register!(
    Gate,
    "nis",
    NisSpec,
    r#"
probability = 0.999
recovery = { deny_after = 5, resume_after = 3, reacquire_after = "30 s", gap = "10 s", never_reacquire = false }
"#
);

#[typetag::deserialize(name = "nis")]
impl GateSpec for NisSpec {
    fn build(&self) -> Result<Box<dyn Gate>, BuildError> {
        let p = self.probability.si();
        if !(0.5..1.0).contains(&p) {
            let effect = if p < 0.5 {
                "reject most good measurements"
            } else {
                "accept every measurement"
            };
            let message = format!("probability {p} would {effect}");
            return Err(BuildError::at("probability", message)
                .help("write a probability from 0.5 to below 1, e.g. 0.999; `none` passes everything"));
        }
        Ok(Box::new(Nis::new(p, self.recovery.build())))
    }
}

/// Rejects a position fix that lies outside the confidence ellipse of the estimate *and* far from
/// it, both horizontally; each condition has variants.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TwoConditionSpec {
    /// Condition 1: the probability of the ellipse; 0.99 is γ = 9.21.
    #[serde(default = "ninety_nine")]
    probability: Probability,
    /// Condition 1: which covariance the ellipse belongs to.
    #[serde(default)]
    ellipse: EllipseSpec,
    /// Condition 2: which fixes count as far away.
    #[serde(default)]
    magnitude: MagnitudeSpec,
    /// 1σ of a good fix, correlated errors included; by default that of the sensor's noise.
    sigma: Option<Positive<dim::Length>>,
    /// A fix nearer to the estimate than this is never rejected.
    #[serde(default = "three_metres")]
    min_distance: NonNegative<dim::Length>,
    /// The speed at which fix and estimate may diverge, for `magnitude = "step"`.
    max_speed: Option<Positive<dim::Speed>>,
    /// The largest 1σ that a good fix reports, for `magnitude = "reported"`.
    max_reported: Option<Positive<dim::Length>>,
    /// How the gate avoids a lock-out: good measurements rejected forever.
    #[serde(default)]
    recovery: RecoverySpec,
}

/// Which covariance the ellipse of the first condition belongs to.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EllipseSpec {
    /// That of the estimate, P.
    #[default]
    Estimate,
    /// That of the innovation, P + R.
    Innovation,
    /// The estimate's, axis by axis.
    PerAxis,
}

/// Which fixes the second condition counts as far away.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MagnitudeSpec {
    /// By its distance from the estimate: more than 3√2 σ.
    #[default]
    Distance,
    /// By its step since the previous fix, minus the step of the estimate: more than `max_speed` ·
    /// Δt + 3√2 σ.
    Step,
    /// By the 1σ that the receiver reports: more than `max_reported`.
    Reported,
}

fn ninety_nine() -> Probability {
    Probability::try_from_si(0.99).unwrap_or_else(|_| unreachable!("0.99 is a probability"))
}

fn three_metres() -> NonNegative<dim::Length> {
    NonNegative::try_from_si(3.0).unwrap_or_default()
}

crate::register!(
    Gate,
    "two_condition",
    TwoConditionSpec,
    r#"
probability = 0.99
ellipse = "estimate"
magnitude = "step"
max_speed = "2 m/s"
sigma = "1.28 m"
min_distance = "3 m"
"#
);

#[typetag::deserialize(name = "two_condition")]
impl GateSpec for TwoConditionSpec {
    fn suits(&self, rows: &[Dimension]) -> Result<(), BuildError> {
        let metres = dim::Length::KIND.dimension;
        if rows.len() >= 2 && rows[..2].iter().all(|row| *row == metres) {
            return Ok(());
        }
        Err(BuildError::new("`two_condition` judges a horizontal position").help("`nis` judges any sensor"))
    }

    fn build(&self) -> Result<Box<dyn Gate>, BuildError> {
        let p = self.probability.si();
        if !(0.5..1.0).contains(&p) {
            let effect = if p < 0.5 {
                "leave most good fixes outside"
            } else {
                "contain every fix"
            };
            let message = format!("an ellipse of probability {p} would {effect}");
            return Err(BuildError::at("probability", message).help("write a probability from 0.5 to below 1, e.g. 0.99"));
        }
        let ellipse = match self.ellipse {
            EllipseSpec::Estimate => Ellipse::Estimate,
            EllipseSpec::Innovation => Ellipse::Innovation,
            EllipseSpec::PerAxis => Ellipse::PerAxis,
        };
        let magnitude = match (self.magnitude, self.max_speed, self.max_reported) {
            (MagnitudeSpec::Distance, None, None) => Magnitude::Distance,
            (MagnitudeSpec::Step, Some(speed), None) => Magnitude::Step { speed: speed.si() },
            (MagnitudeSpec::Reported, None, Some(limit)) => Magnitude::Reported { limit: limit.si() },
            (MagnitudeSpec::Step, None, _) => return Err(BuildError::at("magnitude", "`step` needs `max_speed`")),
            (MagnitudeSpec::Reported, _, None) => return Err(BuildError::at("magnitude", "`reported` needs `max_reported`")),
            _ => {
                return Err(BuildError::at(
                    "magnitude",
                    "`max_speed` belongs to `step`, `max_reported` to `reported`",
                ));
            }
        };
        let sigma = self.sigma.map(|s| s.si());
        let gate = TwoCondition::new(p, ellipse, magnitude, sigma, self.min_distance.si(), self.recovery.build());
        Ok(Box::new(gate))
    }
}
