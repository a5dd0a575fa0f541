//! Content of the folder `runs/`, and safe removal: only files of an iteration are removed.

use crate::setup::error::IterationError;
use dynident_system::names;
use std::fs;
use std::path::{Path, PathBuf};

pub(crate) const UNFINISHED: &str = ".unfinished-";
const RUN: &str = "run_";
pub(crate) const INTERRUPTED: &str = "interrupted_";
pub(crate) const PLANNED: &str = "planned_";
pub(crate) const HELD_OUT: &str = "held_out_";
pub(crate) const HELD_OUT_FILE: &str = "held_out.json";
pub(crate) const PLAN_FILE: &str = "plan.json";
pub(crate) const RUN_FILE: &str = "run.json";
pub(crate) const INTERRUPTED_FILE: &str = "interrupted.json";

/// Prefixes of the logs of a run's approach and return paths.
pub(crate) const WAYS: [&str; 2] = ["approach", "return"];

pub(crate) struct RunsFolder {
    runs: PathBuf,
    kept: Vec<PathBuf>,
    planned: Vec<(usize, PathBuf)>,
    held_out: Vec<(usize, PathBuf)>,
    unfinished: Vec<PathBuf>,
}

impl RunsFolder {
    /// Reads the names in the folder; changes nothing.
    ///
    /// # Errors
    /// Foreign content at the path of a run, where no run can be stored.
    pub(crate) fn read(runs: &Path) -> Result<Self, IterationError> {
        let (mut kept, mut planned, mut unfinished) = (Vec::new(), Vec::new(), Vec::new());
        let mut held_out = Vec::new();
        for path in files(runs)? {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if name.starts_with(UNFINISHED) && is_folder(&path) {
                unfinished.push(path);
            } else if let Some(number) = name.strip_prefix(RUN)
                && number.parse::<usize>().is_ok()
            {
                if !is_folder(&path) || !path.join(RUN_FILE).is_file() {
                    let problem = "is not from an iteration, but is at the path of a run: move it to another folder";
                    return Err(IterationError::State { path, problem: problem.to_owned() });
                }
                kept.push(path);
            } else if name.starts_with(INTERRUPTED) && is_folder(&path) {
                kept.push(path);
            } else if let Some(number) = name.strip_prefix(PLANNED)
                && let Ok(number) = number.parse()
                && is_folder(&path)
            {
                planned.push((number, path));
            } else if let Some(number) = name.strip_prefix(HELD_OUT)
                && let Ok(number) = number.parse()
                && is_folder(&path)
            {
                held_out.push((number, path));
            }
        }
        Ok(Self { runs: runs.to_owned(), kept, planned, held_out, unfinished })
    }

    /// Removes the runs and their plans, if the folders contain only files of an iteration.
    ///
    /// # Errors
    /// A folder behind a symbolic link, or foreign files; nothing is removed then.
    pub(crate) fn remove_runs(&self) -> Result<(), IterationError> {
        self.may_remove_runs()?;
        self.removable().try_for_each(|folder| remove(folder))
    }

    /// Removes one run, if its folder contains only files of an iteration.
    pub(crate) fn remove_run(&self, folder: &Path) -> Result<(), IterationError> {
        self.may_remove_runs()?;
        if self.kept.iter().any(|kept| kept == folder) { remove(folder) } else { Ok(()) }
    }

    fn removable(&self) -> impl Iterator<Item = &PathBuf> {
        self.kept.iter().chain(self.planned.iter().chain(&self.held_out).map(|(_, folder)| folder))
    }

    /// Checks that [`remove_runs`](Self::remove_runs) is possible.
    pub(crate) fn may_remove_runs(&self) -> Result<(), IterationError> {
        if self.removable().next().is_none() {
            return Ok(());
        }
        if self.runs.is_symlink() {
            let problem = "is a symbolic link, and runs are not removed through links: use another --out, or remove the runs yourself";
            return Err(IterationError::State { path: self.runs.clone(), problem: problem.to_owned() });
        }
        for folder in self.removable() {
            for file in files(folder)? {
                if !is_own(&file) {
                    let problem =
                        "is not a file of an iteration, so its folder is not removed: move the file to another folder";
                    return Err(IterationError::State { path: file, problem: problem.to_owned() });
                }
            }
        }
        Ok(())
    }

    /// Removes the plans of all runs except `next`, which are obsolete, and the held-out runs that follow removed
    /// runs.
    pub(crate) fn remove_plans_but(&self, next: usize) -> Result<(), IterationError> {
        let own = |folder: &PathBuf| files(folder).is_ok_and(|files| files.iter().all(|file| is_own(file)));
        let plans = self.planned.iter().filter(|(run, _)| *run != next);
        // A held-out run after a removed run validated another model.
        let held_out = self.held_out.iter().filter(|(run, _)| *run >= next);
        let stale = plans.chain(held_out).filter(|(_, folder)| own(folder));
        stale.into_iter().try_for_each(|(_, folder)| remove(folder))
    }

    /// Removes incomplete folders of a killed iteration.
    pub(crate) fn remove_unfinished(&self) -> Result<(), IterationError> {
        let own = |folder: &&PathBuf| files(folder).is_ok_and(|files| files.iter().all(|file| is_own(file)));
        self.unfinished.iter().filter(own).try_for_each(|folder| remove(folder))
    }
}

fn is_folder(path: &Path) -> bool {
    path.symlink_metadata().is_ok_and(|found| found.is_dir())
}

fn files(folder: &Path) -> Result<Vec<PathBuf>, IterationError> {
    let names = names(folder).map_err(IterationError::file(folder))?;
    Ok(names.into_iter().map(|name| folder.join(name)).collect())
}

fn is_own(file: &Path) -> bool {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let numbered = |rest: &str| rest.strip_suffix(".csv").is_some_and(|number| number.parse::<usize>().is_ok());
    let table = |first: &str, further: &str| name == first || name.strip_prefix(further).is_some_and(numbered);
    let of_way = WAYS.iter().any(|way| {
        name.strip_prefix(way)
            .and_then(|rest| rest.strip_prefix('_'))
            .is_some_and(|rest| rest == "log.csv" || rest.strip_prefix("log_").is_some_and(numbered))
    });
    let known = of_way
        || matches!(&*name, RUN_FILE | INTERRUPTED_FILE | PLAN_FILE | HELD_OUT_FILE)
        || table("log.csv", "log_")
        || table("motion.csv", "motion_");
    known && file.symlink_metadata().is_ok_and(|meta| meta.is_file())
}

/// Removes the files in a folder, then the folder.
pub(crate) fn remove(folder: &Path) -> Result<(), IterationError> {
    for file in files(folder)? {
        fs::remove_file(&file).map_err(IterationError::file(&file))?;
    }
    fs::remove_dir(folder).map_err(IterationError::file(folder))
}
