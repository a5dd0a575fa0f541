use crate::estimation::forecast::MotionForecast;
use crate::estimation::run_motion::RunMotion;
use crate::evidence::held_out_motion::HeldOutRun;
use crate::planning::planner::PlannedMotion;
use crate::policy::record::RunRecord;
use crate::robot::{RobotRun, read_log_table};
use crate::setup::error::IterationError;
use crate::storage::fingerprint::other_settings;
use crate::storage::runs_folder::{
    HELD_OUT, HELD_OUT_FILE, INTERRUPTED, INTERRUPTED_FILE, PLAN_FILE, PLANNED, RUN_FILE, RunsFolder, UNFINISHED, WAYS,
    remove,
};
use crate::storage::sealed::{sealed_json, unsealed};
use dynident_simulation::Record;
use dynident_system::TemporaryFolder;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

const INTERRUPTED_SCHEMA: &str = "dynident/interrupted/1";

const MAX_FILE_BYTES: u64 = 1 << 30;

/// Schema of `runs/run_k/run.json`.
pub const RUN_SCHEMA: &str = "dynident/run/1";

const PLAN_SCHEMA: &str = "dynident/planned-motion/1";

const HELD_OUT_SCHEMA: &str = "dynident/held-out-run/1";

#[derive(Serialize, Deserialize)]
struct HeldOutFile {
    schema: String,
    fingerprint: String,
    run: usize,
    #[serde(flatten)]
    found: HeldOutRun,
}

#[derive(Serialize, Deserialize)]
struct PlanFile {
    schema: String,
    fingerprint: String,
    run: usize,
    motion: Option<RunMotion>,
    forecast: MotionForecast,
}

/// Folder of an iteration: `runs/run_k/run.json` and the logs next to it. A run appears at once, by renaming a
/// finished folder after all files are synced to disk. An iteration that is killed at any moment can therefore resume
/// after its last complete run.
#[derive(Debug)]
pub struct IterationStore {
    runs: PathBuf,
    fingerprint: String,
}

/// Content of `runs/run_k/run.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RunFile {
    /// Name and version of the schema, [`RUN_SCHEMA`].
    pub schema: String,
    /// Fingerprint of all inputs of the runs.
    pub fingerprint: String,
    /// SHA-256 of the rest of the file; a file that was edited or damaged is rejected. Missing in files of earlier
    /// versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub content_sha256: Option<String>,
    /// The run.
    #[serde(flatten)]
    pub record: RunRecord,
}

impl IterationStore {
    /// Opens or creates the folder. `fingerprint` identifies all inputs of the runs; runs with another fingerprint
    /// belong to another iteration. Without `resume`, existing runs are removed. Only files that an iteration writes
    /// are removed, and never through a symbolic link.
    ///
    /// # Errors
    /// A folder that cannot be written, runs of another iteration, or foreign files in a run's folder.
    pub fn open(folder: &Path, fingerprint: &str, resume: bool) -> Result<Self, IterationError> {
        let runs = folder.join("runs");
        fs::create_dir_all(&runs).map_err(IterationError::file(&runs))?;
        let found = RunsFolder::read(&runs)?;
        if !resume {
            found.remove_runs()?;
        }
        found.remove_unfinished()?;
        let store = Self { runs, fingerprint: fingerprint.to_owned() };
        let made = store.records()?.len();
        RunsFolder::read(&store.runs)?.remove_plans_but(made + 1)?;
        Ok(store)
    }

    /// Checks whether a fresh start may remove the existing runs. Changes nothing.
    ///
    /// # Errors
    /// Same as for [`open`](Self::open) without `resume`.
    pub fn may_begin_afresh(folder: &Path) -> Result<(), IterationError> {
        let runs = folder.join("runs");
        if runs.is_dir() { RunsFolder::read(&runs)?.may_remove_runs() } else { Ok(()) }
    }

    /// Returns the stored runs in order.
    ///
    /// # Errors
    /// A file that cannot be read or does not belong to this iteration.
    pub fn records(&self) -> Result<Vec<RunRecord>, IterationError> {
        let mut records = Vec::new();
        loop {
            let path = self.run_folder(records.len() + 1).join(RUN_FILE);
            let Some(file) = read_sealed::<RunFile>(&path, "a run")? else { return Ok(records) };
            let state = |problem: String| IterationError::State { path: path.clone(), problem };
            if file.schema != RUN_SCHEMA {
                return Err(state(format!("has the schema {}, not {RUN_SCHEMA}", file.schema)));
            }
            if file.fingerprint != self.fingerprint {
                return Err(state(other_settings(&file.fingerprint, &self.fingerprint)));
            }
            if file.record.run != records.len() + 1 {
                return Err(state(format!("contains run {}", file.record.run)));
            }
            let mut record = file.record;
            if let Some(motion) = record.motion.take() {
                let folder = self.run_folder(record.run);
                record.motion = Some(motion.with_tables(&folder, record.max_tracking_error_rad.len())?);
            }
            record.held_out = self.held_out(record.run)?;
            records.push(record);
        }
    }

    /// Stores the run of the held-out motion after a run in `held_out_k/`: `held_out.json` and the log.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn keep_held_out(&self, run: usize, found: &HeldOutRun, robot_run: &RobotRun) -> Result<(), IterationError> {
        let folder = self.held_out_folder(run);
        let fingerprint = self.fingerprint.clone();
        let file = HeldOutFile { schema: HELD_OUT_SCHEMA.to_owned(), fingerprint, run, found: found.clone() };
        let text = sealed_json(&file)
            .map_err(|error| IterationError::State { path: folder.join(HELD_OUT_FILE), problem: error.to_string() })?;
        self.keep_whole(&folder, (HELD_OUT_FILE, &text), core::slice::from_ref(robot_run), None)
    }

    fn held_out(&self, run: usize) -> Result<Option<HeldOutRun>, IterationError> {
        let path = self.held_out_folder(run).join(HELD_OUT_FILE);
        let Some(file) = read_sealed::<HeldOutFile>(&path, "a held-out run")? else { return Ok(None) };
        if file.schema != HELD_OUT_SCHEMA || file.fingerprint != self.fingerprint || file.run != run {
            return Err(IterationError::State { path, problem: OF_ANOTHER.to_owned() });
        }
        Ok(Some(file.found))
    }

    /// Returns the log of the held-out run after a run.
    pub(crate) fn held_out_log(&self, run: usize, joints: &[String], rate_hz: f64) -> Result<Record, IterationError> {
        let path = self.held_out_log_path(run);
        read_log_table(&path, joints, rate_hz).map_err(|error| IterationError::State {
            problem: format!("{error}: put the log back, or remove its folder"),
            path: path.clone(),
        })
    }

    /// Path of the log of the held-out run after a run.
    pub fn held_out_log_path(&self, run: usize) -> PathBuf {
        self.held_out_folder(run).join(log_name(0))
    }

    fn held_out_folder(&self, run: usize) -> PathBuf {
        self.runs.join(format!("{HELD_OUT}{run}"))
    }

    /// Stores a run: `run.json`, `log.csv` of each trajectory (`log_2.csv` and so on for further trajectories),
    /// `approach_log.csv` and `return_log.csv` if the run had approach and return paths, and `motion.csv` of each
    /// motion that differs from the task. Removes the plan of the run.
    ///
    /// # Errors
    /// A folder that cannot be written; the run is then not stored.
    pub fn keep(&self, record: &RunRecord, runs: &[RobotRun]) -> Result<(), IterationError> {
        let file = RunFile {
            schema: RUN_SCHEMA.to_owned(),
            fingerprint: self.fingerprint.clone(),
            content_sha256: None,
            record: record.clone(),
        };
        let folder = self.run_folder(record.run);
        let text = sealed_json(&file)
            .map_err(|error| IterationError::State { path: folder.join(RUN_FILE), problem: error.to_string() })?;
        self.keep_whole(&folder, (RUN_FILE, &text), runs, record.motion.as_ref())?;
        let plan = self.plan_folder(record.run);
        if plan.is_dir() { remove(&plan) } else { Ok(()) }
    }

    /// Stores the planned motion of a run in `planned_k/` (`plan.json` and `motion.csv`), so that a resumed iteration
    /// runs the same motion.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn keep_planned(&self, run: usize, planned: &PlannedMotion) -> Result<(), IterationError> {
        let PlannedMotion { motion, forecast } = planned.clone();
        let folder = self.plan_folder(run);
        let file =
            PlanFile { schema: PLAN_SCHEMA.to_owned(), fingerprint: self.fingerprint.clone(), run, motion, forecast };
        let text = sealed_json(&file)
            .map_err(|error| IterationError::State { path: folder.join(PLAN_FILE), problem: error.to_string() })?;
        self.keep_whole(&folder, (PLAN_FILE, &text), &[], planned.motion.as_ref())
    }

    /// Returns the motion that was planned earlier for this run, if any.
    ///
    /// # Errors
    /// A folder that cannot be read or has other content.
    pub fn planned(&self, run: usize, joints: usize) -> Result<Option<PlannedMotion>, IterationError> {
        let folder = self.plan_folder(run);
        let path = folder.join(PLAN_FILE);
        let Some(file) = read_sealed::<PlanFile>(&path, "a planned motion")? else { return Ok(None) };
        if file.schema != PLAN_SCHEMA || file.fingerprint != self.fingerprint || file.run != run {
            return Err(IterationError::State { path, problem: OF_ANOTHER.to_owned() });
        }
        let motion = file.motion.map(|motion| motion.with_tables(&folder, joints)).transpose()?;
        Ok(Some(PlannedMotion { motion, forecast: file.forecast }))
    }

    /// Stores the logs of a run that was stopped early and `interrupted.json` in `interrupted_k/`. Returns the folder,
    /// or `None` if nothing was recorded.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn keep_interrupted(
        &self,
        run: usize,
        runs: &[RobotRun],
        how: &str,
    ) -> Result<Option<PathBuf>, IterationError> {
        let is_empty = |run: &RobotRun| {
            let ways = run.ways.as_ref().map_or(0, |ways| ways.approach.samples + ways.back.samples);
            run.record.samples + ways == 0
        };
        if runs.iter().all(is_empty) {
            return Ok(None);
        }
        let name = |again: usize| match again {
            1 => format!("{INTERRUPTED}{run}"),
            more => format!("{INTERRUPTED}{run}_{more}"),
        };
        let mut again = 1;
        while self.runs.join(name(again)).exists() {
            again += 1;
        }
        let folder = self.runs.join(name(again));
        let value = serde_json::json!({ "schema": INTERRUPTED_SCHEMA, "run": run, "outcome": how });
        let text = dynident_text::json::to_string(&value).map_err(|error| IterationError::State {
            path: folder.join(INTERRUPTED_FILE),
            problem: error.to_string(),
        })?;
        self.keep_whole(&folder, (INTERRUPTED_FILE, &text), runs, None)?;
        Ok(Some(folder))
    }

    fn keep_whole(
        &self,
        folder: &Path,
        file: (&str, &str),
        runs: &[RobotRun],
        motion: Option<&RunMotion>,
    ) -> Result<(), IterationError> {
        let fresh = TemporaryFolder::create_in(&self.runs, UNFINISHED).map_err(IterationError::file(&self.runs))?;
        for (leg, run) in runs.iter().enumerate() {
            write_synced(&fresh.path().join(log_name(leg)), run.record.csv().as_bytes())?;
            for (way, record) in run.ways.iter().flat_map(|ways| WAYS.into_iter().zip([&ways.approach, &ways.back])) {
                write_synced(&fresh.path().join(format!("{way}_{}", log_name(leg))), record.csv().as_bytes())?;
            }
        }
        for (name, table) in motion.into_iter().flat_map(RunMotion::tables) {
            write_synced(&fresh.path().join(name), table.as_bytes())?;
        }
        write_synced(&fresh.path().join(file.0), file.1.as_bytes())?;
        sync_folder(fresh.path())?;
        open_to_others(fresh.path())?;
        fs::rename(fresh.path(), folder).map_err(IterationError::file(folder))?;
        // The folder was renamed, so there is nothing to remove.
        let _ = fresh.keep();
        sync_folder(&self.runs)
    }

    /// Removes the newest run, whose log was corrected, and everything that followed from it.
    pub(crate) fn forget_run(&self, run: usize) -> Result<(), IterationError> {
        RunsFolder::read(&self.runs)?.remove_run(&self.run_folder(run))?;
        self.forget_held_out(run)
    }

    /// Removes the held-out run after the newest run and the plans that followed from it.
    pub(crate) fn forget_held_out(&self, run: usize) -> Result<(), IterationError> {
        RunsFolder::read(&self.runs)?.remove_plans_but(run)
    }

    /// Returns the logs of a run, one per trajectory, at these sampling rates (Hz), bit-identical to the recording.
    ///
    /// # Errors
    /// A log that is missing or invalid.
    pub fn logs(&self, run: usize, joints: &[String], rates_hz: &[f64]) -> Result<Vec<Record>, IterationError> {
        let of_leg = |(leg, rate_hz): (usize, &f64)| {
            let path = self.log_path(run, leg);
            read_log_table(&path, joints, *rate_hz).map_err(|error| IterationError::State {
                problem: format!(
                    "{error}: runs are fitted together, so put the log back, or remove this run's folder and those after it"
                ),
                path: path.clone(),
            })
        };
        rates_hz.iter().enumerate().map(of_leg).collect()
    }

    pub(crate) fn refused(&self, run: usize, problem: String) -> IterationError {
        IterationError::State { path: self.run_folder(run).join(RUN_FILE), problem }
    }

    /// Path of the log of a trajectory (0-based) of a run.
    pub fn log_path(&self, run: usize, leg: usize) -> PathBuf {
        self.run_folder(run).join(log_name(leg))
    }

    fn plan_folder(&self, run: usize) -> PathBuf {
        self.runs.join(format!("{PLANNED}{run}"))
    }

    /// The folder of a run.
    pub fn run_folder(&self, run: usize) -> PathBuf {
        self.runs.join(format!("run_{run}"))
    }
}

const OF_ANOTHER: &str = "belongs to another iteration, version or run: remove its folder";

/// Reads a sealed file of an iteration; `None` if it does not exist.
fn read_sealed<T: DeserializeOwned>(path: &Path, kind: &str) -> Result<Option<T>, IterationError> {
    let text = match dynident_files::read_text(path, MAX_FILE_BYTES) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(IterationError::file(path)(error)),
    };
    let problem = |error: String| format!("is not {kind} of an iteration ({error}); remove its folder");
    let state = |error| IterationError::State { path: path.to_owned(), problem: problem(error) };
    unsealed(&text).map(Some).map_err(state)
}

fn log_name(leg: usize) -> String {
    if leg == 0 { "log.csv".to_owned() } else { format!("log_{}.csv", leg + 1) }
}

fn write_synced(path: &Path, contents: &[u8]) -> Result<(), IterationError> {
    let mut file = File::create(path).map_err(IterationError::file(path))?;
    file.write_all(contents).map_err(IterationError::file(path))?;
    file.sync_all().map_err(IterationError::file(path))
}

fn sync_folder(path: &Path) -> Result<(), IterationError> {
    if cfg!(unix) {
        let folder = File::open(path).map_err(IterationError::file(path))?;
        folder.sync_all().map_err(IterationError::file(path))?;
    }
    Ok(())
}

fn open_to_others(path: &Path) -> Result<(), IterationError> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        fs::set_permissions(path, fs::Permissions::from_mode(0o755)).map_err(IterationError::file(path))?;
    }
    #[cfg(not(unix))]
    let _ = path;
    Ok(())
}
