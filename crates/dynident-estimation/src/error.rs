//! What can be wrong with the numbers that reach an estimator.

use thiserror::Error;

/// Why rows could not be absorbed, a problem not assembled or an estimate not made.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum EstimationError {
    /// A slice of rows does not have the announced shape.
    #[error("{what}: expected {expected} numbers, found {found}; give every row one number per column and the torque")]
    Shape {
        /// Which argument.
        what: &'static str,
        /// Numbers that the announced shape has.
        expected: usize,
        /// Numbers given.
        found: usize,
    },
    /// A number in a row is NaN, infinite or too large to be squared.
    #[error(
        "row {row}, column {column}: {value} cannot be used in a fit (largest magnitude {limit:e}); remove this sample or fix its source"
    )]
    Unusable {
        /// Row within the rows given, from 0.
        row: usize,
        /// Column, from 0; the torque is the last one.
        column: usize,
        /// The number.
        value: f64,
        /// The largest magnitude accepted.
        limit: f64,
    },
    /// Two things that must describe the same columns or joints do not.
    #[error("{what}: expected {expected}, found {found}")]
    Mismatch {
        /// What was compared.
        what: String,
        /// What is needed.
        expected: usize,
        /// What was given.
        found: usize,
    },
    /// A column or joint number is out of range or given twice.
    #[error("log {log}, joint {joint}: column number {column} is given twice or is not below {columns}")]
    Column {
        /// The log.
        log: String,
        /// The joint.
        joint: String,
        /// The offending number.
        column: usize,
        /// How many columns the problem has.
        columns: usize,
    },
    /// A setting has no meaning.
    #[error("setting {setting} = {value}: {fix}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Its value.
        value: f64,
        /// What to give instead.
        fix: &'static str,
    },
    /// There are not more rows than free parameters, so nothing can be said about the noise.
    #[error(
        "{what}: {rows} rows for {parameters} free parameters leave no freedom to judge the noise; give a longer log or fewer columns"
    )]
    TooFewRows {
        /// All rows, or one joint's share.
        what: String,
        /// Rows.
        rows: usize,
        /// Parameters that these rows pay for.
        parameters: f64,
    },
    /// Cluster-robust covariance needs at least two segments.
    #[error(
        "{clusters} time segment(s) in all: a covariance from segments needs at least two; use shorter segments, a longer log or the white-noise covariance"
    )]
    TooFewSegments {
        /// Segments found.
        clusters: usize,
    },
    /// Joints of one log are cut into different segments, so a joint covariance across them has no meaning.
    #[error(
        "log {log}: the segments of joint {joint} differ from those of the log's first joint; absorb the same rows for all joints or treat joints as independent"
    )]
    SegmentsDiffer {
        /// The log.
        log: String,
        /// The joint.
        joint: String,
    },
    /// A prior was given to an estimator that has no noise level to weigh it against.
    #[error("ordinary least squares has no noise level to weigh a prior against; use weighted least squares")]
    PriorWithoutNoiseLevel,
    /// Magnitudes lie so far apart that the result is not a number a computer holds.
    #[error(
        "the estimate of {name} overflows: columns and torque differ by too many powers of ten; check units and scales"
    )]
    Overflow {
        /// The column.
        name: String,
    },
    /// What a caller's own estimator gave is no estimate.
    #[error("the estimator `{name}`: {problem}")]
    Own {
        /// Its name.
        name: String,
        /// What is wrong, and what to give.
        problem: String,
    },
    /// The parameters that an iteration begins with cannot be simulated.
    #[error(
        "the simulation does not get through with the starting values; start from a description or an estimate that is a physically consistent set"
    )]
    NoSimulation,
    /// Unknowns of the motion, or parameters beside it, that the rows leave open.
    #[error(
        "the rows do not separate {name} from the unknowns before it; leave it out, give the motion fewer unknowns, or a longer or livelier log"
    )]
    Undetermined {
        /// The unknown.
        name: String,
    },
    /// The problem has no equations.
    #[error("no rows of any joint: absorb a log before estimating")]
    Empty,
}

/// That two things which describe the same columns, joints or rows agree in number.
pub(crate) fn expect(what: &str, expected: usize, found: usize) -> Result<(), EstimationError> {
    if expected == found { Ok(()) } else { Err(EstimationError::Mismatch { what: what.into(), expected, found }) }
}

/// That a setting means something.
pub(crate) fn require(
    holds: bool,
    setting: &'static str,
    value: f64,
    fix: &'static str,
) -> Result<(), EstimationError> {
    if holds { Ok(()) } else { Err(EstimationError::Setting { setting, value, fix }) }
}

/// That a setting is in its range.
pub(crate) fn within(
    setting: &'static str,
    value: f64,
    range: impl core::ops::RangeBounds<f64>,
    fix: &'static str,
) -> Result<(), EstimationError> {
    require(range.contains(&value), setting, value, fix)
}
