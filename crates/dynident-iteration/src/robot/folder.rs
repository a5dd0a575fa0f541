//! A robot that a person operates with files: the trajectory as output, the log as input.

use super::envelope::EnvelopeWatch;
use super::folder_forms::{FolderForm, FormSettings, write_forms};
use super::handover::model_torques;
use super::log_mistakes::{ExaminedLog, LogMistakeSettings, examine_log};
use super::log_table::{LogTableError, read_log_with_currents};
use super::stop_reason::Stopping;
use super::ways::{RunPart, WayRecords};
use super::{Breach, Robot, RobotFault, RobotRun, RobotStatus, RunRequest, handover};
use dynident_excitation::export::UrScriptSettings;
use dynident_simulation::controllers::ControllerModel;
use dynident_simulation::{PerJoint, Record, Reference, SimulationError, require};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const MAX_STOPPED_BYTES: u64 = 1 << 20;

/// Settings of a folder robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FolderSettings {
    /// The folder of the experiment; every run has a folder `run_k` in it.
    pub folder: PathBuf,
    /// Time to wait for a log, s. Default 0: the folder is checked once.
    #[serde(default)]
    pub wait_s: f64,
    /// Additional formats of each motion: `"ros2"`, `"urscript"`, `"waypoints"`, `"torque"`, `"current"`. Default none;
    /// `trajectory.csv` and `controller.json` are always written.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub forms: Vec<FolderForm>,
    /// Rate of the URScript program, Hz: 125 for CB-series robots, 500 for e-Series robots. Default 125.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub urscript_rate_hz: Option<f64>,
    /// Joint torque per ampere, Nm/A (N/A), including the gear: one number, or one per joint. It converts torques to
    /// `current.csv`, and allows logs with currents `i1..` in A instead of `tau1..`. Default none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torque_constants: Option<PerJoint>,
}

impl FolderSettings {
    /// Creates settings for a folder, with default values.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into(), wait_s: 0.0, forms: Vec::new(), urscript_rate_hz: None, torque_constants: None }
    }

    fn form_settings(&self, joints: usize) -> Result<FormSettings, SimulationError> {
        let constants = self.torque_constants.as_ref().map(|constants| {
            let holds = |value: f64| value.is_finite() && value != 0.0;
            constants.values("torque_constants", joints, "set the joint torque per ampere, Nm/A (N/A)", holds)
        });
        let torque_constants = constants.transpose()?;
        let lacks = self.forms.contains(&FolderForm::Current) && torque_constants.is_none();
        require(
            !lacks,
            "torque_constants",
            f64::NAN,
            "forms = [\"current\"] needs the joint torque per ampere, Nm/A (N/A)",
        )?;
        let urscript = self.forms.contains(&FolderForm::Urscript);
        let fix = "URScript supports only the six joints of a UR arm: remove \"urscript\" from forms, or lock the other joints";
        require(!urscript || joints == 6, "joints of a robot with forms = [\"urscript\"]", joints as f64, fix)?;
        let urscript_rate_hz = self.urscript_rate_hz.unwrap_or(UrScriptSettings::default().rate_hz);
        let fix = "give 1 to 500 Hz (125 for CB-series, 500 for e-series)";
        require((1.0..=500.0).contains(&urscript_rate_hz), "urscript_rate_hz", urscript_rate_hz, fix)?;
        Ok(FormSettings { forms: self.forms.clone(), urscript_rate_hz, torque_constants })
    }
}

/// A robot that a person operates through a folder. The person finds `run_k/trajectory.csv` and
/// `run_k/controller.json` there, runs the trajectory, and writes `run_k/log.csv` (`t_s, q1.., tau1..`). If the robot
/// was stopped early, the person writes the reason to `run_k/stopped.txt`, and the log may be shorter.
///
/// A log is read when it is complete: its last line ends with a newline, and it reaches the end of the trajectory.
/// Files that have not changed are not written again. If the files of a run change although a log exists, the log
/// belongs to another run and is rejected. The paths from and to the home posture are in `approach.csv` and
/// `return.csv`; their logs `approach_log.csv` and `return_log.csv` are checked if they exist.
///
/// Each log is first compared with the motion ([`examine_log`]). Wrong units, signs, columns or time stamps are
/// reported, and the run waits for the corrected file. If a log is corrected later, the next call reads it again.
#[derive(Debug)]
pub struct FolderRobot {
    settings: FolderSettings,
    forms: FormSettings,
    /// Model for the torque check until a run provides one.
    prior: Option<ControllerModel>,
    joints: Vec<String>,
}

impl FolderRobot {
    /// Creates the robot of a folder, with the model's joints.
    ///
    /// # Errors
    /// A waiting time that is negative or not finite, formats that lack a setting or do not fit the robot.
    pub fn new(settings: FolderSettings, joints: Vec<String>) -> Result<Self, SimulationError> {
        let wait = settings.wait_s;
        require((0.0..=1e7).contains(&wait), "wait_s", wait, "give 0 to 1e7 s")?;
        let forms = settings.form_settings(joints.len())?;
        Ok(Self { settings, forms, prior: None, joints })
    }

    /// Sets the model that predicts torques to check the unit of recorded torques, for a controller without a model.
    #[must_use]
    pub fn with_prior(mut self, prior: Option<ControllerModel>) -> Self {
        self.prior = prior;
        self
    }

    fn read(&self, path: &Path, rate_hz: f64) -> Result<Record, LogTableError> {
        read_log_with_currents(path, &self.joints, rate_hz, self.forms.torque_constants.as_deref())
    }

    fn examined(&self, record: Record, reference: &Reference, model: Option<&ControllerModel>) -> ExaminedLog {
        let torque = model.or(self.prior.as_ref()).map(|model| {
            let rows: Vec<Vec<f64>> = model_torques(reference, model).collect();
            (0..self.joints.len()).flat_map(|joint| rows.iter().map(move |row| row[joint])).collect::<Vec<_>>()
        });
        examine_log(record, reference, torque.as_deref(), &LogMistakeSettings::default())
    }

    /// The folder of a run.
    pub fn run_folder(&self, run: usize) -> PathBuf {
        self.settings.folder.join(format!("run_{run}"))
    }

    fn exchange(&self, request: &RunRequest<'_>, folder: &Path) -> Result<RobotRun, RobotFault> {
        let fault = |error: std::io::Error| RobotFault::File { path: folder.to_owned(), reason: error.to_string() };
        std::fs::create_dir_all(folder).map_err(fault)?;
        let log = folder.join("log.csv");
        if log.exists()
            && let Some(path) = handover::other(request, &self.joints, folder)?
        {
            let reason = format!(
                "this file and {} belong to another run: move both to another folder",
                log.file_name().unwrap_or_default().to_string_lossy()
            );
            return Err(RobotFault::File { path, reason });
        }
        handover::write(request, &self.joints, folder)?;
        handover::write_ways(request, folder)?;
        write_forms(request, &self.joints, &self.forms, folder)?;
        let ends = Instant::now() + Duration::from_secs_f64(self.settings.wait_s);
        loop {
            let run = self.check(request, folder)?;
            let waiting = matches!(run.status, RobotStatus::Waiting { .. });
            if !waiting || Instant::now() >= ends || request.stop_requested() {
                return Ok(run);
            }
            std::thread::sleep(Duration::from_millis(200).min(ends.saturating_duration_since(Instant::now())));
        }
    }

    fn check(&self, request: &RunRequest<'_>, folder: &Path) -> Result<RobotRun, RobotFault> {
        let log = folder.join("log.csv");
        let waiting = |reason: String| {
            let status = RobotStatus::Waiting { folder: folder.to_owned(), reason };
            RobotRun::without_samples(status, &self.joints, request.reference.rate_hz())
        };
        if !log.exists() {
            let what = match request.ways {
                None => "run trajectory.csv on the robot and save the log here as log.csv",
                Some(_) => {
                    "run approach.csv, trajectory.csv and return.csv one after another on the robot, and save the log of trajectory.csv here as log.csv"
                }
            };
            return Ok(waiting(what.to_owned()));
        }
        let record = match self.read(&log, request.reference.rate_hz()) {
            Ok(record) => record,
            Err(error @ LogTableError::Incomplete { .. }) => return Ok(waiting(format!("log.csv: {error}"))),
            Err(error) => return Err(RobotFault::File { path: log, reason: error.to_string() }),
        };
        let ways = self.way_records(request, folder)?;
        let stopped = dynident_files::read_text(&folder.join("stopped.txt"), MAX_STOPPED_BYTES).ok();
        // The log of a stopped run contains only a part of the motion, so it is not compared with the motion.
        let ExaminedLog { record, note, mistakes } = match &stopped {
            Some(_) => ExaminedLog { record, note: None, mistakes: Vec::new() },
            None => self.examined(record, request.reference, request.model),
        };
        if !mistakes.is_empty() {
            let each = mistakes.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
            return Ok(waiting(format!(
                "log.csv: {each}. Correct the file and repeat the command; the robot need not move again"
            )));
        }
        let (first, last) = (record.times_s[0], record.times_s[record.samples - 1]);
        let duration_s = request.reference.duration_s();
        let status = match stopped {
            Some(reason) => RobotStatus::Stopped { reason: reason.trim().chars().take(1000).collect() },
            None if last - first < 0.99 * duration_s - 2.0 / request.reference.rate_hz() => {
                let reason = format!(
                    "log.csv covers {:.3} s of {duration_s:.3} s; if the robot was stopped, write the reason to stopped.txt",
                    last - first
                );
                return Ok(waiting(reason));
            }
            None => {
                let breach = EnvelopeWatch::first(request.envelope, request.reference, &record);
                match breach.or_else(|| breach_of_ways(request, ways.as_ref())) {
                    Some(breach) => RobotStatus::LeftEnvelope { breach, stopping: Stopping::SeenAfterwards },
                    None => RobotStatus::Done,
                }
            }
        };
        Ok(RobotRun { status, record, truth: None, ways, note })
    }

    fn way_records(&self, request: &RunRequest<'_>, folder: &Path) -> Result<Option<WayRecords>, RobotFault> {
        let paths = ["approach_log.csv", "return_log.csv"].map(|name| folder.join(name));
        if request.ways.is_none() || !paths.iter().all(|path| path.exists()) {
            return Ok(None);
        }
        let read = |path: &PathBuf| {
            let read = self.read(path, request.reference.rate_hz());
            read.map_err(|error| RobotFault::File { path: path.clone(), reason: error.to_string() })
        };
        Ok(Some(WayRecords { approach: read(&paths[0])?, back: read(&paths[1])? }))
    }
}

fn breach_of_ways(request: &RunRequest<'_>, records: Option<&WayRecords>) -> Option<Breach> {
    let (ways, records) = (request.ways?, records?);
    let parts = [(RunPart::Approach, &ways.approach, &records.approach), (RunPart::Return, &ways.back, &records.back)];
    parts.into_iter().find_map(|(part, way, record)| {
        let breach = EnvelopeWatch::first(request.envelope, way, record)?;
        Some(Breach { part, ..breach })
    })
}

impl Robot for FolderRobot {
    fn has_corrected_log(&self, folder_name: &str, reference: &Reference, kept: &Record) -> bool {
        let path = self.settings.folder.join(folder_name).join("log.csv");
        // A missing or incomplete file is not a correction.
        let Ok(record) = self.read(&path, reference.rate_hz()) else { return false };
        let same = |found: &Record| (&found.times_s, &found.q, &found.tau) == (&kept.times_s, &kept.q, &kept.tau);
        // Only the time stamps may have been changed before the record was stored.
        !same(&record) && !same(&self.examined(record, reference, None).record)
    }

    fn run(&mut self, request: &RunRequest<'_>) -> Result<RobotRun, SimulationError> {
        request.validate(self.joints.len())?;
        Ok(self.exchange(request, &self.settings.folder.join(request.folder_name())).unwrap_or_else(|fault| {
            RobotRun::without_samples(
                RobotStatus::Failed { fault, stopping: None },
                &self.joints,
                request.reference.rate_hz(),
            )
        }))
    }
}
