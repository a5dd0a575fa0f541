//! The Rust part of the Python package `dynident`. The other part, in `python/dynident`, contains code that needs no
//! speed: logs, tables, figures.

#![allow(clippy::needless_pass_by_value, reason = "arguments come from Python by value")]
#![allow(clippy::doc_link_with_quotes, reason = "examples in Python")]

mod arrays;
mod assembled;
mod callables;
mod description;
mod errors;
mod factors;
mod function_robot;
mod functions;
mod jobs;
mod kinematics;
mod model;
mod pool;
mod robot;
mod study;
mod watch;
mod watch_settings;

/// The extension module.
#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    use crate::callables::EstimatorRows;
    #[pymodule_export]
    use crate::errors::{Error, LogError, ResultError, RobotError, StopRun, StudyError};
    #[pymodule_export]
    use crate::factors::{_drift, _factors_errors, _identify_factors, _reduce, _spread, Factors};
    #[pymodule_export]
    use crate::function_robot::Run;
    #[pymodule_export]
    use crate::functions::{
        _check, _command, _design, _identify, _identify_servos, _inspect, _isaac_lab, _iterate, _log_arrays,
        _log_contents, _new, _residuals, _simulate, _validate, _write_files,
    };
    #[pymodule_export]
    use crate::model::{_plot_convergence, FittedModel};
    #[pymodule_export]
    use crate::robot::Robot;
    #[pymodule_export]
    use crate::study::Study;
    #[pymodule_export]
    use crate::watch::OnlineWatch;

    use pyo3::prelude::*;

    #[pymodule_init]
    fn with_version(module: &Bound<'_, PyModule>) -> PyResult<()> {
        // Default for exceptions without a place.
        for place in ["path", "line", "column", "code"] {
            module.py().get_type::<crate::errors::Error>().setattr(place, module.py().None())?;
        }
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
