//! Times of dynamics, triangular factors from samples, a step of an excitation design, a step of the closed loop and
//! reading text, and limits of the machine, as JSON lines.

mod batch;
mod clock;
mod closed_loop;
mod excitation;
mod identification;
mod limits;
mod motion;
mod single;
mod text;

pub(crate) use clock::environment;

use clock::Report;
use dynident_lanes::Level;
use dynident_model::Model;
use std::path::Path;

const DYNAMICS_ONLY: &str = "talos_reduced";
const FACTORS_OF: &str = "panda_arm7";

/// Measures the limits of this machine, and times reading the text at `path`: `rows` samples of `model`, created if
/// missing.
pub(crate) fn time_machine(
    name: &str,
    model: &Model,
    levels: &[Level],
    path: &Path,
    rows: usize,
    only: &[String],
) -> Result<(), String> {
    let words = |problem: &dyn core::fmt::Display| format!("{}: {problem}", path.display());
    limits::of_processor(levels, only);
    if only.is_empty() || only.iter().any(|only| only == "text") {
        text::write(path, model, rows).map_err(|source| words(&source))?;
        limits::of_text(path).map_err(|source| words(&source))?;
        let report = Report { robot: name, dof: model.dof(), level: Level::detect(), only: &[] };
        text::time_reading(path, &report).map_err(|source| words(&source))?;
    }
    Ok(())
}

/// Times everything of one robot on these processor levels, with `block` samples per batch; only quantities of `only`
/// unless it is empty.
pub(crate) fn time_robot(
    name: &str,
    model: &Model,
    levels: &[Level],
    block: usize,
    only: &[String],
) -> Result<(), String> {
    for &level in levels {
        let report = Report { robot: name, dof: model.dof(), level, only };
        single::time_all(model, &report);
        batch::time_all(model, &report, block);
        if level == Level::detect() && name != DYNAMICS_ONLY {
            excitation::time_all(model, &report);
            closed_loop::time_all(model, &report).map_err(|error| format!("{name}: closed loop: {error}"))?;
        }
        if name == FACTORS_OF {
            identification::time_all(model, &report).map_err(|error| format!("factors_10000: {error}"))?;
        }
    }
    Ok(())
}
