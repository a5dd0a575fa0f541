//! Errors of the estimators.

use thiserror::Error;

/// Errors of factors, problems and estimators.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum EstimationError {
    /// A program passed a row of the regression with the wrong number of values. Each row has one value for each
    /// column, and the torque.
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
    /// A position, velocity or torque of the log leads to a value that is NaN, infinite or too large. Check units and
    /// outliers of the log, or leave out the sample with `drop_time_s`.
    #[error(
        "row {row}, column {column}: {value} cannot be used in a fit (largest magnitude {limit:e}); remove this sample or fix its source"
    )]
    Unusable {
        /// Index of the row among the rows passed, from 0.
        row: usize,
        /// Index of the column, from 0; the torque is the last one.
        column: usize,
        /// The value.
        value: f64,
        /// Largest accepted magnitude.
        limit: f64,
    },
    /// Two inputs of a fit have different numbers of columns, joints or rows. In a program, pass lists of equal length;
    /// otherwise report the message.
    #[error("{what}: expected {expected}, found {found}")]
    Mismatch {
        /// The quantity that was compared.
        what: String,
        /// Expected number.
        expected: usize,
        /// Number given.
        found: usize,
    },
    /// A program fixed or selected a column number twice, or one that does not exist. Column numbers start at 0.
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
    /// A setting of the estimator is outside its range. Write a value within the range that the message names.
    #[error("setting {setting} = {value}: {fix}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Value of the setting.
        value: f64,
        /// The fix.
        fix: &'static str,
    },
    /// The logs have fewer usable samples than unknown parameters, or about as many. Record longer logs, or reduce the
    /// friction laws under `[drive]`.
    #[error(
        "{what}: {rows} rows for {parameters} free parameters are too few to estimate the noise; use a longer log or fewer columns"
    )]
    TooFewRows {
        /// What the rows belong to: all joints, or one joint.
        what: String,
        /// Number of rows.
        rows: usize,
        /// Number of free parameters that these rows determine; fractional for the share of one joint.
        parameters: f64,
    },
    /// The error bars are computed from the differences between time segments of the logs, and there is only one.
    /// Record a longer log.
    #[error(
        "too few time segments ({clusters}): a covariance from segments needs at least two; use shorter segments, a longer log or the white-noise covariance"
    )]
    TooFewSegments {
        /// Number of segments found.
        clusters: usize,
    },
    /// A program passed different rows for the joints of one log, so that correlations between joints cannot be
    /// computed. Pass the same rows for all joints.
    #[error(
        "log {log}: the segments of joint {joint} differ from those of the log's first joint; absorb the same rows for all joints or treat joints as independent"
    )]
    SegmentsDiffer {
        /// The log.
        log: String,
        /// The joint.
        joint: String,
    },
    /// A prior (nominal values with uncertainties) is weighed against the noise of the torque, which ordinary least
    /// squares does not estimate. Write `estimator.method = "weighted"`.
    #[error("ordinary least squares has no noise level to weigh a prior against; use weighted least squares")]
    PriorWithoutNoiseLevel,
    /// The estimated value is too large for a number. Position, time or torque probably has a wrong unit or scale:
    /// correct `unit` or `scale` under `[format]`.
    #[error(
        "the estimate of {name} overflows: its regressor column and the torque differ by too many powers of ten; check the units and scales of position and torque"
    )]
    Overflow {
        /// The column.
        name: String,
    },
    /// The function that a program passed as estimator returned values of the wrong size, values that are not finite,
    /// or a negative variance. Correct the function.
    #[error("invalid result of the estimator `{name}`: {problem}")]
    Own {
        /// Name of the estimator.
        name: String,
        /// The problem and its fix.
        problem: String,
    },
    /// This estimator simulates the robot, and the simulation with the start values has no finite result. Correct mass
    /// and inertia in the robot description, or use `estimator.method = "auto"`.
    #[error(
        "the simulation fails with the start values; start from a physically consistent robot description or estimate"
    )]
    NoSimulation,
    /// Two unknowns have the same effect on the logs, so that the fit cannot separate them. Use a more exciting motion,
    /// or fewer unknowns.
    #[error(
        "the rows do not determine {name} separately from the unknowns before it; remove {name}, use fewer unknowns for the motion, or use a longer or more exciting log"
    )]
    Undetermined {
        /// Name of the unknown.
        name: String,
    },
    /// The covariance of the compared results is not positive definite, because the logs did not determine a
    /// parameter. Identify from logs with a more exciting motion (`dynident design`).
    #[error("the {what} is not positive definite; identify both results from logs that excite their parameters")]
    NotPositive {
        /// The covariance.
        what: &'static str,
    },
    /// The fit has no samples of any joint. Check that the logs have rows that are not dropped.
    #[error("no rows of any joint: add the rows of at least one log (absorb) before the estimation")]
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
