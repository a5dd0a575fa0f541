//! Prepared motions.

use dynident_recording::{Log, MotionBlock, MotionSettings};
use std::borrow::Cow;
use std::sync::Arc;

/// A prepared motion with its torques: joints in the order of the model, one uninterrupted piece.
#[derive(Clone, Debug)]
pub struct MotionRecord {
    /// Label in messages.
    pub label: String,
    /// Positions, velocities, accelerations and torques.
    pub motion: Arc<MotionBlock>,
    /// Whether each sample is usable; empty if all are. A filtered row uses no unusable sample.
    pub usable: Vec<bool>,
    /// For each joint the intervals (from, to; s) with valid torque; `None` if torque is always valid.
    pub windows: Option<Vec<Vec<[f64; 2]>>>,
    /// Raw samples of the same motion, joints in the order of the model, for estimators that smooth the positions or
    /// simulate the motion.
    pub raw: Option<Log>,
}

impl MotionRecord {
    /// The motion with the torque lag that `settings` state corrected.
    pub fn as_set(&self, settings: &MotionSettings) -> Cow<'_, Self> {
        match &settings.torque_lag_s {
            Some(lag_s) => {
                let motion = Arc::new(self.motion.without_torque_lag(lag_s));
                Cow::Owned(Self { motion, ..self.clone() })
            }
            None => Cow::Borrowed(self),
        }
    }

    /// The same motion with unusable samples at its ends treated as usable. `None` if samples in between are unusable.
    pub fn with_every_row(&self) -> Option<Self> {
        let first = self.usable.iter().position(|usable| *usable).unwrap_or(0);
        let last = self.usable.iter().rposition(|usable| *usable).unwrap_or(0);
        let inside = self.usable.get(first..=last).unwrap_or_default();
        let whole = self.windows.is_none() && inside.iter().all(|usable| *usable);
        whole.then(|| Self { usable: Vec::new(), ..self.clone() })
    }
}
