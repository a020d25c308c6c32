//! `[filter]`: the backend, as a preset or by its axes.

use fusion_core::covariance::FormKind;
use fusion_core::filter::{Backend, ChartKind, UpdateKind};
use schemars::JsonSchema;
use serde::Deserialize;

/// The backend: a preset, or its three axes.
#[derive(Clone, Copy, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FilterSpec {
    /// A named choice of the three axes below.
    pub backend: Option<PresetSpec>,
    /// What the covariance is the covariance of.
    pub chart: Option<ChartSpec>,
    /// How a measurement is linearised.
    pub update: Option<UpdateSpec>,
    /// How the covariance is kept positive.
    pub form: Option<FormSpec>,
}

/// Named backends.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PresetSpec {
    /// Additive Euler angles, single update, Joseph form: the classical EKF.
    Ekf,
    /// Body-frame error, single update, Joseph form.
    ErrorState,
}

/// Charts.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ChartSpec {
    /// Additive error of roll, pitch, yaw.
    AdditiveEuler,
    /// Additive error of the quaternion's components, normalised.
    AdditiveQuaternion,
    /// Attitude error in body axes.
    Body,
    /// Attitude error in navigation axes.
    Navigation,
}

/// Updates.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum UpdateSpec {
    /// Linearised once, at the prediction.
    Single,
}

/// Covariance forms.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FormSpec {
    /// (I − KH)P(I − KH)ᵀ + KRKᵀ.
    Joseph,
    /// (I − KH)P.
    Standard,
    /// U D Uᵀ by Bierman and Thornton: positive whatever the ratio of the noises.
    Udu,
    /// S Sᵀ by orthogonal transformations: positive whatever the ratio of the noises.
    SquareRoot,
}

impl FilterSpec {
    /// The backend declared: the preset, with each axis that is named put in its place.
    #[must_use]
    pub fn backend(&self) -> Backend {
        let mut backend = match self.backend {
            Some(PresetSpec::Ekf) => Backend::EKF,
            Some(PresetSpec::ErrorState) | None => Backend::ERROR_STATE,
        };
        if let Some(chart) = self.chart {
            backend.chart = match chart {
                ChartSpec::AdditiveEuler => ChartKind::AdditiveEuler,
                ChartSpec::AdditiveQuaternion => ChartKind::AdditiveQuaternion,
                ChartSpec::Body => ChartKind::Body,
                ChartSpec::Navigation => ChartKind::Navigation,
            };
        }
        if let Some(UpdateSpec::Single) = self.update {
            backend.update = UpdateKind::Single;
        }
        if let Some(form) = self.form {
            backend.form = match form {
                FormSpec::Joseph => FormKind::Joseph,
                FormSpec::Standard => FormKind::Standard,
                FormSpec::Udu => FormKind::Udu,
                FormSpec::SquareRoot => FormKind::SquareRoot,
            };
        }
        backend
    }

    /// The backend in the words of TOML: `body / single / joseph`.
    #[must_use]
    pub fn backend_name(&self) -> String {
        let Backend { chart, update, form } = self.backend();
        [format!("{chart:?}"), format!("{update:?}"), format!("{form:?}")]
            .map(|word| snake(&word))
            .join(" / ")
    }
}

/// `AdditiveEuler` as `additive_euler`.
fn snake(word: &str) -> String {
    let mut out = String::new();
    for c in word.chars() {
        if c.is_ascii_uppercase() && !out.is_empty() {
            out.push('_');
        }
        out.push(c.to_ascii_lowercase());
    }
    out
}
