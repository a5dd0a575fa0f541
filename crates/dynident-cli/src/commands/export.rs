use super::permission::ProgramOptions;
use super::{Context, json, known_in, message_of, pretty_json, result_file};
use crate::{Verdict, terminal};
use clap::ValueEnum;
use dynident::export::{CodeOptions, ControllerBrand, Exported, Target};
use dynident::result::{EXPORT_SCHEMA, ExportFile, ExportValidationFile, ServoFile, ServoForm};
use dynident::{
    EXPORT_VALIDATION_SUFFIX, ExportSettings, OutputSet, ResultFile, ServoTarget, Study, export_payload, export_result,
    export_servos, export_simulator, export_stored, export_validation, payload_validation, selected_payload,
    servo_validation, study_inputs,
};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The result.json of an identification, or its folder.
    result: PathBuf,
    /// The study of the result: needed for results of older versions and for the simulator's drives.
    #[arg(long, value_name = "STUDY.toml")]
    study: Option<PathBuf>,
    /// Use the result although it was edited after it was written. Its numbers are still checked.
    #[arg(long)]
    accept_edited: bool,
    /// The format.
    #[arg(long, value_enum, value_name = "FORM")]
    to: Form,
    /// Code with numbers of 32 bits: c, cpp, rust.
    #[arg(long)]
    float32: bool,
    /// Code with the regressor of the base parameters and their values.
    #[arg(long)]
    regressor: bool,
    /// Width of the smoothed steps of friction at zero velocity in the code, rad/s (m/s). Default: 0.002 rad/s of a
    /// typical arm.
    #[arg(long, value_name = "WIDTH")]
    step_width: Option<f64>,
    /// Name of the payload, if the result has several.
    #[arg(long, value_name = "NAME")]
    payload: Option<String>,
    /// Write to this file instead of standard output, and its held-out error to FILE.validation.json next to it.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// An additional folder for the study's files.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    #[command(flatten)]
    programs: ProgramOptions,
}

impl Options {
    /// Name of the output file; empty for standard output.
    fn file_name(&self) -> String {
        self.out.as_ref().map_or_else(String::new, |out| file_name(out))
    }
}

#[derive(Clone, Copy, ValueEnum)]
enum Form {
    /// C99, one header.
    C,
    /// C++17, one header.
    Cpp,
    /// Rust without std, one module.
    Rust,
    /// Python over NumPy, one module.
    Python,
    /// MATLAB and Octave, one function file.
    Matlab,
    /// Python with CasADi, one module of casadi.Function.
    Casadi,
    /// Python with JAX, one module of pure functions.
    Jax,
    /// Python that builds a Pinocchio model, with a torque function.
    Pinocchio,
    /// MuJoCo's MJCF.
    Mjcf,
    /// URDF.
    Urdf,
    /// SDF of Gazebo.
    Sdf,
    /// ROS 2 node parameters.
    Ros2Yaml,
    /// All numbers of the model.
    Json,
    /// Actuators of Isaac Lab, Python; for drives that were fitted to commands.
    IsaacLab,
    /// Armature, damping, friction, delay and gain of every joint with error bars, for a simulator: JSON.
    Simulator,
    /// The same as a Markdown table.
    SimulatorTable,
    /// A payload for Universal Robots: a line of URScript.
    PayloadUr,
    /// A payload for Franka: JSON.
    PayloadFranka,
    /// A payload for KUKA: LOAD_DATA of KRL.
    PayloadKuka,
    /// A payload for ABB: loaddata of RAPID.
    PayloadAbb,
}

enum Kind {
    Model(Target),
    SimulatorJson,
    SimulatorTable,
    Payload(ControllerBrand),
    /// Files that exist only for drives that were fitted to commands.
    Drives,
}

impl Form {
    /// Name on the command line.
    fn name(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }

    /// Whether a file with the held-out error (for payloads, with the intervals) is written next to the file.
    fn is_validated(self) -> bool {
        !matches!(self.kind(), Kind::SimulatorJson | Kind::SimulatorTable)
    }

    fn kind(self) -> Kind {
        match self {
            Self::C => Kind::Model(Target::C),
            Self::Cpp => Kind::Model(Target::Cpp),
            Self::Rust => Kind::Model(Target::Rust),
            Self::Python => Kind::Model(Target::Python),
            Self::Matlab => Kind::Model(Target::Matlab),
            Self::Casadi => Kind::Model(Target::Casadi),
            Self::Jax => Kind::Model(Target::Jax),
            Self::Pinocchio => Kind::Model(Target::Pinocchio),
            Self::Mjcf => Kind::Model(Target::Mjcf),
            Self::Urdf => Kind::Model(Target::Urdf),
            Self::Sdf => Kind::Model(Target::Sdf),
            Self::Ros2Yaml => Kind::Model(Target::Ros2Yaml),
            Self::Json => Kind::Model(Target::Json),
            Self::IsaacLab => Kind::Drives,
            Self::Simulator => Kind::SimulatorJson,
            Self::SimulatorTable => Kind::SimulatorTable,
            Self::PayloadUr => Kind::Payload(ControllerBrand::UniversalRobots),
            Self::PayloadFranka => Kind::Payload(ControllerBrand::Franka),
            Self::PayloadKuka => Kind::Payload(ControllerBrand::Kuka),
            Self::PayloadAbb => Kind::Payload(ControllerBrand::Abb),
        }
    }
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let data = options.data.as_deref();
    let study = options.study.as_deref().map(|path| options.programs.load_study(path, data).map(|study| (study, path)));
    let study = study.transpose()?;
    let result = result_file(&options.result);
    if let Some(out) = &options.out {
        let named = study.as_ref().map(|(study, path)| study_inputs(study, path, data, &["robot", "torque", "log"]));
        let mut inputs = named.unwrap_or_default();
        inputs.push(result.clone());
        let mut outputs = vec![out.clone()];
        outputs.extend(options.to.is_validated().then(|| validation_path(out)));
        dynident::refuse_overwriting(&outputs, &inputs).map_err(message_of)?;
    }
    let with_study = || {
        let study = study.as_ref().map(|(study, path)| (study, *path));
        study.ok_or_else(|| "--study STUDY.toml is missing: state the study of the result".to_owned())
    };
    let code = CodeOptions { float32: options.float32, regressor: options.regressor, step_width: options.step_width };
    if let Some(file) = ServoFile::read(&result).map_err(message_of)? {
        let study = study.as_ref().map(|(study, path)| (study, *path));
        return drives(&file, &result, study, options, code, context);
    }
    let read = if options.accept_edited { ResultFile::read_edited } else { ResultFile::read };
    let stored = read(&result).map_err(message_of)?;
    let simulator = || -> Result<_, String> {
        let (study, path) = with_study()?;
        export_simulator(&stored, &result, study, path, data).map_err(known_in(path))
    };
    if !matches!(options.to.kind(), Kind::Model(_)) && code != CodeOptions::default() {
        return Err("--float32, --regressor and --step-width are options of code: omit them".to_owned());
    }
    let exported = match options.to.kind() {
        Kind::Model(target) => {
            let form = ExportSettings { target, code };
            match &study {
                Some((study, path)) => {
                    export_result(&stored, &result, study, path, data, form).map_err(known_in(path))?
                }
                None => export_stored(&stored, &result, form).map_err(message_of)?,
            }
        }
        Kind::SimulatorJson => simulator()?.json().map_err(|error| error.to_string())?,
        Kind::SimulatorTable => simulator()?.table(),
        Kind::Payload(reader) => {
            export_payload(&stored, &result, options.payload.as_deref(), reader).map_err(message_of)?
        }
        Kind::Drives => {
            return Err(format!(
                "--to {}: {} is a result of torque; this form needs drives that were fitted to commands ([drive.servo])",
                options.to.name(),
                result.display()
            ));
        }
    };
    let name = options.file_name();
    let validation = match options.to.kind() {
        Kind::Model(target) => Some(export_validation(&stored, target, &name, &exported.text)),
        Kind::SimulatorJson | Kind::SimulatorTable | Kind::Drives => None,
        Kind::Payload(_) => {
            let payload = selected_payload(&stored, &result, options.payload.as_deref()).map_err(message_of)?;
            Some(payload_validation(&stored, payload.controller.as_ref(), &options.to.name(), &name, &exported.text))
        }
    };
    write(options, context, exported, Vec::new(), validation.as_ref())
}

/// Exports the drives of a result that was identified from commands and positions.
fn drives(
    file: &ServoFile,
    result: &Path,
    study: Option<(&Study, &Path)>,
    options: &Options,
    code: CodeOptions,
    context: &Context,
) -> Result<Verdict, String> {
    let form = options.to.name();
    let target = match options.to {
        Form::IsaacLab => ServoTarget::IsaacLab,
        Form::Mjcf => ServoTarget::Mjcf,
        Form::Urdf => ServoTarget::Urdf,
        _ => {
            return Err(format!(
                "--to {form}: {} has drives that were fitted to commands and no torque model: use --to isaac-lab, mjcf or \
                 urdf, or the file itself, which is JSON with all values",
                result.display()
            ));
        }
    };
    for (option, is_given) in [
        ("--float32, --regressor and --step-width", code != CodeOptions::default()),
        ("--payload", options.payload.is_some()),
    ] {
        if is_given {
            return Err(format!("{option}: not for drives that were fitted to commands; omit it"));
        }
    }
    let made = export_servos(file, result, target, study, options.data.as_deref());
    let made = made.map_err(|error| match study {
        Some((_, path)) => known_in(path)(error),
        None => message_of(error),
    })?;
    let validation = servo_validation(file, &made.forms, &form, &options.file_name(), &made.exported.text);
    write(options, context, made.exported, made.forms, Some(&validation))
}

fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// The file with the held-out error of an exported file.
fn validation_path(out: &Path) -> PathBuf {
    let mut name = out.as_os_str().to_owned();
    name.push(EXPORT_VALIDATION_SUFFIX);
    name.into()
}

/// Writes the text to its file, with its held-out error next to it, or to standard output; and the notes to standard
/// error.
fn write(
    options: &Options,
    context: &Context,
    exported: Exported,
    servo_forms: Vec<ServoForm>,
    validation: Option<&ExportValidationFile>,
) -> Result<Verdict, String> {
    let Exported { text, notes } = exported;
    match (&options.out, validation) {
        (Some(path), Some(validation)) => {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
            let name = file_name(path);
            let set = OutputSet::new(folder).file(&name, text.as_str());
            let set = set.file(&format!("{name}{EXPORT_VALIDATION_SUFFIX}"), pretty_json(validation)?);
            set.write().map_err(message_of)?;
        }
        (Some(path), None) => dynident::write_atomically(path, text.as_bytes()).map_err(message_of)?,
        (None, _) => {}
    }
    if context.json {
        let target = options.to.name();
        let file = options.out.as_ref().map(|path| path.display().to_string());
        let text = options.out.is_none().then_some(text);
        let schema = EXPORT_SCHEMA.to_owned();
        terminal::print_document(&json(&ExportFile { schema, target, notes, file, servo_forms, text })?)?;
        return Ok(Verdict::Good);
    }
    // A problem of the result is shown even with --quiet.
    let said = notes.iter().filter(|note| !context.quiet || note.contains("PROBLEM"));
    said.for_each(|note| terminal::remark(note));
    if options.out.is_none() {
        terminal::print_document(text.trim_end())?;
    }
    Ok(Verdict::Good)
}
