//! **The study file**: a robot, its drives, its logs and how to fit them, without code.

mod arrays;
mod code;
mod design;
mod drive;
mod estimator;
mod folders;
mod friction;
mod friction_keys;
mod inputs;
mod iteration;
mod log;
mod log_source;
mod overlap;
mod payload;
mod physical;
mod robot;
mod robot_model;
mod simulated;
mod simulation;
mod task;
mod torque;

pub use code::{Code, FunctionChoice};
pub use design::{
    CriterionChoice, DesignSection, FamilyChoice, GivenStroke, JoinedChoice, OptimiserChoice, PriorSection,
    StartPosture, TorqueNoise, WindowedCondition, WindowedProblem,
};
pub use drive::{CoulombChoice, CouplingSection, DriveSection, JointDrive};
pub use estimator::{EstimatorMethod, EstimatorSection};
pub use folders::Folders;
pub use friction::{FrictionChoice, FrictionTerm};
pub(crate) use inputs::StudyInput;
pub use iteration::{
    Automatic, DifferentiatorKey, HeldOutSection, IterationSection, LegOrder, LegSection, MotionChoice, PriorChoice,
    RobotChoice,
};
pub use log::LogSection;
pub(crate) use log_source::StudyLogSource;
pub use payload::{ArmSection, PayloadSection};
pub use physical::PhysicalChoice;
pub use robot::{FollowSection, LoopSection, RobotSection};
pub use robot_model::StudyRobot;
pub use simulated::SimulatedSection;
pub use simulation::{SimulatedTruth, SimulationSection};
pub use torque::TorqueSection;

use crate::error::{Error, StudyError};
use dynident_identification::Role;
use dynident_identification::rows::ParallelFilterSettings;
use dynident_model::line_and_column;
use dynident_recording::{DifferentiatorSettings, LogFormat, MotionSettings};
use dynident_simulation::ControllerSettings;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A study, as written in TOML. Unknown keys are errors, so that a slip of the pen does not silently change a fit.
///
/// ```
/// let study = dynident::Study::parse(
///     r#"
///     [robot]
///     file = "arm.urdf"
///
///     [format]
///     time = { column = "t_s" }
///     position = { columns = "q{1..6}_rad" }
///     torque = { columns = "tau{1..6}_Nm" }
///
///     [[log]]
///     file = "first.csv"
///
///     [[log]]
///     file = "second.csv"
///     role = "validate"
///     "#,
///     std::path::Path::new("study.toml"),
/// )
/// .unwrap();
/// assert_eq!(study.log.len(), 2);
/// ```
#[derive(Clone, Debug, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// What the study is called in reports; the file's name by default.
    #[serde(default)]
    pub name: Option<String>,
    /// Where the recordings can be had.
    #[serde(default)]
    pub source: Option<String>,
    /// Folder of the recordings, relative to the study file, used unless the command line names one.
    #[serde(default)]
    pub data: Option<PathBuf>,
    /// The robot.
    pub robot: RobotSection,
    /// Friction, offsets and drive inertia.
    #[serde(default)]
    pub drive: DriveSection,
    /// Drives that turn with two joints.
    #[serde(default)]
    pub coupling: Vec<CouplingSection>,
    /// Springs, counterbalances, cables: torques by positions and velocities.
    #[serde(default)]
    pub torque: Vec<TorqueSection>,
    /// What logs were recorded with.
    #[serde(default)]
    pub payload: Vec<PayloadSection>,
    /// An arm that is known already.
    #[serde(default)]
    pub arm: Option<ArmSection>,
    /// How all logs are written; a log may have its own `format`.
    #[serde(default)]
    pub format: Option<LogFormat>,
    /// From positions to velocities and accelerations.
    #[serde(default)]
    pub motion: MotionSettings,
    /// The low-pass and decimation that torque and regressor go through alike.
    #[serde(default)]
    pub parallel_filter: ParallelFilterSettings,
    /// The estimator.
    #[serde(default)]
    pub estimator: EstimatorSection,
    /// The excitation trajectory that `design` looks for.
    #[serde(default)]
    pub design: Option<DesignSection>,
    /// The controller of `simulate`, and of `iterate` once there is a model.
    #[serde(default)]
    pub controller: Option<ControllerSettings>,
    /// The robot that `simulate` and `iterate` simulate.
    #[serde(default)]
    pub simulation: Option<SimulationSection>,
    /// How `iterate` goes about it.
    #[serde(default)]
    pub iteration: Option<IterationSection>,
    /// The logs; only `design` needs none.
    #[serde(default)]
    pub log: Vec<LogSection>,
}

/// What TOML cannot say is not said.
fn drop_nulls(value: &mut serde_json::Value) {
    match value {
        serde_json::Value::Object(entries) => {
            entries.retain(|_, entry| !entry.is_null());
            entries.values_mut().for_each(drop_nulls);
        }
        serde_json::Value::Array(values) => values.iter_mut().for_each(drop_nulls),
        _ => {}
    }
}

/// Largest study file, bytes.
const MAX_STUDY_BYTES: u64 = 4 << 20;

impl Study {
    /// Reads a study from a file.
    ///
    /// # Errors
    /// If the file cannot be read, or as [`parse`](Study::parse).
    pub fn load(path: &Path) -> Result<Self, Error> {
        let cannot = |source| Error::File { path: path.to_owned(), source };
        let bytes = dynident_files::read(path, MAX_STUDY_BYTES).map_err(|source| match source.kind() {
            std::io::ErrorKind::FileTooLarge => {
                Error::study(path)(StudyError::TooLarge { most_bytes: MAX_STUDY_BYTES })
            }
            _ => cannot(source),
        })?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let good = error.utf8_error().valid_up_to();
            let before = String::from_utf8_lossy(&error.as_bytes()[..good]).into_owned();
            let (line, column) = line_and_column(&before, before.len());
            Error::StudyAt { path: path.to_owned(), line, column, source: StudyError::NotUtf8 }
        })?;
        Self::parse(&text, path)
    }

    /// Reads a study from its text; `path` is only named in messages.
    ///
    /// # Errors
    /// If the text is no TOML, a key is unknown or of the wrong kind, or sections contradict each other; the message
    /// names file, line and column.
    pub fn parse(text: &str, path: &Path) -> Result<Self, Error> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        if text.trim().is_empty() {
            let fix = "a study needs at least [robot] and, to identify, one [[log]]";
            return Err(Error::study(path)(StudyError::missing("the file is empty", fix)));
        }
        let study: Self = toml::from_str(text).map_err(|error| {
            let (line, column) = error.span().map_or((1, 1), |span| line_and_column(text, span.start));
            let problem = error.message().trim().replace('\n', " ");
            Error::StudyAt { path: path.to_owned(), line, column, source: StudyError::Toml { problem } }
        })?;
        study.check().map_err(Error::study(path))?;
        Ok(study)
    }

    /// Builds a study from JSON with the keys of the TOML, null for one that is not there; `path` is named in messages,
    /// and files are looked for beside it.
    ///
    /// # Errors
    /// As [`parse`](Study::parse), without line and column.
    pub fn from_json(text: &str, path: &Path) -> Result<Self, Error> {
        let wrong = |error: serde_json::Error| Error::study(path)(StudyError::Toml { problem: error.to_string() });
        let mut value = serde_json::from_str(text).map_err(wrong)?;
        drop_nulls(&mut value);
        let study: Self = serde_json::from_value(value).map_err(wrong)?;
        study.check().map_err(Error::study(path))?;
        Ok(study)
    }

    /// The study as TOML, with every key that has a value. Samples and descriptions in memory are only named.
    ///
    /// # Errors
    /// [`StudyError::Toml`] for a number that TOML does not have.
    pub fn to_toml(&self) -> Result<String, StudyError> {
        toml::to_string(self).map_err(|error| StudyError::Toml { problem: error.to_string() })
    }

    /// That there is a log, as fitting and testing need; a study for `design` may have none.
    pub(crate) fn require_log(&self, path: &Path) -> Result<(), Error> {
        if self.log.is_empty() {
            let fix = "name at least one log with `file = \"...\"`";
            return Err(Error::study(path)(StudyError::missing("no [[log]]", fix)));
        }
        Ok(())
    }

    /// That there is a log to fit to.
    pub(crate) fn require_training_log(&self, path: &Path) -> Result<(), Error> {
        self.require_log(path)?;
        if !self.log.iter().any(|log| log.role == Role::Identify) {
            let what = "no log has the role \"identify\"";
            return Err(Error::study(path)(StudyError::missing(what, "there is nothing to fit to")));
        }
        Ok(())
    }

    /// Places of the logs with this role.
    pub(crate) fn logs_of_role(&self, role: Role) -> Vec<usize> {
        (0..self.log.len()).filter(|&index| self.log[index].role == role).collect()
    }

    /// The parts that are a caller's own code, each with the name of its function: a study with such is no file's.
    pub fn functions(&self) -> Vec<String> {
        let mut found = Vec::new();
        for torque in &self.torque {
            found.extend(torque.function.as_ref().map(|name| format!("torque `{}`: {name}", torque.name)));
        }
        if let DifferentiatorSettings::Function { function, .. } = &self.motion.differentiator {
            found.push(format!("motion.differentiator: {function}"));
        }
        if self.estimator.method == EstimatorMethod::Function {
            let name = self.estimator.function.as_deref().unwrap_or_default();
            found.push(format!("estimator: {name}"));
        }
        if let Some(design) = &self.design {
            found.extend(design.family.functions().into_iter().map(|name| format!("design.family: {name}")));
        }
        found
    }

    fn check(&self) -> Result<(), StudyError> {
        for (index, log) in self.log.iter().enumerate() {
            let at = || StudyError::at(format!("[[log]] number {}", index + 1));
            if log.format.is_none() && self.format.is_none() {
                let missing = StudyError::missing("neither the log nor the study has a [format]", "give one of them");
                return Err(at()(missing));
            }
            log.validate().map_err(at())?;
        }
        self.drive.validate()?;
        self.check_temperature()?;
        for (index, coupling) in self.coupling.iter().enumerate() {
            if self.coupling[..index].iter().any(|other| other.name == coupling.name) {
                return Err(StudyError::Twice {
                    what: "coupling".to_owned(),
                    name: coupling.name.clone(),
                    fix: "give each drive a name of its own",
                });
            }
            coupling.validate().map_err(StudyError::at(format!("coupling `{}`", coupling.name)))?;
        }
        for (index, torque) in self.torque.iter().enumerate() {
            if self.torque[..index].iter().any(|other| other.name == torque.name) {
                return Err(StudyError::Twice {
                    what: "torque".to_owned(),
                    name: torque.name.clone(),
                    fix: "give each a name of its own",
                });
            }
            torque.validate().map_err(StudyError::at(format!("torque `{}`", torque.name)))?;
        }
        for (index, payload) in self.payload.iter().enumerate() {
            if self.payload[..index].iter().any(|other| other.name == payload.name) {
                return Err(StudyError::Twice {
                    what: "payload".to_owned(),
                    name: payload.name.clone(),
                    fix: "give each a name of its own",
                });
            }
            payload.validate().map_err(StudyError::at(format!("payload `{}`", payload.name)))?;
        }
        self.robot.validate()?;
        self.parallel_filter.validate()?;
        if let Some(design) = &self.design {
            design.validate().map_err(StudyError::at("[design]"))?;
        }
        self.motion.validate().map_err(StudyError::at("[motion]"))?;
        self.estimator.validate()
    }

    /// That friction which depends on the temperature is asked for where it can be had.
    fn check_temperature(&self) -> Result<(), StudyError> {
        let terms =
            self.drive.joints.values().filter_map(|own| own.terms.as_ref()).chain([&self.drive.terms]).flatten();
        if !terms.into_iter().any(|term| term.law().needs_temperature()) {
            return Ok(());
        }
        let own = self.drive.joints.values().map(|own| own.friction);
        if own.chain([self.drive.friction]).any(|choice| choice == Some(FrictionChoice::Auto)) {
            return Err(StudyError::conflict(
                "drive.friction = \"auto\" with the law `temperature`",
                "let the logs choose friction without it, then state what they chose beside it",
            ));
        }
        if self.estimator.method == EstimatorMethod::Instrumental || self.estimator.instruments.is_some() {
            return Err(StudyError::conflict(
                "drive.laws: `temperature` does not go with instruments",
                "use another estimator.method and leave out estimator.instruments",
            ));
        }
        Ok(())
    }

    /// The format of log number `index`, with its own range in force.
    ///
    /// # Panics
    /// If there is no such log. That every log has a format was checked when the study was read.
    pub fn format_of(&self, index: usize) -> LogFormat {
        let log = &self.log[index];
        let mut format = log.format.clone().or_else(|| self.format.clone()).expect("checked when the study was read");
        if log.rows.is_some() || log.fraction.is_some() || log.time_range_s.is_some() {
            (format.rows, format.fraction, format.time_range_s) = (log.rows, log.fraction, log.time_range_s);
        }
        format.drop_rows.extend_from_slice(&log.drop_rows);
        format.drop_time_s.extend_from_slice(&log.drop_time_s);
        format
    }

    /// What log number `index` is called: its name, or its file's, with its range so that two parts of one file can be
    /// distinguished.
    ///
    /// # Panics
    /// If there is no such log.
    pub fn log_name(&self, index: usize) -> String {
        let log = &self.log[index];
        if let Some(name) = &log.name {
            return name.clone();
        }
        let file =
            log.file.file_stem().map_or_else(|| log.file.display().to_string(), |s| s.to_string_lossy().into_owned());
        if let Some([from, to]) = log.fraction {
            format!("{file} [{:.0} % .. {:.0} %]", 100.0 * from, 100.0 * to)
        } else if let Some([from, to]) = log.rows {
            format!("{file} [rows {from} .. {to}]")
        } else if let Some([from, to]) = log.time_range_s {
            format!("{file} [{from} s .. {to} s]")
        } else {
            file
        }
    }
}
