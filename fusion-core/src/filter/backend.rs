//! The backends: a chart, an update and a form, each chosen independently.

use super::iterated::Iterated;
use super::outright::Outright;
use super::rule::{Single, UpdateRule};
use super::sigma::SigmaSpread;
use super::unscented::Unscented;
use crate::chart::{AdditiveEuler, AdditiveQuaternion, Biases, Body, Chart, Invariant, Navigation, Reset, Side};
use crate::covariance::{FormKind, Kernel};
use crate::custom::Custom;
use alloc::sync::Arc;

/// The definition of the error whose covariance is P.
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
    /// The error as an element of a group.
    Invariant(Side, Biases),
    /// A chart of another crate.
    Custom(&'static Custom<dyn Chart>),
}

/// How a measurement is linearised.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum UpdateKind {
    /// Once, at the prediction.
    #[default]
    Single,
    /// Repeatedly, along the correction: Gauss-Newton.
    Iterated(Iterated),
    /// By sigma points, the prediction too.
    Unscented(SigmaSpread),
    /// Without weighing: the state takes the measured value. No covariance is kept.
    Outright,
    /// A rule of another crate.
    Custom(&'static Custom<dyn UpdateRule>),
}

/// A backend: three independent choices.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Backend {
    /// The definition of the error whose covariance is P.
    pub chart: ChartKind,
    /// How a measurement is linearised.
    pub update: UpdateKind,
    /// How P is stored and kept positive.
    pub form: FormKind,
    /// How P changes when a correction moves the state.
    pub reset: Reset,
    /// The kernel that computes; `None` selects the best that the processor has.
    pub kernel: Option<Kernel>,
    /// Whether calibrations get only a share of the corrections by a sensor with larger errors than it declares.
    pub protection: bool,
}

impl Backend {
    /// The classical EKF: additive Euler angles, one linearisation, Joseph form.
    pub const EKF: Self = Self {
        chart: ChartKind::AdditiveEuler,
        ..Self::ERROR_STATE
    };
    /// The error-state filter: body-frame error, one linearisation, Joseph form.
    pub const ERROR_STATE: Self = Self {
        chart: ChartKind::Body,
        update: UpdateKind::Single,
        form: FormKind::Joseph,
        reset: Reset::Plain,
        kernel: None,
        protection: false,
    };
    /// The iterated error-state filter: body-frame error, Gauss-Newton on the manifold.
    pub const IEKF: Self = Self {
        update: UpdateKind::Iterated(Iterated::DEFAULT),
        ..Self::ERROR_STATE
    };
    /// The invariant filter: right-invariant error, one linearisation.
    pub const INVARIANT: Self = Self {
        chart: ChartKind::Invariant(Side::Right, Biases::Imperfect),
        ..Self::ERROR_STATE
    };
    /// The unscented filter on the manifold, body-frame error.
    pub const UKF: Self = Self {
        update: UpdateKind::Unscented(SigmaSpread::DEFAULT),
        ..Self::ERROR_STATE
    };
}

impl ChartKind {
    /// The chart that this kind names.
    #[must_use]
    pub fn chart(self) -> Arc<dyn Chart> {
        match self {
            Self::AdditiveEuler => Arc::new(AdditiveEuler),
            Self::AdditiveQuaternion => Arc::new(AdditiveQuaternion),
            Self::Body => Arc::new(Body),
            Self::Navigation => Arc::new(Navigation),
            Self::Invariant(side, biases) => Arc::new(Invariant {
                side,
                biases,
                origin: None,
            }),
            Self::Custom(custom) => (custom.make)(),
        }
    }
}

impl UpdateKind {
    /// The rule that this kind names.
    #[must_use]
    pub fn rule(self) -> Arc<dyn UpdateRule> {
        match self {
            Self::Single => Arc::new(Single),
            Self::Iterated(rule) => Arc::new(rule),
            Self::Unscented(spread) => Arc::new(Unscented(spread)),
            Self::Outright => Arc::new(Outright),
            Self::Custom(custom) => (custom.make)(),
        }
    }
}
