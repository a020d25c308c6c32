//! Gate policies as TOML declares them.

#![cfg(feature = "declare")]

use crate::block::{BuildError, GateSpec};
use crate::de::DeserializeSpec;
use crate::units::{AnyQuantity, Dimension, Dimensional, NonNegative, Positive, Probability, UnitError, dim, range};
use fusion_core::gate::{Ellipse, FalseTracks, Gate, Hypotheses, Magnitude, Nis, Open, Recovery, TwoCondition, TwoConditions};
use schemars::JsonSchema;
use serde::Deserialize;

/// Accepts everything; its NIS is still reported.
#[derive(Debug, DeserializeSpec, JsonSchema)]
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
#[derive(Debug, DeserializeSpec, JsonSchema)]
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

/// Leaves it open whether a measurement is good or false: a bank of hypotheses, `[filter.bank]`, keeps both cases until
/// they can be distinguished. False measurements come one by one, or as a track that agrees with itself.
#[derive(Debug, DeserializeSpec, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HypothesesSpec {
    /// The probability that a measurement is false after a good one; 0.01 by default.
    #[serde(default = "one_percent")]
    false_rate: Probability,
    /// The probability that a measurement is good after a false one. It is 1/n for a usual false track of n
    /// measurements; 0.2 by default.
    #[serde(default = "one_fifth")]
    false_ends: Probability,
    /// How far from the estimate a false measurement may be, in the unit of the sensor.
    reach: AnyQuantity,
    /// How fast a false track may move, seen from the estimate, in the unit of the sensor per second; by
    /// default a thousandth of `reach`.
    speed: Option<AnyQuantity>,
    /// How fast that speed changes within a second, in the unit of the sensor per s^1.5; a twentieth of `speed` by
    /// default. At least the noise of the vehicle's own velocity: √(2/T) σ for a velocity with the 1σ σ and the
    /// correlation time T. If it is too small, a false track is easier to predict than the vehicle: the filter then
    /// takes good measurements for a false track when the vehicle turns.
    wander: Option<AnyQuantity>,
    /// The probability that the estimate is wrong beyond its covariance at a good measurement; 1e-9 by default.
    #[serde(default = "one_in_a_billion")]
    lost: Probability,
}

fn one_percent() -> Probability {
    Probability::try_from_si(0.01).unwrap_or_else(|_| unreachable!("0.01 is a probability"))
}

fn one_fifth() -> Probability {
    Probability::try_from_si(0.2).unwrap_or_else(|_| unreachable!("0.2 is a probability"))
}

fn one_in_a_billion() -> Probability {
    Probability::try_from_si(1e-9).unwrap_or_else(|_| unreachable!("1e-9 is a probability"))
}

/// Outside a bank, this gate acts as `nis` with this probability and the default recovery.
const ALONE: f64 = 0.999;
/// The speed of a false track by default, in `reach` per second.
const SPEED: f64 = 1e-3;
/// The default of `wander` as a share of the speed.
const WANDER: f64 = 0.05;

crate::register!(
    Gate,
    "hypotheses",
    HypothesesSpec,
    r#"
false_rate = 0.01
false_ends = 0.2
reach = "1 km"
speed = "1 m/s"
wander = "0.1 m/s/sqrt(s)"
lost = 1e-9
"#
);

#[typetag::deserialize(name = "hypotheses")]
impl GateSpec for HypothesesSpec {
    fn suits(&self, rows: &[Dimension]) -> Result<(), BuildError> {
        let Some((first, others)) = rows.split_first() else { return Ok(()) };
        if others.iter().any(|row| row != first) {
            let message = "the rows of this sensor have different units: one `reach` cannot hold for all of them";
            return Err(BuildError::new(message).help("`nis` judges any sensor"));
        }
        let at = |field: &'static str| move |e: UnitError| BuildError::quantity(field, &e);
        self.reach.within::<range::Positive>(*first).map_err(at("reach"))?;
        for (field, value, halves) in [("speed", &self.speed, -2), ("wander", &self.wander, -3)] {
            let Some(value) = value else { continue };
            let per_time = first.times(Dimension::from_halves([0, 0, halves, 0, 0, 0])).unwrap_or(*first);
            value.within::<range::Positive>(per_time).map_err(at(field))?;
        }
        Ok(())
    }

    fn needs_bank(&self) -> bool {
        true
    }

    fn build(&self) -> Result<Box<dyn Gate>, BuildError> {
        let probabilities = [
            ("false_rate", self.false_rate),
            ("false_ends", self.false_ends),
            ("lost", self.lost),
        ];
        for (field, probability) in probabilities {
            let p = probability.si();
            if !(p > 0.0 && p < 1.0) {
                return Err(BuildError::at(field, format!("{p} is certain, and leaves nothing to weigh"))
                    .help("write a probability between 0 and 1"));
            }
        }
        let si = |field: &'static str, quantity: &AnyQuantity| {
            let value = quantity.expect(quantity.dimension().unwrap_or(Dimension::NONE));
            value.map_err(|e| BuildError::quantity(field, &e))
        };
        let or = |field, quantity: &Option<AnyQuantity>, default| quantity.as_ref().map_or(Ok(default), |q| si(field, q));
        let reach = si("reach", &self.reach)?;
        let speed = or("speed", &self.speed, SPEED * reach)?;
        let tracks = FalseTracks {
            rate: self.false_rate.si(),
            ends: self.false_ends.si(),
            reach,
            speed,
            wander: or("wander", &self.wander, WANDER * speed)?,
            lost: self.lost.si(),
        };
        Ok(Box::new(Hypotheses::new(tracks, ALONE, Recovery::default())))
    }
}

/// Rejects a position fix that lies outside the confidence ellipse of the estimate *and* far from
/// it, horizontally or in height; each condition has variants.
#[derive(Debug, DeserializeSpec, JsonSchema)]
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
    /// 1σ of a good fix per horizontal axis, including correlated errors; by default the sensor's noise.
    sigma: Option<Positive<dim::Length>>,
    /// Also judges height, separately and with its own 1σ, if the sensor has it.
    #[serde(default = "yes")]
    height: bool,
    /// 1σ of a good height, including correlated errors; by default the sensor's noise.
    vertical_sigma: Option<Positive<dim::Length>>,
    /// A fix nearer to the estimate than this is never rejected.
    #[serde(default = "three_metres")]
    min_distance: NonNegative<dim::Length>,
    /// The speed at which fix and estimate may diverge, for `magnitude = "step"`.
    max_speed: Option<Positive<dim::Speed>>,
    /// The largest 1σ that a good fix reports, for `magnitude = "reported"`.
    max_reported: Option<Positive<dim::Length>>,
    /// The largest `quality` of a good fix, e.g. 4 for HDOP, for `magnitude = "quality"`.
    max_quality: Option<Positive<dim::Ratio>>,
    /// How the gate avoids a lock-out: good measurements rejected forever.
    #[serde(default)]
    recovery: RecoverySpec,
}

/// Which covariance the ellipse of the first condition belongs to.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EllipseSpec {
    /// The covariance of the estimate, P.
    #[default]
    Estimate,
    /// The covariance of the innovation, P + R.
    Innovation,
    /// The covariance of the estimate, axis by axis.
    PerAxis,
}

/// Which fixes the second condition counts as far away.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MagnitudeSpec {
    /// By its distance from the estimate: more than 3√2 σ.
    #[default]
    Distance,
    /// By its step since the latest fix that was used, minus the step of the estimate: more than
    /// `max_speed` · Δt + 3√2 σ.
    Step,
    /// By the 1σ that the receiver reports: more than `max_reported`.
    Reported,
    /// By the channel that the sensor names as its `quality`, e.g. HDOP: more than `max_quality`.
    Quality,
}

const fn yes() -> bool {
    true
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
        if rows.len() < 2 || rows[..2].iter().any(|row| *row != metres) {
            return Err(BuildError::new("`two_condition` judges a horizontal position").help("`nis` judges any sensor"));
        }
        match rows.get(2) {
            Some(third) if self.height && *third != metres => {
                let message = "the third row of this sensor is no height";
                Err(BuildError::new(message).help("write `height = false` to judge the first two alone"))
            }
            _ => Ok(()),
        }
    }

    fn needs_quality(&self) -> bool {
        matches!(self.magnitude, MagnitudeSpec::Quality)
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
        let conditions = TwoConditions {
            probability: p,
            ellipse,
            magnitude: self.magnitude()?,
            sigma: self.sigma.map(|s| s.si()),
            vertical_sigma: self.vertical_sigma.map(|s| s.si()),
            least: self.min_distance.si(),
            height: self.height,
        };
        Ok(Box::new(TwoCondition::new(conditions, self.recovery.build())))
    }
}

impl TwoConditionSpec {
    /// The second condition, with its limit.
    fn magnitude(&self) -> Result<Magnitude, BuildError> {
        use MagnitudeSpec::{Distance, Quality, Reported, Step};
        let kind = self.magnitude;
        let (speed, reported) = (self.max_speed.map(|v| v.si()), self.max_reported.map(|v| v.si()));
        let quality = self.max_quality.map(|v| v.si());
        let limits = [
            ("max_speed", speed.is_some(), matches!(kind, Step)),
            ("max_reported", reported.is_some(), matches!(kind, Reported)),
            ("max_quality", quality.is_some(), matches!(kind, Quality)),
        ];
        for (name, is_there, is_wanted) in limits {
            if is_there != is_wanted {
                let what = if is_wanted { "needs" } else { "has no use for" };
                return Err(BuildError::at("magnitude", format!("`{}` {what} `{name}`", kind.name())));
            }
        }
        Ok(match (kind, speed, reported, quality) {
            (Step, Some(speed), ..) => Magnitude::Step { speed },
            (Reported, _, Some(limit), _) => Magnitude::Reported { limit },
            (Quality, .., Some(limit)) => Magnitude::Quality { limit },
            (Distance | Step | Reported | Quality, ..) => Magnitude::Distance,
        })
    }
}

impl MagnitudeSpec {
    const fn name(self) -> &'static str {
        match self {
            Self::Distance => "distance",
            Self::Step => "step",
            Self::Reported => "reported",
            Self::Quality => "quality",
        }
    }
}
