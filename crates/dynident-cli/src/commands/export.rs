//! `dynident export DIR/result.json --study STUDY.toml --to FORM`.

use super::{Context, json, known_in, message_of};
use crate::{Verdict, terminal};
use clap::ValueEnum;
use dynident::export::{Exported, PayloadReader, Target};
use dynident::result::{EXPORT_SCHEMA, ExportFile};
use dynident::{Study, export_model, export_payload, study_inputs};
use std::path::PathBuf;

/// Options of `export`.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The result.json of an identification.
    result: PathBuf,
    /// The study that it was made with; a payload needs none.
    #[arg(long, value_name = "STUDY.toml")]
    study: Option<PathBuf>,
    /// The form.
    #[arg(long, value_enum, value_name = "FORM")]
    to: Form,
    /// Which payload, where the result has several.
    #[arg(long, value_name = "NAME")]
    payload: Option<String>,
    /// Write to this file instead of standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// A further folder in which the study's files are looked for.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
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
    /// MuJoCo's MJCF.
    Mjcf,
    /// URDF.
    Urdf,
    /// SDF of Gazebo.
    Sdf,
    /// Parameters of a ROS 2 node.
    Ros2Yaml,
    /// All numbers of the model.
    Json,
    /// A payload for Universal Robots: a line of URScript.
    PayloadUr,
    /// A payload for Franka: JSON.
    PayloadFranka,
    /// A payload for KUKA: LOAD_DATA of KRL.
    PayloadKuka,
    /// A payload for ABB: loaddata of RAPID.
    PayloadAbb,
}

impl Form {
    /// What is written: the model, or a payload.
    fn kind(self) -> Result<Target, PayloadReader> {
        match self {
            Self::C => Ok(Target::C),
            Self::Cpp => Ok(Target::Cpp),
            Self::Rust => Ok(Target::Rust),
            Self::Python => Ok(Target::Python),
            Self::Matlab => Ok(Target::Matlab),
            Self::Mjcf => Ok(Target::Mjcf),
            Self::Urdf => Ok(Target::Urdf),
            Self::Sdf => Ok(Target::Sdf),
            Self::Ros2Yaml => Ok(Target::Ros2Yaml),
            Self::Json => Ok(Target::Json),
            Self::PayloadUr => Err(PayloadReader::UniversalRobots),
            Self::PayloadFranka => Err(PayloadReader::Franka),
            Self::PayloadKuka => Err(PayloadReader::Kuka),
            Self::PayloadAbb => Err(PayloadReader::Abb),
        }
    }
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let data = options.data.as_deref();
    let study = options.study.as_deref().map(|path| Study::load(path).map(|study| (study, path)));
    let study = study.transpose().map_err(message_of)?;
    if let Some(out) = &options.out {
        let named = study.as_ref().map(|(study, path)| study_inputs(study, path, data, &["robot", "torque", "log"]));
        let mut inputs = named.unwrap_or_default();
        inputs.push(options.result.clone());
        dynident::refuse_overwriting(core::slice::from_ref(out), &inputs).map_err(message_of)?;
    }
    let exported = match options.to.kind() {
        Ok(target) => {
            let Some((study, path)) = &study else {
                return Err("--study STUDY.toml is missing: name the study that the result was made with".to_owned());
            };
            export_model(&options.result, (study, path), data, target).map_err(known_in(path))?
        }
        Err(reader) => export_payload(&options.result, options.payload.as_deref(), reader).map_err(message_of)?,
    };
    write(options, context, exported)
}

/// The text to its file or to standard output, the notes to the screen.
fn write(options: &Options, context: &Context, exported: Exported) -> Result<Verdict, String> {
    let Exported { text, notes } = exported;
    if let Some(path) = &options.out {
        dynident::write_whole(path, text.as_bytes()).map_err(message_of)?;
    }
    if context.json {
        let target = options.to.to_possible_value().map_or(String::new(), |value| value.get_name().to_owned());
        let file = options.out.as_ref().map(|path| path.display().to_string());
        let text = options.out.is_none().then_some(text);
        let schema = EXPORT_SCHEMA.to_owned();
        terminal::print(&json(&ExportFile { schema, target, notes, file, text })?)?;
        return Ok(Verdict::Good);
    }
    // A problem of the result is said to whoever asks for quiet as well.
    let said = notes.iter().filter(|note| !context.quiet || note.contains("PROBLEM"));
    said.for_each(|note| terminal::remark(note));
    if options.out.is_none() {
        terminal::print(text.trim_end())?;
    }
    Ok(Verdict::Good)
}
