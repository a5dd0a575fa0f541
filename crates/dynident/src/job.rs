//! What fitting and testing share: how a job runs, which files it needs, what is told of a log.

use crate::error::Error;
use crate::identify::result::LogSummary;
use crate::machine::Machine;
use crate::measured::evidence::{PriorAgreement, findings};
use crate::measured::lag::{self, TorqueLag};
use crate::measured::rows::Passed;
use crate::progress::Progress;
use crate::study::{Folders, Role, Study};
use std::path::{Path, PathBuf};

/// How a job runs; not what it computes.
pub struct RunOptions<'a> {
    /// Folder of the recordings, in place of the study's own.
    pub data: Option<PathBuf>,
    /// Threads; the result is the same for any number.
    pub threads: usize,
    /// Hears how far the job has come.
    pub progress: &'a dyn Progress,
}

/// What a study is called.
pub(crate) fn study_name(study: &Study, path: &Path) -> String {
    let stem = || path.file_stem().map_or_else(|| "study".to_owned(), |stem| stem.to_string_lossy().into_owned());
    study.name.clone().unwrap_or_else(stem)
}

/// All logs' files, found before any work starts.
pub(crate) fn log_files(study: &Study, folders: &Folders) -> Result<Vec<PathBuf>, Error> {
    study.log.iter().map(|log| folders.find(&log.file, study.source.as_deref())).collect()
}

pub(crate) fn of_role(study: &Study, role: Role) -> Vec<usize> {
    (0..study.log.len()).filter(|&index| study.log[index].role == role).collect()
}

pub(crate) fn joint_names(machine: &Machine) -> Vec<String> {
    machine.model().joints().iter().map(|joint| joint.name.clone()).collect()
}

pub(crate) fn log_summary(
    study: &Study,
    index: usize,
    passed: Passed,
    prior_agreement: Option<PriorAgreement>,
    lags: &[Option<TorqueLag>],
    joints: &[String],
) -> LogSummary {
    let mut model_findings = prior_agreement.as_ref().map_or_else(Vec::new, findings);
    model_findings.extend(lag::findings(lags, joints));
    let mut summary = LogSummary {
        log: study.log_name(index),
        role: match study.log[index].role {
            Role::Identify => "identify",
            Role::Validate => "validate",
        },
        motion_cutoff_hz: passed.motion_cutoff_hz,
        filter_cutoff_hz: passed.filter_cutoff_hz,
        filtered_rate_hz: passed.filtered_rate_hz,
        filtered_rows: passed.filtered_rows,
        model_findings,
        torque_lag_s: Vec::new(),
        torque_lag_std_s: Vec::new(),
        torque_lag_half_width_95_s: Vec::new(),
        prior_agreement,
        import: passed.report,
    };
    note_lags(&mut summary, lags);
    summary
}

/// Writes a log's lags into its summary.
pub(crate) fn note_lags(summary: &mut LogSummary, lags: &[Option<TorqueLag>]) {
    summary.torque_lag_s = lags.iter().map(|lag| lag.map(|lag| lag.lag_s)).collect();
    summary.torque_lag_std_s = lags.iter().map(|lag| lag.map(|lag| lag.std_s)).collect();
    summary.torque_lag_half_width_95_s = lags.iter().map(|lag| lag.map(|lag| lag.half_width_95_s)).collect();
}
