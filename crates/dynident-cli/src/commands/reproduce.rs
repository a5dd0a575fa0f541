use super::{Context, json, message_of};
use crate::{Verdict, summary, terminal};
use dynident::RunOptions;
use dynident_paper::reproduce;
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// Folder for paper.json, report.html, the figures and their studies.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Seed of the genetic algorithm and of random starts.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let progress = context.progress();
    let run = RunOptions { data: None, threads: context.threads, progress: &*progress };
    let file = reproduce(&options.out, options.seed, &run).map_err(message_of)?;
    if context.json {
        terminal::print_document(&json(&file)?)?;
    } else if !context.quiet {
        terminal::print(&summary::reproduction(&file, &options.out))?;
    }
    Ok(if file.reached.iter().all(|goal| goal.met) { Verdict::Good } else { Verdict::Negative })
}
