//! `new`: a study from a robot and its recordings.

mod channels;
mod draft;
mod drives;
mod grippers;
mod joint_files;
mod locked;
mod normalised;
mod position_units;
mod reasons;
mod recognised;
mod settings;
mod tables;

pub use settings::NewStudySettings;

use crate::error::Error;
use crate::jobs::check::check;
use crate::jobs::log::log_contents;
use crate::jobs::options::RunOptions;
use crate::result::{LogContents, NEW_STUDY_SCHEMA, NewStudyFile, StudyChange, StudyCheck, Unsure};
use crate::study::{LoadSettings, Study, XacroSettings, load_robot};
use draft::{Draft, Table};
use drives::{DriveInertiaFinding, drive_inertia};
use dynident_model::Robot;
use dynident_recording::Level;
use joint_files::JointFiles;
use position_units::PositionUnits;
use recognised::RecognisedColumns;
use std::path::{Path, PathBuf};

const MAX_ROUNDS: usize = 3;

/// Inputs of a new study.
#[derive(Clone, Debug, PartialEq)]
pub struct NewStudy {
    /// The robot description: URDF, MJCF, SDF, or D-H table in TOML.
    pub robot: PathBuf,
    /// The robot description as read by [`load_robot`]; `None` reads the file, which must not have xacro macros.
    pub description: Option<Box<Robot>>,
    /// Settings of the program `xacro`; written into the study if arguments are given.
    pub xacro: XacroSettings,
    /// The recordings, at least one.
    pub logs: Vec<PathBuf>,
    /// Path of the study; paths in it are relative to its folder.
    pub out: PathBuf,
    /// Sample rate for recordings without time stamps, Hz.
    pub rate_hz: Option<f64>,
    /// Lines that a person has decided; these override proposals and answer [`NewStudyFile::unsure`].
    pub stated: Vec<StudyChange>,
}

impl NewStudy {
    fn study(&self, draft: &Draft) -> Result<Study, Error> {
        let mut study = Study::parse(&draft.text(), &self.out)?;
        study.robot.description.clone_from(&self.description);
        Ok(study)
    }
}

/// Writes a study: joints from names and number of columns, units from names, limits and ranges, and a part for
/// validation. The study is then examined like by [`check`], and unambiguous corrections are applied. One fit tests
/// for drive inertia, which `design` and `iterate` need but cannot test. Every line has a reason; uncertain lines are
/// marked. No file is written.
///
/// # Errors
/// A robot description or recording that cannot be read, or without recognisable columns of positions and of torques or
/// commands. A recording that cannot be used with the written study is a doubt, not an error.
pub fn new_study(request: &NewStudy, options: &RunOptions<'_>) -> Result<NewStudyFile, Error> {
    new_study_with(request, options, &NewStudySettings::default())
}

/// Like [`new_study()`], with other thresholds.
///
/// # Errors
/// Same as for [`new_study()`], and invalid thresholds.
pub fn new_study_with(
    request: &NewStudy,
    options: &RunOptions<'_>,
    thresholds: &NewStudySettings,
) -> Result<NewStudyFile, Error> {
    thresholds.validate().map_err(Error::section(&request.out, "new"))?;
    let robot = match &request.description {
        Some(robot) => (**robot).clone(),
        None => load_robot(&request.robot, &LoadSettings { xacro: request.xacro.clone(), ..LoadSettings::default() })?,
    };
    // Each episode of a file is a separate recording.
    let (mut logs, mut parts) = (Vec::new(), Vec::new());
    for path in &request.logs {
        for (part, contents) in log_contents(path)?.episodes() {
            logs.push((path.as_path(), contents));
            parts.push(part);
        }
    }
    let find = |logs: &[(&Path, LogContents)]| RecognisedColumns::find(&robot.model, logs, thresholds);
    let names: Vec<String> = robot.model.joints().iter().map(|joint| joint.name.clone()).collect();
    let of_joints = JointFiles::join(&logs, &names).and_then(|(files, joined)| {
        let recorded = RecognisedColumns { joint_files: Some(files), ..find(&joined).ok()? };
        recorded.has_file_pattern(&robot.model).then_some((recorded, joined))
    });
    let recorded = match of_joints {
        Some((recorded, joined)) => {
            logs = joined;
            recorded
        }
        None => RecognisedColumns { parts, ..find(&logs).map_err(Error::NewStudy)? },
    };
    let mut draft = recorded.draft(request, &robot.model, &logs);
    for loss in robot.losses_of_base() {
        draft.explain("[robot]", "file", &loss.to_string());
    }
    let may_be_normalised = PositionUnits::of(&recorded, &robot.model, &logs).may_be_normalised();
    for change in &request.stated {
        draft.apply(change, "As stated");
    }

    let mut unsure = draft.unsure();
    unsure.extend(recorded.unused_recordings(&logs));
    // No correction is reliable without the sample rate and the unit of the positions.
    let is_unknown = |change: &StudyChange| {
        change.line.starts_with("rate_hz") || may_be_normalised && change.line.starts_with("unit")
    };
    let has_unknown = unsure.iter().filter_map(|unsure| unsure.line.as_ref()).any(is_unknown);
    let examined = if has_unknown { None } else { corrected(request, options, &mut draft, &mut unsure)? };
    let remaining = examined.iter().flat_map(|check| &check.findings).filter(|finding| finding.level == Level::Problem);
    unsure.extend(remaining.map(|finding| Unsure {
        line: None,
        proposed: finding.write.iter().filter(|change| change.is_well_formed()).cloned().collect(),
        reason: finding.sentence(),
    }));
    if unsure.is_empty() && examined.is_some() && !recorded.has_commands() {
        match drive_inertia(request, &draft, options)? {
            DriveInertiaFinding::Present(table) => draft = draft.with(table),
            DriveInertiaFinding::Absent(figures) => draft = draft.with(Table::new("", figures)),
        }
    }
    Ok(NewStudyFile {
        schema: NEW_STUDY_SCHEMA.to_owned(),
        file: request.out.display().to_string(),
        text: draft.text(),
        unsure,
        check: examined,
    })
}

/// Checks the drafted study and corrects it, until `check` finds nothing to correct. Returns the last findings.
fn corrected(
    request: &NewStudy,
    options: &RunOptions<'_>,
    draft: &mut Draft,
    unsure: &mut Vec<Unsure>,
) -> Result<Option<StudyCheck>, Error> {
    let mut examined = None;
    for _ in 0..MAX_ROUNDS {
        let study = request.study(draft)?;
        let found = match check(&study, &request.out, options) {
            Ok(found) => found.check,
            Err(error @ Error::Interrupted { .. }) => return Err(error),
            // Except for the part that the error names, the study is known, so it is written.
            Err(error) => {
                unsure.push(Unsure { line: None, proposed: Vec::new(), reason: error.to_string() });
                break;
            }
        };
        let changed = draft.apply_corrections(&found);
        examined = Some(found);
        if !changed {
            break;
        }
    }
    Ok(examined)
}
