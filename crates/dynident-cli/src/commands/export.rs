//! `dynident export DIR/result.json --study STUDY.toml --to FORM`.

use super::{Context, json, known_in, message_of};
use crate::{Verdict, terminal};
use clap::ValueEnum;
use dynident::export::{Exported, Target};
use dynident::result::{EXPORT_SCHEMA, ExportFile};
use dynident::{Study, export_model, study_inputs};
use std::path::PathBuf;

/// Options of `export`.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The result.json of an identification.
    result: PathBuf,
    /// The study that it was made with.
    #[arg(long, value_name = "STUDY.toml")]
    study: PathBuf,
    /// The form.
    #[arg(long, value_enum, value_name = "FORM")]
    to: Form,
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
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let study = Study::load(&options.study).map_err(message_of)?;
    let data = options.data.as_deref();
    if let Some(out) = &options.out {
        let mut inputs = study_inputs(&study, &options.study, data, &["robot", "log"]);
        inputs.push(options.result.clone());
        dynident::refuse_overwriting(core::slice::from_ref(out), &inputs).map_err(message_of)?;
    }
    let target = match options.to {
        Form::C => Target::C,
        Form::Cpp => Target::Cpp,
        Form::Rust => Target::Rust,
        Form::Python => Target::Python,
        Form::Matlab => Target::Matlab,
        Form::Mjcf => Target::Mjcf,
        Form::Urdf => Target::Urdf,
    };
    let exported =
        export_model(&options.result, (&study, &options.study), data, target).map_err(known_in(&options.study))?;
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
    notes.iter().for_each(|note| terminal::remark(note));
    if options.out.is_none() {
        terminal::print(text.trim_end())?;
    }
    Ok(Verdict::Good)
}
