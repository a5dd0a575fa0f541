//! What can be written, and the one function that writes it.

use crate::descriptions::{mjcf, urdf};
use crate::drive_torque::reference_temperatures;
use crate::equations::Equations;
use crate::error::ExportError;
use crate::exported::Exported;
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
    /// MuJoCo's MJCF.
    Mjcf,
    /// URDF.
    Urdf,
}

impl Target {
    /// All of them.
    pub const ALL: [Self; 7] = [Self::C, Self::Cpp, Self::Rust, Self::Python, Self::Matlab, Self::Mjcf, Self::Urdf];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::C => "c",
            Self::Cpp => "cpp",
            Self::Rust => "rust",
            Self::Python => "python",
            Self::Matlab => "matlab",
            Self::Mjcf => "mjcf",
            Self::Urdf => "urdf",
        }
    }
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
    let code = |write: fn(&Source<'_>) -> String, notes: Vec<String>| {
        let equations = Equations::of(robot)?;
        let text = write(&Source { robot, equations: &equations, notes: &notes });
        Ok(Exported { text, notes })
    };
    match target {
        Target::C => code(c_header, notes),
        Target::Cpp => code(cpp_header, notes),
        Target::Rust => code(rust_module, notes),
        Target::Python => code(python_module, notes),
        Target::Matlab => code(matlab_function, notes),
        Target::Mjcf => mjcf(robot, notes),
        Target::Urdf => urdf(robot, notes),
    }
}
