use super::permission::ProgramOptions;
use super::search::{OnInterrupt, Search};
use super::{Context, json, known_in, message_of, pretty_json, refuse_overwriting};
use crate::{Verdict, summary, terminal};
use dynident::{OutputSet, RunOptions, check_writable, simulate_study};
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The study file.
    study: PathBuf,
    /// Folder for log.csv and truth.json.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Seed of the sensor noise, if it differs from the study's.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Folder of the robot description, if it differs from the study's.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    #[command(flatten)]
    programs: ProgramOptions,
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let mut study = options.programs.load_study(&options.study, options.data.as_deref())?;
    if let Some(seed) = options.seed {
        study.simulation.get_or_insert_default().sensors.seed = seed;
    }
    let (path, data) = (&options.study, options.data.as_deref());
    let sections = ["robot", "torque", "design", "iteration", "simulation", "controller"];
    refuse_overwriting(&options.out, &["log.csv", "truth.json"], &study, path, data, &sections, &[])?;
    check_writable(&options.out).map_err(message_of)?;
    let progress = context.progress();
    let run = RunOptions { data: options.data.clone(), threads: context.threads, progress: &*progress };
    let search = Search::new(context, OnInterrupt::EndsCommand);
    let simulation =
        simulate_study(&study, &options.study, &run, &|at| search.hear(at)).map_err(known_in(&options.study))?;
    search.end();
    let set = OutputSet::new(&options.out).file("truth.json", pretty_json(&simulation.file)?);
    set.file("log.csv", simulation.log.as_str()).write().map_err(message_of)?;
    if context.json {
        terminal::print_document(&json(&simulation.file)?)?;
    } else if !context.quiet {
        terminal::print(&summary::simulation(&simulation.file, &options.out))?;
    }
    Ok(if simulation.file.done { Verdict::Good } else { Verdict::Negative })
}
