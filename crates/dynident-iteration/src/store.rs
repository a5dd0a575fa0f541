//! An iteration on disk: every run whole or not at all.

use crate::error::IterationError;
use crate::fingerprint::other_settings;
use crate::forecast::MotionForecast;
use crate::held_out_motion::HeldOutRun;
use crate::planner::PlannedMotion;
use crate::record::RunRecord;
use crate::robot::{RobotRun, read_log_table};
use crate::run_motion::RunMotion;
use crate::runs_folder::{
    HELD_OUT, HELD_OUT_FILE, INTERRUPTED, INTERRUPTED_FILE, PLAN_FILE, PLANNED, RUN_FILE, RunsFolder, UNFINISHED, WAYS,
    remove,
};
use crate::sealed::{sealed_json, unsealed};
use dynident_simulation::Record;
use dynident_system::TemporaryFolder;
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Schema of `runs/interrupted_k/interrupted.json`.
const INTERRUPTED_SCHEMA: &str = "dynident/interrupted/1";

/// Largest file of a run that is read, bytes.
const MOST_BYTES: u64 = 1 << 30;

/// Schema of `runs/run_k/run.json`.
pub const RUN_SCHEMA: &str = "dynident/run/1";

/// Schema of `runs/planned_k/plan.json`.
const PLAN_SCHEMA: &str = "dynident/planned-motion/1";

/// Schema of `runs/held_out_k/held_out.json`.
const HELD_OUT_SCHEMA: &str = "dynident/held-out-run/1";

/// What `runs/held_out_k/held_out.json` holds.
#[derive(Serialize, Deserialize)]
struct HeldOutFile {
    schema: String,
    fingerprint: String,
    run: usize,
    #[serde(flatten)]
    found: HeldOutRun,
}

/// What `runs/planned_k/plan.json` holds: the motion of a run that has not been made yet.
#[derive(Serialize, Deserialize)]
struct PlanFile {
    schema: String,
    fingerprint: String,
    run: usize,
    motion: Option<RunMotion>,
    forecast: MotionForecast,
}

/// The folder of an iteration: `runs/run_k/run.json` and the records beside it. A run appears in one step (rename of a
/// finished folder, everything on the disk before), so that whoever is killed at any moment finds all runs up to one of
/// them, and goes on with the next.
#[derive(Debug)]
pub struct IterationStore {
    runs: PathBuf,
    fingerprint: String,
}

/// What `runs/run_k/run.json` holds.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RunFile {
    /// [`RUN_SCHEMA`].
    pub schema: String,
    /// What the runs depend on, in one number.
    pub fingerprint: String,
    /// SHA-256 of everything else in the file: a file that was edited or damaged is not read. None in files of earlier
    /// versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub content_sha256: Option<String>,
    /// The run.
    #[serde(flatten)]
    pub record: RunRecord,
}

impl IterationStore {
    /// Opens or makes the folder. `fingerprint` stands for everything that the runs depend on; runs with another one
    /// are another iteration's. Without `resume`, runs that are there are removed: the files that an iteration writes,
    /// never others, and never through a symbolic link.
    ///
    /// # Errors
    /// A folder that cannot be written; runs of another iteration; in a run's folder or in its place something that no
    /// iteration wrote.
    pub fn open(folder: &Path, fingerprint: &str, resume: bool) -> Result<Self, IterationError> {
        let runs = folder.join("runs");
        fs::create_dir_all(&runs).map_err(IterationError::file(&runs))?;
        let found = RunsFolder::look(&runs)?;
        if !resume {
            found.remove_runs()?;
        }
        found.remove_unfinished()?;
        let store = Self { runs, fingerprint: fingerprint.to_owned() };
        let made = store.records()?.len();
        // Of another run it is no plan any more: runs before it have been made, or removed.
        RunsFolder::look(&store.runs)?.remove_plans_but(made + 1)?;
        Ok(store)
    }

    /// That a fresh start in the folder may remove the runs that are there. Changes nothing.
    ///
    /// # Errors
    /// As [`open`](Self::open) without `resume`.
    pub fn may_begin_afresh(folder: &Path) -> Result<(), IterationError> {
        let runs = folder.join("runs");
        if runs.is_dir() { RunsFolder::look(&runs)?.may_remove_runs() } else { Ok(()) }
    }

    /// The runs that are there, in order.
    ///
    /// # Errors
    /// A file that cannot be read or is no run of this iteration.
    pub fn records(&self) -> Result<Vec<RunRecord>, IterationError> {
        let mut records = Vec::new();
        loop {
            let path = self.run_folder(records.len() + 1).join(RUN_FILE);
            let text = match dynident_files::read_text(&path, MOST_BYTES) {
                Ok(text) => text,
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(records),
                Err(error) => return Err(IterationError::file(&path)(error)),
            };
            let state = |problem: String| IterationError::State { path: path.clone(), problem };
            let file: RunFile = unsealed(&text)
                .map_err(|error| state(format!("is no run of an iteration ({error}); remove its folder")))?;
            if file.schema != RUN_SCHEMA {
                return Err(state(format!("has the schema {}, not {RUN_SCHEMA}", file.schema)));
            }
            if file.fingerprint != self.fingerprint {
                return Err(state(other_settings(&file.fingerprint, &self.fingerprint)));
            }
            if file.record.run != records.len() + 1 {
                return Err(state(format!("holds run {}", file.record.run)));
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

    /// Keeps the run of the held-out motion after a run: `held_out_k/`, with `held_out.json` and the log.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn keep_held_out(&self, run: usize, found: &HeldOutRun, came: &RobotRun) -> Result<(), IterationError> {
        let folder = self.held_out_folder(run);
        let fingerprint = self.fingerprint.clone();
        let file = HeldOutFile { schema: HELD_OUT_SCHEMA.to_owned(), fingerprint, run, found: found.clone() };
        let text = sealed_json(&file)
            .map_err(|error| IterationError::State { path: folder.join(HELD_OUT_FILE), problem: error.to_string() })?;
        self.keep_whole(&folder, (HELD_OUT_FILE, &text), core::slice::from_ref(came), None)
    }

    /// The held-out run after a run, if it is there.
    fn held_out(&self, run: usize) -> Result<Option<HeldOutRun>, IterationError> {
        let path = self.held_out_folder(run).join(HELD_OUT_FILE);
        let text = match dynident_files::read_text(&path, MOST_BYTES) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(IterationError::file(&path)(error)),
        };
        let wrong = |problem: String| IterationError::State { path: path.clone(), problem };
        let file: HeldOutFile = unsealed(&text)
            .map_err(|error| wrong(format!("is no held-out run of an iteration ({error}); remove its folder")))?;
        if file.schema != HELD_OUT_SCHEMA || file.fingerprint != self.fingerprint || file.run != run {
            return Err(wrong("belongs to another iteration, version or run: remove its folder".to_owned()));
        }
        Ok(Some(file.found))
    }

    /// The log of the held-out run after a run.
    ///
    /// # Errors
    /// A log that is not there any more or holds something else.
    pub(crate) fn held_out_log(&self, run: usize, joints: &[String], rate_hz: f64) -> Result<Record, IterationError> {
        let path = self.held_out_log_path(run);
        read_log_table(&path, joints, rate_hz).map_err(|error| IterationError::State {
            problem: format!("{error}: put the log back, or remove its folder"),
            path: path.clone(),
        })
    }

    /// Where the log of the held-out run after a run stands.
    pub fn held_out_log_path(&self, run: usize) -> PathBuf {
        self.held_out_folder(run).join(log_name(0))
    }

    fn held_out_folder(&self, run: usize) -> PathBuf {
        self.runs.join(format!("{HELD_OUT}{run}"))
    }

    /// Keeps a run: `run.json`, `log.csv` of each leg (`log_2.csv` and so on for further legs), `approach_log.csv` and
    /// `return_log.csv` beside it where it had ways, and `motion.csv` of each that is not the task's. What was planned
    /// for it is removed.
    ///
    /// # Errors
    /// A folder that cannot be written; then the run is not there.
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

    /// Keeps the motion that was planned for a run, so that a further call runs the same: `planned_k/`, with
    /// `plan.json` and `motion.csv`.
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

    /// The motion that an earlier call has planned for a run of so many joints, if one has.
    ///
    /// # Errors
    /// A folder that cannot be read or holds something else.
    pub fn planned(&self, run: usize, joints: usize) -> Result<Option<PlannedMotion>, IterationError> {
        let folder = self.plan_folder(run);
        let path = folder.join(PLAN_FILE);
        let text = match dynident_files::read_text(&path, MOST_BYTES) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(IterationError::file(&path)(error)),
        };
        let wrong = |problem: String| IterationError::State { path: path.clone(), problem };
        let file: PlanFile = unsealed(&text)
            .map_err(|error| wrong(format!("is no planned motion of an iteration ({error}); remove its folder")))?;
        if file.schema != PLAN_SCHEMA || file.fingerprint != self.fingerprint || file.run != run {
            return Err(wrong("belongs to another iteration, version or run: remove its folder".to_owned()));
        }
        let motion = file.motion.map(|motion| motion.with_tables(&folder, joints)).transpose()?;
        Ok(Some(PlannedMotion { motion, forecast: file.forecast }))
    }

    /// Keeps what was recorded of a run that a stop cut short, beside the runs: `interrupted_k/`, with the logs and
    /// `interrupted.json`; where it is, or none if nothing was recorded.
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

    /// A folder with a file, the logs and the motion, whole or not at all.
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
        // It has another name now: there is nothing left to remove.
        let _ = fresh.keep();
        sync_folder(&self.runs)
    }

    /// Forgets the newest run, whose log was corrected, with everything that was made after it.
    ///
    /// # Errors
    /// A folder that holds files of somebody else, or that cannot be removed.
    pub(crate) fn forget_run(&self, run: usize) -> Result<(), IterationError> {
        RunsFolder::look(&self.runs)?.remove_run(&self.run_folder(run))?;
        self.forget_held_out(run)
    }

    /// Forgets the held-out run after the newest run, with what was planned after it.
    ///
    /// # Errors
    /// A folder that cannot be removed.
    pub(crate) fn forget_held_out(&self, run: usize) -> Result<(), IterationError> {
        RunsFolder::look(&self.runs)?.remove_plans_but(run)
    }

    /// The records of a run, leg after leg, at these rates: bit for bit as they were when it was made.
    ///
    /// # Errors
    /// A log that is not there any more or holds something else.
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

    /// That run number `run` cannot be gone on from.
    pub(crate) fn refused(&self, run: usize, problem: String) -> IterationError {
        IterationError::State { path: self.run_folder(run).join(RUN_FILE), problem }
    }

    /// The log of a run's leg, by its place from 0.
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

/// The log of a leg, by its place from 0, in its run's folder.
fn log_name(leg: usize) -> String {
    if leg == 0 { "log.csv".to_owned() } else { format!("log_{}.csv", leg + 1) }
}

fn write_synced(path: &Path, contents: &[u8]) -> Result<(), IterationError> {
    let mut file = File::create(path).map_err(IterationError::file(path))?;
    file.write_all(contents).map_err(IterationError::file(path))?;
    file.sync_all().map_err(IterationError::file(path))
}

/// Names in a folder reach the disk with the folder itself, where the system knows such a thing.
fn sync_folder(path: &Path) -> Result<(), IterationError> {
    if cfg!(unix) {
        let folder = File::open(path).map_err(IterationError::file(path))?;
        folder.sync_all().map_err(IterationError::file(path))?;
    }
    Ok(())
}

/// A temporary folder is private to its owner; a result is for everybody whom the folder lets in.
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
