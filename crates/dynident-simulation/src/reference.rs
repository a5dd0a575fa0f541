//! Reference trajectory of a run at the controller's samples.

use crate::controllers::Target;
use crate::error::{SimulationError, require, require_length};
use dynident_excitation::{Family, Motion};
use std::sync::Arc;

/// Maximum number of samples of a run (28 hours at 1 kHz); a larger number is a typing error.
const MAX_SAMPLES: f64 = 1e8;

/// A reference trajectory sampled at the controller's rate: sample `k` is at the time `k / rate_hz`.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    rate_hz: f64,
    motion: Arc<Motion>,
}

impl Reference {
    /// Creates the reference from the samples of `motion`, whose jerk is not used.
    ///
    /// # Errors
    /// A rate that is not positive, no samples, arrays of the wrong length, a value that is not finite.
    pub fn new(rate_hz: f64, motion: Motion) -> Result<Self, SimulationError> {
        require_rate(rate_hz)?;
        require(motion.samples >= 1 && motion.joints >= 1, "samples of the reference", 0.0, "give one or more")?;
        for (what, values) in [
            ("reference positions", &motion.q),
            ("reference speeds", &motion.dq),
            ("reference accelerations", &motion.ddq),
        ] {
            require_length(what, motion.samples * motion.joints, values.len())?;
            for &value in values {
                require(value.is_finite(), what, value, "give finite numbers")?;
            }
        }
        Ok(Self { rate_hz, motion: Arc::new(motion) })
    }

    /// Samples a trajectory of a family over its whole duration, or over `duration_s` of it.
    ///
    /// # Errors
    /// A wrong number of parameters, a rate or duration that is not positive or results in too many samples, a motion
    /// that is not finite.
    pub fn of_family(
        family: &dyn Family,
        parameters: &[f64],
        rate_hz: f64,
        duration_s: Option<f64>,
    ) -> Result<Self, SimulationError> {
        require_rate(rate_hz)?;
        require_length(format!("parameters of {}", family.name()), family.parameters(), parameters.len())?;
        let duration_s = duration_s.unwrap_or(family.duration_s());
        let within = duration_s > 0.0 && duration_s <= family.duration_s() * (1.0 + 1e-12);
        require(within, "duration_s", duration_s, "give more than 0, at most the duration of the trajectory")?;
        require(
            duration_s * rate_hz < MAX_SAMPLES,
            "duration_s",
            duration_s,
            "give a duration of at most 1e8 samples",
        )?;
        // The tolerance includes a last sample exactly at the end.
        let last = (duration_s * rate_hz + 1e-9).floor() as usize;
        let times: Vec<f64> = (0..=last).map(|sample| (sample as f64 / rate_hz).min(family.duration_s())).collect();
        let mut motion = Motion::default();
        family.motion(parameters, &times, &mut motion);
        Self::new(rate_hz, motion)
    }

    /// Rest at `q` for `duration_s`.
    ///
    /// # Errors
    /// A rate or duration that is not positive or results in too many samples, positions that are not finite.
    pub fn standing(q: &[f64], rate_hz: f64, duration_s: f64) -> Result<Self, SimulationError> {
        require_rate(rate_hz)?;
        let some = duration_s > 0.0 && duration_s * rate_hz < MAX_SAMPLES;
        require(some, "duration_s", duration_s, "give more than 0, and at most 1e8 samples")?;
        let samples = (duration_s * rate_hz + 1e-9).floor() as usize + 1;
        let mut motion = Motion::default();
        motion.reset(q.len(), samples);
        for (joint, &q) in q.iter().enumerate() {
            let own = motion.of(joint);
            motion.q[own].fill(q);
        }
        Self::new(rate_hz, motion)
    }

    /// Holds a joint at a constant position.
    ///
    /// # Errors
    /// A missing joint, a position that is not finite.
    pub fn with_joint_held(mut self, joint: usize, position: f64) -> Result<Self, SimulationError> {
        require(joint < self.joints(), "joint held", joint as f64, "give the index of an existing joint")?;
        require(position.is_finite(), "position held", position, "give a finite position")?;
        let motion = Arc::make_mut(&mut self.motion);
        let own = motion.of(joint);
        motion.q[own.clone()].fill(position);
        motion.dq[own.clone()].fill(0.0);
        motion.ddq[own.clone()].fill(0.0);
        if motion.dddq.len() == motion.q.len() {
            motion.dddq[own].fill(0.0);
        }
        Ok(self)
    }

    /// Rate of the controller, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Samples, joint-major.
    pub fn motion(&self) -> &Motion {
        &self.motion
    }

    pub(crate) fn shared(&self) -> Arc<Motion> {
        Arc::clone(&self.motion)
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.motion.joints
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.motion.samples
    }

    /// Time of the last sample, s.
    pub fn duration_s(&self) -> f64 {
        (self.samples() - 1) as f64 / self.rate_hz
    }
}

/// One sample of a reference.
#[derive(Clone, Debug)]
pub struct ReferenceSample {
    q: Vec<f64>,
    dq: Vec<f64>,
    ddq: Vec<f64>,
}

impl ReferenceSample {
    /// Zeros for a number of joints.
    pub fn new(joints: usize) -> Self {
        Self { q: vec![0.0; joints], dq: vec![0.0; joints], ddq: vec![0.0; joints] }
    }

    /// Copies sample number `sample` of a reference with the same number of joints.
    ///
    /// # Panics
    /// If the reference has fewer joints or samples.
    #[inline]
    pub fn take(&mut self, reference: &Reference, sample: usize) {
        let Motion { samples, q, dq, ddq, .. } = &*reference.motion;
        for joint in 0..self.q.len() {
            let at = joint * samples + sample;
            (self.q[joint], self.dq[joint], self.ddq[joint]) = (q[at], dq[at], ddq[at]);
        }
    }

    /// Returns a view of the sample for controllers.
    pub fn target(&self) -> Target<'_> {
        Target { q: &self.q, dq: &self.dq, ddq: &self.ddq }
    }
}

fn require_rate(rate_hz: f64) -> Result<(), SimulationError> {
    require((1e-3..=1e6).contains(&rate_hz), "rate_hz", rate_hz, "give 0.001 to 1e6 samples a second")
}
