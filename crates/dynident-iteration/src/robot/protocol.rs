//! The messages between an experiment (the host) and a robot program (the client): one JSON object a line. The book's
//! page `robot-protocol.md` describes them with examples.

use super::envelope::Envelope;
use super::ways::RunPart;
use serde::{Deserialize, Serialize};

/// Name and version of the protocol.
pub const PROTOCOL: &str = "dynident-robot/1";

/// What the host writes to the client's standard input.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "kebab-case")]
pub enum ToClient {
    /// Run the trajectory of a file under the controller of a file, by yourself; then the client sends samples and an
    /// end.
    Run {
        /// Number of the run.
        run: usize,
        /// Samples a second that the controller should run at.
        rate_hz: f64,
        /// The trajectory's length, s.
        duration_s: f64,
        /// Path of the trajectory: `t_s, q.., dq.., ddq..` and the model's torques `tau..`, if there is a model.
        trajectory: String,
        /// Path of the controller.
        controller: String,
        /// What no sample may leave, in the order of the client's joints: the client stops by itself where one does.
        #[serde(skip_serializing_if = "Option::is_none")]
        envelope: Option<Envelope>,
        /// The ways from where the robot waits to the trajectory and back, each a table like it: one controller runs
        /// all three without a pause. Only to clients that say that they know it.
        #[serde(skip_serializing_if = "Option::is_none")]
        home: Option<WayFiles>,
    },
    /// A run in steps begins: go to the start and send the state. The ways, where there are some, are part of it.
    Begin {
        /// Number of the run.
        run: usize,
        /// Samples a second.
        rate_hz: f64,
        /// How many torques will come.
        samples: usize,
        /// Positions to start from, rad (m).
        q: Vec<f64>,
        /// Velocities to start with.
        dq: Vec<f64>,
        /// As in a run.
        #[serde(skip_serializing_if = "Option::is_none")]
        envelope: Option<Envelope>,
    },
    /// Hold this torque for one sample, then send the state.
    Torque {
        /// Nm (N).
        tau: Vec<f64>,
    },
    /// The steps are over: stop, and send an end.
    Finish {},
    /// Stop the robot at once, whatever it does, and send an end. It may come at any moment of a run, also in place of
    /// a torque.
    Stop {
        /// Why.
        reason: String,
    },
    /// Nothing more will come.
    Bye {},
}

/// The ways of a run, as files.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WayFiles {
    /// Path of the way to the trajectory's first posture.
    pub approach: String,
    /// Its length, s; 0 where the robot is there already.
    pub approach_s: f64,
    /// Path of the way from its last posture.
    #[serde(rename = "return")]
    pub back: String,
    /// Its length, s.
    pub return_s: f64,
}

/// What the client writes to its standard output. Missing numbers (`null`) are read and distinguished from garbage.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ToHost {
    /// First of all.
    Hello {
        /// [`PROTOCOL`].
        protocol: String,
        /// What the robot is.
        name: String,
        /// Names of its joints, in the order of all its vectors.
        joints: Vec<String>,
        /// Which of `run` and `step` it offers.
        modes: Vec<String>,
        /// What it logs as torque; everything that the drives give, Nm (N), where it does not say.
        #[serde(default)]
        logs: LoggedTorque,
        /// What it can beyond the first version of the protocol: `home` (the ways of a run). Others are not looked at.
        #[serde(default)]
        capabilities: Vec<String>,
    },
    /// One sample of a run.
    Sample {
        /// The part of the run that it belongs to; the motion where it does not say.
        #[serde(default)]
        part: RunPart,
        /// Time since the begin of that part, s.
        t_s: Option<f64>,
        /// Positions, rad (m).
        q: Vec<Option<f64>>,
        /// Velocities, rad/s (m/s), where the robot measures them.
        #[serde(default)]
        dq: Option<Vec<Option<f64>>>,
        /// Torques of the drives, Nm (N).
        tau: Vec<Option<f64>>,
    },
    /// The state in a run by steps.
    State {
        /// Time since the run's begin, s.
        t_s: Option<f64>,
        /// Positions, rad (m).
        q: Vec<Option<f64>>,
        /// Velocities, rad/s (m/s).
        dq: Vec<Option<f64>>,
    },
    /// The run is over.
    End {
        /// `done` or `stopped`.
        status: EndStatus,
        /// Why it stopped.
        #[serde(default)]
        reason: String,
    },
}

/// What a robot logs as `tau`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(tag = "torque", rename_all = "kebab-case", deny_unknown_fields)]
pub enum LoggedTorque {
    /// All that the drives give at the joints, Nm (N).
    #[default]
    Drive,
    /// Currents of the drives, A, which make so much torque at the joint, gear included.
    Current {
        /// Nm/A (N/A) at each joint.
        torque_per_ampere: Vec<f64>,
    },
    /// Torques from which the robot has taken what it adds by itself (gravity, friction).
    Reduced {
        /// What is missing in them.
        without: Vec<String>,
    },
}

/// How a client ends a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EndStatus {
    /// The whole trajectory.
    Done,
    /// Early.
    Stopped,
}

impl ToHost {
    /// The message's type.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Hello { .. } => "hello",
            Self::Sample { .. } => "sample",
            Self::State { .. } => "state",
            Self::End { .. } => "end",
        }
    }
}
