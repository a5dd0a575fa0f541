use super::permission::XacroOptions;
use super::{Context, json, message_of};
use crate::{Verdict, summary, terminal};
use dynident::{
    CorrectedDescription, InspectSettings, Inspection, inspect_robot, inspect_with, mended_robot, write_atomically,
};
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// URDF, MJCF, SDF, or D-H table in TOML.
    robot: PathBuf,
    /// Write a copy of the URDF in which the detected mistakes are corrected, and nothing else is changed.
    #[arg(long, value_name = "OUT.urdf")]
    fix: Option<PathBuf>,
    /// Expected total mass including the base, kg; by default the value in a comment of the file.
    #[arg(long, value_name = "KG", value_parser = kilograms)]
    total_mass: Option<f64>,
    #[command(flatten)]
    xacro: XacroOptions,
}

fn kilograms(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().map_err(|error| format!("{error}: give a number of kilograms"))?;
    if value > 0.0 && value <= 1e6 { Ok(value) } else { Err("give more than 0 and at most 1e6 kg".to_owned()) }
}

pub(crate) fn run(options: &Options, context: &Context) -> Result<Verdict, String> {
    let settings = InspectSettings { total_mass_kg: options.total_mass };
    if let Some(out) = &options.fix {
        dynident::refuse_overwriting(core::slice::from_ref(out), core::slice::from_ref(&options.robot))
            .map_err(message_of)?;
    }
    let robot = options.xacro.load_robot(&options.robot)?;
    let inspection = inspect_robot(&robot, &settings).map_err(message_of)?;
    if context.json {
        terminal::print_document(&json(&inspection)?)?;
    } else {
        terminal::print(&summary::inspection(&inspection))?;
    }
    let Some(out) = &options.fix else { return Ok(verdict(&inspection)) };
    match mended_robot(&robot, &settings).map_err(message_of)? {
        CorrectedDescription::Urdf(text) => {
            write_atomically(out, text.as_bytes()).map_err(message_of)?;
            let left = inspect_with(out, &settings).map_err(message_of)?;
            if !context.quiet {
                terminal::remark(&summary::mended(&inspection, &left, out));
            }
            Ok(verdict(&left))
        }
        CorrectedDescription::NothingToMend => {
            terminal::remark(&format!(
                "{} was not written: no mistake with known correct numbers was found",
                out.display()
            ));
            Ok(verdict(&inspection))
        }
        CorrectedDescription::NoUrdf => Err(format!("{}: --fix supports only URDF files", options.robot.display())),
    }
}

/// Exit status of `inspect`. A robot description with problems is still read, but then the exit status is that of a
/// negative result.
fn verdict(inspection: &Inspection) -> Verdict {
    let problem = inspection.audit.iter().any(|entry| entry.level == "problem");
    if problem || !inspection.slips.is_empty() { Verdict::Negative } else { Verdict::Good }
}
