//! What the robot is asked to follow, and which rows count.

use dynident_dynamics::ParametricModel;
use dynident_recording::{Differentiator, FilterError};
use dynident_simulation::Reference;
use dynident_simulation::{SimulationError, require, require_length};
use std::sync::Arc;

/// One trajectory of a run. The paper moves joint 2 and then joint 1: one leg in which the joints take turns, or
/// two legs.
#[derive(Clone, Debug)]
pub struct Leg {
    reference: Reference,
    commanded: Arc<dynident_recording::Reference>,
    windows: Option<Vec<Vec<[f64; 2]>>>,
    differentiator: Option<Arc<dyn Differentiator>>,
    payload: Option<String>,
}

impl Leg {
    /// A trajectory of which all samples count, for all joints.
    ///
    /// # Errors
    /// A reference of one sample only.
    pub fn whole(reference: Reference) -> Result<Self, FilterError> {
        Self::new(reference, None)
    }

    /// A trajectory of which joint j's torque counts at the times `windows[j]` only (from, to; s): the paper's ±δ about
    /// mid-strokes, while the joint moves alone.
    ///
    /// # Errors
    /// A reference of one sample only.
    pub fn windowed(reference: Reference, windows: Vec<Vec<[f64; 2]>>) -> Result<Self, FilterError> {
        Self::new(reference, Some(windows))
    }

    fn new(reference: Reference, windows: Option<Vec<Vec<[f64; 2]>>>) -> Result<Self, FilterError> {
        let motion = reference.motion();
        let times: Vec<f64> = (0..motion.samples).map(|sample| sample as f64 / reference.rate_hz()).collect();
        let joints: Vec<[Vec<f64>; 3]> = (0..motion.joints)
            .map(|joint| [&motion.q, &motion.dq, &motion.ddq].map(|values| values[motion.of(joint)].to_vec()))
            .collect();
        let commanded = Arc::new(dynident_recording::Reference::sampled(&times, &joints)?);
        Ok(Self { reference, commanded, windows, differentiator: None, payload: None })
    }

    /// The same along another trajectory: windows, payload and a differentiator of one's own stay.
    ///
    /// # Errors
    /// A reference of one sample only.
    pub fn along(&self, reference: Reference) -> Result<Self, FilterError> {
        let other = Self::new(reference, self.windows.clone())?;
        Ok(Self { differentiator: self.differentiator.clone(), payload: self.payload.clone(), ..other })
    }

    /// The same with the commanded motion as differentiators are to know it: strokes in closed form in place of
    /// samples.
    #[must_use]
    pub fn with_commanded(mut self, commanded: dynident_recording::Reference) -> Self {
        self.commanded = Arc::new(commanded);
        self
    }

    /// The same with a differentiator of one's own in place of the settings'.
    #[must_use]
    pub fn with_differentiator(mut self, differentiator: Arc<dyn Differentiator>) -> Self {
        self.differentiator = Some(differentiator);
        self
    }

    /// The same with a payload that the robot carries on it, by its name among the settings' payloads.
    #[must_use]
    pub fn with_payload(mut self, payload: Option<String>) -> Self {
        self.payload = payload;
        self
    }

    /// What the robot carries.
    pub fn payload(&self) -> Option<&str> {
        self.payload.as_deref()
    }

    /// What is followed.
    pub fn reference(&self) -> &Reference {
        &self.reference
    }

    /// The same for differentiators that know the commanded motion.
    pub fn commanded(&self) -> &Arc<dynident_recording::Reference> {
        &self.commanded
    }

    /// The differentiator of one's own, if there is one.
    pub fn differentiator(&self) -> Option<&dyn Differentiator> {
        self.differentiator.as_deref()
    }

    /// Whether the torque of `joint` at `time_s` counts.
    pub fn counts(&self, joint: usize, time_s: f64) -> bool {
        let Some(windows) = &self.windows else { return true };
        windows[joint].iter().any(|[from, to]| (*from..=*to).contains(&time_s))
    }

    /// The windows of each joint, if not everything counts.
    pub fn windows(&self) -> Option<&[Vec<[f64; 2]>]> {
        self.windows.as_deref()
    }
}

/// What an iteration is about: a robot, the trajectories of every run, and parameters that are not looked for.
#[derive(Clone, Debug)]
pub struct IterationTask {
    /// The robot.
    pub robot: ParametricModel,
    /// The trajectories of every run, in order; of the first run only, where the motion is
    /// [planned](crate::MotionPlanner).
    pub legs: Vec<Leg>,
    /// Base columns whose values are given: (place among the base columns, value). Of the paper's joint 1: what joint 2
    /// has shown.
    pub known: Vec<(usize, f64)>,
    /// The largest torque of each joint, Nm (N); infinite where there is none. A trajectory that asks for more by the
    /// model found is refused in the end: tracking it is not a matter of the model.
    pub torque_limits: Option<Vec<f64>>,
}

impl IterationTask {
    /// All joints, one trajectory of which everything counts, nothing known.
    ///
    /// # Errors
    /// A reference of one sample only.
    pub fn new(robot: ParametricModel, reference: Reference) -> Result<Self, FilterError> {
        Ok(Self { robot, legs: vec![Leg::whole(reference)?], known: Vec::new(), torque_limits: None })
    }

    /// Checks that legs and known columns belong to the robot.
    ///
    /// # Errors
    /// No legs, other numbers of joints, windows that are no intervals, columns that do not exist, values that are not
    /// finite.
    pub fn validate(&self) -> Result<(), SimulationError> {
        let dof = self.robot.dof();
        require(!self.legs.is_empty(), "legs", 0.0, "give one or more")?;
        for leg in &self.legs {
            require_length("joints of the reference", dof, leg.reference.joints())?;
            if let Some(windows) = &leg.windows {
                require_length("windows of joints", dof, windows.len())?;
                for [from, to] in windows.iter().flatten() {
                    require(from < to, "window", *from, "give its begin and a later end")?;
                }
            }
        }
        if let Some(limits) = &self.torque_limits {
            require_length("torque limits", dof, limits.len())?;
            for &limit in limits {
                require(limit > 0.0, "torque limit", limit, "give a positive torque")?;
            }
        }
        for (column, value) in &self.known {
            let count = self.robot.base().count();
            require(*column < count, "known column", *column as f64, "there is no such base parameter")?;
            require(value.is_finite(), "known value", *value, "give a finite number")?;
        }
        Ok(())
    }

    /// The known value of each base column, if it has one.
    pub(crate) fn known_values(&self) -> Vec<Option<f64>> {
        let mut values = vec![None; self.robot.base().count()];
        for (column, value) in &self.known {
            values[*column] = Some(*value);
        }
        values
    }
}
