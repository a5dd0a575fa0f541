use super::permission::ProgramOptions;
use super::view::in_folder;
use super::{Context, json, known_in, message_of, result_file};
use crate::{Verdict, terminal};
use clap::ValueEnum;
use dynident::{
    Figure, FigureForm, IterationsFile, PrintStyle, ResultFile, RunOptions, refuse_overwriting, study_inputs,
    validation_traces,
};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Name of the file of an iteration in its folder.
const ITERATIONS: &str = "iterations.json";

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The result.json of an identification or its folder; for `convergence` the iterations.json of `iterate` or its
    /// folder.
    result: PathBuf,
    /// The figure.
    #[arg(long, value_enum, value_name = "FIGURE")]
    figure: Kind,
    /// The file; its ending selects the form: .svg, .pdf or .png (picture), .csv (data of the picture), .tex or .md
    /// (table). May be repeated.
    #[arg(long, required = true, value_name = "FILE")]
    out: Vec<PathBuf>,
    /// The study with the logs for `residuals`: its logs with the role "validate", or all logs if none has this role.
    #[arg(long, value_name = "STUDY.toml")]
    study: Option<PathBuf>,
    /// Folder of the recordings, if it differs from the study's.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Width of the picture, mm: 88 for one column of a journal, 180 for two.
    #[arg(long, value_name = "MM", default_value_t = PrintStyle::default().width_mm)]
    width_mm: f64,
    /// Size of the text in the picture, points.
    #[arg(long, value_name = "PT", default_value_t = PrintStyle::default().font_pt)]
    font_pt: f64,
    /// Resolution of a PNG, pixels per inch.
    #[arg(long, value_name = "DPI", default_value_t = PrintStyle::default().dpi)]
    dpi: f64,
    #[command(flatten)]
    programs: ProgramOptions,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// Measured and predicted torque over time; needs --study.
    Residuals,
    /// Base parameters with error bars.
    Parameters,
    /// Friction of every joint against velocity.
    Friction,
    /// Tracking error and error bars of an iteration by run.
    Convergence,
}

/// Output of `plot --json`.
#[derive(Serialize)]
struct PlotFile {
    schema: &'static str,
    /// The files that were written.
    files: Vec<PathBuf>,
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    options.out.iter().try_for_each(|path| FigureForm::of(path).map(drop)).map_err(message_of)?;
    let input = match options.figure {
        Kind::Convergence => in_folder(&options.result, ITERATIONS),
        Kind::Residuals | Kind::Parameters | Kind::Friction => result_file(&options.result),
    };
    refuse_overwriting(&options.out, core::slice::from_ref(&input)).map_err(message_of)?;
    let figure = figure(options, &input, context)?;
    let style = PrintStyle { width_mm: options.width_mm, font_pt: options.font_pt, dpi: options.dpi };
    figure.write(&options.out, &style).map_err(message_of)?;
    if context.json {
        terminal::print_document(&json(&PlotFile { schema: "dynident/plot/1", files: options.out.clone() })?)?;
    } else if !context.quiet {
        let lines = options.out.iter().map(|path| format!("wrote {}\n", path.display()));
        terminal::print(&lines.collect::<String>())?;
    }
    Ok(Verdict::Good)
}

fn figure(options: &Options, input: &Path, context: &Context) -> Result<Figure, String> {
    if options.study.is_some() && options.figure != Kind::Residuals {
        return Err("--study is only for --figure residuals: omit it".to_owned());
    }
    if options.figure == Kind::Convergence {
        return Ok(Figure::convergence(&IterationsFile::read(input).map_err(message_of)?));
    }
    let stored = ResultFile::read(input).map_err(message_of)?;
    match options.figure {
        Kind::Friction => Figure::friction(&stored, input).map_err(message_of),
        Kind::Residuals => residuals(options, &stored, input, context),
        Kind::Parameters | Kind::Convergence => Ok(Figure::parameters(&stored)),
    }
}

fn residuals(options: &Options, stored: &ResultFile, input: &Path, context: &Context) -> Result<Figure, String> {
    let Some(path) = &options.study else {
        return Err(format!(
            "{}: a result contains no samples, which residuals need: give the study with its logs (--study STUDY.toml)",
            input.display()
        ));
    };
    let study = options.programs.load_study(path, options.data.as_deref())?;
    let inputs = study_inputs(&study, path, options.data.as_deref(), &["robot", "torque", "log"]);
    refuse_overwriting(&options.out, &inputs).map_err(message_of)?;
    let progress = context.progress();
    let run = RunOptions { data: options.data.clone(), threads: context.threads, progress: &*progress };
    let traces = validation_traces(stored, input, &study, path, &run).map_err(known_in(path))?;
    Ok(Figure::residuals(stored, &traces))
}
