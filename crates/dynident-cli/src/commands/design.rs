use super::design_commands::{CommandForms, design_commands, lerobot_files};
use super::permission::ProgramOptions;
use super::search::{OnInterrupt, Search};
use super::{Context, interruption, json, known_in, message_of, pretty_json, refuse_overwriting};
use crate::{Verdict, summary, terminal};
use clap::ValueEnum;
use dynident::excitation::DesignProgress;
use dynident::excitation::export::{
    ExportError, LEROBOT_FILES, Sampled, UrScriptSettings, fitness_csv, ros2_joint_trajectory, trajectory_csv,
    urscript, waypoints_csv,
};
use dynident::iteration::StopSignal;
use dynident::{
    DesignOutcome, Folders, OutputSet, RunOptions, Study, StudyRobot, check_log, check_trajectory, check_writable,
    design_study,
};
use std::path::{Path, PathBuf};

/// File of the designed trajectory; it is not written if the trajectory was given.
const TRAJECTORY: &str = "trajectory.csv";
const FILES: [&str; 10] = [
    "design.json",
    "report.html",
    TRAJECTORY,
    "preview.svg",
    "path.svg",
    "fitness.csv",
    "fitness.svg",
    "trajectory.ros2.yaml",
    "waypoints.csv",
    "trajectory.script",
];
/// Files that only some designs have.
const OPTIONAL_FILES: [&str; 6] =
    [TRAJECTORY, "fitness.csv", "fitness.svg", "trajectory.ros2.yaml", "waypoints.csv", "trajectory.script"];

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The study file; its [design] gives the objective.
    study: PathBuf,
    /// Folder for design.json, report.html, trajectory.csv, preview.svg and path.svg; for a study with [drive.servo]
    /// design.json and commands.csv.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Do not search: check this trajectory (t_s, q1.., dq1.., ddq1.. or only positions) against the study's limits,
    /// with a forecast.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["check_log", "seed"])]
    check: Option<PathBuf>,
    /// Do not search: check a log of the study, by its name or file, with a forecast for each parameter.
    #[arg(long, value_name = "NAME", conflicts_with = "seed")]
    check_log: Option<String>,
    /// Seed of the random starts; replaces that of the study.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Also write files for the robot; may be given several times.
    #[arg(long, value_enum, value_name = "FORMAT")]
    to: Vec<Format>,
    /// Rate of trajectory.csv and of the robot's files, Hz; by default the study's search.rate_hz, and 125 for
    /// URScript.
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate_hz: Option<f64>,
    /// Folder of the robot description; replaces that of the study.
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    #[command(flatten)]
    programs: ProgramOptions,
}

impl Options {
    /// The first given option that does not apply to a design of commands (`[drive.servo]`).
    fn only_for_torque(&self) -> Option<&'static str> {
        let given = [
            ("--check", self.check.is_some()),
            ("--check-log", self.check_log.is_some()),
            ("--to urscript", self.to.contains(&Format::Urscript)),
            ("--to waypoints", self.to.contains(&Format::Waypoints)),
            ("--rate-hz", self.rate_hz.is_some()),
        ];
        given.into_iter().find_map(|(name, is_given)| is_given.then_some(name))
    }
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Format {
    /// ROS 2 JointTrajectory, YAML.
    Ros2,
    /// URScript servoj program.
    Urscript,
    /// Time and positions, CSV.
    Waypoints,
    /// LeRobot data set of version 2.1 with one episode, in the folder lerobot.
    Lerobot,
}

fn rate(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().map_err(|error| format!("{error}: give a number of hertz"))?;
    if (1.0..=1e4).contains(&value) { Ok(value) } else { Err("give 1 to 10000 Hz".to_owned()) }
}

/// Writes the files of a design, and removes those of an earlier one.
fn write_files(out: &Path, outcome: &DesignOutcome, files: &[(&str, Vec<u8>)]) -> Result<(), String> {
    let mut set = OutputSet::new(out).file("design.json", pretty_json(&outcome.file)?);
    for (name, contents) in files {
        set = set.file(name, contents.as_slice());
    }
    let is_checked = outcome.file.given.is_some();
    let others =
        OPTIONAL_FILES.iter().chain(&LEROBOT_FILES).filter(|name| !files.iter().any(|(written, _)| written == *name));
    for name in others.filter(|name| !(is_checked && **name == TRAJECTORY)) {
        set = set.absent(name);
    }
    set.write().map_err(message_of)
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let mut study = options.programs.load_study(&options.study, options.data.as_deref())?;
    if study.drive.servo.is_some() {
        if let Some(option) = options.only_for_torque() {
            return Err(format!("{option} needs a study with torque, and this one has [drive.servo]: remove it"));
        }
        let forms =
            CommandForms { ros2: options.to.contains(&Format::Ros2), lerobot: options.to.contains(&Format::Lerobot) };
        return design_commands(
            &mut study,
            &options.study,
            &options.out,
            options.data.as_deref(),
            options.seed,
            forms,
            context,
        );
    }
    if let Some(seed) = options.seed {
        study.design.get_or_insert_default().search.seed = seed;
    }
    let given = options.check.is_some() || options.check_log.is_some();
    let names: Vec<&str> =
        FILES.into_iter().chain(LEROBOT_FILES).filter(|name| !(given && *name == TRAJECTORY)).collect();
    let sections: &[&str] = if options.check_log.is_some() {
        &["robot", "torque", "design", "log"]
    } else {
        &["robot", "torque", "design"]
    };
    let further: Vec<PathBuf> = options.check.iter().cloned().collect();
    let (path, data) = (&options.study, options.data.as_deref());
    refuse_overwriting(&options.out, &names, &study, path, data, sections, &further)?;
    check_writable(&options.out).map_err(message_of)?;
    writable_formats(options, &study)?;
    let progress = context.progress();
    let run = RunOptions { data: options.data.clone(), threads: context.threads, progress: &*progress };
    interruption::listen(&StopSignal::default());
    let search = Search::new(context, OnInterrupt::KeepsBest);
    let watch = |at: &DesignProgress| search.hear(at);
    let outcome = match (&options.check, &options.check_log) {
        (Some(trajectory), _) => check_trajectory(&study, &options.study, trajectory, &run),
        (None, Some(log)) => check_log(&study, &options.study, log, &run),
        (None, None) => design_study(&study, &options.study, &run, watch),
    };
    let outcome = outcome.map_err(known_in(&options.study))?;
    search.end();
    if interruption::pressed() {
        terminal::remark("search stopped: this is the best motion found");
    }
    let files = files(&outcome, &study, options, context)?;
    write_files(&options.out, &outcome, &files)?;
    if !outcome.file.feasible && !options.to.is_empty() {
        terminal::remark("no robot file was written: the motion breaks its limits");
    }
    if context.json {
        terminal::print_document(&json(&outcome.file)?)?;
    } else if !context.quiet {
        let names: Vec<&str> = files.iter().map(|(name, _)| *name).collect();
        terminal::print(&summary::design(&outcome.file, &options.out, &names))?;
    }
    Ok(if outcome.file.feasible { Verdict::Good } else { Verdict::Negative })
}

/// Checks before the search that every requested format can be written.
fn writable_formats(options: &Options, study: &Study) -> Result<(), String> {
    if !options.to.contains(&Format::Urscript) {
        return Ok(());
    }
    let mut settings = UrScriptSettings::default();
    settings.rate_hz = options.rate_hz.unwrap_or(settings.rate_hz);
    settings.validate().map_err(|error| format!("--to urscript: {error}"))?;
    let folders = Folders::new(study, &options.study, options.data.as_deref());
    let robot = StudyRobot::new(study, &options.study, &folders).map_err(known_in(&options.study))?;
    let joints = robot.model().dof();
    if joints == UR_JOINTS { Ok(()) } else { Err(format!("--to urscript: {}", ExportError::SixJoints { joints })) }
}

const UR_JOINTS: usize = 6;

/// The files next to design.json, all generated before the first is written.
fn files(
    outcome: &DesignOutcome,
    study: &Study,
    options: &Options,
    context: &Context,
) -> Result<Vec<(&'static str, Vec<u8>)>, String> {
    let file = &outcome.file;
    let at = |rate_hz: f64, write: &dyn Fn(&Sampled<'_>) -> Result<String, String>| {
        let (times_s, motion) = outcome.sampled(rate_hz);
        write(&Sampled { joints: &file.joints, times_s: &times_s, motion: &motion }).map(String::into_bytes)
    };
    let rate_hz = options.rate_hz.unwrap_or(file.rate_hz);
    let plain = |write: fn(&Sampled<'_>) -> Result<String, ExportError>| {
        at(rate_hz, &|sampled| write(sampled).map_err(|error| error.to_string()))
    };
    let mut files = vec![
        ("report.html", outcome.report().map_err(message_of)?.into_bytes()),
        ("preview.svg", outcome.preview_svg().map_err(message_of)?.into_bytes()),
        ("path.svg", outcome.path_svg().map_err(message_of)?.into_bytes()),
    ];
    if file.given.is_none() {
        files.insert(0, (TRAJECTORY, plain(trajectory_csv)?));
    }
    if let Some(picture) = outcome.fitness_svg().map_err(message_of)? {
        files.push(("fitness.csv", fitness_csv(&outcome.history).into_bytes()));
        files.push(("fitness.svg", picture.into_bytes()));
    }
    // A motion that breaks limits must not be sent to the robot.
    for format in options.to.iter().filter(|_| file.feasible) {
        match format {
            Format::Ros2 => files.push(("trajectory.ros2.yaml", plain(ros2_joint_trajectory)?)),
            Format::Waypoints => files.push(("waypoints.csv", plain(waypoints_csv)?)),
            Format::Lerobot => {
                let (_, motion) = outcome.sampled(rate_hz);
                let positions: Vec<Vec<f64>> = motion.q.chunks(motion.samples).map(<[f64]>::to_vec).collect();
                let (path, name) = (&options.study, &file.name[..]);
                files.extend(lerobot_files(study, path, &outcome.robot, name, rate_hz, &positions, context)?);
            }
            Format::Urscript => {
                let mut settings = UrScriptSettings::default();
                settings.rate_hz = options.rate_hz.unwrap_or(settings.rate_hz);
                let write = |sampled: &Sampled<'_>| urscript(sampled, &settings).map_err(|error| error.to_string());
                files.push(("trajectory.script", at(settings.rate_hz, &write)?));
            }
        }
    }
    Ok(files)
}
