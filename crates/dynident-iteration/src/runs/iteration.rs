use crate::estimation::estimate::RunEstimate;
use crate::estimation::run_motion::legs_along;
use crate::evidence::held_out_motion::HeldOutMotion;
use crate::planning::planner::MotionPlanner;
use crate::policy::convergence::{Names, UnmetCondition, shortfalls};
use crate::policy::friction_chosen::friction_chosen;
use crate::policy::next_step::{self, Next};
use crate::policy::record::RunRecord;
use crate::setup::error::IterationError;
use crate::setup::leg::{IterationTask, Leg};
use crate::setup::model_parameters::ModelParameters;
use crate::setup::parameter_shares::parameter_shares;
use crate::setup::settings::{IterationSettings, RunIdentificationSettings};
use crate::setup::status::IterationStatus;
use dynident_dynamics::ParametricModel;
use dynident_identification::friction::{FrictionSource, chosen_model};
use dynident_simulation::SimulationError;
use dynident_simulation::controllers::ControllerModel;
use std::borrow::Cow;
use std::sync::Arc;

/// Ratio of torque to limit above which the limit is violated; slightly above 1 because of rounding.
const MAX_TORQUE_LIMIT_RATIO: f64 = 1.001;

/// A task with its settings; [`iterate()`](crate::iterate()) executes it.
#[derive(Clone, Debug)]
pub struct Iteration {
    pub(crate) task: IterationTask,
    pub(crate) settings: IterationSettings,
    pub(crate) planner: Option<Arc<dyn MotionPlanner>>,
    pub(crate) held_out: Option<HeldOutMotion>,
}

impl Iteration {
    /// Creates the iteration of a task.
    ///
    /// # Errors
    /// Same as for [`IterationTask::validate`] and [`IterationSettings::validate`].
    pub fn new(task: IterationTask, settings: IterationSettings) -> Result<Self, SimulationError> {
        task.validate()?;
        settings.validate(task.robot.dof())?;
        Ok(Self { task, settings, planner: None, held_out: None })
    }

    /// Returns the iteration with a planner, which replaces the motion of the task in every run after the first good
    /// one.
    #[must_use]
    pub fn with_planner(mut self, planner: Arc<dyn MotionPlanner>) -> Self {
        self.planner = Some(planner);
        self
    }

    /// The task.
    pub fn task(&self) -> &IterationTask {
        &self.task
    }

    /// The settings.
    pub fn settings(&self) -> &IterationSettings {
        &self.settings
    }

    /// Lowest frequency at which oscillations are detected, Hz.
    pub(crate) fn lowest_oscillation_hz(&self) -> f64 {
        self.settings.safety.oscillation.lowest_hz(self.task.robot.model())
    }

    /// Returns the trajectories of a run: those of the task, or the run's own trajectories.
    ///
    /// # Errors
    /// A record of another task.
    pub fn legs_of(&self, record: &RunRecord) -> Result<Cow<'_, [Leg]>, IterationError> {
        legs_along(&self.task, record.motion.as_ref())
    }

    /// Returns the next step, as a pure function of these records. With a motion planner, an iteration that has
    /// converged can continue with a motion whose forecast gain is large enough.
    ///
    /// # Errors
    /// Records of another robot.
    pub fn next(&self, records: &[RunRecord]) -> Result<Next, IterationError> {
        let robot = self.robot(records)?;
        let next = next_step::next(records, &self.settings, robot.nominal(), &self.names(&robot, records)?);
        if let Next::Finished(IterationStatus::Converged | IterationStatus::Settled | IterationStatus::RunsUsedUp) =
            next
            && let Some(reason) = self.beyond_torque(records)?
        {
            return Ok(Next::Finished(IterationStatus::Refused { reason }));
        }
        Ok(next)
    }

    /// Returns the conditions that are not met after these records; empty if the iteration has converged.
    ///
    /// # Errors
    /// Records of another robot.
    pub fn shortfalls(&self, records: &[RunRecord]) -> Result<Vec<UnmetCondition>, IterationError> {
        let robot = self.robot(records)?;
        Ok(shortfalls(records, &self.settings, &self.names(&robot, records)?))
    }

    /// Names of joints and parameters, and the share of each parameter in the torque along the motion of the last
    /// run.
    pub(crate) fn names(&self, robot: &ParametricModel, records: &[RunRecord]) -> Result<Names, IterationError> {
        let shown = records.last().and_then(|last| Some((last, last.evidence.as_ref()?)));
        let shares = match shown {
            Some((last, evidence)) => {
                let torque_rms: Vec<f64> = evidence.joints.iter().map(|joint| joint.torque_rms).collect();
                parameter_shares(robot, &self.legs_of(last)?, &torque_rms)
            }
            None => Vec::new(),
        };
        let most_lag_s = self.settings.settled.most_lag_s(robot.model());
        Ok(Names {
            joints: robot.joint_names(),
            parameters: robot.base().expressions(),
            shares,
            most_lag_s,
            held_out: self.held_out.is_some(),
        })
    }

    /// Checks whether, according to the last good model, the trajectories need more torque than the joint limits.
    fn beyond_torque(&self, records: &[RunRecord]) -> Result<Option<String>, IterationError> {
        let Some(limits) = &self.task.torque_limits else { return Ok(None) };
        let good = records.iter().rev().find(|record| record.accepted).and_then(RunRecord::knowledge);
        let Some(parameters) = good.and_then(RunEstimate::for_controller) else { return Ok(None) };
        let mut model = self.controller_model(records, &parameters)?;
        let dof = self.task.robot.dof();
        let mut tau = vec![0.0; dof];
        let motion = records.last().and_then(|record| record.motion.as_ref());
        for leg in &*legs_along(&self.task, motion)? {
            let (motion, rate_hz) = (leg.reference().motion(), leg.reference().rate_hz());
            for sample in 0..motion.samples {
                let at = |values: &[f64]| -> Vec<f64> {
                    (0..dof).map(|joint| values[joint * motion.samples + sample]).collect()
                };
                model.reference_torque(&at(&motion.q), &at(&motion.dq), &at(&motion.ddq), &mut tau);
                for (joint, (tau, limit)) in tau.iter().zip(limits).enumerate() {
                    if tau.abs() > limit * MAX_TORQUE_LIMIT_RATIO {
                        let name = &self.task.robot.model().joints()[joint].name;
                        return Ok(Some(format!(
                            "joint {name} needs {:.3} Nm at {:.2} s of the trajectory (estimated model), above its limit of {limit:.3} Nm: use another trajectory",
                            tau.abs(),
                            sample as f64 / rate_hz
                        )));
                    }
                }
            }
        }
        Ok(None)
    }

    /// Returns the robot with the friction that an earlier run selected.
    ///
    /// # Errors
    /// Friction terms that do not fit this robot: the run belongs to another robot.
    pub fn robot(&self, records: &[RunRecord]) -> Result<Cow<'_, ParametricModel>, IterationError> {
        let choices = records.iter().filter_map(|record| Some((record.run, &record.estimate.as_ref()?.friction)));
        let Some((run, choice)) = choices.into_iter().find(|(_, choice)| !choice.is_empty()) else {
            return Ok(Cow::Borrowed(&self.task.robot));
        };
        let chosen = chosen_model(&self.task.robot, choice);
        chosen.map(Cow::Owned).map_err(|source| IterationError::ChosenFriction { run, source })
    }

    /// Returns the task and the identification settings, with the friction that an earlier run selected.
    pub(crate) fn in_force(
        &self,
        before: &[RunRecord],
    ) -> Result<(Cow<'_, IterationTask>, Cow<'_, RunIdentificationSettings>), IterationError> {
        let settings = &self.settings.identification;
        Ok(match self.robot(before)? {
            Cow::Borrowed(_) => (Cow::Borrowed(&self.task), Cow::Borrowed(settings)),
            Cow::Owned(robot) => (
                Cow::Owned(IterationTask { robot, ..self.task.clone() }),
                Cow::Owned(RunIdentificationSettings {
                    friction: FrictionSource::SelectedBefore(friction_chosen(before)),
                    ..settings.clone()
                }),
            ),
        })
    }

    /// Returns the controller model with these parameters, after these records.
    ///
    /// # Errors
    /// Parameters of another robot.
    pub fn controller_model(
        &self,
        records: &[RunRecord],
        parameters: &ModelParameters,
    ) -> Result<ControllerModel, IterationError> {
        let robot = self.robot(records)?;
        Ok(match parameters {
            ModelParameters::All(values) => ControllerModel::from_parameters(robot.model(), robot.terms(), values)?,
            ModelParameters::Base(values) => {
                ControllerModel::from_columns(robot.model(), &robot.base().base_columns(), values)?
            }
        })
    }
}
