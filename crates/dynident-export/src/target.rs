//! What can be written, and the one function that writes it.

use crate::drive_torque::reference_temperatures;
use crate::equations::Equations;
use crate::error::ExportError;
use crate::languages::{Source, c_header, cpp_header, matlab_function, python_module, rust_module};
use crate::robot_model::RobotModel;

/// A form of the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// One C99 header with `static inline` functions.
    C,
    /// One C++17 header.
    Cpp,
    /// One Rust module without `std`.
    Rust,
    /// One Python module over NumPy.
    Python,
    /// One function file for MATLAB and Octave.
    Matlab,
}

/// A model in a form.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// The file's text.
    pub text: String,
    /// What the form does not hold, or holds differently, a sentence each; the text has them as comments.
    pub notes: Vec<String>,
}

/// Writes the robot in the form `target`; `further` are notes of the caller's own, that is where the model comes from.
///
/// # Errors
/// A torque term that is no function of `q`, `dq` and `ddq` (load, Maxwell slip); a joint that moves no inertia.
pub fn export(robot: &RobotModel, target: Target, further: &[String]) -> Result<Exported, ExportError> {
    let temperatures = reference_temperatures(robot);
    let at_reference = temperatures
        .iter()
        .map(|(symbol, reference)| format!("{symbol} is left out: the drive counts as being at {reference} °C."));
    let notes: Vec<String> = further.iter().cloned().chain(at_reference).collect();
    let equations = Equations::of(robot)?;
    let source = Source { robot, equations: &equations, notes: &notes };
    let text = match target {
        Target::C => c_header(&source),
        Target::Cpp => cpp_header(&source),
        Target::Rust => rust_module(&source),
        Target::Python => python_module(&source),
        Target::Matlab => matlab_function(&source),
    };
    Ok(Exported { text, notes })
}
