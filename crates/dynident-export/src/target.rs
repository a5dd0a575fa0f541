//! Export formats, and the function that writes them.

use crate::descriptions::{mjcf, urdf};
use crate::drive_torque::reference_temperatures;
use crate::equations::Equations;
use crate::error::ExportError;
use crate::exported::Exported;
use crate::languages::{
    Source, c_header, casadi_module, cpp_header, jax_module, matlab_function, pinocchio_module, python_module,
    rust_module,
};
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
    /// One Python module with a `casadi.Function` for each function.
    Casadi,
    /// One Python module of pure functions over JAX.
    Jax,
    /// One Python module that builds a model of Pinocchio, with a torque function.
    Pinocchio,
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
    pub const ALL: [Self; 13] = [
        Self::C,
        Self::Cpp,
        Self::Rust,
        Self::Python,
        Self::Matlab,
        Self::Casadi,
        Self::Jax,
        Self::Pinocchio,
        Self::Mjcf,
        Self::Urdf,
        Self::Sdf,
        Self::Ros2Yaml,
        Self::Json,
    ];

    /// Class of torque terms that the format can represent; `None` if it can list all terms.
    pub fn class(self) -> Option<TermClass> {
        match self {
            Self::C
            | Self::Cpp
            | Self::Rust
            | Self::Python
            | Self::Matlab
            | Self::Casadi
            | Self::Jax
            | Self::Pinocchio => Some(TermClass::FunctionsOfMotion),
            Self::Mjcf => Some(TermClass::DampingFrictionAndInertia),
            Self::Urdf | Self::Sdf => Some(TermClass::DampingAndFriction),
            Self::Ros2Yaml | Self::Json => None,
        }
    }

    /// Whether the format is source code.
    pub fn is_code(self) -> bool {
        self.class() == Some(TermClass::FunctionsOfMotion)
    }

    /// Whether the code has a function with state for friction with hysteresis.
    pub fn has_state(self) -> bool {
        self.is_code() && self != Self::Pinocchio
    }

    /// Whether the code can contain the regressor.
    fn has_regressor(self) -> bool {
        self.has_state()
    }

    /// Whether the code can have numbers of 32 bits.
    fn has_float32(self) -> bool {
        matches!(self, Self::C | Self::Cpp | Self::Rust)
    }

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::C => "c",
            Self::Cpp => "cpp",
            Self::Rust => "rust",
            Self::Python => "python",
            Self::Matlab => "matlab",
            Self::Casadi => "casadi",
            Self::Jax => "jax",
            Self::Pinocchio => "pinocchio",
            Self::Mjcf => "mjcf",
            Self::Urdf => "urdf",
            Self::Sdf => "sdf",
            Self::Ros2Yaml => "ros2-yaml",
            Self::Json => "json",
        }
    }
}

/// Options for exported code.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CodeOptions {
    /// Whether numbers have 32 bits (C, C++ and Rust).
    pub float32: bool,
    /// Whether to add the regressor of the base parameters and their values: `inverse_dynamics = W(q, dq, ddq)
    /// parameters`.
    pub regressor: bool,
    /// Width of the smoothed sign functions of friction, rad/s (m/s): see [`RobotModel::with_step_width`]. `None`
    /// keeps the widths.
    pub step_width: Option<f64>,
}

impl CodeOptions {
    fn check(self, target: Target) -> Result<(), ExportError> {
        let is_wrong = |option, wanted: bool, has: fn(Target) -> bool| {
            let targets = || Target::ALL.into_iter().filter(|&target| has(target)).map(Target::name).collect();
            let error = || ExportError::Option { option, target: target.name(), targets: targets() };
            if wanted && !has(target) { Err(error()) } else { Ok(()) }
        };
        is_wrong("float32", self.float32, Target::has_float32)?;
        is_wrong("regressor", self.regressor, Target::has_regressor)?;
        is_wrong("step-width", self.step_width.is_some(), Target::is_code)
    }
}

/// Writes the robot in the format `target`; `further` contains additional notes of the caller, such as the origin of
/// the model.
///
/// # Errors
/// A torque term with memory in code (see [`RobotModel::with_state_terms`]); a joint without inertia; or an overflow.
pub fn export(robot: &RobotModel, target: Target, further: &[String]) -> Result<Exported, ExportError> {
    export_with(robot, target, CodeOptions::default(), further)
}

/// Like [`export`], with options for exported code.
///
/// # Errors
/// Same as for [`export`], or an option that the format does not have.
pub fn export_with(
    robot: &RobotModel,
    target: Target,
    options: CodeOptions,
    further: &[String],
) -> Result<Exported, ExportError> {
    options.check(target)?;
    let with_steps = options.step_width.map(|width| robot.with_step_width(width)).transpose()?;
    let robot = with_steps.as_ref().unwrap_or(robot);
    let temperatures = reference_temperatures(robot);
    let at_reference = temperatures
        .iter()
        .map(|(symbol, reference)| format!("{symbol} is left out: the drive is assumed to be at {reference} °C."));
    let notes: Vec<String> = further.iter().cloned().chain(at_reference).collect();
    // An additional precaution: makes invisible characters visible that a format did not escape.
    let finished = |exported: Exported| Exported { text: visible(&exported.text).into_owned(), ..exported };
    let code = |write: fn(&Source<'_>) -> String, notes: Vec<String>| {
        let most = if options.float32 { f64::from(f32::MAX) } else { f64::MAX };
        let equations = Equations::of(robot, options.regressor, most)?;
        let text = write(&Source { robot, equations: &equations, notes: &notes, float32: options.float32 });
        Ok(Exported { text, notes })
    };
    let exported = match target {
        Target::C => code(c_header, notes),
        Target::Cpp => code(cpp_header, notes),
        Target::Rust => code(rust_module, notes),
        Target::Python => code(python_module, notes),
        Target::Matlab => code(matlab_function, notes),
        Target::Casadi => code(casadi_module, notes),
        Target::Jax => code(jax_module, notes),
        Target::Pinocchio => code(pinocchio_module, notes),
        Target::Mjcf => mjcf(robot, notes),
        Target::Urdf => urdf(robot, notes),
        Target::Sdf => sdf(robot, notes),
        // YAML contains the temperature-dependent terms.
        Target::Ros2Yaml => ros2_parameters(robot, further.to_vec()),
        Target::Json => model_json(robot, further.to_vec()),
    };
    exported.map(finished)
}
