use super::permission::ProgramOptions;
use super::search::{OnInterrupt, Search};
use super::{Context, interruption, json, known_in, message_of, permission, refuse_overwriting};
use crate::live::{LiveServer, LiveState};
use crate::{Verdict, summary, terminal};
use dynident::excitation::DesignProgress;
use dynident::iteration::{NextMotion, RobotRun, RunRecord, StopSignal};
use dynident::result::INTERRUPTED;
use dynident::study::{LegOrder, Study};
use dynident::{
    Error, IterationWatch, IterationsFile, MotionObserver, ProgramPermission, ProgramRequest, Progress, RunOptions,
    Silent, StudyFile, check_writable, iterate_study,
};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::Arc;

const WRITTEN: [&str; 11] = [
    "iterations.json",
    "report.html",
    "trajectory.json",
    "runs",
    "result.json",
    "identified.urdf",
    "identified.toml",
    "identified.xml",
    "identified.sdf",
    "identification.html",
    "controller.json",
];

/// Address of the live page for this computer only, on any free port.
const LOCAL: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 0);

#[derive(clap::Args)]
struct LivePage {
    /// Show the runs live on a page for the browser, with a stop button. The page is served on this computer only; the
    /// link is printed.
    #[arg(long)]
    live: bool,
    /// Address and port of the live page, if other computers are to open it: anyone with the link can stop the robot.
    #[arg(long, value_name = "IP:PORT", default_value_t = LOCAL, requires = "live")]
    live_address: SocketAddr,
}

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The study file.
    study: PathBuf,
    /// Folder for iterations.json, report.html, trajectory.json, runs/, and the identified robot: result.json,
    /// identified.urdf (and .toml or .xml), identification.html, controller.json.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Repeat every run; by default existing runs in the folder are kept.
    #[arg(long)]
    fresh: bool,
    /// Print the status of the iteration in the folder in one line, and run nothing.
    #[arg(long, conflicts_with = "fresh")]
    status: bool,
    /// Seed of the simulated sensor noise, if it differs from the study's.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    #[command(flatten)]
    programs: ProgramOptions,
    /// Ask on the terminal before each run.
    #[arg(long)]
    confirm: bool,
    #[command(flatten)]
    page: LivePage,
    /// Folder of the robot description, if it differs from the study's.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    if options.status {
        return status(&options.out, context);
    }
    let mut study = options.programs.load_study(&options.study, options.data.as_deref())?;
    if let Some(seed) = options.seed {
        study.simulation.get_or_insert_default().sensors.seed = seed;
    }
    let names = written_files(&study);
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let sections = ["robot", "torque", "design", "iteration", "simulation", "controller"];
    let data = options.data.as_deref();
    refuse_overwriting(&options.out, &names, &study, &options.study, data, &sections, &[])?;
    check_writable(&options.out).map_err(message_of)?;
    let decisions = options.programs.decisions();
    decisions.decide_on_robot(&study, &options.study)?;
    if options.confirm {
        permission::somebody()?;
    }
    let stop = StopSignal::default();
    interruption::listen(&stop);
    // A progress bar would overwrite the questions on the terminal.
    let progress: Box<dyn Progress> = if options.confirm { Box::new(Silent) } else { context.progress() };
    let run = RunOptions { data: options.data.clone(), threads: context.threads, progress: &*progress };
    let live = options.page.live.then(|| started(options, &study, &stop)).transpose()?;
    let state = live.as_ref().map(|(_, state)| &**state);
    let search = Search::new(context, OnInterrupt::EndsCommand);
    progress.begin("runs", Some(most_runs(&study)));
    let mut notes = Vec::new();
    let mut hear = |record: &RunRecord, runs: &[RobotRun]| {
        progress.advance(1);
        state.inspect(|state| state.made(record));
        notes.extend(runs.iter().filter_map(|run| Some(format!("run {}: {}", record.run, run.note.as_ref()?))));
    };
    let mut allow = |motion: &NextMotion| permission::for_motion(motion);
    let design = |at: &DesignProgress| search.hear(at);
    let decide = |request: &ProgramRequest| decisions.decide(request);
    let programs = ProgramPermission::Ask(&decide);
    let mut watch = IterationWatch { stop, programs, ..IterationWatch::new(&design, &mut hear) };
    if options.confirm {
        watch.allow = Some(&mut allow);
    }
    watch.observer = state.map(|state| state as &dyn MotionObserver);
    let file = iterate_study(&study, &options.study, &options.out, !options.fresh, &run, &mut watch);
    progress.end();
    search.end();
    state.inspect(|state| state.end(last_words(&file)));
    for note in &notes {
        terminal::remark(note);
    }
    match file {
        Err(error @ Error::Interrupted { .. }) => {
            terminal::remark(&error.to_string());
            Ok(Verdict::Interrupted)
        }
        other => ended(&other.map_err(known_in(&options.study))?, options, context),
    }
}

/// Starts the live page and prints its link.
fn started(options: &Options, study: &Study, stop: &StopSignal) -> Result<(LiveServer, Arc<LiveState>), String> {
    let state = Arc::new(LiveState::new(StudyFile::new(study, &options.study).title(), stop.clone()));
    let address = options.page.live_address;
    let server = LiveServer::start(address, Arc::clone(&state));
    let server = server.map_err(|error| {
        format!("--live-address {address}: {error}; give an address of this computer and a free port (127.0.0.1:0)")
    })?;
    terminal::remark(&format!("live page: {}", server.url()));
    if !address.ip().is_loopback() {
        terminal::remark(
            "the live page is open to the network without encryption: anyone with the link can stop the robot",
        );
    }
    Ok((server, state))
}

/// Text of the live page at the end of the iteration.
fn last_words(file: &Result<IterationsFile, Error>) -> String {
    match file {
        Ok(file) => format!("the iteration has ended: {}", file.reason),
        Err(error) => format!("the iteration has ended: {error}"),
    }
}

fn written_files(study: &Study) -> Vec<String> {
    let legs = study.iteration.as_ref().map_or(0, |section| section.leg.len());
    let legs = (1..=legs).map(|leg| format!("leg_{leg}/runs"));
    WRITTEN.into_iter().map(str::to_owned).chain(legs).collect()
}

fn most_runs(study: &Study) -> u64 {
    let section = study.iteration.clone().unwrap_or_default();
    let iterations = if section.order == LegOrder::OneAfterAnother { section.leg.len().max(1) } else { 1 };
    (section.max_runs * iterations) as u64
}

fn ended(file: &IterationsFile, options: &Options, context: &Context) -> Result<Verdict, String> {
    if context.json {
        terminal::print_document(&json(file)?)?;
    } else if !context.quiet {
        terminal::print(&summary::iteration(file, &options.out))?;
    }
    if file.status == INTERRUPTED {
        return Ok(Verdict::Interrupted);
    }
    Ok(if file.converged { Verdict::Good } else { Verdict::Negative })
}

fn status(out: &Path, context: &Context) -> Result<Verdict, String> {
    let path = out.join("iterations.json");
    if !path.is_file() {
        return Err(format!("{}: this folder contains no iteration", path.display()));
    }
    let file = IterationsFile::read(&path).map_err(message_of)?;
    if context.json {
        terminal::print_document(&json(&file)?)?;
    } else {
        terminal::print(&format!("{}\n", file.status_line()))?;
    }
    Ok(if file.converged { Verdict::Good } else { Verdict::Negative })
}
