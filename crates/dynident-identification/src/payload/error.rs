//! Errors of payloads, offsets per log, gains and known arms.

use thiserror::Error;

/// Invalid combination of payloads, offsets per log, gains or a known arm.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum PayloadError {
    /// A recording has an unknown payload.
    #[error("a [[log]] carries payload `{name}`, but the [[payload]]s are: {}; name one of them or describe it",
        if known.is_empty() { "none".to_owned() } else { known.join(", ") })]
    UnknownPayload {
        /// Name of the payload.
        name: String,
        /// Known payloads.
        known: Vec<String>,
    },
    /// The link does not exist.
    #[error("payload at link `{link}`: no moving link has this name; the moving links are {}", known.join(", "))]
    UnknownLink {
        /// Name of the link.
        link: String,
        /// Links of the robot.
        known: Vec<String>,
    },
    /// Only test recordings have the payload to estimate.
    #[error(
        "payload `{name}` is unknown, and no log to fit to carries it: give its mass_kg and com_m, or a [[log]] with the role \"identify\""
    )]
    NotTrained {
        /// Name of the payload.
        name: String,
    },
    /// A known arm without anything to estimate.
    #[error(
        "[arm]: the arm is held and there is nothing to estimate: describe a [[payload]] without mass_kg and name it in a [[log]], or set `refit`"
    )]
    NothingToEstimate,
    /// A known arm with unknown gains.
    #[error(
        "[arm] and drive.gains = \"unknown\": with a known arm the gains are known; state them as torque.scale of the format"
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
    #[error("[arm]: a known arm has the drive inertia of its result; do not test it")]
    DrivesOfKnownArm,
    /// Friction that depends on the load of the bare arm.
    #[error(
        "load-dependent friction is not possible with payloads, because its load is that of the bare arm: leave out the law `load`"
    )]
    LoadFriction,
    /// No recording determines the gains.
    #[error(
        "drive.gains = \"unknown\" needs training logs both without and with a payload that is known: give a [[payload]] with mass_kg and com_m, and a [[log]] that carries it"
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
