//! Trajectory of the runs: from a file, or designed.

use crate::error::{Error, StudyError};
use crate::jobs::design::{design_study, trajectory_table};
use crate::jobs::options::RunOptions;
use crate::study::{StudyFile, StudyRobot};
use core::ops::ControlFlow;
use dynident_excitation::{DesignProgress, Motion};
use dynident_simulation::{Reference, SimulationError};
use serde::{Deserialize, Serialize};

/// A trajectory at the controller's rate, with time windows per joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Trajectory {
    /// Sample rate, Hz.
    pub(crate) rate_hz: f64,
    pub(crate) joints: usize,
    pub(crate) samples: usize,
    /// Positions, joint-major, rad (m).
    pub(crate) q: Vec<f64>,
    /// Velocities, joint-major, rad/s (m/s).
    pub(crate) dq: Vec<f64>,
    /// Accelerations, joint-major, rad/s² (m/s²).
    pub(crate) ddq: Vec<f64>,
    /// Time ranges (from, to; s) of each joint that are used in the fit; `None` for the whole motion.
    pub(crate) windows: Option<Vec<Vec<[f64; 2]>>>,
    #[serde(default)]
    pub(crate) strokes: Vec<StrokeSpan>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct StrokeSpan {
    pub(crate) joint: usize,
    /// Start of the motion, s.
    pub(crate) from_s: f64,
    /// End of the motion, s.
    pub(crate) to_s: f64,
}

impl Trajectory {
    pub(crate) fn of_study(
        study: StudyFile<'_>,
        robot: &StudyRobot,
        rate_hz: f64,
        options: &RunOptions<'_>,
        watch: &(dyn Fn(&DesignProgress) -> ControlFlow<()> + Sync),
    ) -> Result<Self, Error> {
        let in_reference = Error::section::<SimulationError>(study.path, "iteration");
        let file = study.iteration.as_ref().and_then(|section| section.trajectory.as_ref());
        if let Some(file) = file {
            let folders = study.folders(options.data.as_deref());
            let path = folders.find(file, None)?;
            let table = trajectory_table(&path, &robot.parametric.joint_names(), &study.motion)?;
            let reference = Reference::of_family(&table.given, &[], rate_hz, None).map_err(in_reference)?;
            return Ok(Self::new(&reference, None));
        }
        if study.design.is_none() {
            let missing =
                StudyError::missing("no trajectory", "name a file with trajectory = \"...\", or give a [design]");
            return Err(Error::section(study.path, "iteration")(missing));
        }
        let outcome = design_study(&study, study.path, options, watch)?;
        let mut strokes = Vec::new();
        let windows = outcome.file.windowed.as_ref().map(|windowed| {
            let mut windows = vec![Vec::new(); robot.model().dof()];
            let mut start_s = 0.0;
            for stroke in &windowed.strokes {
                let Some(joint) = robot.model().joint_index(&stroke.joint) else { continue };
                for middle in [0.25, 0.75] {
                    let centre = start_s + middle * stroke.period_s;
                    windows[joint].push([centre - stroke.window_s, centre + stroke.window_s]);
                }
                strokes.push(StrokeSpan { joint, from_s: start_s, to_s: start_s + stroke.period_s });
                start_s += stroke.period_s;
            }
            windows
        });
        let reference = Reference::of_family(outcome.family(), &outcome.file.parameters, rate_hz, None);
        let reference = reference.map_err(in_reference)?;
        Ok(Self { strokes, ..Self::new(&reference, windows) })
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
            strokes: Vec::new(),
        }
    }

    pub(crate) fn reference(&self) -> Result<Reference, SimulationError> {
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

    /// The part of the motion in which joints move that are not held; the whole trajectory if joints do not move one
    /// after another.
    pub(crate) fn without(&self, held: &[Option<f64>]) -> Result<Self, StudyError> {
        if self.strokes.is_empty() || held.iter().all(Option::is_none) {
            return Ok(self.clone());
        }
        let own = self.strokes.iter().filter(|stroke| held.get(stroke.joint).is_none_or(Option::is_none));
        let span = own.fold([f64::INFINITY, 0.0_f64], |[from, to], s| [from.min(s.from_s), to.max(s.to_s)]);
        let at = |time_s: f64| (time_s * self.rate_hz).round() as usize;
        if span[0] > span[1] || at(span[1]) <= at(span[0]) {
            return Err(StudyError::conflict("hold", "the design has no stroke of a moving joint"));
        }
        let (first, last) = (at(span[0]), at(span[1]).min(self.samples - 1));
        let samples = last + 1 - first;
        let part = |values: &[f64]| -> Vec<f64> {
            values.chunks_exact(self.samples).flat_map(|own| own[first..=last].iter().copied()).collect()
        };
        let start_s = first as f64 / self.rate_hz;
        let earlier = |windows: &[[f64; 2]]| -> Vec<[f64; 2]> {
            windows.iter().map(|[from, to]| [from - start_s, to - start_s]).filter(|[_, to]| *to > 0.0).collect()
        };
        Ok(Self {
            rate_hz: self.rate_hz,
            joints: self.joints,
            samples,
            q: part(&self.q),
            dq: part(&self.dq),
            ddq: part(&self.ddq),
            windows: self.windows.as_ref().map(|windows| windows.iter().map(|own| earlier(own)).collect()),
            strokes: Vec::new(),
        })
    }
}
