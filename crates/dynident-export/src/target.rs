//! Export formats, and the function that writes them.

use crate::descriptions::{mjcf, urdf};
use crate::drive_torque::reference_temperatures;
use crate::equations::Equations;
use crate::error::ExportError;
use crate::exported::Exported;
use crate::languages::{Source, c_header, cpp_header, matlab_function, python_module, rust_module};
use crate::model_file::model_json;
use crate::robot_model::RobotModel;
use crate::ros2_parameters::ros2_parameters;
use crate::sdf::sdf;
use dynident_model::terms::TermClass;
use dynident_text::visible;

/// An export format.
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
    /// SDF.
    Sdf,
    /// Parameters of a ROS 2 node, in YAML.
    Ros2Yaml,
    /// All numbers of the model, in JSON: a [`ModelFile`](crate::ModelFile).
    Json,
}

impl Target {
    /// All formats.
    pub const ALL: [Self; 10] = [
        Self::C,
        Self::Cpp,
        Self::Rust,
        Self::Python,
        Self::Matlab,
        Self::Mjcf,
        Self::Urdf,
        Self::Sdf,
        Self::Ros2Yaml,
        Self::Json,
    ];

    /// The class of torque terms that the form can hold; `None` if it can list all terms.
    pub fn class(self) -> Option<TermClass> {
        match self {
            Self::C | Self::Cpp | Self::Rust | Self::Python | Self::Matlab => Some(TermClass::FunctionsOfMotion),
            Self::Mjcf => Some(TermClass::DampingFrictionAndInertia),
            Self::Urdf | Self::Sdf => Some(TermClass::DampingAndFriction),
            Self::Ros2Yaml | Self::Json => None,
        }
    }

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::C => "c",
            Self::Cpp => "cpp",
            Self::Rust => "rust",
            Self::Python => "python",
            Self::Matlab => "matlab",
            Self::Mjcf => "mjcf",
            Self::Urdf => "urdf",
            Self::Sdf => "sdf",
            Self::Ros2Yaml => "ros2-yaml",
            Self::Json => "json",
        }
    }
}

/// Writes the robot in the format `target`; `further` are additional notes of the caller, such as the origin of the
/// model.
///
/// # Errors
/// A torque term that is not a function of `q`, `dq` and `ddq` (load, Maxwell slip); a joint without inertia; or an
/// overflow.
pub fn export(robot: &RobotModel, target: Target, further: &[String]) -> Result<Exported, ExportError> {
    let temperatures = reference_temperatures(robot);
    let at_reference = temperatures
        .iter()
        .map(|(symbol, reference)| format!("{symbol} is left out: the drive is assumed to be at {reference} °C."));
    let notes: Vec<String> = further.iter().cloned().chain(at_reference).collect();
    // Additional safety: shows invisible characters that a format did not escape.
    let finished = |exported: Exported| Exported { text: visible(&exported.text).into_owned(), ..exported };
    let code = |write: fn(&Source<'_>) -> String, notes: Vec<String>| {
        let equations = Equations::of(robot)?;
        let text = write(&Source { robot, equations: &equations, notes: &notes });
        Ok(Exported { text, notes })
    };
    let exported = match target {
        Target::C => code(c_header, notes),
        Target::Cpp => code(cpp_header, notes),
        Target::Rust => code(rust_module, notes),
        Target::Python => code(python_module, notes),
        Target::Matlab => code(matlab_function, notes),
        Target::Mjcf => mjcf(robot, notes),
        Target::Urdf => urdf(robot, notes),
        Target::Sdf => sdf(robot, notes),
        // YAML contains the temperature terms.
        Target::Ros2Yaml => ros2_parameters(robot, further.to_vec()),
        Target::Json => model_json(robot, further.to_vec()),
    };
    exported.map(finished)
}
