//! Reads robot descriptions from paths and texts.

use crate::errors;
use crate::jobs::interruptible;
use dynident::model::{DescriptionFormat, Robot as Description, read_robot};
use dynident::{LoadSettings, ProgramPermission, XacroSettings, load_robot};
use pyo3::prelude::*;
use std::path::Path;

/// The sections of a study with only a robot.
pub(crate) fn study_of(path: &Path, settings: &str) -> PyResult<String> {
    let wrong = |error: serde_json::Error| errors::RobotError::new_err(error.to_string());
    let mut section: serde_json::Map<String, serde_json::Value> = serde_json::from_str(settings).map_err(wrong)?;
    section.insert("file".to_owned(), path.display().to_string().into());
    serde_json::to_string(&serde_json::json!({ "robot": section })).map_err(wrong)
}

/// Reads a robot file; the program `xacro` expands one with macros if permitted. Ctrl-C stops it.
pub(crate) fn described(
    py: Python<'_>,
    path: &Path,
    xacro: XacroSettings,
    allow_command: bool,
) -> PyResult<Description> {
    let programs = ProgramPermission::from_flag(allow_command);
    interruptible(py, |is_stopped| load_robot(path, &LoadSettings { xacro, programs, is_stopped: Some(is_stopped) }))
}

/// The arguments of xacro among the keys of ``[robot]``.
pub(crate) fn xacro_settings(path: &Path, settings: &str) -> PyResult<XacroSettings> {
    let wrong = |error: serde_json::Error| errors::RobotError::new_err(error.to_string());
    let settings: serde_json::Map<String, serde_json::Value> = serde_json::from_str(settings).map_err(wrong)?;
    let own = settings.into_iter().filter(|(key, _)| key.starts_with("xacro"));
    let own = serde_json::to_string(&own.collect::<serde_json::Map<_, _>>()).map_err(wrong)?;
    let study = dynident::Study::from_json(&study_of(path, &own)?, path);
    Ok(study.map_err(|error| errors::StudyError::new_err(error.to_string()))?.robot.xacro_settings())
}

/// Reads the text of a robot description of the format `wanted`.
pub(crate) fn of_text(py: Python<'_>, text: &str, wanted: DescriptionFormat, name: &str) -> PyResult<Description> {
    of_format(read_robot(text.to_owned(), Path::new(name)).map_err(|error| errors::robot(py, &error))?, wanted)
}

pub(crate) fn of_format(found: Description, wanted: DescriptionFormat) -> PyResult<Description> {
    if found.format == wanted {
        Ok(found)
    } else {
        let (path, format) = (found.path.display(), found.format);
        Err(errors::not_this_format(format!("{path}: is {format:?}, not {wanted:?}: use Robot.load")))
    }
}

pub(crate) fn is_xml(text: &str) -> bool {
    text.trim_start_matches('\u{feff}').trim_start().starts_with('<')
}
