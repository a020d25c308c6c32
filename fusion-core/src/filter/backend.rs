//! The backends: a chart, an update and a form, each chosen by itself.

use super::rule::{Single, UpdateRule};
use crate::chart::{AdditiveEuler, AdditiveQuaternion, Body, Chart, Navigation};
use crate::covariance::FormKind;
use std::sync::Arc;

/// What the covariance is the covariance of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum ChartKind {
    /// Additive Euler angles: the classical EKF.
    AdditiveEuler,
    /// Additive quaternion components, normalised.
    AdditiveQuaternion,
    /// Body-frame attitude error.
    #[default]
    Body,
    /// Navigation-frame attitude error.
    Navigation,
}

/// How a measurement is linearised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum UpdateKind {
    /// Once, at the prediction.
    #[default]
    Single,
}

/// A backend: three independent choices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Backend {
    /// What the covariance is the covariance of.
    pub chart: ChartKind,
    /// How a measurement is linearised.
    pub update: UpdateKind,
    /// How P is stored and kept positive.
    pub form: FormKind,
}

impl Backend {
    /// The classical EKF: additive Euler angles, one linearisation, Joseph form.
    pub const EKF: Self = Self {
        chart: ChartKind::AdditiveEuler,
        update: UpdateKind::Single,
        form: FormKind::Joseph,
    };
    /// The error-state filter: body-frame error, one linearisation, Joseph form.
    pub const ERROR_STATE: Self = Self {
        chart: ChartKind::Body,
        update: UpdateKind::Single,
        form: FormKind::Joseph,
    };
}

impl ChartKind {
    /// The chart itself.
    #[must_use]
    pub fn chart(self) -> Arc<dyn Chart> {
        match self {
            Self::AdditiveEuler => Arc::new(AdditiveEuler),
            Self::AdditiveQuaternion => Arc::new(AdditiveQuaternion),
            Self::Body => Arc::new(Body),
            Self::Navigation => Arc::new(Navigation),
        }
    }
}

impl UpdateKind {
    /// The rule itself.
    #[must_use]
    pub fn rule(self) -> Arc<dyn UpdateRule> {
        match self {
            Self::Single => Arc::new(Single),
        }
    }
}
