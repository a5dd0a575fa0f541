//! `dynident design` for a study with `[drive.servo]`: commands instead of a motion with torque.

use super::{Context, json, known_in, message_of, pretty_json, refuse_overwriting};
use crate::{Verdict, summary, terminal};
use dynident::excitation::export::{EpisodeFiles, LEROBOT_FILES, LeRobotEpisode, lerobot_episode, ros2_commands};
use dynident::{
    OutputSet, RunOptions, ServoDesignOutcome, Study, StudyRobot, check_writable, design_servos, lerobot_actions,
};
use std::path::Path;

/// File of the designed commands.
const COMMANDS: &str = "commands.csv";
const DESIGN: &str = "design.json";
const ROS2: &str = "commands.ros2.yaml";

/// Requested files for robots in addition to `commands.csv`.
#[derive(Clone, Copy, Debug)]
pub(super) struct CommandForms {
    pub(super) ros2: bool,
    pub(super) lerobot: bool,
}

/// Designs the commands of the study at the first path into the folder at the second. `data` is the folder of robot and
/// logs, and `seed` replaces that of the study. Files in `forms` are written if the motion keeps all limits.
pub(super) fn design_commands(
    study: &mut Study,
    path: &Path,
    out: &Path,
    data: Option<&Path>,
    seed: Option<u64>,
    forms: CommandForms,
    context: &Context,
) -> Result<Verdict, String> {
    if let (Some(seed), Some(servo)) = (seed, &mut study.drive.servo) {
        servo.design.seed = seed;
    }
    let names: Vec<&str> = [DESIGN, COMMANDS, ROS2].into_iter().chain(LEROBOT_FILES).collect();
    refuse_overwriting(out, &names, study, path, data, &["robot", "design", "log", "format"], &[])?;
    check_writable(out).map_err(message_of)?;
    let progress = context.progress();
    let run = RunOptions { data: data.map(Path::to_owned), threads: context.threads, progress: &*progress };
    let outcome = design_servos(study, path, &run).map_err(known_in(path))?;
    let files = files(study, path, &outcome, forms, context)?;
    let mut set = OutputSet::new(out).file(DESIGN, pretty_json(&outcome.file)?).file(COMMANDS, outcome.csv());
    for (name, contents) in &files {
        set = set.file(name, contents.as_slice());
    }
    // Remove files of an earlier design.
    for name in names[2..].iter().filter(|name| !files.iter().any(|(written, _)| written == *name)) {
        set = set.absent(name);
    }
    set.write().map_err(message_of)?;
    if !outcome.file.feasible && (forms.ros2 || forms.lerobot) {
        terminal::remark("no robot file was written: the motion breaks its limits");
    }
    if context.json {
        terminal::print_document(&json(&outcome.file)?)?;
    } else if !context.quiet {
        let written: Vec<&str> = [DESIGN, COMMANDS].into_iter().chain(files.iter().map(|(name, _)| *name)).collect();
        terminal::print(&summary::servo_design(&outcome.file, out, &written))?;
    }
    Ok(if outcome.file.feasible { Verdict::Good } else { Verdict::Negative })
}

/// The files in addition to the commands.
fn files(
    study: &Study,
    path: &Path,
    outcome: &ServoDesignOutcome,
    forms: CommandForms,
    context: &Context,
) -> Result<EpisodeFiles, String> {
    let file = &outcome.file;
    let mut files = EpisodeFiles::new();
    // Commands whose motion breaks limits must not be sent to the robot.
    if forms.ros2 && file.feasible {
        let text =
            ros2_commands(&file.joints, &outcome.times_s, &outcome.commands).map_err(|error| error.to_string())?;
        files.push((ROS2, text.into_bytes()));
    }
    if forms.lerobot && file.feasible {
        let (name, commands) = (&file.study[..], &outcome.commands);
        files.extend(lerobot_files(study, path, &outcome.robot, name, file.rate_hz, commands, context)?);
    }
    Ok(files)
}

/// The LeRobot data set with the joint positions of a design with this name, at this rate.
pub(super) fn lerobot_files(
    study: &Study,
    path: &Path,
    robot: &StudyRobot,
    name: &str,
    rate_hz: f64,
    positions: &[Vec<f64>],
    context: &Context,
) -> Result<EpisodeFiles, String> {
    let actions = lerobot_actions(study, path, robot, positions).map_err(known_in(path))?;
    if !context.quiet {
        actions.notes.iter().for_each(|note| terminal::remark(note));
    }
    let episode = LeRobotEpisode {
        robot_type: robot.model().name(),
        task: name,
        rate_hz,
        names: &actions.names,
        actions: &actions.values,
    };
    lerobot_episode(&episode).map_err(|error| format!("--to lerobot: {error}"))
}
