//! Every backend: the error-state filter with one part replaced.

use fusion::core::chart::{Biases, Reset, Side};
use fusion::core::covariance::FormKind;
use fusion::core::filter::{Backend, ChartKind};

const OWN: Backend = Backend::ERROR_STATE;

const fn form(form: FormKind) -> Backend {
    Backend { form, ..OWN }
}

const fn chart(chart: ChartKind) -> Backend {
    Backend { chart, ..OWN }
}

/// By what is replaced.
pub const BACKENDS: [(&str, Backend); 12] = [
    ("joseph", OWN),
    ("standard", form(FormKind::Standard)),
    ("udu", form(FormKind::Udu)),
    ("square_root", form(FormKind::SquareRoot)),
    ("iterated", Backend::IEKF),
    ("unscented", Backend::UKF),
    ("full reset", Backend { reset: Reset::Full, ..OWN }),
    ("additive_euler", Backend::EKF),
    ("additive_quaternion", chart(ChartKind::AdditiveQuaternion)),
    ("navigation", chart(ChartKind::Navigation)),
    ("invariant", Backend::INVARIANT),
    ("left_invariant", chart(ChartKind::Invariant(Side::Left, Biases::Imperfect))),
];
