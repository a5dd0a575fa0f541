//! What does not go together with payloads, offsets per log, gains and known arms.

use thiserror::Error;

/// Why payloads, offsets per log, gains or a known arm cannot be had as they are asked for.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum PayloadError {
    /// A recording that carries something unknown.
    #[error("a [[log]] carries payload `{name}`, but the [[payload]]s are: {}; name one of them or describe it",
        if known.is_empty() { "none".to_owned() } else { known.join(", ") })]
    UnknownPayload {
        /// What it carries.
        name: String,
        /// The payloads that there are.
        known: Vec<String>,
    },
    /// A link that is not there.
    #[error("payload at link `{link}`: no moving link has that name; they are {}", known.join(", "))]
    UnknownLink {
        /// The link.
        link: String,
        /// The links that there are.
        known: Vec<String>,
    },
    /// A payload to estimate that is only in recordings to test on.
    #[error(
        "payload `{name}` is unknown, and no log to fit to carries it: give its mass_kg and com_m, or a [[log]] with the role \"identify\""
    )]
    NotTrained {
        /// The payload.
        name: String,
    },
    /// A known arm and nothing to estimate.
    #[error(
        "[arm]: the arm is held and nothing is left to estimate: describe a [[payload]] without mass_kg and let a [[log]] carry it, or say what to `refit`"
    )]
    NothingToEstimate,
    /// A known arm with unknown gains.
    #[error(
        "[arm] and drive.gains = \"unknown\": with a known arm the gains are known; state them as torque.scale of the format"
    )]
    GainsOfKnownArm,
    /// An estimator that does not take further columns.
    #[error(
        "payloads, offsets per log, a known arm and unknown gains go with estimator.method = \"weighted\" or \"ordinary\", without instruments and without essential: \
         leave those out"
    )]
    Estimator,
    /// Friction that is to be chosen for an arm that is known.
    #[error(
        "[arm] and friction = \"auto\": a known arm has the friction of its result; leave friction out, with refit = \"friction\" to find its parameters again"
    )]
    FrictionOfKnownArm,
    /// Drive inertia that is to be tested of an arm that is known.
    #[error("[arm]: a known arm has the drive inertia of its result; test none")]
    DrivesOfKnownArm,
    /// Friction that depends on the bare arm's load.
    #[error(
        "load-dependent friction does not go with payloads, for its load is the bare arm's: leave out the law `load`"
    )]
    LoadFriction,
    /// Gains that no recording determines.
    #[error(
        "drive.gains = \"unknown\" needs training logs both without and with a payload that is known: give a [[payload]] with mass_kg and com_m, and a [[log]] that carries it"
    )]
    GainsNeedPayload,
    /// A covariance of the known arm that is not one.
    #[error("{found} covariances of the known arm where {expected} base parameters are: give one for each pair")]
    ArmCovariance {
        /// Base parameters.
        expected: usize,
        /// Rows of the covariance.
        found: usize,
    },
}
