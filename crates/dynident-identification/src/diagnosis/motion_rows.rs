//! A recording as a few hundred instants of its motion: small enough to ask what it would be under another reading.

use crate::logs::Logs;
use crate::recording::LogError;
use crate::regressor_model::RegressorModel;
use crate::rows::motion_band_hz;
use dynident_recording::{DecimationSettings, Decimator, MotionBlock};

/// Instants of a motion with its torques, all in SI and in the model's order of joints.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionRows {
    /// Positions (rad, m), one vector for each joint.
    pub q: Vec<Vec<f64>>,
    /// Velocities.
    pub dq: Vec<Vec<f64>>,
    /// Accelerations.
    pub ddq: Vec<Vec<f64>>,
    /// Torques (N m, N).
    pub tau: Vec<Vec<f64>>,
    /// Instants per second, before thinning.
    pub rate_hz: f64,
}

impl MotionRows {
    /// Recording number `index`: its motion and torque through the parallel filter alike, decimated, and thinned evenly
    /// to at most `most` instants.
    ///
    /// # Errors
    /// A recording that cannot be read.
    pub fn of_recording(logs: &Logs<'_>, model: &RegressorModel, index: usize, most: usize) -> Result<Self, LogError> {
        let recording = &logs.recordings[index];
        let places = recording.places(model.model())?;
        let joints = places.len();
        let mut rows = Self::empty(joints);
        // Of a log at one rate: made with the first block; none where every sample counts.
        let mut decimator: Option<Decimator> = None;
        let (mut segment, mut panel, mut out) = (0, Vec::new(), Vec::new());
        let mut take = |block: &MotionBlock| {
            if rows.rate_hz == 0.0 {
                rows.rate_hz = block.rate_hz;
                let settings = logs.filter.decimation(block.rate_hz, motion_band_hz(&logs.motion));
                // Four times as many rows as a fit takes: short logs would have too few to tell readings apart.
                let settings = settings.map(|s| DecimationSettings { factor: s.factor / 4, ..s });
                decimator = settings
                    .filter(|settings| settings.factor > 1)
                    .map(|settings| Decimator::new(&settings, block.rate_hz, 4 * joints))
                    .transpose()
                    .map_err(|source| LogError::Filter { log: recording.name.clone(), source })?;
            }
            if block.segment != segment {
                segment = block.segment;
                if let Some(decimator) = &mut decimator {
                    decimator.finish();
                }
            }
            // What rests on samples that the filter invented beyond the ends of a piece is no motion.
            let [begin, behind] = block.unsettled;
            let settled = begin..block.rows.saturating_sub(behind).max(begin);
            panel.clear();
            for values in [&block.q, &block.dq, &block.ddq, &block.tau] {
                for &place in &places {
                    panel.extend_from_slice(&block.joint(values, place)[settled.clone()]);
                }
            }
            let (count, filtered) = match &mut decimator {
                Some(decimator) => {
                    let count = decimator.push(&panel, settled.len(), &mut out);
                    (count, &out)
                }
                None => (settled.len(), &panel),
            };
            for (quantity, to) in rows.quantities_mut().into_iter().enumerate() {
                for (joint, to) in to.iter_mut().enumerate() {
                    to.extend_from_slice(&filtered[(quantity * joints + joint) * count..][..count]);
                }
            }
            Ok(())
        };
        logs.pass(model, index).each_block(&mut take)?;
        Ok(rows.thinned(most))
    }

    /// No instants of `joints` joints.
    pub fn empty(joints: usize) -> Self {
        let none = || vec![Vec::new(); joints];
        Self { q: none(), dq: none(), ddq: none(), tau: none(), rate_hz: 0.0 }
    }

    /// Position, velocity and acceleration of all joints at instant number `row`.
    pub(super) fn at(&self, row: usize) -> [Vec<f64>; 3] {
        [&self.q, &self.dq, &self.ddq].map(|values| values.iter().map(|values| values[row]).collect())
    }

    /// Number of instants.
    pub fn len(&self) -> usize {
        self.q.first().map_or(0, Vec::len)
    }

    /// Whether there is no instant.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// At most `most` instants, evenly chosen.
    fn thinned(mut self, most: usize) -> Self {
        let count = self.len();
        if count > most {
            for values in self.quantities_mut().into_iter().flatten() {
                *values = (0..most).map(|k| values[k * count / most]).collect();
            }
        }
        self
    }

    /// Adds the instants of `other`.
    pub fn append(&mut self, other: &Self) {
        self.rate_hz = other.rate_hz;
        let from = [&other.q, &other.dq, &other.ddq, &other.tau];
        for (to, from) in self.quantities_mut().into_iter().zip(from) {
            for (to, from) in to.iter_mut().zip(from) {
                to.extend_from_slice(from);
            }
        }
    }

    fn quantities_mut(&mut self) -> [&mut Vec<Vec<f64>>; 4] {
        [&mut self.q, &mut self.dq, &mut self.ddq, &mut self.tau]
    }
}
