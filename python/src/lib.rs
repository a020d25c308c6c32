//! The native part of the Python package `fusion`. The folder `fusion/` has what a user imports.

mod arrays;
mod campaign;
mod columns;
mod design;
mod error;
mod navigator;
mod recording;
mod sensor;
mod tuning;

use pyo3::prelude::*;

/// The native part of the package.
#[pymodule(gil_used = false)]
mod _fusion {
    #[pymodule_export]
    use super::campaign::{Campaign, merge};
    #[pymodule_export]
    use super::design::{Design, Finished};
    #[pymodule_export]
    use super::error::{DataError, DesignError, FusionError};
    #[pymodule_export]
    use super::navigator::Navigator;
    #[pymodule_export]
    use super::sensor::declare_sensor;
    #[pymodule_export]
    use super::tuning::{Logs, Tuned};

    use super::{Bound, PyModule, PyResult};
    use pyo3::types::PyModuleMethods;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        fusion_formats::link();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
