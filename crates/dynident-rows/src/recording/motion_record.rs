//! A motion that is made already.

use dynident_recording::{Log, MotionBlock, MotionSettings};
use std::borrow::Cow;
use std::sync::Arc;

/// A motion that is made already, with its torques: joints in the model's order, one uninterrupted piece.
#[derive(Clone, Debug)]
pub struct MotionRecord {
    /// What messages call it.
    pub label: String,
    /// Positions, velocities, accelerations and torques.
    pub motion: Arc<MotionBlock>,
    /// Sample by sample whether it can be used at all; empty if all can. A filtered row sees none that cannot.
    pub usable: Vec<bool>,
    /// For each joint the times (from, to; s) at which its torque counts; `None` if it always does.
    pub windows: Option<Vec<Vec<[f64; 2]>>>,
    /// The raw samples that it was made from, for estimators that smooth or simulate anew; joints in the model's order.
    pub raw: Option<Log>,
}

impl MotionRecord {
    /// The record as `settings` ask for it: without the lag of the torque that they state.
    pub fn as_set(&self, settings: &MotionSettings) -> Cow<'_, Self> {
        match &settings.torque_lag_s {
            Some(lag_s) => {
                let motion = Arc::new(self.motion.without_torque_lag(lag_s));
                Cow::Owned(Self { motion, ..self.clone() })
            }
            None => Cow::Borrowed(self),
        }
    }

    /// The same with every row, where only samples at the ends do not count.
    pub fn with_every_row(&self) -> Option<Self> {
        let first = self.usable.iter().position(|usable| *usable).unwrap_or(0);
        let last = self.usable.iter().rposition(|usable| *usable).unwrap_or(0);
        let inside = self.usable.get(first..=last).unwrap_or_default();
        let whole = self.windows.is_none() && inside.iter().all(|usable| *usable);
        whole.then(|| Self { usable: Vec::new(), ..self.clone() })
    }
}
