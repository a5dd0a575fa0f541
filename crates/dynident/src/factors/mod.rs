//! **Logs as factors**: what many logs of a kind of robot say, in a form that is small, that can be put together in any
//! order, and that a model is made from without the logs.

mod file;

use crate::clock::{LAST_SECOND, utc_of_seconds};
use crate::digest::hexadecimal;
use crate::error::FactorsError;
use crate::result::{FACTORS_SCHEMA, FactorsFile, FactorsLog};
use crate::study::Study;
use dynident_identification::ReducedLog;
use sha2::{Digest, Sha256};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

/// One log of [`Factors`].
#[derive(Clone, Debug)]
pub struct FactorLog {
    /// The robot that it was recorded on, where there are several of one kind.
    pub arm: Option<String>,
    /// When it was recorded, seconds since 1970 began (UTC).
    pub recorded_at_s: Option<f64>,
    /// SHA-256 of its numbers: two logs with the same one are one log.
    pub sha256: String,
    /// The factors.
    pub log: ReducedLog,
}

impl FactorLog {
    /// A log with the hash of its numbers.
    pub(crate) fn new(arm: Option<String>, recorded_at_s: Option<f64>, log: ReducedLog) -> Self {
        let mut hash = Sha256::new();
        for factor in log.factors.iter().chain(log.noise.iter().flatten()) {
            hash.update(format!("{:?}", factor.shape()));
            for number in factor.numbers() {
                hash.update(number.to_le_bytes());
            }
        }
        Self { arm, recorded_at_s, sha256: hexadecimal(&hash.finalize()), log }
    }

    /// Bytes of its numbers.
    pub fn numbers_bytes(&self) -> u64 {
        let factors = self.log.factors.iter().chain(self.log.noise.iter().flatten());
        factors.map(|factor| 8 * factor.shape().count().unwrap_or(0) as u64).sum()
    }

    /// What logs are ordered by, so that no result depends on the order in which they came.
    fn key(&self) -> (Option<&str>, i64, &str, &str) {
        // Bits of a number that is not negative stand in the order of the numbers.
        let time = self.recorded_at_s.map_or(-1, |time| (time.max(0.0) + 0.0).to_bits().cast_signed());
        (self.arm.as_deref(), time, &self.log.name, &self.sha256)
    }
}

/// Reduced logs of one kind of robot, with all that makes a model of them: description, drives, filters, estimator.
///
/// Made by [`reduce()`](crate::reduce()), put together by [`merged`](Self::merged), kept as
/// [`to_bytes`](Self::to_bytes), made into a model by [`identify_factors()`](crate::identify_factors()). Logs stand in
/// an order of their own (robot, time, name, hash), so that the result is the same to the last bit however they came
/// together.
#[derive(Clone, Debug)]
pub struct Factors {
    /// Robot, drives, filters and estimator that all logs share; the description is in memory, and there is no log.
    pub(crate) study: Study,
    /// What messages call the study.
    pub(crate) study_path: PathBuf,
    /// In the order of their keys, none twice.
    logs: Vec<FactorLog>,
}

impl Factors {
    /// Logs in their order.
    pub(crate) fn new(study: Study, study_path: PathBuf, logs: Vec<FactorLog>) -> Self {
        Self { study, study_path, logs: in_order(logs) }
    }

    /// The logs, by robot, time, name and hash.
    pub fn logs(&self) -> &[FactorLog] {
        &self.logs
    }

    /// Robot, drives, filters and estimator; without a log.
    pub fn study(&self) -> &Study {
        &self.study
    }

    /// What messages call the study.
    pub fn study_path(&self) -> &Path {
        &self.study_path
    }

    /// The robots that logs name, in order; none for logs that name none.
    pub fn arms(&self) -> Vec<Option<&str>> {
        let mut arms: Vec<Option<&str>> = self.logs.iter().map(|log| log.arm.as_deref()).collect();
        arms.dedup();
        arms
    }

    /// What there is to say of them as a file of so many bytes at `path`.
    pub fn file(&self, path: &Path, bytes: u64) -> FactorsFile {
        let log = |log: &FactorLog| FactorsLog {
            name: log.log.name.clone(),
            arm: log.arm.clone(),
            recorded_at: log.recorded_at_s.and_then(utc_of_seconds),
            sha256: log.sha256.clone(),
            rows: log.log.statistics.filtered_rows,
        };
        let robot = self.study.robot.description.as_ref().map(|robot| robot.model.name().to_owned());
        FactorsFile {
            schema: FACTORS_SCHEMA.to_owned(),
            file: path.display().to_string(),
            bytes,
            robot: robot.unwrap_or_default(),
            logs: self.logs.iter().map(log).collect(),
        }
    }

    /// Those logs alone that `is_wanted` says yes to.
    #[must_use]
    pub fn only(&self, is_wanted: impl Fn(&FactorLog) -> bool) -> Self {
        let logs = self.logs.iter().filter(|log| is_wanted(log)).cloned().collect();
        Self { study: self.study.clone(), study_path: self.study_path.clone(), logs }
    }

    /// All logs of several. The same log twice is one log, so that whoever reduced one a second time changes nothing;
    /// their order is of no account.
    ///
    /// # Errors
    /// [`FactorsError::Empty`] for nothing to merge, [`FactorsError::Unlike`] for another robot or other settings.
    pub fn merged(parts: impl IntoIterator<Item = Self>) -> Result<Self, FactorsError> {
        let mut parts = parts.into_iter();
        let mut all = parts.next().ok_or(FactorsError::Empty)?;
        let kind = all.kind()?;
        for part in parts {
            is_one_kind(&kind, &part.kind()?)?;
            all.logs.extend(part.logs);
        }
        all.logs = in_order(all.logs);
        Ok(all)
    }

    /// What must be alike in factors that are put together.
    fn kind(&self) -> Result<serde_json::Value, FactorsError> {
        let cannot = |error: serde_json::Error| FactorsError::Header { problem: error.to_string() };
        let mut kind = serde_json::to_value(&self.study).map_err(cannot)?;
        let text = self.study.robot.description.as_ref().map(|robot| robot.text.clone());
        kind["robot"]["file"] = serde_json::Value::Null;
        kind["robot"]["description"] = text.map_or(serde_json::Value::Null, serde_json::Value::String);
        kind["name"] = serde_json::Value::Null;
        Ok(kind)
    }
}

/// That factors of two kinds can be put together: they are of one.
fn is_one_kind(kind: &serde_json::Value, other: &serde_json::Value) -> Result<(), FactorsError> {
    if kind == other {
        return Ok(());
    }
    let differs = |key: &&String| kind.get(*key) != other.get(*key);
    let sections = kind.as_object().map(|sections| sections.keys().filter(differs).cloned().collect());
    Err(FactorsError::Unlike { sections: sections.unwrap_or_default() })
}

/// Logs by their keys, each once.
fn in_order(mut logs: Vec<FactorLog>) -> Vec<FactorLog> {
    logs.sort_by(|a, b| a.key().cmp(&b.key()));
    let mut seen = HashSet::new();
    logs.retain(|log| seen.insert(log.sha256.clone()));
    logs
}

/// Seconds since 1970 began of a time in UTC: `2026-01-05T08:00:00Z`, `2026-01-05 08:00:00`, `2026-01-05`, or the
/// seconds themselves; none for what is no such time.
pub fn seconds_of(text: &str) -> Option<f64> {
    let text = text.trim();
    if let Ok(seconds) = text.parse::<f64>() {
        return (0.0..LAST_SECOND).contains(&seconds).then_some(seconds);
    }
    let whole = if text.len() == "2026-01-05".len() { format!("{text}T00:00:00Z") } else { text.to_owned() };
    let at = humantime::parse_rfc3339_weak(&whole).ok()?;
    Some(at.duration_since(UNIX_EPOCH).ok()?.as_secs_f64())
}

/// The name alone: a file that many machines write says nothing of where it was written.
pub(crate) fn name_alone(path: &Path) -> PathBuf {
    path.file_name().map_or_else(|| path.to_owned(), PathBuf::from)
}
