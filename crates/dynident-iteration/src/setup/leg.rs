use dynident_dynamics::ParametricModel;
use dynident_recording::{Differentiator, FilterError};
use dynident_simulation::Reference;
use dynident_simulation::{SimulationError, require, require_length};
use std::sync::Arc;

/// One trajectory of a run. A motion of one joint after the other can be one trajectory or several.
#[derive(Clone, Debug)]
pub struct Leg {
    reference: Reference,
    commanded: Arc<dynident_recording::Reference>,
    windows: Option<Vec<Vec<[f64; 2]>>>,
    differentiator: Option<Arc<dyn Differentiator>>,
    payload: Option<String>,
}

impl Leg {
    /// Creates a trajectory of which all samples of all joints are used.
    ///
    /// # Errors
    /// A reference with a single sample.
    pub fn whole(reference: Reference) -> Result<Self, FilterError> {
        Self::new(reference, None)
    }

    /// Creates a trajectory of which the torque of joint j is used only in the time intervals `windows[j]` (from, to;
    /// s), for example around the middle of a move in which only this joint moves.
    ///
    /// # Errors
    /// A reference with a single sample.
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

    /// Returns a copy along another reference, with the same windows, payload and custom differentiator.
    ///
    /// # Errors
    /// A reference with a single sample.
    pub fn along(&self, reference: Reference) -> Result<Self, FilterError> {
        let other = Self::new(reference, self.windows.clone())?;
        Ok(Self { differentiator: self.differentiator.clone(), payload: self.payload.clone(), ..other })
    }

    /// Replaces the commanded motion that differentiators use: logistic functions in closed form instead of samples.
    #[must_use]
    pub fn with_commanded(mut self, commanded: dynident_recording::Reference) -> Self {
        self.commanded = Arc::new(commanded);
        self
    }

    /// Sets a custom differentiator, which replaces the differentiator of the settings.
    #[must_use]
    pub fn with_differentiator(mut self, differentiator: Arc<dyn Differentiator>) -> Self {
        self.differentiator = Some(differentiator);
        self
    }

    /// Sets the payload of the robot, by its name among the payloads of the settings.
    #[must_use]
    pub fn with_payload(mut self, payload: Option<String>) -> Self {
        self.payload = payload;
        self
    }

    /// Name of the robot's payload in this trajectory, if any.
    pub fn payload(&self) -> Option<&str> {
        self.payload.as_deref()
    }

    /// The reference trajectory.
    pub fn reference(&self) -> &Reference {
        &self.reference
    }

    /// The commanded motion that differentiators use.
    pub fn commanded(&self) -> &Arc<dynident_recording::Reference> {
        &self.commanded
    }

    /// The custom differentiator, if any.
    pub fn differentiator(&self) -> Option<&dyn Differentiator> {
        self.differentiator.as_deref()
    }

    /// Whether the torque of `joint` at `time_s` is used.
    pub fn counts(&self, joint: usize, time_s: f64) -> bool {
        let Some(windows) = &self.windows else { return true };
        windows[joint].iter().any(|[from, to]| (*from..=*to).contains(&time_s))
    }

    /// The time windows of each joint; `None` if all samples are used.
    pub fn windows(&self) -> Option<&[Vec<[f64; 2]>]> {
        self.windows.as_deref()
    }
}

/// Task of an iteration: a robot, the trajectories of every run, and known parameters.
#[derive(Clone, Debug)]
pub struct IterationTask {
    /// The robot.
    pub robot: ParametricModel,
    /// The trajectories of every run, in order; only of the first run if motions are [planned](crate::MotionPlanner).
    pub legs: Vec<Leg>,
    /// Base columns with known values: (index of the base column, value). Example: values that were estimated from an
    /// outer joint, for the identification of an inner joint.
    pub known: Vec<(usize, f64)>,
    /// Torque limit of each joint, Nm (N), or infinity. At the end of the iteration, a trajectory that needs more
    /// torque according to the estimated model is rejected.
    pub torque_limits: Option<Vec<f64>>,
}

impl IterationTask {
    /// Creates a task for all joints with one trajectory, without windows or known parameters.
    ///
    /// # Errors
    /// A reference with a single sample.
    pub fn new(robot: ParametricModel, reference: Reference) -> Result<Self, FilterError> {
        Ok(Self { robot, legs: vec![Leg::whole(reference)?], known: Vec::new(), torque_limits: None })
    }

    /// Checks that trajectories and known columns belong to the robot.
    ///
    /// # Errors
    /// No legs, wrong numbers of joints, empty windows, unknown columns, values that are not finite.
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
            require(*column < count, "known column", *column as f64, "use the index of an existing base parameter")?;
            require(value.is_finite(), "known value", *value, "give a finite number")?;
        }
        Ok(())
    }

    pub(crate) fn known_values(&self) -> Vec<Option<f64>> {
        let mut values = vec![None; self.robot.base().count()];
        for (column, value) in &self.known {
            values[*column] = Some(*value);
        }
        values
    }
}
