//! A recording of a task: samples, role, and properties.

mod error;
mod motion_record;

pub use error::LogError;
pub use motion_record::MotionRecord;

use dynident_model::Model;
use dynident_recording::filter::CutoffChoice;
use dynident_recording::log::OneOrMany;
use dynident_recording::{Log, MotionBlock, MotionSettings, MotionStream, Reference};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::sync::Arc;

/// Role of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Used to fit the model.
    #[default]
    Identify,
    /// Used to test the model.
    Validate,
}

impl Role {
    /// Name of the role in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Identify => "identify",
            Self::Validate => "validate",
        }
    }
}

/// Source of the motion of a recording.
#[derive(Clone, Debug)]
pub enum Samples {
    /// Raw samples of a file, a stream or arrays, which Dynident resamples, filters and differentiates. Joints are
    /// found by name.
    Log(Box<Log>),
    /// Positions, velocities and accelerations that the caller has prepared, joints in the order of the model.
    Motion(Box<MotionRecord>),
}

/// One recording.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Name in results and messages.
    pub name: String,
    /// Role.
    pub role: Role,
    /// Samples.
    pub samples: Samples,
    /// Commanded motion, joints in the order of the model; required by some differentiators and estimators.
    pub commanded: Option<Arc<Reference>>,
    /// Name of the payload during the recording.
    pub payload: Option<String>,
    /// Properties of the complete recording, if this recording is an excerpt.
    pub whole: Option<Whole>,
}

/// Properties of the complete recording, stored with its [excerpt](crate::excerpts).
#[derive(Clone, Debug)]
pub struct Whole {
    /// Number of rows.
    pub rows: u64,
    /// Cut-off that the positions suggest.
    pub cutoff: CutoffChoice,
    /// Standard deviation of the noise of one sample, joints in the order of the log.
    pub position_noise: Vec<f64>,
}

impl Recording {
    /// A log that is used to fit the model.
    pub fn training(name: impl Into<String>, log: Log) -> Self {
        Self::new(name.into(), Role::Identify, Samples::Log(Box::new(log)))
    }

    /// A log that is used to test the model.
    pub fn held_out(name: impl Into<String>, log: Log) -> Self {
        Self::new(name.into(), Role::Validate, Samples::Log(Box::new(log)))
    }

    /// A prepared motion that is used to fit the model.
    pub fn of_motion(name: impl Into<String>, motion: MotionRecord) -> Self {
        Self::new(name.into(), Role::Identify, Samples::Motion(Box::new(motion)))
    }

    /// A training log whose samples are no longer available, only its factors.
    pub fn without_samples(name: String) -> Self {
        let motion = Arc::new(MotionBlock::default());
        let record = MotionRecord { label: name.clone(), motion, usable: Vec::new(), windows: None, raw: None };
        Self::of_motion(name, record)
    }

    fn new(name: String, role: Role, samples: Samples) -> Self {
        Self { name, role, samples, commanded: None, payload: None, whole: None }
    }

    /// Label of the recording in messages about its rows: the path of a file, or the label of its samples.
    pub fn label(&self) -> String {
        match &self.samples {
            Samples::Log(log) => log.source().label(),
            Samples::Motion(record) => record.label.clone(),
        }
    }

    /// Approximate number of rows.
    pub fn estimated_rows(&self) -> Option<u64> {
        match &self.samples {
            Samples::Log(log) => log.source().estimated_rows(),
            Samples::Motion(record) => Some(record.motion.rows as u64),
        }
    }

    /// The same recording with unusable samples at its ends treated as usable. `None` if samples in between are
    /// unusable.
    pub fn with_every_row(&self) -> Option<Self> {
        match &self.samples {
            Samples::Log(_) => Some(self.clone()),
            Samples::Motion(record) => {
                let record = record.with_every_row()?;
                Some(Self { samples: Samples::Motion(Box::new(record)), ..self.clone() })
            }
        }
    }

    /// Approximate number of rows of the complete recording, also for an excerpt.
    pub fn rows_of_whole(&self) -> Option<u64> {
        self.whole.as_ref().map_or_else(|| self.estimated_rows(), |whole| Some(whole.rows))
    }

    /// Whether the recording has joint temperatures.
    pub fn has_temperature(&self) -> bool {
        match &self.samples {
            Samples::Log(log) => log.format.temperature.is_some(),
            Samples::Motion(record) => !record.motion.temperature_c.is_empty(),
        }
    }

    /// Index in the recording of each joint of the model.
    ///
    /// # Errors
    /// The recording lacks a joint.
    pub fn joint_indices(&self, model: &Model) -> Result<Vec<usize>, LogError> {
        match &self.samples {
            Samples::Log(log) => {
                let place = |name: &String| log.joints.iter().position(|joint| joint == name);
                let of = |joint: &dynident_model::Joint| {
                    place(&joint.name).ok_or_else(|| LogError::NoSuchJoint {
                        log: self.name.clone(),
                        joint: joint.name.clone(),
                        known: log.joints.clone(),
                    })
                };
                model.joints().iter().map(of).collect()
            }
            Samples::Motion(_) => Ok((0..model.dof()).collect()),
        }
    }

    /// Motion settings with their lags in the order of the recording's joints.
    ///
    /// # Errors
    /// The recording lacks a joint.
    pub fn in_log_order<'m>(
        &self,
        model: &Model,
        motion: &'m MotionSettings,
    ) -> Result<Cow<'m, MotionSettings>, LogError> {
        let Some(OneOrMany::Many(lags)) = &motion.torque_lag_s else { return Ok(Cow::Borrowed(motion)) };
        let places = self.joint_indices(model)?;
        if places.iter().enumerate().all(|(joint, place)| joint == *place) || lags.len() != places.len() {
            return Ok(Cow::Borrowed(motion));
        }
        let mut ordered = vec![0.0; lags.len().max(places.iter().max().map_or(0, |place| place + 1))];
        for (lag, place) in lags.iter().zip(places) {
            ordered[place] = *lag;
        }
        Ok(Cow::Owned(MotionSettings { torque_lag_s: Some(OneOrMany::Many(ordered)), ..motion.clone() }))
    }

    /// Opens the log as a stream of positions, velocities, accelerations and torques, with the commanded motion if the
    /// differentiator needs it. `None` for a prepared motion without raw samples.
    ///
    /// # Errors
    /// The log cannot be opened.
    pub fn open(&self, model: &Model, motion: &MotionSettings) -> Result<Option<MotionStream>, LogError> {
        let log = match &self.samples {
            Samples::Log(log) => log,
            Samples::Motion(record) => match &record.raw {
                Some(log) => log,
                None => return Ok(None),
            },
        };
        let reference = match &self.commanded {
            Some(commanded) if motion.differentiator.reference().is_some() => {
                let mut order = vec![0; model.dof()];
                for (joint, &place) in self.joint_indices(model)?.iter().enumerate() {
                    order[place] = joint;
                }
                commanded.reordered(&order).map(Arc::new)
            }
            // The differentiator reports that the commanded motion is missing.
            _ => None,
        };
        let stream = MotionStream::following(log, &*self.in_log_order(model, motion)?, reference.as_ref());
        stream.map(Some).map_err(|source| LogError::recording(&self.name, source))
    }
}
