//! Errors of a physical fit.

use thiserror::Error;

/// Why a physical fit failed.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum PhysicalError {
    /// Two inputs of the physically consistent fit have different numbers of columns or bodies. In a program, pass
    /// lists of equal length; otherwise report the message.
    #[error("{what}: expected {expected}, found {found}")]
    Mismatch {
        /// The quantity that was compared.
        what: String,
        /// Expected number.
        expected: usize,
        /// Number given.
        found: usize,
    },
    /// A mass, an inertia or a limit for the physically consistent fit is NaN or infinite. Correct it in the robot
    /// description or under `[estimator.physical]`.
    #[error("{what} is {value}: use finite numbers")]
    NotFinite {
        /// The quantity.
        what: String,
        /// Value of the quantity.
        value: f64,
    },
    /// A setting of the physically consistent fit is outside its range. Write a value within the range that the message
    /// names.
    #[error("setting {setting} = {value}: {fix}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Value of the setting.
        value: f64,
        /// The fix.
        fix: &'static str,
    },
    /// The nominal inertia of this link is impossible for any real body. Run `dynident inspect ROBOT --fix OUT.urdf`,
    /// or correct the `<inertial>`.
    #[error(
        "body {body}: its prior is not physically consistent (smallest eigenvalue of the pseudo-inertia {least_eigenvalue:.3e}); correct its mass and inertia in the robot description, or give an approximate body of its size"
    )]
    InfeasiblePrior {
        /// The body.
        body: String,
        /// Smallest eigenvalue of its pseudo-inertia, in SI units.
        least_eigenvalue: f64,
    },
    /// The study states that the parameters of this body are known, but no real body has them. Correct the values, or
    /// delete them.
    #[error(
        "body {body}: the known values are not physically consistent (smallest eigenvalue of the pseudo-inertia {least_eigenvalue:.3e}); correct these values, or remove them so that the body is estimated"
    )]
    InfeasibleKnown {
        /// The body.
        body: String,
        /// Smallest eigenvalue of its pseudo-inertia, in SI units.
        least_eigenvalue: f64,
    },
    /// The stated lower limit is not below the upper limit. Exchange or widen the limits.
    #[error("{what}: the interval from {lower} to {upper} is empty; the lower limit must be below the upper limit")]
    EmptyInterval {
        /// The quantity and its body.
        what: String,
        /// Lower limit.
        lower: f64,
        /// Upper limit.
        upper: f64,
    },
    /// The limits of the total mass and those of the single bodies under `[estimator.physical]` cannot be satisfied
    /// together. Widen one of them.
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
    /// The stated limits of masses, centres of mass or laws cannot be satisfied together. Widen or delete one of the
    /// listed constraints.
    #[error("contradicting constraints (violated by {shortfall:.3e} of the reference), widen or remove one: {}", constraints.join("; "))]
    Contradictory {
        /// The contradicting constraints.
        constraints: Vec<String>,
        /// Violation at the best point, in units of the reference bodies.
        shortfall: f64,
    },
    /// The numbers of the fit differ too much in size for the solver. Usually a unit or scale of position, time or
    /// torque is wrong.
    #[error(
        "the physical fit fails in double precision: columns and bodies differ by too many powers of ten; check units and scales"
    )]
    Breakdown,
}
