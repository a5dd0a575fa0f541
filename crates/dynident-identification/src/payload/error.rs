//! Errors of payloads, offsets per log, gains and known arms.

use thiserror::Error;

/// Invalid combination of payloads, offsets per log, gains or a known arm.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum PayloadError {
    /// `payload` of a `[[log]]` must be the `name` of a `[[payload]]`. Correct the name, or add the `[[payload]]`.
    #[error("payload = \"{name}\" of a [[log]] is not the name of a [[payload]] (names: {}); use one of these names, or add a [[payload]] with this name",
        if known.is_empty() { "none".to_owned() } else { known.join(", ") })]
    UnknownPayload {
        /// Name of the payload.
        name: String,
        /// Known payloads.
        known: Vec<String>,
    },
    /// `link` of a `[[payload]]` must be a link that moves with a joint, because otherwise the payload has no effect.
    /// Use one of the listed names.
    #[error("[[payload]] link = \"{link}\": no moving link has this name; use one of {}", known.join(", "))]
    UnknownLink {
        /// Name of the link.
        link: String,
        /// Links of the robot.
        known: Vec<String>,
    },
    /// Only logs for validation carry this payload, so that it cannot be estimated. State its mass, or use one of these
    /// logs for training.
    #[error(
        "payload `{name}` is unknown, and no training log contains it: add mass_kg and com_m to its [[payload]], or payload = \"{name}\" to a [[log]] that is not for validation"
    )]
    NotTrained {
        /// Name of the payload.
        name: String,
    },
    /// `[arm]` takes the arm from an earlier result, and the study has no payload to estimate. Add a `[[payload]]`
    /// without a mass, or `refit`.
    #[error(
        "[arm]: the arm is known, and the study has no other unknown: add a [[payload]] without mass_kg and payload = \"NAME\" to its [[log]], or refit = \"offset\" or \"friction\" to [arm]"
    )]
    NothingToEstimate,
    /// `[arm]` takes the arm from an earlier result, whose torques had known gains. They cannot be estimated again.
    #[error(
        "[arm] and drive.gains = \"unknown\": with a known arm the gains are known; remove this key and write the gains as scale under [format.torque]"
    )]
    GainsOfKnownArm,
    /// These quantities add columns to the least squares problem, which only the two named methods support. Change
    /// `estimator.method`, or remove the settings that the message names.
    #[error(
        "payloads, offsets per log, a known arm and unknown gains require estimator.method = \"weighted\" or \"ordinary\", without instruments and without essential: \
         remove the incompatible settings"
    )]
    Estimator,
    /// `[arm]` takes the friction laws from an earlier result, so they cannot be selected again.
    #[error(
        "[arm] and friction = \"auto\": a known arm has the friction of its result; leave friction out, and set refit = \"friction\" to estimate its parameters again"
    )]
    FrictionOfKnownArm,
    /// `[arm]` takes the drive inertia from an earlier result, so it cannot be tested again.
    #[error(
        "[arm]: a known arm has the drive inertia of its result; remove the test of drive inertia (drive.drive_inertia)"
    )]
    DrivesOfKnownArm,
    /// The law `load` uses the load of the joint without payload, which is wrong in logs with a payload.
    #[error(
        "load-dependent friction is not possible with payloads, because its load is that of the bare arm: remove the law `load` from [drive]"
    )]
    LoadFriction,
    /// A drive gain can only be determined by comparing logs with and without a payload of known mass. Record such logs
    /// and declare the payload.
    #[error(
        "drive.gains = \"unknown\" needs training logs both without and with a payload that is known: add a [[payload]] with mass_kg and com_m, and payload = \"NAME\" to the [[log]] of each loaded recording"
    )]
    GainsNeedPayload,
    /// A program passed a covariance of the known arm that does not match its base parameters. Pass the covariance of
    /// the same result.
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
