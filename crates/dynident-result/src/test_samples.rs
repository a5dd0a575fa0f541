//! Description of the samples that `validate --samples` writes.

use dynident_identification::Role;
use dynident_recording::DecimationSettings;
use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`TestSamplesFile`].
pub const TEST_SAMPLES_SCHEMA: &str = "dynident/test-samples/1";

/// The tables of a folder of samples, `samples.json` next to them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TestSamplesFile {
    /// [`TEST_SAMPLES_SCHEMA`].
    pub schema: String,
    /// Joints of the model, in the order of the columns.
    pub joints: Vec<String>,
    /// One entry for each log of the study.
    pub logs: Vec<TestedLog>,
}

/// The samples of a log and the filter before its errors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TestedLog {
    /// Name of the log, as in the result and in `NAME.validation.json`.
    pub log: String,
    /// Its role.
    pub role: Role,
    /// Name of its table.
    pub file: String,
    /// Sample rate, Hz.
    pub rate_hz: f64,
    /// Low-pass and decimation of measured and predicted torque; null if every sample is compared. A held-out log has
    /// the filter of its test, a training log that of the fit.
    pub filter: Option<DecimationSettings>,
    /// Coefficients of this low-pass. Row k of a segment is the sum of these coefficients times the samples from
    /// `k factor` on, with samples that are not `used` set to zero, divided by the sum of the coefficients of the used
    /// samples; rows where this sum is below one half are not compared.
    pub taps: Vec<f64>,
}

impl TestSamplesFile {
    /// A file for these joints, without logs.
    pub fn new(joints: Vec<String>) -> Self {
        Self { schema: TEST_SAMPLES_SCHEMA.to_owned(), joints, logs: Vec::new() }
    }
}
