//! Tables of samples that `validate --samples` writes, for comparison with other programs.

use dynident_identification::Role;
use dynident_recording::DecimationSettings;
use serde::{Deserialize, Serialize};

/// Name and version of the schema of [`TestSamplesFile`].
pub const TEST_SAMPLES_SCHEMA: &str = "dynident/test-samples/1";

/// Content of `samples.json`, which describes the tables of samples in the same folder.
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

/// Table of samples of a log, and the filter that is applied before errors are computed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TestedLog {
    /// Name of the log, as in the result and in `NAME.validation.json`.
    pub log: String,
    /// Role of the log.
    pub role: Role,
    /// Name of the log's table.
    pub file: String,
    /// Sample rate, Hz.
    pub rate_hz: f64,
    /// Low-pass and decimation of measured and predicted torque before they are compared; null if every sample is
    /// compared. A held-out log has the filter of its test, a training log the filter of the fit.
    pub filter: Option<DecimationSettings>,
    /// Coefficients of this low-pass filter. Filtered row k of a segment is a weighted sum of the samples from index
    /// `k factor` on. Samples that are not `used` are set to zero, and the sum is divided by the sum of the
    /// coefficients of the used samples. Rows for which the latter is below one half are not compared.
    pub taps: Vec<f64>,
}

impl TestSamplesFile {
    /// A file for these joints, without logs.
    pub fn new(joints: Vec<String>) -> Self {
        Self { schema: TEST_SAMPLES_SCHEMA.to_owned(), joints, logs: Vec::new() }
    }
}
