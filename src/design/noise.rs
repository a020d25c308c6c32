//! `noise` of a sensor: declared, reported by its source, or both.

use fusion_models::units::{PerAxis, Positive, dim};
use schemars::JsonSchema;
use serde::Deserialize;

/// The noise of a sensor.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoiseSpec {
    /// 1σ, one for all rows or one per row.
    pub sigma: Option<PerAxis>,
    /// Adds the 1σ that the source reports, its channel `<channel>_sigma`, in quadrature.
    #[serde(default)]
    pub from_source: bool,
    /// Factor on the reported 1σ.
    pub scale: Option<Positive<dim::Ratio>>,
}
