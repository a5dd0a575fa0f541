//! A robot that a person runs: files out, a log in.

use super::envelope::EnvelopeWatch;
use super::log_table::{LogTableError, read_log_table};
use super::stop_reason::Stopping;
use super::ways::{RunPart, WayRecords};
use super::{Breach, Robot, RobotFault, RobotRun, RobotStatus, RunRequest, handover};
use dynident_simulation::{SimulationError, require};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Where, and for how long to look.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FolderSettings {
    /// The folder of the experiment; every run has a folder `run_k` in it.
    pub folder: PathBuf,
    /// How long to wait for a log, s. Default 0: look once.
    #[serde(default)]
    pub wait_s: f64,
}

/// A folder in which a person finds `run_k/trajectory.csv` and `run_k/controller.json`, and drops `run_k/log.csv`
/// (`t_s, q1.., tau1..`). Where the robot was stopped early, `run_k/stopped.txt` says why, and the log may be short.
///
/// A log is taken once it is complete: its last line ends, and it reaches the trajectory's end. Files that are there
/// are not written again unless they differ, so that a second pass disturbs nobody; where they differ and a log is
/// there, that log belongs to another run, and is refused. Ways to the motion and back are in `approach.csv` and
/// `return.csv`; logs of them, `approach_log.csv` and `return_log.csv`, are looked at where they are.
#[derive(Debug)]
pub struct FolderRobot {
    settings: FolderSettings,
    joints: Vec<String>,
    name: String,
}

impl FolderRobot {
    /// The robot behind a folder, with the model's joints.
    ///
    /// # Errors
    /// A time to wait that is negative or not finite.
    pub fn new(settings: FolderSettings, joints: Vec<String>) -> Result<Self, SimulationError> {
        let wait = settings.wait_s;
        require((0.0..=1e7).contains(&wait), "wait_s", wait, "give 0 to 1e7 s")?;
        let name = settings.folder.display().to_string();
        Ok(Self { settings, joints, name })
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
                "it is not this run's, so that {} is of another run: move both away",
                log.file_name().unwrap_or_default().to_string_lossy()
            );
            return Err(RobotFault::File { path, reason });
        }
        handover::write(request, &self.joints, folder)?;
        handover::write_ways(request, folder)?;
        let ends = Instant::now() + Duration::from_secs_f64(self.settings.wait_s);
        loop {
            let run = self.look(request, folder)?;
            let waiting = matches!(run.status, RobotStatus::Waiting { .. });
            if !waiting || Instant::now() >= ends || request.stop_requested() {
                return Ok(run);
            }
            std::thread::sleep(Duration::from_millis(200).min(ends.saturating_duration_since(Instant::now())));
        }
    }

    /// Looks once.
    fn look(&self, request: &RunRequest<'_>, folder: &Path) -> Result<RobotRun, RobotFault> {
        let log = folder.join("log.csv");
        let waiting = |reason: String| {
            let status = RobotStatus::Waiting { folder: folder.to_owned(), reason };
            RobotRun::without_samples(status, &self.joints, request.reference.rate_hz())
        };
        if !log.exists() {
            let what = match request.ways {
                None => "run trajectory.csv on the robot and put the log here as log.csv",
                Some(_) => {
                    "run approach.csv, trajectory.csv and return.csv one after another on the robot, and put the log of trajectory.csv here as log.csv"
                }
            };
            return Ok(waiting(what.to_owned()));
        }
        let record = match read_log_table(&log, &self.joints, request.reference.rate_hz()) {
            Ok(record) => record,
            Err(error @ LogTableError::Incomplete { .. }) => return Ok(waiting(format!("log.csv: {error}"))),
            Err(error) => return Err(RobotFault::File { path: log, reason: error.to_string() }),
        };
        let ways = self.way_records(request, folder)?;
        let stopped = std::fs::read_to_string(folder.join("stopped.txt")).ok();
        let (first, last) = (record.times_s[0], record.times_s[record.samples - 1]);
        let duration_s = request.reference.duration_s();
        let status = match stopped {
            Some(reason) => RobotStatus::Stopped { reason: reason.trim().chars().take(1000).collect() },
            None if last - first < 0.99 * duration_s - 2.0 / request.reference.rate_hz() => {
                let reason = format!(
                    "log.csv covers {:.3} s of {duration_s:.3} s; if the robot was stopped, say why in stopped.txt",
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
        Ok(RobotRun { status, record, truth: None, ways })
    }

    /// What somebody logged of the ways, where both logs are there.
    fn way_records(&self, request: &RunRequest<'_>, folder: &Path) -> Result<Option<WayRecords>, RobotFault> {
        let paths = ["approach_log.csv", "return_log.csv"].map(|name| folder.join(name));
        if request.ways.is_none() || !paths.iter().all(|path| path.exists()) {
            return Ok(None);
        }
        let read = |path: &PathBuf| {
            let read = read_log_table(path, &self.joints, request.reference.rate_hz());
            read.map_err(|error| RobotFault::File { path: path.clone(), reason: error.to_string() })
        };
        Ok(Some(WayRecords { approach: read(&paths[0])?, back: read(&paths[1])? }))
    }
}

/// The first breach of the ways.
fn breach_of_ways(request: &RunRequest<'_>, records: Option<&WayRecords>) -> Option<Breach> {
    let (ways, records) = (request.ways?, records?);
    let parts = [(RunPart::Approach, &ways.approach, &records.approach), (RunPart::Return, &ways.back, &records.back)];
    parts.into_iter().find_map(|(part, way, record)| {
        let breach = EnvelopeWatch::first(request.envelope, way, record)?;
        Some(Breach { part, ..breach })
    })
}

impl Robot for FolderRobot {
    fn name(&self) -> &str {
        &self.name
    }

    fn joints(&self) -> &[String] {
        &self.joints
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
