//! Messages between Dynident (host) and a robot program (client): one JSON object per line. See the page
//! `robot-protocol.md` of the book.

use super::envelope::Envelope;
use super::ways::RunPart;
use serde::{Deserialize, Serialize};

/// Name and version of the protocol.
pub const PROTOCOL: &str = "dynident-robot/1";

/// Messages of the host, on the client's standard input.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "kebab-case")]
pub enum ToClient {
    /// Run the trajectory of a file with the controller of a file; the client then sends samples and an end.
    Run {
        /// Number of the run.
        run: usize,
        /// Rate of the controller, Hz.
        rate_hz: f64,
        /// Duration of the trajectory, s.
        duration_s: f64,
        /// Path of the trajectory: `t_s, q.., dq.., ddq..` and the model's torques `tau..`, if there is a model.
        trajectory: String,
        /// Path of the controller's file.
        controller: String,
        /// Limits of every sample, in the order of the client's joints; the client itself stops if a sample exceeds
        /// them.
        #[serde(skip_serializing_if = "Option::is_none")]
        envelope: Option<Envelope>,
        /// Paths from the home posture to the trajectory and back, each a table like the trajectory. One controller
        /// runs all three without a pause. Only for clients with the capability `home`.
        #[serde(skip_serializing_if = "Option::is_none")]
        home: Option<WayFiles>,
    },
    /// Begin of a run in mode `step`: move to the start and send the state. The paths from and to the home posture
    /// are part of the run.
    Begin {
        /// Number of the run.
        run: usize,
        /// Sampling rate, Hz.
        rate_hz: f64,
        /// Number of torques that follow.
        samples: usize,
        /// Start positions, rad (m).
        q: Vec<f64>,
        /// Start velocities, rad/s (m/s).
        dq: Vec<f64>,
        /// Limits of every sample, as in [`ToClient::Run`].
        #[serde(skip_serializing_if = "Option::is_none")]
        envelope: Option<Envelope>,
    },
    /// Apply this torque for one sample, then send the state.
    Torque {
        /// Torques of the drives, Nm (N).
        tau: Vec<f64>,
    },
    /// The run is complete: stop, and send an end.
    Finish {},
    /// Stop the robot immediately and send an end. This message can arrive at any time of a run, also instead of a
    /// torque.
    Stop {
        /// Why.
        reason: String,
    },
    /// Last message: the program must end.
    Bye {},
}

/// Files of the paths from and to the home posture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WayFiles {
    /// Path of the file of the approach to the trajectory's first posture.
    pub approach: String,
    /// Duration of the approach, s; 0 if the robot is already there.
    pub approach_s: f64,
    /// Path of the file of the return from the last posture.
    #[serde(rename = "return")]
    pub back: String,
    /// Duration of the return, s.
    pub return_s: f64,
}

/// Messages of the client, on its standard output. Missing numbers (`null`) are accepted, and distinguished from
/// invalid messages.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ToHost {
    /// First message of the client.
    Hello {
        /// Name and version of the protocol, [`PROTOCOL`].
        protocol: String,
        /// Name of the robot.
        name: String,
        /// Names of the joints, in the order of all vectors.
        joints: Vec<String>,
        /// Supported modes: `run`, `step`.
        modes: Vec<String>,
        /// Quantity that is logged as torque; default the complete drive torque, Nm (N).
        #[serde(default)]
        logs: LoggedTorque,
        /// Capabilities beyond the first version of the protocol: `home` (the client runs approach and return paths).
        /// Unknown ones are ignored.
        #[serde(default)]
        capabilities: Vec<String>,
    },
    /// One sample of a run.
    Sample {
        /// The part of the run; default the motion.
        #[serde(default)]
        part: RunPart,
        /// Time since the beginning of this part, s.
        t_s: Option<f64>,
        /// Positions, rad (m).
        q: Vec<Option<f64>>,
        /// Velocities, rad/s (m/s), if the robot measures them.
        #[serde(default)]
        dq: Option<Vec<Option<f64>>>,
        /// Torques of the drives, Nm (N).
        tau: Vec<Option<f64>>,
    },
    /// The state of the robot in mode `step`.
    State {
        /// Time since the beginning of the run, s.
        t_s: Option<f64>,
        /// Positions, rad (m).
        q: Vec<Option<f64>>,
        /// Velocities, rad/s (m/s).
        dq: Vec<Option<f64>>,
    },
    /// End of the run.
    End {
        /// `done` or `stopped`.
        status: EndStatus,
        /// Reason for the stop.
        #[serde(default)]
        reason: String,
    },
}

/// Quantity that a robot logs as `tau`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(tag = "torque", rename_all = "kebab-case", deny_unknown_fields)]
pub enum LoggedTorque {
    /// Complete torque of the drives at the joints, Nm (N).
    #[default]
    Drive,
    /// Currents of the drives, A, with the joint torque per ampere, gear included.
    Current {
        /// Joint torque per ampere, Nm/A (N/A), for each joint.
        torque_per_ampere: Vec<f64>,
    },
    /// Torques without parts that the robot adds itself (gravity, friction).
    Reduced {
        /// The missing parts.
        without: Vec<String>,
    },
}

/// How a client ends a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EndStatus {
    /// The trajectory was completed.
    Done,
    /// The run was stopped early.
    Stopped,
}

impl ToHost {
    /// Type of the message.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Hello { .. } => "hello",
            Self::Sample { .. } => "sample",
            Self::State { .. } => "state",
            Self::End { .. } => "end",
        }
    }
}
