//! `dynident identify STUDY.toml [--out DIR]`, or with factors instead of a study and its logs.

use super::permission::ProgramOptions;
use super::{Context, factors, json, judged, known_in, message_of, pretty_json, refuse_overwriting, show_problems};
use crate::{Verdict, summary, terminal};
use dynident::export::Target;
use dynident::{
    EXPORT_VALIDATION_SUFFIX, Factors, IdentificationOutcome, OutputSet, RunOptions, Study, check_writable,
    export_validation, identify, identify_factors, identify_servos, table_validation,
};
use std::path::{Path, PathBuf};

/// File of the user's URDF with the identified values.
const URDF: &str = "identified.urdf";
/// File of the user's D-H table with the identified values, if the robot file is one.
const TABLE: &str = "identified.toml";
/// File of the user's MJCF with the identified values, if the robot file is one.
const MJCF: &str = "identified.xml";
/// File of the user's SDF with the identified values, if the robot file is one.
const SDF: &str = "identified.sdf";

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The study file.
    #[arg(required_unless_present = "factors")]
    study: Option<PathBuf>,
    /// Factor files from `reduce` or `merge`, instead of a study and its logs.
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with_all = ["study", "data"])]
    factors: Vec<PathBuf>,
    /// Use only the logs of this robot in the factors.
    #[arg(long, value_name = "NAME", requires = "factors")]
    arm: Option<String>,
    /// Folder for result.json, report.html and identified.urdf (for a D-H table also identified.toml, for an MJCF
    /// identified.xml, for an SDF identified.sdf), each model with its held-out error in NAME.validation.json. By
    /// default STUDY-result in the current folder, for a study STUDY.toml, and factors-result for factors. An earlier
    /// result in the folder is replaced; its other files stay.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Folder of the recordings, if it differs from the study's.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Exit with status 1 if the relative error on any held-out log is larger, or if no log is held out.
    #[arg(long, value_name = "PERCENT", value_parser = super::percentage)]
    max_validation_error: Option<f64>,
    #[command(flatten)]
    programs: ProgramOptions,
}

/// All files that may be written.
const FILES: [&str; 10] = [
    URDF,
    TABLE,
    MJCF,
    SDF,
    "report.html",
    "result.json",
    "identified.urdf.validation.json",
    "identified.toml.validation.json",
    "identified.xml.validation.json",
    "identified.sdf.validation.json",
];

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let out = out_folder(options);
    let progress = context.progress();
    let run = RunOptions { data: options.data.clone(), threads: context.threads, progress: &*progress };
    if let Some(path) = &options.study {
        let study = options.programs.load_study(path, options.data.as_deref())?;
        if study.fits_commands() {
            return servos(&study, path, &out, options, context, &run);
        }
    }
    let mut identification = match &options.study {
        Some(study) => of_study(study, &out, options, &run)?,
        None => of_factors(&out, options, &run)?,
    };
    if let Some(provenance) = &mut identification.result.provenance {
        provenance.command = Some(command(options));
    }
    let result = &identification.result;
    let mut set = OutputSet::new(&out)
        .file("result.json", pretty_json(result)?)
        .file("report.html", identification.report().map_err(message_of)?);
    let mut models = Vec::new();
    let texts = [
        (URDF, Some(Target::Urdf), &identification.urdf),
        (TABLE, None, &identification.table),
        (MJCF, Some(Target::Mjcf), &identification.mjcf),
        (SDF, Some(Target::Sdf), &identification.sdf),
    ];
    for (name, target, text) in texts {
        models.extend(text.as_ref().map(|_| name));
        let next_to_it = format!("{name}{EXPORT_VALIDATION_SUFFIX}");
        set = match text {
            Some(text) => {
                let validation = match target {
                    Some(target) => export_validation(result, target, name, text),
                    None => table_validation(result, name, text),
                };
                set.file(name, text.as_str()).file(&next_to_it, pretty_json(&validation)?)
            }
            None => set.absent(name).absent(&next_to_it),
        };
    }
    set.write().map_err(message_of)?;
    if context.json {
        terminal::print_document(&json(result)?)?;
    } else if !context.quiet {
        terminal::print(&summary::identification(result, &out, &models))?;
    }
    show_problems(&result.problem_lines(), ", listed in result.json");
    let within = judged(&result.validation, options.max_validation_error);
    Ok(if result.problems.is_empty() { within } else { Verdict::Negative })
}

/// Folder of the result: the given one, or one named after the study.
fn out_folder(options: &Options) -> PathBuf {
    let default = || {
        let stem = options.study.as_deref().and_then(Path::file_stem).unwrap_or("factors".as_ref());
        let mut name = stem.to_owned();
        name.push("-result");
        name.into()
    };
    options.out.clone().unwrap_or_else(default)
}

/// Identifies drives and bodies from commands and positions.
fn servos(
    study: &Study,
    path: &Path,
    out: &Path,
    options: &Options,
    context: &Context,
    run: &RunOptions<'_>,
) -> Result<Verdict, String> {
    if options.max_validation_error.is_some() {
        return Err("--max-validation-error judges torque, and this study has commands: remove it".to_owned());
    }
    refuse_overwriting(out, &FILES, study, path, options.data.as_deref(), &["robot", "log", "format"], &[])?;
    check_writable(out).map_err(message_of)?;
    let mut found = identify_servos(study, path, run).map_err(known_in(path))?;
    if let Some(provenance) = &mut found.result.provenance {
        provenance.command = Some(command(options));
    }
    let mut set = OutputSet::new(out)
        .file("result.json", pretty_json(&found.result)?)
        .file("report.html", found.report().map_err(message_of)?);
    let mut models = Vec::new();
    for (name, text) in [(URDF, &found.urdf), (MJCF, &found.mjcf)] {
        set = match text {
            Some(text) => {
                models.push(name);
                set.file(name, text.as_str())
            }
            None => set.absent(name),
        };
    }
    set.write().map_err(message_of)?;
    if context.json {
        terminal::print_document(&json(&found.result)?)?;
    } else if !context.quiet {
        terminal::print(&summary::servo(&found.result, out, &models))?;
    }
    show_problems(&found.result.problems, ", listed in result.json");
    Ok(if found.result.problems.is_empty() { Verdict::Good } else { Verdict::Negative })
}

fn of_study(path: &Path, out: &Path, options: &Options, run: &RunOptions<'_>) -> Result<IdentificationOutcome, String> {
    let study = options.programs.load_study(path, options.data.as_deref())?;
    let sections = ["robot", "torque", "log", "arm", "format", "motion", "estimator"];
    refuse_overwriting(out, &FILES, &study, path, options.data.as_deref(), &sections, &[])?;
    check_writable(out).map_err(message_of)?;
    identify(&study, path, run).map_err(known_in(path))
}

fn of_factors(out: &Path, options: &Options, run: &RunOptions<'_>) -> Result<IdentificationOutcome, String> {
    let outputs = FILES.map(|name| out.join(name));
    dynident::refuse_overwriting(&outputs, &options.factors).map_err(message_of)?;
    let mut all = factors::read_all(&options.factors)?;
    if let Some(arm) = &options.arm {
        all = of_arm(&all, arm)?;
    }
    check_writable(out).map_err(message_of)?;
    identify_factors(&all, run).map_err(message_of)
}

fn of_arm(all: &Factors, arm: &str) -> Result<Factors, String> {
    let own = all.only(|log| log.arm.as_deref() == Some(arm));
    if own.logs().is_empty() {
        let known: Vec<&str> = all.arms().into_iter().flatten().collect();
        return Err(format!("--arm {arm}: no log of this robot; the factors have logs of {}", known.join(", ")));
    }
    Ok(own)
}

/// The command line of the result without options that do not change the result. Folders are omitted, because their
/// names depend on the computer.
fn command(options: &Options) -> String {
    let name = |path: &Path| path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let limit = options.max_validation_error.map(|limit| format!(" --max-validation-error {limit}"));
    let arm = options.arm.as_ref().map(|arm| format!(" --arm {arm}"));
    let of = match &options.study {
        Some(study) => name(study),
        None => format!("--factors {}", options.factors.iter().map(|path| name(path)).collect::<Vec<_>>().join(" ")),
    };
    format!("dynident identify {of}{}{}", arm.unwrap_or_default(), limit.unwrap_or_default())
}
