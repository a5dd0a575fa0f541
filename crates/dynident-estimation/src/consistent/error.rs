//! Errors of a physical fit.

use thiserror::Error;

/// Why a physical fit failed.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum PhysicalError {
    /// Numbers of columns or bodies do not agree.
    #[error("{what}: expected {expected}, found {found}")]
    Mismatch {
        /// The quantity that was compared.
        what: String,
        /// Expected number.
        expected: usize,
        /// Number given.
        found: usize,
    },
    /// A value is NaN or infinite.
    #[error("{what} is {value}: use finite numbers")]
    NotFinite {
        /// The quantity.
        what: String,
        /// Its value.
        value: f64,
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
    /// A body's reference is not a consistent body.
    #[error(
        "body {body}: its prior is not physically consistent (smallest eigenvalue of the pseudo-inertia {least_eigenvalue:.3e}); correct its mass and inertia in the robot description, or give an approximate body of its size"
    )]
    InfeasiblePrior {
        /// The body.
        body: String,
        /// Smallest eigenvalue of its pseudo-inertia, in SI units.
        least_eigenvalue: f64,
    },
    /// A known body is neither physically consistent nor massless.
    #[error(
        "body {body}: the known values are not physically consistent (smallest eigenvalue of the pseudo-inertia {least_eigenvalue:.3e}); correct these values, or remove them so that the body is estimated"
    )]
    InfeasibleKnown {
        /// The body.
        body: String,
        /// Smallest eigenvalue of its pseudo-inertia, in SI units.
        least_eigenvalue: f64,
    },
    /// The interval of a quantity is empty.
    #[error("{what}: the interval from {lower} to {upper} is empty; the lower limit must be below the upper limit")]
    EmptyInterval {
        /// The quantity and its body.
        what: String,
        /// Lower limit.
        lower: f64,
        /// Upper limit.
        upper: f64,
    },
    /// The limits of the total mass contradict those of the bodies.
    #[error(
        "contradicting mass limits: total mass {lower} to {upper} kg, sum of the bodies' limits {least} to {greatest} kg; widen one of them"
    )]
    TotalMass {
        /// Lower limit of the total.
        lower: f64,
        /// Upper limit of the total.
        upper: f64,
        /// Sum of the bodies' lower limits.
        least: f64,
        /// Sum of the bodies' upper limits.
        greatest: f64,
    },
    /// The constraints contradict each other.
    #[error("contradicting constraints (violated by {shortfall:.3e} of the reference), widen or remove one: {}", constraints.join("; "))]
    Contradictory {
        /// The contradicting constraints.
        constraints: Vec<String>,
        /// Violation at the best point, in units of the reference bodies.
        shortfall: f64,
    },
    /// The solver failed at the start: magnitudes are beyond double precision.
    #[error(
        "the physical fit fails in double precision: columns and bodies differ by too many powers of ten; check units and scales"
    )]
    Breakdown,
}
