//! What can be wrong with a physical problem before it is solved, or shown to have no solution.

use thiserror::Error;

/// Why there is no physical fit.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum PhysicalError {
    /// Two things that must describe the same columns do not.
    #[error("{what}: expected {expected}, found {found}")]
    Mismatch {
        /// What was compared.
        what: String,
        /// What is needed.
        expected: usize,
        /// What was given.
        found: usize,
    },
    /// A number is NaN or infinite.
    #[error("{what} is {value}: give finite numbers")]
    NotFinite {
        /// Which number.
        what: String,
        /// Its value.
        value: f64,
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
    /// A body's reference is not a consistent body.
    #[error(
        "body {body}: its prior is no consistent body (least eigenvalue of the pseudo-inertia {least_eigenvalue:.3e}); fix its mass and inertia or give a rough body of its size"
    )]
    InfeasiblePrior {
        /// The body.
        body: String,
        /// Smallest eigenvalue of its pseudo-inertia, in SI units.
        least_eigenvalue: f64,
    },
    /// A body that is given as known is not a consistent one, nor without mass.
    #[error(
        "body {body}: the values given as known are no consistent body (least eigenvalue of the pseudo-inertia {least_eigenvalue:.3e}); fix them or leave the body unknown"
    )]
    InfeasibleKnown {
        /// The body.
        body: String,
        /// Smallest eigenvalue of its pseudo-inertia, in SI units.
        least_eigenvalue: f64,
    },
    /// Lower and upper limit of one quantity leave nothing between them.
    #[error("{what}: the limits {lower} to {upper} leave nothing between them; swap or widen them")]
    EmptyInterval {
        /// Which quantity of which body.
        what: String,
        /// Lower limit.
        lower: f64,
        /// Upper limit.
        upper: f64,
    },
    /// The total mass cannot be the sum of the bodies' masses.
    #[error(
        "total mass {lower} to {upper} kg: the bodies' own limits allow {least} to {greatest} kg; widen one of them"
    )]
    TotalMass {
        /// Least total asked.
        lower: f64,
        /// Greatest total asked.
        upper: f64,
        /// Sum of the bodies' least masses.
        least: f64,
        /// Sum of the bodies' greatest masses.
        greatest: f64,
    },
    /// The constraints exclude each other.
    #[error("no set of bodies meets all constraints (short by {shortfall:.3e} of the reference); at odds are: {}", constraints.join("; "))]
    Contradictory {
        /// The constraints that exclude each other.
        constraints: Vec<String>,
        /// By how much the best point misses, in units of the reference bodies.
        shortfall: f64,
    },
    /// The solver could not even start: magnitudes beyond double precision.
    #[error(
        "the physical fit breaks down in double precision: columns and bodies differ by too many powers of ten; check units and scales"
    )]
    Breakdown,
}
