//! `[reference]`: what a run is scored against.

use fusion_models::units::{Duration, Positive, Vec3Of, dim};
use schemars::JsonSchema;
use serde::Deserialize;

/// What a run is scored against; never fused.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReferenceSpec {
    /// The source with a `position` channel and, where it has them, `velocity` and `attitude`.
    pub source: String,
    /// Errors and innovations count from this time on.
    #[serde(default)]
    pub from: Option<Duration>,
    /// The reference's point in body axes, from the body origin: the estimate is moved there.
    #[serde(default)]
    pub lever_arm: Vec3Of<dim::Length>,
    /// Takes the mean rotation between the two bodies out of the attitude errors.
    #[serde(default)]
    pub remove_mean_mounting: bool,
    /// Derives a missing reference velocity from its positions.
    #[serde(default)]
    pub velocity_from_position: Option<DifferentiateSpec>,
}

/// The slope of a cubic fitted to neighbouring positions.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DifferentiateSpec {
    /// Epochs on either side of each.
    pub half_window: u32,
    /// Epochs whose neighbours span more get no velocity.
    pub max_span: Positive<dim::Duration>,
}
