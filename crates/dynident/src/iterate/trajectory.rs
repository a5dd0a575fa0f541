//! The trajectory of every run: from a file, or designed first.

use crate::design::{design_study, trajectory_table};
use crate::error::Error;
use crate::job::{RunOptions, joint_names};
use crate::machine::Machine;
use crate::study::{Folders, Study};
use core::ops::ControlFlow;
use dynident_excitation::{DesignProgress, Motion};
use dynident_experiment::Reference;
use dynident_experiment::iteration::Leg;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A trajectory at the controller's rate, and the times that count for each joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Trajectory {
    /// Samples a second.
    pub(crate) rate_hz: f64,
    /// Joints.
    pub(crate) joints: usize,
    /// Samples of each joint.
    pub(crate) samples: usize,
    /// Positions, joint by joint.
    pub(crate) q: Vec<f64>,
    /// Speeds.
    pub(crate) dq: Vec<f64>,
    /// Accelerations.
    pub(crate) ddq: Vec<f64>,
    /// For each joint the times (from, to; s) whose rows count; everything without it.
    pub(crate) windows: Option<Vec<Vec<[f64; 2]>>>,
}

impl Trajectory {
    /// The study's trajectory at the controller's rate.
    pub(crate) fn of_study(
        study: &Study,
        study_path: &Path,
        machine: &Machine,
        rate_hz: f64,
        options: &RunOptions<'_>,
        watch: &(dyn Fn(&DesignProgress) -> ControlFlow<()> + Sync),
    ) -> Result<Self, Error> {
        let wrong = |why: &dyn core::fmt::Display| Error::study(study_path, format!("[iteration]: {why}"));
        let file = study.iteration.as_ref().and_then(|section| section.trajectory.as_ref());
        if let Some(file) = file {
            let folders = Folders::new(study, study_path, options.data.as_deref());
            let path = folders.find(file, None)?;
            let table = trajectory_table(&path, &joint_names(machine), &study.motion)?;
            let reference = Reference::of_family(&table.given, &[], rate_hz, None).map_err(|error| wrong(&error))?;
            return Ok(Self::new(&reference, None));
        }
        if study.design.is_none() {
            return Err(wrong(&"no trajectory: name a file with trajectory = \"...\", or give a [design]"));
        }
        let outcome = design_study(study, study_path, options, watch)?;
        let windows = outcome.file.windowed.as_ref().map(|windowed| {
            let mut windows = vec![Vec::new(); machine.model.dof()];
            let mut start_s = 0.0;
            for stroke in &windowed.strokes {
                let Some(joint) = machine.model.joint_index(&stroke.joint) else { continue };
                for middle in [0.25, 0.75] {
                    let centre = start_s + middle * stroke.period_s;
                    windows[joint].push([centre - stroke.window_s, centre + stroke.window_s]);
                }
                start_s += stroke.period_s;
            }
            windows
        });
        let reference = Reference::of_family(outcome.family(), &outcome.file.parameters, rate_hz, None)
            .map_err(|error| wrong(&error))?;
        Ok(Self::new(&reference, windows))
    }

    fn new(reference: &Reference, windows: Option<Vec<Vec<[f64; 2]>>>) -> Self {
        let motion = reference.motion();
        Self {
            rate_hz: reference.rate_hz(),
            joints: motion.joints,
            samples: motion.samples,
            q: motion.q.clone(),
            dq: motion.dq.clone(),
            ddq: motion.ddq.clone(),
            windows,
        }
    }

    /// As a reference for controllers.
    pub(crate) fn reference(&self) -> Result<Reference, dynident_experiment::ExperimentError> {
        let motion = Motion {
            samples: self.samples,
            joints: self.joints,
            q: self.q.clone(),
            dq: self.dq.clone(),
            ddq: self.ddq.clone(),
            dddq: Vec::new(),
        };
        Reference::new(self.rate_hz, motion)
    }

    /// As the leg of every run; its windows count unless every sample does.
    pub(crate) fn leg(&self, every_sample: bool) -> Result<Leg, String> {
        let reference = self.reference().map_err(|error| error.to_string())?;
        match self.windows.as_ref().filter(|_| !every_sample) {
            None => Leg::whole(reference),
            Some(windows) => Leg::windowed(reference, windows.clone()),
        }
        .map_err(|error| error.to_string())
    }

    /// As a motion with room for jerk, which nobody looks at.
    pub(crate) fn motion(&self) -> Motion {
        Motion {
            samples: self.samples,
            joints: self.joints,
            q: self.q.clone(),
            dq: self.dq.clone(),
            ddq: self.ddq.clone(),
            dddq: vec![0.0; self.q.len()],
        }
    }
}
