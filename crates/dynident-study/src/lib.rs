//! **The study file**: a robot, its drives, its logs and how to fit them, without code.

#![forbid(unsafe_code)]

mod arrays;
mod code;
mod design;
mod drive;
mod error;
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
mod report_thresholds;
mod robot;
mod robot_file;
mod robot_model;
mod servo;
mod simulated;
mod simulation;
mod study_file;
mod task;
mod thresholds;
mod torque;

pub use code::{Code, FunctionChoice};
pub use design::{
    CriterionChoice, DesignSection, FamilyChoice, GivenStroke, JoinedChoice, OptimiserChoice, PriorSection,
    StartPosture, TorqueNoise, WindowedCondition, WindowedProblem,
};
pub use drive::{CoulombChoice, CouplingSection, DriveSection, JointDrive};
pub use error::{Expected, StudyError, StudyFileError, XacroError};
pub use estimator::{EstimatorMethod, EstimatorSection};
pub use folders::Folders;
pub use friction::{FrictionChoice, FrictionTerm};
pub use inputs::StudyInput;
pub use iteration::{
    Automatic, DifferentiatorKey, HeldOutSection, IterationSection, LegOrder, LegSection, MotionChoice, PriorChoice,
    RobotChoice,
};
pub use log::LogSection;
pub use log_source::StudyLogSource;
pub use payload::{ArmSection, PayloadSection};
pub use physical::PhysicalChoice;
pub use report_thresholds::{DifferenceSettings, ProblemSettings, TorqueErrorSettings};
pub use robot::{FollowSection, LoopSection, RobotSection};
pub use robot_file::{LoadSettings, XacroSettings, load_robot};
pub use robot_model::StudyRobot;
pub use servo::{FloorPointSection, FloorSection, PerJoint, ServoSection, moving_link};
pub use simulated::SimulatedSection;
pub use simulation::{SimulatedTruth, SimulationSection};
pub use study_file::{StudyFile, relative_path};
pub use thresholds::{ReportThresholds, ThresholdSection};
pub use torque::TorqueSection;

use dynident_identification::Role;
use dynident_identification::rows::ParallelFilterSettings;
use dynident_model::line_and_column;
use dynident_recording::{DifferentiatorSettings, LogFormat, MotionSettings};
use dynident_simulation::ControllerSettings;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A study, as written in TOML. Unknown keys are errors, so that a typing error cannot silently change a fit.
///
/// ```
/// let study = dynident_study::Study::parse(
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
    /// Name in reports; the file name by default.
    #[serde(default)]
    pub name: Option<String>,
    /// Source of the recordings (for example a URL).
    #[serde(default)]
    pub source: Option<String>,
    /// Folder of the recordings, relative to the study file; a folder on the command line has priority.
    #[serde(default)]
    pub data: Option<PathBuf>,
    /// The robot.
    pub robot: RobotSection,
    /// Friction, offsets and drive inertia.
    #[serde(default)]
    pub drive: DriveSection,
    /// Drives coupled to two joints.
    #[serde(default)]
    pub coupling: Vec<CouplingSection>,
    /// Torques that are functions of positions and velocities: springs, counterbalances, cables.
    #[serde(default)]
    pub torque: Vec<TorqueSection>,
    /// Payloads that the robot carries in logs.
    #[serde(default)]
    pub payload: Vec<PayloadSection>,
    /// An arm that was identified earlier.
    #[serde(default)]
    pub arm: Option<ArmSection>,
    /// Format of all logs; a log can have its own `format`.
    #[serde(default)]
    pub format: Option<LogFormat>,
    /// Method for velocities and accelerations.
    #[serde(default)]
    pub motion: MotionSettings,
    /// Low-pass filter and decimation that are applied to torque and regressor.
    #[serde(default)]
    pub parallel_filter: ParallelFilterSettings,
    /// Estimation method and error bars.
    #[serde(default)]
    pub estimator: EstimatorSection,
    /// Thresholds of decisions, findings and statements.
    #[serde(default, skip_serializing_if = "ThresholdSection::is_default")]
    pub thresholds: Box<ThresholdSection>,
    /// Excitation trajectory of `design`.
    #[serde(default)]
    pub design: Option<DesignSection>,
    /// The controller of `simulate`, and of `iterate` with an identified model.
    #[serde(default)]
    pub controller: Option<ControllerSettings>,
    /// The robot that `simulate` and `iterate` simulate.
    #[serde(default)]
    pub simulation: Option<SimulationSection>,
    /// Settings of `iterate`.
    #[serde(default)]
    pub iteration: Option<IterationSection>,
    /// The logs; only `design` works without logs.
    #[serde(default)]
    pub log: Vec<LogSection>,
}

/// Checks that no earlier entry of a list has this name.
fn check_unique<'a>(
    list: &str,
    name: &str,
    mut earlier: impl Iterator<Item = &'a str>,
    fix: &'static str,
) -> Result<(), StudyError> {
    if earlier.any(|other| other == name) {
        return Err(StudyError::Twice { what: list.to_owned(), name: name.to_owned(), fix });
    }
    Ok(())
}

/// TOML has no null, so keys with this value are removed.
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

/// Kind of a file that is obviously not a study, and the command to which it belongs.
fn other_kind(text: &str, path: &Path) -> Option<(&'static str, String)> {
    let file = path.display();
    let first = text.trim_start();
    let is_table = || {
        let line = first.lines().find(|line| !line.starts_with('#')).unwrap_or_default();
        [',', ';', '\t'].iter().any(|delimiter| line.matches(*delimiter).count() >= 2)
            && !line.contains(['=', '[', '"'])
    };
    if first.starts_with('<') {
        let fix = format!("write a study for it: dynident new --robot {file} --log LOG");
        Some(("this is a robot description, not a study", fix))
    } else if first.starts_with('{') {
        let fix = "give the study file; for the result of an identification, `validate`, `export` and `design` take it as RESULT";
        Some(("this is a JSON file, not a study", fix.to_owned()))
    } else if is_table() {
        let fix = format!("write a study for it: dynident new --robot ROBOT --log {file}");
        Some(("this is a table, not a study", fix))
    } else {
        None
    }
}

/// Largest accepted study file, bytes.
const MAX_STUDY_BYTES: u64 = 4 << 20;

impl Study {
    /// Reads a study from a file.
    ///
    /// # Errors
    /// If the file cannot be read, or as [`parse`](Study::parse).
    pub fn load(path: &Path) -> Result<Self, StudyFileError> {
        let cannot = |source| StudyFileError::File { path: path.to_owned(), source };
        let bytes = dynident_files::read(path, MAX_STUDY_BYTES).map_err(|source| match source.kind() {
            std::io::ErrorKind::FileTooLarge => {
                StudyFileError::study(path)(StudyError::TooLarge { most_bytes: MAX_STUDY_BYTES })
            }
            _ => cannot(source),
        })?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let good = error.utf8_error().valid_up_to();
            let before = String::from_utf8_lossy(&error.as_bytes()[..good]).into_owned();
            let (line, column) = line_and_column(&before, before.len());
            StudyFileError::StudyAt { path: path.to_owned(), line, column, source: Box::new(StudyError::NotUtf8) }
        })?;
        Self::parse(&text, path)
    }

    /// Reads a study from its text; `path` is used in messages only.
    ///
    /// # Errors
    /// If the text is not valid TOML, a key is unknown or has the wrong type, or sections conflict; the message
    /// contains file, line and column.
    pub fn parse(text: &str, path: &Path) -> Result<Self, StudyFileError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        if text.trim().is_empty() {
            let fix = "a study needs at least [robot] and, to identify, one [[log]]";
            return Err(StudyFileError::study(path)(StudyError::missing("the file is empty", fix)));
        }
        if let Some((what, fix)) = other_kind(text, path) {
            return Err(StudyFileError::study(path)(StudyError::conflict(what, fix)));
        }
        let study: Self = toml::from_str(text).map_err(|error| {
            let (line, column) = error.span().map_or((1, 1), |span| line_and_column(text, span.start));
            let problem = error.message().trim().replace('\n', " ");
            StudyFileError::StudyAt {
                path: path.to_owned(),
                line,
                column,
                source: Box::new(StudyError::Toml { problem }),
            }
        })?;
        study.check().map_err(StudyFileError::study(path))?;
        Ok(study)
    }

    /// Builds a study from JSON with the keys of the TOML; null means a missing key. `path` appears in messages, and
    /// files are searched relative to it.
    ///
    /// # Errors
    /// Same as for [`parse`](Study::parse), without line and column.
    pub fn from_json(text: &str, path: &Path) -> Result<Self, StudyFileError> {
        let wrong =
            |error: serde_json::Error| StudyFileError::study(path)(StudyError::Toml { problem: error.to_string() });
        let mut value = serde_json::from_str(text).map_err(wrong)?;
        drop_nulls(&mut value);
        let study: Self = serde_json::from_value(value).map_err(wrong)?;
        study.check().map_err(StudyFileError::study(path))?;
        Ok(study)
    }

    /// The study as TOML, with every key that has a value. Samples and descriptions in memory are represented by their
    /// names.
    ///
    /// # Errors
    /// [`StudyError::Toml`] for a number that TOML cannot represent.
    pub fn to_toml(&self) -> Result<String, StudyError> {
        toml::to_string(self).map_err(|error| StudyError::Toml { problem: error.to_string() })
    }

    /// The study as JSON, with the keys of the TOML.
    ///
    /// # Errors
    /// Same as for [`serde_json::to_value`].
    pub fn to_json(&self) -> serde_json::Result<serde_json::Value> {
        // Compiled once here; otherwise each generic call elsewhere would compile the writers of all sections again.
        serde_json::to_value(self)
    }

    /// Checks that there is a log; a study for `design`, for example, needs none.
    ///
    /// # Errors
    /// [`StudyError::Missing`] without a log.
    pub fn require_log(&self, path: &Path) -> Result<(), StudyFileError> {
        if self.log.is_empty() {
            let fix = "name at least one log with `file = \"...\"`";
            return Err(StudyFileError::study(path)(StudyError::missing("no [[log]]", fix)));
        }
        Ok(())
    }

    /// Checks that there is a log for the fit.
    ///
    /// # Errors
    /// [`StudyError::Missing`] without one.
    pub fn require_training_log(&self, path: &Path) -> Result<(), StudyFileError> {
        self.require_log(path)?;
        if !self.log.iter().any(|log| log.role == Role::Identify) {
            let what = "no log has the role \"identify\"";
            return Err(StudyFileError::study(path)(StudyError::missing(
                what,
                "there are no data for the fit; remove role = \"validate\" from one [[log]]",
            )));
        }
        Ok(())
    }

    /// Indices of the logs with this role.
    pub fn logs_of_role(&self, role: Role) -> Vec<usize> {
        (0..self.log.len()).filter(|&index| self.log[index].role == role).collect()
    }

    /// Parts that are code of the calling program, each with its function name; a study file cannot contain them.
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
            let format = self.format_of(index);
            if format.torque.is_none() && format.command.is_none() {
                let fix = "add torque = { columns = [...] } to [format], or command = { columns = [...] } for a robot that reports no torque";
                return Err(at()(StudyError::missing("neither torque nor command", fix)));
            }
        }
        self.check_servo_gains()?;
        self.drive.validate()?;
        self.check_temperature()?;
        for (index, coupling) in self.coupling.iter().enumerate() {
            let earlier = self.coupling[..index].iter().map(|other| &other.name[..]);
            check_unique("coupling", &coupling.name, earlier, "give each drive a unique name")?;
            coupling.validate().map_err(StudyError::at(format!("coupling `{}`", coupling.name)))?;
        }
        for (index, torque) in self.torque.iter().enumerate() {
            let earlier = self.torque[..index].iter().map(|other| &other.name[..]);
            check_unique("torque", &torque.name, earlier, "give each a unique name")?;
            torque.validate().map_err(StudyError::at(format!("torque `{}`", torque.name)))?;
        }
        for (index, payload) in self.payload.iter().enumerate() {
            let earlier = self.payload[..index].iter().map(|other| &other.name[..]);
            check_unique("payload", &payload.name, earlier, "give each a unique name")?;
            payload.validate().map_err(StudyError::at(format!("payload `{}`", payload.name)))?;
        }
        self.robot.validate()?;
        self.parallel_filter.validate()?;
        if let Some(design) = &self.design {
            design.validate().map_err(StudyError::at("[design]"))?;
        }
        self.motion.validate().map_err(StudyError::at("[motion]"))?;
        self.thresholds.validate()?;
        self.estimator.validate()
    }

    /// Checks that only logs that are fitted to commands have a servo gain.
    fn check_servo_gains(&self) -> Result<(), StudyError> {
        let Some(log) = self.log.iter().find(|log| log.servo_gain.is_some() && !self.fits_commands()) else {
            return Ok(());
        };
        Err(StudyError::conflict(
            format!("servo_gain of the log {}", log.file.display()),
            "this study is identified from torque, which has no servo gain; remove servo_gain, or describe the servos in \
             [drive.servo] to identify from commands",
        ))
    }

    /// Checks that temperature-dependent friction is not used together with friction selection or with instruments.
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
                "select friction without it first, then state the selected friction together with `temperature`",
            ));
        }
        if self.estimator.method == EstimatorMethod::Instrumental || self.estimator.instruments.is_some() {
            return Err(StudyError::conflict(
                "drive.laws: `temperature` cannot be used with instruments",
                "use another estimator.method and remove estimator.instruments",
            ));
        }
        Ok(())
    }

    /// Whether `identify` fits the motion to commands: the study has `[drive.servo]`, or all logs have commands and
    /// no torque.
    pub fn fits_commands(&self) -> bool {
        let without_torque = |index: usize| {
            let format = self.format_of(index);
            format.command.is_some() && format.torque.is_none()
        };
        !self.log.is_empty() && (self.drive.servo.is_some() || (0..self.log.len()).all(without_torque))
    }

    /// Format of log number `index`, with the log's own range.
    ///
    /// # Panics
    /// If there is no such log; `parse` has checked that every log has a format.
    pub fn format_of(&self, index: usize) -> LogFormat {
        self.log[index].format_or(self.format.as_ref()).expect("checked when the study was read")
    }

    /// Name of log number `index`: the given name, or the name of its file with its range, which distinguishes parts
    /// of one file.
    ///
    /// # Panics
    /// If there is no such log.
    pub fn log_name(&self, index: usize) -> String {
        let log = &self.log[index];
        if let Some(name) = &log.name {
            return name.clone();
        }
        // Digits after a dot belong to the name: a data set in a folder `speed_0.3`.
        let is_extension =
            |extension: &std::ffi::OsStr| extension.to_string_lossy().bytes().any(|byte| !byte.is_ascii_digit());
        let has_extension = log.file.extension().is_some_and(is_extension);
        let name = if has_extension { log.file.file_stem() } else { log.file.file_name() };
        let file = name.map_or_else(|| log.file.display().to_string(), |name| name.to_string_lossy().into_owned());
        let file = log.part.iter().fold(file, |file, part| format!("{file} {part}"));
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
