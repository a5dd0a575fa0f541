//! Errors of the estimators.

use thiserror::Error;

/// Errors of factors, problems and estimators.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum EstimationError {
    /// A slice of rows has the wrong length.
    #[error(
        "{what}: expected {expected} numbers, found {found}; give one number per column plus the torque for every row"
    )]
    Shape {
        /// The argument.
        what: &'static str,
        /// Expected number of values.
        expected: usize,
        /// Number of values given.
        found: usize,
    },
    /// A value in a row is NaN, infinite or too large to be squared.
    #[error(
        "row {row}, column {column}: {value} cannot be used in a fit (largest magnitude {limit:e}); remove this sample or fix its source"
    )]
    Unusable {
        /// Row within the rows given, from 0.
        row: usize,
        /// Column, from 0; the torque is the last one.
        column: usize,
        /// The value.
        value: f64,
        /// Largest accepted magnitude.
        limit: f64,
    },
    /// Numbers of columns, joints or rows do not agree.
    #[error("{what}: expected {expected}, found {found}")]
    Mismatch {
        /// The quantity that was compared.
        what: String,
        /// Expected number.
        expected: usize,
        /// Number given.
        found: usize,
    },
    /// A column number is out of range or duplicate.
    #[error("log {log}, joint {joint}: column number {column} is given twice or is not below {columns}")]
    Column {
        /// The log.
        log: String,
        /// The joint.
        joint: String,
        /// The invalid column number.
        column: usize,
        /// Number of columns of the problem.
        columns: usize,
    },
    /// A setting is out of range.
    #[error("setting {setting} = {value}: {fix}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Its value.
        value: f64,
        /// The fix.
        fix: &'static str,
    },
    /// There are not more rows than free parameters, so the noise cannot be estimated.
    #[error(
        "{what}: {rows} rows for {parameters} free parameters are too few to estimate the noise; use a longer log or fewer columns"
    )]
    TooFewRows {
        /// All rows, or the rows of one joint.
        what: String,
        /// Rows.
        rows: usize,
        /// Free parameters that these rows determine; a joint's share need not be whole.
        parameters: f64,
    },
    /// Cluster-robust covariance needs at least two segments.
    #[error(
        "too few time segments ({clusters}): a covariance from segments needs at least two; use shorter segments, a longer log or the white-noise covariance"
    )]
    TooFewSegments {
        /// Segments found.
        clusters: usize,
    },
    /// The joints of one log are cut into different segments, so a covariance across joints is undefined.
    #[error(
        "log {log}: the segments of joint {joint} differ from those of the log's first joint; absorb the same rows for all joints or treat joints as independent"
    )]
    SegmentsDiffer {
        /// The log.
        log: String,
        /// The joint.
        joint: String,
    },
    /// Ordinary least squares has no noise level to weigh a prior against.
    #[error("ordinary least squares has no noise level to weigh a prior against; use weighted least squares")]
    PriorWithoutNoiseLevel,
    /// The estimate overflows because the magnitudes of columns and torque differ too much.
    #[error(
        "the estimate of {name} overflows: its regressor column and the torque differ by too many powers of ten; check the units and scales of position and torque"
    )]
    Overflow {
        /// The column.
        name: String,
    },
    /// A custom estimator returned an invalid result.
    #[error("invalid result of the estimator `{name}`: {problem}")]
    Own {
        /// Its name.
        name: String,
        /// The problem and its fix.
        problem: String,
    },
    /// The start parameters of an iteration cannot be simulated.
    #[error(
        "the simulation fails with the start values; start from a physically consistent robot description or estimate"
    )]
    NoSimulation,
    /// The rows do not determine an unknown of the motion or a parameter.
    #[error(
        "the rows do not determine {name} separately from the unknowns before it; remove {name}, use fewer unknowns for the motion, or use a longer or more exciting log"
    )]
    Undetermined {
        /// Name of the unknown.
        name: String,
    },
    /// A covariance is not positive definite.
    #[error("the {what} is not positive definite; identify both results from logs that excite their parameters")]
    NotPositive {
        /// The covariance.
        what: &'static str,
    },
    /// The problem has no rows.
    #[error("no rows of any joint: absorb a log before estimating")]
    Empty,
}

/// Checks that two counts agree.
pub(crate) fn expect(what: &str, expected: usize, found: usize) -> Result<(), EstimationError> {
    if expected == found { Ok(()) } else { Err(EstimationError::Mismatch { what: what.into(), expected, found }) }
}

/// Checks a condition on a setting.
pub(crate) fn require(
    holds: bool,
    setting: &'static str,
    value: f64,
    fix: &'static str,
) -> Result<(), EstimationError> {
    if holds { Ok(()) } else { Err(EstimationError::Setting { setting, value, fix }) }
}

/// Checks the range of a setting.
pub(crate) fn within(
    setting: &'static str,
    value: f64,
    range: impl core::ops::RangeBounds<f64>,
    fix: &'static str,
) -> Result<(), EstimationError> {
    require(range.contains(&value), setting, value, fix)
}
