//! `dynident design` for a study with `[drive.servo]`: commands instead of a motion with torque.

use super::{Context, json, known_in, message_of, pretty_json, refuse_overwriting};
use crate::{Verdict, summary, terminal};
use dynident::{OutputSet, RunOptions, Study, check_writable, design_servos};
use std::path::Path;

/// The commands.
const COMMANDS: &str = "commands.csv";
const DESIGN: &str = "design.json";

/// Designs the commands of the study at the first path into the folder at the second. `data` is the folder of robot and
/// logs, and `seed` replaces that of the study.
pub(super) fn design_commands(
    study: &mut Study,
    (path, out): (&Path, &Path),
    (data, seed): (Option<&Path>, Option<u64>),
    context: &Context,
) -> Result<Verdict, String> {
    if let (Some(seed), Some(servo)) = (seed, &mut study.drive.servo) {
        servo.design.seed = seed;
    }
    refuse_overwriting((out, &[DESIGN, COMMANDS]), (&*study, path, data), &["robot", "design", "log", "format"], &[])?;
    check_writable(out).map_err(message_of)?;
    let progress = context.progress();
    let run = RunOptions { data: data.map(Path::to_owned), threads: context.threads, progress: &*progress };
    let outcome = design_servos(study, path, &run).map_err(known_in(path))?;
    OutputSet::new(out)
        .file(DESIGN, pretty_json(&outcome.file)?)
        .file(COMMANDS, outcome.csv())
        .write()
        .map_err(message_of)?;
    if context.json {
        terminal::print_document(&json(&outcome.file)?)?;
    } else if !context.quiet {
        terminal::print(&summary::servo_design(&outcome.file, out, &[DESIGN, COMMANDS]))?;
    }
    Ok(if outcome.file.feasible { Verdict::Good } else { Verdict::Negative })
}
