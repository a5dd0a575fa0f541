//! **Logs as factors**: triangular factors are a small representation of many logs of one type of robot. Factors can
//! be merged in any order, and identified without the logs.

mod file;

use crate::clock::{END_OF_RFC3339_S, utc_of_seconds};
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
    /// Identifier of the individual robot, for several robots of the same type.
    pub arm: Option<String>,
    /// Time of recording, seconds since 1970-01-01 (UTC).
    pub recorded_at_s: Option<f64>,
    /// SHA-256 of the numbers of the log; equal hashes mean the same log.
    pub sha256: String,
    /// The factors of the log.
    pub log: ReducedLog,
}

impl FactorLog {
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

    /// Size of the numbers of the log, bytes.
    pub fn numbers_bytes(&self) -> u64 {
        let factors = self.log.factors.iter().chain(self.log.noise.iter().flatten());
        factors.map(|factor| 8 * factor.shape().count().unwrap_or(0) as u64).sum()
    }

    /// Sort key, so that results do not depend on the order of the logs.
    fn key(&self) -> (Option<&str>, i64, &str, &str) {
        // Nonnegative floating-point numbers have the same order as their bits.
        let time = self.recorded_at_s.map_or(-1, |time| (time.max(0.0) + 0.0).to_bits().cast_signed());
        (self.arm.as_deref(), time, &self.log.name, &self.sha256)
    }
}

/// Reduced logs of one type of robot, with everything a model needs: robot description, drives, filters, estimator.
///
/// Created by [`reduce()`](crate::reduce()), merged by [`merged`](Self::merged), stored by
/// [`to_bytes`](Self::to_bytes), identified by [`identify_factors()`](crate::identify_factors()). Logs are sorted
/// (robot, time, name, hash), so the result is bit-identical for any order of merging.
#[derive(Clone, Debug)]
pub struct Factors {
    /// Robot, drives, filters and estimator that all logs share. The robot description is in memory, and the study
    /// has no logs.
    pub(crate) study: Study,
    pub(crate) study_path: PathBuf,
    /// The logs, sorted by their keys, without duplicates.
    logs: Vec<FactorLog>,
}

impl Factors {
    pub(crate) fn new(study: Study, study_path: PathBuf, logs: Vec<FactorLog>) -> Self {
        Self { study, study_path, logs: sorted_unique(logs) }
    }

    /// The logs, sorted by robot, time, name and hash.
    pub fn logs(&self) -> &[FactorLog] {
        &self.logs
    }

    /// Robot, drives, filters and estimator; without logs.
    pub fn study(&self) -> &Study {
        &self.study
    }

    /// Name of the study in messages.
    pub fn study_path(&self) -> &Path {
        &self.study_path
    }

    /// The robots of the logs, sorted; `None` for logs without a robot.
    pub fn arms(&self) -> Vec<Option<&str>> {
        let mut arms: Vec<Option<&str>> = self.logs.iter().map(|log| log.arm.as_deref()).collect();
        arms.dedup();
        arms
    }

    /// Summary of the factors as a file of `bytes` bytes at `path`.
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

    /// The logs that satisfy `is_wanted`.
    #[must_use]
    pub fn only(&self, is_wanted: impl Fn(&FactorLog) -> bool) -> Self {
        let logs = self.logs.iter().filter(|log| is_wanted(log)).cloned().collect();
        Self { study: self.study.clone(), study_path: self.study_path.clone(), logs }
    }

    /// Merges the logs of several parts in any order. Duplicate logs are used once, so reducing a log twice has no
    /// effect.
    ///
    /// # Errors
    /// [`FactorsError::Empty`] without parts, [`FactorsError::Unlike`] for different robots or settings.
    pub fn merged(parts: impl IntoIterator<Item = Self>) -> Result<Self, FactorsError> {
        let mut parts = parts.into_iter();
        let mut all = parts.next().ok_or(FactorsError::Empty)?;
        let kind = all.kind()?;
        for part in parts {
            check_same_kind(&kind, &part.kind()?)?;
            all.logs.extend(part.logs);
        }
        all.logs = sorted_unique(all.logs);
        Ok(all)
    }

    /// Settings that must be equal in all merged factors.
    fn kind(&self) -> Result<serde_json::Value, FactorsError> {
        let cannot = |error: serde_json::Error| FactorsError::Header { problem: error.to_string() };
        let mut kind = self.study.to_json().map_err(cannot)?;
        let text = self.study.robot.description.as_ref().map(|robot| robot.text.clone());
        kind["robot"]["file"] = serde_json::Value::Null;
        kind["robot"]["description"] = text.map_or(serde_json::Value::Null, serde_json::Value::String);
        kind["name"] = serde_json::Value::Null;
        Ok(kind)
    }
}

fn check_same_kind(kind: &serde_json::Value, other: &serde_json::Value) -> Result<(), FactorsError> {
    if kind == other {
        return Ok(());
    }
    let differs = |key: &&String| kind.get(*key) != other.get(*key);
    let sections = kind.as_object().map(|sections| sections.keys().filter(differs).cloned().collect());
    Err(FactorsError::Unlike { sections: sections.unwrap_or_default() })
}

fn sorted_unique(mut logs: Vec<FactorLog>) -> Vec<FactorLog> {
    logs.sort_by(|a, b| a.key().cmp(&b.key()));
    let mut seen = HashSet::new();
    logs.retain(|log| seen.insert(log.sha256.clone()));
    logs
}

/// Seconds since 1970-01-01 of a time in UTC: `2026-01-05T08:00:00Z`, `2026-01-05 08:00:00`, `2026-01-05`, or the
/// number of seconds; `None` for other texts.
pub fn seconds_of(text: &str) -> Option<f64> {
    let text = text.trim();
    if let Ok(seconds) = text.parse::<f64>() {
        return (0.0..END_OF_RFC3339_S).contains(&seconds).then_some(seconds);
    }
    let whole = if text.len() == "2026-01-05".len() { format!("{text}T00:00:00Z") } else { text.to_owned() };
    let at = humantime::parse_rfc3339_weak(&whole).ok()?;
    Some(at.duration_since(UNIX_EPOCH).ok()?.as_secs_f64())
}

/// The file name without its folder, because factors from several computers must be equal.
pub(crate) fn name_alone(path: &Path) -> PathBuf {
    path.file_name().map_or_else(|| path.to_owned(), PathBuf::from)
}
