//! File format of factors, version 1.
//!
//! ```text
//!     bytes                what
//!     16                   "DYNIDENT FACTORS"
//!     4                    version, little endian, 1
//!     4                    zero
//!     8                    length of the head, bytes, little endian
//!     length of the head   JSON: study, description, logs with the shapes of their factors
//!     0 to 7               zeros, up to a multiple of eight
//!     8 n                  numbers, IEEE doubles, little endian: log by log, joint by joint, then those of the noise;
//!                          segment by segment the upper triangle of [W | τ] by rows, or its rows
//!     32                   SHA-256 of all before
//! ```

use super::{FactorLog, Factors};
use crate::error::FactorsError;
use crate::study::Study;
use dynident_estimation::{FactorShape, SegmentedFactor};
use dynident_identification::ReducedLog;
use dynident_identification::rows::{LogStatistics, VelocityHistogram};
use dynident_model::read_robot;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::path::PathBuf;

const MAGIC: &[u8; 16] = b"DYNIDENT FACTORS";
const VERSION: u32 = 1;
const HEADER_START: usize = 32;
const HASH_BYTES: usize = 32;

#[derive(Serialize, Deserialize)]
struct Head {
    study: serde_json::Value,
    study_path: PathBuf,
    robot: Option<HeadRobot>,
    logs: Vec<HeadLog>,
}

#[derive(Serialize, Deserialize)]
struct HeadRobot {
    path: PathBuf,
    text: String,
}

#[derive(Serialize, Deserialize)]
struct HeadLog {
    name: String,
    arm: Option<String>,
    recorded_at_s: Option<f64>,
    motion_cutoff_hz: Option<f64>,
    filter_cutoff_hz: Option<f64>,
    filtered_rate_hz: f64,
    filtered_rows: u64,
    velocities: Vec<VelocityHistogram>,
    factors: Vec<FactorShape>,
    noise: Option<Vec<FactorShape>>,
}

impl Factors {
    /// Serialises the factors to one file with a version and a hash. The file has about `joints × segments × (columns
    /// + 1)² × 4` bytes per log.
    ///
    /// # Errors
    /// [`FactorsError::Header`] for a study that JSON cannot represent.
    pub fn to_bytes(&self) -> Result<Vec<u8>, FactorsError> {
        let cannot = |error: serde_json::Error| FactorsError::Header { problem: error.to_string() };
        let robot = self.study.robot.description.as_ref();
        let head = Head {
            study: self.study.to_json().map_err(cannot)?,
            study_path: self.study_path.clone(),
            robot: robot.map(|robot| HeadRobot { path: robot.path.clone(), text: robot.text.clone() }),
            logs: self.logs().iter().map(head_of).collect(),
        };
        let head = serde_json::to_vec(&head).map_err(cannot)?;
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend([0; 4]);
        bytes.extend((head.len() as u64).to_le_bytes());
        bytes.extend(head);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        for log in self.logs() {
            for factor in log.log.factors.iter().chain(log.log.noise.iter().flatten()) {
                bytes.extend(factor.numbers().into_iter().flat_map(f64::to_le_bytes));
            }
        }
        let hash = Sha256::digest(&bytes);
        bytes.extend(hash);
        Ok(bytes)
    }

    /// Reads the format of [`to_bytes`](Self::to_bytes).
    ///
    /// # Errors
    /// [`FactorsError`] for another file, another version, a truncated or a corrupt file.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, FactorsError> {
        let (head, numbers) = parts(bytes)?;
        let unreadable = |problem: String| FactorsError::Header { problem };
        let head: Head = serde_json::from_slice(head).map_err(|error| unreadable(error.to_string()))?;
        let study = head.study.to_string();
        let mut study = Study::from_json(&study, &head.study_path).map_err(|error| unreadable(error.to_string()))?;
        if let Some(HeadRobot { path, text }) = head.robot {
            let robot = read_robot(text, &path).map_err(|error| unreadable(error.to_string()))?;
            study.robot.description = Some(Box::new(robot));
        }
        let mut rest = numbers;
        let mut logs = Vec::with_capacity(head.logs.len());
        for log in head.logs {
            logs.push(log_of(log, &mut rest, bytes.len())?);
        }
        if !rest.is_empty() {
            return Err(unreadable(format!("{} surplus bytes after the last log", rest.len())));
        }
        Ok(Self::new(study, head.study_path, logs))
    }
}

fn parts(bytes: &[u8]) -> Result<(&[u8], &[u8]), FactorsError> {
    if !bytes.starts_with(MAGIC) {
        return Err(FactorsError::Kind);
    }
    let short = || FactorsError::Short { bytes: bytes.len() };
    let word = |at: usize| bytes.get(at..at + 4).and_then(|word| word.try_into().ok()).map(u32::from_le_bytes);
    let version = word(16).ok_or_else(short)?;
    if version != VERSION {
        return Err(FactorsError::Version { found: version, known: VERSION });
    }
    let length = bytes.get(24..HEADER_START).and_then(|word| word.try_into().ok()).map(u64::from_le_bytes);
    let end = bytes.len().checked_sub(HASH_BYTES).filter(|end| *end >= HEADER_START).ok_or_else(short)?;
    let length = length.and_then(|length| usize::try_from(length).ok()).ok_or_else(short)?;
    let head_end = HEADER_START.checked_add(length).filter(|head_end| *head_end <= end).ok_or_else(short)?;
    let first_number = head_end.next_multiple_of(8);
    if first_number > end {
        return Err(short());
    }
    if Sha256::digest(&bytes[..end])[..] != bytes[end..] {
        return Err(FactorsError::Hash);
    }
    Ok((&bytes[HEADER_START..head_end], &bytes[first_number..end]))
}

fn head_of(log: &FactorLog) -> HeadLog {
    let shapes = |factors: &Vec<SegmentedFactor>| factors.iter().map(SegmentedFactor::shape).collect();
    let ReducedLog { name, factors, noise, statistics } = &log.log;
    HeadLog {
        name: name.clone(),
        arm: log.arm.clone(),
        recorded_at_s: log.recorded_at_s,
        motion_cutoff_hz: statistics.motion_cutoff_hz,
        filter_cutoff_hz: statistics.filter_cutoff_hz,
        filtered_rate_hz: statistics.filtered_rate_hz,
        filtered_rows: statistics.filtered_rows,
        velocities: statistics.velocities.clone(),
        factors: shapes(factors),
        noise: noise.as_ref().map(shapes),
    }
}

/// Reads the log of a header entry, and removes its numbers from `rest`.
fn log_of(head: HeadLog, rest: &mut &[u8], file_bytes: usize) -> Result<FactorLog, FactorsError> {
    let name = head.name;
    let mut factors = |shapes: &[FactorShape]| -> Result<Vec<SegmentedFactor>, FactorsError> {
        let factor = |shape: &FactorShape| {
            let bytes = shape.count().and_then(|count| count.checked_mul(8)).filter(|bytes| *bytes <= rest.len());
            let (own, later) = rest.split_at(bytes.ok_or(FactorsError::Short { bytes: file_bytes })?);
            *rest = later;
            let number = |word: &[u8; 8]| f64::from_le_bytes(*word);
            let numbers: Vec<f64> = own.as_chunks().0.iter().map(number).collect();
            SegmentedFactor::from_numbers(shape, &numbers)
                .map_err(|source| FactorsError::Numbers { log: name.clone(), source })
        };
        shapes.iter().map(factor).collect()
    };
    let of_rows = factors(&head.factors)?;
    let noise = head.noise.as_deref().map(factors).transpose()?;
    let statistics = LogStatistics {
        report: None,
        motion_cutoff_hz: head.motion_cutoff_hz,
        filtered_rate_hz: head.filtered_rate_hz,
        filter_cutoff_hz: head.filter_cutoff_hz,
        filtered_rows: head.filtered_rows,
        velocities: head.velocities,
    };
    let log = ReducedLog { name, factors: of_rows, noise, statistics };
    Ok(FactorLog::new(head.arm, head.recorded_at_s, log))
}
