//! Errors of payloads, offsets per log, gains and known arms.

use thiserror::Error;

/// Invalid combination of payloads, offsets per log, gains or a known arm.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum PayloadError {
    /// A recording has an unknown payload.
    #[error("payload = \"{name}\" of a [[log]] is no name of a [[payload]] (names: {}); use one of these names, or add a [[payload]] with this name",
        if known.is_empty() { "none".to_owned() } else { known.join(", ") })]
    UnknownPayload {
        /// Name of the payload.
        name: String,
        /// Known payloads.
        known: Vec<String>,
    },
    /// The link does not exist.
    #[error("[[payload]] link = \"{link}\": no moving link has this name; use one of {}", known.join(", "))]
    UnknownLink {
        /// Name of the link.
        link: String,
        /// Links of the robot.
        known: Vec<String>,
    },
    /// Only test recordings have the payload to estimate.
    #[error(
        "payload `{name}` is unknown, and no training log contains it: add mass_kg and com_m to its [[payload]], or payload = \"{name}\" to a [[log]] that is not for validation"
    )]
    NotTrained {
        /// Name of the payload.
        name: String,
    },
    /// A known arm without anything to estimate.
    #[error(
        "[arm]: the arm is known, and the study has no other unknown: add a [[payload]] without mass_kg and payload = \"NAME\" to its [[log]], or refit = \"offset\" or \"friction\" to [arm]"
    )]
    NothingToEstimate,
    /// A known arm with unknown gains.
    #[error(
        "[arm] and drive.gains = \"unknown\": with a known arm the gains are known; remove this key and write the gains as scale under [format.torque]"
    )]
    GainsOfKnownArm,
    /// The estimator does not support additional columns.
    #[error(
        "payloads, offsets per log, a known arm and unknown gains require estimator.method = \"weighted\" or \"ordinary\", without instruments and without essential: \
         remove the incompatible settings"
    )]
    Estimator,
    /// Selection of friction for a known arm.
    #[error(
        "[arm] and friction = \"auto\": a known arm has the friction of its result; leave friction out, and set refit = \"friction\" to estimate its parameters again"
    )]
    FrictionOfKnownArm,
    /// Test of drive inertia for a known arm.
    #[error(
        "[arm]: a known arm has the drive inertia of its result; remove the test of drive inertia (drive.drive_inertia)"
    )]
    DrivesOfKnownArm,
    /// Friction that depends on the load of the bare arm.
    #[error(
        "load-dependent friction is not possible with payloads, because its load is that of the bare arm: remove the law `load` from [drive]"
    )]
    LoadFriction,
    /// No recording determines the gains.
    #[error(
        "drive.gains = \"unknown\" needs training logs both without and with a payload that is known: add a [[payload]] with mass_kg and com_m, and payload = \"NAME\" to the [[log]] of each loaded recording"
    )]
    GainsNeedPayload,
    /// The covariance of the known arm has the wrong size.
    #[error(
        "the covariance of the known arm has {found} rows, but there are {expected} base parameters: give one row for each"
    )]
    ArmCovariance {
        /// Number of base parameters.
        expected: usize,
        /// Rows of the covariance.
        found: usize,
    },
}
