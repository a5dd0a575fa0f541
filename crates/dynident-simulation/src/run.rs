//! Result of a run.

use crate::plant::{Plant, PlantFault};
use crate::reference::Reference;
use dynident_excitation::Motion;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// End of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "status", rename_all = "kebab-case")]
pub enum RunStatus {
    /// The run reached the end of the reference.
    Done,
    /// A limit was violated, and the run stopped.
    LimitBroken {
        /// Time, s.
        time_s: f64,
        /// Name of the joint.
        joint: String,
        /// Limited quantity.
        quantity: LimitedQuantity,
        /// Value of the quantity, rad or rad/s (m or m/s).
        value: f64,
        /// The limit.
        limit: f64,
    },
    /// The motion diverged, and the run stopped.
    Diverged {
        /// Time, s.
        time_s: f64,
        /// Reason.
        reason: Divergence,
    },
}

/// Limited quantity of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum LimitedQuantity {
    /// Position.
    Position,
    /// Velocity.
    Speed,
    /// Distance from the reference.
    TrackingError,
}

impl LimitedQuantity {
    fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Speed => "speed",
            Self::TrackingError => "tracking error",
        }
    }
}

/// Reason for a divergence.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Divergence {
    /// The simulation of the robot cannot continue.
    Plant {
        /// Reason.
        fault: PlantFault,
    },
    /// The controller's torque is not finite.
    Torque {
        /// Index of the joint.
        joint: usize,
    },
    /// A velocity that no robot reaches.
    Speed {
        /// Index of the joint.
        joint: usize,
        /// Velocity, rad/s (m/s).
        value: f64,
    },
}

impl core::fmt::Display for Divergence {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Plant { fault } => write!(f, "{fault}"),
            Self::Torque { joint } => {
                write!(f, "the controller's torque of joint {} is not a finite number", joint + 1)
            }
            Self::Speed { joint, value } => write!(f, "joint {} moves at {value:.3e} rad/s", joint + 1),
        }
    }
}

impl RunStatus {
    /// Whether the run reached the end of the reference.
    pub fn is_done(&self) -> bool {
        *self == Self::Done
    }
}

impl core::fmt::Display for RunStatus {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Done => write!(f, "done"),
            Self::LimitBroken { time_s, joint, quantity, value, limit } => {
                write!(
                    f,
                    "stopped at {time_s:.3} s: {} of {joint} is {value:.4}, its limit {limit:.4}",
                    quantity.name()
                )
            }
            Self::Diverged { time_s, reason } => write!(f, "diverged at {time_s:.3} s: {reason}"),
        }
    }
}

/// A run: true motion at every sample of the controller up to its end, measurements of the controller, and tracking
/// errors. Arrays are joint-major: joint `j`, sample `s` at `j * samples + s`. All values are finite in every case.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Names of the joints.
    pub joints: Vec<String>,
    /// Sampling rate, Hz.
    pub rate_hz: f64,
    /// Number of samples of each joint; sample `k` is at the time `k / rate_hz`.
    pub samples: usize,
    /// End of the run.
    pub status: RunStatus,
    /// Reference up to the end of the run.
    pub reference: Arc<Motion>,
    /// True positions, rad (m).
    pub q: Vec<f64>,
    /// True velocities, rad/s (m/s).
    pub dq: Vec<f64>,
    /// True accelerations immediately after each sample, if requested; otherwise empty.
    pub ddq: Vec<f64>,
    /// Torques of the drives from each sample to the next, Nm (N), after the limits.
    pub tau: Vec<f64>,
    /// Positions measured by the controller.
    pub measured_q: Vec<f64>,
    /// Velocities measured by the controller.
    pub measured_dq: Vec<f64>,
    /// Largest true distance from the reference of each joint, rad (m).
    pub max_error: Vec<f64>,
    /// Root mean square of that distance of each joint.
    pub rms_error: Vec<f64>,
    /// Number of samples of each joint with torque at its limit.
    pub saturated: Vec<usize>,
    /// Steps without convergence of the friction torques: see
    /// [`Plant::unsettled_steps`](crate::Plant::unsettled_steps).
    pub unsettled_steps: usize,
}

impl Run {
    /// An empty run with memory for the true motion, but not for measurements.
    pub(crate) fn begin(plant: &Plant, reference: &Reference, accelerations: bool) -> Self {
        let (joints, samples) = (plant.dof(), reference.samples());
        let zeros = || vec![0.0; joints * samples];
        Self {
            joints: plant.model().joints().iter().map(|joint| joint.name.clone()).collect(),
            rate_hz: reference.rate_hz(),
            samples,
            status: RunStatus::Done,
            reference: reference.shared(),
            q: zeros(),
            dq: zeros(),
            ddq: if accelerations { zeros() } else { Vec::new() },
            tau: zeros(),
            measured_q: Vec::new(),
            measured_dq: Vec::new(),
            max_error: vec![0.0; joints],
            rms_error: vec![0.0; joints],
            saturated: vec![0; joints],
            unsettled_steps: 0,
        }
    }

    /// Ends a run after `kept` samples, and converts sums of squares to root mean squares.
    pub(crate) fn end(&mut self, kept: usize) {
        for error in &mut self.rms_error {
            *error = (*error / kept.max(1) as f64).sqrt();
        }
        self.cut(kept);
    }

    /// Index range of one joint in any of the arrays.
    pub fn of(&self, joint: usize) -> core::ops::Range<usize> {
        joint * self.samples..(joint + 1) * self.samples
    }

    /// Time of a sample, s.
    pub fn time_s(&self, sample: usize) -> f64 {
        sample as f64 / self.rate_hz
    }

    /// `q_d - q` of one joint at every sample.
    pub fn tracking_error(&self, joint: usize) -> impl Iterator<Item = f64> + '_ {
        self.reference.q[self.of(joint)].iter().zip(&self.q[self.of(joint)]).map(|(reference, q)| reference - q)
    }

    /// The part of the run with these samples, if the run reached them; times start at the first of these samples.
    /// Numbers of samples at the torque limit and of unsettled steps are those of the whole run.
    #[must_use]
    pub fn of_samples(&self, range: core::ops::Range<usize>) -> Self {
        let (joints, before) = (self.joints.len(), self.samples);
        let range = range.start.min(before)..range.end.min(before);
        let some = |values: &[f64]| -> Vec<f64> {
            if values.len() < joints * before {
                return Vec::new();
            }
            (0..joints).flat_map(|joint| values[joint * before..][range.clone()].iter().copied()).collect()
        };
        let Motion { q, dq, ddq, dddq, .. } = &*self.reference;
        let [q, dq, ddq, dddq] = [q, dq, ddq, dddq].map(|values| some(values));
        let reference = Motion { samples: range.len(), joints, q, dq, ddq, dddq };
        let mut part = Self {
            joints: self.joints.clone(),
            samples: range.len(),
            status: self.status.clone(),
            reference: Arc::new(reference),
            q: some(&self.q),
            dq: some(&self.dq),
            ddq: some(&self.ddq),
            tau: some(&self.tau),
            measured_q: some(&self.measured_q),
            measured_dq: some(&self.measured_dq),
            max_error: vec![0.0; joints],
            rms_error: vec![0.0; joints],
            saturated: self.saturated.clone(),
            ..*self
        };
        for joint in 0..joints {
            let (most, sum) = part
                .tracking_error(joint)
                .fold((0.0_f64, 0.0), |(most, sum), error| (most.max(error.abs()), sum + error * error));
            part.max_error[joint] = most;
            part.rms_error[joint] = (sum / range.len().max(1) as f64).sqrt();
        }
        part
    }

    pub(crate) fn cut(&mut self, samples: usize) {
        let (before, joints) = (self.samples, self.joints.len());
        if samples == before {
            return;
        }
        let reference = Arc::make_mut(&mut self.reference);
        reference.samples = samples;
        let Motion { q, dq, ddq, dddq, .. } = reference;
        let own =
            [&mut self.q, &mut self.dq, &mut self.ddq, &mut self.tau, &mut self.measured_q, &mut self.measured_dq];
        for values in own.into_iter().chain([q, dq, ddq, dddq]) {
            if values.len() == joints * before {
                for joint in 0..joints {
                    values.copy_within(joint * before..joint * before + samples, joint * samples);
                }
                values.truncate(joints * samples);
            }
        }
        self.samples = samples;
    }
}
