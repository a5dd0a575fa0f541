//! One recording of a task: its samples, what it is for, and what is known about how it was made.

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

/// What a recording is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// The model is fitted to it.
    #[default]
    Identify,
    /// The model is tested on it.
    Validate,
}

impl Role {
    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Identify => "identify",
            Self::Validate => "validate",
        }
    }
}

/// Where the motion of a recording comes from.
#[derive(Clone, Debug)]
pub enum Samples {
    /// Raw samples of a file, a stream or of arrays: clock, filters and derivatives are made here. Joints are found by
    /// name.
    Log(Box<Log>),
    /// A motion that is made already, joints in the model's order.
    Motion(Box<MotionRecord>),
}

/// One recording.
#[derive(Clone, Debug)]
pub struct Recording {
    /// What it is called in results and messages.
    pub name: String,
    /// What it is for.
    pub role: Role,
    /// Its samples.
    pub samples: Samples,
    /// The motion that was commanded, joints in the model's order: for differentiators and estimators that need it.
    pub commanded: Option<Arc<Reference>>,
    /// The payload that it was recorded with, by name.
    pub payload: Option<String>,
    /// What is known of the longer recording that it is an excerpt of; none where it is whole.
    pub whole: Option<Whole>,
}

/// What a recording says that is kept as an [excerpt](crate::excerpt), at the excerpt's rate.
#[derive(Clone, Debug)]
pub struct Whole {
    /// Rows of the whole.
    pub rows: u64,
    /// The cut-off that the whole's positions suggest.
    pub cutoff: CutoffChoice,
    /// Standard deviation of the noise of one sample, in the log's order of joints.
    pub position_noise: Vec<f64>,
}

impl Recording {
    /// A log to fit to.
    pub fn training(name: impl Into<String>, log: Log) -> Self {
        Self::new(name.into(), Role::Identify, Samples::Log(Box::new(log)))
    }

    /// A log to test on.
    pub fn held_out(name: impl Into<String>, log: Log) -> Self {
        Self::new(name.into(), Role::Validate, Samples::Log(Box::new(log)))
    }

    /// A motion that is made already, to fit to.
    pub fn of_motion(name: impl Into<String>, motion: MotionRecord) -> Self {
        Self::new(name.into(), Role::Identify, Samples::Motion(Box::new(motion)))
    }

    /// A log to fit to of which only factors are left: a name, and no sample to pass over.
    pub fn without_samples(name: String) -> Self {
        let motion = Arc::new(MotionBlock::default());
        let record = MotionRecord { label: name.clone(), motion, usable: Vec::new(), windows: None, raw: None };
        Self::of_motion(name, record)
    }

    fn new(name: String, role: Role, samples: Samples) -> Self {
        Self { name, role, samples, commanded: None, payload: None, whole: None }
    }

    /// What messages about its rows call it: a file's path, or the label of its samples.
    pub fn label(&self) -> String {
        match &self.samples {
            Samples::Log(log) => log.source().label(),
            Samples::Motion(record) => record.label.clone(),
        }
    }

    /// Rows, about.
    pub fn estimated_rows(&self) -> Option<u64> {
        match &self.samples {
            Samples::Log(log) => log.source().estimated_rows(),
            Samples::Motion(record) => Some(record.motion.rows as u64),
        }
    }

    /// The same with every row, where only a few samples at the ends do not count: for what needs rows without a gap.
    /// `None` where rows inside do not count.
    pub fn with_every_row(&self) -> Option<Self> {
        match &self.samples {
            Samples::Log(_) => Some(self.clone()),
            Samples::Motion(record) => {
                let record = record.with_every_row()?;
                Some(Self { samples: Samples::Motion(Box::new(record)), ..self.clone() })
            }
        }
    }

    /// Rows of what it is an excerpt of, or its own, about.
    pub fn rows_of_whole(&self) -> Option<u64> {
        self.whole.as_ref().map_or_else(|| self.estimated_rows(), |whole| Some(whole.rows))
    }

    /// Whether it has the temperatures of the joints.
    pub fn has_temperature(&self) -> bool {
        match &self.samples {
            Samples::Log(log) => log.format.temperature.is_some(),
            Samples::Motion(record) => !record.motion.temperature_c.is_empty(),
        }
    }

    /// For each joint of the model its place among the recording's joints.
    ///
    /// # Errors
    /// A joint that the recording does not have.
    pub fn places(&self, model: &Model) -> Result<Vec<usize>, LogError> {
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

    /// Settings whose lags stand in the order of the recording's joints.
    ///
    /// # Errors
    /// A joint that the recording does not have.
    pub fn in_log_order<'m>(
        &self,
        model: &Model,
        motion: &'m MotionSettings,
    ) -> Result<Cow<'m, MotionSettings>, LogError> {
        let Some(OneOrMany::Many(lags)) = &motion.torque_lag_s else { return Ok(Cow::Borrowed(motion)) };
        let places = self.places(model)?;
        if places.iter().enumerate().all(|(joint, place)| joint == *place) || lags.len() != places.len() {
            return Ok(Cow::Borrowed(motion));
        }
        let mut ordered = vec![0.0; lags.len().max(places.iter().max().map_or(0, |place| place + 1))];
        for (lag, place) in lags.iter().zip(places) {
            ordered[place] = *lag;
        }
        Ok(Cow::Owned(MotionSettings { torque_lag_s: Some(OneOrMany::Many(ordered)), ..motion.clone() }))
    }

    /// Its log on the way to a motion, with these settings; the commanded motion goes along where the differentiator
    /// needs it. `None` for a motion that is made already and whose raw samples are not at hand.
    ///
    /// # Errors
    /// What opening it can give.
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
                for (joint, &place) in self.places(model)?.iter().enumerate() {
                    order[place] = joint;
                }
                commanded.reordered(&order).map(Arc::new)
            }
            // The differentiator says that it needs one.
            _ => None,
        };
        let stream = MotionStream::following(log, &*self.in_log_order(model, motion)?, reference.as_ref());
        stream.map(Some).map_err(|source| LogError::recording(&self.name, source))
    }
}
