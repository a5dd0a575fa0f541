//! **Dynident from Python**: the part of the package `dynident` that is Rust. Its other part, in `python/dynident`,
//! holds names, documentation and what needs no speed.

mod arrays;
mod errors;
mod robot;

/// The extension module.
#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    use crate::errors::{Error, LogError, RobotError, StudyError};
    #[pymodule_export]
    use crate::robot::Robot;
}
